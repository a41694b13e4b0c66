#!/usr/bin/env python3
"""lf-prune in numpy: the voxels that may hold light, by dense ray tracing with a multiplicative line of sight.

    make -f scripts/pipeline.mk PRUNE='python3 scripts/examples/prune.py'

The centre ray of every section of the aperture is traced from every voxel to a pixel. A voxel is kept if the geometric
mean of its pixels, each within two limits, is at least --threshold of the image's brightest pixel. Sections that are
dark under all lenslets do not count.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))
import lf

DARK, BRIGHT = 1 / 50, 2  # Limits of a pixel, in thresholds: neither a dark nor a bright pixel must decide alone.
LIT = 0.4  # Minimum light of a section, as a share of that of three quarters of the sections.
SEEN = 0.5  # Minimum share of a voxel's rays that must meet the sensor.
FAINT, USUAL = 0.05, 0.2  # Thresholds over the mean brightness of the light: the lower one if it keeps few voxels.
MOST_KEPT = 0.5  # Largest share of the voxels that the lower threshold may keep.


def automatic(image, share):
    """lf-prune's threshold, as a share of the brightest pixel: a share of the mean brightness of the light, or the
    noise if that is more. The noise is the scatter in the darkest twentieth of the tiles of 4 x 4 px."""
    height, width = (n - n % 4 for n in image.shape)
    tiles = image[:height, :width].reshape(height // 4, 4, width // 4, 4).swapaxes(1, 2).reshape(-1, 16)
    dark = tiles[np.argsort(tiles.mean(1))[: -(-len(tiles) // 20)]]
    noise = np.sort(dark.std(1, ddof=1))[len(dark) // 2] if len(dark) else 0
    light = image[~np.isnan(image)].astype(float)
    return min(max(share * (light**2).sum() / light.sum(), noise) / light.max(), 1.0)


def lit_sections(image, camera):
    """Centres (U, V), mm, of the sections that let light through: (sections, 2). Every particle lights all sections
    alike, so the mean over the lenslets' images shows which are dark."""
    half = [0.5 * n * camera.pixel_mm + camera.pitch_mm for n in camera.sensor_px]
    x, y = np.meshgrid(*(np.arange(-side, side, 0.5 * camera.pitch_mm) for side in half))
    centres = np.unique(np.round(np.stack(camera.centre_mm(x, y), -1).reshape(-1, 2), 9), axis=0)
    values = image[~np.isnan(image)].astype(float)
    brightness = (values**2).sum() / max(values.sum(), 1e-300)
    light = np.minimum(np.where(image >= 0.1 * brightness, image, 0), brightness)
    sections = camera.sections_mm()
    means = []
    for section in sections:
        # The image of a lenslet's centre through the section.
        column, row = (np.floor(place).astype(int) for place in camera.through_px(centres.T, centres.T, *section))
        seen = (column >= 0) & (row >= 0) & (column < camera.sensor_px[0]) & (row < camera.sensor_px[1])
        seen[seen] = ~np.isnan(image[row[seen], column[seen]])
        means.append(light[row[seen], column[seen]].mean() if seen.any() else 0)
    return sections[means >= LIT * np.sort(means)[len(means) * 3 // 4]]


def prune(image, camera, grid, threshold):
    """Indices (n,) of the voxels kept, and their scores (n,) in counts. `image` is (height, width), NaN where blind."""
    peak = np.nanmax(image)
    # Real part: what a pixel adds to a voxel's score. Imaginary part: 1 on the sensor, 0 beside it, which counts rays.
    shares = np.clip(image / peak, max(DARK * threshold, 1e-12), max(min(BRIGHT * threshold, 1), 1e-12))
    levels = np.log(np.where(np.isnan(image), max(threshold, 1e-12), shares)) + 1j
    levels = np.pad(levels.astype(np.complex64), 1)
    sections = lit_sections(image, camera)
    x, y, depths = grid.axes_mm()
    indices, scores = [], []
    for k, z in enumerate(depths):
        total = np.zeros((len(y), len(x)), np.complex64)
        for u, v in sections:
            places = camera.place_px(x[None, :], y[:, None], z, u, v)
            column, row = (np.clip(np.floor(p) + 1, 0, n + 1).astype(int) for p, n in zip(places, camera.sensor_px))
            # For a lattice in line with the pixels these are (1, nx) columns and (ny, 1) rows, not a ray per voxel.
            total += levels.take(row * levels.shape[1] + column)
        seen = total.imag
        mean = total.real / np.maximum(seen, 1)
        kept = np.flatnonzero((seen >= SEEN * len(sections)) & (mean >= np.log(max(threshold, 1e-12))))
        indices.append(kept + k * total.size)
        scores.append(peak * np.exp(mean.flat[kept]))
    return np.concatenate(indices), np.concatenate(scores)


def work(options, session):
    camera = lf.Camera(options.camera)
    image, history = lf.read_frame(options.image, camera, options.background, options.channel, options.mask)
    grid = camera.grid(options.pvr, options.depth, options.bounds)
    if options.threshold == "auto":
        thresholds = [automatic(image, share) for share in (FAINT, USUAL)]
    else:
        thresholds = [float(options.threshold)]
    with session.phase("prune"):
        for threshold in thresholds:
            indices, scores = prune(image, camera, grid, threshold)
            if len(indices) <= MOST_KEPT * len(grid):
                break
    session.counts.update(threshold=float(threshold), voxels=len(grid), kept=len(indices))
    if not len(indices):
        raise lf.Refused(f"{options.image}: no voxel survives pruning; wanted a brighter image or a lower --threshold")
    lf.write_volume(options.output, lf.Volume(grid, indices, {"score": scores}, session.history(history)))


parser = lf.Parser(__doc__)
parser.add_argument("image", help="light-field image (EXR)")
parser.add_argument("--pvr", type=lf.numbers(3), default=[1, 1, 10], metavar="X,Y,Z", help="pixels per voxel")
parser.add_argument("--depth", type=lf.numbers(2), required=True, metavar="Z0,Z1", help="depth of the volume, mm")
parser.add_argument("--bounds", type=lf.numbers(4), metavar="X0,X1,Y0,Y1", help="its sides, mm")
parser.add_argument("--threshold", default="auto", metavar="SHARE|auto", help="least score kept")

if __name__ == "__main__":
    lf.main(parser, work)

#!/usr/bin/env python3
"""lf-prune in numpy: the voxels that may hold light, by dense ray tracing with a multiplicative line of sight.

    make -f scripts/pipeline.mk PRUNE='python3 scripts/examples/prune.py'

The centre ray of every section of the aperture is traced from every voxel to a pixel. A voxel is kept if the geometric
mean of its pixels is at least --threshold of the image's brightest pixel.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))
import lf

DARK = 1e-6  # Least value of a pixel, as a share of the brightest: one dark pixel must not decide alone.
SEEN = 0.5  # Least share of a voxel's rays that must meet the sensor.


def automatic(image):
    """lf-prune's threshold, as a share of the brightest pixel: a fifth of the mean brightness of the light, or the
    noise if that is more. The noise is the scatter in the darkest twentieth of the tiles of 4 x 4 px."""
    height, width = (n - n % 4 for n in image.shape)
    tiles = image[:height, :width].reshape(height // 4, 4, width // 4, 4).swapaxes(1, 2).reshape(-1, 16)
    dark = tiles[np.argsort(tiles.mean(1))[: -(-len(tiles) // 20)]]
    noise = np.sort(dark.std(1, ddof=1))[len(dark) // 2] if len(dark) else 0
    light = image[~np.isnan(image)].astype(float)
    return min(max(0.2 * (light**2).sum() / light.sum(), noise) / light.max(), 1.0)


def prune(image, camera, grid, threshold):
    """Indices (n,) of the voxels kept, and their scores (n,) in counts. `image` is (height, width), NaN where blind."""
    peak = np.nanmax(image)
    # Real part: what a pixel adds to a voxel's score. Imaginary part: 1 on the sensor, 0 beside it, which counts rays.
    levels = np.log(np.fmax(np.where(np.isnan(image), 1, image / peak), DARK)) + 1j
    levels = np.pad(levels.astype(np.complex64), 1)
    sections = camera.sections_mm()
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
        kept = np.flatnonzero((seen >= SEEN * len(sections)) & (mean >= np.log(max(threshold, DARK))))
        indices.append(kept + k * total.size)
        scores.append(peak * np.exp(mean.flat[kept]))
    return np.concatenate(indices), np.concatenate(scores)


def work(options, session):
    camera = lf.Camera(options.camera)
    image, history = lf.read_frame(options.image, camera, options.background, options.channel)
    grid = camera.grid(options.pvr, options.depth, options.bounds)
    threshold = automatic(image) if options.threshold == "auto" else float(options.threshold)
    with session.phase("prune"):
        indices, scores = prune(image, camera, grid, threshold)
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
    lf.run(parser, work)

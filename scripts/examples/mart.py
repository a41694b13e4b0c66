#!/usr/bin/env python3
"""Another solver in place of lf-mart: expectation maximisation (MLEM) over ordered subsets of image rows, after Hudson
& Larkin (1994), on a stored sparse matrix.

    make -f scripts/pipeline.mk MART='python3 scripts/examples/mart.py'

Weights are counts of rays: four a side for every section of the aperture, each from another place of the voxel, which
stands for a Gaussian. They put a tenth of a voxel's light into wrong pixels; with FINER = 6 a sixteenth, at twice the
time. A voxel has some 430 weights and takes 17 kB of memory while they are sorted: this is for small volumes.
"""

import sys
from pathlib import Path
from statistics import NormalDist

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))
import lf

FINER = 4  # Rays a side for every section of the aperture.
BLOB = 0.65  # Standard deviation of the Gaussian that a voxel stands for, voxels (lf-mart --basis blob: pixels).
SUBSETS = 14  # Subsets of the image's rows.
STALLED = 0.99  # Sweeps end when two of them leave more than this share of the misfit; as lf-mart --until stall.
LEAST = 1e-4  # Voxels below this share of the brightest are not written; as in lf-mart.
BLOCK = 512  # Voxels whose weights are made at once.


def scatter(count):
    """Places (count, 2) in a voxel where its rays start, in voxels: spread evenly over the Gaussian, the same for every
    voxel (multiples of the powers of 1 / 1.3247, the plastic number, after Roberts 2018)."""
    shares = (0.5 + np.arange(1, count + 1)[:, None] * [0.7548776662466927, 0.5698402909980532]) % 1
    return BLOB * np.vectorize(NormalDist().inv_cdf)(np.clip(shares, 1e-6, 1 - 1e-6))


def weights(camera, volume):
    """The share of each voxel's light that each pixel gets: a sparse matrix (voxels, pixels + 1) f32. The last column
    holds the light that misses the sensor."""
    from scipy import sparse

    width, height = camera.sensor_px
    rays = camera.sections_mm(FINER)
    dx, dy = (scatter(len(rays)) * volume.grid.spacing_mm[:2]).T
    parts = []
    for start in range(0, len(volume.indices), BLOCK):
        x, y, z = (axis[:, None] for axis in volume.grid.centres_mm(volume.indices[start : start + BLOCK]))
        places = camera.place_px(x + dx, y + dy, z, rays[:, 0], rays[:, 1])
        column, row = (np.floor(place).astype(np.int32) for place in places)
        on_sensor = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        # Sorting puts rays that meet the same pixel together, and rays beside the sensor at the end.
        pixels = np.sort(np.where(on_sensor, row * np.int32(width) + column, np.int32(width * height)), axis=1)
        is_first = np.diff(pixels, axis=1, prepend=-1) != 0
        firsts = np.flatnonzero(is_first)
        counts = np.diff(firsts, append=pixels.size).astype(np.float32)
        ends = np.concatenate([[0], is_first.sum(1).cumsum()])
        shape = (len(pixels), width * height + 1)
        parts.append(sparse.csr_array((counts / np.float32(len(rays)), pixels.flat[firsts], ends), shape))
    return sparse.vstack(parts, "csr")


def reconstruct(image, matrix, iterations):
    """Strengths of the voxels, (n,) f32 in counts; the number of sweeps; the misfit of the last sweep. `matrix` comes
    from `weights`; `image` is (height, width), NaN where blind."""
    matrix, width, peak = matrix.tocsc(), image.shape[1], np.nanmax(image)
    light = np.append(image.ravel() / peak, np.float32(np.nan))  # NaN: light beside the sensor is unknown.
    reached = (np.diff(matrix.indptr) > 0) & ~np.isnan(light)
    subsets = []
    for n in range(SUBSETS):
        pixels = np.flatnonzero(reached & (np.arange(light.size) // width % SUBSETS == n))
        part = matrix[:, pixels]
        subsets.append((part, light[pixels], np.maximum(part.sum(1), 1e-6)))
    strengths = np.full(matrix.shape[0], np.nansum(light) / matrix.shape[0], np.float32)
    misfits = []
    for _ in range(iterations):
        squares = 0.0
        for part, wanted, share in subsets:
            found = part.T @ strengths
            squares += ((wanted - found) ** 2).sum()
            strengths *= part @ (wanted / np.maximum(found, 1e-6)) / share
        misfits.append(float(np.sqrt(squares / (light[reached] ** 2).sum())))
        if len(misfits) > 2 and misfits[-1] > STALLED * misfits[-3]:
            break
    return strengths * peak, len(misfits), misfits[-1]


def spread(volume, strengths):
    """The sum of the blobs with these strengths: linear indices and intensities of its lit voxels."""
    from scipy import ndimage

    dense = lf.Volume(volume.grid, volume.indices, {"blobs": strengths}).dense("blobs")
    light = ndimage.gaussian_filter(dense, BLOB, mode="constant").ravel()
    lit = np.flatnonzero(light > LEAST * light.max())
    return lit, light[lit]


def work(options, session):
    lf.module("scipy", "for sparse matrices")
    camera = lf.Camera(options.camera)
    image, _ = lf.read_frame(options.image, camera, options.background, options.channel, options.mask)
    support = lf.read_volume(options.support)
    if not len(support.indices) or not np.nansum(image) > 0:
        raise lf.Refused(
            f"{options.support}: no voxel or no light; wanted a support with voxels and a frame with light"
        )
    with session.phase("weights"):
        matrix = weights(camera, support)
    with session.phase("reconstruct"):
        strengths, sweeps, misfit = reconstruct(image, matrix, options.iterations)
        indices, intensity = spread(support, strengths)
    session.counts.update(support_voxels=len(support.indices), weights=matrix.nnz, sweeps=sweeps, misfit=misfit)
    volume = lf.Volume(support.grid, indices, {"intensity": intensity}, session.history(support.history))
    lf.write_volume(options.output, volume)


parser = lf.Parser(__doc__)
parser.add_argument("support", nargs="?", default="-", help="support (.lfv), - for standard input")
parser.add_argument("-i", "--image", required=True, metavar="FILE", help="light-field image (EXR)")
parser.add_argument("--iterations", type=int, default=60, metavar="N", help="sweeps over all pixels, at most")

if __name__ == "__main__":
    lf.main(parser, work)

#!/usr/bin/env python3
"""OpenPIV's three-dimensional correlation beside lf-xcorr, for `scripts/studies/study xcorr`. Needs numpy and xxhash.

    peer-xcorr.py --make DIR SIGMA_Z      writes DIR/a.lfv and DIR/b.lfv, displaced by (2.3, -1.6, 0.7) voxels
    peer-xcorr.py DIR                     correlates them and prints JSON: vectors, seconds, vectors that are zero or not
                                          numbers, bias and RMS of the others in voxels, with and without outliers

Without the package openpiv it leaves out the comparison. It times only the correlation, on one core as OpenPIV runs it,
not the reading. OpenPIV has one pass, no validation, and keeps both windows in place.
"""
import importlib.util
import json
import math
import os
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))
import lf

SHIFT, SIDE, WINDOW, STEP = (2.3, -1.6, 0.7), 128, 32, 8  # voxels
SIGMA, IN_WINDOW = 0.75, 8  # voxels across; particles in a window


def make(folder, sigma_z):
    """Writes the pair, half the shift before and half after."""
    random, folder = np.random.default_rng(1), Path(folder)
    sigmas = np.array([float(sigma_z), SIGMA, SIGMA])
    margin = np.ceil(4 * sigmas + 4)
    count = round(IN_WINDOW / WINDOW**3 * float(np.prod(SIDE + 2 * margin)))
    places = random.uniform(-margin - 0.5, SIDE + margin - 0.5, (count, 3))
    folder.mkdir(parents=True, exist_ok=True)
    for name, half in (("a.lfv", -0.5), ("b.lfv", 0.5)):
        dense = np.zeros(3 * [SIDE], np.float32)
        for place in places + half * np.array(SHIFT[::-1]):
            lines, box = [], []
            for centre, sigma in zip(place, sigmas):
                start = max(math.ceil(centre - 4 * sigma), 0)
                voxels = np.arange(start, max(min(math.floor(centre + 4 * sigma) + 1, SIDE), start))
                lines.append(np.exp(-0.5 * ((voxels - centre) / sigma) ** 2))
                box.append(slice(start, start + len(voxels)))
            dense[tuple(box)] += np.einsum("i,j,k->ijk", *lines).astype(np.float32)
        indices = np.flatnonzero(dense)
        grid = lf.Grid(dense.shape[::-1], (1.0,) * 3, (0.0,) * 3)
        lf.write_volume(folder / name, lf.Volume(grid, indices, {"intensity": dense.flat[indices]}))


def compare(folder):
    if not importlib.util.find_spec("openpiv"):
        print("The Python package openpiv is not installed; no comparison.")
        return
    os.environ.setdefault("TQDM_DISABLE", "1")
    from openpiv.pyprocess3D import extended_search_area_piv3D

    volumes = [lf.read_volume(Path(folder) / name).dense("intensity") for name in ("a.lfv", "b.lfv")]
    volumes = [dense / dense.max() for dense in volumes]
    window, overlap, began = 3 * (WINDOW,), 3 * (WINDOW - STEP,), time.perf_counter()
    found = extended_search_area_piv3D(*volumes, window_size=window, overlap=overlap, search_area_size=window)
    seconds = time.perf_counter() - began
    # OpenPIV takes [row, column, depth] and gives u along columns, v against rows, w along depth; ours are [z, y, x].
    # Its v is for a y axis that points up, and its correlation's place has the opposite sign. Together they give these
    # signs.
    along_columns, against_rows, along_depth = (np.asarray(component).ravel() for component in found)
    vectors = np.stack([along_depth, -along_columns, against_rows], axis=1)
    finite, zero = np.isfinite(vectors).all(axis=1), (vectors == 0).all(axis=1)
    error = (vectors - np.array(SHIFT))[finite & ~zero]
    # Vectors off by more than a voxel are outliers.
    good = error[(np.abs(error) <= 1).all(axis=1)]
    figures = {"peer": "openpiv", "vectors": len(vectors), "seconds": round(seconds, 3), "not_numbers": int((~finite).sum()),
               "zero": int(zero.sum()), "outliers": len(error) - len(good)}
    for name, part in (("", error), ("_without_outliers", good)):
        if len(part):
            figures["bias_vox" + name] = [round(float(value), 5) for value in part.mean(axis=0)]
            figures["rms_vox" + name] = [round(float(value), 5) for value in np.sqrt((part**2).mean(axis=0))]
    print(json.dumps(figures))


if __name__ == "__main__":
    if sys.argv[1] == "--make":
        make(*sys.argv[2:])
    else:
        compare(sys.argv[1])

#!/usr/bin/env python3
"""Correlates two .lfv volumes with OpenPIV's three-dimensional correlation. Prints one JSON object: vectors, seconds,
vectors a second, vectors that are zero or not numbers, and with --shift the bias and RMS of the others, in voxels.

    peer-xcorr.py a.lfv b.lfv --window 32,32,32 --overlap 0.75 --vectors 500 --shift 2.3,-1.6,0.7
    peer-xcorr.py --make DIR --sigma-z 4         writes DIR/a.lfv and DIR/b.lfv, displaced by (2.3, -1.6, 0.7) voxels

Needs numpy and xxhash; without the package openpiv it leaves out the comparison. It times only the correlation, on one
core as OpenPIV runs it, not the reading. OpenPIV has one pass, no validation, and keeps both windows in place.
"""

import argparse
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

SHIFT = (2.3, -1.6, 0.7)


def triple(kind):
    """For argparse: one value per axis, as `1,2,3`, or one for all axes, as `1`."""

    def parse(text):
        values = [kind(word) for word in text.split(",")]
        values = values * 3 if len(values) == 1 else values
        if len(values) != 3:
            raise argparse.ArgumentTypeError("wanted one number or three, like 32,32,32")
        return values

    return parse


def lit(path):
    """The light of a .lfv as a dense array [z, y, x], peak 1."""
    dense = lf.read_volume(path).dense("intensity")
    return dense / max(dense.max(), np.finfo(np.float32).tiny)


def write(path, dense):
    """Writes the lit voxels of a dense array [z, y, x] as a .lfv with voxels of 1 mm."""
    indices = np.flatnonzero(dense)
    grid = lf.Grid(dense.shape[::-1], (1.0,) * 3, (0.0,) * 3)
    history = [{"tool": "peer-xcorr.py", "version": "1", "arguments": sys.argv[1:]}]
    lf.write_volume(path, lf.Volume(grid, indices, {"intensity": dense.flat[indices]}, history))


def make(folder, sigma_z, shape=(128, 128, 128), sigma=0.75, particles=8, seed=1):
    """Writes a pair of volumes with `particles` in 32^3 voxels on average, half the shift before and half after."""
    random = np.random.default_rng(seed)
    size, sigmas = np.array(shape[::-1]), np.array([sigma_z, sigma, sigma])
    margin = np.ceil(4 * sigmas + 4)
    count = round(particles / 32**3 * float(np.prod(size + 2 * margin)))
    places = random.uniform(-margin - 0.5, size + margin - 0.5, (count, 3))
    folder.mkdir(parents=True, exist_ok=True)
    for name, half in (("a.lfv", -0.5), ("b.lfv", 0.5)):
        dense = np.zeros(size, np.float32)
        for place in places + half * np.array(SHIFT[::-1]):
            lines, box = [], []
            for centre, sigma_vox, length in zip(place, sigmas, size):
                start = max(math.ceil(centre - 4 * sigma_vox), 0)
                voxels = np.arange(start, max(min(math.floor(centre + 4 * sigma_vox) + 1, length), start))
                lines.append(np.exp(-0.5 * ((voxels - centre) / sigma_vox) ** 2))
                box.append(slice(start, start + len(voxels)))
            dense[tuple(box)] += np.einsum("i,j,k->ijk", *lines).astype(np.float32)
        write(folder / name, dense)


def middle(dense, box):
    """The box [x, y, z] in the middle of a dense array."""
    starts = [(length - n) // 2 for length, n in zip(dense.shape, box[::-1])]
    return dense[tuple(slice(start, start + n) for start, n in zip(starts, box[::-1]))]


def fitted(box, window, step, limit):
    """`box`, shortened along its longest axis until it holds at most `limit` windows."""
    counts = [(n - w) // s + 1 for n, w, s in zip(box, window, step)]
    while limit and math.prod(counts) > limit:
        axis = counts.index(max(counts))
        counts[axis] -= 1
    return [w + s * (n - 1) for n, w, s in zip(counts, window, step)]


def correlate(volumes, window, step, search):
    """Displacements [vector, (x, y, z)] in voxels, and the seconds they took. With a search OpenPIV covers less of the
    box: it counts windows as if their step were larger by the search."""
    from openpiv.pyprocess3D import extended_search_area_piv3D

    overlap = [w - s for w, s in zip(window, step)]
    began = time.perf_counter()
    found = extended_search_area_piv3D(
        *volumes,
        window_size=tuple(window[::-1]),
        overlap=tuple(overlap[::-1]),
        search_area_size=tuple(w + 2 * r for w, r in zip(window[::-1], search[::-1])),
    )
    seconds = time.perf_counter() - began
    # OpenPIV takes [row, column, depth] and gives u along columns, v against rows, w along depth; ours are [z, y, x].
    # Its v is for a y axis that points up, and its correlation's place has the opposite sign. Together they give these
    # signs.
    along_columns, against_rows, along_depth = (np.asarray(component).ravel() for component in found)
    return np.stack([along_depth, -along_columns, against_rows], axis=1), seconds


def score(vectors, shift):
    """Counts, and the errors of the vectors against `shift`. Vectors off by more than a voxel are outliers."""
    finite = np.isfinite(vectors).all(axis=1)
    zero = (vectors == 0).all(axis=1)
    figures = {"not_numbers": int((~finite).sum()), "zero": int(zero.sum())}
    if shift is not None:
        error = (vectors - np.array(shift))[finite & ~zero]
        good = error[(np.abs(error) <= 1).all(axis=1)]
        figures["outliers"] = len(error) - len(good)
        for name, error in (("", error), ("_without_outliers", good)):
            if len(error):
                figures["bias_vox" + name] = [round(float(value), 5) for value in error.mean(axis=0)]
                figures["rms_vox" + name] = [round(float(value), 5) for value in np.sqrt((error**2).mean(axis=0))]
    return figures


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("volumes", nargs="*", type=Path, metavar="FILE.lfv")
    option = parser.add_argument
    option("--window", type=triple(int), default=[32] * 3, metavar="X,Y,Z", help="voxels [32]")
    option("--overlap", type=float, default=0.75, metavar="SHARE", help="share of a window that the next covers too [0.75]")
    option("--search", type=triple(int), default=[0] * 3, metavar="X,Y,Z", help="voxels around the second window [0]")
    option("--box", type=triple(int), metavar="X,Y,Z", help="correlate only a box of this size in the middle")
    option("--vectors", type=int, default=0, metavar="N", help="most vectors, in the middle; 0: all")
    option("--shift", type=triple(float), metavar="U,V,W", help="true displacement, voxels")
    option("--make", type=Path, metavar="DIR", help="write a pair of volumes instead")
    option("--sigma-z", type=float, default=0.75, metavar="VOXELS", help="standard deviation of the particles written, along z [0.75]")
    arguments = parser.parse_args()

    os.environ.setdefault("TQDM_DISABLE", "1")
    if arguments.make:
        make(arguments.make, arguments.sigma_z)
        return
    if len(arguments.volumes) != 2:
        parser.error("wanted two volumes")
    if not importlib.util.find_spec("openpiv"):
        print("The Python package openpiv is not installed; no comparison.")
        return
    dense = [lit(path) for path in arguments.volumes]
    if dense[0].shape != dense[1].shape:
        sys.exit(f"volumes of {dense[0].shape[::-1]} and {dense[1].shape[::-1]} voxels; wanted two of one grid")
    window, search = arguments.window, arguments.search
    step = [max(round(w * (1 - arguments.overlap)), 1) for w in window]
    reach = [w + 2 * r for w, r in zip(window, search)]
    box = arguments.box or list(dense[0].shape[::-1])
    if any(n < r or n > length for n, r, length in zip(box, reach, dense[0].shape[::-1])):
        sys.exit(f"a box of {box} voxels; wanted one that holds {reach} and is held by {list(dense[0].shape[::-1])}")
    box = fitted(box, reach, step, arguments.vectors)
    vectors, seconds = correlate([middle(volume, box) for volume in dense], window, step, search)
    figures = {"peer": "openpiv", "box": box, "window": window, "step": step, "vectors": len(vectors)}
    figures |= {"seconds": round(seconds, 3), "vectors_per_s": round(len(vectors) / seconds, 3)}
    print(json.dumps(figures | score(vectors, arguments.shift)))


if __name__ == "__main__":
    try:
        main()
    except lf.Refused as refused:
        sys.exit(f"peer-xcorr.py: {refused}")

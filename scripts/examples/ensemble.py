#!/usr/bin/env python3
"""Statistics of many fields of one flow beyond those of `lf-validate ensemble`: by phase, along an axis, and modes.

    ensemble.py field-*.exr --phases 8 --parts means     means of the phases: means/phase-00.exr ...
    ensemble.py field-*.exr --along x                    correlations and spectra of the fluctuations along x
    ensemble.py field-*.exr --modes 4 --parts modes      proper orthogonal modes: modes/mode-00.exr ...

Prints one JSON object; numbers are for u, v and w.

phases  coherent_mm: RMS of the phases' means about the mean of all; incoherent_mm: RMS of the fluctuations about the
        mean of the phase (n - 1). Field n has phase n modulo N.
lines   correlation by distance_mm, over the RMS at both ends; length_mm, its integral up to the first zero;
        spectrum_mm3 by wavenumber_1_mm (cycles a mm), one-sided, from whole lines under a Hann window: its sum times
        the step of the wavenumber is the variance
modes   by the method of snapshots (Sirovich, Q. Appl. Math., 1987): share of the mean square fluctuation, rms_mm,
        and the amount of the mode in every field, of mean square 1

The mean is that of measured vectors; fluctuations are those of all vectors with data. All fields are held in memory.
Needs numpy and OpenEXR.
"""

import argparse
import json
import os
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))
import lf

MEASURED, NO_DATA = 0, 2
# Places without data divide by 0.
np.seterr(invalid="ignore", divide="ignore")


def read(paths):
    """The layout, vectors (field, component, z, y, x) in mm, and flags (field, z, y, x)."""
    fields = [lf.read_field(path) for path in paths]
    layout = fields[0][0]
    for path, (other, _) in zip(paths, fields):
        if any(other[key] != layout[key] for key in ("shape", "spacing_mm", "origin_mm")):
            raise lf.Refused(f"{path}: vectors at other places; wanted those of {paths[0]}")
    vectors = np.array([[field[name] for name in "uvw"] for _, field in fields], float)
    return layout, vectors, np.array([field["flag"] for _, field in fields])


def mean_of(vectors, flags):
    """Mean (component, z, y, x) and RMS of the fluctuations with n - 1, of measured vectors; NaN without any."""
    known = (flags == MEASURED)[:, None]
    count = known.sum(0)
    mean = np.where(known, vectors, 0).sum(0) / count
    squares = np.where(known, vectors - mean, 0) ** 2
    return mean, np.sqrt(np.where(count > 1, squares.sum(0) / (count - 1), np.nan))


def rms(values, axes):
    """Root mean square of the finite values."""
    return np.sqrt(np.nanmean(values**2, axes))


def by_phase(vectors, flags, mean, phases):
    """Numbers of the phases, and their means."""
    means, fluctuations = zip(*(mean_of(vectors[n::phases], flags[n::phases]) for n in range(phases)))
    numbers = {
        "fields": [len(vectors[n::phases]) for n in range(phases)],
        "coherent_mm": rms(np.array(means) - mean, (0, 2, 3, 4)),
        "incoherent_mm": rms(np.array(fluctuations), (0, 2, 3, 4)),
    }
    return numbers, means


def along(fluctuations, layout, axis):
    """Correlations and spectra along an axis; NaN marks places without data."""
    count, step = layout["shape"][axis], layout["spacing_mm"][axis]
    # Lines (component, line, place), of all fields.
    lines = np.moveaxis(fluctuations, 4 - axis, -1).swapaxes(0, 1).reshape(3, -1, count)
    correlation = np.empty((3, count))
    for distance in range(count):
        a, b = lines[..., : count - distance], lines[..., distance:]
        known = np.isfinite(a) & np.isfinite(b)
        product, first, second = (np.where(known, p, 0).sum((1, 2)) for p in (a * b, a * a, b * b))
        correlation[:, distance] = product / np.sqrt(first * second)
    whole = lines[:, np.isfinite(lines).all((0, 2))]
    hann = np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 2
    waves = np.fft.rfft((whole - whole.mean(2, keepdims=True)) * hann)[..., 1:]
    # The highest wave of an even number of places is its own mirror image.
    fold = np.where(2 * np.arange(1, count // 2 + 1) == count, 1, 2)
    return {
        "axis": "xyz"[axis],
        "distance_mm": np.arange(count) * step,
        "correlation": correlation,
        "length_mm": np.array([length(values, step) for values in correlation]),
        "wavenumber_1_mm": np.arange(1, count // 2 + 1) / (count * step),
        "spectrum_mm3": fold * (np.abs(waves) ** 2).mean(1) * step / (hann**2).sum(),
        "lines": whole.shape[1],
    }


def length(correlation, step):
    """Integral of a correlation up to its first zero, by trapezoids; the whole line if it has none."""
    end = next((n for n, value in enumerate(correlation) if value <= 0), len(correlation))
    total = step * (correlation[:end].sum() - 0.5 * (correlation[0] + correlation[end - 1]))
    if end < len(correlation):
        a, b = correlation[end - 1 : end + 1]
        total += 0.5 * step * a * a / (a - b)
    return total


def modes(fluctuations, places, most):
    """Numbers of the strongest modes, and the modes themselves."""
    count = len(fluctuations)
    flat = np.nan_to_num(fluctuations).reshape(count, -1)
    values, vectors = np.linalg.eigh(flat @ flat.T / (places * count))
    values, vectors = np.maximum(values[::-1][:most], 0), vectors[:, ::-1][:, :most]
    # The sign of an eigenvector is free: its largest entry is positive.
    vectors = vectors * np.sign(vectors[np.abs(vectors).argmax(0), np.arange(vectors.shape[1])])
    numbers = {
        "share": values * places * count / (flat**2).sum(),
        "rms_mm": np.sqrt(values),
        "amount": np.sqrt(count) * vectors.T,
    }
    return numbers, (vectors.T @ flat / np.sqrt(count)).reshape(-1, *fluctuations.shape[1:])


def save(folder, name, parts, layout):
    """Writes vectors (component, z, y, x) as fields, NAME-00.exr and so on."""
    for n, part in enumerate(parts):
        known = np.isfinite(part).all(0)
        components = {name: np.where(known, values, np.nan) for name, values in zip("uvw", part)}
        components["flag"] = np.where(known, MEASURED, NO_DATA)
        lf.write_field(os.path.join(folder, f"{name}-{n:02}.exr"), layout, components)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("fields", nargs="+", help="fields (EXR) with their vectors at the same places, in time's order")
    parser.add_argument("--phases", type=int, metavar="N", help="averages by phase")
    parser.add_argument("--along", choices=["x", "y", "z"], help="spectra and correlations along an axis")
    parser.add_argument("--modes", type=int, metavar="N", help="the strongest proper orthogonal modes")
    parser.add_argument("--parts", metavar="FOLDER", help="write the means of the phases and the modes there")
    options = parser.parse_args()
    if options.phases is not None and not 2 <= options.phases <= len(options.fields):
        found = f"{options.phases} phases of {len(options.fields)} fields"
        raise lf.Refused(f"--phases: {found}; wanted 2 phases or more, and a field or more for each")
    layout, vectors, flags = read(options.fields)
    mean, _ = mean_of(vectors, flags)
    fluctuations = np.where((flags != NO_DATA)[:, None], vectors - mean, np.nan)
    found, parts = {}, {}
    if options.phases:
        found["phases"], parts["phase"] = by_phase(vectors, flags, mean, options.phases)
    if options.along:
        found["lines"] = along(fluctuations, layout, "xyz".index(options.along))
    if options.modes:
        found["modes"], parts["mode"] = modes(fluctuations, np.isfinite(mean[0]).sum(), options.modes)
        parts["mode"] = np.where(np.isfinite(mean), parts["mode"], np.nan)
    if options.parts:
        os.makedirs(options.parts, exist_ok=True)
        for name, part in parts.items():
            save(options.parts, name, part, layout)
    # A number that does not exist is null.
    print(json.dumps(found, default=lambda value: np.where(np.isfinite(value), value, None).tolist()))


if __name__ == "__main__":
    try:
        main()
    except lf.Refused as refusal:
        sys.exit(f"ensemble.py: {refusal}")

#!/usr/bin/env python3
"""Reads a field's `.vti` with VTK, the library of ParaView, and compares every array with the same field's EXR.

    lf-xcorr a.lfv b.lfv -o field.exr && lf-xcorr a.lfv b.lfv -o field.vti && check_vti.py field.vti field.exr

Ends with exit code 1 if a bit differs. Needs vtk (`pip install vtk`).
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))
import lf

# Each array of the .vti, and the channels of the EXR that it holds.
ARRAYS = {
    "displacement_mm": "uvw",
    "uncertainty_mm": ["su", "sv", "sw"],
    "peak": ["peak"],
    "ratio": ["ratio"],
    "flag": ["flag"],
    "count": ["count"],
}


def differences(vti, exr):
    """The differences, as lines of text."""
    lf.module("vtk", "to read a .vti")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLImageDataReader

    layout, field = lf.read_field(exr)
    reader = vtkXMLImageDataReader()
    reader.SetFileName(vti)
    if not reader.CanReadFile(vti):
        return [f"{vti} is no .vti that VTK can read"]
    reader.Update()
    image = reader.GetOutput()
    found = []
    for name, ours, theirs in (
        ("shape", layout["shape"], image.GetDimensions()),
        ("spacing_mm", layout["spacing_mm"], image.GetSpacing()),
        ("origin_mm", layout["origin_mm"], image.GetOrigin()),
    ):
        if tuple(ours) != tuple(theirs):
            found.append(f"{name} {list(theirs)}, in the EXR {ours}")
    if found:
        return found
    wanted = {name: np.stack([field[key].ravel() for key in keys], 1) for name, keys in ARRAYS.items()}
    if layout.get("dt_s") is not None:
        wanted["velocity_mm_s"] = (wanted["displacement_mm"].astype(float) / layout["dt_s"]).astype(np.float32)
    for name, ours in wanted.items():
        array = image.GetPointData().GetArray(name)
        if array is None:
            found.append(f"{name} is missing")
            continue
        theirs = vtk_to_numpy(array).reshape(len(ours), -1)
        if not np.array_equal(ours, theirs, equal_nan=True):
            found.append(f"{name} differs")
    return found


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(f"usage: {sys.argv[0]} FIELD.vti FIELD.exr")
    try:
        lines = differences(*sys.argv[1:])
    except lf.Refused as refusal:
        print(f"check_vti.py: {refusal}", file=sys.stderr)
        sys.exit(2)
    print("\n".join(lines) or f"{sys.argv[1]}: every array equals the EXR's")
    sys.exit(1 if lines else 0)

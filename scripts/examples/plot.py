#!/usr/bin/env python3
"""Draws one slice of a vector field: arrows are the displacement in the slice, colour the component across it.

    plot.py field.exr -o field.png                  the middle slice across z
    plot.py field.exr -o field.pdf --slice y=0.5    the one nearest to y = 0.5 mm

Replaced vectors are grey; places without data are left out. Needs numpy, OpenEXR and matplotlib.
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))
import lf


def draw(path, output, where):
    """Draws the slice `where` (`z` or `y=0.5`) of the field at `path`."""
    lf.module("matplotlib", "to draw").use("agg")
    lf.read_field(path)  # Refuses other files.
    try:
        figure = lf.show(path, where).figure
    except lf.Refused as refusal:
        raise lf.Refused(f"{path}: {refusal}") from None
    try:
        figure.savefig(output, dpi=150)
    except (OSError, ValueError) as error:
        raise lf.Refused(f"{output}: {error}; wanted the name of a picture") from None


def is_slice(text):
    """For argparse: x, y or z, or one of these with a place."""
    name, _, place = text.partition("=")
    if name not in ("x", "y", "z"):
        raise ValueError
    return f"{name}={float(place)}" if place else name


is_slice.__name__ = "slice"

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("field", help="field (EXR)")
    parser.add_argument("-o", "--output", required=True, help="picture: .png, .pdf or .svg")
    parser.add_argument("--slice", type=is_slice, default="z", metavar="AXIS[=MM]", help="slice to draw")
    options = parser.parse_args()
    try:
        draw(options.field, options.output, options.slice)
    except lf.Refused as refusal:
        sys.exit(f"plot.py: {refusal}")

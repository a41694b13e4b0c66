#!/usr/bin/env python3
"""Draws one slice of a vector field: arrows are the displacement in the slice, colour the component across it.

    plot.py field.exr -o field.png                  the middle slice across z
    plot.py field.exr -o field.pdf --slice y=0.5    the one nearest to y = 0.5 mm

Replaced vectors are grey; places without data are left out. Needs numpy, OpenEXR and matplotlib.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))
import lf

MEASURED, NO_DATA = 0, 2
MOST_ARROWS = 40  # Arrows a side. Of more, every second, third ... is drawn.


def draw(path, output, where):
    """Draws the slice `where` (`z` or `y=0.5`) of the field at `path`."""
    matplotlib = lf.module("matplotlib", "to draw")
    matplotlib.use("agg")
    from matplotlib import pyplot

    layout, field = lf.read_field(path)
    name, _, wanted = where.partition("=")
    normal = "xyz".index(name)
    right, up = (axis for axis in range(3) if axis != normal)
    places = lf.Grid(layout["shape"], layout["spacing_mm"], layout["origin_mm"]).axes_mm()
    nearest = np.abs(places[normal] - float(wanted)).argmin() if wanted else layout["shape"][normal] // 2
    title = f"{name} = {places[normal][nearest]:.3g} mm"

    # Components are (z, y, x). Rows of the slice run along y, or along z in a slice across y.
    cut = {key: values.take(nearest, 2 - normal) for key, values in field.items()}
    has_data = cut["flag"] != NO_DATA
    if not has_data.any():
        raise lf.Refused(f"{path}: no data in the slice {title}; wanted another --slice")
    u, v, w = (np.where(has_data, cut["uvw"[axis]], np.nan) for axis in (right, up, normal))

    figure, view = pyplot.subplots(figsize=(7, 6), layout="constrained")
    limit = np.nanmax(np.abs(w)) or 1
    colours = {"cmap": "RdBu_r", "vmin": -limit, "vmax": limit, "shading": "nearest"}
    mesh = view.pcolormesh(places[right], places[up], w, **colours)
    figure.colorbar(mesh, label=f"{'uvw'[normal]}, mm")

    every = tuple(slice(n % step // 2, None, step) for n in u.shape for step in [-(-n // MOST_ARROWS)])
    x, y = (part[every] for part in np.meshgrid(places[right], places[up]))
    u, v, measured = u[every], v[every], cut["flag"][every] == MEASURED
    # The longest arrow is as long as the distance between arrows, at any scale of the axes.
    longest = np.nanmax(np.hypot(u, v)) or 1
    options = {"scale": longest * (max(x.shape) + 1), "scale_units": "width", "width": 0.003, "pivot": "mid"}
    for flagged, colour in ((measured, "black"), (~measured, "grey")):
        view.quiver(x[flagged], y[flagged], u[flagged], v[flagged], color=colour, **options)
    view.set_aspect("equal" if normal == 2 else "auto")
    view.set(xlabel=f"{'xyz'[right]}, mm", ylabel=f"{'xyz'[up]}, mm")
    view.set_title(f"{title}; the longest arrow is {longest:.3g} mm", fontsize=10)
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

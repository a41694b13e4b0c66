#!/usr/bin/env python3
"""Frames of a Photron camera, run.mraw with its header run.cih, as the pages of a TIFF.

    mraw_to_tiff.py run.cih raw/run.tif
    make -f scripts/pipeline.mk FRAME=raw/%.tif PAGES=series

Reads monochrome frames of 8, 12 (packed) or 16 bits. Needs numpy and pillow.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image


def frames(header):
    """The frames that a header describes, (height, width) each."""
    lines = (line.rstrip("\n").split(" : ", 1) for line in open(header, errors="replace"))
    keys = dict(reversed([line for line in lines if len(line) == 2]))  # The first of a name holds.
    width, height, count, bits = (int(keys[k]) for k in ("Image Width", "Image Height", "Total Frame", "Color Bit"))
    if keys.get("Color Type", "Mono") != "Mono" or bits not in (8, 12, 16) or width * height * bits % 8:
        kind = keys.get("Color Type", "Mono")
        sys.exit(f"{header}: {kind}, {width} x {height} px of {bits} bits; wanted Mono of 8, 12 or 16 bits")
    with open(Path(header).with_suffix(".mraw"), "rb") as raw:
        for number in range(count):
            data = np.frombuffer(raw.read(width * height * bits // 8), "<u2" if bits == 16 else "u1")
            if bits == 12:  # Three bytes hold two samples, the highest bits first.
                a, b, c = data[: len(data) // 3 * 3].reshape(-1, 3).T.astype(np.uint16)
                data = np.stack([a << 4 | b >> 4, (b & 15) << 8 | c], axis=1).ravel()
            if len(data) != width * height:
                sys.exit(f"{raw.name}: ends in frame {number}; wanted {count} frames")
            yield Image.fromarray(data.reshape(height, width))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    pages = frames(sys.argv[1])
    next(pages).save(sys.argv[2], save_all=True, append_images=pages)

"""Gives frames the faults of scripts/studies/frames. Reads scene/frame-*.exr; writes the folders clean, lasers,
sensitivity, hot and all, and flat.exr. frames.py SEED"""

import glob
import os
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))
import lf

random = np.random.default_rng(int(sys.argv[1]))
frames = {os.path.basename(path): lf.read_image(path)[0] for path in sorted(glob.glob("scene/frame-*.exr"))}
shape = next(iter(frames.values())).shape
brightest = max(frame.max() for frame in frames.values())
share = np.clip(1 + 0.05 * random.standard_normal(shape), 0.5, 1.5)
hot = (random.random(shape) < 0.002) * brightest / 3


def save(path, counts):
    exr = lf.module("OpenEXR", "to write frames")
    exr.File({"type": exr.scanlineimage}, {"Y": np.ascontiguousarray(counts, np.float32)}).write(path)


faults = {
    "clean": lambda frame, light: frame,
    "lasers": lambda frame, light: frame * light,
    "sensitivity": lambda frame, light: frame * share,
    "hot": lambda frame, light: frame + hot,
    "all": lambda frame, light: frame * light * share + hot,
}
for name, fault in faults.items():
    os.makedirs(name, exist_ok=True)
    for n, (file, frame) in enumerate(frames.items()):
        save(f"{name}/{file}", fault(frame, 0.6 if n % 2 else 1.0))
save("flat.exr", 1000 * share)

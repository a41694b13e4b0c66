"""Gives frames the faults of scripts/studies/frames: frames.py SEED

Reads scene/frame-*.exr and scene/white.exr. Writes a folder of frames for each fault, stray/empty-*.exr without
particles, and images of even light: flat.exr, and flat-dead.exr with dead pixels.
"""

import glob
import os
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))
import lf

GAIN, READ_NOISE = 0.2, 2.4  # counts per electron, counts: those of the scene
random = np.random.default_rng(int(sys.argv[1]))
frames = {os.path.basename(path): lf.read_image(path)[0] for path in sorted(glob.glob("scene/frame-*.exr"))}
height, width = shape = next(iter(frames.values())).shape
brightest = max(frame.max() for frame in frames.values())
y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]

# A window or a relay lens that shades the corners, and pixels that differ.
sensitivity = (1 - 0.3 * (x**2 + y**2)) * np.clip(1 + 0.03 * random.standard_normal(shape), 0.5, 1.5)
hot = (random.random(shape) < 0.002) * random.uniform(0.05, 0.5, shape) * brightest
alive = random.random(shape) >= 0.002
# A reflex behind the lenslets, beside the middle.
white = lf.read_image("scene/white.exr")[0]
reflex = 0.1 * brightest * white / np.quantile(white, 0.99) * np.exp(-((x - 0.3) ** 2 + (y + 0.2) ** 2) / 0.5)


def save(path, counts):
    exr = lf.module("OpenEXR", "to write frames")
    exr.File({"type": exr.scanlineimage}, {"Y": np.ascontiguousarray(counts, np.float32)}).write(path)


def shot(light):
    """Light with its photon noise; a sensor counts no less than nothing."""
    return np.maximum(light + np.sqrt(GAIN * light) * random.standard_normal(shape), 0)


faults = {
    "clean": lambda frame, n: frame,
    "lasers": lambda frame, n: frame * (0.7 if n % 2 else 1),
    "sensitivity": lambda frame, n: frame * sensitivity,
    "hot": lambda frame, n: frame + hot,
    "dead": lambda frame, n: frame * alive,
    "all": lambda frame, n: (frame * (0.7 if n % 2 else 1) * sensitivity + hot) * alive,
    "stray": lambda frame, n: frame + shot(reflex),
    "drift": lambda frame, n: frame + shot(reflex * (1 - 0.02 * n)),
}
for name, fault in faults.items():
    os.makedirs(name, exist_ok=True)
    some = len(frames) if name in ("stray", "drift") else 10
    for n, (file, frame) in enumerate(list(frames.items())[:some]):
        save(f"{name}/{file}", fault(frame, n))
for n in range(10):
    save(f"stray/empty-{n:04}.exr", np.maximum(shot(reflex) + READ_NOISE * random.standard_normal(shape), 0))
flat = 1000 * sensitivity
save("flat.exr", flat + np.sqrt(GAIN * flat / 50) * random.standard_normal(shape))
save("flat-dead.exr", flat * alive)

#!/usr/bin/env python3
"""Light-field frames that lf-synth did not make, photon by photon; for `scripts/studies/fit independent`.

independent.py DIR LAYOUT TURN STOP DENSITY SEED WIDTH HEIGHT FRAMES [NM,PX]: frames, dark frame, camera, true particles.
NM,PX: light of this wavelength diffracts at the lenslets, and the sensor blurs by a Gaussian of this standard deviation.
independent.py --one DIR LAYOUT TURN STOP X,Y,Z PHOTONS: a frame of one particle without noise.
independent.py --apart A.exr B.exr PHOTONS: the share of the light that lies elsewhere in A than in B, and the share
that counting this many photons puts there.

Nothing here comes from lf-synth or from the weights of lf-core. A photon leaves a Gaussian particle for a random place
of the stop. The thin lens f sends it to the particle's image, a plane of lenslets stands in its way, the lenslet whose
centre is nearest takes it, and a sensor one focal length behind catches it:

    lens to image     1/b = 1/f - 1/a                   a: from the particle to the lens
    at the lenslets   P = V + (s/b) (B - V)             V: place on the lens, B = -(b/a) (X, Y), s: lens to array
    on the sensor     C + g (P - V) / s                 C: centre of the lenslet, g: its focal length
    diffraction       + lambda g q                      q: at random by the square of the cell's Fourier transform

A lens turns the picture over; the camera reads it out upright: columns grow with X, rows with -Y. Each photon that
lands is an electron, so the photon noise is that of counting. The rest of the sensor adds 20 counts and a normal
number of 3. Needs numpy and OpenEXR.
"""
import json
import os
import sys

import numpy as np

FOCAL, MAGNIFICATION, F_NUMBER = 200.0, 1.0, 4.0  # mm
PITCH, LENSLET_FOCAL, PIXEL = 0.077, 0.308, 0.0055  # mm
PHOTONS, READ_NOISE, DARK = 100_000, 3.0, 20.0
SIZE = 0.75 * PIXEL / MAGNIFICATION  # standard deviation of a particle, mm
MARGIN, DEPTH = 0.7, 5.0  # mm: from the sensor's end to the lit box, so that all of its light lands; half the box
MOVE = (0.0127, -0.0094, 0.11)  # mm between frames: 2.3, -1.7, 20 px
HEAD = "# frame: right-handed\nframe,id,x_mm,y_mm,z_mm,intensity"
TO_ARRAY = FOCAL * (1 + MAGNIFICATION)
TO_FOCUS = FOCAL * (1 + 1 / MAGNIFICATION)
STOP = TO_ARRAY / F_NUMBER  # diameter or side, mm
ROW = PITCH * np.sqrt(3) / 2  # between rows of a hexagonal lattice, mm


def camera(sensor, layout, turn, stop, blur=None):
    """The camera, as the page of formats says."""
    block = {} if blur is None else {"blur": {"wavelength_nm": blur.wavelength_nm, "sigma_px": blur.sigma_px}}
    return block | {"frame": "right-handed", "sensor": {"width": sensor[0], "height": sensor[1], "pixel_pitch_mm": PIXEL},
            "main_lens": {"focal_length_mm": FOCAL, "magnification": MAGNIFICATION, "working_f_number": F_NUMBER,
                          "aperture": stop},
            "microlenses": {"layout": layout, "pitch_mm": PITCH, "focal_length_mm": LENSLET_FOCAL,
                            "rotation_rad": turn, "offset_mm": [0.0, 0.0]}}


def nearest(layout, turn, x, y):
    """Centre of the lenslet nearest to a place on the array, columns and rows, mm."""
    cos, sin = np.cos(turn), np.sin(turn)
    u, v = cos * x + sin * y, cos * y - sin * x
    if layout == "square":
        cu, cv = (np.floor(u / PITCH) + 0.5) * PITCH, (np.floor(v / PITCH) + 0.5) * PITCH
    else:
        # Two rectangular lattices, the even rows and the odd ones.
        cu, cv = np.rint(u / PITCH) * PITCH, np.rint(v / (2 * ROW)) * (2 * ROW)
        odd_u = (np.floor(u / PITCH) + 0.5) * PITCH
        odd_v = (np.floor(v / (2 * ROW)) + 0.5) * (2 * ROW)
        odd = (u - odd_u) ** 2 + (v - odd_v) ** 2 < (u - cu) ** 2 + (v - cv) ** 2
        cu, cv = np.where(odd, odd_u, cu), np.where(odd, odd_v, cv)
    return cos * cu - sin * cv, cos * cv + sin * cu


class Blur:
    """Where a photon lands beside its ray. The cell is drawn on a grid and transformed: any shape, no formula."""

    # Grid cells in a pitch, and a side. The pattern reaches half as many lambda g / p; too small a reach narrows it.
    CELLS, GRID = 256, 2048

    def __init__(self, layout, words):
        self.wavelength_nm, self.sigma_px = (float(word) for word in words.split(","))
        at = (np.arange(self.GRID) - self.GRID // 2) / self.CELLS
        x, y = np.abs(np.meshgrid(at, at))
        # A hexagon with its flat sides left and right, as the rows of the lattice run along x.
        cell = (x < 0.5) & (y < 0.5) if layout == "square" else (x < 0.5) & (0.5 * x + np.sqrt(0.75) * y < 0.5)
        power = np.abs(np.fft.fftshift(np.fft.fft2(cell))) ** 2
        self.sums = np.cumsum(power.ravel())
        # A step of the grid of frequencies, mm on the sensor.
        self.step = self.wavelength_nm * 1e-6 * LENSLET_FOCAL / PITCH * self.CELLS / self.GRID

    def moves(self, random, count, turn):
        """Along columns and rows, mm."""
        at = np.searchsorted(self.sums, random.random(count) * self.sums[-1])
        v, u = (axis - self.GRID // 2 + random.random(count) - 0.5 for axis in np.divmod(at, self.GRID))
        u, v = (self.step * (np.cos(turn) * u - np.sin(turn) * v), self.step * (np.sin(turn) * u + np.cos(turn) * v))
        return (axis + self.sigma_px * PIXEL * random.standard_normal(count) for axis in (u, v))


def landed(random, count, place, sensor, layout, turn, stop, blur=None):
    """Photons of a particle at `place` in each pixel of a sensor of (columns, rows), row after row."""
    x, y = (random.standard_normal((2, count)) * SIZE + np.reshape(place[:2], (2, 1)))
    if stop == "square":
        vx, vy = (random.random((2, count)) - 0.5) * STOP
    else:
        radius, angle = 0.5 * STOP * np.sqrt(random.random(count)), 2 * np.pi * random.random(count)
        vx, vy = radius * np.cos(angle), radius * np.sin(angle)
    away = TO_FOCUS - place[2]
    image = 1 / (1 / FOCAL - 1 / away)
    px, py = (v + (TO_ARRAY / image) * (-image / away * at - v) for v, at in ((vx, x), (vy, y)))
    # Upright: x is turned back, and y twice, for rows run downwards.
    px, vx = -px, -vx
    cx, cy = nearest(layout, turn, px, py)
    aside = (0, 0) if blur is None else blur.moves(random, count, turn)
    column, row = (np.floor((c + LENSLET_FOCAL * (p - v) / TO_ARRAY + move) / PIXEL + 0.5 * pixels).astype(int)
                   for c, p, v, move, pixels in zip((cx, cy), (px, py), (vx, vy), aside, sensor))
    inside = (column >= 0) & (column < sensor[0]) & (row >= 0) & (row < sensor[1])
    return np.bincount((row * sensor[0] + column)[inside], minlength=sensor[0] * sensor[1])


def write(path, counts):
    """An image as EXR, one channel Y."""
    import OpenEXR

    header = {"compression": OpenEXR.ZIPS_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"Y": np.ascontiguousarray(counts, np.float32)}).write(path)


def read(path):
    """An image as lf-synth writes it."""
    import OpenEXR

    return OpenEXR.File(path, separate_channels=True).channels()["Y"].pixels.astype(float)


def frames(folder, layout, turn, stop, density, seed, width, height, count, blur=None):
    """Particles at random in a box, which all move alike through it; those outside are dark."""
    turn, sensor, count = float(turn), (int(width), int(height)), int(count)
    random, blur = np.random.default_rng([int(seed), 2026]), blur and Blur(layout, blur)
    os.makedirs(folder, exist_ok=True)
    half = 0.5 * PIXEL / MAGNIFICATION
    box = np.array([half * sensor[0] - MARGIN, half * sensor[1] - MARGIN, DEPTH])
    cell = PITCH * (PITCH if layout == "square" else ROW) / MAGNIFICATION**2
    # Beyond the box they are as dense: they come in as others go.
    wide = box + np.abs(MOVE) * (count - 1)
    total = round(float(density) * 4 * box[0] * box[1] / cell * np.prod(wide / box))
    start = random.uniform(-wide, wide, (total, 3))
    with open(f"{folder}/camera.json", "w") as out:
        json.dump(camera(sensor, layout, turn, stop, blur), out, indent=1)
    with open(f"{folder}/particles.csv", "w") as table:
        print(HEAD, file=table)
        for frame in range(count):
            places = start + frame * np.array(MOVE)
            electrons = np.zeros(sensor[0] * sensor[1])
            for number in np.flatnonzero((np.abs(places) < box).all(1)):
                print(frame, number, *(repr(float(c)) for c in places[number]), PHOTONS, sep=",", file=table)
                electrons += landed(random, random.poisson(PHOTONS), places[number], sensor, layout, turn, stop, blur)
            counts = electrons + DARK + READ_NOISE * random.standard_normal(electrons.shape)
            write(f"{folder}/frame-{frame:04}.exr", np.maximum(counts, 0).reshape(sensor[::-1]))
    write(f"{folder}/dark.exr", np.full(sensor[::-1], DARK))


def one(folder, layout, turn, stop, place, count):
    """A frame of one particle without noise, of as much light as in `frames`."""
    os.makedirs(folder, exist_ok=True)
    sensor, turn, random = (840, 700), float(turn), np.random.default_rng(1)
    place, batches = [float(c) for c in place.split(",")], int(count) // PHOTONS
    light = sum(landed(random, PHOTONS, place, sensor, layout, turn, stop) for _ in range(batches))
    with open(f"{folder}/camera.json", "w") as out:
        json.dump(camera(sensor, layout, turn, stop), out, indent=1)
    with open(f"{folder}/particles.csv", "w") as table:
        print(HEAD + "\n0,0", *place, PHOTONS, sep=",", file=table)
    write(f"{folder}/one.exr", (light / batches).reshape(sensor[::-1]))


def apart(first, second, count):
    """Total variation of the light of two images, and what is expected of the first image's photons."""
    a, b = read(first), read(second)
    counting = 0.5 * np.sqrt(2 / (np.pi * float(count)) * b / b.sum()).sum()
    print(f"{100 * 0.5 * np.abs(a - b).sum() / b.sum():.2f} % apart, by counting {100 * counting:.2f} %; "
          f"light {a.sum():.0f} and {b.sum():.0f}, brightest {a.max():.0f} and {b.max():.0f}")


if __name__ == "__main__":
    {"--one": one, "--apart": apart}.get(sys.argv[1], lambda *given: frames(sys.argv[1], *given))(*sys.argv[2:])

"""Scenes of real optics: lenslets that diffract, a blurred sensor of 12 bits, and a camera that was calibrated.

The camera is not the true one: `lf-calib` makes it from data sheets and a noisy white image.
"""
import json

import lab
from lab import PIXEL, Run

WAVELENGTH_NM, BLUR_PX = 532, 0.3
SENSOR = {"photon_noise": True, "gain_counts_per_electron": 0.5, "read_noise_electrons": 3, "bits": 12, "dark_counts": 40}
WHITE, WHITES = {"counts": 2000, "rays_per_lenslet": 200000}, 2
SIDE = 560  # px
LIGHT = {"wavelength_nm": WAVELENGTH_NM}


def blurred(sigma_px):
    """The block `blur` of a camera."""
    return LIGHT | {"sigma_px": sigma_px}


BLUR = f"camera.blur={json.dumps(blurred(BLUR_PX))}"
NOISE = f"sensor_noise={json.dumps(SENSOR)}"
DARK = f'sensor_noise={{"dark_counts": {SENSOR["dark_counts"]}}}'


class Case:
    """A camera. Lenslets have the f-number of the main lens."""

    def __init__(self, layout, turn, stop, f_number=4, magnification=1.0):
        self.layout, self.turn, self.stop, self.f_number, self.magnification = layout, turn, stop, f_number, magnification
        self.pixel = PIXEL / magnification  # at the focal plane, mm
        # Depth is measured in that of f/4 at m = 1.
        self.depth_scale = f_number / 4 / magnification**2
        self.depth = {1: 5, 2: 5, 4: 12, 8: 20}[self.depth_scale]  # mm
        self.name = f"{layout}, {'turned' if turn else 'in line'}, {stop} stop, f/{f_number}, m = {magnification:g}"
        self.folder = f"{layout}-{turn:g}-{stop}-{f_number}-{magnification:g}"

    def keys(self):
        lenses = {"microlenses.layout": self.layout, "microlenses.rotation_rad": self.turn, "main_lens.aperture": self.stop,
                  "main_lens.magnification": self.magnification, "main_lens.working_f_number": self.f_number,
                  "microlenses.focal_length_mm": 0.077 * self.f_number}
        return [f"camera.{key}={value}" for key, value in lenses.items()]


# Six of the sixteen combinations, such that each pair of settings is there. All lattices are turned, as real ones are:
# in line with the pixels, a white image of a square stop hardly shows the pitch.
CASES = [Case("square", 0.003, "square"), Case("square", 0.003, "circle", 8), Case("hexagonal", 0.003, "circle"),
         Case("hexagonal", 0.003, "square", 8, 0.5), Case("square", 0.003, "circle", 4, 0.5),
         Case("hexagonal", 0.003, "square")]


def box(*halves):
    """Keys of a volume of these halves, mm."""
    return [f"volume.{axis}_mm=[-{half},{half}]" for axis, half in zip("xyz", halves)]


def render(folder, case, density, seed, *keys, base="uniform", frames=1, blur_px=BLUR_PX, side=SIDE, half_mm=0.9,
           sensor=SENSOR):
    """Frames, their dark frame, and what a laboratory knows of the camera: calibrated.json. blur_px None: an ideal lens."""
    half = half_mm / case.magnification
    blur = [] if blur_px is None else [f"camera.blur={json.dumps(blurred(blur_px))}"]
    # Calibration images see the same stop.
    blur += [key for key in keys if key.startswith(("second_stop=", "camera.blades=", "camera.main_lens.working"))]
    camera = [*case.keys(), *blur, f"camera.sensor.width={side}", f"camera.sensor.height={side}"]
    noise = [f"sensor_noise={json.dumps(sensor)}"]
    scene = [*camera, f"seed={seed}", f"frames={frames}", f"particles.per_lenslet={density}", "particles.rays=400000",
             *box(half, half, case.depth), "truth=null", *keys]
    lab.scene(folder, base, *scene, *noise, dark=f'sensor_noise={{"dark_counts": {sensor["dark_counts"]}}}', kept=True)
    calibrate(folder, case, camera, noise, blur_px, side)


def calibrate(folder, case, camera, noise, blur_px, side):
    """calibrated.json, from the data sheets and from white images. The blur is that of the data sheets: its wavelength."""
    # Images of a square stop touch and leave no gaps: its white image is taken with a smaller one.
    closed = case.stop == "square"
    white = WHITE | ({"working_f_number": 1.3 * case.f_number} if closed else {})
    keys = [*camera, *noise, f"white={json.dumps(white)}", "truth=null"]
    lab.save(f"{folder}/white.json", Run("lf-synth scene uniform", *lab.setting(keys)).json())
    whites = [f"{folder}/white-{n}.exr" for n in range(WHITES)]
    for n, white in enumerate(whites):
        Run(f"lf-synth white {folder}/white.json --seed {n + 1} -o {white}")
    nominal = f"{folder}/nominal.json"
    Run(f"lf-calib nominal --sensor {side}x{side} --pixel 5.5um --f 200 --magnification {case.magnification} --pitch 77um "
        f"--f-number {case.f_number} --lenslet-f {77 * case.f_number}um --layout {case.layout} --aperture {case.stop} -o {nominal}")
    if blur_px is not None:
        lab.save(nominal, lab.load(nominal) | {"blur": blurred(BLUR_PX)})
    Run(f"lf-calib lattice {'--keep-f-number' if closed else ''}", *whites, "--dark", f"{folder}/dark.exr", "-c", nominal,
        "-o", f"{folder}/calibrated.json")

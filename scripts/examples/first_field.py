#!/usr/bin/env python3
"""From a flow to vectors, in steps to read and to run: first_field.py [FOLDER]. A quarter of an hour for you; the
computer takes a minute or two of it, if it is idle.

Everything is made here: a camera, particles in a known flow, the two frames that the camera would take, and a white
image. Then you forget what you know, and find the flow from the images. FOLDER (first_field) gets the files, and a
picture of each step. Needs the tools on the PATH, and numpy, OpenEXR, xxhash and matplotlib. Read the text of a step
here, look at its picture, change a number, and run it again.
"""

import sys
import time
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "python"))
import lf


def stop(kind, error, trace):
    """Ends in one line if a tool or a module refuses."""
    if issubclass(kind, lf.Refused):
        print(f"first_field.py: {error}", file=sys.stderr)
    else:
        sys.__excepthook__(kind, error, trace)


sys.excepthook = stop
np = lf.module("numpy", "to read files")
lf.module("matplotlib", "to draw").use("agg")

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "first_field")
folder.mkdir(parents=True, exist_ok=True)
began = time.perf_counter()


def at(name):
    """The path of a file of this tutorial."""
    return folder / name


def picture(name, view):
    """Saves a picture and says when."""
    view.figure.savefig(at(name), dpi=120)
    print(f"{time.perf_counter() - began:5.0f} s  {at(name)}")


# 1. A scene.
# A scene says what the camera is, where the particles are and how they move. `demo` is a ready one: a vortex ring in a
# volume 4.6 mm wide and 10 mm deep. The particles move by up to 0.1 mm from frame to frame. Voxels twice as deep as the
# ready scene's halve the work.
DEPTH_MM = (-5, 5)
VOXEL_PX = (2, 2, 20)  # Pixels at the focal plane along x, y and z: 0.011, 0.011 and 0.11 mm.
SIDES_MM = (-2.31, 2.31, -2.31, 2.31)
voxels = f"[{','.join(map(str, VOXEL_PX))}]"
scene = lf.run("lf-synth", "scene", "demo", "--set", f"truth.pixels_per_voxel={voxels}")
lf.write(at("scene.json"), scene)

# 2. Frames.
# lf-synth traces the rays of every particle through the main lens and the microlenses to the sensor. Each microlens
# draws a small round image of the lens's stop. Where a pixel lies in it gives the direction of its ray: this is why one
# image knows depth. Look at the picture: a particle near the focal plane lights one microlens, one far from it many.
lf.run("lf-synth", "frames", at("scene.json"), output=at("scene"))
frame = lf.read(at("scene/frame-0000.exr"))
view = lf.show(frame[400:620, 400:620])
view.set_title("a part of the first frame: one small image under each microlens")
picture("1-frame.png", view)

# 3. The camera.
# In a laboratory you know the camera from its data sheets, and only about. A white image, of an evenly lit screen,
# shows where the microlenses are; lf-calib finds them to a hundredth of a pixel.
lf.run("lf-synth", "white", at("scene.json"), output=at("white.exr"))
camera = {
    "sensor": {"width": 1092, "height": 1092, "pixel_pitch_mm": 0.0055},
    "main_lens": {"focal_length_mm": 200.0, "magnification": 1.0, "working_f_number": 4.0, "aperture": "circle"},
    "microlenses": {
        "layout": "square",
        "pitch_mm": 0.077,
        "focal_length_mm": 0.308,
        "rotation_rad": 0.0,
        "offset_mm": [0.0, 0.0],
    },
}
lf.write(at("nominal.json"), camera)
lf.run("lf-calib", "lattice", at("white.exr"), camera=at("nominal.json"), output=at("camera.json"))
view = lf.show(lf.read(at("white.exr"))[400:620, 400:620])
view.set_title("the same part of the white image")
picture("2-white.png", view)

# 4. Particles.
# lf-prune keeps the voxels from which every ray meets light: one of twelve here. lf-fit finds single particles there
# and fits them to the pixels, with their uncertainty. It also draws them as a volume.
grid = {"pvr": VOXEL_PX, "depth": DEPTH_MM, "bounds": SIDES_MM}
for n in (0, 1):
    image = {"image": at(f"scene/frame-000{n}.exr"), "camera": at("camera.json")}
    lf.run("lf-prune", image["image"], camera=image["camera"], **grid, output=at(f"support-{n}.lfv"))
    found = {"particles": at(f"particles-{n}.csv"), "output": at(f"volume-{n}.lfv")}
    lf.run("lf-fit", at(f"support-{n}.lfv"), **image, **found)
picture("3-volume.png", lf.show(at("volume-0.lfv"), "y"))
picture("4-particles.png", lf.show(at("particles-0.csv")))
particles = lf.read(at("particles-0.csv"))
for axis in "xyz":
    stated = 1000 * float(np.median(particles[f"s{axis}_mm"]))
    print(f"         a particle's {axis} is known to {stated:.2f} um, at the median")

# 5. Vectors.
# lf-xcorr compares the two volumes window by window, and refines what it finds with the particles.
lf.run(
    "lf-xcorr",
    at("volume-0.lfv"),
    at("volume-1.lfv"),
    particles=[at("particles-0.csv"), at("particles-1.csv")],
    output=at("field.exr"),
)
picture("5-field.png", lf.show(at("field.exr")))
picture("6-field-from-the-side.png", lf.show(at("field.exr"), "y"))

# 6. The truth.
# Nobody has it in a laboratory. Here we do: the error is in pixels at the focal plane, of 0.0055 mm.
score = lf.run("lf-validate", "displacement", at("scene/scene-used.json"), at("field.exr"), camera=at("camera.json"))
print("         RMS error: " + ", ".join(f"{axis} {score[f'rms_{axis}_px']:.2f} px" for axis in "uvw"))

# Now ask for fewer particles (`--set particles.per_lenslet=0.1` in step 1), for a smaller stop of the lens
# (`working_f_number`), for noise (`--set 'sensor_noise={"photon_noise": true, "read_noise_electrons": 20}'`), and see
# what becomes of the error. With a camera of your own, begin at step 3 with your own white image, and put its data
# sheets in place of `camera`.

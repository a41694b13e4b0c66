"""Every stage at the ends of its ranges; see scripts/studies/extremes. Needs numpy, OpenEXR and xxhash."""

import json
import os
import re
import subprocess
import sys

import lf
import numpy as np
import OpenEXR

OPTICS = 'camera.main_lens.'


class Refused(Exception):
    """A run that ends with exit code 2 and one line."""


def run(line):
    """Runs a line; returns what it prints. Anything but success or a refusal in one line ends the study."""
    done = subprocess.run(line + " -q", shell=True, capture_output=True, text=True)
    lines = [line for line in done.stderr.splitlines() if ": warning: " not in line]
    if done.returncode == 2 and len(lines) == 1 and "internal error" not in lines[0]:
        raise Refused(lines[0])
    if done.returncode != 0:
        raise SystemExit(f"{line}\nexit {done.returncode}: {done.stderr}")
    return done.stdout


def scene(name, *keys, px=196):
    """Renders the two frames of a scene of 14 x 14 lenslets into the folder NAME."""
    half = 0.5 * px * 0.0055
    keys = [f"camera.sensor.width={px}", f"camera.sensor.height={px}", f"volume.x_mm=[-{half},{half}]",
            f"volume.y_mm=[-{half},{half}]", "volume.z_mm=[-2,2]", "particles.rays=20000",
            'truth={"pixels_per_voxel": [1, 1, 10], "sigma_vox": 0.75, "vectors": [3, 3, 3]}', *keys]
    words = " ".join(f"--set '{key}'" for key in keys)
    text = run(f"lf-synth scene uniform {words}")
    with open(f"{name}.json", "w") as file:
        file.write(text)
    run(f"lf-synth frames {name}.json -o {name}")


def reconstruct(name, more="", image=None, prune=""):
    """Prunes and reconstructs the first frame on the grid of its truth; returns the volume's file and the record."""
    image = image or f"{name}/frame-0000.exr"
    run(f"lf-prune {image} -c {name}/camera.json --like {name}/truth-0000.lfv {prune} -o {name}/support.lfv")
    run(f"lf-mart {name}/support.lfv -i {image} -c {name}/camera.json {more} -o {name}/volume.lfv --stats mart.json")
    with open("mart.json") as file:
        return f"{name}/volume.lfv", json.load(file)["counts"]


def quality(name, volume):
    return json.loads(run(f"lf-validate quality {name}/truth-0000.lfv {volume}"))


def finite(volume):
    values = volume.columns["intensity"]
    return bool(np.isfinite(values).all() and (values >= 0).all())


def write_image(path, pixels):
    header = {"compression": OpenEXR.ZIPS_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"Y": np.ascontiguousarray(pixels, dtype=np.float32)}).write(path)


def frames_of(name):
    return [lf.read_image(f"{name}/frame-000{n}.exr")[0] for n in range(2)]


def blobs(path, places, sigma, shape=(64, 64, 64), gain=1.0):
    """A volume of Gaussians of brightness 1 times the gain, cut at 1e-4."""
    total = np.zeros(shape[::-1])
    z, y, x = np.meshgrid(*[np.arange(n) for n in shape[::-1]], indexing="ij")
    for place in places:
        total += np.exp(-0.5 * sum(((axis - p) / s) ** 2 for axis, p, s in zip((x, y, z), place, sigma)))
    index = np.flatnonzero(total.ravel() > 1e-4)
    grid = lf.Grid(shape=list(shape), spacing_mm=[1.0, 1.0, 1.0], origin_mm=[0.0, 0.0, 0.0])
    values = (total.ravel()[index] * gain).astype(np.float32)
    lf.write_volume(path, lf.Volume(grid, index.astype(np.uint64), {"intensity": values}))


rows = []


def row(topic, value, work):
    """Runs a case and notes its answer: words, or the line of its refusal."""
    try:
        answer = work()
    except Refused as refused:
        answer = "refused: " + re.sub(r"(?<=\.[0-9]{5})[0-9]+", "", str(refused))[:150]
    rows.append((topic, value, answer))
    print(f"{topic}: {value}: {answer}", file=sys.stderr, flush=True)


def table():
    """One row a topic: each value with its answer; finite answers do not say so."""
    print("| what | value: answer, `-` if refused with a line |\n| --- | --- |")
    for topic in dict.fromkeys(topic for topic, _, _ in rows):
        answers = []
        for _, value, answer in (row for row in rows if row[0] == topic):
            short = "-" if answer.startswith("refused") else answer.removeprefix("finite; ")
            answers.append(f"{value}: {short}")
        print(f"| {topic} | {'; '.join(answers)} |")


def intensities():
    """Images times a factor: the volume must be the same volume times the factor."""
    scene("light", "particles.per_lenslet=0.3")
    image = frames_of("light")[0]
    reference = lf.read_volume(reconstruct("light")[0])
    wanted = dict(zip(reference.indices.tolist(), reference.columns["intensity"].astype(float)))
    most = float(image.max())
    for brightest in [1e-42, 1e-40, 1e-37, 1e-30, 1e-10, 1.0, 1e10, 1e30, 1e37, 3e38]:
        def work():
            pixels = (image.astype(float) * (brightest / most)).astype(np.float32)
            write_image("scaled.exr", pixels)
            volume = lf.read_volume(reconstruct("light", image="scaled.exr")[0])
            values = volume.columns["intensity"].astype(float) * (most / brightest)
            found = dict(zip(volume.indices.tolist(), values))
            peak = max(wanted.values())
            off = max(abs(found.get(k, 0) - wanted.get(k, 0)) for k in {*found, *wanted}) / peak
            assert finite(volume)
            return f"finite; {off:.0e}"
        row("brightest pixel of a frame, counts: largest error of a voxel over the brightest", f"{brightest:g}", work)


def gains():
    """lf-xcorr of volumes times a factor: the same field."""
    rng = np.random.default_rng(5)
    places = rng.uniform(4, 60, (60, 3))
    move = np.array([1.3, -0.7, 0.4])
    blobs("a.lfv", places - move / 2, (1, 1, 1))
    fields = {}
    for gain in [1.0, 1e-41, 1e-38, 1e-30, 1e30, 1e38]:
        def work():
            blobs("b.lfv", places + move / 2, (1, 1, 1), gain=gain)
            run("lf-xcorr a.lfv b.lfv --window 24,24,24 --overlap 0.5 -o field.exr")
            field = lf.read_field("field.exr")[1]
            found = np.stack([field[key].ravel() for key in "uvw"]), field["flag"].ravel()
            fields.setdefault("first", found)
            good = (found[1] == 0) & (fields["first"][1] == 0)
            off = np.abs(found[0] - fields["first"][0])[:, good].max()
            error = np.sqrt(((found[0] - move[:, None])[:, good] ** 2).mean())
            return f"finite; {error:.3f}, {off:.0e}"
        row("gain of the second volume: RMS of the field, voxels; most against gain 1", f"{gain:g}", work)


def sums():
    """Sums of many voxels in 32 bits: against 64 bits by numpy, and against a plain 32-bit sum."""
    def many(count):
        rng = np.random.default_rng(3)
        values = np.concatenate([rng.uniform(0.5, 1.5, count // 10).astype(np.float32) for _ in range(10)])
        values[::1000] *= 1e4
        side = int(np.ceil(np.sqrt(count / 16)))
        grid = lf.Grid(shape=[side, side, 16], spacing_mm=[1.0] * 3, origin_mm=[0.0] * 3)
        lf.write_volume("many.lfv", lf.Volume(grid, np.arange(count, dtype=np.uint64), {"intensity": values}))
        return values

    def plain(values, times=1):
        """The sum in 32 bits, one voxel after the other."""
        total = np.float32(0)
        for _ in range(times):
            for part in np.array_split(values, max(1, len(values) // 10**7)):
                total = np.cumsum(np.concatenate([[total], part]), dtype=np.float32)[-1]
        return float(total)

    for count in [10**5, 10**6, 10**7, 5 * 10**7]:
        def work():
            values = many(count)
            found = json.loads(run("lf-validate quality many.lfv many.lfv"))
            exact = values.sum(dtype=np.float64)
            return (f"finite; {abs(found['volume_sum'] / exact - 1):.0e}, {abs(found['q'] - 1):.0e} "
                    f"({abs(plain(values) / exact - 1):.0e})")
        row("voxels of a volume: error of its sum and of Q, both 64 bits (of a sum in 32 bits)", f"{count:.0e}", work)

    def billion():
        values, times = many(10**8), 10
        found = json.loads(run(f"lf-validate depth {' '.join(['many.lfv'] * times)}"))
        exact = values.sum(dtype=np.float64)
        return f"finite; {abs(found['light'] / exact - 1):.0e} ({abs(plain(values, times) / (times * exact) - 1):.0e})"
    row("voxels of ten volumes: error of their light, 64 bits (of a sum in 32 bits)", "1e+09", billion)
    os.remove("many.lfv")


def solver():
    """Relaxation and sweeps: Q against the truth, misfit."""
    scene("solve", "particles.per_lenslet=0.1")
    for method in ["subsets", "smart", "mlem", "mart"]:
        for mu in [1e-6, 1e-3, 1, 2, 10, 100]:
            def work():
                prune = "--threshold 0.05" if method == "mart" else ""
                volume, counts = reconstruct("solve", f"--method {method} --relaxation {mu} --iterations 20", prune=prune)
                assert finite(lf.read_volume(volume))
                return f"finite; {quality('solve', volume)['q']:.3f}, {counts['misfit']:.3f}"
            row(f"relaxation with --method {method}: Q, misfit", f"{mu:g}", work)
    for sweeps in [1, 10, 100, 1000, 100000]:
        def work():
            scene("tiny", "particles.count=2", "particles.per_lenslet=null", px=56)
            volume, counts = reconstruct("tiny", f"--iterations {sweeps} --until never")
            assert finite(lf.read_volume(volume))
            return f"finite; {quality('tiny', volume)['q']:.3f}, {counts['misfit']:.3f}"
        row("sweeps, two particles: Q, misfit", f"{sweeps}", work)


def chain(name, *keys, px=196, more="", prune=""):
    scene(name, *keys, px=px)
    return reconstructed(name, more, prune)


def reconstructed(name, more="", prune=""):
    volume, counts = reconstruct(name, more, prune=prune)
    assert finite(lf.read_volume(volume))
    return f"finite; {quality(name, volume)['q']:.3f}, {counts['misfit']:.3f}"


def sizes():
    with open("middle.csv", "w") as file:
        file.write("# frame: right-handed\nframe,id,x_mm,y_mm,z_mm,intensity\n0,0,0,0,0.3,20000\n")
    for px, what in [(1, "one pixel"), (14, "one lenslet"), (28, "2 x 2 lenslets"), (43, "3 lenslets and a pixel")]:
        one = 'particles={"csv": "middle.csv", "sigma_px": 1.0, "rays": 20000}'
        row("sensor, one particle: Q, misfit", what, lambda: chain("small", one, "flow=null", px=px,
                                           prune="--keep-all"))
    one = ['camera.sensor.pixel_pitch_mm=0.077', "particles.count=3", "particles.per_lenslet=null"]
    row("pixels under a lenslet: Q, misfit", "1", lambda: chain("coarse", *one, px=14))


def optics():
    for number in [0.5, 1, 1.4, 2, 4, 8, 16, 32, 100, 1000]:
        row("f-number of lens and lenslets: Q, misfit", f"{number:g}", lambda: chain(
            "stop", f"{OPTICS}working_f_number={number}", f"camera.microlenses.focal_length_mm={0.077 * number}",
            "particles.per_lenslet=0.2"))
    for m in [0.01, 0.05, 0.1, 0.5, 1, 2, 10, 50, 100]:
        half, deep = 0.539 / m, 2 / m ** 1.5 if m < 1 else 2 / m
        row("magnification: Q, misfit", f"{m:g}", lambda: chain(
            "lens", f"{OPTICS}magnification={m}", f"volume.x_mm=[-{half},{half}]", f"volume.y_mm=[-{half},{half}]",
            f"volume.z_mm=[-{deep},{deep}]", "particles.per_lenslet=0.2"))


def single(name, place, rays=200000, px=392, *more):
    """One particle: the centre of the light found, against its place, px of the focal plane."""
    with open("one.csv", "w") as file:
        file.write("# frame: right-handed\nframe,id,x_mm,y_mm,z_mm,intensity\n")
        file.write(f"0,0,{place[0]},{place[1]},{place[2]},100000\n")
    x, y, z = place
    keys = ['particles={"csv": "one.csv", "sigma_px": 1.0, "rays": RAYS}'.replace("RAYS", str(rays)), "flow=null", "frames=1",
            f"volume.x_mm=[{x - 0.1},{x + 0.1}]", f"volume.y_mm=[{y - 0.1},{y + 0.1}]",
            f"volume.z_mm=[{z - 0.5},{z + 0.5}]", *more]
    scene(name, *keys, px=px)
    volume = lf.read_volume(reconstruct(name)[0])
    assert finite(volume)
    values = volume.columns["intensity"].astype(float)
    nx, ny, _ = volume.grid.shape
    index = volume.indices.astype(np.int64)
    voxel = np.stack([index % nx, index // nx % ny, index // (nx * ny)])
    centre = [volume.grid.origin_mm[a] + volume.grid.spacing_mm[a] * (values * voxel[a]).sum() / values.sum()
              for a in range(3)]
    off = [(c - p) / 0.0055 for c, p in zip(centre, place)]
    return "finite; " + ", ".join(f"{o:.2f}" for o in off)


def places():
    row("one particle: error of x, y, z, px", "in the focal plane", lambda: single("at", (0, 0, 0)))
    row("one particle: error of x, y, z, px", "0.01 px of depth from it", lambda: single("at", (0.01, -0.02, 0.00005)))
    for x in [1.0, 1.07, 1.078, 1.1]:
        row("one particle near the sensor's end at 1.078 mm: error of x, y, z, px", f"x {x} mm, in focus",
            lambda: single("at", (x, 0, 0)))
    for lenslets in [1, 5, 20, 100, 300, 500, 600]:
        keys = ["camera.microlenses.pitch_mm=0.0275", "camera.microlenses.focal_length_mm=0.11"]
        place = (0.02, 0.01, -4 * 0.0275 * lenslets)
        row("one particle that lights so many lenslets of 5 px along x: error of x, y, z, px", f"{lenslets}",
            lambda: single("at", place, min(200000 * lenslets, 20000000), max(300, 5 * lenslets + 100), *keys))


def crowds():
    row("particles a lenslet: Q, misfit", "0", lambda: chain("crowd", "particles.count=0", "particles.per_lenslet=null"))
    for density in [0.01, 0.1, 0.5, 1, 2, 5, 10]:
        row("particles a lenslet: Q, misfit", f"{density}", lambda: chain("crowd", f"particles.per_lenslet={density}"))
    def recorded(dark, noise, well):
        """A frame with noise about a dark level, which is taken off as a background."""
        write_image("dark.exr", np.full((196, 196), dark))
        key = (f'sensor_noise={{"dark_counts": {dark}, "read_noise_electrons": {noise}, '
               f'"full_well_electrons": {well}}}')
        scene("noisy", "particles.per_lenslet=0.1", "particles.intensity=20000", "frames=1", key)
        return reconstructed("noisy", "-b dark.exr", "-b dark.exr")

    for noise in [0, 1, 10, 100, 1000, 10000]:
        row("read noise, electrons; brightest pixel 208: Q, misfit", f"{noise}",
            lambda: recorded(100 + 8 * noise, noise, 1e9))
    for well in [1e9, 1000, 200, 120, 110, 101]:
        row("full well, electrons, with 100 of dark; brightest pixel 208: Q, misfit", f"{well:g}",
            lambda: recorded(100, 1, well))


def windows():
    rng = np.random.default_rng(9)
    places = rng.uniform(2, 62, (400, 3))

    def field(move, words):
        move = np.array(move)
        blobs("a.lfv", places - move / 2, (1, 1, 1))
        blobs("b.lfv", places + move / 2, (1, 1, 1))
        run(f"lf-xcorr a.lfv b.lfv {words} -o field.exr")
        field = lf.read_field("field.exr")[1]
        found, flag = np.stack([field[key].ravel() for key in "uvw"]), field["flag"].ravel()
        good = flag == 0
        assert np.isfinite(found[:, flag != 2]).all()
        if not good.any():
            return "finite; none"
        error = np.sqrt(((found - move[:, None])[:, good] ** 2).mean())
        return f"finite; {good.mean():.0%}, {error:.3f}"

    for side in [1, 2, 3, 5, 8, 12, 16, 24, 32, 48, 64, 65]:
        row("side of a window, voxels, in a volume of 64: measured, RMS in voxels", f"{side}", lambda: field(
            [0.6, -0.4, 0.3], f"--window {side},{side},{side} --overlap 0.5"))
    for move in [0, 0.01, 0.5, 2, 6, 12, 18, 24, 31]:
        row("displacement, voxels, window of 32: measured, RMS in voxels", f"{move}", lambda: field(
            [move, 0, 0], "--window 32,32,32 --initial 32,32,32 --search 32,8,8 --overlap 0.5"))


TOPICS = {"intensities": intensities, "gains": gains, "sums": sums, "solver": solver, "sizes": sizes, "optics": optics,
          "places": places, "crowds": crowds, "windows": windows}

if __name__ == "__main__":
    for topic in sys.argv[1:] or TOPICS:
        TOPICS[topic]()
    table()

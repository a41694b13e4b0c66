#!/usr/bin/env python3
"""Measures settings of lf-prune and lf-mart on scenes of many cameras, for scripts/studies/presets.

    presets.py run SET FOLDER [SETTING...]   runs settings on a set of scenes; what FOLDER holds already is not run again
    presets.py table SET FOLDER [SETTING...] prints w, u, Q, lost particles, seconds and how many errors the stated
                                             uncertainties cover, of each scene and setting

SET is `choose` or `report`. A setting is a name of SETTINGS below, or `name=PRUNE OPTIONS/MART OPTIONS`. Each scene is
rendered with three seeds. Seconds are processor seconds of one thread, for both frames.
"""
import json
import math
import os
import resource
import statistics
import subprocess
import sys

PITCH_PX = 14
PIXEL = 0.0055
LENSLETS = 24
# A camera of 12 bits.
NOISE = {
    "gain_counts_per_electron": 0.2, "photon_noise": True, "full_well_electrons": 20000.0, "read_noise_electrons": 12.0,
    "dark_counts": 40.0, "bits": 12,
}
# Particles that a window holds on average.
IN_WINDOW = 10.0

# Scenes: layout, rotation (rad), stop, magnification, f-number, particles per lenslet, whether noisy, flow.
CHOOSE = {
    "s1": ("square", 0.0, "circle", 1.0, 4.0, 0.5, False, "uniform"),
    "s2": ("square", 0.0, "square", 0.5, 4.0, 0.2, True, "uniform"),
    "s3": ("square", 0.0, "circle", 2.0, 8.0, 1.0, True, "sheared"),
    "s4": ("square", 0.003, "circle", 1.0, 4.0, 0.5, True, "sheared"),
    "s5": ("square", 0.003, "square", 1.0, 8.0, 0.2, False, "uniform"),
    "h1": ("hexagonal", 0.0, "circle", 1.0, 4.0, 0.2, True, "sheared"),
    "h2": ("hexagonal", 0.003, "circle", 1.0, 4.0, 0.5, False, "uniform"),
    "h3": ("hexagonal", 0.003, "square", 2.0, 4.0, 0.5, True, "uniform"),
    "h4": ("hexagonal", 0.0, "circle", 1.0, 4.0, 1.0, False, "uniform"),
    "S1": ("square", 0.0, "circle", 1.0, 4.0, 1.0, True, "sheared"),
    "S2": ("square", 0.0, "circle", 0.5, 8.0, 0.5, True, "uniform"),
    "S3": ("square", 0.0, "square", 2.0, 4.0, 0.5, False, "uniform"),
    "S4": ("square", 0.003, "circle", 2.0, 4.0, 0.2, True, "uniform"),
    "S5": ("square", 0.003, "square", 0.5, 4.0, 0.5, False, "sheared"),
    "H1": ("hexagonal", 0.003, "circle", 1.0, 4.0, 0.5, True, "uniform"),
    "H2": ("hexagonal", 0.0, "square", 1.0, 4.0, 0.2, False, "sheared"),
    "H3": ("hexagonal", 0.0, "circle", 2.0, 8.0, 0.5, True, "uniform"),
    "H4": ("hexagonal", 0.003, "circle", 0.5, 4.0, 0.5, True, "sheared"),
}
REPORT = {
    "R1": ("square", 0.0, "circle", 0.5, 4.0, 1.0, True, "sheared"),
    "R2": ("square", 0.0, "square", 1.0, 8.0, 0.5, False, "uniform"),
    "R3": ("square", 0.003, "circle", 2.0, 8.0, 0.5, True, "uniform"),
    "R4": ("square", 0.003, "square", 2.0, 4.0, 0.2, False, "sheared"),
    "R5": ("square", 0.003, "circle", 1.0, 4.0, 1.0, False, "sheared"),
    "X1": ("hexagonal", 0.0, "circle", 2.0, 4.0, 0.5, True, "sheared"),
    "X2": ("hexagonal", 0.003, "square", 0.5, 4.0, 0.2, False, "uniform"),
    "X3": ("hexagonal", 0.003, "circle", 1.0, 8.0, 0.5, True, "uniform"),
    "X4": ("hexagonal", 0.0, "circle", 1.0, 4.0, 1.0, True, "sheared"),
}
SETS = {"choose": (CHOOSE, (1, 2, 3)), "report": (REPORT, (21, 22, 23))}

SETTINGS = {
    "default": ("", ""),
    "fast": ("--preset fast", "--preset fast"),
    "balanced": ("--preset balanced", "--preset balanced"),
    "accurate": ("--preset accurate", "--preset accurate"),
}


def describe(scene):
    layout, rotation, stop, magnification, f_number, density, is_noisy, flow = scene
    turned = f"{1e3 * rotation:g} mrad" if rotation else "in line"
    noise = "12 bits" if is_noisy else "ideal"
    return f"{layout}, {turned}, {stop}, M {magnification:g}, f/{f_number:g}, {density:g}, {noise}, {flow}"


def build(scene, seed):
    """The scene's JSON, its window (mm) and its depth range (mm)."""
    layout, rotation, stop, magnification, f_number, density, is_noisy, flow = scene
    # As many lenslets are lit at the volume's ends in every camera.
    depth = 2.5 * f_number / 4.0 / magnification**2
    half = 0.5 * LENSLETS * PITCH_PX * PIXEL / magnification
    sensor = PITCH_PX * (LENSLETS + 11)
    px = PIXEL / magnification
    count = density * LENSLETS**2
    window = (IN_WINDOW / count * 8.0 * half * half * depth) ** (1 / 3)
    window = min(window, half)
    steps = depth / 2.5
    # The first pass of lf-xcorr searches an eighth of its window, which is twice the last one.
    along_z = min(0.06 * steps, window / 5.0)
    uniform = {"kind": "uniform", "displacement_mm": [3.6 * px, -2.4 * px, along_z]}
    # From side to side, w changes by 0.06 mm and v by 4 px.
    in_w = {"kind": "shear", "along": "z", "across": "x", "rate": 0.03 * steps / half}
    in_v = {"kind": "shear", "along": "y", "across": "x", "rate": 2.0 * px / half}
    flows = {"uniform": uniform, "sheared": [uniform, in_w, in_v]}
    found = {
        "frame": "right-handed",
        "camera": {
            "sensor": {"width": sensor, "height": sensor, "pixel_pitch_mm": PIXEL},
            "main_lens": {
                "focal_length_mm": 200.0, "magnification": magnification, "working_f_number": f_number, "aperture": stop
            },
            "microlenses": {
                "layout": layout, "pitch_mm": PITCH_PX * PIXEL, "focal_length_mm": PITCH_PX * PIXEL * f_number,
                "rotation_rad": rotation, "offset_mm": [0.0, 0.0],
            },
        },
        "volume": {"x_mm": [-half, half], "y_mm": [-half, half], "z_mm": [-depth, depth]},
        "particles": {"per_lenslet": density, "sigma_px": 0.75, "intensity": 100000.0, "rays": 50000},
        "flow": flows[flow],
        "frames": 2,
        "truth": {"pixels_per_voxel": [1.0, 1.0, 10.0], "sigma_vox": 0.75, "vectors": [9, 9, 9]},
        "seed": seed,
    }
    if is_noisy:
        found["sensor_noise"] = NOISE
    return found, window, depth, half


def call(*words, out=None):
    """Runs a tool. Gives its processor seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with open(out, "w") if out else open(os.devnull, "w") as stream:
        done = subprocess.run([str(word) for word in words], stdout=stream, stderr=subprocess.PIPE, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(map(str, words))}\n{done.stderr}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def render(name, scene, seed, folder):
    found, window, depth, half = build(scene, seed)
    path = f"{folder}/{name}-{seed}"
    os.makedirs(path, exist_ok=True)
    if not os.path.exists(f"{path}/flow.exr"):
        with open(f"{path}/scene.json", "w") as file:
            json.dump(found, file, indent=2)
        call("lf-synth", "frames", f"{path}/scene.json", "-o", path, "--quiet")
    if scene[6] and not os.path.exists(f"{path}/background.exr"):
        # The camera's dark level is its background.
        call("lf-synth", "dark", f"{path}/scene.json", "-o", f"{path}/background.exr", "--quiet")
    return path, window, depth, half


def measure(name, scene, seed, folder, setting, prune, mart):
    path, window, depth, half = render(name, scene, seed, folder)
    result = f"{path}/{setting}.json"
    if os.path.exists(result):
        return json.load(open(result))
    base = f"{path}/{setting}"
    subtract = ["-b", f"{path}/background.exr"] if scene[6] else []
    volume = ["--depth", f"{-depth},{depth}", "--bounds", f"{-half},{half},{-half},{half}"]
    seconds = {"prune": 0.0, "mart": 0.0, "xcorr": 0.0}
    kept = lost = particles = 0
    try:
        for n in range(2):
            frame = f"{path}/frame-000{n}.exr"
            seconds["prune"] += call(
                "lf-prune", frame, "-c", f"{path}/camera.json", *subtract, *volume, *prune.split(), "--threads", 1,
                "--truth", f"{path}/particles.csv", "--frame", n, "--stats", f"{base}-p.json", "-o", f"{base}-s.lfv", "--quiet")
            stats = json.load(open(f"{base}-p.json"))
            counts = stats.get("counts", stats)
            kept += counts["kept"] / counts["voxels"] / 2
            lost += counts.get("lost", 0)
            particles += counts.get("particles", 0)
            seconds["mart"] += call(
                "lf-mart", f"{base}-s.lfv", "-i", frame, "-c", f"{path}/camera.json", *subtract, *mart.split(),
                "--max-memory", 6, "--threads", 1, "-o", f"{base}-v{n}.lfv", "--quiet")
        pair = [f"{base}-v0.lfv", f"{base}-v1.lfv"]
        seconds["xcorr"] += call(
                "lf-xcorr", *pair, "--initial-mm", f"{min(2 * window, 2 * half):.6g}," * 2 + f"{min(2 * window, 2 * depth):.6g}",
                "--window-mm", f"{window:.6g},{window:.6g},{window:.6g}", "--overlap", 0.5, "-o", f"{base}.exr",
                "--threads", 1, "--quiet")
        call("lf-validate", "displacement", f"{path}/scene.json", f"{base}.exr", "-c", f"{path}/camera.json", out=f"{base}-d.json")
        score = json.load(open(f"{base}-d.json"))
        q = None
        try:
            call("lf-validate", "quality", f"{path}/truth-0000.lfv", f"{base}-v0.lfv", out=f"{base}-q.json")
            q = json.load(open(f"{base}-q.json"))["q"]
        except RuntimeError as error:
            # Other voxels than the truth's have no Q.
            if "grid" not in str(error):
                raise
        found = {"seconds": seconds, "kept": kept, "lost": lost, "particles": particles, "q": q, "score": score}
    except RuntimeError as error:
        found = {"failed": str(error)}
    for end in ("-s.lfv", "-v0.lfv", "-v1.lfv", "-p.json", "-d.json", "-q.json"):
        if os.path.exists(base + end):
            os.remove(base + end)
    json.dump(found, open(result, "w"))
    return found


def settings(names):
    """Options of lf-prune and lf-mart by the name of the setting."""
    found = dict(SETTINGS) if not names else {}
    for name in names:
        if name in SETTINGS:
            found[name] = SETTINGS[name]
            continue
        name, words = name.split("=", 1)
        found[name] = tuple(words.split("/"))
    return found


def scenes(which):
    table, seeds = SETS[which]
    return [(name, scene, seed) for seed in seeds for name, scene in table.items()]


def run(which, folder, names):
    for name, scene, seed in scenes(which):
        for setting, (prune, mart) in settings(names).items():
            found = measure(name, scene, seed, folder, setting, prune, mart)
            if "failed" in found:
                print(f"{name} seed {seed} {setting}: {found['failed']}", file=sys.stderr)


def combined(results):
    """One row of the table from the results of a scene's seeds: RMS of RMS, means, sums."""
    score = lambda key: [found["score"][key] for found in results]
    rms = lambda key: math.sqrt(statistics.fmean(value * value for value in score(key)))
    q = [found["q"] for found in results if found["q"] is not None]
    return {
        "w": rms("rms_w_px"),
        "u": rms("rms_u_px"),
        "q": statistics.fmean(q) if q else None,
        "lost": 100.0 * sum(found["lost"] for found in results) / max(1, sum(found["particles"] for found in results)),
        "kept": 100.0 * statistics.fmean(found["kept"] for found in results),
        "replaced": 100.0 * sum(score("replaced")) / max(1, sum(score("vectors"))),
        "covered": [100.0 * statistics.fmean(found["score"]["uncertainty"][f"within_1_{axis}"] for found in results) for axis in "uvw"],
        "seconds": statistics.fmean(sum(found["seconds"].values()) for found in results),
    }


def table(which, folder, names):
    print(f"{'':14s}     w, px    u, px        Q  lost, %  kept, %  replaced, %  seconds  covered u, v, w, %")
    ratios = {}
    for name, scene in SETS[which][0].items():
        print(f"{name}: {describe(scene)}")
        rows = {}
        for setting in settings(names):
            results = [json.load(open(f"{folder}/{name}-{seed}/{setting}.json")) for seed in SETS[which][1]]
            if any("failed" in found for found in results):
                print(f"  {setting:12s}    failed")
                continue
            rows[setting] = row = combined(results)
            q = f"{row['q']:8.3f}" if row["q"] is not None else "       -"
            print(
                f"  {setting:12s} {row['w']:9.3f} {row['u']:8.3f} {q} {row['lost']:8.2f} {row['kept']:8.2f}"
                f" {row['replaced']:12.1f} {row['seconds']:8.2f}     " + " ".join(f"{share:4.0f}" for share in row["covered"])
            )
        for setting, row in rows.items():
            if "default" in rows:
                ratio = ratios.setdefault(setting, {"w": [], "u": [], "seconds": []})
                for key, values in ratio.items():
                    values.append(row[key] / rows["default"][key])
    print("against the default of the same scene: geometric mean, least and greatest ratio")
    for setting, ratio in ratios.items():
        words = (
            f"{key} {statistics.geometric_mean(values):5.2f} ({min(values):4.2f} to {max(values):4.2f})"
            for key, values in ratio.items()
        )
        print(f"  {setting:12s} " + "   ".join(words))


if __name__ == "__main__":
    command, which, folder, *names = sys.argv[1:]
    {"run": run, "table": table}[command](which, folder, names)

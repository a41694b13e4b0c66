#!/usr/bin/env python3
"""Draws misaligned cameras for scripts/studies/calibrate, and judges what lf-calib volume finds from their dot targets.

    calibrate.py draw SEED DIR [perfect]   writes DIR/scene.json (the truth) and DIR/nominal.json (the data sheets)
    calibrate.py shift DIR                 removes the focus offset, unknown to a traverse, from DIR/target/dots.csv
    calibrate.py drift FILE FILE           writes a camera with its lattice 2 px aside
    calibrate.py whole DIR                 writes a camera with everything amiss: DIR/scene.json and DIR/nominal.json
    calibrate.py judge DIR...              counts parameters within 1, 2, 3 stated uncertainties, and terms made free
"""
import json
import math
import random
import sys

LENSLETS = 120
PITCH_PX = 14
PIXEL = 0.0055
# 1 % of the brightest sub-images' peak, about 1000 counts.
NOISE = {"read_noise_electrons": 10.0, "dark_counts": 100.0}


def camera(focal, magnification, gap, pitch, offset, rotation, tilt, k1, tangential):
    lens = {"focal_length_mm": focal, "magnification": magnification, "working_f_number": 4.0, "aperture": "circle"}
    lenslets = {
        "layout": "square", "pitch_mm": pitch, "focal_length_mm": 0.308, "rotation_rad": rotation, "offset_mm": offset
    }
    found = {
        "sensor": {"width": PITCH_PX * LENSLETS, "height": PITCH_PX * LENSLETS, "pixel_pitch_mm": PIXEL},
        "main_lens": lens,
        "microlenses": lenslets,
    }
    if gap != 0.308:
        lenslets["gap_mm"] = gap
    if tilt != [0.0, 0.0]:
        found["tilt"] = {"x_rad": tilt[0], "y_rad": tilt[1]}
    if k1 or tangential != [0.0, 0.0]:
        found["distortion"] = {"radial": [k1, 0.0, 0.0], "tangential": tangential}
    return found


def draw(seed, folder, perfect):
    rng = random.Random(1000 + seed)
    both = lambda most: 0.0 if perfect else rng.uniform(-most, most)
    magnification = 1.0 * (1.0 + both(0.01))
    focal = 200.0 * (1.0 + both(0.005))
    gap = 0.308 * (1.0 + both(0.03))
    shift = [both(0.3) * PIXEL, both(0.3) * PIXEL]
    turn = both(0.001)
    tilt = [both(0.005), both(0.005)]
    distance = focal * (1.0 + magnification)
    corner = math.hypot(1.0, 1.0) * 0.5 * LENSLETS * PITCH_PX * PIXEL / distance
    k1 = both(1.0) * 3.0 * PIXEL / (distance * corner**3)
    tangential = [both(0.3) * PIXEL / (distance * corner**2) for _ in range(2)]
    focus = both(0.2)
    k, k_nominal = gap / distance, 0.308 / 400.0
    # The lenslets' images are where a white image shows them, apart from the shift drawn above. With another k the
    # lenslets themselves are not where the nominal camera has them. A tilt also bends the lattice behind straight
    # images.
    truth = camera(
        focal, magnification, gap, 0.077 * (1 + k_nominal) / (1 + k), [s / (1 + k) for s in shift], turn, tilt, k1, tangential
    )
    if tilt != [0.0, 0.0]:
        radius = 0.5 * math.hypot(1.0, 1.0) * LENSLETS * PITCH_PX * PIXEL
        bend = [-math.tan(t) / distance * radius**2 for t in tilt]
        truth["centres"] = {
            "radius_mm": radius, "x_mm": [0.0, 0.0, bend[0], bend[1], 0.0], "y_mm": [0.0, 0.0, 0.0, bend[0], bend[1]]
        }
    nominal = camera(200.0, 1.0, 0.308, 0.077, [0.0, 0.0], 0.0, [0.0, 0.0], 0.0, [0.0, 0.0])
    depths = [-4.0, -2.7, -1.3, 0.0, 1.3, 2.7, 4.0]
    half = 0.5 * LENSLETS * PITCH_PX * PIXEL
    scene = {
        "camera": truth,
        "volume": {"x_mm": [-half, half], "y_mm": [-half, half], "z_mm": [-5.0, 5.0]},
        "particles": {"count": 0, "sigma_px": 1.0, "rays": 100000},
        "frames": 1,
        "dots": {
            "spacing_mm": 1.1, "diameter_mm": 0.05, "depths_mm": [z + focus for z in depths], "intensity": 500000.0,
            "rotation_rad": rng.uniform(-0.005, 0.005), "centre_mm": [rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3)]
        },
        "sensor_noise": NOISE,
        "seed": seed,
    }
    json.dump(scene, open(f"{folder}/scene.json", "w"), indent=1)
    json.dump(nominal, open(f"{folder}/nominal.json", "w"), indent=1)
    wanted = {
        "magnification": magnification, "focal_length_mm": focal, "gap_mm": gap, "offset_x_mm": shift[0] / (1 + k),
        "offset_y_mm": shift[1] / (1 + k), "rotation_rad": turn, "tilt_x_rad": tilt[0], "tilt_y_rad": tilt[1], "k1": k1,
        "k2": 0.0, "k3": 0.0, "p1": tangential[0], "p2": tangential[1], "focus_offset_mm": focus,
        "target_lean_x_rad": 0.0, "target_lean_y_rad": 0.0,
    }
    json.dump({"wanted": wanted, "focus": focus}, open(f"{folder}/truth.json", "w"), indent=1)


def shift(folder):
    """Subtracts the focus offset from the depths: a traverse knows the steps between depths, not the focal plane."""
    focus = json.load(open(f"{folder}/truth.json"))["focus"]
    lines = open(f"{folder}/target/dots.csv").read().splitlines()
    out = [line for line in lines if not line[0].isdigit()]
    for line in lines[len(out) :]:
        fields = line.split(",")
        fields[4] = repr(float(fields[4]) - focus)
        out.append(",".join(fields))
    open(f"{folder}/target/dots.csv", "w").write("\n".join(out) + "\n")


def judge(folders):
    within, grew, rows = {}, {}, []
    for folder in folders:
        wanted = json.load(open(f"{folder}/truth.json"))["wanted"]
        found = json.load(open(f"{folder}/camera.json"))["calibration"]["volume"]
        for name, truth in wanted.items():
            entry = found["parameters"].get(name)
            if entry is None or "value" not in entry:
                continue
            z = (entry["value"] - truth) / entry["standard_uncertainty"]
            within.setdefault(name, []).append((z, entry["free"], entry["standard_uncertainty"]))
            if entry["free"] and "evidence_deviations" in entry:
                grew[name] = grew.get(name, 0) + 1
        rows.append((found["residual_rms_before_px"], found["residual_rms_px"], found["expected_rms_px"], found["sub_images"]))
    print(f"{len(folders)} targets; mean RMS before, after, by the sub-images' own noise, px: "
          + ", ".join(f"{sum(r[i] for r in rows) / len(rows):.4f}" for i in range(3))
          + f"; sub-images {sum(r[3] for r in rows) // len(rows)}")
    print(f"{'parameter':20} {'free':>5} {'< 1 u':>6} {'< 2 u':>6} {'< 3 u':>6} {'worst':>6} {'rms':>6} {'mean u':>11}")
    for name, all_ in within.items():
        zs = [abs(z) for z, _, _ in all_]
        count = lambda limit: sum(z < limit for z in zs)
        free = sum(f for _, f, _ in all_)
        print(f"{name:20} {free:5} {count(1):6} {count(2):6} {count(3):6} {max(zs):6.2f} "
              f"{math.sqrt(sum(z * z for z in zs) / len(zs)):6.2f} {sum(u for _, _, u in all_) / len(all_):11.3g}")
    print("became free: " + (", ".join(f"{name} {count}" for name, count in grew.items()) or "nothing"))


def drift(truth, off):
    found = json.load(open(truth))
    found["microlenses"]["offset_mm"] = [1.4 * PIXEL, -2.0 * PIXEL * math.sqrt(1.0 - 0.49)]
    json.dump(found, open(off, "w"), indent=1)


def whole(folder):
    """A hexagonal array turned by 3 mrad that departs from its lattice by 2 px; a lens with 3 px of distortion and
    0.6 % more magnification; a sensor 1 % too far and tilted by 2 and -1 mrad; particles in a box away from the axis."""
    radius = 0.5 * math.hypot(1.0, 1.0) * LENSLETS * PITCH_PX * PIXEL
    corner = radius / 400.0
    truth = camera(
        200.0, 1.006, 0.311, 0.077, [0.011, -0.007], 0.003, [0.002, -0.001], 3.0 * PIXEL / (400.0 * corner**3), [0.0, 0.0]
    )
    nominal = camera(200.0, 1.0, 0.308, 0.077, [0.0, 0.0], 0.0, [0.0, 0.0], 0.0, [0.0, 0.0])
    for either in (truth, nominal):
        either["microlenses"]["layout"] = "hexagonal"
    truth["centres"] = {
        "radius_mm": radius, "x_mm": [0.004, 0.001, 0.006, -0.003, 0.002], "y_mm": [0.002, -0.005, 0.001, 0.004, -0.003]
    }
    scene = {
        "camera": truth,
        "volume": {"x_mm": [1.6, 3.0], "y_mm": [-3.0, -1.6], "z_mm": [-5.0, 5.0]},
        "particles": {"per_lenslet": 0.1, "sigma_px": 0.75, "intensity": 100000.0, "rays": 200000},
        "truth": {"pixels_per_voxel": [1.0, 1.0, 10.0], "sigma_vox": 0.75, "vectors": [5, 5, 5]},
        "frames": 1,
        "dots": {
            "spacing_mm": 1.1, "diameter_mm": 0.05, "depths_mm": [-4.0, -2.7, -1.3, 1.3, 2.7, 4.0], "intensity": 500000.0
        },
        "seed": 1,
    }
    json.dump(scene, open(f"{folder}/scene.json", "w"), indent=1)
    json.dump({**scene, "sensor_noise": NOISE}, open(f"{folder}/noisy.json", "w"), indent=1)
    json.dump(nominal, open(f"{folder}/nominal.json", "w"), indent=1)


if sys.argv[1] == "draw":
    draw(int(sys.argv[2]), sys.argv[3], len(sys.argv) > 4)
elif sys.argv[1] == "drift":
    drift(sys.argv[2], sys.argv[3])
elif sys.argv[1] == "whole":
    whole(sys.argv[2])
elif sys.argv[1] == "shift":
    shift(sys.argv[2])
else:
    judge(sys.argv[2:])

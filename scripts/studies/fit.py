#!/usr/bin/env python3
"""Scores what scripts/studies/fit makes: DIR FRAME NAME LOG, --vectors SCENE WAY SCORES, --table KIND LOG,
--shift PX CAMERA, --alter BLOCK.KEY FACTOR MORE CAMERA, --cameras DIR NAME LOG SECONDS, --laboratory DIR NAME LOG,
--chain DIR WAY NAME LOG, --drift DIR DENSITY OFF LOG, --growth DIR NAME LOG SECONDS,
--full DIR NAME LOG, --uniform DIR NAME LOG."""
import glob
import json
import os
import sys

PIXEL = 0.0055  # mm at the focal plane
FOCUS = 0.9  # mm; nearer to focus vectors by correlation are poor
SLABS = ((0, 0.5), (0.5, 2), (2, 5.01))


def table(path, frame=0):
    """The particles of a frame: lists of numbers behind frame and id."""
    lines = [line for line in open(path) if not line.startswith("#")][1:]
    rows = [[float(field) for field in line.split(",")] for line in lines]
    return [row[2:] for row in rows if row[0] == frame]


def match(truth, found):
    """Pairs within max(1.5 px, 3 sigma) along each axis, the nearest first, one to one."""
    cell, cells = 20 * PIXEL, {}
    for j, particle in enumerate(found):
        cells.setdefault((particle[0] // cell, particle[1] // cell), []).append(j)
    pairs = []
    for i, (x, y, z, *_) in enumerate(truth):
        for a in (-1, 0, 1):
            for b in (-1, 0, 1):
                for j in cells.get((x // cell + a, y // cell + b), ()):
                    p = found[j]
                    off = [(p[k] - (x, y, z)[k]) / max(1.5 * PIXEL, 3 * p[4 + k]) for k in range(3)]
                    if max(map(abs, off)) < 1:
                        pairs.append((sum(o * o for o in off), i, j))
    taken, used, matched = set(), set(), []
    for _, i, j in sorted(pairs):
        if i not in taken and j not in used:
            taken.add(i)
            used.add(j)
            matched.append((i, j))
    return matched


def rms(values):
    return (sum(value * value for value in values) / len(values)) ** 0.5 if values else float("nan")


def vectors(scene, way, scores):
    """One line of the errors of vectors."""
    score = json.load(open(scores))
    rms = [score["px"][axis]["rms"] for axis in "uvw"]
    print(f"{scene:<10} {way:<12} {rms[0]:8.3f} {rms[1]:8.3f} {rms[2]:8.3f} {score['outliers']:9}")


def particles(folder, frame, name, log):
    """One line of recall, ghosts and errors; the same as JSON at the end of a log."""
    truth, found = (table(f"{folder}/{file}.csv", int(frame)) for file in ("particles", f"found-{frame}"))
    stats = json.load(open(f"{folder}/fit-{frame}.json"))
    matched = match(truth, found)
    size, drift = stats["counts"]["size_px"], stats["counts"]["drift_px"]
    scored = {"name": name, "truth": len(truth), "found": len(found), "matched": len(matched), "size": size,
              "drift": max(map(abs, drift)), "slabs": []}
    print(f"{folder:<28} recall {len(matched) / len(truth):.4f} ghosts {1 - len(matched) / len(found):.4f}", end="")
    for low, high in SLABS:
        pairs = [(truth[i], found[j]) for i, j in matched if low <= abs(truth[i][2]) < high]
        off = [p[2] - t[2] for t, p in pairs]
        ratio = [(p[2] - t[2]) / p[6] for t, p in pairs]
        count = sum(low <= abs(t[2]) < high for t in truth)
        cover = sum(abs(r) < 1 for r in ratio)
        print(f" | {low}-{high:.0f} mm: recall {len(pairs) / max(count, 1):.4f} z rms {rms(off) / PIXEL:.3f} px,"
              f" over stated {rms(ratio):.2f}, covers {cover / max(len(ratio), 1):.2f}", end="")
        scored["slabs"].append({"truth": count, "matched": len(pairs), "covered": cover,
                                "off2": sum((o / PIXEL) ** 2 for o in off), "ratio2": sum(r * r for r in ratio)})
    print(f" | size {size:.4f} px, drift {max(map(abs, drift)):.4f} px", flush=True)
    with open(log, "a") as out:
        print(json.dumps(scored), file=out)


def tabled(kind, log):
    """A table of the lines of a log, those of one name together."""
    runs = {}
    for line in open(log):
        run = json.loads(line)
        # A name of the others comes once for each camera.
        key = run["name"] if kind in ("report", "independent") else (len(runs), run["name"])
        runs.setdefault(key, []).append(run)
    head = ["", "recall", "ghosts", "recall beyond 0.5 mm", "z RMS there, px", "over the bound", "1 sigma covers"]
    more = ["size, px", "drift, px"] if kind in ("wrong", "camera") else ["covers within 0.5 mm"]
    print("| " + " | ".join(head + more) + " |\n|" + " --- |" * len(head + more))
    for group in runs.values():
        add = lambda key: sum(run[key] for run in group)
        far = lambda key: sum(slab[key] for run in group for slab in run["slabs"][1:])
        near = lambda key: sum(run["slabs"][0][key] for run in group)
        count = max(far("matched"), 1)
        cells = [group[0]["name"], f"{add('matched') / add('truth'):.3f}", f"{1 - add('matched') / add('found'):.3f}",
                 f"{far('matched') / far('truth'):.3f}", f"{(far('off2') / count) ** 0.5:.2f}",
                 f"{(far('ratio2') / count) ** 0.5:.2f}", f"{far('covered') / count:.2f}"]
        if kind in ("wrong", "camera"):
            cells += [f"{group[0]['size']:.3f}", f"{group[0]['drift']:.3f}"]
        else:
            cells += [f"{near('covered') / max(near('matched'), 1):.2f}"]
        print("| " + " | ".join(cells) + " |")


def uniform(folder, name, log):
    """One line of the errors of vectors where all particles move alike, near focus and beyond, as JSON at the end of a
    log. Replaced vectors count, places without data do not. Needs numpy and OpenEXR."""
    sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), "../python"))
    import lf
    import numpy as np

    lines = [line.split(",") for line in open(f"{folder}/particles.csv")][1:]
    first, second = ({row[1]: np.array(row[2:5], float) for row in lines if row[0] == frame} for frame in "01")
    moved = np.mean([second[particle] - first[particle] for particle in first.keys() & second.keys()], 0)
    layout, field = lf.read_field(f"{folder}/field.exr")
    depth = layout["origin_mm"][2] + layout["spacing_mm"][2] * np.arange(layout["shape"][2])
    near = np.broadcast_to(np.abs(depth)[:, None, None] <= FOCUS, field["w"].shape)
    seen = field["flag"] != 2
    off2 = {axis: ((field[axis] - move) / PIXEL) ** 2 for axis, move in zip("uvw", moved.tolist())}
    total = lambda values, where: [float(values[where & seen].sum(dtype=float)), int((where & seen).sum())]
    scored = {"name": name, "blind": int((~seen).sum()), "near": total(off2["w"], near), "far": total(off2["w"], ~near)}
    scored |= {axis: total(off2[axis], seen) for axis in "uvw"}
    stated = field["flag"] == 0
    scored["covered"] = total(off2["w"] < (field["sw"] / PIXEL) ** 2, stated)
    print(json.dumps(scored), flush=True)
    with open(log, "a") as out:
        print(json.dumps(scored), file=out)


def uniforms_tabled(log):
    """A table of them, runs of one name together."""
    runs = {}
    for run in map(json.loads, open(log)):
        runs.setdefault(run["name"], []).append(run)
    head = ["", "vectors", "without data", "u, px", "v, px", "w, px", f"w within {FOCUS} mm of focus", "w beyond",
            "ratio", "1 sigma covers w"]
    print("| " + " | ".join(head) + " |\n|" + " --- |" * len(head))
    for name, group in runs.items():
        mean = lambda key: sum(run[key][0] for run in group) / max(sum(run[key][1] for run in group), 1)
        errors = [mean(key) ** 0.5 for key in ("u", "v", "w", "near", "far")]
        print("| " + " | ".join([name, str(sum(run["w"][1] for run in group)), str(sum(run["blind"] for run in group))]
                                + [f"{error:.3f}" for error in errors]
                                + [f"{errors[3] / errors[4]:.2f}", f"{mean('covered'):.2f}"]) + " |")


def cameras(folder, name, log, seconds):
    """One line of errors of all three axes within and beyond 0.5 mm, as JSON at the end of a log."""
    truth, found = table(f"{folder}/particles.csv"), table(f"{folder}/found-0000.csv")
    matched = match(truth, found)
    scored = {"name": name, "truth": len(truth), "found": len(found), "matched": len(matched), "cpu": float(seconds),
              "slabs": []}
    for low, high in ((0, 0.5), (0.5, 5.01)):
        pairs = [(truth[i], found[j]) for i, j in matched if low <= abs(truth[i][2]) < high]
        off = [[(p[k] - t[k]) / PIXEL for t, p in pairs] for k in range(3)]
        ratio = [(p[2] - t[2]) / p[6] for t, p in pairs]
        scored["slabs"].append({"count": len(pairs), "off2": [sum(o * o for o in axis) for axis in off],
                                "ratio2": sum(r * r for r in ratio), "covered": sum(abs(r) < 1 for r in ratio)})
    print(json.dumps(scored), flush=True)
    with open(log, "a") as out:
        print(json.dumps(scored), file=out)


def cameras_tabled(log):
    """A table of one camera against two; runs of one name and one scene's density and lattice together."""
    runs, scene = {}, ""
    for line in open(log):
        run = json.loads(line)
        if run["name"].endswith("one camera"):
            scene = run["name"]
        runs.setdefault((scene, run["name"]), []).append(run)
    head = ["", "recall", "ghosts", "x, y, z within 0.5 mm, px", "beyond", "z over the bound", "1 sigma covers", "s"]
    print("| " + " | ".join(head) + " |\n|" + " --- |" * len(head))
    for (_, name), group in runs.items():
        add = lambda key: sum(run[key] for run in group)
        slab = lambda n, key: sum(run["slabs"][n][key] for run in group)
        errors = lambda n: ", ".join(f"{(sum(run['slabs'][n]['off2'][k] for run in group) / max(slab(n, 'count'), 1)) ** 0.5:.3f}"
                                     for k in range(3))
        count = max(slab(0, "count") + slab(1, "count"), 1)
        print("| " + " | ".join([
            name, f"{add('matched') / add('truth'):.3f}", f"{1 - add('matched') / add('found'):.3f}", errors(0), errors(1),
            f"{((slab(0, 'ratio2') + slab(1, 'ratio2')) / count) ** 0.5:.2f}",
            f"{(slab(0, 'covered') + slab(1, 'covered')) / count:.2f}", f"{add('cpu') / len(group):.1f}"]) + " |")


def laboratory(folder, name, log):
    """One line of the errors of vectors by correlation and by particles, as JSON at the end of a log."""
    seconds = lambda part: sum(float(line) for line in open(f"{folder}/{part}.s"))
    scored = {"name": name}
    for way in ("correlation", "particles"):
        score, far = (json.load(open(f"{folder}/{way}{part}.json")) for part in ("", "-far"))
        scored[way] = {"rms": [score[f"rms_{axis}_px"] for axis in "uvw"], "median": score["median_abs_w_px"],
                       "far": far["rms_w_px"], "covered": score["uncertainty"]["within_1_w"], "vectors": score["vectors"],
                       "seconds": seconds("both") + seconds(way)}
    print(json.dumps(scored), flush=True)
    with open(log, "a") as out:
        print(json.dumps(scored), file=out)


def laboratory_tabled(log):
    """A table of both ways and the ratio of their errors of w."""
    head = ["", "vectors"] + 2 * ["u, v, w, px", "median of w", "w beyond 1.6 mm", "1 sigma covers w", "s"]
    head[2], head[7] = "by correlation: " + head[2], "by particles: " + head[7]
    head += ["w, ratio", "beyond 1.6 mm"]
    print("| " + " | ".join(head) + " |\n|" + " --- |" * len(head))
    for run in map(json.loads, open(log)):
        cells = [run["name"], f"{run['particles']['vectors']}"]
        for way in ("correlation", "particles"):
            part = run[way]
            cells += [", ".join(f"{rms:.2f}" for rms in part["rms"]), f"{part['median']:.2f}", f"{part['far']:.2f}", f"{part['covered']:.2f}",
                      f"{part['seconds']:.0f}"]
        cells.append(f"{run['correlation']['rms'][2] / run['particles']['rms'][2]:.1f}")
        cells.append(f"{run['correlation']['far'] / run['particles']['far']:.1f}")
        print("| " + " | ".join(cells) + " |")


def chain(folder, way, name, log):
    """One line of time, memory, Q and errors of vectors of a chain, as JSON at the end of a log."""
    quality, score = (json.load(open(f"{folder}/{kind}.json")) for kind in ("quality", "displacement"))
    peak = max(json.load(open(path))["peak_bytes"] for path in glob.glob(f"{folder}/{way}-*.json"))
    scored = {"name": name, "q": quality["q"], "rms": [score[f"rms_{axis}_px"] for axis in "uvw"], "peak": peak,
              "seconds": sum(float(line) for line in open(f"{folder}/{way}.s"))}
    print(json.dumps(scored), flush=True)
    with open(log, "a") as out:
        print(json.dumps(scored), file=out)


def chains_tabled(log):
    """A table of chains, means over the seeds of one name; errors are RMS of their RMS."""
    runs = {}
    for run in map(json.loads, open(log)):
        runs.setdefault(run["name"], []).append(run)
    head = ["", "s", "GB", "Q", "u, px", "v, px", "w, px"]
    print("| " + " | ".join(head) + " |\n|" + " --- |" * len(head))
    for name, group in runs.items():
        mean = lambda key: sum(run[key] for run in group) / len(group)
        errors = [rms([run["rms"][axis] for run in group]) for axis in range(3)]
        print("| " + " | ".join([name, f"{mean('seconds'):.1f}", f"{mean('peak') / 1e9:.2f}", f"{mean('q'):.3f}"]
                                + [f"{error:.3f}" for error in errors]) + " |")


def drift(folder, density, off, log):
    """One line of how far two corrected cameras are from the true one, px, as JSON at the end of a log."""
    lenslets = lambda name: json.load(open(f"{folder}/{name}.json"))["microlenses"]["offset_mm"]
    pitch = json.load(open(f"{folder}/camera.json"))["sensor"]["pixel_pitch_mm"]
    left = lambda name: sum((a - b) ** 2 for a, b in zip(lenslets(name), lenslets("camera"))) ** 0.5 / pitch
    scored = {"density": density, "off": off, "refined": None}
    if os.path.exists(f"{folder}/refined.json"):
        counts = json.load(open(f"{folder}/refine.json"))["counts"]
        scored.update(refined=left("refined"), stated=counts.get("offset_std_px"), alone=counts["particles"])
    counts = json.load(open(f"{folder}/fit.json"))["counts"]
    # Without a drift worth writing lf-fit leaves the camera.
    name = "fitted" if os.path.exists(f"{folder}/fitted.json") else "shifted"
    scored.update(fitted=left(name), fit_stated=max(counts["drift_std_px"]), particles=counts["particles"])
    print(json.dumps(scored), flush=True)
    with open(log, "a") as out:
        print(json.dumps(scored), file=out)


def drift_tabled(log):
    """A table of what both ways leave of a drift: numbers of each seed behind one another."""
    head = ["per lenslet", "off by, px", "refine: particles alone", "left, px", "stated, px", "lf-fit: particles",
            "left, px", "stated, px"]
    print("| " + " | ".join(head) + " |\n|" + " --- |" * len(head))
    runs = {}
    for run in map(json.loads, open(log)):
        runs.setdefault((run["density"], run["off"]), []).append(run)
    for name, group in runs.items():
        refined = lambda key, form: ", ".join("-" if run["refined"] is None else format(run[key], form) for run in group)
        each = lambda key, form="": ", ".join(format(run[key], form) for run in group)
        alone = ", ".join("too few" if run["refined"] is None else str(run["alone"]) for run in group)
        cells = [*name, alone, refined("refined", ".3f"), refined("stated", ".3f"), each("particles"),
                 each("fitted", ".4f"), each("fit_stated", ".4f")]
        print("| " + " | ".join(cells) + " |")


def growth(folder, name, log, seconds):
    """One line of time and memory, as JSON at the end of a log."""
    truth, found = table(f"{folder}/particles.csv"), table(f"{folder}/found-0000.csv")
    stats = json.load(open(f"{folder}/fit-0000.json"))
    scored = {"name": name, "truth": len(truth), "found": len(found), "matched": len(match(truth, found)),
              "cpu": float(seconds), "peak": stats["peak_bytes"], "told": stats["counts"].get("estimated_bytes")}
    print(json.dumps(scored), flush=True)
    with open(log, "a") as out:
        print(json.dumps(scored), file=out)


def growth_tabled(log):
    """A table of them."""
    head = ["", "particles", "recall", "ghosts", "s", "ms a particle", "peak, MB"]
    print("| " + " | ".join(head) + " |\n|" + " --- |" * len(head))
    for run in map(json.loads, open(log)):
        cells = [run["name"], str(run["truth"]), f"{run['matched'] / run['truth']:.3f}",
                 f"{1 - run['matched'] / run['found']:.3f}", f"{run['cpu']:.1f}",
                 f"{1e3 * run['cpu'] / run['truth']:.1f}", f"{run['peak'] / 1e6:.0f}"]
        print("| " + " | ".join(cells) + " |")


def full(folder, name, log):
    """One line of time and memory of the chain on a large frame, as JSON at the end of a log."""
    truth, found = table(f"{folder}/particles.csv"), table(f"{folder}/found-0000.csv")
    stats = json.load(open(f"{folder}/fit-0000.json"))
    peaks = [json.load(open(f"{folder}/{part}.json"))["peak_bytes"] for part in ("prune", "mart")]
    seconds = lambda part: sum(float(line) for line in open(f"{folder}/{part}.s"))
    scored = {"name": name, "truth": len(truth), "found": len(found), "matched": len(match(truth, found)),
              "mart": seconds("mart"), "mart_peak": max(peaks), "cpu": seconds("fit"), "peak": stats["peak_bytes"]}
    print(json.dumps(scored), flush=True)
    with open(log, "a") as out:
        print(json.dumps(scored), file=out)


def full_tabled(log):
    """A table of them."""
    head = ["", "particles", "recall", "ghosts", "lf-prune, lf-mart: s", "GB", "lf-fit: s", "ms a particle", "GB"]
    print("| " + " | ".join(head) + " |\n|" + " --- |" * len(head))
    for run in map(json.loads, open(log)):
        cells = [run["name"], str(run["truth"]), f"{run['matched'] / run['truth']:.3f}",
                 f"{1 - run['matched'] / run['found']:.3f}", f"{run['mart']:.0f}", f"{run['mart_peak'] / 1e9:.2f}",
                 f"{run['cpu']:.0f}", f"{1e3 * run['cpu'] / run['truth']:.1f}", f"{run['peak'] / 1e9:.2f}"]
        print("| " + " | ".join(cells) + " |")


def shifted(px, path):
    """A camera with its lattice off by so many pixels along x."""
    camera = json.load(open(path))
    camera["microlenses"]["offset_mm"][0] += float(px) * camera["sensor"]["pixel_pitch_mm"]
    print(json.dumps(camera, indent=1))


def altered(key, factor, more, path):
    """A camera with a parameter times a factor, and more."""
    camera = json.load(open(path))
    block, name = key.split(".")
    camera[block][name] = camera[block][name] * float(factor) + float(more)
    print(json.dumps(camera, indent=1))


# A table of its own; other kinds share one.
TABLES = {"cameras": cameras_tabled, "compare": chains_tabled, "drift": drift_tabled, "full": full_tabled,
          "growth": growth_tabled, "independent-vectors": uniforms_tabled, "laboratory": laboratory_tabled}


def print_table(kind, log):
    """The table of a log."""
    if kind in TABLES:
        TABLES[kind](log)
    else:
        tabled(kind, log)


WORDS = {"--alter": altered, "--cameras": cameras, "--chain": chain, "--drift": drift, "--full": full,
         "--growth": growth, "--laboratory": laboratory, "--shift": shifted, "--table": print_table,
         "--uniform": uniform, "--vectors": vectors}

if sys.argv[1] in WORDS:
    WORDS[sys.argv[1]](*sys.argv[2:])
else:
    particles(*sys.argv[1:])

"""Disturbs every tool and checks what is left; see scripts/studies/faults."""

import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import time

TIMES = int(sys.argv[1]) if len(sys.argv) > 1 else 30
random.seed(int(sys.argv[2]) if len(sys.argv) > 2 else 1)

SCENE = ("lf-synth scene uniform --set camera.main_lens.aperture=circle --set camera.sensor.width=280 "
         "--set camera.sensor.height=280 --set 'volume.x_mm=[-0.6,0.6]' --set 'volume.y_mm=[-0.6,0.6]' "
         "--set 'volume.z_mm=[-1,1]' --set particles.rays=40000 "
         "--set 'white={\"counts\": 1000, \"rays_per_lenslet\": 4000}'")
DOTS = ("lf-synth scene target --set camera.sensor.width=280 --set camera.sensor.height=280 "
        "--set 'volume.x_mm=[-0.6,0.6]' --set 'volume.y_mm=[-0.6,0.6]' --set dots.spacing_mm=0.3 --set dots.intensity=50000")
# Name, inputs, outputs in the folder `new`, and the words of the run.
RUNS = [
    ("white", ["scene.json"], ["white.exr"], "lf-synth white scene.json -o new/white.exr"),
    ("frames", ["scene.json"], None, "lf-synth frames scene.json -o new"),
    ("background", ["s/frame-0000.exr", "s/frame-0001.exr"], ["b.exr"],
     "lf-calib background s/frame-0000.exr s/frame-0001.exr -o new/b.exr"),
    ("lattice", ["white.exr", "s/camera.json"], ["c.json"],
     "lf-calib lattice white.exr -c s/camera.json -o new/c.json"),
    ("prune", ["s/frame-0000.exr", "s/camera.json"], ["p.lfv"],
     "lf-prune s/frame-0000.exr -c s/camera.json --pvr 1,1,10 --depth -1,1 -o new/p.lfv"),
    ("mart", ["p0.lfv", "s/frame-0000.exr", "s/camera.json"], ["m.lfv", "m.jsonl"],
     "lf-mart p0.lfv -i s/frame-0000.exr -c s/camera.json --iterations 5 --log new/m.jsonl -o new/m.lfv"),
    ("fit", ["part.lfv", "s/frame-0000.exr", "s/camera.json"], ["f.csv", "f.lfv"],
     "lf-fit part.lfv -i s/frame-0000.exr -c s/camera.json --rounds 1 --particles new/f.csv -o new/f.lfv"),
    ("xcorr", ["v0.lfv", "v1.lfv"], ["x.exr", "x.svg"],
     "lf-xcorr v0.lfv v1.lfv --window 32,32,16 --overlap 0.5 -o new/x.exr --plot new/x.svg"),
    ("ensemble", ["x0.exr"], ["e.exr"], "lf-validate ensemble x0.exr x0.exr x0.exr -o new/e.exr"),
    ("dots", ["dots.json"], None, "lf-synth dots dots.json -o new"),
    ("flow", ["x0.exr"], ["w.exr"], "lf-flow solenoidal x0.exr -o new/w.exr"),
    ("export", ["v0.lfv"], ["v.vti"], "lf-validate export v0.lfv -o new/v.vti"),
    ("stack", ["v0.lfv"], ["v.tif"], "lf-validate export v0.lfv -o new/v.tif"),
    ("fields", ["x0.exr"], ["x.nc"], "lf-validate export x0.exr x0.exr -o new/x.nc"),
]


def shell(line):
    done = subprocess.run(line, shell=True, capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{line}\n{done.stderr}")
    return done.stdout


def files(folder):
    """The files of a folder, with their bytes; logs of sweeps without their seconds."""
    found = {}
    for name in os.listdir(folder):
        with open(os.path.join(folder, name), "rb") as file:
            found[name] = file.read()
        if name.endswith(".jsonl"):
            found[name] = re.sub(rb'"seconds":[^,}]*', b"", found[name])
    return found


def prepare():
    """Inputs, and the results of undisturbed runs."""
    shutil.rmtree("new", ignore_errors=True)
    os.makedirs("new")
    for seed in [1, 2]:
        for name, line in [("scene", SCENE), ("dots", DOTS)]:
            with open(f"{name}.json" if seed == 1 else f"other-{name}.json", "w") as file:
                file.write(shell(f"{line} --set seed={seed}"))
    shell("lf-synth frames scene.json -o s -q; lf-synth white scene.json -o white.exr -q")
    small = "--bounds=-0.1,0.1,-0.1,0.1"
    for n, part, name in [(0, "", "v0"), (1, "", "v1"), (0, small, "part")]:
        shell(f"lf-prune s/frame-000{n}.exr -c s/camera.json --pvr 1,1,10 --depth -1,1 {part} -o p{n}.lfv -q")
        shell(f"lf-mart p{n}.lfv -i s/frame-000{n}.exr -c s/camera.json --iterations 5 -o {name}.lfv -q")
    shell("lf-prune s/frame-0000.exr -c s/camera.json --pvr 1,1,10 --depth -1,1 -o p0.lfv -q")
    shell("lf-xcorr v0.lfv v1.lfv --window 32,32,16 --overlap 0.5 -o x0.exr -q")
    whole, usual = {}, {}
    for name, _, _, line in RUNS:
        clear()
        began = time.time()
        shell(f"{line} -q")
        whole[name], usual[name] = files("new"), time.time() - began
    old = {}
    for name, task in [("frames", "frames other-scene.json"), ("dots", "dots other-dots.json")]:
        clear()
        shell(f"lf-synth {task} -o new -q")
        old[name] = files("new")
    return whole, usual, old


def clear(old=()):
    """Empties the folder of outputs, but for old ones."""
    for name in os.listdir("new"):
        os.remove(os.path.join("new", name))
    for name, content in dict(old).items():
        with open(os.path.join("new", name), "wb") as file:
            file.write(content)


faults = []


def judge(what, name, outputs, whole, old):
    """Checks that each output is whole, old or absent. Returns how many are whole."""
    left = files("new")
    parts = [part for part in left if part.startswith(".lf-")]
    if outputs is None:
        # A series: its last file says that all are of one run.
        if "scene-used.json" in left:
            sound = all(left.get(key) == content for key, content in whole.items()) or left == old
            if not sound:
                faults.append(f"{what} {name}: a mixed folder that looks whole")
        for key, content in left.items():
            if key not in parts and content not in (whole.get(key), old.get(key)):
                faults.append(f"{what} {name}: {key} is half")
        return int("scene-used.json" in left and left != old)
    for key in left:
        if key not in parts and left[key] not in (whole.get(key), old.get(key)):
            faults.append(f"{what} {name}: {key} is neither whole nor old")
    return sum(left.get(key) == whole[key] for key in outputs)


def old_files(name, outputs, series):
    """Nothing, or old outputs."""
    if random.random() < 0.5:
        return {}
    return series[name] if outputs is None else {key: f"old {key}".encode() for key in outputs}


def words(line):
    return [word for word in line.split() if word] + ["-q"]


def kills(whole, usual, series):
    """Kills runs, half of them near their end, when they write."""
    print(f"{'killed':<12} {'kills':>6} {'ended before':>13} {'outputs whole':>14} {'parts left':>11}")
    for name, _, outputs, line in RUNS:
        ended, complete, parts, count = 0, 0, 0, 0
        while count < TIMES:
            old = old_files(name, outputs, series)
            clear(old)
            share = random.uniform(0, 1) if random.random() < 0.5 else random.uniform(0.8, 1.1)
            run = subprocess.Popen(words(line), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            try:
                run.wait(share * usual[name])
                ended += 1
                usual[name] *= 0.9
            except subprocess.TimeoutExpired:
                run.send_signal(signal.SIGKILL)
                run.wait()
                count += 1
                # A machine that others use is slow for a while: kills near the end follow it.
                usual[name] *= 1.08 if share > 0.9 else 1
            complete += judge("killed", name, outputs, whole[name], old)
            parts += sum(key.startswith(".lf-") for key in os.listdir("new"))
        print(f"{name:<12} {count:>6} {ended:>13} {complete:>14} {parts:>11}", flush=True)


def check_refusal(what, name, done, subject):
    lines = [line for line in done.stderr.splitlines() if ": warning: " not in line]
    if done.returncode != 2 or len(lines) != 1 or subject not in lines[0]:
        faults.append(f"{what} {name}: exit {done.returncode}: {done.stderr.strip()[:300]}")


def limited(whole, series):
    """Limits the size of files at every power of two below the largest output, and at TIMES lengths in between."""
    print(f"\n{'file limit':<12} {'runs':>6} {'refused':>8} {'whole':>6}")
    for name, _, outputs, line in RUNS:
        largest = max(len(content) for content in whole[name].values())
        runs, refused, complete = 0, 0, 0
        powers = [0] + [2**n for n in range(largest.bit_length()) if 2**n < largest]
        for limit in powers + random.choices(range(largest), k=TIMES):
            old = old_files(name, outputs, series)
            clear(old)
            done = subprocess.run(words(line), capture_output=True, text=True,
                                  preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))
            runs += 1
            refused += done.returncode == 2
            check_refusal("limit", name, done, "new/")
            complete += judge("limit", name, outputs, whole[name], old)
        print(f"{name:<12} {runs:>6} {refused:>8} {complete:>6}", flush=True)


def full_disk(whole, series):
    """Runs on a disk with room for a part of the outputs."""
    shutil.rmtree("disk", ignore_errors=True)
    os.makedirs("disk")
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16m", "tmpfs", "disk"], capture_output=True).returncode:
        print("\na small disk cannot be mounted here: not tried")
        return
    print(f"\n{'full disk':<12} {'runs':>6} {'refused':>8} {'whole':>6}")
    try:
        shutil.rmtree("new")
        os.symlink("disk", "new")
        for name, _, outputs, line in RUNS:
            size = sum(len(content) for content in whole[name].values())
            runs, refused, complete = 0, 0, 0
            for n in range(TIMES):
                old = old_files(name, outputs, series)
                clear(old)
                pages = (size // 4096 + 2) * n // TIMES
                space = os.statvfs("disk")
                with open("disk/filler", "wb") as file:
                    file.write(b"\0" * max(0, (space.f_bavail - pages) * space.f_bsize))
                done = subprocess.run(words(line), capture_output=True, text=True)
                os.remove("disk/filler")
                runs += 1
                refused += done.returncode == 2
                if done.returncode != 0:
                    check_refusal("full disk", name, done, "no space left")
                complete += judge("full disk", name, outputs, whole[name], old)
            print(f"{name:<12} {runs:>6} {refused:>8} {complete:>6}", flush=True)
    finally:
        if os.path.islink("new"):
            os.remove("new")
        subprocess.run(["umount", "disk"], check=True)
        os.makedirs("new", exist_ok=True)


def disturb(path, way):
    """Changes an input; returns a function that mends it."""
    with open(path, "rb") as file:
        content = file.read()

    def mend():
        with open(path, "wb") as file:
            file.write(content)

    if way == "cut":
        os.truncate(path, len(content) // 3)
    elif way == "emptied":
        os.truncate(path, 0)
    elif way == "longer":
        with open(path, "ab") as file:
            file.write(b"more")
    elif way == "touched":
        with open(path, "r+b") as file:
            file.seek(len(content) // 2)
            file.write(b"\x7f")
    else:
        with open(path + ".next", "wb") as file:
            file.write(b"something else")
        os.rename(path + ".next", path)
    return mend


def changed(whole, usual):
    """Changes an input under a run: the run is refused, or its result is that of the old input."""
    print(f"\n{'changed':<12} {'runs':>6} {'refused':>8} {'as before':>10}")
    for name, inputs, outputs, line in RUNS:
        refused, same = 0, 0
        for n in range(TIMES):
            clear()
            path, way = random.choice(inputs), ["cut", "emptied", "longer", "touched", "replaced"][n % 5]
            run = subprocess.Popen(words(line), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
            time.sleep(random.uniform(0, 1) * usual[name])
            mend = disturb(path, way)
            said = run.communicate()[1]
            mend()
            lines = [line for line in said.splitlines() if ": warning: " not in line]
            if run.returncode == 0:
                same += 1
                if files("new") != whole[name]:
                    faults.append(f"{way} {name}: {path}: a result of a changed input")
            elif run.returncode == 2 and len(lines) == 1:
                refused += 1
                judge(way, name, outputs, whole[name], {})
            else:
                faults.append(f"{way} {name}: {path}: exit {run.returncode}: {said[:300]}")
        print(f"{name:<12} {TIMES:>6} {refused:>8} {same:>10}", flush=True)


if __name__ == "__main__":
    whole, usual, series = prepare()
    kills(whole, usual, series)
    limited(whole, series)
    full_disk(whole, series)
    changed(whole, usual)
    print(f"\n{len(faults)} faults")
    for fault in faults:
        print(fault)
    sys.exit(1 if faults else 0)

"""Runs each tool with --stats over a grid of sizes, threads and cameras; see scripts/studies/memory."""

import json
import subprocess
import sys

CAMERAS = {
    "square": {},
    "round": {"main_lens.aperture": '"circle"'},
    "turned": {"microlenses.rotation_rad": 0.003, "main_lens.aperture": '"circle"'},
    "hexagonal": {"microlenses.layout": '"hexagonal"', "microlenses.rotation_rad": 0.003},
    "water": {"medium": '{"index": 1.333, "window_z_mm": 180.0, "window_thickness_mm": 20.0, "window_index": 1.49}'},
}
THREADS = [1, 2, 8]
# Bytes by which a small run may be estimated too high.
SMALL = 5e6
WHITE = 'white={"counts": 1000, "rays_per_lenslet": 100}'


def shell(line):
    """Runs a line; returns what it prints."""
    done = subprocess.run(line, shell=True, capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{line}\n{done.stderr}")
    return done.stdout


def scene(name, side, camera, *keys):
    """Writes NAME.json: a scene on a sensor of `side` pixels."""
    half = 0.5 * side * 0.0055
    keys = [f"camera.sensor.width={side}", f"camera.sensor.height={side}", *keys]
    keys += [f"volume.{axis}_mm=[{-half},{half}]" for axis in "xy"]
    keys += [f"camera.{key}={value}" for key, value in CAMERAS[camera].items()]
    words = " ".join(f"--set '{key}'" for key in keys)
    with open(f"{name}.json", "w") as file:
        file.write(shell(f"lf-synth scene uniform --set camera.main_lens.aperture='\"square\"' {words}"))


worst = {}


def check(what, line, threads, told_by_estimate=False):
    """Runs a line and prints the memory estimated over the memory taken."""
    line = f"{line} -q --threads {threads}"
    told = json.loads(shell(f"{line} --estimate"))["memory_bytes"] if told_by_estimate else None
    shell(f"{line} --stats stats.json")
    with open("stats.json") as file:
        stats = json.load(file)
    taken = stats["peak_bytes"]
    recorded = stats["counts"].get("estimated_bytes")
    told = told or recorded
    if told is None:
        print(f"{what:<58} {threads:2d}   none  {taken / 1e6:8.1f} MB", flush=True)
        return
    ratio = told / taken
    other = f" (recorded {recorded / taken:.2f})" if recorded and abs(recorded / told - 1) > 0.02 else ""
    note = "" if 1 <= ratio and told <= 1.3 * taken + SMALL else "  <"
    print(f"{what:<58} {threads:2d}  {ratio:5.2f}  {taken / 1e6:8.1f} MB{other}{note}", flush=True)
    low, high = worst.get(line.split()[0], (9e9, 0))
    worst[line.split()[0]] = (min(low, ratio), max(high, ratio))


def synth():
    noise = 'sensor_noise={"dark_counts": 100, "read_noise_electrons": 3}'
    for side in [700, 1400, 2800]:
        for threads in THREADS:
            scene("noisy", side, "round", noise, WHITE, "truth=null", "frames=1",
                  "particles.rays=200")
            for task, output in [("white", "white.exr"), ("dark", "dark.exr"), ("frames", "noisy")]:
                check(f"{task}, {side} px, noise", f"lf-synth {task} noisy.json -o {output}", threads)
            scene("plain", side, "hexagonal", WHITE, "frames=2", "particles.rays=2000",
                  "particles.per_lenslet=0.2")
            for task, output in [("white", "white.exr"), ("frames", "plain")]:
                check(f"{task}, {side} px, with truth", f"lf-synth {task} plain.json -o {output}", threads)


def frames(side, camera, density=0.5):
    """A folder with two frames, supports and volumes."""
    name = f"{camera}-{side}"
    scene(name, side, camera, "truth=null", f"particles.per_lenslet={density}", "particles.rays=4000")
    shell(f"lf-synth frames {name}.json -o {name} -q")
    return name


def volumes(side, camera, pvr="1,1,10"):
    name = frames(side, camera)
    for n in range(2):
        shell(f"lf-prune {name}/frame-000{n}.exr -c {name}/camera.json --pvr {pvr} --depth -3,3 -q "
              f"-o {name}/support-{n}.lfv")
        shell(f"lf-mart {name}/support-{n}.lfv -i {name}/frame-000{n}.exr -c {name}/camera.json -q "
              f"--iterations 6 -o {name}/volume-{n}.lfv")
    return name


def prune():
    for camera in CAMERAS:
        for side in [700, 1400]:
            name = frames(side, camera)
            for pvr in ["2,2,20", "1,1,5"]:
                for threads in THREADS:
                    line = f"lf-prune {name}/frame-0000.exr -c {name}/camera.json --depth -5,5 --pvr {pvr} -o s.lfv"
                    check(f"{camera}, {side} px, --pvr {pvr}", line, threads, True)


def mart():
    for camera in CAMERAS:
        for side in [280, 560]:
            name = volumes(side, camera)
            for words in ["", "--basis blob", "--max-memory 0.3"]:
                for threads in THREADS if side < 560 else [2]:
                    line = (f"lf-mart {name}/support-0.lfv -i {name}/frame-0000.exr -c {name}/camera.json "
                            f"--iterations 3 -o v.lfv {words}")
                    check(f"{camera}, {side} px {words}", line, threads, True)
    for camera in ["square", "turned"]:
        scene("small", 280, camera, "truth=null", "particles.per_lenslet=0.3", "particles.rays=4000")
        shell("lf-synth frames small.json -o small -q")
        shell("lf-prune small/frame-0000.exr -c small/camera.json --pvr 2,2,20 --depth -3,3 -q -o small/support.lfv")
        for words in ["--method mart", "--method smart", "--weights drt", "--weights sphere"]:
            line = f"lf-mart small/support.lfv -i small/frame-0000.exr -c small/camera.json --iterations 2 -o v.lfv {words}"
            check(f"{camera}, 280 px {words}", line, 2, True)


def fit():
    for camera in ["square", "turned", "hexagonal"]:
        for side in [280, 420]:
            name = volumes(side, camera)
            for threads in THREADS if side < 420 else [2]:
                line = (f"lf-fit {name}/volume-0.lfv -i {name}/frame-0000.exr -c {name}/camera.json --rounds 1 "
                        f"--particles p.csv")
                check(f"{camera}, {side} px", line, threads, True)


def xcorr():
    for camera in ["square", "hexagonal"]:
        for side in [420, 840]:
            name = volumes(side, camera)
            pair = f"{name}/volume-0.lfv {name}/volume-1.lfv"
            for words in ["", "--window 64,64,16 --overlap 0.5", "--deform never", "--window 160,160,32 --overlap 0.9"]:
                for threads in THREADS if side < 840 else [2]:
                    check(f"{camera}, {side} px {words}", f"lf-xcorr {pair} -o f.exr {words}", threads, True)


def validate():
    for side in [700, 1400]:
        name = volumes(side, "square")
        lines = [f"quality {name}/volume-0.lfv {name}/volume-1.lfv", f"depth {name}/volume-0.lfv",
                 f"elongation {name}/particles.csv {name}/volume-0.lfv"]
        shell(f"lf-xcorr {name}/volume-0.lfv {name}/volume-1.lfv --window 32,32,16 -o f.exr -q")
        lines += ["divergence f.exr", "ensemble f.exr f.exr f.exr -o e.exr"]
        for line in lines:
            for threads in [1, 8]:
                check(f"{line.split()[0]}, {side} px", f"lf-validate {line}", threads)


def flow():
    for side in [420, 840]:
        name = volumes(side, "square")
        shell(f"lf-xcorr {name}/volume-0.lfv {name}/volume-1.lfv --window 48,48,16 --overlap 0.9 -o f.exr -q --dt 0.001")
        tasks = ["smooth f.exr -o s.exr", "solenoidal f.exr -o s.exr", "derive f.exr -o d.exr", "derive f.exr -o d.vti",
                 "pressure f.exr --density 998 -o p.exr", "pressure f.exr f.exr --interval 0.01 --density 998 -o p.exr",
                 "profile f.exr --plane z", "profile f.exr --from -0.2,0,0 --to 0.2,0,0 --points 200000 -o l.csv"]
        for task in tasks:
            for threads in THREADS:
                check(f"{' '.join(task.split()[:2])}, {side} px", f"lf-flow {task}", threads)


STUDIES = {"lf-synth": synth, "lf-prune": prune, "lf-mart": mart, "lf-fit": fit, "lf-xcorr": xcorr,
           "lf-flow": flow, "lf-validate": validate}


if __name__ == "__main__":
    print(f"{'run':<58} {'threads'}  estimated over taken, peak")
    for tool in sys.argv[1:] or STUDIES:
        print(tool)
        STUDIES[tool]()
    for tool, (low, high) in worst.items():
        print(f"{tool}: {low:.2f} to {high:.2f}")

"""What the studies share: the tools, a folder for their files, scenes, runs with their cost, and tables.

A study is a list of columns and of runs. `Study.add` keeps the values of a run under a name in a log, so that a study
that runs in parts keeps the others; `Study.write` puts the table of all names into scripts/measured/, between its marks.
"""
import datetime
import inspect
import json
import os
import pathlib
import resource
import shlex
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Cameras of scenes.
TURNED = ["camera.microlenses.rotation_rad=0.003"]
HEXAGONAL = ["camera.microlenses.layout=hexagonal"]
DISTORTED = ['camera.distortion={"radial": [5, 0, 0], "tangential": [0.01, 0]}']
TILT = ['camera.tilt={"x_rad": 0.002, "y_rad": -0.001}']
WATER = ['camera.medium={"index": 1.333, "window_z_mm": 60, "window_thickness_mm": 20, "window_index": 1.49}']
PIXEL = 0.0055  # mm, of all ready scenes, at the focal plane of those at m = 1
SCRIPT = os.path.abspath(sys.argv[0])
PYTHON = os.environ.get("PYTHON", sys.executable)


def start(folder, *build):
    """Puts the tools on the PATH, those of BIN or a release build, and goes to out/FOLDER."""
    binaries = os.environ.get("BIN")
    if binaries is None:
        subprocess.run(["cargo", "build", "--release", "--bins", "--locked", "--quiet", *build], cwd=ROOT, check=True)
        binaries = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release"
    os.environ["PATH"] = f"{pathlib.Path(binaries).resolve()}:{os.environ['PATH']}"
    os.makedirs(ROOT / "out" / folder, exist_ok=True)
    os.chdir(ROOT / "out" / folder)


class Run:
    """A program that ran: what it printed, processor seconds, and for a tool its account, all keys on one level."""

    def __init__(self, line, *words, account=True, check=True, stdout=None):
        words = [*shlex.split(line), *map(str, words)]
        with tempfile.NamedTemporaryFile(suffix=".json") as stats:
            has_account = account and words[0].startswith("lf-") and words[1] not in ("scene", "info")
            extra = ["--quiet", "--stats", stats.name] if has_account else []
            before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            done = subprocess.run(words + extra, stdout=stdout or subprocess.PIPE, stderr=subprocess.PIPE)
            self.cpu = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
            self.error, self.ok = done.stderr.decode(), done.returncode == 0
            if check and not self.ok:
                sys.exit(f"{shlex.join(words)}\n{self.error}")
            self.text = done.stdout.decode() if done.stdout is not None else ""
            # The tool puts a new file in the place of this one.
            found = pathlib.Path(stats.name).read_bytes()
        account = json.loads(found or b"{}")
        self.stats = {**account.pop("phases", {}), **account.pop("counts", {}), **account, "cpu": self.cpu}

    def __getitem__(self, key):
        return self.stats[key]

    def json(self):
        return json.loads(self.text)


def setting(keys):
    return [word for key in keys for word in ("--set", key)]


def scene(folder, base, *keys, dark=None, task="frames", words="", kept=False):
    """Renders a ready scene with keys set into a folder: scene.json, frames, and with `dark` (keys) dark.exr. With
    `kept`, the frames of the same scene that are there stay."""
    os.makedirs(folder, exist_ok=True)
    path, text = pathlib.Path(folder, "scene.json"), Run(f"lf-synth scene {base}", *setting(keys)).text
    if kept and path.exists() and path.read_text() == text and os.path.exists(f"{folder}/camera.json"):
        return None
    path.write_text(text)
    made = Run(f"lf-synth {task} {path} -o {folder} {words}")
    if dark is not None:
        pathlib.Path(folder, "dark.json").write_text(Run(f"lf-synth scene {base}", *setting([*keys, dark])).text)
        Run(f"lf-synth dark {folder}/dark.json -o {folder}/dark.exr")
    return made


def load(path):
    with open(path) as file:
        return json.load(file)


def save(path, value):
    with open(path, "w") as file:
        json.dump(value, file, indent=1)


def quality(folder, volume="volume.lfv", frame=0):
    return Run(f"lf-validate quality {folder}/truth-{frame:04}.lfv {folder}/{volume}", account=False).json()


def displacement(folder, field="field.exr", truth="scene-used.json", camera="camera.json"):
    words = f"{folder}/{truth} {folder}/{field} -c {folder}/{camera}"
    return Run(f"lf-validate displacement {words}", account=False).json()


def errors(score, kind="rms"):
    """The errors of u, v and w by key."""
    return {axis: score[f"{kind}_{axis}_px"] for axis in "uvw"}


def rms(values):
    values = list(values)
    return (sum(value * value for value in values) / len(values)) ** 0.5 if values else float("nan")


def mean(values):
    values = list(values)
    return sum(values) / len(values) if values else float("nan")


def median(values):
    values = sorted(values)
    return values[(len(values) - 1) // 2]


def machine():
    """Processor and cores of this machine."""
    try:
        lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines()
        name = next(line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        name = os.uname().machine
    return f"{name}, {os.cpu_count()} cores"


class Study:
    """A table that is kept: rows of its page that no run of this process makes stay as they are, unless they are cleared
    or the columns are others. A column is its head, a key of the runs or a function of all runs of a name, and the format;
    numbers of a key are averaged over the runs."""

    def __init__(self, name, columns, first="", page=None, mark=None, resumes=False):
        self.name, self.columns, self.first, self.resumes = name, columns, first, resumes
        self.page, self.mark, self.log = page or name, mark or name, pathlib.Path(f"{name}.jsonl")
        self.runs, self.new = {}, set()
        for line in self.log.read_text().splitlines() if self.log.exists() else []:
            run = json.loads(line)
            self.runs.setdefault(run["name"], []).append(run)
        head, *lines = page_table(self.page, self.mark) or [""]
        self.kept = {line[2:].split(" | ")[0]: line for line in lines[1:]} if head == self.head().split("\n")[0] else {}

    def clear(self, begins=""):
        """Forgets the rows whose names begin so."""
        others = lambda rows: {name: row for name, row in rows.items() if not name.startswith(begins)}
        self.runs, self.kept = others(self.runs), others(self.kept)

    def add(self, name, **values):
        """Keeps the values of a run after the others of its name that this process made (with
        `resumes`, after all), and prints the row so far."""
        if name not in self.new and not self.resumes:
            self.runs[name] = []
        self.new.add(name)
        self.runs.setdefault(name, []).append({"name": name, **values})
        self.log.write_text("".join(json.dumps(run) + "\n" for runs in self.runs.values() for run in runs))
        print(self.row(name), flush=True)

    def has(self, name, **values):
        """Whether a run of this name has these values."""
        return any(values.items() <= run.items() for run in self.runs.get(name, []))

    def row(self, name):
        cells = [name]
        for _, value, *form in self.columns:
            found = value(self.runs[name]) if callable(value) else mean(run[value] for run in self.runs[name])
            cells.append(format(found, form[0] if form else "") if not isinstance(found, str) else found)
        return "| " + " | ".join(cells) + " |"

    def head(self):
        heads = [self.first, *(column[0] for column in self.columns)]
        return "| " + " | ".join(heads) + " |\n| --- |" + " ---: |" * len(self.columns)

    def write(self, order=None):
        """Writes the table into its page, the names by their `order`."""
        names = sorted({**self.kept, **self.runs}, key=order or (lambda name: 0))
        is_kept = lambda name: name in self.kept and name not in self.new
        rows = [self.kept[name] if is_kept(name) else self.row(name) for name in names]
        measured(self.page, "\n".join([self.head(), *rows]), self.mark)


def page_path(page):
    return ROOT / "scripts" / "measured" / f"{page}.md"


def page_table(page, mark):
    """The lines of a table in its page, the head first; none if it is not there."""
    text = page_path(page).read_text() if page_path(page).exists() else ""
    _, found, rest = text.partition(f"<!-- {mark} -->\n")
    return rest.split(f"\n<!-- end of {mark} -->")[0].split("\n") if found else []


def measured(page, text, mark=None):
    """Puts a table between its marks in scripts/measured/PAGE.md, with the date and the machine."""
    path = page_path(page)
    first, last = f"<!-- {mark or page} -->", f"<!-- end of {mark or page} -->"
    when = f"Measured {datetime.date.today()}, {machine()}"
    command = shlex.join([os.path.relpath(SCRIPT, ROOT), *sys.argv[1:]])
    old = path.read_text() if path.exists() else f"# {page}\n\n{when}\n\n    {command}\n"
    old = "\n".join(when if line.startswith("Measured 20") else line for line in old.split("\n"))
    if first not in old:
        old = f"{old.rstrip()}\n\n{first}\n{last}\n"
    before, rest = old.split(first, 1)
    path.parent.mkdir(exist_ok=True)
    path.write_text(f"{before}{first}\n{text}\n{last}{rest.split(last, 1)[1]}")
    print(f"written: scripts/measured/{page}.md")


def main(studies, file, default=None):
    """Runs the study that the first word names."""
    name, words = (sys.argv[1], sys.argv[2:]) if len(sys.argv) > 1 else (default, [])
    if name not in studies:
        sys.exit(f"{file}: '{name}'; wanted {', '.join(studies)}")
    try:
        inspect.signature(studies[name]).bind(*words)
    except TypeError as error:
        sys.exit(f"{file} {name}: {error}")
    start(file, "--workspace")
    studies[name](*words)

"""Shared by the packages: the tools as binaries, what they need of the system, and the version of the workspace."""
import os
import pathlib
import platform
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
TOOLS = ["lf-synth", "lf-calib", "lf-prune", "lf-mart", "lf-fit", "lf-xcorr", "lf-flow", "lf-validate"]
OLD_GLIBC = "2.17"  # of CentOS 7 and all that came later
MACHINES = {62: "x86_64", 183: "aarch64"}  # by the number in the header of an ELF file


def refuse(message):
    """Ends in one line with exit code 2."""
    print(f"{os.path.basename(sys.argv[0])}: {message}", file=sys.stderr)
    sys.exit(2)


def build():
    """Builds the tools and returns their folder. With cargo-zigbuild they run on systems as old as `OLD_GLIBC`."""
    words, folder = ["cargo", "build"], "release"
    if shutil.which("cargo-zigbuild"):
        triple = f"{platform.machine()}-unknown-linux-gnu"
        words, folder = ["cargo", "zigbuild", "--target", f"{triple}.{OLD_GLIBC}"], f"{triple}/release"
    else:
        print("cargo-zigbuild is not installed: the tools will need the C library of this system", file=sys.stderr)
    subprocess.run([*words, "--release", "--bins", "--locked"], cwd=ROOT, check=True)
    return ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / folder


def output(folder):
    """The folder for a package, made if it is not there."""
    folder = pathlib.Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        refuse(f"{folder}: {error.strerror}; wanted a folder")
    return folder


def tools(folder):
    """The bytes of the tools in a folder, by name."""
    folder = pathlib.Path(folder)
    missing = [tool for tool in TOOLS if not (folder / tool).is_file()]
    if missing:
        refuse(f"{folder}: no {', '.join(missing)}; wanted a folder with all tools")
    return {tool: (folder / tool).read_bytes() for tool in TOOLS}


def needs(binaries):
    """The machine that the binaries are for, and the oldest C library with all their symbols: ("x86_64", (2, 17))."""
    versions, machines = set(), set()
    for name, data in binaries.items():
        if data[:4] != b"\x7fELF":
            refuse(f"{name}: not an ELF file; wanted a program for Linux")
        machines.add(MACHINES.get(int.from_bytes(data[18:20], "little")))
        versions |= {tuple(map(int, found)) for found in re.findall(rb"\0GLIBC_(\d+)\.(\d+)", data)}
    if len(machines) != 1 or None in machines or not versions:
        refuse(f"tools for {machines} with C libraries {versions}; wanted one of {set(MACHINES.values())}, with glibc")
    return machines.pop(), max(versions)


def cargo_key(key):
    """The first value of a key of the workspace's Cargo.toml, such as its version."""
    return re.search(rf'^{key} = "(.+)"$', (ROOT / "Cargo.toml").read_text(), re.MULTILINE)[1]

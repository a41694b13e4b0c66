"""The light-field chain from Python: its tools, its files as arrays, and its rays.

    lf.run("lf-mart", "support.lfv", image="frame.exr", camera="camera.json", output="volume.lfv")
    volume = lf.read("volume.lfv")
    lf.show("field.exr")

`run` needs no other package. The rest needs numpy; OpenEXR for images and fields; Pillow for TIFF; xxhash to write a
`.lfv` and to check one; matplotlib for `show` (`pip install numpy OpenEXR pillow xxhash xarray matplotlib`). With
xarray `read` gives labelled arrays. Lengths are mm; places on an image are pixels. The frame, its signs and the formats are
those of lf-core: see the documentation of its modules `optics`, `volume`, `image` and `field`. `scripts/examples` has
stages that use this module, and `first_field.py`, which shows it from a scene to vectors.
"""

from __future__ import annotations

import argparse
import json
import mmap
import os
import resource
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Callable

Path = str | os.PathLike
FRAME = "right-handed"  # X right and Y up in the picture, Z towards the camera.
SIGNATURE = b"\x89LFV\r\n\x1a\n"
# The components of a field and their units.
FIELD_UNITS = {"u": "mm", "v": "mm", "w": "mm", "peak": "1", "ratio": "1", "su": "mm", "sv": "mm", "sw": "mm"}
FIELD_UNITS |= {"flag": "1", "count": "1"}


class Refused(Exception):
    """Work that cannot be done: `file: what was found; what was wanted`."""


def module(name: str, purpose: str) -> Any:
    """The Python module of this name; refuses if it is missing, and says what it is for and how to install it."""
    try:
        return __import__(name)
    except ImportError:
        raise Refused(f"{name}: no such Python module; wanted it {purpose} (pip install {name})") from None


class _Missing:
    """Stands for numpy where it is not installed: `run` works, and what needs numpy refuses."""

    def __getattr__(self, name):
        module("numpy", "to read and write files")


try:
    import numpy as np
except ImportError:
    np = _Missing()


def _check_frame(path, header):
    wanted = f'wanted "frame": "{FRAME}"; make the file again from the images'
    if "frame" not in header:
        raise Refused(f"{path}: its header names no frame: lf 0.1.0 wrote it, with x to the left; {wanted}")
    if header["frame"] != FRAME:
        raise Refused(f"{path}: its header has the frame {header['frame']!r}; {wanted}")


# The tools


def run(tool: str, *words: Any, **options: Any) -> Any:
    """Runs a tool: `run("lf-calib", "lattice", "white.exr", camera="nominal.json", o="camera.json")`.

    `words` are its arguments. An option is a keyword, with _ for -: a tuple is joined by commas (`depth=(-5, 5)`), a
    list is several values (`particles=["a.csv", "b.csv"]`), True is an option without a value, None and False leave it out.

    Returns what the tool prints: JSON as its values, text as `str`, other bytes as they are. If it prints nothing,
    returns its account: `seconds`, `phases` (s), `peak_bytes`, `counts`. Raises `Refused` with its message if it fails;
    a score that misses a limit (exit code 1) is returned.
    Its warnings go to standard error. The tool is that of the PATH, or the one installed beside this module."""
    program = shutil.which(tool) or shutil.which(tool, path=sysconfig.get_path("scripts"))
    if program is None:
        raise Refused(f"{tool}: not on the PATH; wanted a tool of lf")
    line = [program, *map(str, words)]
    with tempfile.TemporaryDirectory() as folder:
        stats = options.pop("stats", None) or os.path.join(folder, "stats.json")
        for name, value in {**options, "stats": stats}.items():
            if value is None or value is False:
                continue
            line.append(f"-{name}" if len(name) == 1 else "--" + name.replace("_", "-"))
            values = value if isinstance(value, list) else [] if value is True else [value]
            line += [",".join(map(str, one)) if isinstance(one, tuple) else str(one) for one in values]
        done = subprocess.run(line, stdin=subprocess.DEVNULL, capture_output=True)
        said = done.stderr.decode(errors="replace").strip()
        if done.returncode not in (0, 1) or (done.returncode == 1 and not done.stdout):
            raise Refused(said or f"{tool}: ended with {done.returncode}; wanted 0")
        if said:
            print(said, file=sys.stderr)
        if not done.stdout:
            with open(stats) as file:
                return json.load(file)
    try:
        text = done.stdout.decode()
    except UnicodeDecodeError:
        return done.stdout
    try:
        return json.loads(text)
    except ValueError:
        return text


# Volumes


@dataclass
class Grid:
    """A regular grid of voxels in the object frame; `origin_mm` is the centre of voxel (0, 0, 0)."""

    shape: tuple[int, int, int]  # nx, ny, nz
    spacing_mm: tuple[float, float, float]
    origin_mm: tuple[float, float, float]

    @classmethod
    def in_bounds(cls, bounds_mm, spacing_mm) -> Grid:
        """Centred in `bounds_mm` = [[x0, x1], [y0, y1], [z0, z1]]: voxels that cover the depth; x and y are rounded."""
        low, high = np.array(bounds_mm, float).T
        spacing = np.array(spacing_mm, float)
        voxels = (high - low) / spacing
        shape = np.array([*np.floor(voxels[:2] + 0.5), np.ceil((1 - 1e-9) * voxels[2])]).astype(int)
        if not (shape >= 1).all():
            raise Refused(f"--pvr, --depth, --bounds: {shape.tolist()} voxels; wanted a grid with voxels")
        origin = 0.5 * (low + high) - 0.5 * (shape - 1) * spacing
        return cls(tuple(shape.tolist()), tuple(spacing.tolist()), tuple(origin.tolist()))

    def __len__(self):
        return int(np.prod([int(n) for n in self.shape]))

    def axes_mm(self) -> list[np.ndarray]:
        """Centres along x, y and z, mm: arrays of nx, ny and nz."""
        return [o + d * np.arange(n) for n, d, o in zip(self.shape, self.spacing_mm, self.origin_mm)]

    def centres_mm(self, indices: np.ndarray) -> list[np.ndarray]:
        """Centres of the voxels with linear indices x + nx (y + ny z), mm: three arrays of the indices' shape."""
        nx, ny, _ = (np.uint64(n) for n in self.shape)
        steps = indices % nx, indices // nx % ny, indices // nx // ny
        return [o + d * step.astype(float) for step, d, o in zip(steps, self.spacing_mm, self.origin_mm)]


@dataclass
class Volume:
    """A `.lfv`: some voxels of a grid, and named columns of their values."""

    grid: Grid
    indices: np.ndarray  # (n,) u64, strictly rising
    columns: dict[str, np.ndarray]  # name -> (n,) f32
    history: list = field(default_factory=list)
    extra: dict = field(default_factory=dict)  # header keys that this module does not know

    def dense(self, column: str) -> np.ndarray:
        """A column as an array of shape (nz, ny, nx), zero where there is no voxel."""
        nx, ny, nz = self.grid.shape
        whole = np.zeros(len(self.grid), np.float32)
        whole[self.indices] = self.columns[column]
        return whole.reshape(nz, ny, nx)


def read_volume(path: Path) -> Volume:
    """Reads a `.lfv`, mapped and not copied; `-` is standard input, read to its end. The arrays are read-only."""
    data = _bytes(path)
    if data[:8] != SIGNATURE or len(data) < 16 or int.from_bytes(data[8:12], "little") != 1:
        raise Refused(f"{path}: not a .lfv of version 1 by its first bytes; wanted a .lfv")
    start = 16 + int.from_bytes(data[12:16], "little")
    try:
        header = json.loads(data[16:start])
        _check_frame(path, header)
        count, names, wanted = int(header["count"]), list(header["columns"]), header["checksum"]
        grid = Grid(*(tuple(header["grid"][key]) for key in ("shape", "spacing_mm", "origin_mm")))
    except (ValueError, KeyError, TypeError) as error:
        raise Refused(f"{path}: {error!r} in its header; wanted the header of a .lfv file") from None
    places, end = [], start + 8 * count
    for _ in names:
        places.append(end + -end % 64)
        end = places[-1] + 4 * count
    if len(data) != end:
        raise Refused(f"{path}: {len(data)} bytes; wanted the {end} bytes that its header gives")
    try:
        checksum = _xxh3([memoryview(data)[start:]])
    except Refused as missing:
        print(f"{path}: not checked for damage: {missing}", file=sys.stderr)
        checksum = wanted
    if checksum != wanted:
        raise Refused(f"{path}: damaged, its bytes give checksum {checksum}; wanted {wanted} as its header says")
    indices = np.frombuffer(data, "<u8", count, start)
    if (indices[1:] <= indices[:-1]).any() or (count and indices[-1] >= len(grid)):
        raise Refused(f"{path}: indices that do not rise, or leave the grid; wanted strictly rising indices in it")
    columns = {name: np.frombuffer(data, "<f4", count, place) for name, place in zip(names, places)}
    known = ("count", "frame", "grid", "columns", "checksum", "history")
    extra = {key: value for key, value in header.items() if key not in known}
    return Volume(grid, indices, columns, header.get("history", []), extra)


def write_volume(path: Path, volume: Volume) -> None:
    """Writes a `.lfv` whole or not at all; `-` is standard output. A file that lf-core wrote comes out byte for byte,
    except numbers below 1e-4 or above 1e16, which every language writes into JSON in its own way."""
    grid, indices = volume.grid, np.ascontiguousarray(volume.indices, "<u8")
    if (indices[1:] <= indices[:-1]).any() or (len(indices) and indices[-1] >= len(grid)):
        raise ValueError("indices do not rise, or leave the grid")
    parts, length = [memoryview(indices).cast("B")], 8 * len(indices)
    for name, values in volume.columns.items():
        values = np.ascontiguousarray(values, "<f4")
        if values.shape != indices.shape or not np.isfinite(values).all():
            raise ValueError(f"column {name}: wanted {len(indices)} finite values")
        parts += [bytes(-length % 64), memoryview(values).cast("B")]
        length += -length % 64 + 4 * len(indices)
    header = {
        "count": len(indices),
        "frame": FRAME,
        "grid": {"shape": grid.shape, "spacing_mm": grid.spacing_mm, "origin_mm": grid.origin_mm},
        "columns": list(volume.columns),
        "checksum": _xxh3(parts),
        **({"history": volume.history} if volume.history else {}),
        **volume.extra,
    }
    text = json.dumps(header, separators=(",", ":"), ensure_ascii=False).encode()
    text += b" " * (-(16 + len(text)) % 64)
    save(path, [SIGNATURE, (1).to_bytes(4, "little"), len(text).to_bytes(4, "little"), text, *parts])


def _xxh3(parts):
    """XXH3-64 with seed 0 of the joined byte strings, as 16 hexadecimal digits."""
    total = module("xxhash", "for the checksum of a .lfv").xxh3_64()
    for part in parts:
        total.update(part)
    return total.hexdigest()


def _bytes(path):
    if str(path) == "-":
        return sys.stdin.buffer.read()
    try:
        with open(path, "rb") as file:
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) if os.fstat(file.fileno()).st_size else b""
    except OSError as error:
        raise Refused(f"{path}: {error.strerror}; wanted a file to read") from None


def save(path, parts):
    """Writes the joined byte strings to a file that appears whole or not at all; `-` is standard output."""
    if str(path) == "-":
        for part in parts:
            sys.stdout.buffer.write(part)
        return sys.stdout.buffer.flush()
    try:
        with tempfile.NamedTemporaryFile(dir=os.path.dirname(path) or ".", delete=False) as file:
            try:
                for part in parts:
                    file.write(part)
                file.flush()
                os.chmod(file.name, 0o666 & ~_umask())
                os.replace(file.name, path)
            except BaseException:
                os.unlink(file.name)
                raise
    except OSError as error:
        raise Refused(f"{path}: {error.strerror}; wanted a place to write") from None


def _umask():
    mask = os.umask(0)
    os.umask(mask)
    return mask


# Images and fields


def _exr(path):
    """The channels of an EXR by name, each (height, width), and its header."""
    exr = module("OpenEXR", "to read images and fields")
    if not os.path.isfile(path):
        raise Refused(f"{path}: no such file; wanted an EXR")
    try:
        file = exr.File(str(path), separate_channels=True)
    except (RuntimeError, ValueError, TypeError) as error:
        raise Refused(f"{path}: {error}; wanted an EXR") from None
    return {name: channel.pixels for name, channel in file.channels().items()}, file.header()


def read_image(path: Path, channel: str | None = None) -> tuple[np.ndarray, list]:
    """A light-field image as counts, (height, width) f32, and its history, which only an EXR has. TIFF and PNG need
    Pillow. `run.tif:3` is page 3 of `run.tif`, counted from 0; `channel` (r, g, b or luma) chooses from colour whose
    channels differ."""
    file, page = _split_page(path)
    if os.path.splitext(file)[1].lower() in (".tif", ".tiff", ".png"):
        return _read_picture(file, page, channel), []
    channels, header = _exr(path)
    if list(channels) != ["Y"]:
        raise Refused(f"{path}: channels {', '.join(channels)}; wanted one channel Y")
    counts = channels["Y"].astype(np.float32)
    if not np.isfinite(counts).all():
        raise Refused(f"{path}: pixels that are not finite; wanted finite values")
    return counts, json.loads(header.get("lf:history", "[]"))


def _split_page(path):
    """A file and the page that its name ends in, or None; a file of exactly that name comes first, as in lf-core."""
    file, colon, page = str(path).rpartition(":")
    named = colon and page.isdecimal() and os.path.exists(file) and not os.path.exists(path)
    return (file, int(page)) if named else (str(path), None)


def _read_picture(path, page, channel):
    module("PIL", "to read TIFF and PNG (its package is called pillow)")
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            pages = getattr(image, "n_frames", 1)
            if page is None and pages > 1:
                raise Refused(f"{path}: {pages} pages; wanted one of them, {path}:0 to {path}:{pages - 1}")
            if (page or 0) >= pages:
                raise Refused(f"{path}: no page {page}, the file has {pages}; wanted a page from 0 to {pages - 1}")
            image.seek(page or 0)
            counts = np.asarray(image.convert("RGB") if image.mode == "P" else image)
    except FileNotFoundError:
        raise Refused(f"{path}: no such file; wanted an image") from None
    except (OSError, UnidentifiedImageError) as error:
        raise Refused(f"{path}: {error}; wanted a TIFF or PNG of grey or RGB") from None
    opaque = 1 if counts.dtype.kind == "f" else np.iinfo(counts.dtype).max if counts.dtype.kind == "u" else None
    counts = counts.astype(np.float32)
    if counts.ndim == 2:
        return counts
    if channel is None and counts.shape[2] in (2, 4) and (counts[..., -1] != opaque).any():
        raise Refused(f"{path}: pixels that are not opaque; wanted full alpha, or --channel, which ignores alpha")
    if counts.shape[2] < 3:
        return counts[..., 0]
    red, green, blue = (counts[..., number] for number in range(3))
    if channel is None and ((red != green) | (green != blue)).any():
        raise Refused(f"{path}: colour; wanted equal channels, or --channel r, g, b or luma")
    luma = np.float32(0.2126) * red + np.float32(0.7152) * green + np.float32(0.0722) * blue
    return {None: red, "r": red, "g": green, "b": blue, "luma": luma}[channel]


def read_frame(
    path: Path,
    camera: Camera,
    background: Path | None = None,
    channel: str | None = None,
    mask: Path | None = None,
) -> tuple[np.ndarray, list]:
    """An image of the camera's size, minus a background, divided by the camera's flat field; and its history. Negative
    values become 0. A pixel that sees less than a twentieth of the flat field's light is NaN, and so is one that the
    camera's second stop cuts or where the mask is 0, as in lf-core."""

    def sized(file):
        counts, history = read_image(file, channel)
        if counts.shape != camera.sensor_px[::-1]:
            height, width = counts.shape
            raise Refused(f"{file}: image of {width} x {height} px; wanted the camera's %d x %d px" % camera.sensor_px)
        return counts, history

    counts, history = sized(path)
    if background is not None:
        counts = counts - sized(background)[0]
    counts = np.maximum(counts, 0)
    if camera.flat_field is not None:
        flat = sized(camera.flat_field)[0]
        counts = np.where(flat < 0.05, np.float32(np.nan), counts / np.maximum(flat, np.float32(0.05)))
    if camera.second_stop is not None or camera.blades is not None:
        counts = np.where(camera.is_cut(), np.float32(np.nan), counts)
    if mask is not None:
        counts = np.where(sized(mask)[0] > 0, counts, np.float32(np.nan))
    return counts, history


def read_field(path: Path) -> tuple[dict, dict[str, np.ndarray]]:
    """A vector field: its layout (the attribute `lf:field` as a dict), and its components by name (u, v, w, su, sv, sw
    in mm; peak, ratio, flag, count), each (nz, ny, nx) f32. Flag 0 is measured, 1 replaced, 2 no data."""
    channels, header = _exr(path)
    if "lf:field" not in header:
        raise Refused(f"{path}: an EXR of channels {', '.join(channels)} without attribute lf:field; wanted a field")
    layout = json.loads(header["lf:field"])
    _check_frame(path, layout)
    return layout, {name: pixels.reshape(layout["shape"][::-1]) for name, pixels in channels.items()}


def write_field(path: Path, layout: dict, components: dict[str, np.ndarray]) -> None:
    """Writes a field that the tools read: `layout` as `read_field` gives it, and every component, (nz, ny, nx). Components
    that are left out are those of measured vectors without uncertainty. The file appears whole or not at all."""
    shape = tuple(layout["shape"][::-1])
    given = {"peak": 0, "ratio": 0, "su": np.nan, "sv": np.nan, "sw": np.nan, "flag": 0, "count": np.nan, **components}
    if set(given) != set(FIELD_UNITS):
        raise ValueError(f"components {', '.join(given)}; wanted {', '.join(FIELD_UNITS)}")
    channels = {}
    for name, values in given.items():
        values = np.broadcast_to(np.asarray(values, np.float32), shape)
        channels[name] = np.ascontiguousarray(values.reshape(shape[0] * shape[1], shape[2]))
    moved = np.stack([channels[name] for name in "uvw"])
    if not (np.isfinite(moved).all(0) | (channels["flag"] == 2)).all():
        raise ValueError("a displacement that is not finite; wanted finite values or flag 2")
    text = json.dumps({"units": FIELD_UNITS, "frame": FRAME, **layout})
    _write_exr(path, channels, {"lf:field": text})


def _write_exr(path, channels, header):
    exr = module("OpenEXR", "to write images and fields")
    header = {"compression": exr.ZIPS_COMPRESSION, "type": exr.scanlineimage, **header}
    with tempfile.TemporaryDirectory(dir=os.path.dirname(path) or ".") as folder:
        part = os.path.join(folder, "part.exr")
        exr.File(header, channels).write(part)
        os.replace(part, path)


# Files of `lf-validate export`. Each reader needs one library and gives plain arrays.


def read_netcdf(path: Path) -> tuple[dict, dict[str, np.ndarray]]:
    """A `.nc` as `read_field` gives a field; components of a series are (t, nz, ny, nx). Needs scipy."""
    module("scipy", "to read NetCDF")
    from scipy.io import netcdf_file

    try:
        with netcdf_file(path, mmap=False) as file:
            values = {name: np.array(file.variables[name].data, np.float32) for name in FIELD_UNITS}
            return json.loads(file.lf_field), values
    except OSError as error:
        raise Refused(f"{path}: {error.strerror or error}; wanted a NetCDF to read") from None
    except (TypeError, ValueError, KeyError, AttributeError) as error:
        raise Refused(f"{path}: {error}; wanted a field that lf-validate export wrote") from None


def read_stack(path: Path) -> np.ndarray:
    """A `.tif` as values (nz, ny, nx), y upwards as everywhere here. Needs tifffile."""
    stack = module("tifffile", "to read stacks").imread(path)
    return stack.reshape(-1, *stack.shape[-2:])[:, ::-1]


def read_vtk(path: Path) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """A `.vti` or `.vtp`: the places of its points (n, 3), and its arrays by name, (n,) or (n, components). Needs vtk."""
    module("vtk", "to read the files of VTK")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLImageDataReader, vtkXMLPolyDataReader

    reader = vtkXMLPolyDataReader() if str(path).endswith(".vtp") else vtkXMLImageDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    data = reader.GetOutput()
    places = np.array([data.GetPoint(n) for n in range(data.GetNumberOfPoints())])
    arrays = data.GetPointData()
    return places, {arrays.GetArrayName(n): vtk_to_numpy(arrays.GetArray(n)) for n in range(arrays.GetNumberOfArrays())}


# Any file, and its picture


def _labelled(dims: tuple, axes: dict, values: dict, units: dict, attrs: dict) -> Any:
    """Arrays with their axes: an xarray.Dataset, or without xarray a dict that also has the axes and `attrs`."""
    try:
        import xarray
    except ImportError:
        return {**axes, **values, "attrs": attrs}
    coordinates = {name: (name, axis, {"units": "mm"}) for name, axis in axes.items()}
    variables = {name: (dims, array, {"units": units.get(name, "1")}) for name, array in values.items()}
    return xarray.Dataset(variables, coordinates, attrs)


def _parts(data: Any) -> tuple[dict, dict]:
    """The arrays by name and the attributes of what `_labelled` gave."""
    if hasattr(data, "data_vars"):
        return {name: array.values for name, array in data.data_vars.items()}, dict(data.attrs)
    if not isinstance(data, dict):
        raise ValueError(f"{type(data).__name__}; wanted what lf.read gives")
    return {name: array for name, array in data.items() if name not in ("x", "y", "z", "attrs")}, data.get("attrs", {})


def _read_table(path):
    lines = _bytes(path)[:].decode().splitlines()
    comments = [line for line in lines if line.startswith("#")]
    names, *rows = [line for line in lines if line and not line.startswith("#")] or [""]
    names = names.split(",")
    try:
        table = np.array([row.split(",") for row in rows], float).reshape(len(rows), len(names))
    except ValueError as error:
        raise Refused(f"{path}: {error}; wanted a table of numbers with one line of names") from None
    values = {name: column.astype(int) if name in ("frame", "id") else column for name, column in zip(names, table.T)}
    units = {name: unit for name in names for _, _, unit in [name.rpartition("_")] if unit in ("mm", "mm2")}
    return _labelled(("row",), {}, values, units, {"comments": "\n".join(comments)})


def read(path: Path, channel: str | None = None) -> Any:
    """Reads any file of the chain, with xarray where it is installed, otherwise with numpy.

    | file | what comes | shape |
    | --- | --- | --- |
    | image (.exr, .tif, .png) | counts, with dimensions row and column, f32 | (height, width) |
    | volume (.lfv) | its columns by name, NaN where there is no voxel; x, y, z in mm, f32 | (nz, ny, nx) |
    | field (.exr, .nc) | u, v, w and su, sv, sw in mm, peak, ratio, flag, count; x, y, z in mm, f32 | (nz, ny, nx) |
    | table (.csv) | its columns by name, which end in their unit | (rows,) |
    | .json | its values | |

    An image is an xarray.DataArray or an array, the others are an xarray.Dataset or a dict of arrays. `write` takes
    both back. A volume of a large frame has few voxels and a grid that may not fit into memory: use `read_volume`. `channel`
    is that of `read_image`."""
    file, _ = _split_page(path)
    ending = os.path.splitext(file)[1].lower()
    if ending == ".json":
        try:
            return json.loads(_bytes(path)[:])
        except ValueError as error:
            raise Refused(f"{path}: {error}; wanted JSON") from None
    if ending == ".csv":
        return _read_table(path)
    if ending == ".lfv":
        volume = read_volume(path)
        grid, values = volume.grid, {}
        for name in volume.columns:
            values[name] = volume.dense(name)
            absent = np.ones(len(grid), bool)
            absent[volume.indices] = False
            values[name].reshape(-1)[absent] = np.nan
        attrs = {"grid": json.dumps(vars(grid)), "history": json.dumps(volume.history), **volume.extra}
        return _labelled(("z", "y", "x"), dict(zip("xyz", grid.axes_mm())), values, {}, attrs)
    if ending == ".nc" or ending == ".exr" and "lf:field" in _exr(path)[1]:
        layout, values = read_netcdf(path) if ending == ".nc" else read_field(path)
        axes = Grid(layout["shape"], layout["spacing_mm"], layout["origin_mm"]).axes_mm()
        dims = ("t", "z", "y", "x") if values["u"].ndim == 4 else ("z", "y", "x")
        return _labelled(dims, dict(zip("xyz", axes)), values, FIELD_UNITS, {"lf_field": json.dumps(layout)})
    if ending not in (".exr", ".tif", ".tiff", ".png"):
        raise Refused(f"{path}: an unknown ending; wanted .exr, .tif, .png, .lfv, .csv, .nc or .json")
    counts, history = read_image(path, channel)
    try:
        import xarray
    except ImportError:
        return counts
    return xarray.DataArray(counts, dims=("row", "column"), attrs={"units": "counts", "history": json.dumps(history)})


def write(path: Path, data: Any) -> None:
    """Writes what `read` gives, changed or not: a volume as .lfv, a field or an image (height, width) as .exr, a table
    as .csv, values as .json. A voxel is left out where a column is NaN. The file appears whole or not at all."""
    ending = os.path.splitext(path)[1].lower()
    if ending == ".json":
        save(path, [(json.dumps(data, indent=2) + "\n").encode()])
    elif ending == ".lfv":
        values, attrs = _parts(data)
        attrs = dict(attrs)
        grid = Grid(**json.loads(attrs.pop("grid")))
        history = json.loads(attrs.pop("history", "[]"))
        columns = {name: np.asarray(array, np.float32) for name, array in values.items()}
        if any(array.shape != tuple(grid.shape[::-1]) for array in columns.values()):
            raise ValueError("a part of a volume; wanted the whole grid")
        there = np.logical_and.reduce([np.isfinite(array).ravel() for array in columns.values()])
        indices = np.flatnonzero(there).astype(np.uint64)
        columns = {name: array.ravel()[there] for name, array in columns.items()}
        write_volume(path, Volume(grid, indices, columns, history, attrs))
    elif ending == ".csv":
        values, attrs = _parts(data)
        rows = zip(*(np.asarray(array).tolist() for array in values.values()))
        lines = [*filter(None, [attrs.get("comments")]), ",".join(values), *(",".join(map(repr, row)) for row in rows)]
        save(path, ["".join(line + "\n" for line in lines).encode()])
    elif ending == ".exr" and getattr(data, "ndim", None) == 2:
        counts = np.ascontiguousarray(data, np.float32)
        _write_exr(path, {"Y": counts}, {"lf:history": getattr(data, "attrs", {}).get("history", "[]")})
    elif ending == ".exr":
        values, attrs = _parts(data)
        write_field(path, json.loads(attrs["lf_field"]), values)
    else:
        raise Refused(f"{path}: an unknown ending; wanted .exr, .lfv, .csv or .json")


def show(what: Any, where: str = "z") -> Any:
    """Draws a file of `read` or what it gives, with matplotlib, and returns the axes. Lengths are mm.

    A field is one slice: arrows are the displacement in the slice, replaced vectors grey, and colour is the component
    across it. `where` is the normal of the slice, `z`, or with a place in mm, `y=0.5`; without a place it is the middle
    one. A volume is its brightest voxels along `where`. A table of particles or vectors is seen along z; colour is depth.
    An image is grey, from black for no counts to white for all but the brightest thousandth."""
    module("matplotlib", "to draw")
    from matplotlib import pyplot

    data = read(what) if isinstance(what, (str, os.PathLike)) else what
    if isinstance(data, Volume):
        raise ValueError("a Volume; wanted the path of its file, or what lf.read gives")
    name, _, place = where.partition("=")
    if name not in ("x", "y", "z"):
        raise ValueError(f"where={where!r}; wanted x, y or z, or one with a place as y=0.5")
    figure, view = pyplot.subplots(figsize=(7, 6), layout="constrained")
    if getattr(data, "ndim", None) == 2:
        picture = view.imshow(data, cmap="gray", vmin=0, vmax=np.nanquantile(data, 0.999), interpolation="nearest")
        figure.colorbar(picture, label="counts")
        view.set(xlabel="column, px", ylabel="row, px")
    elif "x_mm" in data:
        x, y, z = (np.asarray(data[key]) for key in ("x_mm", "y_mm", "z_mm"))
        if "u_mm" in data:
            u, v = (np.asarray(data[key]) for key in ("u_mm", "v_mm"))
            figure.colorbar(view.quiver(x, y, u, v, z, cmap="viridis", width=0.003), label="z, mm")
        else:
            figure.colorbar(view.scatter(x, y, c=z, s=4, cmap="viridis"), label="z, mm")
        view.set(xlabel="x, mm", ylabel="y, mm", aspect="equal")
        view.set_title(f"{len(x)} {'vectors' if 'u_mm' in data else 'particles'}, seen along z", fontsize=10)
    else:
        axes = [np.asarray(data[key]) for key in "xyz"]
        _draw_slice(view, _parts(data)[0], axes, "xyz".index(name), float(place) if place else None)
    return view


MEASURED, NO_DATA = 0, 2  # Flags of a field.
MOST_ARROWS = 40  # Arrows a side. Of more, every second, third ... is drawn.


def _draw_slice(view, values, places, normal, wanted):
    """Draws a slice of a field, or the brightest voxels of a volume, across the axis `normal`."""
    right, up = (axis for axis in range(3) if axis != normal)
    view.set_aspect("equal" if normal == 2 else "auto")
    view.set(xlabel=f"{'xyz'[right]}, mm", ylabel=f"{'xyz'[up]}, mm")
    if "u" not in values:
        column, dense = next(reversed(values.items()))
        brightest = np.where(np.isnan(dense), 0, dense).max(2 - normal)
        limit = np.quantile(brightest, 0.999) or None
        mesh = view.pcolormesh(places[right], places[up], brightest, cmap="magma", vmin=0, vmax=limit)
        view.figure.colorbar(mesh, label=column)
        view.set_title(f"brightest voxels along {'xyz'[normal]}", fontsize=10)
        return
    count = len(places[normal])
    low, high = places[normal].min(), places[normal].max()
    if wanted is not None and not low - 1e-6 <= wanted <= high + 1e-6:
        raise Refused(f"no layer at {'xyz'[normal]} = {wanted:g} mm; wanted a place from {low:.4g} to {high:.4g} mm")
    nearest = np.abs(places[normal] - wanted).argmin() if wanted is not None else count // 2
    title = f"{'xyz'[normal]} = {places[normal][nearest]:.3g} mm"

    # Components are (z, y, x). Rows of the slice run along y, or along z in a slice across y.
    cut = {key: array.take(nearest, 2 - normal) for key, array in values.items()}
    has_data = cut["flag"] != NO_DATA
    if not has_data.any():
        raise Refused(f"no data in the slice {title}; wanted another slice")
    u, v, w = (np.where(has_data, cut["uvw"[axis]], np.nan) for axis in (right, up, normal))
    limit = np.nanmax(np.abs(w)) or 1
    mesh = view.pcolormesh(places[right], places[up], w, cmap="RdBu_r", vmin=-limit, vmax=limit, shading="nearest")
    view.figure.colorbar(mesh, label=f"{'uvw'[normal]}, mm")

    every = tuple(slice(n % step // 2, None, step) for n in u.shape for step in [-(-n // MOST_ARROWS)])
    x, y = (part[every] for part in np.meshgrid(places[right], places[up]))
    u, v, measured = u[every], v[every], cut["flag"][every] == MEASURED
    # The longest arrow is as long as the distance between arrows, at any scale of the axes.
    longest = np.nanmax(np.hypot(u, v)) or 1
    options = {"scale": longest * (max(x.shape) + 1), "scale_units": "width", "width": 0.003, "pivot": "mid"}
    for flagged, colour in ((measured, "black"), (~measured, "grey")):
        view.quiver(x[flagged], y[flagged], u[flagged], v[flagged], color=colour, **options)
    view.set_title(f"{title}; the longest arrow is {longest:.3g} mm", fontsize=10)


# The camera and its rays


class Camera:
    """A `camera.json` and its rays, as the module `optics` of lf-core has them."""

    # A lattice counts as not turned if its rotation moves no lenslet on the sensor by more than this.
    IN_LINE_PX = 0.02
    SNELL_STEPS, PUPIL_STEPS, LATTICE_STEPS = 2, 4, 3  # Newton and fixed-point steps, as in lf-core.
    LEAST_COSINE2 = 0.05  # For rays before a telecentric lens.
    FARTHEST = 1.5  # Radii beyond which the departure of the lenslets stays constant.
    BLOCKS = {"frame", "sensor", "main_lens", "microlenses", "distortion", "tilt", "medium", "blur", "sensor_noise"}
    BLOCKS |= {"aberrations", "blades", "centres", "second_stop", "vignetting", "pose", "calibration"}

    def __init__(self, path):
        try:
            given = {key: value for key, value in json.loads(_bytes(path)[:]).items() if value is not None}
            if given.get("frame", FRAME) != FRAME:  # No key depends on the frame, so a camera may lack it.
                raise Refused(f"{path}: frame {given['frame']!r}; wanted {FRAME!r}")
            if not self.BLOCKS.issuperset(given):
                raise Refused(f"{path}: {', '.join(given.keys() - self.BLOCKS)}; wanted keys that lf.py knows")
            sensor, lens, lenslets = given["sensor"], given["main_lens"], given["microlenses"]
            self.sensor_px = (sensor["width"], sensor["height"])
            self.pixel_mm = sensor["pixel_pitch_mm"]
            self.focal_mm, self.magnification = lens["focal_length_mm"], lens["magnification"]
            self.is_round = lens["aperture"] == "circle"
            self.is_hexagonal = lenslets["layout"] == "hexagonal"
            self.pitch_mm, self.offset_mm = lenslets["pitch_mm"], lenslets["offset_mm"]
            self.rotation_rad = lenslets["rotation_rad"]
            self.image_mm = self.focal_mm * (1 + self.magnification)  # s_i
            self.object_mm = self.focal_mm * (1 + 1 / self.magnification)  # s_o
            telecentric = lens.get("telecentric")
            self.index = None if telecentric is None else telecentric.get("index", 1.0)
            self.stop_mm = lens.get("pupil_distance_mm") or self.image_mm  # L
            vergence = lens.get("pupil_vergence_per_mm")
            far = 0.0 if telecentric is not None and lens.get("pupil_distance_mm") is None else 1.0
            self.pupil_ratio = far if vergence is None else vergence * self.stop_mm  # e
            self.aperture_mm = self.stop_mm / lens["working_f_number"]  # D
            self.lenslet_mm = lenslets["focal_length_mm"]  # f_l
            self.gap_mm = lenslets.get("gap_mm") or self.lenslet_mm  # g
            self.demagnification = self.gap_mm / self.stop_mm  # k
            tilt = given.get("tilt", {"x_rad": 0, "y_rad": 0})
            self.tilt = tuple(float(np.tan(tilt[key])) for key in ("x_rad", "y_rad"))
            bent = given.get("distortion", {})
            self.distortion = (*bent.get("radial", (0, 0, 0)), *bent.get("tangential", (0, 0)))
            terms = given.get("aberrations", {})
            names = ("spherical_px", "secondary_spherical_px", "coma_px", "coma_px_per_mm", "astigmatism_px", "field_curvature_px")
            self.aberrations_mm = [terms.get(name, 0) * self.pixel_mm for name in names]
            self.medium, self.centres = given.get("medium"), given.get("centres")
            self.second_stop, self.blades = given.get("second_stop"), given.get("blades")
            self.blur = given.get("blur", {})
            if self.medium is not None:
                self.window_z_mm, self.medium_index = self.medium["window_z_mm"], self.medium["index"]
                self.window = self.medium.get("window_thickness_mm", 0), self.medium.get("window_index", 1)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise Refused(f"{path}: {error!r}; wanted a camera.json") from None
        in_line = 0.5 * max(self.sensor_px) * abs(self.rotation_rad) <= self.IN_LINE_PX
        if in_line and not self.is_hexagonal and self.centres is None:
            self.rotation_rad = 0.0
        flat = given.get("vignetting")
        self.flat_field = None if flat is None else os.path.join(os.path.dirname(path), flat)

    def grid(self, pixels_per_voxel, depth_mm, sides_mm=None) -> Grid:
        """The grid of lf-prune. `pixels_per_voxel` are pixels at the focal plane along x, y, z; `sides_mm` is
        (x0, x1, y0, y1), by default what the sensor sees of the focal plane."""
        half_x, half_y = (n * (0.5 * self.pixel_mm / self.magnification) for n in self.sensor_px)
        x0, x1, y0, y1 = sides_mm or (-half_x, half_x, -half_y, half_y)
        spacing_mm = [n * self.pixel_mm / self.magnification for n in pixels_per_voxel]
        return Grid.in_bounds([(x0, x1), (y0, y1), depth_mm], spacing_mm)

    def is_cut(self) -> np.ndarray:
        """Whether the second stop or a blade leaves a pixel no light of the main stop, or a part of it: (height, width),
        bool."""
        stop, (width, height) = self.second_stop, self.sensor_px
        unit = (self.blur.get("wavelength_nm") or 0) * 1e-6 * self.gap_mm / self.pixel_mm / self.pitch_mm
        near = 0.6 + np.hypot(self.blur.get("sigma_px", 0), (0.40 if self.is_hexagonal else 0.36) * unit)
        half = 0.5 * self.demagnification * self.aperture_mm / self.pixel_mm
        column, row = np.arange(width) + 0.5 - 0.5 * width, np.arange(height)[:, None] + 0.5 - 0.5 * height
        column, row = np.broadcast_arrays(column, row)
        # The nearest lenslet image and its neighbours, whose images may overlap.
        cut = np.zeros((height, width), bool)
        step = self.pitch_mm * np.exp(1j * (self.rotation_rad + np.arange(6) * np.pi / (3 if self.is_hexagonal else 2)))
        for x, y in [(0.0, 0.0), *((one.real, one.imag) for one in step[: 6 if self.is_hexagonal else 4])]:
            growth = 1 + self.demagnification * self.pupil_ratio
            centre = self.centre_mm(column * self.pixel_mm / growth + x, row * self.pixel_mm / growth + y)
            image = [growth * c / self.pixel_mm for c in centre]
            dx, dy = column - image[0], row - image[1]
            discs = self._blade_discs(half)
            if stop is not None:
                middle = [a + stop["slope"] * i for a, i in zip(stop.get("aside_px", (0, 0)), image)]
                discs.append((middle, 0.5 * stop["diameter_px"]))
            for middle, radius in discs:
                cut |= self._cuts(middle, radius, half, (dx, dy), near)
        return cut

    def _blade_discs(self, half):
        """Middles and radii of the discs inside which light passes the blades of an iris, for lenslet images of this half
        width; as `Blades::discs` of lf-core."""
        if self.blades is None:
            return []
        count, apothem = self.blades["count"], self.blades["apothem"]
        back = (1 - apothem**2) / (2 * max(apothem - np.cos(np.pi / count), 1e-6))
        towards = np.exp(1j * (self.blades["turn_rad"] + np.pi * (2 * np.arange(count) + 1) / count))
        return [((-back * half * one.real, -back * half * one.imag), (apothem + back) * half) for one in towards]

    def _cuts(self, middle, radius, half, place, near):
        """Whether a disc takes light of the main stop from within `near` of a place, all px from the middle of a lenslet
        image; as `Disc::cuts` of lf-core."""
        away, angle = np.hypot(*place), np.arctan2(place[1], place[0])
        wide = np.where(away > near, np.arcsin(np.minimum(near / np.maximum(away, 1e-9), 1)), np.pi)
        cut = np.zeros(away.shape, bool)
        for turn in (wide * part for part in np.linspace(-1, 1, 9)):
            along, across = away * np.cos(turn), away * np.sin(turn)
            x, y = np.cos(angle + turn), np.sin(angle + turn)
            beside = middle[0] * y - middle[1] * x
            second = middle[0] * x + middle[1] * y + np.sqrt(np.maximum(radius**2 - beside**2, 0))
            second = np.where((np.hypot(*middle) >= radius) | (radius**2 <= beside**2), 0, second)
            main = half if self.is_round else half / np.maximum(abs(x), abs(y))
            chord = np.sqrt(np.maximum(near**2 - across**2, 0))
            cut |= (second < main) & (along + chord > second) & (along - chord < main)
        return cut & (np.hypot(place[0] - middle[0], place[1] - middle[1]) > radius - near)

    def sections_mm(self, finer: int = 1) -> np.ndarray:
        """Centres (U, V) of the aperture's sections inside the stop, mm: (sections, 2). A side has as many sections as
        there are pixels under a lenslet, times `finer`."""
        n = finer * max(round(self.pitch_mm / self.pixel_mm), 1)
        centres = 0.5 * self.aperture_mm * ((2 * np.arange(n) + 1) / n - 1)
        v, u = (axis.ravel() for axis in np.meshgrid(centres, centres, indexing="ij"))
        inside = u * u + v * v <= (0.5 * self.aperture_mm) ** 2 if self.is_round else np.full(u.shape, True)
        for middle, radius in self._blade_discs(0.5 * self.aperture_mm):  # Lenslet images show them upside down.
            inside &= np.hypot(u + middle[0], v + middle[1]) <= radius
        return np.stack([u[inside], v[inside]], 1)

    def array_mm(self, x, y, z, u, v):
        """Where rays from (x, y, z) through (u, v) of the aperture meet the array, mm. U and V are measured along the
        sensor's axes, as x_m and y_m are. The arguments broadcast together; without distortion, medium and telecentric
        lens, x_m has the shape of x, z and u together, y_m that of y, z and v."""
        x, y = -x, y  # Along the sensor's axes, which the lens inverts.
        hit = self._undistorted_mm(x, y, z, u, v)
        moved = self._distortion_mm(x, y, z) if any(self.distortion) else (0, 0)
        if any(self.aberrations_mm):
            shift = self._aberrations_mm(self._undistorted_mm(x, y, z, 0.0, 0.0), z, u, v)
            moved = moved[0] + shift[0], moved[1] + shift[1]
        return hit[0] + moved[0], hit[1] + moved[1]

    def _undistorted_mm(self, x, y, z, u, v):
        if self.index is not None:
            across = self.index * self.stop_mm / self.magnification
            cosine2 = np.maximum(1 - (u * u + v * v) / across**2, self.LEAST_COSINE2)
            spread = self.magnification * z / (across * np.sqrt(cosine2))
            return spread * u - self.magnification * x, spread * v - self.magnification * y
        if self.medium is None:
            beta = self.image_mm / (self.object_mm - z)
            alpha = 1 - self.image_mm / self.focal_mm + beta
            stop, array = self._lens_shares()
            away = 1 + (array - 1) * alpha  # 1 if the lens is its own exit pupil
            alpha, beta = stop * alpha / away, beta / away
            return alpha * u - beta * x, alpha * v - beta * y
        return self._behind_window(x, y, z, u, v)

    def _aberrations_mm(self, chief, z, u, v):
        """Shifts of rays on the array, whose chief rays meet it at `chief`."""
        spherical, secondary, coma, coma_growth, astigmatism, curvature = self.aberrations_mm
        coma = coma + coma_growth * z
        per_half, per_corner = 2 / self.aperture_mm, 2 / (self.pixel_mm * np.hypot(*self.sensor_px))
        u, v, x, y = per_half * u, per_half * v, per_corner * chief[0], per_corner * chief[1]
        square, along = u * u + v * v, u * x + v * y
        by_stop = (spherical + secondary * square) * square + 2 * coma * along + curvature * (x * x + y * y)
        by_field = coma * square + astigmatism * along
        return u * by_stop + x * by_field, v * by_stop + y * by_field

    def _lens_shares(self):
        """A ray that passes V and meets the array at y_m has passed the lens at stop V + (1 - array) y_m."""
        return self.image_mm / self.stop_mm, self.image_mm / self.stop_mm * self.pupil_ratio

    def _slope(self, x, y, z):
        """Slopes in the air before the lens of rays that move sideways by (x, y) from depth z to the lens."""
        if self.medium is None:
            return x / (self.object_mm - z), y / (self.object_mm - z)
        # Snell's law, by Newton's method from the paraxial slope.
        (thick, glass), index = self.window, self.medium_index
        air = self.object_mm - self.window_z_mm / index - thick / glass
        layers = (self.window_z_mm - z, index), (thick, glass)
        slope, square = 1 / (air + sum(depth / n for depth, n in layers)), x * x + y * y
        for _ in range(self.SNELL_STEPS):
            roots = [(depth, n, 1 / np.sqrt(n * n + (n * n - 1) * slope**2 * square)) for depth, n in layers]
            reach = air + sum(depth * root for depth, _, root in roots)
            growth = air + sum(depth * n * n * root**3 for depth, n, root in roots)
            slope = slope + (1 - slope * reach) / growth
        return slope * x, slope * y

    def _behind_window(self, x, y, z, u, v):
        stop, array = self._lens_shares()

        def array_from_lens(x, y, hx, hy):
            sx, sy = self._slope(hx - x, hy - y, z)
            lens = 1 - self.image_mm / self.focal_mm
            return lens * hx + self.image_mm * sx, lens * hy + self.image_mm * sy

        if stop == array == 1:
            return array_from_lens(x, y, u, v)
        near = 1e-3  # Near the axis the place on the array changes by alpha times that on the lens.
        alpha = array_from_lens(0.0, 0.0, near, 0.0)[0] / near
        fall, lens = 1 / (1 - (1 - array) * alpha), (u, v)
        for _ in range(self.PUPIL_STEPS):
            hit = array_from_lens(x, y, *lens)
            lens = [h + fall * (stop * w + (1 - array) * m - h) for h, w, m in zip(lens, (u, v), hit)]
        return array_from_lens(x, y, *lens)

    def _distortion_mm(self, x, y, z):
        k1, k2, k3, p1, p2 = self.distortion
        scale = -self.magnification / self.image_mm
        tx, ty = self._slope(-x, -y, z) if self.index is None else (scale * x, scale * y)
        square = tx * tx + ty * ty
        radial = square * (k1 + square * (k2 + square * k3))
        across = p1 * (square + 2 * ty * ty) + 2 * p2 * tx * ty
        along = 2 * p1 * tx * ty + p2 * (square + 2 * tx * tx)
        return self.image_mm * (tx * radial + along), self.image_mm * (ty * radial + across)

    def centre_mm(self, x, y):
        """Centres of the lenslets whose cells hold these places of the array, mm. If the lattice is in line with the
        pixels, x and y keep their shapes; otherwise they broadcast together."""
        if self.centres is None:
            return self._perfect_centre_mm(x, y)
        perfect = x, y
        for _ in range(self.LATTICE_STEPS):
            perfect = [place - off for place, off in zip((x, y), self._departure_mm(*perfect))]
        perfect = self._perfect_centre_mm(*perfect)
        return tuple(place + off for place, off in zip(perfect, self._departure_mm(*perfect)))

    def _departure_mm(self, x, y):
        """Departure of the lenslets from the perfect lattice: polynomials, the lowest degree first."""
        x, y = x / self.centres["radius_mm"], y / self.centres["radius_mm"]
        shrink = np.minimum(1, self.FARTHEST / np.maximum(np.hypot(x, y), 1e-300))
        x, y = x * shrink, y * shrink
        powers = [(degree - n, n) for degree in range(1, 6) for n in range(degree + 1)]
        terms = [x**a * y**b for a, b in powers[: len(self.centres["x_mm"])]]
        return [sum(c * term for c, term in zip(self.centres[key], terms)) for key in ("x_mm", "y_mm")]

    def _perfect_centre_mm(self, x, y):
        x, y = x - self.offset_mm[0], y - self.offset_mm[1]
        cos, sin = np.cos(self.rotation_rad), np.sin(self.rotation_rad)
        turned = sin != 0 or self.is_hexagonal
        x, y = (cos * x + sin * y, cos * y - sin * x) if turned else (x, y)
        if self.is_hexagonal:
            x, y = self._hexagon(x, y)
        else:
            x, y = (self.pitch_mm * (np.floor(q / self.pitch_mm) + 0.5) for q in (x, y))
        x, y = (cos * x - sin * y, cos * y + sin * x) if turned else (x, y)
        return x + self.offset_mm[0], y + self.offset_mm[1]

    def _hexagon(self, x, y):
        """The nearer of two centres, in the row of lenslets above and in the row below. Odd rows are shifted by half a
        pitch."""
        row_mm = self.pitch_mm * np.sqrt(0.75)
        found = []
        for row in (np.floor(y / row_mm), np.floor(y / row_mm) + 1):
            shift = 0.5 * (row % 2)
            cx, cy = self.pitch_mm * (np.round(x / self.pitch_mm - shift) + shift), row_mm * row
            found.append((np.hypot(x - cx, y - cy), cx, cy))
        (near, x0, y0), (far, x1, y1) = found
        return np.where(near <= far, x0, x1), np.where(near <= far, y0, y1)

    def place_px(self, x, y, z, u, v):
        """Where these rays meet the sensor, px. 0 is the left or top edge; a pixel's centre is at a half. Arguments are
        those of `array_mm`, and so are the shapes if the lattice is in line and the sensor without gap and tilt;
        otherwise both results have the shape of all arguments together."""
        hit = self.array_mm(x, y, z, u, v)
        return self.through_px(self.centre_mm(*hit), hit, u, v)

    def through_px(self, centre, hit, u, v):
        """Where rays through (u, v) that meet the array at `hit`, mm, meet the sensor behind the lenslet at `centre`,
        px: x_s = c + k (e x_m - U); with a gap or tilt, the ray bent by the lenslet runs on to the sensor."""
        steep = [self.pupil_ratio * m - w for m, w in zip(hit, (u, v))]
        if any(self.tilt) or self.gap_mm != self.lenslet_mm:
            slope = [q / self.stop_mm - (m - c) / self.lenslet_mm for c, m, q in zip(centre, hit, steep)]
            grown, leant = (sum(t * q for t, q in zip(self.tilt, pair)) for pair in (hit, slope))
            on_sensor = [m + (self.gap_mm + grown) / (1 - leant) * q for m, q in zip(hit, slope)]
        else:
            on_sensor = [c + self.demagnification * q for c, q in zip(centre, steep)]
        return tuple(s / self.pixel_mm + 0.5 * n for s, n in zip(on_sensor, self.sensor_px))


# Shared by all stages


def numbers(count: int) -> Callable[[str], list[float]]:
    """For argparse: parses `count` numbers, as in `1,1,10`."""

    def parse(text):
        found = [float(word) for word in text.split(",")]
        if len(found) != count:
            raise ValueError
        return found

    parse.__name__ = f"{count} numbers with commas between"
    return parse


class Parser(argparse.ArgumentParser):
    """Has the options that all tools share, and refuses in one line with exit code 2."""

    def __init__(self, description):
        super().__init__(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
        self.add_argument("-c", "--camera", required=True, metavar="FILE", help="camera.json")
        self.add_argument("-b", "--background", metavar="FILE", help="image to subtract first")
        self.add_argument("--mask", metavar="FILE", help="image that is 0 where pixels are not used")
        self.add_argument("--channel", choices=["r", "g", "b", "luma"], help="channel of colour images")
        self.add_argument("-o", "--output", default="-", metavar="FILE", help="file to write, - for standard output")
        self.add_argument("--threads", type=int, default=0, help="accepted and ignored: numpy has its own")
        self.add_argument("--stats", metavar="FILE", help="seconds, peak memory and counts as JSON")
        self.add_argument("-q", "--quiet", action="store_true", help="print errors only")

    def parse_args(self):
        """Parses as usual, but reads `-5,5` in `--depth -5,5` as a value, not as an option."""
        words = []
        for word in sys.argv[1:]:
            if words and words[-1].startswith("--") and word[:1] == "-" and word[1:2].isdigit():
                words[-1] += "=" + word
            else:
                words.append(word)
        return super().parse_args(words)

    def error(self, message):
        raise Refused(f"{message}; see --help")


class Session:
    """One run: its phases, its counts, and its step in the history."""

    def __init__(self, stats):
        self.tool, self.stats, self.began = os.path.basename(sys.argv[0]), stats, time.perf_counter()
        self.phases, self.counts = {}, {}

    @contextmanager
    def phase(self, name):
        """Times the enclosed work, under a name."""
        began = time.perf_counter()
        yield
        self.phases[name] = time.perf_counter() - began

    def history(self, before):
        """`before` and this run; empty with LF_HISTORY=off."""
        step = {"tool": self.tool, "version": "example", "arguments": sys.argv[1:]}
        return [] if os.environ.get("LF_HISTORY") == "off" else [*before, step]

    def save_stats(self):
        """Writes the stats if --stats asks for them."""
        if self.stats is None:
            return
        seconds = time.perf_counter() - self.began
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
        found = {
            "tool": self.tool,
            "seconds": seconds,
            "phases": self.phases,
            "peak_bytes": peak,
            "counts": self.counts,
        }
        save(self.stats, [(json.dumps(found, indent=2) + "\n").encode()])


def main(parser: Parser, work: Callable) -> None:
    """The main of a stage: parses, runs `work(options, session)`, reports. Exit codes are those of all tools."""
    try:
        options = parser.parse_args()
        session = Session(options.stats)
        work(options, session)
        session.save_stats()
    except Refused as refusal:
        print(f"{os.path.basename(sys.argv[0])}: {refusal}", file=sys.stderr)
        sys.exit(2)

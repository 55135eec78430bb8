"""Readers of hyperspectral pictures: ENVI, MATLAB and NumPy files."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from isetcl.errors import FileError, InvalidInputError, IsetclError, OutOfMemoryError
from isetcl.memory import check_memory
from isetcl.spectrum import check_wavelengths

Wavelengths = Sequence[float] | np.ndarray | None
Arrays = dict[str, np.ndarray]

# Source: ENVI header format, L3Harris Geospatial, "ENVI Header Files".
_ENVI_TYPES = {
    1: "u1", 2: "i2", 3: "i4", 4: "f4", 5: "f8", 12: "u2", 13: "u4", 14: "i8", 15: "u8",
}  # fmt: skip
_ENVI_ORDERS = {"bsq": (1, 2, 0), "bil": (0, 2, 1), "bip": (0, 1, 2)}
_ENVI_UNITS = {
    "": 1.0,
    "unknown": 1.0,
    "nanometers": 1.0,
    "nanometer": 1.0,
    "nm": 1.0,
    "micrometers": 1000.0,
    "micrometer": 1000.0,
    "microns": 1000.0,
    "um": 1000.0,
}


def read_cube(file: Path, wavelengths_nm: Wavelengths) -> tuple[np.ndarray, np.ndarray]:
    """Values (rows, columns, wavelengths), float32, and ascending wavelengths, nm."""
    readers: dict[str, Callable[[Path], Arrays]] = {
        ".npy": _read_npy,
        ".npz": _read_npz,
        ".mat": _read_mat,
    }
    try:
        if not file.is_file():
            raise FileError(f"cube file {str(file)!r} does not exist")
        if file.suffix.lower() in readers:
            arrays = readers[file.suffix.lower()](file)
            values, grid = _cube_of(file, arrays, wavelengths_nm)
        elif file.suffix.lower() == ".hdr" or _header_of(file) is not None:
            values, grid = _read_envi(file, wavelengths_nm)
        else:
            raise FileError(
                f"cube file {str(file)!r} is of no kind that is read here; use ENVI (.hdr), .mat, "
                ".npz or .npy"
            )
    except IsetclError:
        raise
    except MemoryError as error:
        raise OutOfMemoryError(
            f"cube file {str(file)!r} does not fit into memory; crop it first"
        ) from error
    except Exception as error:
        # Readers raise what they like; whatever it is, the file is no cube.
        raise FileError(
            f"cube file {str(file)!r} cannot be read ({type(error).__name__}: {str(error)[:200]})"
        ) from error
    order = np.argsort(grid, kind="stable")
    if np.any(np.diff(order) != 1):
        values, grid = values[..., order], grid[order]
    return np.asarray(values, dtype=np.float32), _checked(file, grid)


def _checked(file: Path, grid: np.ndarray) -> np.ndarray:
    try:
        return check_wavelengths(grid)
    except InvalidInputError as error:
        raise FileError(f"cube file {str(file)!r}: {error}") from error


def _check_size(file: Path, numbers: float, bytes_each: int) -> None:
    check_memory(
        f"cube file {str(file)!r}",
        numbers * (bytes_each + 8.0),
        lambda factor: f"crop each side to {factor:.2g} of it, or keep fewer wavelengths",
    )


def _cube_of(file: Path, arrays: Arrays, given: Wavelengths) -> tuple[np.ndarray, np.ndarray]:
    """The one array of three dimensions, and the one list as long as its last."""
    cubes = {name: a for name, a in arrays.items() if a.ndim == 3 and a.dtype.kind in "biuf"}
    if len(cubes) != 1:
        listed = ", ".join(f"{name} {a.shape}" for name, a in arrays.items()) or "nothing"
        raise FileError(
            f"cube file {str(file)!r} must hold one array (rows, columns, wavelengths), got "
            f"{listed[:300]}; save one cube"
        )
    ((name, cube),) = cubes.items()
    if given is not None:
        grid = np.asarray(_given(given))
    else:
        lists = {n: a.reshape(-1) for n, a in arrays.items() if n != name and _is_list(a)}
        fitting = {n: a for n, a in lists.items() if len(a) == cube.shape[2] > 0}
        if len(fitting) > 1:
            spoken = {n: a for n, a in fitting.items() if re.search(r"wav|lambda|nm", n, re.I)}
            fitting = spoken or fitting
        if len(fitting) != 1:
            raise FileError(
                f"cube file {str(file)!r} must state its {cube.shape[2]} wavelengths in a list, "
                f"got {len(fitting)} such list(s); pass wavelengths_nm="
            )
        grid = next(iter(fitting.values())).astype(np.float64)
    _check_layers(file, cube.shape[2], grid)
    return cube, grid


def _is_list(array: np.ndarray) -> bool:
    return array.dtype.kind in "iuf" and array.size == max(array.shape, default=0)


def _given(wavelengths_nm: Wavelengths) -> np.ndarray:
    return check_wavelengths(wavelengths_nm)  # type: ignore[arg-type]


def _check_layers(file: Path, layers: int, grid: np.ndarray) -> None:
    if len(grid) != layers:
        raise FileError(
            f"cube file {str(file)!r} has {layers} layers, but {len(grid)} wavelengths are "
            "stated; its shape must be (rows, columns, wavelengths)"
        )


def _read_npy(file: Path) -> Arrays:
    array = np.load(file, mmap_mode="r", allow_pickle=False)
    _check_size(file, array.size, array.dtype.itemsize)
    return {"array": np.array(array)}


def _read_npz(file: Path) -> Arrays:
    with zipfile.ZipFile(file) as archive:
        _check_size(file, float(sum(entry.file_size for entry in archive.infolist())), 1)
    with np.load(file, allow_pickle=False) as archive_of_arrays:
        return {name: archive_of_arrays[name] for name in archive_of_arrays.files}


def _read_mat(file: Path) -> Arrays:
    import scipy.io

    try:
        listed = scipy.io.whosmat(file)
    except NotImplementedError:
        return _read_mat_73(file)
    numeric = {"double", "single", "logical", "int8", "int16", "int32", "int64"}
    numeric |= {"uint8", "uint16", "uint32", "uint64"}
    names = [name for name, _, kind in listed if kind in numeric]
    sizes = {name: float(np.prod(shape)) for name, shape, _ in listed}
    _check_size(file, sum(sizes[name] for name in names), 8)
    found: dict[str, Any] = scipy.io.loadmat(file, variable_names=names)
    return {name: np.asarray(found[name]) for name in names}


def _read_mat_73(file: Path) -> Arrays:
    """MATLAB 7.3 files are HDF5, with the dimensions in opposite order."""
    import h5py  # type: ignore[import-untyped]

    with h5py.File(file, "r") as opened:
        sets = {k: v for k, v in opened.items() if isinstance(v, h5py.Dataset)}
        sets = {k: v for k, v in sets.items() if v.dtype.kind in "biuf"}
        _check_size(file, float(sum(v.size for v in sets.values())), 8)
        return {name: np.asarray(dataset).T for name, dataset in sets.items()}


def _header_of(file: Path) -> Path | None:
    """The ENVI header beside a data file."""
    for candidate in (file.with_suffix(".hdr"), file.with_name(file.name + ".hdr")):
        if candidate.is_file():
            return candidate
    return None


def _data_of(header: Path) -> Path:
    """The data file beside an ENVI header."""
    stem = header.with_suffix("")
    endings = ("", ".raw", ".img", ".dat", ".bin", ".bsq", ".bil", ".bip")
    for ending in endings:
        candidate = stem.with_name(stem.name + ending)
        if candidate.is_file():
            return candidate
    raise FileError(
        f"cube file {str(header)!r} has no data file beside it; put {stem.name!r}, "
        f"{stem.name + '.raw'!r} or {stem.name + '.img'!r} there"
    )


def _read_envi(file: Path, given: Wavelengths) -> tuple[np.ndarray, np.ndarray]:
    header = file if file.suffix.lower() == ".hdr" else _header_of(file)
    assert header is not None
    data = _data_of(header) if file.suffix.lower() == ".hdr" else file
    fields = _envi_fields(header)
    lines, samples, bands = (_whole(header, fields, key) for key in ("lines", "samples", "bands"))
    kind = _whole(header, fields, "data type")
    interleave = fields.get("interleave", "").lower()
    if kind not in _ENVI_TYPES or interleave not in _ENVI_ORDERS:
        raise FileError(
            f"cube file {str(header)!r} must have a data type of {sorted(_ENVI_TYPES)} and an "
            f"interleave of bsq, bil or bip, got {kind} and {interleave!r}; save it as float"
        )
    order = "<" if _whole(header, fields, "byte order", 0) == 0 else ">"
    dtype = np.dtype(order + _ENVI_TYPES[kind])
    offset = _whole(header, fields, "header offset", 0)
    needed = offset + lines * samples * bands * dtype.itemsize
    if data.stat().st_size < needed:
        raise FileError(
            f"cube file {str(data)!r} is truncated: {data.stat().st_size} of {needed} bytes; "
            "copy it again"
        )
    _check_size(file, float(lines * samples * bands), 8)
    shape = {
        "bsq": (bands, lines, samples),
        "bil": (lines, bands, samples),
        "bip": (lines, samples, bands),
    }[interleave]
    stored = np.fromfile(data, dtype, count=lines * samples * bands, offset=offset)
    values = stored.reshape(shape).transpose(_ENVI_ORDERS[interleave]).astype(np.float32)
    if "data ignore value" in fields:
        ignored = np.float32(_number(header, fields, "data ignore value"))
        values[values == ignored] = 0.0
    if "reflectance scale factor" in fields:
        values /= np.float32(_number(header, fields, "reflectance scale factor"))
    grid = _given(given) if given is not None else _envi_wavelengths(header, fields)
    _check_layers(file, bands, grid)
    return values, grid


def _envi_fields(header: Path) -> dict[str, str]:
    """Entries of an ENVI header, keys in lower case."""
    if header.stat().st_size > 1 << 24:
        raise FileError(f"cube file {str(header)!r} is too large to be an ENVI header")
    text = header.read_text(encoding="utf-8", errors="replace")
    if not text.lstrip("\ufeff \n").startswith("ENVI"):
        raise FileError(f"cube file {str(header)!r} is no ENVI header: its first word must be ENVI")
    found = re.findall(r"^[ \t]*([^=\n{}]+?)[ \t]*=[ \t]*(\{[^}]*\}|[^\n]*)", text, re.MULTILINE)
    return {key.strip().lower(): value.strip() for key, value in found}


def _number(header: Path, fields: dict[str, str], key: str) -> float:
    try:
        number = float(fields[key])
    except (KeyError, ValueError):
        raise FileError(
            f"cube file {str(header)!r} must state a number for {key!r}, got {fields.get(key)!r}"
        ) from None
    return number


def _whole(header: Path, fields: dict[str, str], key: str, default: int | None = None) -> int:
    if key not in fields and default is not None:
        return default
    number = _number(header, fields, key)
    lowest = 1 if default is None else 0
    if number != int(number) or number < lowest:
        raise FileError(
            f"cube file {str(header)!r}: {key!r} must be a whole number >= {lowest}, got {number:g}"
        )
    return int(number)


def _envi_wavelengths(header: Path, fields: dict[str, str]) -> np.ndarray:
    """Wavelengths in nm."""
    if "wavelength" not in fields:
        raise FileError(f"cube file {str(header)!r} states no wavelengths; pass wavelengths_nm=")
    unit = fields.get("wavelength units", "").lower()
    words = fields["wavelength"].strip("{} \n").replace("\n", " ").split(",")
    if unit not in _ENVI_UNITS:
        raise FileError(
            f"cube file {str(header)!r} states wavelengths in {unit!r}; use nanometers or "
            "micrometers, or pass wavelengths_nm="
        )
    try:
        return _ENVI_UNITS[unit] * np.array([float(word) for word in words if word.strip()])
    except ValueError:
        raise FileError(
            f"cube file {str(header)!r}: wavelengths must be numbers, got "
            f"{fields['wavelength'][:60]!r}"
        ) from None

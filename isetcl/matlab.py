"""MATLAB files as nested dictionaries: structures, arrays and text."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from isetcl.errors import FileError, InvalidInputError, OutOfMemoryError, check_type
from isetcl.output import replace_file

_MOST_BYTES = (1 << 31) - (1 << 20)


def write_mat(path: str | Path, variables: dict[str, Any]) -> Path:
    """Write variables as a MATLAB file (version 7, compressed); returns the path.

    Nested dictionaries become structures. A crash leaves no half-written file.

    Raises
    ------
    InvalidInputError
        If the file's name does not end in ``.mat``.
    FileError
        If the file cannot be written.
    OutOfMemoryError
        If a variable exceeds the 2 GiB that the format has room for.
    """
    import scipy.io

    check_type("path", path, (str, Path))
    if Path(path).suffix.lower() != ".mat":
        raise InvalidInputError(
            f"a MATLAB file must end in .mat, or MATLAB takes it for text; got {str(path)!r}"
        )
    for name, value in variables.items():
        size = _bytes_of(value)
        if size > _MOST_BYTES:
            raise OutOfMemoryError(
                f"variable {name!r} needs {size / 2**30:.3g} GiB, and MATLAB files of version 7 "
                "hold 2 GiB a variable; take fewer pixels or wavelengths"
            )

    def write(file: Path) -> None:
        # Opened here: scipy would hide why a file cannot be.
        with open(file, "wb") as opened:
            scipy.io.savemat(opened, variables, do_compression=True, long_field_names=True)

    return replace_file(path, write)


def read_mat(path: str | Path) -> dict[str, Any]:
    """Variables of a MATLAB file, versions 5 to 7.3: dictionaries, arrays and text.

    Arrays keep all their dimensions and their class in MATLAB. What is neither number, text nor
    structure is left out.

    Raises
    ------
    FileError
        If the file does not exist or is no MATLAB file.
    """
    import scipy.io

    check_type("path", path, (str, Path))
    file = Path(path)
    if file.is_dir():
        raise FileError(f"file {str(file)!r} is a folder; name the file in it")
    if not file.is_file():
        raise FileError(f"file {str(file)!r} does not exist")
    try:
        try:
            # MATLAB stores doubles without fractions as integers; their class says what they are.
            found = scipy.io.loadmat(file, struct_as_record=True, squeeze_me=False, mat_dtype=True)
        except NotImplementedError:
            return _read_hdf5(file)
        return {k: _plain(v) for k, v in found.items() if not k.startswith("__")}
    except MemoryError as error:
        raise OutOfMemoryError(f"MATLAB file {str(file)!r} does not fit into memory") from error
    except Exception as error:
        # The readers raise what they like; whatever it is, the file cannot be used.
        raise FileError(
            f"file {str(file)!r} cannot be read as a MATLAB file ({type(error).__name__}: "
            f"{str(error)[:200]}); save it in MATLAB, version 5 to 7.3"
        ) from error


def numbers(path: str | Path, record: dict[str, Any], *keys: str) -> np.ndarray:
    """The array at a path of fields; raise FileError where there is none."""
    value: Any = record
    for key in keys:
        value = value.get(key) if isinstance(value, dict) else None
    if not isinstance(value, np.ndarray) or value.size == 0 or value.dtype.kind not in "biuf":
        raise FileError(f"file {str(path)!r} must hold numbers in the field {'.'.join(keys)!r}")
    return value


def _bytes_of(value: Any) -> int:
    if isinstance(value, dict):
        return sum(_bytes_of(each) for each in value.values())
    return int(np.asarray(value).nbytes)


def _plain(value: np.ndarray) -> Any:
    """A structure as a dictionary, characters as text, numbers as they are."""
    if value.dtype.names is not None:
        if value.size != 1:
            return [_plain(np.reshape(each, (1, 1))) for each in value.ravel()]
        record = value.ravel()[0]
        return {name: _plain(np.asarray(record[name])) for name in value.dtype.names}
    if value.dtype.kind in "US":
        return "\n".join(str(line) for line in value.ravel())
    if value.dtype == object:
        # In place of a structure without fields scipy has None.
        return [_plain(each) for each in value.ravel() if isinstance(each, np.ndarray)]
    return value


def _read_hdf5(file: Path) -> dict[str, Any]:
    """MATLAB 7.3 files are HDF5, with the dimensions in opposite order."""
    import h5py  # type: ignore[import-untyped]

    with h5py.File(file, "r") as opened:
        return {k: _plain_hdf5(v) for k, v in opened.items() if not k.startswith("#")}


def _plain_hdf5(value: Any) -> Any:
    import h5py

    if isinstance(value, h5py.Group):
        return {name: _plain_hdf5(each) for name, each in value.items()}
    kind = value.attrs.get("MATLAB_class", b"")
    if value.attrs.get("MATLAB_empty", 0):
        return "" if kind == b"char" else np.zeros((0, 0))
    array = np.asarray(value).T
    if kind == b"char":
        return "".join(chr(code) for code in array.ravel())
    return array if array.dtype.kind in "biuf" else None

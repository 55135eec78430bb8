"""Datasets in NetCDF-4 files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from isetcl.errors import FileError, InvalidInputError, check_type
from isetcl.output import replace_file

if TYPE_CHECKING:
    import xarray

T = TypeVar("T")


def save_dataset(dataset: xarray.Dataset, path: str | Path) -> Path:
    """Write a dataset as compressed NetCDF-4, as `replace_file` does; returns its path."""
    packed = {"zlib": True, "complevel": 1, "shuffle": True}
    numbers = [name for name, data in dataset.data_vars.items() if data.dtype.kind in "fiu"]

    def write(file: Path) -> None:
        dataset.to_netcdf(file, engine="h5netcdf", encoding=dict.fromkeys(numbers, packed))

    return replace_file(path, write)


def load_dataset(path: str | Path, what: str, make: Callable[[xarray.Dataset], T]) -> T:
    """What a dataset in a NetCDF-4 file stands for.

    Parameters
    ----------
    path
        The file.
    what
        What it should hold, for messages.
    make
        Makes it from the dataset, whose data are in memory; raises ValueError, KeyError or
        InvalidInputError for a dataset of another kind.

    Raises
    ------
    FileError
        If the file does not exist, cannot be read or holds something else.
    """
    import xarray

    check_type("path", path, (str, Path))
    file = Path(path)
    if file.is_dir():
        raise FileError(f"file {str(file)!r} is a folder; name the file in it")
    if not file.is_file():
        raise FileError(f"file {str(file)!r} does not exist")
    try:
        with xarray.open_dataset(file, engine="h5netcdf") as dataset:
            return make(dataset.load())
    except (OSError, ValueError, KeyError, InvalidInputError) as error:
        raise FileError(f"file {str(file)!r} holds no {what} of isetcl: {error}") from error

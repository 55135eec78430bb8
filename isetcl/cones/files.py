"""Mosaics as files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from isetcl.cones.mosaic import PER_RECEPTOR, ConeMosaic
from isetcl.errors import FileError, check_type
from isetcl.output import save_dataset

FORMAT_VERSION = 1
_UNITS = {"positions_deg": "deg", "positions_mm": "mm", "eccentricity_deg": "deg", "types": "1"}


def save_mosaic(mosaic: ConeMosaic, path: str | Path) -> Path:
    """Write a mosaic as NetCDF-4; a crash leaves no half-written file.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    import xarray

    variables = {}
    for name, array in mosaic.arrays().items():
        dims = ("receptor", "axis") if array.ndim == 2 else ("receptor",)
        variables[name] = (dims, array, {"units": _UNITS.get(name, "um")})
    dataset = xarray.Dataset(variables, coords={"axis": ["x", "y"]})
    dataset.attrs = {
        "isetcl_mosaic": FORMAT_VERSION,
        "eye": mosaic.eye,
        "aperture_shape": mosaic.aperture_shape,
        "provenance": mosaic.describe(),
    }
    return save_dataset(dataset, path)


def load_mosaic(path: str | Path) -> ConeMosaic:
    """Read a mosaic that `save_mosaic` wrote.

    Raises
    ------
    FileError
        If the file does not exist or holds no mosaic.
    """
    import xarray

    check_type("path", path, (str, Path))
    file = Path(path)
    if not file.is_file():
        raise FileError(f"file {str(file)!r} does not exist")
    try:
        with xarray.open_dataset(file, engine="h5netcdf") as dataset:
            if "isetcl_mosaic" not in dataset.attrs:
                raise ValueError("it lacks the attribute 'isetcl_mosaic'")
            arrays = {name: np.asarray(dataset[name].values) for name in PER_RECEPTOR}
            attributes = dict(dataset.attrs)
        return ConeMosaic(
            **arrays,
            eye=attributes["eye"],
            aperture_shape=attributes["aperture_shape"],
            provenance=json.loads(attributes["provenance"]),
        )
    except (OSError, ValueError, KeyError) as error:
        raise FileError(f"file {str(file)!r} holds no mosaic of isetcl: {error}") from error

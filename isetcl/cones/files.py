"""Mosaics as files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from isetcl.cones.mosaic import PER_RECEPTOR, ConeMosaic
from isetcl.netcdf import load_dataset, save_dataset

if TYPE_CHECKING:
    import xarray

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
    return load_dataset(path, "mosaic", _mosaic_of)


def _mosaic_of(dataset: xarray.Dataset) -> ConeMosaic:
    if "isetcl_mosaic" not in dataset.attrs:
        raise ValueError("it lacks the attribute 'isetcl_mosaic'")
    return ConeMosaic(
        **{name: np.asarray(dataset[name].values) for name in PER_RECEPTOR},
        eye=dataset.attrs["eye"],
        aperture_shape=dataset.attrs["aperture_shape"],
        provenance=json.loads(dataset.attrs["provenance"]),
    )

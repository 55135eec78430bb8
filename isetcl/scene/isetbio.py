"""Scenes of ISETBio and ISETCam: a flat spectral picture facing the eye."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from isetcl.errors import FileError
from isetcl.matlab import numbers, read_mat
from isetcl.photons import (
    checked_cube,
    photon_cube,
    photon_wavelengths,
    photons_per_joule,
)
from isetcl.scene.cube import SpectralCube
from isetcl.scene.model import Scene, SceneObject
from isetcl.scene.targets.planes import facing_quad

_MOST_ERROR = 1e-3
"""Error of the picture's spectra as few channels, of their root mean square."""

_SIMPLE = (("fov",), ("dist",))
_WHOLE = (("wAngular",), ("distance",))
_MEANING = {
    "fov": "the width of the field of view in degrees",
    "dist": "the distance of the scene in metres",
}
_MEANING |= {"wAngular": _MEANING["fov"], "distance": _MEANING["dist"]}


def read_isetbio_scene(path: str | Path) -> Scene:
    """The scene of a file of ISETBio or ISETCam, whose middle lies on the axis of the eye.

    Either the simple file of ``sceneToFile`` (photons, wave, fov, dist), or that with the photons
    as a sum of basis functions (mcCOEF, basis and, if there is one, their mean imgMean), or a
    variable ``scene``. Photons s^-1 m^-2 sr^-1 nm^-1, row 1 at the top; the field of view is
    horizontal, in degrees, from the corneal vertex; pixels are square. Depth maps and illuminants
    are left out: the picture sends out its light by itself.

    Raises
    ------
    FileError
        If the file holds no such scene, or its wavelengths do not lie in equal steps.
    """
    found = read_mat(path)
    is_whole = isinstance(found.get("scene"), dict)
    record: dict[str, Any] = found["scene"] if is_whole else found
    if is_whole:
        grid = photon_wavelengths(path, record, "spectrum", "wave")
        photons = photon_cube(path, record, ("data", "photons"), len(grid))
    elif "mcCOEF" in found:
        grid, photons = _sum_of_functions(path, found)
    else:
        grid, photons = _simple(path, found)
    fov_at, distance_at = _WHOLE if is_whole else _SIMPLE
    fov = _number(path, record, fov_at, 180.0)
    distance = _number(path, record, distance_at, math.inf)
    texts = [record.get(each) for each in ("name", "comment")]
    names = [each.strip() for each in texts if isinstance(each, str) and each.strip()]
    name = names[0] if names else Path(path).stem
    radiance = SpectralCube((photons / photons_per_joule(grid)).astype(np.float32), grid, name)
    width = 2.0 * distance * math.tan(math.radians(fov) / 2.0)
    quad = facing_quad(distance, width, width * photons.shape[0] / photons.shape[1])
    return Scene((SceneObject("picture", quad, radiance.emission(_MOST_ERROR)),), None, name)


def _simple(path: str | Path, found: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths and photons, under either of the names that ISETCam reads."""
    photons_at = next((name for name in ("photons", "data") if name in found), None)
    if photons_at is None:
        remedy = "; read optical images with RetinalImage.from_isetbio"
        raise FileError(
            f"file {str(path)!r} must hold photons, wave, fov and dist, or a variable 'scene', got "
            f"{', '.join(sorted(found)) or 'nothing'}{remedy if 'opticalimage' in found else ''}"
        )
    wave_at = "wavelength" if "wavelength" in found and "wave" not in found else "wave"
    grid = photon_wavelengths(path, found, wave_at)
    return grid, photon_cube(path, found, (photons_at,), len(grid))


def _sum_of_functions(path: str | Path, found: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths, and photons as a sum of basis functions; as in ISETCam none is negative.

    Source: vcReadImage of ISETCam: photons = mcCOEF basis' + imgMean, where there is a mean.
    """
    grid = photon_wavelengths(path, found, "basis", "wave")
    functions = numbers(path, found, "basis", "basis").astype(np.float64)
    weights = numbers(path, found, "mcCOEF")
    weights = weights[..., None] if weights.ndim == 2 else weights
    if weights.ndim != 3 or functions.shape != (len(grid), weights.shape[2]):
        raise FileError(
            f"file {str(path)!r}: basis.basis must have shape ({len(grid)} wavelengths, functions) "
            f"and mcCOEF (rows, columns, functions), got {functions.shape} and {weights.shape}"
        )
    photons = weights @ functions.T
    if "imgMean" in found:
        mean = numbers(path, found, "imgMean").ravel()
        if len(mean) != len(grid):
            raise FileError(
                f"file {str(path)!r}: imgMean must have {len(grid)} numbers, got {len(mean)}"
            )
        photons += mean
    return grid, checked_cube(path, np.maximum(photons, 0.0), len(grid))


def _number(path: str | Path, record: dict[str, Any], keys: tuple[str, ...], most: float) -> float:
    name = ".".join(keys)
    try:
        value = numbers(path, record, *keys).ravel()
    except FileError as error:
        raise FileError(
            f"{error}, {_MEANING[name]}; in MATLAB, add it and save the file again"
        ) from error
    if value.size != 1 or not 0 < float(value[0]) < most:
        rule = "a number > 0" if math.isinf(most) else f"between 0 and {most:g}"
        raise FileError(f"file {str(path)!r}: {name} must be {rule}, got {value}")
    return float(value[0])

"""Scenes of ISETBio and ISETCam: a flat spectral picture facing the eye."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from isetcl.errors import FileError
from isetcl.matlab import numbers, read_mat
from isetcl.photons import photon_cube, photon_wavelengths, photons_per_joule
from isetcl.scene.cube import SpectralCube
from isetcl.scene.model import Scene, SceneObject
from isetcl.scene.targets.planes import facing_quad

_MOST_ERROR = 1e-3
"""Error of the picture's spectra as few channels, of their root mean square."""

_SIMPLE = (("photons",), ("wave",), ("fov",), ("dist",))
_WHOLE = (("data", "photons"), ("spectrum", "wave"), ("wAngular",), ("distance",))


def read_isetbio_scene(path: str | Path) -> Scene:
    """The scene of a file of ISETBio or ISETCam, whose middle lies on the axis of the eye.

    Either the simple file of ``sceneToFile`` (photons, wave, fov, dist), or a variable ``scene``.
    Photons s^-1 m^-2 sr^-1 nm^-1, row 1 at the top; the field of view is horizontal, in degrees,
    from the corneal vertex; pixels are square. Depth maps and illuminants are left out: the picture
    sends out its light by itself.

    Raises
    ------
    FileError
        If the file holds no such scene, or its wavelengths do not lie in equal steps.
    """
    found = read_mat(path)
    is_whole = isinstance(found.get("scene"), dict)
    record: dict[str, Any] = found["scene"] if is_whole else found
    if not is_whole and "photons" not in found:
        raise FileError(
            f"file {str(path)!r} must hold photons, wave, fov and dist, or a variable 'scene', got "
            f"{', '.join(sorted(found)) or 'nothing'}{_remedy(found)}"
        )
    photons_at, wave_at, fov_at, distance_at = _WHOLE if is_whole else _SIMPLE
    grid = photon_wavelengths(path, record, *wave_at)
    photons = photon_cube(path, numbers(path, record, *photons_at), len(grid))
    fov = _number(path, record, fov_at, 180.0)
    distance = _number(path, record, distance_at, math.inf)
    comment = record.get("name" if is_whole else "comment")
    name = comment.strip() if isinstance(comment, str) and comment.strip() else Path(path).stem
    radiance = SpectralCube((photons / photons_per_joule(grid)).astype(np.float32), grid, name)
    width = 2.0 * distance * math.tan(math.radians(fov) / 2.0)
    quad = facing_quad(distance, width, width * photons.shape[0] / photons.shape[1])
    return Scene((SceneObject("picture", quad, radiance.emission(_MOST_ERROR)),), None, name)


def _remedy(found: dict[str, Any]) -> str:
    if "opticalimage" in found:
        return "; read optical images with RetinalImage.from_isetbio"
    if "mcCOEF" in found:
        return "; in MATLAB, save it without compression into basis functions"
    return ""


def _number(path: str | Path, record: dict[str, Any], keys: tuple[str, ...], most: float) -> float:
    value = numbers(path, record, *keys).ravel()
    if value.size != 1 or not 0 < float(value[0]) < most:
        rule = "a number > 0" if math.isinf(most) else f"between 0 and {most:g}"
        raise FileError(f"file {str(path)!r}: {'.'.join(keys)} must be {rule}, got {value}")
    return float(value[0])

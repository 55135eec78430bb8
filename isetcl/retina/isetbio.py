"""Retinal images as files of ISETBio and ISETCam, and back.

Their optical image is flat: square pixels of one size on a plane behind a lens. isetcl's pixels are
equal steps of visual angle. Width in degrees and pixels are kept in both directions. A written file
also keeps the size of a pixel in the middle; elsewhere the two differ by the tangent, 0.3 % at 5
degrees from the middle. A file that is read keeps its photons by area and its angles: the size of a
pixel in millimetres becomes that of the eye it is put into, whatever the focal length in the file.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from isetcl.errors import FileError, InvalidInputError, check_type
from isetcl.eye.model import Eye
from isetcl.matlab import numbers, read_mat, write_mat
from isetcl.photons import check_even, photon_cube, photon_wavelengths, photons_per_joule
from isetcl.retina.grid import Centre, RetinalGrid
from isetcl.retina.image import RetinalImage
from isetcl.spectrum import photopic_weights
from isetcl.units import MM_PER_M

VARIABLE = "opticalimage"
"""Name that the variable must have in a file."""

_OBLONG = 1e-6


def to_isetbio(image: RetinalImage, path: str | Path) -> Path:
    """Write a retinal image as an optical image of ISETBio; returns the path.

    Photons s^-1 m^-2 nm^-1, row 1 at the top. The optics are those of the finished image: model
    ``'skip'``, so it must not be put through ``oiCompute`` again. A depth map is left out, because
    ISETBio would take its middle for the distance of the image plane.

    ISETBio's ``cMosaic.compute`` puts the middle of an image on the middle of the mosaic. Where the
    two differ, pass ``'opticalImagePositionDegs', opticalimage.metadata.centreDeg``.

    Raises
    ------
    InvalidInputError
        If the wavelengths do not lie in equal steps, or the pixels are not square.
    FileError
        If the file cannot be written.
    """
    check_type("path", path, (str, Path))
    grid = check_image(image)
    values = image.irradiance.values
    columns, pitch_deg, pitch_m = square_pixels(image)
    fov_deg = columns * pitch_deg
    focal_m = pitch_m * columns / (2.0 * math.tan(math.radians(fov_deg) / 2.0))
    photons = np.moveaxis(values, 0, -1) * photons_per_joule(grid).astype(values.dtype)
    lux = np.zeros((0, 0))
    if np.any(photopic_weights(grid) > 0):
        lux = image.illuminance_lux.values.astype(np.float64)
    name = Path(path).stem
    record = {
        "type": VARIABLE,
        "name": name,
        "metadata": {
            "program": "isetcl",
            "centreDeg": np.array([_middle(image)]),
            "provenance": json.dumps(image.provenance),
        },
        "data": {
            "photons": photons,
            "illuminance": lux,
            "bitDepth": 8.0 * values.dtype.itemsize,
        },
        "spectrum": {"wave": grid[:, None]},
        "wAngular": fov_deg,
        "diffuser": {"method": "skip"},
        "optics": {
            "type": "optics",
            "name": name,
            "model": "skip",
            "fNumber": MM_PER_M * focal_m / image.entrance_pupil_diameter_mm,
            "focalLength": focal_m,
            "offaxis": "skip",
            "OTF": np.zeros((0, 0)),
            "transmittance": {"wave": grid[:, None], "scale": np.ones((len(grid), 1))},
        },
    }
    return write_mat(path, {VARIABLE: record})


def from_isetbio(path: str | Path, eye: Eye, *, centre_deg: Centre | None = None) -> RetinalImage:
    """The optical image of a file of ISETBio or ISETCam, on the retina of an eye.

    Parameters
    ----------
    path
        A MATLAB file with a variable ``opticalimage``, version 5 to 7.3.
    eye
        Whose retina it lies on; the file knows none.
    centre_deg
        Where its middle lies, degrees right and up from the optical axis, or ``"fovea"``; None is
        where the file of isetcl says, and the axis for files of others.

    Raises
    ------
    FileError
        If the file holds no optical image, or one without photons, wavelengths or field of view.
    InvalidInputError
        If the field of view exceeds that of the eye.
    """
    check_type("eye", eye, Eye)
    found = read_mat(path)
    record = found.get(VARIABLE)
    if not isinstance(record, dict):
        remedy = "; read it with load_scene" if {"scene", "photons"} & set(found) else ""
        raise FileError(
            f"file {str(path)!r} must hold a variable {VARIABLE!r}, got "
            f"{', '.join(sorted(found)) or 'none'}{remedy}"
        )
    grid = photon_wavelengths(path, record, "spectrum", "wave")
    photons = photon_cube(path, record, ("data", "photons"), len(grid))
    fov = numbers(path, record, "wAngular").ravel()
    if fov.size != 1 or not 0 < fov[0] < 180:
        raise FileError(f"file {str(path)!r}: wAngular must be between 0 and 180 deg, got {fov}")
    rows, columns = photons.shape[:2]
    field = (float(fov[0]), float(fov[0]) * rows / columns)
    centre = _centre(path, record) if centre_deg is None else centre_deg
    dtype = np.float32 if photons.dtype == np.float32 else np.float64
    irradiance = (photons / photons_per_joule(grid)).astype(dtype)
    details: dict[str, Any] = {"method": "file", "file": Path(path).name}
    return RetinalImage.from_arrays(
        RetinalGrid.of(eye, field, (columns, rows), centre),
        grid,
        np.ascontiguousarray(np.moveaxis(irradiance, -1, 0)),
        provenance=details,
    )


def _middle(image: RetinalImage) -> tuple[float, float]:
    """Field angles of the middle, degrees."""
    x, y = (image.dataset[name].values.astype(np.float64) for name in ("x", "y"))
    return 0.5 * float(x[0] + x[-1]), 0.5 * float(y[0] + y[-1])


def _centre(path: str | Path, record: dict[str, Any]) -> tuple[float, float]:
    """The middle that `to_isetbio` noted, or the axis."""
    noted = record.get("metadata")
    if not isinstance(noted, dict) or "centreDeg" not in noted:
        return 0.0, 0.0
    found = numbers(path, noted, "centreDeg").ravel()
    if found.size != 2:
        raise FileError(
            f"file {str(path)!r}: metadata.centreDeg must hold two numbers, got {found.size}"
        )
    return float(found[0]), float(found[1])


def check_image(image: RetinalImage) -> np.ndarray:
    """The wavelengths of an image; raise InvalidInputError if ISETBio cannot have it."""
    check_type("image", image, RetinalImage)
    square_pixels(image)
    return check_even("the image", image.wavelengths_nm)


def square_pixels(image: RetinalImage) -> tuple[int, float, float]:
    """Columns, and the pitch of the middle in degrees and in metres.

    Raises
    ------
    InvalidInputError
        If the pixels are not square.
    """
    rows, columns = image.irradiance.shape[1:]
    steps = []
    for name, count in (("x", columns), ("y", rows)):
        at = image.dataset[name].values.astype(np.float64)
        if count > 1:
            steps.append(abs(at[-1] - at[0]) / (count - 1))
    if not steps or max(steps) - min(steps) > _OBLONG * max(steps):
        raise InvalidInputError(
            "an optical image of ISETBio must have square pixels and at least two of them, got "
            f"{columns} x {rows} pixels with steps of {' and '.join(f'{s:.6g}' for s in steps)} deg"
        )
    mm = [image.dataset[name].values.astype(np.float64) for name in ("x_mm", "y_mm")]
    axis = 1 if columns > 1 else 0
    pitch_mm = np.hypot(*(np.gradient(each, axis=axis) for each in mm))
    return columns, steps[0], float(pitch_mm[rows // 2, columns // 2]) / MM_PER_M

"""Readers of depth maps and of photographs that have one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from isetcl.errors import FileError, InvalidInputError, check_choice, check_positive, check_type
from isetcl.psf_baseline.camera import Projection
from isetcl.psf_baseline.depth_image import DepthImage, DepthKind, DepthUnit
from isetcl.scene.display import Display
from isetcl.scene.pbrt.pictures import FLOAT_SUFFIXES, read_floats
from isetcl.scene.texture import Image, load_image


def load_depth(path: str | Path, scale: float | None = None) -> np.ndarray:
    """A depth map from a file, (rows, columns), row 0 at the top.

    Parameters
    ----------
    path
        NPY, EXR (by scan lines), PFM, TIFF or PNG, of one channel or of equal ones.
    scale
        Metres or dioptres of a stored 1. Needed for files of whole numbers, whose unit nothing
        tells (0.001 for millimetres); None takes floats as they are.

    Raises
    ------
    FileError
        If there is no such file or it holds no map.
    InvalidInputError
        If a scale is needed.
    """
    check_type("path", path, (str, Path))
    file = Path(path)
    if not file.is_file():
        raise FileError(f"depth file {str(file)!r} does not exist")
    try:
        raw = _stored(file)
    except FileError:
        raise
    except Exception as error:
        # Readers raise what they like; whatever it is, the file is no depth map.
        raise FileError(
            f"depth file {str(file)!r} cannot be read ({str(error)[:200]}); use NPY, EXR, PFM, "
            "TIFF or PNG"
        ) from error
    if raw.ndim == 3 and raw.shape[2] in (1, 3) and np.all(raw == raw[..., :1]):
        raw = raw[..., 0]
    if raw.ndim != 2 or raw.size == 0 or raw.dtype.kind not in "uif":
        raise FileError(
            f"depth file {str(file)!r} must hold one number a pixel, got {raw.dtype} of shape "
            f"{raw.shape}; a map in false colours is not one"
        )
    if scale is not None:
        return raw.astype(np.float64) * check_positive("scale", scale)
    if raw.dtype.kind != "f":
        raise InvalidInputError(
            f"depth file {str(file)!r} holds whole numbers up to {raw.max()}, whose unit nothing "
            "tells; pass scale, for instance 0.001 for millimetres"
        )
    return raw.astype(np.float64)


def load_depth_image(
    picture: str | Path,
    depth: str | Path,
    fov_deg: float | tuple[float, float],
    *,
    depth_unit: DepthUnit = "m",
    depth_scale: float | None = None,
    depth_kind: DepthKind = "z",
    projection: Projection = "perspective",
    display: Display | None = None,
    **options: Any,
) -> DepthImage:
    """A photograph and its depth map from files.

    Parameters
    ----------
    picture
        What `load_image` reads, decoded by the display where that is not sRGB; EXR, PFM, HDR or NPY
        are linear light, NPY of an unsigned type codes.
    depth, depth_scale
        As `path` and `scale` of `load_depth`.
    fov_deg, depth_unit, depth_kind, projection, display
        As of a `DepthImage`.
    options
        `alpha`, `hidden`, `centre_deg`, `name` of a `DepthImage`.

    Raises
    ------
    FileError
        If a file cannot be read.
    InvalidInputError
        If they do not make a depth image.
    """
    for name in options:
        check_choice("option", name, ("alpha", "hidden", "centre_deg", "name"))
    check_type("picture", picture, (str, Path))
    file = Path(picture)
    options.setdefault("name", file.name)
    light = read_light(file, display)
    return DepthImage(
        light,
        load_depth(depth, depth_scale),
        fov_deg,
        depth_unit=depth_unit,
        depth_kind=depth_kind,
        projection=projection,
        display=display,
        **options,
    )


def read_light(file: Path, display: Display | None) -> Image | np.ndarray:
    """A photograph as a `DepthImage` takes it.

    Raises
    ------
    FileError
        If it cannot be read.
    """
    if not file.is_file():
        raise FileError(f"image file {str(file)!r} does not exist")
    suffix = file.suffix.lower()
    if suffix == ".npy" or suffix in FLOAT_SUFFIXES:
        try:
            return _stored(file)
        except (ValueError, OSError) as error:
            raise FileError(f"image file {str(file)!r} cannot be read ({error})") from error
    image = load_image(file)
    if display is None or isinstance(display.gamma, str):
        return image
    # Back to the codes that the display decodes in its own way (IEC 61966-2-1).
    light = image.texels.astype(np.float64)
    code = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return Image(display.decoded(np.clip(code, 0.0, 1.0)), image.name)


def _stored(file: Path) -> np.ndarray:
    """The numbers in a file."""
    suffix = file.suffix.lower()
    if suffix == ".npy":
        return np.asarray(np.load(file, allow_pickle=False))
    if suffix in FLOAT_SUFFIXES:
        return read_floats(file)
    from skimage.io import imread

    return np.asarray(imread(file))

"""Frequencies across an edge: from cycles per pixel to cycles/degree and cycles/mm."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, IsetclError, check_positive
from isetcl.eye.field_plane import visual_angle_steps
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.eye.visual_angle import retinal_scale
from isetcl.retina.image import RetinalImage

_SQUARE = 1e-3


@dataclass(frozen=True)
class PixelScale:
    """The pixels of an image.

    Attributes
    ----------
    pitch_deg, pitch_mm
        Side of a pixel in degrees of field angle and in mm on the retina; None if not known.
    left_top
        Field angles (x, y) of the first pixel's centre, degrees; (0, 0) for plain arrays.
    eye
        The eye of the image, for its chief-ray map; None for plain arrays.
    wavelength_nm
        Reference wavelength of that map.
    """

    pitch_deg: float | None
    pitch_mm: float | None
    left_top: tuple[float, float] = (0.0, 0.0)
    eye: Eye | None = None
    wavelength_nm: float = REFERENCE_WAVELENGTH_NM

    def __post_init__(self) -> None:
        if self.pitch_deg is None and self.pitch_mm is None:
            raise InvalidInputError(
                "a plain array needs the side of its pixels, pitch_deg or pitch_mm, got neither"
            )
        for name, value in (("pitch_deg", self.pitch_deg), ("pitch_mm", self.pitch_mm)):
            if value is not None:
                check_positive(name, value)

    def place(self, row: float, column: float) -> tuple[float, float]:
        """Where a point of the image lies: field angles (x, y) in degrees, or mm right and down."""
        pitch = self.pitch_deg if self.pitch_deg is not None else self.pitch_mm
        assert pitch is not None
        return self.left_top[0] + column * pitch, self.left_top[1] - row * pitch

    def cycles(
        self, normal: np.ndarray, field_deg: tuple[float, float]
    ) -> tuple[float | None, float | None]:
        """Cycles/degree and cycles/mm of one cycle per pixel along a unit vector (right, up).

        About a field angle: a wave keeps its phase at every point, so that its wave vector follows
        the inverse of the map of small steps.
        """
        if self.eye is None or self.pitch_deg is None:
            per_deg = None if self.pitch_deg is None else 1.0 / self.pitch_deg
            return per_deg, None if self.pitch_mm is None else 1.0 / self.pitch_mm
        seen = visual_angle_steps(field_deg) @ normal / self.pitch_deg
        scale = retinal_scale(self.eye.retina, self.eye.field_map(self.wavelength_nm), field_deg)
        squared = float(seen @ np.linalg.solve(scale @ scale.T, seen))
        return float(np.linalg.norm(seen)), math.sqrt(squared)


def scale_of_image(image: RetinalImage, eye: Eye | None) -> PixelScale:
    """The pixels of a retinal image.

    Raises
    ------
    InvalidInputError
        If they are not square.
    """
    x, y = (np.asarray(image.dataset[name].values, dtype=np.float64) for name in ("x", "y"))
    if len(x) < 2 or len(y) < 2:
        raise InvalidInputError(
            f"the image must have several rows and columns, got {len(x)} x {len(y)} pixels"
        )
    width, height = (x[-1] - x[0]) / (len(x) - 1), (y[0] - y[-1]) / (len(y) - 1)
    if not abs(width - height) <= _SQUARE * abs(width):
        raise InvalidInputError(
            f"pixels must be square, got {width:.6g} x {height:.6g} degrees; render with fov_deg "
            "in the proportion of resolution"
        )
    known = eye if eye is not None else _eye_of(image)
    nm = float(image.provenance.get("grid", {}).get("wavelength_nm", REFERENCE_WAVELENGTH_NM))
    return PixelScale(float(width), None, (float(x[0]), float(y[0])), known, nm)


def _eye_of(image: RetinalImage) -> Eye | None:
    """The eye that an image was made with, out of its provenance; None if it cannot be read."""
    from isetcl.eye.files.values import from_values

    values = image.provenance.get("eye")
    if not isinstance(values, dict):
        return None
    try:
        eye = from_values(values | {"accommodation_model": None}, "eye of the image")
    except IsetclError:
        return None
    return eye if isinstance(eye, Eye) else None

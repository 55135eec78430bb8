"""Degrees of visual field and millimetres of retina: the chart in which cones lie.

Both are polar about the fovea: a direction at eccentricity theta is received at arc length r(theta)
from the fovea, in the opposite direction, as the image is inverted. Lengths are measured in this
flat chart, as in the whole mounts that densities were counted in.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, check_number, check_positive
from isetcl.eye.model import Eye

# Watson 2014, eq. A5, after Drasdo & Fowler 1974: mm of retina from degrees of visual angle.
_WATSON_MM = (0.0, 0.268, 0.0003427, -8.3309e-6)
# Watson 2014, eq. A7: mm^2 of retina per square degree.
_WATSON_MM2 = (0.0752, 5.846e-5, -1.064e-5, 4.116e-8)
_WATSON_LIMIT_DEG = 90.0
_NODES = 4096


@dataclass(frozen=True, eq=False)
class RetinalScale:
    """Arc length from the fovea against eccentricity.

    Parameters
    ----------
    name
        What it is, for provenance.
    limit_deg
        The largest eccentricity it holds for.
    arc_mm
        Arc length, mm, of eccentricities in degrees; grows throughout.
    """

    name: str
    limit_deg: float
    arc_mm: Callable[[np.ndarray], np.ndarray]

    @classmethod
    def of(cls, scale: str | float | Eye) -> RetinalScale:
        """``"watson2014"`` (its eq. A5), a number of mm per degree, or an eye's own chief rays.

        Watson's eq. A6 from mm to degrees is not the inverse of A5, by up to 4 %; the way back is
        here always that of the way forth.

        Raises
        ------
        InvalidInputError
            If it is none of these, or the eye has no axis of symmetry.
        """
        if isinstance(scale, Eye):
            return cls._of_eye(scale)
        if isinstance(scale, str):
            if scale != "watson2014":
                raise InvalidInputError(
                    f"scale must be 'watson2014', mm per degree or an Eye, got {scale!r}"
                )
            return cls(scale, _WATSON_LIMIT_DEG, lambda deg: _polynomial(_WATSON_MM, deg))
        per_deg = check_positive("scale", check_number("scale", scale), "mm/deg")
        return cls(f"{per_deg:g} mm/deg", 180.0, lambda deg: per_deg * deg)

    @classmethod
    def _of_eye(cls, eye: Eye) -> RetinalScale:
        if not eye.is_rotational:
            raise InvalidInputError(
                f"scale must be an eye with an axis of symmetry, and {eye.name!r} has none "
                f"({', '.join(eye.asymmetries())}); pass 'watson2014' or mm per degree"
            )
        chief = eye.field_map()
        return cls(f"chief rays of {eye.name}", float(chief.max_field_deg), chief.arc_mm)  # type: ignore[union-attr]

    def check(self, what: str, eccentricity_deg: float) -> None:
        """Raise InvalidInputError for an eccentricity this scale does not reach."""
        if eccentricity_deg > self.limit_deg:
            raise InvalidInputError(
                f"{what} reaches {eccentricity_deg:.4g} deg from the fovea; the scale "
                f"{self.name!r} ends at {self.limit_deg:.4g} deg; make fov_deg smaller"
            )

    def to_mm(self, positions_deg: np.ndarray) -> np.ndarray:
        """Places on the retina, mm, of directions in degrees, both (..., 2) from the fovea."""
        ecc = np.hypot(positions_deg[..., 0], positions_deg[..., 1])
        tiny = ecc < 1e-9
        ratio = self.arc_mm(np.where(tiny, 1e-6, ecc)) / np.where(tiny, 1e-6, ecc)
        return np.asarray(-positions_deg * ratio[..., None])

    def to_deg(self, positions_mm: np.ndarray) -> np.ndarray:
        """Directions in degrees that places on the retina, mm, receive; both (..., 2)."""
        arc = np.hypot(positions_mm[..., 0], positions_mm[..., 1])
        tiny = arc < 1e-10
        ratio = self.eccentricity_deg(np.where(tiny, 1e-7, arc)) / np.where(tiny, 1e-7, arc)
        return np.asarray(-positions_mm * ratio[..., None])

    def mm2_per_deg2(self, eccentricity_deg: np.ndarray) -> np.ndarray:
        """Area of the chart per square degree of visual field, mm^2/deg^2: r r' / theta."""
        step = 1e-4
        ecc = np.clip(eccentricity_deg, 2.0 * step, self.limit_deg - step)
        slope = (self.arc_mm(ecc + step) - self.arc_mm(ecc - step)) / (2.0 * step)
        return np.asarray(slope * self.arc_mm(ecc) / ecc)

    def eccentricity_deg(self, arc_mm: np.ndarray) -> np.ndarray:
        """Eccentricity, deg, of arc lengths in mm: a table, and two steps of Newton's method."""
        table = np.linspace(0.0, self.limit_deg, _NODES)
        deg = np.interp(arc_mm, self.arc_mm(table), table)
        step = 1e-4
        for _ in range(2):
            inner = np.clip(deg, step, self.limit_deg - step)
            slope = (self.arc_mm(inner + step) - self.arc_mm(inner - step)) / (2.0 * step)
            deg = np.clip(deg - (self.arc_mm(deg) - arc_mm) / slope, 0.0, self.limit_deg)
        return np.asarray(deg)


def watson_mm2_per_deg2(eccentricity_deg: np.ndarray) -> np.ndarray:
    """Area of retina per square degree, mm^2/deg^2, at eccentricities in degrees. Watson's A7."""
    return _polynomial(_WATSON_MM2, eccentricity_deg)


def _polynomial(coefficients: tuple[float, ...], at: np.ndarray) -> np.ndarray:
    return np.asarray(np.polynomial.polynomial.polyval(at, coefficients))

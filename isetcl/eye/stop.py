"""The physical iris."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, check_finite, check_pair, check_positive


@dataclass(frozen=True)
class Stop:
    """The physical iris: a round or elliptical hole in an opaque plane.

    Parameters
    ----------
    z_mm
        Position of the plane behind the corneal vertex, mm.
    diameter_mm
        Diameter of the hole, mm; the longer one of an ellipse. A ray that meets the edge exactly
        passes.
    decentre_mm
        Middle of the hole (x, y), mm from the axis.
    minor_diameter_mm
        The shorter diameter of an ellipse, mm; None for a circle.
    axis_deg
        Direction of the longer diameter, degrees from +x towards +y.
    """

    z_mm: float
    diameter_mm: float
    decentre_mm: tuple[float, float] = (0.0, 0.0)
    minor_diameter_mm: float | None = None
    axis_deg: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "z_mm", check_finite("stop: z_mm", self.z_mm, "mm"))
        diameter = check_positive("stop: diameter_mm", self.diameter_mm, "mm")
        object.__setattr__(self, "diameter_mm", diameter)
        decentre = check_pair("stop: decentre_mm", self.decentre_mm, "mm")
        object.__setattr__(self, "decentre_mm", decentre)
        axis = check_finite("stop: axis_deg", self.axis_deg, "deg")
        object.__setattr__(self, "axis_deg", axis)
        if self.minor_diameter_mm is not None:
            minor = check_positive("stop: minor_diameter_mm", self.minor_diameter_mm, "mm")
            object.__setattr__(self, "minor_diameter_mm", minor)
            if minor > diameter:
                raise InvalidInputError(
                    f"stop: minor_diameter_mm must be <= diameter_mm ({diameter:g} mm), got "
                    f"{minor:g}; exchange them and turn axis_deg by 90"
                )

    @property
    def radius_mm(self) -> float:
        """Radius of the hole, mm; the longer semi-axis of an ellipse."""
        return self.diameter_mm / 2.0

    @property
    def aspect(self) -> float:
        """Shorter diameter over the longer one."""
        return 1.0 if self.minor_diameter_mm is None else self.minor_diameter_mm / self.diameter_mm

    @property
    def is_rotational(self) -> bool:
        """Whether it is a circle about the axis of the eye."""
        return self.decentre_mm == (0.0, 0.0) and self.aspect == 1.0

    def rim_mm(self, disc: np.ndarray) -> np.ndarray:
        """Points (n, 2) of the plane, mm, that belong to points of the unit disc.

        The unit circle becomes the rim.
        """
        turn = math.radians(self.axis_deg)
        long = self.radius_mm * np.array([math.cos(turn), math.sin(turn)])
        short = self.radius_mm * self.aspect * np.array([-math.sin(turn), math.cos(turn)])
        disc = np.asarray(disc, dtype=np.float64)
        return np.asarray(
            self.decentre_mm + disc[..., :1] * long + disc[..., 1:] * short, dtype=np.float64
        )

    def disc_of(self, point_mm: np.ndarray) -> np.ndarray:
        """Points of the unit disc that belong to points (n, 2) of the plane, mm."""
        turn = math.radians(self.axis_deg)
        offset = np.asarray(point_mm, dtype=np.float64) - self.decentre_mm
        long = offset @ np.array([math.cos(turn), math.sin(turn)]) / self.radius_mm
        short = offset @ np.array([-math.sin(turn), math.cos(turn)])
        return np.stack([long, short / (self.radius_mm * self.aspect)], axis=-1)

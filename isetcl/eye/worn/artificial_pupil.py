"""A hole in front of the eye: a change of an eye."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from isetcl.errors import (
    InvalidInputError,
    check_pair,
    check_positive,
)
from isetcl.eye.model import Eye
from isetcl.eye.placement import Placement
from isetcl.eye.stop import Stop
from isetcl.eye.surface import Surface


@dataclass(frozen=True)
class ArtificialPupil:
    """A round hole in front of the eye. It becomes the stop; the iris stays as an aperture.

    Parameters
    ----------
    diameter_mm
        Of the hole, mm.
    distance_mm
        In front of the cornea, mm.
    decentre_mm
        Place of its middle (x, y), mm.
    """

    diameter_mm: float
    distance_mm: float = 12.0
    decentre_mm: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        check_positive("artificial pupil: diameter_mm", self.diameter_mm, "mm")
        check_positive("artificial pupil: distance_mm", self.distance_mm, "mm")
        check_pair("artificial pupil: decentre_mm", self.decentre_mm, "mm")

    def apply(self, eye: Eye) -> Eye:
        """The eye behind this hole."""
        iris, at = eye.stop, eye.stop_index
        if iris.aspect != 1.0:
            raise InvalidInputError(
                f"eye {eye.name!r}: the stop must be round for an artificial pupil, got an ellipse "
                f"of {iris.diameter_mm:g} by {iris.minor_diameter_mm:g} mm"
            )
        placement = Placement(iris.decentre_mm) if iris.decentre_mm != (0.0, 0.0) else None
        aperture = Surface(
            "iris", iris.z_mm, 0.0, 0.0, iris.radius_mm, eye.media()[at], None, placement
        )
        surfaces = (*eye.surfaces[:at], aperture, *eye.surfaces[at:])
        stop = Stop(-self.distance_mm, self.diameter_mm, self.decentre_mm)
        return dataclasses.replace(eye, surfaces=surfaces, stop=stop)

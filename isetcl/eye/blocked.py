"""Eyes that light does not get through: which surface stops it."""

from __future__ import annotations

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.eye.rays import RayBundle, RayStatus


def blocked(name: str, wavelength_nm: float, *bundles: RayBundle) -> InvalidInputError:
    """The error of an eye whose chief rays are lost, naming where the innermost of them is.

    Parameters
    ----------
    name
        Name of the eye.
    bundles
        The same fan of chief rays towards the retina and out of the eye, the innermost first.
    """
    label = f"eye {name!r}: chief rays at {wavelength_nm:g} nm do not cross the eye"
    lost = [(int(np.argmin(b.passed)), b) for b in bundles if not b.passed.all()]
    if not lost:
        return InvalidInputError(f"{label}; check the order and the places of its surfaces")
    first, rays = min(lost, key=lambda pair: pair[0])
    surface = rays.elements[rays.surface[first]]
    meaning = RayStatus(rays.status[first]).meaning
    return InvalidInputError(
        f"{label}: at {surface!r}, {meaning}; check the place, the shape and the semi-diameter of "
        "this surface"
    )

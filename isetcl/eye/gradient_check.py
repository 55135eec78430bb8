"""Whether the gradient-index media of an eye make sense where they are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.eye.gradient import GradientMedium, ShellMedium
from isetcl.eye.prescription import placed_gradients

if TYPE_CHECKING:
    from isetcl.eye.model import Eye

_ACROSS = np.linspace(0.0, 1.0, 17)


def check_gradients(eye: Eye, wavelength_nm: float) -> None:
    """Refuse gradients that are not inside a lens, or whose index fails inside theirs.

    Parameters
    ----------
    eye
        The eye.
    wavelength_nm
        Where the index is looked at, nm; the nearest wavelength that the eye has.

    Raises
    ------
    InvalidInputError
        If the first or last medium or the stop's has a gradient, a lens is wider than its shells,
        or an index falls below 1 inside the lens.
    """
    media = eye.media()
    if not any(isinstance(medium, GradientMedium) for medium in media):
        return
    ends = (("in front of the eye", 0), ("of the vitreous", -1), ("at the stop", eye.stop_index))
    for where, i in ends:
        if isinstance(media[i], GradientMedium):
            raise InvalidInputError(
                f"eye {eye.name!r}: the medium {where} must be homogeneous, got the gradient "
                f"{media[i].name!r}; only what lies between two surfaces can have a gradient"
            )
    low, high = eye.wavelength_range_nm()
    gradients = placed_gradients(eye, min(max(wavelength_nm, low), high))
    for medium, placed in zip(media, gradients, strict=True):
        if placed is None:
            continue
        label = f"eye {eye.name!r}: medium {medium.name!r}"
        r, front, back = np.array(placed.chords)[..., None].transpose(1, 0, 2)
        if isinstance(medium, ShellMedium) and r[-1, 0] > medium.semi_r_mm:
            raise InvalidInputError(
                f"{label}: semi_r_mm must be >= the semi-diameter of the lens, {r[-1, 0]:g} mm, "
                f"got {medium.semi_r_mm:g}; make the shells wider or the lens smaller"
            )
        z = front + (back - front) * _ACROSS
        n = placed.profile.index(r, np.zeros_like(z), z)
        if not np.min(n) >= 1.0:
            at = np.unravel_index(np.argmin(n), n.shape)
            raise InvalidInputError(
                f"{label}: the index must be >= 1 everywhere in the lens, got {n[at]:.4g} at "
                f"z = {z[at]:.3g} mm behind its front vertex and {r[at[0], 0]:.3g} mm from the "
                "axis; check the profile, and that z is measured from the surface in front"
            )

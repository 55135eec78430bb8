"""Closed forms of the error of PSF methods at a straight depth edge between even layers."""

from __future__ import annotations

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_choice, check_finite
from isetcl.psf_baseline.methods import methods
from isetcl.psf_baseline.methods.ikoma import EPSILON
from isetcl.psf_baseline.methods.layered import LEAST_WEIGHT

_EXACT = ("layered_over", "pupil_clipped", "aperture_samples")


def edge_error(
    method: str,
    x: np.ndarray,
    far_radius: float,
    near_radius: float,
    *,
    far: float = 1.0,
    near: float = 0.0,
) -> np.ndarray:
    """What a method's image of an edge is less the true one, with uniform discs as PSFs.

    With H_n, H_f the share of a disc of the near and the far layer's radius about x that lies on
    the near layer, 1/2 - (t sqrt(1 - t^2) + asin t) / pi, t = x / radius, the true image is
    near H_n + far (1 - H_n).

    Parameters
    ----------
    method
        One of `methods()`, but ``"single"``, whose PSF depends on the rest of the view.
    x : array_like
        Distance from the edge, positive on the far layer, which the near one hides elsewhere.
    far_radius, near_radius
        Radii of the blur a |dD| of the layers, in the unit of `x`.
    far, near
        Radiances.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule.
    """
    check_choice("method", method, methods())
    at = check_array("x", x)
    far, near = check_finite("far", far), check_finite("near", near)
    by_near, by_far = _share(at, near_radius), _share(at, far_radius)
    truth = near * by_near + far * (1.0 - by_near)
    seen = 1.0 - by_far
    if method in _EXACT:
        return np.zeros_like(truth)
    if method == "gather":
        own = np.where(at < 0, by_near, by_far)
        image = near * own + far * (1.0 - own)
    elif method in ("layered_sum", "splat"):
        image = near * by_near + far * seen
    elif method in ("layered_normalized", "splat_normalized"):
        image = (near * by_near + far * seen) / (by_near + seen)
    elif method == "layered_over_visible":
        image = near * by_near + (1.0 - by_near) * far * seen
    elif method == "layered_over_normalized":
        image = near * by_near + (1.0 - by_near) * far * (seen >= LEAST_WEIGHT)
    elif method == "ikoma":
        cover = by_near / (1.0 + EPSILON)
        image = near * cover + (1.0 - cover) * far * seen / (seen + EPSILON)
    else:
        raise InvalidInputError(
            f"the error of method {method!r} at an edge depends on the rest of the view; use "
            "error_bound"
        )
    return np.asarray(image - truth)


def _share(x: np.ndarray, radius: float) -> np.ndarray:
    """Share of a disc about x that lies at negative places."""
    if check_finite("radius", radius) < 0:
        raise InvalidInputError(f"radius must be >= 0, got {radius:g}")
    if radius == 0:
        return np.where(x < 0, 1.0, np.where(x == 0, 0.5, 0.0))
    t = np.clip(x / radius, -1.0, 1.0)
    return 0.5 - (t * np.sqrt(1.0 - t * t) + np.arcsin(t)) / np.pi

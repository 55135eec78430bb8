"""The slanted edge of resolution measurements, flat or with a step in depth."""

from __future__ import annotations

import math

from isetcl.errors import InvalidInputError, check_between, check_finite, check_positive
from isetcl.scene.material import Emission
from isetcl.scene.model import Scene, SceneObject
from isetcl.scene.targets.planes import WIDE_DEG, facing_quad, half_plane
from isetcl.spectrum import Spectrum

_FARTHEST_DEG = 60.0


def slanted_edge(
    distance_m: float = 1.0,
    angle_deg: float = 5.0,
    *,
    luminance_cd_m2: float = 100.0,
    contrast: float = 0.98,
    depth_step_m: float = 0.0,
    offset_m: float = 0.0,
) -> Scene:
    """A plane, bright left of a straight edge through the axis and dark right of it.

    Parameters
    ----------
    distance_m
        Distance of the plane from the corneal vertex.
    angle_deg
        Tilt of the edge from the vertical, anticlockwise.
    contrast
        Michelson contrast of the two sides, 0 to 1.
    depth_step_m
        How much nearer the bright side is than the dark one: half of it in front of `distance_m`,
        half behind. Negative brings the dark side forward.
    offset_m
        How far the edge lies from the axis, across it: positive to the right at angle 0, upwards at
        90 degrees. An edge off the axis and at right angles to the field shows the tangential
        transfer of an eye; one along the field the sagittal transfer, without an offset.

    Raises
    ------
    InvalidInputError
        If a number breaks its rule.
    """
    distance = check_positive("distance_m", distance_m, "m")
    check_between("contrast", contrast, 0.0, 1.0)
    step = check_finite("depth_step_m", depth_step_m, "m")
    if not abs(step) < 2.0 * distance:
        raise InvalidInputError(
            f"depth_step_m must be smaller than twice distance_m ({distance:g} m), got {step:g}"
        )
    offset = check_finite("offset_m", offset_m, "m")
    if not abs(offset) < distance * math.tan(math.radians(_FARTHEST_DEG)):
        raise InvalidInputError(
            f"offset_m must lie within {_FARTHEST_DEG:g} degrees of the axis, that is "
            f"{distance * math.tan(math.radians(_FARTHEST_DEG)):.4g} m at this distance, got "
            f"{offset:g}"
        )
    white = Emission(Spectrum.equal_energy(luminance_cd_m2))
    dark = Emission(Spectrum.equal_energy(luminance_cd_m2).scaled((1 - contrast) / (1 + contrast)))
    near, far = distance - abs(step) / 2.0, distance + abs(step) / 2.0
    slope = 2.0 * math.tan(math.radians(WIDE_DEG))
    # The near half plane hides the edge of the far plane, which is whole.
    if step >= 0:
        front = half_plane(near, angle_deg, near * slope, offset)
    else:
        front = half_plane(near, angle_deg + 180.0, near * slope, -offset)
    back = facing_quad(far, far * slope, far * slope)
    shapes = (front, back) if step >= 0 else (back, front)
    return Scene(
        (
            SceneObject("bright side", shapes[0], white),
            SceneObject("dark side", shapes[1], dark),
        ),
        None,
        "slanted edge",
    )

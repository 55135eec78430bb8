"""Points of light: one, or a grid of them over the field."""

from __future__ import annotations

import math

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_between,
    check_count,
    check_number,
    check_pair,
    check_positive,
)
from isetcl.scene.material import Emission
from isetcl.scene.model import Disc, Scene, SceneObject
from isetcl.spectrum import Spectrum


def point_source(
    distance_m: float = math.inf,
    field_deg: tuple[float, float] = (0.0, 0.0),
    *,
    diameter_arcmin: float = 1.0,
    luminance_cd_m2: float = 1e6,
) -> Scene:
    """A small bright disc on black, facing the eye.

    Parameters
    ----------
    distance_m
        Distance from the corneal vertex; infinity is placed at 1e6 m, where its vergence is 1e-6
        dpt.
    field_deg
        Direction (x, y), polar field angles.
    diameter_arcmin
        Angular diameter.

    Raises
    ------
    InvalidInputError
        If a number breaks its rule, or the direction lies 90 degrees or more off the axis.
    """
    from isetcl.eye.field import direction_from_field

    is_far = check_number("distance_m", distance_m) == math.inf
    distance = 1e6 if is_far else check_positive("distance_m", distance_m, "m")
    check_between("diameter_arcmin", diameter_arcmin, 1e-3, 600.0, "arcmin")
    x, y = check_pair("field_deg", field_deg, "deg")
    if math.hypot(x, y) >= 90.0:
        raise InvalidInputError(
            f"field_deg must lie less than 90 deg off the axis, in front of the eye, got ({x:g}, "
            f"{y:g})"
        )
    direction = direction_from_field(np.float64(x), np.float64(y))
    radius = distance * math.tan(math.radians(diameter_arcmin / 120.0))
    disc = Disc(tuple(distance * direction), radius, tuple(-direction))
    light = Emission(Spectrum.equal_energy(luminance_cd_m2))
    return Scene((SceneObject("point", disc, light),), None, "point source")


def point_grid(
    distance_m: float = math.inf,
    *,
    count: tuple[int, int] = (5, 5),
    spacing_deg: float = 5.0,
    diameter_arcmin: float = 1.0,
    luminance_cd_m2: float = 1e6,
) -> Scene:
    """Small bright discs on black, at even steps of field angle, each facing the eye.

    Parameters
    ----------
    distance_m
        Distance of every point from the corneal vertex: they lie on a sphere around it.
    count
        Points across and up; odd numbers have one on the axis.
    spacing_deg
        Step of the polar field angles.
    diameter_arcmin, luminance_cd_m2
        Of each point.

    Raises
    ------
    InvalidInputError
        If a number breaks its rule, or the grid reaches 90 degrees.
    """
    try:
        across, up = count
    except (TypeError, ValueError):
        raise InvalidInputError(
            f"count must be two whole numbers, across and up, got {count!r}"
        ) from None
    columns, rows = check_count("count (across)", across), check_count("count (up)", up)
    step = check_positive("spacing_deg", spacing_deg, "deg")
    points = []
    for j in range(rows):
        for i in range(columns):
            field = (step * (i - (columns - 1) / 2.0), step * (j - (rows - 1) / 2.0))
            single = point_source(
                distance_m,
                field,
                diameter_arcmin=diameter_arcmin,
                luminance_cd_m2=luminance_cd_m2,
            )
            name = f"point ({field[0]:g}, {field[1]:g}) deg"
            points.append(SceneObject(name, single.objects[0].shape, single.objects[0].material))
    return Scene(tuple(points), None, "grid of points")

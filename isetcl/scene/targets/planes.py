"""Planes that face the eye: uniform, textured, with pictures, one or two of them."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_between,
    check_choice,
    check_finite,
    check_positive,
    check_type,
)
from isetcl.scene.display import display_primaries
from isetcl.scene.material import Emission
from isetcl.scene.model import Quad, Scene, SceneObject
from isetcl.scene.texture import Checkerboard, Image, Texture
from isetcl.spectrum import Spectrum

PatternName = Literal["checkerboard", "uniform"]

FIGURE_12_CHECK_M = 10.0 / 1024.0
"""Side of a check in the paper's Figure 12: 1024 fields across a plane of 10 m (ISET3d,
slantedBarTexture)."""

WIDE_DEG = 80.0


def uniform(luminance_cd_m2: float = 100.0, spectrum: Spectrum | None = None) -> Scene:
    """The same radiance from every direction: equal energy, or `spectrum` as it is.

    Raises
    ------
    InvalidInputError
        If the luminance is not positive.
    """
    light = Spectrum.equal_energy(luminance_cd_m2) if spectrum is None else spectrum
    return Scene((), light, "uniform")


def two_planes(
    near_m: float = 0.5,
    far_m: float = 2.0,
    *,
    texture: PatternName = "checkerboard",
    check_m: float = FIGURE_12_CHECK_M,
    dark: float = 0.05,
    edge_angle_deg: float = 45.0,
    luminance_cd_m2: float = 100.0,
    near: Emission | None = None,
    far: Emission | None = None,
) -> Scene:
    """Two planes that face the eye, the near one covering the left half: the paper's Figure 12.

    Parameters
    ----------
    near_m, far_m
        Distances from the corneal vertex, metres.
    texture
        ``"checkerboard"`` on both planes, or ``"uniform"`` (near dark, far white).
    check_m
        Side of a check in metres, on both planes.
    dark
        Weight of the dark checks and of the dark plane.
    edge_angle_deg
        Tilt of the near plane's edge from the vertical, anticlockwise; the edge crosses the axis.
    luminance_cd_m2
        Of the white parts; equal-energy light.
    near, far
        Materials instead of the pattern. They extend over 160 degrees.

    Raises
    ------
    InvalidInputError
        If the near plane is not nearer than the far one, or a number breaks its rule.
    """
    distances = near_and_far(near_m, far_m)
    check_choice("texture", texture, ("checkerboard", "uniform"))
    check_positive("check_m", check_m, "m")
    white = Spectrum.equal_energy(luminance_cd_m2)
    sizes = [2.0 * d * math.tan(math.radians(WIDE_DEG)) for d in distances]
    # A whole number of checks, so that the near edge is the edge of a check.
    sizes = [2.0 * check_m * math.ceil(size / (2.0 * check_m)) for size in sizes]

    def pattern(size: float, weight: float) -> Emission:
        if texture == "uniform":
            return Emission(white.scaled(weight))
        periods = size / (2.0 * check_m)
        board: Texture = Checkerboard(periods, periods, 1.0, dark)
        return Emission(white, board)

    near_quad = half_plane(distances[0], edge_angle_deg, sizes[0])
    far_quad = facing_quad(distances[1], sizes[1], sizes[1], edge_angle_deg)
    return Scene(
        (
            SceneObject("near plane", near_quad, pattern(sizes[0], dark) if near is None else near),
            SceneObject("far plane", far_quad, pattern(sizes[1], 1.0) if far is None else far),
        ),
        None,
        f"two planes at {distances[0]:g} and {distances[1]:g} m",
    )


def image_plane(
    image: Image, distance_m: float, width_deg: float, *, luminance_cd_m2: float = 100.0
) -> Scene:
    """A picture that faces the eye, centred on the axis.

    Parameters
    ----------
    image
        From `load_image`, or linear weights in [0, 1].
    distance_m
        Distance from the corneal vertex, metres.
    width_deg
        Angle the width subtends at the corneal vertex.
    luminance_cd_m2
        Luminance of white (weights 1): D65 from an sRGB display, or equal energy if grey.

    Raises
    ------
    InvalidInputError
        If a number breaks its rule, or the image is none.
    """
    check_type("image", image, Image)
    distance = check_positive("distance_m", distance_m, "m")
    width = (
        2.0 * distance * math.tan(math.radians(check_between("width_deg", width_deg, 0, 170) / 2))
    )
    rows, columns = image.shape
    quad = facing_quad(distance, width, width * rows / columns)
    material = picture(image, luminance_cd_m2)
    return Scene((SceneObject(image.name, quad, material),), None, f"image plane {image.name}")


def image_planes(
    near_image: Image,
    far_image: Image,
    near_m: float,
    far_m: float,
    fov_deg: float,
    *,
    luminance_cd_m2: float = 100.0,
) -> Scene:
    """Two pictures at two distances; the near one covers the left half of the field.

    The near picture is cut to the left half of the field, the far one to the whole of it: both keep
    their proportions, and what does not fit is cut off evenly on both sides. If one is coloured,
    both are shown in D65, else in equal-energy light.

    Parameters
    ----------
    near_image, far_image
        From `load_image`.
    near_m, far_m
        Distances from the corneal vertex, metres.
    fov_deg
        The field the pictures are fitted to, a square.
    luminance_cd_m2
        Luminance of white (weights 1).

    Raises
    ------
    InvalidInputError
        If the near plane is not nearer than the far one, a number breaks its rule, or a picture is
        too narrow to be cut.
    """
    distances = near_and_far(near_m, far_m)
    check_type("near_image", near_image, Image)
    check_type("far_image", far_image, Image)
    # A little more than the field: blur looks beyond its edges.
    slope = 2.0 * math.tan(math.radians(check_between("fov_deg", fov_deg, 0.01, 120.0) * 0.55))
    near_height, far_height = (slope * distance for distance in distances)
    near_width = near_height / 2.0
    near_quad = Quad(
        (-near_width, -near_height / 2, -distances[0]), (near_width, 0, 0), (0, near_height, 0)
    )
    far_quad = facing_quad(distances[1], far_height, far_height)
    white = "D65" if 3 in (near_image.channels, far_image.channels) else "E"
    near_part, far_part = (
        picture(image.cropped(proportion), luminance_cd_m2, white)
        for image, proportion in ((near_image, 0.5), (far_image, 1.0))
    )
    return Scene(
        (
            SceneObject(f"near: {near_image.name}", near_quad, near_part),
            SceneObject(f"far: {far_image.name}", far_quad, far_part),
        ),
        None,
        f"{near_image.name} at {distances[0]:g} m before {far_image.name} at {distances[1]:g} m",
    )


def picture(image: Image, luminance_cd_m2: float = 100.0, white: str = "E") -> Emission:
    """A picture as an emitter: on an sRGB display (D65) if coloured, in light `white` if grey.

    Raises
    ------
    InvalidInputError
        If the luminance is not positive, or the light is unknown.
    """
    check_type("image", image, Image)
    if image.channels == 1:
        if white == "E":
            return Emission(Spectrum.equal_energy(luminance_cd_m2), image)
        return Emission(Spectrum.illuminant(white, luminance_cd_m2), image)
    return Emission(display_primaries(luminance_cd_m2), image)


def near_and_far(near_m: float, far_m: float) -> tuple[float, float]:
    """Two checked distances in order of depth."""
    near, far = check_positive("near_m", near_m, "m"), check_positive("far_m", far_m, "m")
    if not near < far:
        raise InvalidInputError(
            f"near_m must be smaller than far_m, got {near:g} and {far:g} m; swap them"
        )
    return near, far


def facing_quad(distance_m: float, width_m: float, height_m: float, turn_deg: float = 0.0) -> Quad:
    """A rectangle facing the eye, centred on the axis, turned about it."""
    right, up = turned_axes(turn_deg)
    centre = np.array([0.0, 0.0, -distance_m])
    corner = centre - width_m / 2.0 * right - height_m / 2.0 * up
    return Quad(tuple(corner), tuple(width_m * right), tuple(height_m * up))


def half_plane(distance_m: float, turn_deg: float, size_m: float, offset_m: float = 0.0) -> Quad:
    """A square facing the eye whose right edge crosses the axis, turned about the axis.

    `offset_m` moves it to its own right, so that the edge passes the axis at that distance.
    """
    right, up = turned_axes(turn_deg)
    middle = np.array([0.0, 0.0, -distance_m])
    corner = middle + (offset_m - size_m) * right - size_m / 2.0 * up
    return Quad(tuple(corner), tuple(size_m * right), tuple(size_m * up))


def turned_axes(turn_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors right and up after a turn about the axis, anticlockwise."""
    turn = math.radians(check_finite("angle of the edge", turn_deg, "deg"))
    return (
        np.array([math.cos(turn), math.sin(turn), 0.0]),
        np.array([-math.sin(turn), math.cos(turn), 0.0]),
    )

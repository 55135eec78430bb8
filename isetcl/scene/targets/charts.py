"""Flat charts: textures, a grid of lines, the ColorChecker, a Siemens star."""

from __future__ import annotations

import math

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_between,
    check_choice,
    check_count,
    check_pair,
    check_positive,
    check_type,
)
from isetcl.scene.display import display_primaries
from isetcl.scene.material import Diffuse, Emission, Material
from isetcl.scene.mesh import Mesh
from isetcl.scene.model import Disc, Quad, Scene, SceneObject
from isetcl.scene.targets.lighting import Lighting, painted, surroundings
from isetcl.scene.targets.paints import CHART_COLUMNS, CHART_ROWS, chart_paints
from isetcl.scene.targets.planes import facing_quad
from isetcl.scene.texture import TEXTURES, Grid, Texture
from isetcl.spectrum import Spectrum


def textured_plane(
    texture: Texture,
    distance_m: float = 1.0,
    size_m: tuple[float, float] = (1.0, 1.0),
    *,
    luminance_cd_m2: float = 100.0,
    lighting: Lighting = "emitting",
) -> Scene:
    """A rectangle with a texture that faces the eye, centred on the axis.

    Parameters
    ----------
    texture
        A pattern or a linear image, grey or red, green and blue; weights up to 1.
    distance_m
        Distance from the corneal vertex.
    size_m
        Width and height.
    luminance_cd_m2
        Luminance of white (weight 1): equal energy, or D65 where the texture is coloured.
    lighting
        ``"emitting"``, as on a display, or ``"lit"`` from all around, as in print.

    Raises
    ------
    InvalidInputError
        If the texture is none, or a number breaks its rule.
    """
    check_type("texture", texture, TEXTURES)
    distance = check_positive("distance_m", distance_m, "m")
    width, height = (
        check_positive("size_m", side, "m") for side in check_pair("size_m", size_m, "m")
    )
    check_choice("lighting", lighting, ("emitting", "lit"))
    is_grey = texture.channels == 1
    if is_grey:
        white = Spectrum.equal_energy(luminance_cd_m2)
    else:
        white = Spectrum.illuminant("D65", luminance_cd_m2)
    material: Material
    if lighting == "lit":
        material = Diffuse(_full() if is_grey else _reflectances(), texture)
    else:
        material = Emission(white if is_grey else display_primaries(luminance_cd_m2), texture)
    plane = SceneObject("plane", facing_quad(distance, width, height), material)
    return Scene((plane,), surroundings(white, lighting), "textured plane")


def tca_grid(
    distance_m: float = 1.0,
    width_deg: float = 60.0,
    *,
    lines: int = 16,
    line_width: float = 1.0 / 16.0,
    luminance_cd_m2: float = 100.0,
) -> Scene:
    """White lines on black, crossing on the axis, for transverse chromatic aberration: Figure 10.

    Parameters
    ----------
    distance_m
        Distance of the plane from the corneal vertex.
    width_deg
        Angle that the width subtends; lines are evenly spaced in metres.
    lines
        Lines each way, an even number, so that one runs through the axis.
    line_width
        Width of a line, a share of their spacing.
    luminance_cd_m2
        Of the lines, equal-energy light.

    Raises
    ------
    InvalidInputError
        If a number breaks its rule.

    Notes
    -----
    Source: ISET3d: one pixel in 16 of 256, 60 degrees wide, at 1 m.
    """
    distance = check_positive("distance_m", distance_m, "m")
    check_between("width_deg", width_deg, 0.01, 160.0, "deg")
    periods = check_count("lines", lines, 2)
    if periods % 2:
        raise InvalidInputError(f"lines must be even, so that one runs on the axis, got {lines}")
    check_between("line_width", line_width, 0.0, 1.0)
    width = 2.0 * distance * math.tan(math.radians(width_deg) / 2.0)
    light = Emission(Spectrum.equal_energy(luminance_cd_m2), Grid(periods, periods, line_width))
    grid = SceneObject("grid", facing_quad(distance, width, width), light)
    return Scene((grid,), None, "grid of lines")


def macbeth_chart(
    distance_m: float = 0.5,
    width_m: float = 0.28,
    *,
    illuminant: str = "D65",
    luminance_cd_m2: float = 100.0,
    lighting: Lighting = "emitting",
) -> Scene:
    """The 24 patches of the ColorChecker on black, facing the eye.

    Parameters
    ----------
    distance_m
        Distance from the corneal vertex.
    width_m
        Width of six patches with their borders; a border is an eighth of a patch's place.
    illuminant
        Name of the light, as colour-science knows it.
    luminance_cd_m2
        Luminance of a perfect white in that light.
    lighting
        ``"emitting"`` or ``"lit"`` from all around; both look the same.

    Raises
    ------
    InvalidInputError
        If the light is unknown, or a number breaks its rule.

    Notes
    -----
    Source of the reflectances: ISO 17321-1:2012, as tabulated by colour-science.
    """
    distance = check_positive("distance_m", distance_m, "m")
    place = check_positive("width_m", width_m, "m") / CHART_COLUMNS
    white = Spectrum.illuminant(illuminant, luminance_cd_m2)
    side = place * 7.0 / 8.0
    objects = []
    for i, (name, reflectance) in enumerate(chart_paints().items()):
        column, row = i % CHART_COLUMNS, i // CHART_COLUMNS
        x = (column - (CHART_COLUMNS - 1) / 2.0) * place
        y = ((CHART_ROWS - 1) / 2.0 - row) * place
        corner = (x - side / 2.0, y - side / 2.0, -distance)
        quad = Quad(corner, (side, 0.0, 0.0), (0.0, side, 0.0))
        objects.append(SceneObject(name, quad, painted(reflectance, white, lighting)))
    black = painted(Spectrum.constant(0.03, "black frame"), white, lighting)
    frame = facing_quad(distance * (1.0 + 1e-5), CHART_COLUMNS * place, CHART_ROWS * place)
    objects.append(SceneObject("frame", frame, black))
    return Scene(tuple(objects), surroundings(white, lighting), "ColorChecker")


def siemens_star(
    distance_m: float = 1.0,
    diameter_deg: float = 5.0,
    *,
    spokes: int = 36,
    contrast: float = 0.98,
    luminance_cd_m2: float = 100.0,
    lighting: Lighting = "emitting",
) -> Scene:
    """Bright spokes on a dark disc; the spatial frequency grows towards the middle.

    At an angle a from the middle it is spokes / (2 pi a).

    Parameters
    ----------
    distance_m
        Distance from the corneal vertex.
    diameter_deg
        Angle that the disc subtends.
    spokes
        Bright spokes around.
    contrast
        Michelson contrast of the spokes.
    luminance_cd_m2
        Of the bright spokes, equal-energy light.
    lighting
        ``"emitting"`` or ``"lit"`` from all around; both look the same.

    Raises
    ------
    InvalidInputError
        If a number breaks its rule.
    """
    distance = check_positive("distance_m", distance_m, "m")
    check_between("diameter_deg", diameter_deg, 1e-3, 160.0, "deg")
    count = check_count("spokes", spokes, 2, 5000)
    check_between("contrast", contrast, 0.0, 1.0)
    radius = distance * math.tan(math.radians(diameter_deg) / 2.0)
    white = Spectrum.equal_energy(luminance_cd_m2)
    dark = Spectrum.constant((1.0 - contrast) / (1.0 + contrast), "dark")
    mesh = _spokes(count, radius, -distance * (1.0 - 1e-5))
    return Scene(
        (
            SceneObject("spokes", mesh, painted(_full(), white, lighting)),
            SceneObject(
                "disc", Disc((0.0, 0.0, -distance), radius), painted(dark, white, lighting)
            ),
        ),
        surroundings(white, lighting),
        "Siemens star",
    )


def _spokes(count: int, radius: float, z: float) -> Mesh:
    """Sectors of a disc that faces the eye, as wide as the gaps between them."""
    pieces = max(1, round(128 / count))
    share = np.arange(pieces + 1) / pieces * 0.5
    turn = 2.0 * np.pi * (np.arange(count)[:, None] + share).ravel() / count
    rim = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.full(turn.shape, z)])
    vertices = np.concatenate([[[0.0, 0.0, z]], rim])
    first = 1 + (np.arange(count)[:, None] * (pieces + 1) + np.arange(pieces)).ravel()
    return Mesh(vertices, np.column_stack([np.zeros_like(first), first, first + 1]))


def _full() -> Spectrum:
    return Spectrum.constant(1.0, "white")


def _reflectances() -> tuple[Spectrum, ...]:
    """Reflectances of red, green and blue that together are white: of the display in its white."""
    primaries = display_primaries(100.0)
    white = np.sum([spectrum.values for spectrum in primaries], axis=0)
    return tuple(Spectrum(s.wavelengths_nm, s.values / white, s.name) for s in primaries)

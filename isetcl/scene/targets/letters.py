"""Solid letters and numerals at several distances, before a chequered ground and wall."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_positive, check_type
from isetcl.scene.material import Diffuse, Emission
from isetcl.scene.mesh import Mesh
from isetcl.scene.model import Quad, Scene, SceneObject
from isetcl.scene.solid import extruded_mesh
from isetcl.scene.targets.paints import paint
from isetcl.scene.text import DEFAULT_FONT, text_outline
from isetcl.scene.texture import Checkerboard
from isetcl.spectrum import Spectrum

FIGURE_9_DISTANCES_M = (1.0 / 1.8, 1.0 / 1.2, 1.0 / 0.6)
"""Distances of A, B and C in the paper's Figure 9: 1.8, 1.2 and 0.6 dpt."""

_CHECK_M = 10.0 / 64.0
_GROUND_BELOW = 0.0361 / 0.07
_NUMERAL_HEIGHT, _NUMERAL_DEPTH = 0.14, 0.04

# Distance, and middle (x, y) and width of the numeral, mm (ISET3d, numbersAtDepth).
_NUMERALS_MM = (
    (100.0, -16.0, 17.6, 25.4),
    (125.0, 20.0, -22.0, 30.9),
    (150.0, 24.0, 0.0, 38.0),
    (175.0, 28.0, 30.0, 43.2),
    (200.0, -32.0, -35.3, 57.4),
    (300.0, -48.0, 0.0, 84.4),
)


def letters_at_depth(
    letters: str = "ABC",
    distances_m: Sequence[float] = FIGURE_9_DISTANCES_M,
    fields_deg: Sequence[float] = (-5.0, 0.0, 5.0),
    *,
    height_m: float = 0.07,
    depth_m: float = 0.02,
    wall_m: float = 2.0,
    luminance_cd_m2: float = 100.0,
    font: str = DEFAULT_FONT,
) -> Scene:
    """White solid letters at several distances: the paper's Figures 4 and 9.

    The letters stand at the height of the eye over a chequered ground, before a chequered wall, in
    equal-energy light from all around. Figure 4 is ``distances_m=(1 / 1.4, 1.0, 1 / 0.6),
    fields_deg=(-1.5, 0, 1), height_m=0.035``.

    Parameters
    ----------
    letters
        One letter for each distance.
    distances_m
        From the corneal vertex to the fronts of the letters, along the axis.
    fields_deg
        Horizontal field angles of the letters' middles.
    height_m, depth_m
        Height and thickness of each letter.
    wall_m
        Distance of the wall.
    luminance_cd_m2
        Luminance of the light around.
    font
        Family of an installed font.

    Raises
    ------
    InvalidInputError
        If there are not as many letters as distances and angles, a letter stands in the wall, or a
        number breaks its rule.

    Notes
    -----
    Source of the sizes: Lian et al. 2019 and ISET3d (lettersAtDepth).
    """
    check_type("letters", letters, str)
    distances = _positive_list("distances_m", distances_m, len(letters))
    fields = check_array("fields_deg", fields_deg)
    if fields.shape != (len(letters),) or not np.all(np.abs(fields) < 80.0):
        raise InvalidInputError(
            f"fields_deg must be one angle within 80 deg a letter, got {fields_deg!r}"
        )
    height, depth = check_positive("height_m", height_m), check_positive("depth_m", depth_m)
    wall = check_positive("wall_m", wall_m)
    if not np.all(distances + depth < wall):
        raise InvalidInputError(
            f"distances_m must lie before the wall ({wall:g} m), got {distances}"
        )
    white = Diffuse(Spectrum.constant(1.0, "white"))
    objects = []
    for letter, distance, field in zip(letters, distances, fields, strict=True):
        mesh = extruded_mesh(text_outline(letter, height, font=font), depth, f"letter {letter!r}")
        middle = (distance * math.tan(math.radians(field)), 0.0, -distance - depth / 2.0)
        objects.append(SceneObject(letter, _shifted(mesh, middle), white))
    ground = -_GROUND_BELOW * height
    objects += [
        SceneObject("wall", Quad((-5, -5, -wall), (10, 0, 0), (0, 10, 0)), _checks(10.0)),
        SceneObject("ground", Quad((-5, ground, 5), (10, 0, 0), (0, 0, -10)), _checks(10.0)),
    ]
    light = Spectrum.equal_energy(luminance_cd_m2)
    return Scene(tuple(objects), light, f"letters {letters} at depth")


def numbers_at_depth(*, lamp_luminance_cd_m2: float = 300.0, font: str = DEFAULT_FONT) -> Scene:
    """Red numerals 100, 125, 150, 175, 200 and 300 at as many millimetres: the paper's Figure 8.

    Each subtends the same height, 8 degrees. They hang over a chequered ground before a chequered
    wall, under a square lamp of D65.

    Parameters
    ----------
    lamp_luminance_cd_m2
        Luminance of the lamp, 1 m by 1 m, half a metre above the eye.
    font
        Family of an installed font.

    Raises
    ------
    InvalidInputError
        If the luminance is not positive, or the font is not installed.

    Notes
    -----
    Source of the sizes: ISET3d (numbersAtDepth); distances are those of the numerals' fronts.
    """
    red = Diffuse(paint("red"))
    objects = []
    for row in _NUMERALS_MM:
        distance, x, y, width = (value * 1e-3 for value in row)
        text = f"{row[0]:g}"
        depth = _NUMERAL_DEPTH * distance
        loops = text_outline(text, _NUMERAL_HEIGHT * distance, font=font)
        stretch = width / float(np.ptp(np.concatenate(loops)[:, 0]))
        mesh = extruded_mesh([loop * [stretch, 1.0] for loop in loops], depth, f"numeral {text}")
        middle = (x, y, -distance - depth / 2.0)
        objects.append(SceneObject(text, _shifted(mesh, middle), red))
    lamp = Emission(Spectrum.illuminant("D65", lamp_luminance_cd_m2))
    objects += [
        SceneObject("wall", Quad((-1, -1, -1), (2, 0, 0), (0, 2, 0)), _checks(2.0, 0.125)),
        SceneObject("ground", Quad((-1, -0.1, 1), (2, 0, 0), (0, 0, -2)), _checks(2.0, 0.125)),
        SceneObject("lamp", Quad((-0.5, 0.5, -0.5), (1, 0, 0), (0, 0, 1)), lamp),
    ]
    return Scene(tuple(objects), None, "numbers at depth")


def _checks(size_m: float, check_m: float = _CHECK_M) -> Diffuse:
    """Black and grey (0.3) fields, as the ground and the wall of ISET3d have."""
    periods = size_m / (2.0 * check_m)
    return Diffuse(Spectrum.constant(0.3, "grey"), Checkerboard(periods, periods))


def _shifted(mesh: Mesh, offset_m: tuple[float, float, float]) -> Mesh:
    matrix = np.eye(4)
    matrix[:3, 3] = offset_m
    return mesh.moved(matrix)


def _positive_list(name: str, values: Sequence[float], count: int) -> np.ndarray:
    """As many finite numbers > 0."""
    array = check_array(name, values)
    if array.shape != (count,) or not np.all(np.isfinite(array) & (array > 0)) or count == 0:
        raise InvalidInputError(
            f"{name} must be {count or 'at least one'} finite numbers > 0, one a letter, got "
            f"{values!r}"
        )
    return array

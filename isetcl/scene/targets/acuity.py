"""A chart of letters for testing sight."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_between,
    check_positive,
    check_type,
)
from isetcl.scene.model import Scene, SceneObject
from isetcl.scene.solid import flat_mesh
from isetcl.scene.targets.lighting import Lighting, painted, surroundings
from isetcl.scene.targets.optotypes import optotype
from isetcl.scene.targets.planes import facing_quad
from isetcl.spectrum import Spectrum

SNELLEN_ROWS = (
    (200.0, "E"),
    (100.0, "FP"),
    (70.0, "TOZ"),
    (50.0, "LPED"),
    (40.0, "PECFD"),
    (30.0, "EDFCZP"),
    (25.0, "FELOPZD"),
    (20.0, "DEFPOTEC"),
)
"""The usual rows of a Snellen chart: N of 20/N, and the letters."""

_CARD_REFLECTANCE = 0.9
_INK_ABOVE_CARD = 1e-5


def snellen_chart(
    distance_m: float = 6.0,
    rows: Sequence[tuple[float, str]] = SNELLEN_ROWS,
    *,
    on_axis: float | None = None,
    contrast: float = 0.95,
    luminance_cd_m2: float = 100.0,
    lighting: Lighting = "emitting",
) -> Scene:
    """Rows of dark letters on a white card that faces the eye.

    A letter of the row 20/N is as high and wide as 5 N/20 minutes of arc at the card's distance,
    with strokes of a fifth. Between letters there is the width of one; between rows the height of
    the lower one.

    Parameters
    ----------
    distance_m
        Distance of the card from the corneal vertex.
    rows
        From the top: N of 20/N, and the letters (of C D E F H K L N O P R S T V Z).
    on_axis
        N of the row whose middle lies on the axis; None is the middle of the chart.
    contrast
        Weber contrast of the letters: 1 is black.
    luminance_cd_m2
        Of the card, equal-energy light.
    lighting
        ``"emitting"`` or ``"lit"`` from all around; the luminances are the same.

    Raises
    ------
    InvalidInputError
        If a letter is unknown, or a number breaks its rule.

    Notes
    -----
    Sources: Snellen 1862 (five minutes of arc a letter, one a stroke); spacing of Bailey & Lovie
    1976 (Am. J. Optom. Physiol. Opt. 53, 740).
    """
    distance = check_positive("distance_m", distance_m, "m")
    check_between("contrast", contrast, 0.0, 1.0)
    checked = _checked_rows(rows)
    heights = [letter_height_m(distance, denominator) for denominator, _ in checked]
    middles = _middles(heights)
    offset = (middles[0] + heights[0] / 2.0 + middles[-1] - heights[-1] / 2.0) / 2.0
    if on_axis is not None:
        denominators = [denominator for denominator, _ in checked]
        if on_axis not in denominators:
            raise InvalidInputError(
                f"on_axis must be one of the rows {denominators}, got {on_axis}"
            )
        offset = middles[denominators.index(on_axis)]
    white = Spectrum.equal_energy(luminance_cd_m2).scaled(1.0 / _CARD_REFLECTANCE)
    ink = Spectrum.constant(_CARD_REFLECTANCE * (1.0 - contrast), "ink")
    paper = Spectrum.constant(_CARD_REFLECTANCE, "paper")
    dark = painted(ink, white, lighting)
    objects = []
    for (denominator, letters), height, middle in zip(checked, heights, middles, strict=True):
        loops = _row(letters, height)
        place = np.array([0.0, middle - offset - height / 2.0])
        mesh = flat_mesh([loop + place for loop in loops], -distance * (1.0 - _INK_ABOVE_CARD))
        objects.append(SceneObject(f"20/{denominator:g} {letters}", mesh, dark))
    margin = max(heights)
    widths = [(2 * len(row[1]) - 1) * h for row, h in zip(checked, heights, strict=True)]
    top = middles[0] + heights[0] / 2.0 - offset
    bottom = middles[-1] - heights[-1] / 2.0 - offset
    half = max(top, -bottom) + margin
    card = facing_quad(distance, max(widths) + 2.0 * margin, 2.0 * half)
    objects.append(SceneObject("card", card, painted(paper, white, lighting)))
    return Scene(tuple(objects), surroundings(white, lighting), "Snellen chart")


def letter_height_m(distance_m: float, denominator: float) -> float:
    """Height of a letter of the row 20/`denominator`, metres: 5 minutes of arc times N/20."""
    return 2.0 * distance_m * math.tan(math.radians(5.0 / 60.0 * denominator / 20.0) / 2.0)


def _checked_rows(rows: Sequence[tuple[float, str]]) -> list[tuple[float, str]]:
    check_type("rows", rows, (tuple, list))
    checked = []
    for i, row in enumerate(rows):
        try:
            denominator, letters = row
        except (TypeError, ValueError):
            raise InvalidInputError(f"rows[{i}] must be N and letters, got {row!r}") from None
        check_type(f"rows[{i}]: letters", letters, str)
        if not letters:
            raise InvalidInputError(f"rows[{i}] must have at least one letter, got {letters!r}")
        value = check_between(f"rows[{i}]: N of 20/N", denominator, 0.1, 10000.0)
        checked.append((value, letters))
    if not checked:
        raise InvalidInputError("rows must hold at least one row, got none")
    return checked


def _middles(heights: list[float]) -> list[float]:
    """Heights of the middles of the rows over the first one."""
    middles = [0.0]
    for above, below in itertools.pairwise(heights):
        middles.append(middles[-1] - above / 2.0 - below - below / 2.0)
    return middles


def _row(letters: str, height: float) -> list[np.ndarray]:
    """Loops of a row of letters, centred at x = 0, standing on y = 0."""
    start = -(len(letters) - 0.5) * height
    return [
        loop + np.array([start + 2.0 * i * height, 0.0])
        for i, letter in enumerate(letters)
        for loop in optotype(letter, height)
    ]

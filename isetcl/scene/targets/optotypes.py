"""Letters for testing sight: five by five units, strokes of one unit.

C is Landolt's ring; the others follow the same construction (Sloan 1959, Am. J. Ophthalmol. 48,
807), drawn anew. Outlines have their lower left corner at (0, 0) and a height of 5.
"""

from __future__ import annotations

import numpy as np

from isetcl.errors import check_choice

_PIECES = 48


def _arc(x: float, y: float, radius: float, start_deg: float, end_deg: float) -> np.ndarray:
    pieces = max(2, round(abs(end_deg - start_deg) / 360.0 * _PIECES))
    turn = np.radians(np.linspace(start_deg, end_deg, pieces + 1))
    return np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn)])


def _loop(*parts: object) -> np.ndarray:
    """One loop from corners and arcs."""
    return np.concatenate([np.atleast_2d(np.asarray(part, dtype=np.float64)) for part in parts])


def _ring() -> list[np.ndarray]:
    return [_arc(2.5, 2.5, radius, 0.0, 360.0)[:-1] for radius in (2.5, 1.5)]


def _landolt() -> list[np.ndarray]:
    outer, inner = (float(np.degrees(np.arcsin(0.5 / radius))) for radius in (2.5, 1.5))
    return [
        _loop(
            _arc(2.5, 2.5, 2.5, outer, 90.0),
            _arc(2.5, 2.5, 2.5, 90.0, 270.0),
            _arc(2.5, 2.5, 2.5, 270.0, 360.0 - outer),
            _arc(2.5, 2.5, 1.5, 360.0 - inner, inner),
        )
    ]


def _bowl(x: float, y: float, outer: float) -> list[np.ndarray]:
    """A closed bowl on a stem: its right half, and the hole in it."""
    inner = outer - 1.0
    right = _arc(x, y, outer, -90.0, 90.0)
    hole = _loop((1.0, y - inner), _arc(x, y, inner, -90.0, 90.0), (1.0, y + inner))
    return [right, hole]


def _snake() -> np.ndarray:
    """S: both sides of a line of half circles and straights, half a unit away from it."""
    sides = []
    for out in (0.5, -0.5):
        sides.append(
            _loop(
                _arc(3.5, 3.5, 1.0 + out, 0.0, 90.0),
                _arc(1.5, 3.5, 1.0 + out, 90.0, 270.0),
                _arc(3.5, 1.5, 1.0 - out, 90.0, -90.0),
                _arc(1.5, 1.5, 1.0 - out, -90.0, -180.0),
            )
        )
    return np.concatenate([sides[0], sides[1][::-1]])


def _drawn() -> dict[str, list[np.ndarray]]:
    d_right, d_hole = _bowl(2.5, 2.5, 2.5)
    p_right, p_hole = _bowl(3.5, 3.5, 1.5)
    bars = [(5, 0), (5, 1), (1, 1), (1, 2), (5, 2), (5, 3), (1, 3), (1, 4), (5, 4), (5, 5), (0, 5)]
    return {
        "C": _landolt(),
        "D": [_loop((0, 0), d_right, (0, 5)), d_hole],
        "E": [_loop((0, 0), bars)],
        "F": [_loop((0, 0), (1, 0), (1, 2), (4, 2), (4, 3), bars[6:])],
        "H": [
            _loop(
                [(0, 0), (1, 0), (1, 2), (4, 2), (4, 0), (5, 0), (5, 5), (4, 5), (4, 3), (1, 3)],
                [(1, 5), (0, 5)],
            )
        ],
        "K": [
            _loop(
                [(0, 0), (1, 0), (1, 1.6), (2, 2.45), (3.75, 0), (5, 0), (2.778, 3.111), (5, 5)],
                [(3.353, 5), (1, 3), (1, 5), (0, 5)],
            )
        ],
        "L": [_loop([(0, 0), (5, 0), (5, 1), (1, 1), (1, 5), (0, 5)])],
        "N": [
            _loop(
                [(0, 0), (1, 0), (1, 3.47), (4, 0), (5, 0), (5, 5), (4, 5), (4, 1.53), (1, 5)],
                (0, 5),
            )
        ],
        "O": _ring(),
        "P": [_loop((0, 0), (1, 0), (1, 2), p_right, (0, 5)), p_hole],
        "R": [
            _loop((0, 0), (1, 0), (1, 2), (2.3, 2), (3.8, 0), (5, 0), p_right, (0, 5)),
            p_hole,
        ],
        "S": [_snake()],
        "T": [_loop([(2, 0), (3, 0), (3, 4), (5, 4), (5, 5), (0, 5), (0, 4), (2, 4)])],
        "V": [_loop([(2, 0), (3, 0), (5, 5), (3.9, 5), (2.5, 1.4), (1.1, 5), (0, 5)])],
        "Z": [
            _loop(
                [(0, 0), (5, 0), (5, 1), (1.5, 1), (5, 4), (5, 5), (0, 5), (0, 4), (3.5, 4), (0, 1)]
            )
        ],
    }


OPTOTYPES = _drawn()
"""Outlines of the letters there are."""


def optotype(letter: str, height_m: float) -> list[np.ndarray]:
    """Loops of a letter, metres, lower left corner at the origin.

    Raises
    ------
    InvalidInputError
        If the letter is not among `OPTOTYPES`.
    """
    loops = OPTOTYPES[check_choice("optotype", letter, OPTOTYPES)]
    return [loop * (height_m / 5.0) for loop in loops]

"""Kinds of error by themselves: representation, rounding and discretisation of a point."""

from __future__ import annotations

import numpy as np

from isetcl.validation.work_precision.estimators import root
from isetcl.validation.work_precision.method import PART_NAMES, Part, Point
from isetcl.validation.work_precision.pixels import Pixels, Quantity, check_same_grid, pixels_of

_PART_REPLICATES = 4


def kinds_of_error(
    point: Point, seeds: list[int], truth: Pixels, quantity: Quantity
) -> dict[str, float]:
    """Representation, rounding and discretisation of a point, root mean square."""
    level = abs(float(np.mean(truth.values)))
    found: dict[str, float] = {}
    for part in point.method.parts:
        count = 1 if part.is_paired else min(_PART_REPLICATES, len(seeds))
        off = np.array([_difference(point, part, s, truth, quantity) for s in seeds[:count]])
        off /= level
        square = float(np.mean(off.mean(axis=0) ** 2))
        if count > 1:
            square -= float(np.mean(off.var(axis=0, ddof=1))) / count
        found[part.name] = float(root(square))
    return {name: found[name] for name in PART_NAMES if name in found}


def _difference(
    point: Point, part: Part, seed: int, truth: Pixels, quantity: Quantity
) -> np.ndarray:
    sides = []
    for run in (part.one, part.other):
        what = f"the image for the {part.name} of {point.what}"
        pixels = pixels_of(run(point.value, seed), what, quantity)
        check_same_grid(pixels, what, truth)
        sides.append(pixels.values.ravel())
    return sides[0] - sides[1]

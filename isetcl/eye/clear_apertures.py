"""Semi-diameters that nobody measured: the largest with which surfaces exist and do not cross.

Model eyes leave them open, and in Zemax an automatic semi-diameter follows the rays and clips
nothing. Here every surface needs one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from isetcl.eye.sequential import heights_mm
from isetcl.eye.surface import Surface, form_sag

_STEP_MM = 0.05
_MOST_STEPS = 1000
_AZIMUTHS = 16


def widest_mm(form: dict[str, Any], wanted_mm: float) -> float:
    """The largest semi-diameter up to a wanted one, mm, inside which a form exists.

    `form` holds `curvature`, `conic` and `shape`.
    """
    rho = _steps(wanted_mm)[1:]
    sag = form_sag(form["curvature"], form["conic"], form["shape"], *_ring(rho))
    ended = ~np.isfinite(sag).all(axis=1)
    if not ended.any():
        return wanted_mm
    first = int(np.argmax(ended))
    if first >= 2:
        return float(rho[first - 2])
    if rho[first] > 2.0 * _STEP_MM:  # wide steps: look again between the axis and here
        return widest_mm(form, float(rho[first]))
    return float(rho[0] / 2.0)


def uncrossed(surfaces: Sequence[Surface], is_fixed: Sequence[bool]) -> tuple[Surface, ...]:
    """The surfaces, those with free semi-diameters cut where they would cross a neighbour."""
    result = list(surfaces)
    for i in range(1, len(result)):
        pair = result[i - 1], result[i]
        reach = min(s.semi_diameter_mm for s in pair)
        rho = _steps(reach)
        gap = heights_mm(pair[1], *_ring(rho)) - heights_mm(pair[0], *_ring(rho))
        crossed = np.min(np.where(np.isfinite(gap), gap, np.inf), axis=1) < 0.0
        first = int(np.argmax(crossed))
        if crossed.any() and first >= 3:
            for j in (i - 1, i):
                if not is_fixed[j]:
                    cut = min(result[j].semi_diameter_mm, float(rho[first - 2]))
                    result[j] = dataclasses.replace(result[j], semi_diameter_mm=cut)
    return tuple(result)


def _steps(reach_mm: float) -> np.ndarray:
    """Distances from 0 to a reach, mm, 0.05 mm apart or wider."""
    return np.linspace(0.0, reach_mm, 2 + int(min(reach_mm / _STEP_MM, _MOST_STEPS)))


def _ring(rho_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, azimuths) at distances from the axis, mm."""
    turn = 2.0 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS
    return rho_mm[:, None] * np.cos(turn), rho_mm[:, None] * np.sin(turn)

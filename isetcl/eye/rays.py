"""Bundles of traced rays and what can become of a ray."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np


class RayStatus(IntEnum):
    """What became of a ray. The same numbers are compiled into the kernels."""

    OK = 0
    MISSED = 1
    REFLECTED = 2
    STOPPED = 3
    OUTSIDE = 4
    INVALID = 5

    @property
    def meaning(self) -> str:
        """One sentence for messages."""
        return _MEANINGS[self]


_MEANINGS = {
    RayStatus.OK: "the ray passed every element",
    RayStatus.MISSED: "the ray does not cross the surface in its direction of travel",
    RayStatus.REFLECTED: "total internal reflection",
    RayStatus.STOPPED: "the ray met the opaque part of the stop",
    RayStatus.OUTSIDE: "the ray met a surface outside its semi-diameter",
    RayStatus.INVALID: "origin or direction is not finite, or the direction is zero",
}


@dataclass(frozen=True, eq=False)
class RayBundle:
    """Rays after a trace; n rays, e elements in the order the rays met them.

    Attributes
    ----------
    positions_mm : ndarray, (n, 3)
        End points, mm, eye frame: on the retina, or where a lost ray was last known.
    directions : ndarray, (n, 3)
        Unit directions there, eye frame.
    status : ndarray of uint8, (n,)
        `RayStatus` of every ray.
    surface : ndarray of int32, (n,)
        Index of the element that ended a lost ray; -1 for a ray that passed.
    elements : tuple of str
        Names of the elements, in the order the rays met them.
    opl_mm : ndarray, (n,), or None
        Optical path length from the origin, mm; None in single precision, where it would be wrong
        by 1/70 of a wavelength.
    hits_mm : ndarray, (e, n, 3), or None
        Where each ray met each element, if recorded; NaN-free: a lost ray repeats its last hit.
    """

    positions_mm: np.ndarray
    directions: np.ndarray
    status: np.ndarray
    surface: np.ndarray
    elements: tuple[str, ...]
    opl_mm: np.ndarray | None = None
    hits_mm: np.ndarray | None = None

    @property
    def passed(self) -> np.ndarray:
        """True for rays that passed every element, shape (n,)."""
        return self.status == RayStatus.OK

    def __len__(self) -> int:
        return len(self.status)

    def summary(self) -> str:
        """How many rays passed and what became of the rest, one line each."""
        lines = [f"{int(np.sum(self.passed))} of {len(self)} rays passed"]
        for status in RayStatus:
            lost = self.status == status
            if status is RayStatus.OK or not np.any(lost):
                continue
            where = np.unique(self.surface[lost])
            names = ", ".join(self.elements[i] if i >= 0 else "the start" for i in where)
            lines.append(f"{int(np.sum(lost))} at {names}: {status.meaning}")
        return "\n".join(lines)

"""Scatter inside the eye as a veil: what a glare function adds to an eye that is ray traced.

A glare function is the whole point spread function of real eyes. Its core is blur and diffraction,
which rays through a model eye make by themselves and which must not count twice. The veil is the
part beyond a window: nothing up to `window_deg[0]`, all from `window_deg[1]` on, between them the
smooth step s^2 (3 - 2 s) of s = log(angle / w0) / log(w1 / w0). The default begins at 0.1 deg,
where the CIE function begins (a model eye in focus has its light within that), and is complete at
1 deg, from where on stray light is measured. The veil takes its share `fraction` of the light; the
core keeps 1 - `fraction`.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_array,
    check_choice,
    check_pair,
    check_positive,
)
from isetcl.eye.people.glare import check_age, check_pigmentation, cie_general, vos_van_den_berg

ScatterFunction = Literal["cie_general", "vos_van_den_berg"]

_FUNCTIONS = {"cie_general": cie_general, "vos_van_den_berg": vos_van_den_berg}
_SMALLEST_WINDOW_DEG = 0.1
_HALF_SPACE_DEG = 90.0
_TABLE_NODES = 257
_NODES_IN_CELL = 12
_MAX_KERNEL_PIXELS = 4096


@dataclass(frozen=True)
class ScatterModel:
    """The veil of scattered light in an eye.

    Parameters
    ----------
    age_years
        Age, 0 to 100 years.
    pigmentation
        p, 0 (very dark) to 1.2 (light blue); `isetcl.eye.people.glare.PIGMENTATION`.
    function
        ``"cie_general"`` (CIE 146:2002) or ``"vos_van_den_berg"`` (CIE 135/1:1999).
    window_deg
        Angles at which the veil begins and is complete, degrees.

    Raises
    ------
    InvalidInputError
        If a value lies outside its range.
    """

    age_years: float = 35.0
    pigmentation: float = 0.5
    function: ScatterFunction = "cie_general"
    window_deg: tuple[float, float] = (0.1, 1.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "age_years", check_age(self.age_years))
        object.__setattr__(self, "pigmentation", check_pigmentation(self.pigmentation))
        check_choice("function", self.function, _FUNCTIONS)
        low, high = check_pair("window_deg", self.window_deg, "deg")
        if not _SMALLEST_WINDOW_DEG <= low < high < _HALF_SPACE_DEG:
            raise InvalidInputError(
                f"window_deg must be two ascending angles from {_SMALLEST_WINDOW_DEG:g} deg, where "
                f"the CIE function begins, to less than {_HALF_SPACE_DEG:g} deg, got "
                f"{self.window_deg}"
            )
        object.__setattr__(self, "window_deg", (low, high))

    def psf_per_sr(self, angle_deg: np.ndarray | float) -> np.ndarray:
        """The veil's share of the light per solid angle, 1/sr; 0 inside the window and behind."""
        angle = np.abs(check_array("angle_deg", angle_deg))
        low, high = self.window_deg
        there = (angle > low) & (angle <= _HALF_SPACE_DEG)
        safe = np.where(there, angle, high)
        step = np.clip(np.log(safe / low) / math.log(high / low), 0.0, 1.0)
        glare = _FUNCTIONS[self.function](safe, self.age_years, self.pigmentation)
        return np.where(there, step * step * (3.0 - 2.0 * step) * glare, 0.0)

    @property
    def fraction(self) -> float:
        """The share of the light that is scattered: the integral over the half space."""
        return float(self._cumulative[1][-1])

    def fraction_within(self, angle_deg: np.ndarray | float) -> np.ndarray:
        """The share of the light that is scattered by at most an angle, same shape."""
        log_angle, share = self._cumulative
        angle = np.clip(check_array("angle_deg", angle_deg), *self._limits)
        return np.interp(np.log(angle), log_angle, share)

    def angle_of(self, u: np.ndarray | float) -> np.ndarray:
        """The scatter angle in degrees below which a share u of the scattered light stays.

        u in [0, 1); uniform random u give angles distributed as the veil. The azimuth is uniform.
        Monotone; the inverse of `u_of` to rounding.
        """
        value = check_array("u", u)
        if not np.all((value >= 0.0) & (value < 1.0)):
            raise InvalidInputError("u must lie in [0, 1); pass uniform random numbers")
        log_angle, share = self._cumulative
        return np.asarray(np.exp(np.interp(value, share / share[-1], log_angle)))

    def u_of(self, angle_deg: np.ndarray | float) -> np.ndarray:
        """The share of the scattered light that stays below an angle, 0 to 1, same shape."""
        return self.fraction_within(angle_deg) / self.fraction

    def table(self) -> tuple[np.ndarray, np.ndarray]:
        """u and the angle in degrees at its nodes, (257,) each; log angle is linear between them.

        Both ascend strictly: the table that `angle_of` reads, for use on a device.
        """
        log_angle, share = self._cumulative
        return share / share[-1], np.exp(log_angle)

    def mtf(self, frequency_cpd: np.ndarray | float) -> np.ndarray:
        """The factor by which scatter lowers the modulation transfer, 1 at 0, same shape.

        1 - fraction + the transform of the veil, frequencies in cycles/degree. Scatter at the pupil
        multiplies the transfer of the optics.
        """
        frequency = check_array("frequency_cpd", frequency_cpd)
        if not np.all(np.isfinite(frequency) & (frequency >= 0.0)):
            raise InvalidInputError("frequency_cpd must be finite and >= 0 cycles/degree")
        veil = [self._transform(float(f)) for f in frequency.ravel()]
        return 1.0 - self.fraction + np.reshape(veil, frequency.shape)

    def _transform(self, frequency_cpd: float) -> float:
        if frequency_cpd == 0.0:
            return self.fraction
        low, high = self._limits
        # Steps that follow both the wave of the Bessel function and the onset of the veil.
        edges = [low]
        while edges[-1] < high:
            edges.append(edges[-1] + min(0.5 / frequency_cpd, edges[-1] / 8.0))
        return hankel(self.psf_per_sr, frequency_cpd, np.minimum(edges, high))

    def veil_kernel(self, pitch_deg: float, reach_deg: float) -> np.ndarray:
        """The veil's light on a square of samples, (n, n), n odd; sums to what is within reach.

        Parameters
        ----------
        pitch_deg
            Width of a sample, degrees.
        reach_deg
            Angle beyond which the kernel is 0, degrees; `fraction_within` tells what it keeps.

        Raises
        ------
        InvalidInputError
            If that takes more than 4096 samples across.
        """
        return radial_kernel(self.psf_per_sr, pitch_deg, reach_deg)

    def describe(self) -> dict[str, Any]:
        """Everything as plain values, for provenance."""
        return {
            "age_years": self.age_years,
            "pigmentation": self.pigmentation,
            "function": self.function,
            "window_deg": list(self.window_deg),
            "fraction": self.fraction,
        }

    @property
    def _limits(self) -> tuple[float, float]:
        return self.window_deg[0], _HALF_SPACE_DEG

    @functools.cached_property
    def _cumulative(self) -> tuple[np.ndarray, np.ndarray]:
        """Nodes of log angle (degrees), and the share scattered by at most as much, (257,) each."""
        low, high = self._limits
        edges = np.linspace(math.log(low), math.log(high), _TABLE_NODES)
        x, w = np.polynomial.legendre.leggauss(_NODES_IN_CELL)
        half = (edges[1] - edges[0]) / 2.0
        angle = np.exp((edges[:-1] + half)[:, None] + half * x)
        density = self.psf_per_sr(angle) * 2.0 * np.pi * np.sin(np.radians(angle))
        cells = np.sum(w * density * np.radians(angle), axis=1) * half
        return edges, np.concatenate([[0.0], np.cumsum(cells)])


def hankel(psf_per_sr: Any, frequency_cpd: float, edges_deg: np.ndarray) -> float:
    """The transform of a radial point spread function at a frequency in cycles/degree.

    The integral of psf(t) J0(2 pi f t) 2 pi sin t dt over the cells between ascending edges.
    """
    from scipy.special import j0

    x, w = np.polynomial.legendre.leggauss(_NODES_IN_CELL)
    half = np.diff(edges_deg)[:, None] / 2.0
    angle = edges_deg[:-1, None] + half * (1.0 + x)
    rings = psf_per_sr(angle) * 2.0 * np.pi * np.sin(np.radians(angle)) * np.radians(half)
    return float(np.sum(w * rings * j0(2.0 * np.pi * frequency_cpd * angle)))


def radial_kernel(psf_per_sr: Any, pitch_deg: float, reach_deg: float) -> np.ndarray:
    """A radial function in 1/sr, integrated over the squares of a grid, (n, n), n odd.

    The grid is flat, the angle the distance on it; squares beyond the reach are 0. Near the middle
    squares are divided more finely.
    """
    pitch = check_positive("pitch_deg", pitch_deg, "deg")
    reach = check_positive("reach_deg", reach_deg, "deg")
    half = math.floor(reach / pitch + 0.5)
    if 2 * half + 1 > _MAX_KERNEL_PIXELS:
        raise InvalidInputError(
            f"a kernel that reaches {reach:g} deg at samples of {pitch:g} deg is {2 * half + 1} "
            f"samples across, more than {_MAX_KERNEL_PIXELS}; use larger samples or less reach"
        )
    # One octant of the plane is enough: 0 <= row <= column.
    row, column = np.triu_indices(half + 1)
    near = np.hypot(row, column) < 16.0
    values = np.empty(len(row))
    for chosen, order in ((near, 16), (~near, 3)):
        x, w = np.polynomial.legendre.leggauss(order)
        dx = column[chosen, None, None] + x[None, :, None] / 2.0
        dy = row[chosen, None, None] + x[None, None, :] / 2.0
        angle = pitch * np.hypot(dx, dy)
        light = np.where(angle <= reach, psf_per_sr(np.minimum(angle, reach)), 0.0)
        values[chosen] = np.einsum("nij,i,j->n", light, w, w) / 4.0
    quadrant = np.empty((half + 1, half + 1))
    quadrant[row, column] = quadrant[column, row] = values * math.radians(pitch) ** 2
    right = np.concatenate([quadrant[:0:-1], quadrant])
    return np.concatenate([right[:, :0:-1], right], axis=1)

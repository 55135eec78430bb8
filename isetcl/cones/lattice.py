"""Lattices of cones: a start of the right density everywhere, made regular by repulsion.

The start lies on rings about the fovea, a row of hexagons apart at the local spacing, with points
at even steps of the cones counted along each: the density is that wanted from the outset, over long
distances too, which repulsion between neighbours would take thousands of steps to reach. What is
left to it is the order among neighbours.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from isetcl.cones.density import ConeDensity
from isetcl.device.lattice import LatticeKernels

ROUNDS = 12
STEPS = 6
_NOISE = 0.5  # spacings
_FULL_NOISE_FROM = 0.1  # disorder
_RADII = 2048
_AZIMUTHS = 256
_ROW = math.sqrt(0.75)  # distance of the rows of a hexagonal lattice in spacings


@dataclass(frozen=True)
class Sector:
    """A part of the retina's polar chart: distances from the fovea, mm, and azimuths, radians."""

    low_mm: float
    high_mm: float
    first_rad: float
    last_rad: float

    @property
    def is_full(self) -> bool:
        """Whether it goes all the way round."""
        return self.last_rad - self.first_rad > 2.0 * math.pi - 1e-9

    @classmethod
    def around(cls, border_mm: np.ndarray, has_fovea: bool) -> Sector:
        """The least sector that holds a region given by points of its border, (n, 2)."""
        arc = np.hypot(border_mm[:, 0], border_mm[:, 1])
        if has_fovea:
            return cls(0.0, float(arc.max()), -math.pi, math.pi)
        middle = border_mm.mean(axis=0)
        towards = math.atan2(middle[1], middle[0])
        angle = np.arctan2(border_mm[:, 1], border_mm[:, 0]) - towards
        angle = (angle + math.pi) % (2.0 * math.pi) - math.pi
        return cls(
            float(arc.min()),
            float(arc.max()),
            towards + float(angle.min()),
            towards + float(angle.max()),
        )


def rings(density: ConeDensity, sector: Sector, seed: int) -> np.ndarray:
    """Points of a sector with the wanted density, on rings about the fovea, (n, 2), mm.

    Ring k is the curve on which the rows counted outwards, the integral of dr / (s sqrt(3) / 2),
    are k + 1/2; s is the local spacing. Along it the points are s apart.
    """
    azimuth = np.linspace(sector.first_rad, sector.last_rad, _AZIMUTHS + 1)
    # Dense near the fovea, where densities change within a few spacings.
    fraction = np.linspace(0.0, 1.0, _RADII) ** 2
    radius = sector.low_mm + (sector.high_mm - sector.low_mm) * fraction
    spacing = _spacing_table(density, radius, azimuth)
    rows = np.zeros_like(spacing)
    slope = 1.0 / (_ROW * spacing)
    rows[1:] = np.cumsum(0.5 * (slope[1:] + slope[:-1]) * np.diff(radius)[:, None], axis=0)
    random = np.random.default_rng(seed)
    count = math.ceil(rows[-1].max())
    at = np.empty((count, len(azimuth)))
    local = np.empty_like(at)
    wanted = np.arange(count) + 0.5
    for j in range(len(azimuth)):
        at[:, j] = np.interp(wanted, rows[:, j], radius)
        beyond = wanted > rows[-1, j]
        at[beyond, j] += (wanted[beyond] - rows[-1, j]) * _ROW * spacing[-1, j]
        local[:, j] = np.interp(at[:, j], radius, spacing[:, j])
    return _along_rings(at, local, azimuth, sector.is_full, random)


def _along_rings(
    radius: np.ndarray,
    spacing: np.ndarray,
    azimuth: np.ndarray,
    is_full: bool,
    random: np.random.Generator,
) -> np.ndarray:
    """Points at even counts along rings given by radius and spacing at azimuths, (n, 2)."""
    per_rad = radius / spacing
    counted = np.zeros_like(per_rad)
    counted[:, 1:] = np.cumsum(
        0.5 * (per_rad[:, 1:] + per_rad[:, :-1]) * np.diff(azimuth)[None], axis=1
    )
    phase = random.uniform(size=len(radius))
    points = []
    owed = 0.0
    for k, total in enumerate(counted[:, -1]):
        if is_full:
            # Whole numbers on closed rings; what is left over goes to the next one.
            number = max(round(total + owed), 1)
            owed += total - number
            wanted = (np.arange(number) + phase[k]) * (total / number)
        else:
            wanted = np.arange(phase[k], total)
        angle = np.interp(wanted, counted[k], azimuth)
        points.append(np.interp(angle, azimuth, radius[k]) * np.exp(1j * angle))
    joined = np.concatenate(points)
    return np.stack([joined.real, joined.imag], axis=1)


def _spacing_table(density: ConeDensity, radius: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    """Spacing, mm, at (radii, azimuths)."""
    low, high = density.range_mm
    inside = np.clip(radius, low, high)
    places = inside[:, None, None] * np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1)[None]
    return density.spacing_mm(places.reshape(-1, 2)).reshape(len(radius), len(azimuth))


def relaxed(
    places_mm: np.ndarray,
    per_mm2: Callable[[np.ndarray], np.ndarray],
    is_fixed: np.ndarray,
    kernels: LatticeKernels,
    disorder: np.ndarray | float,
    seed: int,
) -> np.ndarray:
    """Points (n, 2), mm, after they have repelled each other into a lattice.

    Every point has a size, the local spacing times its own factor; sizes that differ are what makes
    the lattice as irregular as a real one. Rings are broken up first by noise of half a spacing,
    which lattices without disorder are spared.

    Parameters
    ----------
    per_mm2
        Wanted density, cones/mm^2, at places (n, 2), mm.
    is_fixed
        Points that stay where they are.
    disorder
        Standard deviation of the logarithm of the sizes' factors; one number, or one a point, (n,).
    """
    random = np.random.default_rng([seed, 1])
    draws = random.standard_normal(len(places_mm) + 1)
    # Differences of neighbours on a ring: their sum over many cones stays small, and so do the
    # fluctuations of density over more than a few cones.
    factor = np.exp(disorder * np.diff(draws) / math.sqrt(2.0))
    noise = random.standard_normal(places_mm.shape) * spacing_of(per_mm2(places_mm))[:, None]
    share = np.minimum(np.asarray(disorder) / _FULL_NOISE_FROM, 1.0)
    noise *= np.broadcast_to(_NOISE * share, len(noise))[:, None]
    noise[is_fixed] = 0.0
    return kernels.relax(
        places_mm + noise,
        lambda places: factor * spacing_of(per_mm2(places)),
        is_fixed,
        rounds=ROUNDS,
        steps=STEPS,
    )


def parted(
    places_mm: np.ndarray, least_mm: np.ndarray, is_fixed: np.ndarray, kernels: LatticeKernels
) -> np.ndarray:
    """Points (n, 2), mm, after those nearer than a distance, (n,), have been pushed apart."""
    return kernels.relax(
        places_mm,
        lambda _: least_mm,
        is_fixed,
        rounds=1,
        steps=STEPS,
        range_in_sizes=1.0,
        step=0.5,
    )


def spacing_of(per_mm2: np.ndarray) -> np.ndarray:
    """Spacing, mm, of a hexagonal lattice of a density, sqrt(2 / (sqrt(3) D)). Watson 2014, A4."""
    return np.asarray(np.sqrt(2.0 / (math.sqrt(3.0) * per_mm2)))

"""Rods in the room that cones leave them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from isetcl.cones.density import ConeDensity, DensityFunction
from isetcl.cones.lattice import Sector, relaxed, rings
from isetcl.cones.receptors import rod_intrusion
from isetcl.cones.retinal_scale import RetinalScale
from isetcl.device.lattice import LatticeKernels
from isetcl.errors import InvalidInputError

ROD_OUTER_SEGMENT_UM = 25.0
"""A round figure, the same for all rods; replace it where it matters."""

_DISC_OF_HEXAGON = math.pi / (2.0 * math.sqrt(3.0))
_LEAST_SHARE = 0.25
_LEAST_PER_MM2 = 100.0  # where fewer are wanted, there are none


def free_share(eccentricity_deg: np.ndarray) -> np.ndarray:
    """Share of the retina that is not covered by the cones' inner segments.

    Discs as wide as the cones' spacing cover pi / (2 sqrt(3)) of it; rods make them narrower.
    """
    return np.asarray(1.0 - _DISC_OF_HEXAGON * rod_intrusion(eccentricity_deg) ** 2)


def check_rods(wanted: DensityFunction, scale: RetinalScale, deg: np.ndarray) -> None:
    """Raise InvalidInputError unless rods per mm^2 are finite and >= 0 at directions (n, 2)."""
    if not callable(wanted):
        raise InvalidInputError(
            "rods must be a function of arrays (x_deg, y_deg) that returns rods per mm^2 of retina "
            f"for each, got {wanted!r}; isetcl has no rod density of its own"
        )
    _in_free_room(wanted, scale).per_mm2(scale.to_mm(deg))


def rods_between(
    cones_mm: np.ndarray,
    spacing_mm: np.ndarray,
    wanted: DensityFunction,
    scale: RetinalScale,
    sector: Sector,
    holds: Callable[[np.ndarray, float], np.ndarray],
    margin_deg: float,
    kernels: LatticeKernels,
    *,
    disorder: float,
    seed: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Places of rods, (n, 2), mm, and the room of each, (n,), mm.

    Rods are laid out with their density in the free room, those inside cones left out, and repel
    each other and the rims of the cones.

    Parameters
    ----------
    cones_mm, spacing_mm
        The cones, (m, 2), and their spacing, (m,), mm.
    wanted
        Rods per mm^2 of retina at directions (x_deg, y_deg); 0 where there are none.
    sector
        Holds the field with its margin.
    holds
        Whether directions (n, 2), degrees, lie in the field widened by a margin, degrees.
    margin_deg
        The margin within which rods are laid out; in the outer half they do not move.
    """
    density = _in_free_room(wanted, scale)
    start = rings(density, sector, seed + 1)
    deg = scale.to_deg(start)
    start = start[holds(deg, margin_deg) & _are_wanted(wanted, deg)]
    radius = 0.5 * rod_intrusion(scale.eccentricity_deg(np.hypot(*cones_mm.T))) * spacing_mm
    start = start[_room(start, cones_mm, radius) > 0]
    rims = _rims(cones_mm, radius, density.spacing_mm(cones_mm))
    is_fixed = ~holds(scale.to_deg(start), 0.5 * margin_deg)
    places = relaxed(
        np.concatenate([start, rims]),
        density.per_mm2,
        np.concatenate([is_fixed, np.ones(len(rims), dtype=bool)]),
        kernels,
        disorder,
        seed + 1,
    )[: len(start)]
    room = _room(places, cones_mm, radius)
    places, room = places[room > 0], room[room > 0]
    share = density.spacing_mm(places)
    # Where rods are few they have more than their share of room, but not inside the cones.
    return places, np.clip(room, _LEAST_SHARE * share, share)


def _in_free_room(wanted: DensityFunction, scale: RetinalScale) -> ConeDensity:
    """The density of rods where no cones are; never less than a few per mm^2."""

    def rods(x_deg: np.ndarray, y_deg: np.ndarray) -> np.ndarray:
        values = np.asarray(wanted(x_deg, y_deg), dtype=np.float64)
        # What is no number, or negative, is left to be refused.
        floored = np.where(values >= 0, np.maximum(values, _LEAST_PER_MM2), values)
        return floored / free_share(np.hypot(x_deg, y_deg))

    rods.__name__ = f"rods {getattr(wanted, '__name__', '')}".strip()
    return ConeDensity.of(rods, "right", scale)


def _are_wanted(wanted: DensityFunction, deg: np.ndarray) -> np.ndarray:
    return np.broadcast_to(np.asarray(wanted(deg[:, 0], deg[:, 1])), len(deg)) > _LEAST_PER_MM2


def _room(places_mm: np.ndarray, cones_mm: np.ndarray, radius_mm: np.ndarray) -> np.ndarray:
    """How wide a rod can be beside the nearest cones, mm; negative inside one."""
    from scipy.spatial import cKDTree

    if len(places_mm) == 0:
        return np.zeros(0)
    distance, nearest = cKDTree(cones_mm).query(places_mm, k=min(3, len(cones_mm)))
    rims = distance - radius_mm[nearest]
    return np.asarray(2.0 * rims.reshape(len(places_mm), -1).min(axis=1))


def _rims(cones_mm: np.ndarray, radius_mm: np.ndarray, rod_mm: np.ndarray) -> np.ndarray:
    """Points as far apart as rods, half a rod inside the rims of the cones, (n, 2), mm."""
    inner = np.maximum(radius_mm - 0.5 * rod_mm, 0.0)
    count = np.maximum(np.rint(2.0 * math.pi * inner / rod_mm).astype(int), 1)
    cone = np.repeat(np.arange(len(cones_mm)), count)
    number = np.arange(len(cone)) - np.repeat(np.cumsum(count) - count, count)
    angle = 2.0 * math.pi * number / count[cone] + cone
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.asarray(cones_mm[cone] + np.where(count > 1, inner, 0.0)[cone, None] * around)

"""Rods in the room that cones leave them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from isetcl.cones.density import ConeDensity, DensityFunction
from isetcl.cones.field import Field
from isetcl.cones.lattice import relaxed, rings, spacing_of
from isetcl.cones.receptors import APERTURE_TO_SPACING, rod_intrusion
from isetcl.cones.retinal_scale import RetinalScale
from isetcl.device.lattice import LatticeKernels
from isetcl.errors import InvalidInputError

ROD_OUTER_SEGMENT_UM = 25.0
"""A round figure, the same for all rods; replace it where it matters."""

ROD_DISORDER = 0.18
"""Relative spread of the rods' sizes where it is not asked for; no measurement is known."""

# Rods are 1 um wide in the fovea and 2.5 um in the far periphery (Polyak 1941).
_LEAST_ROOM_MM = 1e-3 / APERTURE_TO_SPACING
_TIMES_OUT = 3
_BEYOND_RIM = 1.05
_LEAST_FREE = 0.02
_GAPS_PER_CONE = 4.0  # rods so dense are half a cone's spacing apart, less than its gaps
_TEST_POINTS = 40_000
_TEST_BANDS = 16
_LEAST_PER_MM2 = 100.0  # where fewer are wanted, there are none


def check_rods(wanted: DensityFunction, deg: np.ndarray) -> None:
    """Raise InvalidInputError unless rods per mm^2 are finite and >= 0 at directions (n, 2)."""
    name = getattr(wanted, "__name__", type(wanted).__name__)
    try:
        values = np.asarray(wanted(deg[:, 0], deg[:, 1]), dtype=np.float64)
        values = np.broadcast_to(values, len(deg))
    except (TypeError, ValueError, ArithmeticError) as error:
        raise InvalidInputError(
            "rods must be a function of arrays (x_deg, y_deg) that returns rods per mm^2 of retina "
            f"for each; function {name} fails: {error}"
        ) from error
    bad = ~(np.isfinite(values) & (values >= 0))
    if np.any(bad):
        first = int(np.argmax(bad))
        x, y = deg[first]
        raise InvalidInputError(
            f"rods must be finite and >= 0 per mm^2 all over the field, got {values[first]:g} at "
            f"({x:.4g}, {y:.4g}) deg from function {name}; return 0 where there are none"
        )


def rods_between(
    field: Field,
    cones_mm: np.ndarray,
    wanted: DensityFunction,
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
    field
        Where: rods are laid out in its margin, too, and do not move in the outer half of it.
    cones_mm
        The cones of the field and its margin, (m, 2), mm.
    wanted
        Rods per mm^2 of retina at directions (x_deg, y_deg); 0 where there are none.
    """
    scale, spacing_mm = field.scale, field.spacing_mm(cones_mm)
    radius = 0.5 * rod_intrusion(scale.eccentricity_deg(np.hypot(*cones_mm.T))) * spacing_mm
    density = _in_free_room(wanted, scale, _share_between(field, cones_mm, radius, seed))

    def crowded(places_mm: np.ndarray) -> np.ndarray:
        # Rods farther apart than the gaps between cones are must fit into a gap all the same.
        return np.maximum(density.per_mm2(places_mm), _GAPS_PER_CONE * field.at(places_mm))

    start = rings(density, field.sector(), seed + 1)
    deg = scale.to_deg(start)
    start = start[field.holds(deg, field.margin_deg) & _are_wanted(wanted, deg)]
    start = start[_room(start, cones_mm, radius) > 0]
    if len(start) == 0:
        return start, np.zeros(0)
    rims = _rims(cones_mm, radius, spacing_of(crowded(cones_mm)))
    at_rims = crowded(rims)  # which do not move
    is_fixed = ~field.holds(scale.to_deg(start), 0.5 * field.margin_deg)
    places = relaxed(
        np.concatenate([start, rims]),
        lambda p: np.concatenate([crowded(p[: len(start)]), at_rims]),
        np.concatenate([is_fixed, np.ones(len(rims), dtype=bool)]),
        kernels,
        disorder,
        seed + 1,
    )[: len(start)]
    places = _out_of_cones(places, cones_mm, radius)
    room = _room(places, cones_mm, radius)
    places, room = places[room > 0], room[room > 0]
    if len(places) == 0:
        return places, room
    share = spacing_of(crowded(places))
    # Where rods are few they have more than their share of room, but not inside the cones.
    return places, np.clip(room, np.minimum(_LEAST_ROOM_MM, share), share)


def _out_of_cones(places_mm: np.ndarray, cones_mm: np.ndarray, radius_mm: np.ndarray) -> np.ndarray:
    """The places, those inside cones moved out over the nearest rim, unless into another cone."""
    from scipy.spatial import cKDTree

    inside = np.flatnonzero(_room(places_mm, cones_mm, radius_mm) <= 0)
    if len(inside) == 0:
        return places_mm
    moved, tree = places_mm.copy(), cKDTree(cones_mm)
    for _ in range(_TIMES_OUT):
        distance, nearest = (x.reshape(len(inside), -1) for x in tree.query(moved[inside], k=3))
        rim = radius_mm[np.minimum(nearest, len(cones_mm) - 1)]
        deepest = np.argmin(distance - rim, axis=1)[:, None]
        cone = np.take_along_axis(nearest, deepest, 1)[:, 0]
        offset = moved[inside] - cones_mm[cone]
        length = np.maximum(np.hypot(*offset.T), 1e-12)
        wanted = np.maximum(_BEYOND_RIM * radius_mm[cone], length)
        moved[inside] = cones_mm[cone] + offset * (wanted / length)[:, None]
    return moved


def _share_between(
    field: Field, cones_mm: np.ndarray, radius_mm: np.ndarray, seed: int
) -> Callable[[np.ndarray], np.ndarray]:
    """The share of the field that lies in no cone, by eccentricity in degrees: points at random.

    Cones of a disordered lattice overlap and leave more than hexagons would.
    """
    sides = np.array([field.width_deg, field.height_deg]) + 2.0 * field.margin_deg
    random = np.random.default_rng([seed, 4])
    deg = field.centre_deg + sides * random.uniform(-0.5, 0.5, (_TEST_POINTS, 2))
    ecc = np.hypot(*deg.T)
    order = np.argsort(ecc)
    is_free = _room(field.scale.to_mm(deg[order]), cones_mm, radius_mm) > 0
    bands = (_TEST_BANDS, -1)
    at, share = ecc[order].reshape(bands).mean(axis=1), is_free.reshape(bands).mean(axis=1)
    return lambda e: np.interp(e, at, np.maximum(share, _LEAST_FREE))


def _in_free_room(
    wanted: DensityFunction, scale: RetinalScale, share: Callable[[np.ndarray], np.ndarray]
) -> ConeDensity:
    """The density of rods where no cones are; never less than a few per mm^2."""

    def rods(x_deg: np.ndarray, y_deg: np.ndarray) -> np.ndarray:
        values = np.asarray(wanted(x_deg, y_deg), dtype=np.float64)
        return np.maximum(values, _LEAST_PER_MM2) / share(np.hypot(x_deg, y_deg))

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

"""Which cones are L, M and S: ratios, a centre without S cones, S cones that keep apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from isetcl.cones.receptors import ReceptorType
from isetcl.device.lattice import LatticeKernels
from isetcl.errors import InvalidInputError, check_array, check_between, check_finite

SFraction = Callable[[np.ndarray], np.ndarray]
"""Share of S cones at eccentricities in degrees."""

APART = 0.68
"""Least distance between S cones over that of a hexagonal lattice of as many.

Discs thrown at random until no more fits reach 0.547 of the plane, which is 0.777 here: the S cones
are then as irregular as random packings are. With 0.68 there are a fifth more places than needed,
so that the wanted number is met everywhere.
"""

NEAREST = 0.5
"""The least of the cones' own distances over the greatest; they are spread evenly between.

S cones of one distance lie nearly as regular as cones do (nearest-neighbour regularity 7.6); with
distances from a half of it up they are semi-regular (4.2), between that and chance (1.9).
"""

_CONES_OF_A_BAND = 150
_MOST_TRIES = 40


def check_ratios(ratios: Sequence[float]) -> tuple[float, float, float]:
    """Shares of L, M and S cones, which sum to 1; dichromats lack one of them.

    Raises
    ------
    InvalidInputError
        If they are not three numbers between 0 and 1, or do not sum to 1.
    """
    try:
        shares = tuple(check_finite("ratios", r) for r in ratios)
    except TypeError:
        shares = ()
    if len(shares) != 3:
        raise InvalidInputError(
            f"ratios must be three numbers, the shares of L, M and S cones, got {ratios!r}"
        )
    for name, share in zip("LMS", shares, strict=True):
        check_between(f"ratios ({name})", share, 0.0, 1.0)
    if abs(sum(shares) - 1.0) > 1e-6:
        scaled = ", ".join(f"{s / sum(shares):.4g}" for s in shares) if sum(shares) > 0 else ""
        hint = f"; pass ({scaled})" if scaled else ""
        raise InvalidInputError(f"ratios of L, M and S must sum to 1, got {sum(shares):g}{hint}")
    return shares


def assign_types(
    places_mm: np.ndarray,
    eccentricity_deg: np.ndarray,
    spacing_mm: np.ndarray,
    kernels: LatticeKernels,
    *,
    ratios: tuple[float, float, float],
    s_fraction: SFraction | None,
    s_free_radius_deg: float,
    seed: int,
) -> np.ndarray:
    """The type of every cone, uint8, (n,).

    S cones are taken in random order, each unless one taken before is too near, and are trimmed to
    the wanted number in bands of eccentricity. L and M are independent of their places, with the
    wanted ratio exact to half a cone.

    Parameters
    ----------
    places_mm, eccentricity_deg, spacing_mm
        Where the cones are, (n, 2) and (n,), and the local spacing of all cones, (n,).
    ratios
        Shares of L, M, S outside the centre without S cones.
    s_fraction
        The share of S cones by eccentricity instead.
    s_free_radius_deg
        Radius of that centre.
    seed
        Seed of all choices.

    Raises
    ------
    InvalidInputError
        If the share of S cones is not between 0 and 1 somewhere, or cones without a type are left.
    """
    random = np.random.default_rng([seed, 2])
    types = np.full(len(places_mm), ReceptorType.L, dtype=np.uint8)
    outside = eccentricity_deg >= s_free_radius_deg
    share = _shares(eccentricity_deg, ratios[2], s_fraction)
    share[~outside] = 0.0
    is_s = choose_s(places_mm, eccentricity_deg, spacing_mm, share, kernels, random)
    types[is_s] = ReceptorType.S
    others = np.flatnonzero(~is_s)
    if ratios[0] + ratios[1] == 0:
        if len(others) and s_fraction is None and np.any(~outside):
            raise InvalidInputError(
                f"the cones within s_free_radius_deg = {s_free_radius_deg:g} deg must be L or M, "
                f"and ratios has neither: {ratios}; pass s_free_radius_deg=0"
            )
        types[others] = ReceptorType.S
        return types
    n_m = round(len(others) * ratios[1] / (ratios[0] + ratios[1]))
    types[random.permutation(others)[:n_m]] = ReceptorType.M
    return types


def choose_s(
    places_mm: np.ndarray,
    eccentricity_deg: np.ndarray,
    spacing_mm: np.ndarray,
    share: np.ndarray,
    kernels: LatticeKernels,
    random: np.random.Generator,
) -> np.ndarray:
    """Which cones are S, (n,) bool, for a wanted share at each, (n,)."""
    is_s = np.zeros(len(places_mm), dtype=bool)
    able = np.flatnonzero(share > 0)
    if len(able) == 0:
        return is_s
    rank = random.permutation(len(able))
    by_distance = np.argsort(eccentricity_deg[able], kind="stable")
    band = np.empty(len(able), dtype=np.intp)
    band[by_distance] = np.arange(len(able)) // _CONES_OF_A_BAND
    # Whole numbers of S cones in every band; what is left over goes to the next.
    total = np.cumsum(np.bincount(band, weights=share[able]))
    wanted = np.diff(np.rint(total), prepend=0.0)
    farthest = APART * spacing_mm[able] / np.sqrt(share[able])
    distance = farthest * random.uniform(NEAREST, 1.0, len(able))
    for _ in range(_MOST_TRIES):
        chosen = kernels.choose_apart(places_mm[able], rank, distance)
        found = np.bincount(band[chosen], minlength=len(wanted))
        if np.all(found >= wanted):
            break
        # Shares too large for the distance: nearer together where they do not fit.
        distance = np.where((found < wanted)[band], 0.93 * distance, distance)
    # The first by rank in every band: those taken until the number was reached.
    candidates = np.flatnonzero(chosen)
    order = candidates[np.lexsort((rank[candidates], band[candidates]))]
    begin = np.searchsorted(band[order], band[order], side="left")
    kept = order[np.arange(len(order)) - begin < wanted[band[order]]]
    is_s[able[kept]] = True
    return is_s


def _shares(eccentricity_deg: np.ndarray, ratio: float, given: SFraction | None) -> np.ndarray:
    """The share of S cones at every cone, (n,)."""
    if given is None:
        return np.full(len(eccentricity_deg), ratio)
    values = check_array("s_fraction", given(eccentricity_deg))
    shares = np.array(np.broadcast_to(values, eccentricity_deg.shape))
    bad = ~((shares >= 0) & (shares <= 1))
    if np.any(bad):
        first = int(np.argmax(bad))
        raise InvalidInputError(
            f"s_fraction must return values between 0 and 1, got {shares[first]:g} at "
            f"{eccentricity_deg[first]:.4g} deg"
        )
    return shares

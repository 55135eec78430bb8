"""Cases 1 to 17: one surface, met in every awkward way."""

from __future__ import annotations

import dataclasses
import math
from decimal import Decimal

import numpy as np

from isetcl.eye.prescription import Element, ElementKind
from isetcl.eye.rays import RayStatus
from isetcl.validation.stability import fifty_digits
from isetcl.validation.stability.case import UM_PER_MM, Bench, case

_WIDE = 1e9


def surface(
    bench: Bench, curvature: float, conic: float, n: tuple[float, float] = (1.0, 1.4)
) -> Element:
    """A surface whose constants the kernels hold exactly, as far as they are numbers of theirs."""
    c, k = bench.number(curvature), bench.number(conic)
    before, after = (bench.number(index) for index in n)
    return Element(ElementKind.REFRACT, "surface", 0.0, c, k, _WIDE, before, after)


def error_um(
    bench: Bench, element: Element, origins: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Distance from the exact points, um (n,), infinite for rays lost by one side only; cosines.

    The exact ray starts from the numbers that the kernels hold.
    """
    origins, directions = bench.rays(origins, directions)
    got = bench.trace((element,), origins, directions)
    errors, cosines = np.zeros(len(origins)), np.ones(len(origins))
    for i, (o, d) in enumerate(zip(origins, directions, strict=True)):
        exact = fifty_digits.trace((_uniform(element),), o, d, 1)
        if (exact is not None) != bool(got.passed[i]):
            errors[i] = np.inf
        elif exact is not None:
            point = exact[0]
            parts = [float(point[j] - Decimal(got.positions_mm[i, j].item())) for j in range(3)]
            errors[i] = UM_PER_MM * math.hypot(*parts)
            slope = _slope(element, [float(v) for v in point])
            cosines[i] = abs(float(slope @ d)) / np.linalg.norm(slope) / np.linalg.norm(d)
    return errors, cosines


def _uniform(element: Element) -> Element:
    return dataclasses.replace(element, n_after=element.n_before)


def _slope(element: Element, point: list[float]) -> np.ndarray:
    c, kappa = element.curvature, 1.0 + element.conic
    return np.array([-c * point[0], -c * point[1], 1.0 - kappa * c * point[2]])


def leaning(angles_rad: np.ndarray | float, count: int | None = None) -> np.ndarray:
    """Unit directions in the x-z plane, (n, 3)."""
    angle = np.broadcast_to(angles_rad, np.shape(angles_rad) if count is None else (count,))
    return np.stack([np.sin(angle), 0.0 * angle, np.cos(angle)], axis=-1)


def _paraboloid_error(bench: Bench, tilts: list[float]) -> float:
    element = surface(bench, -1.0 / 6.0, -1.0)
    heights = np.linspace(0.1, 6.0, 40)
    worst = 0.0
    for tilt in tilts:
        origins = np.stack([heights, 0 * heights, 0 * heights - 5.0], axis=1)
        worst = max(worst, error_um(bench, element, origins, leaning(tilt, 40))[0].max())
    return worst


@case(1, "paraboloid, rays parallel to its axis", "hit", "um", single=5e-4, double=1e-12)
def _parallel(bench: Bench) -> float:
    return _paraboloid_error(bench, [0.0])


@case(2, "paraboloid, tilts of 1e-12 to 1e-2", "hit", "um", single=5e-3, double=1e-11)
def _tilted(bench: Bench) -> float:
    return _paraboloid_error(bench, [10.0**-n for n in (12, 10, 8, 7, 6, 5, 4, 3, 2)])


@case(3, "conic constants within 1e-6 and 1e-15 of -1", "continuous", "um",
      single=5e-3, double=1e-11)  # fmt: skip
def _nearly_parabolic(bench: Bench) -> float:
    heights = np.linspace(0.1, 6.0, 20)
    origins = np.stack([heights, 0 * heights, 0 * heights - 5.0], axis=1)
    worst = 0.0
    for k in (-1 - 1e-6, -1 + 1e-6, -1 - 1e-15, -1 + 1e-15):
        for tilt in (0.0, 1e-6, 0.1):
            element = surface(bench, -1.0 / 6.0, k)
            worst = max(worst, error_um(bench, element, origins, leaning(tilt, 20))[0].max())
    return worst


@case(4, "plane, incidence 0 to 89.99 deg", "hit", "um times cos I", single=3e-3, double=1e-11)
def _plane(bench: Bench) -> float:
    angles = np.radians([0.0, 30.0, 60.0, 80.0, 85.0, 89.0, 89.9, 89.99])
    directions = leaning(angles)
    origins = np.array([2.0, 1.0, 0.0]) - 3.0 * directions
    error, cosine = error_um(bench, surface(bench, 0.0, 0.0), origins, directions)
    return float(np.max(error * cosine))


@case(5, "curvatures of 1e-9, 1e-12, -1e-9 and any conic constant", "a plane within its sag", "um",
      single=3e-3, double=1e-10)  # fmt: skip
def _nearly_plane(bench: Bench) -> float:
    heights = np.linspace(-5.0, 5.0, 11)
    worst = 0.0
    for angle in (0.0, 0.7, -1.2):
        directions = leaning(angle, 11)
        origins = np.stack([heights, 0 * heights, 0 * heights], axis=1) - 3.0 * directions
        plane = bench.trace((surface(bench, 0.0, 0.0),), *bench.rays(origins, directions))
        for c in (1e-9, 1e-12, -1e-9):
            for k in (-50.0, -1.0, 0.0, 20.0):
                got = bench.trace((surface(bench, c, k),), *bench.rays(origins, directions))
                apart = np.linalg.norm(got.positions_mm - plane.positions_mm, axis=1)
                sag = abs(c) * heights**2 / 2.0 / math.cos(angle)
                worst = max(worst, float(np.max(apart - 1.001 * sag)))
    return UM_PER_MM * worst


@case(6, "conic constants -50 to 20 at 0.9 of the rim", "hit", "um", single=6e-3, double=1e-11)
def _strong_conics(bench: Bench) -> float:
    worst = 0.0
    for k in (-50.0, -7.5, 1.0, 5.0, 20.0):
        for c in (1.0 / 15.0, 0.2, -1.0 / 6.0):
            rim = min(5.0, 0.9 / (abs(c) * math.sqrt(1.0 + k))) if k > -1 else 5.0
            at = np.array([[-rim, 0, 0], [0, rim, 0], [rim, 0, 0], [0.5 * rim, 0.5 * rim, 0]])
            for angle in (0.0, 0.3, -0.6):
                directions = leaning(angle, 4)
                error, cosine = error_um(
                    bench, surface(bench, c, k), at - 3 * directions, directions
                )
                worst = max(worst, float(np.max(np.where(cosine > 0.15, error, 0.0))))
    return worst


@case(7, "sphere at its rim", "a hit on it, or a miss", "rays", single=0, double=0)
def _rim(bench: Bench) -> int:
    element = surface(bench, 0.2, 0.0)
    heights = 5.0 * np.sqrt(1.0 - 10.0 ** -np.linspace(2, 14, 49))
    origins = np.stack([heights, 0 * heights, 0 * heights - 3.0], axis=1)
    got = bench.trace((element,), *bench.rays(origins, leaning(0.0, 49)))
    off = np.abs(np.linalg.norm(got.positions_mm - [0, 0, 5.0], axis=1) - 5.0)
    # Within rounding of the rim a ray may be lost; what hits must lie on the sphere.
    wrong = got.passed & ~(off < 40 * bench.epsilon)
    wrong |= ~np.isfinite(got.positions_mm).all(axis=1) | ~np.isfinite(got.directions).all(axis=1)
    wrong |= ~got.passed & (heights < 5.0 * (1 - 20 * bench.epsilon))
    return int(wrong.sum())


@case(8, "rays just beside and just on a sphere", "miss and hit", "rays wrong", single=0, double=0)
def _just_missing(bench: Bench) -> int:
    element = surface(bench, 0.2, 0.0)
    offsets = np.concatenate([10.0 ** np.linspace(-7, -1, 31)] * 2)
    signs = np.repeat([1.0, -1.0], 31)
    heights = 5.0 * np.sqrt(1.0 + signs * offsets)
    origins = np.stack([heights, 0 * heights, 0 * heights - 3.0], axis=1)
    origins, directions = bench.rays(origins, leaning(0.0, 62))
    got = bench.trace((element,), origins, directions)
    # D = 1 - c^2 x^2 of the rounded ray; where it is within 1e-5 of 0 either may be.
    d = 1.0 - (element.curvature * origins[:, 0]) ** 2
    clear = np.abs(d) > (1e-5 if bench.precision == "single" else 1e-14)
    expected = np.where(d > 0, RayStatus.OK, RayStatus.MISSED)
    return int(np.sum(clear & (got.status != expected)))


@case(9, "a ray along the plane of the vertex", "touches it", "um", single=0.0, double=0.0)
def _tangent(bench: Bench) -> float:
    worst = 0.0
    for c in (0.125, -0.2):
        origins, directions = (
            np.array([[-1.0, 0, 0], [0, 0, 0]]),
            np.array([[1.0, 0, 0], [0, 1, 0]]),
        )
        got = bench.trace((surface(bench, c, 0.0),), origins, directions)
        if not got.passed.all():
            return math.inf
        worst = max(worst, float(np.abs(got.positions_mm).max()))
    return UM_PER_MM * worst


@case(10, "a ray parallel to a plane", "miss", "rays wrong", single=0, double=0)
def _parallel_to_plane(bench: Bench) -> int:
    origins = np.array([[0.0, 0, -1], [0, 0, 1], [1, 1, -1e-6]])
    got = bench.trace((surface(bench, 0.0, 0.0),), origins, np.tile([1.0, 0.0, 0.0], (3, 1)))
    return int(np.sum(got.status != RayStatus.MISSED) + np.sum(~np.isfinite(got.positions_mm)))


@case(11, "a plane crossed against the direction of travel", "miss", "rays wrong",
      single=0, double=0)  # fmt: skip
def _backwards(bench: Bench) -> int:
    angles = np.radians([180.0, 135.0, 95.0, 90.001])
    origins = np.tile([0.0, 0.0, 1.0], (4, 1))
    got = bench.trace((surface(bench, 0.0, 0.0),), origins, leaning(angles))
    return int(np.sum(got.status != RayStatus.MISSED))


@case(13, "grazing incidence of 85 to 89.99 deg", "an error of rounding / cos I", "um times cos I",
      single=3e-4, double=1e-12)  # fmt: skip
def _grazing(bench: Bench) -> float:
    angles = np.radians([85.0, 87.0, 88.0, 89.0, 89.5, 89.9, 89.99])
    directions = leaning(angles)
    origins = np.tile([0.0, 0.0, -0.01], (7, 1))
    # The hit may be 60 mm away: its own spacing of numbers comes on top of the conditioning.
    error, cosine = error_um(bench, surface(bench, 0.0, 0.0), origins, directions)
    return float(np.max(error * cosine))


def _critical(bench: Bench, offsets_deg: list[float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Status, error of the direction times cos I', and whether all is finite, by offset."""
    element = surface(bench, 0.0, 0.0, (1.5, 1.0))
    angles = math.asin(1.0 / 1.5) + np.radians(offsets_deg)
    directions = bench.rounded(leaning(angles))
    got = bench.trace((element,), np.tile([0.0, 0.0, -1.0], (len(angles), 1)), directions)
    scaled = np.zeros(len(angles))
    for i, d in enumerate(directions):
        exact = fifty_digits.trace((element,), [0.0, 0.0, -1.0], d, 1)
        if exact is not None and got.passed[i]:
            true = np.array([float(v) for v in exact[1]])
            scaled[i] = float(np.linalg.norm(got.directions[i] - true)) * true[2]
    return got.status, scaled, np.isfinite(got.directions).all(axis=1)


@case(14, "0.1 to 1e-4 deg inside the critical angle", "direction within rounding / cos I'",
      "rad times cos I'", single=4e-7, double=1e-15)  # fmt: skip
def _before_critical(bench: Bench) -> float:
    status, scaled, _ = _critical(bench, [-0.1, -1e-2, -1e-3, -1e-4])
    return float(scaled.max()) if np.all(status == RayStatus.OK) else math.inf


@case(15, "1e-3 deg beyond the critical angle, and within 1e-6 deg of it",
      "total reflection; either, finite", "rays wrong", single=0, double=0)  # fmt: skip
def _beyond_critical(bench: Bench) -> int:
    status, _, finite = _critical(bench, [1e-3, 1e-2, 5.0, 1e-6, -1e-6])
    either = np.isin(status[3:], (RayStatus.OK, RayStatus.REFLECTED))
    return int(np.sum(status[:3] != RayStatus.REFLECTED) + np.sum(~either) + np.sum(~finite))


@case(16, "equal indices on both sides", "undeviated, paths add up", "spacings",
      single=1.0, double=1.0)  # fmt: skip
def _equal_indices(bench: Bench) -> float:
    element = surface(bench, 0.15, -0.5, (1.376, 1.376))
    angles = np.linspace(-0.6, 0.6, 31)
    directions = bench.rounded(leaning(angles))
    got = bench.trace((element,), -3.0 * directions + [0.5, 0.3, 0.0], directions)
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    worst = float(np.abs(got.directions - unit).max()) / bench.epsilon
    if got.opl_mm is not None:
        length = np.linalg.norm(got.positions_mm - (-3.0 * directions + [0.5, 0.3, 0.0]), axis=1)
        off = np.abs(got.opl_mm - element.n_before * length) / (8.0 * bench.epsilon)
        worst = max(worst, float(off.max()))
    return worst


@case(17, "indices that differ by 1e-6", "bent by the law of sines", "rad",
      single=3e-7, double=1e-14)  # fmt: skip
def _tiny_step(bench: Bench) -> float:
    angles = np.radians([10.0, 45.0, 80.0])
    worst = 0.0
    for step in (1e-6, -1e-6):
        n, after = 1.336, 1.336 + step
        element = dataclasses.replace(surface(bench, 0.0, 0.0), n_before=n, n_after=after)
        got = bench.trace((element,), np.tile([0.0, 0.0, -1.0], (3, 1)), leaning(angles))
        found = np.arctan2(got.directions[:, 0], got.directions[:, 2])
        worst = max(worst, float(np.abs(found - np.arcsin(n * np.sin(angles) / after)).max()))
    return worst

"""Cases 29 to 33: surfaces that are no conics of revolution."""

from __future__ import annotations

import dataclasses
import math
from decimal import Decimal

import numpy as np

from isetcl.device.eye_features import EyeFeatures, ShapeKind, shape_kind
from isetcl.eye.placement import Placement
from isetcl.eye.prescription import Element, ElementKind
from isetcl.eye.rays import RayStatus
from isetcl.eye.shapes.biconic import Biconic
from isetcl.validation.stability import fifty_digits
from isetcl.validation.stability.case import UM_PER_MM, Bench, case
from isetcl.validation.stability.single_surfaces import leaning

# One kernel serves all cases.
_FEATURES = EyeFeatures(has_biconics=True, has_quadrics=True, has_placements=True)

EXTREMES = {
    "saddle": ((-1 / 9.0, 0.5), (1 / 8.0, 0.0), 4.0),
    "k = -50 and 5": ((1 / 10.0, -50.0), (1 / 10.0, 5.0), 3.5),
    "keratoconus": ((1 / 6.6, 0.2), (1 / 6.0, -0.8), 3.5),
    "lens": ((1 / 11.0, -7.5), (1 / 10.0, -3.1), 4.0),
}
"""Curvature and conic constant in x and in y, semi-diameter (NUMERICS, table of biconics)."""


def biconic(
    x: tuple[float, float], y: tuple[float, float], semi_mm: float = 1e9, bench: Bench | None = None
) -> Element:
    """A biconic of two sections (curvature, conic constant), refracting into 1.376."""
    if bench is not None:
        x, y = ((bench.number(c), bench.number(k)) for c, k in (x, y))
    kind, shape = ElementKind.REFRACT, Biconic(*x)
    return Element(kind, "biconic", 0.0, *y, semi_mm, 1.0, 1.376, shape)


def oblique(semi_mm: float, count: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """Rays towards places all over a surface, leaning by up to 0.9 rad, (n, 3) each."""
    i = np.arange(count)
    r, turn = 0.9 * semi_mm * np.sqrt((i + 0.5) / count), 2.399963 * i
    lean, way = 0.3 * (i % 4), 1.7 * i
    sine = np.sin(lean)
    directions = np.stack([sine * np.cos(way), sine * np.sin(way), np.cos(lean)], axis=1)
    at = np.stack([r * np.cos(turn), r * np.sin(turn), 0.05 * r**2], axis=1)
    return at - 4.0 * directions, directions


def _trace(bench: Bench, element: Element, rays: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Where rays meet an element, NaN for those that do not."""
    got = bench.trace((element,), *rays, features=_FEATURES)
    return np.where(got.passed[:, None], got.positions_mm, np.nan)


def _apart_um(one: np.ndarray, other: np.ndarray) -> float:
    """Largest distance, um; infinite where only one has a ray, or few are left."""
    lost = np.isnan(one[:, 0]), np.isnan(other[:, 0])
    if np.any(lost[0] != lost[1]) or np.mean(lost[0]) > 0.5:
        return math.inf
    return UM_PER_MM * float(np.nanmax(np.linalg.norm(one - other, axis=1)))


def _searched(element: Element, nudge: float) -> Element:
    """The same surface, so little altered that it is searched for as any biconic is."""
    assert isinstance(element.shape, Biconic)
    altered = Biconic(element.shape.curvature_x, element.shape.conic_x + nudge)
    found = dataclasses.replace(element, shape=altered)
    assert shape_kind(found) is ShapeKind.BICONIC
    return found


@case(
    29, "a sphere as sphere, conic and biconic", "the same points", "um", single=2e-3, double=1e-9
)
def _sphere_thrice(bench: Bench) -> float:
    c = bench.number(1 / 7.8)
    rays = bench.rays(*oblique(4.0))
    plain = Element(ElementKind.REFRACT, "sphere", 0.0, c, 0.0, 1e9, 1.0, 1.376)
    expected = _trace(bench, plain, rays)
    direct = biconic((c, 0.0), (c, 0.0))
    # 1e-14 of the conic constant moves the surface by 1e-13 um.
    others = direct, _searched(direct, 1e-14)
    return max(_apart_um(expected, _trace(bench, e, rays)) for e in others)


@case(30, "a biconic with (1 + kx) cx = (1 + ky) cy", "the quadric", "um", single=2e-3, double=1e-9)
def _matched(bench: Bench) -> float:
    element = biconic((1 / 8.5, 8.5 * 0.75 / 7.8 - 1.0), (1 / 7.8, -0.25))
    assert shape_kind(element) is ShapeKind.QUADRIC
    rays = bench.rays(*oblique(4.0))
    found = (_trace(bench, e, rays) for e in (element, _searched(element, 1e-14)))
    return _apart_um(*found)


@case(31, "a biconic turned by 90 deg", "the biconic of swapped axes", "spacings",
      single=4.0, double=4.0)  # fmt: skip
def _quarter_turn(bench: Bench) -> float:
    first = biconic((1 / 8.5, 0.3), (1 / 7.8, -0.25))
    second = biconic((1 / 7.8, -0.25), (1 / 8.5, 0.3))
    turned = dataclasses.replace(second, placement=Placement(axis_deg=90.0))
    rays = bench.rays(*oblique(4.0))
    one, other = (_trace(bench, e, rays) for e in (first, turned))
    apart = _apart_um(one, other) / UM_PER_MM
    return apart / (bench.epsilon * float(np.nanmax(np.abs(one))))


@case(
    32, "a saddle, k = -50 and 5, keratoconus", "hit", "um times cos I", single=2e-3, double=1e-11
)
def _extremes(bench: Bench) -> float:
    worst = 0.0
    for x, y, semi in EXTREMES.values():
        element = biconic(x, y, bench=bench)
        rays = bench.rays(*oblique(semi))
        got = bench.trace((element,), *rays, features=_FEATURES)
        for i, (o, d) in enumerate(zip(*rays, strict=True)):
            plain = dataclasses.replace(element, n_after=element.n_before)
            exact = fifty_digits.trace((plain,), o, d, 1)
            if exact is None or not got.passed[i]:
                return math.inf
            point = [float(v) for v in exact[0]]
            parts = [
                float(v - Decimal(w.item()))
                for v, w in zip(exact[0], got.positions_mm[i], strict=True)
            ]
            _, g = element.shape.implicit(element.curvature, element.conic, *map(np.float64, point))  # type: ignore[union-attr]
            cosine = abs(float(g @ d)) / np.linalg.norm(g)
            worst = max(worst, UM_PER_MM * math.hypot(*parts) * cosine)
    return worst


@case(33, "rays beyond the rim of a biconic", "miss", "rays wrong", single=0, double=0)
def _beyond_rim(bench: Bench) -> int:
    element = biconic((1 / 5.0, 1.0), (1 / 8.0, 0.0))
    places = np.array([[3.6, 0.0, -3], [2.6, 6.5, -3], [9.0, 9.0, -3], [2.5, 0.0, -3]])
    got = bench.trace((element,), places, leaning(0.0, 4), features=_FEATURES)
    expected = [RayStatus.MISSED] * 3 + [RayStatus.OK]
    return int(np.sum(got.status != expected) + np.sum(~np.isfinite(got.positions_mm)))

"""Rays through conics and biconics with 50 decimal digits, by textbook formulas.

Shares no code with the tracers that it judges: the roots of the quadratic in radius form, Snell's
law with the angle of incidence, and for biconics the secant method on the sag with a numerical
slope. Python's decimal numbers are the same on every machine.
"""

from __future__ import annotations

import decimal
from collections.abc import Iterable, Sequence
from decimal import Decimal

from isetcl.eye.prescription import Element
from isetcl.eye.shapes.biconic import Biconic

DIGITS = 50
_NOTHING = Decimal(10) ** -45
_STEP = Decimal(10) ** -16
Point = list[Decimal]


def trace(
    sequence: Sequence[Element],
    origin: Iterable[float | Decimal],
    direction: Iterable[float | Decimal],
    sense: int,
    *,
    nearby_mm: float | None = None,
) -> tuple[Point, Point, Decimal] | None:
    """One ray through elements in the order it meets them.

    Parameters
    ----------
    sequence
        Elements without placements; conics, planes and biconics.
    origin, direction
        Of the ray, mm, eye frame; the direction of any length.
    sense
        +1 towards the retina, -1 towards the scene.
    nearby_mm
        Length along the ray at which the search on a biconic begins; None at its vertex plane.

    Returns
    -------
    Point, unit direction and optical path length, mm; None for a ray that is lost.
    """
    with decimal.localcontext() as context:
        context.prec = DIGITS
        context.Emax, context.Emin = decimal.MAX_EMAX, decimal.MIN_EMIN
        p = [_exactly(v) for v in origin]
        d = _unit([_exactly(v) for v in direction])
        opl = Decimal(0)
        for e in sequence:
            n1, n2 = Decimal(e.n_before), Decimal(e.n_after)
            if sense < 0:
                n1, n2 = n2, n1
            local = [p[0], p[1], p[2] - Decimal(e.vertex_z_mm)]
            found = (
                _biconic(e, local, d, nearby_mm)
                if isinstance(e.shape, Biconic)
                else _conic(e, local, d, sense)
            )
            if found is None:
                return None
            t, h, g = found
            opl += n1 * t
            if _dot(h[:2], h[:2]) > Decimal(e.semi_diameter_mm) ** 2:
                return None
            p = [h[0], h[1], h[2] + Decimal(e.vertex_z_mm)]
            if n1 != n2:
                bent = _snell(d, [sense * v for v in _unit(g)], n1 / n2)
                if bent is None:
                    return None
                d = bent
        return p, d, opl


def _conic(e: Element, p: Point, d: Point, sense: int) -> tuple[Decimal, Point, Point] | None:
    """Length to a conic of revolution, the point, and its slope; the root of the sense."""
    c, k = Decimal(e.curvature), Decimal(e.conic)
    a = c * (d[0] ** 2 + d[1] ** 2 + (1 + k) * d[2] ** 2)
    b = 2 * (c * (p[0] * d[0] + p[1] * d[1] + (1 + k) * p[2] * d[2]) - d[2])
    g0 = c * (p[0] ** 2 + p[1] ** 2 + (1 + k) * p[2] ** 2) - 2 * p[2]
    if abs(a) < _NOTHING:
        roots = [-g0 / b] if b != 0 else []
    else:
        under = b * b - 4 * a * g0
        if under < 0:
            return None
        # Both roots without cancellation, for tilts of 1e-12 against the axis of a paraboloid.
        q = -(b + under.sqrt().copy_sign(b)) / 2
        roots = [q / a] if q == 0 else [q / a, g0 / q]
    for t in roots:
        h = [u + t * v for u, v in zip(p, d, strict=True)]
        g = [-c * h[0], -c * h[1], 1 - (1 + k) * c * h[2]]
        if sense * _dot(g, d) > 0:
            return t, h, g
    return None


def _biconic(
    e: Element, p: Point, d: Point, nearby_mm: float | None
) -> tuple[Decimal, Point, Point] | None:
    """The same for a biconic; None where the search fails."""
    assert isinstance(e.shape, Biconic)
    cy, ky = Decimal(e.curvature), Decimal(e.conic)
    cx, kx = Decimal(e.shape.curvature_x), Decimal(e.shape.conic_x)

    def sag(x: Decimal, y: Decimal) -> Decimal:
        under = 1 - (1 + kx) * (cx * x) ** 2 - (1 + ky) * (cy * y) ** 2
        if under < 0:
            raise ArithmeticError
        return (cx * x * x + cy * y * y) / (1 + under.sqrt())

    def above(t: Decimal) -> Decimal:
        return p[2] + t * d[2] - sag(p[0] + t * d[0], p[1] + t * d[1])

    try:
        old = -p[2] / d[2] if nearby_mm is None else Decimal(nearby_mm)
        new = old + Decimal("1e-3")
        low, high = above(old), above(new)
        for _ in range(60):
            if abs(new - old) < _NOTHING or high == low:
                break
            old, new = new, new - high * (new - old) / (high - low)
            low, high = high, above(new)
        h = [u + new * v for u, v in zip(p, d, strict=True)]
        slope_x = (sag(h[0] + _STEP, h[1]) - sag(h[0] - _STEP, h[1])) / (2 * _STEP)
        slope_y = (sag(h[0], h[1] + _STEP) - sag(h[0], h[1] - _STEP)) / (2 * _STEP)
    except ArithmeticError:
        return None
    return new, h, [-slope_x, -slope_y, Decimal(1)]


def _snell(d: Point, normal: Point, ratio: Decimal) -> Point | None:
    cosine = _dot(normal, d)
    inside = 1 - ratio**2 * (1 - cosine**2)
    if inside < 0:
        return None
    step = inside.sqrt() - ratio * cosine
    return [ratio * u + step * v for u, v in zip(d, normal, strict=True)]


def _exactly(value: float | Decimal) -> Decimal:
    return value if isinstance(value, Decimal) else Decimal(float(value))


def _dot(a: Point, b: Point) -> Decimal:
    return sum((u * v for u, v in zip(a, b, strict=True)), Decimal(0))


def _unit(v: Point) -> Point:
    length = _dot(v, v).sqrt()
    return [u / length for u in v]

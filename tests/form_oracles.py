"""Surfaces of all shapes and places at 50 digits, from textbook sags; and samples of them.

They share no code with isetcl: a root of z(t) - sag(x(t), y(t)) is found by the secant method, the
normal is a numerical derivative of the sag, and frames are turned by Rodrigues' formula.
"""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np

import isetcl as ic
from isetcl.eye.placement import Placement
from isetcl.eye.prescription import Element, ElementKind
from isetcl.eye.shapes.biconic import Biconic
from isetcl.eye.shapes.even_asphere import EvenAsphere
from isetcl.eye.shapes.height_map import HeightMap
from isetcl.eye.shapes.toric import Toric
from isetcl.eye.shapes.zernike_sag import ZernikeSag
from isetcl.eye.surface import form_sag

mp.mp.dps = 50


def mp_rotation(placement):
    """Rx Ry Rz of a placement, each by Rodrigues' formula, as rows of mpf."""
    if placement is None:
        return mp.eye(3)
    angles = (*placement.tilt_deg, placement.axis_deg)
    total = mp.eye(3)
    for axis, angle in zip(((1, 0, 0), (0, 1, 0), (0, 0, 1)), angles, strict=True):
        a = mp.radians(mp.mpf(angle))
        k = mp.matrix([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        total = total * (mp.eye(3) + mp.sin(a) * k + (1 - mp.cos(a)) * k * k)
    return total


def mp_sag(element):
    """The sag of an element in its own frame as a function of mpf x, y, in textbook radius form."""
    c, k, shape = mp.mpf(element.curvature), mp.mpf(element.conic), element.shape

    def conic(rho2, c=c, k=k):
        return c * rho2 / (1 + mp.sqrt(1 - (1 + k) * c * c * rho2))

    if shape is None:
        return lambda x, y: conic(x * x + y * y)
    if isinstance(shape, Biconic):
        cx, kx = mp.mpf(shape.curvature_x), mp.mpf(shape.conic_x)

        def biconic(x, y):
            a = (1 + kx) * cx**2 * x**2 + (1 + k) * c**2 * y**2
            return (cx * x**2 + c * y**2) / (1 + mp.sqrt(1 - a))

        return biconic
    if isinstance(shape, Toric):
        cx = mp.mpf(shape.curvature_x)

        def toric(x, y):
            arc = conic(y * y)
            if cx == 0:
                return arc
            r = 1 / cx
            # A point of the arc is |r - s| away from the axis of revolution.
            return r - mp.sign(r) * mp.sqrt((r - arc) ** 2 - x * x)

        return toric
    if isinstance(shape, EvenAsphere):
        return lambda x, y: (
            conic(x * x + y * y)
            + sum(mp.mpf(a) * (x * x + y * y) ** (i + 1) for i, a in enumerate(shape.coefficients))
        )
    if isinstance(shape, ZernikeSag):
        return lambda x, y: conic(x * x + y * y) + _zernike(shape, x, y)
    spline = _spline(shape)
    return lambda x, y: conic(x * x + y * y) + spline(x, y)


def _zernike(shape, x, y):
    """Sum of orthonormal Zernike polynomials by the factorial formula."""
    radius = mp.mpf(shape.radius_mm)
    rho, phi = mp.sqrt(x * x + y * y) / radius, mp.atan2(y, x)
    total, j = mp.mpf(0), 0
    for n in range(20):
        for m in range(-n, n + 1, 2):
            if j == len(shape.coefficients_mm):
                return total
            value = mp.mpf(0)
            for s in range((n - abs(m)) // 2 + 1):
                value += (
                    (-1) ** s
                    * mp.factorial(n - s)
                    / mp.factorial(s)
                    / mp.factorial((n + abs(m)) // 2 - s)
                    / mp.factorial((n - abs(m)) // 2 - s)
                    * rho ** (n - 2 * s)
                )
            norm = mp.sqrt((2 if m else 1) * (n + 1))
            angle = mp.cos(m * phi) if m >= 0 else mp.sin(-m * phi)
            total += mp.mpf(shape.coefficients_mm[j]) * norm * value * angle
            j += 1
    return total


def _spline(shape):
    """The interpolating cubic spline with level borders, from its own system of equations."""
    heights = shape.heights_mm[::-1]

    def solve(values):
        n = len(values)
        matrix = np.diag(np.full(n, 4.0)) + np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1)
        matrix[0, 1] = matrix[-1, -2] = 2.0
        return np.linalg.solve(matrix / 6.0, values)

    inner = solve(solve(heights).T).T
    rows, columns = heights.shape

    def kernel(u):
        u = abs(u)
        if u < 1:
            return mp.mpf(2) / 3 - u * u + u**3 / 2
        return (2 - u) ** 3 / 6 if u < 2 else mp.mpf(0)

    def mirrored(i, n):
        i = abs(i)
        return i if i < n else 2 * (n - 1) - i

    def value(x, y):
        at_x = x * (columns - 1) / mp.mpf(shape.width_mm) + mp.mpf(columns - 1) / 2
        at_y = y * (rows - 1) / mp.mpf(shape.height_mm) + mp.mpf(rows - 1) / 2
        first_x, first_y = int(mp.floor(at_x)) - 1, int(mp.floor(at_y)) - 1
        return sum(
            mp.mpf(inner[mirrored(j, rows), mirrored(i, columns)])
            * kernel(at_x - i)
            * kernel(at_y - j)
            for j in range(first_y, first_y + 4)
            for i in range(first_x, first_x + 4)
        )

    return value


def mp_cross(element, origin, direction, sense, nearby_mm):
    """Where a ray crosses a surface, and the unit normal there towards `sense`; mpf, eye frame.

    nearby_mm
        Length along the ray to a place nearby, where the search begins.
    """
    turn = mp_rotation(element.placement)
    shift = element.placement.decentre_mm if element.placement is not None else (0.0, 0.0)
    vertex = mp.matrix([mp.mpf(shift[0]), mp.mpf(shift[1]), mp.mpf(element.vertex_z_mm)])
    p, d = turn.T * (mp.matrix(origin) - vertex), turn.T * mp.matrix(direction)
    sag = mp_sag(element)
    t = mp.findroot(
        lambda t: p[2] + t * d[2] - sag(p[0] + t * d[0], p[1] + t * d[1]),
        (mp.mpf(nearby_mm), mp.mpf(nearby_mm) + mp.mpf("1e-6")),
        solver="secant",
        tol=mp.mpf(10) ** -80,
        maxsteps=60,
        verify=False,
    )
    h = p + t * d
    step = mp.mpf(10) ** -16
    slope_x = (sag(h[0] + step, h[1]) - sag(h[0] - step, h[1])) / (2 * step)
    slope_y = (sag(h[0], h[1] + step) - sag(h[0], h[1] - step)) / (2 * step)
    normal = turn * mp.matrix([-slope_x, -slope_y, mp.mpf(1)])
    normal = normal / mp.sqrt(sum(v * v for v in normal)) * sense
    return turn * h + vertex, normal, t


def mp_form_trace(sequence, origin, direction, sense, lengths_mm):
    """One ray through elements of any shape, 50 digits: (point, direction, opl).

    lengths_mm
        About how far it is from each element to the next.
    """
    p = mp.matrix([mp.mpf(float(v)) for v in origin])
    d = mp.matrix([mp.mpf(float(v)) for v in direction])
    d = d / mp.sqrt(sum(v * v for v in d))
    opl = mp.mpf(0)
    for e, length in zip(sequence, lengths_mm, strict=True):
        n1, n2 = mp.mpf(e.n_before), mp.mpf(e.n_after)
        if sense < 0:
            n1, n2 = n2, n1
        p, normal, t = mp_cross(e, p, d, sense, length)
        opl += n1 * t
        if n1 != n2:
            cosine = sum(a * b for a, b in zip(normal, d, strict=True))
            ratio = n1 / n2
            inside = 1 - ratio**2 * (1 - cosine**2)
            d = ratio * d + (mp.sqrt(inside) - ratio * cosine) * normal
    return p, d, opl


def bump_map(columns=41, rows=37):
    """A cone of 60 um beside the middle, as in keratoconus, on a map of 9 mm x 8.8 mm."""
    y, x = np.meshgrid(np.linspace(4.4, -4.4, rows), np.linspace(-4.5, 4.5, columns), indexing="ij")
    cone = -0.06 * np.exp(-((x - 1.0) ** 2 + (y + 1.2) ** 2) / (2 * 0.8**2))
    return HeightMap(cone, 9.0, 8.8)


ZERNIKES = tuple(
    np.round(1e-3 * np.sin(1.7 * np.arange(28) ** 2 + 0.3) * (np.arange(28) > 2), 7).tolist()
)

PLACE = Placement((0.3, -0.2), (5.0, -4.0), 30.0)


def surface(shape, c=1 / 7.8, k=-0.25, *, n=(1.0, 1.376), semi=4.0, place=None, z=0.0):
    """A refracting element of a shape."""
    return Element(ElementKind.REFRACT, "surface", z, c, k, semi, *n, shape, place)


SHAPES = {
    "conic": surface(None),
    "ellipsoid": surface(Biconic(1 / 8.5, 8.5 * 0.75 / 7.8 - 1.0)),
    "astigmatic": surface(Biconic(1 / 8.2, -0.1)),
    "keratoconus": surface(Biconic(1 / 6.6, 0.2), 1 / 6.0, -0.8, semi=3.5),
    "lens": surface(Biconic(1 / 11.0, -7.5), 1 / 10.0, -3.1, n=(1.3374, 1.42)),
    "extreme conics": surface(Biconic(1 / 10.0, -50.0), 1 / 10.0, 5.0, semi=3.5),
    "saddle": surface(Biconic(-1 / 9.0, 0.5), 1 / 8.0, 0.0),
    "toric": surface(Toric(1 / 8.2)),
    "cylinder": surface(Toric(0.0), 1 / 6.0, 0.0),
    "barrel": surface(Toric(-1 / 7.0), -1 / 6.0, -1.0, n=(1.42, 1.336)),
    "even asphere": surface(EvenAsphere((0.0, -2e-4, 3e-6, -1e-7))),
    "zernike": surface(ZernikeSag(ZERNIKES, 4.2)),
    "height map": surface(bump_map()),
}
"""Surfaces of all shapes."""


def rays_onto(element, fields_deg, count, sense=1.0, seed=3):
    """Rays from 8 mm before a surface towards places within its semi-diameter, (n, 3) each."""
    rng = np.random.default_rng(seed)
    origins, directions = [], []
    for field in fields_deg:
        angle = math.radians(field)
        for _ in range(count):
            turn, place = rng.uniform(0.0, 2.0 * np.pi, 2)
            across = math.sin(angle)
            d = sense * np.array(
                [across * math.cos(turn), across * math.sin(turn), math.cos(angle)]
            )
            r = 0.97 * element.semi_diameter_mm * math.sqrt(rng.uniform())
            x, y = r * math.cos(place), r * math.sin(place)
            z = form_sag(
                element.curvature, element.conic, element.shape, np.array([x]), np.array([y])
            )
            local = np.array([x, y, z[0]])
            point, _ = element.leave(local[None], local[None])
            origins.append(point[0] - 8.0 * d)
            directions.append(d)
    return np.array(origins), np.array(directions)


def irregular_eye():
    """An eye in which nothing is a surface of revolution about its axis, 550 nm; fields to 105."""
    normal = ic.eyes.navarro(6.0)
    shapes = (Biconic(1 / 7.5, -0.1), Toric(1 / 6.3), Biconic(1 / 11.0, -2.0), Biconic(-1 / 6.3))
    places = (None, Placement(axis_deg=20.0), Placement((0.1, 0.05), (3.0, -4.0)), None)
    surfaces = tuple(
        ic.Surface(s.name, s.vertex_z_mm, s.curvature, s.conic, semi, s.medium_after, f, p)
        for s, semi, f, p in zip(normal.surfaces, (5.5, 5.0, 4.4, 4.4), shapes, places, strict=True)
    )
    stop = ic.Stop(3.6, 6.0, (0.2, -0.1), 5.0, 35.0)
    retina = ic.Retina.ellipsoid(23.9, (12.2, 11.6, 11.9))
    return ic.Eye("irregular", surfaces, stop, retina)

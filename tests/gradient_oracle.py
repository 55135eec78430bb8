"""A tracer through gradient-index lenses that shares nothing with the one it judges.

The ray equation d/ds (n dr/ds) = grad n, with the arc length s, by scipy's Dormand-Prince method of
order 8, and Snell's law by angles of a plane of incidence.
"""

import numpy as np
from scipy.integrate import solve_ivp


class Poly:
    """n = sum c[i][j] z^i (x^2 + y^2)^j, term by term."""

    def __init__(self, terms):
        self.terms = terms  # {(i, j): c}

    def n(self, p):
        r2 = p[0] ** 2 + p[1] ** 2
        return sum(c * p[2] ** i * r2**j for (i, j), c in self.terms.items())

    def grad(self, p):
        r2 = p[0] ** 2 + p[1] ** 2
        along = sum(i * c * p[2] ** (i - 1) * r2**j for (i, j), c in self.terms.items() if i)
        across = sum(2 * j * c * p[2] ** i * r2 ** (j - 1) for (i, j), c in self.terms.items() if j)
        return np.array([across * p[0], across * p[1], along])


class Shells:
    """n = core - (core - edge) (zeta^2)^p about (0, 0, centre)."""

    def __init__(self, core, edge, centre, semi_z, semi_r, power):
        self.core, self.less, self.centre = core, core - edge, centre
        self.weights = np.array([semi_r**-2.0, semi_r**-2.0, semi_z**-2.0])
        self.power = power

    def n(self, p):
        q = p - [0.0, 0.0, self.centre]
        return self.core - self.less * np.sum(self.weights * q * q) ** self.power

    def grad(self, p):
        q = p - [0.0, 0.0, self.centre]
        zeta2 = np.sum(self.weights * q * q)
        return -2 * self.power * self.less * zeta2 ** (self.power - 1) * self.weights * q


class Uniform:
    """The same index everywhere."""

    def __init__(self, index):
        self.index = index

    def n(self, p):
        return self.index

    def grad(self, p):
        return np.zeros(3)


def conic(z, radius, k):
    """(S, grad S) of c (x^2 + y^2 + (1 + k) (z - z0)^2) - 2 (z - z0)."""
    c = 1.0 / radius

    def implicit(p):
        q = p - [0.0, 0.0, z]
        value = c * (q[0] ** 2 + q[1] ** 2 + (1 + k) * q[2] ** 2) - 2 * q[2]
        return value, 2 * np.array([c * q[0], c * q[1], c * (1 + k) * q[2] - 1.0])

    return implicit


def follow(medium, vertex_z, p, d, surface, next_z):
    """Point, unit direction and optical path where a ray in a medium first meets a surface."""
    frame = np.array([0.0, 0.0, vertex_z])
    u = np.concatenate([p, medium.n(p - frame) * d, [0.0]])

    def rate(_, u):
        n = medium.n(u[:3] - frame)
        return np.concatenate([u[3:6] / n, medium.grad(u[:3] - frame), [n]])

    straight = isinstance(medium, Uniform)
    # To the plane of the vertex, then Newton's method in the length of the path.
    step = (next_z - p[2]) / d[2]
    for _ in range(40):
        if straight:
            u = u + step * rate(0.0, u)
        else:
            u = solve_ivp(rate, (0.0, step), u, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
        if abs(step) < 1e-12:
            break
        value, slope = surface(u[:3])
        step = -value / (slope @ (u[3:6] / np.linalg.norm(u[3:6])))
    return u[:3], u[3:6] / np.linalg.norm(u[3:6]), u[6]


def snell(d, normal, n, n_next):
    """The refracted unit direction, by the sines of the angles."""
    normal = normal / np.linalg.norm(normal)
    normal = normal if normal @ d > 0 else -normal
    across = d - (d @ normal) * normal
    sine = np.linalg.norm(across)
    new = n / n_next * sine
    along = np.sqrt(1.0 - new**2) * normal
    return along + (across / sine * new if sine > 0 else 0.0)


def trace(surfaces, media, p, d):
    """Hits, last direction and optical path of a ray.

    surfaces: (vertex z, implicit); media: one more, in the frames of the surface before them.
    """
    hits, path, z = [], 0.0, 0.0
    d = d / np.linalg.norm(d)
    for i, (vertex_z, surface) in enumerate(surfaces):
        p, d, part = follow(media[i], z, p, d, surface, vertex_z)
        path += part
        if i + 1 < len(media):
            before = media[i].n(p - [0, 0, z])
            d = snell(d, surface(p)[1], before, media[i + 1].n(p - [0, 0, vertex_z]))
        z = vertex_z
        hits.append(p)
    return np.array(hits), d, path


def liou_brennan(wavelength_n=0.0):
    """Surfaces and media of Liou & Brennan's eye onto its retina, as published (555 nm)."""
    front = Poly({(0, 0): 1.368, (0, 1): -0.001978, (1, 0): 0.049057, (2, 0): -0.015427})
    rear = Poly({(0, 0): 1.407, (0, 1): -0.001978, (2, 0): -0.006605})
    surfaces = [
        (0.0, conic(0.0, 7.77, -0.18)),
        (0.5, conic(0.5, 6.40, -0.60)),
        (3.66, conic(3.66, 12.40, -0.94)),
        (5.25, lambda p: (p[2] - 5.25, np.array([0.0, 0.0, 1.0]))),
        (7.68, conic(7.68, -8.10, 0.96)),
        (23.95, conic(23.95, -12.0, 0.0)),
    ]
    n = [Uniform(i + wavelength_n) for i in (1.0 - wavelength_n, 1.376, 1.336, 1.336)]
    front.terms[0, 0] += wavelength_n
    rear.terms[0, 0] += wavelength_n
    return surfaces, [n[0], n[1], n[2], front, rear, n[3]]

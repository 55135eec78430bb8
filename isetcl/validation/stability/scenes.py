"""Case 25, and scenes beyond the table: bright, near, far, large, tiny, and all around."""

from __future__ import annotations

import math

import numpy as np

from isetcl.scene.edit import transformed
from isetcl.scene.material import Emission
from isetcl.scene.mesh import Mesh
from isetcl.scene.model import Disc, Quad, Scene, SceneObject, Sphere
from isetcl.units import MM_PER_M
from isetcl.validation.stability.case import Bench, case
from isetcl.validation.stability.solids import ball_mesh, look
from isetcl.validation.stability.sums import LIGHT, UNIT, film

SUN_RADIANCE = 2e7
"""Times that of a screen: 1.6e9 cd/m^2 of the solar disc against 80."""
_SUN_RADIUS_DEG = 0.266


def _facing(distance_m: float, half_deg: float, light: Emission = LIGHT) -> SceneObject:
    """A quad that fills a field of view, seen from the cornea."""
    half = distance_m * math.tan(math.radians(half_deg))
    quad = Quad((-half, -half, -distance_m), (2 * half, 0, 0), (0, 2 * half, 0))
    return SceneObject("facing", quad, light)


def _off(one: np.ndarray, other: np.ndarray) -> float:
    """Largest difference, relative to the largest value."""
    if not (np.isfinite(one).all() and np.isfinite(other).all()):
        return math.inf
    return float(np.max(np.abs(one - other)) / np.max(np.abs(other)))


@case(25, "a scene in millimetres, brought to metres", "the same image", "of the brightest pixel",
      single=1e-6, double=1e-12)  # fmt: skip
def _millimetres(bench: Bench) -> float:
    def scene(unit: float) -> Scene:
        corner = tuple(unit * np.array([-0.05, -0.03, -1.0]))
        quad = Quad(corner, (0.06 * unit, 0, 0), (0, 0.07 * unit, 0.02 * unit))
        ball = Sphere((0.03 * unit, 0.02 * unit, -0.7 * unit), 0.02 * unit)
        return Scene((SceneObject("quad", quad, LIGHT), SceneObject("ball", ball, LIGHT)))

    small = transformed(scene(MM_PER_M), "*", np.diag([1e-3, 1e-3, 1e-3, 1.0]))
    return _off(film(bench, small.objects), film(bench, scene(1.0).objects))


@case(61, "a disc 1e8 times as bright as what surrounds it", "the surroundings as without it",
      "of the surroundings", single=1e-5, double=1e-5)  # fmt: skip
def _dynamic_range(bench: Bench) -> float:
    bright = SceneObject("disc", Disc((0.03, 0.0, -1.0), 0.004), Emission(UNIT.scaled(1e8)))
    lit = film(bench, (bright,), UNIT, fov_deg=6.0, resolution=32)
    alone = film(bench, background=UNIT, fov_deg=6.0, resolution=32)
    if not (np.isfinite(lit).all() and lit.max() > 1e7 * alone.max()):
        return math.inf
    return _off(lit[:, :14], alone[:, :14])


@case(62, "the sun in the field", "its light is proportional to its radiance, and finite",
      "of the image", single=1e-6, double=1e-12)  # fmt: skip
def _sun(bench: Bench) -> tuple[float, str]:
    distance = 1.5e11
    radius = distance * math.tan(math.radians(_SUN_RADIUS_DEG))
    films = []
    for power in (1.0, SUN_RADIANCE):
        disc = Sphere((0.02 * distance, 0.01 * distance, -distance), radius)
        sun = SceneObject("sun", disc, Emission(UNIT.scaled(power)))
        films.append(film(bench, (sun,), fov_deg=4.0, resolution=32, samples=128) / power)
    # Nearly all of the light of the disc arrives: its area in pixels of the pixel's brightness.
    even = film(bench, background=UNIT, fov_deg=4.0, resolution=32, samples=128)
    area = float(np.sum(films[0] / even)) * (4.0 / 32) ** 2
    share = area / (math.pi * _SUN_RADIUS_DEG**2)
    note = f"{share:.3f} of the light of the disc arrives"
    return (_off(films[1], films[0]) if abs(share - 1.0) < 0.02 else math.inf), note


@case(63, "an object that touches the cornea", "as bright as the background", "of the irradiance",
      single=1e-6, double=1e-12)  # fmt: skip
def _touching(bench: Bench) -> float:
    even = film(bench, background=UNIT)
    wide = Quad((-0.5, -0.5, 0.0), (1, 0, 0), (0, 1, 0))
    close = film(bench, (SceneObject("touching", wide, LIGHT),))
    return _off(close, even)


@case(64, "objects at 1e9 m", "as bright as the background, and where they are",
      "of the irradiance", single=1e-6, double=1e-12)  # fmt: skip
def _very_far(bench: Bench) -> float:
    even = film(bench, background=UNIT)
    far = film(bench, (_facing(1e9, 20.0),))
    # A small square at 1e9 m and at 1e6 m: the eye is a point to both.
    one, other = (film(bench, (_facing(d, 2.0),)) for d in (1e9, 1e6))
    limit = 1e-4 if bench.precision == "single" else 1e-6
    return _off(far, even) if _off(one, other) < limit else math.inf


@case(65, "the eye inside a closed mesh", "a hit in every direction", "rays wrong",
      single=0, double=0)  # fmt: skip
def _inside_mesh(bench: Bench) -> int:
    corners, faces = np.unique(ball_mesh(3).reshape(-1, 3), axis=0, return_inverse=True)
    mesh = Mesh(2.0 * corners, faces.reshape(-1, 3))
    rng = np.random.default_rng(3)
    directions = rng.normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origins = rng.uniform(-3e-3, 3e-3, directions.shape)
    found = look(bench, [mesh], origins, directions)
    return int(np.sum(found.object != 0) + np.sum(np.abs(found.distance_m - 2.0) > 0.05))


@case(66, "a poster on a wall, in one slanted plane", "the poster is seen", "rays wrong",
      single=0, double=0)  # fmt: skip
def _poster(bench: Bench) -> int:
    rng = np.random.default_rng(11)
    wrong = 0
    for _ in range(4):
        u = np.array([1.0, 0.0, rng.uniform(-0.8, 0.8)])
        v = np.array([0.0, 1.0, rng.uniform(-0.8, 0.8)])
        middle = np.array([0.0, 0.0, -rng.uniform(0.4, 2.0)])
        poster, wall = (
            Quad(tuple(middle - s * u - s * v), tuple(2 * s * u), tuple(2 * s * v))
            for s in (0.3, 3.0)
        )
        places = rng.uniform(-0.29, 0.29, (500, 2))
        targets = middle + places[:, :1] * u + places[:, 1:] * v
        origins = rng.uniform(-2e-3, 2e-3, (500, 3))
        directions = targets - origins
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        wrong += int(np.sum(look(bench, [poster, wall], origins, directions).object != 0))
    return wrong


@case(67, "a scene 1e9 times as large", "the same image from afar", "of the brightest pixel",
      single=1e-4, double=1e-6)  # fmt: skip
def _huge(bench: Bench) -> float:
    def scene(size: float) -> tuple[SceneObject, ...]:
        quad = Quad((-6 * size, -3 * size, -100 * size), (5 * size, 0, 0), (0, 7 * size, 2 * size))
        ball = Sphere((3 * size, 2 * size, -70 * size), 2 * size)
        return SceneObject("quad", quad, LIGHT), SceneObject("ball", ball, LIGHT)

    return _off(film(bench, scene(1e12)), film(bench, scene(1e3)))


@case(68, "a ball of a micrometre before the cornea", "met where it is", "of the distance",
      single=3e-7, double=1e-15)  # fmt: skip
def _tiny(bench: Bench) -> float:
    centre = np.array([bench.number(v) for v in (1e-3, -2e-3, -5e-3)])
    radius = bench.number(1e-6)
    towards = centre + 0.5 * radius * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0.5, 0]])
    directions = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    directions = bench.rounded(directions)
    found = look(bench, [Sphere(tuple(centre), radius)], np.zeros(3), directions)
    d, c = directions.astype(np.longdouble), centre.astype(np.longdouble)
    along = d @ c / np.sum(d * d, axis=1)
    across2 = np.sum((c - along[:, None] * d) ** 2, axis=1)
    exact = along - np.sqrt(np.longdouble(radius) ** 2 - across2) / np.sqrt(np.sum(d * d, axis=1))
    return float(np.max(np.abs(found.distance_m / exact - 1.0)))

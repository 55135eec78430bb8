"""Cases 47 to 52: what rays meet in a scene."""

from __future__ import annotations

import math

import numpy as np

from isetcl.device.mesh import DeviceMesh
from isetcl.eye import catalog
from isetcl.render.device_scene import DeviceScene
from isetcl.render.plan import plan
from isetcl.render.survey import Survey, survey
from isetcl.scene.material import Emission
from isetcl.scene.mesh import Mesh
from isetcl.scene.model import Quad, Scene, SceneObject, Shape, Sphere
from isetcl.spectrum import Spectrum
from isetcl.validation.stability.case import Bench, case

LIGHT = Emission(Spectrum.constant(1.0))
# One kernel for all scenes: each has a flat, a ball and a mesh, where no ray of a case goes.
_ELSEWHERE = (
    Quad((0, 0, 2e30), (1, 0, 0), (0, 1, 0)),
    Sphere((0.0, 0.0, 3e30), 1.0),
    Mesh(np.array([[0, 0, 5.0], [1, 0, 5.0], [0, 1, 5.0]]) * 1e9, np.array([[0, 1, 2]])),
)


def ball_mesh(subdivisions: int) -> np.ndarray:
    """A closed unit ball of triangles, (n, 3, 3): an octahedron, divided and blown up.

    Corners that triangles share are the same numbers.
    """
    corners = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1.0]])
    faces = [
        (x, z, y) if (x + y + z) % 2 else (x, y, z) for x in (0, 1) for y in (2, 3) for z in (4, 5)
    ]
    triangles = corners[np.array(faces)]
    for _ in range(subdivisions):
        a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
        ab, bc, ca = (u + v for u, v in ((a, b), (b, c), (c, a)))
        ab, bc, ca = (m / np.linalg.norm(m, axis=1, keepdims=True) for m in (ab, bc, ca))
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = np.concatenate([np.stack(p, axis=1) for p in parts])
    return triangles


def look(bench: Bench, shapes: list[Shape], origins: np.ndarray, directions: np.ndarray) -> Survey:
    """What rays meet of shapes; the first of `shapes` is number 0."""
    scene = Scene(
        tuple(SceneObject(f"{i}", s, LIGHT) for i, s in enumerate([*shapes, *_ELSEWHERE]))
    )
    prepared = plan(
        scene,
        catalog.navarro(4.0),
        resolution=4,
        wavelengths_nm=np.array([550.0]),
        precision=bench.precision,
        device=bench.device.index,
        pipeline="paths",
    )
    found = survey(prepared, DeviceScene(prepared), origins, directions, with_albedo=False)
    shown = (found.object >= 0) & (found.object < len(shapes))
    return Survey(
        np.where(shown, found.distance_m, np.inf),
        np.where(shown, found.object, -1),
        found.position_m,
        found.normal,
        found.albedo,
    )


@case(47, "rays aimed at edges and corners of triangles, from 0.1 to 1e6 m", "none slips through; "
      "those without area are not met", "rays wrong", single=0, double=0)  # fmt: skip
def _watertight(bench: Bench) -> tuple[int, str]:
    unit = ball_mesh(4)
    rng = np.random.default_rng(1)
    wrong, aimed = 0, 0
    for size, shift in ((0.1, 0.0), (1.0, 0.0), (1.0, 1000.0), (1e3, 0.0), (1e6, 0.0)):
        triangles = size * unit + shift
        along = rng.random((len(unit), 1))
        targets = np.concatenate(
            [triangles[:, 0], triangles[:, 0] * (1 - along) + triangles[:, 1] * along,
             triangles[:, 1] * (1 - along) + triangles[:, 2] * along]
        )  # fmt: skip
        targets = np.concatenate([targets] * 4)
        origins = shift + size * rng.uniform(-0.4, 0.4, targets.shape)
        found = DeviceMesh(bench.device, triangles, bench.precision).trace(
            origins, targets - origins
        )
        wrong += int(np.sum(found.triangle < 0)) + int(np.sum(~np.isfinite(found.weights)))
        aimed += len(targets)
    # Multiples of 1/512: points between two of them are exact, so the triangles have no area.
    p, q = rng.integers(0, 256, size=(2, 100, 3)) / 512.0
    bare = [(p, p, p), (p, q, p), (p, q, q), (p, (p + q) / 2, q)]
    floor = np.array([[[-50, -50, -5], [50, -50, -5], [0, 80, -5.0]]])
    triangles = np.concatenate([*(np.stack(t, axis=1) for t in bare), floor])
    targets = np.concatenate([p, q, (p + q) / 2])
    down = np.tile([0.0, 0.0, -1.0], (len(targets), 1))
    found = DeviceMesh(bench.device, triangles, bench.precision).trace(targets - 3 * down, down)
    wrong += int(np.sum(found.triangle != 400)) + int(np.sum(~np.isfinite(found.distance)))
    return wrong, f"{aimed} rays at closed balls, {len(targets)} at triangles without area"


@case(48, "spheres of 1/100 to 1e-6 of their distance", "hit inside the limb, missed outside",
      "radii from the limb", single=1e-6, double=1e-9)  # fmt: skip
def _small_spheres(bench: Bench) -> tuple[float, str]:
    worst, wrong = 0.0, 0
    for ratio in (1e2, 1e4, 1e6):
        centre = np.array([bench.number(v) for v in (0.3, -0.2, -0.9)])
        radius = bench.number(np.linalg.norm(centre) / ratio)
        rng = np.random.default_rng(4)
        beside = rng.normal(size=(4000, 3))
        beside -= (beside @ centre)[:, None] * centre / (centre @ centre)
        beside /= np.linalg.norm(beside, axis=1, keepdims=True)
        targets = centre + radius * rng.uniform(0.5, 1.5, (4000, 1)) * beside
        directions = targets / np.linalg.norm(targets, axis=1, keepdims=True)
        directions = bench.rounded(directions)
        found = look(bench, [Sphere(tuple(centre), radius)], np.zeros(3), directions)
        # The distance of the line from the centre, of the rounded numbers, in 80 bits or more.
        d, c = directions.astype(np.longdouble), centre.astype(np.longdouble)
        across = np.cross(d, c) / np.sqrt(np.sum(d * d, axis=1, keepdims=True))
        impact = np.sqrt(np.sum(across**2, axis=1)) / np.longdouble(radius)
        bad = (found.object == 0) != (impact < 1)
        wrong += int(bad.sum())
        if bad.any():
            worst = max(worst, float(np.abs(impact - 1)[bad].max()))
    return worst, f"{wrong} of 12000 rays wrong"


@case(49, "rays along an axis that lie in faces of boxes", "hit, for +0 and -0", "rays wrong",
      single=0, double=0)  # fmt: skip
def _in_box_faces(bench: Bench) -> int:
    n, wrong = 6, 0
    corner = np.stack(np.meshgrid(np.arange(n), np.arange(n)), axis=-1).reshape(-1, 2) - n / 2
    square = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], dtype=float)
    flat = (corner[:, None, None] + square[None]).reshape(-1, 3, 2)
    lattice = np.stack(np.meshgrid(np.arange(-2, 3), np.arange(-2, 3)), axis=-1).reshape(-1, 2)
    for axis in range(3):
        mesh = DeviceMesh(bench.device, np.insert(flat, axis, 0.0, axis=2), bench.precision)
        for sign in (-1.0, 1.0):
            for nothing in (0.0, -0.0):
                origins = np.insert(lattice.astype(float), axis, -sign * 2.0, axis=1)
                direction = np.full(3, nothing)
                direction[axis] = sign
                found = mesh.trace(origins, np.tile(direction, (len(origins), 1)))
                wrong += int(np.sum(np.abs(found.distance - 2.0) > 1e-6))
    return wrong


@case(50, "a box without thickness, rays from its plane", "none missed, no NaN", "rays wrong",
      single=0, double=0)  # fmt: skip
def _flat_box(bench: Bench) -> int:
    rng = np.random.default_rng(6)
    triangles = np.insert(rng.uniform(-1, 1, (400, 3, 2)), 2, 0.25, axis=2)
    plate = np.array([[[-4, -4], [4, -4], [4, 4]], [[-4, -4], [4, 4], [-4, 4]]], dtype=float)
    triangles = np.concatenate([triangles, np.insert(plate, 2, 0.25, axis=2)])
    mesh = DeviceMesh(bench.device, triangles, bench.precision)
    inside = np.insert(rng.uniform(-1, 1, (200, 2)), 2, 0.25, axis=1)
    level = np.insert(rng.normal(size=(200, 2)), 2, 0.0, axis=1)
    lying = mesh.trace(inside, level)
    wrong = int(np.sum(np.isnan(lying.distance)) + np.sum(~np.isfinite(lying.weights)))
    steep = np.append(rng.normal(size=(200, 2)), np.ones((200, 1)), axis=1)
    above = mesh.trace(inside - steep, steep)
    return wrong + int(np.sum(np.abs(above.distance - 1.0) > 1e-5))


@case(51, "ground seen to 1e6 m and at the horizon", "distance as far as the slope allows; level "
      "rays miss", "of the distance", single=3e-7, double=1e-12)  # fmt: skip
def _ground(bench: Bench) -> float:
    far, depth = 1e9, bench.number(1.6)
    ground = Quad((-far, -depth, far), (2 * far, 0, 0), (0, 0, -2 * far))
    slopes = np.array([1.6e-6, 1e-7, 1e-3, 0.1])
    directions = np.stack([0 * slopes, -slopes, -np.sqrt(1 - slopes**2)], axis=1)
    directions = bench.rounded(directions)
    level = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.6, 0.0, -0.8]])
    found = look(bench, [ground], np.zeros(3), np.concatenate([directions, level]))
    if np.any(found.object[4:] >= 0) or not np.isfinite(found.distance_m[:4]).all():
        return math.inf
    return float(np.max(np.abs(found.distance_m[:4] * -directions[:, 1] / depth - 1.0)))


@case(52, "eye inside a sphere of 1 km; quads in one plane", "met at 1 km; the first wins",
      "rays wrong", single=0, double=0)  # fmt: skip
def _inside_and_coincident(bench: Bench) -> int:
    rng = np.random.default_rng(2)
    directions = rng.normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    around = look(bench, [Sphere((0.0, 0.0, 0.0), 1000.0)], np.zeros(3), directions)
    wrong = int(np.sum(np.abs(around.distance_m - 1000.0) > 1e-3))
    wall = Quad((-1, -1, -2), (2, 0, 0.3), (0, 2, 0.1))
    towards = np.array([0.0, 0.0, -1.0]) + rng.uniform(-0.2, 0.2, (500, 3)) * [1, 1, 0]
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    same = look(bench, [wall, wall, wall], np.zeros(3), towards)
    return wrong + int(np.sum(same.object != 0))

"""The records of lights: everything with a place or a picture of its own, chosen by power."""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np

from isetcl.device.layout import Member, Struct
from isetcl.render.pack_looks import Looks
from isetcl.scene.light import DistantLight, Environment, Light, SpotLight, light_spectrum
from isetcl.scene.mesh import Instance, Mesh
from isetcl.scene.model import Disc, Quad, Scene, SceneObject, Sphere
from isetcl.spectrum import Spectrum

EVEN_SKY = 1e-4
"""Part of the choice among directions of a picture all around that is even."""

EVEN_SHARE = 0.1
"""Part of the choice among lights that is even, so that none is starved where power misleads."""


CHOICES = 1 << 24
"""Numbers by which a light or a texel is chosen."""


class LightKind(IntEnum):
    """What a light is. The same numbers are compiled into the kernels."""

    OBJECT = 0
    POINT = 1
    DISTANT = 2
    SPOT = 3
    ENVIRONMENT = 4


LIGHT = Struct(
    "light_t",
    (
        Member("kind", "int"),
        Member("object", "int"),
        Member("triangle", "int"),
        Member("row", "int"),
        Member("probability"),
        Member("cumulative"),
        Member("versed_outer"),
        Member("inverse_penumbra"),
        Member("place", length=3),
        Member("axis", length=3),
    ),
)


def pack_lights(
    scene: Scene,
    looks: Looks,
    objects: np.ndarray,
    world: np.ndarray,
    triangles: np.ndarray,
    owner: np.ndarray,
) -> np.ndarray:
    """Lights with their probabilities; fills in the densities of `objects` and `world`.

    Nothing is a light where nothing scatters, since then no light is asked.

    Parameters
    ----------
    triangles, owner
        Triangles in place, (n, 3, 3), and the numbers of the objects they belong to.
    """
    dtype = LIGHT.dtype("double")
    if not scene.has_reflection:
        return np.zeros(0, dtype=dtype)
    surfaces, areas = _surface_lights(scene, triangles, owner)
    reach = _reach(scene, triangles)
    powers = [power for power, _, _ in surfaces]
    powers += [_power(light, reach) for light in scene.lights]
    environment = isinstance(scene.background, Environment) and scene.background.texture is not None
    if environment:
        powers.append(_environment_power(scene.background, reach))  # type: ignore[arg-type]
    # Triangles of one object are chosen by their area.
    groups = [i for _, i, _ in surfaces]
    groups += range(len(scene.objects), len(scene.objects) + len(powers) - len(surfaces))
    chances = _probabilities(np.array(powers, dtype=np.float64), np.array(groups, dtype=int))
    lights = np.zeros(len(powers), dtype=dtype)
    if not len(lights):
        return lights
    lights["cumulative"] = in_steps(np.cumsum(chances))
    lights["probability"] = np.diff(lights["cumulative"], prepend=0.0)
    for record, (_, i, triangle) in zip(lights, surfaces, strict=False):
        record["kind"], record["object"], record["triangle"] = LightKind.OBJECT, i, triangle
    for record, light in zip(lights[len(surfaces) :], scene.lights, strict=False):
        _small_light(record, light, looks)
    _fill_densities(objects, lights[: len(surfaces)], areas)
    if environment:
        lights[-1]["kind"] = LightKind.ENVIRONMENT
        _environment_tables(scene.background, looks, world, lights[-1]["probability"])  # type: ignore[arg-type]
    return lights.astype(
        LIGHT.dtype("single" if objects["opacity"].dtype.itemsize == 4 else "double")
    )


def in_steps(cumulative: np.ndarray) -> np.ndarray:
    """Sums of chances, the last 1, as the numbers that choose can tell them apart.

    Those have 24 binary digits; what is chosen is then weighed by the chance it truly had. No sum
    is rounded to the one before it while there is room for all.
    """
    steps = np.rint(cumulative / cumulative[..., -1:] * CHOICES).astype(np.int64)
    count = steps.shape[-1]
    if count < CHOICES // 16:
        number = np.arange(count)
        steps = np.maximum.accumulate(np.maximum(steps - number, 1), axis=-1) + number
        steps = np.minimum(steps, CHOICES - (count - 1 - number))
    return steps / CHOICES


def _probabilities(powers: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Chances of lights by their power, no group having less than an even share of EVEN_SHARE."""
    if not len(powers) or not powers.sum() > 0:
        return np.full(len(powers), 1.0 / max(1, len(powers)))
    _, number = np.unique(groups, return_inverse=True)
    of_group = np.bincount(number, powers)
    even = EVEN_SHARE / len(of_group)
    chance = (1.0 - EVEN_SHARE) * of_group / of_group.sum() + even
    within = np.where(of_group[number] > 0, powers / np.maximum(of_group[number], 1e-300), 0.0)
    alone = of_group[number] == 0
    within = np.where(alone, 1.0 / np.bincount(number)[number], within)
    return chance[number] * within


def _mean(spectra: tuple[Spectrum, ...], weight: float) -> float:
    """Mean of spectra over their own wavelengths, for choosing lights only."""
    return weight * float(sum(np.mean(s.values) for s in spectra))


def _surface_lights(
    scene: Scene, triangles: np.ndarray, owner: np.ndarray
) -> tuple[list[tuple[float, int, int]], dict[int, float]]:
    """Power, object and triangle (or -1) of every surface that shines, and areas of objects."""
    entries: list[tuple[float, int, int]] = []
    areas: dict[int, float] = {}
    for i, item in enumerate(scene.objects):
        emitted = item.emitted
        if emitted is None:
            continue
        weight = 1.0 if emitted.texture is None else emitted.texture.mean
        weight *= item.opacity if isinstance(item.opacity, (int, float)) else item.opacity.mean
        power = math.pi * _mean(emitted.spectra(), weight)
        if not power > 0:
            continue
        if isinstance(item.shape, (Mesh, Instance)):
            numbers = np.flatnonzero(owner == i)
            a, b, c = (triangles[numbers, k] for k in range(3))
            area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0
            if not area.sum() > 0:
                continue
            entries += [
                (power * float(s), i, int(n)) for s, n in zip(area, numbers, strict=True) if s > 0
            ]
            areas[i] = float(area.sum())
        else:
            areas[i] = _area(item.shape)
            entries.append((power * areas[i], i, -1))
    return entries, areas


def _fill_densities(objects: np.ndarray, lights: np.ndarray, areas: dict[int, float]) -> None:
    """Per object the density, per area, of choosing a place on it; of a ball its probability."""
    for i, area in areas.items():
        own = lights["object"] == i
        share = float(lights["probability"][own].sum())
        is_ball = lights["triangle"][own][0] < 0 and objects[i]["kind"] == 1
        objects[i]["density"] = share if is_ball else share / area


def _small_light(record: np.void, light: Light, looks: Looks) -> None:
    record["row"] = looks.rows((light_spectrum(light),))
    if isinstance(light, DistantLight):
        record["kind"] = LightKind.DISTANT
        record["place"] = np.array(light.towards) / np.linalg.norm(light.towards)
        return
    record["kind"], record["place"] = LightKind.POINT, light.position_m
    if isinstance(light, SpotLight):
        record["kind"] = LightKind.SPOT
        record["axis"] = np.array(light.direction) / np.linalg.norm(light.direction)
        outer = _versed(light.cone_deg)
        inner = _versed(light.cone_deg - light.penumbra_deg)
        record["versed_outer"] = outer
        # A sharp edge is a very narrow penumbra.
        record["inverse_penumbra"] = 1.0 / max(outer - inner, 1e-6 * outer)


def _versed(angle_deg: float) -> float:
    """1 - cos of an angle, without cancellation."""
    return 2.0 * math.sin(math.radians(angle_deg) / 2.0) ** 2


def _environment_tables(
    environment: Environment, looks: Looks, world: np.ndarray, probability: float
) -> None:
    """Shares of texels by the light they send, and their sums over rows and columns."""
    assert environment.texture is not None
    light = _light_of_texels(environment)
    rows, columns = light.shape
    cosine = np.cos(np.pi * ((np.arange(rows) + 0.5) / rows - 0.5))[:, None]
    shares = light * cosine
    even = np.broadcast_to(cosine / (columns * cosine.sum()), shares.shape)
    total = shares.sum()
    shares = (1.0 - EVEN_SKY) * shares / total + EVEN_SKY * even if total > 0 else even
    of_rows = in_steps(np.cumsum(shares.sum(axis=1)))
    of_columns = in_steps(np.cumsum(shares, axis=1))
    drawn = np.diff(of_rows, prepend=0.0)[:, None] * np.diff(of_columns, axis=1, prepend=0.0)
    world["environment_rows"], world["environment_columns"] = rows, columns
    world["environment_shares"] = looks.table(drawn)
    world["environment_rows_sum"] = looks.table(of_rows)
    world["environment_columns_sum"] = looks.table(of_columns)
    world["environment_probability"] = probability


def _light_of_texels(environment: Environment) -> np.ndarray:
    """Mean light of the parts of the sky as large as texels, (rows, columns).

    Between the centres of texels pictures are bilinear: the mean of a quarter of a texel is the
    value in its middle.
    """
    picture = environment.texture
    assert picture is not None
    rows, columns = picture.shape
    u = (np.arange(2 * columns) + 0.5) / (2 * columns)
    v = 1.0 - (np.arange(2 * rows) + 0.5) / (2 * rows)
    level = np.array([np.mean(s.values) for s in environment.spectra()])
    light = np.empty((rows, columns))
    # Row by row of texels, since the weights of all channels take much memory.
    for row in range(rows):
        quarters = picture.weights(*np.meshgrid(u, v[2 * row : 2 * row + 2])) @ level
        light[row] = quarters.reshape(2, columns, 2).mean(axis=(0, 2))
    return light


def _reach(scene: Scene, triangles: np.ndarray) -> float:
    """Radius of a ball around everything in a scene, metres."""
    corners = [triangles.reshape(-1, 3)] if len(triangles) else []
    for item in scene.objects:
        corners.append(_corners(item))
    points = np.concatenate(corners) if corners else np.zeros((1, 3))
    return max(float(np.linalg.norm(points.max(axis=0) - points.min(axis=0))) / 2.0, 1e-6)


def _corners(item: SceneObject) -> np.ndarray:
    """Points that span an object, (n, 3)."""
    shape = item.shape
    if isinstance(shape, Sphere):
        centre = np.array(shape.centre_m)
        return np.array([centre - shape.radius_m, centre + shape.radius_m])
    if isinstance(shape, Instance):
        lo, hi = shape.mesh.vertices_m.min(axis=0), shape.mesh.vertices_m.max(axis=0)
        box = np.array(np.meshgrid(*zip(lo, hi, strict=True))).reshape(3, -1).T
        return box @ shape.matrix[:3, :3].T + shape.matrix[:3, 3]
    if isinstance(shape, Mesh):
        return np.array([shape.vertices_m.min(axis=0), shape.vertices_m.max(axis=0)])
    quad = shape.bounding_quad() if isinstance(shape, Disc) else shape
    corner, u, v = (np.array(x) for x in (quad.corner_m, quad.edge_u_m, quad.edge_v_m))
    return np.array([corner, corner + u, corner + v, corner + u + v])


def _power(light: Light, reach_m: float) -> float:
    """Power of a light without a surface, for choosing lights."""
    mean = _mean((light_spectrum(light),), 1.0)
    if isinstance(light, DistantLight):
        return math.pi * reach_m**2 * mean
    if isinstance(light, SpotLight):
        return 2.0 * math.pi * (1.0 - math.cos(math.radians(light.cone_deg))) * mean
    return 4.0 * math.pi * mean


def _environment_power(environment: Environment, reach_m: float) -> float:
    assert environment.texture is not None
    texels = environment.texture.texels
    mean = texels.reshape(-1, environment.texture.channels).mean(axis=0)
    level = float(
        sum(m * np.mean(s.values) for m, s in zip(mean, environment.spectra(), strict=True))
    )
    return 4.0 * math.pi**2 * reach_m**2 * level


def _area(shape: Quad | Disc | Sphere) -> float:
    """Area of a shape, m^2."""
    if isinstance(shape, Sphere):
        return float(4.0 * np.pi * shape.radius_m**2)
    if isinstance(shape, Disc):
        return float(np.pi * shape.radius_m**2)
    return float(np.linalg.norm(np.cross(shape.edge_u_m, shape.edge_v_m)))

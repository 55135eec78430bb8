"""Instances of meshes: the same images as the meshes in place, at a fraction of the memory."""

import dataclasses

import numpy as np
import pytest
import trimesh
from path_views import (
    EYE,
    HALF,
    ONE,
    PINHOLE,
    UNIT,
    chief_rays,
    pixels_of,
    placed,
    quad_mesh,
    radiance_of,
)
from slow_cases import slow_after

import isetcl as ic
from isetcl.device.choose import find_device
from isetcl.render import pack_paths
from isetcl.render.trees import SceneTrees
from isetcl.scene.view import nearest_distance_m

pytestmark = pytest.mark.usefixtures("shared_kernels")


def ball_mesh(subdivisions=2, *, smooth=False, uv=False):
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    v = np.asarray(ball.vertices)
    coordinates = np.column_stack([v[:, 0] * 2 + 0.3, v[:, 1] * 3]) if uv else None
    return ic.Mesh(v, ball.faces, np.array(ball.vertex_normals) if smooth else None, coordinates)


MAPS = {
    "moved": placed(0.04, at=(0.01, 0.0, -1)),
    "turned": placed(0.05, 40.0, (1, 2, 3), (0.0, 0.01, -1)),
    "squeezed": placed((0.06, 0.02, 0.09), 70.0, (3, 1, 0), (0.0, 0.0, -1)),
    "mirrored": placed((-0.05, 0.05, 0.03), 25.0, (0, 1, 1), (0.0, 0.0, -1)),
}
PATTERN = ic.Diffuse(UNIT.scaled(0.9), ic.Checkerboard(2, 2, 1.0, 0.2))
GLASS = ic.Dielectric(ic.Medium("glass", ic.ConstantIndex(1.5)))
LOOKS = {
    "matt": (ball_mesh(), HALF),
    "smooth": (ball_mesh(smooth=True), HALF),
    "painted": (ball_mesh(uv=True), PATTERN),
    "glass": (ball_mesh(smooth=True), GLASS),
    "shining": (ball_mesh(uv=True), ic.Emission(UNIT, ic.Checkerboard(1, 1), sides="front")),
}
# One light: the choice among several depends on how tightly the scene's extent is estimated.
LIGHTS = (ic.PointLight((-0.5, 0.3, 0.2), UNIT),)
FLOOR = ic.SceneObject("floor", ic.Quad((-2, -0.06, -3), (0, 0, 4), (4, 0, 0)), HALF)


@pytest.mark.slow
@pytest.mark.parametrize("look", LOOKS)
@pytest.mark.parametrize("where", MAPS)
def test_an_instance_is_the_mesh_in_place(where, look):
    mesh, material = LOOKS[look]
    instance = ic.Instance(mesh, MAPS[where])
    in_place = instance.in_place
    if mesh.normals is not None:
        # Interpolated before they are turned, normals keep their lengths.
        normals = mesh.normals @ np.linalg.inv(instance.matrix[:3, :3])
        in_place = dataclasses.replace(in_place, normals=normals)
    images = []
    for shape in (instance, in_place):
        scene = ic.Scene(
            (ic.SceneObject("it", shape, material), FLOOR), UNIT.scaled(0.2), lights=LIGHTS
        )
        images.append(pixels_of(scene, fov_deg=8.0, resolution=12, spp=16, max_bounces=6)[0])
    off = np.abs(images[0] - images[1]) / images[1].max()
    # A few paths meet an edge on the other side of rounding.
    assert np.median(off) < 1e-5
    assert np.mean(off > 1e-3) < 0.15
    assert images[0].mean() == pytest.approx(images[1].mean(), rel=3e-3)


@pytest.mark.parametrize("determinant", slow_after(1, [-1, 1]))
def test_glass_is_inside_an_instance_however_it_is_mirrored(determinant):
    """A lossless body under an even sky is unseen only if its inside is where its index is."""
    matrix = placed((0.05 * determinant, 0.05, 0.05), at=(0, 0, -0.5))
    body = ic.SceneObject("body", ic.Instance(ball_mesh(), matrix), GLASS)
    found, error = radiance_of(ic.Scene((body,), UNIT), fov_deg=8.0, max_bounces=100)
    assert found == pytest.approx(1.0, abs=4 * error + 2e-4)


def forest(count, seed=0):
    """Trees all over the view, (count, 4, 4)."""
    rng = np.random.default_rng(seed)
    return [
        placed(
            rng.uniform(0.02, 0.08, 3) * rng.choice([-1, 1], 3),
            rng.uniform(0, 360),
            rng.normal(size=3),
            (*rng.uniform(-0.8, 0.8, 2), rng.uniform(-4, -1)),
        )
        for _ in range(count)
    ]


@pytest.mark.slow
def test_a_thousand_instances_are_the_flattened_forest():
    mesh = ball_mesh(1)
    maps = forest(1000)
    scattered = [
        ic.SceneObject(f"tree {i}", ic.Instance(mesh, m), HALF) for i, m in enumerate(maps)
    ]
    flat = trimesh.util.concatenate(
        [trimesh.Trimesh(*_moved(mesh, m), process=False) for m in maps]
    )
    whole = ic.SceneObject("forest", ic.Mesh(flat.vertices, flat.faces), HALF)
    where = {"fov_deg": 20.0, "resolution": 16, "spp": 8, "max_bounces": 4}
    images = [
        pixels_of(ic.Scene(objects, UNIT.scaled(0.3), lights=LIGHTS), **where)[0]
        for objects in (tuple(scattered), (whole,))
    ]
    off = np.abs(images[0] - images[1]) / images[1].max()
    assert np.median(off) < 1e-5
    assert np.mean(off > 1e-3) < 0.1


def _moved(mesh, matrix):
    moved = mesh.moved(matrix)
    return moved.vertices_m, moved.faces


def packed(scene, precision="single"):
    prepared = ic.plan(scene, EYE, precision=precision, **ONE)
    return pack_paths.pack_paths(
        scene, prepared.images, prepared.wavelengths_nm, prepared.band_choice.bands, precision
    )


def test_memory_grows_by_instances_not_by_triangles():
    mesh = ball_mesh(4)
    sizes = []
    for count in (8, 800):
        objects = tuple(
            ic.SceneObject(f"tree {i}", ic.Instance(mesh, m), HALF)
            for i, m in enumerate(forest(count))
        )
        scene = packed(ic.Scene(objects, UNIT))
        assert len(scene.triangles) == len(mesh.faces)
        trees = SceneTrees(find_device(), scene, "single")
        sizes.append(trees.nodes.size + trees.blocks.size + trees.instances.nbytes)
    triangle = trees.blocks.size / len(mesh.faces)
    assert (sizes[1] - sizes[0]) / 792 < 8 * triangle


@pytest.mark.parametrize("precision", ["single", pytest.param("double", marks=pytest.mark.slow)])
def test_a_room_of_one_instance_has_no_leaks(precision):
    """Black inside, light outside: not one path gets out through an edge or a corner."""
    room = ic.Mesh(*_moved(ball_mesh(3), np.eye(4)))
    matrix = placed((2.0, 0.7, -1.3), 33.0, (1, 1, 2), (0.2, -0.1, -0.3))
    black = ic.Diffuse(UNIT.scaled(0.0))
    scene = ic.Scene((ic.SceneObject("room", ic.Instance(room, matrix), black),), UNIT.scaled(1e6))
    with pytest.warns(UserWarning, match="no light"):
        found, _ = pixels_of(scene, fov_deg=60.0, resolution=32, spp=64, precision=precision)
    assert found.max() == 0.0


@pytest.mark.parametrize("offset", [0.0, 1000.0])
def test_the_frame_of_a_mesh_costs_no_precision(offset):
    """A wall modelled a kilometre away and brought here: lit evenly, not shadowed by itself."""
    away = (offset, -2 * offset, 3 * offset)
    wall = quad_mesh(ic.Quad((-1 + away[0], -1 + away[1], away[2]), (2, 0, 0), (0, 2, 0)), steps=4)
    turn = placed(1.0, 37.0, (1, 3, 0))
    matrix = turn @ placed(at=-np.array(away))
    matrix[:3, 3] += (0.0, 0.0, -1.0)
    scene = ic.Scene((ic.SceneObject("wall", ic.Instance(wall, matrix), HALF),), UNIT)
    assert radiance_of(scene, fov_deg=20.0, spp=16)[0] == pytest.approx(0.5, rel=2e-3)


TILT = placed(1.0, 33.0, (3, 1, 2))[:3, :3]


@pytest.mark.parametrize("size", slow_after(1, [1e4, 10.0, 1e7]))
@pytest.mark.parametrize("kind", ["quad", "disc", "mesh", "instance", "sphere"])
def test_surfaces_do_not_shadow_themselves_however_large_they_are(size, kind):
    """A tilted plane 1.5 m below the eye, or a ball so far below, under an even sky."""
    normal = TILT @ np.array([0.0, 0.0, 1.0])
    u, v = TILT[:, 0] * size, TILT[:, 1] * size
    point = -1.5 * normal
    quad = ic.Quad(tuple(point - 0.53 * u - 0.47 * v), tuple(u), tuple(v))
    mesh = quad_mesh(quad)
    shape = {
        "quad": quad,
        "disc": ic.Disc(tuple(point), size, tuple(normal)),
        "mesh": mesh,
        "instance": ic.Instance(mesh, np.eye(4)),
        "sphere": ic.Sphere(tuple(-(1.5 + size) * normal), size),
    }[kind]
    # A lamp, too small to matter, brings shadow rays in.
    lamp = ic.DistantLight(tuple(normal), UNIT)
    scene = ic.Scene((ic.SceneObject("ground", shape, HALF),), None, lights=(lamp,))
    look = -normal + 0.2 * TILT[:, 0]
    scene = scene.seen_from((0, 0, 0), tuple(look))
    # A ball that large is followed in double precision unless single is asked for.
    precision = "double" if kind == "sphere" and size > 1e6 else "single"
    found, _ = pixels_of(
        scene, fov_deg=8.0, resolution=8, spp=16, max_bounces=1, precision=precision
    )
    tolerance = 2e-3 if size < 1e6 or kind in ("quad", "disc") else 0.05
    np.testing.assert_allclose(found, 0.5 / np.pi, rtol=tolerance)


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["single", pytest.param("double", marks=pytest.mark.slow)])
def test_pixels_look_at_what_rays_meet_on_the_host(precision):
    """Dark instances among bodies of different light, by chief rays."""
    mesh = ball_mesh(1)
    bodies = (
        ic.Sphere((0.2, 0.1, -2), 0.1),
        ic.Disc((-0.2, 0.1, -2), 0.15, (1, 0, 2)),
        mesh.moved(placed(0.1, at=(0, -0.3, -1.5))),
        ic.Quad((-0.5, 0.2, -1.5), (0.4, 0, 0), (0, 0.2, 0.1)),
    )
    level = 0.1 + 0.2 * np.arange(4)
    lit = [
        ic.SceneObject(f"body {i}", body, ic.Emission(UNIT.scaled(float(level[i]))))
        for i, body in enumerate(bodies)
    ]
    dark = [
        ic.SceneObject(f"tree {i}", ic.Instance(mesh, m), ic.Diffuse(UNIT.scaled(0.0)))
        for i, m in enumerate(forest(20, seed=4))
    ]
    where = {"fov_deg": 30.0, "resolution": 40}
    scene = ic.Scene((*lit, *dark), UNIT)
    found, _ = pixels_of(scene, eye=PINHOLE, spp=4, precision=precision, **where)
    origin, directions = chief_rays(**where, across=5, margin=0.3)
    _, index = nearest_distance_m(scene, origin, directions)
    sent = np.concatenate([level, np.zeros(20), [1.0]])
    # Pixels that look at one object, with some of it around them.
    one = np.ptp(index, axis=(2, 3)) == 0
    assert len(np.unique(index[:, :, 2, 2][one])) > 8
    assert one.mean() > 0.6
    np.testing.assert_allclose(found[one], sent[index[:, :, 2, 2]][one], atol=1e-4)


def test_instances_that_shine_light_a_wall_as_meshes_do():
    wall = ic.SceneObject("wall", ic.Quad((-5, -5, -1), (10, 0, 0), (0, 10, 0)), HALF)
    lamp = quad_mesh(ic.Quad((-1, -1, 0), (0, 2, 0), (2, 0, 0)), steps=2)
    found = []
    for turn in (0.0, 90.0):
        matrix = placed((0.5, 0.5, 0.5), turn, (0, 0, 1), (0, 0, 0.5))
        lamps = [
            ic.SceneObject("lamp", shape, ic.Emission(UNIT, sides="front"))
            for shape in (ic.Instance(lamp, matrix), lamp.moved(matrix))
        ]
        found += [radiance_of(ic.Scene((wall, item)), spp=64, max_bounces=2) for item in lamps]
    mean = np.mean([value for value, _ in found])
    for value, error in found:
        assert value == pytest.approx(mean, abs=4 * error + 1e-5)

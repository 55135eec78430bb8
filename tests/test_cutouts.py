"""Surfaces that let light pass: cut-outs by their opacity, and planes that add light."""

import numpy as np
import pytest
from path_views import HALF, PINHOLE, UNIT, chief_rays, pixels_of, placed, quad_mesh, radiance_of

import isetcl as ic
from isetcl.scene.view import intersect

pytestmark = pytest.mark.usefixtures("shared_kernels")

BACK = ic.SceneObject(
    "back", ic.Quad((-9, -9, -4), (18, 0, 0), (0, 18, 0)), ic.Emission(UNIT.scaled(3.0))
)
WALL = ic.SceneObject("wall", ic.Quad((-5, -5, -1), (10, 0, 0), (0, 10, 0)), HALF)
SHEET = ic.Quad((-1, -1, -1), (2, 0, 0.1), (0, 2, 0))


def shapes_of(quad):
    return {
        "quad": quad,
        "disc": ic.Disc((0, 0, -1), 0.5),
        "sphere": ic.Sphere((0, 0, 0), 2.0),
        "mesh": quad_mesh(quad),
        "instance": ic.Instance(quad_mesh(quad), np.eye(4)),
    }


def bernoulli_error(share, step, pixels, spp):
    """Standard error of a mean of independent choices between two radiances."""
    return step * np.sqrt(share * (1 - share) / (pixels * spp))


@pytest.mark.parametrize("shape", ["quad", "disc", "sphere", "mesh", "instance"])
def test_a_half_open_surface_mixes_what_is_behind_it(shape, precision):
    item = ic.SceneObject("it", shapes_of(SHEET)[shape], ic.Emission(UNIT), opacity=0.3)
    found, error = radiance_of(ic.Scene((item, BACK)), spp=256, precision=precision)
    expected = 0.3 * 1.0 + 0.7 * 3.0
    spread = bernoulli_error(0.3, 2.0, 16, 256)
    assert 0.5 * spread < error < 2 * spread
    assert found == pytest.approx(expected, abs=3 * spread)


def test_thirty_layers_are_passed_one_after_the_other():
    """Each of opacity 0.1 with a light of its own, before a bright back."""
    layers = tuple(
        ic.SceneObject(
            f"layer {i}",
            ic.Quad((-2, -2, -1 - 0.1 * i), (4, 0, 0), (0, 4, 0)),
            ic.Emission(UNIT.scaled(0.1 * i)),
            opacity=0.1,
        )
        for i in range(30)
    )
    found, error = radiance_of(ic.Scene((*layers, BACK)), spp=256)
    share = 0.9 ** np.arange(30) * 0.1
    levels = np.append(0.1 * np.arange(30), 3.0)
    share = np.append(share, 0.9**30)
    expected = np.sum(share * levels)
    spread = np.sqrt((np.sum(share * levels**2) - expected**2) / (16 * 256))
    assert found == pytest.approx(expected, abs=3 * spread)
    assert error < 2 * spread


@pytest.mark.parametrize("shape", ["quad", "disc", "sphere", "mesh", "instance"])
def test_what_has_no_opacity_cannot_be_seen(shape):
    body = shapes_of(SHEET)[shape]
    board = ic.Checkerboard(1, 1, 0.0, 0.0)
    seen = []
    for objects in (
        (),
        (ic.SceneObject("it", body, HALF, emission=ic.Emission(UNIT), opacity=0.0),),
        (ic.SceneObject("it", body, HALF, opacity=board),),
    ):
        sun = ic.DistantLight((0, 1, 2), UNIT)
        scene = ic.Scene((WALL, *objects), UNIT, lights=(sun,))
        seen.append(radiance_of(scene.moved("wall", (0, 0, -1)), spp=64, max_bounces=1)[0])
    # Lights are chosen otherwise where a lamp without opacity is one of them.
    assert seen[1] == pytest.approx(seen[0], rel=0.02)
    assert seen[2] == pytest.approx(seen[0], rel=1e-4)


@pytest.mark.parametrize("shape", ["quad", "disc", "sphere", "mesh", "instance"])
def test_a_checkerboard_of_holes_is_seen_as_such(shape):
    quad = ic.Quad((-0.06, -0.05, -1), (0.12, 0, 0.02), (0, 0.1, 0))
    body = shapes_of(quad)[shape]
    if shape == "disc":
        body = ic.Disc((0, 0, -1), 0.06)
    elif shape == "sphere":
        body = ic.Sphere((0.0, 0.0, -1.0), 0.08)
    board = ic.Checkerboard(3, 2, 1.0, 0.0) if shape != "sphere" else ic.Checkerboard(9, 7)
    item = ic.SceneObject("it", body, ic.Emission(UNIT), opacity=board)
    where = {"fov_deg": 5.0, "resolution": 24}
    found, _ = pixels_of(ic.Scene((item, BACK)), eye=PINHOLE, spp=16, **where)
    origin, directions = chief_rays(**where, across=7, margin=0.2)
    hits = intersect(body, origin, directions)
    hole = ~np.isfinite(hits.distance_m) | (board.weights(hits.u, hits.v)[..., 0] == 0.0)
    level = np.where(hole, 3.0, 1.0)
    # Through a hole of a ball its far side is seen, which the host has not looked at.
    one = np.ptp(level, axis=(2, 3)) == 0
    one &= (shape != "sphere") | ~hole.any(axis=(2, 3))
    expected = level[:, :, 3, 3]
    assert one.sum() > 60
    assert shape == "sphere" or len(np.unique(expected[one])) == 2
    np.testing.assert_allclose(found[one], expected[one], rtol=1e-4)


def test_a_picture_of_opacity_mixes_by_its_weights():
    texels = np.linspace(0.1, 0.9, 8) * np.linspace(0.5, 1.0, 6)[:, None]
    picture = ic.Image(texels)
    quad = ic.Quad((-0.05, -0.05, -1), (0.1, 0, 0.02), (0, 0.1, 0))
    for body in (quad, quad_mesh(quad)):
        item = ic.SceneObject("leaf", body, ic.Emission(UNIT.scaled(0.0)), opacity=picture)
        where = {"fov_deg": 4.0, "resolution": 8}
        found, _ = pixels_of(ic.Scene((item, BACK)), eye=PINHOLE, spp=512, **where)
        origin, directions = chief_rays(**where)
        hits = intersect(quad, origin, directions)
        share = picture.weights(hits.u, hits.v)[..., 0]
        expected = 3.0 * (1.0 - share).mean(axis=(2, 3))
        spread = bernoulli_error(0.5, 3.0, 1, 512)
        # Student's t is not needed: 64 pixels, at 1 in 1000 each.
        assert np.all(np.abs(found - expected) < 4 * spread)
        assert np.mean(found - expected) == pytest.approx(0.0, abs=3 * spread / 8)


@pytest.mark.parametrize("opacity", [0.5, ic.Checkerboard(200, 200), ic.Grid(300, 300, 0.3)])
def test_the_shadow_of_a_half_open_surface_is_half_deep(opacity):
    screen = ic.SceneObject(
        "screen", ic.Quad((0.1, -0.2, -0.6), (0.4, 0, 0), (0, 0.4, 0)), HALF, opacity=opacity
    )
    # A finely cut screen hides half of a lamp of some size.
    lamp = ic.Disc((0.6, 0.0, -0.2), 0.05, (-0.6, 0, -0.8))
    light = ic.SceneObject("lamp", lamp, ic.Emission(UNIT.scaled(100.0), sides="front"))
    found = [
        radiance_of(ic.Scene((WALL, light, *more)), spp=512, max_bounces=1)
        for more in ((), (screen,))
    ]
    whole, half = found[0][0], found[1][0]
    assert found[1][1] < 0.02 * half
    share = 0.5 if not isinstance(opacity, ic.Grid) else 1 - opacity.mean
    assert half == pytest.approx(share * whole, abs=4 * found[1][1] + 0.01 * whole)


def test_a_cut_out_lamp_lights_by_its_opacity():
    """A quarter-open lamp, found by being asked and by chance, alike."""
    lamp = ic.Quad((-2.0, 1.0, -1.0), (4.0, 0, 0), (0, 0.0, 2.0))
    values = []
    for level, opacity in ((0.25, 1.0), (1.0, 0.25), (1.0, ic.Image(np.full((2, 2), 0.25)))):
        item = ic.SceneObject("lamp", lamp, ic.Emission(UNIT.scaled(level)), opacity=opacity)
        values.append(radiance_of(ic.Scene((WALL, item)), fov_deg=2.0, spp=512, max_bounces=1))
    (whole, error), *others = values
    assert error < 0.01 * whole
    for found, other in others:
        assert found == pytest.approx(whole, abs=4 * np.hypot(error, other))


def plane(name, z, level, *, shape="quad", tilt=0.0, **options):
    emission = ic.Emission(UNIT.scaled(level), is_additive=True, **options)
    quad = ic.Quad((-2, -2, z), (4, 0, tilt), (0, 4, 0))
    body = {"quad": quad, "mesh": quad_mesh(quad), "disc": ic.Disc((0, 0, z), 2.0)}[shape]
    return ic.SceneObject(name, body, emission)


@pytest.mark.parametrize("shape", ["quad", "mesh", "disc"])
@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
def test_additive_planes_add_exactly(order, shape, precision):
    planes = [plane(f"{i}", -0.5 - 0.4 * i, 1.0 + i * i, shape=shape) for i in range(3)]
    scene = ic.Scene((BACK, *(planes[i] for i in order)))
    found, _ = pixels_of(scene, spp=4, precision=precision)
    np.testing.assert_allclose(found, 1.0 + 2.0 + 5.0 + 3.0, rtol=1e-5)


@pytest.mark.parametrize("behind", [True, False])
def test_additive_balls_add_on_both_sides(behind):
    """A ball is crossed twice."""
    ball = ic.SceneObject("ball", ic.Sphere((0, 0, -1), 0.4), ic.Emission(UNIT, is_additive=True))
    found, _ = pixels_of(ic.Scene((ball, BACK) if behind else (ball,)), spp=4)
    np.testing.assert_allclose(found, 2.0 + 3.0 * behind, rtol=1e-5)


def test_fifty_additive_planes_are_all_passed():
    planes = tuple(plane(f"{i}", -0.5 - 0.05 * i, 1.0) for i in range(50))
    found, _ = pixels_of(ic.Scene((*planes, BACK)), spp=2)
    np.testing.assert_allclose(found, 53.0, rtol=1e-5)


def test_planes_in_one_place_all_add_and_all_let_pass():
    """Two displays in one plane, and a decal without opacity on a wall."""
    scene = ic.Scene((plane("a", -1.0, 1.0), plane("b", -1.0, 2.0), BACK))
    np.testing.assert_allclose(pixels_of(scene, spp=4)[0], 6.0, rtol=1e-5)
    tilted = (plane("a", -1.0, 1.0, tilt=0.7), plane("b", -1.0, 2.0, tilt=0.7), BACK)
    np.testing.assert_allclose(pixels_of(ic.Scene(tilted), spp=4)[0], 6.0, rtol=1e-5)
    wall = ic.SceneObject("wall", SHEET, ic.Emission(UNIT))
    for opacity, expected in ((0.0, 1.0), (0.4, 0.4 * 3 + 0.6)):
        decal = ic.SceneObject("decal", SHEET, ic.Emission(UNIT.scaled(3.0)), opacity=opacity)
        found, error = radiance_of(ic.Scene((decal, wall, BACK)), spp=256)
        assert found == pytest.approx(expected, abs=4 * error + 1e-4)


@pytest.mark.slow
def test_bounces_count_what_scatters_only():
    """A mirror behind additive planes shows them again; without bounces it is black."""
    mirror = ic.SceneObject("mirror", ic.Quad((-3, -3, -2), (6, 0, 0), (0, 6, 0)), ic.Mirror(UNIT))
    planes = tuple(plane(f"{i}", -0.5 - 0.4 * i, 1.0 + i) for i in range(3))
    scene = ic.Scene((*planes, mirror), UNIT.scaled(10.0))
    for bounces, expected in ((0, 6.0), (1, 6.0 + 6.0 + 10.0)):
        found, _ = pixels_of(scene, spp=4, max_bounces=bounces)
        np.testing.assert_allclose(found, expected, rtol=1e-4)


@pytest.mark.parametrize("opaque", [False, True])
@pytest.mark.slow
def test_an_additive_lamp_lights_a_wall_through_another(opaque):
    """What it sends does not depend on what it lets pass; two of them add, in either order."""
    lamp = ic.Quad((-0.5, -0.5, 0.5), (0, 1, 0), (1, 0, 0))
    before = ic.Quad((-0.5, -0.5, 0.3), (0, 1, 0), (1, 0, 0))

    def lit(*bodies):
        items = [
            ic.SceneObject(f"lamp {i}", body, ic.Emission(UNIT, is_additive=not opaque))
            for i, body in enumerate(bodies)
        ]
        return radiance_of(ic.Scene((WALL, *items)), spp=512, max_bounces=1)

    one, error_one = lit(lamp)
    other, error_other = lit(before)
    both, error = lit(lamp, before)
    back, _ = lit(before, lamp)
    x = 0.5 / 1.5
    quarter = x / np.sqrt(1 + x * x) * np.arctan(x / np.sqrt(1 + x * x)) / np.pi
    assert one == pytest.approx(0.5 * 4 * quarter, abs=4 * error_one + 1e-4)
    allowed = 4 * np.sqrt(error**2 + error_one**2 + error_other**2)
    assert allowed < 0.05 * both
    if opaque:
        # The nearer one hides the other, seen from the middle of the wall.
        assert both == pytest.approx(other, abs=allowed + 0.01)
    else:
        assert both == pytest.approx(one + other, abs=allowed)
    assert back == pytest.approx(both, abs=2 * allowed)


def test_an_additive_plane_may_be_partly_there():
    emission = ic.Emission(UNIT.scaled(4.0), is_additive=True)
    item = ic.SceneObject("plane", SHEET, emission, opacity=0.25)
    found, error = radiance_of(ic.Scene((item, BACK)), spp=256)
    assert found == pytest.approx(4.0, abs=4 * error)
    assert error < 0.1


def test_an_additive_plane_that_shines_forwards_only_is_clear_from_behind():
    item = plane("plane", -1.0, 5.0, sides="front")
    turned = ic.SceneObject("plane", ic.Quad((-2, -2, -1), (0, 4, 0), (4, 0, 0)), item.material)
    for first, expected in ((item, 8.0), (turned, 3.0)):
        found, _ = pixels_of(ic.Scene((first, BACK)), spp=4)
        np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_cut_outs_are_drawn_alike_on_meshes_turned_about():
    """An instance and the mesh in its place have the same holes."""
    board = ic.Checkerboard(3, 2, 1.0, 0.0)
    mesh = quad_mesh(ic.Quad((-1, -1, 0), (2, 0, 0), (0, 2, 0)), steps=3)
    matrix = placed((0.08, -0.05, 0.1), 30.0, (1, 1, 3), (0, 0, -1))
    images = []
    for body in (ic.Instance(mesh, matrix), mesh.moved(matrix)):
        item = ic.SceneObject("it", body, HALF, opacity=board)
        scene = ic.Scene((item, BACK), None, lights=(ic.PointLight((0, 0.2, 0), UNIT),))
        images.append(pixels_of(scene, fov_deg=6.0, resolution=12, spp=16, max_bounces=1)[0])
    off = np.abs(images[0] - images[1])
    assert np.ptp(images[0]) > 1.0
    assert np.median(off) < 1e-5
    assert np.mean(off > 1e-2) < 0.1

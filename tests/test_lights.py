"""Lights: spots, pictures all around, surfaces that shine, and the choice among many."""

import numpy as np
import pytest
from path_views import (
    DARK,
    HALF,
    PINHOLE,
    UNIT,
    chief_rays,
    pipeline_of,
    pixels_of,
    placed,
    quad_mesh,
    radiance_of,
    replicates_of,
)
from slow_cases import slow_after

import isetcl as ic
from isetcl.render import pack_lights

pytestmark = pytest.mark.usefixtures("shared_kernels")

WALL = ic.SceneObject("wall", ic.Quad((-5, -5, -1), (10, 0, 0), (0, 10, 0)), HALF)


def lit_wall(*objects, lights=(), background=None):
    return ic.Scene((WALL, *objects), background, lights=lights)


def smooth_fall(angle_deg, cone_deg, penumbra_deg):
    """The smooth step of the cosine between the inner and the outer edge of a cone."""
    outer, inner = np.cos(np.radians([cone_deg, cone_deg - penumbra_deg]))
    t = np.clip((np.cos(np.radians(angle_deg)) - outer) / (inner - outer), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


@pytest.mark.filterwarnings("ignore:no light of scene")
@pytest.mark.parametrize("cone_deg", [30.0, 0.3])
def test_a_spot_light_falls_off_as_a_smooth_step(cone_deg, precision):
    """From (0, 0.6, -0.2) the middle of the wall is 1 m away; cosine 0.8."""
    place = np.array([0.0, 0.6, -0.2])
    to_wall = np.array([0.0, 0.0, -1.0]) - place
    penumbra = cone_deg / 2
    for off in (0.3, 0.6, 0.75, 0.9, 1.05):
        axis = placed(turn_deg=off * cone_deg, axis=(1, 0, 0))[:3, :3] @ to_wall
        light = ic.SpotLight(
            tuple(place), tuple(axis), UNIT, cone_deg=cone_deg, penumbra_deg=penumbra
        )
        found, _ = radiance_of(
            lit_wall(lights=(light,)),
            eye=PINHOLE,
            fov_deg=0.002,
            resolution=2,
            spp=16,
            max_bounces=1,
            precision=precision,
        )
        fall = smooth_fall(off * cone_deg, cone_deg, penumbra)
        expected = 0.5 / np.pi * 0.8 * fall
        assert found == pytest.approx(expected, rel=2e-3, abs=3e-3 * 0.5 / np.pi * 0.8)


@pytest.mark.filterwarnings("ignore:no light of scene")
def test_a_spot_without_penumbra_has_a_sharp_edge():
    for off, fall in ((0.98, 1.0), (1.02, 0.0)):
        axis = placed(turn_deg=off * 10.0, axis=(1, 0, 0))[:3, :3] @ np.array([0.0, -0.6, -0.8])
        light = ic.SpotLight((0, 0.6, -0.2), tuple(axis), UNIT, cone_deg=10.0, penumbra_deg=0.0)
        found, _ = radiance_of(
            lit_wall(lights=(light,)), fov_deg=0.01, resolution=2, spp=16, max_bounces=1
        )
        assert found == pytest.approx(0.5 / np.pi * 0.8 * fall, rel=1e-3, abs=1e-6)


def sky_image(rows=16, columns=32, seed=0):
    """A picture with a bright patch."""
    texels = np.random.default_rng(seed).random((rows, columns))
    texels[3:5, 9:11] += 40.0
    return ic.Image(texels)


TURN = placed(turn_deg=70.0, axis=(1, 2, 3))[:3, :3]


def irradiance_of_sky(sky, normal, n=1000):
    """Integral of radiance times cosine over the hemisphere, by the midpoint rule in u and v."""
    u, v = np.meshgrid((np.arange(2 * n) + 0.5) / (2 * n), (np.arange(n) + 0.5) / n)
    longitude, latitude = 2 * np.pi * u, np.pi * (v - 0.5)
    local = np.stack(
        [
            np.cos(latitude) * np.sin(longitude),
            np.sin(latitude),
            np.cos(latitude) * np.cos(longitude),
        ],
        axis=-1,
    )
    world = local if sky.rotation is None else local @ np.asarray(sky.rotation).T
    cosine = np.maximum(world @ np.asarray(normal, dtype=float), 0.0)
    step = np.pi / n * np.pi / n
    return float(np.sum(sky.texture.weights(u, v)[..., 0] * cosine * np.cos(latitude)) * step)


def facing_wall(normal):
    """A quad 1 m in front of the eye that faces a direction."""
    normal = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
    u = np.cross([0.0, 1.0, 0.0], normal)
    u /= np.linalg.norm(u)
    v = np.cross(normal, u)
    corner = np.array([0.0, 0.0, -1.0]) - 0.1 * u - 0.1 * v
    return ic.SceneObject("wall", ic.Quad(tuple(corner), tuple(0.2 * u), tuple(0.2 * v)), HALF)


@pytest.mark.parametrize(
    ("normal", "rotation"),
    slow_after(
        1,
        [
            ((0.3, 0.9, 0.3), TURN),
            ((0, 0, 1), TURN),
            ((-0.8, -0.1, 0.4), TURN),
            ((0, 0, 1), None),
            ((0.3, 0.9, 0.3), None),
            ((-0.8, -0.1, 0.4), None),
        ],
    ),
)
def test_a_picture_all_around_lights_surfaces_by_its_integral(normal, rotation):
    sky = ic.Environment(UNIT, sky_image(), rotation)
    scene = ic.Scene((facing_wall(normal),), sky)
    normal = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
    found, error = radiance_of(scene, spp=256, max_bounces=1)
    expected = 0.5 / np.pi * irradiance_of_sky(sky, normal)
    assert error < 0.01 * expected
    assert found == pytest.approx(expected, abs=3.5 * error + 2e-4 * expected)


def test_asking_the_sky_changes_nothing_but_the_noise():
    sky = ic.Environment(UNIT, sky_image())
    scene = ic.Scene((facing_wall((0.3, 0.9, 0.3)),), sky)
    asked, error = replicates_of(*pipeline_of(scene, fov_deg=0.1, max_bounces=1))
    never = {"has_lights": False}
    found, other = replicates_of(*pipeline_of(scene, never, fov_deg=0.1, max_bounces=1))
    assert asked == pytest.approx(found, abs=3.5 * np.hypot(error, other))
    assert other > 2 * error
    assert other < 0.03 * found


@pytest.mark.slow
def test_a_sun_a_million_times_the_sky_converges():
    """Nearly all light comes from one texel, and from the texels that it is interpolated into."""
    texels = np.ones((32, 64))
    texels[8, 20] = 1e6
    sky = ic.Environment(UNIT, ic.Image(texels))
    normal = np.array([0.5, 0.7, 0.5]) / np.linalg.norm([0.5, 0.7, 0.5])
    scene = ic.Scene((facing_wall(normal),), sky)
    found, error = radiance_of(scene, spp=256, max_bounces=1)
    expected = 0.5 / np.pi * irradiance_of_sky(sky, normal)
    assert error < 0.015 * expected
    assert found == pytest.approx(expected, abs=3.5 * error + 5e-4 * expected)
    never = {"has_lights": False}
    mean, unasked = replicates_of(*pipeline_of(scene, never, fov_deg=0.05, max_bounces=1))
    assert max(unasked, abs(mean - expected)) > 10 * error


@pytest.mark.slow
def test_shares_of_the_sky_are_those_of_the_interpolated_picture():
    """Also where the picture is repeated or moved: the noise stays that of the plain one."""
    texels = np.ones((32, 64))
    texels[8, 20] = 1e6
    plain = ic.Image(texels)
    moved = ic.Image(np.roll(texels, 16, axis=1), wrap="repeat", offset=(0.25, 0.0))
    relative = []
    for picture in (plain, moved):
        scene = ic.Scene((facing_wall((0.5, 0.7, 0.5)),), ic.Environment(UNIT, picture))
        found, error = radiance_of(scene, spp=64, max_bounces=1)
        relative.append(error / found)
    assert relative[1] < 3 * relative[0]


@pytest.mark.parametrize("rotation", [None, TURN])
def test_the_eye_sees_the_picture_all_around(rotation):
    sky = ic.Environment(UNIT, sky_image(12, 24, seed=3), rotation)
    where = {"fov_deg": 40.0, "resolution": 12}
    values, _ = pixels_of(ic.Scene((), sky), eye=PINHOLE, spp=256, **where)
    _, directions = chief_rays(**where)
    expected = sky.texture.weights(*sky.coordinates(directions))[..., 0].mean(axis=(2, 3))
    assert np.ptp(expected) > 0.3
    np.testing.assert_allclose(values, expected, atol=0.02 * expected.max())


@pytest.mark.slow
def test_a_mirror_ball_shows_the_picture_all_around():
    """Rays are reflected on the host: d - 2 (d . n) n."""
    across = 0.6 + 0.4 * np.cos(2 * np.pi * (np.arange(24) + 0.5) / 24)
    texels = across * np.sin(np.pi * (np.arange(12) + 0.5) / 12)[:, None] + 0.3
    sky = ic.Environment(UNIT, ic.Image(texels), TURN)
    ball = ic.Sphere((0.0, 0.0, -1.0), 0.2)
    scene = ic.Scene((ic.SceneObject("ball", ball, ic.Mirror(UNIT)),), sky)
    where = {"fov_deg": 12.0, "resolution": 8}
    values, _ = pixels_of(scene, eye=PINHOLE, spp=64, **where)
    origin, d = chief_rays(**where)
    centre = np.array(ball.centre_m) - origin
    along = d @ centre
    miss2 = centre @ centre - along**2
    hit = miss2 < ball.radius_m**2
    t = along - np.sqrt(np.where(hit, ball.radius_m**2 - miss2, 0.0))
    normal = (t[..., None] * d - centre) / ball.radius_m
    mirrored = d - 2 * np.einsum("...i,...i->...", d, normal)[..., None] * normal
    d = np.where(hit[..., None], mirrored, d)
    expected = sky.texture.weights(*sky.coordinates(d))[..., 0].mean(axis=(2, 3))
    inside = hit.all(axis=(2, 3))
    assert inside.sum() > 30
    np.testing.assert_allclose(values[inside], expected[inside], rtol=0.02)


LAMP = ic.Quad((-0.5, -0.5, 0.5), (0, 1, 0), (1, 0, 0))  # behind the eye, facing the wall


@pytest.mark.parametrize("shape", ["quad", "mesh", "instance"])
@pytest.mark.slow
def test_one_sided_lamps_shine_only_forwards(shape):
    body = LAMP if shape == "quad" else quad_mesh(LAMP)
    if shape == "instance":
        # Mirrored in x and standing elsewhere, but in the same place with the same front.
        mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
        body = ic.Instance(body.moved(np.linalg.inv(mirror)), mirror)
    front = ic.Emission(UNIT, sides="front")
    found, error = radiance_of(
        lit_wall(ic.SceneObject("lamp", body, front)), spp=256, max_bounces=1
    )
    # Form factor of a square over its middle, at a distance of 1.5: Howell, B-4, four quarters.
    x = 0.5 / 1.5
    quarter = x / np.sqrt(1 + x * x) * np.arctan(x / np.sqrt(1 + x * x)) / np.pi
    assert error < 2e-3 * found
    assert found == pytest.approx(0.5 * 4 * quarter, abs=3.5 * error + 1e-4)


@pytest.mark.filterwarnings("ignore:no light of scene")
@pytest.mark.parametrize("shape", slow_after(1, ["quad", "mesh", "sphere"]))
def test_one_sided_lamps_are_dark_from_behind(shape):
    backwards = ic.Quad(LAMP.corner_m, LAMP.edge_v_m, LAMP.edge_u_m)
    body = {
        "quad": backwards,
        "mesh": quad_mesh(backwards),
        "sphere": ic.Sphere((0, 0, -1.2), 3.0),
    }[shape]
    lamp = ic.SceneObject("lamp", body, ic.Emission(UNIT, sides="front"))
    assert radiance_of(lit_wall(lamp))[0] == 0.0
    assert radiance_of(ic.Scene((lamp,)), fov_deg=20.0)[0] == 0.0
    if shape != "sphere":
        lamp = ic.SceneObject("lamp", backwards, ic.Emission(UNIT, sides="front"))
        shown = ic.Quad((-5, -5, -1), (10, 0, 0), (0, 10, 0))
        away = ic.Quad(shown.corner_m, shown.edge_v_m, shown.edge_u_m)
        for quad, seen in ((shown, 1.0), (away, 0.0)):
            item = ic.SceneObject("wall", quad, ic.Emission(UNIT, sides="front"))
            found, _ = radiance_of(ic.Scene((item, lamp)))
            assert found == pytest.approx(seen, rel=1e-5)


@pytest.mark.parametrize("shape", slow_after(1, ["sphere", "mesh"]))
@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (0.3, -0.2, -0.4)])
def test_a_closed_shining_cavity_is_a_furnace(shape, place):
    """Le / (1 - rho), also where light of the cavity is found by asking for it."""
    import trimesh

    body = ic.Sphere(place, 1.0)
    if shape == "mesh":
        ball = trimesh.creation.icosphere(subdivisions=2)
        body = ic.Mesh(ball.vertices + np.array(place), ball.faces)
    item = ic.SceneObject("cavity", body, HALF, emission=ic.Emission(UNIT))
    found, error = radiance_of(ic.Scene((item,)), fov_deg=20.0, spp=256, max_bounces=60)
    assert error < 8e-3
    assert found == pytest.approx(2.0, abs=3.5 * error)


@pytest.mark.parametrize("precision", ["single", "double"])
def test_a_cavity_that_shines_outwards_is_dark_inside(precision):
    item = ic.SceneObject(
        "cavity", ic.Sphere((0.3, -0.2, -0.4), 1.0), HALF, emission=ic.Emission(UNIT, sides="front")
    )
    spark = ic.PointLight((0.0, 0.0, -0.1), UNIT.scaled(1e-9))
    scene = ic.Scene((item,), lights=(spark,))
    found, _ = radiance_of(scene, fov_deg=20.0, spp=64, max_bounces=4, precision=precision)
    assert found < 1e-7


def test_a_body_that_shines_and_reflects_sends_out_both():
    """A ball under an even sky: Le + rho."""
    item = ic.SceneObject("ball", ic.Sphere((0, 0, -1), 0.1), HALF, emission=ic.Emission(UNIT))
    found, error = radiance_of(ic.Scene((item,), UNIT), spp=64)
    assert found == pytest.approx(1.5, abs=3.5 * error + 1e-3)


def many_lamps(count=200):
    rng = np.random.default_rng(5)
    places = rng.uniform([-2, -2, -0.6], [2, 2, 2], (count, 3))
    power = 10.0 ** rng.uniform(-4, 1, count)
    power[7] = 300.0
    return places, power


def test_many_lamps_add_up_and_are_chosen_by_power(monkeypatch):
    places, power = many_lamps()
    lights = tuple(
        ic.PointLight(tuple(p), UNIT.scaled(float(i))) for p, i in zip(places, power, strict=True)
    )
    offset = places - np.array([0.0, 0.0, -1.0])
    square = np.sum(offset**2, axis=1)
    expected = 0.5 / np.pi * np.sum(power * offset[:, 2] / square**1.5)
    scene = lit_wall(lights=lights)
    found, error = radiance_of(scene, fov_deg=0.01, spp=512, max_bounces=1)
    assert error < 0.02 * expected
    assert found == pytest.approx(expected, abs=3.5 * error)
    monkeypatch.setattr(pack_lights, "EVEN_SHARE", 1.0)
    even, even_error = radiance_of(scene, fov_deg=0.01, spp=512, max_bounces=1)
    assert even == pytest.approx(expected, abs=4 * even_error)
    assert even_error > 4 * error


def test_chances_are_those_that_numbers_of_24_bits_give():
    """Every number falls on some light, every light has one, weights are their share."""
    rng = np.random.default_rng(1)
    power = 10.0 ** rng.uniform(-12, 0, 20_000)
    cumulative = pack_lights.in_steps(np.cumsum(power)).astype(np.float32).astype(np.float64)
    steps = np.diff(cumulative, prepend=0.0) * 2**24
    np.testing.assert_array_equal(steps, np.rint(steps))
    assert steps.min() == 1
    assert cumulative[-1] == 1.0
    bright = power > 0.1
    np.testing.assert_allclose(steps[bright] / 2**24, (power / power.sum())[bright], rtol=0.05)


def test_a_translucent_sheet_passes_light_behind_it():
    """Lit from behind, cosine 0.8 at 1 m: tau E / pi."""
    sheet = ic.Diffuse(ic.Spectrum.constant(0.1), None, ic.Spectrum.constant(0.6))
    item = ic.SceneObject("sheet", ic.Quad((-5, -5, -1), (10, 0, 0), (0, 10, 0)), sheet)
    light = ic.PointLight((0.6, 0.0, -1.8), UNIT)
    found, error = radiance_of(ic.Scene((item,), lights=(light,)), fov_deg=0.01, max_bounces=1)
    assert found == pytest.approx(0.6 / np.pi * 0.8, abs=3.5 * error + 1e-4)


@pytest.mark.slow
def test_sides_of_a_two_sided_surface_are_its_own():
    sides = ic.TwoSided(
        ic.Diffuse(ic.Spectrum.constant(0.8)), ic.Diffuse(ic.Spectrum.constant(0.2))
    )
    for quad, albedo in (
        (ic.Quad((-1, -1, -1), (2, 0, 0), (0, 2, 0)), 0.8),
        (ic.Quad((-1, -1, -1), (0, 2, 0), (2, 0, 0)), 0.2),
    ):
        for body in (quad, quad_mesh(quad), ic.Instance(quad_mesh(quad), np.eye(4))):
            scene = ic.Scene((ic.SceneObject("it", body, sides),), UNIT)
            assert radiance_of(scene, spp=16)[0] == pytest.approx(albedo, rel=1e-4)


@pytest.mark.slow
def test_lamps_without_light_do_no_harm():
    """No power, no area, an all-black picture, and a black sky: the rest is seen as ever."""
    flat = ic.Mesh([[0, 0, 1], [1, 0, 1], [2, 0, 1], [3, 0, 1]], [[0, 1, 2], [1, 2, 3]])
    black = ic.Image(np.zeros((4, 8)))
    nothing = (
        ic.SceneObject("no area", flat, ic.Emission(UNIT)),
        ic.SceneObject("no power", ic.Disc((0, 0, 0.5), 0.1), DARK),
        ic.SceneObject("black", ic.Disc((0, 0, 0.7), 0.1), ic.Emission(UNIT, black)),
    )
    dark_point = ic.PointLight((0, 0, 0.3), UNIT.scaled(0.0))
    point = ic.PointLight((0.6, 0.0, -0.2), UNIT)
    sky = ic.Environment(UNIT, black)
    for background in (None, sky):
        scene = lit_wall(*nothing, lights=(dark_point, point), background=background)
        found, error = radiance_of(scene, fov_deg=0.01, max_bounces=1, spp=256)
        assert found == pytest.approx(0.5 / np.pi * 0.8, abs=3.5 * error + 1e-4)
    for lights in ((), (dark_point,)):
        with pytest.warns(UserWarning, match="no light of scene"):
            found, _ = radiance_of(lit_wall(*nothing, lights=lights, background=sky))
        assert found == 0.0
    even = lit_wall(nothing[0], background=UNIT)
    assert radiance_of(even)[0] == pytest.approx(0.5, rel=1e-4)

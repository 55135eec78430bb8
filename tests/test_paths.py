"""The path pipeline: light scattered by surfaces, against closed forms and the direct pipeline."""

import dataclasses

import numpy as np
import pytest
import trimesh

import isetcl as ic
from isetcl.render import plan as plan_module
from isetcl.render.paths import PathPipeline

pytestmark = pytest.mark.usefixtures("shared_kernels")

UNIT = ic.Spectrum.constant(1.0)
HALF = ic.Diffuse(ic.Spectrum.constant(0.5))
EYE = ic.eyes.navarro(3.0)
ONE = {"wavelengths_nm": [550.0]}


def quad_mesh(quad, uv=True):
    """A parallelogram as two triangles with its texture coordinates."""
    corner, u, v = (np.array(x) for x in (quad.corner_m, quad.edge_u_m, quad.edge_v_m))
    corners = np.array([corner, corner + u, corner + u + v, corner + v])
    coordinates = [[0, 0], [1, 0], [1, 1], [0, 1]]
    return ic.Mesh(corners, [[0, 1, 2], [0, 2, 3]], uv=coordinates if uv else None)


def hidden_mesh():
    """A triangle behind the eye, which only brings the path pipeline in."""
    return ic.SceneObject(
        "hidden", ic.Mesh([[0, 0, 5], [1e-3, 0, 5], [0, 1e-3, 5]], [[0, 1, 2]]), ic.Emission(UNIT)
    )


def radiance_of(scene, *, fov_deg=0.05, resolution=4, spp=256, **options):
    """Mean radiance in the middle of a scene, from the irradiance of a uniform one."""
    where = {"fov_deg": fov_deg, "resolution": resolution, **ONE}
    image = ic.render(scene, EYE, spp=spp, **where, **options)
    uniform = ic.render(ic.scenes.uniform(spectrum=UNIT), EYE, spp=spp, **where)
    scale = float(uniform.irradiance.mean())
    error = float(np.sqrt(np.sum(image.standard_error.values**2))) / image.irradiance.size
    return float(image.irradiance.mean()) / scale, error / scale


@pytest.mark.own_kernels
@pytest.mark.slow
def test_what_only_emits_is_seen_as_by_the_direct_pipeline(precision):
    objects = (
        ic.SceneObject("disc", ic.Disc((0.01, 0, -0.5), 0.01), ic.Emission(UNIT)),
        ic.SceneObject("ball", ic.Sphere((-0.01, 0, -0.7), 0.01), ic.Emission(UNIT.scaled(2.0))),
        *ic.scenes.two_planes(edge_angle_deg=20.0).objects,
    )
    where = {"fov_deg": 4.0, "resolution": 24, "spp": 32, "precision": precision, "bands": 31}
    direct = ic.render(ic.Scene(objects), EYE, **where).irradiance.values
    paths = ic.render(ic.Scene((*objects, hidden_mesh())), EYE, **where).irradiance.values
    # The same rays; a few meet the edge of a check or a shape on the other side of rounding.
    off = np.abs(paths - direct) / direct.max()
    assert np.median(off) < 1e-6
    assert np.mean(off > 1e-4) < 0.02
    assert paths.mean() == pytest.approx(direct.mean(), rel=1e-4)


def test_pictures_and_boards_on_meshes_are_those_on_quads():
    picture = ic.Image(np.random.default_rng(1).random((16, 12, 3)))
    quad = ic.Quad((-0.05, -0.04, -1.0), (0.1, 0.0, 0.02), (0.0, 0.08, 0.0))
    w = np.array([450.0, 550.0, 650.0])
    for material in (
        ic.scenes.picture(picture),
        ic.Emission(UNIT, ic.Checkerboard(3, 2, 1.0, 0.25)),
    ):
        where = {"fov_deg": 4.0, "resolution": 16, "spp": 64, "bands": 3, "wavelengths_nm": w}
        direct = ic.render(ic.Scene((ic.SceneObject("it", quad, material),)), EYE, **where)
        mesh = ic.render(ic.Scene((ic.SceneObject("it", quad_mesh(quad), material),)), EYE, **where)
        difference = np.abs(mesh.irradiance.values - direct.irradiance.values)
        assert difference.mean() < 2e-3 * direct.irradiance.values.mean()


@pytest.mark.parametrize("reflectance", [0.3, 0.8])
def test_an_integrating_sphere_has_its_closed_form(reflectance):
    """A point I in the middle of a sphere of radius R: L = rho I / (pi R^2 (1 - rho))."""
    material = ic.Diffuse(ic.Spectrum.constant(reflectance))
    scene = ic.Scene(
        (ic.SceneObject("sphere", ic.Sphere((0, 0, 0), 2.0), material),),
        lights=(ic.PointLight((0, 0, 0), UNIT),),
    )
    found, error = radiance_of(scene, fov_deg=10.0, resolution=8, max_bounces=100, spp=512)
    expected = reflectance / (np.pi * 4.0 * (1.0 - reflectance))
    assert error < 0.004 * expected
    assert found == pytest.approx(expected, abs=3.5 * error + 1e-3 * expected)


@pytest.mark.filterwarnings("ignore:no light of scene")
def test_each_bounce_adds_its_term():
    """In the integrating sphere n bounces give rho I / (pi R^2) (1 + rho + ... + rho^(n-1))."""
    scene = ic.Scene(
        (ic.SceneObject("sphere", ic.Sphere((0, 0, 0), 2.0), HALF),),
        lights=(ic.PointLight((0, 0, 0), UNIT),),
    )
    for bounces, terms in ((0, 0.0), (1, 1.0), (2, 1.5), (3, 1.75)):
        found, error = radiance_of(scene, fov_deg=10.0, resolution=8, max_bounces=bounces)
        expected = 0.5 / (np.pi * 4.0) * terms
        assert found == pytest.approx(expected, abs=3.5 * error + 1e-3 * expected)


@pytest.mark.parametrize("shape", ["mesh", "sphere", "quad"])
def test_a_convex_body_under_an_even_sky_shows_its_reflectance(shape):
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.3)
    ball.apply_translation([0, 0, -1])
    body = {
        "mesh": ic.Mesh(ball.vertices, ball.faces),
        "sphere": ic.Sphere((0, 0, -1), 0.3),
        "quad": ic.Quad((-0.3, -0.3, -1), (0.6, 0, 0), (0, 0.6, 0)),
    }[shape]
    found, _ = radiance_of(ic.Scene((ic.SceneObject("it", body, HALF),), UNIT), spp=64)
    assert found == pytest.approx(0.5, rel=1e-4)


# The wall is 1 m in front of the eye and faces it; lights stand in front of the wall, on the axis
# but shown to the eye from behind or beside, so that they do not hide what it sees.
WALL = ic.SceneObject("wall", ic.Quad((-5, -5, -1), (10, 0, 0), (0, 10, 0)), HALF)


def lit_wall(*objects, lights=(), background=None):
    return ic.Scene((WALL, *objects), background, lights=lights)


def test_a_point_light_falls_off_with_the_square_and_the_cosine():
    # At (0.6, 0, -0.2): distance 1 to the middle of the wall, cosine 0.8.
    scene = lit_wall(lights=(ic.PointLight((0.6, 0.0, -0.2), UNIT),))
    found, error = radiance_of(scene, max_bounces=1)
    assert found == pytest.approx(0.5 / np.pi * 0.8, abs=3.5 * error + 1e-3 * 0.5 / np.pi)


def test_a_distant_light_falls_off_with_the_cosine():
    scene = lit_wall(lights=(ic.DistantLight((3.0, 0.0, 4.0), UNIT),))
    found, error = radiance_of(scene, max_bounces=1)
    assert found == pytest.approx(0.5 / np.pi * 0.8, abs=3.5 * error + 1e-4)


@pytest.mark.parametrize("shape", ["disc", "sphere", "mesh"])
def test_area_lights_give_their_closed_forms(shape):
    """Behind the eye, on the axis: a disc gives pi L sin^2, a sphere pi L (r / d)^2."""
    radius, behind = 0.7, 0.9
    distance = 1.0 + behind
    if shape == "sphere":
        light = ic.Sphere((0, 0, behind), radius)
        irradiance = np.pi * (radius / distance) ** 2
    else:
        light = ic.Disc((0, 0, behind), radius)
        irradiance = np.pi * radius**2 / (radius**2 + distance**2)
    if shape == "mesh":
        turn = np.arange(400) * 2 * np.pi / 400
        rim = np.stack([radius * np.cos(turn), radius * np.sin(turn), 0 * turn + behind], axis=1)
        faces = [[400, i, (i + 1) % 400] for i in range(400)]
        light = ic.Mesh(np.vstack([rim, [0, 0, behind]]), faces)
    scene = lit_wall(ic.SceneObject("lamp", light, ic.Emission(UNIT)))
    found, error = radiance_of(scene, max_bounces=1, spp=1024)
    expected = 0.5 * irradiance / np.pi
    assert error < 0.01 * expected
    assert found == pytest.approx(expected, abs=3.5 * error + 1e-3 * expected)


def test_asking_lights_changes_nothing_but_the_noise():
    """A large, near lamp is found both ways; leaving one out must leave the mean."""
    lamp = ic.Quad((-2.0, 1.0, -1.0), (4.0, 0, 0), (0, 0.0, 2.0))
    scene = lit_wall(ic.SceneObject("lamp", lamp, ic.Emission(UNIT)))
    prepared = ic.plan(scene, EYE, fov_deg=8.0, resolution=16, max_bounces=3, **ONE)
    means = []
    for has_lights in (True, False):
        config = dataclasses.replace(prepared.config, has_lights=has_lights)
        pipeline = PathPipeline(dataclasses.replace(prepared, config=config))
        (tile,) = pipeline.tiles()
        films = [pipeline.sample(tile, 128, stream)[0].mean() for stream in range(1, 9)]
        means.append((np.mean(films), np.std(films, ddof=1) / np.sqrt(8)))
    (asked, error), (found, other_error) = means
    assert other_error > 2 * error
    assert asked == pytest.approx(found, abs=3.5 * np.hypot(error, other_error))
    assert other_error < 0.02 * found


@pytest.mark.filterwarnings("ignore:no light of scene")
def test_what_stands_before_a_light_hides_it():
    scene = lit_wall(
        ic.SceneObject("screen", ic.Disc((0.3, 0.0, -0.6), 0.1), ic.Emission(UNIT.scaled(0.0))),
        lights=(ic.PointLight((0.6, 0.0, -0.2), UNIT),),
    )
    found, _ = radiance_of(scene, max_bounces=1)
    assert found == 0.0


def test_smooth_normals_shade_a_coarse_ball_as_a_sphere():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.05)
    ball.apply_translation([0, 0, -1])
    light = (ic.DistantLight((1.0, 1.0, 1.0), UNIT),)
    images = []
    for shape in (
        ic.Sphere((0, 0, -1), 0.05),
        ic.Mesh(ball.vertices, ball.faces, ball.vertex_normals),
        ic.Mesh(ball.vertices, ball.faces),
    ):
        scene = ic.Scene((ic.SceneObject("ball", shape, HALF),), lights=light)
        where = {"fov_deg": 4.0, "resolution": 48, "spp": 64}
        images.append(ic.render(scene, EYE, **where, **ONE).irradiance.values[0])
    sphere, smooth, flat = images
    inside = sphere > 0.2 * sphere.max()
    off = [np.std((image - sphere)[inside]) for image in (smooth, flat)]
    assert off[0] < 0.3 * off[1]


@pytest.mark.own_kernels
def test_tiles_do_not_change_a_bit(monkeypatch):
    lamp = ic.SceneObject("lamp", ic.Sphere((0.3, 0.2, -0.5), 0.1), ic.Emission(UNIT))
    where = {"fov_deg": 6.0, "resolution": (70, 50), "spp": 20, "bands": 2, "max_bounces": 3}
    whole = ic.render(lit_wall(lamp), EYE, **where, wavelengths_nm=[450.0, 650.0])
    # Of kernels that follow bundles of paths, and of those that take turns over a tile.
    monkeypatch.setattr(plan_module, "_TILE_FILM_BYTES", 2 * 16 * 1100)
    monkeypatch.setattr(plan_module, "_TILE_PATHS_BYTES", 2 * 8 * 160 * 1100)
    parts = ic.render(lit_wall(lamp), EYE, **where, wavelengths_nm=[450.0, 650.0])
    assert parts.provenance["tile"] != whole.provenance["tile"]
    np.testing.assert_array_equal(parts.irradiance.values, whole.irradiance.values)


def test_colours_bleed():
    """Light reaches the wall by way of a red floor only; both colours have the same samples."""
    w = np.array([450.0, 650.0])
    red = ic.Diffuse(ic.Spectrum(w, np.array([0.1, 0.8])))
    floor = ic.SceneObject("floor", ic.Quad((-5, -0.5, -1), (10, 0, 0), (0, 0, 3)), red)
    scene = lit_wall(floor, lights=(ic.DistantLight((0.0, 1.0, -0.1), UNIT),))
    where = {"fov_deg": 1.0, "resolution": 4, "wavelengths_nm": w, "bands": 1}
    image = ic.render(scene, EYE, spp=512, max_bounces=2, **where)
    white = ic.render(ic.scenes.uniform(spectrum=UNIT), EYE, spp=64, **where)
    blue, red_light = (image.irradiance / white.irradiance).mean(axis=(1, 2)).values
    assert red_light > 0
    assert red_light / blue == pytest.approx(8.0, rel=1e-3)


def test_the_error_of_scattered_light_is_honest():
    lamp = ic.SceneObject("lamp", ic.Sphere((0.0, 0.5, -0.5), 0.05), ic.Emission(UNIT))
    where = {"fov_deg": 6.0, "resolution": 8, "spp": 32, "max_bounces": 4}
    images = [ic.render(lit_wall(lamp), EYE, seed=seed, **where, **ONE) for seed in range(24)]
    spread = np.var([i.irradiance.values for i in images], axis=0, ddof=1).mean()
    claimed = np.mean([i.standard_error.values**2 for i in images])
    assert claimed == pytest.approx(spread, rel=0.2)


@pytest.mark.own_kernels
def test_the_plan_leaves_out_what_a_scene_does_not_need():
    emitting = ic.plan(ic.Scene((hidden_mesh(),)), EYE, resolution=4)
    assert emitting.config.max_bounces == 0
    assert not emitting.config.has_reflection
    assert not emitting.config.has_lights
    assert not emitting.config.has_flats
    lit = ic.plan(lit_wall(lights=(ic.PointLight((0, 1, 0), UNIT),)), EYE, resolution=4)
    assert lit.config.has_lights
    assert not lit.config.has_triangles
    assert "shadow rays" in lit.explain()
    sky = ic.plan(lit_wall(background=UNIT), EYE, resolution=4)
    assert not sky.config.has_lights


def test_psf_methods_refuse_scattered_light():
    with pytest.raises(ic.InvalidInputError, match="object 'wall' is Diffuse"):
        ic.psf_baseline.render(lit_wall(), EYE)


def test_psf_methods_see_meshes():
    quad = ic.Quad((-0.02, -0.02, -0.5), (0.04, 0, 0), (0, 0.04, 0))
    where = {"fov_deg": 3.0, "resolution": 24, **ONE}
    images = [
        ic.psf_baseline.render(
            ic.Scene((ic.SceneObject("it", shape, ic.Emission(UNIT)),)), EYE, **where
        ).irradiance.values
        for shape in (quad, quad_mesh(quad))
    ]
    np.testing.assert_allclose(images[1], images[0], atol=2e-3 * images[0].max())


def test_materials_that_would_make_light_are_refused():
    with pytest.raises(ic.InvalidInputError, match="reflectance times texture must be <= 1"):
        ic.Diffuse(ic.Spectrum.constant(1.1))
    with pytest.raises(ic.InvalidInputError, match="reflectance times texture must be <= 1"):
        ic.Diffuse(ic.Spectrum.constant(0.8), ic.Checkerboard(2, 2, 1.5, 0.0))
    w = np.array([400.0, 500.0, 600.0, 700.0])
    parts = [ic.Spectrum(w, np.roll([0.9, 0.05, 0.05, 0.0], i)) for i in range(3)]
    picture = ic.Image(np.ones((2, 2, 3)))
    assert ic.Diffuse(tuple(parts), picture).spectra() == tuple(parts)
    with pytest.raises(ic.InvalidInputError, match=r"must be <= 1, got 1\.89"):
        ic.Diffuse((parts[0], parts[0].scaled(1.1), parts[1]), picture)


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: ic.Mesh([[0, 0]], [[0, 0, 0]]), "vertices_m must have shape"),
        (lambda: ic.Mesh([[0, 0, np.nan]], [[0, 0, 0]]), "finite .* vertex 0"),
        (lambda: ic.Mesh([[0, 0, 0]], [[0, 0, 1]]), "indices from 0 to 0.* face 0"),
        (lambda: ic.Mesh([[0, 0, 0]], [[0, 0, 0.5]]), "indices"),
        (lambda: ic.Mesh([[0, 0, 0]], np.zeros((0, 3))), "faces must have shape"),
        (lambda: ic.Mesh([[0, 0, 0]], [[0, 0, 0]], uv=[[0, 0, 0]]), "uv must be finite"),
        (lambda: ic.Mesh([[0, 0, 0]], [[0, 0, 0]]).moved(np.zeros((4, 4))), "affine"),
        (lambda: ic.DistantLight((0, 0, 0), UNIT), "towards must not be zero"),
        (lambda: ic.PointLight((0, 0, np.inf), UNIT), "three finite numbers"),
        (lambda: ic.load_mesh("nothing.ply"), "does not exist"),
    ],
)
def test_bad_meshes_and_lights_are_refused(make, match):
    with pytest.raises(ic.IsetclError, match=match):
        make()


@pytest.mark.parametrize("extension", ["ply", "obj", "stl", "off", "glb"])
def test_mesh_files_are_read(tmp_path, extension):
    box = trimesh.creation.box(extents=(0.1, 0.2, 0.3))
    path = tmp_path / f"box.{extension}"
    box.export(path)
    mesh = ic.load_mesh(path)
    assert len(mesh.faces) == 12
    np.testing.assert_allclose(np.ptp(mesh.vertices_m, axis=0), [0.1, 0.2, 0.3], rtol=1e-6)
    assert ic.load_mesh(path, smooth=True).normals.shape == mesh.vertices_m.shape


def test_files_without_triangles_are_refused(tmp_path):
    path = tmp_path / "words.ply"
    path.write_text("no mesh")
    with pytest.raises(ic.FileError, match=r"words\.ply"):
        ic.load_mesh(path)


def test_a_moved_mesh_keeps_its_normals_upright():
    quad = quad_mesh(ic.Quad((0, 0, 0), (1, 0, 0), (0, 1, 0)))
    mesh = dataclasses.replace(quad, normals=np.tile([0.0, 0.0, 1.0], (4, 1)))
    matrix = np.eye(4)
    # A shear in z by x: the plane z = x has the normal (-1, 0, 1) / sqrt 2.
    matrix[2, 0] = 1.0
    moved = mesh.moved(matrix)
    np.testing.assert_allclose(moved.vertices_m[:, 2], moved.vertices_m[:, 0])
    np.testing.assert_allclose(moved.normals, np.tile([-1, 0, 1], (4, 1)) / np.sqrt(2))


def test_a_light_field_sends_each_direction_its_view(precision):
    """A quad at 1 m whose views grow along u: at x it is seen along slope -x, so it darkens."""
    ramp = np.arange(9.0).reshape(1, 1, 1, 9)
    field = ic.LightField(ramp, (20.0, 20.0))
    quad = ic.Quad((-0.1, -0.1, -1.0), (0.2, 0, 0), (0, 0.2, 0))
    scene = ic.Scene((ic.SceneObject("display", quad, ic.Emission(UNIT, field)),))
    where = {"fov_deg": 8.0, "resolution": 16, "spp": 64, "precision": precision, **ONE}
    image = ic.render(scene, EYE, **where)
    even = ic.render(ic.scenes.uniform(spectrum=UNIT), EYE, **where)
    found = (image.irradiance / even.irradiance).values[0].mean(axis=0)
    x = np.tan(np.radians(image.irradiance.x.values))
    expected = (-x / np.tan(np.radians(10.0)) + 1) / 2 * 9 - 0.5
    # Angles are polar from the axis and the pupil lies 3 mm behind the cornea: 0.3 % of the slope.
    np.testing.assert_allclose(found, expected, atol=0.04)
    assert expected[0] - expected[-1] > 3.0


@pytest.mark.filterwarnings("ignore:no light of scene")
def test_a_light_field_is_dark_from_behind_and_lights_a_wall():
    """Views alike: it shines as an even front does; on a wall too, within 3 standard errors."""
    even_views = ic.LightField(np.ones((2, 2, 3, 3)), (178.0, 178.0))
    lamp = ic.Quad((-0.2, 0.4, -0.9), (0.4, 0, 0), (0, 0, 0.4))
    found = {}
    for name, texture in (("views", even_views), ("even", None)):
        emission = ic.Emission(UNIT.scaled(50.0), texture, sides="front")
        turned = ic.Quad((-0.2, 0.4, -0.5), (0.4, 0, 0), (0, 0, -0.4))
        for side, quad in (("up", lamp), ("down", turned)):
            scene = lit_wall(ic.SceneObject("lamp", quad, emission))
            found[name, side] = radiance_of(scene, max_bounces=1)
    lit = "down" if found["even", "down"][0] > found["even", "up"][0] else "up"
    dark = "up" if lit == "down" else "down"
    assert found["views", dark][0] == found["even", dark][0] == 0.0
    a, b = found["views", lit], found["even", lit]
    assert a[0] == pytest.approx(b[0], abs=4 * np.hypot(a[1], b[1]) + 1e-3 * b[0])


@pytest.mark.slow
@pytest.mark.own_kernels
def test_pictures_are_read_as_wide_as_the_ray(monkeypatch):
    """A floor of random texels: far away a pixel covers many, near by it does not cover one.

    Levels keep the mean, and take the noise away that single texels make.
    """
    from isetcl.render import plan_paths

    texels = np.random.default_rng(5).integers(0, 2, size=(1024, 1024)).astype(float)
    floor = ic.Quad((-2.0, -0.3, 0.0), (4.0, 0, 0), (0, 0, -8.0))
    # Light of its own, turned to a wall's light by a material that keeps the path pipeline.
    item = ic.SceneObject(
        "floor", floor, ic.Emission(UNIT, ic.Image(texels, wrap="repeat", repeats=(16, 16)))
    )
    scene = ic.Scene((item, hidden_mesh()))
    where = {"fov_deg": 30.0, "resolution": 32, "centre_deg": (0.0, -17.0), **ONE}
    truth = ic.render(scene, EYE, spp=2048, seed=3, **where).irradiance.values[0]
    with_levels = ic.render(scene, EYE, spp=8, **where)
    assert ic.plan(scene, EYE, **where).config.has_levels
    monkeypatch.setattr(plan_paths, "SMALLEST_LEVEL", 1 << 20)
    assert not ic.plan(scene, EYE, **where).config.has_levels
    without = ic.render(scene, EYE, spp=8, **where)
    sharp = ic.render(scene, EYE, spp=2048, seed=4, **where).irradiance.values[0]
    scale = truth.mean()
    # The plan has averaged for the nearest part already; farther rows gain.
    far = slice(2, 9)
    assert np.sqrt(np.mean((truth - sharp) ** 2)) < 0.02 * scale
    assert truth.mean() == pytest.approx(sharp.mean(), rel=2e-3)
    noise = [
        np.sqrt(np.mean((image.irradiance.values[0] - truth)[far] ** 2)) / scale
        for image in (with_levels, without)
    ]
    assert noise[0] < 0.5 * noise[1]

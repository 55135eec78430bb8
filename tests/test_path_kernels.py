"""One kernel or stages, any tiles, either precision: the same image; and no NaN in hard scenes."""

import numpy as np
import pytest
from path_views import EVERYTHING, EYE, HALF, UNIT, pipeline_of, pixels_of, placed, quad_mesh
from slow_cases import slow_after

import isetcl as ic
from isetcl.render import plan as plan_module

# Kernels with everything compiled in take long to build; in double precision, a second time.
FEW = pytest.mark.usefixtures("few_lanes")
BOTH = pytest.mark.parametrize(
    "precision", ["single", pytest.param("double", marks=pytest.mark.slow)]
)

WALL = ic.SceneObject("wall", ic.Quad((-5, -5, -1), (10, 0, 0), (0, 10, 0)), HALF)
GLASS = ic.Medium("glass", ic.ConstantIndex(1.5))


def rich_scene():
    """Something of everything: most of the code of the kernels."""
    board = ic.Checkerboard(3, 3, 1.0, 0.2)
    picture = ic.Image(np.random.default_rng(0).random((6, 8)))
    tetra = ic.Mesh(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        uv=[[0, 0], [1, 0], [0, 1], [1, 1]],
    )
    gold = ic.ComplexIndex([300.0, 900.0], [0.2, 0.2], [3.0, 3.0], "metal")
    item = ic.SceneObject
    objects = (
        WALL,
        item("leaf", ic.Quad((-0.2, -0.2, -0.8), (0.2, 0, 0), (0, 0.2, 0)), HALF, opacity=board),
        item(
            "veil",
            ic.Quad((-0.2, 0.0, -0.7), (0.4, 0, 0), (0, 0.1, 0)),
            ic.Emission(UNIT.scaled(0.1), is_additive=True),
        ),
        item("ball", ic.Sphere((0.1, -0.05, -0.8), 0.06), ic.Dielectric(GLASS)),
        item(
            "stone",
            ic.Instance(tetra, placed(0.12, 30, (1, 1, 0), (0.02, 0.02, -0.85))),
            ic.Mix(ic.Coated(UNIT.scaled(0.5), picture), ic.Conductor(gold, roughness=0.3), 0.4),
        ),
        item(
            "stone 2",
            ic.Instance(tetra, placed(-0.1, 80, (1, 2, 0), (-0.1, 0.08, -0.85))),
            ic.TwoSided(ic.Mirror(UNIT.scaled(0.8)), HALF),
        ),
        item("lamp", ic.Sphere((0.3, 0.6, -0.4), 0.05), ic.Emission(UNIT.scaled(20.0), board)),
        item(
            "panel",
            quad_mesh(ic.Quad((-0.6, 0.5, -0.9), (0.3, 0, 0), (0, 0, 0.3))),
            ic.Emission(UNIT.scaled(5.0), sides="front"),
        ),
        item(
            "sheet",
            ic.Disc((-0.08, -0.12, -0.75), 0.05, (1, 0, 2)),
            ic.Diffuse(UNIT.scaled(0.3), ic.Grid(4, 4, 0.2, 1.0, 0.5), UNIT.scaled(0.4)),
        ),
    )
    sky = ic.Environment(UNIT.scaled(0.4), ic.Image(np.random.default_rng(1).random((8, 16))))
    spot = ic.SpotLight((0, 0.8, 0), (0, -0.8, -1), UNIT, cone_deg=30, penumbra_deg=10)
    return ic.Scene(objects, sky, lights=(spot, ic.PointLight((0.5, 0.1, -0.3), UNIT)))


WHERE = {"fov_deg": 24.0, "resolution": 24, "max_bounces": 6}


def film_of(is_fused, precision="single", samples=16):
    changes = EVERYTHING | {"is_fused": is_fused}
    pipeline, tile = pipeline_of(rich_scene(), changes, precision=precision, **WHERE)
    return pipeline.sample(tile, samples, 7)


@pytest.mark.slow
@BOTH
@FEW
def test_stages_give_the_image_of_the_one_kernel(precision):
    fused, staged = film_of(True, precision), film_of(False, precision)
    off = np.abs(staged - fused)[0] / fused[0].mean()
    assert fused[0].min() > 0
    # Compilers round otherwise; a few paths meet an edge on its other side.
    assert np.median(off) < 1e-5
    assert np.mean(off > 1e-2) < 0.05


@pytest.mark.slow
@FEW
def test_single_and_double_agree_but_for_paths_at_edges():
    single, double = film_of(True, "single", 64), film_of(True, "double", 64)
    off = np.abs(single - double)[0] / double[0].mean()
    assert np.median(off) < 2e-3
    assert single[0].mean() == pytest.approx(double[0].mean(), rel=5e-3)


@pytest.mark.parametrize("is_fused", [True, pytest.param(False, marks=pytest.mark.slow)])
@pytest.mark.slow
@FEW
def test_any_tiles_give_the_same_bits(is_fused, monkeypatch):
    monkeypatch.setattr(plan_module, "_decide_fused", lambda device, notes: is_fused)
    where = {"fov_deg": 24.0, "resolution": (50, 30), "spp": 10, "max_bounces": 4, "seed": 3}
    images, tiles = [], set()
    for pixels in (1 << 30, 700, 130):
        monkeypatch.setattr(plan_module, "_TILE_FILM_BYTES", pixels * 16 * 2)
        monkeypatch.setattr(plan_module, "_TILE_PATHS_BYTES", pixels * 2 * 8 * 160)
        image = ic.render(
            rich_scene(), EYE, wavelengths_nm=[450.0, 650.0], bands=2, precision="single", **where
        )
        tiles.add(tuple(image.provenance["tile"]))
        images.append(image.irradiance.values)
    assert len(tiles) == 3
    for image in images[1:]:
        np.testing.assert_array_equal(image, images[0])


@FEW
@pytest.mark.slow
def test_samples_of_the_stages_agree_with_their_mean():
    """The mean film is what the launches add up to, whatever their number."""
    changes = EVERYTHING | {"is_fused": False}
    pipeline, tile = pipeline_of(rich_scene(), changes, precision="single", **WHERE)
    whole = pipeline.sample(tile, 12, 3)
    parts = [part * (count / 12) for part, count in pipeline.parts(tile, 12, 3)]
    assert len(parts) == 2
    np.testing.assert_allclose(np.sum(parts, axis=0), whole, rtol=1e-12)


def scaled_scene(size):
    """A lit corner with a ball and a mesh, of a size in metres."""
    s = size
    lamp = ic.Quad((-s, 2 * s, -2 * s), (2 * s, 0, 0), (0, 0, 2 * s))
    floor = ic.Quad((-4 * s, -s, -8 * s), (0, 0, 16 * s), (8 * s, 0, 0))
    ball = ic.Sphere((0.4 * s, 0, -3 * s), 0.6 * s)
    mesh = quad_mesh(ic.Quad((-s, -s, -4 * s), (2 * s, 0, 0), (0, 2 * s, s)), steps=5)
    smooth = ic.Mesh(mesh.vertices_m, mesh.faces, np.tile([0.0, -1.0, 2.0], (36, 1)), mesh.uv)
    stone = ic.Instance(smooth, placed((0.3, 0.2, 0.4), 50, (1, 2, 3), (-s, 0, -2 * s)))
    power = UNIT.scaled(size**2)
    return ic.Scene(
        (
            ic.SceneObject("floor", floor, HALF),
            ic.SceneObject("lamp", lamp, ic.Emission(UNIT)),
            ic.SceneObject("ball", ball, ic.Dielectric(GLASS)),
            ic.SceneObject("mesh", smooth, HALF, emission=ic.Emission(UNIT.scaled(0.1))),
            ic.SceneObject("stone", stone, ic.Mirror(UNIT, roughness=0.2)),
        ),
        lights=(ic.PointLight((0, s, 0), power),),
    )


@pytest.mark.parametrize("size", slow_after(0, [1e-3, 1e3, 1e9]))
@BOTH
@FEW
def test_scenes_look_alike_whatever_their_size(size, precision):
    """As seen from the middle: far from the cornea all that counts are angles."""
    eye = ic.eyes.navarro(0.05)
    where = {"eye": eye, "fov_deg": 40.0, "resolution": 6, "spp": 256, "max_bounces": 5}
    metre, error = pixels_of(scaled_scene(10.0), precision=precision, **where)
    other, other_error = pixels_of(scaled_scene(size), precision=precision, **where)
    spread = np.hypot(error, other_error)
    # At a millimetre the eye's own size counts; there only that all numbers are finite.
    if size > 1e-2:
        assert np.mean(np.abs(metre - other) < 5 * spread + 0.02 * metre) > 0.9
        assert other.mean() == pytest.approx(metre.mean(), rel=0.05)


@BOTH
@FEW
@pytest.mark.slow
def test_tiny_scenes_have_finite_pixels(precision):
    """Shapes of a micrometre right before the cornea."""
    pipeline, tile = pipeline_of(
        scaled_scene(1e-6), EVERYTHING, fov_deg=40.0, max_bounces=5, precision=precision
    )
    assert np.isfinite(pipeline.sample(tile, 32, 1)).all()


HARD = {
    "no area": (
        ic.SceneObject(
            "it",
            ic.Mesh(
                [[0, 0, -1], [0.1, 0, -1], [0.2, 0, -1], [0, 0.1, -1]],
                [[0, 1, 2], [0, 0, 0], [0, 1, 3]],
                normals=np.zeros((4, 3)),
            ),
            HALF,
            emission=ic.Emission(UNIT),
        ),
    ),
    "inside a mesh": (
        ic.SceneObject(
            "it",
            quad_mesh(ic.Quad((-1, -1, 0), (2, 0, 0), (0, 2, 0)), steps=2),
            ic.Dielectric(GLASS, roughness=0.4),
            emission=ic.Emission(UNIT),
        ),
    ),
    "in one place": (
        WALL,
        ic.SceneObject("again", WALL.shape, HALF, emission=ic.Emission(UNIT)),
        ic.SceneObject("third", quad_mesh(WALL.shape), HALF, opacity=0.5),
    ),
    "a light in a surface": (WALL, ic.SceneObject("it", ic.Sphere((0, 0, -1), 1.0), HALF)),
    "edge on": (
        ic.SceneObject(
            "it", ic.Quad((0, -1, -3), (0, 2, 0), (0, 0, 3)), HALF, emission=ic.Emission(UNIT)
        ),
        WALL,
    ),
    "needle": (
        WALL,
        ic.SceneObject(
            "it",
            ic.Mesh([[0, 0, -0.5], [1e-9, 0, -0.5], [0, 0.1, -0.5]], [[0, 1, 2]]),
            ic.Emission(UNIT.scaled(1e9)),
        ),
    ),
    "narrow metal": (
        ic.SceneObject("it", ic.Sphere((0, 0, 0), 1.0), ic.Mirror(UNIT, roughness=1e-4)),
        ic.SceneObject("lamp", ic.Sphere((0.2, 0.2, -0.3), 1e-5), ic.Emission(UNIT.scaled(1e6))),
    ),
}


@pytest.mark.parametrize("name", HARD)
@BOTH
@FEW
def test_no_scene_makes_pixels_that_are_no_numbers(name, precision):
    lights = (
        ic.PointLight((0, 0, -1), UNIT),
        ic.SpotLight((0, 0, 0), (0, 0, -1), UNIT, cone_deg=1e-3, penumbra_deg=0.0),
        ic.PointLight((0, 0, 0.1), UNIT.scaled(0.0)),
    )
    scene = ic.Scene(HARD[name], UNIT, lights=lights)
    pipeline, tile = pipeline_of(
        scene, EVERYTHING, fov_deg=20.0, resolution=8, max_bounces=12, precision=precision
    )
    for stream in range(1, 5):
        film = pipeline.sample(tile, 16, stream)
        assert np.isfinite(film).all()
        assert film.min() >= 0


@pytest.mark.slow
def test_what_is_compiled_in_without_need_changes_nothing(request):
    """The kernels of a plan, and those that tests share, give the same image to rounding."""
    scenes = {name: make() if callable(make) else make for name, make in SHARED.items()}
    where = {"fov_deg": 6.0, "resolution": 16, "spp": 16, "seed": 5, "max_bounces": 3}
    own = {n: ic.render(s, EYE, **where).irradiance.values for n, s in scenes.items()}
    request.getfixturevalue("shared_kernels")
    for name, scene in scenes.items():
        shared = ic.render(scene, EYE, **where).irradiance.values
        off = np.abs(shared - own[name])
        assert np.mean(off > 1e-4 * own[name].max()) < 0.01, name
        assert shared.mean() == pytest.approx(float(own[name].mean()), rel=1e-3), name


def lit_floor(material, *more, **parts):
    floor = ic.SceneObject("floor", ic.Quad((-1, -0.2, 0), (2, 0, 0), (0, 0, -2)), material)
    lamp = ic.SceneObject("lamp", ic.Quad((-0.2, 0.6, -1), (0.4, 0, 0), (0, 0, 0.4)), LAMP)
    return ic.Scene((floor, lamp, *more), ic.Spectrum.constant(0.2), **parts)


LAMP = ic.Emission(ic.Spectrum.constant(5.0))
SHARED = {
    "matt": lit_floor(ic.Diffuse(ic.Spectrum.constant(0.5), ic.Checkerboard(8, 8, 1.0, 0.3))),
    "glossy": lit_floor(ic.Mirror(ic.Spectrum.constant(0.8), 0.3)),
}

"""Textures in whole renders: what is seen is the weight at the place that is looked at."""

import numpy as np
import pytest
from path_views import HALF, PINHOLE, UNIT, chief_rays, pixels_of, quad_mesh, radiance_of
from slow_cases import slow_after

import isetcl as ic
from isetcl.scene.view import intersect

pytestmark = pytest.mark.usefixtures("shared_kernels")

QUAD = ic.Quad((-0.06, -0.05, -1), (0.12, 0.01, 0.02), (0.0, 0.1, 0.01))
WHERE = {"fov_deg": 5.0, "resolution": 10}
PICTURE = np.random.default_rng(2).random((7, 5))
SHAPES = {
    "quad": QUAD,
    "mesh": quad_mesh(QUAD),
    "instance": ic.Instance(quad_mesh(QUAD), np.eye(4)),
}
TEXTURES = {
    "grid": ic.Grid(3.3, 2.1, 0.3, 0.9, 0.2),
    "board": ic.Checkerboard(2.5, 1.5, 0.8, 0.1),
    "picture": ic.Image(PICTURE),
    "repeated": ic.Image(PICTURE, wrap="repeat", repeats=(2.5, 1.7), offset=(0.3, -4.2)),
    "mirrored": ic.Image(PICTURE, wrap="repeat", repeats=(-1.0, -2.0), offset=(0.1, 0.0)),
    "clamped": ic.Image(PICTURE, wrap="clamp", repeats=(2.0, 3.0), offset=(-0.5, -1.0)),
    "one texel": ic.Image(np.array([[0.6]]), wrap="repeat", repeats=(3.0, 3.0)),
    "one row": ic.Image(PICTURE[:1], wrap="repeat", offset=(0.5, 0.5)),
}


def weights_seen(texture, shape=QUAD, across=16):
    """Mean weights in pixels, and which pixels lie inside the shape."""
    origin, directions = chief_rays(**WHERE, across=across)
    hits = intersect(shape, origin, directions)
    inside = np.isfinite(hits.distance_m)
    weights = np.where(inside, texture.weights(hits.u, hits.v)[..., 0], 0.0)
    return weights.mean(axis=(2, 3)), inside.all(axis=(2, 3))


@pytest.mark.parametrize("shape", ["quad", "mesh", "instance"])
@pytest.mark.parametrize("name", TEXTURES)
def test_a_texture_is_seen_by_its_weights(name, shape):
    """Emission on meshes in place; under an even sky the reflectance of instances."""
    texture = TEXTURES[name]
    is_lit = shape == "instance"
    material = ic.Diffuse(UNIT, texture) if is_lit else ic.Emission(UNIT, texture)
    scene = ic.Scene((ic.SceneObject("it", SHAPES[shape], material),), UNIT)
    found, _ = pixels_of(scene, eye=PINHOLE, spp=256, max_bounces=1, **WHERE)
    expected, inside = weights_seen(texture)
    assert inside.sum() > 30
    # Sharp edges: the area of a pixel by 256 points on each side.
    np.testing.assert_allclose(found[inside], expected[inside], atol=0.035)
    assert found[inside].mean() == pytest.approx(expected[inside].mean(), abs=3e-3)


def test_a_spectral_picture_weighs_every_channel():
    texels = np.random.default_rng(3).random((6, 6, 5))
    spectra = tuple(UNIT.scaled(float(k + 1)) for k in range(5))
    picture = ic.Image(texels, wrap="repeat", repeats=(1.5, 1.0))
    scene = ic.Scene((ic.SceneObject("it", QUAD, ic.Emission(spectra, picture)),))
    found, _ = pixels_of(scene, eye=PINHOLE, spp=128, **WHERE)
    origin, directions = chief_rays(**WHERE)
    hits = intersect(QUAD, origin, directions)
    values = picture.weights(hits.u, hits.v) @ np.arange(1.0, 6.0)
    inside = np.isfinite(hits.distance_m).all(axis=(2, 3))
    expected = values.mean(axis=(2, 3))
    np.testing.assert_allclose(found[inside], expected[inside], rtol=0.02)


@pytest.mark.parametrize("shape", slow_after(1, ["quad", "mesh"]))
def test_mixed_materials_are_weighed_by_a_texture(shape):
    """White and black, by a picture: reflectance 1 - weight; a nested mix multiplies."""
    black, white = ic.Diffuse(UNIT.scaled(0.0)), ic.Diffuse(UNIT)
    mix = ic.Mix(white, ic.Mix(black, white, 0.25), TEXTURES["repeated"])
    scene = ic.Scene((ic.SceneObject("it", SHAPES[shape], mix),), UNIT)
    found, errors = pixels_of(scene, eye=PINHOLE, spp=256, max_bounces=1, **WHERE)
    weight, inside = weights_seen(TEXTURES["repeated"])
    expected = 1.0 - 0.75 * weight
    off = (found - expected)[inside]
    assert np.all(np.abs(off) < 0.15)
    assert off.mean() == pytest.approx(0.0, abs=4 * errors[inside].mean() / np.sqrt(inside.sum()))
    assert np.corrcoef(found[inside], expected[inside])[0, 1] > 0.95


@pytest.mark.slow
def test_roughness_may_be_a_texture():
    """Two fields of a board are as rough as two plain mirrors."""
    sky = ic.Environment(UNIT, ic.Image(np.linspace(0.0, 2.0, 12)[:, None] ** 2 * np.ones(8)))
    tilted = ic.Quad((-0.06, -0.05, -1), (0.12, 0, 0), (0.0, 0.1, 0.06))

    def seen(roughness):
        item = ic.SceneObject("it", tilted, ic.Mirror(UNIT, roughness=roughness))
        return pixels_of(ic.Scene((item,), sky), eye=PINHOLE, spp=256, max_bounces=1, **WHERE)[0]

    board = ic.Checkerboard(1, 1, 0.6, 0.2)
    rough, satin, both = seen(0.6), seen(0.2), seen(board)
    origin, directions = chief_rays(**WHERE, across=5, margin=0.2)
    hits = intersect(tilted, origin, directions)
    weight = np.where(np.isfinite(hits.distance_m), board.weights(hits.u, hits.v)[..., 0], 0.0)
    for level, plain in ((0.6, rough), (0.2, satin)):
        here = (weight == level).all(axis=(2, 3))
        assert here.sum() > 8
        assert both[here].mean() == pytest.approx(plain[here].mean(), rel=0.01)
        assert abs(rough - satin)[here].mean() > 0.05 * satin[here].mean()


@pytest.mark.parametrize("name", ["repeated", "grid", "board", "clamped"])
@pytest.mark.parametrize("far", [3e5, 1e9, -1e9, 1e18])
def test_texture_coordinates_far_outside_stay_among_the_weights(name, far):
    mesh = quad_mesh(QUAD)
    moved = ic.Mesh(mesh.vertices_m, mesh.faces, uv=mesh.uv + np.array([far, -far]))
    texture = TEXTURES[name]
    scene = ic.Scene((ic.SceneObject("it", moved, ic.Emission(UNIT, texture)),))
    found, _ = pixels_of(scene, eye=PINHOLE, spp=16, **WHERE)
    _, inside = weights_seen(texture)
    low = {"grid": 0.2, "board": 0.1}.get(name, PICTURE.min())
    high = {"grid": 0.9, "board": 0.8}.get(name, PICTURE.max())
    assert found[inside].min() > low - 1e-3
    assert found[inside].max() < high + 1e-3


@pytest.mark.parametrize("reflects", slow_after(1, [True, False]))
def test_a_mesh_without_coordinates_has_the_texture_of_its_corner(reflects):
    texture = ic.Checkerboard(2, 2, 0.7, 0.1)
    material = ic.Diffuse(UNIT, texture) if reflects else ic.Emission(UNIT, texture)
    other = ic.SceneObject("other", quad_mesh(ic.Quad((0, 0, -3), (1, 0, 0), (0, 1, 0))), HALF)
    bare = ic.SceneObject("it", quad_mesh(QUAD, uv=False), material)
    for objects in ((bare,), (bare, other)):
        found, _ = radiance_of(ic.Scene(objects, UNIT), spp=16)
        assert found == pytest.approx(0.7, rel=1e-4)

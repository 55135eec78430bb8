"""Scenes written as PBRT read back as the same scenes."""

import warnings

import numpy as np
import pytest
from scene_same import assert_same

import isetcl as ic
from isetcl.scene.colour import reflectance_primaries
from isetcl.scene.display import display_primaries

GRID = np.arange(400.0, 701.0, 5.0)
RED = ic.Spectrum(GRID, np.where(GRID > 580, 0.7, 0.05) + GRID * 1e-5, "red")
GREY = ic.Spectrum.constant(0.4)
LIGHT = ic.Spectrum(GRID, 0.3 + np.sin(GRID / 40.0) ** 2, "light")
RNG = np.random.default_rng(1)
QUAD = ic.Quad((-0.3, 0.1, -1.0), (0.4, 0.1, 0.0), (0.0, 0.5, -0.2))
DISC = ic.Disc((0.1, 0.2, -2.0), 0.3, (0.0, 0.6, 0.8))
SPHERE = ic.Sphere((0.3, -0.2, -3.0), 0.25)
MESH = ic.Mesh(
    np.array([[0, 0, -1], [1, 0, -1], [0, 1, -1], [0.3, 0.2, -2.1]]) / 3.0,
    [[0, 1, 2], [0, 3, 1], [1, 3, 2]],
    uv=RNG.random((4, 2)),
)
SMOOTH = ic.Mesh(
    MESH.vertices_m,
    MESH.faces[:1],
    np.array([[0, 0, 1.0], [0, 0.6, 0.8], [0.6, 0, 0.8], [0, 0, 1]]),
)
MATRIX = np.array([[0, -2.0, 0, 0.1], [2, 0, 0, 0.2], [0, 0, 2, -4], [0, 0, 0, 1.0]])
MIRRORED = np.diag([-1.0, 1.0, 3.0, 1.0])
TEXELS = RNG.random((5, 7)).astype(np.float32)
COLOURED = RNG.random((4, 3, 3)).astype(np.float32)
SPECTRAL = RNG.random((4, 3, 5)).astype(np.float32) / 5.0
FIVE = tuple(ic.Spectrum(GRID, (GRID / 1000.0) ** i, f"s{i}") for i in range(5))
GREY_IMAGE = ic.Image(TEXELS, wrap="repeat", repeats=(3.0, 2.0), offset=(0.25, 0.5))
COPPER = ic.ComplexIndex(GRID, 0.3 + GRID / 1000.0, 2.0 + GRID / 500.0)


def saved(tmp_path, scene):
    path = tmp_path / "scene.pbrt"
    scene.save(path)
    return ic.load_scene(path)


def round_trip(tmp_path, scene):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = saved(tmp_path, scene)
    assert_same(scene, again)


MATERIALS = {
    "diffuse": ic.Diffuse(RED),
    "translucent": ic.Diffuse(GREY, transmittance=RED.scaled(0.5)),
    "checkerboard": ic.Diffuse(RED, ic.Checkerboard(4.0, 2.5, 0.9, 0.1)),
    "grey image": ic.Diffuse(RED, GREY_IMAGE),
    "rgb image": ic.Diffuse(reflectance_primaries(), ic.Image(COLOURED)),
    "spectral image": ic.Diffuse(FIVE, ic.Image(SPECTRAL)),
    "coated": ic.Coated(RED, index=ic.Medium("coat", ic.ConstantIndex(1.4)), roughness=0.2),
    "conductor": ic.Conductor(COPPER, 0.1),
    "glass": ic.Dielectric(ic.Medium("glass", ic.ConstantIndex(1.5))),
    "rough glass": ic.Dielectric(ic.Medium("glass", ic.ConstantIndex(1.5)), GREY_IMAGE),
    "mix": ic.Mix(ic.Diffuse(RED), ic.Conductor(COPPER), 0.25),
    "textured mix": ic.Mix(ic.Diffuse(RED), ic.Coated(GREY), ic.Checkerboard(3.0, 4.0)),
    "emission": ic.Emission(LIGHT),
    "one-sided emission": ic.Emission(LIGHT, sides="front"),
    "luminous checkerboard": ic.Emission(LIGHT, ic.Checkerboard(8.0, 8.0)),
    "luminous grey checkerboard": ic.Emission(LIGHT, ic.Checkerboard(8.0, 8.0, 1.0, 0.25)),
    "display": ic.Emission(display_primaries(250.0), ic.Image(COLOURED)),
    "black": ic.Diffuse(ic.Spectrum.constant(0.0)),
}


@pytest.mark.parametrize("name", MATERIALS)
def test_materials_come_back(tmp_path, name):
    round_trip(tmp_path, ic.Scene((ic.SceneObject("it", QUAD, MATERIALS[name]),)))


@pytest.mark.parametrize(
    "shape",
    [QUAD, DISC, SPHERE, MESH, SMOOTH, ic.Instance(MESH, MATRIX), ic.Instance(MESH, MIRRORED)],
    ids=lambda shape: type(shape).__name__,
)
def test_shapes_come_back(tmp_path, shape):
    for material in (ic.Diffuse(RED), ic.Emission(LIGHT, sides="front")):
        if isinstance(shape, ic.Instance) and isinstance(material, ic.Emission):
            continue
        round_trip(tmp_path, ic.Scene((ic.SceneObject("it", shape, material),)))


def test_textured_spheres_and_meshes_come_back(tmp_path):
    material = MATERIALS["checkerboard"]
    shapes = (SPHERE, MESH, QUAD)
    round_trip(tmp_path, ic.Scene(tuple(ic.SceneObject("it", s, material) for s in shapes)))


def test_instances_share_their_mesh(tmp_path):
    other = MATRIX.copy()
    other[0, 3] = 5.0
    items = tuple(
        ic.SceneObject("it", ic.Instance(MESH, m), MATERIALS["conductor"]) for m in (MATRIX, other)
    )
    again = saved(tmp_path, ic.Scene(items))
    assert_same(items, again.objects)
    assert again.objects[0].shape.mesh is again.objects[1].shape.mesh
    assert len(list(tmp_path.glob("*.ply"))) == 1


def test_lights_come_back(tmp_path):
    lights = (
        ic.PointLight((0.1, 0.2, -0.3), LIGHT),
        ic.SpotLight((0.0, 1.0, -1.0), (0.0, -0.6, -0.8), LIGHT, cone_deg=20.0, penumbra_deg=7.0),
        ic.DistantLight((0.3, 1.0, 0.2), LIGHT),
    )
    round_trip(tmp_path, ic.Scene((), LIGHT, lights=lights))


def test_opacity_and_emission_beside_scattering_come_back(tmp_path):
    items = (
        ic.SceneObject("a", QUAD, ic.Diffuse(RED), emission=ic.Emission(LIGHT), opacity=0.3),
        ic.SceneObject("b", QUAD, ic.Coated(RED), opacity=ic.Checkerboard(3.0, 3.0)),
        ic.SceneObject("c", MESH, ic.Emission(LIGHT), opacity=ic.Image(TEXELS)),
        ic.SceneObject("d", QUAD, MATERIALS["luminous checkerboard"], opacity=0.5),
    )
    round_trip(tmp_path, ic.Scene(items))


def test_a_dispersive_glass_comes_back_in_steps_of_five_nanometres(tmp_path):
    glass = ic.Medium("glass", ic.AbbeDispersion(1.5168, 64.2))
    round_trip(tmp_path, ic.Scene((ic.SceneObject("it", MESH, ic.Dielectric(glass)),)))


def test_an_environment_comes_back_nearly_and_says_so(tmp_path):
    u, v = np.meshgrid((np.arange(64) + 0.5) / 64, 1 - (np.arange(32) + 0.5) / 32)
    texels = np.stack(
        [1 + 0.5 * np.sin(2 * np.pi * u), 1 + np.cos(np.pi * v), np.ones_like(u)], axis=-1
    )
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    sky = ic.Environment(display_primaries(30.0), ic.Image(texels, wrap="repeat"), turn)
    with pytest.warns(UserWarning, match="resampled"):
        again = saved(tmp_path, ic.Scene((), sky)).background
    d = RNG.normal(size=(500, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    a, b = (e.texture.weights(*e.coordinates(d)) for e in (sky, again))
    assert np.median(np.abs(a - b)) < 0.01
    assert np.max(np.abs(a - b)) < 0.2
    assert_same(sky.radiance, again.radiance)


@pytest.mark.parametrize(
    ("material", "match"),
    [
        (ic.Mirror(RED), "mirrors"),
        (ic.TwoSided(ic.Diffuse(RED), ic.Diffuse(GREY)), "sides differ"),
        (ic.Emission(LIGHT, is_additive=True), "let light pass"),
        (ic.UnlitReflectance(RED, LIGHT), "unlit"),
        (ic.Emission(LIGHT, ic.Image(TEXELS)), "sRGB"),
        (ic.Emission(LIGHT, ic.Grid(8.0, 8.0)), "blurred"),
        (ic.Emission(LIGHT, ic.LightField(RNG.random((4, 4, 2, 2)), (9.0, 9.0))), "alike"),
        (ic.Diffuse(RED, ic.Grid(8.0, 8.0)), "blurred"),
    ],
)
def test_what_pbrt_cannot_say_is_said(tmp_path, material, match):
    with pytest.warns(UserWarning, match=match):
        saved(tmp_path, ic.Scene((ic.SceneObject("it", QUAD, material),)))


def test_an_unlit_surface_comes_back_as_luminous_as_it_was(tmp_path):
    unlit = ic.UnlitReflectance(RED, LIGHT)
    with pytest.warns(UserWarning, match="unlit"):
        again = saved(tmp_path, ic.Scene((ic.SceneObject("it", QUAD, unlit),)))
    np.testing.assert_allclose(
        again.objects[0].material.radiance.at(GRID), RED.values * LIGHT.values, rtol=1e-12
    )


@pytest.mark.parametrize("name", ["scene.txt", "no/such/folder/scene.pbrt", "a\0b.pbrt"])
def test_a_bad_place_to_save_is_refused(tmp_path, name):
    with pytest.raises(ic.FileError):
        ic.Scene().save(tmp_path / name)


def test_targets_come_back(tmp_path):
    for scene in (ic.scenes.two_planes(0.5, 2.0), ic.scenes.slanted_edge(1.0)):
        again = saved(tmp_path, scene)
        assert_same(scene.objects, again.objects)
        assert (scene.background is None) == (again.background is None)


def test_objects_keep_their_names(tmp_path):
    grey = ic.Diffuse(GREY)
    tree = ic.Mesh(MESH.vertices_m, MESH.faces)
    names = ("a mug # 2", 'the "ring"', "birch", "oak", "lamp", "checks")
    shapes = (QUAD, SPHERE, ic.Instance(tree, MATRIX), ic.Instance(tree, MIRRORED), DISC, QUAD)
    emission = ic.Emission(LIGHT, ic.Checkerboard(8.0, 8.0, 1.0, 0.25))
    materials = (grey,) * 4 + (ic.Emission(LIGHT), emission)
    parts = zip(names, shapes, materials, strict=True)
    again = saved(tmp_path, ic.Scene(tuple(ic.SceneObject(*part) for part in parts)))
    assert tuple(item.name for item in again.objects) == names


def test_a_file_without_names_calls_objects_by_their_lines(tmp_path):
    path = tmp_path / "plain.pbrt"
    path.write_text('WorldBegin\n# a comment\nAttributeBegin\nShape "sphere"\nAttributeEnd\n')
    assert [item.name for item in ic.load_scene(path).objects] == ["sphere in line 4"]

"""Reading PBRT scenes, versions 3 and 4."""

import contextlib
import gzip
import struct
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import isetcl as ic
from isetcl.scene import view
from isetcl.scene.pbrt import files, parser, pictures, stage
from isetcl.scene.pbrt.surfaces import roughness_to_alpha
from isetcl.scene.pbrt.tokens import tokens

SCENES = Path(__file__).parent / "scenes"
PARTS = ("_materials", "_geometry", "_face")
WHOLE = sorted(p for p in SCENES.glob("*.pbrt") if not p.stem.endswith(PARTS))
HEAD = 'LookAt 0 0 0  0 0 1  0 1 0\nCamera "perspective"\nWorldBegin\n'
NM = np.arange(400.0, 701.0, 20.0)


def load(tmp_path, text, **options):
    path = tmp_path / "it.pbrt"
    path.write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return ic.load_scene(path, **options)


def world(tmp_path, text):
    return load(tmp_path, HEAD + text)


def material(tmp_path, text):
    return world(tmp_path, text + '\nShape "sphere"').objects[0].material


# What a scene shows


@pytest.mark.parametrize("path", WHOLE, ids=lambda p: p.stem)
def test_every_scene_loads(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        scene = ic.load_scene(path)
    assert len(scene.objects) >= 1


def test_the_versions_are_told_apart_by_their_words():
    for path in WHOLE:
        found = parser.parse(path, files.SceneFiles(path, allow_outside=False))
        from isetcl.scene.pbrt.version import version_of

        assert f"v{version_of(found)}" == path.stem[-2:], path.name


def test_right_in_pbrt_is_right_for_the_viewer_and_up_is_up(tmp_path):
    # PBRT's camera at the origin along +z has +x to the right of its picture.
    scene = world(tmp_path, 'Translate 1 0.5 3\nShape "sphere" "float radius" .1')
    assert scene.objects[0].shape.centre_m == (1.0, 0.5, -3.0)


def test_a_camera_elsewhere_sees_right_at_right(tmp_path):
    # From (5, 0, 0) along -x with z up: PBRT's right is up x forward = z x (-x) = -y.
    text = 'LookAt 5 0 0  0 0 0  0 0 1\nCamera "perspective"\nWorldBegin\n'
    scene = load(tmp_path, text + 'Translate 2 -.25 .5\nShape "sphere" "float radius" .1')
    np.testing.assert_allclose(scene.objects[0].shape.centre_m, (0.25, 0.5, -3.0), atol=1e-12)


def test_a_mirrored_camera_sees_left_at_right(tmp_path):
    scene = load(tmp_path, "Scale -1 1 1\n" + HEAD + 'Translate 1 .5 3 Shape "sphere"')
    assert scene.objects[0].shape.centre_m == (-1.0, 0.5, -3.0)


def test_the_scale_of_a_camera_leaves_lengths_alone_and_is_told(tmp_path):
    path = tmp_path / "it.pbrt"
    path.write_text("Scale 4 4 4\n" + HEAD + 'Translate 1 .5 3 Shape "sphere"')
    with pytest.warns(UserWarning, match="scale of the camera"):
        shape = ic.load_scene(path).objects[0].shape
    np.testing.assert_allclose(shape.centre_m, (1.0, 0.5, -3.0))
    np.testing.assert_allclose(shape.radius_m, 1.0)


def test_millimetres_become_metres_with_the_same_irradiance(tmp_path):
    text = 'Camera "realisticEye" "bool mmUnits" ["true"]\nWorldBegin\nTranslate 0 0 100\n'
    text += 'Shape "sphere" "float radius" 5\nLightSource "point" "spectrum I" [300 8 900 8]'
    scene = load(tmp_path, text + ' "point from" [0 0 0] Material "matte"\nShape "sphere"')
    np.testing.assert_allclose(scene.objects[0].shape.centre_m, (0, 0, -0.1))
    np.testing.assert_allclose(scene.objects[0].shape.radius_m, 0.005)
    # I / r^2 stays: 8 / 100^2 per mm^2 is 8e-6 / 0.1^2 per m^2.
    np.testing.assert_allclose(scene.lights[0].intensity.at(NM), 8e-6)


def test_directives_multiply_from_the_right(tmp_path):
    text = "Translate 1 0 2 Rotate 90 0 0 1 Scale 2 2 2 Translate 1 0 0\n"
    # Scale and turn the shift by 1 in x: 2 in y, then the first shift.
    shape = world(tmp_path, text + 'Shape "sphere"').objects[0].shape
    np.testing.assert_allclose(shape.centre_m, (1, 2, -2), atol=1e-12)
    assert shape.radius_m == pytest.approx(2.0)


def test_a_transform_lists_its_columns(tmp_path):
    text = "Transform [1 0 0 0 0 1 0 0 0 0 1 0 3 4 5 1]"
    shape = world(tmp_path, text + 'Shape "sphere"').objects[0].shape
    assert shape.centre_m == (3, 4, -5)


def test_coordinate_systems_are_kept(tmp_path):
    text = """Translate 0 0 5 CoordinateSystem "far" Identity
    TransformBegin CoordSysTransform "far" Shape "sphere" TransformEnd Shape "sphere"
    CoordSysTransform "camera" Shape "sphere" """
    scene = load(tmp_path, HEAD.replace("0 0 0", "0 0 -2", 1) + text)
    assert [o.shape.centre_m[2] for o in scene.objects] == [-7.0, -2.0, 0.0]


# Fronts and backs

GLASS = 'Material "dielectric" '


def front_of(scene, origin, direction):
    """Whether a ray meets the first object on its front."""
    shape = scene.objects[0].shape
    d = np.array(direction) / np.linalg.norm(direction)
    if isinstance(shape, ic.Sphere):
        return True
    if isinstance(shape, ic.Disc):
        return float(np.dot(shape.normal, d)) < 0
    if isinstance(shape, ic.Quad):
        return float(np.cross(shape.edge_u_m, shape.edge_v_m) @ d) < 0
    mesh = shape.in_place if isinstance(shape, ic.Instance) else shape
    hits = [closest for closest in mesh.triangles_m if crosses(closest, np.array(origin), d)]
    nearest = min(hits, key=lambda t: (t.mean(axis=0) - origin) @ d)
    return float(np.cross(nearest[1] - nearest[0], nearest[2] - nearest[0]) @ d) < 0


def crosses(triangle, origin, d):
    a, b, c = triangle
    m = np.stack([b - a, c - a, -d], axis=1)
    if abs(np.linalg.det(m)) < 1e-14:
        return False
    u, v, t = np.linalg.solve(m, origin - a)
    return u >= 0 and v >= 0 and u + v <= 1 and t > 0


# PBRT: the normal of a triangle is (p1 - p0) x (p2 - p0), of a patch dp/du x dp/dv; here towards
# -z, the camera.
FACING = {
    "triangles": 'Shape "trianglemesh" "point3 P" [-1 -1 0 -1 1 0 1 1 0.1] '
    '"integer indices" [0 1 2]',
    "parallelogram": 'Shape "trianglemesh" "point3 P" [-1 -1 0 -1 1 0 1 1 0 1 -1 0] '
    '"integer indices" [0 1 2 0 2 3]',
    "patch": 'Shape "bilinearmesh" "point3 P" [-1 -1 0 -1 1 0 1 -1 0 1 1 0]',
    "bent patch": 'Shape "bilinearmesh" "point3 P" [-1 -1 0 -1 1 0 1 -1 0 1 1 .2]',
    "disc": 'Rotate 180 1 0 0 Shape "disk"',
    "part of a disc": 'Rotate 180 1 0 0 Shape "disk" "float phimax" 350',
    "normals": 'Shape "trianglemesh" "point3 P" [-1 -1 0 -1 1 0 1 1 0.1] "integer indices" [0 2 1] '
    '"normal N" [0 0 -1 0 0 -1 0 0 -1]',
    "part of a sphere": 'Shape "sphere" "float zmax" .99',
    "cylinder": 'Rotate 90 1 0 0 Shape "cylinder"',
    "cone": 'Rotate 90 1 0 0 Translate 0 0 -.4 Shape "cone"',
    "squashed sphere": 'Scale 1 2 1 Shape "sphere"',
}


@pytest.mark.parametrize("turn", ["", "ReverseOrientation"])
@pytest.mark.parametrize("mirror", ["", "Scale -1 1 1"])
@pytest.mark.parametrize("shape", FACING)
def test_the_front_is_where_pbrt_has_it(tmp_path, shape, mirror, turn):
    text = GLASS + turn + "\nTranslate 0 0 4 " + mirror + "\n" + FACING[shape]
    scene = world(tmp_path, text)
    x = 0.25 if mirror else -0.25
    assert front_of(scene, (x, 0.27, 0.0), (0.0, 0.0, -1.0)) == (turn == "")


def test_an_inside_out_glass_sphere_has_its_front_inside(tmp_path):
    scene = world(tmp_path, GLASS + 'ReverseOrientation Translate 0 0 4 Shape "sphere"')
    assert isinstance(scene.objects[0].shape, ic.Mesh)
    assert not front_of(scene, (0.013, 0.017, 0.0), (0.0, 0.0, -1.0))


@pytest.mark.parametrize("mirror", ["", "Scale -1 1 1"])
def test_instances_stand_where_they_are_put_with_fronts_kept(tmp_path, mirror):
    text = (
        GLASS
        + f"""ObjectBegin "it" Translate 0 0 1 {FACING["triangles"]} ObjectEnd
    AttributeBegin Translate 0 0 3 {mirror} ObjectInstance "it" AttributeEnd"""
    )
    scene = world(tmp_path, text)
    shape = scene.objects[0].shape
    assert isinstance(shape, ic.Instance)
    np.testing.assert_allclose(shape.in_place.vertices_m[0], (1 if mirror else -1, -1, -4))
    assert front_of(scene, (0.25 if mirror else -0.25, 0.27, 0.0), (0.0, 0.0, -1.0))


# Shapes


def test_a_sphere_in_pieces_lies_on_the_sphere(tmp_path):
    mesh = world(tmp_path, 'Shape "sphere" "float radius" 2 "float zmin" -1').objects[0].shape
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices_m, axis=1), 2.0)
    assert mesh.vertices_m[:, 2].max() == pytest.approx(1.0)  # z turned round
    np.testing.assert_allclose(mesh.normals, mesh.vertices_m / 2.0, atol=1e-12)


def test_two_triangles_that_make_a_parallelogram_become_one_with_its_coordinates(tmp_path):
    text = 'Texture "c" "spectrum" "checkerboard" Material "diffuse" "texture reflectance" "c"\n'
    text += 'Shape "trianglemesh" "point3 P" [0 0 2 2 0 2 2 1 2 0 1 2] '
    text += '"integer indices" [2 3 0 0 1 2] "point2 uv" [1 0 1 1 0 1 0 0]'
    quad = world(tmp_path, text).objects[0].shape
    # (0, 0) is the vertex (0, 1, 2), (1, 0) the vertex (0, 0, 2), (0, 1) the vertex (2, 1, 2).
    assert quad.corner_m == (0, 1, -2)
    assert quad.edge_u_m == (0, -1, 0)
    assert quad.edge_v_m == (2, 0, 0)


def test_textured_triangles_without_coordinates_get_those_of_pbrt(tmp_path):
    text = 'Texture "c" "spectrum" "checkerboard" Material "diffuse" "texture reflectance" "c"\n'
    mesh = world(tmp_path, text + 'Shape "trianglemesh" "point3 P" [0 0 1 1 0 1 0 1 1]').objects[0]
    np.testing.assert_array_equal(mesh.shape.uv, [[0, 0], [1, 0], [1, 1]])


def test_quads_in_ply_files_and_packed_ones(tmp_path):
    data = (SCENES / "meshes" / "bar.ply").read_bytes()
    (tmp_path / "bar.ply.gz").write_bytes(gzip.compress(data))
    mesh = world(tmp_path, 'Shape "plymesh" "string filename" "bar.ply.gz"').objects[0].shape
    assert mesh.faces.shape == (12, 3)
    a, b, c = (mesh.triangles_m[:, i] for i in range(3))
    # Volume of a closed surface wound outwards (divergence theorem): 65 by 70 by 20 mm.
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0
    np.testing.assert_allclose(volume, 0.065 * 0.07 * 0.02, rtol=1e-6)


def test_shapes_without_a_counterpart_are_told_in_one_warning(tmp_path):
    path = tmp_path / "it.pbrt"
    path.write_text(HEAD + 'Shape "sphere"\nShape "curve"\nShape "nurbs"\nShape "curve"')
    with pytest.warns(UserWarning, match="left out") as caught:
        ic.load_scene(path)
    assert len(caught) == 1
    assert "curve (it.pbrt:5, it.pbrt:7); nurbs (it.pbrt:6)" in str(caught[0].message)


def test_parameters_nobody_knows_are_told(tmp_path):
    path = tmp_path / "it.pbrt"
    path.write_text(HEAD + 'Shape "sphere" "float raduis" 2')
    with pytest.warns(UserWarning, match="'raduis' of Shape"):
        ic.load_scene(path)


# Spectra


def test_inline_spectra_named_spectra_and_files(tmp_path):
    (tmp_path / "a.spd").write_text("400 .1\n700 .4\n")
    for stated in ("[700 .4 400 .1]", '"a.spd"'):
        spectrum = material(tmp_path, f'Material "diffuse" "spectrum reflectance" {stated}')
        np.testing.assert_allclose(spectrum.reflectance.at([400, 550, 700]), [0.1, 0.25, 0.4])


@pytest.mark.parametrize(
    ("name", "index"),
    [("BK7", 1.5168), ("F5", 1.6727), ("FK51A", 1.48656), ("LASF9", 1.85025), ("BAF10", 1.67003),
     ("F10", 1.72825), ("F11", 1.78472)],
)  # fmt: skip
def test_named_glasses_have_the_catalogue_index(tmp_path, name, index):
    # n_d of the SCHOTT catalogue.
    glass = material(tmp_path, f'Material "dielectric" "spectrum eta" "glass-{name}"')
    np.testing.assert_allclose(glass.index.index(587.56), index, atol=2e-5)


def test_lights_of_version_4_have_the_luminance_of_their_scale(tmp_path):
    for colour in ('"rgb L" [1 1 1]', '"spectrum L" [300 7 900 7]', '"blackbody L" 3000',
                   '"spectrum L" "stdillum-F2"'):  # fmt: skip
        text = f'Material "diffuse" LightSource "infinite" {colour} "float scale" 40 Shape "sphere"'
        luminance = world(tmp_path, text).background.luminance_cd_m2()
        assert luminance == pytest.approx(40.0, rel=1e-4), colour


def test_lights_of_version_3_are_as_they_are_stated(tmp_path):
    text = 'Material "matte" Shape "sphere" LightSource "infinite" "color scale" [2 2 2] '
    background = world(tmp_path, text + '"spectrum L" [300 7 900 7]').background
    np.testing.assert_allclose(background.at(NM), 14.0)
    # A black body relative to its peak, which for 5000 K lies at 579.6 nm (Wien).
    light = world(tmp_path, text + '"blackbody L" [5000 3]').background
    assert light.at([579.6])[0] == pytest.approx(6.0, rel=1e-4)
    white = world(tmp_path, text + '"rgb L" [1 1 1]').background
    flat = ic.Spectrum.constant(2.0).luminance_cd_m2()
    assert white.luminance_cd_m2() == pytest.approx(flat, rel=1e-4)


def test_power_gives_the_luminous_flux(tmp_path):
    text = 'AreaLightSource "diffuse" "rgb L" [1 1 1] "float power" 100 "bool twosided" true\n'
    item = world(tmp_path, text + 'Shape "sphere" "float radius" .5').objects[0]
    # Lambert: flux = luminance * pi * area * sides.
    flux = item.emission.radiance.luminance_cd_m2() * np.pi * (4 * np.pi * 0.25) * 2
    assert flux == pytest.approx(100.0, rel=1e-4)
    lights = 'Material "diffuse" LightSource "point" "float power" 50 LightSource "distant" '
    scene = world(tmp_path, lights + '"float illuminance" 200')
    assert scene.lights[0].intensity.luminance_cd_m2() == pytest.approx(50 / (4 * np.pi), rel=1e-4)
    assert scene.lights[1].irradiance.luminance_cd_m2() == pytest.approx(200.0, rel=1e-4)


def test_colours_of_a_wider_space_are_converted(tmp_path):
    text = 'ColorSpace "rec2020" Material "diffuse" "rgb reflectance" [.5 .5 .5]'
    grey = material(tmp_path, text).reflectance
    np.testing.assert_allclose(grey.at(NM), 0.5, atol=1e-3)


# Materials


def test_roughness_follows_both_versions():
    # Version 3's polynomial at roughness 1 is its constant term, clipped to 1; at 0.1 by hand:
    # x = -2.302585: 1.62142 - 1.888016 + 0.919349 - 0.209003 + 0.018010.
    assert roughness_to_alpha(1.0, 3) == 1.0
    assert roughness_to_alpha(0.1, 3) == pytest.approx(0.461760, abs=2e-6)
    assert roughness_to_alpha(0.25, 4) == 0.5


MATERIALS = {
    'Material "matte" "rgb Kd" [.2 .2 .2]': ic.Diffuse,
    'Material "diffuse"': ic.Diffuse,
    'Material "plastic"': ic.Coated,
    'Material "plastic" "rgb Ks" [0 0 0]': ic.Diffuse,
    'Material "coateddiffuse"': ic.Coated,
    'Material "coatedconductor"': ic.Conductor,
    'Material "uber" "rgb Kt" [.5 .5 .5]': ic.Mix,
    'Material "uber"': ic.Coated,
    'Material "mirror"': ic.Mirror,
    'Material "glass"': ic.Dielectric,
    'Material "metal"': ic.Conductor,
    'Material "conductor" "spectrum eta" "metal-Ag-eta" "spectrum k" "metal-Ag-k"': ic.Conductor,
    'Material "conductor" "rgb reflectance" [.9 .8 .7]': ic.Conductor,
    'Material "substrate"': ic.Coated,
    'Material "translucent"': ic.Diffuse,
    'Material "diffusetransmission"': ic.Diffuse,
    'Material "thindielectric"': ic.Mirror,
    'Material "disney"': ic.Coated,
    'Material "disney" "float metallic" 1': ic.Mirror,
    'Material "subsurface"': ic.Coated,
    'Material "hair"': ic.Diffuse,
    'Material "fourier" "string bsdffile" "x.bsdf"': ic.Diffuse,
}


@pytest.mark.parametrize("text", MATERIALS)
def test_materials_become_what_they_are_nearest_to(tmp_path, text):
    assert type(material(tmp_path, text)) is MATERIALS[text]


def test_a_metal_of_a_reflectance_has_it(tmp_path):
    index = material(tmp_path, 'Material "conductor" "spectrum reflectance" [300 .8 900 .8]').index
    n, k = index.at(NM)
    # Fresnel at perpendicular incidence.
    np.testing.assert_allclose(((n - 1) ** 2 + k**2) / ((n + 1) ** 2 + k**2), 0.8)


@pytest.mark.parametrize(
    ("kind", "share"),
    [('"string namedmaterial1" "a" "string namedmaterial2" "b" "rgb amount" [.2 .2 .2]', 0.8),
     ('"string materials" ["a" "b"] "float amount" .2', 0.2)],
)  # fmt: skip
def test_the_amount_of_a_mix_is_that_of_its_version(tmp_path, kind, share):
    text = """MakeNamedMaterial "a" "string type" "diffuse"
    MakeNamedMaterial "b" "string type" "conductor" """
    mix = material(tmp_path, text + f'Material "mix" {kind}')
    assert isinstance(mix.first, ic.Diffuse)
    assert mix.weight == pytest.approx(share, abs=1e-6)


def test_a_mix_of_itself_is_refused(tmp_path):
    text = 'MakeNamedMaterial "a" "string type" "mix" "string materials" ["a" "a"]\n'
    with pytest.raises(ic.FileError, match="of itself"):
        world(tmp_path, text + 'NamedMaterial "a" Shape "sphere"')


# Textures


def shade(item, u, v):
    """Reflectance of a diffuse material, or of a mix of such, at texture coordinates."""
    if isinstance(item, ic.Mix):
        w = item.weight
        w = w if isinstance(w, float) else w.weights(np.array(u), np.array(v))[..., 0, None]
        return (1 - w) * shade(item.first, u, v) + w * shade(item.second, u, v)
    spectra = np.stack([s.at(NM) for s in item.spectra()])
    if item.texture is None:
        return np.broadcast_to(spectra[0], (len(u), len(NM)))
    return item.texture.weights(np.array(u), np.array(v)) @ spectra


UV = np.random.default_rng(3).random((2, 40))


def test_checkerboards_of_any_two_textures(tmp_path):
    text = """Texture "fine" "spectrum" "checkerboard" "float uscale" 10 "float vscale" 6
      "rgb tex1" [.9 .1 .1] "spectrum tex2" [300 .3 900 .3]
    Texture "c" "spectrum" "checkerboard" "float uscale" 2 "float vscale" 2 "texture tex1" "fine"
      "spectrum tex2" [300 .2 900 .2] Material "diffuse" "texture reflectance" "c" """
    found = shade(material(tmp_path, text), *UV)
    red = shade(material(tmp_path, 'Material "diffuse" "rgb reflectance" [.9 .1 .1]'), *UV)
    even = [(np.floor(a * UV[0]) + np.floor(b * UV[1])) % 2 == 0 for a, b in ((10, 6), (2, 2))]
    fine = np.where(even[0][:, None], red, 0.3)
    np.testing.assert_allclose(found, np.where(even[1][:, None], fine, 0.2), atol=1e-6)


def test_images_are_scaled_mixed_and_repeated(tmp_path):
    rng = np.random.default_rng(0)
    pictures.write_pfm(tmp_path / "a.pfm", rng.random((4, 5, 3)))
    pictures.write_pfm(tmp_path / "b.pfm", rng.random((4, 5)))
    where = '"float uscale" 2 "float vdelta" .25'
    text = f"""Texture "a" "spectrum" "imagemap" "string filename" "a.pfm" {where}
    Texture "b" "float" "imagemap" "string filename" "b.pfm" {where}
    Texture "ab" "spectrum" "scale" "texture tex" "a" "texture scale" "b"
    Texture "m" "spectrum" "mix" "texture tex1" "ab" "rgb tex2" [.5 .5 .5] "texture amount" "b"
    """
    found = shade(material(tmp_path, text + 'Material "diffuse" "texture reflectance" "m"'), *UV)
    from isetcl.scene.colour import reflectance_primaries

    a, b = (pictures.read_picture(tmp_path / f"{name}.pfm") for name in "ab")
    texels = np.concatenate([a * b[..., None] * (1 - b[..., None]), b[..., None]], axis=-1)
    image = ic.Image(texels, wrap="repeat", repeats=(2.0, 1.0), offset=(0.0, 0.25))
    spectra = [*(s.at(NM) for s in reflectance_primaries()), np.full(len(NM), 0.5)]
    np.testing.assert_allclose(found, image.weights(*UV) @ np.stack(spectra), atol=1e-5)


def test_an_image_lies_upright(tmp_path):
    pictures.write_pfm(tmp_path / "a.pfm", np.array([[1.0, 1.0], [0.0, 0.0]]))
    text = 'Texture "a" "spectrum" "imagemap" "string filename" "a.pfm" "string wrap" "clamp"\n'
    found = material(tmp_path, text + 'Material "diffuse" "texture reflectance" "a"')
    np.testing.assert_allclose(shade(found, [0.5, 0.5], [0.99, 0.01])[:, 0], [1.0, 0.0])


def test_alpha_cuts_out(tmp_path):
    text = 'Texture "a" "float" "checkerboard" "float tex1" 1 "float tex2" .25\nShape "sphere" '
    assert world(tmp_path, text + '"texture alpha" "a"').objects[0].opacity.dark == 0.25
    assert world(tmp_path, text + '"float alpha" .5').objects[0].opacity == 0.5


# Environments


def test_octahedral_coordinates_invert_their_directions():
    n = 16
    u, v = pictures.octahedral_coordinates(pictures.octahedral_directions(n))
    centres = (np.arange(n) + 0.5) / n
    np.testing.assert_allclose(u, np.broadcast_to(centres, (n, n)), atol=1e-7)
    np.testing.assert_allclose(v, np.broadcast_to(centres[:, None], (n, n)), atol=1e-7)


def test_octahedral_texels_have_equal_areas():
    # The mean direction and second moments over the sphere: 0 and 1/3.
    d = pictures.octahedral_directions(64).reshape(-1, 3)
    np.testing.assert_allclose(d.mean(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(d.T @ d / len(d), np.eye(3) / 3, atol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1.0)


def sky_at(scene, direction):
    d = np.array(direction, dtype=float)
    sky = scene.background
    return sky.texture.weights(*sky.coordinates(d / np.linalg.norm(d)))


def test_a_map_of_version_3_lies_as_pbrt_has_it(tmp_path):
    # Row 0 at the light's +z, column 0 at +x, turning to +y.
    texels = np.zeros((8, 16, 3))
    texels[:2] = 1.0
    texels[3:5, 3:5, 1] = 2.0
    pictures.write_pfm(tmp_path / "a.pfm", texels)
    text = 'Material "matte" Shape "sphere" LightSource "infinite" "string mapname" "a.pfm"'
    scene = world(tmp_path, text)
    # World +z is behind the camera's picture: the eye's -z; +y is +y.
    np.testing.assert_allclose(sky_at(scene, (0, 0, -1)), 1.0)
    np.testing.assert_allclose(sky_at(scene, (0, 1, 0)), [0, 2, 0], atol=1e-6)
    np.testing.assert_allclose(sky_at(scene, (1, 0, 0)), 0.0, atol=1e-6)


def test_a_square_map_of_version_4_lies_as_pbrt_has_it(tmp_path):
    d = pictures.octahedral_directions(64)
    pictures.write_pfm(tmp_path / "a.pfm", 1 + d)
    text = 'Rotate 90 0 1 0 LightSource "infinite" "string filename" "a.pfm" "float scale" 3'
    scene = world(tmp_path, text)
    for towards in np.random.default_rng(5).normal(size=(20, 3)):
        x, y, z = towards / np.linalg.norm(towards)
        # Eye (x, y, z) is world (x, y, -z); turned back by 90 degrees about y.
        np.testing.assert_allclose(sky_at(scene, (x, y, z)), [1 + z, 1 + y, 1 + x], atol=0.08)
    white = sum(s.luminance_cd_m2() for s in scene.background.spectra())
    assert white == pytest.approx(3.0, rel=1e-4)


def test_even_light_adds_to_a_map(tmp_path):
    pictures.write_pfm(tmp_path / "a.pfm", np.ones((4, 8, 3)))
    text = 'Material "matte" Shape "sphere" LightSource "infinite" "string mapname" "a.pfm"\n'
    sky = world(tmp_path, text + 'LightSource "infinite" "spectrum L" [300 2 900 2]').background
    assert len(sky.spectra()) == 4
    np.testing.assert_allclose(sky.spectra()[3].at(NM), 2.0)


def exr(texels, compression, kind):
    """A small OpenEXR file by scan lines, of channels B G R."""
    import zlib

    rows, columns, _ = texels.shape
    attributes = {
        b"channels\0chlist\0": b"".join(
            c + b"\0" + struct.pack("<iIii", kind, 0, 1, 1) for c in (b"B", b"G", b"R")
        ) + b"\0",
        b"compression\0compression\0": bytes([compression]),
        b"dataWindow\0box2i\0": struct.pack("<4i", 0, 0, columns - 1, rows - 1),
    }  # fmt: skip
    head = b"\x76\x2f\x31\x01" + struct.pack("<I", 2)
    for name, value in attributes.items():
        head += name + struct.pack("<i", len(value)) + value
    head += b"\0"
    lines = {0: 1, 2: 1, 3: 16}[compression]
    blocks = []
    for y in range(0, rows, lines):
        dtype = "<f2" if kind == 1 else "<f4"
        raw = texels[y : y + lines, :, ::-1].transpose(0, 2, 1).astype(dtype).tobytes()
        if compression:
            data = np.frombuffer(raw, np.uint8).astype(int)
            data = np.concatenate([data[0::2], data[1::2]])
            packed = zlib.compress(np.concatenate([data[:1], np.diff(data) + 128]).astype("u1"))
            raw = packed if len(packed) < len(raw) else raw
        blocks.append(struct.pack("<ii", y, len(raw)) + raw)
    place = len(head) + 8 * len(blocks)
    offsets = b""
    for block in blocks:
        offsets += struct.pack("<Q", place)
        place += len(block)
    return head + offsets + b"".join(blocks)


@pytest.mark.parametrize("kind", [1, 2])
@pytest.mark.parametrize("compression", [0, 2, 3])
def test_plain_openexr_is_read(tmp_path, compression, kind):
    texels = np.repeat(np.arange(20.0 * 9 * 3).reshape(20, 9, 3), 2, axis=1) / 16.0
    (tmp_path / "a.exr").write_bytes(exr(texels, compression, kind))
    np.testing.assert_array_equal(pictures.read_picture(tmp_path / "a.exr"), texels)


def test_radiance_pictures_are_read(tmp_path):
    # RGBE (128, 64, 32, 129) is (1, 0.5, 0.25): m / 256 * 2^(e - 128).
    line = b"\x02\x02\x00\x08" + b"".join(bytes([128 + 8, v]) for v in (128, 64, 32, 129))
    (tmp_path / "a.hdr").write_bytes(
        b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 8\n" + 2 * line
    )
    texels = pictures.read_picture(tmp_path / "a.hdr")
    np.testing.assert_allclose(texels, np.broadcast_to([1.0, 0.5, 0.25], (2, 8, 3)))


# Bad input

BAD = {
    "no world": ('Camera "perspective"', "WorldBegin"),
    "empty": ("", "WorldBegin"),
    "two worlds": (HEAD + "WorldBegin", "line 4, column 1"),
    "shape before world": ('Shape "sphere"', "after WorldBegin"),
    "unknown directive": (HEAD + "Shpae", "line 4, column 1.*did you mean Shape"),
    "open string": (HEAD + 'Shape "sphere', "line 4, column 7.*not closed"),
    "open list": (HEAD + 'Shape "sphere" "float radius" [1 "x"', "radius"),
    "no value": (HEAD + 'Shape "sphere" "float radius"', "file ends"),
    "not a number": (HEAD + 'Shape "sphere" "float radius" 1.2.3', "line 4, column 31"),
    "not numbers": (HEAD + 'Shape "trianglemesh" "point3 P" [0 0\n 0 1-2]', "line 5, column 4"),
    "words for numbers": (HEAD + 'Shape "sphere" "float radius" "big"', "must be numbers"),
    "overflow": (HEAD + 'Shape "sphere" "float radius" 1e999', "1.8e308"),
    "missing type": (HEAD + 'Shape "sphere" "radius" 1', "type name"),
    "unknown type": (HEAD + 'Shape "sphere" "flaot radius" 1', "did you mean float"),
    "wrong type": (HEAD + 'Shape "sphere" "string radius" "1"', "of type float"),
    "twice": (HEAD + 'Shape "sphere" "float radius" 1 "float radius" 2', "twice"),
    "two numbers": (HEAD + 'Shape "sphere" "float radius" [1 2]', "one value"),
    "odd points": (HEAD + 'Shape "trianglemesh" "point3 P" [1 2]', "multiple of 3"),
    "few numbers": (HEAD + "Translate 1 2", "3 numbers"),
    "end without begin": (HEAD + "AttributeEnd", "must close"),
    "wrong end": (HEAD + "AttributeBegin TransformEnd", "AttributeBegin is open"),
    "never closed": (HEAD + "AttributeBegin", "no AttributeEnd"),
    "object never closed": (HEAD + 'ObjectBegin "a"', "no ObjectEnd"),
    "nested objects": (HEAD + 'ObjectBegin "a" ObjectBegin "b"', "inside another"),
    "object of itself": (HEAD + 'ObjectBegin "a" ObjectInstance "a"', "inside ObjectBegin"),
    "unknown object": (HEAD + 'ObjectInstance "a"', "not defined"),
    "unknown material": (HEAD + 'NamedMaterial "a" Shape "sphere"', "not defined"),
    "unknown texture": (
        HEAD + 'Material "diffuse" "texture reflectance" "a" Shape "sphere"', "'a'"
    ),
    "unknown system": (HEAD + 'CoordSysTransform "a"', "unknown coordinate system"),
    "unknown space": (HEAD + 'ColorSpace "a"', "unknown colour space"),
    "unknown spectrum": (
        HEAD + 'Material "conductor" "spectrum eta" "metal-Xx-eta" Shape "sphere"',
        "unknown spectrum",
    ),
    "flat": (HEAD + 'Scale 0 1 1 Shape "sphere"', "flattens"),
    "flat camera": ("Scale 0 1 1\n" + HEAD, "flattens"),
    "perspective": (HEAD + "Transform [1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1]", "0 0 0 1"),
    "axis": (HEAD + "Rotate 90 0 0 0", "axis"),
    "gaze": ("LookAt 0 0 0 0 0 0 0 1 0", "must differ"),
    "up": ("LookAt 0 0 0 0 0 1 0 0 1", "along the gaze"),
    "radius": (HEAD + 'Shape "sphere" "float radius" 0', "radius must be > 0"),
    "negative radius": (HEAD + 'Shape "disk" "float radius" -1', "radius must be > 0"),
    "huge": (HEAD + 'Shape "trianglemesh" "point3 P" [1e30 0 0 1 0 0 0 1 0]', "within 1e"),
    "huge patch": (
        HEAD + 'Shape "bilinearmesh" "point3 P" [1e200 0 0 1 0 0 0 1e200 0 0 0 1e200]', "beyond"
    ),
    "huge sphere": (
        HEAD + 'AreaLightSource "diffuse" Scale 1e200 1e200 1e200 Shape "sphere"', "beyond"
    ),
    "huge scale": (HEAD + "Scale 1e200 1 1 Scale 1e200 1 1", "overflows"),
    "index": (
        HEAD + 'Shape "trianglemesh" "point3 P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1 3]',
        "between 0 and 2",
    ),
    "negative index": (
        HEAD + 'Shape "bilinearmesh" "point3 P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1 2 -1]',
        "between 0 and 2",
    ),
    "half an index": (
        HEAD + 'Shape "trianglemesh" "point3 P" [0 0 0 1 0 0 0 1 0] "integer indices" [0 1 1.5]',
        "whole numbers",
    ),
    "no triangles": (HEAD + 'Shape "trianglemesh" "point3 P" [] "integer indices" []', "value"),
    "subdivision bomb": (
        HEAD + 'Shape "loopsubdiv" "integer levels" 20 "point3 P" [0 0 0 1 0 0 0 1 0] '
        '"integer indices" [0 1 2]',
        "GiB",
    ),
    "negative light": (HEAD + 'LightSource "point" "rgb I" [-1 0 0]', "line 4.*>= 0"),
    "dark light": (HEAD + 'LightSource "point" "spectrum I" [900 1 1000 1]', "visible energy"),
    "odd spectrum": (HEAD + 'LightSource "point" "spectrum I" [400 1 500]', "pairs"),
    "bad kelvin": (HEAD + 'LightSource "point" "blackbody I" -5', "temperature"),
    "nul": (HEAD + "\0", "no text"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_scenes_are_refused_with_the_place(tmp_path, name):
    text, match = BAD[name]
    with pytest.raises(ic.IsetclError, match=match):
        load(tmp_path, text)


def test_all_missing_files_are_told_at_once(tmp_path):
    text = """Include "a.pbrt" Shape "plymesh" "string filename" "b.ply"
    Texture "c" "spectrum" "imagemap" "string filename" "c.png"
    LightSource "infinite" "string mapname" "d.exr" Material "metal" "spectrum eta" "e.spd" """
    with pytest.raises(ic.FileError, match="5 files") as caught:
        world(tmp_path, text)
    for name in ("a.pbrt", "b.ply", "c.png", "d.exr", "e.spd"):
        assert f"'{name}' (" in str(caught.value)


@pytest.mark.parametrize(
    "name", ["../secret.ply", "/etc/passwd", "link.ply", "sub/../../secret.ply"]
)
def test_files_outside_the_folder_are_refused_unless_allowed(tmp_path, name):
    folder = tmp_path / "scene"
    (folder / "sub").mkdir(parents=True)
    (tmp_path / "secret.ply").write_bytes((SCENES / "meshes" / "bar.ply").read_bytes())
    (folder / "link.ply").symlink_to(tmp_path / "secret.ply")
    text = HEAD + f'Shape "plymesh" "string filename" "{name}"'
    with pytest.raises(ic.FileError, match="outside"):
        load(folder, text)
    if "passwd" not in name:
        assert len(load(folder, text, allow_outside=True).objects) == 1
    with pytest.raises(ic.FileError, match="outside"):
        load(folder, f'Include "{name}"')


def test_circular_includes_are_refused(tmp_path):
    (tmp_path / "a.pbrt").write_text('Include "b.pbrt"')
    (tmp_path / "b.pbrt").write_text('Include "sub/../a.pbrt"')
    (tmp_path / "sub").mkdir()
    with pytest.raises(ic.FileError, match=r"in a circle: it.pbrt -> a.pbrt -> b.pbrt -> a.pbrt"):
        load(tmp_path, 'Include "a.pbrt"')


def test_includes_that_double_are_stopped(tmp_path, monkeypatch):
    monkeypatch.setattr(parser, "MAX_INCLUDED_FILES", 200)
    for i in range(12):
        (tmp_path / f"{i}.pbrt").write_text(f'Include "{i + 1}.pbrt"\n' * 2)
    (tmp_path / "12.pbrt").write_text("Identity")
    with pytest.raises(ic.FileError, match="200 in all"):
        load(tmp_path, 'Include "0.pbrt"')


def test_too_deep_includes_too_many_words_and_objects_are_stopped(tmp_path, monkeypatch):
    for i in range(40):
        (tmp_path / f"{i}.pbrt").write_text(f'Include "{i + 1}.pbrt"\n')
    with pytest.raises(ic.FileError, match="deep"):
        load(tmp_path, 'Include "0.pbrt"')
    monkeypatch.setattr(parser, "MAX_TOKENS", 50)
    with pytest.raises(ic.FileError, match="50 words"):
        world(tmp_path, "Identity " * 60)
    monkeypatch.undo()
    monkeypatch.setattr(stage, "MAX_OBJECTS", 100)
    text = (
        'ObjectBegin "a"\n' + 'Shape "sphere"\n' * 30 + "ObjectEnd\n" + 'ObjectInstance "a"\n' * 9
    )
    with pytest.raises(ic.FileError, match="100 objects"):
        world(tmp_path, text)


def test_a_tower_of_textures_is_stopped(tmp_path):
    text = 'Texture "0" "spectrum" "checkerboard" "rgb tex1" [1 0 0]\n'
    for i in range(12):
        text += f'Texture "{i + 1}" "spectrum" "mix" "texture tex1" "{i}" "texture tex2" "{i}"\n'
    with pytest.raises(ic.InvalidInputError, match="at most 64"):
        world(tmp_path, text)


def ply(vertices, faces, body=b""):
    return (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\n"
        f"property float y\nproperty float z\nelement face {faces}\n"
        "property list uchar int vertex_indices\nend_header\n"
    ).encode() + body


def triangle(corners, *indices):
    return struct.pack("<9f", *corners) + struct.pack("<B3i", 3, *indices)


@pytest.mark.parametrize(
    ("data", "match"),
    [
        (b"", "no PLY"),
        (b"ply junk", "no PLY"),
        (bytes(range(256)) * 4, "no PLY"),
        (ply(3, 1), "cannot be read"),
        (ply(3000, 1), "shorter"),
        (ply(10**9, 2 * 10**9), "GiB"),
        (ply(10**30, 1), "GiB"),
        (ply(3, 1, triangle(range(9), 0, 1, 7)), "between 0 and 2"),
        (ply(3, 1, triangle([np.nan] * 9, 0, 1, 2)), "finite"),
    ],
)  # fmt: skip
def test_bad_meshes_are_refused(tmp_path, data, match):
    (tmp_path / "a.ply").write_bytes(data)
    with pytest.raises(ic.IsetclError, match=match):
        world(tmp_path, 'Shape "plymesh" "string filename" "a.ply"')


def test_a_scene_that_would_not_fit_is_refused_before_it_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr("isetcl.memory.available_bytes", lambda: 1 << 20)
    (tmp_path / "a.pbrt").write_text(HEAD + "# " + "x" * 200_000)
    with pytest.raises(ic.OutOfMemoryError, match="GiB"):
        ic.load_scene(tmp_path / "a.pbrt")
    (tmp_path / "b.pbrt.gz").write_bytes(gzip.compress(b" " * 10_000_000))
    with pytest.raises(ic.OutOfMemoryError, match="GiB"):
        ic.load_scene(tmp_path / "b.pbrt.gz")


@pytest.mark.parametrize("name", ["a.exr", "a.hdr", "a.pfm", "a.png"])
def test_junk_pictures_are_refused(tmp_path, name):
    rng = np.random.default_rng(0)
    whole = {"a.exr": exr(np.ones((20, 9, 3)), 3, 1), "a.pfm": b"PF\n9 9\n-1\n" + bytes(400)}
    for data in (
        b"",
        rng.bytes(2000),
        whole.get(name, b"#?RADIANCE\n\n-Y 9 +X 9\n\x02\x02\x00\x09"),
    ):
        for cut in (len(data), len(data) // 2):
            (tmp_path / name).write_bytes(data[:cut])
            try:
                pictures.read_picture(tmp_path / name)
            except ic.IsetclError:
                continue
            assert data is whole["a.exr"]
            assert cut == len(data)


@pytest.mark.parametrize("name", ["no.pbrt", ".", "a.txt", "x" * 300 + ".pbrt", "a\0.pbrt"])
def test_bad_names_are_refused(tmp_path, name):
    (tmp_path / "a.txt").write_text("")
    with pytest.raises(ic.FileError):
        ic.load_scene(tmp_path / name)
    for junk in (None, 3, b"x"):
        with pytest.raises(ic.InvalidInputError):
            ic.load_scene(junk)


# Anything at all

QUIET = settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
WORDS = st.sampled_from(
    [*parser.DIRECTIVES, '"float radius"', '"rgb L"', "[", "]", "1", "-2.5", "1e300", '"sphere"',
     '"trianglemesh"', '"point3 P"', "[0 0 0 1 0 0 0 1 0]", '"a"', "true", '"spectrum"', '"scale"',
     '"texture tex"', '"diffuse"', '"matte"', '"infinite"', '"bool twosided"', "#\n"]
)  # fmt: skip


@given(st.text())
@example('"')
@example("[")
def test_any_text_is_cut_into_tokens_or_refused(text):
    try:
        found = list(tokens(text, "it"))
    except ic.FileError:
        return
    for token in found:
        assert token.place.line <= text.count("\n") + 1


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=60))
def test_numbers_are_read_exactly(numbers):
    (token,) = tokens("[" + "\n ".join(map(repr, numbers)) + " ]", "it")
    np.testing.assert_array_equal(token.value, numbers)


@given(st.text(st.characters(exclude_characters="\n", exclude_categories=["Cs"])))
def test_strings_are_read_as_they_are_quoted(text):
    quoted = text.replace("\\", "\\\\").replace('"', '\\"')
    (token,) = tokens(f'"{quoted}"', "it")
    assert token.value == text


@QUIET
@given(st.lists(WORDS, max_size=40))
def test_any_words_make_a_scene_or_an_error(tmp_path, words):
    with contextlib.suppress(ic.IsetclError):
        world(tmp_path, " ".join(words))


TEXTS = [p.read_bytes() for p in WHOLE if "chess" not in p.stem]


@QUIET
@given(st.sampled_from(TEXTS), st.data())
def test_mutated_scenes_make_a_scene_or_an_error(tmp_path, text, data):
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(text)))
        end = min(len(text), start + data.draw(st.integers(0, 12)))
        text = text[:start] + data.draw(st.binary(max_size=8)) + text[end:]
    for name in ("textures", "meshes", "spds"):
        if not (tmp_path / name).exists():
            (tmp_path / name).symlink_to(SCENES / name)
    path = tmp_path / "it.pbrt"
    path.write_bytes(text)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        warnings.simplefilter("ignore", UserWarning)
        with contextlib.suppress(ic.IsetclError):
            ic.load_scene(path, allow_outside=True)


def test_what_is_seen_is_where_the_file_puts_it(tmp_path):
    text = 'Translate 0 0 3 Shape "sphere" "float radius" .5'
    scene = world(tmp_path, text)
    distance, index = view.nearest_distance_m(
        scene, np.zeros((2, 3)), np.array([[0, 0, -1.0], [0, 0, 1.0]])
    )
    np.testing.assert_allclose(distance, [2.5, np.inf])
    assert index.tolist() == [0, -1]

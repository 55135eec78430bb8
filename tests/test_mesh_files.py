"""Files of 3-D programs as scenes: geometry, looks, and refusals.

Files made here are written by trimesh, or byte by byte from the specification. Files made by
others were tried by hand: 27 GLB controllers of @webxr-input-profiles/assets 1.0.20, duck.obj,
dragon.obj, boat.obj, airplane.obj, bathtub.obj, env_sphere.obj, wooden_sphere.obj, bunny.obj,
chopping_board.glb, camera.glb, trashbag_rope.glb and ball.glb of genesis-world 1.4.5, logo3d.obj
and box.obj of pyglet 2.1.19, nut.ply, ant.ply, airplane.ply and sphere.ply of pyvista 0.49.1, OBJ
and STL robots of robosuite 1.5.2 and dm-control 1.0.50. Name a folder of such files in
ISETCL_MESH_FILES to compare bounds, area and volume of all of them with trimesh's.
"""

import base64
import io
import json
import os
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image as Pillow

import isetcl as ic
from isetcl.errors import FileError, InvalidInputError, IsetclError, OutOfMemoryError
from isetcl.scene.mesh_files import load_mesh_scene
from isetcl.scene.vertex_colour import baked

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="<f4")
CORNERS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], dtype=np.uint8)


def png(pixels):
    file = io.BytesIO()
    Pillow.fromarray(np.asarray(pixels, dtype=np.uint8)).save(file, "PNG")
    return file.getvalue()


def data_uri(data):
    return "data:application/octet-stream;base64," + base64.b64encode(data).decode()


class Gltf:
    """A glTF document that grows."""

    def __init__(self):
        self.data = b""
        self.json = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0, "name": "thing"}],
            "meshes": [],
            "accessors": [],
            "bufferViews": [],
        }

    def view(self, data, **extra):
        self.data += b"\0" * (-len(self.data) % 8)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), **extra}
        self.json["bufferViews"].append(view)
        self.data += data
        return len(self.json["bufferViews"]) - 1

    def accessor(self, values, **extra):
        values = np.asarray(values)
        kinds = {"f4": 5126, "u1": 5121, "u2": 5123, "u4": 5125, "i1": 5120, "i2": 5122}
        width = 1 if values.ndim == 1 else values.shape[1]
        self.json["accessors"].append(
            {
                "bufferView": self.view(values.tobytes()),
                "componentType": kinds[values.dtype.str[1:]],
                "count": len(values),
                "type": ["", "SCALAR", "VEC2", "VEC3", "VEC4"][width],
                **extra,
            }
        )
        return len(self.json["accessors"]) - 1

    def mesh(self, vertices=TRIANGLE, indices=None, material=None, mode=None, **attributes):
        named = {"POSITION": np.asarray(vertices, "<f4"), **attributes}
        primitive = {
            "attributes": {
                k: v if isinstance(v, int) else self.accessor(v) for k, v in named.items()
            }
        }
        if indices is not None:
            primitive["indices"] = self.accessor(np.asarray(indices, "<u2"))
        for key, value in (("material", material), ("mode", mode)):
            if value is not None:
                primitive[key] = value
        self.json["meshes"].append({"primitives": [primitive]})
        return self

    def material(self, **entries):
        self.json.setdefault("materials", []).append(entries)
        return self

    def texture(self, pixels, **sampler):
        image = {"bufferView": self.view(png(pixels)), "mimeType": "image/png"}
        self.json.setdefault("images", []).append(image)
        texture = {"source": len(self.json["images"]) - 1}
        if sampler:
            self.json.setdefault("samplers", []).append(sampler)
            texture["sampler"] = len(self.json["samplers"]) - 1
        self.json.setdefault("textures", []).append(texture)
        return self

    def text(self):
        buffers = [{"byteLength": len(self.data), "uri": data_uri(self.data)}]
        return json.dumps({**self.json, "buffers": buffers})

    def glb(self):
        found = {**self.json, "buffers": [{"byteLength": len(self.data)}]}
        header = json.dumps(found).encode()
        header += b" " * (-len(header) % 4)
        body = self.data + b"\0" * (-len(self.data) % 4)
        chunks = b"".join(
            np.array([len(part), kind], "<u4").tobytes() + part
            for part, kind in ((header, 0x4E4F534A), (body, 0x004E4942))
        )
        return np.array([0x46546C67, 2, 12 + len(chunks)], "<u4").tobytes() + chunks

    def scene(self, folder, **options):
        file = folder / "it.gltf"
        file.write_text(self.text())
        return load_mesh_scene(file, **options)


def quietly(call, *arguments, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return call(*arguments, **options)


def mesh_of(item):
    return item.shape.in_place if isinstance(item.shape, ic.Instance) else item.shape


def triangles_of(scene):
    return np.concatenate([mesh_of(item).triangles_m for item in scene.objects])


def measures(triangles):
    """Bounds, area, vector area and signed volume."""
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    volume = np.einsum("ij,ij->", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2]))
    area = np.linalg.norm(cross, axis=1).sum()
    bounds = (triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1)))
    return np.concatenate([*bounds, [area], cross.sum(axis=0), [volume]])


# -- geometry -------------------------------------------------------------------------------------


def house():
    """A trimesh scene: three boxes that are one geometry, and a turned and moved sphere."""
    scene = trimesh.Scene()
    box = trimesh.creation.box((1, 2, 3))
    scene.add_geometry(box, node_name="box 0", geom_name="box")
    for i in range(3):
        matrix = trimesh.transformations.translation_matrix([2.0 * i, 0, -5])
        scene.graph.update(frame_to=f"box {i}", geometry="box", matrix=matrix)
    turn = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3], [0.5, 0, 0])
    scene.add_geometry(trimesh.creation.icosphere(2), node_name="ball", transform=turn)
    return scene


def test_a_glb_keeps_names_places_and_repeated_meshes(tmp_path):
    house().export(tmp_path / "house.glb")
    scene = load_mesh_scene(tmp_path / "house.glb")
    assert scene.name == "house"
    assert sorted(item.name for item in scene.objects) == ["ball", "box 0", "box 1", "box 2"]
    boxes = [item.shape for item in scene.objects if item.name.startswith("box")]
    assert all(isinstance(shape, ic.Instance) for shape in boxes)
    assert len({id(shape.mesh) for shape in boxes}) == 1
    expected = measures(house().to_geometry().triangles)
    np.testing.assert_allclose(measures(triangles_of(scene)), expected, rtol=1e-5, atol=1e-5)


def test_scale_shrinks_the_scene_about_the_origin(tmp_path):
    house().export(tmp_path / "house.glb")
    large, small = (load_mesh_scene(tmp_path / "house.glb", scale=s) for s in (1.0, 0.001))
    np.testing.assert_allclose(triangles_of(small), 0.001 * triangles_of(large), rtol=1e-12)


@pytest.mark.parametrize("kind", ["ply", "stl", "off", "obj", "glb"])
def test_formats_of_one_mesh_hold_the_same_triangles(tmp_path, kind):
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.3)
    ball.apply_translation([0.1, 0.2, -1.0])
    ball.export(tmp_path / f"ball.{kind}")
    scene = load_mesh_scene(tmp_path / f"ball.{kind}")
    assert len(scene.objects) == 1
    expected = measures(ball.triangles)
    np.testing.assert_allclose(measures(triangles_of(scene)), expected, rtol=1e-5, atol=1e-6)
    material = scene.objects[0].material
    assert isinstance(material, ic.Diffuse)
    np.testing.assert_allclose(material.reflectance.at([450, 550, 650]), 0.5, atol=1e-9)
    assert scene.lights == ()
    assert scene.background is None


def test_a_mirroring_node_keeps_fronts_in_front(tmp_path):
    box = trimesh.creation.box()
    gltf = Gltf().mesh(box.vertices, box.faces.reshape(-1))
    gltf.json["nodes"] = [{"mesh": 0, "scale": [-1, 1, 1]}, {"mesh": 0, "translation": [3, 0, 0]}]
    gltf.json["scenes"] = [{"nodes": [0, 1]}]
    volumes = [measures(mesh_of(item).triangles_m)[-1] for item in gltf.scene(tmp_path).objects]
    np.testing.assert_allclose(volumes, 6.0, rtol=1e-6)


def test_nodes_apply_scale_then_rotation_then_translation_and_their_parents(tmp_path):
    gltf = Gltf().mesh()
    half = np.sqrt(0.5)
    child = {
        "mesh": 0,
        "scale": [2, 1, 1],
        "rotation": [0, 0, half, half],
        "translation": [1, 0, 0],
    }
    parent = {"children": [1], "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 10, 0, 1]}
    gltf.json["nodes"] = [parent, child]
    # (1, 0, 0) -> (2, 0, 0) -> (0, 2, 0) -> (1, 2, 0) -> (1, 12, 0).
    got = triangles_of(gltf.scene(tmp_path))[0]
    np.testing.assert_allclose(got, [[1, 10, 0], [1, 12, 0], [0, 10, 0]], atol=1e-6)


@pytest.mark.parametrize(
    ("mode", "expected"),
    [
        (5, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]),  # glTF 2.0, section 3.7.2.1: strips
        (6, [[1, 2, 0], [2, 3, 0], [3, 4, 0]]),  # fans
    ],
)
def test_strips_and_fans_are_the_triangles_of_the_specification(tmp_path, mode, expected):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0.0]])
    scene = Gltf().mesh(points, [0, 1, 2, 3, 4], mode=mode).scene(tmp_path)
    np.testing.assert_array_equal(triangles_of(scene), points[np.array(expected)])


def test_sparse_accessors_and_strides_are_read(tmp_path):
    gltf = Gltf()
    rows = np.zeros(3, dtype=[("p", "<f4", 3), ("junk", "<f4", 2)])
    rows["p"], rows["junk"] = TRIANGLE, 99.0
    view = gltf.view(rows.tobytes(), byteStride=20)
    sparse = {
        "count": 1,
        "indices": {"bufferView": gltf.view(np.array([2], "<u2").tobytes()), "componentType": 5123},
        "values": {"bufferView": gltf.view(np.array([[0, 5, 7]], "<f4").tobytes())},
    }
    gltf.json["accessors"].append(
        {"bufferView": view, "componentType": 5126, "count": 3, "type": "VEC3", "sparse": sparse}
    )
    gltf.json["meshes"] = [{"primitives": [{"attributes": {"POSITION": 0}}]}]
    got = triangles_of(gltf.scene(tmp_path))[0]
    np.testing.assert_array_equal(got, [[0, 0, 0], [1, 0, 0], [0, 5, 7]])


def test_normalised_integers_are_fractions(tmp_path):
    gltf = Gltf()
    uv = gltf.accessor(np.array([[0, 0], [255, 0], [0, 51]], "<u1"), normalized=True)
    mesh = gltf.mesh(TEXCOORD_0=uv).scene(tmp_path).objects[0].shape
    # v of glTF runs downwards.
    np.testing.assert_allclose(mesh.uv, [[0, 1], [1, 1], [0, 0.8]], atol=1e-12)


def test_gpu_instancing_places_copies(tmp_path):
    gltf = Gltf().mesh()
    moves = gltf.accessor(np.array([[0, 0, 0], [0, 0, -2], [0, 0, -4]], "<f4"))
    sizes = gltf.accessor(np.array([[1, 1, 1], [2, 2, 2], [3, 3, 3]], "<f4"))
    gltf.json["nodes"][0]["extensions"] = {
        "EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": moves, "SCALE": sizes}}
    }
    scene = gltf.scene(tmp_path)
    assert [item.name for item in scene.objects] == ["thing", "thing.2", "thing.3"]
    np.testing.assert_allclose(mesh_of(scene.objects[2]).vertices_m, 3 * TRIANGLE + [0, 0, -4])


def test_normals_of_the_file_are_kept_and_none_are_made_up(tmp_path):
    normals = np.tile(np.array([0, 0, 1], "<f4"), (3, 1))
    assert Gltf().mesh().scene(tmp_path).objects[0].shape.normals is None
    shape = Gltf().mesh(NORMAL=normals).scene(tmp_path).objects[0].shape
    np.testing.assert_array_equal(shape.normals, normals)
    (tmp_path / "it.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n")
    np.testing.assert_array_equal(
        load_mesh_scene(tmp_path / "it.obj").objects[0].shape.normals, normals
    )
    (tmp_path / "it.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert load_mesh_scene(tmp_path / "it.obj").objects[0].shape.normals is None


# -- looks ----------------------------------------------------------------------------------------


def look(tmp_path, **material):
    gltf = Gltf().mesh(material=0).material(**material)
    return gltf.scene(tmp_path).objects[0]


def rgb_of(spectrum):
    """Linear RGB of a reflectance, by the basis it is made of."""
    from isetcl.scene.colour import reflectance_primaries

    grid = np.arange(400.0, 701.0, 10.0)
    basis = np.stack([s.at(grid) for s in reflectance_primaries()], axis=1)
    return np.linalg.lstsq(basis, spectrum.at(grid), rcond=None)[0]


def test_metallic_and_roughness_become_plastic_metal_or_both(tmp_path):
    colour = [0.2, 0.4, 0.6, 1.0]

    def of(metallic, roughness=0.5):
        pbr = {"baseColorFactor": colour, "metallicFactor": metallic, "roughnessFactor": roughness}
        return look(tmp_path, pbrMetallicRoughness=pbr).material

    plastic, metal, both = of(0.0), of(1.0), of(0.25)
    assert isinstance(plastic, ic.Coated)
    assert isinstance(metal, ic.Mirror)
    assert isinstance(both, ic.Mix)
    assert both.weight == 0.25
    # glTF 2.0, appendix B.3.3: alpha is the square of roughness.
    assert plastic.roughness == metal.roughness == both.second.roughness == 0.25
    assert plastic.index.index(550.0) == 1.5
    for reflectance in (plastic.reflectance, metal.reflectance):
        np.testing.assert_allclose(rgb_of(reflectance), colour[:3], atol=1e-9)


def test_textures_of_roughness_and_metal_are_the_green_and_blue_channels(tmp_path):
    gltf = Gltf().texture([[[9, 255, 0], [9, 0, 51]]]).mesh(material=0)
    info = {"index": 0}
    gltf.material(pbrMetallicRoughness={"metallicRoughnessTexture": info, "metallicFactor": 0.5})
    material = gltf.scene(tmp_path).objects[0].material
    np.testing.assert_allclose(material.weight.texels, [[0.0, 0.1]], atol=1e-6)
    np.testing.assert_allclose(material.second.roughness.texels, [[1.0, 0.0]], atol=1e-6)


def test_pictures_are_upright_and_decoded_from_srgb(tmp_path):
    # Written by trimesh: v upwards, the picture's first row on top.
    uv = [[0, 0], [1, 0], [1, 1], [0, 1]]
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=Pillow.fromarray(CORNERS), metallicFactor=0.0
    )
    quad = trimesh.Trimesh(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
        [[0, 1, 2], [0, 2, 3]],
        visual=trimesh.visual.TextureVisuals(uv=uv, material=material),
        process=False,
    )
    quad.export(tmp_path / "quad.glb")
    item = load_mesh_scene(tmp_path / "quad.glb").objects[0]
    expected = {(0, 1): (1, 0, 0), (1, 1): (0, 1, 0), (0, 0): (0, 0, 1), (1, 0): (1, 1, 1)}
    for vertex, coordinates in zip(item.shape.vertices_m, item.shape.uv, strict=True):
        # Half a texel inside, where the texture is the texel alone.
        u, v = np.clip(coordinates, 0.25, 0.75)
        got = item.material.texture.weights(u, v)
        np.testing.assert_allclose(got, expected[tuple(vertex[:2].astype(int))], atol=1e-6)
    assert item.material.texture.wrap == "repeat"
    grey = Gltf().texture([[[188] * 3]]).mesh(material=0)
    grey.material(pbrMetallicRoughness={"baseColorTexture": {"index": 0}, "metallicFactor": 0})
    texels = grey.scene(tmp_path).objects[0].material.texture.texels
    # IEC 61966-2-1: code 188 of 255 is 0.5029 of linear light. Grey needs one channel only.
    np.testing.assert_allclose(texels, [[0.50289]], atol=1e-5)


def test_texture_transforms_follow_the_extension(tmp_path):
    transform = {"offset": [0.25, 0.125], "scale": [2.0, 0.5]}
    gltf = Gltf().texture(CORNERS).mesh(material=0)
    info = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
    gltf.material(pbrMetallicRoughness={"baseColorTexture": info, "metallicFactor": 0})
    image = gltf.scene(tmp_path).objects[0].material.texture
    plain = ic.Image(image.texels, wrap="repeat")
    u, v = np.random.default_rng(1).uniform(size=(2, 50))
    # glTF: uv' = scale * uv + offset, with v downwards.
    down = 0.5 * (1.0 - v) + 0.125
    expected = plain.weights(2.0 * u + 0.25, 1.0 - down)
    np.testing.assert_allclose(image.weights(u, v), expected, atol=1e-5)


@pytest.mark.parametrize(("code", "wrap"), [(33071, "clamp"), (10497, "repeat")])
def test_samplers_choose_what_lies_beyond_a_picture(tmp_path, code, wrap):
    gltf = Gltf().texture(CORNERS, wrapS=code, wrapT=code).mesh(material=0)
    gltf.material(pbrMetallicRoughness={"baseColorTexture": {"index": 0}, "metallicFactor": 0})
    assert gltf.scene(tmp_path).objects[0].material.texture.wrap == wrap


def test_mirrored_repeats_mirror(tmp_path):
    gltf = Gltf().texture(CORNERS, wrapS=33648, wrapT=33648).mesh(material=0)
    gltf.material(pbrMetallicRoughness={"baseColorTexture": {"index": 0}, "metallicFactor": 0})
    image = gltf.scene(tmp_path).objects[0].material.texture
    u, v = np.random.default_rng(2).uniform(0.3, 0.7, size=(2, 40))
    np.testing.assert_allclose(image.weights(u, v), image.weights(2 - u, -v), atol=1e-5)
    plain = ic.Image(quietly(lambda: image.texels[2:, :2]))
    np.testing.assert_allclose(image.weights(u, v), plain.weights(u, v), atol=1e-5)


def test_emission_has_the_luminance_of_factor_times_strength(tmp_path):
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 5.0}}
    item = look(tmp_path, emissiveFactor=[1, 1, 1], extensions=strength)
    assert item.emission.radiance.luminance_cd_m2() == pytest.approx(500.0, rel=1e-5)
    gltf = Gltf().texture([[[255, 255, 255], [0, 0, 0]]]).mesh(material=0)
    gltf.material(emissiveFactor=[1, 0.5, 0], emissiveTexture={"index": 0})
    item = gltf.scene(tmp_path, luminance_of_white_cd_m2=1.0).objects[0]
    np.testing.assert_allclose(item.emission.texture.texels, [[[1, 0.5, 0], [0, 0, 0]]], atol=1e-6)
    total = sum(s.luminance_cd_m2() for s in item.emission.radiance)
    assert total == pytest.approx(1.0, rel=1e-5)
    assert look(tmp_path, emissiveFactor=[0, 0, 0]).emission is None


def test_unlit_materials_shine_like_a_display(tmp_path):
    item = look(tmp_path, extensions={"KHR_materials_unlit": {}})
    assert isinstance(item.material, ic.Emission)
    assert item.emission is None
    assert item.material.radiance.luminance_cd_m2() == pytest.approx(100.0, rel=1e-5)


def test_alpha_modes_become_opacity(tmp_path):
    pixels = [[[255, 255, 255, 255], [255, 255, 255, 102]]]

    def opacity(**entries):
        gltf = Gltf().texture(pixels).mesh(material=0)
        pbr = {"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 1, 1, 0.5]}
        gltf.material(pbrMetallicRoughness={**pbr, "metallicFactor": 0}, **entries)
        return gltf.scene(tmp_path).objects[0].opacity

    assert opacity() == 1.0
    np.testing.assert_allclose(opacity(alphaMode="BLEND").texels, [[0.5, 0.2]], atol=1e-6)
    np.testing.assert_array_equal(opacity(alphaMode="MASK", alphaCutoff=0.3).texels, [[1, 0]])
    pbr = {"baseColorFactor": [1, 1, 1, 0.25]}
    assert look(tmp_path, pbrMetallicRoughness=pbr, alphaMode="BLEND").opacity == 0.25
    assert look(tmp_path, pbrMetallicRoughness=pbr, alphaMode="MASK").opacity == 0.0


def test_glass_with_a_volume_is_a_clear_body(tmp_path):
    extensions = {
        "KHR_materials_transmission": {"transmissionFactor": 1.0},
        "KHR_materials_volume": {"thicknessFactor": 0.1},
        "KHR_materials_ior": {"ior": 1.33},
    }
    material = quietly(look, tmp_path, extensions=extensions).material
    assert isinstance(material, ic.Dielectric)
    assert material.index.index(550.0) == 1.33
    thin = quietly(
        look, tmp_path, extensions={"KHR_materials_transmission": {"transmissionFactor": 0.75}}
    )
    assert thin.opacity == 0.25


def test_vertex_colours_are_interpolated_linearly_over_triangles(tmp_path):
    rng = np.random.default_rng(3)
    ball = trimesh.creation.icosphere(subdivisions=1)
    # Between 1/3 and 2/3, the fourth texel of a triangle never needs clipping.
    colours = rng.uniform(1 / 3, 2 / 3, size=(len(ball.vertices), 3)).astype("<f4")
    gltf = Gltf().mesh(ball.vertices, ball.faces.reshape(-1), COLOR_0=colours)
    item = gltf.scene(tmp_path).objects[0]
    mesh, texture = item.shape, item.material.texture
    np.testing.assert_allclose(mesh.triangles_m, ball.triangles, atol=1e-6)
    weights = rng.dirichlet([1, 1, 1], size=len(mesh.faces))
    uv = np.einsum("mi,mij->mj", weights, mesh.uv[mesh.faces])
    expected = np.einsum("mi,mij->mj", weights, colours[ball.faces])
    np.testing.assert_allclose(texture.weights(uv[:, 0], uv[:, 1]), expected, atol=1e-5)


def test_vertex_colours_that_need_clipping_are_exact_at_the_corners():
    rng = np.random.default_rng(4)
    mesh = ic.Mesh(rng.normal(size=(60, 3)), np.arange(60).reshape(-1, 3))
    colours = rng.integers(0, 2, size=(60, 3)).astype(float)
    own, texels = baked(mesh, colours)
    got = ic.Image(texels).weights(own.uv[:, 0], own.uv[:, 1])
    np.testing.assert_allclose(got, colours, atol=1e-5)


def test_ply_vertex_colours_are_srgb_codes(tmp_path):
    quad = trimesh.Trimesh(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
        [[0, 1, 2], [0, 2, 3]],
        vertex_colors=[[188, 0, 0, 255], [0, 188, 0, 255], [0, 0, 188, 255], [188] * 3 + [255]],
        process=False,
    )
    quad.export(tmp_path / "quad.ply")
    item = load_mesh_scene(tmp_path / "quad.ply").objects[0]
    at = {
        tuple(v[:2].astype(int)): uv
        for v, uv in zip(item.shape.vertices_m, item.shape.uv, strict=True)
    }
    got = item.material.texture.weights(*at[0, 0])
    np.testing.assert_allclose(got, [0.50289, 0, 0], atol=1e-4)


def test_lights_have_the_candela_and_lux_of_the_file(tmp_path):
    gltf = Gltf().mesh()
    lights = [
        {"type": "point", "intensity": 50.0},
        {"type": "directional", "intensity": 900.0, "color": [1, 0, 0]},
        {"type": "spot", "intensity": 7.0, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.3}},
    ]
    gltf.json["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    turn = [0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)]  # a quarter turn about y: -z becomes -x
    gltf.json["nodes"] += [
        {
            "extensions": {"KHR_lights_punctual": {"light": i}},
            "translation": [1, 2, 3],
            "rotation": turn,
        }
        for i in range(3)
    ]
    gltf.json["scenes"] = [{"nodes": [0, 1, 2, 3]}]
    point, distant, spot = gltf.scene(tmp_path, scale=2.0).lights
    assert point.position_m == (2.0, 4.0, 6.0)
    assert point.intensity.luminance_cd_m2() == pytest.approx(50.0, rel=1e-5)
    np.testing.assert_allclose(distant.towards, [1, 0, 0], atol=1e-12)
    # The red primary of sRGB holds 0.2126 of white's luminance.
    assert distant.irradiance.luminance_cd_m2() == pytest.approx(900 * 0.2126, rel=2e-3)
    np.testing.assert_allclose(spot.direction, [-1, 0, 0], atol=1e-12)
    assert spot.cone_deg == pytest.approx(np.degrees(0.3))
    assert spot.penumbra_deg == pytest.approx(np.degrees(0.2))


def test_what_is_left_out_is_said_once_for_each_kind(tmp_path):
    gltf = Gltf().mesh(material=0).texture(CORNERS)
    for name in ("a", "b"):
        gltf.material(name=name, normalTexture={"index": 0})
    gltf.mesh(material=1)
    gltf.json["nodes"] += [{"mesh": 1}, {"camera": 0}]
    gltf.json["scenes"] = [{"nodes": [0, 1, 2]}]
    gltf.json.update(cameras=[{}], animations=[{}], extensionsUsed=["KHR_materials_sheen"])
    (tmp_path / "it.gltf").write_text(gltf.text())
    with pytest.warns(UserWarning, match=r"it\.gltf") as caught:
        load_mesh_scene(tmp_path / "it.gltf")
    said = sorted(str(w.message) for w in caught)
    assert len(said) == 4
    assert any("normalTexture is left out: a, b" in message for message in said)
    assert any("KHR_materials_sheen" in message for message in said)
    assert any("cameras are left out" in message for message in said)
    # The warning points at the caller, not into isetcl.
    assert {Path(w.filename).name for w in caught} == {Path(__file__).name}


# -- OBJ and MTL ----------------------------------------------------------------------------------

OBJ = """mtllib it.mtl
o one
v 0 0 0
v 1 0 0
v 0 1 0
v 1 1 0
vt 0 0
vt 1 0
vt 0 1
usemtl a
f 1/1 2/2 3/3
o two
usemtl b
f 2/1 4/2 3/3
"""


def obj_scene(folder, mtl, text=OBJ, **options):
    (folder / "it.obj").write_text(text)
    (folder / "it.mtl").write_text(mtl)
    return load_mesh_scene(folder / "it.obj", **options)


def obj_look(folder, lines):
    scene = obj_scene(folder, f"newmtl a\n{lines}\nnewmtl b\nKd 1 1 1\n")
    return next(item for item in scene.objects if item.name.startswith("one"))


def test_obj_objects_and_materials_become_named_objects(tmp_path):
    scene = obj_scene(tmp_path, "newmtl a\nKd 0.1 0.2 0.3\nnewmtl b\nKd 0.4 0.4 0.4\n")
    found = {item.name: rgb_of(item.material.reflectance) for item in scene.objects}
    assert sorted(found) == ["one_a", "two_b"]
    np.testing.assert_allclose(found["one_a"], [0.1, 0.2, 0.3], atol=1e-9)
    np.testing.assert_allclose(found["two_b"], 0.4, atol=1e-9)


def test_mtl_entries_become_materials(tmp_path):
    assert isinstance(obj_look(tmp_path, "Kd 0.5 0.5 0.5\nillum 1\nKs 1 1 1").material, ic.Diffuse)
    assert isinstance(obj_look(tmp_path, "Kd 0 0 0\nKs 0.9 0.8 0.7\nillum 3").material, ic.Mirror)
    assert isinstance(
        obj_look(tmp_path, "Kd 0.4 0.4 0.4\nKs 0.4 0.4 0.4\nillum 3").material, ic.Mix
    )
    coated = obj_look(tmp_path, "Kd 0.5 0.5 0.5\nKs 0.5 0.5 0.5\nNs 98\nillum 2 # shiny").material
    assert isinstance(coated, ic.Coated)
    # Walter et al. 2007: 2 / alpha^2 - 2 = 98.
    assert coated.roughness == pytest.approx(np.sqrt(0.02), rel=1e-12)
    glass = obj_look(tmp_path, "Kd 1 1 1\nNi 1.52\nd 0.1\nillum 4\nNs 1000").material
    assert isinstance(glass, ic.Dielectric)
    assert glass.index.index(550.0) == 1.52
    assert glass.roughness == 0.0
    assert obj_look(tmp_path, "Kd 1 1 1\nd 0.25").opacity == 0.25
    assert obj_look(tmp_path, "Kd 1 1 1\nTr 0.25").opacity == 0.75
    lamp = obj_look(tmp_path, "Kd 0 0 0\nKe 2 2 2").emission
    assert lamp.radiance.luminance_cd_m2() == pytest.approx(200.0, rel=1e-5)
    metal = obj_look(tmp_path, "Kd 0.5 0.5 0.5\nPm 1\nPr 0.3").material
    assert isinstance(metal, ic.Mirror)
    assert metal.roughness == pytest.approx(0.09)


def test_mtl_pictures_are_found_with_options_blanks_and_other_letters(tmp_path):
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "My Wood.PNG").write_bytes(png(CORNERS))
    line = "map_Kd -s 2 3 1 -o 0.25 0.5 -clamp on maps\\my wood.png"
    texture = obj_look(tmp_path, f"Kd 0.5 0.5 0.5\n{line}").material.texture
    assert (texture.repeats, texture.offset, texture.wrap) == ((2, 3), (0.25, 0.5), "clamp")
    np.testing.assert_allclose(texture.texels[0, 0], [0.5, 0, 0], atol=1e-6)
    # A path of another computer is sought beside the file by its last part; black is no colour.
    (tmp_path / "tile.png").write_bytes(png(CORNERS))
    texture = obj_look(tmp_path, "Kd 0 0 0\nmap_Kd C:\\maps\\tile.png").material.texture
    np.testing.assert_allclose(texture.texels[0, 0], [1, 0, 0], atol=1e-6)


def test_a_missing_mtl_file_leaves_grey_and_warns(tmp_path):
    (tmp_path / "it.obj").write_text(OBJ)
    with pytest.warns(UserWarning, match=r"material files are missing.*it\.mtl"):
        scene = load_mesh_scene(tmp_path / "it.obj")
    assert all(isinstance(item.material, ic.Diffuse) for item in scene.objects)
    with pytest.warns(UserWarning, match="materials that no MTL file holds are matt grey: b"):
        obj_scene(tmp_path, "newmtl a\nKd 1 1 1\n")


def test_indices_that_count_back_count_from_their_face(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 9\nv 1 0 9\nv 0 1 9\nf -3 -2 -1\n"
    (tmp_path / "it.obj").write_text(text)
    got = triangles_of(load_mesh_scene(tmp_path / "it.obj"))
    assert sorted(got[:, 0, 2]) == [0.0, 9.0]


def test_polygons_become_triangles(tmp_path):
    turn = np.arange(6) * np.pi / 3
    points = "".join(f"v {np.cos(t):.9f} {np.sin(t):.9f} 0\n" for t in turn)
    (tmp_path / "it.obj").write_text(points + "f 1 2 3 4 5 6\nf 1 2 3 4\n")
    area = measures(triangles_of(load_mesh_scene(tmp_path / "it.obj")))[6] / 2.0
    # A hexagon of side 1, and half of one.
    assert area == pytest.approx(1.5 * np.sqrt(3) * 1.5, rel=1e-5)


# -- refusals -------------------------------------------------------------------------------------


def test_all_missing_pictures_are_listed_at_once(tmp_path):
    with pytest.raises(FileError, match=r"2 file\(s\).*'one.png', 'two.jpg'; put them there"):
        obj_scene(tmp_path, "newmtl a\nmap_Kd one.png\nnewmtl b\nmap_Ke two.jpg\n")
    gltf = Gltf().mesh(material=0)
    gltf.json.update(images=[{"uri": "no%20such.png"}], textures=[{"source": 0}])
    gltf.material(pbrMetallicRoughness={"baseColorTexture": {"index": 0}})
    with pytest.raises(FileError, match=r"'no such\.png'"):
        gltf.scene(tmp_path)


def test_files_outside_the_folder_are_refused_unless_allowed(tmp_path):
    inside = tmp_path / "inside"
    inside.mkdir()
    (tmp_path / "secret.png").write_bytes(png(CORNERS))
    mtl = "newmtl a\nmap_Kd ../secret.png\nnewmtl b\nKd 1 1 1\n"
    with pytest.raises(FileError, match="outside its folder; pass allow_outside=True"):
        obj_scene(inside, mtl)
    assert len(obj_scene(inside, mtl, allow_outside=True).objects) == 2
    (inside / "link.png").symlink_to(tmp_path / "secret.png")
    with pytest.raises(FileError, match="outside its folder"):
        obj_scene(inside, mtl.replace("../secret", "link"))
    gltf = Gltf().mesh()
    document = json.loads(gltf.text())
    document["buffers"] = [{"byteLength": 10, "uri": "%2e%2e/secret.png"}]
    (inside / "it.gltf").write_text(json.dumps(document))
    with pytest.raises(FileError, match="outside its folder"):
        load_mesh_scene(inside / "it.gltf")
    for uri in ("https://example.org/a.png", "file:///etc/passwd"):
        with pytest.raises(FileError, match="no file name"):
            obj_scene(inside, mtl.replace("../secret.png", uri))


def broken(**changes):
    gltf = Gltf().mesh()
    gltf.json.update(changes)
    return gltf.text()


BROKEN = {
    "nan": Gltf().mesh(np.full((3, 3), np.nan)).text(),
    "infinite": Gltf().mesh(np.full((3, 3), np.inf)).text(),
    "index": Gltf().mesh(indices=[0, 1, 7]).text(),
    "version": broken(asset={"version": "1.0"}),
    "cycle": broken(nodes=[{"mesh": 0, "children": [0]}]),
    "node": broken(scenes=[{"nodes": [5]}]),
    "mesh": broken(nodes=[{"mesh": 3}]),
    "negative": broken(nodes=[{"mesh": -1}]),
    "matrix": broken(nodes=[{"mesh": 0, "matrix": [1, 2, 3]}]),
    "projective": broken(nodes=[{"mesh": 0, "matrix": [1.0] * 16}]),
    "not a number": broken(nodes=[{"mesh": 0, "scale": ["a", 1, 1]}]),
    "zero turn": broken(nodes=[{"mesh": 0, "rotation": [0, 0, 0, 0]}]),
    "empty": broken(nodes=[{"name": "nothing"}]),
    "no extent": broken(nodes=[{"mesh": 0, "scale": [1, 0, 1]}]),
    "draco": broken(extensionsRequired=["KHR_draco_mesh_compression"]),
    "list": "[]",
    "json": "{",
    "deep": "[" * 100000,
    "view": broken(bufferViews=[{"buffer": 0, "byteOffset": 8, "byteLength": 999}]),
    "type": broken(accessors=[{"count": 3, "componentType": 1, "type": "VEC3"}]),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_gltf_is_refused_in_isetcl_s_own_words(tmp_path, name):
    file = tmp_path / "bad.gltf"
    file.write_text(BROKEN[name])
    with pytest.raises(FileError, match=r"bad\.gltf"):
        quietly(load_mesh_scene, file)


def test_a_glb_cut_anywhere_is_refused(tmp_path):
    whole = Gltf().mesh().glb()
    file = tmp_path / "cut.glb"
    file.write_bytes(whole)
    assert len(load_mesh_scene(file).objects) == 1
    for length in range(0, len(whole), 7):
        file.write_bytes(whole[:length])
        with pytest.raises(FileError):
            load_mesh_scene(file)


def test_sizes_that_do_not_fit_are_said_before_anything_is_allocated(tmp_path):
    accessor = {"count": 10**13, "componentType": 5126, "type": "VEC3"}
    file = tmp_path / "huge.gltf"
    file.write_text(broken(accessors=[accessor]))
    with pytest.raises(OutOfMemoryError, match=r"huge\.gltf.*GiB"):
        load_mesh_scene(file)


@pytest.mark.parametrize(
    "kind", ["glb", "gltf", "obj", "ply", "stl", "off", "xyzw", "", "zip", "3mf"]
)
@pytest.mark.parametrize(
    "content", [b"", b"\0" * 64, bytes(range(256)) * 4, b"hello\n", b"ply\nformat x\n"]
)
def test_junk_is_refused(tmp_path, kind, content):
    file = tmp_path / f"junk.{kind}"
    file.write_bytes(content)
    with pytest.raises(IsetclError):
        quietly(load_mesh_scene, file)


@pytest.mark.parametrize(
    "text",
    [
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
        "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -9 -2 -1\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\n",
        "v a b c\nf 1 2 3\n",
    ],
)
def test_broken_obj_is_refused(tmp_path, text):
    (tmp_path / "bad.obj").write_text(text)
    with pytest.raises(FileError, match=r"bad\.obj"):
        quietly(load_mesh_scene, tmp_path / "bad.obj")


def test_a_wrong_mtl_line_is_named(tmp_path):
    with pytest.raises(FileError, match=r"'it\.mtl', line 2: kd must be followed by numbers"):
        obj_scene(tmp_path, "newmtl a\nKd red\nnewmtl b\nKd 1 1 1\n")


@pytest.mark.parametrize(
    "options",
    [{"scale": 0}, {"scale": "a"}, {"allow_outside": 1}, {"luminance_of_white_cd_m2": -1}],
)
def test_wrong_options_are_refused(tmp_path, options):
    with pytest.raises(InvalidInputError):
        load_mesh_scene(tmp_path / "x.glb", **options)


def test_paths_that_are_no_files_are_refused(tmp_path):
    for path in (tmp_path / "none.glb", tmp_path, "a\0b.glb"):
        with pytest.raises(FileError):
            load_mesh_scene(path)
    with pytest.raises(InvalidInputError):
        load_mesh_scene(None)


def rich():
    """A document that uses most of what is read."""
    gltf = Gltf().texture(CORNERS, wrapS=33648).texture([[[9, 99, 199]]])
    info = {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2, 2]}}}
    pbr = {"baseColorTexture": info, "metallicRoughnessTexture": {"index": 1}}
    gltf.material(pbrMetallicRoughness=pbr, alphaMode="MASK", emissiveFactor=[1, 1, 0])
    gltf.mesh(indices=[0, 1, 2], material=0, TEXCOORD_0=np.zeros((3, 2), "<f4"), NORMAL=TRIANGLE)
    light = {"type": "spot", "spot": {"outerConeAngle": 0.3}}
    gltf.json["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}
    gltf.json["nodes"] += [{"extensions": {"KHR_lights_punctual": {"light": 0}}, "children": []}]
    gltf.json["nodes"][0]["children"] = [1]
    return json.loads(gltf.text())


def places(value, path=()):
    """Paths of all entries of nested lists and dicts."""
    entries = value.items() if isinstance(value, dict) else enumerate(value)
    for key, entry in entries:
        yield (*path, key)
        if isinstance(entry, (dict, list)):
            yield from places(entry, (*path, key))


def test_no_change_of_any_entry_breaks_more_than_the_file(tmp_path):
    """Every entry of a document becomes junk, or is left out."""
    whole = rich()
    file = tmp_path / "it.gltf"
    refused = 0
    junk = [None, -1, 10**9, "x", [], {}, [None], 1e308]
    for number, path in enumerate(list(places(whole))):
        document = json.loads(json.dumps(whole))
        holder = document
        for key in path[:-1]:
            holder = holder[key]
        for value in ("delete", junk[number % len(junk)], junk[(3 * number + 1) % len(junk)]):
            if value == "delete":
                removed = holder.pop(path[-1])
            elif isinstance(holder, dict) or path[-1] < len(holder):
                holder[path[-1]] = value
            file.write_text(json.dumps(document))
            try:
                quietly(load_mesh_scene, file)
            except IsetclError:
                refused += 1
            if value == "delete" and isinstance(holder, list):
                holder.insert(path[-1], removed)
    assert refused > 50


FOLDER = os.environ.get("ISETCL_MESH_FILES", "")
OTHERS = sorted(
    path
    for kind in ("glb", "obj", "ply", "stl")
    for path in (Path(FOLDER).rglob(f"*.{kind}") if FOLDER else ())
)


@pytest.mark.slow
@pytest.mark.parametrize("path", OTHERS, ids=str)
def test_files_of_others_have_the_geometry_that_trimesh_finds(path):
    try:
        scene = quietly(load_mesh_scene, path)
    except FileError as error:
        pytest.skip(str(error)[:200])
    loaded = trimesh.load(path, force="scene", process=False).to_geometry().triangles
    expected = measures(loaded)
    np.testing.assert_allclose(
        measures(triangles_of(scene)), expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max()
    )

"""The records that the path pipeline reads: shapes, materials, lights and spectra of a scene."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from isetcl.device.layout import Member, Precision, Struct, c_enum, real_dtype
from isetcl.render.pack_lights import LIGHT, LightKind, pack_lights
from isetcl.render.pack_looks import SUBSTANCE, TEXTURE, Looks, SubstanceKind, TextureKind
from isetcl.retina.bands import Band
from isetcl.scene.light import Environment
from isetcl.scene.light_field import LightField
from isetcl.scene.material import Emission
from isetcl.scene.mesh import Instance, Mesh
from isetcl.scene.model import Disc, Quad, Scene, SceneObject, Shape, Sphere
from isetcl.scene.texture import Image
from isetcl.scene.view import plane_axes

WAVELENGTHS_AT_ONCE = 4
"""Wavelengths that a path carries."""


class ShapeKind(IntEnum):
    """What an object is. The same numbers are compiled into the kernels."""

    FLAT = 0
    BALL = 1
    MESH = 2


WORLD = Struct(
    "world_t",
    (
        Member("n_flats", "int"),
        Member("n_balls", "int"),
        Member("n_lights", "int"),
        Member("background", "int"),
        Member("environment", "int"),
        Member("environment_shares", "int"),
        Member("environment_rows_sum", "int"),
        Member("environment_columns_sum", "int"),
        Member("environment_rows", "int"),
        Member("environment_columns", "int"),
        Member("instances_at", "int"),
        Member("environment_probability"),
        Member("rotation", length=9),
        Member("meshes_low", length=3),
        Member("meshes_high", length=3),
    ),
)
OBJECT = Struct(
    "object_t",
    (
        Member("kind", "int"),
        Member("first", "int"),
        Member("substance", "int"),
        Member("is_smooth", "int"),
        Member("instance", "int"),
        Member("emission", "int"),
        Member("emission_texture", "int"),
        Member("shines_behind", "int"),
        Member("is_additive", "int"),
        Member("opacity_texture", "int"),
        Member("opacity"),
        Member("density"),
        Member("turns_u"),
        Member("turns_v"),
    ),
)
FLAT = Struct(
    "flat_t",
    (
        Member("object", "int"),
        Member("is_round", "int"),
        *(
            Member(name, length=3)
            for name in ("corner", "edge_u", "edge_v", "normal", "axis_u", "axis_v", "foot")
        ),
        Member("foot_u"),
        Member("foot_v"),
    ),
)
BALL = Struct("ball_t", (Member("object", "int"), Member("centre", length=3), Member("radius")))
INSTANCE = Struct(
    "instance_t",
    (
        Member("object", "int"),
        Member("nodes_at", "int"),
        Member("blocks_at", "int"),
        Member("first_triangle", "int"),
        Member("matrix", length=12),
        Member("inverse", length=12),
    ),
)
TILE = Struct(
    "tile_t",
    (
        Member("x", "int"),
        Member("y", "int"),
        Member("columns", "int"),
        Member("image_width", "int"),
        Member("pixel_rad"),
    ),
)


def declarations() -> str:
    """The C declarations of the kernels that follow paths."""
    structs = (WORLD, OBJECT, FLAT, BALL, INSTANCE, SUBSTANCE, TEXTURE, LIGHT, TILE)
    return (
        c_enum(TextureKind, "TEXTURE")
        + c_enum(SubstanceKind, "SUBSTANCE")
        + c_enum(ShapeKind, "SHAPE")
        + c_enum(LightKind, "LIGHT")
        + "".join(struct.c_declaration() for struct in structs)
    )


@dataclass(frozen=True, eq=False)
class MeshPart:
    """Triangles that have a hierarchy of their own: those of an instanced mesh."""

    mesh: Mesh
    first_triangle: int
    centre_m: np.ndarray

    @property
    def triangles_m(self) -> np.ndarray:
        """Its triangles about their centre: where a mesh was modelled must not cost precision."""
        return self.mesh.triangles_m - self.centre_m

    def matrix(self, instance: Instance) -> np.ndarray:
        """The map from triangles about their centre to the world, (4, 4)."""
        matrix = instance.matrix.copy()
        matrix[:3, 3] += matrix[:3, :3] @ self.centre_m
        return matrix


@dataclass(frozen=True, eq=False)
class PackedScene:
    """A scene as arrays.

    Attributes
    ----------
    records : dict of ndarray
        "world", "objects", "flats", "balls", "substances", "textures", "lights".
    texels : ndarray of float32
        Of pictures, then tables of the environment.
    spectra : ndarray, (rows, wavelengths + 4)
        Radiances, reflectances, indices and intensities, the last value repeated.
    triangles : ndarray, (n, 3, 3)
        Of all meshes in place, then of all instanced meshes in frames of their own.
    n_placed : int
        Triangles in place.
    parts : tuple of MeshPart
        Instanced meshes.
    instances : tuple of (object, part, Instance)
    triangle_object : ndarray of int32, (n_placed,)
    normals, uvs : ndarray, (n, 9) and (n, 6), or None
        Shading normals and texture coordinates at the corners, where any mesh has them.
    """

    records: dict[str, np.ndarray]
    texels: np.ndarray
    spectra: np.ndarray
    triangles: np.ndarray
    n_placed: int
    parts: tuple[MeshPart, ...]
    instances: tuple[tuple[int, int, Instance], ...]
    triangle_object: np.ndarray
    normals: np.ndarray | None
    uvs: np.ndarray | None


def pack_paths(
    scene: Scene,
    images: dict[str, Image],
    wavelengths_nm: np.ndarray,
    bands: tuple[Band, ...],
    precision: Precision,
) -> PackedScene:
    """The arrays of a scene.

    Parameters
    ----------
    images
        Pictures to upload instead of others, by the digest of those: averaged down where the plan
        found that to be enough.
    """
    return _Packer(scene, images, wavelengths_nm, bands, precision).pack()


def in_place(item: SceneObject) -> Mesh | None:
    """The mesh of an object whose triangles are stored where they stand.

    Instances that shine are stored so, too, since every triangle of theirs is a light.
    """
    if isinstance(item.shape, Mesh):
        return item.shape
    if isinstance(item.shape, Instance) and item.emitted is not None:
        return item.shape.in_place
    return None


def _turns(shape: Shape) -> tuple[float, float]:
    """Texture coordinates a metre along u and v; of meshes, in terms of those of a triangle."""
    if isinstance(shape, Sphere):
        return 1.0 / (2.0 * np.pi * shape.radius_m), 1.0 / (np.pi * shape.radius_m)
    if isinstance(shape, Instance):
        scale = float(np.cbrt(abs(np.linalg.det(shape.matrix[:3, :3]))))
        return 1.0 / scale, 1.0 / scale
    if isinstance(shape, Mesh):
        return 1.0, 1.0
    quad = shape.bounding_quad() if isinstance(shape, Disc) else shape
    return 1.0 / float(np.linalg.norm(quad.edge_u_m)), 1.0 / float(np.linalg.norm(quad.edge_v_m))


class _Packer:
    """Collects records object by object."""

    def __init__(
        self,
        scene: Scene,
        images: dict[str, Image],
        wavelengths_nm: np.ndarray,
        bands: tuple[Band, ...],
        precision: Precision,
    ) -> None:
        self._scene = scene
        self._precision = precision
        self._looks = Looks(images, wavelengths_nm, bands, precision)
        self._flats: list[np.ndarray] = []
        self._balls: list[np.ndarray] = []
        self._meshes: list[tuple[int, Mesh]] = []
        self._parts: dict[str, int] = {}
        self._part_meshes: list[Mesh] = []
        self._instances: list[tuple[int, int, Instance]] = []

    def pack(self) -> PackedScene:
        scene, precision, looks = self._scene, self._precision, self._looks
        objects = np.zeros(max(1, len(scene.objects)), dtype=OBJECT.dtype(precision))
        for i, item in enumerate(scene.objects):
            self._object(objects[i], item, i)
        placed = [mesh.triangles_m for _, mesh in self._meshes]
        owner = np.repeat([i for i, _ in self._meshes], [len(m.faces) for _, m in self._meshes])
        parts, n = [], sum(len(part) for part in placed)
        n_placed = n
        for mesh in self._part_meshes:
            corners = mesh.triangles_m.reshape(-1, 3)
            centre = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
            parts.append(MeshPart(mesh, n, centre))
            n += len(mesh.faces)
        everything = placed + [part.triangles_m for part in parts]
        triangles = np.concatenate(everything) if everything else np.zeros((0, 3, 3))
        self._first_triangles(objects, parts)
        world = np.zeros(1, dtype=WORLD.dtype(precision))
        world["n_flats"], world["n_balls"] = len(self._flats), len(self._balls)
        self._background(world)
        lights = pack_lights(scene, looks, objects, world, triangles[:n_placed], owner)
        world["n_lights"] = len(lights)
        return PackedScene(
            {
                "world": world,
                "objects": objects,
                "flats": self._stack(self._flats, FLAT),
                "balls": self._stack(self._balls, BALL),
                "substances": self._stack(looks.substances, SUBSTANCE),
                "textures": self._stack(looks.textures, TEXTURE),
                "lights": lights if len(lights) else np.zeros(1, dtype=LIGHT.dtype(precision)),
            },
            looks.packed_texels(),
            looks.packed_spectra(WAVELENGTHS_AT_ONCE),
            triangles,
            n_placed,
            tuple(parts),
            tuple(self._instances),
            owner.astype(np.int32) if len(owner) else np.zeros(1, dtype=np.int32),
            self._at_corners("normals", 3),
            self._at_corners("uv", 2),
        )

    def _stack(self, records: list[np.ndarray], struct: Struct) -> np.ndarray:
        if records:
            return np.concatenate(records)
        return np.zeros(1, dtype=struct.dtype(self._precision))

    def _object(self, record: np.void, item: SceneObject, index: int) -> None:
        """One object: its shape, what it sends out and what it does with light."""
        looks = self._looks
        record["kind"], record["first"] = self._shape(item, index)
        mesh = item.shape.mesh if isinstance(item.shape, Instance) else item.shape
        record["is_smooth"] = isinstance(mesh, Mesh) and mesh.normals is not None
        record["instance"] = record["emission"] = record["emission_texture"] = -1
        record["substance"] = looks.substance(item.material) if item.scatters else -1
        emitted = item.emitted
        if emitted is not None:
            record["emission"] = looks.rows(emitted.spectra())
            if isinstance(emitted.texture, LightField):
                assert isinstance(item.shape, Quad), "light fields are shown by quads"
                edges = (np.linalg.norm(e) for e in (item.shape.edge_u_m, item.shape.edge_v_m))
                record["emission_texture"] = looks.light_field(
                    emitted.texture, *(float(edge) for edge in edges)
                )
            else:
                record["emission_texture"] = looks.texture(emitted.texture)
            one_sided = isinstance(emitted, Emission) and emitted.sides == "front"
            record["shines_behind"] = not one_sided
            record["is_additive"] = isinstance(emitted, Emission) and emitted.is_additive
        record["opacity"], record["opacity_texture"] = looks.level(item.opacity)
        record["turns_u"], record["turns_v"] = _turns(item.shape)

    def _shape(self, item: SceneObject, index: int) -> tuple[ShapeKind, int]:
        shape, mesh = item.shape, in_place(item)
        if mesh is not None:
            self._meshes.append((index, mesh))
            return ShapeKind.MESH, 0
        if isinstance(shape, Instance):
            key = shape.mesh.digest()
            if key not in self._parts:
                self._parts[key] = len(self._part_meshes)
                self._part_meshes.append(shape.mesh)
            self._instances.append((index, self._parts[key], shape))
            return ShapeKind.MESH, 0
        if isinstance(shape, Sphere):
            ball = np.zeros(1, dtype=BALL.dtype(self._precision))
            ball["object"], ball["centre"], ball["radius"] = index, shape.centre_m, shape.radius_m
            self._balls.append(ball)
            return ShapeKind.BALL, len(self._balls) - 1
        assert not isinstance(shape, Mesh)
        quad = shape.bounding_quad() if isinstance(shape, Disc) else shape
        flat = np.zeros(1, dtype=FLAT.dtype(self._precision))
        flat["object"], flat["is_round"] = index, isinstance(shape, Disc)
        flat["corner"], flat["edge_u"], flat["edge_v"] = quad.corner_m, quad.edge_u_m, quad.edge_v_m
        normal, axis_u, axis_v = plane_axes(quad)
        flat["normal"], flat["axis_u"], flat["axis_v"] = normal, axis_u, axis_v
        # A plane is held by its point nearest to the eye: corners may be far away.
        foot = normal * (normal @ np.array(quad.corner_m))
        flat["foot"] = foot
        flat["foot_u"], flat["foot_v"] = (
            axis @ (foot - quad.corner_m) for axis in (axis_u, axis_v)
        )
        self._flats.append(flat)
        return ShapeKind.FLAT, len(self._flats) - 1

    def _first_triangles(self, objects: np.ndarray, parts: list[MeshPart]) -> None:
        """A triangle of every mesh, for lanes that have none of their own."""
        at = 0
        for i, mesh in self._meshes:
            objects[i]["first"] = at
            at += len(mesh.faces)
        for i, part, _ in self._instances:
            objects[i]["first"] = parts[part].first_triangle

    def _background(self, world: np.ndarray) -> None:
        background = self._scene.background
        world["rotation"] = np.eye(3).ravel()
        world["environment"] = -1
        if background is None:
            world["background"] = -1
        elif isinstance(background, Environment):
            world["background"] = self._looks.rows(background.spectra())
            world["environment"] = self._looks.texture(background.texture)
            if background.rotation is not None:
                world["rotation"] = background.rotation.ravel()
        else:
            world["background"] = self._looks.rows((background,))

    def _at_corners(self, name: str, width: int) -> np.ndarray | None:
        meshes = [mesh for _, mesh in self._meshes] + self._part_meshes
        if all(getattr(mesh, name) is None for mesh in meshes):
            return None
        parts = []
        for mesh in meshes:
            values = getattr(mesh, name)
            shape = (len(mesh.faces), 3 * width)
            parts.append(np.zeros(shape) if values is None else values[mesh.faces].reshape(shape))
        return np.concatenate(parts).astype(real_dtype(self._precision))

"""The records that the path pipeline reads: shapes, materials, lights and spectra of a scene."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from isetcl.device.layout import Member, Precision, Struct, c_enum, real_dtype
from isetcl.render.kernel_config import MaterialKind
from isetcl.scene.light import DistantLight
from isetcl.scene.material import Diffuse
from isetcl.scene.mesh import Mesh
from isetcl.scene.model import Disc, Quad, Scene, SceneObject, Sphere
from isetcl.scene.texture import Checkerboard, Image
from isetcl.scene.view import plane_axes

WAVELENGTHS_AT_ONCE = 4
"""Wavelengths that a path carries."""


class ShapeKind(IntEnum):
    """What an object is. The same numbers are compiled into the kernels."""

    FLAT = 0
    BALL = 1
    MESH = 2


class LightKind(IntEnum):
    """What a light is. The same numbers are compiled into the kernels."""

    OBJECT = 0
    POINT = 1
    DISTANT = 2


WORLD = Struct(
    "world_t",
    (
        Member("n_flats", "int"),
        Member("n_balls", "int"),
        Member("n_lights", "int"),
        Member("background", "int"),
    ),
)
OBJECT = Struct(
    "object_t",
    (
        Member("kind", "int"),
        Member("first", "int"),
        Member("substance", "int"),
        Member("is_smooth", "int"),
        Member("density"),
    ),
)
FLAT = Struct(
    "flat_t",
    (
        Member("object", "int"),
        Member("is_round", "int"),
        *(
            Member(name, length=3)
            for name in ("corner", "edge_u", "edge_v", "normal", "axis_u", "axis_v")
        ),
    ),
)
BALL = Struct("ball_t", (Member("object", "int"), Member("centre", length=3), Member("radius")))
SUBSTANCE = Struct(
    "substance_t",
    (
        Member("kind", "int"),
        Member("emission", "int"),
        Member("reflectance", "int"),
        Member("picture", "int"),
        Member("periods_u"),
        Member("periods_v"),
        Member("bright"),
        Member("dark"),
    ),
)
PICTURE = Struct(
    "picture_t",
    (Member("first", "int"), Member("channels", "int"), Member("width"), Member("height")),
)
LIGHT = Struct(
    "light_t",
    (
        Member("kind", "int"),
        Member("object", "int"),
        Member("triangle", "int"),
        Member("row", "int"),
        Member("probability"),
        Member("cumulative"),
        Member("place", length=3),
    ),
)
TILE = Struct(
    "tile_t",
    (
        Member("x", "int"),
        Member("y", "int"),
        Member("columns", "int"),
        Member("image_width", "int"),
    ),
)


def declarations() -> str:
    """The C declarations of the kernels that follow paths."""
    structs = (WORLD, OBJECT, FLAT, BALL, SUBSTANCE, PICTURE, LIGHT, TILE)
    return (
        c_enum(MaterialKind, "MATERIAL")
        + c_enum(ShapeKind, "SHAPE")
        + c_enum(LightKind, "LIGHT")
        + "".join(struct.c_declaration() for struct in structs)
    )


@dataclass(frozen=True, eq=False)
class PackedScene:
    """A scene as arrays.

    Attributes
    ----------
    records : dict of ndarray
        "world", "objects", "flats", "balls", "substances", "pictures", "lights".
    texels : ndarray of float32
    spectra : ndarray, (rows, wavelengths + 4)
        Radiances, reflectances and intensities, the last value repeated.
    triangles : ndarray, (n, 3, 3)
        Of all meshes; empty without any.
    triangle_object : ndarray of int32, (n,)
    normals, uvs : ndarray, (n, 9) and (n, 6), or None
        Shading normals and texture coordinates at the corners, where any mesh has them.
    """

    records: dict[str, np.ndarray]
    texels: np.ndarray
    spectra: np.ndarray
    triangles: np.ndarray
    triangle_object: np.ndarray
    normals: np.ndarray | None
    uvs: np.ndarray | None


def pack_paths(
    scene: Scene,
    images: tuple[Image | None, ...],
    wavelengths_nm: np.ndarray,
    precision: Precision,
) -> PackedScene:
    """The arrays of a scene.

    Parameters
    ----------
    images
        For every object the picture to upload (at the resolution the plan chose), or None.
    """
    return _Packer(scene, images, wavelengths_nm, precision).pack()


class _Packer:
    """Collects records object by object."""

    def __init__(
        self,
        scene: Scene,
        images: tuple[Image | None, ...],
        wavelengths_nm: np.ndarray,
        precision: Precision,
    ) -> None:
        self._scene = scene
        self._images = images
        self._wavelengths = wavelengths_nm
        self._precision = precision
        self._rows: list[np.ndarray] = []
        self._flats: list[np.ndarray] = []
        self._balls: list[np.ndarray] = []
        self._pictures: list[np.ndarray] = []
        self._texels: list[np.ndarray] = []
        self._meshes: list[tuple[int, Mesh]] = []

    def pack(self) -> PackedScene:
        scene, precision = self._scene, self._precision
        objects = np.zeros(max(1, len(scene.objects)), dtype=OBJECT.dtype(precision))
        substances = np.zeros(max(1, len(scene.objects)), dtype=SUBSTANCE.dtype(precision))
        for i, item in enumerate(scene.objects):
            objects[i]["substance"] = i
            substances[i] = self._substance(item, self._images[i])
            objects[i]["kind"], objects[i]["first"] = self._shape(item, i)
            objects[i]["is_smooth"] = (
                isinstance(item.shape, Mesh) and item.shape.normals is not None
            )
        triangles, owner = self._triangles()
        lights = self._lights(objects, triangles, owner)
        world = np.zeros(1, dtype=WORLD.dtype(precision))
        world["n_flats"], world["n_balls"] = len(self._flats), len(self._balls)
        world["n_lights"] = len(lights)
        background = scene.background
        world["background"] = (
            -1 if background is None else self._row(background.at(self._wavelengths))
        )
        spectra = np.array(self._rows) if self._rows else np.zeros((1, len(self._wavelengths)))
        spectra = np.pad(spectra, ((0, 0), (0, WAVELENGTHS_AT_ONCE)), mode="edge")
        return PackedScene(
            {
                "world": world,
                "objects": objects,
                "flats": self._stack(self._flats, FLAT),
                "balls": self._stack(self._balls, BALL),
                "substances": substances,
                "pictures": self._stack(self._pictures, PICTURE),
                "lights": lights if len(lights) else np.zeros(1, dtype=LIGHT.dtype(precision)),
            },
            np.concatenate(self._texels) if self._texels else np.zeros(1, dtype=np.float32),
            np.ascontiguousarray(spectra, dtype=real_dtype(precision)),
            triangles,
            owner,
            self._at_corners("normals", 3),
            self._at_corners("uv", 2),
        )

    def _stack(self, records: list[np.ndarray], struct: Struct) -> np.ndarray:
        if records:
            return np.concatenate(records)
        return np.zeros(1, dtype=struct.dtype(self._precision))

    def _row(self, values: np.ndarray) -> int:
        self._rows.append(np.asarray(values, dtype=np.float64))
        return len(self._rows) - 1

    def _substance(self, item: SceneObject, image: Image | None) -> np.ndarray:
        """A material, with its spectra in neighbouring rows."""
        record = np.zeros(1, dtype=SUBSTANCE.dtype(self._precision))
        rows = [self._row(s.at(self._wavelengths)) for s in item.material.spectra()]
        first = rows[0]
        is_diffuse = isinstance(item.material, Diffuse)
        record["emission"] = -1 if is_diffuse else first
        record["reflectance"] = first if is_diffuse else -1
        record["kind"] = MaterialKind.UNIFORM
        texture = item.material.texture
        if image is not None:
            record["kind"] = MaterialKind.IMAGE
            record["picture"] = self._picture(image)
        elif isinstance(texture, Checkerboard):
            record["kind"] = MaterialKind.CHECKERBOARD
            record["periods_u"], record["periods_v"] = 2 * texture.periods_u, 2 * texture.periods_v
            record["bright"], record["dark"] = texture.bright, texture.dark
        return record[0]

    def _picture(self, image: Image) -> int:
        record = np.zeros(1, dtype=PICTURE.dtype(self._precision))
        record["first"] = sum(len(texels) for texels in self._texels)
        record["channels"] = image.channels
        record["height"], record["width"] = image.shape
        self._pictures.append(record)
        self._texels.append(np.ascontiguousarray(image.texels, dtype=np.float32).ravel())
        return len(self._pictures) - 1

    def _shape(self, item: SceneObject, index: int) -> tuple[ShapeKind, int]:
        shape = item.shape
        if isinstance(shape, Mesh):
            self._meshes.append((index, shape))
            return ShapeKind.MESH, 0
        if isinstance(shape, Sphere):
            ball = np.zeros(1, dtype=BALL.dtype(self._precision))
            ball["object"], ball["centre"], ball["radius"] = index, shape.centre_m, shape.radius_m
            self._balls.append(ball)
            return ShapeKind.BALL, len(self._balls) - 1
        quad = shape.bounding_quad() if isinstance(shape, Disc) else shape
        flat = np.zeros(1, dtype=FLAT.dtype(self._precision))
        flat["object"], flat["is_round"] = index, isinstance(shape, Disc)
        flat["corner"], flat["edge_u"], flat["edge_v"] = quad.corner_m, quad.edge_u_m, quad.edge_v_m
        flat["normal"], flat["axis_u"], flat["axis_v"] = plane_axes(quad)
        self._flats.append(flat)
        return ShapeKind.FLAT, len(self._flats) - 1

    def _triangles(self) -> tuple[np.ndarray, np.ndarray]:
        if not self._meshes:
            return np.zeros((0, 3, 3)), np.zeros(1, dtype=np.int32)
        triangles = np.concatenate([mesh.triangles_m for _, mesh in self._meshes])
        owner = np.repeat([i for i, _ in self._meshes], [len(m.faces) for _, m in self._meshes])
        return triangles, owner.astype(np.int32)

    def _at_corners(self, name: str, width: int) -> np.ndarray | None:
        if all(getattr(mesh, name) is None for _, mesh in self._meshes):
            return None
        parts = []
        for _, mesh in self._meshes:
            values = getattr(mesh, name)
            shape = (len(mesh.faces), 3 * width)
            parts.append(np.zeros(shape) if values is None else values[mesh.faces].reshape(shape))
        return np.concatenate(parts).astype(real_dtype(self._precision))

    def _lights(self, objects: np.ndarray, triangles: np.ndarray, owner: np.ndarray) -> np.ndarray:
        """Everything that lights the scene and has a place, with probabilities by power."""
        entries: list[tuple[float, int, int]] = []
        areas: dict[int, float] = {}
        for i, item in enumerate(self._scene.objects):
            if isinstance(item.material, Diffuse):
                continue
            power = self._radiance(item)
            if power <= 0:
                continue
            if isinstance(item.shape, Mesh):
                a, b, c = (triangles[owner == i][:, k] for k in range(3))
                area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0
                numbers = np.flatnonzero(owner == i)
                entries += [
                    (power * float(s), i, int(n))
                    for s, n in zip(area, numbers, strict=True)
                    if s > 0
                ]
                areas[i] = float(area.sum())
            else:
                areas[i] = _area(item.shape)
                entries.append((power * areas[i], i, -1))
        total = sum(power for power, _, _ in entries)
        typical = total / len(entries) if entries else 1.0
        records = np.zeros(
            len(entries) + len(self._scene.lights), dtype=LIGHT.dtype(self._precision)
        )
        total += typical * len(self._scene.lights)
        for record, (power, i, triangle) in zip(records, entries, strict=False):
            record["kind"], record["object"], record["triangle"] = LightKind.OBJECT, i, triangle
            record["probability"] = power / total
        for record, light in zip(records[len(entries) :], self._scene.lights, strict=True):
            distant = isinstance(light, DistantLight)
            spectrum = light.irradiance if isinstance(light, DistantLight) else light.intensity
            record["kind"] = LightKind.DISTANT if distant else LightKind.POINT
            record["row"] = self._row(spectrum.at(self._wavelengths))
            place = np.array(light.towards if isinstance(light, DistantLight) else light.position_m)
            record["place"] = place / np.linalg.norm(place) if distant else place
            record["probability"] = typical / total
        records["cumulative"] = np.cumsum(records["probability"])
        for i, area in areas.items():
            share = float(
                records["probability"][: len(entries)][records["object"][: len(entries)] == i].sum()
            )
            is_ball = objects[i]["kind"] == ShapeKind.BALL
            objects[i]["density"] = share if is_ball else share / area
        return records

    def _radiance(self, item: SceneObject) -> float:
        """Mean radiance of an emitter, for choosing lights."""
        mean = 1.0 if item.material.texture is None else item.material.texture.mean
        return mean * float(sum(np.mean(s.at(self._wavelengths)) for s in item.material.spectra()))


def _area(shape: Quad | Disc | Sphere) -> float:
    """Area of a shape, m^2."""
    if isinstance(shape, Sphere):
        return float(4.0 * np.pi * shape.radius_m**2)
    if isinstance(shape, Disc):
        return float(np.pi * shape.radius_m**2)
    return float(np.linalg.norm(np.cross(shape.edge_u_m, shape.edge_v_m)))

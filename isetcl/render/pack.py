"""The records that the direct pipeline reads: retina, pupils and scene in the kernels' layout."""

from __future__ import annotations

import numpy as np

from isetcl.device.bending import declarations as bend_declarations
from isetcl.device.elements import PackedEye
from isetcl.device.elements import declarations as ray_declarations
from isetcl.device.layout import Member, Precision, Struct, c_enum, real_dtype
from isetcl.eye.exit_pupil import ExitPupilBound
from isetcl.eye.exit_pupil_plane import PlanePupilBound
from isetcl.eye.field_plane import FieldPlane
from isetcl.eye.model import Eye
from isetcl.eye.polynomial import MAX_TERMS
from isetcl.eye.prescription import Element
from isetcl.eye.retina_form import relief, retina_element
from isetcl.render.kernel_config import KernelConfig, MaterialKind
from isetcl.render.sobol import directions
from isetcl.retina.grid import RetinalGrid
from isetcl.retina.places import PlaceGrid
from isetcl.scene.basis import SpectralBasis
from isetcl.scene.mesh import Instance, Mesh
from isetcl.scene.model import Disc, Quad, Scene, Sphere
from isetcl.scene.texture import Checkerboard, Image
from isetcl.scene.view import plane_axes

CAMERA = Struct(
    "camera_t",
    (
        Member("tile_x", "int"),
        Member("tile_y", "int"),
        Member("tile_width", "int"),
        Member("image_width", "int"),
        Member("n_chord", "int"),
        Member("n_depth", "int"),
        Member("left"),
        Member("top"),
        Member("step_x"),
        Member("step_y"),
        Member("retina_z"),
        Member("curvature"),
        Member("kappa"),
        Member("plane", "int"),
        Member("degree", "int"),
        Member("retina", "int"),
        Member("places", "int"),
        Member("chord", length=MAX_TERMS),
        Member("depth", length=MAX_TERMS),
    ),
)

PUPIL = Struct(
    "pupil_t",
    (
        Member("n_semi", "int"),
        Member("n_stretch", "int"),
        Member("n_centre", "int"),
        Member("plane", "int"),
        Member("degree", "int"),
        Member("z"),
        Member("index"),
        Member("pi_index_ratio2"),
        Member("inverse_object_index"),
        Member("semi", length=MAX_TERMS),
        Member("stretch", length=MAX_TERMS),
        Member("centre", length=MAX_TERMS),
    ),
)

PATCH = Struct(
    "patch_t",
    (
        Member("material", "int"),
        Member("is_round", "int"),
        Member("normal", length=3),
        Member("offset"),
        Member("axis_u", length=3),
        Member("offset_u"),
        Member("axis_v", length=3),
        Member("offset_v"),
    ),
)

SPHERE = Struct(
    "sphere_t", (Member("material", "int"), Member("centre", length=3), Member("radius2"))
)


def scene_struct(n_basis: int) -> Struct:
    """Counts of shapes and the colour of the background."""
    return Struct(
        "scene_t",
        (
            Member("n_patches", "int"),
            Member("n_spheres", "int"),
            Member("n_images", "int"),
            Member("n_materials", "int"),
            Member("background", length=max(2, n_basis)),
        ),
    )


def material_struct(n_basis: int) -> Struct:
    """A material: its kind and its one or two colours."""
    return Struct(
        "material_t",
        (
            Member("kind", "int"),
            Member("image", "int"),
            Member("periods_u"),
            Member("periods_v"),
            Member("first", length=max(2, n_basis)),
            Member("second", length=max(2, n_basis)),
        ),
    )


def image_struct(n_basis: int, channels: int) -> Struct:
    """A texture: where its texels are and the colour of each channel."""
    return Struct(
        "image_t",
        (
            Member("first", "int"),
            Member("stride", "int"),
            Member("width"),
            Member("height"),
            Member("colour", length=max(2, n_basis * channels)),
        ),
    )


def sobol_declaration() -> str:
    """The table of direction numbers, by dimension and, for four dimensions at once, by bit."""
    words = np.asarray(directions()).reshape(-1, 32)
    table = ", ".join(f"0x{word:08x}u" for word in words.ravel())
    rows = ", ".join(
        "(uint4)(" + ", ".join(f"0x{word:08x}u" for word in words[:4, bit]) + ")"
        for bit in range(32)
    )
    return (
        f"constant uint SOBOL_DIRECTIONS[] = {{{table}}};\n"
        f"constant uint4 SOBOL_DIRECTIONS_BY_BIT[] = {{{rows}}};\n"
    )


def eye_declarations() -> str:
    """The C declarations of the camera."""
    return CAMERA.c_declaration() + PUPIL.c_declaration() + bend_declarations()


def declarations(config: KernelConfig) -> str:
    """All C declarations of the direct pipeline."""
    structs = (
        PATCH,
        SPHERE,
        scene_struct(config.n_basis),
        material_struct(config.n_basis),
        image_struct(config.n_basis, config.texture_channels),
    )
    return (
        ray_declarations()
        + c_enum(MaterialKind, "MATERIAL")
        + eye_declarations()
        + sobol_declaration()
        + "".join(struct.c_declaration() for struct in structs)
    )


def pack_camera(grid: RetinalGrid, precision: Precision) -> np.ndarray:
    """The retina and its grid; the tile is filled in for every launch."""
    record = np.zeros(1, dtype=CAMERA.dtype(precision))
    if isinstance(grid.field_map, FieldPlane):
        record["image_width"] = grid.resolution[0]
        record["left"], record["step_x"] = -1.0, 2.0 / grid.resolution[0]
        record["top"], record["step_y"] = 1.0, -2.0 / grid.resolution[1]
        return record
    chord, depth = grid.polynomials()
    limit = grid.limit_deg
    record["image_width"] = grid.resolution[0]
    record["left"] = grid.left_deg / limit
    record["top"] = grid.top_deg / limit
    record["step_x"] = grid.pitch_deg[0] / limit
    record["step_y"] = -grid.pitch_deg[1] / limit
    record["retina_z"] = grid.eye.retina.vertex_z_mm
    record["curvature"] = grid.eye.retina.curvature
    record["kappa"] = 1.0 + grid.eye.retina.conic
    _fill(record, "chord", chord)
    _fill(record, "depth", depth)
    return record


def pack_pupils(
    bounds: tuple[ExitPupilBound | PlanePupilBound, ...],
    indices: np.ndarray,
    precision: Precision,
) -> np.ndarray:
    """Exit-pupil ellipses; `indices` are (object, vitreous) indices of each band, (bands, 2)."""
    records = np.zeros(len(bounds), dtype=PUPIL.dtype(precision))
    for i, (bound, (n_object, n_vitreous)) in enumerate(zip(bounds, indices, strict=True)):
        record = records[i : i + 1]
        record["z"] = bound.z_mm
        record["index"] = n_vitreous
        record["pi_index_ratio2"] = np.pi * (n_vitreous / n_object) ** 2
        record["inverse_object_index"] = 1.0 / n_object
        if isinstance(bound, PlanePupilBound):
            continue
        _fill(record, "semi", bound.semi)
        _fill(record, "stretch", bound.stretch)
        _fill(record, "centre", bound.centre)
    return records


def relief_sequence(eye: Eye) -> list[tuple[Element, ...]]:
    """The retina as an element of its own, where the kernels have to know its relief."""
    return [] if relief(eye.retina) is None else [(retina_element(eye.retina),)]


def pack_planes(
    grid: RetinalGrid,
    bounds: tuple[ExitPupilBound | PlanePupilBound, ...],
    camera: np.ndarray,
    pupils: np.ndarray,
    packed: PackedEye,
) -> np.ndarray:
    """The table of an eye, and behind it the polynomials of its retina and pupils, if it has any,
    and the places of a list of them.

    Where they begin is filled into the records of camera and pupils. The last element is the retina
    if it has a relief.
    """
    functions = [bound.ellipse for bound in bounds if isinstance(bound, PlanePupilBound)]
    eye_table = packed.table
    if not functions:
        return _with_places(grid, camera, eye_table)
    camera["retina"] = len(packed.elements) - 1
    used = len(eye_table)
    parts = [eye_table]
    records = [camera[0], *pupils]
    for record, function in zip(records, [grid.plane_polynomial(), *functions], strict=True):
        numbers = function.powers().ravel().astype(eye_table.dtype)
        record["plane"], record["degree"] = used, function.degree
        parts.append(numbers)
        used += len(numbers)
    return _with_places(grid, camera, np.concatenate(parts))


def _with_places(grid: RetinalGrid, camera: np.ndarray, table: np.ndarray) -> np.ndarray:
    """The table with the places of a `PlaceGrid` at its end, in the field angles of the camera."""
    if not isinstance(grid, PlaceGrid):
        return table
    is_plane = isinstance(grid.field_map, FieldPlane)
    half = (grid.fov_deg[0] / 2.0, grid.fov_deg[1] / 2.0)
    scale = half if is_plane else (grid.limit_deg, grid.limit_deg)
    middle = grid.centre_deg if is_plane else (0.0, 0.0)
    camera["places"] = len(table)
    return np.concatenate([table, grid.table(scale, middle).ravel().astype(table.dtype)])


def _fill(record: np.ndarray, name: str, coefficients: np.ndarray) -> None:
    record[name][0, : len(coefficients)] = coefficients
    record[f"n_{name}"] = len(coefficients)


def pack_scene(
    scene: Scene,
    basis: SpectralBasis,
    images: tuple[Image | None, ...],
    config: KernelConfig,
) -> dict[str, np.ndarray]:
    """The arrays scene, patches, spheres, materials, images and texels.

    Parameters
    ----------
    images
        For every object the picture to upload (at the resolution the plan chose), or None.
    """
    precision = config.precision
    n = config.n_basis
    patches: list[np.ndarray] = []
    spheres: list[np.ndarray] = []
    materials = np.zeros(len(scene.objects), dtype=material_struct(n).dtype(precision))
    uploaded = [image for image in images if image is not None]
    records = np.zeros(
        len(uploaded), dtype=image_struct(n, config.texture_channels).dtype(precision)
    )
    texels: list[np.ndarray] = []
    used = 0
    for i, item in enumerate(scene.objects):
        colours = basis.objects[i]
        texture = item.material.texture
        image = images[i]
        materials[i]["image"] = -1
        if image is not None:
            slot = len(texels)
            materials[i]["kind"] = MaterialKind.IMAGE
            materials[i]["image"] = slot
            words, scale = pack_texels(image, config)
            rows, columns = image.shape
            records[slot]["first"] = used
            records[slot]["stride"] = columns + 2
            records[slot]["width"] = columns
            records[slot]["height"] = rows
            channel_colours = np.zeros((config.texture_channels, n))
            if image.channels == config.texture_channels:
                channel_colours[:] = colours * scale
            else:
                # A grey picture among coloured ones is stored in the first channel.
                channel_colours[0] = colours[0] * scale
            records[slot]["colour"][: channel_colours.size] = channel_colours.ravel()
            texels.append(words)
            used += words.size // (1 if config.is_texture_packed else config.texture_channels)
        elif isinstance(texture, Checkerboard):
            materials[i]["kind"] = MaterialKind.CHECKERBOARD
            materials[i]["periods_u"] = 2.0 * texture.periods_u
            materials[i]["periods_v"] = 2.0 * texture.periods_v
            materials[i]["first"][:n] = colours[0] * texture.bright
            materials[i]["second"][:n] = colours[0] * texture.dark
        else:
            materials[i]["kind"] = MaterialKind.UNIFORM
            materials[i]["first"][:n] = colours[0]
        assert not isinstance(item.shape, (Mesh, Instance))
        if isinstance(item.shape, Sphere):
            spheres.append(_sphere(item.shape, i, precision))
        else:
            patches.append(_patch(item.shape, i, precision))
    head = np.zeros(1, dtype=scene_struct(n).dtype(precision))
    head["n_patches"], head["n_spheres"] = len(patches), len(spheres)
    head["n_images"], head["n_materials"] = len(uploaded), len(materials)
    head["background"][0, :n] = basis.background
    return {
        "scene": head,
        "patches": _stack(patches, PATCH, precision),
        "spheres": _stack(spheres, SPHERE, precision),
        "materials": materials if len(materials) else np.zeros(1, dtype=materials.dtype),
        "images": records if len(records) else np.zeros(1, dtype=records.dtype),
        "texels": np.concatenate(texels) if texels else np.zeros(8, dtype=np.uint32),
    }


def _stack(records: list[np.ndarray], struct: Struct, precision: Precision) -> np.ndarray:
    return np.concatenate(records) if records else np.zeros(1, dtype=struct.dtype(precision))


def _patch(shape: Quad | Disc, material: int, precision: Precision) -> np.ndarray:
    """Plane equations relative to the corneal vertex, made in float64."""
    record = np.zeros(1, dtype=PATCH.dtype(precision))
    quad = shape.bounding_quad() if isinstance(shape, Disc) else shape
    normal, axis_u, axis_v = plane_axes(quad)
    corner = np.array(quad.corner_m)
    record["material"] = material
    record["is_round"] = isinstance(shape, Disc)
    record["normal"], record["offset"] = normal, normal @ corner
    record["axis_u"], record["offset_u"] = axis_u, -axis_u @ corner
    record["axis_v"], record["offset_v"] = axis_v, -axis_v @ corner
    return record


def _sphere(shape: Sphere, material: int, precision: Precision) -> np.ndarray:
    record = np.zeros(1, dtype=SPHERE.dtype(precision))
    record["material"] = material
    record["centre"] = shape.centre_m
    record["radius2"] = shape.radius_m**2
    return record


def pack_texels(image: Image, config: KernelConfig) -> tuple[np.ndarray, float]:
    """Words of an image with a border of one repeated texel, and the scale its weights were given.

    Packed words hold 11, 11 and 10 bits of weights divided by their maximum; otherwise every
    channel is a float.
    """
    rows, columns = image.shape
    texels = image.texels.reshape(rows, columns, image.channels)
    if image.channels < config.texture_channels:
        texels = np.concatenate(
            [
                texels,
                np.zeros((rows, columns, config.texture_channels - image.channels), np.float32),
            ],
            axis=2,
        )
    padded = np.pad(texels, ((1, 1), (1, 1), (0, 0)), mode="edge")
    if not config.is_texture_packed:
        return np.ascontiguousarray(padded, dtype=np.float32).view(np.uint32).ravel(), 1.0
    scale = float(padded.max()) or 1.0
    steps = np.array([2047.0, 2047.0, 1023.0])
    codes = np.rint(padded.astype(np.float64) / scale * steps).astype(np.uint32)
    words = codes[..., 0] | (codes[..., 1] << np.uint32(11)) | (codes[..., 2] << np.uint32(22))
    return words.ravel(), scale


def real(precision: Precision, value: float) -> np.generic:
    """A scalar kernel argument of type `real`."""
    scalar: np.generic = real_dtype(precision).type(value)
    return scalar

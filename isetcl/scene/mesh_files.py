"""Scenes from the files of 3-D programs: GLB, glTF, OBJ, PLY, STL, OFF and what trimesh reads."""

from __future__ import annotations

import dataclasses
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from isetcl.errors import (
    FileError,
    InvalidInputError,
    IsetclError,
    OutOfMemoryError,
    check_positive,
    check_type,
)
from isetcl.memory import check_memory
from isetcl.scene.assets import Assets, read_bytes
from isetcl.scene.gltf import load_gltf
from isetcl.scene.light import DistantLight, Light
from isetcl.scene.mesh import Mesh
from isetcl.scene.model import Scene
from isetcl.scene.obj import (
    libraries,
    read_mtl,
    surface_of,
    used_materials,
    with_positive_indices,
)
from isetcl.scene.part import Part, assemble
from isetcl.scene.surface import Paint, Placement, Surface, plain
from isetcl.scene.texture import decode_srgb
from isetcl.scene.vertex_colour import baked

_TEXT_GROWTH = 12.0
"""How much memory reading a mesh takes, at most, times the size of its file."""


def load_mesh_scene(
    path: str | Path,
    *,
    allow_outside: bool = False,
    scale: float = 1.0,
    luminance_of_white_cd_m2: float = 100.0,
) -> Scene:
    """A scene from a file of a 3-D program: named objects, where the file places them.

    GLB and glTF 2.0 come with materials, textures, emission, cut-outs, vertex colours, instances
    and the lights of KHR_lights_punctual; OBJ with the materials of its MTL files. Other formats
    that trimesh reads (PLY, STL, OFF, 3MF, DAE, ...) come with vertex colours where they have them,
    and are matt grey, of reflectance 0.5, where nothing is stated. Colours become spectra on load.

    A file without lights gives a scene without: add a background, lights or a surface that shines.
    Surfaces are seen from both sides, whatever the file says.

    Parameters
    ----------
    path
        The file.
    allow_outside
        Whether textures and other files may lie outside the folder of the file.
    scale
        Metres per unit of the file.
    luminance_of_white_cd_m2
        Luminance of a surface that emits (1, 1, 1). 1 is what glTF says.

    Raises
    ------
    FileError
        If the file cannot be read, holds no triangles, or files that it names are missing or lie
        outside its folder.
    OutOfMemoryError
        If it does not fit into memory.

    Warns
    -----
    UserWarning
        One for each kind of thing that the file asks for and isetcl leaves out.
    """
    check_type("path", path, (str, Path))
    check_type("allow_outside", allow_outside, bool)
    factor = check_positive("scale", scale)
    white = check_positive("luminance_of_white_cd_m2", luminance_of_white_cd_m2, "cd/m^2")
    file = Path(path)
    _check_file(file)
    assets = Assets(file, allow_outside)
    try:
        kind = file.suffix.lower()
        if kind in (".glb", ".gltf"):
            parts, lights = load_gltf(file, assets, white)
        elif kind == ".obj":
            parts, lights = _load_obj(file, assets, white), []
        else:
            parts, lights = _load_other(file, assets), []
        objects = assemble(parts, factor, assets)
    except InvalidInputError as error:
        raise FileError(f"mesh file {str(file)!r}: {error}") from error
    except MemoryError as error:
        if isinstance(error, OutOfMemoryError):
            raise
        raise OutOfMemoryError(
            f"mesh file {str(file)!r} does not fit into memory; use a smaller mesh"
        ) from error
    assets.finish()
    if not objects:
        raise FileError(f"mesh file {str(file)!r} holds no triangles; export its meshes, too")
    moved = tuple(_scaled(light, factor) for light in lights)
    return Scene(objects, name=file.stem, lights=moved)


def _check_file(file: Path) -> None:
    try:
        is_there, size = file.is_file(), file.stat().st_size if file.is_file() else 0
    except (OSError, ValueError) as error:
        raise FileError(f"mesh file {str(file)!r} cannot be read ({error})") from error
    if not is_there:
        raise FileError(f"mesh file {str(file)!r} does not exist")
    if size == 0:
        raise FileError(f"mesh file {str(file)!r} is empty; export it again")
    growth = 2.0 if file.suffix.lower() == ".glb" else _TEXT_GROWTH
    check_memory(
        f"reading mesh file {str(file)!r}",
        growth * size,
        lambda _: "split it, or simplify its meshes",
    )


def _scaled(light: Light, scale: float) -> Light:
    if isinstance(light, DistantLight):
        return light
    x, y, z = light.position_m
    return dataclasses.replace(light, position_m=(scale * x, scale * y, scale * z))


class _Restricted:
    """What trimesh asks for files, so that it gets those of the folder only."""

    def __init__(self, assets: Assets, special: dict[str, bytes] | None = None) -> None:
        self._assets = assets
        self._special = special or {}
        self.file_name = assets.file.name

    def get(self, name: str) -> bytes:
        if name in self._special:
            return self._special[name]
        path = self._assets.find(name)
        if path is None:
            raise FileNotFoundError(name)
        return read_bytes(path)

    def __getitem__(self, name: str) -> bytes:
        return self.get(name)

    def __contains__(self, name: str) -> bool:
        return name in self._special or self._assets.find(name) is not None

    def keys(self) -> list[str]:
        return list(self._special)

    def namespaced(self, _: str) -> _Restricted:
        return self

    def write(self, name: str, _: bytes) -> None:
        raise OSError(f"{name} is not written")


def _trimesh_scene(data: bytes, kind: str, assets: Assets, resolver: Any, **options: Any) -> Any:
    """A trimesh scene from the bytes of a file."""
    import trimesh

    known = set(trimesh.available_formats())
    if kind not in known:
        raise FileError(
            f"mesh file {str(assets.file)!r} is of no kind that is read here ({kind or 'none'}); "
            "use GLB, OBJ, PLY, STL or OFF"
        )
    try:
        with np.errstate(all="ignore"):
            return trimesh.load(
                io.BytesIO(data),
                file_type=kind,
                force="scene",
                process=False,
                resolver=resolver,
                **options,
            )
    except (IsetclError, MemoryError):
        raise
    except Exception as error:
        # Readers raise what they like; whatever it is, the file is no mesh.
        raise FileError(
            f"mesh file {str(assets.file)!r} cannot be read "
            f"({type(error).__name__}: {str(error)[:200]}); export it again, as GLB if you can"
        ) from error


def _load_other(file: Path, assets: Assets) -> list[Part]:
    """Parts of a file that trimesh reads, matt, with the vertex colours and pictures it has."""
    kind = file.suffix.lower().lstrip(".")
    scene = _trimesh_scene(read_bytes(file), kind, assets, _Restricted(assets))
    unit = getattr(scene, "units", None)
    if isinstance(unit, str) and unit not in ("meters", "meter", "m"):
        assets.note("is taken to be in metres; pass scale= for its own unit", unit)
    return _parts(scene, assets, _look_of)


def _load_obj(file: Path, assets: Assets, luminance: float) -> list[Part]:
    """Parts of an OBJ file, one for each object and material."""
    text = read_bytes(file).decode("utf-8", errors="replace").replace("\r\n", "\n")
    text = with_positive_indices(text)
    materials: dict[str, Any] = {}
    for name in libraries(text):
        # Several names may stand on a line; a name may hold blanks.
        names = [name] if (file.parent / name).is_file() else name.split()
        for one in names if all(Path(n).suffix for n in names) else [name]:
            materials |= read_mtl(one, assets)
    unknown = [name for name in used_materials(text) if name not in materials]
    for name in unknown if materials else ():
        assets.note("materials that no MTL file holds are matt grey", name)
    # trimesh gets the names of the materials only, to tell which faces have which.
    stand_in = "".join(f"newmtl {name}\nKd 1 1 1\n" for name in used_materials(text))
    lines = [line for line in text.split("\n") if not line.lstrip().startswith("mtllib")]
    data = "\n".join(["mtllib isetcl.mtl", *lines]).encode()
    resolver = _Restricted(assets, {"isetcl.mtl": stand_in.encode()})
    scene = _trimesh_scene(data, "obj", assets, resolver, split_objects=True)
    surfaces: dict[str, Surface] = {}

    def look(geometry: Any, mesh: Mesh) -> tuple[Mesh, Surface]:
        name = getattr(getattr(geometry.visual, "material", None), "name", None)
        if name not in materials:
            return _look_of(geometry, mesh)
        if name not in surfaces:
            surfaces[name] = surface_of(materials[name], assets, luminance)
        return mesh, surfaces[name]

    return _parts(scene, assets, look)


def _parts(
    scene: Any, assets: Assets, look: Callable[[Any, Mesh], tuple[Mesh, Surface]]
) -> list[Part]:
    """Parts of a trimesh scene; a geometry that stands in many places keeps one mesh."""
    made: dict[str, tuple[Mesh, Surface] | None] = {}
    parts = []
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        geometry = scene.geometry[name]
        if name not in made:
            faces = getattr(geometry, "faces", None)
            if faces is None or len(faces) == 0:
                assets.note("points and lines are left out", str(name))
                made[name] = None
            else:
                made[name] = look(geometry, _mesh_of(geometry))
        entry = made[name]
        if entry is not None:
            label = str(node) if len(scene.graph.geometry_nodes[name]) > 1 else str(name)
            parts.append(Part(label, entry[0], np.array(matrix, dtype=np.float64), entry[1]))
    return parts


def _mesh_of(geometry: Any) -> Mesh:
    """A trimesh mesh as ours, with the normals of the file, if it has any."""
    vertices = np.asarray(geometry.vertices)
    normals = None
    # trimesh computes normals on demand; those of the file are in its cache from the start.
    if "vertex_normals" in getattr(geometry, "_cache", {}):
        normals = np.asarray(geometry.vertex_normals)
    uv = getattr(geometry.visual, "uv", None)
    has_uv = uv is not None and np.shape(uv) == (len(vertices), 2) and np.isfinite(uv).all()
    return Mesh(vertices, np.asarray(geometry.faces), normals, np.asarray(uv) if has_uv else None)


def _look_of(geometry: Any, mesh: Mesh) -> tuple[Mesh, Surface]:
    """A mesh and its look without a material: vertex or face colours, a picture, or grey.

    Colours of these formats are sRGB codes.
    """
    visual = geometry.visual
    kind = getattr(visual, "kind", None)
    if kind in ("vertex", "face"):
        codes = np.asarray(visual.vertex_colors if kind == "vertex" else visual.face_colors)
        colours = decode_srgb(codes[:, :3] / 255.0)
        first = colours[0]
        if np.all(colours == first):
            return mesh, plain(Paint((float(first[0]), float(first[1]), float(first[2]))))
        corners = np.repeat(colours[:, None], 3, axis=1) if kind == "face" else colours
        own, texels = baked(mesh, corners)
        return own, plain(Paint(picture=texels, placement=Placement("clamp")))
    material = getattr(visual, "material", None)
    image = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
    if image is not None and mesh.uv is not None:
        codes = np.asarray(image.convert("RGB"), dtype=np.float64) / 255.0
        return mesh, plain(Paint(picture=decode_srgb(codes).astype(np.float32)))
    stated = getattr(material, "diffuse", None)
    if stated is None:
        stated = getattr(material, "baseColorFactor", None)
    if kind == "texture" and stated is not None and not _is_default(material):
        red, green, blue = (decode_srgb(np.asarray(stated)[:3] / 255.0)).tolist()
        return mesh, plain(Paint((red, green, blue)))
    return mesh, plain()


def _is_default(material: Any) -> bool:
    """Whether trimesh made the material up."""
    name = str(getattr(material, "name", "") or "")
    return name in ("", "material_0") and getattr(material, "image", None) is None

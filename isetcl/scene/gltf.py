"""glTF 2.0 and GLB: meshes where the nodes place them, with their materials and lights.

trimesh reads these files too, but neither sparse nor normalised accessors, and not what stands on
the nodes. Source of every rule here: Khronos Group, glTF 2.0 specification.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from isetcl.errors import FileError, IsetclError
from isetcl.memory import check_memory
from isetcl.scene.assets import Assets, Picture, read_bytes
from isetcl.scene.gltf_material import KNOWN_OF_MATERIALS, Looks
from isetcl.scene.light import Light
from isetcl.scene.mesh import Mesh
from isetcl.scene.part import Part, quaternion_matrix
from isetcl.scene.vertex_colour import baked

Json = dict[str, Any]

_DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_MAGIC, _JSON_CHUNK, _BINARY_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_KNOWN = {
    *KNOWN_OF_MATERIALS,
    "EXT_mesh_gpu_instancing",
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
}


def load_gltf(
    file: Path, assets: Assets, luminance_of_white_cd_m2: float
) -> tuple[list[Part], list[Light]]:
    """Parts and lights of a glTF or GLB file.

    Raises
    ------
    FileError
        If the file is damaged, or needs an extension that isetcl lacks.
    """
    try:
        document = Document(file, read_bytes(file), assets)
        document.check_extensions()
        looks = Looks(document, assets, luminance_of_white_cd_m2)
        parts, lights = [], []
        for name, node, matrix in document.nodes():
            parts += list(document.parts(name, node, matrix, looks))
            lights += looks.lights(node, matrix)
        document.note_the_rest()
    except (IsetclError, MemoryError):
        raise
    except Exception as error:
        # A damaged file breaks any rule; whatever it is, it is no glTF.
        raise FileError(
            f"mesh file {str(file)!r} is no valid glTF 2.0 "
            f"({type(error).__name__}: {str(error)[:200]}); export it again"
        ) from error
    return parts, lights


class Document:
    """A glTF file: its JSON, and the numbers and pictures that it refers to."""

    def __init__(self, file: Path, data: bytes, assets: Assets) -> None:
        self.file = file
        self.assets = assets
        self._binary: bytes | None = None
        self.json: Json = self._read(data)
        self._buffers: dict[int, bytes] = {}
        self._meshes: dict[int, list[tuple[Mesh, np.ndarray | None, int | None]]] = {}
        version = str(self.json.get("asset", {}).get("version", "2.0"))
        if not version.startswith("2"):
            raise self.wrong(f"has version {version}", "export it as glTF 2.0")

    def wrong(self, what: str, remedy: str) -> FileError:
        """An error that names the file."""
        return FileError(f"mesh file {str(self.file)!r} {what}; {remedy}")

    def _read(self, data: bytes) -> Json:
        """The JSON of the file; the binary part of a GLB is kept."""
        if data[:4] != b"glTF":
            found = json.loads(data.decode("utf-8-sig"))
        else:
            header = np.frombuffer(data[:12], "<u4")
            if len(header) < 3 or header[1] != 2:
                raise self.wrong("is no GLB of version 2", "export it as glTF 2.0")
            if int(header[2]) > len(data):
                raise self.wrong(
                    f"is truncated: {len(data)} of {int(header[2])} bytes", "copy it again"
                )
            chunks = dict(self._chunks(data, int(header[2])))
            if _JSON_CHUNK not in chunks:
                raise self.wrong("holds no JSON", "export it again")
            found = json.loads(chunks[_JSON_CHUNK].decode("utf-8"))
            self._binary = chunks.get(_BINARY_CHUNK)
        if not isinstance(found, dict):
            raise self.wrong("is no glTF: its JSON is no object", "export it again")
        return found

    def _chunks(self, data: bytes, end: int) -> Iterator[tuple[int, bytes]]:
        start = 12
        while start + 8 <= end:
            length, kind = (int(x) for x in np.frombuffer(data[start : start + 8], "<u4"))
            if start + 8 + length > end:
                raise self.wrong("is truncated: a chunk is cut off", "copy it again")
            yield kind, data[start + 8 : start + 8 + length]
            start += 8 + length

    def check_extensions(self) -> None:
        """Refuse what the file cannot be read without, and note what is left out."""
        required = [e for e in self.json.get("extensionsRequired", []) if e not in _KNOWN]
        if required:
            raise self.wrong(
                f"needs {', '.join(map(str, required))}, which isetcl cannot read",
                "export it without compression, and its textures as PNG or JPEG",
            )
        for extension in self.json.get("extensionsUsed", []):
            if extension not in _KNOWN:
                self.assets.note("extensions are left out", str(extension))

    def note_the_rest(self) -> None:
        """Note what isetcl has nothing for."""
        if self.json.get("cameras"):
            self.assets.note("cameras are left out; the eye at the origin looks along -z", "")
        if self.json.get("animations"):
            self.assets.note("animations are left out; all is where it is at rest", "")
        if self.json.get("skins"):
            self.assets.note("skins are left out; meshes are in their pose of rest", "")

    # -- numbers ----------------------------------------------------------------------------------

    def _buffer(self, index: int) -> bytes:
        if index not in self._buffers:
            buffer = self.item("buffers", index)
            uri = buffer.get("uri")
            data = self._binary if uri is None else self.assets.data(_name(uri))
            if data is None:
                # A missing file is reported with the missing textures, at once.
                if uri is None:
                    raise self.wrong("refers to a binary part that it lacks", "export it again")
                self.assets.finish()
                raise self.wrong("lacks a buffer", "export it again")
            if len(data) < buffer["byteLength"]:
                raise self.wrong(
                    f"is truncated: buffer {index} has {len(data)} of {buffer['byteLength']} bytes",
                    "copy it again",
                )
            self._buffers[index] = data
        return self._buffers[index]

    def item(self, kind: str, index: object) -> Json:
        """Entry `index` of a list of the file."""
        items = self.json.get(kind, [])
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(items):
            raise self.wrong(f"refers to {kind}[{index}] of {len(items)}", "export it again")
        return dict(items[index])

    def view(self, index: int) -> bytes:
        """Bytes of a buffer view."""
        view = self.item("bufferViews", index)
        start, length = int(view.get("byteOffset", 0)), int(view["byteLength"])
        data = self._buffer(view["buffer"])
        if start < 0 or length < 0 or start + length > len(data):
            raise self.wrong(f"has a buffer view {index} beyond its buffer", "export it again")
        return data[start : start + length]

    def numbers(self, index: int) -> np.ndarray:
        """An accessor as float64 (integers that are normalised become -1 to 1), (n, width)."""
        accessor = self.item("accessors", index)
        count, width = int(accessor["count"]), _WIDTHS[accessor["type"]]
        dtype = np.dtype(_DTYPES[accessor["componentType"]])
        if count < 0:
            raise self.wrong(f"has an accessor {index} of {count} entries", "export it again")
        check_memory(
            f"mesh file {str(self.file)!r}", 32.0 * count * width, lambda _: "use a smaller mesh"
        )
        values = self._strided(accessor, count, width, dtype)
        sparse = accessor.get("sparse")
        if sparse is not None:
            few, at = int(sparse["count"]), sparse["indices"]
            kind = np.dtype(_DTYPES[at["componentType"]])
            where = self._strided(at, few, 1, kind)[:, 0]
            values = values.copy()
            values[where] = self._strided(sparse["values"], few, width, dtype)
        if accessor.get("normalized", False) and dtype.kind in "iu":
            return np.maximum(values / float(np.iinfo(dtype).max), -1.0)
        return values.astype(np.float64)

    def _strided(self, where: Json, count: int, width: int, dtype: np.dtype[Any]) -> np.ndarray:
        """Rows of a buffer view; zeros where there is none."""
        if "bufferView" not in where:
            return np.zeros((count, width), dtype)
        data = self.view(where["bufferView"])
        start = int(where.get("byteOffset", 0))
        row = width * dtype.itemsize
        stride = int(self.item("bufferViews", where["bufferView"]).get("byteStride", row))
        if stride < row or start < 0 or (count and start + (count - 1) * stride + row > len(data)):
            raise self.wrong("has an accessor beyond its buffer view", "export it again")
        if count == 0:
            return np.zeros((0, width), dtype)
        raw = np.frombuffer(data, np.uint8)[start : start + (count - 1) * stride + row]
        rows = np.lib.stride_tricks.as_strided(raw, (count, row), (stride, 1))
        return np.ascontiguousarray(rows).view(dtype)

    # -- pictures ---------------------------------------------------------------------------------

    def picture(self, index: int) -> Picture | None:
        """The picture of a texture; None if its file is missing."""
        texture = self.item("textures", index)
        webp = texture.get("extensions", {}).get("EXT_texture_webp", {})
        source = webp.get("source", texture.get("source"))
        if source is None:
            self.assets.missing.append(f"texture {index} in a format other than PNG, JPEG or WebP")
            return None
        image = self.item("images", source)
        if "uri" in image:
            uri = str(image["uri"])
            data = self.assets.data(uri) if uri.startswith("data:") else None
            return self.assets.picture(_name(uri), data)
        name = f"image {source}"
        return self.assets.picture(name, self.view(image["bufferView"]))

    # -- geometry ---------------------------------------------------------------------------------

    def nodes(self) -> Iterator[tuple[str, Json, np.ndarray]]:
        """Nodes of the scene, with their names and maps to the world."""
        if "scenes" in self.json:
            roots = self.item("scenes", self.json.get("scene", 0)).get("nodes", [])
        else:
            children = {c for n in self.json.get("nodes", []) for c in n.get("children", [])}
            roots = [i for i in range(len(self.json.get("nodes", []))) if i not in children]
        waiting = [(index, np.eye(4)) for index in reversed(roots)]
        seen = set()
        while waiting:
            index, outer = waiting.pop()
            if index in seen:
                raise self.wrong(f"has node {index} in two places", "its nodes must form a tree")
            seen.add(index)
            node = self.item("nodes", index)
            matrix = outer @ _local(node)
            yield str(node.get("name", f"node {index}")), node, matrix
            waiting += [(child, matrix) for child in reversed(node.get("children", []))]

    def parts(self, name: str, node: Json, matrix: np.ndarray, looks: Looks) -> Iterator[Part]:
        """What stands at a node."""
        if "mesh" not in node:
            return
        primitives = self._primitives(node["mesh"])
        places = self._places(node)
        for i, (mesh, colours, material) in enumerate(primitives):
            surface, takes_colours = looks.surface(material)
            if colours is not None and not takes_colours:
                self.assets.note("colours of vertices under pictures are left out", name)
            elif colours is not None:
                key = (node["mesh"], i)
                if key not in looks.coloured:
                    own_mesh, texels = baked(mesh, colours)
                    looks.coloured[key] = (looks.with_picture(material, texels), own_mesh)
                surface, mesh = looks.coloured[key]
            own = name if len(primitives) == 1 else f"{name} {i}"
            for place in places:
                yield Part(own, mesh, matrix @ place, surface)

    def _places(self, node: Json) -> list[np.ndarray]:
        """Maps of the copies of a mesh at a node: one, or those of EXT_mesh_gpu_instancing."""
        instancing = node.get("extensions", {}).get("EXT_mesh_gpu_instancing")
        if instancing is None:
            return [np.eye(4)]
        found = {k: self.numbers(v) for k, v in instancing["attributes"].items() if k[0] != "_"}
        count = max((len(v) for v in found.values()), default=0)
        moves = found.get("TRANSLATION", np.zeros((count, 3)))
        turns = found.get("ROTATION", np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)))
        sizes = found.get("SCALE", np.ones((count, 3)))
        return [
            _composed(move, turn, size)
            for move, turn, size in zip(moves, turns, sizes, strict=True)
        ]

    def _primitives(self, index: int) -> list[tuple[Mesh, np.ndarray | None, int | None]]:
        """Meshes of a mesh entry, with vertex colours and the number of the material."""
        if index not in self._meshes:
            entry = self.item("meshes", index)
            found = []
            if any("targets" in primitive for primitive in entry["primitives"]):
                self.assets.note("morph targets are left out", str(entry.get("name", index)))
            for primitive in entry["primitives"]:
                if primitive.get("mode", _TRIANGLES) not in (_TRIANGLES, _STRIP, _FAN):
                    name = str(entry.get("name", f"mesh {index}"))
                    self.assets.note("points and lines are left out", name)
                    continue
                made = self._primitive(primitive)
                if made is not None:
                    found.append((*made, primitive.get("material")))
            self._meshes[index] = found
        return self._meshes[index]

    def _primitive(self, primitive: Json) -> tuple[Mesh, np.ndarray | None] | None:
        attributes = primitive["attributes"]
        if "POSITION" not in attributes:
            return None
        vertices = self.numbers(attributes["POSITION"])
        if "indices" in primitive:
            corners = self.numbers(primitive["indices"]).reshape(-1).astype(np.int64)
        else:
            corners = np.arange(len(vertices))
        faces = _faces(corners, primitive.get("mode", _TRIANGLES))
        if len(faces) == 0:
            return None
        normals = self.numbers(attributes["NORMAL"]) if "NORMAL" in attributes else None
        uv = None
        if "TEXCOORD_0" in attributes:
            # v of glTF runs down from the top of the picture.
            uv = self.numbers(attributes["TEXCOORD_0"]) * [1.0, -1.0] + [0.0, 1.0]
        colours = None
        if "COLOR_0" in attributes:
            colours = np.clip(self.numbers(attributes["COLOR_0"])[:, :3], 0.0, 1.0)
            if len(colours) != len(vertices) or np.all(colours == 1.0):
                colours = None
        return Mesh(vertices, faces, normals, uv), colours


def _faces(corners: np.ndarray, mode: int) -> np.ndarray:
    """Triangles (m, 3) of a list, strip or fan; those of a strip that have no area are left out."""
    if mode == _TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    if len(corners) < 3:
        return np.zeros((0, 3), np.int64)
    second, third = corners[1:-1], corners[2:]
    if mode == _FAN:
        faces = np.stack([second, third, np.full_like(second, corners[0])], axis=1)
    else:
        odd = np.arange(len(second)) % 2 == 1
        first = corners[:-2]
        faces = np.stack(
            [first, np.where(odd, third, second), np.where(odd, second, third)], axis=1
        )
    a, b, c = faces.T
    return faces[(a != b) & (b != c) & (a != c)]


def _local(node: Json) -> np.ndarray:
    """The map of a node to its parent."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    return _composed(
        np.array(node.get("translation", (0.0, 0.0, 0.0)), dtype=np.float64),
        np.array(node.get("rotation", (0.0, 0.0, 0.0, 1.0)), dtype=np.float64),
        np.array(node.get("scale", (1.0, 1.0, 1.0)), dtype=np.float64),
    )


def _composed(move: np.ndarray, turn: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Scale, then turn by a quaternion (x, y, z, w), then move."""
    matrix = np.eye(4)
    matrix[:3, :3] = quaternion_matrix(turn) * size.reshape(3)
    matrix[:3, 3] = move.reshape(3)
    return matrix


def _name(uri: object) -> str:
    """The file name of a URI, or the data URI itself."""
    text = str(uri)
    return text if text.startswith("data:") else unquote(text)

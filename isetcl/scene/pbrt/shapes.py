"""PBRT's shapes as triangles, or as the shapes that isetcl knows by formula."""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np

from isetcl.errors import FileError, InvalidInputError, OutOfMemoryError
from isetcl.memory import check_memory
from isetcl.scene.pbrt.files import SceneFiles, read_bytes
from isetcl.scene.pbrt.geometry import Flat, Geometry, Round, Triangles, as_flat
from isetcl.scene.pbrt.parameters import Parameters
from isetcl.scene.pbrt.places import Notes, located, wrong

BYTES_A_TRIANGLE = 600.0
"""Memory of a triangle until it is rendered: indices, corners, hierarchy."""
_STEPS = 96
"""Steps around a tessellated shape of revolution."""
_QUIET = (
    "alpha",
    "shadowalpha",
    "edgelength",
    "splitdepth",
    "faceIndices",
    "faceindices",
    "S",
    "scheme",
)


def check_triangles(count: float, what: str) -> None:
    """Raise OutOfMemoryError unless so many triangles fit, before they are made."""
    check_memory(
        f"{what} of {count:.4g} triangles",
        BYTES_A_TRIANGLE * count,
        lambda shrink: f"reduce it to {int(count * shrink**2)} triangles",
    )


class ShapeReader:
    """Reads Shape directives; files of meshes are read once."""

    def __init__(self, files: SceneFiles, notes: Notes, version: int) -> None:
        self._files = files
        self._notes = notes
        self._meshes: dict[Path, Triangles | Flat] = {}

    def read(self, kind: str, parameters: Parameters) -> Geometry | None:
        """The shape of a kind; None for one that is left out, which is noted."""
        makers = {
            "sphere": self._sphere,
            "disk": self._disk,
            "cylinder": self._cylinder,
            "cone": self._cone,
            "paraboloid": self._paraboloid,
            "hyperboloid": self._hyperboloid,
            "trianglemesh": self._trianglemesh,
            "plymesh": self._plymesh,
            "bilinearmesh": self._bilinearmesh,
            "loopsubdiv": self._loopsubdiv,
            "heightfield": self._heightfield,
        }
        parameters.ignore(_QUIET)
        if kind not in makers:
            self._notes.add("shapes left out, which isetcl has none of", kind, parameters.place)
            parameters.ignore(p.name for p in parameters.unused())
            return None
        with located(parameters.place):
            return makers[kind](parameters)

    def _sphere(self, parameters: Parameters) -> Geometry:
        radius = _positive(parameters, "radius", 1.0)
        low, high = sorted(
            float(np.clip(parameters.number(n, d), -radius, radius))
            for n, d in (("zmin", -radius), ("zmax", radius))
        )
        phi = _turn(parameters)

        def tessellate() -> Triangles:
            angles = np.linspace(math.acos(max(-1.0, low / radius)), math.acos(high / radius), 49)
            profile = np.stack([radius * np.sin(angles), radius * np.cos(angles)], axis=1)
            return _revolved(profile, phi, np.stack([np.sin(angles), np.cos(angles)], axis=1))

        if low == -radius and high == radius and phi == 360.0:
            return Round("sphere", radius, 0.0, tessellate)
        self._note_tessellated("part of a sphere", parameters)
        return tessellate()

    def _disk(self, parameters: Parameters) -> Geometry:
        radius = _positive(parameters, "radius", 1.0)
        inner = parameters.number("innerradius", 0.0)
        height = parameters.number("height", 0.0)
        if not 0 <= inner < radius:
            raise InvalidInputError(f"innerradius must lie between 0 and the radius, got {inner:g}")
        phi = _turn(parameters)

        def tessellate() -> Triangles:
            # PBRT's v runs from the rim to the middle.
            profile = np.array([[radius, height], [inner, height]])
            return _revolved(profile, phi, np.array([[0.0, 1.0], [0.0, 1.0]]))

        if inner == 0 and phi == 360.0:
            return Round("disk", radius, height, tessellate)
        self._note_tessellated("part of a disk", parameters)
        return tessellate()

    def _cylinder(self, parameters: Parameters) -> Geometry:
        radius = _positive(parameters, "radius", 1.0)
        low, high = sorted((parameters.number("zmin", -1.0), parameters.number("zmax", 1.0)))
        self._note_tessellated("cylinder", parameters)
        profile = np.array([[radius, low], [radius, high]])
        return _revolved(profile, _turn(parameters), np.array([[1.0, 0.0], [1.0, 0.0]]))

    def _cone(self, parameters: Parameters) -> Geometry:
        radius = _positive(parameters, "radius", 1.0)
        height = _positive(parameters, "height", 1.0)
        self._note_tessellated("cone", parameters)
        out = np.array([height, radius]) / math.hypot(height, radius)
        return _revolved(
            np.array([[radius, 0.0], [0.0, height]]), _turn(parameters), np.stack([out, out])
        )

    def _paraboloid(self, parameters: Parameters) -> Geometry:
        radius = _positive(parameters, "radius", 1.0)
        low, high = sorted((parameters.number("zmin", 0.0), parameters.number("zmax", 1.0)))
        if low < 0 or high <= 0:
            raise InvalidInputError(f"a paraboloid must lie at z >= 0, got {low:g} to {high:g}")
        self._note_tessellated("paraboloid", parameters)
        z = np.linspace(math.sqrt(low), math.sqrt(high), 33) ** 2
        r = radius * np.sqrt(z / high)
        out = np.stack([2.0 * r, np.full_like(r, -(radius**2) / high)], axis=1)
        out /= np.linalg.norm(out, axis=1, keepdims=True)
        return _revolved(np.stack([r, z], axis=1), _turn(parameters), out)

    def _hyperboloid(self, parameters: Parameters) -> Geometry:
        first = parameters.vector("p1", (0.0, 0.0, 0.0))
        second = parameters.vector("p2", (1.0, 1.0, 1.0))
        self._note_tessellated("hyperboloid", parameters)
        points = first + np.linspace(0.0, 1.0, 33)[:, None] * (second - first)
        profile = np.stack([np.hypot(points[:, 0], points[:, 1]), points[:, 2]], axis=1)
        return _revolved(profile, _turn(parameters), None)

    def _trianglemesh(self, parameters: Parameters) -> Geometry:
        points = _points(parameters)
        indices = parameters.numbers("indices", "integer")
        if indices is None and len(points) == 3:
            indices = np.arange(3.0)
        faces = _groups(parameters, "indices", indices, 3)
        normals = _matching(parameters.vectors("N"), points, "N")
        uv = _uv(parameters, points)
        check_triangles(len(faces), "a trianglemesh")
        return as_flat(Triangles(points, faces, normals, uv))

    def _plymesh(self, parameters: Parameters) -> Geometry:
        name = parameters.text("filename")
        if "displacement" in parameters:
            self._notes.add(
                "displacements left out", "plymesh", parameters.place_of("displacement")
            )
            parameters.ignore(("displacement",))
        path = self._files.find(name, parameters.place_of("filename"))
        if path is None:
            raise wrong(parameters.place, f"the mesh {name!r} does not exist")
        if path not in self._meshes:
            self._meshes[path] = as_flat(read_ply(path))
        return self._meshes[path]

    def _bilinearmesh(self, parameters: Parameters) -> Geometry:
        points = _points(parameters)
        parameters.ignore(("emissionfilename",))
        indices = parameters.numbers("indices", "integer")
        if indices is None and len(points) == 4:
            indices = np.arange(4.0)
        patches = _groups(parameters, "indices", indices, 4)
        normals = _matching(parameters.vectors("N"), points, "N")
        uv = _uv(parameters, points)
        if len(patches) and (patches.min() < 0 or patches.max() >= len(points)):
            raise InvalidInputError(f"indices must lie between 0 and {len(points) - 1}")
        # A Quad's corners in turn; PBRT lists p00 p10 p01 p11.
        corners = patches[:, [0, 1, 3, 2]]
        if all(_is_planar(points[patch]) for patch in patches[:1000]) or len(patches) > 100_000:
            check_triangles(2 * len(patches), "a bilinearmesh")
            faces = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
            if len(patches) == 1 and uv is None:
                uv = np.zeros((len(points), 2))
                uv[patches[0]] = [[0, 0], [1, 0], [0, 1], [1, 1]]
            return as_flat(Triangles(points, faces, normals, uv))
        self._note_tessellated("bilinearmesh", parameters)
        check_triangles(512 * len(patches), "a bilinearmesh")
        return _bilinear(points, patches, normals, uv)

    def _loopsubdiv(self, parameters: Parameters) -> Geometry:
        points = _points(parameters)
        levels = parameters.whole("levels", parameters.whole("nlevels", 3))
        faces = _groups(parameters, "indices", parameters.numbers("indices", "integer"), 3)
        cage = Triangles(points, faces)
        if not 0 <= levels <= 20:
            raise InvalidInputError(f"levels must lie between 0 and 20, got {levels}")
        check_triangles(len(faces) * 4.0**levels, "a loopsubdiv")
        import trimesh

        try:
            vertices, triangles = trimesh.remesh.subdivide_loop(
                cage.points, cage.faces, iterations=levels
            )
            smooth = trimesh.Trimesh(vertices, triangles, process=False).vertex_normals
        except Exception as error:
            # The subdivider raises what it likes on cages that are no surface.
            raise InvalidInputError(
                f"the cage of loopsubdiv cannot be subdivided ({error}); repair it, every edge "
                "must have one or two triangles"
            ) from error
        self._note_tessellated(f"loopsubdiv, {levels} levels", parameters)
        return Triangles(np.asarray(vertices), np.asarray(triangles), np.asarray(smooth))

    def _heightfield(self, parameters: Parameters) -> Geometry:
        columns, rows = parameters.whole("nu", 0), parameters.whole("nv", 0)
        z = parameters.numbers("Pz", "float")
        if z is None:
            z = parameters.numbers("z", "float")
        if columns < 2 or rows < 2 or z is None or len(z) != columns * rows:
            raise InvalidInputError(
                f"a heightfield must have nu times nv heights Pz, got nu {columns}, nv {rows} and "
                f"{0 if z is None else len(z)}"
            )
        check_triangles(2.0 * columns * rows, "a heightfield")
        u, v = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
        points = np.stack([u, v, z.reshape(rows, columns)], axis=-1).reshape(-1, 3)
        return Triangles(points, _grid_faces(rows, columns), None, points[:, :2].copy())

    def _note_tessellated(self, what: str, parameters: Parameters) -> None:
        self._notes.add("curved shapes made of triangles", what, parameters.place)


def _positive(parameters: Parameters, name: str, default: float) -> float:
    value = parameters.number(name, default)
    if not 0 < value <= 1e12:
        raise wrong(parameters.place_of(name), f"{name} must be > 0 and <= 1e12, got {value:g}")
    return value


def _turn(parameters: Parameters) -> float:
    phi = parameters.number("phimax", 360.0)
    if not 0 < phi <= 360:
        raise wrong(
            parameters.place_of("phimax"), f"phimax must be > 0 and <= 360 degrees, got {phi:g}"
        )
    return phi


def _points(parameters: Parameters) -> np.ndarray:
    points = parameters.vectors("P")
    if points is None:
        raise InvalidInputError("points P must be given")
    return points


def _groups(parameters: Parameters, name: str, indices: np.ndarray | None, size: int) -> np.ndarray:
    if indices is None:
        raise InvalidInputError(f"{name} must be given where there are more points")
    if len(indices) % size:
        raise wrong(
            parameters.place_of(name),
            f"{name} must be groups of {size}, got {len(indices)} numbers",
        )
    if len(indices) and not np.abs(indices).max() < 2**53:
        raise wrong(parameters.place_of(name), f"{name} must lie between 0 and the last point")
    return indices.reshape(-1, size).astype(np.int64)


def _matching(values: np.ndarray | None, points: np.ndarray, name: str) -> np.ndarray | None:
    if values is not None and len(values) != len(points):
        raise InvalidInputError(
            f"{name} must have one entry a point ({len(points)}), got {len(values)}"
        )
    return values


def _uv(parameters: Parameters, points: np.ndarray) -> np.ndarray | None:
    for name in ("uv", "st"):
        values = parameters.vectors(name, 2)
        if values is not None:
            return _matching(values, points, name)
    return None


def _is_planar(corners: np.ndarray) -> bool:
    """Whether a patch of corners p00 p10 p01 p11 is a parallelogram or at least flat."""
    a, b, c = corners[1] - corners[0], corners[2] - corners[0], corners[3] - corners[0]
    size = float(np.abs([a, b, c]).max())
    with np.errstate(all="ignore"):
        return bool(abs(np.dot(np.cross(a, b), c)) <= 1e-9 * size**3)


def _grid_faces(rows: int, columns: int) -> np.ndarray:
    """Triangles of a grid of points, row by row."""
    start = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1)
    right, above = start + 1, start + columns
    return np.concatenate(
        [
            np.stack([start, right, above + 1], axis=1),
            np.stack([start, above + 1, above], axis=1),
        ]
    )


def _revolved(profile: np.ndarray, phi_deg: float, normals: np.ndarray | None) -> Triangles:
    """A profile (r, z) turned about z: u is the turn, v runs along the profile."""
    steps = max(3, math.ceil(_STEPS * phi_deg / 360.0))
    u = np.linspace(0.0, 1.0, steps + 1)
    turn = np.radians(phi_deg) * u
    v = np.linspace(0.0, 1.0, len(profile))
    r, z = profile[:, :1], profile[:, 1:]
    points = np.stack(np.broadcast_arrays(r * np.cos(turn), r * np.sin(turn), z), axis=-1).reshape(
        -1, 3
    )
    uv = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    smooth = None
    if normals is not None:
        out, up = normals[:, :1], normals[:, 1:]
        smooth = np.stack(
            np.broadcast_arrays(out * np.cos(turn), out * np.sin(turn), up), axis=-1
        ).reshape(-1, 3)
    faces = _grid_faces(len(profile), steps + 1)
    corners = points[faces]
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = float(np.abs(points).max())
    kept = np.linalg.norm(sides, axis=1) > 1e-14 * size**2
    return Triangles(points, faces[kept], smooth, uv)


def _bilinear(
    points: np.ndarray, patches: np.ndarray, normals: np.ndarray | None, uv: np.ndarray | None
) -> Triangles:
    """Bilinear patches as 16 by 16 cells each."""
    n = 17
    t = np.linspace(0.0, 1.0, n)
    u, v = (a.reshape(-1, 1) for a in np.meshgrid(t, t))
    weights = np.concatenate([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v], axis=1)
    cells = _grid_faces(n, n)
    corner_uv = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    all_points = np.einsum("ij,pjk->pik", weights, points[patches]).reshape(-1, 3)
    each = np.broadcast_to(corner_uv, (len(patches), 4, 2)) if uv is None else uv[patches]
    all_uv = np.einsum("ij,pjk->pik", weights, each).reshape(-1, 2)
    smooth = None
    if normals is not None:
        smooth = np.einsum("ij,pjk->pik", weights, normals[patches]).reshape(-1, 3)
    faces = (cells[None] + (np.arange(len(patches)) * n * n)[:, None, None]).reshape(-1, 3)
    return Triangles(all_points, faces, smooth, all_uv)


def read_ply(path: Path) -> Triangles:
    """The mesh of a PLY file (also .ply.gz), quads cut in two.

    Raises
    ------
    FileError
        If it is none; the message names the file.
    OutOfMemoryError
        If it would not fit: told from its header.
    """
    from trimesh.exchange import ply

    data = read_bytes(path, "mesh file", factor=4.0)
    _check_header(path, data)
    try:
        loaded = ply.load_ply(io.BytesIO(data), fix_texture=False, skip_materials=True)
        raw = loaded["metadata"]["_ply_raw"]["vertex"]["data"]
        vertices = _columns(raw, ("x", "y", "z"))
        faces = _triangulated(loaded["faces"])
        normals = _columns(raw, ("nx", "ny", "nz"))
        uv = None
        for names in (("u", "v"), ("s", "t"), ("texture_u", "texture_v")):
            uv = _columns(raw, names) if uv is None else uv
        if vertices is None:
            raise InvalidInputError("vertices must have finite x, y and z")
        return Triangles(vertices, faces, normals, uv)
    except InvalidInputError as error:
        raise FileError(f"mesh file {str(path)!r}: {error}") from error
    except MemoryError as error:
        raise OutOfMemoryError(f"mesh file {str(path)!r} does not fit into memory") from error
    except Exception as error:
        # The PLY reader raises what it likes; whatever it is, the file is no mesh.
        raise FileError(
            f"mesh file {str(path)!r} cannot be read as PLY ({error or type(error).__name__}); "
            "export it again"
        ) from error


def _check_header(path: Path, data: bytes) -> None:
    """Refuse what is no PLY or would not fit, by its header alone."""
    head, found, _ = data[:100_000].partition(b"end_header")
    if not data.startswith(b"ply") or not found:
        raise FileError(f"mesh file {str(path)!r} is no PLY file; export it again")
    for line in head.decode("latin-1").splitlines():
        words = line.split()
        if len(words) == 3 and words[0] == "element" and words[2].isdigit():
            count = int(words[2]) if len(words[2]) < 18 else 10**18
            check_triangles(count, f"mesh file {str(path)!r}: {words[1]} list")
            if count > len(data):
                raise FileError(
                    f"mesh file {str(path)!r} is shorter than its header says ({count} "
                    f"{words[1]} entries); export it again"
                )


def _triangulated(faces: object) -> np.ndarray:
    if isinstance(faces, np.ndarray) and faces.ndim == 2 and faces.shape[1] == 3:
        return faces.astype(np.int64)
    rows = [np.asarray(face, dtype=np.int64) for face in faces]  # type: ignore[attr-defined]
    triangles = [[f[0], f[i], f[i + 1]] for f in rows for i in range(1, len(f) - 1)]
    return np.array(triangles, dtype=np.int64).reshape(-1, 3)


def _columns(raw: np.ndarray, names: tuple[str, ...]) -> np.ndarray | None:
    known = raw.dtype.names if isinstance(raw, np.ndarray) else raw.keys()
    if not all(name in (known or ()) for name in names):
        return None
    values = np.stack(
        [np.asarray(raw[name], dtype=np.float64).reshape(-1) for name in names], axis=1
    )
    return values if np.isfinite(values).all() else None

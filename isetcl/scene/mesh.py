"""Triangle meshes: what they are, and reading them from the files that trimesh reads."""

from __future__ import annotations

import functools
import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from isetcl.errors import FileError, InvalidInputError, check_array, check_type
from isetcl.scene.bvh import WideTree, build_binary_tree, collapse

MAX_COORDINATE_M = 1e12


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface of triangles.

    Parameters
    ----------
    vertices_m : array_like, (n, 3)
        Corners, metres, world frame.
    faces : array_like of int, (m, 3)
        Indices of the corners of each triangle.
    normals : array_like, (n, 3), optional
        Shading normals at the vertices; None shades triangles flat.
    uv : array_like, (n, 2), optional
        Texture coordinates at the vertices; None is (0, 0) everywhere.

    Raises
    ------
    InvalidInputError
        If shapes do not fit, a number is not finite, or an index is out of range.
    """

    vertices_m: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None = None
    uv: np.ndarray | None = None

    def __post_init__(self) -> None:
        vertices = check_array("mesh: vertices_m", self.vertices_m)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or len(vertices) == 0:
            raise InvalidInputError(
                f"mesh: vertices_m must have shape (n, 3), got {vertices.shape}"
            )
        bad = ~(np.abs(vertices) <= MAX_COORDINATE_M).all(axis=1)
        if bad.any():
            raise InvalidInputError(
                f"mesh: vertices_m must be finite and within {MAX_COORDINATE_M:g} m, got "
                f"{vertices[bad][0].tolist()} at vertex {int(np.argmax(bad))}"
            )
        faces = check_array("mesh: faces", self.faces)
        if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
            raise InvalidInputError(f"mesh: faces must have shape (m, 3), got {faces.shape}")
        wrong = ~((faces >= 0) & (faces < len(vertices)) & (faces == np.rint(faces))).all(axis=1)
        if wrong.any():
            raise InvalidInputError(
                f"mesh: faces must be indices from 0 to {len(vertices) - 1}, got "
                f"{faces[wrong][0].tolist()} in face {int(np.argmax(wrong))}"
            )
        object.__setattr__(self, "vertices_m", vertices)
        object.__setattr__(self, "faces", faces.astype(np.int64))
        for name, width in (("normals", 3), ("uv", 2)):
            object.__setattr__(self, name, self._attribute(name, width))

    def _attribute(self, name: str, width: int) -> np.ndarray | None:
        value = getattr(self, name)
        if value is None:
            return None
        array = check_array(f"mesh: {name}", value)
        if array.shape != (len(self.vertices_m), width) or not np.isfinite(array).all():
            raise InvalidInputError(
                f"mesh: {name} must be finite, of shape ({len(self.vertices_m)}, {width}), got "
                f"shape {array.shape}"
            )
        return array

    @functools.cached_property
    def triangles_m(self) -> np.ndarray:
        """Corners of each triangle, metres, (m, 3, 3)."""
        return self.vertices_m[self.faces]

    @functools.cached_property
    def tree(self) -> WideTree:
        """A hierarchy for rays on the host, made with numpy."""
        corners = self.triangles_m
        return collapse(build_binary_tree(corners.min(axis=1), corners.max(axis=1)))

    def moved(self, matrix: np.ndarray) -> Mesh:
        """The mesh under an affine map, a matrix (4, 4) for column vectors.

        Raises
        ------
        InvalidInputError
            If the matrix is not affine or flattens space.
        """
        m = check_affine(matrix)
        linear = m[:3, :3]
        normals = None
        if self.normals is not None:
            normals = self.normals @ np.linalg.inv(linear)
            length = np.linalg.norm(normals, axis=1, keepdims=True)
            normals = normals / np.where(length > 0, length, 1.0)
        # A mirrored triangle would face the other way.
        faces = self.faces if np.linalg.det(linear) > 0 else self.faces[:, ::-1]
        return Mesh(self.vertices_m @ linear.T + m[:3, 3], faces, normals, self.uv)

    def digest(self) -> str:
        """A hash of the mesh, for provenance."""
        parts = (self.vertices_m, self.faces, self.normals, self.uv)
        data = b"".join(b"-" if part is None else part.tobytes() for part in parts)
        return hashlib.sha256(data).hexdigest()[:16]


@dataclass(frozen=True, eq=False)
class Instance:
    """A mesh in another place; many instances of one mesh keep it only once.

    Parameters
    ----------
    mesh
        The mesh.
    matrix : array_like, (4, 4)
        Affine map from the mesh to the world, for column vectors.

    Raises
    ------
    InvalidInputError
        If the matrix is not affine or flattens space.
    """

    mesh: Mesh
    matrix: np.ndarray

    def __post_init__(self) -> None:
        check_type("instance: mesh", self.mesh, Mesh)
        object.__setattr__(self, "matrix", check_affine(self.matrix))

    @functools.cached_property
    def in_place(self) -> Mesh:
        """The mesh moved to where the instance stands."""
        return self.mesh.moved(self.matrix)

    def digest(self) -> str:
        """A hash, for provenance."""
        data = self.mesh.digest().encode() + self.matrix.tobytes()
        return hashlib.sha256(data).hexdigest()[:16]


def check_affine(matrix: np.ndarray) -> np.ndarray:
    """Return an affine map as a float64 matrix (4, 4).

    Raises
    ------
    InvalidInputError
        If the matrix is not affine or flattens space.
    """
    m = check_array("matrix", matrix)
    if m.shape != (4, 4) or not np.isfinite(m).all() or not np.allclose(m[3], [0, 0, 0, 1]):
        raise InvalidInputError("matrix must be affine, of shape (4, 4), last row 0 0 0 1")
    if not abs(np.linalg.det(m[:3, :3])) > 0:
        raise InvalidInputError("matrix must not flatten space: its determinant is 0")
    return m


def load_mesh(path: str | Path, *, smooth: bool = False) -> Mesh:
    """All triangles of a file that trimesh reads (PLY, OBJ, STL, OFF, GLB, ...), as one mesh.

    Parameters
    ----------
    path
        The file; its unit is taken to be the metre.
    smooth
        Keep, or compute, normals at the vertices and shade smoothly.

    Raises
    ------
    FileError
        If the file does not exist or holds no triangles.
    """
    import trimesh

    check_type("path", path, (str, Path))
    file = Path(path)
    if not file.is_file():
        raise FileError(f"mesh file {str(file)!r} does not exist")
    try:
        loaded = trimesh.load(file, force="mesh", process=False)
    except Exception as error:
        # Readers raise what they like; whatever it is, the file is no mesh.
        raise FileError(
            f"mesh file {str(file)!r} cannot be read ({error}); use PLY, OBJ, STL, OFF or GLB"
        ) from error
    if not isinstance(loaded, trimesh.Trimesh) or len(loaded.faces) == 0:
        raise FileError(f"mesh file {str(file)!r} holds no triangles")
    uv = getattr(loaded.visual, "uv", None)
    has_uv = uv is not None and np.shape(uv) == (len(loaded.vertices), 2)
    return Mesh(
        np.asarray(loaded.vertices),
        np.asarray(loaded.faces),
        np.asarray(loaded.vertex_normals) if smooth else None,
        np.asarray(uv) if has_uv else None,
    )

"""Shapes before they are placed: triangles, or one of the shapes isetcl knows by formula."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.scene.mesh import MAX_COORDINATE_M, Mesh
from isetcl.scene.model import Disc, Quad, Shape, Sphere
from isetcl.scene.pbrt.transforms import (
    determinant,
    normals_through,
    points_through,
    similarity_scale,
)

FLAT = 1e-9
SPHERE_AXES = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""From PBRT's sphere, longitude from x to y about z, to isetcl's, from z to x about y."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """A mesh in the coordinates of its file; see `Mesh`."""

    points: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None = None
    uv: np.ndarray | None = None

    def __post_init__(self) -> None:
        if len(self.faces) == 0 or len(self.points) == 0:
            raise InvalidInputError("a mesh must have vertices and triangles, got none")
        bad = ~(np.abs(self.points) <= MAX_COORDINATE_M).all(axis=1)
        if bad.any():
            i = int(np.argmax(bad))
            raise InvalidInputError(
                f"vertices must be finite and within {MAX_COORDINATE_M:g} m, got "
                f"{self.points[i].tolist()} at vertex {i}"
            )
        wrong = ((self.faces < 0) | (self.faces >= len(self.points))).any(axis=1)
        if wrong.any():
            i = int(np.argmax(wrong))
            raise InvalidInputError(
                f"indices must lie between 0 and {len(self.points) - 1}, got "
                f"{self.faces[i].tolist()} in triangle {i}"
            )


@dataclass(frozen=True, eq=False)
class Round:
    """A full sphere about the origin, or a full disc across z; `tessellate` makes triangles."""

    kind: Literal["sphere", "disk"]
    radius: float
    height: float
    tessellate: Callable[[], Triangles]

    @functools.cached_property
    def spare(self) -> Triangles:
        """The shape as triangles."""
        return self.tessellate()


@dataclass(frozen=True, eq=False)
class Flat:
    """A parallelogram, whose front is along (or, with sign -1, against) edge u x edge v.

    has_uv tells whether u and v are the coordinates of the file.
    """

    corner: np.ndarray
    edge_u: np.ndarray
    edge_v: np.ndarray
    sign: float
    has_uv: bool
    spare: Triangles


Geometry = Triangles | Round | Flat


def triangles_of(geometry: Geometry) -> Triangles:
    """The triangles of a shape."""
    return geometry if isinstance(geometry, Triangles) else geometry.spare


def as_flat(mesh: Triangles) -> Triangles | Flat:
    """A parallelogram, where a mesh of two triangles is one; else the mesh."""
    if len(mesh.faces) != 2 or len(mesh.points) != 4:
        return mesh
    first, second = (list(face) for face in mesh.faces)
    shared = [i for i in first if i in second]
    if len(set(first)) != 3 or len(set(second)) != 3 or len(shared) != 2:
        return mesh
    start = next(i for i in first if i not in shared)
    at = first.index(start)
    a, b, d = start, first[(at + 1) % 3], first[(at + 2) % 3]
    c = next(i for i in second if i not in shared)
    p = mesh.points
    size = float(np.abs(p - p[a]).max())
    u, v = p[b] - p[a], p[d] - p[a]
    normal = np.cross(u, v)
    length = float(np.linalg.norm(normal))
    if not length > FLAT * size**2 or np.abs(p[b] + p[d] - p[a] - p[c]).max() > FLAT * size:
        return mesh
    other = np.cross(p[second[1]] - p[second[0]], p[second[2]] - p[second[0]])
    if float(other @ normal) <= 0:
        return mesh
    sign = 1.0
    if mesh.normals is not None:
        along = mesh.normals @ (normal / length)
        if not np.allclose(np.abs(along), 1.0, atol=1e-5) or np.ptp(np.sign(along)) > 0:
            return mesh
        sign = float(np.sign(along[0]))
    return _with_uv(mesh, (a, b, c, d), sign)


def _with_uv(mesh: Triangles, cycle: tuple[int, int, int, int], sign: float) -> Flat:
    """The parallelogram of four corners in turn, with the file's (u, v) where they are its own."""
    p = mesh.points
    if mesh.uv is not None:
        for turn in range(4):
            a, b, c, d = (cycle[(turn + i) % 4] for i in range(4))
            for first, last, way in ((b, d, 1.0), (d, b, -1.0)):
                wanted = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
                if np.allclose(mesh.uv[[a, first, c, last]], wanted, atol=1e-9):
                    return Flat(p[a], p[first] - p[a], p[last] - p[a], sign * way, True, mesh)
    a, b, _, d = cycle
    return Flat(p[a], p[b] - p[a], p[d] - p[a], sign, False, mesh)


@dataclass(frozen=True)
class Needs:
    """What a surface needs of its shape: texture coordinates, a front and a back."""

    uv: bool
    sides: bool


def place(geometry: Geometry, matrix: np.ndarray, is_reversed: bool, needs: Needs) -> Shape:
    """A shape moved into the world.

    Its front is where the normal of the file's coordinates points after the move (turned round
    by ReverseOrientation), whether or not the move mirrors.

    Raises
    ------
    InvalidInputError
        If the move flattens it, or leads too far.
    """
    if not determinant(matrix) or not np.isfinite(matrix).all():
        raise InvalidInputError("the transform flattens the shape: no scale may be 0")
    if isinstance(geometry, Round):
        analytic = _placed_round(geometry, matrix, is_reversed, needs)
        if analytic is not None:
            return analytic
    if isinstance(geometry, Flat):
        flat = _placed_flat(geometry, matrix, is_reversed, needs)
        if flat is not None:
            return flat
    return placed_mesh(triangles_of(geometry), matrix, is_reversed, needs)


def _placed_round(
    shape: Round, matrix: np.ndarray, is_reversed: bool, needs: Needs
) -> Sphere | Disc | None:
    if shape.kind == "sphere":
        scale = similarity_scale(matrix)
        if scale is None or (is_reversed and needs.sides):
            return None
        if needs.uv and not np.allclose(matrix[:3, :3] / scale, SPHERE_AXES, atol=1e-6):
            return None
        centre = matrix[:3, 3]
        return Sphere(triple(centre), shape.radius * scale)
    x, y = matrix[:3, 0], matrix[:3, 1]
    radius = float(np.linalg.norm(x))
    across = abs(float(x @ y)) > 1e-6 * radius**2
    if needs.uv or across or abs(float(np.linalg.norm(y)) - radius) > 1e-6 * radius:
        return None
    centre = points_through(matrix, np.array([[0.0, 0.0, shape.height]]))[0]
    normal = normals_through(matrix, np.array([[0.0, 0.0, -1.0 if is_reversed else 1.0]]))[0]
    return Disc(triple(centre), shape.radius * radius, triple(normal))


def _placed_flat(shape: Flat, matrix: np.ndarray, is_reversed: bool, needs: Needs) -> Quad | None:
    if needs.uv and not shape.has_uv:
        return None
    linear = matrix[:3, :3]
    corner = points_through(matrix, shape.corner[None])[0]
    u, v = linear @ shape.edge_u, linear @ shape.edge_v
    front = shape.sign * (-1.0 if is_reversed else 1.0) * np.sign(determinant(matrix))
    if front < 0 and needs.sides:
        if needs.uv:
            return None
        u, v = v, u
    return Quad(triple(corner), triple(u), triple(v))


def placed_mesh(mesh: Triangles, matrix: np.ndarray, is_reversed: bool, needs: Needs) -> Mesh:
    """Triangles moved into the world, wound so that their front is where it belongs."""
    if needs.uv and mesh.uv is None:
        mesh = _with_default_uv(mesh)
    points = points_through(matrix, mesh.points)
    faces = mesh.faces
    normals = None
    if mesh.normals is None:
        if (determinant(matrix) < 0) != is_reversed:
            faces = faces[:, ::-1]
    else:
        normals = normals_through(matrix, mesh.normals) * (-1.0 if is_reversed else 1.0)
        corners = points[faces]
        with np.errstate(all="ignore"):
            winding = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            against = np.einsum("ij,ij->i", winding, normals[faces].sum(axis=1)) < 0
        if against.any():
            faces = np.where(against[:, None], faces[:, ::-1], faces)
    return Mesh(points, faces, normals, mesh.uv if needs.uv or mesh.uv is not None else None)


def _with_default_uv(mesh: Triangles) -> Triangles:
    """The mesh with PBRT's coordinates for triangles without: (0,0), (1,0), (1,1) on each."""
    corners = mesh.faces.reshape(-1)
    uv = np.tile(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]), (len(mesh.faces), 1))
    return replace(
        mesh,
        points=mesh.points[corners],
        faces=np.arange(len(corners)).reshape(-1, 3),
        normals=None if mesh.normals is None else mesh.normals[corners],
        uv=uv,
    )


def area_m2(shape: Shape) -> float:
    """Area of a placed shape, m^2."""
    if isinstance(shape, Sphere):
        return float(4.0 * np.pi * shape.radius_m**2)
    if isinstance(shape, Disc):
        return float(np.pi * shape.radius_m**2)
    if isinstance(shape, Quad):
        return float(np.linalg.norm(np.cross(shape.edge_u_m, shape.edge_v_m)))
    corners = (shape if isinstance(shape, Mesh) else shape.in_place).triangles_m
    sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return float(np.linalg.norm(sides, axis=1).sum() / 2.0)


def triple(vector: np.ndarray) -> tuple[float, float, float]:
    """Three numbers of a vector."""
    return float(vector[0]), float(vector[1]), float(vector[2])

"""Meshes made from outlines and profiles: flat ones, extruded ones, lathed ones, boxes.

All are closed (except flat ones), share their corners, and face outwards.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_count, check_positive
from isetcl.scene.mesh import Mesh
from isetcl.scene.polygon import Triangulation, triangulate

_CREASE_DEG = 40.0


def flat_mesh(loops: list[np.ndarray], z_m: float = 0.0, name: str = "outline") -> Mesh:
    """The inside of an outline (metres) as triangles in the plane z, facing +z.

    Texture coordinates run over the outline's bounding box.

    Raises
    ------
    InvalidInputError
        If the outline is none.
    """
    part = triangulate(loops, name)
    vertices = np.column_stack([part.points, np.full(len(part.points), z_m)])
    return Mesh(vertices, part.faces, uv=_box_coordinates(part.points))


def extruded_mesh(loops: list[np.ndarray], depth_m: float, name: str = "outline") -> Mesh:
    """An outline (metres) given a thickness along z, from -depth/2 to +depth/2; watertight.

    Raises
    ------
    InvalidInputError
        If the outline is none, or the depth is not positive.
    """
    depth = check_positive("depth_m", depth_m, "m")
    part = triangulate(loops, name)
    count = len(part.points)
    front = np.column_stack([part.points, np.full(count, depth / 2.0)])
    back = np.column_stack([part.points, np.full(count, -depth / 2.0)])
    faces = np.concatenate([part.faces, part.faces[:, ::-1] + count, _walls(part)])
    uv = _box_coordinates(part.points)
    return Mesh(np.concatenate([front, back]), faces, uv=np.concatenate([uv, uv]))


def _walls(part: Triangulation) -> np.ndarray:
    """Two triangles behind each edge of the outline; the back follows the front in the list."""
    count = len(part.points)
    a, b = part.boundary().T
    return np.concatenate(
        [np.column_stack([a, a + count, b + count]), np.column_stack([a, b + count, b])]
    )


def _box_coordinates(points: np.ndarray) -> np.ndarray:
    low, high = points.min(axis=0), points.max(axis=0)
    return (points - low) / (high - low)


def lathed_mesh(profile_m: np.ndarray, *, segments: int = 48, smooth: bool = True) -> Mesh:
    """A profile turned about the y axis, closed at both ends.

    Parameters
    ----------
    profile_m : array_like, (n, 2)
        Radius (>= 0) and height of the points of the profile, from the bottom to the top, metres.
        An end that is not on the axis is closed by a disc.
    segments
        Flat pieces around the axis.
    smooth
        Shade round the axis and along the profile smoothly, where it bends by less than 40 degrees.

    Raises
    ------
    InvalidInputError
        If the profile has less than two points, a negative radius, or a radius of 0 in between.
    """
    profile = _closed_profile(profile_m)
    check_count("segments", segments, 3)
    slopes = _slopes(profile)
    turn = 2.0 * math.pi * np.arange(segments) / segments
    around = np.column_stack([np.sin(turn), np.zeros(segments), np.cos(turn)])
    axis = np.array([0.0, 1.0, 0.0])
    here, there = np.arange(segments), np.roll(np.arange(segments), -1)
    vertices: list[np.ndarray] = []
    normals: list[np.ndarray] = []
    faces: list[np.ndarray] = []
    for k, ends in enumerate(itertools.pairwise(profile)):
        first = 2 * k * segments
        for (radius, height), (out, up) in zip(ends, slopes[k], strict=True):
            vertices.append(radius * around + height * axis)
            normals.append(out * around + up * axis)
        low, high = first + here, first + segments + here
        if ends[0][0] > 0:
            faces.append(np.column_stack([low, first + there, first + segments + there]))
        if ends[1][0] > 0:
            faces.append(np.column_stack([low, first + segments + there, high]))
    shading = np.concatenate(normals) if smooth else None
    return Mesh(np.concatenate(vertices), np.concatenate(faces), shading)


def _closed_profile(profile_m: np.ndarray) -> np.ndarray:
    """A checked profile that starts and ends on the axis."""
    profile = check_array("profile_m", profile_m)
    if profile.ndim != 2 or profile.shape[1] != 2 or len(profile) < 2:
        raise InvalidInputError(f"profile_m must have shape (n >= 2, 2), got {profile.shape}")
    if not np.isfinite(profile).all() or np.any(profile[:, 0] < 0):
        raise InvalidInputError("profile_m must be finite with radii >= 0")
    if np.any(profile[1:-1, 0] == 0) or not np.any(profile[:, 0] > 0):
        raise InvalidInputError("profile_m must leave the axis, and touch it only at its ends")
    if np.any(np.all(profile[1:] == profile[:-1], axis=1)):
        raise InvalidInputError("profile_m must not hold the same point twice in a row")
    parts = [profile]
    if profile[0, 0] > 0:
        parts.insert(0, np.array([[0.0, profile[0, 1]]]))
    if profile[-1, 0] > 0:
        parts.append(np.array([[0.0, profile[-1, 1]]]))
    return np.concatenate(parts)


def _slopes(profile: np.ndarray) -> np.ndarray:
    """Normals (out, up) of each piece of a profile at its two ends, (pieces, 2, 2).

    Those of two pieces that meet at less than the crease angle are averaged.
    """
    step = np.diff(profile, axis=0)
    own = np.column_stack([step[:, 1], -step[:, 0]]) / np.linalg.norm(step, axis=1)[:, None]
    slopes = np.repeat(own[:, None], 2, axis=1)
    for k in range(len(own) - 1):
        if own[k] @ own[k + 1] > math.cos(math.radians(_CREASE_DEG)):
            mean = own[k] + own[k + 1]
            slopes[k, 1] = slopes[k + 1, 0] = mean / np.linalg.norm(mean)
    return slopes


def box_mesh(low_m: tuple[float, float, float], high_m: tuple[float, float, float]) -> Mesh:
    """A closed box between two opposite corners, metres, its sides along the axes.

    Raises
    ------
    InvalidInputError
        If a coordinate of the first corner is not smaller than that of the second.
    """
    low, high = check_array("low_m", low_m), check_array("high_m", high_m)
    if low.shape != (3,) or high.shape != (3,) or not np.all(low < high):
        raise InvalidInputError(f"low_m must be smaller than high_m, got {low_m} and {high_m}")
    bits = np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)])
    quads = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    faces = [(a, b, c) for a, b, c, _ in quads] + [(a, c, d) for a, _, c, d in quads]
    return Mesh(np.where(bits == 1, high, low), np.array(faces))


def joined_mesh(*meshes: Mesh) -> Mesh:
    """Several meshes as one, without texture coordinates; shading normals where all have them.

    Raises
    ------
    InvalidInputError
        If there is none.
    """
    if not meshes:
        raise InvalidInputError("joined_mesh needs at least one mesh, got none")
    starts = np.cumsum([0] + [len(mesh.vertices_m) for mesh in meshes[:-1]])
    normals = [mesh.normals for mesh in meshes if mesh.normals is not None]
    return Mesh(
        np.concatenate([mesh.vertices_m for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]),
        np.concatenate(normals) if len(normals) == len(meshes) else None,
    )

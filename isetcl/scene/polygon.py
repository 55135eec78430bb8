"""Flat shapes bounded by closed outlines, with holes: their triangles.

An outline is a list of loops, each an array (n, 2) of corners without the first repeated. What lies
inside is what an odd number of loops surround.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError, check_array

_SHORTEST_EDGE = 1e-8


@dataclass(frozen=True, eq=False)
class Triangulation:
    """Triangles of a polygon: points (n, 2) and anticlockwise faces (m, 3)."""

    points: np.ndarray
    faces: np.ndarray

    def boundary(self) -> np.ndarray:
        """Directed edges (k, 2) with the inside on their left."""
        edges = self.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        count = len(self.points)
        forward = edges[:, 0] * count + edges[:, 1]
        backward = edges[:, 1] * count + edges[:, 0]
        return edges[~np.isin(forward, backward)]

    def area(self) -> float:
        """Area of all triangles."""
        a, b, c = (self.points[self.faces[:, k]] for k in range(3))
        return float(np.sum(_cross(b - a, c - a)) / 2.0)


def triangulate(loops: list[np.ndarray], name: str = "outline") -> Triangulation:
    """Triangles of the inside of an outline.

    A Delaunay triangulation of the corners; an edge of the outline that is missing in it is halved
    until all are there. The triangles are then parted by the edges, without a test of position.

    Raises
    ------
    InvalidInputError
        If a loop has less than three corners, or loops touch or cross.
    """
    from scipy.spatial import Delaunay

    points, edges = _joined(loops, name)
    shortest = _SHORTEST_EDGE * float(np.ptp(points, axis=0).max())
    # Where edges cross, halves of them are missing however short they become.
    while np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1).min() > shortest:
        if len(np.unique(points, axis=0)) != len(points):
            break
        mesh = Delaunay(points)
        missing = ~_is_among(edges, mesh.simplices, len(points))
        if not missing.any():
            return Triangulation(points, _inside(mesh, edges, name))
        middle = points[edges[missing]].mean(axis=1)
        new = len(points) + np.arange(len(middle))
        halves = np.concatenate(
            [
                np.column_stack([edges[missing, 0], new]),
                np.column_stack([new, edges[missing, 1]]),
            ]
        )
        points = np.concatenate([points, middle])
        edges = np.concatenate([edges[~missing], halves])
    raise InvalidInputError(
        f"{name}: loops must neither touch nor cross; draw overlapping parts as one outline"
    )


def _joined(loops: list[np.ndarray], name: str) -> tuple[np.ndarray, np.ndarray]:
    """Points of all loops, and the edges (n, 2) between them."""
    parts, edges, start = [], [], 0
    for loop in loops:
        corners = check_array(f"{name}: loop", loop)
        if corners.ndim != 2 or corners.shape[1] != 2 or not np.isfinite(corners).all():
            raise InvalidInputError(
                f"{name}: a loop must be finite, of shape (n, 2), got {corners.shape}"
            )
        corners = corners[np.any(corners != np.roll(corners, 1, axis=0), axis=1)]
        if len(corners) < 3:
            raise InvalidInputError(
                f"{name}: a loop must have at least three different corners, got {len(corners)}"
            )
        index = start + np.arange(len(corners))
        edges.append(np.column_stack([index, np.roll(index, -1)]))
        parts.append(corners)
        start += len(corners)
    if not parts:
        raise InvalidInputError(f"{name}: at least one loop is needed, got none")
    points = np.concatenate(parts)
    if len(np.unique(points, axis=0)) != len(points):
        raise InvalidInputError(f"{name}: loops must not touch; two corners are in the same place")
    return points, np.concatenate(edges)


def _is_among(edges: np.ndarray, faces: np.ndarray, count: int) -> np.ndarray:
    """Which edges are sides of triangles."""
    sides = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    wanted = np.sort(edges, axis=1)
    return np.isin(wanted[:, 0] * count + wanted[:, 1], sides[:, 0] * count + sides[:, 1])


def _inside(mesh: object, edges: np.ndarray, name: str) -> np.ndarray:
    """Anticlockwise triangles inside: crossing an edge of the outline changes the side."""
    faces: np.ndarray = mesh.simplices  # type: ignore[attr-defined]
    points: np.ndarray = mesh.points  # type: ignore[attr-defined]
    neighbours: np.ndarray = mesh.neighbors  # type: ignore[attr-defined]
    outline = {(min(a, b), max(a, b)) for a, b in edges.tolist()}
    side = np.full(len(faces), -1)
    # Neighbour k lies across the edge that faces corner k.
    across = [
        [(min(f[i], f[j]), max(f[i], f[j])) in outline for i, j in ((1, 2), (2, 0), (0, 1))]
        for f in faces.tolist()
    ]
    waiting = []
    for t, k in np.argwhere(neighbours < 0).tolist():
        side[t] = int(across[t][k])
        waiting.append(t)
    while waiting:
        t = waiting.pop()
        for k, other in enumerate(neighbours[t].tolist()):
            if other >= 0 and side[other] < 0:
                side[other] = side[t] ^ int(across[t][k])
                waiting.append(other)
    kept = faces[side == 1]
    if len(kept) == 0:
        raise InvalidInputError(f"{name}: the loops must surround an area, got none")
    a, b, c = (points[kept[:, k]] for k in range(3))
    clockwise = _cross(b - a, c - a) < 0
    kept[clockwise] = kept[clockwise][:, ::-1]
    return kept.astype(np.int64)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]

"""Simplified Staunton chess pieces: profiles turned on a lathe, with the sizes of a small real set.

Diameters and heights are those of the chess set of ISET3d; the profiles are drawn anew. Pieces
stand on y = 0 with their axes on the y axis; the knight looks along +x.
"""

from __future__ import annotations

import functools

import numpy as np

from isetcl.scene.mesh import Mesh
from isetcl.scene.solid import extruded_mesh, joined_mesh, lathed_mesh

_SEGMENTS = 48

_Points = tuple[tuple[float, float], ...]


def _ball(height: float, radius: float, from_deg: float, to_deg: float = 90.0) -> _Points:
    """Points of a profile along a ball on the axis, between two latitudes."""
    turn = np.radians(np.linspace(from_deg, to_deg, 12))
    points = np.column_stack([radius * np.cos(turn), height + radius * np.sin(turn)])
    if to_deg == 90.0:
        points[-1, 0] = 0.0
    return tuple((float(r), float(h)) for r, h in points)


# Radius and height, mm, from the foot upwards.
_PROFILES_MM: dict[str, _Points] = {
    "pawn": (
        *((6.4, 0.0), (6.4, 1.6), (5.7, 2.6), (5.0, 3.4), (3.6, 4.8), (2.6, 8.0), (2.1, 13.0)),
        *((3.6, 14.2), (3.6, 15.0), (2.2, 15.7)),
        *_ball(19.2, 4.0, -55.0),
    ),
    "rook": (
        *((7.0, 0.0), (7.0, 1.8), (6.2, 3.0), (5.4, 4.0), (4.4, 6.0), (3.9, 12.0), (3.9, 18.0)),
        *((5.2, 20.5), (5.2, 26.7), (3.6, 26.7), (3.6, 24.0)),
    ),
    "knight": (*((7.45, 0.0), (7.45, 2.0), (6.4, 3.2), (5.8, 4.4), (5.2, 6.0), (5.0, 8.0)),),
    "bishop": (
        *((7.5, 0.0), (7.5, 2.0), (6.4, 3.2), (5.6, 4.2), (4.2, 6.0), (3.0, 11.0), (2.4, 19.0)),
        *((2.2, 24.0), (4.2, 25.5), (4.2, 26.4), (2.4, 27.3), (3.2, 28.6), (3.7, 30.4)),
        *((3.5, 32.6), (2.6, 35.0), (1.3, 36.9)),
        *_ball(38.1, 1.2, -40.0),
    ),
    "queen": (
        *((8.3, 0.0), (8.3, 2.2), (7.0, 3.6), (6.0, 4.8), (4.4, 7.0), (3.2, 13.0), (2.6, 22.0)),
        *((2.4, 27.0), (4.6, 28.6), (4.6, 29.6), (2.8, 30.6), (3.4, 33.0), (5.0, 38.4)),
        *((3.4, 39.2), (1.6, 39.4)),
        *_ball(40.6, 1.5, -40.0),
    ),
    "king": (
        *((8.5, 0.0), (8.5, 2.2), (7.2, 3.6), (6.2, 4.8), (4.6, 7.0), (3.4, 13.0), (2.8, 22.0)),
        *((2.6, 28.0), (4.8, 29.6), (4.8, 30.6), (3.0, 31.6), (3.6, 34.0), (4.9, 39.2)),
        *((4.0, 40.3), (2.0, 41.1), (0.0, 41.4)),
    ),
}

_HORSE_MM = (
    *((-4.4, 7.5), (4.4, 7.5), (4.2, 12.5), (2.6, 16.5), (1.8, 19.6), (3.6, 19.4), (5.2, 18.8)),
    *((6.8, 19.6), (7.0, 21.5), (5.2, 25.0), (3.2, 28.5), (1.2, 31.0), (-0.2, 33.3)),
    *((-0.9, 30.8), (-3.2, 26.5), (-4.9, 20.0), (-5.2, 13.0)),
)
_HORSE_THICKNESS_MM = 6.0

# A cross on the king: half width, height and thickness of its bars.
_CROSS_MM = (
    *((-0.7, 41.0), (0.7, 41.0), (0.7, 43.6), (2.3, 43.6), (2.3, 45.0), (0.7, 45.0), (0.7, 47.4)),
    *((-0.7, 47.4), (-0.7, 45.0), (-2.3, 45.0), (-2.3, 43.6), (-0.7, 43.6)),
)
_CROSS_THICKNESS_MM = 1.4

PIECES = tuple(_PROFILES_MM)
"""Names of the pieces."""


@functools.cache
def chess_piece(name: str) -> Mesh:
    """The mesh of one of `PIECES`, metres."""
    turned = lathed_mesh(np.array(_PROFILES_MM[name]) * 1e-3, segments=_SEGMENTS)
    if name == "knight":
        return joined_mesh(turned, _board_cut(_HORSE_MM, _HORSE_THICKNESS_MM))
    if name == "king":
        return joined_mesh(turned, _board_cut(_CROSS_MM, _CROSS_THICKNESS_MM))
    return turned


def _board_cut(outline_mm: _Points, thickness_mm: float) -> Mesh:
    """An outline in the plane x, y cut from a board, with flat normals at corners of its own."""
    cut = extruded_mesh([np.array(outline_mm) * 1e-3], thickness_mm * 1e-3)
    corners = cut.triangles_m
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    faces = np.arange(3 * len(corners)).reshape(-1, 3)
    return Mesh(corners.reshape(-1, 3), faces, np.repeat(normals, 3, axis=0))

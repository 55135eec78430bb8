"""A chess set: the paper's scene for depth of field."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from isetcl.errors import InvalidInputError, check_choice, check_positive, check_type
from isetcl.scene.light import DistantLight
from isetcl.scene.material import Coated, Diffuse, Material
from isetcl.scene.mesh import Instance, Mesh
from isetcl.scene.model import Quad, Scene, SceneObject
from isetcl.scene.solid import box_mesh
from isetcl.scene.targets.chess_pieces import chess_piece
from isetcl.scene.texture import Checkerboard
from isetcl.spectrum import Spectrum

Finish = Literal["matt", "varnished"]

SQUARE_M = 0.0236
"""Side of a square (ISET3d, chessSet); the board of eight is 189 mm wide."""

START = "rnbqkbnr/pppppppp/8/8/8/8/PPPPPPPP/RNBQKBNR"
"""The start of a game, in Forsyth-Edwards notation."""

_PIECE_OF = {
    "p": "pawn",
    "r": "rook",
    "n": "knight",
    "b": "bishop",
    "q": "queen",
    "k": "king",
}
_EYE_ABOVE_BOARD_M = 0.0881
_BORDER_M, _THICKNESS_M, _SEAM_M = 0.008, 0.0048, 1e-4
_SUN_TOWARDS = (-0.5, 1.0, 0.6)
_VARNISH_ROUGHNESS = 0.1


def chess_set(
    distance_m: float = 0.5,
    position: str = START,
    *,
    eye_height_m: float = _EYE_ABOVE_BOARD_M,
    finish: Finish = "matt",
    luminance_cd_m2: float = 100.0,
) -> Scene:
    """A small wooden chess set on a table: the paper's Figures 1 and 7.

    White sits on the side of the eye. Half of the light on the table comes from all around, half
    from the upper left; both are equal-energy light. Objects are called "white pawn e2", "board",
    "frame" and "table".

    Parameters
    ----------
    distance_m
        From the corneal vertex to the middle of the board, along the axis.
    position
        Where the pieces stand: the first field of Forsyth-Edwards notation.
    eye_height_m
        Height of the eye above the board.
    finish
        ``"matt"`` or ``"varnished"``, the latter with a clear coat.
    luminance_cd_m2
        Of a perfect white lying free on the table.

    Raises
    ------
    InvalidInputError
        If the position is not legible, or a number breaks its rule.

    Notes
    -----
    Source of the sizes: ISET3d (chessSet); the pieces are simplified.
    """
    distance = check_positive("distance_m", distance_m, "m")
    level = -check_positive("eye_height_m", eye_height_m, "m")
    check_choice("finish", finish, ("matt", "varnished"))
    light, dark = _wood(0.30, 0.75, "light wood"), _wood(0.03, 0.20, "dark wood")
    woods = {"white": _finished(light, finish), "black": _finished(dark, finish)}
    half = 4.0 * SQUARE_M
    board = Quad((-half, level, half - distance), (2 * half, 0, 0), (0, 0, -2 * half))
    # The square at the lower left, a1, is dark: the first field of the texture.
    squares = Checkerboard(4, 4, bright=0.25, dark=1.0)
    objects = [
        SceneObject("board", board, _finished(light, finish, squares)),
        SceneObject("frame", _frame(level, distance), woods["black"]),
        SceneObject("table", _table(level, distance), Diffuse(Spectrum.constant(0.3, "table"))),
    ]
    for side, piece, square, file, rank in _placed(position):
        x, z = (file - 3.5) * SQUARE_M, (3.5 - rank) * SQUARE_M - distance
        matrix = _standing(x, level, z, 90.0 if side == "white" else -90.0)
        shape = Instance(chess_piece(piece), matrix)
        objects.append(SceneObject(f"{side} {piece} {square}", shape, woods[side]))
    white = Spectrum.equal_energy(luminance_cd_m2)
    slope = _SUN_TOWARDS[1] / math.sqrt(sum(c * c for c in _SUN_TOWARDS))
    sun = DistantLight(_SUN_TOWARDS, white.scaled(0.5 * math.pi / slope))
    return Scene(tuple(objects), white.scaled(0.5), "chess set", (sun,))


def _wood(blue: float, red: float, name: str) -> Spectrum:
    """A reflectance that rises evenly from 400 to 700 nm, about as that of wood does."""
    nodes = np.array([360.0, 400.0, 700.0, 830.0])
    return Spectrum(nodes, np.array([blue, blue, red, red]), name)


def _finished(wood: Spectrum, finish: str, texture: Checkerboard | None = None) -> Material:
    if finish == "matt":
        return Diffuse(wood, texture)
    return Coated(wood, texture, roughness=_VARNISH_ROUGHNESS)


def _frame(level: float, distance: float) -> Mesh:
    reach = 4.0 * SQUARE_M + _BORDER_M
    low = (-reach, level - _THICKNESS_M, -distance - reach)
    return box_mesh(low, (reach, level - _SEAM_M, reach - distance))


def _table(level: float, distance: float) -> Quad:
    return Quad((-1.0, level - _THICKNESS_M, 1.0 - distance), (2.0, 0, 0), (0, 0, -3.0))


def _standing(x: float, y: float, z: float, turn_deg: float) -> np.ndarray:
    """The place of a piece: turned about the vertical, then moved."""
    c, s = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
    return np.array([[c, 0, s, x], [0, 1, 0, y], [-s, 0, c, z], [0, 0, 0, 1.0]])


def _placed(position: str) -> list[tuple[str, str, str, int, int]]:
    """Side, piece, name of the square, file and rank (0 to 7) of every piece."""
    check_type("position", position, str)
    ranks = position.split("/")
    placed = []
    for i, row in enumerate(ranks):
        rank, file = 7 - i, 0
        for sign in row:
            if sign in "12345678":
                file += int(sign)
                continue
            if sign.lower() not in _PIECE_OF or file > 7:
                file = 9
                break
            side = "white" if sign.isupper() else "black"
            square = f"{'abcdefgh'[file]}{rank + 1}"
            placed.append((side, _PIECE_OF[sign.lower()], square, file, rank))
            file += 1
        if file != 8 or len(ranks) != 8:
            raise InvalidInputError(
                "position must be eight ranks of eight squares in Forsyth-Edwards notation, such "
                f"as {START!r}, got {position!r}"
            )
    return placed

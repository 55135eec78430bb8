"""The Cornell box, as measured."""

from __future__ import annotations

import numpy as np

from isetcl.scene.material import Diffuse, Emission
from isetcl.scene.mesh import Mesh
from isetcl.scene.model import Quad, Scene, SceneObject
from isetcl.scene.solid import extruded_mesh
from isetcl.scene.targets.paints import cornell_paints
from isetcl.spectrum import Spectrum

# Corners in mm: x to the left, y up, z away from the opening.
_CAMERA = (278.0, 273.0, -800.0)
_WALLS = {
    "floor": ("white", ((552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2))),
    "ceiling": (
        "white",
        ((556, 548.8, 0), (556, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0)),
    ),
    "back wall": (
        "white",
        ((549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556, 548.8, 559.2)),
    ),
    "right wall": ("green", ((0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2))),
    "left wall": (
        "red",
        ((552.8, 0, 0), (549.6, 0, 559.2), (556, 548.8, 559.2), (556, 548.8, 0)),
    ),
}
_BLOCKS = {
    "short block": (165.0, ((130, 65), (82, 225), (240, 272), (290, 114))),
    "tall block": (330.0, ((423, 247), (265, 296), (314, 456), (472, 406))),
}
_TWO_TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])
_LAMP_X, _LAMP_Z, _LAMP_Y = (213.0, 343.0), (227.0, 332.0), 548.8
_LAMP_BELOW_CEILING = 0.5
_LAMP_NM, _LAMP_VALUES = (400.0, 500.0, 600.0, 700.0), (0.0, 8.0, 15.6, 18.4)


def cornell_box(lamp_luminance_cd_m2: float = 2000.0) -> Scene:
    """The Cornell box with its two blocks: measured paints, lamp and sizes; 400 to 700 nm.

    The eye stands where the camera of the original stood, 0.8 m before the open side, and sees the
    box (0.55 m wide) under 38 degrees.

    Parameters
    ----------
    lamp_luminance_cd_m2
        Luminance of the lamp in the ceiling, which shines downwards.

    Raises
    ------
    InvalidInputError
        If the luminance is not positive.

    Notes
    -----
    Source: Cornell University Program of Computer Graphics, Cornell Box Data. The lamp hangs half a
    millimetre below the ceiling, which has no hole here.
    """
    lamp = Spectrum(np.array(_LAMP_NM), np.array(_LAMP_VALUES), "Cornell lamp")
    glow = Emission(lamp.with_luminance(lamp_luminance_cd_m2), sides="front")
    objects = [SceneObject("lamp", _lamp(), glow)]
    paints = {name: Diffuse(spectrum) for name, spectrum in cornell_paints().items()}
    for name, (colour, corners) in _WALLS.items():
        mesh = Mesh(_in_world(np.array(corners, dtype=float)), _TWO_TRIANGLES)
        objects.append(SceneObject(name, mesh, paints[colour]))
    for name, (height, base) in _BLOCKS.items():
        objects.append(SceneObject(name, _block(height, np.array(base)), paints["white"]))
    return Scene(tuple(objects), None, "Cornell box")


def _in_world(points_mm: np.ndarray) -> np.ndarray:
    """Metres before an eye in the place of the camera: half a turn about the vertical."""
    return (points_mm - _CAMERA) * [-1e-3, 1e-3, -1e-3]


def _lamp() -> Quad:
    y = _LAMP_Y - _LAMP_BELOW_CEILING
    corner, along_x, along_z = _in_world(
        np.array(
            [
                (_LAMP_X[0], y, _LAMP_Z[0]),
                (_LAMP_X[1], y, _LAMP_Z[0]),
                (_LAMP_X[0], y, _LAMP_Z[1]),
            ]
        )
    )
    # The order of the edges makes the lamp face down.
    return Quad(tuple(corner), tuple(along_x - corner), tuple(along_z - corner))


def _block(height_mm: float, base_mm: np.ndarray) -> Mesh:
    """A prism on the floor, from its base (x, z)."""
    ground = np.column_stack([base_mm[:, 0], np.zeros(4), base_mm[:, 1]])
    base = _in_world(ground)
    height = height_mm * 1e-3
    prism = extruded_mesh([np.column_stack([base[:, 0], -base[:, 2]])], height, "block")
    # Lay the outline on the floor: its y runs along -z, its thickness upwards.
    matrix = np.array(
        [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, base[0, 1] + height / 2.0],
            [0.0, -1.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
    return prism.moved(matrix)

"""Pieces of a scene file: a mesh, where it stands, and how it looks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.scene.assets import Assets
from isetcl.scene.mesh import Instance, Mesh
from isetcl.scene.model import SceneObject
from isetcl.scene.surface import Surface


@dataclass(frozen=True, eq=False)
class Part:
    """A mesh with a name, a map to the world (4, 4) and a look. A mesh may stand in many parts."""

    name: str
    mesh: Mesh
    matrix: np.ndarray
    surface: Surface


def quaternion_matrix(quaternion: np.ndarray) -> np.ndarray:
    """The rotation matrix of a quaternion (x, y, z, w) of any length > 0."""
    x, y, z, w = (float(q) for q in np.asarray(quaternion).reshape(4))
    square = x * x + y * y + z * z + w * w
    if not square > 0.0:
        raise ValueError("a rotation is (0, 0, 0, 0)")
    s = 2.0 / square
    return np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
            [s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)],
            [s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)],
        ]
    )


def assemble(parts: list[Part], scale: float, assets: Assets) -> tuple[SceneObject, ...]:
    """Scene objects with different names; a mesh that stands in many places becomes instances.

    A map that flattens hides the part.
    """
    counts: dict[int, int] = {}
    for part in parts:
        counts[id(part.mesh)] = counts.get(id(part.mesh), 0) + 1
    names: dict[str, int] = {}
    objects = []
    for part in parts:
        matrix = np.diag([scale, scale, scale, 1.0]) @ part.matrix
        if float(np.linalg.det(matrix[:3, :3])) == 0.0:
            assets.note("parts of no extent (scaled by 0) are left out", part.name)
            continue
        single = counts[id(part.mesh)] == 1
        try:
            shape = part.mesh.moved(matrix) if single else Instance(part.mesh, matrix)
        except InvalidInputError as error:
            raise InvalidInputError(f"part {part.name!r}: {error}") from error
        objects.append(part.surface.object(_unique(part.name, names), shape))
    return tuple(objects)


def _unique(name: str, names: dict[str, int]) -> str:
    """The name, or the name with a number where it was given before."""
    names[name] = names.get(name, 0) + 1
    if names[name] == 1:
        return name
    other = f"{name}.{names[name]}"
    return other if other not in names else _unique(other, names)

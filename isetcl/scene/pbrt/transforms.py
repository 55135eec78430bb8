"""Matrices (4, 4) for column vectors, as PBRT's directives state them."""

from __future__ import annotations

import math

import numpy as np

from isetcl.scene.pbrt.places import Place, wrong


def translation(x: float, y: float, z: float) -> np.ndarray:
    """A shift."""
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def scaling(x: float, y: float, z: float) -> np.ndarray:
    """A scaling along the axes."""
    return np.diag([x, y, z, 1.0])


def rotation(numbers: tuple[float, ...], place: Place) -> np.ndarray:
    """A turn about an axis: degrees, then the axis (Rodrigues' formula)."""
    degrees, x, y, z = numbers
    axis = np.array([x, y, z])
    length = float(np.linalg.norm(axis))
    if not 0 < length < math.inf:
        raise wrong(place, f"the axis of Rotate must not be zero, got {x:g} {y:g} {z:g}")
    a = axis / length
    turn = math.radians(degrees)
    cosine, sine = math.cos(turn), math.sin(turn)
    cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    matrix = np.eye(4)
    matrix[:3, :3] = cosine * np.eye(3) + sine * cross + (1 - cosine) * np.outer(a, a)
    return matrix


def look_at(numbers: tuple[float, ...], place: Place) -> np.ndarray:
    """World to camera: x to the right, y up, z forward (PBRT's left-handed camera)."""
    eye, to, up = (np.array(numbers[i : i + 3]) for i in (0, 3, 6))
    forward = _unit(to - eye, place, "the eye and the point it looks at must differ")
    upward = _unit(up, place, "the up vector must not be zero")
    right = _unit(np.cross(upward, forward), place, "the up vector must not lie along the gaze")
    camera = np.eye(4)
    axes = np.stack([right, np.cross(forward, right), forward])
    camera[:3, :3] = axes
    camera[:3, 3] = -axes @ eye
    return camera


def _unit(vector: np.ndarray, place: Place, rule: str) -> np.ndarray:
    length = float(np.linalg.norm(vector))
    if not 1e-12 < length < math.inf:
        raise wrong(place, f"LookAt: {rule}")
    return vector / length


def stated(numbers: tuple[float, ...], place: Place) -> np.ndarray:
    """The matrix of Transform and ConcatTransform, which list it column by column."""
    matrix = np.array(numbers).reshape(4, 4).T
    if not np.allclose(matrix[3], [0, 0, 0, 1], atol=1e-6):
        raise wrong(place, "the last row of a transform must be 0 0 0 1: nothing is projective")
    matrix[3] = 0, 0, 0, 1
    return matrix


def product(first: np.ndarray, second: np.ndarray, place: Place) -> np.ndarray:
    """The product of two matrices, which must stay finite."""
    with np.errstate(all="ignore"):
        matrix: np.ndarray = first @ second
    if not np.isfinite(matrix).all():
        raise wrong(place, "the transform overflows; scale the scene to metres")
    return matrix


def inverse(matrix: np.ndarray, place: Place) -> np.ndarray:
    """The inverse of a matrix, which must not flatten space."""
    with np.errstate(all="ignore"):
        try:
            result = np.linalg.inv(matrix)
        except np.linalg.LinAlgError:
            result = np.full((4, 4), np.nan)
    if not np.isfinite(result).all() or determinant(matrix) == 0:
        raise wrong(place, "the transform flattens space: no scale may be 0")
    return result


def determinant(matrix: np.ndarray) -> float:
    """Determinant of the linear part, scaled so that its size says how flat the matrix is."""
    linear = matrix[:3, :3]
    columns = np.sqrt(np.sum((linear / (np.abs(linear).max() or 1.0)) ** 2, axis=0))
    if not np.all(columns > 0):
        return 0.0
    value = float(np.linalg.det(linear / (np.abs(linear).max()) / columns))
    return 0.0 if abs(value) < 1e-12 else value


def similarity_scale(matrix: np.ndarray) -> float | None:
    """The scale of a map that keeps angles; None for other maps."""
    linear = matrix[:3, :3]
    largest = float(np.abs(linear).max())
    if largest == 0:
        return None
    gram = (linear / largest).T @ (linear / largest)
    squared = float(np.trace(gram)) / 3.0
    if not np.allclose(gram, squared * np.eye(3), atol=1e-6 * squared):
        return None
    return largest * float(np.sqrt(squared))


def eye_from_world(camera_from_world: np.ndarray, place: Place) -> tuple[np.ndarray, float]:
    """World to the eye's frame (right-handed, looking along -z), and the scale of the camera.

    The eye stands where the camera stands and looks where it looks. PBRT's camera looks along +z
    with x to the right: turning z round makes the frame right-handed and keeps right at right. The
    camera's scale, which changes no picture of a pinhole, is left out, so that lengths stay those
    of the world.
    """
    world_from_camera = inverse(camera_from_world, place)
    linear = camera_from_world[:3, :3]
    scale = similarity_scale(camera_from_world)
    if scale is None:
        u, _, vt = np.linalg.svd(linear)
        turned, scale = u @ vt, float("nan")
    else:
        turned = linear if abs(scale - 1.0) < 1e-15 else linear / scale
    matrix = np.eye(4)
    matrix[:3, :3] = np.diag([1.0, 1.0, -1.0]) @ turned
    matrix[:3, 3] = -matrix[:3, :3] @ world_from_camera[:3, 3]
    return matrix + 0.0, scale


def points_through(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (n, 3) under a map; overflow becomes infinity, which the shapes refuse."""
    with np.errstate(all="ignore"):
        moved: np.ndarray = points @ matrix[:3, :3].T + matrix[:3, 3]
    return moved


def normals_through(matrix: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Unit normals (n, 3) under a map: by the transposed inverse, whatever its handedness."""
    with np.errstate(all="ignore"):
        linear = matrix[:3, :3] / np.abs(matrix[:3, :3]).max()
        turned = normals @ np.linalg.inv(linear)
        length = np.linalg.norm(turned, axis=1, keepdims=True)
        unit: np.ndarray = turned / np.where(length > 0, length, 1.0)
    return unit

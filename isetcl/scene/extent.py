"""Where a scene lies: the box around it, and what stands straight ahead of the eye."""

from __future__ import annotations

import math

import numpy as np

from isetcl.scene.affine import centre_m
from isetcl.scene.mesh import Instance, Mesh
from isetcl.scene.model import Disc, Quad, Scene, SceneObject, Shape, Sphere
from isetcl.scene.view import intersect

_AHEAD = np.array([0.0, 0.0, -1.0])


def box_m(scene: Scene) -> np.ndarray | None:
    """Lowest and highest x, y, z of all objects, metres, (2, 3); None without objects."""
    boxes = [_box(item.shape) for item in scene.objects]
    if not boxes:
        return None
    return np.array([np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)])


def middle_ahead_m(scene: Scene) -> float:
    """Distance of the first surface on the axis of an eye at the origin, metres; inf for none.

    Surfaces that let more than half of the light pass by their opacity are looked through.
    """
    return min((_ahead_m(item) for item in scene.objects), default=math.inf)


def width_deg(scene: Scene) -> float:
    """Field of view, degrees, of a square about the axis that shows all objects; at most 180."""
    box = box_m(scene)
    if box is None:
        return 180.0
    choices = np.stack(np.meshgrid(*box.T, indexing="ij"), axis=-1).reshape(-1, 3)
    if np.any(choices[:, 2] >= 0):
        return 180.0
    angles = np.degrees(np.arctan2(np.abs(choices[:, :2]), -choices[:, 2:]))
    return 2.0 * float(angles.max())


def is_in_view(scene: Scene, fov_deg: tuple[float, float]) -> bool:
    """Whether an object, or the box around it, may reach into a view about the axis."""
    slopes = np.tan(np.radians(np.minimum(fov_deg, 170.0)) / 2.0)
    for item in scene.objects:
        low, high = _box(item.shape)
        if low[2] >= 0:
            continue
        # The far side of the box, or all around where the eye stands beside it or in it.
        reach = -low[2] * slopes
        if np.all(low[:2] <= reach) and np.all(high[:2] >= -reach):
            return True
    return False


def _box(shape: Shape) -> np.ndarray:
    """Lowest and highest corner of a shape, (2, 3)."""
    if isinstance(shape, (Sphere, Disc)):
        reach = np.full(3, shape.radius_m)
        if isinstance(shape, Disc):
            normal = np.array(shape.normal) / np.linalg.norm(shape.normal)
            reach *= np.sqrt(np.maximum(1.0 - normal**2, 0.0))
        return np.array([centre_m(shape) - reach, centre_m(shape) + reach])
    if isinstance(shape, Quad):
        corner, u, v = (np.array(x) for x in (shape.corner_m, shape.edge_u_m, shape.edge_v_m))
        points = np.array([corner, corner + u, corner + v, corner + u + v])
    elif isinstance(shape, Instance):
        low, high = _box(shape.mesh)
        corners = np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3)
        points = corners @ shape.matrix[:3, :3].T + shape.matrix[:3, 3]
    else:
        points = shape.vertices_m
    return np.array([points.min(axis=0), points.max(axis=0)])


def _ahead_m(item: SceneObject) -> float:
    if isinstance(item.opacity, (int, float)) and item.opacity < 0.5:
        return math.inf
    shape = item.shape
    if not isinstance(shape, (Mesh, Instance)):
        return float(intersect(shape, np.zeros((1, 3)), _AHEAD[None]).distance_m[0])
    low, high = _box(shape)
    if np.any(low[:2] > 0) or np.any(high[:2] < 0) or low[2] > 0:
        return math.inf
    # One ray meets every triangle: building a hierarchy for it would take longer.
    return _ahead_of(shape.in_place if isinstance(shape, Instance) else shape)


def _ahead_of(mesh: Mesh) -> float:
    """Distance of the first triangle on the axis: the one around (0, 0), seen along z."""
    a, b, c = np.moveaxis(mesh.triangles_m, 1, 0)
    wa, wb, wc = _twice_area(b, c), _twice_area(c, a), _twice_area(a, b)
    total = wa + wb + wc
    inside = (np.minimum(np.minimum(wa, wb), wc) >= 0) | (np.maximum(np.maximum(wa, wb), wc) <= 0)
    inside &= total != 0
    if not np.any(inside):
        return math.inf
    depth = wa * a[:, 2] + wb * b[:, 2] + wc * c[:, 2]
    z = depth[inside] / total[inside]
    return float(-z[z < 0].max()) if np.any(z < 0) else math.inf


def _twice_area(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Twice the area of the triangle (0, p, q), seen along z; with its sense."""
    return np.asarray(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])

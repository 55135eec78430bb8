"""Rays against a scene on the host, in float64: what is seen, how far away, and behind it.

Slow and simple: the oracle of the kernels' shapes, the source of depth maps, and the view that PSF
methods start from.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from isetcl.scene.bvh import closest_hits
from isetcl.scene.material import Emission
from isetcl.scene.mesh import Instance, Mesh
from isetcl.scene.model import Disc, Quad, Scene, SceneObject, Shape, Sphere
from isetcl.scene.texture import Image

COINCIDENT = 8.0 * float(np.finfo(np.float64).eps)
"""Relative difference of distances below which two surfaces lie in the same place. The earlier
object is then seen; the kernels have the same rule in their own precision."""


@dataclass(frozen=True, eq=False)
class Hits:
    """Where rays meet one shape: distance along the ray in metres (inf for a miss), and (u, v).

    `is_front` is true where the side is met that the normal points to.
    """

    distance_m: np.ndarray
    u: np.ndarray
    v: np.ndarray
    is_front: np.ndarray


def intersect(shape: Shape, origins_m: np.ndarray, directions: np.ndarray) -> Hits:
    """Hits of rays (..., 3) with a shape; directions are unit vectors, distances positive."""
    if isinstance(shape, Sphere):
        return _intersect_sphere(shape, origins_m, directions)
    if isinstance(shape, Instance):
        shape = shape.in_place
    if isinstance(shape, Mesh):
        return _intersect_mesh(shape, origins_m, directions)
    quad = shape.bounding_quad() if isinstance(shape, Disc) else shape
    hits = _intersect_quad(quad, origins_m, directions)
    if isinstance(shape, Disc):
        outside = (hits.u - 0.5) ** 2 + (hits.v - 0.5) ** 2 >= 0.25
        distance = np.where(outside, np.inf, hits.distance_m)
        return dataclasses.replace(hits, distance_m=distance)
    return hits


def _intersect_quad(quad: Quad, origins: np.ndarray, directions: np.ndarray) -> Hits:
    normal, axis_u, axis_v = plane_axes(quad)
    corner = np.array(quad.corner_m)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = ((corner - origins) @ normal) / (directions @ normal)
        point = origins + distance[..., None] * directions - corner
        u, v = point @ axis_u, point @ axis_v
        hit = (distance > 0) & (u >= 0) & (u < 1) & (v >= 0) & (v < 1)
        is_front = np.broadcast_to(directions @ normal < 0, hit.shape)
    return Hits(
        np.where(hit, distance, np.inf), np.where(hit, u, 0.0), np.where(hit, v, 0.0), is_front
    )


def plane_axes(quad: Quad) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit normal, and the vectors whose products with point - corner are u and v."""
    edge_u, edge_v = np.array(quad.edge_u_m), np.array(quad.edge_v_m)
    normal = np.cross(edge_u, edge_v)
    axis_u = np.cross(edge_v, normal) / np.dot(edge_u, np.cross(edge_v, normal))
    axis_v = np.cross(normal, edge_u) / np.dot(edge_v, np.cross(normal, edge_u))
    return normal / np.linalg.norm(normal), axis_u, axis_v


def _intersect_sphere(sphere: Sphere, origins: np.ndarray, directions: np.ndarray) -> Hits:
    relative = origins - np.array(sphere.centre_m)
    nearest = -np.einsum("...i,...i->...", relative, directions)
    foot = relative + nearest[..., None] * directions
    half2 = sphere.radius_m**2 - np.einsum("...i,...i->...", foot, foot)
    half = np.sqrt(np.maximum(half2, 0.0))
    is_front = nearest - half > 0
    distance = np.where(is_front, nearest - half, nearest + half)
    hit = (half2 > 0) & (distance > 0)
    with np.errstate(invalid="ignore"):
        n = (relative + np.where(hit, distance, 0.0)[..., None] * directions) / sphere.radius_m
    u = np.arctan2(n[..., 0], n[..., 2]) / (2.0 * np.pi) % 1.0
    v = 0.5 + np.arctan2(n[..., 1], np.hypot(n[..., 0], n[..., 2])) / np.pi
    return Hits(np.where(hit, distance, np.inf), u, v, is_front)


def _intersect_mesh(mesh: Mesh, origins: np.ndarray, directions: np.ndarray) -> Hits:
    origins, directions = np.broadcast_arrays(origins, directions)
    distance, triangle, weight = closest_hits(
        mesh.tree, mesh.triangles_m, origins.reshape(-1, 3), directions.reshape(-1, 3)
    )
    uv = np.zeros((len(distance), 2))
    hit = triangle >= 0
    corner_m = mesh.triangles_m[triangle]
    normal = np.cross(corner_m[:, 1] - corner_m[:, 0], corner_m[:, 2] - corner_m[:, 0])
    is_front = np.einsum("ij,ij->i", normal, directions.reshape(-1, 3)) < 0
    if mesh.uv is not None:
        corner = mesh.uv[mesh.faces[triangle[hit]]]
        b, c = weight[hit, :1], weight[hit, 1:]
        uv[hit] = (1 - b - c) * corner[:, 0] + b * corner[:, 1] + c * corner[:, 2]
    shape = origins.shape[:-1]
    parts = (distance, uv[:, 0], uv[:, 1], is_front)
    return Hits(*(part.reshape(shape) for part in parts))


def weights(item: SceneObject, hits: Hits) -> np.ndarray:
    """Texture weights of an object at its hits, shape (..., channels).

    0 where it is missed, or met on a side that sends out no light.
    """
    texture = item.material.texture
    if texture is None:
        values = np.ones((*hits.distance_m.shape, 1))
    else:
        values = texture.weights(hits.u, hits.v)
    lit = np.isfinite(hits.distance_m)
    if isinstance(item.material, Emission) and item.material.sides == "front":
        lit = lit & hits.is_front
    return np.where(lit[..., None], values, 0.0)


def nearest_distance_m(
    scene: Scene, origins_m: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Distance to the first object along each ray (inf for none), and its index (-1 for none)."""
    shape = np.broadcast_shapes(origins_m.shape, directions.shape)[:-1]
    distance = np.full(shape, np.inf)
    index = np.full(shape, -1)
    for i, item in enumerate(scene.objects):
        found = intersect(item.shape, origins_m, directions).distance_m
        closer = found < distance * (1.0 - COINCIDENT)
        distance = np.where(closer, found, distance)
        index = np.where(closer, i, index)
    return distance, index


def outline_points(shape: Shape, origin_m: np.ndarray, count: int) -> np.ndarray:
    """Points (count, 3) along the outline of a shape as seen from a point; none from inside it.

    Of a mesh, `count` of its corners.
    """
    if isinstance(shape, Instance):
        shape = shape.in_place
    if isinstance(shape, Mesh):
        return shape.vertices_m[np.linspace(0, len(shape.vertices_m) - 1, count).astype(int)]
    if isinstance(shape, Sphere):
        centre = np.array(shape.centre_m)
        away = centre - origin_m
        distance2 = float(away @ away)
        if distance2 <= shape.radius_m**2:
            return np.zeros((0, 3))
        share = shape.radius_m**2 / distance2
        radius = shape.radius_m * np.sqrt(1.0 - share)
        return _circle(centre - share * away, away / np.sqrt(distance2), radius, count)
    if isinstance(shape, Disc):
        normal = np.array(shape.normal) / np.linalg.norm(shape.normal)
        return _circle(np.array(shape.centre_m), normal, shape.radius_m, count)
    corner, edge_u, edge_v = (np.array(x) for x in (shape.corner_m, shape.edge_u_m, shape.edge_v_m))
    corners = np.array([corner, corner + edge_u, corner + edge_u + edge_v, corner + edge_v, corner])
    along = np.linspace(0.0, 4.0, count, endpoint=False)
    side = along.astype(int)
    part = (along - side)[:, None]
    return corners[side] * (1.0 - part) + corners[side + 1] * part


def _circle(centre: np.ndarray, normal: np.ndarray, radius: float, count: int) -> np.ndarray:
    helper = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = np.cross(normal, helper)
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    turn = np.arange(count) * (2.0 * np.pi / count)
    return centre + radius * (np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * second)


def texels_across(shape: Shape, image: Image, nearest_m: float, angle_rad: float) -> float:
    """Texels of a shape's picture across a cone of rays of an angle, at a distance in metres.

    Of a picture that is repeated over the shape or stretched, in its coarser direction.
    """
    rows, columns = image.shape
    if isinstance(shape, Instance):
        shape = shape.in_place
    if isinstance(shape, Mesh):
        texel_m = _texel_of_mesh(shape, rows * columns)
    elif isinstance(shape, Sphere):
        texel_m = shape.radius_m * np.pi * max(2.0 / columns, 1.0 / rows)
    else:
        quad = shape.bounding_quad() if isinstance(shape, Disc) else shape
        _, axis_u, axis_v = plane_axes(quad)
        texel_m = max(
            1.0 / (columns * float(np.linalg.norm(axis_u))),
            1.0 / (rows * float(np.linalg.norm(axis_v))),
        )
    return float(nearest_m * angle_rad / texel_m * min(abs(r) for r in image.repeats))


def _texel_of_mesh(mesh: Mesh, texels: int) -> float:
    """Mean width of a texel on a mesh, metres; infinite without texture coordinates."""
    if mesh.uv is None:
        return float("inf")
    a, b, c = (mesh.triangles_m[:, k] for k in range(3))
    area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    corner = mesh.uv[mesh.faces]
    e1, e2 = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    uv_area = float(np.abs(e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]).sum())
    return float(np.sqrt(area / (uv_area * texels))) if uv_area > 0 else float("inf")

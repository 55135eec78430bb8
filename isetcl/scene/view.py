"""Rays against a scene on the host, in float64: what is seen, how far away, and behind it.

Slow and simple: the oracle of the kernels' shapes, the source of depth maps, and the view that PSF
methods start from.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isetcl.scene.model import Disc, Quad, Scene, SceneObject, Shape, Sphere


@dataclass(frozen=True, eq=False)
class Hits:
    """Where rays meet one shape: distance along the ray in metres (inf for a miss), and (u, v)."""

    distance_m: np.ndarray
    u: np.ndarray
    v: np.ndarray


def intersect(shape: Shape, origins_m: np.ndarray, directions: np.ndarray) -> Hits:
    """Hits of rays (..., 3) with a shape; directions are unit vectors, distances positive."""
    if isinstance(shape, Sphere):
        return _intersect_sphere(shape, origins_m, directions)
    quad = shape.bounding_quad() if isinstance(shape, Disc) else shape
    hits = _intersect_quad(quad, origins_m, directions)
    if isinstance(shape, Disc):
        outside = (hits.u - 0.5) ** 2 + (hits.v - 0.5) ** 2 >= 0.25
        return Hits(np.where(outside, np.inf, hits.distance_m), hits.u, hits.v)
    return hits


def _intersect_quad(quad: Quad, origins: np.ndarray, directions: np.ndarray) -> Hits:
    normal, axis_u, axis_v = plane_axes(quad)
    corner = np.array(quad.corner_m)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = ((corner - origins) @ normal) / (directions @ normal)
        point = origins + distance[..., None] * directions - corner
        u, v = point @ axis_u, point @ axis_v
        hit = (distance > 0) & (u >= 0) & (u < 1) & (v >= 0) & (v < 1)
    return Hits(np.where(hit, distance, np.inf), np.where(hit, u, 0.0), np.where(hit, v, 0.0))


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
    distance = np.where(nearest - half > 0, nearest - half, nearest + half)
    hit = (half2 > 0) & (distance > 0)
    with np.errstate(invalid="ignore"):
        n = (relative + np.where(hit, distance, 0.0)[..., None] * directions) / sphere.radius_m
    u = np.arctan2(n[..., 0], n[..., 2]) / (2.0 * np.pi) % 1.0
    v = 0.5 + np.arctan2(n[..., 1], np.hypot(n[..., 0], n[..., 2])) / (2.0 * np.pi)
    return Hits(np.where(hit, distance, np.inf), u, v)


def weights(item: SceneObject, hits: Hits) -> np.ndarray:
    """Texture weights of an object at its hits, shape (..., channels); 0 where it is missed."""
    texture = item.material.texture
    if texture is None:
        values = np.ones((*hits.distance_m.shape, 1))
    else:
        values = texture.weights(hits.u, hits.v)
    return np.where(np.isfinite(hits.distance_m)[..., None], values, 0.0)


def nearest_distance_m(
    scene: Scene, origins_m: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Distance to the first object along each ray (inf for none), and its index (-1 for none)."""
    shape = np.broadcast_shapes(origins_m.shape, directions.shape)[:-1]
    distance = np.full(shape, np.inf)
    index = np.full(shape, -1)
    for i, item in enumerate(scene.objects):
        found = intersect(item.shape, origins_m, directions).distance_m
        closer = found < distance
        distance = np.where(closer, found, distance)
        index = np.where(closer, i, index)
    return distance, index

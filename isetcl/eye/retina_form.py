"""The form of a retina: its normals, lengths along it, and the relief that lies on it.

A relief (`HeightMap`) is too rough for the smooth maps that label retinal points. Points are
labelled on the retina without it and then moved along the retina's own axis onto it.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from isetcl.eye.prescription import Element, ElementKind
from isetcl.eye.retina import Retina
from isetcl.eye.sequential import intersect
from isetcl.eye.shapes.height_map import HeightMap
from isetcl.eye.surface import form_quadric

_ARC_NODES = 24


def relief(retina: Retina) -> HeightMap | None:
    """The height map that lies on a retina, if any."""
    return retina.shape if isinstance(retina.shape, HeightMap) else None


def without_relief(retina: Retina) -> Retina:
    """The retina that labels points."""
    return retina if relief(retina) is None else dataclasses.replace(retina, shape=None)


def retina_element(retina: Retina) -> Element:
    """The retina as something rays meet."""
    return Element(
        ElementKind.RETINA,
        "retina",
        retina.vertex_z_mm,
        retina.curvature,
        retina.conic,
        float("inf"),
        1.0,
        1.0,
        retina.shape,
        retina.placement,
    )


def onto_relief(retina: Retina, point_mm: np.ndarray) -> np.ndarray:
    """Points (n, 3), mm, of the retina without relief, moved onto it along the retina's axis."""
    return _shifted(retina, point_mm, 1.0)


def off_relief(retina: Retina, point_mm: np.ndarray) -> np.ndarray:
    """The inverse of `onto_relief`."""
    return _shifted(retina, point_mm, -1.0)


def _shifted(retina: Retina, point_mm: np.ndarray, sense: float) -> np.ndarray:
    map_of_heights = relief(retina)
    if map_of_heights is None:
        return point_mm
    element = retina_element(retina)
    local, _ = element.enter(point_mm, point_mm)
    height, _, _ = map_of_heights.departure(local[:, 0], local[:, 1])
    return lifted(retina, point_mm, sense * height)


def lifted(retina: Retina, point_mm: np.ndarray, height_mm: np.ndarray | float) -> np.ndarray:
    """Points (n, 3), mm, moved along the retina's axis by heights, mm."""
    axis = np.array([0.0, 0.0, 1.0])
    if retina.placement is not None:
        axis = retina.placement.rotation @ axis
    return np.asarray(point_mm + np.asarray(height_mm)[..., None] * axis)


def retinal_normal(retina: Retina, point_mm: np.ndarray) -> np.ndarray:
    """Unit normals, (n, 3), away from the lens, at points (n, 3) of a retina, mm, eye frame."""
    element = retina_element(retina)
    local, _ = element.enter(point_mm, point_mm)
    if retina.shape is None:
        _, slope = form_quadric(retina.curvature, retina.conic, None).implicit(*local.T)
    else:
        _, slope = retina.shape.implicit(retina.curvature, retina.conic, *local.T)
    _, slope = element.leave(local, slope)
    return np.asarray(slope / np.linalg.norm(slope, axis=-1, keepdims=True))


def arc_coordinates_mm(retina: Retina, middle_z_mm: float, point_mm: np.ndarray) -> np.ndarray:
    """Lengths along a retina, polar about where the axis of the eye meets it, (n, 2), mm.

    A point at azimuth phi about the axis lies at L (cos phi, sin phi), with L the length of the
    retina's section at phi from the axis to the point. The section is followed by the angle at a
    point of the axis inside the eye, `middle_z_mm`.

    Parameters
    ----------
    point_mm
        Points of the retina, (n, 3), mm, eye frame.
    """
    offset = point_mm - np.array([0.0, 0.0, middle_z_mm])
    across = np.hypot(offset[:, 0], offset[:, 1])
    angle = np.arctan2(across, offset[:, 2])
    unit = offset[:, :2] / np.where(across > 0, across, 1.0)[:, None]
    nodes, weights = np.polynomial.legendre.leggauss(_ARC_NODES)
    turn = (angle[:, None] * (nodes + 1.0) / 2.0).ravel()
    towards = np.repeat(unit, _ARC_NODES, axis=0)
    sine, cosine = np.sin(turn), np.cos(turn)
    ray = np.concatenate([towards * sine[:, None], cosine[:, None]], axis=1)
    round_ = np.concatenate([towards * cosine[:, None], -sine[:, None]], axis=1)
    start = np.broadcast_to([0.0, 0.0, middle_z_mm], ray.shape)
    crossing = intersect(start, ray, retina_element(retina), 1.0)
    slope = crossing.gradient
    # Along the section r'(t) = -r (g . round) / (g . ray).
    tangent = np.sum(slope * round_, axis=1) / np.sum(slope * ray, axis=1)
    speed = (crossing.length * np.sqrt(1.0 + tangent**2)).reshape(-1, _ARC_NODES)
    length = angle / 2.0 * (speed @ weights)
    return np.asarray(length[:, None] * unit)

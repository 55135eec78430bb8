"""Steps along the retina as visual angles: what a small displacement looks like from inside."""

from __future__ import annotations

import math

import numpy as np

from isetcl.eye.field import FieldMap
from isetcl.eye.field_plane import FieldPlane, visual_angle_steps
from isetcl.eye.retina import Retina


def retinal_scale(
    retina: Retina, chief_map: FieldMap | FieldPlane, field_deg: tuple[float, float]
) -> np.ndarray:
    """Steps along the retina of a degree of visual angle to the right and up, mm, (2, 3)."""
    if isinstance(chief_map, FieldPlane):
        return visual_angle_steps(field_deg) @ chief_map.slopes_mm_per_deg(field_deg)
    angle = math.hypot(*field_deg)
    c, s = (field_deg[0] / angle, field_deg[1] / angle) if angle > 0 else (1.0, 0.0)
    point = chief_map.retinal_point_mm(np.array(field_deg[0]), np.array(field_deg[1]))
    kappa = 1.0 + retina.conic
    normal = np.array(
        [
            -retina.curvature * point[0],
            -retina.curvature * point[1],
            1.0 - kappa * retina.curvature * (point[2] - retina.vertex_z_mm),
        ]
    )
    normal /= np.linalg.norm(normal)
    sagittal = np.array([s, -c, 0.0])
    tangential = np.cross(sagittal, normal)
    radial = float(chief_map.mm_per_deg(angle))
    around = radial
    if angle > 1e-6:
        around = float(chief_map.height_mm(angle)) / math.degrees(math.sin(math.radians(angle)))
    t, r = radial * tangential, around * sagittal
    return np.stack([c * t - s * r, s * t + c * r])


def visual_angle_deg(offset_mm: np.ndarray, mm_per_deg: np.ndarray) -> np.ndarray:
    """Offsets (n, 3) on the retina as visual angles to the right and up, degrees, (n, 2)."""
    inverse = np.linalg.inv(mm_per_deg @ mm_per_deg.T)
    return np.asarray(offset_mm @ mm_per_deg.T @ inverse)

"""How far away what each retinal pixel looks at is."""

from __future__ import annotations

import numpy as np

from isetcl.eye.field import direction_from_field
from isetcl.retina.grid import RetinalGrid
from isetcl.scene.model import Scene
from isetcl.scene.view import nearest_distance_m
from isetcl.units import MM_PER_M

_RAYS_AT_ONCE = 1 << 20


def vergence_map(scene: Scene, grid: RetinalGrid) -> np.ndarray:
    """Vergence (1/m, along the axis from the cornea) of the nearest object in each direction.

    Seen along the chief rays of the pixel centres; 0 where there is nothing. Shape (rows, columns).
    """
    rows, columns = grid.shape
    result = np.zeros((rows, columns))
    block = max(1, _RAYS_AT_ONCE // columns)
    for top in range(0, rows, block):
        x, y = np.meshgrid(grid.x_deg, grid.y_deg[top : top + block])
        directions = direction_from_field(x, y)
        origins = grid.field_map.entrance_mm(x, y) / MM_PER_M
        origin_z = origins[..., 2]
        distance, _ = nearest_distance_m(scene, origins, directions)
        with np.errstate(invalid="ignore"):
            depth = -(origin_z + distance * directions[..., 2])
        ahead = np.isfinite(depth) & (depth > 0)
        result[top : top + block] = np.where(ahead, 1.0 / np.where(ahead, depth, 1.0), 0.0)
    return result

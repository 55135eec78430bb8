"""Procedural scenes: `isetcl.scenes`.

All stand in front of the eye, which sits at the origin and looks along -z. Sizes are in metres,
angles in degrees; luminances are those of the white parts.
"""

from isetcl.scene.targets.edge import slanted_edge
from isetcl.scene.targets.multi_plane import (
    depth_blend_weights,
    depth_blended_images,
    multi_plane_display,
)
from isetcl.scene.targets.planes import (
    FIGURE_12_CHECK_M,
    PatternName,
    image_plane,
    image_planes,
    picture,
    two_planes,
    uniform,
)
from isetcl.scene.targets.points import point_grid, point_source
from isetcl.scene.text import text_image

__all__ = [
    "FIGURE_12_CHECK_M",
    "PatternName",
    "depth_blend_weights",
    "depth_blended_images",
    "image_plane",
    "image_planes",
    "multi_plane_display",
    "picture",
    "point_grid",
    "point_source",
    "slanted_edge",
    "text_image",
    "two_planes",
    "uniform",
]

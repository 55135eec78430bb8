"""Procedural scenes: `isetcl.scenes`.

All stand in front of the eye, which sits at the origin and looks along -z. Sizes are in metres,
angles in degrees; luminances are those of the white parts.
"""

from isetcl.scene.targets.acuity import SNELLEN_ROWS, snellen_chart
from isetcl.scene.targets.charts import macbeth_chart, siemens_star, tca_grid, textured_plane
from isetcl.scene.targets.chess import chess_set
from isetcl.scene.targets.cornell import cornell_box
from isetcl.scene.targets.edge import slanted_edge
from isetcl.scene.targets.letters import letters_at_depth, numbers_at_depth
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
    "SNELLEN_ROWS",
    "PatternName",
    "chess_set",
    "cornell_box",
    "depth_blend_weights",
    "depth_blended_images",
    "image_plane",
    "image_planes",
    "letters_at_depth",
    "macbeth_chart",
    "multi_plane_display",
    "numbers_at_depth",
    "picture",
    "point_grid",
    "point_source",
    "siemens_star",
    "slanted_edge",
    "snellen_chart",
    "tca_grid",
    "text_image",
    "textured_plane",
    "two_planes",
    "uniform",
]

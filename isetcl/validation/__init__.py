"""How far an image is from the truth, and what it cost."""

from isetcl.retina.depth_edges import occlusion_strip
from isetcl.validation import stability, stats
from isetcl.validation.comparison import Comparison, Trial, compare
from isetcl.validation.occlusion import (
    OcclusionError,
    RegionError,
    occlusion_error,
)
from isetcl.validation.slanted_edge import Edge, SlantedEdgeMtf, slanted_edge_mtf
from isetcl.validation.work_precision import (
    Reference,
    SceneMethod,
    WorkMethod,
    WorkPrecision,
    work_precision,
)

__all__ = [
    "Comparison",
    "Edge",
    "OcclusionError",
    "Reference",
    "RegionError",
    "SceneMethod",
    "SlantedEdgeMtf",
    "Trial",
    "WorkMethod",
    "WorkPrecision",
    "compare",
    "occlusion_error",
    "occlusion_strip",
    "slanted_edge_mtf",
    "stability",
    "stats",
    "work_precision",
]

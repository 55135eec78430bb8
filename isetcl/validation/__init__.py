"""How far an image is from the truth, and what it cost."""

from isetcl.retina.depth_edges import occlusion_strip
from isetcl.validation import stability, stats
from isetcl.validation.comparison import Comparison, Trial, compare
from isetcl.validation.measured_tca import MeasuredTca, measured_tca
from isetcl.validation.occlusion import (
    OcclusionError,
    RegionError,
    occlusion_error,
)
from isetcl.validation.occlusion_study import OcclusionStudy, occlusion_study
from isetcl.validation.slanted_edge import slanted_edge_mtf
from isetcl.validation.slanted_edge_result import Edge, SlantedEdgeMtf
from isetcl.validation.three_mtfs import ThreeMtfs, three_mtfs
from isetcl.validation.work_precision import (
    NoisyTimingError,
    Reference,
    SceneMethod,
    WorkMethod,
    WorkPrecision,
    work_precision,
)

__all__ = [
    "Comparison",
    "Edge",
    "MeasuredTca",
    "NoisyTimingError",
    "OcclusionError",
    "OcclusionStudy",
    "Reference",
    "RegionError",
    "SceneMethod",
    "SlantedEdgeMtf",
    "ThreeMtfs",
    "Trial",
    "WorkMethod",
    "WorkPrecision",
    "compare",
    "measured_tca",
    "occlusion_error",
    "occlusion_strip",
    "occlusion_study",
    "slanted_edge_mtf",
    "stability",
    "stats",
    "three_mtfs",
    "work_precision",
]

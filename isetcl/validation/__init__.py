"""How far an image is from the truth, and what it cost."""

from isetcl.retina.depth_edges import occlusion_strip
from isetcl.validation import stability, stats
from isetcl.validation.comparison import Comparison, Trial, compare
from isetcl.validation.occlusion.error import (
    OcclusionError,
    RegionError,
    occlusion_error,
)
from isetcl.validation.occlusion.study import OcclusionStudy, occlusion_study
from isetcl.validation.transfer.measured_tca import MeasuredTca, measured_tca
from isetcl.validation.transfer.result import Edge, SlantedEdgeMtf
from isetcl.validation.transfer.slanted_edge import slanted_edge_mtf
from isetcl.validation.transfer.three_mtfs import ThreeMtfs, three_mtfs
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

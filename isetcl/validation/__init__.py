"""How far an image is from the truth, and what it cost."""

from isetcl.retina.depth_edges import occlusion_strip
from isetcl.validation import stats
from isetcl.validation.comparison import Comparison, Trial, compare
from isetcl.validation.occlusion import (
    OcclusionError,
    RegionError,
    occlusion_error,
)
from isetcl.validation.occlusion_study import OcclusionStudy, occlusion_study
from isetcl.validation.work_precision import (
    Reference,
    SceneMethod,
    WorkMethod,
    WorkPrecision,
    work_precision,
)

__all__ = [
    "Comparison",
    "OcclusionError",
    "OcclusionStudy",
    "Reference",
    "RegionError",
    "SceneMethod",
    "Trial",
    "WorkMethod",
    "WorkPrecision",
    "compare",
    "occlusion_error",
    "occlusion_strip",
    "occlusion_study",
    "stats",
    "work_precision",
]

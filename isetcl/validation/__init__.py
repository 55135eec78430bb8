"""How far an image is from the truth, and what it cost."""

from isetcl.retina.depth_edges import occlusion_strip
from isetcl.validation import stats
from isetcl.validation.comparison import Comparison, Trial, compare
from isetcl.validation.occlusion import (
    OcclusionError,
    RegionError,
    occlusion_error,
)

__all__ = [
    "Comparison",
    "OcclusionError",
    "RegionError",
    "Trial",
    "compare",
    "occlusion_error",
    "occlusion_strip",
    "stats",
]

"""Error against run time: kinds of error apart, replicates, and times in the steady state."""

from isetcl.validation.work_precision.method import Part, WorkMethod
from isetcl.validation.work_precision.reference import Reference, traced_reference
from isetcl.validation.work_precision.result import WorkPrecision
from isetcl.validation.work_precision.scene_method import SceneMethod
from isetcl.validation.work_precision.study import work_precision
from isetcl.validation.work_precision.timing import Clock, NoisyTimingError

__all__ = [
    "Clock",
    "NoisyTimingError",
    "Part",
    "Reference",
    "SceneMethod",
    "WorkMethod",
    "WorkPrecision",
    "traced_reference",
    "work_precision",
]

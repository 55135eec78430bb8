"""The stability suite: what isetcl computes where others go wrong, on every device.

Each case is a small function that lets the package's own code run on an extreme input and measures
how far off it is: from a formula, from 50 decimal digits, or from float64 arithmetic that is
written differently. `isetcl validate stability` runs them all.
"""

from isetcl.validation.stability.case import Bench, Case, NotApplicableError, Outcome, cases
from isetcl.validation.stability.suite import Report, markdown, run

__all__ = [
    "Bench",
    "Case",
    "NotApplicableError",
    "Outcome",
    "Report",
    "cases",
    "markdown",
    "run",
]

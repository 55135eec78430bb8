"""Logarithmic axes of the figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axis import Axis

_FEW_DECADES = 3.0


def plain_ticks(axis: Axis) -> None:
    """Numbers such as 0.5 and 20; powers of ten alone where there are many."""
    from matplotlib.ticker import LogLocator, NullFormatter

    few = np.ptp(np.log10(axis.get_view_interval())) < _FEW_DECADES
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if few else (1,)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())

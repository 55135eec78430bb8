"""Tables of a medium's index."""

from __future__ import annotations

import numpy as np

from isetcl.eye.media import Medium
from isetcl.scene.tabulated_index import TabulatedIndex

STEP_NM = 5.0


def tabulated(medium: Medium) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths and indices of a medium: its own table, or 360 to 830 nm in steps of 5 nm."""
    if isinstance(medium.dispersion, TabulatedIndex):
        table = medium.dispersion
        return np.array(table.wavelengths_nm), np.array(table.indices)
    low, high = medium.dispersion.range_nm
    grid = np.arange(max(low, 360.0), min(high, 830.0) + 1e-9, STEP_NM)
    return grid, medium.index(grid)

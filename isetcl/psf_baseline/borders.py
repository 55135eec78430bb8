"""What lies beyond the borders of a picture."""

from __future__ import annotations

from typing import Literal

import numpy as np

Border = Literal["reflect", "zero", "replicate"]
BORDERS = ("reflect", "zero", "replicate")


def pixel_index(place: np.ndarray, count: int, border: Border) -> tuple[np.ndarray, np.ndarray]:
    """Pixels that places (in pixels) fall on, continued beyond the border, and which are real."""
    pixel = np.floor(place).astype(int)
    inside = (pixel >= 0) & (pixel < count)
    if border == "reflect":
        turned = pixel % (2 * count)
        return np.minimum(turned, 2 * count - 1 - turned), np.ones_like(inside)
    return np.clip(pixel, 0, count - 1), inside | (border == "replicate")

"""Ways to combine blurred layers into an image, each with the error it must make at depth edges.

Notation: layer k has radiance f_k, coverage m_k (1 where it is seen from the centre of the pupil)
and point spread function P_k; * is convolution. Names M3, M8 ... are those of the survey in the
documentation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np


class Blur(Protocol):
    """Convolution of layer k's coverage or of one of its colour channels with its PSF."""

    def colour(self, layer: int) -> np.ndarray:
        """P_k * (m_k f_k), (basis, rows, columns)."""

    def coverage(self, layer: int) -> np.ndarray:
        """P_k * m_k, (rows, columns)."""

    def total(self, layers: Sequence[int]) -> np.ndarray:
        """Sum of `colour` over layers, (basis, rows, columns)."""


@dataclass(frozen=True)
class Method:
    """A way to combine layers.

    Attributes
    ----------
    name
        Name used in `render`.
    needs_complete_layers
        Whether layers must be known behind what hides them.
    combine
        The function; see `layered_sum`.
    """

    name: str
    needs_complete_layers: bool
    combine: Callable[[Blur, int], np.ndarray]


def layered_sum(blur: Blur, n_layers: int) -> np.ndarray:
    """M3: blur the visible part of every layer and add, L = sum_k P_k * (m_k f_k).

    The method of the paper's Figure 12A. Exact where all layers are equally blurred. At a depth
    edge the blurred parts do not add up to one: light that should be hidden is added and light
    that should be revealed is missing, up to half the contrast of the edge.

    Parameters
    ----------
    blur
        Convolved visible layers, far to near.
    n_layers
        Number of layers.

    Returns
    -------
    ndarray, (basis, rows, columns)
    """
    return blur.total(range(n_layers))


def layered_over(blur: Blur, n_layers: int) -> np.ndarray:
    """M8: composite complete layers back to front, C <- P_k * (m_k f_k) + (1 - P_k * m_k) C.

    Exact where one of two objects is in focus or the far one is uniform. Two overlapping blurred
    textured layers are treated as if seen through independent parts of the pupil, which they are
    not. A slanted surface that is cut into layers darkens where they meet, since their blurred
    edges do not add up to one: a uniform plane in two layers by a quarter.

    Parameters
    ----------
    blur
        Convolved complete layers, far to near.
    n_layers
        Number of layers.

    Returns
    -------
    ndarray, (basis, rows, columns)
    """
    image = blur.colour(0)
    for k in range(1, n_layers):
        image = blur.colour(k) + (1.0 - blur.coverage(k)) * image
    return image


_METHODS = (
    Method("layered_sum", needs_complete_layers=False, combine=layered_sum),
    Method("layered_over", needs_complete_layers=True, combine=layered_over),
)


def methods() -> dict[str, Method]:
    """The methods by name."""
    return {method.name: method for method in _METHODS}

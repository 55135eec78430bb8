"""M7: the image formation model of learned optics."""

from __future__ import annotations

import numpy as np

from isetcl.psf_baseline.methods.blur import Blur

EPSILON = 1e-3
"""Keeps the weights from vanishing. Source: Ikoma et al. 2021, their code."""


def ikoma(blur: Blur, n_layers: int) -> np.ndarray:
    """M7: layers over each other, normalised by everything at or behind each of them.

    E_k = P_k * sum_{j at or behind k} m_j, l_k = P_k * (m_k f_k) / (E_k + e),
    a_k = P_k * m_k / (E_k + e), L = sum_k l_k prod_{j nearer} (1 - a_j), e = 1e-3.

    Ikoma, Nguyen, Metzler, Peng and Wetzstein 2021 (Depth from Defocus with Learned Optics), with
    layers even in inverse depth. It telescopes, so that slanted surfaces keep their light. Known
    failure: hidden content is guessed from what is visible, which is wrong where the foreground is
    blurred; half the contrast. An even scene stays even to e, a thousandth darker; light is not
    conserved.

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
    image = np.zeros_like(blur.layers[0].colour)
    for k in range(n_layers):
        weight = blur.coverage_behind(k) + EPSILON
        image = blur.colour(k) / weight + (1.0 - blur.coverage(k) / weight) * image
    return image

"""M3 to M6 and M8: layers, each blurred by its own PSF, added or put over each other."""

from __future__ import annotations

import numpy as np

from isetcl.psf_baseline.methods.blur import Blur

LEAST_WEIGHT = 1e-3
"""Blurred coverage below which nothing is known of a layer."""


def layered_sum(blur: Blur, n_layers: int) -> np.ndarray:
    """M3: blur the visible part of every layer and add, L = sum_k P_k * (m_k f_k).

    The method of the paper's Figure 12A. Exact where all layers are equally blurred. At a depth
    edge the blurred parts do not add up to one: light that should be hidden is added and light
    that should be revealed is missing, up to half the contrast of the edge. Every point's light is
    conserved; an even scene does not stay even at depth edges.

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


def layered_normalized(blur: Blur, n_layers: int) -> np.ndarray:
    """M4: the sum over the blurred coverage, L = sum_k P_k * (m_k f_k) / sum_k P_k * m_k.

    Common. Known failure: it knows no order, so that a blurred background tints a sharp
    foreground; a third to half of the contrast. An even scene stays even; light is not conserved.

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
    weight = sum(blur.coverage(k) for k in range(n_layers))
    return quotient(blur.total(range(n_layers)), np.asarray(weight))


def layered_over_visible(blur: Blur, n_layers: int) -> np.ndarray:
    """M5: visible layers back to front, C <- P_k * (m_k f_k) + (1 - P_k * m_k) C.

    Layered depth of field without filling (Kraus and Strengert 2007 fill first), and the occlusion
    mode of differentiable-optics packages. Known failure: what a layer hides is missing, so that a
    dark rim follows every depth edge, up to half the contrast. A slanted surface darkens where it
    is cut: a uniform one by a quarter between two layers, to 1 - 1/e of itself in many layers
    thinner than the blur. Conserves neither light nor even scenes.

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
    return _over(blur, n_layers)


def layered_over_normalized(blur: Blur, n_layers: int) -> np.ndarray:
    """M6: as M5, with everything behind a layer divided by its own blurred coverage.

    B <- [P_k * (m_k f_k) + (1 - P_k * m_k) B] / A, A the blurred coverage so far, for all but the
    nearest layer, over which nothing is divided: what is seen of a background is extended under
    what stands before it, as far as its blur reaches. The class of VisSim and of Csoba and
    Kunkli's layered vision simulation. Exact for a sharp foreground before an even background.
    Known failure: a blurred foreground still has a dark rim, since a background that is sharper
    does not reach under it. Light is not conserved, nor an even scene at such edges.

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
    known = np.asarray(blur.coverage(0))
    image = blur.colour(0)
    for k in range(1, n_layers):
        behind = quotient(image, known)
        cover = blur.coverage(k)
        image = blur.colour(k) + (1.0 - cover) * behind
        known = cover + (1.0 - cover) * (known >= LEAST_WEIGHT)
    return image


def layered_over(blur: Blur, n_layers: int) -> np.ndarray:
    """M8: composite complete layers back to front, C <- P_k * (m_k f_k) + (1 - P_k * m_k) C.

    Multi-plane images and layered depth of field with hidden content (Lee et al. 2010, Selgrad et
    al. 2015). Exact where one of two objects is in focus or the far one is uniform. Two overlapping
    blurred textured layers are treated as if seen through independent parts of the pupil, which
    they are not: the error is their covariance over the pupil, at most a quarter of the contrast. A
    slanted surface that is cut into layers darkens where they meet, since their blurred edges do
    not add up to one: a uniform plane in two layers by a quarter. An even scene stays even if its
    farthest layer covers everything; light is not conserved, as it is not where things hide others.

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
    return _over(blur, n_layers)


def _over(blur: Blur, n_layers: int) -> np.ndarray:
    image = blur.colour(0)
    for k in range(1, n_layers):
        image = blur.colour(k) + (1.0 - blur.coverage(k)) * image
    return image


def quotient(image: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """An image over its weight, 0 where there is next to no weight."""
    known = weight >= LEAST_WEIGHT
    return image * np.where(known, 1.0 / np.where(known, weight, 1.0), 0.0).astype(image.dtype)

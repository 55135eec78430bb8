"""M9: every source point spread with its own PSF, clipped by what stands before it."""

from __future__ import annotations

import math

import numpy as np

from isetcl.psf_baseline.methods.blur import Blur

_TINY = 1e-12  # variance of offsets, samples^2, that is none


def pupil_clipped(blur: Blur, n_layers: int) -> np.ndarray:
    """M9: the PSF of each point from the part of the pupil that it can be seen through.

    A ray through pupil point p from place v of layer k lands at v + o_k(p); it passes the nearer
    layer j at v + o_k(p) - o_j(p). The pupil is divided into cells q with PSFs P_kq that sum to the
    eye's, and

    L = sum_k sum_q P_kq * (m_k f_k s_kq),
    s_kq(v) = mean over cell q of prod_{j nearer} [1 - m_j(v + o_k(p) - o_j(p))],

    with the product taken layer by layer. What is not clipped is spread by the PSF itself, with
    its diffraction if it has any; only differences from the mean visibility use the rays of the
    cells. Class: opaque, occlusion-aware PSFs (as in Dr.Bokeh, 2024, in one plane). Exact for
    planar occluders at small angles as cells shrink; with finite cells what is left is the
    covariance of two layers within a cell, beyond the blur of the edge, which is matched. Known
    failure: cost grows with cells times occluders; curved and slanted occluders are as good as
    their layers. An even scene stays even; hidden light is lost, as it should be.

    Parameters
    ----------
    blur
        Convolved complete layers, far to near, with pupil shifts of many rays in a sample.
    n_layers
        Number of layers.

    Returns
    -------
    ndarray, (basis, rows, columns)
    """
    nearest = n_layers - 1
    spectrum = blur.transfer(nearest) * blur.layer_spectrum(nearest)
    if n_layers == 1:
        return blur.image(spectrum)
    columns, rows, weights = blur.pupil_shifts()
    shown = [np.zeros_like(layer.coverage) for layer in blur.layers[:-1]]
    spread = [np.zeros_like(blur.transfer(k)) for k in range(nearest)]
    for q in range(len(weights)):
        share = weights[q] / weights[q].sum()
        hidden = np.zeros_like(blur.layers[nearest].coverage)
        for k in range(nearest - 1, -1, -1):
            # What hides layer k + 1, and that layer itself, moved as seen from layer k.
            places = _steps(columns[k : k + 2, q], rows[k : k + 2, q], share)
            step = blur.points_transfer(*places, share)
            hidden = blur.image(step * _hiding(blur, k + 1, hidden))
            seen = np.clip(1.0 - hidden, 0.0, 1.0)
            cell = blur.points_transfer(columns[k, q], rows[k, q], weights[q])
            spectrum += cell * blur.spectrum(blur.layers[k].colour * seen)
            shown[k] += np.float32(weights[q].sum()) * seen
            spread[k] += cell
    for k in range(nearest):
        rest = blur.transfer(k) - spread[k]
        spectrum += rest * blur.spectrum(blur.layers[k].colour * shown[k])
    return blur.image(spectrum)


def _steps(
    columns: np.ndarray, rows: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Offsets from one layer to the next nearer one of the rays of a cell, in samples.

    Where a ray lands and what it passes are one thing, but in a cell they are spread one after
    the other, and the nearer layer's edges would be blurred by both. Its offsets are stretched or
    shrunk about their mean such that the variances add up to that of the edge's own image.

    Parameters
    ----------
    columns, rows : ndarray, (2, rays)
        Where the rays land from either layer.
    weights : ndarray, (rays,)
        Their sum is 1.
    """
    variance = _variance(columns, weights) + _variance(rows, weights)
    x, y = columns[1] - columns[0], rows[1] - rows[0]
    own = float(_variance(x, weights) + _variance(y, weights))
    wanted = max(float(variance[1] - variance[0]), 0.0)
    scale = math.sqrt(wanted / own) if own > _TINY else 0.0
    return _scaled(x, weights, scale), _scaled(y, weights, scale)


def _variance(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    middle = (values @ weights)[..., None]
    return np.square(values - middle) @ weights


def _scaled(values: np.ndarray, weights: np.ndarray, scale: float) -> np.ndarray:
    middle = values @ weights
    return middle + scale * (values - middle)


def _hiding(blur: Blur, k: int, hidden: np.ndarray) -> np.ndarray:
    """Transform of 1 - (1 - hidden)(1 - m_k)."""
    if not hidden.any():
        return blur.coverage_spectrum(k)
    return blur.spectrum(1.0 - (1.0 - hidden) * (1.0 - blur.layers[k].coverage))

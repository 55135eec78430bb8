"""M9: every source point spread with its own PSF, clipped by what stands before it."""

from __future__ import annotations

import numpy as np

from isetcl.psf_baseline.methods.blur import Blur
from isetcl.psf_baseline.methods.layered import layered_over


def pupil_clipped(blur: Blur, n_layers: int) -> np.ndarray:
    """M9: the PSF of each point from the parts of the pupil that it is seen through.

    The pupil is divided into cells q of share a_q, through which layer k has the PSF a_q P_kq.
    What of a point at v of layer k lands at u through cell q is clipped by all nearer layers:

    L(u) = sum_k sum_v m_k f_k(v) sum_q a_q P_kq(u - v) prod_{j nearer} [1 - (P_jq * m_j)(u)].

    Computed as M8, with the eye's PSFs and their diffraction if they have any, plus what the sum
    over cells differs from M8 with the cells' mean PSFs: the covariance of the layers over the
    pupil, which M8 leaves out. Class: opaque, occlusion-aware PSFs (as in Dr.Bokeh, 2024, in one
    plane). Exact for planar occluders at small angles as cells shrink, and with any cells where M8
    is. Known failure: what is left with finite cells is the covariance inside them; cost grows with
    cells times layers; curved and slanted occluders are as good as their layers. An even scene
    stays even; hidden light is lost, as it should be. Memory does not grow with the cells.

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
    image = layered_over(blur, n_layers)
    if n_layers == 1:
        return image
    columns, rows, weights = blur.pupil_shifts()
    shape = image.shape[1:]
    # In double precision: many small terms are added whose sum is next to nothing.
    change = np.zeros(image.shape)
    colours = np.zeros((n_layers - 1, *image.shape))
    covers = np.zeros((n_layers, *shape))
    for q, share in enumerate(weights.sum(axis=1)):
        light = np.ones(shape)
        for k in range(n_layers - 1, -1, -1):
            cell = blur.points_transfer(columns[k, q], rows[k, q], weights[q])
            if k < n_layers - 1:
                colour = blur.image(cell * blur.layer_spectrum(k))
                change += light * colour
                colours[k] += colour
            if k > 0:
                cover = blur.image(cell * blur.coverage_spectrum(k))
                light *= 1.0 - cover / share
                covers[k] += cover
    light = np.ones(shape)
    for k in range(n_layers - 1, 0, -1):
        light *= 1.0 - covers[k]
        change -= light * colours[k - 1]
    return image + change.astype(image.dtype)

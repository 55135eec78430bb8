"""M1: every pixel gathers with the PSF of its own depth."""

from __future__ import annotations

import numpy as np

from isetcl.psf_baseline.methods.blur import Blur


def gather(blur: Blur, n_layers: int) -> np.ndarray:
    """M1: blur the view once per layer and pick at each pixel, L(u) = sum_v P_z(u)(u - v) f(v).

    In layers L = sum_k m_k (P_k * sum_j m_j f_j). The gather form of Potmesil and Chakravarty's
    1982 post-filter, and the blend of blurred images by a depth map in differentiable-optics
    packages. Known failure: the PSF belongs to the receiving pixel instead of the source, so that
    a sharp foreground bleeds into a blurred background and a blurred foreground keeps a hard edge;
    up to half the contrast. Wrong on slopes too, where the light of a point is not conserved. An
    even scene stays even.

    Parameters
    ----------
    blur
        Convolved visible layers, far to near; their coverages tell each pixel's depth.
    n_layers
        Number of layers.

    Returns
    -------
    ndarray, (basis, rows, columns)
    """
    image = blur.layers[0].coverage * blur.scene(0)
    for k in range(1, n_layers):
        image += blur.layers[k].coverage * blur.scene(k)
    return image

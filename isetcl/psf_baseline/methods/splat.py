"""M2: every pixel spreads with the PSF of its own depth."""

from __future__ import annotations

import numpy as np

from isetcl.psf_baseline.methods.blur import Blur
from isetcl.psf_baseline.methods.layered import layered_normalized, layered_sum


def splat(blur: Blur, n_layers: int) -> np.ndarray:
    """M2: spread each pixel's light and add, L(u) = sum_v P_z(v)(u - v) f(v).

    The PSF of a pixel's own vergence is interpolated linearly between those of two layers, which
    is a sum of softly sliced layers; on flat layers it is M3. The class of Barsky 2002
    (vision-realistic rendering) and of per-pixel PSF rendering in differentiable-optics packages.
    Known failure: hidden light is added and revealed light missing, so that depth edges show light
    and dark gaps of half the contrast. Every point's light is conserved; an even scene does not
    stay even at depth edges.

    Parameters
    ----------
    blur
        Convolved visible layers, softly sliced, far to near.
    n_layers
        Number of layers.

    Returns
    -------
    ndarray, (basis, rows, columns)
    """
    return layered_sum(blur, n_layers)


def splat_normalized(blur: Blur, n_layers: int) -> np.ndarray:
    """M2n: spread light and weights, L = M2 / sum_v P_z(v)(u - v).

    Common in fast renderers. Known failure: order-free, so that the colour of what is in focus
    leaks over depth edges and a blurred background tints a sharp foreground; a third to half of
    the contrast. An even scene stays even; light is not conserved.

    Parameters
    ----------
    blur
        Convolved visible layers, softly sliced, far to near.
    n_layers
        Number of layers.

    Returns
    -------
    ndarray, (basis, rows, columns)
    """
    return layered_normalized(blur, n_layers)

"""M0: one PSF for everything."""

from __future__ import annotations

import numpy as np

from isetcl.psf_baseline.methods.blur import Blur


def single(blur: Blur, n_layers: int) -> np.ndarray:
    """M0: blur the whole view with one PSF, L = P * f.

    P is that of the layer that covers most of the view, the nearer one of two alike. Used for
    planar scenes, as in ISETBio's classic path. Known failure: no depth at all; whatever lies at
    another depth has the wrong blur, at depth edges and away from them. Exact for a scene at one
    depth. Every point's light is spread and none lost; an even scene stays even.

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
    return blur.scene(_largest(blur, n_layers))


def _largest(blur: Blur, n_layers: int) -> int:
    """The layer that covers most; of two alike (to a thousandth) the nearer one."""
    areas = [float(blur.layers[k].coverage.sum(dtype=np.float64)) for k in range(n_layers)]
    most = max(areas)
    return max(k for k, area in enumerate(areas) if area >= 0.999 * most)

"""Ways to combine blurred layers into an image, each with the error it must make at depth edges.

Notation: layer k has radiance f_k, coverage m_k and point spread function P_k; * is convolution,
layers count from far to near. Visible layers cover what is seen from the centre of the pupil,
complete ones also what nearer ones hide. Names M0 ... M10 are those of the survey in the
documentation. What all of them approximate, for a thin pupil A(p) and small angles, is

    L(u) = int A(p) sum_k m_k f_k(u + p dD_k) prod_{j nearer} [1 - m_j(u + p dD_j)] dp,

with dD_k the defocus of layer k.
"""

from isetcl.psf_baseline.methods.blur import Blur
from isetcl.psf_baseline.methods.clipped import pupil_clipped
from isetcl.psf_baseline.methods.gather import gather
from isetcl.psf_baseline.methods.ikoma import ikoma
from isetcl.psf_baseline.methods.layered import (
    layered_normalized,
    layered_over,
    layered_over_normalized,
    layered_over_visible,
    layered_sum,
)
from isetcl.psf_baseline.methods.multi_view import aperture_samples
from isetcl.psf_baseline.methods.registry import Method, methods
from isetcl.psf_baseline.methods.single import single
from isetcl.psf_baseline.methods.splat import splat, splat_normalized

__all__ = [
    "Blur",
    "Method",
    "aperture_samples",
    "gather",
    "ikoma",
    "layered_normalized",
    "layered_over",
    "layered_over_normalized",
    "layered_over_visible",
    "layered_sum",
    "methods",
    "pupil_clipped",
    "single",
    "splat",
    "splat_normalized",
]

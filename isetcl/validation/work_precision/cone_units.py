"""Errors of brightness in units of the Poisson noise of a cone.

A cone stands in every pixel and sees the light of that pixel alone, as in
`isetcl.retina.cone_noise`. Where the reference is as bright as its mean, the cone has N excitations
within the integration time; where its brightness is R times the mean, N R, with the noise
sqrt(N R). An error of brightness I - R, both in units of the mean, is N (I - R) excitations, so

    error = root mean square of (I - R) sqrt(N / R) over the pixels that are not dark,

a number without unit: 1 is an error as large as the cone's own noise, and below 0.1 more samples
cannot be seen. It is that of `ConeNoise.error` where all pixels have one spectrum.
"""

from __future__ import annotations

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.retina.cone_noise import ConeNoise
from isetcl.retina.image import RetinalImage
from isetcl.validation.work_precision.estimators import Squares, squares_of


def mean_excitations(
    image: RetinalImage, cone: ConeNoise, illuminance_lux: float | None
) -> float | None:
    """Excitations, within the integration time, of a cone in the image's mean light.

    The cone is of the type, L, M or S, that this light excites most.

    Parameters
    ----------
    image
    cone
        Its aperture and integration time.
    illuminance_lux
        Mean illuminance on the retina to which the image is scaled; None leaves it as it is.

    Returns
    -------
    float or None
        None if the image has no spectrum: fewer than two wavelengths, or none that cones see.
    """
    try:
        weights = cone.weights(image.wavelengths_nm)
        lux = float(image.illuminance_lux.values.mean())
    except InvalidInputError:
        return None
    spectrum = image.irradiance.values.mean(axis=(1, 2), dtype=np.float64)
    scale = 1.0 if illuminance_lux is None else illuminance_lux / lux
    return scale * float(np.max(weights @ spectrum))


def cone_squares(
    images: np.ndarray, reference: np.ndarray, variance: np.ndarray, excitations: float
) -> Squares | None:
    """The mean square error in units of cone noise; None if all of the reference is dark.

    Parameters
    ----------
    images : ndarray, (replicates, pixels)
        Brightness in any unit.
    reference, variance : ndarray, (pixels,)
        The reference and its squared standard error, in the same unit.
    excitations
        Of a cone where the reference is as bright as its mean.
    """
    lit = reference > 0
    level = float(np.mean(reference))
    if not np.any(lit) or not level > 0:
        return None
    weight = np.sqrt(excitations / (level * reference[lit]))
    return squares_of((images[:, lit] - reference[lit]) * weight, variance[lit] * weight**2)

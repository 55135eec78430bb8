"""Mosaics as files that ISETBio's cMosaic imports."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from isetcl.cones.light_catch import mean_segment_factor
from isetcl.cones.mosaic import ConeMosaic
from isetcl.cones.observer import Observer
from isetcl.cones.receptors import ReceptorType, outer_segment_um
from isetcl.errors import InvalidInputError, check_type
from isetcl.matlab import write_mat
from isetcl.retina.image import RetinalImage
from isetcl.retina.isetbio import square_pixels
from isetcl.spectrum import default_wavelengths_nm
from isetcl.units import MM_PER_M, UM_PER_MM

VARIABLE = "coneData"
SCALE = "micronsPerDegree"


def to_isetbio(mosaic: ConeMosaic, path: str | Path, *, image: RetinalImage | None = None) -> Path:
    """Write a mosaic as a structure ``coneData`` for ``cMosaic('coneData', ...)``.

    Positions are micrometres from the fovea, x to the right and y up in the visual field, as
    ISETBio has them. Types count from 1 (L, M, S). Outer segments are factors of the fovea's
    absorptance, of L cones on average over 400 to 700 nm. The one diameter that blurs the image is
    the median aperture.

    Parameters
    ----------
    mosaic
        The cones.
    path
        The file, ending in ``.mat``.
    image
        The retinal image that ISETBio will show to the cones. Positions and blur are then
        micrometres in this image, so that every cone looks where it does in isetcl, and the file
        also holds ``micronsPerDegree``, for ``cMosaic('coneData', coneData, 'micronsPerDegree',
        micronsPerDegree)``. None keeps those of the mosaic's own retina, where by default (Watson
        2014) a degree of the fovea is 268 um; in images of Navarro's eye it is 287 um.

    Raises
    ------
    InvalidInputError
        If the mosaic has rods, which ISETBio does not know, or the image's pixels are not square.
    FileError
        If the file cannot be written.
    """
    check_type("mosaic", mosaic, ConeMosaic)
    if np.any(mosaic.types == ReceptorType.ROD):
        raise InvalidInputError(
            "a mosaic for ISETBio must have cones only, got "
            f"{mosaic.counts['ROD']} rods; write mosaic.select(mosaic.types < 3)"
        )
    variables: dict[str, Any] = {}
    positions_um, blur_um = -UM_PER_MM * mosaic.positions_mm, mosaic.aperture_um
    if image is not None:
        check_type("image", image, RetinalImage)
        _, pitch_deg, pitch_m = square_pixels(image)
        per_deg = UM_PER_MM * MM_PER_M * pitch_m / pitch_deg
        variables[SCALE] = per_deg
        positions_um, blur_um = per_deg * mosaic.positions_deg, per_deg * mosaic.aperture_deg
    variables[VARIABLE] = {
        "positionUnits": "microns",
        "positions": positions_um,
        "types": mosaic.types[:, None].astype(np.float64) + 1.0,
        "lightGatheringApertureDiameters": mosaic.aperture_um[None, :],
        "blurApertureDiameterMicrons": float(np.median(blur_um)),
        # The misspelling is that of ISETBio.
        "outerSegmentLengthAttenationFactors": segment_factors(mosaic)[None, :],
    }
    return write_mat(path, variables)


def segment_factors(mosaic: ConeMosaic) -> np.ndarray:
    """Absorptance of L cones over that of the fovea by outer segment, (n,), mean of wavelengths."""
    fraction = mosaic.outer_segment_um / float(outer_segment_um(np.zeros(1))[0])
    return mean_segment_factor(Observer(), default_wavelengths_nm(), fraction)

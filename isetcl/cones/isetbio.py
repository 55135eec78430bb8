"""Mosaics as files that ISETBio's cMosaic imports."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from isetcl.cones.light_catch import mean_segment_factor
from isetcl.cones.mosaic import ConeMosaic
from isetcl.cones.observer import Observer
from isetcl.cones.receptors import ReceptorType, outer_segment_um
from isetcl.errors import InvalidInputError, check_type
from isetcl.matlab import write_mat
from isetcl.spectrum import default_wavelengths_nm

VARIABLE = "coneData"


def to_isetbio(mosaic: ConeMosaic, path: str | Path) -> Path:
    """Write a mosaic as a structure ``coneData`` for ``cMosaic('coneData', ...)``.

    Positions are micrometres from the fovea, x to the right and y up in the visual field, as
    ISETBio has them. Types count from 1 (L, M, S). Outer segments are factors of the fovea's
    absorptance, of L cones on average over 400 to 700 nm. The one diameter that blurs the image is
    the median aperture.

    Raises
    ------
    InvalidInputError
        If the mosaic has rods, which ISETBio does not know.
    FileError
        If the file cannot be written.
    """
    check_type("mosaic", mosaic, ConeMosaic)
    if np.any(mosaic.types == ReceptorType.ROD):
        raise InvalidInputError(
            "a mosaic for ISETBio must have cones only, got "
            f"{mosaic.counts['ROD']} rods; write mosaic.select(mosaic.types < 3)"
        )
    record = {
        "positionUnits": "microns",
        "positions": -1e3 * mosaic.positions_mm,
        "types": mosaic.types[:, None].astype(np.float64) + 1.0,
        "lightGatheringApertureDiameters": mosaic.aperture_um[None, :],
        "blurApertureDiameterMicrons": float(np.median(mosaic.aperture_um)),
        # The misspelling is that of ISETBio.
        "outerSegmentLengthAttenationFactors": segment_factors(mosaic)[None, :],
    }
    return write_mat(path, {VARIABLE: record})


def segment_factors(mosaic: ConeMosaic) -> np.ndarray:
    """Absorptance of L cones over that of the fovea by outer segment, (n,), mean of wavelengths."""
    fraction = mosaic.outer_segment_um / float(outer_segment_um(np.zeros(1))[0])
    return mean_segment_factor(Observer(), default_wavelengths_nm(), fraction)

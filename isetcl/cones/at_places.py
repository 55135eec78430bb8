"""Excitations of receptors at which the scene was rendered itself, without an image."""

from __future__ import annotations

import numpy as np

from isetcl.cones.light_catch import ReceptorEfficiency
from isetcl.cones.mosaic import ConeMosaic
from isetcl.cones.observer import Observer
from isetcl.errors import InvalidInputError
from isetcl.retina.places import IrradianceAtPlaces

_AT_ONCE = 1 << 14


def rates_at_places(
    mosaic: ConeMosaic,
    light: IrradianceAtPlaces,
    observer: Observer,
    segments: str,
    has_macular_pigment: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """Mean excitations a second and their standard errors, (receptors,).

    Raises
    ------
    InvalidInputError
        If the light is not that of the mosaic's apertures, or of one wavelength only.
    """
    _check_same(mosaic, light)
    efficiency = ReceptorEfficiency(
        mosaic, light.wavelengths_nm, observer, segments, has_macular_pigment
    )
    rate, error = np.empty(len(mosaic)), np.empty(len(mosaic))
    for first in range(0, len(mosaic), _AT_ONCE):
        part = slice(first, min(first + _AT_ONCE, len(mosaic)))
        own = IrradianceAtPlaces(light.dataset.isel(place=part))
        rate[part], error[part] = own.weighted(efficiency.efficiencies(part))
    return rate, error


def _check_same(mosaic: ConeMosaic, light: IrradianceAtPlaces) -> None:
    if len(light.wavelengths_nm) < 2:
        raise InvalidInputError("excitations need light of at least 2 wavelengths, got 1")
    data, n = light.dataset, light.irradiance.shape[1]
    at = np.stack([data["x_deg"].values, data["y_deg"].values], axis=1)
    is_same = n == len(mosaic) and bool(
        data.attrs.get("aperture_shape", mosaic.aperture_shape) == mosaic.aperture_shape
        and np.allclose(at, mosaic.positions_deg, rtol=0, atol=1e-9)
        and np.allclose(data["radius_um"].values, 0.5 * mosaic.aperture_um, rtol=1e-9)
    )
    if not is_same:
        raise InvalidInputError(
            f"the light was rendered at {n} apertures that are not those of this mosaic of "
            f"{len(mosaic)} receptors; render with at=mosaic"
        )

"""Excitations of receptors at which the scene was rendered itself, without an image."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from isetcl.cones.light_catch import ReceptorEfficiency
from isetcl.cones.mosaic import ConeMosaic
from isetcl.cones.viewing import Viewing
from isetcl.errors import InvalidInputError, check_type
from isetcl.retina.places import IrradianceAtPlaces
from isetcl.spectrum import Uneven

_AT_ONCE = 1 << 14


@dataclass(frozen=True)
class ReceptorsAtPlaces:
    """The receptors of a mosaic and how they look, for goals of a render in their noise."""

    mosaic: ConeMosaic
    viewing: Viewing

    def __post_init__(self) -> None:
        check_type("viewing", self.viewing, Viewing)

    @property
    def types(self) -> np.ndarray:
        """Types of the receptors, (n,)."""
        return self.mosaic.types

    def efficiencies(self, wavelengths_nm: np.ndarray, uneven_wavelengths: Uneven) -> np.ndarray:
        """Excitations a second per W m^-2 nm^-1 at each wavelength, (n, wavelengths).

        Unequal steps are taken as bins if that is asked for here or by the viewing.

        Raises
        ------
        InvalidInputError
            If a wavelength lies beyond the pigments, or steps are unequal and not allowed.
        """
        viewing = self.viewing
        if uneven_wavelengths == "bins":
            viewing = dataclasses.replace(viewing, uneven_wavelengths="bins")
        efficiency = ReceptorEfficiency(self.mosaic, wavelengths_nm, viewing)
        return efficiency.efficiencies(slice(None))


def rates_at_places(
    mosaic: ConeMosaic, light: IrradianceAtPlaces, viewing: Viewing
) -> tuple[np.ndarray, np.ndarray]:
    """Mean excitations a second and their standard errors, (receptors,).

    Raises
    ------
    InvalidInputError
        If the light is not that of the mosaic's apertures, of one wavelength only, or of
        wavelengths in unequal steps that are not allowed.
    """
    _check_same(mosaic, light)
    efficiency = ReceptorEfficiency(mosaic, light.wavelengths_nm, viewing)
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

"""Photopigments: what part of the light in its outer segment a receptor absorbs.

Wavelengths are in nm; densities and absorbances are decadic.
"""

from __future__ import annotations

import numpy as np

from isetcl.errors import InvalidInputError, check_choice, check_number
from isetcl.eye.people.macular_pigment import (
    MACULAR_PEAK_OVER_460_NM,
    PIGMENT_MODELS,
    PigmentModel,
    check_pigment_range,
    cie_170_table,
)

FOVEAL_DENSITIES = (0.5, 0.5, 0.4)
"""Optical densities of L, M and S pigments in the fovea. Stockman & Sharpe 2000."""

PHOTON_EFFICIENCY = 2.0 / 3.0
"""Excitations per photon absorbed. Rodieck 1998, The First Steps in Seeing, p. 472."""

# Published peaks of the cones, nm, which a nomogram's shift counts from: Stockman & Rider 2023.
CONE_PEAK_NM = {"L": 551.9, "M": 529.8, "S": 416.9}


def absorbance(
    cone: str,
    wavelengths_nm: np.ndarray,
    model: PigmentModel = "cie_170",
    shift_nm: float = 0.0,
) -> np.ndarray:
    """Low-density absorbance of a cone's pigment, peak 1, (wavelengths,).

    Parameters
    ----------
    cone
        ``"L"``, ``"M"`` or ``"S"``.
    wavelengths_nm
        Ascending wavelengths, nm.
    model
        ``"cie_170"``: the tables of CIE 170-1:2006, 390 to 830 nm, every nm; between them linear in
        the logarithm. ``"stockman_rider_2023"``: Fourier templates, 360 to 850 nm.
    shift_nm
        How far the peak is moved, nm. On a scale of log wavelength the spectrum keeps its shape.

    Raises
    ------
    InvalidInputError
        If a name is unknown or a wavelength lies outside the model.
    """
    check_choice("cone", cone, ("L", "M", "S"))
    check_choice("pigment model", model, PIGMENT_MODELS)
    grid = check_pigment_range(model, wavelengths_nm)
    if model == "stockman_rider_2023":
        from isetcl.eye.people.stockman_rider import template_absorbance

        return template_absorbance(cone, grid, shift_nm)
    table, peak = cie_170_table(), CONE_PEAK_NM[cone]
    log = table[:, 1 + "LMS".index(cone)]
    return np.asarray(10.0 ** _extended(grid * peak / (peak + shift_nm), table[:, 0], log))


def _extended(at: np.ndarray, nodes: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Linear interpolation that goes on beyond the ends with the slope of the last 30 nodes."""
    found = np.interp(at, nodes, values)
    rise = (values[-1] - values[-31]) / (nodes[-1] - nodes[-31])
    fall = (values[30] - values[0]) / (nodes[30] - nodes[0])
    found += np.maximum(at - nodes[-1], 0.0) * rise
    return np.asarray(found + np.minimum(at - nodes[0], 0.0) * fall)


def absorptance(density: np.ndarray | float, absorbance: np.ndarray) -> np.ndarray:
    """Share of photons that a pigment of a peak density absorbs: 1 - 10^(-density absorbance)."""
    return np.asarray(-np.expm1(-np.log(10.0) * density * absorbance))


def field_size_densities(field_deg: float) -> tuple[tuple[float, float, float], float]:
    """Optical densities of L, M and S, and the macular pigment's peak density, of a field's size.

    CIE 170-1:2006, for fields of 1 to 10 degrees: 0.38 + 0.54 exp(-d/1.333) for L and M, 0.30 +
    0.45 exp(-d/1.333) for S, 0.485 exp(-d/6.132) for the macular pigment at 460 nm.
    """
    if not 1.0 <= check_number("field_deg", field_deg) <= 10.0:
        raise InvalidInputError(
            f"field_deg must be 1 to 10 deg, which CIE 170-1 covers, got {field_deg:g}"
        )
    fall = float(np.exp(-field_deg / 1.333))
    long = 0.38 + 0.54 * fall
    return (long, long, 0.30 + 0.45 * fall), 0.485 * MACULAR_PEAK_OVER_460_NM * float(
        np.exp(-field_deg / 6.132)
    )

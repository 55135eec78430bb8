"""Fourier templates of the pigments of cones, of the macular pigment and of the lens.

Stockman & Rider 2023, Color Res Appl 48:818, fit Fourier series to the log absorbance against log
wavelength, so that a spectrum shifts with its peak without changing its shape. Coefficients: their
published program, version 1.0.1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_LOG_ORIGIN = 2.556302500767287267
_LOG_SCALE = 0.1187666467581842301

_L_SER = (
    -42.417608560, -2.656791612, 75.011093607, 56.477062776, 7.509397607, 9.061442173,
    -38.068488495, -20.974610259, -6.642746250, -3.785039126, 9.322071459, 3.134494745,
    1.603799055, 0.439302358, -0.676958684, -0.072988371, -0.078857510, -0.004264105,
)  # fmt: skip
_M = (
    -210.6568853069, -0.1458073553, 386.7319763250, 305.4710584670, 5.0218382813, 6.8386224350,
    -208.2062335724, -118.4890200521, -5.7625866330, -3.7973553168, 55.1803460639, 19.9728512548,
    1.8990456325, 0.6913410864, -5.0891806213, -0.7070689492, -0.1419926703, 0.0005894876,
)  # fmt: skip
_S = (
    207.3880950935, -6.3065623516, -393.7100478026, -315.6650602846, 19.2917535553, 19.6414743488,
    214.2211570447, 121.8584683485, -15.1820737886, -8.6774057156, -56.7596380441, -20.6318720369,
    3.6934875040, 1.0483022480, 5.3656615075, 0.7898783086, -0.1480357836, 0.0002358232,
)  # fmt: skip
_MACULAR = (
    3712.2037792986, 374.1811575175, -7007.6989637831, -5887.2857515364, -633.0475233043,
    -716.0429039473, 4386.8811254914, 2882.1092658881, 638.1347550701, 468.4980700497,
    -1653.7567388120, -817.1240899995, -286.4038978705, -144.7996457395, 340.3364828167,
    115.5652804221, 59.1650826447, 18.6678197694, -30.2344535413, -5.4683753172, -4.1335064207,
    -0.5043959566, 0.5094171266,
)  # fmt: skip
_MACULAR_RANGE_NM = (375.0, 550.0)
_MACULAR_SCALE_NM = 55.70423008
_MACULAR_FACTOR = 1.0050048550
"""Makes the density at 460 nm 0.35."""
_LENS = (
    -313.9508632762, -70.3216819666, 585.4719725809, 471.5395862431, 117.3539102044,
    127.0168222865, -324.4700544731, -188.1638078982, -104.5512488013, -68.3078486904,
    89.7815373733, 33.4498264952, 35.2723638870, 13.6524086627, -8.7568168893, -1.2825766708,
    -3.5126531075, -0.4477840959, 0.0428291365,
)  # fmt: skip
_LENS_RANGE_NM = (360.0, 660.0)
_LENS_SCALE_NM = 95.49296586
_LENS_FACTOR = 1.0091871745
"""Makes the density at 400 nm 1.7649."""


@dataclass(frozen=True)
class _Template:
    peak_nm: float
    coefficients: tuple[float, ...]


# As published the series of L peaks at 0.9945 (those of M and S at 1.0000): brought to 1 here.
_L_SER_PEAK = 0.9944520192499002

_CONES = {"L": _Template(553.1, _L_SER), "M": _Template(529.9, _M), "S": _Template(416.9, _S)}

# The mean observer's L pigments: serine at position 180 in 56 %, 2.70 nm shorter alanine in the
# rest (Stockman & Rider 2023); the factor brings the peak of the sum back to 1.
_SERINE_SHARE = 0.56
_ALANINE_SHIFT_NM = -2.70
_MEAN_FACTOR = 1.0009350552348480


def _fourier(coefficients: tuple[float, ...], x: np.ndarray) -> np.ndarray:
    """c0 + sum of c(2k-1) cos kx + c(2k) sin kx, a last odd coefficient being a constant."""
    total = np.full(x.shape, coefficients[0])
    for k in range(1, (len(coefficients) - 1) // 2 + 1):
        total += coefficients[2 * k - 1] * np.cos(k * x) + coefficients[2 * k] * np.sin(k * x)
    return total


def _log_absorbance(template: _Template, nm: np.ndarray, shift_nm: float) -> np.ndarray:
    x = (np.log10(nm) - _LOG_ORIGIN) / _LOG_SCALE
    x = x + np.log10(template.peak_nm / (template.peak_nm + shift_nm)) / _LOG_SCALE
    return _fourier(template.coefficients[:-1], x) + template.coefficients[-1]


def template_absorbance(cone: str, wavelengths_nm: np.ndarray, shift_nm: float = 0.0) -> np.ndarray:
    """Low-density absorbance of the cone ``"L"``, ``"M"`` or ``"S"``, peak 1, (wavelengths,).

    `shift_nm` moves the peak, nm. ``"L"`` is the mean observer's: 56 % of the pigments with serine
    at position 180, the others with alanine, 2.7 nm shorter; ``"L_ser"`` and ``"L_ala"`` are these.
    """
    if cone == "L":
        parts = [template_absorbance(f"L_{k}", wavelengths_nm, shift_nm) for k in ("ser", "ala")]
        share = _SERINE_SHARE
        return np.asarray(_MEAN_FACTOR * (share * parts[0] + (1.0 - share) * parts[1]))
    if cone in ("L_ser", "L_ala"):
        template = _CONES["L"]
        shift_nm = shift_nm + (_ALANINE_SHIFT_NM if cone == "L_ala" else 0.0)
        return np.asarray(10.0 ** _log_absorbance(template, wavelengths_nm, shift_nm) / _L_SER_PEAK)
    return np.asarray(10.0 ** _log_absorbance(_CONES[cone], wavelengths_nm, shift_nm))


def template_macular_density(wavelengths_nm: np.ndarray) -> np.ndarray:
    """Density of the macular pigment, 0.35 at 460 nm, zero outside 375 to 550 nm."""
    x = (wavelengths_nm - _MACULAR_RANGE_NM[0]) / _MACULAR_SCALE_NM
    density = _MACULAR_FACTOR * _fourier(_MACULAR, x)
    return _within(wavelengths_nm, _MACULAR_RANGE_NM, density)


def template_lens_density(wavelengths_nm: np.ndarray) -> np.ndarray:
    """Density of the lens of the mean observer, 1.7649 at 400 nm, (wavelengths,).

    Zero outside 360 to 660 nm; not a measurement below 390 nm.
    """
    x = (wavelengths_nm - _LENS_RANGE_NM[0]) / _LENS_SCALE_NM
    return _within(wavelengths_nm, _LENS_RANGE_NM, _LENS_FACTOR * _fourier(_LENS, x))


def _within(nm: np.ndarray, limits: tuple[float, float], values: np.ndarray) -> np.ndarray:
    return np.where((nm >= limits[0]) & (nm <= limits[1]), np.maximum(values, 0.0), 0.0)

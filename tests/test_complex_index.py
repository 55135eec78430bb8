"""Metals and clear media by name, against values measured and published by others."""

import numpy as np
import pytest

from isetcl.errors import InvalidInputError
from isetcl.eye.media import Medium, SellmeierDispersion
from isetcl.scene.complex_index import ComplexIndex
from isetcl.scene.glass import glass

SYMBOLS = {
    "silver": "Ag",
    "gold": "Au",
    "copper": "Cu",
    "aluminium": "Al",
    "chromium": "Cr",
    "nickel": "Ni",
    "titanium": "Ti",
    "iron": "Fe",
    "tungsten": "W",
}


def reflectance(metal, wavelengths_nm):
    """At normal incidence, by Fresnel's equations."""
    n, k = ComplexIndex.named(metal).at(wavelengths_nm)
    return ((n - 1) ** 2 + k**2) / ((n + 1) ** 2 + k**2)


# Reflectance of fresh evaporated films, measured directly: Hass 1965, Applied Optics and Optical
# Engineering vol. 3, ch. 8 (the table of the Handbook of Optics), at 400, 450, 500, 650 and 700 nm.
# The indices come from other films of other laboratories; 0.03 is how far such films differ.
HASS = {
    "aluminium": (0.924, 0.922, 0.918, 0.907, 0.897),
    "silver": (0.956, 0.971, 0.979, 0.988, 0.989),
    "gold": (0.387, 0.387, 0.477, 0.955, 0.970),
    "copper": (0.475, 0.552, 0.600, 0.966, 0.975),
}


@pytest.mark.parametrize("metal", HASS)
def test_reflectance_agrees_with_measured_mirrors(metal):
    got = reflectance(metal, [400, 450, 500, 650, 700])
    np.testing.assert_allclose(got, HASS[metal], atol=0.035)


# Lorentz-Drude models fitted to other data: Rakic, Djurisic, Elazar & Majewski 1998, Appl Opt
# 37:5271, table 2: plasma energy (eV), then f, gamma (eV), omega (eV) of each oscillator.
LORENTZ_DRUDE = {
    "aluminium": (
        14.98,
        [
            (0.523, 0.047, 0.0),
            (0.227, 0.333, 0.162),
            (0.050, 0.312, 1.544),
            (0.166, 1.351, 1.808),
            (0.030, 3.382, 3.473),
        ],
    ),
    "nickel": (
        15.92,
        [
            (0.096, 0.048, 0.0),
            (0.100, 4.511, 0.174),
            (0.135, 1.334, 0.582),
            (0.106, 2.178, 1.597),
            (0.729, 6.292, 6.089),
        ],
    ),
    "titanium": (
        7.29,
        [
            (0.148, 0.082, 0.0),
            (0.899, 2.276, 0.777),
            (0.393, 2.518, 1.545),
            (0.187, 1.663, 2.509),
            (0.001, 1.762, 19.43),
        ],
    ),
    "tungsten": (
        13.22,
        [
            (0.206, 0.064, 0.0),
            (0.054, 0.530, 1.004),
            (0.166, 1.281, 1.917),
            (0.706, 3.332, 3.580),
            (2.590, 5.836, 7.498),
        ],
    ),
}


@pytest.mark.parametrize(
    ("metal", "tolerance"),
    [("aluminium", 0.01), ("tungsten", 0.02), ("nickel", 0.06), ("titanium", 0.065)],
)
def test_reflectance_agrees_with_models_of_other_measurements(metal, tolerance):
    wavelengths = np.arange(400.0, 781.0, 20.0)
    energy = 1239.841984 / wavelengths
    plasma, oscillators = LORENTZ_DRUDE[metal]
    permittivity = 1.0 + sum(
        f * plasma**2 / (omega**2 - energy**2 - 1j * energy * gamma)
        for f, gamma, omega in oscillators
    )
    index = np.sqrt(permittivity)
    expected = np.abs((index - 1) / (index + 1)) ** 2
    np.testing.assert_allclose(reflectance(metal, wavelengths), expected, atol=tolerance)


def test_evaporated_chromium_reflects_as_handbooks_say():
    # 0.55 to 0.57 (Hass 1965).
    np.testing.assert_allclose(reflectance("chromium", [500, 550, 600]), 0.56, atol=0.02)


@pytest.mark.parametrize("metal", SYMBOLS)
def test_every_metal_covers_the_visible_range(metal):
    n, k = ComplexIndex.named(metal).at(np.arange(360.0, 851.0, 10.0))
    assert np.all(n > 0)
    assert np.all(k > 0)


def test_symbols_and_capitals_name_the_same_metals():
    for metal, symbol in SYMBOLS.items():
        assert ComplexIndex.named(symbol).digest() == ComplexIndex.named(metal).digest()
    assert ComplexIndex.named(" Gold ").name == "gold"
    assert len({ComplexIndex.named(metal).digest() for metal in SYMBOLS}) == len(SYMBOLS)


@pytest.mark.parametrize("bad", ["goldd", "Xx", "", None, 3, ["gold"]])
def test_unknown_metals_are_refused_with_near_matches(bad):
    with pytest.raises(InvalidInputError, match=r"unknown metal.*known: aluminium"):
        ComplexIndex.named(bad)
    if bad == "goldd":
        with pytest.raises(InvalidInputError, match="did you mean gold"):
            ComplexIndex.named(bad)


def test_an_index_is_interpolated_linearly_and_never_extrapolated():
    index = ComplexIndex([400, 500], [1.0, 2.0], [0.0, 4.0], "x")
    n, k = index.at([425, 500])
    np.testing.assert_allclose(n, [1.25, 2.0])
    np.testing.assert_allclose(k, [1.0, 4.0])
    for wavelength in (399.9, 500.1):
        with pytest.raises(InvalidInputError, match="known from 400 to 500 nm"):
            index.at([wavelength])


@pytest.mark.parametrize(
    ("n", "k"),
    [([0, 1], [1, 1]), ([1, 1], [-1, 1]), ([1, np.nan], [1, 1]), ([1], [1, 1]), ("ab", [1, 1])],
)
def test_impossible_indices_are_refused(n, k):
    with pytest.raises(InvalidInputError):
        ComplexIndex([400, 500], n, k)


# Catalogues: n_d and V_d of SCHOTT 2017; fused silica and its V_d of Malitson 1965 (Heraeus states
# 1.45846 and 67.8); water at 20 degrees C: IAPWS R9-97 gives 1.33336 at 589.26 nm in vacuum.
CATALOGUE = {
    "BK7": (1.51680, 64.17, 1e-5, 0.01),
    "F2": (1.62004, 36.37, 1e-5, 0.01),
    "SF10": (1.72825, 28.41, 1e-5, 0.01),
    "SF11": (1.78472, 25.76, 1e-5, 0.01),
    "N-SF11": (1.78472, 25.68, 1e-5, 0.01),
    "fused silica": (1.45846, 67.8, 1e-5, 0.05),
    "water": (1.33340, 55.7, 1e-4, 0.3),
    # Plastics: Edmund Optics' table of plastics states 1.491756 (57.44) and 1.585470 (29.91); the
    # source states an accuracy of 0.001, which is 10 % of the Abbe number.
    "PMMA": (1.4918, 57.4, 1.5e-3, 6.0),
    "polycarbonate": (1.5855, 29.9, 1e-3, 3.0),
}


@pytest.mark.parametrize("name", CATALOGUE)
def test_glasses_have_the_index_and_abbe_number_of_their_catalogues(name):
    n_d, abbe, index_tolerance, abbe_tolerance = CATALOGUE[name]
    f, d, c = glass(name).index(np.array([486.1327, 587.5618, 656.2725]))
    assert d == pytest.approx(n_d, abs=index_tolerance)
    assert (d - 1) / (f - c) == pytest.approx(abbe, abs=abbe_tolerance)


def test_schott_s_sheet_of_bk7_holds_at_other_lines():
    # N-BK7 data sheet, SCHOTT: n_h (404.7 nm), n_g (435.8), n_e (546.1), n_r (706.5).
    got = glass("N-BK7").index(np.array([404.6561, 435.8343, 546.0740, 706.5188]))
    np.testing.assert_allclose(got, [1.53024, 1.52668, 1.51872, 1.51289], atol=1e-5)


@pytest.mark.parametrize("name", CATALOGUE)
def test_every_glass_covers_the_default_wavelengths(name):
    medium = glass(name)
    assert isinstance(medium, Medium)
    assert np.all(np.diff(medium.index(np.arange(400.0, 781.0, 10.0))) < 0)


def test_glasses_have_aliases_and_unknown_ones_are_refused():
    assert glass("bk7") == glass("N-BK7") == glass("BK7")
    assert glass("Acrylic") == glass("PMMA")
    for bad in ("BK77", "", None, 7, ["BK7"]):
        with pytest.raises(InvalidInputError, match="unknown glass"):
            glass(bad)


@pytest.mark.parametrize(
    ("b", "c", "low", "high"),
    [
        ((1.0,), (0.01, 0.02), 400, 700),
        ((), (), 400, 700),
        ((1.0,), (0.25,), 400, 700),  # a resonance at 500 nm
        ((-0.5,), (0.01,), 400, 700),  # an index below 1
        ((np.nan,), (0.01,), 400, 700),
        ("abc", (0.01,), 400, 700),
        (None, (0.01,), 400, 700),
        ((1.0,), (0.01,), 700, 400),
        ((1.0,), (0.01,), -1, 400),
    ],
)
def test_impossible_sellmeier_formulas_are_refused(b, c, low, high):
    with pytest.raises(InvalidInputError, match="sellmeier"):
        SellmeierDispersion(b, c, low, high)


def test_a_sellmeier_formula_is_not_extrapolated():
    medium = Medium("x", SellmeierDispersion((1.2,), (0.01,), 400.0, 700.0))
    assert medium.index(500.0) == pytest.approx(np.sqrt(1 + 1.2 * 0.25 / 0.24), rel=1e-12)
    with pytest.raises(InvalidInputError, match="between 400 and 700"):
        medium.index(399.0)

"""Melanopsin: its action spectrum against that of the standard, and images weighted by it."""

import colour
import numpy as np
import pytest

import isetcl as ic
from isetcl.cones import Observer, melanopic_irradiance
from isetcl.errors import InvalidInputError
from isetcl.spectrum import luminous_efficiency

WAVES = np.arange(400.0, 781.0)

# CIE S 026:2018, Table 2: the melanopic action spectrum.
STANDARD = {
    400: 0.0114277, 420: 0.137237, 440: 0.401587, 460: 0.708049, 480: 0.965605, 490: 1.0,
    500: 0.965952, 520: 0.699628, 540: 0.351707, 560: 0.118526, 580: 0.0268747, 600: 0.00506686,
    620: 0.000947313,
}  # fmt: skip


GRID = ic.RetinalGrid.of(ic.eyes.navarro(3.0), (0.1, 0.1), (3, 2))


def image_of(irradiance, waves):
    spectrum = np.broadcast_to(np.asarray(irradiance)[:, None, None], (len(waves), 2, 3))
    return ic.RetinalImage.from_arrays(GRID, waves, spectrum.copy())


def test_sensitivity_at_the_cornea_is_near_the_melanopic_action_spectrum():
    waves = np.array(list(STANDARD), dtype=float)
    found = Observer().melanopic_sensitivity(waves)
    expected = np.array(list(STANDARD.values()))
    np.testing.assert_allclose(found, expected, atol=0.03)
    # The lens of the standard, which it does not say, is clearer at 420 nm.
    np.testing.assert_allclose(found[waves >= 440], expected[waves >= 440], rtol=0.09)
    full = Observer().melanopic_sensitivity(WAVES)
    assert WAVES[np.argmax(full)] == pytest.approx(490.0, abs=1.0)
    assert full.max() == 1.0


def test_daylight_and_lamplight_have_their_melanopic_efficacies():
    # CIE S 026:2018: 1.3262 mW/lm of D65; illuminant A has 0.4959 of that.
    sensitivity, visible = Observer().melanopic_sensitivity(WAVES), luminous_efficiency(WAVES)
    efficacy = []
    for name in ("D65", "A"):
        table = colour.SDS_ILLUMINANTS[name]
        light = np.interp(WAVES, table.wavelengths, table.values)
        efficacy.append(1e3 * np.sum(light * sensitivity) / (683.0 * np.sum(light * visible)))
    assert efficacy[0] == pytest.approx(1.3262, rel=0.01)
    assert efficacy[1] / efficacy[0] == pytest.approx(0.4959, rel=0.005)


def test_the_pigment_absorbs_most_at_480_nm_and_little_of_it():
    absorbed = Observer().melanopsin_absorptance(WAVES)
    assert WAVES[np.argmax(absorbed)] == pytest.approx(480.0, abs=1.0)
    # 1 - 10^-0.015; twice the pigment takes nearly twice as much.
    assert absorbed.max() == pytest.approx(0.0339, rel=0.01)
    dense = Observer(melanopsin_density=0.03).melanopsin_absorptance(WAVES)
    assert dense.max() / absorbed.max() == pytest.approx(1.966, abs=0.002)


def test_old_lenses_move_the_peak_to_longer_wavelengths():
    peaks = [
        WAVES[np.argmax(Observer().melanopic_sensitivity(WAVES, age))] for age in (25.0, 32.0, 75.0)
    ]
    assert peaks[0] <= peaks[1] < peaks[2]


def test_an_image_is_weighted_by_the_pigment_wavelength_by_wavelength():
    waves = np.arange(440.0, 521.0, 10.0)
    irradiance = np.zeros(len(waves))
    irradiance[4] = 3.0
    found = melanopic_irradiance(image_of(irradiance, waves))
    assert found.dims == ("y", "x")
    assert found.attrs["units"] == "W m^-2"
    # In energy the pigment peaks within 1 % at 480 nm: 3 W m^-2 nm^-1 over 10 nm.
    np.testing.assert_allclose(found.values, 30.0, rtol=0.01)


def test_a_lens_before_the_retina_takes_what_it_absorbs():
    waves = np.arange(450.0, 511.0, 1.0)
    image = image_of(np.ones(len(waves)), waves)
    lens = ic.retina.transmittance(age=32, model="pokorny_1987")
    behind = melanopic_irradiance(image.through(lens)).values / melanopic_irradiance(image).values
    # Pokorny et al. 1987: densities of 0.295 at 450 and 0.147 at 510 nm.
    assert np.all((behind > 10.0**-0.295) & (behind < 10.0**-0.147))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Observer().melanopic_sensitivity([380.0, 500.0]), "from 400 to 780 nm, got 380"),
        (lambda: Observer().melanopic_sensitivity(WAVES, 10.0), "age_years"),
        (lambda: Observer().melanopsin_absorptance([700.0, 900.0]), "from 300 to 800 nm"),
        (lambda: Observer(melanopsin_density=0.0), "melanopsin_density must lie between"),
        (lambda: melanopic_irradiance(None), "image must be"),
        (lambda: melanopic_irradiance(image_of([1.0], np.array([500.0]))), "two wavelengths"),
        (
            lambda: melanopic_irradiance(image_of([1.0, 1.0], np.array([500.0, 830.0]))),
            "300 to 800",
        ),
    ],
)
def test_what_melanopsin_cannot_see_is_refused(call, message):
    with pytest.raises(InvalidInputError, match=message):
        call()


def test_melanopic_irradiance_of_uneven_wavelengths_wants_leave():
    image = image_of(np.ones(3), np.array([450.0, 460.0, 490.0]))
    with pytest.raises(InvalidInputError, match="got steps of 10 to 30 nm"):
        melanopic_irradiance(image)
    # Bins of 10, 20 and 30 nm.
    sensitivity = Observer().melanopsin_absorptance(WAVES) * WAVES
    own = np.interp([450.0, 460.0, 490.0], WAVES, sensitivity / sensitivity.max())
    found = melanopic_irradiance(image, uneven_wavelengths="bins")
    np.testing.assert_allclose(found, own @ [10.0, 20.0, 30.0], rtol=1e-4)

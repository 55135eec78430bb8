"""Pigments of receptors against the standard's fundamentals and published check numbers."""

import colour
import numpy as np
import pytest

from isetcl.cones.nomogram import govardovskii_absorbance
from isetcl.cones.observer import Observer
from isetcl.errors import InvalidInputError
from isetcl.eye.people.macular_pigment import macular_fraction
from isetcl.eye.people.pigments import absorbance
from isetcl.eye.people.stockman_rider import (
    template_lens_density,
    template_macular_density,
)
from isetcl.spectrum import luminous_efficiency

WAVES = np.arange(400.0, 701.0)
PLANCK_TIMES_C = 6.62607015e-34 * 299792458.0


def fundamentals(size):
    table = colour.MSDS_CMFS[f"Stockman & Sharpe {size} Degree Cone Fundamentals"]
    return np.stack([np.interp(WAVES, table.wavelengths, table.values[:, i]) for i in range(3)])


@pytest.mark.parametrize("size", [2, 10])
def test_the_standard_observers_have_the_published_fundamentals(size):
    # colour-science's tables are Stockman & Sharpe 2000 to 1e-5; ours come from absorbances.
    found = Observer.of_field(float(size)).fundamentals(WAVES)
    np.testing.assert_allclose(found, fundamentals(size), atol=1e-3)


@pytest.mark.parametrize("size", [2, 10])
def test_the_templates_come_near_the_fundamentals(size):
    # Stockman & Rider 2023 state their fits; an independent evaluation found up to 0.019.
    observer = Observer.of_field(float(size), model="stockman_rider_2023")
    error = np.abs(observer.fundamentals(WAVES) - fundamentals(size))
    assert error.max() < 0.025


def test_absorbance_and_efficiency_are_those_of_isetbio():
    waves = np.array([450.0, 550.0, 650.0])
    observer = Observer()
    expected = [0.133838173147422, 0.990923208090168, 0.0758280695937327]
    np.testing.assert_allclose(observer.absorbances(waves)[0], expected, rtol=2e-5)
    expected = [0.0952016434207283, 0.453633542263389, 0.0557320888215983]
    np.testing.assert_allclose(observer.quantal_efficiency(waves)[0], expected, rtol=2e-5)
    unit = observer.macular_density(np.array([450.0]))[0] / 0.35
    assert unit == pytest.approx(0.946322067594433, rel=1e-4)
    assert 10 ** (-0.35 * unit) == pytest.approx(0.466430859836272, rel=1e-4)


@pytest.mark.parametrize(
    ("eccentricity", "expected"),
    [
        (0.0, (2117.9, 1629.6, 458.9)),
        (None, (2375.2, 1975.9, 790.2)),
        (10.0, (2363.7, 1960.3, 774.9)),
    ],
)
def test_excitations_of_an_equal_energy_lux_are_the_published_ones(eccentricity, expected):
    # Excitations per um^2 and s at one photopic lux on the retina, 400 to 700 nm every nm.
    irradiance = 1.0 / (683.0 * np.sum(luminous_efficiency(WAVES)))
    photons = irradiance * WAVES * 1e-9 / PLANCK_TIMES_C
    observer = Observer()
    fraction = 0.0 if eccentricity is None else macular_fraction(eccentricity)
    through = 10.0 ** (-fraction * observer.macular_density(WAVES))
    found = 1e-12 * np.sum(observer.quantal_efficiency(WAVES) * through * photons, axis=1)
    np.testing.assert_allclose(found, expected, rtol=5e-4)


def test_the_templates_deviate_from_the_tables_as_evaluated_elsewhere():
    waves = np.arange(390.0, 831.0)
    for cone, limit in (("L", 0.028), ("M", 0.027), ("S", 0.012)):
        tabulated = absorbance(cone, waves)
        template = absorbance(cone, waves, "stockman_rider_2023")
        assert np.abs(tabulated - template).max() == pytest.approx(limit, abs=1e-3)
        assert template.max() == pytest.approx(1.0, abs=5e-4)
    assert template_lens_density(np.array([400.0]))[0] == pytest.approx(1.7649, abs=1e-6)
    assert template_macular_density(np.array([460.0]))[0] == pytest.approx(0.35, abs=1e-6)


@pytest.mark.parametrize("model", ["cie_170", "stockman_rider_2023"])
def test_a_shifted_pigment_is_the_same_on_a_scale_of_log_wavelength(model):
    waves = np.arange(500.0, 600.0, 0.1)
    for cone in "LM":
        peak = {"L": 551.9, "M": 529.8 if model == "cie_170" else 529.9}[cone]
        base = absorbance(cone, waves, model)
        moved = absorbance(cone, waves * (peak - 5.0) / peak, model, -5.0)
        # The two pigments of L are shifted one by one, by the same nm and not the same ratio.
        np.testing.assert_allclose(moved, base, atol=2e-4 if cone == "L" else 1e-9)


def test_dichromats_and_anomalous_observers_hold_two_like_pigments():
    for kind, pair in (("protan", 1), ("deutan", 0)):
        rows = Observer.dichromat(kind).quantal_efficiency(WAVES)
        np.testing.assert_array_equal(rows[0], rows[1])
        np.testing.assert_array_equal(rows[0], Observer().quantal_efficiency(WAVES)[pair])
        peaks = Observer.anomalous(kind, 4.0).peaks_nm
        assert peaks[0] - peaks[1] == pytest.approx(4.0)


def test_rods_behind_a_lens_are_the_scotopic_observer():
    from isetcl.eye.people.ocular_media import ocular_density

    waves = np.arange(400.0, 701.0, 5.0)
    table = colour.SDS_LEFS["CIE 1951 Scotopic Standard Observer"]
    expected = np.interp(waves, table.wavelengths, table.values)
    lens = 10.0 ** -ocular_density(32, waves, "cie_170")
    found = Observer().rod_efficiency(waves) * waves * lens
    np.testing.assert_allclose(found / found.max(), expected / expected.max(), atol=1e-4)
    assert Observer().rod_efficiency(WAVES).max() == pytest.approx(2 / 3 * (1 - 10**-0.4), rel=1e-9)


def test_the_nomogram_peaks_at_its_wavelength():
    waves = np.arange(380.0, 700.0, 0.1)
    for peak in (420.0, 480.0, 500.0, 560.0):
        curve = govardovskii_absorbance(peak, waves)
        # Govardovskii et al. 2000: the alpha band peaks at its wavelength within half a nm.
        assert waves[np.argmax(curve)] == pytest.approx(peak, abs=0.7)
        assert curve.max() == pytest.approx(1.0, abs=0.01)


def test_shorter_outer_segments_absorb_less():
    # A thin layer absorbs in proportion to its length: ln(10) density absorbance.
    thin = Observer().quantal_efficiency(WAVES, 1e-4)
    expected = 2 / 3 * np.log(10) * 1e-4 * np.array([[0.5], [0.5], [0.4]])
    np.testing.assert_allclose(thin, expected * Observer().absorbances(WAVES), rtol=1e-4)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Observer(optical_densities=(0.5, 0.0, 0.4)), "optical density of M"),
        (lambda: Observer(shifts_nm=(0.0, 99.0, 0.0)), "shift of M"),
        (lambda: Observer(pigments=("L", "X", "S")), "pigment of M"),
        (lambda: Observer(macular_peak_density=-0.1), "macular_peak_density"),
        (lambda: Observer().absorbances(np.array([380.0])), "390 to 830 nm"),
        (lambda: Observer().rod_efficiency(np.array([395.0])), "400 to 780 nm"),
        (lambda: Observer().fundamentals(WAVES, age_years=12.0), "age_years"),
        (lambda: Observer.of_field(20.0), "field_deg"),
        (lambda: Observer().quantal_efficiency(WAVES, 0.0), "segment_fraction"),
    ],
)
def test_bad_input_is_refused(make, words):
    with pytest.raises(InvalidInputError, match=words):
        make()

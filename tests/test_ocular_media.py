"""Transmittance of the ocular media against published and independently computed densities."""

import numpy as np
import pytest

import isetcl as ic
from isetcl.eye.people.ocular_media import OcularMedia, ocular_density, ocular_transmittance

LIGHT = ic.Spectrum.constant(1.0)
EVEN = ic.Scene(name="even", objects=(), background=LIGHT)


def test_the_formula_has_independently_computed_densities():
    # van de Kraats & van Norren 2007 at 32 years, small field, of another implementation.
    found = ocular_density(32.0, [400.0, 450.0, 550.0, 700.0], "van_de_kraats_small_field")
    assert found == pytest.approx([1.922, 0.501, 0.253, 0.162], abs=6e-4)


def test_the_large_field_loses_less_by_its_scatter_term():
    # Only R differs, 0.446 against 0.225, times (400 / lambda)^4.
    nm = np.array([400.0, 500.0, 700.0])
    small = ocular_density(50.0, nm, "van_de_kraats_small_field")
    large = ocular_density(50.0, nm, "van_de_kraats_large_field")
    assert small - large == pytest.approx(0.221 * (400.0 / nm) ** 4)


def test_cie_203_differs_from_its_source_by_its_three_constants():
    nm = np.array([320.0, 400.0, 500.0, 700.0])
    source = ocular_density(40.0, nm, "van_de_kraats_large_field")
    change = -0.075 * (400.0 / nm) ** 4 - 0.051
    change += 0.052 * 2.13 * np.exp(-((0.029 * (nm - 370.0)) ** 2))
    assert ocular_density(40.0, nm, "cie_203") - source == pytest.approx(change)


def test_the_cie_lens_is_that_of_the_standard_observer():
    # Lens density at 32 years behind the Stockman-Sharpe fundamentals (CVRL), every 10 nm.
    nm = np.array([400.0, 410, 420, 430, 440, 450, 460, 480, 500, 550, 600, 650, 660, 730])
    table = [1.7649, 1.1374, 0.7240, 0.4876, 0.3413, 0.2629, 0.2279, 0.1834, 0.1537, 0.0859]
    table += [0.0297, 0.0032, 0.0, 0.0]
    assert ocular_density(32.0, nm, "cie_170") == pytest.approx(table, abs=6e-5)


def test_the_older_lens_has_its_published_table():
    # Pokorny, Smith & Lutze 1987: TL1 + TL2 at 32 years.
    found = ocular_density(32.0, [400.0, 450.0, 500.0, 600.0, 650.0, 700.0], "pokorny_1987")
    assert found == pytest.approx([1.600, 0.300, 0.167, 0.033, 0.0, 0.0])


@pytest.mark.parametrize("model", ["pokorny_1987", "cie_170"])
def test_the_aging_part_of_the_lens_grows_by_two_slopes(model):
    # From 460 nm on there is no stable part: 2 % a year to 60, then 6.67 % of the value at 32.
    young = ocular_density(32.0, [500.0], model)
    for age, growth in ((20.0, 0.76), (60.0, 1.56), (80.0, 2.894)):
        assert ocular_density(age, [500.0], model) / young == pytest.approx(growth)
    assert ocular_density(60.0 + 1e-9, [500.0], model) / young == pytest.approx(1.56)


def test_the_models_agree_on_what_age_does_to_blue_light():
    # Relative to long wavelengths, the density at 450 nm that 40 years add.
    nm = np.array([450.0, 650.0])
    added = {}
    for model in ("cie_203", "pokorny_1987", "cie_170"):
        young, old = (ocular_density(age, nm, model) for age in (25.0, 65.0))
        added[model] = (old - old[1] - young + young[1])[0]
    assert min(added.values()) > 0.1
    assert max(added.values()) < 2.0 * min(added.values())


def test_transmittance_is_the_power_of_ten_of_density():
    nm = np.array([420.0, 555.0])
    assert ocular_transmittance(30.0, nm) == pytest.approx(10.0 ** -ocular_density(30.0, nm))


@pytest.mark.parametrize("method", ["rays", "psf"])
def test_media_multiply_the_spectrum_of_an_image(method):
    eye, nm = ic.eyes.navarro(4.0), np.array([420.0, 500.0, 650.0])
    media = OcularMedia(70.0, "cie_170")
    options = {"fov_deg": 2.0, "resolution": 4, "wavelengths_nm": nm}
    if method == "rays":
        options |= {"spp": 16}
        clear, filtered = (ic.render(EVEN, eye, media=m, **options) for m in (None, media))
    else:
        clear, filtered = (
            ic.psf_baseline.render(EVEN, eye, media=m, **options) for m in (None, media)
        )
    ratio = filtered.irradiance.values / clear.irradiance.values
    expected = 10.0 ** -ocular_density(70.0, nm, "cie_170")
    assert ratio == pytest.approx(np.broadcast_to(expected[:, None, None], ratio.shape), rel=1e-5)
    assert filtered.provenance["media"] == {"age_years": 70.0, "model": "cie_170"}
    assert clear.provenance["media"] is None
    error = filtered.standard_error.values, clear.standard_error.values
    assert error[0] == pytest.approx(error[1] * expected[:, None, None], rel=1e-5)


def test_a_plan_says_what_the_media_let_through():
    planned = ic.plan(EVEN, ic.eyes.navarro(), media=OcularMedia(60.0))
    assert "60 years" in planned.explain()
    assert "ocular media" not in ic.plan(EVEN, ic.eyes.navarro()).explain()


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: OcularMedia(10.0, "cie_170"), "age_years of ocular media 'cie_170' must lie"),
        (lambda: OcularMedia(30.0, "cie203"), "did you mean cie_203"),
        (lambda: OcularMedia(np.nan), "age_years"),
        (lambda: ocular_density(30.0, [390.0], "cie_170"), "known from 400 to 830 nm"),
        (lambda: ocular_density(30.0, [500.0, 710.0]), "known from 300 to 700 nm"),
        (lambda: ic.plan(EVEN, ic.eyes.navarro(), media=60.0), "media must be an OcularMedia"),
        (lambda: ic.psf_baseline.render(EVEN, ic.eyes.navarro(), media=1), "media must be"),
    ],
)
def test_media_out_of_range_are_refused(make, match):
    with pytest.raises(ic.InvalidInputError, match=match):
        make()

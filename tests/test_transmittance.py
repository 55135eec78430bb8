"""Media before the receptors: steps on an image, their values, and the way back."""

import numpy as np
import pytest

import isetcl as ic
from isetcl import retina
from isetcl.errors import InvalidInputError
from isetcl.eye.people.ocular_media import ocular_density

WAVES = np.arange(400.0, 701.0, 20.0)


@pytest.fixture(scope="module")
def image():
    rng = np.random.default_rng(2)
    grid = ic.RetinalGrid.of(ic.eyes.navarro(), 10.0, (6, 5))
    values = rng.uniform(0.5, 1.0, (len(WAVES), 5, 6))
    return ic.RetinalImage.from_arrays(
        grid,
        WAVES,
        values,
        standard_error=0.01 * values,
        illuminance_standard_error=rng.uniform(size=(5, 6)),
        provenance={"media": None},
    )


def test_the_lens_takes_its_share_at_every_wavelength(image):
    # CIE 170-1 at 32 years: 1.7649 at 400 nm, 0.2629 at 450, 0.0859 at 550 (its table).
    behind = image.through(retina.transmittance(age=32.0, model="cie_170"))
    for name in ("irradiance", "standard_error"):
        ratio = (behind.dataset[name] / image.dataset[name]).values
        assert ratio[0] == pytest.approx(10**-1.7649, rel=1e-6)
        assert np.ptp(ratio, axis=(1, 2)).max() < 1e-12
    assert behind.steps[0].medium.age_years == 32.0


def test_macular_pigment_is_densest_where_the_fovea_looks(image):
    behind = image.through(retina.macular_pigment(0.5, (1.0, -2.0)))
    share = (behind.irradiance / image.irradiance).sel(wavelength=460.0).values
    x, y = np.meshgrid(image.dataset["x"], image.dataset["y"])
    r2 = (x - 1.0) ** 2 + (y + 2.0) ** 2
    # 0.35 at 460 nm where the peak, at 458 nm, is 0.352114; Lorentzian of 3.6028 deg^2.
    expected = 10.0 ** (-0.5 * 0.35 / 0.352114 * 3.6028 / (r2 + 3.6028))
    np.testing.assert_allclose(share, expected, rtol=1e-5)


def test_steps_are_undone_in_any_order(image, tmp_path):
    both = image.through(retina.transmittance(70.0)).through(retina.macular_pigment())
    assert [each.label for each in both.steps] == ["media", "macular pigment"]
    read = ic.RetinalImage.load(both.save(tmp_path / "image.nc"))
    back = read.without("media").without("macular pigment")
    assert back.steps == ()
    for name in ("irradiance", "standard_error", "illuminance_standard_error"):
        np.testing.assert_allclose(back.dataset[name], image.dataset[name], rtol=1e-12)


def test_the_media_of_a_rendered_image_are_undone_too():
    options = {"fov_deg": 1.0, "resolution": 8, "spp": 8, "wavelengths_nm": [500.0, 600.0]}
    scene, eye = ic.scenes.two_planes(), ic.eyes.navarro()
    clear = ic.render(scene, eye, **options)
    old = ic.render(scene, eye, media=ic.OcularMedia(75.0), **options)
    assert old.steps[0].medium == ic.OcularMedia(75.0)
    np.testing.assert_allclose(old.without("media").irradiance, clear.irradiance, rtol=1e-5)
    assert old.without("media").steps == ()
    with pytest.raises(InvalidInputError, match="already"):
        old.through(retina.transmittance(32.0))


def test_the_template_is_the_mean_observer_s_lens_and_grows_with_age():
    at = np.array([400.0])
    young = ocular_density(32.0, at, "stockman_rider_2023")[0]
    assert young == pytest.approx(1.7649, rel=1e-6)
    for age in (25.0, 50.0, 75.0):
        ratio = ocular_density(age, at, "stockman_rider_2023")[0] / young
        growth = ocular_density(age, at, "cie_170")[0] / ocular_density(32.0, at, "cie_170")[0]
        assert ratio == pytest.approx(growth, rel=1e-9)


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda image: image.without("media"), "no step 'media'"),
        (lambda image: image.through(0.5), "step"),
        (lambda _: retina.transmittance(age=12.0), "age_years"),
        (lambda _: retina.transmittance(model="glass"), "model of the ocular media"),
        (lambda _: retina.macular_pigment(-0.1), "peak_density"),
        (lambda _: retina.macular_pigment(model="leaf"), "pigment model"),
    ],
)
def test_bad_input_is_refused(image, act, words):
    with pytest.raises(InvalidInputError, match=words):
        act(image)

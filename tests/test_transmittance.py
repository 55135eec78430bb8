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


def test_errors_of_the_illuminance_follow_the_light(image):
    behind = image.through(retina.transmittance(60.0))
    # As many lux of noise per lux of light before as behind.
    before = image.dataset["illuminance_standard_error"] / image.illuminance_lux
    after = behind.dataset["illuminance_standard_error"] / behind.illuminance_lux
    np.testing.assert_allclose(after, before, rtol=1e-6)
    assert float(behind.illuminance_lux.mean()) < 0.95 * float(image.illuminance_lux.mean())


def test_light_absorbed_and_light_let_through_are_all_of_it(image):
    # T = 10^-D of the density that the same model gives; CIE 170-1 at 450 nm, 32 years: 0.2629.
    step = retina.transmittance(32.0, "cie_170")
    through = step.at(np.array([450.0]), np.zeros(1), np.zeros(1))
    assert through.ravel() == pytest.approx(10**-0.262880, rel=1e-5)
    assert (1.0 - through).ravel() == pytest.approx(1 - 10**-0.262880, rel=1e-5)
    # Image of one kind of pigment, at the fovea 0.35 at 458 nm by default.
    fovea = retina.macular_pigment().at(np.array([458.0]), np.zeros(1), np.zeros(1))
    assert fovea.ravel() == pytest.approx(10**-0.35, rel=1e-6)


def test_the_place_of_a_step_among_others_does_not_matter(image):
    lens, pigment = retina.transmittance(50.0), retina.macular_pigment(0.4, (0.0, 1.0))
    one, other = image.through(lens).through(pigment), image.through(pigment).through(lens)
    np.testing.assert_allclose(one.irradiance, other.irradiance, rtol=1e-12)
    assert [each.label for each in one.without("media").steps] == ["macular pigment"]
    assert one.without("media").steps[0].medium == pigment.medium
    np.testing.assert_allclose(
        one.without("media").irradiance, image.through(pigment).irradiance, rtol=1e-12
    )


def test_light_that_did_not_come_through_cannot_come_back():
    waves = np.array([300.0, 500.0])
    grid = ic.RetinalGrid.of(ic.eyes.navarro(), 1.0, (2, 2))
    image = ic.RetinalImage.from_arrays(grid, waves, np.ones((2, 2, 2), dtype=np.float32))
    dark = image.through(retina.transmittance(90.0, "cie_203"))
    with pytest.raises(InvalidInputError, match=r"'media' lets .* at 300 nm; undoing it needs"):
        dark.without("media")


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
        (lambda _: retina.macular_pigment(0.3, (0.0,)), "fovea_deg"),
        (lambda _: retina.transmittance(age=81.0), "20 to 80|between 20 and 80"),
        (lambda _: retina.transmittance(age=101.0, model="cie_203"), "age_years"),
        (lambda _: retina.Transmittance(3, retina.macular_pigment().medium), "label"),
        (lambda _: retina.Transmittance("glass", "glass"), "medium"),
        (
            lambda image: image.through(retina.macular_pigment()).through(retina.macular_pigment()),
            "already",
        ),
    ],
)
def test_bad_input_is_refused(image, act, words):
    with pytest.raises(InvalidInputError, match=words):
        act(image)

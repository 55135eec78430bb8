"""Kinds of PSFs, against closed forms, transfer functions and each other."""

import math

import numpy as np
import pytest
from oracles import reduced_eye
from slow_cases import slow_after

import isetcl as ic
from isetcl.eye.bending.ray_bending import Hurb
from isetcl.eye.people import glare, human_mtf
from isetcl.psf_baseline import Psf, geometric_psf, psf_kinds
from isetcl.psf_baseline.psfs import psf_kind
from isetcl.psf_baseline.psfs.cells import binned, disc_cells, gaussian_cells, radial_cells

KINDS = psf_kinds()
EYE = ic.eyes.navarro(4.0, 2.0)
FREQUENCY = np.array([1.0, 3.0, 8.0, 15.0, 30.0])
FINE = 0.004


def line_transfer(psf, frequency=FREQUENCY):
    """Transfer along x of a kernel, straight from its definition."""
    x = (np.arange(psf.kernel.shape[0]) - psf.radius) * psf.pitch_deg
    return psf.kernel.sum(axis=0) @ np.exp(-2j * np.pi * np.outer(x, frequency))


def square(frequency, pitch=FINE):
    """Transfer of the square over which a sample integrates."""
    return np.sinc(frequency * pitch)


@pytest.mark.parametrize("pitch", slow_after(1, [0.02, 0.5]))
@pytest.mark.parametrize("name", KINDS)
def test_a_kernel_and_what_is_outside_hold_all_light(name, pitch):
    psf = KINDS[name](EYE, 550.0, 1.0, pitch)
    assert psf.kernel.sum() + psf.energy_outside == pytest.approx(1.0, abs=1e-6)
    assert psf.kernel.min() >= 0.0
    assert psf.kernel.shape[0] % 2 == 1
    scatters = name in ("ijspeert", "vos_van_den_berg")
    assert psf.energy_outside < (0.2 if scatters else 0.01 + 1e-9)


@pytest.mark.parametrize("name", ["geometric", "wave", "hurb", "disc", "gaussian"])
def test_a_pattern_narrower_than_a_pixel_keeps_its_light_in_the_middle(name):
    psf = KINDS[name](reduced_eye(2.0), 550.0, 0.0, 2.0)
    assert psf.kernel[psf.radius, psf.radius] > 0.99


@pytest.mark.parametrize("radius", [0.2, 0.7, 3.3, 25.0])
def test_squares_of_a_disc_are_exact(radius):
    kernel = disc_cells(26, radius)
    assert kernel.sum() == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(kernel, kernel.T, atol=1e-15)
    x = (np.arange(53 * 40) + 0.5) / 40 - 26.5
    inside = (np.hypot(x[None, :], x[:, None]) < radius).astype(float)
    counted = inside.reshape(53, 40, 53, 40).mean(axis=(1, 3)) / (math.pi * radius**2)
    # Counting 1600 points a square is good to a line of points along the rim.
    assert np.abs(kernel - counted).max() < 0.03 / (math.pi * radius**2)


@pytest.mark.parametrize("sigma", [0.05, 0.4, 3.0])
def test_round_squares_of_a_gaussian_are_those_of_its_error_function(sigma):
    half = 24
    found = radial_cells(lambda r: 1.0 - np.exp(-(r**2) / (2.0 * sigma**2)), half)
    np.testing.assert_allclose(found, gaussian_cells(half, sigma), atol=2e-5)
    assert found.sum() == pytest.approx(1.0, abs=1e-9)


def test_bins_keep_the_middle_and_the_sum():
    kernel = np.zeros((31, 31))
    kernel[15, 15] = 1.0
    kernel[15, 17] = 2.0
    found = binned(kernel, 5)
    assert found.sum() == 3.0
    assert found[found.shape[0] // 2, found.shape[0] // 2] == 3.0
    kernel[15, 18] = 4.0
    assert binned(kernel, 5)[3, 4] == 4.0


@pytest.mark.parametrize("name", ["watson", "williams", "ijspeert"])
def test_population_psfs_have_their_published_transfer(name):
    pupil = EYE.entrance_pupil(550.0).diameter_mm
    published = {
        "watson": lambda f: human_mtf.watson_2013_mtf(f, pupil),
        "williams": human_mtf.williams_1994_mtf,
        "ijspeert": lambda f: glare.ijspeert_mtf(f, pupil_diameter_mm=pupil),
    }[name]
    psf = KINDS[name](EYE, 550.0, 1.0, FINE)
    error = line_transfer(psf) - published(FREQUENCY) * square(FREQUENCY)
    # What is outside has next to no transfer; cut off at a border it rings a little.
    assert np.abs(error).max() < 0.003


def test_the_cie_s_psf_has_its_published_density():
    psf = KINDS["vos_van_den_berg"](EYE, 550.0, 1.0, 0.01, reach_deg=1.0)
    for n in (30, 60, 90):
        share = psf.kernel[psf.radius, psf.radius + n] / math.radians(0.01) ** 2
        published = glare.vos_van_den_berg(0.01 * n)
        # The formula integrates to 1.00 to 1.02, which is divided out.
        assert share == pytest.approx(published, rel=0.02)
    inner = psf.kernel.sum()
    assert 0.85 < inner < 0.97


def test_older_eyes_scatter_more():
    young, old = (
        psf_kind("ijspeert").with_options(age_years=age)(EYE, 550.0, 0.0, 0.02) for age in (20, 80)
    )
    assert old.energy_outside > 1.3 * young.energy_outside


@pytest.mark.parametrize(
    ("vergence", "field"), [(2.0, (0.0, 0.0)), (0.8, (0.0, 0.0)), (1.5, (8.0, 5.0))]
)
def test_the_wave_psf_has_the_eye_s_transfer(vergence, field):
    psf = KINDS["wave"](EYE, 550.0, vergence, FINE, field)
    front = EYE.wavefront(field, 550.0, object_distance_m=1.0 / vergence)
    expected = front.otf().along(FREQUENCY, 0.0) * square(FREQUENCY)
    # A hundredth of the light may lie outside.
    assert np.abs(line_transfer(psf) - expected).max() < 0.012


@pytest.mark.slow
def test_wave_and_rays_agree_where_the_blur_is_large():
    field, vergence = (10.0, 4.0), 0.0
    wave = KINDS["wave"](EYE, 550.0, vergence, 0.01, field)
    rays = geometric_psf(EYE, 550.0, vergence, 0.01, field)
    places = []
    for psf in (wave, rays):
        n = (np.arange(psf.kernel.shape[0]) - psf.radius) * 0.01
        total = psf.kernel.sum()
        places.append([psf.kernel.sum(0) @ n / total, -psf.kernel.sum(1) @ n / total])
    # Coma and oblique focus move the centroid by two hundredths of a degree, the same way.
    np.testing.assert_allclose(places[0], places[1], atol=0.004)
    assert np.hypot(*places[1]) > 0.02
    low = np.array([0.5, 1.0, 2.0])
    np.testing.assert_allclose(
        np.abs(line_transfer(wave, low)), np.abs(line_transfer(rays, low)), atol=0.02
    )


def test_hurb_has_the_closed_form_s_transfer_in_a_perfect_eye():
    eye = reduced_eye(3.0)
    cutoff = eye.entrance_pupil(550.0).diameter_mm * 1e6 / 550.0 * math.pi / 180.0
    psf = KINDS["hurb"](eye, 550.0, 0.0, 0.002)
    expected = Hurb().otf(FREQUENCY / cutoff) * square(FREQUENCY, 0.002)
    assert np.abs(line_transfer(psf).real - expected).max() < 0.012


def test_hurb_is_wider_with_the_values_of_iset3d():
    eye = reduced_eye(3.0)
    wide = psf_kind("hurb").with_options(model="iset3d")(eye, 550.0, 0.0, 0.002)
    plain = KINDS["hurb"](eye, 550.0, 0.0, 0.002)
    assert wide.kernel.max() < 0.8 * plain.kernel.max()


@pytest.mark.parametrize("defocus", [0.5, 2.0])
def test_disc_and_gaussian_have_the_thin_lens_s_variance(defocus):
    # Radius a dD with a = 1.5 mm; mean square radius a^2 dD^2 / 2.
    eye = reduced_eye(3.0)
    pupil = eye.entrance_pupil(550.0)
    at_pupil = defocus / (1.0 + defocus * pupil.z_mm / 1000.0)
    radius = math.degrees(pupil.radius_mm / 1000.0 * at_pupil)
    for name in ("disc", "gaussian"):
        psf = KINDS[name](eye, 450.0, defocus, radius / 20.0)
        n = np.arange(psf.kernel.shape[0]) - psf.radius
        variance = psf.kernel.sum(axis=0) @ n**2 / 20.0**2
        # A square adds 1/12 of its area.
        assert variance - 1.0 / 12.0 / 400.0 == pytest.approx(0.25, rel=2e-4)


def test_what_an_eye_is_focused_on_has_no_disc():
    eye = ic.eyes.navarro(4.0, 3.0)
    focus = eye.focus_vergence_dpt(550.0)
    assert KINDS["disc"](eye, 550.0, focus, 1e-5).kernel.shape == (1, 1)
    assert KINDS["disc"](eye, 550.0, focus + 0.1, 0.001).kernel.shape[0] > 20


def test_chromatic_defocus_is_diffraction_where_it_is_in_focus():
    eye = reduced_eye(3.0)
    psf = KINDS["chromatic_defocus"](eye, 550.0, 0.0, 0.002)
    pupil = eye.entrance_pupil(550.0).diameter_mm
    expected = human_mtf.diffraction_mtf(FREQUENCY, pupil, 550.0) * square(FREQUENCY, 0.002)
    assert np.abs(line_transfer(psf).real - expected).max() < 0.012


def test_chromatic_defocus_is_sharp_in_the_blue_for_what_is_nearer():
    # Human eyes are myopic in the blue: 0.80 dpt from 550 to 450 nm by the published constants.
    eye = reduced_eye(3.0)
    difference = 0.63346 / (0.45 - 0.21410) - 0.63346 / (0.55 - 0.21410)
    assert difference == pytest.approx(0.80, abs=0.01)
    kind = KINDS["chromatic_defocus"]
    sharp = kind(eye, 450.0, difference, 0.005).kernel.max()
    assert sharp > 5.0 * kind(eye, 450.0, 0.0, 0.005).kernel.max()


@pytest.mark.slow
def test_kinds_that_know_no_colour_or_depth_are_the_same_everywhere():
    for name, kind in KINDS.items():
        options = {"reach_deg": 0.3}
        plain = kind(EYE, 550.0, 1.0, 0.03, **options).kernel
        red = kind(EYE, 650.0, 1.0, 0.03, **options).kernel
        far = kind(EYE, 550.0, 0.0, 0.03, **options).kernel
        assert np.array_equal(plain, red) != kind.knows_wavelength, name
        assert np.array_equal(plain, far) != kind.knows_depth, name


@pytest.mark.parametrize(
    ("call", "match"),
    [
        (lambda: psf_kind("wavy"), "unknown psf 'wavy'; did you mean wave"),
        (lambda: psf_kind("watson").with_options(age=3), "has no options"),
        (lambda: psf_kind("ijspeert").with_options(age=3), "did you mean age_years"),
        (lambda: psf_kind("hurb").with_options(model="airy")(EYE, 550.0, 0.0, 0.1), "iset3d"),
        (lambda: KINDS["wave"](EYE, 550.0, -1.0, 0.1), "between 0 and"),
        (lambda: KINDS["wave"](EYE, 550.0, 1.0, 0.0), "pitch_deg"),
        (lambda: KINDS["disc"](EYE, 550.0, 0.0, 1e-6), "samples across"),
        pytest.param(
            lambda: KINDS["wave"](reduced_eye(8.0), 400.0, 60.0, 0.05),
            "psf='geometric'",
            marks=pytest.mark.slow,
        ),
        (lambda: KINDS["watson"](ic.eyes.navarro(1.0), 550.0, 1.0, 0.05), "pupil_diameter_mm"),
    ],
)
def test_impossible_requests_are_refused(call, match):
    with pytest.raises(ic.InvalidInputError, match=match):
        call()


@pytest.mark.parametrize(
    ("kernel", "outside", "match"),
    [
        (np.ones((2, 2)) / 4.0, 0.0, "odd number"),
        (np.array([[0.0, -0.1, 0.0], [0.0, 1.1, 0.0], [0.0, 0.0, 0.0]]), 0.0, "shares of light"),
        (np.full((3, 3), np.nan), 0.0, "finite"),
        (np.ones((3, 3)), 0.0, "add up to 1"),
        (np.ones((1, 1)), 0.5, "add up to 1"),
    ],
)
def test_psfs_of_the_user_s_must_be_shares_of_light(kernel, outside, match):
    with pytest.raises(ic.InvalidInputError, match=match):
        Psf(kernel, 0.01, outside)

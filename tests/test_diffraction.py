"""Point spread and transfer functions against closed forms, Huygens' sum and other programs."""

import dataclasses
import math

import numpy as np
import pytest
from oracles import reduced_eye
from scipy.special import j1

import isetcl as ic
from isetcl.eye.aberrations.refraction_error import best_focus_dpt, through_focus
from isetcl.eye.waves import diffraction_psf


def aberration_free(front):
    return dataclasses.replace(front, opd_um=np.where(front.inside, 0.0, np.nan))


def real_entrance_pupil(name, diameter_mm):
    """A model eye whose marginal rays, not its paraxial ones, enter this far apart."""
    eye = ic.eyes.by_name(name, diameter_mm / 1.13)
    for _ in range(2):
        reached = 2 * eye.wavefront(samples=16).entrance_radius_mm
        stop = ic.Stop(eye.stop.z_mm, eye.stop.diameter_mm * diameter_mm / reached)
        eye = dataclasses.replace(eye, stop=stop)
    return eye


@pytest.fixture(scope="module")
def airy_front():
    # A long reduced eye: nearly no difference between sines and heights.
    return reduced_eye(3.0, axial_length_mm=60.0).wavefront(samples=128)


def test_the_perfect_psf_is_airy_s(airy_front):
    # (2 J1(v) / v)^2 with v = pi theta D / lambda; first zero 1.21967 lambda / D.
    psf = airy_front.psf(6.0, 60)
    cut_off = math.pi / 180 * 3.0 / 550e-6
    x, y = np.meshgrid(psf.x_arcmin, psf.y_arcmin)
    v = math.pi * np.hypot(x, y) / 60 * cut_off
    np.testing.assert_allclose(psf.relative, (2 * j1(v) / v) ** 2, atol=1e-3)
    assert airy_front.strehl() == pytest.approx(1.0, abs=1e-9)
    assert psf.peak_per_arcmin2 == pytest.approx(math.pi / 4 * (cut_off / 60) ** 2, rel=2e-3)


def test_encircled_energy_of_airy_s_disc(airy_front):
    # 1 - J0^2 - J1^2 at the dark rings.
    cut_off = math.pi / 180 * 3.0 / 550e-6
    radii = np.array([3.8317, 7.0156, 10.1735]) / math.pi / cut_off * 60
    got = airy_front.otf().encircled_energy(radii)
    np.testing.assert_allclose(got, [0.8378, 0.9099, 0.9376], atol=1.5e-3)


def test_the_perfect_mtf_is_the_overlap_of_two_discs(airy_front):
    cut_off = math.pi / 180 * 3.0 / 550e-6
    f = np.array([0.0, 1.0, 5.0, 10.0, 20.0, 30.0, 60.0, 90.0, 100.0])
    u = np.minimum(f / cut_off, 1.0)
    expected = 2 / math.pi * (np.arccos(u) - u * np.sqrt(1 - u * u))
    transfer = airy_front.otf()
    n = airy_front.samples
    assert transfer.values[n, n] == 1.0
    assert (transfer.x_cpd[n], transfer.y_cpd[n]) == (0.0, 0.0)
    for orientation in (0.0, 37.0, 90.0, None):
        np.testing.assert_allclose(transfer.mtf(f, orientation), expected, atol=1e-3)
    # (2 / pi)(acos u - u sqrt(1 - u^2)) at 10, 30, 60 of 95.2 cycles/degree (3 mm, 550 nm).
    np.testing.assert_allclose(transfer.mtf([10, 30, 60], 0.0), [0.8665, 0.6055, 0.2544], atol=1e-3)
    np.testing.assert_allclose(transfer.ptf_deg([10, 30], 45.0), 0.0, atol=1e-6)


@pytest.mark.parametrize("diameter_mm", [2.0, 4.0])
def test_fraunhofer_and_huygens_agree_on_axis(diameter_mm):
    front = ic.eyes.navarro(diameter_mm).wavefront()
    fast, exact = front.psf(8.0, 25), front.psf(8.0, 25, "huygens")
    assert np.max(np.abs(fast.relative - exact.relative)) < 1e-3 * exact.relative.max()


def test_fraunhofer_and_huygens_agree_off_axis():
    front = ic.eyes.navarro(2.0).wavefront((8.0, 20.0))
    fast, exact = front.psf(8.0, 25), front.psf(8.0, 25, "huygens")
    assert np.max(np.abs(fast.relative - exact.relative)) < 1e-3 * exact.relative.max()


def test_the_matrix_transform_is_the_fft():
    front = ic.eyes.navarro(3.0).wavefront(samples=32)
    n = front.samples
    padded = np.zeros((4 * n, 4 * n), dtype=complex)
    padded[:n, :n] = front.pupil_function()
    # Rows descend in y and fft2 has exp(-i ...): shift theorem to the same points.
    v = np.fft.fftfreq(4 * n, front.step_cpd)
    by_fft = np.abs(np.fft.fft2(padded)) * front.step_cpd
    direct = np.abs(diffraction_psf.fraunhofer(front, -v, v))
    np.testing.assert_allclose(direct, by_fft, atol=1e-10 * by_fft.max())


def test_psf_energy_and_otf_describe_the_same_light():
    front = ic.eyes.navarro(3.0).wavefront((0.0, 10.0))
    psf = front.psf(60.0 / front.step_cpd, 128)
    assert psf.energy == pytest.approx(1.0, abs=0.015)
    frequency = 20.0
    wave = np.exp(-2j * math.pi * frequency * psf.y_arcmin / 60)[:, None]
    transform = np.sum(psf.density_per_arcmin2 * wave) * psf.pitch_arcmin**2
    assert front.otf().along([frequency], 90.0)[0] == pytest.approx(transform, abs=3e-3)


def test_peak_is_found_wherever_it_lies():
    front = ic.eyes.navarro(4.0).wavefront((0.0, 12.0))
    psf = front.psf(12.0, 241)
    assert front.strehl() >= psf.relative.max()
    assert front.strehl() == pytest.approx(psf.relative.max(), rel=0.01)


@pytest.mark.parametrize(
    ("diameter_mm", "on_retina", "best", "defocus_dpt", "mtf"),
    [
        (2.0, 0.998, 0.9992, 0.02, None),
        (3.0, 0.839, 0.979, 0.106, (0.8565, 0.7182, 0.5883, 0.2514)),
        (4.0, 0.118, 0.789, 0.229, (0.8245, 0.6598, 0.5339, 0.3264)),
        (6.0, 0.037, 0.141, 0.262, (0.3621, 0.2643, 0.1935, 0.1258)),
    ],
)
def test_navarro_s_strehl_and_mtf_agree_with_another_program(
    diameter_mm, on_retina, best, defocus_dpt, mtf
):
    # Another program, 550 nm, pupil by real rays (agreement, not proof).
    front = real_entrance_pupil("navarro", diameter_mm).wavefront(samples=88)
    assert front.strehl() == pytest.approx(on_retina, abs=1.5e-3)
    found = best_focus_dpt(front)
    assert found == pytest.approx(defocus_dpt, abs=2.5e-3)
    focused = front.defocused(found)
    assert focused.strehl() == pytest.approx(best, abs=2.5e-3)
    if mtf is not None:
        got = focused.otf().mtf([10, 20, 30, 60], 0.0)
        np.testing.assert_allclose(got, mtf, atol=2.5e-3)


@pytest.mark.parametrize(
    ("name", "diameter_mm", "best"),
    [("arizona", 3.0, 0.984), ("arizona", 4.0, 0.831), ("legrand", 3.0, 0.847)],
)
def test_best_strehl_of_other_eyes_agrees_with_another_program(name, diameter_mm, best):
    front = real_entrance_pupil(name, diameter_mm).wavefront(samples=64)
    focused = front.defocused(best_focus_dpt(front))
    assert focused.strehl() == pytest.approx(best, abs=4e-3)


def test_marechal_s_strehl_holds_for_small_aberrations():
    front = ic.eyes.navarro(2.0).wavefront()
    assert front.strehl_marechal == pytest.approx(front.strehl(), abs=2e-4)
    assert front.strehl() < 0.999


def test_through_focus_curves_agree_on_where_focus_is():
    front = ic.eyes.navarro(2.5).wavefront(samples=32)
    grid = np.linspace(-0.4, 0.6, 11)
    for metric, better in (("strehl", np.argmax), ("mtf", np.argmax), ("rms", np.argmin)):
        curve = through_focus(front, grid, metric)
        best = best_focus_dpt(front, metric)
        assert abs(grid[better(curve)] - best) <= 0.1
        # rms is least in the focus of `refraction`.
        if metric == "rms":
            assert best == pytest.approx(-front.refraction().m_dpt)


def test_defocus_alone_lowers_the_peak_as_a_sinc():
    # Born & Wolf 8.8: (sin(u/4) / (u/4))^2, u/4 = pi W20 / lambda, even pupil, small angles.
    front = reduced_eye(2.0, axial_length_mm=60.0).wavefront()
    for dioptres in (0.25, 0.5, 1.0):
        quarter = math.pi * (dioptres / 2.0) / 0.55
        expected = (math.sin(quarter) / quarter) ** 2
        wave = diffraction_psf.fraunhofer(front.defocused(dioptres), np.zeros(1), np.zeros(1))
        ideal = diffraction_psf.fraunhofer(front, np.zeros(1), np.zeros(1))
        assert abs(wave[0, 0] / ideal[0, 0]) ** 2 == pytest.approx(expected, abs=1e-3)


def test_bad_input_is_refused():
    front = ic.eyes.navarro(3.0).wavefront(samples=32)
    with pytest.raises(ic.InvalidInputError, match="fov_arcmin must be at most"):
        front.psf(200.0)
    with pytest.raises(ic.InvalidInputError, match="unknown method"):
        front.psf(5.0, 32, "fresnel")
    with pytest.raises(ic.InvalidInputError, match="frequency_cpd"):
        front.otf().mtf([-1.0])
    with pytest.raises(ic.InvalidInputError, match="radius_arcmin"):
        front.otf().encircled_energy(500.0)
    with pytest.raises(ic.InvalidInputError, match="focus metric"):
        best_focus_dpt(front, "sharp")
    with pytest.raises(ic.InvalidInputError, match="too few"):
        front.defocused(20.0).otf()

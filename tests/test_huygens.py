"""Huygens' sum on the device against the host's, and its parts against formulas."""

import dataclasses
import math

import numpy as np
import pytest
from numpy.polynomial.polynomial import polyval

import isetcl as ic
from isetcl.device.huygens import HuygensSum, _Waves
from isetcl.eye.waves import diffraction_psf

# Of the largest amplitude.
TOLERANCE = {"single": 1e-4, "double": 1e-10}


@pytest.fixture(scope="module")
def fronts():
    eye = ic.eyes.navarro(3.0)
    return {field: eye.wavefront(field, samples=96) for field in (0.0, 20.0, 35.0)}


@pytest.mark.parametrize("field", [0.0, 20.0, 35.0])
def test_the_kernel_agrees_with_the_host_s_sum(device, precision, fronts, field):
    front = fronts[field]
    # An odd number of points, which fills no whole vectors.
    v = diffraction_psf.visual_angles_deg(front, 30.0, 23)
    host = diffraction_psf.huygens(front, v[:19], -v)
    wave = HuygensSum(device, front, v[:19], -v, precision).run()
    assert wave.shape == (23, 19)
    error = np.max(np.abs(wave - host)) / np.max(np.abs(host))
    assert error < TOLERANCE[precision]


@pytest.mark.slow
def test_as_wide_an_image_as_samples_allow_is_still_right_in_single_precision(device):
    front = ic.eyes.navarro(3.0).wavefront(10.0, samples=256)
    v = diffraction_psf.visual_angles_deg(front, 60.0 / front.step_cpd, 12)
    host = diffraction_psf.huygens(front, v, -v)
    wave = HuygensSum(device, front, v, -v, "single").run()
    # Nothing but stray light lies there: compared with the peak.
    peak = math.sqrt(diffraction_psf.peak(front)[0])
    assert np.max(np.abs(wave - host)) < TOLERANCE["single"] * peak


def test_a_near_reference_sphere_takes_roots_instead_of_a_series(device, precision, fronts):
    # A sphere of 0.2 mm: the series would not converge fast enough.
    front = dataclasses.replace(fronts[0.0], radius_mm=0.2)
    v = np.linspace(-0.1, 0.1, 9)
    assert _Waves.of(front, v, -v).series(1e-13).shape == (2, 0)
    host = diffraction_psf.huygens(front, v, -v)
    wave = HuygensSum(device, front, v, -v, precision).run()
    assert np.max(np.abs(wave - host)) / np.max(np.abs(host)) < TOLERANCE[precision]


def test_the_series_are_those_of_the_roots(fronts):
    waves = _Waves.of(fronts[20.0], np.array([0.2]), np.array([0.2]))
    t_largest = waves.largest * waves.bend
    previous = 0
    for wanted in (1e-3, 1e-8, 1e-13):
        way, strength = waves.series(wanted)
        assert len(way) > previous or wanted == 1e-3
        previous = len(way)
        for t in (-t_largest, 0.5 * t_largest, t_largest):
            exact = 2.0 * math.expm1(0.5 * math.log1p(t)) / t
            got = polyval(t, [1.0, *way])
            assert abs(got - exact) * waves.largest < wanted + 1e-14
            assert polyval(t, [1.0, *strength]) == pytest.approx((1 + t) ** -0.5, abs=wanted)


def test_huygens_psf_is_the_density_of_the_host_s(device, fronts):
    front = fronts[20.0]
    ours, host = ic.huygens_psf(front, 12.0, 24), front.psf(12.0, 24, "huygens")
    np.testing.assert_array_equal(ours.x_arcmin, host.x_arcmin)
    np.testing.assert_array_equal(ours.y_arcmin, host.y_arcmin)
    np.testing.assert_allclose(ours.relative, host.relative, rtol=0, atol=1e-10)
    assert ours.wavelength_nm == host.wavelength_nm


def test_the_fourier_transform_is_within_a_thousandth_of_it_on_axis(fronts):
    front = fronts[0.0]
    exact, fast = ic.huygens_psf(front, 10.0, 64).relative, front.psf(10.0, 64).relative
    assert np.max(np.abs(exact - fast)) < 1e-3 * np.max(exact)


def test_what_cannot_be_computed_is_refused(fronts):
    with pytest.raises(ic.InvalidInputError, match=r"fov_arcmin must be at most"):
        ic.huygens_psf(fronts[0.0], 600.0)
    with pytest.raises(ic.InvalidInputError, match=r"front must be a Wavefront.*Eye.wavefront"):
        ic.huygens_psf(ic.eyes.navarro())
    with pytest.raises(ic.InvalidInputError, match="unknown precision"):
        ic.huygens_psf(fronts[0.0], precision="half")
    with pytest.raises(ic.DeviceError, match="no OpenCL device matches"):
        ic.huygens_psf(fronts[0.0], device="nonsense")

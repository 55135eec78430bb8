"""Fourier transforms by others than scipy: those of a device, and those of a caller."""

import sys

import numpy as np
import pytest
from scipy import fft

import isetcl as ic

EYE = ic.eyes.navarro(4.0, 1.0)


class PlainFft:
    """numpy's transforms, which are in double precision."""

    def __init__(self):
        self.calls = 0

    def rfft2(self, image, size):
        self.calls += 1
        return np.fft.rfft2(image, size).astype(np.complex64)

    def irfft2(self, spectrum, size):
        self.calls += 1
        return np.fft.irfft2(spectrum, size).astype(np.float32)

    def __str__(self):
        return "plain"


def image(**options):
    """Two sheets of noise, off the axis: the PSFs are not symmetric."""
    rng = np.random.default_rng(2)
    near = np.where(np.arange(16) < 8, 2.0, 0.3) * np.ones((16, 1))
    behind = (ic.psf_baseline.DepthSheet(rng.random((16, 16)), 0.3),)
    picture = ic.psf_baseline.DepthImage(
        rng.random((16, 16)), near, 0.6, centre_deg=(4.0, 3.0), depth_unit="dpt", hidden=behind
    )
    options = {"wavelengths_nm": [450.0], "psf_cache": None} | options
    return ic.psf_baseline.render(picture, EYE, **options)


@pytest.mark.parametrize("method", ["layered_over", "pupil_clipped"])
def test_images_are_those_of_whoever_makes_the_transforms_to_rounding(method):
    plain = PlainFft()
    options = {"method": method, "pupil_samples": 4}
    found, expected = image(fft=plain, **options), image(**options)
    level = float(expected.irradiance.values.mean())
    assert np.abs(found.irradiance - expected.irradiance).max() < 3e-6 * level
    assert plain.calls > 0
    assert found.provenance["fft"] == "plain"
    assert expected.provenance["fft"] == "scipy"


@pytest.mark.parametrize("bad", ["vkfft", "scipi", 3, None, PlainFft, object()])
def test_what_makes_no_transforms_is_refused(bad):
    with pytest.raises(ic.InvalidInputError, match="fft must be 'scipy' or an object with rfft2"):
        image(fft=bad)


def test_a_missing_library_is_named_with_its_remedy(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvkfft.opencl", None)
    with pytest.raises(ic.DeviceError, match=r"needs pyvkfft.*isetcl\[gpu-fft\].*fft='scipy'"):
        ic.device_fft()


@pytest.fixture(scope="module")
def device():
    try:
        return ic.device_fft()
    except ic.DeviceError as error:
        pytest.skip(str(error))


@pytest.mark.slow
@pytest.mark.parametrize("shape", [(54, 60), (3, 40, 45), (2, 2, 25, 27)])
def test_transforms_of_a_device_are_scipys_to_rounding(device, shape):
    rng = np.random.default_rng(1)
    values = rng.random(shape).astype(np.float32)
    size = (shape[-2] + 6, shape[-1] + 3)
    # Against double precision: float32 rounds by 6e-8, a few times log2 of the samples.
    expected = fft.rfft2(values.astype(float), size)
    found = device.rfft2(values, size)
    assert found.dtype == np.complex64
    assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()
    kept = found.copy()
    back = device.irfft2(found, size)
    assert back.dtype == np.float32
    np.testing.assert_allclose(back[..., : shape[-2], : shape[-1]], values, atol=3e-6)
    np.testing.assert_allclose(back[..., shape[-2] :, :], 0.0, atol=3e-6)
    np.testing.assert_array_equal(found, kept)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["layered_sum", "layered_over"])
def test_images_by_a_device_are_scipys_to_rounding(device, method):
    found, expected = image(method=method, fft=device), image(method=method)
    level = float(expected.irradiance.values.mean())
    assert np.abs(found.irradiance - expected.irradiance).max() < 3e-6 * level
    assert found.provenance["fft"].startswith("VkFFT on ")

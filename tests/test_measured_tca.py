"""Transverse chromatic aberration from the places of a line in an image."""

import math

import numpy as np
import pytest

import isetcl as ic
from isetcl.retina.grid import RetinalGrid
from isetcl.retina.image import RetinalImage
from isetcl.validation import measured_tca


def line_image(shifts_arcmin, slope=0.1, centre_deg=(15.0, 2.0), is_turned=False, noise=0.0):
    """Gaussian lines, displaced across by arcmin of field angle."""
    grid = RetinalGrid(ic.eyes.navarro(2.0), (0.8, 0.32), (80, 32), centre_deg)
    if is_turned:
        grid = RetinalGrid(ic.eyes.navarro(2.0), (0.32, 0.8), (32, 80), centre_deg)
    x, y = np.meshgrid(grid.x_deg - centre_deg[0], grid.y_deg - centre_deg[1])
    across, along = (y, x) if is_turned else (x, y)
    away = (across - slope * along) / math.hypot(1.0, slope)
    images = np.exp(-0.5 * ((away - np.array(shifts_arcmin)[:, None, None] / 60.0) / 0.05) ** 2)
    rng = np.random.default_rng(2)
    noisy = images + rng.normal(0.0, 1.0, images.shape) * noise
    wavelengths = np.linspace(450.0, 650.0, len(images))
    error = np.full(images.shape, noise)
    return RetinalImage.from_arrays(grid, wavelengths, noisy, standard_error=error)


def test_a_line_that_is_moved_is_found_where_it_is():
    found = measured_tca(line_image([-4.0, 1.0, 0.0]))
    # The line is nearly at right angles to the field, where a degree of field angle is a degree.
    np.testing.assert_allclose(found.shift_arcmin, [-4.0, 1.0, 0.0], atol=1e-2)
    assert found.field_deg == pytest.approx((15.0, 2.0), abs=1e-3)
    assert found.normal == pytest.approx(np.array([1.0, -0.1]) / math.hypot(1.0, 0.1), abs=1e-6)
    assert found.range_arcmin == pytest.approx(4.0, abs=1e-2)


def test_a_horizontal_line_at_the_side_moves_by_a_smaller_visual_angle():
    """Around the axis a step of field angle is sin(t)/t of a degree."""
    found = measured_tca(line_image([3.0, 0.0], 0.0, (30.0, 0.0), is_turned=True))
    t = math.radians(30.0)
    assert found.shift_arcmin[0] == pytest.approx(3.0 * math.sin(t) / t, rel=2e-3)
    assert found.normal == pytest.approx((0.0, 1.0))


def test_a_region_leaves_out_pixels_that_are_none():
    image = line_image([-4.0, 1.0, 0.0])
    image.irradiance.values[:, :3] = np.nan
    found = measured_tca(image, region=(4, 32, 0, 80))
    np.testing.assert_allclose(found.shift_arcmin, [-4.0, 1.0, 0.0], atol=1e-2)
    with pytest.raises(ic.InvalidInputError, match="choose a region without them"):
        measured_tca(image)


def test_the_standard_error_is_the_scatter_of_centroids():
    found = measured_tca(line_image(np.zeros(40), noise=2e-3))
    clear = found.shift_arcmin - np.mean(found.shift_arcmin)
    ratio = np.std(clear, ddof=1) / np.mean(found.standard_error_arcmin)
    # Chi of 39 degrees: 0.5 to 1.5 is 4 of its standard deviations of 0.113.
    assert 0.55 < ratio < 1.45


@pytest.mark.slow
def test_the_navarro_eye_shows_the_tca_of_its_chief_rays_at_15_degrees():
    """7.2 arcmin over 430 to 770 nm and 8.8 over 400 to 700 nm, by chief rays and from a render."""
    eye = ic.eyes.navarro(1.0, 0.4)
    # A line of the grid at 15 degrees, the picture half-way between two horizontal ones.
    width = 2.0 * math.degrees(math.atan(2.0 * math.tan(math.radians(15.0))))
    for ends, expected in (((430.0, 770.0), 7.2), ((400.0, 700.0), 8.8)):
        chief = eye.tca_arcmin((15.0, 0.0), ends, ends[1], 1.0)
        assert abs(chief[0, 0]) == pytest.approx(expected, abs=0.05)
        image = ic.render(
            ic.scenes.tca_grid(1.0, width),
            eye,
            fov_deg=(1.6, 0.32),
            resolution=(80, 16),
            centre_deg=(15.0, 1.9),
            spp=256,
            wavelengths_nm=list(ends),
            bands=2,
            progress=False,
        )
        found = measured_tca(image)
        assert found.field_deg[0] == pytest.approx(15.0, abs=0.03)
        # Coma moves centroids off the chief rays: 0.4 % with this pupil, 1 % with 2 mm.
        assert found.range_arcmin == pytest.approx(expected, abs=0.1)
        assert np.sign(found.shift_arcmin[0]) == np.sign(chief[0, 0])
        assert np.max(found.standard_error_arcmin) < 0.02


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data.isel(wavelength=[0]), "at least two wavelengths"),
        (lambda data: data.isel(x=slice(0, 41)), "dark on both sides"),
        (lambda data: data.isel(y=slice(0, 2)), "at least 4 pixels long"),
        (lambda data: data.assign(irradiance=data["irradiance"] * np.nan), "must be finite"),
        (lambda data: data.assign(irradiance=data["irradiance"] * 0.0), "one is black"),
    ],
)
def test_images_without_a_whole_line_are_refused(change, message):
    image = line_image([1.0, 0.0])
    with pytest.raises(ic.InvalidInputError, match=message):
        measured_tca(RetinalImage(change(image.dataset)))

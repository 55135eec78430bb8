"""The retinal image: labels, units, files, colour."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import xarray

import isetcl as ic
from isetcl.retina.depth import vergence_map


@pytest.fixture(scope="module")
def image():
    return ic.render(
        ic.scenes.two_planes(),
        ic.eyes.navarro(4.0, 2.0),
        fov_deg=(4.0, 2.0),
        resolution=(40, 20),
        spp=32,
        bands=4,
    )


def test_dimensions_coordinates_and_units(image):
    assert image.irradiance.dims == ("wavelength", "y", "x")
    assert image.irradiance.shape == (31, 20, 40)
    assert image.irradiance.attrs["units"] == "W m-2 nm-1"
    assert image.standard_error.shape == image.irradiance.shape
    x, y = image.dataset["x"].values, image.dataset["y"].values
    np.testing.assert_allclose(np.diff(x), 0.1)
    np.testing.assert_allclose(np.diff(y), -0.1)
    assert x.mean() == pytest.approx(0.0, abs=1e-12)


def test_retinal_positions_are_inverted_and_in_millimetres(image):
    top_left = image.dataset.isel(x=0, y=0)
    assert float(top_left["x_mm"]) > 0
    assert float(top_left["y_mm"]) < 0
    scale = float(image.dataset["x_mm"][10, 0]) / -float(image.dataset["x"][0])
    assert scale == pytest.approx(0.2874, rel=0.01)


def test_provenance_names_what_made_the_image(image):
    p = image.provenance
    assert p["eye"]["name"] == "navarro"
    assert p["method"] == "ray tracing"
    assert p["seed"] == 0
    assert p["samples_per_pixel"] == 32
    assert len(p["kernel"]) == 16
    assert p["is_complete"] is True
    assert {"device", "driver", "version", "scene_digest"} <= set(p)
    assert p["entrance_pupil_diameter_mm"] == pytest.approx(4.0 * 1.13, rel=0.01)


def test_a_saved_image_is_read_back_bit_for_bit(image, tmp_path):
    path = image.save(tmp_path / "image.nc")
    loaded = ic.RetinalImage.load(path)
    xarray.testing.assert_identical(loaded.dataset, image.dataset)
    assert loaded.provenance == image.provenance
    assert [p.name for p in tmp_path.iterdir()] == ["image.nc"]


def test_saving_where_one_cannot_write_is_a_clear_error(image, tmp_path):
    with pytest.raises(ic.FileError, match="cannot write"):
        image.save(tmp_path / "no" / "such" / "folder.nc")


def test_files_that_hold_no_image_are_refused(tmp_path):
    with pytest.raises(ic.FileError, match="does not exist"):
        ic.RetinalImage.load(tmp_path / "nothing.nc")
    text = tmp_path / "text.nc"
    text.write_text("hello")
    with pytest.raises(ic.FileError, match="no retinal image"):
        ic.RetinalImage.load(text)
    other = tmp_path / "other.nc"
    xarray.Dataset({"a": ("x", [1.0])}).to_netcdf(other, engine="h5netcdf")
    with pytest.raises(ic.FileError, match="irradiance"):
        ic.RetinalImage.load(other)


def flat(grid, wavelengths, value):
    return ic.RetinalImage.from_arrays(
        grid, wavelengths, np.full((len(wavelengths), *grid.shape), value)
    )


@pytest.fixture(scope="module")
def grid():
    return ic.RetinalGrid.of(ic.eyes.navarro(), 2.0, 4)


def test_illuminance_is_683_times_the_sum_over_v_lambda(grid):
    wavelengths = np.arange(400.0, 701.0, 10.0)
    import colour

    v = colour.colorimetry.SDS_LEFS_PHOTOPIC["CIE 1924 Photopic Standard Observer"]
    expected = 683.0 * 10.0 * sum(v[w] for w in wavelengths)
    lux = flat(grid, wavelengths, 1.0).illuminance_lux
    np.testing.assert_allclose(lux, expected, rtol=1e-12)
    assert lux.attrs["units"] == "lux"


def test_illuminance_of_one_wavelength_is_refused(grid):
    with pytest.raises(ic.InvalidInputError, match="at least two wavelengths"):
        _ = flat(grid, np.array([550.0]), 1.0).illuminance_lux


def test_scaling_to_a_mean_illuminance_scales_errors_and_says_so(image):
    scaled = image.scale_to_mean_illuminance(12.5)
    assert float(scaled.illuminance_lux.mean()) == pytest.approx(12.5, rel=1e-6)
    ratio = scaled.irradiance.values / image.irradiance.values
    np.testing.assert_allclose(ratio, ratio.flat[0], rtol=1e-5)
    assert scaled.relative_error == pytest.approx(image.relative_error, rel=1e-5)
    assert scaled.provenance["scaled_to_mean_illuminance_lux"] == 12.5
    with pytest.raises(ic.InvalidInputError, match="lux must be > 0"):
        image.scale_to_mean_illuminance(0.0)


def test_daylight_is_neutral_in_srgb(grid):
    wavelengths = np.arange(400.0, 701.0, 10.0)
    light = ic.Spectrum.illuminant("D65").at(wavelengths)
    data = np.tile(light[:, None, None], (1, *grid.shape))
    white = ic.RetinalImage.from_arrays(grid, wavelengths, data).to_srgb()
    assert white.dtype == np.uint8
    assert np.ptp(white[0, 0].astype(int)) <= 2
    assert white.min() >= 252


def test_equal_energy_is_neutral_when_the_eye_is_adapted_to_it(grid):
    wavelengths = np.arange(400.0, 701.0, 10.0)
    neutral = flat(grid, wavelengths, 1.0).to_srgb(white_point="E")
    pink = flat(grid, wavelengths, 1.0).to_srgb()
    assert np.ptp(neutral[0, 0].astype(int)) <= 3
    assert np.ptp(pink[0, 0].astype(int)) > 5
    with pytest.raises(ic.InvalidInputError, match="unknown white point"):
        flat(grid, wavelengths, 1.0).to_srgb(white_point="X99")


@pytest.mark.parametrize(("wavelength", "channel"), [(460.0, 2), (530.0, 1), (640.0, 0)])
def test_single_wavelengths_have_their_colour(grid, wavelength, channel):
    pixel = flat(grid, np.array([wavelength]), 1.0).to_srgb()[0, 0]
    assert int(np.argmax(pixel)) == channel


def test_white_can_be_given_in_lux(grid):
    wavelengths = np.arange(400.0, 701.0, 10.0)
    picture = flat(grid, wavelengths, 1.0)
    lux = float(picture.illuminance_lux.mean())
    dim = picture.to_srgb(white_lux=4 * lux, white_point="E")
    # A quarter of white: sRGB code 137.
    assert abs(int(dim[0, 0, 1]) - 137) <= 2


def test_plot_draws_the_image_in_degrees(image):
    ax = image.plot()
    assert ax.images[0].get_extent() == pytest.approx([-2.0, 2.0, -1.0, 1.0])
    assert "deg" in ax.get_xlabel()


def test_the_depth_map_shows_the_planes():
    grid = ic.RetinalGrid.of(ic.eyes.navarro(), 2.0, 20)
    depth = vergence_map(ic.scenes.two_planes(edge_angle_deg=0.0), grid)
    np.testing.assert_allclose(depth[:, :10], 2.0, rtol=1e-6)
    np.testing.assert_allclose(depth[:, 10:], 0.5, rtol=1e-6)
    assert not vergence_map(ic.scenes.uniform(), grid).any()


def test_datasets_without_irradiance_are_refused():
    with pytest.raises(ic.InvalidInputError, match="irradiance"):
        ic.RetinalImage(xarray.Dataset())


def test_provenance_is_json(image):
    assert json.loads(image.dataset.attrs["provenance"])["format_version"] == 1


def test_uneven_wavelengths_weigh_by_their_width():
    grid = ic.RetinalGrid.of(ic.eyes.navarro(), 2.0, 4)
    uneven = np.concatenate([np.arange(400.0, 550.0, 2.0), np.arange(550.0, 701.0, 10.0)])
    image = flat(grid, uneven, 1.0)
    # 683 lm/ic.Spectrum.equal_energy(100.0) times the integral of V, 106.857 nm.
    assert float(image.illuminance_lux.mean()) == pytest.approx(683.0 * 106.857, rel=2e-3)
    pixel = image.to_srgb(white_point="E")[0, 0].astype(int)
    assert np.ptp(pixel) <= 4


def test_a_crash_while_writing_leaves_the_old_file(tmp_path, monkeypatch):
    import xarray

    grid = ic.RetinalGrid.of(ic.eyes.navarro(), 2.0, 4)
    image = flat(grid, np.array([500.0, 600.0]), 1.0)
    path = tmp_path / "image.nc"
    path.write_bytes(b"precious")

    def crash(self, to, **_):
        Path(to).write_bytes(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(xarray.Dataset, "to_netcdf", crash)
    with pytest.raises(ic.FileError, match="disk full"):
        image.save(path)
    assert path.read_bytes() == b"precious"
    assert [p.name for p in tmp_path.iterdir()] == ["image.nc"]


def test_a_crash_while_writing_a_report_file_leaves_the_old_one(tmp_path, monkeypatch):
    from isetcl.output import write_file

    path = tmp_path / "a.png"
    path.write_bytes(b"precious")
    real = Path.write_bytes

    def crash(self, data):
        real(self, b"half")
        raise OSError("disk full")

    monkeypatch.setattr(Path, "write_bytes", crash)
    with pytest.raises(ic.FileError, match="disk full"):
        write_file(path, b"new")
    assert path.read_bytes() == b"precious"
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


def test_scaling_scales_the_spectral_error_too():
    image = ic.render(ic.scenes.two_planes(), ic.eyes.navarro(), resolution=8, spp=16, bands=2)
    scaled = image.scale_to_mean_illuminance(2.0 * float(image.illuminance_lux.mean()))
    np.testing.assert_allclose(scaled.standard_error, 2.0 * image.standard_error, rtol=1e-5)


def test_relative_error_counts_lit_pixels_only():
    from isetcl.retina.image import relative_error

    assert relative_error(np.array([2.0, 0.0]), np.array([0.1, 9.0])) == pytest.approx(0.05)


def test_white_is_the_brightest_part():
    grid = ic.RetinalGrid.of(ic.eyes.navarro(), 2.0, 10)
    w = np.arange(400.0, 701.0, 10.0)
    data = np.full((31, 10, 10), 0.25)
    data[:, :, :3] = 1.0
    codes = ic.RetinalImage.from_arrays(grid, w, data).to_srgb(white_point="E")[..., 1]
    assert codes[0, 0] >= 253
    assert abs(int(codes[0, 9]) - 137) <= 2


def test_the_depth_map_is_seen_from_the_entrance_pupil():
    grid = ic.RetinalGrid.of(ic.eyes.navarro(), (30.0, 0.1), (601, 2))
    quad = ic.Quad((-0.01, -1, -0.05), (0.02, 0, 0), (0, 2, 0))
    from isetcl.retina.depth import vergence_map

    row = vergence_map(
        ic.Scene((ic.SceneObject("q", quad, ic.Emission(ic.Spectrum.equal_energy(100.0))),)), grid
    )[0]
    edge = np.abs(grid.x_deg[row > 0]).max()
    # 10 mm aside at 50 mm, from the pupil 3.04 mm behind the cornea (Navarro): 10.67 deg
    assert edge == pytest.approx(math.degrees(math.atan(10 / 53.04)), abs=0.06)

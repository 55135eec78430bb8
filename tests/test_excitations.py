"""Excitations of receptors against closed forms, sums over many points, and published numbers."""

import sys

import numpy as np
import pytest
from cone_oracle import expected_excitations
from scipy.special import erf

import isetcl as ic
from isetcl import retina
from isetcl.cones import ConeMosaic, Excitations, Observer
from isetcl.cones.light_catch import mean_segment_factor
from isetcl.device.cone_apertures import frame_groups
from isetcl.errors import FileError, InvalidInputError, OutOfMemoryError
from isetcl.eye.people.macular_pigment import macular_fraction, standard_lens_density
from isetcl.spectrum import luminous_efficiency

pytestmark = pytest.mark.filterwarnings("ignore:pixels are up to")

EYE = ic.eyes.navarro()
WAVES = np.arange(400.0, 701.0, 10.0)
EXACT = {"single": 4e-6, "double": 1e-9}
RNG = np.random.default_rng(7)


def image_of(values, fov_deg=0.4, waves=WAVES, centre_deg=(0.0, 0.0)):
    """An image from (rows, columns), or from (wavelengths, rows, columns)."""
    values = np.asarray(values, dtype=np.float64)
    if values.ndim == 2:
        values = np.broadcast_to(values, (len(waves), *values.shape))
    fov = fov_deg if np.ndim(fov_deg) else (fov_deg, fov_deg)
    grid = ic.RetinalGrid.of(EYE, fov, values.shape[:0:-1], centre_deg)
    return ic.RetinalImage.from_arrays(grid, waves, values.copy())


def mosaic_of(positions, types=None, spacing_um=4.0, **options):
    types = np.zeros(len(positions), dtype=int) if types is None else types
    return ConeMosaic.from_positions(positions, types, spacing_um=spacing_um, **options)


@pytest.mark.parametrize("aperture", ["pillbox", "gaussian"])
def test_the_image_is_averaged_over_the_aperture(precision, aperture):
    # Pixels of random brightness; the mean over an aperture by a fine sum over its points. A
    # wavelength grid of two, an observer without lengths: ratios to a uniform image are the means.
    rng = np.random.default_rng(3)
    brightness = rng.uniform(size=(20, 24))
    fov = 0.1
    image = image_of(brightness, fov)
    even = image_of(np.ones((20, 24)), fov)
    places = rng.uniform(-0.022, 0.022, size=(15, 2))
    spacing = np.linspace(0.5, 10.0, 15)
    mosaic = mosaic_of(places, spacing_um=spacing, aperture=aperture)
    with pytest.warns(UserWarning, match="too coarse"):
        found = mosaic.excitations(image, precision=precision)
    found = found.mean.values[0]
    flat = mosaic.excitations(even, precision=precision).mean.values[0]
    x_mm, y_mm = image.dataset["x_mm"].values[0], image.dataset["y_mm"].values[:, 0]
    per_deg = [abs(mm[-1] - mm[0]) / (fov * (1 - 1 / len(mm))) for mm in (x_mm, y_mm)]
    reach = 2.6 if aperture == "gaussian" else 1.0
    u = (np.arange(600) + 0.5) / 300 - 1
    u, v = np.meshgrid(reach * u, reach * u)
    weight = np.exp(-(u**2) - v**2) if aperture == "gaussian" else (u**2 + v**2 < 1) * 1.0
    for (x, y), radius, share in zip(
        places, 0.5e-3 * mosaic.aperture_um, found / flat, strict=True
    ):
        column = np.floor((x + radius * u / per_deg[0] + fov / 2) / fov * 24).astype(int)
        row = np.floor((fov / 2 - y - radius * v / per_deg[1]) / fov * 20).astype(int)
        assert share == pytest.approx(
            np.sum(weight * brightness[row, column]) / np.sum(weight), abs=1.5e-3
        )


def test_a_gaussian_aperture_sees_a_step_as_the_error_function():
    brightness = np.zeros((64, 64))
    brightness[:, 32:] = 1.0
    image, even = image_of(brightness, 0.4), image_of(np.ones((64, 64)), 0.4)
    places = np.stack([np.linspace(-0.03, 0.03, 31), np.zeros(31)], axis=1)
    mosaic = mosaic_of(places, spacing_um=20.0, aperture="gaussian")
    share = mosaic.excitations(image).mean.values[0] / mosaic.excitations(even).mean.values[0]
    x_mm = image.dataset["x_mm"].values[32]
    per_deg = abs(x_mm[-1] - x_mm[0]) / (0.4 * 63 / 64)
    expected = 0.5 * (1 + erf(places[:, 0] * per_deg / (0.5e-3 * mosaic.aperture_um)))
    np.testing.assert_allclose(share, expected, atol=3e-4)


def test_excitations_are_flat_in_a_uniform_image_and_grow_with_time(precision):
    image = image_of(np.full((96, 96), 2e-3))
    places = RNG.uniform(-0.15, 0.15, size=(300, 2))
    mosaic = mosaic_of(places, spacing_um=4.0)
    options = {"segments": "none", "has_macular_pigment": False, "precision": precision}
    short = mosaic.excitations(image, 0.005, **options).mean.values
    twice = mosaic.excitations(image, 0.010, **options).mean.values
    assert np.ptp(short) / short.mean() < 2e-5
    np.testing.assert_allclose(twice, 2 * short, rtol=1e-6)


def test_a_foveal_cone_catches_the_published_number_at_five_lux():
    # 250 000 cones/mm^2: spacing 2.1491 um, aperture 1.6978 um; equal energy through the lens.
    waves = np.arange(400.0, 701.0)
    spectrum = 10.0 ** -standard_lens_density(waves)
    spectrum *= 5.0 / (683.0 * np.sum(spectrum * luminous_efficiency(waves)))
    image = image_of(np.ones((32, 32)) * spectrum[:, None, None], 0.06, waves)
    assert float(image.illuminance_lux.mean()) == pytest.approx(5.0, rel=1e-3)
    spacing = np.sqrt(2.0 / (np.sqrt(3.0) * 250e3)) * 1e3
    mosaic = mosaic_of(np.zeros((3, 2)), [0, 1, 2], spacing)
    assert mosaic.aperture_um[0] == pytest.approx(1.6978, abs=1e-4)
    bare = mosaic.excitations(image).mean.values[0]
    np.testing.assert_allclose(bare, (117.5, 84.6, 10.1), rtol=5e-3)
    dark = mosaic.excitations(image, dark_rate_hz=250.0).mean.values[0]
    np.testing.assert_allclose(dark - bare, 1.25, atol=1e-4)


def test_receptors_see_through_the_pigment_of_their_own_eccentricity():
    image = image_of(np.full((30, 30), 1e-3), 24.0)
    places = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, -8.0], [10.0, 3.0]])
    mosaic = mosaic_of(places, spacing_um=400.0)
    options = {"segments": "none", "precision": "double"}
    seen = mosaic.excitations(image, **options).mean.values[0]
    clear = mosaic.excitations(image, has_macular_pigment=False, **options).mean.values[0]
    observer = Observer()
    through = 10.0 ** (
        -np.outer(macular_fraction(np.hypot(*places.T)), observer.macular_density(WAVES))
    )
    weight = WAVES * observer.quantal_efficiency(WAVES)[0]
    np.testing.assert_allclose(seen / clear, through @ weight / weight.sum(), rtol=1e-9)


def test_isetbio_s_segment_factor_is_a_mean_over_wavelengths():
    image = image_of(np.full((30, 30), 1e-3), 24.0)
    mosaic = mosaic_of(np.array([[0.0, 0.0], [4.86, 0.0], [10.0, 0.0]]), spacing_um=400.0)
    options = {"has_macular_pigment": False, "precision": "double"}
    full = mosaic.excitations(image, segments="none", **options).mean.values[0]
    mean = mosaic.excitations(image, segments="mean", **options).mean.values[0]
    observer = Observer()
    short = observer.quantal_efficiency(WAVES, 21.2 / 47.81)[0]
    factor = np.mean(short / observer.quantal_efficiency(WAVES)[0])
    np.testing.assert_allclose(mean / full, [1.0, factor, factor], rtol=1e-9)
    spectral = mosaic.excitations(image, segments="spectral", **options).mean.values[0]
    expected = np.sum(WAVES * short) / np.sum(WAVES * observer.quantal_efficiency(WAVES)[0])
    np.testing.assert_allclose(spectral / full, [1.0, expected, expected], rtol=1e-9)


def test_a_gaze_that_moves_is_a_mosaic_that_moves():
    image = image_of(RNG.uniform(size=(64, 64)), 0.3)
    mosaic = mosaic_of(RNG.uniform(-0.05, 0.05, size=(50, 2)), spacing_um=3.0)
    path = np.array([[0.0, 0.0], [0.03, -0.01], [-0.02, 0.04]])
    frames = mosaic.excitations(image, gaze_deg=path, precision="double", frame_time_s=0.01)
    np.testing.assert_allclose(frames.dataset["time_s"], [0.0, 0.01, 0.02])
    labels = np.stack([frames.dataset["gaze_x_deg"], frames.dataset["gaze_y_deg"]], axis=1)
    np.testing.assert_array_equal(labels, path)
    for frame, step in zip(frames.mean.values, path, strict=True):
        # The eccentricity of the moved mosaic is still its own.
        still = mosaic.moved(step).excitations(image, precision="double")
        np.testing.assert_allclose(frame, still.mean.values[0], rtol=1e-6)


def test_noise_is_poisson_and_every_instance_its_own():
    image = image_of(np.full((16, 16), 1e-3))
    mosaic = mosaic_of(RNG.uniform(-0.1, 0.1, size=(40, 2)), [0, 1, 2, 0] * 10, spacing_um=4.0)
    made = mosaic.excitations(image, 0.0005, seed=3)
    many = made.instances(4000, seed=5)
    mean, variance = many.mean("instance").values[0], many.var("instance").values[0]
    expected = made.mean.values[0]
    # Six standard errors of 40 means and variances: Poisson's fourth moment is m + 3 m^2.
    np.testing.assert_array_less(np.abs(mean - expected), 6 * np.sqrt(expected / 4000))
    spread = np.sqrt((expected + 2 * expected**2) / 4000)
    np.testing.assert_array_less(np.abs(variance - expected), 6 * spread)
    few = made.instances(10, seed=5)
    np.testing.assert_array_equal(few, many.isel(instance=slice(0, 10)))
    np.testing.assert_array_equal(made.counts, made.instances(1, seed=3)[0])
    assert not np.array_equal(few[0], few[1])


def test_excitations_come_back_from_their_file(tmp_path):
    image = image_of(np.full((16, 16), 1e-3))
    mosaic = mosaic_of(np.zeros((3, 2)), [0, 1, 2])
    made = mosaic.excitations(image, 0.02, seed=11)
    read = ic.cones.Excitations.load(made.save(tmp_path / "e.nc"))
    np.testing.assert_array_equal(read.mean, made.mean)
    np.testing.assert_array_equal(read.counts, made.counts)
    assert read.provenance["observer"]["macular_peak_density"] == 0.35
    assert float(read.of("M")[0, 0]) == float(made.mean[0, 1])
    (tmp_path / "other.nc").write_text("nothing")
    with pytest.raises(FileError, match=r"other\.nc"):
        Excitations.load(tmp_path / "other.nc")
    with pytest.raises(FileError, match=r"no\.nc"):
        Excitations.load(tmp_path / "no.nc")
    with pytest.raises(InvalidInputError, match="coordinate 'type'"):
        Excitations(made.dataset.drop_vars("type"))
    with pytest.raises(InvalidInputError, match="variable 'mean'"):
        Excitations(image.dataset)


def test_rods_and_dichromats_catch_by_their_own_pigments():
    image = image_of(np.full((16, 16), 1e-3))
    mosaic = mosaic_of(np.zeros((4, 2)), [0, 1, 2, 3])
    normal = mosaic.excitations(image).mean.values[0]
    assert np.all(normal > 0)
    protanope = mosaic.excitations(image, observer=Observer.dichromat("protan")).mean.values[0]
    np.testing.assert_allclose(protanope, normal[[1, 1, 2, 3]], rtol=1e-6)


UNEVEN = np.array([400.0, 405.0, 430.0, 480.0, 500.0, 503.0, 560.0, 600.0, 660.0, 700.0])


@pytest.mark.parametrize("aperture", ["pillbox", "gaussian"])
@pytest.mark.parametrize(
    ("fov", "centre", "waves", "spacing"),
    [
        ((0.3, 0.3), (0.0, 0.0), WAVES, (1.0, 12.0)),
        ((0.3, 0.25), (16.0, -12.0), UNEVEN, (3.0, 12.0)),
        ((12.0, 9.0), (16.0, 0.0), WAVES[::10], (50.0, 300.0)),
    ],
    ids=["oblong pixels", "periphery, uneven steps", "wide field"],
)
def test_excitations_are_those_of_the_formulas(precision, aperture, fov, centre, waves, spacing):
    rng = np.random.default_rng(11)
    image = image_of(rng.uniform(size=(len(waves), 24, 35)) ** 3, fov, waves, centre)
    places = np.array(centre) + rng.uniform(-0.27, 0.27, (12, 2)) * fov
    um = rng.uniform(*spacing, 12)
    mosaic = mosaic_of(places, rng.integers(0, 3, 12), um, aperture=aperture)
    gaze = np.array([[0.0, 0.0], [0.06 * fov[0], -0.03 * fov[1]]])
    for has_pigment in (True, False):
        options = {"gaze_deg": gaze, "has_macular_pigment": has_pigment, "precision": precision}
        options["uneven_wavelengths"] = "refuse" if waves is not UNEVEN else "bins"
        found = mosaic.excitations(image, 0.02, **options).mean.values
        for frame, look in zip(found, gaze, strict=True):
            expected = expected_excitations(
                mosaic, image, 0.02, look, has_macular_pigment=has_pigment
            )
            np.testing.assert_allclose(frame, expected, rtol=EXACT[precision])


def test_apertures_of_many_pixels_are_summed_in_strips(precision):
    # Discs 31 to 100 pixels wide: below, at and beyond one, two and three strips of 32 columns.
    rng = np.random.default_rng(12)
    image = image_of(rng.uniform(size=(2, 110, 110)) ** 9, 0.11, np.array([500.0, 600.0]))
    pixel_um = 1e3 * float(np.ptp(image.dataset["x_mm"].values[55])) / 109
    widths = np.array([31.0, 31.9, 32.0, 33.0, 63.5, 64.0, 65.0, 95.7, 97.0, 100.0])
    places = np.stack([np.linspace(-0.004, 0.004, 10), np.linspace(0.003, -0.003, 10)], axis=1)
    mosaic = mosaic_of(places, spacing_um=widths * pixel_um / 0.79)
    found = mosaic.excitations(image, precision=precision).mean.values[0]
    np.testing.assert_allclose(found, expected_excitations(mosaic, image, 0.005), EXACT[precision])


def test_light_beside_an_aperture_does_not_reach_it(precision):
    # 1e9 times as bright, in the pixels of the square around the disc that the disc leaves out.
    rng = np.random.default_rng(14)
    waves = np.array([500.0, 600.0])
    pixel_um = 1e3 * float(np.ptp(image_of(np.ones((40, 40))).dataset["x_mm"].values[20])) / 39
    mosaic = mosaic_of(rng.uniform(-0.003, 0.003, (8, 2)), spacing_um=12.0 * pixel_um / 0.79)
    column, row = (20.0 + np.array([[1.0], [-1.0]]) * mosaic.positions_deg.T / 0.01).round(9)
    middles = np.stack([column, row], axis=1)
    x, y = np.meshgrid(np.arange(40), np.arange(40))
    for i, middle in enumerate(middles):
        away = [
            np.maximum(np.abs(v + 0.5 - m) - 0.5, 0.0) for v, m in zip((x, y), middle, strict=True)
        ]
        values = np.where(np.hypot(*away) < 6.02, rng.uniform(0.5, 1.0, (40, 40)), 1e9)
        dim = image_of(np.minimum(values, 1.0) * np.ones((2, 1, 1)), waves=waves)
        bright = image_of(values * np.ones((2, 1, 1)), waves=waves)
        found = [
            mosaic.excitations(each, precision=precision).mean.values[0, i]
            for each in (dim, bright)
        ]
        assert found[0] == found[1]


def test_s_cones_keep_their_digits_in_red_light():
    # Deep red, of which S cones catch 1e-7 of what L cones do, beside a little blue.
    spectrum = np.where(WAVES > 640, 1.0, 0.0) + np.where(WAVES < 450, 1e-10, 0.0)
    values = np.random.default_rng(15).uniform(size=(12, 12))
    image = image_of(values * spectrum[:, None, None], 0.1)
    mosaic = mosaic_of(np.zeros((3, 2)), [0, 1, 2])
    found = mosaic.excitations(image).mean.values[0]
    assert found[2] < 1e-6 * found[0]
    np.testing.assert_allclose(found, expected_excitations(mosaic, image, 0.005), EXACT["single"])


def test_frames_are_grouped_with_their_neighbours():
    # Two fixations a degree apart in turn, and one glance elsewhere: lanes must not look at both.
    rng = np.random.default_rng(16)
    shifts = rng.uniform(0.0, 2.0, (41, 2)) + 150.0 * (np.arange(41)[:, None] % 2)
    shifts[7] = -400.0
    groups = frame_groups(shifts, np.array([4.0, 4.0]), 16)
    np.testing.assert_array_equal(np.sort(np.concatenate(groups)), np.arange(41))
    assert max(len(group) for group in groups) <= 16
    assert max(np.ptp(shifts[group], axis=0).max() for group in groups) < 2.0
    assert len(groups) <= 7


def test_tiny_apertures_see_one_pixel(precision):
    rng = np.random.default_rng(13)
    values = rng.uniform(size=(20, 20))
    image, even = image_of(values, 2.0), image_of(np.ones((20, 20)), 2.0)
    column, row = rng.integers(0, 20, (2, 30))
    inside = rng.uniform(0.02, 0.98, (2, 30))
    places = np.stack([-1.0 + (column + inside[0]) / 10, 1.0 - (row + inside[1]) / 10], axis=1)
    mosaic = mosaic_of(places, spacing_um=0.01 * 28.0)
    with pytest.warns(UserWarning, match="too coarse"):
        seen = mosaic.excitations(image, precision=precision).mean.values[0]
    full = mosaic.excitations(even, precision=precision).mean.values[0]
    np.testing.assert_allclose(seen / full, values[row, column], rtol=1e-5)


@pytest.mark.parametrize("spacing", [1e-5, 1e-3, 4.0])
def test_receptors_that_touch_the_border_are_seen_whole(precision, spacing):
    # On a wide image single precision rounds the border away; no receptor may lose its light.
    waves = np.array([450.0, 550.0, 650.0])
    image = image_of(np.full((3, 20, 4096), 1e-3), (4.096, 0.02), waves)
    middle = mosaic_of(np.zeros((1, 2)), spacing_um=spacing)
    options = {"precision": precision, "segments": "none", "has_macular_pigment": False}
    pixel_mm = np.abs(np.diff(image.dataset["x_mm"].values[10, -2:].astype(float)))[0]
    edge = 2.048 - 0.5 * middle.aperture_um[0] / (1e3 * pixel_mm / 1e-3) * (1.0 + 1e-3)
    mosaic = mosaic_of(np.array([[edge, 0.0], [-edge, 0.0]]), spacing_um=spacing)
    expected = np.full(2, middle.excitations(image, **options).mean.values[0, 0])
    np.testing.assert_allclose(mosaic.excitations(image, **options).mean.values[0], expected, 1e-6)
    with pytest.raises(InvalidInputError, match="1 of 2 receptors look beyond the image"):
        mosaic.moved((0.01, 0.0)).excitations(image)


@pytest.mark.parametrize("spacing", [1e-4, 4.0])
def test_receptors_over_the_border_are_refused_however_small(spacing):
    waves = np.array([450.0, 550.0])
    image = image_of(np.full((2, 20, 4096), 1e-3), (4.096, 0.02), waves)
    radius_px = 0.5 * 0.79 * spacing / (1e3 * np.ptp(image.dataset["x_mm"].values[10]) / 4095)
    edge = 2.048 + 0.7e-3 * radius_px
    with pytest.raises(InvalidInputError, match="1 of 1 receptors look beyond the image"):
        mosaic_of(np.array([[edge, 0.0]]), spacing_um=spacing).excitations(image)


def test_gaussians_must_lie_in_the_image_to_where_they_are_cut_off():
    image = image_of(np.ones((40, 40)), 0.4)
    per_deg = np.ptp(image.dataset["x_mm"].values[20].astype(float)) / (0.4 * 39 / 40)
    for radii, is_inside in ((2.7, True), (2.5, False)):
        mosaic = mosaic_of(np.zeros((1, 2)), spacing_um=20.0, aperture="gaussian")
        edge = 0.2 - radii * 0.5e-3 * mosaic.aperture_um[0] / per_deg
        for place in ((edge, 0.0), (-edge, 0.0), (0.0, edge), (0.0, -edge)):
            if is_inside:
                mosaic.moved(place).excitations(image)
                continue
            with pytest.raises(InvalidInputError, match="look beyond the image"):
                mosaic.moved(place).excitations(image)


def test_places_on_wide_images_are_as_exact_as_on_small_ones():
    # A sharp edge in pixel 3000 of 4096: what an aperture of one pixel sees is where it lies.
    values = np.zeros((2, 8, 4096))
    values[:, :, 3001:] = 1.0
    waves = np.array([500.0, 600.0])
    image, even = image_of(values, (40.96, 0.08), waves), image_of(values + 1, (40.96, 0.08), waves)
    # One more at the left, so that all columns are needed.
    at = np.append(3001 + np.linspace(-0.3, 0.3, 31), 10.0)
    mosaic = mosaic_of(np.stack([-20.48 + 0.01 * at, np.zeros(32)], axis=1), spacing_um=4.0)
    single, double = (
        mosaic.excitations(image, precision=p).mean.values[0]
        / mosaic.excitations(even, precision=p).mean.values[0]
        for p in ("single", "double")
    )
    np.testing.assert_allclose(single, double, atol=1e-6)


def test_uneven_wavelength_steps_integrate_the_same_spectrum():
    # Bins half-way to the neighbours: a smooth spectrum on steps of 1 to 5 nm against every nm.
    fine = np.arange(400.0, 701.0)
    uneven = 399.0 + np.cumsum(np.tile([1.0, 4.0, 5.0, 2.0, 3.0, 5.0, 3.0], 13))
    uneven = np.unique(np.append(uneven[uneven < 700.0], 700.0))
    mosaic = mosaic_of(np.array([[0.0, 0.0], [0.0, 1.0], [2.0, 0.0]]), [0, 1, 2])
    for segments in ("spectral", "mean"):
        found = []
        for waves in (fine, uneven):
            spectrum = 1e-3 * np.exp(-(((waves - 520.0) / 45.0) ** 2))
            image = image_of(spectrum[:, None, None] * np.ones((8, 8)), 6.0, waves)
            options = {"segments": segments, "uneven_wavelengths": "bins"}
            found.append(mosaic.excitations(image, **options).mean.values[0])
        np.testing.assert_allclose(found[1], found[0], rtol=1e-3)


def test_the_mean_segment_factor_is_a_mean_over_wavelengths_and_not_over_samples():
    # Every nm where cones absorb little and the factor is small, every 5 nm elsewhere.
    fraction = np.array([1.0, 0.7, 21.2 / 47.81])
    observer, fine = Observer(), np.arange(400.0, 701.0)
    crowded = np.concatenate([np.arange(400.0, 480.0), np.arange(480.0, 701.0, 5.0)])
    found = mean_segment_factor(observer, crowded, fraction)
    whole = observer.quantal_efficiency(fine)[0]
    expected = [np.mean(observer.quantal_efficiency(fine, f)[0] / whole) for f in fraction]
    np.testing.assert_allclose(found, expected, rtol=1e-3)


def test_the_warning_of_coarse_pixels_names_a_resolution_that_is_enough(recwarn):
    import re
    import warnings

    mosaic = mosaic_of(np.zeros((1, 2)), spacing_um=3.0)
    with pytest.warns(UserWarning, match="too coarse") as caught:
        mosaic.excitations(image_of(np.ones((2, 30, 40)), 1.0, WAVES[:2]))
    columns, rows = map(int, re.search(r"at least (\d+) x (\d+)", str(caught[0].message)).groups())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mosaic.excitations(image_of(np.ones((2, rows, columns)), 1.0, WAVES[:2]))
    # 2.37 um against pixels of 1 deg, some 290 um, over 40 and 30.
    assert columns == pytest.approx(290 / 2.37, rel=0.05)
    assert rows == pytest.approx(290 / 2.37, rel=0.05)


def test_without_light_only_the_dark_excites():
    mosaic = mosaic_of(RNG.uniform(-0.1, 0.1, (20, 2)))
    black = image_of(np.zeros((16, 16)))
    made = mosaic.excitations(black, 0.02)
    assert np.all(made.mean.values == 0)
    assert np.all(made.counts.values == 0)
    dark = mosaic.excitations(black, 0.02, dark_rate_hz=100.0).mean.values
    np.testing.assert_allclose(dark, 2.0, rtol=1e-6)


def test_parts_of_mosaics_frames_and_wavelengths_are_computed_alike(monkeypatch):
    image = image_of(RNG.uniform(size=(24, 24)), 0.3)
    mosaic = mosaic_of(RNG.uniform(-0.05, 0.05, (50, 2)), RNG.integers(0, 3, 50))
    path = RNG.uniform(-0.05, 0.05, (9, 2))
    options = {"gaze_deg": path, "segments": "mean"}
    whole = mosaic.excitations(image, **options).mean.values
    monkeypatch.setattr("isetcl.device.cone_apertures._MOST_RECEPTORS", 7)
    monkeypatch.setattr("isetcl.device.cone_apertures._MOST_FRAMES", 4)
    monkeypatch.setattr("isetcl.cones.light_catch._MOST_EFFICIENCIES", 31 * 16)
    np.testing.assert_array_equal(mosaic.excitations(image, **options).mean.values, whole)


def test_instances_of_one_seed_are_not_those_of_the_next():
    made = mosaic_of(np.zeros((400, 2))).excitations(image_of(np.full((16, 16), 1e-3)))
    by_seed = [made.instances(3, seed=seed).values for seed in (5, 6, 7)]
    every = np.concatenate(by_seed).reshape(9, -1).astype(float)
    correlation = np.corrcoef(every)[np.triu_indices(9, 1)]
    # Independent rows of 400: the coefficients scatter by 1/20.
    assert np.abs(correlation).max() < 0.25
    frames = mosaic_of(np.zeros((400, 2))).excitations(
        image_of(np.full((16, 16), 1e-3)), gaze_deg=np.zeros((2, 2))
    )
    both = frames.counts.values.astype(float)
    assert abs(np.corrcoef(both)[0, 1]) < 0.25


def test_anyone_can_draw_an_instance_again():
    # The documented generator and key, so that files and other programs find the same numbers.
    made = mosaic_of(np.zeros((30, 2))).excitations(image_of(np.full((16, 16), 1e-3)))
    drawn = np.random.Generator(np.random.Philox(key=[5, 2])).poisson(made.mean.values)
    np.testing.assert_array_equal(made.instances(3, seed=5)[2], drawn)


def test_provenance_and_labels_say_how_excitations_were_made():
    mosaic = mosaic_of(np.array([[0.1, -0.05], [0.0, 0.02]]), [2, 1], provenance={"by": "hand"})
    made = mosaic.excitations(image_of(np.ones((32, 32))), 0.02, dark_rate_hz=3.0, seed=4)
    details = made.provenance
    assert details["mosaic"]["by"] == "hand"
    assert details["dark_rate_hz"] == 3.0
    assert details["image"]["eye"]["name"] == EYE.name
    assert (made.integration_time_s, made.dataset.attrs["seed"]) == (0.02, 4)
    np.testing.assert_array_equal(made.dataset["x_deg"], [0.1, 0.0])
    np.testing.assert_array_equal(made.dataset["y_deg"], [-0.05, 0.02])
    np.testing.assert_array_equal(made.types, [2, 1])
    np.testing.assert_array_equal(made.of(2), made.of("S"))
    assert made.of("S").shape == (1, 1)
    assert made.of("ROD").shape == (1, 0)
    assert repr(made).startswith("<Excitations of 2 receptors in 1 frame of 20 ms, mean ")
    for kind in ("K", 7, 1.5):
        with pytest.raises(InvalidInputError, match="receptor type"):
            made.of(kind)


def test_macular_pigment_is_not_counted_twice():
    image = image_of(np.ones((24, 24)), 0.2)
    mosaic = mosaic_of(np.array([[0.0, 0.0], [0.05, 0.02]]), [0, 2])
    behind = image.through(retina.macular_pigment())
    with pytest.raises(InvalidInputError, match="has_macular_pigment must be False"):
        mosaic.excitations(behind)
    found = mosaic.excitations(behind, has_macular_pigment=False).mean.values
    np.testing.assert_allclose(found, mosaic.excitations(image).mean.values, rtol=2e-3)


@pytest.fixture(scope="module")
def clear_and_behind():
    """Light of an even field on four cones: an image, and at the cones, clear and behind a lens."""
    mosaic = mosaic_of(np.zeros((3, 2)), [0, 1, 2])
    scene, lens = ic.scenes.uniform(), ic.OcularMedia(32.0, "cie_170")
    ways = ({"fov_deg": 0.1, "resolution": 4}, {"at": mosaic})
    waves = np.arange(400.0, 701.0, 2.0)
    light = [
        [
            ic.render(scene, EYE, spp=2, bands=2, wavelengths_nm=waves, media=media, **way)
            for media in (None, lens)
        ]
        for way in ways
    ]
    return mosaic, lens, light


@pytest.mark.parametrize("way", [0, 1], ids=["image", "at the cones"])
def test_light_without_a_lens_is_warned_of_and_can_still_pass_one(clear_and_behind, way, recwarn):
    mosaic, lens, light = clear_and_behind
    clear, behind = light[way]
    with pytest.warns(UserWarning, match=r"without the eye's lens.*transmittance.*'as_is'") as told:
        bare = mosaic.excitations(clear).mean.values[0]
    assert [w.filename for w in told if "lens" in str(w.message)] == [__file__]
    recwarn.clear()
    np.testing.assert_array_equal(mosaic.excitations(clear, media="as_is").mean.values[0], bare)
    expected = mosaic.excitations(behind).mean.values[0]
    for media in (lens, retina.transmittance(32.0, "cie_170")):
        passed = mosaic.excitations(clear, media=media)
        np.testing.assert_allclose(passed.mean.values[0], expected, rtol=1e-5)
        assert passed.provenance["media"] == {"age_years": 32.0, "model": "cie_170"}
    assert not [w for w in recwarn if "lens" in str(w.message)]
    # Per lux of equal energy and of that behind the lens 458.9 and 178.2; and what the lens takes.
    nm = np.arange(400.0, 701.0)
    seen = luminous_efficiency(nm)
    lux = np.sum(seen) / np.sum(seen * 10.0 ** -standard_lens_density(nm))
    assert bare[2] / expected[2] == pytest.approx(458.9 / 178.2 * lux, rel=0.02)


@pytest.mark.parametrize("way", [0, 1], ids=["image", "at the cones"])
def test_no_light_passes_a_lens_twice(clear_and_behind, way):
    mosaic, lens, light = clear_and_behind
    with pytest.raises(InvalidInputError, match="media would be counted twice"):
        mosaic.excitations(light[way][1], media=lens)
    if way == 0:
        other = retina.Transmittance("another lens", ic.OcularMedia(60.0))
        with pytest.raises(InvalidInputError, match=r"without\('media'\)"):
            light[0][1].through(other)


def test_light_of_arrays_and_files_is_taken_as_it_is(recwarn, tmp_path):
    image = image_of(np.ones((8, 8)))
    mosaic = mosaic_of(np.zeros((1, 2)))
    mosaic.excitations(image)
    mosaic.excitations(ic.RetinalImage.from_isetbio(image.to_isetbio(tmp_path / "i.mat"), EYE))
    assert not [w for w in recwarn if "lens" in str(w.message)]


def test_means_beyond_memory_are_refused_with_their_size(monkeypatch):
    monkeypatch.setattr("isetcl.memory.available_bytes", lambda: 2**20)
    mosaic, image = mosaic_of(np.zeros((100, 2))), image_of(np.ones((8, 8)))
    with pytest.raises(OutOfMemoryError, match=r"9000 frames and 100 receptors needs.*frames at a"):
        mosaic.excitations(image, gaze_deg=np.zeros((9000, 2)))
    monkeypatch.setattr("isetcl.memory.available_bytes", lambda: 2**10)
    with pytest.raises(OutOfMemoryError, match=r"mosaic\.within"):
        mosaic.excitations(image)


def test_means_that_no_count_holds_are_refused():
    made = mosaic_of(np.zeros((2, 2))).excitations(image_of(np.full((8, 8), 1e6)), 10.0)
    with pytest.raises(InvalidInputError, match="shorten integration_time_s"):
        made.instances()


def nan_image():
    values = np.full((8, 8), 1e-3)
    values[2, 3] = np.nan
    return image_of(values)


@pytest.mark.parametrize("segments", ["spectral", "mean", "none"])
def test_rods_catch_by_their_own_efficiency_wherever_they_lie(segments):
    # Their outer segments do not follow those of the cones: (photons) (area) (efficiency).
    image = image_of(np.full((12, 12), 1e-3), 24.0)
    mosaic = mosaic_of(np.array([[0.0, 0.0], [10.0, 0.0], [0.0, 3.0]]), [3, 3, 0], 3.0)
    options = {"has_macular_pigment": False, "segments": segments, "precision": "double"}
    found = mosaic.excitations(image, 0.02, **options).mean.values[0]
    photons = 1e-3 * WAVES * 1e-9 / (6.62607015e-34 * 299792458.0)
    area = np.pi * (0.5e-6 * 0.79 * 3.0) ** 2
    rod = 0.02 * area * 10.0 * np.sum(photons * Observer().rod_efficiency(WAVES))
    np.testing.assert_allclose(found[:2], rod, rtol=1e-9)
    if segments == "none":
        cone = 0.02 * area * 10.0 * np.sum(photons * Observer().quantal_efficiency(WAVES)[0])
        assert found[2] == pytest.approx(cone, rel=1e-9)


def descending_image():
    return ic.RetinalImage(image_of(np.ones((8, 8))).dataset.isel(wavelength=slice(None, None, -1)))


def uneven_image():
    return image_of(np.ones((8, 8)), waves=UNEVEN)


def crooked_image(fov_deg=0.4):
    return ic.RetinalImage(image_of(np.ones((8, 8)), fov_deg).dataset.isel(x=[0, 1, 2, 3, 4, 7]))


@pytest.mark.parametrize(
    ("image", "options", "words"),
    [
        (lambda: image_of(np.ones((8, 8)), 0.05), {}, "look beyond the image"),
        (lambda: image_of(np.ones((8, 8))), {"gaze_deg": [[0.0, 0.0], [0.3, 0.0]]}, "gaze moves"),
        (lambda: image_of(np.full((8, 8), -1e-3)), {}, "irradiance must be finite and >= 0"),
        (nan_image, {}, "irradiance must be finite and >= 0"),
        (lambda: image_of(np.ones((8, 8)), waves=np.array([550.0])), {}, "2 wavelengths"),
        (lambda: image_of(np.ones((8, 8)), waves=np.array([380.0, 550.0])), {}, "390 to 830 nm"),
        (lambda: image_of(np.ones((8, 8))), {"integration_time_s": 0.0}, "integration_time_s"),
        (lambda: image_of(np.ones((8, 8))), {"dark_rate_hz": -1.0}, "dark_rate_hz"),
        (lambda: image_of(np.ones((8, 8))), {"segments": "long"}, "segments"),
        (lambda: image_of(np.ones((8, 8))), {"gaze_deg": np.empty((0, 2))}, "at least one frame"),
        (lambda: "image", {}, "image"),
        (lambda: image_of(np.ones((8, 8))), {"integration_time_s": np.inf}, "integration_time_s"),
        (lambda: image_of(np.ones((8, 8))), {"frame_time_s": -1.0}, "frame_time_s"),
        (lambda: image_of(np.ones((8, 8))), {"dark_rate_hz": np.nan}, "dark_rate_hz"),
        (lambda: image_of(np.ones((8, 8))), {"seed": -1}, "seed"),
        (lambda: image_of(np.ones((8, 8))), {"precision": "half"}, "precision"),
        (lambda: image_of(np.ones((8, 8))), {"observer": "me"}, "observer"),
        (lambda: image_of(np.ones((8, 8))), {"gaze_deg": [[0.0, 0.0, 0.0]]}, "gaze_deg"),
        (lambda: image_of(np.ones((1, 8))), {}, "2 x 2 pixels"),
        (lambda: image_of(np.full((8, 8), np.inf)), {}, "irradiance must be finite and >= 0"),
        (lambda: image_of(np.ones((8, 8)), waves=np.array([700.0, 840.0])), {}, "390 to 830 nm"),
        (descending_image, {}, "strictly ascending"),
        (uneven_image, {}, r"equal steps to be summed, got steps of 3 to 60 nm; .*resample"),
        (uneven_image, {"uneven_wavelengths": "trapezia"}, "uneven_wavelengths"),
        (lambda: image_of(np.ones((8, 8))), {"media": 32.0}, "media must be OcularMedia"),
        (lambda: image_of(np.ones((8, 8))), {"media": "none"}, "media"),
        (
            lambda: image_of(np.ones((8, 8))),
            {"media": retina.macular_pigment()},
            "got macular pigment",
        ),
        (crooked_image, {}, "equal steps along x"),
        (lambda: crooked_image(1e-5), {}, "equal steps along x"),
    ],
)
def test_bad_input_is_refused(image, options, words):
    mosaic = mosaic_of(np.array([[0.0, 0.0], [0.05, 0.0]]))
    with pytest.raises(InvalidInputError, match=words):
        mosaic.excitations(image(), **options)


def test_instances_beyond_memory_are_refused(monkeypatch):
    made = mosaic_of(np.zeros((3, 2)), [0, 1, 2]).excitations(image_of(np.ones((64, 64))))
    with pytest.raises(InvalidInputError, match="need 12 GiB, and at most 2"):
        made.instances(1 << 30)
    # Three receptors of 4 bytes.
    # The function of the package's that name hides the module.
    monkeypatch.setattr(sys.modules[Excitations.__module__], "_MOST_BYTES", 1200)
    assert made.instances(100).shape == (100, 1, 3)
    with pytest.raises(InvalidInputError, match="101 instances of 1 frames and 3 receptors"):
        made.instances(101)

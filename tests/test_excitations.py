"""Excitations of receptors against closed forms, sums over many points, and published numbers."""

import numpy as np
import pytest
from scipy.special import erf

import isetcl as ic
from isetcl.cones import ConeMosaic, Observer
from isetcl.errors import FileError, InvalidInputError
from isetcl.eye.people.macular_pigment import macular_fraction, standard_lens_density
from isetcl.spectrum import luminous_efficiency

pytestmark = pytest.mark.filterwarnings("ignore:pixels are up to")

EYE = ic.eyes.navarro()
WAVES = np.arange(400.0, 701.0, 10.0)
RNG = np.random.default_rng(7)


def image_of(values, fov_deg=0.4, waves=WAVES):
    """An image around the axis from (rows, columns), or from (wavelengths, rows, columns)."""
    values = np.asarray(values, dtype=np.float64)
    if values.ndim == 2:
        values = np.broadcast_to(values, (len(waves), *values.shape))
    grid = ic.RetinalGrid.of(EYE, (fov_deg, fov_deg), values.shape[:0:-1])
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
    np.testing.assert_allclose(mean / full, [1.0, factor, factor], rtol=1e-4)
    spectral = mosaic.excitations(image, segments="spectral", **options).mean.values[0]
    expected = np.sum(WAVES * short) / np.sum(WAVES * observer.quantal_efficiency(WAVES)[0])
    np.testing.assert_allclose(spectral / full, [1.0, expected, expected], rtol=1e-9)


def test_a_gaze_that_moves_is_a_mosaic_that_moves():
    image = image_of(RNG.uniform(size=(64, 64)), 0.3)
    mosaic = mosaic_of(RNG.uniform(-0.05, 0.05, size=(50, 2)), spacing_um=3.0)
    path = np.array([[0.0, 0.0], [0.03, -0.01], [-0.02, 0.04]])
    frames = mosaic.excitations(image, gaze_deg=path, precision="double", frame_time_s=0.01)
    np.testing.assert_allclose(frames.dataset["time_s"], [0.0, 0.01, 0.02])
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
        ic.cones.Excitations.load(tmp_path / "other.nc")


def test_rods_and_dichromats_catch_by_their_own_pigments():
    image = image_of(np.full((16, 16), 1e-3))
    mosaic = mosaic_of(np.zeros((4, 2)), [0, 1, 2, 3])
    normal = mosaic.excitations(image).mean.values[0]
    assert np.all(normal > 0)
    protanope = mosaic.excitations(image, observer=Observer.dichromat("protan")).mean.values[0]
    np.testing.assert_allclose(protanope, normal[[1, 1, 2, 3]], rtol=1e-6)


def nan_image():
    values = np.full((8, 8), 1e-3)
    values[2, 3] = np.nan
    return image_of(values)


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
    ],
)
def test_bad_input_is_refused(image, options, words):
    mosaic = mosaic_of(np.array([[0.0, 0.0], [0.05, 0.0]]))
    with pytest.raises(InvalidInputError, match=words):
        mosaic.excitations(image(), **options)


def test_instances_beyond_memory_are_refused():
    made = mosaic_of(np.zeros((3, 2)), [0, 1, 2]).excitations(image_of(np.ones((64, 64))))
    with pytest.raises(InvalidInputError, match="GiB"):
        made.instances(1 << 30)


@pytest.mark.parametrize(("kind", "words"), [("X", "unknown kind 'X'"), (7, "between 0 and 3")])
def test_types_that_do_not_exist_are_refused(kind, words):
    made = mosaic_of(np.zeros((3, 2)), [0, 1, 2]).excitations(image_of(np.ones((64, 64))))
    with pytest.raises(InvalidInputError, match=words):
        made.of(kind)


def test_results_print_as_a_line():
    made = mosaic_of(np.zeros((3, 2)), [0, 1, 2]).excitations(image_of(np.ones((64, 64))))
    assert repr(made).startswith("<Excitations of 3 receptors in 1 frames, 5 ms each, mean ")
    assert repr(ic.cones.photocurrent(made)) == "<Photocurrent of 3 cones in 1 frames>"
    gaze = ic.cones.eye_movements(0.02, trials=2)
    assert repr(gaze) == "<EyeMovements of 2 trials, 4 frames to 0.015 s>"

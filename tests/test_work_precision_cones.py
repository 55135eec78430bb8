"""Errors in units of the Poisson noise of cones, in studies of error against run time."""

import csv

import numpy as np
import pytest
from planted_methods import KNOBS, PIXELS, TRUTH, FakeClock, Planted, pattern, study

import isetcl as ic
from isetcl.errors import InvalidInputError
from isetcl.eye.people.macular_pigment import standard_lens_density
from isetcl.retina.cone_noise import ConeNoise
from isetcl.spectrum import luminous_efficiency
from isetcl.validation import Reference, SceneMethod, WorkMethod, work_precision

EXCITATIONS = 400.0
# The mean of 1 / (1 + a sin x) is 1 / sqrt(1 - a^2).
MEAN_INVERSE = 1.0 / np.sqrt(0.75)


class Wrong(Planted):
    """0.3 of the cones' noise off, root mean square, in every pixel to a random side."""

    def __call__(self, knob, seed):
        super().__call__(knob, seed)
        signs = np.where(pattern() > 0, 1.0, -1.0)
        # Larger where it is darker: an error in units of the mean cone's noise would be another.
        times = 0.3 * TRUTH**-0.5 / np.sqrt(MEAN_INVERSE)
        return TRUTH + times * signs * np.sqrt(TRUTH / EXCITATIONS)


@pytest.fixture(scope="module")
def found():
    reference = Reference(TRUTH, mean_excitations=EXCITATIONS)
    return study(
        {"wrong": Wrong(), "random": Planted(), "biased": Planted(bias=0.02, salt=1)},
        reference=reference,
        cone_noise=ConeNoise(0.2),
    )


def test_an_error_of_so_many_times_the_noise_of_cones_is_found(found):
    own = found.of("wrong")
    for name in ("cone_noise", "cone_noise_low", "cone_noise_high"):
        assert own[name].values == pytest.approx([0.3] * 3, rel=1e-9)


def test_noise_is_told_in_units_of_cone_noise(found):
    # sigma^2 N / R, and of 1 / R the mean is known; 16 x 256 values know a variance to 2.2 %.
    sigma = 0.1 / np.sqrt(KNOBS)
    expected = sigma * np.sqrt(EXCITATIONS * MEAN_INVERSE)
    own = found.of("random")
    assert own["cone_noise"].values == pytest.approx(expected, rel=0.05)
    assert np.all(own["cone_noise_low"] < own["cone_noise"])
    assert np.all(own["cone_noise"] < own["cone_noise_high"])


def test_the_time_to_a_part_of_the_cones_noise_follows_from_the_law(found):
    # 0.1 sqrt(400 x 1.1547 / N) = 0.2 at N = 115.5, which takes 1 ms each.
    data = found.dataset
    own = data.sel(curve="random")
    time = 1e-3 * 0.01 * EXCITATIONS * MEAN_INVERSE / 0.2**2
    assert own["cone_time_s"].item() == pytest.approx(time, rel=0.06)
    assert own["cone_time_low_s"] < time < own["cone_time_high_s"]
    assert own["cone_time_how"].item() == "interpolated"
    assert data.sel(curve="wrong")["cone_time_how"].item() == "not reached"
    # 2 % of bias are 0.43 of the cones' noise.
    assert data.sel(curve="biased")["cone_time_how"].item() == "not reached"


def test_the_noise_of_the_reference_is_not_the_methods_error():
    error = 0.01
    noisy = TRUTH + error * np.random.default_rng(5).standard_normal(PIXELS)
    reference = Reference(noisy, error, mean_excitations=EXCITATIONS)
    own = study({"random": Planted()}, reference=reference).of("random")
    noise = np.sqrt(EXCITATIONS * MEAN_INVERSE)
    expected = 0.1 / np.sqrt(KNOBS) * noise
    # A mean square of 256 values is known to 9 %.
    slack = 3 * 0.09 * (error * noise) ** 2
    for value, truth in zip(own["cone_noise"].values, expected, strict=True):
        assert value**2 == pytest.approx(truth**2, rel=0.1, abs=slack)


def test_dark_pixels_have_no_noise_to_compare_with():
    truth = np.where(np.arange(PIXELS) < 64, 0.0, TRUTH)
    level = truth.mean()

    def run(knob, seed):
        clock.now += 1.0
        lit = truth + 0.5 * np.sqrt(truth * level / EXCITATIONS)
        return np.where(truth > 0, lit, 0.7)

    clock = FakeClock()
    own = work_precision(
        [WorkMethod("mine", run, (1.0,), is_random=False)],
        reference=Reference(truth, mean_excitations=EXCITATIONS),
        clock=clock.clock(),
        least_s=0.0,
    ).dataset
    assert own["cone_noise"].values == pytest.approx([0.5], rel=1e-9)


WAVES = np.arange(400.0, 701.0, 5.0)


def seen(lux):
    """An image of equal energy behind the lens, its upper half twice as bright."""
    grid = ic.RetinalGrid.of(ic.eyes.navarro(4.0), 1.0, 8)
    spectrum = 10.0 ** -standard_lens_density(WAVES)
    spectrum *= lux / (683.0 * 5.0 * np.sum(spectrum * luminous_efficiency(WAVES)))
    half = np.repeat([4.0 / 3.0, 2.0 / 3.0], 4)
    return grid, spectrum[:, None, None] * half[None, :, None] * np.ones(8)


@pytest.mark.parametrize("quantity", ["photopic", "spectral"])
@pytest.mark.parametrize("lux", [10.0, None])
def test_excitations_are_those_of_a_foveal_cone_in_the_stated_light(quantity, lux):
    # 117.5 of the L cone within 5 ms at 5 lux of equal energy behind the lens.
    grid, irradiance = seen(40.0)
    reference = ic.RetinalImage.from_arrays(grid, WAVES, irradiance)
    clock = FakeClock()

    def run(knob, seed):
        clock.now += 1.0
        return ic.RetinalImage.from_arrays(grid, WAVES, 1.03 * irradiance)

    result = work_precision(
        [WorkMethod("mine", run, (1.0,), is_random=False)],
        reference=reference, clock=clock.clock(), least_s=0.0, quantity=quantity,
        illuminance_lux=lux,
    )  # fmt: skip
    n = 117.5 / 5.0 * (40.0 if lux is None else lux)
    cone = result.provenance["cone_noise"]
    assert cone["mean_excitations"] == pytest.approx(n, rel=5e-3)
    assert (cone["integration_time_s"], cone["illuminance_lux"]) == (0.005, lux)
    # 3 % of N R excitations over their root, and R has the mean 1.
    assert result.dataset["cone_noise"].values == pytest.approx([0.03 * np.sqrt(n)], rel=3e-3)
    # As the goal of renders measures it, from excitations of the three types.
    cones = ConeNoise(0.1)
    scale = 1.0 if lux is None else lux / reference.illuminance_lux.values.mean()
    means = scale * np.einsum("cw,wyx->cyx", cones.weights(WAVES), irradiance).reshape(3, -1)
    assert result.dataset["cone_noise"].values == pytest.approx([cones.error(means, 0.03 * means)])


@pytest.mark.slow
def test_renders_that_stop_at_a_part_of_the_cones_noise_have_that_error():
    # The goal knows the noise from its own replicates and by type of cone, the study from an
    # independent reference and by brightness. Of 8 replicates of 900 pixels each is known to 2 %.
    scene, eye = ic.scenes.two_planes(), ic.eyes.navarro(4.0, 2.0)
    where = {"fov_deg": 2.0, "resolution": 30, "wavelengths_nm": np.arange(400.0, 701.0, 60.0)}
    image = ic.render(scene, eye, **where, bands=6, target_error=ConeNoise(0.2), progress=False)
    told = image.provenance
    size = told["samples_per_pixel"]
    study = work_precision(
        [SceneMethod(knobs=(size,), options={"bands": 6})],
        scene=scene, eye=eye, **where, seed=5, replicates=8, illuminance_lux=None, least_s=0.0,
        parts=False, allow_noise=True,
    )  # fmt: skip
    assert study.dataset["cone_noise"].item() == pytest.approx(
        told["cone_noise"]["reached"], rel=0.1
    )


def test_images_without_a_spectrum_have_no_error_in_these_units():
    result = study({"random": Planted()})
    assert np.isnan(result.of("random")["cone_noise"].values).all()
    assert result.dataset["cone_time_how"].values.tolist() == ["unknown"]
    assert "cone_noise" not in result.provenance
    assert "cone" not in "".join(result.summary())
    with pytest.raises(InvalidInputError, match="no errors in units of cone noise"):
        result.plot(error="cone_noise")


def test_tables_files_and_diagrams_tell_errors_in_units_of_cone_noise(found, tmp_path):
    with found.to_csv(tmp_path / "points.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(r["cone_noise"]) for r in rows] == found.dataset["cone_noise"].values.tolist()
    assert found.record()["points"][0]["cone_noise"] == pytest.approx(0.3)
    head, *cells = found.rows()
    assert cells[0][head.index("of cone noise")] == "0.3"
    text = found.table()
    assert "400 excitations within 5 ms at a mean of 10 lux" in text
    assert "0.2 of the cones' noise not reached" in text
    ax = found.plot(error="cone_noise")
    assert "cone" in ax.get_ylabel()
    curves = [c for c in ax.containers if len(c) and c[0] is not None]
    for curve, name in zip(curves, ("wrong", "random", "biased"), strict=True):
        np.testing.assert_allclose(curve[0].get_ydata(), found.of(name)["cone_noise"])
    assert any(np.allclose(line.get_ydata(), 0.2) for line in ax.lines)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: study({"a": Planted()}, cone_noise=0.1), "cone_noise must be"),
        (lambda: study({"a": Planted()}, illuminance_lux=0.0), "illuminance_lux must be > 0"),
        (lambda: Reference(TRUTH, mean_excitations=-1.0), "mean_excitations must be > 0"),
        (
            lambda: Reference(
                ic.RetinalImage.from_arrays(*(seen(1.0)[0], WAVES, seen(1.0)[1])),
                mean_excitations=3.0,
            ),
            "has a spectrum",
        ),
    ],
)
def test_bad_input_is_refused(make, text):
    with pytest.raises(InvalidInputError, match=text):
        make()

"""Error against run time: planted truths, intervals, times, and what is refused."""

import csv
import json

import numpy as np
import pytest
from planted_methods import KNOBS, PIXELS, TRUTH, FakeClock, Planted, pattern, study

import isetcl as ic
from isetcl.device.choose import find_device
from isetcl.validation import Reference, SceneMethod, WorkMethod, work_precision
from isetcl.validation.work_precision import NoisyTimingError, Part
from isetcl.validation.work_precision.estimators import resampled_medians, resampling
from isetcl.validation.work_precision.scene_method import rounded_inputs


@pytest.mark.parametrize("count", [9, 16])
def test_medians_of_resamples_are_those_of_the_resamples(count):
    values = np.random.default_rng(3).standard_normal(count)
    shares = resampling(count, 50, 1)
    found = resampled_medians(list(values), shares)
    expected = [np.median(np.repeat(values, np.rint(s * count).astype(int))) for s in shares]
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.fixture(scope="module")
def planted():
    return {
        "biased": Planted(bias=0.02, salt=1),
        "random": Planted(salt=2),
        "stratified": Planted(slope=-1.5, noise=2.0, salt=3),
    }


@pytest.fixture(scope="module")
def found(planted):
    return study(planted, targets=(0.01, 0.03))


def test_bias_and_noise_are_told_apart(found):
    own = found.of("biased")
    # The first round warms up, and its images do not count twice.
    assert own["images"].values.tolist() == [16] * 3
    assert own["bias"].values == pytest.approx([0.02] * 3, rel=0.05)
    expected = 0.1 / np.sqrt(KNOBS)
    assert own["monte_carlo"].values == pytest.approx(expected, rel=0.06)
    assert own["rmse"].values == pytest.approx(np.hypot(0.02, expected), rel=0.05)
    for name in ("random", "stratified"):
        other = found.of(name)
        assert np.all(other["bias_low"].values == 0.0)
        assert np.all(other["bias"].values < 0.15 * other["monte_carlo"].values)


@pytest.mark.parametrize(("name", "slope"), [("random", -0.5), ("stratified", -1.5)])
def test_the_fall_of_the_error_is_found(found, name, slope):
    for fit in ("slope", "noise_slope", "time_slope"):
        own = found.dataset.sel(curve=name)
        assert own[fit].item() == pytest.approx(slope, abs=0.02)
        assert own[f"{fit}_low"].item() <= slope <= own[f"{fit}_high"].item()


def test_times_to_a_target_follow_from_the_laws(found):
    times = found.dataset["time_to_s"]
    how = found.dataset["time_to_how"]
    # 0.1 N^-1/2 = 0.01 at N = 100, which takes 0.1 s; 2 N^-3/2 = 0.01 at N = 34.2.
    assert times.values[1, 0] == pytest.approx(0.1, rel=0.05)
    assert times.values[2, 0] == pytest.approx(1e-3 * 200 ** (2 / 3), rel=0.03)
    assert how.values[1:, 0].tolist() == ["interpolated", "interpolated"]
    # 2 % of bias never become 1 %, and 2.5 % at the first point are below 3 % already.
    assert how.values[0, 0] == "not reached"
    assert np.isinf(times.values[0, 0])
    assert how.values[1, 1] == "at most"
    ratio, low, high = found.faster("stratified", "random", 0.01)
    assert low < 100.0 / 200 ** (2 / 3) < high
    assert ratio == pytest.approx(100.0 / 200 ** (2 / 3), rel=0.06)


def test_times_that_do_not_grow_cannot_be_extrapolated():
    class Cached(Planted):
        def __call__(self, knob, seed):
            self.clock.now += 1.0 - 2e-3 * knob
            return super().__call__(knob, seed)

    data = study({"cached": Cached(), "biased": Cached(bias=0.02)}, targets=(0.001,)).dataset
    # More samples would help the one, and nobody knows when; the other has its bias.
    assert data["time_to_how"].values[:, 0].tolist() == ["unknown", "not reached"]
    assert np.isnan(data["time_to_s"].values[0, 0])
    assert np.isinf(data["time_to_s"].values[1, 0])


def test_methods_are_compared_after_the_same_time(found):
    # After 0.064 s: 0.1 / 8 against 2 / 64^1.5.
    ratio, low, high = found.more_exact("stratified", "random", 0.064)
    assert low < 3.2 < high
    assert ratio == pytest.approx(3.2, rel=0.04)
    with pytest.raises(ic.InvalidInputError, match=r"between .* 0\.016 and 0\.256 s, got 3"):
        found.more_exact("random", "biased", 3.0)


def test_times_are_told_in_those_of_the_first_method():
    result = study({"slow": Planted(), "fast": Planted(slope=-1.5, noise=2.0)}, targets=(0.01,))
    times = [result.dataset[f"times_first{end}"].values[:, 0] for end in ("", "_low", "_high")]
    assert [t[0] for t in times] == [1.0, 1.0, 1.0]
    true = 200 ** (2 / 3) / 100.0
    assert times[1][1] < true < times[2][1]
    assert times[0][1] == pytest.approx(true, rel=0.06)
    assert f"{times[0][1]:.3g} times that of slow" in result.table()


def test_the_scatter_of_times_is_in_the_intervals_of_times():
    # With errors that are all but known, what is left is that of the median of 16 times: of a
    # logarithm's standard deviation s, 1.25 s / 4, which Student's quantile makes 2.13 of.
    quiet, loud = Planted(slope=-1.5, noise=2.0), Planted(slope=-1.5, noise=2.0, scatter=0.1)
    result = study({"quiet": quiet, "loud": loud}, targets=(0.01,), allow_noise=True)
    low, high = (result.dataset[f"time_to_{e}_s"].values[:, 0] for e in ("low", "high"))
    width = np.log(high / low)
    assert width[0] < 0.03
    # The median is known worse than the mean; at 16 the factor of 1.25 is one of about 1.2.
    assert 0.5 < width[1] / (2 * 2.13 * 1.25 * 0.1 / 4) < 1.8


def test_the_largest_error_is_that_of_one_pixel():
    class Spike(Planted):
        def __call__(self, knob, seed):
            super().__call__(knob, seed)
            return TRUTH + 0.7 * (np.arange(PIXELS) == seed + 5)

    own = study({"spike": Spike()}).of("spike")
    assert own["largest"].values == pytest.approx([0.7] * 3)
    # One of the three pixels that are the worst 1 %.
    assert own["worst"].values == pytest.approx([0.7 / np.sqrt(3)] * 3)


def test_the_record_names_what_was_asked_for():
    result = work_precision(
        [SceneMethod(knobs=(4,), options={"precision": "single"})],
        scene=ic.scenes.two_planes(), eye=ic.eyes.navarro(4.0), fov_deg=1.0, resolution=8,
        reference=np.ones((8, 8)), replicates=2, least_s=0.0, allow_noise=True, parts=False,
        wavelengths_nm=np.array([550.0]),
    )  # fmt: skip
    record = json.loads(json.dumps(result.provenance))
    device = find_device(None)
    assert record["device"]["driver"] == device.describe()["driver"]
    assert record["device"]["vector_width_single"] == device.vector_width("single")
    assert record["arguments"]["wavelengths_nm"] == [550.0]
    assert record["methods"]["ray_tracing (precision single)"] == {
        "knob": "spp", "options": {"precision": "single"},
    }  # fmt: skip
    assert {"load_before", "load"} <= set(record)
    assert (record["scene"], record["eye"]) == (ic.scenes.two_planes().name, "navarro")


def test_beyond_the_last_point_time_goes_on_with_the_knob():
    # A fixed cost of 0.5 s: time is no power of the knob, but a line of it.
    class Slow(Planted):
        def __call__(self, knob, seed):
            self.clock.now += 0.5
            return super().__call__(knob, seed)

    result = study({"slow": Slow(), "biased": Slow(bias=0.02, salt=5)}, targets=(0.003, 0.025))
    data = result.dataset
    assert data["time_to_how"].values[0, 0] == "extrapolated"
    assert data["time_to_s"].values[0, 0] == pytest.approx(0.5 + 1e-3 * (0.1 / 0.003) ** 2, rel=0.1)
    assert data["time_to_how"].values[1].tolist() == ["not reached", "interpolated"]


def test_the_noise_of_the_reference_is_subtracted():
    error = 0.01
    noisy = TRUTH + error * np.random.default_rng(5).standard_normal(PIXELS)
    result = study({"random": Planted()}, reference=Reference(noisy, error))
    own = result.of("random")
    expected = 0.1 / np.sqrt(KNOBS)
    # Chi-square of 256 pixels: the reference's mean square is known to 9 %.
    for value, truth in zip(own["mse"].values, expected**2, strict=True):
        assert value == pytest.approx(truth, rel=0.07, abs=3 * 0.09 * error**2)
    held = (own["rmse_low"].values <= expected) & (expected <= own["rmse_high"].values)
    assert held.all()


def test_a_reference_noisier_than_the_image_is_said():
    error = 0.01
    noisy = TRUTH + error * np.random.default_rng(5).standard_normal(PIXELS)
    result = study(
        {"stratified": Planted(slope=-1.5, noise=2.0)}, reference=Reference(noisy, error)
    )
    assert result.of("stratified")["is_limited"].values.tolist() == [False, True, True]
    (note,) = [n for n in result.notes if "noisier" in n]
    assert "method 'stratified' at spp 64" in note
    assert result.table().count("<ref") == 2
    assert not any("noisier" in n for n in study({"random": Planted()}).notes)


def test_errors_near_the_noise_of_the_reference_are_drawn_on_grey():
    reference = Reference(TRUTH, 1e-3)
    ax = study({"random": Planted()}, reference=reference).plot()
    (span,) = [p for p in ax.patches if "ten times" in str(p.get_label())]
    assert span.get_y() + span.get_height() == pytest.approx(1.0)
    assert not study({"random": Planted()}).plot().patches


def test_parts_of_the_error_are_told_apart():
    def shifted(size, noise=0.0):
        def run(knob, seed):
            rng = np.random.default_rng([int(noise * 1e6), seed])
            return TRUTH + size * pattern() + noise * rng.standard_normal(PIXELS)

        return run

    parts = (
        Part("representation", shifted(1e-4), shifted(0.0)),
        Part("rounding", shifted(3e-3), shifted(1e-3)),
        Part("discretisation", shifted(0.03, 0.01), shifted(0.0, 0.02), is_paired=False),
    )
    own = study({"random": Planted()}, parts=parts).of("random")
    assert own["representation"].values == pytest.approx(1e-4, rel=1e-6)
    assert own["rounding"].values == pytest.approx(2e-3, rel=1e-6)
    assert own["discretisation"].values == pytest.approx(0.03, rel=0.08)
    # The kinds are independent: their budget is the root of the sum of squares.
    kinds = ("representation", "rounding", "discretisation", "monte_carlo")
    budget = np.sqrt(sum(own[name].values ** 2 for name in kinds))
    assert own["budget"].values == pytest.approx(budget, rel=1e-12)
    assert own["budget"].values == pytest.approx(np.hypot(0.03, 0.1 / np.sqrt(KNOBS)), rel=0.1)
    left_out = study({"random": Planted()}, parts=parts).of("random")
    assert np.isfinite(left_out["rounding"].values).all()
    assert np.isnan(study({"random": Planted()}).of("random")["rounding"].values).all()


def test_methods_take_turns_with_the_same_seeds():
    order = []

    class Noted(Planted):
        def __call__(self, knob, seed):
            order.append((self.salt, knob, seed))
            return super().__call__(knob, seed)

    said = []
    methods = {"a": Noted(salt=1), "b": Noted(salt=2)}
    study(methods, knobs=(4, 16), replicates=3, seed=8, on_step=lambda *step: said.append(step))
    # 4 first images, 12 measurements, 4 looks at kinds of error.
    assert [fraction for _, fraction in said] == pytest.approx(np.arange(20) / 20)
    once = [(salt, knob) for salt in (1, 2) for knob in (4, 16)]
    assert [(salt, knob) for salt, knob, _ in order] == once * 4
    assert [seed for *_, seed in order] == [8] * 8 + [9] * 4 + [10] * 4


def test_short_calls_are_repeated_until_a_measurement_lasts():
    quick = Planted()
    result = study({"quick": quick}, knobs=(16,), replicates=2, least_s=0.1)
    # 0.1 s of calls of 16 ms are seven; the first one only warms up.
    assert len(quick.calls) == 1 + 2 * 7
    assert result.dataset["time_s"].values == pytest.approx([0.016])
    assert result.dataset["build_s"].values == pytest.approx([0.0], abs=1e-9)


def test_building_is_not_part_of_the_time():
    class Built(Planted):
        def __call__(self, knob, seed):
            self.clock.now += 0.0 if self.calls else 2.0
            return super().__call__(knob, seed)

    result = study({"built": Built()}, knobs=(16, 64))
    assert "first image 2.02 s, 2 s of it to build" in result.table()
    data = result.dataset
    assert data["first_s"].values == pytest.approx([2.016, 0.064])
    assert data["build_s"].values == pytest.approx([2.0, 0.0], abs=1e-9)
    assert data["time_s"].values == pytest.approx([0.016, 0.064])


def test_a_noisy_machine_is_refused_and_said():
    noisy = {"steady": Planted(), "uneven": Planted(jitter=0.3, salt=2)}
    with pytest.raises(NoisyTimingError, match=r"too noisy.*uneven.*30 %.*allow_noise") as caught:
        study(noisy)
    withheld = caught.value.result
    assert np.isnan(withheld.dataset["time_s"].values).all()
    assert np.isnan(withheld.dataset["time_to_s"].values).all()
    assert withheld.of("steady")["rmse"].values == pytest.approx(0.1 / np.sqrt(KNOBS), rel=0.1)
    allowed = study(noisy, allow_noise=True)
    assert any("too noisy" in note for note in allowed.notes)
    assert allowed.of("uneven")["is_noisy"].values.all()
    assert not allowed.of("steady")["is_noisy"].values.any()
    assert allowed.table().count("~") == 3


def test_fewer_than_sixteen_replicates_are_said():
    few = study({"random": Planted()}, replicates=4)
    assert any("only 4 replicates" in note for note in few.notes)
    assert any("only 4 measurements" in note for note in few.notes)
    assert not any("replicates" in note for note in study({"random": Planted()}).notes)


def test_a_run_time_of_zero_is_refused():
    class Instant(Planted):
        def __call__(self, knob, seed):
            return TRUTH

    with pytest.raises(ic.InvalidInputError, match=r"run time of method 'instant'.*> 0 s, got 0 s"):
        study({"instant": Instant()})


def test_images_with_nan_are_refused():
    class Broken(Planted):
        def __call__(self, knob, seed):
            image = super().__call__(knob, seed)
            image[:3] = np.nan
            return image

    with pytest.raises(ic.InvalidInputError, match=r"'broken' at spp 16 .*finite.* 3 NaN"):
        study({"broken": Broken()})
    with pytest.raises(ic.InvalidInputError, match="the reference must be finite"):
        study({"random": Planted()}, reference=np.full(PIXELS, np.nan))


def retinal_image(resolution, fov_deg=2.0):
    grid = ic.RetinalGrid.of(ic.eyes.navarro(4.0), fov_deg, resolution)
    wavelengths = np.array([500.0, 600.0])
    return ic.RetinalImage.from_arrays(grid, wavelengths, np.ones((2, *grid.shape)))


def test_mixed_grids_are_refused_with_both_printed():
    fake = FakeClock()

    def run(knob, seed):
        fake.now += 1.0
        return retinal_image(8)

    for reference, text in (
        (retinal_image(6), "6 y from 0.833333 to -0.833333 deg"),
        (retinal_image(8, 4.0), "8 y from 1.75 to -1.75 deg"),
        (np.ones((5, 8)), r"an array of shape \(5, 8\)"),
    ):
        with pytest.raises(ic.InvalidInputError, match=text) as caught:
            work_precision(
                [WorkMethod("mine", run, (1.0,))], reference=reference, clock=fake.clock()
            )
        assert "8 y from 0.875 to -0.875 deg, 8 x from -0.875 to 0.875 deg" in str(caught.value)
        assert "2 wavelength from 500 to 600 nm" in str(caught.value)


def test_what_a_reference_shares_with_the_images_is_said():
    image = retinal_image(8)
    details = {"method": "ray tracing", "samples_per_pixel": 64, "seed": 99, "sampler": "sobol"}
    details |= {"precision": "single"}
    fake = FakeClock()

    def run(knob, seed):
        fake.now += 1.0
        return image

    def notes(**changed):
        image.dataset.attrs["provenance"] = json.dumps(image.provenance | details | changed)
        mine = WorkMethod("mine", run, (1.0,), is_random=False)
        return work_precision([mine], reference=image, clock=fake.clock()).notes

    said = "\n".join(notes())
    assert "in single precision" in said
    assert "Sobol' points of another seed" in said
    said = "\n".join(notes(precision="double", sampler="random"))
    assert "precision" not in said
    assert "Sobol" not in said


def test_a_reference_that_is_not_independent_is_refused():
    image = ic.render(
        ic.scenes.two_planes(), ic.eyes.navarro(4.0), fov_deg=1.0, resolution=8, spp=64, seed=3,
        wavelengths_nm=np.array([550.0]), progress=False,
    )  # fmt: skip
    fake = FakeClock()
    mine = WorkMethod("mine", lambda knob, seed: image, (1.0,))
    for method, seed, text in ((mine, 0, "seed 3"), ("ray_tracing", 100, "64 x 256 samples")):
        with pytest.raises(ic.InvalidInputError, match=text):
            work_precision(
                [method], scene=ic.scenes.two_planes(), eye=ic.eyes.navarro(4.0), reference=image,
                fov_deg=1.0, resolution=8, clock=fake.clock(), seed=seed,
            )  # fmt: skip


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: WorkMethod("a", 3, (1,)), "function of knob and seed"),
        (lambda: WorkMethod("a", print, ()), "one value of its knob or more"),
        (lambda: WorkMethod("a", print, (2, 2)), "each once"),
        (lambda: WorkMethod("a", print, (0,)), "must be > 0"),
        (lambda: Part("noise", print, print), "representation"),
        (lambda: SceneMethod("layered_summ"), "layered_sum"),
        (lambda: SceneMethod(knob="oversampling"), "knob"),
        (lambda: SceneMethod(knobs=(2.5,)), "whole number"),
        (lambda: SceneMethod("layered_sum", knobs=(16,)), "oversampling must be at most 8"),
        (lambda: SceneMethod(options={"spp": 3}), "cannot be an option"),
        (lambda: Reference(TRUTH, -1.0), ">= 0"),
        (lambda: Reference([1.0]), "ndarray"),
        (lambda: work_precision([]), "one or more"),
        (lambda: work_precision(["ray_tracing"]), "scene="),
        (lambda: study({"a": Planted()}, replicates=1), ">= 2|between 2"),
        (lambda: study({"a": Planted()}, quantity="colour"), "photopic"),
        (lambda: study({"a": Planted()}, time="gpu"), "wall"),
        (lambda: study({"a": Planted()}, targets=(0.0,)), "must be > 0"),
        (lambda: study({"a": Planted()}, reference=np.zeros(PIXELS)), "black"),
        (lambda: study({"a": Planted()}, reference=Reference(TRUTH, np.ones(3))), "shape"),
        (lambda: work_precision([WorkMethod("a", print, (1,))] * 2), "different names"),
        (lambda: study({"a": Planted()}, fov=2.0), "argument of work_precision 'fov'.*fov_deg"),
    ],
)
def test_bad_input_is_refused(make, text):
    with pytest.raises(ic.InvalidInputError, match=text):
        make()


def test_files_hold_all_points(found, tmp_path):
    with found.to_csv(tmp_path / "points.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(r["method"], float(r["value"])) for r in rows][:4] == [
        ("biased", 16.0), ("biased", 64.0), ("biased", 256.0), ("random", 16.0),
    ]  # fmt: skip
    assert [float(r["rmse"]) for r in rows] == found.dataset["rmse"].values.tolist()
    record = json.loads(found.to_json(tmp_path / "points.json").read_text())
    assert [p["rmse"] for p in record["points"]] == found.dataset["rmse"].values.tolist()
    assert record["points"][0]["rounding"] is None
    assert record["methods"][0]["targets"][0] == {
        "target": 0.01, "time_to_s": "infinite", "time_to_low_s": "infinite",
        "time_to_high_s": "infinite", "time_to_how": "not reached", "efficiency_at": 0.0,
        "times_first": None, "times_first_low": None, "times_first_high": None,
    }  # fmt: skip
    assert record["provenance"]["replicates"] == 16
    with pytest.raises(ic.FileError, match="cannot write"):
        found.to_csv(tmp_path / "no" / "points.csv")


def test_the_diagram_has_a_curve_for_each_method(found):
    ax = found.plot()
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    labels = ax.get_legend_handles_labels()[1]
    assert [name for name in labels if name in ("biased", "random", "stratified")] == [
        "biased", "random", "stratified",
    ]  # fmt: skip
    curves = [c for c in ax.containers if len(c) and c[0] is not None]
    for curve, name in zip(curves, ("biased", "random", "stratified"), strict=True):
        own = found.of(name)
        np.testing.assert_allclose(curve[0].get_xdata(), own["time_s"])
        np.testing.assert_allclose(curve[0].get_ydata(), 100.0 * own["rmse"])


def test_rounded_inputs_are_those_of_single_precision():
    eye = ic.eyes.navarro(4.0, 2.0)
    rounded = rounded_inputs(eye)
    for own, other in zip(eye.surfaces, rounded.surfaces, strict=True):
        assert other.vertex_z_mm == float(np.float32(own.vertex_z_mm))
    # Powers of 60 dpt from curvatures right to 6e-8.
    assert rounded.power_dpt(550.0) == pytest.approx(eye.power_dpt(550.0), rel=4 * 6e-8)
    assert rounded.power_dpt(550.0) != eye.power_dpt(550.0)
    quad = rounded_inputs(ic.scenes.two_planes()).objects[1].shape
    assert all(x == float(np.float32(x)) for x in (*quad.corner_m, *quad.edge_u_m))

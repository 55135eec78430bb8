"""Error against run time of a real scene in small, and what has become worse since."""

import copy
import json
import runpy
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).parents[1] / "benchmarks"
EARLIER = FOLDER / "results" / "work_precision_quick.json"
HOW = {"interpolated", "extrapolated", "at most", "not reached"}


@pytest.fixture(scope="module")
def script():
    sys.path.insert(0, str(FOLDER))
    try:
        return runpy.run_path(str(FOLDER / "work_precision.py"))
    finally:
        sys.path.remove(str(FOLDER))


@pytest.fixture(scope="module")
def found(script):
    return script["quick"]()


@pytest.mark.slow
def test_renderers_are_measured_against_an_independent_reference(found):
    text = found.provenance["reference"]
    assert "32768 random samples" in text
    assert "double precision, seed 1000003, 6 bands" in text
    # 64 x the samples of the longest method, whose points are scrambled Sobol' points of seed 0.
    assert found.provenance["seed"] == 0
    assert found.dataset["value"].values.max() * 64 == 32768
    assert 0 < found.dataset["reference_error"].values.max() < 0.005
    assert not found.dataset["is_limited"].values.any()


@pytest.mark.slow
def test_every_column_has_its_numbers(found):
    data = found.dataset
    columns = (
        *("rmse", "monte_carlo", "bias", "worst", "largest", "relative_mse", "energy_error"),
        *("cone_noise", "discretisation", "budget", "efficiency", "spread", "first_s", "build_s"),
        *("time_s", "wall_median_s", "wall_least_s", "cpu_median_s", "cpu_least_s"),
    )
    for name in columns:
        assert np.isfinite(data[name].values).all(), name
        assert np.all(data[name].values >= 0), name
    for name in ("rmse", "cone_noise"):
        low, high = (data[f"{name}_{end}"].values for end in ("low", "high"))
        assert np.all((low <= data[name].values) & (data[name].values <= high))
    assert np.all(data["efficiency"].values > 0)
    assert np.all(data["rmse"].values <= data["worst"].values)
    assert np.all(data["worst"].values <= data["largest"].values)
    assert np.all(data["time_s"].values == data["cpu_median_s"].values)
    assert set(data["time_to_how"].values.ravel()) | set(data["cone_time_how"].values) <= HOW
    single = found.of("ray tracing f32")
    assert np.all(single["transfer_s"].values < single["wall_median_s"].values)
    assert np.isfinite(single["rounding"].values).all()


@pytest.mark.slow
def test_more_work_takes_longer_and_is_more_exact(found):
    for name in found.dataset["curve"].values:
        own = found.of(str(name))
        assert own["time_s"].values[-1] > own["time_s"].values[0], name
        assert np.all(np.diff(own["rmse"].values) < 0), name


@pytest.mark.slow
def test_the_bias_of_few_bands_is_their_discretisation(found):
    # One from the reference, the other from renders with all bands: two ways to the same error.
    few, every = found.of("ray tracing f32"), found.of("ray tracing f32, all bands")
    bias, part = few["bias"].values[-1], few["discretisation"].values[-1]
    assert bias == pytest.approx(part, rel=0.05)
    # And together with the noise it is the whole error.
    assert few["budget"].values == pytest.approx(few["rmse"].values, rel=0.05)
    assert np.all(every["bias_low"].values == 0.0)
    assert every["bias_high"].values[-1] < 0.1 * bias


@pytest.mark.slow
def test_tracing_in_single_precision_is_as_good_as_in_double(found):
    single, double = found.of("ray tracing f32").isel(point=[0, 1]), found.of("ray tracing f64")
    np.testing.assert_allclose(single["rmse"], double["rmse"], rtol=0.05)
    assert np.all(single["rounding"].values < 0.2 * single["monte_carlo"].values)
    assert np.all(single["representation"].values < single["rounding"].values + 1e-9)
    # Sobol' points on edges: between N^-1/2 and N^-1.
    slope = found.dataset["noise_slope"].sel(curve="ray tracing f32, all bands").item()
    assert -1.0 < slope < -0.5


@pytest.mark.slow
def test_summed_layers_stay_wrong_at_the_depth_edge(found):
    wrong, better = found.of("layered_sum"), found.of("layered_over")
    assert np.all(wrong["bias_low"].values > 0.1)
    assert np.all(better["rmse"].values < 0.35 * wrong["rmse"].values)
    how = found.dataset["time_to_how"].sel(curve="layered_sum").values
    assert set(how) == {"not reached"}


@pytest.mark.slow
def test_no_error_has_grown(script, found):
    wrong, slow = script["regressions"](found.record(), json.loads(EARLIER.read_text()))
    for text in slow:
        warnings.warn(text, stacklevel=1)
    assert not wrong


def test_errors_that_grow_are_found_and_slower_methods_said(script):
    earlier = json.loads(EARLIER.read_text())
    assert script["regressions"](earlier, earlier) == ([], [])
    worse, slower, fewer = (copy.deepcopy(earlier) for _ in range(3))
    for name in ("rmse", "rmse_low", "rmse_high"):
        worse["points"][1][name] *= 1.05
    (text,), slow = script["regressions"](worse, earlier)
    assert "'ray tracing f32', 64" in text
    assert not slow
    slower["points"][-1]["time_s"] *= 1.4
    wrong, (text,) = script["regressions"](slower, earlier)
    assert not wrong
    assert "'layered_over', 2" in text
    assert "1.40 times" in text
    # A slower machine is not a slower method.
    for point in slower["points"]:
        point["time_s"] = 3.0 * earlier["points"][slower["points"].index(point)]["time_s"]
    assert script["regressions"](slower, earlier) == ([], [])
    fewer["points"].pop()
    assert "no longer measured" in script["regressions"](fewer, earlier)[0][0]

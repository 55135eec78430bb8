"""Contrasts and the ideal observer, against closed forms and simulated decisions."""

import math

import numpy as np
import pytest
import xarray
from scipy.stats import norm, poisson

from isetcl.cones import (
    Excitations,
    contrast,
    contrast_image,
    discriminate,
    discrimination_threshold,
)
from isetcl.cones.discrimination import d_prime_of, percent_correct
from isetcl.errors import InvalidInputError


def excitations_of(mean, types=None, places=None, integration_time_s=0.005):
    mean = np.atleast_2d(np.asarray(mean, dtype=np.float64))
    n = mean.shape[1]
    x = np.arange(n) if places is None else places[0]
    y = np.arange(n) % 3 if places is None else places[1]
    kinds = np.zeros(n, np.uint8) if types is None else np.asarray(types, np.uint8)
    dataset = xarray.Dataset(
        {"mean": (("frame", "receptor"), mean)},
        coords={
            "x_deg": ("receptor", x * 1.0),
            "y_deg": ("receptor", y * 1.0),
            "type": ("receptor", kinds),
            "time_s": ("frame", integration_time_s * np.arange(len(mean))),
        },
        attrs={"integration_time_s": integration_time_s, "seed": 0, "provenance": "{}"},
    )
    return Excitations(dataset)


# ---- contrast --------------------------------------------------------------------------------


def test_contrast_is_the_change_over_the_background():
    seen = excitations_of([[10.0, 30.0, 8.0], [20.0, 10.0, 8.0]], [0, 0, 2])
    against = contrast(seen, excitations_of([[20.0, 20.0, 4.0]], [0, 0, 2]))
    np.testing.assert_allclose(against, [[-0.5, 0.5, 1.0], [0.0, -0.5, 1.0]])
    # Without a background: 17.5 is the mean of L, 8 that of S.
    own = contrast(seen)
    np.testing.assert_allclose(own[0], [10 / 17.5 - 1, 30 / 17.5 - 1, 0.0])


@pytest.mark.slow
def test_a_contrast_image_reproduces_a_plane_between_the_cones_of_a_type():
    rng = np.random.default_rng(5)
    places = rng.uniform(-1, 1, size=(2, 300))
    kinds = rng.integers(0, 2, 300)
    plane = 5.0 + 2.0 * places[0] - places[1] + 100.0 * kinds
    found = contrast_image(excitations_of(plane, kinds, places).mean, "L", 40)
    assert found.dims == ("y", "x")
    assert found["y"].values[0] > found["y"].values[-1]
    inside = np.isfinite(found.values)
    assert inside.mean() > 0.7
    expected = 5.0 + 2.0 * found["x"].values - found["y"].values[:, None]
    np.testing.assert_allclose(found.values[inside], expected[inside], atol=1e-9)


# ---- the ideal observer ----------------------------------------------------------------------


@pytest.fixture(scope="module")
def pair():
    rng = np.random.default_rng(2)
    first = rng.uniform(2.0, 60.0, size=(2, 150))
    second = first * np.exp(rng.normal(0.0, 0.02, size=first.shape))
    return first, second


def test_simulated_decisions_are_as_often_right_as_d_prime_says(pair):
    # In each trial one Poisson instance of either; the exact log-likelihood ratio chooses.
    first, second = pair
    found = discriminate(excitations_of(first), excitations_of(second))
    rng = np.random.default_rng(1)
    trials = 8000
    weight = np.log(second / first).ravel()
    evidence = [
        rng.poisson(m.ravel(), size=(trials, weight.size)) @ weight for m in (first, second)
    ]
    right = np.mean(evidence[1] > evidence[0])
    error = math.sqrt(right * (1 - right) / trials)
    assert 0.6 < right < 0.95
    assert found.percent_correct / 100 == pytest.approx(right, abs=4 * error)
    # d' itself: difference of means over the root of the mean variance.
    measured = (evidence[1].mean() - evidence[0].mean()) / math.sqrt(
        (evidence[1].var() + evidence[0].var()) / 2
    )
    assert found.d_prime == pytest.approx(measured, abs=0.04)


def test_d_prime_of_one_cone_is_near_the_exact_one():
    # Means of 400 and 420; exact two-interval choice by summing over both Poisson distributions.
    counts = np.arange(200, 700)
    pa, pb = poisson.pmf(counts, 400), poisson.pmf(counts, 420)
    below = np.cumsum(pa) - pa
    exact = 100 * np.sum(pb * (below + pa / 2))
    found = discriminate(excitations_of([400.0]), excitations_of([420.0]))
    assert found.percent_correct == pytest.approx(exact, abs=0.05)
    assert found.d_prime == pytest.approx(20 / math.sqrt(410), rel=1e-3)


def test_squares_of_d_prime_nearly_add_up_over_types(pair):
    first, second = pair
    kinds = np.arange(150) % 3
    found = discriminate(excitations_of(first, kinds), excitations_of(second, kinds))
    assert set(found.by_type) == {"L", "M", "S"}
    total = math.sqrt(sum(v * v for v in found.by_type.values()))
    assert total == pytest.approx(found.d_prime, rel=0.02)


def test_equal_stimuli_cannot_be_told_apart(pair):
    same = discriminate(excitations_of(pair[0]), excitations_of(pair[0]))
    assert same.d_prime == 0.0
    assert same.percent_correct == 50.0
    dark = discriminate(excitations_of([0.0, 4.0]), excitations_of([0.0, 4.0]))
    assert dark.d_prime == 0.0


def test_noise_of_a_render_counts_as_a_difference():
    # Two renders of one scene, each with an error of r times the cones' noise: d' = r sqrt(2 n).
    rng = np.random.default_rng(9)
    mean = np.full(4000, 200.0)
    first, second = (mean + 0.1 * np.sqrt(mean) * rng.standard_normal(4000) for _ in range(2))
    found = discriminate(excitations_of(first), excitations_of(second)).d_prime
    assert found == pytest.approx(0.1 * math.sqrt(2 * 4000), rel=0.05)


def test_several_renders_take_their_noise_out_of_d_prime():
    # True d' of 1 in 2000 receptors; errors of a tenth of the cones' noise would alone make 6.3.
    # d'^2 is uncertain by 2 r^2 sqrt(n / 6) = 0.37 for four renders of each; by 0.067 for 30 tries.
    rng = np.random.default_rng(4)
    mean = rng.uniform(50.0, 150.0, 2000)
    change = mean * (1 + rng.choice([-1, 1], 2000) / np.sqrt(2000 * mean.mean()))
    truth = discriminate(excitations_of(mean), excitations_of(change)).d_prime
    assert truth == pytest.approx(1.0, abs=0.01)

    def renders(of):
        noise = 0.1 * np.sqrt(of) * rng.standard_normal((4, 2000))
        return [excitations_of(of + each) for each in noise]

    found = [discriminate(renders(mean), renders(change)).d_prime ** 2 for _ in range(30)]
    assert np.std(found) == pytest.approx(0.37, rel=0.45)
    assert np.mean(found) == pytest.approx(truth**2, abs=4 * 0.067)
    single = discriminate(renders(mean)[0], renders(change)[0]).d_prime
    assert single > 6.0
    nothing = [discriminate(renders(mean), renders(mean)).d_prime for _ in range(10)]
    assert max(nothing) < 1.2
    assert min(nothing) == 0.0


def test_the_threshold_of_a_contrast_is_that_of_the_closed_form():
    # n cones of mean m: d' of contrast c is c sqrt(n m / (1 + c / 2)) to the third order.
    n, m = 50, 80.0
    found = discrimination_threshold(
        lambda c: excitations_of(np.full(n, m * (1 + c))), 1e-4, 0.5, percent=75.0
    )
    wanted = math.sqrt(2) * norm.ppf(0.75)
    expected = wanted / math.sqrt(n * m)
    assert found == pytest.approx(expected * (1 + expected / 4), rel=2e-3)


def test_percent_and_d_prime_are_inverse():
    assert percent_correct(d_prime_of(82.0)) == pytest.approx(82.0)
    assert d_prime_of(76.02499389065233) == pytest.approx(1.0)


def test_bad_comparisons_are_refused():
    one, two = excitations_of([3.0, 4.0]), excitations_of([3.0, 4.0, 5.0])
    with pytest.raises(InvalidInputError, match="second must be of the same receptors"):
        discriminate(one, two)
    with pytest.raises(InvalidInputError, match="as many frames"):
        discriminate(one, excitations_of([[3.0, 4.0]] * 2))
    with pytest.raises(InvalidInputError, match="one integration time"):
        discriminate(one, excitations_of([3.0, 4.0], integration_time_s=0.01))
    with pytest.raises(InvalidInputError, match="dark_rate_hz"):
        discriminate(one, excitations_of([0.0, 4.0]))
    with pytest.raises(InvalidInputError, match="must be an Excitations"):
        discriminate(one, [3])
    with pytest.raises(InvalidInputError, match="second must be an Excitations or list or tuple"):
        discriminate(one, 3)
    with pytest.raises(InvalidInputError, match="as many, got 2 and 1"):
        discriminate([one, one], one)
    with pytest.raises(InvalidInputError, match="one render or more"):
        discriminate([], [])
    with pytest.raises(InvalidInputError, match="background must excite every receptor"):
        contrast(one, excitations_of([0.0, 4.0]))
    with pytest.raises(InvalidInputError, match="one frame or 1"):
        contrast(one, excitations_of([[3.0, 4.0]] * 2))
    with pytest.raises(InvalidInputError, match="three receptors or more"):
        contrast_image(one.mean, "L")
    line = excitations_of(np.ones(4), places=(np.arange(4), np.zeros(4)))
    with pytest.raises(InvalidInputError, match="lie on one line"):
        contrast_image(line.mean, "L")
    with pytest.raises(InvalidInputError, match="threshold must lie between"):
        discrimination_threshold(lambda c: excitations_of([3.0 + c]), 1e-6, 1e-5)
    with pytest.raises(InvalidInputError, match="high must be > low"):
        discrimination_threshold(lambda c: excitations_of([3.0 + c]), 1.0, 0.5)
    with pytest.raises(InvalidInputError, match="percent must lie between"):
        discrimination_threshold(lambda c: excitations_of([3.0 + c]), 0.1, 1.0, percent=100.0)

"""Fixational eye movements: their statistics, their seeds, and a turning eye's parallax."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import isetcl as ic
from isetcl.cones import ConeMosaic, DriftModel, EyeMovements, Microsaccades
from isetcl.cones.microsaccades import FixationMap
from isetcl.errors import InvalidInputError
from isetcl.eye.turning import ROTATION_CENTRE_MM

PAPER = DriftModel()


def linear_displacement(lag_steps, delay):
    """RMS displacement, arcmin, of the drift with its feedback linearised.

    For a Gaussian w the best line through tanh(epsilon w) has the slope E[w tanh] / E[w^2]; with it
    the spectrum of w is that of a linear filter of xi, and the displacement follows from it.
    """
    omega = np.linspace(0, np.pi, 40001)[1:]
    z = np.exp(1j * omega)

    def spectrum(slope):
        response = z - (1 - PAPER.gamma) + PAPER.gain * slope * z**-delay
        return PAPER.control_noise**2 / np.abs(response) ** 2

    def spread(slope):
        return math.sqrt(np.trapezoid(spectrum(slope), omega) / np.pi)

    def slope_of(sd):
        def part(u):
            return u * math.tanh(PAPER.steepness * sd * u) * math.exp(-u * u / 2)

        return quad(part, -8, 8)[0] / math.sqrt(2 * math.pi) / sd

    slope = brentq(lambda s: slope_of(spread(s)) - s, 0.5, 1.1)
    kernel = (np.sin(lag_steps * omega / 2) / np.sin(omega / 2)) ** 2
    of_control = np.trapezoid(spectrum(slope) * kernel, omega) / np.pi
    return 0.5 * math.sqrt(of_control + lag_steps * PAPER.position_noise**2)


def test_drift_spreads_as_its_linearised_feedback_predicts():
    # 300 paths of 0.3 s; standard errors by the spread over the paths.
    paths = ic.cones.eye_movements(0.3, 0.001, trials=300, seed=3)
    for lag in (1, 10, 50, 100):
        moved = np.square(60 * (paths.gaze_deg[:, lag:] - paths.gaze_deg[:, :-lag])).mean(axis=1)
        error = moved.std(axis=0) / math.sqrt(len(moved))
        for axis, delay in enumerate((70, 40)):
            expected = linear_displacement(lag, delay) ** 2
            # The line is not the curve: by simulation, up to 1 % of the square.
            assert abs(moved[:, axis].mean() - expected) < 4 * error[axis] + 0.01 * expected


@pytest.mark.slow
def test_two_thousand_paths_have_the_computed_statistics():
    # An independent program's numbers from 2000 paths, rounded as printed; its own sampling error
    # beside ours: 2 % of a root mean square over 2000 paths and two axes, 3 % on one axis.
    paths = ic.cones.eye_movements(1.001, 0.001, trials=2000, seed=11)
    both = {0.001: 0.19, 0.010: 0.75, 0.050: 1.75, 0.100: 2.2, 0.200: 2.9, 0.500: 4.5, 1.0: 6.3}
    for lag, expected in both.items():
        found = math.sqrt(np.mean(np.square(paths.displacement_arcmin(lag))))
        assert found == pytest.approx(expected, rel=0.03, abs=0.05)
    np.testing.assert_allclose(paths.displacement_arcmin(0.05), (1.79, 1.69), rtol=0.04)
    np.testing.assert_allclose(paths.displacement_arcmin(0.1), (2.30, 2.12), rtol=0.04)
    for lag, expected in ((0.02, 30.8), (0.1, 24.0), (0.5, 20.0), (1.0, 20.0)):
        assert paths.diffusion_arcmin2_s(lag) == pytest.approx(expected, rel=0.05)
    spread = (60 * paths.gaze_deg).std(axis=1).mean(axis=0)
    np.testing.assert_allclose(spread, (2.47, 2.44), rtol=0.04)


def test_a_path_depends_on_seed_trial_and_time_only():
    options = {"microsaccades": "statistics", "seed": 5}
    few = ic.cones.eye_movements(1.0, trials=3, **options)
    many = ic.cones.eye_movements(1.0, trials=5, **options)
    longer = ic.cones.eye_movements(1.3, trials=3, **options)
    np.testing.assert_array_equal(few.gaze_deg, many.gaze_deg[:3])
    np.testing.assert_array_equal(few.gaze_deg, longer.gaze_deg[:, :200])
    other = ic.cones.eye_movements(1.0, trials=3, microsaccades="statistics", seed=6)
    assert not np.any(few.gaze_deg[:, 1:] == other.gaze_deg[:, 1:])


def test_paths_begin_or_balance_at_the_middle():
    begin = ic.cones.eye_movements(0.3, trials=2)
    np.testing.assert_array_equal(begin.gaze_deg[:, 0], 0.0)
    middle = ic.cones.eye_movements(0.3, trials=2, centre="mean")
    np.testing.assert_allclose(middle.gaze_deg.mean(axis=1), 0.0, atol=1e-15)
    np.testing.assert_allclose(middle.gaze_deg - middle.gaze_deg[:, :1], begin.gaze_deg, atol=1e-15)


def test_frames_lie_on_straight_lines_between_the_steps():
    fine = ic.cones.eye_movements(0.2, 0.001, seed=2)
    coarse = ic.cones.eye_movements(0.2, 0.0025, seed=2)
    for axis in (0, 1):
        expected = np.interp(coarse.time_s, fine.time_s, fine.path()[:, axis])
        np.testing.assert_allclose(coarse.path()[:, axis], expected, atol=1e-12)


def test_velocity_of_a_cubic_path_is_its_derivative():
    # Savitzky-Golay of order 3 is exact on cubics.
    time = 0.002 * np.arange(100)
    cubic = np.stack([3 * time**3 - time, 0.5 - 2 * time**2], axis=1)[None]
    paths = EyeMovements(time, cubic, np.zeros((1, 100), bool))
    expected = np.stack([9 * time**2 - 1, -4 * time], axis=1)
    np.testing.assert_allclose(paths.velocity_deg_s()[0], expected, atol=1e-9)


@pytest.mark.parametrize("model", ["statistics", "fixation map"])
def test_microsaccades_come_and_go_as_their_statistics_say(model):
    # Intervals from start to start are gamma of shape 5 and mean 0.45 s; the speed is the length
    # over the duration, rounded to a ms and at least 2.
    paths = ic.cones.eye_movements(8.0, 0.001, trials=16, microsaccades=model, seed=4)
    flags = np.pad(paths.is_microsaccade, ((0, 0), (1, 1))).astype(int)
    starts = [np.flatnonzero(np.diff(row) == 1) for row in flags]
    ends = [np.flatnonzero(np.diff(row) == -1) for row in flags]
    intervals = np.concatenate([np.diff(row) for row in starts])
    assert len(intervals) > 200
    # Paths of a length leave out long intervals at their ends: 0.45 s of 8 s.
    error = 0.45 / math.sqrt(5 * len(intervals))
    assert 1e-3 * intervals.mean() == pytest.approx(0.45, abs=4 * error + 0.01)
    still = ic.cones.eye_movements(8.0, 0.001, trials=16, seed=4)
    jumps = 60 * np.diff(paths.gaze_deg - still.gaze_deg, axis=1)
    lengths, times = [], []
    for trial, (first, last) in enumerate(zip(starts, ends, strict=True)):
        for a, b in zip(first, last, strict=False):
            if b == len(paths.time_s):
                continue  # cut off by the end of the path
            lengths.append(np.hypot(*jumps[trial, max(a - 1, 0) : b - 1].sum(axis=0)))
            times.append(b - a)
    lengths, times = np.array(lengths), np.array(times)
    long = lengths > 12.0  # arcmin: five steps or more, so that rounding is small
    speed = lengths[long] / 60 / (1e-3 * times[long])
    assert np.count_nonzero(long) > 15
    assert speed.mean() == pytest.approx(39.0, abs=1.5)
    assert times.min() >= 2
    # Between microsaccades both paths drift alike.
    outside = ~paths.is_microsaccade[:, 1:]
    np.testing.assert_allclose(jumps[outside], 0.0, atol=1e-9)


def test_corrections_bring_the_gaze_back():
    drift = ic.cones.eye_movements(10.0, 0.01, trials=10, seed=1)
    for model in ("statistics", "fixation map"):
        held = ic.cones.eye_movements(10.0, 0.01, trials=10, microsaccades=model, seed=1)
        late = np.hypot(*60 * held.gaze_deg[:, 500:].reshape(-1, 2).T)
        free = np.hypot(*60 * drift.gaze_deg[:, 500:].reshape(-1, 2).T)
        assert np.mean(late) < 0.6 * np.mean(free)
        assert np.quantile(late, 0.9) < 20.0


def test_the_fixation_map_sends_the_gaze_to_the_best_place():
    # Once at (4, -2) for 0.3 s, later at (-6, 2) for 0.2 s, arcmin. Each place has a blurred spot
    # of its time, faded by the time since; the target is central and cold.
    visits = FixationMap(2)
    stays = (((4.0, -2.0), 0, 300), ((-6.0, 2.0), 300, 500))
    for place, first, last in stays:
        for t in range(first, last):
            visits.add(t, np.array([place, (0.0, 0.0)]))
    best, target = -1.0, None
    nodes = range(-20, 21, 2)
    remembered = [
        sum(10 * math.exp(-(500 - t) / 500) for t in range(first + 10, last + 1, 10))
        for _, first, last in stays
    ]

    def warmth(x, y):
        total = 0.0
        for weight, ((px, py), _, _) in zip(remembered, stays, strict=True):
            if max(abs(x - px), abs(y - py)) < 7:  # the kernel reaches 2.5 standard deviations
                total += weight * math.exp(-((x - px) ** 2 + (y - py) ** 2) / 8)
        return total

    hottest = max(warmth(x, y) for x in nodes for y in nodes)
    for x in nodes:
        for y in nodes:
            wish = 0.5 * math.exp(-(x * x + y * y) / 450) + 0.5 * (1 - warmth(x, y) / hottest)
            if wish > best + 1e-12:
                best, target = wish, (x, y)
    assert target not in ((0, 0), (4, -2), (-6, 2))
    np.testing.assert_array_equal(visits.target(0, 15.0), target)
    np.testing.assert_array_less(4.0, np.hypot(*visits.target(1, 15.0)))


def test_one_step_of_a_frame_is_enough_for_its_flag():
    fine = ic.cones.eye_movements(4.0, 0.001, microsaccades="statistics", seed=8)
    coarse = ic.cones.eye_movements(4.0, 0.005, microsaccades="statistics", seed=8)
    grouped = fine.is_microsaccade.reshape(1, 800, 5).any(axis=2)
    assert grouped.sum() > 5
    np.testing.assert_array_equal(coarse.is_microsaccade, grouped)


def test_a_plot_shows_the_path():
    axes = ic.cones.eye_movements(2.0, trials=2, microsaccades="statistics").plot(trials=2)
    assert axes.get_xlabel() == "gaze, x (arcmin)"
    assert len(axes.lines) >= 4


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"duration_s": 0.0}, "duration_s must be > 0"),
        ({"frame_time_s": -1.0}, "frame_time_s must be > 0"),
        ({"trials": 0}, "trials must be between 1"),
        ({"microsaccades": "fixation"}, "fixation map"),
        ({"centre": "middle"}, "unknown centre"),
        ({"drift": 3}, "must be a DriftModel"),
        ({"trials": 10**6, "duration_s": 60.0}, "GiB"),
        ({"seed": -1}, "seed must be"),
    ],
)
def test_bad_paths_are_refused(options, message):
    with pytest.raises(InvalidInputError, match=message):
        ic.cones.eye_movements(**{"duration_s": 1.0} | options)


def test_bad_numbers_are_refused():
    with pytest.raises(InvalidInputError, match="gamma must be <= 1"):
        DriftModel(gamma=1.5)
    with pytest.raises(InvalidInputError, match="gain must be >= 0"):
        DriftModel(gain=-1.0)
    with pytest.raises(InvalidInputError, match="speed_deg_s must be > 0"):
        Microsaccades(speed_deg_s=0.0)
    with pytest.raises(InvalidInputError, match="must hold 5 frames"):
        ic.cones.eye_movements(1.0, 0.02).velocity_deg_s()
    with pytest.raises(InvalidInputError, match="lag_s must be"):
        ic.cones.eye_movements(1.0).displacement_arcmin(2.0)
    with pytest.raises(InvalidInputError, match="trial must be"):
        ic.cones.eye_movements(1.0).path(1)
    with pytest.raises(InvalidInputError, match="got shapes"):
        EyeMovements(np.zeros(3), np.zeros((1, 3, 3)), np.zeros((1, 3), bool))


# ---- an eye that turns -----------------------------------------------------------------------


@pytest.fixture(scope="module")
def grid_mosaic():
    x, y = np.meshgrid(np.linspace(-1.6, 0.6, 56), np.linspace(-0.5, 0.5, 26))
    places = np.stack([x.ravel(), y.ravel()], axis=1)
    return ConeMosaic.from_positions(places, np.zeros(len(places), int), spacing_um=20.0)


def centroid_deg(excitations, frame):
    mean = excitations.mean.values[frame]
    return float(np.sum(mean * excitations.dataset["x_deg"].values) / mean.sum())


def shift_by_turning(mosaic, distance_m, gazes):
    seen = ic.cones.excitations_of_turning_eye(
        mosaic,
        ic.scenes.point_source(distance_m, diameter_arcmin=15.0),
        ic.eyes.navarro(2.0, 1.0 / distance_m),
        gazes,
        fov_deg=(3.6, 1.2),
        resolution=(180, 60),
        spp=32,
        bands=1,
        wavelengths_nm=np.array([540.0, 560.0]),
    )
    return seen, centroid_deg(seen, 1) - centroid_deg(seen, 0)


def expected_shift(distance_m):
    """The eye turns by 1 degree to the right about a centre behind the cornea; its entrance pupil,
    b before that centre, goes b sin(1 deg) to the right. A point on the old axis then lies in the
    direction -(1 deg + arctan(b sin / (d + centre - b cos))) of the eye."""
    turn = math.radians(1.0)
    eye = ic.eyes.navarro(2.0, 1.0 / distance_m)
    pupil_mm = ROTATION_CENTRE_MM - eye.entrance_pupil().z_mm
    ahead = 1e3 * distance_m + ROTATION_CENTRE_MM - pupil_mm * math.cos(turn)
    return -1.0 - math.degrees(math.atan(pupil_mm * math.sin(turn) / ahead))


@pytest.mark.slow
def test_near_things_shift_more_than_far_ones_when_the_eye_turns(grid_mosaic):
    near, near_shift = shift_by_turning(grid_mosaic, 0.12, [(0, 0), (1, 0), (0, 0)])
    _, far_shift = shift_by_turning(grid_mosaic, 5.0, [(0, 0), (1, 0)])
    # Coma moves the centroid of light off the chief ray, by 0.001 deg here; alike for both.
    assert near_shift == pytest.approx(expected_shift(0.12), abs=2.5e-3)
    assert far_shift == pytest.approx(expected_shift(5.0), abs=2.5e-3)
    parallax = expected_shift(0.12) - expected_shift(5.0)
    assert parallax == pytest.approx(-5.03 / 60, abs=1e-3)
    assert near_shift - far_shift == pytest.approx(parallax, abs=1e-3)
    # One image for each different gaze; frames in their order.
    assert near.mean.shape == (3, len(grid_mosaic))
    np.testing.assert_array_equal(near.mean.values[0], near.mean.values[2])
    assert near.dataset["gaze_x_deg"].values.tolist() == [0.0, 1.0, 0.0]
    np.testing.assert_allclose(near.dataset["time_s"], [0.0, 0.005, 0.010])


def test_a_turning_eye_refuses_arguments_given_twice(grid_mosaic):
    scene, eye = ic.scenes.point_source(), ic.eyes.navarro()
    with pytest.raises(InvalidInputError, match="must not have 'seed'"):
        ic.cones.excitations_of_turning_eye(
            grid_mosaic, scene, eye, [(0.0, 0.0)], cone_options={"seed": 1}
        )
    with pytest.raises(InvalidInputError, match="gaze_deg must have shape"):
        ic.cones.excitations_of_turning_eye(grid_mosaic, scene, eye, [(0.0, 0.0, 1.0)])

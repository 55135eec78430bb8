"""The current of outer segments against other solvers, and its noise against its formula."""

import math

import numpy as np
import pytest
import xarray
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import root
from scipy.signal import welch
from scipy.special import gamma

import isetcl as ic
from isetcl.cones import ConeMosaic, OuterSegment
from isetcl.cones.photocurrent import noise_power_pa2_hz, photocurrent_noise
from isetcl.errors import InvalidInputError

FOVEAL, PERIPHERAL = OuterSegment.foveal(), OuterSegment.peripheral()
SEGMENTS = {"foveal": FOVEAL, "peripheral": PERIPHERAL}


def cascade(segment):
    """The published equations, with q and s_max from the dark state, as y' = f(y, rate)."""
    s = segment
    dark = 0.5 * s.current_factor * s.dark_gmp**s.channel_power
    q = s.beta_hz * s.dark_calcium / dark
    most = (s.eta_hz2 / s.phi_hz) * s.dark_gmp
    most *= 1 + (s.dark_calcium / s.cyclase_calcium) ** s.cyclase_power

    def current(y):
        return s.current_factor * y[2] ** s.channel_power / (1 + y[4] / s.dark_calcium)

    def slope(y, rate):
        cyclase = most / (1 + (y[3] / s.cyclase_calcium) ** s.cyclase_power)
        return np.array(
            [
                s.gain_hz * rate - s.sigma_hz * y[0],
                y[0] + s.eta_hz2 - s.phi_hz * y[1],
                cyclase - y[1] * y[2],
                q * current(y) - s.beta_hz * y[3],
                s.slow_hz * (y[3] - y[4]),
            ]
        )

    return slope, current


def test_constants_are_those_published():
    # ISETBio's osBioPhys; a dark current of k g^h / 2.
    assert FOVEAL.dark_current_pa == pytest.approx(-0.5 * 0.02 * 20.5**3)
    assert (FOVEAL.sigma_hz, FOVEAL.eta_hz2, FOVEAL.beta_hz, FOVEAL.gain_hz) == (10, 700, 5, 12)
    assert (PERIPHERAL.sigma_hz, PERIPHERAL.eta_hz2) == (22, 2000)
    assert (PERIPHERAL.beta_hz, PERIPHERAL.gain_hz) == (9, 10)
    for s in (FOVEAL, PERIPHERAL):
        assert (s.phi_hz, s.dark_gmp, s.current_factor, s.channel_power) == (22, 20.5, 0.02, 3)
        assert (s.dark_calcium, s.slow_hz, s.cyclase_power, s.cyclase_calcium) == (1, 0.4, 4, 0.5)


@pytest.mark.parametrize("name", SEGMENTS)
@pytest.mark.parametrize("rate", [0.0, 300.0, 5e3, 1e5])
def test_the_steady_state_is_a_root_of_the_equations(name, rate):
    slope, current = cascade(SEGMENTS[name])
    state = np.array(SEGMENTS[name].steady_state(rate))
    scale = np.maximum(state, 1e-9)
    found = root(lambda u: slope(u * scale, rate) / scale, 1.05 * np.ones(5), tol=1e-12)
    assert found.success
    np.testing.assert_allclose(state, np.where(state == 0, 0, found.x * scale), rtol=1e-9)
    pa = SEGMENTS[name].steady_current_pa(rate)
    assert pa == pytest.approx(-current(found.x * scale), rel=1e-8)


@pytest.mark.parametrize("name", SEGMENTS)
def test_another_solver_finds_the_same_current(name):
    # A step up, a flash and a step down; 5 ms frames; scipy's implicit solver at 1e-9.
    segment = SEGMENTS[name]
    slope, current = cascade(segment)
    rates = np.full(120, 2000.0)
    rates[20:60] = 8000.0
    rates[30] = 60000.0
    rates[90:] = 0.0
    state = np.array(segment.steady_state(2000.0))
    expected = []
    for rate in rates:
        steps = solve_ivp(
            lambda _, y, rate=rate: slope(y, rate), (0, 0.005), state, "LSODA", rtol=1e-9, atol=1e-9
        )
        state = steps.y[:, -1]
        expected.append(-current(state))
    found = segment.respond(rates, 0.005, 2000.0)
    np.testing.assert_allclose(found, expected, atol=2e-3)
    assert np.ptp(expected) > 30.0
    # Second order: a step five times as long is 25 times as wrong.
    coarse = segment.respond(rates, 0.005, 2000.0, step_s=5e-4)
    ratio = np.abs(coarse - expected).max() / np.abs(found - expected).max()
    assert 15 < ratio < 40


@pytest.mark.parametrize("name", SEGMENTS)
@pytest.mark.parametrize("background", [0.0, 3000.0])
def test_a_dim_flash_gives_the_impulse_response_of_the_linearised_equations(name, background):
    segment = SEGMENTS[name]
    slope, current = cascade(segment)
    state = np.array(segment.steady_state(background))
    steps = 1e-6 * np.diag(np.maximum(state, 1.0))
    jacobian = np.stack(
        [
            (slope(state + h, background) - slope(state - h, background)) / (2 * h.sum())
            for h in steps
        ],
        axis=1,
    )
    gradient = np.array([(current(state + h) - current(state - h)) / (2 * h.sum()) for h in steps])
    # A kick of the pigment in the middle of the first ms, read at the ends of 300 ms.
    kick = expm(0.5e-3 * jacobian) @ np.array([segment.gain_hz, 0, 0, 0, 0])
    once = expm(1e-3 * jacobian)
    expected = np.array([-gradient @ np.linalg.matrix_power(once, n) @ kick for n in range(300)])
    dark, light = np.full(300, background), 1e-2
    rates = dark.copy()
    rates[0] += light / 1e-3
    found = segment.respond(rates, 1e-3, background) - segment.respond(dark, 1e-3)
    np.testing.assert_allclose(found / light, expected, atol=3e-3 * np.abs(expected).max())
    # Light shuts channels: the inward current shrinks first, and overshoots later.
    assert found[int(np.argmax(np.abs(found)))] > 0
    assert found.min() < 0


def test_foveal_responses_are_about_twice_as_slow_as_peripheral_ones():
    # Sinha et al. 2017, Cell 168:413: times to peak differ about twofold.
    flash = np.zeros(3000)
    flash[0] = 1e-2 / 1e-4
    peaks = {k: 0.1 * np.argmax(s.respond(flash, 1e-4, 0.0)) for k, s in SEGMENTS.items()}
    assert 1.6 < peaks["foveal"] / peaks["peripheral"] < 2.4
    assert 20 < peaks["peripheral"] < 40


def test_steady_light_gives_a_steady_current_and_bright_light_stays_stable():
    for segment in SEGMENTS.values():
        rates = np.broadcast_to(np.array([0.0, 40.0, 1e4, 1e7]), (50, 4))
        found = segment.respond(rates, 0.01)
        steady = np.broadcast_to(segment.steady_current_pa(rates[0]), found.shape)
        np.testing.assert_allclose(found, steady, rtol=1e-6, atol=1e-9)
        jump = segment.respond(np.full((50, 1), 1e7), 0.01, 0.0)
        assert np.all((jump > -86.2) & (jump <= 0))


# ---- noise -----------------------------------------------------------------------------------


def variance_pa2():
    """Both Lorentzians integrated from 0: S f0 sqrt(pi) Gamma(n - 1/2) / (2 Gamma(n))."""
    terms = ((0.16, 55.0, 4.0), (0.045, 190.0, 2.5))
    return sum(s * f * math.sqrt(math.pi) * gamma(n - 0.5) / (2 * gamma(n)) for s, f, n in terms)


@pytest.mark.parametrize("frame_s", [5e-4, 5e-3, 0.02])
def test_noise_has_the_variance_of_the_formula_at_any_frame_rate(frame_s):
    noise = photocurrent_noise(400, 150, frame_s, seed=3)
    # Samples forget each other within 3 ms; the least number of independent ones is 0.2 s / 3 ms
    # times 150 cones: 10 000, a standard error of 1.4 % of the variance.
    assert noise.var() == pytest.approx(variance_pa2(), rel=0.05)
    assert noise.mean() == pytest.approx(0, abs=0.15)


def test_noise_has_the_spectrum_of_two_lorentzians():
    noise = photocurrent_noise(4000, 60, 2.5e-4, seed=1)
    frequency, power = welch(noise, 4000.0, nperseg=400, axis=0, detrend=False)
    power = power.mean(axis=1)
    seen = (frequency > 5) & (frequency < 1000)
    np.testing.assert_allclose(power[seen], noise_power_pa2_hz(frequency[seen]), rtol=0.15)
    bands = power[seen].sum() / noise_power_pa2_hz(frequency[seen]).sum()
    assert bands == pytest.approx(1.0, abs=0.03)
    assert noise_power_pa2_hz(0.0) == pytest.approx(0.205)


def test_noise_depends_on_seed_and_cone_and_its_ends_are_strangers():
    few, many = (photocurrent_noise(40, n, 5e-3, seed=2) for n in (3, 30))
    np.testing.assert_array_equal(few, many[:, :3])
    assert not np.any(few == photocurrent_noise(40, 3, 5e-3, seed=4))
    ends = photocurrent_noise(50, 2000, 1e-3, seed=5)
    assert abs(np.corrcoef(ends[0], ends[-1])[0, 1]) < 0.1
    assert abs(np.corrcoef(ends[:, 0::2].ravel(), ends[:, 1::2].ravel())[0, 1]) < 0.05


# ---- of a mosaic -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def seen():
    """Two cones near the fovea and one at 12 degrees, before an even image, four frames."""
    waves = np.arange(400.0, 701.0, 10.0)
    grid = ic.RetinalGrid.of(ic.eyes.navarro(), (28.0, 28.0), (28, 28))
    image = ic.RetinalImage.from_arrays(grid, waves, np.full((31, 28, 28), 2e-5))
    places = np.array([[0.0, 0.0], [1.0, 0.0], [12.0, 0.0]])
    mosaic = ConeMosaic.from_positions(places, [0, 1, 0], spacing_um=400.0)
    return mosaic.excitations(image, gaze_deg=np.zeros((4, 2)))


def test_cones_have_the_constants_of_their_eccentricity(seen):
    current = ic.cones.photocurrent(seen)
    rates = seen.mean.values[0] / 0.005
    expected = [
        FOVEAL.steady_current_pa(rates[0]),
        FOVEAL.steady_current_pa(rates[1]),
        PERIPHERAL.steady_current_pa(rates[2]),
    ]
    np.testing.assert_allclose(current.current.values, np.tile(expected, (4, 1)), rtol=1e-6)
    np.testing.assert_allclose(current.dataset["time_s"], 0.005 * np.arange(1, 5))
    all_alike = ic.cones.photocurrent(seen, segment="foveal").current.values[0, 2]
    assert all_alike == pytest.approx(FOVEAL.steady_current_pa(rates[2]), rel=1e-6)
    from_dark = ic.cones.photocurrent(seen, background_hz=0.0).current.values
    assert np.all(np.diff(from_dark, axis=0) > 0)


def test_noise_is_added_to_the_current(seen):
    made = ic.cones.photocurrent(seen, seed=9)
    added = made.noisy.values - made.current.values
    np.testing.assert_allclose(added, photocurrent_noise(4, 3, 0.005, 9), atol=1e-12)
    assert made.provenance["step_s"] == 1e-4
    noisy_light = ic.cones.photocurrent(seen, is_noisy_light=True).current.values
    assert np.any(noisy_light != made.current.values)


def test_bad_currents_are_refused(seen):
    rods = ConeMosaic.from_positions([[0, 0], [1, 0]], [0, 3], spacing_um=4.0)
    dataset = seen.dataset.isel(receptor=[0, 1]).assign_coords(type=("receptor", rods.types))
    with pytest.raises(InvalidInputError, match="has rods"):
        ic.cones.photocurrent(ic.cones.Excitations(dataset))
    uneven = seen.dataset.assign_coords(time_s=("frame", [0.0, 1.0, 3.0, 4.0]))
    with pytest.raises(InvalidInputError, match="evenly spaced"):
        ic.cones.photocurrent(ic.cones.Excitations(uneven))
    with pytest.raises(InvalidInputError, match="unknown segment"):
        ic.cones.photocurrent(seen, segment="fovea")
    with pytest.raises(InvalidInputError, match="rates_hz must be finite"):
        FOVEAL.respond(np.array([1.0, -1.0]))
    with pytest.raises(InvalidInputError, match="got shape"):
        FOVEAL.respond(np.ones((2, 3)), background_hz=np.ones(2))
    with pytest.raises(InvalidInputError, match="sigma_hz must be > 0"):
        OuterSegment(sigma_hz=0.0)
    unplaced = ic.cones.Excitations(seen.dataset.drop_vars("eccentricity_deg"))
    with pytest.raises(InvalidInputError, match="do not tell the eccentricity"):
        ic.cones.photocurrent(unplaced)


def test_currents_and_movements_print_as_a_line():
    gaze = ic.cones.eye_movements(0.02, trials=2)
    assert repr(gaze) == "<EyeMovements of 2 trials, 4 frames to 0.015 s>"
    data = xarray.Dataset({"current": (("frame", "receptor"), np.zeros((4, 3)))})
    assert repr(ic.cones.Photocurrent(data)) == "<Photocurrent of 3 cones in 4 frames>"

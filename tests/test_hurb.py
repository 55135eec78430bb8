"""Models of bends at the stop, on the host: closed forms, published numbers, samples."""

import math

import numpy as np
import pytest
from scipy import integrate, special
from slow_cases import slow_after

import isetcl as ic
from isetcl.errors import InvalidInputError
from isetcl.eye.bending.airy import (
    FIRST_ZERO,
    airy_table,
    circle_otf,
    radius_of_share,
    share_beyond,
)
from isetcl.eye.bending.ray_bending import Airy, Hurb, bend, diffraction_model, to_disc

# Another program: OTF at s = .1 .2 .3 .4 .5 .6 .8, peak over Airy's, energy within the
# first dark ring.
SHARES = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8])
EXACT = (0.8729, 0.7471, 0.6238, 0.5046, 0.3910, 0.2848, 0.1041)
TABLE = {
    ("iset3d", 1.0): ((0.8537, 0.7274, 0.6173, 0.5213, 0.4380, 0.3660, 0.2509), 2.1917, 0.7997),
    ("iset3d", math.sqrt(2)): (
        (0.7992, 0.6351, 0.5000, 0.3895, 0.2999, 0.2281, 0.1268),
        1.0959,
        0.7212,
    ),
    # Its gamma, 1.889, is sqrt(2) x 1.336 in the OTF; the peak there, 0.6142, is 2.19174 / 1.889^2.
    ("iset3d", math.sqrt(2) * 1.336): (
        (0.7405, 0.5414, 0.3887, 0.2733, 0.1879, 0.1262, 0.0528),
        0.6140,
        0.6346,
    ),
    ("optrace", 1.0): ((0.8484, 0.7135, 0.5951, 0.4925, 0.4045, 0.3298, 0.2143), 1.8286, 0.7906),
    ("optrace", math.sqrt(2)): (
        (0.7905, 0.6143, 0.4699, 0.3540, 0.2628, 0.1922, 0.0984),
        0.9143,
        0.7043,
    ),
    ("optrace", 2.0): ((0.7135, 0.4925, 0.3298, 0.2143, 0.1353, 0.0829, 0.0285), 0.4571, 0.5866),
}
RNG = np.random.default_rng(7)


def draws(n):
    """Shares beyond and directions of n random bends."""
    turn = 2 * np.pi * RNG.uniform(size=n)
    return 1.0 - RNG.uniform(size=n), np.stack([np.cos(turn), np.sin(turn)], axis=1)


def disc_points(n):
    """Uniform points of the unit disc."""
    radius, turn = np.sqrt(RNG.uniform(size=n)), 2 * np.pi * RNG.uniform(size=n)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)


def straight(n, index):
    """Directions along -z as long as the index."""
    return np.tile([0.0, 0.0, -index], (n, 1))


@pytest.mark.parametrize("case", slow_after(1, [(case,) for case in TABLE]))
def test_the_closed_form_gives_the_published_table(case):
    otf, peak, energy = TABLE[case]
    model = Hurb(*case)
    np.testing.assert_allclose(model.otf(SHARES), otf, atol=6e-5)
    assert model.peak_ratio() == pytest.approx(peak, abs=1e-4)
    assert model.encircled_energy(FIRST_ZERO) == pytest.approx(energy, abs=1e-4)


def test_exact_diffraction_is_the_table_s():
    np.testing.assert_allclose(circle_otf(SHARES), EXACT, atol=6e-5)
    assert circle_otf(1.3) == 0.0


@pytest.mark.parametrize(
    ("axes", "peak"),
    slow_after(1, [("isotropic", 4 / 3), ("iset3d", 2.19174), ("optrace", 1.82857)]),
)
def test_peaks_scale_as_one_over_gamma_squared(axes, peak):
    for gamma in (0.8, 1.0, 1.7):
        assert Hurb(axes, gamma).peak_ratio() == pytest.approx(peak / gamma**2, rel=1e-5)


@pytest.mark.parametrize(
    ("axes", "gamma", "rms"), slow_after(1, [("optrace", 1.116, 0.059), ("iset3d", 1.219, 0.062)])
)
def test_the_best_gamma_is_the_published_one(axes, gamma, rms):
    from scipy.optimize import minimize_scalar

    s = np.linspace(0.0, 1.0, 101)[1:]
    best = minimize_scalar(
        lambda g: float(np.mean((Hurb(axes, g).otf(s) - circle_otf(s)) ** 2)),
        bounds=(0.5, 2.5),
        method="bounded",
    )
    assert best.x == pytest.approx(gamma, abs=0.01)
    assert math.sqrt(best.fun) == pytest.approx(rms, abs=0.002)


def test_the_airy_pattern_s_shares():
    # Born & Wolf 8.5.2: 1 - J0^2 - J1^2.
    zeros = special.jn_zeros(1, 3)
    assert zeros[0] == pytest.approx(FIRST_ZERO, rel=1e-15)
    np.testing.assert_allclose(1 - share_beyond(zeros), [0.8378, 0.9099, 0.9376], atol=5e-5)
    inside = integrate.quad(lambda v: 2 * special.j1(v) ** 2 / v, 0, 4.5)[0]
    assert 1 - share_beyond(4.5) == pytest.approx(inside, rel=1e-10)


def test_the_inverse_of_the_airy_shares():
    v = np.concatenate([np.linspace(1e-3, 20, 4001), np.linspace(100, 157, 101)])
    again = share_beyond(radius_of_share(share_beyond(v)))
    np.testing.assert_allclose(again, share_beyond(v), rtol=1e-12)
    np.testing.assert_allclose(radius_of_share(np.array([1e-6])), 2 / (np.pi * 1e-6))


def test_the_table_of_the_airy_pattern_is_its_inverse():
    steps, table = airy_table()
    assert np.all(np.diff(table) > 0)
    beyond = 1.0 - RNG.uniform(size=20000) * 0.995
    x = np.sqrt((1 - beyond) / beyond) * steps
    found = np.interp(x, np.arange(len(table)), table)
    # In shares of light: at the first dark ring, where v changes like a cube root, a cell holds
    # 2 x / (1 + x^2)^2 = 0.12 times its width, 2.3e-4; a straight line errs by a fifth of that.
    error = np.abs(share_beyond(found) - beyond)
    assert np.max(error) < 5e-5
    assert np.mean(error) < 1e-6
    # Where the table ends the mean tail begins without a step.
    last = ((len(table) - 1) / steps) ** 2
    assert table[-1] == pytest.approx(2 / np.pi * (1 + last), rel=1e-12)


@pytest.mark.parametrize(
    "model", slow_after(2, [Airy(), Hurb(), Hurb("optrace", 1.0), Hurb("isotropic", 1.0)])
)
def test_bends_on_the_host_have_the_closed_form_s_otf(model):
    n, stop, wavelength, index = 200_000, ic.Stop(3.6, 3.0), 550.0, 1.336
    points = stop.rim_mm(disc_points(n))
    bent = bend(model, stop, points, straight(n, index), wavelength, *draws(n))
    cutoff = stop.diameter_mm / (wavelength * 1e-6)  # cycles per unit of T
    for s in SHARES:
        waves = np.cos(2 * np.pi * s * cutoff * np.nan_to_num(bent[:, 0]))
        exact = circle_otf(s) if isinstance(model, Airy) else model.otf(s)
        assert abs(np.mean(waves) - exact) < 4 * np.std(waves) / math.sqrt(n)


def test_a_bend_keeps_the_length_of_a_direction():
    n, index = 1000, 1.336
    slanted = np.tile([0.3, -0.4, -math.sqrt(index**2 - 0.25)], (n, 1))
    for model in (Airy(), Hurb()):
        bent = bend(model, ic.Stop(0.0, 0.5), disc_points(n) / 4, slanted, 550.0, *draws(n))
        kept = np.isfinite(bent[:, 2])
        assert np.mean(kept) > 0.99
        np.testing.assert_allclose(np.linalg.norm(bent[kept], axis=1), index, rtol=1e-12)
        assert np.all(bent[kept, 2] < 0)


def test_what_is_evanescent_is_lost():
    # v of sine 1 in air: pi D / lambda; beyond it 2 / (pi v) of the light.
    n, stop, wavelength = 200_000, ic.Stop(0.0, 0.05), 550.0
    bent = bend(Airy(), stop, np.zeros((n, 2)), straight(n, 1.0), wavelength, *draws(n))
    expected = 2 / np.pi / (np.pi * 0.05 / 550e-6)
    lost = np.mean(np.isnan(bent[:, 2]))
    assert lost == pytest.approx(expected, abs=4 * math.sqrt(expected / n))


def test_a_slanted_ray_sees_a_foreshortened_stop():
    # The pattern of a stop of width D seen at angle psi is that of D cos psi: wider in angle.
    n, psi = 100_000, math.radians(50.0)
    slanted = np.tile([math.sin(psi), 0.0, -math.cos(psi)], (n, 1))
    bent = bend(Airy(), ic.Stop(0.0, 3.0), np.zeros((n, 2)), slanted, 550.0, *draws(n))
    angle = np.arctan2(bent[:, 0], -bent[:, 2]) - psi
    s = 0.4
    frequency = s * 3.0 * math.cos(psi) / 550e-6
    waves = np.cos(2 * np.pi * frequency * np.nan_to_num(angle))
    assert abs(np.mean(waves) - circle_otf(s)) < 4 * np.std(waves) / math.sqrt(n) + 1e-3


@pytest.mark.parametrize("model", [Airy(), Hurb()])
def test_an_ellipse_is_a_stretched_circle(model):
    n, wavelength = 200_000, 550.0
    stop = ic.Stop(0.0, 4.0, (0.3, -0.2), 2.0, 30.0)
    points = stop.rim_mm(disc_points(n))
    bent = bend(model, stop, points, straight(n, 1.0), wavelength, *draws(n))
    turn = math.radians(30.0)
    for width, along in (
        (4.0, (math.cos(turn), math.sin(turn))),
        (2.0, (-math.sin(turn), math.cos(turn))),
    ):
        change = np.nan_to_num(bent[:, :2]) @ along
        for s in (0.2, 0.5):
            waves = np.cos(2 * np.pi * s * width / (wavelength * 1e-6) * change)
            exact = circle_otf(s) if isinstance(model, Airy) else model.otf(s)
            assert abs(np.mean(waves) - exact) < 4 * np.std(waves) / math.sqrt(n)


def test_the_paper_s_values():
    # sigma_S = atan(1 / (1.41 Delta 2 pi / lambda)): at 550 nm 2.13 arcmin at 0.1 mm.
    model = Hurb.iset3d()
    for delta, arcmin in ((0.01, 21.3), (0.1, 2.13), (0.5, 0.43), (1.0, 0.21)):
        sigma = math.atan(model.scale_mm(550.0, 1.336) / 1.336 / delta)
        formula = math.atan(1 / (1.41 * delta * 2 * math.pi / 550e-6))
        assert sigma == pytest.approx(formula, rel=1e-9)
        assert math.degrees(sigma) * 60 == pytest.approx(arcmin, abs=0.05)
    across, along = model.distances(np.array([0.6]))
    assert (across[0], along[0]) == (pytest.approx(0.4), pytest.approx(0.8))


@pytest.mark.slow
def test_vacuum_bends_are_wider_by_the_index():
    s, n = 0.3, 1.336
    wide = Hurb("iset3d", 1.4, "vacuum")
    assert wide.otf(s, n) == pytest.approx(float(Hurb("iset3d", 1.4 * n).otf(s)), rel=1e-12)
    assert wide.peak_ratio(n) == pytest.approx(Hurb("iset3d", 1.4).peak_ratio() / n**2, rel=1e-6)


def test_the_matrix_of_a_stop_takes_its_rim_to_the_unit_circle():
    stop = ic.Stop(0.0, 5.0, (1.0, 2.0), 3.0, 70.0)
    rim = stop.rim_mm(np.array([[1.0, 0.0], [0.0, 1.0], [0.6, -0.8]]))
    disc = (rim - stop.decentre_mm) @ to_disc(stop).T
    np.testing.assert_allclose(disc, [[1, 0], [0, 1], [0.6, -0.8]], atol=1e-14)


def test_names_and_models():
    assert diffraction_model("none") is None
    assert diffraction_model("hurb") == Hurb()
    assert diffraction_model("iset3d") == Hurb("iset3d", 2 / 1.41, "vacuum")
    assert diffraction_model(Hurb("optrace")) == Hurb("optrace")
    assert diffraction_model("airy") == Airy()


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: diffraction_model("fresnel"), "diffraction"),
        (lambda: diffraction_model(3), "diffraction"),
        (lambda: Hurb("radial"), "axes"),
        (lambda: Hurb(gamma=0.0), "gamma"),
        (lambda: Hurb(wavelength="air"), "wavelength"),
        (lambda: radius_of_share(np.array([0.0])), "beyond"),
    ],
)
def test_bad_values_are_named(make, named):
    with pytest.raises(InvalidInputError, match=named):
        make()

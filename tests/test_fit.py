"""Eyes fitted to measured wavefronts: parameters come back, and uncertainties are honest."""

import dataclasses
import math

import numpy as np
import pytest
from scipy import stats

import isetcl as ic
from isetcl.eye.fitting.parameters import get_parameter, parameter_names, with_parameters
from isetcl.eye.waves.zernike import ZernikeFit

fit, measure, ZernikeMeasurement = ic.eyes.fit, ic.eyes.measure, ic.eyes.ZernikeMeasurement

FIELDS = [(0.0, 0.0), (0.0, 10.0), (0.0, -10.0), (10.0, 0.0), (-15.0, 0.0)]
TRUTH = {
    "cornea front.curvature": 1.0 / 7.9,
    "lens back.conic": -1.4,
    "lens front.vertex_z_mm": 3.75,
    "retina.vertex_z_mm": 24.3,
}
FREE = list(TRUTH)
START = ic.eyes.navarro(6.0)
PERSON = with_parameters(START, TRUTH)


def measured(eye=PERSON, radius_mm=3.0, order=6, fields=FIELDS):
    return [measure(eye, f, radius_mm=radius_mm, order=order) for f in fields]


def noisy(clean, noise_um, rng):
    return [
        dataclasses.replace(
            m,
            zernike=dataclasses.replace(
                m.zernike,
                coefficients_um=m.zernike.coefficients_um
                + noise_um * rng.standard_normal(len(m.zernike.coefficients_um)),
            ),
        )
        for m in clean
    ]


@pytest.mark.parametrize("field", [(0.0, 0.0), (7.0, -5.0), (-15.0, 0.0)])
def test_measuring_an_eye_gives_the_fit_to_its_wavefront(field):
    # The other route samples the wavefront on a square grid and solves least squares.
    eye = ic.eyes.arizona(5.0)
    # At a lower order the ragged rim of the grid mixes what is left out, by 2e-5 um.
    fast = measure(eye, field, radius_mm=2.0, order=8, object_distance_m=2.0)
    front = eye.wavefront(field, samples=64, object_distance_m=2.0)
    slow = front.zernike(8, 2.0).coefficients_um
    # Piston and tilt too: both are relative to the chief ray.
    assert fast.zernike.coefficients_um == pytest.approx(slow, abs=1e-7)


@pytest.mark.slow
def test_a_perturbed_eye_is_recovered_from_noiseless_zernikes_at_five_fields():
    found = fit(measured(), START, FREE)
    assert found.is_converged
    assert found.values == pytest.approx(list(TRUTH.values()), rel=1e-4)
    assert found.start == pytest.approx([get_parameter(START, n) for n in FREE])
    assert get_parameter(found.eye, "lens back.conic") == pytest.approx(-1.4, rel=1e-4)
    assert found.rms_um < 1e-6
    assert found.degrees_of_freedom == 5 * 25 - 4
    # The iris moved with the lens it rests on.
    assert found.eye.stop.z_mm == pytest.approx(3.75, rel=1e-4)


@pytest.mark.slow
def test_an_eye_is_recovered_from_wavefronts_sampled_another_way():
    fields = [(0.0, 0.0), (0.0, 10.0), (-12.0, 0.0)]
    fits = [PERSON.wavefront(f, samples=64).zernike(6, 2.6) for f in fields]
    items = [ZernikeMeasurement(f, z) for f, z in zip(fields, fits, strict=True)]
    found = fit(items, START, FREE[:2] + FREE[3:])
    # The lens front stays where it was not: only what is free may be right.
    assert found.rms_um > 1e-4
    found = fit(items, START, FREE)
    assert found.values == pytest.approx(list(TRUTH.values()), rel=1e-4)


@pytest.mark.slow
def test_tilts_and_toric_corneas_are_recovered():
    # A lens that is tilted and shifted, a cornea steeper in one section, a pupil off the axis.
    cornea, back = START.surfaces[0], START.surfaces[3]
    surfaces = (
        dataclasses.replace(cornea, shape=ic.Biconic(cornea.curvature, cornea.conic)),
        *START.surfaces[1:3],
        dataclasses.replace(back, placement=ic.Placement()),
    )
    start = dataclasses.replace(START, surfaces=surfaces)
    truth = {
        "cornea front.shape.curvature_x": 1.0 / 7.6,
        "lens back.placement.tilt_deg[0]": 3.0,
        "lens back.placement.decentre_mm[0]": 0.15,
        "stop.decentre_mm[1]": 0.2,
    }
    person = with_parameters(start, truth)
    items = measured(person, 2.0, 4, [(0.0, 0.0), (0.0, 8.0)])
    found = fit(items, start, list(truth))
    assert found.values == pytest.approx(list(truth.values()), rel=1e-4)


@pytest.mark.parametrize("field", [(0.0, 0.0), (6.0, -8.0)])
def test_measuring_a_decentred_eye_gives_the_fit_to_its_wavefront(field):
    eye = with_parameters(START, {"stop.decentre_mm[0]": 0.4, "stop.decentre_mm[1]": -0.2})
    eye = dataclasses.replace(eye, stop=dataclasses.replace(eye.stop, diameter_mm=4.0))
    # The circle lies about the middle of the entrance pupil, as the fit's does.
    fast = measure(eye, field, radius_mm=1.8, order=8).zernike.coefficients_um
    slow = eye.wavefront(field, samples=64).zernike(8, 1.8).coefficients_um
    assert fast == pytest.approx(slow, abs=1e-6)


def test_standard_errors_are_those_of_linear_least_squares():
    # One parameter: sigma / |dZ/dp|, the slope by a wide central difference of another function.
    name, noise = "retina.vertex_z_mm", 0.02
    found = fit(measured(START, fields=[(0.0, 5.0)]), START, [name], noise_um=noise)
    z = get_parameter(START, name)
    ahead, behind = (
        with_parameters(START, {name: z + dz}).wavefront((0.0, 5.0), samples=64).zernike(6, 3.0)
        for dz in (0.01, -0.01)
    )
    slope = (ahead.coefficients_um - behind.coefficients_um)[3:] / 0.02
    assert found.standard_errors[0] == pytest.approx(noise / np.linalg.norm(slope), rel=1e-3)
    assert found.intervals(0.95)[0] == pytest.approx(
        z + np.array([-1.959964, 1.959964]) * found.standard_errors[0]
    )


def test_unstated_noise_is_taken_from_the_residuals():
    rng = np.random.default_rng(5)
    items = noisy(measured(START), 0.03, rng)
    found = fit(items, START, ["retina.vertex_z_mm"])
    # 124 degrees of freedom: the estimate is within 20 % in 99.8 % of cases.
    assert found.noise_um == pytest.approx(0.03, rel=0.2)
    assert not found.noise_is_stated
    stated = fit(items, START, ["retina.vertex_z_mm"], noise_um=0.03)
    ratio = found.standard_errors / stated.standard_errors
    assert ratio == pytest.approx(found.noise_um / 0.03)
    width = np.diff(found.intervals(0.95))[0, 0] / (2.0 * found.standard_errors[0])
    assert width == pytest.approx(stats.t.ppf(0.975, 124))


@pytest.mark.slow
def test_intervals_cover_the_truth_95_times_of_100():
    # 100 fits with noise of 0.01 um. A count of 88 to 100 has a probability of 0.9985 for each
    # parameter if the coverage is 0.95; the spread of the errors must be that which is claimed,
    # by the chi-square bounds of 99.8 %.
    rng = np.random.default_rng(20)
    clean, truth = measured(), np.array(list(TRUTH.values()))
    scores, covered = [], []
    for _ in range(100):
        found = fit(noisy(clean, 0.01, rng), START, FREE, noise_um=0.01)
        low, high = found.intervals(0.95).T
        covered.append((low <= truth) & (truth <= high))
        scores.append((found.values - truth) / found.standard_errors)
    count = np.sum(covered, axis=0)
    assert np.all(count >= 88), count
    squares = np.sum(np.square(scores), axis=0)
    low, high = stats.chi2.ppf([0.001, 0.999], 100)
    assert np.all((squares > low) & (squares < high)), squares


def test_conventions_of_coefficients_are_understood():
    # Z(3, 1) = 0.3 um orthonormal: norm sqrt(8); OSA 8, Noll 8 of 1-based; cosine, so that an
    # examiner who faces the eye sees it with the other sign.
    osa = np.zeros(10)
    osa[8] = 0.3
    make = ZernikeMeasurement.from_coefficients
    common = {"radius_mm": 2.0, "wavelength_nm": 600.0}
    assert make((0.0, 0.0), osa, **common).zernike.coefficient_um(3, 1) == 0.3
    peak = make(0.0, osa * math.sqrt(8.0), normalisation="peak", **common)
    assert peak.zernike.coefficient_um(3, 1) == pytest.approx(0.3)
    waves = make(0.0, osa / 0.6, unit="waves", **common)
    assert waves.zernike.coefficient_um(3, 1) == pytest.approx(0.3)
    noll = np.zeros(10)
    noll[7] = 0.3
    assert make(0.0, noll, order="noll", **common).zernike.coefficient_um(3, 1) == 0.3
    facing = make(0.0, osa, side="examiner", **common)
    assert facing.zernike.coefficient_um(3, 1) == pytest.approx(-0.3)


def test_peak_coefficients_in_noll_order_are_the_same_wavefront():
    rng = np.random.default_rng(2)
    values = rng.standard_normal(15)
    item = ZernikeMeasurement.from_coefficients(
        0.0, values, radius_mm=1.0, wavelength_nm=550.0, order="noll", normalisation="peak"
    )
    # Noll 1 to 11 without their norms, written out (Noll 1976, table I).
    x, y = 0.3, -0.5
    r2 = x * x + y * y
    noll = [1, x, y, 2 * r2 - 1, 2 * x * y, x * x - y * y, (3 * r2 - 2) * y, (3 * r2 - 2) * x]
    noll += [3 * x * x * y - y**3, x**3 - 3 * x * y * y, 6 * r2 * r2 - 6 * r2 + 1]
    noll += [(4 * r2 - 3) * (x * x - y * y), (4 * r2 - 3) * 2 * x * y]
    noll += [x**4 - 6 * x * x * y * y + y**4, 4 * x * y * (x * x - y * y)]
    expected = float(np.dot(values, noll))
    assert float(item.zernike.opd_um(np.array(x), np.array(y))) == pytest.approx(expected)


def test_parameters_have_names():
    names = parameter_names(START)
    assert "cornea front.vertex_z_mm" not in names
    assert {"lens back.medium_after.dispersion.n_c", "stop.z_mm", *FREE} <= set(names)
    changed = with_parameters(START, {"lens front.vertex_z_mm": 3.5, "stop.z_mm": 3.4})
    assert changed.stop.z_mm == 3.4
    assert changed.accommodation_model is None
    medium = with_parameters(START, {"lens front.medium_after.dispersion.n_c": 1.42})
    assert medium.surfaces[2].medium_after.dispersion.n_c == 1.42
    assert medium.surfaces[3] == START.surfaces[3]


def test_a_thinner_lens_gets_a_smaller_rim():
    # The faces of a lens 3 mm thick meet before the 5.2 mm of the thicker one.
    thin = with_parameters(START, {"lens front.vertex_z_mm": 4.6})
    front, back = thin.surfaces[2:]
    rim = front.semi_diameter_mm
    assert rim == back.semi_diameter_mm < START.surfaces[2].semi_diameter_mm
    gap = back.vertex_z_mm + back.sag_mm(rim) - front.vertex_z_mm - front.sag_mm(rim)
    assert 0.0 <= gap < 0.05


ONE = measured(START, fields=[(0.0, 0.0)])


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: fit(ONE, START, ["lens back.radius"]), "no parameter 'lens back.radius'"),
        (lambda: fit(ONE, START, ["lens bak.conic"]), "did you mean lens back.conic"),
        (lambda: fit(ONE, START, ["retina.conic"]), "'retina.conic' must change"),
        (lambda: fit(ONE, START, ["retina.vertex_z_mm", "stop.diameter_mm"]), "stop.diameter_mm"),
        (
            lambda: fit(ONE, START, ["retina.vertex_z_mm", "retina.vertex_z_mm"]),
            "every parameter once",
        ),
        (
            lambda: fit(
                ONE, START, [f"lens front.medium_after.dispersion.{n}" for n in ("n_f", "n_c")]
            ),
            "cannot be told apart",
        ),
        (lambda: fit(ONE, START, []), "at least one parameter"),
        (lambda: fit([], START, FREE), "at least one ZernikeMeasurement"),
        (lambda: fit([1.0], START, FREE), r"measured\[0\]"),
        (lambda: fit(ONE, START, FREE, noise_um=0.0), "noise_um must be > 0"),
        (lambda: fit(ONE, START, FREE, lowest_order=7), "0 coefficients of order 7"),
        (lambda: fit(ONE, START, "retina.vertex_z_mm"), "pass a list of names"),
        (lambda: measure(START, radius_mm=6.9), "do not reach the retina"),
    ],
)
def test_impossible_fits_are_refused(make, match):
    with pytest.raises(ic.InvalidInputError, match=match):
        make()


@pytest.mark.parametrize(
    ("values", "options", "match"),
    [
        (np.zeros(14), {}, r"1, 3, 6, 10, 15 \.\.\.\), got 14"),
        (np.zeros(15), {"normalisation": "born_wolf"}, "unknown normalisation 'born_wolf'"),
        (np.zeros(15), {"order": "fringe"}, "unknown order of Zernike polynomials 'fringe'"),
        (np.zeros(15), {"unit": "mm"}, "unknown unit 'mm'"),
        (np.full(15, np.nan), {}, "finite"),
        (np.zeros(15), {"radius_mm": -2.0}, "radius_mm must be > 0"),
        (np.zeros(15), {"object_distance_m": -1.0}, "distance"),
    ],
)
def test_wrong_measurements_are_refused(values, options, match):
    common = {"radius_mm": 2.0, "wavelength_nm": 600.0} | options
    with pytest.raises(ic.InvalidInputError, match=match):
        ZernikeMeasurement.from_coefficients((0.0, 0.0), values, **common)


def test_a_search_cut_short_says_so():
    with pytest.warns(UserWarning, match="did not converge in 1 steps"):
        found = fit(measured(fields=[(0.0, 0.0), (0.0, 10.0)]), START, FREE, max_evaluations=1)
    assert not found.is_converged
    assert isinstance(found.eye, ic.Eye)
    assert "cornea front.curvature" in found.summary()


def test_measurements_hold_fits():
    zernike = ZernikeFit(np.zeros(6), 2.0, 550.0)
    assert ZernikeMeasurement(5.0, zernike).field_deg == (0.0, 5.0)

"""Published means of human eyes against their tables, and eyes drawn from a population."""

import math

import numpy as np
import pytest
from scipy import stats
from scipy.io import savemat

import isetcl as ic
from isetcl.eye.people import human_mtf, pupil_size
from isetcl.eye.people.population import Population, load_population
from isetcl.eye.people.virtual_eye import chromatic_difference_dpt, radial_mtf, wavefront_of
from isetcl.eye.waves.zernike import ZernikeFit, from_sparse, noll_nm, norm, osa_index

WATSON_CPD = [5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0, 60.0]
WATSON = {
    2.0: [0.8647, 0.6574, 0.4808, 0.3530, 0.1973, 0.1112, 0.0567, 0.0151],
    2.5: [0.8468, 0.6178, 0.4412, 0.3224, 0.1860, 0.1143, 0.0711, 0.0419],
    3.0: [0.8159, 0.5626, 0.3897, 0.2817, 0.1641, 0.1046, 0.0695, 0.0464],
    4.0: [0.7129, 0.4270, 0.2782, 0.1967, 0.1148, 0.0754, 0.0528, 0.0383],
    5.0: [0.5662, 0.2953, 0.1843, 0.1286, 0.0751, 0.0500, 0.0358, 0.0267],
    6.0: [0.4308, 0.2055, 0.1256, 0.0872, 0.0510, 0.0343, 0.0249, 0.0189],
}


@pytest.mark.parametrize("pupil", WATSON)
def test_watsons_mean_mtf_has_its_table(pupil):
    # Watson 2013, as several public programs compute it.
    found = human_mtf.watson_2013_mtf(np.array(WATSON_CPD), pupil)
    assert found == pytest.approx(WATSON[pupil], abs=1e-4)


def test_the_diffraction_limit_has_its_table():
    # 550 nm; cut-offs 63.47 and 126.93 cycles/degree at 2 and 4 mm.
    cpd = np.array([5.0, 10.0, 20.0, 40.0, 60.0])
    limits = {2.0: [0.8998, 0.8002, 0.6055, 0.2544, 0.0152]}
    limits[4.0] = [0.9499, 0.8998, 0.8002, 0.6055, 0.4214]
    for pupil, table in limits.items():
        assert human_mtf.diffraction_mtf(cpd, pupil, 550.0) == pytest.approx(table, abs=6e-5)
    found = human_mtf.diffraction_mtf(np.array([10.0, 20.0, 30.0, 40.0, 60.0]), 3.0, 550.0)
    assert found == pytest.approx([0.8665, 0.7345, 0.6055, 0.4812, 0.2544], abs=6e-5)
    half_cutoff = np.pi * 3.0e6 / (180.0 * 550.0) / 2
    assert float(human_mtf.diffraction_mtf(half_cutoff, 3.0, 550.0)) == pytest.approx(
        0.391, abs=5e-4
    )
    assert float(human_mtf.diffraction_mtf(63.46, 2.0, 550.0)) > 0.0
    assert float(human_mtf.diffraction_mtf(63.48, 2.0, 550.0)) == 0.0


def test_pupil_formulas_have_their_values():
    # Watson & Yellott 2012, 100 deg^2: Stanley-Davies, then ages 30 and 60.
    levels = np.array([1.0, 10.0, 100.0, 1000.0])
    base = pupil_size.stanley_davies(levels, area_deg2=100.0)
    assert base == pytest.approx([6.7586, 5.7447, 4.4196, 3.2671], abs=6e-5)
    rows = {
        (30.0, "both"): [6.6971, 5.6970, 4.3899, 3.2530],
        (30.0, "one"): [7.2498, 6.6971, 5.6970, 4.3899],
        (60.0, "both"): [5.3980, 4.6887, 3.7617, 2.9554],
    }
    for (age, eyes), row in rows.items():
        found = pupil_size.watson_yellott(levels, area_deg2=100.0, age_years=age, eyes=eyes)
        assert found == pytest.approx(row, abs=6e-5)


def test_older_pupil_formulas_agree_at_their_landmarks():
    # tanh vanishes at 1 cd/m^2 and at 10^-0.5 mL; the cubic at 10^-8.1 mL; 1 mL = 3.1831 cd/m^2.
    assert float(pupil_size.pokorny_smith(1.0)) == pytest.approx(5.0)
    assert float(pupil_size.moon_spencer(3.1831 * 10.0**-0.5)) == pytest.approx(4.9, abs=1e-5)
    lowest = pupil_size.de_groot_gebhard(3.1831 * 10.0**-8.1)
    assert float(lowest) == pytest.approx(10.0**0.8558)
    # Their usual forms for cd/m^2: log10 L, and 7.175 exp(-0.00092 (7.597 + log10 L)^3).
    level = np.arange(-3.0, 4.0)
    spencer = 4.9 - 3.0 * np.tanh(0.4 * level)
    assert pupil_size.moon_spencer(10.0**level) == pytest.approx(spencer, abs=4e-3)
    gebhard = 7.175 * np.exp(-0.00092 * (7.597 + level) ** 3)
    assert pupil_size.de_groot_gebhard(10.0**level) == pytest.approx(gebhard, rel=7e-3)


def test_older_pupil_formulas_describe_the_same_eyes():
    # Whoever converts millilamberts the wrong way round is 1.1 mm off.
    levels = 10.0 ** np.arange(-1.0, 3.0)
    formulas = (pupil_size.moon_spencer, pupil_size.de_groot_gebhard, pupil_size.pokorny_smith)
    sizes = np.array([formula(levels) for formula in formulas])
    assert np.ptp(sizes, axis=0).max() < 0.7


def test_interferometric_and_double_pass_mtfs_have_their_values():
    # exp(-2.424) = 0.088567; the diffraction limit of 3 mm at 633 nm has its end at 82.716 c/d.
    s = 20.0 / (math.pi * 3e6 / (180.0 * 633.0))
    ideal = 2.0 / math.pi * (math.acos(s) - s * math.sqrt(1.0 - s * s))
    expected = ideal * (0.3481 + 0.6519 * 0.088567)
    assert float(human_mtf.williams_1994_mtf(20.0)) == pytest.approx(expected, rel=1e-5)
    expected = 0.78 * math.exp(-1.72) + 0.22 * math.exp(-0.37)
    assert float(human_mtf.navarro_1993_mtf(10.0)) == pytest.approx(expected)
    between = human_mtf.navarro_1993_mtf(10.0, 25.0)
    outer = [float(human_mtf.navarro_1993_mtf(10.0, e)) for e in (20.0, 30.0)]
    assert outer[1] < between < outer[0]
    corner = 16.6 - 1.49 * 3.0
    assert float(human_mtf.rovamo_1998_mtf(corner, 3.0)) == pytest.approx(math.exp(-1.0))
    # n = exp(0.28 - 0.318) = 0.96271, 2^n = 1.94897.
    found = float(human_mtf.rovamo_1998_mtf(2.0 * corner, 3.0))
    assert found == pytest.approx(math.exp(-1.94897), rel=1e-4)


@pytest.mark.parametrize("formula", ["geisler_1984", "davila_geisler_1991"])
def test_line_spreads_and_transfers_are_transforms_of_each_other(formula):
    x = np.linspace(-40.0, 40.0, 80_001)
    spread = human_mtf.gaussian_lsf(x, formula)
    step = x[1] - x[0]
    assert spread.sum() * step == pytest.approx(1.0, abs=1e-9)
    for cpd in (3.0, 12.0, 40.0):
        found = np.sum(spread * np.cos(2.0 * np.pi * cpd / 60.0 * x)) * step
        assert float(human_mtf.gaussian_mtf(cpd, formula)) == pytest.approx(found, abs=1e-9)


def test_westheimers_line_spread_has_its_transfer():
    x = np.linspace(-60.0, 60.0, 240_001)
    spread = human_mtf.westheimer_lsf(x)
    assert float(human_mtf.westheimer_lsf(0.0)) == pytest.approx(1.0)
    for cpd in (0.0, 3.0, 12.0, 40.0):
        found = np.sum(spread * np.cos(2.0 * np.pi * cpd / 60.0 * x)) / spread.sum()
        assert float(human_mtf.westheimer_mtf(cpd)) == pytest.approx(found, abs=2e-6)


def test_westheimers_two_formulas_differ_as_described():
    # The line integral of the point spread against the line spread, both 1 at 0.
    t = np.linspace(-20.0, 20.0, 40_001)
    line = [human_mtf.westheimer_psf(np.hypot(x, t)).sum() for x in (0.0, 1.0, 3.0)]
    ratio = np.array(line) / line[0] / human_mtf.westheimer_lsf(np.array([0.0, 1.0, 3.0]))
    assert ratio[1] == pytest.approx(0.5, abs=0.05)
    assert ratio[2] < 1e-3


@pytest.mark.parametrize("pupil", [None, 2.0])
def test_a_virtual_eye_without_aberrations_is_limited_by_diffraction(pupil):
    flat = ZernikeFit(np.zeros(6), 1.5, 550.0)
    cpd = np.array([0.0, 5.0, 20.0, 40.0, 60.0])
    found = radial_mtf(flat, cpd, pupil_diameter_mm=pupil, wavelengths_nm=[550.0], focus_nm=550.0)
    expected = human_mtf.diffraction_mtf(cpd, pupil or 3.0, 550.0)
    assert found == pytest.approx(expected, abs=1e-3)


def test_a_virtual_eye_has_the_mtf_of_the_eye_its_coefficients_come_from():
    # The model eye does not quite meet the sine condition, the virtual one does.
    eye = ic.eyes.navarro(4.0)
    front = eye.wavefront(field_deg=(3.0, 2.0), samples=64)
    cpd = np.array([3.0, 6.0, 12.0, 24.0, 48.0])
    virtual = wavefront_of(front.zernike(8))
    for turn in (0.0, 50.0, 90.0):
        expected = front.otf().mtf(cpd, turn)
        assert virtual.otf().mtf(cpd, turn) == pytest.approx(expected, abs=0.01)
    assert virtual.rms_um == pytest.approx(front.rms_um, rel=0.01)


def test_a_virtual_eye_has_the_psf_of_the_eye_its_coefficients_come_from():
    # Off axis, where coma and oblique astigmatism tell up from down and left from right.
    front = ic.eyes.navarro(4.0).wavefront(field_deg=(9.0, 5.0), samples=64)
    real = front.psf(12.0, 48).relative
    virtual = wavefront_of(front.zernike(8)).psf(12.0, 48).relative
    largest = real.max()
    assert np.max(np.abs(virtual - real)) < 0.06 * largest
    for turned in (real[::-1], real[:, ::-1], real[::-1, ::-1], real.T):
        assert np.max(np.abs(turned - real)) > 0.15 * largest


def test_the_rms_of_a_virtual_eye_is_that_of_its_coefficients():
    fit = from_sparse({(2, -2): 0.1, (3, 1): 0.2, (4, 0): -0.15, (1, 1): 3.0}, 2.5, 600.0)
    front = wavefront_of(fit, samples=128)
    values = front.zernike(4).coefficients_um
    assert values == pytest.approx(fit.coefficients_um, abs=1e-9)
    # Tilt only moves the image; coma brings its own tilt in q, sqrt(8) (3 r^3 - 2 r) has none.
    assert front.rms_um == pytest.approx(fit.rms_um(2), rel=2e-3)


def test_virtual_eyes_defocus_in_blue_light():
    # Thibos et al. 1992: 1.7174 dpt between 589 and 400 nm.
    assert float(chromatic_difference_dpt(400.0)) == pytest.approx(-1.7174, abs=5e-5)
    myopic = from_sparse({(2, 0): 0.1}, 1.5, 550.0)
    cpd = np.array([2.0, 5.0, 10.0])
    found = radial_mtf(myopic, cpd, wavelengths_nm=[450.0], focus_nm=560.0, samples=64)
    # The same defocus as a coefficient: M r^2 / (4 sqrt 3), positive for a myopic eye.
    blur = float(chromatic_difference_dpt(560.0) - chromatic_difference_dpt(450.0))
    assert blur > 0.8
    more = blur * 1.5**2 / (4.0 * math.sqrt(3.0))
    defocused = from_sparse({(2, 0): 0.1 + more}, 1.5, 450.0)
    assert found == pytest.approx(wavefront_of(defocused).otf().mtf(cpd), abs=1e-9)


def test_white_light_transfers_less_than_its_best_wavelength():
    flat = ZernikeFit(np.zeros(6), 1.5, 560.0)
    cpd = np.array([5.0, 10.0, 20.0])
    white = radial_mtf(flat, cpd)
    assert np.all(white < radial_mtf(flat, cpd, wavelengths_nm=[560.0]))
    assert radial_mtf(flat, np.array([0.0]))[0] == pytest.approx(1.0, abs=1e-6)


def population(seed=3, terms=15, diameter_mm=6.0):
    """A made-up population with correlations, and its covariance."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((terms, terms)) * np.geomspace(0.2, 0.01, terms)[:, None] / 4.0
    mean = ZernikeFit(0.05 * rng.standard_normal(terms), diameter_mm / 2.0, 550.0)
    return Population(mean, root @ root.T)


def test_drawn_eyes_have_the_mean_and_covariance_of_the_population():
    people = population()
    drawn = np.array([eye.coefficients_um for eye in people.draw(4000, seed=1)])
    # Hotelling's statistic of the mean, and the likelihood-ratio test of the covariance, at 0.1 %.
    n, k = drawn.shape
    inverse = np.linalg.inv(people.covariance_um2)
    off = drawn.mean(axis=0) - people.mean.coefficients_um
    assert stats.chi2.cdf(n * off @ inverse @ off, k) < 0.999
    ratio = np.cov(drawn.T) @ inverse
    likelihood = n * (np.trace(ratio) - np.linalg.slogdet(ratio)[1] - k)
    assert 0.001 < stats.chi2.cdf(likelihood, k * (k + 1) / 2) < 0.999


def test_the_mean_square_of_drawn_eyes_is_that_of_the_distribution():
    # E sum c^2 = |mean|^2 + trace C; its variance 2 tr C^2 + 4 m C m.
    people = population()
    m, c = people.mean.coefficients_um, people.covariance_um2
    squares = [eye.rms_um(0) ** 2 for eye in people.draw(2000, seed=8)]
    sigma = math.sqrt((2.0 * np.trace(c @ c) + 4.0 * m @ c @ m) / 2000.0)
    assert np.mean(squares) == pytest.approx(m @ m + np.trace(c), abs=3.3 * sigma)


def test_a_seed_draws_the_same_eyes_again():
    people = population()
    first, more = people.draw(3, seed=4), people.draw(5, seed=4)
    for one, other in zip(first, more, strict=False):
        # Products of matrices of another size round otherwise.
        assert one.coefficients_um == pytest.approx(other.coefficients_um, abs=1e-14)
    assert not np.array_equal(people.draw(1, seed=5)[0].coefficients_um, first[0].coefficients_um)
    assert people.pupil_diameter_mm == 6.0


def write(people, kind, path, **extra):
    """A population as a file; `extra` are single values."""
    single = {"pupil_diameter_mm": people.pupil_diameter_mm} | extra
    mean, covariance = people.mean.coefficients_um, people.covariance_um2
    if kind == "npz":
        np.savez(path, mean_um=mean, covariance_um2=covariance, **single)
    elif kind == "mat":
        savemat(path, {"sample_mean": mean, "S": covariance, **single})
    else:
        header = "\n".join(f"{name}: {value}" for name, value in single.items())
        np.savetxt(path, np.vstack([mean, covariance]), delimiter=",", header=header, fmt="%.17g")
    return path


@pytest.mark.parametrize("kind", ["npz", "mat", "csv"])
def test_populations_are_read_from_three_kinds_of_files(kind, tmp_path):
    people = population()
    read = ic.eyes.load_population(write(people, kind, tmp_path / f"p.{kind}", wavelength_nm=633.0))
    assert read.mean.coefficients_um == pytest.approx(people.mean.coefficients_um)
    assert read.covariance_um2 == pytest.approx(people.covariance_um2)
    assert read.pupil_diameter_mm == 6.0
    assert read.mean.wavelength_nm == 633.0


def test_another_order_and_normalisation_are_the_same_population(tmp_path):
    # The moved covariance, written out: entry (i, j) of Noll's peak coefficients belongs to the
    # OSA pair (n, m) of each, divided by both norms.
    given = population(terms=10)
    path = write(given, "npz", tmp_path / "p.npz", order="noll", normalisation="peak")
    read = load_population(path)
    pairs = [noll_nm(j + 1) for j in range(10)]
    for i, a in enumerate(pairs):
        at = osa_index(*a)
        expected = given.mean.coefficients_um[i] / norm(*a)
        assert read.mean.coefficients_um[at] == pytest.approx(expected)
        for j, b in enumerate(pairs):
            expected = given.covariance_um2[i, j] / (norm(*a) * norm(*b))
            assert read.covariance_um2[at, osa_index(*b)] == pytest.approx(expected)


def bad(path, **change):
    entries = {"mean_um": np.zeros(6), "covariance_um2": np.eye(6), "pupil_diameter_mm": 6.0}
    np.savez(path, **{k: v for k, v in (entries | change).items() if v is not None})
    return path


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"mean_um": np.zeros(7)}, r"1, 3, 6, 10, 15 \.\.\.\), got 7"),
        ({"covariance_um2": np.eye(10)}, "covariance_um2 must be 6 x 6"),
        ({"covariance_um2": np.triu(np.ones((6, 6)))}, "must be symmetric"),
        ({"covariance_um2": np.diag([1.0, 1, 1, 1, 1, -0.1])}, "smallest eigenvalue is -0.1"),
        ({"covariance_um2": np.full((6, 6), np.nan)}, "finite"),
        ({"order": "fringe"}, "unknown order in file"),
        ({"normalisation": "zemax"}, "unknown normalisation in file"),
        ({"pupil_diameter_mm": None}, "must hold 'pupil_diameter_mm'"),
        ({"covariance_um2": None}, "must hold 'covariance_um2'"),
        ({"pupil_diameter_mm": -1.0}, "pupil_diameter_mm must be > 0"),
        ({"pupil_diameter_mm": np.array([3.0, 4.0])}, "single number"),
    ],
)
def test_bad_populations_are_refused(change, match, tmp_path):
    with pytest.raises(ic.InvalidInputError, match=match):
        load_population(bad(tmp_path / "p.npz", **change))


def test_a_file_without_a_pupil_takes_the_one_that_is_given(tmp_path):
    path = bad(tmp_path / "p.npz", pupil_diameter_mm=None)
    assert load_population(path, pupil_diameter_mm=4.5).mean.radius_mm == 2.25


def test_files_that_cannot_be_read_are_named(tmp_path):
    with pytest.raises(ic.FileError, match="does not exist"):
        load_population(tmp_path / "none.npz")
    for kind in ("npz", "mat", "csv"):
        path = tmp_path / f"broken.{kind}"
        path.write_bytes(b"no numbers here")
        with pytest.raises(ic.FileError, match=f"broken.{kind}"):
            load_population(path)
    sheet = tmp_path / "p.xlsx"
    sheet.write_bytes(b"")
    with pytest.raises(ic.InvalidInputError, match=r"unknown kind of population file '\.xlsx'"):
        load_population(sheet)


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: human_mtf.watson_2013_mtf(5.0, 1.0), "pupil_diameter_mm must lie between 2 and 6"),
        (lambda: human_mtf.watson_2013_mtf(-5.0, 3.0), "frequency_cpd"),
        (lambda: human_mtf.navarro_1993_mtf(5.0, 70.0), "eccentricity_deg must lie"),
        (lambda: human_mtf.gaussian_mtf(5.0, "geisler"), "did you mean geisler_1984"),
        (lambda: pupil_size.moon_spencer(0.0), "luminance_cd_m2"),
        (lambda: pupil_size.watson_yellott(1.0, area_deg2=-1.0), "area_deg2 must be > 0"),
        (lambda: pupil_size.watson_yellott(1.0, area_deg2=1.0, age_years=9.0), "age_years"),
        (lambda: pupil_size.watson_yellott(1.0, area_deg2=1.0, eyes="left"), "unknown eyes"),
        (
            lambda: wavefront_of(ZernikeFit(np.zeros(3), 2.0, 550.0), pupil_diameter_mm=5.0),
            "pupil_diameter_mm must be at most 4 mm",
        ),
        (
            lambda: radial_mtf(
                ZernikeFit(np.zeros(3), 2.0, 550.0), [1.0], wavelengths_nm=[900, 950]
            ),
            "visible light",
        ),
        (lambda: population().draw(0), "count must be"),
    ],
)
def test_values_out_of_range_are_refused(make, match):
    with pytest.raises(ic.InvalidInputError, match=match):
        make()

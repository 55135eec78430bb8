"""Pigments of receptors against the standard's fundamentals and published check numbers."""

import colour
import numpy as np
import pytest

from isetcl.cones.nomogram import govardovskii_absorbance
from isetcl.cones.observer import Observer
from isetcl.errors import InvalidInputError
from isetcl.eye.people.macular_pigment import macular_fraction, standard_lens_density
from isetcl.eye.people.pigments import absorbance
from isetcl.eye.people.stockman_rider import (
    template_lens_density,
    template_macular_density,
)
from isetcl.spectrum import luminous_efficiency

WAVES = np.arange(400.0, 701.0)
PLANCK_TIMES_C = 6.62607015e-34 * 299792458.0


def fundamentals(size, waves=WAVES):
    table = colour.MSDS_CMFS[f"Stockman & Sharpe {size} Degree Cone Fundamentals"]
    values = np.nan_to_num(table.values)
    return np.stack([np.interp(waves, table.wavelengths, values[:, i]) for i in range(3)])


@pytest.mark.parametrize(
    ("size", "densities", "macular_at_460_nm", "limits"),
    [
        (2, (0.5, 0.5, 0.4), 0.350, (3e-4, 3e-4, 2e-5)),
        (10, (0.38, 0.38, 0.30), 0.095, (8e-5, 8e-5, 8e-5)),
    ],
)
def test_the_standard_observers_have_the_published_fundamentals(
    size, densities, macular_at_460_nm, limits
):
    # colour-science has the tables of Stockman & Sharpe 2000; ours come from absorbances. Limits:
    # what an independent evaluation of the same data leaves; S is tabulated to 615 nm.
    waves = np.arange(390.0, 831.0)
    observer = Observer(
        optical_densities=densities, macular_peak_density=macular_at_460_nm * 0.352114 / 0.35
    )
    error = np.abs(observer.fundamentals(waves) - fundamentals(size, waves)).max(axis=1)
    np.testing.assert_array_less(error, limits)
    # A field's size gives the densities by CIE 170-1's formulas, which are close to these.
    error = Observer.of_field(float(size)).fundamentals(waves) - fundamentals(size, waves)
    assert np.abs(error).max() < 1e-3


def test_older_lenses_take_more_from_the_short_waves():
    waves, observer = np.arange(390.0, 701.0, 5.0), Observer()
    # CIE 170-1: the ageing part of the lens, 0.661837 at 400 nm and 0.427672 at 420, grows by
    # 0.02 a year from 32 to 60.
    ratio = observer.fundamentals(waves, 60.0) / observer.fundamentals(waves, 32.0)
    at = {nm: int(np.argmin(np.abs(waves - nm))) for nm in (390, 400, 420, 700)}
    fall = np.log10(ratio[:, at[420]] / ratio[:, at[400]])
    np.testing.assert_allclose(fall, 0.56 * (0.661837 - 0.427672), rtol=1e-4)
    # Below the age table the whole lens grows as at 400 nm.
    fall = np.log10(ratio[:, at[400]] / ratio[:, at[390]])
    np.testing.assert_allclose(fall, 0.56 * 0.661837 * (2.5122 / 1.7649 - 1.0), rtol=1e-3)


@pytest.mark.parametrize("size", [2, 10])
def test_the_templates_come_near_the_fundamentals(size):
    # Stockman & Rider 2023 state their fits; an independent evaluation found up to 0.019.
    observer = Observer.of_field(float(size), model="stockman_rider_2023")
    error = np.abs(observer.fundamentals(WAVES) - fundamentals(size))
    assert error.max() < 0.025


def test_absorbance_and_efficiency_are_those_of_isetbio():
    waves = np.array([450.0, 550.0, 650.0])
    observer = Observer()
    expected = [0.133838173147422, 0.990923208090168, 0.0758280695937327]
    np.testing.assert_allclose(observer.absorbances(waves)[0], expected, rtol=2e-5)
    expected = [0.0952016434207283, 0.453633542263389, 0.0557320888215983]
    np.testing.assert_allclose(observer.quantal_efficiency(waves)[0], expected, rtol=2e-5)
    unit = observer.macular_density(np.array([450.0]))[0] / 0.35
    assert unit == pytest.approx(0.946322067594433, rel=1e-4)
    assert 10 ** (-0.35 * unit) == pytest.approx(0.466430859836272, rel=1e-4)


def test_below_its_table_the_lens_goes_on_as_the_template():
    waves = np.array([365.0, 380.0, 390.0, 500.0, 600.0])
    observer = Observer(model="stockman_rider_2023")
    found = observer.fundamentals(waves)
    template = template_lens_density(waves)
    lens = 2.5122 * template[:3] / template[2]
    bare = observer.quantal_efficiency(waves) * 10.0 ** -observer.macular_density(waves) * waves
    expected = bare[:, :3] / bare[:, 2:3] * 10.0 ** (lens[2] - lens)
    np.testing.assert_allclose(found[:, :3] / found[:, 2:3], expected, rtol=1e-9)
    assert expected[2, 0] < 0.5


# Excitations of L, M and S per um^2 of aperture and s at one photopic lux on the retina, 400 to 700
# nm every nm, as evaluated elsewhere from the same tables: with the macular pigment of the fovea,
# without any, with that at 10 degrees; and photons per m^2 and s in all.
PER_LUX = {
    "equal energy": (
        1.1426e16,
        (2117.9, 1629.6, 458.9),
        (2375.2, 1975.9, 790.2),
        (2363.7, 1960.3, 774.9),
    ),
    "equal energy behind the lens": (
        1.0737e16,
        (2076.3, 1494.6, 178.2),
        (2263.1, 1748.7, 340.4),
        (2254.8, 1737.3, 332.7),
    ),
    "D65 behind the lens": (
        1.0115e16,
        (2064.4, 1556.3, 193.4),
        (2274.0, 1842.8, 373.0),
        (2264.8, 1830.0, 364.5),
    ),
}


@pytest.mark.parametrize("name", list(PER_LUX))
def test_excitations_of_one_lux_are_the_published_ones(name):
    spectrum = np.ones_like(WAVES)
    if name.startswith("D65"):
        table = colour.SDS_ILLUMINANTS["D65"]
        spectrum = np.interp(WAVES, table.wavelengths, table.values)
    if name.endswith("lens"):
        spectrum = spectrum * 10.0 ** -standard_lens_density(WAVES)
    irradiance = spectrum / (683.0 * np.sum(spectrum * luminous_efficiency(WAVES)))
    photons = irradiance * WAVES * 1e-9 / PLANCK_TIMES_C
    total, *expected = PER_LUX[name]
    assert np.sum(photons) == pytest.approx(total, rel=5e-5)
    observer = Observer()
    for fraction, each in zip((1.0, 0.0, macular_fraction(10.0)), expected, strict=True):
        through = 10.0 ** (-fraction * observer.macular_density(WAVES))
        found = 1e-12 * np.sum(observer.quantal_efficiency(WAVES) * through * photons, axis=1)
        np.testing.assert_allclose(found, each, atol=0.051)


# Wavelength, nm; density of the lens; log10 absorbance of L, M, S; excitations per photon at the
# retina (behind macular pigment) and at the cornea, as evaluated elsewhere from the same tables.
TABLE = np.array([
    [390, 2.5122, -0.9338, -1.0479, -0.1338, 0.0754, 0.0589, 0.2955, 0.0002, 0.0002, 0.0009],
    [400, 1.7649, -0.8835, -0.9707, -0.0499, 0.0764, 0.0633, 0.3061, 0.0013, 0.0011, 0.0053],
    [430, 0.4876, -0.9536, -0.8565, -0.0222, 0.0440, 0.0542, 0.2135, 0.0143, 0.0176, 0.0695],
    [460, 0.2279, -0.7801, -0.5543, -0.3146, 0.0520, 0.0822, 0.1077, 0.0308, 0.0486, 0.0637],
    [500, 0.1537, -0.3040, -0.1384, -1.4586, 0.1798, 0.2341, 0.0130, 0.1262, 0.1643, 0.0091],
    [550, 0.0859, -0.0040, -0.0731, -3.5813, 0.4536, 0.4147, 0.0002, 0.3723, 0.3403, 0.0001],
    [600, 0.0297, -0.2378, -0.7868, -5.7038, 0.3241, 0.1143, 1.2e-6, 0.3027, 0.1068, 1.1e-6],
    [650, 0.0032, -1.1202, -2.2222, -7.4819, 0.0557, 0.0046, 2.0e-8, 0.0553, 0.0046, 2.0e-8],
    [700, 0.0000, -2.6209, -3.8852, -9.2349, 0.0018, 0.0001, 3.6e-10, 0.0018, 0.0001, 3.6e-10],
])  # fmt: skip


def test_media_pigments_and_efficiencies_are_the_tabulated_ones():
    waves, observer = TABLE[:, 0], Observer()
    lens = standard_lens_density(waves)
    at_retina = observer.quantal_efficiency(waves) * 10.0 ** -observer.macular_density(waves)
    rows = [lens, *np.log10(observer.absorbances(waves)), *at_retina, *(at_retina * 10.0**-lens)]
    np.testing.assert_allclose(np.stack(rows, axis=1), TABLE[:, 1:], atol=6e-5)


def test_efficiencies_peak_where_published():
    waves, observer = np.arange(390.0, 831.0), Observer()
    at_retina = observer.quantal_efficiency(waves) * 10.0 ** -observer.macular_density(waves)
    at_cornea = at_retina * 10.0 ** -standard_lens_density(waves)
    for rows, peaks in (
        (at_retina, [(555, 0.4550), (539, 0.4434), (399, 0.3062)]),
        (at_cornea, [(566, 0.3834), (541, 0.3534), (442, 0.0843)]),
    ):
        found = [(waves[np.argmax(row)], row.max()) for row in rows]
        np.testing.assert_allclose(found, peaks, atol=5.1e-5)


def test_absorbances_go_on_in_the_infrared():
    # The table's own values; S beyond 615 nm falls by 0.03506 a nm.
    found = np.log10(Observer().absorbances(np.array([760.0, 800.0, 830.0])))
    expected = [[-4.536, -5.683, -6.477], [-5.728, -6.804, -7.543], [-11.339, -12.741, -13.793]]
    np.testing.assert_allclose(found, expected, atol=6e-4)
    # A pigment moved 20 nm to the blue is read 31 nm beyond the table: the slope of its last 30 nm.
    moved = np.log10(absorbance("L", np.array([829.0, 830.0]), shift_nm=-20.0))
    stretch = 551.9 / 531.9
    slope = (-6.477 - np.log10(absorbance("L", np.array([800.0]))[0])) / 30.0
    assert moved[1] - moved[0] == pytest.approx(stretch * slope, rel=2e-3)
    assert moved[1] == pytest.approx(-6.477 + slope * 830.0 * (stretch - 1.0), abs=2e-3)


def test_absorbances_go_on_in_the_ultraviolet():
    # A pigment of S moved 20 nm to the red is read 18 nm before the table, which rises there from
    # -0.1338 at 390 nm to -0.0000 at 420: the slope of those 30 nm.
    moved = np.log10(absorbance("S", np.array([390.0, 391.0]), shift_nm=20.0))
    squeeze = 416.9 / 436.9
    slope = 0.1338 / 30.0
    assert moved[1] - moved[0] == pytest.approx(squeeze * slope, rel=2e-3)
    assert moved[0] == pytest.approx(-0.13385 + slope * 390.0 * (squeeze - 1.0), abs=1e-4)


def test_macular_pigment_falls_as_measured():
    # Putnam & Bland 2014, Fig. 2B: eccentricity, deg, and density.
    measured = np.array([
        [-7.99, 0.021], [-5.97, 0.033], [-4.17, 0.058], [-2.85, 0.105], [-2.01, 0.151],
        [-1.18, 0.244], [-0.63, 0.312], [0.07, 0.342], [0.90, 0.281], [1.53, 0.214],
        [2.15, 0.151], [3.82, 0.077], [6.11, 0.033], [8.13, 0.014],
    ])  # fmt: skip
    fitted = 0.35 * macular_fraction(measured[:, 0])
    assert np.abs(fitted - measured[:, 1]).max() < 0.015
    assert 0.35 * macular_fraction(10.0) == pytest.approx(0.0122, abs=5e-5)


def test_the_templates_deviate_from_the_tables_as_evaluated_elsewhere():
    waves = np.arange(390.0, 831.0)
    for cone, limit in (("L", 0.028), ("M", 0.027), ("S", 0.012)):
        tabulated = absorbance(cone, waves)
        template = absorbance(cone, waves, "stockman_rider_2023")
        assert np.abs(tabulated - template).max() == pytest.approx(limit, abs=1e-3)
        assert template.max() == pytest.approx(1.0, abs=5e-4)
    assert template_lens_density(np.array([400.0]))[0] == pytest.approx(1.7649, abs=1e-6)
    assert template_macular_density(np.array([460.0]))[0] == pytest.approx(0.35, abs=1e-6)


@pytest.mark.parametrize("model", ["cie_170", "stockman_rider_2023"])
def test_a_shifted_pigment_is_the_same_on_a_scale_of_log_wavelength(model):
    waves = np.arange(500.0, 600.0, 0.1)
    for cone in "LM":
        peak = {"L": 551.9, "M": 529.8 if model == "cie_170" else 529.9}[cone]
        base = absorbance(cone, waves, model)
        moved = absorbance(cone, waves * (peak - 5.0) / peak, model, -5.0)
        # The two pigments of L are shifted one by one, by the same nm and not the same ratio.
        np.testing.assert_allclose(moved, base, atol=2e-4 if cone == "L" else 1e-9)


def test_dichromats_and_anomalous_observers_hold_two_like_pigments():
    for kind, pair in (("protan", 1), ("deutan", 0)):
        rows = Observer.dichromat(kind).quantal_efficiency(WAVES)
        np.testing.assert_array_equal(rows[0], rows[1])
        np.testing.assert_array_equal(rows[0], Observer().quantal_efficiency(WAVES)[pair])
        peaks = Observer.anomalous(kind, 4.0).peaks_nm
        assert peaks[0] - peaks[1] == pytest.approx(4.0)


def test_rods_behind_a_lens_are_the_scotopic_observer():
    from isetcl.eye.people.ocular_media import ocular_density

    waves = np.arange(400.0, 701.0, 5.0)
    table = colour.SDS_LEFS["CIE 1951 Scotopic Standard Observer"]
    expected = np.interp(waves, table.wavelengths, table.values)
    lens = 10.0 ** -ocular_density(32, waves, "cie_170")
    found = Observer().rod_efficiency(waves) * waves * lens
    np.testing.assert_allclose(found / found.max(), expected / expected.max(), atol=1e-4)
    assert Observer().rod_efficiency(WAVES).max() == pytest.approx(2 / 3 * (1 - 10**-0.4), rel=1e-9)


def test_the_nomogram_peaks_at_its_wavelength():
    waves = np.arange(380.0, 700.0, 0.1)
    for peak in (420.0, 480.0, 500.0, 560.0):
        curve = govardovskii_absorbance(peak, waves)
        # Govardovskii et al. 2000: the alpha band peaks at its wavelength within half a nm.
        assert waves[np.argmax(curve)] == pytest.approx(peak, abs=0.7)
        assert curve.max() == pytest.approx(1.0, abs=0.01)


def test_the_beta_band_has_its_published_place_height_and_width():
    # Govardovskii et al. 2000, eqs. 4, 5a, 5b at 500 nm: 0.26 at 346.5 nm, 57 nm wide, over the
    # alpha band's 1 / (exp(-14.9 (1.104 - 500 / nm)) + 0.674).
    for nm, beta in ((346.5, 0.26), (403.5, 0.26 / np.e), (289.5, 0.26 / np.e)):
        alpha = 1.0 / (np.exp(-14.9 * (1.104 - 500.0 / nm)) + 0.674)
        found = float(govardovskii_absorbance(500.0, np.array([nm]))[0])
        assert found == pytest.approx(alpha + beta, abs=1e-4)


def test_shorter_outer_segments_absorb_less():
    # A thin layer absorbs in proportion to its length: ln(10) density absorbance.
    thin = Observer().quantal_efficiency(WAVES, 1e-4)
    expected = 2 / 3 * np.log(10) * 1e-4 * np.array([[0.5], [0.5], [0.4]])
    np.testing.assert_allclose(thin, expected * Observer().absorbances(WAVES), rtol=1e-4)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Observer(optical_densities=(0.5, 0.0, 0.4)), "optical density of M"),
        (lambda: Observer(shifts_nm=(0.0, 99.0, 0.0)), "shift of M"),
        (lambda: Observer(pigments=("L", "X", "S")), "pigment of M"),
        (lambda: Observer(macular_peak_density=-0.1), "macular_peak_density"),
        (lambda: Observer(shifts_nm=(0.0, 0.0)), "must name L, M and S"),
        (lambda: Observer(model="leaf"), "pigment model"),
        (lambda: Observer(photon_efficiency=1.5), "photon_efficiency"),
        (lambda: Observer(rod_density=0.0), "rod_density"),
        (lambda: Observer.dichromat("tritan"), "kind of dichromat"),
        (lambda: Observer.anomalous("protan", 40.0), "separation_nm"),
        (lambda: Observer().absorbances(np.array([550.0, 450.0])), "ascending"),
        (lambda: absorbance("K", WAVES), "cone"),
        (lambda: Observer().absorbances(np.array([380.0])), "390 to 830 nm"),
        (lambda: Observer().rod_efficiency(np.array([395.0])), "400 to 780 nm"),
        (lambda: Observer().fundamentals(WAVES, age_years=12.0), "age_years"),
        (lambda: Observer.of_field(20.0), "field_deg"),
        (lambda: Observer.of_field("2"), "field_deg"),
        (lambda: Observer(optical_densities=0.5), "must name L, M and S"),
        (lambda: Observer().quantal_efficiency(WAVES, 0.0), "segment_fraction"),
    ],
)
def test_bad_input_is_refused(make, words):
    with pytest.raises(InvalidInputError, match=words):
        make()

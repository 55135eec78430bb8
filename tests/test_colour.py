"""Spectra from colours, against colour-science's own integration and published numbers."""

import colour
import numpy as np
import pytest

from isetcl.errors import FileError, InvalidInputError
from isetcl.scene.colour import (
    blackbody,
    load_spd,
    radiance_of_rgb,
    reflectance_of_rgb,
    reflectance_primaries,
    spectrum_of_xyz,
)
from isetcl.scene.display import display_primaries

CMFS = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]


def integrated_xyz(spectrum, illuminant=None):
    """Tristimulus values as colour-science integrates them (ASTM E308 / 5 nm sums)."""
    shape = colour.SpectralShape(380, 780, 5)
    sd = colour.SpectralDistribution(spectrum.at(shape.wavelengths), shape.wavelengths)
    if illuminant is None:
        return colour.colorimetry.sd_to_XYZ_integration(sd, CMFS, k=683.0, shape=shape)
    light = colour.SDS_ILLUMINANTS[illuminant].copy().align(shape)
    observer = CMFS.copy().align(shape)
    return colour.colorimetry.sd_to_XYZ_integration(sd, observer, illuminant=light) / 100.0


def srgb_of(xyz):
    """Linear sRGB by the matrix of IEC 61966-2-1."""
    return colour.XYZ_to_RGB(xyz, colour.RGB_COLOURSPACES["sRGB"], None)


RGBS = [(1, 1, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0.5, 0.2, 0.7), (0.02, 0.9, 0.3), (0, 0, 0)]


@pytest.mark.parametrize("rgb", RGBS)
def test_a_reflectance_has_its_rgb_under_d65(rgb):
    reflectance = reflectance_of_rgb(rgb)
    assert reflectance.values.min() >= 0
    assert reflectance.values.max() <= 1.0 + 1e-12
    # Mallett & Yuksel state an exact match; the matrix and white of sRGB are rounded to 4 digits.
    np.testing.assert_allclose(srgb_of(integrated_xyz(reflectance, "D65")), rgb, atol=2e-3)


@pytest.mark.parametrize("rgb", [(1, 1, 1), (3.0, 0, 0), (0, 250.0, 1.0), (0.5, 0.2, 0.7)])
def test_a_radiance_has_its_rgb_and_its_luminance(rgb):
    xyz = integrated_xyz(radiance_of_rgb(rgb, 80.0))
    np.testing.assert_allclose(srgb_of(xyz / 80.0), rgb, atol=2e-3 * max(rgb))
    # Luminance weights of sRGB: IEC 61966-2-1.
    luminance = 80.0 * np.dot([0.2126, 0.7152, 0.0722], rgb)
    assert xyz[1] == pytest.approx(luminance, rel=2e-3)


def test_reflectance_primaries_sum_to_one_over_the_whole_visible_range():
    grid = np.arange(360.0, 831.0)
    np.testing.assert_allclose(sum(s.at(grid) for s in reflectance_primaries()), 1.0, atol=1e-12)


def test_white_radiance_is_d65():
    sd = colour.SDS_ILLUMINANTS["D65"]
    grid = np.arange(380.0, 781.0, 20.0)
    ratio = radiance_of_rgb((1, 1, 1), 50.0).at(grid) / np.array([sd[w] for w in grid])
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-9)


@pytest.mark.parametrize("rgb", [(1.1, 0, 0), (-0.1, 0, 0), (np.nan, 0, 0), (1, 1), "red", None])
def test_impossible_reflectances_are_refused_with_a_remedy(rgb):
    with pytest.raises(InvalidInputError, match="reflectance rgb must be"):
        reflectance_of_rgb(rgb)


@pytest.mark.parametrize("rgb", [(-1e-3, 1, 1), (np.inf, 0, 0), (1, 1, 1, 1), None])
def test_impossible_emissions_are_refused(rgb):
    with pytest.raises(InvalidInputError, match="emission rgb must be"):
        radiance_of_rgb(rgb, 100.0)
    with pytest.raises(InvalidInputError, match="luminance_of_white"):
        radiance_of_rgb((1, 1, 1), 0.0)


@pytest.mark.parametrize("kelvin", [800.0, 2856.0, 6504.0, 25000.0])
def test_black_body_follows_planck(kelvin):
    grid = np.arange(300.0, 1101.0, 50.0)
    # colour-science works per metre, with c2 of ITS-90 (1.4388e-2), 1.6e-5 from CODATA's.
    expected = colour.colorimetry.planck_law(grid * 1e-9, kelvin) * 1e-9
    np.testing.assert_allclose(blackbody(kelvin).at(grid), expected, rtol=2e-3)
    fine = blackbody(kelvin)
    x = 0.01438776877 / (fine.wavelengths_nm * 1e-9 * kelvin)  # c2, CODATA 2018
    c1 = 1.191042972e-16  # first radiation constant for radiance, W m^2 sr^-1, CODATA 2018
    np.testing.assert_allclose(
        fine.values, c1 / (fine.wavelengths_nm * 1e-9) ** 5 / np.expm1(x) * 1e-9, rtol=1e-7
    )


def test_black_body_peaks_where_wien_says():
    fine = blackbody(5000.0)
    peak = fine.wavelengths_nm[np.argmax(fine.values)]
    assert peak == pytest.approx(2.897771955e6 / 5000.0, abs=1.0)  # CODATA 2018


@pytest.mark.parametrize("kelvin", [1e-310, 1e-3, 1.0, 1e6, 1e9])
def test_extreme_temperatures_give_finite_radiance(kelvin):
    assert np.isfinite(blackbody(kelvin).values).all()


@pytest.mark.parametrize("kelvin", [0.0, -1.0, 1e10, np.nan, np.inf, "hot", None])
def test_temperatures_that_are_none_are_refused(kelvin):
    with pytest.raises(InvalidInputError, match="temperature_k"):
        blackbody(kelvin)


# Inside sRGB; a laser-like green and a deep red that no display shows; black.
@pytest.mark.parametrize(
    "xyz",
    [(95.0, 100.0, 108.0), (20.0, 60.0, 5.0), (30.0, 12.0, 0.5), (0, 0, 0), (1e-9, 1e-9, 1e-9)],
)
def test_a_spectrum_of_xyz_has_those_tristimulus_values(xyz):
    spectrum = spectrum_of_xyz(xyz)
    assert spectrum.values.min() >= 0
    np.testing.assert_allclose(integrated_xyz(spectrum), xyz, atol=2e-3 * max(xyz))


def test_a_reflectance_of_xyz_has_those_tristimulus_values_under_d65():
    xyz = (0.3, 0.4, 0.2)
    spectrum = spectrum_of_xyz(xyz, kind="reflectance")
    np.testing.assert_allclose(integrated_xyz(spectrum, "D65"), xyz, atol=1e-3)


@pytest.mark.parametrize(
    ("xyz", "kind"),
    [
        ((1, 0, 0), "radiance"),
        ((0, 1, 0), "radiance"),
        ((-1, 1, 1), "radiance"),
        ((0.2, 0.6, 0.05), "reflectance"),
        ((2.0, 2.0, 2.0), "reflectance"),
        ((0.3, 0.3, 0.3), "transmittance"),
    ],
)
def test_impossible_xyz_is_refused(xyz, kind):
    with pytest.raises(InvalidInputError):
        spectrum_of_xyz(xyz, kind=kind)


def test_spd_files_are_read_with_comments_and_any_separator(tmp_path):
    file = tmp_path / "lamp.spd"
    file.write_text(
        "\ufeff# a lamp\n400 0.5\n\n450.5,1e-3 # blue\n700;2\n 710\t0\n", encoding="utf-8"
    )
    spectrum = load_spd(file)
    np.testing.assert_array_equal(spectrum.wavelengths_nm, [400, 450.5, 700, 710])
    np.testing.assert_array_equal(spectrum.values, [0.5, 1e-3, 2, 0])
    assert spectrum.name == "lamp.spd"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("400 1\n500 x\n", "line 2"),
        ("400 1\n500\n", "line 2"),
        ("400 1 2\n", "line 1"),
        ("# c\n400 1\n400 2\n", "line 3: wavelengths must ascend"),
        ("400 -1\n", "line 1: value"),
        ("400 nan\n", "line 1: value"),
        ("-4 1\n", "line 1: wavelength"),
        ("inf 1\n", "line 1: wavelength"),
        ("", "holds no values"),
        ("# only\n", "holds no values"),
    ],
)
def test_a_wrong_spd_file_is_refused_by_line(tmp_path, text, message):
    file = tmp_path / "bad.spd"
    file.write_text(text)
    with pytest.raises(FileError, match=message):
        load_spd(file)


def test_spd_files_that_are_none_are_refused(tmp_path):
    (tmp_path / "junk.spd").write_bytes(bytes(range(256)))
    for path in (tmp_path / "none.spd", tmp_path, tmp_path / "junk.spd"):
        with pytest.raises(FileError):
            load_spd(path)
    with pytest.raises(InvalidInputError):
        load_spd(3)


def test_display_primaries_and_reflectance_primaries_are_the_same_colours():
    # The display's primaries are the reflectances under D65, by the paper's construction.
    grid = np.arange(380.0, 781.0, 5.0)
    light = sum(s.at(grid) for s in display_primaries(100.0))
    for shown, painted in zip(display_primaries(100.0), reflectance_primaries(), strict=True):
        np.testing.assert_allclose(shown.at(grid), painted.at(grid) * light, rtol=1e-9)

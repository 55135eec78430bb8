"""Chromatic, oblique and spherical aberration and geometric MTF of the model eyes."""

import dataclasses

import numpy as np
import pytest

import isetcl as ic
from isetcl.eye.aberrations import geometric
from isetcl.eye.aberrations.chromatic import lca_dpt, tca_arcmin
from isetcl.eye.aberrations.polychromatic import polychromatic_mtf, polychromatic_otf
from isetcl.eye.aberrations.refraction_error import (
    longitudinal_spherical_aberration_dpt,
    oblique_foci,
)

HEIGHTS = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0]
LCA_NM = [400.0, 430.0, 458.0, 486.0, 543.0, 632.8, 656.0, 700.0, 770.0]


def zemax_eye():
    """The eye of a Zemax trace: retina 16.32 mm behind the lens, 4 mm stop."""
    return dataclasses.replace(ic.eyes.navarro(4.0), retina=ic.Retina.from_radius(23.92, -12.0))


@pytest.mark.parametrize(
    ("name", "wavelength_nm", "expected"),
    [
        ("navarro", 543.0, [0.032, 0.131, 0.303, 0.558, 0.913, 1.391, 2.022, 2.850]),
        ("arizona", 589.3, [0.027, 0.110, 0.261, 0.496, 0.836, 1.308, 1.946, 2.794]),
        ("legrand", 589.3, [0.090, 0.366, 0.839, 1.534, 2.492, 3.779, 5.512, 7.909]),
    ],
)
def test_spherical_aberration_agrees_with_an_independent_tracer(name, wavelength_nm, expected):
    eye = ic.eyes.by_name(name)
    got = longitudinal_spherical_aberration_dpt(eye, HEIGHTS, wavelength_nm)
    np.testing.assert_allclose(got, expected, atol=4e-3)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("navarro", [-2.081, -1.429, -1.001, -0.684, -0.243, 0.174, 0.253, 0.385, 0.560]),
        ("arizona", [-1.636, -1.212, -0.896, -0.638, -0.238, 0.176, 0.255, 0.383, 0.542]),
        ("legrand", [-1.474, -1.117, -0.842, -0.611, -0.236, 0.182, 0.267, 0.409, 0.595]),
    ],
)
def test_longitudinal_chromatic_aberration_agrees_with_an_independent_tracer(name, expected):
    # The table is n'/(L - H') - P: at the principal plane, 1.6 mm behind the cornea.
    eye = ic.eyes.by_name(name)
    got = lca_dpt(eye, LCA_NM, plane="principal")
    np.testing.assert_allclose(got, expected, atol=1e-3)
    # Moving the plane by d changes V to V (1 - V d).
    at_cornea = lca_dpt(eye, LCA_NM)
    np.testing.assert_allclose(at_cornea, got, atol=2.1**2 * 1.7e-3)


@pytest.mark.parametrize(
    ("field", "expected"),
    [(5, 2.387), (8, 3.825), (10, 4.787), (15, 7.213), (20, 9.678), (30, 14.79), (40, 20.25)],
)
def test_transverse_chromatic_aberration_agrees_with_an_independent_tracer(field, expected):
    got = tca_arcmin(ic.eyes.navarro(), field, [430.0, 770.0], 550.0)
    assert got[0, 1] < 0 < got[1, 1]
    assert got[1, 1] - got[0, 1] == pytest.approx(expected, rel=1e-3)
    np.testing.assert_allclose(got[:, 0], 0.0, atol=1e-9)


def test_transverse_chromatic_aberration_at_1_m_and_of_other_eyes():
    def spread(eye, field, ends, distance=np.inf):
        got = tca_arcmin(eye, (field, 0.0), ends, 550.0, distance)[:, 0]
        return got[1] - got[0]

    accommodated = ic.eyes.navarro(accommodation_parameter=0.4)
    assert spread(accommodated, 8.0, [430.0, 770.0], 1.0) == pytest.approx(3.84, abs=0.01)
    assert spread(accommodated, 15.0, [430.0, 770.0], 1.0) == pytest.approx(7.24, abs=0.01)
    assert spread(accommodated, 15.0, [400.0, 700.0], 1.0) == pytest.approx(8.83, abs=0.01)
    assert spread(ic.eyes.navarro(), 15.0, [543.0, 842.0]) == pytest.approx(3.539, abs=0.005)
    arizona = ic.eyes.arizona(interpolation="cauchy")
    assert spread(arizona, 15.0, [430.0, 770.0]) == pytest.approx(6.659, abs=0.005)


FIELDS = np.array([5, 10, 15, 20, 30, 40, 50, 60, 70])
TANGENTIAL = [-0.006, -0.025, -0.064, -0.132, -0.421, -1.092, -2.554, -5.823, -13.85]
SAGITTAL = [0.045, 0.178, 0.401, 0.711, 1.586, 2.783, 4.249, 5.864, 7.368]


def test_line_foci_of_navarro_s_eye_agree_with_an_independent_tracer():
    eye = ic.eyes.navarro()
    axis = oblique_foci(eye, 0.0, 543.0)
    got = oblique_foci(eye, FIELDS, 543.0)
    # The table's eye has its focus on the retina; this one's index formulas are off by 0.002 dpt.
    assert axis.tangential_dpt[0] == pytest.approx(0.002, abs=1e-3)
    # The table's vergences are taken where the chief ray crosses the paraxial entrance pupil's
    # plane, these where it crosses the axis, which moves forward with the field.
    chief = eye.field_map(543.0)
    gap = chief.entrance_z_mm(0.0) - chief.entrance_z_mm(FIELDS.astype(float))
    shift_m = gap / np.cos(np.radians(FIELDS)) / 1000
    for values, expected in (
        (got.tangential_dpt, np.array(TANGENTIAL)),
        (got.sagittal_dpt, np.array(SAGITTAL)),
    ):
        moved = values / (1 - values * shift_m)
        np.testing.assert_allclose(moved, expected + 0.002, atol=2e-3, rtol=2e-3)
        # Without that, only the far field differs.
        np.testing.assert_allclose(values[:6], expected[:6] + 0.002, atol=3e-3)


def test_line_foci_of_other_eyes_agree_with_an_independent_tracer():
    for name, fields, tangential, sagittal in (
        (
            "arizona",
            [10, 20, 30, 40],
            [-0.044, -0.225, -0.755, -1.955],
            [0.103, 0.416, 0.882, 1.427],
        ),
        ("legrand", [10, 30], [-0.308, -3.034], [0.024, 0.188]),
    ):
        got = oblique_foci(ic.eyes.by_name(name), fields, 589.3)
        # Their retinas lie up to 0.01 dpt elsewhere; see the axis.
        np.testing.assert_allclose(got.tangential_dpt, tangential, atol=0.03)
        np.testing.assert_allclose(got.sagittal_dpt, sagittal, atol=0.01)


def test_field_curvature_and_astigmatism_come_from_the_line_foci():
    foci = oblique_foci(ic.eyes.navarro(), [0.0, 20.0])
    assert foci.field_curvature_dpt[0] == 0.0
    assert foci.field_curvature_dpt[1] == pytest.approx((0.711 - 0.132) / 2, abs=0.005)
    assert foci.astigmatism_dpt[1] == pytest.approx(-0.132 - 0.711, abs=0.005)


def test_geometric_mtf_is_zemax_s_by_rays_and_by_the_wavefront():
    # The curve of Zemax; frequencies in cycles/mm on the retina.
    eye = zemax_eye()
    rays = geometric.spot(eye)
    frequency = np.array([10.0, 20.0, 30.0, 50.0, 100.0]) * rays.mm_per_deg[0]
    expected = [0.869452, 0.594879, 0.391965, 0.326540, 0.220863]
    np.testing.assert_allclose(rays.mtf(frequency, 0.0), expected, atol=0.003)
    np.testing.assert_allclose(rays.mtf(frequency, 63.0), rays.mtf(frequency, 0.0), atol=1e-10)
    implied = geometric.spot_of_wavefront(eye.wavefront(samples=128))
    np.testing.assert_allclose(implied.mtf(frequency), expected, atol=0.003)


def test_polychromatic_geometric_mtf_is_zemax_s():
    eye = zemax_eye()
    scale = float(eye.field_map(555.0).mm_per_deg(0.0))
    got = polychromatic_mtf(
        eye,
        np.array([10.0, 20.0, 30.0, 50.0, 100.0]) * scale,
        wavelengths_nm=[470.0, 510.0, 555.0, 610.0, 650.0],
        weights=[0.091, 0.503, 1.0, 0.503, 0.107],
        model="geometric",
    )
    expected = [0.847766, 0.598627, 0.452803, 0.336307, 0.201237]
    np.testing.assert_allclose(got, expected, atol=0.003)


@pytest.mark.slow
def test_polychromatic_mtf_with_diffraction_agrees_with_another_program():
    # 2 mm entrance pupil, equal energy, V(lambda), best focus (flat within 0.03 dpt).
    eye = ic.eyes.navarro(2.0, pupil_plane="entrance")
    got = polychromatic_mtf(eye, [5, 10, 20, 30, 60], wavelengths_nm=np.arange(440.0, 681.0, 30.0))
    np.testing.assert_allclose(got, [0.879, 0.744, 0.512, 0.339, 0.016], atol=4e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pupil_mm", "defocus_dpt", "expected"),
    [
        (3.0, 0.06, [0.881, 0.731, 0.495, 0.349, 0.145]),
        (4.0, 0.12, [0.836, 0.645, 0.399, 0.273, 0.128]),
        (6.0, 0.20, [0.451, 0.325, 0.175, 0.107, 0.056]),
    ],
)
def test_polychromatic_mtf_of_larger_pupils_agrees_too(pupil_mm, defocus_dpt, expected):
    """Its best focus is not given in dioptres, and 0.02 dpt change a row by 0.01."""
    eye = ic.eyes.navarro(pupil_mm, pupil_plane="entrance")
    grid = {"wavelengths_nm": np.arange(420.0, 691.0, 15.0), "defocus_dpt": defocus_dpt}
    got = polychromatic_mtf(eye, [5, 10, 20, 30, 60], **grid)
    np.testing.assert_allclose(got, expected, atol=0.015)


@pytest.mark.slow
def test_off_axis_colours_lie_apart_in_the_polychromatic_transfer():
    # Two narrow lines: modulus falls by cos(pi f TCA) along the field, and not across it.
    eye = ic.eyes.navarro(1.5)
    lines = {"wavelengths_nm": [520.0, 600.0], "weights": [1.0, 1.0], "field_deg": (0.0, 8.0)}
    one = [
        polychromatic_otf(eye, [15.0], **{**lines, "weights": w}, orientation_deg=90.0)[0]
        for w in ([1.0, 0.0], [0.0, 1.0])
    ]
    both = polychromatic_otf(eye, [15.0], **lines, orientation_deg=90.0)[0]
    assert both == pytest.approx((one[0] + one[1]) / 2, abs=1e-12)
    tca = np.diff(tca_arcmin(eye, 8.0, [520.0, 600.0], 555.0)[:, 1])[0]
    angle = np.angle(one[0] / one[1])
    # Up to the phases that coma adds to both alike.
    assert angle == pytest.approx(2 * np.pi * 15.0 * tca / 60, rel=0.15)


def test_spots_are_weighted_by_flux():
    rays = geometric.spot(ic.eyes.navarro(3.0), (5.0, 5.0), rings=12)
    assert rays.weights.sum() == pytest.approx(1.0)
    # Mirror symmetry about the meridian of the field.
    assert rays.centroid_arcmin[0] == pytest.approx(rays.centroid_arcmin[1], abs=1e-9)
    assert rays.rms_arcmin > 0
    finer = geometric.spot(ic.eyes.navarro(3.0), (5.0, 5.0), rings=20)
    assert rays.rms_arcmin == pytest.approx(finer.rms_arcmin, rel=1e-9)


def test_bad_input_is_refused():
    eye = ic.eyes.navarro()
    with pytest.raises(ic.InvalidInputError, match="heights_mm must be > 0"):
        longitudinal_spherical_aberration_dpt(eye, [0.0])
    with pytest.raises(ic.InvalidInputError, match="does not reach"):
        longitudinal_spherical_aberration_dpt(eye, [7.4])
    with pytest.raises(ic.InvalidInputError, match="365 and 1014"):
        lca_dpt(eye, [300.0, 500.0])
    with pytest.raises(ic.InvalidInputError, match="field angle"):
        oblique_foci(eye, 130.0)
    with pytest.raises(ic.InvalidInputError, match="weights"):
        polychromatic_mtf(eye, [5.0], wavelengths_nm=[500.0, 600.0], weights=[1.0])
    with pytest.raises(ic.InvalidInputError, match="unknown model"):
        polychromatic_mtf(eye, [5.0], model="wave")
    with pytest.raises(ic.InvalidInputError, match="neither"):
        polychromatic_mtf(eye, [5.0], model="geometric", defocus_dpt=1.0)

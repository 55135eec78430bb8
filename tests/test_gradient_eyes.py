"""Eyes with gradient-index lenses against their published powers and an independent tracer."""

import math

import numpy as np
import pytest

import isetcl as ic
from isetcl.eye.aberrations.chromatic import lca_dpt
from isetcl.eye.aberrations.refraction_error import longitudinal_spherical_aberration_dpt
from isetcl.eye.models.ageing import LENS_EDGE, lens_core, lens_geometry
from isetcl.eye.paraxial import object_vergence_dpt
from isetcl.eye.sequential import trace

HEIGHTS = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0]
NM = 555.0
AGES = (18.0, 30.0, 45.0, 60.0, 70.0)


def test_liou_and_brennan_s_eye_has_its_published_power_and_length():
    # Liou & Brennan 1997: 60.35 dpt, axial length 23.95 mm, and its focus is there.
    eye = ic.eyes.liou_brennan()
    points = eye.cardinal_points(NM)
    assert points.power_dpt == pytest.approx(60.35, abs=0.01)
    assert eye.axial_length_mm == pytest.approx(23.95, abs=1e-12)
    # The coded dispersion is off by 5e-5 at its own wavelength: 1.5 um of focus.
    assert points.focal_point_back_mm == pytest.approx(23.95, abs=0.002)


@pytest.mark.parametrize(
    ("make", "front", "rear"),
    [
        # n at the front vertex and at the equator, from the papers' polynomials.
        (ic.eyes.liou_brennan, 1.368, 1.407),
        (ic.eyes.atchison, 1.371, 1.418),
    ],
)
def test_the_two_halves_of_a_lens_meet_with_one_index(make, front, rear):
    before, behind = (s.medium_after for s in make().surfaces[2:4])
    thickness = make().surfaces[3].vertex_z_mm - make().surfaces[2].vertex_z_mm
    r = np.array([0.0, 2.0])
    zero = np.zeros(2)
    ends = before.gradient(NM).index(r, zero, zero), before.gradient(NM).index(r, zero, thickness)
    assert ends[0][0] == pytest.approx(front, abs=6e-5)
    assert ends[1][0] == pytest.approx(rear, abs=6e-5)
    np.testing.assert_allclose(behind.gradient(NM).index(r, zero, zero), ends[1], atol=6e-5)


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (ic.eyes.liou_brennan, [0.017, 0.067, 0.149, 0.263, 0.406, 0.575, 0.768, 0.978]),
        (ic.eyes.atchison, [0.022, 0.086, 0.185, 0.305, 0.428, 0.532, 0.583, 0.535]),
    ],
)
def test_spherical_aberration_agrees_with_an_independent_tracer(make, expected):
    got = longitudinal_spherical_aberration_dpt(make(), HEIGHTS, NM)
    np.testing.assert_allclose(got, expected, atol=1e-3)


@pytest.mark.parametrize(
    ("make", "z", "magnification"),
    [(ic.eyes.liou_brennan, 3.098, 1.1332), (ic.eyes.atchison, 3.135, 1.1356)],
)
def test_entrance_pupils_lie_where_another_tracer_puts_them(make, z, magnification):
    pupil = make().entrance_pupil(NM)
    assert pupil.z_mm == pytest.approx(z, abs=1e-3)
    assert pupil.magnification == pytest.approx(magnification, abs=1e-4)


def test_the_coded_dispersion_of_liou_and_brennan_gives_half_the_colour_of_eyes():
    # An independent tracer with the same formula.
    wavelengths = [400.0, 430.0, 458.0, 486.0, 543.0, 632.8, 656.0, 700.0, 770.0]
    expected = [-0.823, -0.653, -0.508, -0.376, -0.147, 0.105, 0.149, 0.206, 0.232]
    got = lca_dpt(ic.eyes.liou_brennan(), wavelengths, plane="principal")
    np.testing.assert_allclose(got, expected, atol=1e-3)


def test_the_pupil_and_fovea_of_liou_and_brennan_can_lie_nasally():
    eye = ic.eyes.liou_brennan(3.0, pupil_plane="entrance", is_decentred=True)
    assert eye.stop.decentre_mm == (-0.5, 0.0)
    assert eye.fovea_deg == (-5.0, 0.0)
    assert eye.entrance_pupil().diameter_mm == pytest.approx(3.0, rel=1e-12)


def at_principal_plane(eye):
    """Refraction at the principal plane, dpt."""
    vergence = object_vergence_dpt(eye, NM)
    gap_m = eye.cardinal_points(NM).principal_point_front_mm / 1000.0
    return -vergence / (1.0 + vergence * gap_m)


@pytest.mark.parametrize(
    ("refraction", "expected"), [(0.0, -0.023), (-2.0, -1.944), (-4.0, -3.779), (-8.0, -7.220)]
)
def test_atchison_s_eyes_have_the_refractions_that_an_independent_tracer_finds(
    refraction, expected
):
    eye = ic.eyes.atchison(3.0, refraction)
    assert at_principal_plane(eye) == pytest.approx(expected, abs=1e-3)


def test_atchison_s_emmetropic_eye_has_the_power_that_an_independent_tracer_finds():
    points = ic.eyes.atchison().cardinal_points(NM)
    assert points.power_dpt == pytest.approx(61.505, abs=1e-3)
    assert points.focal_point_back_mm == pytest.approx(23.572, abs=1e-3)


@pytest.mark.parametrize("refraction", [0.0, -5.0, -10.0])
def test_atchison_s_eye_grows_with_myopia_as_published(refraction):
    # Length 23.58 - 0.299 SR; retina: Rx -12.91 - 0.094 SR, Ry -12.72 + 0.004 SR, Qx 0.27 + 0.026
    # SR, Qy 0.25 + 0.017 SR in the paper, of which the semi-axes used are a rounded form.
    eye = ic.eyes.atchison(3.0, refraction)
    assert eye.axial_length_mm == pytest.approx(23.58 - 0.299 * refraction)
    assert eye.surfaces[0].radius_mm == pytest.approx(7.77 + 0.022 * refraction)
    retina = eye.retina
    assert 1.0 / retina.shape.curvature_x == pytest.approx(-12.91 - 0.094 * refraction, abs=0.1)
    assert retina.radius_mm == pytest.approx(-12.72 + 0.004 * refraction, abs=0.12)
    assert retina.shape.conic_x == pytest.approx(0.27 + 0.026 * refraction, abs=0.04)
    assert retina.conic == pytest.approx(0.25 + 0.017 * refraction, abs=0.04)


def test_atchison_s_retina_can_be_made_round():
    eye = ic.eyes.atchison(is_retina_round=True)
    assert eye.is_rotational
    assert not ic.eyes.atchison().is_rotational
    assert eye.retina.sag_mm(8.0) == pytest.approx(
        -10.148 + 10.148 * math.sqrt(1.0 - (8.0 / 11.41) ** 2)
    )


def test_an_abbe_number_leaves_atchison_s_indices_at_555_nm():
    plain, chromatic = ic.eyes.atchison(), ic.eyes.atchison(abbe_number=50.0)
    np.testing.assert_allclose(chromatic.indices(NM), plain.indices(NM), rtol=1e-14)
    assert np.diff(lca_dpt(chromatic, [400.0, 700.0]))[0] > 1.5


@pytest.mark.parametrize("age", AGES)
def test_the_ageing_eye_is_emmetropic_at_every_age_and_its_parameter_brings_the_focus_near(age):
    focus = [
        object_vergence_dpt(ic.eyes.ageing(age_years=age, accommodation_parameter=d), 550.0)
        for d in (0.0, 1.0, 4.0, 10.0)
    ]
    assert focus[0] == pytest.approx(0.0, abs=1e-9)
    assert np.all(np.diff(focus) > 0)
    assert 0.55 < focus[1] < 0.75


def test_the_lens_of_the_ageing_eye_is_navarro_s():
    # Navarro 2014 at 40 years and D = 5: thickness 3.874 + 0.038 D, radii 1 / (1/10.38 + 0.0077 D)
    # and 1 / (1/5.38 + 0.0043 D).
    eye = ic.eyes.ageing(age_years=40.0, accommodation_parameter=5.0)
    front, middle, back = eye.surfaces[2:]
    assert back.vertex_z_mm - front.vertex_z_mm == pytest.approx(3.874 + 0.19)
    assert (middle.vertex_z_mm - front.vertex_z_mm) / (3.874 + 0.19) == pytest.approx(0.4)
    assert front.curvature == pytest.approx(1.0 / 10.38 + 0.0385)
    assert back.curvature == pytest.approx(-(1.0 / 5.38 + 0.0215))
    assert (front.conic, back.conic) == (-6.5, -3.0)


@pytest.mark.parametrize("d", [0.0, 7.0])
def test_the_index_of_the_ageing_lens_rises_from_its_edge_to_its_core(d):
    eye = ic.eyes.ageing(age_years=50.0, accommodation_parameter=d)
    before, behind = (s.medium_after.gradient(NM) for s in eye.surfaces[2:4])
    thickness = lens_geometry(50.0, d)[0]
    zero = np.zeros(1)
    core = float(lens_core(50.0).evaluate(np.array(NM)))
    edge = float(LENS_EDGE.evaluate(np.array(NM)))
    assert before.index(zero, zero, zero)[0] == pytest.approx(edge)
    assert before.index(zero, zero, 0.4 * thickness)[0] == pytest.approx(core)
    assert behind.index(zero, zero, zero)[0] == pytest.approx(core)
    assert behind.index(zero, zero, 0.6 * thickness)[0] == pytest.approx(edge)
    # p = 1: the index falls with the square of the way to the edge.
    assert before.index(zero, zero, 0.2 * thickness)[0] == pytest.approx(
        core - (core - edge) * 0.25
    )


def test_the_ageing_eye_accommodates_to_an_object():
    eye = ic.eyes.ageing(3.0, 3.0, age_years=25.0, focus_criterion="paraxial")
    assert eye.focus_vergence_dpt(criterion="paraxial") == pytest.approx(3.0, abs=1e-9)
    assert eye.accommodation_model.age_years == 25.0


def test_two_keratometer_readings_make_an_astigmatic_cornea():
    eye = ic.eyes.ageing(keratometry_dpt=(43.399, 44.337))
    front = eye.surfaces[0]
    # The front is the ellipsoid of semi-axes sqrt(R a) and a = 14.26 mm.
    for x, y, power in ((3.0, 0.0, 43.399), (0.0, 3.0, 44.337)):
        across = math.sqrt(337.5 / power * 14.26)
        sag = 14.26 * (1.0 - math.sqrt(1.0 - (3.0 / across) ** 2))
        assert front.sag_mm(x, y) == pytest.approx(sag, rel=1e-12)
    assert ic.eyes.ageing().is_rotational
    assert not eye.is_rotational


@pytest.mark.parametrize("name", ["liou_brennan", "atchison", "ageing"])
def test_chief_rays_of_wide_fields_pass_and_eyes_come_back_from_json(name):
    eye = ic.eyes.by_name(name, 2.0)
    pupil = eye.entrance_pupil()
    angle = np.radians([0.0, 20.0, 40.0])
    directions = np.stack([0.0 * angle, np.sin(angle), np.cos(angle)], axis=1)
    origins = np.array([0.0, 0.0, pupil.z_mm]) - 20.0 * directions
    assert trace(eye, origins, directions, NM).passed.all()
    assert ic.Eye.from_json(eye.to_json()) == eye


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: ic.eyes.atchison(3.0, -11.0), "spectacle_refraction_dpt must lie between -10 and"),
        (lambda: ic.eyes.atchison(3.0, 1.0), "between -10 and 0 dpt"),
        (lambda: ic.eyes.ageing(age_years=5.0), "age_years must lie between 18 and 70 years"),
        (lambda: ic.eyes.ageing(keratometry_dpt=(43.0, 400.0)), "between 30 and 60 dpt, got 400"),
        (lambda: ic.eyes.ageing(accommodation_parameter=11.0), "D must lie between 0 and 10"),
        (lambda: ic.eyes.liou_brennan().power_dpt(900.0), "between 380 and 780 nm"),
    ],
)
def test_bad_requests_are_refused_with_the_rule(make, match):
    with pytest.raises(ic.InvalidInputError, match=match):
        make()

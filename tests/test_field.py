"""The chief-ray map against published values and its own definition."""

import numpy as np
import pytest
from oracles import reduced_eye

import isetcl as ic
from isetcl.eye.field import direction_from_field
from isetcl.eye.sequential import trace


def test_retinal_heights_of_navarro_s_eye_agree_with_an_independent_tracer():
    # Object at infinity, 543 nm, retina -12 mm.
    field = [5, 10, 15, 20, 30, 40, 50, 60, 70]
    height = [1.43322, 2.84328, 4.20768, 5.50513, 7.82382, 9.67506, 10.98599, 11.74376, 11.99841]
    got = ic.eyes.navarro().field_map(543.0).height_mm(np.array(field))
    np.testing.assert_allclose(got, height, atol=1e-4)


@pytest.mark.parametrize(
    ("name", "scale"), [("navarro", 0.28742), ("arizona", 0.28794), ("legrand", 0.29118)]
)
def test_the_scale_on_axis_is_that_of_an_independent_tracer(name, scale):
    # The tracer's wavelengths are not stated for all three; dispersion changes the scale by 0.1 %.
    assert ic.eyes.by_name(name).field_map(550.0).mm_per_deg(0.0) == pytest.approx(
        scale, rel=1.5e-3
    )


def test_mm_per_degree_is_not_a_constant():
    field_map = ic.eyes.navarro().field_map(550.0)
    assert field_map.mm_per_deg(60.0) < 0.93 * field_map.mm_per_deg(0.0)


def test_the_map_and_its_inverse_agree_to_a_picometre():
    field_map = ic.eyes.arizona().field_map(500.0)
    field = np.linspace(0.0, 100.0, 57)
    back = field_map.field_deg(field_map.arc_mm(field))
    np.testing.assert_allclose(back, field, atol=1e-8)


@pytest.mark.parametrize("field", [3.0, 25.0, 70.0, 95.0])
def test_a_ray_along_the_mapped_direction_passes_the_middle_of_the_stop(field):
    # The independent route: launch from outside towards the produced chief ray, hit the same point.
    eye = ic.eyes.navarro(2.0)
    field_map = eye.field_map(550.0)
    away = direction_from_field(np.array(field / np.sqrt(2)), np.array(field / np.sqrt(2)))
    axis = np.array([0.0, 0.0, float(field_map.entrance_z_mm(field))])
    rays = trace(eye, axis + 30.0 * away, -away, 550.0, record_hits=True)
    assert rays.passed.all()
    assert np.linalg.norm(rays.hits_mm[2, 0, :2]) < 1e-6
    expected = field_map.retinal_point_mm(field / np.sqrt(2), field / np.sqrt(2))
    np.testing.assert_allclose(rays.positions_mm[0], expected, atol=1e-6)


def test_up_in_the_scene_is_down_on_the_retina():
    point = ic.eyes.navarro().field_map(550.0).retinal_point_mm(np.array(2.0), np.array(10.0))
    assert point[0] < 0
    assert point[1] < 0


def test_the_eyes_see_as_far_out_as_people_do():
    # The human temporal field ends near 105 deg.
    assert 100.0 < ic.eyes.navarro().field_map(550.0).max_field_deg < 110.0


def test_the_paraxial_entrance_pupil_is_the_limit_of_the_chief_rays():
    eye = ic.eyes.legrand()
    assert eye.field_map(550.0).entrance_z_mm(0.0) == pytest.approx(
        eye.entrance_pupil(550.0).z_mm, abs=1e-6
    )


def test_a_direction_outside_the_field_is_an_error_that_names_the_limit():
    with pytest.raises(ic.InvalidInputError, match="at most"):
        ic.eyes.navarro().field_map(550.0).height_mm(120.0)


def test_a_stop_at_the_surface_of_a_reduced_eye_refracts_the_chief_ray_once():
    # sin(theta) = n sin(theta'), and the ray meets the retinal sphere centred on the surface.
    eye = reduced_eye()
    field = np.radians(20.0)
    inside = np.arcsin(np.sin(field) * 0.75)
    # Sphere of radius 22 about the vertex: the point at angle theta' lies 22 mm away.
    got = eye.field_map(550.0).height_mm(20.0)
    assert got == pytest.approx(22.0 * np.sin(inside), abs=1e-6)


def test_transverse_chromatic_aberration_agrees_with_an_independent_tracer():
    # Navarro, infinity, 430 to 770 nm: 2.387 arcmin at 5 deg, 7.213 at 15, 20.25 at 40.
    eye = ic.eyes.navarro()
    blue, red = eye.field_map(430.0), eye.field_map(770.0)
    for field, expected in ((5.0, 2.387), (15.0, 7.213), (40.0, 20.25)):
        # Where on the retina each colour of one direction lands, in arcmin of the middle's scale.
        shift_mm = blue.arc_mm(field) - red.arc_mm(field)
        arcmin = 60.0 * shift_mm / float(eye.field_map(550.0).mm_per_deg(field))
        assert abs(arcmin) == pytest.approx(expected, rel=0.02)


def test_arcs_beyond_the_last_chief_ray_are_refused():
    with pytest.raises(ic.InvalidInputError, match="arc_mm must lie within"):
        ic.eyes.navarro().field_map(550.0).field_deg(25.0)

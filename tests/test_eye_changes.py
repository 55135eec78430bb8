"""Eyes with another length, chamber, cornea, refraction or pupil."""

import dataclasses

import numpy as np
import pytest

import isetcl as ic
from isetcl.eye.aberrations.chromatic import tca_arcmin
from isetcl.eye.paraxial import object_vergence_dpt


@pytest.mark.parametrize("name", ic.eyes.names())
@pytest.mark.parametrize("refraction", [-10.0, -4.0, 0.0, 3.0])
def test_the_far_point_of_a_changed_eye_is_the_focus_of_its_spectacle_lens(name, refraction):
    eye = ic.eyes.by_name(name).with_spectacle_refraction(refraction)
    got = object_vergence_dpt(eye, 550.0)
    # A thin lens of power F forms the image of infinity 1/F behind itself, 12 mm nearer the cornea.
    far_point_m = np.inf if refraction == 0 else -1.0 / refraction + 0.012
    assert got == pytest.approx(1.0 / far_point_m, abs=1e-9)


def test_a_refraction_is_that_of_the_relaxed_eye_whatever_its_accommodation():
    relaxed = ic.eyes.navarro(3.0).with_spectacle_refraction(-3.0)
    near = ic.eyes.navarro(3.0, 5.0).with_spectacle_refraction(-3.0)
    parameter = near.accommodation_parameter
    assert parameter == ic.eyes.navarro(3.0, 5.0).accommodation_parameter
    assert near == relaxed.accommodation_model.eye(parameter)
    assert near.accommodation_model.eye(0.0) == relaxed


def test_a_changed_eye_still_accommodates_and_its_whole_family_is_changed_alike():
    eye = ic.eyes.navarro(3.0).with_axial_length(25.0).with_cornea(front_radius_mm=7.6)
    near = eye.focus_at(0.2)
    assert near.focus_vergence_dpt() == pytest.approx(5.0, abs=1e-6)
    plain = ic.eyes.navarro(3.0, accommodation_parameter=near.accommodation_parameter)
    assert near.surfaces[0].radius_mm == pytest.approx(7.6)
    assert near.surfaces[1:] == plain.surfaces[1:]
    assert near.axial_length_mm - plain.axial_length_mm == pytest.approx(25.0 - 23.9203)
    assert near.accommodation_model == eye.accommodation_model
    # Changed again from there, both changes stay.
    wide = near.with_pupil(4.0).focus_at(0.15)
    assert (wide.stop.diameter_mm, wide.surfaces[0].radius_mm) == pytest.approx((4.0, 7.6))


def test_a_change_to_what_is_there_already_is_none():
    eye = ic.eyes.arizona(3.0, accommodation_parameter=2.0)
    same = eye.with_axial_length(eye.axial_length_mm).with_cornea(front_radius_mm=7.8)
    same = same.with_anterior_chamber_depth(3.52 - 0.08)
    unbound = {"accommodation_model": None}
    for got, expected in zip(
        dataclasses.replace(same, **unbound).surfaces, eye.surfaces, strict=True
    ):
        assert got.vertex_z_mm == pytest.approx(expected.vertex_z_mm, abs=1e-12)
        assert got.curvature == expected.curvature
    assert same.retina == eye.retina


def test_the_chamber_is_measured_from_either_side_of_the_cornea_and_the_stop_goes_with_the_lens():
    eye = ic.eyes.navarro(3.0)
    outer = eye.with_anterior_chamber_depth(3.2)
    inner = eye.with_anterior_chamber_depth(3.2 - 0.55, measured_from="endothelium")
    for changed in (outer, inner):
        z = [s.vertex_z_mm for s in changed.surfaces]
        assert z == pytest.approx([0.0, 0.55, 3.2, 7.2], abs=1e-12)
        assert changed.stop.z_mm == pytest.approx(3.2, abs=1e-12)
        assert changed.axial_length_mm == pytest.approx(23.9203)
    moved = eye.with_anterior_chamber_depth(3.2, hold="vitreous_depth")
    assert moved.axial_length_mm == pytest.approx(23.9203 - 0.4)


@pytest.mark.parametrize(
    ("depth_mm", "span_nm", "expected"),
    [
        (3.29, [430.0, 770.0], (3.68, 6.94)),
        (2.57, [430.0, 770.0], (4.15, 7.83)),
        (3.29, [400.0, 700.0], (4.50, 8.48)),
        (2.57, [400.0, 700.0], (5.05, 9.53)),
        (2.02, [400.0, 700.0], (5.45, 10.30)),
    ],
)
def test_a_shallow_chamber_raises_transverse_colour_as_an_independent_tracer_finds(
    depth_mm, span_nm, expected
):
    # A = 0.4, grid at 1 m, at 8 and 15 deg; that tracer held the vitreous. Arcmin.
    shallow = ic.eyes.navarro().with_anterior_chamber_depth(
        depth_mm, measured_from="endothelium", hold="vitreous_depth"
    )
    eye = shallow.accommodation_model.eye(0.4)
    for field, arcmin in zip((8.0, 15.0), expected, strict=True):
        ends = tca_arcmin(eye, field, span_nm, 550.0, 1.0)
        assert ends[1, 1] - ends[0, 1] == pytest.approx(arcmin, abs=0.01)


def test_a_lens_close_to_the_cornea_is_cut_at_its_rim_and_still_accommodates():
    eye = ic.eyes.navarro(2.0).with_anterior_chamber_depth(1.9)
    assert 4.0 < eye.surfaces[2].semi_diameter_mm < 5.2
    # The relaxed eye of a lens moved forwards is myopic, and near objects can be focused.
    assert object_vergence_dpt(eye, 550.0) > 1.0
    near = eye.focus_at(0.2, criterion="paraxial")
    assert object_vergence_dpt(near, 550.0) == pytest.approx(5.0, abs=1e-7)


def test_an_entrance_pupil_set_last_has_its_diameter_behind_a_new_cornea():
    eye = ic.eyes.navarro(3.0, pupil_plane="entrance").with_cornea(front_radius_mm=7.0)
    assert eye.entrance_pupil().diameter_mm > 3.01
    eye = eye.with_pupil(3.0, "entrance")
    assert eye.entrance_pupil().diameter_mm == pytest.approx(3.0, rel=1e-12)


def test_a_new_pupil_keeps_the_place_and_proportions_of_the_old_one():
    oval = ic.Stop(3.6, 4.0, (0.3, -0.1), 3.0, 20.0)
    eye = dataclasses.replace(ic.eyes.legrand(), stop=oval).with_pupil(2.0)
    assert eye.stop == ic.Stop(3.6, 2.0, (0.3, -0.1), 1.5, 20.0)


def test_a_steep_cornea_ends_earlier_and_gets_a_smaller_semi_diameter():
    eye = ic.eyes.gullstrand_emsley().with_cornea(front_radius_mm=6.0)
    assert eye.surfaces[0].semi_diameter_mm == pytest.approx(0.99 * 6.0)


NAVARRO = ic.eyes.navarro(3.0)


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: NAVARRO.with_axial_length(7.0), "retina must lie behind"),
        (lambda: NAVARRO.with_axial_length(-1.0), "axial_length_mm must be > 0"),
        (lambda: NAVARRO.with_anterior_chamber_depth(0.3), "must lie behind 'cornea back'"),
        (lambda: NAVARRO.with_anterior_chamber_depth(21.0), "retina must lie behind"),
        (lambda: NAVARRO.with_anterior_chamber_depth(3.0, hold="lens"), "unknown hold"),
        (
            lambda: NAVARRO.with_anterior_chamber_depth(3.0, measured_from="lid"),
            "unknown measured_from",
        ),
        (
            lambda: ic.eyes.bennett_rabbetts().with_anterior_chamber_depth(
                3.0, measured_from="endothelium"
            ),
            "cornea of one surface, so measured_from must be 'epithelium'",
        ),
        (
            lambda: ic.eyes.thibos().with_anterior_chamber_depth(3.0),
            "no surface behind its stop",
        ),
        (lambda: NAVARRO.with_cornea(front_radius_mm=0.0), "front_radius_mm must be a non-zero"),
        (lambda: NAVARRO.with_cornea(front_conic=float("nan")), "front_conic must be finite"),
        (lambda: NAVARRO.with_cornea(front_radius_mm=5.5), "they cross"),
        (
            lambda: ic.eyes.drasdo_fowler().with_cornea(back_radius_mm=6.5),
            "one surface, so back_radius_mm",
        ),
        (lambda: NAVARRO.with_spectacle_refraction(90.0), "cannot have refraction_dpt 90"),
        (lambda: NAVARRO.with_spectacle_refraction(60.0), "its image would not lie behind"),
        (
            lambda: NAVARRO.with_spectacle_refraction(-2.0, vertex_distance_mm=-1.0),
            "vertex_distance_mm must be >= 0 mm",
        ),
        (
            lambda: NAVARRO.with_spectacle_refraction(-2.0, wavelength_nm=200.0),
            "between 365 and 1014 nm",
        ),
        (lambda: NAVARRO.with_pupil(0.0), "pupil_diameter_mm must be > 0"),
    ],
)
def test_impossible_changes_are_refused_with_the_rule(make, match):
    with pytest.raises(ic.InvalidInputError, match=match):
        make()


def test_a_cornea_that_is_no_conic_has_no_one_radius():
    eye = ic.eyes.legrand()
    front = dataclasses.replace(eye.surfaces[0], shape=ic.Biconic(1 / 7.6))
    bent = dataclasses.replace(eye, surfaces=(front, *eye.surfaces[1:]))
    with pytest.raises(ic.InvalidInputError, match="'cornea front' is no conic of revolution"):
        bent.with_cornea(front_radius_mm=7.0)

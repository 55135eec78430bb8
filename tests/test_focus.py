"""The focus solver against Zemax and against definitions."""

import math

import numpy as np
import pytest
from oracles import peers_eye, reduced_eye
from slow_cases import slow_after

import isetcl as ic
from isetcl.eye.focus import focus_vergence_dpt, rms_spot_mm

# ISET3d, convertToNavarroAccomm.m: best-focus object distance in mm of Navarro's eye, Zemax, 4 mm,
# 550 nm. The entries at A = 4, 7 and 8 are off its own curve and left out (eyes.md, 1.1).
ZEMAX_MM = {
    0: 2275.4,
    0.4: 1013.579,
    1: 603.02,
    2: 385.92,
    3: 292.238,
    5: 200.036,
    6: 172.586,
    9: 119.859,
    10: 108.021,
}


@pytest.mark.parametrize(("parameter", "distance_mm"), ZEMAX_MM.items())
def test_best_focus_of_navarro_s_eye_agrees_with_zemax(parameter, distance_mm):
    eye = ic.eyes.navarro(4.0, accommodation_parameter=parameter)
    assert eye.focus_vergence_dpt(550.0) == pytest.approx(1000.0 / distance_mm, abs=0.02)


@pytest.mark.parametrize(
    ("build", "pupil", "vergence"),
    [
        (lambda p: ic.eyes.navarro(p), 2.0, 0.068),
        (lambda p: ic.eyes.navarro(p), 3.0, 0.217),
        (lambda p: ic.eyes.arizona(p, interpolation="linear"), 3.0, 0.432),
        (lambda p: ic.eyes.arizona(p, interpolation="linear"), 4.0, 0.629),
        (lambda p: ic.eyes.legrand(p), 4.0, 1.515),
    ],
)
def test_best_focus_depends_on_the_stop_as_an_independent_tracer_found(build, pupil, vergence):
    assert build(pupil).focus_vergence_dpt(550.0) == pytest.approx(vergence, abs=0.01)


@pytest.mark.parametrize("criterion", ["rms_spot", "paraxial"])
@pytest.mark.parametrize("builder", [ic.eyes.navarro, ic.eyes.arizona])
@pytest.mark.parametrize("vergence", slow_after(2, [2.0, 8.0, 0.9, 5.0]))
def test_an_accommodated_eye_is_in_focus_where_it_was_asked_to(builder, criterion, vergence):
    eye = builder(3.0, vergence, focus_criterion=criterion)
    assert focus_vergence_dpt(eye, 550.0, criterion) == pytest.approx(vergence, abs=1e-6)


def test_the_spot_is_smallest_at_the_vergence_of_best_focus():
    eye = ic.eyes.navarro(5.0, 2.0)
    around = [rms_spot_mm(eye, 2.0 + d, 550.0) for d in (-0.02, 0.0, 0.02)]
    assert around[1] < around[0]
    assert around[1] < around[2]


def test_rms_spot_of_a_uniform_collimated_beam_is_the_published_integral():
    # 40-digit integral for the peers' eye; the beam fills the stop of radius 2 mm.
    assert rms_spot_mm(peers_eye(4.0), 0.0, 550.0) == pytest.approx(0.0076965677733493855, rel=1e-9)


def test_a_descartes_surface_is_focused_at_infinity_without_blur():
    eye = reduced_eye(6.0)
    assert eye.focus_vergence_dpt(550.0) == pytest.approx(0.0, abs=1e-6)
    assert rms_spot_mm(eye, 0.0, 550.0) < 1e-9


def test_focus_at_infinity_is_refused_with_the_far_point_and_a_remedy():
    with pytest.raises(ic.FocusError, match=r"0\.430 dpt.*asked for infinity.*relaxed eye"):
        ic.eyes.navarro(4.0, 0.0)


def test_an_object_nearer_than_the_near_point_is_refused():
    with pytest.raises(ic.FocusError, match="move the object farther away"):
        ic.eyes.arizona(4.0, 30.0)


def test_an_eye_without_accommodation_says_where_it_is_focused():
    with pytest.raises(ic.FocusError, match=r"cannot accommodate.*focused at"):
        ic.eyes.legrand(4.0).focus_at(0.5)


def test_a_stop_that_rays_cannot_fill_is_a_clear_error():
    with pytest.raises(ic.FocusError, match="stop"):
        ic.eyes.navarro(11.0).focus_vergence_dpt()


def test_giving_both_accommodations_is_refused():
    with pytest.raises(ic.InvalidInputError, match="not both"):
        ic.eyes.navarro(4.0, 2.0, accommodation_parameter=1.0)


def test_holding_the_axial_length_keeps_it_and_holding_the_vitreous_does_not():
    grown = ic.eyes.navarro(4.0, accommodation_parameter=5.0)
    kept = ic.eyes.navarro(4.0, accommodation_parameter=5.0, hold="axial_length")
    assert kept.axial_length_mm == 23.9203
    assert grown.axial_length_mm == pytest.approx(23.9203 + 0.05 * np.log(6.0), abs=1e-12)


def test_the_spot_weighs_rays_by_solid_angle():
    from isetcl.eye.focus import rms_spot_mm
    from isetcl.eye.sequential import trace

    eye = ic.eyes.navarro(5.0)
    # isotropic point 10 mm in front of the cornea: equal steps of cos(theta) are equal solid angles
    cosine = np.linspace(math.cos(math.radians(16.0)), 1.0, 40001)[:-1]
    d = np.stack([0 * cosine, np.sqrt(1 - cosine**2), cosine], axis=1)
    rays = trace(eye, np.broadcast_to([0.0, 0.0, -10.0], d.shape), d, 550.0)
    assert rays.status.max() == ic.RayStatus.STOPPED
    assert rays.passed.sum() > 10000
    expected = math.sqrt(np.mean(rays.positions_mm[rays.passed, 1] ** 2))
    assert rms_spot_mm(eye, 100.0, 550.0) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(("stop_mm", "accommodation_dpt"), [(7.0, 2.5), (8.0, 5.0)])
def test_a_wide_stop_that_no_longer_fits_the_accommodated_lens_still_focuses(
    stop_mm, accommodation_dpt
):
    eye = ic.eyes.arizona(stop_mm, accommodation_dpt)
    assert eye.focus_vergence_dpt() == pytest.approx(accommodation_dpt, abs=1e-6)

"""Lenses worn in front of an eye and in it, an artificial pupil, gaze and fovea."""

import dataclasses
import math

import numpy as np
import pytest

import isetcl as ic
from isetcl import ArtificialPupil, ContactLens, IntraocularLens, SpectacleLens
from isetcl.errors import InvalidInputError
from isetcl.eye.sequential import trace
from isetcl.eye.worn.surfaces import POWER_WAVELENGTH_NM

UNIT = ic.Spectrum.constant(1.0)


def far_point_eye(vergence_dpt):
    """An eye whose paraxial far point has a vergence at the cornea, at the power wavelength."""
    eye = ic.eyes.navarro(3.0)
    cardinal = eye.cardinal_points(POWER_WAVELENGTH_NM)
    # Newton: x x' = f f', measured from the focal points; the object lies 1/V in front of z = 0.
    z = -1000.0 / vergence_dpt - cardinal.focal_point_front_mm
    product = cardinal.focal_length_front_mm * cardinal.focal_length_back_mm
    retina_z = cardinal.focal_point_back_mm + product / z
    retina = dataclasses.replace(eye.retina, vertex_z_mm=retina_z)
    return dataclasses.replace(eye, retina=retina, accommodation_model=None)


@pytest.mark.parametrize("power", [-8.0, -2.5, 1.5, 6.0])
@pytest.mark.parametrize("shape", [{}, {"front_power_dpt": 4.0, "centre_thickness_mm": 5.0}])
def test_a_spectacle_lens_of_the_refraction_brings_infinity_into_focus(power, shape):
    """Back vertex power: the far point of the eye is the focus of the lens behind it."""
    far = power / (1.0 - 0.014 * power)
    eye = far_point_eye(-far)
    lens = SpectacleLens(power, vertex_distance_mm=14.0, **shape)
    corrected = lens.apply(eye)
    assert eye.focus_vergence_dpt(POWER_WAVELENGTH_NM, "paraxial") == pytest.approx(-far, abs=1e-9)
    left = corrected.focus_vergence_dpt(POWER_WAVELENGTH_NM, "paraxial")
    assert left == pytest.approx(0.0, abs=1e-9)


def test_the_bend_and_thickness_of_spectacles_magnify():
    """Shape factor 1 / (1 - (t / n) F1), and power factor 1 / (1 - d Fv) with d to the pupil."""
    eye = far_point_eye(-4.0 / (1.0 - 0.012 * 4.0))
    lens = SpectacleLens(4.0, front_power_dpt=9.0, centre_thickness_mm=4.0)
    corrected = lens.apply(eye)
    pupil_m = (12.0 + eye.entrance_pupil(POWER_WAVELENGTH_NM).z_mm) / 1000.0
    n = float(lens.medium.index(POWER_WAVELENGTH_NM))
    expected = 1.0 / ((1.0 - 0.004 / n * 9.0) * (1.0 - pupil_m * 4.0))
    step = 1e-4
    heights = []
    for model in (corrected, eye):
        pupil = model.entrance_pupil(POWER_WAVELENGTH_NM).z_mm
        start = np.array([[0.0, -step * (pupil + 30.0), -30.0]])
        rays = trace(model, start, np.array([[0.0, step, 1.0]]), POWER_WAVELENGTH_NM)
        heights.append(rays.positions_mm[0, 1])
    # The chief ray of the corrected eye enters its pupil steeper by the magnification.
    assert heights[0] / heights[1] == pytest.approx(expected, rel=1e-6)


def test_a_cylinder_lies_along_its_axis_as_the_examiner_sees_it():
    """-2 dpt x 30: rays in the section along the axis pass unbent, those across it diverge.

    The examiner's 30 degrees lie at 150 degrees in the frame of the eye that looks out.
    """
    eye = ic.eyes.navarro(3.0)
    lens = SpectacleLens(0.0, -2.0, 30.0)
    corrected = lens.apply(eye)
    turn = math.radians(150.0)
    along = np.array([math.cos(turn), math.sin(turn)])
    across = np.array([-math.sin(turn), math.cos(turn)])
    for direction, power in ((along, 0.0), (across, -2.0)):
        start = np.array([[*(1e-3 * direction), -30.0]])
        rays = trace(
            corrected, start, np.array([[0.0, 0.0, 1.0]]), POWER_WAVELENGTH_NM, record_hits=True
        )
        height, later = (rays.hits_mm[i, 0, :2] for i in (1, 2))
        gap = 12.0 - 1e-6
        slope = (later - height) / gap
        assert slope == pytest.approx(-height * power / 1000.0, abs=2e-12)


def test_a_contact_lens_adds_its_power_to_the_eye():
    """Soft and without thickness: the refraction at the cornea falls by its back vertex power."""
    eye = ic.eyes.navarro(3.0)
    start = eye.focus_vergence_dpt(POWER_WAVELENGTH_NM, "paraxial")
    for power in (-6.0, 0.0, 4.0):
        worn = ContactLens(power, centre_thickness_mm=1e-4).apply(eye)
        change = worn.focus_vergence_dpt(POWER_WAVELENGTH_NM, "paraxial") - start
        assert change == pytest.approx(power, abs=2e-4)


def test_a_thick_contact_lens_brings_infinity_into_focus():
    """The far point is the back focus of the lens in air, also where it touches the eye."""
    eye = far_point_eye(5.0)
    worn = ContactLens(-5.0, centre_thickness_mm=0.3).apply(eye)
    assert worn.focus_vergence_dpt(POWER_WAVELENGTH_NM, "paraxial") == pytest.approx(0, abs=1e-9)


def test_tears_behind_a_steep_rigid_lens_act_as_a_plus_lens():
    """(n_tear - 1)(1/R_back - 1/R_cornea) dpt more: the rule of fitters, thin tears."""
    eye = ic.eyes.navarro(3.0)
    thin = {"centre_thickness_mm": 1e-4, "tear_thickness_mm": 1e-4, "fit": "rigid"}
    plain, steep = (
        ContactLens(0.0, base_curve_mm=r, diameter_mm=0.01, **thin).apply(eye) for r in (7.72, 7.6)
    )
    change = steep.focus_vergence_dpt(POWER_WAVELENGTH_NM, "paraxial") - plain.focus_vergence_dpt(
        POWER_WAVELENGTH_NM, "paraxial"
    )
    assert change == pytest.approx(336.0 * (1 / 7.6 - 1 / 7.72), abs=2e-3)


@pytest.mark.parametrize("shape_factor", [-1.0, 0.0, 0.7])
def test_an_intraocular_lens_has_its_power_in_the_eye(shape_factor):
    """By a paraxial ray through the lens alone, in aqueous and vitreous."""
    eye = ic.eyes.navarro(3.0)
    lens = IntraocularLens(22.0, centre_thickness_mm=1.0, shape_factor=shape_factor)
    front, back = lens.apply(eye).surfaces[2:]
    n1, n, n2 = (
        float(m.index(POWER_WAVELENGTH_NM))
        for m in (eye.surfaces[1].medium_after, lens.medium, eye.surfaces[3].medium_after)
    )
    nu = -(n - n1) * front.curvature
    y = 1.0 + nu / n * (back.vertex_z_mm - front.vertex_z_mm)
    nu -= y * (n2 - n) * back.curvature
    assert -1000.0 * nu == pytest.approx(22.0, abs=1e-9)
    c1, c2 = front.curvature, back.curvature
    assert (c1 + c2) / (c1 - c2) == pytest.approx(shape_factor, abs=1e-12)


def test_an_intraocular_lens_sits_where_the_lens_was_and_ends_accommodation():
    eye = ic.eyes.navarro(3.0)
    worn = IntraocularLens(22.0).apply(eye)
    assert (worn.surfaces[2].vertex_z_mm + worn.surfaces[3].vertex_z_mm) / 2 == pytest.approx(5.6)
    assert worn.accommodation_model is None
    with pytest.raises(ic.FocusError, match="cannot accommodate"):
        worn.focus_at(0.5)


def test_an_artificial_pupil_is_the_entrance_pupil():
    worn = ArtificialPupil(1.0, 10.0).apply(ic.eyes.navarro(6.0))
    pupil = worn.entrance_pupil()
    assert (pupil.z_mm, pupil.diameter_mm) == (-10.0, 1.0)
    # The iris still clips: a hole as large as the iris lets no more light in than the iris does.
    narrow = ArtificialPupil(8.0, 10.0).apply(ic.eyes.navarro(2.0))
    height = np.array([0.9, 1.2])
    rays = trace(
        narrow, np.c_[0 * height, height, 0 * height - 20.0], np.array([[0, 0, 1.0]]), 550.0
    )
    assert list(rays.passed) == [True, False]
    assert rays.elements[rays.surface[1]] == "iris"


def test_spectacles_stay_on_the_head_while_the_eye_turns():
    """Straight ahead through the lens from an eye turned aside: the middle of the lens is there."""
    lens = SpectacleLens(-5.0, gaze_deg=(20.0, 0.0))
    eye = lens.apply(ic.eyes.navarro(3.0))
    back = eye.surfaces[1]
    middle = np.array([*back.placement.decentre_mm, back.vertex_z_mm])
    centre = np.array([0.0, 0.0, 13.5])
    # As far from the centre of rotation as before, and to the left of an eye that looks right.
    assert np.linalg.norm(middle - centre) == pytest.approx(25.5)
    seen = (middle - centre) / 25.5
    assert seen == pytest.approx([-math.sin(math.radians(20)), 0.0, -math.cos(math.radians(20))])
    # The lens still faces the head's way: its axis passes the centre of rotation.
    normal = back.placement.rotation @ np.array([0.0, 0.0, -1.0])
    assert normal == pytest.approx(seen, abs=1e-12)


def ball_before(scene):
    return np.array(scene.objects[0].shape.centre_m)


def test_a_turned_eye_sees_what_lies_in_its_gaze_straight_ahead():
    centre = np.array([0.0, 0.0, 0.0135])
    gaze = np.array([math.sin(0.3) * math.cos(0.2), math.sin(0.2), -math.cos(0.3) * math.cos(0.2)])
    ball = ic.Sphere(tuple(centre + 1.0 * gaze), 0.01)
    scene = ic.Scene((ic.SceneObject("ball", ball, ic.Emission(UNIT)),))
    seen = ball_before(scene.turned((math.degrees(0.3), math.degrees(0.2))))
    assert seen == pytest.approx([0.0, 0.0, -(1.0 - 0.0135)], abs=1e-12)


def test_the_fovea_sees_the_point_that_the_eye_fixates():
    """Its direction from the entrance pupil has the field angles of the fovea."""
    eye = dataclasses.replace(ic.eyes.navarro(3.0), fovea_deg=(-5.0, 1.5))
    point = (0.3, -0.2, -0.8)
    ball = ic.SceneObject("ball", ic.Sphere(point, 0.01), ic.Emission(UNIT))
    seen = ball_before(ic.Scene((ball,)).fixating(eye, point))
    away = seen - np.array([0.0, 0.0, eye.entrance_pupil().z_mm * 1e-3])
    theta = math.degrees(math.atan2(math.hypot(away[0], away[1]), -away[2]))
    turn = math.atan2(away[1], away[0])
    angles = (theta * math.cos(turn), theta * math.sin(turn))
    assert angles == pytest.approx((-5.0, 1.5), abs=1e-9)
    # The distance from the centre of rotation does not change.
    centre = np.array([0.0, 0.0, 0.0135])
    assert np.linalg.norm(seen - centre) == pytest.approx(np.linalg.norm(point - centre))


def test_an_image_may_be_centred_on_the_fovea():
    eye = dataclasses.replace(ic.eyes.navarro(3.0), fovea_deg=(-5.0, 1.5))
    grid = ic.RetinalGrid.of(eye, 2.0, 4, "fovea")
    assert grid.centre_deg == (-5.0, 1.5)
    # The middle of four pixels of half a degree; 5 degrees off the axis polar angles lie closer
    # together around it by the sine of 5.22 degrees over the angle, 0.14 %.
    assert np.min(grid.eccentricity_deg()) == pytest.approx(math.hypot(0.25, 0.25), rel=1.4e-3)
    with pytest.raises(InvalidInputError, match="centre_deg"):
        ic.RetinalGrid.of(eye, 2.0, 4, "macula")


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: SpectacleLens(-31.0), "sphere_dpt must lie between"),
        (lambda: SpectacleLens(-3.0, 1.0, 200.0), "axis_deg must lie between"),
        (lambda: SpectacleLens(-3.0, vertex_distance_mm=0.0), "vertex_distance_mm must be > 0"),
        (lambda: ContactLens(-3.0, fit="hard"), "fit"),
        (lambda: ContactLens(-3.0, base_curve_mm=8.0), "base_curve_mm must be None"),
        (lambda: IntraocularLens(100.0), "power_dpt must lie between"),
        (lambda: ArtificialPupil(0.0), "diameter_mm must be > 0"),
        (
            lambda: ContactLens(-3.0).apply(SpectacleLens(-3.0).apply(ic.eyes.navarro())),
            "put the contact lens on first",
        ),
        (
            lambda: IntraocularLens(60.0, centre_thickness_mm=5.0).apply(ic.eyes.navarro()),
            "cuts surface .intraocular lens front",
        ),
    ],
)
def test_impossible_lenses_are_refused(make, match):
    with pytest.raises(InvalidInputError, match=match):
        make()


def test_a_corrected_eye_accommodates_behind_its_lens():
    """A -4 dpt eye behind its spectacles focuses at 0.5 m by accommodating less than 2 dpt."""
    eye = ic.eyes.navarro(3.0).with_spectacle_refraction(-4.0, vertex_distance_mm=12.0)
    worn = eye.with_fovea((-5.0, 0.0)).changed(SpectacleLens(-4.0)).with_pupil(2.5)
    near = worn.focus_at(0.5)
    assert near.focus_vergence_dpt() == pytest.approx(2.0, abs=1e-5)
    assert near.surfaces[0].name == "spectacle lens front"
    assert (near.fovea_deg, near.stop.diameter_mm) == ((-5.0, 0.0), 2.5)
    emmetropic = ic.eyes.navarro(3.0).with_spectacle_refraction(0.0).focus_at(0.5)
    assert near.accommodation_parameter < emmetropic.accommodation_parameter


def test_a_lens_in_front_is_rendered():
    """A uniform scene keeps its radiance through any lens; only the pupil's image changes."""
    eye = ic.eyes.navarro(3.0)
    for worn in (eye.changed(SpectacleLens(-6.0)), eye.changed(ContactLens(4.0))):
        scene = ic.scenes.uniform(100.0)
        options = {"fov_deg": 2.0, "resolution": 4, "wavelengths_nm": [550.0], "spp": 64}
        image = ic.render(scene, worn, **options).irradiance.values
        # E = pi (n'/n)^2 L sin^2(theta'): behind the stop nothing has changed.
        bare = ic.render(scene, eye, **options).irradiance.values
        assert image == pytest.approx(bare, rel=2e-5)

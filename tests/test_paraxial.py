"""Gaussian optics against published cardinal points."""

import numpy as np
import pytest
from oracles import peers_eye, reduced_eye

import isetcl as ic
from isetcl.eye.paraxial import object_vergence_dpt


def navarro_543():
    """Navarro's eye with the indices that his paper prints for 543 nm."""
    index = {"cornea": 1.3777, "aqueous": 1.3391, "lens": 1.4222, "vitreous": 1.3377}
    media = {name: ic.Medium(name, ic.ConstantIndex(n)) for name, n in index.items()}
    surface = ic.Surface.from_radius
    return ic.Eye(
        "navarro 543",
        (
            surface("cf", 0.0, 7.72, conic=-0.26, semi_diameter_mm=5, medium_after=media["cornea"]),
            surface("cb", 0.55, 6.5, semi_diameter_mm=5, medium_after=media["aqueous"]),
            surface("lf", 3.6, 10.2, conic=-3.1316, semi_diameter_mm=4, medium_after=media["lens"]),
            surface(
                "lb", 7.6, -6.0, conic=-1.0, semi_diameter_mm=4, medium_after=media["vitreous"]
            ),
        ),
        ic.Stop(3.6, 4.0),
        ic.Retina.from_radius(23.9203, -12.0),
    )


def test_navarro_s_cardinal_points_match_two_other_programs():
    # visisipy's tests, computed by OpticStudio and by Optiland, which agree.
    c = navarro_543().cardinal_points(543.0)
    assert c.focal_length_front_mm == pytest.approx(-16.467904, abs=2e-6)
    assert c.focal_length_back_mm == pytest.approx(22.029115, abs=2e-6)
    assert c.focal_point_front_mm == pytest.approx(-14.885414, abs=2e-6)
    assert c.focal_point_back_mm - 23.9203 == pytest.approx(0.000014, abs=2e-6)
    assert c.principal_point_front_mm == pytest.approx(1.582490, abs=2e-6)
    assert c.principal_point_back_mm - 23.9203 == pytest.approx(-22.029102, abs=2e-6)
    assert c.nodal_point_front_mm == pytest.approx(7.143701, abs=2e-6)
    assert c.nodal_point_back_mm - 23.9203 == pytest.approx(-16.467890, abs=2e-6)


def test_le_grand_s_cardinal_points_are_the_published_ones():
    def surface(name, z, radius, n):
        medium = ic.Medium(name, ic.ConstantIndex(n))
        return ic.Surface.from_radius(name, z, radius, semi_diameter_mm=4, medium_after=medium)

    eye = ic.Eye(
        "le grand",
        (
            surface("cf", 0.0, 7.8, 1.3771),
            surface("cb", 0.55, 6.5, 1.3374),
            surface("lf", 3.6, 10.2, 1.42),
            surface("lb", 7.6, -6.0, 1.336),
        ),
        ic.Stop(3.6, 4.0),
        ic.Retina.from_radius(24.19655, -13.4),
    )
    c = eye.cardinal_points(589.3)
    assert c.power_dpt == pytest.approx(59.94, abs=0.005)
    got = (
        c.focal_length_front_mm,
        c.focal_length_back_mm,
        c.focal_point_front_mm,
        c.focal_point_back_mm,
        c.principal_point_front_mm,
        c.principal_point_back_mm,
        c.nodal_point_front_mm,
        c.nodal_point_back_mm,
    )
    # Le Grand & El Hage 1980.
    expected = (-16.68, 22.29, -15.09, 24.20, 1.59, 1.91, 7.20, 7.51)
    np.testing.assert_allclose(got, expected, atol=0.01)


@pytest.mark.parametrize(
    ("state", "power", "front", "back"),
    [("relaxed", 59.94, -16.68, 22.29), ("accommodated", 67.68, -14.78, 19.74)],
)
def test_both_forms_of_le_grand_s_eye_have_their_published_power(state, power, front, back):
    c = ic.eyes.legrand(state=state).cardinal_points(589.3)
    assert c.power_dpt == pytest.approx(power, abs=0.02)
    assert c.focal_length_front_mm == pytest.approx(front, abs=0.01)
    assert c.focal_length_back_mm == pytest.approx(back, abs=0.01)


def test_arizona_s_power_and_its_growth_with_accommodation():
    # Published 60.6 dpt relaxed; the rest from an independent tracer (agreement, not proof).
    for a, power in ((0, 60.6227), (1, 61.844), (2, 63.058), (5, 66.638), (10, 72.330)):
        eye = ic.eyes.arizona(2.0, accommodation_parameter=float(a))
        assert eye.power_dpt(587.56) == pytest.approx(power, abs=0.002)


def test_arizona_s_parameter_is_close_to_dioptres_paraxially():
    expected = {1: 0.997, 2: 1.994, 3: 2.997, 4: 4.005, 5: 5.017, 8: 8.061, 10: 10.080}
    for a, vergence in expected.items():
        eye = ic.eyes.arizona(2.0, accommodation_parameter=float(a))
        assert object_vergence_dpt(eye, 587.56) == pytest.approx(vergence, abs=0.002)


@pytest.mark.parametrize(
    ("name", "wavelength", "z", "magnification"),
    [
        ("navarro", 543.0, 3.040, 1.1334),
        ("arizona", 587.56, 2.962, 1.1277),
        ("legrand", 589.3, 3.038, 1.1311),
    ],
)
def test_entrance_pupils_lie_where_another_tracer_puts_them(name, wavelength, z, magnification):
    # At the wavelengths for which the models' indices are published.
    pupil = ic.eyes.by_name(name).entrance_pupil(wavelength)
    assert pupil.z_mm == pytest.approx(z, abs=0.001)
    assert pupil.magnification == pytest.approx(magnification, abs=3e-4)


def test_a_pupil_given_in_the_entrance_plane_has_that_diameter_from_outside():
    eye = ic.eyes.navarro(3.0, pupil_plane="entrance")
    assert eye.entrance_pupil(550.0).diameter_mm == pytest.approx(3.0, rel=1e-12)
    assert eye.stop.diameter_mm == pytest.approx(3.0 / 1.1333, rel=1e-3)


def test_a_stop_at_the_only_surface_is_both_its_own_pupils():
    eye = reduced_eye(4.0)
    assert eye.entrance_pupil(550.0).diameter_mm == 4.0
    assert eye.entrance_pupil(550.0).z_mm == 0.0


def test_the_peers_eye_has_the_published_power_and_focus():
    # mpmath, 40 digits, for indices 1.376, 1.3374, 1.42, 1.336.
    c = peers_eye().cardinal_points(550.0)
    assert c.power_dpt == pytest.approx(60.41557386895208, rel=1e-13)
    assert c.focal_length_back_mm == pytest.approx(22.113503430389137, rel=1e-13)
    assert c.focal_point_back_mm - 7.6 == pytest.approx(16.403976263645475, rel=1e-13)
    assert c.focal_point_front_mm == pytest.approx(-14.968874619131924, rel=1e-13)
    pupil = peers_eye().entrance_pupil(550.0)
    assert pupil.magnification == pytest.approx(1.1328384180315612, rel=1e-13)
    assert pupil.z_mm == pytest.approx(3.042426614184212, rel=1e-13)


@pytest.mark.parametrize(
    ("name", "blue", "red"),
    [("navarro", -2.081, 0.385), ("arizona", -1.636, 0.383), ("legrand", -1.474, 0.409)],
)
def test_longitudinal_chromatic_aberration_agrees_with_an_independent_tracer(name, blue, red):
    eye = ic.eyes.by_name(name)
    reference = object_vergence_dpt(eye, 589.3)
    assert reference - object_vergence_dpt(eye, 400.0) == pytest.approx(blue, abs=0.012)
    assert reference - object_vergence_dpt(eye, 700.0) == pytest.approx(red, abs=0.012)


def test_an_eye_under_water():
    # Power (n2 - n1) / R; object at 1/V metres: n1 V = P - n2 / L.  E = pi (n2 / n1)^2 sin^2.
    n1, n2, radius, length = 1.333, 1.5, 3.0, 22.0
    medium, water = ic.Medium("m", ic.ConstantIndex(n2)), ic.Medium("w", ic.ConstantIndex(n1))
    surface = ic.Surface.from_radius(
        "s", 0.0, radius, conic=-((n1 / n2) ** 2), semi_diameter_mm=2.5, medium_after=medium
    )
    eye = ic.Eye(
        "diver", (surface,), ic.Stop(0.0, 2.0), ic.Retina.from_radius(length, -12.0), water
    )
    power = 1000 * (n2 - n1) / radius
    assert eye.focus_vergence_dpt(550.0, "paraxial") == pytest.approx(
        (power - 1000 * n2 / length) / n1
    )


def test_entrance_pupil_under_water():
    # thin lens-less check: stop 3 mm behind a surface of radius 8 between n1 and n2
    n1, n2, d, r = 1.2, 1.5, 3.0, 8.0
    s1 = ic.Surface.from_radius(
        "a", 0.0, r, semi_diameter_mm=4.0, medium_after=ic.Medium("m", ic.ConstantIndex(n2))
    )
    eye = ic.Eye(
        "e",
        (s1,),
        ic.Stop(d, 2.0),
        ic.Retina.from_radius(24.0, -12.0),
        ic.Medium("w", ic.ConstantIndex(n1)),
    )
    # light from the stop towards the scene: n1 / z = n2 / d - (n2 - n1) / r
    assert eye.entrance_pupil(550.0).z_mm == pytest.approx(n1 / (n2 / d - (n2 - n1) / r))

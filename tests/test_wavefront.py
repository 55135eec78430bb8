"""Wavefronts against analytic systems, 50-digit rays and their own sign conventions."""

import dataclasses
import math

import mpmath as mp
import numpy as np
import pytest
from oracles import mp_trace, reduced_eye

import isetcl as ic
from isetcl.eye.aberrations import geometric
from isetcl.eye.aberrations.refraction_error import Refraction, oblique_foci
from isetcl.eye.field import direction_from_field
from isetcl.eye.object_point import ObjectPoint, pupil_axes
from isetcl.eye.prescription import elements
from isetcl.eye.surface import conic_sag


def longer(eye, by_mm):
    """The eye with its retina moved back: myopic by it."""
    retina = dataclasses.replace(eye.retina, vertex_z_mm=eye.retina.vertex_z_mm + by_mm)
    return dataclasses.replace(eye, retina=retina)


def open_sequence(eye, wavelength_nm):
    stop = eye.stop_index
    sequence = list(elements(eye, wavelength_nm))
    sequence[stop] = dataclasses.replace(sequence[stop], semi_diameter_mm=1e3)
    sequence[-1] = dataclasses.replace(sequence[-1], semi_diameter_mm=1e3)
    return sequence


def mp_path(eye, source, entrance_mm, distance_m):
    """Point, direction and path of a ray from the object, 50 digits; less the object's distance."""
    x, y = (mp.mpf(v) for v in source.field_deg)
    angle = mp.sqrt(x * x + y * y)
    theta = angle * mp.pi / 180
    c, s = (x / angle, y / angle) if angle > 0 else (mp.mpf(1), mp.mpf(0))
    towards = [c * mp.sin(theta), s * mp.sin(theta), -mp.cos(theta)]
    tangential, sagittal = [c * mp.cos(theta), s * mp.cos(theta), mp.sin(theta)], [-s, c, 0]
    u, v = (mp.mpf(float(w)) for w in entrance_mm)
    along, across = c * u + s * v, c * v - s * u
    point = [along * a + across * b for a, b in zip(tangential, sagittal, strict=True)]
    point[2] += mp.mpf(source.entrance_z_mm)
    middle = [mp.mpf(0), mp.mpf(0), mp.mpf(source.entrance_z_mm)]
    # From a point 50 mm before the pupil on, since `mp_trace` takes origins in float64.
    if math.isinf(distance_m):
        start = [float(a + 50 * b) for a, b in zip(point, towards, strict=True)]
        direction = [-v for v in towards]
        passed = sum((m - a) * b for a, b, m in zip(start, towards, middle, strict=True))
    else:
        ahead = (1000 * mp.mpf(distance_m) + middle[2]) / mp.cos(theta)
        origin = [a + ahead * b for a, b in zip(middle, towards, strict=True)]
        direction = [a - b for a, b in zip(point, origin, strict=True)]
        size = mp.sqrt(sum(v * v for v in direction))
        start = [float(a - 50 * b / size) for a, b in zip(point, direction, strict=True)]
        passed = mp.sqrt(sum((a - b) ** 2 for a, b in zip(start, origin, strict=True))) - ahead
    hit, unit, path = mp_trace(open_sequence(eye, source.wavelength_nm), start, direction, 1)
    return hit, unit, path + passed


def mp_to_sphere(path, index, centre, radius):
    hit, unit, length = path
    offset = [a - b for a, b in zip(hit, centre, strict=True)]
    along = sum(a * b for a, b in zip(offset, unit, strict=True))
    return length - index * (along + mp.sqrt(along**2 - sum(a * a for a in offset) + radius**2))


@pytest.mark.parametrize("distance_m", [0.05, 0.4, 20.0, 1e6, 1e9, math.inf])
@pytest.mark.parametrize("field_deg", [(0.0, 0.0), (12.0, -20.0)])
def test_opd_is_right_to_1e_8_waves_at_every_distance(distance_m, field_deg):
    # Against rays of 50 digits that start at the object.
    eye = ic.eyes.navarro(5.0)
    front = eye.wavefront(field_deg, 550.0, object_distance_m=distance_m, samples=16)
    source = ObjectPoint(eye, field_deg, 550.0, distance_m)
    start = source.chief().entrance_mm[0]
    centre = [mp.mpf(float(v)) for v in front.centre_mm]
    to_sphere = (mp.mpf(front.vitreous_index), centre, mp.mpf(front.radius_mm))
    chief = mp_to_sphere(mp_path(eye, source, start, distance_m), *to_sphere)
    for place in ((8, 1), (3, 10), (12, 12)):
        path = mp_path(eye, source, front.entrance_mm[place] + start, distance_m)
        waves = (chief - mp_to_sphere(path, *to_sphere)) * 1e6 / 550
        assert float(waves) == pytest.approx(front.opd_waves[place], abs=1e-8)


def test_a_million_metres_is_infinity():
    # W differs by p^2 / (2 D) = 2e-6 um.
    eye = ic.eyes.navarro(4.0)
    far, infinite = (
        eye.wavefront(10.0, object_distance_m=d, samples=16).opd_um for d in (1e6, math.inf)
    )
    np.testing.assert_allclose(far, infinite, atol=3e-6)


def test_descartes_ellipsoid_has_no_aberration_on_axis():
    front = reduced_eye(4.0).wavefront()
    assert np.nanmax(np.abs(front.opd_um)) < 1e-10
    assert front.strehl() == pytest.approx(1.0, abs=1e-12)


def test_a_sphere_has_the_spherical_aberration_of_theory():
    # Seidel, stop at the surface, object at infinity: W(rho) = S_I / 8 rho^4 with
    # S_I = -A^2 h D(u/n), A = n i = h c, D(u/n) = u'/n' and u' = -h c (n' - 1) / n': a path longer
    # by S_I / 8 at the edge is a wave that lags, W here = -(path), converted by hand below.
    index, radius, h = 4.0 / 3.0, 5.5, 0.5
    eye = reduced_eye(2 * h, conic=0.0)
    c = 1.0 / radius
    slope = -h * c * (index - 1.0) / index
    seidel = -((h * c) ** 2) * h * (slope / index)
    fit = eye.wavefront(samples=32).zernike()
    rim_um = 6 * math.sqrt(5) * fit.coefficient_um(4, 0)
    # Positive: the edge of an undercorrected eye is myopic.
    assert rim_um == pytest.approx(1000 * seidel / 8, rel=0.03)
    assert rim_um > 0


def test_myopia_is_a_positive_defocus_coefficient_and_a_negative_refraction():
    # Reduced eye: M = n / L' - n / L at the vertex, which is principal point and entrance pupil.
    eye = longer(reduced_eye(1.0), 0.7)
    index, length = 4.0 / 3.0, 22.0
    expected = 1000 * index * (1 / (length + 0.7) - 1 / length)
    front = eye.wavefront(samples=32)
    fit = front.zernike()
    assert fit.coefficient_um(2, 0) > 0
    assert fit.coefficient_um(2, 0) == pytest.approx(
        -expected * 0.25 / (4 * math.sqrt(3)), rel=2e-3
    )
    for definition in ("minimum_rms", "zernike", "seidel"):
        got = front.refraction(definition)
        assert got.m_dpt == pytest.approx(expected, rel=2e-3)
        assert abs(got.j0_dpt) < 1e-7
        assert abs(got.j45_dpt) < 1e-7
    # The same, for an object there.
    near = eye.wavefront(object_distance_m=-1.0 / expected, samples=32)
    assert near.refraction("seidel").m_dpt == pytest.approx(0.0, abs=1e-3)


def test_seidel_refraction_is_the_paraxial_one_in_the_entrance_pupil():
    for name in ("navarro", "arizona", "legrand"):
        eye = longer(ic.eyes.by_name(name, 5.0), 0.4)
        pupil = eye.entrance_pupil(550.0).z_mm
        cornea = -eye.focus_vergence_dpt(550.0, "paraxial")
        expected = cornea / (1 - cornea * pupil / 1000)
        got = eye.wavefront(samples=32).refraction("seidel").m_dpt
        assert got == pytest.approx(expected, abs=2e-3)


def test_defocusing_lens_and_nearer_object_do_the_same():
    eye = ic.eyes.navarro(3.0)
    pupil = eye.entrance_pupil(550.0).z_mm
    # 1 dpt at the entrance pupil.
    traced = eye.wavefront(object_distance_m=1.0 - pupil / 1000, samples=32)
    lens = eye.wavefront(samples=32).defocused(1.0)
    difference = traced.zernike().coefficients_um - lens.zernike().coefficients_um
    assert np.max(np.abs(difference[3:])) < 2e-4


def test_a_lens_corrects_what_refraction_says():
    front = ic.eyes.navarro(4.0).wavefront((8.0, 15.0), samples=32)
    found = front.refraction()
    left = front.with_lens(found.m_dpt, found.j0_dpt, found.j45_dpt)
    assert abs(found.j45_dpt) > 0.05
    for value in dataclasses.astuple(left.refraction()):
        assert value == pytest.approx(0.0, abs=1e-10)
    assert left.rms_um < front.rms_um


def test_cylinder_and_axis_follow_the_power_vector():
    # Thibos 1997: -1 x 180 (stronger along 90) is M = -0.5, J0 = 0.5.
    sphere, cylinder, axis = Refraction(-0.5, 0.5, 0.0).sphere_cylinder_axis
    assert (sphere, cylinder, axis) == (0.0, -1.0, 0.0)
    sphere, cylinder, axis = Refraction(0.0, 0.0, 0.25).sphere_cylinder_axis
    assert (sphere, cylinder, axis) == (0.25, -0.5, 45.0)


def test_refraction_over_the_field_tends_to_the_line_foci():
    # A small pupil's refraction is that of the narrow pencil.  Field along y: T acts along y.
    eye = ic.eyes.navarro(0.15)
    for angle in (0.0, 20.0, 50.0):
        foci = oblique_foci(eye, [angle])
        tangential, sagittal = foci.tangential_dpt[0], foci.sagittal_dpt[0]
        got = eye.wavefront(angle, samples=32).refraction()
        assert got.m_dpt == pytest.approx((tangential + sagittal) / 2, abs=0.01)
        assert got.j0_dpt == pytest.approx((sagittal - tangential) / 2, abs=0.01)


def test_rays_are_the_normals_of_the_wavefront():
    # Signs of W, of q and of the axes at once: places of rays against the gradient of W.
    eye = ic.eyes.navarro(4.0)
    field = (6.0, 11.0)
    front = eye.wavefront(field, samples=48)
    implied = geometric.spot_of_wavefront(front)
    source = ObjectPoint(eye, field, 550.0)
    chief = source.chief()
    traced = source.trace(implied.entrance_mm + chief.entrance_mm)
    offset = traced.point_mm - chief.point_mm
    inverse = np.linalg.pinv(front.mm_per_deg)
    seen = 60 * offset @ inverse
    size = np.ptp(seen, axis=0).max()
    # Cells on the rim are sampled beside their middles, to which the gradient belongs.
    whole = implied.weights > 0.9 * implied.weights.max()
    assert np.mean(whole) > 0.85
    # The retina is curved, and rays are normals of W to first order only.
    got = np.stack([implied.x_arcmin, implied.y_arcmin], axis=1)
    np.testing.assert_allclose(got[whole], seen[whole], atol=0.01 * size)
    assert size > 10


def test_a_tilt_moves_the_image_its_way():
    front = reduced_eye(3.0).wavefront()
    x, y = np.meshgrid(front.x_cpd, front.y_cpd)
    # W = lambda q . v moves it by v.
    v = np.array([2.0, -1.0]) / 60
    tilted = dataclasses.replace(front, opd_um=front.opd_um + 0.55 * (x * v[0] + y * v[1]))
    psf = tilted.psf(8.0, 81)
    row, column = np.unravel_index(np.argmax(psf.relative), psf.relative.shape)
    assert psf.x_arcmin[column] == pytest.approx(2.0, abs=0.06)
    assert psf.y_arcmin[row] == pytest.approx(-1.0, abs=0.06)
    assert tilted.rms_um < 1e-9
    assert tilted.strehl() == pytest.approx(1.0, abs=1e-6)


def test_turning_the_field_turns_everything():
    up = ic.eyes.navarro(3.0).wavefront((0.0, 9.0), samples=32)
    right = ic.eyes.navarro(3.0).wavefront((9.0, 0.0), samples=32)
    np.testing.assert_allclose(np.rot90(up.opd_um, -1), right.opd_um, atol=1e-9)
    # Mirror symmetry about the meridian of the field.
    np.testing.assert_allclose(up.opd_um, up.opd_um[:, ::-1], atol=1e-10)
    assert up.zernike().coefficient_um(3, -1) == pytest.approx(
        right.zernike().coefficient_um(3, 1), abs=1e-7
    )


def test_flux_is_that_of_an_even_beam():
    # The stop at the surface of the reduced eye is its entrance pupil: even in mm^2.
    front = reduced_eye(4.0).wavefront()
    assert front.area_mm2.sum() == pytest.approx(math.pi * 4, rel=1e-3)
    used = front.inside
    density = front.flux[used] / front.area_mm2[used]
    np.testing.assert_allclose(density, density[0], rtol=1e-12)
    assert front.entrance_radius_mm == pytest.approx(2.0, rel=1e-12)


def test_a_near_point_lights_the_rim_less():
    # Flux per area of the plane through the pupil of a point at d: cos^3 = (1 + (p/d)^2)^-1.5.
    front = reduced_eye(7.0).wavefront(object_distance_m=0.02, samples=32)
    used = front.inside
    squared = np.sum(front.entrance_mm[used] ** 2, axis=1)
    density = front.flux[used] / front.area_mm2[used] * (1 + squared / 400.0) ** 1.5
    np.testing.assert_allclose(density, density[0], rtol=1e-9)


def test_degrees_on_the_retina_are_true_angles():
    # A direction turned by a small angle to its right or up moves the chief ray's point by M.
    eye = ic.eyes.navarro(3.0)
    field = (22.0, -35.0)
    front = eye.wavefront(field, samples=16)
    chief_map = eye.field_map(550.0)
    towards = direction_from_field(*np.array(field))
    start = chief_map.retinal_point_mm(*np.array(field))
    for axis, expected in zip(pupil_axes(field), front.mm_per_deg, strict=True):
        turned = towards + math.radians(1e-3) * axis
        angle = math.degrees(math.atan2(math.hypot(turned[0], turned[1]), -turned[2]))
        x, y = angle * turned[:2] / math.hypot(turned[0], turned[1])
        moved = chief_map.retinal_point_mm(np.array(x), np.array(y)) - start
        np.testing.assert_allclose(1e3 * moved, expected, atol=2e-5)


def test_stiles_crawford_is_a_law_of_intensity():
    plain = reduced_eye(6.0).wavefront(samples=128)
    front = plain.with_stiles_crawford(0.05)
    rho = np.linalg.norm(front.entrance_mm, axis=-1)
    ratio = (front.flux / np.where(plain.inside, plain.flux, 1.0))[plain.inside]
    law = 10 ** (-0.05 * rho[plain.inside] ** 2)
    np.testing.assert_allclose(ratio / ratio[0], law / law[0], rtol=1e-12)
    # Mean intensity over a disc of radius 3: (1 - 10^(-0.45)) / (0.45 ln 10).
    expected = (1 - 10**-0.45) / (0.45 * math.log(10))
    assert 1 / np.max(ratio) == pytest.approx(expected, rel=2e-3)
    assert front.flux.sum() == pytest.approx(1.0)


def test_best_focus_reference_finds_the_image_of_a_perfect_eye():
    eye = longer(reduced_eye(3.0), 0.5)
    front = eye.wavefront(reference="best_focus")
    np.testing.assert_allclose(front.centre_mm, [0, 0, 22.0], atol=1e-6)
    assert front.rms_um < 1e-6


def test_fields_beyond_90_deg_and_extreme_pupils_are_traced():
    # W stays mirror symmetric and smooth there.
    for diameter in (0.1, 8.0):
        front = ic.eyes.navarro(diameter).wavefront(0.0, samples=32)
        np.testing.assert_allclose(front.opd_um, front.opd_um[::-1], atol=1e-9)
    front = ic.eyes.navarro(1.0).wavefront((95.0, 0.0), samples=16)
    assert front.inside.sum() > 30
    np.testing.assert_allclose(front.opd_um, front.opd_um[::-1], atol=1e-8)


def test_vignetted_pupils_are_reported_and_not_fitted():
    eye = ic.eyes.navarro(4.0)
    small = dataclasses.replace(eye.surfaces[-1], semi_diameter_mm=1.7)
    eye = dataclasses.replace(eye, surfaces=(*eye.surfaces[:-1], small))
    front = eye.wavefront(0.0)
    # The marginal ray of 2 mm meets the last surface at 1.70 mm: a little is lost.
    assert eye.wavefront(25.0, samples=48).vignetted > 0.02
    with pytest.raises(ic.InvalidInputError, match="lost at the rims"):
        eye.wavefront(25.0, samples=48).zernike()
    assert front.vignetted < 0.02
    tiny = dataclasses.replace(small, semi_diameter_mm=0.4)
    blind = dataclasses.replace(eye, surfaces=(*eye.surfaces[:-1], tiny))
    with pytest.raises(ic.InvalidInputError, match="vignetted"):
        blind.wavefront(0.0)


def test_bad_input_is_refused():
    eye = ic.eyes.navarro()
    cases = (
        ({"field_deg": 120.0}, "field angle must be at most"),
        ({"field_deg": (1.0, 2.0, 3.0)}, "two numbers"),
        ({"wavelength_nm": 300.0}, "nm"),
        ({"wavelength_nm": 1100.0}, "nm"),
        ({"samples": 8}, "between 16 and 1024"),
        ({"reference": "worst"}, "reference"),
        ({"object_distance_m": -1.0}, "distance_m"),
        ({"object_distance_m": 0.001}, "in front of the eye"),
        ({"field_deg": 88.0, "object_distance_m": 1.0}, "85 deg"),
        ({"stiles_crawford": -0.1}, "rho_per_mm2"),
    )
    for options, message in cases:
        with pytest.raises(ic.InvalidInputError, match=message):
            eye.wavefront(**options)
    with pytest.raises(ic.InvalidInputError, match="too few for diffraction; use samples="):
        eye.wavefront(samples=16).defocused(5.0).strehl()
    with pytest.raises(ic.InvalidInputError, match="at most"):
        eye.wavefront(samples=16).zernike(radius_mm=3.0)
    with pytest.raises(ic.InvalidInputError, match="definition"):
        eye.wavefront(samples=16).refraction("subjective")


def test_conic_sag_stays_the_oracle_of_the_exact_path():
    # W of one ray by hand: a plane wave on the reduced myopic eye, paraxially aberration free.
    eye = longer(reduced_eye(2.0), 0.3)
    front = eye.wavefront(samples=16)
    index, h = 4.0 / 3.0, np.hypot(*front.entrance_mm[0, 7])
    surface = eye.surfaces[0]
    sag = float(conic_sag(h, surface.curvature, surface.conic))
    # The wave converges to z = 22 exactly: path to a point P beyond is the sphere about it.
    focus = np.array([0.0, 22.0])
    unit = (focus - [h, sag]) / np.linalg.norm(focus - [h, sag])
    centre = np.array([0.0, 22.3])
    offset = focus - centre
    back = offset @ unit + math.sqrt((offset @ unit) ** 2 - offset @ offset + front.radius_mm**2)
    # Every ray has the same path to the focus; the chief ray goes on 0.3 mm from there.
    lag = (index * (0.3 - front.radius_mm)) - (-index * back)
    assert front.opd_um[0, 7] == pytest.approx(1000 * lag, abs=1e-8)

"""Rays at the edges of what a surface and an eye allow, each against a formula or a limit."""

import dataclasses
import math

import numpy as np
import pytest
from test_sequential import hard_rays
from test_trace_rays import run, single_surface

import isetcl as ic
from isetcl.eye.prescription import elements
from isetcl.eye.rays import RayStatus

pytestmark = pytest.mark.usefixtures("one_register")

REAL = {"single": np.float32, "double": np.float64}


def rounded(array, precision):
    return np.asarray(array).astype(REAL[precision]).astype(np.float64)


def test_rays_parallel_to_the_axis_of_a_paraboloid_meet_its_parabola(device, precision):
    x = rounded(np.linspace(0.0, 6.0, 61), precision)
    origins = np.stack([x, 0 * x, 0 * x - 5.0], axis=1)
    rays = run(
        device, precision, (single_surface(-1 / 6.0, -1.0),), origins, np.tile([0.0, 0, 1], (61, 1))
    )
    expected = np.stack([x, 0 * x, -(x**2) / 12.0], axis=1)
    error = np.max(np.abs(rays.positions_mm - expected))
    assert error < {"single": 5e-7, "double": 2e-15}[precision]


def oblique_rays(precision):
    """Rays onto a surface near the origin, leaning by up to 1.2 rad."""
    h, lean = (v.ravel() for v in np.meshgrid(np.linspace(-4.0, 4.0, 17), (0.0, 1e-3, 0.4, -1.2)))
    directions = np.stack([np.sin(lean), 0.1 + 0 * lean, np.cos(lean)], axis=1)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origins = np.stack([h, 0 * h, 0 * h], axis=1) - 3.0 * directions
    return rounded(origins, precision), rounded(directions, precision)


@pytest.mark.parametrize("beyond", [1e-15, -1e-15, 1e-9, -1e-9])
def test_conics_beside_a_paraboloid_are_continuous_with_it(device, precision, beyond):
    rays = oblique_rays(precision)
    at = run(device, precision, (single_surface(-1 / 6.0, -1.0),), *rays)
    beside = run(device, precision, (single_surface(-1 / 6.0, -1.0 + beyond),), *rays)
    assert at.passed.sum() > 40
    np.testing.assert_array_equal(at.status, beside.status)
    # The sag moves by |beyond| c^3 r^4 / 8 < 1 mm |beyond| within 5 mm of the axis.
    near = at.passed & (np.linalg.norm(at.positions_mm[:, :2], axis=1) < 5.0)
    error = np.max(np.abs(at.positions_mm - beside.positions_mm)[near])
    assert error < {"single": 5e-6, "double": 1e-14}[precision] + 10.0 * abs(beyond)


@pytest.mark.parametrize("conic", [-50.0, -1.0, 0.0, 20.0])
@pytest.mark.parametrize("curvature", [1e-9, -1e-9, 1e-12])
def test_a_surface_that_is_almost_plane_is_the_plane(device, precision, curvature, conic):
    origins, directions = oblique_rays(precision)
    got = run(device, precision, (single_surface(curvature, conic),), origins, directions)
    length = -origins[:, 2] / directions[:, 2]
    expected = origins + length[:, None] * directions
    assert got.passed.all()
    cosine = directions[:, 2]
    sag = 0.5 * abs(curvature) * np.sum(expected[:, :2] ** 2, axis=1)
    error = np.linalg.norm(got.positions_mm - expected, axis=1) * cosine
    assert np.all(error < 1.1 * sag + {"single": 3e-6, "double": 1e-14}[precision])


def test_at_the_rim_of_a_sphere_a_ray_hits_or_misses_and_nothing_is_not_a_number(device, precision):
    # Parallel to the axis at heights r (1 +- delta): hit inside, missed outside.
    delta = np.array([10.0**-k for k in range(1, 16)])
    heights = rounded(5.0 * np.concatenate([1.0 - delta, 1.0 + delta, [1.0]]), precision)
    origins = np.stack([heights, 0 * heights, 0 * heights - 3.0], axis=1)
    n = len(heights)
    rays = run(
        device, precision, (single_surface(0.2, 0.0),), origins, np.tile([0.0, 0, 1], (n, 1))
    )
    assert np.isfinite(rays.positions_mm).all()
    assert np.isfinite(rays.directions).all()
    # Outside a band of a few roundings of the discriminant 1 - (h / r)^2 nothing is in doubt.
    discriminant = 1.0 - (heights / 5.0) ** 2
    clear = np.abs(discriminant) > {"single": 1e-5, "double": 1e-14}[precision]
    assert clear.sum() >= 8
    hit = rays.status != RayStatus.MISSED
    np.testing.assert_array_equal(hit[clear], discriminant[clear] > 0)
    # Those that hit lie on the sphere about (0, 0, 5).
    radius = np.linalg.norm(rays.positions_mm[hit] - [0.0, 0.0, 5.0], axis=1)
    cosine = np.sqrt(np.maximum(discriminant[hit], 1e-3))
    eps = float(np.finfo(REAL[precision]).eps)
    assert np.max(np.abs(radius - 5.0) * cosine) < 20.0 * eps


@pytest.mark.parametrize("before_deg", [1e-1, 1e-2, 1e-3, 1e-4])
def test_just_before_total_reflection_the_direction_is_right_to_its_condition(
    device, precision, before_deg
):
    n, n_next = 1.4, 1.3
    angle = math.asin(n_next / n) - math.radians(before_deg)
    direction = rounded([[math.sin(angle), 0.0, math.cos(angle)]], precision)
    direction = direction / np.linalg.norm(direction)
    rays = run(
        device,
        precision,
        (single_surface(0.0, 0.0, n=(n, n_next)),),
        np.array([[0.0, 0.0, -1.0]]),
        direction,
    )
    sine = n / n_next * direction[0, 0]
    cosine = math.sqrt((1.0 - sine) * (1.0 + sine))
    assert rays.status[0] == RayStatus.OK
    error = np.max(np.abs(rays.directions[0] - [sine, 0.0, cosine]))
    assert error < {"single": 4e-7, "double": 1e-15}[precision] / cosine


@pytest.mark.parametrize("offset_deg", [1e-6, -1e-6, 0.0])
def test_at_the_critical_angle_a_ray_passes_or_is_reflected_and_is_finite(
    device, precision, offset_deg
):
    angle = math.asin(1.0 / 1.5) + math.radians(offset_deg)
    rays = run(
        device,
        precision,
        (single_surface(0.0, 0.0, n=(1.5, 1.0)),),
        np.array([[0.0, 0.0, -1.0]]),
        np.array([[math.sin(angle), 0.0, math.cos(angle)]]),
    )
    assert rays.status[0] in (RayStatus.OK, RayStatus.REFLECTED)
    assert np.isfinite(rays.positions_mm).all()
    assert np.isfinite(rays.directions).all()


def test_the_retina_is_met_behind_its_equator(precision):
    # Its sphere, about z = 12 mm, is met in front of that where no sag exists any more.
    eye = ic.eyes.navarro(3.0)
    retina = eye.retina
    centre = retina.vertex_z_mm - 12.0
    for field in (75.0, 85.0):
        angle = math.radians(field)
        along = np.array([0.0, math.sin(angle), math.cos(angle)])
        across = np.array([0.0, math.cos(angle), -math.sin(angle)])
        origins = np.array([[0.0, 0.0, 2.0] + h * across for h in np.linspace(-3, 3, 61)])
        rays = ic.trace_rays(eye, origins - 20.0 * along, along, 550.0, precision=precision)
        assert rays.passed.sum() >= 4
        hits = rays.positions_mm[rays.passed]
        assert np.all(hits[:, 2] < centre)
        radius = np.linalg.norm(hits - [0.0, 0.0, centre], axis=1)
        np.testing.assert_allclose(radius, 12.0, rtol=0, atol=1e-5)


def scaled(element, factor):
    return dataclasses.replace(
        element,
        vertex_z_mm=element.vertex_z_mm * factor,
        curvature=element.curvature / factor,
        semi_diameter_mm=element.semi_diameter_mm * factor,
    )


def test_a_whole_eye_scaled_by_a_power_of_two_gives_the_same_bits(device, precision):
    sequence = elements(ic.eyes.navarro(8.0), 550.0)
    origins, directions = hard_rays()
    origins = rounded(origins, precision)
    one = run(device, precision, sequence, origins, directions)
    assert one.passed.sum() > 30
    for factor, limit in ((2.0**7, 0.0), (1e3, {"single": 1e-6, "double": 1e-13}[precision])):
        larger = tuple(scaled(e, factor) for e in sequence)
        other = run(device, precision, larger, origins * factor, directions)
        ok = one.passed & other.passed
        assert np.mean(one.passed == other.passed) > (0.97 if limit else 0.9999)
        off = np.abs(other.positions_mm / factor - one.positions_mm)[ok]
        assert np.max(off) <= limit * 24.0


def test_a_round_trip_of_ordinary_fields_returns_to_a_fiftieth_of_a_micrometre(precision):
    eye = ic.eyes.navarro(6.0)
    origins, directions = hard_rays()
    ordinary = directions[:, 2] / np.linalg.norm(directions, axis=1) > math.cos(math.radians(60.0))
    origins, directions = origins[ordinary], directions[ordinary]
    forward = ic.trace_rays(eye, origins, directions, 550.0, precision=precision)
    ok = forward.passed
    assert ok.sum() > 15
    back = ic.trace_rays(
        eye,
        forward.positions_mm[ok],
        -forward.directions[ok],
        550.0,
        towards="scene",
        precision=precision,
    )
    assert back.passed.all()
    error = np.linalg.norm(back.positions_mm - forward.hits_mm[0][ok], axis=1)
    assert error.max() < {"single": 2e-5, "double": 1e-13}[precision]


def test_numbers_too_small_to_be_normal_are_as_good_as_zero(precision):
    eye = ic.eyes.navarro(4.0)
    tiny = np.array([[1e-40, -1e-40, -1.0], [0.5, 1e-310, -1.0]])
    along = np.array([[1e-40, 0.0, 1.0], [0.0, -1e-310, 1.0]])
    got = ic.trace_rays(eye, tiny, along, 550.0, precision=precision)
    exact = ic.trace_rays(
        eye, [[0.0, 0.0, -1.0], [0.5, 0.0, -1.0]], [0.0, 0.0, 1.0], 550.0, precision=precision
    )
    assert got.passed.all()
    np.testing.assert_allclose(got.positions_mm, exact.positions_mm, rtol=0, atol=1e-30)


def test_an_eye_a_thousand_kilometres_from_the_origin_sees_the_same_floats():
    # The numbers are exact in float64 there: what differs is how the eye's place is subtracted.
    unit = 2.0**-16
    quad = ic.Quad((-3277 * unit, -2000 * unit, -19661 * unit), (6554 * unit, 0, 0), (0, 0.0625, 0))
    ball = ic.Sphere((1000 * unit, 0.0, -0.5), 0.125)
    light = ic.Emission(ic.Spectrum.constant(1.0))
    here = ic.Scene((ic.SceneObject("quad", quad, light), ic.SceneObject("ball", ball, light)))
    away = (1e6, -2e6, 3e6)
    there = here.moved("*", away).seen_from(away)
    for a, b in zip(here.objects, there.objects, strict=True):
        for field in dataclasses.fields(a.shape):
            one, other = (np.float32(getattr(o.shape, field.name)) for o in (a, b))
            assert np.all(np.abs(one - other) <= np.spacing(np.abs(one))), field.name

"""The host tracer against 50-digit arithmetic, published rays and hard cases."""

import math

import numpy as np
import pytest
from oracles import PEERS_RAYS, mp_trace, peers_eye

import isetcl as ic
from isetcl.eye.prescription import Element, ElementKind, elements
from isetcl.eye.rays import RayStatus
from isetcl.eye.sequential import meets_far_side, trace, trace_elements


def test_collimated_rays_reproduce_the_40_digit_references():
    heights = np.array([r[0] for r in PEERS_RAYS])
    origins = np.stack([0 * heights, heights, 0 * heights - 1.0], axis=1)
    rays = trace(peers_eye(), origins, np.array([[0.0, 0.0, 1.0]]), 550.0)
    np.testing.assert_allclose(rays.positions_mm[:, 1], [r[1] for r in PEERS_RAYS], atol=1e-14)
    np.testing.assert_allclose(rays.positions_mm[:, 2], [r[2] for r in PEERS_RAYS], atol=1e-13)


def test_a_ray_of_zemax_is_followed_through_every_surface():
    # Navarro, 550 nm, parallel ray at y; z from the posterior lens vertex (7.6 mm).
    eye = ic.eyes.navarro(4.0)
    retina = ic.Retina.from_radius(7.6 + 16.32, -12.0)
    eye = ic.Eye("zemax", eye.surfaces, eye.stop, retina)
    expected = [
        (1.1353921095, -7.5161712817),
        (1.1126073519, -6.9540694000),
        (1.0041390371, -4.0),
        (1.0023399019, -3.9510016329),
        (0.84573266255, -0.0596053114),
        (-2.3644385229e-3, 16.319999767),
    ]
    rays = trace(
        eye,
        np.array([[0.0, expected[0][0], -1.0]]),
        np.array([[0.0, 0.0, 1.0]]),
        550.0,
        record_hits=True,
    )
    np.testing.assert_allclose(rays.hits_mm[:, 0, 1], [e[0] for e in expected], atol=5e-5)
    np.testing.assert_allclose(rays.hits_mm[:, 0, 2] - 7.6, [e[1] for e in expected], atol=5e-5)


def hard_rays():
    """Rays at fields of 0 to 105 deg towards points of the entrance pupil, (n, 3) each."""
    rng = np.random.default_rng(7)
    origins, directions = [], []
    for field in (0.0, 20.0, 40.0, 60.0, 80.0, 90.0, 95.0, 100.0):
        for _ in range(6):
            angle = math.radians(field)
            direction = np.array([0.0, math.sin(angle), math.cos(angle)])
            point = np.array([*rng.uniform(-0.9, 0.9, 2), 2.6])
            origins.append(point - 12.0 * direction)
            directions.append(direction)
    return np.array(origins), np.array(directions)


def test_rays_up_to_100_degrees_agree_with_50_digits():
    eye = ic.eyes.navarro(8.0)
    sequence = elements(eye, 550.0)
    origins, directions = hard_rays()
    rays = trace_elements(sequence, origins, directions, "retina")
    compared = 0
    for i in range(len(origins)):
        exact = mp_trace(sequence, origins[i], directions[i], 1)
        assert (exact is not None) == bool(rays.passed[i])
        if exact is None:
            continue
        point, direction, opl = exact
        assert max(abs(float(point[j]) - rays.positions_mm[i, j]) for j in range(3)) < 3e-12
        assert max(abs(float(direction[j]) - rays.directions[i, j]) for j in range(3)) < 1e-12
        assert abs(float(opl) - rays.opl_mm[i]) < 1e-11
        compared += 1
    assert compared > 30


def test_tracing_back_returns_to_where_the_ray_came_from():
    eye = ic.eyes.navarro(8.0)
    origins, directions = hard_rays()
    forward = trace(eye, origins, directions, 550.0, record_hits=True)
    ok = forward.passed
    assert ok.sum() > 30
    back = trace(eye, forward.positions_mm[ok], -forward.directions[ok], 550.0, towards="scene")
    assert back.passed.all()
    np.testing.assert_allclose(back.positions_mm, forward.hits_mm[0][ok], atol=1e-11)
    np.testing.assert_allclose(back.directions, -directions[ok], atol=1e-12)


def single(curvature, conic, n=(1.0, 1.4), semi=1e9, kind=ElementKind.REFRACT):
    return Element(kind, "surface", 0.0, curvature, conic, semi, *n)


@pytest.mark.parametrize("tilt", [0.0, 1e-12, 1e-8, 1e-6, 1e-3, 1e-2])
def test_a_paraboloid_met_along_its_axis_is_hit_exactly(tilt):
    # optiland 0.6.0 is off by 4.4 mm here at a tilt of 1e-8.
    element = single(1.0 / -6.0, -1.0)
    heights = np.linspace(0.1, 6.0, 12)
    origins = np.stack([heights, 0 * heights, 0 * heights - 5.0], axis=1)
    directions = np.tile([math.sin(tilt), 0.0, math.cos(tilt)], (12, 1))
    rays = trace_elements((element,), origins, directions, "retina")
    for i in range(12):
        exact = mp_trace((element,), origins[i], directions[i], 1)
        assert max(abs(float(exact[0][j]) - rays.positions_mm[i, j]) for j in range(3)) < 1e-14 * 50


@pytest.mark.parametrize("conic", [-50.0, -7.5, -1.0, 0.0, 1.0, 5.0, 20.0])
@pytest.mark.parametrize("curvature", [1 / 15, 1 / 5, -1 / 5, -1 / 6])
def test_conics_near_their_rim_agree_with_50_digits(curvature, conic):
    element = single(curvature, conic)
    rim = 0.9 / (abs(curvature) * math.sqrt(1 + conic)) if conic > -1 else 5.0
    for angle in (0.0, 0.3, -0.8):
        direction = np.array([[math.sin(angle), 0.0, math.cos(angle)]])
        target = np.array([rim * 0.999, 0.0, 0.0])
        z = curvature * rim**2 / (1 + math.sqrt(1 - (1 + conic) * (curvature * rim) ** 2))
        origin = (target + np.array([0.0, 0.0, z]) - 3.0 * direction[0])[None]
        rays = trace_elements((element,), origin, direction, "retina")
        exact = mp_trace((element,), origin[0], direction[0], 1)
        assert (exact is not None) == bool(rays.passed[0])
        if exact is not None:
            error = max(abs(float(exact[0][j]) - rays.positions_mm[0, j]) for j in range(3))
            assert error < 1e-13


def test_an_axial_ray_stays_on_the_axis_exactly():
    rays = trace(
        ic.eyes.navarro(), np.array([[0.0, 0.0, -1.0]]), np.array([[0.0, 0.0, 1.0]]), 550.0
    )
    assert rays.positions_mm[0, 0] == 0.0
    assert rays.positions_mm[0, 1] == 0.0
    assert rays.directions[0].tolist() == [0.0, 0.0, 1.0]


def test_a_plane_crossed_against_the_direction_of_travel_is_a_miss():
    rays = trace_elements(
        (single(0.0, 0.0),), np.array([[0.0, 0.0, -1.0]]), np.array([[0.0, 0.0, -1.0]]), "retina"
    )
    assert rays.status[0] == RayStatus.MISSED


def test_a_ray_parallel_to_a_plane_misses_it_unless_it_lies_in_it():
    rays = trace_elements(
        (single(0.0, 0.0, semi=10.0),),
        np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0]]),
        np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]),
        "retina",
    )
    assert rays.status[0] == RayStatus.MISSED
    assert np.all(np.isfinite(rays.positions_mm))


def test_equal_indices_leave_a_ray_undeviated():
    element = single(0.2, -0.5, n=(1.336, 1.336))
    direction = np.array([[0.3, -0.2, 0.9]])
    rays = trace_elements(
        (element,), np.array([[0.1, 0.2, -3.0]]), direction / np.linalg.norm(direction), "retina"
    )
    np.testing.assert_array_equal(rays.directions, direction / np.linalg.norm(direction))


@pytest.mark.parametrize(
    ("offset_deg", "status"), [(-1e-3, RayStatus.OK), (1e-3, RayStatus.REFLECTED)]
)
def test_total_reflection_begins_at_the_critical_angle(offset_deg, status):
    angle = math.asin(1.0 / 1.5) + math.radians(offset_deg)
    element = single(0.0, 0.0, n=(1.5, 1.0))
    rays = trace_elements(
        (element,),
        np.array([[0.0, 0.0, -1.0]]),
        np.array([[math.sin(angle), 0.0, math.cos(angle)]]),
        "retina",
    )
    assert rays.status[0] == status


def test_the_edge_of_the_stop_lets_a_ray_pass():
    stop = single(0.0, 0.0, n=(1.0, 1.0), semi=2.0, kind=ElementKind.STOP)
    beside = np.nextafter(2.0, 3.0)
    rays = trace_elements(
        (stop,),
        np.array([[2.0, 0, -1], [beside, 0, -1]]),
        np.array([[0.0, 0, 1]]).repeat(2, 0),
        "retina",
    )
    assert rays.status.tolist() == [RayStatus.OK, RayStatus.STOPPED]


def test_unusable_rays_are_marked_and_leave_their_neighbours_alone():
    bad = [[np.nan, 0, -1], [0, 0, -1], [0, 0, -1], [np.inf, 0, -1], [0.5, 0, -1]]
    directions = [[0, 0, 1.0], [0, 0, 0.0], [0, np.nan, 1], [0, 0, 1], [0, 0, 7.0]]
    rays = trace(ic.eyes.navarro(), np.array(bad), np.array(directions), 550.0)
    assert rays.status.tolist() == [RayStatus.INVALID] * 4 + [RayStatus.OK]
    assert np.isfinite(rays.positions_mm).all()
    assert np.isfinite(rays.directions).all()
    alone = trace(ic.eyes.navarro(), np.array([[0.5, 0, -1]]), np.array([[0, 0, 1.0]]), 550.0)
    np.testing.assert_array_equal(rays.positions_mm[4], alone.positions_mm[0])


def test_a_lost_ray_stays_where_it_was_lost_and_says_where():
    rays = trace(
        ic.eyes.navarro(2.0), np.array([[0.0, 3.0, -1.0]]), np.array([[0.0, 0.0, 1.0]]), 550.0
    )
    assert rays.status[0] == RayStatus.STOPPED
    assert rays.elements[rays.surface[0]] == "stop"
    assert rays.positions_mm[0, 2] == pytest.approx(3.6)
    assert "stop" in rays.summary()


def test_the_far_side_is_met_from_inside_a_sphere_and_nowhere_in_an_eye_to_100_degrees():
    inside = np.array([[0.0, 0.0, 5.0]])
    outwards = np.array([[1.0, 0.0, 0.2]]) / math.hypot(1.0, 0.2)
    assert meets_far_side((single(0.2, 0.0),), inside, outwards, "scene")[0]
    assert not meets_far_side((single(0.2, 0.0),), inside, -outwards, "scene")[0]
    eye = ic.eyes.navarro(4.0)
    sequence = tuple(e for e in reversed(elements(eye, 550.0)) if e.kind is not ElementKind.RETINA)
    for field in (0.0, 50.0, 100.0):
        start = eye.field_map(550.0).retinal_point_mm(np.array(0.0), np.array(field))
        aim = np.array([0.0, 0.0, 3.68]) - start
        unit = (aim / np.linalg.norm(aim))[None]
        assert not meets_far_side(sequence, start[None], unit, "scene")[0]


def test_opl_forward_equals_opl_backward():
    eye = ic.eyes.navarro(6.0)
    forward = trace(
        eye, np.array([[0.3, 1.1, -2.0]]), np.array([[0.01, 0.02, 1.0]]), 550.0, record_hits=True
    )
    back = trace(eye, forward.positions_mm, -forward.directions, 550.0, towards="scene")
    cornea = forward.hits_mm[0, 0]
    ahead = np.linalg.norm(cornea - np.array([0.3, 1.1, -2.0]))
    assert forward.opl_mm[0] - ahead == pytest.approx(back.opl_mm[0], abs=1e-12)

"""`isetcl.trace_rays` on the device: accuracy, hard cases, and independence of the layout."""

import math

import numpy as np
import pytest
from oracles import PEERS_RAYS, mp_trace, peers_eye
from slow_cases import slow_after
from test_sequential import hard_rays

import isetcl as ic
from isetcl.device.tracer import RayTracer
from isetcl.errors import InvalidInputError
from isetcl.eye.prescription import Element, ElementKind, elements
from isetcl.eye.rays import RayStatus
from isetcl.eye.sequential import intersect, trace_elements
from isetcl.eye.sequential import trace as host_trace

# Largest error on the retina, mm: 0.01 um in single precision, 1e-12 mm in double.
TOLERANCE = {"single": 1e-5, "double": 1e-12}


def run(device, precision, sequence, origins, directions, towards="retina", **options):
    """Elements in travel order on the device, without the host's preparation."""
    tracer = RayTracer(device, precision, record_opl=True, **options)
    trace = tracer.prepare(tracer.upload(origins, directions), sequence, towards)
    trace.run()
    return trace.fetch()


def single_surface(curvature, conic, n=(1.0, 1.4), semi=1e9, kind=ElementKind.REFRACT):
    return Element(kind, "surface", 0.0, curvature, conic, semi, *n)


def test_collimated_rays_reproduce_the_40_digit_references(precision):
    heights = np.array([r[0] for r in PEERS_RAYS])
    origins = np.stack([0 * heights, heights, 0 * heights - 1.0], axis=1)
    rays = ic.trace_rays(peers_eye(), origins, [0.0, 0.0, 1.0], 550.0, precision=precision)
    np.testing.assert_allclose(
        rays.positions_mm[:, 1], [r[1] for r in PEERS_RAYS], rtol=0, atol=TOLERANCE[precision]
    )


def test_a_ray_of_zemax_is_reproduced(precision):
    eye = ic.eyes.navarro(4.0)
    eye = ic.Eye("zemax", eye.surfaces, eye.stop, ic.Retina.from_radius(23.92, -12.0))
    rays = ic.trace_rays(eye, [0, 1.1353921095, -1], [0, 0, 1], 550.0, precision=precision)
    assert rays.positions_mm[0, 1] == pytest.approx(-2.3644385229e-3, abs=5e-5)
    assert rays.hits_mm[3, 0, 1] == pytest.approx(1.0023399019, abs=5e-5)


def test_rays_up_to_100_degrees_agree_with_50_digits(device, precision):
    eye = ic.eyes.navarro(8.0)
    sequence = elements(eye, 550.0)
    origins, directions = hard_rays()
    real = np.float32 if precision == "single" else np.float64
    # The reference starts from the same rounded rays: this is the kernel's error alone.
    origins, directions = origins.astype(real).astype(float), directions.astype(real).astype(float)
    rays = run(device, precision, sequence, origins, directions)
    limit = {"single": 3e-5, "double": 1e-12}[precision]
    compared = 0
    for i in range(len(origins)):
        exact = mp_trace(sequence, origins[i], directions[i], 1)
        assert (exact is not None) == bool(rays.passed[i])
        if exact is not None:
            error = max(abs(float(exact[0][j]) - rays.positions_mm[i, j]) for j in range(3))
            assert error < limit
            compared += 1
    assert compared > 30


@pytest.mark.parametrize("stop_mm", [0.1, 2.0, 8.0])
@pytest.mark.parametrize("distance_m", [0.05, 0.3, 10.0, 1e6, math.inf])
def test_single_precision_is_wrong_by_at_most_a_hundredth_of_a_micrometre(stop_mm, distance_m):
    eye = ic.eyes.navarro(stop_mm)
    vergence = 0.0 if math.isinf(distance_m) else 1e-3 / distance_m
    i = np.arange(64)
    radius = 0.5 * stop_mm * np.sqrt((i + 0.5) / 64)
    turn = i * np.pi * (3 - np.sqrt(5))
    field = np.radians((i % 7) * 10.0)
    pupil = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.full(64, 3.04)], axis=1)
    towards = np.stack([np.zeros(64), np.sin(field), np.cos(field)], axis=1)
    # Rays of object points at the distance: they lean by their place in the pupil.
    directions = towards + vergence * (pupil - [0, 0, 3.04])
    origins = pupil - 20.0 * directions
    expected = host_trace(eye, origins, directions, 550.0)
    got = ic.trace_rays(eye, origins, directions, 550.0, precision="single")
    both = expected.passed & got.passed
    assert both.sum() >= 32
    error = np.linalg.norm(got.positions_mm - expected.positions_mm, axis=1)[both]
    assert error.max() < 1e-5


def test_an_origin_a_kilometre_away_costs_nothing(precision):
    eye = ic.eyes.navarro(4.0)
    direction = np.array([1e-3, 2e-3, 1.0])
    near = np.array([0.3, 0.5, -1.0])
    far = near - 1e6 * direction
    one = ic.trace_rays(eye, near, direction, 550.0, precision=precision)
    other = ic.trace_rays(eye, far, direction, 550.0, precision=precision)
    np.testing.assert_allclose(
        other.positions_mm, one.positions_mm, rtol=0, atol=2e-6 if precision == "single" else 1e-9
    )
    if precision == "double":
        length = np.linalg.norm(1e6 * direction)
        assert other.opl_mm[0] - one.opl_mm[0] == pytest.approx(length, abs=1e-6)


def test_tracing_back_returns_to_where_the_ray_came_from(precision):
    eye = ic.eyes.navarro(8.0)
    origins, directions = hard_rays()
    forward = ic.trace_rays(eye, origins, directions, 550.0, precision=precision)
    ok = forward.passed
    back = ic.trace_rays(
        eye,
        forward.positions_mm[ok],
        -forward.directions[ok],
        550.0,
        towards="scene",
        precision=precision,
    )
    assert back.passed.all()
    limit = {"single": 2e-4, "double": 1e-10}[precision]
    np.testing.assert_allclose(back.positions_mm, forward.hits_mm[0][ok], rtol=0, atol=limit)


def test_optical_path_lengths_agree_with_the_host_to_1e_8_waves():
    eye = ic.eyes.navarro(6.0)
    origins, directions = hard_rays()
    got = ic.trace_rays(eye, origins, directions, 550.0)
    expected = host_trace(eye, origins, directions, 550.0)
    ok = expected.passed
    assert np.max(np.abs(got.opl_mm - expected.opl_mm)[ok]) / 550e-6 < 1e-7
    assert ic.trace_rays(eye, origins, directions, 550.0, precision="single").opl_mm is None


@pytest.mark.parametrize("tilt", [0.0, 1e-12, 1e-8, 1e-6, 1e-4, 1e-2])
def test_a_paraboloid_met_along_its_axis_is_hit(device, precision, tilt):
    element = single_surface(1.0 / -6.0, -1.0)
    heights = np.linspace(0.1, 6.0, 60)
    origins = np.stack([heights, 0 * heights, 0 * heights - 5.0], axis=1)
    directions = np.tile([math.sin(tilt), 0.0, math.cos(tilt)], (60, 1))
    real = np.float32 if precision == "single" else np.float64
    origins, directions = origins.astype(real).astype(float), directions.astype(real).astype(float)
    rays = run(device, precision, (element,), origins, directions)
    expected = trace_elements((element,), origins, directions, "retina")
    error = np.linalg.norm(rays.positions_mm - expected.positions_mm, axis=1)
    assert rays.passed.all()
    assert error.max() < {"single": 5e-6, "double": 1e-14}[precision]


@pytest.mark.parametrize(
    "conic", [-50.0, -7.5, -1.0 - 1e-6, -1.0, -1.0 + 1e-6, 0.0, 1.0, 5.0, 20.0]
)
@pytest.mark.parametrize("curvature", [0.0, 1e-9, 1e-6, 1 / 15, 1 / 5, -1 / 6])
def test_conics_of_all_kinds_agree_with_the_host(device, precision, curvature, conic):
    element = single_surface(curvature, conic)
    rim = 5.0
    if conic > -1 and curvature != 0:
        rim = min(5.0, 0.9 / (abs(curvature) * math.sqrt(1 + conic)))
    height = np.linspace(-rim, rim, 41)
    origins, directions = [], []
    for angle in (0.0, 0.4, -1.2):
        d = np.array([math.sin(angle), 0.1, math.cos(angle)])
        d /= np.linalg.norm(d)
        for h in height:
            origins.append(np.array([h, 0.0, 0.0]) - 3.0 * d)
            directions.append(d)
    real = np.float32 if precision == "single" else np.float64
    origins = np.array(origins).astype(real).astype(float)
    directions = np.array(directions).astype(real).astype(float)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rays = run(device, precision, (element,), origins, directions)
    expected = trace_elements((element,), origins, directions, "retina")
    # The conditioning of an intersection is 1 / cos I; an eye's surfaces end 10 mm from the vertex.
    cosine = intersect(origins, directions, element, 1.0).cosine
    near = np.linalg.norm(expected.positions_mm, axis=1) < 10.0
    clear = expected.passed & rays.passed & near
    assert clear.sum() >= 0.9 * (expected.passed & near & (cosine > 0.05)).sum()
    assert clear.sum() > 20
    error = np.linalg.norm(rays.positions_mm - expected.positions_mm, axis=1)
    assert np.max((error * cosine)[clear]) < {"single": 3e-6, "double": 1e-14}[precision]


@pytest.mark.parametrize("angle_deg", [85.0, 88.0, 89.0, 89.9, 89.99])
def test_grazing_rays_err_only_by_rounding_over_the_cosine(device, precision, angle_deg):
    element = single_surface(0.0, 0.0)
    angle = math.radians(angle_deg)
    direction = np.array([[math.sin(angle), 0.0, math.cos(angle)]])
    real = np.float32 if precision == "single" else np.float64
    direction = direction.astype(real).astype(float)
    rays = run(device, precision, (element,), np.array([[0.0, 0.0, -1.0]]), direction)
    expected = direction[0, 0] / direction[0, 2]
    error = abs(rays.positions_mm[0, 0] - expected)
    assert error * math.cos(angle) < {"single": 1e-6, "double": 1e-14}[precision]


@pytest.mark.parametrize(
    ("offset_deg", "status"),
    [
        (-0.1, RayStatus.OK),
        (-1e-3, RayStatus.OK),
        (1e-3, RayStatus.REFLECTED),
        (5.0, RayStatus.REFLECTED),
    ],
)
def test_total_reflection_begins_at_the_critical_angle(device, precision, offset_deg, status):
    angle = math.asin(1.0 / 1.5) + math.radians(offset_deg)
    rays = run(
        device,
        precision,
        (single_surface(0.0, 0.0, n=(1.5, 1.0)),),
        np.array([[0.0, 0.0, -1.0]]),
        np.array([[math.sin(angle), 0.0, math.cos(angle)]]),
    )
    assert rays.status[0] == status
    assert np.isfinite(rays.directions).all()


def test_rays_that_graze_just_beside_a_sphere_miss_it(device, precision):
    element = single_surface(0.2, 0.0)
    heights = np.array([4.999, 5.001, 4.0, 6.0])
    origins = np.stack([heights, 0 * heights, 0 * heights - 3.0], axis=1)
    rays = run(device, precision, (element,), origins, np.tile([0.0, 0.0, 1.0], (4, 1)))
    assert rays.status.tolist() == [RayStatus.OK, RayStatus.MISSED, RayStatus.OK, RayStatus.MISSED]


def test_planes_are_missed_when_crossed_backwards_or_not_at_all(device, precision):
    rays = run(
        device,
        precision,
        (single_surface(0.0, 0.0),),
        np.array([[0.0, 0.0, -1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.0]]),
        np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    )
    assert rays.status[:2].tolist() == [RayStatus.MISSED, RayStatus.MISSED]
    assert rays.status[2] == RayStatus.OK
    assert np.isfinite(rays.positions_mm).all()


def test_an_axial_ray_stays_on_the_axis_exactly(precision):
    rays = ic.trace_rays(ic.eyes.navarro(), [0, 0, -5], [0, 0, 1], 550.0, precision=precision)
    assert rays.positions_mm[0, :2].tolist() == [0.0, 0.0]
    assert rays.directions[0].tolist() == [0.0, 0.0, 1.0]


def test_a_mirrored_bundle_gives_the_mirrored_result_bit_for_bit(precision):
    origins, directions = hard_rays()
    flip = np.array([-1.0, 1.0, 1.0])
    eye = ic.eyes.arizona(8.0)
    one = ic.trace_rays(eye, origins, directions, 550.0, precision=precision)
    other = ic.trace_rays(eye, origins * flip, directions * flip, 550.0, precision=precision)
    np.testing.assert_array_equal(one.positions_mm * flip, other.positions_mm)


@pytest.mark.parametrize("width", slow_after(2, [1, 16, 8, 32, 64]))
def test_the_vector_width_does_not_change_a_bit(device, precision, width):
    if not device.is_cpu:
        pytest.skip("vectors wider than one lane are for CPUs")
    sequence = elements(ic.eyes.navarro(8.0), 550.0)
    origins, directions = hard_rays()
    narrow = run(device, precision, sequence, origins, directions, vector_width=4)
    other = run(device, precision, sequence, origins, directions, vector_width=width)
    np.testing.assert_array_equal(narrow.positions_mm, other.positions_mm)
    np.testing.assert_array_equal(narrow.status, other.status)


def test_the_order_of_rays_does_not_change_a_bit(precision):
    eye = ic.eyes.navarro(3.0)
    origins, directions = hard_rays()
    order = np.random.default_rng(3).permutation(len(origins))
    one = ic.trace_rays(eye, origins, directions, 550.0, precision=precision)
    other = ic.trace_rays(eye, origins[order], directions[order], 550.0, precision=precision)
    np.testing.assert_array_equal(one.positions_mm[order], other.positions_mm)
    np.testing.assert_array_equal(one.status[order], other.status)


def test_what_becomes_of_a_ray_is_the_same_on_host_and_device(precision):
    eye = ic.eyes.navarro(3.0)
    rng = np.random.default_rng(5)
    origins = np.concatenate([rng.uniform(-9, 9, (4000, 2)), np.full((4000, 1), -3.0)], axis=1)
    directions = np.concatenate([rng.normal(0, 0.3, (4000, 2)), np.ones((4000, 1))], axis=1)
    got = ic.trace_rays(eye, origins, directions, 550.0, precision=precision)
    expected = host_trace(eye, origins, directions, 550.0)
    assert len(set(expected.status.tolist())) >= 3
    different = np.mean((got.status != expected.status) | (got.surface != expected.surface))
    # Single precision may decide otherwise for rays within rounding of an edge.
    assert different <= {"single": 5e-4, "double": 0.0}[precision]
    lost = (expected.status == RayStatus.STOPPED) & (got.status == RayStatus.STOPPED)
    assert lost.sum() > 100
    limit = {"single": 2e-5, "double": 1e-11}[precision]
    np.testing.assert_allclose(
        got.positions_mm[lost], expected.positions_mm[lost], rtol=0, atol=limit
    )


def test_hits_are_recorded_on_every_element():
    eye = ic.eyes.navarro(3.0)
    got = ic.trace_rays(eye, [0.2, 0.4, -1.0], [0, 0, 1], 550.0)
    expected = host_trace(
        eye, np.array([[0.2, 0.4, -1.0]]), np.array([[0, 0, 1.0]]), 550.0, record_hits=True
    )
    assert got.elements == (
        "cornea front",
        "cornea back",
        "stop",
        "lens front",
        "lens back",
        "retina",
    )
    np.testing.assert_allclose(got.hits_mm, expected.hits_mm, atol=1e-13)
    assert ic.trace_rays(eye, [0, 0, -1], [0, 0, 1], 550.0, record_hits=False).hits_mm is None


def test_every_ray_may_have_its_own_wavelength():
    eye = ic.eyes.navarro(3.0)
    wavelengths = np.array([450.0, 650.0, 450.0, 550.0])
    origins = np.array([[0.0, h, -1.0] for h in (0.1, 0.4, 0.7, 1.0)])
    got = ic.trace_rays(eye, origins, [0, 0, 1], wavelengths)
    for i, wavelength in enumerate(wavelengths):
        alone = ic.trace_rays(eye, origins[i], [0, 0, 1], wavelength)
        np.testing.assert_allclose(got.positions_mm[i], alone.positions_mm[0], atol=1e-15)
        np.testing.assert_allclose(got.hits_mm[:, i], alone.hits_mm[:, 0], atol=1e-15)


def test_unusable_rays_are_marked_and_leave_their_neighbours_alone(precision):
    origins = np.array([[np.nan, 0, -1], [0, 0.5, -1], [0, 0, np.inf], [0, 0, -1]])
    directions = np.array([[0, 0, 1.0], [0, 0, 1], [0, 0, 1], [0, 0, 0]])
    rays = ic.trace_rays(ic.eyes.navarro(), origins, directions, 550.0, precision=precision)
    assert rays.status.tolist() == [
        RayStatus.INVALID,
        RayStatus.OK,
        RayStatus.INVALID,
        RayStatus.INVALID,
    ]
    assert np.isfinite(rays.positions_mm).all()
    alone = ic.trace_rays(ic.eyes.navarro(), origins[1], directions[1], 550.0, precision=precision)
    np.testing.assert_array_equal(rays.positions_mm[1], alone.positions_mm[0])


@pytest.mark.parametrize(
    ("origins", "directions", "wavelength", "match"),
    [
        (np.zeros((2, 2)), [0, 0, 1], 550.0, r"shape \(n, 3\)"),
        (np.zeros((2, 3)), np.zeros((3, 3)), 550.0, "same number of rows"),
        (np.zeros((0, 3)), [0, 0, 1], 550.0, "at least one row"),
        ([0, 0, -1], [0, 0, 1], 300.0, "between 365 and 1014 nm"),
        (np.zeros((3, 3)), [0, 0, 1], [500.0, 600.0], "one per ray"),
        ("abc", [0, 0, 1], 500.0, "numbers"),
    ],
)
def test_bad_input_is_refused_with_the_rule(origins, directions, wavelength, match):
    with pytest.raises(ic.InvalidInputError, match=match):
        ic.trace_rays(ic.eyes.navarro(), origins, directions, wavelength)


def test_an_unknown_direction_of_travel_or_precision_is_refused():
    with pytest.raises(ic.InvalidInputError, match="towards"):
        ic.trace_rays(ic.eyes.navarro(), [0, 0, -1], [0, 0, 1], 550.0, towards="brain")
    with pytest.raises(ic.InvalidInputError, match=r"precision.*double"):
        ic.trace_rays(ic.eyes.navarro(), [0, 0, -1], [0, 0, 1], 550.0, precision="duoble")


@pytest.mark.parametrize("record", [True, False])
def test_path_lengths_are_known_both_ways_and_without_hits(record):
    from isetcl.eye.sequential import trace

    eye = ic.eyes.navarro(6.0)
    o, d = (
        np.array([[0.3, 1.1, -2.0], [0.0, 0.0, -2.0]]),
        np.array([[0.01, 0.02, 1.0], [0.0, 0.0, 1.0]]),
    )
    there = ic.trace_rays(eye, o, d, 550.0, record_hits=record)
    np.testing.assert_allclose(there.opl_mm, trace(eye, o, d, 550.0).opl_mm, rtol=0, atol=1e-10)
    # Axis: 2 mm of air, then the sum of n t (paper, table 1)
    n = eye.indices(550.0)
    axial = 2.0 + 0.55 * n[1] + 3.05 * n[2] + 4.0 * n[3] + 16.3203 * n[4]
    assert there.opl_mm[1] == pytest.approx(axial, abs=1e-10)
    back = ic.trace_rays(
        eye, there.positions_mm, -there.directions, 550.0, towards="scene", record_hits=record
    )
    assert back.opl_mm[1] == pytest.approx(axial - 2.0, abs=1e-10)
    both = ic.trace_rays(eye, o[[1, 1]], d[[1, 1]], np.array([550.0, 450.0]), record_hits=record)
    n = eye.indices(450.0)
    assert both.opl_mm == pytest.approx(
        [axial, 2.0 + 0.55 * n[1] + 3.05 * n[2] + 4.0 * n[3] + 16.3203 * n[4]], abs=1e-10
    )


@pytest.mark.parametrize("precision", ["single", "double"])
def test_lost_rays_are_lost_without_hits_too(precision):
    eye = ic.eyes.navarro(3.0)
    rng = np.random.default_rng(5)
    o = np.concatenate([rng.uniform(-9, 9, (4000, 2)), np.full((4000, 1), -3.0)], axis=1)
    d = np.concatenate([rng.normal(0, 0.3, (4000, 2)), np.ones((4000, 1))], axis=1)
    with_hits, without = (
        ic.trace_rays(eye, o, d, 550.0, precision=precision, record_hits=h) for h in (True, False)
    )
    np.testing.assert_array_equal(with_hits.status, without.status)
    np.testing.assert_array_equal(with_hits.surface, without.surface)
    # one stopped ray alone, nobody else lost in its group
    alone = ic.trace_rays(
        eye, [[0.0, 2.5, -1.0]], [0, 0, 1], 550.0, precision=precision, record_hits=False
    )
    assert alone.status[0] == ic.RayStatus.STOPPED


def test_directions_that_share_a_z_are_not_shared():
    eye = ic.eyes.navarro(3.0)
    d = np.array([[0.1, 0.0, 1.0], [-0.1, 0.0, 1.0], [0.0, 0.1, 1.0]])
    rays = ic.trace_rays(eye, np.array([0.0, 0.0, -1.0]), d, 550.0)
    m = rays.positions_mm
    assert m[0, 0] > 0.5
    assert m[0, 0] == pytest.approx(-m[1, 0], abs=1e-12)
    assert m[2, 1] == pytest.approx(m[0, 0], abs=1e-12)


@pytest.mark.parametrize("curvature", [0.0, 0.125, -0.2])
def test_a_ray_along_the_vertex_plane_touches_the_vertex(device, precision, curvature):
    """It lies in the tangent plane: the surface is met at the vertex itself, at a right angle."""
    rays = run(
        device,
        precision,
        (single_surface(curvature, 0.0),),
        np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]),
        np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    )
    assert rays.status.tolist() == [RayStatus.OK] * 2
    if curvature != 0.0:
        assert rays.positions_mm == pytest.approx(np.zeros((2, 3)), abs=1e-12)
    # Grazing light enters at the critical angle.
    sine = np.linalg.norm(rays.directions[:, :2], axis=1)
    assert sine == pytest.approx([1.0 / 1.4] * 2, rel=1e-6)


@pytest.mark.parametrize("step", [1e-6, -1e-6])
def test_an_index_step_of_a_millionth_bends_by_the_law_of_sines(device, precision, step):
    n, after = 1.336, 1.336 + step
    angle = np.radians([10.0, 45.0, 80.0])
    along = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    start = np.tile([0.0, 0.0, -1.0], (3, 1))
    rays = run(device, precision, (single_surface(0.0, 0.0, n=(n, after)),), start, along)
    found = np.arctan2(rays.directions[:, 0], rays.directions[:, 2])
    expected = np.arcsin(n * np.sin(angle) / after)
    assert found == pytest.approx(expected, abs={"single": 3e-7, "double": 1e-14}[precision])


def test_light_takes_as_long_back_as_forth():
    """From the cornea to the retina and back, to 1e-9 waves."""
    eye = ic.eyes.navarro(8.0)
    rng = np.random.default_rng(2)
    origins = np.column_stack([rng.uniform(-2.0, 2.0, (40, 2)), np.full(40, -1.0)])
    pointing = np.column_stack([rng.uniform(-0.1, 0.1, (40, 2)), np.ones(40)])
    pointing /= np.linalg.norm(pointing, axis=1, keepdims=True)
    there = ic.trace_rays(eye, origins, pointing, 550.0)
    outside = np.linalg.norm(there.hits_mm[0] - origins, axis=1)
    back = ic.trace_rays(eye, there.positions_mm, -there.directions, 550.0, towards="scene")
    both = there.passed & back.passed
    assert both.sum() > 30
    assert (there.opl_mm - outside)[both] == pytest.approx(back.opl_mm[both], abs=1e-9 * 550e-6)


def test_a_tracer_refuses_what_is_not_compiled_into_it(device):
    tracer = RayTracer(device, "single")
    rays = tracer.upload(np.array([[0.0, 0.0, -1.0]]), np.array([[0.0, 0.0, 1.0]]))
    with pytest.raises(InvalidInputError, match="without has_polynomial_gradients"):
        tracer.prepare(rays, elements(ic.eyes.liou_brennan(), 550.0), "retina")

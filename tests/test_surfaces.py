"""Surfaces of all shapes, in all places, on the device: accuracy, hard cases, independence."""

import dataclasses
import math

import mpmath as mp
import numpy as np
import pytest
from form_oracles import PLACE, SHAPES, ZERNIKES, irregular_eye, mp_form_trace, rays_onto, surface

import isetcl as ic
from isetcl.device import elements as packing
from isetcl.device.eye_features import EyeFeatures, ShapeKind
from isetcl.device.tracer import RayTracer
from isetcl.eye.placement import Placement
from isetcl.eye.prescription import ElementKind, elements
from isetcl.eye.rays import RayStatus
from isetcl.eye.sequential import intersect, trace_elements
from isetcl.eye.shapes.biconic import Biconic
from isetcl.eye.shapes.even_asphere import EvenAsphere
from isetcl.eye.shapes.height_map import HeightMap
from isetcl.eye.shapes.toric import Toric
from isetcl.eye.shapes.zernike_sag import ZernikeSag
from isetcl.eye.waves.zernike import osa_nm

FORMS = (
    *("has_placements", "has_placed_stop", "has_quadrics", "has_biconics", "has_torics"),
    *("has_even_aspheres", "has_zernike_sags", "has_height_maps"),
)
EVERYTHING = EyeFeatures(**dict.fromkeys(FORMS, True))
REAL = {"single": np.float32, "double": np.float64}
# Largest error, mm: 2e-3 um in single precision, 1e-11 um in double.
TOLERANCE = {"single": 2e-6, "double": 1e-14}
NEWTON = [name for name, e in SHAPES.items() if name not in ("conic", "ellipsoid")]


def run(device, precision, sequence, rays, towards="retina", **options):
    """Rays of a precision through elements in travel order, by the kernel that knows all shapes."""
    # Kernels of few lanes are built in half the time; wide ones have a test of their own.
    width = min(8, device.vector_width(precision))
    options = {"features": EVERYTHING, "record_hits": True, "vector_width": width} | options
    tracer = RayTracer(device, precision, record_opl=True, **options)
    trace = tracer.prepare(tracer.upload(*rays), sequence, towards)
    trace.run()
    return trace.fetch()


def rounded(rays, precision):
    """Rays whose numbers are exact in a precision."""
    return tuple(a.astype(REAL[precision]).astype(np.float64) for a in rays)


def placed(name):
    return dataclasses.replace(SHAPES[name], placement=PLACE)


@pytest.mark.parametrize("towards", ["retina", "scene"])
@pytest.mark.parametrize("name", list(SHAPES))
def test_every_shape_in_its_place_agrees_with_50_digits(device, precision, name, towards):
    element, sense = placed(name), 1.0 if towards == "retina" else -1.0
    rays = rounded(rays_onto(element, (0.0, 30.0, 55.0), 2, sense), precision)
    got = run(device, precision, (element,), rays, towards)
    lengths = intersect(*rays, element, sense).length
    compared = 0
    for i in np.flatnonzero(got.passed):
        point, direction, opl = mp_form_trace(
            (element,), rays[0][i], rays[1][i], sense, (lengths[i],)
        )
        assert (
            max(abs(float(point[j] - got.positions_mm[i, j])) for j in range(3))
            < (TOLERANCE[precision])
        )
        assert max(abs(float(direction[j] - got.directions[i, j])) for j in range(3)) < (
            5e-7 if precision == "single" else 1e-15
        )
        if precision == "double":
            assert abs(float(opl) - got.opl_mm[i]) < 2e-14
        compared += 1
    assert compared >= 3


@pytest.mark.parametrize("name", list(SHAPES))
def test_skew_rays_onto_every_shape_agree_with_the_host(device, precision, name):
    for element in (SHAPES[name], placed(name)):
        rays = rounded(rays_onto(element, (0.0, 20.0, 40.0, 60.0, 75.0), 60), precision)
        got = run(device, precision, (element,), rays)
        expected = trace_elements((element,), *rays, "retina")
        cosine = intersect(*rays, element, 1.0).cosine
        # The conditioning of an intersection is 1 / cos I.
        clear = expected.passed & (cosine > 0.1)
        assert clear.sum() > 200
        assert np.mean(got.passed[clear]) == 1.0
        error = np.linalg.norm(got.positions_mm - expected.positions_mm, axis=1) * cosine
        assert error[clear].max() < TOLERANCE[precision]


def searched(monkeypatch, kind):
    """Quadrics are met by the search of a shape instead of directly."""
    monkeypatch.setattr(packing, "shape_kind", lambda element: kind)


@pytest.mark.parametrize("conic", [-7.5, -1.0, -0.26, 0.0, 1.0, 5.0])
def test_a_biconic_of_equal_sections_is_the_conic(device, precision, conic, monkeypatch):
    reach = 4.0 if conic <= -1 else min(4.0, 0.9 * 7.8 / math.sqrt(1 + conic))
    flat = surface(None, k=conic, semi=reach, place=PLACE)
    twin = dataclasses.replace(flat, shape=Biconic(flat.curvature, conic))
    rays = rounded(rays_onto(flat, (0.0, 25.0, 50.0), 40), precision)
    expected = run(device, precision, (flat,), rays, features=EyeFeatures(has_placements=True))
    direct = run(device, precision, (twin,), rays)
    searched(monkeypatch, ShapeKind.BICONIC)
    got = run(device, precision, (twin,), rays)
    ok = expected.passed
    assert ok.sum() > 60
    cosine = intersect(*rays, flat, 1.0).cosine
    for other in (direct, got):
        assert other.passed[ok].all()
        error = np.linalg.norm(other.positions_mm - expected.positions_mm, axis=1) * cosine
        assert error[ok].max() < TOLERANCE[precision]


def test_a_biconic_with_matched_factors_is_a_quadric(device, precision, monkeypatch):
    # (1 + kx) cx = (1 + ky) cy: an ellipsoid, met directly, or by the search for biconics.
    element = placed("ellipsoid")
    rays = rounded(rays_onto(element, (0.0, 25.0, 50.0), 40), precision)
    expected = run(device, precision, (element,), rays)
    searched(monkeypatch, ShapeKind.BICONIC)
    got = run(device, precision, (element,), rays)
    assert expected.passed.sum() > 100
    np.testing.assert_array_equal(got.status, expected.status)
    np.testing.assert_allclose(
        got.positions_mm, expected.positions_mm, rtol=0, atol=TOLERANCE[precision]
    )


def test_an_even_asphere_without_coefficients_is_the_conic_and_one_of_rho_2_bends_it(
    device, precision
):
    plain = surface(None, k=-1.0)
    rays = rounded(rays_onto(plain, (0.0, 25.0, 50.0), 40), precision)
    expected = run(device, precision, (plain,), rays)
    zero = dataclasses.replace(plain, shape=EvenAsphere((0.0, 0.0)))
    # On a paraboloid c rho^2 / 2 the coefficient of rho^2 is half a curvature.
    share = 0.01
    split = dataclasses.replace(
        plain, curvature=plain.curvature - 2.0 * share, shape=EvenAsphere((share,))
    )
    for element in (zero, split):
        got = run(device, precision, (element,), rays)
        np.testing.assert_allclose(
            got.positions_mm[expected.passed],
            expected.positions_mm[expected.passed],
            rtol=0,
            atol=TOLERANCE[precision],
        )


def ulps(values, others, real):
    return np.max(np.abs(values - others)) / (np.finfo(real).eps * np.max(np.abs(others)))


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (surface(Biconic(1 / 8.5, 0.3)), surface(Biconic(1 / 7.8, -0.25), 1 / 8.5, 0.3)),
        (
            surface(ZernikeSag((0, 0, 0, 0.0, 0.0, 2e-3), 4.0)),
            surface(ZernikeSag((0, 0, 0, 0.0, 0.0, -2e-3), 4.0)),
        ),
    ],
    ids=["biconic", "zernike"],
)
def test_a_quarter_turn_swaps_the_axes(device, precision, first, second):
    turned = dataclasses.replace(second, placement=Placement(axis_deg=90.0))
    rays = rounded(rays_onto(first, (0.0, 25.0, 50.0), 40), precision)
    one = run(device, precision, (first,), rays)
    other = run(device, precision, (turned,), rays)
    np.testing.assert_array_equal(one.status, other.status)
    assert ulps(one.positions_mm, other.positions_mm, REAL[precision]) <= 4
    assert ulps(one.directions, other.directions, REAL[precision]) <= 4


def test_a_quadric_turned_by_its_axis_is_the_rotated_quadric(device, precision):
    # cx x'^2 + cy y'^2 with x' = x cos a + y sin a: the sections at a and a + 90 deg.
    element = surface(Biconic(1 / 6.0, -1.0), 1 / 9.0, -1.0, place=Placement(axis_deg=25.0))
    a = math.radians(25.0)
    for angle, curvature in ((a, 1 / 6.0), (a + math.pi / 2, 1 / 9.0)):
        x, y = 2.0 * math.cos(angle), 2.0 * math.sin(angle)
        rays = np.array([[x, y, -3.0]]), np.array([[0.0, 0.0, 1.0]])
        got = run(device, precision, (element,), rays)
        assert got.positions_mm[0, 2] == pytest.approx(curvature * 2.0, abs=TOLERANCE[precision])


@pytest.mark.parametrize(
    ("element", "beyond"),
    [
        (surface(Biconic(1 / 5.0, 1.0), 1 / 8.0, 0.0, semi=1e9), (3.6, 0.0)),
        (surface(Biconic(1 / 5.0, 1.0), 1 / 8.0, 0.0, semi=1e9), (2.6, 6.5)),
        (surface(Biconic(1 / 5.0, 1.0), 1 / 8.0, 0.0, semi=1e9), (9.0, 9.0)),
        (surface(Toric(1 / 8.0), 1 / 5.0, 1.0, semi=1e9), (0.0, 3.6)),
        (surface(Toric(1 / 8.0), 1 / 5.0, 1.0, semi=1e9), (8.6, 0.0)),
        (surface(EvenAsphere((0.0, 1e-5)), 1 / 5.0, 1.0, semi=1e9), (3.7, 0.0)),
        (surface(ZernikeSag(ZERNIKES, 4.0), 1 / 5.0, 1.0, semi=1e9), (2.7, 2.7)),
    ],
)
def test_a_ray_beyond_the_rim_misses(device, precision, element, beyond):
    inside = 0.7 * np.array(beyond) * min(1.0, 3.0 / math.hypot(*beyond))
    origins = np.array([[*beyond, -3.0], [*inside, -3.0]])
    rays = rounded((origins, np.tile([0.0, 0.0, 1.0], (2, 1))), precision)
    got = run(device, precision, (element,), rays)
    assert got.status.tolist() == [RayStatus.MISSED, RayStatus.OK]
    assert np.isfinite(got.positions_mm).all()
    host = trace_elements((element,), *rays, "retina")
    assert host.status.tolist() == [RayStatus.MISSED, RayStatus.OK]


def test_a_search_that_begins_beyond_the_rim_finds_back(device, precision):
    # Rays slanted inwards onto places near the rim in x, 3.54 mm; the quadric, which is flatter
    # there, is met beyond.
    element = surface(Biconic(1 / 5.0, 1.0), 1 / 8.0, 0.0, semi=1e9)
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(3.2, 3.45, 9), np.linspace(-1.0, 1.0, 5)))
    z = element.shape.sag_mm(element.curvature, element.conic, x, y)
    slant = np.radians(np.linspace(30.0, 60.0, len(x)))
    directions = np.stack([-np.sin(slant), 0 * slant, np.cos(slant)], axis=1)
    rays = rounded((np.stack([x, y, z], axis=1) - 5.0 * directions, directions), precision)
    length, missed = element.quadric.intersect(*rays, 1.0)
    begin = rays[0] + length[:, None] * rays[1]
    beyond = ~missed & (np.abs(begin[:, 0]) > 3.54)
    assert beyond.sum() >= 3
    got = run(device, precision, (element,), rays)
    host = trace_elements((element,), *rays, "retina")
    assert host.passed[beyond].all()
    # In single precision the few steps do not suffice where the way back is longest.
    found = beyond & got.passed
    assert found.sum() >= (0.7 if precision == "single" else 1.0) * beyond.sum()
    limit = 4 * TOLERANCE[precision]
    np.testing.assert_allclose(got.positions_mm[found, 0], x[found], rtol=0, atol=limit)
    np.testing.assert_allclose(host.positions_mm[beyond, 0], x[beyond], rtol=0, atol=limit)


@pytest.mark.parametrize("name", NEWTON)
def test_a_surface_crossed_backwards_or_passed_by_is_missed(device, precision, name):
    rays = (
        np.array([[0.5, 0.4, -1.0], [0.0, 0.0, -1.0], [20.0, 0.0, -1.0]]),
        np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    )
    got = run(device, precision, (SHAPES[name],), rays)
    host = trace_elements((SHAPES[name],), *rays, "retina")
    # A second sheet, as a sphere's rear, may be crossed that way, if the search finds it at all.
    assert all(a in (b, RayStatus.MISSED) for a, b in zip(got.status, host.status, strict=True))
    assert np.isfinite(got.positions_mm).all()
    if isinstance(SHAPES[name].shape, Biconic) and name != "saddle":
        assert got.status.tolist() == [RayStatus.MISSED] * 3


@pytest.mark.parametrize("name", ["astigmatic", "toric", "even asphere", "zernike"])
def test_a_mirrored_surface_mirrors_rays_bit_for_bit(device, precision, name):
    place = Placement((0.3, -0.2), (5.0, -4.0), 30.0)
    opposite = Placement((-0.3, -0.2), (5.0, 4.0), -30.0)
    first, second = SHAPES[name], SHAPES[name]
    if name == "zernike":
        odd = [osa_nm(j)[1] for j in range(28)]
        # x -> -x: phi -> pi - phi changes the sign of cos m phi for odd m, of sin m phi for even.
        signs = [(-1.0) ** m if m >= 0 else -((-1.0) ** m) for m in odd]
        mirrored = tuple(s * c for s, c in zip(signs, ZERNIKES, strict=True))
        second = dataclasses.replace(second, shape=ZernikeSag(mirrored, 4.2))
    flip = np.array([-1.0, 1.0, 1.0])
    first = dataclasses.replace(first, placement=place)
    second = dataclasses.replace(second, placement=opposite)
    origins, directions = rounded(rays_onto(first, (0.0, 30.0, 60.0), 40), precision)
    one = run(device, precision, (first,), (origins, directions))
    other = run(device, precision, (second,), (origins * flip, directions * flip))
    np.testing.assert_array_equal(one.positions_mm * flip, other.positions_mm)
    np.testing.assert_array_equal(one.directions * flip, other.directions)


def all_shapes_in_a_row(seed=5):
    """A sequence with every shape, 1 mm apart, of media so alike that rays pass, and rays."""
    sequence = tuple(
        dataclasses.replace(
            placed(name),
            vertex_z_mm=float(i),
            n_before=1.336 + 0.001 * (i % 2),
            n_after=1.336 + 0.001 * ((i + 1) % 2),
            semi_diameter_mm=3.4,
        )
        for i, name in enumerate(SHAPES)
    )
    rng = np.random.default_rng(seed)
    origins = np.concatenate([rng.uniform(-3, 3, (300, 2)), np.full((300, 1), -3.0)], axis=1)
    directions = np.concatenate([rng.normal(0, 0.05, (300, 2)), np.ones((300, 1))], axis=1)
    return sequence, (origins, directions / np.linalg.norm(directions, axis=1, keepdims=True))


@pytest.mark.parametrize(
    "width",
    [1, 16, pytest.param(32, marks=pytest.mark.slow), pytest.param(64, marks=pytest.mark.slow)],
)
def test_the_vector_width_does_not_change_a_bit(device, precision, width):
    if not device.is_cpu:
        pytest.skip("vectors wider than one lane are for CPUs")
    sequence, rays = all_shapes_in_a_row()
    narrow = run(device, precision, sequence, rays)
    other = run(device, precision, sequence, rays, vector_width=width)
    assert 50 < narrow.passed.sum() < 290
    np.testing.assert_array_equal(narrow.hits_mm, other.hits_mm)
    np.testing.assert_array_equal(narrow.directions, other.directions)
    np.testing.assert_array_equal(narrow.status, other.status)


def test_neither_order_nor_recording_nor_bad_neighbours_change_a_bit(device, precision):
    sequence, (origins, directions) = all_shapes_in_a_row()
    one = run(device, precision, sequence, (origins, directions))
    order = np.random.default_rng(3).permutation(len(origins))
    other = run(device, precision, sequence, (origins[order], directions[order]))
    np.testing.assert_array_equal(one.positions_mm[order], other.positions_mm)
    bare = run(device, precision, sequence, (origins, directions), record_hits=False)
    np.testing.assert_array_equal(one.positions_mm, bare.positions_mm)
    np.testing.assert_array_equal(one.status, bare.status)
    spoilt = origins.copy()
    spoilt[::3, 0], spoilt[1::3, 1] = np.nan, 1e30
    kept = np.arange(len(origins)) % 3 == 2
    other = run(device, precision, sequence, (spoilt, directions))
    np.testing.assert_array_equal(one.positions_mm[kept], other.positions_mm[kept])
    assert not other.passed[~kept].any()


def test_what_is_compiled_in_without_need_changes_nothing(device, precision):
    for name in ("astigmatic", "height map"):
        element = placed(name)
        rays = rounded(rays_onto(element, (0.0, 30.0, 60.0), 40), precision)
        general = run(device, precision, (element,), rays)
        own = run(device, precision, (element,), rays, features=EyeFeatures.of([(element,)]))
        np.testing.assert_array_equal(general.positions_mm, own.positions_mm)
        np.testing.assert_array_equal(general.directions, own.directions)


@pytest.mark.parametrize("name", [*NEWTON, "ellipsoid"])
def test_an_eye_twice_as_large_gives_the_same_bits(device, precision, name):
    element = placed(name)
    rays = rounded(rays_onto(element, (0.0, 30.0, 60.0), 20), precision)
    shape = element.shape
    if isinstance(shape, Biconic):
        larger = Biconic(shape.curvature_x / 2, shape.conic_x)
    elif isinstance(shape, Toric):
        larger = Toric(shape.curvature_x / 2)
    elif isinstance(shape, EvenAsphere):
        powers = enumerate(shape.coefficients, start=1)
        larger = EvenAsphere(tuple(a * 2.0 ** (1 - 2 * i) for i, a in powers))
    elif isinstance(shape, ZernikeSag):
        larger = ZernikeSag(tuple(2 * c for c in shape.coefficients_mm), 2 * shape.radius_mm)
    else:
        larger = HeightMap(2 * shape.heights_mm, 2 * shape.width_mm, 2 * shape.height_mm)
    place = dataclasses.replace(PLACE, decentre_mm=(0.6, -0.4))
    double = dataclasses.replace(
        element,
        curvature=element.curvature / 2,
        semi_diameter_mm=2 * element.semi_diameter_mm,
        shape=larger,
        placement=place,
    )
    one = run(device, precision, (element,), rays)
    other = run(device, precision, (double,), (2 * rays[0], rays[1]))
    np.testing.assert_array_equal(2 * one.positions_mm, other.positions_mm)
    np.testing.assert_array_equal(one.directions, other.directions)


@pytest.mark.parametrize("towards", ["retina", "scene"])
def test_equal_indices_leave_directions_alone(device, precision, towards):
    real, sense = REAL[precision], 1.0 if towards == "retina" else -1.0
    for name in SHAPES:
        element = dataclasses.replace(placed(name), n_before=1.376, n_after=1.376)
        stop = dataclasses.replace(
            element, kind=ElementKind.STOP, shape=None, placement=None, curvature=0.0, conic=0.0
        )
        rays = rounded(rays_onto(element, (0.0, 30.0, 60.0), 20, sense), precision)
        got = run(device, precision, (element,), rays, towards)
        alone = run(device, precision, (stop,), rays, towards)
        ok = got.passed
        assert ok.sum() > 40
        # Exactly those of rays that meet no surface; the one ulp is that of making them unit.
        np.testing.assert_array_equal(got.directions[ok], alone.directions[ok])
        unit = (rays[1] / np.linalg.norm(rays[1], axis=1, keepdims=True)).astype(real)
        error = np.abs(got.directions.astype(real) - unit) / np.spacing(np.abs(unit))
        assert np.max(error[ok]) <= 1.0


def hard_rays(count=10):
    """Rays from fields of 0 to 105 deg towards places of the entrance pupil, (n, 3) each."""
    rng = np.random.default_rng(7)
    origins, directions = [], []
    for field in (0.0, 20.0, 40.0, 60.0, 75.0, 85.0, 90.0, 95.0, 100.0, 105.0):
        for _ in range(count):
            turn, angle = rng.uniform(0, 2 * np.pi), math.radians(field)
            across = math.sin(angle)
            d = np.array([across * math.cos(turn), across * math.sin(turn), math.cos(angle)])
            origins.append(np.array([*rng.uniform(-1.0, 1.0, 2), 2.6]) - 12.0 * d)
            directions.append(d)
    return np.array(origins), np.array(directions)


def test_rays_up_to_105_degrees_through_an_irregular_eye_agree_with_50_digits(device, precision):
    sequence = elements(irregular_eye(), 550.0)
    rays = rounded(hard_rays(), precision)
    got = run(device, precision, sequence, rays)
    host = trace_elements(sequence, *rays, "retina", record_hits=True)
    assert np.mean(got.status == host.status) > (0.98 if precision == "single" else 0.995)
    behind, compared = 0, 0
    for i in np.flatnonzero(got.passed & host.passed):
        ends = np.concatenate([rays[0][None, i], host.hits_mm[:, i]])
        lengths = np.linalg.norm(np.diff(ends, axis=0), axis=1)
        # The retina is a biconic in name; behind its equator it is no sag, and textbook algebra
        # of the ellipsoid is asked for it.
        point, direction, _ = mp_form_trace(sequence[:-1], rays[0][i], rays[1][i], 1, lengths[:-1])
        point = onto_ellipsoid(point, direction, (12.2, 11.6, 11.9), 23.9)
        error = max(abs(float(point[j] - got.positions_mm[i, j])) for j in range(3))
        assert error < (3e-5 if precision == "single" else 1e-12)
        behind += bool(point[2] < 12.0)
        compared += 1
    assert compared > 50
    assert behind >= 3


def onto_ellipsoid(point, direction, semi_axes, vertex_z):
    """Where a ray from within leaves an ellipsoid, whose rear end is the vertex."""
    centre = (0, 0, mp.mpf(vertex_z) - mp.mpf(semi_axes[2]))
    p = [(point[j] - centre[j]) / mp.mpf(semi_axes[j]) for j in range(3)]
    d = [direction[j] / mp.mpf(semi_axes[j]) for j in range(3)]
    a, b, c = (sum(u * v for u, v in zip(x, y, strict=True)) for x, y in ((d, d), (p, d), (p, p)))
    t = (-b + mp.sqrt(b * b - a * (c - 1))) / a
    return [point[j] + t * direction[j] for j in range(3)]


def test_tracing_back_through_an_irregular_eye_returns(precision):
    eye = irregular_eye()
    origins, directions = hard_rays()
    forward = ic.trace_rays(eye, origins, directions, 550.0, precision=precision)
    ok = forward.passed
    assert ok.sum() > 50
    back = ic.trace_rays(
        eye,
        forward.positions_mm[ok],
        -forward.directions[ok],
        550.0,
        towards="scene",
        precision=precision,
    )
    # At grazing incidence on the cornea rounding is magnified by 1 / cos.
    assert np.mean(back.passed) > 0.98
    error = np.linalg.norm(back.positions_mm - forward.hits_mm[0][ok], axis=1)[back.passed]
    assert error.max() < {"single": 5e-4, "double": 1e-10}[precision]
    if precision == "double":
        both = np.flatnonzero(ok)[back.passed]
        outside = forward.hits_mm[0][both] - origins[both]
        inside = forward.opl_mm[both] - np.linalg.norm(outside, axis=1)
        # 1e-9 waves
        assert np.max(np.abs(back.opl_mm[back.passed] - inside)) < 1e-9 * 550e-6 * 100


@pytest.mark.parametrize("axis_deg", [0.0, 90.0, 180.0])
def test_a_ray_on_the_edge_of_an_elliptical_stop_passes(device, precision, axis_deg):
    # All numbers are powers of two, so that the edge is met exactly in both precisions.
    stop = ic.Stop(3.6, 4.0, (0.5, -0.25), 2.0, axis_deg)
    eye = dataclasses.replace(ic.eyes.navarro(4.0), stop=stop, accommodation_model=None)
    element = elements(eye, 550.0)[eye.stop_index]
    eps = float(np.finfo(REAL[precision]).eps)
    semi = (1.0, 2.0) if axis_deg == 90.0 else (2.0, 1.0)
    signs = [(-1, 0), (1, 0), (0, -1), (0, 1)]
    points = {
        shrink: np.array(
            [[0.5 + a * semi[0] * shrink, -0.25 + b * semi[1] * shrink, 2.0] for a, b in signs]
        )
        for shrink in (1.0, 1.0 - 8 * eps, 1.0 + 8 * eps)
    }
    status = {
        shrink: run(device, precision, (element,), (at, np.tile([0.0, 0.0, 1.0], (4, 1)))).status
        for shrink, at in points.items()
    }
    assert status[1.0 - 8 * eps].tolist() == [RayStatus.OK] * 4
    assert status[1.0 + 8 * eps].tolist() == [RayStatus.STOPPED] * 4
    if axis_deg == 0.0:
        # Sines and cosines of other angles are not exact: there the edge is a few bits wide.
        assert status[1.0].tolist() == [RayStatus.OK] * 4


@pytest.mark.parametrize(
    "stop",
    [
        ic.Stop(3.6, 4.0, (0.3, -0.2), 2.5, 30.0),
        ic.Stop(3.6, 3.0, (0.5, 0.1)),
        ic.Stop(3.6, 4.0, (0.0, 0.0), 1.0, -70.0),
    ],
)
def test_a_stop_of_any_form_stops_what_lies_outside_its_ellipse(precision, stop):
    eye = dataclasses.replace(ic.eyes.navarro(4.0), stop=stop, accommodation_model=None)
    x, y = np.meshgrid(np.linspace(-3.2, 3.2, 41), np.linspace(-3.2, 3.2, 43))
    origins = np.stack([x.ravel(), y.ravel(), np.full(x.size, -1.0)], axis=1)
    got = ic.trace_rays(eye, origins, [0.0, 0.0, 1.0], 550.0, precision=precision)
    inside = np.hypot(*stop.disc_of(got.hits_mm[eye.stop_index][:, :2]).T) <= 1.0
    assert 100 < inside.sum() < 1500
    np.testing.assert_array_equal(got.passed, inside)
    assert set(got.status[~inside].tolist()) == {RayStatus.STOPPED}


def test_a_tilted_plane_is_where_geometry_says_and_bends_by_snell(device, precision):
    # A plane tilted about x by a: y sin a = z cos a on it; light along z meets it at angle a.
    a = math.radians(20.0)
    plane = surface(None, 0.0, 0.0, n=(1.0, 1.5), place=Placement(tilt_deg=(20.0, 0.0)))
    rays = np.array([[0.3, 1.0, -2.0]]), np.array([[0.0, 0.0, 1.0]])
    got = run(device, precision, (plane,), rays)
    assert got.positions_mm[0] == pytest.approx([0.3, 1.0, math.tan(a)], abs=TOLERANCE[precision])
    # Its normal is R z = (0, -sin a, cos a); inside the ray is asin(sin a / 1.5) from it.
    bent = math.asin(math.sin(a) / 1.5)
    expected = [0.0, -math.sin(a - bent), math.cos(a - bent)]
    assert got.directions[0] == pytest.approx(
        expected, abs=5e-7 if precision == "single" else 1e-15
    )


def test_a_retina_with_three_axes_and_a_tilt_is_met_where_its_ellipsoid_is(precision):
    semi = (13.0, 11.0, 12.0)
    retina = ic.Retina.ellipsoid(24.0, semi, Placement((0.2, -0.1), (4.0, 3.0), 15.0))
    eye = dataclasses.replace(ic.eyes.navarro(4.0), retina=retina, accommodation_model=None)
    origins, directions = hard_rays(20)
    got = ic.trace_rays(eye, origins, directions, 550.0, precision=precision)
    assert got.passed.sum() > 60
    local = (got.positions_mm[got.passed] - [0.2, -0.1, 24.0]) @ retina.placement.rotation
    on = np.sum((local + np.array([0.0, 0.0, 12.0])) ** 2 / np.square(semi), axis=1)
    assert np.max(np.abs(on - 1.0)) < (2e-6 if precision == "single" else 1e-14)
    assert np.min(local[:, 2]) < -10.0


def test_a_relief_of_the_retina_moves_hits_by_its_height(precision):
    # A level map of 0.1 mm shifts a plane retina's frame by just that.
    level = HeightMap(np.full((6, 6), -0.1), 30.0, 30.0)
    plain = ic.eyes.navarro(4.0)
    flat = dataclasses.replace(plain, retina=ic.Retina(24.0, 0.0), accommodation_model=None)
    raised = dataclasses.replace(flat, retina=ic.Retina(24.0, 0.0, 0.0, level))
    origins, directions = hard_rays()
    one = ic.trace_rays(flat, origins, directions, 550.0, precision=precision)
    other = ic.trace_rays(raised, origins, directions, 550.0, precision=precision)
    ok = one.passed & other.passed & (np.abs(one.positions_mm[:, :2]).max(axis=1) < 14.0)
    assert ok.sum() >= 30
    limit = 5e-6 if precision == "single" else 1e-13
    np.testing.assert_allclose(other.positions_mm[ok, 2], 23.9, atol=limit)
    slope = one.directions[ok, :2] / one.directions[ok, 2:]
    expected = one.positions_mm[ok, :2] - 0.1 * slope
    np.testing.assert_allclose(other.positions_mm[ok, :2], expected, atol=limit)


def batoid_hits(surface_of, element, rays):
    """Points and directions behind a surface of batoid, in the frame of the eye."""
    batoid = pytest.importorskip("batoid")
    place = element.placement
    rotation = np.eye(3) if place is None else place.rotation
    shift = (0.0, 0.0) if place is None else place.decentre_mm
    system = batoid.CoordSys(origin=[*shift, element.vertex_z_mm], rot=rotation)
    n1, n2 = batoid.ConstMedium(element.n_before), batoid.ConstMedium(element.n_after)
    origins, directions = rays
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    count = len(origins)
    bundle = batoid.RayVector(
        *origins.T,
        *(unit / element.n_before).T,
        np.zeros(count),
        np.full(count, 550e-9),
        np.ones(count),
        np.zeros(count, bool),
    )
    surface_of(batoid).refract(bundle, n1, n2, coordSys=system)
    bundle.toCoordSys(batoid.CoordSys())
    return np.stack([bundle.x, bundle.y, bundle.z], axis=1), bundle.v * element.n_after


NOLL = tuple(
    # OSA index of Noll's j: n from the row, m by sign and size (Noll 1976, table I).
    next(i for i in range(66) if osa_nm(i) == nm)
    for nm in ((0, 0), (1, 1), (1, -1), (2, 0), (2, -2), (2, 2), (3, -1), (3, 1), (3, -3), (3, 3))
)


@pytest.mark.parametrize("kind", ["conic", "asphere", "zernike"])
def test_batoid_finds_the_same_points_and_directions(device, precision, kind):
    # batoid is written in float64 C++; its asphere begins with the fourth power.
    if kind == "conic":
        element = placed("conic")
        make = lambda b: b.Quadric(7.8, -0.25)  # noqa: E731
    elif kind == "asphere":
        element = dataclasses.replace(
            placed("even asphere"), shape=EvenAsphere((0.0, -2e-4, 3e-6, -1e-7))
        )
        make = lambda b: b.Asphere(7.8, -0.25, [-2e-4, 3e-6, -1e-7])  # noqa: E731
    else:
        noll = np.array([0, 0, 0, 0, 3e-3, -4e-3, 2e-3, -1e-3, 1.5e-3, 5e-4])
        osa = np.zeros(10)
        osa[list(NOLL)] = noll
        element = dataclasses.replace(placed("zernike"), shape=ZernikeSag(tuple(osa), 4.2))
        make = lambda b: b.Sum(  # noqa: E731
            [b.Quadric(7.8, -0.25), b.Zernike([0.0, *noll], R_outer=4.2)]
        )
    rays = rounded(rays_onto(element, (0.0, 20.0, 40.0), 60), precision)
    got = run(device, precision, (element,), rays)
    points, directions = batoid_hits(make, element, rays)
    assert got.passed.sum() > 170
    # batoid's search ends at 1e-12 of its unit.
    limit = TOLERANCE[precision] if precision == "single" else 2e-12
    np.testing.assert_allclose(got.positions_mm[got.passed], points[got.passed], rtol=0, atol=limit)
    np.testing.assert_allclose(
        got.directions[got.passed],
        directions[got.passed],
        rtol=0,
        atol=5e-7 if precision == "single" else 1e-12,
    )

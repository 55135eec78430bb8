"""Eyes that are no figures of revolution: chief rays, pupils, throughput, foci, refractions."""

import dataclasses

import numpy as np
import pytest
from scipy.special import ellipeinc
from slow_cases import slow_after

import isetcl as ic
from isetcl.eye import sequential
from isetcl.eye.aberrations import geometric
from isetcl.eye.exit_pupil import exit_pupil_bound
from isetcl.eye.exit_pupil_plane import plane_pupil_bound
from isetcl.eye.field import direction_from_field
from isetcl.eye.object_point import ObjectPoint
from isetcl.eye.placement import Placement
from isetcl.eye.retina_form import (
    arc_coordinates_mm,
    off_relief,
    onto_relief,
    retina_element,
    retinal_normal,
)
from isetcl.eye.sequential import intersect
from isetcl.eye.shapes.height_map import HeightMap
from isetcl.eye.shapes.toric import Toric
from isetcl.eye.throughput import (
    axial_irradiance_per_radiance,
    irradiance_per_radiance,
    plane_irradiance_per_radiance,
)

NM = 550.0
FIELDS = np.array([(0.0, 0.0), (3.0, 4.0), (-20.0, 5.0), (11.0, -30.0), (-40.0, -41.0)])


def changed(eye, **parts):
    return dataclasses.replace(eye, accommodation_model=None, **parts)


def forced(eye):
    """The same eye, taken for one that is no figure of revolution."""
    stop = dataclasses.replace(eye.stop, decentre_mm=(1e-300, 0.0))
    result = dataclasses.replace(eye, stop=stop)
    assert not result.is_rotational
    return result


def with_surface(eye, number, **parts):
    surfaces = list(eye.surfaces)
    surfaces[number] = dataclasses.replace(surfaces[number], **parts)
    return changed(eye, surfaces=tuple(surfaces))


def crooked(axis_deg=0.0, mirrored=False):
    """Toric cornea, tilted and decentred lens, elliptical stop off the axis; turned as a whole."""
    eye = ic.eyes.navarro(3.0)
    turn = np.radians(axis_deg)
    side = -1.0 if mirrored else 1.0
    turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])

    def placed(decentre, lean, axis):
        """Displaced by `decentre`, its axis leaning by a vector, turned by `axis` degrees."""
        middle = turned @ (decentre[0] * side, decentre[1])
        lean = turned @ (lean[0] * side, lean[1])
        about_y = np.arcsin(lean[0])
        about_x = np.arcsin(-lean[1] / np.cos(about_y))
        tilt = tuple(np.degrees([about_x, about_y]))
        return Placement(tuple(middle), tilt, axis * side + axis_deg)

    toric = placed((0.0, 0.0), (0.0, 0.0), 20.0)
    eye = with_surface(eye, 0, shape=Toric(1.0 / 7.5), placement=toric)
    eye = with_surface(eye, 2, placement=placed((0.2, -0.1), (0.08, 0.05), 0.0))
    eye = with_surface(eye, 3, placement=placed((0.2, -0.1), (0.08, 0.05), 0.0))
    stop = dataclasses.replace(
        eye.stop,
        decentre_mm=tuple(turned @ (0.3 * side, 0.1)),
        minor_diameter_mm=2.4,
        axis_deg=30.0 * side + axis_deg,
    )
    return changed(eye, stop=stop)


# The code for any eye gives what that for figures of revolution gives.


@pytest.mark.parametrize("name", ["navarro", "arizona"])
def test_chief_rays_of_a_figure_of_revolution_are_the_same_in_two_angles(name):
    eye = ic.eyes.by_name(name)
    one, two = eye.field_map(NM), forced(eye).field_map(NM)
    assert two.max_field_deg == pytest.approx(one.max_field_deg, abs=0.3)
    x, y = FIELDS.T
    point = two.retinal_point_mm(x, y)
    np.testing.assert_allclose(point, one.retinal_point_mm(x, y), atol=1e-9)
    np.testing.assert_allclose(two.coordinates_mm(x, y), one.coordinates_mm(x, y), atol=1e-8)
    np.testing.assert_allclose(two.field_of_point_deg(point), FIELDS, atol=1e-9)
    # Both name a point of the ray in front of the eye, not the same one.
    gap = np.cross(two.entrance_mm(x, y) - one.entrance_mm(x, y), direction_from_field(x, y))
    assert np.max(np.abs(gap)) < 1e-9


@pytest.mark.parametrize("fov", [(10.0, 10.0), (60.0, 40.0)])
def test_pupils_and_throughput_of_a_figure_of_revolution_are_the_same_in_two_angles(fov):
    eye = ic.eyes.navarro(4.0)
    grid = ic.RetinalGrid.of(eye, fov, (9, 9))
    plane = ic.RetinalGrid.of(forced(eye), fov, (9, 9))
    at = plane.rectangle.lattice(5)
    field = np.hypot(*at.T)
    bound = exit_pupil_bound(eye, NM, grid.field_map, grid.limit_deg)
    both = plane_pupil_bound(forced(eye), NM, plane.field_map, plane.rectangle)
    np.testing.assert_allclose(both.area_mm2(at), bound.area_mm2(field), rtol=2e-3)
    # The best ellipse fills at least as well as that of the extents.
    assert both.fill > bound.fill - 1e-5
    assert not both.clipped_elsewhere
    assert not both.has_far_side
    got = plane_irradiance_per_radiance(forced(eye), NM, plane.field_map, at)
    expected = irradiance_per_radiance(eye, NM, grid.field_map, field)
    np.testing.assert_allclose(got, expected, rtol=1e-9)
    axial = axial_irradiance_per_radiance(forced(eye), NM)
    assert axial == pytest.approx(axial_irradiance_per_radiance(eye, NM), rel=1e-11)


@pytest.mark.parametrize("field", [(0.0, 0.0), (3.0, 10.0), (-20.0, 15.0)])
@pytest.mark.parametrize("distance_m", slow_after(1, [0.3, np.inf]))
def test_wavefronts_of_a_figure_of_revolution_are_the_same_in_two_angles(field, distance_m):
    eye = ic.eyes.navarro(4.0)
    one = eye.wavefront(field, NM, object_distance_m=distance_m)
    two = forced(eye).wavefront(field, NM, object_distance_m=distance_m)
    np.testing.assert_allclose(one.opd_um, two.opd_um, atol=1e-7)
    np.testing.assert_allclose(one.mm_per_deg, two.mm_per_deg, atol=1e-8)


def test_focus_of_a_figure_of_revolution_is_the_same_through_the_whole_pupil():
    eye = ic.eyes.arizona(4.0)
    assert forced(eye).focus_vergence_dpt(NM) == pytest.approx(eye.focus_vergence_dpt(NM), abs=1e-7)
    near = forced(eye).focus_at(0.4, NM)
    assert near.accommodation_parameter == pytest.approx(
        eye.focus_at(0.4, NM).accommodation_parameter, rel=1e-6
    )


# Symmetries.


@pytest.mark.slow
def test_turning_an_eye_turns_its_chief_rays_and_pupils():
    plain, turned = crooked(), crooked(70.0)
    c, s = np.cos(np.radians(70.0)), np.sin(np.radians(70.0))
    rotation = np.array([[c, -s], [s, c]])
    fields = FIELDS[:4]
    there = fields @ rotation.T
    one, two = plain.field_map(NM), turned.field_map(NM)
    point = one.retinal_point_mm(*fields.T)
    got = two.retinal_point_mm(*there.T)
    np.testing.assert_allclose(got[:, :2], point[:, :2] @ rotation.T, atol=1e-9)
    np.testing.assert_allclose(got[:, 2], point[:, 2], atol=1e-9)
    np.testing.assert_allclose(
        plane_irradiance_per_radiance(turned, NM, two, there),
        plane_irradiance_per_radiance(plain, NM, one, fields),
        rtol=1e-6,
    )
    assert turned.focus_vergence_dpt(NM) == pytest.approx(plain.focus_vergence_dpt(NM), abs=1e-5)


def test_a_mirrored_eye_has_mirrored_chief_rays():
    one, two = crooked().field_map(NM), crooked(mirrored=True).field_map(NM)
    flip = np.array([-1.0, 1.0, 1.0])
    point = one.retinal_point_mm(*FIELDS[:4].T)
    got = two.retinal_point_mm(*(FIELDS[:4] * flip[:2]).T)
    np.testing.assert_allclose(got, point * flip, atol=1e-9)
    assert np.max(np.abs(point[0, :2])) > 0.02  # no trivial symmetry


@pytest.mark.parametrize("field", [(0.0, 0.0), (6.0, -4.0)])
def test_the_chief_ray_of_a_wavefront_lands_where_the_map_says(field):
    eye = crooked()
    source = ObjectPoint(eye, field, NM, object_distance_m=0.5)
    chief = source.chief()
    expected = eye.field_map(NM).retinal_point_mm(*np.array(field))
    np.testing.assert_allclose(chief.point_mm[0], expected, atol=1e-9)
    np.testing.assert_allclose(chief.stop_mm[0], eye.stop.decentre_mm, atol=1e-9)
    np.testing.assert_allclose(chief.entrance_mm[0], 0.0, atol=1e-9)


def test_the_pupil_of_a_wavefront_is_the_ellipse_of_the_stop():
    eye = changed(
        ic.eyes.navarro(4.0),
        stop=dataclasses.replace(
            ic.eyes.navarro(4.0).stop,
            decentre_mm=(0.3, -0.2),
            minor_diameter_mm=2.0,
            axis_deg=25.0,
        ),
    )
    front = eye.wavefront((0.0, 0.0), NM, samples=256)
    x, y = front.entrance_mm[front.inside].T
    weights = front.area_mm2[front.inside]
    # Second moments of an ellipse: a quarter of its squared semi-axes along and across.
    turn = np.radians(25.0)
    along, across = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    magnification = eye.entrance_pupil(NM).magnification
    for values, semi in ((along, 2.0), (across, 1.0)):
        values = values - np.average(values, weights=weights)
        moment = np.average(values**2, weights=weights)
        # Pupil aberration makes the image of the stop 1 % smaller than the paraxial one.
        assert 2.0 * np.sqrt(moment) == pytest.approx(semi * magnification, rel=0.02)


@pytest.mark.parametrize("field", [(0.0, 0.0), (6.0, -4.0)])
def test_the_normals_of_a_wavefront_are_the_rays_of_the_spot_diagram(field):
    eye = crooked()
    traced = geometric.spot(eye, field, NM)
    implied = geometric.spot_of_wavefront(eye.wavefront(field, NM, samples=128))
    assert implied.rms_arcmin == pytest.approx(traced.rms_arcmin, rel=2e-3)
    assert implied.centroid_arcmin == pytest.approx(traced.centroid_arcmin, abs=0.02)
    for orientation in (0.0, 45.0, 90.0):
        np.testing.assert_allclose(
            implied.mtf([2.0, 5.0], orientation), traced.mtf([2.0, 5.0], orientation), atol=3e-3
        )


# Irradiance.


def counted_irradiance(eye, field, side=700):
    """Irradiance per radiance, by rays to an even grid over the plane of the exit pupil."""
    chief = eye.field_map(NM)
    start = chief.retinal_point_mm(*np.array(field))
    pupil = eye.exit_pupil(NM)
    half = 2.0 * pupil.radius_mm
    axis = (np.arange(side) + 0.5) / side * 2.0 * half - half
    x, y = np.meshgrid(axis, axis)
    ray = np.stack([x.ravel(), y.ravel(), np.full(x.size, pupil.z_mm)], axis=1) - start
    rays = sequential.trace(eye, np.broadcast_to(start, ray.shape), ray, NM, towards="scene")
    normal = retinal_normal(eye.retina, start[None])[0]
    distance2 = np.sum(ray**2, axis=1)
    cosines = (ray @ normal) * ray[:, 2] / distance2
    index = eye.indices(NM)
    weight = (index[-1] / index[0]) ** 2 * cosines / distance2 * (2.0 * half / side) ** 2
    return float(np.sum(weight * rays.passed))


@pytest.mark.parametrize("field", slow_after(0, [((0.0, 0.0),), ((20.0, -10.0),)]))
def test_throughput_is_what_counted_rays_give(field):
    eye = crooked()
    got = plane_irradiance_per_radiance(eye, NM, eye.field_map(NM), np.array([field]))[0]
    # A grid of 700 across counts an outline to about 2e-4 of its area.
    assert got == pytest.approx(counted_irradiance(eye, field), rel=4e-4)


@pytest.mark.slow
def test_no_ray_that_passes_the_stop_lies_outside_the_bound():
    eye = crooked()
    grid = ic.RetinalGrid.of(eye, 20.0, 9, (5.0, -3.0))
    bound = plane_pupil_bound(eye, NM, grid.field_map, grid.rectangle)
    assert bound.fill > 0.999
    rng = np.random.default_rng(2)
    at = grid.rectangle.points(rng.uniform(-1.0, 1.0, (60, 2)))
    turn = np.linspace(0.0, 2.0 * np.pi, 50, endpoint=False)
    values = bound.ellipse(at)
    rim = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    edge = values[:, None, :2] + np.einsum("fij,aj->fai", values[:, 2:].reshape(-1, 2, 2), rim)
    start = np.repeat(grid.field_map.retinal_point_mm(*at.T), len(turn), axis=0)
    target = np.concatenate([edge.reshape(-1, 2), np.full((edge.size // 2, 1), bound.z_mm)], axis=1)
    rays = sequential.trace(eye, start, target - start, NM, towards="scene")
    assert not rays.passed.any()


# Retinas.


def ellipsoidal(axes=(11.0, 12.5, 12.0)):
    eye = ic.eyes.navarro(3.0)
    return changed(eye, retina=ic.Retina.ellipsoid(eye.axial_length_mm, axes))


def test_points_of_an_ellipsoid_lie_on_it_and_lengths_are_elliptic_integrals():
    a, b, d = 11.0, 12.5, 12.0
    eye = ellipsoidal((a, b, d))
    chief = eye.field_map(NM)
    for field, semi in (((25.0, 0.0), a), ((0.0, 25.0), b)):
        x, y = np.array(field)
        point = chief.retinal_point_mm(x, y)
        centre = eye.axial_length_mm - d
        offset = point - np.array([0.0, 0.0, centre])
        assert np.sum((offset / (a, b, d)) ** 2) == pytest.approx(1.0, abs=1e-12)
        # The section is an ellipse: from its vertex by the parameter t, semi sin t across.
        t = np.arctan2(np.hypot(*offset[:2]) / semi, offset[2] / d)
        length = semi * ellipeinc(t, 1.0 - (d / semi) ** 2)
        assert np.linalg.norm(chief.coordinates_mm(x, y)) == pytest.approx(length, abs=1e-7)


def test_lengths_on_a_tilted_sphere_are_its_arcs():
    # Tilted about its vertex; a section through the axis is a circle of the sphere all the same.
    retina = ic.Retina(24.0, -1.0 / 12.0, placement=Placement(tilt_deg=(0.0, 8.0)))
    centre = np.array([-12.0 * np.sin(np.radians(8.0)), 0.0, 24.0 - 12.0 * np.cos(np.radians(8.0))])
    beta = np.radians(50.0)
    point = centre + 12.0 * np.array([np.sin(beta), 0.0, np.cos(beta)])
    got = arc_coordinates_mm(retina, 3.0, point[None])[0]
    assert got == pytest.approx((12.0 * (beta - np.radians(8.0)), 0.0), abs=1e-9)


def bumpy(height_mm=0.1):
    y, x = np.mgrid[1:-1:33j, -1:1:33j]
    bump = height_mm * np.exp(-8.0 * ((x - 0.1) ** 2 + y**2))
    eye = ic.eyes.navarro(3.0)
    retina = dataclasses.replace(eye.retina, shape=HeightMap(bump, 8.0, 8.0))
    return changed(eye, retina=retina)


@pytest.mark.slow
def test_a_relief_on_a_tilted_retina_lies_on_the_surface_that_rays_meet():
    plain = bumpy()
    place = Placement((0.3, -0.2), (3.0, -4.0), 20.0)
    retina = dataclasses.replace(plain.retina, placement=place)
    eye = changed(plain, retina=retina)
    chief = eye.field_map(NM)
    fields = np.array([(0.0, 0.0), (3.0, 2.0), (-2.0, 1.0)])
    point = chief.retinal_point_mm(*fields.T)
    away = retinal_normal(retina, point)
    hit = intersect(point - away, away, retina_element(retina), 1.0)
    np.testing.assert_allclose(hit.position, point, atol=1e-9)
    np.testing.assert_allclose(chief.field_of_point_deg(point), fields, atol=1e-9)


@pytest.mark.slow
def test_a_relief_lifts_points_along_its_axis_and_tilts_their_normals():
    eye = bumpy()
    smooth = ic.eyes.navarro(3.0).retina
    chief = eye.field_map(NM)
    at = np.array([(0.0, 0.0), (3.0, 2.0), (-2.0, 1.0)])
    point = chief.retinal_point_mm(*at.T)
    base = off_relief(eye.retina, point)
    sag = smooth.vertex_z_mm + smooth.sag_mm(base[:, 0], base[:, 1])
    np.testing.assert_allclose(base[:, 2], sag, atol=1e-12)
    np.testing.assert_allclose(point[:, :2], base[:, :2], atol=1e-12)
    expected = eye.retina.vertex_z_mm + eye.retina.sag_mm(point[:, 0], point[:, 1])
    np.testing.assert_allclose(point[:, 2], expected, atol=1e-12)
    np.testing.assert_allclose(chief.field_of_point_deg(point), at, atol=1e-9)
    h = 1e-5
    slopes = [
        (
            eye.retina.sag_mm(point[:, 0] + dx, point[:, 1] + dy)
            - eye.retina.sag_mm(point[:, 0] - dx, point[:, 1] - dy)
        )
        / (2.0 * h)
        for dx, dy in ((h, 0.0), (0.0, h))
    ]
    normal = np.stack([-slopes[0], -slopes[1], np.ones(3)], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    np.testing.assert_allclose(retinal_normal(eye.retina, point), normal, atol=1e-8)
    np.testing.assert_allclose(onto_relief(eye.retina, base), point, atol=1e-12)

"""Photographs in perspective: places, areas and depths on the even field angles of an eye."""

import dataclasses
import math

import numpy as np
import pytest
from oracles import reduced_eye

import isetcl as ic
from isetcl.psf_baseline import DepthImage, DepthSheet, load_depth_image, render
from isetcl.psf_baseline.camera import Camera
from isetcl.psf_baseline.picture_source import image_grid, picture_stack
from isetcl.psf_baseline.view import ViewGrid

ONE = np.array([550.0])
TAN_20 = math.tan(math.radians(20.0))


def field_of(x, y, z):
    """Polar field angles of a point before the eye, which looks along -z."""
    theta = np.degrees(np.arctan2(np.hypot(x, y), -z))
    azimuth = np.arctan2(y, x)
    return theta * np.cos(azimuth), theta * np.sin(azimuth)


# ---- places ----------------------------------------------------------------------------------


def test_points_fall_where_a_pinhole_projects_them():
    camera = Camera((40.0, 30.0), (0.0, 0.0), (60, 80))
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 7), np.linspace(-0.4, 0.4, 5))
    column, row = camera.places(*field_of(x, y, -1.7))
    np.testing.assert_allclose(column, 40.0 + 40.0 * (x / 1.7) / TAN_20, atol=1e-9)
    high = math.tan(math.radians(15.0))
    np.testing.assert_allclose(row, 30.0 - 30.0 * (y / 1.7) / high, atol=1e-9)


def test_a_turned_camera_sees_what_the_turned_scene_shows():
    # To the right by 25 degrees: a point (u, v, -1) of its own frame, turned about the vertical.
    camera = Camera((30.0, 30.0), (25.0, 0.0), (50, 50))
    u, v = np.meshgrid(np.linspace(-0.2, 0.2, 5), np.linspace(-0.2, 0.2, 5))
    turn = math.radians(25.0)
    x = u * math.cos(turn) + math.sin(turn)
    z = -math.cos(turn) + u * math.sin(turn)
    column, row = camera.places(*field_of(x, v, z))
    half = math.tan(math.radians(15.0))
    np.testing.assert_allclose(column, 25.0 + 25.0 * u / half, atol=1e-9)
    np.testing.assert_allclose(row, 25.0 - 25.0 * v / half, atol=1e-9)


def test_pixels_look_where_their_places_are():
    camera = Camera((50.0, 40.0), (10.0, -7.0), (6, 8))
    seen = camera.directions()
    column, row = camera.places(*field_of(*np.moveaxis(seen, -1, 0)))
    np.testing.assert_allclose(column, np.broadcast_to(np.arange(8) + 0.5, (6, 8)), atol=1e-9)
    np.testing.assert_allclose(row, np.arange(6)[:, None] + np.full((6, 8), 0.5), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(seen, axis=-1), 1.0)


@pytest.mark.parametrize("rows", [20, 40, 60])
def test_the_image_that_fits_into_a_photograph_ends_at_its_corners(rows):
    picture = DepthImage(np.ones((rows, 40)), 1.0, 40.0)
    width, height = picture.even_fov_deg
    # A corner at the angle whose tangent the corner of the picture has.
    slope = rows / 40.0
    diagonal = math.hypot(1.0, slope)
    angle = math.degrees(math.atan(TAN_20 * diagonal))
    assert width == pytest.approx(2.0 * angle / diagonal, rel=1e-9)
    assert height == pytest.approx(width * slope, rel=1e-12)
    grid = image_grid(picture, ic.eyes.navarro(), None, None, None)
    assert grid.fov_deg == pytest.approx((width, height))
    assert grid.resolution == (40, rows)


def test_small_photographs_are_not_resampled_and_angular_pictures_never():
    assert DepthImage(np.ones((64, 64)), 1.0, 1.0).camera is None
    assert DepthImage(np.ones((64, 64)), 1.0, 40.0).camera is not None
    assert DepthImage(np.ones((64, 64)), 1.0, 40.0, projection="angular").camera is None
    # theta^3 / 3 of 5 degrees, in pixels of 10 / 512 degrees: two thirds at the middle of a side,
    # twice the square root of 2 of it at a corner.
    theta, pixel = math.radians(5.0), math.radians(10.0 / 512.0)
    photo = Camera((10.0, 10.0), (0.0, 0.0), (512, 512))
    corner = math.hypot(theta, theta)
    # Both are the same at the middles of the sides, where the cubic is taken away again.
    expected = (corner**3 / 3.0 - corner * theta**2 / 3.0) / pixel
    assert photo.farthest_from_even() == pytest.approx(expected, rel=0.02)


# ---- areas -----------------------------------------------------------------------------------


def layer_of(image, grid, oversampling=1, margin=0, border="reflect"):
    stack = picture_stack(image, ONE, border)
    view = ViewGrid(grid, oversampling, margin)
    (layer,) = stack.layers_on(view, np.array([-np.inf, np.inf]), False)
    return layer


@pytest.mark.parametrize(("resolution", "allowed"), [(10, 0.006), (24, 0.01), (60, 0.03)])
def test_samples_are_means_over_the_area_that_they_cover_of_a_photograph(resolution, allowed):
    rng = np.random.default_rng(1)
    picture = rng.random((24, 24))
    grid = ic.RetinalGrid.of(reduced_eye(), 36.0, resolution)
    found = layer_of(DepthImage(picture, 1.0, 40.0), grid).colour[0]
    # A second way: many points in every sample, each with the pixel that it falls on.
    fine = (np.arange(720) + 0.5) / 720 * 36.0 - 18.0
    theta = np.radians(np.hypot(fine, fine[:, None]))
    ratio = np.tan(theta) / np.degrees(theta) / TAN_20
    column = np.floor((fine * ratio + 1.0) * 12.0).astype(int)
    row = np.floor((1.0 + fine[:, None] * ratio) * 12.0).astype(int)
    points = picture[np.clip(row, 0, 23), np.clip(column, 0, 23)]
    expected = points.reshape(resolution, 720 // resolution, resolution, -1).mean(axis=(1, 3))
    # What the slant of a sample adds and takes away at single pixels, of a range of 1.
    assert np.sqrt(np.mean((found - expected) ** 2)) < allowed


@pytest.mark.parametrize(("border", "kept"), [("reflect", 1.0), ("replicate", 1.0), ("zero", 0.0)])
def test_corners_beyond_a_photograph_follow_the_border(border, kept):
    image = DepthImage(np.ones((16, 16)), 1.0, 40.0)
    grid = ic.RetinalGrid.of(reduced_eye(), 40.0, 32)
    layer = layer_of(image, grid, 1, 3, border)
    assert layer.coverage[0, 0] == pytest.approx(kept, abs=1e-6)
    assert layer.coverage[19, 19] == pytest.approx(1.0, rel=1e-6)
    np.testing.assert_allclose(layer.colour[0], layer.coverage, rtol=1e-6)
    far = picture_stack(image, ONE, border).vergence_map(grid)
    assert (far[0, 0], far[16, 16]) == (kept, 1.0)


def test_depth_is_never_mixed_across_an_edge():
    depth = np.where(np.arange(24) < 15, 0.5, 2.0)
    image = DepthImage(np.full((24, 24), 0.3), np.broadcast_to(depth, (24, 24)), 40.0)
    grid = ic.RetinalGrid.of(reduced_eye(), 30.0, 33)
    seen = picture_stack(image, ONE).vergence_map(grid)
    assert set(np.unique(seen)) == {0.5, 2.0}
    # The edge is where the tangent is a quarter of that of the border.
    x, y = np.meshgrid(grid.x_deg, grid.y_deg)
    theta = np.radians(np.hypot(x, y))
    tangent = np.tan(theta) * x / np.maximum(np.hypot(x, y), 1e-12)
    np.testing.assert_array_equal(seen == 2.0, tangent < TAN_20 * 0.25)


@pytest.fixture(scope="module")
def wall():
    """A painted wall 2 m away and a photograph of it, 40 degrees wide."""
    y, x = np.mgrid[0:48, 0:48] / 48.0
    paint = ic.Image((0.5 + 0.3 * np.sin(14.0 * x + 5.0 * y) * np.cos(11.0 * y)).astype(np.float32))
    half = 2.0 * TAN_20
    white = ic.Display((1, 1), width_m=1.0).white
    shape = ic.Quad((-half, -half, -2.0), (2 * half, 0, 0), (0, 2 * half, 0))
    scene = ic.Scene((ic.SceneObject("wall", shape, ic.Emission(white, paint)),))
    return scene, DepthImage(paint, 2.0, 40.0)


def test_a_photograph_gives_what_the_wall_that_it_shows_gives(wall):
    scene, photo = wall
    eye = ic.eyes.navarro(4.0, 0.5)
    where = {"fov_deg": 30.0, "resolution": 24, "wavelengths_nm": ONE, "method": "gather"}
    made = render(photo, eye, **where)
    truth = render(scene, eye, **where).irradiance.values
    away = np.abs(made.irradiance.values - truth)[0] / truth.mean()
    # Squares in place of texels interpolated: the difference is of the paint's second order.
    assert np.sqrt(np.mean(away**2)) < 0.008
    assert made.provenance["projection"] == "perspective"
    assert made.provenance["is_reprojected"]
    np.testing.assert_allclose(made.vergence_dpt, 0.5, rtol=1e-6)
    # Taken as even angles the paint is displaced, by 0.3 degrees at 15.
    wrong = render(dataclasses.replace(photo, projection="angular"), eye, **where)
    assert wrong.provenance["projection"] == "angular"
    assert not wrong.provenance["is_reprojected"]
    assert np.sqrt(np.mean((wrong.irradiance.values[0] - truth[0]) ** 2)) > 0.02 * truth.mean()


# ---- depths ----------------------------------------------------------------------------------


def test_a_flat_wall_has_one_depth_along_the_axis_and_many_ranges():
    one = np.ones((9, 11))
    wall = DepthImage(one, 2.0, 60.0)
    np.testing.assert_allclose(wall.vergence_dpt, 0.5)
    # The same wall by a scanner: range = depth / cosine, of tangents x, y: sqrt(1 + x^2 + y^2).
    x = np.linspace(-1, 1, 12)
    x = (x[1:] + x[:-1]) / 2.0 * math.tan(math.radians(30.0))
    y = np.arange(-4, 5) * (x[1] - x[0])
    ranges = 2.0 * np.sqrt(1.0 + x**2 + y[:, None] ** 2)
    scanned = DepthImage(one, ranges, 60.0, depth_kind="range")
    np.testing.assert_allclose(scanned.vergence_dpt, 0.5, rtol=1e-12)
    mistaken = DepthImage(one, ranges, 60.0)
    np.testing.assert_allclose(mistaken.vergence_dpt, 1.0 / ranges)
    dioptres = DepthImage(one, 1.0 / ranges, 60.0, depth_unit="dpt", depth_kind="range")
    np.testing.assert_allclose(dioptres.vergence_dpt, 0.5, rtol=1e-12)


def test_a_sphere_about_the_eye_has_one_range_in_even_angles():
    image = DepthImage(np.ones((1, 5)), 2.0, 50.0, depth_kind="range", projection="angular")
    # Pixels at -20, -10, 0, 10 and 20 degrees.
    expected = 0.5 / np.cos(np.radians([-20.0, -10.0, 0.0, 10.0, 20.0]))
    np.testing.assert_allclose(image.vergence_dpt[0], expected)
    behind = DepthSheet(np.ones((1, 5)), 3.0)
    both = dataclasses.replace(image, hidden=(behind,))
    np.testing.assert_allclose(both.maps[1][0][0], expected * 2.0 / 3.0)


def test_depth_of_a_turned_camera_is_along_its_own_axis():
    # A wall across the axis of the eye 2 m away, from a camera turned by 25 degrees: at its own
    # tangent u the wall is 2 / (cos - u sin) of its depths away.
    image = DepthImage(np.ones((1, 5)), 1.0, 30.0, centre_deg=(25.0, 0.0))
    u = np.linspace(-0.8, 0.8, 5) * math.tan(math.radians(15.0))
    turn = math.radians(25.0)
    depth = 2.0 / (math.cos(turn) - u * math.sin(turn))
    wall = dataclasses.replace(image, depth=depth[None])
    np.testing.assert_allclose(wall.vergence_dpt[0], 0.5, rtol=1e-12)
    infinite = dataclasses.replace(image, depth=np.full((1, 5), np.inf))
    assert np.all(infinite.vergence_dpt == 0.0)


# ---- bad input -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"projection": "perspektive"}, "unknown projection.*did you mean perspective"),
        ({"depth_kind": "rang"}, "unknown depth kind.*did you mean range"),
        ({"fov_deg": 180.0}, 'at most 179.*projection="angular"'),
        ({"centre_deg": (0.0, 95.0)}, "within 90 deg"),
        ({"fov_deg": 120.0, "centre_deg": (60.0, 0.0)}, "less than 90 deg from the axis"),
        ({"depth": 0.0081, "depth_kind": "range", "fov_deg": 90.0}, "depth must be"),
    ],
)
def test_cameras_that_cannot_be_are_refused(change, message):
    good = {"picture": np.ones((4, 4)), "depth": 1.0, "fov_deg": 40.0}
    with pytest.raises(ic.InvalidInputError, match=message):
        DepthImage(**(good | change))


def test_files_are_photographs_unless_said_otherwise(tmp_path):
    np.save(tmp_path / "p.npy", np.ones((4, 4)))
    np.save(tmp_path / "d.npy", np.full((4, 4), 2.0))
    files = tmp_path / "p.npy", tmp_path / "d.npy", 40.0
    photo = load_depth_image(*files)
    assert (photo.projection, photo.depth_kind) == ("perspective", "z")
    assert load_depth_image(*files, depth_kind="range").vergence_dpt.max() > 0.5
    assert load_depth_image(*files, projection="angular").camera is None

"""Displays: calibrated ones, stacks of planes, light fields."""

import math

import numpy as np
import pytest

import isetcl as ic
from isetcl.scene.view import intersect

SRGB_WHITE_XY = (0.3127, 0.3290)


def display(**options):
    return ic.Display((8, 4), **({"width_m": 0.4} | options))


def radiance_at(item, direction, wavelengths):
    """Spectral radiance of an object along a ray from the origin."""
    unit = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    hit = intersect(item.shape, np.zeros(3), unit)
    weights = item.material.texture.weights(hit.u, hit.v)
    spectra = np.array([s.at(wavelengths) for s in item.material.spectra()])
    return weights @ spectra


def luminance(item, direction=(0, 0, -1)):
    known = item.material.spectra()[0].wavelengths_nm
    grid = np.arange(known[0], known[-1] + 0.5, 1.0)
    values = radiance_at(item, direction, grid)
    return ic.Spectrum(grid, values).luminance_cd_m2()


@pytest.mark.parametrize(
    ("size", "wanted"),
    [
        ({"width_m": 0.4}, (0.4, 0.2)),
        ({"height_m": 0.3}, (0.6, 0.3)),
        ({"pixel_pitch_m": 1e-3}, (8e-3, 4e-3)),
        ({"width_m": 0.5, "height_m": 0.2}, (0.5, 0.2)),
    ],
)
def test_the_size_follows_from_any_of_its_numbers(size, wanted):
    screen = ic.Display((8, 4), **size)
    assert screen.size_m == pytest.approx(wanted)
    quad = screen.plane(np.zeros((4, 8)), 0.7).shape
    assert np.array(quad.edge_u_m)[0] == pytest.approx(wanted[0])
    middle = np.array(quad.corner_m) + np.array(quad.edge_u_m) / 2 + np.array(quad.edge_v_m) / 2
    np.testing.assert_allclose(middle, (0, 0, -0.7), atol=1e-15)
    assert np.cross(quad.edge_u_m, quad.edge_v_m)[2] > 0


def test_full_code_is_white_of_the_stated_luminance_and_colour():
    import colour

    screen = display(luminance_cd_m2=250.0)
    item = screen.plane(np.full((4, 8, 3), 255, np.uint8), 0.5)
    assert luminance(item) == pytest.approx(250.0, rel=1e-5)
    grid = np.arange(380.0, 781.0, 5.0)
    sd = colour.SpectralDistribution(radiance_at(item, (0, 0, -1), grid), grid)
    xyz = colour.sd_to_XYZ(sd, method="Integration")
    assert colour.XYZ_to_xy(xyz) == pytest.approx(SRGB_WHITE_XY, abs=5e-4)


@pytest.mark.parametrize(
    ("gamma", "light"),
    [
        ("srgb", ((0.5 + 0.055) / 1.055) ** 2.4),
        (2.2, 0.5**2.2),
        (np.array([0.0, 0.1, 0.4, 0.9, 2.0]), 0.2),
        (np.array([0.0, 0.3, 1.0]), 0.3),
    ],
)
def test_codes_become_light_as_the_display_does(gamma, light):
    item = display(gamma=gamma, luminance_cd_m2=100.0).plane(np.full((4, 8), 0.5), 1.0)
    assert luminance(item) == pytest.approx(100.0 * light, rel=1e-5)
    sixteen = np.full((4, 8), 32768, np.uint16)
    assert luminance(display(gamma=gamma).plane(sixteen, 1.0)) == pytest.approx(
        100.0 * light, rel=1e-3
    )


def test_a_table_of_three_columns_decodes_each_primary():
    table = np.array([[0, 0, 0], [0.2, 0.5, 0.7], [1, 1, 1]])
    screen = display(gamma=table)
    np.testing.assert_allclose(screen.decoded(np.full((1, 3), 0.5)), [[0.2, 0.5, 0.7]])
    np.testing.assert_allclose(screen.decoded(np.full((1, 3), 0.25)), [[0.1, 0.25, 0.35]])
    with pytest.raises(ic.InvalidInputError, match="must be coloured"):
        screen.decoded(np.zeros((4, 8)))


def test_black_is_not_quite_black():
    screen = display(luminance_cd_m2=200.0, black_level_cd_m2=0.5)
    assert luminance(screen.plane(np.zeros((4, 8, 3)), 1.0)) == pytest.approx(0.5, rel=1e-5)
    assert luminance(screen.plane(np.ones((4, 8, 3)), 1.0)) == pytest.approx(200.0, rel=1e-5)
    half = screen.plane(ic.Image(np.full((4, 8), 0.5)), 1.0)
    assert luminance(half) == pytest.approx(100.25, rel=1e-5)


def test_own_primaries_are_shown_as_they_are_or_scaled_together():
    lines = [
        ic.Spectrum(np.array([400.0, c - 1, c, c + 1, 700.0]), np.array([0, 0, k, 0, 0]))
        for c, k in ((610.0, 0.1), (530.0, 0.2), (450.0, 0.3))
    ]
    own = sum(s.luminance_cd_m2() for s in lines)
    plain = display(primaries=tuple(lines))
    assert plain.luminance_cd_m2 == pytest.approx(own)
    assert plain.primaries == tuple(lines)
    scaled = display(primaries=tuple(lines), luminance_cd_m2=50.0)
    assert scaled.white.luminance_cd_m2() == pytest.approx(50.0)
    ratios = [a.values.max() / b.values.max() for a, b in zip(scaled.primaries, lines, strict=True)]
    np.testing.assert_allclose(ratios, 50.0 / own)
    red = scaled.plane(np.tile([1.0, 0.0, 0.0], (4, 8, 1)), 1.0)
    assert radiance_at(red, (0, 0, -1), [530.0, 610.0])[0] == 0.0


def test_the_picture_stands_upright_and_is_not_mirrored():
    codes = np.zeros((4, 8))
    codes[0, 0] = 1.0
    item = display(gamma=1.0).plane(codes, 1.0)
    assert luminance(item, (-0.175, 0.075, -1.0)) == pytest.approx(100.0, rel=1e-3)
    for other in ((0.175, 0.075, -1.0), (-0.175, -0.075, -1.0)):
        assert luminance(item, other) == 0.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"width_m": None}, "got none"),
        ({"pixel_pitch_m": 1e-3}, "width_m and pixel_pitch_m"),
        ({"width_m": -1.0}, "width_m must be > 0"),
        ({"gamma": "linear"}, "gamma"),
        ({"gamma": 0.0}, "gamma"),
        ({"gamma": [1.0]}, "table"),
        ({"gamma": [0.0, 0.5, 0.4]}, "never falls"),
        ({"gamma": [0.0, 0.0]}, "ends above 0"),
        ({"primaries": ic.Spectrum.constant(1.0)}, "primaries"),
        ({"primaries": (ic.Spectrum.constant(1.0),) * 2}, "three spectra"),
        ({"primaries": (1, 2, 3)}, "primaries"),
        ({"luminance_cd_m2": 0.0}, "luminance_cd_m2"),
        ({"black_level_cd_m2": 100.0}, "below white"),
        ({"black_level_cd_m2": -1.0}, "black_level"),
    ],
)
def test_an_impossible_display_is_refused(options, message):
    with pytest.raises(ic.InvalidInputError, match=message):
        display(**options)


@pytest.mark.parametrize("resolution", [None, 3, (0, 4), (4,), (1.5, 2), "ab"])
def test_an_impossible_resolution_is_refused(resolution):
    with pytest.raises(ic.InvalidInputError, match="resolution"):
        ic.Display(resolution, width_m=1.0)


@pytest.mark.parametrize(
    ("picture", "message"),
    [
        (np.zeros((8, 4)), "4 rows, 8 columns"),
        (np.zeros((4, 8, 2)), "4 rows, 8 columns"),
        (np.full((4, 8), 255), "between 0 and 1"),
        (np.full((4, 8), np.nan), "between 0 and 1"),
        ("photo.png", "codes must be numbers"),
        (ic.Image(np.full((4, 8), 2.0)), "must not exceed 1"),
    ],
)
def test_a_picture_that_does_not_fit_is_refused(picture, message):
    with pytest.raises(ic.InvalidInputError, match=message):
        display().plane(picture, 1.0)
    with pytest.raises(ic.InvalidInputError, match="distance_m"):
        display().plane(np.zeros((4, 8)), 0.0)


def test_depth_is_blended_linearly_in_dioptres():
    # Half-way between 2 and 1 dpt is 1.5 dpt: 0.667 m, not 0.75 m.
    depth = np.array([0.5, 1 / 1.5, 1.0, 1 / 1.25, 0.3, np.inf])
    near, far = ic.scenes.depth_blend_weights(depth, [0.5, 1.0])
    np.testing.assert_allclose(near, [1, 0.5, 0, 0.25, 1, 0], atol=1e-12)
    np.testing.assert_allclose(far, 1 - near)
    unsorted = ic.scenes.depth_blend_weights(depth, vergences_dpt=[1.0, 0.25, 2.0])
    np.testing.assert_allclose(unsorted.sum(axis=0), 1.0)
    np.testing.assert_allclose(unsorted[2], near, atol=1e-12)
    assert unsorted[1, -1] == 1.0


def test_the_planes_together_show_the_picture():
    rng = np.random.default_rng(2)
    image = ic.Image(rng.uniform(size=(6, 9, 3)), "photo")
    depth = rng.uniform(0.3, 4.0, size=(6, 9))
    parts = ic.scenes.depth_blended_images(image, depth, vergences_dpt=[0.5, 1.5, 2.5])
    np.testing.assert_allclose(sum(p.texels for p in parts), image.texels, rtol=1e-6)
    scene = ic.scenes.multi_plane_display(parts, vergences_dpt=[0.5, 1.5, 2.5], width_deg=12.0)
    seen = 0.0
    for item, vergence in zip(scene.objects, (0.5, 1.5, 2.5), strict=True):
        assert item.material.is_additive
        assert item.shape.corner_m[2] == pytest.approx(-1.0 / vergence)
        width = np.linalg.norm(item.shape.edge_u_m)
        assert 2 * math.atan(width * vergence / 2) == pytest.approx(math.radians(12.0))
        assert np.linalg.norm(item.shape.edge_v_m) == pytest.approx(width * 6 / 9)
        seen = seen + radiance_at(item, (0.03, 0.02, -1.0), [450.0, 550.0, 650.0])
    whole = ic.scenes.image_plane(image, 1.0, 12.0).objects[0]
    wanted = radiance_at(whole, (0.03, 0.02, -1.0), [450.0, 550.0, 650.0])
    np.testing.assert_allclose(seen, wanted, rtol=1e-5)


GREY = ic.Image(np.ones((4, 4)))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ic.scenes.depth_blend_weights([1.0]), "either"),
        (lambda: ic.scenes.depth_blend_weights([1.0], [1.0], vergences_dpt=[1.0]), "either"),
        (lambda: ic.scenes.depth_blend_weights([0.0], [1.0]), "depth_m"),
        (lambda: ic.scenes.depth_blend_weights([np.nan], [1.0]), "depth_m"),
        (lambda: ic.scenes.depth_blend_weights([1.0], [1.0, 1.0]), "differ"),
        (lambda: ic.scenes.depth_blend_weights([1.0], [-1.0]), "distances_m"),
        (lambda: ic.scenes.depth_blend_weights([1.0], []), "distances_m"),
        (lambda: ic.scenes.depth_blend_weights("far", [1.0]), "depth_m"),
        (lambda: ic.scenes.depth_blended_images(GREY, np.ones((3, 4)), [1.0]), "one distance a"),
        (lambda: ic.scenes.depth_blended_images("photo", np.ones((3, 4)), [1.0]), "image"),
        (lambda: ic.scenes.multi_plane_display([GREY], [1.0, 2.0]), "one a plane"),
        (lambda: ic.scenes.multi_plane_display(GREY, [1.0]), "images"),
        (lambda: ic.scenes.multi_plane_display([GREY], [1.0], 180.0), "width_deg"),
        (
            lambda: ic.scenes.multi_plane_display([GREY, ic.Image(np.ones((4, 5)))], [1.0, 2.0]),
            "one shape",
        ),
    ],
)
def test_impossible_planes_are_refused(call, message):
    with pytest.raises(ic.InvalidInputError, match=message):
        call()


def test_a_light_field_that_is_linear_in_slope_is_met_exactly_between_view_centres():
    horizontal, vertical = math.tan(math.radians(15.0)), math.tan(math.radians(10.0))
    x = horizontal * ((np.arange(8) + 0.5) / 4 - 1)
    y = vertical * (1 - (np.arange(5) + 0.5) / 2.5)
    views = 2.0 + 3.0 * x[None, :] + 4.0 * y[:, None]
    field = ic.LightField(np.tile(views, (3, 2, 1, 1)), (30.0, 20.0))
    assert (field.shape, field.views, field.channels) == ((3, 2), (5, 8), 1)
    rng = np.random.default_rng(3)
    sx, sy = rng.uniform(x[0], x[-1], 100), rng.uniform(y[-1], y[0], 100)
    found = field.weights(rng.uniform(size=100), rng.uniform(size=100), sx, sy)
    assert found.shape == (100, 1)
    np.testing.assert_allclose(found[:, 0], 2.0 + 3.0 * sx + 4.0 * sy, rtol=1e-6)


def test_a_light_field_holds_its_border_views_and_ends_at_its_angle():
    field = ic.LightField(np.array([[[[1.0, 2.0, 3.0]]]]), (40.0, 10.0))
    edge = math.tan(math.radians(20.0))
    slopes = np.array([-1.01, -0.99, -0.7, -2 / 3, 0.0, 0.99, 1.01]) * edge
    found = field.weights(0.5, 0.5, slopes, 0.0)[:, 0]
    np.testing.assert_allclose(found, [0, 1, 1, 1, 2, 3, 0], atol=1e-6)
    assert field.weights(0.5, 0.5, 0.0, math.tan(math.radians(5.1)))[0] == 0.0


def test_pixels_and_views_of_a_light_field_lie_as_documented():
    texels = np.zeros((2, 3, 2, 2))
    texels[0, 2, 0, 1] = 1.0
    field = ic.LightField(texels, (20.0, 20.0))
    outwards = 0.9 * math.tan(math.radians(10.0))
    # Top right pixel, light that goes up and to the right.
    assert field.weights(0.99, 0.51, outwards, outwards)[0] == 1.0
    assert field.weights(0.67, 0.99, outwards, outwards)[0] == 1.0
    for u, v, x, y in ((0.65, 0.9, 1, 1), (0.9, 0.49, 1, 1), (0.9, 0.9, -1, 1), (0.9, 0.9, 1, -1)):
        assert field.weights(u, v, x * outwards, y * outwards)[0] == 0.0


def test_a_coloured_light_field_is_emitted_by_a_surface():
    rng = np.random.default_rng(5)
    field = ic.LightField(rng.uniform(size=(4, 4, 3, 3, 3)), (30.0, 30.0))
    from isetcl.scene.display import display_primaries

    glow = ic.Emission(display_primaries(100.0), field, sides="front")
    item = ic.SceneObject("display", ic.Quad((-1, -1, -1), (2, 0, 0), (0, 2, 0)), glow)
    assert ic.Scene((item,)).digest() != ic.Scene(()).digest()
    middle = field.weights(0.1, 0.9)
    np.testing.assert_allclose(middle, field.texels[0, 0, 1, 1], rtol=1e-6)
    with pytest.raises(ic.InvalidInputError, match="3 channel"):
        ic.Emission(ic.Spectrum.constant(1.0), field)
    with pytest.raises(ic.InvalidInputError, match="texture"):
        ic.Diffuse(ic.Spectrum.constant(0.5), field)


@pytest.mark.parametrize(
    ("texels", "angles", "message"),
    [
        (np.ones((2, 2)), (10, 10), "shape"),
        (np.ones((0, 2, 2, 2)), (10, 10), "shape"),
        (-np.ones((2, 2, 2, 2)), (10, 10), ">= 0"),
        (np.full((2, 2, 2, 2), np.nan), (10, 10), "finite"),
        ("views", (10, 10), "must be numbers"),
        (np.ones((2, 2, 2, 2)), 10, "two numbers"),
        (np.ones((2, 2, 2, 2)), (0, 10), "angle_deg"),
        (np.ones((2, 2, 2, 2)), (10, 180), "angle_deg"),
    ],
)
def test_an_impossible_light_field_is_refused(texels, angles, message):
    with pytest.raises(ic.InvalidInputError, match=message):
        ic.LightField(texels, angles)

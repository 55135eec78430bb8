"""PSF methods M0 to M10 against closed forms, the integral they approximate, and ray tracing."""

import math
import re

import numpy as np
import pytest
from layers import RADIUS_MM, combined, disc, layer, reference, visible

import isetcl as ic
from isetcl.psf_baseline import methods
from isetcl.psf_baseline.convolve import LayerSpectra, SpectralBlur
from isetcl.psf_baseline.pupil import thin_lens_offsets
from isetcl.psf_baseline.slicing import closed
from isetcl.psf_baseline.view import Layer

VISIBLE = [name for name, method in methods().items() if not method.needs_complete_layers]
COMPLETE = [name for name, method in methods().items() if method.needs_complete_layers]


def test_all_methods_of_the_survey_are_there():
    assert [method.id for method in methods().values()] == (
        ["M0", "M1", "M2", "M2n", "M3", "M4", "M5", "M6", "M7", "M8", "M9", "M10"]
    )
    assert methods()["layered_sum"].id == "M3"
    assert methods()["layered_over"].id == "M8"
    for method in methods().values():
        assert method.summary
        assert method.failure
        # Each says what it computes and what it does wrong.
        assert method.combine.__doc__.startswith(method.id + ":")
        text = " ".join(method.combine.__doc__.split())
        if method.name not in ("layered_sum", "layered_over"):
            assert "Known failure" in text
        # And what becomes of light and of even scenes.
        assert re.search(r"even scene|even$|[Cc]onserves", text)
        assert "light" in text.lower()
        assert method.keeps_uniform == bool(re.search("even scene stays even(?! to)", text))


@pytest.mark.parametrize(
    ("name", "guess"),
    [("gathr", "gather"), ("pupil_cliped", "pupil_clipped"), ("layered_over_norm", "layered_over")],
)
def test_unknown_methods_get_near_matches(name, guess):
    with pytest.raises(ic.InvalidInputError, match=f"did you mean.*{guess}"):
        ic.psf_baseline.render(
            ic.scenes.uniform(), ic.eyes.navarro(), method=name, fov_deg=1.0, resolution=4
        )


# ---- edges: a black half-plane (x < 0) before a white field, lengths in blur radii -----------

RHO = 64
CASES = {"A": (1.0, 0.0), "B": (0.0, 1.0), "C": (0.5, 1.0)}  # blur radii of far and near layer


def hidden(x, radius):
    """P * (x < 0) for a uniform disc, 1/2 - (t sqrt(1 - t^2) + asin t) / pi."""
    if radius == 0.0:
        return (x < 0).astype(float)
    t = np.clip(x / radius, -1.0, 1.0)
    return 0.5 - (t * np.sqrt(1.0 - t * t) + np.arcsin(t)) / np.pi


def edge_errors(name, far, near, rho=RHO, **options):
    """Largest error and its integral in blur radii."""
    rows, columns = 2 * rho + 8, 12 * rho
    x = np.arange(columns) - columns / 2 + 0.5
    cover = np.broadcast_to(x < 0, (rows, columns))
    one = np.ones((rows, columns))
    layers = [layer(0.0, one, one), layer(1.0, 0.0 * one, cover)]
    image = combined(name, layers, (far * rho, near * rho), **options)[rows // 2]
    # Beyond the middle the borders of the strip blur in.
    error = np.abs(image - (1.0 - hidden(x, near * rho)))[2 * rho : -2 * rho]
    return float(error.max()), float(error.sum() / rho)


def normalized_c():
    """M4 in case C, by its formula: white by both weights, less what passes the near layer."""
    x = (np.arange(-4096, 4096) + 0.5) / 2048
    passes, white = 1.0 - hidden(x, 1.0), 1.0 - hidden(x, 0.5)
    error = np.abs(white / (1.0 - passes + white) - passes)
    return float(error.max()), float(error.sum() / 2048)


NORMALIZED_C = normalized_c()

EDGE_TABLE = {
    # Computed for this project from the closed form: largest error and integral.
    "gather": {"A": (0.50, 0.21), "B": (0.50, 0.21), "C": (0.20, 0.11)},
    "splat": {"A": (0.50, 0.42), "B": (0.50, 0.42), "C": (0.20, 0.21)},
    "splat_normalized": {"A": (0.33, 0.16), "B": (0.50, 0.26), "C": NORMALIZED_C},
    "layered_sum": {"A": (0.50, 0.42), "B": (0.50, 0.42), "C": (0.20, 0.21)},
    "layered_normalized": {"A": (0.33, 0.16), "B": (0.50, 0.26), "C": NORMALIZED_C},
    "layered_over_visible": {"A": (0.50, 0.21), "B": (0.50, 0.21), "C": (0.28, 0.23)},
    "layered_over_normalized": {"A": (0.0, 0.0), "B": (0.50, 0.21), "C": (0.195, 0.04)},
    "ikoma": {"A": (0.004, None), "B": (0.50, 0.22), "C": (0.195, 0.05)},
    "layered_over": {"A": (0.0, 0.0), "B": (0.0, 0.0), "C": (0.0, 0.0)},
}


@pytest.mark.parametrize(
    ("name", "case", "expected"),
    [(name, case, value) for name, row in EDGE_TABLE.items() for case, value in row.items()],
)
def test_the_edge_errors_are_those_of_the_table(name, case, expected):
    largest, integral = edge_errors(name, *CASES[case])
    assert largest == pytest.approx(expected[0], abs=0.01)
    if expected[1] is not None:
        assert integral == pytest.approx(expected[1], abs=0.01)


def test_what_ikoma_adds_to_its_divisors_is_seen_where_all_else_is_exact():
    # Case A: behind the edge the far layer is divided by S + eps, S >= 1/2, and the near one covers
    # 1 / (1 + eps) of the rest: at most eps / (1/2 + eps), and eps everywhere else.
    largest, integral = edge_errors("ikoma", *CASES["A"])
    assert largest == pytest.approx(1e-3 / (0.5 + 1e-3), abs=5e-5)
    x = (np.arange(-4096, 4096) + 0.5) / 1024
    white = 1.0 - hidden(x, 1.0)
    error = np.where(x > 0, 1e-3 / (white + 1e-3), 1e-3 / 1.001 * white / (white + 1e-3))
    assert integral == pytest.approx(error.sum() / 1024, abs=2e-4)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("name", ["pupil_clipped", "aperture_samples"])
def test_methods_that_follow_rays_have_no_edge_error(name, case):
    # Rays land between samples and are shared by neighbours: a sample of 24 in a blur radius.
    largest, integral = edge_errors(name, *CASES[case], rho=24, samples=400, rays=16)
    assert largest < (0.03 if case == "B" else 0.01)
    assert integral < 0.005


@pytest.mark.parametrize("case", CASES)
def test_one_psf_is_that_of_the_nearer_of_two_layers_alike(case):
    # Half the view each. Before an even field only the nearer layer's blur is to be seen.
    assert edge_errors("single", *CASES[case])[0] < 1e-3


# ---- textures -------------------------------------------------------------------------------


def chord(n=4001):
    """The disc pupil seen edge on: places across it and their shares."""
    p = (np.arange(n) + 0.5) / n * 2.0 - 1.0
    share = np.sqrt(1.0 - p * p)
    return p, share / share.sum()


def behind_an_edge(texture, sign):
    """M8's error in case C before a texture of place in blur radii, and where it lies."""
    rows, columns = 2 * RHO + 8, 12 * RHO
    x = np.arange(columns) - columns / 2 + 0.5
    fine = (np.arange(columns * 16) + 0.5) / 16 - columns / 2
    paint = texture(fine / RHO).reshape(columns, 16).mean(axis=1)
    one = np.ones((rows, columns))
    layers = [layer(0.0, one * paint, one), layer(1.0, 0.0 * one, one * (x < 0))]
    image = combined("layered_over", layers, (sign * 0.5 * RHO, RHO))[rows // 2]
    # The integral over the pupil, seen edge on.
    p, share = chord()
    u = x[:, None] / RHO
    truth = (texture(u + sign * 0.5 * p) * (u + p > 0)) @ share
    inner = slice(2 * RHO, -2 * RHO)
    return (image - truth)[inner], x[inner] / RHO


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_two_blurred_layers_with_texture_differ_by_their_covariance_over_the_pupil(sign):
    # Black and white that meet behind the edge. With S the share of the pupil on one side of a
    # chord, the far layer shows white through S(2u) of it, and S(u) of it passes the near layer.
    error, u = behind_an_edge(lambda v: (v > 0) * 1.0, sign)
    passes, white = 1.0 - hidden(u, 1.0), 1.0 - hidden(2.0 * u, 1.0)
    # Of the two parts of the pupil one lies in the other, or they begin at opposite sides.
    both = np.minimum(passes, white) if sign > 0 else np.maximum(0.0, passes + white - 1.0)
    np.testing.assert_allclose(error, passes * white - both, atol=0.01)
    # Two numbers in [0, 1] have no larger covariance than 1/4, and here it is reached.
    assert np.abs(error).max() == pytest.approx(0.25, abs=0.01)


@pytest.mark.parametrize("period", [1.0, 1.25, 1.5])
@pytest.mark.parametrize(("sign", "expected"), [(1.0, (0.24, 0.155)), (-1.0, (0.25, 0.158))])
def test_bars_behind_a_blurred_edge_err_as_the_survey_says(sign, expected, period):
    # Computed for this project before a texture of which nothing more is told. Bars of 1 to 1.5
    # blur radii agree with it, if one of them begins at the depth edge: no fine tuning.
    error, _ = behind_an_edge(lambda v: (np.sin(2.0 * np.pi * v / period) > 0) * 1.0, sign)
    assert np.abs(error).max() == pytest.approx(expected[0], abs=0.01)
    assert np.abs(error).sum() / RHO == pytest.approx(expected[1], abs=0.01)


SIZE = 129
MIDDLE = SIZE // 2


def far_wall(row, column):
    return 0.5 + 0.4 * np.sin(column / 3.1 + 0.3) * np.cos(row / 4.3), np.ones_like(row)


def bar(row, column):
    inside = (np.abs(row - 5.0) < 9.0) & (np.abs(column + 3.0) < 20.0)
    return 0.3 + 0.2 * np.cos(row / 3.0), inside.astype(float)


def curtain(row, column):
    return 0.5 + 0.3 * np.sin(row / 2.0 + column / 5.0), (0.9 * column + 0.3 * row < -2.3) * 1.0


def sampled(function, vergence, fineness=8):
    """A layer of area means of a function of (row, column) about the middle."""
    row, column = np.mgrid[0:SIZE, 0:SIZE] - float(MIDDLE)
    part = (np.arange(fineness) + 0.5) / fineness - 0.5
    colour, cover = np.zeros((SIZE, SIZE)), np.zeros((SIZE, SIZE))
    for dy in part:
        for dx in part:
            value, covered = function(row + dy, column + dx)
            colour += value * covered / fineness**2
            cover += covered / fineness**2
    return Layer(vergence, colour[None].astype(np.float32), cover.astype(np.float32))


@pytest.mark.parametrize(
    ("functions", "defocus"),
    [
        ((far_wall, curtain), (6.0, 12.0)),
        ((far_wall, curtain), (-6.0, 12.0)),
        ((far_wall, curtain), (12.0, -7.0)),
        ((far_wall, bar, curtain), (-5.0, 4.0, 12.0)),
    ],
)
def test_clipped_psfs_and_aperture_samples_converge_to_the_integral(functions, defocus):
    layers = [sampled(f, float(k)) for k, f in enumerate(functions)]
    places = [(row, column) for row in (0, 7) for column in range(-24, 26, 3)]
    truth = reference(functions, defocus, places, count=150)

    def rms(name, samples):
        image = combined(name, layers, defocus, samples=samples, rays=256)
        found = [image[row + MIDDLE, column + MIDDLE] for row, column in places]
        return float(np.sqrt(np.mean(np.square(found - truth))))

    # What is left beside the cells: samples of a finite size.
    floor = 0.0035
    clipped, sampled_views = rms("pupil_clipped", 100), rms("aperture_samples", 300)
    assert clipped < floor
    assert sampled_views < floor
    # Few cells leave more; perfect layers put over each other are worse than either.
    assert rms("pupil_clipped", 3) > 2.0 * clipped
    assert rms("aperture_samples", 8) > 4.0 * sampled_views
    assert rms("layered_over", 0) > 2.0 * floor


@pytest.mark.parametrize("name", ["layered_sum", "splat", "single", "gather"])
def test_layers_of_equal_defocus_are_blurred_as_one_picture(name):
    layers = [sampled(f, float(k)) for k, f in enumerate((far_wall, bar, curtain))]
    seen = sum(each.colour for each in visible(layers))
    image = combined(name, layers, (9.0, 9.0, 9.0))
    from scipy.ndimage import convolve

    truth = convolve(seen[0].astype(float), disc(9.0).kernel, mode="constant")
    inner = slice(12, -12)
    assert np.max(np.abs(image - truth)[inner, inner]) < 1e-5


@pytest.mark.parametrize("defocus", [(0.0, 12.0), (12.0, 0.0)])
def test_complete_layers_over_each_other_are_exact_if_one_is_in_focus(defocus):
    functions = (far_wall, curtain)
    layers = [sampled(f, float(k)) for k, f in enumerate(functions)]
    image = combined("layered_over", layers, defocus)
    places = [(row, column) for row in (0, 7) for column in range(-24, 26, 3)]
    # A sharp layer is known by its samples: compare away from where its edge crosses them.
    places = [p for p in places if defocus[1] or abs(0.9 * p[1] + 0.3 * p[0] + 2.3) > 0.6]
    truth = reference(functions, defocus, places, count=300)
    found = [image[row + MIDDLE, column + MIDDLE] for row, column in places]
    np.testing.assert_allclose(found, truth, atol=0.006)


def test_complete_layers_over_each_other_are_not_exact_if_none_is_in_focus():
    functions, defocus = (far_wall, curtain), (6.0, 12.0)
    layers = [sampled(f, float(k)) for k, f in enumerate(functions)]
    image = combined("layered_over", layers, defocus)
    places = [(0, column) for column in range(-12, 12, 2)]
    truth = reference(functions, defocus, places)
    found = np.array([image[row + MIDDLE, column + MIDDLE] for row, column in places])
    assert np.max(np.abs(found - truth)) > 0.05


# ---- slopes ---------------------------------------------------------------------------------


def slices(count, width, rows, columns):
    """A white surface cut into vertical slices of one depth each, the last to the border."""
    x = np.arange(columns) - columns // 2
    one = np.ones((rows, columns))
    which = np.clip(x // width + count // 2, 0, count - 1)
    return [layer(float(k), one, one * (which == k)) for k in range(count)]


SLOPE = {
    # Relative to the surface: two slices; many that are thin for the blur.
    "layered_over_visible": (0.75, 1.0 - math.exp(-1.0)),
    "layered_over": (0.75, 1.0 - math.exp(-1.0)),
    "layered_sum": (1.0, 1.0),
    "layered_normalized": (1.0, 1.0),
    "ikoma": (1.0, 1.0),
    "layered_over_normalized": (1.0, 1.0),
}


@pytest.mark.parametrize("name", SLOPE)
def test_slanted_surfaces_darken_where_their_slices_lie_over_each_other(name):
    two, many = SLOPE[name]
    # Ikoma's epsilon of a thousandth is left out of its weights.
    tolerance = 2e-3 if name == "ikoma" else 1e-3
    rows, radius = 72, 30.0
    image = combined(name, slices(2, 1, rows, 256), (radius, radius))[rows // 2]
    # A sample beside the edge is half a sample from it: 2 / pi / 30 / 2.
    assert image[100:156].min() == pytest.approx(two, abs=tolerance)
    thin = slices(64, 2, rows, 256)
    image = combined(name, thin, (radius,) * 64)[rows // 2]
    assert image[128] == pytest.approx(many, abs=0.01 if many < 1 else tolerance)


# ---- even scenes and light ------------------------------------------------------------------


def even_scene(complete):
    """An even scene in three overlapping layers with ragged outlines."""
    n = 160
    row, column = np.mgrid[0:n, 0:n] - n / 2.0
    one = np.ones((n, n))
    blob = np.hypot(row, column) < 30.0
    half = column + 4.0 * np.sin(row / 5.0) < -6.0
    layers = [layer(0.0, one, one), layer(1.0, one, blob), layer(2.0, one, half)]
    return layers if complete else visible(layers)


@pytest.mark.parametrize("name", methods())
def test_even_scenes_stay_even_in_methods_that_say_so_and_in_no_other(name):
    image = combined(name, even_scene(True), (4.0, 9.0, -14.0), samples=48, rays=64)
    error = np.max(np.abs(image - 1.0)[30:-30, 30:-30])
    if methods()[name].keeps_uniform:
        assert error < 1e-6
    elif name == "ikoma":
        assert error > 1e-6
    else:
        assert error > 0.05


@pytest.mark.parametrize("name", VISIBLE)
def test_the_light_of_visible_points_is_conserved_in_methods_that_say_so_and_in_no_other(name):
    n = 160
    row, column = np.mgrid[0:n, 0:n] - n / 2.0
    texture = np.where(np.hypot(row, column) < 40.0, 1.0 + 0.5 * np.sin(column / 3.0), 0.0)
    near = (column < 0) & (np.hypot(row, column) < 40.0)
    one = np.ones((n, n))
    layers = [layer(0.0, texture, one), layer(1.0, 0.3 * texture, one * near)]
    image = combined(name, layers, (12.0, 4.0))
    light = sum(float(each.colour.sum(dtype=np.float64)) for each in visible(layers))
    error = abs(float(image.sum(dtype=np.float64)) / light - 1.0)
    assert (error < 1e-6) == methods()[name].conserves_light, error


def test_objects_before_nothing_do_not_spread_into_it():
    # Divided by its own coverage a blurred disc would be a sharp, larger one.
    n = 96
    row, column = np.mgrid[0:n, 0:n] - n / 2.0
    blob = (np.hypot(row, column) < 12.0) * np.ones((n, n))
    layers = [layer(0.0, blob, blob)]
    truth = combined("layered_sum", layers, (10.0,))
    for name in VISIBLE:
        image = combined(name, layers, (10.0,))
        np.testing.assert_allclose(image, truth, atol=1.1e-3 if name == "ikoma" else 1e-5)


def test_methods_that_follow_rays_say_that_they_need_them():
    layers = [sampled(far_wall, 0.0), sampled(curtain, 1.0)]
    psfs = [disc(3.0), disc(5.0)]
    without = SpectralBlur(LayerSpectra(layers), psfs)
    one = SpectralBlur(LayerSpectra(layers), psfs, thin_lens_offsets(RADIUS_MM, (3.0,), 4))
    for name in ("pupil_clipped", "aperture_samples"):
        with pytest.raises(ic.InvalidInputError, match="needs PupilOffsets"):
            methods()[name].combine(without, 2)
        with pytest.raises(ic.InvalidInputError, match="one vergence for each of the 2 layers"):
            methods()[name].combine(one, 2)


# ---- against ray tracing --------------------------------------------------------------------


@pytest.fixture(scope="module")
def flat():
    """A picture at one depth, its eye, and it ray-traced."""
    y, x = np.mgrid[0:64, 0:64] / 64.0
    picture = ic.Image(0.5 + 0.4 * np.sin(30 * x) * np.sin(25 * y))
    scene = ic.scenes.image_plane(picture, 0.8, 3.0)
    eye = ic.eyes.navarro(3.0, 2.0)
    where = {"fov_deg": 1.0, "resolution": 48, "wavelengths_nm": [450.0, 650.0]}
    return scene, eye, where, ic.render(scene, eye, spp=1024, bands=2, **where)


@pytest.mark.parametrize("name", methods())
def test_every_method_agrees_with_ray_tracing_at_one_depth(name, flat):
    scene, eye, where, traced = flat
    image = ic.psf_baseline.render(scene, eye, method=name, **where)
    difference = image.irradiance.values - traced.irradiance.values
    level = traced.irradiance.values.mean(axis=(1, 2))
    assert np.all(np.abs(difference.mean(axis=(1, 2))) < 2e-3 * level)
    noise2 = np.mean(np.square(traced.standard_error.values), axis=(1, 2))
    rest = np.sqrt(np.maximum(np.mean(difference**2, axis=(1, 2)) - noise2, 0.0))
    # What is left beside the noise: one PSF for the whole field, bilinear samples.
    assert np.all(rest < 4e-3 * level)


def test_off_the_axis_aperture_samples_blur_as_the_psf_does():
    # Coma and astigmatism at 13 degrees: rays through the pupil against the PSF of that place.
    eye, centre = ic.eyes.navarro(5.0, 2.0), (-5.0, 12.0)
    scene = ic.scenes.point_source(1.2, centre, diameter_arcmin=6.0)
    where = {"fov_deg": 1.6, "resolution": 48, "centre_deg": centre, "wavelengths_nm": [550.0]}
    images = [
        ic.psf_baseline.render(scene, eye, method=name, **where).irradiance.values[0]
        for name in ("layered_sum", "aperture_samples")
    ]
    assert np.max(np.abs(images[1] - images[0])) < 0.03 * images[0].max()


def test_an_object_before_nothing_is_alike_in_all_methods():
    quad = ic.Quad((-0.005, -0.005, -1.0), (0.01, 0, 0), (0, 0.01, 0))
    scene = ic.Scene((ic.SceneObject("q", quad, ic.Emission(ic.Spectrum.constant(1.0))),))
    where = {"fov_deg": 1.0, "resolution": 16, "wavelengths_nm": [550.0]}
    images = [
        ic.psf_baseline.render(scene, ic.eyes.navarro(4.0), method=name, **where).irradiance.values
        for name in methods()
    ]
    for image in images:
        np.testing.assert_allclose(image, images[0], atol=3e-3 * images[0].max())


def test_methods_that_follow_rays_are_right_where_two_textures_are_blurred():
    # Focused between two checkerboards; the strip along the edge holds half the image.
    scene, eye = ic.scenes.two_planes(), ic.eyes.navarro(4.0, 1.2)
    where = {"fov_deg": 1.0, "resolution": 64, "wavelengths_nm": [550.0]}
    traced = ic.render(scene, eye, spp=1024, **where)
    error = {}
    for name in COMPLETE:
        image = ic.psf_baseline.render(scene, eye, method=name, **where)
        error[name] = ic.validation.occlusion_error(image, traced).photopic["strip"].rms
    assert error["pupil_clipped"] < 0.02
    assert error["aperture_samples"] < 0.02
    assert error["layered_over"] > 0.08


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"slicing": "softly"}, "unknown slicing.*did you mean soft"),
        ({"pupil_samples": 0}, "pupil_samples"),
        ({"pupil_samples": 2.5}, "pupil_samples"),
    ],
)
def test_bad_options_of_methods_are_refused(options, match):
    with pytest.raises(ic.InvalidInputError, match=match):
        ic.psf_baseline.render(
            ic.scenes.two_planes(), ic.eyes.navarro(), fov_deg=1.0, resolution=8, **options
        )


def test_visible_layers_without_gaps_are_unchanged():
    seen = visible([sampled(far_wall, 0.0), sampled(curtain, 1.0)])
    for before, after in zip(seen, closed(seen), strict=True):
        np.testing.assert_allclose(after.coverage, before.coverage, atol=1e-6)

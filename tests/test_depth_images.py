"""PSF methods on pictures with depth: pinhole views, photographs with depth maps, planes."""

import functools
import math

import numpy as np
import pytest
from oracles import reduced_eye

import isetcl as ic
from isetcl.psf_baseline import DepthImage, DepthSheet, load_depth, load_depth_image, render
from isetcl.psf_baseline.picture_source import picture_stack
from isetcl.psf_baseline.view import ViewGrid

NM = np.array([500.0, 550.0, 600.0])
ONE = np.array([550.0])
GREY = ic.Spectrum.equal_energy(100.0)


@functools.cache
def eye_focused_at(dioptres=2.0):
    return ic.eyes.navarro(4.0, dioptres)


def planes(n=32, bright=(0.8, 0.3), far_dpt=0.5):
    """A near plane over the left half at 2 dpt before a far one: picture, depth in dioptres."""
    left = np.broadcast_to(np.arange(n) < n // 2, (n, n))
    return np.where(left, *bright), np.where(left, 2.0, far_dpt)


def same_planes(bright=(0.8, 0.3), far_dpt=0.5):
    """The same as surfaces, in the light of the white of an sRGB display."""
    white = ic.Display((1, 1), width_m=1.0).white
    near, far = (ic.Emission(white.scaled(b)) for b in bright)
    return ic.scenes.two_planes(
        0.5, 1.0 / far_dpt, texture="uniform", edge_angle_deg=0.0, near=near, far=far
    )


# ---- the same as scenes ----------------------------------------------------------------------


@pytest.mark.parametrize("method", ["layered_sum", "gather", "ikoma", "layered_over"])
def test_a_depth_image_gives_what_the_surfaces_it_shows_give(method):
    picture, depth = planes()
    image = DepthImage(picture, depth, 0.6, depth_unit="dpt")
    where = {"fov_deg": 0.6, "resolution": 32, "wavelengths_nm": NM}
    own = render(image, eye_focused_at(), method=method, wavelengths_nm=NM).irradiance
    theirs = render(same_planes(), eye_focused_at(), method=method, **where).irradiance
    np.testing.assert_allclose(own.values, theirs.values, rtol=2e-3)
    assert float(np.max(theirs) / np.min(theirs)) > 2.0


def test_a_pinhole_view_gives_what_its_scene_gives():
    scene = same_planes()
    where = {"fov_deg": 0.6, "resolution": 32, "wavelengths_nm": NM}
    view = ic.pinhole(scene, eye_focused_at(), layers=2, **where)
    for method in ("layered_normalized", "layered_over"):
        own = render(view, eye_focused_at(), method=method)
        theirs = render(scene, eye_focused_at(), method=method, **where)
        np.testing.assert_allclose(own.irradiance, theirs.irradiance, rtol=2e-3)
        np.testing.assert_allclose(own.dataset["x"], theirs.dataset["x"])
        np.testing.assert_allclose(own.vergence_dpt, theirs.vergence_dpt, rtol=1e-6)
    assert own.provenance["hidden"] == "given"


def test_hidden_layers_show_where_the_front_is_blurred():
    # A near black card, out of focus, before a far picture: the far one is seen through its rim.
    n = 32
    left = np.broadcast_to(np.arange(n) < n // 2, (n, n)).astype(float)
    far = DepthSheet(np.full((n, n), 0.6), 0.5)
    image = DepthImage(
        np.zeros((n, n)), 3.0, 0.6, alpha=left, depth_unit="dpt", hidden=(far,), name="card"
    )
    focused_far = eye_focused_at(0.5)
    made = render(image, focused_far, method="layered_over", wavelengths_nm=ONE)
    profile = made.irradiance.values[0, n // 2] / made.irradiance.values.max()
    # Closed form: the disc's edge function of the blur radius a |dD|, on a straight edge.
    a_m = focused_far.entrance_pupil(550.0).diameter_mm / 2e3
    pitch = 0.6 / n
    rho = math.degrees(a_m * 2.5) / pitch
    t = np.clip((np.arange(n) + 0.5 - n / 2) / rho, -1.0, 1.0)
    expected = 0.5 + (t * np.sqrt(1 - t * t) + np.arcsin(t)) / np.pi
    np.testing.assert_allclose(profile, expected, atol=0.03)


def test_soft_alpha_mixes_two_sheets_at_one_depth():
    grey = DepthImage(
        np.full((4, 4), 1.0), 1.0, 1.0, alpha=0.25, hidden=(DepthSheet(np.full((4, 4), 0.2), 1.0),)
    )
    plain = DepthImage(np.full((4, 4), 0.25 * 1.0 + 0.75 * 0.2), 1.0, 1.0)
    for method in ("layered_sum", "layered_over"):
        one, other = (
            render(image, eye_focused_at(1.0), method=method, wavelengths_nm=ONE).irradiance
            for image in (grey, plain)
        )
        np.testing.assert_allclose(one, other, rtol=1e-5)


def test_extended_backgrounds_leave_no_dark_rim_and_none_does():
    picture, depth = planes(bright=(0.0, 0.5))
    image = DepthImage(picture, depth, 0.6, depth_unit="dpt")
    truth = render(
        same_planes((0.0, 0.5)),
        eye_focused_at(0.5),
        method="layered_over",
        fov_deg=0.6,
        resolution=32,
        wavelengths_nm=ONE,
    ).irradiance.values
    # At the very edge half of the light is missing; the pixel beside it has a little more.
    for hidden, least, most in (("extend", 0.0, 0.005), ("none", 0.35, 0.5)):
        made = render(
            image, eye_focused_at(0.5), method="layered_over", hidden=hidden, wavelengths_nm=ONE
        )
        error = np.abs(made.irradiance.values - truth).max() / truth.max()
        assert least <= error <= most
        assert made.provenance["hidden"] == hidden


# ---- pixels, borders -------------------------------------------------------------------------


def layers_of(image, view, border="reflect"):
    stack = picture_stack(image, ONE, border)
    return stack.layers_on(view, np.array([-np.inf, np.inf]), False)


@pytest.mark.parametrize("resolution", [5, 9, 12, 31])
def test_samples_of_any_size_are_means_over_their_area(resolution):
    rng = np.random.default_rng(3)
    picture = rng.random((12, 12))
    image = DepthImage(picture, 1.0, 1.2)
    grid = ic.RetinalGrid.of(reduced_eye(), 1.2, resolution)
    (layer,) = layers_of(image, ViewGrid(grid, 1, 0))
    # A second way: cut every pixel into so many parts that samples are whole numbers of them.
    fine = np.kron(picture, np.ones((resolution, resolution)))
    expected = fine.reshape(resolution, 12, resolution, 12).mean(axis=(1, 3))
    np.testing.assert_allclose(layer.colour[0], expected, rtol=1e-5)
    np.testing.assert_allclose(layer.coverage, 1.0, rtol=1e-6)


@pytest.mark.parametrize(
    ("border", "mode"), [("reflect", "symmetric"), ("replicate", "edge"), ("zero", "constant")]
)
def test_borders_go_on_as_the_user_says(border, mode):
    rng = np.random.default_rng(4)
    picture = rng.random((5, 5))
    grid = ic.RetinalGrid.of(reduced_eye(), 0.5, 5)
    # A margin of nearly three times the picture: it is mirrored more than once.
    (layer,) = layers_of(DepthImage(picture, 1.0, 0.5), ViewGrid(grid, 1, 14), border)
    np.testing.assert_allclose(layer.colour[0], np.pad(picture, 14, mode=mode), rtol=1e-6)
    inside = np.pad(np.ones((5, 5)), 14) if border == "zero" else 1.0
    np.testing.assert_allclose(layer.coverage, inside)


def test_blur_wider_than_the_picture_is_said_and_keeps_a_mirrored_field_even():
    image = DepthImage(np.full((4, 4), 0.5), 1.0, 0.05)
    blurred = eye_focused_at(6.0)
    for border, part in (("reflect", 1.0), ("replicate", 1.0), ("zero", None)):
        made = render(image, blurred, border=border, wavelengths_nm=ONE)
        sharp = render(image, eye_focused_at(1.0), border="reflect", wavelengths_nm=ONE)
        details = made.provenance
        assert details["border"] == border
        assert details["blur_is_wider_than_image"]
        assert details["border_deg"] > 0.05
        ratio = made.irradiance.values / sharp.irradiance.values
        if part is None:
            # A picture of side s seen through a disc of radius a dD: s^2 / (pi (a dD)^2).
            radius = math.degrees(blurred.entrance_pupil(550.0).diameter_mm / 2e3 * 5.0)
            assert ratio.mean() == pytest.approx(0.05**2 / (math.pi * radius**2), rel=0.2)
        else:
            # The two eyes differ in their pupil, not in the evenness of the field.
            assert np.ptp(ratio) / ratio.mean() < 1e-4
    small = render(image, eye_focused_at(1.0), wavelengths_nm=ONE, fov_deg=0.05, resolution=64)
    assert not small.provenance["blur_is_wider_than_image"]


def test_a_picture_of_one_pixel_is_an_even_field():
    one = DepthImage(np.array([[0.5]]), np.array([[2.0]]), 1.0)
    many = DepthImage(np.full((8, 8), 0.5), 2.0, 1.0)
    made = render(one, eye_focused_at(), wavelengths_nm=ONE, method="gather")
    assert made.irradiance.shape == (1, 1, 1)
    other = render(many, eye_focused_at(), wavelengths_nm=ONE, fov_deg=1.0, resolution=1)
    np.testing.assert_allclose(made.irradiance, other.irradiance, rtol=1e-5)


def test_a_pinhole_view_of_one_pixel_cannot_tell_its_size():
    view = ic.pinhole(same_planes(), reduced_eye(), fov_deg=0.5, resolution=1, wavelengths_nm=ONE)
    with pytest.raises(ic.InvalidInputError, match="one pixel does not tell"):
        render(view, reduced_eye())


@pytest.mark.parametrize("method", sorted(ic.psf_baseline.methods()))
def test_without_depth_variation_all_methods_agree(method):
    picture = np.random.default_rng(5).random((16, 16))
    image = DepthImage(picture, np.full((16, 16), 0.8), 0.4)
    options = {"wavelengths_nm": ONE, "pupil_samples": 400}
    made = render(image, eye_focused_at(1.0), method=method, **options).irradiance.values
    plain = render(image, eye_focused_at(1.0), method="single", wavelengths_nm=ONE)
    assert len(plain.provenance["layers_dpt"]) == 1
    # M7 adds a thousandth to what it divides by; M10 has a staircase of rays for a PSF.
    allowed = {"ikoma": 1.1e-3, "aperture_samples": 0.03}.get(method, 1e-4)
    np.testing.assert_allclose(made, plain.irradiance, rtol=allowed)


# ---- light -----------------------------------------------------------------------------------


def test_light_is_that_of_the_display():
    codes = np.full((2, 2, 3), 128, np.uint8)
    display = ic.Display(
        (2, 2), width_m=0.1, gamma=2.0, luminance_cd_m2=50.0, black_level_cd_m2=5.0
    )
    stack = picture_stack(DepthImage(codes, 1.0, 1.0, display=display), NM)
    (sheet,) = stack.sheets
    radiance = np.tensordot(stack.basis.spectra.T, sheet.colour, axes=1)[:, 0, 0]
    # 5 cd/m^2 of black and the rest by the square of the code, of the colour of white.
    level = (5.0 + 45.0 * (128 / 255) ** 2) / 50.0
    np.testing.assert_allclose(radiance, level * display.white.at(NM), rtol=1e-5)
    linear = DepthImage(np.full((2, 2, 3), (128 / 255) ** 2), 1.0, 1.0, display=display)
    same = picture_stack(linear, NM).sheets[0].colour
    np.testing.assert_allclose(same, sheet.colour, rtol=1e-5)


def test_spectral_cubes_keep_their_spectra():
    rng = np.random.default_rng(6)
    grid = np.array([450.0, 550.0, 650.0])
    values = rng.random((3, 4, 3))
    image = DepthImage(ic.SpectralCube(values, grid), 1.0, 1.0)
    at = np.array([450.0, 500.0, 650.0])
    stack = picture_stack(image, at)
    got = np.tensordot(stack.basis.spectra.T, stack.sheets[0].colour, axes=1)
    middle = (values[..., 0] + values[..., 1]) / 2.0
    expected = np.stack([values[..., 0], middle, values[..., 2]])
    np.testing.assert_allclose(got, expected, atol=1e-4)
    with pytest.raises(ic.InvalidInputError, match="known from 450 to 650"):
        render(image, reduced_eye(), wavelengths_nm=[700.0])
    default = render(image, reduced_eye(), resolution=2, fov_deg=0.5)
    assert default.wavelengths_nm.tolist() == [450.0 + 10.0 * k for k in range(21)]


def test_a_view_of_few_spectra_has_few_channels():
    view = ic.pinhole(same_planes(), reduced_eye(), fov_deg=0.5, resolution=4, layers=2)
    assert len(picture_stack(view, view.radiance["wavelength"].values).basis.spectra) == 1
    with pytest.raises(ic.InvalidInputError, match="not known at"):
        render(view, reduced_eye(), wavelengths_nm=[455.5])


# ---- depth -----------------------------------------------------------------------------------


def test_metres_and_dioptres_are_the_same_and_infinity_is_zero_dioptres():
    picture, dioptres = planes(8, far_dpt=0.0)
    with np.errstate(divide="ignore"):
        metres = 1.0 / dioptres
    one = DepthImage(picture, metres, 0.5)
    other = DepthImage(picture, dioptres, 0.5, depth_unit="dpt")
    np.testing.assert_allclose(one.vergence_dpt, other.vergence_dpt)
    assert one.vergence_dpt.min() == 0.0
    made = render(one, eye_focused_at(), wavelengths_nm=ONE)
    assert min(made.provenance["layers_dpt"]) == 0.0
    assert np.isfinite(made.irradiance.values).all()


@pytest.mark.parametrize(
    ("unit", "bad"),
    [("m", np.nan), ("m", 0.0), ("m", -1.0), ("m", 0.001), ("m", -np.inf),
     ("dpt", np.nan), ("dpt", -0.1), ("dpt", np.inf), ("dpt", 200.0)],
)  # fmt: skip
def test_depths_that_are_none_are_refused_with_their_place(unit, bad):
    depth = np.ones((3, 4))
    depth[1, 2] = bad
    with pytest.raises(ic.InvalidInputError, match="row 1, column 2 and 1 such"):
        DepthImage(np.ones((3, 4)), depth, 1.0, depth_unit=unit)
    # Where nothing is covered a depth means nothing.
    alpha = np.ones((3, 4))
    alpha[1, 2] = 0.0
    image = DepthImage(np.ones((3, 4)), depth, 1.0, depth_unit=unit, alpha=alpha)
    assert np.isfinite(image.vergence_dpt).all()


def test_sizes_must_fit():
    with pytest.raises(ic.InvalidInputError, match=r"depth must have shape \(3, 4\).*\(4, 3\)"):
        DepthImage(np.ones((3, 4)), np.ones((4, 3)), 1.0)
    with pytest.raises(ic.InvalidInputError, match="alpha must have shape"):
        DepthImage(np.ones((3, 4)), 1.0, 1.0, alpha=np.ones((2, 4)))
    with pytest.raises(ic.InvalidInputError, match="hidden layer 1 must have 3 rows and 4 columns"):
        DepthImage(np.ones((3, 4)), 1.0, 1.0, hidden=(DepthSheet(np.ones((3, 5)), 2.0),))
    with pytest.raises(ic.InvalidInputError, match=r"\(rows, columns, 3\)"):
        DepthImage(np.ones((3, 4, 2)), 1.0, 1.0)
    with pytest.raises(ic.InvalidInputError, match=r"\(rows, columns, 3\)"):
        DepthImage(np.ones((0, 4)), 1.0, 1.0)


def test_layers_out_of_order_are_refused():
    depth = np.full((2, 2), 3.0)
    depth[0, 0] = 1.0
    behind = (DepthSheet(np.ones((2, 2)), depth),)
    with pytest.raises(ic.InvalidInputError, match=r"layer 1 must lie at or behind.*1 pixel"):
        DepthImage(np.ones((2, 2)), 2.0, 1.0, hidden=behind)
    one = np.ones((2, 2))
    with pytest.raises(ic.InvalidInputError, match="must fall from plane to plane"):
        DepthImage.of_planes([one, one], [0.5, 2.0], [1.0, 1.0], 1.0)
    with pytest.raises(ic.InvalidInputError, match="as many"):
        DepthImage.of_planes([one], [0.5, 2.0], [1.0, 1.0], 1.0)


def test_planes_are_sheets_near_to_far():
    one = np.ones((2, 2))
    image = DepthImage.of_planes([one, 0.5 * one], [2.0, 0.5], [0.5, 1.0], 1.0)
    assert [v.max() for v, _ in image.maps] == [2.0, 0.5]
    assert image.maps[0][1].max() == 0.5


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"alpha": 1.5}, "alpha must lie between 0 and 1"),
        ({"depth_unit": "cm"}, "unknown depth unit"),
        ({"fov_deg": -1.0}, "fov_deg"),
        ({"fov_deg": (1.0, 0.0)}, "height"),
        ({"display": 3}, "display must be a Display"),
        ({"hidden": (3,)}, "hidden must be a DepthSheet"),
        ({"hidden": (DepthSheet(ic.SpectralCube(np.ones((2, 2, 1)), [550.0]), 9.0),)}, "or none"),
    ],
)
def test_other_bad_arguments_are_named(change, message):
    good = {"picture": np.ones((2, 2)), "depth": 1.0, "fov_deg": 1.0}
    with pytest.raises(ic.InvalidInputError, match=message):
        DepthImage(**(good | change))


def test_bad_pictures_and_options_are_refused_by_render():
    good = DepthImage(np.ones((2, 2)), 1.0, 1.0)
    with pytest.raises(ic.InvalidInputError, match="finite and >= 0"):
        render(DepthImage(np.array([[1.0, np.nan]]), 1.0, 1.0), reduced_eye(), wavelengths_nm=ONE)
    with pytest.raises(ic.InvalidInputError, match=r"unknown border.*did you mean reflect"):
        render(good, reduced_eye(), border="reflct", wavelengths_nm=ONE)
    with pytest.raises(ic.InvalidInputError, match="unknown hidden"):
        render(good, reduced_eye(), hidden="guess", wavelengths_nm=ONE)
    with pytest.raises(ic.InvalidInputError, match="outside pictures"):
        render(good, reduced_eye(), scatter=ic.ScatterModel(), wavelengths_nm=ONE)
    with pytest.raises(ic.InvalidInputError, match="scene must be"):
        render(np.ones((2, 2)), reduced_eye())
    with pytest.raises(ic.InvalidInputError, match="square pixels"):
        render(DepthImage(np.ones((2, 2)), 1.0, (1.0, 2.0)), reduced_eye(), wavelengths_nm=ONE)


# ---- files -----------------------------------------------------------------------------------


def test_depth_maps_are_read_from_all_kinds_of_files(tmp_path):
    from skimage.io import imsave
    from test_pbrt import exr

    metres = (np.arange(42.0).reshape(6, 7) + 1.0) / 8.0
    np.save(tmp_path / "d.npy", metres)
    imsave(tmp_path / "d.tiff", metres.astype(np.float32), check_contrast=False)
    imsave(tmp_path / "d.png", (metres * 1000).astype(np.uint16), check_contrast=False)
    (tmp_path / "d.exr").write_bytes(exr(np.repeat(metres[..., None], 3, axis=2), 2, 2))
    for name in ("d.npy", "d.tiff", "d.exr"):
        np.testing.assert_allclose(load_depth(tmp_path / name), metres)
    np.testing.assert_allclose(load_depth(tmp_path / "d.png", 0.001), metres)
    with pytest.raises(ic.InvalidInputError, match="pass scale"):
        load_depth(tmp_path / "d.png")


def test_infinite_and_bad_numbers_in_float_files_are_kept_for_the_check(tmp_path):
    from test_pbrt import exr

    metres = np.array([[np.inf, -1.0], [np.nan, 2.0]])
    (tmp_path / "d.exr").write_bytes(exr(np.repeat(metres[..., None], 3, axis=2), 0, 2))
    np.save(tmp_path / "p.npy", np.ones((2, 2)))
    with pytest.raises(ic.FileError, match="one number a pixel"):
        # NaN differs from itself: the channels are not equal.
        load_depth(tmp_path / "d.exr")
    metres[1, 0] = 3.0
    (tmp_path / "d.exr").write_bytes(exr(np.repeat(metres[..., None], 3, axis=2), 0, 2))
    assert load_depth(tmp_path / "d.exr").tolist() == metres.tolist()
    with pytest.raises(ic.InvalidInputError, match="got -1 at row 0, column 1"):
        load_depth_image(tmp_path / "p.npy", tmp_path / "d.exr", 1.0)


def test_a_photograph_and_its_map_make_an_image(tmp_path):
    from skimage.io import imsave

    codes = np.arange(36, dtype=np.uint8).reshape(3, 4, 3) * 7
    imsave(tmp_path / "p.png", codes, check_contrast=False)
    np.save(tmp_path / "d.npy", np.full((3, 4), 2.0))
    image = load_depth_image(tmp_path / "p.png", tmp_path / "d.npy", 1.0, centre_deg=(1.0, 0.0))
    assert image.name == "p.png"
    # Three rows for four columns in tangents, not in angles.
    high = math.degrees(2.0 * math.atan(0.75 * math.tan(math.radians(0.5))))
    assert image.fov_deg == pytest.approx((1.0, high), rel=1e-12)
    even = load_depth_image(tmp_path / "p.png", tmp_path / "d.npy", 1.0, projection="angular")
    assert even.fov_deg == (1.0, 0.75)
    power = ic.Display((4, 3), width_m=1.0, gamma=2.0)
    squared = load_depth_image(tmp_path / "p.png", tmp_path / "d.npy", 1.0, display=power)
    np.testing.assert_allclose(squared.picture.texels, (codes / 255.0) ** 2, atol=1e-6)
    with pytest.raises(ic.InvalidInputError, match="unknown option"):
        load_depth_image(tmp_path / "p.png", tmp_path / "d.npy", 1.0, alphas=1.0)


@pytest.mark.parametrize("name", ["nothing.npy", "text.npy", "text.png", "text.exr", "rgb.npy"])
def test_files_without_a_map_are_refused(tmp_path, name):
    if name.startswith("text"):
        (tmp_path / name).write_text("no picture")
    if name.startswith("rgb"):
        np.save(tmp_path / name, np.random.default_rng(0).random((2, 2, 3)))
    with pytest.raises(ic.FileError, match=name):
        load_depth(tmp_path / name)

"""Depth from focus: stacks made by blurring known scenes with discs, and what is found in them."""

import functools
import math

import numpy as np
import pytest

import isetcl as ic
from isetcl.psf_baseline import DepthImage, FocalStack, load_focal_stack, render

N = 72
FOV_DEG = 4.0
APERTURE_MM = 20.0
PIXEL = 2.0 * math.tan(math.radians(FOV_DEG / 2.0)) / N
RESOLUTION = PIXEL / (APERTURE_MM / 1e3)  # one pixel of blur, A dV
STEP = 3.0 * RESOLUTION
FOCUS = 0.3 + STEP * np.arange(7)
INNER = slice(10, -10)


@functools.cache
def disc(radius):
    """A uniform disc on pixels by the share of 11 x 11 points in each that it covers."""
    half = math.ceil(radius + 0.5)
    fine = (np.arange((2 * half + 1) * 11) + 0.5) / 11 - half - 0.5
    inside = np.hypot(fine, fine[:, None]) <= max(radius, 0.05)
    share = inside.reshape(2 * half + 1, 11, 2 * half + 1, 11).mean(axis=(1, 3))
    return share / share.sum()


def blurred(picture, vergence, focus):
    """A plane at a vergence, photographed: a disc A |dV| wide."""
    from scipy.signal import fftconvolve

    kernel = disc(round(abs(vergence - focus) / RESOLUTION / 2.0, 6))
    reach = len(kernel) // 2
    return fftconvolve(np.pad(picture, reach, mode="symmetric"), kernel, mode="valid")


@functools.cache
def texture(seed=0):
    return 0.5 + 0.4 * np.random.default_rng(seed).uniform(-1.0, 1.0, (N, N))


def stack_of(vergence, focus=FOCUS, noise=0.0, **options):
    rng = np.random.default_rng(5)
    pictures = [
        np.maximum(blurred(texture(), vergence, f) + noise * rng.normal(size=(N, N)), 0.0)
        for f in focus
    ]
    return FocalStack(pictures, focus, APERTURE_MM, FOV_DEG, **options)


# ---- depth -----------------------------------------------------------------------------------


def test_the_resolution_is_a_pixel_of_blur():
    assert stack_of(0.5).resolution_dpt == pytest.approx(RESOLUTION, rel=1e-12)
    even = stack_of(0.5, projection="angular")
    assert even.resolution_dpt == pytest.approx(math.radians(FOV_DEG) / N / 0.02, rel=1e-12)


@pytest.mark.parametrize("noise", [0.0, 0.005])
@pytest.mark.parametrize("place", [2.0, 2.25, 2.5, 3.4, 3.75])
def test_depth_is_found_between_the_pictures_to_a_pixel_of_blur(place, noise):
    vergence = FOCUS[0] + place * STEP
    found = stack_of(vergence, noise=noise).depth()
    error = (found.vergence_dpt - vergence)[INNER, INNER]
    assert np.abs(error).max() < RESOLUTION
    # That is three times finer than the steps of the stack, and most pixels are better still.
    assert np.sqrt(np.mean(error**2)) < 0.4 * RESOLUTION
    assert found.known_share == 1.0
    assert repr(found).startswith("<FocusDepth of ")
    assert repr(found).endswith(" pixels, 100% known>")


def test_stacks_may_fall_or_rise_and_step_unevenly():
    vergence = FOCUS[0] + 2.4 * STEP
    rising = stack_of(vergence).depth().vergence_dpt
    falling = stack_of(vergence, FOCUS[::-1]).depth().vergence_dpt
    np.testing.assert_allclose(falling, rising, rtol=1e-5)
    uneven = FOCUS[0] + STEP * np.array([0.0, 0.8, 1.9, 2.7, 4.2, 5.0])
    found = stack_of(vergence, uneven).depth().vergence_dpt[INNER, INNER]
    assert np.abs(found - vergence).max() < RESOLUTION


def test_what_lies_beyond_the_stack_is_put_at_its_end():
    for vergence, end in ((FOCUS[-1] + 2.0 * STEP, FOCUS[-1]), (0.0, FOCUS[0])):
        found = stack_of(vergence).depth(least_confidence=0.0)
        np.testing.assert_array_equal(found.vergence_dpt[INNER, INNER], end)


@pytest.fixture(scope="module")
def two_planes():
    """The left half at the second focus, the right one near the sixth; a flat patch on it."""
    left = np.arange(N) < N // 2
    flat = np.zeros((N, N), bool)
    flat[20:52, 44:68] = True
    near, far = np.where(flat, 0.5, texture(1)), texture(2)
    depths = FOCUS[1], FOCUS[5] - 0.3 * STEP
    pictures = [
        np.where(left, blurred(far, depths[0], f), blurred(near, depths[1], f)) for f in FOCUS
    ]
    # A cut without blur of its own: what blurs over the edge is another test.
    truth = np.where(left, far, near)
    return FocalStack(pictures, FOCUS, APERTURE_MM, FOV_DEG), depths, truth, flat


def test_planes_and_the_picture_in_focus_are_recovered(two_planes):
    stack, depths, truth, _ = two_planes
    found = stack.depth()
    away = np.abs(np.arange(N) - (N - 1) / 2.0)
    clear = np.broadcast_to(away > 10, (N, N)).copy()
    clear[:10] = clear[-10:] = False
    for part, depth in ((slice(0, N // 2), depths[0]), (slice(N // 2, N), depths[1])):
        own = clear & found.is_known
        own[:, : part.start], own[:, part.stop :] = False, False
        assert own.mean() > 0.15
        assert np.abs(found.vergence_dpt[own] - depth).max() < RESOLUTION
        # Focused there, or with a disc of radius 0.45 pixels, which stays inside a pixel.
        np.testing.assert_allclose(found.picture[own], truth[own], atol=1e-9)


def test_even_areas_are_unknown_and_take_the_nearest_known_depth(two_planes):
    stack, depths, _, _ = two_planes
    found = stack.depth(window=5)
    # The widest blur, 15 pixels across, reaches into the patch from all sides.
    inside = slice(31, 41), slice(54, 58)
    assert np.all(found.confidence[inside] == 0.0)
    assert not found.is_known[inside].any()
    assert 0.5 < found.known_share < 1.0
    assert np.abs(found.vergence_dpt[inside] - depths[1]).max() < 2.0 * STEP


def test_noise_alone_has_no_depth():
    rng = np.random.default_rng(0)
    pictures = [0.5 + 0.02 * rng.normal(size=(N, N)) for _ in FOCUS]
    stack = FocalStack(pictures, FOCUS, APERTURE_MM, FOV_DEG)
    found = stack.depth(least_confidence=0.0)
    assert found.confidence.max() < 0.35
    with pytest.raises(ic.InvalidInputError, match="focus changes the contrast of no pixel"):
        stack.depth()


def test_an_even_stack_has_no_depth_at_all():
    stack = FocalStack([np.full((9, 9), 0.5)] * 3, [0.0, 1.0, 2.0], 4.0, 1.0)
    with pytest.raises(ic.InvalidInputError, match=r"largest confidence 0, .*needs texture"):
        stack.depth_image()


# ---- on to images ----------------------------------------------------------------------------


def test_a_focal_stack_renders_as_the_picture_and_depth_it_was_made_of():
    vergence = FOCUS[3]
    stack = stack_of(vergence)
    image = stack.depth_image()
    assert isinstance(image, DepthImage)
    assert image.projection == "perspective"
    eye = ic.eyes.navarro(3.0, 1.5)
    where = {"resolution": 24, "fov_deg": 2.0, "wavelengths_nm": [550.0], "method": "gather"}
    made = render(image, eye, **where).irradiance.values
    truth = render(DepthImage(texture(), 1.0 / vergence, FOV_DEG), eye, **where).irradiance.values
    np.testing.assert_allclose(made, truth, rtol=0.01)


def test_stacks_are_read_from_files_and_decoded_by_the_display(tmp_path):
    from skimage.io import imsave

    stack = stack_of(FOCUS[2])
    display = ic.Display((4, 4), width_m=1.0, gamma=2.0, black_level_cd_m2=1.0)
    paths = []
    for k, picture in enumerate(stack.pictures):
        codes = np.round(np.sqrt(np.clip(picture, 0.0, 1.0)) * 255).astype(np.uint8)
        paths.append(tmp_path / f"{k}.png")
        imsave(paths[-1], np.stack([codes] * 3, axis=-1), check_contrast=False)
    read = load_focal_stack(paths, FOCUS, APERTURE_MM, FOV_DEG, display=display, name="shelf")
    found = read.depth()
    assert found.picture.shape == (N, N, 3)
    inner = (slice(10, -10),) * 2
    assert np.abs(found.vergence_dpt - FOCUS[2])[inner].max() < RESOLUTION
    np.testing.assert_allclose(found.picture[..., 0], stack.pictures[2], atol=0.004)
    image = read.depth_image()
    assert (image.name, image.display) == ("shelf", display)
    with pytest.raises(ic.InvalidInputError, match="unknown option"):
        load_focal_stack(paths, FOCUS, APERTURE_MM, FOV_DEG, names="shelf")
    with pytest.raises(ic.FileError, match="does not exist"):
        load_focal_stack([*paths[:6], tmp_path / "no.png"], FOCUS, APERTURE_MM, FOV_DEG)


# ---- bad input -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"pictures": [np.ones((4, 4)), np.ones((4, 5)), np.ones((4, 4))]},
            "picture 1 must have 4",
        ),
        ({"pictures": [np.ones((4, 4)), np.ones((4, 4, 3)), np.ones((4, 4))]}, "all grey or all"),
        ({"pictures": [np.ones((4, 4))] * 2, "focus_dpt": [0.0, 1.0]}, "at least 3 pictures"),
        ({"focus_dpt": [0.0, 1.0]}, "a focus for each"),
        ({"focus_dpt": [0.0, 2.0, 1.0]}, "all rise or all fall.*sort"),
        ({"focus_dpt": [0.0, 1.0, 1.0]}, "all rise or all fall.*doubles"),
        ({"focus_dpt": [-1.0, 0.0, 1.0]}, "must be >= 0"),
        ({"focus_dpt": [0.0, 1.0, np.nan]}, "focus_dpt"),
        ({"focus_dpt": [0.0, 1.0, np.inf]}, "must be >= 0 and < 125"),
        ({"aperture_mm": 0.0}, "aperture_mm"),
        ({"fov_deg": -1.0}, "fov_deg"),
        ({"projection": "flat"}, "unknown projection"),
        ({"pictures": [np.ones((4, 4)), np.ones((4, 4)), 2.0 * np.ones((4, 4))]}, "one exposure"),
        ({"pictures": [np.ones((4, 4)), np.ones((4, 4)), np.zeros((4, 4))]}, "picture 2 is black"),
        ({"pictures": [np.ones((4, 4)), np.ones((4, 4)), -np.ones((4, 4))]}, "finite and >= 0"),
        ({"pictures": 3}, "pictures must be"),
    ],
)
def test_stacks_that_cannot_be_are_refused(change, message):
    good = {
        "pictures": [np.ones((4, 4))] * 3,
        "focus_dpt": [0.0, 1.0, 2.0],
        "aperture_mm": 4.0,
        "fov_deg": 1.0,
    }
    with pytest.raises(ic.InvalidInputError, match=message):
        FocalStack(**(good | change))


@pytest.mark.parametrize("options", [{"window": 0}, {"window": 99}, {"least_confidence": 1.5}])
def test_options_out_of_range_are_refused(options):
    with pytest.raises(ic.InvalidInputError, match=next(iter(options))):
        stack_of(FOCUS[3]).depth(**options)

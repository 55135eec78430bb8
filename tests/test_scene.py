"""Shapes, materials, textures, targets and the spectra of a scene."""

import math

import numpy as np
import pytest

import isetcl as ic
from isetcl.scene.basis import spectral_basis
from isetcl.scene.display import display_primaries
from isetcl.scene.texture import decode_srgb
from isetcl.scene.view import intersect
from isetcl.spectrum import default_wavelengths_nm

WHITE = ic.Spectrum.equal_energy(100.0)


def hits(shape, origin, direction):
    d = np.asarray(direction, dtype=float)
    return intersect(shape, np.asarray(origin, dtype=float), d / np.linalg.norm(d))


def test_a_quad_is_hit_inside_and_missed_outside():
    quad = ic.Quad((-1, -1, -2), (2, 0, 0), (0, 2, 0))
    assert hits(quad, (0, 0, 0), (0, 0, -1)).distance_m == 2.0
    inside = hits(quad, (0, 0, 0), (0.25, -0.4, -1))
    assert (inside.u, inside.v) == (pytest.approx(0.75), pytest.approx(0.1))
    assert hits(quad, (0, 0, 0), (0.6, 0, -1)).distance_m == math.inf
    assert hits(quad, (0, 0, 0), (0, 0, 1)).distance_m == math.inf
    assert hits(quad, (0, 0, 0), (1, 0, 0)).distance_m == math.inf


def test_a_leaning_parallelogram_has_its_own_coordinates():
    quad = ic.Quad((0, 0, -1), (1, 0, -1), (0.5, 1, 0))
    point = np.array([0, 0, -1]) + 0.3 * np.array([1, 0, -1]) + 0.6 * np.array([0.5, 1, 0])
    found = hits(quad, (0, 0, 0), point)
    assert found.distance_m == pytest.approx(np.linalg.norm(point))
    assert (found.u, found.v) == (pytest.approx(0.3), pytest.approx(0.6))


def test_a_disc_is_round():
    disc = ic.Disc((0, 0, -1), 0.5)
    assert hits(disc, (0, 0, 0), (0.49, 0, -1)).distance_m < 2
    assert hits(disc, (0, 0, 0), (0.4, 0.4, -1)).distance_m == math.inf
    up = hits(disc, (0, 0, 0), (0, 0.4, -1))
    assert up.v == pytest.approx(0.9)


def test_a_sphere_is_seen_from_outside_and_from_inside():
    sphere = ic.Sphere((0, 0, -2), 0.5)
    assert hits(sphere, (0, 0, 0), (0, 0, -1)).distance_m == pytest.approx(1.5)
    assert hits(sphere, (0, 0, -2), (0, 0, -1)).distance_m == pytest.approx(0.5)
    assert hits(sphere, (0, 0, 0), (0, 0, 1)).distance_m == math.inf
    north = hits(sphere, (0, 0, 0), (0, 0.2, -1))
    assert north.v > 0.5
    # Texture coordinates run from pole to pole: v is latitude over 180 degrees.
    assert hits(sphere, (0, 5, -2), (0, -1, 0)).v == pytest.approx(1.0)
    assert hits(sphere, (0, -5, -2), (0, 1, 0)).v == pytest.approx(0.0)
    oblique = hits(sphere, (0, 5, 3), (0, -1 / math.sqrt(2), -1 / math.sqrt(2)))
    assert oblique.v == pytest.approx(0.75)


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: ic.Quad((0, 0, 0), (1, 0, 0), (2, 0, 0)), "span an area"),
        (lambda: ic.Quad((0, 0, float("nan")), (1, 0, 0), (0, 1, 0)), "finite"),
        (lambda: ic.Quad((0, 0), (1, 0, 0), (0, 1, 0)), "three"),
        (lambda: ic.Disc((0, 0, -1), 0.0), "radius_m must be > 0"),
        (lambda: ic.Disc((0, 0, -1), 1.0, (0, 0, 0)), "normal must not be zero"),
        (lambda: ic.Sphere((0, 0, -1), -2.0), "radius_m must be > 0"),
        (lambda: ic.Sphere((0, 0, -1), float("nan")), "finite"),
        (lambda: ic.Checkerboard(0, 1), "periods_u must be > 0"),
        (lambda: ic.Checkerboard(1, 1, -1.0), "bright must be >= 0"),
        (lambda: ic.Image(np.zeros(4)), "must have shape"),
        (lambda: ic.Image(np.full((2, 2), -1.0)), ">= 0"),
        (lambda: ic.Image(np.full((2, 2), np.nan)), "finite"),
        (lambda: ic.Emission(WHITE, ic.Image(np.zeros((2, 2, 3)))), "as many spectra"),
        (lambda: ic.Emission((WHITE, WHITE)), "as many spectra"),
        (lambda: ic.UnlitReflectance(ic.Spectrum.constant(1.2), WHITE), "<= 1"),
        (lambda: ic.Spectrum(np.array([500.0, 400.0]), np.array([1.0, 1.0])), "ascending"),
        (lambda: ic.Spectrum(np.array([400.0, 500.0]), np.array([1.0, -1.0])), ">= 0"),
        (lambda: ic.Spectrum(np.array([400.0]), np.array([1.0, 2.0])), "one entry per wavelength"),
        (lambda: ic.Spectrum.illuminant("D66"), "did you mean D65"),
        (lambda: ic.Spectrum.equal_energy(0.0), "luminance_cd_m2 must be > 0"),
        (lambda: ic.Spectrum.constant(1.0).at([100.0]), "200 to 2000"),
        (lambda: ic.scenes.two_planes(2.0, 0.5), "smaller than far_m"),
        (lambda: ic.scenes.two_planes(-1.0, 0.5), "near_m must be > 0"),
        (lambda: ic.scenes.two_planes(texture="chequers"), "checkerboard"),
        (lambda: ic.scenes.slanted_edge(contrast=1.5), "contrast must lie between"),
        (lambda: ic.scenes.point_source(0.0), "distance_m must be > 0"),
        (lambda: ic.scenes.image_plane(ic.Image(np.ones((2, 2))), 1.0, 200.0), "width_deg"),
    ],
)
def test_bad_scenes_are_refused_with_the_rule(make, match):
    with pytest.raises(ic.InvalidInputError, match=match):
        make()


def test_a_checkerboard_alternates():
    board = ic.Checkerboard(2, 1, 0.8, 0.1)
    u = np.array([0.1, 0.3, 0.6, 0.9])
    np.testing.assert_allclose(board.weights(u, 0.2 + 0 * u)[:, 0], [0.8, 0.1, 0.8, 0.1])
    np.testing.assert_allclose(board.weights(u, 0.7 + 0 * u)[:, 0], [0.1, 0.8, 0.1, 0.8])


def test_an_image_is_the_right_way_up_and_bilinear():
    image = ic.Image(np.array([[0.0, 1.0], [0.5, 0.25]]))
    corners = image.weights(np.array([0.25, 0.75, 0.25, 0.75]), np.array([0.75, 0.75, 0.25, 0.25]))
    np.testing.assert_allclose(corners[:, 0], [0.0, 1.0, 0.5, 0.25], atol=1e-7)
    assert image.weights(np.array([0.5]), np.array([0.5]))[0, 0] == pytest.approx(0.4375)
    assert image.weights(np.array([0.0]), np.array([0.0]))[0, 0] == pytest.approx(0.5)


@pytest.mark.parametrize("shape", [(64, 64), (50, 37), (65, 64, 3), (3, 200)])
def test_halving_an_image_keeps_its_mean_and_its_place(shape):
    rng = np.random.default_rng(0)
    image = ic.Image(rng.random(shape))
    half = image.halved(1)
    assert half.shape == (max(1, shape[0] // 2), max(1, shape[1] // 2))
    assert half.texels.mean() == pytest.approx(image.texels.mean(), rel=0.02)
    ramp = ic.Image(np.tile(np.linspace(0, 1, shape[1], dtype=np.float32), (shape[0], 1)))
    u, v = np.linspace(0.1, 0.9, 9), np.full(9, 0.5)
    np.testing.assert_allclose(ramp.halved(1).weights(u, v), ramp.weights(u, v), atol=0.03)


def test_images_are_decoded_from_srgb(tmp_path):
    from skimage.io import imsave

    codes = np.array([[0, 64, 128], [188, 230, 255]], dtype=np.uint8)
    path = tmp_path / "grey.png"
    imsave(path, codes, check_contrast=False)
    # IEC 61966-2-1: code 188 is half of white.
    texels = ic.load_image(path).texels
    assert texels[1, 0] == pytest.approx(0.5029, abs=1e-3)
    assert texels[0, 0] == 0.0
    assert texels[1, 2] == 1.0
    # IEC 61966-2-1: ((64 / 255 + 0.055) / 1.055)^2.4.
    assert texels[0, 1] == pytest.approx(0.05126945837, rel=1e-5)


@pytest.mark.parametrize(
    ("shape", "dtype", "channels"),
    [
        ((4, 5), np.uint8, 1),
        ((4, 5, 3), np.uint8, 3),
        ((4, 5, 4), np.uint8, 3),
        ((4, 5), np.uint16, 1),
    ],
)
def test_images_of_all_common_kinds_are_read(tmp_path, shape, dtype, channels):
    from skimage.io import imsave

    path = tmp_path / "image.png"
    data = np.random.default_rng(0).integers(0, np.iinfo(dtype).max, shape).astype(dtype)
    imsave(path, data, check_contrast=False)
    image = ic.load_image(path)
    assert image.channels == channels
    assert image.shape == (4, 5)
    assert image.texels.max() <= 1.0


def test_alpha_is_composited_on_black(tmp_path):
    from skimage.io import imsave

    data = np.zeros((1, 2, 4), dtype=np.uint8)
    data[..., :3] = 255
    data[0, 0, 3], data[0, 1, 3] = 255, 51
    imsave(tmp_path / "a.png", data, check_contrast=False)
    np.testing.assert_allclose(
        ic.load_image(tmp_path / "a.png").texels[0, :, 0], [1.0, 0.2], atol=1e-6
    )


def test_files_that_are_no_images_are_refused(tmp_path):
    with pytest.raises(ic.FileError, match="does not exist"):
        ic.load_image(tmp_path / "none.png")
    broken = tmp_path / "broken.png"
    broken.write_bytes(b"\x89PNG\r\n\x1a\nrubbish")
    with pytest.raises(ic.FileError, match="cannot be read as an image"):
        ic.load_image(broken)


def test_luminance_of_a_spectrum_is_what_was_asked_for():
    for spectrum in (
        ic.Spectrum.equal_energy(42.0),
        ic.Spectrum.illuminant("D65", 42.0),
        ic.Spectrum.illuminant("FL2", 42.0),
    ):
        assert spectrum.luminance_cd_m2() == pytest.approx(42.0, rel=1e-12)


def test_the_shipped_luminosity_function_is_colour_science_s():
    import colour

    from isetcl.spectrum import luminous_efficiency

    v = colour.colorimetry.SDS_LEFS_PHOTOPIC["CIE 1924 Photopic Standard Observer"]
    np.testing.assert_allclose(luminous_efficiency(np.asarray(v.domain)), v.values, rtol=1e-8)
    assert luminous_efficiency(555.0) == 1.0
    assert luminous_efficiency(300.0) == 0.0


def test_display_primaries_reproduce_the_colours_they_are_given():
    # The tristimulus values of linear sRGB times the primaries are those of sRGB.
    import colour

    wavelengths = np.arange(380.0, 781.0, 5.0)
    primaries = np.array([s.at(wavelengths) for s in display_primaries(1.0)])
    cmfs = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    bars = np.stack([np.interp(wavelengths, cmfs.wavelengths, cmfs.values[:, i]) for i in range(3)])
    xyz = 683.0 * 5.0 * primaries @ bars.T
    matrix = np.asarray(colour.models.RGB_COLOURSPACES["sRGB"].matrix_RGB_to_XYZ)
    np.testing.assert_allclose(xyz.T, matrix, atol=4e-3)


def test_a_black_and_white_scene_has_one_spectrum():
    basis = spectral_basis(ic.scenes.two_planes(), default_wavelengths_nm())
    assert basis.spectra.shape == (1, 31)
    assert all(c.shape == (1, 1) for c in basis.objects)


def test_pictures_on_one_display_share_three_spectra():
    picture = ic.Image(np.random.default_rng(0).random((4, 4, 3)))
    scene = ic.scenes.image_planes(picture, picture, 0.5, 2.0, 5.0)
    assert spectral_basis(scene, default_wavelengths_nm()).spectra.shape == (3, 31)


def test_a_mixture_of_spectra_adds_none():
    wavelengths = default_wavelengths_nm()
    a = ic.Spectrum(wavelengths, np.linspace(0.1, 1.0, 31), "a")
    b = ic.Spectrum(wavelengths, np.linspace(1.0, 0.2, 31), "b")
    mixed = ic.Spectrum(wavelengths, 0.3 * a.values + 2.0 * b.values, "mixed")
    quad = ic.Quad((-1, -1, -2), (2, 0, 0), (0, 2, 0))
    scene = ic.Scene(
        tuple(ic.SceneObject(s.name, quad, ic.Emission(s)) for s in (a, b, mixed)), a.scaled(3.0)
    )
    basis = spectral_basis(scene, wavelengths)
    assert len(basis.spectra) == 2
    np.testing.assert_allclose(basis.objects[2] @ basis.spectra, [mixed.values], rtol=1e-9)
    np.testing.assert_allclose(basis.background @ basis.spectra, 3.0 * a.values, rtol=1e-9)


def test_a_spectrum_that_does_not_cover_the_wavelengths_is_refused():
    scene = ic.Scene((), ic.Spectrum(np.array([450.0, 600.0]), np.ones(2), "narrow"))
    with pytest.raises(ic.InvalidInputError, match="'narrow' is known from 450 to 600"):
        spectral_basis(scene, default_wavelengths_nm())


def test_the_two_planes_are_the_paper_s():
    scene = ic.scenes.two_planes()
    near, far = (item.shape for item in scene.objects)
    assert near.corner_m[2] == -0.5
    assert far.corner_m[2] == -2.0
    # Checks of 10 m / 1024 on both planes.
    for item in scene.objects:
        width = np.linalg.norm(item.shape.edge_u_m)
        check = width / (2 * item.material.texture.periods_u)
        assert check == pytest.approx(10.0 / 1024.0, rel=1e-12)
    # The near plane lies left of an edge through the axis that leans by 45 deg.
    for direction, expected in (((-1, -1, 0), 0.5), ((1, 1, 0), 2.0)):
        d = np.array([0.0, 0.0, -1.0]) + 1e-3 * np.array(direction)
        nearest = min(float(hits(item.shape, (0, 0, 0), d).distance_m) for item in scene.objects)
        assert nearest == pytest.approx(expected, rel=1e-4)


def test_a_point_source_lies_in_its_direction():
    scene = ic.scenes.point_source(2.0, (3.0, -4.0))
    disc = scene.objects[0].shape
    centre = np.array(disc.centre_m)
    assert np.linalg.norm(centre) == pytest.approx(2.0)
    assert math.degrees(math.acos(-centre[2] / 2.0)) == pytest.approx(5.0)
    assert centre[0] > 0 > centre[1]


def test_an_image_plane_subtends_the_angle_asked_for():
    scene = ic.scenes.image_plane(ic.Image(np.ones((10, 20))), 0.5, 12.0)
    width = np.linalg.norm(scene.objects[0].shape.edge_u_m)
    assert math.degrees(2 * math.atan(width / 2 / 0.5)) == pytest.approx(12.0)


def test_digests_tell_scenes_apart():
    digests = {
        ic.scenes.two_planes().digest(),
        ic.scenes.two_planes(0.4).digest(),
        ic.scenes.two_planes(dark=0.1).digest(),
        ic.scenes.two_planes(luminance_cd_m2=99.0).digest(),
        ic.scenes.uniform().digest(),
    }
    assert len(digests) == 5
    assert ic.scenes.two_planes().digest() == ic.scenes.two_planes().digest()


def test_srgb_follows_both_branches_of_iec_61966():

    np.testing.assert_allclose(
        decode_srgb(np.array([0.02, 0.04045])), np.array([0.02, 0.04045]) / 12.92, rtol=1e-12
    )
    assert decode_srgb(0.2) == pytest.approx(0.0331047666, rel=1e-6)


def test_a_bilevel_image_is_black_and_white():
    from isetcl.scene.texture import _linear_light

    assert _linear_light(np.array([[True, False]])).tolist() == [[1.0, 0.0]]


def test_a_disc_may_lie_on_the_floor():
    from isetcl.scene.view import intersect

    d = np.array([0.0, -1.0, -3.0]) / math.sqrt(10.0)
    hit = intersect(ic.Disc((0, -1, -3), 0.5, (0, 1, 0)), np.zeros(3), d)
    assert hit.distance_m == pytest.approx(math.sqrt(10.0))
    assert (hit.u, hit.v) == (pytest.approx(0.5), pytest.approx(0.5))


def test_the_background_is_part_of_the_digest():
    assert ic.scenes.uniform(100.0).digest() != ic.scenes.uniform(99.0).digest()


def test_the_slanted_edge_is_bright_left_and_leans_anticlockwise():
    from isetcl.scene.view import nearest_distance_m

    scene = ic.scenes.slanted_edge(1.0, 5.0, contrast=0.5)
    white, dark = (o.material.radiance.at([550.0])[0] for o in scene.objects)
    assert dark / white == pytest.approx(1.0 / 3.0)
    t = math.tan(math.radians(5.0))
    for x, y, index in (
        (-0.2, 0, 0),
        (0.2, 0, 1),
        (-t + 0.01, 1, 1),
        (-t - 0.01, 1, 0),
        (t - 0.01, -1, 0),
        (t + 0.01, -1, 1),
    ):
        d = np.array([x, y, -1.0]) / np.linalg.norm([x, y, -1.0])
        assert nearest_distance_m(scene, np.zeros(3), d)[1] == index


def test_a_point_source_subtends_its_diameter():
    disc = ic.scenes.point_source(2.0, diameter_arcmin=30.0).objects[0].shape
    assert 2 * math.degrees(math.atan(disc.radius_m / 2.0)) == pytest.approx(0.5)


def test_photographs_cover_the_left_half_and_the_whole_field():
    from isetcl.scene.view import nearest_distance_m

    for shape in ((30, 60), (60, 30), (40, 40)):
        pic = ic.Image(np.ones(shape))
        scene = ic.scenes.image_planes(ic.Image(np.ones((60, 60))), pic, 0.5, 2.0, 10.0)
        t = math.tan(math.radians(5.0))
        for x, y, depth in (
            (-0.01, 0.99, 0.5),
            (-0.01, -0.99, 0.5),
            (0.01, 0.0, 2.0),
            (0.99, 0.99, 2.0),
            (0.99, -0.99, 2.0),
        ):
            d = np.array([x * t, y * t, -1.0])
            n = np.linalg.norm(d)
            assert nearest_distance_m(scene, np.zeros(3), d / n)[0] / n == pytest.approx(depth)


def test_a_spectrum_is_not_extrapolated_at_either_end():
    s = ic.Spectrum(np.array([400.0, 600.0]), np.ones(2))
    for w in (399.0, 601.0):
        with pytest.raises(ic.InvalidInputError, match="400 to 600"):
            s.at([w])


def test_reflectance_and_light_meet_on_their_common_wavelengths():
    m = ic.UnlitReflectance(
        ic.Spectrum(np.array([400.0, 700.0]), np.array([0.5, 0.5])), ic.Spectrum.equal_energy(100.0)
    )
    assert m.spectra()[0].at([550.0])[0] == pytest.approx(
        0.5 * ic.Spectrum.equal_energy(100.0).at([550.0])[0]
    )


def test_spectra_that_differ_by_half_a_percent_stay_apart():
    from isetcl.scene.basis import spectral_basis

    w = np.linspace(400.0, 700.0, 31)
    a = ic.Spectrum(w, np.ones(31))
    b = ic.Spectrum(w, 1 + 0.005 * np.sin(w / 20))
    q = ic.Quad((-1, -1, -2), (2, 0, 0), (0, 2, 0))
    basis = spectral_basis(
        ic.Scene(tuple(ic.SceneObject("q", q, ic.Emission(s)) for s in (a, b))), w
    )
    np.testing.assert_allclose(basis.objects[1] @ basis.spectra, [b.values], rtol=1e-8)


def test_of_coincident_walls_the_first_is_seen():
    from isetcl.scene.view import nearest_distance_m

    q = ic.Quad((-1, -1, -2), (2, 0, 0), (0, 2, 0))
    near = ic.Quad((-1, -1, -1), (2, 0, 0), (0, 2, 0))
    scene = ic.Scene(
        tuple(
            ic.SceneObject(str(i), s, ic.Emission(ic.Spectrum.equal_energy(100.0)))
            for i, s in enumerate((q, near, near, q))
        )
    )
    distance, index = nearest_distance_m(scene, np.zeros(3), np.array([0.0, 0.0, -1.0]))
    assert (float(distance), int(index)) == (1.0, 1)


def test_luminance_is_absolute():
    assert ic.Spectrum.constant(1.0).luminance_cd_m2() == pytest.approx(683.0 * 106.857, rel=1e-5)


def test_light_of_very_different_strength_keeps_its_spectrum():
    from isetcl.scene.basis import spectral_basis

    w = np.linspace(400.0, 700.0, 31)
    high = ic.Spectrum(w, np.linspace(1e14, 2e14, 31))
    low = ic.Spectrum(w, np.linspace(2.0, 1.0, 31))
    flat = ic.Spectrum(w, np.ones(31))
    q = ic.Quad((-1, -1, -2), (2, 0, 0), (0, 2, 0))
    objects = tuple(ic.SceneObject("q", q, ic.Emission(s)) for s in (high, low, flat))
    basis = spectral_basis(ic.Scene(objects), w)
    np.testing.assert_allclose(basis.objects[2] @ basis.spectra, [flat.values], rtol=1e-3)


def save_photograph(path, mode, orientation=None):
    from PIL import Image as Pillow

    picture = Pillow.fromarray(np.uint8([[[255, 0, 0], [0, 255, 0], [0, 0, 255]]] * 2)).resize(
        (24, 16), Pillow.Resampling.NEAREST
    )
    exif = picture.getexif()
    if orientation is not None:
        exif[0x0112] = orientation
    picture.convert(mode).save(path, exif=exif) if mode != "P" else picture.convert("P").save(path)
    return path


def test_photographs_are_turned_upright(tmp_path):
    image = ic.load_image(save_photograph(tmp_path / "a.jpg", "RGB", orientation=6))
    # 6: the stored picture must be turned clockwise; its left column, red, comes to the top.
    assert image.shape == (24, 16)
    assert np.argmax(image.texels[2, 8]) == 0
    assert np.argmax(image.texels[-3, 8]) == 2


@pytest.mark.parametrize(("name", "mode"), [("a.gif", "P"), ("a.jpg", "CMYK"), ("a.png", "RGBA")])
def test_pictures_of_other_modes_keep_their_colours(tmp_path, name, mode):
    image = ic.load_image(save_photograph(tmp_path / name, mode))
    assert image.shape == (16, 24)
    for column, channel in ((3, 0), (12, 1), (20, 2)):
        assert np.argmax(image.texels[8, column]) == channel
        assert image.texels[8, column, channel] > 0.8


def test_a_grey_picture_beside_a_coloured_one_stands_in_the_same_light():
    grey, colour = ic.Image(np.ones((4, 4))), ic.Image(np.ones((4, 4, 3)))
    scene = ic.scenes.image_planes(grey, colour, 0.5, 2.0, 8.0)
    w = np.arange(400.0, 701.0, 10.0)
    lights = [sum(s.at(w) for s in item.material.spectra()) for item in scene.objects]
    np.testing.assert_allclose(lights[0], lights[1], rtol=1e-6)
    alone = ic.scenes.image_planes(grey, grey, 0.5, 2.0, 8.0).objects[0].material.spectra()[0]
    assert np.ptp(alone.at(w)) < 1e-12 * alone.at(w)[0]


def test_a_picture_is_cut_in_the_middle():
    texels = np.arange(24.0).reshape(4, 6)
    assert ic.Image(texels).cropped(1.0).texels.tolist() == texels[:, 1:5].tolist()
    assert ic.Image(texels).cropped(3.0).texels.tolist() == texels[1:3].tolist()


def test_a_tall_near_picture_covers_the_left_half_and_no_more():
    from isetcl.scene.view import nearest_distance_m

    tall = ic.Image(np.ones((512, 120)))
    scene = ic.scenes.image_planes(tall, ic.Image(np.ones((64, 64))), 0.5, 2.0, 10.0)
    slope = np.tan(np.radians(5.0))
    for x, y, depth in ((-0.99, 0.9, 0.5), (-0.01, -0.9, 0.5), (0.01, 0.9, 2.0), (0.99, 0.0, 2.0)):
        d = np.array([x * slope, y * slope, -1.0])
        n = float(np.linalg.norm(d))
        assert nearest_distance_m(scene, np.zeros(3), d / n)[0] / n == pytest.approx(depth)

"""Plans: what is compiled in, with reasons; bands; grids; memory."""

import dataclasses
import math

import numpy as np
import pytest
from oracles import reduced_eye
from slow_cases import slow_after

import isetcl as ic
from isetcl.device.eye_features import EyeFeatures
from isetcl.eye.exit_pupil import exit_pupil_bound
from isetcl.eye.sequential import trace
from isetcl.render import plan as plan_module
from isetcl.render.direct import tiles
from isetcl.retina.bands import choose_bands
from isetcl.spectrum import default_wavelengths_nm


def features(plan):
    return {
        f.name: getattr(plan.config, f.name)
        for f in dataclasses.fields(plan.config)
        if f.name.startswith("has_")
    }


def test_a_simple_scene_needs_little():
    plan = ic.plan(ic.scenes.two_planes(texture="uniform"), ic.eyes.legrand(3.0), fov_deg=5.0)
    assert {name for name, value in features(plan).items() if value} == {"has_patches"}
    assert plan.config.n_basis == 1
    text = plan.explain()
    for line in ("conic surfaces", "spheres", "images", "far sides", "clipping", "emission only"):
        assert line in text
    assert "every refracting surface is a sphere" in text


@pytest.mark.slow
def test_every_feature_is_found_when_it_is_needed():
    white = ic.Spectrum.equal_energy()
    picture = ic.Image(np.random.default_rng(0).random((8, 8, 3)))
    blue = ic.Spectrum.illuminant("D65")
    scene = ic.Scene(
        (
            ic.SceneObject("disc", ic.Disc((0, 0, -1), 0.1), ic.Emission(white)),
            ic.SceneObject(
                "ball",
                ic.Sphere((0, 0, -2), 0.3),
                ic.Emission(blue, ic.Checkerboard(2, 2)),
            ),
            ic.SceneObject(
                "picture",
                ic.Quad((-1, -1, -3), (2, 0, 0), (0, 2, 0)),
                ic.scenes.picture(picture),
            ),
        )
    )
    eye = ic.eyes.navarro(8.0)
    aspheric = dataclasses.replace(
        eye,
        retina=ic.Retina.from_radius(23.9203, -12.0, 0.2),
        stop=dataclasses.replace(eye.stop, decentre_mm=(0.2, 0.1)),
        accommodation_model=None,
    )
    bends = {"diffraction": "airy", "scatter": ic.ScatterModel()}
    plan = ic.plan(scene, aspheric, fov_deg=130.0, resolution=16, bands=1, **bends)
    # Surfaces of other shapes and in other places are those of test_surfaces.py.
    of_eyes = {f.name for f in dataclasses.fields(EyeFeatures) if f.name.startswith("has_")}
    others = of_eyes - {"has_conics", "has_placed_stop"} | {"has_relief"}
    assert {name for name, value in features(plan).items() if not value} == others
    # Equal energy and the three primaries; D65 is the sum of the primaries.
    assert plan.config.n_basis == 4
    assert plan.config.texture_channels == 3


def test_another_prescription_pupil_or_accommodation_compiles_nothing_new():
    scene = ic.scenes.two_planes()
    configs = {
        ic.plan(scene, eye, fov_deg=5.0, resolution=64, bands=4).config
        for eye in (
            ic.eyes.navarro(2.0),
            ic.eyes.navarro(5.0, 3.0),
            ic.eyes.arizona(4.0, 1.0),
            ic.eyes.arizona(3.0, interpolation="linear"),
        )
    }
    assert len(configs) == 1


def test_one_band_serves_an_achromatic_eye_or_a_single_wavelength():
    achromatic = ic.plan(ic.scenes.uniform(), reduced_eye(), fov_deg=5.0)
    assert len(achromatic.band_choice.bands) == 1
    assert "bends all wavelengths alike" in achromatic.explain()
    single = ic.plan(ic.scenes.uniform(), ic.eyes.navarro(), wavelengths_nm=[550.0])
    assert len(single.band_choice.bands) == 1


def test_every_wavelength_belongs_to_exactly_one_band_for_every_legal_number():
    # The paper's renderer leaves the longest wavelengths black for 19 of its 30 legal values.
    grid = ic.RetinalGrid.of(ic.eyes.navarro(), 10.0, 256)
    wavelengths = default_wavelengths_nm()
    for count in range(1, 32):
        bands = choose_bands(grid.eye, grid, wavelengths, count).bands
        assert len(bands) == count
        assert [i for b in bands for i in range(b.first, b.last + 1)] == list(range(31))
        for band in bands:
            assert wavelengths[band.first] <= band.wavelength_nm <= wavelengths[band.last]


def test_more_bands_leave_less_displacement_and_31_leave_none():
    grid = ic.RetinalGrid.of(ic.eyes.navarro(), 10.0, 256)
    left = [
        choose_bands(grid.eye, grid, default_wavelengths_nm(), n).displacement_pixels
        for n in (1, 2, 4, 8, 16, 31)
    ]
    assert left == sorted(left, reverse=True)
    assert left[-1] == 0.0


def test_auto_takes_fewer_bands_where_pixels_are_coarse():
    eye = ic.eyes.navarro()
    coarse = ic.RetinalGrid.of(eye, 40.0, 64)
    fine = ic.RetinalGrid.of(eye, 2.0, 512)
    wavelengths = default_wavelengths_nm()
    few = choose_bands(eye, coarse, wavelengths, "auto")
    many = choose_bands(eye, fine, wavelengths, "auto")
    assert len(few.bands) < len(many.bands) == 16
    assert few.displacement_pixels <= 0.5


def test_images_are_averaged_down_where_a_pixel_covers_many_texels():
    picture = ic.Image(np.random.default_rng(0).random((2048, 2048)))
    plan = ic.plan(ic.scenes.image_plane(picture, 1.0, 10.0), ic.eyes.navarro(), resolution=64)
    # 32 texels across a pixel: blocks of 8 leave 4, whose blur is a fifth of the pixel's own.
    assert plan.images[0].shape == (256, 256)
    assert "1/8" in plan.explain()
    fine = ic.plan(ic.scenes.image_plane(picture, 1.0, 10.0), ic.eyes.navarro(), resolution=1024)
    assert fine.images[0].shape == (2048, 2048)


@pytest.mark.slow
def test_texels_are_packed_only_where_that_is_harmless():
    picture = ic.Image(np.random.default_rng(0).random((8, 8, 3)))
    scene = ic.scenes.image_plane(picture, 1.0, 10.0)
    rough = ic.plan(scene, ic.eyes.navarro(), expected_error=0.01)
    exact = ic.plan(scene, ic.eyes.navarro(), expected_error=1e-4)
    double = ic.plan(scene, ic.eyes.navarro(), precision="double", expected_error=0.01)
    packed = [p.config.is_texture_packed for p in (rough, exact, double)]
    assert packed == [True, False, False]


def test_tiles_cover_the_image_once(monkeypatch):
    monkeypatch.setattr(plan_module, "_TILE_FILM_BYTES", 4000)
    plan = ic.plan(ic.scenes.uniform(), ic.eyes.navarro(), resolution=(37, 23), bands=2)
    covered = np.zeros((23, 37), dtype=int)
    for tile in tiles(plan):
        covered[tile.window] += 1
        assert tile.columns <= plan.tile[0]
        assert tile.rows <= plan.tile[1]
    assert (covered == 1).all()
    assert len(tiles(plan)) > 1


@pytest.mark.parametrize("stop_mm", [0.1, 2.0, 8.0])
@pytest.mark.parametrize("limit", slow_after(2, [0.5, 75.0, 10.0, 40.0]))
@pytest.mark.parametrize("name", ["navarro", "arizona", "legrand"])
def test_the_pupil_bound_misses_no_light(name, stop_mm, limit):
    # Shoot many rays at a region 20 % wider than the bound: all that pass lie inside it.
    eye = ic.eyes.by_name(name, stop_mm)
    grid_map = eye.field_map(550.0)
    bound = exit_pupil_bound(eye, 450.0, grid_map, limit)
    rng = np.random.default_rng(2)
    inside, passed = 0, 0
    for field in np.linspace(0.0, limit, 7):
        g = field / limit
        s = g * g
        poly = np.polynomial.polynomial.polyval
        semi = float(poly(s, bound.semi))
        tangential = semi + s * float(poly(s, bound.stretch))
        r = 1.2 * np.sqrt(rng.uniform(size=4000))
        turn = rng.uniform(0, 2 * np.pi, 4000)
        x = semi * r * np.cos(turn)
        y = g * float(poly(s, bound.centre)) + tangential * r * np.sin(turn)
        start = grid_map.retinal_point_mm(np.array(0.0), np.array(field))
        aim = np.stack([x, y, np.full_like(x, bound.z_mm)], axis=1) - start
        rays = trace(eye, np.broadcast_to(start, aim.shape), aim, 450.0, towards="scene")
        assert not np.any(rays.passed & (r > 1.0 + 1e-9))
        inside += int(np.sum(r <= 1.0))
        passed += int(rays.passed.sum())
    if not bound.clipped_elsewhere:
        assert passed > 0.97 * inside


def test_grids_are_upright_and_centred():
    grid = ic.RetinalGrid.of(ic.eyes.navarro(), 4.0, (8, 4), (1.0, -2.0))
    assert grid.fov_deg == (4.0, 2.0)
    assert grid.x_deg.mean() == pytest.approx(1.0)
    assert grid.y_deg.mean() == pytest.approx(-2.0)
    assert grid.y_deg[0] > grid.y_deg[-1]
    assert grid.shape == (4, 8)
    assert grid.directions()[0, 0, 1] > grid.directions()[-1, 0, 1]


def test_the_polynomials_of_a_grid_are_its_chief_rays():
    for fov in (0.5, 20.0, 100.0):
        grid = ic.RetinalGrid.of(ic.eyes.navarro(), fov, 16)
        chord, depth = grid.polynomials()
        g = np.linspace(0.01, 1.0, 33)
        poly = np.polynomial.polynomial.polyval
        point = grid.field_map.retinal_point_mm(0 * g, g * grid.limit_deg)
        np.testing.assert_allclose(-g * poly(g * g, chord), point[:, 1], atol=2e-8)
        np.testing.assert_allclose(
            poly(g * g, depth) + grid.eye.retina.vertex_z_mm, point[:, 2], atol=2e-8
        )


def test_displacement_is_the_published_chromatic_aberration():
    from isetcl.retina.bands import choose_bands

    # transverse: 2.387 arcmin at 5 deg between 430 and 770 nm; half of it to either side
    eye = ic.eyes.navarro(0.01)
    grid = ic.RetinalGrid.of(eye, 5.0 * math.sqrt(2.0), 100)
    found = choose_bands(eye, grid, np.array([430.0, 770.0]), 1)
    assert 2 * found.displacement_pixels * 60 * grid.pitch_deg[0] == pytest.approx(2.387, rel=0.03)
    # longitudinal: 2.466 dpt between 400 and 700 nm times the radius of the entrance pupil
    eye = ic.eyes.navarro(4.0)
    grid = ic.RetinalGrid.of(eye, 0.01, 4)
    found = choose_bands(eye, grid, np.array([400.0, 700.0]), 1)
    angle = 2 * found.displacement_pixels * math.radians(grid.pitch_deg[0])
    assert angle == pytest.approx(2.466 * 2.0e-3 * 1.1334, rel=0.012)


def test_band_wavelength_is_its_mean():
    from isetcl.retina.bands import choose_bands

    grid = ic.RetinalGrid.of(ic.eyes.navarro(), 2.0, 64)
    w = np.arange(400.0, 701.0, 10.0)
    (band,) = choose_bands(grid.eye, grid, w, 1).bands
    assert band.wavelength_nm == pytest.approx(550.0)


def test_a_band_s_wavelengths_have_their_own_throughput():
    from isetcl.eye.throughput import axial_irradiance_per_radiance as axial

    eye = ic.eyes.navarro(3.0)
    w = np.array([400.0, 550.0, 700.0])
    image = ic.render(
        ic.scenes.uniform(100.0),
        eye,
        fov_deg=0.05,
        resolution=4,
        spp=512,
        bands=1,
        wavelengths_nm=w,
    )
    got = image.irradiance.values.mean(axis=(1, 2)) / ic.Spectrum.equal_energy(100.0).at(w)
    assert got == pytest.approx([axial(eye, x) for x in w], rel=1e-3)


def test_a_picture_on_a_sphere_is_halved_by_its_own_texel():
    picture = ic.Image(np.random.default_rng(0).random((1024, 2048)))
    ball = ic.Sphere((0, 0, -2.0), 1.0)
    scene = ic.Scene(
        (ic.SceneObject("ball", ball, ic.Emission(ic.Spectrum.equal_energy(100.0), picture)),)
    )
    plan = ic.plan(scene, ic.eyes.navarro(), fov_deg=10.0, resolution=16)
    # pixel 0.625 deg at 1 m: 10.9 mm; texel pi / 1024: 3.07 mm; 3.6 texels: kept
    assert plan.images[0].shape == (1024, 2048)
    plan = ic.plan(scene, ic.eyes.navarro(), fov_deg=10.0, resolution=4)
    # 14.2 texels: 1/2 leaves 7, 1/4 would leave 3.6
    assert plan.images[0].shape == (512, 1024)


def test_the_memory_estimate_covers_the_arrays():
    from isetcl.render.plan import bytes_per_pixel

    plan = ic.plan(ic.scenes.uniform(), ic.eyes.navarro(), resolution=8, bands=4)
    # float64 film sums, tracked squares, float32 irradiance and error
    assert bytes_per_pixel(plan) >= 4 * 8 + 5 * 8 + 31 * 2 * 4


def test_each_feature_has_its_own_define(device):
    from isetcl.render.kernel_config import KernelConfig

    base = KernelConfig("single", 1)
    for field in dataclasses.fields(base):
        if field.name.startswith(("has_", "is_")):
            other = dataclasses.replace(base, **{field.name: not getattr(base, field.name)})
            a, b = base.defines(device), other.defines(device)
            assert sum(a[k] != b[k] for k in a) == 1, field.name


def test_a_planet_is_traced_in_double_precision(device):
    if not device.has_double:
        pytest.skip("this device has no double precision")
    earth = ic.Sphere((0.0, -6.4e6 - 1.6, 0.0), 6.4e6)
    ball = ic.Sphere((0.0, 0.0, -1.0), 0.1)
    light = ic.Emission(ic.Spectrum.constant(1.0))
    for shape, precision in ((earth, "double"), (ball, "single")):
        scene = ic.Scene((ic.SceneObject("it", shape, light),))
        assert ic.plan(scene, ic.eyes.navarro(), resolution=4).config.precision == precision

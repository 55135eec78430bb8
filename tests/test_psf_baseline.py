"""PSFs and the two methods, against closed forms and ray tracing."""

import dataclasses
import math
import subprocess
import sys

import numpy as np
import pytest
from oracles import reduced_eye
from slow_cases import slow_after

import isetcl as ic
from isetcl.eye.sequential import trace
from isetcl.psf_baseline import geometric_psf, methods
from isetcl.psf_baseline.view import ViewGrid, layer_edges_dpt, take_layers
from isetcl.scene.basis import spectral_basis

WHITE = ic.Spectrum.equal_energy(100.0)


def second_moment(psf):
    """Mean square radius in degrees^2."""
    n = np.arange(psf.kernel.shape[0]) - psf.radius
    r2 = (n[None, :] ** 2 + n[:, None] ** 2) * psf.pitch_deg**2
    return float(np.sum(psf.kernel * r2) / psf.kernel.sum())


@pytest.mark.parametrize("field", [(0.0, 0.0), (3.0, -2.0)])
@pytest.mark.parametrize("vergence", slow_after(1, [0.0, 1.0, 3.0]))
def test_a_psf_keeps_all_energy(field, vergence):
    psf = geometric_psf(ic.eyes.navarro(4.0, 2.0), 550.0, vergence, 0.005, field)
    assert psf.kernel.sum() == pytest.approx(1.0, abs=1e-6)
    assert psf.energy_outside == pytest.approx(0.0, abs=1e-6)
    assert psf.kernel.min() >= 0.0


@pytest.mark.parametrize("pitch", [0.5, 0.02, 0.002])
def test_a_psf_narrower_than_a_pixel_keeps_its_energy_in_the_middle(pitch):
    psf = geometric_psf(reduced_eye(2.0), 550.0, 0.0, pitch)
    assert psf.kernel[psf.radius, psf.radius] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("defocus", [0.5, 2.0])
def test_a_defocused_perfect_eye_has_a_uniform_disc(defocus):
    # Radius a |D| radians with a = 0.5 mm: 0.5e-3 rad per dioptre; small pupil, no aberration.
    eye = reduced_eye(1.0)
    radius_deg = np.degrees(0.5e-3 * defocus)
    psf = geometric_psf(eye, 550.0, defocus, radius_deg / 40.0)
    n = np.arange(psf.kernel.shape[0]) - psf.radius
    r = np.hypot(n[None, :], n[:, None]) / 40.0
    level = 1.0 / (np.pi * 40.0**2)
    inside = psf.kernel[(r < 0.95) & (r > 0.05)]
    assert np.mean(inside) == pytest.approx(level, rel=0.01)
    assert np.std(inside) < 0.08 * level
    assert psf.kernel[r > 1.05].sum() < 1e-9
    # Mean square radius of a uniform disc: half the square of its radius.
    assert second_moment(psf) == pytest.approx(radius_deg**2 / 2.0, rel=0.01)


def test_the_psf_has_the_second_moment_of_traced_rays():
    # Rays launched by hand on a square grid of the pupil, not the fan of the PSF.
    eye = ic.eyes.navarro(5.0, 2.0)
    psf = geometric_psf(eye, 500.0, 1.0, 0.002)
    pupil = eye.entrance_pupil(500.0)
    g = np.linspace(-1.1, 1.1, 401) * pupil.radius_mm
    px, py = (a.ravel() for a in np.meshgrid(g, g))
    target = np.stack([px, py, np.full_like(px, pupil.z_mm)], axis=1)
    source = np.array([0.0, 0.0, -1000.0])
    rays = trace(eye, np.broadcast_to(source, target.shape), target - source, 500.0)
    hit = rays.positions_mm[rays.passed]
    arc = 12.0 * np.arcsin(np.hypot(hit[:, 0], hit[:, 1]) / 12.0)
    field = eye.field_map(500.0).field_deg(arc)
    assert second_moment(psf) == pytest.approx(float(np.mean(field**2)), rel=5e-3)


def test_off_axis_psfs_agree_with_axial_ones_at_the_axis():
    eye = ic.eyes.navarro(4.0, 2.0)
    axial = geometric_psf(eye, 550.0, 0.5, 0.004)
    beside = geometric_psf(eye, 550.0, 0.5, 0.004, (1e-4, 0.0))
    assert second_moment(beside) == pytest.approx(second_moment(axial), rel=0.01)


@pytest.mark.parametrize(
    ("vergence", "pitch", "match"),
    [
        (-0.1, 0.01, "between 0 and"),
        (1e4, 0.01, "between 0 and"),
        (1.0, 0.0, "pitch_deg"),
        (2.0, 1e-6, "samples across"),
    ],
)
def test_impossible_psfs_are_refused(vergence, pitch, match):
    with pytest.raises(ic.InvalidInputError, match=match):
        geometric_psf(ic.eyes.navarro(), 550.0, vergence, pitch)


def small(**options):
    return {"fov_deg": 1.0, "resolution": 64, "wavelengths_nm": [550.0]} | options


def edge_scene(near, far, near_m=0.5, far_m=2.0):
    return ic.scenes.two_planes(
        near_m, far_m, edge_angle_deg=0.0, near=ic.Emission(near), far=ic.Emission(far)
    )


def profile(image):
    """Mean irradiance of every column, relative to the far right, and x in degrees."""
    values = image.irradiance.values[0].mean(axis=0)
    return image.dataset["x"].values, values / values[-1]


@pytest.mark.parametrize("method", slow_after(1, ["layered_over", "layered_sum"]))
def test_a_uniform_scene_has_the_traced_irradiance(method):
    # On axis: an independent closed form is in test_render; here the two renderers must agree.
    scene, eye = ic.scenes.uniform(100.0), ic.eyes.navarro(4.0)
    base = ic.psf_baseline.render(scene, eye, method=method, fov_deg=20.0, resolution=16)
    traced = ic.render(scene, eye, fov_deg=20.0, resolution=16, spp=256, bands=31)
    ratio = base.illuminance_lux.values / traced.illuminance_lux.values
    assert np.max(np.abs(ratio - 1)) < 2e-3
    assert abs(ratio.mean() - 1) < 2e-4


@pytest.mark.parametrize("method", ["layered_sum", "layered_over"])
def test_one_plane_at_one_depth_agrees_with_ray_tracing(method):
    y, x = np.mgrid[0:64, 0:64] / 64.0
    picture = ic.Image(0.5 + 0.4 * np.sin(30 * x) * np.sin(25 * y))
    scene = ic.scenes.image_plane(picture, 0.8, 3.0)
    eye = ic.eyes.navarro(3.0, 2.0)
    options = {"fov_deg": 1.0, "resolution": 48, "wavelengths_nm": [450.0, 550.0, 650.0]}
    base = ic.psf_baseline.render(scene, eye, method=method, **options)
    traced = ic.render(scene, eye, spp=2048, bands=3, **options)
    difference = base.irradiance.values - traced.irradiance.values
    level = traced.irradiance.values.mean()
    assert abs(difference.mean()) < 5e-4 * level
    noise = np.sqrt(np.mean(traced.standard_error.values**2))
    # What is left beside the noise: one PSF for the whole field, bilinear samples.
    assert np.sqrt(max(np.mean(difference**2) - noise**2, 0)) < 4e-3 * level


def test_layered_sum_makes_half_the_contrast_of_error_at_a_sharp_near_edge():
    # Case A of the edge errors: near plane sharp and black, far plane blurred and white. In a real
    # eye at 2 mm the near edge is sharp to 0.1 arcmin, the far blur circle 5 arcmin wide.
    eye = ic.eyes.navarro(2.0, 2.0)
    scene = edge_scene(WHITE.scaled(0.0), WHITE)
    where = {"fov_deg": 0.4, "resolution": 96, "wavelengths_nm": [550.0]}
    x, summed = profile(ic.psf_baseline.render(scene, eye, method="layered_sum", **where))
    _, over = profile(ic.psf_baseline.render(scene, eye, method="layered_over", **where))
    _, traced = profile(ic.render(scene, eye, spp=2048, **where))
    error = summed - traced
    assert np.max(np.abs(error)) == pytest.approx(0.5, abs=0.05)
    # Light that belongs to the far plane is missing right of the edge and leaks to its left.
    assert np.mean(error[(x > 0.01) & (x < 0.03)]) < -0.25
    assert np.mean(error[(x < -0.01) & (x > -0.03)]) > 0.25
    assert np.max(np.abs(over - traced)[np.abs(x) > 0.006]) < 0.02


def test_layered_over_is_exact_in_case_a_and_layered_sum_wrong_by_one_half():
    # Perfect eye focused at infinity: the "near" plane at 1 km is sharp, and no real plane lies
    # behind it, so blur the far plane by hand: compare the methods on known layers instead.
    n = 257
    x = np.arange(n) - 128
    disc = (x[None, :] ** 2 + x[:, None] ** 2 <= 40**2).astype(float)
    disc /= disc.sum()
    from isetcl.psf_baseline.convolve import LayerSpectra, SpectralBlur
    from isetcl.psf_baseline.psf import Psf
    from isetcl.psf_baseline.view import Layer

    size = 512
    mask = np.zeros((size, size), dtype=np.float32)
    mask[:, : size // 2] = 1.0
    delta = Psf(np.ones((1, 1)), 1.0, 0.0)
    blur = Psf(disc, 1.0, 0.0)
    truth = 1.0 - mask
    far_full = Layer(0.5, np.ones((1, size, size), np.float32), np.ones((size, size), np.float32))
    far_seen = Layer(0.5, (1 - mask)[None], 1 - mask)
    near = Layer(2.0, np.zeros((1, size, size), np.float32), mask)
    middle = (slice(200, 312), slice(150, 362))
    for name, layers in (("layered_sum", [far_seen, near]), ("layered_over", [far_full, near])):
        spectral = SpectralBlur(LayerSpectra(layers), [blur, delta])
        image = methods()[name].combine(spectral, 2)[0]
        error = np.abs(image - truth)[middle]
        if name == "layered_sum":
            assert error.max() == pytest.approx(0.5, abs=0.01)
            # Mean over the blur circle's half-width on both sides: 0.42 of its radius.
            per_row = np.abs(image - truth)[256, 150:362].sum() / 40.0
            assert per_row == pytest.approx(0.42, abs=0.01)
        else:
            assert error.max() < 1e-5


def test_the_sum_is_exact_where_both_layers_are_equally_blurred():
    eye = ic.eyes.navarro(4.0, 2.0)
    scene = edge_scene(WHITE.scaled(0.3), WHITE, near_m=1.0, far_m=1.0005)
    one = ic.psf_baseline.render(scene, eye, method="layered_sum", layers=2, **small())
    traced = ic.render(scene, eye, spp=2048, **small())
    error = np.abs(profile(one)[1] - profile(traced)[1])
    assert error.max() < 0.01


@pytest.mark.parametrize("aperture_mm", [1.0, 2.0])
def test_a_blurred_near_edge_is_the_closed_form_of_a_thin_lens(aperture_mm):
    # Perfect reduced eye focused at infinity, black half-plane at 0.5 m before a white field:
    # 1/2 - (t sqrt(1 - t^2) + asin t) / pi with t = x / (a D) is what is hidden.
    eye = reduced_eye(aperture_mm)
    near = ic.scenes.two_planes(0.5, 1e6, edge_angle_deg=0.0).objects[0]
    scene = ic.Scene((ic.SceneObject("near", near.shape, ic.Emission(WHITE.scaled(0.0))),), WHITE)
    rho = np.degrees(aperture_mm / 2e3 * 2.0)
    options = {"fov_deg": (4.0 * rho, 0.2 * rho), "resolution": (64, 4), "wavelengths_nm": [550.0]}
    traced = ic.render(scene, eye, spp=4096, **options)
    x, values = profile(traced)
    # Mean over a pixel of the closed form.
    fine = np.linspace(-0.5, 0.5, 21) * (x[1] - x[0])
    t = np.clip((x[:, None] + fine) / rho, -1.0, 1.0)
    hidden = np.mean(0.5 - (t * np.sqrt(1 - t * t) + np.arcsin(t)) / np.pi, axis=1)
    noise = float(traced.standard_error.values.mean() / traced.irradiance.values.max())
    assert np.max(np.abs(values - (1.0 - hidden))) < 0.003 + 4 * noise


def test_layers_are_as_few_as_the_blur_allows():
    grid = ic.RetinalGrid.of(ic.eyes.navarro(4.0), 2.0, 64)
    assert len(layer_edges_dpt(ic.scenes.two_planes(), grid, "auto", 0.01)) == 3
    assert len(layer_edges_dpt(ic.scenes.two_planes(), grid, 7, 0.01)) == 8
    assert len(layer_edges_dpt(ic.scenes.uniform(), grid, "auto", 0.01)) == 2
    leaning = ic.Quad((-0.1, -0.1, -0.5), (0.2, 0, -0.4), (0, 0.2, 0))
    scene = ic.Scene((ic.SceneObject("ramp", leaning, ic.Emission(WHITE)),))
    edges = layer_edges_dpt(scene, grid, "auto", 0.02)
    assert np.all(np.diff(edges) <= 0.02 * 1.5 + 1e-5)
    assert len(edges) > 5


@pytest.mark.parametrize("layers", [[2.0, 0.1], [0.6, 3.0], [1.0], "many", 0, True])
def test_bad_layers_are_refused(layers):
    with pytest.raises(ic.InvalidInputError):
        ic.psf_baseline.render(
            ic.scenes.two_planes(), ic.eyes.navarro(), layers=layers, **small(resolution=8)
        )


def test_complete_layers_know_what_is_hidden_and_visible_ones_do_not():
    grid = ic.RetinalGrid.of(ic.eyes.navarro(), 1.0, 16)
    scene = ic.scenes.two_planes(edge_angle_deg=0.0)
    view = ViewGrid(grid, 1, 0)
    basis = spectral_basis(scene, np.array([550.0]))
    edges = np.array([0.4, 1.0, 2.5])
    far, near = take_layers(scene, view, basis, edges, complete=True)
    assert far.coverage.min() == 1.0
    assert near.coverage[:, :7].min() == 1.0
    assert near.coverage[:, 9:].max() == 0.0
    seen_far, _ = take_layers(scene, view, basis, edges, complete=False)
    np.testing.assert_allclose(seen_far.coverage + near.coverage, 1.0, atol=1e-6)
    assert (far.vergence_dpt, near.vergence_dpt) == (pytest.approx(0.5), pytest.approx(2.0))


def test_an_empty_scene_is_black():
    image = ic.psf_baseline.render(ic.Scene(), ic.eyes.navarro(), **small(resolution=8))
    assert not image.irradiance.values.any()


def test_psf_images_say_how_they_were_made():
    image = ic.psf_baseline.render(
        ic.scenes.two_planes(), ic.eyes.navarro(), method="layered_over", **small(resolution=16)
    )
    assert image.provenance["method"] == "layered_over"
    assert image.provenance["layers_dpt"] == [pytest.approx(0.5), pytest.approx(2.0)]
    assert image.relative_error == 0.0


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"method": "layered_som"}, "did you mean layered_sum"),
        ({"psf": "waves"}, "unknown psf 'waves'.*wave"),
        ({"oversampling": 0}, "oversampling"),
        ({"fov_deg": (2.0, 1.0)}, "square pixels"),
    ],
)
def test_bad_options_are_refused(options, match):
    with pytest.raises(ic.InvalidInputError, match=match):
        ic.psf_baseline.render(
            ic.scenes.two_planes(), ic.eyes.navarro(), **small(resolution=8, **options)
        )


def test_the_baseline_never_touches_opencl():
    code = (
        "import isetcl as ic, sys\n"
        "ic.psf_baseline.render(ic.scenes.two_planes(), ic.eyes.navarro(), resolution=8,"
        " wavelengths_nm=[550.0])\n"
        "sys.exit('pyopencl' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def blob(image, i):
    v = image.irradiance.values[i].astype(float)
    v = v / v.sum()
    x, y = np.meshgrid(image.dataset["x"].values, image.dataset["y"].values)
    mx, my = (v * x).sum(), (v * y).sum()
    return np.array(
        [
            mx,
            my,
            np.sqrt((v * (x - mx) ** 2).sum()),
            np.sqrt((v * (y - my) ** 2).sum()),
            np.cbrt((v * (x - mx) ** 3).sum()),
            np.cbrt((v * (y - my) ** 3).sum()),
        ]
    )


@pytest.mark.parametrize(
    "options",
    [{"psf": "geometric_spread"}, pytest.param({"field": 3}, marks=pytest.mark.slow)],
)
def test_a_point_off_the_axis_is_blurred_as_traced(options):
    # a defocused point 12 deg up and 5 deg left: coma and transverse colour have a direction
    eye = ic.eyes.navarro(5.0, 2.0)
    centre = (-5.0, 12.0)
    scene = ic.scenes.point_source(1.2, centre, diameter_arcmin=4.0)
    where = {"fov_deg": 1.6, "resolution": 64, "centre_deg": centre}
    where["wavelengths_nm"] = [450.0, 550.0, 650.0]
    base = ic.psf_baseline.render(scene, eye, **where, **options)
    traced = ic.render(scene, eye, spp=4096, bands=3, **where)
    for i in range(3):
        b, t = blob(base, i), blob(traced, i)
        np.testing.assert_allclose(b[:2], t[:2], atol=0.004)
        np.testing.assert_allclose(b[2:4], t[2:4], rtol=0.03)
        np.testing.assert_allclose(b[4:], t[4:], atol=0.012)


def test_a_psf_is_centred_on_an_aspheric_retina():
    from isetcl.psf_baseline import geometric_psf

    retina = ic.Retina.from_radius(22.0, -12.0, -0.6)
    eye = dataclasses.replace(reduced_eye(0.5, conic=0.0), retina=retina)
    psf = geometric_psf(eye, 550.0, 0.0, 0.01, (20.0, 0.0))
    n = (np.arange(psf.kernel.shape[0]) - psf.radius) * 0.01
    assert abs((psf.kernel.sum(axis=0) * n).sum()) < 0.02
    assert psf.kernel.shape[0] < 100


def test_within_a_layer_the_nearer_surface_is_seen():
    from isetcl.psf_baseline.view import ViewGrid, take_layers
    from isetcl.scene.basis import spectral_basis

    grid = ic.RetinalGrid.of(ic.eyes.navarro(), 1.0, 4)
    light = ic.Spectrum.equal_energy(100.0)

    def wall(z, light):
        return ic.SceneObject("w", ic.Quad((-1, -1, -z), (2, 0, 0), (0, 2, 0)), ic.Emission(light))

    scene = ic.Scene((wall(1.0, light), wall(1.1, light.scaled(3.0))))
    basis = spectral_basis(scene, np.array([550.0]))
    edges = np.array([0.5, 2.0])
    (layer,) = take_layers(scene, ViewGrid(grid, 1, 0), basis, edges, complete=True)
    assert layer.vergence_dpt == pytest.approx(1.0)
    radiance = layer.colour[0] * basis.spectra[0, 0]
    np.testing.assert_allclose(radiance, light.at([550.0])[0], rtol=1e-6)


def test_second_moments_off_axis_are_those_of_traced_rays():
    from isetcl.eye.sequential import trace
    from isetcl.psf_baseline import geometric_psf

    eye = ic.eyes.navarro(5.0, 2.0)
    angle = 20.0
    psf = geometric_psf(eye, 550.0, 0.0, 0.005, (0.0, angle))
    towards = np.array([0.0, math.sin(math.radians(angle)), -math.cos(math.radians(angle))])
    g = np.linspace(-3.2, 3.2, 401)
    px, py = (a.ravel() for a in np.meshgrid(g, g))
    start = np.stack([px, py, np.full_like(px, 3.04)], axis=1) + 12.0 * towards
    rays = trace(eye, start, np.broadcast_to(-towards, start.shape), 550.0)
    hit = rays.positions_mm[rays.passed]
    height = np.hypot(hit[:, 0], hit[:, 1])
    field = eye.field_map(550.0).field_deg(12.0 * np.arcsin(height / 12.0))
    x, y = -field * hit[:, 0] / height, -field * hit[:, 1] / height - angle
    n = (np.arange(psf.kernel.shape[0]) - psf.radius) * psf.pitch_deg
    k = psf.kernel
    assert (k.sum(axis=1) * -n).sum() == pytest.approx(y.mean(), abs=0.002)
    assert abs(y.mean()) > 0.003
    assert (k.sum(axis=0) * n**2).sum() == pytest.approx(np.mean(x**2), rel=0.01)
    assert (k.sum(axis=1) * n**2).sum() == pytest.approx(np.mean(y**2), rel=0.01)


def test_the_flux_of_a_near_point_is_by_solid_angle():
    # 9 mm in front of the cornea, axis: equal steps of cos(theta) carry equal flux
    from isetcl.eye.sequential import trace
    from isetcl.psf_baseline import geometric_psf

    eye = ic.eyes.navarro(5.0)
    v = 1000.0 / 9.0
    psf = geometric_psf(eye, 550.0, v, 0.1)
    cosine = np.linspace(math.cos(math.radians(17.0)), 1.0, 40001)[:-1]
    d = np.stack([0 * cosine, np.sqrt(1 - cosine**2), cosine], axis=1)
    rays = trace(eye, np.broadcast_to([0.0, 0.0, -9.0], d.shape), d, 550.0)
    h = np.abs(rays.positions_mm[rays.passed, 1])
    field = eye.field_map(550.0).field_deg(12.0 * np.arcsin(h / 12.0))
    n = (np.arange(psf.kernel.shape[0]) - psf.radius) * 0.1
    got = (psf.kernel * (n[None] ** 2 + n[:, None] ** 2)).sum()
    assert got == pytest.approx(np.mean(field**2), rel=5e-3)


def test_clusters_never_exceed_the_step():
    from isetcl.psf_baseline.view import _cluster_edges

    edges = _cluster_edges(np.arange(0.0, 1.0, 0.01), 0.1, 1e-6)
    assert np.diff(edges).max() <= 0.121
    assert len(edges) == 11


def test_blur_step_is_pixel_over_pupil():
    from isetcl.psf_baseline.view import blur_step_dpt

    eye = reduced_eye(4.0)
    grid = ic.RetinalGrid.of(eye, 1.0, 100)
    assert blur_step_dpt(grid) == pytest.approx(math.radians(0.01) / 4e-3)


def test_samples_on_an_edge_are_half_covered():
    from isetcl.psf_baseline.view import ViewGrid, take_layers
    from isetcl.scene.basis import spectral_basis

    grid = ic.RetinalGrid.of(ic.eyes.navarro(), 1.0, 15)
    scene = ic.scenes.two_planes(edge_angle_deg=0.0, texture="uniform")
    basis = spectral_basis(scene, np.array([550.0]))
    edges = np.array([0.4, 1.0, 2.5])
    near = take_layers(scene, ViewGrid(grid, 1, 0), basis, edges, complete=True)[1]
    np.testing.assert_allclose(near.coverage[:, 7], 0.5)


def test_edges_of_layers_belong_to_a_layer():
    options = {"fov_deg": 1.0, "resolution": 4, "wavelengths_nm": [550.0]}
    images = [
        ic.psf_baseline.render(ic.scenes.uniform(), ic.eyes.navarro(), layers=layers, **options)
        for layers in ("auto", [0.0, 3.0])
    ]
    assert images[0].irradiance.values.min() > 0
    np.testing.assert_allclose(images[0].irradiance, images[1].irradiance)


def test_a_slanted_plane_is_bright_up_to_the_borders():
    """Its vergence goes on changing beyond the image's border, from where blur comes in."""
    plane = ic.Quad((-3, -3, -2.7), (6, 0, 4), (0, 6, 0))
    scene = ic.Scene((ic.SceneObject("plane", plane, ic.Emission(ic.Spectrum.constant(1.0))),))
    uniform = ic.Scene((), ic.Spectrum.constant(1.0))
    where = {"fov_deg": 6.0, "resolution": 48, "wavelengths_nm": [550.0]}
    for accommodation in (2.0, 4.0):
        eye = ic.eyes.navarro(4.0, accommodation)
        image, full = (
            ic.psf_baseline.render(each, eye, **where).irradiance.values[0]
            for each in (scene, uniform)
        )
        np.testing.assert_allclose(image, full, rtol=2e-3)


def test_the_blur_of_a_lamp_beside_the_image_reaches_into_it():
    eye = ic.eyes.navarro(6.0, 1.5)
    lamp = ic.Disc((0.0, 0.25 * np.tan(np.radians(1.3)), -0.25), 0.001)
    scene = ic.Scene((ic.SceneObject("lamp", lamp, ic.Emission(ic.Spectrum.constant(1.0))),))
    where = {"fov_deg": 2.0, "resolution": 32, "wavelengths_nm": [550.0]}
    base = ic.psf_baseline.render(scene, eye, **where).irradiance.values.sum()
    traced = ic.render(scene, eye, spp=4096, **where).irradiance.values.sum()
    assert traced > 0
    assert base == pytest.approx(traced, rel=0.06)


@pytest.mark.parametrize("diameter_arcmin", slow_after(2, [0.2, 12.0, 1.0, 3.0]))
def test_small_objects_keep_their_light(diameter_arcmin):
    """The flux through the entrance pupil, radiance times solid angle times area, arrives."""
    eye = ic.eyes.navarro(4.0, 2.0)
    scene = ic.scenes.point_source(0.5, diameter_arcmin=diameter_arcmin)
    where = {"fov_deg": 1.0, "resolution": 16, "wavelengths_nm": [550.0]}
    image = ic.psf_baseline.render(scene, eye, **where)
    field = eye.field_map(550.0)
    pixel_m2 = (field.mm_per_deg(0.0) / 16 * 1e-3) ** 2
    disc = scene.objects[0]
    pupil = eye.entrance_pupil(550.0)
    solid_angle = np.pi * (disc.shape.radius_m / (0.5 + pupil.z_mm * 1e-3)) ** 2
    area_m2 = np.pi * (pupil.radius_mm * 1e-3) ** 2
    expected = disc.material.radiance.at([550.0])[0] * solid_angle * area_m2
    # The pupil is larger than its paraxial size by 1 % at its edge, and the fovea's PSF serves all.
    assert image.irradiance.values.sum() * pixel_m2 == pytest.approx(expected, rel=0.02)


def test_objects_too_small_to_be_found_are_refused():
    with pytest.raises(ic.InvalidInputError, match=r"'point' is .* samples .* make it larger"):
        ic.psf_baseline.render(
            ic.scenes.point_source(0.5, diameter_arcmin=0.01),
            ic.eyes.navarro(),
            fov_deg=20.0,
            resolution=32,
            wavelengths_nm=[550.0],
        )


def test_fine_pictures_are_averaged_in_the_view():
    """A picture of noise finer than a sample is grey, as ray tracing sees it."""
    texels = np.random.default_rng(4).random((2048, 2048))
    scene = ic.scenes.image_plane(ic.Image(texels), 1.0, 8.0)
    where = {"fov_deg": 4.0, "resolution": 16, "wavelengths_nm": [550.0]}
    image = ic.psf_baseline.render(scene, ic.eyes.navarro(1.0, 1.0), **where).irradiance.values
    assert np.std(image) / np.mean(image) < 0.02


def test_a_view_that_does_not_fit_into_memory_is_refused(monkeypatch):
    from isetcl import memory

    monkeypatch.setattr(memory, "available_bytes", lambda: 64 << 20)
    with pytest.raises(ic.OutOfMemoryError, match=r"a view of .* would fit"):
        ic.psf_baseline.render(ic.scenes.two_planes(), ic.eyes.navarro(4, 2), resolution=2000)


UNIT = ic.Spectrum.constant(1.0)
ONE_SIDED_VIEW = {"fov_deg": 0.5, "resolution": 4, "wavelengths_nm": [550.0]}
ONE_SIDED = {
    "quad": ic.Quad((-0.1, -0.1, -1.0), (0.2, 0, 0), (0, 0.2, 0)),
    "quad turned": ic.Quad((0.1, -0.1, -1.0), (-0.2, 0, 0), (0, 0.2, 0)),
    "disc": ic.Disc((0.0, 0.0, -1.0), 0.1, (0.0, 0.0, 1.0)),
    "disc turned": ic.Disc((0.0, 0.0, -1.0), 0.1, (0.0, 0.0, -1.0)),
    "ball": ic.Sphere((0.0, 0.0, -1.2), 0.2),
    "ball around": ic.Sphere((0.0, 0.0, 0.0), 1.0),
    "mesh": ic.Mesh([[-1, -1, -1], [1, -1, -1], [0, 1, -1]], [[0, 1, 2]]),
    "mesh turned": ic.Mesh([[-1, -1, -1], [1, -1, -1], [0, 1, -1]], [[0, 2, 1]]),
}


@pytest.fixture(scope="module")
def lit_by_all():
    """The irradiance of an even scene as bright as the lamps."""
    image = ic.psf_baseline.render(ic.Scene((), UNIT), reduced_eye(1.0), **ONE_SIDED_VIEW)
    return image.irradiance.values


@pytest.mark.parametrize("name", ONE_SIDED)
def test_a_one_sided_lamp_is_dark_from_behind(name, lit_by_all):
    """The side that the right-handed normal points to is lit, and only that."""
    lamp = ic.SceneObject("lamp", ONE_SIDED[name], ic.Emission(UNIT, sides="front"))
    behind = ic.SceneObject("wall", ic.Sphere((0, 0, 0), 5.0), ic.Emission(UNIT.scaled(0.5)))
    image = ic.psf_baseline.render(ic.Scene((lamp, behind)), reduced_eye(1.0), **ONE_SIDED_VIEW)
    expected = 0.0 if "turned" in name or "around" in name else 1.0
    ratio = image.irradiance.values / lit_by_all
    assert ratio == pytest.approx(np.full_like(ratio, expected), abs=1e-6)


def test_a_repeated_picture_is_filtered_by_its_repeats():
    """A hundred fine repeats blur to their mean, wherever the samples fall."""
    texels = np.zeros((64, 64))
    texels[:, ::2] = 1.0
    picture = ic.Image(texels, wrap="repeat", repeats=(100.0, 100.0))
    quad = ic.Quad((-0.1, -0.1, -1.0), (0.2, 0, 0), (0, 0.2, 0))
    items = [ic.SceneObject("q", quad, ic.Emission(UNIT, t)) for t in (picture, None)]
    fine, plain = (
        ic.psf_baseline.render(ic.Scene((item,)), reduced_eye(1.0), fov_deg=1.0, resolution=8)
        for item in items
    )
    ratio = fine.irradiance.values / plain.irradiance.values
    assert ratio == pytest.approx(np.full_like(ratio, 0.5), abs=1e-3)


@pytest.mark.parametrize(
    ("name", "bad"),
    [
        ("vergence_dpt", np.nan),
        ("vergence_dpt", -1.0),
        ("vergence_dpt", np.inf),
        ("radiance", np.nan),
        ("radiance", np.inf),
    ],
)
def test_pinhole_views_with_impossible_values_are_refused(name, bad):
    eye = ic.eyes.navarro(4.0)
    where = {"fov_deg": 1.0, "resolution": 4, "wavelengths_nm": [550.0]}
    data = ic.pinhole(ic.scenes.uniform(), eye, **where).dataset.copy(deep=True)
    data[name].values[..., 2, 3] = bad
    with pytest.raises(ic.InvalidInputError, match="finite radiances and vergences >= 0"):
        ic.psf_baseline.render(ic.PinholeView(data), eye)


LARGE = """
import resource
import numpy as np, isetcl as ic
n = 1024
y, x = np.mgrid[0:n, 0:n] / n
image = ic.psf_baseline.DepthImage(
    0.5 + 0.4 * np.sin(90.0 * x) * np.sin(70.0 * y), 1.5 * (x + y), n / 60.0, depth_unit="dpt"
)
made = ic.psf_baseline.render(
    image, ic.eyes.navarro(4.0, 1.0), method="layered_over", psf="disc", layers=41,
    wavelengths_nm=[550.0], psf_cache=None,
)
assert made.irradiance.shape == (1, n, n)
assert len(made.provenance["layers_dpt"]) == 41
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="ru_maxrss is in KiB on Linux alone")
def test_a_million_pixels_in_41_layers_fit_into_four_gigabytes():
    done = subprocess.run([sys.executable, "-c", LARGE], capture_output=True, text=True, check=True)
    assert float(done.stdout) < 4.0

"""Rays through the pupil and soft slices, what PSF methods stand on."""

import dataclasses
import math

import numpy as np
import pytest
from layers import disc, layer
from oracles import reduced_eye

import isetcl as ic
from isetcl.psf_baseline import methods, psf_kinds, pupil_offsets
from isetcl.psf_baseline.convolve import LayerSpectra, SpectralBlur
from isetcl.psf_baseline.pupil import PupilOffsets, thin_lens_offsets
from isetcl.psf_baseline.slicing import soft_slices
from isetcl.psf_baseline.view import Layer


def ramp_layers(count=4, n=64):
    """A surface whose vergence grows evenly from 0 to 1 along a row, in hard layers."""
    vergence = np.broadcast_to((np.arange(n) + 0.5) / n, (8, n)).astype(np.float32)
    which = np.floor(vergence * count).astype(int)
    cover = [np.float32(which == k) for k in range(count)]
    return vergence, [
        Layer((k + 0.5) / count, np.stack([c, c * vergence]), c, c * vergence)
        for k, c in enumerate(cover)
    ]


def test_soft_slices_of_visible_layers_add_up_and_have_the_vergence_of_each_sample():
    vergence, layers = ramp_layers()
    soft = soft_slices(layers, complete=False)
    np.testing.assert_allclose(sum(s.coverage for s in soft), 1.0, atol=1e-6)
    np.testing.assert_allclose(
        sum(s.colour for s in soft), sum(h.colour for h in layers), atol=1e-6
    )
    mean = sum(s.vergence_dpt * s.coverage for s in soft)
    # Linear interpolation between layers; beyond the outer ones there is nothing to share with.
    np.testing.assert_allclose(mean, np.clip(vergence, 0.125, 0.875), atol=1e-6)


def test_soft_slices_of_complete_layers_hide_nothing_of_their_own_surface():
    _, layers = ramp_layers()
    soft = soft_slices(layers, complete=True)
    through = np.ones_like(soft[0].coverage)
    colour = np.zeros_like(soft[0].colour)
    for each in reversed(soft):
        colour += through * each.colour
        through = through * (1.0 - each.coverage)
    np.testing.assert_allclose(through, 0.0, atol=1e-6)
    np.testing.assert_allclose(colour, sum(h.colour for h in layers), atol=1e-6)


def test_flat_layers_are_not_sliced_softly():
    n = 8
    one = np.ones((n, n), np.float32)
    layers = [Layer(v, one[None], one, one * v) for v in (0.5, 2.0)]
    soft = soft_slices(layers, complete=True)
    assert all(a is b for a, b in zip(soft, layers, strict=True))


def test_a_ramp_is_even_with_soft_slices_over_each_other_and_dark_with_hard_ones():
    quad = ic.Quad((-0.2, -0.2, -0.25), (0.4, 0, -0.9), (0, 0.4, 0))
    light = ic.Spectrum.constant(1.0)
    scene = ic.Scene((ic.SceneObject("ramp", quad, ic.Emission(light)),))
    eye = ic.eyes.navarro(4.0, 3.0)
    where = {"fov_deg": 3.0, "resolution": 32, "wavelengths_nm": [550.0], "layers": 3}
    even = ic.psf_baseline.render(ic.Scene((), light), eye, **where).irradiance.values
    ratio = {
        (name, slicing): ic.psf_baseline.render(
            scene, eye, method=name, slicing=slicing, **where
        ).irradiance.values
        / even
        for name, slicing in (
            ("layered_over", "hard"),
            ("layered_over", "soft"),
            ("layered_over", "auto"),
            ("aperture_samples", "hard"),
            ("aperture_samples", "auto"),
        )
    }
    assert ratio["layered_over", "hard"].min() < 0.93
    assert ratio["layered_over", "soft"].min() > 0.97
    np.testing.assert_array_equal(ratio["layered_over", "auto"], ratio["layered_over", "hard"])
    assert ratio["aperture_samples", "hard"].min() < 0.97
    # Three layers are few: between them more is revealed than half a layer covers.
    assert ratio["aperture_samples", "auto"].min() > 0.98


def test_in_a_complete_layer_what_was_shared_by_the_nearer_one_hides_what_was_there():
    one = np.ones((4, 4), np.float32)
    slope = np.linspace(0.5, 1.5, 16, dtype=np.float32).reshape(4, 4)
    far = Layer(0.5, 5.0 * one[None], one, one * np.float32(0.5))
    near = Layer(1.0, 2.0 * one[None], one, slope)
    lower, _ = soft_slices([far, near], complete=True)
    np.testing.assert_allclose(lower.coverage, 1.0)
    given = (slope > 0.5) & (slope < 1.0)
    np.testing.assert_allclose(lower.colour[0][given], 2.0)
    np.testing.assert_allclose(lower.colour[0][slope > 1.0], 5.0)


def test_distant_layers_share_nothing_even_if_they_are_not_quite_flat():
    one = np.ones((4, 4), np.float32)
    slope = np.linspace(-0.05, 0.05, 16, dtype=np.float32).reshape(4, 4)
    layers = [Layer(v, one[None], one, v + slope) for v in (0.5, 2.0)]
    soft = soft_slices(layers, complete=False)
    assert all(a is b for a, b in zip(soft, layers, strict=True))


def test_rays_of_a_thin_lens_land_by_their_height_times_the_defocus():
    # The reduced eye, perfect and focused at infinity, with its pupil at the cornea.
    found = pupil_offsets(reduced_eye(1.0), 550.0, (0.0, 0.5, 2.0), 64, rays_per_sample=4)
    thin = thin_lens_offsets(0.5, (0.0, 0.5, 2.0), 64, rays_per_sample=4)
    # Its spherical aberration at the pupil's edge is a few thousandths of the blur.
    for name in ("x_deg", "y_deg"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(thin, name), atol=4e-3 * np.abs(thin.x_deg).max()
        )
    np.testing.assert_allclose(found.weights, thin.weights, rtol=5e-3)
    assert thin.weights.sum() == pytest.approx(1.0, abs=1e-12)
    assert found.weights.sum() == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("samples", [1, 2, 7, 48, 256])
@pytest.mark.parametrize("rays", [1, 16])
def test_rays_fill_the_disc_evenly(samples, rays):
    points = thin_lens_offsets(1.0, (0.0,), samples, rays_per_sample=rays).points_mm
    assert points.shape == (samples, rays, 2)
    radius2 = np.sum(points**2, axis=-1).ravel()
    assert radius2.max() < 1.0
    # Mean square radius and centre of a uniform disc.
    if samples * rays >= 16:
        assert radius2.mean() == pytest.approx(0.5, abs=0.02)
        np.testing.assert_allclose(points.mean(axis=(0, 1)), 0.0, atol=0.06)


@pytest.mark.parametrize("field", [(0.0, 0.0), (12.0, -5.0)])
def test_rays_through_the_pupil_have_the_moments_of_the_psf(field):
    eye = ic.eyes.navarro(4.0, 2.0)
    found = pupil_offsets(eye, 550.0, (0.5,), 200, rays_per_sample=16, field_deg=field)
    psf = psf_kinds()["geometric"](eye, 550.0, 0.5, 0.004, field)
    n = (np.arange(psf.kernel.shape[0]) - psf.radius) * psf.pitch_deg
    w, x, y = found.weights, found.x_deg[0], found.y_deg[0]
    for mine, kernel, places in ((x, psf.kernel.sum(axis=0), n), (y, psf.kernel.sum(axis=1), -n)):
        scale = math.sqrt(float(np.sum(kernel * places**2)))
        assert np.sum(w * mine) == pytest.approx(np.sum(kernel * places), abs=0.01 * scale)
        assert np.sum(w * mine**2) == pytest.approx(np.sum(kernel * places**2), rel=0.02)


@pytest.mark.slow
def test_cells_of_an_elliptical_pupil_have_the_moments_of_the_psf():
    eye = ic.eyes.navarro(4.0, 2.0)
    narrow = ic.Stop(eye.stop.z_mm, 4.0, minor_diameter_mm=2.0, axis_deg=30.0)
    eye = dataclasses.replace(eye, stop=narrow)
    found = pupil_offsets(eye, 550.0, (0.5,), 200, rays_per_sample=16)
    psf = psf_kinds()["geometric"](eye, 550.0, 0.5, 0.004)
    n = (np.arange(psf.kernel.shape[0]) - psf.radius) * psf.pitch_deg
    x, y = np.meshgrid(n, -n)
    mine = (found.x_deg[0], found.y_deg[0])
    for one, other in ((0, 0), (1, 1), (0, 1)):
        truth = np.sum(psf.kernel * (x, y)[one] * (x, y)[other])
        assert np.sum(found.weights * mine[one] * mine[other]) == pytest.approx(truth, rel=0.03)


def test_light_moves_to_the_right_and_up_by_its_offsets():
    n = 33
    row, column = np.mgrid[0:n, 0:n] - n // 2
    blob = np.exp(-(row**2 + column**2) / 8.0)
    spot = layer(0.0, blob, np.ones((n, n)))
    x, y = 2.3, 3.6
    one = np.ones((1, 1, 1))
    pupil = PupilOffsets((0.0,), np.zeros((1, 1, 2)), one[0], x * one, y * one)
    blur = SpectralBlur(LayerSpectra([spot]), [disc(0.0)], pupil)
    columns, rows, weights = blur.pupil_shifts()
    transfer = blur.points_transfer(columns[0, 0], rows[0, 0], weights[0])
    for image in (
        methods()["aperture_samples"].combine(blur, 1)[0],
        blur.image(transfer * blur.layer_spectrum(0))[0],
    ):
        assert np.sum(image * column) / image.sum() == pytest.approx(x, abs=1e-3)
        assert np.sum(image * row) / image.sum() == pytest.approx(-y, abs=1e-3)


def test_blue_rays_land_farther_out_by_longitudinal_colour():
    # Chromatic difference of refraction of Navarro's eye between 450 and 550 nm.
    eye = ic.eyes.navarro(2.0)
    blue, green = (pupil_offsets(eye, w, (1.0,), 64) for w in (450.0, 550.0))
    slope = [
        -math.radians(float(np.sum(p.x_deg[0] * p.points_mm[..., 0])))
        * 1e3
        / float(np.sum(p.points_mm[..., 0] ** 2))
        for p in (blue, green)
    ]
    defocus = slope[0] - slope[1]
    lca = eye.focus_vergence_dpt(550.0) - eye.focus_vergence_dpt(450.0)
    assert abs(defocus) == pytest.approx(abs(lca), rel=0.05)
    assert abs(defocus) > 0.4


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"samples": 0}, "samples"),
        ({"rays_per_sample": 0}, "rays_per_sample"),
        ({"vergences_dpt": (float("nan"),)}, "vergences_dpt"),
        ({"vergences_dpt": ("a",)}, "vergences_dpt"),
        ({"wavelength_nm": -1.0}, "wavelength_nm"),
        ({"field_deg": (1.0,)}, "field_deg"),
    ],
)
def test_impossible_rays_are_refused(change, match):
    arguments = {"wavelength_nm": 550.0, "vergences_dpt": (1.0,), "samples": 4} | change
    with pytest.raises(ic.InvalidInputError, match=match):
        pupil_offsets(ic.eyes.navarro(), **arguments)

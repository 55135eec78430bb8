"""What a retinal point gathers its light from, against rays sent in, irradiance and ray tracing."""

import numpy as np
import pytest

import isetcl as ic
from isetcl.eye.prescription import elements
from isetcl.eye.sequential import trace_elements
from isetcl.eye.throughput import irradiance_per_radiance
from isetcl.psf_baseline import psf_kinds
from isetcl.psf_baseline.outgoing import RetinalPoint
from isetcl.psf_baseline.psf import launch, seen_from
from isetcl.scene.targets.planes import facing_quad


@pytest.fixture(scope="module")
def eye():
    return ic.eyes.navarro(4.0, 2.0)


@pytest.mark.parametrize("field", [(0.0, 0.0), (14.0, -6.0)])
@pytest.mark.parametrize("vergence", [0.0, 0.5, 12.0])
def test_rays_sent_back_land_where_they_came_from(eye, field, vergence):
    point = RetinalPoint(eye, 450.0, field)
    rng = np.random.default_rng(4)
    rays = point.through(rng.uniform(-1.2, 1.2, (64, 2)))
    found = 0
    for place, offset, flux in zip(
        rays.entrance_points_mm(), rays.offsets_deg(vergence), rays.flux, strict=True
    ):
        if flux == 0.0:
            continue
        source = tuple(np.array(field) - offset)
        # Through the same point in front of the eye, as a ray of that object.
        origin, direction = launch(place[None], vergence, rays.entrance_mm, source)
        landed = trace_elements(elements(eye, 450.0), origin, direction, "retina")
        np.testing.assert_allclose(seen_from(eye, 450.0, landed)[0], field, atol=1e-6)
        found += 1
    assert found > 30


@pytest.mark.parametrize("angle", [0.0, 20.0, 50.0])
def test_the_flux_of_all_rays_is_the_irradiance_of_an_even_field(eye, angle):
    point = RetinalPoint(eye, 550.0, (0.0, angle))
    half = 1.3 * point.radius_mm
    g = (np.arange(400) + 0.5) / 200.0 * half - half
    rays = point.through(np.stack(np.meshgrid(g, g), axis=-1).reshape(-1, 2))
    area = (g[1] - g[0]) ** 2
    index = eye.indices(550.0)
    found = rays.flux.sum() * area * float(index[-1] / index[0]) ** 2
    expected = irradiance_per_radiance(eye, 550.0, eye.field_map(550.0), np.array([angle]))
    # A square grid counts the area in the rim to a few parts in ten thousand.
    assert found == pytest.approx(expected[0], rel=1e-3)


def test_checks_out_of_focus_have_the_contrast_of_ray_tracing(eye):
    checks = ic.Checkerboard(256.0, 256.0, 1.0, 0.05)
    light = ic.Emission(ic.Spectrum.equal_energy(100.0), checks)
    # Turned, so that edges fall between samples in every way.
    quad = facing_quad(2.0, 5.0, 5.0, 25.0)
    scene = ic.Scene((ic.SceneObject("checks", quad, light),))
    view = {"fov_deg": 0.5, "resolution": 32, "wavelengths_nm": np.array([550.0])}
    traced = ic.render(scene, eye, spp=8192, progress=False, **view)
    off = {}
    for kind in ("geometric", "geometric_spread"):
        made = ic.psf_baseline.render(
            scene, eye, psf=kind, field=3, oversampling=4, psf_cache=False, **view
        )
        truth, noise = traced.irradiance.values[0], traced.standard_error.values[0]
        square = np.mean((made.irradiance.values[0] - truth) ** 2.0 - noise**2.0)
        off[kind] = np.sqrt(max(float(square), 0.0)) / truth.mean()
    # 1024 pixels with noise of 0.25 %: a mean square is known to that of 0.055 %.
    assert off["geometric"] < 1e-3
    assert off["geometric_spread"] > 5e-3


def test_kernels_of_retinal_points_keep_all_light(eye):
    for field in ((0.0, 0.0), (5.0, 3.0)):
        psf = psf_kinds()["geometric"](eye, 550.0, 0.5, 0.01, field)
        assert psf.kernel.sum() == pytest.approx(1.0, abs=1e-6)


def test_a_direction_that_no_light_arrives_from_is_refused(eye):
    with pytest.raises(ic.InvalidInputError, match="field"):
        RetinalPoint(eye, 550.0, (120.0, 0.0))


@pytest.mark.parametrize("kind", ["geometric", "geometric_spread"])
@pytest.mark.parametrize("at", [(-1.0, 3.0), (3.0, -1.0), (-3.0, -1.0), (1.0, -3.0), (-1.0, -3.0)])
def test_mirrored_positions_have_mirrored_psfs(eye, kind, at):
    bank = ic.psf_baseline.PsfBank(eye, kind, 0.02, cache=False)
    found, made = bank.psf(550.0, 0.0, at), psf_kinds()[kind](eye, 550.0, 0.0, 0.02, at)
    # Rays fill the pupil in a spiral, which a mirror turns the other way.
    assert np.abs(found.kernel - made.kernel).sum() < 0.02
    wrong = bank.psf(550.0, 0.0, (3.0, 1.0))
    assert np.abs(wrong.kernel - made.kernel).sum() > 0.05
    assert bank.made == 1

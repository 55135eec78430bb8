"""Diffraction and scatter in the renderer, against closed forms, wavefronts and glare functions."""

import numpy as np
import pytest
from leaving_rays import leave
from oracles import reduced_eye
from scipy import special
from test_hurb import SHARES, TABLE

import isetcl as ic
from isetcl.eye.airy import FIRST_ZERO, circle_otf, share_beyond

WAVELENGTH = 550.0
GREEN = np.array([WAVELENGTH])
PERFECT = reduced_eye(2.0)
CUTOFF_CPD = np.radians(2.0 / (WAVELENGTH * 1e-6))


def decision(prepared, feature):
    return next(d for d in prepared.decisions if d.feature == feature)


@pytest.mark.parametrize("case", TABLE)
def test_rays_of_a_perfect_eye_have_the_published_otf_of_hurb(case):
    # 4 standard errors of 131072 random rays: 0.008; quasi-random ones are better.
    otf, _, energy = TABLE[case]
    rays = leave(PERFECT, diffraction=ic.Hurb(*case), samples=2048)
    found, error = rays.otf(SHARES * CUTOFF_CPD)
    assert np.all(np.abs(found - otf) < 4 * error + 1e-4)
    zero = FIRST_ZERO * WAVELENGTH * 1e-6 / (np.pi * 2.0)
    assert rays.share_within(zero) == pytest.approx(energy, abs=4 * 0.5 / 362)


def test_rays_of_a_perfect_eye_have_the_airy_pattern(precision):
    rays = leave(PERFECT, diffraction="airy", samples=2048, precision=precision)
    found, error = rays.otf(np.append(SHARES, [1.0, 1.3]) * CUTOFF_CPD)
    exact = circle_otf(np.append(SHARES, [1.0, 1.3]))
    assert np.all(np.abs(found - exact) < 4 * error + 1e-4)
    # Rings and all: the light within every dark and bright ring, and far out.
    v = np.concatenate([special.jn_zeros(1, 6), special.jn_zeros(0, 6), [50.0, 500.0]])
    share = rays.share_within(v * WAVELENGTH * 1e-6 / (np.pi * 2.0))
    beyond = share_beyond(v)
    error = np.sqrt(beyond * (1 - beyond) / 131072)
    assert np.all(np.abs(share - (1 - beyond)) < 4 * error + 1e-4)


def test_the_airy_pattern_has_its_size_on_the_retina():
    # A small disc at infinity; v = 2 pi n' sin(theta') r / lambda with r on the retina, theta' that
    # of a marginal ray, and no word of the angles in front of the eye.
    disc_arcmin, pixels = 0.4, 60
    scene = ic.scenes.point_source(diameter_arcmin=disc_arcmin)
    view = {"fov_deg": 0.1, "resolution": pixels, "wavelengths_nm": GREEN}
    sharp = ic.render(scene, PERFECT, spp=512, **view)
    image = ic.render(scene, PERFECT, spp=8192, diffraction="airy", **view)
    edge = ic.trace_rays(PERFECT, (0.0, 0.999999, -5.0), (0.0, 0.0, 1.0), WAVELENGTH)
    aperture = 4.0 / 3.0 * abs(edge.directions[0, 1])
    grid = ic.RetinalGrid.of(PERFECT, 0.1, pixels)
    x, y = np.meshgrid(grid.x_deg, grid.y_deg)
    r = np.linalg.norm(grid.field_map.retinal_point_mm(x, y)[..., :2], axis=-1)
    mm = np.linalg.norm(np.diff(grid.field_map.retinal_point_mm(x, y), axis=1), axis=-1).mean()
    per_mm = 2 * np.pi * aperture / (WAVELENGTH * 1e-6)
    disc = per_mm * disc_arcmin / 2 * mm / (0.1 * 60 / pixels)
    s, ds = np.linspace(0.0, 1.0, 1501, retstep=True)
    with np.errstate(invalid="ignore"):
        blur = np.where(s > 0, special.j1(2 * disc * s) / (disc * s), 1.0)
    blur *= np.sinc(per_mm * mm * s / np.pi) ** 0.5  # the pixel, on the mean over directions
    pattern = circle_otf(s) * blur * s * ds
    expected = 8 * special.j0(2 * (per_mm * r)[..., None] * s) @ pattern
    expected *= sharp.irradiance.values.sum() * (per_mm * mm) ** 2 / (16 * np.pi) * 2
    values = image.irradiance.values[0].astype(float)
    error = image.standard_error.values[0].astype(float)
    for low, high in ((0, 1.5), (1.5, 3.2), (3.4, 4.3), (4.6, 5.7), (6.7, 7.4), (7.9, 9.0)):
        there = (per_mm * r >= low) & (per_mm * r < high)
        spread = np.sqrt(np.sum(error[there] ** 2)) + 0.02 * expected[there].sum()
        assert abs(values[there].sum() - expected[there].sum()) < 4 * spread, (low, high)

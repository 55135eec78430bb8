"""Diffraction and scatter in the renderer, against closed forms, wavefronts and glare functions."""

import dataclasses

import numpy as np
import pytest
from leaving_rays import empty_scene, leave
from oracles import reduced_eye
from scipy import special
from scipy.optimize import minimize_scalar
from test_hurb import SHARES, TABLE
from typer.testing import CliRunner

import isetcl as ic
from isetcl.cli import app
from isetcl.errors import InvalidInputError
from isetcl.eye.aberrations.geometric import spot
from isetcl.eye.bending.airy import FIRST_ZERO, circle_otf, share_beyond
from isetcl.eye.bending.bent_otf import bent_otf
from isetcl.eye.bending.ray_bending import Airy, Hurb
from isetcl.render import sobol
from isetcl.render.direct import DirectPipeline
from isetcl.render.paths import PathPipeline
from isetcl.render.plan import plan
from isetcl.render.plan_bends import AUTO_BOUND, mtf_errors
from isetcl.retina.bands import choose_bands
from isetcl.spectrum import luminous_efficiency

pytestmark = pytest.mark.usefixtures("one_register")

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
    width = per_mm * mm
    s, ds = np.linspace(0.0, 1.0, 501, retstep=True)
    with np.errstate(invalid="ignore"):
        # The disc, and a pixel on the mean over its directions.
        round_source = np.where(s > 0, special.j1(2 * disc * s) / (disc * s), 1.0)
    pattern = 2 / np.pi * circle_otf(s) * round_source * np.sinc(width * s / np.pi) * s * ds
    expected = special.j0(2 * (per_mm * r)[..., None] * s) @ pattern
    expected *= width**2 * sharp.irradiance.values.sum(dtype=float)
    values = image.irradiance.values[0].astype(float)
    error = image.standard_error.values[0].astype(float)
    for low, high in ((0, 1.5), (1.5, 3.2), (3.4, 4.3), (4.6, 5.7), (6.7, 7.4), (7.9, 9.0)):
        there = (per_mm * r >= low) & (per_mm * r < high)
        spread = np.sqrt(np.sum(error[there] ** 2)) + 0.02 * expected[there].sum()
        assert abs(values[there].sum() - expected[there].sum()) < 4 * spread, (low, high)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["airy", ic.Hurb()])
def test_elliptical_and_decentred_stops_have_scaled_patterns(model):
    stop = ic.Stop(0.0, 3.0, (0.4, -0.3), 1.5, 30.0)
    rays = leave(dataclasses.replace(PERFECT, stop=stop), diffraction=model, samples=2048)
    passed = rays.weight.sum()
    for width_mm, axis_deg in ((3.0, 30.0), (1.5, 120.0)):
        shares = np.array([0.1, 0.3, 0.5, 0.8])
        found, error = rays.otf(shares * np.radians(width_mm / (WAVELENGTH * 1e-6)), axis_deg)
        exact = circle_otf(shares) if model == "airy" else model.otf(shares)
        # Rays drawn beside the stop, 0.3 %, are no part of the light.
        assert np.all(np.abs(found / passed - exact) < 4 * error + 1e-3)


def test_a_nearly_perfect_eye_has_the_otf_of_its_wavefront():
    # Navarro's eye with a 1 mm stop: diffraction by far prevails.
    eye = ic.eyes.navarro(1.0)
    front = eye.wavefront(wavelength_nm=WAVELENGTH)
    frequency = np.array([3.0, 8.0, 15.0, 22.0, 30.0, 40.0])
    rays = leave(eye, diffraction="airy", samples=2048)
    found, error = rays.otf(frequency)
    assert np.all(np.abs(found - front.otf().mtf(frequency)) < 4 * error + 0.003)


def test_the_paper_s_hurb_is_wider_by_the_index_of_the_aqueous():
    eye = ic.eyes.navarro(1.0)
    frequency = np.array([5.0, 10.0, 20.0, 30.0])
    cutoff = np.radians(2e6 * eye.entrance_pupil(WAVELENGTH).radius_mm / WAVELENGTH)
    index = float(eye.indices(WAVELENGTH)[2])
    found, error = leave(eye, diffraction="iset3d", samples=2048).otf(frequency)
    expected = ic.Hurb.iset3d().otf(frequency / cutoff, index)
    assert np.all(np.abs(found - expected) < 4 * error + 0.003)


# Another program: Navarro, V-weighted over 410 to 700 nm, best at 20 cycles/deg; HURB with
# the paper's axes; entrance pupil, gamma, then 5 10 20 30 60 cycles/deg.
POLYCHROMATIC = (
    pytest.param(2.0, 1.0, (0.861, 0.721, 0.495, 0.340, 0.113), marks=pytest.mark.slow),
    (3.0, 1.889, (0.808, 0.625, 0.374, 0.228, 0.054)),
    pytest.param(2.0, 1.889, (0.772, 0.581, 0.318, 0.168, 0.019), marks=pytest.mark.slow),
    pytest.param(3.0, None, (0.940, 0.815, 0.571, 0.397, 0.186), marks=pytest.mark.slow),
    pytest.param(3.0, 1.0, (0.865, 0.708, 0.472, 0.323, 0.125), marks=pytest.mark.slow),
    pytest.param(3.0, 1.414, (0.838, 0.669, 0.426, 0.278, 0.089), marks=pytest.mark.slow),
    pytest.param(3.4, 1.889, (0.809, 0.621, 0.367, 0.223, 0.059), marks=pytest.mark.slow),
    pytest.param(4.0, 1.889, (0.773, 0.569, 0.338, 0.210, 0.063), marks=pytest.mark.slow),
    pytest.param(6.0, 1.889, (0.426, 0.307, 0.177, 0.106, 0.038), marks=pytest.mark.slow),
)


@pytest.mark.parametrize(("pupil_mm", "gamma", "expected"), POLYCHROMATIC)
def test_polychromatic_transfer_with_hurb_is_the_published_one(pupil_mm, gamma, expected):
    # 30 wavelengths of 8192 rays: 4 standard errors are 0.008 or less.
    eye = ic.eyes.navarro(pupil_mm, pupil_plane="entrance")
    wavelengths = np.arange(410.0, 701.0, 10.0)
    sensitivity = luminous_efficiency(wavelengths)
    model = "none" if gamma is None else ic.Hurb(gamma=gamma)
    rays = [leave(eye, w, samples=128, diffraction=model) for w in wavelengths]
    pupil_m = eye.entrance_pupil(WAVELENGTH).z_mm / 1000.0

    def transfer(vergence_dpt, frequencies):
        total = np.zeros(len(frequencies))
        for bundle, weight in zip(rays, sensitivity, strict=True):
            across = bundle.position_m[:, 0] + bundle.x * (bundle.position_m[:, 2] - pupil_m)
            angle = np.degrees(bundle.x + vergence_dpt * across)
            waves = np.cos(2 * np.pi * np.outer(frequencies, angle))
            total += weight / sensitivity.sum() * (waves @ bundle.weight)
        return total

    start = np.linspace(-0.3, 0.3, 7)
    near = start[np.argmax([transfer(v, [20.0])[0] for v in start])]
    best = minimize_scalar(
        lambda v: -transfer(v, [20.0])[0], bounds=(near - 0.1, near + 0.1), method="bounded"
    )
    found = transfer(best.x, [5.0, 10.0, 20.0, 30.0, 60.0])
    np.testing.assert_allclose(found, expected, atol=0.012)


@pytest.mark.parametrize("diffraction", ["airy", pytest.param("hurb", marks=pytest.mark.slow)])
def test_bends_neither_make_nor_lose_light(diffraction):
    view = {"fov_deg": 8.0, "resolution": 8, "wavelengths_nm": GREEN, "spp": 256}
    eye = ic.eyes.navarro(3.0)
    plain = ic.render(empty_scene(), eye, **view).irradiance.values
    bent = ic.render(
        empty_scene(), eye, diffraction=diffraction, scatter=ic.ScatterModel(), **view
    ).irradiance.values
    # Evanescent light, and rays that meet the rim of the cornea: 1e-4 of all.
    assert np.all(bent <= plain * (1 + 1e-5))
    np.testing.assert_allclose(bent, plain, rtol=2e-3)
    assert bent.mean() == pytest.approx(plain.mean(), rel=2e-4)


def test_a_veil_is_the_glare_function():
    # Every pixel sees the mean of the function over a bright disc, times its solid angle.
    model = ic.ScatterModel(65.0, 1.0)
    radius_deg = 2.0
    scene = ic.scenes.point_source(10.0, diameter_arcmin=120.0 * radius_deg, luminance_cd_m2=100.0)
    view = {"fov_deg": 40.0, "resolution": 40, "wavelengths_nm": GREEN}
    eye = ic.eyes.navarro(3.0)
    white = ic.Scene((), ic.Spectrum.equal_energy(100.0), "white")
    whole = ic.render(white, eye, spp=64, **view).irradiance.values[0]
    image = ic.render(scene, eye, spp=8192, scatter=model, **view)
    share = image.irradiance.values[0] / whole
    error = image.standard_error.values[0] / whole
    grid = ic.RetinalGrid.of(eye, 40.0, 40)
    pointing = grid.directions()
    source, solid = points_of_disc(radius_deg, 12, 24)
    between = np.degrees(np.arccos(np.clip(pointing @ source, -1, 1)))
    expected = model.psf_per_sr(between).mean(axis=-1) * solid
    away = np.degrees(np.arccos(-pointing[..., 2]))
    for low, high in ((3.5, 5), (5, 7), (7, 10), (10, 14), (14, 20), (20, 27)):
        there = (away >= low) & (away < high)
        spread = np.sqrt(np.sum(error[there] ** 2))
        total = expected[there].sum()
        assert spread < 0.06 * total
        assert abs(share[there].sum() - total) < 4 * spread + 0.005 * total, (low, high)
    # In the middle of the disc also the light that is not scattered.
    middle = away < 0.8
    source, solid = points_of_disc(radius_deg, 120, 72)
    between = np.degrees(np.arccos(np.clip(pointing[middle] @ source, -1, 1)))
    within = model.psf_per_sr(between).mean() * solid
    assert share[middle].mean() == pytest.approx(1.0 - model.fraction + within, abs=2e-3)


def points_of_disc(radius_deg, rings, spokes):
    """Directions (3, n) that share the solid angle of a disc on the axis evenly, and that angle."""
    radius = np.radians(radius_deg) * np.sqrt((np.arange(rings) + 0.5) / rings)
    angle, turn = (a.ravel() for a in np.meshgrid(radius, np.arange(spokes) * 2 * np.pi / spokes))
    sine = np.sin(angle)
    directions = np.stack([sine * np.cos(turn), sine * np.sin(turn), -np.cos(angle)])
    return directions, 2 * np.pi * (1 - np.cos(np.radians(radius_deg)))


@pytest.mark.slow
def test_both_pipelines_bend_the_same_rays(few_lanes):
    scene = ic.scenes.two_planes(0.5, 2.0)
    view = {
        "fov_deg": 4.0,
        "resolution": 16,
        "wavelengths_nm": GREEN,
        "diffraction": "hurb",
        "scatter": ic.ScatterModel(),
        "precision": "double",
    }
    direct, paths = plan(scene, PERFECT, **view), plan(scene, PERFECT, pipeline="paths", **view)
    one, other = DirectPipeline(direct), PathPipeline(paths)
    word = sobol.stream(3, 0)
    first = np.tensordot(direct.expansion, one.sample(one.tiles()[0], 32, word), axes=1)
    second = np.tensordot(paths.expansion, other.sample(other.tiles()[0], 32, word), axes=1)
    np.testing.assert_allclose(second, first, rtol=1e-6)


def test_the_default_compiles_no_bends():
    prepared = plan(empty_scene(), PERFECT, wavelengths_nm=GREEN)
    defines = prepared.config.defines(prepared.device)
    assert (defines["HAS_DIFFRACTION"], defines["HAS_SCATTER"]) == (0, 0)
    assert decision(prepared, "diffraction").choice == "left out"
    assert prepared.bends.describe() == {"diffraction": None, "scatter": None}


@pytest.mark.parametrize(
    ("eye", "resolution", "chosen"),
    [
        pytest.param(PERFECT, 128, "airy", marks=pytest.mark.slow),
        pytest.param(ic.eyes.navarro(2.0), 128, "iset3d", marks=pytest.mark.slow),
        pytest.param(PERFECT, 2, "none", marks=pytest.mark.slow),
    ],
)
def test_auto_takes_what_comes_nearest_to_the_exact_transfer(eye, resolution, chosen):
    prepared = plan(empty_scene(), eye, fov_deg=2.0, resolution=resolution, diffraction="auto")
    assert prepared.config.diffraction == chosen
    errors = mtf_errors(eye, prepared.grid, prepared.wavelengths_nm)
    assert (errors["none"] > AUTO_BOUND) == (chosen != "none")
    told = decision(prepared, "diffraction").reason
    for error in errors.values():
        assert f"{error:.2g}" in told
    assert f"bound {AUTO_BOUND:g}" in told
    if chosen == "iset3d":
        assert errors["hurb"] < 0.025 < errors["airy"] < errors["none"]


def test_the_errors_that_auto_weighs_are_those_of_a_perfect_eye():
    # No blur: sinc(f p) (1 - D(f)) at its largest up to half a cycle a pixel, and none with airy.
    grid = ic.RetinalGrid.of(PERFECT, 1.0, 100)
    f = np.linspace(0.0, 50.0, 13)
    exact = np.max(np.sinc(f * 0.01) * (1 - circle_otf(f / CUTOFF_CPD)))
    errors = mtf_errors(PERFECT, grid, GREEN)
    assert errors["none"] == pytest.approx(exact, abs=2e-3)
    assert errors["airy"] < 3e-3


@pytest.mark.parametrize("model", [Airy(), Hurb(), Hurb.iset3d()])
def test_rays_of_an_aberrated_eye_have_the_closed_form_s_transfer(model):
    # The kernels draw at random what `bent_otf` sums over the pupil.
    eye = ic.eyes.navarro(4.0)
    frequency = np.array([2.0, 5.0, 10.0, 20.0])
    index = float(eye.indices(WAVELENGTH)[2])
    rays = spot(eye, wavelength_nm=WAVELENGTH)
    expected = bent_otf(rays, model, frequency, stop=eye.stop, stop_index=index)
    found, error = leave(eye, diffraction=model, samples=2048).otf(frequency)
    assert np.all(np.abs(found - expected.real) < 4 * error + 0.004)
    assert np.max(np.abs(expected.imag)) < 1e-6


def test_diffraction_asks_for_more_bands():
    # An achromatic eye needs one, unless its pattern grows with the wavelength.
    grid = ic.RetinalGrid.of(PERFECT, 1.0, 200)
    wavelengths = np.linspace(400.0, 700.0, 31)
    assert len(choose_bands(PERFECT, grid, wavelengths, "auto").bands) == 1
    bands = choose_bands(PERFECT, grid, wavelengths, "auto", has_diffraction=True).bands
    ratio = [wavelengths[b.last] / wavelengths[b.first] for b in bands]
    assert len(bands) > 1
    assert max(ratio) < 1.4


def test_what_bends_is_in_the_provenance():
    view = {"fov_deg": 1.0, "resolution": 4, "spp": 2, "wavelengths_nm": GREEN}
    bends = {"diffraction": "airy", "scatter": ic.ScatterModel(50.0)}
    told = ic.render(empty_scene(), PERFECT, **bends, **view).provenance
    assert told["diffraction"] == {"model": "airy"}
    assert told["scatter"]["age_years"] == 50.0
    prepared = plan(empty_scene(), PERFECT, diffraction=ic.Hurb("optrace", 1.5))
    assert prepared.bends.describe()["diffraction"] == {
        "model": "hurb",
        "axes": "optrace",
        "gamma": 1.5,
        "wavelength": "medium",
    }


def test_the_command_line_explains_what_bends():
    arguments = ["render", "uniform", "--explain", "--diffraction", "iset3d", "--scatter", "60"]
    told = CliRunner().invoke(app, arguments)
    assert told.exit_code == 0, told.output
    assert "hurb (iset3d, gamma 1.418, lambda in vacuum)" in told.output
    assert "cie_general" in told.output


@pytest.mark.parametrize(
    ("bends", "named"),
    [
        ({"diffraction": "huygens"}, "diffraction"),
        ({"diffraction": None}, "diffraction"),
        ({"scatter": 0.1}, "scatter"),
    ],
)
def test_unknown_bends_are_named(bends, named):
    with pytest.raises(InvalidInputError, match=named):
        plan(empty_scene(), PERFECT, **bends)

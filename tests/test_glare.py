"""Glare functions against their published values, and the veil made from them."""

import math

import numpy as np
import pytest
from scipy.integrate import quad, trapezoid
from slow_cases import slow_after

import isetcl as ic
from isetcl.eye.field import direction_from_field
from isetcl.eye.people import glare
from isetcl.eye.people.scatter import ScatterModel, hankel, radial_kernel

MODELS = [ScatterModel(20.0, 0.5, "vos_van_den_berg"), ScatterModel(70.0, 1.0, "cie_general")]


def over_half_space(psf, low_deg=1e-7, high_deg=90.0):
    """The integral of a radial function in 1/sr, by the trapezium rule in log angle."""
    log_angle = np.linspace(math.log(low_deg), math.log(high_deg), 200_001)
    angle = np.exp(log_angle)
    ring = 2.0 * np.pi * np.sin(np.radians(angle)) * np.radians(angle)
    return float(trapezoid(psf(angle) * ring, log_angle))


def test_the_cie_functions_have_their_published_values():
    # CIE 146:2002: 10 + (5 + 0.05) (1 + 0.4^4) + 0.00125 at 1 deg, 25 years, brown eyes.
    assert float(glare.cie_general(1.0, 25.0, 0.5)) == pytest.approx(15.18053, abs=1e-9)
    assert float(glare.cie_general(10.0, 62.5, 1.0)) == pytest.approx(0.01 + 0.06 * 2 + 0.0025)
    assert float(glare.cie_small_angle(2.0, 62.5)) == pytest.approx(1.25 + 2.5)
    assert float(glare.stiles_holladay(10.0, 70.0)) == pytest.approx(0.2)


def test_the_general_function_of_unpigmented_wall_light_is_the_small_angle_one():
    angle = np.array([0.1, 1.0, 5.0, 30.0])
    assert glare.cie_general(angle, 50.0, 0.0) == pytest.approx(glare.cie_small_angle(angle, 50.0))


def test_the_total_glare_function_has_its_values_and_integrals():
    # Values and integrals of an independent implementation.
    values = glare.vos_van_den_berg(np.array([0.0, 0.01, 0.1, 1.0, 10.0]), 20.0, 0.5)
    assert values == pytest.approx([9.154e6, 7.949e5, 1.145e4, 18.81, 0.0597], rel=7e-4)
    for age, p, total, beyond in ((20, 0.5, 1.0101, 0.0749), (20, 0, 1.0049, 0.0614)):

        def psf(angle, age=age, p=p):
            return glare.vos_van_den_berg(angle, age, p)

        assert over_half_space(psf) == pytest.approx(total, abs=6e-5)
        assert over_half_space(psf, 1.0) == pytest.approx(beyond, abs=6e-5)
    aged = over_half_space(lambda angle: glare.vos_van_den_berg(angle, 70.0, 0.5))
    assert aged == pytest.approx(1.0172, abs=6e-5)


def test_the_functions_agree_where_they_all_apply():
    # They describe the same measurements: within a quarter of each other, Stiles-Holladay a half.
    angle = np.linspace(3.0, 10.0, 8)
    general = glare.cie_general(angle, 30.0, 0.5)
    assert glare.vos_van_den_berg(angle, 30.0, 0.5) == pytest.approx(general, rel=0.25)
    assert glare.stiles_holladay(angle, 30.0) == pytest.approx(general, rel=0.5)


def test_spencers_function_is_a_point_spread_function():
    # Each of its parts is normalised over small angles; together they hold all light.
    assert over_half_space(glare.spencer_photopic) == pytest.approx(1.0, abs=0.02)
    f0, f1, f2 = 2.61e6, 20.91 / 0.02**3, 72.37 / 0.02**2
    assert float(glare.spencer_photopic(0.0)) == pytest.approx(0.384 * f0 + 0.478 * f1 + 0.138 * f2)


@pytest.mark.parametrize(("age", "m", "pupil"), [(20, 0.142, 3.0), (70, 0.16, 6.0)])
def test_ijspeerts_function_holds_all_light_and_has_its_own_mtf(age, m, pupil):
    def psf(angle):
        return glare.ijspeert_psf(angle, age, m, pupil)

    assert over_half_space(psf) == pytest.approx(1.0, abs=1e-5)
    assert float(glare.ijspeert_mtf(0.0, age, m, pupil)) == pytest.approx(1.0)
    # At 1 cycle/degree and more only narrow terms count, for which small angles are exact.
    edges = np.concatenate([[0.0], np.geomspace(1e-5, 0.1, 200), np.arange(0.15, 90.0, 0.05)])
    for frequency in (1.0, 5.0):
        expected = float(glare.ijspeert_mtf(frequency, age, m, pupil))
        assert hankel(psf, frequency, edges) == pytest.approx(expected, abs=2e-4)


def test_ijspeerts_terms_have_their_values():
    # Age 70 doubles the age factor, 3.2 mm halves the small-angle share; worked out by hand from
    # the paper's expressions for m = 0.142.
    share, width = glare.ijspeert_terms(70.0, 0.142, 3.2)
    assert share == pytest.approx([0.375656, 0.375656, 0.036438, 0.212249], abs=2e-6)
    assert width == pytest.approx([8.14194e-5, 1.332795e-3, 0.0624220, 1.0], rel=1e-5)


@pytest.mark.parametrize("model", MODELS)
def test_the_veil_is_the_glare_function_beyond_its_window(model):
    own = getattr(glare, model.function)
    angle = np.array([1.0, 2.0, 20.0, 89.0])
    expected = own(angle, model.age_years, model.pigmentation)
    assert model.psf_per_sr(angle) == pytest.approx(expected)
    assert np.all(model.psf_per_sr(np.array([0.0, 0.05, 0.1, 90.1])) == 0.0)
    # A quarter and half of the way up in log angle: s^2 (3 - 2 s) is 5/32 and 1/2.
    for place, share in ((0.1**0.75, 5.0 / 32.0), (0.1**0.5, 0.5)):
        whole = float(own(place, model.age_years, model.pigmentation))
        assert float(model.psf_per_sr(place)) == pytest.approx(share * whole)


@pytest.mark.parametrize("model", MODELS)
def test_the_scattered_share_is_the_integral_over_the_half_space(model):
    assert model.fraction == pytest.approx(over_half_space(model.psf_per_sr, 0.1), rel=1e-7)
    below = over_half_space(model.psf_per_sr, 0.1, 5.0)
    assert float(model.fraction_within(5.0)) == pytest.approx(below, rel=1e-4)


def test_the_young_brown_eye_scatters_a_known_share():
    # 7.49 % beyond 1 deg (as above); the window lets a little less through below.
    model = ScatterModel(20.0, 0.5, "vos_van_den_berg")
    beyond = model.fraction - float(model.fraction_within(1.0))
    assert beyond == pytest.approx(0.0749, abs=1e-4)
    assert ScatterModel(80.0).fraction > 2.0 * ScatterModel(20.0).fraction


@pytest.mark.parametrize("model", MODELS)
def test_scatter_angles_have_the_distribution_of_the_veil(model):
    u = np.linspace(0.0, 1.0, 4001)[:-1]
    angle = model.angle_of(u)
    assert np.all(np.diff(angle) > 0.0)
    assert angle[0] == pytest.approx(0.1)
    assert angle[-1] <= 90.0
    assert model.u_of(angle) == pytest.approx(u, abs=1e-12)
    nodes, angles = model.table()
    assert np.all(np.diff(nodes) > 0.0)
    assert np.all(np.diff(angles) > 0.0)

    def ring(angle_deg):
        return float(model.psf_per_sr(angle_deg)) * math.sin(math.radians(angle_deg))

    whole = quad(ring, 0.1, 90.0, limit=500, points=[0.2, 1.0, 10.0])[0]
    for share in (0.1, 0.5, 0.9, 0.99):
        edge = float(model.angle_of(share))
        points = [p for p in (0.2, 1.0, 10.0) if p < edge]
        part = quad(ring, 0.1, edge, limit=500, points=points)[0]
        assert part / whole == pytest.approx(share, abs=1e-4)


def test_the_transform_of_a_lorentzian_like_spread_is_an_exponential():
    # (1 + (t/s)^2)^-1.5 / (2 pi s^2) has the transform exp(-2 pi s f).
    s = 0.02

    def psf(angle):
        return 1.0 / (2.0 * np.pi * math.radians(s) ** 2 * (1.0 + (angle / s) ** 2) ** 1.5)

    edges = np.concatenate([np.geomspace(1e-4, 0.05, 60), np.arange(0.06, 30.0, 0.01)])
    edges = np.concatenate([[0.0], edges])
    for frequency in (2.0, 5.0, 10.0):
        expected = math.exp(-2.0 * math.pi * s * frequency)
        assert hankel(psf, frequency, edges) == pytest.approx(expected, abs=3e-4)


@pytest.mark.parametrize("model", MODELS)
def test_the_mtf_of_the_veil_is_that_of_its_kernel(model):
    # A second algorithm: the cosine transform of the samples of the kernel.
    pitch, reach = 0.05, 20.0
    kernel = model.veil_kernel(pitch, reach)
    assert kernel.sum() == pytest.approx(float(model.fraction_within(reach)), rel=3e-3)
    x = (np.arange(len(kernel)) - len(kernel) // 2) * pitch
    lost = model.fraction - kernel.sum()
    for frequency in (0.3, 1.0, 3.0):
        sinc = np.sinc(frequency * pitch)  # samples are means over squares
        veil = float(kernel.sum(axis=0) @ np.cos(2.0 * np.pi * frequency * x)) / sinc
        expected = 1.0 - model.fraction + veil
        assert float(model.mtf(frequency)) == pytest.approx(expected, abs=0.02 * lost + 2e-5)


def test_scatter_lowers_all_frequencies_but_zero():
    model = ScatterModel(35.0)
    mtf = model.mtf([0.0, 0.1, 1.0, 10.0, 60.0])
    assert mtf[0] == pytest.approx(1.0, abs=1e-12)
    assert np.all(np.diff(mtf[:4]) < 0.0)
    assert mtf[-1] == pytest.approx(1.0 - model.fraction, abs=1e-4)


def test_kernels_are_integrals_over_squares():
    # A Gaussian has its integral over a square in closed form.
    sigma, pitch = 0.3, 0.2
    psf = radial_kernel(
        lambda t: np.exp(-((t / sigma) ** 2) / 2) / (2 * np.pi * math.radians(sigma) ** 2),
        pitch,
        3.0,
    )
    edges = (np.arange(psf.shape[0] + 1) - psf.shape[0] / 2) * pitch / (sigma * math.sqrt(2))
    line = np.diff([math.erf(e) for e in edges]) / 2.0
    assert psf == pytest.approx(np.outer(line, line), abs=1e-9)


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: glare.cie_general(0.05), "angle_deg must lie between 0.1 and 100"),
        (lambda: glare.stiles_holladay(40.0), "between 1 and 30"),
        (lambda: glare.cie_general(1.0, 120.0), "age_years must lie between"),
        (lambda: glare.cie_general(math.nan), "angle_deg"),
        (lambda: ScatterModel(pigmentation=2.0), "pigmentation must lie between 0 and 1.2"),
        (lambda: ScatterModel(function="vos_van"), "did you mean vos_van_den_berg"),
        (lambda: ScatterModel(window_deg=(0.01, 1.0)), "window_deg must be two ascending"),
        (lambda: ScatterModel().angle_of(1.0), r"u must lie in \[0, 1\)"),
        (lambda: ScatterModel().mtf(-1.0), "frequency_cpd"),
        (lambda: ScatterModel().veil_kernel(0.01, 60.0), "more than 4096"),
    ],
)
def test_glare_out_of_range_is_refused(make, match):
    with pytest.raises(ic.InvalidInputError, match=match):
        make()


LIGHT = ic.Spectrum.constant(1.0)


def lamp(x_deg, y_deg, radius_deg, eye):
    """A scene with one round lamp at 1 m that faces the entrance pupil."""
    towards = direction_from_field(np.array(x_deg), np.array(y_deg))
    centre = towards + np.array([0.0, 0.0, eye.entrance_pupil().z_mm / 1000.0])
    disc = ic.Disc(tuple(centre), math.tan(math.radians(radius_deg)), tuple(-towards))
    return ic.Scene(name="lamp", objects=(ic.SceneObject("lamp", disc, ic.Emission(LIGHT)),))


def veil_of_lamp(image, source_deg, radius_deg, model):
    """Radiance of the veil at every pixel: the glare function averaged over the lamp's disc."""
    x, y = np.meshgrid(image.dataset["x"].values, image.dataset["y"].values)
    rings = np.sqrt((np.arange(8) + 0.5) / 8.0) * radius_deg
    turns = np.arange(12) * np.pi / 6.0
    dx = (rings[:, None] * np.cos(turns)).ravel()
    dy = (rings[:, None] * np.sin(turns)).ravel()
    sources = direction_from_field(source_deg[0] + dx, source_deg[1] + dy)
    cosine = np.clip(direction_from_field(x, y) @ sources.T, -1.0, 1.0)
    solid = 2.0 * np.pi * (1.0 - math.cos(math.radians(radius_deg)))
    return model.psf_per_sr(np.degrees(np.arccos(cosine))).mean(axis=-1) * solid


@pytest.mark.parametrize(
    ("source", "radius", "centre", "fov", "beside", "tolerance"),
    slow_after(
        2,
        [
            ((0.0, 0.0), 0.1, (0.0, 0.0), 2.0, 0.3, 0.01),
            ((50.0, 0.0), 1.0, (0.0, 0.0), 2.0, 0.0, 0.005),
            ((0.0, 0.0), 0.1, (5.0, 0.0), 2.0, 0.0, 0.005),
            ((6.0, 0.0), 0.3, (0.0, 0.0), 1.0, 0.0, 0.01),
            ((20.0, 20.0), 0.5, (0.0, 0.0), 2.0, 0.0, 0.005),
        ],
    ),
)
def test_a_lamp_is_veiled_by_the_glare_function(source, radius, centre, fov, beside, tolerance):
    # Far from the lamp there is nothing but scatter: glare x radiance x solid angle, seen by the
    # same throughput as a uniform field.
    eye, model = ic.eyes.navarro(3.0, 1.0), ScatterModel(70.0)
    options = {"fov_deg": fov, "resolution": 48, "centre_deg": centre, "wavelengths_nm": [550.0]}
    image = ic.psf_baseline.render(lamp(*source, radius, eye), eye, scatter=model, **options)
    even = ic.Scene(name="even", objects=(), background=LIGHT)
    throughput = ic.psf_baseline.render(even, eye, **options).irradiance.values[0]
    expected = veil_of_lamp(image, source, radius, model)
    x, y = np.meshgrid(image.dataset["x"].values, image.dataset["y"].values)
    clear = np.hypot(x - source[0], y - source[1]) > beside
    ratio = image.irradiance.values[0] / throughput / expected
    assert np.max(np.abs(ratio[clear] - 1.0)) < tolerance


@pytest.mark.parametrize("method", ["layered_sum", "layered_over"])
def test_scatter_moves_light_but_makes_none(method):
    eye, model = ic.eyes.navarro(3.0, 1.0), ScatterModel(50.0, 1.0, "vos_van_den_berg")
    options = {"method": method, "fov_deg": 4.0, "resolution": 80, "wavelengths_nm": [550.0]}
    scene = lamp(0.0, 0.0, 0.1, eye)
    clear = ic.psf_baseline.render(scene, eye, **options)
    veiled = ic.psf_baseline.render(scene, eye, scatter=model, **options)
    x, y = np.meshgrid(clear.dataset["x"].values, clear.dataset["y"].values)
    whole = clear.irradiance.values.sum()
    circle = np.hypot(x, y) < 1.9
    # What stays in the core, and what the veil keeps within the circle.
    expected = 1.0 - model.fraction + float(model.fraction_within(1.9))
    assert veiled.irradiance.values[0][circle].sum() / whole == pytest.approx(expected, abs=2e-3)
    assert veiled.provenance["scatter"]["fraction"] == pytest.approx(model.fraction)
    assert clear.provenance["scatter"] is None


def test_scatter_changes_nothing_in_an_even_field():
    scene = ic.Scene(name="even", objects=(), background=LIGHT)
    eye = ic.eyes.navarro(4.0)
    options = {"fov_deg": 6.0, "resolution": 12, "wavelengths_nm": [550.0]}
    clear = ic.psf_baseline.render(scene, eye, **options)
    veiled = ic.psf_baseline.render(scene, eye, scatter=ScatterModel(80.0), **options)
    ratio = veiled.irradiance.values / clear.irradiance.values
    # A little light is missing: beyond 90 deg from the axis there is none.
    assert np.max(np.abs(ratio - 1.0)) < 2e-3


def test_what_is_no_scatter_model_is_refused():
    scene = ic.Scene(name="even", objects=(), background=LIGHT)
    with pytest.raises(ic.InvalidInputError, match="scatter must be a ScatterModel"):
        ic.psf_baseline.render(scene, ic.eyes.navarro(), scatter=0.1)

"""Eyes with gradient-index lenses: what is refused, rendered and planned."""

import dataclasses

import numpy as np
import pytest

import isetcl as ic
from isetcl.device.gradients import WANTED_MM
from isetcl.errors import InvalidInputError
from isetcl.eye.gradient import PolynomialGradient, PolynomialMedium, ShellGradient, ShellMedium
from isetcl.eye.media import ConstantIndex, CornuDispersion
from isetcl.eye.throughput import axial_irradiance_per_radiance
from isetcl.render.plan import plan

FRONT = PolynomialGradient(((1.368, -0.001978), (0.049057,), (-0.015427,)))


def with_media(replaced):
    """Liou & Brennan's eye with the media behind some of its surfaces replaced."""
    eye = ic.eyes.liou_brennan(4.0)
    surfaces = [
        dataclasses.replace(s, medium_after=replaced.get(s.name, s.medium_after))
        for s in eye.surfaces
    ]
    return dataclasses.replace(eye, surfaces=tuple(surfaces))


def gradient(profile=FRONT, n=1.368):
    return PolynomialMedium("gradient", ConstantIndex(n), profile)


def shells(**changes):
    values = {
        "name": "shells",
        "dispersion": ConstantIndex(1.41),
        "edge": ConstantIndex(1.37),
        "centre_z_mm": 1.59,
        "semi_z_mm": 1.59,
        "semi_r_mm": 5.3,
        "power": 3.0,
    }
    return ShellMedium(**(values | changes))


def shell_eye(pupil_mm):
    """Liou & Brennan's cornea with a lens of shells of a real power."""
    front, rear = shells(
        dispersion=CornuDispersion(1.39, 8.0), edge=CornuDispersion(1.35, 7.0), power=2.7
    ).halves(2.43, ("front half", "rear half"))
    eye = with_media({"lens front": front, "lens equator": rear})
    return dataclasses.replace(eye, stop=dataclasses.replace(eye.stop, diameter_mm=pupil_mm))


@pytest.mark.parametrize(
    ("build", "parts"),
    [
        (lambda: with_media({"cornea back": gradient()}), ("at the stop", "homogeneous")),
        (lambda: with_media({"lens back": gradient()}), ("vitreous", "between two surfaces")),
        (
            lambda: dataclasses.replace(ic.eyes.liou_brennan(4.0), medium_before=gradient()),
            ("in front of the eye", "homogeneous"),
        ),
        (
            lambda: with_media({"lens front": gradient(PolynomialGradient(((1.368,), (-0.5,))))}),
            ("lens", "must be >= 1", "measured from the surface in front"),
        ),
        (
            lambda: with_media({"lens front": shells(semi_r_mm=3.0)}),
            ("'shells'", "semi_r_mm must be >=", "got 3", "make the shells wider"),
        ),
        (lambda: PolynomialGradient(()), ("coefficients", "rows")),
        (lambda: PolynomialGradient(((1.4, np.nan),)), ("coefficients", "finite")),
        (lambda: PolynomialGradient(((1.4,),) * 9), ("coefficients", "9 rows")),
        (lambda: PolynomialGradient("1.4"), ("coefficients", "rows of numbers")),
        (lambda: ShellGradient(0.9, 1.3, 0.0, 1.0, 1.0, 2.0), ("n_core", ">= 1", "0.9")),
        (lambda: ShellGradient(1.4, 1.3, 0.0, 0.0, 1.0, 2.0), ("semi_z_mm", "> 0")),
        (lambda: shells(power=0.5), ("'shells'", "power must be >= 1", "0.5")),
        (lambda: shells(edge=None), ("shells, edge", "dispersion")),
        (lambda: shells(edge=1.37), ("shells, edge", "ConstantIndex")),
        (lambda: PolynomialMedium("m", ConstantIndex(1.4), ((1.4,),)), ("'m': profile",)),
    ],
)
def test_gradients_that_make_no_sense_are_refused(build, parts):
    with pytest.raises(InvalidInputError) as caught:
        build()
    for part in parts:
        assert part in str(caught.value)


def test_a_wavelength_beyond_the_edges_formula_is_refused_by_the_mediums_name():
    medium = shells(edge=CornuDispersion(1.37, 6.0))
    assert medium.range_nm == (380.0, 780.0)
    with pytest.raises(InvalidInputError, match=r"'shells'.*380 and 780"):
        medium.gradient(800.0)
    with pytest.raises(InvalidInputError, match=r"'shells'.*380 and 780"):
        medium.index(350.0)


def test_dispersion_shifts_a_polynomial_and_moves_core_and_edge_of_shells():
    x, y, z = 0.3, -0.4, np.linspace(0.0, 1.5, 7)
    curve = CornuDispersion(1.35, 7.0)
    medium = PolynomialMedium("m", curve, FRONT)
    blue, red = (medium.gradient(w).index(x, y, z) for w in (450.0, 650.0))
    step = 7.0 / (450.0 - 130.0) - 7.0 / (650.0 - 130.0)
    np.testing.assert_allclose(blue - red, step, rtol=1e-12)
    assert medium.gradient(500.0).index(0.0, 0.0, 0.0) == pytest.approx(1.35 + 7.0 / 370.0)
    onion = shells(dispersion=curve, edge=ConstantIndex(1.36))
    core, origin = (onion.gradient(450.0).index(0.0, 0.0, at) for at in (1.59, 0.0))
    assert core == pytest.approx(1.35 + 7.0 / 320.0)
    assert origin == pytest.approx(1.36)
    assert onion.index(450.0) == pytest.approx(1.36)


@pytest.mark.slow
@pytest.mark.parametrize("builder", [ic.eyes.liou_brennan, ic.eyes.atchison])
def test_uniform_radiance_through_a_gradient_lens_gives_what_the_marginal_ray_says(
    builder, precision
):
    eye = builder(3.0)
    if not eye.is_rotational:
        eye = builder(3.0, is_retina_round=True)
    image = ic.render(
        ic.scenes.uniform(100.0),
        eye,
        fov_deg=0.05,
        resolution=4,
        spp=256,
        wavelengths_nm=[555.0],
        precision=precision,
    )
    light = ic.Spectrum.equal_energy(100.0).at([555.0])[0]
    expected = axial_irradiance_per_radiance(eye, 555.0) * light
    assert float(image.irradiance.mean()) == pytest.approx(expected, rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("make", [ic.eyes.liou_brennan, shell_eye])
def test_both_pipelines_see_the_same_through_a_gradient_lens(make, few_lanes):
    unit = ic.Spectrum.constant(1.0)
    # A triangle behind the eye only brings the path pipeline in.
    corners = [[0, 0, 5], [1e-3, 0, 5], [0, 1e-3, 5]]
    hidden = ic.SceneObject("hidden", ic.Mesh(corners, [[0, 1, 2]]), ic.Emission(unit))
    objects = ic.scenes.two_planes(edge_angle_deg=20.0).objects
    where = {"fov_deg": 2.0, "resolution": 12, "spp": 32, "wavelengths_nm": [500.0, 600.0]}
    eye = make(4.0)
    direct = ic.render(ic.Scene(objects), eye, **where).irradiance.values
    paths = ic.render(ic.Scene((*objects, hidden)), eye, **where).irradiance.values
    # The same rays; hardly one of 9216 meets an edge on the other side of rounding, which moves its
    # pixel by one sample of 32.
    off = np.abs(paths - direct) / direct.max()
    assert np.count_nonzero(off > 1e-6) <= 3
    assert off.max() < 1.5 / 32


def test_a_plan_says_how_many_steps_go_through_a_lens():
    options = {"fov_deg": 1.0, "resolution": 4, "wavelengths_nm": [555.0]}
    scene = ic.scenes.uniform(100.0)
    for precision, steps in (("single", "1, 1"), ("double", "3, 3")):
        text = plan(scene, ic.eyes.liou_brennan(4.0), precision=precision, **options).explain()
        line = next(row for row in text.splitlines() if "steps through gradients" in row)
        assert steps in line
        assert f"{WANTED_MM[precision]:g} mm" in line
    text = plan(scene, ic.eyes.navarro(4.0), **options).explain()
    assert "steps through gradients" not in text

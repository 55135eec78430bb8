"""The fused kernel against an independent float64 estimator that uses the same samples."""

import dataclasses

import numpy as np
import pytest
from oracles import estimate
from slow_cases import slow_after

import isetcl as ic
from isetcl.render import sobol
from isetcl.render.direct import DirectPipeline, Tile
from isetcl.render.plan import plan

RED = ic.Spectrum(np.array([380.0, 780.0]), np.array([0.1, 1.0]), "red")
BLUE = ic.Spectrum(np.array([380.0, 780.0]), np.array([1.0, 0.1]), "blue")
GREEN = ic.Spectrum(np.array([380.0, 550.0, 780.0]), np.array([0.0, 1.0, 0.0]), "green")
WHITE = ic.Spectrum.equal_energy(100.0)


def smooth_image(channels, size=48):
    rng = np.random.default_rng(4)
    y, x = np.mgrid[0:size, 0:size] / size
    planes = [
        0.5
        + 0.5 * np.sin(2 * np.pi * (rng.uniform(1, 3) * x + rng.uniform(1, 3) * y + rng.uniform()))
        for _ in range(channels)
    ]
    return ic.Image(np.stack(planes, axis=-1))


def quad(z, half, material, name="quad", lean=0.0):
    corner = (-half, -half, -z + lean)
    return ic.SceneObject(
        name, ic.Quad(corner, (2 * half, 0.0, -lean), (0.0, 2 * half, -lean)), material
    )


def scenes():
    """Scenes that between them use every feature of the pipeline."""
    board = ic.Checkerboard(7, 5, 0.9, 0.2)
    return {
        "two planes": ic.scenes.two_planes(0.5, 2.0),
        "background": ic.Scene((quad(1.0, 0.02, ic.Emission(WHITE)),), RED),
        "leaning quad": ic.Scene((quad(1.0, 0.2, ic.Emission(WHITE, board), lean=0.1),), BLUE),
        "disc": ic.Scene(
            (
                ic.SceneObject(
                    "disc",
                    ic.Disc((0.01, -0.01, -0.7), 0.03, (0.2, 0.3, 1.0)),
                    ic.Emission(RED, board),
                ),
            ),
            BLUE,
        ),
        "spheres": ic.Scene(
            (
                ic.SceneObject("near", ic.Sphere((0.02, 0.0, -0.5), 0.015), ic.Emission(RED)),
                ic.SceneObject("around", ic.Sphere((0.0, 0.0, 0.0), 3.0), ic.Emission(BLUE)),
            ),
            None,
        ),
        "textured sphere": ic.Scene(
            (ic.SceneObject("ball", ic.Sphere((0.0, 0.0, -0.6), 0.04), ic.Emission(WHITE, board)),),
            None,
        ),
        "grey image": ic.Scene((quad(0.8, 0.06, ic.Emission(WHITE, smooth_image(1))),), RED),
        "coloured images": ic.Scene(
            (
                quad(0.5, 0.02, ic.Emission((RED, GREEN, BLUE), smooth_image(3)), "near"),
                quad(2.0, 0.3, ic.Emission((RED, GREEN, BLUE), smooth_image(3, 32)), "far"),
            ),
            None,
        ),
        "grey and coloured": ic.Scene(
            (
                quad(0.5, 0.02, ic.Emission(GREEN, smooth_image(1)), "near"),
                quad(2.0, 0.3, ic.Emission((RED, GREEN, BLUE), smooth_image(3)), "far"),
            ),
            None,
        ),
        "reflectance": ic.Scene(
            (quad(0.8, 0.05, ic.UnlitReflectance(ic.Spectrum.constant(0.4), WHITE, board)),), None
        ),
    }


def compare(scene, eye, precision, *, fov_deg=5.0, centre_deg=(0.0, 0.0), samples=24, **changes):
    """Largest difference from the estimator over some pixels, relative to the largest value."""
    prepared = plan(
        scene,
        eye,
        fov_deg=fov_deg,
        resolution=(24, 20),
        centre_deg=centre_deg,
        bands=3,
        precision=precision,
    )
    prepared = dataclasses.replace(prepared, config=dataclasses.replace(prepared.config, **changes))
    stream = sobol.stream(11, 2)
    film = DirectPipeline(prepared).sample(Tile(0, 0, 24, 20), samples, stream)
    n_basis = prepared.config.n_basis
    columns, rows = (a.ravel() for a in np.meshgrid(np.arange(0, 24, 3), np.arange(0, 20, 3)))
    bits = 24 if precision == "single" else 31
    differences, largest = [], 0.0
    for band in range(3):
        expected = estimate(prepared, band, columns, rows, samples, stream, bits)
        got = film[band * n_basis : (band + 1) * n_basis, rows, columns]
        differences.append(np.abs(got - expected))
        largest = max(largest, float(np.abs(expected).max()))
    assert largest > 0
    return np.array(differences) / largest


RARE = {"background", "leaning quad", "grey image", "coloured images"}
"""Scenes of the slow tests: the others use every feature, too."""


@pytest.mark.parametrize("name", slow_after(6, sorted(scenes(), key=RARE.__contains__)))
def test_every_kind_of_scene_agrees_with_the_estimator(name, precision):
    changes = {"is_texture_packed": False} if "colour" in name else {}
    difference = compare(scenes()[name], ic.eyes.navarro(4.0, 2.0), precision, **changes)
    if precision == "double":
        # The kernel's polynomials place retinal points within 1e-9 mm of the chief-ray map.
        assert difference.max() < 1e-9
    else:
        # A sample within rounding of an edge may fall on its other side: one in 24.
        assert np.quantile(difference, 0.9) < 2e-5
        assert difference.max() < 0.1


def test_packed_texels_are_wrong_by_their_quantisation_only():
    scene = scenes()["coloured images"]
    difference = compare(scene, ic.eyes.navarro(4.0, 2.0), "single", is_texture_packed=True)
    assert np.quantile(difference, 0.95) < 5e-4
    assert np.median(difference) > 1e-6


@pytest.mark.parametrize(
    ("eye", "fov", "centre"),
    [
        (ic.eyes.legrand(3.0), 6.0, (0.0, 0.0)),
        (ic.eyes.arizona(6.0), 6.0, (12.0, -7.0)),
        (ic.eyes.navarro(4.0), 100.0, (0.0, 0.0)),
        (ic.eyes.navarro(8.0), 40.0, (55.0, 0.0)),
        (ic.eyes.navarro(0.1), 1.0, (0.0, 0.0)),
    ],
    ids=["spherical surfaces", "off axis", "wide field", "clipped lens", "pinhole"],
)
def test_every_kind_of_eye_agrees_with_the_estimator(eye, fov, centre, precision):
    scene = ic.Scene(
        (ic.SceneObject("around", ic.Sphere((0.0, 0.0, 0.0), 5.0), ic.Emission(RED)),), None
    )
    difference = compare(scene, eye, precision, fov_deg=fov, centre_deg=centre)
    if precision == "double":
        assert difference.max() < 1e-9
    else:
        assert np.quantile(difference, 0.9) < 1e-4
        assert difference.max() < 0.1


@pytest.mark.parametrize(
    "feature",
    slow_after(1, ["has_far_side", "has_conics", "has_semi_diameters", "has_aspheric_retina"]),
)
def test_a_feature_that_is_compiled_in_but_not_needed_changes_nothing(feature):
    scene = scenes()["two planes"]
    eye = ic.eyes.legrand(3.0)
    films = []
    for value in (False, True):
        prepared = plan(scene, eye, fov_deg=4.0, resolution=32, bands=2, precision="double")
        assert not getattr(prepared.config, feature)
        config = dataclasses.replace(prepared.config, **{feature: value})
        pipeline = DirectPipeline(dataclasses.replace(prepared, config=config))
        films.append(pipeline.sample(Tile(0, 0, 32, 32), 16, 5))
    np.testing.assert_allclose(films[0], films[1], rtol=0, atol=1e-12)


def test_lanes_do_not_change_a_bit(device):
    if not device.is_cpu:
        pytest.skip("vectors wider than one lane are for CPUs")
    films = []
    for width in (1, 16, 64):
        prepared = plan(scenes()["coloured images"], ic.eyes.navarro(), resolution=24, bands=2)
        config = dataclasses.replace(prepared.config, vector_width=width)
        pipeline = DirectPipeline(dataclasses.replace(prepared, config=config))
        films.append(pipeline.sample(Tile(0, 0, 24, 24), 8, 5))
    np.testing.assert_array_equal(films[0], films[1])
    np.testing.assert_array_equal(films[0], films[2])


def test_a_long_sum_is_continued_in_float64():
    prepared = plan(scenes()["two planes"], ic.eyes.navarro(), resolution=8, bands=1)
    pipeline = DirectPipeline(prepared)
    tile = Tile(0, 0, 8, 8)
    whole = pipeline.sample(tile, 640, 3)
    pieces = ((0, 256), (256, 256), (512, 128))
    parts = [pipeline._launch(tile, first, count, 640, 3) for first, count in pieces]
    expected = (2 * parts[0] + 2 * parts[1] + parts[2]) / 5
    np.testing.assert_allclose(whole, expected, rtol=1e-12)


@pytest.mark.slow
def test_of_coincident_shapes_the_first_is_seen(precision):
    first = quad(1.0, 0.1, ic.Emission(RED), "first")
    second = quad(1.0, 0.1, ic.Emission(BLUE), "second")
    for order, expected in (((first, second), RED), ((second, first), BLUE)):
        image = ic.render(
            ic.Scene(order),
            ic.eyes.navarro(),
            fov_deg=1.0,
            resolution=4,
            spp=8,
            precision=precision,
        )
        alone = ic.render(
            ic.Scene(order[:1]),
            ic.eyes.navarro(),
            fov_deg=1.0,
            resolution=4,
            spp=8,
            precision=precision,
        )
        blue, red = image.irradiance.values[[0, -1]].mean(axis=(1, 2))
        assert (red > blue) == (expected is RED)
        np.testing.assert_allclose(image.irradiance, alone.irradiance, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e6])
def test_scaling_a_distant_scene_leaves_directions_alone(scale, precision):
    # A sphere around the eye at any size fills the field: nothing is lost or enlarged.
    scene = ic.Scene(
        (ic.SceneObject("around", ic.Sphere((0.0, 0.0, 0.0), 30.0 * scale), ic.Emission(WHITE)),)
    )
    image = ic.render(
        scene, ic.eyes.navarro(), fov_deg=10.0, resolution=8, spp=16, precision=precision
    )
    background = ic.render(
        ic.Scene((), WHITE),
        ic.eyes.navarro(),
        fov_deg=10.0,
        resolution=8,
        spp=16,
        precision=precision,
    )
    np.testing.assert_allclose(image.irradiance, background.irradiance, rtol=1e-6)


def test_launches_continue_the_sequence():
    from isetcl.render.direct import DirectPipeline, Tile

    pipeline = DirectPipeline(
        ic.plan(
            ic.scenes.two_planes(), ic.eyes.navarro(), resolution=8, bands=2, precision="double"
        )
    )
    tile = Tile(0, 0, 8, 8)
    parts = [pipeline._launch(tile, first, 16, 32, 3) for first in (0, 16)]
    np.testing.assert_allclose(
        pipeline._launch(tile, 0, 32, 32, 3), (parts[0] + parts[1]) / 2, rtol=1e-12
    )


def test_texture_edges_repeat_the_last_texel():
    # Bright left, dark right column: without a repeated border the right edge would be bright.
    texels = np.zeros((4, 4))
    texels[:, 0] = 1.0
    picture = ic.Image(texels)
    scene = ic.scenes.image_plane(picture, 1.0, 4.0)
    image = ic.render(
        scene, ic.eyes.navarro(0.5), fov_deg=4.0, resolution=32, spp=16, wavelengths_nm=[550.0]
    )
    row = image.irradiance.values[0, 16]
    assert row[-3] < 1e-3 * row[3]

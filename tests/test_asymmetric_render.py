"""Pictures through eyes that are no figures of revolution, against rays traced the other way."""

import dataclasses

import numpy as np
import pytest
from test_asymmetric_eyes import bumpy, crooked, ellipsoidal, forced, with_surface

import isetcl as ic
from isetcl.eye import sequential
from isetcl.eye.shapes.zernike_sag import ZernikeSag
from isetcl.eye.throughput import plane_irradiance_per_radiance
from isetcl.render import sobol
from isetcl.render.direct import DirectPipeline, Tile
from isetcl.render.paths import PathPipeline

NM = 550.0
WHITE = ic.Spectrum.equal_energy(1000.0)
QUADS = (((0.003, 0.002, -1.0), 0.002, 0.002), ((-0.006, -0.004, -1.0), 0.0005, 0.008))


def bars(turn_deg=0.0, distance=1.0):
    """Two bright rectangles, turned about the axis."""
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, distance]])
    return ic.Scene(
        tuple(
            ic.SceneObject(
                f"bar {i}",
                ic.Quad(tuple(turn @ corner), tuple(turn @ (w, 0, 0)), tuple(turn @ (0, h, 0))),
                ic.Emission(WHITE),
            )
            for i, (corner, w, h) in enumerate(QUADS)
        )
    )


def image(scene, eye, side, spp, *, fov=1.2, pipeline="auto", precision="double", replicates=4):
    """Irradiance and its standard error, (rows, columns)."""
    plan = ic.plan(
        scene,
        eye,
        fov_deg=fov,
        resolution=side,
        wavelengths_nm=[NM],
        pipeline=pipeline,
        precision=precision,
    )
    working = (DirectPipeline if plan.basis is not None else PathPipeline)(plan)
    films = [
        np.tensordot(
            plan.expansion, working.sample(Tile(0, 0, side, side), spp, sobol.stream(1, i)), axes=1
        )[0]
        for i in range(replicates)
    ]
    return np.mean(films, axis=0), np.std(films, axis=0, ddof=1) / np.sqrt(replicates)


def sent_forwards(eye, side, fov=1.2, rays=200_000):
    """Irradiance of the bars and its standard error, by rays from them through the host's tracer.

    Where a ray lands is asked of the chief-ray map; the area of a pixel is that of its map.
    """
    grid = ic.RetinalGrid.of(eye, fov, side)
    rng = np.random.default_rng(5)
    sums = np.zeros((2, side, side))
    radius = 2.6
    radiance = float(WHITE.at([NM])[0])
    for corner, width, height in QUADS:
        place = np.stack([width * rng.random(rays), height * rng.random(rays), np.zeros(rays)], 1)
        start = 1000.0 * (np.array(corner) + place)
        rho, turn = radius * np.sqrt(rng.random(rays)), 2.0 * np.pi * rng.random(rays)
        through = np.stack([rho * np.cos(turn), rho * np.sin(turn), np.full(rays, -0.5)], axis=1)
        ray = through - start
        distance2 = np.sum(ray**2, axis=1)
        areas = 1e6 * width * height * np.pi * radius**2
        flux = radiance * areas * ray[:, 2] ** 2 / distance2**2 / rays
        traced = sequential.trace(eye, start, ray, NM)
        seen = grid.field_map.field_of_point_deg(traced.positions_mm[traced.passed])
        column = np.floor((seen[:, 0] - grid.left_deg) / grid.pitch_deg[0]).astype(int)
        row = np.floor((grid.top_deg - seen[:, 1]) / grid.pitch_deg[1]).astype(int)
        inside = (np.minimum(row, column) >= 0) & (np.maximum(row, column) < side)
        for power in (1, 2):
            weight = flux[traced.passed][inside] ** power
            np.add.at(sums[power - 1], (row[inside], column[inside]), weight)
    slopes = grid.field_map.slopes_mm_per_deg((0.0, 0.0))
    area = np.linalg.norm(np.cross(*slopes)) * np.prod(grid.pitch_deg)
    return sums[0] / area, np.sqrt(sums[1]) / area


def cone():
    """Navarro's eye with a coma-like cornea."""
    coefficients = (0, 0, 0, 1e-3, 0, 5e-4, 0, 1.5e-3, 1e-3, 0, 0, 0, 5e-4)
    return with_surface(ic.eyes.navarro(3.0), 0, shape=ZernikeSag(coefficients, 3.0))


EYES = {"crooked": crooked, "cone": cone, "ellipsoid": ellipsoidal, "bumpy": bumpy}


@pytest.mark.parametrize(
    ("name", "pipeline"),
    [
        ("crooked", "auto"),
        pytest.param("crooked", "paths", marks=pytest.mark.slow),
        pytest.param("cone", "auto", marks=pytest.mark.slow),
        pytest.param("ellipsoid", "auto", marks=pytest.mark.slow),
        pytest.param("bumpy", "auto", marks=pytest.mark.slow),
        pytest.param("bumpy", "paths", marks=pytest.mark.slow),
    ],
)
def test_the_picture_of_bars_is_what_rays_from_them_make(name, pipeline):
    eye = EYES[name]()
    expected, expected_error = sent_forwards(eye, 10)
    got, error = image(bars(), eye, 10, 1024, pipeline=pipeline)
    lit = expected > 0.02 * expected.max()
    assert lit.sum() > 8
    deviation = (got - expected)[lit] / np.hypot(error, expected_error)[lit]
    # Errors from four replicates have heavy tails, but forward rays bring most of the noise.
    assert np.sqrt(np.mean(deviation**2)) < 1.5
    total = np.hypot(np.linalg.norm(error), np.linalg.norm(expected_error))
    assert abs(np.sum(got - expected)) < 3.0 * total
    assert total < 0.006 * np.sum(expected)


@pytest.mark.parametrize("precision", ["single", pytest.param("double", marks=pytest.mark.slow)])
@pytest.mark.slow
def test_a_figure_of_revolution_gives_the_same_picture_in_two_angles(precision):
    eye = ic.eyes.navarro(3.0)
    one, _ = image(bars(), eye, 16, 256, precision=precision, replicates=2)
    two, _ = image(bars(), forced(eye), 16, 256, precision=precision, replicates=2)
    # The same random numbers; the pupils' ellipses differ by 1e-5.
    assert np.sqrt(np.mean((one - two) ** 2)) < 1e-3 * one.max()
    assert np.sum(two) == pytest.approx(np.sum(one), rel=1e-4)


@pytest.mark.slow
def test_turning_eye_and_scene_by_a_right_angle_turns_the_picture():
    one, one_error = image(bars(), crooked(), 16, 512)
    two, two_error = image(bars(90.0), crooked(90.0), 16, 512)
    # The picture's rows run downwards: anticlockwise is `rot90` by one.
    turned, turned_error = np.rot90(one), np.rot90(one_error)
    lit = turned > 0.02 * turned.max()
    deviation = (two - turned)[lit] / np.hypot(two_error, turned_error)[lit]
    assert np.sqrt(np.mean(deviation**2)) < 3.0
    assert np.sqrt(np.mean((two - turned) ** 2)) < 0.01 * turned.max()
    assert np.sqrt(np.mean((two - one) ** 2)) > 0.05 * turned.max()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "precision"),
    [
        ("bumpy", "single"),
        pytest.param("bumpy", "double", marks=pytest.mark.slow),
        pytest.param("crooked", "single", marks=pytest.mark.slow),
        pytest.param("crooked", "double", marks=pytest.mark.slow),
        pytest.param("ellipsoid", "single", marks=pytest.mark.slow),
    ],
)
def test_uniform_radiance_gives_the_integrated_irradiance_everywhere(name, precision):
    eye = EYES[name]()
    side, fov = 12, 24.0
    got, _ = image(
        ic.scenes.uniform(100.0), eye, side, 512, fov=fov, precision=precision, replicates=4
    )
    x, y = np.meshgrid(*(getattr(ic.RetinalGrid.of(eye, fov, side), f"{a}_deg") for a in "xy"))
    # Pixel means: Gauss's two points a side.
    step = fov / side / np.sqrt(12.0)
    at = np.stack(
        [
            np.stack([x + i * step, y + j * step], axis=-1).reshape(-1, 2)
            for i in (-1, 1)
            for j in (-1, 1)
        ]
    )
    per_radiance = plane_irradiance_per_radiance(
        eye, NM, eye.field_map(NM), at.reshape(-1, 2)
    ).reshape(4, -1)
    radiance = float(ic.Spectrum.equal_energy(100.0).at([NM])[0])
    relative = got.ravel() / (radiance * per_radiance.mean(axis=0)) - 1.0
    assert np.max(np.abs(relative)) < 0.004
    # One ray in some thousand misses the stop by design.
    assert abs(np.mean(relative)) < 1e-4


def test_depth_maps_look_along_the_chief_rays_of_a_decentred_pupil():
    # A quad a little beside the axis, in front of a wall: the chief ray that just meets its edge.
    eye = crooked()
    grid = ic.RetinalGrid.of(eye, 2.0, 64)
    white = ic.Emission(WHITE)
    scene = ic.Scene(
        (
            ic.SceneObject("near", ic.Quad((0.0, -0.01, -0.1), (0.01, 0, 0), (0, 0.02, 0)), white),
            ic.SceneObject("wall", ic.Quad((-1, -1, -2.0), (2, 0, 0), (0, 2, 0)), white),
        )
    )
    from isetcl.retina.depth import vergence_map

    seen = vergence_map(scene, grid)
    edge = grid.x_deg[np.argmax(seen[32] > 5.0)] - grid.pitch_deg[0] / 2.0
    entrance = grid.field_map.entrance_mm(np.array(edge), np.array(grid.y_deg[32]))
    # From the entrance pupil, 0.3 mm to the right, the edge at x = 0 lies to the left.
    expected = np.degrees(np.arctan2(-entrance[0], 100.0 + entrance[2]))
    assert edge == pytest.approx(expected, abs=grid.pitch_deg[0])
    assert edge < -0.1


@pytest.mark.slow
def test_the_baseline_and_the_renderer_agree_on_an_astigmatic_eye():
    eye = crooked()
    options = {"fov_deg": 1.2, "resolution": 24, "wavelengths_nm": [NM]}
    baseline = ic.psf_baseline.render(bars(), eye, oversampling=4, **options)
    expected = baseline.irradiance.values[0]
    got, error = image(bars(), eye, 24, 512)
    # The baseline blurs with the PSF of the middle of the field.
    assert np.sqrt(np.mean((got - expected) ** 2)) < 0.006 * expected.max()
    assert np.sqrt(np.mean(error**2)) < 0.004 * expected.max()


def test_a_plan_says_what_is_not_round():
    eye = dataclasses.replace(crooked(), retina=bumpy().retina)
    text = ic.plan(bars(), eye, fov_deg=1.0, resolution=8, wavelengths_nm=[NM]).explain()
    assert "cornea front, lens front, lens back, stop, retina" in text
    assert "a height map lies on the retina" in text

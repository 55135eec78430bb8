"""Independent random samples, the sampler of references: even, independent, and unbiased."""

import numpy as np
import pytest
from scipy import stats

import isetcl as ic
from isetcl.device import program
from isetcl.device.planes import run_on_planes
from isetcl.render import pack
from isetcl.render.kernel_config import KernelConfig


@pytest.fixture(scope="module")
def numbers(device):
    """Numbers (dimension, sample, stream) of 8 dimensions, 64 samples and 256 streams."""
    config = KernelConfig("single", 16, n_basis=3, sampler="random")
    source = program.assemble("sequence.cl", config.defines(device), pack.declarations(config))
    streams, samples = np.arange(256.0), 64
    return np.array(
        [
            run_on_planes(
                device, "single", source, "sobol_points", streams, samples,
                np.int32(samples), np.int32(dimension), width=16,
            )
            for dimension in range(8)
        ]
    )  # fmt: skip


def test_random_numbers_are_even(numbers):
    # Chi-square over 256 cells of 131072 numbers: a cell that has 8 % more is found.
    for own in numbers:
        counts = np.histogram(own, 256, (0.0, 1.0))[0]
        assert stats.chisquare(counts).pvalue > 1e-4
    assert numbers.min() >= 0.0
    assert numbers.max() < 1.0


def test_random_numbers_of_samples_streams_and_dimensions_are_independent(numbers):
    # Pairs fill 32 x 32 cells as evenly as chance; standard normal correlations stay below 4.5.
    pairs = {
        "samples": (numbers[:, :-1], numbers[:, 1:]),
        "streams": (numbers[:, :, :-1], numbers[:, :, 1:]),
        "dimensions": (numbers[:-1], numbers[1:]),
    }
    for one, other in pairs.values():
        x, y = one.ravel(), other.ravel()
        counts = np.histogram2d(x, y, 32, ((0, 1), (0, 1)))[0]
        assert stats.chisquare(counts.ravel()).pvalue > 1e-4
        assert abs(np.corrcoef(x, y)[0, 1]) * np.sqrt(x.size) < 4.5
    assert len(np.unique(numbers)) > 0.98 * numbers.size * (1 - numbers.size / 2**25)


WHERE = {
    "fov_deg": 2.0,
    "resolution": 16,
    "wavelengths_nm": np.array([550.0]),
    "progress": False,
}


@pytest.mark.slow
def test_random_samples_make_the_same_image_and_more_noise():
    scene, eye = ic.scenes.two_planes(), ic.eyes.navarro(4.0, 2.0)
    sobol, few, many = (
        ic.render(scene, eye, spp=spp, seed=seed, sampler=sampler, **WHERE)
        for spp, seed, sampler in ((1024, 1, "sobol"), (256, 2, "random"), (4096, 3, "random"))
    )
    # N^-1/2: sixteen times the samples, a quarter of the error; each is known to 5 %.
    assert few.relative_error / many.relative_error == pytest.approx(4.0, rel=0.15)
    assert sobol.relative_error < 0.6 * 0.5 * few.relative_error
    assert many.provenance["sampler"] == "random"
    assert sobol.provenance["sampler"] == "sobol"
    one, other = sobol.brightness(), many.brightness()
    z = (one[0].mean() - other[0].mean()) * 16 / np.sqrt(np.mean(one[1] ** 2 + other[1] ** 2))
    # Detects a bias of 0.15 % with 80 %.
    assert abs(z) < 4.0


@pytest.mark.slow
def test_the_reported_error_of_random_samples_is_true():
    scene, eye = ic.scenes.two_planes(), ic.eyes.navarro(4.0, 2.0)
    images = [
        ic.render(scene, eye, spp=64, seed=seed, sampler="random", **WHERE) for seed in range(16)
    ]
    spread = np.var([i.brightness()[0] for i in images], axis=0, ddof=1).mean()
    reported = np.mean([i.brightness()[1] ** 2 for i in images])
    # 256 pixels of 15 degrees of freedom: known to 2.3 %.
    assert spread / reported == pytest.approx(1.0, abs=0.1)


def test_the_plan_tells_of_random_samples():
    scene, eye = ic.scenes.two_planes(), ic.eyes.navarro(4.0)
    assert "random" in ic.plan(scene, eye, sampler="random").explain()
    with pytest.raises(ic.InvalidInputError, match="sampler"):
        ic.plan(scene, eye, sampler="halton")


@pytest.mark.slow
def test_paths_take_random_samples_too(few_lanes):
    scene = ic.Scene(
        objects=(
            ic.SceneObject(
                "wall",
                ic.Quad((-1.0, -1.0, -1.0), (2.0, 0, 0), (0, 2.0, 0)),
                ic.Diffuse(ic.Spectrum.constant(0.5)),
            ),
            ic.SceneObject(
                "lamp",
                ic.Disc((0, 0.8, -0.6), 0.2, (0, -1, 0)),
                ic.Emission(ic.Spectrum.illuminant("E", 1000.0)),
            ),
        )
    )
    eye = ic.eyes.navarro(4.0, 1.0)
    options = WHERE | {"resolution": 8, "fov_deg": 10.0, "spp": 512}
    one, other = (
        ic.render(scene, eye, seed=seed, sampler=sampler, **options)
        for seed, sampler in ((1, "sobol"), (2, "random"))
    )
    assert other.relative_error > 1.2 * one.relative_error
    errors = one.brightness()[1], other.brightness()[1]
    off = one.brightness()[0].mean() - other.brightness()[0].mean()
    assert abs(off) * 8 / np.sqrt(np.mean(errors[0] ** 2 + errors[1] ** 2)) < 4.0

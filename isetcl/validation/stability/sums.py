"""Cases 53 to 58: sums of many samples, and the numbers that they are made of."""

from __future__ import annotations

import functools
import itertools
import math

import numpy as np

from isetcl.device import program
from isetcl.device.planes import run_on_planes
from isetcl.eye import catalog
from isetcl.render import pack, sobol
from isetcl.render.accumulate import TileAccumulator
from isetcl.render.direct import SAMPLES_PER_LAUNCH, DirectPipeline
from isetcl.render.kernel_config import KernelConfig
from isetcl.render.plan import plan
from isetcl.scene.material import Emission
from isetcl.scene.model import Quad, Scene, SceneObject, Sphere
from isetcl.spectrum import Spectrum
from isetcl.validation.stability.case import Bench, case

UNIT = Spectrum.constant(1.0)
LIGHT = Emission(UNIT)
# Every scene has a flat shape and a ball, so that all share one kernel.
_BEHIND = (
    SceneObject("flat behind", Quad((0, 0, 2e3), (1, 0, 0), (0, 1, 0)), LIGHT),
    SceneObject("ball behind", Sphere((0.0, 0.0, 3e3), 1.0), LIGHT),
)


def film(
    bench: Bench,
    objects: tuple[SceneObject, ...] = (),
    background: Spectrum | None = None,
    *,
    samples: int = 16,
    stream: int = 1,
    stop_mm: float = 4.0,
    fov_deg: float = 10.0,
    resolution: int = 16,
) -> np.ndarray:
    """The mean film at 550 nm of what a scene sends into Navarro's eye, (rows, columns)."""
    scene = Scene((*objects, *_BEHIND), background)
    prepared = plan(
        scene,
        catalog.navarro(stop_mm),
        fov_deg=fov_deg,
        resolution=resolution,
        wavelengths_nm=np.array([550.0]),
        bands=1,
        precision=bench.precision,
        device=bench.device.index,
    )
    pipeline = DirectPipeline(prepared)
    (tile,) = pipeline.tiles()
    sampled = pipeline.sample(tile, samples, sobol.stream(0, stream))
    return np.tensordot(prepared.expansion, sampled, axes=1)[0]


@case(53, "2^26 samples of 1 in one pixel", "1 exactly", "of the sum", single=0.0, double=0.0)
def _many_ones(bench: Bench) -> float:
    sums = TileAccumulator(np.eye(1))
    ones = np.ones((1, 1, 1))
    for _ in range(1 << 12):
        # A replicate of 2^14 samples, launch by launch as the pipelines add them up.
        total, launches = np.zeros((1, 1, 1)), (1 << 14) // SAMPLES_PER_LAUNCH
        for _ in range(launches):
            total += ones * (SAMPLES_PER_LAUNCH / (1 << 14))
        sums.add(total, 1 << 14)
    assert sums.samples == 1 << 26
    return abs(float(sums.film()[0, 0, 0]) - 1.0)


@case(54, "1e9 samples; the longest sum in a kernel's own precision",
      "within 1e-9 of the sum; rounding below 2e-5", "of these limits",
      single=1.0, double=1.0)  # fmt: skip
def _billion(bench: Bench) -> tuple[float, str]:
    sums = TileAccumulator(np.eye(1))
    count = 100_000 if bench.full else 2_000
    size = 1_000_000_000 // count
    values = 0.1 + 0.05 * np.sin(np.arange(count))
    for value in values:
        sums.add(np.full((1, 1, 1), value), size)
    exact = math.fsum(values * size) / (count * size)
    long = abs(float(sums.film()[0, 0, 0]) / exact - 1.0)
    # Adding n numbers of one sign errs by n - 1 roundings at most (Higham 2002, section 4.2).
    launch = SAMPLES_PER_LAUNCH * bench.epsilon / 2.0
    note = f"{long:.1g} over 1e9 samples; {SAMPLES_PER_LAUNCH} in a launch, {launch:.1g} at most"
    return max(long / 1e-9, launch / 2e-5), note


@case(55, "five replicates added in any order", "the same; of float64 kernels within rounding",
      "spacings of float64", single=0, double=8)  # fmt: skip
def _merged(bench: Bench) -> float:
    # Two sums of n numbers of one sign are 2 (n - 1) spacings apart at most (Higham 2002, section
    # 4.2). Those of float32 kernels have so many bits to spare that nothing is rounded.
    ball = (SceneObject("ball", Sphere((0.0, 0.0, -1.0), 0.05), LIGHT),)
    parts = [film(bench, ball, stream=s)[None] for s in range(1, 6)]
    if np.any(film(bench, ball, stream=1) != parts[0][0]):
        return math.inf
    films = []
    for order in itertools.permutations(parts):
        sums = TileAccumulator(np.eye(1))
        for part in order:
            sums.add(part, 16)
        films.append(sums.film())
    apart = np.ptp(films, axis=0)
    return float(np.max(apart / np.spacing(films[0])))


@functools.cache
def _sequence_source(bench: Bench) -> str:
    config = KernelConfig(bench.precision, bench.device.vector_width(bench.precision), n_basis=1)
    defines, declarations = config.defines(bench.device), pack.declarations(config)
    return program.assemble("sequence.cl", defines, declarations)


def _points(bench: Bench, streams: np.ndarray, samples: int, dimension: int) -> np.ndarray:
    """Coordinates (samples, streams)."""
    return run_on_planes(
        bench.device,
        bench.precision,
        _sequence_source(bench),
        "sobol_points",
        streams,
        samples,
        np.int32(samples),
        np.int32(dimension),
    )


@case(56, "random numbers", "0 <= u <= 1 - 2^-24 and as often in every 64th", "numbers wrong",
      single=0, double=0)  # fmt: skip
def _below_one(bench: Bench) -> tuple[int, str]:
    values = _points(bench, np.arange(4096.0), 256, 1)
    largest = float(values.max())
    limit = 1.0 - 2.0**-24 if bench.precision == "single" else 1.0 - 2.0**-31
    wrong = int(np.sum(~((values >= 0) & (values <= limit))))
    for one in values.T[:64]:
        wrong += int(np.sum(np.bincount((one * 64).astype(int), minlength=64) != 4))
    return wrong, f"largest 1 - {1.0 - largest:.1g} of {values.size}"


@case(57, "elementary intervals to 2^10; the middle of the disc map", "filled alike; no NaN",
      "boxes wrong", single=0, double=0)  # fmt: skip
def _elementary(bench: Bench) -> int:
    wrong = 0
    for log2 in (3, 6, 10):
        count = 1 << log2
        x, y = (_points(bench, np.array([5.0, 77.0]), count, d) for d in (0, 1))
        for k in range(log2 + 1):
            columns, rows = 1 << k, 1 << (log2 - k)
            box = np.floor(x * columns).astype(int) * rows + np.floor(y * rows).astype(int)
            for stream in box.T:
                wrong += int(np.sum(np.bincount(stream, minlength=count) != 1))
    places = np.array([[0.5, 0.5, 0.0, 1.0 - 2.0**-24, 0.5], [0.5, 0.0, 0.0, 0.5, 1.0 - 2.0**-24]])
    disc = run_on_planes(
        bench.device, bench.precision, _sequence_source(bench), "disc_points", places, 2
    )
    wrong += int(np.sum(~np.isfinite(disc))) + int(np.any(disc[:, 0] != 0.0))
    return wrong + int(np.sum(np.hypot(*disc) > 1.0 + 4.0 * bench.epsilon))


@case(58, "a furnace: the same radiance everywhere, pupils of 0.5 to 8 mm",
      "a shell around the eye is as bright as the background", "of the irradiance",
      single=1e-6, double=1e-12)  # fmt: skip
def _furnace(bench: Bench) -> float:
    shell = (SceneObject("shell", Sphere((0.0, 0.0, 0.0), 30.0), LIGHT),)
    worst = 0.0
    for stop in (0.5, 2.0, 8.0):
        even = film(bench, background=UNIT, stop_mm=stop)
        around = film(bench, shell, stop_mm=stop)
        worst = max(worst, float(np.max(np.abs(around / even - 1.0))))
    return worst

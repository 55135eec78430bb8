"""Rendering a scene onto a retina: `isetcl.render`."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import Any, Literal

import numpy as np

from isetcl.device.layout import Precision
from isetcl.errors import InvalidInputError, check_count, check_positive
from isetcl.eye.model import Eye
from isetcl.render import schedule, sobol
from isetcl.render.accumulate import TileAccumulator
from isetcl.render.direct import DirectPipeline, tiles
from isetcl.render.plan import Plan, check_memory, plan
from isetcl.render.progress import Progress, ProgressCallback, display
from isetcl.retina.depth import vergence_map
from isetcl.retina.image import RetinalImage, relative_error
from isetcl.scene.model import Scene
from isetcl.spectrum import photopic_weights
from isetcl.version import __version__

DEFAULT_SPP = 256
MAX_SPP = 1 << 22


def render(
    scene: Scene,
    eye: Eye,
    *,
    fov_deg: float | tuple[float, float] = 10.0,
    resolution: int | tuple[int, int] = 256,
    centre_deg: tuple[float, float] = (0.0, 0.0),
    spp: int | None = None,
    time_budget_s: float | None = None,
    target_error: float | None = None,
    wavelengths_nm: np.ndarray | None = None,
    bands: int | Literal["auto"] = "auto",
    precision: Precision | Literal["auto"] = "auto",
    seed: int = 0,
    device: str | None = None,
    progress: bool | ProgressCallback | None = None,
) -> RetinalImage:
    """The retinal image of a scene by ray tracing, in absolute units, with its standard error.

    Rays start on the retina, pass the eye and meet the scene. The image is the same, bit for bit,
    whatever the tiles, threads or launches.

    Parameters
    ----------
    scene, eye
        What is seen, and by which eye (at the origin, looking along -z).
    fov_deg
        Field of view in degrees: the width (pixels are square), or (width, height).
    resolution
        Pixels: a number for a square, or (columns, rows).
    centre_deg
        Field angles (x, y) of the middle of the image.
    spp
        Samples a pixel and band, at least 2. Default 256 if neither of the next two is given.
    time_budget_s
        Stop after about so many seconds, preparation included.
    target_error
        Stop when the relative standard error of the image has fallen to this: photopic, root mean
        square over lit pixels divided by their mean.
    wavelengths_nm
        Ascending wavelengths; default 400 to 700 in steps of 10 nm.
    bands
        Lens traces for all wavelengths; ``"auto"`` chooses from dispersion and pixel size.
    precision
        ``"single"``, ``"double"`` or ``"auto"``.
    seed
        Images of different seeds are independent.
    device
        See `find_device`.
    progress
        True shows a bar, False none, None a bar on a terminal; or a function of `Progress`.

    Returns
    -------
    RetinalImage
        Interrupted by Ctrl-C, what was finished, with its error; provenance says ``complete``.

    Raises
    ------
    InvalidInputError, DeviceError, OutOfMemoryError
        Before any work starts.
    KeyboardInterrupt
        If interrupted before there is anything to return.
    """
    start = time.perf_counter()
    goal = _Goal(spp, time_budget_s, target_error, start)
    seed = check_count("seed", seed, 0, (1 << 63) - 1)
    prepared = plan(
        scene,
        eye,
        fov_deg=fov_deg,
        resolution=resolution,
        centre_deg=centre_deg,
        wavelengths_nm=wavelengths_nm,
        bands=bands,
        precision=precision,
        expected_error=goal.expected_error(),
        device=device,
    )
    check_memory(prepared)
    pipeline = DirectPipeline(prepared)
    film = _Film(prepared, pipeline, seed)
    is_complete = True
    with display(progress, f"tracing {scene.name}") as show:
        try:
            for fraction in goal.work(film):
                show(Progress(fraction, film.error(), time.perf_counter() - start))
        except KeyboardInterrupt:
            if film.replicates < 2:
                raise
            is_complete = False
    return film.image(
        {
            "is_complete": is_complete,
            "elapsed_s": time.perf_counter() - start,
            "kernel": pipeline.kernel_digest,
        }
    )


class _Film:
    """The accumulators of all tiles, and the image they make."""

    def __init__(self, prepared: Plan, pipeline: DirectPipeline, seed: int) -> None:
        self._plan = prepared
        self._pipeline = pipeline
        self._seed = seed
        self._tiles = tiles(prepared)
        expansion = prepared.expansion
        weights = photopic_weights(prepared.wavelengths_nm)
        if not np.any(weights > 0):
            weights = np.ones(len(weights))
        rows = np.eye(expansion.shape[1]) if prepared.config.n_basis == 1 else expansion
        self._tracked = np.vstack([rows, weights @ expansion])
        self._next_replicate = 0
        self.clear()

    def clear(self) -> None:
        """Forget all samples; replicates to come are new ones."""
        self._accumulators = [TileAccumulator(self._tracked) for _ in self._tiles]

    @property
    def replicates(self) -> int:
        """Replicates that all tiles have."""
        return min(a.replicates for a in self._accumulators)

    @property
    def samples(self) -> int:
        """Samples a pixel and band that all tiles have."""
        return min(a.samples for a in self._accumulators)

    def add_replicate(self, samples: int) -> Iterator[float]:
        """Add a replicate to all tiles; yields the fraction done after each tile."""
        stream = sobol.stream(self._seed, self._next_replicate)
        self._next_replicate += 1
        for i, (tile, accumulator) in enumerate(zip(self._tiles, self._accumulators, strict=True)):
            accumulator.add(self._pipeline.sample(tile, samples, stream), samples)
            yield (i + 1) / len(self._tiles)

    def seconds_per_sample(self) -> float:
        """Time of one sample a pixel over the whole image, from one small launch."""
        tile = self._tiles[0]
        self._pipeline.sample(tile, 1, 0)
        start = time.perf_counter()
        self._pipeline.sample(tile, 4, 0)
        elapsed = (time.perf_counter() - start) / 4
        columns, rows = self._plan.grid.resolution
        return elapsed * columns * rows / (tile.columns * tile.rows)

    def error(self) -> float:
        """Relative standard error of the image so far; NaN before two replicates."""
        if self.replicates < 2:
            return math.nan
        values, errors = [], []
        for accumulator in self._accumulators:
            values.append(np.tensordot(self._tracked[-1], accumulator.film(), axes=1).ravel())
            errors.append(accumulator.standard_error()[-1].ravel())
        return relative_error(np.concatenate(values), np.concatenate(errors))

    def image(self, details: dict[str, Any]) -> RetinalImage:
        """The image with its standard error, in the plan's precision."""
        prepared = self._plan
        dtype = np.float32 if prepared.config.precision == "single" else np.float64
        shape = (len(prepared.wavelengths_nm), *prepared.grid.shape)
        irradiance = np.empty(shape, dtype=dtype)
        standard_error = np.empty(shape, dtype=dtype)
        photopic_error = np.empty(prepared.grid.shape, dtype=dtype)
        for tile, accumulator in zip(self._tiles, self._accumulators, strict=True):
            window = (slice(None), *tile.window)
            irradiance[window] = np.tensordot(prepared.expansion, accumulator.film(), axes=1)
            error = accumulator.standard_error()
            photopic_error[tile.window] = error[-1]
            if prepared.config.n_basis == 1:
                # One film channel a wavelength: its error scales with the spectrum.
                standard_error[window] = np.tensordot(prepared.expansion, error[:-1], axes=1)
            else:
                standard_error[window] = error[:-1]
        return RetinalImage.from_arrays(
            prepared.grid,
            prepared.wavelengths_nm,
            irradiance,
            standard_error=standard_error,
            illuminance_standard_error=photopic_error,
            vergence_dpt=vergence_map(prepared.scene, prepared.grid),
            provenance=self._provenance() | details,
        )

    def _provenance(self) -> dict[str, Any]:
        prepared = self._plan
        return {
            "method": "ray tracing",
            "version": __version__,
            "scene": prepared.scene.name,
            "scene_digest": prepared.scene.digest(),
            "seed": self._seed,
            "samples_per_pixel": self.samples,
            "replicates": self.replicates,
            "bands_nm": [band.wavelength_nm for band in prepared.band_choice.bands],
            "precision": prepared.config.precision,
            "tile": list(prepared.tile),
            **prepared.device.describe(),
        }


class _Goal:
    """When a render is done: after a number of samples, a time, or at an error."""

    def __init__(
        self,
        spp: int | None,
        time_budget_s: float | None,
        target_error: float | None,
        start: float,
    ) -> None:
        if spp is not None and (time_budget_s is not None or target_error is not None):
            raise InvalidInputError(
                "give spp, or time_budget_s and target_error, not both: "
                f"got spp={spp}, time_budget_s={time_budget_s}, target_error={target_error}"
            )
        if spp is None and time_budget_s is None and target_error is None:
            spp = DEFAULT_SPP
        self._spp = None if spp is None else check_count("spp", spp, 2, MAX_SPP)
        self._deadline = math.inf
        if time_budget_s is not None:
            self._deadline = start + check_positive("time_budget_s", time_budget_s, "s")
        self._target = 0.0
        if target_error is not None:
            self._target = check_positive("target_error", target_error)

    def expected_error(self) -> float:
        """The relative error to expect, for decisions that trade it against speed."""
        if self._target > 0:
            return self._target
        # 64 samples leave about 3 % on a checkerboard with edges; the error falls as N^-0.6.
        return 0.03 * (64.0 / self._spp) ** 0.6 if self._spp else 1e-3

    def work(self, film: _Film) -> Iterator[float]:
        """Add replicates until the goal is met; yields the fraction done."""
        if self._spp is not None:
            done = 0
            for size in schedule.split(self._spp):
                for part in film.add_replicate(size):
                    yield (done + part * size) / self._spp
                done += size
            return
        size = schedule.MIN_REPLICATE_SPP
        if self._deadline < math.inf:
            remaining = self._deadline - time.perf_counter()
            affordable = remaining / max(film.seconds_per_sample(), 1e-9)
            size = max(1, min(size, int(affordable / (schedule.PILOT_REPLICATES + 0.5))))
        for i in range(schedule.PILOT_REPLICATES):
            for part in film.add_replicate(size):
                yield 0.05 * (i + part) / schedule.PILOT_REPLICATES
        yield from self._continue(film, size)

    def _continue(self, film: _Film, size: int) -> Iterator[float]:
        """Go on after the pilot, with longer replicates if many samples are needed."""
        pilot_error = film.error()
        if pilot_error <= self._target or size < schedule.MIN_REPLICATE_SPP:
            return
        per_sample = film.seconds_per_sample()
        needed = float(MAX_SPP)
        if self._target > 0:
            needed = schedule.samples_for_error(film.samples, pilot_error, self._target)
        if self._deadline < math.inf:
            remaining = self._deadline - time.perf_counter()
            needed = min(needed, film.samples + remaining / per_sample)
        longer = min(schedule.replicate_size_for(needed), MAX_SPP // schedule.MAX_REPLICATES)
        if longer > size * schedule.PILOT_REPLICATES:
            # Equal replicates make the standard error exact; the pilot is a small part of the work.
            film.clear()
            size = longer
        while not self._is_done(film, size * per_sample):
            before = film.samples
            for part in film.add_replicate(size):
                yield min(0.99, (before + part * size) / max(needed, 1.0))

    def _is_done(self, film: _Film, replicate_s: float) -> bool:
        if film.samples >= MAX_SPP:
            return True
        if film.replicates < schedule.PILOT_REPLICATES:
            return False
        if time.perf_counter() + replicate_s > self._deadline:
            return True
        return film.error() <= self._target

"""What is known of an image while it is rendered: sums of all tiles, and the image they make."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from isetcl.device.layout import real_dtype
from isetcl.render import sobol
from isetcl.render.accumulate import TileAccumulator
from isetcl.render.direct import DirectPipeline, tiles
from isetcl.render.noise_goal import NoiseGoal
from isetcl.render.paths import PathPipeline
from isetcl.render.plan import Plan
from isetcl.retina.depth import vergence_map
from isetcl.retina.image import RetinalImage, relative_error
from isetcl.retina.places import IrradianceAtPlaces, PlaceGrid
from isetcl.spectrum import photopic_weights
from isetcl.version import __version__

_TIMED_TILES = 5


class Film:
    """The accumulators of all tiles, and the image they make."""

    def __init__(
        self,
        prepared: Plan,
        pipeline: DirectPipeline | PathPipeline,
        seed: int,
        noise: NoiseGoal | None = None,
    ) -> None:
        has_places = prepared.config.places != "none"
        self._keeps = real_dtype(prepared.config.precision) if has_places else None
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
        self._photopic = len(self._tracked) - 1
        self._noise = noise
        if noise is not None:
            self._tracked = np.vstack([self._tracked, noise.rows])
        self._next_replicate = 0
        self._accumulators = self._empty()
        self._pilot: list[TileAccumulator] | None = None
        self._error, self._error_at = math.nan, 0
        self._paces: list[float] = []

    def _empty(self) -> list[TileAccumulator]:
        own = None if self._noise is None else self._noise.receptors
        return [
            TileAccumulator(
                self._tracked,
                local=None if own is None else own.weights[:, tile.window[0], tile.window[1]],
                keeps=self._keeps,
            )
            for tile in self._tiles
        ]

    def restart(self) -> None:
        """Begin anew with other replicates; the old ones are kept until two new are finished."""
        self._pilot, self._accumulators = self._accumulators, self._empty()
        self._error, self._error_at = math.nan, 0

    def keep_finished(self) -> bool:
        """Settle for what is finished, if that is enough for an error."""
        if self.replicates < 2 and self._pilot is not None:
            self._accumulators, self._pilot = self._pilot, None
        return self.replicates >= 2

    @property
    def replicates(self) -> int:
        """Replicates that all tiles have."""
        return min(a.replicates for a in self._accumulators)

    @property
    def samples(self) -> int:
        """Samples a pixel and band that all tiles have."""
        return min(a.samples for a in self._accumulators)

    @property
    def pixels(self) -> int:
        """Pixels of the image."""
        return math.prod(self._plan.grid.shape)

    @property
    def is_dark(self) -> bool:
        """Whether the scene sends out light of which no sample has found any."""
        return self._plan.has_light and not any(a.film().any() for a in self._accumulators)

    def add_replicate(self, samples: int) -> Iterator[float]:
        """Add a replicate to all tiles; yields the fraction done after each launch."""
        stream = sobol.stream(self._seed, self._next_replicate)
        self._next_replicate += 1
        total = samples * len(self._tiles)
        elapsed = 0.0
        for i, (tile, accumulator) in enumerate(zip(self._tiles, self._accumulators, strict=True)):
            film: np.ndarray | float = 0.0
            done = 0
            since = time.perf_counter()
            for part, count in self._pipeline.parts(tile, samples, stream):
                film = film + part * (count / samples)
                done += count
                if done < samples:
                    elapsed += time.perf_counter() - since
                    yield (i * samples + done) / total
                    since = time.perf_counter()
            assert isinstance(film, np.ndarray)
            accumulator.add(film, samples)
            elapsed += time.perf_counter() - since
            yield (i + 1) * samples / total
        self._paces.append(elapsed / samples)
        if self.replicates >= 2:
            self._pilot = None

    def seconds_per_sample(self) -> float:
        """Time of one sample a pixel over the whole image.

        That of the faster of the last two replicates, since drivers may still have compiled in the
        first; before there are any, from small launches in a few tiles of all parts of the image.
        """
        if self._paces:
            return min(self._paces[-2:])
        chosen = self._tiles[:: -(-len(self._tiles) // _TIMED_TILES)]
        elapsed = 0.0
        for tile in chosen:
            # Some drivers compile anew for launches of another size.
            self._pipeline.sample(tile, 4, 0)
            start = time.perf_counter()
            self._pipeline.sample(tile, 4, 0)
            elapsed += (time.perf_counter() - start) / 4
        return elapsed * self.pixels / sum(tile.columns * tile.rows for tile in chosen)

    def error(self) -> float:
        """Error after the last whole replicate; NaN before two of them.

        The relative standard error, or, with a `NoiseGoal`, the error in its units.
        """
        if self._error_at != self.replicates:
            self._error_at = self.replicates
            self._error = self._relative_error() if self.replicates >= 2 else math.nan
        return self._error

    def _relative_error(self) -> float:
        if self._noise is not None and self._noise.receptors is not None:
            return self._noise.goal.error(*self._by_type(self._noise.receptors.types))
        if self._noise is not None:
            return self._noise.goal.error(*self._known(slice(self._photopic + 1, None)))
        value, error = self._known(slice(self._photopic, self._photopic + 1))
        return relative_error(value[0], error[0])

    def _by_type(self, types: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Excitations of the receptors of each type and their standard errors."""
        means, errors = np.empty(types.shape), np.empty(types.shape)
        for tile, accumulator in zip(self._tiles, self._accumulators, strict=True):
            means[tile.window] = accumulator.local()
            errors[tile.window] = accumulator.standard_error()[-1]
        kinds = [types == kind for kind in np.unique(types[types >= 0])]
        return [means[kind] for kind in kinds], [errors[kind] for kind in kinds]

    def _known(self, quantities: slice) -> tuple[np.ndarray, np.ndarray]:
        """Tracked quantities of all pixels and their standard errors, both (quantities, pixels)."""
        values, errors = [], []
        for accumulator in self._accumulators:
            tracked = self._tracked[quantities]
            value = np.tensordot(tracked, accumulator.film(), axes=1)
            values.append(value.reshape(len(tracked), -1))
            errors.append(accumulator.standard_error()[quantities].reshape(len(tracked), -1))
        return np.concatenate(values, axis=1), np.concatenate(errors, axis=1)

    def image(
        self, details: dict[str, Any], surfaces: dict[str, Any] | None = None
    ) -> RetinalImage:
        """The image with its standard error, in the plan's precision.

        Parameters
        ----------
        details
            More for the provenance.
        surfaces
            Variables that say what the pixels look at; None finds vergences on the host.
        """
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
            photopic_error[tile.window] = error[self._photopic]
            if prepared.config.n_basis == 1:
                # One film channel a wavelength: its error scales with the spectrum.
                standard_error[window] = np.tensordot(
                    prepared.expansion, error[: self._photopic], axes=1
                )
            else:
                standard_error[window] = error[: self._photopic]
        return RetinalImage.from_arrays(
            prepared.grid,
            prepared.wavelengths_nm,
            irradiance,
            standard_error=standard_error,
            illuminance_standard_error=photopic_error,
            vergence_dpt=(
                vergence_map(prepared.scene, prepared.grid) if surfaces is None else None
            ),
            surfaces=surfaces,
            provenance=self._provenance() | details,
        )

    def at_places(self, details: dict[str, Any]) -> IrradianceAtPlaces:
        """The irradiance at the places of a plan that has them, in the plan's precision."""
        prepared = self._plan
        grid = prepared.grid
        assert isinstance(grid, PlaceGrid)
        dtype = real_dtype(prepared.config.precision)
        waves, n = len(prepared.wavelengths_nm), len(grid.listed)
        samples = np.array([count for _, count in self._accumulators[0].kept[: self.replicates]])
        values = np.empty((self.replicates, waves, *grid.shape), dtype=dtype)
        for tile, accumulator in zip(self._tiles, self._accumulators, strict=True):
            for number, (film, _) in enumerate(accumulator.kept[: self.replicates]):
                window = (number, slice(None), *tile.window)
                values[window] = np.tensordot(prepared.expansion, film, axes=1)
        return IrradianceAtPlaces.from_replicates(
            grid.listed,
            prepared.wavelengths_nm,
            values.reshape(self.replicates, waves, -1)[..., :n].copy(),
            samples,
            {"eye": prepared.eye.describe()} | self._provenance() | details,
        )

    def _provenance(self) -> dict[str, Any]:
        prepared = self._plan
        return {
            "method": "ray tracing",
            "version": __version__,
            "scene": prepared.scene.name,
            "scene_digest": prepared.scene.digest(),
            "object_names": [item.name for item in prepared.scene.objects],
            "seed": self._seed,
            "samples_per_pixel": self.samples,
            "replicates": self.replicates,
            "chromatic_displacement_pixels": prepared.band_choice.displacement_pixels,
            "bands_nm": [band.wavelength_nm for band in prepared.band_choice.bands],
            "precision": prepared.config.precision,
            "sampler": prepared.config.sampler,
            "tile": list(prepared.tile),
            **self._cone_noise_reached(),
            **prepared.bends.describe(),
            "media": None if prepared.media is None else prepared.media.describe(),
            **prepared.device.describe(),
        }

    def _cone_noise_reached(self) -> dict[str, Any]:
        return {} if self._noise is None else {"cone_noise": self._noise.describe(self.error())}

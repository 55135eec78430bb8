"""Sums over replicates: the image, and how sure it is.

A replicate is an independently scrambled copy of the whole sampling; the spread of replicate means
is the only honest measure of the error of quasi-random samples. Sums are float64.
"""

from __future__ import annotations

import numpy as np


class TileAccumulator:
    """Replicates of one tile.

    Parameters
    ----------
    tracked : ndarray, (quantities, channels)
        Linear combinations of film channels whose standard error is wanted.
    local : ndarray or None, (channels, rows, columns)
        One more combination, of each pixel's own, whose standard error is wanted.
    keeps : dtype or None
        As what the film of every replicate is kept in `kept`; None forgets it.
    """

    def __init__(
        self,
        tracked: np.ndarray,
        *,
        local: np.ndarray | None = None,
        keeps: np.dtype | None = None,
    ) -> None:
        self._keeps, self._local = keeps, local
        self.kept: list[tuple[np.ndarray, int]] = []
        self._tracked = tracked
        self._sum: np.ndarray | None = None
        self._samples = 0
        self._replicates = 0
        # Squares are summed about the first replicate, so that they do not cancel.
        self._pivot: np.ndarray | None = None
        self._squares: np.ndarray | None = None

    @property
    def replicates(self) -> int:
        """Replicates added so far."""
        return self._replicates

    @property
    def samples(self) -> int:
        """Samples a pixel and band added so far."""
        return self._samples

    def add(self, film: np.ndarray, samples: int) -> None:
        """Add the mean film (channels, rows, columns) of a replicate of so many samples."""
        quantities = self._quantities(film)
        if self._keeps is not None:
            self.kept.append((film.astype(self._keeps), samples))
        if self._sum is None or self._pivot is None or self._squares is None:
            self._sum = film * samples
            self._pivot = quantities
            self._squares = np.zeros_like(quantities)
        else:
            self._sum += film * samples
            quantities -= self._pivot
            quantities *= quantities
            quantities *= samples
            self._squares += quantities
        self._samples += samples
        self._replicates += 1

    def film(self) -> np.ndarray:
        """Mean film, (channels, rows, columns)."""
        assert self._sum is not None
        return self._sum / self._samples

    def local(self) -> np.ndarray:
        """Mean of the local combination, (rows, columns)."""
        assert self._local is not None
        return np.asarray(np.sum(self._local * self.film(), axis=0))

    def _quantities(self, film: np.ndarray) -> np.ndarray:
        found = np.tensordot(self._tracked, film, axes=1)
        if self._local is None:
            return found
        return np.concatenate([found, np.sum(self._local * film, axis=0)[None]])

    def standard_error(self) -> np.ndarray:
        """Standard error of the tracked quantities, (quantities, rows, columns); the local last.

        sqrt(sum n_r (x_r - mean)^2 / (N (R - 1))) over R replicates of n_r of N samples, whose
        variances are taken to fall as 1/n_r; NaN for one.
        """
        assert self._pivot is not None
        assert self._squares is not None
        n = self._replicates
        if n < 2:
            return np.full_like(self._pivot, np.nan)
        offset = self._quantities(self.film()) - self._pivot
        spread = np.maximum(self._squares / self._samples - offset * offset, 0.0)
        return np.sqrt(spread / (n - 1))

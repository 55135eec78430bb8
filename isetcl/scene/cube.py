"""Hyperspectral pictures: a spectrum in every pixel, as textures of few channels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from isetcl.errors import InvalidInputError, check_count, check_finite, check_positive, check_type
from isetcl.memory import check_memory
from isetcl.scene.material import Diffuse, Emission
from isetcl.scene.texture import Image
from isetcl.spectrum import Spectrum, check_wavelengths

_ROWS_AT_ONCE = 64


@dataclass(frozen=True, eq=False)
class CubeChannels:
    """A cube as an image of few channels, and how far it is from the cube.

    Attributes
    ----------
    image : Image
        Weights of the spectra.
    spectra : tuple of Spectrum
        One for each channel: 1 at a wavelength of its own, falling linearly to 0 at the next ones.
        They sum to 1.
    rms_error, largest_error
        Difference from the cube over all pixels and wavelengths, as parts of the cube's root mean
        square.
    """

    image: Image
    spectra: tuple[Spectrum, ...]
    rms_error: float
    largest_error: float


@dataclass(frozen=True, eq=False)
class SpectralCube:
    """A spectral reflectance or radiance in every pixel.

    Parameters
    ----------
    values : array_like, (rows, columns, wavelengths)
        Finite and >= 0, row 0 at the top. Reflectance: 0 to 1. Radiance: W m^-2 sr^-1 nm^-1.
    wavelengths_nm
        Ascending wavelengths, nm.
    name
        For messages and provenance.

    Raises
    ------
    InvalidInputError
        If shapes differ, or a value is negative or not finite.
    """

    values: np.ndarray
    wavelengths_nm: np.ndarray
    name: str = "cube"

    def __post_init__(self) -> None:
        check_type("cube: name", self.name, str)
        grid = check_wavelengths(self.wavelengths_nm)
        values = np.asarray(self.values)
        if values.dtype.kind not in "biuf" or values.ndim != 3 or values.size == 0:
            raise InvalidInputError(
                f"cube {self.name!r} must hold numbers of shape (rows, columns, wavelengths), got "
                f"{values.dtype} of shape {values.shape}"
            )
        if values.shape[2] != len(grid):
            raise InvalidInputError(
                f"cube {self.name!r} must have one layer a wavelength, got {values.shape[2]} "
                f"layers and {len(grid)} wavelengths; pass (rows, columns, wavelengths)"
            )
        values = np.ascontiguousarray(values, dtype=np.float32)
        low, high = float(np.min(values)), float(np.max(values))
        if not (np.isfinite(low) and np.isfinite(high)) or low < 0:
            wrong = int(np.sum(~np.isfinite(values) | (values < 0)))
            raise InvalidInputError(
                f"cube {self.name!r} must be finite and >= 0, got {wrong} value(s) that are not "
                f"(smallest {low:g}); clip it first"
            )
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "wavelengths_nm", grid)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Rows, columns and wavelengths."""
        rows, columns, count = self.values.shape
        return rows, columns, count

    def between(self, low_nm: float, high_nm: float) -> SpectralCube:
        """The layers from one wavelength to another.

        Raises
        ------
        InvalidInputError
            If there is none.
        """
        low, high = check_finite("low_nm", low_nm, "nm"), check_finite("high_nm", high_nm, "nm")
        kept = (self.wavelengths_nm >= low) & (self.wavelengths_nm <= high)
        if not kept.any():
            raise InvalidInputError(
                f"cube {self.name!r} has no layer between {low:g} and {high:g} nm; it is known "
                f"from {self.wavelengths_nm[0]:g} to {self.wavelengths_nm[-1]:g} nm"
            )
        return SpectralCube(self.values[..., kept], self.wavelengths_nm[kept], self.name)

    def scaled(self, factor: float) -> SpectralCube:
        """The cube times a number > 0."""
        number = np.float32(check_positive("factor", factor))
        return SpectralCube(self.values * number, self.wavelengths_nm, self.name)

    def clipped(self, high: float = 1.0) -> SpectralCube:
        """The cube with values above a bound set to it."""
        bound = np.float32(check_positive("high", high))
        return SpectralCube(np.minimum(self.values, bound), self.wavelengths_nm, self.name)

    def channels(self, max_error: float = 0.01, max_channels: int | None = None) -> CubeChannels:
        """The cube as an image of the fewest channels that are near enough.

        Spectra are joined by straight lines between a few of their own wavelengths, chosen so that
        the squared error of the whole cube is least (dynamic programming). The channels are values
        of the cube, so that none is negative, and none exceeds the cube.

        Parameters
        ----------
        max_error
            Root mean square difference, as a part of the cube's root mean square.
        max_channels
            The most channels; the error is then what it is, and stated in the result.
        """
        wanted = check_finite("max_error", max_error)
        if wanted < 0:
            raise InvalidInputError(f"max_error must be >= 0, got {wanted:g}")
        count = self.shape[2]
        most = count if max_channels is None else check_count("max_channels", max_channels, 2)
        moments = _second_moments(self.values)
        pixels = self.values.shape[0] * self.values.shape[1]
        total = float(np.trace(moments))
        knots = _knots(self.wavelengths_nm, moments, wanted**2 * total, min(most, count))
        return self._at_knots(knots, np.sqrt(total / (pixels * count)))

    def _at_knots(self, knots: list[int], rms: float) -> CubeChannels:
        grid = self.wavelengths_nm
        places = grid[knots]
        spectra = tuple(
            Spectrum(places, row, f"{self.name} {place:g} nm")
            for place, row in zip(places, np.eye(len(knots)), strict=True)
        )
        image = Image(self.values[..., knots], self.name)
        # The spectra at every wavelength of the cube.
        weights = np.stack([spectrum.at(grid) for spectrum in spectra]).astype(np.float32)
        squares, largest = 0.0, 0.0
        for start in range(0, self.shape[0], _ROWS_AT_ONCE):
            rows = self.values[start : start + _ROWS_AT_ONCE]
            difference = rows - rows[..., knots] @ weights
            squares += float(np.sum(difference.astype(np.float64) ** 2))
            largest = max(largest, float(np.max(np.abs(difference))))
        scale = rms if rms > 0 else 1.0
        error = float(np.sqrt(squares / self.values.size))
        return CubeChannels(image, spectra, error / scale, largest / scale)

    def diffuse(self, max_error: float = 0.01, max_channels: int | None = None) -> Diffuse:
        """A matt surface painted with the cube, which holds reflectances.

        Raises
        ------
        InvalidInputError
            If a reflectance exceeds 1.
        """
        largest = float(np.max(self.values))
        if largest > 1.0 + 1e-5:
            raise InvalidInputError(
                f"cube {self.name!r} must be <= 1 to be a reflectance, got {largest:g}; "
                "use .scaled() or .clipped(), or .emission() if it is a radiance"
            )
        made = self.channels(max_error, max_channels)
        return Diffuse(made.spectra if len(made.spectra) > 1 else made.spectra[0], made.image)

    def emission(self, max_error: float = 0.01, max_channels: int | None = None) -> Emission:
        """A surface that sends out the cube, which holds radiances."""
        made = self.channels(max_error, max_channels)
        return Emission(made.spectra if len(made.spectra) > 1 else made.spectra[0], made.image)


def load_cube(
    path: str | Path,
    *,
    wavelengths_nm: Sequence[float] | np.ndarray | None = None,
    clip: tuple[float, float] | None = None,
) -> SpectralCube:
    """A hyperspectral picture from an ENVI, MATLAB or NumPy file.

    ``.hdr`` with its data file (ENVI; reflectance scale factor applied, ignored values become 0),
    ``.mat`` (MATLAB, version 7.3 too), ``.npz`` and ``.npy``. In MATLAB and NumPy files the cube is
    the array of three dimensions, and the wavelengths are the one list as long as its last.

    Parameters
    ----------
    path
        The file.
    wavelengths_nm
        Wavelengths, where the file does not state them.
    clip
        Smallest and largest value; what lies beyond is set to them. None refuses negative values.

    Raises
    ------
    FileError
        If the file cannot be read, or holds no cube, or no wavelengths.
    OutOfMemoryError
        If it does not fit into memory.
    """
    from isetcl.scene.cube_files import read_cube

    check_type("path", path, (str, Path))
    values, grid = read_cube(Path(path), wavelengths_nm)
    if clip is not None:
        low, high = (check_finite("clip", bound) for bound in _two(clip))
        if not 0 <= low < high:
            raise InvalidInputError(f"clip must be 0 <= low < high, got {low:g} and {high:g}")
        values = np.clip(values, np.float32(low), np.float32(high))
    return SpectralCube(values, grid, Path(path).name)


def _two(clip: tuple[float, float]) -> tuple[float, float]:
    try:
        low, high = clip
    except (TypeError, ValueError):
        raise InvalidInputError(f"clip must be two numbers, got {clip!r}") from None
    return low, high


def _second_moments(values: np.ndarray) -> np.ndarray:
    """Sums over pixels of the products of layers, (wavelengths, wavelengths)."""
    count = values.shape[2]
    check_memory("the reduction of a cube", 40.0 * count * count, lambda _: "use fewer wavelengths")
    total = np.zeros((count, count))
    for start in range(0, values.shape[0], _ROWS_AT_ONCE):
        rows = values[start : start + _ROWS_AT_ONCE].reshape(-1, count).astype(np.float64)
        total += rows.T @ rows
    return total


def _knots(grid: np.ndarray, moments: np.ndarray, allowed: float, most: int) -> list[int]:
    """The fewest layers between which straight lines leave a squared error that is allowed.

    Where more than `most` would be needed, those with the least error.
    """
    count = len(grid)
    if count == 1:
        return [0]
    cost = _line_costs(grid, moments)
    # best[j]: least error of lines from the first layer to layer j with the knots so far.
    best = cost[0].copy()
    back: list[np.ndarray] = []
    while best[-1] > allowed and len(back) + 2 < most:
        joined = best[:, None] + cost
        back.append(np.argmin(joined, axis=0))
        best = np.min(joined, axis=0)
    knots = [count - 1]
    for previous in reversed(back):
        knots.append(int(previous[knots[-1]]))
    return sorted({0, *knots})


def _line_costs(grid: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Squared error of a straight line between every two layers, infinite backwards."""
    count = len(grid)
    own = np.diag(moments)
    cost = np.full((count, count), np.inf)
    for a in range(count):
        cost[a, a] = 0.0
        if a + 1 >= count:
            continue
        ends = np.arange(a + 1, count)
        # Rows: the far end b; columns: the layer between.
        between = ends[None, :] < ends[:, None]
        t = (grid[ends][None, :] - grid[a]) / (grid[ends][:, None] - grid[a])
        s = 1.0 - t
        error = (
            own[ends][None, :]
            + s**2 * own[a]
            + t**2 * own[ends][:, None]
            + 2.0 * s * t * moments[a, ends][:, None]
            - 2.0 * s * moments[a, ends][None, :]
            - 2.0 * t * moments[np.ix_(ends, ends)]
        )
        cost[a, ends] = np.maximum(np.where(between, error, 0.0), 0.0).sum(axis=1)
    return cost

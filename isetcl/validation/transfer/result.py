"""What a slanted edge tells: the edge, its transfer and their errors."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.eye.waves.otf import check_frequencies

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

PixelChoice = Literal["remove", "keep"]


@dataclass(frozen=True)
class Edge:
    """The edge that was found.

    Attributes
    ----------
    angle_deg
        Tilt from the vertical, anticlockwise, -90 to 90 degrees.
    position
        A point of it, in the middle of its length: field angles (x, y), degrees; for plain arrays
        columns and rows (downwards, negative) times the pitch.
    bend_px
        How far the middle of the edge lies from the straight line between its ends, pixels.
    rows
        Its length, in rows or columns of pixels.
    half_width_px
        How far on both sides pixels are used.
    contrast
        Michelson contrast of the two sides.
    knots_per_pixel
        Steps of the edge spread function: 4 a pixel, or 3 or 2 where the pixels allow no more.
    noise
        Standard deviation of a pixel about the edge spread function, relative to the step.
    """

    angle_deg: float
    position: tuple[float, float]
    bend_px: float
    rows: int
    half_width_px: float
    contrast: float
    knots_per_pixel: int
    noise: float


@dataclass(frozen=True, eq=False)
class SlantedEdgeMtf:
    """Modulation transfer across an edge; f frequencies, n wavelengths.

    Attributes
    ----------
    frequency_cpd, frequency_cpmm : ndarray, (f,), or None
        Frequencies along the edge's normal, cycles/degree of visual angle and cycles/mm on the
        retina; None where the scale is not known.
    frequency_cpp : ndarray, (f,)
        The same in cycles per pixel.
    wavelengths_nm : ndarray, (n,), or None
        Wavelengths; None for plain arrays without them.
    mtf, standard_error : ndarray, (n, f)
        Transfer of every wavelength, and its standard error.
    photopic_mtf, photopic_standard_error : ndarray, (f,)
        Transfer in photopic light (or by the weights asked for), and its standard error.
    mtf50_cpd, mtf50_standard_error_cpd
        Frequency at which the photopic transfer falls to 0.5; NaN beyond the frequencies computed,
        or without a scale in degrees.
    edge
        What was measured.
    beyond, beyond_standard_error
        Share of the photopic light that the edge spreads beyond the region, and its standard error:
        found from the outer part of the region, and put back; see the notes of `slanted_edge_mtf`.
    distance_deg, edge_spread : ndarray, (m,)
        Photopic edge spread function, 0 to 1, against the distance in degrees (or mm).
    pixel
        Whether the pixels' own integration was removed.
    """

    frequency_cpd: np.ndarray | None
    frequency_cpmm: np.ndarray | None
    frequency_cpp: np.ndarray
    wavelengths_nm: np.ndarray | None
    mtf: np.ndarray
    standard_error: np.ndarray
    photopic_mtf: np.ndarray
    photopic_standard_error: np.ndarray
    mtf50_cpd: float
    mtf50_standard_error_cpd: float
    edge: Edge
    beyond: float
    beyond_standard_error: float
    distance_deg: np.ndarray
    edge_spread: np.ndarray
    pixel: PixelChoice

    def at(self, frequency_cpd: np.ndarray | list[float]) -> np.ndarray:
        """Photopic transfer at frequencies in cycles/degree, between those computed, (k,)."""
        if self.frequency_cpd is None:
            raise InvalidInputError(
                "frequencies in cycles/degree need the scale of the image; pass pitch_deg"
            )
        wanted = check_frequencies(frequency_cpd)
        if np.any(wanted > self.frequency_cpd[-1] * (1.0 + 1e-9)):
            raise InvalidInputError(
                f"frequency_cpd must be at most {self.frequency_cpd[-1]:.4g}, the highest one "
                f"computed, got {np.max(wanted):.4g} cycles/degree"
            )
        return np.interp(wanted, self.frequency_cpd, self.photopic_mtf)

    def to_dataset(self) -> xarray.Dataset:
        """Everything as an `xarray.Dataset` with dimensions wavelength and frequency."""
        import xarray

        spectral = ("wavelength", "frequency")
        data = {
            "mtf": (spectral, self.mtf),
            "standard_error": (spectral, self.standard_error),
            "photopic_mtf": ("frequency", self.photopic_mtf),
            "photopic_standard_error": ("frequency", self.photopic_standard_error),
        }
        coords: dict[str, tuple[str, np.ndarray, dict[str, str]]] = {
            "frequency": ("frequency", self.frequency_cpp, {"units": "cycles/pixel"})
        }
        if self.frequency_cpd is not None:
            coords["frequency_cpd"] = ("frequency", self.frequency_cpd, {"units": "cycles/degree"})
        if self.frequency_cpmm is not None:
            coords["frequency_cpmm"] = ("frequency", self.frequency_cpmm, {"units": "cycles/mm"})
        if self.wavelengths_nm is not None:
            coords["wavelength"] = ("wavelength", self.wavelengths_nm, {"units": "nm"})
        details = {f"edge_{name}": value for name, value in dataclasses.asdict(self.edge).items()}
        attributes = {
            **details,
            "mtf50_cpd": self.mtf50_cpd,
            "beyond": self.beyond,
            "beyond_standard_error": self.beyond_standard_error,
            "pixel": self.pixel,
        }
        return xarray.Dataset(data, coords, attributes)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the photopic transfer with its standard error, and the wavelengths pale."""
        from isetcl.validation.transfer.pictures import draw_slanted_edge

        return draw_slanted_edge(self, ax)

"""Pictures with depth as the layers that PSF methods combine.

Every sheet of pixels is divided by depth first, and what a sample of a view holds is then the mean
over its area, so that light is kept whatever the two pixel sizes are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from isetcl.psf_baseline.borders import Border, pixel_index
from isetcl.psf_baseline.camera import Camera, Projection
from isetcl.psf_baseline.view import Layer, ViewGrid
from isetcl.retina.grid import RetinalGrid
from isetcl.scene.basis import SpectralBasis

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Hidden = Literal["extend", "none"]
HIDDEN = ("extend", "none")


@dataclass(frozen=True, eq=False)
class Sheet:
    """A picture in coefficients of spectra.

    Attributes
    ----------
    colour : ndarray, (basis, rows, columns), float32
        Radiance of what is covered, not multiplied by alpha.
    alpha, vergence_dpt : ndarray, (rows, columns)
        Covered share, and vergence, 1/m.
    """

    colour: np.ndarray
    alpha: np.ndarray
    vergence_dpt: np.ndarray


@dataclass(frozen=True, eq=False)
class PictureStack:
    """Sheets of pixels before an eye, near to far, and what to assume beyond and behind them.

    Attributes
    ----------
    name, digest_text
        For provenance.
    left_deg, top_deg, pitch_deg
        Field angles of the upper left corner, and the width and height of a pixel, degrees.
    basis
        Spectra of the sheets' coefficients.
    sheets
        Near to far.
    border
        Beyond the picture: ``"reflect"`` mirrors it at the border, as often as need be;
        ``"replicate"`` repeats its outermost pixels; ``"zero"`` is dark and empty.
    hidden
        Behind the only sheet of a picture without hidden layers: ``"extend"`` takes the nearest
        pixel that is farther away; ``"none"`` is dark and empty.
    camera
        Of a picture in perspective; None where its pixels are, or are as good as, even steps of
        field angle.
    projection
        ``"perspective"`` or ``"angular"``, as the picture says or is taken to be.
    """

    name: str
    digest_text: str
    left_deg: float
    top_deg: float
    pitch_deg: tuple[float, float]
    basis: SpectralBasis
    sheets: tuple[Sheet, ...]
    border: Border
    hidden: Hidden
    camera: Camera | None = None
    projection: Projection = "angular"

    def digest(self) -> str:
        """A hash of what the pictures hold, for provenance."""
        return self.digest_text

    @property
    def is_extended(self) -> bool:
        """Whether hidden content is invented."""
        return len(self.sheets) == 1 and self.hidden == "extend"

    def vergences_dpt(self) -> np.ndarray:
        """All vergences that occur, sorted."""
        values = [sheet.vergence_dpt[sheet.alpha > 0] for sheet in self.sheets]
        return np.unique(np.concatenate(values))

    def vergences_between(self, edges_dpt: np.ndarray) -> tuple[list[float], list[float]]:
        """Mean vergence and visible area, in pixels, of what lies between edges.

        What lies beyond the outer edges belongs to the outer layers.
        """
        count = len(edges_dpt) - 1
        total, covered, visible = np.zeros(count), np.zeros(count), np.zeros(count)
        light = np.ones(self.sheets[0].alpha.shape)
        for sheet in self.sheets:
            which = np.searchsorted(edges_dpt[1:-1], sheet.vergence_dpt).ravel()
            for sums, weight in (
                (total, sheet.alpha * sheet.vergence_dpt),
                (covered, sheet.alpha),
                (visible, sheet.alpha * light),
            ):
                sums += np.bincount(which, weight.ravel(), minlength=count)
            light = light * (1.0 - sheet.alpha)
        middle = np.maximum(0.0, (edges_dpt[:-1] + edges_dpt[1:]) / 2.0)
        mean = np.where(covered > 0, total / np.where(covered > 0, covered, 1.0), middle)
        return mean.tolist(), visible.tolist()

    def assumptions(self, grid: RetinalGrid, reach_deg: float) -> dict[str, Any]:
        """What is assumed beyond and behind the pictures of an image, for provenance."""
        return {
            "border": self.border,
            "border_deg": reach_deg,
            "blur_is_wider_than_image": reach_deg > min(grid.fov_deg),
            "hidden": self.hidden if len(self.sheets) == 1 else "given",
            "projection": self.projection,
            "is_reprojected": self.camera is not None,
        }

    def layers_on(self, view: ViewGrid, edges_dpt: np.ndarray, complete: bool) -> list[Layer]:
        """The layers between edges on the samples of a view, far to near; see `take_layers`."""
        sample = self._sampler(view)
        rows, columns = self.sheets[0].alpha.shape
        which = [
            np.where(sheet.alpha > 0, np.searchsorted(edges_dpt, sheet.vergence_dpt) - 1, -1)
            for sheet in self.sheets
        ]
        count = len(edges_dpt) - 1
        extended = _extended(which[0], count) if complete and self.is_extended else None
        layers = []
        for k in range(count):
            planes = self._planes(which, k, complete)
            if extended is not None:
                place, source = extended[k]
                planes[:, place] = self._pixels(source)
            planes = planes.reshape(-1, rows, columns)
            sampled = np.stack([sample(plane) for plane in planes]).astype(np.float32)
            total = float(sampled[-2].sum(dtype=np.float64))
            if total > 0:
                mean = float(sampled[-1].sum(dtype=np.float64)) / total
                layers.append(Layer(mean, sampled[:-2], sampled[-2], sampled[-1]))
        return layers

    def _sampler(self, view: ViewGrid) -> Callable[[np.ndarray], np.ndarray]:
        """A function that takes pixels to the means over the samples of a view."""
        rows, columns = self.sheets[0].alpha.shape
        x_deg, y_deg = view.x_deg(0.0), view.y_deg(0.0)
        if self.camera is not None:
            shares = self.camera.shares(x_deg, y_deg, view.pitch_deg, self.border)
            return lambda plane: (shares @ plane.ravel()).reshape(view.shape)
        wide, high = self.pitch_deg
        width, height = view.pitch_deg
        down = _overlap((self.top_deg - y_deg) / high, height / high, rows, self.border)
        across = _overlap((x_deg - self.left_deg) / wide, width / wide, columns, self.border)
        return lambda plane: np.asarray((across @ (down @ plane).T).T)

    def vergence_map(self, grid: RetinalGrid) -> np.ndarray:
        """Vergence of what the middles of an image's pixels look at, (rows, columns); 0 if none."""
        rows, columns = self.sheets[0].alpha.shape
        seen = np.zeros((rows, columns))
        for sheet in reversed(self.sheets):
            seen = np.where(sheet.alpha > 0.5, sheet.vergence_dpt, seen)
        if self.camera is not None:
            at_column, at_row = self.camera.places(grid.x_deg[None, :], grid.y_deg[:, None])
        else:
            at_column = ((grid.x_deg - self.left_deg) / self.pitch_deg[0])[None, :]
            at_row = ((self.top_deg - grid.y_deg) / self.pitch_deg[1])[:, None]
        row, in_rows = pixel_index(at_row, rows, self.border)
        column, in_columns = pixel_index(at_column, columns, self.border)
        return np.where(in_rows & in_columns, seen[row, column], 0.0)

    def _planes(self, which: list[np.ndarray], k: int, complete: bool) -> np.ndarray:
        """Colour, coverage and vergence of one layer by pixel, (basis + 2, pixels)."""
        n_basis, *shape = self.sheets[0].colour.shape
        planes = np.zeros((n_basis + 2, shape[0] * shape[1]))
        light = np.ones(shape[0] * shape[1])
        for sheet, own in zip(self.sheets, which, strict=True):
            here = (own == k).ravel()
            alpha = sheet.alpha.ravel()
            share = np.where(here, light * alpha, 0.0)
            planes[:n_basis] += share * sheet.colour.reshape(n_basis, -1)
            planes[n_basis] += share
            planes[n_basis + 1] += share * sheet.vergence_dpt.ravel()
            # Of complete layers only what lies in the same layer hides something.
            light = light * np.where(here, 1.0 - alpha, 1.0) if complete else light * (1.0 - alpha)
        return planes

    def _pixels(self, source: np.ndarray) -> np.ndarray:
        """Colour, coverage and vergence of pixels of the front, (basis + 2, n)."""
        front = self.sheets[0]
        alpha = front.alpha.ravel()[source]
        colour = front.colour.reshape(len(front.colour), -1)[:, source]
        depth = front.vergence_dpt.ravel()[source]
        return np.concatenate([colour * alpha, alpha[None], (depth * alpha)[None]])


def _extended(which: np.ndarray, count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """For every layer the pixels that nearer ones hide, and those to fill them with, both flat.

    A hidden pixel takes the nearest pixel of any farther layer; behind that comes what is hidden
    there, and so on to the farthest.
    """
    from scipy.ndimage import distance_transform_edt

    filled: list[tuple[np.ndarray, np.ndarray]] = [(np.zeros(0, int), np.zeros(0, int))] * count
    parts: list[list[tuple[np.ndarray, np.ndarray]]] = [[] for _ in range(count)]
    columns = which.shape[1]
    level = which.ravel().copy()
    for k in range(count - 1, 0, -1):
        farther = (which >= 0) & (which < k)
        place = np.flatnonzero(level == k)
        if len(place) == 0 or not farther.any():
            continue
        nearest = distance_transform_edt(
            ~farther, return_distances=False, return_indices=True
        ).reshape(2, -1)[:, place]
        source = nearest[0] * columns + nearest[1]
        level[place] = which.ravel()[source]
        for j in np.unique(level[place]):
            chosen = level[place] == j
            parts[int(j)].append((place[chosen], source[chosen]))
    for k, found in enumerate(parts):
        if found:
            filled[k] = tuple(np.concatenate(each) for each in zip(*found, strict=True))  # type: ignore[assignment]
    return filled


def _overlap(start: np.ndarray, width: float, count: int, border: Border) -> csr_array:
    """Share of each pixel in each sample, a sparse matrix (samples, pixels).

    Parameters
    ----------
    start, width
        Where samples begin and how wide they are, in pixels.
    """
    from scipy.sparse import csr_array

    # Rounding must not give a sample a trace of the next pixel.
    start = np.round(start, 9)
    reach = int(np.ceil(width)) + 1
    pixel = np.floor(start)[:, None] + np.arange(reach)
    low, high = np.maximum(start[:, None], pixel), np.minimum(start[:, None] + width, pixel + 1.0)
    share = np.maximum(high - low, 0.0) / width
    index, is_real = pixel_index(pixel + 0.5, count, border)
    sample = np.broadcast_to(np.arange(len(start))[:, None], pixel.shape)
    values = (share * is_real).ravel()
    kept = values > 1e-9
    entries = (values[kept], (sample.ravel()[kept], index.ravel()[kept]))
    return csr_array(entries, shape=(len(start), count))

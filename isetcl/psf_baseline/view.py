"""What PSF methods start from: sharp layers of the scene, seen through the entrance pupil.

The view is taken on a grid finer and larger than the image, along the chief rays of the reference
wavelength, in object-space field angles. Every sample knows all surfaces along its ray, so that a
layer can be had with or without what hides it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from isetcl.errors import InvalidInputError, check_count
from isetcl.eye.field import direction_from_field
from isetcl.retina.grid import RetinalGrid
from isetcl.scene.basis import SpectralBasis
from isetcl.scene.model import Scene
from isetcl.scene.view import intersect, weights
from isetcl.units import MM_PER_M

Layers = Literal["auto"] | int | Sequence[float]

MAX_LAYERS = 512

_ROWS_AT_ONCE = 64
_RAYS_AT_ONCE = 1 << 17
_EDGE_CONTRAST = 0.1


@dataclass(frozen=True)
class ViewGrid:
    """Fine samples that cover an image and a margin around it.

    Attributes
    ----------
    grid
        The image's pixels.
    oversampling
        Samples across a pixel.
    margin
        Samples beyond each border of the image.
    """

    grid: RetinalGrid
    oversampling: int
    margin: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of samples."""
        rows, columns = self.grid.shape
        extra = 2 * self.margin
        return rows * self.oversampling + extra, columns * self.oversampling + extra

    @property
    def pitch_deg(self) -> tuple[float, float]:
        """Width and height of a sample, degrees."""
        width, height = self.grid.pitch_deg
        return width / self.oversampling, height / self.oversampling

    def x_deg(self, offset: float = 0.5) -> np.ndarray:
        """Field angles x at a fraction `offset` of each column of samples."""
        columns = np.arange(self.shape[1]) - self.margin + offset
        return self.grid.left_deg + columns * self.pitch_deg[0]

    def y_deg(self, offset: float = 0.5) -> np.ndarray:
        """Field angles y at a fraction `offset` of each row of samples."""
        rows = np.arange(self.shape[0]) - self.margin + offset
        return self.grid.top_deg - rows * self.pitch_deg[1]


@dataclass(frozen=True, eq=False)
class Layer:
    """One depth interval of a view.

    Attributes
    ----------
    vergence_dpt
        Vergence the layer is blurred for, 1/m.
    colour : ndarray, (basis, rows, columns), float32
        Coefficients of the scene's spectra times coverage.
    coverage : ndarray, (rows, columns), float32
        Fraction of each sample the layer covers, 0 to 1.
    """

    vergence_dpt: float
    colour: np.ndarray
    coverage: np.ndarray


def layer_edges_dpt(scene: Scene, grid: RetinalGrid, layers: Layers, step_dpt: float) -> np.ndarray:
    """Edges of depth layers in dioptres, ascending (far to near), shape (n + 1,).

    Parameters
    ----------
    layers
        ``"auto"``: as few as keep a layer thinner than `step_dpt`, none where there is nothing; a
        number: equal steps between the farthest and the nearest surface; or the edges themselves.
    step_dpt
        Change of vergence that widens the blur by one pixel.

    Raises
    ------
    InvalidInputError
        If edges are not ascending or do not enclose the scene, or too many layers are needed.
    """
    seen = _vergences(scene, grid)
    if len(seen) == 0:
        return np.array([-1e-9, 1e-9])
    low, high = float(seen[0]), float(seen[-1])
    pad = 1e-6 * max(1.0, high)
    if isinstance(layers, str):
        if layers != "auto":
            raise InvalidInputError(
                f"layers must be 'auto', a number or edges in dioptres, got {layers!r}"
            )
        return _cluster_edges(seen, step_dpt, pad)
    if isinstance(layers, int) and not isinstance(layers, bool):
        count = check_count("layers", layers, 1, MAX_LAYERS)
        return np.linspace(low - pad, high + pad, count + 1)
    edges = np.asarray(layers, dtype=np.float64)
    if edges.ndim != 1 or len(edges) < 2 or np.any(np.diff(edges) <= 0):
        raise InvalidInputError(
            f"layer edges must be ascending numbers of dioptres, got {edges.tolist()}"
        )
    if edges[0] > low or edges[-1] < high:
        raise InvalidInputError(
            f"layer edges must enclose the scene, {low:g} to {high:g} dpt, got {edges[0]:g} to "
            f"{edges[-1]:g} dpt"
        )
    return edges


def _vergences(scene: Scene, grid: RetinalGrid) -> np.ndarray:
    """Vergences of all surfaces along a coarse set of rays, hidden ones included, sorted."""
    x = np.linspace(grid.x_deg[0], grid.x_deg[-1], 65)
    y = np.linspace(grid.y_deg[0], grid.y_deg[-1], 65)
    origin, directions = _rays(grid, *np.meshgrid(x, y))
    found = [
        _vergence(intersect(o.shape, origin, directions).distance_m, origin, directions)
        for o in scene.objects
    ]
    values = [v[v > 0] for v in found]
    if scene.background is not None:
        values.append(np.zeros(1))
    return np.unique(np.concatenate(values)) if values else np.zeros(0)


def _cluster_edges(seen: np.ndarray, step_dpt: float, pad: float) -> np.ndarray:
    """Edges between groups of sorted vergences, each group no wider than the step."""
    edges = [float(seen[0]) - pad]
    start = float(seen[0])
    previous = start
    for value in map(float, seen[1:]):
        if value - start > step_dpt:
            edges.append((previous + value) / 2.0)
            start = value
        previous = value
    edges.append(previous + pad)
    if len(edges) > MAX_LAYERS + 1:
        raise InvalidInputError(
            f"the scene needs {len(edges) - 1} layers of {step_dpt:.3g} dpt, more than "
            f"{MAX_LAYERS}; pass a number of layers or use larger pixels"
        )
    return np.array(edges)


def _rays(grid: RetinalGrid, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Origins in the entrance pupil, metres, and directions, for field angles."""
    field = np.minimum(np.hypot(x, y), grid.field_map.max_field_deg)
    z = grid.field_map.entrance_z_mm(field) / MM_PER_M
    return np.stack([np.zeros_like(x), np.zeros_like(x), z], axis=-1), direction_from_field(x, y)


def _vergence(distance_m: np.ndarray, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """1/(depth along the axis from the corneal vertex); -1 where there is no hit."""
    with np.errstate(invalid="ignore", divide="ignore"):
        depth = -(origin[..., 2] + distance_m * directions[..., 2])
        hit = np.isfinite(distance_m) & (depth > 0)
        return np.where(hit, 1.0 / np.where(hit, depth, 1.0), -1.0)


def take_layers(
    scene: Scene,
    view: ViewGrid,
    basis: SpectralBasis,
    edges_dpt: np.ndarray,
    *,
    complete: bool,
    refinement: int = 4,
) -> list[Layer]:
    """The layers of a scene, far to near; layers in which nothing is seen are left out.

    Parameters
    ----------
    complete
        True: each layer as if nothing stood before it. False: only what is visible.
    refinement
        Rays across a sample where neighbouring samples differ strongly; one ray elsewhere.
    """
    rows, columns = view.shape
    count = len(edges_dpt) - 1
    found = np.zeros((count, len(basis.spectra) + 2, rows, columns), dtype=np.float32)
    for top in range(0, rows, _ROWS_AT_ONCE):
        block = slice(top, top + _ROWS_AT_ONCE)
        x, y = np.meshgrid(view.x_deg(), view.y_deg()[block])
        surfaces = _surfaces(scene, view.grid, basis, x, y)
        found[:, :, block] = _by_layer(surfaces, edges_dpt, complete, x.shape, len(basis.spectra))
    if refinement > 1:
        _refine(found, scene, view, basis, edges_dpt, complete, refinement)
    layers = []
    for colour, coverage, vergence in ((f[:-2], f[-2], f[-1]) for f in found):
        total = float(coverage.sum(dtype=np.float64))
        if total > 0:
            mean = float(vergence.sum(dtype=np.float64)) / total
            layers.append(Layer(mean, colour, coverage))
    return layers


def _refine(
    found: np.ndarray,
    scene: Scene,
    view: ViewGrid,
    basis: SpectralBasis,
    edges_dpt: np.ndarray,
    complete: bool,
    refinement: int,
) -> None:
    """Replace samples that differ strongly from a neighbour by means over `refinement`^2 rays."""
    row, column = np.nonzero(_has_edge(found[:, :-1]))
    offsets = (np.arange(refinement) + 0.5) / refinement
    for first in range(0, len(row), _RAYS_AT_ONCE):
        r, c = row[first : first + _RAYS_AT_ONCE], column[first : first + _RAYS_AT_ONCE]
        mean = np.zeros((*found.shape[:2], len(r)))
        for offset_y in offsets:
            for offset_x in offsets:
                x, y = view.x_deg(offset_x)[c], view.y_deg(offset_y)[r]
                surfaces = _surfaces(scene, view.grid, basis, x, y)
                mean += _by_layer(surfaces, edges_dpt, complete, x.shape, len(basis.spectra))
        found[:, :, r, c] = mean / refinement**2


def _has_edge(values: np.ndarray) -> np.ndarray:
    """Samples that differ from one of their neighbours by a tenth of the range, (rows, columns)."""
    rows, columns = values.shape[-2:]
    edge = np.zeros((rows, columns), dtype=bool)
    for plane in values.reshape(-1, rows, columns):
        threshold = _EDGE_CONTRAST * float(np.ptp(plane))
        if threshold == 0.0:
            continue
        padded = np.pad(plane, 1, mode="edge")
        for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
            one = padded[1 + dy : 1 + dy + rows, 1 + dx : 1 + dx + columns]
            other = padded[1 - dy : 1 - dy + rows, 1 - dx : 1 - dx + columns]
            edge |= (np.abs(one - plane) > threshold) | (np.abs(other - plane) > threshold)
    return edge


def _surfaces(
    scene: Scene, grid: RetinalGrid, basis: SpectralBasis, x: np.ndarray, y: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Vergence (-1 for a miss) and colour (..., basis) of every object along rays, first wins."""
    origin, directions = _rays(grid, x, y)
    surfaces = []
    for item, coefficients in zip(scene.objects, basis.objects, strict=True):
        hits = intersect(item.shape, origin, directions)
        vergence = _vergence(hits.distance_m, origin, directions)
        surfaces.append((vergence, weights(item, hits) @ coefficients))
    if scene.background is not None:
        colour = np.broadcast_to(basis.background, (*x.shape, len(basis.background)))
        surfaces.append((np.zeros(x.shape), colour))
    return surfaces


def _by_layer(
    surfaces: list[tuple[np.ndarray, np.ndarray]],
    edges_dpt: np.ndarray,
    complete: bool,
    shape: tuple[int, ...],
    n_basis: int,
) -> np.ndarray:
    """What each ray finds in each layer: the nearest surface between its edges.

    Returns
    -------
    ndarray, (layers, basis + 2, ...)
        Colour, coverage (0 or 1) and vergence; all 0 where the layer is empty or, unless complete
        layers are wanted, hidden.
    """
    count = len(edges_dpt) - 1
    result = np.zeros((count, n_basis + 2, *shape))
    nearest = np.full(shape, -1.0)
    for vergence, _ in surfaces:
        nearest = np.maximum(nearest, vergence)
    for i in range(count):
        best = np.full(shape, -1.0)
        for vergence, tint in surfaces:
            here = (vergence > edges_dpt[i]) & (vergence <= edges_dpt[i + 1]) & (vergence > best)
            if not complete:
                here &= vergence == nearest
            if here.any():
                best = np.where(here, vergence, best)
                result[i, :n_basis] = np.where(here, np.moveaxis(tint, -1, 0), result[i, :n_basis])
        covered = best >= 0.0
        result[i, n_basis] = covered
        result[i, n_basis + 1] = np.where(covered, best, 0.0)
    return result


def blur_step_dpt(grid: RetinalGrid) -> float:
    """Change of vergence that widens the blur circle by one pixel: pixel angle / pupil diameter.

    Source: the rule N >= pupil (V_max - V_min) / pixel for layered depth of field.
    """
    pupil_m = grid.eye.entrance_pupil(grid.wavelength_nm).diameter_mm / MM_PER_M
    return math.radians(min(grid.pitch_deg)) / pupil_m

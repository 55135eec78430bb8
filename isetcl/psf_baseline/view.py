"""What PSF methods start from: sharp layers of the scene, seen through the entrance pupil.

The view is taken on a grid finer and larger than the image, along the chief rays of the reference
wavelength, in object-space field angles. Every sample knows all surfaces along its ray, so that a
layer can be had with or without what hides it.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_count
from isetcl.eye.field import direction_from_field
from isetcl.eye.field_plane import FieldPlane
from isetcl.retina.grid import RetinalGrid
from isetcl.scene.basis import SpectralBasis
from isetcl.scene.mesh import Mesh
from isetcl.scene.model import Scene, SceneObject, Shape
from isetcl.scene.view import COINCIDENT, Hits, intersect, outline_points, weights
from isetcl.units import MM_PER_M

Layers = Literal["auto"] | int | Sequence[float]


class LayerSource(Protocol):
    """What has layers of its own instead of surfaces: a `PictureStack`."""

    def vergences_dpt(self) -> np.ndarray:
        """All vergences that occur, sorted."""

    def vergences_between(self, edges_dpt: np.ndarray) -> tuple[list[float], list[float]]:
        """Mean vergence and visible area, in pixels, of what lies between edges."""

    def layers_on(self, view: ViewGrid, edges_dpt: np.ndarray, complete: bool) -> list[Layer]:
        """The layers between edges on the samples of a view; see `take_layers`."""


MAX_LAYERS = 512

_ROWS_AT_ONCE = 64
_RAYS_AT_ONCE = 1 << 17
_EDGE_CONTRAST = 0.1
_THICK_SAMPLES = 16.0  # objects at least so thick are found by the differences of samples
_RAYS_ACROSS_OBJECT = 48
_MAX_REFINEMENT = 128


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
    depth : ndarray, (rows, columns), float32, or None
        Coverage times the vergence of what is seen, 1/m; None if all lies at `vergence_dpt`.
    """

    vergence_dpt: float
    colour: np.ndarray
    coverage: np.ndarray
    depth: np.ndarray | None = None


def layer_edges_dpt(
    scene: Scene | LayerSource,
    grid: RetinalGrid,
    layers: Layers,
    step_dpt: float,
    reach_deg: float = 0.0,
) -> np.ndarray:
    """Edges of depth layers in dioptres, ascending (far to near), shape (n + 1,).

    What lies beyond the outer edges belongs to the outer layers.

    Parameters
    ----------
    reach_deg
        How far beyond the image's borders surfaces count: their blur may reach into it.
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
    seen = _vergences(scene, grid, reach_deg) if isinstance(scene, Scene) else scene.vergences_dpt()
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
    if np.ndim(layers) == 0:
        count = check_count("layers", layers, 1, MAX_LAYERS)  # type: ignore[arg-type]
        return np.linspace(low - pad, high + pad, count + 1)
    edges = check_array("layers", layers)
    if edges.ndim != 1 or len(edges) < 2 or np.any(np.diff(edges) <= 0):
        raise InvalidInputError(
            f"layer edges must be ascending numbers of dioptres, got {edges.tolist()}"
        )
    if reach_deg == 0.0 and (edges[0] > low or edges[-1] < high):
        raise InvalidInputError(
            f"layer edges must enclose the scene, {low:g} to {high:g} dpt, got {edges[0]:g} to "
            f"{edges[-1]:g} dpt"
        )
    return edges


def _vergences(scene: Scene, grid: RetinalGrid, reach_deg: float) -> np.ndarray:
    """Vergences of surfaces in a field larger than the image, hidden ones included, sorted.

    Along a coarse set of rays, and at points of every outline, so that small objects count too.
    """
    left, right = grid.left_deg - reach_deg, grid.left_deg + grid.fov_deg[0] + reach_deg
    top, low = grid.top_deg + reach_deg, grid.top_deg - grid.fov_deg[1] - reach_deg
    origin, directions = _rays(
        grid, *np.meshgrid(np.linspace(left, right, 129), np.linspace(top, low, 129))
    )
    values = []
    for item in scene.objects:
        hits = _vergence(intersect(item.shape, origin, directions).distance_m, origin, directions)
        x, y, vergence = _outline(grid, item.shape, 256)
        inside = (x >= left) & (x <= right) & (y >= low) & (y <= top)
        values += [hits[hits > 0], vergence[inside]]
    if scene.background is not None:
        values.append(np.zeros(1))
    return np.unique(np.concatenate(values)) if values else np.zeros(0)


def _outline(
    grid: RetinalGrid, shape: Shape, count: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Field angles (x, y), degrees, and vergences of points on the outline of a shape."""
    pupil = grid.field_map.entrance_mm(np.array(0.0), np.array(0.0)) / MM_PER_M
    point = outline_points(shape, pupil, count)
    point = point[point[:, 2] < 0.0]
    away = point - pupil
    across = np.hypot(away[:, 0], away[:, 1])
    theta = np.degrees(np.arctan2(across, -away[:, 2]))
    scale = theta / np.where(across > 0, across, 1.0)
    return away[:, 0] * scale, away[:, 1] * scale, -1.0 / point[:, 2]


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
    chief = grid.field_map
    field = np.minimum(np.hypot(x, y), chief.max_field_deg)
    if isinstance(chief, FieldPlane):
        inside = field / np.maximum(np.hypot(x, y), 1e-300) * (1.0 - 1e-12)
        origin = chief.entrance_mm(x * inside, y * inside) / MM_PER_M
        return origin, direction_from_field(x, y)
    z = chief.entrance_z_mm(field) / MM_PER_M
    return np.stack([np.zeros_like(x), np.zeros_like(x), z], axis=-1), direction_from_field(x, y)


def _vergence(distance_m: np.ndarray, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """1/(depth along the axis from the corneal vertex); -1 where there is no hit."""
    with np.errstate(invalid="ignore", divide="ignore"):
        depth = -(origin[..., 2] + distance_m * directions[..., 2])
        hit = np.isfinite(distance_m) & (depth > 0)
        return np.where(hit, 1.0 / np.where(hit, depth, 1.0), -1.0)


def take_layers(
    scene: Scene | LayerSource,
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
        Rays across a sample where neighbouring samples differ strongly; one ray elsewhere. Objects
        thinner than a few samples take more, so that their light is not lost.

    Raises
    ------
    InvalidInputError
        If an object in the field is too small to be found by the finest refinement.
    """
    if not isinstance(scene, Scene):
        return scene.layers_on(view, edges_dpt, complete)
    rows, columns = view.shape
    count = len(edges_dpt) - 1
    found = np.zeros((count, len(basis.spectra) + 2, rows, columns), dtype=np.float32)

    def take(top: int) -> None:
        block = slice(top, top + _ROWS_AT_ONCE)
        x, y = np.meshgrid(view.x_deg(), view.y_deg()[block])
        surfaces = _surfaces(scene, view.grid, basis, x, y)
        taken = _by_layer(surfaces, edges_dpt, complete, x.shape, len(basis.spectra))
        for k in np.flatnonzero(taken[:, -2].any(axis=(1, 2))):
            # Zeros that are never written take no memory.
            found[k, :, block] = taken[k]

    with ThreadPoolExecutor(min(8, os.cpu_count() or 1)) as pool:
        list(pool.map(take, range(0, rows, _ROWS_AT_ONCE)))
    if refinement > 1:
        rays_across = np.where(_has_edge(found[:, :-1]), refinement, 0)
        for item in scene.objects:
            _mark_outline(rays_across, item, view, refinement)
        for factor in np.unique(rays_across[rays_across > 0]):
            _refine(found, scene, view, basis, edges_dpt, complete, rays_across, int(factor))
    layers = []
    for colour, coverage, depth in ((f[:-2], f[-2], f[-1]) for f in found):
        total = float(coverage.sum(dtype=np.float64))
        if total > 0:
            mean = float(depth.sum(dtype=np.float64)) / total
            layers.append(Layer(mean, colour, coverage, depth))
    return layers


def _mark_outline(
    rays_across: np.ndarray, item: SceneObject, view: ViewGrid, refinement: int
) -> None:
    """Raise the refinement of samples along an object's outline to what its thickness needs."""
    x, y, _ = _outline(view.grid, item.shape, 256)
    if isinstance(item.shape, Mesh) or len(x) < 256:
        # An outline that passes behind the eye is large; neighbours show its edges.
        return
    width, height = view.pitch_deg
    column, row = x / width, -y / height
    area = 0.5 * abs(float(np.sum(column * np.roll(row, -1) - row * np.roll(column, -1))))
    steps = np.hypot(np.roll(column, -1) - column, np.roll(row, -1) - row)
    perimeter = float(np.sum(steps))
    thickness = 2.0 * area / perimeter if perimeter > 0 else 0.0
    if thickness > _THICK_SAMPLES:
        return
    dense = int(np.clip(4.0 * perimeter, 256, 1 << 18))
    x, y, _ = _outline(view.grid, item.shape, dense)
    column = np.floor((x - view.x_deg(0.0)[0]) / width).astype(int)
    row = np.floor((view.y_deg(0.0)[0] - y) / height).astype(int)
    rows, columns = view.shape
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    if not inside.any():
        return
    if thickness * _MAX_REFINEMENT < _RAYS_ACROSS_OBJECT / 16.0:
        raise InvalidInputError(
            f"object {item.name!r} is {thickness:.2g} samples of the view across, too small for "
            "PSF methods; make it larger and dimmer, use smaller pixels or more oversampling"
        )
    wanted = math.ceil(_RAYS_ACROSS_OBJECT / max(thickness, 1e-9))
    factor = min(max(refinement, wanted), _MAX_REFINEMENT)
    place = (row[inside], column[inside])
    rays_across[place] = np.maximum(rays_across[place], factor)


def _refine(
    found: np.ndarray,
    scene: Scene,
    view: ViewGrid,
    basis: SpectralBasis,
    edges_dpt: np.ndarray,
    complete: bool,
    rays_across: np.ndarray,
    refinement: int,
) -> None:
    """Replace samples that want so many rays across by means over `refinement`^2 rays."""
    row, column = np.nonzero(rays_across == refinement)
    offsets = (np.arange(refinement) + 0.5) / refinement
    offset_y, offset_x = (o.ravel() for o in np.meshgrid(offsets, offsets, indexing="ij"))
    samples = max(1, _RAYS_AT_ONCE // refinement**2)
    for first in range(0, len(row), samples):
        r, c = row[first : first + samples], column[first : first + samples]
        x = view.x_deg(0.0)[c] + offset_x[:, None] * view.pitch_deg[0]
        y = view.y_deg(0.0)[r] - offset_y[:, None] * view.pitch_deg[1]
        surfaces = _surfaces(scene, view.grid, basis, x, y)
        rays = _by_layer(surfaces, edges_dpt, complete, x.shape, len(basis.spectra))
        found[:, :, r, c] = rays.mean(axis=2)


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
        seen = vergence >= 0.0
        if seen.any():
            colour = np.zeros((*x.shape, coefficients.shape[1]))
            parts = (hits.distance_m, hits.u, hits.v, hits.is_front)
            colour[seen] = weights(item, Hits(*(part[seen] for part in parts))) @ coefficients
            surfaces.append((vergence, colour))
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
    first = np.full(shape, -1)
    nearest = np.full(shape, -1.0)
    for k, (vergence, _) in enumerate(surfaces):
        closer = _is_closer(vergence, nearest)
        nearest, first = np.where(closer, vergence, nearest), np.where(closer, k, first)
    ranges = [(float(v[v >= 0].min(initial=np.inf)), float(v.max())) for v, _ in surfaces]
    for i in range(count):
        best = np.full(shape, -1.0)
        for k, (vergence, tint) in enumerate(surfaces):
            if ranges[k][0] > edges_dpt[i + 1] or ranges[k][1] <= edges_dpt[i]:
                continue
            here = (vergence > edges_dpt[i]) & (vergence <= edges_dpt[i + 1])
            here &= _is_closer(vergence, best)
            if not complete:
                here &= first == k
            if here.any():
                best = np.where(here, vergence, best)
                result[i, :n_basis] = np.where(here, np.moveaxis(tint, -1, 0), result[i, :n_basis])
        covered = best >= 0.0
        result[i, n_basis] = covered
        result[i, n_basis + 1] = np.where(covered, best, 0.0)
    return result


def _is_closer(vergence: np.ndarray, best: np.ndarray) -> np.ndarray:
    """Where a surface lies before the best so far; of two in the same place the earlier counts."""
    return vergence > best + COINCIDENT * np.abs(best)


def blur_step_dpt(grid: RetinalGrid) -> float:
    """Change of vergence that widens the blur circle by one pixel: pixel angle / pupil diameter.

    Source: the rule N >= pupil (V_max - V_min) / pixel for layered depth of field.
    """
    pupil_m = grid.eye.entrance_pupil(grid.wavelength_nm).diameter_mm / MM_PER_M
    return math.radians(min(grid.pitch_deg)) / pupil_m

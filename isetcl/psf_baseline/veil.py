"""The veil of light that is scattered inside the eye, over a sharp view of the scene.

Scatter reaches from a tenth of a degree to all of the half space in front of the eye. Light from
within some degrees is convolved with the veil on a fine flat grid; light from farther away is
added source by source, with true angles between directions. The two parts are blended where both
are good. The veil knows neither depth nor wavelength, so that one serves all layers and
wavelengths; what is hidden from the middle of the pupil does not scatter.
"""

from __future__ import annotations

import math

import numpy as np

from isetcl.eye.field import direction_from_field
from isetcl.eye.people.scatter import ScatterModel, hankel, radial_kernel
from isetcl.psf_baseline.view import ViewGrid, take_layers
from isetcl.retina.grid import RetinalGrid
from isetcl.scene.basis import SpectralBasis
from isetcl.scene.model import Scene

_REACH_DEG = 8.0
_NEAR_PITCH_DEG = 0.025
_FAR_PITCH_DEG = 0.2
_FAR_BLOCK = 5  # samples of the far view across one source
_NODE_STEP_DEG = 2.0
_HALF_SPACE_DEG = 90.0
_PAIRS_AT_ONCE = 1 << 21


def veil(scene: Scene, view: ViewGrid, basis: SpectralBasis, model: ScatterModel) -> np.ndarray:
    """Scattered light at every sample of a view, in coefficients of the scene's spectra.

    Returns
    -------
    ndarray, (basis, rows, columns), float32
        Radiance whose image, added to the image of the unscattered share 1 - `model.fraction`, is
        the image with scatter.
    """
    return (_near(scene, view, basis, model) + _far(scene, view, basis, model)).astype(np.float32)


def _is_far(angle_deg: np.ndarray) -> np.ndarray:
    """The share of light from an angle that the far part takes: a smooth step, 0 to 1."""
    step = np.clip(2.0 * angle_deg / _REACH_DEG - 1.0, 0.0, 1.0)
    return step * step * (3.0 - 2.0 * step)


def _near(scene: Scene, view: ViewGrid, basis: SpectralBasis, model: ScatterModel) -> np.ndarray:
    """Light from within the reach, by convolution on a flat grid."""
    from scipy.ndimage import map_coordinates
    from scipy.signal import fftconvolve

    def psf(angle_deg: np.ndarray) -> np.ndarray:
        return model.psf_per_sr(angle_deg) * (1.0 - _is_far(angle_deg))

    pitch = max(_NEAR_PITCH_DEG, max(view.pitch_deg))
    half = max(np.ptp(view.x_deg()), np.ptp(view.y_deg())) / 2.0 + _REACH_DEG
    fine = _square_view(view.grid, pitch, math.ceil(half / pitch) + 2)
    colour = _visible(scene, fine, basis)
    kernel = radial_kernel(psf, pitch, _REACH_DEG)
    edges = np.geomspace(model.window_deg[0], max(_REACH_DEG, 2.0 * model.window_deg[0]), 257)
    # The flat grid is a little larger than the sphere: no light may be made of it.
    kernel *= hankel(psf, 0.0, edges) / kernel.sum()
    spread = fftconvolve(colour, kernel[None], mode="same", axes=(1, 2))
    column = (view.x_deg() - fine.x_deg()[0]) / pitch
    row = (fine.y_deg()[0] - view.y_deg()) / pitch
    places = np.meshgrid(row, column, indexing="ij")
    return np.stack([map_coordinates(plane, places, order=3) for plane in spread])


def _far(scene: Scene, view: ViewGrid, basis: SpectralBasis, model: ScatterModel) -> np.ndarray:
    """Light from beyond the reach: sources seen from a few nodes, and splines between those."""
    from scipy.interpolate import RectBivariateSpline

    directions, flux = _sources(scene, view.grid, basis)
    x, y = (_nodes(axis) for axis in (view.x_deg(), view.y_deg()))
    nodes = direction_from_field(*np.meshgrid(x, y)).reshape(-1, 3)
    light = np.zeros((len(nodes), flux.shape[1]))
    at_once = max(1, _PAIRS_AT_ONCE // max(1, len(flux)))
    for first in range(0, len(nodes), at_once):
        some = slice(first, first + at_once)
        angle = np.degrees(np.arccos(np.clip(nodes[some] @ directions.T, -1.0, 1.0)))
        light[some] = (model.psf_per_sr(angle) * _is_far(angle)) @ flux
    planes = light.T.reshape(-1, len(y), len(x))
    # Splines want ascending axes; y descends.
    splines = [RectBivariateSpline(y[::-1], x, plane[::-1], s=0) for plane in planes]
    return np.stack([spline(view.y_deg()[::-1], view.x_deg())[::-1] for spline in splines])


def _nodes(axis: np.ndarray) -> np.ndarray:
    """Evenly spaced angles over the range of an axis, in its own direction."""
    count = max(5, math.ceil(float(np.ptp(axis)) / _NODE_STEP_DEG) + 1)
    return np.linspace(axis[0], axis[-1], count)


def _sources(
    scene: Scene, grid: RetinalGrid, basis: SpectralBasis
) -> tuple[np.ndarray, np.ndarray]:
    """All light in front of the eye as small sources: directions (n, 3), flux (n, basis).

    The flux is radiance times solid angle. Each source lies in the middle of the light it stands
    for.
    """
    reach = _HALF_SPACE_DEG + max(abs(c) for c in grid.centre_deg)
    blocks = math.ceil(reach / (_FAR_PITCH_DEG * _FAR_BLOCK))
    margin = blocks * _FAR_BLOCK + (_FAR_BLOCK - 1) // 2
    wide = _square_view(grid, _FAR_PITCH_DEG, margin)
    colour = _visible(scene, wide, basis)
    x, y = np.meshgrid(wide.x_deg(), wide.y_deg())
    angle = np.radians(np.hypot(x, y))
    solid = math.radians(_FAR_PITCH_DEG) ** 2 * np.sinc(angle / np.pi)
    flux = colour * np.where(angle <= math.radians(_HALF_SPACE_DEG), solid, 0.0)
    weight = flux.sum(axis=0)
    total = _in_blocks(weight)
    lit = total > 0
    middle = [_in_blocks(weight * axis)[lit] / total[lit] for axis in (x, y)]
    return direction_from_field(*middle), np.stack([_in_blocks(f)[lit] for f in flux], axis=1)


def _in_blocks(values: np.ndarray) -> np.ndarray:
    """Sums over square blocks of samples."""
    n = len(values) // _FAR_BLOCK
    return np.asarray(values.reshape(n, _FAR_BLOCK, n, _FAR_BLOCK).sum(axis=(1, 3)))


def _square_view(grid: RetinalGrid, pitch_deg: float, margin: int) -> ViewGrid:
    """A square view about the middle of a grid, `margin` samples each way, of its own pitch."""
    one = RetinalGrid.of(grid.eye, pitch_deg, 1, grid.centre_deg)
    return ViewGrid(one, 1, margin)


def _visible(scene: Scene, view: ViewGrid, basis: SpectralBasis) -> np.ndarray:
    """What is seen along every sample, (basis, rows, columns)."""
    everything = np.array([-np.inf, np.inf])
    layers = take_layers(scene, view, basis, everything, complete=False)
    if not layers:
        return np.zeros((len(basis.spectra), *view.shape), dtype=np.float32)
    return layers[0].colour

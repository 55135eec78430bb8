"""Retinal images by PSF convolution: `isetcl.psf_baseline.render`.

Nothing here is shared with the ray-tracing renderer: PSFs come from the float64 tracer, views from
analytic intersections on the host, and every wavelength is computed by itself.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Sequence

import numpy as np

from isetcl.errors import InvalidInputError, check_choice, check_count
from isetcl.eye.model import Eye
from isetcl.eye.throughput import irradiance_per_radiance
from isetcl.psf_baseline.convolve import LayerSpectra, SpectralBlur
from isetcl.psf_baseline.methods import Method, methods
from isetcl.psf_baseline.psf import Psf, geometric_psf
from isetcl.psf_baseline.view import (
    Layer,
    Layers,
    ViewGrid,
    blur_step_dpt,
    layer_edges_dpt,
    take_layers,
)
from isetcl.retina.depth import vergence_map
from isetcl.retina.grid import RetinalGrid
from isetcl.retina.image import RetinalImage
from isetcl.scene.basis import spectral_basis
from isetcl.scene.model import Scene
from isetcl.spectrum import check_wavelengths, default_wavelengths_nm
from isetcl.version import __version__

PSF_KINDS = ("geometric",)

_SHIFT_TOLERANCE = 0.05


def render(
    scene: Scene,
    eye: Eye,
    *,
    method: str = "layered_sum",
    psf: str = "geometric",
    layers: Layers = "auto",
    fov_deg: float | tuple[float, float] = 10.0,
    resolution: int | tuple[int, int] = 256,
    centre_deg: tuple[float, float] = (0.0, 0.0),
    wavelengths_nm: np.ndarray | None = None,
    oversampling: int = 2,
    progress: Callable[[float], None] | None = None,
) -> RetinalImage:
    """The retinal image of a scene approximated by PSF convolution, in absolute units.

    One PSF per layer and wavelength, that of the middle of the field, serves the whole image.

    Parameters
    ----------
    scene, eye, fov_deg, resolution, centre_deg, wavelengths_nm
        As in `isetcl.render`; the image lies on the same grid.
    method
        One of `methods()`: ``"layered_sum"`` or ``"layered_over"``.
    psf
        ``"geometric"``: from the eye's own rays.
    layers
        Depth layers: ``"auto"`` (blur changes by less than a pixel inside a layer), a number, or
        edges in dioptres.
    oversampling
        Samples across a pixel in views and PSFs.
    progress
        Called with the fraction done after every wavelength.

    Returns
    -------
    RetinalImage
        With a standard error of zero: it has no noise, only bias.

    Raises
    ------
    InvalidInputError
        Before any work starts, if an argument breaks its rule.
    """
    start = time.perf_counter()
    chosen: Method = methods()[check_choice("method", method, methods())]
    check_choice("psf", psf, PSF_KINDS)
    check_count("oversampling", oversampling, 1, 8)
    grid = RetinalGrid.of(eye, fov_deg, resolution, centre_deg)
    wavelengths = check_wavelengths(
        default_wavelengths_nm() if wavelengths_nm is None else wavelengths_nm
    )
    basis = spectral_basis(scene, wavelengths)
    edges = layer_edges_dpt(scene, grid, layers, blur_step_dpt(grid))
    verges = _layer_vergences(scene, grid, edges)
    psfs = _all_psfs(grid, wavelengths, verges, oversampling)
    margin = _margin(grid, wavelengths, psfs, oversampling)
    view = ViewGrid(grid, oversampling, margin)
    taken = take_layers(scene, view, basis, edges, complete=chosen.needs_complete_layers)
    irradiance = np.zeros((len(wavelengths), *grid.shape), dtype=np.float32)
    if taken:
        taken_psfs = _matching(psfs, verges, taken, grid, wavelengths, oversampling)
        spectra = LayerSpectra(taken)
        for i, wavelength in enumerate(wavelengths):
            blur = SpectralBlur(spectra, taken_psfs[i])
            channels = chosen.combine(blur, len(taken))
            radiance = np.tensordot(basis.spectra[:, i].astype(np.float32), channels, axes=1)
            on_retina = _onto_retina(radiance, view, float(wavelength))
            irradiance[i] = on_retina * _throughput(grid, float(wavelength))
            if progress is not None:
                progress((i + 1) / len(wavelengths))
    details = {
        "method": method,
        "psf": psf,
        "version": __version__,
        "scene": scene.name,
        "scene_digest": scene.digest(),
        "layers_dpt": [layer.vergence_dpt for layer in taken],
        "oversampling": oversampling,
        "psf_energy_outside": max((p.energy_outside for row in psfs for p in row), default=0.0),
        "elapsed_s": time.perf_counter() - start,
    }
    return RetinalImage.from_arrays(
        grid,
        wavelengths,
        irradiance,
        vergence_dpt=vergence_map(scene, grid),
        provenance=details,
    )


def _layer_vergences(scene: Scene, grid: RetinalGrid, edges_dpt: np.ndarray) -> list[float]:
    """A vergence for every layer: its mean in a coarse view, or its middle if nothing is seen."""
    coarse = RetinalGrid.of(grid.eye, grid.fov_deg, (33, 33), grid.centre_deg)
    basis = spectral_basis(scene, np.array([grid.wavelength_nm]))
    verges = []
    for low, high in itertools.pairwise(edges_dpt):
        view = ViewGrid(coarse, 1, 0)
        layers = take_layers(scene, view, basis, np.array([low, high]), complete=True, refinement=1)
        verges.append(layers[0].vergence_dpt if layers else max(0.0, (low + high) / 2.0))
    return verges


def _all_psfs(
    grid: RetinalGrid, wavelengths_nm: np.ndarray, verges: Sequence[float], oversampling: int
) -> list[list[Psf]]:
    """PSFs for every wavelength and layer at the middle of the field."""
    width, height = grid.pitch_deg
    if abs(width / height - 1.0) > 1e-6:
        raise InvalidInputError(
            f"PSF methods need square pixels, got {width:g} by {height:g} deg; "
            "pass one number for fov_deg"
        )
    return [
        [
            geometric_psf(grid.eye, float(w), v, width / oversampling, grid.centre_deg)
            for v in verges
        ]
        for w in wavelengths_nm
    ]


def _matching(
    psfs: list[list[Psf]],
    verges: Sequence[float],
    taken: Sequence[Layer],
    grid: RetinalGrid,
    wavelengths_nm: np.ndarray,
    oversampling: int,
) -> list[list[Psf]]:
    """The PSFs of the layers that were found, in their order."""
    index = [int(np.argmin([abs(v - layer.vergence_dpt) for v in verges])) for layer in taken]
    return [[row[k] for k in index] for row in psfs]


def _margin(
    grid: RetinalGrid, wavelengths_nm: np.ndarray, psfs: list[list[Psf]], oversampling: int
) -> int:
    """Samples a view must reach beyond the image: the largest PSF and the lateral colour shift."""
    radius = max(psf.radius for row in psfs for psf in row)
    arc = float(grid.field_map.arc_mm(grid.limit_deg))
    shift = 0.0
    for wavelength in (wavelengths_nm[0], wavelengths_nm[-1]):
        own = grid.eye.field_map(float(wavelength))
        shift = max(shift, abs(float(own.field_deg(_within(arc, own))) - grid.limit_deg))
    return radius + int(np.ceil(shift / min(grid.pitch_deg) * oversampling)) + 2


def _within(arc_mm: np.ndarray | float, field_map: object) -> np.ndarray:
    from isetcl.eye.field import FieldMap

    assert isinstance(field_map, FieldMap)
    return np.minimum(arc_mm, float(field_map.arc_mm(field_map.max_field_deg)))


def _onto_retina(radiance: np.ndarray, view: ViewGrid, wavelength_nm: float) -> np.ndarray:
    """Blurred radiance at the retinal pixels: moved by lateral colour, averaged over samples.

    A retinal point receives another direction at each wavelength. The blurred view is looked up
    there, linearly between samples, and averaged over the samples of a pixel.
    """
    from scipy.ndimage import map_coordinates

    grid, n = view.grid, view.oversampling
    rows, columns = grid.shape
    inner = slice(view.margin, -view.margin) if view.margin else slice(None)
    x, y = view.x_deg()[inner], view.y_deg()[inner]
    own = grid.eye.field_map(wavelength_nm)
    field = np.linspace(0.0, grid.limit_deg, 65)
    seen = own.field_deg(_within(grid.field_map.arc_mm(field), own))
    ratio = np.ones_like(field)
    ratio[1:] = seen[1:] / field[1:]
    ratio[0] = ratio[1]
    if np.max(np.abs(seen - field)) > _SHIFT_TOLERANCE * view.pitch_deg[0]:
        scale = np.interp(np.hypot(x[None, :], y[:, None]), field, ratio)
        column = (x[None, :] * scale - view.x_deg()[0]) / view.pitch_deg[0]
        row = (view.y_deg()[0] - y[:, None] * scale) / view.pitch_deg[1]
        samples = map_coordinates(radiance, [row, column], order=1, mode="nearest")
    else:
        samples = radiance[inner, inner]
    return samples.reshape(rows, n, columns, n).mean(axis=(1, 3))


def _throughput(grid: RetinalGrid, wavelength_nm: float) -> np.ndarray:
    """Irradiance per unit radiance at every pixel, sr, (rows, columns)."""
    nodes = np.linspace(0.0, grid.limit_deg, 9)
    values = irradiance_per_radiance(grid.eye, wavelength_nm, grid.field_map, nodes)
    curve = np.polynomial.Polynomial.fit((nodes / grid.limit_deg) ** 2, values, 4)
    x, y = np.meshgrid(grid.x_deg, grid.y_deg)
    return np.asarray(curve((x * x + y * y) / grid.limit_deg**2))

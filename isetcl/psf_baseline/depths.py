"""Depth layers of an image, with a vergence that each is blurred for."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from isetcl.psf_baseline.bank import PsfBank
from isetcl.psf_baseline.on_retina import shift_deg
from isetcl.psf_baseline.psf import Psf
from isetcl.psf_baseline.view import (
    Layer,
    Layers,
    LayerSource,
    ViewGrid,
    blur_step_dpt,
    layer_edges_dpt,
    take_layers,
)
from isetcl.retina.grid import RetinalGrid
from isetcl.scene.basis import spectral_basis
from isetcl.scene.model import Scene

_MARGIN_ROUNDS = 4


@dataclass(frozen=True, eq=False)
class Depths:
    """Depth layers.

    Attributes
    ----------
    edges_dpt : ndarray, (n + 1,)
        Edges, far to near; the outer layers hold everything beyond.
    vergences_dpt : list of float
        What each is blurred for, 1/m.
    areas : list of float
        Visible area of each, in pixels of a coarse view.
    """

    edges_dpt: np.ndarray
    vergences_dpt: list[float]
    areas: list[float]

    @property
    def open_edges_dpt(self) -> np.ndarray:
        """The edges, the outer ones infinite."""
        edges = self.edges_dpt.copy()
        edges[0], edges[-1] = -np.inf, np.inf
        return edges

    def number_of(self, layer: Layer) -> int:
        """Which of the layers one is that was taken between the edges."""
        inner = self.edges_dpt[1:-1]
        return int(np.searchsorted(inner, layer.vergence_dpt, side="left"))


def plan_depths(
    scene: Scene | LayerSource,
    grid: RetinalGrid,
    layers: Layers,
    wavelengths_nm: np.ndarray,
    bank: PsfBank,
    bound: float,
) -> Depths:
    """The layers that an image needs.

    Blur brings light from beyond the borders into the image, so that the margin depends on the
    PSFs, those on the layers, and the layers on what lies in the margin.
    """
    reach = 0.0
    for _ in range(_MARGIN_ROUNDS):
        edges = layer_edges_dpt(scene, grid, layers, blur_step_dpt(grid), reach)
        verges, areas = (
            _vergences(scene, grid, edges)
            if isinstance(scene, Scene)
            else scene.vergences_between(edges)
        )
        psfs = [bank.over_depth(w, verges, grid.centre_deg, bound=bound) for w in wavelengths_nm]
        needed = margin(grid, wavelengths_nm, psfs) * bank.pitch_deg
        if needed <= reach:
            break
        reach = needed
    return Depths(edges, verges, areas)


def margin(grid: RetinalGrid, wavelengths_nm: np.ndarray, psfs: Sequence[Sequence[Psf]]) -> int:
    """Samples a view must reach beyond the image: the largest PSF and the lateral colour shift."""
    radius = max(psf.radius for row in psfs for psf in row)
    shift = max(shift_deg(grid, float(wavelengths_nm[i])) for i in (0, -1))
    return radius + int(np.ceil(shift / psfs[0][0].pitch_deg)) + 2


def _vergences(
    scene: Scene, grid: RetinalGrid, edges_dpt: np.ndarray
) -> tuple[list[float], list[float]]:
    """A vergence for every layer: its mean in a coarse view, or its middle if nothing is seen.

    Also how much of the coarse view shows each.
    """
    coarse = RetinalGrid.of(grid.eye, grid.fov_deg, (33, 33), grid.centre_deg)
    basis = spectral_basis(scene, np.array([grid.wavelength_nm]))
    view = ViewGrid(coarse, 1, 0)
    edges = edges_dpt.copy()
    edges[0] = edges[0] if edges[0] > 0 else -np.inf
    verges = [max(0.0, float(low + high) / 2.0) for low, high in itertools.pairwise(edges_dpt)]
    areas = [0.0] * len(verges)
    depths = Depths(edges_dpt, verges, areas)
    for complete in (True, False):
        for layer in take_layers(scene, view, basis, edges, complete=complete, refinement=1):
            if complete:
                verges[depths.number_of(layer)] = layer.vergence_dpt
            else:
                areas[depths.number_of(layer)] = float(layer.coverage.sum())
    return verges, areas

"""The image of a patch: its layers are taken, blurred at every wavelength and combined."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy import fft

from isetcl.eye.people.scatter import ScatterModel
from isetcl.psf_baseline.bank import PsfBank
from isetcl.psf_baseline.convolve import LayerSpectra, SpectralBlur
from isetcl.psf_baseline.depths import Depths, margin
from isetcl.psf_baseline.methods import Method
from isetcl.psf_baseline.on_retina import onto_retina
from isetcl.psf_baseline.patches import Patch
from isetcl.psf_baseline.picture_stack import PictureStack
from isetcl.psf_baseline.psf import Psf
from isetcl.psf_baseline.pupil import PupilOffsets, pupil_offsets
from isetcl.psf_baseline.slicing import closed, soft_slices
from isetcl.psf_baseline.transforms import SCIPY, WORKERS, RealFft
from isetcl.psf_baseline.veil import veil
from isetcl.psf_baseline.view import Layer, ViewGrid, take_layers
from isetcl.retina.grid import RetinalGrid
from isetcl.scene.basis import SpectralBasis
from isetcl.scene.model import Scene


@dataclass(frozen=True, eq=False)
class Job:
    """What all patches of an image share; see `render`."""

    scene: Scene | PictureStack
    grid: RetinalGrid
    wavelengths_nm: np.ndarray
    basis: SpectralBasis
    depths: Depths
    bank: PsfBank
    method: Method
    slicing: str
    oversampling: int
    pupil_samples: int | None
    scatter: ScatterModel | None
    depth_bound: float
    one_layer: int | None = None
    transforms: RealFft = SCIPY
    whole: tuple[ViewGrid, list[Layer]] | None = None

    def with_layers_of(self, patches: list[Patch], most_bytes: float) -> Job:
        """The job with the layers of the whole image taken, for patches that overlap.

        Unchanged where that would take more memory than is allowed.
        """
        reach = max(self.view(patch, self.psfs(patch)).margin for patch in patches)
        view = ViewGrid(self.grid, self.oversampling, reach)
        if self.needed_bytes(view) > most_bytes:
            return self
        return dataclasses.replace(self, whole=(view, self._taken(view)))

    def psfs(self, patch: Patch) -> list[list[Psf]]:
        """PSFs of a patch, by wavelength and layer."""
        rows = [
            self.bank.over_depth(
                float(w), self.depths.vergences_dpt, patch.field_deg, bound=self.depth_bound
            )
            for w in self.wavelengths_nm
        ]
        if self.one_layer is not None:
            rows = [[row[self.one_layer]] * len(row) for row in rows]
        return rows

    def view(self, patch: Patch, psfs: list[list[Psf]]) -> ViewGrid:
        """The samples that a patch needs."""
        grid = patch.grid(self.grid)
        return ViewGrid(grid, self.oversampling, margin(grid, self.wavelengths_nm, psfs))

    def reach_deg(self) -> float:
        """How far beyond the image its view reaches, for PSFs of its middle."""
        psfs = [
            self.bank.over_depth(
                float(w), self.depths.vergences_dpt, self.grid.centre_deg, bound=self.depth_bound
            )
            for w in self.wavelengths_nm
        ]
        return margin(self.grid, self.wavelengths_nm, psfs) * self.bank.pitch_deg

    def layers(self, view: ViewGrid) -> tuple[list[Layer], list[int]]:
        """The layers of a view as the method wants them, and their numbers."""
        complete = self.method.needs_complete_layers
        taken = self._taken(view) if self.whole is None else _part(*self.whole, view)
        numbers = [self.depths.number_of(layer) for layer in taken]
        taken = [
            dataclasses.replace(layer, vergence_dpt=self.depths.vergences_dpt[k])
            for layer, k in zip(taken, numbers, strict=True)
        ]
        if (self.method.slicing if self.slicing == "auto" else self.slicing) == "soft":
            taken = soft_slices(taken, complete=complete)
        if taken and not complete:
            taken = closed(taken)
        return taken, numbers

    def _taken(self, view: ViewGrid) -> list[Layer]:
        return take_layers(
            self.scene,
            view,
            self.basis,
            self.depths.open_edges_dpt,
            complete=self.method.needs_complete_layers,
        )

    def images(self, patch: Patch) -> Iterator[tuple[list[float], np.ndarray]]:
        """Vergences of the layers, and radiance on the retina, (rows, columns), by wavelength.

        Wavelengths are shared out among threads; a single one has all of them for its FFTs.
        """
        psfs = self.psfs(patch)
        view = self.view(patch, psfs)
        taken, numbers = self.layers(view)
        verges = [layer.vergence_dpt for layer in taken]
        spread = None
        if self.scatter is not None and isinstance(self.scene, Scene):
            spread = veil(self.scene, view, self.basis, self.scatter)
        same = all(row[k] is psfs[0][k] for row in psfs for k in range(len(row)))
        spectra = (
            LayerSpectra(taken, keep_transfers=same, transforms=self.transforms) if taken else None
        )

        def at(i: int) -> np.ndarray:
            wavelength = float(self.wavelengths_nm[i])
            mix = self.basis.spectra[:, i].astype(np.float32)
            radiance = np.zeros(view.shape, dtype=np.float32)
            if spectra is not None:
                pupil = self._pupil(patch, wavelength, verges)
                own = [psfs[i][k] for k in numbers]
                radiance = self.method.combine(SpectralBlur(spectra, own, pupil, mix), len(taken))[
                    0
                ]
            if self.scatter is not None and spread is not None:
                veiled = np.tensordot(mix, spread, axes=1)
                radiance = (1.0 - self.scatter.fraction) * radiance + veiled
            return onto_retina(radiance, view, wavelength, self.grid)

        count = len(self.wavelengths_nm)
        if count == 1 or WORKERS == 1:
            with fft.set_workers(WORKERS):
                yield from ((verges, at(i)) for i in range(count))
            return
        with ThreadPoolExecutor(min(WORKERS, count)) as pool:
            yield from ((verges, image) for image in pool.map(at, range(count)))

    def needed_bytes(self, view: ViewGrid) -> float:
        """Memory that a patch takes at its peak.

        A sample of the view takes a float for every layer and channel, as much for their
        transforms, and working space for every wavelength that is made at once.
        """
        n, basis = len(self.depths.vergences_dpt), len(self.basis.spectra)
        per_sample = 4 * n * (basis + 2) + 4 * n * (basis + 1) + 32 * (basis + 2)
        if self.method.slicing == "soft" or self.method.pupil_samples > 0:
            # Sliced copies of the layers, and sums over the pupil in double precision.
            per_sample += n * 12 * (basis + 1)
        per_sample += 32 * min(WORKERS, len(self.wavelengths_nm))
        return view.shape[0] * view.shape[1] * per_sample

    def _pupil(
        self, patch: Patch, wavelength_nm: float, vergences_dpt: list[float]
    ) -> PupilOffsets | None:
        """Rays through the pupil for methods that follow them."""
        if self.method.pupil_samples == 0:
            return None
        samples = self.method.pupil_samples if self.pupil_samples is None else self.pupil_samples
        return pupil_offsets(
            self.grid.eye,
            wavelength_nm,
            vergences_dpt,
            samples,
            rays_per_sample=self.method.rays_per_sample,
            field_deg=patch.field_deg,
        )


def _part(whole: ViewGrid, layers: list[Layer], view: ViewGrid) -> list[Layer]:
    """The layers of a view that lies within another, of samples in the same places."""
    width, height = whole.pitch_deg
    left = round((view.x_deg()[0] - whole.x_deg()[0]) / width)
    top = round((whole.y_deg()[0] - view.y_deg()[0]) / height)
    rows, columns = slice(top, top + view.shape[0]), slice(left, left + view.shape[1])
    parts = []
    for layer in layers:
        coverage = layer.coverage[rows, columns]
        if coverage.any():
            depth = None if layer.depth is None else layer.depth[rows, columns]
            colour = layer.colour[:, rows, columns]
            parts.append(Layer(layer.vergence_dpt, colour, coverage, depth))
    return parts

"""Convolution of layers with PSFs by real FFTs, every transform made once."""

from __future__ import annotations

import functools
import threading
from collections.abc import Sequence

import numpy as np
from scipy import fft

from isetcl.errors import InvalidInputError
from isetcl.psf_baseline.psf import Psf
from isetcl.psf_baseline.pupil import PupilOffsets
from isetcl.psf_baseline.transforms import SCIPY, WORKERS, RealFft
from isetcl.psf_baseline.view import Layer

_BOX_GRAIN = 32  # samples by which the room around a layer's box grows
_BOX_SHARE = 0.7  # a box is used if its transform is smaller than this part of the view's
_SYMMETRY = 1e-7


class LayerSpectra:
    """Fourier transforms of all layers, shared by all wavelengths.

    The views reach beyond the image by more than the PSFs do, so the cyclic convolution is right
    on the image. Transforms that no method asks for are not made. Threads may share it.

    Parameters
    ----------
    layers
        Far to near, all of one shape.
    keep_transfers
        Whether transforms of PSFs are kept too, for PSFs that serve all wavelengths.
    transforms
        Who makes the transforms.
    """

    def __init__(
        self,
        layers: Sequence[Layer],
        *,
        keep_transfers: bool = False,
        transforms: RealFft = SCIPY,
    ) -> None:
        self.fft = transforms
        self.layers = layers
        self.shape = layers[0].coverage.shape
        self.size = _good_size(self.shape)
        self.keep_transfers = keep_transfers
        self.lock = threading.RLock()
        self.transfers: dict[tuple[int, tuple[int, int]], np.ndarray] = {}
        self._known: dict[tuple[str, int, int], np.ndarray] = {}
        self._boxes = [_Box.around(layer.coverage) for layer in layers]
        self.is_full = [bool(layer.coverage.min() >= 1.0) for layer in layers]

    def colour(self, k: int) -> np.ndarray:
        """Transform of layer k's colour, (basis, rows, frequencies)."""
        return self._once("colour", k, 0, lambda: self._transform(self.layers[k].colour))

    def coverage(self, k: int) -> np.ndarray:
        """Transform of layer k's coverage, (rows, frequencies)."""
        return self._once("coverage", k, 0, lambda: self._transform(self.layers[k].coverage))

    def scene(self) -> np.ndarray:
        """Transform of all layers' colours, added, (basis, rows, frequencies)."""
        return self._once(
            "scene",
            0,
            0,
            lambda: self._transform(np.sum([layer.colour for layer in self.layers], axis=0)),
        )

    def coverage_behind(self, k: int) -> np.ndarray:
        """Transform of the coverage of layers 0 to k, added, (rows, frequencies)."""
        if k == 0:
            return self.coverage(0)
        return self._once("behind", k, 0, lambda: self.coverage(k) + self.coverage_behind(k - 1))

    def box(self, k: int, radius: int) -> tuple[_Box, tuple[int, int]] | None:
        """The part of the view that a blurred layer covers, and the size of its transform.

        None where the whole view is as good, and where devices make the transforms, for which
        every size costs a plan.
        """
        if self.fft is not SCIPY:
            return None
        room = -(-radius // _BOX_GRAIN) * _BOX_GRAIN
        box = self._boxes[k].grown(room, self.shape)
        size = _good_size((box.rows.stop - box.rows.start + room, box.width + room))
        if size[0] * size[1] > _BOX_SHARE * self.size[0] * self.size[1]:
            return None
        return box, size

    def in_box(self, what: str, k: int, box: _Box, size: tuple[int, int]) -> np.ndarray:
        """Transform of layer k's "colour" or "coverage" in a box."""
        image = getattr(self.layers[k], what)[..., box.rows, box.columns]
        return self._once(what, k, size[0] << 20 | size[1], lambda: self.fft.rfft2(image, size))

    def _transform(self, image: np.ndarray) -> np.ndarray:
        with fft.set_workers(WORKERS):
            return self.fft.rfft2(image, self.size)

    def _once(self, what: str, k: int, size: int, make) -> np.ndarray:  # type: ignore[no-untyped-def]
        key = (what, k, size)
        if key not in self._known:
            with self.lock:
                if key not in self._known:
                    self._known[key] = make()
        return self._known[key]


class _Box:
    """Rows and columns of a view."""

    def __init__(self, rows: slice, columns: slice) -> None:
        self.rows, self.columns = rows, columns
        self.width = columns.stop - columns.start

    @classmethod
    def around(cls, coverage: np.ndarray) -> _Box:
        """The smallest box that holds all that is covered."""
        ends = []
        for axis in (1, 0):
            found = np.flatnonzero(coverage.any(axis=axis))
            ends.append(slice(int(found[0]), int(found[-1]) + 1) if len(found) else slice(0, 1))
        return cls(*ends)

    def grown(self, room: int, shape: tuple[int, int]) -> _Box:
        """The box with room around it, as far as the view goes."""
        return _Box(
            *(
                slice(max(0, s.start - room), min(n, s.stop + room))
                for s, n in zip((self.rows, self.columns), shape, strict=True)
            )
        )


class SpectralBlur:
    """Blurred layers at one wavelength: the `Blur` that methods combine.

    Parameters
    ----------
    spectra
        Transforms of the layers.
    psfs
        One for every layer, all of one pitch.
    pupil
        Where rays of every layer land, for methods that follow them.
    mix
        Radiance of every spectrum of the basis at this wavelength, (basis,): colours are mixed by
        it before they are blurred, and there is one channel. None keeps the basis.
    """

    def __init__(
        self,
        spectra: LayerSpectra,
        psfs: Sequence[Psf],
        pupil: PupilOffsets | None = None,
        mix: np.ndarray | None = None,
    ) -> None:
        self._spectra = spectra
        self._pitch_deg = psfs[0].pitch_deg
        self._psfs = psfs
        self._pupil = pupil
        self._mix = None if mix is None else np.asarray(mix, dtype=np.float32)
        self._layers: Sequence[Layer] | None = None
        for psf in psfs:
            if 2 * psf.radius + 1 > min(spectra.size):
                raise InvalidInputError(
                    f"the PSF is {2 * psf.radius + 1} samples wide, more than the "
                    f"{min(spectra.size)} of the view; pad the view (with its mirror image, zeros "
                    "or its border), or use a smaller PSF"
                )

    @property
    def layers(self) -> Sequence[Layer]:
        """See `Blur`."""
        if self._mix is None:
            return self._spectra.layers
        if self._layers is None:
            self._layers = [
                Layer(x.vergence_dpt, self._mixed(x.colour), x.coverage, x.depth)
                for x in self._spectra.layers
            ]
        return self._layers

    def colour(self, layer: int) -> np.ndarray:
        """See `Blur`."""
        if self._psfs[layer].radius == 0 and self._psfs[layer].energy_outside <= 0.0:
            return self._mixed(self._spectra.layers[layer].colour)
        return self._blurred("colour", layer)

    def coverage(self, layer: int) -> np.ndarray:
        """See `Blur`."""
        if self._spectra.is_full[layer]:
            return np.ones(self._spectra.shape, dtype=np.float32)
        if self._psfs[layer].radius == 0 and self._psfs[layer].energy_outside <= 0.0:
            return self._spectra.layers[layer].coverage
        return self._blurred("coverage", layer)

    def total(self, layers: Sequence[int]) -> np.ndarray:
        """See `Blur`; added before the inverse transform, of which one serves all."""
        spectrum: np.ndarray | None = None
        for k in layers:
            part = self._transfer(k) * self._spectra_mixed(k)
            spectrum = part if spectrum is None else np.add(spectrum, part, out=spectrum)
        assert spectrum is not None
        return self._scaled(self.image(spectrum))

    def scene(self, layer: int) -> np.ndarray:
        """See `Blur`."""
        return self.image(self._transfer(layer) * self._mixed(self._spectra.scene()))

    def coverage_behind(self, layer: int) -> np.ndarray:
        """See `Blur`."""
        return self.image(self._transfer(layer) * self._spectra.coverage_behind(layer))

    def pupil_shifts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """See `Blur`."""
        if self._pupil is None:
            raise InvalidInputError(
                "this method needs PupilOffsets for its layers, got none; see pupil_offsets"
            )
        if len(self._pupil.vergences_dpt) != len(self.layers):
            raise InvalidInputError(
                f"PupilOffsets must have one vergence for each of the {len(self.layers)} layers, "
                f"got {len(self._pupil.vergences_dpt)}"
            )
        # Rows count downwards.
        columns, rows = self._pupil.x_deg / self._pitch_deg, -self._pupil.y_deg / self._pitch_deg
        return columns, rows, self._pupil.weights

    def image(self, spectrum: np.ndarray) -> np.ndarray:
        """See `Blur`."""
        rows, columns = self._spectra.shape
        # Threads belong to wavelengths.
        image = self._spectra.fft.irfft2(spectrum, self._spectra.size)
        return np.asarray(image[..., :rows, :columns])

    def layer_spectrum(self, layer: int) -> np.ndarray:
        """See `Blur`."""
        return self._mixed(self._spectra.colour(layer))

    def coverage_spectrum(self, layer: int) -> np.ndarray:
        """See `Blur`."""
        return self._spectra.coverage(layer)

    def points_transfer(
        self, columns: np.ndarray, rows: np.ndarray, weights: np.ndarray
    ) -> np.ndarray:
        """See `Blur`."""
        height, width = self._spectra.size
        left, top = np.floor(columns).astype(int), np.floor(rows).astype(int)
        right, low = columns - left, rows - top
        kernel = np.zeros(height * width)
        for down, share_y in ((0, 1.0 - low), (1, low)):
            for across, share_x in ((0, 1.0 - right), (1, right)):
                place = (top + down) % height * width + (left + across) % width
                np.add.at(kernel, place, weights * share_x * share_y)
        image = kernel.reshape(height, width).astype(np.float32)
        return self._spectra.fft.rfft2(image, self._spectra.size)

    def _blurred(self, what: str, layer: int) -> np.ndarray:
        """Blurred "colour" or "coverage" of a layer, in the part of the view that it reaches."""
        psf, spectra = self._psfs[layer], self._spectra
        found = spectra.box(layer, psf.radius)
        if found is None:
            whole = self._spectra_mixed(layer) if what == "colour" else spectra.coverage(layer)
            image = self.image(self._transfer(layer) * whole)
            return self._scaled(image) if what == "colour" else image
        box, size = found
        spectrum = spectra.in_box(what, layer, box, size)
        if what == "colour":
            spectrum = self._mixed(spectrum)
        small = spectra.fft.irfft2(self._transform(psf, size) * spectrum, size)
        height = box.rows.stop - box.rows.start
        image = np.zeros((*small.shape[:-2], *spectra.shape), dtype=np.float32)
        image[..., box.rows, box.columns] = small[..., :height, : box.width]
        if psf.energy_outside > 0.0:
            # The light of the layer, spread over the view.
            light = spectrum[..., 0, 0].real * psf.energy_outside / np.prod(spectra.shape)
            image += light[..., None, None].astype(np.float32)
        return image

    def _mixed(self, colours: np.ndarray) -> np.ndarray:
        """One channel of (basis, ...), as this wavelength has it."""
        if self._mix is None:
            return colours
        if len(self._mix) == 1:
            return colours * self._mix[0]
        return np.tensordot(self._mix, colours, axes=1)[None]

    def _spectra_mixed(self, layer: int) -> np.ndarray:
        """As `layer_spectrum`; one spectrum is scaled only in the image, by `_scaled`."""
        if self._mix is not None and len(self._mix) == 1:
            return self._spectra.colour(layer)
        return self._mixed(self._spectra.colour(layer))

    def _scaled(self, image: np.ndarray) -> np.ndarray:
        if self._mix is not None and len(self._mix) == 1:
            image *= self._mix[0]
        return image

    def _transfer(self, layer: int) -> np.ndarray:
        """Transform of a layer's PSF in the whole view, with what it leaves out spread evenly."""
        psf, spectra = self._psfs[layer], self._spectra
        transfer = self._transform(psf, spectra.size)
        if psf.energy_outside > 0.0:
            area = spectra.size[0] * spectra.size[1] / (spectra.shape[0] * spectra.shape[1])
            transfer = transfer.copy() if spectra.keep_transfers else transfer
            transfer[0, 0] += psf.energy_outside * area
        return transfer

    def _transform(self, psf: Psf, size: tuple[int, int]) -> np.ndarray:
        if not self._spectra.keep_transfers:
            return transfer_of(psf.kernel, size)
        key = (id(psf), size)
        with self._spectra.lock:
            if key not in self._spectra.transfers:
                self._spectra.transfers[key] = transfer_of(psf.kernel, size)
            return self._spectra.transfers[key]


def transfer_of(kernel: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Transform of a kernel with its middle at the origin, (rows, columns // 2 + 1), single.

    Real where the kernel is its own mirror image both ways: then it is a product of three small
    matrices of cosines. Otherwise the rows that hold nothing are left out of the first FFTs.
    """
    rows, columns = size
    half = kernel.shape[0] // 2
    tolerance = _SYMMETRY * float(kernel.max())
    if (
        np.abs(kernel - kernel[::-1]).max() <= tolerance
        and np.abs(kernel - kernel[:, ::-1]).max() <= tolerance
    ):
        quarter = kernel[half:, half:].copy()
        quarter[1:] *= 2.0
        quarter[:, 1:] *= 2.0
        upper = _cosines(rows, half) @ quarter.astype(np.float32) @ _cosines(columns, half).T
        return np.concatenate([upper, upper[(rows - 1) // 2 : 0 : -1]])
    strip = np.zeros((kernel.shape[0], columns), dtype=np.float32)
    strip[:, : kernel.shape[0]] = kernel
    lines = fft.rfft(np.roll(strip, -half, axis=1), axis=1)
    spectrum = np.zeros((rows, columns // 2 + 1), dtype=np.complex64)
    spectrum[: half + 1] = lines[half:]
    if half > 0:
        spectrum[-half:] = lines[:half]
    return np.asarray(fft.fft(spectrum, axis=0, overwrite_x=True))


@functools.lru_cache(maxsize=32)
def _cosines(size: int, half: int) -> np.ndarray:
    """cos(2 pi i j / size) for frequencies 0 to size / 2 and samples 0 to half, single."""
    phase = np.outer(np.arange(size // 2 + 1), np.arange(half + 1)) % size
    return np.cos(2.0 * np.pi / size * phase).astype(np.float32)


def _good_size(shape: Sequence[int]) -> tuple[int, int]:
    return (
        fft.next_fast_len(int(shape[0]), real=True),
        fft.next_fast_len(int(shape[1]), real=True),
    )

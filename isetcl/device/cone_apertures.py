"""What receptors catch of a spectral image, on an OpenCL device; see cone_excitations.cl."""

from __future__ import annotations

import numpy as np

from isetcl.device import program
from isetcl.device.devices import Device
from isetcl.device.layout import Precision, real_dtype

GAUSSIAN_REACH = 2.6
"""1/e radii at which a Gaussian aperture is cut off: 0.02 % of its light along an axis is lost."""

_MOST_RECEPTORS = 1 << 18
_MOST_FRAMES = 1 << 10
_BLOCK = 8


class ApertureSums:
    """An image on a device, and the receptors that look at it.

    Parameters
    ----------
    device, precision
        Where and how to compute.
    irradiance
        (wavelengths, rows, columns).
    is_gaussian
        Whether apertures are Gaussians, whose size is the 1/e radius, and not discs.
    """

    def __init__(
        self,
        device: Device,
        irradiance: np.ndarray,
        *,
        is_gaussian: bool = False,
        precision: Precision = "single",
    ) -> None:
        device.check_precision(precision)
        self._device = device
        self._real = real_dtype(precision)
        self._blocks = -(-irradiance.shape[0] // _BLOCK)
        self._shape = irradiance.shape[1:]
        defines = device.defines(precision, 1)
        defines |= {"BLOCKS": self._blocks, "HAS_GAUSSIAN": int(is_gaussian)}
        source = program.assemble("cone_excitations.cl", defines)
        self._kernel = program.kernel(device, source, "cone_excitations")
        waves = np.zeros((*self._shape, self._blocks * _BLOCK), dtype=self._real)
        waves[..., : irradiance.shape[0]] = np.moveaxis(irradiance, 0, -1)
        self._image = device.upload(waves)

    def run(self, apertures: np.ndarray, efficiency: np.ndarray, shifts: np.ndarray) -> np.ndarray:
        """Excitations, (frames, receptors), float64 in double and float32 in single precision.

        Parameters
        ----------
        apertures
            (receptors, 4): column and row of the middle, semi-axes; pixels from the image's corner.
        efficiency
            (receptors, wavelengths): excitations per unit of irradiance.
        shifts
            (frames, 2): columns and rows by which the receptors move over the image.
        """
        result = np.empty((len(shifts), len(apertures)), dtype=self._real)
        for first in range(0, len(apertures), _MOST_RECEPTORS):
            part = slice(first, first + _MOST_RECEPTORS)
            for frame in range(0, len(shifts), _MOST_FRAMES):
                frames = slice(frame, frame + _MOST_FRAMES)
                result[frames, part] = self._run(apertures[part], efficiency[part], shifts[frames])
        return result

    def _run(self, apertures: np.ndarray, efficiency: np.ndarray, shifts: np.ndarray) -> np.ndarray:
        import pyopencl as cl

        device, n = self._device, len(apertures)
        padded = np.zeros((n, self._blocks * _BLOCK), dtype=self._real)
        padded[:, : efficiency.shape[1]] = efficiency
        output = device.allocate(len(shifts) * n, self._real)
        # An OpenCL kernel does not keep its buffers alive.
        inputs = [
            device.upload(np.ascontiguousarray(each, dtype=self._real))
            for each in (apertures, padded, shifts)
        ]
        size = (np.int32(self._shape[0]), np.int32(self._shape[1]))
        self._kernel.set_args(self._image, *size, *inputs, np.int32(n), output)
        local = device.work_group_size
        items = (-(-n // local) * local, len(shifts))
        cl.enqueue_nd_range_kernel(device.queue, self._kernel, items, (local, 1))
        found = np.empty((len(shifts), n), dtype=self._real)
        cl.enqueue_copy(device.queue, found, output)
        return found

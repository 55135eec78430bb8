"""Fourier transforms on an OpenCL device, by VkFFT: what PSF methods take as `fft=`.

Images come from the host and go back to it; plans are kept by shape.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from typing import Any

import numpy as np

from isetcl.device.choose import find_device
from isetcl.device.devices import Device
from isetcl.errors import DeviceError

_MOST_PLANS = 64
_REMEDY = (
    'pip install "isetcl[gpu-fft]" (VkFFT is compiled as it is installed: that takes a C++ '
    "compiler and the headers and library of OpenCL, `apt install g++ ocl-icd-opencl-dev`), or "
    "use fft='scipy'"
)


class DeviceFft:
    """Transforms of real images over their last two axes on a device, in single precision.

    As `isetcl.psf_baseline.transforms.RealFft` asks for. Threads may share it; the device does one
    transform after another.

    Parameters
    ----------
    device
        Where.
    app
        VkFFT's class of plans.
    """

    def __init__(self, device: Device, app: Any) -> None:
        self.device = device
        self._app = app
        self._plans: OrderedDict[tuple[int, ...], Any] = OrderedDict()
        self._lock = threading.Lock()

    def rfft2(self, image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
        """Transform with zeros up to a size, (..., rows, columns // 2 + 1), complex64."""
        rows, columns = size
        planes = image.reshape(-1, *image.shape[-2:])
        padded = np.zeros((len(planes), rows, columns), dtype=np.float32)
        padded[:, : planes.shape[1], : planes.shape[2]] = planes
        found = self._run(padded, (len(planes), rows, columns // 2 + 1), True)
        return found.reshape(*image.shape[:-2], *found.shape[-2:])

    def irfft2(self, spectrum: np.ndarray, size: tuple[int, int]) -> np.ndarray:
        """The image of a size whose transform this is, float32."""
        planes = spectrum.reshape(-1, *spectrum.shape[-2:])
        packed = np.ascontiguousarray(planes, dtype=np.complex64)
        found = self._run(packed, (len(planes), *size), False)
        return found.reshape(*spectrum.shape[:-2], *size)

    def __str__(self) -> str:
        return f"VkFFT on {self.device.name}"

    def _run(self, values: np.ndarray, shape: tuple[int, ...], is_forward: bool) -> np.ndarray:
        import pyopencl.array as on_device

        queue = self.device.queue
        with self._lock:
            plan = self._plan(values.shape if is_forward else shape)
            source = on_device.to_device(queue, values)
            target = on_device.empty(queue, shape, np.float32 if not is_forward else np.complex64)
            if is_forward:
                plan.fft(source, target)
            else:
                # The copy on the device may be overwritten.
                plan.ifft(source, target)
            return np.asarray(target.get())

    def _plan(self, shape: tuple[int, ...]) -> Any:
        """The plan for real images of a shape, (images, rows, columns)."""
        if shape not in self._plans:
            self._plans[shape] = self._app(
                shape, np.float32, self.device.queue, ndim=2, inplace=False, norm=1, r2c=True
            )
            if len(self._plans) > _MOST_PLANS:
                self._plans.popitem(last=False)
        self._plans.move_to_end(shape)
        return self._plans[shape]


def device_fft(device: str | None = None) -> DeviceFft:
    """Fourier transforms on an OpenCL device, for ``psf_baseline.render(..., fft=device_fft())``.

    They are made by VkFFT (D. Tolmachev, IEEE Access 2023) through pyvkfft, the extra ``gpu-fft``
    of this package. The first of every size is compiled, which takes from a part of a second on
    GPUs to seconds on processors.

    Parameters
    ----------
    device
        As `find_device` takes it.

    Raises
    ------
    DeviceError
        If pyvkfft is not installed or finds no OpenCL library, or there is no such device.
    """
    try:
        from pyvkfft.opencl import VkFFTApp
    except (ImportError, OSError) as error:
        raise DeviceError(
            f"device_fft needs pyvkfft for OpenCL, which cannot be imported ({error}); {_REMEDY}"
        ) from None
    return DeviceFft(find_device(device), VkFFTApp)

"""Huygens' point spread function on an OpenCL device: the sum over all samples of a wavefront."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from isetcl.device import program
from isetcl.device.choose import find_device
from isetcl.device.devices import Device
from isetcl.device.layout import Precision, real_dtype
from isetcl.errors import check_type
from isetcl.eye.waves import diffraction_psf
from isetcl.eye.waves.diffraction_psf import DiffractionPsf
from isetcl.eye.waves.wavefront import Wavefront

_PARTS = 8
"""Sums of each point, added on the host: more work-items for GPUs, and less rounding in float32."""

_WANTED_WAVES: dict[Precision, float] = {"single": 1e-8, "double": 1e-13}
_MOST_TERMS = 8


def huygens_psf(
    front: Wavefront,
    fov_arcmin: float = 20.0,
    resolution: int = 256,
    *,
    device: str | None = None,
    precision: Precision = "double",
) -> DiffractionPsf:
    """The point spread function by Huygens' principle, computed by an OpenCL kernel.

    The same as ``front.psf(fov_arcmin, resolution, "huygens")``, many times as fast.

    Parameters
    ----------
    front
        The wavefront; see `Eye.wavefront`.
    fov_arcmin
        Width of the square on the retina, arcmin of visual angle.
    resolution
        Samples across it.
    device
        As `find_device` takes it.
    precision
        ``"double"`` (1e-10 of the peak from the host) or ``"single"`` (1e-4).

    Raises
    ------
    InvalidInputError
        If the samples are too few for the aberrations or for this width.
    DeviceError
        If there is no device, or it lacks the precision.
    """
    check_type("front", front, Wavefront, "pass what Eye.wavefront returns")
    v = diffraction_psf.visual_angles_deg(front, fov_arcmin, resolution)
    wave = HuygensSum(find_device(device), front, v, -v, precision).run()
    return diffraction_psf.from_amplitude(front, wave, v)


class HuygensSum:
    """One prepared sum of spherical waves on a device.

    Parameters
    ----------
    device, precision
        Where and how to compute.
    front
        The wavefront.
    x_deg, y_deg
        Visual angles of the columns and rows of image points, degrees.
    """

    def __init__(
        self,
        device: Device,
        front: Wavefront,
        x_deg: np.ndarray,
        y_deg: np.ndarray,
        precision: Precision = "double",
    ) -> None:
        device.check_precision(precision)
        self._device = device
        self._real = real_dtype(precision)
        self._shape = (len(y_deg), len(x_deg))
        self._step_cpd = front.step_cpd
        waves = _Waves.of(front, x_deg, y_deg)
        series = waves.series(_WANTED_WAVES[precision])
        defines = device.defines(precision) | {"ORDER": series.shape[1]}
        self._width = defines["WIDTH"]
        source = program.assemble("huygens.cl", defines)
        self._kernel = program.kernel(device, source, "huygens")
        self._upload(waves, series)

    def _upload(self, waves: _Waves, series: np.ndarray) -> None:
        """Copy samples and points to the device; the last point fills the last lanes."""
        import pyopencl as cl

        count = waves.points.shape[1]
        step = self._width * (1 if self._device.is_cpu else self._device.work_group_size)
        self._padded = -(-count // step) * step
        points = np.pad(waves.points, ((0, 0), (0, self._padded - count)), mode="edge")
        n_samples = len(waves.samples)
        self._result = np.empty((_PARTS, 2, self._padded), dtype=self._real)

        def copied(values: np.ndarray) -> cl.Buffer:
            return self._device.upload(np.asarray(values, dtype=self._real))

        self._output = self._device.allocate(self._result.size, self._real)
        self._arguments = (
            copied(waves.samples),
            np.int32(n_samples),
            np.int32(-(-n_samples // _PARTS)),
            copied(points),
            np.int32(self._padded),
            self._real.type(waves.bend),
            copied(series if series.size else np.zeros(1)),
            self._output,
        )

    def run(self) -> np.ndarray:
        """Complex amplitude at the image points, (rows, columns); see `diffraction_psf.huygens`."""
        import pyopencl as cl

        queue = self._device.queue
        self._kernel.set_args(*self._arguments)
        local = 1 if self._device.is_cpu else self._device.work_group_size
        size = (self._padded // self._width, _PARTS)
        cl.enqueue_nd_range_kernel(queue, self._kernel, size, (local, 1))
        cl.enqueue_copy(queue, self._result, self._output)
        total = self._result.astype(np.float64).sum(axis=0)[:, : math.prod(self._shape)]
        return np.asarray((total[0] + 1j * total[1]).reshape(self._shape) * self._step_cpd)


@dataclass(frozen=True, eq=False)
class _Waves:
    """Samples and image points in the units of the kernel; see huygens.cl."""

    samples: np.ndarray
    points: np.ndarray
    bend: float
    largest: float

    @classmethod
    def of(cls, front: Wavefront, x_deg: np.ndarray, y_deg: np.ndarray) -> _Waves:
        used = front.inside
        x, y = np.meshgrid(front.x_cpd, front.y_cpd)
        phase = -front.opd_waves[used]
        # Whole waves are taken away in float64: what is left is small in any precision.
        samples = np.stack([x[used], y[used], phase - np.rint(phase), front.amplitude[used]], 1)
        per_mm = front.vitreous_index / (front.wavelength_nm * 1e-6)
        columns, rows = np.meshgrid(x_deg, y_deg)
        angles = np.stack([columns.ravel(), rows.ravel()])
        place = front.mm_per_deg.T @ angles
        own = np.sum(place**2, axis=0) * per_mm / (2.0 * front.radius_mm)
        reach = np.max(np.hypot(x[used], y[used])) * np.max(np.hypot(*angles)) + np.max(own)
        bend = 2.0 / (per_mm * front.radius_mm)
        return cls(samples, np.concatenate([angles, own[None]]), bend, float(reach))

    def series(self, wanted_waves: float) -> np.ndarray:
        """Coefficients of the way and the strength from t on, (2, terms); (2, 0) asks for roots.

        2 / (1 + sqrt(1 + t)) = 2 (sqrt(1 + t) - 1) / t has 2 binom(1/2, k + 1), and
        1 / sqrt(1 + t) has binom(-1/2, k). All are < 1, so that the first one left out bounds the
        error.
        """
        from scipy.special import binom

        t = self.largest * self.bend
        for terms in range(1, _MOST_TERMS + 1):
            if t < 0.1 and max(self.largest, 1.0) * t ** (terms + 1) < wanted_waves:
                k = np.arange(1, terms + 1)
                return np.stack([2.0 * binom(0.5, k + 1), binom(-0.5, k)])
        return np.empty((2, 0))

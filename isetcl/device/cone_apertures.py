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
_TILE = 32  # pixels
_LANES = {"single": 16, "double": 8}


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
        waves = irradiance.shape[0]
        self._blocks = -(-waves // _BLOCK)
        self._shape = irradiance.shape[1:]
        self._lanes = 1 if device.vector_width(precision) == 1 else _LANES[precision]
        defines = device.defines(precision, self._lanes)
        defines |= {"BLOCKS": self._blocks, "HAS_GAUSSIAN": int(is_gaussian)}
        source = program.assemble("cone_excitations.cl", defines)
        self._kernel = program.kernel(device, source, "cone_excitations")
        pixels = np.empty((*self._shape, self._blocks * _BLOCK), dtype=self._real)
        pixels[..., :waves] = np.moveaxis(irradiance, 0, -1)
        pixels[..., waves:] = 0
        self._image = device.upload(pixels)

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
        window = 2.0 * np.median(apertures[:, 2:], axis=0) + 1.0
        for frame in range(0, len(shifts), _MOST_FRAMES):
            frames = slice(frame, frame + _MOST_FRAMES)
            groups = frame_groups(shifts[frames], window, self._lanes)
            for first in range(0, len(apertures), _MOST_RECEPTORS):
                part = slice(first, first + _MOST_RECEPTORS)
                self._run(
                    apertures[part], efficiency[part], shifts[frames], groups, result[frames, part]
                )
        return result

    def _run(
        self,
        apertures: np.ndarray,
        efficiency: np.ndarray,
        shifts: np.ndarray,
        groups: list[np.ndarray],
        result: np.ndarray,
    ) -> None:
        """Fill `result` (frames, receptors), a view or an array of its own."""
        import pyopencl as cl

        device, n = self._device, len(apertures)
        padded = np.zeros((n, self._blocks * _BLOCK), dtype=self._real)
        padded[:, : efficiency.shape[1]] = efficiency
        corners = np.floor(apertures[:, :2])
        rests = np.concatenate([apertures[:, :2] - corners, apertures[:, 2:]], axis=1)
        places = (rests.astype(self._real), corners.astype(np.int32), padded)
        output = device.allocate(result.size, self._real)
        # An OpenCL kernel does not keep its buffers alive.
        lanes = self._lanes_of(groups, shifts)
        inputs = [device.upload(each) for each in (*places, *lanes, _by_tiles(corners))]
        size = (np.int32(self._shape[0]), np.int32(self._shape[1]))
        self._kernel.set_args(self._image, *size, *inputs, np.int32(n), output)
        local = device.work_group_size
        items = (len(groups), -(-n // local) * local)
        cl.enqueue_nd_range_kernel(device.queue, self._kernel, items, (1, local))
        found = result if result.flags.c_contiguous else np.empty_like(result)
        cl.enqueue_copy(device.queue, found, output)
        if found is not result:
            result[...] = found

    def _lanes_of(self, groups: list[np.ndarray], shifts: np.ndarray) -> tuple[np.ndarray, ...]:
        """Origins, reaches, shifts and frames of all groups, as the kernel has them."""
        frames = np.array([np.resize(group, self._lanes) for group in groups], dtype=np.int32)
        own = shifts[frames]
        whole = np.floor(own)
        origin = whole.min(axis=1)
        away = own - origin[:, None]
        low, high = away.min(axis=1), away.max(axis=1)
        reach = np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], axis=1)
        lanes = np.concatenate([whole - origin[:, None], own - whole], axis=2)
        return (
            origin.astype(np.int32),
            reach.astype(self._real),
            np.ascontiguousarray(np.moveaxis(lanes, 2, 1), dtype=self._real),
            frames,
        )


def _by_tiles(corners: np.ndarray) -> np.ndarray:
    """Numbers of receptors tile by tile of the image, so that its pixels are still at hand."""
    tiles = corners // _TILE
    return np.lexsort((tiles[:, 0], tiles[:, 1])).astype(np.int32)


def frame_groups(shifts: np.ndarray, window: np.ndarray, lanes: int) -> list[np.ndarray]:
    """Frames that lie near each other, at most so many together.

    Every lane of a group looks at the pixels of all; frames that lie far apart, in apertures, are
    cheaper one by one.

    Parameters
    ----------
    shifts
        (frames, 2), pixels.
    window
        Columns and rows of pixels that a usual aperture reaches, (2,).
    """
    found, open_groups = [], [np.arange(len(shifts))]
    while open_groups:
        group = open_groups.pop()
        if len(group) == 1:
            found.append(group)
            continue
        extent = np.ptp(shifts[group], axis=0)
        axis = int(np.argmax(extent / window))
        group = group[np.argsort(shifts[group, axis], kind="stable")]
        along = shifts[group, axis]
        if len(group) > lanes:
            middle = lanes * max(1, round(len(group) / (2 * lanes)))
            parts = group[:middle], group[middle:]
        else:
            gap = 1 + int(np.argmax(np.diff(along)))
            parts = group[:gap], group[gap:]
            cost = [np.prod(window + np.ptp(shifts[each], axis=0)) for each in parts]
            if sum(cost) >= np.prod(window + extent):
                found.append(group)
                continue
        open_groups += parts
    return found

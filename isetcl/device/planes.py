"""Kernels that map planes of values to planes of values, one value a lane: probes of functions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from isetcl.device import program
from isetcl.device.devices import Device
from isetcl.device.layout import Precision, real_dtype


def run_on_planes(
    device: Device,
    precision: Precision,
    source: str,
    name: str,
    planes: np.ndarray,
    n_out: int,
    *more: Any,
    first: Sequence[np.ndarray] = (),
    width: int | None = None,
) -> np.ndarray:
    """What a kernel `name(first ..., x, n, out, more ...)` makes of values.

    Parameters
    ----------
    source
        The assembled source that has the kernel.
    planes : ndarray, (inputs, n) or (n,)
        Values, rounded to the precision; the kernel sees zeros beyond the last.
    n_out
        Planes that it writes.
    more, first
        Further arguments behind and before; arrays in front are uploaded.
    width
        Lanes that the source was assembled for; None for the device's own.

    Returns
    -------
    ndarray of float64, (n_out, n)
    """
    import pyopencl as cl

    real = real_dtype(precision)
    width = device.vector_width(precision) if width is None else width
    values = np.atleast_2d(np.asarray(planes, dtype=real))
    n = values.shape[1]
    padded = -(-n // width) * width
    data = np.zeros((len(values), padded), dtype=real)
    data[:, :n] = values
    into = device.upload(data)
    out = np.empty((n_out, padded), dtype=real)
    result = device.allocate(out.size, real)
    kernel = program.kernel(device, source, name)
    before = [device.upload(b) for b in first]
    kernel.set_args(*before, into, np.int32(padded), result, *more)
    cl.enqueue_nd_range_kernel(device.queue, kernel, (padded // width,), (1,))
    cl.enqueue_copy(device.queue, out, result)
    return out[:, :n].astype(np.float64)

"""Choosing the device that does the work."""

from __future__ import annotations

import os

from isetcl.device import selftest
from isetcl.device.devices import Device, list_devices
from isetcl.errors import DeviceError, InvalidInputError

ENVIRONMENT_VARIABLE = "ISETCL_DEVICE"

_HOW_TO_GET_ONE = (
    "install PoCL with `pip install pocl-binary-distribution` (Linux x86-64), with "
    "`apt install pocl-opencl-icd`, or your graphics driver's OpenCL; `isetcl devices` lists "
    "what is found"
)


def find_device(wanted: str | None = None) -> Device:
    """The device that was asked for, or the fastest that passes the self-test.

    Parameters
    ----------
    wanted
        "0:1" (platform and device index) or a part of the platform's or device's name, in any
        case. None: the environment variable ISETCL_DEVICE, then the fastest.

    Raises
    ------
    DeviceError
        If there is no device, none has the name, or the one asked for fails its self-test.
    """
    wanted = wanted if wanted is not None else os.environ.get(ENVIRONMENT_VARIABLE) or None
    devices = list_devices()
    if not devices:
        raise DeviceError(f"no OpenCL device was found; {_HOW_TO_GET_ONE}")
    if wanted is None:
        return selftest.fastest(devices)
    if not isinstance(wanted, str) or not wanted.strip():
        raise InvalidInputError(f"device must be a name or an index such as '0:0', got {wanted!r}")
    needle = wanted.strip().lower()
    for device in devices:
        if device.index == needle or needle in f"{device.platform} {device.name}".lower():
            selftest.require(device)
            return device
    known = "; ".join(f"{d.index} {d.platform}: {d.name}" for d in devices)
    raise DeviceError(f"no OpenCL device matches {wanted!r}; found {known}")

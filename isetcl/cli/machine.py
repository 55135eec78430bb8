"""`isetcl devices` and `isetcl info`: what this machine computes with."""

from __future__ import annotations

from typing import Annotated

import typer


def devices(
    double: Annotated[bool, typer.Option(help="Test double precision as well.")] = True,
) -> None:
    """List OpenCL devices with their self-test and the rays each traces in a second."""
    from rich.console import Console
    from rich.table import Table

    from isetcl.device import selftest
    from isetcl.device.choose import ENVIRONMENT_VARIABLE, find_device
    from isetcl.device.devices import list_devices
    from isetcl.device.layout import Precision

    found = list_devices()
    if not found:
        find_device()
    console = Console()
    for device in found:
        console.print(
            f"{device.index} {device.name} ({device.platform} {device.driver}), kernels for "
            f"{device.target or 'its own processor'}",
            highlight=False,
            soft_wrap=True,
        )
        table = Table("precision", "self-test", "million rays/s", "ray error (um)")
        precisions: list[Precision] = ["single"]
        if double and device.has_double:
            precisions.append("double")
        for precision in precisions:
            result = selftest.run(device, precision)
            verdict = "passed" if result.passed else "; ".join(result.failures)
            speed = f"{result.rays_per_s / 1e6:.3g}"
            table.add_row(precision, verdict, speed, f"{1000 * result.ray_error_mm:.1g}")
        console.print(table)
    console.print(f"Choose one with --device or {ENVIRONMENT_VARIABLE}.", highlight=False)


def info() -> None:
    """Show versions of isetcl and what it stands on."""
    from importlib.metadata import PackageNotFoundError, version

    from rich.console import Console

    console = Console()
    for package in ("isetcl", "pyopencl", "pocl-binary-distribution", "numpy", "scipy", "xarray"):
        try:
            console.print(f"{package} {version(package)}", highlight=False)
        except PackageNotFoundError:
            console.print(f"{package} is not installed", highlight=False)

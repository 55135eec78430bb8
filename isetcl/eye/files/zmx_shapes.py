"""The forms of Zemax surfaces: curvature, conic constant and shape from the records of a file."""

from __future__ import annotations

from typing import Any

import numpy as np

from isetcl.errors import InvalidInputError
from isetcl.eye.files.zmx_text import ZmxSurface
from isetcl.eye.shapes.biconic import Biconic
from isetcl.eye.shapes.even_asphere import MAX_TERMS, EvenAsphere
from isetcl.eye.shapes.shape import SurfaceShape
from isetcl.eye.shapes.toric import Toric
from isetcl.eye.shapes.zernike_sag import MAX_ORDER, ZernikeSag
from isetcl.eye.waves import zernike

MOST_TERMS = zernike.term_count(MAX_ORDER)
SUPPORTED = ("STANDARD", "BICONICX", "TOROIDAL", "EVENASPH", "SZERNSAG", "COORDBRK")


def form_of(surface: ZmxSurface, unit_mm: float) -> dict[str, Any]:
    """`curvature` (1/mm), `conic` and `shape` of a surface.

    Raises
    ------
    InvalidInputError
        If the type or a part of it is not supported.
    """
    curvature = surface.curvature / unit_mm
    form: dict[str, Any] = {"curvature": curvature, "conic": surface.conic, "shape": None}
    if surface.kind == "STANDARD":
        return form
    if surface.kind == "BICONICX":
        # PARM 1, 2: radius and conic constant in x; a radius of 0 stands for a plane section.
        shape: SurfaceShape = Biconic(
            _inverse(surface.parameters.get(1, 0.0), unit_mm), surface.parameters.get(2, 0.0)
        )
        return form | {"shape": shape}
    if surface.kind == "TOROIDAL":
        return form | {"shape": _toric(surface, unit_mm)}
    if surface.kind == "EVENASPH":
        powers = _powers(surface, unit_mm)
        return form | {"shape": EvenAsphere(powers) if any(powers) else None}
    if surface.kind == "SZERNSAG":
        return form | {"shape": _zernike(surface, unit_mm)}
    raise InvalidInputError(
        f"surface type {surface.kind!r} cannot be read (known: {', '.join(SUPPORTED)}); replace "
        "it in the lens editor"
    )


def _inverse(radius: float, unit_mm: float) -> float:
    return 0.0 if radius == 0 else 1.0 / (radius * unit_mm)


def _powers(surface: ZmxSurface, unit_mm: float) -> list[float]:
    """Coefficients of rho^2, rho^4 ... in mm, from PARM 1 to 8."""
    return [
        surface.parameters.get(i, 0.0) * unit_mm ** (1 - 2 * i) for i in range(1, MAX_TERMS + 1)
    ]


def _toric(surface: ZmxSurface, unit_mm: float) -> Toric:
    """PARM 1: radius of rotation; PARM 2 to 8, powers of y, have to be zero."""
    if any(v != 0.0 for i, v in surface.parameters.items() if 2 <= i <= 8) or any(
        surface.extra.values()
    ):
        raise InvalidInputError(
            "a TOROIDAL surface must have no polynomial or Zernike terms (PARM 2 to 8, XDAT); use "
            "EVENASPH or SZERNSAG"
        )
    return Toric(_inverse(surface.parameters.get(1, 0.0), unit_mm))


def _zernike(surface: ZmxSurface, unit_mm: float) -> SurfaceShape | None:
    """XDAT 1: number of terms; 2: radius; 3 ...: Noll's orthonormal coefficients, length units.

    Even powers of rho (PARM 1 to 5) are sums of the polynomials without angle.
    """
    if any(surface.parameters.get(i, 0.0) for i in (9, 10)):
        raise InvalidInputError("a SZERNSAG surface must have no decentred terms (PARM 9, 10)")
    last = surface.extra.get(1, 0.0) + 2.0
    noll = {
        i - 2: value * unit_mm
        for i, value in surface.extra.items()
        if 3 <= i <= last and value != 0.0
    }
    powers = _powers(surface, unit_mm)
    if not noll:
        return EvenAsphere(powers) if any(powers) else None
    if max(noll) > MOST_TERMS:
        raise InvalidInputError(
            f"a SZERNSAG surface must have at most {MOST_TERMS} terms (XDAT 3 ...), got {max(noll)}"
        )
    radius = surface.extra.get(2, 0.0) * unit_mm
    coefficients = np.zeros(MOST_TERMS)
    for j, value in noll.items():
        coefficients[zernike.osa_index(*zernike.noll_nm(j))] = value
    if any(powers):
        coefficients += _polynomials_of(powers, radius)
    used = int(np.max(np.nonzero(coefficients)[0])) + 1
    return ZernikeSag(coefficients[:used].tolist(), radius)


def _polynomials_of(powers: list[float], radius_mm: float) -> np.ndarray:
    """Coefficients in OSA order of a1 rho^2 + a2 rho^4 + ... over a radius in mm."""
    most = MAX_ORDER // 2
    if any(powers[most:]):
        raise InvalidInputError(
            f"a SZERNSAG surface must have no even powers beyond rho^{2 * most} (PARM {most}) "
            "beside its Zernike terms"
        )
    orders = range(0, 2 * most + 1, 2)
    table = np.zeros((most + 1, most + 1))  # even powers of rho / radius by polynomials
    for k, n in enumerate(orders):
        radial = zernike.norm(n, 0) * zernike.radial_coefficients(n, 0)
        table[: k + 1, k] = radial[::2]
    scaled = [0.0, *(a * radius_mm ** (2 * i) for i, a in enumerate(powers[:most], start=1))]
    result = np.zeros(MOST_TERMS)
    result[[zernike.osa_index(n, 0) for n in orders]] = np.linalg.solve(table, scaled)
    return result

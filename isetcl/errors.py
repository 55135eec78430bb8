"""Every error isetcl raises on purpose, and the checks that raise them.

A message says what is wrong, the rule, the value and the remedy, in that order.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Sequence

import numpy as np


class IsetclError(Exception):
    """Base of all errors raised by isetcl."""


class InvalidInputError(IsetclError, ValueError):
    """An argument breaks a documented rule."""


class FocusError(InvalidInputError):
    """An eye cannot be brought into focus where it was asked to."""


class FileError(IsetclError, OSError):
    """A file cannot be read or written."""


class DeviceError(IsetclError, RuntimeError):
    """No OpenCL device can do the work."""


class KernelBuildError(DeviceError):
    """OpenCL refused a kernel; the message names the saved source."""


class OutOfMemoryError(IsetclError, MemoryError):
    """A result does not fit; the message says which size would."""


def check_finite(name: str, value: float, unit: str = "") -> float:
    """Return `value` as a float; raise InvalidInputError unless it is a finite number."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InvalidInputError(f"{name} must be a number, got {value!r}") from None
    if not math.isfinite(number):
        raise InvalidInputError(f"{name} must be finite{_in(unit)}, got {number}")
    return number


def check_positive(name: str, value: float, unit: str = "") -> float:
    """Return `value` as a float; raise InvalidInputError unless it is finite and > 0."""
    number = check_finite(name, value, unit)
    if number <= 0:
        raise InvalidInputError(f"{name} must be > 0{_in(unit)}, got {number:g}")
    return number


def check_between(name: str, value: float, low: float, high: float, unit: str = "") -> float:
    """Return `value` as a float; raise InvalidInputError unless low <= value <= high."""
    number = check_finite(name, value, unit)
    if not low <= number <= high:
        raise InvalidInputError(
            f"{name} must lie between {low:g} and {high:g}{_in(unit)}, got {number:g}"
        )
    return number


def check_count(name: str, value: int, low: int = 1, high: int | None = None) -> int:
    """Return `value` as an int; raise InvalidInputError unless it is a whole number in range."""
    number = check_finite(name, value)
    if number != int(number):
        raise InvalidInputError(f"{name} must be a whole number, got {value!r}")
    if number < low or (high is not None and number > high):
        rule = f">= {low}" if high is None else f"between {low} and {high}"
        raise InvalidInputError(f"{name} must be {rule}, got {int(number)}")
    return int(number)


def check_choice(name: str, value: str, choices: Iterable[str]) -> str:
    """Return `value`; raise InvalidInputError, with the near matches, unless it is a choice."""
    known = list(choices)
    if value in known:
        return value
    near = difflib.get_close_matches(str(value), known, n=3, cutoff=0.4)
    hint = f"; did you mean {' or '.join(near)}?" if near else ""
    raise InvalidInputError(f"unknown {name} {value!r}{hint} (known: {', '.join(sorted(known))})")


def check_vectors(name: str, value: np.ndarray | Sequence[object], *, width: int = 3) -> np.ndarray:
    """Return `value` as a float64 array (n, width); raise InvalidInputError for other shapes."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidInputError(f"{name} must be numbers of shape (n, {width})") from None
    if array.ndim == 1 and array.shape == (width,):
        array = array[np.newaxis]
    if array.ndim != 2 or array.shape[1] != width:
        raise InvalidInputError(
            f"{name} must have shape (n, {width}), got {array.shape}; pass one row per ray or point"
        )
    return array


def _in(unit: str) -> str:
    return f" {unit}" if unit else ""

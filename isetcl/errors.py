"""Every error isetcl raises on purpose, and the checks that raise them.

A message says what is wrong, the rule, the value and the remedy, in that order.
"""

from __future__ import annotations

import difflib
import math
import operator
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
    number = check_number(name, value)
    if not math.isfinite(number):
        raise InvalidInputError(f"{name} must be finite, got {number} {unit}".rstrip())
    return number


def check_number(name: str, value: float) -> float:
    """Return `value` as a float, infinite or NaN too; raise InvalidInputError for other things."""
    try:
        if not isinstance(value, (str, bytes, bool, np.bool_)) and np.ndim(value) == 0:
            return float(value)
    except OverflowError:
        raise InvalidInputError(f"{name} must be smaller than 1.8e308, got {value!r}") from None
    except (TypeError, ValueError):
        pass
    raise InvalidInputError(f"{name} must be a number, got {_short(value)}")


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
    try:
        count = operator.index(value) if not isinstance(value, bool) else None
    except TypeError:
        count = None
    if count is None:
        number = check_finite(name, value)
        count = int(number)
        if number != count:
            raise InvalidInputError(f"{name} must be a whole number, got {value!r}")
    if count < low or (high is not None and count > high):
        rule = f">= {low}" if high is None else f"between {low} and {high}"
        raise InvalidInputError(f"{name} must be {rule}, got {count}")
    return count


def check_choice(name: str, value: str, choices: Iterable[str]) -> str:
    """Return `value`; raise InvalidInputError, with the near matches, unless it is a choice."""
    known = list(choices)
    if isinstance(value, str) and value in known:
        return value
    folded = {choice.lower(): choice for choice in known}
    close = difflib.get_close_matches(str(value).lower(), folded, n=3, cutoff=0.4)
    near = [folded[match] for match in close]
    hint = f"; did you mean {' or '.join(near)}?" if near else ""
    listed = ", ".join(sorted(known))
    raise InvalidInputError(f"unknown {name} {_short(value)}{hint} (known: {listed})")


def check_type(
    name: str, value: object, kinds: type | tuple[type, ...], remedy: str | None = None
) -> None:
    """Raise InvalidInputError unless `value` is an instance of one of the kinds."""
    if not isinstance(value, kinds):
        allowed = kinds if isinstance(kinds, tuple) else (kinds,)
        wanted = " or ".join(kind.__name__ for kind in allowed)
        hint = f"; {remedy}" if remedy else ""
        raise InvalidInputError(f"{name} must be {_article(wanted)}, got {_short(value)}{hint}")


def check_pair(name: str, value: Sequence[float], unit: str = "") -> tuple[float, float]:
    """Return two finite numbers; raise InvalidInputError for anything else."""
    try:
        first, second = value
    except (TypeError, ValueError):
        raise InvalidInputError(f"{name} must be two numbers, got {_short(value)}") from None
    return (
        check_finite(f"{name} (first)", first, unit),
        check_finite(f"{name} (second)", second, unit),
    )


def check_array(name: str, value: object) -> np.ndarray:
    """Return `value` as a float64 array of any shape; raise InvalidInputError unless it is one."""
    try:
        array = np.asarray(value)
    except ValueError:
        array = np.asarray(None)
    if array.dtype.kind not in "biuf":
        raise InvalidInputError(f"{name} must be numbers, got {_short(value)}")
    return array.astype(np.float64)


def check_vectors(name: str, value: np.ndarray | Sequence[object], *, width: int = 3) -> np.ndarray:
    """Return `value` as a float64 array (n, width); raise InvalidInputError for other shapes."""
    array = check_array(name, value)
    if array.ndim == 1 and array.shape == (width,):
        array = array[np.newaxis]
    if array.ndim != 2 or array.shape[1] != width:
        raise InvalidInputError(
            f"{name} must have shape (n, {width}), got {array.shape}; pass one row per ray or point"
        )
    return array


def _in(unit: str) -> str:
    return f" {unit}" if unit else ""


def _article(noun: str) -> str:
    return f"{'an' if noun[0] in 'AEIOUaeiou' else 'a'} {noun}"


def _short(value: object) -> str:
    """A value for a message: its type, where it is no plain value or would fill the screen."""
    text = repr(value)
    plain = value is None or isinstance(value, (str, bytes, int, float, tuple, list))
    return text if plain and len(text) <= 60 else f"an object of type {type(value).__name__}"

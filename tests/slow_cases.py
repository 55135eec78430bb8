"""Tests of many dear cases: the first ones in every run, the rest among the slow ones."""

from collections.abc import Iterable
from typing import Any

import pytest


def slow_after(count: int, cases: Iterable[Any]) -> list[Any]:
    """The cases of a `pytest.mark.parametrize`, those after the first `count` marked slow.

    A case is a value, or a tuple of one value for each name.
    """
    tuples = [each if isinstance(each, tuple) else (each,) for each in cases]
    return [
        pytest.param(*each, marks=pytest.mark.slow if i >= count else ())
        for i, each in enumerate(tuples)
    ]

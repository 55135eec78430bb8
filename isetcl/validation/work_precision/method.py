"""What is measured: a way to make an image, with a knob that trades error against time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from isetcl.errors import InvalidInputError, check_choice, check_positive, check_type
from isetcl.retina.image import RetinalImage

ImageLike = RetinalImage | np.ndarray
Run = Callable[[float, int], ImageLike]
PartName = Literal["representation", "rounding", "discretisation"]

PART_NAMES: tuple[PartName, ...] = ("representation", "rounding", "discretisation")


@dataclass(frozen=True)
class Part:
    """One kind of error by itself: the difference of two ways to make an image.

    Attributes
    ----------
    name
        ``"representation"`` (rounded inputs), ``"rounding"`` (rounded arithmetic) or
        ``"discretisation"`` (bands, samples of a view, steps).
    one, other
        Functions of the knob and the seed.
    is_paired
        Whether both take the same samples, so that noise cancels in each difference. Where it does
        not, it is taken out over several seeds.
    """

    name: PartName
    one: Run
    other: Run
    is_paired: bool = True

    def __post_init__(self) -> None:
        check_choice("part of an error", self.name, PART_NAMES)
        for function in (self.one, self.other):
            if not callable(function):
                raise InvalidInputError(
                    f"part {self.name!r} needs two functions of knob and seed, got {function!r}"
                )


@dataclass(frozen=True)
class WorkMethod:
    """A way to make an image, as a function of a knob and a seed.

    Attributes
    ----------
    name
        Name of the curve.
    run
        ``run(knob, seed)`` returns a `RetinalImage` or an array.
    knobs
        Values of the knob, > 0, each once.
    knob
        What the knob is called.
    is_random
        Whether the image depends on the seed. If not, one image is enough.
    parts
        Kinds of error that can be had by themselves.
    options
        What else the method was told, for the record.
    """

    name: str
    run: Run
    knobs: tuple[float, ...]
    knob: str = "knob"
    is_random: bool = True
    parts: tuple[Part, ...] = ()
    options: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_type("name of a method", self.name, str)
        check_type("name of a knob", self.knob, str)
        check_type("is_random", self.is_random, bool)
        if not callable(self.run):
            raise InvalidInputError(
                f"method {self.name!r} needs a function of knob and seed as run, got {self.run!r}"
            )
        object.__setattr__(self, "knobs", checked_knobs(self.name, self.knobs))
        check_type("options", self.options, Mapping)
        check_type("parts", self.parts, tuple)
        for part in self.parts:
            check_type(f"part of method {self.name!r}", part, Part)


@dataclass(frozen=True)
class Point:
    """A method at one value of its knob."""

    method: WorkMethod
    value: float

    @property
    def what(self) -> str:
        """The point in words."""
        return f"method {self.method.name!r} at {self.method.knob} {self.value:g}"


def checked_knobs(name: str, knobs: object) -> tuple[float, ...]:
    """Values of a knob: some, positive, each once."""
    check_type(f"knobs of method {name!r}", knobs, (tuple, list))
    assert isinstance(knobs, (tuple, list))
    for value in knobs:
        check_positive(f"knob of method {name!r}", value)
    if not knobs or len(set(knobs)) != len(knobs):
        raise InvalidInputError(
            f"method {name!r} needs one value of its knob or more, each once, got {knobs!r}"
        )
    return tuple(knobs)

"""The parameters of one directive, by name and type, with defaults and a record of their use."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from isetcl.scene.pbrt.parser import Directive, Parameter
from isetcl.scene.pbrt.places import Place, wrong


class Parameters:
    """Looks up the parameters of a directive; what nobody asks for is told by `unused`."""

    def __init__(self, directive: Directive, defaults: Mapping[str, Parameter] | None = None):
        self.place: Place = directive.place
        self.directive = directive.name
        self._own = directive.parameters
        self._all = {**(defaults or {}), **directive.parameters}
        self._used: set[str] = set()
        self.is_needed = True

    def __contains__(self, name: str) -> bool:
        return name in self._all

    def get(self, name: str, *types: str) -> Parameter | None:
        """The parameter of a name, which must have one of the types and not be empty; or None."""
        parameter = self._all.get(name)
        if parameter is None:
            return None
        self._used.add(name)
        if parameter.type not in types:
            raise wrong(
                parameter.place,
                f"parameter {name!r} must be of type {' or '.join(types)}, got {parameter.type}",
            )
        if len(parameter.values) == 0:
            raise wrong(parameter.place, f"parameter {name!r} must have a value, got []")
        return parameter

    def type_of(self, name: str) -> str | None:
        """The type that a parameter was given with, if it was given."""
        parameter = self._all.get(name)
        return None if parameter is None else parameter.type

    def number(self, name: str, default: float) -> float:
        """A float (or integer) parameter of one value."""
        parameter = self.get(name, "float", "integer")
        return default if parameter is None else float(_single(parameter))

    def whole(self, name: str, default: int) -> int:
        """An integer parameter of one value."""
        parameter = self.get(name, "integer", "float")
        if parameter is None:
            return default
        value = float(_single(parameter))
        if value != round(value):
            raise wrong(parameter.place, f"parameter {name!r} must be whole, got {value:g}")
        return int(value)

    def numbers(self, name: str, *types: str) -> np.ndarray | None:
        """All numbers of a parameter; None where it is not given."""
        parameter = self.get(name, *(types or ("float", "integer")))
        return None if parameter is None else np.asarray(parameter.values, dtype=np.float64)

    def vectors(self, name: str, width: int = 3) -> np.ndarray | None:
        """Points, vectors or normals as rows, shape (n, width); None where not given."""
        kinds = ("point3", "vector3", "normal") if width == 3 else ("point2", "vector2", "float")
        values = self.numbers(name, *kinds)
        if values is None:
            return None
        if len(values) % width:
            raise wrong(self._all[name].place, f"parameter {name!r} must be pairs of numbers")
        return values.reshape(-1, width)

    def vector(self, name: str, default: tuple[float, float, float]) -> np.ndarray:
        """One point or vector."""
        values = self.vectors(name)
        if values is None:
            return np.array(default)
        if len(values) != 1:
            raise wrong(self._all[name].place, f"parameter {name!r} must be one, got {len(values)}")
        return values[0]

    def text(self, name: str, default: str = "") -> str:
        """A string parameter of one value."""
        parameter = self.get(name, "string")
        return default if parameter is None else str(_single(parameter))

    def flag(self, name: str, default: bool) -> bool:
        """A bool parameter of one value."""
        parameter = self.get(name, "bool")
        return default if parameter is None else bool(_single(parameter))

    def place_of(self, name: str) -> Place:
        """Where a parameter stands; the directive's place where it is not given."""
        parameter = self._all.get(name)
        return self.place if parameter is None else parameter.place

    def ignore(self, names: Iterable[str]) -> None:
        """Count parameters as used that say nothing about what is seen."""
        self._used.update(names)

    def unused(self) -> list[Parameter]:
        """Parameters of the directive itself that nobody asked for.

        None where nothing needed the directive, such as a material that no shape has.
        """
        if not self.is_needed:
            return []
        return [p for name, p in self._own.items() if name not in self._used]


def _single(parameter: Parameter) -> float | str | bool:
    if len(parameter.values) != 1:
        raise wrong(
            parameter.place,
            f"parameter {parameter.name!r} must have one value, got {len(parameter.values)}",
        )
    value: float | str | bool = parameter.values[0]
    return value

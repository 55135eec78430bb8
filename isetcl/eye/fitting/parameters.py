"""Parameters of an eye by name: "cornea front.curvature", "retina.vertex_z_mm", "stop.z_mm".

A name is a part (a surface by its own name, "stop" or "retina"), a dot, and the path to a number in
that part: fields by dots, places in a tuple by [0]. What an eye does not have has no name: to fit
the tilt of a lens ("lens back.placement.tilt_deg[0]"), start from an eye whose surface has a
`Placement`, even one that moves nothing.
"""

from __future__ import annotations

import dataclasses
import difflib
import itertools
import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from isetcl.errors import InvalidInputError, check_finite
from isetcl.eye.model import Eye, smallest_gap_mm
from isetcl.eye.surface import Surface

_SAME_PLANE_MM = 1e-9
_GAP_SAMPLES = 261
_NOT_OPTICAL = {"semi_diameter_mm", "range_nm"}
_STEP = re.compile(r"\.?([A-Za-z_]\w*)|\[(\d+)\]")

Path = tuple[str | int, ...]


def parameter_names(eye: Eye) -> tuple[str, ...]:
    """The names of all numbers that shape an eye."""
    names = []
    for part, thing in _parts(eye).items():
        for path, _ in _numbers(thing):
            text = "".join(f"[{s}]" if isinstance(s, int) else f".{s}" for s in path)
            names.append(part + text)
    # The first vertex is the origin.
    return tuple(n for n in names if n != f"{eye.surfaces[0].name}.vertex_z_mm")


def get_parameter(eye: Eye, name: str) -> float:
    """The value of a parameter.

    Raises
    ------
    InvalidInputError
        If the eye has no parameter of this name; the message lists those it has.
    """
    part, path = _resolve(eye, name)
    value = _parts(eye)[part]
    for step in path:
        value = value[step] if isinstance(step, int) else getattr(value, step)
    return float(value)


def with_parameters(eye: Eye, values: Mapping[str, float]) -> Eye:
    """The eye with other values of some parameters; it no longer accommodates.

    A surface that touches the plane of the stop takes the stop along when its vertex moves, unless
    "stop.z_mm" is given too: the iris rests on the lens. Semi-diameters shrink to where surfaces
    would meet.

    Raises
    ------
    InvalidInputError
        If a name is unknown, or there is no such eye.
    """
    parts = _parts(eye)
    for name, value in values.items():
        part, path = _resolve(eye, name)
        parts[part] = _changed(parts[part], path, check_finite(name, value))
    surfaces = _trimmed([parts[surface.name] for surface in eye.surfaces])
    stop = parts["stop"]
    if "stop.z_mm" not in values:
        for old, new in zip(eye.surfaces, surfaces, strict=True):
            moved = new.vertex_z_mm != old.vertex_z_mm
            if moved and abs(old.vertex_z_mm - eye.stop.z_mm) <= _SAME_PLANE_MM:
                stop = dataclasses.replace(stop, z_mm=new.vertex_z_mm)
    return dataclasses.replace(
        eye,
        surfaces=surfaces,
        stop=stop,
        retina=parts["retina"],
        accommodation_model=None,
        accommodation_parameter=None,
    )


def _trimmed(surfaces: list[Surface]) -> tuple[Surface, ...]:
    """Surfaces whose neighbours do not meet inside their semi-diameters."""
    limits = [s.semi_diameter_mm for s in surfaces]
    for i, (front, back) in enumerate(itertools.pairwise(surfaces)):
        rho = np.linspace(0.0, min(front.semi_diameter_mm, back.semi_diameter_mm), _GAP_SAMPLES)
        gap = smallest_gap_mm(front, back, rho)
        if np.any(gap < 0.0) and gap[0] > 0.0:
            meet = float(rho[max(1, int(np.argmax(gap < 0.0)) - 1)])
            limits[i], limits[i + 1] = min(limits[i], meet), min(limits[i + 1], meet)
    return tuple(
        s if limit == s.semi_diameter_mm else dataclasses.replace(s, semi_diameter_mm=limit)
        for s, limit in zip(surfaces, limits, strict=True)
    )


def _parts(eye: Eye) -> dict[str, Any]:
    """Surfaces by their names, stop and retina."""
    parts = {s.name: s for s in eye.surfaces} | {"stop": eye.stop, "retina": eye.retina}
    if len(parts) != len(eye.surfaces) + 2:
        names = [s.name for s in eye.surfaces]
        raise InvalidInputError(
            f"eye {eye.name!r}: parameters go by the names of surfaces, which must differ from "
            f"each other and from 'stop' and 'retina', got {names}; rename the surfaces"
        )
    return parts


def _numbers(thing: Any) -> Iterator[tuple[Path, float]]:
    """Paths to the numbers inside a dataclass or tuple."""
    if isinstance(thing, bool):
        return
    if isinstance(thing, (int, float)):
        yield (), float(thing)
    elif isinstance(thing, tuple):
        for i, item in enumerate(thing):
            for path, value in _numbers(item):
                yield (i, *path), value
    elif dataclasses.is_dataclass(thing):
        for field in dataclasses.fields(thing):
            if field.name not in _NOT_OPTICAL:
                for path, value in _numbers(getattr(thing, field.name)):
                    yield (field.name, *path), value


def _resolve(eye: Eye, name: str) -> tuple[str, Path]:
    """Part and path of a parameter's name."""
    known = parameter_names(eye)
    if name not in known:
        near = difflib.get_close_matches(str(name), known, n=3, cutoff=0.5)
        hint = f"; did you mean {' or '.join(near)}?" if near else ""
        raise InvalidInputError(
            f"eye {eye.name!r} has no parameter {name!r}{hint} (known: {', '.join(known)})"
        )
    part = max((p for p in _parts(eye) if name.startswith(f"{p}.")), key=len)
    steps = _STEP.findall(name[len(part) :])
    return part, tuple(word if word else int(place) for word, place in steps)


def _changed(thing: Any, path: Path, value: float) -> Any:
    """A frozen dataclass or tuple with the number at a path replaced."""
    if not path:
        return value
    step, rest = path[0], path[1:]
    if isinstance(step, int):
        return (*thing[:step], _changed(thing[step], rest, value), *thing[step + 1 :])
    return dataclasses.replace(thing, **{step: _changed(getattr(thing, step), rest, value)})

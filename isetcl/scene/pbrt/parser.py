"""The directives of a PBRT file and of the files it includes, with their parameters."""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from isetcl.scene.pbrt.files import SceneFiles, read_text
from isetcl.scene.pbrt.places import Place, wrong
from isetcl.scene.pbrt.tokens import Token, tokens

MAX_INCLUDE_DEPTH = 32
MAX_INCLUDED_FILES = 20_000
MAX_TOKENS = 100_000_000
MAX_DIRECTIVES = 5_000_000

_NUMBERS = {
    "Translate": 3,
    "Scale": 3,
    "Rotate": 4,
    "LookAt": 9,
    "Transform": 16,
    "ConcatTransform": 16,
    "TransformTimes": 2,
}
_STRINGS = {
    "ObjectBegin": 1,
    "ObjectInstance": 1,
    "CoordinateSystem": 1,
    "CoordSysTransform": 1,
    "NamedMaterial": 1,
    "ColorSpace": 1,
    "Include": 1,
    "Import": 1,
    "ActiveTransform": 1,
    "MediumInterface": 2,
}
_PARAMETERS = {
    "Camera": 1,
    "Film": 1,
    "Sampler": 1,
    "Integrator": 1,
    "SurfaceIntegrator": 1,
    "VolumeIntegrator": 1,
    "Renderer": 1,
    "Accelerator": 1,
    "PixelFilter": 1,
    "Material": 1,
    "MakeNamedMaterial": 1,
    "MakeNamedMedium": 1,
    "Texture": 3,
    "AreaLightSource": 1,
    "LightSource": 1,
    "Shape": 1,
    "Attribute": 1,
    "Option": 1,
}
_BARE = (
    "AttributeBegin",
    "AttributeEnd",
    "TransformBegin",
    "TransformEnd",
    "ObjectEnd",
    "ReverseOrientation",
    "Identity",
    "WorldBegin",
    "WorldEnd",
)
DIRECTIVES = (*_NUMBERS, *_STRINGS, *_PARAMETERS, *_BARE)

_SAME_TYPE = {
    "color": "rgb",
    "point": "point3",
    "vector": "vector3",
    "normal3": "normal",
}
_GROUPS = {"point2": 2, "vector2": 2, "point3": 3, "vector3": 3, "normal": 3, "rgb": 3, "xyz": 3}
_NUMERIC = ("integer", "float", "blackbody", *_GROUPS)
_TEXTUAL = ("string", "texture")
TYPES = (*_NUMERIC, *_TEXTUAL, "bool", "spectrum", *_SAME_TYPE)


@dataclass(frozen=True, eq=False)
class Parameter:
    """A typed parameter: numbers as an array, strings and truth values as a tuple."""

    type: str
    name: str
    values: np.ndarray | tuple[str, ...] | tuple[bool, ...]
    place: Place


@dataclass(frozen=True, eq=False)
class Directive:
    """A directive: its name, its plain arguments, its parameters, and where it stands.

    `title` is what a comment calls the block that AttributeBegin opens.
    """

    name: str
    place: Place
    strings: tuple[str, ...] = ()
    numbers: tuple[float, ...] = ()
    parameters: dict[str, Parameter] = field(default_factory=dict)
    title: str = ""


def parse(main: Path, files: SceneFiles) -> list[Directive]:
    """All directives of a file, includes in their places.

    Raises
    ------
    FileError
        If the text breaks the grammar (names file, line and column), or includes never end.
    """
    return _Parser(files).run(main)


class _Parser:
    """Reads files by a stack of token streams."""

    def __init__(self, files: SceneFiles) -> None:
        self._files = files
        self._stack: list[tuple[Path, Iterator[Token]]] = []
        self._ahead: Token | None = None
        self._count = 0
        self._included = 0

    def run(self, main: Path) -> list[Directive]:
        directives: list[Directive] = []
        self._push(main, main.name)
        while (token := self._take()) is not None:
            directive = self._directive(token)
            if directive.name in ("Include", "Import"):
                self._include(directive)
                continue
            directives.append(directive)
            if len(directives) > MAX_DIRECTIVES:
                raise wrong(
                    token.place,
                    f"a scene must have at most {MAX_DIRECTIVES} directives; join small shapes "
                    "into meshes",
                )
        return directives

    def _push(self, path: Path, name: str) -> None:
        self._stack.append((path, tokens(read_text(path), name)))

    def _include(self, directive: Directive) -> None:
        name = directive.strings[0]
        path = self._files.find(name, directive.place)
        if path is None:
            return
        if any(path == open_file for open_file, _ in self._stack):
            chain = " -> ".join([*(p.name for p, _ in self._stack), path.name])
            raise wrong(directive.place, f"files must not include each other in a circle: {chain}")
        self._included += 1
        if len(self._stack) >= MAX_INCLUDE_DEPTH or self._included > MAX_INCLUDED_FILES:
            raise wrong(
                directive.place,
                f"includes must be at most {MAX_INCLUDE_DEPTH} deep and {MAX_INCLUDED_FILES} in "
                "all; does a file include itself by a copy?",
            )
        self._push(path, name)

    def _peek(self) -> Token | None:
        """The next token of the file that is being read; None at its end."""
        if self._ahead is None and self._stack:
            self._ahead = next(self._stack[-1][1], None)
        return self._ahead

    def _take(self) -> Token | None:
        """The next token, going back to the including file at the end of one."""
        while self._stack and self._peek() is None:
            self._stack.pop()
        token, self._ahead = self._ahead, None
        self._count += 1
        if token is not None and self._count > MAX_TOKENS:
            raise wrong(token.place, f"a scene must have at most {MAX_TOKENS} words")
        return token

    def _next(self, place: Place, wanted: str) -> Token:
        """The next token of the same file, which must be there."""
        if self._peek() is None:
            raise wrong(place, f"the file ends where {wanted} must follow")
        token = self._take()
        assert token is not None
        return token

    def _directive(self, token: Token) -> Directive:
        name = str(token.value)
        if token.kind != "word" or name not in DIRECTIVES:
            close = difflib.get_close_matches(name, DIRECTIVES, n=2) if token.kind == "word" else []
            hint = f"; did you mean {' or '.join(close)}?" if close else ""
            raise wrong(token.place, f"a directive must stand here, got {token.shown()}{hint}")
        if name in _NUMBERS:
            return Directive(name, token.place, numbers=self._plain_numbers(token, _NUMBERS[name]))
        if name in _STRINGS:
            return Directive(name, token.place, strings=self._strings(token, _STRINGS[name]))
        if name == "Option":
            return self._option(token)
        if name in _PARAMETERS:
            strings = self._strings(token, _PARAMETERS[name])
            return Directive(name, token.place, strings, parameters=self._parameters(name))
        return Directive(name, token.place, title=token.name)

    def _option(self, directive: Token) -> Directive:
        """Version 4's options of the renderer: a name and a value, which say nothing of a scene."""
        strings = self._strings(directive, 1)
        self._values(directive, strings[0])
        return Directive("Option", directive.place, strings)

    def _plain_numbers(self, directive: Token, count: int) -> tuple[float, ...]:
        wanted = f"{directive.value} takes {count} numbers"
        numbers: list[float] = []
        while len(numbers) < count:
            token = self._next(directive.place, wanted)
            if token.kind == "number":
                numbers.append(float(token.value))
            elif token.kind == "numbers":
                numbers.extend(np.asarray(token.value)[: count + 1].tolist())
            else:
                raise wrong(token.place, f"{wanted}, got {token.shown()} after {len(numbers)}")
        if len(numbers) > count:
            raise wrong(directive.place, f"{wanted}, got more")
        return tuple(numbers)

    def _strings(self, directive: Token, count: int) -> tuple[str, ...]:
        wanted = f"{directive.value} takes {count} string{'s' if count > 1 else ''}"
        strings: list[str] = []
        while len(strings) < count:
            ahead = self._peek()
            is_over = ahead is None or ahead.kind != "string"
            if directive.value == "MediumInterface" and strings and is_over:
                break
            token = self._next(directive.place, wanted)
            is_word = token.kind == "word" and directive.value == "ActiveTransform"
            if token.kind != "string" and not is_word:
                raise wrong(token.place, f"{wanted}, got {token.shown()}")
            strings.append(str(token.value))
        return tuple(strings)

    def _parameters(self, directive: str) -> dict[str, Parameter]:
        found: dict[str, Parameter] = {}
        while (ahead := self._peek()) is not None and ahead.kind == "string":
            parameter = self._parameter()
            if parameter.name in found:
                first = found[parameter.name].place
                raise wrong(
                    parameter.place,
                    f"parameter {parameter.name!r} of {directive} is given twice, first in line "
                    f"{first.line}; remove one",
                )
            found[parameter.name] = parameter
        return found

    def _parameter(self) -> Parameter:
        token = self._take()
        assert token is not None
        words = str(token.value).split()
        if len(words) != 2:
            raise wrong(
                token.place,
                f'a parameter must be declared as "type name", got {token.shown()}',
            )
        kind = _SAME_TYPE.get(words[0], words[0])
        if words[0] not in TYPES:
            close = difflib.get_close_matches(words[0], TYPES, n=2)
            hint = f"; did you mean {' or '.join(close)}?" if close else ""
            raise wrong(token.place, f"unknown type {words[0]!r} of parameter {words[1]!r}{hint}")
        values = self._values(token, words[1])
        return Parameter(kind, words[1], _checked(kind, words[1], values, token.place), token.place)

    def _values(self, declaration: Token, name: str) -> list[Token]:
        first = self._next(declaration.place, f"the value of parameter {name!r}")
        if first.kind in ("number", "numbers", "string"):
            return [first]
        if first.kind == "word" and first.value in ("true", "false"):
            return [first]
        if first.kind != "open":
            raise wrong(first.place, f"parameter {name!r} must have a value, got {first.shown()}")
        values: list[Token] = []
        while True:
            token = self._next(first.place, f"the ] of parameter {name!r}")
            if token.kind == "close":
                return values
            if token.kind in ("open", "numbers"):
                raise wrong(token.place, f"lists must not lie inside lists (parameter {name!r})")
            values.append(token)


def _checked(
    kind: str, name: str, values: list[Token], place: Place
) -> np.ndarray | tuple[str, ...] | tuple[bool, ...]:
    """The values of a parameter as its type demands them."""
    numeric = all(token.kind in ("number", "numbers") for token in values)
    if kind in _NUMERIC or (kind == "spectrum" and numeric and values):
        if not numeric:
            bad = next(t for t in values if t.kind not in ("number", "numbers"))
            raise wrong(bad.place, f"{kind} {name!r} must be numbers, got {bad.shown()}")
        array = _joined(values)
        size = _GROUPS.get(kind, 1)
        if len(array) % size:
            raise wrong(
                place,
                f"{kind} {name!r} must have a multiple of {size} numbers, got {len(array)}",
            )
        if kind == "integer" and not np.all(array == np.rint(array)):
            raise wrong(place, f"integer {name!r} must be whole numbers")
        return array
    if kind == "bool":
        if not all(t.kind in ("word", "string") and t.value in ("true", "false") for t in values):
            raise wrong(place, f"bool {name!r} must be true or false")
        return tuple(token.value == "true" for token in values)
    for token in values:
        if token.kind != "string":
            raise wrong(token.place, f"{kind} {name!r} must be a string, got {token.shown()}")
    return tuple(str(token.value) for token in values)


def _joined(values: list[Token]) -> np.ndarray:
    if len(values) == 1 and values[0].kind == "numbers":
        return np.asarray(values[0].value)
    return np.array([token.value for token in values], dtype=np.float64)

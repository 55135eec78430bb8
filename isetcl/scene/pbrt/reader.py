"""A scene from the directives of a PBRT file."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from isetcl.errors import FileError, OutOfMemoryError
from isetcl.scene.light import Light
from isetcl.scene.model import Scene
from isetcl.scene.pbrt.files import SceneFiles
from isetcl.scene.pbrt.halves import joined_halves
from isetcl.scene.pbrt.lights import LightReader
from isetcl.scene.pbrt.materials import MaterialReader
from isetcl.scene.pbrt.parameters import Parameters
from isetcl.scene.pbrt.parser import Directive, Parameter, parse
from isetcl.scene.pbrt.patterns import level
from isetcl.scene.pbrt.places import Notes, Place, located, wrong
from isetcl.scene.pbrt.shapes import ShapeReader
from isetcl.scene.pbrt.spectra import SpectrumReader, is_named
from isetcl.scene.pbrt.stage import Part, Stage
from isetcl.scene.pbrt.surfaces import Surface, clipped
from isetcl.scene.pbrt.textures import TextureReader
from isetcl.scene.pbrt.transforms import (
    eye_from_world,
    inverse,
    look_at,
    product,
    rotation,
    scaling,
    stated,
    translation,
)
from isetcl.scene.pbrt.version import version_of

MAX_NESTING = 10_000
MM_PER_M = 1000.0
_FILE_NAMES = ("filename", "mapname")
_RENDERING = (
    "Film", "Sampler", "Integrator", "SurfaceIntegrator", "VolumeIntegrator", "Renderer",
    "Accelerator", "PixelFilter", "Option", "WorldEnd",
)  # fmt: skip


def read_scene(path: Path, *, allow_outside: bool = False) -> Scene:
    """The scene of a PBRT file, version 3 or 4, seen by an eye where its camera stands.

    Parameters
    ----------
    path
        The main file.
    allow_outside
        Whether files outside its folder may be read.

    Raises
    ------
    FileError
        If the file breaks the grammar, or files are missing.
    InvalidInputError
        If what it describes cannot be.
    OutOfMemoryError
        If it would not fit.
    """
    try:
        files = SceneFiles(path, allow_outside=allow_outside)
        directives = parse(path, files)
        _look_for_files(directives, files)
        files.check()
        notes = Notes(path.name)
        # Numbers that overflow become infinite, which whatever takes them refuses.
        with np.errstate(all="ignore"):
            scene = _Reader(files, notes, version_of(directives), path.stem).run(directives)
    except MemoryError as error:
        if isinstance(error, OutOfMemoryError):
            raise
        raise OutOfMemoryError(
            f"scene {str(path)!r} does not fit into memory; use fewer triangles or smaller images"
        ) from error
    notes.warn()
    return scene


def _look_for_files(directives: list[Directive], files: SceneFiles) -> None:
    """Look up all files that the scene needs, so that all missing ones are told at once."""
    for directive in directives:
        needs = directive.name in ("Shape", "Texture", "LightSource", "AreaLightSource")
        if not needs and directive.name not in ("Material", "MakeNamedMaterial"):
            continue
        for parameter in directive.parameters.values():
            values = parameter.values
            if isinstance(values, np.ndarray) or len(values) != 1:
                continue
            name = str(values[0])
            is_file = needs and parameter.type == "string" and parameter.name in _FILE_NAMES
            is_spectrum = parameter.type == "spectrum" and not is_named(name)
            if (is_file and _is_read(directive)) or is_spectrum:
                files.find(name, parameter.place)


def _is_read(directive: Directive) -> bool:
    """Whether files of a directive are read at all."""
    kind = directive.strings[-1]
    return not (
        (directive.name == "LightSource" and kind in ("projection", "goniometric"))
        or (directive.name == "Texture" and kind != "imagemap")
    )


@dataclass
class _State:
    """What AttributeBegin keeps: the transform, the material, the light, defaults, the name."""

    matrix: np.ndarray = field(default_factory=lambda: np.eye(4))
    is_active: bool = True
    is_reversed: bool = False
    material: tuple[str, str, Parameters] | None = None
    light: tuple[str, Parameters] | None = None
    defaults: dict[str, dict[str, Parameter]] = field(default_factory=dict)
    title: str = ""

    def copy(self) -> _State:
        """The same state, to be changed apart."""
        other = copy.copy(self)
        other.defaults = {target: dict(given) for target, given in self.defaults.items()}
        return other


class _Reader:
    """Carries out directives in turn."""

    def __init__(self, files: SceneFiles, notes: Notes, version: int, name: str) -> None:
        self._notes = notes
        self._name = name
        self._spectra = SpectrumReader(files, notes, version)
        self._textures = TextureReader(files, self._spectra, notes)
        self._materials = MaterialReader(self._spectra, self._textures, notes, version)
        self._lights = LightReader(self._spectra, self._textures, notes, version)
        self._shapes = ShapeReader(files, notes, version)
        self._state = _State()
        self._stack: list[tuple[str, _State, Place]] = []
        self._systems: dict[str, np.ndarray] = {}
        self._camera: tuple[np.ndarray, Place, float] | None = None
        self._unit_m = 1.0
        self._in_world = False
        self._definition: tuple[str, Place] | None = None
        self._definitions: dict[str, list[Part]] = {}
        self._stage = Stage(self._lights, notes)
        self._sources: list[Light] = []
        self._read: list[Parameters] = []
        self._handlers: dict[str, Callable[[Directive], None]] = {
            "Identity": lambda d: self._set(np.eye(4), d.place),
            "Translate": lambda d: self._turn(translation(*d.numbers), d.place),
            "Scale": lambda d: self._turn(scaling(*d.numbers), d.place),
            "Rotate": lambda d: self._turn(rotation(d.numbers, d.place), d.place),
            "LookAt": lambda d: self._turn(look_at(d.numbers, d.place), d.place),
            "Transform": lambda d: self._set(stated(d.numbers, d.place), d.place),
            "ConcatTransform": lambda d: self._turn(stated(d.numbers, d.place), d.place),
            "CoordinateSystem": self._coordinate_system,
            "CoordSysTransform": self._use_coordinate_system,
            "ActiveTransform": self._active_transform,
            "TransformTimes": lambda d: self._motion(d),
            "ReverseOrientation": self._reverse,
            "AttributeBegin": self._begin,
            "AttributeEnd": self._end,
            "TransformBegin": self._begin,
            "TransformEnd": self._end,
            "ObjectBegin": self._object_begin,
            "ObjectEnd": self._object_end,
            "ObjectInstance": self._object_instance,
            "WorldBegin": self._world_begin,
            "Camera": self._camera_here,
            "ColorSpace": self._colour_space,
            "Attribute": self._attribute,
            "Material": self._material,
            "NamedMaterial": self._named_material,
            "MakeNamedMaterial": self._make_named_material,
            "MakeNamedMedium": self._medium,
            "MediumInterface": self._medium,
            "Texture": self._texture,
            "AreaLightSource": self._area_light,
            "LightSource": self._light_source,
            "Shape": self._shape,
        }

    def run(self, directives: list[Directive]) -> Scene:
        """The scene of all directives."""
        for directive in directives:
            if directive.name in _RENDERING:
                continue
            try:
                self._handlers[directive.name](directive)
            except (ArithmeticError, np.linalg.LinAlgError) as error:
                raise wrong(
                    directive.place,
                    f"numbers of {directive.name} must be of the size of things in metres, not "
                    "beyond 1e100",
                ) from error
        self._check_end(directives)
        self._tell_unused()
        return Scene(
            tuple(joined_halves(self._stage.objects)),
            self._lights.sky.background(),
            self._name,
            tuple(self._sources),
        )

    def _check_end(self, directives: list[Directive]) -> None:
        if self._stack:
            kind, _, where = self._stack[-1]
            raise wrong(where, f"{kind}Begin has no {kind}End; add it")
        if self._definition is not None:
            raise wrong(self._definition[1], "ObjectBegin has no ObjectEnd; add it")
        if not self._in_world:
            what = f"it ends after {directives[-1].name}" if directives else "it is empty"
            raise FileError(
                f"scene {self._name!r} must have WorldBegin, then shapes and lights, but {what}"
            )

    def _tell_unused(self) -> None:
        for parameters in self._read:
            for parameter in parameters.unused():
                what = f"{parameter.name!r} of {parameters.directive}"
                self._notes.add("parameters not known, left out", what, parameter.place)

    def _parameters(self, directive: Directive, target: str = "") -> Parameters:
        parameters = Parameters(directive, self._state.defaults.get(target))
        # Materials and lights of shapes are made when a shape has them.
        parameters.is_needed = target != "material" and directive.name != "AreaLightSource"
        self._read.append(parameters)
        return parameters

    # Transforms

    def _set(self, matrix: np.ndarray, _: Place) -> None:
        if self._state.is_active:
            self._state.matrix = matrix

    def _turn(self, matrix: np.ndarray, where: Place) -> None:
        if self._state.is_active:
            self._state.matrix = product(self._state.matrix, matrix, where)

    def _coordinate_system(self, directive: Directive) -> None:
        self._systems[directive.strings[0]] = self._state.matrix

    def _use_coordinate_system(self, directive: Directive) -> None:
        name = directive.strings[0]
        if name not in self._systems:
            known = ", ".join(sorted(self._systems)) or "none"
            raise wrong(directive.place, f"unknown coordinate system {name!r} (known: {known})")
        self._set(self._systems[name], directive.place)

    def _active_transform(self, directive: Directive) -> None:
        which = directive.strings[0]
        if which not in ("StartTime", "EndTime", "All"):
            raise wrong(
                directive.place, f"ActiveTransform must be StartTime, EndTime or All, got {which}"
            )
        self._state.is_active = which != "EndTime"
        self._motion(directive)

    def _motion(self, directive: Directive) -> None:
        self._notes.add("motion left out, the start taken", directive.name, directive.place)

    def _reverse(self, _: Directive) -> None:
        self._state.is_reversed = not self._state.is_reversed

    # Blocks

    def _begin(self, directive: Directive) -> None:
        if len(self._stack) >= MAX_NESTING:
            raise wrong(directive.place, f"blocks must be nested at most {MAX_NESTING} deep")
        kind = directive.name.removesuffix("Begin")
        self._stack.append((kind, self._state, directive.place))
        self._state = self._state.copy()
        self._state.title = directive.title or self._state.title

    def _end(self, directive: Directive) -> None:
        kind = directive.name.removesuffix("End")
        if not self._stack or self._stack[-1][0] != kind:
            opened = f"; {self._stack[-1][0]}Begin is open" if self._stack else ""
            raise wrong(directive.place, f"{directive.name} must close {kind}Begin{opened}")
        saved = self._stack.pop()[1]
        if kind == "Transform":
            self._state.matrix = saved.matrix
        else:
            self._state = saved

    def _object_begin(self, directive: Directive) -> None:
        self._check_world(directive)
        if self._definition is not None:
            raise wrong(directive.place, "ObjectBegin must not stand inside another")
        self._stack.append(("Object", self._state, directive.place))
        self._state = self._state.copy()
        self._definition = (directive.strings[0], directive.place)
        self._definitions[directive.strings[0]] = []

    def _object_end(self, directive: Directive) -> None:
        if self._definition is None or not self._stack or self._stack[-1][0] != "Object":
            raise wrong(directive.place, "ObjectEnd must close ObjectBegin")
        self._state = self._stack.pop()[1]
        self._definition = None

    def _object_instance(self, directive: Directive) -> None:
        self._check_world(directive)
        name = directive.strings[0]
        if self._definition is not None:
            raise wrong(directive.place, "ObjectInstance must not stand inside ObjectBegin")
        if name not in self._definitions:
            raise wrong(directive.place, f"object {name!r} is not defined; use ObjectBegin first")
        with located(directive.place):
            parts = self._definitions[name]
            for part in parts:
                called = f"{part.name} of {self._state.title or name}"
                if self._state.title and len(parts) == 1:
                    called = self._state.title
                self._stage.add(part, self._state.matrix, called, directive.place)

    def _world_begin(self, directive: Directive) -> None:
        if self._in_world:
            raise wrong(directive.place, "WorldBegin must stand once in a scene")
        if self._stack:
            raise wrong(self._stack[-1][2], f"{self._stack[-1][0]}Begin is open at WorldBegin")
        if self._camera is None and not np.array_equal(self._state.matrix, np.eye(4)):
            self._camera = (self._state.matrix, directive.place, 1.0)
        if self._camera is not None:
            matrix, where, self._unit_m = self._camera
            self._stage.eye, scale = eye_from_world(matrix, where)
            if not abs(scale - 1.0) < 1e-6:
                size = "differs by direction" if np.isnan(scale) else f"is {scale:g}"
                self._notes.add("scale of the camera left out", f"it {size}", where)
            self._stage.eye = product(scaling(*[self._unit_m] * 3), self._stage.eye, where)
            self._systems["camera"] = inverse(matrix, where)
        else:
            self._stage.eye = np.diag([1.0, 1.0, -1.0, 1.0])
        self._systems["world"] = np.eye(4)
        self._in_world = True
        self._state.matrix = np.eye(4)
        self._state.is_active = True

    def _check_world(self, directive: Directive) -> None:
        if not self._in_world:
            raise wrong(directive.place, f"{directive.name} must stand after WorldBegin")

    def _camera_here(self, directive: Directive) -> None:
        millimetres = directive.parameters.get("mmUnits") or directive.parameters.get("mmunits")
        in_mm = millimetres is not None and str(millimetres.values[0]).lower() == "true"
        unit_m = 1.0 / MM_PER_M if in_mm else 1.0
        self._camera = (self._state.matrix, directive.place, unit_m)

    # What things are made of

    def _colour_space(self, directive: Directive) -> None:
        if not self._spectra.set_colour_space(directive.strings[0]):
            raise wrong(
                directive.place,
                f"unknown colour space {directive.strings[0]!r} (known: srgb, dci-p3, rec2020, "
                "aces2065-1)",
            )

    def _attribute(self, directive: Directive) -> None:
        target = directive.strings[0]
        if target not in ("shape", "light", "material", "medium", "texture"):
            raise wrong(
                directive.place,
                f"Attribute must be for shape, light, material, medium or texture, got {target!r}",
            )
        self._state.defaults.setdefault(target, {}).update(directive.parameters)

    def _material(self, directive: Directive) -> None:
        parameters = self._parameters(directive, "material")
        self._state.material = (directive.strings[0], "", parameters)

    def _named_material(self, directive: Directive) -> None:
        self._state.material = ("", directive.strings[0], self._parameters(directive))

    def _make_named_material(self, directive: Directive) -> None:
        parameters = self._parameters(directive, "material")
        kind = parameters.text("type")
        if "type" not in parameters:
            raise wrong(directive.place, "MakeNamedMaterial must have a string type")
        self._materials.name(directive.strings[0], kind, parameters)

    def _medium(self, directive: Directive) -> None:
        if any(directive.strings):
            self._notes.add("media left out", directive.name, directive.place)

    def _texture(self, directive: Directive) -> None:
        name, kind, form = directive.strings
        self._textures.define(name, kind, form, self._parameters(directive, "texture"))

    def _area_light(self, directive: Directive) -> None:
        self._state.light = (directive.strings[0], self._parameters(directive, "light"))

    def _light_source(self, directive: Directive) -> None:
        self._check_world(directive)
        matrix = product(self._stage.eye, self._state.matrix, directive.place)
        parameters = self._parameters(directive, "light")
        self._sources += self._lights.read(directive.strings[0], parameters, matrix, self._unit_m)

    def _surface(self, directive: Directive) -> Surface:
        if self._state.material is None:
            return self._materials.default(Parameters(directive))
        kind, name, parameters = self._state.material
        if name:
            return self._materials.named(name, parameters)
        return self._materials.make(kind, parameters)

    # Shapes

    def _shape(self, directive: Directive) -> None:
        self._check_world(directive)
        kind = directive.strings[0]
        parameters = self._parameters(directive, "shape")
        alpha = self._textures.grey(parameters, "alpha", 1.0)
        geometry = self._shapes.read(kind, parameters)
        if geometry is None:
            return
        assert alpha is not None
        part = Part(
            self._state.title or f"{kind} in line {directive.place.line}",
            geometry,
            self._state.matrix,
            self._state.is_reversed,
            self._surface(directive),
            clipped(level(alpha, self._notes, directive.place)),
            self._state.light,
            directive.place,
        )
        if part.surface.material is None and part.light is None:
            self._notes.add("invisible boundaries left out", "interface", directive.place)
            return
        if self._definition is not None:
            self._definitions[self._definition[0]].append(part)
            return
        with located(directive.place):
            self._stage.add(part, None, part.name, directive.place)

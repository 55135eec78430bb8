"""What is looked at: shapes, what they send out, and the scene that holds them.

World frame: metres, right-handed, +x to the viewer's right, +y up; the corneal vertex is the
origin and the eye looks along -z.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_positive, check_type
from isetcl.scene.light import LIGHTS, Environment, Light
from isetcl.scene.light_field import LightField
from isetcl.scene.material import EMITTING, SCATTERING, Emission, Material, UnlitReflectance
from isetcl.scene.mesh import Instance, Mesh
from isetcl.scene.specular import Level, check_level, level_digest
from isetcl.scene.texture import Checkerboard, Image
from isetcl.spectrum import Spectrum

if TYPE_CHECKING:
    from isetcl.eye.model import Eye

Vector = Sequence[float] | np.ndarray


def _vector(name: str, value: tuple[float, float, float]) -> tuple[float, float, float]:
    array = check_array(name, value)
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise InvalidInputError(f"{name} must be three finite numbers in metres, got {value!r}")
    return float(array[0]), float(array[1]), float(array[2])


@dataclass(frozen=True)
class Quad:
    """A parallelogram: a corner and the edges from it, metres. u runs along the first edge."""

    corner_m: tuple[float, float, float]
    edge_u_m: tuple[float, float, float]
    edge_v_m: tuple[float, float, float]

    def __post_init__(self) -> None:
        for name in ("corner_m", "edge_u_m", "edge_v_m"):
            object.__setattr__(self, name, _vector(f"quad: {name}", getattr(self, name)))
        u, v = np.array(self.edge_u_m), np.array(self.edge_v_m)
        area = np.linalg.norm(np.cross(u, v))
        if not area > 1e-12 * np.linalg.norm(u) * np.linalg.norm(v):
            raise InvalidInputError(
                f"quad: edge_u_m and edge_v_m must span an area, got {self.edge_u_m} and "
                f"{self.edge_v_m}"
            )


@dataclass(frozen=True)
class Disc:
    """A flat disc: centre and radius in metres, and the direction it faces. v points up."""

    centre_m: tuple[float, float, float]
    radius_m: float
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre_m", _vector("disc: centre_m", self.centre_m))
        object.__setattr__(self, "normal", _vector("disc: normal", self.normal))
        check_positive("disc: radius_m", self.radius_m, "m")
        if not np.any(self.normal):
            raise InvalidInputError("disc: normal must not be zero, got (0, 0, 0)")

    def bounding_quad(self) -> Quad:
        """The square around the disc, whose (u, v) are the disc's texture coordinates."""
        normal = np.array(self.normal) / np.linalg.norm(self.normal)
        up = np.array([0.0, 1.0, 0.0]) if abs(normal[1]) < 0.999 else np.array([0.0, 0.0, -1.0])
        right = np.cross(up, normal)
        right *= self.radius_m / np.linalg.norm(right)
        upward = np.cross(normal, right)
        corner = np.array(self.centre_m) - right - upward
        return Quad(tuple(corner), tuple(2.0 * right), tuple(2.0 * upward))


@dataclass(frozen=True)
class Sphere:
    """A sphere: centre and radius in metres. u is longitude about y, v latitude from the south."""

    centre_m: tuple[float, float, float]
    radius_m: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre_m", _vector("sphere: centre_m", self.centre_m))
        check_positive("sphere: radius_m", self.radius_m, "m")


Shape = Quad | Disc | Sphere | Mesh | Instance
SHAPES = (Quad, Disc, Sphere, Mesh, Instance)
"""The kinds of shape."""


@dataclass(frozen=True, eq=False)
class SceneObject:
    """A shape with its material and a name for messages.

    Parameters
    ----------
    name, shape, material
        What it is called, where it is, what it does with light.
    emission
        Light that it sends out besides scattering some; a material that only sends out light is
        its own emission.
    opacity
        Share of the light that meets the surface; the rest passes as if nothing were there. A grey
        texture cuts out leaves and letters.

    Raises
    ------
    InvalidInputError
        If a part is of the wrong kind, or emission is stated twice.
    """

    name: str
    shape: Shape
    material: Material
    emission: Emission | None = None
    opacity: Level = 1.0

    def __post_init__(self) -> None:
        check_type("scene object: name", self.name, str)
        check_type(f"object {self.name!r}: shape", self.shape, SHAPES)
        check_type(f"object {self.name!r}: material", self.material, EMITTING + SCATTERING)
        check_level(f"object {self.name!r}: opacity", self.opacity)
        self._check_light_field()
        if self.emission is None:
            return
        check_type(f"object {self.name!r}: emission", self.emission, Emission)
        if not self.scatters:
            raise InvalidInputError(
                f"object {self.name!r}: emission must be None where the material sends out light "
                "itself; combine them in the material"
            )
        if self.emission.is_additive:
            raise InvalidInputError(
                f"object {self.name!r}: an additive emission lets light pass and cannot scatter "
                "it; make it the material"
            )

    def _check_light_field(self) -> None:
        emitted = self.material if isinstance(self.material, EMITTING) else self.emission
        if isinstance(emitted, Emission) and isinstance(emitted.texture, LightField):
            check_type(
                f"object {self.name!r}: shape of a light field",
                self.shape,
                Quad,
                "light fields know directions along the edges of a Quad",
            )

    @property
    def scatters(self) -> bool:
        """Whether the surface scatters light that falls on it."""
        return isinstance(self.material, SCATTERING)

    @property
    def emitted(self) -> Emission | UnlitReflectance | None:
        """What the surface sends out by itself."""
        return self.material if isinstance(self.material, EMITTING) else self.emission

    @property
    def is_opaque(self) -> bool:
        """Whether nothing behind the surface shows through it."""
        additive = isinstance(self.material, Emission) and self.material.is_additive
        return isinstance(self.opacity, (int, float)) and self.opacity == 1.0 and not additive

    def spectra(self) -> tuple[Spectrum, ...]:
        """Spectra of what it sends out, then of what it reflects."""
        emission = () if self.emission is None else self.emission.spectra()
        return (*emission, *self.material.spectra())

    def digest(self) -> str:
        """A hash, for provenance."""
        mesh = isinstance(self.shape, (Mesh, Instance))
        parts = [
            self.shape.digest() if mesh else repr(self.shape),  # type: ignore[union-attr]
            self.material.digest(),
            self.emission.digest() if self.emission else "",
            level_digest(self.opacity),
        ]
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]


@dataclass(frozen=True, eq=False)
class Scene:
    """A set of objects before a background.

    Parameters
    ----------
    objects
        The objects. Where two coincide exactly, the earlier one is seen.
    background
        Spectral radiance from directions in which there is nothing, W m^-2 sr^-1 nm^-1; None is
        black. An `Environment` where it differs by direction. It lights the scene, too.
    name
        For reports.
    lights
        Lights without a surface.
    """

    objects: tuple[SceneObject, ...] = ()
    background: Spectrum | Environment | None = None
    name: str = "scene"
    lights: tuple[Light, ...] = ()
    _digest: str = field(init=False, repr=False, default="")

    def __post_init__(self) -> None:
        check_type("scene: objects", self.objects, (tuple, list))
        object.__setattr__(self, "objects", tuple(self.objects))
        for i, item in enumerate(self.objects):
            check_type(f"scene: objects[{i}]", item, SceneObject)
        if self.background is not None:
            check_type("scene: background", self.background, (Spectrum, Environment))
        check_type("scene: lights", self.lights, (tuple, list))
        object.__setattr__(self, "lights", tuple(self.lights))
        for i, light in enumerate(self.lights):
            check_type(f"scene: lights[{i}]", light, LIGHTS)
        object.__setattr__(self, "_digest", self._hash())

    def save(self, path: str | Path) -> None:
        """Write the scene as PBRT 4 text (.pbrt), which `load_scene` reads back.

        Meshes (PLY) and pictures (PFM) go beside it. What PBRT has no words for is listed in
        warnings, one a kind.

        Raises
        ------
        FileError
            If a file cannot be written, or the name does not end in .pbrt.
        """
        from isetcl.scene.pbrt.writer import write_scene

        write_scene(self, path)

    @property
    def has_reflection(self) -> bool:
        """Whether any surface scatters light, so that paths go on behind it."""
        return any(item.scatters for item in self.objects)

    @property
    def has_meshes(self) -> bool:
        """Whether any shape is a triangle mesh."""
        return any(isinstance(item.shape, (Mesh, Instance)) for item in self.objects)

    @property
    def is_flat_light(self) -> bool:
        """Whether all that is seen is opaque light of analytic shapes before an even background."""
        plain = all(
            item.is_opaque and not item.scatters and _is_even(item.emitted) for item in self.objects
        )
        return plain and not self.has_meshes and not isinstance(self.background, Environment)

    def digest(self) -> str:
        """A hash of everything in the scene, for provenance and caches."""
        return self._digest

    def find(self, pattern: str) -> tuple[str, ...]:
        """Names of the objects that fit a name or pattern: `edit.find`."""
        from isetcl.scene import edit

        return edit.find(self, pattern)

    def moved(self, name: str, offset_m: Vector) -> Scene:
        """A scene with objects moved by (x, y, z) in metres: `edit.moved`."""
        from isetcl.scene import edit

        return edit.moved(self, name, offset_m)

    def rotated(
        self, name: str, axis: str | Vector, angle_deg: float, about_m: Vector | None = None
    ) -> Scene:
        """A scene with objects turned, about their centres or a point: `edit.rotated`."""
        from isetcl.scene import edit

        return edit.rotated(self, name, axis, angle_deg, about_m)

    def scaled(self, name: str, factor: float | Vector, about_m: Vector | None = None) -> Scene:
        """A scene with objects enlarged, about their centres or a point: `edit.scaled`."""
        from isetcl.scene import edit

        return edit.scaled(self, name, factor, about_m)

    def transformed(self, name: str, matrix: np.ndarray) -> Scene:
        """A scene with objects under an affine map (4, 4): `edit.transformed`."""
        from isetcl.scene import edit

        return edit.transformed(self, name, matrix)

    def with_material(self, name: str, material: Material) -> Scene:
        """A scene with objects of another material: `edit.with_material`."""
        from isetcl.scene import edit

        return edit.with_material(self, name, material)

    def recoloured(self, name: str, reflectance: Spectrum) -> Scene:
        """A scene with objects of another reflectance: `edit.recoloured`."""
        from isetcl.scene import edit

        return edit.recoloured(self, name, reflectance)

    def without(self, name: str) -> Scene:
        """A scene without some of its objects: `edit.without`."""
        from isetcl.scene import edit

        return edit.without(self, name)

    def added(self, *objects: SceneObject) -> Scene:
        """A scene with more objects: `edit.added`."""
        from isetcl.scene import edit

        return edit.added(self, *objects)

    def with_lights(self, *lights: Light) -> Scene:
        """A scene with other lights: `edit.with_lights`."""
        from isetcl.scene import edit

        return edit.with_lights(self, *lights)

    def with_background(self, background: Spectrum | Environment | None) -> Scene:
        """A scene before another background: `edit.with_background`."""
        from isetcl.scene import edit

        return edit.with_background(self, background)

    def seen_from(
        self,
        eye_at_m: Vector = (0.0, 0.0, 0.0),
        look_at_m: Vector | None = None,
        *,
        gaze_deg: tuple[float, float] | None = None,
        up: Vector = (0.0, 1.0, 0.0),
    ) -> Scene:
        """The scene as it lies before an eye in another place: `gaze.seen_from`."""
        from isetcl.scene import gaze

        return gaze.seen_from(self, eye_at_m, look_at_m, gaze_deg=gaze_deg, up=up)

    def turned(
        self, gaze_deg: tuple[float, float], *, rotation_centre_mm: float | None = None
    ) -> Scene:
        """The scene as it lies before an eye that has turned in its socket: `gaze.turned`."""
        from isetcl.scene import gaze

        return gaze.turned(self, gaze_deg, rotation_centre_mm=rotation_centre_mm)

    def fixating(
        self, eye: Eye, point_m: Vector, *, rotation_centre_mm: float | None = None
    ) -> Scene:
        """The scene as it lies before an eye whose fovea sees a point: `gaze.fixating`."""
        from isetcl.scene import gaze

        return gaze.fixating(self, eye, point_m, rotation_centre_mm=rotation_centre_mm)

    def binocular(
        self,
        interpupillary_distance_mm: float = 63.0,
        verge_on_m: Vector | None = None,
        *,
        rotation_centre_mm: float | None = None,
    ) -> tuple[Scene, Scene]:
        """The scene as it lies before the left and the right eye: `gaze.binocular`."""
        from isetcl.scene import gaze

        return gaze.binocular(
            self, interpupillary_distance_mm, verge_on_m, rotation_centre_mm=rotation_centre_mm
        )

    def _hash(self) -> str:
        parts = [self.background.digest() if self.background else "black"]
        parts += [item.digest() for item in self.objects]
        parts += [light.digest() for light in self.lights]
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]


def _is_even(emission: Emission | UnlitReflectance | None) -> bool:
    """Whether a surface shines on both sides, with a texture that the direct pipeline knows."""
    if isinstance(emission, Emission) and emission.sides != "both":
        return False
    texture = None if emission is None else emission.texture
    if isinstance(texture, Image):
        return texture.is_plain and texture.channels in (1, 3)
    return texture is None or isinstance(texture, Checkerboard)

"""Editing a scene: finding, moving, painting, adding and leaving out its objects.

Every function returns a new scene; the one it was given stays as it is. Wherever an object is
named, a pattern such as ``"pawn*"`` names all that fit.
"""

from __future__ import annotations

import dataclasses
import difflib
import fnmatch
from collections.abc import Callable

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_positive, check_type
from isetcl.scene.affine import (
    about,
    centre_m,
    check_map,
    moved_shape,
    rotation,
    translation,
    vector,
)
from isetcl.scene.light import LIGHTS, Environment, Light
from isetcl.scene.light_field import LightField
from isetcl.scene.material import Coated, Diffuse, Material, UnlitReflectance
from isetcl.scene.model import Scene, SceneObject, Vector
from isetcl.scene.specular import Mirror
from isetcl.scene.texture import TEXTURES
from isetcl.spectrum import Spectrum

_LISTED = 8


def find(scene: Scene, pattern: str) -> tuple[str, ...]:
    """Names of the objects that fit a pattern, in the order of the scene, each once.

    Parameters
    ----------
    scene
        Where to look.
    pattern
        A name, or a pattern with ``*``, ``?`` and ``[...]``; capitals matter. An object that is
        called exactly so comes before what a pattern would fit.

    Raises
    ------
    InvalidInputError
        If nothing fits; the message names what comes near.
    """
    return tuple(dict.fromkeys(scene.objects[i].name for i in _indices(scene, pattern)))


def _indices(scene: Scene, pattern: str) -> list[int]:
    """Places of the objects that fit a pattern."""
    check_type("name", pattern, str, "pass the name of an object, or a pattern such as 'pawn*'")
    names = [item.name for item in scene.objects]
    exact = [i for i, name in enumerate(names) if name == pattern]
    fitting = exact or [i for i, name in enumerate(names) if fnmatch.fnmatchcase(name, pattern)]
    if fitting:
        return fitting
    known = list(dict.fromkeys(names))
    folded = {name.lower(): name for name in known}
    bare = pattern.strip("*").lower()
    near = [folded[n] for n in difflib.get_close_matches(bare, folded, n=3, cutoff=0.5)]
    near = near or [name for low, name in folded.items() if bare and bare in low][:3]
    hint = f"; did you mean {' or '.join(map(repr, near))}?" if near else ""
    listed = ", ".join(map(repr, known[:_LISTED])) or "none"
    more = f" and {len(known) - _LISTED} more" if len(known) > _LISTED else ""
    raise InvalidInputError(
        f"no object of {scene.name!r} is called {pattern!r}{hint} (objects: {listed}{more})"
    )


def changed(scene: Scene, name: str, change: Callable[[SceneObject], SceneObject]) -> Scene:
    """The scene with a function applied to the objects that a name or pattern fits.

    Raises
    ------
    InvalidInputError
        If nothing fits.
    """
    objects = list(scene.objects)
    for i in _indices(scene, name):
        objects[i] = change(objects[i])
    return dataclasses.replace(scene, objects=tuple(objects))


def transformed(scene: Scene, name: str, matrix: np.ndarray) -> Scene:
    """The scene with objects under an affine map.

    Parameters
    ----------
    scene, name
        The scene, and which objects.
    matrix : array_like, (4, 4)
        The map in world coordinates (metres), for column vectors; its determinant is > 0.

    Raises
    ------
    InvalidInputError
        If nothing fits, or the matrix is not affine, flattens space or mirrors it.
    """
    checked = check_map(matrix)
    return changed(scene, name, lambda item: moved_object(item, checked))


def moved(scene: Scene, name: str, offset_m: Vector) -> Scene:
    """The scene with objects moved by an offset (x, y, z) in metres.

    Raises
    ------
    InvalidInputError
        If nothing fits, or the offset is not three finite numbers.
    """
    return transformed(scene, name, translation(offset_m))


def rotated(
    scene: Scene,
    name: str,
    axis: str | Vector,
    angle_deg: float,
    about_m: Vector | None = None,
) -> Scene:
    """The scene with objects turned.

    Parameters
    ----------
    scene, name
        The scene, and which objects.
    axis
        ``"x"``, ``"y"``, ``"z"`` or a direction; the turn is anticlockwise seen against it.
    angle_deg
        Angle of the turn.
    about_m
        A point on the axis, metres; None is the centre of each object.

    Raises
    ------
    InvalidInputError
        If nothing fits, the axis is none, or a number is not finite.
    """
    return _about_centres(scene, name, rotation(axis, angle_deg), about_m)


def scaled(scene: Scene, name: str, factor: float | Vector, about_m: Vector | None = None) -> Scene:
    """The scene with objects enlarged.

    Parameters
    ----------
    scene, name
        The scene, and which objects.
    factor
        One number > 0, or three along x, y and z.
    about_m
        The point that stays where it is, metres; None is the centre of each object.

    Raises
    ------
    InvalidInputError
        If nothing fits, or a factor is not > 0.
    """
    factors = check_array("factor", factor)
    if factors.shape not in ((), (3,)):
        raise InvalidInputError(f"factor must be one number or three, got {factor!r}")
    values = [check_positive("factor", float(f)) for f in np.broadcast_to(factors, 3)]
    return _about_centres(scene, name, np.diag(values), about_m)


def _about_centres(scene: Scene, name: str, linear: np.ndarray, about_m: Vector | None) -> Scene:
    point = None if about_m is None else vector("about_m", about_m)

    def change(item: SceneObject) -> SceneObject:
        return moved_object(item, about(linear, centre_m(item.shape) if point is None else point))

    return changed(scene, name, change)


def moved_object(item: SceneObject, matrix: np.ndarray) -> SceneObject:
    """An object under an affine map."""
    parts = (item.material, item.emission, item.opacity)
    pattern = any(_has_texture(part) for part in parts)
    return dataclasses.replace(item, shape=moved_shape(item.shape, matrix, is_patterned=pattern))


def _has_texture(part: object) -> bool:
    """Whether a texture is anywhere in a material."""
    if isinstance(part, (*TEXTURES, LightField)):
        return True
    if not dataclasses.is_dataclass(part) or isinstance(part, Spectrum):
        return False
    return any(_has_texture(getattr(part, field.name)) for field in dataclasses.fields(part))


def with_material(scene: Scene, name: str, material: Material) -> Scene:
    """The scene with objects of another material; what they sent out besides goes with the old one.

    Raises
    ------
    InvalidInputError
        If nothing fits, or the material is none.
    """

    def change(item: SceneObject) -> SceneObject:
        return dataclasses.replace(item, material=material, emission=None)

    return changed(scene, name, change)


def recoloured(scene: Scene, name: str, reflectance: Spectrum) -> Scene:
    """The scene with objects of another spectral reflectance, and all else as it was.

    A grey texture stays, as a pattern in the new colour; a coloured one is painted over.

    Raises
    ------
    InvalidInputError
        If nothing fits, or a material has no reflectance.
    """
    check_type("reflectance", reflectance, Spectrum)

    def change(item: SceneObject) -> SceneObject:
        material = item.material
        if isinstance(material, Mirror):
            return dataclasses.replace(
                item, material=dataclasses.replace(material, reflectance=reflectance)
            )
        if not isinstance(material, (Diffuse, Coated, UnlitReflectance)):
            kind = type(material).__name__
            raise InvalidInputError(
                f"object {item.name!r}: its material {kind} has no reflectance; use with_material"
            )
        texture = material.texture
        kept = texture if texture is not None and texture.channels == 1 else None
        painted = dataclasses.replace(material, reflectance=reflectance, texture=kept)
        return dataclasses.replace(item, material=painted)

    return changed(scene, name, change)


def without(scene: Scene, name: str) -> Scene:
    """The scene without some of its objects.

    Raises
    ------
    InvalidInputError
        If nothing fits.
    """
    gone = set(_indices(scene, name))
    kept = tuple(item for i, item in enumerate(scene.objects) if i not in gone)
    return dataclasses.replace(scene, objects=kept)


def added(scene: Scene, *objects: SceneObject) -> Scene:
    """The scene with more objects, behind the others in the list.

    Raises
    ------
    InvalidInputError
        If one is no object.
    """
    for i, item in enumerate(objects):
        check_type(f"objects[{i}]", item, SceneObject, "pass objects one by one")
    return dataclasses.replace(scene, objects=(*scene.objects, *objects))


def with_lights(scene: Scene, *lights: Light) -> Scene:
    """The scene with these lights in the place of its own; none switches them off.

    Raises
    ------
    InvalidInputError
        If one is no light.
    """
    for i, light in enumerate(lights):
        check_type(f"lights[{i}]", light, LIGHTS, "pass lights one by one")
    return dataclasses.replace(scene, lights=tuple(lights))


def with_background(scene: Scene, background: Spectrum | Environment | None) -> Scene:
    """The scene before another background; None is black.

    Raises
    ------
    InvalidInputError
        If it is neither a spectrum nor an environment.
    """
    return dataclasses.replace(scene, background=background)

"""Parts of a scene, placed before the eye."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isetcl.scene.mesh import Instance, Mesh
from isetcl.scene.model import SceneObject, Shape
from isetcl.scene.pbrt.geometry import (
    Flat,
    Geometry,
    Needs,
    Round,
    area_m2,
    place,
    placed_mesh,
    triangles_of,
)
from isetcl.scene.pbrt.lights import LightReader
from isetcl.scene.pbrt.parameters import Parameters
from isetcl.scene.pbrt.places import Notes, Place, wrong
from isetcl.scene.pbrt.surfaces import Level, Surface, has_sides, has_texture, is_black
from isetcl.scene.pbrt.transforms import inverse, product
from isetcl.scene.texture import TEXTURES

MAX_OBJECTS = 1_000_000


@dataclass(frozen=True, eq=False)
class Part:
    """A shape with its surface, before it is placed."""

    name: str
    geometry: Geometry
    matrix: np.ndarray
    is_reversed: bool
    surface: Surface
    opacity: Level
    light: tuple[str, Parameters] | None
    place: Place


class Stage:
    """Gathers the objects of a scene; `eye` maps the file's world to the eye's frame."""

    def __init__(self, lights: LightReader, notes: Notes) -> None:
        self.eye = np.eye(4)
        self.objects: list[SceneObject] = []
        self._lights = lights
        self._notes = notes
        self._meshes: dict[int, Mesh] = {}

    def add(self, part: Part, instance: np.ndarray | None, name: str, where: Place) -> None:
        """Place a part in the world, itself or (with a matrix) as an instance."""
        if len(self.objects) >= MAX_OBJECTS:
            raise wrong(where, f"a scene must have at most {MAX_OBJECTS} objects")
        material = part.surface.material
        is_lit = part.light is not None
        one_sided = is_lit and not part.light[1].flag("twosided", False)  # type: ignore[index]
        has_map = is_lit and "filename" in part.light[1]  # type: ignore[index]
        opacity = self._opacity(part, where)
        needs = Needs(
            uv=has_texture(material) or has_map or isinstance(opacity, TEXTURES),
            sides=has_sides(material) or one_sided,
        )
        shape = self._placed(part, instance, needs, where)
        if isinstance(part.geometry, Round) and isinstance(shape, (Mesh, Instance)):
            what = f"{part.geometry.kind}, stretched, textured or turned inside out"
            self._notes.add("curved shapes made of triangles", what, part.place)
        emission = None
        if part.light is not None:
            emission = self._lights.emission(part.light[1], part.light[0], area_m2(shape))
        if emission is not None and is_black(material):
            self.objects.append(SceneObject(name, shape, emission, opacity=opacity))
        elif material is not None:
            self.objects.append(
                SceneObject(name, shape, material, emission=emission, opacity=opacity)
            )

    def _opacity(self, part: Part, where: Place) -> Level:
        """The share of light that meets a part: its alpha and its material's opacity."""
        own, alpha = part.surface.opacity, part.opacity
        if isinstance(own, TEXTURES) or isinstance(alpha, TEXTURES):
            if own != 1.0 and alpha != 1.0:
                self._notes.add("opacity of materials with alpha left out", "material", where)
            return alpha if own == 1.0 or isinstance(alpha, TEXTURES) else own
        return own * alpha

    def _placed(self, part: Part, instance: np.ndarray | None, needs: Needs, where: Place) -> Shape:
        own = product(self.eye, part.matrix, where)
        if instance is None:
            return place(part.geometry, own, part.is_reversed, needs)
        moved = product(instance, part.matrix, where)
        whole = product(self.eye, moved, where)
        if isinstance(part.geometry, (Round, Flat)):
            shape = place(part.geometry, whole, part.is_reversed, needs)
            if not isinstance(shape, Mesh):
                return shape
        turned = product(product(self.eye, instance, where), inverse(self.eye, where), where)
        key = id(part)
        if key not in self._meshes:
            mesh = placed_mesh(triangles_of(part.geometry), own, part.is_reversed, needs)
            self._meshes[key] = mesh
        return Instance(self._meshes[key], turned)

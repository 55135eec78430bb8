"""What the path pipeline needs of a scene."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from isetcl import memory
from isetcl.eye.field import direction_from_field
from isetcl.render.decision import Decision, left_out
from isetcl.render.kernel_config import TEXELS_PER_FOOTPRINT
from isetcl.render.pack_looks import SMALLEST_LEVEL
from isetcl.retina.grid import RetinalGrid
from isetcl.scene.light import Environment, SpotLight, light_spectrum
from isetcl.scene.light_field import LightField
from isetcl.scene.material import Coated, Diffuse, Emission, Material, Mix, TwoSided
from isetcl.scene.mesh import Instance, Mesh
from isetcl.scene.model import Scene, SceneObject, Sphere
from isetcl.scene.specular import Conductor, Dielectric, Mirror
from isetcl.scene.texture import TEXTURES, Grid, Image, Texture
from isetcl.scene.view import intersect, texels_across
from isetcl.units import MM_PER_M

_BYTES_A_TRIANGLE = {"single": 500, "double": 750}
"""Memory that a triangle takes at the peak of a render, bytes: 340 and 540 were measured with 1.3
million, to which normals and texture coordinates add 60 and 120."""


def parts_of(material: Material) -> Iterator[Material]:
    """A material and those it is combined of."""
    yield material
    if isinstance(material, Mix):
        yield from parts_of(material.first)
        yield from parts_of(material.second)
    elif isinstance(material, TwoSided):
        yield from parts_of(material.front)
        yield from parts_of(material.back)


def textures_of(item: SceneObject) -> Iterator[Texture]:
    """All textures on an object."""
    levels: list[object] = [item.opacity]
    if item.emission is not None:
        levels.append(item.emission.texture)
    for part in parts_of(item.material):
        levels += [part.texture, getattr(part, "roughness", None), getattr(part, "weight", None)]
    yield from (level for level in levels if isinstance(level, TEXTURES))


def combined_depth(material: Material) -> int:
    """Combinations one within another; 0 for a plain material."""
    if isinstance(material, Mix):
        return 1 + max(combined_depth(material.first), combined_depth(material.second))
    if isinstance(material, TwoSided):
        return 1 + max(combined_depth(material.front), combined_depth(material.back))
    return 0


def check_spectra(scene: Scene, wavelengths_nm: np.ndarray) -> None:
    """Raise InvalidInputError unless everything in a scene is known at all wavelengths.

    Raises
    ------
    InvalidInputError
    """
    spectra = [light_spectrum(light) for light in scene.lights]
    if isinstance(scene.background, Environment):
        spectra += scene.background.spectra()
    elif scene.background is not None:
        spectra.append(scene.background)
    for item in scene.objects:
        if item.emission is not None:
            spectra += item.emission.spectra()
        for part in parts_of(item.material):
            spectra += part.spectra()
            if isinstance(part, Diffuse) and part.transmittance is not None:
                spectra.append(part.transmittance)
            if isinstance(part, Conductor):
                part.index.at(wavelengths_nm)
            elif isinstance(part, (Dielectric, Coated)):
                part.index.index(wavelengths_nm)
    for spectrum in spectra:
        spectrum.at(wavelengths_nm)


def check_mesh_memory(scene: Scene, precision: str) -> None:
    """Raise OutOfMemoryError, with the size needed, if the scene's triangles do not fit.

    Raises
    ------
    OutOfMemoryError
    """
    meshes = {}
    for item in scene.objects:
        shape = item.shape
        if isinstance(shape, Instance):
            # Instances that shine are stored triangle by triangle.
            key = shape.mesh.digest() if item.emitted is None else shape.digest()
            meshes[key] = len(shape.mesh.faces)
        elif isinstance(shape, Mesh):
            meshes[shape.digest()] = len(shape.faces)
    triangles = sum(meshes.values())
    if triangles:
        memory.check_memory(
            f"a scene of {triangles:,} triangles",
            triangles * _BYTES_A_TRIANGLE[precision],
            lambda share: f"simplify the meshes to about {int(triangles * share):,} triangles",
        )


def path_images(scene: Scene, grid: RetinalGrid, notes: list[Decision]) -> dict[str, Image]:
    """Pictures to upload averaged down, by the digest of those they replace."""
    halvings: dict[str, tuple[Image, int, float, str]] = {}
    for item in scene.objects:
        images = [texture for texture in textures_of(item) if isinstance(texture, Image)]
        if not images:
            continue
        nearest = _nearest_m(item, grid)
        for image in images:
            pixel_rad = math.radians(min(grid.pitch_deg))
            footprint = texels_across(item.shape, image, nearest, pixel_rad)
            if not math.isfinite(footprint):
                footprint = 1.0
            times = max(0, math.floor(math.log2(max(footprint, 1.0) / TEXELS_PER_FOOTPRINT)))
            known = halvings.get(image.digest())
            if known is None or times < known[1]:
                halvings[image.digest()] = (image, times, footprint, item.name)
    if isinstance(scene.background, Environment) and scene.background.texture is not None:
        # What is on a surface, too, is uploaded once, and the sky needs all of it.
        halvings.pop(scene.background.texture.digest(), None)
    small = {}
    for key, (image, times, footprint, name) in halvings.items():
        if times > 0:
            reason = f"a pixel covers {footprint:.3g} texels of {name!r} across"
            notes.append(Decision("texture filter", f"1/{1 << times}", reason))
            small[key] = image.halved(times)
    return small


def _nearest_m(item: SceneObject, grid: RetinalGrid) -> float:
    """A distance, metres, that no visible part of an object is nearer than; 0 if unknown."""
    pupil_m = np.array([0.0, 0.0, grid.eye.entrance_pupil(grid.wavelength_nm).z_mm / MM_PER_M])
    shape = item.shape
    if isinstance(shape, (Mesh, Instance)):
        mesh = shape.in_place if isinstance(shape, Instance) else shape
        corners = mesh.triangles_m
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        away = np.linalg.norm(corners - pupil_m, axis=2).min(axis=1)
        return float(max(np.min(away - edges), 0.0))
    step_x, step_y = (max(1, n // 64) for n in grid.resolution)
    directions = direction_from_field(*np.meshgrid(grid.x_deg[::step_x], grid.y_deg[::step_y]))
    nearest = float(np.min(intersect(shape, pupil_m, directions).distance_m))
    return nearest if math.isfinite(nearest) else 0.0


def decide_bounces(scene: Scene, max_bounces: int, notes: list[Decision]) -> int:
    """How often paths may be scattered."""
    if not scene.has_reflection:
        reason = "nothing scatters light: what is met first is what is seen"
        notes.append(Decision("lighting", "emission only", reason))
        return 0
    reason = "surfaces scatter light; paths end by chance after the third bounce"
    notes.append(Decision("lighting", f"{max_bounces} bounces", reason))
    return max_bounces


def decide_features(scene: Scene, notes: list[Decision]) -> dict[str, bool | int]:
    """What the path pipeline compiles in of a scene."""
    none = "none in the scene"
    features: dict[str, bool | int] = {
        field: left_out(notes, name, count > 0, f"{count} in the scene", none)
        for field, (name, count) in (
            _shape_counts(scene) | _texture_counts(scene) | _material_counts(scene)
        ).items()
    }
    depth = max((combined_depth(item.material) for item in scene.objects), default=0)
    left_out(notes, "mixed materials", depth > 0, f"{depth} within one another", none)
    features["combined_depth"] = depth
    lights = _lights(scene)
    features["has_reflection"] = scene.has_reflection
    features["has_lights"] = left_out(
        notes,
        "shadow rays",
        lights > 0,
        f"{lights} lights with a place",
        "nothing scatters light" if not scene.has_reflection else "no light has a place",
    )
    spots = sum(isinstance(light, SpotLight) for light in scene.lights)
    features["has_spots"] = left_out(notes, "spot lights", spots > 0, f"{spots} in the scene", none)
    features["has_environment"] = left_out(
        notes,
        "image all around",
        _has_image_around(scene),
        "light differs by direction",
        "the background is even",
    )
    return features


def _has_image_around(scene: Scene) -> bool:
    return isinstance(scene.background, Environment) and scene.background.texture is not None


def _lights(scene: Scene) -> int:
    """Lights that a surface can be lit by, and that have a place or an image."""
    if not scene.has_reflection:
        return 0
    emitters = sum(item.emitted is not None for item in scene.objects)
    return emitters + len(scene.lights) + _has_image_around(scene)


def _shape_counts(scene: Scene) -> dict[str, tuple[str, int]]:
    shapes = [item.shape for item in scene.objects]
    meshes = [s.mesh if isinstance(s, Instance) else s for s in shapes]
    triangles = [m for m in meshes if isinstance(m, Mesh)]
    placed = sum(
        len(m.faces)
        for item, m in zip(scene.objects, meshes, strict=True)
        if isinstance(m, Mesh) and not (isinstance(item.shape, Instance) and item.emitted is None)
    )
    instances = sum(isinstance(i.shape, Instance) and i.emitted is None for i in scene.objects)
    balls = [item for item in scene.objects if isinstance(item.shape, Sphere)]
    return {
        "has_flats": ("flat shapes", len(shapes) - len(triangles) - len(balls)),
        "has_balls": ("spheres", len(balls)),
        "has_textured_balls": ("textured spheres", sum(any(textures_of(item)) for item in balls)),
        "has_triangles": ("hierarchy of triangles", placed),
        "has_instances": ("instances of meshes", instances),
        "has_normals": ("shading normals", sum(mesh.normals is not None for mesh in triangles)),
        "has_uv": ("texture coordinates", sum(mesh.uv is not None for mesh in triangles)),
    }


def _is_additive(item: SceneObject) -> bool:
    return isinstance(item.material, Emission) and item.material.is_additive


def _light_fields(scene: Scene) -> int:
    emitted = [item.emitted for item in scene.objects]
    return sum(e is not None and isinstance(e.texture, LightField) for e in emitted)


def _texture_counts(scene: Scene) -> dict[str, tuple[str, int]]:
    textures = [texture for item in scene.objects for texture in textures_of(item)]
    if isinstance(scene.background, Environment) and scene.background.texture is not None:
        textures.append(scene.background.texture)
    cutouts = sum(
        not (isinstance(i.opacity, (int, float)) and i.opacity == 1.0) for i in scene.objects
    )
    additive = sum(_is_additive(item) for item in scene.objects)
    return {
        "has_pictures": ("images", sum(isinstance(texture, Image) for texture in textures)),
        "has_levels": (
            "pictures averaged by distance",
            sum(isinstance(t, Image) and max(t.shape) >= 2 * SMALLEST_LEVEL for t in textures),
        ),
        "has_grids": ("grids of lines", sum(isinstance(texture, Grid) for texture in textures)),
        "has_light_fields": ("light fields", _light_fields(scene)),
        "has_cutouts": ("cut-out surfaces", cutouts),
        "has_additive": ("surfaces that add light", additive),
    }


def _material_counts(scene: Scene) -> dict[str, tuple[str, int]]:
    parts = [part for item in scene.objects for part in parts_of(item.material)]

    def count(kind: type) -> int:
        return sum(isinstance(part, kind) for part in parts)

    thin = sum(isinstance(part, Diffuse) and part.transmittance is not None for part in parts)
    return {
        "has_translucent": ("translucent sheets", thin),
        "has_mirrors": ("mirrors", count(Mirror)),
        "has_conductors": ("metals", count(Conductor)),
        "has_dielectrics": ("clear bodies", count(Dielectric)),
        "has_coated": ("coated surfaces", count(Coated)),
    }

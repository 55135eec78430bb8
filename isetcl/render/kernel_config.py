"""What is compiled into the pipelines: one field for every #define."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

from isetcl.device.devices import Device
from isetcl.device.eye_features import EyeFeatures
from isetcl.device.layout import Precision


class MaterialKind(IntEnum):
    """How a shape's colour varies over it. The same numbers are compiled into the kernels."""

    UNIFORM = 0
    CHECKERBOARD = 1
    IMAGE = 2


Sampler = Literal["sobol", "random"]
PlaceKind = Literal["none", "disc", "gaussian"]
BendKind = Literal["none", "airy", "iset3d", "optrace", "isotropic"]
_HURB_AXES: tuple[BendKind, ...] = ("iset3d", "optrace", "isotropic")


def eye_defines(config: KernelConfig | PathConfig) -> dict[str, int]:
    """The #defines of the eye: what its surfaces are, and what bends rays inside it."""
    numbers = {f"HURB_{name.upper()}": i for i, name in enumerate(_HURB_AXES)}
    is_hurb = config.diffraction in _HURB_AXES
    return (
        config.eye_feature_defines()
        | numbers
        | {
            "HAS_ASPHERIC_RETINA": int(config.has_aspheric_retina),
            "HAS_ASYMMETRY": int(config.has_asymmetry),
            "HAS_RELIEF": int(config.has_relief),
            "HAS_FAR_SIDE": int(config.has_far_side),
            "HAS_SEMI_DIAMETERS": int(config.has_semi_diameters),
            "HAS_DIFFRACTION": int(config.diffraction != "none"),
            "DIFFRACTION_AIRY": int(config.diffraction == "airy"),
            "HURB_AXES": _HURB_AXES.index(config.diffraction) if is_hurb else 0,
            "HAS_SCATTER": int(config.has_scatter),
            "RANDOM_SAMPLES": int(config.sampler == "random"),
            "HAS_PLACES": int(config.places != "none"),
            "HAS_GAUSSIAN_PLACES": int(config.places == "gaussian"),
        }
    )


@dataclass(frozen=True)
class KernelConfig(EyeFeatures):
    """Compile-time features of the direct pipeline; what an eye needs is in `EyeFeatures`.

    Attributes
    ----------
    precision, vector_width
        Type and lanes of the arithmetic.
    n_basis
        Spectra that span the scene: channels of the film.
    has_aspheric_retina
        The retina is not a sphere, so its normal has to be normalised.
    has_asymmetry
        The eye is no figure of revolution: retina and pupils are functions of two field angles.
    has_relief
        A height map lies on the retina.
    has_far_side
        Some ray may cross a surface beyond its equator.
    has_semi_diameters
        Some ray that passes the stop may be clipped elsewhere.
    diffraction, has_scatter
        What bends rays: "none", "airy" or the axes of HURB; and scatter.
    has_patches, has_discs, has_spheres, has_textured_spheres
        Shapes in the scene.
    has_checkerboards, has_images
        Textures in the scene.
    texture_channels, is_texture_packed
        Format of image texels: 1 or 3 floats, or 3 channels in one word.
    sampler
        Where samples come from: Owen-scrambled Sobol' points, or independent random numbers.
    places
        Pixels are apertures from a list instead of those of a grid: their shape.
    """

    precision: Precision
    vector_width: int
    n_basis: int = 1
    has_aspheric_retina: bool = True
    has_asymmetry: bool = False
    has_relief: bool = False
    has_far_side: bool = True
    has_semi_diameters: bool = True
    diffraction: BendKind = "none"
    has_scatter: bool = False
    has_patches: bool = True
    has_discs: bool = True
    has_spheres: bool = True
    has_textured_spheres: bool = True
    has_checkerboards: bool = True
    has_images: bool = True
    texture_channels: int = 3
    is_texture_packed: bool = False
    sampler: Sampler = "sobol"
    places: PlaceKind = "none"

    def defines(self, device: Device) -> dict[str, int]:
        """The #defines, those of the device included."""
        return (
            device.defines(self.precision, self.vector_width)
            | eye_defines(self)
            | {
                "N_BASIS": self.n_basis,
                "HAS_PATCHES": int(self.has_patches),
                "HAS_DISCS": int(self.has_discs),
                "HAS_SPHERES": int(self.has_spheres),
                "HAS_TEXTURED_SPHERES": int(self.has_textured_spheres),
                "HAS_CHECKERBOARDS": int(self.has_checkerboards),
                "HAS_IMAGES": int(self.has_images),
                "TEXTURE_CHANNELS": self.texture_channels,
                "TEXTURE_PACKED": int(self.is_texture_packed),
            }
        )


SAMPLES_AT_ONCE = 8
"""Samples a pixel that the path pipeline follows at a time: the same whatever the tile, so that
sums are the same too."""


TEXELS_PER_FOOTPRINT = 4
"""Texels that a pixel may cover before pictures are averaged down."""

MOST_PASSES = 64
"""Cut-out or additive surfaces that a ray may pass one after the other."""


GROUP_PIXELS = 64
"""Pixels whose paths a work-item follows where they stay in its cache."""


PATH_LANES = {"single": 16, "double": 8}
"""Most paths side by side: one 512-bit register of them."""


def paths_an_item(device: Device) -> int:
    """Paths that a work-item shades one after the other."""
    return 64 if device.is_cpu else 1


def path_width(device: Device, precision: Precision) -> int:
    """Paths that are shaded side by side: one hardware vector of them on a CPU."""
    return min(device.vector_width(precision), PATH_LANES[precision])


@dataclass(frozen=True)
class PathConfig(EyeFeatures):
    """Compile-time features of the path pipeline, and how far it follows paths.

    Attributes
    ----------
    precision, vector_width
        Type of the arithmetic, and its lanes in the stage that leaves the eye.
    max_bounces
        Times a path may be scattered; 0 if nothing scatters.
    is_fused
        One kernel follows bundles of paths to their ends, instead of stages over all of them.
    starts_given
        Paths begin with given rays, as those through a pinhole, instead of leaving the eye.
    has_aspheric_retina, has_asymmetry, has_relief, has_far_side, has_semi_diameters, diffraction,
    has_scatter
        As in `KernelConfig`.
    has_flats, has_balls, has_textured_balls, has_triangles, has_instances
        Shapes in the scene; triangles in place, and those of instanced meshes.
    has_normals, has_uv
        Whether any mesh has shading normals or texture coordinates.
    has_pictures, has_grids, has_light_fields
        Textures on any shape.
    has_levels
        Pictures averaged down level by level, read by the width of the ray.
    has_reflection, has_lights
        Surfaces that scatter, and lights with a place that they can be lit by.
    has_translucent, has_mirrors, has_conductors, has_dielectrics, has_coated
        Materials besides matt ones.
    combined_depth
        Materials mixed, or different on both sides, one within another; 0 for none.
    has_spots, has_environment
        Spot lights, and an image all around.
    has_cutouts, has_additive
        Surfaces that let light pass.
    n_basis
        Film channels a band: the wavelengths a path carries.
    sampler, places
        As in `KernelConfig`.
    """

    precision: Precision
    vector_width: int
    max_bounces: int
    is_fused: bool = False
    starts_given: bool = False
    has_aspheric_retina: bool = True
    has_asymmetry: bool = False
    has_relief: bool = False
    has_far_side: bool = True
    has_semi_diameters: bool = True
    diffraction: BendKind = "none"
    has_scatter: bool = False
    has_flats: bool = True
    has_balls: bool = True
    has_textured_balls: bool = True
    has_triangles: bool = True
    has_instances: bool = True
    has_normals: bool = True
    has_uv: bool = True
    has_pictures: bool = True
    has_levels: bool = True
    has_grids: bool = True
    has_light_fields: bool = True
    has_reflection: bool = True
    has_lights: bool = True
    has_translucent: bool = True
    has_mirrors: bool = True
    has_conductors: bool = True
    has_dielectrics: bool = True
    has_coated: bool = True
    combined_depth: int = 1
    has_spots: bool = True
    has_environment: bool = True
    has_cutouts: bool = True
    has_additive: bool = True
    n_basis: int = 4
    sampler: Sampler = "sobol"
    places: PlaceKind = "none"

    @property
    def most_segments(self) -> int:
        """Straight parts of the longest path."""
        return self.max_bounces + 1 + (MOST_PASSES if self.has_additive else 0)

    def eye_defines(self, device: Device, width: int) -> dict[str, int]:
        """The #defines of the stage that leaves the eye, those of the device included."""
        return device.defines(self.precision, width) | eye_defines(self)

    def path_defines(self, device: Device) -> dict[str, int]:
        """The #defines of the stages that follow paths, those of the device included."""
        has_choices = self.combined_depth or any(
            (self.has_translucent, self.has_dielectrics, self.has_coated)
        )
        return device.defines(self.precision, path_width(device, self.precision)) | {
            "PATHS_ARE_LOCAL": int(self.is_fused),
            "STARTS_GIVEN": int(self.starts_given),
            "GROUP_PIXELS": GROUP_PIXELS,
            "SAMPLES_AT_ONCE": SAMPLES_AT_ONCE,
            "PATHS_AN_ITEM": paths_an_item(device),
            "MOST_PASSES": MOST_PASSES,
            "MOST_COMBINED": self.combined_depth + 1,
            "HAS_FLATS": int(self.has_flats),
            "HAS_BALLS": int(self.has_balls),
            "HAS_TEXTURED_BALLS": int(self.has_textured_balls),
            "HAS_MESHES": int(self.has_triangles or self.has_instances),
            "HAS_TRIANGLES": int(self.has_triangles),
            "HAS_INSTANCES": int(self.has_instances),
            "HAS_NORMALS": int(self.has_normals),
            "HAS_UV": int(self.has_uv),
            "HAS_PICTURES": int(self.has_pictures),
            "HAS_LEVELS": int(self.has_levels),
            "MOST_TEXELS": TEXELS_PER_FOOTPRINT,
            "HAS_GRIDS": int(self.has_grids),
            "HAS_LIGHT_FIELDS": int(self.has_light_fields),
            "HAS_REFLECTION": int(self.has_reflection),
            "HAS_LIGHTS": int(self.has_lights),
            "HAS_TRANSLUCENT": int(self.has_translucent),
            "HAS_MIRRORS": int(self.has_mirrors or self.has_conductors),
            "HAS_CONDUCTORS": int(self.has_conductors),
            "HAS_DIELECTRICS": int(self.has_dielectrics),
            "HAS_COATED": int(self.has_coated),
            "HAS_COMBINED": int(self.combined_depth > 0),
            "HAS_CHOICES": int(has_choices),
            "HAS_SPOTS": int(self.has_spots),
            "HAS_ENVIRONMENT": int(self.has_environment),
            "HAS_CUTOUTS": int(self.has_cutouts),
            "RANDOM_SAMPLES": int(self.sampler == "random"),
            "HAS_ADDITIVE": int(self.has_additive),
        }

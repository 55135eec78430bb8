"""isetcl: retinal images by spectral ray tracing through model eyes, and by PSF convolution.

Importing isetcl is cheap: OpenCL, scipy, xarray and colour-science are imported when they are used.
"""

from __future__ import annotations

import importlib
from typing import Any

from isetcl.device.fft import device_fft
from isetcl.device.huygens import huygens_psf
from isetcl.errors import (
    DeviceError,
    FileError,
    FocusError,
    InvalidInputError,
    IsetclError,
    KernelBuildError,
    OutOfMemoryError,
)
from isetcl.eye import catalog as eyes
from isetcl.eye.bending.ray_bending import Hurb
from isetcl.eye.files.load import load_eye
from isetcl.eye.gradient import PolynomialGradient, PolynomialMedium, ShellGradient, ShellMedium
from isetcl.eye.media import (
    AbbeDispersion,
    ConstantIndex,
    CornuDispersion,
    Medium,
    NavarroDispersion,
    SellmeierDispersion,
    TabulatedDispersion,
)
from isetcl.eye.model import Eye
from isetcl.eye.people.ocular_media import OcularMedia, ocular_transmittance
from isetcl.eye.people.scatter import ScatterModel
from isetcl.eye.placement import Placement
from isetcl.eye.rays import RayBundle, RayStatus
from isetcl.eye.retina import Retina
from isetcl.eye.shapes.biconic import Biconic
from isetcl.eye.shapes.even_asphere import EvenAsphere
from isetcl.eye.shapes.height_map import HeightMap
from isetcl.eye.shapes.toric import Toric
from isetcl.eye.shapes.zernike_sag import ZernikeSag
from isetcl.eye.stop import Stop
from isetcl.eye.surface import Surface
from isetcl.eye.worn.artificial_pupil import ArtificialPupil
from isetcl.eye.worn.contact_lens import ContactLens
from isetcl.eye.worn.intraocular_lens import IntraocularLens
from isetcl.eye.worn.spectacles import SpectacleLens

# The function `render` takes the place of the package of the same name as an attribute of isetcl;
# `from isetcl.render.plan import ...` goes on working.
from isetcl.render.pinhole import pinhole
from isetcl.render.plan import Plan, plan
from isetcl.render.render import render
from isetcl.render.trace import trace_rays
from isetcl.retina.grid import RetinalGrid
from isetcl.retina.image import RetinalImage
from isetcl.retina.pinhole_view import PinholeView
from isetcl.scene import targets as scenes
from isetcl.scene.colour import (
    blackbody,
    load_spd,
    radiance_of_rgb,
    reflectance_of_rgb,
    reflectance_primaries,
    spectrum_of_xyz,
)
from isetcl.scene.complex_index import ComplexIndex
from isetcl.scene.cube import SpectralCube, load_cube
from isetcl.scene.display import Display, display_primaries
from isetcl.scene.glass import glass
from isetcl.scene.light import DistantLight, Environment, PointLight, SpotLight
from isetcl.scene.light_field import LightField
from isetcl.scene.load import load_scene
from isetcl.scene.material import Coated, Diffuse, Emission, Mix, TwoSided, UnlitReflectance
from isetcl.scene.mesh import Instance, Mesh, load_mesh
from isetcl.scene.mesh_files import load_mesh_scene
from isetcl.scene.model import Disc, Quad, Scene, SceneObject, Sphere
from isetcl.scene.specular import Conductor, Dielectric, Mirror
from isetcl.scene.texture import Checkerboard, Grid, Image, load_image
from isetcl.spectrum import Spectrum
from isetcl.version import __version__

_LAZY_MODULES = ("cones", "psf_baseline", "validation")

__all__ = [
    "AbbeDispersion",
    "ArtificialPupil",
    "Biconic",
    "Checkerboard",
    "Coated",
    "ComplexIndex",
    "Conductor",
    "ConstantIndex",
    "ContactLens",
    "CornuDispersion",
    "DeviceError",
    "Dielectric",
    "Diffuse",
    "Disc",
    "Display",
    "DistantLight",
    "Emission",
    "Environment",
    "EvenAsphere",
    "Eye",
    "FileError",
    "FocusError",
    "Grid",
    "HeightMap",
    "Hurb",
    "Image",
    "Instance",
    "IntraocularLens",
    "InvalidInputError",
    "IsetclError",
    "KernelBuildError",
    "LightField",
    "Medium",
    "Mesh",
    "Mirror",
    "Mix",
    "NavarroDispersion",
    "OcularMedia",
    "OutOfMemoryError",
    "PinholeView",
    "Placement",
    "Plan",
    "PointLight",
    "PolynomialGradient",
    "PolynomialMedium",
    "Quad",
    "RayBundle",
    "RayStatus",
    "Retina",
    "RetinalGrid",
    "RetinalImage",
    "ScatterModel",
    "Scene",
    "SceneObject",
    "SellmeierDispersion",
    "ShellGradient",
    "ShellMedium",
    "SpectacleLens",
    "SpectralCube",
    "Spectrum",
    "Sphere",
    "SpotLight",
    "Stop",
    "Surface",
    "TabulatedDispersion",
    "Toric",
    "TwoSided",
    "UnlitReflectance",
    "ZernikeSag",
    "__version__",
    "blackbody",
    "cones",
    "device_fft",
    "display_primaries",
    "eyes",
    "glass",
    "huygens_psf",
    "load_cube",
    "load_eye",
    "load_image",
    "load_mesh",
    "load_mesh_scene",
    "load_scene",
    "load_spd",
    "ocular_transmittance",
    "pinhole",
    "plan",
    "psf_baseline",
    "radiance_of_rgb",
    "reflectance_of_rgb",
    "reflectance_primaries",
    "render",
    "scenes",
    "spectrum_of_xyz",
    "trace_rays",
    "validation",
]


def __getattr__(name: str) -> Any:
    if name in _LAZY_MODULES:
        return importlib.import_module(f"isetcl.{name}")
    raise AttributeError(f"module 'isetcl' has no attribute {name!r}")

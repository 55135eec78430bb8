"""isetcl: retinal images by spectral ray tracing through model eyes, and by PSF convolution.

Importing isetcl is cheap: what a public name stands for is imported when the name is first used,
and OpenCL, scipy, xarray and colour-science when something needs them.
"""

from __future__ import annotations

import importlib
import importlib.util
from typing import TYPE_CHECKING, Any

from isetcl.version import __version__

if TYPE_CHECKING:
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
    from isetcl.render.pinhole import pinhole
    from isetcl.render.plan import Plan, plan
    from isetcl.render.render import render
    from isetcl.render.trace import trace_rays
    from isetcl.retina.cone_noise import ConeNoise
    from isetcl.retina.grid import RetinalGrid
    from isetcl.retina.image import RetinalImage
    from isetcl.retina.pinhole_view import PinholeView
    from isetcl.retina.places import IrradianceAtPlaces, Places
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

_MODULES = {
    "eyes": "isetcl.eye.catalog",
    "scenes": "isetcl.scene.targets",
}
"""Public names of modules that are called otherwise where they are."""

_PLACES = {
    "isetcl.device.fft": ("device_fft",),
    "isetcl.device.huygens": ("huygens_psf",),
    "isetcl.errors": (
        "DeviceError",
        "FileError",
        "FocusError",
        "InvalidInputError",
        "IsetclError",
        "KernelBuildError",
        "OutOfMemoryError",
    ),
    "isetcl.eye.bending.ray_bending": ("Hurb",),
    "isetcl.eye.files.load": ("load_eye",),
    "isetcl.eye.gradient": (
        "PolynomialGradient",
        "PolynomialMedium",
        "ShellGradient",
        "ShellMedium",
    ),
    "isetcl.eye.media": (
        "AbbeDispersion",
        "ConstantIndex",
        "CornuDispersion",
        "Medium",
        "NavarroDispersion",
        "SellmeierDispersion",
        "TabulatedDispersion",
    ),
    "isetcl.eye.model": ("Eye",),
    "isetcl.eye.people.ocular_media": ("OcularMedia", "ocular_transmittance"),
    "isetcl.eye.people.scatter": ("ScatterModel",),
    "isetcl.eye.placement": ("Placement",),
    "isetcl.eye.rays": ("RayBundle", "RayStatus"),
    "isetcl.eye.retina": ("Retina",),
    "isetcl.eye.shapes.biconic": ("Biconic",),
    "isetcl.eye.shapes.even_asphere": ("EvenAsphere",),
    "isetcl.eye.shapes.height_map": ("HeightMap",),
    "isetcl.eye.shapes.toric": ("Toric",),
    "isetcl.eye.shapes.zernike_sag": ("ZernikeSag",),
    "isetcl.eye.stop": ("Stop",),
    "isetcl.eye.surface": ("Surface",),
    "isetcl.eye.worn.artificial_pupil": ("ArtificialPupil",),
    "isetcl.eye.worn.contact_lens": ("ContactLens",),
    "isetcl.eye.worn.intraocular_lens": ("IntraocularLens",),
    "isetcl.eye.worn.spectacles": ("SpectacleLens",),
    "isetcl.render.pinhole": ("pinhole",),
    "isetcl.render.plan": ("Plan", "plan"),
    "isetcl.render.render": ("render",),
    "isetcl.render.trace": ("trace_rays",),
    "isetcl.retina.cone_noise": ("ConeNoise",),
    "isetcl.retina.grid": ("RetinalGrid",),
    "isetcl.retina.image": ("RetinalImage",),
    "isetcl.retina.pinhole_view": ("PinholeView",),
    "isetcl.retina.places": ("IrradianceAtPlaces", "Places"),
    "isetcl.scene.colour": (
        "blackbody",
        "load_spd",
        "radiance_of_rgb",
        "reflectance_of_rgb",
        "reflectance_primaries",
        "spectrum_of_xyz",
    ),
    "isetcl.scene.complex_index": ("ComplexIndex",),
    "isetcl.scene.cube": ("SpectralCube", "load_cube"),
    "isetcl.scene.display": ("Display", "display_primaries"),
    "isetcl.scene.glass": ("glass",),
    "isetcl.scene.light": ("DistantLight", "Environment", "PointLight", "SpotLight"),
    "isetcl.scene.light_field": ("LightField",),
    "isetcl.scene.load": ("load_scene",),
    "isetcl.scene.material": (
        "Coated",
        "Diffuse",
        "Emission",
        "Mix",
        "TwoSided",
        "UnlitReflectance",
    ),
    "isetcl.scene.mesh": ("Instance", "Mesh", "load_mesh"),
    "isetcl.scene.mesh_files": ("load_mesh_scene",),
    "isetcl.scene.model": ("Disc", "Quad", "Scene", "SceneObject", "Sphere"),
    "isetcl.scene.specular": ("Conductor", "Dielectric", "Mirror"),
    "isetcl.scene.texture": ("Checkerboard", "Grid", "Image", "load_image"),
    "isetcl.spectrum": ("Spectrum",),
}
"""The modules that public names are from: those of the imports above."""

_MODULE_OF = {name: module for module, names in _PLACES.items() for name in names}

__all__ = [
    "AbbeDispersion",
    "ArtificialPupil",
    "Biconic",
    "Checkerboard",
    "Coated",
    "ComplexIndex",
    "Conductor",
    "ConeNoise",
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
    "IrradianceAtPlaces",
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
    "Places",
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
    "figures",
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
    "retina",
    "scenes",
    "spectrum_of_xyz",
    "trace_rays",
    "validation",
]

# The function `render` has the name of a package, which Python would put in its place when it is
# imported: so that happens now. `from isetcl.render.plan import ...` goes on working.
importlib.import_module("isetcl.render")
del globals()["render"]


def __getattr__(name: str) -> Any:
    if name in _MODULE_OF:
        found = getattr(importlib.import_module(_MODULE_OF[name]), name)
    elif name in _MODULES:
        found = importlib.import_module(_MODULES[name])
    elif not name.startswith("_") and importlib.util.find_spec(f"isetcl.{name}") is not None:
        found = importlib.import_module(f"isetcl.{name}")
    else:
        raise AttributeError(f"module 'isetcl' has no attribute {name!r}")
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

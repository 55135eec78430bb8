"""isetcl: retinal images by spectral ray tracing through model eyes, and how far PSF methods are off.

The public names are listed in `__all__`; they are imported when first used, so that importing
isetcl costs little.
"""

from __future__ import annotations

import importlib
from typing import Any

from isetcl.version import __version__

_HOME = {
    "Eye": "isetcl.eye.model",
    "Surface": "isetcl.eye.model",
    "Stop": "isetcl.eye.model",
    "Retina": "isetcl.eye.model",
    "Medium": "isetcl.eye.media",
    "ConstantIndex": "isetcl.eye.media",
    "NavarroDispersion": "isetcl.eye.media",
    "CornuDispersion": "isetcl.eye.media",
    "AbbeDispersion": "isetcl.eye.media",
    "RayBundle": "isetcl.eye.rays",
    "RayStatus": "isetcl.eye.rays",
    "Scene": "isetcl.scene.model",
    "SceneObject": "isetcl.scene.model",
    "Quad": "isetcl.scene.model",
    "Disc": "isetcl.scene.model",
    "Sphere": "isetcl.scene.model",
    "Emission": "isetcl.scene.model",
    "UnlitReflectance": "isetcl.scene.model",
    "Checkerboard": "isetcl.scene.texture",
    "Image": "isetcl.scene.texture",
    "load_image": "isetcl.scene.texture",
    "Spectrum": "isetcl.spectrum",
    "RetinalGrid": "isetcl.retina.grid",
    "RetinalImage": "isetcl.retina.image",
    "trace_rays": "isetcl.render.trace",
    "plan": "isetcl.render.plan",
    "Plan": "isetcl.render.plan",
    "render": "isetcl.render.render",
    "IsetclError": "isetcl.errors",
    "InvalidInputError": "isetcl.errors",
    "FocusError": "isetcl.errors",
    "FileError": "isetcl.errors",
    "DeviceError": "isetcl.errors",
    "KernelBuildError": "isetcl.errors",
    "OutOfMemoryError": "isetcl.errors",
}

_MODULES = {
    "eyes": "isetcl.eye.catalog",
    "scenes": "isetcl.scene.targets",
    "psf_baseline": "isetcl.psf_baseline",
    "validation": "isetcl.validation",
}

__all__ = ["__version__", *sorted(_HOME), *sorted(_MODULES)]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        value = getattr(importlib.import_module(_HOME[name]), name)
    elif name in _MODULES:
        value = importlib.import_module(_MODULES[name])
    else:
        raise AttributeError(f"module 'isetcl' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)

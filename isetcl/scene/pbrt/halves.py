"""Two cut-outs that fill each other's holes, joined into one surface with a texture.

PBRT has no patterned area lights but pictures; a luminous checkerboard is written as two lights of
the same shape, each cut out where the other shines.
"""

from __future__ import annotations

import numpy as np

from isetcl.scene.material import Emission
from isetcl.scene.mesh import Mesh
from isetcl.scene.model import SceneObject
from isetcl.scene.pbrt.surfaces import is_black
from isetcl.scene.texture import Checkerboard
from isetcl.spectrum import Spectrum


def joined_halves(objects: list[SceneObject]) -> list[SceneObject]:
    """The objects, with neighbours joined that are two halves of one luminous checkerboard."""
    result: list[SceneObject] = []
    for item in objects:
        joined = _joined(result[-1], item) if result else None
        if joined is None:
            result.append(item)
        else:
            result[-1] = joined
    return result


def _joined(first: SceneObject, second: SceneObject) -> SceneObject | None:
    a, b = first.opacity, second.opacity
    if not (isinstance(a, Checkerboard) and isinstance(b, Checkerboard)):
        return None
    fits = (a.periods_u, a.periods_v, a.dark, a.bright) == (
        b.periods_u, b.periods_v, b.bright, b.dark,
    )  # fmt: skip
    if not fits or a.dark != 0.0 or not _same_shape(first, second):
        return None
    bright, dark = _radiance(first), _radiance(second)
    if bright is None or dark is None or not (bright[1] or dark[1]):
        return None
    sides = bright[1] or dark[1]
    if bright[1] != dark[1] and bright[1] and dark[1]:
        return None
    weights = _weights(bright[0], dark[0])
    if weights is None or sides is None:
        return None
    spectrum, values = weights
    texture = Checkerboard(a.periods_u, a.periods_v, *values)
    emission = Emission(spectrum, texture, "both" if sides == "both" else "front")
    return SceneObject(first.name, first.shape, emission, opacity=a.bright)


def _same_shape(first: SceneObject, second: SceneObject) -> bool:
    a, b = first.shape, second.shape
    if type(a) is not type(b):
        return False
    return a.digest() == b.digest() if isinstance(a, Mesh) else a == b  # type: ignore[union-attr]


def _radiance(item: SceneObject) -> tuple[Spectrum | None, str | None] | None:
    """The even radiance of an object and its sides; (None, None) for a black one."""
    material = item.material
    if isinstance(material, Emission) and material.texture is None and not material.is_additive:
        return material.spectra()[0], material.sides
    if item.emission is None and item.scatters and is_black(material):  # type: ignore[arg-type]
        return None, None
    return None


def _weights(
    bright: Spectrum | None, dark: Spectrum | None
) -> tuple[Spectrum, tuple[float, float]] | None:
    if bright is None or dark is None:
        only = bright or dark
        return None if only is None else (only, (1.0, 0.0) if dark is None else (0.0, 1.0))
    if not np.array_equal(bright.wavelengths_nm, dark.wavelengths_nm) or not bright.values.any():
        return None
    peak = int(np.argmax(bright.values))
    ratio = float(dark.values[peak] / bright.values[peak])
    if not np.allclose(dark.values, ratio * bright.values, rtol=1e-9, atol=0):
        return None
    return bright, (1.0, ratio)

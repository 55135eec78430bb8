"""How a chart is seen: by light of its own, or lit from all around."""

from __future__ import annotations

from typing import Literal

from isetcl.errors import check_choice
from isetcl.scene.material import Diffuse, Material, UnlitReflectance
from isetcl.scene.texture import Texture
from isetcl.spectrum import Spectrum

Lighting = Literal["emitting", "lit"]
"""``"emitting"``: surfaces shine as if painted in an even light, and nothing else does; ``"lit"``:
they scatter an even light from all around."""


def painted(
    reflectance: Spectrum | tuple[Spectrum, ...],
    white: Spectrum,
    lighting: Lighting,
    texture: Texture | None = None,
) -> Material:
    """A matt paint that looks alike both ways: on a flat chart, in light of radiance `white`.

    Raises
    ------
    InvalidInputError
        If the way of lighting is unknown.
    """
    if check_choice("lighting", lighting, ("emitting", "lit")) == "lit":
        return Diffuse(reflectance, texture)
    return UnlitReflectance(reflectance, white, texture)


def surroundings(white: Spectrum, lighting: Lighting) -> Spectrum | None:
    """What lies around the chart: the light itself, or nothing."""
    return white if check_choice("lighting", lighting, ("emitting", "lit")) == "lit" else None

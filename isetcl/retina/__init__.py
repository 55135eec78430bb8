"""The retinal image, the grid it lives on, and what stands before the receptors."""

from isetcl.retina.transmittance import (
    MacularPigment,
    Transmittance,
    macular_pigment,
    transmittance,
)

__all__ = ["MacularPigment", "Transmittance", "macular_pigment", "transmittance"]

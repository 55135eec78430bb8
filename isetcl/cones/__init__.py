"""Cones: receptors, their mosaic, and what they catch of a retinal image."""

# The functions `mosaic` and `excitations` take the places of the modules of the same names as
# attributes of the package; `from isetcl.cones.mosaic import ...` goes on working.
from isetcl.cones.mosaic import ConeMosaic  # isort: skip
from isetcl.cones.excitations import Excitations, excitations
from isetcl.cones.field import MosaicEstimate
from isetcl.cones.generate import estimate_mosaic, mosaic
from isetcl.cones.observer import Observer
from isetcl.cones.receptors import ReceptorType

__all__ = [
    "ConeMosaic",
    "Excitations",
    "MosaicEstimate",
    "Observer",
    "ReceptorType",
    "estimate_mosaic",
    "excitations",
    "mosaic",
]

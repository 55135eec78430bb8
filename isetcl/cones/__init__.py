"""Cones: receptors, their mosaic, and what they catch of a retinal image."""

# The function `mosaic` takes the place of the module of the same name as an attribute of the
# package; `from isetcl.cones.mosaic import ...` goes on working.
from isetcl.cones.mosaic import ConeMosaic  # isort: skip
from isetcl.cones.field import MosaicEstimate
from isetcl.cones.generate import estimate_mosaic, mosaic
from isetcl.cones.receptors import ReceptorType

__all__ = ["ConeMosaic", "MosaicEstimate", "ReceptorType", "estimate_mosaic", "mosaic"]

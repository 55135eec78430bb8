"""Cones: receptors, their mosaic, and what they catch of a retinal image."""

# The functions `mosaic` and `excitations` take the places of the modules of the same names as
# attributes of the package; `from isetcl.cones.mosaic import ...` goes on working.
from isetcl.cones.mosaic import ConeMosaic  # isort: skip
from isetcl.cones.discrimination import (
    Discrimination,
    contrast,
    contrast_image,
    discriminate,
    discrimination_threshold,
)
from isetcl.cones.excitations import Excitations, excitations
from isetcl.cones.eye_movements import DriftModel, EyeMovements, eye_movements
from isetcl.cones.field import MosaicEstimate
from isetcl.cones.generate import estimate_mosaic, mosaic
from isetcl.cones.melanopsin import melanopic_irradiance
from isetcl.cones.microsaccades import Microsaccades
from isetcl.cones.observer import Observer
from isetcl.cones.outer_segment import OuterSegment
from isetcl.cones.photocurrent import Photocurrent, photocurrent
from isetcl.cones.receptors import ReceptorType
from isetcl.cones.turning_eye import excitations_of_turning_eye
from isetcl.cones.viewing import Viewing

__all__ = [
    "ConeMosaic",
    "Discrimination",
    "DriftModel",
    "Excitations",
    "EyeMovements",
    "Microsaccades",
    "MosaicEstimate",
    "Observer",
    "OuterSegment",
    "Photocurrent",
    "ReceptorType",
    "Viewing",
    "contrast",
    "contrast_image",
    "discriminate",
    "discrimination_threshold",
    "estimate_mosaic",
    "excitations",
    "excitations_of_turning_eye",
    "eye_movements",
    "melanopic_irradiance",
    "mosaic",
    "photocurrent",
]

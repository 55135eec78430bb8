"""Cones: receptors, their mosaic, and what they catch of a retinal image."""

from isetcl.cones.mosaic import ConeMosaic
from isetcl.cones.receptors import ReceptorType

__all__ = ["ConeMosaic", "ReceptorType"]

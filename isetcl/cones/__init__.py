"""Cones: receptors, their mosaic, and what they catch of a retinal image."""

"""Rays bent by diffraction at the stop and by scatter."""

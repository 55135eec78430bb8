"""Aberrations, refraction and image quality of an eye, as numbers and curves."""

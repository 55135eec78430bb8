"""Drawings of an eye and of its image quality."""

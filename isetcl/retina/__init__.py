"""The retinal image and the grid it lives on."""

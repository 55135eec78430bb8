"""Modulation transfer measured from images, rays and wavefronts, and compared with people's."""

"""Kinds of point spread functions, each sampled with area integration.

A sample of a kernel is the share of the flux that falls on its square; the samples and the light
that is reported as outside add up to 1.
"""

from isetcl.psf_baseline.psfs.registry import PsfKind, psf_kind, psf_kinds

__all__ = ["PsfKind", "psf_kind", "psf_kinds"]

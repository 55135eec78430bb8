"""Approximations of the retinal image by depth-dependent point spread functions.

This package never touches OpenCL or the renderer: a baseline that shared code with the method it
judges would prove nothing.
"""

from isetcl.psf_baseline.bank import PsfBank
from isetcl.psf_baseline.bound import ErrorBound, Verdict, error_bound, error_bounds
from isetcl.psf_baseline.depth_files import load_depth, load_depth_image
from isetcl.psf_baseline.depth_from_focus import FocusDepth
from isetcl.psf_baseline.depth_image import DepthImage, DepthSheet
from isetcl.psf_baseline.edge_error import edge_error
from isetcl.psf_baseline.focal_stack import FocalStack, load_focal_stack
from isetcl.psf_baseline.methods import Method, methods
from isetcl.psf_baseline.psf import Psf, geometric_psf
from isetcl.psf_baseline.psf_cache import PsfCache
from isetcl.psf_baseline.psfs import PsfKind, psf_kinds
from isetcl.psf_baseline.pupil import PupilOffsets, pupil_offsets
from isetcl.psf_baseline.render import render

__all__ = [
    "DepthImage",
    "DepthSheet",
    "ErrorBound",
    "FocalStack",
    "FocusDepth",
    "Method",
    "Psf",
    "PsfBank",
    "PsfCache",
    "PsfKind",
    "PupilOffsets",
    "Verdict",
    "edge_error",
    "error_bound",
    "error_bounds",
    "geometric_psf",
    "load_depth",
    "load_depth_image",
    "load_focal_stack",
    "methods",
    "psf_kinds",
    "pupil_offsets",
    "render",
]

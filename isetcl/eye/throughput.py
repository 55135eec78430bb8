"""How much irradiance an eye makes of a uniform radiance."""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np

from isetcl.eye.model import Eye
from isetcl.eye.prescription import ElementKind, elements
from isetcl.eye.sequential import trace_elements


@functools.lru_cache(maxsize=1024)
def axial_irradiance_per_radiance(eye: Eye, wavelength_nm: float) -> float:
    """Irradiance at the retinal vertex per unit uniform radiance in front of the eye, sr.

    pi (n'/n)^2 sin^2(theta'), with theta' the angle in the vitreous of the real ray from the
    retinal vertex to the edge of the stop (Born & Wolf, 4.8; n'/n is conservation of basic
    radiance).
    """
    index = eye.indices(wavelength_nm)
    sine = _marginal_sine(eye, wavelength_nm)
    return math.pi * (float(index[-1]) / float(index[0])) ** 2 * sine**2


def _marginal_sine(eye: Eye, wavelength_nm: float) -> float:
    """Sine of the angle at the retinal vertex of the ray that meets the edge of the stop."""
    from scipy.optimize import newton

    sequence = [
        e for e in reversed(elements(eye, wavelength_nm)) if e.kind is not ElementKind.RETINA
    ]
    rear = len(eye.surfaces) - eye.stop_index
    plane = dataclasses.replace(
        sequence[rear], kind=ElementKind.REFRACT, semi_diameter_mm=math.inf
    )
    path = (*sequence[:rear], plane)
    start = np.array([[0.0, 0.0, eye.retina.vertex_z_mm]])
    radius = eye.stop.radius_mm

    def excess(sine: float) -> float:
        direction = np.array([[0.0, sine, -math.sqrt(1.0 - sine * sine)]])
        return float(trace_elements(path, start, direction, "scene").positions_mm[0, 1]) - radius

    pupil = eye.exit_pupil(wavelength_nm)
    guess = math.sin(math.atan2(pupil.radius_mm, eye.retina.vertex_z_mm - pupil.z_mm))
    second = guess * (1.0 - 0.5 * excess(guess) / radius)
    return float(newton(excess, guess, x1=second, tol=1e-14))



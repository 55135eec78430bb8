"""Whatever is passed to the functions of cones in time, what comes back is isetcl's own error."""

import numpy as np
import pytest
from test_bad_input import JUNK, SCENE
from test_discrimination import excitations_of

import isetcl as ic
from isetcl.cones import (
    ConeMosaic,
    DriftModel,
    EyeMovements,
    Microsaccades,
    OuterSegment,
    Viewing,
)
from isetcl.cones.photocurrent import photocurrent_noise

SEEN = excitations_of([3.0, 4.0, 5.0])
MOSAIC = ConeMosaic.from_positions([[0, 0], [0.1, 0]], [0, 1])
PATHS = EyeMovements(1e-3 * np.arange(50), np.zeros((1, 50, 2)), np.zeros((1, 50), bool))
SEGMENT = OuterSegment()


def current(**options):
    return ic.cones.photocurrent(SEEN, **{"segment": "foveal"} | options)


def threshold(**options):
    limits = {"low": 0.1, "high": 100.0} | options
    return ic.cones.discrimination_threshold(lambda c: excitations_of([3.0 + c]), **limits)


def turning(gaze_deg=((0.0, 0.0),), **options):
    return ic.cones.excitations_of_turning_eye(
        MOSAIC, SCENE, ic.eyes.navarro(), gaze_deg, **options, fov_deg=0.0
    )


# One argument of each call is junk; some junk is legal, which is no error either.
CALLS = {
    "segments": lambda x: Viewing(segments=x),
    "uneven wavelengths": lambda x: Viewing(uneven_wavelengths=x),
    "media of a viewing": lambda x: Viewing(media=x),
    "viewing": lambda x: MOSAIC.places(x),
    "receptors": lambda x: ic.Places(MOSAIC.positions_deg, np.ones(2), receptors=x),
    "duration": lambda x: ic.cones.eye_movements(x),
    "frame time": lambda x: ic.cones.eye_movements(0.1, x),
    "trials": lambda x: ic.cones.eye_movements(0.1, trials=x),
    "microsaccades": lambda x: ic.cones.eye_movements(0.1, microsaccades=x),
    "drift": lambda x: ic.cones.eye_movements(0.1, drift=x),
    "centre": lambda x: ic.cones.eye_movements(0.1, centre=x),
    "seed": lambda x: ic.cones.eye_movements(0.1, seed=x),
    "gamma": lambda x: DriftModel(gamma=x),
    "interval": lambda x: Microsaccades(interval_s=x),
    "microsaccade model": lambda x: Microsaccades(x),
    "paths": lambda x: EyeMovements(x, x, x),
    "window": lambda x: PATHS.velocity_deg_s(x),
    "lag": lambda x: PATHS.diffusion_arcmin2_s(x),
    "trial": lambda x: PATHS.path(x),
    "gain": lambda x: OuterSegment(gain_hz=x),
    "steady rate": lambda x: SEGMENT.steady_current_pa(x),
    "rates": lambda x: SEGMENT.respond(x),
    "length of frames": lambda x: SEGMENT.respond(np.ones(3), x),
    "background": lambda x: SEGMENT.respond(np.ones(3), 1e-3, x),
    "step": lambda x: SEGMENT.respond(np.ones(3), 1e-3, step_s=x),
    "excitations": lambda x: ic.cones.photocurrent(x),
    "light before": lambda x: current(background_hz=x),
    "segment": lambda x: current(segment=x),
    "longest step": lambda x: current(step_s=x),
    "noise seed": lambda x: current(seed=x),
    "noisy light": lambda x: current(is_noisy_light=x),
    "noise frames": lambda x: photocurrent_noise(x, 2, 1e-3),
    "noise cones": lambda x: photocurrent_noise(5, x, 1e-3),
    "noise time": lambda x: photocurrent_noise(5, 2, x),
    "contrast": lambda x: ic.cones.contrast(x),
    "contrast background": lambda x: ic.cones.contrast(SEEN, x),
    "contrast values": lambda x: ic.cones.contrast_image(x, "L"),
    "contrast kind": lambda x: ic.cones.contrast_image(SEEN.mean, x),
    "contrast pixels": lambda x: ic.cones.contrast_image(SEEN.mean, "L", x),
    "contrast frame": lambda x: ic.cones.contrast_image(SEEN.mean, "L", 8, x),
    "first": lambda x: ic.cones.discriminate(x, SEEN),
    "second": lambda x: ic.cones.discriminate(SEEN, x),
    "stimulus": lambda x: ic.cones.discrimination_threshold(x, 0.1, 1.0),
    "low": lambda x: threshold(low=x),
    "high": lambda x: threshold(high=x),
    "percent": lambda x: threshold(percent=x),
    "tolerance": lambda x: threshold(tolerance=x),
    "reference": lambda x: threshold(reference=x),
    "gaze": lambda x: turning(x),
    "turning frame": lambda x: turning(frame_time_s=x),
    "rotation centre": lambda x: turning(rotation_centre_mm=x),
    "cone options": lambda x: turning(cone_options=x),
    "ratio": lambda x: ic.ConeNoise(x),
    "counting time": lambda x: ic.ConeNoise(0.1, x),
    "spelling": lambda x: ic.ConeNoise.parse(x),
    "noise wavelengths": lambda x: ic.ConeNoise(0.1).weights(x),
}


@pytest.mark.parametrize("name", CALLS)
def test_junk_is_refused_with_an_error_of_isetcl(name):
    refused = 0
    for junk in JUNK:
        try:
            CALLS[name](junk)
        except ic.InvalidInputError:
            refused += 1
    assert refused >= 5

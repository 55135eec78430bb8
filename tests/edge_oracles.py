"""Images of slanted edges whose modulation transfer is known, and nothing of isetcl in them.

Lengths are pixels. A pixel is the mean over its square: along the edge's normal a box of width
cos(a) and another of width sin(a).
"""

import itertools
import math

import numpy as np


def distances(shape, angle_deg, middle=(0.3, -0.2)):
    """Distance of every pixel from an edge tilted anticlockwise from the vertical; right is > 0."""
    rows, columns = shape
    up = (rows - 1) / 2 - np.arange(rows)[:, None] - middle[1]
    right = np.arange(columns)[None, :] - (columns - 1) / 2 - middle[0]
    angle = math.radians(angle_deg)
    return right * math.cos(angle) + up * math.sin(angle)


def step_through_boxes(distance, widths):
    """A unit step convolved with boxes: differences of the power x^n / n! for x > 0."""
    widths = [width for width in widths if width > 1e-9]
    n = len(widths)
    total = 0.0
    for signs in itertools.product((1.0, -1.0), repeat=n):
        shifted = distance + np.dot(signs, widths) / 2.0
        total = total + np.prod(signs) * np.maximum(shifted, 0.0) ** n / math.factorial(n)
    return total / np.prod(widths)


def step_through_mtf(distance, mtf, highest, widths):
    """1/2 + integral of MTF(f) sin(2 pi f x) / (pi f), by the midpoint rule, for an even spread."""
    reach = float(np.max(np.abs(distance))) + 1.0
    count = math.ceil(16 * reach * highest)
    f = (np.arange(count) + 0.5) * highest / count
    parts = mtf(f) * np.prod([np.sinc(f * w) for w in widths], axis=0) / (np.pi * f)
    x = np.linspace(-reach, reach, math.ceil(32 * reach))
    values = 0.5 + np.sin(2.0 * np.pi * np.outer(x, f)) @ parts * highest / count
    from scipy.interpolate import CubicSpline

    return CubicSpline(x, values)(distance)


def gaussian(sigma):
    return lambda f: np.exp(-2.0 * (np.pi * sigma * f) ** 2)


def motion(length):
    return lambda f: np.abs(np.sinc(f * length))


def diffraction(cutoff):
    def mtf(f):
        s = np.clip(f / cutoff, 0.0, 1.0)
        return 2.0 / np.pi * (np.arccos(s) - s * np.sqrt(1.0 - s * s))

    return mtf


def edge_image(kind, size, angle_deg, shape):
    """Brightness 0 to the left and 1 to the right of an edge, and its modulation transfer."""
    distance = distances(shape, angle_deg)
    angle = math.radians(angle_deg)
    pixel = (abs(math.cos(angle)), abs(math.sin(angle)))
    if kind == "motion":
        return step_through_boxes(distance, (*pixel, size)), motion(size)
    if kind == "gaussian":
        mtf, highest = gaussian(size), 1.2 / size
    else:
        mtf, highest = diffraction(size), size
    return step_through_mtf(distance, mtf, highest, pixel), mtf


def binned_mtf(image, angle_deg, frequency, *, is_corrected):
    """The customary way, with the line known: means over quarter pixels, three-point derivative.

    Averaging loses sinc(f/4), the derivative sinc(f/2); both are put back if corrected.
    """
    distance = distances(image.shape, angle_deg)
    half = int(0.4 * min(image.shape)) * 4
    place = np.rint(distance * 4.0).astype(int)
    used = np.abs(place) <= half
    count = np.bincount(place[used] + half)
    spread = np.bincount(place[used] + half, image[used]) / count
    line = (spread[2:] - spread[:-2]) / 2.0
    x = (np.arange(1, 2 * half) - half) / 4.0
    window = 0.54 + 0.46 * np.cos(np.pi * x * 4.0 / half)
    transform = np.exp(-2j * np.pi * np.outer(frequency, x)) @ (line * window)
    loss = np.sinc(frequency / 2.0) * np.sinc(frequency / 4.0) if is_corrected else 1.0
    return np.abs(transform) / np.sum(line * window) / loss

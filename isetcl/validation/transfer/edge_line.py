"""Where the slanted edge of an image lies: its rows, its line to a part of a pixel, its flat sides.

Images here are turned so that the edge runs steeply: rows t, columns s, both ascending; the edge is
s = a + b t + c t^2.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from isetcl.errors import InvalidInputError

_SMOOTHING_PX = 1.5
_LINE_TOLERANCE_PX = 2.5
_LINES_TRIED = 400
_FEWEST_ROWS = 8
_ON_LINE = 0.8
_CENTROID_ROUNDS = 5
_FIRST_REACH_PX = 16.0
_LEAST_REACH_PX = 3.0
_REACH_WIDTHS = 3.0
_FLAT_SLOPE = 0.05
_OTHER_SLOPE = 0.15
_FEWEST_PER_DISTANCE = 0.5
_LEAST_WIDTH_PX = 6
_NOISE_LIMIT = 4.0
_STANDS_OUT = 5.0
_SURE_ROWS = 24
_LEAST_STEP = 3.0
_SAME_STEP = 0.6
_CORNER_PX = 6


@dataclass(frozen=True)
class EdgeLine:
    """The line of an edge in a turned image, and the pixels that belong to it.

    Attributes
    ----------
    is_turned
        Whether the image was transposed, because its edge is nearer to the horizontal.
    coefficients
        a, b, c of s = a + b t + c t^2, pixels, t from `middle`.
    middle
        Middle of the rows, pixels.
    rows
        First row and the one after the last.
    half_width
        How far from the line, along its normal, pixels are used.
    """

    is_turned: bool
    coefficients: tuple[float, float, float]
    middle: float
    rows: tuple[int, int]
    half_width: float

    def at(self, t: np.ndarray | float) -> np.ndarray:
        """Column of the line at rows t."""
        a, b, c = self.coefficients
        u = np.asarray(t, dtype=np.float64) - self.middle
        return np.asarray(a + u * (b + c * u))

    def slope(self, t: np.ndarray | float) -> np.ndarray:
        """Columns per row at rows t."""
        _, b, c = self.coefficients
        return np.asarray(b + 2.0 * c * (np.asarray(t, dtype=np.float64) - self.middle))

    @property
    def tilt_deg(self) -> float:
        """Angle between the line and the rows' normal, degrees, >= 0."""
        return math.degrees(math.atan(abs(self.coefficients[1])))

    @property
    def cosine(self) -> float:
        """Distance along the normal of a step of one column."""
        return 1.0 / math.hypot(1.0, self.coefficients[1])

    def distance(self, shape: tuple[int, int]) -> np.ndarray:
        """Distance of every pixel from the line along its normal, pixels, (t, s)."""
        t = np.arange(shape[0])
        across = np.arange(shape[1])[None, :] - self.at(t)[:, None]
        return np.asarray(across / np.hypot(1.0, self.slope(t))[:, None])


def turned(image: np.ndarray, is_turned: bool) -> np.ndarray:
    """An image (..., rows from the top, columns) in the frame of `EdgeLine`, (..., t, s)."""
    upwards = image[..., ::-1, :]
    return np.swapaxes(upwards, -1, -2) if is_turned else upwards


def find_edge(brightness: np.ndarray, region_name: str = "the image") -> EdgeLine:
    """The strongest long, straight edge of an image (rows, columns).

    Raises
    ------
    InvalidInputError
        If there is none.
    """
    span = float(np.ptp(brightness))
    if not span > 1e-9 * float(np.max(np.abs(brightness))):
        raise InvalidInputError(
            f"{region_name} must hold an edge, but it is constant; light one side more"
        )
    found = [_rough_line(turned(brightness, turn)) for turn in (False, True)]
    scores = [0.0 if each is None else each[0] for each in found]
    best = int(np.argmax(scores))
    rough = found[best]
    if rough is None:
        raise InvalidInputError(
            f"{region_name} must hold an edge, but no straight step of brightness through "
            f"{_FEWEST_ROWS} rows or columns stands out; render ic.scenes.slanted_edge, "
            "choose a region, or take more samples"
        )
    _, slope, offset, rows = rough
    image = turned(brightness, bool(best))
    middle = (rows[0] + rows[1] - 1) / 2.0
    line = EdgeLine(bool(best), (offset + slope * middle, slope, 0.0), middle, rows, 0.0)
    line = _by_centroids(image, line)
    for _ in range(2):
        line = _by_centroids(image, _in_all_rows(image, line))
    _check_step(image, line, region_name)
    line = _with_flat_sides(image, line)
    _check_width(line, region_name)
    return line


def _rough_line(image: np.ndarray) -> tuple[float, float, float, tuple[int, int]] | None:
    """Score, slope, offset and rows of the best line through the steepest places of the rows."""
    from scipy.ndimage import gaussian_filter

    rows, columns = image.shape
    if rows < _FEWEST_ROWS or columns < _FEWEST_ROWS:
        return None
    steep = gaussian_filter(image, _SMOOTHING_PX, order=(0, 1), mode="nearest")
    places = np.argmax(np.abs(steep), axis=1)
    strength = steep[np.arange(rows), places]
    rng = np.random.default_rng(0)
    pairs = rng.integers(0, rows, (_LINES_TRIED, 2))
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    first, second = pairs.T
    slopes = (places[second] - places[first]) / (second - first)
    offsets = places[first] - slopes * first
    off = np.abs(np.arange(rows) * slopes[:, None] + offsets[:, None] - places)
    near = (off <= _LINE_TOLERANCE_PX) & (np.abs(slopes) <= 1.01)[:, None]
    scores = np.abs(np.where(near, strength, 0.0).sum(axis=1))
    best = int(np.argmax(scores))
    run = _longest_run(near[best] & (np.sign(strength) == np.sign(np.sum(strength[near[best]]))))
    if run is None:
        return None
    t = np.arange(*run)[near[best][slice(*run)]]
    slope, offset = np.polyfit(t, places[t], 1)
    typical = float(np.median(np.abs(steep)))
    along = float(np.mean(np.abs(strength[t])))
    # Maxima of noise make short lines by chance, so that those must be clearer.
    needed = _STANDS_OUT * max(1.0, math.sqrt(_SURE_ROWS / (run[1] - run[0])))
    if not along > needed * typical:
        return None
    return float(np.sum(np.abs(strength[t]))), float(slope), float(offset), run


def _longest_run(flags: np.ndarray, gap: int = 4) -> tuple[int, int] | None:
    """The longest stretch that begins and ends with True and is mostly True; None if too short."""
    ones = np.flatnonzero(flags)
    best = (0, 0)
    start = 0
    for i in range(len(ones)):
        if i + 1 == len(ones) or ones[i + 1] - ones[i] > gap:
            if ones[i] + 1 - ones[start] > best[1] - best[0]:
                best = (int(ones[start]), int(ones[i]) + 1)
            start = i + 1
    length = best[1] - best[0]
    if length < _FEWEST_ROWS or float(np.mean(flags[slice(*best)])) < _ON_LINE:
        return None
    return best


def _by_centroids(image: np.ndarray, line: EdgeLine) -> EdgeLine:
    """Fit the line to the centroids of the rows' derivatives under a Hamming window, repeatedly.

    The window shrinks with the width of the edge, which keeps noise far from it out.
    """
    t = np.arange(*line.rows)
    derivative = np.diff(image[t], axis=1)
    derivative = derivative * np.sign(np.sum(derivative))
    middle_s = np.arange(derivative.shape[1]) + 0.5
    reach = _FIRST_REACH_PX
    a, b = line.coefficients[:2]
    for _ in range(_CENTROID_ROUNDS):
        away = middle_s - (a + b * (t - line.middle))[:, None]
        window = np.where(np.abs(away) < reach, 0.54 + 0.46 * np.cos(np.pi * away / reach), 0.0)
        weight = derivative * window
        mass = weight.sum(axis=1)
        good = mass > 0.2 * np.median(mass)
        if np.sum(good) < 2 or not np.median(mass) > 0.0:
            break
        centroid = (weight * away).sum(axis=1)[good] / mass[good]
        u = t[good] - line.middle
        step_b, step_a = np.polyfit(u, np.clip(centroid, -reach, reach), 1)
        a, b = a + float(step_a), b + float(step_b)
        profile = np.maximum(weight, 0.0)
        width = math.sqrt(float(np.sum(profile * away**2) / np.sum(profile)))
        reach = min(_FIRST_REACH_PX, max(_LEAST_REACH_PX, _REACH_WIDTHS * width))
    return EdgeLine(line.is_turned, (a, b, 0.0), line.middle, line.rows, line.half_width)


def _in_all_rows(image: np.ndarray, line: EdgeLine) -> EdgeLine:
    """The longest stretch of rows that have the same step across the line.

    A blurred edge is steepest at many places, so that some rows miss the line at first; others
    beyond a corner seem to lie on it.
    """
    from scipy.ndimage import uniform_filter1d

    distance = line.distance(image.shape)
    near = (np.abs(distance) > 1.0) & (np.abs(distance) < _FIRST_REACH_PX)
    counts = [np.maximum(np.sum(near & side, axis=1), 1) for side in (distance > 0, distance < 0)]
    sums = [np.sum(image * (near & side), axis=1) for side in (distance > 0, distance < 0)]
    step = uniform_filter1d(sums[0] / counts[0] - sums[1] / counts[1], 5, mode="nearest")
    is_seen = np.min(counts, axis=0) >= _LEAST_REACH_PX
    rough = step[slice(*line.rows)]
    usual = float(np.percentile(np.abs(rough), 90.0)) * float(np.sign(np.median(rough)))
    run = _longest_run(is_seen & (step * usual > _SAME_STEP * usual**2), gap=1)
    first, last = line.rows if run is None else run
    middle = (first + last - 1) / 2.0
    a = float(line.at(middle))
    moved = (a, line.coefficients[1], line.coefficients[2])
    return dataclasses.replace(line, coefficients=moved, middle=middle, rows=(first, last))


def _with_flat_sides(image: np.ndarray, line: EdgeLine) -> EdgeLine:
    """How far both sides are seen and hold nothing else; rows near the ends of the edge go."""
    rows = line.rows
    for _ in range(3):
        width = _flat_width(image, dataclasses.replace(line, rows=rows))
        lean = math.ceil(width * abs(line.coefficients[1]) / line.cosine) + _CORNER_PX
        first = rows[0] if line.rows[0] <= 2 else line.rows[0] + lean
        last = rows[1] if line.rows[1] >= image.shape[0] - 2 else line.rows[1] - lean
        if last - first < _FEWEST_ROWS:
            break
        rows = (first, last)
    a, b, _ = line.coefficients
    middle = (rows[0] + rows[1] - 1) / 2.0
    moved = (a + b * (middle - line.middle), b, 0.0)
    return EdgeLine(line.is_turned, moved, middle, rows, float(width))


def _flat_width(image: np.ndarray, line: EdgeLine) -> int:
    """Pixels from the line to where too little is seen, or another edge begins."""
    inside = slice(*line.rows)
    distance = line.distance(image.shape)[inside]
    values = image[inside]
    half = int(min(np.max(distance), -np.min(distance)))
    index = np.rint(distance).astype(int)
    used = np.abs(index) <= half
    count = np.bincount(index[used] + half, minlength=2 * half + 1)
    mean = np.bincount(index[used] + half, values[used], 2 * half + 1) / np.maximum(count, 1)
    enough = count >= _FEWEST_PER_DISTANCE * np.median(count[max(0, half - 4) : half + 5])
    slope = np.abs(np.gradient(mean)) if half > 0 else np.zeros(1)
    noise = float(np.median(slope)) * _NOISE_LIMIT
    peak = float(np.max(slope[max(0, half - 3) : half + 4]))
    both = np.maximum(slope[half:], slope[half::-1])
    seen = enough[half:] & enough[half::-1]
    foot = _first(both < _FLAT_SLOPE * peak)
    other = foot + _first(both[foot:] > _OTHER_SLOPE * peak + noise)
    return max(0, min(_first(~seen) - 1, other - 2, half))


def _first(flags: np.ndarray) -> int:
    """Index of the first True, or the length."""
    return int(np.argmax(flags)) if np.any(flags) else len(flags)


def _check_step(image: np.ndarray, line: EdgeLine, region_name: str) -> None:
    """Refuse an edge whose step is lost in the scatter of its neighbours in the same row."""
    inside = slice(*line.rows)
    distance, values = line.distance(image.shape)[inside], image[inside]
    near = np.abs(distance) < _FIRST_REACH_PX
    step = abs(
        float(np.mean(values[near & (distance > 0)]) - np.mean(values[near & (distance < 0)]))
    )
    # Second differences of straight parts are noise alone, of variance 1 + 4 + 1.
    noise = 1.4826 * float(np.median(np.abs(np.diff(values, 2, axis=1)))) / math.sqrt(6.0)
    if not step > _LEAST_STEP * noise:
        raise InvalidInputError(
            f"the edge in {region_name} is too noisy: its step is only {step / noise:.2g} times "
            f"the noise of a pixel, and must be {_LEAST_STEP:g} times; take more samples"
        )


def _check_width(line: EdgeLine, region_name: str) -> None:
    if line.half_width < _LEAST_WIDTH_PX:
        raise InvalidInputError(
            f"the edge in {region_name} must have flat sides at least {_LEAST_WIDTH_PX} pixels "
            f"wide, got {line.half_width:g}; choose a wider region or a larger field of view"
        )

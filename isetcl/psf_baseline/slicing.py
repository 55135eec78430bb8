"""How depth is cut into layers: hard, or soft, a sample shared by the two layers about it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from isetcl.psf_baseline.view import Layer

_CONTIGUOUS = 2.0


def soft_slices(layers: Sequence[Layer], *, complete: bool) -> list[Layer]:
    """Layers whose samples are shared with a neighbour by their vergence.

    A sample at vergence v between the vergences of two layers, V_1 <= v <= V_2, belongs to the
    nearer one by t = (v - V_1) / (V_2 - V_1). Its blur is then interpolated linearly in vergence
    instead of jumping. Only layers of one surface are bridged, whose distance is at most twice
    what the thicker of them extends over; flat objects stay whole.

    Parameters
    ----------
    layers
        Far to near.
    complete
        True: the farther layer keeps the whole sample, under the share of the nearer one, so that
        layers put over each other lose nothing. False: it keeps the rest, so that all shares add
        up to what is visible; put over each other they let light through, so that M5 darkens
        slopes even more than with hard slices.
    """
    shares = _shares(layers)
    if not any(np.any(up) or np.any(down) for up, down in shares):
        return list(layers)
    result = []
    for k, layer in enumerate(layers):
        up, down = shares[k]
        # What goes down leaves its share here and, in complete layers, all of it below.
        own = 1.0 - down if complete else 1.0 - up - down
        parts = [(layer, own)]
        if k > 0 and np.any(shares[k - 1][0]):
            parts.append((layers[k - 1], shares[k - 1][0]))
        if k + 1 < len(layers) and np.any(shares[k + 1][1]):
            below = shares[k + 1][1]
            parts.append((layers[k + 1], (below > 0).astype(np.float32) if complete else below))
        result.append(_joined(layer.vergence_dpt, parts, complete))
    return result


def closed(layers: Sequence[Layer]) -> list[Layer]:
    """Visible layers with black added to the farthest where nothing is seen.

    Methods that divide by coverage would otherwise spread objects into the dark around them.
    """
    empty = 1.0 - np.sum([layer.coverage for layer in layers], axis=0)
    far = layers[0]
    coverage = far.coverage + np.maximum(empty, 0.0).astype(far.coverage.dtype)
    return [Layer(far.vergence_dpt, far.colour, coverage, None), *layers[1:]]


def _shares(layers: Sequence[Layer]) -> list[tuple[np.ndarray, np.ndarray]]:
    """What every sample of every layer gives to the next nearer and the next farther layer."""
    nothing = np.zeros(1, dtype=np.float32)
    found = [_vergence(layer) for layer in layers]
    widths = [float(np.ptp(v[v >= 0])) if np.any(v >= 0) else 0.0 for v in found]
    shares = []
    for k, layer in enumerate(layers):
        give = []
        for other in (k + 1, k - 1):
            if not 0 <= other < len(layers):
                give.append(nothing)
                continue
            gap = layers[other].vergence_dpt - layer.vergence_dpt
            if abs(gap) > _CONTIGUOUS * max(widths[k], widths[other]):
                give.append(nothing)
                continue
            part = np.clip((found[k] - layer.vergence_dpt) / gap, 0.0, 1.0)
            give.append(np.where(found[k] >= 0, part, 0.0).astype(np.float32))
        shares.append((give[0], give[1]))
    return shares


def _vergence(layer: Layer) -> np.ndarray:
    """Vergence of what is seen at every sample of a layer, -1 where there is nothing."""
    covered = layer.coverage > 0
    if layer.depth is None:
        return np.where(covered, np.float32(layer.vergence_dpt), np.float32(-1.0))
    return np.where(covered, layer.depth / np.where(covered, layer.coverage, 1.0), -1.0)


def _joined(
    vergence_dpt: float, parts: Sequence[tuple[Layer, np.ndarray]], complete: bool
) -> Layer:
    """A layer from shares of layers; complete ones hide each other, the last listed in front."""
    colour = np.zeros_like(parts[0][0].colour)
    coverage = np.zeros_like(parts[0][0].coverage)
    # Nearest last: the layer below, the layer itself, the layer above.
    for layer, share in sorted(parts, key=lambda part: part[0].vergence_dpt):
        own = layer.coverage * share
        rest = 1.0 - own if complete else 1.0
        colour = layer.colour * share + rest * colour
        coverage = own + rest * coverage
    return Layer(vergence_dpt, colour, coverage)

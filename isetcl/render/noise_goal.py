"""A goal in units of the noise of cones: of foveal ones, or of those that light is rendered at."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from isetcl.render.plan import Plan
from isetcl.retina.cone_noise import ConeNoise
from isetcl.retina.places import PlaceGrid


@dataclass(frozen=True, eq=False)
class OwnReceptors:
    """Receptors in the form of the grid of their places.

    Parameters
    ----------
    weights : (channels, rows, columns)
        Excitations per unit of each film channel; zero where the last row only repeats a place.
    types : (rows, columns)
        Types as numbers; -1 where the last row only repeats a place.
    """

    weights: np.ndarray
    types: np.ndarray


class NoiseGoal:
    """Whose noise a render is measured by.

    Attributes
    ----------
    goal
        What was asked for.
    rows : (types, channels)
        Excitations of the foveal cones per unit of film channels; none where there are receptors.
    receptors
        Those of the places that are rendered at; None where foveal cones are meant.

    Raises
    ------
    InvalidInputError
        If the wavelengths are not those of the pigments, or too few, or in unequal steps.
    """

    def __init__(self, prepared: Plan, goal: ConeNoise) -> None:
        self.goal = goal
        self.receptors = _own_receptors(prepared, goal)
        self.rows = np.empty((0, prepared.expansion.shape[1]))
        if self.receptors is None:
            self.rows = goal.weights(prepared.wavelengths_nm) @ prepared.expansion

    def describe(self, reached: float) -> dict[str, Any]:
        """The goal and what was reached, as plain values, for provenance."""
        if self.receptors is None:
            return self.goal.describe() | {"of": "a foveal cone", "reached": reached}
        return asdict(self.goal) | {"of": "the receptors themselves", "reached": reached}


def _own_receptors(prepared: Plan, goal: ConeNoise) -> OwnReceptors | None:
    grid = prepared.grid
    if not isinstance(grid, PlaceGrid) or goal.aperture_um is not None:
        return None
    receptors = grid.listed.receptors
    if receptors is None:
        return None
    n, pixels = len(grid.listed), grid.shape[0] * grid.shape[1]
    own = goal.receptor_weights(receptors, prepared.wavelengths_nm) @ prepared.expansion
    weights = np.zeros((own.shape[1], pixels))
    weights[:, :n] = own.T
    types = np.full(pixels, -1)
    types[:n] = receptors.types
    return OwnReceptors(weights.reshape(-1, *grid.shape), types.reshape(grid.shape))

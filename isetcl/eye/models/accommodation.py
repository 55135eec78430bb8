"""From a request in dioptres to a member of a family of eyes."""

from __future__ import annotations

from isetcl.errors import InvalidInputError, check_finite
from isetcl.eye.model import AccommodationModel, Eye, FocusCriterion
from isetcl.units import distance_from_vergence


def accommodated(
    model: AccommodationModel,
    accommodation_dpt: float | None,
    parameter: float | None,
    wavelength_nm: float,
    criterion: FocusCriterion,
) -> Eye:
    """The eye of a family at an accommodation in dioptres, or at its own parameter.

    With neither it is the relaxed eye. The wavelength, nm, and the criterion are those of
    `Eye.focus_at`.

    Raises
    ------
    InvalidInputError
        If both are given, or the accommodation is negative.
    FocusError
        If the family cannot focus there.
    """
    if accommodation_dpt is not None and parameter is not None:
        raise InvalidInputError(
            "give accommodation_dpt or accommodation_parameter, not both, "
            f"got {accommodation_dpt} and {parameter}"
        )
    if accommodation_dpt is None:
        return model.eye(model.parameter_range[0] if parameter is None else parameter)
    if check_finite("accommodation_dpt", accommodation_dpt, "dpt") < 0:
        raise InvalidInputError(
            f"accommodation_dpt must be >= 0 dpt, got {accommodation_dpt:g}; leave it out for the "
            "relaxed eye"
        )
    relaxed = model.eye(model.parameter_range[0])
    return relaxed.focus_at(distance_from_vergence(accommodation_dpt), wavelength_nm, criterion)

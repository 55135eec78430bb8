"""The model eyes by name: `isetcl.eyes`."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from isetcl.errors import InvalidInputError, check_choice
from isetcl.eye.media import AbbeInterpolation
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye, FocusCriterion, PupilPlane
from isetcl.eye.models.accommodation import accommodated
from isetcl.eye.models.ageing import ageing
from isetcl.eye.models.arizona import ArizonaModel
from isetcl.eye.models.atchison import atchison
from isetcl.eye.models.bennett_rabbetts import bennett_rabbetts
from isetcl.eye.models.gullstrand import gullstrand, gullstrand_emsley
from isetcl.eye.models.legrand import LeGrandState, legrand_eye
from isetcl.eye.models.liou_brennan import liou_brennan
from isetcl.eye.models.navarro import Hold, NavarroModel
from isetcl.eye.models.parts import PupilSpec
from isetcl.eye.models.reduced import drasdo_fowler, thibos
from isetcl.units import distance_from_vergence

if TYPE_CHECKING:
    from isetcl.eye.fitting.fit import EyeFit, fit
    from isetcl.eye.fitting.measurement import ZernikeMeasurement, measure
    from isetcl.eye.people.population import load_population

# What measured eyes need is imported when it is first used.
_PLACES = {
    "EyeFit": "isetcl.eye.fitting.fit",
    "ZernikeMeasurement": "isetcl.eye.fitting.measurement",
    "fit": "isetcl.eye.fitting.fit",
    "load_population": "isetcl.eye.people.population",
    "measure": "isetcl.eye.fitting.measurement",
}


def navarro(
    pupil_diameter_mm: float = 4.0,
    accommodation_dpt: float | None = None,
    *,
    pupil_plane: PupilPlane = "stop",
    focus_wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
    focus_criterion: FocusCriterion = "rms_spot",
    accommodation_parameter: float | None = None,
    hold: Hold = "vitreous_depth",
) -> Eye:
    """Navarro's wide-angle eye (Escudero-Sanz & Navarro 1999), the paper's table 1.

    Parameters
    ----------
    pupil_diameter_mm
        Diameter of the pupil in `pupil_plane`, mm.
    accommodation_dpt
        The eye is in focus for an object at 1/accommodation metres from the corneal vertex, at the
        focus wavelength and by the criterion. None, the default, is the relaxed eye; that one is
        focused somewhat in front of infinity (0.43 dpt at a 4 mm stop and 550 nm).
    pupil_plane
        ``"stop"`` (the iris, as in the paper) or ``"entrance"`` (what a clinician measures).
    focus_wavelength_nm, focus_criterion
        See `Eye.focus_at`.
    accommodation_parameter
        Navarro's own parameter A, 0 to 10, instead of `accommodation_dpt`. It is not dioptres:
        A = 1 focuses at 1.65 dpt.
    hold
        What stays when the lens grows: ``"vitreous_depth"`` or ``"axial_length"``; see
        `NavarroModel`.

    Raises
    ------
    FocusError
        If the eye cannot focus there (the far point at 4 mm is 0.43 dpt, the near point 9.3 dpt).
    InvalidInputError
        If an argument breaks its rule, or both accommodations are given.
    """
    model = NavarroModel(PupilSpec(pupil_diameter_mm, pupil_plane), hold)
    return accommodated(
        model, accommodation_dpt, accommodation_parameter, focus_wavelength_nm, focus_criterion
    )


def arizona(
    pupil_diameter_mm: float = 4.0,
    accommodation_dpt: float | None = None,
    *,
    pupil_plane: PupilPlane = "stop",
    focus_wavelength_nm: float = REFERENCE_WAVELENGTH_NM,
    focus_criterion: FocusCriterion = "rms_spot",
    accommodation_parameter: float | None = None,
    interpolation: AbbeInterpolation = "shifted_cauchy",
) -> Eye:
    """The Arizona eye (Schwiegerling 2004), the paper's table 2.

    Parameters
    ----------
    pupil_diameter_mm, accommodation_dpt, pupil_plane, focus_wavelength_nm, focus_criterion
        As in `navarro`.
    accommodation_parameter
        The model's own parameter A, 0 to 10, instead of `accommodation_dpt`; near to dioptres for
        paraxial focus.
    interpolation
        How index and Abbe number become a dispersion curve: ``"shifted_cauchy"`` (default),
        ``"cauchy"`` or ``"linear"`` (ISET3d's straight line); see `AbbeDispersion`.

    Raises
    ------
    FocusError, InvalidInputError
        As in `navarro`.
    """
    model = ArizonaModel(PupilSpec(pupil_diameter_mm, pupil_plane), interpolation)
    return accommodated(
        model, accommodation_dpt, accommodation_parameter, focus_wavelength_nm, focus_criterion
    )


def legrand(
    pupil_diameter_mm: float = 4.0,
    *,
    pupil_plane: PupilPlane = "stop",
    state: LeGrandState = "relaxed",
) -> Eye:
    """Le Grand's full theoretical eye, the paper's table 3.

    Parameters
    ----------
    pupil_diameter_mm, pupil_plane
        As in `navarro`.
    state
        ``"relaxed"`` or ``"accommodated"`` (Le Grand's second form: 7.3 dpt paraxial). The model
        has nothing in between, so it takes no accommodation in dioptres.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule.
    """
    return legrand_eye(PupilSpec(pupil_diameter_mm, pupil_plane), state)


_BUILDERS: dict[str, Callable[..., Eye]] = {
    "navarro": navarro,
    "arizona": arizona,
    "legrand": legrand,
    "gullstrand": gullstrand,
    "gullstrand_emsley": gullstrand_emsley,
    "bennett_rabbetts": bennett_rabbetts,
    "liou_brennan": liou_brennan,
    "atchison": atchison,
    "ageing": ageing,
    "drasdo_fowler": drasdo_fowler,
    "thibos": thibos,
}

ACCOMMODATING = tuple(
    name
    for name, builder in _BUILDERS.items()
    if "accommodation_dpt" in inspect.signature(builder).parameters
)
"""Names of the eyes that accommodate continuously."""

FILE_SUFFIXES = (".json", ".zmx", ".dat")
"""Endings of names that are files of eyes."""

__all__ = [
    "ACCOMMODATING",
    "FILE_SUFFIXES",
    "EyeFit",
    "ZernikeMeasurement",
    "by_name",
    "fit",
    "load_population",
    "measure",
    "names",
    *_BUILDERS,
]


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = getattr(importlib.import_module(_PLACES[name]), name)
    return globals()[name]


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def names() -> tuple[str, ...]:
    """The names that `by_name` knows."""
    return tuple(_BUILDERS)


def by_name(
    name: str, pupil_diameter_mm: float = 4.0, accommodation_dpt: float | None = None
) -> Eye:
    """A model eye by its name, one of `names()`, or the eye of a file (see `load_eye`).

    Everything else is at its default.

    Raises
    ------
    InvalidInputError
        If the name is unknown (near matches are named), or the eye cannot accommodate.
    FileError
        If the file cannot be read.
    """
    if isinstance(name, str) and name.lower().endswith(FILE_SUFFIXES):
        from isetcl.eye.files.load import load_eye

        eye = load_eye(name, pupil_diameter_mm=pupil_diameter_mm)
        if accommodation_dpt is None:
            return eye
        return eye.focus_at(distance_from_vergence(accommodation_dpt))
    builder = _BUILDERS[check_choice("eye", name, names())]
    if name in ACCOMMODATING:
        return builder(pupil_diameter_mm, accommodation_dpt)
    if accommodation_dpt is not None:
        raise InvalidInputError(
            f"eye {name!r} does not accommodate continuously, so accommodation_dpt must be left "
            f"out (--accommodation relaxed), got {accommodation_dpt:g} dpt; or use "
            + " or ".join(repr(other) for other in ACCOMMODATING)
        )
    return builder(pupil_diameter_mm)

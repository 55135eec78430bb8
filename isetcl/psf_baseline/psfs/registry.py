"""The list of kinds of point spread functions."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from isetcl.errors import (
    InvalidInputError,
    check_between,
    check_choice,
    check_finite,
    check_pair,
    check_positive,
    check_type,
)
from isetcl.eye.model import Eye
from isetcl.psf_baseline.psf import Psf, geometric_psf
from isetcl.psf_baseline.psfs.defocus import chromatic_defocus_psf, disc_psf, gaussian_psf
from isetcl.psf_baseline.psfs.gathered import gathered_psf
from isetcl.psf_baseline.psfs.hurb import hurb_psf
from isetcl.psf_baseline.psfs.population import (
    ijspeert_psf,
    vos_van_den_berg_psf,
    watson_psf,
    williams_psf,
)
from isetcl.psf_baseline.psfs.wave import wave_psf
from isetcl.units import MM_PER_M

MAX_REACH_DEG = 30.0
_CLEARANCE_MM = 8.0
_COMMON = {"eye", "wavelength_nm", "vergence_dpt", "pitch_deg", "field_deg", "reach_deg"}


@dataclass(frozen=True)
class PsfKind:
    """A way to get the PSF of an eye for a wavelength, a depth and a field position.

    Attributes
    ----------
    name
        Name used in `render`.
    make
        The function; see `wave_psf`.
    summary, failure
        What it is, and what it leaves out, in a line each.
    knows_wavelength, knows_depth, knows_field
        Whether the PSF changes with each of these; where not, one serves all.
    options
        Further arguments of the function.
    """

    name: str
    make: Callable[..., Psf]
    summary: str
    failure: str
    knows_wavelength: bool = False
    knows_depth: bool = False
    knows_field: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)

    def __call__(
        self,
        eye: Eye,
        wavelength_nm: float,
        vergence_dpt: float,
        pitch_deg: float,
        field_deg: tuple[float, float] = (0.0, 0.0),
        *,
        reach_deg: float = 2.0,
    ) -> Psf:
        """The PSF on a grid of visual angle, relative to the chief ray of its own wavelength.

        Parameters
        ----------
        wavelength_nm
            Wavelength, nm.
        vergence_dpt
            1/(distance along the axis from the corneal vertex), 1/m; 0 is infinity.
        pitch_deg
            Width of a sample, degrees.
        field_deg
            Field angles (x, y) of the point.
        reach_deg
            How far a kernel may reach that would otherwise go on without end. It is as small as
            99 % of the light allow; the rest is its `energy_outside`.

        Raises
        ------
        InvalidInputError
            If an argument breaks its rule, or the kernel would be more than 4096 samples across.
        """
        check_type("eye", eye, Eye)
        check_positive("wavelength_nm", wavelength_nm, "nm")
        check_positive("pitch_deg", pitch_deg, "deg")
        check_finite("vergence_dpt", vergence_dpt, "dpt")
        where = check_pair("field_deg", field_deg, "deg")
        check_between("reach_deg", reach_deg, 0.0, MAX_REACH_DEG, "deg")
        if not 0.0 <= vergence_dpt < MM_PER_M / _CLEARANCE_MM:
            raise InvalidInputError(
                f"vergence_dpt must lie between 0 and {MM_PER_M / _CLEARANCE_MM:g} dpt (the "
                f"object in front of the eye), got {vergence_dpt:g} dpt"
            )
        return self.make(
            eye, wavelength_nm, vergence_dpt, pitch_deg, where, reach_deg=reach_deg, **self.options
        )

    def with_options(self, **options: Any) -> PsfKind:
        """The same kind with other options, as the age of population formulas.

        Raises
        ------
        InvalidInputError
            If the kind has no such option.
        """
        known = [n for n in inspect.signature(self.make).parameters if n not in _COMMON]
        for name in options:
            if not known:
                raise InvalidInputError(f"psf {self.name!r} has no options, got {name!r}")
            check_choice(f"option of psf {self.name!r}", name, known)
        return dataclasses.replace(self, options={**self.options, **options})

    def describe(self) -> dict[str, Any]:
        """Name and options as plain values, for provenance."""
        return {"kind": self.name, **self.options}


def _spread(
    eye: Eye,
    wavelength_nm: float,
    vergence_dpt: float,
    pitch_deg: float,
    field_deg: tuple[float, float] = (0.0, 0.0),
    *,
    reach_deg: float = 2.0,
) -> Psf:
    """`geometric_psf`, whose kernel is as large as its rays need."""
    return geometric_psf(eye, wavelength_nm, vergence_dpt, pitch_deg, field_deg)


_EYE: dict[str, Any] = {"knows_wavelength": True, "knows_depth": True, "knows_field": True}

_KINDS = (
    PsfKind(
        "geometric",
        gathered_psf,
        "the eye's own rays, to a retinal point",
        "no diffraction",
        **_EYE,
    ),
    PsfKind(
        "geometric_spread",
        _spread,
        "the eye's own rays, from an object point",
        "no diffraction; coma makes large blur discs of the wrong size, by about 1 %",
        **_EYE,
    ),
    PsfKind(
        "wave",
        wave_psf,
        "the eye's own wavefront: aberrations and diffraction",
        "needs many samples of the pupil far from focus",
        **_EYE,
    ),
    PsfKind(
        "hurb",
        hurb_psf,
        "the eye's own rays, bent at the stop by uncertainty",
        "no interference: no rings, and tails that are too wide",
        **_EYE,
    ),
    PsfKind(
        "disc",
        disc_psf,
        "the blur disc of a thin lens focused like the eye",
        "no colour, aberrations or diffraction; the same all over the field",
        knows_depth=True,
    ),
    PsfKind(
        "gaussian",
        gaussian_psf,
        "a Gaussian of the variance of the disc",
        "as the disc, and no sharp rim",
        knows_depth=True,
    ),
    PsfKind(
        "chromatic_defocus",
        chromatic_defocus_psf,
        "diffraction and defocus of a reduced eye with longitudinal colour",
        "no aberrations but defocus; the same all over the field",
        knows_wavelength=True,
        knows_depth=True,
    ),
    PsfKind(
        "watson",
        watson_psf,
        "mean of 200 eyes by pupil size, in white light",
        "no depth, colour or field; no phase",
    ),
    PsfKind(
        "williams",
        williams_psf,
        "mean eye at 3 mm and 633 nm",
        "no pupil, depth, colour or field; no phase",
    ),
    PsfKind(
        "ijspeert",
        ijspeert_psf,
        "mean eye by pupil size, age and pigmentation, with the light it scatters",
        "no depth, colour or field; what is beyond the kernel is spread evenly",
    ),
    PsfKind(
        "vos_van_den_berg",
        vos_van_den_berg_psf,
        "the CIE's standard eye by age and pigmentation, with the light it scatters",
        "no pupil, depth, colour or field; what is beyond the kernel is spread evenly",
    ),
)


def psf_kinds() -> dict[str, PsfKind]:
    """The kinds of PSFs by name."""
    return {kind.name: kind for kind in _KINDS}


def psf_kind(kind: str | PsfKind) -> PsfKind:
    """A kind by its name; a kind is returned as it is.

    Raises
    ------
    InvalidInputError
        With the near matches, if there is no such kind.
    """
    if isinstance(kind, PsfKind):
        return kind
    kinds = psf_kinds()
    return kinds[check_choice("psf", kind, kinds)]

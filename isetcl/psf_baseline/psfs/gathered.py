"""PSFs of retinal points: what each gathers its light from."""

from __future__ import annotations

from isetcl.eye.model import Eye
from isetcl.psf_baseline.outgoing import gathered_deg, gathered_fan_deg
from isetcl.psf_baseline.psf import PUPIL_RAYS, RADIAL_RAYS, Psf, deposited, turned


def gathered_psf(
    eye: Eye,
    wavelength_nm: float,
    vergence_dpt: float,
    pitch_deg: float,
    field_deg: tuple[float, float] = (0.0, 0.0),
    *,
    reach_deg: float = 2.0,
) -> Psf:
    """The kernel with which a retinal point gathers light, from the eye's own rays.

    Turned about its middle it shows where the light of the point comes from; an image that is
    blurred with it has at that point what rays from there find, whatever coma does to the
    neighbourhood. Without diffraction; the kernel is as large as the rays need.

    Parameters
    ----------
    wavelength_nm, vergence_dpt, pitch_deg
        As for `geometric_psf`.
    field_deg
        Field angles (x, y) of the retinal point.
    reach_deg
        Not used: the rays end.
    """
    if field_deg == (0.0, 0.0) and eye.is_rotational:
        radius, weights = gathered_fan_deg(eye, wavelength_nm, vergence_dpt, RADIAL_RAYS)
        return turned(radius / pitch_deg, weights, pitch_deg)
    x, y, weights = gathered_deg(eye, wavelength_nm, vergence_dpt, field_deg, PUPIL_RAYS)
    return deposited(x / pitch_deg, y / pitch_deg, weights, pitch_deg)

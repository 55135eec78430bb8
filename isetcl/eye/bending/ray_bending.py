"""Diffraction at the stop as random bends of rays: Heisenberg's uncertainty, and the Airy pattern.

A ray at a point of the stop has the direction T, |T| = n. A hole changes only the part of T that
lies in its plane, and by an amount that does not depend on n or on the slant of the ray: the
angular spectrum behind the hole is that in front of it, convolved with the Fourier transform of the
hole, and a spatial frequency f is the change lambda f of T (lambda in vacuum). Here a model draws
that change for a hole of radius 1; for an elliptical hole it is stretched back, since the Fourier
transform of a stretched disc is that of the disc, compressed:

    dT = scale M^T tau,   M: the stop's plane to the unit disc.

What would make |T| in the plane exceed n is evanescent, and the ray is lost.

Rays may be followed either way. The distribution of the change is even in it, and the measure
dx dy dTx dTy is the same on both sides of every surface; so drawing the change for a ray that comes
from the retina gives the light that the same change sends there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from isetcl.errors import InvalidInputError, check_array, check_choice, check_positive
from isetcl.eye.bending.airy import airy_table, radius_of_share
from isetcl.eye.stop import Stop
from isetcl.units import NM_PER_MM

HurbAxes = Literal["iset3d", "optrace", "isotropic"]
_HURB_AXES = ("iset3d", "optrace", "isotropic")

ISET3D_GAMMA = 2.0 / 1.41
"""gamma of the factor 1.41 in ISET3d's sigma = atan(1 / (1.41 Delta 2 pi / lambda))."""

_RADII = 200
_LARGEST_BESSEL = 1e8
_FREQUENCIES = 600


@dataclass(frozen=True)
class Hurb:
    """Heisenberg uncertainty ray bending: two Gaussian deviates that depend on the edge's distance.

    tan sigma = gamma / (2 k Delta) with k = 2 pi / lambda: across the nearest edge (S) Delta is the
    distance to it, along it (L) another one. In a round stop of radius R, at r from its middle,
    Delta_S = R - r. In an elliptical one all lengths are taken where the ellipse is stretched to a
    circle, and the bend is stretched back; then the pattern of an ellipse is that of a circle with
    the two directions scaled, as it is for light. There is no interference in it: it has no rings.

    Parameters
    ----------
    axes
        Delta_L: ``"iset3d"`` (the paper) sqrt(R^2 - r^2), ``"optrace"`` sqrt((R - r) R), or
        ``"isotropic"`` R - r.
    gamma
        Width of the Gaussians. Freniere's 1 is the default: with it the white-light MTF of
        Navarro's and the Arizona eye is right to 0.03 at 5 to 30 cycles/deg through pupils of 2 to
        6 mm. 1.22 fits the MTF of an eye without aberrations best, and sqrt(2) its peak.
    wavelength
        lambda is that in the stop's ``"medium"``, as diffraction has it, or in ``"vacuum"``.

    Notes
    -----
    `Hurb.iset3d()` is what the paper's software computes.

    References
    ----------
    Freniere, Groot Gregory & Hassler 1999, Proc SPIE 3780:151. Lian et al. 2019, J Vision
    19(5):23 (axes "iset3d"). optrace, documentation of HURB (axes "optrace").
    """

    axes: HurbAxes = "iset3d"
    gamma: float = 1.0
    wavelength: Literal["medium", "vacuum"] = "medium"

    def __post_init__(self) -> None:
        check_choice("hurb: axes", self.axes, _HURB_AXES)
        object.__setattr__(self, "gamma", check_positive("hurb: gamma", self.gamma))
        check_choice("hurb: wavelength", self.wavelength, ("medium", "vacuum"))

    @classmethod
    def iset3d(cls) -> Hurb:
        """The values of ISET3d: gamma = 2 / 1.41 and the wavelength in vacuum.

        sigma_S = atan(1 / (1.41 Delta_S 2 pi / lambda)). Since the stop lies in the aqueous, its
        bends are n times wider than gamma says.
        """
        return cls("iset3d", ISET3D_GAMMA, "vacuum")

    def scale_mm(self, wavelength_nm: float, index: float) -> float:
        """dT times length: T changes by this over Delta for a deviate of 1, mm."""
        scale = self.gamma * wavelength_nm / NM_PER_MM / (4.0 * math.pi)
        return scale * index if self.wavelength == "vacuum" else scale

    def distances(self, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Delta_S and Delta_L at distances from the middle of a round stop of radius 1."""
        r = check_array("radius", radius)
        across = 1.0 - r
        along = {
            "iset3d": (1.0 - r) * (1.0 + r),
            "optrace": across,
            "isotropic": across**2,
        }[self.axes]
        return across, np.sqrt(along)

    def tau(self, disc: np.ndarray, beyond: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Changes of T for a stop of radius 1 and a scale of 1, (n, 2).

        Parameters
        ----------
        disc : ndarray, (n, 2)
            Points of the stop, in the unit disc.
        beyond : ndarray, (n,)
            Shares of larger deviates, uniform in (0, 1].
        turn : ndarray, (n, 2)
            Unit vectors of random direction.
        """
        radius = np.linalg.norm(disc, axis=1)
        safe = np.where(radius > 0.0, radius, 1.0)[:, None]
        s = np.where(radius[:, None] > 0.0, disc / safe, np.array([1.0, 0.0]))
        deviates = np.sqrt(-2.0 * np.log(beyond))[:, None] * turn
        across, along = self.distances(radius)
        with np.errstate(divide="ignore"):
            g_s, g_l = deviates[:, 0] / across, deviates[:, 1] / along
        return np.stack([g_s * s[:, 0] - g_l * s[:, 1], g_s * s[:, 1] + g_l * s[:, 0]], axis=1)

    def otf(self, share_of_cutoff: np.ndarray | float, index: float = 1.0) -> np.ndarray:
        """OTF of an aberration-free system with a round stop at s = frequency lambda / D.

        The mean over the stop of exp(-2 s^2 (sigma_S^2 cos^2 + sigma_L^2 sin^2)), sigma =
        gamma / (2 Delta). It has no cut-off. lambda is that in the medium of the stop.

        Parameters
        ----------
        share_of_cutoff
            s, any shape.
        index
            Index at the stop; widens the bends where the model takes the wavelength in vacuum.
        """
        from scipy.special import ive

        s = check_array("share_of_cutoff", share_of_cutoff)
        nodes, weights = np.polynomial.legendre.leggauss(_RADII)
        r = (nodes + 1.0) / 2.0
        gamma = self.gamma * (index if self.wavelength == "vacuum" else 1.0)
        a, b = (2.0 * (gamma / (2.0 * d) * s[..., None]) ** 2 for d in self.distances(r))
        # <exp(-a cos^2 - b sin^2)> = exp(-(a + b)/2) I0((a - b)/2), and a >= b.
        # Where the difference is beyond the range of ive, exp(-b) has made the product 0.
        return np.asarray(
            np.exp(-b) * ive(0, np.minimum((a - b) / 2.0, _LARGEST_BESSEL)) @ (weights * r)
        )

    def encircled_energy(self, v: np.ndarray | float, index: float = 1.0) -> np.ndarray:
        """Share of the light within v = pi D sin(theta) / lambda; see `otf`. Any shape."""
        from scipy.special import j1

        v = check_array("v", v)
        s, weight = self._frequencies(index)
        return np.asarray(2.0 * v * (j1(2.0 * v[..., None] * s) @ (weight * self.otf(s, index))))

    def peak_ratio(self, index: float = 1.0) -> float:
        """Peak of the pattern over that of the Airy pattern: 8 integral OTF(s) s ds."""
        s, weight = self._frequencies(index)
        return float(8.0 * (weight * s) @ self.otf(s, index))

    def _frequencies(self, index: float) -> tuple[np.ndarray, np.ndarray]:
        """Nodes and weights over all s where there is any transfer."""
        gamma = self.gamma * (index if self.wavelength == "vacuum" else 1.0)
        nodes, weights = np.polynomial.legendre.leggauss(_FREQUENCIES)
        most = 9.0 / gamma  # exp(-s^2 gamma^2 / 2) of the middle of the stop: 1e-18
        return most * (nodes + 1.0) / 2.0, most / 2.0 * weights

    def describe(self) -> dict[str, Any]:
        """Everything as plain values, for provenance."""
        return {
            "model": "hurb",
            "axes": self.axes,
            "gamma": self.gamma,
            "wavelength": self.wavelength,
        }


@dataclass(frozen=True)
class Airy:
    """The diffraction pattern of the whole stop, drawn for every ray: rings and all.

    The change of T has the density |Fourier transform of the stop|^2 wherever the ray passes, so
    that the image of a point is the rays' own, convolved with the pattern. Without aberrations that
    is exact. With them the transfer is the product of both, which is too low where aberrations and
    diffraction matter alike: in white light through Navarro's eye by 0.02 at 1 mm, 0.10 at 2 and 3
    mm and 0.08 at 4 mm of pupil (`Hurb()`: 0.15, 0.02, 0.02, 0.02).

    The shares of light beyond ring 50 follow the mean 2 / (pi v); what is beyond |T| = n is lost
    (3e-5 of the light at 3 mm).
    """

    def scale_mm(self, wavelength_nm: float, index: float) -> float:
        """dT times length: T changes by this times v over the radius of the stop, mm."""
        return wavelength_nm / NM_PER_MM / (2.0 * math.pi)

    def tau(self, disc: np.ndarray, beyond: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Changes of T for a stop of radius 1 and a scale of 1, (n, 2); as `Hurb.tau`."""
        return radius_of_share(beyond)[:, None] * np.asarray(turn)

    def describe(self) -> dict[str, Any]:
        """Everything as plain values, for provenance."""
        return {"model": "airy"}


Diffraction = Hurb | Airy
DiffractionChoice = Literal["none", "hurb", "iset3d", "airy", "auto"] | Hurb | Airy
_NAMES = ("none", "hurb", "iset3d", "airy", "auto")


def diffraction_model(choice: DiffractionChoice) -> Diffraction | Literal["auto"] | None:
    """The model that an argument `diffraction` names; None for "none".

    Raises
    ------
    InvalidInputError
        If it is no name or model.
    """
    if isinstance(choice, Hurb | Airy):
        return choice
    if not isinstance(choice, str):
        raise InvalidInputError(
            f"diffraction must be one of {', '.join(_NAMES)}, or a Hurb(...), got {choice!r}"
        )
    check_choice("diffraction", choice, _NAMES)
    models: dict[str, Diffraction | Literal["auto"] | None] = {
        "none": None,
        "hurb": Hurb(),
        "iset3d": Hurb.iset3d(),
        "airy": Airy(),
        "auto": "auto",
    }
    return models[choice]


def bend(
    model: Diffraction,
    stop: Stop,
    points_mm: np.ndarray,
    directions: np.ndarray,
    wavelength_nm: float,
    beyond: np.ndarray,
    turn: np.ndarray,
) -> np.ndarray:
    """Directions behind the stop, (n, 3), each as long as it was; NaN where a ray is lost.

    Parameters
    ----------
    points_mm : ndarray, (n, 2) or (n, 3)
        Where the rays meet the plane of the stop.
    directions : ndarray, (n, 3)
        Directions T, as long as the index there.
    wavelength_nm
        Wavelength in vacuum, nm.
    beyond, turn
        Random numbers; see `Hurb.tau`.
    """
    t = np.asarray(directions, dtype=np.float64)
    n2 = np.sum(t * t, axis=1)
    index = float(np.sqrt(n2[0]))
    disc = stop.disc_of(np.asarray(points_mm, dtype=np.float64)[:, :2])
    tau = model.tau(disc, np.asarray(beyond), np.asarray(turn))
    moved = t[:, :2] + model.scale_mm(wavelength_nm, index) * (tau @ to_disc(stop))
    with np.errstate(invalid="ignore"):
        along = np.sign(t[:, 2]) * np.sqrt(n2 - np.sum(moved * moved, axis=1))
    return np.concatenate([moved, along[:, None]], axis=1)


def to_disc(stop: Stop) -> np.ndarray:
    """The matrix M (2, 2), 1/mm, from the stop's plane (about its middle) to the unit disc."""
    turn = math.radians(stop.axis_deg)
    long = np.array([math.cos(turn), math.sin(turn)]) / stop.radius_mm
    short = np.array([-math.sin(turn), math.cos(turn)]) / (stop.radius_mm * stop.aspect)
    return np.stack([long, short])


def radial_table(model: Diffraction) -> tuple[float, np.ndarray]:
    """Steps a unit and the table of lengths of tau that the kernels need; empty for HURB."""
    return airy_table() if isinstance(model, Airy) else (0.0, np.zeros(0))

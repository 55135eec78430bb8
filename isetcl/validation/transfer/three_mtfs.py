"""The modulation transfer of an eye, found in three ways that share little.

From a slanted edge in a rendered image; from the line spread of rays of a point, traced forwards;
and from the wavefront in the exit pupil.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from isetcl.errors import (
    InvalidInputError,
    check_array,
    check_between,
    check_choice,
    check_finite,
    check_positive,
    check_type,
)
from isetcl.eye.aberrations.geometric import Spot, spot, spot_of_wavefront
from isetcl.eye.aberrations.polychromatic import Model
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye, check_eye_wavelengths
from isetcl.eye.waves.wavefront import Wavefront
from isetcl.retina.image import RetinalImage
from isetcl.spectrum import check_wavelengths, luminous_efficiency
from isetcl.units import ARCMIN_PER_DEG, MM_PER_M, NM_PER_MM
from isetcl.validation.transfer.result import SlantedEdgeMtf
from isetcl.validation.transfer.slanted_edge import slanted_edge_mtf

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FAR_M = 1e6
_ANGLE_RANGE_DEG = (2.0, 40.0)
_PIXELS = (64, 512)
_MARGIN = 1.15
_BEYOND = 0.005
_NOT_ROUND = 1.0

Section = Literal["sagittal", "tangential"]
SECTIONS: tuple[Section, ...] = ("sagittal", "tangential")


@dataclass(frozen=True, eq=False)
class ThreeMtfs:
    """Modulation transfer by three ways; f frequencies.

    Attributes
    ----------
    frequency_cpd : ndarray, (f,)
        Frequencies, cycles/degree.
    slanted_edge, slanted_edge_error : ndarray, (f,)
        From the rendered edge, with its standard error.
    line_spread : ndarray, (f,)
        From the rays of a point; for the model "diffraction" times the transfer of the pupil
        without aberrations.
    wavefront : ndarray, (f,)
        From the wavefront: by diffraction, or for the model "geometric" by its normals.
    model
        ``"geometric"`` or ``"diffraction"``.
    wavelengths_nm, weights : ndarray, (n,)
        Light, with weights that sum to 1.
    field_deg
        Field angles (x, y) of the middle of the edge.
    section
        ``"sagittal"`` for stripes along the field, ``"tangential"`` for those across it.
    edge_angle_deg
        Tilt of the edge from the vertical, anticlockwise; the transfer holds for stripes along it.
    measured
        What was measured in the image.
    image
        The image.
    """

    frequency_cpd: np.ndarray
    slanted_edge: np.ndarray
    slanted_edge_error: np.ndarray
    line_spread: np.ndarray
    wavefront: np.ndarray
    model: Model
    wavelengths_nm: np.ndarray
    weights: np.ndarray
    field_deg: tuple[float, float]
    section: Section
    edge_angle_deg: float
    measured: SlantedEdgeMtf
    image: RetinalImage

    def differences(self) -> dict[str, float]:
        """Largest difference of each pair, up to the highest frequency."""
        ways = {
            "slanted edge": self.slanted_edge,
            "line spread": self.line_spread,
            "wavefront": self.wavefront,
        }
        names = list(ways)
        return {
            f"{one} and {other}": float(np.max(np.abs(ways[one] - ways[other])))
            for i, one in enumerate(names)
            for other in names[i + 1 :]
        }

    @property
    def light(self) -> str:
        """The light in words."""
        if len(self.wavelengths_nm) == 1:
            return f"{self.wavelengths_nm[0]:g} nm"
        return f"{self.wavelengths_nm[0]:g} to {self.wavelengths_nm[-1]:g} nm, weighted"

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the three curves, the edge's with its standard error; returns the axes."""
        from isetcl.validation.transfer.pictures import draw_three_mtfs

        return draw_three_mtfs(self, ax)


def three_mtfs(
    eye: Eye,
    *,
    wavelengths_nm: np.ndarray | Sequence[float] | float = REFERENCE_WAVELENGTH_NM,
    weights: np.ndarray | Sequence[float] | None = None,
    model: Model = "geometric",
    largest_cpd: float = 60.0,
    field_deg: float = 0.0,
    section: Section = "sagittal",
    object_distance_m: float = math.inf,
    edge_angle_deg: float = 5.0,
    spp: int = 256,
    seed: int = 0,
    device: str | None = None,
) -> ThreeMtfs:
    """The modulation transfer from a rendered slanted edge, from rays, and from the wavefront.

    Parameters
    ----------
    eye
        The eye, focused on the edge or not.
    wavelengths_nm
        Light: a wavelength, or several.
    weights
        Weight of every wavelength; None is V(lambda), for light of equal energy.
    model
        ``"geometric"``: rays alone, in all three. ``"diffraction"``: the renderer bends rays at the
        stop ("airy"), rays of a point are convolved with the pattern of the pupil, and the
        wavefront is what it is. The first two are approximations there: they know no interference
        between aberrated rays.
    largest_cpd
        Highest frequency, cycles/degree: half a cycle per pixel of the image.
    field_deg
        Distance of the edge's middle from the axis, degrees: upwards, with the tilt of the edge.
    section
        ``"sagittal"``: the edge runs along the field, and the blur across it is the sagittal one.
        ``"tangential"``: it runs at right angles to the field. On the axis of an eye of revolution
        the two are alike.
    object_distance_m
        Distance of the edge from the corneal vertex; infinity is 1e6 m.
    edge_angle_deg
        Tilt of the edge from the vertical, for the tangential section from the horizontal, 2 to 40
        degrees.
    spp, seed, device
        As for `isetcl.render`.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule, or rays are vignetted.

    Notes
    -----
    The second and third ways take the light of one point. The edge's image is made of many points
    whose coma differs; with the spherical aberration of an eye with a pupil of 4.5 mm this lowers
    the transfer of the edge by up to 0.003.
    """
    check_type("eye", eye, Eye)
    check_choice("model", model, ("geometric", "diffraction"))
    highest = check_positive("largest_cpd", largest_cpd, "cycles/degree")
    angle = check_between("edge_angle_deg", edge_angle_deg, *_ANGLE_RANGE_DEG, "deg")
    check_choice("section", section, SECTIONS)
    height = check_finite("field_deg", field_deg, "deg")
    grid = check_wavelengths(wavelengths_nm)
    check_eye_wavelengths(eye, grid)
    share = _shares(grid, weights)
    turn = math.radians(angle)
    field = (-height * math.sin(turn) + 0.0, height * math.cos(turn))
    tilt = angle + (90.0 if section == "tangential" else 0.0)
    rays, fronts = [], []
    for nm in grid:
        options = {
            "object_distance_m": object_distance_m,
            "scale_wavelength_nm": REFERENCE_WAVELENGTH_NM,
        }
        rays.append(spot(eye, field, float(nm), **options))  # type: ignore[arg-type]
        fronts.append(eye.wavefront(field, float(nm), **options))  # type: ignore[arg-type]
    shifts = eye.tca_arcmin(field, grid, REFERENCE_WAVELENGTH_NM, object_distance_m)
    across = np.array([math.cos(math.radians(tilt)), math.sin(math.radians(tilt))])
    moved = shifts @ across / ARCMIN_PER_DEG
    pixels = _pixels(eye, rays, shifts, highest, model, angle)
    image = _render_edge(
        eye,
        grid,
        (pixels / (2.0 * highest), pixels, field, tilt, object_distance_m),
        height if section == "tangential" else 0.0,
        diffraction="airy" if model == "diffraction" else "none",
        spp=spp,
        seed=seed,
        device=device,
    )
    measured = slanted_edge_mtf(image, weights=share, eye=eye)
    assert measured.frequency_cpd is not None
    frequency = measured.frequency_cpd
    line, wave = np.zeros((2, len(frequency)), dtype=complex)
    for part, one, front, shift in zip(share, rays, fronts, moved, strict=True):
        phase = part * np.exp(-2j * np.pi * frequency * shift)
        line += phase * one.otf(frequency, tilt) * _ideal(front, frequency, tilt, model)
        wave += phase * _wave(front, frequency, tilt, model)
    return ThreeMtfs(
        frequency,
        measured.photopic_mtf,
        measured.photopic_standard_error,
        np.abs(line),
        np.abs(wave),
        model,
        grid,
        share,
        field,
        section,
        tilt,
        measured,
        image,
    )


def _shares(grid: np.ndarray, weights: np.ndarray | Sequence[float] | None) -> np.ndarray:
    """Weights of the wavelengths, which sum to 1."""
    if weights is None:
        share = luminous_efficiency(grid) if len(grid) > 1 else np.ones(1)
    else:
        share = check_array("weights", weights)
    if share.shape != grid.shape or not np.all(share >= 0) or not np.sum(share) > 0:
        raise InvalidInputError(
            f"weights must be one number >= 0 per wavelength, not all 0, got {share.tolist()}"
        )
    return np.asarray(share / np.sum(share))


def _pixels(
    eye: Eye,
    rays: Sequence[Spot],
    shifts_arcmin: np.ndarray,
    highest_cpd: float,
    model: Model,
    angle_deg: float,
) -> int:
    """Pixels of a square image whose flat sides hold the blur and 99.5 % of what diffraction bends.

    The rest is found from what is seen of it.
    """
    reach = max(
        float(np.max(np.hypot(one.x_arcmin + x, one.y_arcmin + y)))
        for one, (x, y) in zip(rays, shifts_arcmin, strict=True)
    )
    half_deg = 2.0 * reach / ARCMIN_PER_DEG
    if model == "diffraction":
        pupil = eye.entrance_pupil(REFERENCE_WAVELENGTH_NM).diameter_mm
        longest = max(one.wavelength_nm for one in rays)
        cutoff = math.radians(pupil * NM_PER_MM / longest)
        # See the notes of slanted_edge_mtf.
        half_deg += 0.13 / (cutoff * _BEYOND)
    lean = math.cos(math.radians(angle_deg))
    count = math.ceil(_MARGIN * 2.0 * half_deg / lean * 2.0 * highest_cpd)
    if count > _PIXELS[1]:
        raise InvalidInputError(
            f"the edge is blurred over {half_deg * ARCMIN_PER_DEG:.3g} arcmin, which needs {count} "
            f"pixels at largest_cpd {highest_cpd:g}, more than {_PIXELS[1]}; lower largest_cpd"
        )
    return max(_PIXELS[0], count + count % 2)


def _render_edge(
    eye: Eye,
    grid: np.ndarray,
    view: tuple[float, int, tuple[float, float], float, float],
    off_axis_deg: float,
    **options: object,
) -> RetinalImage:
    from isetcl.render.interrupt import check_complete
    from isetcl.render.render import render
    from isetcl.scene.targets.edge import slanted_edge

    fov, pixels, field, angle, distance = view
    away = _FAR_M if math.isinf(distance) else distance
    # Chief rays aim at the middle of the entrance pupil.
    height = away + eye.entrance_pupil().z_mm / MM_PER_M
    offset = height * math.tan(math.radians(off_axis_deg))
    scene = slanted_edge(away, angle, offset_m=offset)
    image: RetinalImage = render(  # type: ignore[call-overload]
        scene,
        eye,
        fov_deg=fov,
        resolution=pixels,
        centre_deg=field,
        wavelengths_nm=grid,
        bands=len(grid),
        progress=False,
        **options,
    )
    check_complete(image)
    return image


def _ideal(front: Wavefront, frequency: np.ndarray, angle: float, model: Model) -> np.ndarray:
    """Transfer of the pupil without aberrations; 1 for the geometric model."""
    if model == "geometric":
        return np.ones_like(frequency)
    flat = dataclasses.replace(front, opd_um=np.where(np.isfinite(front.opd_um), 0.0, np.nan))
    return np.abs(flat.otf().along(frequency, angle))


def _wave(front: Wavefront, frequency: np.ndarray, angle: float, model: Model) -> np.ndarray:
    if model == "geometric":
        return spot_of_wavefront(front).otf(frequency, angle)
    return front.otf().along(frequency, angle)

"""From pinhole views and depth images to stacks of pictures: grids, wavelengths and spectra."""

from __future__ import annotations

import hashlib

import numpy as np

from isetcl.errors import InvalidInputError, check_choice, check_type
from isetcl.eye.model import Eye
from isetcl.psf_baseline.borders import BORDERS, Border
from isetcl.psf_baseline.depth_image import DepthImage
from isetcl.psf_baseline.picture_light import shown, srgb
from isetcl.psf_baseline.picture_stack import HIDDEN, Hidden, PictureStack, Sheet
from isetcl.retina.grid import Centre, RetinalGrid
from isetcl.retina.pinhole_view import PinholeView
from isetcl.scene.basis import SpectralBasis
from isetcl.scene.cube import SpectralCube
from isetcl.scene.display import Display, display_primaries
from isetcl.scene.model import Scene
from isetcl.spectrum import Spectrum, check_wavelengths, default_wavelengths_nm

Source = Scene | PinholeView | DepthImage

DEFAULT_FOV_DEG = 10.0
DEFAULT_RESOLUTION = 256

_SPECTRAL_TOLERANCE = 1e-5


def image_grid(
    source: Source,
    eye: Eye,
    fov_deg: float | tuple[float, float] | None,
    resolution: int | tuple[int, int] | None,
    centre_deg: Centre | None,
) -> RetinalGrid:
    """The pixels of an image; what is None is that of the picture, 10 deg and 256 for a scene.

    Of a picture in perspective it is the largest image about its middle that it fills: its corners
    lie nearer than its width and height in degrees tell.

    Raises
    ------
    InvalidInputError
        If an argument breaks its rule, or the size of a view of one pixel is not given.
    """
    check_type("eye", eye, Eye)
    check_type("scene", source, (Scene, PinholeView, DepthImage))
    if isinstance(source, Scene):
        own_fov: float | tuple[float, float] = DEFAULT_FOV_DEG
        own_resolution: int | tuple[int, int] = DEFAULT_RESOLUTION
        own_centre: Centre = (0.0, 0.0)
    else:
        left, top, (width, height), (rows, columns) = _window(source)
        own_fov, own_resolution = (columns * width, rows * height), (columns, rows)
        own_centre = (left + own_fov[0] / 2.0, top - own_fov[1] / 2.0)
        if isinstance(source, DepthImage):
            own_fov = source.even_fov_deg
    return RetinalGrid.of(
        eye,
        own_fov if fov_deg is None else fov_deg,
        own_resolution if resolution is None else resolution,
        own_centre if centre_deg is None else centre_deg,
    )


def image_wavelengths(source: Source, wavelengths_nm: np.ndarray | None) -> np.ndarray:
    """The wavelengths of an image; None is those of a view, or 400 to 700 nm as far as known.

    Raises
    ------
    InvalidInputError
        If a view or cube is not known at one of them.
    """
    if isinstance(source, PinholeView):
        known = np.asarray(source.radiance["wavelength"].values, dtype=np.float64)
        if wavelengths_nm is None:
            return known
        wanted = check_wavelengths(wavelengths_nm)
        off = np.min(np.abs(wanted[:, None] - known), axis=1)
        if np.any(off > 1e-6):
            raise InvalidInputError(
                f"the pinhole view is not known at {wanted[off > 1e-6].tolist()} nm, only at "
                f"{known.tolist()}; render it with these wavelengths"
            )
        return wanted
    if isinstance(source, DepthImage) and isinstance(source.picture, SpectralCube):
        known = source.picture.wavelengths_nm
        if wavelengths_nm is None:
            usual = default_wavelengths_nm()
            usual = usual[(usual >= known[0]) & (usual <= known[-1])]
            return usual if len(usual) else known
        wanted = check_wavelengths(wavelengths_nm)
        if wanted[0] < known[0] or wanted[-1] > known[-1]:
            raise InvalidInputError(
                f"cube {source.picture.name!r} is known from {known[0]:g} to {known[-1]:g} nm, got "
                f"wavelengths from {wanted[0]:g} to {wanted[-1]:g} nm"
            )
        return wanted
    return check_wavelengths(default_wavelengths_nm() if wavelengths_nm is None else wavelengths_nm)


def picture_stack(
    source: PinholeView | DepthImage,
    wavelengths_nm: np.ndarray,
    border: Border = "reflect",
    hidden: Hidden = "extend",
) -> PictureStack:
    """What PSF methods take their layers from.

    Raises
    ------
    InvalidInputError
        If an option is unknown.
    """
    check_choice("border", border, BORDERS)
    check_choice("hidden", hidden, HIDDEN)
    left, top, pitch, _ = _window(source)
    if isinstance(source, PinholeView):
        spectra, sheets = _of_view(source, wavelengths_nm)
        name = str(source.dataset.attrs.get("scene", "pinhole view"))
        digest = _view_digest(source)
    else:
        spectra, sheets = _of_image(source, wavelengths_nm)
        name, digest = source.name, source.digest()
    basis = SpectralBasis(spectra, np.zeros(len(spectra)), ())
    return PictureStack(
        name=name,
        digest_text=digest,
        left_deg=left,
        top_deg=top,
        pitch_deg=pitch,
        basis=basis,
        sheets=tuple(sheets),
        border=border,
        hidden=hidden,
        camera=source.camera if isinstance(source, DepthImage) else None,
        projection=source.projection if isinstance(source, DepthImage) else "angular",
    )


def _window(
    source: PinholeView | DepthImage,
) -> tuple[float, float, tuple[float, float], tuple[int, int]]:
    """Left and top field angles, pixel width and height, rows and columns."""
    if isinstance(source, DepthImage):
        rows, columns = source.shape
        width, height = source.fov_deg  # type: ignore[misc]
        x, y = source.centre_deg
        return x - width / 2.0, y + height / 2.0, (width / columns, height / rows), (rows, columns)
    x_deg, y_deg = (np.asarray(source.dataset[axis].values, np.float64) for axis in ("x", "y"))
    steps = [
        abs(float(v[-1] - v[0])) / (len(v) - 1) if len(v) > 1 else None for v in (x_deg, y_deg)
    ]
    wide, high = (own if own is not None else other for own, other in (steps, steps[::-1]))
    if wide is None or high is None:
        raise InvalidInputError(
            "a pinhole view of one pixel does not tell how large the pixel is; render more pixels, "
            "or make a DepthImage of it, which has fov_deg"
        )
    shape = len(y_deg), len(x_deg)
    return float(x_deg[0]) - wide / 2.0, float(y_deg[0]) + high / 2.0, (wide, high), shape


def _of_view(view: PinholeView, wavelengths_nm: np.ndarray) -> tuple[np.ndarray, list[Sheet]]:
    data = view.dataset.sel(wavelength=wavelengths_nm, method="nearest")
    radiance = np.asarray(data["radiance"].values)
    if radiance.ndim == 3:
        radiance = radiance[None]
    vergence = np.asarray(data["vergence_dpt"].values, np.float64).reshape(-1, *radiance.shape[2:])
    number = np.asarray(data["object"].values).reshape(vergence.shape)
    if not np.all(np.isfinite(radiance)) or not np.all(np.isfinite(vergence) & (vergence >= 0)):
        raise InvalidInputError(
            "a pinhole view must hold finite radiances and vergences >= 0; render it again"
        )
    # Where there is neither an object nor a background there is nothing to blur.
    covered = (number >= 0) | np.any(radiance > 0, axis=1)
    spectra, colour = _reduced(np.moveaxis(radiance, 1, 0))
    sheets = [
        Sheet(colour[:, k], covered[k].astype(np.float64), vergence[k])
        for k in range(len(vergence))
    ]
    return spectra, sheets


def _of_image(image: DepthImage, wavelengths_nm: np.ndarray) -> tuple[np.ndarray, list[Sheet]]:
    pictures = [sheet.picture for sheet in image.sheets]
    if isinstance(image.picture, SpectralCube):
        cubes = [_cube_at(cube, wavelengths_nm) for cube in pictures]  # type: ignore[arg-type]
        spectra, colour = _reduced(np.stack(cubes, axis=1))
        planes = [colour[:, k] for k in range(len(pictures))]
    else:
        display = image.display
        lights = [shown(picture, display) for picture in pictures]  # type: ignore[arg-type]
        is_grey = all(light.ndim == 2 for light in lights)
        planes = [_channels(light, is_grey) for light in lights]
        spectra = np.stack([s.at(wavelengths_nm) for s in _display_spectra(display, is_grey)])
    sheets = [
        Sheet(plane.astype(np.float32), alpha, vergence)
        for plane, (vergence, alpha) in zip(planes, image.maps, strict=True)
    ]
    return spectra, sheets


def _channels(light: np.ndarray, is_grey: bool) -> np.ndarray:
    """Channels first; grey pictures among coloured ones are white light."""
    if is_grey:
        return light[None]
    return np.moveaxis(np.stack([light] * 3, axis=-1) if light.ndim == 2 else light, -1, 0)


def _display_spectra(display: Display | None, is_grey: bool) -> list[Spectrum]:
    """Spectral radiances of the primaries, or of white alone."""
    if display is None:
        return [srgb().white] if is_grey else list(display_primaries())
    assert display.primaries is not None
    return [display.white] if is_grey else list(display.primaries)


def _cube_at(cube: SpectralCube, wavelengths_nm: np.ndarray) -> np.ndarray:
    """The cube between its own wavelengths, linearly, (wavelengths, rows, columns)."""
    own = cube.wavelengths_nm
    if len(own) == 1:
        return np.moveaxis(cube.values, -1, 0)
    high = np.clip(np.searchsorted(own, wavelengths_nm), 1, len(own) - 1)
    share = (wavelengths_nm - own[high - 1]) / (own[high] - own[high - 1])
    values = cube.values[..., high - 1] * (1.0 - share) + cube.values[..., high] * share
    return np.moveaxis(values, -1, 0)


def _reduced(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Spectra (n, wavelengths) and coefficients (n, ...) of values (wavelengths, ...).

    The fewest principal spectra that leave a hundred thousandth of the root mean square.
    """
    flat = values.reshape(len(values), -1).astype(np.float64)
    power, vectors = np.linalg.eigh(flat @ flat.T)
    left = np.cumsum(np.maximum(power, 0.0))
    rank = max(1, int(np.sum(left > _SPECTRAL_TOLERANCE**2 * left[-1])))
    kept = vectors[:, ::-1][:, :rank].T
    return kept, (kept @ flat).reshape(rank, *values.shape[1:]).astype(np.float32)


def _view_digest(view: PinholeView) -> str:
    found = hashlib.sha256()
    for name in ("radiance", "vergence_dpt", "object"):
        found.update(np.ascontiguousarray(view.dataset[name].values).tobytes())
    return found.hexdigest()[:16]

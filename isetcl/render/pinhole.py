"""A scene as a pinhole in the middle of the entrance pupil sees it: `isetcl.pinhole`."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Literal

import numpy as np

from isetcl import memory
from isetcl.device.layout import Precision
from isetcl.errors import check_count, check_type
from isetcl.eye.model import Eye
from isetcl.render import sobol
from isetcl.render.accumulate import TileAccumulator
from isetcl.render.device_scene import DeviceScene
from isetcl.render.direct import Tile
from isetcl.render.kernel_config import PathConfig
from isetcl.render.paths import PathPipeline
from isetcl.render.plan import DEFAULT_BOUNCES, Plan, plan
from isetcl.render.survey import Survey, survey
from isetcl.retina.grid import Centre, RetinalGrid
from isetcl.retina.pinhole_view import PinholeView
from isetcl.scene.model import Scene
from isetcl.units import MM_PER_M

if TYPE_CHECKING:
    import xarray

MOST_LAYERS = 64
_STEP = {"single": 16 * 2.4e-7, "double": 16 * 4.44e-16}


def pinhole(
    scene: Scene,
    eye: Eye,
    *,
    fov_deg: float | tuple[float, float] = 10.0,
    resolution: int | tuple[int, int] = 256,
    centre_deg: Centre = (0.0, 0.0),
    layers: int | Literal["all"] = 1,
    spp: int = 64,
    wavelengths_nm: np.ndarray | None = None,
    precision: Precision | Literal["auto"] = "auto",
    max_bounces: int = DEFAULT_BOUNCES,
    seed: int = 0,
    device: str | None = None,
) -> PinholeView:
    """Radiance and depth along the chief rays of a retinal image's pixels, sharp.

    Rays of the pixels' centres go through the middle of the entrance pupil, so that the view lies
    on the same grid as `isetcl.render`'s image.

    Parameters
    ----------
    scene, eye, fov_deg, resolution, centre_deg, wavelengths_nm
        As for `isetcl.render`.
    precision, max_bounces, seed, device
        As for `isetcl.render`.
    layers
        Surfaces to follow along each ray: 1 is what is seen, 2 also what is right behind it, ...;
        ``"all"`` peels until no ray meets another surface (at most 64).
    spp
        Samples of scattered light a pixel, layer and band, at least 2; scenes that only send out
        light need no more.

    Returns
    -------
    PinholeView

    Raises
    ------
    InvalidInputError, DeviceError, OutOfMemoryError
        Before any work starts.
    """
    check_type("scene", scene, Scene)
    samples = check_count("spp", spp, 2, 1 << 24)
    seed = check_count("seed", seed, 0, (1 << 63) - 1)
    most = MOST_LAYERS if layers == "all" else check_count("layers", layers, 1, MOST_LAYERS)
    prepared = plan(
        scene,
        eye,
        fov_deg=fov_deg,
        resolution=resolution,
        centre_deg=centre_deg,
        wavelengths_nm=wavelengths_nm,
        precision=precision,
        max_bounces=max_bounces,
        device=device,
        pipeline="paths",
    )
    columns, rows = prepared.grid.resolution
    _check_memory(prepared, 1 if layers == "all" else most)
    assert isinstance(prepared.config, PathConfig)
    prepared = dataclasses.replace(
        prepared,
        config=dataclasses.replace(prepared.config, starts_given=True),
        tile=(columns, rows),
    )
    pipeline = PathPipeline(prepared)
    rays = chief_rays(prepared.grid)
    least = np.zeros(prepared.grid.shape)
    found = []
    for number in range(most):
        met = survey(prepared, pipeline.scene, *rays, least)
        if number > 0 and not np.any(met.object >= 0):
            break
        pipeline.start_from(*rays, least)
        radiance, error = _radiance(prepared, pipeline, samples, seed, number)
        found.append((met, radiance, error))
        step = _STEP[prepared.config.precision]
        beyond = np.where(np.isfinite(met.distance_m), met.distance_m * (1 + step) + 1e-12, 1e30)
        least = np.maximum(least, beyond)
    return PinholeView(_dataset(prepared, rays, found))


def chief_rays(grid: RetinalGrid) -> tuple[np.ndarray, np.ndarray]:
    """Origins (metres) and directions, (rows, columns, 3), of the chief rays of pixel centres."""
    x, y = np.meshgrid(grid.x_deg, grid.y_deg)
    return grid.field_map.entrance_mm(x, y) / MM_PER_M, grid.directions()


def vergence_of(rays: tuple[np.ndarray, np.ndarray], distance_m: np.ndarray) -> np.ndarray:
    """1/(depth along the axis from the cornea), 1/m; 0 where nothing lies ahead."""
    with np.errstate(invalid="ignore"):
        depth = -(rays[0][..., 2] + distance_m * rays[1][..., 2])
    ahead = np.isfinite(depth) & (depth > 0)
    return np.where(ahead, 1.0 / np.where(ahead, depth, 1.0), 0.0)


def surface_variables(
    prepared: Plan, rays: tuple[np.ndarray, np.ndarray], met: Survey
) -> dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]]:
    """The variables of a dataset that describe what the pixels' chief rays met."""
    plane, axes = ("y", "x"), ("axis", "y", "x")
    return {
        "vergence_dpt": (
            plane,
            vergence_of(rays, met.distance_m).astype(np.float32),
            {"units": "m-1", "long_name": "vergence of the nearest object"},
        ),
        "distance_m": (plane, met.distance_m.astype(np.float32), {"units": "m"}),
        "object": (plane, met.object, {"long_name": "number of the object, -1 for none"}),
        "material": (
            plane,
            material_numbers(prepared.scene)[met.object],
            {"long_name": "number of the material, -1 for none; alike materials share one"},
        ),
        "position_m": (axes, np.moveaxis(met.position_m, -1, 0).astype(np.float32), {"units": "m"}),
        "normal": (axes, np.moveaxis(met.normal, -1, 0).astype(np.float32), {}),
        "albedo": (("wavelength", "y", "x"), met.albedo.astype(np.float32), {}),
    }


def look_at(
    prepared: Plan, scene: DeviceScene, *, everything: bool
) -> dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]]:
    """What the pixels of a plan look at: everything of `surface_variables`, or vergence alone."""
    rays = chief_rays(prepared.grid)
    met = survey(prepared, scene, *rays, with_albedo=everything)
    variables = surface_variables(prepared, rays, met)
    return variables if everything else {"vergence_dpt": variables["vergence_dpt"]}


def material_numbers(scene: Scene) -> np.ndarray:
    """Number of each object's material; the last entry, -1, is that of no object."""
    digests = [item.material.digest() for item in scene.objects]
    first = {digest: i for i, digest in enumerate(dict.fromkeys(digests))}
    return np.array([*(first[digest] for digest in digests), -1], dtype=np.int32)


def _check_memory(prepared: Plan, layers: int) -> None:
    columns, rows = prepared.grid.resolution
    per_pixel = len(prepared.wavelengths_nm) * (8 * 4 + 4 * 3 * layers) + 200
    memory.check_memory(
        f"a pinhole view of {columns} x {rows} pixels",
        columns * rows * per_pixel,
        lambda share: f"about {int(columns * share)} x {int(rows * share)} pixels would fit",
    )


def _radiance(
    prepared: Plan, pipeline: PathPipeline, spp: int, seed: int, layer: int
) -> tuple[np.ndarray, np.ndarray]:
    """Spectral radiance and its standard error, (wavelengths, rows, columns)."""
    columns, rows = prepared.grid.resolution
    expansion = (prepared.expansion > 0).astype(np.float64)
    accumulator = TileAccumulator(expansion)
    replicates = max(2, min(8, spp // 32))
    if not prepared.scene.has_reflection:
        spp, replicates = 2, 2
    for replicate in range(replicates):
        count = (spp * (replicate + 1)) // replicates - (spp * replicate) // replicates
        stream = sobol.stream(seed, layer * replicates + replicate)
        accumulator.add(pipeline.sample(Tile(0, 0, columns, rows), count, stream), count)
    return (
        np.tensordot(expansion, accumulator.film(), axes=1),
        accumulator.standard_error(),
    )


def _dataset(
    prepared: Plan,
    rays: tuple[np.ndarray, np.ndarray],
    found: list[tuple[Survey, np.ndarray, np.ndarray]],
) -> xarray.Dataset:
    import xarray

    grid = prepared.grid
    units = {"units": "W m-2 sr-1 nm-1"}
    parts = []
    for met, radiance, error in found:
        spectral = ("wavelength", "y", "x")
        parts.append(
            xarray.Dataset(
                {
                    "radiance": (spectral, radiance.astype(np.float32), units),
                    "standard_error": (spectral, error.astype(np.float32), units),
                }
                | surface_variables(prepared, rays, met),
                coords={
                    "wavelength": ("wavelength", prepared.wavelengths_nm, {"units": "nm"}),
                    "y": ("y", grid.y_deg, {"units": "deg", "long_name": "field angle, up"}),
                    "x": ("x", grid.x_deg, {"units": "deg", "long_name": "field angle, right"}),
                    "axis": ("axis", ["x", "y", "z"]),
                },
            )
        )
    dataset = xarray.concat(parts, dim="layer")
    names = [item.name for item in prepared.scene.objects]
    dataset.attrs |= {"scene": prepared.scene.name, "object_names": names or ["(none)"]}
    return dataset

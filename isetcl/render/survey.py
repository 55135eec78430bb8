"""What single rays meet in a scene, from a device: distances, objects, places, normals, albedos."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from isetcl.device import program
from isetcl.device.layout import real_dtype
from isetcl.render import pack, pack_paths
from isetcl.render.device_scene import DeviceScene
from isetcl.render.kernel_config import PathConfig, path_width
from isetcl.render.plan import Plan

_RAYS_AT_ONCE = 1 << 20


@dataclass(frozen=True, eq=False)
class Survey:
    """What rays (...) met.

    Attributes
    ----------
    distance_m : ndarray, (...)
        Along the ray; infinite where nothing is met.
    object : ndarray of int32, (...)
        Number of the object in the scene; -1 for none.
    position_m, normal : ndarray, (..., 3)
        Place, and shading normal on the side of the ray; 0 where nothing is met.
    albedo : ndarray, (wavelengths, ...)
        Reflectance: of metals along the normal, of clear bodies and lights 0.
    """

    distance_m: np.ndarray
    object: np.ndarray
    position_m: np.ndarray
    normal: np.ndarray
    albedo: np.ndarray


def survey(
    plan: Plan,
    scene: DeviceScene,
    origins_m: np.ndarray,
    directions: np.ndarray,
    least_m: np.ndarray | float = 0.0,
    *,
    with_albedo: bool = True,
) -> Survey:
    """What rays meet beyond a distance.

    Surfaces less than half opaque are looked through; mixed materials are averaged.

    Parameters
    ----------
    plan, scene
        A plan of the path pipeline, and its scene on the device.
    origins_m, directions : ndarray, (..., 3)
        Rays, world frame; directions are unit vectors.
    least_m : ndarray, (...), or float
        Distances beyond which surfaces are looked for.
    with_albedo
        Whether albedos are wanted; they are 0 otherwise.
    """
    shape = directions.shape[:-1]
    n = int(np.prod(shape))
    rays = np.empty((7, n))
    rays[:3] = np.broadcast_to(origins_m, (*shape, 3)).reshape(n, 3).T
    rays[3:6] = directions.reshape(n, 3).T
    rays[6] = np.broadcast_to(least_m, shape).ravel()
    wavelengths = len(plan.wavelengths_nm) if with_albedo else 0
    found = np.empty(n), np.empty(n, np.int32), np.empty((6, n)), np.zeros((wavelengths, n))
    runner = _Runner(plan, scene, with_albedo)
    for start in range(0, n, _RAYS_AT_ONCE):
        part = slice(start, min(n, start + _RAYS_AT_ONCE))
        for first in range(0, max(1, wavelengths), pack_paths.WAVELENGTHS_AT_ONCE):
            distance, item, place = runner.run(rays[:, part], first)
            found[0][part], found[1][part], found[2][:, part] = distance, item, place[:6]
            rows = found[3][first : first + pack_paths.WAVELENGTHS_AT_ONCE]
            rows[:, part] = place[6 : 6 + len(rows)]
    return Survey(
        np.where(found[1] >= 0, found[0], np.inf).reshape(shape),
        found[1].reshape(shape),
        found[2][:3].T.reshape(*shape, 3),
        found[2][3:].T.reshape(*shape, 3),
        found[3].reshape(wavelengths, *shape),
    )


def _what_is_needed(config: PathConfig, with_albedo: bool) -> PathConfig:
    """Features without those that surveys never need, or not without albedos."""
    config = dataclasses.replace(
        config,
        is_fused=False,
        has_lights=False,
        has_light_fields=False,
        has_spots=False,
        has_environment=False,
        has_levels=False,
    )
    if with_albedo:
        return config
    return dataclasses.replace(
        config,
        has_translucent=False,
        has_mirrors=False,
        has_conductors=False,
        has_dielectrics=False,
        has_coated=False,
        combined_depth=0,
        has_pictures=config.has_pictures and config.has_cutouts,
        has_grids=config.has_grids and config.has_cutouts,
    )


class _Runner:
    """The kernel of surveys, built for a plan."""

    def __init__(self, plan: Plan, scene: DeviceScene, with_albedo: bool) -> None:
        config = plan.config
        assert isinstance(config, PathConfig)
        config = _what_is_needed(config, with_albedo)
        self._device, self._scene = plan.device, scene
        self._real = real_dtype(config.precision)
        self._width = path_width(plan.device, config.precision)
        defines = config.path_defines(plan.device) | {"STACK_SIZE": scene.stack_size}
        declarations = pack_paths.declarations() + pack.sobol_declaration()
        source = program.assemble("survey.cl", defines, declarations)
        self._kernel = program.kernel(plan.device, source, "survey")

    def run(self, rays: np.ndarray, first: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Distances, objects and places (10, n) of rays (7, n)."""
        import pyopencl as cl

        n = rays.shape[1]
        step = self._width * self._device.work_group_size
        padded = -(-n // step) * step
        data = np.zeros((7, padded), dtype=self._real)
        data[5] = -1.0
        data[:, :n] = rays
        queue = self._device.queue
        into = self._device.upload(data)
        results = (
            np.empty(padded, self._real),
            np.empty(padded, np.int32),
            np.empty((10, padded), self._real),
        )
        buffers = [self._device.allocate(array.size, array.dtype) for array in results]
        self._kernel.set_args(
            np.int32(padded),
            into,
            *self._scene.surfaces(),
            *self._scene.looks(),
            np.int32(first),
            *buffers,
        )
        group = self._device.work_group_size
        cl.enqueue_nd_range_kernel(queue, self._kernel, (padded // self._width,), (group,))
        for array, buffer in zip(results, buffers, strict=True):
            cl.enqueue_copy(queue, array, buffer)
        distance, item, place = results
        return distance[:n].astype(float), item[:n], place[:, :n].astype(float)

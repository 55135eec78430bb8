"""Rays as they leave an eye, straight from the kernel that starts paths, for tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import isetcl as ic
from isetcl.device import program
from isetcl.device.bending import add_bends
from isetcl.device.elements import declarations as element_declarations
from isetcl.device.elements import pack_eye, travel_order
from isetcl.device.layout import real_dtype
from isetcl.eye.prescription import elements
from isetcl.render import pack, sobol
from isetcl.render.kernel_config import PathConfig
from isetcl.render.plan import plan

PIXELS = 64


@dataclass(frozen=True)
class Leaving:
    """Rays of one retinal point: tangents of their directions, and their light; n rays.

    x, y are slopes in front of the eye, to the right and up; weight sums to 1 with what was lost.
    """

    x: np.ndarray
    y: np.ndarray
    weight: np.ndarray
    position_m: np.ndarray

    def otf(self, frequency_cpd, orientation_deg=0.0):
        """Mean of cos(2 pi f t) over the light, and its standard error if rays were random."""
        turn = np.radians(orientation_deg)
        angle = np.degrees(np.cos(turn) * self.x + np.sin(turn) * self.y)
        waves = [np.cos(2 * np.pi * f * angle) for f in np.atleast_1d(frequency_cpd)]
        value = np.array([self.weight @ w for w in waves])
        spread = np.array([np.std(w) for w in waves]) / np.sqrt(len(angle))
        return value, spread

    def share_within(self, angle_rad):
        """The share of the light within angles of the axis."""
        order = np.argsort(np.hypot(self.x, self.y))
        total = np.cumsum(self.weight[order])
        radius = np.hypot(self.x, self.y)[order]
        return np.concatenate([[0.0], total])[np.searchsorted(radius, angle_rad)]


def empty_scene():
    """Something to plan for."""
    return ic.Scene((), ic.Spectrum.equal_energy(1.0), "empty")


def leave(
    eye,
    wavelength_nm=550.0,
    *,
    samples=1024,
    field_deg=(0.0, 0.0),
    fov_deg=1e-7,
    precision="single",
    seed=0,
    **bends,
):
    """64 x `samples` rays of one retinal point; `bends` are arguments of `isetcl.plan`."""
    import pyopencl as cl

    prepared = plan(
        empty_scene(),
        eye,
        fov_deg=(PIXELS * fov_deg, fov_deg),
        resolution=(PIXELS, 1),
        centre_deg=field_deg,
        wavelengths_nm=np.array([wavelength_nm]),
        precision=precision,
        pipeline="paths",
        **bends,
    )
    config = prepared.config
    assert isinstance(config, PathConfig)
    device = prepared.device
    source = program.assemble(
        "start_paths.cl",
        config.eye_defines(device, config.vector_width),
        element_declarations() + pack.eye_declarations() + pack.sobol_declaration(),
    )
    kernel = program.kernel(device, source, "start_paths")
    sequence = travel_order(elements(eye, wavelength_nm), "scene")
    packed = add_bends(
        pack_eye([sequence], "scene", precision),
        [sequence],
        eye.stop,
        [wavelength_nm],
        diffraction=prepared.bends.diffraction,
        scatter=prepared.bends.scatter,
    )
    camera = pack.pack_camera(prepared.grid, precision)
    camera["tile_width"] = PIXELS
    indices = np.array([(sequence[-1].n_before, sequence[0].n_after)])
    pupils = pack.pack_pupils(prepared.pupils, indices, precision)
    table = pack.pack_planes(prepared.grid, prepared.pupils, camera, pupils, packed)
    real = real_dtype(precision)
    flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
    upload = [
        cl.Buffer(device.context, flags, hostbuf=np.ascontiguousarray(a))
        for a in (camera, pupils, packed.elements, table)
    ]
    slots = PIXELS * samples
    out = [np.empty((k, slots), dtype=real) for k in (3, 3, 1)]
    results = [cl.Buffer(device.context, cl.mem_flags.WRITE_ONLY, a.nbytes) for a in out]
    kernel.set_args(
        *upload[:3],
        np.int32(len(sequence)),
        upload[3],
        np.uint32(0),
        np.uint32(samples),
        np.uint32(sobol.stream(seed, 0)),
        np.int32(PIXELS),
        np.int32(slots),
        *results,
        results[2],
    )
    size = (PIXELS // config.vector_width, 1, samples)
    cl.enqueue_nd_range_kernel(device.queue, kernel, size, (1, 1, 1))
    for array, buffer in zip(out, results, strict=True):
        cl.enqueue_copy(device.queue, array, buffer)
    position, direction, weight = (a.astype(np.float64) for a in out)
    chief = np.median(weight[weight > 0])
    return Leaving(
        direction[0] / -direction[2],
        direction[1] / -direction[2],
        weight[0] / (chief * slots),
        position.T,
    )

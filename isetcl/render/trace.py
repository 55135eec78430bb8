"""Tracing bundles of rays through an eye: `isetcl.trace_rays`."""

from __future__ import annotations

import dataclasses

import numpy as np

from isetcl.device.choose import find_device
from isetcl.device.elements import travel_order
from isetcl.device.eye_features import EyeFeatures
from isetcl.device.layout import Precision
from isetcl.device.tracer import RayTracer
from isetcl.errors import (
    InvalidInputError,
    check_array,
    check_choice,
    check_type,
    check_vectors,
)
from isetcl.eye.model import Eye
from isetcl.eye.prescription import elements
from isetcl.eye.rays import RayBundle, RayStatus
from isetcl.eye.sequential import Towards, normalise_rays


def trace_rays(
    eye: Eye,
    origins_mm: np.ndarray,
    directions: np.ndarray,
    wavelength_nm: np.ndarray | float,
    *,
    towards: Towards = "retina",
    precision: Precision = "double",
    record_hits: bool = True,
    device: str | None = None,
) -> RayBundle:
    """Rays traced through an eye on an OpenCL device.

    A ray is a line: it is carried to the eye in float64 before anything is rounded, so an origin
    a kilometre away costs no accuracy.

    Parameters
    ----------
    eye
        The eye.
    origins_mm
        Start points, (n, 3) or (3,), mm, eye frame.
    directions
        Directions, (n, 3) or (3,), any non-zero length; one direction serves all rays.
    wavelength_nm
        Wavelength in nm, one or (n,).
    towards
        ``"retina"``: onto the retina. ``"scene"``: from the vitreous out of the cornea; the
        end points are on the cornea.
    precision
        ``"double"`` (positions to 1e-11 mm, 1e-9 mm through lenses with a gradient index) or
        ``"single"`` (to 1e-5 mm; no optical path lengths).
    record_hits
        Keep the hits on every element.
    device
        See `find_device`.

    Returns
    -------
    RayBundle
        End points, directions, status, and hits per element.

    Raises
    ------
    InvalidInputError
        If shapes do not fit or a wavelength lies outside the range of a medium.
    DeviceError
        If there is no device, or it lacks float64.
    """
    check_type("eye", eye, Eye)
    check_choice("towards", towards, ("retina", "scene"))
    check_type("record_hits", record_hits, bool)
    check_choice("precision", precision, ("single", "double"))
    origins, unit, bad = _prepare(origins_mm, directions)
    wavelengths = _wavelength_per_ray(wavelength_nm, len(origins))
    sequences = {w: travel_order(elements(eye, w), towards) for w in np.unique(wavelengths)}
    # Carry every ray to its point of closest approach to the corneal vertex.
    approach = -np.einsum("ij,ij->i", origins, unit)
    start = origins + approach[:, None] * unit
    tracer = RayTracer(
        find_device(device),
        precision,
        record_hits=record_hits,
        record_opl=precision == "double",
        shared_direction=len(unit) > 1 and bool(np.all(unit == unit[0])),
        features=EyeFeatures.of(sequences.values()),
    )
    parts = []
    for wavelength, sequence in sequences.items():
        chosen = np.flatnonzero(wavelengths == wavelength)
        trace = tracer.prepare(tracer.upload(start[chosen], unit[chosen]), sequence, towards)
        trace.run()
        bundle = trace.fetch()
        if bundle.opl_mm is not None:
            index = sequence[0].n_before if towards == "retina" else sequence[0].n_after
            bundle = dataclasses.replace(bundle, opl_mm=bundle.opl_mm + index * approach[chosen])
        parts.append((chosen, bundle))
    return _mark_invalid(_merge(parts, len(origins)), bad)


def _prepare(
    origins_mm: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Origins and unit directions of equal length, and which rays are unusable."""
    origins = check_vectors("origins_mm", origins_mm)
    pointing = check_vectors("directions", directions)
    if len(origins) != len(pointing) and 1 not in (len(origins), len(pointing)):
        raise InvalidInputError(
            "origins_mm and directions must have the same number of rows (or one), got "
            f"{len(origins)} and {len(pointing)}"
        )
    if 0 in (len(origins), len(pointing)):
        raise InvalidInputError("origins_mm and directions must have at least one row, got none")
    return normalise_rays(*np.broadcast_arrays(origins, pointing))


def _wavelength_per_ray(wavelength_nm: np.ndarray | float, count: int) -> np.ndarray:
    wavelengths = check_array("wavelength_nm", wavelength_nm)
    if wavelengths.ndim > 1 or wavelengths.size not in (1, count):
        raise InvalidInputError(
            f"wavelength_nm must be one number or one per ray ({count}), "
            f"got shape {wavelengths.shape}"
        )
    return np.broadcast_to(wavelengths, (count,))


def _merge(parts: list[tuple[np.ndarray, RayBundle]], count: int) -> RayBundle:
    """One bundle in the order of the input from bundles of chosen rays."""
    if len(parts) == 1:
        return parts[0][1]

    whole: dict[str, np.ndarray] = {}
    for name in ("positions_mm", "directions", "status", "surface", "opl_mm", "hits_mm"):
        sample = getattr(parts[0][1], name)
        if sample is None:
            continue
        # Rays are the first axis, except of the hits, where elements are.
        is_hits = name == "hits_mm"
        shape = (len(sample), count, 3) if is_hits else (count, *sample.shape[1:])
        whole[name] = np.empty(shape, dtype=sample.dtype)
        for chosen, bundle in parts:
            rays = (slice(None), chosen) if is_hits else chosen
            whole[name][rays] = getattr(bundle, name)
    return dataclasses.replace(parts[0][1], **whole)  # type: ignore[arg-type]


def _mark_invalid(bundle: RayBundle, bad: np.ndarray) -> RayBundle:
    """The bundle with the status INVALID for rays that could not be used."""
    if not bad.any():
        return bundle
    return dataclasses.replace(
        bundle,
        status=np.where(bad, np.uint8(RayStatus.INVALID), bundle.status),
        surface=np.where(bad, np.int32(-1), bundle.surface),
    )

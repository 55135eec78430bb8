"""Diffraction and scatter as the kernels read them: numbers in the eye's table."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from enum import IntEnum

import numpy as np

from isetcl.device.elements import PackedEye
from isetcl.eye.bending.airy import TABLE_SIZE
from isetcl.eye.bending.ray_bending import Diffraction, radial_table, to_disc
from isetcl.eye.people.scatter import ScatterModel
from isetcl.eye.prescription import Element, ElementKind
from isetcl.eye.stop import Stop

SCATTER_NODES = 4096


class Bend(IntEnum):
    """Where the numbers of a stop and band lie. Tables are counted from there."""

    SCALE = 0
    CENTRE_X = 1
    CENTRE_Y = 2
    XX = 3
    XY = 4
    YX = 5
    YY = 6
    STEPS = 7
    TABLE = 8
    FRACTION = 9
    SCATTER_TABLE = 10


def declarations() -> str:
    """The C declarations of the numbers' places and the tables' sizes."""
    places = "".join(f"#define BEND_{place.name} {place.value}\n" for place in Bend)
    return f"{places}#define AIRY_NODES {TABLE_SIZE}\n#define SCATTER_NODES {SCATTER_NODES}\n"


def add_bends(
    packed: PackedEye,
    sequences: Sequence[tuple[Element, ...]],
    stop: Stop,
    wavelengths_nm: Sequence[float],
    *,
    diffraction: Diffraction | None,
    scatter: ScatterModel | None,
) -> PackedEye:
    """The packed eye with what bends rays at its stop; the same eye where nothing does.

    Parameters
    ----------
    sequences, wavelengths_nm
        Elements in the order the rays meet them, and the wavelength in vacuum, for each band.
    """
    if diffraction is None and scatter is None:
        return packed
    dtype = packed.table.dtype
    steps, airy = (0.0, np.zeros(0)) if diffraction is None else radial_table(diffraction)
    veil = np.zeros(0) if scatter is None else half_tangents(scatter)
    records = packed.elements.copy()
    first = len(packed.table)
    tables = first + len(Bend) * len(sequences)
    blocks = np.zeros((len(sequences), len(Bend)))
    at = 0
    for i, (sequence, wavelength) in enumerate(zip(sequences, wavelengths_nm, strict=True)):
        begin = first + i * len(Bend)
        for k, element in enumerate(sequence):
            if element.kind is ElementKind.STOP:
                records["bend"][at + k] = begin
                if diffraction is not None:
                    blocks[i, Bend.SCALE] = diffraction.scale_mm(wavelength, element.n_before)
        at += len(sequence)
        blocks[i, Bend.CENTRE_X : Bend.CENTRE_Y + 1] = stop.decentre_mm
        blocks[i, Bend.XX : Bend.YY + 1] = to_disc(stop).ravel()
        blocks[i, Bend.STEPS] = steps
        blocks[i, Bend.TABLE] = tables - begin
        blocks[i, Bend.FRACTION] = 0.0 if scatter is None else scatter.fraction
        blocks[i, Bend.SCATTER_TABLE] = tables + len(airy) - begin
    more = np.concatenate([blocks.ravel(), airy, veil]).astype(dtype)
    return dataclasses.replace(packed, elements=records, table=np.concatenate([packed.table, more]))


def half_tangents(scatter: ScatterModel) -> np.ndarray:
    """tan(angle / 2) at even steps of the share of scattered light that is turned less."""
    share = np.linspace(0.0, 1.0, SCATTER_NODES)
    share[-1] = np.nextafter(1.0, 0.0)
    return np.asarray(np.tan(np.radians(scatter.angle_of(share)) / 2.0))

"""Other eyes made from an eye, as methods of `Eye`: changed in a part, or read from a file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from isetcl.eye.pictures.methods import EyePictures

if TYPE_CHECKING:
    from pathlib import Path

    from isetcl.eye.changes import ChamberStart, EyeChange, ShiftHold
    from isetcl.eye.model import Eye, PupilPlane

_REFERENCE_NM = 550.0


class EyeVariants(EyePictures):
    """Methods of `Eye` that return another eye, and what writes it."""

    def changed(self, change: EyeChange) -> Eye:
        """The eye with a change, in every state of accommodation.

        Parameters
        ----------
        change
            A lens in front of the eye or in it (`SpectacleLens`, `ContactLens`, `IntraocularLens`),
            an `ArtificialPupil`, or anything else with a method `apply` from one eye to another.
        """
        from isetcl.eye import changes

        return changes.altered(self._as_eye(), change)

    def with_fovea(self, fovea_deg: tuple[float, float]) -> Eye:
        """The eye with its fovea where the field angles (x, y) are seen, degrees."""
        from isetcl.eye import changes

        return changes.altered(self._as_eye(), changes.FoveaChange(fovea_deg))

    def with_pupil(
        self,
        diameter_mm: float,
        plane: PupilPlane = "stop",
        *,
        decentre_mm: tuple[float, float] | None = None,
        aspect: float | None = None,
        axis_deg: float | None = None,
    ) -> Eye:
        """The eye with another pupil, in every state of accommodation.

        Parameters
        ----------
        diameter_mm
            Diameter, mm; of an elliptical stop the longer one.
        plane
            ``"stop"`` (the iris) or ``"entrance"`` (what a clinician measures; paraxial at 550 nm).
        decentre_mm
            Middle of the stop (x, y), mm; None leaves it.
        aspect
            Shorter diameter over the longer one, 1 for a circle; None leaves it.
        axis_deg
            Direction of the longer diameter, degrees from +x towards +y; None leaves it.
        """
        from isetcl.eye import changes
        from isetcl.eye.models import parts as build

        pupil = build.PupilSpec(diameter_mm, plane, decentre_mm, aspect, axis_deg)
        return changes.altered(self._as_eye(), pupil)

    def with_axial_length(self, axial_length_mm: float) -> Eye:
        """The eye with its retina moved so that it is this long, mm.

        An eye that accommodates can still do so: the whole family becomes longer by the same
        length. The shape of the retina stays.

        Raises
        ------
        InvalidInputError
            If the retina would lie inside the lens.
        """
        from isetcl.eye import changes

        return changes.with_axial_length(self._as_eye(), axial_length_mm)

    def with_anterior_chamber_depth(
        self,
        depth_mm: float,
        *,
        measured_from: ChamberStart = "epithelium",
        hold: ShiftHold = "axial_length",
    ) -> Eye:
        """The eye with its lens, and the stop before it, moved to this depth, mm.

        In an eye that accommodates the lens is moved by the same length in every state.

        Parameters
        ----------
        depth_mm
            From the cornea to the vertex of the lens, in the present state of accommodation.
        measured_from
            ``"epithelium"`` (front of the cornea) or ``"endothelium"`` (its back).
        hold
            What stays: ``"axial_length"`` or ``"vitreous_depth"`` (the retina moves too).

        Raises
        ------
        InvalidInputError
            If the lens would touch the cornea or the retina, or the cornea has one surface and the
            depth is to be measured from its back.
        """
        from isetcl.eye import changes

        return changes.with_anterior_chamber_depth(
            self._as_eye(), depth_mm, measured_from=measured_from, hold=hold
        )

    def with_cornea(
        self,
        *,
        front_radius_mm: float | None = None,
        back_radius_mm: float | None = None,
        front_conic: float | None = None,
        back_conic: float | None = None,
    ) -> Eye:
        """The eye with other radii, mm, or conic constants of its cornea; None leaves a number.

        A surface that would end inside its semi-diameter gets a smaller one.

        Raises
        ------
        InvalidInputError
            If a radius is 0, the cornea has no back surface or is no conic of revolution, or its
            surfaces cross.
        """
        from isetcl.eye import changes

        change = changes.CorneaChange(front_radius_mm, back_radius_mm, front_conic, back_conic)
        return changes.with_cornea(self._as_eye(), change)

    def with_spectacle_refraction(
        self,
        refraction_dpt: float,
        *,
        vertex_distance_mm: float = 12.0,
        wavelength_nm: float = _REFERENCE_NM,
    ) -> Eye:
        """The eye made longer or shorter so that a thin spectacle lens of this power corrects it.

        The retina is moved to where the far point of that lens is imaged by the relaxed eye, by
        paraxial rays. Real rays of a wide pupil focus somewhat nearer.

        Parameters
        ----------
        refraction_dpt
            Power of the lens, dpt; negative for myopia.
        vertex_distance_mm
            From the lens to the cornea, mm; 0 is the refraction at the cornea.
        wavelength_nm
            Wavelength in focus, nm.

        Raises
        ------
        InvalidInputError
            If no length of the eye gives that refraction.
        """
        from isetcl.eye import changes

        return changes.with_spectacle_refraction(
            self._as_eye(),
            refraction_dpt,
            vertex_distance_mm=vertex_distance_mm,
            wavelength_nm=wavelength_nm,
        )

    def to_json(self, path: str | Path | None = None) -> str:
        """The eye as JSON text, with every digit; `from_json` makes the same eye of it.

        Parameters
        ----------
        path
            A file to write too; None writes none.

        Raises
        ------
        InvalidInputError
            If the eye holds a medium, shape or accommodation model of the user's own making.
        FileError
            If the file cannot be written.
        """
        from isetcl.eye.files import json_file

        return json_file.eye_to_json(self._as_eye(), path)

    @staticmethod
    def from_json(source: str | Path) -> Eye:
        """The eye of a file that `to_json` wrote, or of its text (which begins with a brace).

        Raises
        ------
        FileError
            If the file is missing or breaks the format; the message names the place in it.
        """
        from isetcl.eye.files import json_file

        return json_file.eye_from_json(source)

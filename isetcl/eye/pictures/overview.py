"""All pictures of an eye: each by its name, and together on one page."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from isetcl.errors import IsetclError, check_choice, check_vectors
from isetcl.eye.aberrations.geometric import FEWEST_RINGS
from isetcl.eye.model import REFERENCE_WAVELENGTH_NM, Eye
from isetcl.eye.pictures import wave_pictures
from isetcl.eye.pictures.picture_parts import field_name, figure_or_new

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from isetcl.eye.pictures.picture_parts import AnyFigure

_FRAUNHOFER_NM = (486.1, 656.3)
_DECADES = 4.0
_NARROW, _WIDE = 40, 90  # letters of a line

_SIZES_IN = {
    "section": (7.0, 5.4),
    "spots": (0.0, 5.0),
    "fans": (8.0, 6.0),
    "wavefront": (0.0, 3.6),
    "zernikes": (6.4, 4.8),
    "psf": (0.0, 3.6),
    "psf_log": (0.0, 3.6),
    "mtf": (7.0, 5.0),
    "through_focus": (7.0, 5.0),
    "lca": (7.0, 5.0),
    "field_curvature": (7.0, 5.0),
}
"""Names and sizes of pictures of their own; width 0 is for one that has a panel for each field."""

_PANEL_IN = 3.8

_PAGE: tuple[tuple[float, tuple[tuple[str, float], ...]], ...] = (
    (1.1, (("section", 1.0), ("mtf", 1.0), ("through_focus", 1.0))),
    (1.2, (("spots", 1.9), ("fans", 1.1))),
    (1.0, (("wavefront", 2.0), ("zernikes", 1.0))),
    (1.0, (("psf", 2.0), ("lca", 1.0))),
    (1.0, (("psf_log", 2.0), ("field_curvature", 1.0))),
)
"""Rows of the page: their heights, and the names of their pictures with their widths."""

PAGE_IN = (17.0, 21.0)
"""Width and height of the page, inches."""


@dataclass(frozen=True)
class Overview:
    """The pictures of an eye for objects at a distance.

    Parameters
    ----------
    eye
        The eye.
    fields_deg
        Field angles upwards, degrees.
    wavelength_nm
        Wavelength of what is drawn in one wavelength, nm. Rays are drawn in blue and red as well,
        as far as the media are defined there.
    object_distance_m
        Distance of the object from the corneal vertex, m.
    """

    eye: Eye
    fields_deg: tuple[float, ...] = (0.0, 5.0, 10.0)
    wavelength_nm: float = REFERENCE_WAVELENGTH_NM
    object_distance_m: float = math.inf

    def __post_init__(self) -> None:
        fields = check_vectors("fields_deg", [list(self.fields_deg)], width=len(self.fields_deg))
        object.__setattr__(self, "fields_deg", tuple(float(f) for f in fields[0]))

    @staticmethod
    def names() -> tuple[str, ...]:
        """Names of all pictures."""
        return tuple(_SIZES_IN)

    def size_in(self, name: str) -> tuple[float, float]:
        """Width and height of a picture of its own, inches."""
        width, height = _SIZES_IN[check_choice("picture", name, _SIZES_IN)]
        return width or 0.6 + _PANEL_IN * max(len(self.fields_deg), 1.4), height

    def draw(self, name: str, figure: AnyFigure | None = None) -> AnyFigure:
        """One picture; returns its figure.

        Raises
        ------
        InvalidInputError
            If the name is unknown, or the eye does not allow the picture.
        """
        size = self.size_in(name)
        chosen = figure_or_new(figure, *size)
        getattr(self, f"_{name}")(chosen)
        return chosen

    def draw_or_say(self, name: str, figure: AnyFigure) -> str | None:
        """Draw it; where the eye does not allow it, write the reason instead and return it."""
        try:
            self.draw(name, figure)
        except IsetclError as error:
            reason = f"{name}: {error}"
            _say(reason, figure)
            return reason
        return None

    def page(self, figure: AnyFigure | None = None) -> AnyFigure:
        """All pictures on one page; returns its figure."""
        chosen = figure_or_new(figure, *PAGE_IN)
        heights = [height for height, _ in _PAGE]
        rows = chosen.subfigures(len(_PAGE), 1, squeeze=False, height_ratios=heights)
        for row, (_, cells) in zip(rows[:, 0], _PAGE, strict=True):
            widths = [width for _, width in cells]
            parts = row.subfigures(1, len(cells), squeeze=False, width_ratios=widths)
            for part, (name, _) in zip(parts[0], cells, strict=True):
                self.draw_or_say(name, part)
        return chosen

    @property
    def _colours_nm(self) -> list[float]:
        low, high = self.eye.wavelength_range_nm()
        others = {w for w in _FRAUNHOFER_NM if low <= w <= high}
        return sorted({self.wavelength_nm, *others})

    def _section(self, figure: AnyFigure) -> None:
        self.eye.plot(
            figure.subplots(),
            fields_deg=self.fields_deg,
            wavelength_nm=self.wavelength_nm,
            object_distance_m=self.object_distance_m,
        )

    def _spots(self, figure: AnyFigure) -> None:
        def spot(field: float) -> None:
            for wavelength in self._colours_nm:
                self.eye.spot(
                    field, wavelength, object_distance_m=self.object_distance_m, rings=FEWEST_RINGS
                )

        self.eye.plot_spots(
            self._usable(spot, figure),
            self._colours_nm,
            figure,
            reference_nm=self.wavelength_nm,
            object_distance_m=self.object_distance_m,
        )

    def _fans(self, figure: AnyFigure) -> None:
        ends = dict.fromkeys((self.fields_deg[0], self.fields_deg[-1]))
        self.eye.plot_fan(
            tuple(ends),
            self._colours_nm,
            figure,
            reference_nm=self.wavelength_nm,
            object_distance_m=self.object_distance_m,
        )

    def _wavefront(self, figure: AnyFigure) -> None:
        def draw(field: float, part: AnyFigure) -> None:
            self.eye.plot_opd(
                field,
                self.wavelength_nm,
                part,
                zernike_order=None,
                object_distance_m=self.object_distance_m,
            )

        self._each(figure, draw)

    def _zernikes(self, figure: AnyFigure) -> None:
        field = self.fields_deg[-1]
        front = self.eye.wavefront(
            field, self.wavelength_nm, object_distance_m=self.object_distance_m
        )
        _named(wave_pictures.draw_zernikes(front.zernike(4), figure.subplots()), field)

    def _psf(self, figure: AnyFigure, decades: float | None = None) -> None:
        def draw(field: float, part: AnyFigure) -> None:
            ax = self.eye.plot_psf(
                field,
                self.wavelength_nm,
                part.subplots(),
                decades=decades,
                object_distance_m=self.object_distance_m,
            )
            _named(ax, field)

        self._each(figure, draw)

    def _psf_log(self, figure: AnyFigure) -> None:
        self._psf(figure, _DECADES)

    def _mtf(self, figure: AnyFigure) -> None:
        def sampled(field: float) -> None:
            self.eye.wavefront(
                field, self.wavelength_nm, object_distance_m=self.object_distance_m
            ).check_sampling()

        self.eye.plot_mtf(
            self._usable(sampled, figure),
            self.wavelength_nm,
            figure.subplots(),
            object_distance_m=self.object_distance_m,
        )

    def _through_focus(self, figure: AnyFigure) -> None:
        self.eye.plot_through_focus(
            None, "strehl", figure.subplots(), wavelength_nm=self.wavelength_nm
        )

    def _lca(self, figure: AnyFigure) -> None:
        self.eye.plot_lca(None, figure.subplots())

    def _field_curvature(self, figure: AnyFigure) -> None:
        self.eye.plot_oblique_foci(None, figure.subplots(), wavelength_nm=self.wavelength_nm)

    def _each(self, figure: AnyFigure, draw: Callable[[float, AnyFigure], None]) -> None:
        """A panel for each field angle, side by side; refused ones say why."""
        parts = figure.subfigures(1, len(self.fields_deg), squeeze=False)[0]
        for field, part in zip(self.fields_deg, parts, strict=True):
            try:
                draw(field, part)
            except IsetclError as error:
                _say(f"{field_name(field)}: {error}", part)

    def _usable(self, attempt: Callable[[float], None], figure: AnyFigure) -> list[float]:
        """Field angles that the eye allows; the others are named above the picture.

        Raises
        ------
        InvalidInputError
            If none is.
        """
        usable: list[float] = []
        refused: list[str] = []
        for field in self.fields_deg:
            try:
                attempt(field)
            except IsetclError as error:
                if not usable and field == self.fields_deg[-1]:
                    raise
                refused.append(f"{field_name(field)}: {error}")
            else:
                usable.append(field)
        if refused:
            text = "\n".join(_folded(reason, _WIDE) for reason in refused)
            figure.suptitle(f"left out: {text}", fontsize="x-small")
        return usable


def _say(text: str, figure: AnyFigure) -> None:
    """A reason instead of a picture."""
    figure.clear()
    ax = figure.subplots()
    ax.set_axis_off()
    ax.text(0.5, 0.5, _folded(text, _NARROW), ha="center", va="center", fontsize="small")


def _named(ax: Axes, field_deg: float) -> None:
    ax.set_title(f"{field_name(field_deg)}: {ax.get_title()}", fontsize="medium")


def _folded(text: str, width: int) -> str:
    import textwrap

    return "\n".join(textwrap.wrap(text, width))

"""The figures there are, by their number in the paper."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from isetcl.errors import InvalidInputError, check_type
from isetcl.figures import (
    accommodation,
    cone_excitations,
    depth_of_field,
    lens_transmittance,
    longitudinal_chromatic,
    mtf_comparison,
    mtf_of_three_eyes,
    occlusion,
    pupil_size,
    three_eyes,
    transverse_chromatic,
)
from isetcl.figures.quality import Quality
from isetcl.figures.result import FigureResult
from isetcl.output import check_folder

_MODULES = (
    lens_transmittance,
    mtf_comparison,
    three_eyes,
    mtf_of_three_eyes,
    pupil_size,
    depth_of_field,
    accommodation,
    longitudinal_chromatic,
    transverse_chromatic,
    cone_excitations,
    occlusion,
)


@dataclass(frozen=True)
class PaperFigure:
    """A figure of the paper.

    Attributes
    ----------
    number, title
        Which one it is.
    draw
        Draws it into a folder.
    """

    number: int
    title: str
    draw: Callable[[Path, Quality], FigureResult]


FIGURES = {
    module.NUMBER: PaperFigure(module.NUMBER, module.TITLE, module.draw) for module in _MODULES
}
"""All figures of Lian et al. 2019 that show a result: 2 to 12."""


def figures_of(numbers: Iterable[int]) -> tuple[PaperFigure, ...]:
    """The figures of some numbers, each once, in their order; all of them for no number.

    Raises
    ------
    InvalidInputError
        If there is no figure of a number; the message lists those there are.
    """
    wanted = tuple(dict.fromkeys(numbers))
    for number in wanted:
        if number not in FIGURES:
            listed = ", ".join(f"{n} ({figure.title})" for n, figure in FIGURES.items())
            raise InvalidInputError(f"there is no figure {number} to draw; known are: {listed}")
    return tuple(FIGURES[number] for number in wanted) or tuple(FIGURES.values())


def draw_figure(
    number: int, folder: str | Path = "isetcl-figures", quality: Quality | None = None
) -> FigureResult:
    """Draw one figure of the paper; writes a PNG and a JSON file.

    Parameters
    ----------
    number
        2 to 12.
    folder
        Where the files go; it is made if it does not exist.
    quality
        None is the default quality on the default device.

    Raises
    ------
    InvalidInputError
        If there is no such figure.
    FileError
        If the folder cannot be written.
    """
    (figure,) = figures_of([number])
    how = Quality() if quality is None else quality
    check_type("quality", how, Quality)
    where = Path(folder)
    check_folder(where)
    return figure.draw(where, how)

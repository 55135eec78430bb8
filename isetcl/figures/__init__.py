"""The figures of Lian et al. (2019), computed by isetcl, each beside the numbers of the paper."""

from isetcl.figures.quality import Quality
from isetcl.figures.registry import FIGURES, PaperFigure, draw_figure, figures_of
from isetcl.figures.result import FigureResult, Row

__all__ = [
    "FIGURES",
    "FigureResult",
    "PaperFigure",
    "Quality",
    "Row",
    "draw_figure",
    "figures_of",
]

"""The figures of Lian et al. (2019), computed by isetcl, each beside the numbers of the paper."""

from isetcl.figures.quality import Quality
from isetcl.figures.registry import FIGURES, Figure, draw_figure, figure_of
from isetcl.figures.result import FigureResult, Row

__all__ = ["FIGURES", "Figure", "FigureResult", "Quality", "Row", "draw_figure", "figure_of"]

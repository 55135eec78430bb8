"""What a figure found, number by number beside the paper's, as text and JSON."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from isetcl.errors import InvalidInputError, check_choice
from isetcl.version import __version__

Verdict = Literal["agrees", "differs, explained", "differs"]
VERDICTS = ("agrees", "differs, explained", "differs")


@dataclass(frozen=True)
class Row:
    """One quantity of a figure.

    Parameters
    ----------
    quantity
        What it is, or what the paper says of it.
    isetcl
        What isetcl finds.
    paper
        What the paper prints; for what it prints nothing of, the value of `source`.
    source
        Where that stands: a caption or section of the paper, or another source.
    verdict
        ``"agrees"``; ``"differs, explained"``, with the reason; or ``"differs"``, without one.
    reason
        Why the two differ, or what the agreement rests on.

    Raises
    ------
    InvalidInputError
        If the verdict is unknown, or an explained difference has no reason.
    """

    quantity: str
    isetcl: str
    paper: str
    source: str
    verdict: Verdict
    reason: str = ""

    def __post_init__(self) -> None:
        check_choice("verdict", self.verdict, VERDICTS)
        if self.verdict == "differs, explained" and not self.reason:
            raise InvalidInputError(
                f"row {self.quantity!r}: a difference that is explained must have a reason"
            )


@dataclass(frozen=True)
class FigureResult:
    """A figure that was drawn.

    Parameters
    ----------
    number, title
        Which figure of the paper it is.
    files
        What was written, the picture first.
    rows
        isetcl's numbers beside the paper's.
    numbers
        All numbers behind the picture, for JSON.
    """

    number: int
    title: str
    files: tuple[Path, ...]
    rows: tuple[Row, ...]
    numbers: Mapping[str, Any] = field(default_factory=dict)

    @property
    def unexplained(self) -> tuple[Row, ...]:
        """Rows that differ from the paper without a known reason."""
        return tuple(row for row in self.rows if row.verdict == "differs")


def near(
    quantity: str,
    found: float,
    expected: float,
    tolerance: float,
    source: str,
    *,
    unit: str = "",
    known: str = "",
    digits: int = 3,
) -> Row:
    """A number that must lie within `tolerance` of the expected one.

    `known` explains a difference: it is shown where the numbers differ.
    """
    text = f"{_number(expected, digits)} ± {_number(tolerance, 2)}{_unit(unit)}"
    shown = f"{_number(found, digits)}{_unit(unit)}"
    return _judged(quantity, shown, text, source, abs(found - expected) <= tolerance, known)


def between(
    quantity: str,
    found: float,
    low: float,
    high: float,
    source: str,
    *,
    unit: str = "",
    known: str = "",
    digits: int = 3,
) -> Row:
    """A number that must lie in a range; see `near`."""
    text = f"{_number(low, digits)} to {_number(high, digits)}{_unit(unit)}"
    shown = f"{_number(found, digits)}{_unit(unit)}"
    return _judged(quantity, shown, text, source, low <= found <= high, known)


def states(
    quantity: str, evidence: str, paper: str, source: str, is_so: bool, *, known: str = ""
) -> Row:
    """A statement of the paper in words, with isetcl's evidence for or against it; see `near`."""
    return _judged(quantity, evidence, paper, source, is_so, known)


def _judged(quantity: str, found: str, paper: str, source: str, agrees: bool, known: str) -> Row:
    if agrees:
        return Row(quantity, found, paper, source, "agrees")
    verdict: Verdict = "differs, explained" if known else "differs"
    return Row(quantity, found, paper, source, verdict, known)


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}g}"


def _unit(unit: str) -> str:
    return f" {unit}" if unit else ""


def write_json(
    path: Path,
    number: int,
    title: str,
    quality_name: str,
    rows: tuple[Row, ...],
    numbers: Mapping[str, Any],
) -> Path:
    """Write what a figure found; returns the path.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    from isetcl.output import write_file

    record = {
        "figure": number,
        "title": title,
        "paper": "Lian, MacKenzie, Brainard, Cottaris & Wandell 2019, J Vision 19(12):23",
        "quality": quality_name,
        "isetcl": __version__,
        "python": platform.python_version(),
        "rows": [asdict(row) for row in rows],
        "numbers": dict(numbers),
    }
    text = json.dumps(record, indent=1, default=_plain, allow_nan=False)
    return write_file(path, text.encode())


def _plain(value: Any) -> Any:
    """Arrays and numpy numbers as what JSON knows."""
    return value.tolist()

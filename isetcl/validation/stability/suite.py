"""Running the stability suite on devices, and its tables."""

from __future__ import annotations

import datetime
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from isetcl.device.choose import find_device
from isetcl.device.devices import list_devices
from isetcl.device.layout import Precision
from isetcl.errors import InvalidInputError, check_choice
from isetcl.validation.stability.case import Bench, Case, Outcome, cases
from isetcl.version import __version__

PRECISIONS: tuple[Precision, ...] = ("single", "double")


@dataclass(frozen=True)
class Report:
    """The outcomes on one device.

    Attributes
    ----------
    device
        `Device.describe`.
    outcomes
        Case by case, in single and double precision as far as they were run.
    """

    device: dict[str, str]
    outcomes: tuple[Outcome, ...]

    @property
    def failures(self) -> tuple[Outcome, ...]:
        """Outcomes that must not be."""
        return tuple(o for o in self.outcomes if o.failed)

    def record(self) -> dict[str, Any]:
        """Everything as plain values, for JSON."""
        rows = [
            {
                "number": o.case.number,
                "title": o.case.title,
                "expected": o.case.expected,
                "unit": o.case.unit,
                "precision": o.precision,
                "measured": None if math.isnan(o.value) else _plain(o.value),
                "tolerance": o.case.tolerance(o.precision),
                "verdict": o.verdict,
                "note": o.note,
                "seconds": round(o.seconds, 3),
            }
            for o in self.outcomes
        ]
        return {"version": __version__, "device": self.device, "cases": rows}


def _plain(value: float) -> float | str:
    """JSON has no infinity."""
    return value if math.isfinite(value) else "infinite"


def run(
    device: str | None = None,
    precision: Precision | None = None,
    *,
    numbers: Iterable[int] | None = None,
    full: bool = False,
    on_outcome: Callable[[str, Outcome], None] | None = None,
) -> tuple[Report, ...]:
    """The suite on every device present, or on one.

    Parameters
    ----------
    device
        See `find_device`; None runs on all.
    precision
        None runs both, as far as a device has float64.
    numbers
        Cases to run; None runs all.
    full
        Do not scale down the longest cases.
    on_outcome
        Called with the name of the device after every case.

    Raises
    ------
    InvalidInputError
        If a number is no case.
    DeviceError
        If there is no device.
    """
    if precision is not None:
        check_choice("precision", precision, PRECISIONS)
    chosen = _chosen(numbers)
    # Without a device this says how to get one.
    targets = (find_device(device),) if device is not None or not list_devices() else list_devices()
    reports = []
    for target in targets:
        outcomes = []
        for each in PRECISIONS if precision is None else (precision,):
            if each == "double" and not target.has_double:
                continue
            bench = Bench(target, each, full)
            for case in chosen:
                outcome = case.run(bench)
                outcomes.append(outcome)
                if on_outcome is not None:
                    on_outcome(target.name, outcome)
        reports.append(Report(target.describe(), tuple(outcomes)))
    return tuple(reports)


def _chosen(numbers: Iterable[int] | None) -> tuple[Case, ...]:
    known = {case.number: case for case in cases()}
    if numbers is None:
        return tuple(known.values())
    wanted = list(numbers)
    missing = [n for n in wanted if n not in known]
    if missing:
        raise InvalidInputError(
            f"there is no case {missing[0]}; cases are numbered 1 to {max(known)}"
        )
    return tuple(known[n] for n in sorted(set(wanted)))


def number(value: float | None) -> str:
    """A measured value or a tolerance as text."""
    if value is None or math.isnan(value):
        return "–"
    if math.isinf(value):
        return "infinite"
    return "0" if value == 0 else f"{value:.2g}"


def by_case(report: Report) -> list[dict[Precision, Outcome]]:
    """The outcomes of every case, by precision."""
    found: dict[int, dict[Precision, Outcome]] = {}
    for o in report.outcomes:
        found.setdefault(o.case.number, {})[o.precision] = o
    return list(found.values())


def _row(of_case: dict[Precision, Outcome]) -> tuple[str, ...]:
    """Cells of a case, both precisions side by side."""
    case = next(iter(of_case.values())).case
    # A bar would end the cell.
    title = case.title.replace("|", "\\|")
    row = [str(case.number), title, case.expected, case.unit]
    for precision in PRECISIONS:
        if precision not in of_case:
            row += ["–", "–", "not run"]
            continue
        outcome = of_case[precision]
        row += [number(outcome.value), number(case.tolerance(precision)), outcome.verdict]
    return tuple(row)


HEAD = (
    "case", "input", "expected", "unit",
    "float32", "allowed", "verdict", "float64", "allowed", "verdict",
)  # fmt: skip


def markdown(reports: Sequence[Report]) -> str:
    """The tables as a page of documentation."""
    lines = [
        "# Stability",
        "",
        "What isetcl computes for inputs at which ray tracers go wrong, against formulas, 50",
        "decimal digits, or float64 arithmetic that is written differently. A measured value",
        "passes if it is not larger than what is allowed. Made by",
        "`isetcl validate stability --markdown FILE`.",
    ]
    for report in reports:
        failed = len(report.failures)
        verdict = "all cases pass" if failed == 0 else f"{failed} cases fail"
        of = report.device
        lines += [
            "",
            f"## {of['platform']}: {of['device']}",
            "",
            f"isetcl {__version__}, driver {of['driver']}, {of['opencl']}, kernels for "
            f"{of['target']}, {datetime.date.today().isoformat()}: {verdict}.",
            "",
            "| " + " | ".join(HEAD) + " |",
            "|" + " --- |" * len(HEAD),
            *("| " + " | ".join(_row(of_case)) + " |" for of_case in by_case(report)),
        ]
        notes = [
            f"* {o.case.number}, {o.precision}: {o.note}."
            for o in report.outcomes
            if o.note and o.verdict != "not applicable"
        ]
        if notes:
            lines += ["", "Remarks:", "", *notes]
        left = sorted({(o.case.number, o.note) for o in report.outcomes
                       if o.verdict == "not applicable" and "precision" not in o.note})  # fmt: skip
        if left:
            lines += ["", "Not applicable:", "", *(f"* {n}: {why}." for n, why in left)]
    return "\n".join(lines) + "\n"

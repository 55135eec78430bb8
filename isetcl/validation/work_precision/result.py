"""The result of a study of error against run time: numbers, table, files and picture."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from isetcl.errors import FileError, InvalidInputError, check_choice, check_positive, check_type

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

    from isetcl.validation.work_precision.targets import Curve

_TABLE = (
    ("time_s", "time", "s"),
    ("cpu_median_s", "CPU", "s"),
    ("rmse", "rmse", "%"),
    ("cone_noise", "of cone noise", ""),
    ("monte_carlo", "noise", "%"),
    ("bias", "bias", "%"),
    ("representation", "repr.", "%"),
    ("rounding", "rounding", "%"),
    ("discretisation", "discr.", "%"),
    ("worst", "worst 1 %", "%"),
    ("energy", "energy", "%"),
)


@dataclass(frozen=True, eq=False)
class WorkPrecision:
    """Error against run time of several methods.

    Attributes
    ----------
    dataset : xarray.Dataset
        Dimension ``point`` (a method at one value of its knob, named by the coordinates
        ``method``, ``knob``, ``value``): ``rmse`` with ``rmse_low`` and ``rmse_high``,
        ``monte_carlo``, ``bias``, ``representation``, ``rounding``, ``discretisation``,
        ``budget`` (root of the sum of the squares of noise and parts), ``relative_mse``,
        ``worst``, ``largest``, ``energy``, times (s) with ``build_s`` and ``transfer_s`` apart,
        ``spread``, ``efficiency``; dimension ``curve`` (a method): slopes; (curve, target):
        ``time_to_s`` and how it is known, ``times_first`` (over the first method's). Errors are
        relative to the mean of the reference, intervals are of 95 %. ``cone_noise`` is the error
        in units of the Poisson noise of a cone in each pixel, with the light and the cone that
        `provenance` names; ``cone_time_s`` the time to the wanted part of it.
    notes : tuple of str
        What a reader must know.
    provenance : dict
        Settings, versions, device and clock.
    """

    dataset: xarray.Dataset
    notes: tuple[str, ...]
    provenance: dict[str, Any]
    _curves: dict[str, Curve] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        import xarray

        check_type("dataset", self.dataset, xarray.Dataset)

    def of(self, method: str) -> xarray.Dataset:
        """The points of one method.

        Raises
        ------
        InvalidInputError
            With the near matches, if there is no such method.
        """
        check_choice("method", method, self.dataset["curve"].values.tolist())
        return self.dataset.isel(point=self.dataset["method"].values == method)

    def faster(self, one: str, other: str, target: float = 0.01) -> tuple[float, float, float]:
        """How many times sooner one method reaches an error than another, with its interval.

        Resamples are paired, because all methods take the same seeds, and hold the scatter of the
        times as well.

        Raises
        ------
        InvalidInputError
            If a name is unknown, either method does not reach the error, or times were withheld.
        """
        from isetcl.validation.work_precision.targets import ratio_of_times, time_to

        mine, theirs = self._curve(one), self._curve(other)
        wanted = check_positive("target", target)
        for name, curve in ((one, mine), (other, theirs)):
            if not math.isfinite(time_to(curve, wanted)[0].seconds):
                raise InvalidInputError(f"method {name!r} does not reach {100 * wanted:g} %")
        return ratio_of_times(theirs, mine, wanted)

    def more_exact(self, one: str, other: str, seconds: float) -> tuple[float, float, float]:
        """How many times smaller one method's error is than another's after the same time.

        Errors are interpolated between points; the interval is of 95 %, resamples are paired.

        Raises
        ------
        InvalidInputError
            If a name is unknown, the time is not between those of both methods' points, or times
            were withheld.
        """
        from isetcl.validation.work_precision.estimators import percentiles
        from isetcl.validation.work_precision.targets import error_after

        check_positive("seconds", seconds, "s")
        found = []
        for name in (one, other):
            curve = self._curve(name)
            if not curve.seconds[0] <= seconds <= curve.seconds[-1]:
                raise InvalidInputError(
                    f"seconds must lie between those of method {name!r}, {curve.seconds[0]:.3g} "
                    f"and {curve.seconds[-1]:.3g} s, got {seconds:g}; add values of its knob"
                )
            found.append(error_after(curve, seconds))
        (mine, my_draws), (theirs, their_draws) = found
        count = int(self.dataset["images"].max())
        return (theirs / mine, *percentiles(their_draws / my_draws, count))

    def _curve(self, name: str) -> Curve:
        check_choice("method", name, self.dataset["curve"].values.tolist())
        if name not in self._curves:
            raise InvalidInputError(
                "the times of this result were withheld, for the machine was too noisy; measure "
                "again"
            )
        return self._curves[name]

    def table(self) -> str:
        """All points as text, percent of the mean; ``~`` marks times that differed too much."""
        return "\n".join([_aligned(self.rows()), "", *self.summary(), *self.notes])

    def rows(self) -> list[list[str]]:
        """The table's cells, the names of the columns first."""
        data = self.dataset
        head = ["method", "knob", *(f"{title} ({u})" if u else title for _, title, u in _TABLE)]
        rows = [head]
        for i in range(data.sizes["point"]):
            row = [str(data["method"].values[i]), _knob(data, i)]
            for name, _, unit in _TABLE:
                value = float(data[name].values[i])
                text = _number(100.0 * value if unit == "%" else value)
                if name in ("rmse", "bias"):
                    low, high = (
                        100.0 * float(data[f"{name}_{e}"].values[i]) for e in ("low", "high")
                    )
                    text += f" [{_number(low)}, {_number(high)}]"
                if name == "rmse" and data["is_limited"].values[i]:
                    text += " <ref"
                if name == "time_s" and data["is_noisy"].values[i]:
                    text = f"~{text}"
                row.append(text)
            rows.append(row)
        return rows

    def summary(self) -> list[str]:
        """The reference, and slopes and times to targets, a line for each method."""
        data = self.dataset
        lines = [self._reference_line()]
        for m, name in enumerate(data["curve"].values):
            slopes = [float(data[f"slope{end}"].values[m]) for end in ("", "_low", "_high")]
            words = [f"{name}:"]
            if math.isfinite(slopes[0]):
                words.append(
                    f"error falls as knob^{slopes[0]:.2f} [{slopes[1]:.2f}, {slopes[2]:.2f}];"
                )
            own = self.of(str(name)).isel(point=0)
            first, build = own["first_s"].item(), own["build_s"].item()
            if math.isfinite(first):
                words.append(f"first image {first:.3g} s, {build:.3g} s of it to build;")
                moved = own["transfer_s"].item()
                words += [f"copies {moved:.2g} s;"] if math.isfinite(moved) else []
            for k, target in enumerate(data["target"].values):
                seconds = float(data["time_to_s"].values[m, k])
                how = str(data["time_to_how"].values[m, k])
                text = how
                if math.isfinite(seconds):
                    ends = [float(data[f"time_to_{e}_s"].values[m, k]) for e in ("low", "high")]
                    text = f"{seconds:.3g} s [{ends[0]:.3g}, {ends[1]:.3g}], {how}"
                    text += f", efficiency {float(data['efficiency_at'].values[m, k]):.3g} /s"
                    times = float(data["times_first"].values[m, k])
                    if m and math.isfinite(times):
                        text += f", {times:.3g} times that of {data['curve'].values[0]}"
                words.append(f"{100 * target:g} % {text};")
            words += self._cone_words(m)
            lines.append(" ".join(words).rstrip(";"))
        return lines

    def _reference_line(self) -> str:
        error = 100.0 * float(self.dataset["reference_error"].max())
        known = f"standard error {_number(error)} %" if error > 0 else "taken as exact"
        line = f"reference: {self.provenance.get('reference', 'given')}, {known}"
        cone = self.provenance.get("cone_noise")
        if cone is None:
            return line
        lux = cone["illuminance_lux"]
        light = "" if lux is None else f" at a mean of {lux:g} lux"
        return line + (
            f"; a cone has {cone['mean_excitations']:.4g} excitations within "
            f"{1e3 * cone['integration_time_s']:g} ms{light}"
        )

    def _cone_words(self, m: int) -> list[str]:
        """The time to the wanted part of the cones' noise."""
        cone = self.provenance.get("cone_noise")
        if cone is None:
            return []
        own = self.dataset.isel(curve=m)
        seconds, how = own["cone_time_s"].item(), own["cone_time_how"].item()
        text = how
        if math.isfinite(seconds):
            ends = [own[f"cone_time_{e}_s"].item() for e in ("low", "high")]
            text = f"{seconds:.3g} s [{ends[0]:.3g}, {ends[1]:.3g}], {how}"
        return [f"{cone['ratio']:g} of the cones' noise {text};"]

    def to_csv(self, path: str | Path) -> Path:
        """Write a line for each point, all columns; returns the path.

        Raises
        ------
        FileError
        """
        data = self.dataset
        names = [n for n, v in data.variables.items() if v.dims == ("point",)]
        lines = [names, *zip(*(data[n].values.tolist() for n in names), strict=True)]
        target = Path(path)
        try:
            with target.open("w", encoding="utf-8", newline="") as file:
                csv.writer(file).writerows(lines)
        except OSError as error:
            raise FileError(f"cannot write {target}: {error.strerror}") from error
        return target

    def record(self) -> dict[str, Any]:
        """Everything as plain values: points, methods with their targets, notes, provenance."""
        data = self.dataset
        columns = {n: v.values.tolist() for n, v in data.variables.items() if v.dims == ("point",)}
        points = [
            dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)
        ]
        methods = []
        for m, name in enumerate(data["curve"].values.tolist()):
            own = data.isel(curve=m)
            fits = {
                n: own[n].item()
                for n, v in data.variables.items()
                if v.dims == ("curve",) and n != "curve"
            }
            goals = [
                {"target": float(t)}
                | {
                    n: own[n].values[k].item()
                    for n, v in data.variables.items()
                    if v.dims == ("curve", "target")
                }
                for k, t in enumerate(data["target"].values)
            ]
            methods.append(fits | {"method": name, "targets": goals})
        plain = {"points": points, "methods": methods, "notes": list(self.notes)}
        return _plain(plain | {"provenance": self.provenance})

    def to_json(self, path: str | Path) -> Path:
        """Write `record`; what is not known is null. Returns the path.

        Raises
        ------
        FileError
        """
        target = Path(path)
        try:
            target.write_text(json.dumps(self.record(), indent=1) + "\n", encoding="utf-8")
        except OSError as error:
            raise FileError(f"cannot write {target}: {error.strerror}") from error
        return target

    def plot(self, ax: Axes | None = None, error: str = "rmse") -> Axes:
        """Error against time, a curve for each method, with the targets; returns the axes.

        Parameters
        ----------
        ax
            None makes a figure.
        error
            ``"rmse"``, ``"cone_noise"`` (in units of it), one kind by itself (``"monte_carlo"``,
            ``"bias"``, ``"representation"``, ``"rounding"``, ``"discretisation"``), ``"budget"``,
            ``"worst"`` or ``"largest"``.

        Raises
        ------
        InvalidInputError
            If there is no such error, or none is known.
        """
        from isetcl.validation.work_precision.picture import draw

        return draw(self, ax, error)


def _knob(data: xarray.Dataset, i: int) -> str:
    return f"{data['knob'].values[i]} {float(data['value'].values[i]):g}"


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3g}"


def _aligned(rows: list[list[str]]) -> str:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = ("  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)) for row in rows)
    return "\n".join(line.rstrip() for line in lines)


def _plain(value: Any) -> Any:
    """The same without numbers that JSON does not have: NaN is null, infinity a word."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else "infinite"
    return value

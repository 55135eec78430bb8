"""The README's numbers on speed and exactness are those of the benchmarks' records."""

import json
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "benchmarks"
README = (ROOT / "README.md").read_text(encoding="utf-8")
# What is known before any measurement.
FIXED = ("Figure 12", "40-digit", "800 x 800 pixels", "31 wavelengths", "Mitsuba 3", "-O3")


@pytest.fixture(scope="module")
def section():
    return README.split("## How fast, how exact")[1].split("<!-- end of")[0]


def record(name):
    return json.loads((FOLDER / "results" / f"{name}.json").read_text(encoding="utf-8"))


def test_the_section_is_what_the_records_make_of_it(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    monkeypatch.delitem(sys.modules, "summary", raising=False)
    monkeypatch.delitem(sys.modules, "readme", raising=False)
    import readme

    assert readme.section() in README


def numbers(value):
    """All numbers of a record, those in its texts included, and as percent."""
    if isinstance(value, dict):
        value = [*value, *value.values()]
    if isinstance(value, list):
        return set().union(*(numbers(item) for item in value)) if value else set()
    if isinstance(value, str):
        return {f"{float(text):.3g}" for text in re.findall(r"\d+\.?\d*", value)}
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return {f"{factor * value:.3g}" for factor in (1.0, 100.0, 1000.0)}
    return set()


def test_every_number_is_in_a_record(section):
    known = set().union(*(numbers(record(p.stem)) for p in (FOLDER / "results").glob("*.json")))
    text = re.sub(r"\s+", " ", section)
    for words in FIXED:
        text = text.replace(words, "")
    text = re.sub(r"\]\([^)]*\)", "", text)
    for token in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", text):
        if token == "1" and "below 1," in text:
            continue
        assert f"{float(token):.3g}" in known, token


def cells(section, first):
    (line,) = [ln for ln in section.splitlines() if ln.startswith(f"| {first} |")]
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_errors_and_times_are_those_of_the_study(section):
    study = record("work_precision")
    for method in study["methods"]:
        name = method["method"]
        row = cells(section, f"`{name}`" if "_" in name else name)
        points = [p for p in study["points"] if p["method"] == name]
        least, seconds = min((p["rmse"], p["time_s"]) for p in points)
        assert float(row[1]) == pytest.approx(100.0 * least, rel=0.006)
        assert float(row[2]) == pytest.approx(seconds, rel=0.006)
        for cell, target in zip(row[3:], method["targets"], strict=False):
            assert cell.endswith(target["time_to_how"])
            if target["time_to_how"] != "not reached":
                assert float(cell.split()[0]) == pytest.approx(target["time_to_s"], rel=0.006)
        if "cone_noise" in study["provenance"]:
            best = min(points, key=lambda p: p["rmse"])["cone_noise"]
            assert float(row[5]) == pytest.approx(best, rel=0.006)
            assert row[6].endswith(method["cone_time_how"])


@pytest.mark.parametrize(
    ("program", "name", "key"),
    [
        ("Embree, by embreex", "mesh", "cpu_time_of_embreex_over_ours"),
        ("`scipy.signal.fftconvolve`", "psf_baseline", "times_of_fftconvolve_over_ours"),
    ],
)
def test_ratios_are_those_of_the_records(section, program, name, key):
    found = sorted(record(name)[key].values())
    ends = [float(text) for text in cells(section, program)[2].split(" to ")]
    assert [ends[0], ends[-1]] == pytest.approx([found[0], found[-1]], rel=0.006)

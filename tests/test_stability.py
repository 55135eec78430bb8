"""The stability suite: all cases pass here, its table is whole, and a failure is no success."""

import dataclasses
import json
import math
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from oracles import mp_trace
from test_sequential import hard_rays
from typer.testing import CliRunner

import isetcl as ic
from isetcl.cli import app
from isetcl.eye.prescription import elements
from isetcl.validation import stability
from isetcl.validation.stability import fifty_digits, solids, suite
from isetcl.validation.stability.case import Bench, Case, NotApplicableError, case

QUICK = {1, 2, 6, 8, 10, 11, 15, 17, 18, 23, 37, 47, 54}
"""Cases that share the kernels of other tests."""


PARAMETERS = [
    pytest.param(c, marks=() if c.number in QUICK else pytest.mark.slow, id=str(c.number))
    for c in stability.cases()
]


@pytest.fixture(scope="module")
def benches(device):
    return {p: Bench(device, p) for p in ("single", "double")}


@pytest.mark.parametrize("chosen", PARAMETERS)
def test_the_case_passes(chosen, benches, precision):
    outcome = chosen.run(benches[precision])
    assert outcome.verdict in ("pass", "not applicable"), f"{outcome.value} {outcome.note}"
    if outcome.verdict == "not applicable" and chosen.number != 36:
        assert chosen.tolerance(precision) is None


def test_all_sixty_cases_are_there_and_more_scenes():
    numbers = [c.number for c in stability.cases()]
    assert numbers == list(range(1, 69))
    for c in stability.cases():
        assert all((c.title, c.expected, c.unit))
        assert c.single is not None or c.double is not None


def test_the_documentation_has_every_case_and_no_failure():
    text = (Path(__file__).parent.parent / "docs" / "stability.md").read_text()
    for c in stability.cases():
        title = c.title.replace("|", "\\|")
        assert f"| {c.number} | {title} | {c.expected} | {c.unit} |" in text
    assert "| fail |" not in text
    assert "| error |" not in text


def test_the_reference_of_50_digits_is_mpmaths():
    sequence = elements(ic.eyes.navarro(8.0), 550.0)
    compared = 0
    for o, d in zip(*hard_rays(), strict=True):
        ours, theirs = fifty_digits.trace(sequence, o, d, 1), mp_trace(sequence, o, d, 1)
        assert (ours is None) == (theirs is None)
        if ours is None:
            continue
        compared += 1
        for a, b in ((ours[0], theirs[0]), (ours[1], theirs[1]), ([ours[2]], [theirs[2]])):
            assert all(abs(mp.mpf(str(u)) - v) < 1e-45 for u, v in zip(a, b, strict=True))
    assert compared > 30


def test_the_ball_of_triangles_is_closed():
    triangles = solids.ball_mesh(2)
    edges = {}
    for t in triangles:
        for a, b in ((0, 1), (1, 2), (2, 0)):
            key = tuple(t[a]), tuple(t[b])
            assert key not in edges
            edges[key] = True
    assert len(edges) == 3 * len(triangles) == 3 * 8 * 16
    assert all((b, a) in edges for a, b in edges)
    outward = np.einsum(
        "ij,ij->i",
        np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]),
        triangles.mean(axis=1),
    )
    assert np.all(outward > 0)


def made(measure, tolerance=1.0, number=1):
    return Case(number, "made up", "nothing", "um", tolerance, tolerance, measure)


def raising(error):
    def measure(_):
        raise error

    return measure


@pytest.mark.parametrize(
    ("measure", "verdict", "note"),
    [
        (lambda _: 0.5, "pass", ""),
        (lambda _: (1.0, "just so"), "pass", "just so"),
        (lambda _: 1.5, "fail", ""),
        (lambda _: math.nan, "fail", ""),
        (lambda _: math.inf, "fail", ""),
        (raising(NotApplicableError("no lanes")), "not applicable", "no lanes"),
        (raising(ValueError("wrong shape")), "error", "ValueError: wrong shape"),
        (raising(ic.KernelBuildError("refused")), "error", "KernelBuildError: refused"),
    ],
)
def test_verdicts_are_those_of_the_measurement(benches, measure, verdict, note):
    outcome = made(measure).run(benches["single"])
    assert (outcome.verdict, outcome.note) == (verdict, note)
    assert outcome.failed == (verdict in ("fail", "error"))
    only_double = dataclasses.replace(made(measure), single=None).run(benches["single"])
    assert only_double.verdict == "not applicable"


@pytest.fixture
def made_suite(monkeypatch):
    """The command line with a few cases of ours instead of the suite."""

    def with_cases(*measures):
        cases = tuple(made(m, number=i) for i, m in enumerate(measures, start=1))
        monkeypatch.setattr(suite, "cases", lambda: cases)
        monkeypatch.setattr(stability, "cases", lambda: cases)

    return with_cases


def invoke(*arguments):
    return CliRunner().invoke(app, ["validate", "stability", *map(str, arguments)])


def test_a_suite_that_passes_exits_with_0(made_suite, tmp_path):
    made_suite(lambda _: 0.25, raising(NotApplicableError("one device")))
    result = invoke("--json", tmp_path / "s.json", "--markdown", tmp_path / "s.md")
    assert result.exit_code == 0, result.output
    assert "2 of 2 cases" in result.output
    assert "all pass" in result.output
    (report, *_) = json.loads((tmp_path / "s.json").read_text())
    assert [c["verdict"] for c in report["cases"]] == ["pass", "not applicable"] * 2
    assert report["cases"][0]["measured"] == 0.25
    assert report["cases"][1]["measured"] is None
    text = (tmp_path / "s.md").read_text()
    assert "| 1 | made up | nothing | um | 0.25 | 1 | pass | 0.25 | 1 | pass |" in text
    assert "* 2: one device." in text


@pytest.mark.parametrize("bad", [lambda _: 2.0, raising(ValueError("odd"))])
def test_a_case_that_fails_makes_the_exit_status_1(made_suite, bad, tmp_path):
    made_suite(lambda _: 0.25, bad)
    result = invoke("--precision", "single", "--json", tmp_path / "s.json")
    assert result.exit_code == 1
    assert "1 failed" in result.output
    assert "case 2, single: made up" in result.output
    assert json.loads((tmp_path / "s.json").read_text())


def test_chosen_cases_are_run_alone():
    result = invoke("--case", 10, "--case", 11, "--precision", "double")
    assert result.exit_code == 0, result.output
    assert "2 of 68 cases" in result.output


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        (("--case", 99), "no case 99; cases are numbered 1 to 68"),
        (("--precision", "half"), "unknown --precision"),
        (("--device", "no such thing"), "no OpenCL device matches"),
        (("--json", "/no/such/folder/s.json"), "does not exist"),
    ],
)
def test_bad_requests_are_refused_before_any_case_runs(arguments, match, monkeypatch):
    monkeypatch.setattr(Case, "run", raising(AssertionError("a case ran")))
    result = invoke(*arguments)
    assert result.exit_code != 0
    assert isinstance(result.exception, ic.IsetclError)
    assert match in str(result.exception)


def test_a_case_is_registered_once():
    with pytest.raises(AssertionError, match="registered twice"):
        case(1, "again", "nothing", "um", single=0, double=0)(lambda _: 0.0)


def test_files_that_cannot_be_written_are_refused_before_any_case(tmp_path):
    from isetcl.errors import FileError

    for option in ("--json", "--markdown"):
        for path, reason in (
            (tmp_path, "it is a folder"),
            (tmp_path / "no" / "a", "does not exist"),
        ):
            found = CliRunner().invoke(app, ["validate", "stability", option, str(path)])
            assert isinstance(found.exception, FileError)
            assert f"{option}: cannot write" in str(found.exception)
            assert reason in str(found.exception)

"""The validation report: complete, self-contained, and honest about what failed."""

import json
import re

import pytest
from typer.testing import CliRunner

from isetcl import validation_report
from isetcl.cli import app
from isetcl.errors import FileError, InvalidInputError
from isetcl.page import Listing, Picture, Table, Text, page
from isetcl.validation_report import Part, report_parts, write_validation_report


@pytest.fixture
def parts(monkeypatch):
    """Three quick parts in the place of the real ones: right, wrong, and broken."""

    def broken(is_draft, device):
        raise RuntimeError("no light <here>")

    made = {
        "right": ("What is right", lambda *_: Part([Text("5 < 6")], (), {"number": 5})),
        "wrong": ("What is wrong", lambda *_: Part([Text("7")], ["7 is not 8"])),
        "broken": ("What breaks", broken),
    }
    monkeypatch.setattr(validation_report, "_PARTS", made)


def test_a_part_that_fails_is_told_and_the_others_are_there(parts, tmp_path):
    steps = []
    found = write_validation_report(tmp_path / "new" / "out", on_step=lambda *s: steps.append(s))
    assert found.failures == {
        "wrong": ("7 is not 8",),
        "broken": ("RuntimeError: no light <here>",),
    }
    assert [s for s, _ in steps] == ["What is right", "What is wrong", "What breaks"]
    record = json.loads((tmp_path / "new" / "out" / "report.json").read_text())
    assert record["parts"]["right"]["number"] == 5
    assert record["failures"]["wrong"] == ["7 is not 8"]
    assert record["packages"]["numpy"]
    assert record["devices"][0]["device"]
    assert re.fullmatch("[0-9a-f]{64}", record["sha256"]["kernels"])
    content = (tmp_path / "new" / "out" / "report.html").read_text()
    for words in ("5 &lt; 6", "7 is not 8", "no light &lt;here&gt;", "as it must be"):
        assert words in content


def test_the_hash_is_that_of_the_files():
    import hashlib
    from pathlib import Path

    package = Path(validation_report.__file__).parent
    total = hashlib.sha256()
    for path in sorted(package.rglob("*.cl")):
        total.update(str(path.relative_to(package)).encode() + b"\0" + path.read_bytes())
    assert validation_report._where()["sha256"]["kernels"] == total.hexdigest()


def test_only_wanted_parts_are_made_and_unknown_ones_are_refused(parts, tmp_path):
    found = write_validation_report(tmp_path, parts=["right"])
    assert found.failures == {}
    assert "What is wrong" not in (tmp_path / "report.html").read_text()
    with pytest.raises(InvalidInputError, match=r"part of the report 'left'.*right"):
        write_validation_report(tmp_path, parts=["left"])


def test_the_command_fails_if_something_does(parts, tmp_path):
    run = CliRunner().invoke
    good = run(app, ["validate", "--report", str(tmp_path), "--part", "right"])
    assert good.exit_code == 0
    bad = run(app, ["validate", "--report", str(tmp_path)])
    assert bad.exit_code == 1
    assert "7 is not 8" in bad.stdout
    assert run(app, ["validate"]).exit_code == 2
    mixed = run(app, ["validate", "--draft", "stability"])
    assert isinstance(mixed.exception, InvalidInputError)


def test_options_of_the_report_without_a_report_are_refused():
    found = CliRunner().invoke(app, ["validate", "--part", "mtf"])
    assert isinstance(found.exception, InvalidInputError)
    assert "add --report FOLDER" in str(found.exception)


def test_a_folder_that_cannot_be_written_is_told_with_its_option(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match="choose another with --report"):
        write_validation_report(tmp_path / "file")


@pytest.fixture
def stopped(parts):
    """Ctrl-C in the second of three parts."""

    def stop(is_draft, device):
        raise KeyboardInterrupt

    validation_report._PARTS["wrong"] = ("What is wrong", stop)


def test_an_interrupted_report_holds_the_parts_that_were_finished(stopped, tmp_path):
    found = CliRunner().invoke(app, ["validate", "--report", str(tmp_path)])
    assert found.exit_code == 130
    assert "interrupted; the report holds the parts that were finished" in found.stderr
    record = json.loads((tmp_path / "report.json").read_text())
    assert record["is_complete"] is False
    assert list(record["parts"]) == ["right"]
    assert (
        "interrupted, with the parts that were finished" in (tmp_path / "report.html").read_text()
    )


def test_a_report_interrupted_in_its_first_part_is_not_written(stopped, tmp_path):
    found = CliRunner().invoke(app, ["validate", "--report", str(tmp_path), "--part", "wrong"])
    assert found.exit_code == 130
    assert "interrupted before a part of the report was finished" in found.stderr
    assert list(tmp_path.iterdir()) == []


def test_verdicts_of_extreme_cases_have_their_colours(monkeypatch):
    from isetcl.validation import stability

    run = stability.run
    monkeypatch.setattr(stability, "run", lambda device: run(device, numbers=[12]))
    blocks = validation_report._stability(True, None).blocks
    assert '<td class="good">pass</td>' in blocks[0].markup()


def test_a_page_needs_no_other_file():
    blocks = [
        Text("<b>"),
        Listing("a  b"),
        Picture(b"\x89PNG", 'a "picture"'),
        Table(("n", "word"), [("10", "good"), ("9", "bad")], verdicts=(["good"], ["bad"])),
    ]
    text = page("t", "h", "l", [("One", blocks), ("Two", [])], has_contents=True)
    assert "&lt;b&gt;" in text
    assert "<b>" not in text
    assert re.findall(r'(?:src|href)="(?!data:image/png;base64,|#part-[12]")', text) == []
    assert "http" not in text
    assert text.count('<th><button type="button">') == 2
    assert '<td class="good">good</td>' in text
    assert '<td class="bad">bad</td>' in text


def test_all_of_the_validation_is_part_of_the_report():
    assert list(report_parts()) == ["stability", "mtf", "occlusion", "work-precision", "figures"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "pictures"), [("mtf", 1), ("occlusion", 1), ("work-precision", 2)]
)
def test_a_draft_of_every_part_passes(name, pictures, tmp_path):
    found = write_validation_report(tmp_path, parts=[name], is_draft=True)
    assert found.failures == {}
    assert (tmp_path / "report.html").read_text().count("data:image/png") == pictures

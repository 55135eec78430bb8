"""The README does what it says."""

import re
import runpy
import shlex
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()


def blocks(language=""):
    return re.findall(rf"^```{language}\n(.*?)^```", README, flags=re.M | re.S)


def test_the_python_example_runs(tmp_path, monkeypatch, capsys):
    (example,) = blocks("python")
    monkeypatch.chdir(tmp_path)
    exec(compile(example, "README.md", "exec"), {})
    printed = capsys.readouterr().out
    assert "2 of 2 rays passed" in printed
    assert (tmp_path / "retina.nc").exists()


def test_the_two_commands_are_the_promised_ones():
    commands = [b.strip() for b in blocks()]
    setup = "python -m venv .venv && . .venv/bin/activate && "
    assert commands[0] == setup + "pip install . && isetcl compare"
    assert commands[2] == setup + 'pip install ".[test]" && pytest'


def test_the_command_with_photographs_is_understood(monkeypatch):
    import typer

    from isetcl.cli import app

    command = next(b for b in blocks() if "--near-image" in b)
    arguments = shlex.split(command)[1:]
    context = typer.main.get_command(app).make_context("isetcl", list(arguments))
    sub = typer.main.get_command(app).commands["compare"]
    parsed = sub.make_context("compare", arguments[1:]).params
    assert context.info_name == "isetcl"
    assert parsed["eye"] == "arizona"
    assert parsed["size"] == 512


def test_linked_files_exist():
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", README):
        assert (ROOT / target).exists(), target


@pytest.mark.parametrize("name", ["LICENSE", "CONTRIBUTING.md", "CHANGELOG.md", ".ci/run"])
def test_the_promised_files_are_there(name):
    assert (ROOT / name).is_file()


def test_the_benchmark_tables_are_those_of_the_json_files():
    folder = ROOT / "benchmarks"
    page = runpy.run_path(str(folder / "summary.py"))["page"]()
    assert (folder / "README.md").read_text(encoding="utf-8") == page

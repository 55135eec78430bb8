"""The README does what it says."""

import ast
import importlib.util
import re
import runpy
import shlex
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()


def blocks(language=""):
    found = re.findall(r"^```(\w*)\n(.*?)^```$", README, flags=re.M | re.S)
    return [text for kind, text in found if kind == language]


@pytest.mark.slow
def test_the_python_examples_run_one_after_the_other(tmp_path, monkeypatch, capsys):
    import xarray

    monkeypatch.chdir(tmp_path)
    names = {}
    for example in blocks("python"):
        exec(compile(example, "README.md", "exec"), names)
    printed = capsys.readouterr().out
    assert "2 of 2 rays passed" in printed
    assert "('table', 'mug', 'ring')" in printed
    assert (tmp_path / "retina.nc").exists()
    assert names["view"].layers == 2
    assert isinstance(names["image"].dataset["albedo"], xarray.DataArray)


def test_the_two_commands_are_the_promised_ones():
    commands = [b.strip() for b in blocks()]
    setup = "python -m venv .venv && . .venv/bin/activate && "
    assert commands[0] == setup + "pip install . && isetcl compare"
    assert commands[2] == setup + 'pip install ".[test]" && pytest'


def test_the_commands_that_render_are_understood():
    import typer

    from isetcl.cli import app

    (block,) = (b for b in blocks() if b.startswith("isetcl render"))
    render = typer.main.get_command(app).commands["render"]
    parsed = [
        render.make_context("render", shlex.split(line)[2:]).params for line in block.splitlines()
    ]
    assert [p["scene"] for p in parsed] == ["letters_at_depth", "chess_set", "kitchen.glb"]
    assert [p["fov"] for p in parsed] == [None, 29.0, None]


def test_the_commands_about_eyes_are_understood():
    import typer

    from isetcl.cli import app

    (block,) = (b for b in blocks() if b.startswith("isetcl eye"))
    commands = typer.main.get_command(app).commands
    lines = [shlex.split(line) for line in block.splitlines()]
    parsed = [commands[words[1]].make_context(words[1], words[2:]).params for words in lines]
    assert [p["name"] for p in parsed] == ["navarro", "liou_brennan"]
    assert [p["pupil"] for p in parsed] == [4.0, 3.0]


def test_the_commands_about_cones_and_validation_are_understood():
    import typer

    from isetcl.cli import app

    group = typer.main.get_command(app).commands
    lines = [
        shlex.split(line)[1:]
        for start in ("isetcl cones", "isetcl validate")
        for b in blocks()
        if b.startswith(start)
        for line in b.splitlines()
    ]
    parsed = [group[words[0]].make_context(words[0], words[1:]).params for words in lines]
    assert [p.get("movie") for p in parsed] == [60.0, *[None] * 6]
    assert [parsed[1]["centre"], parsed[2]["centre"]] == ["0.6,0", "1,0"]
    assert str(parsed[4]["report"]) == "report"
    assert parsed[5]["numbers"] == [3, 10]
    assert parsed[6]["plot"]


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


def test_benchmarks_and_examples_import_what_there_is():
    # They do not run with the tests, and a name that has moved would break them unnoticed.
    wanted = {
        (path.name, node.module, alias.name)
        for folder in ("benchmarks", "examples")
        for path in (ROOT / folder).glob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("isetcl")
        for alias in node.names
    }
    assert len(wanted) > 40
    for file, module, name in sorted(wanted):
        found = importlib.import_module(module)
        is_module = hasattr(found, "__path__") and importlib.util.find_spec(f"{module}.{name}")
        assert hasattr(found, name) or is_module, f"{file}: {module}.{name}"

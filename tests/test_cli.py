"""The command line as a user meets it."""

import json
import signal
import subprocess
import sys

import numpy as np
import pytest
from slow_cases import slow_after

import isetcl as ic

SMALL = ["--size", "24", "--spp", "8"]


def run(*arguments, cwd=None, env=None):
    return subprocess.run(
        [sys.executable, "-m", "isetcl.cli", *arguments],
        capture_output=True,
        text=True,
        cwd=cwd,
        env=env,
        check=False,
    )


@pytest.mark.slow
def test_compare_writes_its_folder_and_prints_a_table(tmp_path):
    result = run("compare", *SMALL, "--output", "results", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "layered sum (M3)" in result.stdout
    assert "Predicted: layered_sum within 1 % on" in result.stdout
    assert "report.html" in result.stdout
    folder = tmp_path / "results"
    record = json.loads((folder / "report.json").read_text())
    assert {t["method"] for t in record["trials"]} == {"ray tracing", "layered_sum", "layered_over"}
    assert record["command"].startswith("isetcl compare --size 24")
    assert ic.RetinalImage.load(folder / "ray_tracing.nc").irradiance.shape == (31, 24, 24)
    for name in ("images", "profiles", "error_against_time", "difference_layered_over"):
        assert (folder / f"{name}.png").stat().st_size > 5000


@pytest.mark.slow
def test_compare_takes_methods_by_name_or_place_in_the_survey(tmp_path):
    chosen = ("--methods", "M7, gather,M1")
    result = run("compare", *SMALL, *chosen, "--output", "results", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    record = json.loads((tmp_path / "results" / "report.json").read_text())
    assert [t["method"] for t in record["trials"] if t["spp"] is None] == ["ikoma", "gather"]
    assert (tmp_path / "results" / "difference_ikoma.png").stat().st_size > 5000


def test_compare_suggests_methods_near_a_misspelt_one(tmp_path):
    result = run("compare", *SMALL, "--methods", "layered_summ", cwd=tmp_path)
    assert result.returncode == 2
    assert "did you mean layered_sum" in result.stderr


@pytest.mark.slow
def test_compare_takes_photographs(tmp_path):
    from skimage.io import imsave

    rng = np.random.default_rng(0)
    for name, shape in (("a.jpg", (90, 60, 3)), ("b.png", (60, 90))):
        imsave(tmp_path / name, rng.integers(0, 255, shape).astype(np.uint8), check_contrast=False)
    result = run(
        *("compare", "--near-image", "a.jpg", "--far-image", "b.png", "--near", "0.4"),
        *("--far", "3", "--eye", "arizona", "--pupil", "6", "--accommodation", "2.5"),
        *("--fov", "8", *SMALL, "-o", "photos"),
        cwd=tmp_path,
    )
    assert result.returncode == 0, result.stderr
    record = json.loads((tmp_path / "photos" / "report.json").read_text())
    assert record["reference"]["eye"]["name"] == "arizona"
    assert record["reference"]["eye"]["stop"]["diameter_mm"] == 6.0
    assert record["methods"]["layered_sum"]["layers_dpt"] == pytest.approx([1 / 3, 2.5], rel=1e-6)


BAD = [
    (["--eye", "navaro"], "did you mean navarro"),
    (["--near", "3", "--far", "1"], "near_m must be smaller than far_m"),
    (["--near", "-1"], "must be > 0"),
    (["--pupil", "0"], "pupil_diameter_mm must be > 0"),
    (["--near-image", "a.jpg"], "give both --near-image and --far-image"),
    (["--near-image", "a.jpg", "--far-image", "b.jpg"], "'a.jpg' does not exist"),
    (["--accommodation", "much"], "'near', 'far' or 'relaxed'"),
    (["--accommodation", "50"], "move the object farther away"),
    (["--fov", "400"], "chief rays enter"),
    (["--size", "0"], "resolution"),
    (["--spp", "1"], "--spp must be >= 2"),
    (["--device", "abacus"], "no OpenCL device matches 'abacus'"),
    (["--output", "/proc/nowhere"], "cannot write into folder"),
    (["--eye", "legrand"], "--accommodation relaxed"),
]


@pytest.mark.parametrize(("arguments", "message"), BAD, ids=[" ".join(b[0]) for b in BAD])
def test_bad_input_is_explained_without_a_traceback(
    arguments, message, tmp_path, monkeypatch, capsys
):
    from isetcl import cli

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["isetcl", "compare", *arguments])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    assert stopped.value.code == 2
    errors = capsys.readouterr().err
    assert message in errors
    assert "Traceback" not in errors
    assert not list(tmp_path.glob("**/*.nc"))


def test_devices_shows_self_test_and_speed():
    result = run("devices")
    assert result.returncode == 0, result.stderr
    assert "passed" in result.stdout
    assert "million rays/s" in result.stdout


def test_info_shows_versions():
    result = run("info")
    assert result.returncode == 0
    assert f"isetcl {ic.__version__}" in result.stdout


@pytest.mark.slow
def test_an_eye_that_cannot_accommodate_is_compared_relaxed(tmp_path, monkeypatch, capsys):
    from isetcl import cli

    monkeypatch.chdir(tmp_path)
    arguments = ["compare", "--eye", "legrand", "--accommodation", "relaxed", *SMALL]
    monkeypatch.setattr(sys, "argv", ["isetcl", *arguments])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    assert stopped.value.code == 0
    assert (tmp_path / "isetcl-compare" / "report.html").exists()


@pytest.mark.parametrize(
    ("when", "finished"),
    slow_after(
        1,
        [
            ("ray tracing, 2 samples", {"ray_tracing"}),
            ("PSF method layered_over", {"ray_tracing", "layered_sum"}),
        ],
    ),
)
def test_ctrl_c_leaves_a_report_of_what_was_finished(when, finished, tmp_path, monkeypatch, capsys):
    from isetcl import cli
    from isetcl.cli import compare

    class Interrupts(compare._StepBar):
        def __call__(self, text, fraction):
            if text.startswith(when):
                signal.raise_signal(signal.SIGINT)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(compare, "_StepBar", Interrupts)
    monkeypatch.setattr(sys, "argv", ["isetcl", "compare", *SMALL])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    assert stopped.value.code == 130
    assert "the report holds what was finished" in capsys.readouterr().err
    folder = tmp_path / "isetcl-compare"
    record = json.loads((folder / "report.json").read_text())
    assert record["is_complete"] is False
    assert {path.stem for path in folder.glob("*.nc")} == finished
    assert "Ctrl-C ended" in (folder / "report.html").read_text()


def test_ctrl_c_before_there_is_anything_says_so(tmp_path, monkeypatch, capsys):
    from isetcl import cli
    from isetcl.cli import compare

    class Interrupts(compare._StepBar):
        def __call__(self, text, fraction):
            signal.raise_signal(signal.SIGINT)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(compare, "_StepBar", Interrupts)
    monkeypatch.setattr(sys, "argv", ["isetcl", "compare", *SMALL])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    assert stopped.value.code == 130
    assert "before there was a report" in capsys.readouterr().err
    assert not list(tmp_path.glob("**/*.nc"))


def test_accommodation_may_be_given_in_words():
    from isetcl.cli.compare import _model_eye

    for word, v in (("near", 2.0), ("far", 0.8), ("1.5", 1.5)):
        assert _model_eye("navarro", 4.0, word, 0.5, 1.25).focus_vergence_dpt() == pytest.approx(
            v, abs=1e-5
        )


def test_defaults_depend_on_photographs_and_samples():
    from isetcl.cli.compare import _field, _trial_samples

    assert (_field(None, False), _field(None, True), _field(3.0, True)) == (2.0, 8.0, 3.0)
    assert _trial_samples(256) == [4, 16, 64, 256]
    assert _trial_samples(8) == [2, 8]


def test_without_photographs_the_scene_is_figure_12():
    from isetcl.cli.compare import _two_planes

    scene, angle, white = _two_planes(None, None, 0.5, 2.0, 2.0)
    assert (angle, white) == (45.0, "E")
    assert [item.shape.corner_m[2] for item in scene.objects] == [-0.5, -2.0]


def test_the_command_passes_its_options_on(monkeypatch, tmp_path):
    from isetcl import cli, validation

    seen = {}

    def stop(scene, eye, **options):
        seen.update(options)
        raise ic.InvalidInputError("enough")

    monkeypatch.setattr(validation, "compare", stop)
    monkeypatch.setattr(
        sys,
        "argv",
        [
            "isetcl",
            "compare",
            *["--seed", "7", "--spp", "64", "--size", "50", "--fov", "3", "-o"],
            str(tmp_path / "o"),
        ],
    )
    with pytest.raises(SystemExit):
        cli.main()
    assert (seen["seed"], seen["reference_spp"], seen["resolution"], seen["fov_deg"]) == (
        7,
        256,
        50,
        3.0,
    )
    assert seen["samples"] == [4, 16, 64]

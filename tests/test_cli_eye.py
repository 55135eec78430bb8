"""`isetcl eye` and `isetcl mtf` as a user meets them."""

import csv
import dataclasses
import json
import math
import sys

import numpy as np
import pytest
from typer.testing import CliRunner

import isetcl as ic
from isetcl import cli
from isetcl.eye.aberrations.mtf_table import mtf_table
from isetcl.eye.aberrations.summary import summarise
from isetcl.eye.pictures import overview


def run(*arguments):
    return CliRunner().invoke(cli.app, list(arguments))


def cells(text, name):
    """The cells of the table row that begins with a name."""
    row = next(line for line in text.splitlines() if line.startswith(f"│ {name} "))
    return [cell.strip() for cell in row.strip("│\n ").split("│")][1:]


def small_cornea():
    """An eye whose cornea is too small to let all light from 40 degrees pass."""
    eye = ic.eyes.navarro(2.0)
    cornea = dataclasses.replace(eye.surfaces[0], semi_diameter_mm=3.0)
    return dataclasses.replace(eye, surfaces=(cornea, *eye.surfaces[1:]))


@pytest.fixture
def few_pictures(monkeypatch):
    monkeypatch.setattr(overview.Overview, "names", staticmethod(lambda: ("lca", "zernikes")))
    monkeypatch.setattr(overview, "_PAGE", ((1.0, (("lca", 1.0), ("field_curvature", 1.0))),))


@pytest.mark.slow
def test_the_tables_of_an_eye_hold_its_numbers():
    result = run("eye", "navarro", "--accommodation", "2", "--field", "0,10", "--no-pictures")
    assert result.exit_code == 0, result.output
    eye = ic.eyes.navarro(4.0, 2.0)
    assert cells(result.output, "cornea front")[:5] == ["0", "7.72", "-0.26", "7", "1.37740"]
    assert float(cells(result.output, "stop")[3]) == 2.0
    places = [result.output.index(f"│ {name} ") for name in ("cornea back", "stop", "lens front")]
    assert places == sorted(places)
    assert float(cells(result.output, "power")[0]) == pytest.approx(eye.power_dpt(), abs=1e-3)
    assert cells(result.output, "in focus: smallest spot")[0] == "2"
    # The object lies where the eye is focused.
    assert "object 0.5 m away" in result.output
    front = eye.wavefront(10.0, object_distance_m=0.5)
    assert float(cells(result.output, "Strehl ratio")[1]) == pytest.approx(front.strehl(), rel=5e-3)
    term = float(cells(result.output, "Z(3, -1) coma, vertical")[1])
    assert term == pytest.approx(front.zernike(4).coefficient_um(3, -1), abs=1e-4)
    # What is 0 by symmetry is left out.
    assert "Z(3, 1)" not in result.output
    assert "pictures" not in result.output


def test_pictures_and_a_record_are_written(tmp_path, few_pictures):
    folder = tmp_path / "eye"
    result = run("eye", "legrand", "--pupil", "2", "--field", "5", "--out", str(folder))
    assert result.exit_code == 0, result.output
    for name in ("lca.png", "zernikes.png", "overview.png"):
        assert (folder / name).read_bytes().startswith(b"\x89PNG")
    record = json.loads((folder / "eye.json").read_text())
    assert record["eye"]["stop"]["diameter_mm"] == 2.0
    assert record["object_distance_m"] is None
    assert record["fields"][0]["field_deg"] == 5.0
    assert len(record["fields"][0]["zernike"]["coefficients_um"]) == 15


@pytest.mark.slow
def test_every_picture_of_an_eye_is_drawn(tmp_path):
    result = run("eye", "arizona", "--pupil", "3", "--field", "0,10", "-o", str(tmp_path))
    assert result.exit_code == 0, result.output
    written = {path.stem for path in tmp_path.glob("*.png")}
    assert written == {*overview.Overview.names(), "overview"}


@pytest.mark.slow
def test_what_an_eye_does_not_allow_is_left_out_and_said(tmp_path, few_pictures):
    small_cornea().to_json(tmp_path / "small.json")
    result = run("eye", str(tmp_path / "small.json"), "--field", "0,40", "--out", str(tmp_path))
    assert result.exit_code == 0, result.output
    assert cells(result.output, "spot radius, RMS (arcmin)")[1] == "–"
    assert cells(result.output, "Z(2, 0) defocus")[1] == "–"
    assert "not drawn: zernikes" in result.stderr
    assert (tmp_path / "zernikes.png").exists()


@pytest.mark.slow
def test_the_mtf_table_is_printed_and_written(tmp_path):
    result = run(
        *("mtf", "navarro", "--pupil", "3", "--field", "5", "--frequency", "0,10,30"),
        *("--step", "100", "-o", str(tmp_path)),
    )
    assert result.exit_code == 0, result.output
    eye = ic.eyes.navarro(3.0)
    expected = eye.wavefront(5.0).otf().mtf([0.0, 10.0, 30.0], 90.0)
    shown = [float(c) for c in cells(result.output, "550 nm, diffraction, tangential")]
    np.testing.assert_allclose(shown, expected, atol=6e-4)
    assert shown[0] == 1.0
    rows = list(csv.DictReader((tmp_path / "mtf.csv").open()))
    assert [float(row["frequency_cpd"]) for row in rows] == [0.0, 10.0, 30.0]
    column = [float(row["photopic_geometric_sagittal"]) for row in rows]
    # Photopic light of 410, 510 and 610 nm.
    grid = {"wavelengths_nm": [410.0, 510.0, 610.0], "model": "geometric"}
    wanted = eye.polychromatic_mtf([0.0, 10.0, 30.0], field_deg=5.0, orientation_deg=0.0, **grid)
    np.testing.assert_allclose(column, wanted, atol=1e-9)
    record = json.loads((tmp_path / "mtf.json").read_text())
    assert record["mtf"]["photopic_geometric_sagittal"] == pytest.approx(column)
    assert (tmp_path / "mtf.png").stat().st_size > 5000


@pytest.mark.slow
def test_sections_that_are_alike_share_a_row_and_refused_ones_are_empty():
    eye = ic.eyes.navarro(3.0)
    table = mtf_table(eye, [10.0], step_nm=150.0)
    assert [section for *_, section, _ in table.curves()] == [None] * 4
    dark = mtf_table(small_cornea(), [10.0], 40.0, step_nm=150.0)
    assert "vignetted" in dark.refused["monochromatic_geometric"]
    lights = {(light, model): values for light, model, _, values in dark.curves()}
    assert lights["monochromatic", "geometric"] is None
    assert lights["monochromatic", "diffraction"].shape == (1,)


def test_an_eye_may_come_from_a_file(tmp_path):
    path = tmp_path / "mine.json"
    ic.eyes.navarro(5.0).to_json(path)
    only = ("--no-pictures", "--field", "0")
    result = run("eye", str(path), *only)
    assert result.exit_code == 0, result.output
    assert float(cells(result.output, "stop")[3]) == 2.5
    result = run("eye", str(path), *only, "--pupil", "3")
    assert float(cells(result.output, "stop")[3]) == 1.5


BAD = [
    (["eye", "navaro"], "did you mean navarro"),
    (["eye", "none.json"], "'none.json' does not exist"),
    (["eye", "navarro", "--field", "0;5"], "--field must be numbers with commas"),
    (["eye", "navarro", "--field", "200"], "field angle must be at most"),
    (["eye", "navarro", "--wavelength", "100"], "wavelength must lie between"),
    (["eye", "navarro", "--wavelength", "-5"], "--wavelength must be > 0 nm"),
    (["eye", "navarro", "--pupil", "0"], "pupil_diameter_mm must be > 0"),
    (["eye", "navarro", "--accommodation", "50"], "move the object farther away"),
    (["eye", "navarro", "--accommodation", "centre"], "or 'relaxed', got 'centre'"),
    (["eye", "navarro", "--distance", "-1"], "--distance must be > 0 m"),
    (["eye", "navarro", "--distance", "0.001"], "object_distance_m must be >= 0.01 m"),
    (["eye", "navarro", "--out", "/proc/nowhere"], "cannot write into folder"),
    (["mtf", "navarro", "--frequency", "5,-1"], "--frequency must be >= 0"),
    (["mtf", "navarro", "--step", "0"], "--step must be > 0 nm"),
    (["mtf", "legrand", "--accommodation", "2"], "--accommodation relaxed"),
    (["mtf"], "name one eye, as EYE or with --eye"),
    (["mtf", "navarro", "--eye", "arizona"], "got 'navarro' and 'arizona'"),
    (["mtf", "navarro", "--population", "some.npz"], "add --plot"),
    (["mtf", "navarro", "--plot", "--population", "none.npz"], "'none.npz' does not exist"),
    (["mtf", "navarro", "--plot", "--spp", "1"], "--spp must be >= 2"),
]


@pytest.mark.parametrize(("arguments", "message"), BAD, ids=[" ".join(b[0]) for b in BAD])
def test_bad_input_is_explained_without_a_traceback(arguments, message, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["isetcl", *arguments])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    assert stopped.value.code == 2
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.out == ""


def test_a_summary_gathers_what_the_eye_answers():
    eye = ic.eyes.navarro(3.0)
    found = summarise(eye, [0.0, 8.0], 600.0)
    assert found.lca_dpt == pytest.approx(np.ptp(eye.lca_dpt([400.0, 700.0])))
    assert found.focus_rms_dpt == pytest.approx(eye.focus_vergence_dpt(600.0))
    assert math.isinf(found.object_distance_m)
    field = found.fields[1]
    assert field.spot_rms_arcmin == pytest.approx(eye.spot(8.0, 600.0).rms_arcmin)
    foci = eye.oblique_foci(8.0, 600.0)
    assert (field.tangential_dpt, field.sagittal_dpt) == (
        foci.tangential_dpt[0],
        foci.sagittal_dpt[0],
    )
    json.dumps(found.as_dict())

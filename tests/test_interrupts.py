"""Ctrl-C ends what goes on from a render, and says so: half an image is not taken for a whole."""

import importlib
import json
import types

import pytest
from typer.testing import CliRunner

import isetcl as ic
from isetcl.cli import app, cones, eye
from isetcl.figures import Quality
from isetcl.validation import SceneMethod
from isetcl.validation.work_precision import scene_method

RENDER = importlib.import_module("isetcl.render.render")
EYE = ic.eyes.navarro(3.0)
SCENE = ic.scenes.uniform()
TRACED = RENDER.render


def half(*_, **__):
    return types.SimpleNamespace(provenance={"is_complete": False})


@pytest.fixture
def interrupted(monkeypatch):
    monkeypatch.setattr(RENDER, "render", half)
    monkeypatch.setattr(scene_method, "render", half)


def turning():
    mosaic = ic.cones.ConeMosaic.from_positions([[0, 0], [0.01, 0]], [0, 1], spacing_um=3.0)
    ic.cones.excitations_of_turning_eye(mosaic, SCENE, EYE, [[0, 0]], fov_deg=1, resolution=8)


def measured():
    method = SceneMethod("ray_tracing", "spp", (4,))
    method.on(SCENE, EYE, {"fov_deg": 1.0, "resolution": 8}, None).run(4.0, 0)


@pytest.mark.parametrize(
    "work",
    [
        lambda: Quality(is_draft=True).render(SCENE, EYE),
        lambda: ic.validation.three_mtfs(EYE, spp=2),
        turning,
        measured,
    ],
    ids=["figure", "three MTFs", "turning eye", "work precision"],
)
def test_half_an_image_is_not_worked_with(work, interrupted):
    with pytest.raises(KeyboardInterrupt):
        work()


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (["figures", "2", "--draft"], "interrupted while figure 2 was drawn"),
        (
            ["mtf", "navarro", "--plot", "--frequency", "5", "--step", "100"],
            "interrupted before the edge was measured",
        ),
    ],
    ids=["figures", "mtf"],
)
def test_the_command_says_that_it_was_interrupted(
    command, words, interrupted, monkeypatch, tmp_path
):
    monkeypatch.setattr(eye, "_write_mtf", lambda *_: None)
    found = CliRunner().invoke(app, [*command, "-o", str(tmp_path)])
    assert found.exit_code == 130
    assert words in found.stderr


def test_cones_go_on_with_the_image_so_far_and_say_so(monkeypatch, tmp_path):
    def interrupted(*arguments, **options):
        image = TRACED(*arguments, **options)
        details = image.provenance | {"is_complete": False}
        image.dataset.attrs["provenance"] = json.dumps(details)
        return image

    monkeypatch.setattr(RENDER, "render", interrupted)
    monkeypatch.setattr(cones, "_pictures", lambda *_: [])
    command = ["cones", "uniform", "--fov", "0.05", "--size", "8", "--spp", "2", "--movie", "20"]
    found = CliRunner().invoke(app, [*command, "-o", str(tmp_path)])
    assert found.exit_code == 130
    assert "interrupted; the image of the scene holds what was finished" in found.stderr
    assert (tmp_path / "excitations.nc").exists()
    assert not (tmp_path / "fixation.gif").exists()

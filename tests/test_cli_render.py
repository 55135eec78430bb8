"""`isetcl render` as a user meets it."""

import inspect
import math
import signal
import sys

import numpy as np
import pytest

import isetcl as ic
from isetcl import cli
from isetcl.cli import inputs
from isetcl.scene import extent

TINY = ["--size", "12", "--spp", "4"]

SQUARE = """v -0.1 -0.1 -1
v 0.1 -0.1 -1
v 0.1 0.1 -1
v -0.1 0.1 -1
f 1 2 3
f 1 3 4
"""


@pytest.fixture
def isetcl(tmp_path, monkeypatch, capsys):
    """Run the command in an empty folder: exit status, standard output, standard error."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["isetcl", "render", *arguments])
        try:
            cli.main()
            status = 0
        except SystemExit as stopped:
            status = stopped.code
        printed = capsys.readouterr()
        return status, printed.out, printed.err

    return run


def test_a_target_becomes_an_image_and_a_picture(isetcl, tmp_path):
    from PIL import Image

    status, out, _ = isetcl("two-planes", "--size", "12x8", "--spp", "4", "-o", "o", "--seed", "3")
    assert status == 0
    assert "retina.nc, retina.png in o/" in out
    image = ic.RetinalImage.load(tmp_path / "o" / "retina.nc")
    assert image.irradiance.shape == (31, 8, 12)
    assert image.dataset.attrs["command"].startswith("isetcl render two-planes --size 12x8")
    assert Image.open(tmp_path / "o" / "retina.png").size == (12, 8)
    assert sorted(p.name for p in (tmp_path / "o").iterdir()) == ["retina.nc", "retina.png"]


@pytest.mark.slow
def test_layers_are_written_as_data_and_pictures(isetcl, tmp_path):
    assert isetcl("letters_at_depth", *TINY, "--layers", "-o", "o")[0] == 0
    assert {p.name for p in (tmp_path / "o").iterdir()} == {
        *("retina.nc", "retina.png", "depth.png", "object.png", "normal.png")
    }
    data = ic.RetinalImage.load(tmp_path / "o" / "retina.nc").dataset
    assert {"distance_m", "object", "normal", "albedo"} <= set(data.data_vars)
    # Beside the letters stands a wall, 2 m away.
    assert float(data["distance_m"].max()) == pytest.approx(2.0, rel=0.05)


@pytest.mark.slow
def test_a_file_without_light_is_lit_by_a_sky_and_the_user_is_told(isetcl, tmp_path):
    (tmp_path / "square.obj").write_text(SQUARE)
    status, _, err = isetcl("square.obj", *TINY, "--fov", "4")
    assert status == 0
    assert "scene 'square' has no light: an even sky of 100 cd/m^2 lights it" in err
    assert "focused on what stands in the middle of the image, 1 m away" in err
    lit = ic.RetinalImage.load(tmp_path / "isetcl-render" / "retina.nc").illuminance_lux
    assert isetcl("square.obj", *TINY, "--fov", "4", "--sky", "300")[0] == 0
    brighter = ic.RetinalImage.load(tmp_path / "isetcl-render" / "retina.nc").illuminance_lux
    assert float(brighter.mean() / lit.mean()) == pytest.approx(3.0, rel=1e-5)


def test_an_eye_that_sees_nothing_is_told_where_to_stand(isetcl, tmp_path):
    (tmp_path / "square.obj").write_text(SQUARE.replace("-1\n", "1\n"))
    status, _, err = isetcl("square.obj", *TINY, "--fov", "4")
    assert status == 0
    assert "no object is in sight" in err
    advice = err.split("--from ")[1].split()
    assert isetcl("square.obj", *TINY, "--from", advice[0], "--look-at", advice[2])[0] == 0
    image = ic.RetinalImage.load(tmp_path / "isetcl-render" / "retina.nc")
    assert float(image.vergence_dpt.max()) > 0


def test_explain_prints_the_plan_and_renders_nothing(isetcl, tmp_path):
    status, out, _ = isetcl("two_planes", "--explain", "--pupil", "3")
    assert status == 0
    assert out.startswith("precision")
    assert "emission only" in out
    assert not list(tmp_path.iterdir())


BAD = [
    (["cornel_box"], "did you mean cornell_box?"),
    (["nothing.pbrt"], "scene file 'nothing.pbrt' does not exist"),
    (["scene.pbrtt"], "did you mean scene.pbrt"),
    (["nowhere/scene.pbrt"], "there is no folder 'nowhere'"),
    (["."], "is a folder"),
    (["notes.txt"], "no known suffix"),
    (["uniform", "--accommodation", "0.5feet"], "a distance (0.5m)"),
    (["uniform", "--accommodation", "-1m"], "must be > 0 m"),
    (["uniform", "--accommodation", "50"], "move the object farther away"),
    (["uniform", "--fov", "-3"], "--fov must be > 0 deg"),
    (["uniform", "--fov", "nan"], "--fov must be finite"),
    (["uniform", "--fov", "400"], "reduce fov_deg"),
    (["uniform", "--size", "big"], "columns x rows"),
    (["uniform", "--size", "-5"], "columns x rows"),
    (["uniform", "--size", "0"], "must be between 1 and"),
    (["uniform", "--size", "99999"], "must be between 1 and"),
    (["uniform", "--spp", "1"], "spp must be between 2"),
    (["uniform", "--spp", "16", "--error", "0.1"], "give --spp, or --error and --time"),
    (["uniform", "--error", "0"], "target_error must be > 0"),
    (["uniform", "--error", "little"], "'cone_noise:RATIO'"),
    (["uniform", "--error", "cone_noise:0"], "ratio must be > 0"),
    (["uniform", "--time", "-1"], "time_budget_s must be > 0"),
    (["uniform", "--max-bounces", "-1"], "max_bounces must be"),
    (["uniform", "--from", "1,2"], "--from must be three numbers"),
    (["uniform", "--from", "1,2,inf"], "--from must be three numbers"),
    (["uniform", "--look-at", "a,b,c"], "--look-at must be three numbers"),
    (["uniform", "--look-at", "0,0,0"], "must be another point than --from"),
    (["uniform", "--error", "5"], "0.02 stands for 2 %"),
    (["outside.pbrt"], "pass --allow-outside"),
    (["uniform", "--sky", "0"], "--sky must be > 0 cd/m^2"),
    (["uniform", "--eye", "navaro"], "did you mean navarro"),
    (["uniform", "--pupil", "-2"], "pupil_diameter_mm must be > 0"),
    (["uniform", "--seed", "-2"], "seed must be"),
    (["uniform", "--device", "abacus"], "no OpenCL device matches"),
    (["uniform", "--output", "/proc/nowhere"], "cannot write into folder"),
]


@pytest.mark.parametrize(("arguments", "message"), BAD, ids=[" ".join(b[0]) for b in BAD])
def test_bad_input_is_explained_without_a_traceback(arguments, message, isetcl, tmp_path):
    (tmp_path / "notes.txt").write_text("no scene")
    outside = 'WorldBegin Shape "plymesh" "string filename" "../a.ply"'
    (tmp_path / "outside.pbrt").write_text(outside)
    (tmp_path / "scene.pbrt").write_text("WorldBegin")
    status, _, err = isetcl(*arguments)
    assert status == 2
    assert err.startswith("isetcl: ")
    assert message in err
    assert not list(tmp_path.glob("**/*.nc"))


def test_the_options_reach_the_renderer(isetcl, monkeypatch):
    seen = {}

    def stop(scene, eye, **options):
        seen.update(options, eye=eye, scene=scene)
        raise ic.InvalidInputError("enough")

    monkeypatch.setattr(sys.modules["isetcl.render.render"], "render", stop)
    isetcl(
        *("two_planes", "--error", "0.1", "--time", "3", "--max-bounces", "2", "--fov", "1.5"),
        *("--seed", "9", "--layers", "--accommodation", "50cm", "--pupil", "3", "--eye", "arizona"),
        *("--from", "-0.1,0,1", "--look-at", "-0.1,0,0"),
    )
    names = ("target_error", "time_budget_s", "max_bounces", "fov_deg", "seed", "layers", "spp")
    assert [seen[n] for n in names] == [0.1, 3.0, 2, 1.5, 9, True, None]
    assert seen["eye"].name == "arizona"
    assert seen["eye"].focus_vergence_dpt() == pytest.approx(2.0, abs=1e-4)
    # The near plane, 0.5 m ahead of the origin, is 1.5 m ahead of an eye 1 m behind it.
    assert seen["scene"].objects[0].shape.corner_m[2] == pytest.approx(-1.5)


@pytest.mark.parametrize(("at", "status"), [(2, 130), (0, 130)])
def test_ctrl_c_keeps_what_is_done(at, status, isetcl, tmp_path, monkeypatch):
    from isetcl.render import goal

    work = goal.Goal.work

    def interrupted(self, film):
        for fraction in work(self, film):
            if film.replicates >= at:
                signal.raise_signal(signal.SIGINT)
            yield fraction

    monkeypatch.setattr(goal.Goal, "work", interrupted)
    got, _, err = isetcl("two_planes", "--size", "12", "--spp", "512", "-o", "o")
    assert got == status
    if at == 0:
        assert "interrupted before there was an image" in err
        assert not list(tmp_path.glob("**/*.nc"))
    else:
        assert "the image holds what was finished" in err
        image = ic.RetinalImage.load(tmp_path / "o" / "retina.nc")
        assert image.provenance["is_complete"] is False


def test_every_target_that_needs_no_arguments_is_offered():
    ready = {
        name
        for name in ic.scenes.__all__
        if inspect.isfunction(getattr(ic.scenes, name))
        and inspect.signature(getattr(ic.scenes, name)).return_annotation == "Scene"
        and all(
            p.default is not p.empty
            for p in inspect.signature(getattr(ic.scenes, name)).parameters.values()
        )
    }
    assert ready | {"textured_plane"} == set(inputs.TARGETS)


def test_accommodation_is_dioptres_a_distance_or_a_word():
    for text, value in (("2", 2.0), ("2 dpt", 2.0), ("1.5D", 1.5), ("0.5m", 2.0), ("25cm", 4.0)):
        assert inputs.vergence(text) == pytest.approx(value)
    assert inputs.vergence("400 mm") == pytest.approx(2.5)
    assert inputs.vergence("Relaxed") == "relaxed"


def test_the_eye_focuses_on_what_stands_ahead_if_it_can(capsys):
    def at(distance):
        return ic.scenes.siemens_star(distance)

    assert inputs.accommodated("navarro", 4.0, "centre", at(0.4)).focus_vergence_dpt() == (
        pytest.approx(2.5, abs=1e-3)
    )
    relaxed = ic.eyes.navarro(4.0)
    far = (at(6.0), "beyond its far point")
    for scene, message in (far, (at(0.05), "too near"), (ic.scenes.uniform(), "nothing stands")):
        assert inputs.accommodated("navarro", 4.0, "centre", scene).surfaces == relaxed.surfaces
        assert message in capsys.readouterr().err


def test_light_decides_which_white_looks_neutral():
    assert inputs.white_point(ic.scenes.letters_at_depth()) == "E"
    assert inputs.white_point(ic.scenes.macbeth_chart()) == "D65"
    d65 = ic.Scene(background=ic.Spectrum.illuminant("D65", 10.0))
    assert inputs.white_point(d65) == "D65"


def test_the_box_around_a_scene_holds_every_kind_of_shape():
    tetrahedron = ic.Mesh(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    )
    turned = np.array([[0, -1, 0, 2], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    grey = ic.Diffuse(ic.Spectrum.constant(0.5))
    cases = (
        (ic.Sphere((1, 2, 3), 0.5), [[0.5, 1.5, 2.5], [1.5, 2.5, 3.5]]),
        (ic.Disc((0, 0, -1), 2.0, (0, 0, 1)), [[-2, -2, -1], [2, 2, -1]]),
        (
            ic.Disc((0, 0, 0), 1.0, (0, 1, 1)),
            [[-1, -(0.5**0.5), -(0.5**0.5)], [1, 0.5**0.5, 0.5**0.5]],
        ),
        (ic.Quad((0, 0, 0), (1, 0, 0), (0, 1, -1)), [[0, 0, -1], [1, 1, 0]]),
        (tetrahedron, [[0, 0, 0], [1, 1, 1]]),
        (ic.Instance(tetrahedron, turned), [[1, 0, 0], [2, 1, 1]]),
    )
    for shape, box in cases:
        scene = ic.Scene((ic.SceneObject("it", shape, grey),))
        np.testing.assert_allclose(extent.box_m(scene), box, atol=1e-12)
    assert extent.box_m(ic.scenes.uniform()) is None


def test_what_stands_ahead_is_found_on_every_kind_of_shape():
    grey = ic.Diffuse(ic.Spectrum.constant(0.5))

    def ahead(*shapes, opacity=1.0):
        objects = [ic.SceneObject("it", s, grey, opacity=opacity) for s in shapes]
        return extent.middle_ahead_m(ic.Scene(tuple(objects)))

    behind, near, far = (
        ic.Mesh([[-1, -1, z], [1, -1, z], [0, 1, z + 1]], [[0, 1, 2]]) for z in (3, -2, -5)
    )
    # The middle of a triangle that leans by 45 degrees is halfway up.
    assert ahead(behind, far, near) == pytest.approx(1.5)
    shift = np.eye(4)
    shift[2, 3] = 1.0
    assert ahead(ic.Instance(near, shift)) == pytest.approx(0.5)
    assert ahead(ic.Sphere((0, 0, -3), 1.0), far) == pytest.approx(2.0)
    assert ahead(ic.Sphere((0, 0, -3), 1.0), opacity=0.2) == math.inf
    shift[0, 3] = 5.0
    assert ahead(ic.Instance(near, shift)) == math.inf
    assert ahead(behind) == math.inf


def test_a_lamp_in_sight_does_not_decide_the_exposure_of_a_room():
    room, stars = ic.scenes.cornell_box(), ic.scenes.point_grid()
    lux = np.full((20, 20), 1.0)
    lux[0, :4] = 100.0
    assert inputs.exposure_lux(room, lux) == pytest.approx(3.0)
    # Lights alone, and things before the dark, are shown by their own brightness.
    assert inputs.exposure_lux(stars, lux) == pytest.approx(100.0)
    lux[1:] = 0.0
    lux[0] = 50.0
    assert inputs.exposure_lux(room, lux) == pytest.approx(50.0)
    assert inputs.exposure_lux(room, 0.0 * lux) == 0.0


def test_an_eye_may_look_straight_down_with_minus_z_on_top():
    ball = ic.SceneObject(
        "ball", ic.Sphere((0, 0, -0.5), 0.1), ic.Diffuse(ic.Spectrum.constant(0.5))
    )
    seen = inputs.placed(ic.Scene((ball,)), "0,2,0", "0,0,0").objects[0].shape
    np.testing.assert_allclose(seen.centre_m, (0, 0.5, -2), atol=1e-12)


def test_advice_is_in_the_frame_of_the_scene_wherever_the_eye_stands(isetcl, tmp_path):
    (tmp_path / "square.obj").write_text(SQUARE)
    _, _, err = isetcl("square.obj", *TINY, "--fov", "4", "--from", "0,0,-3")
    assert "y -0.1 to 0.1, z -1 to -1 m" in err


def test_a_file_without_objects_is_told(isetcl, tmp_path):
    (tmp_path / "empty.pbrt").write_text('WorldBegin LightSource "infinite"')
    assert "holds no objects" in isetcl("empty.pbrt", *TINY)[2]


def test_an_eye_inside_an_object_is_told_so(isetcl, tmp_path):
    import trimesh

    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.stl")
    status, _, err = isetcl("box.stl", *TINY)
    assert status == 0
    assert "does the eye stand inside an object?" in err
    assert "to see them whole: --from" in err


def test_the_bar_keeps_the_last_error_it_was_told():
    from isetcl.render.progress import Progress, ProgressBar

    bar = ProgressBar("tracing")
    for error in (math.nan, 0.071, math.nan):
        bar(Progress(0.1, error, 1.0))
    assert bar._bar.tasks[0].fields["error"] == "error 7.1 %"

"""The occlusion study: closed forms of thin lenses, the paper's Figure 12, and going on."""

import functools

import numpy as np
import pytest

import isetcl as ic
from isetcl.validation import occlusion_study
from isetcl.validation.occlusion import cells
from isetcl.validation.occlusion.edge_scene import EdgeScene

NEAR_M, FAR_M = 0.5, 2.0
# Between the planes, so that the near one is blurred twice as much: dD 1.0 and 0.5 dpt.
BETWEEN_DPT = 1.0
LAYERED = (
    *("layered_sum", "layered_normalized", "layered_over_visible", "layered_over_normalized"),
    *("ikoma", "gather", "layered_over", "pupil_clipped"),
)


@functools.cache
def navarro(pupil_mm, focus_dpt):
    """Focusing takes a while: tests share eyes."""
    return ic.eyes.navarro(pupil_mm, focus_dpt, pupil_plane="entrance")


# Largest error and integral in units of the larger blur radius, near plane 0, far plane 1: the
# survey's table of edge errors, computed from the disc's edge function
# 1/2 - (t sqrt(1 - t^2) + asin t) / pi; the sum's integral is 4 / (3 pi).
TABLE = {
    "near": {
        "layered_sum": (0.50, 0.42),
        "layered_normalized": (0.33, 0.16),
        "layered_over_visible": (0.50, 0.21),
        "layered_over_normalized": (0.0, 0.0),
        "ikoma": (0.004, 0.004),
        "gather": (0.50, 0.21),
        "layered_over": (0.0, 0.0),
        "pupil_clipped": (0.0, 0.0),
    },
    "far": {
        "layered_sum": (0.50, 0.42),
        "layered_normalized": (0.50, 0.26),
        "layered_over_visible": (0.50, 0.21),
        "layered_over_normalized": (0.50, 0.21),
        "ikoma": (0.50, 0.22),
        "gather": (0.50, 0.21),
        "layered_over": (0.0, 0.0),
        "pupil_clipped": (0.0, 0.0),
    },
    "1": {
        "layered_sum": (0.20, 0.21),
        "layered_over_visible": (0.28, 0.23),
        "layered_over_normalized": (0.195, 0.04),
        "ikoma": (0.195, 0.05),
        "gather": (0.20, 0.11),
        "layered_over": (0.0, 0.0),
        "pupil_clipped": (0.0, 0.0),
    },
}
BLUR_DPT = {"near": 1.5, "far": 1.5, "1": 1.0}


def thin_study(methods, focus):
    return occlusion_study(
        methods,
        focus=focus,
        pupil_mm=(4.0,),
        contrast=(0.0,),
        levels=(0.0, 1.0),
        thin_lens=True,
        columns=80,
        oversampling=2,
        eye=navarro,
    )


@pytest.fixture(scope="module")
def thin():
    return thin_study(LAYERED, ("near", "far", BETWEEN_DPT))


@pytest.fixture(scope="module")
def thin_near():
    return thin_study(("layered_sum", "layered_normalized", "layered_over"), ("near",))


def cell(study, focus, kind, **place):
    own = study.dataset.sel(focus=focus, kind=kind)
    return own.isel({d: place.get(d, 0) for d in own.dims if d != "offset"})


def check_table(study, focus):
    radius_arcmin = np.degrees(2e-3 * BLUR_DPT[focus]) * 60.0
    for kind in study.dataset["kind"].values.tolist():
        if kind not in TABLE[focus]:
            continue
        largest, integral = TABLE[focus][kind]
        own = cell(study, focus, kind)
        # A pixel averages the jump at the edge, whose slope is 2 / (pi radius): half of it where
        # its border is the edge, all where the jump lies in a pixel, as at a blur radius.
        pixel = 10.3132 / 16.0 / radius_arcmin * 2.0 / np.pi
        allowed = (1.0 if focus == "1" else 0.5) * pixel + 0.005
        assert own["largest"].item() == pytest.approx(largest, abs=allowed), kind
        measured = own["integral_arcmin"].item() / radius_arcmin
        assert measured == pytest.approx(integral, abs=0.008), kind


def test_a_thin_lens_focused_near_has_the_closed_forms_errors(thin_near):
    check_table(thin_near, "near")


@pytest.mark.slow
@pytest.mark.parametrize("focus", TABLE)
def test_thin_lenses_have_the_closed_forms_errors(thin, focus):
    check_table(thin, focus)


def check_strip(study, focus):
    # 4 mm, 0.5 and 2 m: a |D1 - D2| = 2e-3 m x 1.5 dpt = 10.31 arcmin, whatever is in focus.
    own = cell(study, focus, "layered_sum")
    assert own["half_width_arcmin"].item() == pytest.approx(10.3132, abs=1e-3)
    # From the integral 4 / (3 pi) of the half-width, and from where the error ends.
    measured = own["integral_arcmin"].item() * 3.0 * np.pi / 4.0
    assert measured == pytest.approx(10.3132, rel=0.01)
    error = np.abs(own["profile"].values)
    assert error[np.abs(own["offset"].values) > 1.0].max() < 1e-3
    assert error[np.abs(own["offset"].values) < 0.95].min() > 5e-3
    # The edge function falls to 0.05 at t = 0.8054.
    pixel = 2 * 2.5 * 10.3132 / 80
    assert own["reach_arcmin"].item() == pytest.approx(0.8054 * 10.3132, abs=pixel)


def test_the_strip_of_the_paper_is_10_arcmin_each_side(thin_near):
    check_strip(thin_near, "near")


@pytest.mark.slow
def test_the_strip_is_as_wide_with_the_far_plane_in_focus(thin):
    check_strip(thin, "far")


def test_the_thin_lens_image_is_the_share_of_the_pupil_that_sees_each_plane():
    edge = EdgeScene(NEAR_M, FAR_M, near_level=0.2, far_level=0.9)
    x = np.linspace(-0.3, 0.3, 61)
    image = edge.thin_lens_image(x, np.array([0.0]), 1e-6, 4.0, FAR_M)[0]
    t = np.clip(x / (edge.half_width_arcmin(4.0) / 60.0), -1.0, 1.0)
    on_near = 0.5 - (t * np.sqrt(1.0 - t * t) + np.arcsin(t)) / np.pi
    np.testing.assert_allclose(image, 0.2 * on_near + 0.9 * (1.0 - on_near), atol=1.5e-3)


def test_checks_of_an_edge_scene_have_its_contrast_frequency_and_level():
    edge = EdgeScene(NEAR_M, FAR_M, 0.6, 2.0, 1.0, 0.5)
    eye = ic.eyes.navarro(4.0)
    depth_m = eye.entrance_pupil(550.0).z_mm / 1000.0
    view = ic.pinhole(
        edge.scene(depth_m), eye, fov_deg=2.0, resolution=128, wavelengths_nm=np.array([550.0])
    )
    white = ic.Spectrum.equal_energy(100.0).at(np.array([550.0]))[0]
    seen = view.radiance.values.reshape(-1, 128, 128)[0] / white
    x, y = np.meshgrid(view.radiance["x"], view.radiance["y"])
    level = np.where(x < 0, 1.0, 0.5)
    expected = np.where(x < 0, edge.radiance(1.0, x, y), edge.radiance(0.5, x, y))
    assert np.mean(np.abs(seen - expected) > 1e-3) < 0.02
    for side in (x < 0, x > 0):
        own = (seen / level)[side]
        assert (own.max() - own.min()) / (own.max() + own.min()) == pytest.approx(0.6, abs=1e-4)


@pytest.fixture(scope="module")
def figure_12():
    return occlusion_study(
        ("layered_sum", "layered_over", "pupil_clipped"),
        focus=("near",),
        pupil_mm=(4.0,),
        frequency_cpd=(2.0,),
        columns=40,
        reference_spp=512,
        eye=navarro,
    )


@pytest.mark.slow
def test_the_paper_s_figure_12_sums_are_wrong_near_the_edge_only(figure_12):
    wrong = cell(figure_12, "near", "layered_sum")
    assert wrong["strip_rms"].item() > 0.15
    assert wrong["outside_rms"].item() < 0.1 * wrong["strip_rms"].item()
    # The error ends within the strip, by less than half of it.
    assert 0.5 * 10.3132 < wrong["reach_arcmin"].item() < 1.1 * 10.3132
    right = cell(figure_12, "near", "pupil_clipped")
    assert right["strip_rms"].item() < 0.15 * wrong["strip_rms"].item()
    # The sum adds light on the near side, that of the far plane.
    assert wrong["profile"].values[12:20].mean() > 0.05


def test_where_no_error_is_found_the_figure_shows_the_one_there_may_be():
    import xarray
    from matplotlib.figure import Figure

    from isetcl.validation.occlusion.picture import _draw_by

    errors = {"rms": [0.0, 0.2], "rms_low": [0.0, 0.1], "rms_high": [0.05, 0.3]}
    data = xarray.Dataset(
        {f"strip_{k}": (("kind", "pupil_mm"), [v]) for k, v in errors.items()},
        {"kind": ["layered_sum"], "pupil_mm": [2.0, 4.0]},
    )
    ax = Figure().subplots()
    _draw_by(data, "pupil_mm", {"layered_sum": "k"}, ax)
    marks = {line.get_marker(): line.get_xydata() for line in ax.lines}
    np.testing.assert_allclose(marks["v"], [(2.0, 5.0)])
    np.testing.assert_allclose(marks["o"], [(4.0, 20.0)])


@pytest.mark.slow
def test_table_figure_and_file_tell_the_same(figure_12, tmp_path):
    import xarray

    lines = figure_12.table().splitlines()
    assert len(lines) == 1 + 3
    assert lines[1].split()[:8] == ["0.5", "2", "near", "4", "0.9", "2", "layered_sum", "10.3"]
    figure = figure_12.plot()
    left, right = figure.axes[:2]
    assert [t.get_text() for t in left.get_yticklabels()] == [
        "layered sum", "layered over", "pupil clipped",
    ]  # fmt: skip
    labels = right.get_legend_handles_labels()[1]
    assert sorted(labels) == ["layered over", "layered sum", "pupil clipped"]
    with xarray.open_dataset(figure_12.save(tmp_path / "study.nc"), engine="h5netcdf") as data:
        np.testing.assert_array_equal(data["strip_rms"], figure_12.dataset["strip_rms"])
    with pytest.raises(ic.FileError, match="cannot write"):
        figure_12.save(tmp_path / "no" / "study.nc")


def test_the_noise_of_the_reference_is_no_error():
    wavelengths = np.array([550.0])
    work = cells.Work(
        *(("one",), wavelengths, (1.0, 1.0), navarro, False, 60, 2.5, 64, 0, None, 0.02),
        *("geometric", 1, 2),
    )
    rng = np.random.default_rng(3)
    error = 0.05
    noise = np.full((1, 20, 60), error**2)
    off = error * rng.standard_normal((1, 1, 20, 60))
    found = work._errors(off, noise, 10.0, np.array([15.0]), 7)
    # 480 pixels: the mean square is known to 6.5 %.
    assert found["strip_rms"].item() < 0.5 * error
    assert found["strip_rms_low"].item() == 0.0
    assert 0.0 < found["away_rms_high"].item() < 0.6 * error
    assert found["reach_arcmin"].item() == 0.0
    off[..., 24:36] += 0.2
    # Where light is still blurred to: in the outside, not away.
    off[..., 45:48] += 0.3
    found = work._errors(off, noise, 10.0, np.array([15.0]), 7)
    assert found["strip_rms"].item() == pytest.approx(0.2 * np.sqrt(12 / 24), rel=0.05)
    assert found["strip_rms_low"].item() < 0.2 * np.sqrt(0.5) < found["strip_rms_high"].item()
    assert found["reach_arcmin"].item() == pytest.approx(6 * 50.0 / 60)
    assert found["strip_bias"].item() == pytest.approx(0.1, rel=0.1)
    assert found["outside_rms"].item() == pytest.approx(0.3 * np.sqrt(3 / 36), rel=0.1)
    assert found["away_rms_low"].item() == 0.0
    # A field that blur fills has no pixels away from the edge.
    assert np.isnan(work._errors(off, noise, 10.0, np.array([30.0]), 7)["away_rms"].item())


SMALL = {
    "methods": ("layered_sum",),
    "focus": ("near",),
    "pupil_mm": (4.0,),
    "columns": 24,
    "oversampling": 4,
    "reference_spp": 512,
    "eye": navarro,
}


@functools.cache
def small_study():
    return occlusion_study(**SMALL).dataset.squeeze()


def arizona(pupil_mm, focus_dpt):
    return ic.eyes.arizona(pupil_mm, focus_dpt, pupil_plane="entrance")


def width(data, region="away"):
    """Of the interval of the mean square error."""
    return (data[f"{region}_rms_high"] ** 2 - data[f"{region}_rms_low"] ** 2).item()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "holds"),
    [
        # Half-widths are a |D1 - D2|; planes nearer together make smaller errors.
        ({"near_m": (1.0,)}, lambda new, old: new.half_width_arcmin * 3 == old.half_width_arcmin),
        ({"far_m": (1.0,)}, lambda new, old: new.half_width_arcmin * 1.5 == old.half_width_arcmin),
        ({"pupil_mm": (2.0,)}, lambda new, old: new.half_width_arcmin * 2 == old.half_width_arcmin),
        # Checks that the far plane's blur does not wipe out make the sum more wrong.
        ({"focus": ("far",)}, lambda new, old: new.strip_rms > 1.2 * old.strip_rms),
        ({"focus": (1.0,)}, lambda new, old: new.blur_reach_arcmin < 0.9 * old.blur_reach_arcmin),
        # Even planes have nothing to be blurred away from the edge, and not much noise.
        ({"contrast": (0.0,)}, lambda new, old: new.away_rms_high < 1e-3),
        ({"contrast": (0.3,)}, lambda new, old: 2 * new.away_rms_high < old.away_rms_high),
        ({"frequency_cpd": (1.0,)}, lambda new, old: new.strip_rms != old.strip_rms),
        # Blue light is blurred more where green is in focus.
        (
            {"wavelengths_nm": (450.0,)},
            lambda new, old: new.blur_reach_arcmin > 1.3 * old.blur_reach_arcmin,
        ),
        # Before a dark far plane the near one in focus is all there is.
        ({"levels": (1.0, 0.0)}, lambda new, old: new.strip_rms < 0.1 * old.strip_rms),
        ({"levels": (2.0, 2.0)}, lambda new, old: abs(new.strip_rms / old.strip_rms - 2) < 0.02),
        ({"eye": arizona}, lambda new, old: abs(new.blur_reach_arcmin - old.blur_reach_arcmin) > 0),
        ({"span": 2.0}, lambda new, old: new.offset.max() < old.offset.max()),
        ({"columns": 36}, lambda new, old: new.sizes["offset"] == 36),
        ({"reach_error": 0.2}, lambda new, old: new.reach_arcmin < old.reach_arcmin),
        # A quarter of the samples: noise of twice the size or more.
        ({"reference_spp": 128}, lambda new, old: width(new) > 2.0 * width(old)),
        ({"seed": 1}, lambda new, old: 0 < abs(new.away_bias - old.away_bias) < 2e-3),
        # One PSF for the whole field, few samples: worse away from the edge.
        ({"field": 1}, lambda new, old: new.away_rms > old.away_rms_high),
        ({"oversampling": 1}, lambda new, old: new.away_rms > old.away_rms_high),
        ({"psf": "geometric_spread"}, lambda new, old: abs(new.profile - old.profile).max() > 2e-3),
        ({"psf": "disc"}, lambda new, old: new.away_rms > 0.03),
        ({"thin_lens": True}, lambda new, old: width(new) == 0.0 < width(old)),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_every_option_does_what_it_says(options, holds):
    data = occlusion_study(**{**SMALL, **options}).dataset.squeeze()
    assert holds(data, small_study())


@pytest.mark.slow
def test_away_from_the_edge_nothing_is_wrong():
    # The default's samples and PSFs, all colours, near and far in focus.
    study = occlusion_study(
        ("layered_sum", "layered_over"),
        pupil_mm=(4.0,),
        wavelengths_nm=(450.0, 550.0, 650.0),
        columns=36,
        eye=navarro,
    )
    data = study.dataset.squeeze()
    assert float(data["strip_rms"].sel(kind="layered_sum").min()) > 0.1
    assert float(data["away_rms_high"].max()) < 0.01
    # Together, all cells: what is left is the samples of the views.
    assert float(np.sqrt((data["away_rms"] ** 2).mean())) < 0.004


GRID = {
    "methods": ("layered_sum",),
    "focus": ("near",),
    "pupil_mm": (4.0,),
    "contrast": (0.0,),
    "near_m": (0.5, 2.5),
    "far_m": (2.0, 2.2),
    "thin_lens": True,
    "columns": 12,
    "eye": navarro,
}


def test_a_study_that_was_stopped_goes_on_where_it_was(tmp_path, monkeypatch):
    path = tmp_path / "cells.jsonl"
    worked = []
    own = cells.Work.cell

    def counted(self, edge, place):
        worked.append(place)
        return own(self, edge, place)

    monkeypatch.setattr(cells.Work, "cell", counted)

    def stop(text, fraction):
        if fraction > 0:
            raise KeyboardInterrupt

    whole = occlusion_study(**GRID)
    # 2.5 m is not nearer than 2 m: those cells are left out.
    assert [w[:2] for w in worked] == [(0.5, 2.0), (0.5, 2.2)]
    worked.clear()
    part = occlusion_study(**GRID, path=path, on_step=stop)
    assert not part.is_complete
    assert np.isfinite(part.dataset["strip_rms"].values).sum() == 1
    # Pairs that are left out have no line, cells that were not reached no numbers.
    lines = [line.split() for line in part.table().splitlines()[1:]]
    assert [line[:2] for line in lines] == [["0.5", "2"], ["0.5", "2.2"]]
    assert [line[-1] == "-" for line in lines] == [False, True]
    # The thin lens, out of focus for the far plane alone, blurs it as far as the strip is wide.
    one = part.dataset.isel(far_m=0, near_m=0)
    assert one["blur_reach_arcmin"].item() == pytest.approx(one["half_width_arcmin"].item())
    # The last line was cut off.
    with path.open("a") as file:
        file.write('{"cell": "[0.5, 2.0, ')
    worked.clear()
    rest = occlusion_study(**GRID, path=path)
    assert rest.is_complete
    assert [w[:2] for w in worked] == [(0.5, 2.2)]
    for name in ("strip_rms", "profile", "reach_arcmin"):
        np.testing.assert_array_equal(rest.dataset[name], whole.dataset[name])
    worked.clear()
    occlusion_study(**GRID, path=path)
    assert worked == []
    with pytest.raises(ic.InvalidInputError, match="another study"):
        occlusion_study(**{**GRID, "columns": 14}, path=path)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"methods": ("layered_summ",)}, "layered_sum"),
        ({"methods": ()}, "one or more"),
        ({"near_m": (3.0,)}, "no near plane is nearer"),
        ({"near_m": ()}, "one value or more"),
        ({"pupil_mm": (4.0, 4.0)}, "each once"),
        ({"pupil_mm": 4.0}, "pupil_mm must be"),
        ({"focus": ("middle",)}, "near"),
        ({"contrast": (1.5,)}, "between 0 and 1"),
        ({"frequency_cpd": (0.0,)}, "> 0"),
        ({"levels": (-1.0, 1.0)}, "near_level"),
        ({"span": 0.5}, "span"),
        ({"columns": 2}, "columns"),
        ({"eye": "navarro"}, "function of pupil and focus"),
        ({"focus": (20.0,)}, "focus"),
        ({"on_step": 3}, "on_step"),
        ({"psf": "geometrical"}, "geometric"),
        ({"field": 0}, "field"),
        ({"oversampling": 9}, "oversampling"),
        ({"reach_error": 0.0}, "reach_error"),
        ({"seed": -1}, "seed"),
        ({"wavelengths_nm": (700.0, 400.0)}, "wavelengths"),
    ],
)
def test_bad_input_is_refused_before_any_work(options, text, monkeypatch):
    monkeypatch.setattr(cells.Work, "cell", None)
    with pytest.raises(ic.InvalidInputError, match=text):
        occlusion_study(**{**GRID, "near_m": (0.5,), **options})


def test_a_file_that_cannot_be_read_is_refused(tmp_path):
    with pytest.raises(ic.FileError, match="cannot use"):
        occlusion_study(**GRID, path=tmp_path)

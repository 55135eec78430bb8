"""Predicted errors of PSF methods against closed forms and ray tracing."""

import functools
import math

import numpy as np
import pytest
import random_planes
from layers import combined, layer
from oracles import reduced_eye
from slow_cases import slow_after

import isetcl as ic
from isetcl.psf_baseline import (
    DepthImage,
    DepthSheet,
    edge_error,
    error_bound,
    error_bounds,
    methods,
)
from isetcl.psf_baseline.prediction import predict
from isetcl.psf_baseline.psfs.reach import reach_psf
from isetcl.validation import occlusion_strip

ONE = np.array([550.0])

# Blur radii of the far and the near layer.
CASES = {"A": (1.0, 0.0), "B": (0.0, 1.0), "C": (0.5, 1.0)}
EDGE_TABLE = {
    # Computed for this project from the integral over the pupil: largest error and its integral.
    "gather": {"A": (0.50, 0.21), "B": (0.50, 0.21), "C": (0.20, 0.11)},
    "layered_sum": {"A": (0.50, 0.42), "B": (0.50, 0.42), "C": (0.20, 0.21)},
    "layered_normalized": {"A": (0.33, 0.16), "B": (0.50, 0.26)},
    "layered_over_visible": {"A": (0.50, 0.21), "B": (0.50, 0.21), "C": (0.28, 0.23)},
    "layered_over_normalized": {"A": (0.0, 0.0), "B": (0.50, 0.21), "C": (0.195, 0.04)},
    "ikoma": {"A": (0.004, None), "B": (0.50, 0.22), "C": (0.195, 0.05)},
    "layered_over": {"A": (0.0, 0.0), "B": (0.0, 0.0), "C": (0.0, 0.0)},
}
CLOSED = sorted(set(methods()) - {"single"})


# ---- closed forms ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("method", "case", "expected"),
    [(m, case, value) for m, row in EDGE_TABLE.items() for case, value in row.items()],
)
def test_closed_forms_give_the_table_of_edge_errors(method, case, expected):
    x = (np.arange(6000) + 0.5) / 1000.0 - 3.0
    error = np.abs(edge_error(method, x, *CASES[case]))
    assert error.max() == pytest.approx(expected[0], abs=0.005)
    if expected[1] is not None:
        assert error.sum() / 1000.0 == pytest.approx(expected[1], abs=0.006)


@pytest.mark.parametrize("method", CLOSED)
def test_closed_forms_are_what_methods_do_with_any_two_radiances(method):
    far, near, radii = 0.7, 0.4, (14.0, 32.0)
    rows, columns = 72, 240
    x = np.arange(columns) - columns / 2 + 0.5
    cover = np.broadcast_to(x < 0, (rows, columns))
    one = np.ones((rows, columns))
    layers = [layer(0.0, far * one, one), layer(1.0, near * one, cover)]
    image = combined(method, layers, radii, samples=200, rays=64)[rows // 2]
    share = [0.5 - edge_share(x / r) for r in radii]
    truth = near * share[1] + far * (1.0 - share[1])
    expected = edge_error(method, x, *radii, far=far, near=near)
    inner = slice(40, -40)
    np.testing.assert_allclose((image - truth)[inner], expected[inner], atol=0.012)


def edge_share(t):
    t = np.clip(t, -1.0, 1.0)
    return (t * np.sqrt(1.0 - t * t) + np.arcsin(t)) / np.pi


def test_one_psf_has_no_closed_form_of_its_own():
    with pytest.raises(ic.InvalidInputError, match="use error_bound"):
        edge_error("single", [0.0], 1.0, 1.0)
    with pytest.raises(ic.InvalidInputError, match="radius must be >= 0"):
        edge_error("gather", [0.0], -1.0, 1.0)
    with pytest.raises(ic.InvalidInputError, match=r"did you mean.*gather"):
        edge_error("gathr", [0.0], 1.0, 1.0)


# ---- predictions -----------------------------------------------------------------------------

FOV_DEG = 0.64
PUPIL_MM = 4.0
NEAR_DPT = 2.0


@functools.cache
def perfect_eye():
    return reduced_eye(PUPIL_MM)


def step(n=32, near=0.4, far=0.7, hidden=False):
    """A near half before a far one, of even radiance; the eye is focused at infinity."""
    left = np.broadcast_to(np.arange(n) < n // 2, (n, n))
    behind = (DepthSheet(np.full((n, n), far), 0.0),) if hidden else ()
    depth = np.where(left, NEAR_DPT, 0.0)
    picture = np.where(left, near, far)
    return DepthImage(picture, depth, FOV_DEG, depth_unit="dpt", hidden=behind)


@pytest.mark.parametrize(
    "method",
    slow_after(2, ["gather", "layered_sum", "layered_normalized", "layered_over_visible", "ikoma"]),
)
def test_the_prediction_at_a_straight_edge_is_the_closed_form(method):
    n = 32
    found = error_bound(step(n), perfect_eye(), method=method, wavelengths_nm=ONE)
    radius = math.degrees(PUPIL_MM / 2e3 * NEAR_DPT) * n / FOV_DEG
    x = np.arange(n) - n / 2 + 0.5
    # A pixel is the mean over its width.
    fine = x[:, None] + (np.arange(16) + 0.5) / 16 - 0.5
    both = {"far": 0.7, "near": 0.4}
    expected = edge_error(method, fine, 0.0, radius, **both).mean(axis=1)
    share = 0.5 - edge_share(fine / radius).mean(axis=1)
    level = (0.4 * share + 0.7 * (1.0 - share)).mean()
    np.testing.assert_allclose(found.estimate[n // 2], expected / level, atol=0.02)
    assert np.abs(expected).max() > 0.1
    assert np.all(found.bound >= np.abs(found.estimate))


def test_a_method_that_is_exact_is_predicted_to_be():
    found = error_bound(step(hidden=True), perfect_eye(), method="layered_over", wavelengths_nm=ONE)
    # Rays through the pupil blur in a staircase of 256, the method in one of its own samples.
    assert np.abs(found.estimate).max() < 0.02
    assert np.abs(found.estimate).mean() < 0.002
    assert not found.parts["hidden"].any()


def test_the_strip_is_as_wide_as_the_pupil_and_the_depths_say():
    found = error_bound(step(), perfect_eye(), wavelengths_nm=ONE)
    half_deg = math.degrees(PUPIL_MM / 2e3 * NEAR_DPT)
    assert found.strip[0].sum() * FOV_DEG / 32 / 2 == pytest.approx(
        half_deg, abs=1.5 * FOV_DEG / 32
    )
    verge = step().vergence_dpt
    np.testing.assert_array_equal(found.strip, occlusion_strip(verge, FOV_DEG / 32, PUPIL_MM))
    # Nothing is predicted beyond it but what one PSF does to a whole field.
    assert np.abs(found.estimate[~found.strip]).max() < 1e-3


def test_unknown_content_behind_edges_is_bounded_by_the_contrast():
    n = 32
    rng = np.random.default_rng(8)
    left = np.broadcast_to(np.arange(n) < n // 2, (n, n))
    blocks = np.kron(rng.random((8, 8)), np.ones((4, 4)))
    depth = np.where(left, NEAR_DPT, 0.0)
    front = np.where(left, 0.3, blocks)
    seen = DepthImage(front, depth, FOV_DEG, depth_unit="dpt")
    # The truth has other blocks behind the near half.
    behind = np.where(left, np.kron(rng.random((8, 8)), np.ones((4, 4))), blocks)
    known = DepthImage(front, depth, FOV_DEG, depth_unit="dpt", hidden=(DepthSheet(behind, 0.0),))
    options = {"method": "layered_over", "wavelengths_nm": ONE}
    bound = error_bound(seen, perfect_eye(), **options)
    made, truth = (
        ic.psf_baseline.render(image, perfect_eye(), **options).brightness()[0]
        for image in (seen, known)
    )
    error = np.abs(made - truth) / truth.mean()
    assert error.max() > 0.1
    assert (error <= bound.bound).mean() >= 0.95
    without = bound.bound - bound.parts["hidden"]
    assert (error[bound.strip] <= without[bound.strip]).mean() < 0.95
    assert not error_bound(known, perfect_eye(), **options).parts["hidden"].any()


@pytest.mark.slow
def test_pinhole_views_are_bounded_like_their_pictures():
    scene = ic.scenes.two_planes(0.5, 2.0, texture="uniform", edge_angle_deg=0.0)
    where = {"fov_deg": 0.8, "resolution": 24, "wavelengths_nm": ONE}
    eye = ic.eyes.navarro(4.0, 2.0)
    for layers in (1, 2):
        view = ic.pinhole(scene, eye, layers=layers, **where)
        found, own = error_bound(view, eye), error_bound(scene, eye, **where)
        np.testing.assert_allclose(found.estimate, own.estimate, atol=3e-3)
        # A single layer does not know what is behind, but all that is seen there is even.
        assert found.parts["hidden"].max() < (0.01 if layers == 1 else 1e-9)


def bars(n, fov_deg, cycles, centre_deg=(0.0, 0.0)):
    """Upright bars far away."""
    x = np.arange(n) + 0.5
    picture = 0.5 + 0.4 * np.sin(2.0 * np.pi * cycles * x / n) * np.ones((n, 1))
    return DepthImage(picture, 0.0, fov_deg, depth_unit="dpt", centre_deg=centre_deg)


def test_what_the_field_changes_is_predicted_from_rays_as_kernels_have_it():
    """Blurred bars, off the axis, whose error no shift of the image explains."""
    eye = ic.eyes.navarro(5.0, 2.5)
    picture = bars(24, 1.6, 4, (6.0, 0.0))
    where = {"wavelengths_nm": ONE, "fov_deg": 1.6, "resolution": 24, "centre_deg": (6.0, 0.0)}
    found = predict(picture, eye, "geometric", 1024, where)
    # A second way: kernels from other rays, in the same places.
    centre, patches = (
        ic.psf_baseline.render(picture, eye, field=field, psf_cache=None, **where).brightness()[0]
        for field in ("centre", 3)
    )
    expected = (patches - centre) / centre.mean()
    assert np.abs(expected).max() > 0.009
    np.testing.assert_allclose(found.truth - found.centred, expected, atol=0.0025)
    slope = np.gradient(found.centred, axis=1)
    moves = np.stack([slope.ravel(), (slope * np.linspace(-1.0, 1.0, 24)).ravel()], axis=1)
    fit = moves @ np.linalg.lstsq(moves, expected.ravel(), rcond=None)[0]
    assert np.abs(expected.ravel() - fit).max() > 0.009


@pytest.mark.slow
def test_of_psfs_that_change_over_the_field_a_quarter_of_its_part_is_left():
    eye = ic.eyes.navarro(4.0, 2.0)
    options = {"method": "layered_sum", "wavelengths_nm": ONE, "psf_cache": None}
    picture = bars(12, 1.6, 2, (8.0, 0.0))
    centre, patches = (error_bound(picture, eye, field=f, **options) for f in ("centre", 3))
    # Half the distance between nodes: a quarter of what grows with its square.
    np.testing.assert_allclose(patches.parts["field"], centre.parts["field"] / 4.0)
    assert np.abs(centre.estimate).max() > 3.0 * np.abs(patches.estimate).max()
    # PSFs that know no field are alike everywhere, patches or not.
    disc = [error_bound(picture, eye, psf="disc", field=f, **options) for f in ("centre", 3)]
    np.testing.assert_allclose(disc[0].bound, disc[1].bound, atol=1e-4)
    np.testing.assert_array_equal(disc[1].parts["field"], centre.parts["field"])


@pytest.mark.parametrize("field", [(0.0, 0.0), (12.0, -9.0)])
@pytest.mark.parametrize("vergence", slow_after(1, [4.0, 0.0]))
def test_the_reach_of_a_view_is_that_of_its_psfs(field, vergence):
    eye = ic.eyes.navarro(4.0, 1.0)
    reach, psf = (
        make(eye, 450.0, vergence, 0.004, field)
        for make in (reach_psf, ic.psf_baseline.geometric_psf)
    )
    assert reach.kernel[reach.radius, reach.radius] == 1.0
    lit = np.flatnonzero(psf.kernel.max(axis=0) + psf.kernel.max(axis=1))
    farthest = np.abs(lit - psf.radius).max()
    assert farthest <= reach.radius <= 1.15 * farthest + 3


# ---- kinds of PSFs ---------------------------------------------------------------------------


@pytest.mark.slow
def test_the_eye_s_own_psfs_are_judged_with_their_diffraction_and_others_by_its_rays():
    eye = ic.eyes.navarro(2.0, 0.3)
    options = {"method": "layered_sum", "wavelengths_nm": ONE, "psf_cache": None}
    picture = bars(16, 0.16, 4)
    rays, wave, watson = (
        ic.psf_baseline.render(picture, eye, psf=psf, **options).brightness()[0]
        for psf in ("geometric", "wave", "watson")
    )
    level = rays.mean()
    assert np.abs(wave - rays).max() > 0.03 * level
    # At one depth the eye's own PSFs are right whatever their diffraction.
    for psf in ("geometric", "wave"):
        found = error_bound(picture, eye, psf=psf, **options)
        assert np.abs(found.estimate).max() < 0.007
    # What a mean eye leaves out or adds is error.
    found = error_bound(picture, eye, psf="watson", **options)
    np.testing.assert_allclose(found.estimate, (watson - rays) / level, atol=0.007)
    assert np.abs(found.estimate).max() > 0.03
    own = ic.psf_baseline.psf_kinds()["watson"](eye, 550.0, 0.0, 0.005)
    same = error_bound(picture, eye, psf=own, **options)
    np.testing.assert_allclose(same.estimate, found.estimate, atol=1e-4)


QUICK = ("geometric", "gaussian", "williams")


@pytest.mark.parametrize(
    "psf",
    [
        kind if kind in QUICK else pytest.param(kind, marks=pytest.mark.slow)
        for kind in ic.psf_baseline.psf_kinds()
    ],
)
def test_all_kinds_of_psfs_have_bounds(psf):
    options = {"wavelengths_nm": ONE, "psf": psf, "field": "patches", "psf_error": 0.3}
    found = error_bound(step(8), perfect_eye(), method="layered_sum", **options)
    assert np.isfinite(found.bound).all()
    assert np.all(found.bound >= np.abs(found.estimate))
    # The gap at the edge is there whatever the PSF; the widest hide much of it.
    assert 0.05 < np.abs(found.estimate).max() < 0.6


# ---- verdicts --------------------------------------------------------------------------------


def test_a_flat_scene_is_safe_and_says_so():
    image = DepthImage(np.full((8, 8), 0.5), 1.0, 0.4)
    verdict = error_bound(image, perfect_eye(), method="gather", wavelengths_nm=ONE).verdict()
    assert verdict.is_safe
    assert verdict.share == 1.0
    assert verdict.text == "gather within 1 % on 100 % of the image"


def test_a_verdict_never_claims_more_than_the_bound():
    found = error_bound(step(), perfect_eye(), wavelengths_nm=ONE)
    for tolerance in (0.005, 0.01, 0.1, 0.9):
        verdict = found.verdict(tolerance, needed=0.9)
        share = float((found.bound <= tolerance).mean())
        assert verdict.share == share
        assert verdict.is_safe == (share >= 0.9)
        claimed = float(verdict.text.split(" on ")[1].split()[0])
        assert 100 * share - 0.1 <= claimed <= 100 * share
    assert not found.verdict().is_safe


@pytest.mark.slow
def test_methods_asked_for_together_get_the_bounds_they_get_alone():
    names = ["gather", "layered_sum"]
    both = error_bounds(step(), perfect_eye(), names, wavelengths_nm=ONE)
    assert list(both) == names
    for name in names:
        own = error_bound(step(), perfect_eye(), method=name, wavelengths_nm=ONE)
        np.testing.assert_array_equal(both[name].bound, own.bound)
    assert error_bounds(step(4), perfect_eye(), [], wavelengths_nm=ONE) == {}


def test_the_bound_is_the_sum_of_its_parts():
    found = error_bound(step(), perfect_eye(), wavelengths_nm=ONE)
    assert set(found.parts) == {"edges", "pupil", "field", "hidden", "agreement"}
    np.testing.assert_allclose(found.bound, sum(found.parts.values()))
    assert all(np.all(part >= 0) for part in found.parts.values())


def test_one_pixel_and_black_pictures_have_bounds():
    one = DepthImage(np.array([[0.5]]), 1.0, 0.1)
    assert error_bound(one, perfect_eye(), wavelengths_nm=ONE).bound.shape == (1, 1)
    black = DepthImage(np.zeros((4, 4)), 1.0, 0.1)
    assert not error_bound(black, perfect_eye(), wavelengths_nm=ONE).bound.any()
    nothing = ic.Scene((), None, "nothing")
    where = {"fov_deg": 1.0, "resolution": 4, "wavelengths_nm": ONE}
    assert error_bound(nothing, perfect_eye(), **where).verdict().is_safe


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"method": "layered"}, "did you mean layered_"),
        ({"pupil_samples": 2}, "pupil_samples"),
        ({"scatter": None}, "unknown option of error_bound"),
        ({"psf": "wav"}, "did you mean wave"),
        ({"field": "patch"}, "did you mean patches"),
        ({"field": 0}, "field"),
        ({"border": "edge"}, "unknown border"),
        ({"wavelengths_nm": []}, "wavelengths_nm"),
    ],
)
def test_bad_arguments_are_named(change, message):
    with pytest.raises(ic.InvalidInputError, match=message):
        error_bound(step(4), perfect_eye(), **change)


def test_bad_tolerances_are_named():
    found = error_bound(step(4), perfect_eye(), wavelengths_nm=ONE)
    with pytest.raises(ic.InvalidInputError, match="tolerance"):
        found.verdict(-0.1)
    with pytest.raises(ic.InvalidInputError, match="needed"):
        found.verdict(0.1, 1.5)


# ---- against ray tracing ---------------------------------------------------------------------


def judged(scene, eye, *names, pixels=64, spp=2048, diffraction="none", nm=None, **psfs):
    """Absolute error, its standard error from noise, and the bound, by method, of the mean."""
    where = {"fov_deg": random_planes.FOV_DEG, "resolution": pixels, "wavelengths_nm": nm}
    traced, noise = ic.render(
        scene, eye, spp=spp, seed=1, progress=False, diffraction=diffraction, **where
    ).brightness()
    bounds = error_bounds(scene, eye, names, **where, **psfs)
    level = traced.mean()
    found = {}
    for name in names:
        made = ic.psf_baseline.render(scene, eye, method=name, **where, **psfs).brightness()[0]
        error = np.abs(made - traced).ravel() / level
        found[name] = (error, noise.ravel() / level, bounds[name].bound.ravel())
    return found


def assert_bounded(error, noise, bound, measurable=0.3):
    """At least 95 % below, noise of two standard errors forgiven; the median ratio below 3.

    The ratio is over pixels whose error is at least four standard errors, so that it is error.
    """
    assert np.mean(noise) < 0.003
    assert np.mean(error <= bound + 2.0 * noise) >= 0.95
    real = error >= 4.0 * noise
    assert real.mean() > measurable
    assert 1.0 <= np.median(bound[real] / error[real]) <= 3.0


@pytest.mark.slow
def test_ray_traced_errors_lie_below_the_bound():
    found = judged(*random_planes.planes(3), "layered_sum", pixels=24, spp=1024)
    assert_bounded(*found["layered_sum"])


@pytest.mark.slow
def test_twenty_random_scenes_of_planes_are_bounded():
    names = ("layered_sum", "layered_over")
    found = [judged(*random_planes.planes(seed), *names) for seed in range(20)]
    for name in names:
        of_scenes = [scene[name] for scene in found]
        assert_bounded(*(np.concatenate(parts) for parts in zip(*of_scenes, strict=True)))
        # In every one of them, without forgiving noise.
        assert min(np.mean(error <= bound) for error, _, bound in of_scenes) >= 0.95


@pytest.mark.slow
def test_a_mesh_is_bounded():
    for found in judged(*random_planes.sheet(), "layered_sum", "gather", "layered_over").values():
        assert_bounded(*found)
        assert np.mean(found[0] <= found[2]) >= 0.95


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "options"),
    [
        (9, {"psf": "hurb", "diffraction": "hurb"}),
        (9, {"field": 3, "nm": ONE}),
        (3, {"psf": "disc", "nm": ONE}),
        (9, {"psf": "watson", "nm": ONE}),
    ],
)
def test_other_psfs_and_those_that_change_over_the_field_are_bounded(seed, options):
    found = judged(*random_planes.planes(seed), "layered_sum", **options)["layered_sum"]
    # PSFs that change over the field err by more than noise at depth edges alone.
    assert_bounded(*found, measurable=0.15 if "field" in options else 0.3)
    assert np.mean(found[0] <= found[2]) >= 0.95

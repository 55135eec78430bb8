"""Procedural targets: sizes of the paper's scenes, solid letters, charts, chess, Cornell box."""

import math

import numpy as np
import pytest
import trimesh

import isetcl as ic
from isetcl.scene.polygon import triangulate
from isetcl.scene.solid import box_mesh, extruded_mesh, flat_mesh, lathed_mesh
from isetcl.scene.targets.chess_pieces import PIECES, chess_piece
from isetcl.scene.targets.optotypes import OPTOTYPES
from isetcl.scene.targets.paints import chart_paints, cornell_paints
from isetcl.scene.text import text_outline
from isetcl.scene.view import intersect, nearest_distance_m

ARCMIN = math.pi / 180.0 / 60.0
SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])


def shape_of(scene, name):
    (found,) = [item.shape for item in scene.objects if item.name == name]
    return found


def solid(mesh):
    return trimesh.Trimesh(mesh.vertices_m, mesh.faces)


def seen(scene, directions):
    """Names of the objects first met along rays from the origin."""
    rays = np.atleast_2d(np.asarray(directions, dtype=float))
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    _, index = nearest_distance_m(scene, np.zeros(3), rays)
    return [scene.objects[i].name if i >= 0 else None for i in index]


def radiance(scene, direction, wavelength=550.0):
    """What an unlit scene sends along a ray to the origin."""
    ray = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    _, index = nearest_distance_m(scene, np.zeros(3), ray)
    item = scene.objects[int(index)]
    hit = intersect(item.shape, np.zeros(3), ray)
    texture = item.material.texture
    weights = np.ones(1) if texture is None else texture.weights(hit.u, hit.v)
    return float(weights @ [s.at([wavelength])[0] for s in item.material.spectra()])


def area_of_loops(loops):
    """Gauss's area formula: fonts draw holes the other way round."""
    total = 0.0
    for loop in loops:
        x, y = loop.T
        total += 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    return abs(total)


# ------------------------------------------------------------------------------------ polygons


@pytest.mark.parametrize("text", ["A", "B", "C", "8", "@", "100", "Ää&%", "Snellen 20/20"])
def test_triangles_fill_an_outline_and_no_more(text):
    loops = text_outline(text, 1.0)
    part = triangulate(loops)
    assert part.area() == pytest.approx(area_of_loops(loops), rel=1e-9)
    edges = part.boundary()
    # The boundary is made of closed loops: every corner is entered once and left once.
    np.testing.assert_array_equal(np.sort(edges[:, 0]), np.sort(edges[:, 1]))
    assert len(np.unique(edges[:, 0])) == len(edges)


def test_a_square_with_a_square_hole_has_eight_triangles():
    part = triangulate([SQUARE, 0.25 * SQUARE + 0.5])
    # n corners and h holes make n + 2 h - 2 triangles.
    assert len(part.faces) == 8 + 2 - 2
    assert part.area() == pytest.approx(4.0 - 0.25)
    inner = triangulate([SQUARE, 0.5 * SQUARE + 0.5, 0.25 * SQUARE + 0.7])
    assert inner.area() == pytest.approx(4.0 - 1.0 + 0.25)


def test_the_way_round_does_not_matter():
    assert triangulate([SQUARE[::-1]]).area() == pytest.approx(4.0)
    assert triangulate([SQUARE, 0.5 * SQUARE[::-1] + 0.5]).area() == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("loops", "message"),
    [
        ([], "at least one loop"),
        ([SQUARE[:2]], "three different corners"),
        ([np.zeros((4, 2))], "three different corners"),
        ([np.zeros((4, 3))], "shape"),
        ([SQUARE * np.nan], "finite"),
        ([SQUARE, SQUARE], "same place"),
        ([SQUARE, SQUARE + 1.0], "neither touch nor cross|same place"),
        ([SQUARE[[0, 2, 1, 3]]], "neither touch nor cross"),
        (["ab"], "must be numbers"),
    ],
)
def test_an_outline_that_is_none_is_refused(loops, message):
    with pytest.raises(ic.InvalidInputError, match=message):
        triangulate(loops)


@pytest.mark.parametrize("text", ["A", "B", "C", "175"])
def test_extruded_letters_are_closed_solids(text):
    loops = text_outline(text, 0.07)
    body = solid(extruded_mesh(loops, 0.02))
    assert body.is_watertight
    assert body.is_winding_consistent
    assert body.volume == pytest.approx(area_of_loops(loops) * 0.02, rel=1e-9)
    np.testing.assert_allclose(body.extents[1:], (0.07, 0.02), rtol=1e-12)


def test_a_flat_outline_faces_the_eye():
    mesh = flat_mesh([SQUARE], -1.0)
    corners = mesh.triangles_m
    assert np.all(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0)
    np.testing.assert_allclose(mesh.uv, mesh.vertices_m[:, :2] / 2.0)


def test_a_lathed_cone_has_the_volume_of_a_pyramid():
    n = 64
    mesh = lathed_mesh(np.array([[0.3, 0.0], [0.1, 0.5], [0.0, 0.5]]), segments=n)
    body = solid(mesh)
    assert body.is_watertight
    base = n / 2 * math.sin(2 * math.pi / n)
    wanted = base * 0.5 / 3 * (0.3**2 + 0.3 * 0.1 + 0.1**2)
    assert body.volume == pytest.approx(wanted, rel=1e-9)
    open_end = solid(lathed_mesh(np.array([[0.3, 0.0], [0.1, 0.5]]), segments=n))
    assert open_end.volume == pytest.approx(wanted, rel=1e-9)


def test_a_lathed_half_circle_is_shaded_like_a_sphere():
    turn = np.radians(np.linspace(-90, 90, 61))
    profile = np.column_stack([np.cos(turn), np.sin(turn)])
    profile[[0, -1], 0] = 0.0
    mesh = lathed_mesh(profile, segments=40)
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0)
    cosine = np.einsum("ij,ij->i", mesh.normals, mesh.vertices_m)
    assert cosine.min() > math.cos(math.radians(1.6))
    cylinder = lathed_mesh(np.array([[1.0, 0.0], [1.0, 1.0]]))
    upright = np.abs(cylinder.normals[:, 1])
    assert set(np.round(upright, 12)) == {0.0, 1.0}


def test_a_box_is_closed():
    body = solid(box_mesh((0, 0, 0), (1, 2, 3)))
    assert (body.is_watertight, body.volume) == (True, pytest.approx(6.0))


@pytest.mark.parametrize(
    "call",
    [
        lambda: extruded_mesh([SQUARE], 0.0),
        lambda: lathed_mesh([[1.0, 0.0]]),
        lambda: lathed_mesh([[1.0, 0.0], [-1.0, 1.0]]),
        lambda: lathed_mesh([[1.0, 0.0], [0.0, 1.0], [1.0, 2.0]]),
        lambda: lathed_mesh([[1.0, 0.0], [1.0, 0.0]]),
        lambda: lathed_mesh([[1.0, 0.0], [1.0, 1.0]], segments=2),
        lambda: lathed_mesh("cone"),
        lambda: box_mesh((0, 0, 0), (1, 0, 1)),
    ],
)
def test_solids_that_are_none_are_refused(call):
    with pytest.raises(ic.InvalidInputError):
        call()


# ---------------------------------------------------------------------------------------- text


@pytest.mark.parametrize("text", ["Hg&8", "I", "LTE"])
def test_a_picture_of_text_covers_as_much_as_its_outline(text):
    image = ic.scenes.text_image(text, rows=201, margin=0.1)
    part = triangulate(text_outline(text, 0.8 * 201))
    covered = float(np.sum(1.0 - image.texels))
    # Eight bits a texel, on the border of the letters only.
    assert covered == pytest.approx(part.area(), rel=2e-3)


def test_text_stands_upright_and_reads_from_left_to_right():
    ink = 1.0 - ic.scenes.text_image("L", rows=60, margin=0.2).texels
    left, right = np.array_split(ink.sum(axis=0), 2)
    top, bottom = np.array_split(ink.sum(axis=1), 2)
    assert left.sum() > right.sum()
    assert bottom.sum() > top.sum()
    assert ink[:11].max() == ink[-11:].max() == 0.0
    assert ink[13:47].sum(axis=1).min() > 0.0


def test_ink_and_paper_have_the_wanted_weights():
    image = ic.scenes.text_image("I", rows=50, ink=0.8, paper=0.2)
    assert image.texels[0, 0] == pytest.approx(0.2)
    assert image.texels.max() == pytest.approx(0.8)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ic.scenes.text_image(""), "one line with letters"),
        (lambda: ic.scenes.text_image(" "), "one line with letters"),
        (lambda: ic.scenes.text_image("a\nb"), "one line"),
        (lambda: ic.scenes.text_image(3), "text must be"),
        (lambda: ic.scenes.text_image("a", 0), "rows"),
        (lambda: ic.scenes.text_image("a", margin=0.5), "margin"),
        (lambda: ic.scenes.text_image("a", ink=-1.0), "ink and paper"),
        (lambda: ic.scenes.text_image("a", font="No Such Font"), "not installed"),
        (lambda: ic.scenes.text_image("a", weight="heavy"), "weight"),
        (lambda: ic.scenes.text_image("鯨"), "has no letter"),
        (lambda: text_outline("a", -1.0), "height_m"),
    ],
)
def test_text_that_cannot_be_drawn_is_refused(call, message):
    with pytest.raises(ic.InvalidInputError, match=message):
        call()


# --------------------------------------------------------------------------- letters at depth


def test_letters_stand_where_those_of_figure_nine_stand():
    scene = ic.scenes.letters_at_depth()
    # Shipped positions of ISET3d, metres: x and distance.
    for name, x, distance in (("A", -0.0486, 0.5556), ("B", 0.0, 0.8333), ("C", 0.1458, 1.6667)):
        body = solid(shape_of(scene, name))
        assert body.is_watertight
        np.testing.assert_allclose(body.extents[1:], (0.070, 0.020), rtol=1e-9)
        low, high = body.bounds
        np.testing.assert_allclose((low + high)[:2] / 2, (x, 0.0), atol=1e-4)
        assert -high[2] == pytest.approx(distance, abs=1e-4)
    assert shape_of(scene, "wall").corner_m[2] == -2.0
    assert shape_of(scene, "ground").corner_m[1] == pytest.approx(-0.0361)


def test_letters_can_be_others_elsewhere():
    scene = ic.scenes.letters_at_depth(
        "Q", [0.7], [3.0], height_m=0.035, depth_m=0.01, luminance_cd_m2=20.0
    )
    low, high = solid(shape_of(scene, "Q")).bounds
    assert (low + high)[0] / 2 == pytest.approx(0.7 * math.tan(math.radians(3.0)))
    assert scene.background.luminance_cd_m2() == pytest.approx(20.0)


def test_numerals_fill_the_boxes_of_figure_eight():
    scene = ic.scenes.numbers_at_depth()
    # ISET3d: x and height of each numeral, mm.
    boxes = {
        "100": (-28.7, -3.3, 10.6, 24.6),
        "125": (4.55, 35.45, -30.75, -13.25),
        "150": (5.0, 43.0, -10.5, 10.5),
        "175": (6.4, 49.6, 17.9, 42.1),
        "200": (-60.7, -3.3, -49.3, -21.3),
        "300": (-90.2, -5.8, -21.0, 21.0),
    }
    for name, box in boxes.items():
        body = solid(shape_of(scene, name))
        assert body.is_watertight
        low, high = body.bounds * 1e3
        np.testing.assert_allclose((low[0], high[0], low[1], high[1]), box, atol=0.2)
        assert -high[2] == pytest.approx(float(name))
        # Each subtends the same eight degrees.
        assert math.degrees((high[1] - low[1]) / float(name)) == pytest.approx(8.0, abs=0.05)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"letters": ""}, "distances_m|at least one"),
        ({"letters": 3}, "letters"),
        ({"distances_m": [1.0]}, "3 finite numbers"),
        ({"distances_m": [1.0, 1.0, -1.0]}, "3 finite numbers"),
        ({"distances_m": "far"}, "distances_m"),
        ({"distances_m": [1.0, 1.5, 3.0]}, "before the wall"),
        ({"fields_deg": [0.0]}, "fields_deg"),
        ({"fields_deg": [0.0, 0.0, 90.0]}, "fields_deg"),
        ({"height_m": 0.0}, "height_m"),
        ({"depth_m": -1.0}, "depth_m"),
        ({"luminance_cd_m2": 0.0}, "luminance_cd_m2"),
        ({"font": "No Such Font"}, "not installed"),
    ],
)
def test_impossible_letters_are_refused(options, message):
    with pytest.raises(ic.InvalidInputError, match=message):
        ic.scenes.letters_at_depth(**options)
    with pytest.raises(ic.InvalidInputError, match="luminance"):
        ic.scenes.numbers_at_depth(lamp_luminance_cd_m2=-1.0)


# -------------------------------------------------------------------------------------- Snellen


@pytest.mark.parametrize("distance", [6.0, 0.4])
def test_a_letter_of_twenty_twenty_subtends_five_minutes_of_arc(distance):
    scene = ic.scenes.snellen_chart(distance)
    for denominator, letters in ic.scenes.SNELLEN_ROWS:
        mesh = shape_of(scene, f"20/{denominator:g} {letters}")
        height = np.ptp(mesh.vertices_m[:, 1])
        angle = 2 * math.atan(height / 2 / distance) / ARCMIN
        assert angle == pytest.approx(5.0 * denominator / 20.0, rel=1e-6)
        # Letters as wide as high, gaps as wide as letters.
        width = np.ptp(mesh.vertices_m[:, 0])
        assert width == pytest.approx((2 * len(letters) - 1) * height, rel=2e-2)


def test_the_smallest_letter_at_six_metres_is_8_73_mm_high():
    scene = ic.scenes.snellen_chart(6.0)
    assert np.ptp(shape_of(scene, "20/20 DEFPOTEC").vertices_m[:, 1]) == pytest.approx(
        8.73e-3, abs=5e-6
    )


def test_the_gap_of_the_ring_is_one_minute_of_arc():
    scene = ic.scenes.snellen_chart(6.0, [(20.0, "C")], on_axis=20.0)
    # On the right rim, two minutes from the middle: the stroke lies from 1.5 to 2.5.
    for y, wanted in ((0.0, "card"), (0.45, "card"), (-0.45, "card"), (0.55, "20/20 C")):
        assert seen(scene, (2.0 * ARCMIN, y * ARCMIN, -1.0)) == [wanted]
    for x, wanted in ((-2.6, "card"), (-2.4, "20/20 C"), (-1.6, "20/20 C"), (-1.4, "card")):
        assert seen(scene, (x * ARCMIN, 0.0, -1.0)) == [wanted]


def test_the_bars_of_the_e_are_one_minute_thick():
    scene = ic.scenes.snellen_chart(6.0, [(20.0, "E")], on_axis=20.0)
    heights = np.arange(-2.75, 3.0, 0.5)
    rays = [(1.0 * ARCMIN, y * ARCMIN, -1.0) for y in heights]
    ink = [name != "card" for name in seen(scene, rays)]
    bars = [0, 1, 1, 0, 0, 1, 1, 0, 0, 1, 1, 0]
    assert ink == [bool(bar) for bar in bars]


@pytest.mark.parametrize("letter", sorted(OPTOTYPES))
def test_optotypes_fill_a_square_of_five_strokes(letter):
    points = np.concatenate(OPTOTYPES[letter])
    np.testing.assert_allclose(points.min(axis=0), 0.0, atol=1e-9)
    # The gap of the ring takes 2.5 - sqrt(2.5^2 - 0.5^2) from its right side.
    right = 2.5 + math.sqrt(6.0) if letter == "C" else 5.0
    np.testing.assert_allclose(points.max(axis=0), (right, 5.0), atol=1e-9)
    part = triangulate(OPTOTYPES[letter])
    assert part.area() == pytest.approx(
        triangulate(OPTOTYPES[letter][:1]).area()
        - sum(triangulate([hole]).area() for hole in OPTOTYPES[letter][1:])
    )
    # A stroke of width 1: its area is its length, between 8 (L: 9) and 20 units.
    assert 8.0 < part.area() < 20.0


def test_the_chart_has_the_stated_luminance_and_contrast_in_both_lights():
    shining = ic.scenes.snellen_chart(2.0, contrast=0.8, luminance_cd_m2=120.0, on_axis=20.0)
    lit = ic.scenes.snellen_chart(
        2.0, contrast=0.8, luminance_cd_m2=120.0, on_axis=20.0, lighting="lit"
    )
    (card,) = shining.objects[-1].material.spectra()
    (ink,) = shining.objects[0].material.spectra()
    assert card.luminance_cd_m2() == pytest.approx(120.0)
    assert ink.luminance_cd_m2() == pytest.approx(120.0 * (1 - 0.8))
    assert shining.background is None
    # A flat card under an even sky of radiance L sends back its reflectance times L.
    paper = lit.objects[-1].material.spectra()[0].at([550.0])[0]
    assert paper * lit.background.luminance_cd_m2() == pytest.approx(120.0)


def test_rows_are_spaced_by_the_lower_letters_and_centred_on_the_wanted_one():
    scene = ic.scenes.snellen_chart(6.0, [(40.0, "HN"), (20.0, "KR"), (10.0, "SV")], on_axis=20.0)
    spans = [
        (item.shape.vertices_m[:, 1].min(), item.shape.vertices_m[:, 1].max())
        for item in scene.objects[:3]
    ]
    assert sum(spans[1]) == pytest.approx(0.0, abs=1e-12)
    for upper, lower in ((0, 1), (1, 2)):
        gap = spans[upper][0] - spans[lower][1]
        assert gap == pytest.approx(spans[lower][1] - spans[lower][0])
    corners = scene.objects[-1].shape
    assert corners.corner_m[1] < spans[2][0]
    assert corners.corner_m[1] + corners.edge_v_m[1] > spans[0][1]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"distance_m": 0.0}, "distance_m"),
        ({"rows": []}, "at least one row"),
        ({"rows": [(20.0,)]}, "must be N and letters"),
        ({"rows": [(20.0, "")]}, "at least one letter"),
        ({"rows": [(20.0, "A")]}, "optotype"),
        ({"rows": [(0.0, "E")]}, "N of 20/N"),
        ({"rows": "E"}, "rows"),
        ({"on_axis": 21.0}, "on_axis"),
        ({"contrast": 1.5}, "contrast"),
        ({"lighting": "dark"}, "lighting"),
    ],
)
def test_an_impossible_chart_of_letters_is_refused(options, message):
    with pytest.raises(ic.InvalidInputError, match=message):
        ic.scenes.snellen_chart(**options)


# --------------------------------------------------------------------------------------- charts


def test_the_grid_has_a_line_on_the_axis_and_sixteen_periods_in_sixty_degrees():
    scene = ic.scenes.tca_grid(1.0, 60.0)
    width = 2 * math.tan(math.radians(30.0))
    spacing, half_line = width / 16, width / 256 / 2
    for k in range(-7, 8):
        for off, wanted in ((0.9, True), (-0.9, True), (1.1, False), (-1.1, False)):
            x = k * spacing + off * half_line
            assert (radiance(scene, (x, 0.37 * spacing, -1.0)) > 0) is wanted
            assert (radiance(scene, (0.37 * spacing, x, -1.0)) > 0) is wanted
    quad = scene.objects[0].shape
    assert 2 * math.atan(quad.edge_u_m[0] / 2) == pytest.approx(math.radians(60.0))


def test_the_grey_patches_of_the_chart_have_their_published_densities():
    paints = list(chart_paints().values())
    assert len(paints) == 24
    densities = (0.05, 0.23, 0.44, 0.70, 1.05, 1.50)
    for paint, density in zip(paints[-6:], densities, strict=True):
        assert paint.at([550.0])[0] == pytest.approx(10.0**-density, rel=0.12)
    names = list(chart_paints())
    assert (names[0], names[5], names[14]) == ("dark skin", "bluish green", "red")


def test_patches_lie_in_rows_of_six_from_the_top_left():
    scene = ic.scenes.macbeth_chart(0.5, 0.24)
    for name, x, y in (
        ("dark skin", -0.1, 0.06),
        ("bluish green", 0.1, 0.06),
        ("red", -0.02, -0.02),
    ):
        assert seen(scene, (x, y, -0.5)) == [name]
        assert seen(scene, (x + 0.019, y, -0.5)) == ["frame"]
    shining = radiance(scene, (-0.1, 0.06, -0.5))
    white = ic.Spectrum.illuminant("D65", 100.0).at([550.0])[0]
    assert shining == pytest.approx(white * chart_paints()["dark skin"].at([550.0])[0], rel=1e-6)
    lit = ic.scenes.macbeth_chart(0.5, lighting="lit", illuminant="A")
    assert lit.background.luminance_cd_m2() == pytest.approx(100.0)


@pytest.mark.parametrize("spokes", [2, 7, 36, 200])
def test_a_star_has_its_spokes_all_the_way_round(spokes):
    scene = ic.scenes.siemens_star(1.0, 5.0, spokes=spokes, contrast=0.5)
    turn = 2 * np.pi * (np.arange(spokes * 20) + 0.5) / (spokes * 20)
    for share in (0.1, 0.6, 0.98):
        radius = share * math.tan(math.radians(2.5))
        rays = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), -np.ones_like(turn)])
        names = np.array(seen(scene, rays)).reshape(spokes, 20)
        assert np.all(names[:, :10] == "spokes")
        assert np.all(names[:, 10:] == "disc")
    bright, dark = radiance(scene, rays[1]), radiance(scene, rays[11])
    assert (bright - dark) / (bright + dark) == pytest.approx(0.5)


def test_a_textured_plane_is_lit_or_shines():
    texture = ic.Checkerboard(1, 1, bright=1.0, dark=0.25)
    scene = ic.scenes.textured_plane(texture, 2.0, (1.0, 0.5), luminance_cd_m2=50.0)
    ratio = radiance(scene, (0.1, 0.1, -2.0)) / radiance(scene, (-0.1, 0.1, -2.0))
    assert ratio == pytest.approx(4.0)
    assert scene.objects[0].shape.edge_v_m == (0.0, 0.5, 0.0)
    colour = ic.Image(np.ones((2, 2, 3)))
    lit = ic.scenes.textured_plane(colour, lighting="lit")
    grid = np.arange(400.0, 701.0, 10.0)
    total = sum(s.at(grid) for s in lit.objects[0].material.spectra())
    np.testing.assert_allclose(total, 1.0, rtol=1e-12)
    shining = ic.scenes.textured_plane(colour)
    total = sum(s.at(grid) for s in shining.objects[0].material.spectra())
    np.testing.assert_allclose(total, lit.background.at(grid), rtol=1e-9)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ic.scenes.textured_plane("photo.png"), "texture"),
        (lambda: ic.scenes.textured_plane(ic.Checkerboard(1, 1), -1.0), "distance_m"),
        (lambda: ic.scenes.textured_plane(ic.Checkerboard(1, 1), 1.0, 2.0), "size_m"),
        (lambda: ic.scenes.textured_plane(ic.Checkerboard(1, 1), 1.0, (0, 1)), "size_m"),
        (lambda: ic.scenes.textured_plane(ic.Checkerboard(1, 1), lighting="x"), "lighting"),
        (lambda: ic.scenes.tca_grid(lines=15), "lines must be even"),
        (lambda: ic.scenes.tca_grid(lines=0), "lines"),
        (lambda: ic.scenes.tca_grid(1.0, 180.0), "width_deg"),
        (lambda: ic.scenes.tca_grid(line_width=2.0), "line_width"),
        (lambda: ic.scenes.macbeth_chart(0.0), "distance_m"),
        (lambda: ic.scenes.macbeth_chart(illuminant="D99"), "illuminant"),
        (lambda: ic.scenes.macbeth_chart(lighting=None), "lighting"),
        (lambda: ic.scenes.siemens_star(spokes=1), "spokes"),
        (lambda: ic.scenes.siemens_star(contrast=-0.1), "contrast"),
        (lambda: ic.scenes.siemens_star(1.0, 0.0), "diameter_deg"),
    ],
)
def test_impossible_charts_are_refused(call, message):
    with pytest.raises(ic.InvalidInputError, match=message):
        call()


# -------------------------------------------------------------------------- edges and points


@pytest.mark.parametrize("step", [0.4, -0.4, 0.0])
def test_an_edge_with_a_step_stays_on_the_axis(step):
    scene = ic.scenes.slanted_edge(1.0, 10.0, depth_step_m=step)
    edge = np.array([-math.sin(math.radians(10.0)), math.cos(math.radians(10.0)), 0.0])
    across = np.array([edge[1], -edge[0], 0.0])
    for along in (-0.2, 0.0, 0.3):
        for off, name in ((-1e-3, "bright side"), (1e-3, "dark side")):
            ray = np.array([0.0, 0.0, -1.0]) + along * edge + off * across
            assert seen(scene, ray) == [name]
    rays = np.outer([-1e-3, 1e-3], across) + np.array([0.0, 0.0, -1.0])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    distance, _ = nearest_distance_m(scene, np.zeros(3), rays)
    np.testing.assert_allclose(distance, (1.0 - step / 2, 1.0 + step / 2), rtol=1e-5)


@pytest.mark.parametrize("step", [0.4, -0.4, 0.0])
@pytest.mark.parametrize("angle", [10.0, 100.0])
def test_an_edge_may_lie_beside_the_axis(angle, step):
    scene = ic.scenes.slanted_edge(1.0, angle, depth_step_m=step, offset_m=0.25)
    turn = math.radians(angle)
    along = np.array([-math.sin(turn), math.cos(turn), 0.0])
    across = np.array([math.cos(turn), math.sin(turn), 0.0])
    near = 1.0 - abs(step) / 2.0
    for height in (-0.2, 0.0, 0.3):
        for off, name in ((0.249, "bright side"), (0.251, "dark side"), (-0.3, "bright side")):
            ray = np.array([0.0, 0.0, -near]) + height * along + off * across
            assert seen(scene, ray) == [name]


def test_points_lie_at_even_field_angles_on_a_sphere():
    scene = ic.scenes.point_grid(0.8, count=(5, 3), spacing_deg=7.0, diameter_arcmin=3.0)
    assert len(scene.objects) == 15
    angles = []
    for item in scene.objects:
        x, y, z = np.array(item.shape.centre_m) / 0.8
        assert math.hypot(x, y, z) == pytest.approx(1.0)
        polar = math.degrees(math.acos(-z))
        turn = math.atan2(y, x)
        angles.append((polar * math.cos(turn), polar * math.sin(turn)))
        assert 2 * math.atan(item.shape.radius_m / 0.8) == pytest.approx(3 * ARCMIN)
    wanted = [(7.0 * (i - 2), 7.0 * (j - 1)) for j in range(3) for i in range(5)]
    np.testing.assert_allclose(angles, wanted, atol=1e-6)


@pytest.mark.parametrize(
    "call",
    [
        lambda: ic.scenes.slanted_edge(1.0, depth_step_m=2.0),
        lambda: ic.scenes.slanted_edge(1.0, depth_step_m=math.nan),
        lambda: ic.scenes.slanted_edge(1.0, offset_m=math.inf),
        lambda: ic.scenes.slanted_edge(1.0, offset_m=-2.0),
        lambda: ic.scenes.point_grid(count=5),
        lambda: ic.scenes.point_grid(count=(0, 5)),
        lambda: ic.scenes.point_grid(count=(37, 37)),
        lambda: ic.scenes.point_grid(spacing_deg=0.0),
        lambda: ic.scenes.point_grid(-1.0),
    ],
)
def test_impossible_edges_and_points_are_refused(call):
    with pytest.raises(ic.InvalidInputError):
        call()


# ---------------------------------------------------------------------------------- chess, Cornell


def test_pieces_have_the_sizes_of_a_small_real_set():
    # ISET3d: diameter and height, mm; the king's cross adds 6 mm.
    sizes = {
        "pawn": (12.8, 23.2),
        "rook": (14.0, 26.7),
        "knight": (14.9, 33.3),
        "bishop": (15.0, 39.3),
        "queen": (16.6, 42.1),
        "king": (17.0, 41.4 + 6.0),
    }
    assert set(sizes) == set(PIECES)
    for name, (diameter, height) in sizes.items():
        body = solid(chess_piece(name))
        assert body.is_watertight
        assert body.volume > 0
        np.testing.assert_allclose(body.extents * 1e3, (diameter, height, diameter), atol=1e-6)
        assert body.bounds[0][1] == 0.0


def test_the_game_begins_with_thirty_two_pieces_on_their_squares():
    scene = ic.scenes.chess_set()
    assert len(scene.find("white *")) == len(scene.find("black *")) == 16
    assert len(scene.find("* pawn *")) == 16
    board = shape_of(scene, "board")
    assert board.edge_u_m[0] == pytest.approx(8 * 0.0236)
    (texture,) = [item.material.texture for item in scene.objects if item.name == "board"]
    for name, square in (("white queen d1", (3, 0)), ("black king e8", (4, 7))):
        matrix = shape_of(scene, name).matrix
        place = (np.array(square) + 0.5) / 8
        wanted = (
            np.array(board.corner_m)
            + place[0] * np.array(board.edge_u_m)
            + place[1] * np.array(board.edge_v_m)
        )
        np.testing.assert_allclose(matrix[:3, 3], wanted, atol=1e-12)
        # The queen stands on her colour; so does the black king on white.
        assert texture.weights(*place)[0] == texture.largest
    assert texture.weights(1 / 16, 1 / 16)[0] < texture.largest
    pawns = {id(shape_of(scene, name).mesh) for name in scene.find("* pawn *")}
    assert len(pawns) == 1
    # Knights look at the opponent.
    for side, sign in (("white knight b1", -1.0), ("black knight g8", 1.0)):
        ahead = shape_of(scene, side).matrix[:3, :3] @ [1.0, 0.0, 0.0]
        np.testing.assert_allclose(ahead, (0.0, 0.0, sign), atol=1e-12)


def test_a_white_sheet_on_the_table_has_the_stated_luminance():
    scene = ic.scenes.chess_set(luminance_cd_m2=80.0)
    (sun,) = scene.lights
    towards = np.array(sun.towards) / np.linalg.norm(sun.towards)
    # Lambert: radiance is irradiance times the cosine over pi, plus that of the even sky.
    total = sun.irradiance.luminance_cd_m2() * towards[1] / math.pi
    assert total + scene.background.luminance_cd_m2() == pytest.approx(80.0)


def test_positions_follow_the_notation():
    scene = ic.scenes.chess_set(position="8/8/8/3k4/8/8/1P6/6K1")
    names = [item.name for item in scene.objects[3:]]
    assert names == ["black king d5", "white pawn b2", "white king g1"]
    varnished = ic.scenes.chess_set(finish="varnished")
    assert isinstance(varnished.objects[-1].material, ic.Coated)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"position": "8/8"}, "eight ranks"),
        ({"position": "9/8/8/8/8/8/8/8"}, "eight ranks"),
        ({"position": "ppppppppp/8/8/8/8/8/8/8"}, "eight ranks"),
        ({"position": "x7/8/8/8/8/8/8/8"}, "eight ranks"),
        ({"position": None}, "position"),
        ({"distance_m": 0.0}, "distance_m"),
        ({"eye_height_m": -1.0}, "eye_height_m"),
        ({"finish": "gold"}, "finish"),
        ({"luminance_cd_m2": "bright"}, "luminance_cd_m2"),
    ],
)
def test_an_impossible_game_is_refused(options, message):
    with pytest.raises(ic.InvalidInputError, match=message):
        ic.scenes.chess_set(**options)


def test_the_paints_of_the_cornell_box_are_those_measured():
    # Rows of the published table: nm, white, green, red.
    rows = [
        (400, 0.343, 0.092, 0.040),
        (456, 0.777, 0.103, 0.060),
        (500, 0.747, 0.285, 0.058),
        (508, 0.732, 0.390, 0.055),
        (600, 0.740, 0.160, 0.287),
        (700, 0.737, 0.159, 0.642),
    ]
    for nm, *values in rows:
        found = [cornell_paints()[name].at([nm])[0] for name in ("white", "green", "red")]
        assert found == values
    assert all(len(s.values) == 76 for s in cornell_paints().values())


def test_the_cornell_box_is_built_as_measured():
    scene = ic.scenes.cornell_box(1500.0)
    assert seen(scene, [(-0.25, 0, -1), (0.25, 0, -1), (0, 0.26, -0.9), (-0.22, -0.27, -0.95)]) == [
        "left wall",
        "right wall",
        "ceiling",
        "floor",
    ]
    for name, height in (("short block", 0.165), ("tall block", 0.330)):
        body = solid(shape_of(scene, name))
        assert body.is_watertight
        assert body.volume > 0
        assert body.extents[1] == pytest.approx(height)
        # It stands on the floor, 273 mm below the eye.
        assert body.bounds[0][1] == pytest.approx(-0.273)
    # The short block stands in front on the right, the tall one behind on the left.
    short, tall = (solid(shape_of(scene, f"{n} block")).centroid for n in ("short", "tall"))
    assert short[0] > 0 > tall[0]
    assert short[2] > tall[2]
    # Published corner of its base: 290, 0, 114 mm, from a camera at 278, 273, -800.
    corner = [-(0.290 - 0.278), -0.273, -(0.114 + 0.8)]
    gaps = np.linalg.norm(shape_of(scene, "short block").vertices_m - corner, axis=1)
    assert gaps.min() < 1e-12
    lamp = scene.objects[0]
    normal = np.cross(lamp.shape.edge_u_m, lamp.shape.edge_v_m)
    assert normal[1] < 0 == normal[0] == normal[2]
    assert np.linalg.norm(normal) == pytest.approx(0.130 * 0.105)
    assert lamp.material.sides == "front"
    assert lamp.material.radiance.luminance_cd_m2() == pytest.approx(1500.0)
    with pytest.raises(ic.InvalidInputError, match="luminance_cd_m2"):
        ic.scenes.cornell_box(0.0)


def test_every_scene_is_the_same_each_time_and_lies_before_the_eye():
    for name in ("letters_at_depth", "snellen_chart", "macbeth_chart", "chess_set", "tca_grid"):
        scene = getattr(ic.scenes, name)()
        assert scene.digest() == getattr(ic.scenes, name)().digest()
        # The eye of the chess player looks over the board.
        down = -0.2 if name == "chess_set" else 0.001
        assert seen(scene, (0.001, down, -1.0)) != [None]

"""Editing scenes, placing one eye and two, against vector formulas."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import isetcl as ic
from isetcl.scene.affine import moved_shape
from isetcl.scene.gaze import ROTATION_CENTRE_MM
from isetcl.scene.view import intersect

WHITE = ic.Spectrum.equal_energy(100.0)
GREY = ic.Diffuse(ic.Spectrum.constant(0.5, "grey"))
TRIANGLES = ic.Mesh(
    [[0, 0, -2], [1, 0, -2], [0, 1, -2.5], [-0.8, -0.5, -1.5]],
    [[0, 1, 2], [0, 3, 1]],
    [[0, 0, 1]] * 4,
    [[0, 0], [1, 0], [0, 1], [1, 1]],
)
QUAD = ic.Quad((-1, -1, -2), (2, 0, -0.5), (0.3, 2, 0))
DISC = ic.Disc((0.1, 0.2, -2), 1.2, (0.2, 0.1, 1.0))
SPHERE = ic.Sphere((0.1, -0.1, -2), 0.8)
SHAPES = {
    "quad": QUAD,
    "disc": DISC,
    "sphere": SPHERE,
    "mesh": TRIANGLES,
    "instance": ic.Instance(TRIANGLES, np.diag([1.0, 1.5, 1.0, 1.0])),
}
TURN = Rotation.from_rotvec(0.7 * np.array([0.2, 0.9, -0.4])).as_matrix()
SIMILAR = 1.7 * TURN
SHEARED = TURN @ np.diag([1.4, 0.8, 1.1]) @ Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()


def affine(linear, offset=(0.0, 0.0, 0.0)):
    matrix = np.eye(4)
    matrix[:3, :3] = linear
    matrix[:3, 3] = offset
    return matrix


def room():
    near = ic.SceneObject("pawn 1", ic.Sphere((0.1, 0.0, -1.0), 0.02), GREY)
    far = ic.SceneObject("pawn 2", ic.Sphere((-0.1, 0.0, -1.5), 0.02), GREY)
    board = ic.SceneObject("board", ic.Quad((-1, -0.1, 0), (2, 0, 0), (0, 0, -2)), GREY)
    lamp = ic.SceneObject("lamp", ic.Disc((0, 1, -1), 0.1, (0, -1, 0)), ic.Emission(WHITE))
    lights = (
        ic.PointLight((0.0, 2.0, -1.0), WHITE),
        ic.SpotLight((1.0, 2.0, 0.0), (0.0, -1.0, -0.5), WHITE),
        ic.DistantLight((0.0, 1.0, 1.0), WHITE),
    )
    return ic.Scene((near, far, board, lamp), ic.Environment(WHITE), "room", lights)


def shape_of(scene, name):
    (found,) = [item.shape for item in scene.objects if item.name == name]
    return found


@pytest.mark.parametrize("linear", [TURN, SIMILAR, SHEARED], ids=["turn", "similar", "sheared"])
@pytest.mark.parametrize("kind", SHAPES)
def test_a_moved_shape_meets_moved_rays_at_the_same_point(kind, linear):
    rng = np.random.default_rng(4)
    shape, offset = SHAPES[kind], np.array([0.3, -0.4, 0.7])
    origins = rng.normal(scale=0.2, size=(400, 3))
    directions = rng.normal(size=(400, 3)) * [0.5, 0.5, 0.2] + [0, 0, -2]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    before = intersect(shape, origins, directions)
    moved = moved_shape(shape, affine(linear, offset), is_patterned=True)
    along = directions @ linear.T
    length = np.linalg.norm(along, axis=1)
    after = intersect(moved, origins @ linear.T + offset, along / length[:, None])
    hit = np.isfinite(before.distance_m)
    assert 60 < hit.sum() < 400
    is_faceted = isinstance(moved, ic.Mesh) and not isinstance(shape, ic.Mesh)
    if not is_faceted:
        np.testing.assert_array_equal(np.isfinite(after.distance_m), hit)
    both = hit & np.isfinite(after.distance_m)
    assert both.sum() >= 0.97 * hit.sum()
    # The chord of a facet lies 3e-4 of the radius inside; oblique rays see more of it.
    tolerance = 0.03 if is_faceted else 1e-12
    np.testing.assert_allclose(
        after.distance_m[both], (before.distance_m * length)[both], rtol=0, atol=tolerance
    )
    if kind in ("disc", "mesh", "instance", "quad"):
        np.testing.assert_allclose(after.u[both], before.u[both], atol=1e-3)
        np.testing.assert_allclose(after.v[both], before.v[both], atol=1e-3)


def test_the_mesh_of_a_sphere_has_its_texture_and_its_normals():
    mesh = moved_shape(SPHERE, affine(TURN), is_patterned=True)
    assert isinstance(mesh, ic.Mesh)
    away = (mesh.vertices_m - TURN @ SPHERE.centre_m) / SPHERE.radius_m
    np.testing.assert_allclose(mesh.normals, away, atol=1e-12)
    local = away @ TURN
    u = np.arctan2(local[:, 0], local[:, 2]) / (2 * np.pi)
    off_pole = np.abs(local[:, 1]) < 0.999
    turn = (u - mesh.uv[:, 0])[off_pole]
    np.testing.assert_allclose(turn, np.rint(turn), atol=1e-9)
    np.testing.assert_allclose(
        0.5 + np.arcsin(np.clip(local[:, 1], -1, 1)) / np.pi, mesh.uv[:, 1], atol=1e-6
    )
    corners = mesh.triangles_m
    outwards = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    middle = corners.mean(axis=1) - TURN @ SPHERE.centre_m
    assert np.all(np.einsum("ij,ij->i", outwards, middle) > 0)


def test_round_things_stay_round_where_they_can():
    assert isinstance(moved_shape(SPHERE, affine(SIMILAR)), ic.Sphere)
    assert moved_shape(SPHERE, affine(SIMILAR)).radius_m == pytest.approx(1.7 * 0.8)
    assert isinstance(
        moved_shape(SPHERE, affine(np.eye(3), (1, 2, 3)), is_patterned=True), ic.Sphere
    )
    assert isinstance(moved_shape(SPHERE, affine(SHEARED)), ic.Mesh)
    disc = moved_shape(DISC, affine(SIMILAR))
    assert isinstance(disc, ic.Disc)
    normal = SIMILAR @ np.array(DISC.normal)
    np.testing.assert_allclose(disc.normal, normal / np.linalg.norm(normal), atol=1e-12)
    # A disc in the plane of an even stretch stays one, whatever happens across it.
    flat = ic.Disc((0, 0, -1), 0.5)
    assert moved_shape(flat, affine(np.diag([2.0, 2.0, 5.0]))) == ic.Disc((0, 0, -5), 1.0)
    assert isinstance(moved_shape(flat, affine(np.diag([2.0, 1.0, 1.0]))), ic.Mesh)


def test_fronts_stay_fronts():
    fronts = np.cross(QUAD.edge_u_m, QUAD.edge_v_m)
    moved = moved_shape(QUAD, affine(SHEARED))
    wanted = np.linalg.inv(SHEARED).T @ fronts * np.linalg.det(SHEARED)
    np.testing.assert_allclose(np.cross(moved.edge_u_m, moved.edge_v_m), wanted, atol=1e-12)
    with pytest.raises(ic.InvalidInputError, match="must not mirror"):
        room().transformed("board", np.diag([-1.0, 1.0, 1.0, 1.0]))


def test_an_instance_keeps_its_mesh():
    scene = ic.Scene((ic.SceneObject("it", ic.Instance(TRIANGLES, affine(TURN)), GREY),))
    moved = scene.transformed("it", affine(SHEARED, (1, 2, 3))).objects[0].shape
    assert moved.mesh is TRIANGLES
    np.testing.assert_allclose(moved.matrix, affine(SHEARED, (1, 2, 3)) @ affine(TURN))


def test_names_are_found_by_pattern():
    scene = room()
    assert scene.find("pawn*") == ("pawn 1", "pawn 2")
    assert scene.find("*") == ("pawn 1", "pawn 2", "board", "lamp")
    assert scene.find("pawn ?") == ("pawn 1", "pawn 2")
    odd = ic.Scene((ic.SceneObject("a[1]", SPHERE, GREY), ic.SceneObject("a1", SPHERE, GREY)))
    assert odd.find("a[1]") == ("a[1]",)


@pytest.mark.parametrize("wrong", ["bord", "BOARD", "Board*"])
def test_a_name_that_fits_nothing_is_answered_with_near_ones(wrong):
    for call in (
        lambda s: s.find(wrong),
        lambda s: s.moved(wrong, (0, 0, 0)),
        lambda s: s.without(wrong),
        lambda s: s.recoloured(wrong, ic.Spectrum.constant(0.1)),
    ):
        with pytest.raises(ic.InvalidInputError, match="did you mean 'board'"):
            call(room())


def test_edits_leave_the_first_scene_alone_and_touch_only_what_is_named():
    scene = room()
    before = scene.digest()
    moved = scene.moved("pawn*", (0.0, 0.5, -1.0))
    assert shape_of(moved, "pawn 1").centre_m == pytest.approx((0.1, 0.5, -2.0))
    assert shape_of(moved, "pawn 2").centre_m == pytest.approx((-0.1, 0.5, -2.5))
    assert shape_of(moved, "board") == shape_of(scene, "board")
    assert (moved.lights, moved.background, moved.name) == (
        scene.lights,
        scene.background,
        scene.name,
    )
    assert scene.digest() == before != moved.digest()


def test_a_turn_about_the_own_centre_leaves_it_there_and_follows_the_right_hand():
    scene = room().rotated("board", "y", 90.0)
    board = shape_of(scene, "board")
    centre = np.array(board.corner_m) + (np.array(board.edge_u_m) + board.edge_v_m) / 2
    np.testing.assert_allclose(centre, (0, -0.1, -1), atol=1e-12)
    # A quarter turn about +y takes +x to -z, and -z to -x.
    np.testing.assert_allclose(board.edge_u_m, (0, 0, -2), atol=1e-12)
    np.testing.assert_allclose(board.edge_v_m, (-2, 0, 0), atol=1e-12)
    about = room().rotated("pawn 1", (0, 0, 2), 90.0, about_m=(0, 0, 0))
    np.testing.assert_allclose(shape_of(about, "pawn 1").centre_m, (0, 0.1, -1), atol=1e-12)


def test_turns_agree_with_scipy():
    axis, point = np.array([0.3, -0.5, 0.8]), np.array([1.0, 2.0, 3.0])
    scene = ic.Scene((ic.SceneObject("it", TRIANGLES, GREY),)).rotated("it", axis, 37.0, point)
    turn = Rotation.from_rotvec(np.radians(37.0) * axis / np.linalg.norm(axis))
    wanted = turn.apply(TRIANGLES.vertices_m - point) + point
    np.testing.assert_allclose(scene.objects[0].shape.vertices_m, wanted, atol=1e-12)


def test_scaling_is_about_the_centre_or_a_point():
    scene = room()
    larger = shape_of(scene.scaled("pawn 1", 3.0), "pawn 1")
    assert (larger.radius_m, larger.centre_m) == (pytest.approx(0.06), pytest.approx((0.1, 0, -1)))
    about = shape_of(scene.scaled("pawn 1", 2.0, (0.0, 0.0, 0.0)), "pawn 1")
    assert about.centre_m == pytest.approx((0.2, 0.0, -2.0))
    stretched = shape_of(scene.scaled("pawn 1", (1, 2, 1)), "pawn 1")
    extent = np.ptp(stretched.vertices_m, axis=0)
    np.testing.assert_allclose(extent, (0.04, 0.08, 0.04), rtol=1e-3)


def test_materials_change_and_patterns_stay():
    red = ic.Spectrum(np.array([400.0, 700.0]), np.array([0.1, 0.8]), "red")
    board = ic.Diffuse(ic.Spectrum.constant(0.5), ic.Checkerboard(4, 4))
    picture = ic.Diffuse((ic.Spectrum.constant(0.3),) * 3, ic.Image(np.ones((2, 2, 3))))
    glossy = ic.Coated(ic.Spectrum.constant(0.5), roughness=0.2)
    scene = room().with_material("board", board).with_material("pawn 1", picture)
    scene = scene.with_material("pawn 2", glossy).recoloured("board", red).recoloured("pawn*", red)
    first, second, third, _ = (item.material for item in scene.objects)
    assert (first.reflectance, first.texture) == (red, None)
    assert (second.reflectance, second.roughness) == (red, 0.2)
    assert (third.reflectance, third.texture) == (red, board.texture)
    with pytest.raises(ic.InvalidInputError, match=r"lamp.*Emission has no reflectance"):
        scene.recoloured("lamp", red)


def test_a_new_material_takes_the_place_of_all_light_from_the_old_one():
    glowing = ic.SceneObject("glow", SPHERE, GREY, emission=ic.Emission(WHITE))
    mirror = ic.Mirror(ic.Spectrum.constant(0.9))
    (item,) = ic.Scene((glowing,)).with_material("glow", mirror).objects
    assert (item.material, item.emission) == (mirror, None)
    (item,) = ic.Scene((glowing,)).with_material("glow", ic.Emission(WHITE)).objects
    assert item.emitted is item.material


def test_things_come_and_go():
    scene = room()
    more = ic.SceneObject("more", SPHERE, GREY)
    assert scene.added(more, more).objects[-2:] == (more, more)
    assert [item.name for item in scene.without("pawn*").objects] == ["board", "lamp"]
    assert scene.with_lights().lights == ()
    lamp = ic.PointLight((0, 0, 0), WHITE)
    assert scene.with_lights(lamp).lights == (lamp,)
    assert scene.with_background(None).background is None


def points_of(scene):
    """Centres of the two pawns and of a point light, (3, 3)."""
    return np.array(
        [
            shape_of(scene, "pawn 1").centre_m,
            shape_of(scene, "pawn 2").centre_m,
            scene.lights[0].position_m,
        ]
    )


def test_an_eye_elsewhere_sees_its_target_straight_ahead_at_its_distance():
    scene, eye = room(), np.array([0.4, 0.3, 0.2])
    seen = scene.seen_from(eye, (0.1, 0.0, -1.0))
    distance = np.linalg.norm(eye - [0.1, 0.0, -1.0])
    np.testing.assert_allclose(shape_of(seen, "pawn 1").centre_m, (0, 0, -distance), atol=1e-12)
    before, after = points_of(scene), points_of(seen)
    np.testing.assert_allclose(
        np.linalg.norm(after, axis=1), np.linalg.norm(before - eye, axis=1), rtol=1e-12
    )
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(after, axis=0), axis=1),
        np.linalg.norm(np.diff(before, axis=0), axis=1),
        rtol=1e-12,
    )


def test_a_gaze_to_the_right_and_up_brings_things_left_and_down():
    scene = room()
    seen = scene.seen_from(gaze_deg=(20.0, 0.0))
    # What lay straight ahead now lies 20 degrees to the left.
    ahead = scene.added(ic.SceneObject("ahead", ic.Sphere((0, 0, -3), 0.1), GREY))
    centre = shape_of(ahead.seen_from(gaze_deg=(20.0, 0.0)), "ahead").centre_m
    angle = math.radians(20.0)
    np.testing.assert_allclose(centre, (-3 * math.sin(angle), 0, -3 * math.cos(angle)), atol=1e-12)
    centre = shape_of(ahead.seen_from(gaze_deg=(0.0, 10.0)), "ahead").centre_m
    angle = math.radians(10.0)
    np.testing.assert_allclose(centre, (0, -3 * math.sin(angle), -3 * math.cos(angle)), atol=1e-12)
    # Lights and surroundings turn along.
    turn = Rotation.from_euler("y", 20.0, degrees=True).as_matrix()
    np.testing.assert_allclose(seen.lights[1].direction, turn @ scene.lights[1].direction)
    np.testing.assert_allclose(seen.lights[2].towards, turn @ scene.lights[2].towards)
    np.testing.assert_allclose(seen.background.rotation, turn, atol=1e-12)


def test_the_surroundings_look_the_same_from_a_turned_eye():
    panorama = ic.Image(np.random.default_rng(0).uniform(size=(16, 32)))
    scene = ic.Scene((), ic.Environment(WHITE, panorama, TURN))
    seen = scene.seen_from((1, 2, 3), (0.4, 1.0, -2.0), up=(0.1, 1, 0)).background
    forward = np.array([0.4, 1.0, -2.0]) - [1, 2, 3]
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.1, 1.0, 0.0])
    right /= np.linalg.norm(right)
    to_eye = np.array([right, np.cross(right, forward), -forward])
    directions = np.random.default_rng(1).normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    before = scene.background.coordinates(directions)
    after = seen.coordinates(directions @ to_eye.T)
    np.testing.assert_allclose(after, before, atol=1e-12)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"eye_at_m": (0, 0), "look_at_m": (0, 0, -1)}, "eye_at_m must be three"),
        ({"look_at_m": (0, 0, 0)}, "must differ"),
        ({"look_at_m": (0, 1, 0)}, "must not look along up"),
        ({"look_at_m": (0, 0, -1), "gaze_deg": (0, 0)}, "not both"),
        ({"gaze_deg": 3.0}, "gaze_deg must be two numbers"),
        ({"gaze_deg": (0.0, 90.0)}, "gaze_deg"),
        ({"up": (0, 0, 0)}, "up must not be zero"),
    ],
)
def test_an_impossible_gaze_is_refused(options, message):
    with pytest.raises(ic.InvalidInputError, match=message):
        room().seen_from(**options)


@pytest.mark.parametrize("distance", [0.2, 0.5, 3.0])
def test_the_lines_of_sight_meet_at_the_point_at_the_vergence_angle(distance):
    ipd, c = 0.064, ROTATION_CENTRE_MM * 1e-3
    left, right = room().binocular(64.0, (0, 0, -distance))
    mark = ic.SceneObject("mark", ic.Sphere((0, 0, -distance), 0.001), GREY)
    for scene in room().added(mark).binocular(64.0, (0, 0, -distance)):
        # From the vertex: the way from the centre of rotation less the part inside the eye.
        wanted = math.hypot(ipd / 2, distance + c) - c
        np.testing.assert_allclose(shape_of(scene, "mark").centre_m, (0, 0, -wanted), atol=1e-12)
    # The axes of the two views: how a distant light turned between them.
    first, second = (np.array(scene.lights[2].towards) for scene in (left, right))
    turn, _ = Rotation.align_vectors(
        [first, left.lights[1].direction], [second, right.lights[1].direction]
    )
    vergence = 2 * math.atan(ipd / 2 / (distance + c))
    assert turn.magnitude() == pytest.approx(vergence, abs=1e-9)
    assert (left.name, right.name) == ("room, left eye", "room, right eye")


def test_the_disparity_of_a_nearer_point_follows_from_its_directions():
    ipd, c = 0.063, ROTATION_CENTRE_MM * 1e-3
    fixated, near = np.array([0.05, 0.0, -1.0]), np.array([0.02, 0.0, -0.7])
    scene = ic.Scene((ic.SceneObject("near", ic.Sphere(tuple(near), 0.001), GREY),))
    angles = []
    for side, view in zip((-0.5, 0.5), scene.binocular(63.0, fixated), strict=True):
        centre = np.array([side * ipd, 0.0, c])
        axis = (fixated - centre) / np.linalg.norm(fixated - centre)
        ray = near - (centre + c * axis)
        wanted = math.atan2(ray[0], -ray[2]) - math.atan2(axis[0], -axis[2])
        x, y, z = view.objects[0].shape.centre_m
        assert math.atan2(x, -z) == pytest.approx(wanted, abs=1e-12)
        assert y == pytest.approx(0.0, abs=1e-12)
        angles.append(wanted)
    # What is nearer than the point of fixation is seen crossed: to the right by the left eye.
    assert angles[0] > angles[1]


def test_parallel_eyes_see_the_scene_shifted():
    scene = room()
    left, right = scene.binocular(60.0)
    np.testing.assert_allclose(points_of(left) - points_of(scene), [[0.03, 0, 0]] * 3, atol=1e-12)
    np.testing.assert_allclose(points_of(right) - points_of(scene), [[-0.03, 0, 0]] * 3, atol=1e-12)


def test_eyes_turn_without_twist():
    """Listing's law: the axis of the turn lies in the plane x, y."""
    left, _ = room().binocular(63.0, (0.3, -0.4, -0.8), rotation_centre_mm=13.0)
    before = [room().lights[1].direction, room().lights[2].towards]
    turn, _ = Rotation.align_vectors([left.lights[1].direction, left.lights[2].towards], before)
    assert abs(turn.as_rotvec()[2]) < 1e-9 < turn.magnitude()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.0,), "interpupillary_distance_mm"),
        ((63.0, (0, 0, 1)), "in front of the eyes"),
        ((63.0, (0, 0)), "verge_on_m must be three"),
        (("wide",), "interpupillary_distance_mm must be a number"),
    ],
)
def test_impossible_eyes_are_refused(arguments, message):
    with pytest.raises(ic.InvalidInputError, match=message):
        room().binocular(*arguments)


@pytest.mark.parametrize(
    "call",
    [
        lambda s: s.moved("board", (0, 0)),
        lambda s: s.moved("board", None),
        lambda s: s.moved(3, (0, 0, 0)),
        lambda s: s.rotated("board", "w", 3.0),
        lambda s: s.rotated("board", (0, 0, 0), 3.0),
        lambda s: s.rotated("board", "x", math.nan),
        lambda s: s.rotated("board", "x", 3.0, about_m="here"),
        lambda s: s.scaled("board", 0.0),
        lambda s: s.scaled("board", (1, 2)),
        lambda s: s.transformed("board", np.eye(3)),
        lambda s: s.transformed("board", np.zeros((4, 4))),
        lambda s: s.with_material("board", "paint"),
        lambda s: s.recoloured("board", "red"),
        lambda s: s.recoloured("board", ic.Spectrum.constant(1.5)),
        lambda s: s.added("chair"),
        lambda s: s.added([ic.SceneObject("it", SPHERE, GREY)]),
        lambda s: s.with_lights("sun"),
        lambda s: s.with_background("sky"),
    ],
)
def test_junk_is_refused(call):
    with pytest.raises(ic.InvalidInputError) as caught:
        call(room())
    assert len(str(caught.value)) > 15

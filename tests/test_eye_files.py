"""Eyes written to files and read from them: JSON, Zemax, ISET3d."""

import dataclasses
import json
import math

import numpy as np
import pytest
from zmx_files import ISET3D, NAVARRO, SINGLET, TILTED, as_opticstudio_writes

import isetcl as ic
from isetcl.eye.sequential import trace
from isetcl.eye.shapes.height_map import HeightMap


def every_part():
    """An eye with every kind of part; the parts need not make optical sense together."""
    rng = np.random.default_rng(1)
    sellmeier = ic.SellmeierDispersion((1.03961212, 0.231792344), (0.00600069867, 0.0200179144))
    media = [
        ic.Medium("a", ic.ConstantIndex(1.1 + 1.0 / 3.0)),
        ic.Medium("b", ic.CornuDispersion(1.3221, 7.0096)),
        ic.Medium("c", ic.AbbeDispersion(1.42, 50.0, "cauchy")),
        ic.Medium("d", sellmeier),
        ic.Medium("e", ic.TabulatedDispersion((400.0, 700.0), (1.34, 1.33))),
        ic.Medium("f", ic.NavarroDispersion(1.3565, 1.3407, 1.3341, 1.3273)),
    ]
    shapes = [
        None,
        ic.Biconic(1.0 / 7.3, -0.1),
        ic.Toric(0.1),
        ic.EvenAsphere([1e-4, 1e-5 / 3.0]),
        ic.ZernikeSag([0.0, 1e-3, 2e-3 / 7.0], 3.0),
        HeightMap(1e-3 * rng.standard_normal((5, 6)), 8.0, 8.5),
    ]
    surfaces = tuple(
        ic.Surface(
            f"s{i}", 0.7 * i, 0.1 + 0.001 / (i + 3), -0.1 * i, 3.0, media[i], shapes[i], placement
        )
        for i, placement in enumerate(
            [None, None, ic.Placement((0.1, -0.2), (1.0 / 3.0, 2.0), 12.3), None, None, None]
        )
    )
    return ic.Eye(
        "every",
        surfaces,
        ic.Stop(5.0, 2.0, (0.1, 0.0), 1.0 / 3.0, 15.0),
        ic.Retina.ellipsoid(24.0, (11.4, 11.3, 10.1), ic.Placement((0.5, 0.1))),
    )


@pytest.mark.parametrize("name", ic.eyes.names())
def test_every_model_eye_comes_back_from_json_as_the_same_value(name):
    eye = ic.eyes.by_name(name, 10.0 / 3.0)
    assert ic.Eye.from_json(eye.to_json()) == eye
    changed = (
        eye.with_spectacle_refraction(-10.0 / 3.0)
        .with_cornea(front_radius_mm=7.7)
        .with_pupil(2.7, "entrance")
    )
    assert ic.Eye.from_json(changed.to_json()) == changed


def test_an_eye_from_a_file_accommodates_like_the_one_that_was_written(tmp_path):
    near = ic.eyes.navarro(3.0, accommodation_parameter=1.0, hold="axial_length")
    eye = near.with_anterior_chamber_depth(3.4)
    file = tmp_path / "eye.json"
    text = eye.to_json(file)
    assert file.read_text(encoding="utf-8") == text
    for again in (ic.Eye.from_json(file), ic.Eye.from_json(str(file)), ic.load_eye(file)):
        assert again == eye
        assert again.accommodation_model.eye(2.5) == eye.accommodation_model.eye(2.5)


def test_every_kind_of_part_is_written_with_every_digit():
    eye = every_part()
    again = ic.Eye.from_json(eye.to_json())
    assert again.to_json() == eye.to_json()
    np.testing.assert_array_equal(
        again.surfaces[5].shape.heights_mm, eye.surfaces[5].shape.heights_mm
    )
    for old, new in zip(eye.surfaces[:5], again.surfaces[:5], strict=True):
        assert new == old
    assert (again.stop, again.retina) == (eye.stop, eye.retina)
    assert json.loads(json.dumps(eye.describe()))["retina"]["shape"]["kind"] == "Biconic"


def test_an_eye_of_a_file_can_be_named_like_a_model_eye(tmp_path):
    file = tmp_path / "mine.JSON"
    ic.eyes.navarro(3.0).with_axial_length(24.2).to_json(file)
    eye = ic.eyes.by_name(str(file), 2.0)
    assert (eye.stop.diameter_mm, eye.axial_length_mm) == pytest.approx((2.0, 24.2))
    near = ic.eyes.by_name(str(file), 2.0, 4.0)
    assert near.focus_vergence_dpt() == pytest.approx(4.0, abs=1e-6)
    with pytest.raises(ic.FileError, match="does not exist"):
        ic.eyes.by_name("none.json")


def edited(change):
    """The JSON of Navarro's eye after a change of its document."""
    document = json.loads(ic.eyes.navarro(3.0).to_json())
    change(document)
    return json.dumps(document)


def with_surface(**changes):
    return lambda d: d["eye"]["surfaces"][2].update(changes)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("{", "line 1, column 2: is no JSON"),
        ('{"a": NaN}', "numbers must be finite, got NaN"),
        ("{}", 'must be an object with "format"'),
        (edited(lambda d: d.update(version=2)), "written by a newer isetcl"),
        (edited(lambda d: d.update(version="1")), "version must be 1, got '1'"),
        (edited(lambda d: d.pop("eye")), "must have an 'eye'"),
        (edited(lambda d: d.update(eye=d["eye"]["stop"])), "eye must be of kind 'Eye', got Stop"),
        (edited(lambda d: d["eye"].pop("kind")), "eye: must have a 'kind'"),
        (edited(lambda d: d["eye"].pop("retina")), "eye: Eye needs retina"),
        (edited(with_surface(kind="Surfaec")), r"eye.surfaces\[2\]: unknown kind.*mean Surface"),
        (edited(with_surface(conik=1.0)), r"surfaces\[2\]: unknown field of Surface.*mean conic"),
        (edited(with_surface(conic="1")), r"surfaces\[2\]: .*conic must be a number"),
        (edited(with_surface(semi_diameter_mm=-1)), r"surfaces\[2\]: .*must be > 0 mm, got -1"),
        (edited(with_surface(shape={"kind": "Toric"})), r"surfaces\[2\].shape: Toric needs curv"),
        (edited(with_surface(medium_after=None)), r"medium_after must be a Medium"),
        (
            edited(lambda d: d["eye"]["accommodation_model"].update(pupil=3)),
            "eye.accommodation_model: pupil must be a PupilSpec, got 3",
        ),
        (edited(with_surface(vertex_z_mm=1e3)), "must lie behind 'lens front'"),
        (edited(with_surface()).replace('"conic"', '"kind": "Stop", "conic"'), "'kind' twice"),
        ('{"format": "isetcl eye", "version": 1, "eye": ' + "[" * 60 + "]" * 60 + "}", "nested"),
        ("{" + '"a": ' + "[" * 100000, "cannot be read|no JSON"),
        (edited(with_surface()).replace("-3.1316", "9" * 5000, 1), "cannot be read|smaller than"),
    ],
)
def test_a_broken_eye_file_names_the_place(text, match):
    with pytest.raises(ic.FileError, match=match):
        ic.Eye.from_json(text)


def test_files_that_are_none_are_refused(tmp_path):
    binary = tmp_path / "b.json"
    binary.write_bytes(b"PK\x03\x04\0\0\0")
    for path, match in (
        (tmp_path / "none.json", "does not exist"),
        (tmp_path, "no known suffix"),
        (tmp_path / "a.txt", r"no known suffix \(known: .json, .zmx, .dat\)"),
        (binary, "binary|no JSON"),
    ):
        with pytest.raises(ic.FileError, match=match):
            ic.load_eye(path)
    with pytest.raises(ic.FileError, match="is a folder"):
        ic.Eye.from_json(tmp_path)
    with pytest.raises(ic.FileError, match="cannot be written"):
        ic.eyes.navarro().to_json(tmp_path / "no" / "such" / "folder.json")
    with pytest.raises(ic.InvalidInputError, match="retina_distance_mm and"):
        ic.load_eye("a.zmx", retina_distance_mm=16.0)
    with pytest.raises(ic.InvalidInputError, match="media must be left out"):
        ic.load_eye("a.json", media={"LENS": ic.Medium("l", ic.ConstantIndex(1.4))})


def test_parts_of_the_user_s_own_cannot_be_written():
    class Mine:
        parameter_range = (0.0, 1.0)

        def eye(self, parameter):
            return ic.eyes.navarro()

    eye = dataclasses.replace(ic.eyes.navarro(), accommodation_model=Mine())
    with pytest.raises(ic.InvalidInputError, match="accommodation_model cannot be written: Mine"):
        eye.to_json()


def written(tmp_path, text, name="eye.zmx", encoding="utf-8"):
    file = tmp_path / name
    file.write_bytes(text.encode(encoding))
    return file


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
def test_a_zemax_file_of_navarro_s_eye_is_his_eye(tmp_path, encoding):
    eye = ic.load_eye(written(tmp_path, NAVARRO, encoding=encoding))
    model = ic.eyes.navarro(3.0)
    assert eye.name == "Navarro wide-angle eye"
    for got, expected in zip(eye.surfaces, model.surfaces, strict=True):
        assert got.name == expected.name
        assert got.vertex_z_mm == pytest.approx(expected.vertex_z_mm, abs=1e-12)
        assert got.curvature == pytest.approx(expected.curvature, rel=1e-14)
        assert got.conic == expected.conic
        assert (got.shape, got.placement) == (None, None)
    assert eye.surfaces[0].semi_diameter_mm == 5.5  # fixed in the file
    assert min(s.semi_diameter_mm for s in eye.surfaces[1:]) > 4.5  # automatic: clips nothing
    assert eye.stop == ic.Stop(model.stop.z_mm, 3.0)
    assert eye.retina.curvature == pytest.approx(-1.0 / 12.0)
    assert eye.axial_length_mm == pytest.approx(23.9203, abs=1e-12)
    # visisipy quotes a mean error of the indices of 4 to 7e-5.
    for wavelength in (458.0, 543.0, 589.3, 632.8):
        np.testing.assert_allclose(eye.indices(wavelength), model.indices(wavelength), atol=4e-4)
    assert eye.power_dpt(543.0) == pytest.approx(60.7242, abs=0.06)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8", "latin-1"])
def test_what_opticstudio_writes_besides_changes_nothing(tmp_path, encoding):
    text = as_opticstudio_writes()
    assert "\r\nMNUM 2 1\r\n" in text
    assert "\r\n  SCBD" in text
    got = ic.load_eye(written(tmp_path, text, encoding=encoding))
    assert got == ic.load_eye(written(tmp_path, NAVARRO))


def test_a_lens_of_zemax_gives_opticstudio_s_own_numbers(tmp_path):
    # Cardinal points, a ray at (1, 1) mm and the Zernike coefficients of OpticStudio 25.1.1, as the
    # tests of ZOSPy 2.2.0 (github.com/MREYE-LUMC/ZOSPy) record them.
    file = written(tmp_path, SINGLET)
    lens = ic.load_eye(file)
    points = lens.cardinal_points(543.0)
    assert points.focal_length_back_mm == pytest.approx(20.168067, abs=5e-7)
    assert points.focal_point_back_mm == pytest.approx(1.0 + 19.831933, abs=5e-7)
    assert points.principal_point_front_mm == pytest.approx(0.336134, abs=5e-7)
    wide = ic.load_eye(file, pupil_diameter_mm=3.0)
    start, along = np.array([[1.0, 1.0, -3.0]]), np.array([[0.0, 0.0, 1.0]])
    ray = trace(wide, start, along, 543.0, record_hits=True)
    expected = [
        (1.0, 1.0, 0.05006265674),
        (0.98494782874, 0.98494782874, 0.95143492457),
        (-0.0061213962872, -0.0061213962872, 20.792),
    ]
    np.testing.assert_allclose(ray.hits_mm[1:, 0], expected, rtol=0, atol=1e-11)
    leaving = [(-0.04982749, -0.04982749, 0.9975141315)]
    np.testing.assert_allclose(ray.directions, leaving, rtol=0, atol=1e-10)
    waves = lens.wavefront(0.0, 543.0).zernike(order=8).in_order("noll") / 0.543
    expected = {1: -0.01473686, 4: 0.00031809, 11: 0.00684048, 22: 3.01e-6}
    for j in range(1, 38):
        assert waves[j - 1] == pytest.approx(expected.get(j, 0.0), abs=1.5e-8), j


def test_comments_of_an_older_encoding_are_read(tmp_path):
    text = NAVARRO.replace("COMM cornea back", "COMM Hornhaut r\xfcckw\xe4rts")
    eye = ic.load_eye(written(tmp_path, text, encoding="latin-1"))
    assert len(eye.surfaces) == 4
    assert eye.surfaces[1].name.startswith("Hornhaut r")


def test_a_zemax_eye_can_be_changed_and_given_another_pupil(tmp_path):
    file = written(tmp_path, NAVARRO)
    assert ic.load_eye(file, pupil_diameter_mm=2.0).stop.diameter_mm == 2.0
    entrance = ic.load_eye(file, pupil_diameter_mm=2.0, pupil_plane="entrance")
    assert entrance.entrance_pupil().diameter_mm == pytest.approx(2.0, rel=1e-12)
    assert ic.load_eye(file).with_axial_length(25.0).axial_length_mm == pytest.approx(25.0)
    lens = ic.Medium("mine", ic.ConstantIndex(1.45))
    assert ic.load_eye(file, media={"Lens Front": lens}).surfaces[2].medium_after == lens


def test_an_absurd_automatic_semi_diameter_is_cut_to_what_exists(tmp_path):
    file = written(tmp_path, NAVARRO.replace("DIAM 1.2 0", "DIAM 1e9 0"))
    assert 4.5 < ic.load_eye(file).surfaces[1].semi_diameter_mm < 6.5


def test_lengths_in_centimetres_become_millimetres(tmp_path):
    eye = ic.load_eye(written(tmp_path, TILTED))
    assert [s.vertex_z_mm for s in eye.surfaces[:2]] == pytest.approx([0.0, 0.5])
    assert eye.surfaces[0].radius_mm == pytest.approx(8.0)
    assert eye.axial_length_mm == pytest.approx(23.6)
    assert eye.stop.z_mm == pytest.approx(3.5)
    assert eye.entrance_pupil(550.0).diameter_mm == pytest.approx(3.0, rel=1e-12)
    # The sag of an even asphere in cm: c rho^2 / (...) + a1 rho^2 + a2 rho^4 + a3 rho^6.
    rho = 0.25
    root = math.sqrt(1.0 - 0.8 * (1.25 * rho) ** 2)
    sag = 1.25 * rho**2 / (1.0 + root) + 0.01 * rho**2 + 0.03 * rho**4 - 0.02 * rho**6
    assert eye.surfaces[0].sag_mm(10.0 * rho) == pytest.approx(10.0 * sag, rel=1e-12)


def test_noll_s_terms_become_the_same_polynomials(tmp_path):
    # XDAT 7, 8 and 10 are Z5 = sqrt(6) r^2 sin 2t, Z6 = sqrt(6) r^2 cos 2t, Z8 = sqrt(8) (3 r^3 -
    # 2 r) cos t.
    surface = ic.load_eye(written(tmp_path, TILTED)).surfaces[1]
    x, y = 1.3, -0.7
    r, t = math.hypot(x, y) / 3.0, math.atan2(y, x)
    terms = (
        0.002 * math.sqrt(6.0) * r**2 * math.sin(2 * t)
        - 0.003 * math.sqrt(6.0) * r**2 * math.cos(2 * t)
        + 0.001 * math.sqrt(8.0) * (3 * r**3 - 2 * r) * math.cos(t)
    )
    radius = 10.0 / 1.5
    sphere = radius - math.sqrt(radius**2 - x * x - y * y)
    assert float(surface.sag_mm(x, y)) == pytest.approx(sphere + terms, abs=1e-12)


def test_even_powers_beside_noll_s_terms_are_added(tmp_path):
    powers = "  PARM 1 0.02\n  PARM 3 -0.3\n  XDAT 1 8 0 0 0\n"
    surface = ic.load_eye(written(tmp_path, TILTED)).surfaces[1]
    text = TILTED.replace("  XDAT 1 8 0 0 0\n", powers)
    both = ic.load_eye(written(tmp_path, text)).surfaces[1]
    x, y = 1.3, -0.7
    rho = math.hypot(x, y) / 10.0  # cm
    expected = 10.0 * (0.02 * rho**2 - 0.3 * rho**6)
    assert float(both.sag_mm(x, y) - surface.sag_mm(x, y)) == pytest.approx(expected, rel=1e-9)
    alone = text.replace("XDAT 7 ", "XDAT 77 ").replace("XDAT 8 ", "XDAT 78 ")
    alone = alone.replace("XDAT 10 ", "XDAT 79 ")
    shape = ic.load_eye(written(tmp_path, alone)).surfaces[1].shape
    assert shape.coefficients[:3] == pytest.approx((0.002, 0.0, -0.3e-5))


def zemax_frame(point, shift, angles_deg):
    """A point behind a coordinate break (order 0) in the frame before it, by three turns."""
    turned = np.array(point, dtype=float)
    for axis in (2, 1, 0):  # the last turn is about the innermost axis
        a = math.radians(angles_deg[axis])
        i, j = [(1, 2), (2, 0), (0, 1)][axis]
        u, v = turned[i], turned[j]
        turned[i], turned[j] = u * math.cos(a) - v * math.sin(a), u * math.sin(a) + v * math.cos(a)
    return turned + np.array([*shift, 0.0])


def test_coordinate_breaks_place_the_lens_and_their_inverse_restores_the_axis(tmp_path):
    eye = ic.load_eye(written(tmp_path, TILTED))
    front, back = eye.surfaces[2:]
    shift, angles = (0.2, -0.3), (4.0, -3.0, 20.0)
    expected = np.add(zemax_frame((0.0, 0.0, 4.0), shift, angles), [0.0, 0.0, 3.6])
    got = (*back.placement.decentre_mm, back.vertex_z_mm)
    np.testing.assert_allclose(got, expected, atol=1e-12)
    assert (*front.placement.decentre_mm, front.vertex_z_mm) == pytest.approx((0.2, -0.3, 3.6))
    for axis in np.eye(3):
        turned = zemax_frame(axis, (0.0, 0.0), angles)
        np.testing.assert_allclose(front.placement.rotation @ axis, turned, atol=1e-12)
    assert eye.retina.placement is None


def test_rays_through_the_tilted_eye_agree_with_batoid(tmp_path):
    batoid = pytest.importorskip("batoid")
    eye = ic.load_eye(written(tmp_path, TILTED))
    media = [batoid.ConstMedium(n) for n in (1.0, 1.376, 1.336, 1.42, 1.337)]
    base = batoid.CoordSys()
    lens = base.shiftLocal([0.2, -0.3, 3.6])
    for turn in (
        batoid.RotX(math.radians(4.0)),
        batoid.RotY(math.radians(-3.0)),
        batoid.RotZ(math.radians(20.0)),
    ):
        lens = lens.rotateLocal(turn)
    # In cm the coefficients of rho^4 and rho^6 are 0.03 and -0.02, in mm 1e-3 and 1e-5 of that.
    cornea = batoid.Sum(
        [
            batoid.Asphere(8.0, -0.2, [0.03e-3, -0.02e-5]),
            batoid.Paraboloid(1.0 / (2 * 0.01e-1)),
        ]
    )
    noll = np.zeros(9)
    noll[[5, 6, 8]] = 0.002, -0.003, 0.001
    back = batoid.Sum([batoid.Sphere(10.0 / 1.5), batoid.Zernike(noll, R_outer=3.0)])
    steps = (
        (cornea, base),
        (back, base.shiftLocal([0, 0, 0.5])),
        (batoid.Quadric(10.0 / 0.95, -1.5), lens),
        (batoid.Quadric(-10.0 / 1.7, -0.8), lens.shiftLocal([0, 0, 4.0])),
    )
    rng = np.random.default_rng(3)
    origins = np.column_stack([rng.uniform(-0.7, 0.7, (20, 2)), np.full(20, -5.0)])
    directions = np.column_stack([rng.uniform(-0.04, 0.04, (20, 2)), np.ones(20)])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rays = batoid.RayVector(*origins.T, *directions.T, 0.0, 550e-9)
    for i, (surface, place) in enumerate(steps):
        surface.refract(rays, media[i], media[i + 1], coordSys=place)
    batoid.Sphere(-12.5).intersect(rays, coordSys=base.shiftLocal([0, 0, 23.6]))
    rays = rays.toCoordSys(base)
    got = trace(eye, origins, directions, 550.0)
    assert got.passed.all()
    np.testing.assert_allclose(got.positions_mm, rays.r, atol=1e-9)


def test_toric_and_biconic_surfaces_and_an_oval_stop_are_read(tmp_path):
    text = NAVARRO.replace("  TYPE STANDARD\n  CURV 1.29", "  TYPE BICONICX\n  CURV 1.29")
    text = text.replace("  CONI -0.26\n", "  CONI -0.26\n  PARM 1 7.5\n  PARM 2 -0.1\n")
    text = text.replace(
        "  TYPE STANDARD\n  CURV 1.538", "  TYPE TOROIDAL\n  PARM 1 0\n  CURV 1.538"
    )
    text = text.replace("  STOP\n", "  STOP\n  ELAP 1.0 1.4 0\n")
    eye = ic.load_eye(written(tmp_path, text))
    assert eye.surfaces[0].shape == ic.Biconic(1.0 / 7.5, -0.1)
    assert eye.surfaces[1].shape == ic.Toric(0.0)
    assert eye.stop == ic.Stop(eye.stop.z_mm, 2.8, minor_diameter_mm=2.0, axis_deg=90.0)


def test_a_glass_can_be_picked_up_from_an_earlier_surface(tmp_path):
    # The stop repeats the aqueous of surface 2; values behind a pickup are placeholders.
    text = NAVARRO.replace(
        '  CURV 0.0 0 0 0 0 ""\n  DISZ 0\n  GLAS ___BLANK 1 0 1.33745 48.50',
        '  CURV 0.0 0 0 0 0 ""\n  DISZ 0\n  GLAS ___BLANK 2 2 1.5 40',
    )
    assert "___BLANK 2 2" in text
    assert ic.load_eye(written(tmp_path, text)) == ic.load_eye(written(tmp_path, NAVARRO))
    with pytest.raises(ic.FileError, match="must be picked up from an earlier surface, got '9'"):
        ic.load_eye(written(tmp_path, text.replace("___BLANK 2 2", "___BLANK 2 9")))


def swap(old, new, count=1):
    assert old in NAVARRO
    return NAVARRO.replace(old, new, count)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "got 0 surfaces"),
        (swap("MODE SEQ", "MODE NSC"), "line 2: MODE must be SEQ"),
        (swap("UNIT MM", "UNIT FT"), "line 4: UNIT names an unknown unit 'FT'"),
        (swap("SURF 3", "SURF 4"), "line 31: SURF must count from 0 up by 1"),
        (
            swap("TYPE STANDARD\n  CURV 9.8", "TYPE GRINSUR5\n  CURV 9.8"),
            r"line 40: surface 4 \(GRINSUR5\): surface type 'GRINSUR5' cannot be read",
        ),
        (swap("CURV 9.8", "CURV x9.8"), "line 41: CURV needs a number, got 'x9.8"),
        (swap("  CONI -3.1316", "  CONI"), "line 42: CONI needs 1 values, got 0"),
        (swap("  DISZ 4\n", "  DISZ INFINITY\n"), "surface 4.*DISZ. must be finite"),
        (swap("  DISZ 3.05", "  DISZ -3.05"), "surface 4.*runs backwards"),
        (swap("  DISZ 4\n", "  DISZ 17\n").replace("16.3203", "-1"), "retina must lie behind"),
        (swap("  STOP\n", ""), r"one stop surface \(STOP\), got 0"),
        (swap("  STOP\n", "  STOP\n  SQAP 1 1 0\n"), "line 33: SQAP is an aperture that cannot"),
        (
            swap("  STOP\n", "  STOP\n  OBDC 0.5 0\n"),
            "line 33: OBDC shifts the aperture of surface 3, which cannot be read; decentre",
        ),
        (
            swap("  CONI -3.1316\n", "  CONI -3.1316\n  SCBD 1 0 0 0 0 9.0E+01 0 0\n"),
            "line 43: SCBD tilts or decentres surface 4 in its properties, which cannot be read",
        ),
        (swap("DIAM 1.5 1", "DIAM 0 1"), "stop must have a semi-diameter; pass pupil_diameter_mm"),
        (
            swap("___BLANK 1 0 1.42011 46.38", "LENS 0 0 1.5 40"),
            r"surface 4 .*glass 'LENS' \(line 44\) stands in a catalogue.*media={'LENS'",
        ),
        (swap("___BLANK 1 0 1.42011 46.38", "MIRROR 0 0"), "no mirrors"),
        (
            swap("___BLANK 1 0 1.42011 46.38", "___BLANK 1 0 1.42").replace(
                "1.42 0 0 0 0 0 0", "1.42"
            ),
            "as its 4th and 5th",
        ),
        (
            swap("___BLANK 1 0 1.42011 46.38", "___BLANK 1 0 0.5 46"),
            r"index of a model glass \(line 44\) must lie between 1 and 5",
        ),
        (swap("1.42011 46.38", "1.42011 1e-320"), "Abbe number .line 44. must lie between 5 and"),
        (swap("CURV -8.33", "CURV 8.33"), "surface 6.*curvature must be <= 0"),
        (
            swap("  TYPE STANDARD\n  CURV 1.53", "  TYPE TOROIDAL\n  PARM 2 1e-3\n  CURV 1.53"),
            "surface 2 .TOROIDAL.*no polynomial",
        ),
        (
            swap(
                "  TYPE STANDARD\n  CURV 1.53",
                "  TYPE SZERNSAG\n  PARM 6 1e-9\n  XDAT 1 4\n  XDAT 2 3\n  XDAT 6 1e-3\n"
                "  CURV 1.53",
            ),
            r"no even powers beyond rho\^10 \(PARM 5\)",
        ),
        (
            swap("  TYPE STANDARD\n  CURV 1.53", "  TYPE SZERNSAG\n  XDAT 1 4\n  XDAT 3 1\n"),
            "radius_mm must be > 0",
        ),
        (swap("  CURV 9.8", "  PARM 3 -1e300\n  CURV 9.8"), "line 41: PARM must be > -1e"),
        (
            swap("  TYPE STANDARD\n  CURV 1.53", "  TYPE SZERNSAG\n  XDAT 1 1e9\n  XDAT 99 1\n"),
            "at most 66 terms",
        ),
        (swap("  STOP\n  TYPE STANDARD\n  CURV 0.0", "  STOP\n  CURV 0.1"), "must be plane"),
    ],
)
def test_a_zemax_file_that_cannot_be_traced_names_line_and_surface(tmp_path, text, match):
    with pytest.raises(ic.FileError, match=match):
        ic.load_eye(written(tmp_path, text))


def iset3d_folder(tmp_path, text=ISET3D):
    model = ic.eyes.navarro()
    wavelengths = np.arange(400.0, 801.0, 10.0)
    for i, medium in enumerate(model.media()[1:], start=1):
        rows = (
            f"{w:g} {n:.6f}\n" for w, n in zip(wavelengths, medium.index(wavelengths), strict=True)
        )
        (tmp_path / f"ior{i}.spd").write_text("".join(rows))
    return written(tmp_path, text, "navarro.dat")


def test_an_iset3d_lens_file_is_read_with_its_tables_of_indices(tmp_path):
    eye = ic.load_eye(iset3d_folder(tmp_path))
    model = ic.eyes.navarro(4.0)
    front = eye.surfaces[0]
    assert front.shape == ic.Biconic(1.0 / 7.72, -0.26)
    assert (front.radius_mm, front.conic) == pytest.approx((7.5, -0.2))
    for got, expected in zip(eye.surfaces[1:], model.surfaces[1:], strict=True):
        assert got.curvature == pytest.approx(expected.curvature, rel=1e-12)
        assert got.vertex_z_mm == pytest.approx(expected.vertex_z_mm)
        assert (got.conic, got.shape) == (expected.conic, None)
    assert [s.semi_diameter_mm for s in eye.surfaces] == [4.82, 4.341, 3.75, 3.75]
    assert (eye.stop.diameter_mm, eye.stop.z_mm) == pytest.approx((4.0, 3.6))
    assert eye.axial_length_mm == pytest.approx(7.6 + 16.32)
    # Straight lines between rows 10 nm apart lie h^2 n'' / 8 too high: 4.5e-6 in the lens.
    np.testing.assert_allclose(eye.indices(555.0), model.indices(555.0), atol=5e-6)
    arizona = ic.load_eye(
        tmp_path / "navarro.dat", retina_distance_mm=16.713, retina_radius_mm=-13.4
    )
    assert arizona.axial_length_mm == pytest.approx(7.6 + 16.713)
    assert arizona.retina.radius_mm == pytest.approx(-13.4)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("# nothing\n", "one row of zero radii"),
        (ISET3D.replace("-7.72\t-7.5", "-7.72"), "line 4: must be 7 numbers"),
        (ISET3D.replace("-7.72", "-7.7a"), "line 4: must be numbers"),
        (ISET3D.replace("0.55", "-0.55"), "line 4: thickness must be >= 0"),
        (ISET3D.replace("0\t0\t0\t2\t2\t0\t0\n", ""), "got 0 stops in 4 rows"),
        (ISET3D.replace("0.55\t1", "0.55\t7"), "line 4: must be 7 numbers .*from 0 to 6"),
        (ISET3D.replace("4.82", "9.0"), "line 4: .*semi_diameter_mm"),
        (ISET3D.replace("\t1\t4.82", "\t6\t4.82"), "line 4: medium 6 must have one table ior6"),
    ],
)
def test_a_broken_iset3d_file_names_the_line(tmp_path, text, match):
    with pytest.raises(ic.FileError, match=match):
        ic.load_eye(iset3d_folder(tmp_path, text))


def test_a_broken_table_of_indices_is_named(tmp_path):
    file = iset3d_folder(tmp_path)
    (tmp_path / "ior3.spd").write_text("400 1.4\n390 1.4\n")
    with pytest.raises(ic.FileError, match=r"ior3.spd.*wavelengths_nm must be > 0 and increase"):
        ic.load_eye(file)
    (tmp_path / "ior3.spd").write_text("400 1.4\nred 1.4\n")
    with pytest.raises(ic.FileError, match=r"ior3.spd.*line 2: must be a wavelength"):
        ic.load_eye(file)

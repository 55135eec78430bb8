"""Scenes in files of ISETBio and ISETCam, in all the forms that these have written."""

import numpy as np
import pytest
import scipy.io

import isetcl as ic
from isetcl.errors import FileError

PHOTON_J_M = 6.62607015e-34 * 299792458.0


def simple_scene(tmp_path, **changes):
    photons = np.zeros((20, 40, 4))
    photons[:10, :, 0] = 2e15
    photons[10:, 20:, :] = [1e15, 2e15, 3e15, 4e15]
    record = {
        "photons": photons,
        "wave": np.array([400.0, 500.0, 600.0, 700.0]),
        "fov": 4.0,
        "dist": 0.57,
        "comment": "a test",
        "illuminant": {"type": "illuminant"},
    }
    scipy.io.savemat(tmp_path / "scene.mat", record | changes)
    return tmp_path / "scene.mat"


def test_a_scene_file_is_a_picture_at_its_distance(tmp_path):
    scene = ic.load_scene(simple_scene(tmp_path))
    (picture,) = scene.objects
    width = 2 * 0.57 * np.tan(np.radians(2.0))
    assert scene.name == "a test"
    assert picture.shape.corner_m == pytest.approx((-width / 2, -width / 4, -0.57))
    assert picture.shape.edge_u_m == pytest.approx((width, 0, 0))
    emission = picture.material
    waves = np.array([400.0, 500.0, 600.0, 700.0])
    spectra = np.stack([s.at(waves) for s in emission.spectra()])
    seen = emission.texture.texels[[5, 15, 15]][[0, 1, 2], [5, 5, 30]] @ spectra
    photons = np.array([[2e15, 0, 0, 0], [0, 0, 0, 0], [1e15, 2e15, 3e15, 4e15]])
    np.testing.assert_allclose(seen, photons * PHOTON_J_M / (waves * 1e-9), rtol=3e-3, atol=1e-9)


def test_a_scene_structure_is_read_too(tmp_path):
    record = {
        "name": "whole",
        "data": {"photons": np.ones((4, 4, 2)) * 1e15},
        "spectrum": {"wave": [500.0, 600.0]},
        "wAngular": 10.0,
        "distance": 1.2,
    }
    scipy.io.savemat(tmp_path / "b.mat", {"scene": record})
    scene = ic.load_scene(tmp_path / "b.mat")
    assert scene.name == "whole"
    assert scene.objects[0].shape.corner_m[2] == pytest.approx(-1.2)


def radiance_of(scene, waves):
    """Radiance of the picture of a scene, (rows, columns, wavelengths)."""
    emission = scene.objects[0].material
    spectra = np.stack([s.at(waves) for s in emission.spectra()])
    return emission.texture.texels[..., : len(spectra)] @ spectra


SCENE_WAVES = np.array([400.0, 500.0, 600.0])
BASIS = np.array([[1.0, -1.0], [1.0, 0.0], [1.0, 1.0]])


def basis_scene(**changes):
    """Variables of a scene stored as basis functions: 1 + 0.5 a, with a from -2 to 2 in columns."""
    weights = np.stack([np.full((3, 5), 1e15), np.tile(np.arange(-2.0, 3.0), (3, 1)) * 5e14], -1)
    record = {
        "mcCOEF": weights,
        "basis": {"basis": BASIS, "wave": SCENE_WAVES[:, None]},
        "comment": "few functions",
        "fov": 4.0,
        "dist": 0.57,
    }
    return record | changes


def basis_photons(mean=0.0):
    a = 0.5 * np.arange(-2.0, 3.0)
    return 1e15 * np.stack([1 - a, np.ones(5), 1 + a], -1) + mean


def test_scenes_stored_as_basis_functions_are_read(tmp_path):
    # What vcReadImage of ISETCam makes of them: mcCOEF basis', and the mean of the image if there
    # is one; without that one wavelength of the outer columns would be exactly dark.
    joules = PHOTON_J_M / (SCENE_WAVES * 1e-9)
    for mean in (None, np.array([1e14, 2e14, 3e14])):
        extra = {} if mean is None else {"imgMean": mean}
        scipy.io.savemat(tmp_path / "a.mat", basis_scene(**extra))
        scene = ic.load_scene(tmp_path / "a.mat")
        expected = basis_photons(0.0 if mean is None else mean) * joules
        found = radiance_of(scene, SCENE_WAVES)
        assert found.shape == (3, 5, 3)
        np.testing.assert_allclose(found, np.tile(expected, (3, 1, 1)), rtol=5e-3, atol=2e-7)
        assert scene.name == "few functions"


def test_sums_of_basis_functions_below_zero_are_dark(tmp_path):
    # ISETCam: photons = max(photons, 0).
    weights = np.stack([np.full((2, 2), 1e15), np.full((2, 2), 3e15)], -1)
    scipy.io.savemat(tmp_path / "a.mat", basis_scene(mcCOEF=weights))
    found = radiance_of(ic.load_scene(tmp_path / "a.mat"), SCENE_WAVES)
    joules = PHOTON_J_M / (SCENE_WAVES * 1e-9)
    np.testing.assert_allclose(
        found, np.broadcast_to([0, 1e15, 4e15] * joules, (2, 2, 3)), atol=1e-6
    )


def whole_scene(photons, **data):
    return {
        "scene": {
            "metadata": {},  # a structure without fields, as ISETCam leaves it
            "data": {"photons": photons, **data},
            "spectrum": {"wave": SCENE_WAVES},
            "wAngular": 10.0,
            "distance": 1.2,
        }
    }


def test_photons_that_old_files_keep_as_whole_numbers_are_expanded(tmp_path):
    # ieUncompressData of ISETBio: (max - min) / (2^n - 1) * stored + min.
    stored = np.arange(2 * 3 * 3, dtype=np.uint16).reshape(2, 3, 3) * 3000
    scipy.io.savemat(tmp_path / "a.mat", whole_scene(stored, dmin=1e15, dmax=5e15))
    found = radiance_of(ic.load_scene(tmp_path / "a.mat"), SCENE_WAVES)
    photons = 4e15 / 65535 * stored + 1e15
    np.testing.assert_allclose(found, photons * PHOTON_J_M / (SCENE_WAVES * 1e-9), rtol=1e-2)
    scipy.io.savemat(tmp_path / "b.mat", whole_scene(stored))
    with pytest.raises(FileError, match="uint16 are compressed, and need the numbers dmin and"):
        ic.load_scene(tmp_path / "b.mat")
    scipy.io.savemat(tmp_path / "c.mat", whole_scene(stored.astype(np.int32)))
    with pytest.raises(FileError, match="single or double, got int32"):
        ic.load_scene(tmp_path / "c.mat")


def test_doubles_that_matlab_stores_in_bytes_stay_doubles(tmp_path):
    # MATLAB writes the numbers of a double array without fractions as bytes; its class (6 of the
    # array flags, level 5 MAT-file format) still says double. scipy writes bytes as class 9.
    stored = np.arange(1, 13, dtype=np.uint8).reshape(2, 2, 3)
    scipy.io.savemat(tmp_path / "a.mat", whole_scene(stored))
    data = (tmp_path / "a.mat").read_bytes()
    flags = b"\x06\0\0\0\x08\0\0\0"
    assert data.count(flags + b"\x09") == 1
    (tmp_path / "a.mat").write_bytes(data.replace(flags + b"\x09", flags + b"\x06"))
    found = radiance_of(ic.load_scene(tmp_path / "a.mat"), SCENE_WAVES)
    joules = PHOTON_J_M / (SCENE_WAVES * 1e-9)
    np.testing.assert_allclose(found, stored * joules, rtol=1e-2)


@pytest.mark.parametrize(
    ("variables", "message"),
    [
        (basis_scene(mcCOEF=np.ones((3, 5, 3))), r"\(3 wavelengths, functions\).*\(3, 2\) and"),
        (basis_scene(imgMean=np.ones(5)), "imgMean must have 3 numbers, got 5"),
        (basis_scene(basis=1.0), "basis.wave"),
        (basis_scene(fov=np.zeros((0, 0))), "'fov', the width of the field of view in degrees; in"),
        (basis_scene(dist=np.zeros((0, 0))), "'dist', the distance of the scene in metres; in"),
    ],
)
def test_basis_functions_that_do_not_fit_are_refused(tmp_path, variables, message):
    scipy.io.savemat(tmp_path / "a.mat", variables)
    with pytest.raises(FileError, match=message):
        ic.load_scene(tmp_path / "a.mat")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"fov": 0.0}, "fov must be between 0 and 180"),
        ({"dist": -1.0}, "dist must be a number > 0"),
        ({"wave": [400.0, 500.0, 600.0, 650.0]}, "equal steps"),
        ({"wave": [400.0, 500.0]}, "shape"),
    ],
)
def test_scenes_that_cannot_be_are_refused(tmp_path, changes, message):
    with pytest.raises(FileError, match=message):
        ic.load_scene(simple_scene(tmp_path, **changes))

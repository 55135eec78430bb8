"""Files of ISETBio: structure, units and photons, by scipy.io and h5py; and what is refused."""

import os
import shutil
import subprocess

import numpy as np
import pytest
import scipy.io

import isetcl as ic
from isetcl.cones import ConeMosaic
from isetcl.errors import FileError, InvalidInputError, OutOfMemoryError

EYE = ic.eyes.navarro(pupil_diameter_mm=3.0)
WAVES = np.arange(400.0, 701.0, 10.0)
PHOTON_J_M = 6.62607015e-34 * 299792458.0


def image_of(shape=(12, 16), waves=WAVES, fov_deg=(0.8, 0.6), dtype=np.float32):
    values = np.random.default_rng(1).uniform(0.0, 3e-3, size=(len(waves), *shape))
    grid = ic.RetinalGrid.of(EYE, fov_deg, shape[::-1])
    return ic.RetinalImage.from_arrays(grid, waves, values.astype(dtype))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    image = image_of()
    path = image.to_isetbio(tmp_path_factory.mktemp("isetbio") / "edge.mat")
    return image, path


def test_the_optical_image_has_the_fields_that_isetbio_reads(written):
    # Fields and units: the file description of ISETCam's oiGet and oiCreate.
    image, path = written
    found = scipy.io.loadmat(path)["opticalimage"][0, 0]
    assert found["type"][0] == "opticalimage"
    assert found["name"][0] == "edge"
    data, optics = found["data"][0, 0], found["optics"][0, 0]
    assert data["photons"].shape == (12, 16, 31)
    assert data["photons"].dtype == np.float32
    assert data["bitDepth"].item() == 32
    assert data["illuminance"].shape == (12, 16)
    np.testing.assert_allclose(data["illuminance"], image.illuminance_lux.values, rtol=1e-6)
    wave = found["spectrum"][0, 0]["wave"]
    assert wave.shape == (31, 1)
    np.testing.assert_array_equal(wave[:, 0], WAVES)
    assert found["wAngular"].item() == pytest.approx(0.8)
    assert found["diffuser"][0, 0]["method"][0] == "skip"
    assert "depthMap" not in found.dtype.names
    assert optics["type"][0] == "optics"
    assert optics["model"][0] == "skip"
    assert optics["transmittance"][0, 0]["scale"].shape == (31, 1)
    pupil_m = 1e-3 * EYE.entrance_pupil().diameter_mm
    assert optics["fNumber"].item() == pytest.approx(optics["focalLength"].item() / pupil_m)


def test_photons_are_those_of_the_irradiance_and_keep_their_places(written):
    image, path = written
    photons = scipy.io.loadmat(path)["opticalimage"]["data"][0, 0]["photons"][0, 0]
    for wave, row, column in ((0, 0, 0), (15, 3, 12), (30, 11, 15)):
        joules = float(image.irradiance.values[wave, row, column])
        expected = joules * WAVES[wave] * 1e-9 / PHOTON_J_M
        assert photons[row, column, wave] == pytest.approx(expected, rel=1e-6)


def test_isetbio_computes_the_pixels_of_the_retina_from_the_file(written):
    # ISETCam: width = 2 d tan(fov / 2), with d the focal length for an object at 1e10 m; the
    # retina's own arc from pixel to pixel on the axis is 0.05 deg of field.
    _, path = written
    record = scipy.io.loadmat(path)["opticalimage"][0, 0]
    focal = record["optics"][0, 0]["focalLength"].item()
    distance = 1.0 / (1.0 / focal - 1.0 / 1e10)
    width_mm = 2e3 * distance * np.tan(np.radians(record["wAngular"].item()) / 2)
    per_deg = EYE.field_map(550.0).axial_scale_mm_per_deg()
    assert width_mm / 16 == pytest.approx(0.05 * per_deg, rel=1e-3)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_all_photons_come_back(tmp_path, dtype):
    image = image_of(dtype=dtype)
    back = ic.RetinalImage.from_isetbio(image.to_isetbio(tmp_path / "a.mat"), EYE)
    assert back.irradiance.dtype == dtype
    total, before = (
        back.irradiance.values.sum(dtype=float),
        image.irradiance.values.sum(dtype=float),
    )
    assert total == pytest.approx(before, rel=1e-6)
    np.testing.assert_allclose(back.irradiance.values, image.irradiance.values, rtol=1e-6)
    for axis in ("x", "y", "x_mm", "y_mm", "wavelength"):
        np.testing.assert_allclose(
            back.dataset[axis].values, image.dataset[axis].values, rtol=1e-6, atol=1e-9
        )


@pytest.mark.slow
@pytest.mark.skipif(
    shutil.which("octave-cli") is None or "ISETCAM" not in os.environ,
    reason="needs GNU Octave, and the folder of ISETCam's code in ISETCAM",
)
def test_isetcam_itself_reads_the_file(written, tmp_path):
    image, path = written
    questions = {
        "wave": (WAVES, 1e-15),
        "size": ([12, 16], 0),
        "hfov": (0.8, 1e-15),
        "vfov": (0.6, 1e-5),
        "mean illuminance": (image.illuminance_lux.values.mean(), 1e-6),
        "sample spacing": (np.full(2, 5e-5 * EYE.field_map().axial_scale_mm_per_deg()), 1e-3),
        "optics aperture diameter": (1e-3 * EYE.entrance_pupil().diameter_mm, 1e-9),
        "photons": (
            np.moveaxis(image.irradiance.values.astype(float), 0, -1) * WAVES * 1e-9 / PHOTON_J_M,
            1e-6,
        ),
    }
    lines = [f"addpath(genpath('{os.environ['ISETCAM']}')); load('{path}'); oi = opticalimage;"]
    lines += [f"v{i} = oiGet(oi, '{name}');" for i, name in enumerate(questions)]
    lines.append(f"save('-v7', '{tmp_path / 'said.mat'}')")
    subprocess.run(["octave-cli", "-q", "--eval", " ".join(lines)], check=True, timeout=120)
    said = scipy.io.loadmat(tmp_path / "said.mat")
    for i, (expected, rtol) in enumerate(questions.values()):
        found = said[f"v{i}"].reshape(np.shape(expected))
        np.testing.assert_allclose(found, expected, rtol=rtol)


def test_the_middle_of_an_image_is_noted_and_comes_back(tmp_path):
    # cMosaic.compute lays images on the middle of the mosaic unless 'opticalImagePositionDegs'
    # says otherwise, which is what the note is for.
    values = np.random.default_rng(4).uniform(size=(2, 3, 4))
    grid = ic.RetinalGrid.of(EYE, (0.8, 0.6), (4, 3), (5.0, -2.0))
    image = ic.RetinalImage.from_arrays(grid, np.array([500.0, 600.0]), values)
    path = image.to_isetbio(tmp_path / "a.mat")
    record = scipy.io.loadmat(path)["opticalimage"][0, 0]
    noted = record["metadata"][0, 0]["centreDeg"]
    assert noted.shape == (1, 2)
    np.testing.assert_allclose(noted, [[5.0, -2.0]])
    back = ic.RetinalImage.from_isetbio(path, EYE)
    for axis in ("x", "y", "x_mm", "y_mm"):
        np.testing.assert_allclose(
            back.dataset[axis].values, image.dataset[axis].values, rtol=1e-6, atol=1e-9
        )
    moved = ic.RetinalImage.from_isetbio(path, EYE, centre_deg=(1.0, 0.0))
    assert moved.dataset["x"].values.mean() == pytest.approx(1.0)
    scipy.io.savemat(tmp_path / "b.mat", optical_image(metadata=np.zeros((0, 0))))
    theirs = ic.RetinalImage.from_isetbio(tmp_path / "b.mat", EYE)
    assert theirs.dataset["x"].values.mean() == pytest.approx(0.0, abs=1e-12)
    scipy.io.savemat(tmp_path / "c.mat", optical_image(metadata={"centreDeg": 3.0}))
    with pytest.raises(FileError, match="must hold two numbers, got 1"):
        ic.RetinalImage.from_isetbio(tmp_path / "c.mat", EYE)


def test_a_single_wavelength_comes_back(tmp_path):
    image = image_of(waves=np.array([550.0]))
    back = ic.RetinalImage.from_isetbio(image.to_isetbio(tmp_path / "a.mat"), EYE)
    np.testing.assert_allclose(back.irradiance.values, image.irradiance.values, rtol=1e-6)


def test_files_of_version_7_3_are_read(tmp_path):
    import h5py

    photons = np.random.default_rng(2).uniform(size=(5, 7, 3))
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        for name, value in (
            ("data/photons", photons),
            ("spectrum/wave", np.array([[500.0], [550.0], [600.0]])),
            ("wAngular", np.array([[1.4]])),
        ):
            file[f"opticalimage/{name}"] = value.T
    # What MATLAB writes before the HDF5 part.
    with open(tmp_path / "a.mat", "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    image = ic.RetinalImage.from_isetbio(tmp_path / "a.mat", EYE)
    joules = photons * PHOTON_J_M / (np.array([500.0, 550.0, 600.0]) * 1e-9)
    np.testing.assert_allclose(image.irradiance.values, np.moveaxis(joules, -1, 0), rtol=1e-12)
    assert image.dataset["x"].values[-1] == pytest.approx(0.6)


def test_uneven_grids_and_oblong_pixels_are_refused(tmp_path):
    with pytest.raises(InvalidInputError, match="equal steps"):
        image_of(waves=np.array([400.0, 500.0, 550.0])).to_isetbio(tmp_path / "a.mat")
    with pytest.raises(InvalidInputError, match="square pixels"):
        image_of(fov_deg=(0.8, 0.7)).to_isetbio(tmp_path / "a.mat")
    assert not list(tmp_path.iterdir())


def optical_image(**changes):
    record = {
        "data": {"photons": np.ones((4, 4, 3))},
        "spectrum": {"wave": np.array([500.0, 550.0, 600.0])},
        "wAngular": 1.0,
    }
    return {"opticalimage": record | changes}


@pytest.mark.parametrize(
    ("variables", "message"),
    [
        ({"coneData": {"types": 1}}, "must hold a variable 'opticalimage', got coneData"),
        ({"photons": np.ones((2, 2, 2)), "wave": [1, 2]}, "load_scene"),
        (optical_image(spectrum={"wave": [500.0, 510.0, 600.0]}), "equal steps"),
        (optical_image(spectrum={"wave": [500.0, 510.0]}), "shape"),
        (optical_image(data={"photons": -np.ones((4, 4, 3))}), "finite and >= 0"),
        (optical_image(data={"other": 1.0}), "data.photons"),
        (optical_image(wAngular=400.0), "wAngular"),
    ],
)
def test_files_of_another_kind_are_refused(tmp_path, variables, message):
    scipy.io.savemat(tmp_path / "a.mat", variables)
    with pytest.raises(FileError, match=message):
        ic.RetinalImage.from_isetbio(tmp_path / "a.mat", EYE)


def test_files_that_are_none_are_refused(tmp_path):
    (tmp_path / "a.mat").write_bytes(b"no MATLAB file at all" * 40)
    for name in ("a.mat", "missing.mat"):
        with pytest.raises(FileError, match=r"cannot be read as a MATLAB|does not exist"):
            ic.RetinalImage.from_isetbio(tmp_path / name, EYE)
        with pytest.raises(FileError):
            ic.load_scene(tmp_path / name)


@pytest.mark.parametrize(
    ("path", "error", "message"),
    [
        (".", InvalidInputError, r"must end in \.mat"),
        ("image", InvalidInputError, r"must end in \.mat"),
        ("taken.mat", FileError, "it is a folder"),
        (None, InvalidInputError, "path must be a str or Path"),
    ],
)
def test_names_that_no_file_can_have_are_refused(tmp_path, path, error, message):
    (tmp_path / "taken.mat").mkdir()
    with pytest.raises(error, match=message):
        image_of((2, 2), fov_deg=0.1).to_isetbio(None if path is None else tmp_path / path)
    with pytest.raises(FileError, match="is a folder"):
        ic.RetinalImage.from_isetbio(tmp_path / "taken.mat", EYE)
    with pytest.raises(FileError, match="is a folder"):
        ic.RetinalImage.load(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["taken.mat"]


def test_what_the_format_has_no_room_for_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("isetcl.matlab._MOST_BYTES", 1000)
    with pytest.raises(OutOfMemoryError, match="2 GiB a variable"):
        image_of().to_isetbio(tmp_path / "a.mat")


def test_a_mosaic_has_the_fields_that_cmosaic_imports(tmp_path):
    # Fields, shapes and the numbers of types: importExternalConeData of ISETBio.
    places = np.array([[0.0, 0.0], [0.3, 0.1], [-2.0, 1.0], [5.0, -3.0]])
    mosaic = ConeMosaic.from_positions(places, [0, 1, 2, 0], spacing_um=[2.2, 2.5, 5.0, 9.0])
    found = scipy.io.loadmat(mosaic.to_isetbio(tmp_path / "m.mat"))["coneData"][0, 0]
    assert found["positionUnits"][0] == "microns"
    assert found["positions"].shape == (4, 2)
    # To the right and up in the visual field; Watson 2014, eq. A5: 0.3162 deg are 0.0848 mm.
    assert np.hypot(*found["positions"][1]) == pytest.approx(84.8, abs=0.1)
    assert np.all(found["positions"][1] > 0)
    np.testing.assert_array_equal(found["types"].ravel(), [1, 2, 3, 1])
    np.testing.assert_allclose(
        found["lightGatheringApertureDiameters"].ravel(), 0.79 * np.array([2.2, 2.5, 5.0, 9.0])
    )
    assert found["blurApertureDiameterMicrons"].item() == pytest.approx(0.79 * 3.75)
    factors = found["outerSegmentLengthAttenationFactors"].ravel()
    assert factors[0] == pytest.approx(1.0)
    assert np.all(np.diff(factors) < 0)


def test_cones_look_where_they_do_in_the_image_that_goes_with_them(tmp_path):
    # cMosaic.compute takes the image's micrometres for the cones': pixel (row, column) lies at
    # (column - middle, middle - row) pitches. A ramp in both directions tells where a cone looks.
    image = image_of((30, 40), fov_deg=(0.8, 0.6))
    places = np.array([[0.0, 0.0], [0.3, 0.1], [-0.25, 0.2], [0.1, -0.28]])
    mosaic = ConeMosaic.from_positions(places, [0, 1, 2, 0], spacing_um=3.0)
    found = scipy.io.loadmat(mosaic.to_isetbio(tmp_path / "m.mat", image=image))
    oi = scipy.io.loadmat(image.to_isetbio(tmp_path / "i.mat"))["opticalimage"][0, 0]
    focal_um = 1e6 * oi["optics"][0, 0]["focalLength"].item()
    pitch_um = 2.0 * focal_um * np.tan(np.radians(oi["wAngular"].item()) / 2) / 40
    cones = found["coneData"][0, 0]
    np.testing.assert_allclose(cones["positions"] / pitch_um, places / 0.02, atol=1e-6)
    assert found["micronsPerDegree"].item() == pytest.approx(pitch_um / 0.02)
    # Light is gathered on the true area; what blurs the image is as wide as it is in the image.
    np.testing.assert_allclose(cones["lightGatheringApertureDiameters"].ravel(), 0.79 * 3.0)
    expected = np.median(mosaic.aperture_deg) * pitch_um / 0.02
    assert cones["blurApertureDiameterMicrons"].item() == pytest.approx(expected)
    with pytest.raises(InvalidInputError, match="image must be a RetinalImage"):
        mosaic.to_isetbio(tmp_path / "n.mat", image="i.mat")


def test_a_mosaic_with_rods_is_refused(tmp_path):
    mosaic = ConeMosaic.from_positions([[0.0, 0.0], [1.0, 0.0]], [0, 3], spacing_um=3.0)
    with pytest.raises(InvalidInputError, match="cones only"):
        mosaic.to_isetbio(tmp_path / "m.mat")


def test_an_optical_image_is_no_scene(tmp_path, written):
    with pytest.raises(FileError, match="from_isetbio"):
        ic.load_scene(written[1])


def test_a_missing_folder_is_named(tmp_path):
    mosaic = ConeMosaic.from_positions([[0.0, 0.0], [1.0, 0.0]], [0, 1], spacing_um=3.0)
    with pytest.raises(FileError, match=r"there is no folder.*missing"):
        mosaic.to_isetbio(tmp_path / "missing" / "m.mat")

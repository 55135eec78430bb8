"""Whatever is passed to a public function, what comes back is isetcl's own error."""

import numpy as np
import pytest

import isetcl as ic

JUNK = [
    None,
    "abc",
    "3",
    [1, 2, 3, 4, 5],
    {},
    np.nan,
    np.inf,
    -1,
    10**400,
    np.zeros((2, 2)),
    object(),
]
EYE = ic.eyes.navarro()
WHITE = ic.Spectrum.equal_energy(100.0)
EMISSION = ic.Emission(WHITE)
QUAD = ic.Quad((-1, -1, -1), (2, 0, 0), (0, 2, 0))
SCENE = ic.Scene((ic.SceneObject("it", QUAD, EMISSION),))
PICTURE = ic.Image(np.ones((4, 4)))
MEDIUM = ic.Medium("m", ic.ConstantIndex(1.336))


def image(wavelengths=(500.0, 600.0), value=1.0):
    grid = ic.RetinalGrid.of(EYE, 1.0, 4)
    w = np.array(wavelengths)
    return ic.RetinalImage.from_arrays(grid, w, np.full((len(w), 4, 4), value))


def small(**options):
    return {"fov_deg": 1.0, "resolution": 4, "wavelengths_nm": [550.0], **options}


# One argument of each call is junk. A second entry lists the junk that is legal there.
CALLS = {
    "navarro pupil": (lambda x: ic.eyes.navarro(x), ()),
    "navarro accommodation": (lambda x: ic.eyes.navarro(4.0, x), (None,)),
    "navarro parameter": (lambda x: ic.eyes.navarro(4.0, accommodation_parameter=x), (None,)),
    "navarro plane": (lambda x: ic.eyes.navarro(4.0, pupil_plane=x), ()),
    "navarro hold": (lambda x: ic.eyes.navarro(4.0, hold=x), ()),
    "arizona interpolation": (lambda x: ic.eyes.arizona(4.0, interpolation=x), ()),
    "legrand state": (lambda x: ic.eyes.legrand(4.0, state=x), ()),
    "by_name": (lambda x: ic.eyes.by_name(x), ()),
    "constant index": (lambda x: ic.ConstantIndex(x), ()),
    "abbe": (lambda x: ic.AbbeDispersion(x, 50.0), ()),
    "medium name": (lambda x: ic.Medium(x, ic.ConstantIndex(1.3)), ("abc", "3")),
    "medium dispersion": (lambda x: ic.Medium("m", x), ()),
    "medium index": (lambda x: MEDIUM.index(x), ()),
    "surface z": (lambda x: ic.Surface("s", x, 0.1, 0.0, 3.0, MEDIUM), (-1,)),
    "surface conic": (lambda x: ic.Surface("s", 0.0, 0.1, x, 3.0, MEDIUM), (-1,)),
    "surface semi": (lambda x: ic.Surface("s", 0.0, 0.1, 0.0, x, MEDIUM), ()),
    "surface medium": (lambda x: ic.Surface("s", 0.0, 0.1, 0.0, 3.0, x), ()),
    "surface radius": (
        lambda x: ic.Surface.from_radius("s", 0.0, x, semi_diameter_mm=0.1, medium_after=MEDIUM),
        (-1, np.inf),
    ),
    "stop z": (lambda x: ic.Stop(x, 3.0), (-1,)),
    "stop diameter": (lambda x: ic.Stop(3.0, x), ()),
    "retina z": (lambda x: ic.Retina(x, -0.08), ()),
    "retina curvature": (lambda x: ic.Retina(24.0, x), (-1,)),
    "retina radius": (lambda x: ic.Retina.from_radius(24.0, x), (-1, np.inf)),
    "eye surfaces": (lambda x: ic.Eye("e", x, EYE.stop, EYE.retina), ()),
    "eye stop": (lambda x: ic.Eye("e", EYE.surfaces, x, EYE.retina), ()),
    "eye retina": (lambda x: ic.Eye("e", EYE.surfaces, EYE.stop, x), ()),
    "eye medium": (lambda x: ic.Eye("e", EYE.surfaces, EYE.stop, EYE.retina, x), ()),
    "eye model": (
        lambda x: ic.Eye("e", EYE.surfaces, EYE.stop, EYE.retina, accommodation_model=x),
        (None,),
    ),
    "power": (lambda x: EYE.power_dpt(x), ()),
    "cardinal points": (lambda x: EYE.cardinal_points(x), ()),
    "entrance pupil": (lambda x: EYE.entrance_pupil(x), ()),
    "exit pupil": (lambda x: EYE.exit_pupil(x), ()),
    "indices": (lambda x: EYE.indices(x), ()),
    "field map": (lambda x: EYE.field_map(x), ()),
    "arc": (lambda x: EYE.field_map().arc_mm(x), (-1, np.zeros((2, 2)), [1, 2, 3, 4, 5])),
    "field": (lambda x: EYE.field_map().field_deg(x), (-1, np.zeros((2, 2)), [1, 2, 3, 4, 5])),
    "focus wavelength": (lambda x: EYE.focus_vergence_dpt(x), ()),
    "focus criterion": (lambda x: EYE.focus_vergence_dpt(550.0, x), ()),
    "focus_at": (lambda x: EYE.focus_at(x), ()),
    "trace eye": (lambda x: ic.trace_rays(x, [0, 0, -1], [0, 0, 1], 550.0), ()),
    "trace origins": (lambda x: ic.trace_rays(EYE, x, [0, 0, 1], 550.0), ()),
    "trace directions": (lambda x: ic.trace_rays(EYE, [0, 0, -1], x, 550.0), ()),
    "trace wavelength": (lambda x: ic.trace_rays(EYE, [0, 0, -1], [0, 0, 1], x), ()),
    "trace towards": (
        lambda x: ic.trace_rays(EYE, [0, 0, -1], [0, 0, 1], 550.0, towards=x),
        (),
    ),
    "trace hits": (
        lambda x: ic.trace_rays(EYE, [0, 0, -1], [0, 0, 1], 550.0, record_hits=x),
        (),
    ),
    "spectrum wavelengths": (lambda x: ic.Spectrum(x, np.ones(5)), ([1, 2, 3, 4, 5],)),
    "spectrum values": (lambda x: ic.Spectrum(np.arange(1.0, 6.0), x), ([1, 2, 3, 4, 5],)),
    "spectrum at": (lambda x: WHITE.at(x), ()),
    "spectrum scaled": (lambda x: WHITE.scaled(x), ()),
    "spectrum luminance": (lambda x: WHITE.with_luminance(x), ()),
    "illuminant": (lambda x: ic.Spectrum.illuminant(x), ()),
    "checkerboard": (lambda x: ic.Checkerboard(x, 2), ()),
    "image": (lambda x: ic.Image(x), (np.zeros((2, 2)),)),
    "load image": (lambda x: ic.load_image(x), ()),
    "quad corner": (lambda x: ic.Quad(x, (1, 0, 0), (0, 1, 0)), ()),
    "disc centre": (lambda x: ic.Disc(x, 1.0), ()),
    "disc radius": (lambda x: ic.Disc((0, 0, -1), x), ()),
    "sphere centre": (lambda x: ic.Sphere(x, 1.0), ()),
    "emission": (lambda x: ic.Emission(x), ()),
    "emission texture": (lambda x: ic.Emission(WHITE, x), (None,)),
    "unlit": (lambda x: ic.UnlitReflectance(x, WHITE), ()),
    "unlit white": (lambda x: ic.UnlitReflectance(ic.Spectrum.constant(0.5), x), ()),
    "object shape": (lambda x: ic.SceneObject("it", x, EMISSION), ()),
    "object material": (lambda x: ic.SceneObject("it", QUAD, x), ()),
    "scene objects": (lambda x: ic.Scene(x), ()),
    "scene background": (lambda x: ic.Scene((), x), (None,)),
    "uniform": (lambda x: ic.scenes.uniform(x), ()),
    "point distance": (lambda x: ic.scenes.point_source(x), (np.inf,)),
    "point field": (lambda x: ic.scenes.point_source(1.0, x), ()),
    "edge distance": (lambda x: ic.scenes.slanted_edge(x), ()),
    "edge angle": (lambda x: ic.scenes.slanted_edge(1.0, x), (-1,)),
    "planes near": (lambda x: ic.scenes.two_planes(x, 2.0), ()),
    "planes texture": (lambda x: ic.scenes.two_planes(texture=x), ()),
    "planes angle": (lambda x: ic.scenes.two_planes(edge_angle_deg=x), (-1,)),
    "planes material": (lambda x: ic.scenes.two_planes(near=x), (None,)),
    "picture plane": (lambda x: ic.scenes.image_plane(x, 1.0, 5.0), ()),
    "picture planes": (lambda x: ic.scenes.image_planes(PICTURE, x, 1.0, 2.0, 5.0), ()),
    "picture": (lambda x: ic.scenes.picture(x), ()),
    "grid eye": (lambda x: ic.RetinalGrid.of(x, 1.0, 4), ()),
    "grid fov": (lambda x: ic.RetinalGrid.of(EYE, x, 4), ()),
    "grid resolution": (lambda x: ic.RetinalGrid.of(EYE, 1.0, x), ()),
    "grid centre": (lambda x: ic.RetinalGrid.of(EYE, 1.0, 4, x), ()),
    "grid itself": (lambda x: ic.RetinalGrid(EYE, (1.0, 1.0), x), ()),
    "plan scene": (lambda x: ic.plan(x, EYE), ()),
    "plan eye": (lambda x: ic.plan(SCENE, x), ()),
    "plan bands": (lambda x: ic.plan(SCENE, EYE, **small(bands=x)), ()),
    "render wavelengths": (
        lambda x: ic.render(SCENE, EYE, **small() | {"wavelengths_nm": x}),
        (None,),
    ),
    "render spp": (lambda x: ic.render(SCENE, EYE, **small(spp=x)), (None,)),
    "render target": (lambda x: ic.render(SCENE, EYE, **small(target_error=x)), (None,)),
    "render time": (lambda x: ic.render(SCENE, EYE, **small(time_budget_s=x)), (None,)),
    "render seed": (lambda x: ic.render(SCENE, EYE, **small(seed=x)), ()),
    "render precision": (lambda x: ic.render(SCENE, EYE, **small(precision=x)), ()),
    "render progress": (lambda x: ic.render(SCENE, EYE, **small(spp=2, progress=x)), (None,)),
    "render device": (lambda x: ic.render(SCENE, EYE, **small(device=x)), (None,)),
    "psf scene": (lambda x: ic.psf_baseline.render(x, EYE), ()),
    "psf eye": (lambda x: ic.psf_baseline.render(SCENE, x), ()),
    "psf method": (lambda x: ic.psf_baseline.render(SCENE, EYE, **small(method=x)), ()),
    "psf kind": (lambda x: ic.psf_baseline.render(SCENE, EYE, **small(psf=x)), ()),
    "psf layers": (
        lambda x: ic.psf_baseline.render(SCENE, EYE, **small(layers=x)),
        ([1, 2, 3, 4, 5],),
    ),
    "psf oversampling": (lambda x: ic.psf_baseline.render(SCENE, EYE, **small(oversampling=x)), ()),
    "psf progress": (lambda x: ic.psf_baseline.render(SCENE, EYE, **small(progress=x)), (None,)),
    "geometric psf eye": (lambda x: ic.psf_baseline.geometric_psf(x, 550.0, 1.0, 0.01), ()),
    "geometric psf": (lambda x: ic.psf_baseline.geometric_psf(EYE, x, 1.0, 0.01), ()),
    "geometric psf depth": (lambda x: ic.psf_baseline.geometric_psf(EYE, 550.0, x, 0.01), ()),
    "geometric psf field": (
        lambda x: ic.psf_baseline.geometric_psf(EYE, 550.0, 1.0, 0.01, x),
        (),
    ),
    "image dataset": (lambda x: ic.RetinalImage(x), ()),
    "image save": (lambda x: image().save(x), ("abc", "3")),
    "image load": (lambda x: ic.RetinalImage.load(x), ()),
    "image plot": (lambda x: image().plot(x), (None,)),
    "image scale": (lambda x: image().scale_to_mean_illuminance(x), ()),
    "image white": (lambda x: image().to_srgb(x), (None,)),
    "image white point": (lambda x: image().to_srgb(None, x), ()),
    "occlusion image": (lambda x: ic.validation.occlusion_error(x, image()), ()),
    "occlusion reference": (lambda x: ic.validation.occlusion_error(image(), x), ()),
    "compare methods": (lambda x: ic.validation.compare(SCENE, EYE, methods=x), ()),
    "compare samples": (lambda x: ic.validation.compare(SCENE, EYE, samples=x), ()),
    "compare reference": (lambda x: ic.validation.compare(SCENE, EYE, reference_spp=x), ()),
    "compare seed": (lambda x: ic.validation.compare(SCENE, EYE, seed=x), ()),
    "compare step": (lambda x: ic.validation.compare(SCENE, EYE, on_step=x), (None,)),
}


def is_legal(junk, legal):
    return any(repr(junk) == repr(each) for each in legal)


@pytest.mark.parametrize("name", CALLS)
def test_junk_is_refused_with_a_clear_error(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    call, legal = CALLS[name]
    tried = 0
    for junk in JUNK:
        if is_legal(junk, legal):
            continue
        tried += 1
        with pytest.raises(ic.IsetclError) as caught:
            call(junk)
        assert len(str(caught.value)) > 15, junk
    assert tried >= 5


def test_options_that_do_not_exist_are_named():
    with pytest.raises(
        ic.InvalidInputError, match=r"unknown option of plot 'white_luks'.*white_lux"
    ):
        image().plot(white_luks=3.0)
    with pytest.raises(ic.InvalidInputError, match="unknown option of compare 'spp'"):
        ic.validation.compare(SCENE, EYE, spp=4)


def test_a_black_image_is_not_scaled():
    with pytest.raises(ic.InvalidInputError, match="a black image cannot be scaled"):
        image(value=0.0).scale_to_mean_illuminance(5.0)

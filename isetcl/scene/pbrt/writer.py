"""A scene as PBRT 4 text, with PLY meshes and PFM pictures beside it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from isetcl.errors import FileError, InvalidInputError, check_type
from isetcl.scene.colour import _xyz_of_primaries
from isetcl.scene.display import display_primaries
from isetcl.scene.light import DistantLight, Environment, Light, SpotLight, light_spectrum
from isetcl.scene.light_field import LightField
from isetcl.scene.material import EMITTING, Diffuse, Emission, UnlitReflectance
from isetcl.scene.mesh import Instance, Mesh
from isetcl.scene.model import Disc, Quad, Scene, SceneObject, Sphere
from isetcl.scene.pbrt.pictures import octahedral_directions
from isetcl.scene.pbrt.places import Notes
from isetcl.scene.pbrt.surfaces import has_texture
from isetcl.scene.pbrt.text import comment, file_stem, name_comment, number, numbers, spectral
from isetcl.scene.pbrt.write_materials import MaterialWriter
from isetcl.scene.texture import TEXTURES, Checkerboard, Image, Texture
from isetcl.spectrum import Spectrum

_HEADER = """\
Scale -1 1 1
LookAt 0 0 0  0 0 -1  0 1 0
Camera "perspective" "float fov" 40
Film "rgb" "integer xresolution" 512 "integer yresolution" 512 "string filename" "{name}.exr"
Sampler "halton" "integer pixelsamples" 64
Integrator "volpath" "integer maxdepth" 16

WorldBegin
"""
_STEPS = 128


def write_scene(scene: Scene, path: str | Path) -> None:
    """Write a scene as PBRT 4 text; meshes (PLY) and pictures (PFM) go beside it.

    What `load_scene` reads from the file is the same scene. What PBRT has no words for is listed
    in warnings, one a kind.

    Raises
    ------
    FileError
        If a file cannot be written, or the name does not end in .pbrt.
    """
    check_type("path", path, (str, Path))
    check_type("scene", scene, Scene)
    file = Path(path)
    if file.suffix.lower() != ".pbrt":
        raise FileError(f"a scene must be saved as .pbrt, got {str(file)!r}; rename it")
    try:
        if not file.parent.is_dir():
            raise FileError(f"folder {str(file.parent)!r} does not exist; create it first")
        notes = Notes(f"saving {file.name}")
        text = _Writer(file, notes).text(scene)
        file.write_text(text, encoding="utf-8")
    except (OSError, ValueError) as error:
        if isinstance(error, (FileError, InvalidInputError)):
            raise
        raise FileError(f"scene {str(file)!r} cannot be written ({error})") from error
    notes.warn()


class _Writer:
    """Gathers the lines of a file."""

    def __init__(self, file: Path, notes: Notes) -> None:
        self._folder = file.parent
        self._stem = file_stem(file.stem)
        self._notes = notes
        self._materials = MaterialWriter(file.parent, self._stem, notes)
        self._world: list[str] = []
        self._meshes: dict[str, str] = {}
        self._definitions: dict[str, str] = {}

    def text(self, scene: Scene) -> str:
        """The whole file."""
        if scene.background is not None:
            self._background(scene.background)
        for light in scene.lights:
            self._light(light)
        for item in scene.objects:
            self._object(item)
        head = [
            comment(f"{scene.name}, written by isetcl. Metres; the eye at the origin, along -z."),
            _HEADER.format(name=self._stem),
        ]
        return "\n".join([*head, *self._materials.lines, *self._world]) + "\n"

    # Lights

    def _radiance(self, name: str, of: Spectrum) -> str | None:
        """A light's spectrum with the scale that PBRT 4 takes out: its luminance in cd/m^2."""
        luminance = of.luminance_cd_m2()
        if not luminance > 0:
            if of.values.any():
                self._notes.add("lights without visible energy left out", of.name)
            return None
        return f"{spectral(name, of)}\n  {number('scale', luminance)}"

    def _background(self, background: Spectrum | Environment) -> None:
        if isinstance(background, Environment) and background.texture is not None:
            self._environment(background)
            return
        even = background if isinstance(background, Spectrum) else background.spectra()[0]
        radiance = self._radiance("L", even)
        if radiance is not None:
            self._world.append(f'LightSource "infinite"\n  {radiance}')

    def _environment(self, sky: Environment) -> None:
        assert sky.texture is not None
        rows, columns = sky.texture.shape
        n = int(np.clip(2 ** np.ceil(np.log2(max(rows, columns / 2, 8) * 1.5)), 8, 4096))
        self._notes.add("environments resampled to PBRT's equal-area square", sky.texture.name)
        # The square's axes are those of the world.
        directions = octahedral_directions(n)
        texels = sky.texture.weights(*sky.coordinates(directions))
        white, rgb = self._as_rgb(sky.spectra(), texels)
        name = self._materials.picture(rgb)
        self._world.append(
            f'LightSource "infinite"\n  "string filename" "{name}"\n  {number("scale", white)}'
        )

    def _as_rgb(
        self, spectra: tuple[Spectrum, ...], weights: np.ndarray
    ) -> tuple[float, np.ndarray]:
        """Weights of spectra as linear sRGB under a white of some cd/m^2, float32."""
        white = float(spectra[0].values.max() / display_primaries(1.0)[0].values.max())
        if white > 0 and len(spectra) == 3:
            pairs = list(zip(spectra, display_primaries(white), strict=True))
            if all(_is_close(a, b) for a, b in pairs):
                return white, np.asarray(weights, dtype=np.float32)
        self._notes.add(
            "luminous pictures written in sRGB, whose spectra PBRT makes anew", spectra[0].name
        )
        matrix = np.stack([_linear_rgb(s) for s in spectra])
        rgb = np.maximum(weights.reshape(*weights.shape[:2], -1) @ matrix, 0.0)
        white = float(rgb.max()) or 1.0
        return white, (rgb / white).astype(np.float32)

    def _light(self, light: Light) -> None:
        name = "L" if isinstance(light, DistantLight) else "I"
        radiance = self._radiance(name, light_spectrum(light))
        if radiance is None:
            return
        if isinstance(light, DistantLight):
            place = f'"point3 from" {numbers(light.towards)} "point3 to" [ 0 0 0 ]'
            self._world.append(f'LightSource "distant"\n  {place}\n  {radiance}')
            return
        if isinstance(light, SpotLight):
            end = np.add(light.position_m, light.direction)
            lines = [
                'LightSource "spot"',
                f'"point3 from" {numbers(light.position_m)} "point3 to" {numbers(end)}',
                number("coneangle", light.cone_deg),
                number("conedeltaangle", light.penumbra_deg),
                radiance,
            ]
            self._world.append("\n  ".join(lines))
            return
        place = f'"point3 from" {numbers(light.position_m)}'
        self._world.append(f'LightSource "point"\n  {place}\n  {radiance}')

    # Objects

    def _object(self, item: SceneObject) -> None:
        emission, opacity = item.emitted, item.opacity
        if isinstance(emission, UnlitReflectance):
            self._notes.add("unlit surfaces written as luminous ones", item.name)
            emission = Emission(emission.spectra(), emission.texture)
        if emission is not None and emission.is_additive:
            self._notes.add("luminous surfaces that let light pass, written as opaque", item.name)
        pattern = None if emission is None else emission.texture
        if emission is not None and isinstance(pattern, Checkerboard):
            if isinstance(opacity, TEXTURES):
                self._notes.add("cut-outs of luminous checkerboards left out", item.name)
                opacity = 1.0
            self._halves(item, emission, pattern, float(opacity))
            return
        self._part(item, emission, opacity)

    def _halves(
        self, item: SceneObject, emission: Emission, pattern: Checkerboard, opacity: float
    ) -> None:
        """A luminous checkerboard as two lights, each cut out where the other shines."""
        periods = (pattern.periods_u, pattern.periods_v)
        for weight, values in ((pattern.bright, (opacity, 0.0)), (pattern.dark, (0.0, opacity))):
            even = Emission(emission.spectra()[0].scaled(weight), sides=emission.sides)
            self._part(item, even if weight > 0 else None, Checkerboard(*periods, *values))

    def _part(self, item: SceneObject, emission: Emission | None, opacity: float | Texture) -> None:
        material = item.material
        if isinstance(material, EMITTING):
            material = Diffuse(Spectrum.constant(0.0, "black"))
        name = self._materials.material(material)
        lines = [name_comment(item.name), "AttributeBegin", f'  NamedMaterial "{name}"']
        if emission is not None:
            light = self._area_light(emission)
            lines += [f"  {light}"] if light else []
        alpha = "" if opacity == 1.0 else " " + self._materials.level("alpha", opacity)
        is_patterned = emission is not None and emission.texture is not None
        uses_uv = has_texture(material) or is_patterned or isinstance(opacity, TEXTURES)
        shape = item.shape
        if isinstance(shape, Instance):
            self._instance(shape, lines, alpha, emission is not None)
            return
        lines += self._shape(shape, alpha, uses_uv)
        self._world.append("\n".join([*lines, "AttributeEnd"]))

    def _area_light(self, emission: Emission) -> str | None:
        sides = '"bool twosided" ' + ("true" if emission.sides == "both" else "false")
        if emission.texture is None:
            radiance = self._radiance("L", emission.spectra()[0])
            return None if radiance is None else f'AreaLightSource "diffuse" {sides} {radiance}'
        pattern = emission.texture
        if isinstance(pattern, Image) and pattern.is_plain:
            texels = pattern.texels
        elif isinstance(pattern, LightField):
            self._notes.add("light fields written as light alike in all directions", pattern.name)
            texels = pattern.texels.mean(axis=(2, 3))
        else:
            self._notes.add(
                "luminous patterns written as pictures, their edges blurred", type(pattern).__name__
            )
            centres = (np.arange(2048) + 0.5) / 2048
            texels = pattern.weights(*np.meshgrid(centres, 1.0 - centres))
        white, rgb = self._as_rgb(emission.spectra(), texels)
        if not rgb.any():
            return None
        name = self._materials.picture(rgb)
        scale = number("scale", white)
        return f'AreaLightSource "diffuse" {sides} "string filename" "{name}" {scale}'

    def _shape(self, shape: Quad | Disc | Sphere | Mesh, alpha: str, uses_uv: bool) -> list[str]:
        if isinstance(shape, Mesh):
            return [f'  Shape "plymesh" "string filename" "{self._ply(shape)}"{alpha}']
        if isinstance(shape, Quad):
            c, u, v = (np.array(a) for a in (shape.corner_m, shape.edge_u_m, shape.edge_v_m))
            corners = np.stack([c, c + u, c + v, c + u + v])
            return [f'  Shape "bilinearmesh" "point3 P" {numbers(corners)}{alpha}']
        if isinstance(shape, Sphere):
            # PBRT's longitude runs about z from x to y; here about y from z to x.
            axes = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
            radius = number("radius", shape.radius_m)
            return [_transform(axes, shape.centre_m), f'  Shape "sphere" {radius}{alpha}']
        if uses_uv:
            self._notes.add("discs with textures written as triangles", "Disc")
            return [f'  Shape "plymesh" "string filename" "{self._ply(_fan(shape))}"{alpha}']
        quad = shape.bounding_quad()
        u, v = (np.array(edge) / (2.0 * shape.radius_m) for edge in (quad.edge_u_m, quad.edge_v_m))
        axes = np.stack([u, v, np.cross(u, v)], axis=1)
        radius = number("radius", shape.radius_m)
        return [_transform(axes, shape.centre_m), f'  Shape "disk" {radius}{alpha}']

    def _instance(self, shape: Instance, head: list[str], alpha: str, shines: bool) -> None:
        if shines:
            self._notes.add("instances that shine, which PBRT itself renders dark", "Instance")
        body = "\n".join([*head[1:], *self._shape(shape.mesh, alpha, True), "AttributeEnd"])
        if body not in self._definitions:
            name = f"object-{len(self._definitions)}"
            self._definitions[body] = name
            self._world.append(f'ObjectBegin "{name}"\n{body}\nObjectEnd')
        self._world.append(
            f"{head[0]}\n"
            "AttributeBegin\n"
            f"  Transform {numbers(shape.matrix.T)}\n"
            f'  ObjectInstance "{self._definitions[body]}"\n'
            "AttributeEnd"
        )

    def _ply(self, mesh: Mesh) -> str:
        key = mesh.digest()
        if key not in self._meshes:
            name = f"{self._stem}-{len(self._meshes)}.ply"
            _write_ply(self._folder / name, mesh)
            self._meshes[key] = name
        return self._meshes[key]


def _is_close(a: Spectrum, b: Spectrum) -> bool:
    same_grid = np.array_equal(a.wavelengths_nm, b.wavelengths_nm)
    return same_grid and np.allclose(a.values, b.values, rtol=1e-9, atol=0)


def _linear_rgb(of: Spectrum) -> np.ndarray:
    """Linear sRGB of a radiance, (1, 1, 1) being a white of 1 cd/m^2."""
    from isetcl.scene.colour import _observer

    grid, functions = _observer(1)
    radiance = np.interp(grid, of.wavelengths_nm, of.values, left=0.0, right=0.0)
    return np.asarray(np.linalg.solve(_xyz_of_primaries(), functions.T @ radiance))


def _transform(axes: np.ndarray, centre: tuple[float, float, float]) -> str:
    matrix = np.eye(4)
    matrix[:3, :3] = axes
    matrix[:3, 3] = centre
    return f"  Transform {numbers(matrix.T)}"


def _fan(disc: Disc) -> Mesh:
    """A disc as triangles, with its texture coordinates."""
    quad = disc.bounding_quad()
    turn = np.linspace(0.0, 2.0 * np.pi, _STEPS, endpoint=False)
    rim = 0.5 + 0.5 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    uv = np.concatenate([[[0.5, 0.5]], rim])
    points = np.array(quad.corner_m) + uv[:, :1] * quad.edge_u_m + uv[:, 1:] * quad.edge_v_m
    after = np.arange(1, _STEPS + 1)
    faces = np.stack([np.zeros(_STEPS, dtype=int), after, after % _STEPS + 1], axis=1)
    return Mesh(points, faces, None, uv)


def _write_ply(path: Path, mesh: Mesh) -> None:
    """Write a mesh as binary PLY with numbers of 64 bits."""
    columns = [mesh.vertices_m]
    names = ["x", "y", "z"]
    if mesh.normals is not None:
        columns.append(mesh.normals)
        names += ["nx", "ny", "nz"]
    if mesh.uv is not None:
        columns.append(mesh.uv)
        names += ["u", "v"]
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(mesh.vertices_m)}"]
    head += [f"property double {name}" for name in names]
    head += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices"]
    head += ["end_header", ""]
    faces = np.empty(len(mesh.faces), dtype=[("n", "u1"), ("i", "<i4", (3,))])
    faces["n"], faces["i"] = 3, mesh.faces
    data = np.ascontiguousarray(np.concatenate(columns, axis=1), dtype="<f8")
    path.write_bytes("\n".join(head).encode() + data.tobytes() + faces.tobytes())

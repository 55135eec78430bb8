"""Scenes in Mitsuba 3, seen along the very rays that leave an eye of isetcl.

`translate` writes a scene of isetcl as a scene of Mitsuba, object by object. `Comparison` lets
isetcl render the scene through an eye, takes the rays that its first stage sends out of the eye,
lets Mitsuba's path tracer find the radiance along them, and weighs that as isetcl does. Both films
are means over the same rays, so what differs is what happens in the scene, and nothing else.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pytest

import isetcl as ic
from isetcl.device import program
from isetcl.device.elements import declarations
from isetcl.render import pack, sobol
from isetcl.render.kernel_config import PathConfig
from isetcl.render.paths import PathPipeline
from isetcl.validation.stats import Replicates, image_test

WAVELENGTHS_NM = np.array([450.0, 530.0, 610.0, 690.0])


def load(variant="llvm_ad_spectral"):
    """Mitsuba 3 in a variant; tests are skipped where it, or an LLVM library, is missing."""
    libraries = sorted(Path("/usr/lib").glob("*/libLLVM*.so*"))
    if libraries:
        os.environ.setdefault("DRJIT_LIBLLVM_PATH", str(libraries[-1]))
    mi = pytest.importorskip("mitsuba")
    try:
        mi.set_variant(variant)
        np.array(mi.Float([1.0, 2.0]) + 1.0)
    except (ImportError, AttributeError, RuntimeError) as error:
        pytest.skip(f"Mitsuba's {variant} does not run: {error}")
    return mi


class Translator:
    """What a scene of isetcl is in Mitsuba."""

    def __init__(self, mi) -> None:
        self.mi = mi
        self.is_mono = mi.variant().endswith("mono")
        # On spheres Mitsuba counts v from the other pole.
        self.is_ball = False

    def spectrum(self, spectrum, scale=1.0):
        values = scale * spectrum.at(WAVELENGTHS_NM)
        return self.table(values)

    def table(self, values):
        if self.is_mono:
            return {"type": "uniform", "value": float(values[0])}
        return {
            "type": "irregular",
            "wavelengths": ", ".join(f"{w:.9g}" for w in WAVELENGTHS_NM),
            "values": ", ".join(f"{v:.9g}" for v in np.broadcast_to(values, 4)),
        }

    def texture(self, texture, spectrum=None):
        """A spectrum weighted by a texture; a grey texture where there is no spectrum."""
        if isinstance(texture, (int, float)):
            return float(texture)
        if texture is None:
            return self.spectrum(spectrum)
        if isinstance(texture, ic.Checkerboard):
            across, up = texture.periods_u, texture.periods_v
            to_uv = self.mi.ScalarTransform4f().scale([across, up, 1])
            if self.is_ball:
                to_uv = self.mi.ScalarTransform4f().translate([0, up, 0]).scale([across, -up, 1])
            colours = [
                {"type": "uniform", "value": level}
                if spectrum is None
                else self.spectrum(spectrum, level)
                for level in (texture.bright, texture.dark)
            ]
            if spectrum is None:
                # For grey values Mitsuba 3.9 takes the two colours the other way round.
                colours.reverse()
            return {
                "type": "checkerboard",
                "color0": colours[0],
                "color1": colours[1],
                "to_uv": to_uv,
            }
        assert isinstance(texture, ic.Image)
        assert texture.channels == 1
        level = 1.0 if spectrum is None else float(spectrum.values[0])
        assert spectrum is None or np.ptp(spectrum.values) == 0, "grey pictures only"
        data = np.asarray(texture.texels, dtype=np.float32).reshape(*texture.shape, 1) * level
        # Mitsuba's rows start at v = 0, and those of isetcl at v = 1.
        data = data if self.is_ball else data[::-1]
        return {
            "type": "bitmap",
            "data": self.mi.TensorXf(np.ascontiguousarray(data)),
            "raw": True,
            "filter_type": "bilinear",
            "wrap_mode": texture.wrap,
        }

    def roughness(self, material, smooth, rough):
        if isinstance(material.roughness, (int, float)) and material.roughness == 0:
            return {"type": smooth}
        alpha = self.texture(material.roughness)
        return {"type": rough, "distribution": "ggx", "alpha": alpha}

    def material(self, material):
        if isinstance(material, ic.Diffuse):
            assert material.transmittance is None
            colour = self.texture(material.texture, material.reflectance)
            return _both({"type": "diffuse", "reflectance": colour})
        if isinstance(material, ic.Mirror):
            kind = self.roughness(material, "conductor", "roughconductor")
            more = {"material": "none", "specular_reflectance": self.spectrum(material.reflectance)}
            return _both(kind | more)
        if isinstance(material, ic.Conductor):
            kind = self.roughness(material, "conductor", "roughconductor")
            n, k = material.index.at(WAVELENGTHS_NM)
            return _both(kind | {"eta": self.table(n), "k": self.table(k)})
        if isinstance(material, ic.Dielectric):
            kind = self.roughness(material, "dielectric", "roughdielectric")
            index = float(material.index.index(WAVELENGTHS_NM)[0])
            return kind | {"int_ior": index, "ext_ior": 1.0}
        if isinstance(material, ic.Coated):
            kind = self.roughness(material, "plastic", "roughplastic")
            index = float(material.index.index(WAVELENGTHS_NM)[0])
            colour = self.texture(material.texture, material.reflectance)
            more = {"int_ior": index, "ext_ior": 1.0, "nonlinear": True}
            return _both(kind | more | {"diffuse_reflectance": colour})
        if isinstance(material, ic.Mix):
            return {
                "type": "blendbsdf",
                "weight": self.texture(material.weight),
                "first": self.material(material.first),
                "second": self.material(material.second),
            }
        assert isinstance(material, ic.TwoSided)
        return {
            "type": "twosided",
            "first": self.material(material.front)["material"],
            "second": self.material(material.back)["material"],
        }

    def shape(self, shape):
        matrix = np.eye(4)
        if isinstance(shape, ic.Quad):
            u, v = (np.array(e) / 2 for e in (shape.edge_u_m, shape.edge_v_m))
            normal = np.cross(u, v)
            matrix[:3] = np.column_stack(
                [u, v, normal / np.linalg.norm(normal), np.array(shape.corner_m) + u + v]
            )
            return {"type": "rectangle", "to_world": self.mi.ScalarTransform4f(matrix)}
        if isinstance(shape, ic.Disc):
            to_world = self.mi.ScalarTransform4f().look_at(
                shape.centre_m, np.add(shape.centre_m, shape.normal), _across(shape.normal)
            )
            radius = shape.radius_m
            return {"type": "disk", "to_world": to_world.scale([radius, radius, 1])}
        assert isinstance(shape, ic.Sphere)
        # Longitude turns about z in Mitsuba, from x, and here about y, from z.
        matrix[:3, :3] = np.eye(3)[:, [2, 0, 1]] * shape.radius_m
        matrix[:3, 3] = shape.centre_m
        return {"type": "sphere", "to_world": self.mi.ScalarTransform4f(matrix)}

    def mesh(self, mesh, parts):
        mi = self.mi
        properties = mi.Properties()
        for key, value in parts.items():
            properties[key] = mi.load_dict(value)
        made = mi.Mesh(
            "mesh",
            len(mesh.vertices_m),
            len(mesh.faces),
            has_vertex_normals=mesh.normals is not None,
            has_vertex_texcoords=mesh.uv is not None,
            props=properties,
        )
        values = mi.traverse(made)
        values["vertex_positions"] = np.ravel(mesh.vertices_m).astype(np.float32)
        values["faces"] = np.ravel(mesh.faces).astype(np.uint32)
        if mesh.normals is not None:
            values["vertex_normals"] = np.ravel(mesh.normals).astype(np.float32)
        if mesh.uv is not None:
            values["vertex_texcoords"] = np.ravel(mesh.uv).astype(np.float32)
        values.update()
        return made

    def object(self, item):
        parts = {}
        self.is_ball = isinstance(item.shape, ic.Sphere)
        emission = item.emitted
        if emission is not None:
            one_sided = emission.sides == "front" or isinstance(item.shape, ic.Sphere)
            assert one_sided, "Mitsuba's area lights shine to the front only"
            radiance = self.texture(emission.texture, emission.radiance)
            parts["emitter"] = {"type": "area", "radiance": radiance}
        if isinstance(item.material, ic.Emission):
            black = {"type": "uniform", "value": 0.0}
            parts["bsdf"] = {"type": "diffuse", "reflectance": black}
        else:
            parts["bsdf"] = self.material(item.material)
        if not (isinstance(item.opacity, float) and item.opacity == 1.0):
            opacity = self.texture(item.opacity)
            parts["bsdf"] = {"type": "mask", "opacity": opacity, "nested": parts["bsdf"]}
        if isinstance(item.shape, ic.Mesh):
            return self.mesh(item.shape, parts)
        return self.shape(item.shape) | parts

    def light(self, light):
        if isinstance(light, ic.PointLight):
            intensity = self.spectrum(light.intensity)
            return {"type": "point", "position": list(light.position_m), "intensity": intensity}
        if isinstance(light, ic.DistantLight):
            towards = [-x for x in light.towards]
            irradiance = self.spectrum(light.irradiance)
            return {"type": "directional", "direction": towards, "irradiance": irradiance}
        assert isinstance(light, ic.SpotLight)
        assert light.penumbra_deg == 0, "Mitsuba's spots fall off linearly with the angle"
        return {
            "type": "spot",
            "to_world": self.mi.ScalarTransform4f().look_at(
                light.position_m,
                np.add(light.position_m, light.direction),
                _across(light.direction),
            ),
            "intensity": self.spectrum(light.intensity),
            "cutoff_angle": light.cone_deg,
            "beam_width": light.cone_deg * (1 - 1e-6),
        }

    def scene(self, scene):
        parts = {"type": "scene"}
        parts |= {f"object_{i}": self.object(o) for i, o in enumerate(scene.objects)}
        parts |= {f"light_{i}": self.light(light) for i, light in enumerate(scene.lights)}
        if isinstance(scene.background, ic.Spectrum):
            parts["sky"] = {"type": "constant", "radiance": self.spectrum(scene.background)}
        elif scene.background is not None:
            parts["sky"] = self.environment(scene.background)
        return self.mi.load_dict(parts)

    def environment(self, environment):
        """An image all around: columns from -z over +x, at their middles; rows from +y to -y."""
        assert self.is_mono, "colours of images are made up of RGB in spectral variants"
        rows, columns = (2 * n for n in environment.texture.shape)
        polar = np.pi * np.arange(rows) / (rows - 1)
        turn = 2 * np.pi * (np.arange(columns) + 0.5) / columns
        polar, turn = np.meshgrid(polar, turn, indexing="ij")
        directions = np.stack(
            [np.sin(polar) * np.sin(turn), np.cos(polar), -np.sin(polar) * np.cos(turn)], axis=-1
        )
        level = environment.texture.weights(*environment.coordinates(directions))
        level = level * float(environment.radiance.at(WAVELENGTHS_NM)[0])
        texels = np.repeat(level, 3, axis=-1).astype(np.float32)
        return {"type": "envmap", "bitmap": self.mi.Bitmap(np.ascontiguousarray(texels))}


def _both(bsdf):
    return {"type": "twosided", "material": bsdf}


def _across(direction):
    direction = np.abs(np.asarray(direction, dtype=float))
    return list(np.eye(3)[int(np.argmin(direction))])


class Rays:
    """The rays that leave an eye for replicates of samples: (replicates, samples, pixels, ...)."""

    def __init__(self, pipeline, samples, streams):
        import pyopencl as cl

        (tile,) = pipeline.tiles()
        assert pipeline._n_bands == 1
        pipeline._begin(tile)
        config = pipeline._config
        source = program.assemble(
            "start_paths.cl",
            config.eye_defines(pipeline._device, config.vector_width),
            declarations() + pack.eye_declarations() + pack.sobol_declaration(),
        )
        kernel = program.kernel(pipeline._device, source, "start_paths")
        pixels = tile.columns * tile.rows
        padded = pipeline._pad(pixels)
        slots = padded * samples
        real = pipeline._real
        found = []
        # Origin, direction, weight, and a place that only given rays use.
        buffers = [pipeline._device.allocate(k * slots, real) for k in (3, 3, 1, 1)]
        for stream in streams:
            kernel.set_args(
                *pipeline._eye_arguments(),
                np.uint32(0),
                np.uint32(samples),
                np.uint32(stream),
                np.int32(padded),
                np.int32(slots),
                *buffers,
            )
            size = (padded // config.vector_width, 1, samples)
            cl.enqueue_nd_range_kernel(pipeline._device.queue, kernel, size, (1, 1, 1))
            planes = [np.empty((3, samples, padded), dtype=real) for _ in range(2)]
            weight = np.empty((samples, padded), dtype=real)
            for array, buffer in zip([*planes, weight], buffers[:3], strict=True):
                cl.enqueue_copy(pipeline._device.queue, array, buffer)
            found.append([*(p[:, :, :pixels] for p in planes), weight[:, :pixels]])
        self.origin, self.direction = (np.stack([f[i] for f in found], axis=1) for i in range(2))
        self.weight = np.stack([f[2] for f in found]).astype(np.float64)


def radiance(mi, scene, rays, max_depth, seed=0, chunk=1 << 19):
    """Radiance along rays by Mitsuba's path tracer, (4, replicates, samples, pixels)."""
    integrator = mi.load_dict({"type": "path", "max_depth": max_depth, "rr_depth": 4})
    origin, direction = (a.reshape(3, -1).astype(np.float32) for a in (rays.origin, rays.direction))
    n = origin.shape[1]
    channels = 1 if mi.variant().endswith("mono") else 4
    out = np.empty((channels, n))
    sampler = mi.load_dict({"type": "independent"})
    for number, first in enumerate(range(0, n, chunk)):
        part = slice(first, min(first + chunk, n))
        ray = mi.Ray3f(mi.Point3f(origin[:, part]), mi.Vector3f(direction[:, part]))
        if channels == 4:
            ray.wavelengths = type(ray.wavelengths)(*WAVELENGTHS_NM.tolist())
        sampler.seed(1000 * seed + number, part.stop - part.start)
        spectrum, _, _ = integrator.sample(scene, sampler, mi.RayDifferential3f(ray))
        out[:, part] = np.array(spectrum)
    return out.reshape(channels, *rays.weight.shape)


@dataclass(frozen=True)
class View:
    """What both renderers look at, and how long."""

    fov_deg: float = 9.8
    resolution: int = 64
    samples: int = 16
    replicates: int = 16
    bounces: int = 1
    seed: int = 0
    precision: str = "single"

    def pipeline(self, scene, eye=None):
        prepared = ic.plan(
            scene,
            ic.eyes.navarro(4.0, 1.0) if eye is None else eye,
            fov_deg=self.fov_deg,
            resolution=self.resolution,
            wavelengths_nm=WAVELENGTHS_NM,
            bands=1,
            max_bounces=self.bounces,
            precision=self.precision,
        )
        assert isinstance(prepared.config, PathConfig)
        return PathPipeline(prepared)

    @property
    def streams(self):
        return [sobol.stream(self.seed, i) for i in range(self.replicates)]

    def film(self, pipeline):
        """Films of replicates, (replicates, 4, rows, columns)."""
        (tile,) = pipeline.tiles()
        return np.stack([pipeline.sample(tile, self.samples, s) for s in self.streams])


class Comparison:
    """isetcl and Mitsuba along the same rays; differences are tested over replicates."""

    def __init__(self, scene, view, *, eye=None, variant="llvm_ad_spectral", loaded=None):
        self.view = view
        self._eye = eye
        self._mi = load(variant)
        pipeline = view.pipeline(scene, eye)
        self.rays = Rays(pipeline, view.samples, view.streams)
        self.even = self.rays.weight.mean(axis=1)
        self._loaded = Translator(self._mi).scene(scene) if loaded is None else loaded
        self.own = view.film(pipeline)

    @cached_property
    def other(self):
        """Mitsuba's films, (replicates, 4, rows, columns)."""
        seen = radiance(self._mi, self._loaded, self.rays, self.view.bounces + 1, self.view.seed)
        film = (seen * self.rays.weight).mean(axis=2).transpose(1, 0, 2)
        n = self.view.resolution
        return film.reshape(*film.shape[:2], n, n)

    def films(self, scene):
        """isetcl's films of another scene along the same rays."""
        return self.view.film(self.view.pipeline(scene, self._eye))

    @property
    def level(self):
        """Mean radiance that Mitsuba finds."""
        return float(self.other.mean() / self.even.mean())

    def agreement(self, own=None):
        n = self.view.resolution
        even = self.even.reshape(-1, n, n).mean(axis=0)
        own = self.own if own is None else own
        return agreement(own, self.other, even)


def agreement(own, other, even):
    """Paired tests of two sets of films over replicates, in radiance.

    Blocks without any noise differ by the rounding of single precision only.
    """
    channels = other.shape[1]
    films = (Replicates(f / even.mean()) for f in (own[:, :channels], other))
    return image_test(*films, paired=True, rounding=2e-5)

"""Wavefront OBJ files: the materials of their MTL files, and text that trimesh reads wrongly.

Source: Alias Wavefront, Advanced Visualizer manual, appendices B1 (OBJ) and B2 (MTL).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from isetcl.errors import FileError
from isetcl.scene.assets import Assets, Picture, read_bytes
from isetcl.scene.colour import reflectance_of_rgb
from isetcl.scene.material import Coated, Diffuse, Mix
from isetcl.scene.specular import Level, Mirror
from isetcl.scene.surface import (
    GREY,
    Paint,
    Placement,
    Rgb,
    Surface,
    clear_coat,
    glass_of,
    level,
    metallic_roughness,
    plain,
    squared,
)

_DARK = 1e-3
_REFRACTING = (4, 6, 7, 9)
_MIRRORING = (3, 5)
# Options of a texture and how many words follow each.
_OPTIONS = {
    "-blendu": 1,
    "-blendv": 1,
    "-bm": 1,
    "-boost": 1,
    "-cc": 1,
    "-clamp": 1,
    "-imfchan": 1,
    "-mm": 2,
    "-texres": 1,
    "-type": 1,
}
_KNOWN = {
    "kd", "ks", "ke", "ka", "ns", "ni", "d", "tr", "tf", "illum", "pr", "pm", "map_kd", "map_ke",
    "map_d", "map_pr", "map_pm", "sharpness",
}  # fmt: skip


@dataclass(eq=False)
class MtlMaterial:
    """An entry of an MTL file: its statements, by lower-case key, and where they stand."""

    name: str
    entries: dict[str, list[str]] = field(default_factory=dict)
    where: dict[str, str] = field(default_factory=dict)

    def numbers(self, key: str) -> list[float] | None:
        """Numbers of an entry; None if there is none.

        Raises
        ------
        FileError
            If they are none.
        """
        words = self.entries.get(key)
        if words is None:
            return None
        try:
            found = [float(word) for word in words if not word.startswith("-halo")]
            if not found or not all(abs(x) < 1e30 for x in found):
                raise ValueError
        except ValueError:
            raise FileError(
                f"{self.where[key]}: {key} must be followed by numbers, got "
                f"{' '.join(words)[:60]!r}; correct the line"
            ) from None
        return found

    def number(self, key: str, default: float) -> float:
        """The first number of an entry, or the default."""
        found = self.numbers(key)
        return default if found is None else found[0]

    def colour(self, key: str, default: Rgb) -> Rgb:
        """A colour >= 0 of one (grey) or three numbers."""
        found = self.numbers(key)
        if found is None:
            return default
        red, green, blue = found[:3] if len(found) >= 3 else [found[0]] * 3
        return max(red, 0.0), max(green, 0.0), max(blue, 0.0)


def read_mtl(name: str, assets: Assets) -> dict[str, MtlMaterial]:
    """Materials of an MTL file by name; none, with a note, if the file is missing."""
    path = assets.find(name, is_needed=False)
    if path is None:
        assets.note("material files are missing; what they should colour is matt grey", name)
        return {}
    text = read_bytes(path).decode("utf-8", errors="replace").replace("\\\n", " ")
    materials: dict[str, MtlMaterial] = {}
    current: MtlMaterial | None = None
    for count, line in enumerate(text.splitlines(), start=1):
        words = line.split("#", 1)[0].split() if not _names_file(line) else line.split()
        if len(words) < 2:
            continue
        key = words[0].lower()
        if key == "newmtl":
            current = materials.setdefault(" ".join(words[1:]), MtlMaterial(" ".join(words[1:])))
        elif current is not None:
            current.entries[key] = words[1:]
            current.where[key] = f"material file {path.name!r}, line {count}"
    return materials


def _names_file(line: str) -> bool:
    """Whether a line names a file, which may hold #."""
    return line.strip().lower().startswith(("map_", "bump", "disp", "decal", "refl", "norm"))


def surface_of(material: MtlMaterial, assets: Assets, luminance_of_white_cd_m2: float) -> Surface:
    """The look of an MTL material.

    Kd is the colour of a matt surface. A highlight (Ks, with illum other than 0 and 1) makes it a
    coated one; Ks without Kd makes it a mirror, and illum 3 and 5 mix both. illum 4, 6, 7 and 9
    with an index Ni are glass. The exponent Ns becomes a GGX width alpha = sqrt(2 / (Ns + 2)).

    Source of the width: Walter, Marschner, Li & Torrance 2007 (EGSR), section 5.2: Phong's exponent
    2 / alpha^2 - 2 has about the same lobe.
    """
    for key in material.entries:
        if key not in _KNOWN:
            assets.note("entries of materials are left out", key)
    picture, placement = _texture(material, "map_kd", assets)
    kd = material.colour("kd", (1.0, 1.0, 1.0) if picture is not None else GREY)
    if picture is not None and max(kd) <= 0.0:
        # Some programs write black where they mean the picture alone.
        kd = (1.0, 1.0, 1.0)
    clipped: Rgb = (min(kd[0], 1.0), min(kd[1], 1.0), min(kd[2], 1.0))
    paint = Paint(clipped, None if picture is None else picture.colour(), placement)
    opacity = _opacity(material, assets)
    emission = _emission(material, assets).emission(luminance_of_white_cd_m2)
    scattering = _scattering(material, paint, opacity, assets)
    if scattering is None:
        alpha = _alpha(material)
        return Surface(glass_of(material.number("ni", 1.5), alpha), emission)
    return Surface(scattering, emission, opacity)


def _scattering(
    material: MtlMaterial, paint: Paint, opacity: Level, assets: Assets
) -> Diffuse | Coated | Mirror | Mix | None:
    """What an opaque material does with light; None for glass."""
    if "pm" in material.entries or "pr" in material.entries:
        rough = _map(material, "map_pr", material.number("pr", 1.0), assets)
        metallic = _map(material, "map_pm", material.number("pm", 0.0), assets)
        return metallic_roughness(paint, metallic, squared(rough))  # type: ignore[return-value]
    illum = int(material.number("illum", 2))
    index = material.number("ni", 1.0)
    passing = opacity != 1.0 or max(material.colour("tf", (0.0,) * 3)) > 0.0
    if illum in _REFRACTING and index > 1.0 and passing:
        return None
    red, green, blue = (min(x, 1.0) for x in material.colour("ks", (0.0, 0.0, 0.0)))
    shine, alpha = max(red, green, blue), _alpha(material)
    if shine <= _DARK or illum in (0, 1):
        return plain(paint).material  # type: ignore[return-value]
    mirror = Mirror(reflectance_of_rgb((red, green, blue)), roughness=alpha)
    if max(paint.mean()) <= _DARK:
        return mirror
    reflectance, texture = paint.reflectance()
    if illum in _MIRRORING:
        share = shine / (shine + max(paint.mean()))
        return Mix(Diffuse(reflectance, texture), mirror, share)
    coat = clear_coat(index if 1.0 < index < 3.0 else 1.5)
    return Coated(reflectance, texture, index=coat, roughness=alpha)


def _alpha(material: MtlMaterial) -> float:
    """GGX width of the highlight; Ns above 900 or so is a polished surface."""
    exponent = max(material.number("ns", 0.0), 0.0)
    alpha = (2.0 / (exponent + 2.0)) ** 0.5
    return 0.0 if alpha < 0.047 else min(alpha, 1.0)


def _opacity(material: MtlMaterial, assets: Assets) -> Level:
    stated = material.number("d", 1.0 - material.number("tr", 0.0))
    factor = min(max(stated, 0.0), 1.0)
    picture, placement = _texture(material, "map_d", assets)
    if picture is None:
        return factor
    texels = picture.channel(3) if picture.has_alpha else picture.channel(0)
    return level(factor, texels, placement)


def _emission(material: MtlMaterial, assets: Assets) -> Paint:
    picture, placement = _texture(material, "map_ke", assets)
    ke = material.colour("ke", (1.0, 1.0, 1.0) if picture is not None else (0.0, 0.0, 0.0))
    return Paint(ke, None if picture is None else picture.colour(), placement)


def _map(material: MtlMaterial, key: str, factor: float, assets: Assets) -> Level:
    picture, placement = _texture(material, key, assets)
    return level(factor, None if picture is None else picture.channel(0), placement)


def _texture(material: MtlMaterial, key: str, assets: Assets) -> tuple[Picture | None, Placement]:
    """A picture with its options: -s and -o (scale and offset of u and v) and -clamp."""
    words = list(material.entries.get(key, ()))
    scale, offset, wrap = [1.0, 1.0], [0.0, 0.0], "repeat"
    while words and words[0].lower() in (*_OPTIONS, "-s", "-o", "-t"):
        option = words.pop(0).lower()
        if option in _OPTIONS:
            values, words = words[: _OPTIONS[option]], words[_OPTIONS[option] :]
            if option == "-clamp" and values == ["on"]:
                wrap = "clamp"
            continue
        numbers: list[float] = []
        while words and len(numbers) < 3 and re.fullmatch(r"[-+.\deE]+", words[0]):
            numbers.append(float(words.pop(0)))
        target = {"-s": scale, "-o": offset}.get(option, [0.0, 0.0])
        target[: len(numbers[:2])] = numbers[:2]
    if not words:
        return None, Placement()
    placement = Placement(wrap, (scale[0], scale[1]), (offset[0], offset[1]))
    return assets.picture(" ".join(words)), placement


def libraries(text: str) -> list[str]:
    """Names of the MTL files of an OBJ file."""
    return [name.strip() for name in re.findall(r"^[ \t]*mtllib[ \t]+(.+)$", text, re.MULTILINE)]


def used_materials(text: str) -> list[str]:
    """Names of the materials that an OBJ file uses, in order."""
    found = re.findall(r"^[ \t]*usemtl[ \t]+(.+)$", text, re.MULTILINE)
    return list(dict.fromkeys(name.strip() for name in found))


def with_positive_indices(text: str) -> str:
    """The text of an OBJ file with indices that count back replaced by those that count on.

    They count back from the last vertex before the face, which matters where vertices follow.
    """
    if not re.search(r"^[ \t]*f[ \t].*-\d", text, re.MULTILINE):
        return text
    counts = {"v": 0, "vt": 0, "vn": 0}
    lines = []
    for line in text.splitlines():
        words = line.split()
        if words and words[0] in counts:
            counts[words[0]] += 1
        elif words and words[0] == "f":
            line = "f " + " ".join(_positive(word, counts) for word in words[1:])
        lines.append(line)
    return "\n".join(lines) + "\n"


def _positive(corner: str, counts: dict[str, int]) -> str:
    parts = corner.split("/")
    for i, (part, kind) in enumerate(zip(parts, counts, strict=False)):
        if part.startswith("-"):
            parts[i] = str(counts[kind] + 1 + int(part))
    return "/".join(parts)

"""Which version of PBRT a scene is written for: the file does not say, its words do."""

from __future__ import annotations

from isetcl.scene.pbrt.parser import Directive

_V3_MATERIALS = {
    "matte", "plastic", "glass", "metal", "mirror", "uber", "substrate", "translucent", "fourier",
    "disney", "kdsubsurface", "none",
}  # fmt: skip
_V4_MATERIALS = {
    "diffuse", "coateddiffuse", "coatedconductor", "conductor", "dielectric", "thindielectric",
    "diffusetransmission", "interface", "measured",
}  # fmt: skip
_V4_DIRECTIVES = {"Attribute", "Option", "ColorSpace", "Import"}
_V3_NAMES = {"Kd", "Ks", "Kr", "Kt", "mapname", "namedmaterial1", "nsamples", "st", "indexmatch"}
_V4_NAMES = {"reflectance", "illuminance", "power", "materials", "encoding"}


def version_of(directives: list[Directive]) -> int:
    """3 or 4, by what occurs only in one of them; 4 where nothing tells."""
    votes = 0
    for directive in directives:
        votes += _vote(directive)
    return 3 if votes < 0 else 4


def _vote(directive: Directive) -> int:
    vote = 4 if directive.name in _V4_DIRECTIVES else 0
    kind = directive.strings[0] if directive.strings else ""
    if directive.name == "MakeNamedMaterial":
        given = directive.parameters.get("type")
        kind = str(given.values[0]) if given is not None and len(given.values) else ""
    if directive.name in ("Material", "MakeNamedMaterial"):
        vote += 4 * ((kind in _V4_MATERIALS) - (kind in _V3_MATERIALS))
    if directive.name == "Film":
        vote += 4 * ((kind in ("rgb", "gbuffer", "spectral")) - (kind == "image"))
    if directive.name == "Shape" and kind in ("bilinearmesh",):
        vote += 4
    if (
        directive.name == "LightSource"
        and kind == "infinite"
        and "filename" in directive.parameters
    ):
        vote += 4
    if directive.name in ("SurfaceIntegrator", "Renderer"):
        vote -= 4
    for name, parameter in directive.parameters.items():
        vote += (name in _V4_NAMES) - (name in _V3_NAMES)
        if directive.name == "LightSource" and name == "scale":
            vote += 1 if parameter.type == "float" else -1
    return vote

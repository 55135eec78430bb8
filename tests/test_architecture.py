"""The order of the layers, and what importing isetcl costs."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "isetcl"

# Imports only go down this list.
ORDER = (
    {"version"},
    {
        "errors",
        "units",
        "memory",
        "output",
        "netcdf",
        "page",
        "matlab",
        "photons",
        "spectrum",
        "data",
    },
    {"eye"},
    {"scene"},
    {"device", "kernels"},
    {"retina"},
    {"render", "psf_baseline"},
    {"cones"},
    {"validation"},
    {"plots"},
    {"figures"},
    {"report", "validation_report"},
    {"distributed"},
    {"cli"},
)
RANK = {name: i for i, group in enumerate(ORDER) for name in group}
BASELINE_MAY_IMPORT = {
    "version",
    "errors",
    "units",
    "memory",
    "spectrum",
    "eye",
    "scene",
    "retina",
    "psf_baseline",
}


def imported_modules(path):
    """Dotted names under isetcl that a file imports, inside functions too."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {a.name for a in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names |= {f"{node.module}.{a.name}" for a in node.names}
    return {n for n in names if n.split(".")[0] == "isetcl"}


def layer(path):
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return parts[0]


FILES = sorted(p for p in PACKAGE.rglob("*.py") if p != PACKAGE / "__init__.py")


def test_imports_only_go_down():
    for path in FILES:
        own = layer(path)
        for name in imported_modules(path):
            other = name.split(".")[1]
            assert other in RANK, f"{path} imports {name}, which has no place in the order"
            if other != own:
                assert RANK[other] <= RANK[own], f"{path}: {own} must not import {name}"
                assert {own, other} != {"render", "psf_baseline"}, path


def test_every_module_has_a_place_in_the_order():
    for path in FILES:
        assert layer(path) in RANK


def test_the_baseline_imports_neither_renderer_nor_opencl():
    for path in (PACKAGE / "psf_baseline").rglob("*.py"):
        assert {n.split(".")[1] for n in imported_modules(path)} <= BASELINE_MAY_IMPORT
        assert "pyopencl" not in path.read_text()


PIPELINES = ("direct", "paths", "stages", "trees", "device_scene", "survey")


def test_only_the_device_layer_and_the_pipeline_touch_opencl():
    users = {str(p.relative_to(PACKAGE)) for p in FILES if "import pyopencl" in p.read_text()}
    pipelines = {f"render/{name}.py" for name in PIPELINES}
    assert all(u.startswith("device/") or u in pipelines for u in users)


def test_there_is_no_opencl_c_inside_python():
    for path in FILES:
        text = path.read_text()
        assert "get_global_id" not in text
        assert "__kernel" not in text


def test_importing_isetcl_is_cheap():
    heavy = ("pyopencl", "scipy", "xarray", "pandas", "colour", "matplotlib", "skimage", "trimesh")
    code = f"import isetcl, sys; print([m for m in {heavy!r} if m in sys.modules])"
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "[]"


def test_importing_isetcl_brings_nothing_in_before_it_is_used():
    code = (
        "import isetcl, sys\n"
        "print(sorted(m for m in sys.modules if m.startswith('isetcl.')))\n"
        "isetcl.eyes.navarro\n"
        "late = ('fitting', 'files', 'people.population', 'worn', 'waves.huygens')\n"
        "print([m for m in late if 'isetcl.eye.' + m in sys.modules])\n"
        "print([m for m in ('device', 'render.plan', 'scene') if 'isetcl.' + m in sys.modules])\n"
        "from isetcl import load_eye, eyes\n"
        "print(load_eye.__name__, eyes.fit.__name__, isetcl.eyes.load_population.__name__)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.splitlines() == [
        "['isetcl.render', 'isetcl.version']",
        "[]",
        "[]",
        "load_eye fit load_population",
    ]


@pytest.mark.parametrize("path", ["__init__.py", "eye/catalog.py"])
def test_names_that_are_imported_late_are_where_readers_are_told(path):
    # An editor reads the imports under TYPE_CHECKING, Python the table.
    import importlib

    module = importlib.import_module({"__init__.py": "isetcl"}.get(path, "isetcl.eye.catalog"))
    tree = ast.parse((PACKAGE / path).read_text())
    (guarded,) = (n for n in tree.body if isinstance(n, ast.If))
    told = {
        (alias.asname or alias.name): (node.module, alias.name)
        for node in guarded.body
        for alias in node.names
    }
    for name, (where, original) in told.items():
        place = importlib.import_module(where)
        expected = getattr(place, original, None) or importlib.import_module(f"{where}.{original}")
        assert getattr(module, name) is expected
    late = {*getattr(module, "_MODULE_OF", module._PLACES), *getattr(module, "_MODULES", ())}
    assert set(told) == late


def test_every_public_name_exists():
    import isetcl

    for name in isetcl.__all__:
        assert getattr(isetcl, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = isetcl.nonsense


def test_the_render_function_survives_importing_its_package():
    code = (
        "import isetcl, isetcl.render.plan\n"
        "from isetcl.render import schedule\n"
        "assert callable(isetcl.render) and isetcl.plan is not None"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_kernels_never_call_what_stops_vectorisation_or_loses_precision():
    for path in (PACKAGE / "kernels").rglob("*.cl"):
        code = "\n".join(
            line
            for line in path.read_text().splitlines()
            if not line.lstrip().startswith(("*", "/*"))
        )
        calls = re.findall(r"\b(native_\w+|half_\w+|mad|vload\d*|vstore\d*)\s*\(", code)
        assert calls == [], f"{path.name} calls {calls}"


def test_every_file_of_the_package_is_installed(monkeypatch):
    import runpy
    from types import SimpleNamespace

    found = {}
    stand_in = SimpleNamespace(
        setup=lambda **options: found.update(options), find_packages=lambda **_: []
    )
    monkeypatch.setitem(sys.modules, "setuptools", stand_in)
    runpy.run_path(str(PACKAGE.parent / "setup.py"))
    installed = set()
    for name, patterns in found["package_data"].items():
        folder = PACKAGE.parent.joinpath(*name.split("."))
        installed |= {path for pattern in patterns for path in folder.glob(pattern)}
    others = {p for p in PACKAGE.rglob("*") if p.suffix not in (".py", ".pyc") and p.is_file()}
    assert others
    assert others <= installed

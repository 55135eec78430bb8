"""Fixtures that many tests share."""

import gc
import os
import signal
import sys
from pathlib import Path

import matplotlib
import pytest

matplotlib.use("Agg")
sys.path.insert(0, str(Path(__file__).parent))

# A terminal's width must not change what tests see of the command line.
os.environ.setdefault("COLUMNS", "100")
# What a test finds must not be left over from another run.
os.environ["ISETCL_PSF_CACHE"] = "off"
# Shells start jobs in the background with Ctrl-C ignored; the tests press it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def device():
    from isetcl.device.choose import find_device

    return find_device()


@pytest.fixture(params=["single", "double"])
def precision(request):
    return request.param


@pytest.fixture
def one_register(monkeypatch, device):
    """Rays side by side in one vector of the hardware instead of four: kernels are built sooner.

    That the number of lanes changes no bit is tested in test_trace_rays.py and test_direct.py.
    """
    from isetcl.device.devices import Device

    width = Device.vector_width
    monkeypatch.setattr(
        Device, "vector_width", lambda self, precision: max(1, width(self, precision) // 4)
    )


@pytest.fixture
def few_lanes(monkeypatch):
    """Fewer paths side by side: kernels are built in two thirds of the time."""
    import importlib

    config = importlib.import_module("isetcl.render.kernel_config")
    monkeypatch.setattr(config, "PATH_LANES", {"single": 4, "double": 4})


@pytest.fixture
def shared_kernels(monkeypatch, request):
    """Paths are followed by kernels that know all that scenes can have, so that scenes share them.

    Building a kernel takes longer than most tests, and less with fewer lanes; that what is compiled
    in without need changes nothing, nor the lanes, is tested in test_path_kernels.py. Tests
    marked `own_kernels` have those of their plan.
    """
    import importlib

    if request.node.get_closest_marker("own_kernels"):
        return
    request.getfixturevalue("few_lanes")
    plan = importlib.import_module("isetcl.render.plan")
    decide = plan.decide_features

    def generous(scene, notes):
        features = decide(scene, notes)
        everything = {name: True for name in features if name.startswith("has_")}
        return features | everything | {"combined_depth": max(3, features["combined_depth"])}

    monkeypatch.setattr(plan, "decide_features", generous)


DOUBLE_IS_SLOW = {
    "test_cutouts",
    "test_direct",
    "test_gradients",
    "test_instances",
    "test_lamps",
    "test_glare",
    "test_lights",
    "test_materials",
    "test_paths",
    "test_pinhole",
    "test_render",
    "test_surfaces_rendered",
    "test_textures_on_paths",
}
"""Images in double precision come from the same sources with another type, and building the kernels
takes most of the time. Rays, functions of kernels and surfaces are tested in both every time."""


@pytest.hookimpl(wrapper=True)
def pytest_collection(session):
    """Collect without looking for garbage: what is made lives on, and looking takes a third."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    for item in items:
        parameters = item.callspec.params if hasattr(item, "callspec") else {}
        if item.path.stem in DOUBLE_IS_SLOW and parameters.get("precision") == "double":
            item.add_marker(pytest.mark.slow)

"""Fixtures that many tests share."""

import os
import sys
from pathlib import Path

import matplotlib
import pytest

matplotlib.use("Agg")
sys.path.insert(0, str(Path(__file__).parent))

# A terminal's width must not change what tests see of the command line.
os.environ.setdefault("COLUMNS", "100")


@pytest.fixture(scope="session")
def device():
    from isetcl.device.choose import find_device

    return find_device()


@pytest.fixture(params=["single", "double"])
def precision(request):
    return request.param

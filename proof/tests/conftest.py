"""The truth generator for tests."""

import sys
from importlib import import_module

import pytest

from origami_proof import battery

MODULES = ("beam", "coupon", "draw", "feet", "laws", "objects", "recorder", "rigid", "rivals", "strata", "world")


@pytest.fixture
def truth(monkeypatch):
    """The modules of the truth generator, which are scripts beside each other."""
    pytest.importorskip("mujoco", reason="the truth of the proof needs MuJoCo: pip install -e proof")
    monkeypatch.syspath_prepend(str(battery.generator().parent))
    yield {name: import_module(name) for name in MODULES}
    for name in MODULES:
        sys.modules.pop(name, None)

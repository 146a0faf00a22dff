"""What every scene states for the diagnosis and for sidecars: names of creases, and the natural curvature of beams."""

from dataclasses import replace

import numpy as np
import pytest

from origami_sim import Drive, equilibrium
from origami_sim.device.scene import NAMES, scene_module, scene_settings


@pytest.mark.parametrize("name", NAMES)
def test_every_crease_of_a_scene_has_a_name(name):
    module = scene_module(name)
    model = module.build(scene_settings(module))[0]
    assert len(model.names.get("crease", ())) == len(model.creases)
    assert all(label.strip() for label in model.names.get("crease", ()))


def unloaded(name: str, **values):
    """Model and parameters of a beam without weight, and its length."""
    module = scene_module(name)
    settings = scene_settings(module).replace(**values)
    return *module.build(settings)[:2], settings


@pytest.mark.parametrize(
    "name, values",
    [
        ("mae_cantilever", {"gravity": 0.0}),
        ("de_bender", {"orientation": "weightless", "section": "linear"}),
        ("de_bender", {"orientation": "weightless", "section": "ogden"}),
    ],
)
def test_a_beam_without_a_load_is_as_curved_as_was_stated(name, values):
    """A circle of radius 1 / curvature: the tip of length L is (1 - cos kL) / k above the root."""
    curvature = 12.0
    model, parameters, s = unloaded(name, natural_curvature=curvature, **values)
    found = equilibrium(model, parameters, Drive())
    assert found.converged
    tip = found.x[np.argmax(model.position[:, 0])] - [0.0, 0.0, model.position[0, 2]]
    turn = curvature * s.length
    exact = np.array([np.sin(turn), 1 - np.cos(turn)]) / curvature
    np.testing.assert_allclose(tip[[0, 2]], exact, atol=3e-3 * s.length)


def test_an_arch_let_go_at_one_end_has_its_natural_curvature():
    module, curvature = scene_module("magnetic_arch"), 3.0
    s = scene_settings(module).replace(natural_curvature=curvature, cells=10.0, rows=2.0)
    model, parameters, _ = module.build(s)
    free = np.where(model.position[:, :1] > s.length / 2, 1.0, model.free)
    found = equilibrium(replace(model, free=free), parameters, Drive())
    assert found.converged
    turn = curvature * model.position[:, 0].max()
    tip = found.x[np.argmax(model.position[:, 0])]
    exact = np.array([np.sin(turn), 1 - np.cos(turn)]) / curvature
    np.testing.assert_allclose(tip[[0, 2]], exact, atol=3e-3 * s.length)

"""Every scene that is simulated in reasonable time, recorded as it is and diagnosed: nothing may be claimed."""

import numpy as np
import pytest

from origami_sim.device.scene import scene_module, scene_settings
from origami_sim.diagnose import diagnose
from origami_sim.recording import Channel, Recording
from origami_sim.solve.motion.dynamics import simulate

SUSPECTS = ("mass_damping", "length_scale", "angle_scale", "crease_friction", "gravity_tilt", "gravity")

ANGLE, LENGTH = 2e-3, 1e-4
"""Noise of a fold angle [rad] and of a marker [m]."""


def recorded(scene: str, seconds: float = 1.0) -> Recording:
    """A second of a scene: the angles of up to four creases, else four markers."""
    model, parameters, drive = scene_module(scene).build(scene_settings(scene_module(scene)))[:3]
    made = simulate(model, parameters, drive, duration=seconds, rate=100)
    assert not made.failures
    rng, channels = np.random.default_rng(0), {}
    if 0 < len(model.creases) <= 4:
        for c in range(len(model.creases)):
            values = made.creases[:, c, 0] + ANGLE * rng.normal(size=len(made.times))
            channels[f"fold{c}"] = Channel(f"fold{c}", "crease_angle", values, "rad", ANGLE, {"crease": c})
    else:
        free = np.flatnonzero(model.free.any(1))
        for n in free[np.linspace(0, len(free) - 1, 4).astype(int)]:
            values = made.x[:, n, 0] + LENGTH * rng.normal(size=(len(made.times), 3))
            channels[f"node{n}"] = Channel(f"node{n}", "marker", values, "m", LENGTH, {"node": int(n)})
    return Recording("second", made.times, channels)


@pytest.mark.slow
@pytest.mark.parametrize(
    "scene",
    ["box", "crease_coupon", "de_bender", "de_fold", "fold_file", "mae_crease", "pendulum_chain"],
)
def test_nothing_is_claimed_of_a_scene_as_it_is(scene):
    found = diagnose(scene_module(scene), [recorded(scene)], catalogue=SUSPECTS)
    assert found.verdict in ("ADEQUATE", "PARAMETER") or (found.verdict == "TIE" and "nominal" in found.chosen)
    assert max(np.array(found.error_refitted) / found.noise) < 1.3

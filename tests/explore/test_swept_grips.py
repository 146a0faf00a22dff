"""Sweeps and gradients over what moves a grip."""

import numpy as np
from solve.test_grips import chain

from origami_sim import Drive, ramp, simulate
from origami_sim.explore import Way, find, gradient


def build(travel=1e-3, stiffness=2e-4, smooth=True):
    """A folded chain between two grips, of which one moves."""
    model, parameters = chain("elastic")
    parameters.set("crease", "stiffness", stiffness)
    return model, parameters, Drive(grips={"left": ramp(travel, 0.05, smooth=smooth)})


def pull(found):
    """Force of the grip that moves [N], of what is at rest."""
    return float(found.reactions()[found.model.grips == 0, 0].sum())


def test_worlds_of_a_sweep_follow_their_own_paths():
    travels = (2e-4, 5e-4, 5e-4)
    found = find(build, [{"travel": t, "stiffness": k} for t, k in zip(travels, (2e-4, 2e-4, 4e-4), strict=True)],
                 way=Way(duration=0.06, rate=200))  # fmt: skip
    for one, t in zip(found, travels, strict=True):
        assert not one.failure and one.motion is not None
        np.testing.assert_allclose(one.motion.grip_path("left")[-1, 0], t, rtol=1e-12)
    alone = simulate(*build(5e-4), duration=0.06, rate=200)
    np.testing.assert_allclose(found[1].motion.grip_load("left"), alone.grip_load("left"), atol=1e-6)


def test_force_in_a_grip_has_the_gradient_of_devices_built_anew():
    point = {"travel": 1e-3, "stiffness": 2e-4}
    slope = gradient(build, pull, point).slope[0]
    for k, name in enumerate(point):
        h = 1e-3 * point[name]
        ends = [pull(f) for f in find(build, [{**point, name: point[name] + s * h} for s in (1, -1)])]
        np.testing.assert_allclose(slope[k], (ends[0] - ends[1]) / (2 * h), rtol=1e-4)

"""Starts from a bent shape, and the names of fold angles."""

import numpy as np
import pytest

from origami_sim import InputError, Sheet, State, equilibrium, simulate, strip
from origami_sim.pattern import grid


def test_a_state_is_folded_by_angles_of_its_creases():
    built = Sheet(strip([0.01, 0.02, 0.02], 0.02), thickness="1 mm", panels="rigid").name("crease", ["hip", "knee"])
    model, parameters = built.crease(stiffness="2 mN m/rad").fix(panels=[0]).build()
    state = State.folded(model, {"hip": "30 deg", 1: -0.2}, worlds=2)
    assert state.angles[:2] == pytest.approx(np.array([[np.pi / 6] * 2, [-0.2] * 2])) and state.worlds == 2
    held = np.all(model.free == 0, axis=1)
    assert np.array_equal(state.x[held, 0], model.position[held])
    motion = simulate(model, parameters, duration=0.01, state=State.folded(model, {"knee": 0.3}))
    assert motion.creases[0, :, 0] == pytest.approx([0.0, 0.3], abs=1e-12)
    for angles, said in (
        ({"ankle": 0.1}, r"no such crease.*'ankle'.*hip, knee"),
        ({"hip": "3 mm"}, r"wrong unit.*angles\.hip"),
        ({"hip": 4.0}, r"beyond half a turn.*angles\.hip.*4\.0"),
    ):
        with pytest.raises(InputError, match=said):
            State.folded(model, angles)
    loop = Sheet(grid(2, 2, "20 mm", "20 mm"), thickness="1 mm").crease(stiffness=1e-3).fix(panels=[0]).build()[0]
    with pytest.raises(InputError, match="close loops have no free angles"):
        State.folded(loop, {0: 0.1})


@pytest.mark.parametrize("panels", ["rigid", "elastic"])
def test_motions_and_equilibria_name_fold_angles_alike(panels):
    sheet = Sheet(strip([0.01, 0.02], 0.02), thickness="1 mm", panels=panels).crease(stiffness=2e-3, rest_angle=0.4)
    model, parameters = sheet.fix(panels=[0]).build()
    found = equilibrium(model, parameters)
    assert found.creases == pytest.approx([0.4]) and np.array_equal(found.creases, found.angles[:1])
    motion = simulate(model, parameters, duration=0.01, state=found.state)
    assert motion.creases[-1, :, 0] == pytest.approx(found.creases, abs=1e-6)

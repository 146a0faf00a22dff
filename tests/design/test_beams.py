"""Strips that stand for plane beams: what crossing their cells keeps, and what it mends."""

import numpy as np

from origami_sim import Drive, Sheet, State, strip
from origami_sim.design.beams import as_beam, crossed
from origami_sim.solve.batch import Batch


def sheet():
    widths = [0.014, 0.012, 0.011, 0.009]
    return Sheet(strip([0.003] * 3, widths), thickness=1e-3, triangulation="diagonal", membrane_damping=0.05).crease(
        stiffness=1e-3
    )


def test_both_diagonals_have_half_of_the_stiffness_and_the_loss():
    before, p = sheet().build()
    after, q = crossed(before, p)
    assert len(after.bars) == len(before.bars) + 3
    for name in ("stiffness", "viscosity"):
        owner = "bars" if name == "stiffness" else "bar_viscosity"
        assert np.isclose(q[owner, name].sum(), p[owner, name].sum())
    lengths = np.linalg.norm(np.diff(after.position[after.bars], axis=1)[:, 0], axis=1)
    np.testing.assert_allclose(q["bars", "rest_length"][:, 0], lengths, rtol=1e-12)
    assert {tuple(sorted(b)) for b in after.bars.tolist()} == {tuple(sorted(b)) for b in (after.bars ^ 1).tolist()}


def test_a_strip_that_is_pressed_is_pressed_alike_on_either_side():
    """One diagonal alone pushes the corners of a station by unlike forces."""
    model, parameters = sheet().build()
    as_beam(model, parameters, 20.0)
    forces = []
    for m, p in ((model, parameters), crossed(model, parameters)):
        state = State.at_rest(m)
        state.x[:, :, 0] *= 0.999
        f = Batch(m, p, Drive(), state).evaluate(0.0).forces["bars"][:, 0].reshape(-1, 2, 3)
        forces.append(np.abs(f[:, 0, 0] - f[:, 1, 0]).max() / np.abs(f[..., 0]).max())
    assert forces[0] > 0.01 and forces[1] < 1e-12

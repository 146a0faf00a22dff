"""What every effect has to satisfy on rigid panels; a new effect file is tested without being named here."""

from dataclasses import replace

import numpy as np
import pytest
from effects.kit import make_model, quiet, start
from effects.test_catalogue import NOW, give, responsible, the_drive

from origami_sim.effects import CATALOGUE, CONTACTS, DISTORTIONS, SHELLS
from origami_sim.model import node_mass
from origami_sim.model.articulation import Articulation
from origami_sim.solve.batch import Batch
from origami_sim.solve.motion.dynamics import simulate
from origami_sim.solve.rigid.batch import RigidBatch

ALL = tuple(n for n, e in CATALOGUE.items() if e.family not in (*DISTORTIONS, *SHELLS, "bar", "bend"))
FOLDS = (np.array([0.7, -0.5]), np.array([2.9, -2.8]))
"""Fold angles [rad]; in the second, laws act that wait for a crease to close."""

HOVERS = {"squeeze_film": 1e-3}
"""Height of the lowest contact point above the ground [m] where a law does not act on what has come to the ground."""


def the_model():
    """Three square panels in a row, the first one held, two triangles each, contact points under the last."""
    x = np.array([[i, j, 0.0] for i in range(4) for j in (0.0, 1.0)])
    triangles = [t for p in range(0, 6, 2) for t in ((p, p + 2, p + 3), (p, p + 3, p + 1))]
    free = np.ones_like(x)
    free[:4] = 0.0
    model = make_model(
        x,
        creases=[(p + 3, p, p + 1, p - 2) for p in (2, 4)],
        triangles=triangles,
        contacts=[triangles[-1], triangles[-2]],
        weights=[[1 / 3, 1 / 3, 1 / 3], [0.2, 0.3, 0.5]],
        offsets=[-0.05, 0.02],
        axes=[[-1.0, 1, 0]] * 2,
        free=free,
        effects=ALL,
        electrodes=np.array([0, 1]),
    )
    return replace(model, triangle_panel=np.array([0, 0, 1, 1, 2, 2]), panels="rigid")


def setting(name, folds):
    """Model, parameters with this effect alone, a folded state that moves, its Jacobian [2, N, 3] and the bias (2,)."""
    touching = CATALOGUE[name].family in CONTACTS
    rates = np.array([1.3, -0.8]) * (1e-3 if touching else 1.0)  # a layer of micrometres is soon crossed
    rng = np.random.default_rng(sum(map(ord, name)))
    model = the_model()
    parameters = quiet(model)
    give(parameters, model, name, rng)
    mass = rng.uniform(0.5, 1.5, len(model.position))
    parameters.set("inertia", "mass", mass)
    mass = node_mass(model, parameters)[:, 0]
    arm = Articulation(model)
    rest = arm.reference().angles[:, 0]

    def at(angles):
        return arm.positions(replace(arm.reference(), angles=(rest + angles)[:, None]))[:, 0]

    x = at(folds)
    pose = replace(arm.reference(), angles=(rest + folds)[:, None])
    by = arm.jacobian(pose)[:, :, 0]
    state = start(model, x=x, v=np.einsum("mna,m->na", by, rates))
    state.memory[:] = 1e-4 * rng.normal(size=state.memory.shape) * touching
    h = 1e-4 / np.abs(rates).max()
    swing = (at(folds + h * rates) - 2 * x + at(folds - h * rates)) / h**2
    if touching:
        parameters.set("plane", "reach", 1.0)
        gaps = Batch(model, parameters, the_drive(), state).evaluate(0.0).gaps
        parameters.set("plane", "height", float(gaps.min() + 1e-5 - HOVERS.get(name, 0.0)))
        if CATALOGUE[name].family != "contact":
            parameters.set("ground", "stiffness", 700.0).set("friction", "stiffness", 300.0)
            parameters.set("coulomb", "friction_coefficient", 0.5)
    inertia = np.einsum("mna,n,kna->mk", by, mass, by)
    return model, parameters, state, by, inertia, np.einsum("mna,n,na->m", by, mass, swing)


@pytest.mark.parametrize("name", ALL)
def test_accelerations_are_those_of_the_same_forces(name):
    """M q'' = J^T f - bias, with the forces that the effects report and a Jacobian in NumPy."""
    drive, largest = the_drive(gradient=np.diag([0.3, 0.2, -0.5]) if name == "field_gradient" else None), 0.0
    for folds in FOLDS:
        model, parameters, state, by, inertia, bias = setting(name, folds)
        state.step = round(NOW / 1e-3)
        batch = RigidBatch(model, parameters, drive, state)
        batch.advance(0, 1e-3, np.inf)
        tree = batch._tree
        found = tree.data.numpy()[tree.du : tree.du + 2]
        f = Batch(model, parameters, drive, state).evaluate(NOW).forces
        total = sum(f.values())[:, 0]
        expected = np.linalg.solve(inertia, np.einsum("mna,na->m", by, total) - bias)
        largest = max(largest, np.abs(f[responsible(name)]).max())
        assert found == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.abs(expected).max() + 1e-9)
    assert largest > 0 or CATALOGUE[name].memory, "the comparison is empty"


@pytest.mark.parametrize("name", ALL)
def test_energy_and_work_are_kept(name):
    """Energy less the work that was fed in stays, for effects that store, lose or feed it."""
    model, parameters, state, *_ = setting(name, FOLDS[0])
    motion = simulate(model, parameters, the_drive(), duration=0.02, rate=200.0, state=state, tolerance=1e-11)
    assert not motion.failures
    scale = max(np.abs(e).max() for e in motion.energies.values())
    assert np.ptp(motion.energy_balance()) < 2e-6 * scale

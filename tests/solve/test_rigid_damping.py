"""Rigid panels whose steps are implicit in damping, against independent solutions and against explicit steps."""

import numpy as np
import pytest
from effects.kit import slope
from scipy.integrate import solve_ivp
from solve.test_rigid import double_pendulum, folded, hanging

from origami_sim import Drive, Sheet, simulate, strip, waterbomb
from origami_sim.model import State
from origami_sim.model.articulation import Articulation
from origami_sim.solve.rigid.batch import RigidBatch
from origami_sim.solve.rigid.damping import overdamped
from origami_sim.solve.rigid.tableaus import additive
from origami_sim.solve.rigid.topology import Topology


def damped(viscosity):
    return hanging().set("crease_viscosity", viscosity=np.array(viscosity)).build()


def slow(monkeypatch):
    """Lagrange's equations by an implicit method of SciPy's."""

    def by_radau(f, span, y, _, times, **options):
        return solve_ivp(f, span, y, "Radau", times, rtol=1e-12, atol=1e-13)

    monkeypatch.setattr("solve.test_rigid.solve_ivp", by_radau)


def test_weights_are_those_of_a_consistent_method_of_order_five():
    table, more = additive()
    times, explicit = table[:8, 0], table[:8, 1:9]
    implicit = explicit + np.tril(more[:8, :8], -1) + np.diag(np.diag(more)[:8])
    weights, error = table[8, 1:9], table[9, 1:9]
    for a in (explicit, implicit):
        assert np.allclose(a.sum(axis=1), times, atol=1e-12)
        for power in range(5):
            assert weights @ times**power == pytest.approx(1 / (power + 1), abs=1e-12)
        assert weights @ a @ times == pytest.approx(1 / 6, abs=1e-12)
        assert weights @ a @ a @ times == pytest.approx(1 / 24, abs=1e-12)
        assert weights @ a @ a @ a @ times == pytest.approx(1 / 120, abs=1e-12)
    assert [abs(error @ times**power) < 1e-12 for power in range(5)] == [True, True, True, True, False]
    assert np.allclose(implicit[-1], weights, atol=1e-15)  # stiffly accurate: what is fast decays


def test_steps_that_are_implicit_in_damping_are_of_order_five():
    model, parameters = damped([2e-4, 1e-4])
    state = folded(model, [1.2, 0.7])
    expected = double_pendulum(model, parameters, [1.2, 0.7], np.array([0.0, 1.0]), (2e-4, 1e-4))[-1]
    steps = np.array([0.0025, 0.00125, 0.000625])
    errors = []
    for dt in steps:
        batch = RigidBatch(model, parameters, Drive(), state, tolerance=0.0, implicit=True)
        batch.advance(round(1.0 / dt), dt, np.inf)
        errors.append(np.abs(batch.state().angles[:, 0] - expected).max())
    assert slope(steps, errors) > 4.8  # more, as the joints' damping of an earlier step counts less and less
    assert errors[-1] < 2e-11


def test_an_overdamped_chain_creeps_as_lagranges_equations_say(monkeypatch):
    """Decay rates of up to 6e4/s, over steps of up to 10 ms."""
    slow(monkeypatch)
    model, parameters = damped([5.0, 3.0])
    assert overdamped(model, parameters, Topology(model), 0.01)
    run = simulate(model, parameters, duration=1.0, rate=100.0, state=folded(model, [1.2, 0.7]))
    expected = double_pendulum(model, parameters, [1.2, 0.7], run.times, (5.0, 3.0))
    assert np.abs(run.creases[1:, :, 0] - expected[1:]).max() < 5e-11
    batch = RigidBatch(model, parameters, Drive(), folded(model, [1.2, 0.7]), tolerance=0.0, implicit=True)
    batch.advance(100, 0.01, np.inf)  # given steps, 190 times longer than explicit ones may be
    assert np.abs(batch.state().angles[:, 0] - expected[-1]).max() < 1e-9


def strip_of_cells(cells: int):
    """A strip of magnetic elastomer as a chain of rigid cells, in a field across it."""
    length, bending = 0.04 / cells, 1e6 * 0.008 * 1e-9 / 12.0
    sheet = Sheet(strip([length] * (cells + 1), 0.008), thickness=1e-3, density=2000.0, panels="rigid").fix(panels=[0])
    sheet.crease(stiffness=bending / length, loss_time=5e-3)
    for panel in range(1, cells + 1):
        sheet.magnetise(panel, remanence=0.05, volume=length * 8e-6, poling=(1.0, 0.0, 0.0))
    return sheet.build()


def test_stiffness_of_joints_does_not_bound_steps_of_a_damped_chain():
    """Its stiffest mode decays at 2e5/s, and bounded steps at 0.6 ms while only damping was implicit."""
    model, parameters = strip_of_cells(12)
    drive, state = Drive(field=(0.0, 0.0, 5e-3)), State.at_rest(model)
    found = []
    for tolerance in (1e-10, 1e-4):
        batch = RigidBatch(model, parameters, drive, state, tolerance=tolerance, implicit=True)
        batch.advance(1, 4e-3, np.inf)
        found.append(batch.film(50, 1, 4e-3, np.inf)[1][:, :12])
    span = batch._tree.data.numpy()[batch._tree.span]
    assert span > 4e-3  # whole frames
    assert np.abs(found[1] - found[0]).max() < 2e-5


def test_steps_are_implicit_only_where_viscosity_would_bound_them():
    mild, parameters = damped([2e-4, 1e-4])
    assert not overdamped(mild, parameters, Topology(mild), 0.01)
    strong, parameters = damped([5.0, 3.0])
    assert not overdamped(strong, parameters, Topology(strong), 1e-6)
    loops, parameters = (
        Sheet(waterbomb(0.04), thickness=1e-3, panels="rigid").set("crease_viscosity", viscosity=1.0).build()
    )
    assert not overdamped(loops, parameters, Topology(loops), 1.0)


def walker(viscosity: float):
    """Two plates between walls on four feet, with a hinge that is folded up when they are let go."""
    pattern = strip([0.02, 0.02], 0.02)
    sheet = Sheet(pattern, thickness=1.5e-3, density=2200.0, modulus=1.5e6, panels="rigid", triangulation="diagonal")
    sheet.fix(nodes=range(len(pattern.vertices)), axes="y")
    sheet.crease([0], stiffness=5e-3).set("crease_viscosity", viscosity=viscosity).gravity()
    x = np.array(pattern.vertices)
    for panel, far in ((0, x[:, 0].min()), (1, x[:, 0].max())):
        for y in np.unique(x[:, 1]):
            at = sheet.contact(panel, (far, y, 0.0), offset=-1e-3)
            sheet.set("coulomb", [at], friction_coefficient=0.4)
            sheet.set("ground", [at], stiffness=1300.0, damping=0.2)
            sheet.set("friction", [at], stiffness=500.0, damping=0.1)
    return sheet.build()


def test_a_device_between_walls_moves_in_a_plane():
    model, _ = walker(1e-3)
    arm = Articulation(model)
    assert arm.names()[:3] == ["shift x", "shift z", "turn y"]
    pose = arm.moved(arm.reference(), np.array([[0.01], [0.02], [2.0], [0.5]]))
    x = arm.positions(pose)
    assert np.allclose(x[:, 0, 1], model.position[:, 1], atol=1e-12)
    by = np.array([[1e-3], [-2e-3], [0.4], [-0.3]])
    assert np.allclose(arm.shift_between(pose, arm.moved(pose, by)), by, atol=1e-12)
    assert len(Topology(model).turns) == 3


def test_feet_hold_and_slide_the_same_with_implicit_steps():
    """A fold that opens on rough ground, overdamped: where each node ends by both kinds of steps."""
    model, parameters = walker(1e-3)
    assert overdamped(model, parameters, Topology(model), 0.01)
    arm = Articulation(model)
    pose = arm.moved(arm.reference(), np.array([[0.0], [0.0], [0.0], [0.08]]))
    state = State.at_rest(model, 1, position=arm.positions(pose), placed=True)
    ends = []
    for implicit in (False, True):
        batch = RigidBatch(model, parameters, Drive(), state, tolerance=1e-13, implicit=implicit)
        batch.advance(40, 0.01, np.inf)
        assert batch.status()[0] < 0
        ends.append(batch.state().x[:, 0])
    moved = np.abs(ends[0] - state.x[:, 0]).max()
    assert moved > 1e-3
    # where feet stop is the sum of many small slips: explicit steps of 1e-12 end 0.7 um from those of 1e-13
    assert np.abs(ends[1] - ends[0]).max() < 3e-4 * moved


def test_the_gpu_follows_the_cpu(cuda):
    model, parameters = damped([5.0, 3.0])
    chain = model, parameters, folded(model, [1.2, 0.7], worlds=3), 1e-9, 1e-7
    model, parameters = walker(1e-3)
    pose = Articulation(model).moved(Articulation(model).reference(), np.array([[0.0], [0.0], [0.0], [0.08]]))
    stands = State.at_rest(model, 1, position=Articulation(model).positions(pose), placed=True)
    feet = model, parameters, stands, 1e-10, 5e-7
    for model, parameters, state, tolerance, apart in (chain, feet):
        ends = []
        for device in ("cpu", cuda):
            batch = RigidBatch(model, parameters, Drive(), state, tolerance=tolerance, implicit=True, device=device)
            batch.advance(40, 0.01, np.inf)
            ends.append(batch.state().x)
        assert np.abs(ends[0] - ends[1]).max() < apart  # feet slip by 1 mm; other steps end as far apart

"""When a mismatch sets in: in swings of a strip in which something changes, and on a curve."""

import numpy as np
import pytest

from origami_sim.diagnose import Options
from origami_sim.diagnose.arrange import arranged
from origami_sim.diagnose.prepare import prepared
from origami_sim.drive import Drive
from origami_sim.fit.nominal import nominal_fits
from origami_sim.locate.onset import onset
from origami_sim.model import State
from origami_sim.model.articulation import Articulation
from origami_sim.recording import Channel, Recording
from origami_sim.solve.motion.dynamics import simulate
from tests.diagnose.strips import hanging, record, subject

SMALL = {"duration": 4.0, "panels": 3, "rate": 100}


def sudden(t0: float, change=None, kick=None, seed: int = 0, noise: float = 2e-3) -> Recording:
    """A swing in which a parameter is multiplied at t0, or all free nodes get a velocity, by two simulations."""
    model, parameters = hanging(3)
    arm, rng = Articulation(model), np.random.default_rng(seed)
    start = np.array([0.9, -0.7])[:, None] * (1 + 0.1 * rng.normal(size=(2, 1)))
    state = State.at_rest(model, position=arm.positions(arm.moved(arm.reference(), start))[:, 0])
    before = simulate(model, parameters, Drive(), duration=t0, rate=100, state=state)
    after, state = parameters.copy(), before.state.copy()
    for (owner, name), (by, entity) in (change or {}).items():
        values = after[owner, name].copy()
        values[entity] *= by
        after.set(owner, name, values)
    if kick is not None:
        state.v[:] += (model.free[:, None] > 0) * np.array(kick)
    rest = simulate(model, after, Drive(), duration=4.0 - t0, rate=100, state=state)
    folds = np.concatenate([before.creases[:, :2, 0], rest.creases[1:, :2, 0]])
    folds = folds + noise * rng.normal(size=folds.shape)
    channels = {
        f"fold{c}": Channel(f"fold{c}", "crease_angle", folds[:, c], "rad", noise, {"crease": c}) for c in (0, 1)
    }
    return Recording("sudden", 0.01 * np.arange(len(folds)), channels)


def dated(recording: Recording) -> float:
    forward, _ = arranged(subject(3), prepared([recording], 200.0), Options())
    _, base, _ = nominal_fits(forward)
    return onset(forward, base)


SUDDEN = {
    "a crease that loosens": {"change": {("crease", "stiffness"): (0.3, 0)}},
    "a crease that softens": {"change": {("crease", "stiffness"): (0.7, 1)}},
    "a push": {"kick": (0.05, 0.0, 0.0)},
}


@pytest.mark.parametrize("which", [pytest.param("a crease that loosens", marks=pytest.mark.slow), "a push"])
def test_what_sets_in_abruptly_is_dated_to_its_segment(which):
    recording = sudden(2.17, **SUDDEN[which])
    forward, _ = arranged(subject(3), prepared([recording], 200.0), Options())
    length = max(b.times[-1] for b in forward.blocks) + 0.01
    assert 2.17 - length <= dated(recording) <= 2.18


def test_nothing_sets_in_where_nothing_is_missing():
    assert np.isnan(dated(record(factors={("crease", "stiffness"): 1.06}, **SMALL)))


@pytest.mark.slow
def test_onsets_of_many_swings():
    """Median error at most half a segment, nine of ten within one (50 frames)."""
    errors, rng = [], np.random.default_rng(11)
    for seed in range(24):
        t0 = round(float(rng.uniform(0.6, 3.4)), 2)
        found = dated(sudden(t0, seed=seed, **list(SUDDEN.values())[seed % 3]))
        errors.append(100 * abs(found - t0) if np.isfinite(found) else np.inf)
    print("errors in frames", np.round(errors, 1))
    assert np.median(errors) <= 25
    assert np.mean(np.array(errors) <= 51) >= 0.9


@pytest.mark.slow
def test_false_alarms_of_swings():
    """Half of them with a stiffness drawn from its prior: at most one in 40 at an alarm rate of 1 %."""
    alarms = []
    for seed in range(40):
        rng = np.random.default_rng([seed, 7])
        factors = {} if seed % 2 else {("crease", "stiffness"): 1 + 0.05 * rng.normal()}
        found = dated(record(seed=seed, factors=factors, noise=float(rng.choice([1e-3, 3e-3])), **SMALL))
        if np.isfinite(found):
            alarms.append((seed, found))
    assert len(alarms) <= 1, alarms

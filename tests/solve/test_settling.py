"""Equilibria of many worlds, step by step."""

import numpy as np

from origami_sim import Drive, Sheet, strip
from origami_sim.model import State
from origami_sim.solve.statics.settling import SettlingBars, _over, levels, settling


def loaded(factor: float):
    """A strip of six cells whose end sinks under its weight, with creases stiffer by a factor."""
    sheet = Sheet(strip([0.01] * 6, 0.01), thickness=1e-3, density=1200.0, modulus=2e6).fix(panels=[0]).gravity()
    model, parameters = sheet.crease(range(5), stiffness=5e-4 * factor).build()
    return model, parameters


def settled(worlds) -> np.ndarray:
    count = len(worlds)
    drive, state = Drive(), State.at_rest(worlds[0][0], count)
    search = settling(worlds, drive, state, keeping=True)
    out = []
    for _ in range(3):
        level = levels(drive, 0.0, count)
        state, found = search.settle(level, state, state.x, np.ones(count, bool), dt=1.0, time=0.0)
        assert np.all(found)
        out.append(state.x)
    return np.stack(out)


def test_worlds_that_lie_close_together_share_tangents(monkeypatch):
    """Eight worlds that differ by 1e-4, and one that is far away: the same places as each finds alone."""
    factors = [*(1.0 + 1e-4 * np.arange(8)), 0.3]
    worlds = [loaded(f) for f in factors]
    alone = np.concatenate([settled([w]) for w in worlds], axis=2)
    sunk = np.abs(alone[-1] - worlds[0][0].position[:, None]).max(axis=(0, 2))
    assert sunk[:8].min() > 5e-3 and sunk[8] > 1.3 * sunk[0]
    taken, factors_of = [], SettlingBars._factors

    def counted(self, x, wanted):
        taken.append(int(wanted.sum()))
        return factors_of(self, x, wanted)

    monkeypatch.setattr(SettlingBars, "_factors", counted)
    together = settled(worlds)
    assert np.abs(together - alone).max() < 1e-11
    assert sum(taken) < 0.3 * 9 * len(taken)


def test_a_share_of_next_to_nothing_is_no_warning(recwarn):
    """Worlds that have settled move by subnormal numbers; the step that they may take is bounded elsewhere."""
    found = _over(np.ones(3), np.array([0.0, 5e-310, 2.0]))
    assert found.tolist() == [0.0, np.inf, 0.5] and not recwarn.list

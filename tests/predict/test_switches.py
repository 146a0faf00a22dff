"""A field that is switched between two frames: nobody knows when, and nothing is missing for that."""

from dataclasses import replace

import numpy as np
import pytest

from origami_sim import Drive, Sheet, series, simulate, strip
from origami_sim.diagnose import Options, Subject, factor
from origami_sim.diagnose.arrange import arranged
from origami_sim.fit.nominal import nominal_fits
from origami_sim.predict.rigid import FEWEST
from origami_sim.recording import Channel, DriveChannel, Recording
from origami_sim.recording.drives import switched_between

RATE, NOISE, DURATION = 60, 1e-3, 5.0
SWITCHED = np.array([0.507, 1.259, 2.004, 2.76, 3.511, 4.264])
"""Instants at which the field is switched [s]: no frames."""


def flap(loss: float = 4e-6):
    sheet = Sheet(strip([0.01, 0.04], 0.02), thickness=1e-3, material="pdms", triangulation="center", panels="rigid")
    sheet.crease(stiffness=2e-3).set("crease_viscosity", viscosity=loss)
    sheet.magnetise(1, remanence=0.1, volume=7e-7, poling=(1, 0, 0)).fix(panels=[0])
    return sheet.build()


def recorded(rate: int = RATE) -> Recording:
    """The fold under a field of -+ 8 mT along z, logged with every so many frames."""
    levels = 8e-3 * (-1.0) ** np.arange(len(SWITCHED) + 1)
    times = np.sort([0.0, *SWITCHED - 1e-7, *SWITCHED + 1e-7, DURATION + 1.0])
    truth = Drive(field=(0.0, 0.0, series(times, np.repeat(levels, 2))))
    motion = simulate(*flap(), truth, duration=DURATION, rate=RATE)
    fold = motion.creases[:, 0, 0] + NOISE * np.random.default_rng(0).normal(size=len(motion.times))
    log = np.arange(0.0, DURATION + 1.0 / rate, 1.0 / rate)
    field = np.zeros((len(log), 3))
    field[:, 2] = levels[np.searchsorted(SWITCHED, log)]
    drive = DriveChannel("field", field, "T", False, times=log)
    channel = Channel("fold", "crease_angle", fold, "rad", NOISE, {"crease": 0})
    return Recording("r", motion.times, {"fold": channel}, {"field": drive})


def arrange(recording: Recording):
    known = [factor("crease.stiffness", 0.05), factor("crease_viscosity.viscosity", 0.3)]
    return arranged(Subject.from_model(*flap(), None, known), [recording], Options())


def test_segments_begin_anew_after_switches_that_are_logged_with_the_frames(monkeypatch):
    """The fit is then down to the noise; with a ramp from one row to the other it misses 22 times as much."""
    forward, notes = arrange(recorded())
    begins = {b.first for b in forward.blocks}
    after = np.ceil(SWITCHED * RATE).astype(int)
    assert begins >= set(after.tolist()) and any("each of 6 switches" in n for n in notes)
    assert {b.first + len(b.times) for b in forward.blocks if b.reach is None} == {*after.tolist(), 301}
    count = sum(b.seen().sum() for b in forward.blocks)
    _, base, weights = nominal_fits(forward)
    assert count == 301 and weights.deviation[0] == pytest.approx(NOISE, rel=0.05)
    monkeypatch.setattr("origami_sim.predict.rigid.switched_between", lambda recording: [])
    _, other, blurred = nominal_fits(arrange(recorded())[0])
    assert blurred.deviation[0] > 20.0 * weights.deviation[0]
    assert base.theta == pytest.approx([1.0, 1.0], abs=2e-3) and other.theta[1] < 0.91


def test_frames_between_rows_of_a_slow_log_are_not_compared():
    """Rows every 0.2 s: twelve frames, of which those between the rows of a switch may be under either field."""
    recording = recorded(rate=5)
    between = switched_between(recording)
    assert between == [(12 * k, 12 * (k + 1)) for k in np.floor(SWITCHED * 5).astype(int)]
    forward, _ = arrange(recording)
    lost = sum(int(np.isnan(b.values).sum()) for b in forward.blocks)
    assert lost == 11 * len(SWITCHED)


def test_a_fine_log_leaves_segments_tied():
    """Rows of 1 ms tell when to a sixteenth of a frame; and switches in turn leave no room for segments."""
    forward, notes = arrange(recorded(rate=1000))
    assert switched_between(recorded(rate=1000)) == [] and not any("switch" in n for n in notes)
    assert sum(b.reach is None for b in forward.blocks) == 1
    fast = recorded()
    values = np.zeros((len(fast.times), 3))
    values[:, 2] = np.where(np.arange(len(fast.times)) // 5 % 2, 8e-3, -8e-3)
    fast = replace(fast, drive={"field": DriveChannel("field", values, "T", False)})
    lengths = [len(b.times) for b in arrange(fast)[0].blocks]
    assert min(lengths) >= FEWEST

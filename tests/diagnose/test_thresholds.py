"""Thresholds of suspects begin within what was recorded, so that a stop that a swing meets is found."""

import numpy as np
import pytest
from strips import record, subject

from origami_sim.diagnose import Options, diagnose
from origami_sim.diagnose.arrange import arranged
from origami_sim.diagnose.prepare import prepared
from origami_sim.effects import CATALOGUE
from origami_sim.hypotheses.suspects import suspects

SWING = {"duration": 4.0, "panels": 2, "rate": 100}
STOP = 0.45


@pytest.fixture(scope="module")
def stopped():
    """A panel that swings by 0.9 rad to one side and meets a stop at half of that on the other."""
    return record({"crease_contact": {"contact_stiffness": (2e-3, None), "contact_angle": (-STOP, None)}}, **SWING)


def test_stops_and_contacts_begin_within_the_recorded_angles(stopped):
    forward, _ = arranged(subject(2), prepared([stopped], 200.0), Options())
    every = forward.admitted(suspects(forward.model, forward.recordings, forward.drive, forward.parameters))
    angles = stopped.channels["fold1"].values
    starts = {name: [s.free[1].start for s in every if s.effect == name] for name in ("crease_stop", "crease_contact")}
    most = np.abs(angles).max()
    assert starts["crease_stop"] == pytest.approx([0.6 * most, 0.9 * most], rel=0.02)
    sides = [0.6 * angles.max(), 0.9 * angles.max(), 0.6 * angles.min(), 0.9 * angles.min()]
    assert starts["crease_contact"] == pytest.approx(sides, rel=0.02)
    (hysteresis, *_) = (s for s in every if s.effect == "crease_hysteresis")
    assert hysteresis.free[1].start == CATALOGUE["crease_hysteresis"].parameter("yield_angle").typical


def test_a_contact_that_a_swing_meets_is_named_with_its_angle(stopped):
    few = ["crease_contact", "crease_stop", "crease_stiffening", "crease_asymmetry", "air_drag"]
    found = diagnose(subject(2), stopped, Options(threads=1), catalogue=few)
    assert found.verdict == "MECHANISM" and found.chosen == ["crease_contact at crease 0"], found.sentence
    numbers = {n.label: n for n in found.candidates[0].numbers}
    assert numbers["crease_contact.contact_angle"].value == pytest.approx(-STOP, abs=0.02)

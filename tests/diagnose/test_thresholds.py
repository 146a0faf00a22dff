"""Thresholds of suspects begin within what was recorded, so that a stop that a swing meets is found."""

import numpy as np
import pytest
from strips import record, subject

from origami_sim.diagnose import Options, diagnose
from origami_sim.diagnose.arrange import arranged, shortened
from origami_sim.diagnose.prepare import prepared
from origami_sim.effects import CATALOGUE
from origami_sim.fit.least_squares import fit
from origami_sim.fit.nominal import level, nominal_fits
from origami_sim.hypotheses.hypothesis import Hypothesis
from origami_sim.hypotheses.suspects import suspects
from origami_sim.infer.basins import loosened, tightened
from origami_sim.infer.budget import astray
from origami_sim.infer.scan import over_shapes, scanned

SWING = {"duration": 4.0, "panels": 2, "rate": 100}
STOP = 0.45


@pytest.fixture(scope="module")
def stopped():
    """A panel that swings by 0.9 rad to one side and meets a stop at half of that on the other."""
    return record({"crease_contact": {"contact_stiffness": (2e-3, None), "contact_angle": (-STOP, None)}}, **SWING)


def test_stops_contacts_and_yields_begin_within_what_was_recorded(stopped):
    forward, _ = arranged(subject(2), prepared([stopped], 200.0), Options())
    every = forward.admitted(suspects(forward.model, forward.recordings, forward.drive, forward.parameters))
    angles = stopped.channels["fold1"].values
    starts = {name: [s.free[1].start for s in every if s.effect == name] for name in ("crease_stop", "crease_contact")}
    most = np.abs(angles).max()
    assert starts["crease_stop"] == pytest.approx([0.6 * most, 0.9 * most], rel=1e-9)
    sides = [0.6 * angles.max(), 0.9 * angles.max(), 0.6 * angles.min(), 0.9 * angles.min()]
    assert starts["crease_contact"] == pytest.approx(sides, rel=1e-9)
    law = {name: values[0, 0] for name, values in forward.parameters.of("crease").items()}
    moment = law["stiffness"] * np.abs(angles - law["rest_angle"]).max()  # of a crease that does not yield
    yields = [s.free[1].start for s in every if s.effect == "crease_yield"]
    assert yields == pytest.approx([0.2 * moment, 0.5 * moment], rel=1e-9)
    fixed = [s.fixed for s in every if s.effect == "crease_contact"]
    assert fixed == [(("contact_side", side),) for side in (1.0, 1.0, -1.0, -1.0)]
    (hysteresis, *_) = (s for s in every if s.effect == "crease_hysteresis")
    assert hysteresis.free[1].start == CATALOGUE["crease_hysteresis"].parameter("yield_angle").typical


def test_a_contact_that_a_swing_meets_is_named_with_its_angle(stopped):
    few = ["crease_contact", "crease_stop", "crease_stiffening", "crease_asymmetry", "air_drag"]
    found = diagnose(subject(2), stopped, Options(threads=1), catalogue=few)
    assert found.verdict == "MECHANISM" and found.chosen == ["crease_contact at crease 0"], found.sentence
    numbers = {n.label: n for n in found.candidates[0].numbers}
    assert numbers["crease_contact.contact_angle"].value == pytest.approx(-STOP, abs=0.02)


def test_a_stop_short_of_flat_is_named_wherever_flat_is():
    """A lid that cannot close: it is stopped from below, at a fold that is still open."""
    stop = {"contact_stiffness": (2e-3, None), "contact_angle": (0.1, None), "contact_side": (-1.0, None)}
    few = ["crease_contact", "crease_stop", "crease_stiffening", "crease_asymmetry", "air_drag"]
    found = diagnose(subject(2), record({"crease_contact": stop}, **SWING), Options(threads=1), catalogue=few)
    assert found.verdict == "MECHANISM" and found.chosen == ["crease_contact at crease 0"], found.sentence
    numbers = {n.label: n for n in found.candidates[0].numbers}
    assert numbers["crease_contact.contact_side"].value == -1.0
    assert numbers["crease_contact.contact_angle"].value == pytest.approx(0.1, abs=0.01)
    assert [v for label, v in found.patch.items() if label.startswith("crease_contact.contact_side@")] == [-1.0]


def test_a_stop_that_takes_energy_is_named_with_what_it_takes():
    stop = {"contact_stiffness": (2e-2, None), "contact_angle": (-STOP, None), "contact_loss": (0.12, None)}
    few = ["crease_contact", "crease_stop", "crease_stiffening", "crease_asymmetry", "air_drag"]
    found = diagnose(subject(2), record({"crease_contact": stop}, **SWING), Options(threads=1), catalogue=few)
    assert found.verdict == "MECHANISM" and found.chosen == ["crease_contact at crease 0"], found.sentence
    numbers = {n.label: n for n in found.candidates[0].numbers}
    for name, (true, _) in stop.items():
        number = numbers[f"crease_contact.{name}"]
        assert number.low < true < number.high and number.value == pytest.approx(true, rel=0.15)


def test_a_stiff_stop_is_found_from_a_soft_one_that_acts_earlier(stopped):
    """A threshold is tried with strengths of its own: to a late stop belongs a stiff one."""
    forward, _ = arranged(subject(2), prepared([stopped], 200.0), Options())
    _, base, weights = nominal_fits(forward)
    every = forward.admitted(suspects(forward.model, forward.recordings, forward.drive, forward.parameters))
    contact = next(s for s in every if s.effect == "crease_contact" and -STOP < s.free[1].start < 0.0)
    soft = np.concatenate([base.theta, [2e-4, 0.6 * -STOP]])
    f = fit(forward, Hypothesis((contact,)), weights, theta=soft, local=base.local, most=0)
    found = over_shapes(forward, f, weights)
    assert found is not None
    stiffness, angle = found[0][-2:]
    assert angle == pytest.approx(-STOP, abs=0.03) and 1e-3 < stiffness < 1e-2  # from 2e-4, beside other thresholds
    there = fit(forward, Hypothesis((contact,)), weights, theta=found[0], local=base.local)
    assert there.theta[-1] == pytest.approx(-STOP, abs=0.02) and there.cost < f.cost - found[1]


HARD = 0.05


@pytest.fixture(scope="module")
def bounced():
    """A panel that bounces off a stop 250 times as stiff as its crease, within one or two frames."""
    effects = {"crease_contact": {"contact_stiffness": (HARD, None), "contact_angle": (-STOP, None)}}
    return record(effects, **SWING | {"duration": 3.0})


def test_segments_are_short_where_something_acts_within_a_few_frames(bounced):
    for recording, short in ((bounced, True), (record(**SWING), False)):
        forward, _ = arranged(subject(2), prepared([recording], 200.0), Options())
        finer = shortened(forward, nominal_fits(forward)[1], Options())
        assert (finer is not None) == short
        if finer is not None:
            assert (
                finer.abrupt and {len(b.times) for b in finer.blocks[:-1]} == {8} and len(forward.blocks[0].times) > 30
            )
            longest = max(b.lasting for b in forward.blocks)
            for b in finer.blocks[:-1]:  # by chance forces a rate changes as the root of time
                usual = forward.readings.usual_rates(0)  # type: ignore[attr-defined]
                assert b.reach[len(usual) :] == pytest.approx(usual * np.sqrt(b.lasting / longest), rel=1e-12)


def test_a_hard_stop_is_found_with_loose_ties_from_where_a_fit_is_stuck(bounced):
    forward, _ = arranged(subject(2), prepared([bounced], 200.0), Options())
    forward = shortened(forward, nominal_fits(forward)[1], Options())
    assert forward is not None
    _, base, _ = nominal_fits(forward)
    every = forward.admitted(suspects(forward.model, forward.recordings, forward.drive, forward.parameters))
    contact = [s for s in every if s.effect == "crease_contact" and s.fixed[0][1] < 0.0][1]
    by = level(forward, base)
    begin = scanned(forward, Hypothesis((contact,)), by, base.local, None)
    stuck = fit(forward, Hypothesis((contact,)), by, theta=begin, local=base.local)
    assert stuck.theta[-2] < 0.2 * HARD and abs(stuck.theta[-1] + STOP) > 0.05
    loose = loosened(forward, stuck)
    assert not astray(forward, loose)
    found = tightened(forward, loose, stuck)
    assert found.theta[-2] == pytest.approx(HARD, rel=0.05) and found.theta[-1] == pytest.approx(-STOP, abs=1e-3)
    assert np.all(loosened(forward, base).rms() > 2.0 * loose.rms())  # what explains nothing does not so either


def test_a_hard_stop_is_named_with_intervals_that_cover(bounced):
    few = ["crease_contact", "crease_stop", "crease_stiffening", "crease_asymmetry", "air_drag"]
    found = diagnose(subject(2), bounced, Options(threads=1), catalogue=few)
    assert found.verdict == "MECHANISM" and found.chosen == ["crease_contact at crease 0"], found.sentence
    numbers = {n.label: n for n in found.candidates[0].numbers}
    for name, true in (("contact_stiffness", HARD), ("contact_angle", -STOP)):
        number = numbers[f"crease_contact.{name}"]
        assert number.low < true < number.high  # of the stiffness within 44 %
        assert number.value == pytest.approx(true, rel=0.15)

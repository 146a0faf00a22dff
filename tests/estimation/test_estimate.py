"""Estimates of stated numbers and effects: values, intervals, evidence, and what is left behind."""

import json

import numpy as np
import pytest
from diagnose.strips import hanging, record, subject
from diagnose.swings import FRICTION, NOISE, main, swing

from origami_sim import Drive, InputError, State, Subject, estimate, simulate
from origami_sim.device.scene import read_calibration
from origami_sim.diagnose import Options, factor
from origami_sim.model.articulation import Articulation
from origami_sim.recording import Channel, Recording

SMALL = {"panels": 2, "duration": 2.0, "rate": 100, "noise": 1e-3}
ONE_CORE = Options(threads=1)


def test_an_effect_that_is_stated_is_estimated_with_its_interval_and_evidence():
    true = {"crease_friction": {"friction_moment": (2e-5, [0])}}
    swing = record(true, factors={("crease", "stiffness"): 1.06}, **SMALL)
    without = estimate(subject(2), swing, options=ONE_CORE)
    found = estimate(subject(2), swing, ["crease_friction at crease 0"], options=ONE_CORE)
    numbers = {n.label: n for n in found.numbers}
    moment = numbers["crease_friction.friction_moment"]
    assert moment.low < 2e-5 < moment.high and moment.value == pytest.approx(2e-5, rel=0.1)
    # only the ratio of stiffness, weight and moment shows, and the estimate says so
    assert set(found.strongest_correlation()[:2]) <= {"crease.stiffness", "inertia.mass", moment.label}
    ratio = numbers["crease.stiffness"].value / numbers["inertia.mass"].value
    assert ratio == pytest.approx(1.06, abs=0.03)
    assert found.over_noise < 1.1 and without.over_noise > 3.0
    assert max(found.error_held_out) < 0.5 * max(without.error_held_out)
    assert found.log_evidence > 50.0 and without.log_evidence == 0.0


def test_an_effect_that_does_not_act_gains_no_evidence():
    found = estimate(subject(2), record(seed=3, **SMALL), ["crease_friction"], options=ONE_CORE)
    assert found.log_evidence < 1.0, "its further numbers are charged for (Occam)"


def test_intervals_cover_as_often_as_they_say():
    """Simulation-based calibration (Talts et al. 2018): truths from the prior, departures over deviations are normal.

    Of 80 such runs the deviations are 1.05 and 1.00; of longer, less noisy ones in four segments 1.01 and 0.98.
    """
    model, parameters = hanging(2)
    known = [factor("crease.stiffness", 0.2), factor("crease_viscosity.viscosity", 0.3)]
    rng, departures = np.random.default_rng(12), []
    arm = Articulation(model)
    start = State.at_rest(model, position=arm.positions(arm.moved(arm.reference(), np.array([[0.8]])))[:, 0])
    for _ in range(12):
        truth = 1.0 + np.array([0.2, 0.3]) * np.clip(rng.normal(size=2), -2.0, 2.0)
        real = parameters.copy()
        for (owner, name), by in zip((("crease", "stiffness"), ("crease_viscosity", "viscosity")), truth, strict=True):
            real.set(owner, name, parameters[owner, name] * by)
        motion = simulate(model, real, Drive(), duration=1.0, rate=60, state=start)
        read = motion.creases[:, 0, 0] + 2e-2 * rng.normal(size=len(motion.times))
        fold = Channel("fold1", "crease_angle", read, "rad", 2e-2, {"crease": 0})
        given = Subject.from_model(model, parameters, None, known)
        found = estimate(given, Recording("swing", motion.times, {"fold1": fold}), options=ONE_CORE)
        for n, true in zip(found.numbers, truth, strict=True):
            departures.append((n.value - true) / ((n.high - n.low) / 3.92))
    assert 0.6 < np.std(departures) < 1.45, "of 24, 95 % of standard deviations lie within"
    assert abs(np.mean(departures)) < 0.6


@pytest.mark.parametrize(
    ("effects", "said"),
    [
        (["crease_fricton"], "no such effect; 'crease_friction' is near"),
        (["crease_friction at crease 7"], "cannot act there.*crease_friction at crease 0"),
        (["magnetic_viscosity"], "cannot act on this device"),
    ],
)
def test_an_effect_that_cannot_act_is_refused(effects, said):
    with pytest.raises(InputError, match=said):
        estimate(subject(3), record(panels=3, duration=0.5, rate=60), effects, options=ONE_CORE)


def test_nothing_to_fit_is_refused_before_anything_is_computed():
    with pytest.raises(InputError, match=r"nothing is to be fitted.*priors"):
        estimate(hanging(2), record(panels=2, duration=0.5, rate=60))


def test_the_command_leaves_numbers_that_run_takes(tmp_path, capsys):
    recording, out = swing(tmp_path, duration=4.0), tmp_path / "out"
    arguments = ("estimate", recording, "--model", "pendulum_chain", "--effect", "crease_friction@hinge1")
    assert main(*arguments, "--out", out, "--json") == 0
    said = json.loads(capsys.readouterr().out)
    moment = next(n for n in said["numbers"] if n["label"] == "crease_friction.friction_moment")
    assert moment["value"] == pytest.approx(FRICTION, rel=0.05) and said["error_fitted"][0] < 1.2 * NOISE
    assert sorted(p.name for p in out.iterdir()) == ["estimate.json", "fit.png", "fitted.toml"]
    (added,) = read_calibration(out / "fitted.toml").effects
    assert added.effect == "crease_friction" and added.values["friction_moment"] == moment["value"]
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("all of it")
    assert main(*arguments, "--out", tmp_path / "mine") == 2
    assert "other things in it, not an estimate" in capsys.readouterr().err

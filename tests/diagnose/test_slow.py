"""Slow motions with a clock: predictions against integrations of their own, choice of the motion, verdicts."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from slow_motions import DIPOLE, END, NOISE, K, angles, field, flap, recording, times

from origami_sim import Drive, Sheet, strip
from origami_sim.diagnose import Options, Subject, diagnose
from origami_sim.diagnose.arrange import arranged, slowly
from origami_sim.diagnose.inertia import inertia
from origami_sim.errors import InputError
from origami_sim.hypotheses.hypothesis import Hypothesis
from origami_sim.hypotheses.spectra import with_spectra, without_idle
from origami_sim.hypotheses.suspects import suspects
from origami_sim.infer.components import near_zero
from origami_sim.predict.slow import Slow
from origami_sim.recording import Channel, Recording, read_recording
from origami_sim.recording.recording import DriveChannel
from origami_sim.recording.stated import Start

ONE = Options(threads=1)
SOME = ["crease_relaxation", "crease_aging", "crease_stiffening", "crease_offset", "crease_set", "angle_offset"]
"""Effects of which one or another is concealed."""


def suspect(forward, effect: str):
    found = suspects(forward.model, forward.recordings, forward.drives[0], forward.parameters)
    return next(s for s in forward.admitted(found) if s.effect == effect)


def predicted(forward, hypothesis=None, *numbers) -> np.ndarray:
    nominal = [f.start for f in forward.subject.nominals]
    values = forward.predict(hypothesis or Hypothesis(), [np.array([*nominal, *numbers])])
    return np.concatenate([v[0, :, 0] for v in values])


# --- predictions


@pytest.mark.parametrize("panels", ["rigid", ""])
@pytest.mark.parametrize(
    "effect, numbers, truth",
    [
        ("crease_relaxation", (0.5 * K, 30.0), {"branch": 0.5 * K, "time": 30.0}),
        ("crease_aging", (0.05, 4.0), {"drift": 0.05, "onset": 4.0}),
    ],
)
def test_what_remembers_is_followed_along_time(panels, effect, numbers, truth):
    t = times()
    true = angles(t, **truth)
    forward = Slow(flap(), [recording(true)], panels=panels, threads=1)
    close = predicted(forward, Hypothesis((suspect(forward, effect),)), *numbers)
    # the flap's own loss lags, and bars give way, by less than a fifth of the noise
    assert np.abs(close - true).max() < 0.2 * NOISE
    assert np.abs(predicted(forward) - true).max() > 20 * NOISE


def test_losses_of_the_rate_count():
    """A dashpot that needs seconds: the device creeps, in steps that follow the noise."""
    true = angles(times(), viscosity=5.0 * K)
    forward = Slow(flap(), [recording(true)], panels="rigid", threads=1)
    given = forward.parameters["crease_viscosity", "viscosity"].max()
    model = forward.model
    assert given < 1e-3 * 5.0 * K  # the flap's own loss is silent beside it
    viscous = forward.parameters.copy().set("crease_viscosity", "viscosity", 5.0 * K)
    subject = Subject.from_model(model, viscous, forward.drive)
    slow = Slow(subject, [recording(true)], threads=1)
    assert np.abs(predicted(slow) - true).max() < 0.3 * NOISE  # at frames as far apart as the lag is long
    assert np.abs(predicted(forward) - true).max() > 20 * NOISE


def test_all_worlds_at_once_are_as_each_alone():
    forward = Slow(flap(), [recording(angles(times()))], panels="rigid", threads=1)
    s = Hypothesis((suspect(forward, "crease_relaxation"),))
    nominal = [f.start for f in forward.subject.nominals]
    thetas = [np.array([*nominal, b * K, 30.0]) for b in (0.0, 0.1, 0.5)]
    together = np.concatenate([v[..., 0] for v in forward.predict(s, thetas)], axis=1)
    for theta, row in zip(thetas, together, strict=True):
        alone = np.concatenate([v[0, :, 0] for v in forward.predict(s, [theta])])
        assert np.abs(row - alone).max() < 0.1 * NOISE


def hinge_of_a_stack() -> Subject:
    """A panel on a crease of a held one that a dielectric stack folds."""
    sheet = Sheet(strip([0.02, 0.02], 0.02), thickness=1e-3, panels="rigid")
    model, parameters = sheet.fix(panels=[0]).crease(stiffness=2e-3).on("maxwell_stress").build()
    stack = {"permittivity": 4.5, "layer_thickness": 5e-5, "layers": 1.0, "lever": 5e-4, "width": 0.02}
    for name, value in stack.items():
        parameters.set("maxwell_stress", name, value)
    return Subject.from_model(model, parameters, Drive())


def held_voltage(share: float, slow: float, start: Start | None = None) -> Recording:
    """A voltage that comes on at once and stays: the moment creeps up by a share, in closed form."""
    t = np.linspace(0.0, 200.0, 51)
    made = hinge_of_a_stack()
    model, parameters, _ = made.build({})
    from origami_sim import equilibrium

    fast = equilibrium(model, parameters, Drive(voltage=1500.0)).angles[0]
    creep = 1.0 if start else 1.0 - np.exp(-t / slow)
    values = fast * (1.0 + share * creep)
    channel = Channel("fold", "crease_angle", values + np.zeros_like(t), "rad", 1e-5, {"crease": 0})
    return Recording("held", t, {"fold": channel}, {"voltage": DriveChannel("voltage", np.array(1500.0), "V", True)},
                     start=start)  # fmt: skip


@pytest.mark.parametrize("start", [None, Start("equilibrium")])
def test_a_drive_comes_on_at_the_first_frame_unless_the_device_had_rested_in_it(start):
    given = held_voltage(0.1, 40.0, start)
    forward = Slow(hinge_of_a_stack(), [given], threads=1)
    s = suspect(forward, "dielectric_relaxation")
    found = predicted(forward, Hypothesis((s,)), 0.1, 40.0)
    assert np.abs(found - given.channels["fold"].values).max() < 1e-5
    _, notes = arranged(hinge_of_a_stack(), [given], replace(ONE, motion="quasistatic"))
    assert any("begins under a drive" in n for n in notes) == (start is None)


def test_moments_that_are_missing_are_told_along_time():
    """At the recorded angles the branch's moment is missing."""
    t = times()
    true = angles(t, branch=0.5 * K)
    forward = Slow(flap(), [recording(true, noise=1e-6)], panels="rigid", threads=1)
    (found,) = forward.balance(Hypothesis(), np.array([f.start for f in forward.subject.nominals]))
    branch = K * true - DIPOLE * field(t, 0.1) * np.cos(true)
    assert np.abs(found.missing[0] + branch).max() < 1e-3 * np.abs(branch).max() or (
        np.abs(found.missing[0] - branch).max() < 1e-3 * np.abs(branch).max()
    )
    assert set(found.against) == {"field_z", "time"}


def test_a_prony_series_is_one_suspect():
    forward = Slow(flap(), [recording(angles(times()))], panels="rigid", threads=1)
    every = [s for s in suspects(forward.model, forward.recordings, forward.drives[0], forward.parameters)]
    plain = [s for s in every if s.effect == "crease_relaxation"]
    series = [s for s in with_spectra(plain, 1.0, 100.0) if len(s.free) > 2]
    assert {len(s.free) for s in series} == {4, 6}
    for s in series:
        assert [f.name for f in s.strengths] == [f"stiffness_{n + 1}" for n in range(len(s.free) // 2)]
        starts = sorted(f.start for f in s.free if f.name.startswith("time"))
        assert 1.0 < starts[0] < starts[-1] < 100.0
    three = next(s for s in series if len(s.free) == 6)
    numbers = [x for n in range(3) for x in (0.2 * K, (3.0, 30.0, 300.0)[n])]
    one = Hypothesis((three,))
    assert np.abs(predicted(forward, one, *numbers) - predicted(forward)).max() > 10 * NOISE


def test_branches_that_a_fit_leaves_at_nothing_are_left_out():
    forward = Slow(flap(), [recording(angles(times()))], panels="rigid", threads=1)
    once = suspect(forward, "crease_relaxation")
    late = replace(once, free=(once.free[0], replace(once.free[1], start=40.0)))
    every = with_spectra([once, late], 1.0, 100.0)
    three = every[-1]
    assert len(three.free) == 6
    scale = three.free[0].scale
    assert without_idle(three, np.array([0.0, 1.0, scale, 30.0, 1e-9 * scale, 9.0]), every)[0] is late
    shorter, kept = without_idle(three, np.array([scale, 1.0, 0.0, 10.0, 2 * scale, 50.0]), every)
    assert len(shorter.free) == 4 and kept.tolist() == [scale, 1.0, 2 * scale, 50.0]
    begun = tuple(replace(three.free[0], name=f"begun_{n}", recording=0) for n in (1, 2, 3))  # which may be negative
    more = [replace(s, free=(*s.free, *begun[: len(s.free) // 2])) for s in every]
    held = np.array([scale, 1.0, 0.0, 10.0, 2 * scale, 50.0, -1.0, 0.0, -3.0])
    with np.errstate(invalid="raise"):
        shorter, kept = without_idle(more[-1], held, more)
    assert len(shorter.free) == 6 and kept.tolist() == [scale, 1.0, 2 * scale, 50.0, -1.0, -3.0]
    whole = np.array([scale, 1.0, scale, 10.0, scale, 50.0])
    assert without_idle(three, whole, every) == (three, whole)


def test_a_number_on_its_bound_is_told_from_zero_unless_it_is_zero():
    f = SimpleNamespace(theta=np.array([5.0, 0.0, 1.0, 3.0]), deviations=lambda: np.array([0.0, 0.0, 1.0, 1.0]))
    with np.errstate(all="raise"):
        assert near_zero(cast(Any, f), 0.95).tolist() == [False, True, True, False]


# --- which motion


def test_the_motion_is_chosen_by_what_inertia_would_change():
    slow = recording(angles(times()))
    forward, notes = arranged(flap(), [slow], ONE)
    assert isinstance(forward, Slow) and forward.panels == "rigid"
    assert inertia(flap(), [slow]) < 1e-3 and any("quasi-static" in n for n in notes)
    t = np.linspace(0.0, 1.0, 400)
    swing = Channel("fold", "crease_angle", 0.1 * np.cos(60.0 * t), "rad", NOISE, {"crease": 0})
    fast = Recording("swing", t, {"fold": swing})
    assert inertia(flap(), [fast]) > 3.0
    forward, notes = arranged(flap(), [fast], ONE)
    assert not forward.curve
    forward, notes = arranged(flap(), [replace(fast, motion="quasistatic")], ONE)
    assert forward.curve and any("as stated" in n for n in notes)
    assert slowly(flap(), [replace(slow, motion="dynamic")], ONE) is None


def test_a_swing_hidden_between_averaged_frames_is_seen():
    """Many swings within each of the frames that are compared: their means rest, and yet inertia shows."""
    t = np.linspace(0.0, 400.0, 20_001)
    swing = Channel("fold", "crease_angle", 0.1 * np.cos(40.0 * t), "rad", NOISE, {"crease": 0})
    assert inertia(flap(), [Recording("swing", t, {"fold": swing})]) > 1.0


def test_wrong_statements():
    slow = recording(angles(times()), motion="quasistatic")
    with pytest.raises(InputError, match="cannot be diagnosed together"):
        arranged(flap(), [slow, replace(slow, motion="dynamic")], ONE)
    with pytest.raises(InputError, match="begins at rest"):
        arranged(flap(), [replace(slow, start=Start("moving"))], ONE)
    with pytest.raises(InputError, match="no such start"):
        arranged(flap(), [slow], replace(ONE, segment=50.0))


def test_the_sidecar_states_the_motion(tmp_path):
    rows = "\n".join(f"{k},{0.01 * k}" for k in range(20))
    (tmp_path / "a.csv").write_text("t,a\n" + rows + "\n")
    text = '[time]\ncolumn = "t"\n[channels.fold]\ncolumn = "a"\nkind = "crease_angle"\nunit = "rad"\ncrease = 0\n'
    (tmp_path / "a.toml").write_text('motion = "quasistatic"\n' + text)
    assert read_recording(tmp_path / "a.csv").motion == "quasistatic"
    (tmp_path / "a.toml").write_text('motion = "slow"\n' + text)
    with pytest.raises(InputError, match="motion"):
        read_recording(tmp_path / "a.csv")
    (tmp_path / "a.toml").write_text(
        'motion = "dynamic"\n' + text.partition("[channels")[1] + text.partition("[channels")[2]
    )
    with pytest.raises(InputError, match="no clock"):
        read_recording(tmp_path / "a.csv")


# --- verdicts


@pytest.mark.slow
@pytest.mark.parametrize(
    "effect, truth",
    [
        ("crease_relaxation", {"stiffness_1": 0.3 * K, "time_1": 30.0}),
        ("crease_aging", {"drift": 0.03, "onset": 5.0}),
    ],
)
def test_what_was_concealed_is_found(effect, truth):
    numbers = list(truth.values())
    own = {"branch": numbers[0], "time": numbers[1]} if effect == "crease_relaxation" else truth
    made = [
        recording(angles(times(), level, **own), level, seed=n, name=f"hold {level}")
        for n, level in enumerate((0.1, 0.06))
    ]
    found = diagnose(flap(), made, ONE, catalogue=SOME)
    assert found.verdict == "MECHANISM" and found.chosen == [f"{effect} at hinge"], found.sentence
    for n in found.candidates[0].numbers:
        owner, _, name = n.label.partition(".")
        if owner == effect:
            assert n.low <= truth[name] <= n.high, (n.label, n.low, n.high)
    assert found.error_after[0] < 1.1 * NOISE


@pytest.mark.slow
def test_nothing_is_missing():
    made = recording(angles(times(), END and 0.1))
    found = diagnose(flap(), made, ONE, catalogue=SOME[:3])
    assert found.verdict == "ADEQUATE", found.sentence


def test_noise_of_a_recorder_that_filters_is_no_missing_force():
    """Neighbouring frames differ by less than the noise; what is stated of it is not known."""
    rng, t = np.random.default_rng(3), times(801)
    noise = np.zeros(len(t))
    for n, white in enumerate(NOISE * np.sqrt(1.0 - 0.5**2) * rng.normal(size=len(t))):
        noise[n] = 0.5 * noise[n - 1] + white
    one = recording(angles(t) + noise, noise=0.0)
    channel = one.channels["fold"]
    one = replace(one, channels={"fold": replace(channel, noise=0.7 * NOISE)}, motion="quasistatic")
    d = diagnose(flap(), one, ONE, catalogue=SOME)
    assert d.verdict in ("ADEQUATE", "PARAMETER"), d.sentence

"""A recording that begins in the midst of a motion does not tell what a relaxation remembers there."""

from dataclasses import replace

import numpy as np
import pytest

from origami_sim.design.build import Sheet
from origami_sim.diagnose import Subject, factor
from origami_sim.drive import Drive, sine
from origami_sim.fit.least_squares import fit
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import Hypothesis, Suspect
from origami_sim.hypotheses.suspects import suspects
from origami_sim.model.bodies import rigid
from origami_sim.pattern import strip
from origami_sim.predict.begun import within
from origami_sim.predict.rigid import RigidRollouts
from origami_sim.recording import Channel, DriveChannel, Recording
from origami_sim.recording.stated import Start
from origami_sim.solve.motion.dynamics import simulate

STIFFNESS, TIME, NOISE, RATE = 3e-5, 0.475, 3e-3, 100.0
FIELD, FREQUENCY = 0.02, 2.5


def hinge():
    """A magnet that hangs on a crease."""
    pattern = strip([0.03, 0.03], 0.03)
    pattern.vertices = pattern.vertices[:, [2, 1, 0]] * (1, 1, -1)
    sheet = Sheet(pattern, thickness=1.5e-3, material="pdms", triangulation="center")
    sheet.fix(panels=[0])
    sheet.on("bars").set("bars", stiffness=1000.0)
    sheet.set("panel_bending", stiffness=1.0)
    sheet.crease([0], stiffness=2e-4)
    sheet.set("crease_viscosity", viscosity=1e-6)
    sheet.gravity((0, 0, -9.80665))
    sheet.membrane_damping = 0.0
    sheet.magnetise(1, remanence=1.0, volume=6.3e-9, poling=[0, 0, 1])
    return sheet.build()


@pytest.fixture(scope="module")
def motion() -> tuple[np.ndarray, np.ndarray, int]:
    """Times, fold angles and the crease of the hinge with a relaxation, driven for 4 s before it is recorded."""
    model, parameters = hinge()
    richer = model.with_effects("crease_relaxation")
    real = parameters.for_model(richer).set("crease_relaxation", "stiffness_1", STIFFNESS)
    real.set("crease_relaxation", "time_1", TIME)
    drive = Drive(field=(sine(FIELD, FREQUENCY), 0, 0))
    made = simulate(*rigid(richer, real), drive, duration=6.4, rate=RATE, tolerance=1e-10)
    crease = int(np.argmax(np.abs(made.creases[:, :, 0]).max(axis=0)))
    return made.times, made.creases[:, crease, 0], crease


def recorded(motion, first: int, seed: int) -> Recording:
    times, angle, crease = (motion[0][first : first + 200], motion[1][first : first + 200], motion[2])
    noisy = angle + NOISE * np.random.default_rng(seed).normal(size=200)
    b = np.zeros((200, 3))
    b[:, 0] = FIELD * np.sin(2 * np.pi * FREQUENCY * times)
    channel = Channel("fold", "crease_angle", noisy, "rad", NOISE, {"crease": crease})
    return Recording("swing", times - times[0], {"fold": channel}, {"field": DriveChannel("field", b, "T", False)})


def moving(motion, first: int, seed: int) -> Recording:
    return replace(recorded(motion, first, seed), start=Start("moving"))


def predicted_by(*recordings: Recording) -> RigidRollouts:
    known = [
        factor("crease.stiffness", 0.05),
        factor("crease_viscosity.viscosity", 0.3),
        factor("inertia.mass", 0.03),
    ]
    return RigidRollouts(Subject.from_model(*hinge(), None, known), recordings, segment=0.3)


def relaxation(forward: RigidRollouts) -> Suspect:
    every = suspects(forward.model, forward.recordings, forward.drive)
    return next(s for s in forward.admitted(every) if s.effect == "crease_relaxation")


def found(forward: RigidRollouts, suspect: Suspect) -> np.ndarray:
    """Departures (2,) of stiffness and time constant from the truth, in standard deviations."""
    begin = np.array([1.0, 1.0, 1.0, STIFFNESS, TIME, *(f.start for f in suspect.free[2:])])
    f = fit(forward, Hypothesis((suspect,)), Weights(np.full(1, NOISE), gap=1e-3), theta=begin, most=20)
    return ((f.theta - begin) / f.deviations())[3:5]


def test_every_recording_and_crease_has_a_memory_of_its_own(motion):
    one, other = recorded(motion, 408, 0), recorded(motion, 418, 1)
    forward = predicted_by(one, other)
    suspect = relaxation(forward)
    assert [(f.name, f.recording) for f in suspect.free[2:]] == [("begun_1", 0), ("begun_1", 1)]
    hypothesis, values = within(Hypothesis((suspect,)), np.arange(7.0), 3, 1)
    assert [f.recording for f in hypothesis.free] == [None, None, 1] and values.tolist() == [0, 1, 2, 3, 4, 6]
    held = predicted_by(replace(one, start=Start("released", rate_sd=100.0)), other)
    assert [f.recording for f in relaxation(held).free[2:]] == [1], "what begins at rest remembers nothing else"


def test_what_begins_slower_has_less_behind_it(motion):
    turning = int(np.argmax(np.abs(motion[1][400:440]))) + 400
    forward = predicted_by(recorded(motion, turning + 10, 0), recorded(motion, turning, 1), moving(motion, turning, 1))
    fast, slow, stated = (f.spread for f in relaxation(forward).free[2:])
    assert fast == stated == 1.0 and slow < 0.2


def test_memory_at_the_first_frame_moves_only_its_own_recording_and_fades(motion):
    forward = predicted_by(recorded(motion, 408, 0), recorded(motion, 418, 1))
    hypothesis = Hypothesis((relaxation(forward),))
    plain = np.array([1.0, 1.0, 1.0, STIFFNESS, TIME, 0.0, 0.0])
    moved = np.array([1.0, 1.0, 1.0, STIFFNESS, TIME, 1.0, 0.0])
    changes = [np.abs(v[1] - v[0]).max() for v in forward.predict(hypothesis, [plain, moved])]
    own = [c for c, b in zip(changes, forward.blocks, strict=True) if b.recording == 0]
    rest = [c for c, b in zip(changes, forward.blocks, strict=True) if b.recording == 1]
    assert max(rest) == 0.0 and own[0] > 1e-3
    lasting = forward.blocks[0].lasting * (len(own) - 1)
    assert own[-2] / own[0] == pytest.approx(np.exp(-(lasting - forward.blocks[0].lasting) / TIME), rel=0.15)


@pytest.mark.parametrize(("first", "seed"), [(408, 4), (418, 0)])
def test_a_relaxation_is_found_in_the_midst_of_a_motion(motion, first, seed):
    """Taken to begin at rest, it is 13 and 6 standard deviations off; see `begun`."""
    forward = predicted_by(recorded(motion, first, seed))
    suspect = relaxation(forward)
    assert np.abs(found(forward, suspect)).max() < 2.0
    assert np.abs(found(forward, replace(suspect, free=suspect.free[:2]))).max() > 4.0


@pytest.mark.slow
def test_intervals_of_a_relaxation_hold_from_seed_to_seed(motion):
    off = []
    for seed in range(12):
        forward = predicted_by(moving(motion, 403 + seed, seed))  # turning points among them
        off.append(found(forward, relaxation(forward)))
    assert np.mean(np.abs(off) < 1.96) >= 0.9 and np.abs(np.mean(off, axis=0)).max() < 0.8

"""What equation error says of a device that nothing holds: its wrench in flight, and the impulses of its blows."""

import numpy as np
import pytest

from origami_sim.diagnose import Options, Subject
from origami_sim.diagnose.diagnose import arranged, nominal_fits, prepared
from origami_sim.diagnose.impulses import impulses
from origami_sim.diagnose.locate import locate, motion, touching
from origami_sim.diagnose.track import track
from origami_sim.recording import Channel, Recording
from origami_sim.scene import read_calibration
from origami_sim.scenes import cube_toss
from origami_sim.solve.dynamics import simulate

NOISE, RATE = 2e-4, 300.0


def settings(**changes):
    return read_calibration("cube_toss").replace(length_scale=0.0, height=0.25, **changes)


def toss(duration: float, push=0.0, **changes):
    """The motion of a toss, with a constant force along y [N], and its recording by four corners."""
    s = settings(**changes)
    model, parameters, drive = cube_toss.build(s)
    parameters.set("gravity", "gravity_y", push / s.mass)
    state = cube_toss.tossed(s, model)
    made = simulate(model, parameters, drive, duration=duration, rate=RATE, state=state)
    rng = np.random.default_rng(0)
    channels = {}
    for n in cube_toss.NODES["impact"]:
        values = made.x[:, n, 0] + NOISE * rng.normal(size=(len(made.times), 3))
        channels[f"corner{n}"] = Channel(f"corner{n}", "marker", values, "m", NOISE, {"node": n})
    return made, Recording("toss", made.times, channels)


def fitted(recording: Recording, **changes):
    """The forward model of a cube with these numbers, and its nominal fit: one segment."""
    subject = Subject.from_scene(cube_toss, settings(**changes))
    forward = arranged(subject, prepared([recording], RATE), Options(segment=10.0, start="fit"))
    return forward, nominal_fits(forward)[1]


def test_a_tumbling_cube_is_followed_turn_by_turn():
    made, recording = toss(0.15)
    forward, _ = fitted(recording)
    t = track(forward, recording)
    assert t is not None and np.all(t.told)
    assert np.abs(t.pose.centre - made.x[:, 8, 0]).max() < 4 * NOISE
    inside = slice(4, -4)
    spin = np.gradient(t.q[3:6], t.times, axis=1)[:, inside].mean(axis=1)
    corner = made.x[:, 7, 0] - made.x[:, 8, 0]
    speed = np.gradient(corner, made.times, axis=0)[inside].mean(axis=0)
    turned = np.mean([np.cross(spin, c) for c in corner[inside]], axis=0)
    assert turned == pytest.approx(speed, abs=0.05 * np.linalg.norm(speed))


def test_a_force_in_flight_is_located_with_its_direction_and_size():
    _, recording = toss(0.18, push=0.8)
    forward, base = fitted(recording)
    places = {p.site: p for p in locate(forward, base)}
    push = places["shift y"]
    assert push.score == max(p.score for p in places.values()) and push.score > 15.0
    assert np.mean(push.moment) == pytest.approx(0.8, rel=0.06)
    assert places["shift x"].score < 2.5 and places["turn z"].score < 2.5


def test_frames_in_contact_are_left_out_of_the_flight():
    made, recording = toss(0.45)
    forward, base = fitted(recording)
    found = motion(forward, base, 0)
    assert found is not None
    low = made.times[made.gaps[:, :, 0].min(axis=1) < 0.0]
    assert len(low) and np.abs(found.times[:, None] - low).min() > found.half / RATE


@pytest.mark.parametrize("restitution", [0.9, 0.125])
def test_impulses_are_the_momentum_that_blows_give(restitution):
    """The recorded impulse is what the motion took up, whatever the model says; the model's differs if its law does."""
    made, recording = toss(0.32, restitution=0.9, spin=2.0)
    forward, base = fitted(recording, restitution=restitution)
    blow, *later = impulses(forward, base)
    for b in later:  # the wrong model may fall again where the recording flies on
        assert restitution == 0.125 and np.abs(b.recorded).max() < 3 * max(b.error) and b.apart > 10.0
    speed = np.gradient(made.centre_of_mass()[:, 0], made.times, axis=0)
    low = np.flatnonzero(made.gaps[:, :, 0].min(axis=1) < 0.0)
    start, stop = low[0] - 3, low[-1] + 4
    s = settings()
    gained = s.mass * (speed[stop] - speed[start] + [0, 0, s.gravity * (made.times[stop] - made.times[start])])
    assert np.abs(blow.recorded - gained).max() < 3 * max(blow.error) and gained[2] > 50 * max(blow.error)
    assert made.times[low[0]] < blow.time < made.times[low[-1]] and blow.site.startswith("corner")
    assert (blow.apart > 10.0) == (restitution == 0.125)


def test_what_touches_is_near_or_about_to_be():
    gaps = np.array([[0.05, 0.03, 0.01, 0.008, 0.02, 0.05]])
    assert touching(gaps, 1e-4).tolist() == [False, False, True, False, False, False]
    assert not np.any(touching(np.zeros((0, 4)), 1e-3))

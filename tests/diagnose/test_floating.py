"""What equation error says of a device that nothing holds: its wrench in flight, and the impulses of its blows."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from origami_sim.design.build import Sheet
from origami_sim.device.scene import read_calibration
from origami_sim.diagnose import Options, Subject
from origami_sim.diagnose.arrange import arranged, starting
from origami_sim.diagnose.baselines import _samples, baselines
from origami_sim.diagnose.prepare import prepared
from origami_sim.drive import Drive
from origami_sim.fit.held_out import predicted, refitted
from origami_sim.fit.nominal import nominal_fits
from origami_sim.hypotheses.hypothesis import Free, Hypothesis, apply
from origami_sim.hypotheses.subject import untold
from origami_sim.hypotheses.suspects import suspects
from origami_sim.locate.impulses import impulses
from origami_sim.locate.locate import locate, motion, motions_of, touching
from origami_sim.model.articulation import Articulation
from origami_sim.pattern import strip
from origami_sim.pattern.assemble import assemble
from origami_sim.physics.materials import MU0
from origami_sim.predict.drives import drive_of
from origami_sim.predict.track import placed, track
from origami_sim.recording import Camera, Channel, Recording
from origami_sim.recording.recording import DriveChannel, estimate_noise
from origami_sim.scenes import crawler, cube_toss
from origami_sim.solve.motion.dynamics import simulate

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
    forward, _ = arranged(subject, prepared([recording], RATE), Options(segment=10.0, start="fit"))
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
    places = {p.site: p for p in locate(forward, motions_of(forward, base))}
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


@pytest.mark.parametrize("restitution", [pytest.param(0.9, marks=pytest.mark.slow), 0.125])
def test_impulses_are_the_momentum_that_blows_give(restitution):
    """The recorded impulse is what the motion took up, whatever the model says; the model's differs if its law does."""
    made, recording = toss(0.32, restitution=0.9, spin=2.0)
    forward, base = fitted(recording, restitution=restitution)
    blow, *later = impulses(forward, base)
    for b in later:  # the wrong model may fall again where the recording flies on
        assert restitution == 0.125 and np.abs(b.recorded).max() < 3 * max(b.error) and b.apart > 5.0
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


# --- free panels with a crease


@pytest.mark.slow
def test_baselines_of_a_free_device_learn_the_moment_of_its_crease():
    """Coordinates of a free device begin with its shift and turn; none of them has a moment that is missing here."""
    sheet = Sheet(strip([0.02, 0.02], 0.02), thickness=1.5e-3, modulus=1.5e6, triangulation="center")
    sheet.panel([0, 1], rigidity=0.02)
    sheet.crease(stiffness=5e-3).set("crease_viscosity", viscosity=2e-6)
    sheet.magnetise(0, remanence=1.0, volume=2e-8, poling=(1, 0, 0))
    sheet.magnetise(1, remanence=1.0, volume=2e-8, poling=(-1, 0, 0))
    model, parameters = sheet.build()
    times = np.arange(240) / 240.0
    field = np.zeros((240, 3))
    field[:, 2] = 0.03 * np.sin(2 * np.pi * 3.0 * times)
    drive = {"field": DriveChannel("field", field, "T", False)}
    truth = parameters.copy().set("crease_viscosity", "viscosity", 1e-4)
    signals = drive_of(Recording("free", times, {}, drive), Drive())
    made = simulate(model, truth, signals, duration=times[-1], rate=240)
    rng = np.random.default_rng(0)
    channels = {
        f"corner{n}": Channel(
            f"corner{n}", "marker", made.x[:, n, 0] + 2e-5 * rng.normal(size=(240, 3)), "m", 2e-5, {"node": n}
        )
        for n in range(6)
    }
    subject = Subject.from_model(model, parameters, signals, [])
    o = Options(segment=0.12, start="fit", panels="elastic")
    forward, _ = arranged(subject, prepared([Recording("free", times, channels, drive)], 240.0), o)
    _, base, weights = nominal_fits(forward)
    angle, rate, missing = _samples(forward, motions_of(forward, base), 0, [0])
    assert np.ptp(angle) == pytest.approx(np.ptp(made.angles[:, 0, 0]), rel=0.1)
    assert np.polyfit(rate, missing, 1)[0] == pytest.approx(-9.8e-5, rel=0.1)
    fits = refitted(forward, base)
    plain, *others = baselines(forward, fits, weights, predicted(forward, fits, weights).rms)
    assert all(np.linalg.norm(b.rms) < 0.4 * np.linalg.norm(plain.rms) for b in others)


@pytest.mark.filterwarnings("error")
def test_markers_on_a_line_turn_a_free_device_as_little_as_they_can():
    sheet = Sheet(strip([0.02, 0.02], 0.02), thickness=1.5e-3, modulus=1.5e6, triangulation="center")
    model, _ = sheet.crease(stiffness=5e-3).build()
    arm = Articulation(model)
    side = [n for n, x in enumerate(model.position) if x[1] == model.position[:, 1].min()]
    assert len(side) == 3
    channels = {f"n{n}": Channel(f"n{n}", "marker", np.zeros((2, 3)), "m", 1e-5, {"node": n}) for n in side}
    recording = Recording("line", np.arange(2.0), channels)
    for turn in (np.zeros(3), np.array([0.0, 0.4, 0.0]), np.array([0.0, -0.3, 1.2])):
        turned = Rotation.from_rotvec(turn)
        level = turned.apply(model.position[side]) + np.array([0.01, -0.02, 0.3])
        pose = placed(model, arm, recording, level.ravel())
        assert np.abs(arm.positions(pose)[side, 0] - level).max() < 1e-15
        assert Rotation.from_matrix(pose.rotation[0]).magnitude() <= turned.magnitude() + 1e-15


# --- on feet


def walker():
    """Two panels on legs, with magnets against each other; feet of one name are a pair of points."""
    leg, x = 0.008, (0.0, 0.022, 0.04)
    vertices = np.array([[a, side * 0.01, leg] for a in x for side in (-1, 1)])
    sheet = Sheet(assemble(vertices, [(0, 2, 3, 1), (2, 4, 5, 3)]), thickness=1.5e-3, density=2200.0, modulus=1.5e6,
                  triangulation="center")  # fmt: skip
    sheet.fix(nodes=range(6), axes="y")
    sheet.on("bars").set("bars", stiffness=1500.0)
    sheet.crease(stiffness=5e-3).set("crease_viscosity", viscosity=3e-4)
    for panel, moment in ((0, 0.04), (1, -0.035)):
        sheet.magnetise(panel, remanence=1.0, volume=abs(moment) * MU0, poling=(np.sign(moment), 0, 0))
    sheet.gravity((0.0, 0.0, -9.81))
    sheet.membrane_damping = 0.0
    for panel, at, name in ((0, x[0], "rear foot"), (1, x[2], "front foot")):
        for y in (-0.01, 0.01):
            sheet.contact(panel, (at, y, leg), offset=-leg, name=name)
    sheet.set("coulomb", friction_coefficient=0.5)
    for effect in ("ground", "friction"):
        sheet.set(effect, stiffness=1000.0, damping=0.1)
    return sheet.build()


def walked(model, parameters, *, noise: float, seed=0) -> Recording:
    """Three edges from the side, by a tracker that smooths and rounds."""
    rng = np.random.default_rng(seed)
    wait = np.arange(0.0, 0.85, 1 / 120)
    field = np.zeros((len(wait), 3))
    field[:, 2] = 0.055 * np.sin(2 * np.pi * 2.5 * np.maximum(wait - 0.1, 0.0))
    drive = {"field": DriveChannel("field", field, "T", False, times=wait)}
    made = simulate(model, parameters, drive_of(Recording("walk", wait, {}, drive), Drive()), duration=0.8, rate=120)
    channels = {}
    for n in (0, 2, 4):
        e = noise * rng.normal(size=(len(made.times), 2))
        e[1:-1] = 0.25 * e[:-2] + 0.5 * e[1:-1] + 0.25 * e[2:]
        values = np.round((made.x[:, n, 0][:, [0, 2]] + e) / (noise / 2)) * noise / 2
        channels[f"edge{n}"] = Channel(f"edge{n}", "marker_2d", values, "m", estimate_noise(made.times, values),
                                       {"node": n}, camera=Camera(np.zeros(3), np.eye(3)[[0, 2]]))  # fmt: skip
    return Recording("walk", made.times, channels, drive)


def test_each_foot_is_suspected_by_itself_of_more_or_less_friction():
    model, parameters = walker()
    recording = walked(model, parameters, noise=3e-4)
    found = suspects(model, [recording], Drive(), parameters)
    sites = {s.site: s for s in found if s.effect == "coulomb"}
    assert set(sites) == {"rear foot", "front foot"} and sites["rear foot"].entities == (0, 1)
    assert {s.site for s in found if s.effect == "adhesion"} == {"rear foot", "front foot", "the ground"}
    rear = sites["rear foot"]
    assert rear.free[0].lower == pytest.approx(-0.5)
    for more, expected in ((0.2, 0.7), (-0.2, 0.3), (-0.9, 0.0)):
        changed = apply(parameters, Hypothesis((rear,)), [more], model)["coulomb", "friction_coefficient"]
        assert np.ravel(changed) == pytest.approx([expected, expected, 0.5, 0.5])


def test_feet_are_suspected_together_but_without_the_belly():
    model, parameters, drive = crawler.build(read_calibration("crawler"))
    recording = walked(*walker(), noise=3e-4)
    sites = {s.site: s.entities for s in suspects(model, [recording], drive, parameters) if s.effect == "stribeck"}
    feet = [n for n in sites if n.startswith("foot at")]
    assert len(feet) == 2 and set(sites) == {*feet, "all feet", "the ground"} and sites["the ground"] is None
    assert sites["all feet"] == tuple(sorted(k for n in feet for k in sites[n])) and len(sites["all feet"]) == 4


def test_feet_without_names_are_those_of_a_panel_and_never_the_belly():
    """At the nodes of a crease the sheets of two panels touch: points of one name that are no foot."""
    sheet = Sheet(strip([0.03, 0.04], 0.02), thickness="1 mm", panels="rigid").crease(stiffness="2 mN m/rad")
    sheet.mass([0, 1], "2 g").feet([0, 1, 4, 5], height="4 mm", friction=0.3, backward=0.6)
    model, parameters = sheet.gravity().ground(friction=0.25).build()
    recording = walked(*walker(), noise=3e-4)
    found = {s.site: s for s in suspects(model, [recording], Drive(), parameters) if s.effect == "coulomb"}
    assert {n: s.entities for n, s in found.items()} == {
        "feet of panel 0": (0, 1),
        "feet of panel 1": (2, 3),
        "all feet": (0, 1, 2, 3),
    }

    def build(values):
        other = parameters.copy()
        friction = other["coulomb", "friction_coefficient"].copy()
        friction[:4] = values["friction"]
        other.set("coulomb", "friction_coefficient", friction)
        return model, other, Drive()

    subject = Subject(build, (Free("", "friction", "1", 0.3, 0.02, 0.0, np.inf, 0.05),))
    refitted, untested = untold(subject, list(found.values()))
    assert "coulomb at all feet (by friction)" in refitted and "numbers of the model" in refitted
    assert untested.endswith("do not tell: coulomb at feet of panel 0, coulomb at feet of panel 1.")


@pytest.mark.parametrize("seed", range(4))
def test_what_stands_starts_from_rest_however_the_tracker_smooths(seed):
    model, parameters = walker()
    recording = walked(model, parameters, noise=3e-4, seed=seed)
    subject = Subject.from_model(model, parameters, Drive(), [])
    assert starting(subject, [recording]) == "rest"
    assert starting(subject, [recording.window(0.3, 0.8)]) == "fit"
    wild = {n: replace(c, values=c.values.copy()) for n, c in recording.channels.items()}
    wild["edge4"].values[0, 1] += 3e-3  # one frame is no motion
    assert starting(subject, [replace(recording, channels=wild)]) == "rest"


@pytest.mark.parametrize("shorter", [0.0, 0.02])
def test_what_is_seen_from_the_side_does_not_roll_to_explain_a_wrong_length(shorter):
    """Once turned a little out of the picture, turning further would shorten it."""
    model, parameters = walker()
    recording = walked(model, parameters, noise=1e-4).window(0.2, 0.8)
    channels = {n: replace(c, values=(1.0 - shorter) * c.values) for n, c in recording.channels.items()}
    recording = replace(recording, channels=channels)
    model = replace(model, free=np.ones_like(model.free))  # no walls hold it in the picture
    subject = Subject.from_model(model, parameters, Drive(), [])
    forward, _ = arranged(subject, [recording], Options(segment=0.1, start="fit"))
    followed = track(forward, recording)
    poses = [*(b.pose for b in forward.blocks), followed.pose]
    turns = np.concatenate([Rotation.from_matrix(p.rotation).as_rotvec() for p in poses])
    assert len(forward.blocks) > 3 and np.abs(turns[:, [0, 2]]).max() < 1e-4
    assert np.ptp(turns[:, 1]) > 0.05 and followed.told.tolist() == [True, False, True, False, True, False, True]
    rates = np.abs([b.rates for b in forward.blocks])
    assert rates[:, [1, 3, 5]].max() < 1e-3 < 1.0 < rates[:, 4].max()

"""Equation error: at which crease or panel something is missing, how large it is, and what it goes with."""

from dataclasses import replace

import numpy as np
import pytest

from origami_sim.design.build import Sheet
from origami_sim.device.scene import read_calibration
from origami_sim.diagnose import Options, Subject, factor
from origami_sim.diagnose.arrange import arranged
from origami_sim.diagnose.prepare import prepared
from origami_sim.drive import Drive, sine
from origami_sim.effects import get
from origami_sim.fit.least_squares import carried_on, fit
from origami_sim.fit.nominal import nominal_fits
from origami_sim.hypotheses.hypothesis import Hypothesis
from origami_sim.hypotheses.suspects import suspects
from origami_sim.locate.acting import _actions, acting
from origami_sim.locate.locate import frozen, locate, motions_of, phase, reversals, since
from origami_sim.locate.partial import partials
from origami_sim.locate.places import REVERSAL
from origami_sim.model import State, dihedral_angles
from origami_sim.model.articulation import Articulation
from origami_sim.pattern import strip
from origami_sim.recording import Channel, Recording
from origami_sim.scenes import box
from origami_sim.solve.motion.dynamics import simulate
from tests.diagnose.strips import hanging, record, subject

FRICTION = {"crease_friction": {"friction_moment": (2e-5, [1])}}


@pytest.mark.parametrize("which", ["strip", "box"])
def test_articulation_moves_panels_rigidly_and_knows_its_jacobian(which):
    model = hanging()[0] if which == "strip" else box.build(read_calibration("box"))[0]
    arm, rng = Articulation(model), np.random.default_rng(1)
    assert len(arm.open) == 0 and not arm.floating
    pose = arm.moved(arm.reference(3), 0.5 * rng.normal(size=(arm.size, 3)))
    x = arm.positions(pose)
    a, b = model.bars.T
    lengths = np.linalg.norm(x[a] - x[b], axis=-1)
    assert lengths == pytest.approx(
        np.repeat(np.linalg.norm(model.position[a] - model.position[b], axis=-1)[:, None], 3, 1)
    )
    assert dihedral_angles(x, model.creases)[arm.creases] == pytest.approx(pose.angles, abs=1e-12)
    for k, tangent in enumerate(arm.jacobian(pose)):
        by = np.zeros((arm.size, 3))
        by[k] = 1e-6
        slope = (arm.positions(arm.moved(pose, by)) - arm.positions(arm.moved(pose, -by))) / 2e-6
        assert slope == pytest.approx(tangent, abs=1e-9)
    for panel, (nodes, hinge) in arm.outer.items():  # a panel moves as it turns
        turning, apart = arm.turning(x)[panel], x[nodes] - x[nodes[0]]
        moved = arm.jacobian(pose)[:, nodes]
        assert moved - moved[:, :1] == pytest.approx(np.cross(turning[:, None], apart), abs=1e-12)
        assert np.linalg.norm(turning[hinge], axis=-1) == pytest.approx(1.0)


@pytest.mark.parametrize("effect", ["field_lag", "drive_delay"])
def test_a_distorted_drive_is_held_at_each_time(effect):
    """Each world of `frozen` has what the drive gives at its time, also after effects that make it a series."""
    times = np.linspace(0.0, 1.0, 9)
    drive = get(effect).apply(Drive(field=(0, 1e-3, sine(5e-3, 2.0))), 1.0, np.array([0.1]))
    held = frozen(drive, times)
    for name, signal in held.signals.items():
        each = [np.ravel(drive.signals[name](t))[0] for t in times.tolist()]
        assert np.broadcast_to(signal(0.0), times.shape) == pytest.approx(each, abs=1e-15)


@pytest.fixture(scope="module")
def rubbing():
    """The refitted model of a strip with dry friction at its second crease, which it lacks."""
    recordings = prepared([record(FRICTION, duration=4.0, panels=3, rate=100)], 200.0)
    forward, _ = arranged(subject(3), recordings, Options())
    return forward, nominal_fits(forward)[1]


def test_equation_error_finds_the_crease(rubbing):
    forward, base = rubbing
    places = locate(forward, motions_of(forward, base))
    assert places[0].site == "crease 1" and places[0].share > 0.5
    assert places[0].power < 0, "friction takes energy"
    rate = next(c for c in places[0].curves if c.against == "rate")
    moment = np.array(rate.mean)
    assert moment[0] > 0 > moment[-1], "it opposes the motion"


def test_each_of_two_effects_is_seen_through_what_is_missing_without_it():
    """Friction against the rate, a stiffening against the angle, each at its crease and as large as it was."""
    stiffens = {"crease_stiffening": {"cubic_stiffness": (3e-4, [0])}}
    recordings = prepared([record(FRICTION | stiffens, duration=4.0, panels=3, rate=100)], 200.0)
    forward, _ = arranged(subject(3), recordings, Options())
    base = nominal_fits(forward)[1]
    every = {s.label: s for s in suspects(forward.model, recordings, forward.drive, forward.parameters)}
    pair = [every["crease_friction at crease 1"], every["crease_stiffening at crease 0"]]
    start = np.array([*base.theta, 2e-5, *(f.start for f in pair[0].free[1:]), 3e-4])
    f = carried_on(forward, fit(forward, Hypothesis(tuple(pair)), base.weights, theta=start, local=base.local))
    rubs, bends = partials(forward, [(s, f) for s in pair])
    assert (rubs.label, rubs.site, rubs.curve.against) == (pair[0].label, "crease 1", "rate")
    x, law = np.array(rubs.curve.x), np.array(rubs.law)
    fast = np.abs(x) > 0.5 * np.abs(x).max()  # well after it has turned
    assert law[fast] == pytest.approx(-2e-5 * np.sign(x[fast]), rel=0.1)
    for p in (rubs, bends):
        seen, given = np.array(p.curve.mean), np.array(p.law)
        assert np.sqrt(np.mean((seen - given) ** 2)) < 0.2 * np.sqrt(np.mean(given**2))  # 0.15 and 0.06: noise
    assert (bends.site, bends.curve.against) == ("crease 0", "angle")


def test_errors_of_a_recorder_are_seen_through_readings_without_each():
    """A scale is a line, an eccentric disc a parabola; bars hold what was recorded around the law."""
    recording = record(duration=4.0, rate=100)
    for c in recording.channels.values():
        c.values[:] = 1.05 * c.values + 0.05 * (np.cos(c.values) - 1.0)
    forward, _ = arranged(subject(), prepared([recording], 200.0), Options())
    base = nominal_fits(forward)[1]
    every = {s.label: s for s in suspects(forward.model, forward.recordings, forward.drive, forward.parameters)}
    pair = [every[f"{name} at the measurement"] for name in ("angle_scale", "angle_eccentricity")]
    f = fit(forward, Hypothesis(tuple(pair)), base.weights, local=base.local)
    shown = partials(forward, [(s, f) for s in pair])
    scale, _, cosine = f.theta[len(base.theta) :]
    for p, order, gives in zip(shown, (1, 2), (scale / (1.0 + scale), -0.5 * cosine), strict=True):
        assert (p.curve.against, p.unit) == ("reading", "rad")
        assert np.polyfit(p.curve.x, p.law, order)[0] == pytest.approx(gives, rel=0.05)  # 0.0002 and 0.029
        off = (np.array(p.curve.mean) - p.law) / p.curve.error
        assert np.sqrt(np.mean(off**2)) < 1.5 and np.abs(p.law).max() > 3 * np.max(p.curve.error)


def test_each_of_several_explanations_is_seen_through_what_its_own_fit_lacks():
    """Of a flap that swings fast, smoothing takes a moment from accelerations that goes with the angle as laws do."""
    sheet = Sheet(strip(["20 mm", "60 mm"], "40 mm"), thickness="3 mm", material="pet", panels="rigid")
    sheet.body(1, mass="8.6 g", centre=(0.05, 0, 0), inertia=(1.16e-6, 2.58e-6, 3.72e-6))
    sheet.crease(stiffness="2 mN m/rad", loss_time="6.5 ms").gravity((9.81, 0, 0)).fix(panels=[0])
    model, parameters = sheet.build()
    arm = Articulation(model)
    state = State.at_rest(model, position=arm.positions(arm.moved(arm.reference(), np.ones((1, 1))))[:, 0])
    motion = simulate(model, parameters, Drive(), duration=4.0, rate=150, state=state)
    read = 1.03 * motion.creases[:, 0, 0] + 2e-3 * np.random.default_rng(1).normal(size=len(motion.times))
    recording = Recording(
        "swing", motion.times, {"fold": Channel("fold", "crease_angle", read, "rad", 2e-3, {"crease": 0})}
    )
    known = [factor("crease.stiffness", 0.03), factor("inertia.mass", 0.005)]
    forward, _ = arranged(Subject.from_model(model, parameters, None, known), prepared([recording], 200.0), Options())
    base = nominal_fits(forward)[1]
    every = {s.label: s for s in suspects(forward.model, forward.recordings, forward.drive, forward.parameters)}
    rivals = [every[name] for name in ("crease_stiffening at crease 0", "eccentric_weight at panel 1")]
    fits = [carried_on(forward, fit(forward, Hypothesis((s,)), base.weights, local=base.local)) for s in rivals]
    stiffens, leans = partials(forward, list(zip(rivals, fits, strict=True)))
    for p in (stiffens, leans):
        off = (np.array(p.curve.mean) - p.law) / p.curve.error
        assert np.sqrt(np.mean(off**2)) < 0.7  # 0.5 and 0.3; with what smoothing takes 1.9 and 2.1
    assert np.abs(leans.law).max() > 5 * np.max(leans.curve.error)  # 7


def acting_alone(recording):
    forward = arranged(subject(), prepared([recording], 200.0), Options())[0]
    base = nominal_fits(forward)[1]
    return acting(forward.articulation, motions_of(forward, base))


def test_a_moment_at_a_crease_is_told_from_forces_on_panels():
    first, second, *_ = acting_alone(record(FRICTION))
    assert (first.what, first.site) == ("moment at", "crease 1") and first.left < 1.2
    assert second.left > 1.5 and first.overlap < 0.95
    assert acting_alone(record()) == [], "of noise nothing is said"


def test_creases_of_one_name_act_together(rubbing):
    forward, base = rubbing
    (m,) = motions_of(forward, base)
    named = Articulation(replace(forward.model, names={**forward.model.names, "crease": ("hem", "hem")}))
    alone, both = _actions(forward.articulation, m), _actions(named, m)
    assert np.all(alone["moment at", "crease 0"] == [[1.0], [0.0]])
    assert np.all(both["moment at", "hem"] == 1.0) and len(both) == len(alone) - 1


@pytest.mark.parametrize("panel", [2, 3])
def test_a_force_on_a_panel_is_told_from_moments_at_creases(panel):
    """A spring pulls at a panel: the folds from there to the held panel all miss a moment."""
    model = hanging()[0]
    nodes = np.unique(model.triangles[model.triangle_panel == panel])
    found = acting_alone(record({"tether": {"stiffness": (0.02, nodes)}}))
    assert found[0].site == f"panel {panel}" and found[0].what in ("force across", "moment on")
    best = min(a.left for a in found if a.what == "moment at")
    assert found[0].left < (0.98 if panel == 2 else 0.8) * best  # a moment at crease 1 turns panels 2 and 3 alike


@pytest.mark.parametrize("site", [("force across", "panel 2"), ("moment on", "panel 3"), ("moment at", "crease 1")])
def test_the_size_of_an_action_is_recovered_with_its_error(site):
    """An action of a known size is added to what a swing without anything missing leaves."""
    forward = arranged(subject(), prepared([record()], 200.0), Options())[0]
    (m,) = motions_of(forward, nominal_fits(forward)[1])
    known = {"force across": 2e-3, "moment on": 5e-5, "moment at": 2e-5}[site[0]] * np.tanh(m.q[1] / 0.2)
    found = acting(
        forward.articulation, [replace(m, missing=m.missing + _actions(forward.articulation, m)[site] * known)]
    )
    a = next(a for a in found if (a.what, a.site) == site)
    assert a is found[0] and a.left < 0.7 and a.unit == ("N" if site[0] == "force across" else "N m")
    size, error = np.array(a.curves[0].mean), np.array(a.curves[0].error)
    truth = np.interp(a.curves[0].x, m.mean(m.times), m.mean(known))
    assert np.sqrt(np.mean(((size - truth) / error) ** 2)) < 0.6
    assert np.sqrt(np.mean((size - truth) ** 2)) < 0.12 * np.sqrt(np.mean(truth**2))
    assert {c.against for c in a.curves} == {"time", "angle", "rate", REVERSAL}


def test_the_missing_power_is_that_of_the_friction_block_by_block(rubbing):
    """Dry friction takes M |rate|; crease 0 misses next to nothing."""
    forward, base = rubbing
    (motion,) = motions_of(forward, base)
    places = {p.site: p for p in locate(forward, [motion])}
    taken = motion.mean(-2e-5 * np.abs(motion.rate[1]))
    found = places["crease 1"].balance
    assert found is not None and np.min(np.diff(found.x)) >= 0.099
    known = np.array(found.error) < 0.2 * np.abs(taken).max()
    assert known.sum() > 10
    # the refitted viscosity has taken a part of it
    assert np.corrcoef(np.array(found.mean)[known], taken[known])[0, 1] > 0.8
    curves = {c.against: c for c in places["crease 1"].curves}
    assert {"angle", "rate", REVERSAL} <= set(curves)
    late = [m for t, m in zip(curves[REVERSAL].x, curves[REVERSAL].mean, strict=True) if t > 0.02]
    assert np.mean(np.array(late) < 0) > 0.8, "friction acts against the motion, soon after it has turned"


def test_phases_reversals_and_steps_are_those_of_the_signal():
    t = np.linspace(0.0, 3.0, 901)
    square = np.sign(np.sin(2 * np.pi * 1.5 * t + 0.3))
    for wave in (np.sin(2 * np.pi * 1.5 * t + 0.3), square + 0.2):
        found = phase(t, wave)
        assert found is not None
        assert np.abs(np.angle(np.exp(1j * (found - 2 * np.pi * 1.5 * t - 0.3)))).max() < 0.1
    assert phase(t, t) is None and phase(t, 0 * t) is None
    assert phase(t, np.random.default_rng(0).normal(size=901)) is None
    turned = reversals(np.cos(2 * np.pi * t))  # at 1/4, 3/4, ... s, and told a little later
    assert t[turned] == pytest.approx(np.arange(0.25, 3.0, 0.5), abs=0.03)
    ago = since(t, turned)
    assert (
        np.all(np.isnan(ago[:75]))
        and np.nanmax(ago) == pytest.approx(0.5, abs=0.03)
        and ago[turned] == pytest.approx(0)
    )

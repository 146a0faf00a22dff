"""Diagnosis of curves with known answers, made by closed forms and root finding, not by the simulator."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from origami_sim.device.scene import read_calibration, scene_module, scene_settings
from origami_sim.diagnose import Options, Subject, diagnose
from origami_sim.errors import InputError
from origami_sim.fit.nominal import nominal_fits
from origami_sim.hypotheses.hypothesis import Hypothesis
from origami_sim.infer.screen import screen
from origami_sim.locate.locate_curves import sign_changes
from origami_sim.observation.observe import follow, observe_equilibria
from origami_sim.physics.materials import MU0
from origami_sim.predict.curves import Static, clocked
from origami_sim.predict.prescribed import Prescribed, curves
from origami_sim.recording import Channel, Recording
from origami_sim.recording.recording import DriveChannel

COUPON = scene_module("crease_coupon")
SETTINGS = scene_settings(COUPON).replace(stiffness=2e-3, rest_angle=0.3)
K, REST = 2e-3, 0.3
MOMENT_NOISE = 1e-5
ANGLE_NOISE = 2e-3
FLAP = scene_module("mae_crease")


def coupon() -> Subject:
    return Subject.from_scene(COUPON, SETTINGS, spreads={"stiffness": 0.2 * K, "rest_angle": 0.02})


def torque(law, seed=0) -> Recording:
    """A torque test: `law(angle) -> moment`, 72 steps from valley to mountain."""
    q = np.linspace(1.8, -1.5, 72)
    moment = law(q) + MOMENT_NOISE * np.random.default_rng(seed).normal(size=len(q))
    return curve({"moment": Channel("moment", "moment", moment, "N m", MOMENT_NOISE, {"crease": 0})}, angle=q)


def curve(channels, *, angle=None, field=None) -> Recording:
    drive = {}
    if angle is not None:
        drive["crease_angle"] = DriveChannel("crease_angle", angle, "rad", False)
    if field is not None:
        drive["field"] = DriveChannel("field", np.outer(field, [0.0, 0.0, 1.0]), "T", False)
    steps = np.arange(len(next(iter(channels.values())).values), dtype=float)
    return Recording("made", steps, channels, drive, {"time_base": "step"})


def relaxing(time_constant: float, share: float, seed=0) -> list[Recording]:
    """Ramp and hold of a standard linear solid, in closed form, to two angles."""
    out = []
    for n, level in enumerate((0.6, 1.1)):
        t = np.concatenate([np.linspace(0.0, 2.0, 11), np.geomspace(2.1, 300.0, 50)])
        rate, tau, k1 = level / 2.0, time_constant, share * K
        branch = k1 * rate * tau * np.where(t <= 2.0, 1 - np.exp(-t / tau), np.exp(-t / tau) * (np.exp(2.0 / tau) - 1))
        angle = REST + np.minimum(rate * t, level)
        moment = K * (angle - REST) + branch
        moment += MOMENT_NOISE * np.random.default_rng(seed + n).normal(size=len(t))
        channel = Channel("moment", "moment", moment, "N m", MOMENT_NOISE, {"crease": 0})
        drive = {"crease_angle": DriveChannel("crease_angle", angle, "rad", False)}
        out.append(Recording(f"hold {level}", t, {"moment": channel}, drive))
    return out


def flap_curve(*, tilt=0.0, valley=0.0, loop=0.0, stray=0.0, seed=0) -> Recording:
    """Fold angle of the magnetic flap against a field of both signs: (k + ka [th > 0]) th = m B cos(th + tilt).

    The field that reaches it is up to `loop` [T] behind the one commanded, and `stray` [T] more.
    """
    s = scene_settings(FLAP)
    dipole = s.remanence * s.length * s.width * s.thickness / MU0

    def balance(angle, field):
        return (s.stiffness + valley * (angle > 0)) * angle - dipole * field * np.cos(angle + tilt)

    fields = np.concatenate([np.linspace(0.0, 0.15, 10), np.linspace(0.15, -0.15, 19)[1:]])
    reaching, last = [], 0.0
    for field in fields:
        last = min(max(last, field - loop), field + loop)
        reaching.append(last)
    angles = np.array([brentq(balance, -2.0, 2.0, args=(b + stray,), xtol=1e-14) for b in reaching])
    angles += ANGLE_NOISE * np.random.default_rng(seed).normal(size=len(angles))
    return curve({"fold": Channel("fold", "crease_angle", angles, "rad", ANGLE_NOISE, {"crease": 0})}, field=fields)


def flap() -> Subject:
    s = scene_settings(FLAP)
    return Subject.from_scene(FLAP, s, spreads={"stiffness": 0.1 * s.stiffness, "remanence": 0.05 * s.remanence})


# --- predictions


def test_prescribed_moments():
    """A linear crease gives K (theta - rest) to rounding, in six blocks."""
    forward = curves(coupon(), [torque(lambda q: K * (q - REST))])
    assert isinstance(forward, Prescribed)
    assert [len(b.times) for b in forward.blocks] == [12] * 6
    predicted = np.concatenate([v[0, :, 0] for v in forward.predict(Hypothesis(), [np.array([K, REST])])])
    q = forward._q[0][0]
    assert np.abs(predicted - K * (q - REST)).max() < 1e-15


def test_prescribed_moments_know_the_drive_of_their_step():
    """The torque that holds the magnetic flap at angles while the field rises: k th - m B cos th."""
    s = scene_settings(FLAP)
    dipole = s.remanence * s.length * s.width * s.thickness / MU0
    q, field = np.linspace(0.0, 1.0, 12), np.linspace(0.0, 0.1, 12)
    moment = Channel("moment", "moment", s.stiffness * q - dipole * field * np.cos(q), "N m", 1e-6, {"crease": 0})
    recording = curve({"moment": moment}, angle=q, field=field)
    forward = curves(flap(), [recording])
    nominal = np.array([[f.start for f in forward.subject.nominals]])
    predicted = np.concatenate([v[0, :, 0] for v in forward.predict(Hypothesis(), nominal)])
    assert np.abs(predicted - moment.values).max() < 1e-12 * np.abs(moment.values).max() + 1e-15


def test_prescribed_relaxation_is_exact():
    """The exponential update gives the closed form of ramp and hold at the frames, however far they are apart."""
    recording = relaxing(20.0, 0.5)[0]
    forward = curves(coupon(), [recording])
    suspect = next(s for s in forward.admitted(suspected(forward)) if s.effect == "crease_relaxation")
    theta = np.array([K, REST, 0.5 * K, 20.0])
    predicted = np.concatenate([v[0, :, 0] for v in forward.predict(Hypothesis((suspect,)), [theta])])
    assert np.abs(predicted - recording.channels["moment"].values).max() < 5 * MOMENT_NOISE
    exact = np.concatenate([v[0, :, 0] for v in forward.predict(Hypothesis(), [theta[:2]])])
    late = recording.times > 2.0
    branch = 0.25 * K * 0.3 * 20.0 * 2 * (np.exp(0.1) - 1) * np.exp(-recording.times[late] / 20.0)
    assert np.abs((predicted - exact)[late] - branch).max() < 1e-14


def suspected(forward):
    from origami_sim.hypotheses.suspects import suspects

    return suspects(forward.model, forward.recordings, forward.drives[0])


def test_what_distorts_the_drive_remembers_earlier_steps():
    """A field that lags behind its current by a width, in the diagnosis and along the equilibria of the statics."""
    width = 0.004
    recording = flap_curve(loop=width)
    forward = curves(flap(), [recording])
    suspect = next(s for s in forward.admitted(suspected(forward)) if s.effect == "field_hysteresis")
    nominal = [f.start for f in forward.subject.nominals]
    predicted = forward.predict(Hypothesis((suspect,)), np.array([[*nominal, width]]))
    angles = recording.channels["fold"].values
    assert np.abs(np.concatenate([v[0, :, 0] for v in predicted]) - angles).max() < 5 * ANGLE_NOISE
    without = np.concatenate([v[0, :, 0] for v in forward.predict(Hypothesis(), np.array([nominal]))])
    assert np.abs(without - angles).max() > 10 * ANGLE_NOISE
    model = forward.model.with_effects("field_hysteresis")
    parameters = forward.parameters.for_model(model)
    parameters.set("field_hysteresis", "coercive_field", width)
    found = observe_equilibria(model, parameters, follow(model, parameters, recording), recording)["fold"]
    assert np.abs(found - angles).max() < 5 * ANGLE_NOISE


def test_chains_are_those_of_the_statics():
    """All worlds at once, as far off as a fifth of the stiffness, against one search for each step."""
    module = scene_module("mae_cantilever")
    settings = read_calibration("magnetic_beam").replace(cells=5.0)
    model = module.build(settings)[0]
    tip = int(np.argmax(model.position[:, 0]))
    levels = np.linspace(0.0, 0.02, 8)
    channel = Channel("tip", "tip_displacement", np.zeros(8), "m", 1e-5, {"node": tip, "direction": [0.0, 0.0, 1.0]})
    recording = curve({"tip": channel}, field=levels)
    subject = Subject.from_scene(module, settings, spreads={"modulus": 1e5})
    forward = curves(subject, [recording])
    assert isinstance(forward, Static)
    moduli = settings.modulus * np.array([1.0, 0.8, 1.2])
    predicted = np.concatenate([v[..., 0] for v in forward.predict(Hypothesis(), moduli[:, None])], axis=1)
    for modulus, row in zip(moduli, predicted, strict=True):
        model, parameters, _ = module.build(settings.replace(modulus=modulus))
        found = observe_equilibria(model, parameters, follow(model, parameters, recording), recording)["tip"]
        assert np.abs(row - found).max() < 1e-8 * settings.length


def test_rigid_panels_follow_load_steps():
    """The flap of a rigid panel against its closed form, there and back."""
    rigid = flap().with_rigid_panels()
    forward = curves(rigid, [flap_curve()])
    assert isinstance(forward, Static) and forward.model.panels == "rigid"
    predicted = np.concatenate([v[0, :, 0] for v in forward.predict(Hypothesis(), [[f.start for f in rigid.nominals]])])
    s = scene_settings(FLAP)
    dipole = s.remanence * s.length * s.width * s.thickness / MU0
    field = forward.recordings[0].drive["field"].values[:, 2]
    assert np.abs(s.stiffness * predicted - dipole * field * np.cos(predicted)).max() < 1e-9 * s.stiffness


def test_a_measurement_at_one_channel_acts_there_only():
    """Two sensors at one crease; the zero of the second is off. Exactly, and the other one is as it was."""
    one = flap_curve().channels["fold"]
    field = np.concatenate([np.linspace(0.0, 0.15, 10), np.linspace(0.15, -0.15, 19)[1:]])
    forward = curves(flap(), [curve({n: replace(one, name=n) for n in ("left", "right")}, field=field)])
    nominal = [f.start for f in forward.subject.nominals]
    offset = {s.site: s for s in suspected(forward) if s.effect == "angle_offset"}
    assert set(offset) == {"the measurement", "channel left", "channel right"}

    def predicted(*sites):
        theta = np.array([*nominal, *(0.03 for _ in sites)])
        return np.concatenate([v[0] for v in forward.predict(Hypothesis(tuple(offset[s] for s in sites)), [theta])])

    plain = predicted()
    for site, moved in (("the measurement", [1, 1]), ("channel left", [1, 0]), ("channel right", [0, 1])):
        np.testing.assert_allclose(predicted(site) - plain, np.outer(np.ones(28), 0.03 * np.array(moved)), atol=1e-12)


def test_curves_are_screened_whole():
    """What a cubic crease would do shows in all six pieces of a curve, as large as it is in closed form."""
    forward = curves(coupon(), [torque(lambda q: K * (q - REST) + 0.02 * K * (q - REST) ** 3)])
    _, base, weights = nominal_fits(forward)
    every = [s for s in forward.admitted(suspected(forward)) if s.effect == "crease_stiffening"]
    (found,) = screen(forward, every, base, weights)
    rest = dict(zip((f.name for f in base.free), base.theta, strict=True))["rest_angle"]
    exact = -found.size[0] * (forward._q[0][0] - rest) ** 3 / weights.deviation[0]
    parts = np.concatenate([p[: len(b.times), 0] for p, b in zip(found.parts, forward.blocks, strict=True)])
    assert len(found.parts) == 6 and np.abs(np.abs(parts) - np.abs(exact)).max() < 1e-6 * np.abs(exact).max()


def test_memory_follows_the_path():
    """Permanent set: on the way back the largest fold so far still pushes, in closed form."""
    s = scene_settings(FLAP)
    recording = flap_curve()
    forward = curves(flap(), [recording])
    suspect = next(x for x in suspected(forward) if x.effect == "crease_set")
    ks = 0.1 * s.stiffness
    theta = np.array([*(f.start for f in forward.subject.nominals), ks])
    predicted = np.concatenate([v[0, :, 0] for v in forward.predict(Hypothesis((suspect,)), [theta])])
    dipole = s.remanence * s.length * s.width * s.thickness / MU0
    most = least = 0.0
    for field, angle in zip(recording.drive["field"].values[:, 2], predicted, strict=True):

        def balance(a, field=field, most=most, least=least):
            return s.stiffness * a - ks * (max(most, a) + min(least, a)) - dipole * field * np.cos(a)

        exact = brentq(balance, -2.0, 2.0, xtol=1e-14)
        most, least = max(most, exact), min(least, exact)
        assert angle == pytest.approx(exact, abs=2e-4)


def test_steps_have_no_clock():
    assert clocked("crease_relaxation") and clocked("clock_delay") and clocked("crease_swelling")
    assert not clocked("gravity") and not clocked("crease_stiffening") and not clocked("crease_set")


def test_wrong_curves():
    recording = torque(lambda q: K * (q - REST))
    wrong = curve({"fold": Channel("fold", "crease_angle", np.zeros(9), "rad", 1e-3, {"crease": 0})}, angle=np.zeros(9))
    with pytest.raises(InputError, match="compared by its moments"):
        curves(coupon(), [wrong])
    module = scene_module("bifold")
    with pytest.raises(InputError):
        curves(Subject.from_scene(module, scene_settings(module)), [recording])


# --- verdicts


def test_null():
    d = diagnose(coupon(), [torque(lambda q: K * (q - REST))])
    assert d.verdict == "ADEQUATE"


def test_wrong_parameter():
    d = diagnose(coupon(), [torque(lambda q: 1.25 * K * (q - REST))])
    assert d.verdict == "PARAMETER"
    assert d.chosen == ["stiffness"]
    assert d.candidates[0].numbers[0].value == pytest.approx(1.25 * K, rel=0.01)


def test_cubic_stiffening():
    d = diagnose(coupon(), [torque(lambda q: K * (q - REST) + 3e-4 * (q - REST) ** 3)])
    assert d.by_step and d.folds[0].name == "made, load steps 0 to 23"
    assert d.places and all(np.isnan(p.power) for p in d.places)
    assert (d.verdict, d.chosen) == ("MECHANISM", ["crease_stiffening at hinge"])
    number = next(n for n in d.candidates[0].numbers if n.label == "crease_stiffening.cubic_stiffness")
    assert number.value == pytest.approx(3e-4, rel=0.1)
    assert d.error_after[0] < 0.1 * d.error_refitted[0]
    against = d.places[0].curves[0]
    assert against.against == "angle"
    assert sign_changes(against)  # what a straight line leaves of a cubic


def test_two_effects_each_of_which_hides_the_other():
    """Friction and a set of about the same size: either alone takes a part of both, and leaves much."""
    most, least, slid = 0.0, 0.0, 0.0
    up = np.linspace(0.0, 1.2, 25)
    path = REST + np.concatenate([up, up[-2::-1], -up[1:], -up[-2::-1]])
    moment = []
    for turn in path - REST:
        most, least = max(most, turn), min(least, turn)
        slid = min(max(slid, turn - 0.01), turn + 0.01)
        moment.append(K * turn + 2.5e-5 * (turn - slid) / 0.01 - 1.2e-4 * (most + least))
    rng = np.random.default_rng(1)
    noisy = np.array(moment) + MOMENT_NOISE * rng.normal(size=len(path))
    made = curve({"moment": Channel("moment", "moment", noisy, "N m", MOMENT_NOISE, {"crease": 0})}, angle=path)
    found = diagnose(coupon(), made, Options(threads=1))
    assert found.verdict in ("SEVERAL", "TIE"), found.sentence
    best = found.candidates[0]
    assert set(best.effects) == {"crease_friction", "crease_set"}
    numbers = {n.label: n.value for n in best.numbers}
    assert numbers["crease_friction.friction_moment"] == pytest.approx(2.5e-5, rel=0.15)
    assert numbers["crease_set.set_stiffness"] == pytest.approx(1.2e-4, rel=0.15)
    assert found.error_after[0] < 1.2 * MOMENT_NOISE


def test_relaxation():
    d = diagnose(coupon(), relaxing(20.0, 0.5))
    assert d.verdict == "MECHANISM"
    assert d.candidates[0].effects == ["crease_relaxation"]
    numbers = {n.label: n.value for n in d.candidates[0].numbers}
    assert numbers["crease_relaxation.time_1"] == pytest.approx(20.0, rel=0.1)
    assert numbers["crease_relaxation.stiffness_1"] == pytest.approx(0.5 * K, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    "truth, made", [("field_misalignment", {"tilt": 0.07}), ("crease_asymmetry", {"valley": 0.004})]
)
def test_tilted_field_or_asymmetry(truth, made):
    """Both make the two signs of the field differ; the truth is named, alone or in a tie."""
    suspects = [
        "field_misalignment",
        "crease_asymmetry",
        "crease_stiffening",
        "crease_offset",
        "crease_set",
        "angle_scale",
    ]
    d = diagnose(flap(), [flap_curve(**made)], catalogue=suspects)
    assert d.verdict in ("MECHANISM", "TIE")
    assert any(label.startswith(truth) for label in d.chosen)


@pytest.mark.slow
def test_a_stray_field_is_no_weight_and_no_rest_angle():
    """One component of three shows: the others cost nothing, and are not said."""
    found = diagnose(flap(), [flap_curve(stray=2e-3)])
    best = found.candidates[0]
    assert found.verdict == "MECHANISM" and best.label == "field_offset at the drive"
    assert len([n for n in best.numbers if n.label.startswith("field_offset.")]) < 3
    assert "not told from zero" not in best.distrust
    assert [c.label for c in found.candidates].count(best.label) == 1


def test_laws_with_a_loss_that_is_not_stated_are_suspects_of_load_steps():
    assert not any(map(clocked, ("crease_yield", "crease_contact", "crease_friction")))
    assert all(
        map(clocked, ("crease_relaxation", "crease_viscosity", "crease_aging", "crease_swelling", "clock_delay"))
    )
    assert all(map(clocked, ("voltage_lag", "voltage_limit", "magnetic_viscosity", "dielectric_relaxation")))

"""The diagnosis on constructed cases with known answers, stage by stage."""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from origami_sim.articulation import Articulation
from origami_sim.diagnose import Options, diagnose, experiment, prepare, search, several, verdict
from origami_sim.diagnose.acting import _actions, acting
from origami_sim.diagnose.baselines import baselines
from origami_sim.diagnose.compare import FOLDS, memory, probabilities, score
from origami_sim.diagnose.diagnosis import REVERSAL
from origami_sim.diagnose.forward import calmed
from origami_sim.diagnose.locate import locate, motions_of, phase, reversals, since
from origami_sim.diagnose.prepare import among, arranged, nominal_fits, prepared
from origami_sim.diagnose.screen import _affordable, _least, again, screen
from origami_sim.diagnose.search import chosen, look_elsewhere, refit, unbent
from origami_sim.diagnose.tables import varying_drive
from origami_sim.drive import Drive, sine
from origami_sim.errors import InputError
from origami_sim.fit.hypothesis import Hypothesis, Suspect, distinct_sites, suspects
from origami_sim.fit.subject import alignments
from origami_sim.model import State, dihedral_angles
from origami_sim.recording import Channel, NoiseReport, Recording
from origami_sim.scene import read_calibration
from origami_sim.scenes import box
from tests.diagnose.strips import hanging, record, subject

FRICTION = {"crease_friction": {"friction_moment": (2e-5, [1])}}
LOOPS = ("crease_friction", "crease_hysteresis", "air_drag", "crease_stiffening", "crease_offset", "mass_damping")
SMALL = {"duration": 4.0, "panels": 3, "rate": 100}


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


@pytest.fixture(scope="module")
def rubbing():
    """The nominal fit and the screening of a strip with dry friction at its second crease."""
    recordings = prepared([record(FRICTION, **SMALL)], 200.0)
    forward = arranged(subject(3), recordings, Options())
    given, base, weights = nominal_fits(forward)
    every = [s for s in suspects(forward.model, recordings, forward.drive) if s.effect in LOOPS]
    return forward, given, base, weights, screen(forward, every, base, weights)


def test_all_suspects_share_a_program(rubbing):
    """Compiling one for each would take longer than running it."""
    forward = rubbing[0]
    every = forward.admitted(suspects(forward.model, forward.recordings, forward.drive, forward.parameters))
    programs, felt = set(), set()
    for s in every:
        hypothesis = Hypothesis((s,))
        theta = np.array([f.start for f in (*forward.subject.nominals, *hypothesis.free)])
        world = forward._world(hypothesis, theta, hypothesis.effects)
        for model, parameters in (world, calmed(*world)):
            batch = forward._batch(model, parameters, forward.drive, State.at_rest(model))
            programs.add(id(batch.program))
            felt |= set(model.laws)
    assert len(felt) > 20 and len(programs) == 1


def test_the_nominal_refit_is_no_worse_than_the_model_as_given(rubbing):
    _, given, base, _, _ = rubbing
    assert base.cost <= given.cost * (1 + 1e-9)


def test_screening_names_the_effect_its_site_and_about_its_strength(rubbing):
    *_, screening = rubbing
    best = screening.signatures[0]
    assert best.suspect.effect in ("crease_friction", "crease_hysteresis")
    assert best.suspect.site == "crease 1"
    friction = next(s for s in screening.signatures if s.suspect.label == "crease_friction at crease 1")
    assert friction.strength == pytest.approx(2e-5, rel=0.5)
    assert look_elsewhere(screening, 499, 0) < 0.01
    overlap = screening.overlap()
    assert np.diag(overlap) == pytest.approx(1.0) and overlap.max() <= 1 + 1e-9


def test_starts_that_were_bent_are_put_back_to_look_again(rubbing):
    """Bent starts can hide an effect: what stands out from the recorded ones is fitted, too; else nothing is done."""
    forward, _, base, weights, _ = rubbing
    every = [s for s in suspects(forward.model, forward.recordings, forward.drive) if s.effect in LOOPS]
    told = forward.told(base.hypothesis, base.theta)
    assert unbent(forward, replace(base, local=told), every, [], weights, Options()) == []
    bent = told.copy()
    bent[0] += 8.0 * forward.blocks[0].known
    found = unbent(forward, replace(base, local=bent), every, [], weights, Options())
    best = min(found, key=lambda f: f.cost)
    assert best.hypothesis.label in ("crease_friction at crease 1", "crease_hysteresis at crease 1")
    assert best.cost < 0.5 * base.cost
    labels = [f.hypothesis.label for f in found]
    again = unbent(forward, replace(base, local=bent), every, found, weights, Options())
    assert not {f.hypothesis.label for f in again} & set(labels)


def test_numbers_that_were_bent_are_put_back_to_look_again(rubbing):
    """A number far from what was known can stand for an effect, which then seems not to matter."""
    forward, _, base, weights, _ = rubbing
    every = [s for s in suspects(forward.model, forward.recordings, forward.drive) if s.effect in LOOPS]
    first, local = base.free[0], forward.told(base.hypothesis, base.theta)
    assert unbent(forward, replace(base, local=local), every, [], weights, Options()) == []
    theta = base.theta.copy()
    theta[0] = first.start + 4.0 * first.spread
    found = unbent(forward, replace(base, local=local, theta=theta), every, [base], weights, Options())
    best = min(found, key=lambda f: f.cost)
    assert best.hypothesis.label in ("crease_friction at crease 1", "crease_hysteresis at crease 1")
    assert best.cost < 0.5 * base.cost and abs(best.theta[0] - first.start) < 3.0 * first.spread
    assert unbent(forward, replace(base, local=local, theta=theta), every, found, weights, Options()) == []


def test_equation_error_finds_the_crease(rubbing):
    forward, _, base, _, _ = rubbing
    places = locate(forward, motions_of(forward, base))
    assert places[0].site == "crease 1" and places[0].share > 0.5
    assert places[0].power < 0, "friction takes energy"
    rate = next(c for c in places[0].curves if c.against == "rate")
    moment = np.array(rate.mean)
    assert moment[0] > 0 > moment[-1], "it opposes the motion"


def acting_alone(recording):
    forward = arranged(subject(), prepared([recording], 200.0), Options())
    forward.soften()
    base = nominal_fits(forward)[1]
    return acting(forward.articulation, motions_of(forward, base))


def test_a_moment_at_a_crease_is_told_from_forces_on_panels():
    first, second, *_ = acting_alone(record(FRICTION))
    assert (first.what, first.site) == ("moment at", "crease 1") and first.left < 1.2
    assert second.left > 1.5 and first.overlap < 0.95
    assert acting_alone(record()) == [], "of noise nothing is said"


def test_creases_of_one_name_act_together(rubbing):
    forward, _, base, _, _ = rubbing
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
    assert found[0].left < 0.8 * best


@pytest.mark.parametrize("site", [("force across", "panel 2"), ("moment on", "panel 3"), ("moment at", "crease 1")])
def test_the_size_of_an_action_is_recovered_with_its_error(site):
    """An action of a known size is added to what a swing without anything missing leaves."""
    forward = arranged(subject(), prepared([record()], 200.0), Options())
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
    forward, _, base, *_ = rubbing
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


def test_a_nested_model_never_fits_worse(rubbing):
    """Adding an effect, whichever, does not worsen the training fit."""
    forward, _, base, weights, screening = rubbing
    for found in screening.signatures[:2] + screening.signatures[-2:]:
        f = refit(forward, base, found, weights, screening, most=2)
        assert f.failed or f.cost <= base.cost * (1 + 1e-6), found.suspect.label
    assert chosen(screening, 2)[0] is screening.signatures[0]


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(n, marks=pytest.mark.slow) for n in range(2, 30))])
def test_whatever_is_added_to_whatever_was_recorded_never_fits_worse(seed):
    """Strips, concealed effects, numbers and suspects at random: one effect more, and another beside it."""
    rng = np.random.default_rng([seed, 11])
    panels = int(rng.integers(2, 4))
    hidden = [
        {"crease_friction": {"friction_moment": (10 ** rng.uniform(-6, -4.3), None)}},
        {"crease_stiffening": {"cubic_stiffness": (10 ** rng.uniform(-5, -3), None)}},
        {"air_drag": {"drag_coefficient": (10 ** rng.uniform(-1, 0.7), None)}},
        {"crease_offset": {"offset_moment": (1e-5 * rng.normal(), [0])}},
        {},
    ][int(rng.integers(5))]
    known = {("crease", "stiffness"): 1 + 0.05 * rng.normal(), ("inertia", "mass"): 1 + 0.03 * rng.normal()}
    swing = {"panels": panels, "duration": 2.0, "rate": 100, "size": rng.uniform(0.2, 1.2)}
    forward = arranged(subject(panels), prepared([record(hidden, factors=known, seed=seed, **swing)], 200.0), Options())
    _, base, weights = nominal_fits(forward)
    every = forward.admitted(suspects(forward.model, forward.recordings, forward.drive))
    few = [every[k] for k in rng.choice(len(every), 5, replace=False)]
    screening = screen(forward, few, base, weights)
    for found in screening.signatures[:3]:
        f = refit(forward, base, found, weights, screening, most=2)
        assert f.failed or f.cost <= base.cost * (1 + 1e-9), found.suspect.label
        if f.failed:
            continue
        for g in again(screening, f).signatures[:1]:
            both = refit(forward, f, g, weights, screening, most=2)
            assert both.failed or both.cost <= f.cost * (1 + 1e-9), both.hypothesis.label


def test_fits_that_are_left_far_behind_stay_rough(rubbing, monkeypatch):
    """A rough fit is no better than the finished one; only those that come near the best one are carried on."""
    forward, _, base, weights, screening = rubbing
    carried, plain = [], search.finished
    monkeypatch.setattr(search, "finished", lambda f, r, *a: (carried.append(r), plain(f, r, *a))[1])
    finalists = [*chosen(screening, 4), screening.signatures[-1]]
    fits = search.contest(forward, base, finalists, screening, weights, lambda part: None)
    assert fits[0] is base and [f.hypothesis.suspects for f in fits[1:]] == [(s.suspect,) for s in finalists]
    rough = [search.roughly(forward, base, s, weights, screening) for s in finalists]
    assert all(f.cost <= r.cost <= base.cost * (1 + 1e-9) for f, r in zip(fits[1:], rough, strict=True))
    gain = base.cost - min(r.cost for r in rough)
    near = [r for r in rough if base.cost - min(r.cost, r.promise) >= min(0.5 * gain, gain - 50.0)]
    labels = {r.hypothesis.label for r in near}
    assert {r.hypothesis.label for r in carried} == labels and 0 < len(labels) < len(rough)


def test_what_keeps_panels_in_shape_is_screened_as_strongly_beside_softer_panels():
    forward = arranged(subject(3), [record(duration=2.0, panels=3)], Options(threads=1))
    theta = np.array([f.start for f in forward.subject.nominals])
    base = SimpleNamespace(hypothesis=Hypothesis(), theta=theta)
    (panels,) = [s for s in suspects(forward.model, forward.recordings, forward.drive) if s.effect == "panel_softness"]
    sizes = []
    for forward.softness in (1.0, 100.0):
        sizes.append(_affordable(forward, base, panels, panels.free[0].scale, _least(forward, base, panels)))
    assert sizes[0] == sizes[1] == panels.free[0].scale


def test_a_segments_memory_does_not_depend_on_which_others_are_asked_for():
    """The largest fold of the past is that of the whole recording before the segment."""
    forward = arranged(subject(3), [record(duration=3.0, panels=3)], Options(threads=1))
    mullins = next(
        s for s in suspects(forward.model, forward.recordings, forward.drive) if s.effect == "crease_mullins"
    )
    theta = np.array([*(f.start for f in forward.subject.nominals), 1e-4, 0.3])
    every = forward.predict(Hypothesis((mullins,)), [theta])
    for b in (0, len(forward.blocks) - 1):
        assert np.array_equal(forward.predict(Hypothesis((mullins,)), [theta], blocks=[b])[0], every[b], equal_nan=True)
    hypothesis = Hypothesis((mullins,))
    largest = forward._memory(0, [forward._world(hypothesis, theta, hypothesis.effects)], forward.blocks)
    assert largest is not None and np.all(np.diff(largest, axis=1) >= 0) and largest.max() > 0.5


def test_memory_and_probabilities():
    rng = np.random.default_rng(3)
    white = [rng.normal(size=(2000, 2)) for _ in range(4)]
    assert memory(white) == pytest.approx(1.0, abs=0.3)
    smooth = [np.convolve(rng.normal(size=4020), np.ones(20) / 20, "valid")[:, None] for _ in range(4)]
    assert memory(smooth) == pytest.approx(20.0, rel=0.25)  # a running mean of 20 samples
    assert probabilities([0.0, 0.0, -np.inf]) == pytest.approx([0.5, 0.5, 0.0])


def test_friction_is_found_with_its_strength_and_the_fit_improves():
    found = diagnose(subject(3), [record(FRICTION, **SMALL)], catalogue=LOOPS)
    assert found.verdict in ("MECHANISM", "TIE")
    row = next(c for c in found.candidates if c.label == "crease_friction at crease 1")
    assert found.chosen[0] == row.label
    moment = next(n for n in row.numbers if n.label == "crease_friction.friction_moment")
    assert moment.low < 2e-5 < moment.high and moment.value == pytest.approx(2e-5, rel=0.2)
    before, after, noise = (np.sum(np.square(e)) for e in (found.error_refitted, found.error_after, found.noise))
    assert (before - after) / (before - noise) > 0.9, "of what could be removed on held-out data"
    assert found.exit_code >= 10 and found.candidates[0].gain > 0


def test_nothing_is_found_where_nothing_is_missing():
    found = diagnose(subject(3), [record(seed=4, **SMALL)], catalogue=LOOPS)
    assert found.verdict == "ADEQUATE"
    assert max(np.array(found.error_after) / found.noise) < 1.1


def test_a_wrong_parameter_is_called_a_parameter():
    found = diagnose(subject(3), [record(factors={("crease", "stiffness"): 1.1}, **SMALL)], catalogue=LOOPS)
    assert found.verdict == "PARAMETER" and "crease.stiffness" in found.chosen
    numbers = {n.label: n for n in found.candidates[0].numbers}
    stiffness, mass = numbers["crease.stiffness"], numbers["inertia.mass"]
    assert stiffness.low < 1.1 < stiffness.high
    assert stiffness.value / mass.value == pytest.approx(1.1, abs=0.01), "a frequency tells no more than the ratio"


def test_an_offset_of_one_encoder_is_the_measurement():
    r = record(**SMALL)
    r.channels["fold1"].values[:] += 0.03
    found = diagnose(subject(3), [r], catalogue=(*LOOPS, "angle_offset"))
    assert found.verdict == "MEASUREMENT" and found.chosen[0] == "angle_offset at channel fold1"


def test_wrong_zeros_of_two_encoders_are_found_beside_each_other():
    r = record(**SMALL)
    for name, zero in (("fold1", 0.03), ("fold2", -0.02)):
        r.channels[name].values[:] += zero
    found = diagnose(subject(3), [r], catalogue=("angle_offset", "angle_scale", "crease_friction"))
    assert found.verdict == "SEVERAL"
    best = found.candidates[0]
    zeros = {s: n for s, n in zip(best.sites, best.numbers[-2:], strict=True)}
    assert set(zeros) == {"channel fold1", "channel fold2"}
    for site, truth in (("channel fold1", 0.03), ("channel fold2", -0.02)):
        assert zeros[site].value == pytest.approx(truth, abs=1e-4)
        assert zeros[site].low < truth < zeros[site].high
    assert set(found.patch) >= {"angle_offset.angle_offset@0", "angle_offset.angle_offset@1"}


def test_a_large_error_of_the_scale_is_the_measurement():
    found = diagnose(subject(3), [record(scale=0.7, **SMALL)], catalogue=(*LOOPS, "angle_scale"))
    assert found.verdict == "MEASUREMENT" and found.chosen[0] == "angle_scale at the measurement"
    scale = next(n for n in found.candidates[0].numbers if n.label == "angle_scale.angle_scale")
    assert scale.low < -0.3 < scale.high and scale.high - scale.low < 0.06


def test_an_alignment_within_what_is_known_is_the_measurement():
    aligned = subject(3).beside(alignments({"angle_scale.angle_scale": 0.02}))
    found = diagnose(aligned, [record(scale=0.96, **SMALL)], catalogue=LOOPS[:3])
    assert found.verdict == "MEASUREMENT" and found.chosen == ["angle_scale.angle_scale"]
    assert found.sentence.startswith("Aligning the recording within what is known of it is enough: angle_scale")
    assert found.patch["angle_scale.angle_scale"] == pytest.approx(-0.04, abs=0.02)


def test_more_loss_at_one_crease_is_found_where_the_model_has_that_loss():
    r = record({"crease_viscosity": {"viscosity": (1.2e-5, [1])}}, **SMALL)
    found = diagnose(subject(3), [r], catalogue=("crease_viscosity", "crease_friction", "mass_damping"))
    assert found.verdict == "MECHANISM" and found.chosen == ["crease_viscosity at crease 1"]
    more = found.candidates[0].numbers[-1]
    assert more.low < 8e-6 < more.high and more.value == pytest.approx(8e-6, rel=0.15)


@pytest.mark.slow
def test_two_effects_are_found_together():
    both = {**FRICTION, "air_drag": {"drag_coefficient": (2.0, None)}}
    found = diagnose(subject(), [record(both, duration=10.0)], catalogue=(*LOOPS, "crease_mullins"))
    assert found.verdict == "SEVERAL"
    assert set(found.candidates[0].effects) == {"crease_friction", "air_drag"}


@pytest.mark.slow
def test_false_alarms_are_counted_over_a_hundred_nulls():
    """Half of them with parameters drawn from their priors. At most 5 %, which is nominal, plus two standard errors."""
    alarms = []
    for seed in range(100):
        rng = np.random.default_rng([seed, 7])
        factors = {} if seed % 2 else {("crease", "stiffness"): 1 + 0.05 * rng.normal()}
        made = record(seed=seed, factors=factors, noise=float(rng.choice([1e-3, 3e-3])), **SMALL)
        found = diagnose(subject(3), [made], catalogue=LOOPS)
        if found.verdict not in ("ADEQUATE", "PARAMETER"):
            alarms.append((seed, found.verdict, found.chosen))
    assert len(alarms) <= 9, alarms


@pytest.mark.slow
def test_nulls_are_not_blamed_with_the_whole_catalogue_to_choose_from():
    """As they are, with a parameter off, and with a scale off: where that is named, it is no alarm."""
    alarms = []
    for seed in range(12):
        rng = np.random.default_rng([seed, 7])
        off, scale = 1 + 0.05 * rng.normal(), 1 + 0.02 * rng.normal()
        made = record(
            seed=seed,
            factors={("crease", "stiffness"): off} if seed % 3 == 1 else {},
            scale=scale if seed % 3 == 2 else 1.0,
            noise=float(rng.choice([1e-3, 3e-3])),
            **SMALL,
        )
        found = diagnose(subject(3), [made])
        quiet = ("ADEQUATE", "PARAMETER", *(("MEASUREMENT",) if seed % 3 == 2 else ()))
        if found.verdict not in quiet and "nominal" not in found.chosen:
            alarms.append((seed, found.verdict, found.chosen))
    assert len(alarms) <= 1, alarms


def test_frames_are_thinned_but_not_below_what_a_comparison_needs():
    swing = record(**SMALL)
    (same,) = prepared([replace(swing, times=swing.times / 100)], 200.0)
    assert len(same.times) == len(swing.times), "40 ms at 10 kHz are few frames, not many"
    long = record(panels=3, duration=5.0, rate=400)
    (half,) = prepared([long], 200.0)
    assert len(half.times) == pytest.approx(len(long.times) / 2, abs=1)


def test_thinned_frames_are_means_that_follow_a_bend():
    """Noise falls with the root of the frames, the motion stays, and what cannot be averaged stays as it was read."""
    t, rng = np.arange(4001) / 1000.0, np.random.default_rng(2)
    swing = 0.7 * np.sin(2 * np.pi * 6.0 * t)

    def thin(values, times=t, quantum=0.0):
        noise = 0.01
        known = NoiseReport(noise, noise, quantum, 0.0, noise, np.nan, np.nan, 0)
        channel = Channel("a", "crease_angle", values, "rad", noise, noise_report=known)
        (out,) = prepared([Recording("r", times, {"a": channel})], 200.0)
        return out

    exact = thin(swing)
    assert np.array_equal(exact.times, t[::5])
    assert exact.channels["a"].values == pytest.approx(swing[::5], abs=5e-6)  # a plain mean is off by 1e-3
    noisy = thin(swing + rng.normal(0.0, 0.01, 4001)).channels["a"]
    left = (noisy.values - swing[::5])[1:-1]
    assert np.std(left) == pytest.approx(noisy.noise, rel=0.08) and noisy.noise < 0.52 * 0.01
    assert abs(np.mean(left[1:] * left[:-1])) < 0.15 * np.var(left)
    assert noisy.noise_report.level == noisy.noise
    smooth = np.convolve(rng.normal(0.0, 0.02, 4005), np.ones(5) / 5.0, "valid")  # frames that are alike
    alike = thin(swing + smooth).channels["a"]
    assert 0.75 < alike.noise / np.std((alike.values - swing[::5])[1:-1]) < 1.1 and alike.noise > 1.2 * noisy.noise
    counted = thin(0.03 * np.round(0.1 * swing / 0.03), quantum=0.03).channels["a"]  # steps are no noise that averages
    assert counted.noise == pytest.approx(0.03 / np.sqrt(12.0))
    gap = np.where(t > 2.0, t + 0.5, t)
    assert thin(swing, gap).channels["a"].values == pytest.approx(swing[::5], abs=5e-6)
    holes = np.where(rng.random(4001) < 0.02, np.nan, 0.0)
    assert thin(swing + holes).channels["a"].values == pytest.approx(swing[::5], abs=2e-4, nan_ok=True)
    holed = thin(swing + holes + rng.normal(0.0, 0.01, 4001)).channels["a"]
    assert np.nanstd((holed.values - swing[::5])[1:-1]) == pytest.approx(holed.noise, rel=0.08)
    assert np.isnan(holed.values).sum() <= 2


@pytest.mark.parametrize(("rate", "every"), [(400, 2), (500, 2), (700, 3), (800, 4)])
def test_no_frame_is_thrown_away_where_frames_are_thinned(rate, every):
    t, rng = np.arange(10 * rate) / rate, np.random.default_rng(3)
    swing = 0.7 * np.sin(2 * np.pi * 4.0 * t)

    def thin(values):
        made = Recording("r", t, {"a": Channel("a", "crease_angle", values, "rad", 0.01)})
        return prepared([made], 200.0)[0]

    assert np.array_equal(thin(swing).times, t[::every])
    assert thin(swing).channels["a"].values == pytest.approx(swing[::every], abs=2e-5)
    noisy = thin(swing + rng.normal(0.0, 0.01, len(t))).channels["a"]
    left = (noisy.values - swing[::every])[1:-1]
    assert np.std(left) == pytest.approx(noisy.noise, rel=0.08)
    assert noisy.noise < 1.25 * 0.01 / np.sqrt(every)  # a mean without its bend has 1 / root


def test_wild_frames_are_left_out_and_told():
    t = np.arange(800) / 120.0
    values = np.stack([np.cos(3.0 * t), np.sin(3.0 * t)], axis=1)
    values[[100, 300]] += 0.5
    made = Recording("r", t, {"m": Channel("m", "marker_2d", values, "m", 1e-3)}, metadata={"notes": ["known."]})
    (found,) = prepared([made], 200.0)
    assert np.flatnonzero(np.isnan(found.channels["m"].values).all(axis=1)).tolist() == [100, 300]
    assert found.metadata["notes"] == [
        "known.", "r: 2 wild frames of channel 'm' are left out, the first at t = 0.833333 s."
    ]  # fmt: skip
    curve = replace(made, metadata={"time_base": "step"})
    assert prepared([curve], 200.0)[0].channels["m"].values is values


def test_a_segment_that_is_asked_for_has_a_start_of_its_own(monkeypatch):
    monkeypatch.setattr(prepare, "starting", lambda *_: "rest")
    at_rest = record(**SMALL)
    assert arranged(subject(3), [at_rest], Options()).start == "rest"
    cut = arranged(subject(3), [at_rest], Options(segment=0.5))
    assert cut.start == "fit" and len(cut.blocks) > 1
    for length in (0.0, 1e-9, np.inf, np.nan):
        with pytest.raises(InputError, match=r"segment.*allowed: >= 0\.08 s"):
            arranged(subject(3), [at_rest], Options(segment=length))


def test_one_recording_from_rest_is_held_out_stretch_by_stretch(rubbing):
    """A number that one stretch tells alone is not known when that is left out."""
    at_rest = arranged(subject(3), [record(size=0.0, **SMALL)], Options(start="rest"))
    _, base, weights = nominal_fits(at_rest)
    assert len(base.blocks) == 1
    found = score(at_rest, base, weights)
    assert len(found.held_out) == len(found.squares) == FOLDS
    line = base.linear
    assert line is not None
    pieces = line.cut(FOLDS, len(weights.deviation))
    assert np.concatenate(pieces.residual) == pytest.approx(line.residual[0])
    early = [(1.0 if n == 1 else 1e-2) * np.ones_like(t) for n, t in enumerate(pieces.tangent)]
    alone = score(at_rest, replace(base, linear=replace(line, tangent=[np.concatenate(early)])), weights)
    squares = [float(r @ r) for r in pieces.residual]
    assert alone.squares[1] > 2.0 * squares[1] and np.delete(alone.squares, 1) == pytest.approx(
        np.delete(squares, 1), rel=1e-3
    )


def test_stretches_of_one_segment_are_predicted_with_the_start_that_the_others_tell():
    forward = arranged(subject(3), [record(**SMALL)], Options(start="fit", segment=5.0))
    _, base, weights = nominal_fits(forward)
    assert len(base.blocks) == 1 and forward.local and base.linear is not None
    found = score(forward, base, weights)
    line, own = base.linear, len(forward.blocks[0].values) * len(weights.deviation)
    both = np.concatenate([line.slopes[0], line.tangent[0]], axis=1)
    prior = np.array([f.scale / f.spread for f in base.free])
    away = prior * [(f.start - t) / f.scale for f, t in zip(base.free, base.theta, strict=True)]
    pieces = line.cut(FOLDS, len(weights.deviation))
    edges = np.cumsum([0, *map(len, pieces.residual)])
    for n, (a, b) in enumerate(pairwise(edges)):
        kept = np.r_[0:a, b : len(both)]  # with the rows of the start
        assert edges[-1] == own < len(both)
        rows = np.concatenate([both[kept], np.diag(np.r_[np.zeros(forward.local), prior])[forward.local :]])
        step, *_ = np.linalg.lstsq(rows, np.concatenate([line.residual[0][kept], away]), rcond=None)
        left = line.residual[0][a:b] - both[a:b] @ step
        assert found.squares[n] == pytest.approx(left @ left, rel=1e-2)
    assert found.held_out.sum() < -0.5 * sum(float(r @ r) for r in pieces.residual)


@pytest.mark.parametrize("segment", [99.0, 2.5])
def test_baselines_are_left_out_where_nothing_is_left_to_learn_from(segment):
    forward = arranged(subject(3), [record(**SMALL)], Options(start="fit", segment=segment))
    _, base, weights = nominal_fits(forward)
    refitted, *others = baselines(forward, base, weights, score(forward, base, weights))
    assert np.all(np.isfinite(refitted.rms))
    assert all(np.all(np.isnan(b.rms)) and "two halves" in b.note for b in others)


def test_effects_that_cannot_act_are_not_left_out_without_a_word(rubbing):
    forward = rubbing[0]
    every = suspects(forward.model, forward.recordings, forward.drive)
    assert {s.effect for s in among(every, ["crease_friction", "adhesion"])} == {"crease_friction"}
    with pytest.raises(InputError, match=r"none of these can act.*adhesion.*air_drag.*crease_friction"):
        among(every, ["adhesion"])
    with pytest.raises(InputError, match="no such effect"):
        among(every, ["crease_frictn"])


def test_residuals_are_held_against_the_drive_that_varies(rubbing):
    forward = rubbing[0]
    assert varying_drive(forward) == (None, "rate")
    driven = Drive(field=(0, 0, sine(0.01, 1.0)))
    for drives in ([driven, Drive()], [Drive(), driven]):  # whichever recording has it
        turned = SimpleNamespace(_drives=drives, recordings=2 * forward.recordings)
        assert varying_drive(turned) == ("field_z", "drive field_z")


def test_a_recorder_is_as_likely_to_be_wrong_as_any_of_its_channels_is(rubbing):
    forward = rubbing[0]
    counts = {
        s.site: s.sites for s in suspects(forward.model, forward.recordings, forward.drive) if s.effect == "angle_scale"
    }
    channels = len(counts) - 1
    assert channels > 1 and counts.pop("the measurement") == 2 and set(counts.values()) == {2 * channels}


@pytest.mark.parametrize(
    ("there", "further", "may"),
    [
        (("crease_stiffening", "crease", (0,)), ("crease_offset", "crease", (0,)), True),
        (("crease_stiffening", "crease", (0,)), ("crease_offset", "crease", (1,)), False),
        (("crease_stiffening", "crease", (0,)), ("crease_offset", "crease", None), True),
        (("crease_stiffening", "crease", (0,)), ("eccentric_weight", "panel", (1,)), True),
        (("crease_stiffening", "crease", (0,)), ("field_lag", "drive", None), True),
        (("field_lag", "drive", None), ("crease_offset", "crease", (1,)), True),
        (("angle_offset", "measurement", None), ("crease_offset", "crease", (1,)), False),
        (("angle_offset", "measurement", (0,)), ("angle_scale", "measurement", None), False),
        # what keeps the energy leaves what keeps it, and a loss leaves losses; friction may stick like a spring
        (("tether", "panel", (1,)), ("crease_quadratic_damping", "crease", None), False),
        (("air_drag", "panel", None), ("crease_stiffening", "crease", None), False),
        (("air_drag", "panel", None), ("crease_quadratic_damping", "crease", None), True),
        (("tether", "panel", (1,)), ("crease_friction", "crease", None), True),
    ],
)
def test_what_an_inexact_law_leaves_acts_where_it_does_and_as_it_does(there, further, may):
    one, two = (Suspect(effect, "somewhere", kind, (), entities) for effect, kind, entities in (there, further))
    assert several.shares(SimpleNamespace(hypothesis=Hypothesis((one,))), two) == may


def test_where_the_best_further_effect_is_no_gain_those_near_it_are_tried(monkeypatch):
    """What has half of its squared score: the tilt, which then is a gain, but not what scores less."""
    scores = {"weak at 1": 10.0, "weak at 2": 9.0, "tilt": -8.0, "weak at 3": 2.0, "other": 6.0}
    found = [SimpleNamespace(suspect=SimpleNamespace(label=n, effect=n.split()[0]), score=v) for n, v in scores.items()]

    def explanation(*labels):
        suspects = tuple(SimpleNamespace(label=n) for n in labels)
        return SimpleNamespace(hypothesis=SimpleNamespace(suspects=suspects), failed=False, cost=50.0)

    tried = []

    def contest(forward, best, signatures, *_):
        tried.append([g.suspect.label for g in signatures])
        return [best, *(explanation("first", label) for label in tried[-1])]

    monkeypatch.setattr(several, "again", lambda *_: SimpleNamespace(signatures=found))
    monkeypatch.setattr(several, "contest", contest)
    monkeypatch.setattr(several, "shares", lambda *_: False)
    monkeypatch.setattr(several, "look_elsewhere", lambda *_, **__: 0.001)
    monkeypatch.setattr(several.words, "structure", lambda *_: SimpleNamespace(repeated=0.0))
    monkeypatch.setattr(
        several,
        "score",
        lambda forward, f, _: SimpleNamespace(evidence=1.0, label=f.hypothesis.suspects[-1].label),
    )
    monkeypatch.setattr(several, "better", lambda a, b: a.label == "tilt")
    base, best = explanation(), explanation("first")
    known = {id(best): SimpleNamespace(evidence=0.0, label="first")}
    new, told = several.further(None, best, [base, best], known, None, None, Options())  # type: ignore[arg-type]
    assert tried == [["weak at 1", "weak at 2"], ["tilt"]] and len(new) == 3
    assert told is new[-1]


def test_one_number_cannot_have_two_values():
    """All creases share an effect with each of them, all channels likewise; two creases do not, nor two channels."""
    forward = arranged(subject(3), [record(**SMALL)], Options())
    every = {s.label: s for s in suspects(forward.model, forward.recordings, forward.drive)}
    one, two, each = (every[f"crease_friction at {s}"] for s in ("crease 0", "crease 1", "all creases"))
    assert distinct_sites(one, two) and distinct_sites(two, one) and not distinct_sites(one, one)
    assert not distinct_sites(one, each) and not distinct_sites(each, two)
    left, right = (every[f"angle_offset at channel fold{n}"] for n in (1, 2))
    assert distinct_sites(left, right) and not distinct_sites(left, every["angle_offset at the measurement"])
    assert distinct_sites(left, every["angle_scale at channel fold1"])


def test_numbers_of_which_no_model_can_be_built_are_not_tried_and_end_nothing():
    """A build that refuses stiff creases, where a hypothesis asks for them."""
    plain = subject(3)

    def build(values):
        if values.get("crease.stiffness", 1.0) > 1.02:
            raise InputError("too stiff", field="crease.stiffness", value=values["crease.stiffness"], allowed="<= 1.02")
        return plain.build(values)

    refusing = replace(plain, build=build)
    forward = arranged(refusing, [record(factors={("crease", "stiffness"): 1.1}, **SMALL)], Options())
    _, base, weights = nominal_fits(forward)
    assert not base.failed and base.theta[0] <= 1.02
    (one,) = (
        s
        for s in suspects(forward.model, forward.recordings, forward.drive)
        if s.effect == "crease_friction" and s.entities == (1,)
    )
    assert forward.step(Hypothesis((one,)), np.array([1.1, 1.0, 1.0, 1e-6])) == 0.0
    screening = screen(forward, [one], base, weights)
    found = refit(forward, base, screening.signatures[0], weights, screening)
    assert found.failed or found.theta[0] <= 1.02


def test_two_that_do_the_same_are_a_tie_with_an_experiment():
    """A crease whose rest angle is off and a panel whose weight is, in a small swing of one crease."""
    off = {"crease_offset": {"offset_moment": (3e-6, [0])}}
    swing = record(off, **SMALL | {"panels": 2}, size=0.3)
    found = diagnose(subject(2), [swing], catalogue=("crease_offset", "eccentric_weight", "crease_friction"))
    assert found.verdict == "TIE"
    both = {"crease_offset at crease 0", "eccentric_weight at panel 1"}
    assert set(found.chosen) == both and all(c in found.sentence for c in both)
    assert found.experiments and set(found.experiments[0].separates) == both
    best = max(found.experiments, key=lambda e: e.expected)
    assert best.expected > 0.0 and (best.repeats > 1) == (best.expected < 5.0)


def test_what_the_catalogue_lacks_is_unknown_and_described():
    found = diagnose(subject(3), [record(FRICTION, **SMALL)], catalogue=("crease_stiffening", "crease_offset"))
    assert found.verdict == "UNKNOWN"
    assert "moment at crease 1" in found.sentence or "acts at crease 1" in found.sentence
    assert "takes energy" in found.sentence


def test_recordings_that_excite_no_suspect_test_none():
    found = diagnose(subject(3), [record(FRICTION, **SMALL)], catalogue=("crease_stop", "crease_contact"))
    assert found.verdict == "UNTESTABLE" and not found.chosen and not found.patch
    assert any("Not tested" in n and "crease_stop" in n for n in found.notes)


def test_what_leads_is_exchanged_even_if_no_further_effect_was_asked_for(monkeypatch):
    """Three explanations, each better than the one before; the pair was refused, and leads all the same."""
    base, one, pair, other = (
        SimpleNamespace(hypothesis=Hypothesis(tuple(SimpleNamespace(label=n) for n in names)))  # type: ignore[arg-type]
        for names in ("", "a", "ab", "cb")
    )
    order, calls = [base, one, pair, other], []
    monkeypatch.setattr(several, "leader", lambda fits, scores: max(fits, key=order.index))
    monkeypatch.setattr(several, "further", lambda f, best, *_: calls.append(("more", best)) or ([pair], None))
    monkeypatch.setattr(several, "spared", lambda *_: [])

    def swaps(forward, base, best, *_):
        calls.append(("exchanged", best))
        return [other] if best is pair else []

    monkeypatch.setattr(several, "swaps", swaps)
    found = several.combine(None, [base, one], {}, None, None, Options(), lambda *_: None)
    assert found == [pair, other]
    assert calls == [("more", one), ("exchanged", pair), ("exchanged", other)], "once each, and no third effect"
    calls.clear()
    monkeypatch.setattr(several, "further", lambda f, best, *_: calls.append(("more", best)) or ([], None))
    assert several.combine(None, [base, one], {}, None, None, Options(), lambda *_: None) == []
    assert calls == [("more", one)]


def test_bad_data_are_named():
    with pytest.raises(InputError, match="nothing to diagnose"):
        diagnose(subject(), [])
    short = record(duration=0.05, rate=100)
    with pytest.raises(InputError, match="too short"):
        diagnose(subject(), [short])


def test_rivals_share_the_derivatives_of_an_experiment(rubbing):
    forward, _, base, weights, screening = rubbing
    best, rival = (refit(forward, base, s, weights, screening) for s in chosen(screening, 2))
    for n, (what, _) in enumerate(experiment._menu(forward)[:3]):
        made = experiment._menu(forward)[n][1]
        assert experiment.recorded(made, best)
        fresh, _ = experiment.separation(made, rival, weights)
        _, known = experiment.separation(made, base, weights)
        again, _ = experiment.separation(made, rival, weights, known)
        # they are those under another explanation: 0.97, 1.35 and 1.32 here
        assert 0.9 < again / fresh < 1.4, what


def test_a_clamped_crease_stays_as_it_is_and_tells_at_which_crease_something_acts(rubbing):
    forward, _, base, weights, screening = rubbing
    menu = dict(experiment._menu(forward))
    clamped = menu["crease 1 clamped as it is in the reference state"]
    free = menu["repeat the same experiment"]
    nothing = np.zeros((1, len(clamped.blocks), clamped.local))
    for made, least, most in ((clamped, 0.0, 0.005), (free, 1.0, 1.2)):
        swings = [v[0] for v in made.predict(base.hypothesis, base.theta[None], nothing)]
        assert least < max(np.ptp(s[:, 1]) for s in swings) < most
        assert max(np.ptp(s[:, 0]) for s in swings) > 1.4
    friction = next(s for s in screening.signatures if s.suspect.label == "crease_friction at crease 1")
    rubs = refit(forward, base, friction, weights, screening)
    rubs = replace(rubs, theta=np.concatenate([base.theta, rubs.theta[len(base.theta) :]]))
    d = []
    for c in range(2):
        made = menu[f"crease {c} clamped as it is in the reference state"]
        assert experiment.recorded(made, rubs)
        d.append(experiment.separation(made, base, weights)[0])
    assert d[1] < 0.02 * d[0]  # what acts at a clamped crease does not show


@pytest.mark.parametrize(("second", "told", "best"), [(0.5, [0, 2], "c"), (3.5, [0, 1, 2], "b")])
def test_the_next_experiment_is_for_rivals_that_can_be_told(monkeypatch, second, told, best):
    """The nearest rival counts, but for one that nothing in the menu would tell apart."""
    apart = {"a": (6.0, 0.5, 3.0), "b": (9.0, second, 2.0), "c": (4.0, 0.1, 4.0)}
    monkeypatch.setattr(experiment, "_menu", lambda forward: [(w, w) for w in apart])
    monkeypatch.setattr(experiment, "recorded", lambda what, f: True)
    monkeypatch.setattr(experiment, "separation", lambda what, rival, *_: (apart[what][rival.number], None))

    def explanation(number):
        return SimpleNamespace(number=number, hypothesis=SimpleNamespace(label=f"rival {number}"))

    rivals = [explanation(n) for n in range(3)]
    named = explanation(-1)
    judged = SimpleNamespace(best=named, tied=[named, *rivals], others=[])
    found = experiment.propose(None, judged, None)  # pyright: ignore[reportArgumentType]
    assert found[0].what == best and found[0].separates == ["rival -1", *(f"rival {n}" for n in told)]
    assert [e.expected for e in found] == sorted((min(apart[w][n] for n in told) for w in apart), reverse=True)
    assert found[0].repeats == int(np.ceil((5.0 / found[0].expected) ** 2))


@pytest.mark.parametrize(
    ("more", "value", "words"), [(True, 0.7, "more"), (True, 0.3, "less"), (False, 0.7, "the same")]
)
def test_where_else_an_effect_may_act_is_said(more, value, words):
    free = SimpleNamespace(start=0.5)
    suspect = SimpleNamespace(free=(free, SimpleNamespace(start=0.1)), site="fold1", more=more)
    fitted = SimpleNamespace(
        hypothesis=SimpleNamespace(suspects=(suspect,)), free=(None, *suspect.free), theta=[1.0, value, 0.1]
    )
    assert verdict._elsewhere(fitted) == f"{words} at fold1"  # pyright: ignore[reportArgumentType]

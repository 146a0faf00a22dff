"""Screening, and the search for sets of effects, on a strip whose second crease rubs."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from origami_sim.design.build import Sheet
from origami_sim.diagnose import Options, Subject, diagnose, factor
from origami_sim.diagnose.arrange import arranged
from origami_sim.diagnose.baselines import baselines
from origami_sim.diagnose.experiment import propose
from origami_sim.diagnose.prepare import prepared
from origami_sim.diagnose.tables import varying_drive
from origami_sim.drive import Drive, sine
from origami_sim.errors import InputError
from origami_sim.fit.held_out import estimated, folds, predicted, refitted, without
from origami_sim.fit.hyper import HYPER
from origami_sim.fit.implied import implied, log_evidence, with_own_noise
from origami_sim.fit.least_squares import OWED, fit
from origami_sim.fit.nominal import nominal_fits
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import Hypothesis
from origami_sim.hypotheses.suspects import suspects
from origami_sim.infer.components import with_single_components
from origami_sim.infer.placement import forget
from origami_sim.infer.posterior import marginals
from origami_sim.infer.scan import at_their_strengths, over_shapes, over_their_range
from origami_sim.infer.screen import screen
from origami_sim.infer.search import better_within, continued_from, search
from origami_sim.pattern import strip
from origami_sim.recording import Channel, DriveChannel, Recording
from origami_sim.solve.motion.dynamics import simulate
from tests.diagnose.strips import record, subject
from tests.diagnose.swings import single

FRICTION = {"crease_friction": {"friction_moment": (2e-5, [1])}}
FEW = ("crease_friction", "air_drag", "crease_stiffening", "crease_offset")
SMALL = {"duration": 4.0, "panels": 3, "rate": 100}


def missed(forward, f) -> float:
    """Root mean square of what a fit leaves, over the noise, in the channel of which it leaves most."""
    return float(np.nanmax(f.rms() / forward.blocks[0].noise))


@pytest.fixture(scope="module")
def rubbing():
    """The nominal fits and the signatures of a strip with dry friction at its second crease."""
    recordings = prepared([record(FRICTION, **SMALL)], 200.0)
    forward, _ = arranged(subject(3), recordings, Options())
    given, base, weights = nominal_fits(forward)
    every = [s for s in suspects(forward.model, recordings, forward.drive) if s.effect in FEW]
    return forward, given, base, weights, screen(forward, every, base, weights)


@pytest.fixture(scope="module")
def found(rubbing):
    forward, _, base, weights, signatures = rubbing
    return search(forward, base, signatures, weights)


def test_the_nominal_refit_is_no_worse_than_the_model_as_given(rubbing):
    _, given, base, _, _ = rubbing
    assert base.cost <= given.cost * (1 + 1e-9)


def test_the_effect_its_site_and_its_strength_are_found(found, rubbing):
    chance = found.probabilities()
    assert sum(chance.values()) == pytest.approx(1.0)
    best = max(found.nodes, key=lambda k: chance[k])
    assert found.label(best) == "crease_friction at crease 1" and chance[best] > 0.5
    f = found.nodes[best].fit
    numbers = {n.label: t for n, t in zip(f.free, f.theta, strict=True)}
    assert numbers["crease_friction.friction_moment"] == pytest.approx(2e-5, rel=0.2)
    assert missed(rubbing[0], f) < 1.1 and missed(rubbing[0], rubbing[2]) > 10.0
    assert marginals(found)["crease_friction at crease 1"] > 0.5


def test_the_most_probable_set_is_fitted_however_few_fits_are_allowed(rubbing):
    forward, _, base, weights, signatures = rubbing
    out = search(forward, base, list(signatures), weights, most=0)
    chance = out.probabilities()
    assert max(chance, key=lambda k: chance[k]) in out.nodes


def test_another_yield_angle_is_found_about_a_fit_that_ended_with_a_wrong_one(found, rubbing):
    forward, _, _, weights, _ = rubbing
    best = next(n.fit for k, n in found.nodes.items() if found.label(k) == "crease_friction at crease 1")
    right = fit(forward, best.hypothesis, weights, theta=best.theta, local=best.local)
    assert (over_shapes(forward, right, weights) or (0, 0.0))[1] < 1.0
    (one,) = best.hypothesis.suspects
    held = tuple(replace(f, lower=0.0299) if f.name == "yield_angle" else f for f in one.free)
    begin = np.append(best.theta[:-1], 0.03)
    wrong = fit(forward, Hypothesis((replace(one, free=held),)), weights, theta=begin, local=best.local)
    stuck = replace(wrong, hypothesis=best.hypothesis, free=best.free)
    assert stuck.theta[-1] == pytest.approx(0.03, rel=0.01)
    theta, gain = over_shapes(forward, stuck, weights)
    assert gain > 10.0 and theta[-1] < 0.02
    assert fit(forward, best.hypothesis, weights, theta=theta, local=best.local).cost < 1.01 * right.cost < stuck.cost


def test_a_set_that_is_fitted_again_is_polished_again(found):
    """Evidence of fits with stale derivatives by starts is not comparable with that of polished ones."""
    key = next(iter(found.polished))
    other = replace(found, **{n: dict(getattr(found, n)) for n in ("nodes", "estimates")}, polished=set(found.polished))
    other = replace(other, **{n: dict(getattr(found, n)) for n in ("log", "total", "promise")})
    forget(other, key)
    assert key not in other.nodes and key not in other.polished and key in found.polished


def test_gaps_and_noise_of_a_fit_are_more_probable_than_those_beside_them(rubbing):
    """From white noise with any gaps they are the same; noise that is better is taken where it is known."""
    forward, _, base, _, _ = rubbing
    deviation = forward.blocks[0].noise
    colour = tuple(np.array([1.0, 0.6, 0.3]) for _ in deviation)
    starts = [Weights(deviation, gap=1e-1), Weights(deviation, gap=1e-5), Weights(2 * deviation, colour, gap=1e-2)]
    *white, coloured = (with_own_noise(forward, base.reweighted(w), HYPER)[0] for w in starts)
    logs = [log_evidence(f) for f in white]
    assert np.ptp(logs) < 1e-3 < log_evidence(coloured) - logs[0]
    for f, log in zip(white, logs, strict=True):
        around = implied(forward, f.reweighted(Weights(f.weights.deviation, gap=f.weights.gap)), HYPER)
        beside = [other for other, w in around if w.gap != f.weights.gap]
        assert beside and max(beside) <= log + 1e-6
    again, owed = with_own_noise(forward, base, HYPER, [coloured.weights])
    assert log_evidence(again) > log_evidence(coloured) - OWED and owed < OWED


def test_what_is_held_out_is_judged_in_one_noise_for_all(found, rubbing):
    """A good fit in tight noise of its own, and in that of the model it is compared with."""
    forward, _, base, weights, _ = rubbing
    best = next(n.fit for k, n in found.nodes.items() if found.label(k) == "crease_friction at crease 1")
    one, other = (estimated(forward, f, weights).rms for f in (best, best.reweighted(weights)))
    assert one == pytest.approx(other, rel=0.1)
    assert one[1] < 0.1 * estimated(forward, base, weights).rms[1]


def test_nothing_is_found_of_a_strip_as_it_is():
    forward, _ = arranged(subject(3), prepared([record(seed=4, **SMALL)], 200.0), Options())
    _, base, weights = nominal_fits(forward)
    every = [s for s in suspects(forward.model, forward.recordings, forward.drive) if s.effect in FEW]
    found = search(forward, base, screen(forward, every, base, weights), weights)
    chance = found.probabilities()
    assert max(chance, key=lambda k: chance[k]) == frozenset() and chance[frozenset()] > 0.6


def test_a_set_that_is_likely_never_fits_worse_than_one_that_it_contains(found, rubbing):
    forward = rubbing[0]
    chance = found.probabilities()
    for key, node in found.nodes.items():
        for other, smaller in found.nodes.items():
            if other < key and chance[key] > 0.05:
                larger, fewer = missed(forward, node.fit), missed(forward, smaller.fit)
                assert larger <= 1.02 * fewer, (found.label(key), found.label(other))


def test_a_fit_that_went_astray_is_begun_again_from_the_best_set_within_it(found, rubbing):
    """With drag beside the friction that was found, from numbers that have no friction."""
    forward = rubbing[0]
    (rubs,) = (k for k in found.nodes if found.label(k) == "crease_friction at crease 1")
    (drag,) = (n for n, s in enumerate(found.signatures) if s.suspect.label == "air_drag at all panels")
    node, key = found.nodes[rubs], rubs | {drag}
    hypothesis = Hypothesis(tuple(found.suspect(n) for n in sorted(key)))
    astray = fit(forward, hypothesis, node.fit.weights, local=node.fit.local, most=0)
    assert better_within(found, astray, key) is node
    again = continued_from(found, forward, key, node)
    assert again.cost < node.fit.cost + OWED and better_within(found, again, key) is None


def test_what_all_creases_do_is_the_sum_of_what_each_does(rubbing):
    signatures = {s.suspect.label: s for s in rubbing[4]}
    each = [signatures[f"air_drag at panel {n}"] for n in (1, 2)]
    both = signatures["air_drag at all panels"]
    for n, part in enumerate(both.parts):
        whole = sum(s.parts[n] / s.size for s in each) * both.size
        assert np.abs(part - whole).max() <= 1e-9 * np.abs(whole).max()


def test_numbers_of_which_no_model_can_be_built_are_not_tried_and_end_nothing():
    """A build that refuses stiff creases, where a hypothesis asks for them."""
    plain = subject(3)

    def build(values):
        if values.get("crease.stiffness", 1.0) > 1.02:
            raise InputError("too stiff", field="crease.stiffness", value=values["crease.stiffness"], allowed="<= 1.02")
        return plain.build(values)

    refusing = replace(plain, build=build)
    swing = record(factors={("crease", "stiffness"): 1.1}, **SMALL)
    forward, _ = arranged(refusing, [swing], Options(panels="elastic"))
    _, base, weights = nominal_fits(forward)
    assert not base.failed and base.theta[0] <= 1.02
    (one,) = (
        s
        for s in suspects(forward.model, forward.recordings, forward.drive)
        if s.effect == "crease_friction" and s.entities == (1,)
    )
    assert forward.step(Hypothesis((one,)), np.array([1.1, 1.0, 1.0, 1e-6])) == 0.0
    assert screen(forward, [one], base, weights)
    theta = np.concatenate([base.theta, [f.start for f in one.free]])
    found = fit(forward, Hypothesis((one,)), weights, theta=theta, local=base.local)
    assert found.failed or found.theta[0] <= 1.02


def test_residuals_are_held_against_the_drive_that_varies(rubbing):
    forward = rubbing[0]
    assert varying_drive(forward) == (None, "rate")
    driven = Drive(field=(0, 0, sine(0.01, 1.0)))
    for drives in ([driven, Drive()], [Drive(), driven]):  # whichever recording has it
        turned = SimpleNamespace(drives=drives, recordings=2 * forward.recordings)
        assert varying_drive(turned) == ("field_z", "drive field_z")


def test_what_one_stretch_tells_alone_is_not_known_when_it_is_left_out(rubbing):
    """One fold alone asks for another number: it is told that number by the others, which know nothing of it."""
    forward, _, base, *_ = rubbing
    line, first = base.linear, folds(forward, base.blocks)[0]
    asks = [
        3.0 * t[:, 0] if n in first else 0.0 * r
        for n, (r, t) in enumerate(zip(line.residual, line.tangent, strict=True))
    ]
    wide = tuple(replace(f, spread=np.inf) for f in base.free)
    left = estimated(forward, replace(base, free=wide, linear=replace(line, residual=asks)), base.weights)
    squares = np.sum(left.folds**2, axis=1)
    assert len(squares) == 5 and squares[0] > 3.0 * max(squares[1:])


def test_errors_by_simulation_are_those_of_fits_to_all_else(found, rubbing):
    """Beside fits with derivatives and starts of their own: these gain no more, and predict what is left out alike."""
    forward, _, _, weights, _ = rubbing
    best = next(n.fit for k, n in found.nodes.items() if found.label(k) == "crease_friction at crease 1")
    fits, whole = refitted(forward, best), set(best.blocks)
    rest = [sorted(whole - {best.blocks[n] for n in part}) for part in folds(forward, best.blocks)]
    begin = {"theta": best.theta, "weights": best.weights}
    anew = [fit(forward, f.hypothesis, blocks=some, **begin) for f, some in zip(fits, rest, strict=True)]
    assert all(f.cost < other.cost + OWED and f.blocks == other.blocks for f, other in zip(fits, anew, strict=True))
    errors = predicted(forward, fits, weights)
    assert errors.folds.shape == (5, 2)
    assert errors.folds == pytest.approx(predicted(forward, anew, weights).folds, rel=0.005)


def test_a_strength_of_which_one_stretch_alone_tells_is_none_when_that_is_left_out(found, rubbing):
    """No number is kept that only what is held out tells, and none is sought that follows the rest's noise."""
    forward = rubbing[0]
    best = next(n.fit for k, n in found.nodes.items() if found.label(k) == "crease_friction at crease 1")
    last, column = folds(forward, best.blocks)[-1], len(forward.subject.nominals)
    tangent = [t.copy() for t in best.linear.tangent]
    for n, t in enumerate(tangent):
        t[:, column] *= n in last
    alone = replace(best, linear=replace(best.linear, tangent=tangent))
    for f, left in ((alone, 0.0), (best, 1.0)):
        ((step, _),) = without(f, [last])
        now = f.theta[column] / f.free[column].scale
        assert now > 0 and now + step[column] == pytest.approx(left * now, abs=0.1 * now)


LEVELS = [
    ((1.0, 2.0, 1.01, 2.0), [[0, 1, 4, 5], [2, 3, 6, 7]]),  # repeats tell what they are to predict
    ((1.0, 1.0, 1.0, 1.0), [[0, 1], [2, 3], [4, 5], [6, 7]]),
    ((None, None, None, None), [[0, 1], [2, 3], [4, 5], [6, 7]]),
    ((None, 1.0, 1.0, None), [[0, 1], [2, 3, 4, 5], [6, 7]]),
]


@pytest.mark.parametrize(("levels", "parts"), LEVELS)
def test_recordings_of_one_drive_level_are_held_out_together(levels, parts):
    def recorded(level):
        t = np.linspace(0.0, 1.0, 11)
        values = np.stack([0.0 * t, -(level or 0.0) * np.sin(7.0 * t)], axis=1)
        drive = {} if level is None else {"field": DriveChannel("field", values, "T", False)}
        return Recording("a", t, {}, drive)

    forward = SimpleNamespace(
        recordings=[recorded(level) for level in levels],
        blocks=[SimpleNamespace(recording=n // 2) for n in range(8)],
    )
    assert folds(forward, range(8)) == parts


def test_baselines_are_left_out_where_nothing_is_left_to_learn_from():
    forward, _ = arranged(subject(3), [record(**SMALL)], Options(start="fit", segment=99.0))
    _, base, weights = nominal_fits(forward)
    fits = refitted(forward, base)
    plain, *others = baselines(forward, fits, weights, predicted(forward, fits, weights).rms)
    assert np.all(np.isfinite(plain.rms))
    assert others and all(np.all(np.isnan(b.rms)) and "several segments" in b.note for b in others)


def test_a_recording_that_is_one_segment_has_the_errors_of_its_fit():
    """Without it there is nothing to refit to: numbers as they were given predict it worse by any measure."""
    forward, _ = arranged(subject(3), [record(**SMALL)], Options(start="fit", segment=99.0))
    _, base, weights = nominal_fits(forward)
    moved = replace(base, theta=base.theta * 1.01)
    assert len(forward.blocks) == 1 and refitted(forward, moved)[0].theta == pytest.approx(moved.theta, rel=1e-12)
    for found in (estimated(forward, base, weights), predicted(forward, refitted(forward, base), weights)):
        assert found.rms == pytest.approx(base.rms(), rel=0.02)


def test_what_acts_at_a_crease_is_told_least_where_that_crease_is_clamped(rubbing, found):
    """Friction at the second crease against nothing missing: clamping that crease is no experiment for it."""
    forward, _, base, weights, _ = rubbing
    best = next(n.fit for k, n in found.nodes.items() if found.label(k) == "crease_friction at crease 1")
    # with the same numbers of the model: these differ by what friction was taken for
    best = replace(best, theta=np.concatenate([base.theta, best.theta[len(base.theta) :]]))
    menu = {e.what: e for e in propose(forward, [best, base], np.array([0.5, 0.5]), weights, most=99)}
    clamped = [menu[f"crease {c} clamped as it is in the reference state"].information for c in (0, 1)]
    assert clamped[0] > 0.95 and clamped[1] < 0.2
    for e in menu.values():
        assert e.entropy == 1.0 and 0.0 <= e.information <= 1.0
        assert e.separates == ["crease_friction at crease 1", "nominal"]


def test_what_could_stand_in_the_place_of_the_best_effect_is_fitted_also_in_coloured_noise():
    """A zero that is off, of a camera that smooths: for an arm that hangs it is a lean of the stand, or a weight."""
    module, s = single()
    model, parameters, drive = module.build(s.replace(angle_1=1.2))
    start = module.start(s.replace(angle_1=1.2), model)
    motion = simulate(model, parameters, drive, duration=6.0, rate=120, state=start)
    noise = 5.6e-3 * np.random.default_rng(1).normal(size=len(motion.times) + 2)
    smooth = np.convolve(noise, [0.25, 0.5, 0.25], "valid")
    angle = module.arm_angles(motion, s)[:, 0] + 4e-3 + smooth
    channel = Channel("theta1", "panel_angle", angle, "rad", 3.4e-3, {"panel": "arm1"})
    arm = Subject.from_scene(module, s, spreads={"mass_1": 0.01 * s.mass_1, "viscosity_1": 5e-5})
    found = diagnose(arm, [Recording("swing", motion.times, {"theta1": channel})], Options(threads=1))
    chance = {c.label: c.probability for c in found.candidates}
    assert found.verdict == "TIE"
    assert min(chance["angle_offset at the measurement"], chance["gravity_tilt at the body"]) > 0.1


def test_one_law_by_two_names_is_a_tie():
    """Of a single panel, air drag and a loss of its crease that grows with the square of the rate are the same."""
    effects = {"air_drag": {"drag_coefficient": (1.0, None)}, "crease_friction": {"friction_moment": (2e-5, [0])}}
    swing = record(effects, panels=2, duration=4.0, noise=2e-4, seed=2)
    forward, _ = arranged(subject(2), prepared([swing], 200.0), Options())
    _, base, weights = nominal_fits(forward)
    some = ("crease_friction", "air_drag", "crease_quadratic_damping")
    every = [s for s in suspects(forward.model, forward.recordings, forward.drive) if s.effect in some]
    found = search(forward, base, screen(forward, every, base, weights), weights)
    total = {found.effects(k): found.total[k] for k in found.nodes}
    drag, loss = (total[frozenset(("crease_friction", name))] for name in ("air_drag", "crease_quadratic_damping"))
    assert abs(drag - loss) < 0.6 and max(total.values()) == max(drag, loss)


def test_what_friction_remembers_is_of_each_worlds_own_motion():
    """A heavier model is predicted alike beside another and alone: derivatives by its mass are of its own motion."""
    swing = record({"crease_friction": {"friction_moment": (2e-5, [0])}}, panels=2, duration=4.0, noise=2e-4)
    forward, _ = arranged(subject(2), prepared([swing], 200.0), Options())
    every = suspects(forward.model, forward.recordings, forward.drive)
    (one,) = (s for s in every if s.label == "crease_friction at crease 0")
    given = np.array([1.0, 1.0, 1.0, 2e-5, 0.01])
    heavier = given * (1.0, 1.0, 1.05, 1.0, 1.0)
    local = np.zeros((2, len(forward.blocks), forward.local))
    beside = forward.predict(Hypothesis((one,)), np.array([given, heavier]), local)
    alone = forward.predict(Hypothesis((one,)), heavier[None], local[:1])
    assert max(np.abs(b[1] - a[0]).max() for b, a in zip(beside, alone, strict=True)) < 1e-12
    assert max(np.abs(b[0] - a[0]).max() for b, a in zip(beside, alone, strict=True)) > 0.02


def test_signatures_are_of_the_strengths_that_explain_most():
    """Friction that holds is no multiple of what a third of it does; drag would have to push, and stays as it was."""
    effects = {"air_drag": {"drag_coefficient": (1.0, None)}, "crease_friction": {"friction_moment": (2e-5, [0])}}
    forward, _ = arranged(subject(2), prepared([record(effects, panels=2, duration=4.0, noise=2e-4)], 200.0), Options())
    _, base, weights = nominal_fits(forward)
    some = ("crease_friction", "air_drag")
    every = [s for s in suspects(forward.model, forward.recordings, forward.drive) if s.effect in some]
    before = screen(forward, every, base, weights)
    after = at_their_strengths(forward, before, base, weights)
    size = {s.suspect.effect: (float(s.size[0]), float(t.size[0])) for s, t in zip(before, after, strict=True)}
    assert size["crease_friction"][0] < 1e-5 and size["crease_friction"][1] == pytest.approx(2e-5, rel=0.2)
    assert size["air_drag"][0] == size["air_drag"][1]
    assert not any(s.status for s in after)


def test_components_of_a_vector_are_screened_alone_as_beside_it():
    sheet = Sheet(strip([0.02] * 3, 0.02), thickness="1 mm", material="pdms", panels="rigid").fix(panels=[0])
    sheet.crease(stiffness="1 mN m/rad", loss_time="5 ms").gravity()
    for panel in (1, 2):
        sheet.magnetise(panel, remanence="50 mT", volume="400 mm^3", poling=(1, 0, 0))
    model, parameters = sheet.build()
    drive = Drive(field=(0.0, 0.0, sine("5 mT", "2 Hz")))
    run, rng = simulate(model, parameters, drive, duration=1.0, rate=100), np.random.default_rng(0)
    read = run.creases[:, :, 0] + 1e-3 * rng.normal(size=(len(run.times), 2))
    channels = {f"fold{k}": Channel(f"fold{k}", "crease_angle", read[:, k], "rad", 1e-3, {"crease": k}) for k in (0, 1)}
    known = Subject.from_model(model, parameters, drive, [factor("crease.stiffness", 0.05)])
    forward, _ = arranged(known, prepared([Recording("swing", run.times, channels)], 200.0), Options())
    _, base, weights = nominal_fits(forward)
    every = [s for s in suspects(model, forward.recordings, drive, parameters) if s.effect == "poling_error"]
    found = with_single_components(screen(forward, every, base, weights))
    again = screen(forward, [s.suspect for s in found], base, weights, sized=True)
    assert len(found) == 3 * len(every) == 9
    assert [s.suspect.label for s in again] == [s.suspect.label for s in found]
    assert [len(s.size) for s in again] == [len(s.size) for s in found] == [2, 1, 1] * 3


def test_an_effect_that_can_act_at_one_crease_is_no_suspect_at_all_of_them():
    """Where one of two creases is a dielectric hinge, its permittivity at all creases is that of the hinge."""
    sheet = Sheet(strip([0.02] * 3, 0.02), thickness="0.25 mm", material="pet", panels="rigid").fix(panels=[0])
    sheet.crease([1], stiffness="0.1 mN m/rad", loss_time="8 ms").gravity((9.81, 0, 0))
    sheet.electrode([0], layers=4, notch="6 mm", layer_thickness="0.1 mm", film_thickness="50 um", loss_time="8 ms")
    model, parameters = sheet.build()
    drive = Drive(voltage=sine("2 kV", "1 Hz"))
    run = simulate(model, parameters, drive, duration=0.5, rate=100)
    channels = {
        f"f{k}": Channel(f"f{k}", "crease_angle", run.creases[:, k, 0], "rad", 1e-3, {"crease": k}) for k in (0, 1)
    }
    known = Subject.from_model(model, parameters, drive, [factor("crease.stiffness", 0.05)])
    forward, _ = arranged(known, prepared([Recording("swing", run.times, channels)], 200.0), Options())
    _, base, weights = nominal_fits(forward)
    every = suspects(model, forward.recordings, drive, parameters)
    some = [s for s in every if s.effect in ("strain_permittivity", "crease_friction")]
    acting = {s.suspect.label for s in screen(forward, some, base, weights) if not s.status}
    assert acting == {f"crease_friction at {site}" for site in ("crease 0", "crease 1", "all creases")} | {
        "strain_permittivity at crease 0"
    }


def test_a_scan_of_strengths_ends_with_the_time(rubbing):
    """A search went on for as long as its limit again, as the scan told its progress and did not hear the answer."""
    forward, _, base, weights, signatures = rubbing
    some, told = [s.suspect for s in signatures if s.suspect.effect == "crease_friction"], []

    def progress(part: float) -> bool:
        told.append(part)
        return part < 0.5

    found = list(over_their_range(forward, some, base, weights, progress))
    rubs = [s.label for s in some].index("crease_friction at crease 1")
    assert len(found) == len(some) == 3 and rubs == 1 and told == [0.0, 1 / 3, 2 / 3]
    assert found[rubs] is not None and found[2] is None

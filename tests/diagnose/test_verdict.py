"""What a verdict is made of: sets of explanations, and words for what is left."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from origami_sim.fit.evidence import Group, Summed
from origami_sim.fit.hyper import HYPER
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import Free, Hypothesis, Suspect
from origami_sim.infer.budget import Budget, Share, shapley
from origami_sim.infer.posterior import Estimate, Node, Posterior, realised_part
from origami_sim.infer.screen import LATE, Signature
from origami_sim.locate.describe import described
from origami_sim.locate.places import Acting, Curve, Place
from origami_sim.verdict.decide import credible, decide, shared_out
from origami_sim.verdict.sentences import explains, in_all, places, undecided
from origami_sim.verdict.words import change, joined, said, say, title


def test_the_explanations_that_are_stated_hold_95_per_cent_and_none_only_adds_to_another():
    none, a, b, ab = frozenset(), frozenset("a"), frozenset("b"), frozenset("ab")
    assert credible({a: 0.97, none: 0.03}) == ([a], 0.97)
    assert credible({a: 0.6, b: 0.3, none: 0.1}) == ([a, b, none], pytest.approx(1.0))
    named, total = credible({a: 0.7, ab: 0.2, b: 0.06, none: 0.04})
    assert named == [a, b] and total == pytest.approx(0.96)
    assert credible({ab: 0.6, a: 0.4})[0] == [ab, a], "of the two the simpler one is another explanation"
    assert credible({none: 0.6, a: 0.4})[0] == [none, a]


def test_what_a_fit_explains_goes_to_the_parts_by_what_they_change():
    x, y, z = np.eye(3)
    assert shapley([3.0 * x, 2.0 * y, z]) == pytest.approx(np.array([9.0, 4.0, 1.0]) / 14.0)
    assert shapley([0.0 * x, x + y]) == pytest.approx([0.0, 1.0]), "what did not move explains nothing"
    assert shapley([x, x]) == pytest.approx([0.5, 0.5]) and shapley([2.0 * x, x]) == pytest.approx([2 / 3, 1 / 3])
    # two that nearly cancel are one, whatever their sizes; the rest keeps its own
    parts = shapley([x, 100.0 * y, -99.0 * y])
    assert parts[0] == pytest.approx(0.5) and parts[1] == pytest.approx(0.5 * 100**2 / (100**2 + 99**2))
    assert shapley([-0.1 * x, 1.1 * x]) == pytest.approx([0.01 / 1.22, 1.21 / 1.22])


def test_words_are_those_of_a_physicist():
    assert joined(["a", "b", "c"]) == "a, b and c" and joined(["a"]) == "a"
    assert said(1.03, "-") == "1.03" and said(0.0123, "rad").endswith("rad")
    assert said(0.391, "SI") == "0.391", "what a device states without a unit has none"
    assert title("air_drag")[0].islower() and "_" not in title("air_drag")


def place(law, *, memory=0.0, share=0.9) -> Place:
    """A crease that misses a moment law(angle, rate), and one that goes with neither, in a swing that dies."""
    rng, t = np.random.default_rng(0), np.linspace(0.0, 40.0 * np.pi, 4000)
    angle, rate = np.array([np.sin(t), np.cos(t)]) * np.linspace(1.0, 0.2, len(t))
    moment = law(angle, rate) + memory * np.sign(np.sin(t / 20.0)) + 0.1 * rng.normal(size=len(t))
    curves = []
    for name, x in (("angle", angle), ("rate", rate)):
        parts = np.array_split(np.argsort(x), 13)
        mean, error = (np.array([f(moment[p]) for p in parts]) for f in (np.mean, np.std))
        counts = [len(p) for p in parts]
        curves.append(
            Curve(name, "rad", [x[p].mean() for p in parts], list(mean), list(error / np.sqrt(counts)), counts)
        )
    power = float(np.mean(moment * rate))
    return Place("fold1", 9.0, share, power, 0.0, list(t), list(moment), [0.1] * len(t), curves)


@pytest.mark.parametrize(
    "law, words",
    [
        (lambda a, w: -np.sign(w), ("goes with the rate at fold1 (", "odd in the rate", "takes energy")),
        (lambda a, w: 0.5 * w**3, ("odd in the rate", "gives energy")),
        (lambda a, w: a**3, ("goes with the angle at fold1 (", "odd in the angle", "keeps the energy")),
        (lambda a, w: a**2, ("goes with the angle at fold1 (", "even in the angle", "keeps the energy")),
    ],
)
def test_what_is_left_is_described_by_what_it_goes_with(law, words):
    said = described([place(law), place(lambda a, w: 0.0 * a, share=0.1)], [])
    assert said.startswith("What is left acts at fold1, ") and all(w in said for w in words)
    assert "memory" not in said
    assert "; the rest has a memory, or comes from outside" in described([place(law, memory=2.0)], [])


def test_what_is_left_is_placed_by_the_actions_that_leave_least():
    actions = [Acting("moment on", "panel2", 1.0, [], "", 0.0), Acting("moment at", "fold1", 1.1, [], "", 0.0)]
    far = Acting("moment at", "fold3", 4.0, [], "", 0.0)
    said = described([place(lambda a, w: a)], [*actions, far], "What is missing")
    assert said.startswith("What is missing acts like a moment on panel2 or a moment at fold1, goes")
    assert described([], [far]) == ""
    assert "acts at several places" in described([place(lambda a, w: a, share=0.4)], [])


@pytest.mark.parametrize(
    ("named", "rest", "over", "missing", "word"),
    [
        (0.1, 0.02, 1.0, 0.0, "MECHANISM"),
        (0.001, 0.02, 1.0, 0.99, "UNKNOWN"),  # forces are missing, though numbers explain nearly all
        (0.001, 0.02, 3.0, 0.0, "UNKNOWN"),  # no forces, but three times the noise
        (0.001, 0.02, 1.0, 0.2, "MECHANISM"),  # nothing shows that the rest is real
        (0.001, 0.02, 1.0, 0.4, "UNKNOWN"),  # it may well be: what is named is less probable than a law outside
        (0.1, 0.02, 3.0, 0.99, "MECHANISM"),  # more is named than left
    ],
)
def test_unknown_is_what_leaves_more_than_it_names_and_leaves_something_real(named, rest, over, missing, word):
    drag = Suspect("air_drag", "all panels", "panel", (Free("air_drag", "drag_coefficient", "-", 0.0, 1.0),))
    p = Posterior([Signature(drag, [np.zeros(0)], 1.0)], Weights(np.ones(1)))
    cells = np.where(HYPER.clean, (1.0 - missing) / HYPER.clean.sum(), missing / (~HYPER.clean).sum())
    with np.errstate(divide="ignore"):
        p.log = {frozenset(): np.log(cells) - 20.0, frozenset({0}): np.log(cells)}
    p.total = {frozenset(): -20.0, frozenset({0}): 0.0}
    p.nodes = cast(dict, dict.fromkeys(p.total))
    parts = ("numbers", 1.0 - named - rest), ("effect", named), ("rest", rest)
    budget = Budget([Share(kind, kind, share) for kind, share in parts], over, beyond=named)
    assert decide(p, lambda key: budget).word == word


@pytest.mark.parametrize(("pushed", "word"), [(0.7, ""), (0.9, "UNKNOWN")])
def test_forces_that_act_now_and_then_are_unknown(pushed, word):
    p = posterior({(): 0.0, ("air_drag",): -9.0})
    shares = [Share("", "numbers", 0.99), Share("", "rest", 0.01)]
    assert decide(p, lambda key: Budget(shares, 1.0, pushed)).word == word


@pytest.mark.parametrize(
    ("effects", "word", "foreign"),
    [
        (("air_drag",), "MECHANISM", 0.07 / 1.07),
        (("air_drag", "crease_friction"), "SEVERAL", 0.28 / 1.28),
        (("air_drag", "angle_offset", "clock_rate"), "SEVERAL", 0.07 / 1.07),  # what a recorder does imitates no law
        (("angle_offset",), "MEASUREMENT", 0.07 / 1.07),
    ],
)
def test_a_law_that_the_catalogue_lacks_may_be_imitated(effects, word, foreign):
    decided = decide(posterior({effects: 0.0, (): -50.0}), lambda key: Budget([Share("", "effect", 1.0)], 1.0))
    assert (decided.word, decided.foreign) == (word, pytest.approx(foreign))
    assert decided.lead == set(effects) and decided.probability == pytest.approx(1.0 - foreign)


@pytest.mark.parametrize(("rest", "real", "foreign"), [(0.0, 1.0, 0.07), (0.2, 0.0, 0.07), (0.2, 1.0, 0.9)])
def test_what_is_left_may_be_the_part_of_one_law_that_is_not_imitated(rest, real, foreign):
    """A fifth that is real needs a further law (0.3) beside the named one; a fourth of that may be left of any law."""
    shares = [Share("", "effect", 1.0 - rest), Share("", "rest", rest)]
    budget = Budget(shares, 1.0, real=real, beyond=1.0 - rest)
    decided = decide(posterior({("air_drag",): 0.0, (): -50.0}), lambda key: budget)
    odds = 0.07 + real * 0.25 / 0.3 if rest else 0.07
    assert odds == pytest.approx(foreign, abs=0.01) and decided.word == "MECHANISM"
    assert decided.probability == pytest.approx(1.0 / (1.0 + odds))
    two = decide(posterior({("air_drag", "crease_friction"): 0.0, (): -50.0}), lambda key: budget)
    assert two.word == ("SEVERAL" if odds < 0.5 else "UNKNOWN"), "nothing is found that is less probable than not"


@pytest.mark.parametrize(("left", "word"), [(0.1, "SEVERAL"), (0.6, "UNKNOWN")])
def test_many_laws_are_not_named_but_the_few_that_explain_most(left, word):
    """Three laws are 1500 more probable (in the logarithm) than two of them; those are named if they explain most."""
    three = ("air_drag", "crease_friction", "crease_softness")
    p = posterior({three: 0.0, three[:2]: -1500.0, three[1:]: -1520.0, three[:1]: -1600.0, (): -2000.0})
    p.realised = {frozenset(): [(5.0, 7.0, 2.0)]}
    shares = [Share("", "effect", 1.0 - left), Share("", "rest", left)]
    decided = decide(p, lambda key: Budget(shares, 1.0 + 10.0 * left, beyond=1.0 - left))
    assert decided.word == word and decided.lead == set(three[:2])
    if word == "SEVERAL":
        assert decided.probability == pytest.approx(1.0 / 1.28)


def test_weak_estimates_stay_as_probable_though_a_strong_one_was_too_high():
    """What is linear errs in proportion to how far it goes: of what promised nothing there is nothing to take."""
    p = posterior({(): 0.0, ("air_drag",): -1.0, ("clock_rate",): -1.0})
    for key, gain in zip([k for k in p.total if k], (4.0, -0.5), strict=True):
        del p.nodes[key]
        p.estimates[key] = Estimate(frozenset(), (), np.zeros(0), (1, 0.0), gain)
    drag, clock = p.estimates
    before = p.probabilities()
    p.realised = {frozenset(): [(20.0, 30.0, 5.0), (4.0, 6.0, -9.0)]}
    assert realised_part([(20.0, 5.0), (4.0, -9.0)]) == pytest.approx(100.0 / 416.0)
    after = p.probabilities()
    assert after[clock] / after[frozenset()] == pytest.approx(before[clock] / before[frozenset()])
    lost = np.log(before[drag] / before[frozenset()]) - np.log(after[drag] / after[frozenset()])
    assert lost == pytest.approx(4.0 * (1.0 - 100.0 / 416.0))


def test_what_acts_in_every_explanation_is_said_once():
    effects: list[str] = ["air_drag", "crease_friction", "clock_delay"]
    drag, friction, delay = (frozenset((e,)) for e in effects)
    assert not in_all(drag, [drag, friction])
    text = undecided(frozenset(), [drag, friction], {drag: 0.6, friction: 0.3}, "")
    assert text.startswith("These recordings do not decide between ") and "(p = 0.60) and" in text
    chances = {friction | drag: 0.6, friction | delay: 0.3}
    assert in_all(friction, list(chances)) == friction
    text = undecided(friction, list(chances), chances, "1 effect with 0.2 mN m")
    assert text.startswith("Found: 1 effect with 0.2 mN m; besides, these recordings do not decide between ")
    assert "dry friction" not in text and text.count(" with ") == 1


@pytest.mark.parametrize(("apart", "listed"), [(0.3, 5), (6.0, 0)])
def test_of_effects_that_nothing_tells_apart_all_are_listed(apart, listed):
    """Five ways to be late beside a friction: predictions differ by less than all data together see, or by more."""
    late = ("clock_delay", "drive_delay", "exposure", "field_lag", "tracker_lag")
    logs = {("crease_friction", e): -0.3 * n for n, e in enumerate(late)}
    p = posterior({**logs, ("crease_friction",): -90.0, (): -99.0})
    predicted(p, {effects: apart * n / (len(late) - 1) for n, effects in enumerate(logs)})
    decided = decide(p, lambda key: Budget([Share("", "effect", 1.0)], 1.0))
    assert decided.lead == {"crease_friction"} and decided.word == ("TIE" if listed else "MECHANISM")
    assert not listed or decided.credible == [frozenset(e) for e in logs]
    assert decided.probability > 0.7


@pytest.mark.parametrize(
    ("apart", "owed", "log", "tie"),
    [(0.5, 0.0, -1.7, True), (1.8, 0.0, -1.7, False), (1.8, 1.5, -1.7, True), (0.5, 0.0, -9.0, False)],
)
def test_what_only_priors_tell_apart_is_a_tie(apart, owed, log, tie):
    """A loss of the hinge of a single arm and the air's drag on it, beside a friction; a rival of 1e-4 is none."""
    two = ("crease_friction", "crease_quadratic_damping"), ("air_drag", "crease_friction")
    p = posterior({two[0]: 0.0, two[1]: log, ("crease_friction",): -90.0, (): -99.0})
    predicted(p, {two[0]: 0.0, two[1]: apart}, owed)
    decided = decide(p, lambda key: Budget([Share("", "effect", 1.0)], 1.0))
    assert decided.word == ("TIE" if tie else "SEVERAL")
    assert decided.credible[:2] == [frozenset(e) for e in two] if tie else decided.lead == set(two[0])


def test_a_rival_counts_only_where_it_acts_in_place_of_what_predicts_the_same():
    """An offset that is probable only beside the scale is no alternative to it."""
    two, both = ("crease_friction", "length_scale"), ("crease_friction", "length_scale", "marker_offset")
    rival = ("crease_friction", "marker_offset")
    p = posterior({two: 0.0, both: -1.8, rival: -20.0, (): -99.0})
    predicted(p, {two: 0.0, rival: 0.3})
    decided = decide(p, lambda key: Budget([Share("", "effect", 1.0)], 1.0))
    assert decided.lead == set(two) and not decided.tie


def test_what_explanations_share_is_counted_once():
    a, b = frozenset({"x", "a"}), frozenset({"x", "b"})
    out = shared_out({a: 0.5, b: 0.2, a | b: 0.2, frozenset({"x"}): 0.1}, [a, b])
    assert out == pytest.approx({a: 0.6, b: 0.3})


def test_a_search_that_ended_before_its_best_set_was_fitted_has_not_decided():
    p = posterior({("crease_friction",): 0.0, (): -50.0})
    del p.nodes[frozenset({0})]
    for ended, word in ((True, "TIE"), (False, "UNKNOWN")):
        p.ended = ended
        assert decide(p, lambda key: Budget([Share("not named", "rest", 1.0)], 9.0)).word == word


def test_what_was_not_simulated_may_be_what_nothing_else_explains():
    p = posterior({("crease_friction",): 0.0, (): -50.0})
    p.ended = True
    for status, word in (("", "UNKNOWN"), (LATE, "TIE")):
        p.signatures[-1] = replace(p.signatures[-1], status=status)
        assert decide(p, lambda key: Budget([Share("not named", "rest", 1.0)], 9.0)).word == word


def test_places_are_said_with_their_probability_and_turned_signs():
    """A stiffer root and a softer middle of a beam are the same to a modulus that is uncertain."""
    sites = ("the root", "the middle", "the tip")
    every = [
        Suspect("crease_softness", site, "crease", (Free("crease_softness", "dK", "-", 0.0, 1.0),)) for site in sites
    ]
    p = Posterior([Signature(s, [np.zeros(0)], np.ones(1)) for s in every], Weights(np.ones(1)))
    chance = {frozenset({n}): v for n, v in enumerate((0.6, 0.3, 0.1))} | {frozenset(): 0.0}
    for n, strength in ((0, 1.0), (1, -1.0)):
        free = every[n].free
        fitted = SimpleNamespace(free=free, theta=np.array([strength]), hypothesis=Hypothesis((every[n],)))
        p.nodes[frozenset({n})] = Node(frozenset({n}), cast(Fit, fitted), np.zeros(1), [], [], [None])
    text = places(p, chance, frozenset({"crease_softness"}), frozenset({0}))
    assert (
        text == ", there with p = 0.60, else with the opposite sign at the middle (p = 0.30) or at the tip (p = 0.10)"
    )
    assert places(p, {frozenset({0}): 1.0}, frozenset({"crease_softness"}), frozenset({0})) == ""


def predicted(p: Posterior, at: dict[tuple[str, ...], float], owed: float = 0.0) -> None:
    """Gives fitted sets predictions that lie so many standard deviations of all data together from each other."""
    for effects, by in at.items():
        key = frozenset(k for k in range(len(p.signatures)) if p.suspect(k).effect in effects)
        own = Hypothesis(tuple(p.suspect(k) for k in sorted(key)))
        made = {"residuals": [np.full((4, 1), 0.5 * by)], "weights": Weights(np.ones(1)), "hypothesis": own}
        cells = np.where(HYPER.clean, 0.0, -np.inf)
        p.nodes[key] = Node(key, cast(Fit, SimpleNamespace(**made)), cells, [], [], [None] * len(HYPER.cells), owed)


def posterior(logs: dict[tuple[str, ...], float]) -> Posterior:
    """Fitted sets of effects with these log posteriors, without a discrepancy."""
    names = sorted({e for effects in logs for e in effects})
    made = [Suspect(e, "the body", "panel", (Free(e, "strength", "-", 0.0, 1.0),)) for e in names]
    hyper = replace(HYPER, unlisted=0.07, imitated=4.0)
    p = Posterior([Signature(s, [np.zeros(0)], 1.0) for s in made], Weights(np.ones(1)), hyper)
    p.total = {frozenset(map(names.index, effects)): log for effects, log in logs.items()}
    p.log = {key: np.where(HYPER.clean, log, -np.inf) for key, log in p.total.items()}
    p.nodes = cast(dict, dict.fromkeys(p.total))
    return p


@pytest.mark.parametrize(
    ("deviations", "moved", "lead"),
    [
        (1.5, True, {"air_drag"}),
        (5.0, True, {"air_drag", "crease_friction"}),
        (5.0, False, {"air_drag"}),  # derivatives promise it, and the fit stays at zero
    ],
)
def test_an_effect_whose_strength_is_not_told_from_zero_is_not_named(deviations, moved, lead):
    """Friction is probable beside drag, as it would explain part of a discrepancy; its fit has hardly any."""
    p = posterior({("air_drag", "crease_friction"): 0.0, ("air_drag",): -4.0, (): -50.0})
    at, promised = np.array([30.0, deviations * moved]), deviations * (not moved)
    groups = [Group((k,), 1, at[k : k + 1], 1, np.full(1, np.inf)) for k in range(2)]
    # where the fit ended, in units of what is known of each strength
    both = Summed(np.array([[1.0, 0.0, 0.0], [0.0, 1.0, promised], [0.0, promised, 40.0]]), 0.0)
    key = frozenset({0, 1})
    fitted = cast(Fit, SimpleNamespace(hypothesis=Hypothesis(tuple(s.suspect for s in p.signatures))))
    grid = [both, *[None] * (len(HYPER.cells) - 1)]
    p.nodes[key] = Node(key, fitted, np.where(HYPER.clean, 0.0, -np.inf), groups, [], grid)
    decided = decide(p, lambda key: Budget([Share("", "effect", 1.0)], 1.0))
    assert decided.lead == lead and decided.best == frozenset(n for n, e in enumerate(sorted(lead)))


def test_an_effect_at_two_sites_is_named_once():
    numbers = [Free("crease_friction", "friction_moment", "N m", 0.0, 1e-3) for _ in range(2)]
    suspects = [Suspect("crease_friction", f"fold{n}", "crease", (f,), (n,)) for n, f in enumerate(numbers)]
    values, sd = np.array([1e-3, 2e-3]), np.full(2, 1e-5)
    ends = values - 2.0 * sd, values + 2.0 * sd
    text = say(fitted(suspects, values, sd, ends))
    assert text.count("dry friction") == 1
    assert "at fold0 (friction moment 1.00 mN m" in text and " and at fold1 (friction moment 2.000" in text


def fitted(suspects, values, sd, ends, at_bound=None) -> Fit:
    made = {"deviations": lambda: sd, "intervals": lambda: ends, "at_bound": np.zeros(len(values), bool)}
    made |= {} if at_bound is None else {"at_bound": at_bound}
    hypothesis = Hypothesis(tuple(suspects))
    return cast(Fit, SimpleNamespace(hypothesis=hypothesis, free=hypothesis.free, theta=values, **made))


def test_a_mass_at_several_nodes_is_said_as_their_sum():
    added = Free("added_mass", "added", "kg", 0.0, 1e-5, entities=(6, 7))
    values, sd = np.array([77e-6]), np.array([4e-6])
    one = Suspect("added_mass", "shank", "node", (added,), (6, 7))
    assert "added 150 mg in all, 95 %: 140 mg to 170 mg" in say(
        fitted([one], values, sd, (values - 2 * sd, values + 2 * sd))
    )


@pytest.mark.parametrize("held", [False, True])
def test_other_numbers_of_a_single_effect_are_said_unless_they_lie_on_a_bound(held):
    numbers = (
        Free("crease_relaxation", "stiffness_1", "N m/rad", 0.0, 1e-5),
        Free("crease_relaxation", "time_1", "s", 1.0, 1.0, power=0.0),
    )
    values, sd = np.array([1e-4, 43.8]), np.array([1e-6, 1.0])
    suspect = Suspect("crease_relaxation", "hinge", "crease", numbers, (0,))
    text = say(fitted([suspect], values, sd, (values - 2 * sd, values + 2 * sd), np.array([False, held])))
    assert (
        text.startswith("viscoelastic relaxation at hinge (stiffness 100 µN m/rad") and ("time 43.8 s" in text) != held
    )


def test_times_of_branches_without_a_stiffness_are_not_said():
    n = {"stiffness": ("N m/rad", 1e-5), "time": ("s", 1.0)}
    free = tuple(
        Free("crease_relaxation", f"{k}_{i}", unit, float(k == "time"), scale)
        for k, (unit, scale) in n.items()
        for i in (1, 2)
    )
    suspect = Suspect("crease_relaxation", "hinge", "crease", free, (0,))
    values, sd = np.array([0.0, 4e-4, 8.7, 23.9]), np.full(4, 1e-6)
    text = say(fitted([suspect], values, sd, (values - 2 * sd, values + 2 * sd), np.array([True, False, False, False])))
    assert "time, branch 2: 23.9 s" in text and "8.7" not in text


@pytest.mark.parametrize(("numbers", "far", "words"), [(0.7, 2.0, True), (0.7, 0.5, False), (0.2, 2.0, False)])
def test_where_numbers_explain_more_the_one_that_moved_farthest_is_said(numbers, far, words):
    known = (Free("", "mass", "kg", 0.02, 1e-3, spread=1e-3), Free("", "stiffness", "N m/rad", 3e-3, 1e-4, spread=1e-4))
    f = cast(Fit, SimpleNamespace(free=known, theta=np.array([0.0205, 3e-3 + far * 1e-4]), strain=np.array([0.5, far])))
    shares = [Share("", "numbers", numbers), Share("", "effect", 1.0 - numbers)]
    text = explains(Budget(shares, 1.0), "", f)
    assert text.startswith(f"explains {1.0 - numbers:.0%} of the mismatch, numbers of the model {numbers:.0%}")
    assert ("above all stiffness, from 3.00 mN m/rad to 3.20 mN m/rad" in text) == words and "mass" not in text


def test_numbers_far_from_what_was_known_are_said_in_the_headline():
    known = tuple(Free("", n, "kg", 0.02, 1e-3, spread=1e-3) for n in ("mass", "modulus", "width"))
    f = cast(Fit, SimpleNamespace(free=known, theta=np.full(3, 0.03), strain=np.array([6.24, 8.46, 2.9])))
    text = explains(Budget([Share("", "effect", 1.0)], 1.0), "", f)
    said = "modulus is 8.5 and mass is 6.2 standard deviations from what was known"
    assert text == f"explains 100% of the mismatch; then {said}"


def test_from_which_number_to_which_shows_that_they_differ():
    assert change(0.2, 0.19952, "m") == "from 200.0 mm to 199.5 mm"
    assert change(1e-4, 9.24e-5, "N m/rad") == "from 100 µN m/rad to 92.4 µN m/rad"
    assert change(0.0, 0.02, "rad") == "from 0 rad to 20.0 mrad" and change(1.0, 1.0, "-") == "from 1 to 1"

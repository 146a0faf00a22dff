"""Which set of effects is fitted next."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.stats import t

from origami_sim.infer.posterior import Key, Posterior
from origami_sim.infer.proposals import most_reached, proposed

DRAG, LOSS, RUB, SCALE, ZERO = range(5)
BEST = frozenset({RUB, LOSS, SCALE})


def posterior(fitted: dict[Key, float], estimated: dict[Key, float]) -> Posterior:
    """Fitted sets and others with their log posteriors; nothing is known of single effects, or of what fits gain."""
    fitted = {frozenset(): -1e6} | fitted
    frees = {n: SimpleNamespace(start=0.0) for n in range(5)}
    nodes = {}
    for k in fitted:
        fit = SimpleNamespace(weights=None, free=[frees[n] for n in sorted(k)], theta=np.full(len(k), 3.0))
        nodes[k] = SimpleNamespace(key=k, instead={}, fit=fit, others=[], groups=[], grid=[None])
    estimates = {k: SimpleNamespace(parent=frozenset()) for k in estimated}
    known = dict(nodes=nodes, estimates=estimates, promise=dict(estimated), total=fitted | estimated)
    out = Posterior([], cast(Any, None), **cast(Any, known))
    more = dict(leader=max(fitted, key=lambda k: fitted[k]), imitates=lambda key: False, effects=lambda key: key)
    more["labels"] = lambda key: tuple(sorted(map(str, key)))
    more["promised"] = lambda key: max(out.total[key], out.promise[key])
    more["signatures"] = [
        SimpleNamespace(suspect=SimpleNamespace(strengths=(f,)), size=np.ones(1)) for f in frees.values()
    ]
    more["suspect"] = lambda n: SimpleNamespace(effect=str(n))
    own = ("nodes", "estimates", "promise", "total", "gains", "realised", "hoped", "ranked", "swapped", "begun")
    return cast(Posterior, SimpleNamespace(**{n: getattr(out, n) for n in own}, **more))


def test_a_rival_of_a_smaller_set_is_fitted_with_what_the_best_adds_to_that():
    """Drag and a loss of the hinge look alike; the scale that is told beside one is told beside the other."""
    two = {frozenset({RUB, LOSS}): -12.0, frozenset({RUB, DRAG}): -12.5}
    alike = frozenset({RUB, DRAG, SCALE})
    out = posterior({BEST: 0.0} | two, {alike: -40.0})
    assert proposed(out, 1) == alike
    assert proposed(posterior({BEST: 0.0} | two | {alike: -0.4}, {}), 1) is None
    worse = posterior({BEST: 0.0, frozenset({RUB, LOSS}): -12.0, frozenset({RUB, DRAG}): -30.0}, {alike: -40.0})
    assert proposed(worse, 1) is None


def test_a_rival_is_fitted_with_what_the_best_has_in_place_of_another_effect():
    """A zero of the encoder explains less than its scale beside a loss of the hinge, and so beside the drag like it."""
    two = {frozenset({RUB, LOSS, ZERO}): -8.0, frozenset({RUB, DRAG, ZERO}): -9.0}
    alike = frozenset({RUB, DRAG, SCALE})
    assert proposed(posterior({BEST: 0.0} | two, {alike: -40.0}), 1) == alike
    alone = {frozenset(): -90.0, frozenset({DRAG}): -0.5, frozenset({LOSS}): 0.0}
    both = frozenset({DRAG, LOSS})
    assert proposed(posterior(alone, {both: -40.0}), 1) is None, "what looks alike does not add up"


def test_of_all_that_a_rival_is_like_that_counts_which_promises_most():
    """The same set differs from a second rival, which is far less probable, as the best one does from another."""
    two = {frozenset({RUB, LOSS}): -1.0, frozenset({RUB, DRAG}): -1.5}
    with_zero = {frozenset({RUB, LOSS, ZERO}): -2.0, frozenset({RUB, DRAG, ZERO}): -30.0}
    alike = frozenset({RUB, DRAG, SCALE})
    for some in (two | with_zero, with_zero | two):
        assert proposed(posterior({BEST: 0.0} | some, {alike: -40.0}), 1) == alike


@pytest.mark.parametrize(("cosine", "same"), [(0.999, True), (0.9, False)])
def test_what_the_refitted_model_cannot_tell_from_the_best_is_fitted_in_its_place(cosine, same):
    """Of a signature of 10 deviations, 3 times as strong, another explains all but 1.8 squares, or all but 171."""
    late = frozenset({DRAG, SCALE})
    out = posterior({frozenset({RUB, SCALE}): 0.0}, {late: -5e4, frozenset({RUB, ZERO}): -5e4})
    none = cast(Any, out.nodes[frozenset()])
    none.others, none.groups = [DRAG, RUB, SCALE, ZERO], [SimpleNamespace(columns=(n,)) for n in range(4)]
    gram = 100.0 * np.array([[1.0, cosine], [cosine, 1.0]])
    seen = np.zeros((5, 5))  # with a column of the residual
    seen[:2, :2], seen[2:4, 2:4] = gram, 1e-4 * gram  # it does not see a scale, nor a zero
    none.grid = [SimpleNamespace(gram=seen)]
    assert proposed(out, 0) == (late if same else None)


@pytest.mark.parametrize(
    ("explained", "of_first", "wanted"),
    [
        (3500.0, None, "first"),  # estimated at 6.2 below: within a hundredth of what the exchanged effect explains
        (200.0, None, "none"),
        (3500.0, -7.0, "none"),  # the first exchange came out as estimated, or worse
        (3500.0, -2.0, "second"),  # better than estimated by what others need
    ],
)
def test_in_the_place_of_a_strong_effect_one_that_may_do_the_same_is_fitted(explained, of_first, wanted):
    """Derivatives tell what a late field does in the place of a motion blur to a part of what either explains."""
    best, first, second = frozenset({RUB, SCALE}), frozenset({RUB, DRAG}), frozenset({RUB, LOSS})
    fitted = {best: 0.0} | ({} if of_first is None else {first: of_first})
    estimated = {k: v for k, v in {first: -6.2, second: -6.4, frozenset({RUB}): -explained}.items() if k not in fitted}
    out = posterior(fitted, estimated)
    cast(Any, out.nodes[best]).instead = {first: -6.2, second: -6.4}
    found = {"first": first, "second": second, "none": None}
    assert [proposed(out, n) for n in range(2)] == [found[wanted]] * 2


def test_what_promises_a_part_of_the_posterior_is_fitted():
    other = frozenset({DRAG})
    assert proposed(posterior({BEST: 0.0}, {other: -1.0}), 0) == other
    assert proposed(posterior({BEST: 0.0}, {other: -4.0}), 0) is None


def test_how_far_a_set_may_come_is_told_by_those_before_it():
    """Two fits that came 31 of 120 and 12 of 101 say little of a third; three that came a tenth of their way do."""
    assert most_reached([], 63.0) == most_reached([(120.0, 31.0)], 63.0) == 63.0, "up to what it promises"
    assert most_reached([(120.0, 31.0), (101.0, 12.0)], 63.0) == 63.0
    tenth = [(100.0, 12.0), (80.0, 8.0), (120.0, 10.0)]
    assert 10.0 < most_reached(tenth, 100.0) < 20.0
    left = np.array([12.0, 8.0, 10.0]) - 3040.0 / 30800.0 * np.array([100.0, 80.0, 120.0])
    doubt = np.sqrt(left @ left / 2.0 * (1.0 + 100.0**2 / 30800.0))
    assert most_reached(tenth, 100.0) == pytest.approx(304000.0 / 30800.0 + t.ppf(0.95, 2) * doubt, rel=1e-12)


@pytest.mark.parametrize(("value", "worth"), [(0.0, False), (0.5, True)])
def test_what_physics_would_hold_at_nothing_is_not_fitted(value, worth):
    """A lag beside a rival of the best set, of which the recordings would have less than none."""
    rival = frozenset({RUB, LOSS, ZERO})
    lag = rival | {DRAG}
    out = posterior({BEST: 0.0, rival: -1.0}, {lag: -2.0})
    node = cast(Any, out.nodes[rival])
    node.groups = [SimpleNamespace(columns=(n,), strengths=1) for n in range(len(lag))]
    values = np.array([3, 3, 3, value])
    out.estimates[lag] = cast(Any, SimpleNamespace(parent=rival, groups=(0, 1, 2, 3), values=values))
    assert proposed(out, 0) == (lag if worth else None)


@pytest.mark.parametrize(("promise", "worth"), [(-0.1, False), (0.1, True)])
def test_what_only_adds_to_the_best_is_fitted_if_it_promises_the_lead(promise, worth):
    more = BEST | {DRAG}
    assert proposed(posterior({BEST: 0.0}, {more: promise}), 0) == (more if worth else None)
    drag = frozenset({DRAG})
    none = posterior({frozenset(): 0.0, BEST: -9.0}, {drag: promise})  # beside nothing, all that is said depends on it
    none.estimates[drag] = cast(Any, SimpleNamespace(parent=frozenset(), groups=(), values=np.zeros(0)))
    assert proposed(none, 0) == drag


def test_a_set_is_fitted_from_other_shapes_only_if_it_promises_more():
    """A rival with what the best adds to a smaller set was fitted already, with another yield angle."""
    two = {frozenset({RUB, LOSS}): -12.0, frozenset({RUB, DRAG}): -12.5}
    alike = frozenset({RUB, DRAG, SCALE})
    out = posterior({BEST: 0.0} | two | {frozenset({RUB, DRAG, SCALE, ZERO}): -0.4}, {alike: -40.0})
    labels = out.labels
    out.labels = lambda key: labels(key - {ZERO})
    assert proposed(out, 1) is None


def test_sets_that_had_no_room_do_not_tell_how_far_another_comes():
    with np.errstate(all="raise"):
        assert most_reached([(0.0, 1.0), (0.0, -2.0)], 63.0) == 63.0

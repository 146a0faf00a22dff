"""What a posterior over sets of effects says: which are named, and how probable that is."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np

from origami_sim.infer.budget import FAR, Budget
from origami_sim.infer.discrepancy import laws, of_recorder
from origami_sim.infer.posterior import CREDIBLE, Key, Node, Posterior
from origami_sim.infer.screen import LATE
from origami_sim.infer.unlisted import UNLISTED

ALONE = 0.8
"""Probability from which one explanation is named alone: to name a wrong one is four times as bad as a tie."""

LISTED = 3
"""Explanations of which one has to be chosen that are listed at most; of more, none is worth a reader's time.

Those that predict the same are one."""


@dataclass(frozen=True)
class Decision:
    """What a posterior says, before it is put into words.

    Attributes:
        word: of the verdict; "" where nothing is named. best: the set to show. lead: effects that are named.
        credible: explanations that may be, besides. tie: whether nothing decides between them. probability: of what is
            named, or of them. chance: posterior of the sets that may be named, see `considered`. classes: the same of
            their effects, without those that are not told from nothing. foreign: that a law which the catalogue lacks
            is imitated by them.
    """

    word: str
    best: Key
    lead: frozenset[str]
    credible: list[frozenset[str]]
    tie: bool
    probability: float
    chance: dict[Key, float]
    classes: dict[frozenset[str], float]
    foreign: float


def decide(p: Posterior, budgets: Callable[[Key], Budget]) -> Decision:
    """The verdict on a posterior over sets of effects.

    Args:
        budgets: the budget of a fitted set.
    """
    chance = considered(p)
    classes = by_effects(p, chance)
    top = max(classes, key=lambda c: classes[c])
    lead, beside = surely(p, classes)
    if not any(p.told(k) >= lead for k in p.nodes):  # of what no fit tells from zero no number could be said
        lead, beside = frozenset(), []
    best = best_of(p, chance, top if beside else lead or top)
    may_be, total = credible(classes)
    if beside:
        may_be, total = beside, sum(v for c, v in classes.items() if any(c >= b for b in beside))
    left = budgets(best)
    named = [c for c in classes if c >= lead] if lead else may_be if top else [top]
    rest = real_rest(p, best, left)
    foreign = p.hyper.foreign(laws(beside[0] if beside else lead), rest) if lead else imitated(p, chance, named, rest)

    def as_(word: str, probability: float, *, tie: bool = False) -> Decision:
        return Decision(word, best, lead or top, may_be, tie, probability * (1.0 - foreign), chance, classes, foreign)

    late = not_simulated(p)
    if not late and all(s.status for s in p.signatures):
        return as_("UNTESTABLE", 1.0)
    if ended_early(p, chance) and (not lead or (late and left.rest > left.beyond)):
        return as_("TIE", total, tie=True)
    real = UNLISTED in lead or left.over > FAR or missing(p, best, left) > ALONE
    if (left.rest > left.beyond and real) or foreign > 0.5:  # or most probably none of these acts
        return as_("UNKNOWN", np.nan)
    if not top:
        return as_("", classes[top])
    if not lead or beside:
        return as_("MEASUREMENT" if all(map(from_recorder, may_be)) else "TIE", total, tie=True)
    several = sum(p.suspect(n).effect in lead for n in best) > 1
    word = "MEASUREMENT" if from_recorder(lead) else "SEVERAL" if several else "MECHANISM"
    return as_(word, sum(classes[c] for c in named))


def ended_early(p: Posterior, chance: dict[Key, float]) -> bool:
    """Whether a search was ended before all was simulated, or while a set was most probable that was not fitted."""
    return p.ended and (not_simulated(p) > 0 or max(chance, key=lambda k: (chance[k], k in p.nodes)) not in p.nodes)


def not_simulated(p: Posterior) -> int:
    """How many suspects there was no time to simulate."""
    return sum(s.status == LATE for s in p.signatures)


def missing(p: Posterior, key: Key, left: Budget) -> float:
    """Probability that a set leaves something real."""
    return max(left.pushed, left.real, float(np.sum(p.cells(key)[~p.hyper.clean])))


def real_rest(p: Posterior, key: Key, left: Budget) -> float:
    """What a set leaves and is real, over what its effects explain."""
    return missing(p, key, left) * left.rest / max(left.beyond, left.rest, 1e-300)


def considered(p: Posterior) -> dict[Key, float]:
    """Posterior of the sets that may be named.

    So many laws that they rather imitate one which the catalogue lacks are not: then it is asked which of fewer explain
    most, of the fitted sets, and what those leave is real and not named.
    """
    chance = p.probabilities()
    if not p.imitates(max(chance, key=lambda k: chance[k])):
        return chance
    return p.probabilities(among=[k for k in p.nodes if not p.imitates(k)])


def by_effects(p: Posterior, chance: dict[Key, float]) -> dict[frozenset[str], float]:
    """Posterior of each set of effects, wherever they act, without those that are not told from nothing.

    With such an effect and without it is one explanation, which counts once, as the more probable of the two.
    """
    out: dict[frozenset[str], float] = {}
    with_idle: dict[frozenset[str], float] = {}
    for key, value in chance.items():
        c = p.told(key)
        if c == p.effects(key):
            out[c] = out.get(c, 0.0) + value
        else:
            with_idle[c] = max(with_idle.get(c, 0.0), value)
    for c, value in with_idle.items():
        out[c] = max(out.get(c, 0.0), value)
    total = sum(out.values()) / sum(chance.values())
    return {c: value / total for c, value in out.items()}


def imitated(p: Posterior, chance: dict[Key, float], classes: Collection[frozenset[str]], left: float) -> float:
    """Probability that a law which the catalogue lacks is imitated by effects, of which these sets act.

    Args:
        left: see `Hyper.foreign`.
    """
    mine = [(value, c) for key, value in chance.items() if (c := p.told(key)) in classes]
    total = sum(value for value, _ in mine)
    return sum(value * p.hyper.foreign(laws(c), left) for value, c in mine) / total if total else 0.0


def of_each(classes: dict[frozenset[str], float]) -> dict[str, float]:
    """Posterior of each effect, whatever acts besides."""
    out: dict[str, float] = {}
    for c, value in classes.items():
        for effect in c:
            out[effect] = out.get(effect, 0.0) + value
    return out


def surely(p: Posterior, classes: dict[frozenset[str], float]) -> tuple[frozenset[str], list[frozenset[str]]]:
    """Effects that act together with at least `ALONE`; and with what else, if one of a few surely acts besides.

    What is added is listed where `LISTED` effects or fewer hold `ALONE`, whatever small ones act with them. Those of
    which fits predict the same are one here, and an effect that has such likes is one of them.
    """
    fitted = {p.effects(k): p.nodes[k] for k in sorted(p.nodes, key=lambda k: p.total[k])}  # the best of each
    marginal = of_each(classes)
    lead: frozenset[str] = frozenset()
    for effect in sorted(marginal, key=lambda e: (-marginal[e], e)):
        larger = lead | {effect}
        if sum(v for c, v in classes.items() if c >= larger) < ALONE:
            break
        lead = larger
    more = {c - lead: v for c, v in classes.items() if c >= lead}
    chance = of_each(more)
    groups = indistinct(fitted, lead, sorted(chance, key=lambda e: (-chance[e], e))) if lead else []
    for n in range(1, min(LISTED, len(groups)) + 1):
        likely = [e for group in groups[:n] for e in group]
        if len(likely) > 1 and sum(v for c, v in more.items() if c & set(likely)) >= ALONE:
            return lead, [lead | {e} for e in likely]
    return with_likes(fitted, classes, lead)


def indistinct(fitted: dict[frozenset[str], Node], lead: frozenset[str], effects: Sequence[str]) -> list[list[str]]:
    """Groups of effects that recordings do not tell apart beside others: their fits predict the same."""
    groups: list[list[str]] = []
    for effect in effects:
        one = fitted.get(lead | {effect})
        same = (group for group in groups if predict_the_same(one, fitted.get(lead | {group[0]})))
        if (group := next(same, None)) is not None:
            group.append(effect)
        else:
            groups.append([effect])
    return groups


def with_likes(
    fitted: dict[frozenset[str], Node], classes: dict[frozenset[str], float], lead: frozenset[str]
) -> tuple[frozenset[str], list[frozenset[str]]]:
    """Effects that surely act, without one in whose place another predicts the same, and sets with either.

    Of two that data cannot tell apart only priors, and how far their fits went, decide which is more probable. A drag
    on a single arm and a loss of its hinge are the same.
    """
    for effect in sorted(lead):
        others = [c for c in fitted if len(c) == len(lead) and lead - c == {effect}]
        likely = [c for c in others if holding(classes, c, without=effect) > 1.0 - CREDIBLE]
        if alike := [c for c in likely if predict_the_same(fitted[c], fitted.get(lead))]:
            return lead - {effect}, [lead, *alike]
    return lead, []


def predict_the_same(one: Node | None, other: Node | None) -> bool:
    """Whether all data together see the predictions of two fits differ by less than one standard deviation.

    Either may be off its best by what derivatives still promise it. Of what was not fitted, or of a search that was
    stored, predictions are not known.
    """
    if one is None or other is None or one.fit.weights is None:
        return False
    gaps = [(a - b) / one.fit.weights.deviation for a, b in zip(one.fit.residuals, other.fit.residuals, strict=True)]
    return float(sum(np.nansum(np.square(g)) for g in gaps)) < 1.0 + one.owed + other.owed


def holding(classes: dict[frozenset[str], float], effects: frozenset[str], without: str) -> float:
    """Posterior of effects, whatever acts besides but for one."""
    return sum(v for c, v in classes.items() if c >= effects and without not in c)


def shared_out(
    classes: dict[frozenset[str], float], explanations: Sequence[frozenset[str]]
) -> dict[frozenset[str], float]:
    """Posterior of explanations, whatever acts besides: sets that hold several count for these in equal parts."""
    out = dict.fromkeys(explanations, 0.0)
    for c, value in classes.items():
        held = [e for e in explanations if e and c >= e] or [e for e in explanations if e == c]
        for e in held:
            out[e] += value / len(held)
    return out


def best_of(p: Posterior, chance: dict[Key, float], effects: frozenset[str]) -> Key:
    """The most probable fitted set of these effects; or else of these and others, or else of any."""
    if not effects:
        return frozenset()
    classes = {k: p.effects(k) for k in p.nodes}
    mine = [k for k, c in classes.items() if c == effects]
    mine = mine or [k for k, c in classes.items() if c >= effects] or list(p.nodes)
    return max(mine, key=lambda k: (chance.get(k, 0.0), p.total[k]))


def credible(classes: dict[frozenset[str], float]) -> tuple[list[frozenset[str]], float]:
    """The smallest set of explanations that holds 95 %; what only adds to another one is left out."""
    total, out = 0.0, []
    for c in sorted(classes, key=lambda c: -classes[c]):
        if total >= CREDIBLE:
            break
        total += classes[c]
        if not any(c > d for d in out if d):
            out.append(c)
    return out, min(total, 1.0)


def from_recorder(effects: frozenset[str]) -> bool:
    """Whether effects are all errors of the recorder, and there are any."""
    return bool(effects) and all(map(of_recorder, effects))


def log_odds(p: Posterior, key: Key) -> float:
    """Log posterior odds of a set over the model without an effect."""
    return p.total[key] - p.total[frozenset()]

"""The verdict: sums over the posterior, put into words."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field

import numpy as np

from origami_sim.effects import get
from origami_sim.fit.bursts import bursts
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.hypotheses.hypothesis import NOMINAL
from origami_sim.infer.budget import FAR, Budget, Share, over_noise
from origami_sim.infer.discrepancy import laws, of_recorder
from origami_sim.infer.intervals import widened
from origami_sim.infer.posterior import CREDIBLE, Key, Node, Posterior
from origami_sim.infer.remainder import mismatch
from origami_sim.infer.unlisted import UNLISTED, crease_of_the_rest, usual_moment
from origami_sim.infer.words import distinct, joined, said, say, title

ALONE = 0.8
"""Probability from which one explanation is named alone: to name a wrong one is four times as bad as a tie."""

LISTED = 3
"""Explanations of which one has to be chosen that are listed at most; of more, none is worth a reader's time.

Those that predict the same are one."""

COMPARED = 0.9
"""Share of the frames that has to be compared before nothing may be said to be missing."""

MORE_LAWS = " More laws at once would follow the recordings more closely, as they do where the catalogue lacks one."
"""What is said where the best set is not named."""


@dataclass(frozen=True, eq=False)
class Judgement:
    """What is said.

    Attributes:
        verdict, sentence, probability, chosen: see `Diagnosis`. best: the fit to show. tied: explanations that are not
            told from it, itself among them. others: the next best. budget: of the mismatch. notes: what else to say.
        chance: posterior of the sets that may be named, see `considered`.
    """

    verdict: str
    sentence: str
    probability: float
    chosen: list[str]
    best: Fit
    tied: list[Fit] = field(default_factory=list)
    others: list[Fit] = field(default_factory=list)
    budget: list[Share] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    chance: dict[Key, float] = field(default_factory=dict)


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
    if not any(p.effects(k) >= lead for k in p.nodes):  # of what was never fitted no number could be said
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

    if all(s.status for s in p.signatures):
        return as_("UNTESTABLE", 1.0)
    real = UNLISTED in lead or left.over > FAR or missing(p, best, left) > ALONE
    if left.rest > left.beyond and real:
        return as_("UNKNOWN", np.nan)
    if not top:
        return as_("", classes[top])
    if not lead or beside:
        return as_("MEASUREMENT" if all(map(_of_recorder, may_be)) else "TIE", total, tie=True)
    several = sum(p.suspect(n).effect in lead for n in best) > 1
    word = "MEASUREMENT" if _of_recorder(lead) else "SEVERAL" if several else "MECHANISM"
    return as_(word, sum(classes[c] for c in named))


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


def judge(forward: Predictor, given: Fit, base: Fit, p: Posterior, compared: float) -> Judgement:
    """The verdict in words.

    Args:
        given, base: the model as given, and refitted. compared: share of the frames that were compared.
    """
    budgets: dict[Key, Budget] = {}

    def budgeted(key: Key) -> Budget:
        if key not in budgets:
            budgets[key] = mismatch(p, forward, given, base, key)
        return budgets[key]

    d = decide(p, budgeted)
    chance, classes = d.chance, d.classes
    more_laws = len(chance) < len(p.total)  # only some may be named
    best = p.nodes[d.best].fit
    left = crease_of_the_rest(forward, best, p.hyper) if d.lead and _shows(budgeted(d.best).rest) else ""
    shown = widened(p, d.best)
    explained = explains(budgeted(d.best), left, shown)
    tied = [widened(p, k) for c in d.credible if (k := best_of(p, chance, c)) in p.nodes]
    ranked = sorted(p.nodes, key=lambda k: -chance.get(k, 0.0))
    others = [widened(p, k) for k in ranked if p.effects(k) != d.lead]
    common = {"best": shown, "tied": tied, "others": others, "budget": budgeted(d.best).shares, "chance": chance}
    over = over_noise(forward, best)
    beyond = f" What it leaves is {over:.1f} times the noise." if over > FAR else ""
    beyond += (MORE_LAWS if more_laws else "") + _unlisted(d)
    suspects = shown.hypothesis.suspects
    chosen = [s.label for s in suspects]
    if d.word == "UNTESTABLE":
        text = "None of the catalogue's suspects is excited by these recordings."
        text = text if p.signatures else "There is no suspect that could act here."
        return Judgement(d.word, text, d.probability, [], **common)
    if not d.lead:
        alone = p.nodes[frozenset()].fit  # its numbers are those of the tables
        word, text, chosen = unnamed_verdict(forward, given, alone, compared, unknown=d.word == "UNKNOWN")
        return Judgement(word, text, np.nan if word == "UNKNOWN" else d.probability, chosen, **common)
    if d.word == "UNKNOWN" and UNLISTED in d.lead:
        b = budgeted(d.best)
        text = f"Something real is missing that the catalogue does not name: {smooth_moment(forward, shown)}."
        text += f" It explains {_share(b.rest)} of the mismatch, numbers of the model {_share(b.numbers)}."
        nearest = next((f for f in others if f.hypothesis.suspects), None)
        text += f" The closest of the catalogue is {say(nearest)}." if nearest else ""
        return Judgement(d.word, text, np.nan, [shown.hypothesis.label], **common)
    if d.word == "UNKNOWN":
        text = f"Something real is missing that the catalogue does not name: the closest, {say(shown)}, {explained}."
        text += MORE_LAWS if more_laws else ""
        return Judgement(d.word, text, np.nan, [shown.hypothesis.label], **common)
    if d.tie and p.ended and max(chance, key=lambda k: (chance[k], k in p.nodes)) not in p.nodes:
        likely = [c for c in d.credible if classes[c] > 1.0 - CREDIBLE][:LISTED]
        text = "Not decided yet. Estimated to be most probable, and not fitted: "
        text += f"{joined([f'{_name(c)} (p = {classes[c]:.2f})' for c in likely])}. Of what was fitted the best is "
        text += f"{say(shown)}, which {explained}." if suspects else "the model without any effect."
        return Judgement(d.word, text, d.probability, chosen, **common)
    if d.tie:
        names = distinct([f for f in tied if f.hypothesis.suspects]) + (
            ["nothing"] if frozenset() in d.credible else []
        )
        chances = {c: holding(classes, c) if c > d.lead else classes[c] for c in d.credible}
        sure = in_all(d.lead, d.credible)
        text = undecided(sure, d.credible, chances, say(shown, only=sure) if sure else "")
        more = p.effects(d.best) - sure
        if sure and more:
            text += f" With {say(shown, only=more)} they {explained.replace('explains', 'explain', 1)}."
        else:
            text += f" The best is {say(shown)}, which {explained}."
        return Judgement(d.word, text + beyond, d.probability, names, **common)
    # the shown set may hold more than what surely acts: of that, each effect by its own probability
    named = [s for s in suspects if s.effect in d.lead]
    chosen = [s.label for s in named]
    if d.word == "MEASUREMENT":
        text = f"The measurement, not the device, explains the mismatch: {say(shown, only=d.lead)}"
    else:
        text = f"Found: {say(shown, only=d.lead)}{_elsewhere(p, chance, d.lead, d.best)}"
    who = "with what acts besides, they" if len(named) < len(suspects) else "they" if len(named) > 1 else "it"
    explained = explained if who == "it" else explained.replace("explains", "explain", 1)
    more = 1.0 - classes.get(d.lead, 0.0) * (1.0 - d.foreign) / d.probability
    others = ", whatever acts besides" if 1.0 - CREDIBLE < more <= ALONE else ""
    text += f", p = {d.probability:.2f}{others}; {who} {explained}.{beyond}"
    if more > ALONE:
        each = _besides(classes, d.lead)
        likely = f": {joined([f'{title(e)} (p = {v:.2f})' for e, v in each])}" if each else ""
        text += f" Something acts besides (p = {more:.2f}), and these recordings do not tell what{likely}."
    return Judgement(d.word, text, d.probability, chosen, **common)


def smooth_moment(forward: Predictor, f: Fit) -> str:
    """The moment of a crease that no law of the catalogue gives, in words."""
    site = next(s.site for s in f.hypothesis.suspects if s.effect == UNLISTED)
    return f"{title(UNLISTED)}, at {site} (root mean square {said(usual_moment(forward, f), 'N m', 2)})"


def in_all(lead: frozenset[str], credible: list[frozenset[str]]) -> frozenset[str]:
    """The effects that are named, if every explanation holds them and more; else none."""
    return lead if all(c > lead for c in credible) else frozenset()


def undecided(
    sure: frozenset[str], credible: list[frozenset[str]], chances: dict[frozenset[str], float], described: str
) -> str:
    """Between which explanations recordings do not decide, and what acts in all of them, in words.

    Args:
        described: what surely acts, with sites and strengths, in words.
    """
    likely = [c for c in credible if chances[c] > 1.0 - CREDIBLE] or credible[:1]
    each = [f"{_name(c - sure)} (p = {chances[c]:.2f})" for c in likely]
    rest = len(credible) - len(each)
    more = f", and {rest} that {'are' if rest > 1 else 'is'} less probable" if rest else ""
    begin = f"Found: {described}; besides, these" if sure else "These"
    return f"{begin} recordings do not decide between {joined(each)}{more}."


def unnamed_verdict(
    forward: Predictor, given: Fit, base: Fit, compared: float, *, unknown: bool = False
) -> tuple[str, str, list[str]]:
    """Word, sentence and numbers where no effect is more probable than none: adequate, a number, or real and not named.

    Args:
        unknown: whether a discrepancy is real that the refitted model leaves.
    """
    over = over_noise(forward, base)
    if unknown:
        now, anew = bursts(base), len(forward.blocks) > len(forward.recordings)
        text = f"The refitted model{', begun anew in every stretch,' if anew else ''} misses the recordings by "
        text += f"{over:.2f} times the noise"
        if over < FAR:
            text = f"What the refitted model leaves, {over:.2f} times the noise, is more than noise: forces that it "
            text += "lacks act on the device"
        if now.probability > 0.5:
            missed = f"{now.share:.0%} of the stretches are missed by {now.times:.1f} times as much as the others"
            text = f"{text} now and then: {missed}"
        return "UNKNOWN", f"{text}, and nothing in the catalogue explains it.", []
    if compared < COMPARED:
        text = f"Only {compared:.0%} of the frames could be compared; in these nothing is found to be missing."
        return "UNTESTABLE", text, []
    assert base.weights is not None
    given = given.reweighted(base.weights)
    off = [m for m, v in zip(base.free, base.theta, strict=True) if abs(v - m.start) > m.spread]
    if odds_of_numbers(given, base) <= 0.0 or not off:
        text = f"The model is adequate: within what is known of its numbers, its error is {over:.2f} times the noise."
        return "ADEQUATE", text, []
    far = sorted(zip(base.free, base.theta, strict=True), key=lambda m: -abs(m[1] - m[0].start) / m[0].spread)
    f, t = far[0]
    beyond = [m for m, v in far if abs(v - m.start) > m.spread]
    aligned = all(m.aligned for m in beyond)
    recorder = aligned and all(get(m.name.partition(".")[0]).family == "measurement" for m in beyond)
    strain = abs(t - f.start) / f.spread
    text = "Aligning the recording" if aligned else "Refitting the numbers of the model"
    text += f" is enough: {f.label} goes from {said(f.start, f.unit)} to {said(t, f.unit)}, {strain:.1f} standard "
    text += f"deviations of what was known; the error is then {over:.2f} times the noise."
    return "MEASUREMENT" if recorder else "PARAMETER", text, [m.label for m in beyond]


def odds_of_numbers(given: Fit, base: Fit) -> float:
    """Log odds that numbers of the model are off within their priors, against that they are exactly as given."""
    line = base.linear
    assert line is not None
    if not line.tangent[0].shape[1]:
        return -np.inf
    prior = np.maximum(
        base.coordinates.precision, 1e-6
    )  # nothing is known to better than that of those without a prior
    a = np.concatenate([*line.cleared(line.tangent), np.diag(prior)])
    size = np.abs(np.diag(np.linalg.qr(a, mode="r")))
    return float(0.5 * (given.misfit - base.cost) - np.sum(np.log(size / prior)))


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
        likely = [c for c in others if holding(classes, c) > 1.0 - CREDIBLE]
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


def holding(classes: dict[frozenset[str], float], effects: frozenset[str]) -> float:
    """Posterior of effects, whatever acts besides; of none, that nothing does."""
    return sum(v for c, v in classes.items() if c >= effects) if effects else classes.get(effects, 0.0)


def _besides(classes: dict[frozenset[str], float], lead: frozenset[str]) -> list[tuple[str, float]]:
    """The most probable effects that act beside others, with their probabilities."""
    chance = of_each({c - lead: value for c, value in classes.items() if c >= lead})
    likely = sorted(chance.items(), key=lambda item: (-item[1], item[0]))[:LISTED]
    return [(e, v) for e, v in likely if v > 1.0 - CREDIBLE]


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


def explains(b: Budget, left: str, f: Fit) -> str:
    """What a set explains, what numbers of the model do, and how much at which crease is left, in words.

    Where numbers explain more, the one is said that moved farthest.
    """
    text = f"explains {_share(b.named)} of the mismatch"
    if _shows(b.numbers):
        text += f", numbers of the model {b.numbers:.0%}"
    moved = [(s, n, t) for s, n, t in zip(f.strain, f.free, f.theta, strict=True) if n.owner == NOMINAL and s > 1.0]
    if moved and b.numbers > b.named:
        _, n, value = max(moved, key=lambda one: one[0])
        text += f" (above all {n.label}, from {said(n.start, n.unit)} to {said(value, n.unit)})"
    where = f", above all at {left}" if left else ""
    return text + (f"; {b.rest:.0%} is real and not named{where}" if _shows(b.rest) else "")


def _shows(part: float) -> bool:
    """Whether a share of the mismatch is a per cent at least, as it is said."""
    return round(part, 2) > 0.0


def _share(part: float) -> str:
    return f"{part:.0%}" if _shows(part) else "less than 1%"


def _unlisted(d: Decision) -> str:
    """How probable it is that a law is imitated which the catalogue lacks, in words."""
    small = d.foreign < 1.0 - CREDIBLE
    return "" if small else f" A law that the catalogue lacks may do all of this (p = {d.foreign:.2f})."


def _elsewhere(p: Posterior, chance: dict[Key, float], lead: frozenset[str], best: Key) -> str:
    """Where else the same effects may act, in words."""
    where: dict[str, float] = {}
    for key, value in chance.items():
        if p.effects(key) >= lead:
            name = joined(sorted({p.suspect(n).label for n in key if p.suspect(n).effect in lead}))
            where[name] = where.get(name, 0.0) + value
    least = (1.0 - CREDIBLE) * sum(where.values())
    where.pop(joined(sorted({p.suspect(n).label for n in best if p.suspect(n).effect in lead})), None)
    likely = sorted(n for n, v in where.items() if v > least)
    return f" (or {joined(likely[:3])})" if likely else ""


def _name(effects: frozenset[str]) -> str:
    return " with ".join(sorted(title(e) for e in effects)) or "nothing missing"


def _of_recorder(effects: frozenset[str]) -> bool:
    return bool(effects) and all(map(of_recorder, effects))


def log_odds(p: Posterior, key: Key) -> float:
    """Log posterior odds of a set over the model without an effect."""
    return p.total[key] - p.total[frozenset()]

"""The verdict in words."""

from dataclasses import dataclass, field

import numpy as np

from origami_sim.effects import get
from origami_sim.fit.bursts import bursts
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.hypotheses.hypothesis import NOMINAL
from origami_sim.infer.budget import FAR, Budget, Share, over_noise
from origami_sim.infer.intervals import widened
from origami_sim.infer.posterior import CREDIBLE, Key, Posterior
from origami_sim.infer.remainder import mismatch
from origami_sim.infer.unlisted import UNLISTED, crease_of_the_rest, usual_moment
from origami_sim.verdict.decide import (
    ALONE,
    LISTED,
    Decision,
    best_of,
    decide,
    ended_early,
    not_simulated,
    of_each,
    shared_out,
)  # fmt: skip
from origami_sim.verdict.words import change, distinct, joined, said, say, title

COMPARED = 0.9
"""Share of the frames that has to be compared before nothing may be said to be missing."""

STRAINED = 3.0
"""Standard deviations from what was known beyond which a headline says so of a number.

Where ten numbers were known rightly, one in forty headlines says it; with half of it three in four, with double none.
"""

MORE_LAWS = " More laws at once would follow the recordings more closely, as they do where the catalogue lacks one."
"""What is said where the best set is not named."""


@dataclass(frozen=True, eq=False)
class Judgement:
    """What is said.

    Attributes:
        verdict, sentence, probability, chosen: see `Diagnosis`. best: the fit to show. tied: explanations that are not
            told from it, itself among them. others: the next best. budget: of the mismatch. notes: what else to say.
        chance: posterior of the sets that may be named, see `considered`. foreign: see `Decision`.
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
    foreign: float = 0.0

    def of(self, key: Key) -> float:
        """Posterior of a set; of effects, that they are it and no law that the catalogue lacks."""
        return self.chance.get(key, 0.0) * (1.0 - self.foreign if key else 1.0)

    @property
    def outside(self) -> float:
        """Posterior of a law that the catalogue lacks, which sets of effects imitate."""
        return self.foreign * sum(value for key, value in self.chance.items() if key)


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
    common = {"best": shown, "tied": tied, "others": others, "budget": budgeted(d.best).shares}
    common |= {"chance": chance, "foreign": d.foreign}
    over = over_noise(forward, best)
    beyond = f" What it leaves is {over:.1f} times the noise." if over > FAR else ""
    beyond += (MORE_LAWS if more_laws else "") + _unlisted(d)
    suspects = shown.hypothesis.suspects
    chosen = [s.label for s in suspects]
    if d.word == "UNTESTABLE":
        text = "None of the catalogue's suspects is excited by these recordings."
        text = text if p.signatures else "There is no suspect that could act here."
        return Judgement(d.word, text, d.probability, [], **common)
    if d.tie and ended_early(p, chance):
        late = not_simulated(p)
        text = "Not decided yet" + (f": {late} of {len(p.signatures)} suspects were not simulated." if late else ".")
        likely = ([c for c in d.credible if classes[c] > 1.0 - CREDIBLE] or d.credible)[:LISTED]
        if any(likely):
            text += f" Estimated to be most probable{' of the others' if late else ', and not fitted'}: "
            text += f"{joined([f'{_name(c)} (p = {classes[c]:.2f})' for c in likely])}."
        text += " Of what was fitted the best is "
        text += f"{say(shown)}, which {explained}." if suspects else "the model without any effect."
        return Judgement(d.word, text, d.probability, chosen, **common)
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
        text += _unlisted(d)
        return Judgement(d.word, text, np.nan, [shown.hypothesis.label], **common)
    if d.tie:
        names = distinct([f for f in tied if f.hypothesis.suspects]) + (
            ["nothing"] if frozenset() in d.credible else []
        )
        chances = shared_out(classes, d.credible)
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
        text = f"Found: {say(shown, only=d.lead)}{places(p, chance, d.lead, d.best)}"
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
    if unknown or over > FAR:  # so far off, no refit is enough
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
    text += f" is enough: {f.label} goes {change(f.start, t, f.unit)}, {strain:.1f} standard "
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


def _besides(classes: dict[frozenset[str], float], lead: frozenset[str]) -> list[tuple[str, float]]:
    """The most probable effects that act beside others, with their probabilities."""
    chance = of_each({c - lead: value for c, value in classes.items() if c >= lead})
    likely = sorted(chance.items(), key=lambda item: (-item[1], item[0]))[:LISTED]
    return [(e, v) for e, v in likely if v > 1.0 - CREDIBLE]


def explains(b: Budget, left: str, f: Fit) -> str:
    """What a set explains, what numbers of the model do, and how much at which crease is left, in words.

    Where numbers explain more, the one is said that moved farthest; and which are far from what was known.
    """
    text = f"explains {_share(b.named)} of the mismatch"
    if _shows(b.numbers):
        text += f", numbers of the model {b.numbers:.0%}"
    moved = [(s, n, t) for s, n, t in zip(f.strain, f.free, f.theta, strict=True) if n.owner == NOMINAL and s > 1.0]
    strained = [f"{n.label} is {s:.1f}" for s, n, _ in sorted(moved, key=lambda one: -one[0]) if s > STRAINED][:LISTED]
    if moved and b.numbers > b.named:
        _, n, value = max(moved, key=lambda one: one[0])
        text += f" (above all {n.label}, {change(n.start, value, n.unit)})"
    where = f", above all at {left}" if left else ""
    text += f"; {b.rest:.0%} is real and not named{where}" if _shows(b.rest) else ""
    return text + (f"; then {joined(strained)} standard deviations from what was known" if strained else "")


def _shows(part: float) -> bool:
    """Whether a share of the mismatch is a per cent at least, as it is said."""
    return round(part, 2) > 0.0


def _share(part: float) -> str:
    return f"{part:.0%}" if _shows(part) else "less than 1%"


def _unlisted(d: Decision) -> str:
    """How probable it is that a law is imitated which the catalogue lacks, in words."""
    small = d.foreign < 1.0 - CREDIBLE
    return "" if small else f" A law that the catalogue lacks may do all of this (p = {d.foreign:.2f})."


def places(p: Posterior, chance: dict[Key, float], lead: frozenset[str], best: Key) -> str:
    """How probable it is that named effects act where it is said, and where else they may, in words."""
    where: dict[str, float] = {}
    fitted: dict[str, Key] = {}
    for key, value in chance.items():
        if p.effects(key) >= lead:
            place = _place(p, key, lead)
            where[place] = where.get(place, 0.0) + value
            if key in p.nodes and value >= chance.get(fitted.get(place, key), 0.0):
                fitted[place] = key
    total = sum(where.values())
    here = where.pop(_place(p, best, lead), 0.0)
    likely = [w for w in sorted(where, key=lambda w: -where[w]) if where[w] > (1.0 - CREDIBLE) * total][:LISTED]
    each = []
    for w in likely:
        turned = len(lead) == 1 and w in fitted and _sign(p, fitted[w], lead) * _sign(p, best, lead) < 0.0
        each.append(f"{'with the opposite sign ' if turned else ''}{w} (p = {where[w] / total:.2f})")
    return f", there with p = {here / total:.2f}, else {' or '.join(each)}" if each else ""


def _place(p: Posterior, key: Key, lead: frozenset[str]) -> str:
    """Where named effects act in a set, in words."""
    mine = sorted({(s.effect, s.site) for s in map(p.suspect, key) if s.effect in lead})
    return joined([f"at {site}" if len(lead) == 1 else f"{title(effect)} at {site}" for effect, site in mine])


def _sign(p: Posterior, key: Key, lead: frozenset[str]) -> float:
    """Which way a named effect acts in a fitted set."""
    f = p.nodes[key].fit
    value = dict(zip((id(n) for n in f.free), f.theta, strict=True))
    (first, *_) = (s.free[0] for s in f.hypothesis.suspects if s.effect in lead)
    return float(np.sign(value[id(first)] - first.start))


def _name(effects: frozenset[str]) -> str:
    return " with ".join(sorted(title(e) for e in effects)) or "nothing missing"

"""Explanations by several effects: pairs that hide each other, further effects, and exchanges among them."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from origami_sim.diagnose import verdict as words
from origami_sim.diagnose.compare import Score, better, score, weights_from
from origami_sim.diagnose.forward import Forward
from origami_sim.diagnose.options import Options
from origami_sim.diagnose.screen import Screening, Signature, again, reweighted
from origami_sim.diagnose.search import NEAR, contest, distinct, finished, leader, look_elsewhere, refit, roughly
from origami_sim.effects import get
from origami_sim.fit.hypothesis import Hypothesis, Suspect, distinct_sites
from origami_sim.fit.least_squares import Fit, Weights, fit

MORE = 4.0
"""Times as much as a signature promises that a fit is thought to gain, at most."""


def pairs(forward, base: Fit, screening: Screening, fits: list[Fit], weights: Weights, o: Options) -> list[Fit]:
    """The best pair of suspects by the screening, if it promises much more than the best single one gives.

    What they promise is measured by the noise alone: in the weights of the model without them, they are noise. No pair
    can explain more than there is beside the noise.
    """
    if o.most < 2:
        return []
    sharp = Weights(forward.blocks[0].noise)
    plain = base.reweighted(weights, sharp)
    seen = reweighted(screening, plain, weights, sharp)
    r, top = seen.residual, distinct(seen.signatures)[:12]

    def missed(f: Fit) -> float:
        """What a fit misses of the screened blocks."""
        line = f.reweighted(weights, sharp).linear
        assert line is not None
        return float(sum(line.residual[f.blocks.index(b)] @ line.residual[f.blocks.index(b)] for b in seen.blocks))

    gains = {f.hypothesis.label: missed(base) - missed(f) for f in fits if not f.failed}
    single = max([*(s.score**2 for s in top), *gains.values()])
    there = missed(base) - sum(np.isfinite(forward.blocks[b].values).sum() for b in seen.blocks)
    best, most = None, 0.0
    for a, b in combinations(top, 2):
        both = np.stack([a.shape, b.shape], axis=1)
        if not distinct_sites(a.suspect, b.suspect):
            continue
        if abs(a.shape @ b.shape) > 0.95 or min(abs(a.score), abs(b.score)) < 2.0:
            continue
        x, *_ = np.linalg.lstsq(both, r, rcond=None)
        if np.sign(x[0]) != np.sign(a.score) or np.sign(x[1]) != np.sign(b.score):
            continue
        # fits gain other amounts than signatures promise, for which strengths are small
        more = max(gains.get(s.suspect.label, 0.0) / s.score**2 for s in (a, b))
        explained = min(float(np.sum((both @ x) ** 2)) * float(np.clip(more, 1.0, MORE)), there)
        if explained > most:
            best, most = (a, b), explained
    if best is None or most - single < 9.0 + 0.1 * single:
        return []
    first, second = (_counterpart(screening, s) for s in best)
    known = [f for f in fits if f.hypothesis.suspects == (first.suspect,)]
    one = known[0] if known else refit(forward, base, first, weights, screening)
    if one.failed:
        return []
    both = refit(forward, one, second, weights, screening)
    return [both] if known else [one, both]


def _counterpart(screening: Screening, found: Signature) -> Signature:
    """The same signature in other weights, in which it may not stand out enough to be tested."""

    def key(s: Suspect):
        return s.label, tuple((n.name, n.start) for n in s.free[1:])

    return next(s for s in (*screening.signatures, *screening.untestable) if key(s.suspect) == key(found.suspect))


RIVALS = 3
"""Further effects that are tried at a time."""

SAME, OTHER = 0.7, 0.5
"""Parts of the best further suspect's squared score from which on the same effect at other sites, and others, count."""


def combine(forward, fits, scores, screening: Screening, weights, o: Options, tell) -> list[Fit]:
    """Adds effects to the best explanation while held-out data ask for it, and exchanges each of several."""
    more: list[Fit] = []
    base, best, asked, exchanged, extended = fits[0], leader(fits, scores), True, set(), set()
    while best is not None and best is not base:
        several = len(best.hypothesis.suspects)
        tell("combine", several / (o.most + 1))
        if several > 1 and id(best) not in exchanged:  # what stands in for another may ask for a further effect
            exchanged.add(id(best))
            more += swaps(forward, base, best, [*fits, *more], scores, screening, weights)
            more += spared(forward, [*fits, *more], scores, weights)
            best = leader([*fits, *more], scores)
        elif asked and several < o.most and id(best) not in extended:
            extended.add(id(best))
            tried, told = further(forward, best, [*fits, *more], scores, screening, weights, o)
            more += tried
            asked, best = told is not None, told or leader([*fits, *more], scores)
        else:
            break
    return more


def further(
    forward, best: Fit, fits, scores, screening: Screening, weights, o: Options
) -> tuple[list[Fit], Fit | None]:
    """New fits of the best explanation and one effect more; of all such, the one that held-out data ask for."""
    base = fits[0]
    left = again(screening, best)
    if not left.signatures:
        return [], None
    top, found = left.signatures[0], distinct(left.signatures)
    structured = words.structure(best, best).repeated >= words.STRUCTURED
    inexact = top.score**2 < words.INEXACT * (base.cost - best.cost) and shares(best, top.suspect)
    told = look_elsewhere(left, o.draws, o.seed, small=words.SMALL) <= o.level and not inexact
    if not (told or structured):
        return [], None
    turns = [found]
    if told:  # the best one at other sites, too; if none of them will do, what scores nearly as much
        same = [g for g in found if g.suspect.effect == top.suspect.effect and g.score**2 > SAME * top.score**2]
        turns = [same, [g for g in found if g not in same and g.score**2 > OTHER * top.score**2]]
    new: list[Fit] = []
    for turn in turns:
        made = {g.suspect.label: _made(fits, (*best.hypothesis.suspects, g.suspect)) for g in turn[:RIVALS]}
        fresh = contest(forward, best, [g for g in turn[:RIVALS] if not made[g.suspect.label]], screening, weights)[1:]
        fresh = [f for f in fresh if not f.failed]
        tried = [*fresh, *(f for f in made.values() if f is not None and not f.failed)]
        new += fresh
        if not tried:
            continue
        scores |= {id(f): score(forward, f, weights) for f in fresh}
        f = max(tried, key=lambda f: scores[id(f)].evidence)
        if told:
            asked = better(scores[id(f)], scores[id(best)])
        else:
            asked = stands_out(forward, base, best, f, screening, weights, o)
        if asked:
            return new, f
    return new, None


def shares(best: Fit, s: Suspect) -> bool:
    """Whether a further effect may be what inexact laws of an explanation leave.

    What a law of a crease leaves acts at that crease, and what a law that keeps the energy leaves keeps it. A
    recorder's errors have exact laws.
    """
    mechanisms = [t for t in best.hypothesis.suspects if t.kind != "measurement"]
    apart = {"crease", "panel"}

    def beside(t: Suspect) -> bool:
        elsewhere = s.kind == t.kind and s.kind in apart and distinct_sites(t, replace(s, effect=t.effect))
        a, b = get(s.effect), get(t.effect)
        return elsewhere or (a.conservative and b.dissipates) or (a.dissipates and b.conservative)

    return any(not beside(t) for t in mechanisms)


def stands_out(
    forward: Forward, base: Fit, best: Fit, f: Fit, screening: Screening, weights: Weights, o: Options
) -> bool:
    """Whether a further effect is told by the weights of the fit with it; in others, what it explains is noise."""
    new = weights_from(forward, [f])
    none, less, all_ = (g.reweighted(weights, new) for g in (base, best, f))
    if less.cost - all_.cost < words.INEXACT * (none.cost - less.cost) and shares(best, f.hypothesis.suspects[-1]):
        return False
    left = again(reweighted(screening, none, weights, new), less)
    if not left.signatures or look_elsewhere(left, o.draws, o.seed, small=words.SMALL) > o.level:
        return False
    return better(score(forward, all_, new), score(forward, less, new))


def swaps(forward, base: Fit, best: Fit, fits, scores, screening: Screening, weights) -> list[Fit]:
    """Of several effects, each is left out in turn, and the others that could take its place are tried."""
    out: list[Fit] = []
    near = {"known": best.linear, "kept": len(forward.subject.nominals)}
    for s in best.hypothesis.suspects:
        rest = tuple(t for t in best.hypothesis.suspects if t is not s)
        known = [f for f in (*fits, *out) if _same(f.hypothesis, rest) and not f.failed]
        rest = known[0].hypothesis.suspects if known else rest
        place = numbers_kept(best, rest)
        inner = known[0] if known else fit(forward, Hypothesis(rest), weights, theta=place, local=best.local, **near)
        if inner.failed:
            continue
        if not known:
            scores[id(inner)] = score(forward, inner, weights)
            out.append(inner)
        left = again(screening, inner)
        for g in distinct(left.signatures)[:RIVALS]:
            wanted = (*inner.hypothesis.suspects, g.suspect)
            if any(_same(f.hypothesis, wanted) for f in (*fits, *out)):
                continue
            f = roughly(forward, inner, g, weights, screening)
            theta = np.concatenate([place, f.theta[len(inner.free) :]])
            other = fit(forward, f.hypothesis, weights, theta=theta, local=best.local, rough=True, **near)
            f = min(f, other, key=lambda f: f.reach)
            if f.reach < best.cost + NEAR:
                f = finished(forward, f, weights)
            if not f.failed:
                scores[id(f)] = score(forward, f, weights)
                out.append(f)
    return out


def spared(forward: Forward, fits: Sequence[Fit], scores: dict[int, Score], weights: Weights) -> list[Fit]:
    """Of the best explanations by several effects: without those whose strength is not told from none.

    What is left may have been fitted before, and have been stuck far from where this fit came to.
    """
    out: list[Fit] = []
    good = [f for f in fits if id(f) in scores]
    most = max(scores[id(f)].evidence for f in good)
    for f in good:
        if len(f.hypothesis.suspects) < 2 or scores[id(f)].evidence < most - words.CLOSE:
            continue
        sure = dict(zip((id(n) for n in f.free), zip(f.theta, f.deviations(), strict=True), strict=True))
        for s in f.hypothesis.suspects:
            told = any(abs(sure[id(n)][0] - n.start) > 2.0 * sure[id(n)][1] for n in s.strengths)
            rest = tuple(t for t in f.hypothesis.suspects if t is not s)
            near = [g for g in (*fits, *out) if _same(g.hypothesis, rest) and g.cost < f.cost + words.CLOSE]
            if told or near:
                continue
            near = {"known": f.linear, "kept": len(forward.subject.nominals)}
            fewer = fit(forward, Hypothesis(rest), weights, theta=numbers_kept(f, rest), local=f.local, **near)
            if not fewer.failed:
                scores[id(fewer)] = score(forward, fewer, weights)
                out.append(fewer)
    return out


def _made(fits: Sequence[Fit], wanted: tuple[Suspect, ...]) -> Fit | None:
    """The fit of these suspects, if there is one."""
    return next((f for f in fits if _same(f.hypothesis, wanted)), None)


def _same(hypothesis: Hypothesis, wanted: tuple[Suspect, ...]) -> bool:
    return {s.label for s in hypothesis.suspects} == {s.label for s in wanted}


def numbers_kept(f: Fit, rest: tuple[Suspect, ...]) -> np.ndarray:
    """The numbers of a fit that a smaller hypothesis of these suspects still has."""
    ends = np.cumsum([len(f.free) - len(f.hypothesis.free), *(len(s.free) for s in f.hypothesis.suspects)])
    own = {s.label: f.theta[a:b] for s, a, b in zip(f.hypothesis.suspects, ends[:-1], ends[1:], strict=True)}
    return np.concatenate([f.theta[: ends[0]], *(own[s.label] for s in rest)])

"""Which single suspects are fitted, from where, and how far; of the fits, the best."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from origami_sim.diagnose import verdict as words
from origami_sim.diagnose.compare import Score, score, supported, weights_from
from origami_sim.diagnose.forward import Forward
from origami_sim.diagnose.hypothesis import Suspect, distinct_sites
from origami_sim.diagnose.options import Options, Report
from origami_sim.diagnose.refit import LITTLE, Fit, Weights, carried_on, fit, promised
from origami_sim.diagnose.screen import Projector, Screening, Signature, reweighted, screen, widening
from origami_sim.diagnose.static import CurveForward


def look_elsewhere(screening: Screening, draws: int, seed: int, fits: Sequence[Fit] = (), *, small: int = 0) -> float:
    """Chance that noise alone gives any suspect so high a score: draws of white residuals, the same projection.

    Args:
        small: so many suspects, drawn at random, act with a score of `words.SHOWN` each beside the noise.
        fits: the model without an effect, then those with one; what they gain counts if it is more than the screening
            saw, which knows small effects only.
    """
    if not screening.signatures:
        return 1.0
    shapes = np.stack([s.shape for s in screening.signatures])
    rng = np.random.default_rng(seed)
    # the scores of white noise have the covariance of the signatures' overlaps
    overlap = shapes @ shapes.T
    value, vector = np.linalg.eigh(overlap)
    draws_ = rng.normal(size=(draws, len(value))) * np.sqrt(np.maximum(value, 0.0)) @ vector.T
    for _ in range(small):
        sign = rng.choice([-words.SHOWN, words.SHOWN], size=(draws, 1))
        draws_ += sign * overlap[rng.integers(len(overlap), size=draws)]
    highest = np.abs(draws_).max(axis=1)
    found = max(abs(s.score) for s in screening.signatures)
    for f in fits[1:]:
        if not f.failed and len(f.hypothesis.suspects) == 1:
            gain = fits[0].cost - f.cost - 2.0 * (len(f.hypothesis.free) - 1)
            found = max(found, np.sqrt(max(gain, 0.0)))
    return float((1 + np.count_nonzero(highest >= found)) / (draws + 1))


def chosen(screening: Screening, most: int) -> list[Signature]:
    """The best suspects, at most so many; of those that look the same, the best only."""
    out: list[Signature] = []
    for s in distinct(screening.signatures):
        if len(out) >= most or abs(s.score) < 2.0:
            break
        if not any(alike(s, t) for t in out):
            out.append(s)
    return out


def distinct(found: Sequence[Signature]) -> list[Signature]:
    """Of signatures of one suspect, with several time constants, the first."""
    first: dict[str, Signature] = {}
    for s in found:
        first.setdefault(s.suspect.label, s)
    return list(first.values())


def alike(a: Signature, b: Signature) -> bool:
    """Whether these recordings cannot tell two suspects apart, by less than half a unit of log likelihood."""
    strength = max(abs(a.score), abs(b.score), 1.0)
    return 1.0 - float(a.shape @ b.shape) ** 2 < 1.0 / strength**2


SHAPES = (0.3, 3.0)
"""Factors on the typical value of a suspect's second number (a time, an angle) from which fits begin as well."""


def roughly(
    forward: Forward, base: Fit, found: Signature, weights: Weights, screening: Screening, most: int = 5
) -> Fit:
    """The same, with the derivatives by nominals and starts that the fit without the suspect had.

    Of a suspect with a second number, which sets the shape of its signature, several values are tried.
    """
    s = found.suspect
    begin = None
    if list(base.blocks) == screening.blocks and found.parts:
        assert base.linear is not None
        unit = s.free[0].scale / found.size
        rest = len(s.free) - 1
        parts = [base.linear.below(n, p) for n, p in enumerate(found.parts)]
        columns = [np.concatenate([unit * p[:, None], np.zeros((len(p), rest))], axis=1) for p in parts]
        begin = base.linear.beside(columns, len(base.free))

    def fitted(second: float, begin) -> Fit:
        values = [f.start for f in s.free]
        if len(values) > 1:
            values[1] = float(np.clip(second * values[1], s.free[1].lower, s.free[1].upper))
        return fit(
            forward,
            base.hypothesis.plus(s),
            weights,
            theta=np.concatenate([base.theta, values]),
            local=base.local,
            blocks=base.blocks,
            most=most,
            known=base.linear,
            kept=len(base.free),
            begin=begin,
            rough=True,
        )

    tried = [fitted(1.0, begin)]
    if len(s.free) > 1:
        tried += [fitted(part, None) for part in SHAPES]
    return min(tried, key=lambda f: f.cost)


def finished(forward: Forward, f: Fit, weights: Weights, most: int = 5) -> Fit:
    """A rough fit, carried on with derivatives of its own."""
    if f.failed or f.promise == np.inf:
        return f
    return carried_on(forward, f, weights, most=most)


def refit(forward: Forward, base: Fit, found: Signature, weights: Weights, screening: Screening, most: int = 5) -> Fit:
    """The nominal model with one more suspect: from the fit without it and its signature, which cannot become worse."""
    return finished(forward, roughly(forward, base, found, weights, screening, most), weights, most)


HOPE, NEAR = 0.5, 50.0
"""A rough fit is carried on if it gains, or promises, this part of what the best one gains, or all but so much cost."""


def contest(
    forward: Forward,
    base: Fit,
    finalists: Sequence[Signature],
    screening: Screening,
    weights: Weights,
    tell: Callable[[float], None] = lambda part: None,
) -> list[Fit]:
    """A fit, and that with each finalist more; those that neither are nor promise to be good stay rough."""
    fits = [base]
    for n, s in enumerate(finalists):
        tell(0.5 * n / len(finalists))
        fits.append(roughly(forward, base, s, weights, screening))
    gain = base.cost - min(f.cost for f in fits)
    enough = base.cost - min(HOPE * gain, gain - NEAR)
    for n, f in enumerate(fits):
        tell(0.5 + 0.5 * n / len(fits))
        if n and f.reach <= enough:
            fits[n] = finished(forward, f, weights)
    return fits


FAR = 2.0
"""Standard deviations from what was recorded beyond which a fitted start makes up for what the model lacks."""

UNBENT = 3
"""How many of these are fitted."""


def bent(forward: Forward, f: Fit, by: float = 1.0) -> list[int]:
    """The blocks whose fitted start is further from what was recorded than so many of its standard deviations."""
    if not forward.local:
        return []
    away = np.abs(f.local - forward.told(f.hypothesis, f.theta))
    return [b for b in f.blocks if np.any(away[b] > by * forward.blocks[b].known)]


def unbent(
    forward: Forward, base: Fit, every: Sequence[Suspect], fits: Sequence[Fit], weights: Weights, o: Options
) -> list[Fit]:
    """The suspects that stand out where what was bent to make up for them is put back, fitted from there.

    Put back are starts far from what was recorded, and numbers far from what was known of them. Seen from a bent
    start, an effect can have the wrong sign; from a bent number, it can seem not to matter, so that then those that
    were fitted are fitted again.
    """
    far, given = bent(forward, base, FAR), np.array([f.start for f in base.free])
    strained = np.abs(base.theta - given) > words.STRAINED * np.array([f.spread for f in base.free])
    if not (far or strained.any()):
        return []
    theta, local = np.where(strained, given, base.theta), base.local.copy()
    if far:
        local[far] = forward.told(base.hypothesis, theta)[far]
    back = fit(forward, base.hypothesis, weights, theta=theta, local=local, most=0)
    if back.failed:
        return []
    seen = screen(forward, every, back, weights, most=o.screened)
    if strained.any():
        found = contest(forward, back, chosen(seen, o.finalists), seen, weights)[1:]
    else:
        known = {f.hypothesis.label for f in fits}
        new = [s for s in chosen(seen, UNBENT) if s.suspect.label not in known]
        found = [refit(forward, back, s, weights, seen, most=8) for s in new]
    return improved(found, fits)


def improved(new: Sequence[Fit], fits: Sequence[Fit]) -> list[Fit]:
    """Those of new fits that end below all of the same hypothesis."""
    return [f for f in new if all(g.cost > f.cost for g in fits if g.hypothesis.label == f.hypothesis.label)]


TWINS = 8
"""Suspects that may be as good as the best explanation and are fitted beside it, at most."""

SEEN = 3.0
"""Score from which on a suspect is fitted because of what it promises."""


def twins(forward: Forward, rough: Screening, screening: Screening, fits: Sequence[Fit], weights: Weights) -> list[Fit]:
    """The single suspects that may be as good as the best of those that were fitted, fitted as well.

    They looked the same as one of the best, or promise about as much: of effects that hardly show, many do.

    Args:
        rough: the screening by which fits were chosen, whose weights may have hidden differences. screening: the same
            with the present weights.
    """
    scores = {id(f): score(forward, f, weights) for f in fits if not f.failed}
    good = [f for f in fits if id(f) in scores]
    evidence = supported(good, scores)
    near = [f for f, e in zip(good, evidence, strict=True) if e > max(evidence) - words.CLOSE]
    done = {f.hypothesis.label for f in fits}
    best = [s for f in near for s in rough.signatures if f.hypothesis.label == s.suspect.label]
    same = {s.suspect.label for s in rough.signatures for m in best if s.score and alike(s, m)}
    single = min((f for f in good if len(f.hypothesis.suspects) < 2), key=lambda f: f.cost)
    gain = fits[0].only(screening.blocks).misfit - single.only(screening.blocks).misfit
    least = max(SEEN**2, gain - 2.0 * words.CLOSE)
    rest = [s for s in distinct(screening.signatures) if s.suspect.label not in done]
    again = [s for s in rest if s.suspect.label in same]
    again += [s for s in rest if s not in again and s.score**2 > least]
    out = []
    for s in again[:TWINS]:
        f = roughly(forward, fits[0], s, weights, screening)
        out.append(finished(forward, f, weights) if f.reach < single.cost + NEAR else f)
    return out


LOOKALIKE = 0.9
"""Isolability from which a suspect is fitted as a lookalike."""

MOST_ALIKE = 5
"""Lookalikes that are fitted, at most."""

LINEAR = 0.5
"""Part of a fit's gain that its signature promised, from which on signatures tell what looks the same."""


def lookalikes(
    forward: Forward, every: Sequence[Suspect], screening: Screening, fits: Sequence[Fit], weights: Weights
) -> list[Fit]:
    """The suspects that look the same as the best single explanation where that was fitted, fitted from there.

    Those, too, that were fitted from elsewhere and ended far from it, if they end nearer now. Where its effect is
    large, what starts and numbers make up for without it is, too: seen from there, two suspects that are the same (a
    clock and a drive that are late) can look different. They are compared in one segment.
    """
    scores = {id(f): score(forward, f, weights) for f in fits if not f.failed}
    base, best = fits[0], leader(fits, scores)
    if best is None or len(best.hypothesis.suspects) != 1 or isinstance(forward, CurveForward):
        return []
    label, own = best.hypothesis.label, len(base.free)
    seen = max((g.score**2 for g in screening.signatures if g.suspect.label == label), default=0.0)
    if seen > LINEAR * (base.cost - best.cost):
        return []
    assert best.linear is not None
    effect = [best.linear.clear(n, t[:, own]) for n, t in enumerate(best.linear.tangent)]
    n = max(range(len(effect)), key=lambda n: effect[n] @ effect[n])
    part = best.only([best.blocks[n]])
    done = {f.hypothesis.label for f in fits if f is best or f.reach < best.cost + words.CLOSE}
    (mine,) = best.hypothesis.suspects
    rest = [s for s in every if s.label not in done and distinct_sites(s, mine)]
    at_fit = screen(forward, rest, part, weights)
    assert part.linear is not None
    line = part.linear.beside([np.zeros((len(t), 0)) for t in part.linear.tangent], own)
    project = Projector(replace(part, free=base.free, linear=line), part.blocks)
    shape = project([part.linear.tangent[0][part.linear.data(0), own]])
    strength = (best.theta[own] - best.free[own].start) / best.free[own].scale
    found = []
    for g in (*at_fit.signatures, *at_fit.untestable):
        theirs = project(g.parts) if g.parts else np.zeros(len(shape))
        same = float(shape @ theirs / max(np.linalg.norm(shape) * np.linalg.norm(theirs), 1e-300))
        if abs(same) < LOOKALIKE:
            continue
        first = g.suspect.free[0]
        value = first.start + strength * float(shape @ theirs) / float(theirs @ theirs) * g.size
        if first.lower <= value <= first.upper:
            found.append((abs(same), g.suspect, value))
    most: dict[str, tuple[Suspect, float]] = {}
    for _, s, value in sorted(found, key=lambda f: -f[0]):
        most.setdefault(s.label, (s, value))
    out = []
    for s, value in list(most.values())[:MOST_ALIKE]:
        begin = np.concatenate([best.theta[:own], [value], [f.start for f in s.free[1:]]])
        near = {"theta": begin, "local": best.local, "blocks": best.blocks, "known": best.linear, "kept": own}
        f = fit(forward, base.hypothesis.plus(s), weights, rough=True, **near)
        out.append(finished(forward, f, weights) if f.reach < best.cost + NEAR else f)
    return improved(out, fits)


def renewed(fits: Sequence[Fit], new: Sequence[Fit]) -> list[Fit]:
    """All fits, new ones in the place of those of the same hypothesis."""
    return [*{f.hypothesis.label: f for f in [*fits, *new]}.values()]


MANY = 6
"""Suspects that are fitted to all recordings where none leaves noise alone."""


def others(
    forward: Forward, seen: tuple[Fit, Screening, Weights], fits: Sequence[Fit], weights: Weights, tell: Report
) -> list[Fit]:
    """Where the best explanation leaves structure: the best of all suspects that were not fitted alone, fitted as well.

    A screening knows small changes only, and is no reason to refuse a suspect where what is missing is large. All are
    fitted to the segment that the model without an effect misses most, and those that explain most of it to all.

    Args:
        seen: the model without an effect, the screening about it, and their weights. weights: those of the fits.
    """
    base, screening, old = seen
    scores = {id(f): score(forward, f, weights) for f in fits if not f.failed}
    best = leader(fits, scores)
    if best is None or not words.lacking(fits[0], best):
        return []
    done = {f.hypothesis.label for f in fits}
    rest = [s for s in distinct(screening.signatures) if abs(s.score) >= 2.0 and s.suspect.label not in done]
    assert base.linear is not None
    missed = [r @ r for r in base.linear.residual]
    worst = max(range(len(screening.blocks)), key=lambda n: missed[base.blocks.index(screening.blocks[n])])
    block, tried = [screening.blocks[worst]], []
    part, seen_there = base.only(block), replace(screening, blocks=block)
    for n, s in enumerate(rest):
        tell("other suspects", 0.8 * n / len(rest))
        tried.append(roughly(forward, part, s.only(worst), old, seen_there))
    good = sorted((f for f in tried if not f.failed), key=lambda f: f.reach)[:MANY]
    out = []
    for n, f in enumerate(good):
        tell("other suspects", 0.8 + 0.2 * n / len(good))
        given = {"theta": f.theta, "local": base.local, "known": base.linear, "kept": len(base.free)}
        out.append(finished(forward, fit(forward, f.hypothesis, old, rough=True, **given), old))
    return [f.reweighted(old, weights) for f in out if not f.failed]


HOPELESS = 4.0
"""How many times the cost of the best fit one may have that is refined."""

CONTENDERS = 5
"""Fits that are refined, beside the model without any effect."""

AGAIN = 2
"""Of these, how many are also fitted anew from the starts that were recorded; all, if that led one far down."""


def settled(
    forward: Forward, screening: Screening, fits: list[Fit], weights: Weights, refined: Sequence[Fit] = ()
) -> tuple[Screening, list[Fit], Weights]:
    """The fits with the weights of the best one, which first counted what it lacks as noise; the best ones refined.

    Args:
        refined: fits that have been, with the weights given.
    """
    new = weights_from(forward, fits)
    same = np.all(np.abs(np.log(new.deviation / weights.deviation)) < 0.05)
    if same and abs(np.log(new.part / weights.part)) < 0.2:
        new = weights
    out = [f if f.failed else f.reweighted(weights, new) for f in fits]
    least = min(f.cost for f in out)
    order = [n for n, f in enumerate(out) if n and not f.failed and f.cost < HOPELESS * least]
    order.sort(key=lambda n: out[n].cost)
    far = False
    for place, n in enumerate([0, *order[:CONTENDERS]]):
        f = out[n]
        if new is weights and any(fits[n] is r for r in refined):
            continue
        if n and f.cost > least + NEAR and promised(forward, f) > least + NEAR:
            continue
        out[n] = carried_on(forward, f, new)
        if new is not weights and (far or place <= AGAIN) and bent(forward, out[n]) and f.cost < HOPELESS * least:
            # starts that made up for what the model lacked can be far off: those that were recorded are tried as well
            near = {"known": out[n].linear, "kept": len(forward.subject.nominals) if n else 0}
            other = fit(forward, f.hypothesis, new, theta=f.theta, blocks=f.blocks, **near)
            if other.cost < out[n].cost - LITTLE:
                far |= other.cost < out[n].cost - NEAR
                out[n] = carried_on(forward, other, new)
    return reweighted(screening, out[0], weights, new), out, new


def widened(forward: Forward, screening: Screening, f: Fit, weights: Weights) -> np.ndarray:
    """How effects that are too small to be told widen a fit's intervals (P,); less where a fit leaves more than noise.

    What is left already counts as noise in the weights.
    """
    noise = np.minimum(forward.blocks[0].noise / weights.deviation, 1.0)
    return widening(screening, f, words.ALLOWED * float(np.mean(noise**2)) * weights.part)


def leader(fits: Sequence[Fit], scores: dict[int, Score]) -> Fit | None:
    """The fit of the highest evidence."""
    good = [f for f in fits if id(f) in scores]
    return good[int(np.argmax(supported(good, scores)))] if good else None

"""Search for the sets of effects that the recordings support: linear evidence proposes, fits decide.

About every fit the evidence of all sets that add one or two effects to it is known in closed form. The set with the
largest posterior that has not been fitted is fitted next, until what has not been fitted holds little. Each set is
judged by the linearisation that is nearest to it: its own, if it was fitted.

Half and double of UNFITTED, LEADING and OWED change no word on four swings (two rub, one stiffens, one lacks nothing),
and no probability by more than 0.011.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np
from scipy.special import gammaln, logsumexp
from scipy.stats import t as student

from origami_sim.fit.evidence import Sets, Summed, log_occam
from origami_sim.fit.hyper import HYPER, Hyper
from origami_sim.fit.implied import OwnColumns, with_own_noise
from origami_sim.fit.least_squares import Fit, carried_on, fit, promised, renewed, small
from origami_sim.fit.nominal import level
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.profile import OWED
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import Hypothesis, Suspect, distinct_sites
from origami_sim.infer.basins import Calm, elsewhere
from origami_sim.infer.budget import FAR, over_noise
from origami_sim.infer.columns import Columns
from origami_sim.infer.foresight import Foresight
from origami_sim.infer.judged import judged
from origami_sim.infer.posterior import Estimate, Key, Node, Posterior
from origami_sim.infer.scan import from_given_numbers, over_their_range, scanned, strained
from origami_sim.infer.screen import Signature, screen
from origami_sim.infer.unlisted import anywhere, beside
from origami_sim.predict.spectra import without_idle
from origami_sim.threads import shared

UNFITTED = 0.05
"""Part of the best set's posterior up to which another is not worth a fit: what is named holds four times the rest."""

FITS = 16
"""Sets that are fitted at most, before leaders are polished and after."""

LEADING = 12
"""Single effects, those that promise most, that are paired with all others, and fitted if they may be best.

It bounds the time of a search.
"""

CELLS = 8
"""Cells of the grid of discrepancies for which pairs are judged: those that hold nearly all of the posterior."""

MANY = 200
"""Sets beyond which only these cells are looked at."""

TOGETHER = 768
"""Sets times cells that are judged at once, while other cores judge others: some 10 ms of work.

It decides on time alone: with twice as many eight cores take 1.4 times as long, and one core 0.95 times."""


def search(
    forward: Predictor,
    base: Fit,
    signatures: list[Signature],
    weights: Weights,
    *,
    given: Fit | None = None,
    calm: Calm | None = None,
    progress: Callable[[float], None] | None = None,
    most: int = FITS,
    store: bool = False,
) -> Posterior:
    """The posterior over sets of effects, from the refitted model without any.

    Args:
        given: the model with its numbers as they were given, about which single effects are judged too if the refit
            took them further than chance would.
        calm: what makes it linear if it has many basins, see `basins`.
    """
    out = Posterior(signatures, weights, store=store)
    _add(out, forward, frozenset(), base, log_priors(signatures))
    if calm is not None:
        _begun(out, forward, calm)
    elif given is not None and strained(base):
        _about_given(out, forward, base, given)
    extended(out, forward, progress=progress, most=most)
    while polished(out, forward) or reconsidered(out, forward, base, progress=progress):
        extended(out, forward, progress=progress, most=most)
    while (key := out.most_probable) not in out.nodes:  # what is named has to be fitted, however many were
        _tried(out, forward, key)
    beyond_the_catalogue(out, forward)
    return out


def _about_given(out: Posterior, forward: Predictor, base: Fit, given: Fit) -> None:
    """Enters what single effects promise about the model as given, where the refit left its numbers' priors."""
    by = level(forward, base)
    given = fit(forward, Hypothesis(), by, local=given.local, most=0)  # with derivatives by its numbers
    about = screen(forward, [s.suspect for s in out.signatures], given, by)
    of = {s.suspect.form: s for s in about}  # their strengths have another scale here
    alone = {k: of.get(out.suspect(n).form) for k in out.estimates if len(k) == 1 for n in k}
    known = {k: s for k, s in alone.items() if s is not None}
    _promised(out, list(known), from_given_numbers(forward, list(known.values()), given, base, by))


def _begun(out: Posterior, forward: Predictor, calm: Calm) -> None:
    """Enters the fits that calm a rough model; what it promises itself is forgotten, but for what was simulated."""
    alone = {frozenset((n,)): one for n, one in enumerate(calm.found) if one is not None}
    for key in list(out.estimates):
        if key in alone:
            out.total[key] = out.promise[key] = -np.inf
        else:
            out.drop(key)
    known = [k for k in alone if k in out.estimates]
    _promised(out, known, [alone[k] for k in known])
    for n, f in calm.fits.items():
        _add(out, forward, frozenset((n,)), f, log_priors(out.signatures))
    out.reconsidered = out.rough = True


def reconsidered(
    out: Posterior, forward: Predictor, base: Fit, *, progress: Callable[[float], None] | None = None
) -> bool:
    """Simulates every single effect at several strengths where nothing explains a recording; whether any promises more.

    A model that snaps, or a crease that sticks, has no derivatives that tell why. So before nothing is said to explain
    a recording, each effect is tried over its range, once.
    """
    if out.reconsidered or over_noise(forward, out.nodes[out.leader].fit) < FAR:
        return False
    out.reconsidered = True
    alone = [k for k in out.estimates if len(k) == 1]
    suspects = [out.suspect(n) for k in alone for n in k]
    return _promised(out, alone, over_their_range(forward, suspects, base, level(forward, base), progress))


def beyond_the_catalogue(out: Posterior, forward: Predictor) -> None:
    """Enters a smooth moment of a crease that no law gives, if it may be as probable as the best set.

    It is fitted alone, and competes with what was found: where that is right the moment explains less, as it cannot do
    what laws of the drive, of memory or with sharp bends do.
    """
    if all(s.status for s in out.signatures):  # nothing can be tested
        return
    best, none = max(out.total[k] for k in _named(out)), out.nodes[frozenset()].fit
    about = beside(forward, none, anywhere(forward), out.hyper)
    if not about:
        return
    suspect, begin, gain = max(about, key=lambda one: one[2])
    every, key = [*out.signatures, Signature(suspect, [], np.ones(1))], frozenset({len(out.signatures)})
    prior = log_priors(every)
    odds = _log_prior(key, prior, out.hyper) - _log_prior(frozenset(), prior, out.hyper)
    if out.total[frozenset()] + gain + odds < best + np.log(UNFITTED):
        return
    out.signatures.append(every[-1])
    theta = np.concatenate([none.theta, begin])
    f = fit(forward, Hypothesis((suspect,)), level(forward, none), theta=theta, local=none.local)
    if f.failed:
        out.failed[key] = f.failed
    else:
        enter(out, _node(out, forward, key, f)[0], prior)


def _promised(out: Posterior, alone: Sequence[Key], found: Iterable[tuple[np.ndarray, float] | None]) -> bool:
    """Enters where single effects may begin, and what they then gain over the model without any; whether any gain more.

    The gain is charged as for strengths that are as sharp as data of that many standard deviations make them.
    """
    prior, none, some = log_priors(out.signatures), frozenset(), False
    for key, one in zip(alone, found, strict=True):
        if one is None:
            continue
        theta, gain = one
        (suspect,) = map(out.suspect, key)
        begun = theta[len(theta) - len(suspect.free) :]
        change = [(v - f.start) / f.scale for v, f in zip(begun, suspect.free, strict=True) if f in suspect.strengths]
        occam = log_occam(gain, np.array(change), out.hyper)
        odds = _log_prior(key, prior, out.hyper) - _log_prior(none, prior, out.hyper)
        promise = out.total[none] + gain + occam + odds
        if promise > _promise(out, key):
            out.promise[key], out.begun[key], some = promise, theta, True
            out.ranked[key] = promise
    out.ranked = dict(sorted(out.ranked.items(), key=lambda item: -item[1]))
    return some


def extended(
    out: Posterior, forward: Predictor, *, progress: Callable[[float], None] | None = None, most: int = FITS
) -> Posterior:
    """Fits sets until none that has not been fitted holds much of the posterior."""
    for n in range(most):
        if progress:
            progress(n / most)
        key = _likely(out)
        if n % 2 or key is None:
            key = _alike(out) or _alone(out) or key
        key = key or _within(out)
        if key is None:
            break
        _tried(out, forward, key)
    return out


def _tried(out: Posterior, forward: Predictor, key: Key) -> None:
    """Fits a set, and keeps by how much it is better than was thought."""
    labels, promise, estimate, estimated = out.labels(key), _promise(out, key), out.estimates[key], out.total[key]
    out.hoped[labels] = max(promise, out.hoped.get(labels, -np.inf))
    swapped = _in_place_of(out, max(out.total, key=lambda k: out.total[k])).get(key)
    fitted = _fitted(out, forward, key)
    if fitted.failed:
        out.failed[key] = fitted.failed
        out.drop(key)
        return
    _add(out, forward, key, fitted, log_priors(out.signatures))
    out.gains.setdefault(estimate.parent, []).append(out.total[key] - promise)
    if estimate.parent and key in out.ranked:  # what the model without any had promised of it
        out.gains.setdefault(frozenset(), []).append(out.total[key] - out.ranked[key])
    realised = estimate.gain, estimate.gain + out.total[key] - estimated
    out.realised.setdefault(estimate.parent, []).append(realised)
    if swapped is not None:
        out.swapped.append(out.total[key] - swapped)
    _without_idle_branches(out, forward, key)


def _without_idle_branches(out: Posterior, forward: Predictor, key: Key) -> None:
    """Fits a set with shorter spectra as well, where its fit leaves branches of a Prony series at nothing."""
    f, place, every = out.nodes[key].fit, len(forward.subject.nominals), [s.suspect for s in out.signatures]
    suspects, theta = [], [f.theta[:place]]
    for s in f.hypothesis.suspects:
        shorter, kept = without_idle(s, f.theta[place : place + len(s.free)], every)
        suspects.append(shorter)
        theta.append(kept)
        place += len(s.free)
    hypothesis = Hypothesis(tuple(suspects))
    fewer = frozenset(_members(hypothesis, out))
    if fewer not in out.nodes:
        found = fit(forward, hypothesis, level(forward, f), theta=np.concatenate(theta), local=f.local)
        if not found.failed:
            _add(out, forward, fewer, found, log_priors(out.signatures))


def _named(out: Posterior) -> list[Key]:
    """The fitted sets of which one may be named, once others are known.

    Where the best set is of so many laws that they rather imitate another, none of its kind is: it suffices to know it.
    """
    few = [k for k in out.nodes if not out.imitates(k)]
    return few if out.imitates(out.leader) else list(out.nodes)


def _likely(out: Posterior) -> Key | None:
    """The set to fit next: of those that may be named that which promises most, if it may be as probable as any."""
    fitted = _named(out)
    others = out.estimates if len(fitted) == len(out.nodes) else [k for k in out.estimates if not out.imitates(k)]
    least = max(out.total[k] for k in fitted) + np.log(UNFITTED)
    off = {k: [fitted - estimated for estimated, fitted in pairs] for k, pairs in out.realised.items()}
    promised, estimated = (
        {k: min(0.0, _most(off)) for k, off in each.items() if len(off) > 1} for each in (out.gains, off)
    )
    unfitted = {
        k: max(out.promise[k] + promised.get(parent, 0.0), out.total[k] + estimated.get(parent, 0.0))
        for k in others
        for parent in [out.estimates[k].parent]
    }
    # another start of the shape of a set that was fitted has to promise more than that did
    better = [k for k, w in unfitted.items() if w > max(least, out.hoped.get(out.labels(k), -np.inf) + OWED)]
    return max(better, key=lambda k: unfitted[k], default=None)


def _promise(out: Posterior, key: Key) -> float:
    """Log posterior that a set which was not fitted may have, by the nearest fit."""
    return max(out.total[key], out.promise[key])


def _most(gains: Sequence[float]) -> float:
    """What the next set may gain over its promise at most, if it is like those before (but for UNFITTED); 0 if none."""
    if not gains:
        return 0.0
    off = np.array(gains if len(gains) > 1 else [0.0, *gains])
    doubt = np.sqrt(1.0 + 1.0 / len(off)) * np.std(off, ddof=1)
    return float(np.mean(off) + student.ppf(1.0 - UNFITTED, len(off) - 1) * doubt)


def _alone(out: Posterior) -> Key | None:
    """A single effect to fit that may be best, if it is better than it promised by as much as other sets were.

    About a model that is far from what was recorded what is linear promises too little, or too much; about a fit that
    leaves white noise it tells which effects could stand in its place. Of an effect that was fitted alone, or is in the
    best set, there is no need to know more.
    """
    best = max(out.total, key=lambda k: out.total[k])
    near, bonus = out.total[best] + np.log(UNFITTED), _most(out.gains.get(frozenset(), []))
    known = {out.suspect(n).effect for key in out.nodes if key == best or len(key) == 1 for n in key}
    singles = [k for k, p in out.ranked.items() if k in out.estimates and p + bonus >= near][:LEADING]
    singles = [k for k in singles if not known & out.effects(k)]
    instead = _in_place_of(out, best)
    if not instead or not singles:
        return next(iter(singles), None)
    # to leave a strong effect out is not quite linear: the first one tells by how much others are underestimated
    key = max(singles, key=lambda k: instead.get(k, np.inf))
    return key if instead.get(key, np.inf) + max(out.swapped, default=np.inf) >= near else None


def _alike(out: Posterior) -> Key | None:
    """A set to fit that does what the best of those that may be named does, as that one's fit judges it."""
    leader = out.nodes[max(_named(out), key=lambda k: out.total[k])]
    near, fitted = out.total[leader.key] + np.log(UNFITTED), {out.effects(k) for k in out.nodes}
    alike = {k: t for k, t in leader.instead.items() if t >= near and out.effects(k) not in fitted}
    return max((k for k in alike if k in out.estimates), key=lambda k: alike[k], default=None)


def _within(out: Posterior) -> Key | None:
    """Where the best set is of too many laws to be named, the best of those within it that may be, if not fitted."""
    if not out.imitates(out.leader):
        return None
    inside = [k for k in out.estimates if k < out.leader and not out.imitates(k)]
    known = max((out.total[k] for k in out.nodes if k < out.leader and not out.imitates(k)), default=-np.inf)
    best = max(inside, key=lambda k: out.total[k], default=None)
    return best if best is not None and out.total[best] > known else None


def _in_place_of(out: Posterior, best: Key) -> dict[Key, float]:
    """Log posterior of single effects in the place of the best set, as its fit judges them if it leaves white noise."""
    leader = out.nodes.get(best)
    white = leader is not None and leader.fit.weights is not None and not leader.fit.weights.colour
    return leader.instead if leader is not None and white else {}


def polished(out: Posterior, forward: Predictor) -> bool:
    """Fits leaders on by their own noise, and takes all their derivatives where they end; whether there were any.

    Leaders are the best set, which is believed by what its fit reaches and not by what derivatives promise, and those
    that may be named that hold part of the posterior, or would if they gained as much as others did.
    """
    prior, some = log_priors(out.signatures), False
    while True:
        fitted = _named(out)
        least = max(out.total[k] for k in fitted) + np.log(UNFITTED) - max(0.0, _most(list(out.polished.values())))
        leaders = [k for k in [*fitted, out.leader] if out.total[k] >= least and k not in out.polished]
        if not leaders:
            return some
        key, some = max(leaders, key=lambda k: out.total[k]), True
        out.polished[key] = 0.0
        before, f = out.total[key], out.nodes[key].fit
        f = renewed(forward, f)
        if f.cost - promised(forward, f) >= OWED:
            f = carried_on(forward, f)
            f = f if f.failed or f.exact else renewed(forward, f)
        if not f.failed:
            _add(out, forward, key, f, prior)
            out.polished[key] = out.total[key] - before


def log_priors(signatures: Sequence[Signature], hyper: Hyper = HYPER) -> np.ndarray:
    """Log prior of each suspect being one that was left out, given that one was: effects, then their sites, alike."""
    kinds: dict[str, list[int]] = {}
    for n, s in enumerate(signatures):
        kinds.setdefault(s.suspect.effect, []).append(n)
    out = np.zeros(len(signatures))
    for mine in kinds.values():  # a recorder as a whole is as likely to be wrong as all of its channels alone
        share = {signatures[n].suspect.label: 1.0 / signatures[n].suspect.sites for n in mine}
        for n in mine:
            out[n] = np.log(share[signatures[n].suspect.label] / sum(share.values())) - np.log(len(kinds))
    return out + np.log(hyper.effects)


def _log_prior(key: Key, prior: np.ndarray, hyper: Hyper) -> float:
    """Log prior of a set: any order of the same effects is one set."""
    return float(sum(prior[n] for n in key) + np.log(1.0 - hyper.effects) + gammaln(len(key) + 1))


def _add(out: Posterior, forward: Predictor, key: Key, f: Fit, prior: np.ndarray) -> None:
    """Judges a fitted set, and all that add one or two effects to it if it leads, or leads those of its size."""
    node, effects = _node(out, forward, key, f)
    if _leads(out, node, prior):
        own = OwnColumns(node.fit)
        coloured = node.fit.weights is not None and node.fit.weights.colour
        node.foresight = Foresight.of(forward, node.fit, own, effects, out.hyper) if coloured else None
        place(out, node, prior)
    else:
        enter(out, node, prior)


def _leads(out: Posterior, node: Node, prior: np.ndarray) -> bool:
    """Whether a set holds part of the posterior, or is the best of so many effects."""
    total = float(logsumexp(node.evidence + out.hyper.log_cells)) + _log_prior(node.key, prior, out.hyper)
    others = {k: out.total[k] for k in out.nodes if k != node.key}
    alike = max((t for k, t in others.items() if len(k) == len(node.key)), default=-np.inf)
    return total >= min(alike, max(others.values(), default=-np.inf) + np.log(UNFITTED))


def enter(out: Posterior, node: Node, prior: np.ndarray) -> None:
    """Enters a judged set into a posterior."""
    key = node.key
    forget(out, key)
    out.nodes[key] = node
    out.log[key] = node.evidence + out.hyper.log_cells + _log_prior(key, prior, out.hyper)
    out.total[key] = float(logsumexp(out.log[key]))
    out.estimates.pop(key, None)


def place(out: Posterior, node: Node, prior: np.ndarray) -> None:
    """Enters a judged set, and all that add one or two effects to it, into a posterior."""
    hyper, key, f = out.hyper, node.key, node.fit
    cells = hyper.log_cells
    enter(out, node, prior)
    node.wide = True
    members = _members(f.hypothesis, out)
    own = tuple(range(len(members)))
    fewer = [s for n in range(len(own)) for s in combinations(own, n)]
    later = [n + len(own) for n in range(len(node.others))]

    def joined(with_: tuple[int, ...]) -> list[tuple[int, ...]]:
        mine = frozenset(members[k] for k in with_)
        return [(*with_, n) for n in later if _compatible(out, mine, node.others[n - len(own)])]

    _judge(out, node, fewer, prior, cells)
    for s in fewer:
        _judge(out, node, joined(s), prior, cells)
    more = joined(own)
    singles = _judge(out, node, more, prior, cells, foresee=True)
    ranked = [more[n][-1] for n in np.argsort(-singles)]
    if not key:
        alone = {k: out.promise[k] for n in node.others if (k := frozenset((n,))) in out.promise}
        out.ranked = dict(sorted(alone.items(), key=lambda item: -item[1]))
    pairs = []
    for a, one in enumerate(ranked[:LEADING]):
        first = frozenset((node.others[one - len(own)],))
        if len(own) + 2 > hyper.most:
            break
        pairs += [(*own, one, n) for n in ranked[a + 1 :] if _compatible(out, first, node.others[n - len(own)])]
    _judge(out, node, pairs, prior, cells, foresee=True)
    node.foresight = None  # it is large


def forget(out: Posterior, key: Key) -> None:
    """Leaves out a fit of a set, what was estimated by it, and that it was polished: the next one has to be as well."""
    out.nodes.pop(key, None)
    out.polished.pop(key, None)
    for k in [k for k, e in out.estimates.items() if e.parent == key]:
        out.drop(k)


def _members(hypothesis: Hypothesis, out: Posterior) -> list[int]:
    """Indices of a hypothesis' suspects."""
    place = {id(s.suspect): n for n, s in enumerate(out.signatures)}
    return [place[id(s)] for s in hypothesis.suspects]  # the same objects also after weights have changed


def _judge(
    out: Posterior,
    node: Node,
    sets: list[tuple[int, ...]],
    prior: np.ndarray,
    cells: np.ndarray,
    *,
    foresee: bool = False,
) -> np.ndarray:
    """Judges sets of groups by a node, and keeps that where no other node is nearer; how they rank (n,)."""
    if not sets:
        return np.zeros(0)
    members = _members(node.fit.hypothesis, out)
    own = len(members)
    keys = [frozenset(members[c] if c < own else node.others[c - own] for c in s) for s in sets]
    found = np.full((len(sets), len(cells)), -np.inf)
    values: dict[int, np.ndarray] = {}
    order = [c for c in np.argsort(-(node.evidence + cells))[: CELLS if len(sets) > MANY else None] if node.grid[c]]
    every = Summed.join([cell for c in order if (cell := node.grid[c])])
    width: dict[tuple[int, int], list[int]] = {}
    for n, s in enumerate(sets):
        width.setdefault((len(s), sum(len(node.groups[g].columns) for g in s)), []).append(n)
    most = max(1, TOGETHER // len(order))
    alike = [mine[k : k + most] for mine in width.values() for k in range(0, len(mine), most)]
    white = node.foresight.white if foresee and node.foresight is not None else None
    count = every.gram.shape[-1] - 1

    def of_sets(mine: list[int]) -> list[tuple[np.ndarray, np.ndarray]]:
        rows = Sets.of([sets[n] for n in mine], node.groups, own, count)
        return [each.of(rows, out.hyper) for each in (every, white) if each is not None]

    judgements = list(zip(alike, shared([partial(of_sets, mine) for mine in alike]), strict=True))
    log_prior = np.array([_log_prior(key, prior, out.hyper) for key in keys])
    for mine, ((log, value), *_) in judgements:
        found[np.ix_(mine, order)] = (log + cells[order, None] + log_prior[mine]).T
        peak = np.argmax(log + cells[order, None], axis=0)
        values.update((n, value[peak[k], k]) for k, n in enumerate(mine) if log[peak[k], k] > -np.inf)
    rank = promise = logsumexp(found, axis=1)
    totals: list[float] = rank.tolist()
    gains = rank - log_prior - logsumexp(node.evidence + cells)
    if foresee and node.foresight is not None:
        # what is missing explains some of the colour, and all that flaws and discrepancy would
        bare = np.array([smooth == 0.0 and flaws == out.hyper.flaws[0] for _, smooth, flaws in out.hyper.cells])
        total, rank, promise = float(logsumexp((node.evidence + cells)[bare])), rank.copy(), promise.copy()
        for mine, (_, (log, value)) in judgements:
            rank[mine] = log + log_prior[mine]
            values.update(zip(mine, value, strict=True))
        leading = np.argsort(-rank)[:LEADING].tolist()
        ahead = node.foresight.gains([[node.groups[g] for g in sets[n]] for n in leading], out.hyper)
        promise[leading] = total + log_prior[leading] + ahead
    for n, key in enumerate(keys):
        if len(key) == 1 or (len(key) == own and len(key - node.key) == 1):
            node.instead[key] = totals[n]
        if key in out.nodes and key and key < node.key and key not in out.renewed:
            if totals[n] > out.total[key] + OWED:  # its own fit ended early: it goes on from here
                out.renewed.add(key)
                out.hoped.pop(out.labels(key), None)
                forget(out, key)
        if key in out.nodes or key in out.failed or n not in values:
            continue
        before, near = out.estimates.get(key), (len(key ^ node.key), -float(np.max(node.evidence)))
        if before is None or near <= before.near:
            out.log[key], out.total[key], out.promise[key] = found[n], totals[n], float(promise[n])
            out.estimates[key] = Estimate(node.key, sets[n], values[n], near, float(gains[n]))
    return rank


def _compatible(out: Posterior, key: Key, n: int) -> bool:
    """Whether a suspect can be added to a set."""
    if len(key) >= out.hyper.most:
        return False
    s = out.suspect(n)
    return all(distinct_sites(out.suspect(k), s) and not _same_place(out.suspect(k), s) for k in key)


def _same_place(a: Suspect, b: Suspect) -> bool:
    """Whether both are one effect at all sites and at one of them, of which the second is no further effect."""
    return a.effect == b.effect and (a.entities is None or b.entities is None)


def _node(out: Posterior, forward: Predictor, key: Key, f: Fit) -> tuple[Node, Columns]:
    """A fit judged by its own noise, and the columns of its own and of all further effects."""
    return judged(out, forward, key, with_own_noise(forward, f, out.hyper))


def _fitted(out: Posterior, forward: Predictor, key: Key) -> Fit:
    """Fits a set, from where the linear estimate of the nearest fitted one puts it."""
    estimate = out.estimates[key]
    node = out.nodes[estimate.parent]
    members = _members(node.fit.hypothesis, out)
    line, count = node.fit.linear, len(forward.subject.nominals)
    assert line is not None and line.steps is not None and node.fit.weights is not None
    by = level(forward, node.fit)  # white, and with gaps that are no obstacle on the way
    begin, steps, suspects = [node.fit.theta[:count]], [line.steps[:count]], []
    own = np.cumsum([count, *(len(s.free) for s in node.fit.hypothesis.suspects)])
    # of a signature, the part that changes little enough for a derivative, in the weights of the fit
    allowed = 0.5 * small(forward, by, node.fit.blocks) / float(np.max(out.weights.deviation / by.deviation))
    column = 0
    for g in estimate.groups:
        if g < len(members):
            suspects.append(node.fit.hypothesis.suspects[g])
            begin.append(node.fit.theta[own[g] : own[g + 1]])
            steps.append(line.steps[own[g] : own[g + 1]])
        else:
            signature = out.signatures[node.others[g - len(members)]]
            suspect, count_of = signature.suspect, len(signature.size)
            suspects.append(suspect)
            begin.append(signature.values(estimate.values[column : column + count_of]))
            part = dict(zip(suspect.strengths, allowed / np.maximum(signature.raw, allowed), strict=True))
            steps.append(np.array([part.get(n, forward.nudge) for n in suspect.free]))
        column += len(node.groups[g].columns)
    hypothesis, parent = Hypothesis(tuple(suspects)), node.fit
    given, rough = out.begun.get(key), out.rough and len(suspects) == 1  # several begin from a calm fit
    if len(suspects) == 1 and strained(parent):
        given = scanned(forward, hypothesis, by, parent.local, given)
    if given is not None:
        return elsewhere(forward, fit(forward, hypothesis, by, theta=given, local=parent.local), rough)
    # derivatives by the numbers of the model and by starts hardly change with an effect
    known = replace(line.reweighted(node.fit.weights, by), steps=np.concatenate(steps))
    near = {"known": known, "kept": count}
    found = fit(forward, hypothesis, by, theta=np.concatenate(begin), local=parent.local, **near)
    return elsewhere(forward, found, rough)

"""Search for the sets of effects that the recordings support: linear evidence proposes, fits decide.

About every fit the evidence of all sets that add one or two effects to it is known in closed form. The set with the
largest posterior that has not been fitted is fitted next, until what has not been fitted holds little. Each set is
judged by the linearisation that is nearest to it: its own, if it was fitted.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from origami_sim.fit.derivatives import small
from origami_sim.fit.evidence import log_occam
from origami_sim.fit.implied import OwnColumns, log_evidence, with_own_noise
from origami_sim.fit.least_squares import OWED, Fit, converged, fit
from origami_sim.fit.nominal import level
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import Hypothesis
from origami_sim.hypotheses.spectra import without_idle
from origami_sim.infer.basins import Calm, elsewhere, loosened, tightened
from origami_sim.infer.budget import FAR, astray, over_noise
from origami_sim.infer.columns import Columns
from origami_sim.infer.components import (
    near_zero,
    with_further_numbers,
    with_single_components,
    without_unseen_components,
)
from origami_sim.infer.foresight import Foresight
from origami_sim.infer.judged import judged
from origami_sim.infer.placement import enter, log_prior_of, log_priors, members_of, place
from origami_sim.infer.posterior import CREDIBLE, Estimate, Key, Node, Posterior
from origami_sim.infer.proposals import ROUGH, UNFITTED, in_place_of, named, proposed
from origami_sim.infer.scan import at_their_strengths, from_given_numbers, over_their_range, scanned, strained
from origami_sim.infer.screen import Signature, screen
from origami_sim.infer.unlisted import anywhere, beside

GoingOn = Callable[[float, Posterior], bool]
"""Told the part of a search that is done, and what is known so far; says whether it goes on."""

FITS = 16
"""Sets that are fitted at most since one took the lead for which the one before is not worth a fit (`UNFITTED`).

As many more if others are more probable then: without a fit none can be named.
"""


def search(
    forward: Predictor,
    base: Fit,
    signatures: list[Signature],
    weights: Weights,
    *,
    given: Fit | None = None,
    calm: Calm | None = None,
    going_on: GoingOn = lambda part, so_far: True,
    most: int = FITS,
    store: bool = False,
) -> Posterior:
    """The posterior over sets of effects, from the refitted model without any.

    Args:
        given: the model with its numbers as they were given, about which single effects are judged too if the refit
            took them further than chance would.
        calm: what makes it linear if it has many basins, see `basins`.
        going_on: asked before each fit, and told the part of them that is done and what is known so far. If it says no,
            what has been fitted by then is the answer (`Posterior.ended`).
    """
    if calm is None:
        signatures = with_single_components(at_their_strengths(forward, signatures, base, weights))
    out = Posterior(signatures, weights, store=store)
    _add(out, forward, frozenset(), base, log_priors(signatures))
    if calm is not None:
        _begun(out, forward, calm)
    elif given is not None and strained(base) and not _ended(out, most, going_on):
        _about_given(out, forward, base, given)
    for _ in range(most):  # what is named has to be fitted, however many were
        extended(out, forward, most, going_on)
        while polished(out, forward, most, going_on) or reconsidered(out, forward, base, going_on):
            extended(out, forward, most, going_on)
        if (key := out.most_probable) in out.nodes or out.ended:
            break
        _tried(out, forward, key)
    if not out.ended:
        beyond_the_catalogue(out, forward)
    return out


def _ended(out: Posterior, most: int, going_on: GoingOn) -> bool:
    """Whether the search is to end before the next fit."""
    out.ended = out.ended or not going_on(min(out.futile / most, 1.0), out)
    return out.ended


def _about_given(out: Posterior, forward: Predictor, base: Fit, given: Fit) -> None:
    """Enters what single effects promise about the model as given, where the refit left its numbers' priors."""
    by = level(forward, base)
    given = fit(forward, Hypothesis(), by, local=given.local, most=0)  # with derivatives by its numbers
    about = _screened(out, forward, range(len(out.signatures)), given, by)  # strengths have another scale here
    known = {k: about[n] for k in out.estimates if len(k) == 1 for n in k if n in about}
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


def reconsidered(out: Posterior, forward: Predictor, base: Fit, going_on: GoingOn) -> bool:
    """Simulates every single effect at several strengths where nothing explains a recording; whether any promises more.

    A model that snaps, or a crease that sticks, has no derivatives that tell why. So before nothing is said to explain
    a recording, each effect is tried over its range, once, and the best of them is fitted.
    """
    if out.ended or out.reconsidered or over_noise(forward, out.nodes[out.leader].fit) < FAR:
        return False
    out.reconsidered = True
    alone = [k for k in out.estimates if len(k) == 1]
    suspects = [out.suspect(n) for k in alone for n in k]
    told = lambda part: going_on(part, out)  # noqa: E731
    if not _promised(out, alone, over_their_range(forward, suspects, base, level(forward, base), told)):
        return False
    _tried(out, forward, next(k for k in out.ranked if k in out.begun and k in out.estimates))
    return True


def screened_beside(out: Posterior, forward: Predictor, going_on: GoingOn) -> bool:
    """Simulates what further effects do beside the best set, if its numbers left their priors; whether it did.

    Such numbers may have absorbed an effect. To take its place they have to go all the way back, which cancels against
    what it does but for a hundredth: a signature about the refitted model, which lacks the best set, is not that near.
    Once about each set.
    """
    key = out.leader
    if not key or key in out.about or not strained(out.nodes[key].fit) or out.ended:
        return False
    f, others = out.nodes[key].fit, out.nodes[key].others
    mine = [n for n in others if out.suspect(n).effect not in out.effects(key) and not out.signatures[n].status]
    about = _screened(out, forward, mine, f, out.weights, lambda: going_on(0.0, out))
    # in the units that they had, in which what was estimated about other fits remains
    out.about[key] = {n: s.of(out.suspect(n)) for n, s in about.items() if s.parts and not s.status}
    _add(out, forward, key, f, log_priors(out.signatures))
    return True


def _screened(
    out: Posterior,
    forward: Predictor,
    some: Sequence[int],
    f: Fit,
    weights: Weights,
    going_on: Callable[[], bool] = lambda: True,
) -> dict[int, Signature]:
    """Signatures of some suspects about a fit."""
    about = screen(forward, [out.suspect(n) for n in some], f, weights, going_on=going_on)
    of = {s.suspect.form: s for s in about}
    return {n: of[form] for n in some if (form := out.suspect(n).form) in of}


def beyond_the_catalogue(out: Posterior, forward: Predictor) -> None:
    """Enters a smooth moment of a crease that no law gives, if it may be as probable as the best set.

    It is fitted alone, and competes with what was found: where that is right the moment explains less, as it cannot do
    what laws of the drive, of memory or with sharp bends do. Once about each fit of the model without any effects.
    """
    if out.beyond is out.nodes[frozenset()] or all(s.status for s in out.signatures):  # or nothing can be tested
        return
    out.beyond = out.nodes[frozenset()]
    best, none = max(out.total[k] for k in named(out)), out.beyond.fit
    about = beside(forward, none, anywhere(forward), out.hyper)
    if not about:
        return
    suspect, begin, gain = max(about, key=lambda one: one[2])
    every, key = [*out.signatures, Signature(suspect, [], np.ones(1))], frozenset({len(out.signatures)})
    prior = log_priors(every)
    odds = log_prior_of(key, prior, out.hyper) - log_prior_of(frozenset(), prior, out.hyper)
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
        odds = log_prior_of(key, prior, out.hyper) - log_prior_of(none, prior, out.hyper)
        promise = out.total[none] + gain + occam + odds
        if promise > out.promised(key):
            out.promise[key], out.begun[key], some = promise, theta, True
            out.ranked[key] = promise
    out.ranked = dict(sorted(out.ranked.items(), key=lambda item: -item[1]))
    return some


def extended(out: Posterior, forward: Predictor, most: int, going_on: GoingOn) -> None:
    """Fits sets until none that has not been fitted holds much of the posterior, or so many in turn did not lead."""
    while out.futile < most and not _ended(out, most, going_on):
        if _again(out, forward):
            out.futile += 1
            continue
        if screened_beside(out, forward, going_on):
            continue
        key = proposed(out, out.futile)
        if key is None:
            return
        _tried(out, forward, key)
        if len(out.leader) > 2:  # many laws may imitate what none gives: it is known before more of them are tried
            beyond_the_catalogue(out, forward)


def _again(out: Posterior, forward: Predictor) -> bool:
    """Fits a set anew of which the fit of a larger one promises more, if it may then be best; whether there was one.

    The model without any effects is fitted anew in any case, once: all that is promised of single ones depends on it.
    """
    least = max(out.total[k] for k in named(out)) + np.log(UNFITTED)
    stale = {frozenset()} - {k for k, _ in out.renewed}
    early = {k: out.ahead[k][0] for k in named(out) if k in out.ahead and (out.ahead[k][0] >= least or k in stale)}
    if not early:
        return False
    key = max(early, key=lambda k: early[k])
    _, estimate = out.ahead.pop(key)
    out.renewed.add((key, estimate.parent))
    noise = out.nodes[estimate.parent].fit.weights
    before, f = out.nodes[key], _finished(out, forward, _fitted(out, forward, key, estimate), noise)
    if not f.failed:
        node, effects = _node(out, forward, key, f)
        if node.evidence.max() > before.evidence.max():
            _entered(out, forward, node, effects, log_priors(out.signatures))
            if not key:
                out.gains.clear()
                out.realised.pop(key, None)
    return True


def _tried(out: Posterior, forward: Predictor, key: Key) -> None:
    """Fits a set, and keeps by how much it is better than was thought."""
    labels, promise, estimate, estimated = out.labels(key), out.promised(key), out.estimates[key], out.total[key]
    best = out.total[out.leader]
    out.hoped[labels] = max(promise, out.hoped.get(labels, -np.inf))
    swapped = in_place_of(out, max(out.total, key=lambda k: out.total[k])).get(key)
    fitted = _finished(out, forward, _fitted(out, forward, key, estimate))
    if (within := better_within(out, fitted, key)) is not None:
        again = _finished(out, forward, continued_from(out, forward, key, within), within.fit.weights)
        if not again.failed and (fitted.failed or log_evidence(again) > log_evidence(fitted)):
            fitted = again
    out.futile += 1
    if fitted.failed:
        out.failed[key] = fitted.failed
        out.drop(key)
        return
    _add(out, forward, key, fitted, log_priors(out.signatures))
    if not estimate.parent or key in out.ranked:  # what the model without any had promised of it
        out.gains.append(out.total[key] - (out.ranked[key] if estimate.parent else promise))
    if np.isfinite(estimated):
        over = np.array([estimated, promise, out.total[key]]) - (estimated - estimate.gain)
        out.realised.setdefault(estimate.parent, []).append(tuple(over.tolist()))
    if swapped is not None:
        out.swapped.append(out.total[key] - swapped)
    _without_idle_branches(out, forward, key)
    if out.total[out.leader] > best - np.log(UNFITTED):  # what stands beside it is known only now
        out.futile = 0
    if key == out.leader:
        _with_seen_components(out, forward, key)
        _with_further_numbers(out, forward, out.leader)


def better_within(out: Posterior, f: Fit, key: Key) -> Node | None:
    """The best fitted set within another, if it misses less in its noise: then the fit of the larger went astray."""
    inside = [node for k, node in out.nodes.items() if k and k < key]
    best = max(inside, key=lambda node: node.evidence.max(), default=None)
    if best is None or f.failed or best.fit.weights is None:
        return best
    return best if f.reweighted(best.fit.weights).cost > best.fit.cost + OWED else None


def continued_from(out: Posterior, forward: Predictor, key: Key, node: Node) -> Fit:
    """Fits a set from where the fit of one within it ended, in that one's noise."""
    f, new = node.fit, [out.suspect(n) for n in sorted(key - node.key)]
    assert f.weights is not None
    theta = np.concatenate([f.theta, *(np.array([n.start for n in s.free]) for s in new)])
    return fit(forward, Hypothesis((*f.hypothesis.suspects, *new)), f.weights, theta=theta, local=f.local)


def _finished(out: Posterior, forward: Predictor, f: Fit, noise: Weights | None = None) -> Fit:
    """A fit that goes on in its own noise, by derivatives taken there, until these promise nothing more.

    Args:
        noise: that of another fit, which is tried beside the leader's.
    """
    if f.failed:
        return f
    if forward.abrupt and astray(forward, f):
        loose = loosened(forward, f)
        if not loose.failed and not astray(forward, loose):
            f = tightened(forward, loose, f)
        elif not astray(forward, out.nodes[out.leader].fit):
            return f  # it is no rival
    known = [w for w in (out.nodes[out.leader].fit.weights, noise) if w is not None]
    own, _ = with_own_noise(forward, f, out.hyper, known)
    return own if (on := converged(forward, own)).failed else on


def _without_idle_branches(out: Posterior, forward: Predictor, key: Key) -> None:
    """Fits a set with shorter spectra as well, where branches of a Prony series may be nothing by a Wald test."""
    f, place, every = out.nodes[key].fit, len(forward.subject.nominals), [s.suspect for s in out.signatures]
    suspects, theta = [], [f.theta[:place]]
    unseen = near_zero(f, CREDIBLE)
    for s in f.hypothesis.suspects:
        mine, strong = slice(place, place + len(s.free)), [n in s.strengths for n in s.free]
        shorter, kept = without_idle(s, np.where(unseen[mine] & strong, 0.0, f.theta[mine]), every)
        suspects.append(shorter)
        theta.append(kept)
        place += len(s.free)
    hypothesis = Hypothesis(tuple(suspects))
    fewer = frozenset(members_of(hypothesis, out))
    if fewer not in out.nodes:
        found = fit(forward, hypothesis, level(forward, f), theta=np.concatenate(theta), local=f.local)
        if not found.failed:
            _add(out, forward, fewer, found, log_priors(out.signatures))


def _with_seen_components(out: Posterior, forward: Predictor, key: Key) -> None:
    """Fits a set as well without components of its vectors that recordings do not tell from zero.

    Along these its other numbers are free, as a turn about y beside one about x that a device in that plane hides.
    """
    f = out.nodes[key].fit
    if (fewer := without_unseen_components(f, CREDIBLE)) is None:
        return
    hypothesis, theta = _with_known_forms(out, fewer[0]), fewer[1]
    if hypothesis is None:
        return
    _in_another_form(out, forward, fit(forward, hypothesis, level(forward, f), theta=theta, local=f.local), f)


def _with_further_numbers(out: Posterior, forward: Predictor, key: Key) -> None:
    """Fits a set as well with the further numbers of its effects, such as the loss of a contact."""
    f = out.nodes[key].fit
    if (more := with_further_numbers(f)) is None:
        return
    hypothesis, theta = _with_known_forms(out, more[0]), more[1]
    if hypothesis is None:
        return
    found = fit(forward, hypothesis, level(forward, f), theta=theta, local=f.local)
    _in_another_form(out, forward, elsewhere(forward, found, rough=False), f)


def _with_known_forms(out: Posterior, hypothesis: Hypothesis) -> Hypothesis | None:
    """The hypothesis with the suspects that are known by the same form; None if that set was fitted."""
    of = {s.suspect.form: s.suspect for s in out.signatures}
    known = Hypothesis(tuple(of.get(s.form, s) for s in hypothesis.suspects))
    if all(s.form in of for s in known.suspects) and frozenset(members_of(known, out)) in out.nodes:
        return None
    return known


def _in_another_form(out: Posterior, forward: Predictor, found: Fit, f: Fit) -> None:
    """Enters the fit of a set whose effects have other numbers than in a fit before."""
    found = _finished(out, forward, found, f.weights)
    if not found.failed:
        known = {id(s.suspect) for s in out.signatures}
        new = [s for s in found.hypothesis.suspects if id(s) not in known]
        out.signatures += [Signature(s, [], np.ones(1)) for s in new]
        _add(out, forward, frozenset(members_of(found.hypothesis, out)), found, log_priors(out.signatures))


def polished(out: Posterior, forward: Predictor, most: int, going_on: GoingOn) -> bool:
    """Fits leaders on by their own noise, and takes all their derivatives where they end; whether anything changed.

    Leaders are the best set, which is believed by what its fit reaches and not by what derivatives promise, and those
    that may be named that hold part of the posterior, or would if all came true that their derivatives promise. Where
    the best has no effect that is told from nothing, the model without any can do the same.
    """
    prior, some = log_priors(out.signatures), False
    while True:
        some |= _in_the_leaders_noise(out, forward, prior)
        least = max(out.total[k] for k in named(out)) + np.log(UNFITTED)
        reach = {k: out.total[k] + 0.5 * out.nodes[k].owed for k in [*named(out), out.leader]}
        idle = not out.told(out.leader)
        leaders = [k for k, most in reach.items() if (most >= least or (idle and not k)) and k not in out.polished]
        if not leaders or _ended(out, most, going_on):
            return some
        key = max(leaders, key=lambda k: reach[k])
        before, now = out.total[key], out.nodes[key].fit
        f = converged(forward, now)
        if f is not now:
            some = True
            if not f.failed:
                _add(out, forward, key, f, prior)
        if f is now or f.failed or out.nodes[key].owed < OWED or out.total[key] < before + OWED:
            out.polished.add(key)


def _in_the_leaders_noise(out: Posterior, forward: Predictor, prior: np.ndarray) -> bool:
    """Judges fitted sets anew that may hold part of the posterior in the noise of the best one; whether any was."""
    noise, some = out.nodes[out.leader].fit.weights, False
    if noise is None or not noise.colour:
        return some
    for key, node in list(out.nodes.items()):
        own = node.fit.weights
        if own is None or own.like(noise) or node.tried is noise:
            continue
        gain = log_evidence(node.fit.reweighted(noise)) - log_evidence(node.fit)
        if gain > OWED and out.total[key] + gain > out.total[out.leader] + np.log(UNFITTED):
            _add(out, forward, key, node.fit, prior)
            some = True
    return some


def _add(out: Posterior, forward: Predictor, key: Key, f: Fit, prior: np.ndarray) -> None:
    """Judges a fitted set, and all that add one or two effects to it if it leads, or leads those of its size."""
    _entered(out, forward, *_node(out, forward, key, f), prior)


def _entered(out: Posterior, forward: Predictor, node: Node, effects: Columns, prior: np.ndarray) -> None:
    """Enters a judged set, see `_add`; what was estimated by an earlier fit of it is estimated anew."""
    before = out.nodes.get(node.key)
    if (before is not None and before.wide) or _leads(out, node, prior):
        own = OwnColumns(node.fit)
        coloured = node.fit.weights is not None and node.fit.weights.colour
        node.foresight = Foresight.of(forward, node.fit, own, effects, out.hyper) if coloured else None
        place(out, node, prior)
    else:
        enter(out, node, prior)


def _leads(out: Posterior, node: Node, prior: np.ndarray) -> bool:
    """Whether a set holds part of the posterior, or is the best of so many effects."""
    total = float(logsumexp(node.evidence + out.hyper.log_cells)) + log_prior_of(node.key, prior, out.hyper)
    others = {k: out.total[k] for k in out.nodes if k != node.key}
    alike = max((t for k, t in others.items() if len(k) == len(node.key)), default=-np.inf)
    return total >= min(alike, max(others.values(), default=-np.inf) + np.log(UNFITTED))


def _node(out: Posterior, forward: Predictor, key: Key, f: Fit) -> tuple[Node, Columns]:
    """A fit judged by its own noise or that of the leader, and the columns of its own and of all further effects."""
    leading = out.nodes[out.leader].fit.weights if out.nodes else None
    own, owed = with_own_noise(forward, f, out.hyper, [leading] if leading is not None else [])
    node, columns = judged(out, forward, key, own, owed)
    node.tried = leading
    return node, columns


def _fitted(out: Posterior, forward: Predictor, key: Key, estimate: Estimate) -> Fit:
    """Fits a set, from where the linear estimate of a fitted one puts it."""
    node = out.nodes[estimate.parent]
    members = members_of(node.fit.hypothesis, out)
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
            signature = out.signature(node.others[g - len(members)], node.key)
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
    if given is not None and not key < estimate.parent:  # there a larger set found where it may be
        return elsewhere(forward, fit(forward, hypothesis, by, theta=given, local=parent.local), rough)
    # derivatives by the numbers of the model and by starts hardly change with an effect
    known = replace(line.reweighted(node.fit.weights, by), steps=np.concatenate(steps))
    near = {"known": known, "kept": count, "rough": ROUGH}
    found = fit(forward, hypothesis, by, theta=np.concatenate(begin), local=parent.local, **near)
    return elsewhere(forward, found, rough)

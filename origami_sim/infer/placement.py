"""Places a judged fit into a posterior, with all sets of effects that add one or two to it, or have fewer."""

from collections.abc import Sequence
from functools import partial
from itertools import combinations

import numpy as np
from scipy.special import gammaln, logsumexp

from origami_sim.fit.evidence import Sets, Summed
from origami_sim.fit.hyper import HYPER, Hyper
from origami_sim.fit.least_squares import OWED
from origami_sim.hypotheses.hypothesis import Hypothesis, Suspect, distinct_sites
from origami_sim.infer.posterior import Estimate, Key, Node, Posterior
from origami_sim.infer.screen import Signature
from origami_sim.infer.unlisted import UNLISTED
from origami_sim.threads import shared

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


def log_prior_of(key: Key, prior: np.ndarray, hyper: Hyper) -> float:
    """Log prior of a set: any order of the same effects is one set."""
    return float(sum(prior[n] for n in key) + np.log(1.0 - hyper.effects) + gammaln(len(key) + 1))


def enter(out: Posterior, node: Node, prior: np.ndarray) -> None:
    """Enters a judged set into a posterior."""
    key = node.key
    forget(out, key)
    out.nodes[key] = node
    out.log[key] = node.evidence + out.hyper.log_cells + log_prior_of(key, prior, out.hyper)
    out.total[key] = float(logsumexp(out.log[key]))
    out.estimates.pop(key, None)


def place(out: Posterior, node: Node, prior: np.ndarray) -> None:
    """Enters a judged set, and all that add one or two effects to it, into a posterior."""
    hyper, key, f = out.hyper, node.key, node.fit
    cells = hyper.log_cells
    enter(out, node, prior)
    node.wide = True
    members = members_of(f.hypothesis, out)
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
        alone = {k: out.promised(k) for n in node.others if (k := frozenset((n,))) in out.promise}
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
    out.polished.discard(key)
    out.ahead = {k: one for k, one in out.ahead.items() if key not in (k, one[1].parent)}
    for k in [k for k, e in out.estimates.items() if e.parent == key]:
        out.drop(k)


def members_of(hypothesis: Hypothesis, out: Posterior) -> list[int]:
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
    members = members_of(node.fit.hypothesis, out)
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
    log_prior = np.array([log_prior_of(key, prior, out.hyper) for key in keys])
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
    here = out.effects(node.key)
    for n, key in enumerate(keys):
        apart = len(out.effects(key) ^ here), len(key ^ node.key)
        if len(key) == 1 or (len(key) == own and len(key - node.key) == 1):
            node.instead[key] = totals[n]
        if key in out.nodes and key < node.key and (key, node.key) not in out.renewed and n in values:
            known, _ = out.ahead.get(key, (out.total[key] + OWED, None))
            if totals[n] > known:  # its own fit ended early
                out.ahead[key] = totals[n], Estimate(node.key, sets[n], values[n], (*apart, 0.0), float(gains[n]))
        if key in out.nodes or key in out.failed or n not in values:
            continue
        before, near = out.estimates.get(key), (*apart, -float(np.max(node.evidence)))
        if before is None or near <= before.near:
            out.log[key], out.total[key], out.promise[key] = found[n], totals[n], float(promise[n])
            out.estimates[key] = Estimate(node.key, sets[n], values[n], near, float(gains[n]))
    return rank


def _compatible(out: Posterior, key: Key, n: int) -> bool:
    """Whether a suspect can be added to a set, but not to a moment that no law gives: that would do the same."""
    if len(key) >= out.hyper.most or UNLISTED in out.effects(key):
        return False
    s = out.suspect(n)
    return all(distinct_sites(out.suspect(k), s) and not _same_place(out.suspect(k), s) for k in key)


def _same_place(a: Suspect, b: Suspect) -> bool:
    """Whether both are one effect at all sites and at one of them, of which the second is no further effect."""
    return a.effect == b.effect and (a.entities is None or b.entities is None)

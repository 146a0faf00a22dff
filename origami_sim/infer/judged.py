"""A fit with its evidence: of the set of its effects, under every size of gaps, flaws and discrepancy."""

from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np

from origami_sim.fit.chain import Chain
from origami_sim.fit.evidence import Group, Problem, Summed, beside_numbers, summed
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import log_volume, recast
from origami_sim.infer.discrepancy import cosines
from origami_sim.infer.implied import OwnColumns
from origami_sim.infer.posterior import Key, Node, Posterior
from origami_sim.threads import shared


def judged(out: Posterior, forward: Predictor, key: Key, f: Fit) -> tuple[Node, list[np.ndarray]]:
    """A fit judged by the weights that it has, and the columns of its own and of all further effects, per segment."""
    hyper, line, own = out.hyper, f.linear, OwnColumns(f)
    assert line is not None and f.weights is not None
    # order: the fit's own columns by suspect, then one column for each other suspect
    others = [n for n, s in enumerate(out.signatures) if s.parts and not s.status and n not in key]
    count, groups = len(own.columns), list(own.groups)
    for n, o in enumerate(others):
        one = out.signatures[o]
        groups.append(Group((count + n,), 1, np.zeros(1), one.side, np.full(1, np.inf), *one.bounds, one.usual))
    added = [np.zeros((len(t), len(others))) for t in line.tangent]
    for k, o in enumerate(others):
        for columns, part in zip(added, out.signatures[o].parts, strict=True):
            columns[:, k] = part
    added = recast(added, line.rows, out.weights, f.weights)
    effects = [np.concatenate([t[:, own.columns], a], axis=1) for t, a in zip(line.tangent, added, strict=True)]
    width, weights = count + len(others), f.weights
    laid, volume = own.sets(width), weights.log_prior - log_volume(weights, line.rows)
    out.smooth = out.smooth or cosines(forward, f, line)
    both = [np.concatenate(c, axis=1) for c in zip(effects, out.smooth, strict=True)]
    chain = Chain.shared(line, beside_numbers(line, own.nominal, both))

    def of_gap(gap: float) -> tuple[Problem, list[Summed]]:
        made = own.problem(chain.regapped(weights.gap / gap), width)
        made = replace(made, constant=made.constant + volume)
        return made, [summed(made, size, flaws) for size, flaws in product(hyper.smooth, hyper.flaws)]

    gaps = hyper.gaps if any(t is not None for t in line.tie) else hyper.gaps[:1]
    found = dict(zip(gaps, shared([partial(of_gap, gap) for gap in gaps]), strict=True))
    cells = [cell for _, cells in found.values() for cell in cells]
    evidence = np.full(len(hyper.cells), -np.inf)
    evidence[: len(cells)] = Summed.join(cells).of(laid, hyper)[0][:, 0]
    grid: list[Summed | None] = [*cells, *[None] * (len(evidence) - len(cells))]
    problems = {gap: made for gap, (made, _) in found.items()}
    return Node(key, f, evidence, groups, others, grid, problems=problems if out.store else {}), effects

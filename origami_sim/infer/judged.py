"""A fit with its evidence: of the set of its effects, under every size of gaps, flaws and discrepancy."""

from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np

from origami_sim.fit.chain import Chain
from origami_sim.fit.evidence import Problem, Summed, beside_numbers, summed
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
    # order: the fit's own columns by suspect, then those of the strengths of each other suspect
    others = [n for n, s in enumerate(out.signatures) if s.parts and not s.status and n not in key]
    count, groups = len(own.columns), list(own.groups)
    width, known = count, [out.signatures[o] for o in others]
    for one in known:
        groups.append(one.group(width))
        width += len(one.size)
    none = [np.zeros((len(t), 0)) for t in line.tangent]
    added = [np.concatenate([n, *(s.parts[b] for s in known)], axis=1) for b, n in enumerate(none)]
    added = recast(added, line.rows, out.weights, f.weights)
    effects = [np.concatenate([t[:, own.columns], a], axis=1) for t, a in zip(line.tangent, added, strict=True)]
    weights = f.weights
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

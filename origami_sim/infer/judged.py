"""A fit with its evidence: of the set of its effects, under every size of gaps, flaws and discrepancy."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np

from origami_sim.fit.chain import Chain
from origami_sim.fit.evidence import Problem, Summed, beside_numbers, summed, without_flaws
from origami_sim.fit.implied import OwnColumns
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import log_volume
from origami_sim.infer.columns import Columns
from origami_sim.infer.discrepancy import cosines
from origami_sim.infer.placement import members_of
from origami_sim.infer.posterior import Key, Node, Posterior
from origami_sim.threads import shared


def judged(out: Posterior, forward: Predictor, key: Key, f: Fit, owed: float = 0.0) -> tuple[Node, Columns]:
    """A fit judged by the weights that it has, and the columns of its own and of all further effects.

    Args:
        owed: squares that derivatives promise it and that steps by them do not gain: they count for nothing.
    """
    hyper, line, own = out.hyper, f.linear, OwnColumns(f)
    assert line is not None and f.weights is not None
    # order: the fit's own columns by suspect, then those of the strengths of each other suspect
    others = [n for n, s in enumerate(out.signatures) if s.parts and not s.status and n not in key]
    count, groups = len(own.columns), list(own.groups)
    width, known = count, [out.signature(o, key) for o in others]
    for one in known:
        groups.append(one.group(width))
        width += len(one.size)
    weights = f.weights
    # what a strength does from nothing on is no multiple of what a little more of it does about the fit
    mine = {g: out.signatures[n] for g, n in enumerate(members_of(f.hypothesis, out))}
    secants = {g: s for g, s in mine.items() if s.parts and not s.status and len(s.size) == len(s.suspect.free)}
    for g, s in secants.items():
        values = own.groups[g].at * [n.scale for n in f.hypothesis.suspects[g].strengths] / s.size
        own.groups[g] = groups[g] = replace(own.groups[g], whole=(tuple(range(width, width + len(values))), values))
        width += len(values)
    effects = Columns(line, weights, own.columns, known, out.weights)
    every = replace(effects, further=[*known, *secants.values()])
    held = without_flaws(own.groups)
    laid, volume = own.sets(width), weights.log_prior - log_volume(weights, line.rows) - 0.5 * owed
    out.smooth = smooth = out.smooth or cosines(forward, f, line)

    def columns(some: Sequence[int]) -> list[np.ndarray]:
        both = [np.concatenate([x, smooth[n]], axis=1) for n, x in zip(some, every.of(some), strict=True)]
        return beside_numbers(line, own.nominal, some, both)

    chain = Chain.shared(line, columns)

    def of_gap(gap: float) -> tuple[Problem, list[Summed]]:
        made = own.problem(chain.regapped(weights.gap / gap), width)
        made = replace(made, constant=made.constant + volume)
        return made, [summed(made, size, flaws, held) for size, flaws in product(hyper.smooth, hyper.flaws)]

    gaps = hyper.gaps if any(t is not None for t in line.tie) else hyper.gaps[:1]
    found = dict(zip(gaps, shared([partial(of_gap, gap) for gap in gaps]), strict=True))
    cells = [cell for _, cells in found.values() for cell in cells]
    evidence = np.full(len(hyper.cells), -np.inf)
    evidence[: len(cells)] = Summed.join(cells).of(laid, hyper)[0][:, 0]
    grid: list[Summed | None] = [*cells, *[None] * (len(evidence) - len(cells))]
    problems = {gap: made for gap, (made, _) in found.items()}
    return Node(key, f, evidence, groups, others, grid, owed, problems=problems if out.store else {}), effects

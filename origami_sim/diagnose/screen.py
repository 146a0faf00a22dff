"""Screening: how well each suspect explains what the refitted nominal model leaves, before anything is refitted.

All predictions are linearised at the refitted nominal model. What nominal parameters (within their priors) and starts
could explain is projected out of the residual and of every suspect's signature; the score of a suspect is then a
whitened matched filter, and two suspects whose signatures are parallel cannot be told apart by these recordings,
whatever is fitted afterwards.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from origami_sim.diagnose.forward import stiff
from origami_sim.diagnose.hypothesis import Suspect, distinct_sites, scaled
from origami_sim.diagnose.refit import SLOWEST, Fit, Weights, whitened
from origami_sim.effects import get

CHUNK = 6
"""Effects of which the suspects are simulated together."""

SILENT = 0.3
"""Norm of a signature [standard deviations] below which a suspect at its largest admissible strength is not excited."""


@dataclass(frozen=True, eq=False)
class Signature:
    """What a suspect would do to the predictions.

    Attributes:
        suspect: with its strength's scale set to where its effect is as large as the residual.
        parts: per screened block, the whitened change of the predictions for a change of the strength by `size`.
        size: that change [SI], signed.
        shape: (R,) the same less what nominals and starts could explain, all blocks together; unit norm, for a growing
            strength. norm: its norm for `size`. raw: the norm before the projection.
        score: z of the matched filter, signed, within the bounds: 0 where physics forbids the sign. strength: estimate
            from it [SI].
        error: standard deviation of that estimate.
        status: "", or why the suspect cannot be tested.
    """

    suspect: Suspect
    parts: list[np.ndarray]
    size: float
    shape: np.ndarray
    norm: float
    raw: float
    score: float
    strength: float
    error: float
    status: str = ""

    def only(self, n: int) -> "Signature":
        """The same of the n-th screened block alone."""
        return replace(self, parts=[self.parts[n]])


@dataclass(frozen=True, eq=False)
class Screening:
    """All signatures, best score first, and the whitened residual that they are to explain.

    Attributes:
        signatures: of suspects that can be tested. untestable: of those that cannot.
        blocks: the blocks that were used.
        residual: (R,) whitened residual without what nominals and starts could explain. total: its sum of squares.
    """

    signatures: list[Signature]
    untestable: list[Signature]
    blocks: list[int]
    residual: np.ndarray
    total: float

    def overlap(self) -> np.ndarray:
        """[S, S] isolability |cos| between signatures: 1 where two suspects look the same."""
        shapes = np.stack([s.shape for s in self.signatures]) if self.signatures else np.zeros((0, 1))
        return np.abs(shapes @ shapes.T)


class Projector:
    """Removes what the fitted numbers (with priors) and starts could explain from whitened columns."""

    def __init__(self, base: Fit, blocks: Sequence[int]):
        line = base.linear
        assert line is not None
        self.line = line
        self._index = [base.blocks.index(b) for b in blocks]
        prior = np.array([f.scale / f.spread if np.isfinite(f.spread) else 0.0 for f in base.free])
        width = line.tangent[0].shape[1]  # none where only the starts were fitted
        rows = [line.clear(n, line.tangent[n]) for n in self._index]
        stacked = np.concatenate([*rows, np.diag(prior)[:, :width]])
        self._pad = len(prior)
        if width:
            q, r = np.linalg.qr(stacked)
            size = np.abs(np.diag(r))
            self._q = q[:, size > 1e-8 * size.max(initial=1e-300)]
        else:
            self._q = np.zeros((len(stacked), 0))

    def __call__(self, parts: Sequence[np.ndarray]) -> np.ndarray:
        """Projected column (R + priors,) from one array [r] per block."""
        full = [self.line.below(n, p) for n, p in zip(self._index, parts, strict=True)]
        cleared = np.concatenate([self.line.clear(n, p) for n, p in zip(self._index, full, strict=True)])
        padded = np.concatenate([cleared, np.zeros(self._pad)])
        return padded - self._q @ (self._q.T @ padded)

    def residual(self) -> np.ndarray:
        return self([self.line.residual[n] for n in self._index])


def widening(screening: Screening, f: Fit, squares: float) -> np.ndarray:
    """(P,) by how much more uncertain a hypothesis' numbers are, because other effects act that are not in the fit.

    Args:
        squares: d'^2 of these effects together. Any suspect is as likely to be among them as any other.
    """
    out = np.ones(len(f.free))
    assert f.linear is not None
    own = len(f.free) - len(f.hypothesis.free)
    if not (screening.signatures and len(f.hypothesis.free)):
        return out
    index = [f.blocks.index(b) for b in screening.blocks]
    prior = np.diag([n.scale / n.spread if np.isfinite(n.spread) else 0.0 for n in f.free])[:own]
    tangent = np.concatenate([*(f.linear.clear(n, f.linear.tangent[n]) for n in index), prior])
    towards = np.linalg.pinv(tangent, rcond=1e-10)[own:]  # what a change of the data does to each number
    towards /= np.maximum(np.linalg.norm(towards, axis=1, keepdims=True), 1e-300)
    shapes = np.stack([s.shape for s in screening.signatures])
    out[own:] = np.sqrt(1.0 + squares * np.mean((towards @ shapes.T) ** 2, axis=1))
    return out


def screen(
    forward,
    suspects: Sequence[Suspect],
    base: Fit,
    weights: Weights,
    *,
    most: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Screening:
    """Scores all suspects against the residual of a fitted nominal model.

    What all creases (or panels) would do together is the sum of what each would do, so that only single ones are
    simulated.

    Args:
        most: use at most so many blocks, evenly spread, if that saves time.
    """
    blocks = list(base.blocks)
    if most is not None and len(blocks) > most and forward.separate:
        blocks = [blocks[i] for i in np.round(np.linspace(0, len(blocks) - 1, most)).astype(int)]
    single = [s for s in suspects if not _together(s, suspects)]
    groups: list[list[Suspect]] = []
    for s in sorted(single, key=lambda s: (stiff(s.effect), bool(get(s.effect).memory), s.effect)):
        last = groups[-1] if groups else []
        if last and stiff(last[0].effect) == stiff(s.effect) and len({t.effect for t in last} | {s.effect}) <= CHUNK:
            last.append(s)
        else:
            groups.append([s])
    simulated: list[tuple[Suspect, float, list[np.ndarray]]] = []
    for n, group in enumerate(groups):
        simulated += _changes_of(forward, group, base, weights, blocks)
        if progress:
            progress((n + 1) / len(groups))
    for s in suspects:
        if _together(s, suspects):
            mine = [m for m in simulated if m[0].effect == s.effect]
            size = float(np.median([abs(m[1]) for m in mine])) * np.sign(mine[0][1])
            parts = [sum(m[2][n] * (size / m[1]) for m in mine) for n in range(len(blocks))]
            simulated.append((s, size, parts))  # type: ignore[arg-type]
    return rated(simulated, base, blocks)


def _together(s: Suspect, suspects: Sequence[Suspect]) -> bool:
    """Whether a suspect is the sum of other suspects of its effect at single entities."""
    return (
        s.kind in ("crease", "panel")
        and s.entities is None
        and any(t.effect == s.effect and t.entities is not None for t in suspects)
    )


def again(screening: Screening, base: Fit) -> Screening:
    """The signatures of suspects that can join another fit, against its residual, without new simulations."""
    kept = [
        (s.suspect, s.size, s.parts)
        for s in (*screening.signatures, *screening.untestable)
        if s.parts and all(distinct_sites(s.suspect, t) for t in base.hypothesis.suspects)
    ]
    return rated(kept, base, screening.blocks)


def reweighted(screening: Screening, base: Fit, old: Weights, new: Weights) -> Screening:
    """The same signatures with other weights, against the residual of a fit with these."""
    factor = old.deviation / new.deviation * np.sqrt(new.part / old.part)
    kept = [
        (s.suspect, s.size, [np.tile(factor, len(p) // len(factor)) * p for p in s.parts])
        for s in (*screening.signatures, *screening.untestable)
    ]
    unseen = [s for s in screening.untestable if not s.parts]
    found = rated([k for k in kept if k[2]], base, screening.blocks)
    return replace(found, untestable=[*found.untestable, *unseen])


def rated(simulated: Sequence[tuple[Suspect, float, list[np.ndarray]]], base: Fit, blocks: list[int]) -> Screening:
    """Scores of simulated changes against the residual of a fit."""
    project = Projector(base, blocks)
    residual = project.residual()
    found = []
    for s, size, parts in simulated:
        nothing = residual * 0
        if not all(np.all(np.isfinite(p)) for p in parts):
            found.append(Signature(s, [], size, nothing, 0.0, np.nan, 0.0, 0.0, np.inf, "its simulation goes unstable"))
            continue
        raw = float(np.sqrt(sum(p @ p for p in parts)))
        shape = project(parts)
        norm = float(np.linalg.norm(shape))
        s = scaled(s, abs(size))
        # sizes make the raw change as large as the residual; if starts take most of it, larger strengths still show
        reach = max(1.0, _admissible(s, 10 * np.sign(size) * _typical(s)) / size)
        if norm * reach < SILENT or norm < 1e-3 * raw:
            why = "these recordings do not excite it" if raw < SILENT else "nominal parameters can take its place"
            found.append(Signature(s, parts, size, nothing, norm, raw, 0.0, 0.0, np.inf, why))
            continue
        best, p = float(shape @ residual / norm**2) * size, s.free[0]
        strength = float(np.clip(best, p.lower - p.start, p.upper - p.start))
        # what is explained by as much of it as the bounds allow
        explained = (best**2 - (best - strength) ** 2) * (norm / size) ** 2
        score = float(np.sign(strength) * np.sqrt(max(explained, 0.0)))
        shape = shape / norm * np.sign(size)
        found.append(Signature(s, parts, size, shape, norm, raw, score, strength, abs(size) / norm))
    tested = sorted((s for s in found if not s.status), key=lambda s: -abs(s.score))
    return Screening(tested, [s for s in found if s.status], blocks, residual, float(residual @ residual))


def _changes_of(forward, group, base: Fit, weights: Weights, blocks):
    """Changes by suspects that share a program; strengths are scaled for a change as large as the residual."""
    few = [max(blocks, key=lambda b: _size(base, b, weights))]
    goal = np.sqrt(_size(base, few[0], weights)) + 1.0
    least = _least(forward, base, group[0])
    size = np.array([_affordable(forward, base, s, s.free[0].scale, least) for s in group])
    change = _changes(forward, group, size, base, few)  # on one block first
    wanted, _ = _resized(forward, group, size, change[0], goal, base, weights, least)
    if few == blocks:
        redo = np.flatnonzero(wanted != size)
    else:
        change, size = _changes(forward, group, wanted, base, blocks), wanted
        wanted, off = _resized(forward, group, size, change[blocks.index(few[0])], goal, base, weights, least)
        redo = np.flatnonzero(off & (wanted != size))
    if len(redo):
        size[redo] = wanted[redo]
        for c, new in zip(change, _changes(forward, [group[k] for k in redo], size[redo], base, blocks), strict=True):
            c[redo] = new
    out = []
    for k, s in enumerate(group):
        lost = any(np.any(np.isnan(c[k])) for c in change)
        parts = [np.full(c[k].size, np.nan) if lost else whitened(c[k], weights) for c in change]
        out.append((s, float(size[k]), parts))
    return out


def _resized(forward, group, size, change, goal: float, base: Fit, weights: Weights, least: float):
    """Sizes [S] that would change a block by as much as the goal, and whether the present ones are far from it."""
    with np.errstate(invalid="ignore", over="ignore"):
        norm = np.array([np.linalg.norm(whitened(c, weights)) for c in change])
    lost = np.array([bool(np.any(np.isnan(c))) for c in change])
    ratio = np.where(lost, 0.01, np.where(norm > 0, goal / np.maximum(norm, 1e-30), 100.0))
    off = (ratio < 0.1) | (ratio > 10.0)
    new = [
        _affordable(forward, base, s, z * np.clip(r, 1e-4, 1e4), least) if not 0.2 < r < 5.0 else z
        for s, z, r in zip(group, size, ratio, strict=True)
    ]
    return np.array(new), off


def _size(base: Fit, block: int, weights: Weights) -> float:
    r = whitened(base.residuals[base.blocks.index(block)], weights)
    return float(r @ r)


def _least(forward, base: Fit, s: Suspect) -> float:
    """The smallest step of the solver that a change by such a suspect may ask for."""
    return forward.step(base.hypothesis, base.theta, soft=not stiff(s.effect)) / SLOWEST


def _affordable(forward, base: Fit, s: Suspect, change: float, least: float) -> float:
    """A change within the bounds with which the solver's step is no smaller than the least."""
    change = _admissible(s, change)
    if get(s.effect).family == "measurement":  # does not move anything
        return change
    rest = [f.start for f in s.free[1:]]
    hypothesis = base.hypothesis.plus(s)
    for _ in range(12):
        theta = np.concatenate([base.theta, [s.free[0].start + change], rest])
        if forward.step(hypothesis, theta, soft=True) >= least:
            break
        change /= 4.0
    return change


def _typical(s: Suspect) -> float:
    """A noticeable strength; ten times as much is the most that is plausible."""
    return max(abs(get(s.effect).parameter(f.name).typical or 0.0) for f in s.strengths)


def _admissible(s: Suspect, change: float) -> float:
    """A change of the strength that stays within its bounds."""
    f = s.free[0]
    return float(np.clip(f.start + change, f.lower, f.upper) - f.start) or f.scale


def _changes(forward, group, size, base: Fit, blocks) -> list[np.ndarray]:
    """Per block, what each suspect changes in the predictions [S, n, D]; nan where the simulation fails.

    Suspects that need the same step of the solver, within a factor of two, are simulated together.
    """
    rest = [np.array([f.start for f in s.free], float) for s in group]
    for values, z in zip(rest, size, strict=True):
        values[0] += z
    thetas = [np.concatenate([base.theta, v]) for v in rest]
    hypotheses = [base.hypothesis.plus(s) for s in group]
    steps = np.array([forward.step(h, t, soft=True) for h, t in zip(hypotheses, thetas, strict=True)])
    pace = np.round(np.log2(np.maximum(steps, 1e-12) / max(steps.max(), 1e-12)))
    out = [np.full((len(group), *forward.blocks[b].values.shape), np.nan) for b in blocks]
    for p in np.unique(pace):
        mine = np.flatnonzero(pace == p)
        predicted = forward.predict(
            [base.hypothesis, *(hypotheses[k] for k in mine)],
            [base.theta, *(thetas[k] for k in mine)],
            np.repeat(base.local[None], 1 + len(mine), axis=0),
            blocks,
            soft=True,
        )
        for n, v in enumerate(predicted):
            seen = np.isfinite(forward.blocks[blocks[n]].values)
            out[n][mine] = np.where(seen, v[1:] - v[0], 0.0)
    return out

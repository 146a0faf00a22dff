"""Screening: how well each suspect explains what the refitted nominal model leaves, before anything is refitted.

All predictions are linearised at the refitted nominal model. What nominal parameters (within their priors) and starts could
explain is projected out of the residual and of every suspect's signature; the score of a suspect is then a whitened
matched filter, and two suspects whose signatures are parallel cannot be told apart by these recordings, whatever is
fitted afterwards.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from origami_sim.diagnose.hypothesis import Hypothesis, Suspect, scaled
from origami_sim.diagnose.refit import Fit, Weights, whitened

CHUNK = 8
"""Effects that share a program while screening: more compile longer, fewer compile more often."""

SILENT = 0.3
"""Norm of a signature [standard deviations] below which a suspect at its largest admissible strength is not excited."""


@dataclass(frozen=True, eq=False)
class Signature:
    """What a suspect would do to the predictions.

    Attributes:
        suspect: with its strength's scale set to where its effect is as large as the residual.
        shape: (R,) whitened change of all predictions per scale, less what nominals and starts could explain; unit norm.
        norm: its norm before. raw: its norm before the projection.
        score: z of the matched filter, signed; 0 where physics forbids the sign. strength: estimate from it [SI].
        error: standard deviation of that estimate.
        status: "", or why the suspect cannot be tested.
    """

    suspect: Suspect
    shape: np.ndarray
    norm: float
    raw: float
    score: float
    strength: float
    error: float
    status: str = ""


@dataclass(frozen=True, eq=False)
class Screening:
    """All signatures, best score first, and the whitened residual that they are to explain.

    Attributes:
        signatures: of suspects that can be tested. untestable: of those that cannot.
        residual: (R,) whitened residual without what nominals and starts could explain.
        total: its sum of squares. degrees: about how many independent numbers it holds.
    """

    signatures: list[Signature]
    untestable: list[Signature]
    residual: np.ndarray
    total: float
    degrees: float

    def overlap(self) -> np.ndarray:
        """[S, S] isolability |cos| between signatures: 1 where two suspects look the same."""
        shapes = np.stack([s.shape for s in self.signatures]) if self.signatures else np.zeros((0, 1))
        return np.abs(shapes @ shapes.T)

    def explained(self) -> list[float]:
        """Part of the residual's squares that each signature explains."""
        return [s.score**2 / self.total if self.total > 0 else 0.0 for s in self.signatures]


class Projector:
    """Removes what nominal parameters (with priors) and starts could explain from whitened columns."""

    def __init__(self, forward, base: Fit):
        line = base.linear
        assert line is not None
        self.line, self.base = line, base
        count = len(forward.subject.nominals)
        free = base.free[:count]
        rows = [line.clear(n, t[:, :count]) for n, t in enumerate(line.tangent)]
        prior = np.array([f.scale / f.spread if np.isfinite(f.spread) else 0.0 for f in free])
        self._rows = np.concatenate(rows)
        stacked = np.concatenate([self._rows, np.diag(prior)])
        q, r = np.linalg.qr(stacked) if count else (np.zeros((len(stacked), 0)), np.zeros((0, 0)))
        size = np.abs(np.diag(r))
        keep = size > 1e-8 * size.max(initial=1e-300)
        self._q = q[:, keep]
        self._pad = len(prior)

    def __call__(self, parts: Sequence[np.ndarray]) -> np.ndarray:
        """Projected columns (R + priors, ...) from one array [r, ...] per block."""
        cleared = np.concatenate([self.line.clear(n, p) for n, p in enumerate(parts)])
        padded = np.concatenate([cleared, np.zeros((self._pad, *cleared.shape[1:]))])
        return padded - self._q @ (self._q.T @ padded)


def screen(
    forward,
    suspects: Sequence[Suspect],
    base: Fit,
    weights: Weights,
    *,
    progress: Callable[[float], None] | None = None,
) -> Screening:
    """Scores all suspects against the residual of a fitted nominal model."""
    project = Projector(forward, base)
    residual = project(base.linear.residual)  # type: ignore[union-attr]
    total = float(residual @ residual)
    groups: list[list[Suspect]] = []
    for s in suspects:
        for g in groups:
            effects = {t.effect for t in g}
            if s.effect in effects or len(effects) < CHUNK:
                g.append(s)
                break
        else:
            groups.append([s])
    found: list[Signature] = []
    for n, group in enumerate(groups):
        found += _signatures(forward, group, base, weights, project, residual)
        if progress:
            progress((n + 1) / len(groups))
    tested = sorted((s for s in found if not s.status), key=lambda s: -abs(s.score))
    degrees = _degrees(residual)
    return Screening(tested, [s for s in found if s.status], residual, total, degrees)


def _degrees(residual: np.ndarray) -> float:
    return float(max(np.count_nonzero(residual), 1))


def _signatures(forward, group, base: Fit, weights: Weights, project: Projector, residual) -> list[Signature]:
    """Signatures of suspects that share a program; strengths are scaled until the effect is as large as the residual."""
    blocks = list(base.blocks)
    few = blocks[:: max(1, len(blocks) // 3)][:3]
    target = {b: float(np.sum(whitened(base.residuals[n], weights) ** 2)) for n, b in enumerate(blocks)}
    goal = np.sqrt(sum(target[b] for b in few)) + 1.0
    size = np.array([s.free[0].scale for s in group])
    settled = np.zeros(len(group), bool)
    for _ in range(4):  # on a few blocks
        change = _changes(forward, group, size, base, few)
        norm = np.array(
            [np.sqrt(sum(np.sum(whitened(c[k], weights) ** 2) for c in change)) for k in range(len(group))]
        )
        ratio = np.where(np.isfinite(norm) & (norm > 0), goal / np.maximum(norm, 1e-30), np.where(norm > 0, 0.01, 100.0))
        settled = (ratio > 0.3) & (ratio < 3.0)
        if np.all(settled):
            break
        factor = np.where(settled, 1.0, np.clip(ratio, 1e-3, 1e3))
        size = np.array([_admissible(s, z) for s, z in zip(group, size * factor, strict=True)])
    change = _changes(forward, group, size, base, blocks)
    out = []
    for k, s in enumerate(group):
        parts = [whitened(c[k], weights) for c in change]
        s = scaled(s, abs(size[k]))
        raw = float(np.sqrt(sum(p @ p for p in parts)))
        if not np.isfinite(raw) or any(np.any(np.isnan(c[k])) for c in change):
            out.append(Signature(s, residual * 0, 0.0, np.nan, 0.0, 0.0, np.inf, "its simulation goes unstable"))
            continue
        shape = project(parts)
        norm = float(np.linalg.norm(shape))
        if norm < SILENT:
            why = "these recordings do not excite it" if raw < SILENT else "nominal parameters can take its place"
            out.append(Signature(s, residual * 0, norm, raw, 0.0, 0.0, np.inf, why))
            continue
        score = float(shape @ residual / norm)
        strength = score / norm * size[k]
        p = s.free[0]
        if not p.lower - 1e-12 <= p.start + strength <= p.upper + 1e-12:
            score, strength = 0.0, 0.0
        out.append(Signature(s, shape / norm * np.sign(size[k]), norm, raw, score, strength, abs(size[k]) / norm))
    return out


def _admissible(s: Suspect, change: float) -> float:
    """A change of the strength that stays within its bounds."""
    f = s.free[0]
    return float(np.clip(f.start + change, f.lower, f.upper) - f.start) or f.scale


def _changes(forward, group, size, base: Fit, blocks) -> list[np.ndarray]:
    """Per block, what each suspect changes in the predictions [S, n, D]."""
    count = len(forward.subject.nominals)
    nominal = base.theta[:count]
    rest = [np.array([f.start for f in s.free], float) for s in group]
    for values, z in zip(rest, size, strict=True):
        values[0] += z
    thetas = [nominal] + [np.concatenate([nominal, v]) for v in rest]
    hypotheses = [Hypothesis()] + [Hypothesis((s,)) for s in group]
    local = np.repeat(base.local[None], len(thetas), axis=0)
    predicted = forward.predict(hypotheses, thetas, local, blocks)
    out = []
    for b, v in zip(blocks, predicted, strict=True):
        seen = np.isfinite(forward.blocks[b].values)
        out.append(np.where(seen, v[1:] - v[0], 0.0))
    return out

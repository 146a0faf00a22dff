"""The next experiment: of what the set-up can do, that from which most is expected to be learnt.

The expected information of an experiment is by how much it lowers the entropy of the posterior over explanations in the
mean (Lindley 1956; MacKay 1992; Houlsby et al. 2011), the mutual information of explanation h and recording y,

    I = sum_h p_h E_{y | h} log2 ( p(y | h) / sum_k p_k p(y | k) ).

Each explanation predicts a normal distribution: its simulation, the noise, and what is still uncertain of its numbers
and of the start. Everything but noise lies in the few directions in which explanations and numbers differ, so that the
integrals are taken there, by Monte Carlo, to within two hundredths of a bit.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from origami_sim.diagnose.menu import Trial, menu
from origami_sim.fit.derivatives import changed, first_steps, links, start_steps
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.linear import Linearisation
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights
from origami_sim.infer.intervals import widened
from origami_sim.infer.posterior import Key, Posterior
from origami_sim.recording.possible import Possible
from origami_sim.report.diagnosis import Experiment

LEADING, LEAST = 5, 0.01
"""Explanations that are looked at, and the probability of the least of them; with more, what is told of the leaders
hardly changes, and each costs as many rollouts as it has numbers."""

DRAWS = 1000
"""Draws of a recording per explanation: what is expected is then known to a hundredth of a bit, or 0.015 with half."""

REPEATS = (1, 2, 4, 8, 16, 32, 64)
"""Numbers of repeats that are looked at."""

ENOUGH = 0.8
"""Part of what any number of repeats of the best experiment would tell that is worth stopping at; with 0.9 it takes
about twice as many."""

LITTLE = 0.02
"""Entropy of the explanations [bits] below which nothing is proposed: expected information is known no better."""

TOLD = 0.1
"""Expected information [bits] between two explanations that are as likely, from which an experiment separates them."""


@dataclass(frozen=True, eq=False)
class Prospect:
    """What explanations expect of an experiment where they differ, in standard deviations of the noise.

    Attributes:
        means: [H, k] predictions. spreads: per explanation [k, P] columns of the covariance beyond the noise.
    """

    means: np.ndarray
    spreads: list[np.ndarray]

    @classmethod
    def of(cls, means: np.ndarray, spreads: Sequence[np.ndarray]) -> "Prospect":
        """From predictions [H, n] and columns [n, P] in all directions."""
        apart = (means - means[0]).T
        q, r = np.linalg.qr(np.concatenate([apart[:, 1:], *spreads], axis=1))
        ends = np.cumsum([len(means) - 1, *(s.shape[1] for s in spreads)])
        own = [r[:, a:b] for a, b in pairwise(ends)]
        return cls((q.T @ apart).T, own)

    def among(self, chosen: Sequence[int]) -> "Prospect":
        """That of some explanations."""
        return Prospect(self.means[list(chosen)], [self.spreads[h] for h in chosen])

    def information(self, chance: np.ndarray, amount: float = 1.0) -> float:
        """Expected information about which explanation is true [bits].

        Args:
            chance: (H,) probabilities. amount: of data, over what was simulated.
        """
        scale = np.sqrt(amount)
        size = self.means.shape[1]
        normal = np.random.default_rng(0).normal(size=(DRAWS, size))
        roots = [np.linalg.cholesky(np.eye(size) + amount * s @ s.T) for s in self.spreads]
        total = 0.0
        for h, p in enumerate(chance):
            y = scale * self.means[h] + normal @ roots[h].T
            log = np.stack([_log_density(y - scale * m, r) for m, r in zip(self.means, roots, strict=True)])
            mixed = logsumexp(log + np.log(chance)[:, None], axis=0)
            total += p * float(np.mean(log[h] - mixed))
        return float(np.clip(total / np.log(2.0), 0.0, entropy(chance)))


def _log_density(x: np.ndarray, root: np.ndarray) -> np.ndarray:
    """Log density (n,) of x [n, k] under a normal distribution, without its constant."""
    z = solve_triangular(root, x.T, lower=True)
    return -0.5 * np.sum(z**2, axis=0) - float(np.sum(np.log(np.diag(root))))


def entropy(chance: np.ndarray) -> float:
    """Entropy of probabilities [bits]."""
    p = chance[chance > 0.0]
    return float(-np.sum(p * np.log2(p)))


def explanations(p: Posterior) -> tuple[list[Fit], np.ndarray]:
    """The leading explanations that were fitted, and their probabilities among themselves.

    What only adds an effect to another one of them is not a further explanation, nor are the same effects at the same
    sites that were fitted from another start.
    """
    chance = p.probabilities()
    kept: list[Key] = []
    for key in sorted(p.nodes, key=lambda k: -chance[k]):
        same = any((k and key > k) or p.label(k) == p.label(key) for k in kept)
        if len(kept) < LEADING and (len(kept) < 2 or chance[key] >= LEAST) and not same:
            kept.append(key)
    share = np.array([max(chance[k], 1e-12) for k in kept])
    return [widened(p, k) for k in kept], share / share.sum()


def propose(
    forward: Predictor,
    leading: Sequence[Fit],
    chance: np.ndarray,
    weights: Weights,
    possible: Possible | None = None,
    *,
    progress: Callable[[float], None] | None = None,
    most: int = 4,
) -> list[Experiment]:
    """Experiments, those first from which most is expected to be learnt; none where nothing is open.

    Args:
        leading: explanations. chance: (H,) their probabilities. weights: of the noise. possible: see there.

    Raises:
        InputError: what is said to be possible does not fit the device.
    """
    trials = menu(forward, possible or Possible())
    if entropy(chance) < LITTLE:
        return []
    prospects: list[Prospect | None] = []
    for n, trial in enumerate(trials):
        prospects.append(prospect(trial.forward, leading, weights))
        if progress:
            progress((n + 1) / len(trials))
    made = [(t, p) for t, p in zip(trials, prospects, strict=True) if p is not None]
    told = [[p.information(chance, t.amount * n) for n in REPEATS] for t, p in made]
    whole = max((row[-1] for row in told), default=0.0)
    out = []
    for (trial, p), row in zip(made, told, strict=True):
        enough = next((n for n, v in zip(REPEATS, row, strict=True) if v >= ENOUGH * whole), 9999)
        labels = _separated(trial, p, leading)
        out.append(Experiment(trial.what, labels, row[0], entropy(chance), enough if whole > 0.0 else 9999))
    return sorted(out, key=lambda e: -e.information)[:most]


def _separated(trial: Trial, p: Prospect, leading: Sequence[Fit]) -> list[str]:
    """The best explanation and those that an experiment tells from it; all if it tells none."""
    even = np.array([0.5, 0.5])
    others = [h for h in range(1, len(leading)) if p.among([0, h]).information(even, trial.amount) >= TOLD]
    return [leading[h].hypothesis.label for h in (0, *(others or range(1, len(leading))))]


def prospect(forward: Predictor, leading: Sequence[Fit], weights: Weights) -> Prospect | None:
    """What explanations expect of an experiment, from one batch of rollouts; None where one of them goes unstable.

    The start is known as well as block.known says, and shared: derivatives by it and by the numbers of the model are
    those of the first explanation.
    """
    first, count = leading[0], len(leading[0].free) - len(leading[0].hypothesis.free)
    blocks = range(len(forward.blocks))
    nudges = start_steps(forward, weights, blocks)
    each, thetas, steps, rows = [], [], [], []
    for h, f in enumerate(leading):
        rows.append(len(each))
        moved = [k for k in range(len(f.free)) if k >= count or h == 0]
        change = first_steps(forward, f.coordinates, f.theta)
        further = f.coordinates.values(f.coordinates.of(f.theta) + change)
        steps.append(change[moved])
        for k in (None, *moved):
            theta = f.theta.copy()
            if k is not None:
                theta[k] = further[k]
            each.append(f.hypothesis)
            thetas.append(theta)
    worlds = len(each)
    each += [first.hypothesis] * forward.local
    thetas += [first.theta] * forward.local
    local = np.zeros((len(each), len(forward.blocks), forward.local))
    for i in range(forward.local):
        local[worlds + i, :, i] = nudges[:, i]
    parts = changed(forward, forward.shoot(each, thetas, local, blocks), weights, blocks)
    if not all(np.all(np.isfinite(c)) for c in parts):
        return None
    line = _line(forward, parts, worlds, nudges)
    columns = [np.concatenate([np.zeros((1, c.shape[1])), c[: worlds - 1]]).T for c in parts]
    moves = np.concatenate(line.cleared(columns))
    means = moves[:, rows].T
    shared, spreads = np.zeros((len(moves), 0)), []
    for h, f in enumerate(leading):
        own = moves[:, rows[h] + 1 : rows[h] + 1 + len(steps[h])] - means[h][:, None]
        own = own / steps[h]
        if not h:
            shared = own[:, :count]
        every = own if not h else np.concatenate([shared, own], axis=1)
        deviation = f.spread / np.sqrt(np.maximum(np.diag(f.covariance), 1e-300))
        cover = f.covariance * np.outer(deviation, deviation)
        value, vector = np.linalg.eigh(0.5 * (cover + cover.T))
        spreads.append(every @ (vector * np.sqrt(np.maximum(value, 0.0))))
    return Prospect.of(means, spreads)


def _line(forward: Predictor, parts: list[np.ndarray], worlds: int, nudges: np.ndarray) -> Linearisation:
    """The derivatives by starts, from changes of which the last ones are theirs."""
    rows = [b.rows(*link) for b, link in zip(forward.blocks, links(forward, range(len(parts))), strict=True)]
    slopes = []
    for block, own, c, nudge in zip(forward.blocks, rows, parts, nudges, strict=True):
        slope = c[worlds - 1 :].T / nudge
        if own.start:
            slope[own.data : own.data + own.start] = np.diag(1.0 / block.known)
        slopes.append(slope)
    still, none = [np.zeros(c.shape[1]) for c in parts], [c[:0].T for c in parts]
    return Linearisation(rows, still, none, slopes, [None] * len(rows))

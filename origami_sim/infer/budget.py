"""The budget of the mismatch: what it goes to, between the model as given and nothing but noise."""

from dataclasses import dataclass
from itertools import combinations
from math import factorial

import numpy as np

from origami_sim.fit.bursts import bursts
from origami_sim.fit.hyper import HYPER
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.linear import Linearisation
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.recorder import recorder_noise
from origami_sim.fit.weights import Weights
from origami_sim.infer.unlisted import UNLISTED
from origami_sim.infer.words import pooled

FAR = 2.0
"""Error over the noise of the recorder from which something real is left, whatever is more probable.

Of ten objects with nothing missing it is 0.96 to 1.14, also with trackers that average over frames.
"""


@dataclass
class Share:
    """A part of the mismatch.

    Attributes:
        name: an effect with its site; "numbers of the model"; "not named". kind: effect, measurement, numbers, rest.
        share: of all squares that the model as given misses beyond noise.
    """

    name: str
    kind: str
    share: float


@dataclass(frozen=True)
class Budget:
    """Where the mismatch goes.

    Attributes:
        shares: add up to one; none if nothing is missed. over: error that is left, over the recorder's noise (root mean
            square over the components). pushed: probability that forces act now and then, see
            `bursts`. real: that what is left is no noise of the recorder, see `remainder`.
    """

    shares: list[Share]
    over: float
    pushed: float = 0.0
    real: float = 0.0

    @property
    def named(self) -> float:
        """What effects explain, of device or recorder."""
        return sum(s.share for s in self.shares if s.kind in ("effect", "measurement"))

    @property
    def numbers(self) -> float:
        return sum(s.share for s in self.shares if s.kind == "numbers")

    @property
    def rest(self) -> float:
        """What is real and not named."""
        return sum(s.share for s in self.shares if s.kind == "rest")


def budget(forward: Predictor, given: Fit, base: Fit, best: Fit, recorder: Weights | None = None) -> Budget:
    """Shares of what the model as given misses beyond the noise, in squares over the noise; they add up to one.

    What each of several effects explains is the mean over the orders in which they may be added (Shapley 1953), with
    all numbers refitted. Noise is what the best explanation leaves once forces that are missing are allowed for, up to
    what the recorder shows; the budget allows for next to none.

    Args:
        recorder: noise of the recorder, where what the best explanation leaves is none.
    """
    assert best.weights is not None
    over, now = over_noise(forward, best), bursts(best)
    level, colour = np.minimum(best.weights.deviation, recorder_noise(forward, best)), best.weights.colour
    if recorder is not None:
        level, colour = np.minimum(level, recorder.deviation), recorder.colour
    if now.probability > 0.5:
        level = np.minimum(level, np.maximum(now.level, forward.blocks[0].noise))
    noise = Weights(level, colour, HYPER.least)
    count = float(sum(forward.blocks[b].seen().sum() for b in best.blocks))

    def missed(f: Fit) -> float:
        line = f.reweighted(noise).linear
        assert line is not None
        left = line.eliminated.rows[:, -1]
        return float(left @ left) + f.penalty

    first, second, last = missed(given), missed(base), missed(best)
    numbers, gain, rest = max(first - second, 0.0), max(second - last, 0.0), max(last - count, 0.0)
    total = numbers + gain + rest
    if total <= 0.0:
        return Budget([], over, now.probability)
    out = [Share("numbers of the model", "numbers", numbers / total)] if numbers > 0.0 else []
    suspects = best.hypothesis.suspects
    parts = _parts(best, noise) if len(suspects) > 1 else np.ones(len(suspects))
    for s, part in zip(suspects, parts, strict=True):
        share = gain * part / total
        if s.effect == UNLISTED:
            out.append(Share(f"not named, at {s.site}", "rest", share))
        else:
            out.append(Share(s.label, "measurement" if s.kind == "measurement" else "effect", share))
    out.append(Share("not named", "rest", rest / total))
    return Budget([Share(s.name, s.kind, float(s.share)) for s in out], over, now.probability)


def over_noise(forward: Predictor, f: Fit) -> float:
    """Error that a fit leaves, over the recorder's noise (root mean square over the components)."""
    return pooled(f.rms() / recorder_noise(forward, f))


def _parts(f: Fit, noise: Weights) -> np.ndarray:
    """Of what several effects explain together, the part of each, linearised at the fit."""
    line = f.reweighted(noise).linear
    assert line is not None
    own = len(f.free) - len(f.hypothesis.free)
    ends = np.cumsum([own, *(len(s.free) for s in f.hypothesis.suspects)])
    n = len(f.hypothesis.suspects)
    cost = {s: _without(f, line, [k for k in range(n) if k not in s], ends) for s in _subsets(n)}
    out = np.zeros(n)
    for k in range(n):
        for s in _subsets(n):
            if k in s:
                continue
            weight = factorial(len(s)) * factorial(n - len(s) - 1) / factorial(n)
            out[k] += weight * max(cost[s] - cost[tuple(sorted((*s, k)))], 0.0)
    return out / out.sum() if out.sum() > 0 else np.full(n, 1.0 / n)


def _subsets(n: int) -> list[tuple[int, ...]]:
    return [s for k in range(n + 1) for s in combinations(range(n), k)]


def _without(f: Fit, line: Linearisation, lacking: list[int], ends: np.ndarray) -> float:
    """Squares that are missed without some effects, all other numbers refitted."""
    at = f.coordinates.of(f.theta)
    gone = np.zeros(len(f.free), bool)
    for k in lacking:
        gone[ends[k] : ends[k + 1]] = True
    strong = {id(n) for s in f.hypothesis.suspects for n in s.strengths}
    back = np.where(gone & [id(n) in strong for n in f.free], at, 0.0)
    whole = line.eliminated.rows
    tangent, left = whole[:, :-1], whole[:, -1] + whole[:, :-1] @ back
    prior = f.coordinates.precision
    away = -prior * at
    a = np.concatenate([tangent[:, ~gone], np.diag(prior)[:, ~gone]])
    y = np.concatenate([left, np.where(gone, 0.0, away)])
    x, *_ = np.linalg.lstsq(a, y, rcond=1e-12)
    rest = y - a @ x
    return float(rest @ rest)

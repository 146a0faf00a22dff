"""The budget of the mismatch: what it goes to, between the model as given and nothing but noise."""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from origami_sim.fit.bursts import bursts
from origami_sim.fit.hyper import HYPER
from origami_sim.fit.least_squares import Fit
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
        beyond: share that effects of the catalogue explain and numbers of the model alone would not.
    """

    shares: list[Share]
    over: float
    pushed: float = 0.0
    real: float = 0.0
    beyond: float = 0.0

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

    What a fit explains is divided between the numbers of the model and the effects, in proportion to what is lost
    without each, all others refitted (proportional marginal variance decomposition, Feldman 2005, Groemping 2007). So
    numbers that stayed where they were get nothing, also where they could have imitated an effect. Noise is what the
    best explanation leaves once forces that are missing are allowed for, up to what the recorder shows; the budget
    allows for next to none.

    Args:
        given, base, best: fits of the model as given, of its numbers alone, and of the best explanation.
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
    gain, rest = max(first - last, 0.0), max(last - count, 0.0)
    total = gain + rest
    if total <= 0.0:
        return Budget([], over, now.probability)
    numbers, *parts = gain / total * _parts(best, noise)
    out = [Share("numbers of the model", "numbers", numbers)] if numbers > 0.0 else []
    for s, share in zip(best.hypothesis.suspects, parts, strict=True):
        if s.effect == UNLISTED:
            out.append(Share(f"not named, at {s.site}", "rest", share))
        else:
            out.append(Share(s.label, "measurement" if s.kind == "measurement" else "effect", share))
    out.append(Share("not named", "rest", rest / total))
    named = not any(s.effect == UNLISTED for s in best.hypothesis.suspects)
    beyond = max(second - last, 0.0) / total if named else 0.0
    return Budget([Share(s.name, s.kind, float(s.share)) for s in out], over, now.probability, beyond=beyond)


def over_noise(forward: Predictor, f: Fit) -> float:
    """Error that a fit leaves, over the recorder's noise (root mean square over the components)."""
    return pooled(f.rms() / recorder_noise(forward, f))


def _parts(f: Fit, noise: Weights) -> np.ndarray:
    """Of what a fit explains, the parts (1 + n,) of the model's numbers and of each effect, linearised at the fit."""
    line = f.reweighted(noise).linear
    assert line is not None
    rows = np.asarray(np.linalg.qr(line.eliminated.rows, mode="r"))  # their Gram matrix is all that matters
    ends = np.cumsum([0, len(f.free) - len(f.hypothesis.free), *(len(s.free) for s in f.hypothesis.suspects)])
    least = _missed(f, rows, ends, ())
    return needed(len(ends) - 1, lambda lacking: _missed(f, rows, ends, lacking) - least)


def needed(n: int, lost: Callable[[tuple[int, ...]], float]) -> np.ndarray:
    """Parts (n,) of a whole, in proportion to what is lost without each: the ratio potential (Ortmann 2000).

    Args:
        lost: what is lost without some of the parts, whatever the others can do in their place.
    """
    every = tuple(range(n))
    potential: dict[tuple[int, ...], float] = {(): 1.0}
    least = 1e-9 * lost(every)  # so that of several that replace each other, each gets something
    for lacking in (s for k in range(1, n + 1) for s in combinations(every, k)):
        fewer = [1.0 / potential[tuple(m for m in lacking if m != k)] for k in lacking]
        potential[lacking] = max(lost(lacking), least, 1e-300) / np.sum(fewer)
    out = np.array([potential[every] / potential[tuple(m for m in every if m != k)] for k in every])
    return out / out.sum()


def _missed(f: Fit, rows: np.ndarray, ends: np.ndarray, lacking: Collection[int]) -> float:
    """Squares that are missed without some parts of a fit, all other numbers refitted.

    Args:
        rows: [., P + 1] of its tangent and residual. ends: where the numbers of each part begin, and the last ends.
    """
    at, gone = f.coordinates.of(f.theta), np.zeros(len(f.free), bool)
    for k in lacking:
        gone[ends[k] : ends[k + 1]] = True
    strong = {id(n) for s in f.hypothesis.suspects for n in s.strengths}
    strong |= {id(n) for n in f.free[: ends[1]]}
    back = np.where(gone & [id(n) in strong for n in f.free], at, 0.0)
    prior = f.coordinates.precision
    a = np.concatenate([rows[:, :-1][:, ~gone], np.diag(prior)[:, ~gone]])
    y = np.concatenate([rows[:, -1] + rows[:, :-1] @ back, np.where(gone, 0.0, -prior * at)])
    x, *_ = np.linalg.lstsq(a, y, rcond=1e-12)
    rest = y - a @ x
    return float(rest @ rest)

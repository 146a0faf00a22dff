"""The budget of the mismatch: what it goes to, between the model as given and nothing but noise."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from origami_sim.fit.bursts import bursts
from origami_sim.fit.hyper import HYPER
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights
from origami_sim.infer.recorder import recorder_noise
from origami_sim.infer.unlisted import UNLISTED

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

    What a fit explains is divided between the numbers of the model and the effects by what each changes as it was
    fitted, see `shapley` (product measure, Pratt 1987). So numbers that stayed where they were get nothing, also where
    they could have imitated an effect. Noise is what the best explanation leaves once forces that are missing are
    allowed for, up to what the recorder shows; the budget allows for next to none.

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


def pooled(errors: np.ndarray) -> float:
    """Root mean square of what components miss, in multiples of their noise (D,)."""
    return float(np.sqrt(np.nanmean(np.square(errors))))


def over_noise(forward: Predictor, f: Fit) -> float:
    """Error that a fit leaves, over the recorder's noise (root mean square over the components)."""
    return pooled(f.rms() / recorder_noise(forward, f))


def astray(forward: Predictor, f: Fit) -> bool:
    """Whether a fit misses far more than the noise that was stated, or read from neighbouring frames.

    What rings faster than frames tell looks like the noise of a recorder.
    """
    return bool(pooled(f.rms() / forward.blocks[0].noise) > FAR)


def _parts(f: Fit, noise: Weights) -> np.ndarray:
    """Of what a fit explains, the parts (1 + n,) of the model's numbers and of each effect, linearised at the fit."""
    line = f.reweighted(noise).linear
    assert line is not None
    rows = np.asarray(np.linalg.qr(line.eliminated.rows, mode="r"))  # their Gram matrix is all that matters
    ends = np.cumsum([0, len(f.free) - len(f.hypothesis.free), *(len(s.free) for s in f.hypothesis.suspects)])
    strong = {id(n) for s in f.hypothesis.suspects for n in s.strengths} | {id(n) for n in f.free[: ends[1]]}
    at = np.where([id(n) in strong for n in f.free], f.coordinates.of(f.theta), 0.0)
    return shapley([rows[:, a:b] @ at[a:b] for a, b in pairwise(ends)])


def shapley(changes: Sequence[np.ndarray]) -> np.ndarray:
    """Parts (n,) of the squares of a sum of changes: their Shapley values, of squares that some of them explain.

    These are inner products with the sum. A negative one is one with that which it cancels most; the two are divided
    by their own squares.
    """
    x = np.array(changes)
    own, groups = np.sum(x * x, axis=1), [[k] for k in range(len(x))]
    while True:
        together = np.array([x[g].sum(axis=0) for g in groups])
        values = together @ together.sum(axis=0)
        worst = int(np.argmin(values))
        if values[worst] >= 0.0 or len(groups) == 1:
            break
        against = together @ together[worst]
        against[worst] = np.inf
        best = int(np.argmin(against))
        groups = [g for k, g in enumerate(groups) if k not in (worst, best)] + [groups[best] + groups[worst]]
    out = np.zeros(len(x))
    for g, value in zip(groups, values, strict=True):
        out[g] = max(value, 0.0) * own[g] / max(own[g].sum(), 1e-300)
    return out / max(out.sum(), 1e-300)

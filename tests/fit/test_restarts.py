"""Better starts of segments: a ball that bounces, whose measured rates beside a bounce are those of no motion."""

from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

import origami_sim.fit.least_squares as least_squares
from origami_sim.fit.least_squares import fit
from origami_sim.fit.predictor import Block, Prediction
from origami_sim.fit.restarts import best_of_each
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import Hypothesis

FRAME, LENGTH, NOISE = 0.01, 12, 1e-3
GRAVITY, STIFF, RESTITUTION, LOW = 9.81, 170.0, 0.95, 0.02


def flown(height: float, rate: float, time: float) -> tuple[float, float]:
    """Height and rate of a ball after a time, on ground that is a spring, with a loss where it leaves it."""
    sag = GRAVITY / STIFF**2
    while True:
        if height > 0.0 or (height == 0.0 and rate > 0.0):
            going = (rate + np.sqrt(rate * rate + 2.0 * GRAVITY * height)) / GRAVITY
            if time < going:
                return height + rate * time - 0.5 * GRAVITY * time * time, rate - GRAVITY * time
            height, rate = -1e-15, rate - GRAVITY * going
        else:
            size, phase = np.hypot(height + sag, rate / STIFF), np.arctan2(-rate / STIFF, height + sag)
            going = ((2.0 * np.pi - np.arccos(min(sag / size, 1.0)) - phase) % (2.0 * np.pi)) / STIFF
            if time < going:
                turn = phase + STIFF * time
                return size * np.cos(turn) - sag, -STIFF * size * np.sin(turn)
            height, rate = 0.0, RESTITUTION * STIFF * size * np.sqrt(1.0 - min(sag / size, 1.0) ** 2)
        time -= going


class Ball:
    """Segments of a recorded ball, each from a start that is measured by neighbouring frames."""

    local, nudge, blur, curve, separate = 2, 0.01, 0.0, False, True
    model, subject = SimpleNamespace(contacts=()), SimpleNamespace(nominals=())

    def __init__(self, seed: int, segments: int = 12) -> None:
        true = np.array([flown(0.05, 0.3, t) for t in FRAME * np.arange(segments * LENGTH)])
        read = true[:, 0] + NOISE * np.random.default_rng(seed).normal(size=len(true))
        self.begin = []
        for n in range(0, segments * LENGTH, LENGTH):
            late = n and true[n, 0] < LOW  # a rate that is averaged over frames is that before the bounce
            self.begin.append(np.array([read[n], abs(true[n, 1]) * (1.0 if late else np.sign(true[n, 1]))]))
        times, wide = FRAME * np.arange(LENGTH), np.array([0.1, 1.0])
        self.blocks = [
            Block(
                0, n * LENGTH, times, read[n * LENGTH : (n + 1) * LENGTH, None], np.array([NOISE]), None, np.zeros(1),  # type: ignore[arg-type]
                wide, reach=wide if n < segments - 1 else None, lasting=LENGTH * FRAME, shows=np.ones((1, 1)),
            )
            for n in range(segments)
        ]  # fmt: skip

    def step(self, hypothesis, theta) -> float:
        return 1.0

    def shoot(self, hypothesis, thetas, locals_, blocks) -> Prediction:
        values, ends = [], []
        for b in blocks:
            starts = self.begin[b] + locals_[:, b]
            values.append(np.array([[flown(*s, t)[0] for t in self.blocks[b].times] for s in starts])[:, :, None])
            tied = self.blocks[b].reach is not None
            ends.append(np.array([flown(*s, LENGTH * FRAME) for s in starts]) - self.begin[b + 1] if tied else None)
        return Prediction(values, ends)


def test_segments_begin_where_those_before_lead_past_a_bounce(monkeypatch):
    """All noise, and ties that hold; from measured starts alone least squares end at many times that."""
    given = {"weights": Weights(np.array([NOISE]), gap=1e-2), "fixed": True, "most": 12}
    left, alone = [], []
    for seed in range(4):
        left.append(fit(Ball(seed), Hypothesis(), **given).cost)
        with monkeypatch.context() as without:
            without.setattr(least_squares, "restarted", lambda *args: (args[3], 0.0))
            alone.append(fit(Ball(seed), Hypothesis(), **given).cost)
    count = 12 * LENGTH
    assert max(left) < count + 3.0 * np.sqrt(2.0 * count)
    assert min(alone) > 100.0 * count


def test_the_best_combination_of_starts_is_that_of_all():
    """Against all 3^5 combinations of three candidates of five segments, one pair of which is not tied."""
    rng = np.random.default_rng(1)
    tied, reach = [True, True, False, True, False], np.tile([0.3, 2.0], (5, 1))
    starts, ends = rng.normal(size=(2, 3, 5, 2))
    costs = rng.chisquare(3, size=(3, 5))
    costs[1, 2], ends[2, 0] = np.inf, np.nan  # of which no motion can be simulated

    def squares(choice) -> float:
        out = sum(costs[c, n] for n, c in enumerate(choice))
        for n in np.flatnonzero(tied):
            out += np.sum(((starts[choice[n + 1], n + 1] - ends[choice[n], n]) / reach[n]) ** 2)
        return float(np.nan_to_num(out, nan=np.inf))

    best = min(product(range(3), repeat=5), key=squares)
    found, least = best_of_each(tied, reach, starts, costs, ends)
    assert least == pytest.approx(squares(best), rel=1e-12)
    assert found.tolist() == list(best)

"""What the catalogue lacks: smooth curves in the channels, and laws that others imitate."""

from collections.abc import Collection

import numpy as np

from origami_sim.effects import get
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.linear import Linearisation
from origami_sim.fit.predictor import Predictor

SMOOTH = 40
"""Cosines of a channel's discrepancy in one recording, at most: slower than noise, faster than an offset."""


def cosines(forward: Predictor, f: Fit, line: Linearisation) -> list[np.ndarray]:
    """Per block [r, K]: smooth curves in each channel over each recording, of unit root mean square times 1/order."""
    dims = len(forward.components)
    chains: list[list[int]] = []
    for n, b in enumerate(f.blocks):
        tied = n > 0 and line.tie[n - 1] is not None
        same = n > 0 and forward.blocks[b].recording == forward.blocks[f.blocks[n - 1]].recording
        if tied or (same and not forward.separate):
            chains[-1].append(n)
        else:
            chains.append([n])
    most = max(2, min(SMOOTH, 240 // max(1, dims * len(chains))))
    kinds = [max(2, min(sum(line.rows[n].data for n in chain) // dims // 10, most)) for chain in chains]
    total = sum(kinds) * dims
    out = [np.zeros((r.count, total)) for r in line.rows]
    column = 0
    for chain, count in zip(chains, kinds, strict=True):
        frames = [line.rows[n].data // dims for n in chain]
        first = np.cumsum([0, *frames])
        for n, a in zip(chain, first[:-1], strict=True):
            t = (a + np.arange(line.rows[n].data // dims) + 0.5) / first[-1]
            seen = forward.blocks[f.blocks[n]].seen()
            for d in range(dims):
                for k in range(count):
                    shape = np.cos(np.pi * k * t) / (1.0 + k / 4.0)
                    out[n][d : line.rows[n].data : dims, column + d * count + k] = np.where(seen[:, d], shape, 0.0)
        column += count * dims
    return out


def laws(effects: Collection[str]) -> int:
    """How many laws these effects are: errors of a recorder imitate none, unless there is nothing else."""
    return sum(not of_recorder(e) for e in effects) or min(len(effects), 1)


def of_recorder(effect: str) -> bool:
    return get(effect).family == "measurement"

"""Thresholds of suspected laws, begun within what was recorded: fold angles, fields and voltages.

A stop beyond all recorded angles changes nothing, so that no derivative tells of it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from origami_sim.effects import get
from origami_sim.hypotheses.hypothesis import Suspect
from origami_sim.predict.track import recorded_folds
from origami_sim.predict.worlds import Worlds

REACHED = (0.6, 0.9)
"""Parts of the largest recorded value at which thresholds begin: what acts for long, and what acts at the ends alone.

A fit moves the threshold from there: half of both, and one of 0.75 alone, lead to the same verdict on a strip that
meets a stop, and to its angle within 3 mrad.
"""


def within_reach(forward: Worlds, every: Sequence[Suspect]) -> list[Suspect]:
    """The suspects, those with a threshold as often as it may begin; of a signed one, on either side.

    What is known of a threshold beforehand is that it lies about as far as the recordings go.
    """
    folds, out = recorded_folds(forward), []
    for s in every:
        place, quantity = next(
            ((n, p.threshold) for n, f in enumerate(s.free) if (p := get(s.effect).parameter(f.name)).threshold),
            (0, ""),
        )
        seen = recorded(forward, s, quantity, folds)
        f = s.free[place]
        sides = (1.0, -1.0) if f.lower < 0.0 else (1.0,)
        reach = [float(np.max(side * seen if len(sides) > 1 else np.abs(seen), initial=0.0)) for side in sides]
        starts = [side * part * most for side, most in zip(sides, reach, strict=True) if most > 0.0 for part in REACHED]
        for start in starts:
            known = {"start": float(np.clip(start, f.lower, f.upper)), "scale": 0.1 * max(reach), "spread": max(reach)}
            out.append(replace(s, free=tuple(replace(g, **known) if n == place else g for n, g in enumerate(s.free))))
        if not starts:  # it has none, or recordings do not tell
            out.append(s)
    return out


def recorded(forward: Worlds, s: Suspect, quantity: str, folds: dict[int, np.ndarray]) -> np.ndarray:
    """All recorded values (n,) of the quantity that a suspect's threshold is of; none if recordings do not tell."""
    if quantity == "fold":
        mine = folds if s.entities is None else [c for c in s.entities if c in folds]
        return np.concatenate([np.zeros(0), *(folds[c] for c in mine)])
    signals = [
        c.at(r.times)
        for r in forward.recordings
        for name, c in r.drive.items()
        if quantity and name.startswith(quantity)
    ]
    return np.concatenate([np.zeros(0), *(size(values) for values in signals)])


def size(values: np.ndarray) -> np.ndarray:
    """Sizes (n,) of the values of a drive in time, of vectors their lengths."""
    return np.abs(values) if values.ndim == 1 else np.linalg.norm(values, axis=-1)

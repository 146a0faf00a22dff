"""Thresholds of suspected laws, begun within what was recorded: fold angles, moments of creases, fields, voltages.

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
"""Parts of the way to the largest recorded value at which thresholds begin: what acts for long, what at the ends alone.

A fit moves the threshold from there: half of both, and one of 0.75 alone, lead to the same verdict on a strip that
meets a stop, and to its angle within 3 mrad.
"""

YIELDING = (0.2, 0.5)
"""The same of the moment of a crease that would not yield; one that does turns as far at less.

Half and double of both lead to the same moment and softening of a chain of which one crease yields.
"""


def within_reach(forward: Worlds, every: Sequence[Suspect]) -> list[Suspect]:
    """The suspects, those with a threshold as often as it may begin; of a law on one side of it, on either side.

    What is known of a threshold beforehand is that it lies about as far as the recordings go. A side that they do not
    reach from zero, as of a lid that cannot close, they reach from their other end.
    """
    folds, out = recorded_folds(forward), []
    for s in every:
        place, p = next(
            ((n, p) for n, f in enumerate(s.free) if (p := get(s.effect).parameter(f.name)).threshold), (0, None)
        )
        seen = recorded(forward, s, p.threshold if p is not None else "", folds)
        most = float(np.max(np.abs(seen), initial=0.0))
        if p is None or not most:  # it has none, or recordings do not tell
            out.append(s)
            continue
        high, low = float(np.max(seen)), float(np.min(seen))
        above, below = (1.0, 0.0 if high > 0.0 else low, high), (-1.0, 0.0 if low < 0.0 else high, low)
        ways = (above, below) if p.side else ((1.0, 0.0, most),)
        for side, begin, end in ways:
            for part in YIELDING if p.threshold == "moment" else REACHED:
                start = float(np.clip(begin + part * (end - begin), s.free[place].lower, s.free[place].upper))
                known = replace(s.free[place], start=start, scale=0.1 * most, spread=most)
                free = tuple(known if n == place else g for n, g in enumerate(s.free))
                out.append(replace(s, free=free, fixed=((p.side, side),) if p.side else ()))
    return out


def recorded(forward: Worlds, s: Suspect, quantity: str, folds: dict[int, np.ndarray]) -> np.ndarray:
    """All recorded values (n,) of the quantity that a suspect's threshold is of; none if recordings do not tell."""
    if quantity in ("fold", "moment"):
        seen = {c: angles for c, angles in folds.items() if s.entities is None or c in s.entities}
        if quantity == "moment":  # of the crease, as it is given
            law = forward.parameters.of("crease") if "crease" in forward.model.effects else {}
            seen = {c: law["stiffness"][c, 0] * (a - law["rest_angle"][c, 0]) for c, a in seen.items() if law}
        return np.concatenate([np.zeros(0), *seen.values()])
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

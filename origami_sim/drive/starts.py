"""A drive as it is seen from several starts."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from origami_sim.drive.drive import PATHS, SAMPLES_PER_SECOND, Drive, Signal, series

BENDS, LISTED = 512, 10**6
"""Places at which a drive that is seen from many starts is sampled at least, and of which a list is made at most.

Jumps keep their instants while there are no more of them: on a grid of 0.5 ms a voltage that is switched within a short
segment moves a finger of 0.3 g by 5 mrad. Twenty-two delays of a drive with four switches need 176 places; the list is
8 MB at most.
"""


def shifted(
    drive: Drive, starts: np.ndarray, duration: float, worlds: int, among=None, commanded: Drive | None = None
) -> Drive:
    """The drive seen from several starts [s], one rollout for each [world, start].

    Args:
        starts: (B,) or [worlds, B]. among: starts of all rollouts for which it is sampled alike (default: of these).
            commanded: before it was distorted, whose bends it keeps.
    """
    among = starts if among is None else among
    count = starts.shape[-1]
    if not np.any(among) and (count == 1 or drive.worlds == 1):
        return drive
    changed = {}
    for name, s in drive.signals.items():
        if name == "origin":
            continue
        if s.constant:
            if np.size(s.offset) > 1:
                changed[name] = np.repeat(s.offset, count)
            continue
        given = s if commanded is None else commanded[name]
        wave = Signal(amplitude=given.amplitude, frequency=given.frequency, phase=given.phase)
        sampled = np.any(given.amplitude) or s.times is not given.times
        local = wave.sampled(duration) if sampled else np.array([0.0, duration])
        if given.times is not None:
            local = np.unique(np.concatenate([local, _knots(given.times, among.ravel(), duration)]))
        each = s.each()
        own = np.broadcast_to(starts, (len(each), count)) if starts.ndim == 1 else starts
        each *= len(own) // len(each)
        seen = [(one, local + t0) for one, t in zip(each, own, strict=True) for t0 in t]
        changed[name] = series(local, _columns([one(t) for one, t in seen], local, worlds * count))
        if name.partition("_")[0] in PATHS and s.smooth:  # and exactly so
            rates = _columns([one.derivatives(t)[0] for one, t in seen], local, worlds * count)
            changed[name] = replace(changed[name], slopes=rates)
    age = np.ravel(drive.signals["origin"](0.0))
    ages = (np.broadcast_to(age, worlds)[:, None] + starts).ravel()
    return drive.replace(**changed, origin=ages)


def _columns(each: Sequence[np.ndarray], local: np.ndarray, rollouts: int) -> np.ndarray:
    """Values [n, rollouts] at local times (n,) of what is given for each rollout, or for those of all worlds alike."""
    columns = np.stack([np.broadcast_to(one, local.shape) for one in each], axis=1)
    return np.tile(columns, (1, rollouts // len(each)))


def _knots(times: np.ndarray, starts: np.ndarray, duration: float) -> np.ndarray:
    """Where a series bends within a duration from any of the starts; a fine grid if that were many more places."""
    rate = min(4.0 / float(np.min(np.diff(times))), SAMPLES_PER_SECOND)
    most = max(BENDS, int(np.ceil(rate * duration)))
    begins = np.unique(starts)
    first, last = np.searchsorted(times, [begins, begins + duration])
    if np.sum(last - first) <= LISTED:
        within = [times[a:b] - t0 for a, b, t0 in zip(first, last, begins, strict=True)]
        exact = np.unique(np.round(np.concatenate(within), 10))
        if len(exact) <= most:
            return exact[(exact > 0.0) & (exact < duration)]
    return np.linspace(0.0, duration, most + 1)

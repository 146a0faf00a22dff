"""What laws remember at the first frame of a recording that begins in the midst of a motion.

A recording does not tell what was before it. Where a law forgets linearly, its memory at the first frame is as unknown
as angles and rates are there, and a number of its own in each recording and at each crease: normal, with the most that
the recorded motion, from rest, makes of that memory as its standard deviation if it is under way at the first frame. A
motion that decays was larger before; what begins slower than it usually is has less behind it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from origami_sim.effects import get
from origami_sim.hypotheses.hypothesis import Free, Hypothesis, Suspect
from origami_sim.model import Model, Parameters

Rows = list[tuple[slice, np.ndarray]]
"""Rows of the memory, and what they are over the most that a recorded motion makes of them [entities, W]."""


def with_begins(every: Sequence[Suspect], recordings: Mapping[int, float], entities: Sequence[int]) -> list[Suspect]:
    """The suspects; those that remember, with what they do at the first frame of each of these recordings.

    Args:
        recordings: how far each is under way at its first frame, 0 to 1. entities: creases that move.
    """
    out = []
    for s in every:
        fitted = {f.name for f in s.free}
        names = [m.begun for m in get(s.effect).memory if m.begun and m.by in fitted and not s.more]
        mine = [e for e in entities if s.entities is None or e in s.entities]
        more = [
            Free(s.effect, n, "-", 0.0, way, spread=way, entities=(e,), recording=r)
            for n in names
            for r, way in recordings.items()
            for e in mine
            if way
        ]
        out.append(replace(s, free=(*s.free, *more)) if more else s)
    return out


def within(hypothesis: Hypothesis, values: np.ndarray, nominals: int, recording: int) -> tuple[Hypothesis, np.ndarray]:
    """A hypothesis and its numbers, of which only those that are about a recording."""
    kept = [f.recording is None or f.recording == recording for f in hypothesis.free]
    if all(kept):
        return hypothesis, values
    some = [
        replace(s, free=tuple(f for f in s.free if f.recording is None or f.recording == recording))
        for s in hypothesis.suspects
    ]
    return Hypothesis(tuple(some)), np.asarray(values)[[True] * nominals + kept]


def begins(model: Model, parameters: Parameters) -> Rows:
    """Memory that does not begin at rest."""
    out, row = [], 0
    own = {(e, m.name): m.begun for e in model.effects for m in get(e).memory}
    for effect, name, size in model.memories:
        begun = own[effect, name]
        if begun and np.any(given := parameters[effect, begun]):
            out.append((slice(row, row + size), given))
        row += size
    return out

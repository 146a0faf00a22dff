"""Spectra of relaxation: several branches of a Prony series are one law, and those that do nothing are left out."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from origami_sim.effects import get
from origami_sim.hypotheses.hypothesis import Suspect

IDLE = 1e-6
"""Part of its scale below which a branch does nothing: what bounded least squares leave of a number that a bound holds.

Half and double decide nothing.
"""


def with_spectra(every: Sequence[Suspect], shortest: float, longest: float) -> list[Suspect]:
    """The suspects, and those that relax with a Prony series of two and more branches, which is one law.

    Args:
        shortest, longest: between which the time constants of a series begin, evenly in their logarithm [s].
    """
    out, done = list(every), set()
    for s in every:
        place = s.effect, s.entities, s.more
        branches = [n for n in (1, 2, 3) if _has_branch(s.effect, n)]
        if place in done or s.more or len(branches) < 2:
            continue
        done.add(place)
        stiffness, time = s.free
        for count in branches[1:]:
            times = np.geomspace(shortest, longest, count + 2)[1:-1]
            free = []
            for n, t in enumerate(times, 1):
                free.append(replace(stiffness, name=f"stiffness_{n}"))
                free.append(replace(time, name=f"time_{n}", start=float(t)))
            out.append(replace(s, free=tuple(free)))
    return out


def _has_branch(effect: str, n: int) -> bool:
    return {f"stiffness_{n}", f"time_{n}"} <= {p.name for p in get(effect).parameters}


def without_idle(s: Suspect, values: np.ndarray, every: Sequence[Suspect]) -> tuple[Suspect, np.ndarray]:
    """A suspect and its numbers (k,), without the branches of its spectrum that a fit left at nothing.

    Args:
        every: suspects, of which the one with as many branches as are left stands for it whose time constants begin
            nearest.
    """
    # a branch's numbers end in its number: stiffness_2, time_2
    idle = {f.name[-2:] for f, v in zip(s.free, values, strict=True) if f in s.strengths and abs(v) < IDLE * f.scale}
    left = [(f.name, v) for f, v in zip(s.free, values, strict=True) if f.name[-2:] not in idle]
    kept = np.array([v for _, v in left])
    shorter = [t for t in every if t.label == s.label and len(t.free) == len(kept) < len(values)]
    if not shorter:
        return s, values
    times = np.log([v for name, v in left if name.startswith("time_")])  # beside what a branch remembers at the start

    def apart(t: Suspect) -> float:
        return float(np.abs(times - np.log([f.start for f in t.free if f.name.startswith("time_")])).sum())

    return min(shorter, key=apart), kept

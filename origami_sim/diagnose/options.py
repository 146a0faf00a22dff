"""How thoroughly a diagnosis looks."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Options:
    """How thoroughly to look; the defaults keep the promise of a minute for four panels and ten seconds.

    Attributes:
        panels: "rigid", "elastic", or "auto": rigid where bending could not show.
        segment: length of a segment [s], each with a start of its own; None: chosen from how fast starts are forgotten
            or amplified.
        start: "fit", "rest" or None (rest if the recording starts at rest in the reference state).
        rate: frames per second that are compared; the recording is thinned to it.
        steps: solver steps that one pass over the data may take; longer recordings are sampled evenly.
        screened: segments that the screening uses at most.
        finalists: suspects that are refitted. most: effects that may be combined.
        significance, level: of the look-elsewhere tests, against noise and against effects too small to be told.
        seed: of the null draws. threads: see `Batch`.
    """

    panels: str = "auto"
    segment: float | None = None
    start: str | None = None
    rate: float = 200.0
    steps: int = 150_000
    screened: int = 8
    finalists: int = 6
    most: int = 3
    significance: float = 0.05
    level: float = 0.05
    draws: int = 999
    seed: int = 0
    threads: int | None = None


Report = Callable[[str, float], None]
"""Told the stage and the fraction of it that is done."""

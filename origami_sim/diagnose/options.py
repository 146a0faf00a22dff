"""How a diagnosis looks."""

from collections.abc import Callable
from dataclasses import dataclass

from origami_sim.possible import Possible


@dataclass(frozen=True)
class Options:
    """How a diagnosis looks; the defaults are what an experimenter wants.

    Attributes:
        motion: "dynamic", "quasistatic" (equilibria along time), or "auto": as stated, or quasi-static where inertia
            could not show.
        panels: "rigid", "elastic", or "auto": rigid where bending could not show.
        segment: length of a segment [s], each with a start of its own; None: what can be predicted.
        start: "fit", "rest" or None (rest if the recording starts at rest in the reference state).
        rate: frames per second that are compared; what was recorded faster is averaged to it.
        fits: sets of effects that are fitted at most. threads: see `Batch`.
        possible: what the set-up can do in a further recording; None: what the scene says, else the defaults. What a
            sidecar states goes before either.
    """

    motion: str = "auto"
    panels: str = "auto"
    segment: float | None = None
    start: str | None = None
    rate: float = 200.0
    fits: int = 16
    threads: int | None = None
    possible: Possible | None = None


Report = Callable[[str, float], None]
"""Told the stage and the fraction of it that is done."""

"""How a diagnosis looks."""

from collections.abc import Callable
from dataclasses import dataclass

from origami_sim.errors import InputError
from origami_sim.recording.possible import Possible


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
        fits: sets of effects that are fitted at most since one took the lead; as many more if those are more probable.
        limit: seconds from the beginning after which no further suspect is simulated and no further set is fitted: the
            verdict is then what is known, and says how probable what was not fitted is. A fit that has begun is ended
            first. Hard stops take 117 s on a core.
        threads: see `Batch`.
        possible: what the set-up can do in a further recording; None: what the scene says, else the defaults. What a
            sidecar states goes before either.

    Raises:
        InputError: a rate or a limit that is not positive, fewer than 4 fits.
    """

    motion: str = "auto"
    panels: str = "auto"
    segment: float | None = None
    start: str | None = None
    rate: float = 200.0
    fits: int = 16
    limit: float = 300.0
    threads: int | None = None
    possible: Possible | None = None

    def __post_init__(self):
        if not self.rate > 0:
            raise InputError("frames are compared at a positive rate", field="rate", value=self.rate, allowed="> 0 Hz")
        if not self.limit > 0:
            raise InputError("a search takes time", field="limit", value=self.limit, allowed="> 0 s")
        if self.fits < 4:
            raise InputError("too few fits to find an effect", field="fits", value=self.fits, allowed="4 or more")


Report = Callable[[str, float], None]
"""Told the stage and the fraction of it that is done."""

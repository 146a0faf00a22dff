"""What a diagnosis keeps beside its answer: its fits, what stands so far, predictions on disk with which it resumes."""

from collections.abc import Callable
from pathlib import Path

from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.predict.cache import Cache
from origami_sim.predict.worlds import Worlds
from origami_sim.report.diagnosis import Diagnosis
from origami_sim.threads import leads
from origami_sim.verdict.stored import Stored


class Keep:
    """The memory of one diagnosis.

    Attributes:
        forward: what predicted. fits: "before" (as given), "refitted" and "after" (the best explanation).
        cache: predictions on disk, if there is a folder for them.
        found: the diagnosis as far as it stands; None before there is a verdict.
        write: called with it whenever it has changed; may be set.
        film: writes its replays and returns them; may be set. films: what it returned.
        store: whether `stored` is wanted: what is needed to judge the search anew; there as soon as the verdict stands.
    """

    def __init__(self, folder: str | Path | None = None, *, store: bool = False):
        self.cache = None if folder is None else Cache(folder)
        self.forward: Predictor | None = None
        self.fits: dict[str, Fit] = {}
        self.found: Diagnosis | None = None
        self.store = store
        self.stored: Stored | None = None
        self.write: Callable[[Diagnosis], object] | None = None
        self.film: Callable[[Diagnosis], list[Path]] | None = None
        self.films: list[Path] = []

    def follow(self, forward: Predictor) -> None:
        """From now on, predictions of this predictor, and of copies of it, are remembered."""
        self.forward = forward
        if isinstance(forward, Worlds):
            forward.cache = self.cache

    def stands(self, found: Diagnosis) -> None:
        """Takes over the diagnosis as it is now."""
        self.found = found
        if self.write is not None and leads():
            self.write(found)

    def clear(self) -> None:
        """Forgets the predictions on disk."""
        if self.cache is not None:
            self.cache.clear()

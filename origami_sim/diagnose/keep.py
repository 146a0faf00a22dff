"""What a diagnosis keeps beside its answer: its fits, and predictions on disk with which it resumes."""

from pathlib import Path

from origami_sim.fit.cache import Cache
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.worlds import Worlds


class Keep:
    """The memory of one diagnosis.

    Attributes:
        forward: what predicted. fits: "before" (as given), "refitted" and "after" (the best explanation).
        cache: predictions on disk, if there is a folder for them.
    """

    def __init__(self, folder: str | Path | None = None):
        self.cache = None if folder is None else Cache(folder)
        self.forward: Predictor | None = None
        self.fits: dict[str, Fit] = {}

    def follow(self, forward: Predictor) -> None:
        """From now on, predictions of this predictor, and of copies of it, are remembered."""
        self.forward = forward
        if isinstance(forward, Worlds):
            forward.cache = self.cache

    def clear(self) -> None:
        """Forgets the predictions on disk."""
        if self.cache is not None:
            self.cache.clear()

"""What a diagnosis keeps beside its answer: predictions on disk, so that it can be interrupted, and its fits.

Nearly all of its time goes into predictions, which are pure functions of model, parameters, starts and drive. Each is
stored under a digest of these and of the package's own sources; a diagnosis that is started again finds them and so
arrives in seconds where it was stopped. Nothing is pickled.
"""

import hashlib
import os
import shutil
import time as clock
import zipfile
import zlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np

from origami_sim.diagnose.forward import Forward
from origami_sim.fit.hypothesis import Hypothesis
from origami_sim.fit.least_squares import Fit

WORTH = 0.02
"""Predictions that took less [s] are not stored."""

_SOURCES = ("*.py", "effects/*.py", "solve/*.py", "recording/*.py", "diagnose/*.py")


class Keep:
    """The memory of one diagnosis.

    Attributes:
        forward: the segments. fits: "before" (as given), "refitted" and "after" (the best explanation).
        found, computed: predictions that were found on disk, and those that were made.
    """

    def __init__(self, folder: str | Path | None = None):
        self.folder = None if folder is None else Path(folder)
        self.forward: Forward | None = None
        self.fits: dict[str, Fit] = {}
        self.found = self.computed = 0

    def follow(self, forward: Forward) -> None:
        """From now on, predictions of this forward model, and of copies that are made of it, are remembered."""
        self.forward = forward
        if self.folder is not None:  # by its class: a copy of it remembers as well, under a digest of its own
            kind = type(forward)
            forward.__class__ = type(kind.__name__, (kind,), {"predict": self._remembering(kind)})

    def _remembering(self, kind: type[Forward]) -> Callable[..., list[np.ndarray]]:
        """The method `predict` of a kind of forward model, which first looks among what is stored."""

        def predict(
            forward: Forward,
            hypothesis: Hypothesis | Sequence[Hypothesis],
            theta: Sequence[np.ndarray] | np.ndarray,
            local: np.ndarray | None = None,
            blocks: Sequence[int] | None = None,
            *,
            soft: bool = False,
        ) -> list[np.ndarray]:
            assert self.folder is not None
            wanted = list(range(len(forward.blocks)) if blocks is None else blocks)
            file = self.folder / f"{digest(forward, hypothesis, theta, local, wanted, soft)}.npz"
            stored = _read(file, len(wanted))
            if stored is not None:
                self.found += 1
                return stored
            began = clock.perf_counter()
            # in the order of memory that a file has: sums depend on it in their last digit
            made = kind.predict(forward, hypothesis, theta, local, blocks, soft=soft)
            out = [np.ascontiguousarray(v) for v in made]
            self.computed += 1
            if clock.perf_counter() - began > WORTH:
                _write(file, out)
            return out

        return predict

    def clear(self) -> None:
        """Forgets the predictions on disk."""
        if self.folder is not None:
            shutil.rmtree(self.folder, ignore_errors=True)


def digest(forward: Forward, hypothesis, theta, local, wanted: Sequence[int], soft: bool) -> str:
    """Digest of all that a prediction depends on."""
    each = [hypothesis] * len(theta) if isinstance(hypothesis, Hypothesis) else list(hypothesis)
    effects = tuple(dict.fromkeys(e for h in each for e in h.effects))
    sites = [[(s.effect, s.entities) for s in h.suspects] for h in each]
    numbers = [f.name for f in forward.subject.nominals]
    kind = (type(forward).__name__, forward.start, forward.softness, forward.calm, numbers, soft)
    h = hashlib.sha256(repr((_sources(), kind, effects, sites, wanted)).encode())
    nominal = np.array([f.start for f in forward.subject.nominals])
    model, parameters = forward._world(Hypothesis(), nominal, ())
    h.update(model.hash.encode() + parameters.hash.encode())
    for values in theta:
        h.update(np.asarray(values, float).tobytes() + b"|")
    path = getattr(forward, "_q", None)  # of a prescribed motion
    for part in path if isinstance(path, (list, tuple)) else [path]:
        h.update(b"-" if part is None else np.asarray(part, float).tobytes())
    h.update(b"-" if local is None else np.ascontiguousarray(np.asarray(local)[:, wanted]).tobytes())
    for b in wanted:
        block = forward.blocks[b]
        h.update(repr((block.recording, block.first)).encode())
        for part in (
            block.times,
            block.values[:1],
            block.rates,
            block.pose.rotation,
            block.pose.centre,
            block.pose.angles,
        ):
            h.update(np.ascontiguousarray(part).tobytes())
    for recording, drive in zip(forward.recordings, forward._drives, strict=True):
        h.update(recording.times.tobytes())
        for c in recording.channels.values():
            h.update(repr((c.name, c.kind, c.noise, c.values.shape, sorted(c.attachment.items()), c.camera)).encode())
            h.update(np.ascontiguousarray(c.values).tobytes())
        for name, signal in drive.signals.items():
            h.update(name.encode())
            for value in vars(signal).values():
                h.update(b"-" if value is None else np.asarray(value, float).tobytes())
    return h.hexdigest()[:32]


@cache
def _sources() -> str:
    """Digest of the package: predictions of another version are not its own."""
    h = hashlib.sha256()
    home = Path(__file__).parents[1]
    for pattern in _SOURCES:
        for file in sorted(home.glob(pattern)):
            h.update(file.name.encode() + file.read_bytes())
    return h.hexdigest()


def _read(file: Path, count: int) -> list[np.ndarray] | None:
    """Stored predictions; None if there are none, or if the file is damaged."""
    try:
        with np.load(file, allow_pickle=False) as data:
            return [data[str(n)] for n in range(count)]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error):
        return None


def _write(file: Path, values: list[np.ndarray]) -> None:
    """Stores predictions, if the disk takes them: without, only an interruption costs more."""
    part = file.with_name(f".{file.stem}.{os.getpid()}.part")
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        with open(part, "wb") as f:
            np.savez(f, allow_pickle=False, **{str(n): v for n, v in enumerate(values)})
        part.replace(file)
    with suppress(OSError):
        part.unlink(missing_ok=True)

"""Predictions that are kept on disk, so that work which was interrupted goes on.

Nearly all time goes into predictions, which are pure functions of model, parameters, starts and drive. Each is
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

from origami_sim.fit.predictor import Prediction
from origami_sim.hypotheses.hypothesis import Free, Hypothesis
from origami_sim.predict.worlds import Worlds
from origami_sim.threads import leads, told

WORTH = 0.02
"""Predictions that took less [s] are not stored."""

_FOLDERS = "physics drive effects model pattern solve recording device observation hypotheses fit predict".split()
_SOURCES = ("*.py", *(f"{folder}/**/*.py" for folder in _FOLDERS))


class Cache:
    """Predictions that were made, in a folder.

    Attributes:
        found, computed: predictions that were found on disk, and those that were made.
    """

    def __init__(self, folder: str | Path):
        self.folder = Path(folder)
        self.found = self.computed = 0

    def recalled(
        self,
        forward: Worlds,
        each: Sequence[Hypothesis],
        theta: Sequence[np.ndarray] | np.ndarray,
        local: np.ndarray | None,
        wanted: Sequence[int],
        made: Callable[[], Prediction],
    ) -> Prediction:
        """What was predicted before, or else what is made now."""

        def known() -> tuple[Path, Prediction | None]:
            file = self.folder / f"{digest(forward, each, theta, local, wanted)}.npz"
            return file, _read(file, len(wanted))

        file, stored = told(known)
        if stored is not None:
            self.found += 1
            return stored
        began = clock.perf_counter()
        out = made()
        self.computed += 1
        if leads() and clock.perf_counter() - began > WORTH:
            _write(file, out)
        return out

    def clear(self) -> None:
        """Forgets the predictions on disk."""
        shutil.rmtree(self.folder, ignore_errors=True)


def digest(forward: Worlds, each: Sequence[Hypothesis], theta, local, wanted: Sequence[int]) -> str:
    """Digest of all that a prediction depends on."""
    effects = tuple(dict.fromkeys(e for h in each for e in h.effects))
    sites = [[(s.effect, s.entities, *map(_number, s.free)) for s in h.suspects] for h in each]
    numbers = [_number(f) for f in forward.subject.nominals]
    h = hashlib.sha256(repr((_sources(), forward.kind(), numbers, effects, sites, list(wanted))).encode())
    nominal = np.array([f.start for f in forward.subject.nominals])
    model, parameters = forward.world(Hypothesis(), nominal, ())
    h.update(model.hash.encode() + parameters.hash.encode())
    for values in theta:
        h.update(np.asarray(values, float).tobytes() + b"|")
    if local is not None:  # what is remembered at a start depends on the first world's starts before it
        h.update(np.ascontiguousarray(np.asarray(local)[:, wanted]).tobytes() + np.asarray(local)[0].tobytes())
    for b in wanted:
        h.update(forward.blocks[b].digest)
    for part in forward.inputs():
        h.update(b"-" if part is None else part if isinstance(part, bytes) else np.asarray(part, float).tobytes())
    return h.hexdigest()[:32]


def _number(f: Free) -> tuple:
    """Which number of a model a value is for."""
    return f.owner, f.name, f.entities, f.recording


@cache
def _sources() -> str:
    """Digest of the package: predictions of another version are not its own."""
    h = hashlib.sha256()
    home = Path(__file__).parents[1]
    for pattern in _SOURCES:
        for file in sorted(home.glob(pattern)):
            h.update(file.name.encode() + file.read_bytes())
    return h.hexdigest()


def _read(file: Path, count: int) -> Prediction | None:
    """Stored predictions; None if there are none, or if the file is damaged."""
    try:
        with np.load(file, allow_pickle=False) as data:
            shapes, tied, numbers = data["shapes"], data["tied"], data["numbers"]
            if len(tied) != count or np.any(shapes < 0) or np.sum(np.prod(shapes, axis=1)) != len(numbers):
                return None
            parts = np.split(numbers, np.cumsum(np.prod(shapes, axis=1)))[:-1]
            arrays = [a.reshape(shape) for a, shape in zip(parts, shapes, strict=True)]
            ends = iter(a[..., 0] for a in arrays[count:])
            return Prediction(arrays[:count], [next(ends) if some else None for some in tied])
    except (OSError, ValueError, KeyError, EOFError, StopIteration, zipfile.BadZipFile, zlib.error):
        return None
    except RuntimeError:  # flags of an archive that asks for a password, or for what zipfile cannot do
        return None


def _write(file: Path, prediction: Prediction) -> None:
    """Stores predictions, if the disk takes them: without, only an interruption costs more."""
    part = file.with_name(f".{file.stem}.{os.getpid()}.part")
    # one after the other: an entry of the file for each took longer than what is in them
    arrays = [*prediction.values, *(e[..., None] for e in prediction.ends if e is not None)]
    whole = {
        "numbers": np.concatenate([np.zeros(0), *(a.ravel() for a in arrays)]),
        "shapes": np.array([a.shape for a in arrays], np.int64).reshape(-1, 3),
        "tied": np.array([e is not None for e in prediction.ends]),
    }
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        with open(part, "wb") as f:
            np.savez(f, allow_pickle=False, **whole)
        part.replace(file)
    with suppress(OSError):
        part.unlink(missing_ok=True)

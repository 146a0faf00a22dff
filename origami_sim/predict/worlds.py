"""Models of hypotheses: what is simulated for numbers of the model and of the effects that are suspected."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from origami_sim.drive import Drive
from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.fit.predictor import Block, Prediction, Predictor
from origami_sim.hypotheses.hypothesis import Hypothesis, Subject, apply
from origami_sim.hypotheses.suspects import suspects
from origami_sim.hypotheses.weight import weighed
from origami_sim.model import Model, Parameters
from origami_sim.model.articulation import Articulation
from origami_sim.observation.channels import component_names
from origami_sim.predict.begun import within
from origami_sim.recording import Recording

if TYPE_CHECKING:
    from origami_sim.predict.cache import Cache
    from origami_sim.predict.track import Track

World = tuple[Model, Parameters]


class Worlds(ABC):
    """What all predictors have in common: the object, its recordings, and models of it.

    Args:
        subject: how to build the model. recordings: of one object. threads: see `Batch`.
    """

    nudge, blur, prescribed, abrupt = 0.01, 0.0, False, False

    def __init__(self, subject: Subject, recordings: Sequence[Recording], threads: int | None = None):
        self.subject, self.recordings, self.threads = subject, list(recordings), threads
        self.values = {f.name: f.start for f in subject.nominals}
        self.cache: Cache | None = None
        self.model, self.parameters, self.drive = subject.build(self.values)
        self.articulation = Articulation(self.model)
        self.shared = self._program()
        self._given = np.array([f.start for f in subject.nominals])
        self._built: dict[tuple, World] = {}
        self._arms: dict[bytes, Articulation] = {self.model.position.tobytes(): self.articulation}
        self.components = component_names(self.recordings[0])
        self.tracked: dict[int, Track | None] = {}
        self.blocks: list[Block] = []
        self.drives: list[Drive] = []

    def _program(self) -> tuple[str, ...]:
        """The effects of the program that all hypotheses share: compiling one for each took longer than running."""
        every = suspects(self.model, self.recordings, self.drive, self.parameters)
        return tuple(dict.fromkeys([*self.model.effects, *(s.effect for s in every)]))

    def built(self, values: Mapping[str, float]) -> World:
        """Model and parameters for values of the nominals, remembered; of measurements one row for each channel."""
        key = tuple(values.items())
        if key not in self._built:
            if len(self._built) > 500:
                self._built.clear()
            model, parameters, _ = self.subject.build(values)
            model = replace(model, channels=max(len(r.channels) for r in self.recordings))
            self._built[key] = model, parameters.for_model(model)
        return self._built[key]

    def predict(self, hypothesis, theta, local=None, blocks=None) -> list[np.ndarray]:
        """See `Predictor.predict`."""
        return self.shoot(hypothesis, theta, local, blocks).values

    def shoot(
        self,
        hypothesis: Hypothesis | Sequence[Hypothesis],
        theta: Sequence[np.ndarray] | np.ndarray,
        local: np.ndarray | None = None,
        blocks: Sequence[int] | None = None,
    ) -> Prediction:
        """See `Predictor.shoot`."""
        wanted = list(range(len(self.blocks)) if blocks is None else blocks)
        each = [hypothesis] * len(theta) if isinstance(hypothesis, Hypothesis) else list(hypothesis)

        def made() -> Prediction:
            out = self._shot(each, theta, local, wanted)
            # in the order of memory that stored ones have: sums depend on it in their last digit
            ends = [None if e is None else e.copy(order="C") for e in out.ends]
            return Prediction([v.copy(order="C") for v in out.values], ends)

        return made() if self.cache is None else self.cache.recalled(self, each, theta, local, wanted, made)

    def abruptly(self) -> Predictor | None:
        """See `Predictor.abruptly`: here none."""
        return None

    def kind(self) -> tuple:
        """What kind of prediction it is, for a digest."""
        return (type(self).__name__, getattr(self, "start", ""), getattr(self, "calm", 0.0))

    def inputs(self) -> Iterator[np.ndarray | bytes | None]:
        """All of the recordings that a prediction depends on, for a digest."""
        for recording, drive in zip(self.recordings, self.drives, strict=True):
            yield recording.times
            yield repr((recording.gravity, recording.start)).encode()
            for c in recording.channels.values():
                yield repr((c.name, c.kind, c.noise, c.values.shape, sorted(c.attachment.items()), c.camera)).encode()
                yield c.values
            for name, signal in drive.signals.items():
                yield name.encode()
                yield from (None if v is None else np.asarray(v, float) for v in signal.numbers)
            yield drive.fingerprint

    @abstractmethod
    def _shot(self, each: Sequence[Hypothesis], theta, local, wanted: list[int]) -> Prediction:
        """What `shoot` predicts, if it is not remembered."""

    def worlds_of(self, each: Sequence[Hypothesis], theta, effects: Sequence[str], r: int):
        """A world for each hypothesis, weighed as in a recording, and those of which no model can be built."""
        worlds, impossible, gravity = [], [], self.recordings[r].gravity
        for k, (h, t) in enumerate(zip(each, theta, strict=True)):
            try:
                world = self.world(*within(h, t, len(self.subject.nominals), r), effects)
            except InputError:  # such as an inertia that no masses give
                impossible.append(k)
                world = self.world(Hypothesis(), self._given, effects)
            worlds.append(weighed(*world, gravity))
        return worlds, impossible

    def world(self, hypothesis: Hypothesis, values: np.ndarray, effects: Sequence[str]) -> World:
        """The model with these effects, and the parameters of one world."""
        count = len(self.subject.nominals)
        names = [f.name for f in self.subject.nominals]
        model, parameters = self.built(dict(zip(names, map(float, values[:count]), strict=True)))
        if not effects:
            return model, parameters
        richer = model.with_effects(*effects)
        return richer, apply(parameters, hypothesis, values[count:], richer)


def distinct_memories(worlds: Sequence[World]) -> tuple[list[int], np.ndarray]:
    """Worlds of which no two remember the same motion differently, and (K,) which of them each world is like."""
    telling = {e for e in worlds[0][0].effects if get(e).memory or get(e).family == "drive"}
    found: dict[bytes, int] = {}
    of = [
        found.setdefault(b"".join(parameters[p].tobytes() for p in parameters if p[0] in telling), len(found))
        for _, parameters in worlds
    ]
    return [of.index(n) for n in range(len(found))], np.array(of)


def lasting(model: Model) -> np.ndarray:
    """Rows of memory that do not fade: of laws in which no time passes, such as dry friction."""
    stays = {e for e, *_ in model.memories if "dt" not in get(e).arguments}
    rows = np.concatenate([np.zeros(0, bool), *(np.full(size, e in stays) for e, _, size in model.memories)])
    return np.flatnonzero(rows)


def distinct_motions(worlds: Sequence[World], *more: np.ndarray | None) -> tuple[list[int], np.ndarray]:
    """Worlds of which no two move alike, and (K,) which of them each world moves like: a measurement moves nothing.

    Args:
        more: what else makes worlds differ, [K, ...] each.
    """
    shown = {e for e in worlds[0][0].effects if get(e).family == "measurement"}
    found: dict[tuple, int] = {}
    first, of = [], []
    for k, (model, parameters) in enumerate(worlds):
        felt = b"".join(parameters[p].tobytes() for p in parameters if p[0] not in shown)
        key = (model.position.tobytes(), felt, *(m[k].tobytes() for m in more if m is not None))
        if key not in found:
            found[key] = len(first)
            first.append(k)
        of.append(found[key])
    return first, np.array(of)

"""What a hypothesis predicts for recordings: the protocol that rollouts of bars, of rigid panels, and curves share."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from typing import Protocol

import numpy as np

from origami_sim.drive import Drive
from origami_sim.fit.noise import numbered
from origami_sim.fit.weights import Rows
from origami_sim.hypotheses.hypothesis import Hypothesis, Subject, Suspect
from origami_sim.model import Model, Parameters
from origami_sim.model.articulation import Articulation, Pose
from origami_sim.recording import Recording


@dataclass(frozen=True, eq=False)
class Block:
    """A segment of a recording that is predicted from a start of its own.

    Attributes:
        recording: index of the recording. first: index of its first frame. times: (n,) since that frame [s].
        values: (n, D) all components of all channels [SI]; nan where missing.
        noise: (D,) their standard deviations.
        pose, rates: the start about which `local` numbers shift: coordinates, and their rates.
        known: (L,) standard deviations of the start about it; empty where it is not fitted.
        reach: (L,) gaps to the next segment are measured by these; None where that is not tied to this one.
        lasting: time until the next segment begins, if the motion goes on from this one to it [s].
        begin: (D,) what was measured at the first frame, which tells the turn of angles.
        shows: [D, m] derivatives of the channels by the coordinates at the start; None where that is not fitted.
        repeats: [n, D] which values are missing as they repeat one that is there, see `without_repeats`; None: none.
    """

    recording: int
    first: int
    times: np.ndarray
    values: np.ndarray
    noise: np.ndarray
    pose: Pose
    rates: np.ndarray
    known: np.ndarray
    reach: np.ndarray | None = None
    lasting: float = 0.0
    begin: np.ndarray | None = None
    shows: np.ndarray | None = None
    repeats: np.ndarray | None = None

    def rows(self, before: bool, after: bool) -> Rows:
        """How many rows of a least-squares problem it has, tied or not to the segments before and after it."""
        if (before, after) not in self._rows:
            size = len(self.known)
            made = Rows(self.values.size, 0 if before else size, size if after else 0, self.seen(), self.frames)
            self._rows[before, after] = made
        return self._rows[before, after]

    @cached_property
    def _rows(self) -> dict[tuple[bool, bool], Rows]:
        """Those that were asked for: segments that are weighed alike are told by them, again and again."""
        return {}

    @cached_property
    def frames(self) -> np.ndarray:
        """(n,) numbers of the frames: neighbours differ by one, or more where some are missing."""
        steps = np.diff(self.times)
        return numbered(self.times, float(np.median(steps))) if len(steps) else np.zeros(1, np.int64)

    @cached_property
    def digest(self) -> bytes:
        """Of all that predictions of it depend on."""
        parts = (self.times, self.values[:1], self.rates, self.pose.rotation, self.pose.centre, self.pose.angles)
        told = repr((self.recording, self.first, self.lasting)).encode()
        return sha256(told + b"".join(np.ascontiguousarray(p).tobytes() for p in parts)).digest()

    def seen(self) -> np.ndarray:
        """[n, D] which values were measured."""
        return np.isfinite(self.values)

    def without(self, frames: np.ndarray) -> "Block":
        """The same, of which some frames (n,) are not compared."""
        repeats = None if self.repeats is None else np.where(frames[:, None], False, self.repeats)
        return replace(self, values=np.where(frames[:, None], np.nan, self.values), repeats=repeats)

    def counted(self) -> np.ndarray:
        """[n, D] which values were measured, with those that repeat one."""
        return self.seen() if self.repeats is None else self.seen() | self.repeats


@dataclass(frozen=True, eq=False)
class Prediction:
    """Of K worlds, per block: values [K, n, D] of all components, and ends [K, L] of those that the next is tied to.

    An end is where the motion arrives at the next block's first frame, as a shift from that block's own start.
    """

    values: list[np.ndarray]
    ends: list[np.ndarray | None]


class Predictor(Protocol):
    """Predicts recordings of one object under hypotheses; whoever asks does not know by which kind of simulation.

    Attributes:
        subject: how the model is built. recordings: of one object. drives: of each of them.
        model, parameters, drive: as given.
        articulation: coordinates of rigid panels. components: names of the D components.
        blocks: the segments. local: L, numbers of each segment's start (coordinates, then rates); 0 if none is fitted.
        start: "fit" or "rest". panels: "elastic", "rigid" or "" (of curves). separate: whether a segment is predicted
            without those before it.
        nudge: steps of derivatives, as a part of changes that are noticeable. blur: error of the solver's own [rad, m].
        curve: whether these are load steps or slow loads, each of which has an equilibrium.
        prescribed: whether the motion is.
        abrupt: whether segments are short, as what is missing acts within a few frames.
    """

    subject: Subject
    recordings: list[Recording]
    drives: list[Drive]
    model: Model
    parameters: Parameters
    drive: Drive
    articulation: Articulation
    components: list[str]
    blocks: list[Block]
    local: int
    start: str
    panels: str
    separate: bool
    nudge: float
    blur: float
    curve: bool
    prescribed: bool
    abrupt: bool
    threads: int | None

    def shoot(
        self,
        hypothesis: Hypothesis | Sequence[Hypothesis],
        theta: Sequence[np.ndarray] | np.ndarray,
        local: np.ndarray | None = None,
        blocks: Sequence[int] | None = None,
    ) -> Prediction:
        """Predicts blocks from their starts.

        Args:
            hypothesis: one for all K worlds, or one for each.
            theta: K times the nominals, then the hypothesis' numbers [SI].
            local: [K, B, L] shifts of the starts, for all blocks. blocks: which to predict (default all).

        A world that goes unstable, or of whose numbers no model can be built, gives nan.
        """
        ...

    def predict(
        self,
        hypothesis: Hypothesis | Sequence[Hypothesis],
        theta: Sequence[np.ndarray] | np.ndarray,
        local: np.ndarray | None = None,
        blocks: Sequence[int] | None = None,
    ) -> list[np.ndarray]:
        """The values of `shoot`: per block [K, n, D]."""
        ...

    def abruptly(self) -> "Predictor | None":
        """The same with segments as short as tells a start (`abrupt`); None where they are not tied."""
        ...

    def step(self, hypothesis: Hypothesis, theta: np.ndarray) -> float:
        """The solver's step for one world [s]; 0 if no model can be built."""
        ...

    def admitted(self, every: Sequence[Suspect]) -> list[Suspect]:
        """The suspects that these recordings can be asked about."""
        ...

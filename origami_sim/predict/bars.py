"""Rollouts of bars: of devices whose panels bend, from rest or from free starts."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from origami_sim.errors import InputError
from origami_sim.fit.predictor import Block
from origami_sim.hypotheses.hypothesis import Hypothesis, Subject
from origami_sim.model import Model, Parameters, State
from origami_sim.observation.channels import stacked
from origami_sim.predict.filming import film
from origami_sim.predict.rollouts import Rollouts
from origami_sim.predict.shots import Shots, Simulated
from origami_sim.recording import Recording
from origami_sim.solve.timestep import gradient_norms, stable_step

CALM = 0.04
"""Time at the start of a segment in which panels are damped [s].

A segment starts with flat panels, because markers do not show how they bend. Real panels bend under their load; without
the damping they would begin to ring. What is measured in that time is not compared.
"""

RATIO = 0.3
"""Damping of panels in that time, as a ratio of critical for each bar and bending line."""

CALMING = {"bar_viscosity": "bars", "panel_viscosity": "panel_bending"}
"""What calms panels, by what keeps them in shape."""


class BarRollouts(Rollouts):
    """A `Predictor` of devices whose panels bend.

    Args:
        segment: length of a segment [s]; None: each recording is one segment. most: at most so many segments of each
            recording, evenly spread, for a quick look; None: all. The rest as for `Rollouts`.
    """

    panels = "elastic"

    def __init__(
        self,
        subject: Subject,
        recordings: Sequence[Recording],
        *,
        segment: float | None = None,
        start: str = "fit",
        most: int | None = None,
        threads: int | None = None,
    ):
        super().__init__(subject, recordings, start=start, threads=threads)
        settles = start == "fit" and len(self.articulation.creases) > 0
        self.calm = CALM if settles else 0.0
        for index, recording in enumerate(self.recordings):
            self.blocks += self._segments(index, recording, segment, most)

    def _program(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys([*super()._program(), *CALMING]))

    def _segments(self, index: int, recording: Recording, segment: float | None, most: int | None) -> list[Block]:
        values, noise = stacked(recording)
        step = float(np.median(np.diff(recording.times)))
        frames = len(recording.times) if segment is None else max(8, round(segment / step) + 1)
        calm = self._calm_frames(recording, frames)
        firsts = np.arange(0, max(1, len(recording.times) - frames + 1), max(1, frames - 1 - calm))
        if most is not None and len(firsts) > most:
            firsts = firsts[np.round(np.linspace(0, len(firsts) - 1, most)).astype(int)]
        if self.start == "fit":
            told = [self.readings.tells(recording, values, noise, int(first)) for first in firsts]
            firsts = firsts[told] if any(told) else firsts
        return [self.segment(index, int(first), frames) for first in firsts]

    def _calm_frames(self, recording: Recording, frames: int) -> int:
        step = float(np.median(np.diff(recording.times)))
        return min(int(np.ceil(self.calm / step)), frames // 4)

    def segment(self, index: int, first: int, frames: int) -> Block:
        block = super().segment(index, first, frames)
        return block.without(np.arange(len(block.times)) < self._calm_frames(self.recordings[index], frames))

    def _cuts(self, worlds: int, count: int) -> list[slice]:
        """Of a recording that is one segment, or a few, parts of the worlds, so that all cores have some."""
        if self.calm:
            return super()._cuts(worlds, count)
        ends = np.linspace(0, worlds, min(worlds, count) + 1).round().astype(int)
        return [slice(a, b) for a, b in pairwise(ends.tolist())]

    def _pace(self, worlds) -> float | None:
        return stable_step(worlds[0][0], Parameters.join([p for _, p in worlds])).dt

    def step(self, hypothesis: Hypothesis, theta: np.ndarray) -> float:
        """The solver's step for one world, a frame at most [s]; 0 if no model can be built."""
        frame = float(np.median(np.diff(self.recordings[0].times)))
        try:
            world = self.world(hypothesis, theta, hypothesis.effects)
        except InputError:
            return 0.0
        return min(frame, stable_step(*world).dt)

    def _filmed(self, shots: Shots) -> Simulated:
        recording, model = self.recordings[shots.recording], shots.model or shots.worlds[0][0]
        parameters = Parameters.join([p for _, p in shots.worlds], repeat=len(shots.blocks))
        drive, state, step = self.driven(shots), self.state(shots), shots.step
        pace = shots.pace or stable_step(model, parameters).dt
        substeps = max(1, int(np.ceil(step / pace * (1 - 1e-12))))
        raw: list[np.ndarray] = []
        models = [m for m, _ in shots.worlds]
        calm = min(self._calm_frames(recording, len(shots.blocks[0].times)), shots.frames - 1)
        if calm:
            quiet, damped = calmed(model, parameters)
            finer = max(substeps, int(np.ceil(step / stable_step(quiet, damped).dt * (1 - 1e-12))))
            batch = self.batch(quiet, damped, drive, _with_effects(state, quiet), threads=shots.threads)
            raw += film(batch, recording, calm + 1, finer, step, models)
            state = _with_effects(batch.state(), model, step=calm * substeps)
        batch = self.batch(model, parameters, drive, state, threads=shots.threads)
        begin = state.x.copy() if self.start == "rest" else None
        left = shots.frames - sum(map(len, raw))
        raw += film(batch, recording, left, substeps, step, models, first=not calm, begin=begin)
        out = np.concatenate(raw)
        out[:, :, batch.status() >= 0] = np.nan
        return Simulated(out)


def calmed(model: Model, parameters: Parameters) -> tuple[Model, Parameters]:
    """The same model with damped panels; folding is not damped."""
    added = [e for e, of in CALMING.items() if of in model.effects]
    quiet = model.with_effects(*added)
    out = parameters.for_model(quiet)
    with np.errstate(divide="ignore"):
        mass = parameters["inertia", "mass"]
        mobility = np.divide(
            1.0, mass, out=np.zeros_like(mass), where=np.any(model.free, axis=1)[:, None]
        )  # of held: 0
        if "bars" in model.effects:
            lighter = 1.0 / np.maximum(mobility[model.bars].sum(axis=1), 1e-300)
            dashpot = 2 * RATIO * np.sqrt(parameters["bars", "stiffness"] * np.minimum(lighter, 1e300))
            out.set("bar_viscosity", "viscosity", out["bar_viscosity", "viscosity"] + dashpot)
        if "panel_bending" in model.effects:
            nodes, slopes = gradient_norms(model, "bend")
            inertia = 1.0 / np.maximum((mobility[nodes] * slopes[:, :, None] ** 2).sum(axis=1), 1e-300)
            dashpot = 2 * RATIO * np.sqrt(parameters["panel_bending", "stiffness"] * np.minimum(inertia, 1e300))
            out.set("panel_viscosity", "viscosity", out["panel_viscosity", "viscosity"] + dashpot)
    return quiet, out


def _with_effects(state: State, model: Model, step: int | None = None) -> State:
    """A state for a model whose further effects have no memory; work is counted anew."""
    count = len(model.laws) + bool(len(model.grips))
    return replace(
        state.copy(),
        work=np.zeros((count, state.worlds)),
        power=np.zeros((count, state.worlds)),
        step=state.step if step is None else step,
    )

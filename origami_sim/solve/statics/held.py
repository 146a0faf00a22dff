"""Worlds of which the nodes are led from one place to another, and what the laws give there."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from origami_sim.drive import Drive
from origami_sim.effects import get
from origami_sim.model import Model, Parameters, State
from origami_sim.solve.batch import Batch, Evaluation

FOREVER = 1e12
"""Length of a step after which everything has relaxed [s]: a million times the longest time constant admitted.

Within it everything moves so slowly that laws of the rate are silent.
"""

FRICTION = ("tangent", "rub")
"""Families of dry friction, on the ground and between panels: their memory asks for the slip and not for the time."""


class Held:
    """Worlds of which the nodes are led, and what the laws then give.

    Args:
        drive: one level of every channel for each world, see `levels`. The rest as for `Batch`.

    Attributes:
        remembers: whether any law has memory. friction: [M] rows of the memory that are dry friction's.
    """

    def __init__(
        self,
        model: Model,
        parameters: Parameters,
        drive: Drive,
        state: State,
        *,
        among: Sequence[str] = (),
        threads: int | None = None,
    ):
        still = replace(model, free=np.zeros_like(model.free))
        self.batch = Batch(still, parameters, drive, state, among=among, threads=threads, supports=model)
        self.remembers = any(get(e).memory for e in model.laws)
        kinds = [get(e).family in FRICTION for e, *_ in model.memories]
        self.friction = np.repeat(np.array(kinds, bool), [n for *_, n in model.memories])

    def force(
        self, start: State, x: np.ndarray, dt: float, time: float, velocity: np.ndarray | None = None
    ) -> np.ndarray:
        """Forces [N, W, 3] at positions x [N, W, 3], reached from a state within dt [s], at a time [s].

        They are those at rest, or at a velocity [N, W, 3].
        """
        b = self.batch
        self._lead(start, x, dt, velocity is not None)
        b._overwrite(b._v, np.zeros_like(x) if velocity is None else velocity)
        return b.total_force(time)

    def after(self, start: State, x: np.ndarray, dt: float, time: float, moving: bool = False) -> State:
        """The state at positions x [N, W, 3], reached from another within dt [s], at a time [s]."""
        self._lead(start, x, dt, moving)
        if not self.remembers:
            self.batch.total_force(time)  # which also goes on with the angles
        return self.batch.state()

    def _lead(self, start: State, x: np.ndarray, dt: float, moving: bool):
        """Leads the nodes to positions x [N, W, 3]; dry friction follows the slip, however short the step.

        Unless the device moves at the end as well, dashpots of the ground must not share in what friction remembers:
        the load that they add in a short step would tear feet off the ground, or press them against it.
        """
        b = self.batch
        if not self.remembers:
            b.place(x, start.angles)
            return
        quiet = not moving and bool(np.any(self.friction))
        if not (quiet and np.all(self.friction)):
            b.place(start.x, start.angles, start.memory)
            b.lead(x, dt)
        if quiet:
            kept = b.remembered().copy()
            b.place(start.x, start.angles, start.memory)
            b.lead(x, FOREVER)
            if not np.all(self.friction):
                b._overwrite(b._memory, np.where(self.friction[:, None], b.remembered(), kept))

    def at(self, state: State, time: float, velocity: np.ndarray | None = None) -> Evaluation:
        """Forces and energies by effect in a state, at rest or at a velocity [N, W, 3]."""
        b = self.batch
        b.place(state.x, state.angles, state.memory)
        b._overwrite(b._v, np.zeros_like(state.x) if velocity is None else velocity)
        return b.evaluate(time)

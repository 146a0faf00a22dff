"""Whether panels come near each other in a run without contact, of which nothing was stated.

Contact costs two to ten times the run, whether or not anything touches. So a run whose panels may touch by default
goes without it, and between frames it is looked whether any two parts of the surface come as near as they would touch.
If they do, the run is made again with contact from its start, and says so; else contact would have changed nothing.

Between frames nodes are taken to go along the cubic through their positions and velocities, in pieces so short that the
list of near pairs holds, and on each piece straight on, where `touching.free_share` tells how far pairs come.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import warp as wp

from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, State, carried_sides, check_state
from origami_sim.model.contact import FRICTION, engaged, may_touch
from origami_sim.pattern.intersections import crossing_pairs
from origami_sim.solve.kernels.approach import approach
from origami_sim.solve.program.compose_touch import DEEPEST
from origami_sim.solve.skin import near_pairs, surface, upload

if TYPE_CHECKING:
    from origami_sim.solve.statics.system import Equilibrium

PIECES = 64
"""Pieces of the way between two frames at most. What moves farther is looked at within a larger distance, which makes
longer lists. Half and double change the time that fast motions take, by a few per cent of the run."""

TOGETHER = 1e-9
"""Distance over the device's size at which parts lie together in the reference state: panels that were parted to turn
about their faces. Half and double are rounding as well."""

FRAMES = 8
"""Ways between frames that are looked at together. Half costs small devices 1.03 times the run, double lets a run that
is made again go on for 16 frames more."""

STATED = "Sheet.touch states it, and touch(False) that panels pass through each other"
"""How contact that nobody stated is stated, in words."""

AGAIN = 8
"""So many times as many pieces are taken where lists found no room. Half and double: see `PIECES`."""


class Met(Exception):
    """Panels came near each other in a run without contact.

    Attributes:
        where: which panels, and when. sentence: that, and what follows from it.
    """

    def __init__(self, where: str):
        super().__init__(where)
        self.where, self.sentence = where, f"{where}: {_acting()}"


class Watch:
    """Looks at a run of a batch of worlds, from frame to frame.

    Args:
        model, parameters: without contact, which `may_touch`. worlds: of the run. device: where it is looked.
        when: says in words where in the run a time is.
    """

    def __init__(
        self,
        model: Model,
        parameters: Parameters,
        worlds: int,
        device: str = "cpu",
        when: Callable[[float], str] = "at t = {:.4g} s".format,
    ):
        self.model, self.parameters, self.worlds, self.device, self.when = model, parameters, worlds, device, when
        self._skin = upload(model, self._room, device)
        self._base = surface(model).margin
        self._size = float(np.ptp(model.position, axis=0).max())
        self._pads = 2.0 if len(model.pad_triangles) else 1.0  # corners of patches move up to so much farther
        thick = parameters["surface", "thickness"]
        self._by_world = int(thick.shape[1] > 1)
        self._stride = thick.shape[1]
        self._thick = wp.array(np.ascontiguousarray(thick).ravel(), dtype=wp.float64, device=device)
        n = max(len(model.position), 1)
        self._between = [self._room(n, dtype=wp.vec3d) for _ in range(2)]
        self._met = wp.zeros(worlds, dtype=wp.float64, device=device)
        self._sides = self._room(2, dtype=wp.int32)
        self._frames: list[tuple[float, np.ndarray, np.ndarray]] = []

    def _room(self, *shape: int, dtype) -> wp.array:
        return wp.zeros((*shape, self.worlds), dtype=dtype, device=self.device)

    def begin(self, x: np.ndarray, deepest: float) -> str:
        """Why there can be no contact in a run from positions x [N, W, 3], in a sentence; empty if there can.

        Args:
            deepest: share of the distance at which they touch by which panels may be pressed together at the start.
        """
        for w in range(self.worlds):
            named = panels_inside(self.model, self.parameters, x[:, w], w, deepest)
            if named is not None:
                return (
                    f"{named} lie in each other at the start, so that panels pass through each other in this "
                    "run; Sheet.touch(thickness=...) states a thickness with which they do not."
                )
        return ""

    def add(self, time: float, x: np.ndarray, v: np.ndarray) -> None:
        """Adds a frame: its time [s], positions and velocities [N, W, 3] [m], [m/s]; several are looked at together.

        Raises:
            Met: two panels came as near as they touch.
        """
        self._frames.append((time, x, v))
        if len(self._frames) > FRAMES:
            self.look()

    def look(self) -> None:
        """Looks at the way that the frames added since have taken.

        Raises:
            Met: two panels came as near as they touch.
        """
        if len(self._frames) < 2:
            return
        times, x, v = (np.array(a) for a in zip(*self._frames, strict=True))
        self._frames = self._frames[-1:]
        length = np.diff(times)
        with np.errstate(invalid="ignore"):
            way = np.linalg.norm(np.diff(x, axis=0), axis=-1).max(axis=(1, 2))
            speed = np.linalg.norm(v, axis=-1).max(axis=(1, 2))
            reach = self._pads * np.fmax(way, length * np.fmax(speed[1:], speed[:-1]))
            reach = np.where(np.isfinite(reach), reach, 0.0)  # of worlds that failed
        for more in (1, AGAIN):
            pieces = more * np.clip(np.ceil(4.0 * reach / self._base), 1, PIECES).astype(np.int32)
            self._skin.margin = max(self._base, 4.0 * float((reach / pieces).max())) if more == 1 else self._base
            films = [wp.array(a, dtype=wp.vec3d, device=self.device) for a in (x, v)]
            rows = [wp.array(a, dtype=t, device=self.device) for a, t in ((times, wp.float64), (pieces, wp.int32))]
            finest = wp.float64(TOGETHER * self._size)
            how = [self._thick, self._by_world, self._stride, finest, *self._between, self._met, self._sides]
            wp.launch(approach, dim=self.worlds, inputs=[self._skin, *films, *rows, *how], device=self.device)
            met, sides = self._met.numpy(), self._sides.numpy()
            w = int(met.argmin())
            if not np.isfinite(met[w]):
                return
            if sides[0, w] >= 0:
                break
        where = self.when(float(met[w])) + (f" in world {w}" if self.worlds > 1 else "")
        if sides[0, w] < 0:
            raise Met(f"Panels come so near each other that pairs cannot be listed {where}")
        raise Met(f"{_names(self.model, sides[:, w])} meet {where}")


def panels_inside(model: Model, parameters: Parameters, x: np.ndarray, world: int, deepest: float = 0.0) -> str | None:
    """Names of two panels that lie in each other at positions x [N, 3], None if none do.

    Args:
        deepest: share of the distance at which they touch by which they may be pressed together.
    """
    if not np.all(np.isfinite(x)):
        return None
    beside = {tuple(sorted(p)) for p in carried_sides(model).tolist()}  # by how much a stop gives, they cross
    for pair in crossing_pairs(x, model.triangles, 0.0):
        if tuple(sorted(model.triangle_panel[pair].tolist())) not in beside:
            return _names(model, pair)
    found = near_pairs(model, parameters, x, world=world, owner="surface")
    deep = found.offset * (1 - deepest) * (1 - 1e-6) - found.distance
    return _names(model, found.sides[int(deep.argmax())]) if len(deep) and deep.max() > 0 else None


def met_at(model: Model, parameters: Parameters, found: "Equilibrium", world: int) -> str:
    """Which panels lie in each other in an equilibrium, or have passed, in a sentence; empty if none do.

    Panels beside a crease that is folded by more than half a turn have passed through each other.
    """
    past = np.abs(found.angles[: len(model.creases)]) > np.pi
    if np.any(past):
        return f"{model.name('crease', int(past.argmax()))} would fold by more than half a turn: {_acting()}"
    named = panels_inside(model, parameters, found.x, world)
    return "" if named is None else f"{named} would lie in each other: {_acting()}"


def _names(model: Model, sides: np.ndarray) -> str:
    return " and ".join(model.name("panel", int(p)) for p in sorted(model.triangle_panel[sides].tolist()))


def _acting() -> str:
    return f"contact between panels acts in this run, with a friction of {FRICTION:g} ({STATED})."


def watch_of(
    model: Model, parameters: Parameters, start: State, *, reference: bool, **how
) -> tuple[Watch | None, list[str]]:
    """The watch of a run from a state, None where there is nothing to watch; and what is to be said of it.

    Args:
        reference: whether the state is the reference state, in which what is stated to touch may not be pressed.
        how: of `Watch`: device, when.
    """
    if not may_touch(model, parameters) or len(model.triangles) < 2:
        return None, []
    watch = Watch(model, parameters, start.worlds, **how)
    said = watch.begin(start.x, 0.0 if reference else DEEPEST)
    return (None, [said]) if said else (watch, [])


def continued(model: Model, parameters: Parameters, state: State | None) -> tuple[Model, Parameters]:
    """The model and parameters that a state is of: with contact, if it is the end of a run in which that acted.

    Raises:
        InputError: a state of another model, or what is none.
    """
    if state is not None:
        check_state(model, state)
    if state is None or not may_touch(model, parameters):
        return model, parameters
    rows = sum(size for *_, size in model.memories)
    if len(state.memory) == rows:
        return model, parameters
    other, own = engaged(model, parameters)
    if len(state.memory) != sum(size for *_, size in other.memories):
        raise InputError("the state is of another model", field="state.memory", value=len(state.memory), allowed=rows)
    return other, own


def with_memory(model: Model, state: State) -> State:
    """A state of the model without contact as one of the model with it."""
    out = State.at_rest(model, state.worlds, position=state.x, placed=True)
    out.v, out.a, out.angles = state.v.copy(), state.a.copy(), state.angles.copy()
    out.memory[: len(state.memory)] = state.memory  # contact comes last
    own = bool(len(model.grips))  # whose row comes last
    for name in ("work", "power"):
        given, rows = getattr(state, name), getattr(out, name)
        rows[: len(given) - own] = given[: len(given) - own]
        if own:
            rows[-1] = given[-1]
    out.status, out.step = state.status.copy(), state.step
    return out


def without_memory(model: Model, state: State) -> State:
    """A state of the model with contact as one of the model without it."""
    out = state.copy()
    rows = sum(size for *_, size in model.memories)
    out.memory, own = state.memory[:rows], [*range(len(model.laws)), *([-1] if len(model.grips) else [])]
    out.work, out.power = state.work[own], state.power[own]
    return out

"""Gradients of what a device does by the numbers of its design.

Equilibria by the implicit function theorem: with the tangent K of the statics, K dy/dp = dF/dp on the free axes; held
nodes go where the design puts them. Of rigid panels y are fold angles and the pose of the root, and closed loops stay
closed. Motions by forward sensitivities: worlds at p + s h, s = 1, -1, 2, -2, of one batch
with one time step, so that what is differentiated is one discrete motion.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from origami_sim.device.device import lasting
from origami_sim.errors import InputError
from origami_sim.explore.found import Build, Device, Found, Measure, Way, at, found
from origami_sim.model import State
from origami_sim.model.distort import distorted
from origami_sim.solve.batch import Batch
from origami_sim.solve.grips import held_at, levels_at
from origami_sim.solve.rigid.sensitivity import followed
from origami_sim.solve.statics.equilibria import tangent
from origami_sim.solve.statics.system import NULL_SHIFT, STENCIL, WEIGHTS
from origami_sim.solve.timestep import stable_step

STEP = 1e-3
"""Step of the differences by a design's number, over its scale.

Of fourth order: truncation is STEP^4 and rounding eps / STEP, both near 1e-12. Half and double are as good; of motions
with impacts and stick the error says how good they are.
"""

REFINED = 2
"""Refinements of a solution with the shifted tangent, of which the shift spoils soft modes.

Without any the gradient of a paper tube's stiffness is 2e-7 off, with one 3e-9; double changes nothing more.
"""


@dataclass
class Gradient:
    """Measures at a point and their derivatives.

    Attributes:
        value: [M] of the measures. slope: [M, P] by the unknowns, in their order [unit of the measure over SI].
        error: [M, P] estimate of the slopes' error: what differences of second order say otherwise, which bounds it
            from above where the measure is smooth; nan for equilibria.
        found: the device there.
    """

    value: np.ndarray
    slope: np.ndarray
    error: np.ndarray
    found: Found = field(repr=False)


def gradient(
    build: Build,
    measures: Measure | Sequence[Measure],
    point: Mapping[str, float],
    *,
    scales: Mapping[str, float] | None = None,
    fixed: Mapping[str, object] | None = None,
    way: Way | None = None,
) -> Gradient:
    """Derivatives of measures by the numbers of a design.

    Args:
        point: where, and by which numbers [SI]. fixed: further arguments of `build`.
        scales: sizes over which the numbers matter, such as the width of their bounds (default: their own size).

    Raises:
        InputError: the device is not found there, a number that is zero and has no scale, devices whose topology
            changes, loops of rigid panels that open as the design changes.
    """
    how, every = way or Way(), [measures] if callable(measures) else list(measures)
    names = list(point)
    size = {n: abs((scales or {}).get(n, point[n])) for n in names}
    for n in names:
        if not size[n] > 0:
            raise InputError("a number at zero needs a scale for its gradient", field=n, allowed="scales={name: size}")
    step = {n: STEP * size[n] for n in names}
    moved = [{**point, n: point[n] + s * step[n]} for n in names for s in STENCIL]
    devices = [at(build, {**(fixed or {}), **p}) for p in [point, *moved]]
    if len({(len(d.model.position), d.model.creases.tobytes(), d.model.triangles.tobytes()) for d in devices}) > 1:
        raise InputError("the design's topology changes with a number", field=", ".join(names))
    near = _moving(devices, how) if how.duration is not None else _at_rest(devices, how, len(names), step)
    value = np.array([float(m(near[0])) for m in every])
    around = np.array([[float(m(f)) for f in near[1:]] for m in every]).reshape(len(every), len(names), len(STENCIL))
    width = np.array([step[n] for n in names])
    slope = around @ WEIGHTS / width
    plain = (around[..., 0] - around[..., 1]) / (2 * width)
    error = np.abs(plain - slope) if how.duration is not None else np.full_like(slope, np.nan)
    return Gradient(value, slope, error, near[0])


def _moving(devices: list[Device], way: Way) -> list[Found]:
    """All worlds, with the time step of the stiffest."""
    steps = [stable_step(d.model, d.parameters).dt for d in devices]
    dt = way.dt if way.dt is not None or not np.isfinite(min(steps)) else 0.99 * min(steps)
    out = found(devices, replace(way, dt=dt))
    bad = next((f.failure for f in out if f.failure), None)
    if bad:
        raise InputError(f"there is no gradient of a motion that fails: {bad}", field="point")
    return out


def _at_rest(devices: list[Device], way: Way, unknowns: int, step: Mapping[str, float]) -> list[Found]:
    """The equilibrium, and to first order where it goes as the design changes."""
    first = devices[0]
    rest = found([first], way)[0]
    if rest.failure or rest.equilibrium is None:
        raise InputError(f"there is no gradient without an equilibrium: {rest.failure}", field="point")
    if rest.equilibrium.touching:
        return _at_rest([d.touching() for d in devices], way, unknowns, step)
    state = rest.equilibrium.state
    time = lasting(first.drive) if way.time is None else way.time
    if first.model.panels == "rigid":
        designs = [(d.model, d.parameters, d.drive) for d in devices]
        there = followed(designs, state, time, STENCIL, WEIGHTS)
        moved = [Found(*d, x, angles, time=time) for d, (x, angles) in zip(designs[1:], there, strict=True)]
        return [rest, *moved]
    free = np.flatnonzero(first.model.free.ravel())
    k = sp.csc_array(tangent(first.model, first.parameters, first.drive, time=time, state=state))[free][:, free]
    stiffest = float(np.abs(k.diagonal()).max())
    solve = spla.splu(sp.csc_matrix(k + NULL_SHIFT * stiffest * sp.eye_array(len(free))))
    out = [rest]
    for u, h in zip(range(unknowns), step.values(), strict=True):
        near = devices[1 + u * len(STENCIL) :][: len(STENCIL)]
        pushed = []
        for d in near:  # forces with free nodes where they were and held ones where the design has them
            start = State.at_rest(d.model, position=_supported(first, d, rest.x, time))
            start.angles, start.memory = state.angles.copy(), state.memory.copy()
            batch = Batch(d.model, d.parameters, distorted(d.model, d.parameters, d.drive, time), start, threads=1)
            pushed.append(batch.total_force(time)[:, 0].ravel()[free])
        push = WEIGHTS @ np.array(pushed) / h
        towards = solve.solve(push)
        for _ in range(REFINED):
            towards += solve.solve(push - k @ towards)
        for s, d in zip(STENCIL, near, strict=True):
            move = np.zeros(rest.x.size)
            move[free] = s * h * towards
            x = _supported(first, d, rest.x, time) + move.reshape(-1, 3)
            there = State.at_rest(d.model, position=x)
            turned = there.angles[:, 0] + 2 * np.pi * np.round((rest.angles - there.angles[:, 0]) / (2 * np.pi))
            out.append(Found(d.model, d.parameters, d.drive, x, turned, time=time))
    return out


def _supported(first: Device, near: Device, x: np.ndarray, time: float) -> np.ndarray:
    """Positions x [N, 3] of the first device, with held nodes where another one's supports and grips have them."""
    x = x + (1 - first.model.free) * (near.model.position - first.model.position)
    return held_at(near.model, x[:, None], levels_at(near.model, near.drive, time, 1))[:, 0]

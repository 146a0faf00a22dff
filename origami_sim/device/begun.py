"""Where a recorded motion begins, as a state of the model that is simulated beside it, and which frames it has."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, State
from origami_sim.model.articulation import Articulation, Pose
from origami_sim.recording import Recording
from origami_sim.solve.grips import carried_along, levels_at, moving, nearest_levels
from origami_sim.solve.motion.dynamics import Trajectory
from origami_sim.solve.statics.equilibria import equilibrium

CLEAR = 3.0
"""Standard deviations of the noise from which the first frame shows another pose than the reference state."""

GEOMETRIC = ("crease_angle", "panel_angle", "marker", "marker_2d")
"""Kinds of channels that show where a device is."""

MATCHED = (16, 32, 64, 128)
"""Numbers of first frames over which a start is matched: the last are as many as a rate is read from.

With twice as many a start is not known better than it has to be; a quarter leaves it to noise.
"""

ROUNDS = 2
"""Gauss-Newton steps over each of them: the numbers before bring the start near."""

NUDGE = 1e-5
"""Change of a start [rad, m, rad/s, m/s] over which its effect is taken: far above rounding, far below what bends."""

Roll = Callable[[State, Recording], Trajectory]
"""Simulates worlds that begin in a state, for as long as a recording lasts."""


def filmed(recording: Recording) -> tuple[float, float]:
    """Seconds and frames per second of a simulation that is laid over a recording.

    Its frames lie on the recorded ones; a whole number a second does that even where a clock rounds its times.
    """
    times = recording.times - recording.times[0]
    own = 1.0 / float(np.median(np.diff(times)))

    def beside(rate: float) -> float:
        return round(float(np.abs(times - np.round(times * rate) / rate).mean()), 9)  # [s], to less than clocks tell

    rate = min((float(r) for r in (round(own), own) if r > 0), key=beside)
    return float(np.ceil(times[-1] * rate - 1e-6)) / rate, rate


def begun(
    model: Model, parameters: Parameters, drive: Drive, recording: Recording, roll: Roll | None = None
) -> State | None:
    """The state in which a recording begins; None where the model starts as it does by itself.

    What is held is where the drive has its grips in the first frame.

    Where the sidecar states an equilibrium, it is that in the drive of the first frame, the nearest to what is seen.
    Else it is as `seen` tells; where it may be moving, nearer to it by `matched`.

    Args:
        roll: see `Roll`. None: what is read has to do.

    Raises:
        InputError: there is no such equilibrium.
    """
    found = _begun(model, parameters, drive, recording, roll)
    if not moving(model, drive):
        return found
    found = State.at_rest(model) if found is None else found
    levels = levels_at(model, drive, 0.0, found.worlds)
    found.x = carried_along(model, found.x, nearest_levels(model, found.x), levels)
    return found


def _begun(model: Model, parameters: Parameters, drive: Drive, recording: Recording, roll: Roll | None) -> State | None:
    """The same, with grips where they were in the reference state, unless an equilibrium is stated."""
    told, read = recording.start, seen(model, recording)
    state = None if read is None else state_of(model, *read)
    if told is None or told.state != "equilibrium":
        rolls = roll is not None and read is not None and (told is None or told.state == "moving")
        return matched(model, recording, *read, roll) if rolls else state  # type: ignore[misc]
    found = equilibrium(model, parameters, drive, state=state)
    if not found.converged:
        raise InputError(
            f"the model has no equilibrium in the drive of the first frame ({found.message.rstrip('.')})",
            file=recording.metadata.get("sidecar"),
            field="start",
            value="equilibrium",
            allowed="released, moving",
        )
    return found.state


def state_of(model: Model, pose: Pose, rates: np.ndarray) -> State:
    """Worlds at poses whose coordinates change at rates (m, W)."""
    arm = Articulation(model)
    x = arm.positions(pose)
    state = State.at_rest(model, x.shape[1], position=x)
    state.v[:] = np.einsum("mnwa,mw->nwa", arm.jacobian(pose, x), rates)
    return state


def matched(model: Model, recording: Recording, pose: Pose, rates: np.ndarray, roll: Roll) -> State:
    """The start near one that was read from which a simulation goes through the first frames.

    What is read from a few noisy frames at the end of a motion is known to some parts in ten, and a swing then parts
    from its recording within a tenth of its period. A simulation explains more of them than a polynomial does: its
    start is changed by Gauss-Newton steps, over as many frames as it still follows as a polynomial would.
    """
    from origami_sim.observation.channels import angle_mask, stacked
    from origami_sim.observation.observe import observe
    from origami_sim.observation.rates import BENT

    arm, m = Articulation(model), Articulation(model).size
    turning, best = angle_mask(recording), np.zeros(2 * m)
    steps = NUDGE * np.eye(2 * m, 2 * m + 1, 1)

    def state(z: np.ndarray) -> State:
        return state_of(model, arm.moved(pose.select([0] * z.shape[1]), z[:m]), rates + z[m:])

    for frames in MATCHED:
        part = recording.only(slice(0, frames))
        values, noise = stacked(part)
        z, left = best.copy(), np.inf
        for _ in range(ROUNDS):
            try:
                film = roll(state(z[:, None] + steps), part)
            except InputError:  # a start that is refused, such as one inside the ground: what was read stands
                break
            if film.failures:
                break
            each = [np.column_stack([*observe(film, part, world=w).values()]) for w in range(2 * m + 1)]
            tangent = np.stack([(e - each[0]) / NUDGE for e in each[1:]], axis=-1)
            gap = values - each[0]
            gap[:, turning] -= 2 * np.pi * np.round(gap[:, turning] / (2 * np.pi))
            good = np.isfinite(gap)
            weight = np.broadcast_to(1.0 / noise, gap.shape)[good]
            a, y = tangent[good] * weight[:, None], gap[good] * weight
            by = np.linalg.lstsq(a, y, rcond=1e-9)[0]
            left = np.sqrt(np.sum((y - a @ by) ** 2) / max(len(y) - 2 * m, 1))
            z = z + by
        if not left <= BENT:
            break
        best = z
    return state(best[:, None])


def seen(model: Model, recording: Recording) -> tuple[Pose, np.ndarray] | None:
    """The pose and the rates (m, 1) of its coordinates that the first frames show; None where a model starts by itself.

    That is where they show the reference state; for a device that nothing holds, unless it is stated to rest: on a
    ground, where it touches turns on less than is read; and for devices that close loops or start in a state of their
    own. The state is at the angles that the sidecar states, and at rest unless it is moving. What the channels do not
    tell is as in the reference state.
    """
    from origami_sim.observation.channels import stacked
    from origami_sim.predict.starts import CAREFUL, channel_tangent, read_start, seen_first

    arm, told = Articulation(model), recording.start
    stated = told.angles if told is not None else {}
    recording = replace(recording, channels={n: c for n, c in recording.channels.items() if c.kind in GEOMETRIC})
    if len(arm.open) or not arm.size or not (recording.channels or stated):
        return None
    if (arm.floating and (told is None or told.state != "equilibrium")) or not np.array_equal(
        model.begins, model.position
    ):
        return None
    pose, rate = arm.reference(), np.zeros(arm.size)
    if recording.channels:
        values, noise = stacked(recording)
        first = seen_first(values)
        away = np.abs(channel_tangent(model, arm, recording, pose, first)[0] - first)
        if told is None and np.all(away[np.isfinite(first)] <= CLEAR * noise[np.isfinite(first)]):
            return None
        found = read_start(model, arm, recording, values, noise, 0)
        pose = found.pose
        if told is None or told.state == "moving":
            rate = np.where(np.isfinite(found.error) & (np.abs(found.rates) > CAREFUL * found.error), found.rates, 0.0)
    by = np.zeros((arm.size, 1))
    for crease, angle in stated.items():
        joint = _joint(arm, int(crease) if crease.isdecimal() else crease)
        if joint is not None:
            by[joint] = angle - pose.angles[joint - arm.size + len(arm.creases)]
    return arm.moved(pose, by), rate[:, None]


def _joint(arm: Articulation, crease: object) -> int | None:
    """The coordinate of a crease that is given by number or name; None if the model has none."""
    names = arm.names()
    if isinstance(crease, int):
        found = np.flatnonzero(arm.creases == crease)
        return arm.size - len(arm.creases) + int(found[0]) if len(found) else None
    return names.index(crease) if isinstance(crease, str) and names.count(crease) == 1 else None

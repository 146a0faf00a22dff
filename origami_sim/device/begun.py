"""Where a recorded motion begins, as a state of the model that is simulated beside it, and which frames it has."""

import numpy as np

from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, State
from origami_sim.model.articulation import Articulation
from origami_sim.recording import Recording, initial_angles
from origami_sim.solve.statics.equilibria import equilibrium

CLEAR = 3.0
"""Standard deviations of the noise from which the first frame shows another pose than the reference state."""

MOVING = 2.0
"""Standard errors from which a rate of the first frames is one."""


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


def begun(model: Model, parameters: Parameters, drive: Drive, recording: Recording) -> State | None:
    """The state in which a recording begins; None where the model starts as it does by itself.

    Where the sidecar states an equilibrium, it is that in the drive of the first frame, the nearest to what is seen.
    Else it is as `seen` tells.

    Raises:
        InputError: there is no such equilibrium.
    """
    state = seen(model, recording)
    if recording.start is None or recording.start.state != "equilibrium":
        return state
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


def seen(model: Model, recording: Recording) -> State | None:
    """The state at the recorded fold angles and their rates; None where the model starts as it does by itself.

    That is where no fold angle is recorded or stated, or where the first frame shows the reference state; and for
    devices that nothing holds, that close loops or that start in a state of their own. Where the sidecar states the
    start, it is that: at the angles that it states, and at rest unless it is moving. Creases of which nothing is told
    are as in the reference state.
    """
    arm, told = Articulation(model), recording.start
    folds = {n: c for n, c in recording.channels.items() if c.kind == "crease_angle"}
    stated = told.angles if told is not None else {}
    if arm.floating or len(arm.open) or not (folds or stated) or not np.array_equal(model.begins, model.position):
        return None
    pose = arm.reference()
    joints = {n: j for n, c in folds.items() if (j := _joint(arm, c.attachment.get("crease"))) is not None}
    first = {n: folds[n].values[np.isfinite(folds[n].values)][0] for n in joints}
    if told is None and all(abs(first[n] - pose.angles[j, 0]) <= CLEAR * folds[n].noise for n, j in joints.items()):
        return None
    by, rate = np.zeros((2, arm.size, 1))
    found = initial_angles(recording, float(recording.times[0])) if folds else {}
    for name, joint in joints.items():
        by[joint] = found[name].angle - pose.angles[joint]
        if (told is None or told.state == "moving") and abs(found[name].rate) > MOVING * found[name].rate_error:
            rate[joint] = found[name].rate
    for crease, angle in stated.items():
        joint = _joint(arm, int(crease) if crease.isdecimal() else crease)
        if joint is not None:
            by[joint] = angle - pose.angles[joint]
    pose = arm.moved(pose, by)
    x = arm.positions(pose)
    state = State.at_rest(model, position=x)
    state.v[:] = np.einsum("mnwa,mw->nwa", arm.jacobian(pose, x), rate)
    return state


def _joint(arm: Articulation, crease: object) -> int | None:
    """The coordinate of a crease that is given by number or name; None if the model has none."""
    names = arm.names()
    if isinstance(crease, int):
        found = np.flatnonzero(arm.creases == crease)
        return int(found[0]) if len(found) else None
    return names.index(crease) if isinstance(crease, str) and names.count(crease) == 1 else None

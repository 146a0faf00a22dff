"""Where a recorded motion begins, as a state of the model that is simulated beside it."""

import numpy as np

from origami_sim.model import Model, State
from origami_sim.model.articulation import Articulation
from origami_sim.recording import Recording, initial_angles

CLEAR = 3.0
"""Standard deviations of the noise from which the first frame shows another pose than the reference state."""

MOVING = 2.0
"""Standard errors from which a rate of the first frames is one."""


def begun(model: Model, recording: Recording) -> State | None:
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

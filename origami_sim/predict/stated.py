"""Starts that an experimenter states: released at rest, at equilibrium, or already moving."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from origami_sim.errors import InputError
from origami_sim.fit.predictor import Block
from origami_sim.hypotheses.hypothesis import Hypothesis
from origami_sim.hypotheses.weight import weighed
from origami_sim.model import State
from origami_sim.model.articulation import Articulation
from origami_sim.observation.channels import channel_values, stacked
from origami_sim.observation.rates import WIDEST
from origami_sim.predict.starts import Reading, read_start
from origami_sim.predict.track import coordinates
from origami_sim.predict.worlds import World, Worlds
from origami_sim.solve.motion.dynamics import simulate
from origami_sim.solve.statics.equilibria import equilibrium

AT_REST = 1e-3
"""Standard deviation of rates of a device at rest, as a part of usual rates, where no other is stated.

What is left to itself moves by less than a thousandth of what follows; ten times as much frees the start again.
"""

RESTS = 0.01
"""Standard deviation of an equilibrium [rad] where none is stated: how well a device is left at rest."""

CONTRADICTED = 6.0
"""Standard deviations by which a reading may differ from what is stated before it is refused."""


def stated(forward: Worlds, block: Block, usual: np.ndarray, read: Reading, slowest: Callable[[], Reading]) -> Block:
    """The first block of a recording, with what is stated about its start.

    Args:
        usual: (m,) usual rates of the coordinates. read: the first frame. slowest: reads it as `Readings.slowest` does.

    Raises:
        InputError: a crease that does not exist; a start that the data contradict; no equilibrium.
    """
    recording = forward.recordings[block.recording]
    start = recording.start
    if start is None or start.state == "moving":
        return block
    slow = slowest()
    arm, m = forward.articulation, forward.articulation.size
    sidecar = recording.metadata.get("sidecar")
    pose, known = block.pose, block.known.copy()
    still, own, let_go = AT_REST * np.maximum(usual, 1e-9), np.zeros(m), np.zeros(m)
    world = forward.world(Hypothesis(), np.array([f.start for f in forward.subject.nominals]), ())
    if start.rate_sd is not None:
        still = np.full(m, start.rate_sd)
    elif start.state == "released":
        let_go = _in_a_frame(forward, block.recording, usual)
        own = np.maximum(let_go, _released(forward, block.recording, world, read))
    far = np.abs(slow.rates) > CONTRADICTED * np.hypot(still, slow.error) + own
    if np.any(far):
        worst = int(np.argmax(np.abs(slow.rates) * far))
        rate = f"{abs(slow.rates[worst]):.3g} {'m/s' if worst < arm.shifts else 'rad/s'}"
        raise InputError(
            f"the data contradict a start at rest: {arm.names()[worst]} moves at {rate}",
            file=sidecar,
            field="start",
            value=start.state,
            allowed="'moving', or the frames from the release on",
        )
    doubtful = np.abs(block.rates) > CONTRADICTED * np.hypot(still, read.error) + own  # what is longer may be bent
    known[m:] = np.where(doubtful, np.abs(block.rates), np.hypot(still, let_go))
    angles = pose.angles.copy()
    first = m - len(arm.creases)
    if start.state == "released":
        names = [forward.model.name("crease", int(c)) for c in arm.creases]
        for crease, value in start.angles.items():
            joint = names.index(crease) if crease in names else int(crease) if crease.isdigit() else -1
            if not 0 <= joint < len(names):
                raise InputError(
                    "the model has no such crease",
                    file=sidecar,
                    field=f"start.angles.{crease}",
                    allowed=", ".join(names),
                )
            assert start.sd is not None
            _agrees(angles[joint, 0], value, np.hypot(start.sd, read.shown[first + joint]), crease, sidecar)
            angles[joint], known[first + joint] = value, start.sd
    else:
        rest, doubt = equilibrium_of(forward, block.recording, world, angles[:, 0])
        sd = np.hypot(RESTS if start.sd is None else start.sd, doubt)
        for joint, value in enumerate(rest):
            name = forward.model.name("crease", int(arm.creases[joint]))
            _agrees(angles[joint, 0], value, np.hypot(sd[joint], read.shown[first + joint]), name, sidecar)
        angles[:, 0], known[first : first + len(rest)] = rest, sd
    return replace(block, pose=replace(pose, angles=angles), rates=np.zeros(m), known=known)


def _released(forward: Worlds, r: int, world: World, read: Reading) -> np.ndarray:
    """Rates (m,) that the model shows where it is released at rest, read as data are, with what it gains in a frame.

    The first frames already hold its motion; and at which instant within a frame a hand let go is not known.
    """
    recording, (values, noise) = forward.recordings[r], stacked(forward.recordings[r])
    model, parameters = weighed(*world, recording.gravity)
    state = State.at_rest(model, position=forward.articulation.positions(read.pose)[:, 0])
    times, step = recording.times - recording.times[0], float(np.median(np.diff(recording.times)))
    last = float(times[: 2 * WIDEST][-1])
    run = simulate(model, parameters, forward.drives[r], duration=last, rate=1.0 / step, state=state)
    own = channel_values(forward.model, recording, run.x, None)[:, :, 0]
    shown = np.stack([np.interp(times, run.times, c, right=np.nan) for c in own.T], axis=1)
    shown = np.where(np.isfinite(values), shown, np.nan)
    found = read_start(forward.model, forward.articulation, recording, shown, noise, 0, slowest=True)
    moved = np.linalg.lstsq(found.tangent / noise[:, None], (own[1] - own[0]) / noise, rcond=None)[0]
    return np.abs(found.rates) + 2.0 / step * np.abs(moved)


def _in_a_frame(forward: Worlds, r: int, usual: np.ndarray) -> np.ndarray:
    """Rates (m,) that a device usually gains in a frame: at which instant a hand let it go is not known better.

    With usual rates u and a spread q of a coordinate, accelerations are about u^2 / q.
    """
    found, times = coordinates(forward, r), forward.recordings[r].times
    if found is None:
        return np.zeros_like(usual)
    return usual**2 / np.maximum(found[0].std(axis=1), 1e-9) * float(np.median(np.diff(times)))


def _agrees(read: float, value: float, sd: float, crease: str, sidecar: object) -> None:
    if np.isfinite(sd) and abs(read - value) > CONTRADICTED * sd:
        raise InputError(
            f"the data contradict the stated start: {crease} is read as {read:.4g} rad",
            file=sidecar,  # type: ignore[arg-type]
            field=f"start.{crease}",
            value=f"{value:.4g} rad +- {sd:.2g} rad",
            allowed="what the first frame shows",
        )


def equilibrium_of(forward: Worlds, r: int, world: World, near: Sequence[float] | np.ndarray):
    """Fold angles (J,) at which a world rests in the drive of a recording's first frame, and their doubts (J,).

    The doubt is what the numbers of the model, within their priors, leave open.

    Raises:
        InputError: there is no equilibrium near the angles.
    """
    rest = _rest(forward, r, world, np.asarray(near, float))
    doubt = np.zeros_like(rest)
    theta = np.array([f.start for f in forward.subject.nominals])
    for k, f in enumerate(forward.subject.nominals):
        moved = theta.copy()
        moved[k] += f.scale if theta[k] + f.scale <= f.upper else -f.scale
        other = _rest(forward, r, forward.world(Hypothesis(), moved, ()), rest)
        doubt = np.hypot(doubt, (other - rest) * f.spread / f.scale)
    return rest, doubt


def _rest(forward: Worlds, r: int, world: World, near: np.ndarray) -> np.ndarray:
    model, parameters = weighed(*world, forward.recordings[r].gravity)
    arm = Articulation(model)
    pose = arm.reference()
    x = arm.positions(replace(pose, angles=near[:, None]))
    found = equilibrium(
        model, parameters, forward.drives[r].held(0.0), state=State.at_rest(model, position=x[:, 0]), contact=False
    )
    if not found.converged:
        raise InputError(
            "the model has no equilibrium near the first frame",
            file=forward.recordings[r].metadata.get("sidecar"),
            field="start",
            value="equilibrium",
            allowed="released, moving",
        )
    return np.asarray(found.angles, float)[arm.creases]

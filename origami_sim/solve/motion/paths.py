"""A path of equilibria as the frames of a motion, so that it can be saved, replayed and exported."""

from typing import TYPE_CHECKING

import numpy as np

from origami_sim.drive import Signal
from origami_sim.effects import CONTACTS, get
from origami_sim.errors import InputError
from origami_sim.solve import grips
from origami_sim.solve.batch import Batch
from origami_sim.solve.motion.dynamics import Trajectory
from origami_sim.solve.motion.gripped import exerted_at_rest
from origami_sim.solve.timestep import AT_REST, TimeStep

if TYPE_CHECKING:
    from origami_sim.solve.statics.equilibria import Path


def frames(path: "Path") -> Trajectory:
    """The points of a path of equilibria as frames, a point a second, without velocities.

    Raises:
        InputError: a path without points.
    """
    model, parameters, drive = path.model, path.parameters, path.drive
    if not len(path.factor) or model is None or parameters is None or drive is None:
        raise InputError("the path has no points to be shown", field="path", value=path.message)
    times = np.arange(len(path.factor), dtype=float)
    batch = Batch(model, parameters, drive, path.start, threads=1)
    found = []
    for x, angles, factor in zip(path.x, path.angles, path.factor, strict=True):
        batch.place(x[:, None], angles[:, None])
        found.append(batch.evaluate(float(factor)))
    x = path.x[:, :, None]
    forces = {n: np.stack([e.forces[n] for e in found]) for n in model.laws}
    work = {}
    for n, f in forces.items():
        spent = 0.5 * np.einsum("fnwa,fnwa->fw", f[1:] + f[:-1], np.diff(x, axis=0))
        work[n] = np.concatenate([np.zeros((1, 1)), np.cumsum(spent, axis=0)]) * get(n).exchanges_work
    zero = np.zeros_like(x)
    signals = {}
    for n, s in drive.signals.items():
        if s.times is not None:  # a line of the factor, see `continuation`
            along = np.asarray(path.factor if len(times) > 1 else np.repeat(path.factor, 2), float)
            s = Signal(offset=s.offset, times=np.arange(float(len(along))), values=along, scale=s.scale)
        signals[n] = s
    pulls = None
    if grips.moving(model, drive):
        total = sum(forces.values(), np.zeros_like(x))
        pulls, work[grips.WORK] = exerted_at_rest(model, drive, path.factor, x, total)
    contact = [n for n in model.laws if get(n).family in CONTACTS]
    return Trajectory(
        model=model,
        parameters=parameters,
        drive=drive.with_signals(signals),
        times=times,
        x=x,
        v=zero,
        angles=path.angles[:, :, None],
        energies={"kinetic": np.zeros((len(times), 1)), **{n: e[:, None] for n, e in path.energies.items()}},
        work=work,
        gaps=np.stack([e.gaps for e in found]),
        contact_forces=sum((forces[n] for n in contact), zero),
        grip_wrenches=pulls,
        failures=[],
        dt=1.0,
        step=TimeStep(np.inf, np.inf, 0, AT_REST),
        state=path.state(-1),
        wall=path.wall,
        notes=[f"{path.message} A second is a point of the path.", *filter(None, [path.touching])],
    )

"""What motions in grips have besides: starts that fit, force and moment of every grip, panels that are torn."""

import numpy as np

from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.model import Model, State
from origami_sim.solve import grips
from origami_sim.solve.batch import Batch, Evaluation
from origami_sim.solve.rigid.batch import RigidBatch
from origami_sim.solve.rigid.shares import shared
from origami_sim.solve.rigid.topology import Topology


def check_start(model: Model, drive: Drive, state: State, begin: float, end: float) -> bool:
    """Whether grips move within a motion from `begin` to `end` [s], of which the start is then looked at.

    Raises:
        InputError: a path of a grip that the model lacks, a start that is not on the paths, a velocity of rigid panels
            that jumps on the way.
    """
    if not grips.moving(model, drive):
        return False
    grips.refuse_jump(model, state.x, grips.levels_at(model, drive, begin, state.worlds))
    if model.panels != "rigid":
        return True
    for name in grips.channels(model):
        kinks = drive[name].kinks if name in drive.signals else np.zeros(0)
        inside = kinks[(kinks > begin) & (kinks < end)]
        if len(inside):
            raise InputError(
                f"its velocity jumps at t = {inside[0]:.6g} s, which no rigid panel can follow",
                field=name,
                allowed="ramp(..., smooth=True), series(..., smooth=True), sine(...), or panels='elastic'",
            )
    return True


def exerted(batch: Batch, drive: Drive, mass: np.ndarray, state: State, now: Evaluation, time: float) -> np.ndarray:
    """Force [N] and moment about its pole [N m] of each grip in a frame of a motion [G, W, 6]."""
    model = batch.model
    motion = grips.motion_at(model, drive, time, state.worlds)
    if isinstance(batch, RigidBatch):
        wrench, loops = batch.supporting()
        return shared(model, batch.tree_of, state.x, motion[0], wrench, loops)
    force = sum((now.forces[n] for n in model.laws), np.zeros_like(state.x))
    return grips.wrenches(model, mass, state.x, force, motion)


def exerted_at_rest(
    model: Model, tree: Topology | None, x: np.ndarray, levels: np.ndarray, force: np.ndarray
) -> np.ndarray:
    """The same in equilibria [G, W, 6], at positions x [N, W, 3] with forces of all laws [N, W, 3] and levels [G, W].

    Args:
        tree: of rigid panels.
    """
    if tree is None:
        still = np.stack([levels, np.zeros_like(levels), np.zeros_like(levels)])
        return grips.wrenches(model, np.zeros((len(x), 1)), x, force, still)
    wrench = -np.concatenate([force.sum(axis=0), np.cross(x, force).sum(axis=0)], axis=1)
    return shared(model, tree, x, levels, wrench, -np.einsum("mnwa,nwa->mw", tree.rates(x), force))


def tears(model: Model, drive: Drive, times: np.ndarray, x: np.ndarray) -> dict[int, tuple[float, int, str]]:
    """Worlds of rigid panels that grips tear apart: the first frame's time [s], a node, and why. x: [F, N, W, 3]."""
    found: dict[int, tuple[float, int, str]] = {}
    for time, frame in zip(times.tolist(), x, strict=True):
        torn = grips.torn(model, frame, grips.levels_at(model, drive, time, x.shape[2]))
        found |= {w: (time, *how) for w, how in torn.items() if w not in found}
    return found

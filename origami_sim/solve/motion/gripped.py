"""What motions in grips have besides: starts that fit, force and moment of every grip, panels that are torn."""

import numpy as np

from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.model import Model, State
from origami_sim.solve import grips
from origami_sim.solve.rigid.shares import shared, supporting
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
    slack = 1e-9 * (end - begin)  # instants of frames are rounded
    for name in grips.channels(model):
        kinks = drive[name].kinks if name in drive.signals else np.zeros(0)
        inside = kinks[(kinks > begin + slack) & (kinks < end - slack)]
        if len(inside):
            raise InputError(
                f"its velocity jumps at t = {inside[0]:.6g} s, which no rigid panel can follow",
                field=name,
                allowed="ramp(..., smooth=True), series(..., smooth=True) from rest, sine(...), or panels='elastic'",
            )
    return True


def exerted(
    model: Model,
    x: np.ndarray,
    force: np.ndarray,
    motion: np.ndarray,
    *,
    mass: np.ndarray | None = None,
    tree: Topology | None = None,
    borne: tuple[np.ndarray, np.ndarray] | None = None,
) -> np.ndarray:
    """Force [N] and moment about its pole [N m] of each grip [G, W, 6].

    Args:
        x: [N, W, 3] positions [m]. force: [N, W, 3] of all laws [N].
        motion: levels, rates and accelerations [3, G, W] of the grips. mass: [N, 1 or W] of the nodes [kg] of bars;
            None: at rest.
        tree: of rigid panels. borne: what their supports and loops bear, see `RigidBatch.supporting`; None: at rest.
    """
    if tree is None:
        still = np.zeros((len(x), 1))
        return grips.wrenches(model, still if mass is None else mass, x, force, motion)
    return shared(model, tree, x, motion[0], *(supporting(tree, x, force) if borne is None else borne))


def exerted_at_rest(
    model: Model, drive: Drive, times: np.ndarray, x: np.ndarray, force: np.ndarray, tree: Topology | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The same of equilibria at times [F], and the work [J] of all grips since the first: [F, G, W, 6] and [F, W].

    Args:
        x: [F, N, W, 3] positions [m]. force: [F, N, W, 3] of all laws [N]. tree: of rigid panels.
    """
    levels = grips.levels_over(model, drive, times, x.shape[2])
    frames = zip(x, force, levels, strict=True)
    out = np.stack([exerted(model, a, f, grips.standing(at), tree=tree) for a, f, at in frames])
    return out, grips.work(levels, grips.on_path(model.grip_screws[:, None], out))


def tears(model: Model, drive: Drive, times: np.ndarray, x: np.ndarray) -> dict[int, tuple[float, int, str]]:
    """Worlds of rigid panels that grips tear apart: the first frame's time [s], a node, and why. x: [F, N, W, 3]."""
    found: dict[int, tuple[float, int, str]] = {}
    for time, frame in zip(times.tolist(), x, strict=True):
        torn = grips.torn(model, frame, grips.levels_at(model, drive, time, x.shape[2]))
        found |= {w: (time, *how) for w, how in torn.items() if w not in found}
    return found

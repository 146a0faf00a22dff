"""What grips on rigid panels exert, each of them.

Loops to the ground are redundant: a panel is held at more nodes than it has motions. What each grip exerts as a whole
is determined all the same, unless the panels could be pressed or twisted between grips without moving: such components
depend on how panels deform, and are not a number.
"""

import numpy as np

from origami_sim.model import Model
from origami_sim.solve.grips import poles
from origami_sim.solve.rigid.topology import REDUNDANT, Topology

SHARED = 1e-6
"""Part of a component of what a grip exerts, over the most that it could have, from which it is not determined.

Rounding leaves 1e-9 where it is, and what is shared has a tenth or more. Half and double tell the same ones.
"""

DEAD = 1e-3
"""Part of what loops add to the coordinates that no force of theirs could: at a dead centre it is most of it, and where
loops are soft to 1e-10 up to 1e-5. Half and double tell the same ones."""


def closing(tree: Topology, x: np.ndarray) -> np.ndarray:
    """[R, m] derivatives of the loops' gaps by the coordinates at positions [N, 3]."""
    count = len(tree.turns) + len(tree.joints)
    return tree.closures(x, np.zeros((count, 1)))[1][:, :, 0].T


def supporting(tree: Topology, x: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What `shared` is to share at rest: of all supports [W, 6] and of loops [m, W], against forces [N, W, 3]."""
    wrench = -np.concatenate([force.sum(axis=0), np.cross(x, force).sum(axis=0)], axis=1)
    return wrench, -np.einsum("mnwa,nwa->mw", tree.rates(x), force)


def shared(
    model: Model, tree: Topology, x: np.ndarray, levels: np.ndarray, wrench: np.ndarray, loops: np.ndarray
) -> np.ndarray:
    """Force [N] and moment about its pole [N m] of each grip on rigid panels [G, W, 6]; nan where not determined.

    Args:
        x: [N, W, 3] positions. levels: [G, W]. wrench: [W, 6] force and moment about the origin of all supports.
        loops: [m, W] what loops add to the momenta of the coordinates.
    """
    root, rows = tree.in_grips
    at = poles(model, levels)
    out = np.zeros((*at.shape[:2], 6))
    ground = np.flatnonzero(rows > -2)
    size = float(np.ptp(model.position, axis=0).max(initial=0.0)) or 1.0
    scale = np.repeat([1.0, 1.0 / size], 3)
    for w in range(x.shape[1]):
        slope = closing(tree, x[:, w])
        place, axis = x[tree.row_node[ground], w], tree.row_axis[ground]
        each = np.concatenate([axis, np.cross(place, axis)], axis=1).T  # [6, ground] of a unit of each
        pull, free = np.zeros(len(slope)), np.zeros((len(slope), 0))
        if len(slope):
            left, values, right = np.linalg.svd(slope)
            rank = int(np.sum(values > REDUNDANT * values.max(initial=0.0)))
            pull = left[:, :rank] @ ((right[:rank] @ loops[:, w]) / values[:rank])
            if np.abs(slope.T @ pull - loops[:, w]).max() > DEAD * np.abs(loops[:, w]).max():
                out[:, w] = np.nan  # dead centre: no force of finite size keeps the balance
                continue
            free = left[:, rank:]  # forces of loops that move nothing
        rest = each @ pull[ground]
        rest_free = each @ free[ground]
        for g in range(len(at)):
            own = rows[ground] == g
            found, spread = each[:, own] @ pull[ground][own], each[:, own] @ free[ground][own]
            if g == root:
                found, spread = found + wrench[w] - rest, spread - rest_free
            for a in (found[:, None], spread):  # about its own pole
                a[3:] -= np.cross(at[g, w], a[:3].T).T
            found = found.copy()
            open_ = np.linalg.norm(spread * scale[:, None], axis=1) > SHARED if spread.size else np.zeros(6, bool)
            out[g, w] = np.where(open_, np.nan, found)
    return out

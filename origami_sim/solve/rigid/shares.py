"""Grips that hold rigid panels: which of them the tree has to follow, and what force each exerts.

Loops to the ground are redundant: a panel is held at more nodes than it has motions. What each grip exerts as a whole
is determined all the same, unless the panels could be pressed or twisted between grips without moving: such components
depend on how panels deform, and are not a number.
"""

import numpy as np

from origami_sim.errors import InputError
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


def of_grips(model: Model, tree: Topology) -> tuple[int, np.ndarray]:
    """The grip of the root, -1 where it stands; and that of each constraint [R], -2 between panels.

    Raises:
        InputError: a panel that a grip holds only in part, or beside a support that stands still.
    """
    held = np.any(model.free[tree.root_nodes] == 0.0, axis=1)
    mine = np.unique(model.grips[tree.root_nodes[held]])
    if len(mine) > 1 or (len(mine) and mine[0] >= 0 and len(tree.turns)):
        nodes = tree.root_nodes[held]
        raise InputError(
            "a rigid panel in a grip is held by it alone, and as a whole",
            field="grip",
            value=f"nodes {nodes.tolist()}",
            allowed="Sheet.grip(name, panels=[...]), or panels='elastic'",
        )
    rows = np.where(tree.row_body[:, 1] >= 0, -2, model.grips[tree.row_node]) if len(tree.row_node) else np.zeros(0)
    return (int(mine[0]) if len(mine) else -1), rows.astype(np.int32)


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
    root, rows = of_grips(model, tree)
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

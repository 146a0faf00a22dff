"""Force of the supports of rigid panels: what the rate of momentum lacks of all other forces.

Newton's second law for the device as a whole: R = d/dt sum m v - sum F. Forces between panels cancel, so that no share
of them has to be known. How several supports of rigid bodies share R is not determined by mechanics of rigid bodies.
"""

import numpy as np

from origami_sim.model import Model
from origami_sim.solve.rigid.shares import closing
from origami_sim.solve.rigid.topology import Topology, mass_matrix

ALONG = 1e-5
"""Part of a radian by which panels are moved along their motion, for differences of what unit rates move."""


def held_nodes(model: Model) -> np.ndarray:
    """Nodes of which an axis is held; without the points that stand for a panel's mass."""
    held = np.any(model.free == 0.0, axis=1)
    held[len(held) - len(model.carriers) :] = False
    return np.flatnonzero(held)


def support_of_all(model: Model, mass: np.ndarray, x: np.ndarray, v: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Force of all supports together on the device in each of W states: (W, 3) [N].

    Kane's equations give the accelerations of the coordinates, so that nothing is differentiated in time.

    Args:
        mass: (N,) of the nodes. x, v: [N, W, 3] positions and velocities of rigid panels.
        force: [N, W, 3] of all effects on the nodes.
    """
    moving = bool(np.any(v))
    still = -force.sum(axis=0)
    tree = Topology(model)
    count = len(tree.turns) + len(tree.joints)
    if not count:
        return still
    by = tree.rates(x)
    flat = np.moveaxis(by, 2, 0).reshape(x.shape[1], count, -1)  # [W, m, 3 N]
    u = np.zeros((count, x.shape[1]))
    if moving:
        corners = 3 * (len(x) - len(model.carriers))
        own, going = flat[:, :, :corners], np.moveaxis(v, 1, 0).reshape(x.shape[1], -1, 1)[:, :corners]
        u = np.stack([np.linalg.lstsq(a.T, b[:, 0], rcond=None)[0] for a, b in zip(own, going, strict=True)], axis=1)
    step = ALONG / max(1.0, float(np.abs(u).max(initial=0.0)))
    ends = [tree.moved(x, sign * step * u) for sign in (1.0, -1.0)] if moving else [x, x]
    turning = np.einsum("mnwa,mw->nwa", tree.rates(ends[0]) - tree.rates(ends[1]), u) / (2.0 * step)
    heavy = mass_matrix(by, mass)
    right = np.einsum("mnwa,nwa->wm", by, force - mass[:, None, None] * turning)
    out = np.empty((x.shape[1], 3))
    for w in range(x.shape[1]):
        a, b = heavy[w], right[w]
        if len(tree.row_node):  # loops stay closed
            slopes = closing(tree, x[:, w])
            change = closing(tree, ends[0][:, w]) - closing(tree, ends[1][:, w])
            rows = len(slopes)
            a = np.block([[a, slopes.T], [slopes, np.zeros((rows, rows))]])
            b = np.append(b, -(change @ u[:, w]) / (2.0 * step))
        rate = np.linalg.lstsq(a, b, rcond=1e-13)[0][:count]
        acceleration = np.einsum("mna,m->na", by[:, :, w], rate) + turning[:, w]
        out[w] = still[w] + mass @ acceleration
    return out

"""Damped joints of rigid panels: whether they are overdamped, so that steps have to be implicit in their damping."""

import numpy as np

from origami_sim.model import Model, Parameters, node_mass
from origami_sim.solve.rigid.topology import Topology, check_inertia

STABLE = 3.3
"""Largest product of a step and a decay rate at which the explicit steps are stable (Dormand & Prince 1980)."""

FEWEST = 20
"""Explicit steps in a frame that viscosity has to ask for before steps are implicit in damping.

A crawler of which it asks 10 takes 0.7 times as long with explicit as with implicit steps; of 19 the same, of 37 1.6
times, of 80 2.9 times. Rollouts of a wrong hypothesis may be more damped than the nominal model, which decides.
"""


def overdamped(model: Model, parameters: Parameters, tree: Topology, frame: float) -> bool:
    """Whether joints' viscosity makes explicit steps much shorter than frames; not told where panels close loops.

    Args:
        frame: duration within which steps end [s].

    Raises:
        InputError: a panel that turns without inertia.
    """
    if len(tree.row_node) or "crease_viscosity" not in model.effects:
        return False
    check_inertia(model, tree, model.position, node_mass(model, parameters)[:, 0])
    by, mass = tree.rates(model.position[:, None])[:, :, 0], node_mass(model, parameters)[:, 0]
    inertia = np.einsum("mna,n,kna->mk", by, mass, by)
    viscosity, joint = np.zeros(len(inertia)), tree.joint_of >= 0
    given = np.broadcast_to(parameters["crease_viscosity", "viscosity"][:, 0], len(model.creases))
    np.add.at(viscosity, len(tree.turns) + tree.joint_of[joint], given[joint])
    fastest = float(np.abs(np.linalg.eigvals(np.linalg.solve(inertia, np.diag(viscosity)))).max(initial=0.0))
    return fastest * frame > FEWEST * STABLE

"""Damped joints of rigid panels: whether they are overdamped, so that steps have to be implicit in their damping."""

import numpy as np

from origami_sim.model import Model, Parameters, node_mass
from origami_sim.solve.rigid.topology import Topology, check_inertia, mass_matrix

STABLE = 3.3
"""Largest product of a step and a decay rate at which the explicit steps are stable (Dormand & Prince 1980)."""

FEWEST = 10
"""Explicit steps in a frame that viscosity has to ask for before steps are implicit in damping.

A walker that falls onto its feet takes 1.6 times as long with implicit as with explicit steps where viscosity asks for
4, 0.61 times for 11, 0.21 times for 55. The nominal model decides, and fits may be more damped (by 3.5 where viscosity
explains a lag).
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
    mass = node_mass(model, parameters)[:, 0]
    check_inertia(model, tree, model.position, mass)
    inertia = mass_matrix(tree.rates(model.position[:, None]), mass)[0]
    viscosity, joint = np.zeros(len(inertia)), tree.joint_of >= 0
    given = np.broadcast_to(parameters["crease_viscosity", "viscosity"][:, 0], len(model.creases))
    np.add.at(viscosity, len(tree.turns) + tree.joint_of[joint], given[joint])
    fastest = float(np.abs(np.linalg.eigvals(np.linalg.solve(inertia, np.diag(viscosity)))).max(initial=0.0))
    return fastest * frame > FEWEST * STABLE

"""Stiffness of sheets, a matrix of six numbers for strains or curvatures 11, 22 and twice 12, and its relaxation."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import warp as wp

from origami_sim.effects._effect import Memory, Parameter, scalar
from origami_sim.effects.crease_relaxation import branch

COMPONENTS = ("11", "22", "12", "66", "16", "26")
"""Entries of the matrix that are parameters; 6 stands for the shear (Jones 1999, Mechanics of Composite Materials)."""


@wp.func
def weighed(k: wp.vec3d, s11: scalar, s22: scalar, s12: scalar, s66: scalar, s16: scalar, s26: scalar):
    return wp.vec3d(
        s11 * k[0] + s12 * k[1] + s16 * k[2],
        s12 * k[0] + s22 * k[1] + s26 * k[2],
        s16 * k[0] + s26 * k[1] + s66 * k[2],
    )


def stiffnesses(symbol: str, unit: str, meaning: str) -> tuple[Parameter, ...]:
    """The six parameters of a symmetric matrix, zero at first."""
    low = {"11": 0.0, "22": 0.0, "66": 0.0}
    return tuple(
        Parameter(f"stiffness_{c}", symbol + c, unit, 0.0, (low.get(c, -math.inf), math.inf), f"{meaning} {c}")
        for c in COMPONENTS
    )


def matrix(parameters: Mapping[str, np.ndarray]) -> np.ndarray:
    """The matrices [..., 3, 3] of parameters [...]."""
    a, b, c, d, e, f = np.broadcast_arrays(*(parameters[f"stiffness_{k}"] for k in COMPONENTS))
    return np.stack([np.stack(r, axis=-1) for r in ((a, c, e), (c, b, f), (e, f, d))], axis=-2)


def largest(parameters: Mapping[str, np.ndarray]) -> np.ndarray:
    """Largest stiffness of any strain of unit norm (11^2 + 22^2 + 2 12^2): an eigenvalue in Mandel's notation."""
    scale = np.sqrt([1.0, 1.0, 2.0])
    return np.abs(np.linalg.eigvalsh(matrix(parameters) * scale[:, None] * scale)).max(axis=-1)


# relaxation -----------------------------------------------------------------------------------------------------------

BRANCHES = (1, 2, 3)


@wp.func
def relaxed(q: wp.vec3d, change: wp.vec3d, dt: scalar, share: scalar, time: scalar):
    """A Maxwell branch's stress over the stiffness after a step: what is left, and what the change adds as in a crease.

    Exact for a strain that changes evenly within the step.
    """
    return wp.exp(-dt / time) * q + branch(scalar(0.0), scalar(1.0), dt, share, time) * change


@wp.func
def maxwell(
    change: wp.vec3d,
    dt: scalar,
    q1: wp.vec3d,
    q2: wp.vec3d,
    q3: wp.vec3d,
    stiffness_11: scalar,
    stiffness_22: scalar,
    stiffness_12: scalar,
    stiffness_66: scalar,
    stiffness_16: scalar,
    stiffness_26: scalar,
    share_1: scalar,
    time_1: scalar,
    share_2: scalar,
    time_2: scalar,
    share_3: scalar,
    time_3: scalar,
):
    """The law of three branches: what they resist a change with, and their memory after it."""
    p1 = relaxed(q1, change, dt, share_1, time_1)
    p2 = relaxed(q2, change, dt, share_2, time_2)
    p3 = relaxed(q3, change, dt, share_3, time_3)
    resisting = weighed(
        p1 + p2 + p3, stiffness_11, stiffness_22, stiffness_12, stiffness_66, stiffness_16, stiffness_26
    )
    return resisting, p1, p2, p3


def instantaneous(parameters: Mapping[str, np.ndarray]) -> np.ndarray:
    """Largest stiffness of the branches for a strain of unit norm that comes at once."""
    return largest(parameters) * sum(np.asarray(parameters[f"share_{i}"]) for i in BRANCHES)


def relaxation(symbol: str, unit: str, meaning: str) -> dict[str, Any]:
    """What effects by which a stiffness relaxes have in common, but for their law.

    Branches are silent at first. Each remembers its stress over the stiffness: a strain or a curvature, in the
    triangle's axes.
    """
    branches = tuple(
        p
        for i in BRANCHES
        for p in (
            Parameter(
                f"share_{i}", f"g{i}", "-", 0.0, (0.0, math.inf), f"stiffness of branch {i} over the elastic one",
                typical=0.1 if i == 1 else 0.0,
            ),
            Parameter(f"time_{i}", f"tau{i}", "s", 1.0, (1e-6, math.inf), f"relaxation time {i}", typical=0.01),
        )
    )  # fmt: skip
    return {
        "memory": tuple(Memory(f"q{i}", 3, own=True) for i in BRANCHES),
        "parameters": (*stiffnesses(symbol, unit, meaning), *branches),
        "fitted": ("share_1", "time_1"),
        "stated": ("stiffness_11", "stiffness_22", "stiffness_66"),
        "needs": tuple(f"share_{i}" for i in BRANCHES),
        "stiffness": instantaneous,
        "source": "generalised Maxwell solid of which all moduli relax alike (standard linear solid with one branch); "
        "exact exponential update (Simo & Hughes 1998, ch. 10)",
    }

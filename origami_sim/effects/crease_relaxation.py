"""Viscoelastic relaxation: of a crease, three Maxwell branches (Prony series) beside its elasticity."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Memory, Parameter, scalar


@wp.func
def branch(q: scalar, turn: scalar, dt: scalar, stiffness: scalar, time: scalar):
    # exact for a rate that is constant over the step; the turn, not the rate at its end, keeps it second-order and as
    # stable as a spring of this stiffness
    r = dt / time
    grow = scalar(1.0) - scalar(0.5) * r
    if r > scalar(1.0e-6):
        grow = (scalar(1.0) - wp.exp(-r)) / r
    return q * wp.exp(-r) + stiffness * grow * turn


@wp.func
def moment(
    turn: scalar,
    dt: scalar,
    q1: scalar,
    q2: scalar,
    q3: scalar,
    stiffness_1: scalar,
    time_1: scalar,
    stiffness_2: scalar,
    time_2: scalar,
    stiffness_3: scalar,
    time_3: scalar,
):
    p1 = branch(q1, turn, dt, stiffness_1, time_1)
    p2 = branch(q2, turn, dt, stiffness_2, time_2)
    p3 = branch(q3, turn, dt, stiffness_3, time_3)
    return -(p1 + p2 + p3), p1, p2, p3


EFFECT = Effect(
    name="crease_relaxation",
    family="crease",
    force=moment,
    memory=tuple(Memory(f"q{i}", begun=f"begun_{i}", by=f"stiffness_{i}") for i in (1, 2, 3)),
    parameters=tuple(
        p
        for i, first in ((1, 3e-4), (2, 0.0), (3, 0.0))
        for p in (
            Parameter(f"stiffness_{i}", f"K{i}", "N m/rad", 0.0, (0.0, math.inf), f"spring {i}", typical=first),
            Parameter(f"time_{i}", f"tau{i}", "s", 1.0, (1e-6, math.inf), f"relaxation time {i}", typical=1.0),
            Parameter(
                f"begun_{i}",
                f"xi{i}",
                "-",
                0.0,
                (-math.inf, math.inf),
                f"q{i} at a recording's first frame over the most later",
            ),
        )
    ),
    fitted=("stiffness_1", "time_1"),
    needs=("stiffness_1", "stiffness_2", "stiffness_3"),
    stiffness=lambda p: p["stiffness_1"] + p["stiffness_2"] + p["stiffness_3"],
    formula="M = -sum q_i,  dq_i/dt = K_i dtheta/dt - q_i / tau_i",
    source="standard linear solid / Prony series; exact exponential update (Simo & Hughes 1998, ch. 10)",
    matters="VHB loses half its force in 10 s; silicone a few percent per decade",
    confused_with="Kelvin-Voigt loss at one frequency; set; dielectric relaxation; leakage",
    separated_by="hold at constant drive, then recovery at zero",
)

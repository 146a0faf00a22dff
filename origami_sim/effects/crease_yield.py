"""Yield: beyond a moment a crease keeps part of its fold, at once or at a rate."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Memory, Parameter, scalar


@wp.func
def flow(excess: scalar, before: scalar, dt: scalar, time: scalar):
    """How much of the excess moment a step takes away, if the crease turns at an even rate within it.

    The excess would grow from `before` to `excess` [N m] without flow; it decays within `time` [s].
    """
    taken = wp.max(excess, scalar(0.0))
    if time > scalar(0.0):
        taken = scalar(0.0)
        if dt > scalar(0.0):
            rise = (excess - before) / dt
            first = wp.max(before, scalar(0.0))
            lasts = dt  # how long it flows
            if before < scalar(0.0) and excess > before:
                lasts = dt * wp.clamp(excess / (excess - before), scalar(0.0), scalar(1.0))
            end = first * wp.exp(-lasts / time) + rise * time * (scalar(1.0) - wp.exp(-lasts / time))
            if end < scalar(0.0):  # turning back, it comes to rest within the step
                lasts = time * wp.log(scalar(1.0) - first / (rise * time))
                end = scalar(0.0)
            if first > scalar(0.0) or excess > scalar(0.0):
                taken = wp.max(first + rise * lasts - end, scalar(0.0))
    return taken


@wp.func
def moment(
    angle: scalar,
    turn: scalar,
    dt: scalar,
    plastic: scalar,
    flowed: scalar,
    stiffness: scalar,
    rest_angle: scalar,
    softening: scalar,
    yield_moment: scalar,
    isotropic: scalar,
    viscosity: scalar,
):
    kept = plastic
    all_flow = flowed
    if softening > scalar(0.0) and stiffness > scalar(0.0):
        hardening = stiffness * (scalar(1.0) - softening) / softening
        back = (scalar(1.0) - isotropic) * hardening * plastic
        limit = yield_moment + isotropic * hardening * flowed
        trial = stiffness * (angle - rest_angle - plastic) - back
        start = trial - stiffness * turn
        way = wp.sign(trial)
        if wp.abs(start) > limit:
            way = wp.sign(start)
        compliance = softening / stiffness
        taken = flow(way * trial - limit, way * start - limit, dt, viscosity * compliance)
        kept = plastic + way * taken * compliance
        all_flow = flowed + taken * compliance
    return stiffness * kept, kept, all_flow


EFFECT = Effect(
    name="crease_yield",
    family="crease",
    force=moment,
    memory=(Memory("plastic"), Memory("flowed")),
    parameters=(
        Parameter("stiffness", "K", "N m/rad", 0.0, (0.0, math.inf), "stiffness of the elastic crease, which yields"),
        Parameter("rest_angle", "theta0", "rad", 0.0, (-math.pi, math.pi), "angle without moment before it yields"),
        Parameter(
            "softening", "s", "-", 0.0, (0.0, 1.0),
            "share of the stiffness that is lost while it yields; 1: it flows at a constant moment", typical=0.7,
        ),
        Parameter(
            "yield_moment", "My", "N m", 0.0, (0.0, math.inf), "moment at which it yields first", typical=2e-4,
            threshold="moment",
        ),
        Parameter(
            "isotropic", "b", "-", 0.0, (0.0, 1.0),
            "share of the hardening by which both limits grow; the rest shifts them", typical=0.0,
        ),
        Parameter(
            "viscosity", "eta", "N m s/rad", 0.0, (0.0, math.inf), "excess moment per rate of flow; 0: at once",
            typical=0.0,
        ),
    ),
    fitted=("softening", "yield_moment"),
    stiffness=lambda p: p["stiffness"] * p["softening"],
    formula=(
        "M = K p beside the crease's own -K (theta - theta0);  with m = K (theta - theta0 - p), h = K (1 - s) / s: "
        "dp/dt = sign(m - q) <|m - q| - R> / eta,  q = (1 - b) h p,  R = My + b h sum |dp|;  eta = 0: |m - q| <= R"
    ),
    source=(
        "return map of mixed linear hardening (Simo & Hughes 1998, box 1.5) with Perzyna's (1966) linear excess "
        "stress, exact for an even turn within a step"
    ),
    matters="paper, card, polyester and polyimide films keep most of a first fold; elastomers do not",
    confused_with="set in proportion to the fold, dry friction, Mullins softening, a rest angle read wrongly",
    separated_by="folds of growing size: below the yield moment nothing stays; unload: the slope is the first one",
)  # fmt: skip

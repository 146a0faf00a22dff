"""Directional friction: larger backward than forward along an axis of the body (cut or inclined foot)."""

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def coefficient(direction: wp.vec3d, axis: wp.vec3d, backward_excess: scalar):
    return backward_excess * wp.max(-wp.dot(direction, axis), scalar(0.0))


EFFECT = Effect(
    name="directional_friction",
    family="coefficient",
    force=coefficient,
    parameters=(
        Parameter("backward_excess", "dmu", "-", 0.0, (0.0, 5.0), "mu backward minus mu forward", typical=0.3),
    ),
    fitted=("backward_excess",),
    formula="mu = mu_f + dmu max(-s . axis, 0), s the direction of (impending) sliding",
    source="directional feet; linear in the direction cosine",
    matters="ratchet of a crawler: net drift fixed to the body, even in B, survives slow driving",
    confused_with="ground tilt (fixed to the lab), mass asymmetry (vanishes when slow)",
    separated_by="turn the body by 180 degrees",
)

"""The kernel of the force at one point of an implicit step, for the average along it (see `implicit`)."""

import functools

import warp as wp

from origami_sim.effects import DISTORTIONS, get
from origami_sim.solve.program import compose

_HEAD = """
@wp.kernel(enable_backward=False)
def average({arguments}
    A: wp.array2d(dtype=vec3), F: wp.array2d(dtype=vec3), work: wp.array2d(dtype=scalar),
    power: wp.array2d(dtype=scalar), X0: wp.array(dtype=vec3), X1: wp.array2d(dtype=vec3),
    fractions: wp.array(dtype=scalar), others: wp.array(dtype=scalar), begin: wp.array(dtype=scalar), first_world: int,
):
    w = (first_world + wp.tid()) & NATURAL
    fraction = fractions[w]
    other = others[w]
    h = fraction * begin[1]
    time = begin[0] + h
    half = scalar(1.0)
{hoist}
    if h > scalar(0.0):
        for row in range(mask.shape[0]):
            n = row & NATURAL
            X[n, w] = X0[n] + fraction * (X1[n, w] - X0[n])
            F[n, w] = vec3(scalar(0.0), scalar(0.0), scalar(0.0))
{body}
"""
"""The rollout's force evaluation alone, at a fraction of the step from X0 to X1, which begins at begin[0] and lasts
begin[1]; `others` is the other point of the average. Memory and angles are those of its beginning, and advance. The
slip since then is (V - A) h."""


class _Averager(compose._Composer):
    """Within a step, lengths and angles go evenly from their first to their last value.

    So stiff bars do not feel that the straight path of a node cuts the corner of its turn.
    """

    def _span(self, t: compose.Text):
        t("before = X0[q] - X0[p]")
        t("after = X1[q, w] - X1[p, w]")
        t("length = wp.length(before) + fraction * (wp.length(after) - wp.length(before))")
        # the mean of the gradient along the path: times the change of the span it is the change of the length
        t("along = (before + after) * (scalar(1.0) / (wp.length(before) + wp.length(after)))")

    def _strain(self, t: compose.Text, moving: bool):
        ends = [f"X0[n{i}]" for i in (1, 2, 3)], [f"X1[n{i}, w]" for i in (1, 2, 3)]
        for i, (a, b) in enumerate(zip(*ends, strict=True), 1):
            t(f"y{i} = scalar(0.5) * ({a} + {b})")
        t(f"before_strain = shells.strain({', '.join(ends[0])}, shape)")
        t(f"strain = before_strain + fraction * (shells.strain({', '.join(ends[1])}, shape) - before_strain)")
        if moving:
            t("earlier = before_strain")

    def _fold(self, t: compose.Text):
        t("g = kinematics.dihedral(X[i, w], X[j, w], X[k, w], X[l, w])")
        t("last = kinematics.dihedral(X1[i, w], X1[j, w], X1[k, w], X1[l, w])")
        # likewise the mean of the gradient, at both points
        for n in "ijkl":
            t(f"x_{n} = X0[{n}] + other * (X1[{n}, w] - X0[{n}])")
        t("g_other = kinematics.dihedral(x_i, x_j, x_k, x_l)")
        for n in "ijkl":
            t(f"g.g{n} = scalar(0.5) * (g.g{n} + g_other.g{n})")
        t("angle = angles[r, w] + fraction * (kinematics.unwrap(last.angle, angles[r, w]) - angles[r, w])")


@functools.cache
def kernel(names: tuple[str, ...]) -> wp.Kernel:
    """The kernel of the averaged force for a set of effects."""
    effects = tuple(e for e in map(get, names) if e.family not in DISTORTIONS)
    composer = _Averager(effects)
    source = _HEAD.format(arguments=composer.arguments(), hoist=composer.hoist(), body=composer.body("rollout"))
    return compose.written(source, "average", effects)

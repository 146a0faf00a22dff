"""Small models for the tests of effects and solvers: every model runs one program with the whole catalogue in it."""

import math

import numpy as np

from origami_sim.effects import CATALOGUE, DISTORTIONS, PAIRS, SHELLS
from origami_sim.model import Model, Parameters, State

ALL = tuple(n for n, e in CATALOGUE.items() if e.family not in DISTORTIONS)
"""Every effect that acts as a force."""

INTERNAL = ("bar", "crease", "bend", *SHELLS, *PAIRS)
"""Families whose forces act between nodes: no net force, no net torque."""


def make_model(
    position,
    *,
    bars=(),
    creases=(),
    bends=(),
    triangles=(),
    contacts=(),
    weights=None,
    offsets=None,
    axes=None,
    free=None,
    effects=tuple(CATALOGUE),
    electrodes=None,
    names=None,
) -> Model:
    """A model from lists; contact points sit on the first corner of their triangle unless weights are given."""

    def indices(a, columns):
        return np.asarray(a, np.int32).reshape(-1, columns)

    position = np.asarray(position, float)
    contacts, k, h = indices(contacts, 3), len(contacts), len(creases) + len(bends)
    return Model(
        position=position,
        free=np.ones_like(position) if free is None else np.asarray(free, float),
        bars=indices(bars, 2),
        creases=indices(creases, 4),
        bends=indices(bends, 4),
        triangles=indices(triangles, 3),
        triangle_panel=np.zeros(len(triangles), np.int32),
        contacts=contacts,
        contact_weights=np.tile([1.0, 0, 0], (k, 1)) if weights is None else np.asarray(weights, float),
        contact_offsets=np.zeros(k) if offsets is None else np.asarray(offsets, float),
        contact_axes=np.zeros((k, 3)) if axes is None else np.asarray(axes, float),
        electrodes=np.zeros(h, np.int32) if electrodes is None else np.asarray(electrodes, np.int32),
        effects=effects,
        names=names or {},
    )


def quiet(model: Model, values=None) -> Parameters:
    """Parameters with every effect off, also those that act by default (gravity and ground), then these values."""
    p = Parameters(model)
    # the stiffness of friction would limit the step even where nothing presses
    for *key, value in (("gravity", "gravity_z", 0.0), ("ground", "stiffness", 0.0), ("friction", "stiffness", 1e-9)):
        if tuple(key) in p:
            p.set(*key, value)
    for key, value in (values or {}).items():
        p.set(*key, value)
    return p


def lengths(model: Model) -> np.ndarray:
    return np.linalg.norm(np.diff(model.position[model.bars], axis=1)[:, 0], axis=-1)


def hinge_positions(angle, left=(0.4, 0.9), right=(0.6, 0.8)) -> np.ndarray:
    """Nodes i, j, k, l of two triangles about the x axis, l turned up by `angle` (valley positive).

    `left` and `right` are the place of the apex along the axis j-k of unit length, and its distance from it.
    """
    return np.array(
        [
            [right[0], -right[1], 0.0],
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [left[0], left[1] * math.cos(angle), left[1] * math.sin(angle)],
        ]
    )


HINGE = {
    "bars": [(0, 1), (0, 2), (1, 2), (3, 1), (3, 2)],
    "creases": [(0, 1, 2, 3)],
    "triangles": [(1, 2, 3), (1, 0, 2)],
}


def hinge(angle=0.0, *, held=(), **options) -> Model:
    """One crease between two triangles; the nodes `held` do not move."""
    x = hinge_positions(angle)
    free = np.ones_like(x)
    free[list(held)] = 0.0
    return make_model(x, free=free, **{**HINGE, **options})


def strip(n=4, *, effects=tuple(CATALOGUE), height=0.0, electrodes=None) -> Model:
    """n square panels in a row, each cut by a bending line, creases between them, contact points under all."""
    x = np.array([[i, j, height] for i in range(n + 1) for j in (0.0, 1.0)], float)
    triangles, bars, creases, bends = [], {(0, 1)}, [], []
    for p in range(n):
        a, b, c, d = 2 * p, 2 * p + 1, 2 * p + 2, 2 * p + 3
        triangles += [(a, c, d), (a, d, b)]
        bars |= {(a, c), (b, d), (c, d), (a, d)}
        bends.append((c, a, d, b))
        if p:
            creases.append((d, a, b, a - 2))
    contacts = [triangles[0], triangles[1], triangles[-1]]
    return make_model(
        x,
        bars=sorted(bars),
        creases=creases,
        bends=bends,
        triangles=triangles,
        contacts=contacts,
        weights=[[1 / 3, 1 / 3, 1 / 3], [0.2, 0.3, 0.5], [0.6, 0.3, 0.1]],
        offsets=[-0.05, 0.1, -0.02],
        axes=[[-1.0, 1, 0]] * 3,
        effects=effects,
        electrodes=electrodes,
    )


def random_rotation(rng) -> np.ndarray:
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def start(model: Model, worlds=1, *, x=None, v=None) -> State:
    """A state of these positions and velocities, [N, 3] or [N, W, 3]."""
    state = State.at_rest(model, worlds, x)
    if v is not None:
        v = np.asarray(v, float)
        state.v[:] = v[:, None] if v.ndim == 2 else v
    return state


def slope(steps, errors) -> float:
    """Order of convergence: slope of log error against log step."""
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])

"""Small structures for the statics tests, written out as arrays."""

from dataclasses import replace

import numpy as np

from origami_sim.model import Model, Parameters, dihedral_angles


def model_of(position, effects, *, bars=(), creases=(), triangles=(), held=()) -> Model:
    """A model without contacts; `held` lists nodes, or (node, axis) pairs, that do not move."""
    position = np.asarray(position, float)
    free = np.ones(position.shape)
    for h in held:
        free[h] = 0.0
    return Model(
        position=position,
        free=free,
        bars=np.array(bars, int).reshape(-1, 2),
        creases=np.array(creases, int).reshape(-1, 4),
        bends=np.zeros((0, 4), int),
        triangles=np.array(triangles, int).reshape(-1, 3),
        triangle_panel=np.arange(len(triangles)),
        contacts=np.zeros((0, 3), int),
        contact_weights=np.zeros((0, 3)),
        contact_offsets=np.zeros(0),
        contact_axes=np.zeros((0, 3)),
        electrodes=np.zeros(len(creases), int),
        effects=tuple(effects),
    )


def lengths(model: Model) -> np.ndarray:
    """Reference lengths of the bars [m]."""
    return np.linalg.norm(np.diff(model.position[model.bars], axis=1)[:, 0], axis=-1)


def hinges_of(triangles) -> tuple[list, list]:
    """Edges of a mesh, and (i, j, k, l) of every edge between two triangles: l in the one that runs j -> k."""
    apex = {}
    for t in triangles:
        for a, b, c in (t, (t[1], t[2], t[0]), (t[2], t[0], t[1])):
            apex[a, b] = c
    edges = sorted({tuple(sorted(e)) for e in apex})
    return edges, [(apex[b, a], a, b, apex[a, b]) for a, b in edges if (a, b) in apex and (b, a) in apex]


def kresling() -> tuple[Model, Parameters]:
    """The cell of Liu & Paulino 2017, with unit loads downwards on the top nodes.

    Their creases stiffen within 45 degrees of folding flat; crease_stop with the crease's own stiffness is that law.
    """
    n = 8
    turn = 2 * np.pi * np.arange(n) / n
    ring = np.stack([np.cos(turn), np.sin(turn), np.zeros(n)], axis=1)
    upper = np.stack([np.cos(turn + np.pi / 4), np.sin(turn + np.pi / 4), np.ones(n)], axis=1)
    triangles = []
    for i in range(n):
        j = (i + 1) % n
        triangles += [(i, j, j + n), (i, j + n, i + n)]
    edges, creases = hinges_of(triangles)
    effects = ("ogden_bars", "crease", "crease_stop", "load")
    model = model_of(
        np.concatenate([ring, upper]), effects, bars=edges, creases=creases, triangles=triangles, held=range(n)
    )
    x = model.position
    axis = np.linalg.norm(x[model.creases[:, 2]] - x[model.creases[:, 1]], axis=-1)
    parameters = Parameters(
        model,
        {
            ("ogden_bars", "area"): 0.1,
            ("ogden_bars", "modulus"): 5e3,
            ("ogden_bars", "rest_length"): lengths(model),
            ("crease", "stiffness"): 1e-3 * axis,
            ("crease", "rest_angle"): dihedral_angles(x, model.creases),
            ("crease_stop", "stop_stiffness"): 1e-3 * axis,
            ("crease_stop", "stop_angle"): 0.75 * np.pi,
        },
    )
    parameters.set("load", "force_z", -1.0, entities=np.arange(n, 2 * n))
    return model, parameters


PLAIN = ("bars", "crease", "magnetic_torque", "load")
"""One set of effects for all small structures, so that they share their kernels."""


def truss(rise=0.3, stiffness=100.0) -> tuple[Model, Parameters]:
    """Two bars from supports at x = -1 and 1 to an apex that moves vertically, with a unit load downwards."""
    model = model_of([(-1, 0, 0), (1, 0, 0), (0, 0, rise)], PLAIN, bars=[(0, 2), (1, 2)], held=[0, 1, (2, 0), (2, 1)])
    parameters = Parameters(model, {("bars", "stiffness"): stiffness, ("bars", "rest_length"): lengths(model)})
    return model, parameters.set("load", "force_z", -1.0, entities=2)


def tent(side=0.02, stiffness=500.0) -> tuple[Model, Parameters]:
    """Two rigid panels, hinged at a ridge, that stand with four feet above a compliant ground; grams at the nodes."""
    x = [(s * side, y, 0.02 + (s == 0) * side / 2) for s in (0, 1, -1) for y in (0, side)]
    triangles = [(0, 2, 3), (0, 3, 1), (0, 1, 5), (0, 5, 4)]
    edges, creases = hinges_of(triangles)
    model = model_of(x, ("bars", "crease", "gravity", "ground"), bars=edges, creases=creases, triangles=triangles)
    model = replace(
        model,
        contacts=np.array([(2, 3, 0), (3, 2, 0), (4, 5, 0), (5, 4, 0)]),
        contact_weights=np.tile([1.0, 0, 0], (4, 1)),
        contact_offsets=np.zeros(4),
        contact_axes=np.zeros((4, 3)),
    )
    return model, Parameters(
        model,
        {
            ("bars", "stiffness"): 1e4,
            ("bars", "rest_length"): lengths(model),
            ("crease", "stiffness"): 0.05,
            ("crease", "rest_angle"): dihedral_angles(model.position, model.creases),
            ("inertia", "mass"): 1e-3,
            ("ground", "stiffness"): stiffness,
            ("plane", "reach"): 1.0,
        },
    )


def flap(*, side=0.02, stiffness=0.02, membrane=1e3, free=False) -> tuple[Model, Parameters]:
    """A triangle hinged on the y axis to another one, which is held unless `free`; it points along x."""
    x = [(0, 0, 0), (0, side, 0), (side, side / 2, 0), (-side, side / 2, 0)]
    # from node 1 to node 0 (towards -y) the left side is +x
    model = model_of(
        x,
        PLAIN,
        bars=[(0, 1), (0, 2), (1, 2), (0, 3), (1, 3)],
        creases=[(3, 1, 0, 2)],
        triangles=[(0, 2, 1)],
        held=() if free else (0, 1, 3),
    )
    parameters = Parameters(
        model,
        {
            ("bars", "stiffness"): membrane,
            ("bars", "rest_length"): lengths(model),
            ("crease", "stiffness"): stiffness,
        },
    )
    return model, parameters


def strip(cells: int, *, length=1.0, width=0.1, rigidity=1.0, membrane=1e7) -> tuple[Model, Parameters]:
    """A cantilever of hinged rigid cells along x, clamped at x <= 0, with a unit tip load along -z.

    The hinge between two cells is as soft as a cell's length of the beam, that at the clamp as half a cell's.
    """
    d = length / cells
    x = [(d * i, s * width / 2, 0) for i in range(-1, cells + 1) for s in (-1, 1)]
    triangles = []
    for i in range(cells + 1):
        a, b, c, e = 2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1
        triangles += [(a, b, c), (a, c, e)]
    edges, creases = hinges_of(triangles)
    model = model_of(x, PLAIN, bars=edges, creases=creases, triangles=triangles, held=range(4))
    along = model.position[model.creases[:, 2]] - model.position[model.creases[:, 1]]
    across = np.abs(along[:, 0]) < 1e-12
    stiffness = np.where(across, rigidity / d, 1e4 * rigidity / d)
    stiffness[across & (model.creases[:, 1:3] == 2).any(axis=1)] *= 2
    parameters = Parameters(
        model,
        {
            ("bars", "stiffness"): membrane / lengths(model),
            ("bars", "rest_length"): lengths(model),
            ("crease", "stiffness"): stiffness,
        },
    )
    parameters.set("load", "force_z", -0.5, entities=[2 * cells + 2, 2 * cells + 3])
    return model, parameters

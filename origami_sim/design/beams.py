"""Strips of two nodes per station that stand for plane beams."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from origami_sim.design.build import Sheet
from origami_sim.effects import get
from origami_sim.model import Model, Parameters


def diagonal_share(cell: float, width: float) -> float:
    """Turn of a cell's diagonal under a bending moment over the turn of the cell, for the rigidity of the sheet.

    With k = D e^2 / (A1 + A2), e^2 = w^2 + l^2 and the part w / e of the moment about the diagonal: (w / e)^4.
    """
    return (width**2 / (width**2 + cell**2)) ** 2


def as_beam(model: Model, parameters: Parameters, axial: ArrayLike):
    """Makes a strip of two nodes per station a plane beam of axial stiffness E A [N], one or by cell.

    Both corners of a station weigh alike, so that nothing twists; bars along the strip as in `stiff_along`.
    """
    pairs = parameters["inertia", "mass"].reshape(-1, 2)
    parameters.set("inertia", "mass", np.repeat(pairs.mean(axis=1), 2))
    stiff_along(model, parameters, np.broadcast_to(axial, len(pairs) - 1))


def stiff_along(model: Model, parameters: Parameters, axial: np.ndarray):
    """Gives the bars along a strip of two nodes per station, its first nodes, all of E A [N], by cell.

    By the rule for triangles they would get less the narrower the cells are, and the weight would stretch fine meshes.
    """
    length = parameters["bars", "rest_length"][:, 0]
    inside = model.bars.max(axis=1) < 2 * (len(axial) + 1)
    along = np.flatnonzero(inside & (np.abs(np.diff(model.bars, axis=1)[:, 0]) == 2))  # from a station to the next
    cell = model.bars[along].min(axis=1) // 2
    stiffness = axial[cell] / 2 / length[along]
    if ("bar_viscosity", "viscosity") in parameters:
        factor = np.sqrt(stiffness / parameters["bars", "stiffness"][along, 0])
        viscosity = parameters["bar_viscosity", "viscosity"][along, 0]
        parameters.set("bar_viscosity", "viscosity", viscosity * factor, along)
    parameters.set("bars", "stiffness", stiffness, along)


def crossed(model: Model, parameters: Parameters) -> tuple[Model, Parameters]:
    """Gives each cell of a strip of two nodes per station its other diagonal, and each of both half the stiffness.

    One diagonal alone skews a cell that is pressed, so that its corners slip and land unlike: the strip stands on its
    left and right by turns, whatever the cells.
    """
    near = np.abs(np.diff(model.bars // 2, axis=1)[:, 0]) == 1
    slanted = np.flatnonzero(near & (model.bars.sum(axis=1) % 2 == 1))  # between the sides of neighbouring stations
    other = model.bars[slanted] ^ 1
    both = replace(model, bars=np.concatenate([model.bars, other]).astype(np.int32))
    out = Parameters(both)
    for owner, name in parameters:
        value = parameters[owner, name]
        if owner in model.effects and get(owner).family == "bar":
            value = np.concatenate([value, value[slanted]])
            if name in ("stiffness", "viscosity"):
                value[slanted] *= 0.5
                value[len(model.bars) :] *= 0.5
        out.set(owner, name, value)
    return both, out


def along_strip(sheet: Sheet, word: str) -> list[str]:
    """Names of the creases of a strip along x, counted from its first end: "station 1", "station 2"."""
    order = np.argsort(sheet.mesh.vertices[sheet.mesh.creases[:, 1], 0], kind="stable")
    rank = np.empty(len(order), int)
    rank[order] = np.arange(1, len(order) + 1)
    return [f"{word} {k}" for k in rank]

"""Rigid bodies: mass, centre of mass and inertia tensor of every panel, and the model whose panels do not deform.

A rigid panel of any mass, centre and inertia is carried by four equal masses at the corners of a tetrahedron, which has
the same six second moments. They are nodes like others, so that every law that acts on masses (weight, drag by mass)
acts on the true body, off its mid-plane if that is where it lies.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from origami_sim.effects import SHELLS, get
from origami_sim.errors import InputError
from origami_sim.model.model import STATED, Model, Parameters, node_mass

TETRAHEDRON = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
"""Corners whose mean is zero and whose mean square along every axis is one."""

ELASTIC = ("bars", "bar_viscosity", "panel_bending", "panel_viscosity", "eccentric_weight")
"""Effects that only keep panels in shape, or that say where their mass lies; rigid panels have no need of them."""

SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Rows and columns of the six numbers of a symmetric tensor: xx, yy, zz, xy, xz, yz."""


def second_moments(inertia: np.ndarray) -> np.ndarray:
    """Second moments [3, 3] [kg m^2] (integral of x x^T dm) that belong to an inertia tensor [3, 3]."""
    return 0.5 * np.trace(inertia) * np.eye(3) - inertia


def inertia_tensor(moments: np.ndarray) -> np.ndarray:
    """Inertia tensor [3, 3] [kg m^2] that belongs to second moments [3, 3]."""
    return np.trace(moments) * np.eye(3) - moments


def mass_points(mass: float, centre: np.ndarray, inertia: np.ndarray) -> np.ndarray:
    """Places [4, 3] [m] at which four equal masses have this mass, centre of mass and inertia tensor about it."""
    size, axes = np.linalg.eigh(second_moments(inertia) / mass)
    return centre + TETRAHEDRON * np.sqrt(np.maximum(size, 0.0)) @ axes.T


def triangle(corners: np.ndarray, mass: float, thickness: float) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre (3,) and second moments [3, 3] about the origin of a uniform triangular prism."""
    centre = corners.mean(axis=0)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal = normal / np.linalg.norm(normal)
    spread = (corners.T @ corners + 9 * np.outer(centre, centre)) / 12 + thickness**2 / 12 * np.outer(normal, normal)
    return mass, centre, mass * spread


def rectangle(
    centre: np.ndarray, size: np.ndarray, thickness: float, normal: np.ndarray, mass: float
) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre and second moments [3, 3] about the origin of a uniform block, its sides along x and y if flat."""
    along = np.eye(3)[np.argmin(np.abs(normal[:2]))]  # the axis that lies more nearly in the plane
    along = along - normal * (along @ normal)
    along = along / np.linalg.norm(along)
    across = np.cross(normal, along)
    if np.argmin(np.abs(normal[:2])) == 1:
        along, across = across, along
    spread = sum(
        length**2 / 12 * np.outer(e, e) for length, e in ((size[0], along), (size[1], across), (thickness, normal))
    )
    return mass, centre, mass * (spread + np.outer(centre, centre))


def check_body(mass: float, inertia: np.ndarray, field: str) -> None:
    """Refuses a mass or an inertia tensor that no body can have.

    Raises:
        InputError: not finite, mass not positive, tensor not symmetric, or a principal moment that is larger than the
            sum of the two others.
    """
    if not (np.isfinite(mass) and mass > 0):
        raise InputError("a body needs a positive mass", field=f"{field}.mass", value=mass, allowed="> 0 kg")
    good = inertia.shape == (3, 3) and np.all(np.isfinite(inertia)) and np.allclose(inertia, inertia.T, rtol=1e-9)
    moments = np.linalg.eigvalsh(second_moments(inertia)) if good else np.array([-1.0])
    if not good or moments.min() < -1e-9 * np.abs(moments).max():
        raise InputError(
            "no body has this inertia",
            field=f"{field}.inertia",
            value=np.asarray(inertia).tolist(),
            allowed="a symmetric tensor [kg m^2] of which no principal moment exceeds the sum of the two others",
        )


def rigid(model: Model, parameters: Parameters) -> tuple[Model, Parameters]:
    """The model with rigid panels, and its parameters: hinges and bodies in place of bars.

    Bars and bending lines go. Where the parameters state bodies (`Sheet.build` does), each panel gets the mass, centre
    and full inertia of its body by four mass points, nodes after those of the model; else node masses stay as they are.

    Raises:
        InputError: an effect that bends or stretches panels.
    """
    if model.panels == "rigid":
        return model, parameters
    bending = [n for n in model.effects if get(n).family in ("bar", "bend", *SHELLS) and n not in ELASTIC]
    if bending:
        raise InputError(
            "rigid panels neither bend nor stretch",
            field="panels",
            value=", ".join(bending),
            allowed="panels='elastic'",
        )
    stated = {n: v for n, v in parameters.of("body").items()}
    mass = stated["mass"]
    with_bodies = bool(len(mass)) and bool(np.all(mass > 0))
    worlds = max(v.shape[1] for v in stated.values())
    if with_bodies and worlds > 1:
        raise InputError("bodies are given for one world", field="body", value=worlds, allowed="1")
    n, carriers, position = len(model.position), np.zeros(0, np.int32), model.position
    if with_bodies:
        points = []
        for p in range(len(mass)):
            centre, tensor = body_of(parameters, p)
            points.append(mass_points(float(mass[p, 0]), centre, tensor))
        carriers = np.repeat(np.arange(len(mass), dtype=np.int32), 4)
        position = np.concatenate([position, *points])
    effects = tuple(e for e in model.effects if e not in ELASTIC or (e == "eccentric_weight" and not with_bodies))
    out = replace(
        model,
        position=position,
        free=np.concatenate([model.free, np.ones((len(carriers), 3))]),
        bars=np.zeros((0, 2), np.int32),
        bends=np.zeros((0, 4), np.int32),
        electrodes=model.electrodes[: len(model.creases)],
        effects=effects,
        panels="rigid",
        carriers=carriers,
        grips=np.append(model.grips, np.full(len(carriers), -1, np.int32)) if len(model.grips) else model.grips,
    )
    given = Parameters(out)
    for owner, name in given:
        old = parameters[owner, name]
        family = get(owner).family if owner not in STATED else ""
        if (family == "node" or owner == "inertia") and len(carriers):
            new = np.zeros((n + len(carriers), *old.shape[1:])) + given[owner, name][0]
            new[:n] = old
            if owner == "inertia":
                new[:n], new[n:] = 0.0, np.repeat(mass, 4, axis=0) / 4
            elif "mass" in get(owner).arguments:  # laws of the mass act where the mass is
                new[n:] = old[[int(np.flatnonzero(_of_panel(model, int(p)))[0]) for p in carriers]]
        elif family == "bend":
            new = old[:0]
        else:
            new = old
        given.replace(owner, name, new)
    return out, given


def eccentric(model: Model, parameters: Parameters) -> Callable[[np.ndarray], np.ndarray] | None:
    """How far eccentric weights move the mass points of rigid panels off the mid-plane; None: there are none.

    With its mass points there, a panel has the inertia of such a weight as well, and what `gravity` pulls at it, which
    the law of `centred` parameters then lacks.

    Returns: of positions [N, W, 3] [m] the displacements [N, W, 3] [m] that the centres of the panels' masses need.
    """
    if "eccentric_weight" not in model.effects or not len(model.carriers):
        return None
    moment = parameters["eccentric_weight", "mass"] * parameters["eccentric_weight", "offset"]
    if not np.any(moment):
        return None
    first = len(model.position) - len(model.carriers)
    points = {p: first + np.flatnonzero(model.carriers == p) for p in np.unique(model.carriers)}
    mass = node_mass(model, parameters)

    def displacement(x: np.ndarray) -> np.ndarray:
        a, b, c = (x[model.triangles[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        along = moment[:, :, None] * normal / np.linalg.norm(normal, axis=2, keepdims=True)
        out = np.zeros_like(x)
        for panel, mine in points.items():
            out[mine] = along[model.triangle_panel == panel].sum(axis=0) / mass[mine].sum(axis=0)[:, None]
        return out

    return displacement


def centred(model: Model, parameters: Parameters) -> Parameters:
    """The parameters of a model whose mass points lie where eccentric weights move them: the law without `gravity`."""
    out = parameters.copy()
    if "gravity" in model.effects:
        first = len(model.position) - len(model.carriers)
        of = [first + int(np.flatnonzero(model.carriers == p)[0]) for p in model.triangle_panel]
        for axis in ("gravity_x", "gravity_y", "gravity_z"):
            out.replace("eccentric_weight", axis, out["eccentric_weight", axis] - out["gravity", axis][of])
    return out


def body_of(parameters: Parameters, panel: int) -> tuple[np.ndarray, np.ndarray]:
    """Centre of mass (3,) [m] in the reference state and inertia tensor [3, 3] about it [kg m^2] of a panel's body."""
    body = parameters.of("body")
    centre = np.array([body[f"centre_{a}"][panel, 0] for a in "xyz"])
    tensor = np.zeros((3, 3))
    for a, b in SYMMETRIC:
        tensor[a, b] = tensor[b, a] = body[f"inertia_{'xyz'[a]}{'xyz'[b]}"][panel, 0]
    return centre, tensor


def _of_panel(model: Model, panel: int) -> np.ndarray:
    out = np.zeros(len(model.position), bool)
    out[model.triangles[model.triangle_panel == panel]] = True
    return out

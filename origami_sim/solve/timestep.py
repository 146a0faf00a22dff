"""The largest stable time step of the explicit solver, from the stiffest element."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from origami_sim.effects import CONTACTS, HINGES, PAIRS, Effect, get
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, curvature, node_mass

SAFETY = 0.8
"""Fraction of the stability limit that is used unless a step is given."""

RIGID = "rigid panels"
"""Cause of a step that has no bound, because the solver adapts it."""

AT_REST = "equilibria along time"
"""Likewise, of a quasi-static motion."""

CROWD = 4.0 / 3.0
"""Square of what stands for the gradients of all pairs that touch at once at a corner of a triangle.

Six triangles meet at a node inside a mesh, and 24 times a pair's stiffness pushes it where the node meets another node:
twelve pairs of a corner with the triangles around the other. Half of it suffices for what meets triangles only; double
would make the step 0.5 to 0.8 times as long, by the damping.
"""

SCALINGS, SETTLED = 20, 0.01
"""Scalings of the nodes that are tried at most for a closer bound; relative gain below which there are enough."""


@dataclass(frozen=True)
class TimeStep:
    """A stable step and the reason for it.

    Attributes:
        limit: bound on stable steps over all worlds [s].
        dt: the step recommended, SAFETY * limit [s].
        node: node whose elements are the stiffest for its mass. cause: the element there which contributes most.
    """

    limit: float
    dt: float
    node: int
    cause: str

    def __str__(self):
        if self.cause in (RIGID, AT_REST):
            return f"each step by its error ({self.cause})"
        if np.isinf(self.limit):
            return "nothing limits the time step"
        limit = f"{SAFETY:g} of the limit {self.limit:.3g} s set at node {self.node} by {self.cause}"
        return f"dt = {self.dt:.3g} s ({limit})"


def gradient_norms(model: Model, family: str) -> tuple[np.ndarray, np.ndarray]:
    """Nodes [n, k] of the elements of a family and the norms of their coordinate's gradient there [n, k]."""
    x = model.position
    if family == "node":
        return np.arange(len(x))[:, None], np.ones((len(x), 1))
    if family == "bar":
        return model.bars, np.ones(model.bars.shape)
    if family in HINGES:
        h = model.creases if family == "crease" else model.bends
        i, j, k, m = (x[h[:, c]] for c in range(4))
        e = k - j
        ee = (e**2).sum(-1)
        n1, n2 = np.cross(i - j, e), np.cross(e, m - j)
        gi, gl = (np.sqrt(ee) / np.linalg.norm(n, axis=-1) for n in (n1, n2))
        ai, al = ((i - j) * e).sum(-1) / ee, ((m - j) * e).sum(-1) / ee
        # on the axis the two sides add as vectors; their lengths bound the sum at every fold angle
        gj = np.abs(1 - ai) * gi + np.abs(1 - al) * gl
        gk = np.abs(ai) * gi + np.abs(al) * gl
        return h, np.stack([gi, gj, gk, gl], axis=1)
    if family == "membrane":
        a, b, c = (x[model.triangles[:, i]] for i in range(3))
        twice = np.linalg.norm(np.cross(b - a, c - a), axis=-1)
        return model.triangles, np.stack([np.linalg.norm(s, axis=-1) / twice for s in (c - b, a - c, b - a)], axis=1)
    if family == "plate":
        return _plate_norms(model)
    if family in PAIRS:
        return model.triangles, np.full(model.triangles.shape, np.sqrt(CROWD))
    if family in CONTACTS:
        a, b, c = (x[model.contacts[:, i]] for i in range(3))
        area = np.linalg.norm(np.cross(b - a, c - a), axis=-1)
        slopes = np.stack([np.linalg.norm(s, axis=-1) / area for s in (c - b, a - c, b - a)], axis=1)
        return model.contacts, np.abs(model.contact_weights) + np.abs(model.contact_offsets)[:, None] * slopes
    raise KeyError(family)


def _plate_norms(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Nodes [R, k] of the rows of curvature (padded by the first with nothing) and the gradient's norms there [R, k].

    They are those of the reference state, where the parts of a row's hinges add or cancel along one normal; folds of a
    sheet that is fine enough to be one stay small.
    """
    rows, x = curvature.of(model), model.position
    hinges, n, count = model.bends[rows.hinge], len(x), len(rows.triangle)
    weight = rows.weight * np.sqrt([1.0, 1.0, 0.5])  # the norm counts the shear component, not its double, twice
    slopes = [weight[:, :, None] * g[rows.hinge][:, None] for g in _hinge_gradients(x, model.bends)]
    place = (rows.row[:, None] * n + hinges).T.ravel()
    found, index = np.unique(place, return_inverse=True)
    total = np.zeros((len(found), 3, 3))
    np.add.at(total, index, np.concatenate(slopes))
    norm = np.sqrt((total**2).sum((1, 2)))
    row = found // n
    column = np.arange(len(found)) - np.searchsorted(row, row)
    nodes = np.zeros((count, int(column.max(initial=-1)) + 1), np.int64)
    norms = np.zeros(nodes.shape)
    nodes[:] = found[np.searchsorted(row, np.arange(count))][:, None] % n
    nodes[row, column], norms[row, column] = found % n, norm
    return nodes, norms


def _hinge_gradients(x: np.ndarray, hinges: np.ndarray) -> list[np.ndarray]:
    """Gradients [Q, 3] of the fold angles at the nodes i, j, k and l."""
    i, j, k, m = (x[hinges[:, c]] for c in range(4))
    e = k - j
    ee = (e**2).sum(-1, keepdims=True)
    n1, n2 = np.cross(i - j, e), np.cross(e, m - j)
    gi, gl = (n * np.sqrt(ee) / (n**2).sum(-1, keepdims=True) for n in (n1, n2))
    ai, al = (((p - j) * e).sum(-1, keepdims=True) / ee for p in (i, m))
    return [gi, -(1 - ai) * gi - (1 - al) * gl, -ai * gi - al * gl, gl]


def _per_element(model: Model, family: str, k: np.ndarray) -> np.ndarray:
    """Stiffness of the elements of a family, from that of its entities [E, W]: of triangles it is given per area."""
    if family == "membrane":
        return k * curvature.of(model).area[:, None]
    if family == "plate":
        rows = curvature.of(model)
        return np.broadcast_to(k, (len(model.triangles), k.shape[1]))[rows.triangle] * rows.share[:, None]
    return k


def stable_step(model: Model, parameters: Parameters) -> TimeStep:
    """Bound on the step by the row sums of the mass-scaled stiffness and damping (a block Gershgorin bound).

    With lambda_i = sum over elements of k |g_i| sum_j |g_j| / m_i, every frequency is below sqrt(max lambda); central
    differences are then stable for dt <= 2 / omega (sqrt(1 + 4 zeta^2) - 2 zeta), with the damping taken at a predicted
    velocity. The nodes are scaled so that their row sums become alike, by which the bound comes down to the largest
    eigenvalue of the matrix of norms (Collatz-Wielandt; Varga 2000, theorem 2.2): at any scaling it is a bound.

    Raises:
        InputError: parameters for different numbers of worlds.
    """
    n, worlds = len(model.position), parameters.worlds
    if model.panels == "rigid":  # the solver takes its steps by the error that it makes
        return TimeStep(np.inf, np.inf, 0, RIGID)
    for owner, name in parameters:
        if (given := parameters[owner, name].shape[1]) not in (1, worlds):
            raise InputError(
                "parameters are given for different numbers of worlds",
                field=f"{owner}.{name}",
                value=given,
                allowed=f"1 or {worlds}",
            )
    free = model.free.max(axis=1) > 0
    mass = np.broadcast_to(node_mass(model, parameters), (n, worlds))
    laws = [e for e in map(get, model.laws) if e.family != "triangle" and model.count(e.family)]
    families: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for f in dict.fromkeys(e.family for e in laws):
        nodes, norms = gradient_norms(model, f)
        families[f] = nodes, norms * free[nodes]
    first = dict(zip(families, np.cumsum([0, *(len(nodes) for nodes, _ in families.values())]), strict=False))
    total = sum(len(nodes) for nodes, _ in families.values())
    slopes = {kind: np.zeros((total, worlds)) for kind in ("stiffness", "damping")}  # of all elements
    stiffest: list[tuple[Effect, np.ndarray]] = []
    for effect in laws:
        nodes, _ = families[effect.family]
        own = {"mass": parameters["inertia", "mass"]} if effect.family == "node" else {}
        for kind, sums in slopes.items():
            slope = getattr(effect, kind)
            if slope is None:
                continue
            k = _per_element(model, effect.family, slope({**own, **parameters.of(effect.name)}))
            k = np.broadcast_to(k, (len(nodes), worlds))
            sums[first[effect.family] : first[effect.family] + len(nodes)] += k
            if kind == "stiffness":
                stiffest.append((effect, k))
    entries = [
        (norms.ravel(), nodes.ravel(), np.repeat(first[f] + np.arange(len(nodes)), nodes.shape[1]))
        for f, (nodes, norms) in families.items()
    ]
    value, row, column = (np.concatenate([e[k] for e in entries] or [np.zeros(0, int)]) for k in range(3))
    norm = sp.csr_array((value, (row, column)), shape=(n, total))  # of each element's gradient
    across = sp.csr_array(norm.T)

    x = np.ones((n, worlds))
    limit, plain = np.zeros(worlds), None
    for _ in range(SCALINGS):
        y = across @ x
        square, rate = (norm @ (k * y) / (mass * x) for k in (slopes["stiffness"], slopes["damping"]))
        with np.errstate(divide="ignore"):
            # the damping is taken with a prediction of the velocity, whose limit lies at half the usual one
            limits = 2.0 / (rate + np.sqrt(rate**2 + square))
        plain = limits if plain is None else plain
        best = limits.min(axis=0)
        settled = np.all((best <= limit * (1 + SETTLED)) | np.isinf(best))
        limit = np.maximum(limit, best)
        if settled:
            break
        h = np.where(np.isfinite(limit), limit, 0.0)
        growth = h**2 / 4.0 * square + h * rate  # 1 at all nodes if the sums are alike
        x = x * np.maximum(growth / np.maximum(growth.max(axis=0), 1e-300), 1e-6)
        x = np.maximum(x / x.max(axis=0), 1e-100)
    assert plain is not None
    w = int(np.argmin(limit))
    i = int(np.argmin(plain[:, w]))
    largest, cause = 0.0, "damping"
    for effect, k in stiffest:
        nodes, norms = families[effect.family]
        row = np.where(nodes == i, k[:, [w]] * norms * norms.sum(axis=1, keepdims=True), 0.0).max(axis=1, initial=0.0)
        if row.max(initial=0.0) > largest:
            at = int(np.argmax(row)) if effect.family != "plate" else int(curvature.of(model).triangle[np.argmax(row)])
            largest, cause = row.max(), f"{model.name(effect.family, at)} ({effect.name})"
    return TimeStep(limit=float(limit[w]), dt=SAFETY * float(limit[w]), node=i, cause=cause)

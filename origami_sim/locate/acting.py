"""What one moment or force alone could be the mismatch: at a crease, across a panel, or turning a panel.

The forces that a recorded motion needs beyond the model's (`locate.py`) are those of the tree's coordinates. A moment
at a crease acts on the fold there and on no other; a force on a panel acts on all folds between it and what holds the
device. For each such action, whatever its size from window to window, it is counted how much of what is missing it
leaves, in the covariance that the noise of accelerations and inexact forces of the model give; its size in each window
is the one that leaves least.
"""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from origami_sim.locate.locate import Motion, against, bins, way
from origami_sim.locate.places import REVERSAL, Acting, Curve
from origami_sim.model.articulation import Articulation

SAME = 0.999
"""|cos| from which on two actions are one."""

INEXACT = 0.01
"""Part of the model's own forces by which they may be wrong, as numbers are not known exactly and no panel is rigid.

On strips with known forces on panels, the uncertainty of the refitted numbers and of the angles is too little (nothing
missing then looks like a moment), and with half as much the wrong panel can come first.
"""

DRAWN = 6
"""Actions, the best, whose size is given, and which the page lists."""

BLIND = 10.0
"""Times the median error of a size beyond which a window tells nothing of it, as the action has no lever there."""

SEEN = 5.0
"""Standard deviations by which what is missing must exceed the noise for anything to be said of it."""


def acting(arm: Articulation, motions: Sequence[Motion]) -> list[Acting]:
    """Actions that could alone be what is missing, best first; those that are the same under one name.

    Returns: nothing where fewer than two folds are measured, or only noise is missing.
    """
    if not motions or len(arm.creases) < 2 or motions[0].told.sum() < 2:
        return []
    needed: list[np.ndarray] = []
    sites: dict[Site, list[np.ndarray]] = {}
    for m in motions:
        white = _whitener(m)
        needed.append(np.einsum("wmn,nw->wm", white, m.mean(m.missing)[m.told]))
        for site, direction in _actions(arm, m).items():
            d = np.einsum("wmn,nw->wm", white, m.mean(direction)[m.told])
            sites.setdefault(site, []).append(d)
    y = np.concatenate(needed)
    total, freedom = float(np.sum(y**2)), y.size
    if total - freedom < SEEN * np.sqrt(2.0 * freedom):
        return []
    reach = {site: [np.maximum(np.linalg.norm(d, axis=1), 1e-300) for d in by] for site, by in sites.items()}
    unit = {site: np.concatenate(by) / np.concatenate(reach[site])[:, None] for site, by in sites.items()}
    rest = {site: max(total - float(np.sum(np.sum(u * y, axis=1) ** 2)), 0.0) for site, u in unit.items()}
    weight = np.sum(y**2, axis=1)

    def overlap(a: Site, b: Site) -> float:
        """|cos| of two actions, where something is missing."""
        return float(np.sqrt(np.average(np.sum(unit[a] * unit[b], axis=1) ** 2, weights=weight)))

    found: dict[Site, Acting] = {}
    for site in sorted(rest, key=lambda s: rest[s]):
        twin = next((s for s in found if overlap(site, s) > SAME), None)
        if twin:
            found[twin].same.append(" ".join(site))
        else:
            what, where = site
            left = float(np.sqrt(rest[site] / (freedom - len(y))))
            found[site] = Acting(what, where, left, [], "", 0.0, "N" if what.startswith("force") else "N m")
    for site, a in found.items():
        others = {s: overlap(site, s) for s in found if s != site}
        if others:
            nearest = max(others, key=lambda s: others[s])
            a.like, a.overlap = " ".join(nearest), others[nearest]
    beside = _beside(arm)
    for site, a in list(found.items())[:DRAWN]:
        sizes = [np.sum(d * n, axis=1) / r**2 for d, n, r in zip(sites[site], needed, reach[site], strict=True)]
        a.curves = _curves(motions, beside[site], sizes, [1.0 / r for r in reach[site]])
    return list(found.values())


def _curves(
    motions: Sequence[Motion], k: int, sizes: Sequence[np.ndarray], errors: Sequence[np.ndarray]
) -> list[Curve]:
    """The size of an action in windows: in time, and in bins of what it may go with at a coordinate."""
    first, size, error = motions[0], np.concatenate(sizes), np.concatenate(errors)
    weight, seen = 1.0 / error**2, error < BLIND * np.median(error)
    head = np.flatnonzero(seen[: len(sizes[0])])
    if not len(head):
        return []
    times = first.mean(first.times)[head].tolist()
    out = [Curve("time", "s", times, size[head].tolist(), error[head].tolist(), [first.width] * len(head))]
    along = size * np.concatenate([m.middle(way(m.rate[k])) for m in motions])
    for (name, unit), each in against(motions, k).items():
        x = np.concatenate([m.middle(v) for m, v in zip(motions, each, strict=True)])
        y = along if name == REVERSAL else size
        parts = bins(np.where(seen, x, np.nan))
        out.append(
            Curve(
                name,
                unit,
                [float(x[p].mean()) for p in parts],
                [float(np.average(y[p], weights=weight[p])) for p in parts],
                [float(weight[p].sum() ** -0.5) for p in parts],
                [len(p) for p in parts],
            )
        )
    return out


def _beside(arm: Articulation) -> "dict[Site, int]":
    """Coordinate of the crease of each action: of a panel, the one that moves it."""
    out: dict[Site, int] = {}
    for k, c in enumerate(arm.creases, arm.size - len(arm.creases)):
        out.setdefault(("moment at", arm.model.name("crease", int(c))), k)
    for p, (_, hinge) in arm.outer.items():
        for what in ("force across", "moment on"):
            out.setdefault((what, arm.model.name("panel", p)), hinge)
    return out


Site = tuple[str, str]
"""What acts, and where."""


def _whitener(m: Motion) -> np.ndarray:
    """[w, m, m] per window: makes the noise of the missing forces that are told independent, of unit variance."""
    by = m.mean(m.inertia)[m.told][:, m.told] * (m.calmer * m.noise[m.told])[:, None]
    covariance = np.einsum("mkw,nkw->wmn", by, by) + np.diag((INEXACT * m.modelled[m.told].std(axis=1)) ** 2)
    return np.linalg.inv(np.linalg.cholesky(covariance))


def _actions(arm: Articulation, m: Motion) -> dict[Site, np.ndarray]:
    """What actions of unit size do to the coordinates, each [m, n]; creases or panels of one name act together."""
    model, pose = arm.model, m.pose
    x = arm.positions(pose)
    jacobian, turning = arm.jacobian(pose, x), arm.turning(x)
    out: dict[Site, np.ndarray] = defaultdict(lambda: np.zeros((arm.size, pose.worlds)))
    for k, c in enumerate(arm.creases, arm.size - len(arm.creases)):
        out["moment at", model.name("crease", int(c))][k] += 1.0
    for p, (nodes, hinge) in arm.outer.items():
        a, b, c = model.triangles[np.flatnonzero(model.triangle_panel == p)[0]]
        normal = np.cross(x[b] - x[a], x[c] - x[a])
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        name = model.name("panel", p)
        out["force across", name] += np.einsum("mnwa,wa->mw", jacobian[:, nodes], normal) / len(nodes)
        out["moment on", name] += np.einsum("mwa,wa->mw", turning[p], turning[p][hinge])
    return out

"""What one moment or force alone could be the mismatch: at a crease, across a panel, or turning a panel.

The forces that a recorded motion needs beyond the model's (`locate.py`) are those of the tree's coordinates. A moment
at a crease acts on the fold there and on no other; a force on a panel acts on all folds between it and what holds the
device. For each such action, whatever its size from window to window, it is counted how much of what is missing it
leaves, in the covariance that the noise of accelerations and inexact forces of the model give.
"""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from origami_sim.diagnose.articulation import Articulation
from origami_sim.diagnose.diagnosis import Acting
from origami_sim.diagnose.locate import Motion

SAME = 0.999
"""|cos| from which on two actions are one."""

INEXACT = 0.01
"""Part of the model's own forces by which they may be wrong, as numbers are not known exactly and no panel is rigid.

On strips with known forces on panels, the uncertainty of the refitted numbers and of the angles is too little (nothing
missing then looks like a moment), and with half as much the wrong panel can come first.
"""

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
            sites.setdefault(site, []).append(d / np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-300))
    y = np.concatenate(needed)
    total, freedom = float(np.sum(y**2)), y.size
    if total - freedom < SEEN * np.sqrt(2.0 * freedom):
        return []
    unit = {site: np.concatenate(u) for site, u in sites.items()}
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
            found[site] = Acting(what, where, float(np.sqrt(rest[site] / (freedom - len(y)))), [], "", 0.0)
    for site, a in found.items():
        others = {s: overlap(site, s) for s in found if s != site}
        if others:
            nearest = max(others, key=lambda s: others[s])
            a.like, a.overlap = " ".join(nearest), others[nearest]
    return list(found.values())


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

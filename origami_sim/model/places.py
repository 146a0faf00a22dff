"""Places on a device that follow from its form: stretches, ends and middle of a beam, the plane of its folds."""

import numpy as np

from origami_sim.model.model import Model

Place = tuple[str, str, tuple[int, ...]]
"""A place in words, its kind (crease, panel or body), and the entities of a family that are there."""

SLENDER = 4.0
"""Length over width of what is taken as a beam. At 2 a square box with flaps would be one, at 8 a short bender none."""

PARTS = {3: ("first third", "middle third", "last third"), 4: ("first", "second", "third", "last")}
"""Stretches into which a beam is divided, by their number. Quarters tell where, thirds hold what lies in the middle."""

STATIONS = 2
"""Places along a beam that a stretch has at least: with 1 it would be a crease or a panel, with 4 short chains of cells
would have none."""


def along(model: Model, points: np.ndarray) -> np.ndarray | None:
    """Place of points [n, 3] along a slender device, 0 at its first and 1 at its last end; None if it is no beam.

    The first end is the one that is held, if one is, else that of the lower coordinates.
    """
    corners = model.position[: len(model.position) - len(model.carriers)]
    middle = corners.mean(axis=0)
    axes = np.linalg.svd(corners - middle, full_matrices=False)[2]
    extent = np.ptp((corners - middle) @ axes.T, axis=0)
    if extent[0] < SLENDER * max(extent[1:], default=0.0) or not extent[0]:
        return None
    axis = axes[0] * np.sign(axes[0][np.argmax(np.abs(axes[0]))])
    at = (corners - middle) @ axis
    held = ~np.any(model.free[: len(corners)], axis=1)
    if np.any(held) and np.mean(at[held]) > 1e-6 * extent[0]:
        axis = -axis
    return ((points - middle) @ axis - np.min((corners - middle) @ axis)) / extent[0]


def along_creases(model: Model) -> np.ndarray:
    """Place of each crease (C,) along a slender device, from -1/2 to 1/2; zeros if it is no beam.

    Where a part is held, the beam begins at its first crease.
    """
    at = along(model, model.position[model.creases[:, 1:3]].mean(axis=1)) if len(model.creases) else None
    if at is None:
        return np.zeros(len(model.creases))
    first = float(at.min()) if np.any(~np.any(model.free, axis=1)) else 0.0
    return (at - first) / (1.0 - first) - 0.5


def stretches(model: Model, family: str) -> list[Place]:
    """(name, kind, entities) of stretches of a beam: the creases, bending lines or triangles of thirds and quarters.

    Empty for other families, for what is no beam, and for a division in which a stretch has fewer than two stations.
    """
    kind = {"crease": "crease", "bend": "body", "triangle": "panel"}.get(family)
    if kind is None:
        return []
    nodes = {"crease": model.creases[:, 1:3], "bend": model.bends[:, 1:3], "triangle": model.triangles}[family]
    at = along(model, model.position[nodes].mean(axis=1)) if len(nodes) else None
    if at is None:
        return []
    what = {"crease": "creases", "bend": "bending lines", "triangle": "panels"}[family]
    out = []
    for count, words in PARTS.items():
        part = np.clip(np.floor(at * count + 1e-9).astype(int), 0, count - 1)
        groups = [np.flatnonzero(part == k) for k in range(count)]
        if min(len(np.unique(np.round(at[g], 6))) for g in groups) < STATIONS:
            continue
        label = "{}" if count == 3 else "{} quarter"
        out += [
            (f"the {what} of the {label.format(w)}", kind, tuple(map(int, g)))
            for w, g in zip(words, groups, strict=True)
        ]
    return out


def points(model: Model) -> list[Place]:
    """(name, kind, nodes) of the ends and the middle of a beam, where these can move."""
    first = len(model.position) - len(model.carriers)
    at = along(model, model.position[:first])
    if at is None or len(np.unique(np.round(at, 6))) < STATIONS * max(PARTS):
        return []
    out = []
    for site, place in (("the first end", 0.0), ("the middle", 0.5), ("the last end", 1.0)):
        station = at[np.argmin(np.abs(at - place))]
        mine = np.flatnonzero(np.abs(at - station) < 1e-6)
        if np.all(np.any(model.free[mine], axis=1)):
            out.append((site, "body", tuple(map(int, mine))))
    return out


def across(model: Model) -> np.ndarray:
    """Unit vector (3,) along most creases, so across the plane in which the device folds; y where there are none."""
    lines = model.creases if len(model.creases) else model.bends
    if not len(lines):
        return np.array([0.0, 1.0, 0.0])
    edge = model.position[lines[:, 2]] - model.position[lines[:, 1]]
    return np.linalg.eigh(edge.T @ edge)[1][:, -1]

"""Meshes of flat sheets and plates on them, for the tests of shells."""

import numpy as np
from scipy.spatial import Delaunay

from origami_sim import Sheet
from origami_sim.pattern import sheet

KINDS = ("diagonal", "crossed", "skewed", "random")


def mesh(kind, nx, ny=None, size=(1.0, 1.0), seed=0):
    """Vertices [N, 3] and triangles of a rectangle of nx by ny cells; lines of nodes on its border stay as they are."""
    ny = ny or nx
    x, y = np.meshgrid(np.linspace(0, 1, nx + 1), np.linspace(0, 1, ny + 1), indexing="ij")
    p, index = np.stack([x.ravel(), y.ravel()], axis=1), np.arange(x.size).reshape(x.shape)
    a, b, c, d = (q.ravel() for q in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    if kind == "crossed":
        middle = len(p) + np.arange(len(a))
        triangles = np.concatenate([np.stack([q, r, middle], 1) for q, r in ((a, b), (b, c), (c, d), (d, a))])
        p = np.concatenate([p, p[np.stack([a, b, c, d])].mean(axis=0)])
    if kind == "skewed":
        bump = np.sin(np.pi * p[:, 1]) * np.array([np.sin(np.pi * p[:, 0]), np.sin(2 * np.pi * p[:, 0])])
        p = p + 0.06 * bump.T
    if kind == "random":
        inner = np.all((p > 1e-9) & (p < 1 - 1e-9), axis=1)
        cells = np.array([nx, ny])
        p[inner] += np.random.default_rng(seed).uniform(-0.3, 0.3, (inner.sum(), 2)) / cells
        triangles = Delaunay(p * cells).simplices
        q, r = p[triangles[:, 1]] - p[triangles[:, 0]], p[triangles[:, 2]] - p[triangles[:, 0]]
        twice = q[:, 0] * r[:, 1] - q[:, 1] * r[:, 0]
        triangles = np.where(twice[:, None] > 0, triangles, triangles[:, ::-1])[np.abs(twice) * nx * ny > 1e-6]
    return np.column_stack([p * size, np.zeros(len(p))]), triangles


def disc(rings):
    """Vertices and triangles of the unit disc: rings of 6, 12, 18 ... nodes around one."""
    turns = [2 * np.pi * np.arange(6 * k) / (6 * k) for k in range(1, rings + 1)]
    radius = np.repeat(np.arange(1, rings + 1) / rings, [len(t) for t in turns])
    a = np.concatenate(turns)
    x = np.vstack([np.zeros((1, 3)), np.column_stack([radius * np.cos(a), radius * np.sin(a), 0 * a])])
    return x, Delaunay(x[:, :2]).simplices


def joined(*parts):
    """Meshes joined at nodes in the same place."""
    x = np.concatenate([p for p, _ in parts])
    first = np.cumsum([0, *(len(p) for p, _ in parts)])
    triangles = np.concatenate([t + n for (_, t), n in zip(parts, first, strict=False)])
    every, index = np.unique(np.round(x, 9), axis=0, return_inverse=True)
    used, triangles = np.unique(index.ravel()[triangles], return_inverse=True)
    return every[used], triangles.reshape(-1, 3)


def rimmed(kind, n):
    """The unit square with a row of cells around it, to be held: its border is clamped."""
    rim, around = mesh("diagonal", n + 2)
    rim[:, :2] = (rim[:, :2] - 0.5) * (n + 2) / n + 0.5
    middle = rim[around].mean(axis=1)[:, :2]
    return joined(mesh(kind, n), (rim, around[np.any((middle < 0) | (middle > 1), axis=1)]))


def rimmed_end(kind, nx, ny, width):
    """A strip of unit length with one more column of cells before its beginning, to be held."""
    held, triangles = mesh("diagonal", 1, ny, size=(1 / nx, width))
    return joined(mesh(kind, nx, ny, size=(1.0, width)), (held - [1 / nx, 0, 0], triangles))


def plate(x, triangles, *, thickness=1e-3, modulus=1e9, held=(), axes="xyz", **shell):
    """Model and parameters of a shell held at some nodes, with a load effect."""
    s = Sheet(sheet(x, triangles), thickness=thickness, modulus=modulus, density=1000.0, membrane_damping=0.0)
    s.shell(**shell).fix(nodes=held, axes=axes)
    return s.on("load").build()


def tributary(x, triangles):
    """Area of each node [N]."""
    corners = x[triangles]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    out = np.zeros(len(x))
    np.add.at(out, triangles.ravel(), np.repeat(area / 3, 3))
    return out


def border(x, size=(1.0, 1.0)):
    """Nodes on the border of the rectangle from the origin, and beyond it."""
    return np.flatnonzero(np.any((x[:, :2] < 1e-9) | (x[:, :2] > np.array(size) - 1e-9), axis=1))


def at(x, w, place):
    """A nodal quantity at a place in the plane, by a quadratic through the nearest nodes."""
    d = x[:, :2] - place
    near = np.argsort((d**2).sum(axis=1))[:9]
    a, b = d[near].T
    return np.linalg.lstsq(np.column_stack([np.ones(9), a, b, a * a, a * b, b * b]), w[near], rcond=None)[0][0]

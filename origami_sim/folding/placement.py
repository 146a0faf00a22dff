"""A shape from angles alone: panels turned to given fold angles, as consistently as the angles allow.

What a sheet looks like at given fold angles follows from one panel to the next, by turning each about the crease it
shares with the last. Around a vertex the turns may not close; here all frames are found at once, as the least squares
of all hinges (rotation-invariant coordinates: Lipman, Sorkine, Levin and Cohen-Or 2005, doi:10.1145/1073204.1073217),
and the nodes from the frames by a Poisson equation. The result starts a search where following the sheet from flat
ends in a cul-de-sac: patterns that cannot fold rigidly have many.
"""

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from scipy.sparse.csgraph import connected_components

from .elastic import Elastic, Shape

LOOSE = 0.1
"""Weight of the lines inside panels, taken as flat, beside that of driven creases: panels may bend. Half and
double fold the same of 20 public patterns; a start need not be exact."""
TINY = 1e-10
"""Added to the diagonals, which have a null space where parts of a sheet hang together by a vertex. Half
and double change nothing: it is far below all else and far above rounding."""


class Placement:
    """Places the panels of a sheet at given angles; see `Elastic`."""

    def __init__(self, sheet: Elastic):
        self.sheet, mesh, x = sheet, sheet.mesh, sheet.reference
        triangles = mesh.triangles
        sides = {}
        for t, (a, b, c) in enumerate(triangles.tolist()):
            sides |= {(a, b): t, (b, c): t, (c, a): t}
        axes = sheet.hinges[:, 1:3].tolist()
        self.left = np.array([sides[j, k] for j, k in axes], dtype=np.int64)
        self.right = np.array([sides[k, j] for j, k in axes], dtype=np.int64)
        self.roots = _roots(x[triangles].mean(axis=1), self.left, self.right)
        self.axis = (x[sheet.hinges[:, 2]] - x[sheet.hinges[:, 1]]) / sheet.axes[:, None]
        self.weight = np.where(sheet.driven, 1.0, LOOSE) * np.sqrt(sheet.axes)
        self.edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
        self.vectors = x[self.edges[:, 1]] - x[self.edges[:, 0]]
        n = len(self.edges)
        rows, columns = np.tile(np.arange(n), 2), self.edges.T.ravel()
        self.difference = sp.csr_matrix((np.repeat([-1.0, 1.0], n), (rows, columns)), shape=(n, len(x)))
        self.poisson = _factors(self.difference.T @ self.difference)

    def at(self, angles) -> Shape:
        """Return the sheet with its hinges at angles [H] [rad], as far as they are consistent."""
        frames = self._frames(angles)
        edges = np.einsum("tij,tj->ti", np.tile(frames, (3, 1, 1)), self.vectors)
        x = self.poisson.solve(np.ascontiguousarray(self.difference.T @ edges))
        return Shape(x, self.sheet.angles(x, angles))

    def _frames(self, angles) -> np.ndarray:
        """Return the rotations [T, 3, 3] of the triangles: left = right . turn(axis, angle - start)."""
        hinges, triangles = len(self.axis), len(self.sheet.mesh.triangles)
        turn = rotations(self.axis, angles - self.sheet.start)
        row = np.arange(3 * hinges).reshape(hinges, 3)
        left = 3 * self.left[:, None] + np.arange(3)
        right = np.repeat(3 * self.right[:, None] + np.arange(3), 3, axis=0).ravel()
        values = [np.repeat(self.weight, 3), -(self.weight[:, None, None] * turn.transpose(0, 2, 1)).ravel()]
        places = (np.concatenate([row.ravel(), np.repeat(row, 3)]), np.concatenate([left.ravel(), right]))
        system = sp.csc_matrix((np.concatenate(values), places), shape=(3 * hinges, 3 * triangles))
        held = (3 * self.roots[:, None] + np.arange(3)).ravel()
        free = np.setdiff1d(np.arange(3 * triangles), held)
        columns = np.zeros((3 * triangles, 3))
        columns[held] = np.tile(np.eye(3), (len(self.roots), 1))
        if len(free):
            part = system[:, free]
            columns[free] = _factors(part.T @ part).solve(-part.T @ (system[:, held] @ columns[held]))
        u, _, v = np.linalg.svd(columns.reshape(triangles, 3, 3).transpose(0, 2, 1))
        u[:, :, 2] *= np.sign(np.linalg.det(u @ v))[:, None]
        return u @ v


def rotations(axis, angle) -> np.ndarray:
    """Return the rotation matrices [H, 3, 3] about unit vectors [H, 3] by angles [H] [rad] (Rodrigues)."""
    zero = np.zeros(len(axis))
    x, y, z = axis.T
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    sine, rest = np.sin(angle)[:, None, None], (1.0 - np.cos(angle))[:, None, None]
    return np.eye(3) + sine * cross + rest * (cross @ cross)


def _roots(centres, left, right) -> np.ndarray:
    """Return the middle triangle of each part that hinges hold together."""
    count = len(centres)
    links = sp.coo_array((np.ones(len(left)), (left, right)), shape=(count, count))
    parts, part = connected_components(links, directed=False)
    roots = []
    for p in range(parts):
        of_part = np.flatnonzero(part == p)
        away = np.linalg.norm(centres[of_part] - centres[of_part].mean(axis=0), axis=1)
        roots.append(of_part[int(np.argmin(away))])
    return np.array(roots, dtype=np.int64)


def _factors(matrix):
    return spla.splu((matrix + TINY * sp.eye_array(matrix.shape[0])).tocsc())

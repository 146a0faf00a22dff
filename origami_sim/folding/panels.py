"""Distances between the corners of a panel, as they are in the panel: laid out flat, so that bending changes none.

A bar that crosses a panel tells of its length only; a panel that is sheared across it keeps that length. The triangles
of a panel hang together as a tree, so that their sides lay it out in one way.
"""

import numpy as np

from origami_sim.pattern import Triangulation


class Panels:
    """Panels of more than three corners, laid out from the lengths of the sides of their triangles.

    Attributes:
        pairs: [P, 2] corners of one panel that no bar joins, as nodes.
    """

    def __init__(self, mesh: Triangulation):
        count = np.bincount(mesh.triangle_face)
        self._roots: list[tuple[int, int, int, int, int]] = []
        self._levels: list[list[tuple[int, ...]]] = []
        slot: dict[tuple[int, int], int] = {}
        bars = set(map(tuple, mesh.bars.tolist()))
        pairs: list[tuple[int, int, int, int]] = []
        order = np.argsort(mesh.triangle_face, kind="stable")
        for part in np.split(order, np.cumsum(count)[:-1]):
            if len(part) < 2:
                continue
            face = int(mesh.triangle_face[part[0]])
            triangles = mesh.triangles[part].tolist()
            for v in dict.fromkeys(v for t in triangles for v in t):
                slot[face, v] = len(slot)
            self._lay_out(triangles, lambda v, face=face: slot[face, v])
            corners = sorted({v for t in triangles for v in t})
            pairs += [
                (a, b, slot[face, a], slot[face, b])
                for n, a in enumerate(corners)
                for b in corners[n + 1 :]
                if (a, b) not in bars
            ]
        listed = np.array(pairs, dtype=np.int64).reshape(-1, 4)
        self.pairs, self._slots, self._count = listed[:, :2], listed[:, 2:], len(slot)
        self._root = np.array(self._roots, dtype=np.int64).reshape(-1, 5)
        self._level = [np.array(rows, dtype=np.int64) for rows in self._levels]

    def _lay_out(self, triangles, slot) -> None:
        """List in which order the corners of a panel follow from each other: a root's first side, then apexes."""
        by_side = {side: (*side, c) for a, b, c in triangles for side, c in (((a, b), c), ((b, c), a), ((c, a), b))}
        a, b, _ = triangles[0]
        self._roots.append((a, b, slot(a), slot(b), 0))
        todo, depth = [(a, b)], 0
        while todo:
            if len(self._levels) <= depth:
                self._levels.append([])
            following = []
            for a, b in todo:
                c = by_side[a, b][2]
                self._levels[depth].append((a, b, c, slot(a), slot(b), slot(c)))
                following += [side for side in ((c, b), (a, c)) if side in by_side]
            todo, depth = following, depth + 1

    def distances(self, x: np.ndarray) -> np.ndarray:
        """Return the distances [P] of the pairs at positions x [N, 3]."""
        plane = np.zeros((self._count, 2))
        if not len(self.pairs):
            return np.zeros(0)
        a, b, _, at_b, _ = self._root.T
        plane[at_b, 0] = np.linalg.norm(x[b] - x[a], axis=1)
        for a, b, c, at_a, at_b, at_c in (rows.T for rows in self._level):
            along = plane[at_b] - plane[at_a]
            length = np.maximum(np.linalg.norm(along, axis=1), 1e-300)
            side, other = np.linalg.norm(x[c] - x[a], axis=1), np.linalg.norm(x[c] - x[b], axis=1)
            ahead = (length**2 + side**2 - other**2) / (2.0 * length)
            left = np.sqrt(np.maximum(side**2 - ahead**2, 0.0))
            along /= length[:, None]
            plane[at_c] = plane[at_a] + ahead[:, None] * along + left[:, None] * along[:, ::-1] * [-1.0, 1.0]
        return np.linalg.norm(plane[self._slots[:, 1]] - plane[self._slots[:, 0]], axis=1)

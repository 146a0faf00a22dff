"""The crease pattern: vertices, polygon faces and assigned edges, before any mechanics."""

import math
from dataclasses import dataclass, field

import numpy as np

ASSIGNMENTS = ("B", "M", "V", "F", "U", "C", "J")
"""FOLD 1.2 edge assignments: border, mountain, valley, flat, unassigned, cut, join."""


@dataclass(eq=False)
class Pattern:
    """A polygon mesh with crease assignments.

    Attributes:
        vertices: [V, 3] positions [m].
        faces: vertex loops, counter-clockwise seen from the top side.
        edges: [E, 2] vertex pairs; every face side is listed exactly once.
        assignments: E letters of `ASSIGNMENTS`.
        fold_angles: [E] target fold angle [rad], valley positive, in [-pi, pi]; nan where not given.
        stiffness: [E] crease stiffness [N m/rad]; nan where not given.
        rest_angles: [E] rest angle [rad]; nan where not given.
        thickness: [F] panel thickness [m]; nan where not given.
        materials: F material names or None.
        notes: sentences telling what a reader defaulted, merged or skipped.
        extra: keys of the source file that mean nothing to us, kept for the round trip.
        accuracy: of a drawing, distance within which points were one [m], so that each may be as far off; else nan.
    """

    vertices: np.ndarray
    faces: list[tuple[int, ...]]
    edges: np.ndarray
    assignments: list[str]
    fold_angles: np.ndarray
    stiffness: np.ndarray
    rest_angles: np.ndarray
    thickness: np.ndarray
    materials: list[str | None]
    notes: list[str] = field(default_factory=list)
    extra: dict = field(default_factory=dict)
    accuracy: float = math.nan

    @property
    def vertex_count(self) -> int:
        return len(self.vertices)

    @property
    def face_count(self) -> int:
        return len(self.faces)

    @property
    def edge_count(self) -> int:
        return len(self.edges)

    def edges_assigned(self, letters: str) -> np.ndarray:
        """Return the indices of the edges whose assignment is one of `letters`, ascending, int64."""
        return np.array([e for e, letter in enumerate(self.assignments) if letter in letters], dtype=np.int64)

    def equals(self, other: "Pattern") -> bool:
        """Tell whether both patterns hold the same data to the last bit; `notes` are not compared."""
        arrays = ("vertices", "edges", "fold_angles", "stiffness", "rest_angles", "thickness")
        lists = ("faces", "assignments", "materials", "extra")
        return all(np.array_equal(getattr(self, n), getattr(other, n), equal_nan=n != "edges") for n in arrays) and all(
            getattr(self, n) == getattr(other, n) for n in lists
        )

"""Rigid motions that points allow which are held along some axes."""

import numpy as np

FARTHER = 0.3
"""Part of a radian, and of the size, by which the root is moved to see what holds it: any angle that is not small."""


def possible(points: np.ndarray, held: np.ndarray) -> np.ndarray:
    """The rigid motions [d, 6] (angular velocity, velocity) that move no point [n, 3] where it is held [n, 3]."""
    basis, found = _within(np.eye(6), points, held), 7
    while len(basis) < found:
        found = len(basis)
        # a flat sheet may begin a motion that it cannot go on with: ask again a little further along each
        for motion in basis:
            turn, along = screw(FARTHER * motion[None, :3])
            basis = _within(basis, points @ turn[0].T + FARTHER * along[0] @ motion[3:], held)
    return basis


def _within(basis: np.ndarray, points: np.ndarray, held: np.ndarray) -> np.ndarray:
    """The motions [d, 6] (angular velocity, velocity) of a basis that move no point [n, 3] where it is held [n, 3]."""
    node, a = np.nonzero(held)
    rows = np.concatenate([np.cross(points[node], np.eye(3)[a]), np.eye(3)[a]], axis=1)
    if not len(rows) or not len(basis):
        return basis
    _, s, vt = np.linalg.svd(rows @ basis.T)
    return vt[np.sum(s > 1e-9) :] @ basis


def carried(x: np.ndarray, motion: np.ndarray, by: np.ndarray) -> np.ndarray:
    """Places [N, W, 3] to which points x [N, W, 3] go with a rigid motion, within `by` units of time [W].

    Args:
        motion: (6,) angular velocity, and velocity of the origin.
    """
    turn, along = screw(by[:, None] * motion[:3])
    return np.einsum("wab,nwb->nwa", turn, x) + np.einsum("wab,wb->wa", along, by[:, None] * motion[3:])


def velocity(x: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Velocities [..., 3] of points x [..., 3] that go along with a rigid motion (6,)."""
    return motion[3:] + np.cross(motion[:3], x)


def screw(turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotations R [W, 3, 3] by rotation vectors [W, 3] [rad], and matrices V [W, 3, 3] that make screws of them.

    A velocity v that turns along for a unit of time shifts by V v: the exponential of a rigid motion (Murray, Li and
    Sastry 1994, A Mathematical Introduction to Robotic Manipulation, eq. 2.36).
    """
    angle = np.linalg.norm(turn, axis=1)[:, None, None]
    k = np.cross(np.eye(3), turn[:, None, :])
    sine, lift = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    small = angle < 1e-2  # where the difference of angle and sine is rounding
    rest = np.where(small, 1 / 6 - angle**2 / 120 + angle**4 / 5040, (1 - sine) / np.where(small, 1.0, angle) ** 2)
    return np.eye(3) + sine * k + lift * (k @ k), np.eye(3) + lift * k + rest * (k @ k)

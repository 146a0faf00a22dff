"""A recorded motion as that of rigid panels: coordinates of the tree, frame by frame, also of what nothing holds."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from origami_sim.model import Model
from origami_sim.model.articulation import Articulation, Pose
from origami_sim.observation.attachments import body_point
from origami_sim.observation.channels import PATH, angle_mask, channel_values, stacked
from origami_sim.recording import Recording

ROUNDS = 25
"""Newton steps from the pose that markers give to that which fits all channels."""


@dataclass(frozen=True, eq=False)
class Track:
    """Coordinates of n frames.

    Attributes:
        times: (n,) [s]. pose: n poses. q: [m, n] shifts [m], turns [rad] and folds [rad]; of the turns, which have no
            angle, the small ones from frame to frame, added up. noise: (m,). told: (m,) whether the channels tell it.
            arm: whose coordinates they are.
    """

    times: np.ndarray
    pose: Pose
    q: np.ndarray
    noise: np.ndarray
    told: np.ndarray
    arm: Articulation

    def at(self, times: np.ndarray, q: np.ndarray) -> Pose:
        """Poses at times (k,) whose coordinates [m, k] are near those of the nearest frames."""
        near = np.searchsorted(0.5 * (self.times[1:] + self.times[:-1]), times)
        moved = self.arm.moved(self.pose.select(near), q - self.q[:, near])
        return replace(moved, angles=q[len(self.arm.motions) :])


def track(forward, recording: Recording, values: np.ndarray | None = None) -> Track | None:
    """The motion of a recording, or of other values [n, D] of its channels; None if too few frames are complete."""
    arm = forward.articulation
    recorded, noise = stacked(recording)
    values = recorded if values is None else values
    good = np.all(np.isfinite(values), axis=1)
    if good.sum() < min(20, len(values)) or not arm.size:
        return None
    times = recording.times[: len(values)]
    values = np.stack([np.interp(times, times[good], v[good]) for v in values.T], axis=1)
    pose = arm.reference(len(values))
    if arm.floating:
        each = [placed(forward.model, arm, recording, v) for v in values]
        rotation, centre = (np.concatenate([getattr(p, f) for p in each]) for f in ("rotation", "centre"))
        pose = Pose(rotation, centre, pose.angles)
    turning, weight = angle_mask(recording), 1.0 / noise

    def wrapped(change: np.ndarray) -> np.ndarray:
        change[turning] -= 2 * np.pi * np.round(change[turning] / (2 * np.pi))
        return change

    scaled = inverse = np.zeros((len(values), arm.size, len(noise)))
    sought = None
    for _ in range(ROUNDS):
        now = channel_values(forward.model, recording, arm.positions(pose)[None], None)[0]
        tangent = np.empty((len(noise), arm.size, len(values)))
        for k in range(arm.size):
            by = np.zeros((arm.size, len(values)))
            by[k] = 1e-6
            ahead = channel_values(forward.model, recording, arm.positions(arm.moved(pose, by))[None], None)[0]
            tangent[:, k] = wrapped(ahead - now) / 1e-6
        scaled = np.moveaxis(tangent * weight[:, None, None], 2, 0)  # [n, D, m]
        sought = arm.sought(scaled) if sought is None else sought
        inverse = arm.inverse(scaled, sought, 1e-6)
        by = np.einsum("nkd,dn->kn", inverse, wrapped(values.T - now) * weight[:, None])
        pose = arm.moved(pose, np.clip(by, -0.7, 0.7))
        if np.abs(by).max() < 1e-9:
            break
    told = np.median(np.einsum("nkd,ndk->kn", inverse, scaled), axis=1) > 0.99
    spread = np.sqrt(np.median(np.sum(inverse**2, axis=2), axis=0))
    folds = np.unwrap(pose.angles, axis=1)
    steps = Rotation.from_matrix(pose.rotation[1:] @ np.swapaxes(pose.rotation[:-1], 1, 2)).as_rotvec()
    turns = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    root = arm.motions @ np.concatenate([pose.centre, turns], axis=1).T
    return Track(times, pose, np.concatenate([root, folds]), spread, told, arm)


def followed(forward, index: int) -> Track | None:
    """The motion of a recording, which is found once; see `track`."""
    if index not in forward.tracked:
        forward.tracked[index] = track(forward, forward.recordings[index])
    return forward.tracked[index]


def recorded_folds(forward) -> dict[int, np.ndarray]:
    """All recorded angles (n,) of each crease of the tree that the channels tell, or that a drive prescribes."""
    creases = forward.articulation.creases
    if forward.prescribed:
        each = [(r.drive[PATH].at(r.times).reshape(len(r.times), -1).T, creases) for r in forward.recordings]
    else:
        tracks = [t for r in range(len(forward.recordings)) if (t := followed(forward, r)) is not None]
        first = forward.articulation.size - len(creases)
        each = [(t.q[first:][t.told[first:]], creases[t.told[first:]]) for t in tracks]
    out: dict[int, list[np.ndarray]] = {}
    for folds, mine in each:
        for c, angles in zip(mine.tolist(), folds, strict=True):
            out.setdefault(c, []).append(angles)
    return {c: np.concatenate(angles) for c, angles in out.items()}


def coordinates(forward, index: int) -> tuple[np.ndarray, np.ndarray] | None:
    """Folds [m, n] of all frames of a recording and their noise (m,); None if channels do not give the whole pose."""
    if forward.articulation.floating:
        return None
    found = followed(forward, index)
    return (found.q, found.noise) if found is not None and np.all(found.told) else None


LINE = 0.02
"""Width over length below which markers lie on a line."""


def placed(model: Model, arm: Articulation, recording: Recording, level: np.ndarray) -> Pose:
    """The reference pose; of a device that nothing holds, turned and shifted as a whole onto three or more markers.

    From there the pose is found in small turns, however far the device has turned.

    Args:
        level: (D,) what the channels show.
    """
    pose, row = arm.reference(), 0
    points, places = [], []
    for channel in recording.channels.values():
        width = 1 if channel.values.ndim == 1 else channel.values.shape[1]
        if channel.kind == "marker" and np.all(np.isfinite(level[row : row + width])):
            points.append(body_point(model, model.position[None], channel)[0])
            places.append(level[row : row + width])
        row += width
    if not arm.floating or len(points) < 3:
        return pose
    here, there = np.array(points), np.array(places)
    a, b = there - there.mean(0), here - here.mean(0)
    _, size, along = np.linalg.svd(b)
    if size[1] < LINE * size[0]:  # about a line nothing is told: the least turn
        a, b = (b @ along[0] @ a)[None], along[:1]
    turn = Rotation.align_vectors(a, b)[0]
    shift = there.mean(0) + turn.apply(pose.centre[0] - here.mean(0)) - pose.centre[0]
    by = arm.motions @ np.concatenate([shift, turn.as_rotvec()])
    return arm.moved(pose, np.concatenate([by, np.zeros(len(arm.creases))])[:, None])

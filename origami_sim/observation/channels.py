"""The observer for batches: channels of many worlds at once."""

import numpy as np

from origami_sim.errors import InputError
from origami_sim.model import Model, dihedral_angles
from origami_sim.observation.attachments import body_axes, body_point, index_of, panel_of
from origami_sim.recording import Camera, Channel, Recording

PATH = "crease_angle"
"""Drive channel that prescribes the fold angles [rad], one column per crease of the tree, from the root outwards."""


def read(
    model: Model, channel: Channel, x: np.ndarray, angles: np.ndarray | None, begin: np.ndarray | None = None
) -> np.ndarray:
    """One channel [F, d, W] at positions x [F, N, W, 3]; angles [F, C, W] are the continuous hinge angles if known.

    Args:
        begin: [N, W, 3] positions since which displacements are counted; None: where the model starts.

    Raises:
        InputError: a channel attached to something that the model does not have.
    """
    if channel.kind == "crease_angle":
        c = index_of(model, channel, "crease", len(model.creases))
        if angles is not None:
            return angles[:, c : c + 1]
        return np.moveaxis(dihedral_angles(np.moveaxis(x, 0, 1), model.creases[c : c + 1]), 0, 1)
    if channel.kind == "panel_angle":
        panel = panel_of(model, channel)
        triangles = model.triangles[model.triangle_panel == panel]
        nodes = set(np.unique(triangles).tolist())
        axis = next((c[1:3] for c in model.creases if {int(c[1]), int(c[2])} <= nodes), None)
        if axis is None:
            raise InputError("a panel angle needs a crease on the panel", field="panel", value=panel)
        # from the middle of the axis to that of the triangles, in the order in which films lie in memory
        weights = np.zeros(len(model.position))
        np.add.at(weights, triangles, 1.0 / triangles.size)
        np.add.at(weights, axis, -0.5)
        by = (weights[:, None] * np.eye(3)[::2, None]).reshape(2, -1)
        along = x.transpose(2, 0, 1, 3).reshape(x.shape[2], len(x), -1) @ by.T
        return np.arctan2(along[..., 0], along[..., 1]).T[:, None]
    if channel.kind == "marker":
        return np.moveaxis(_points(model, channel, x), 2, 1)
    if channel.kind == "marker_2d":
        return np.moveaxis(_camera(channel).project(_points(model, channel, x)), 2, 1)
    if channel.kind == "tip_displacement":
        start = np.broadcast_to(model.begins[:, None] if begin is None else begin, x.shape[1:])
        moved = _points(model, channel, x) - _points(model, channel, start[None])
        along = channel.attachment.get("direction")
        if channel.values.ndim > 1 and along is None:
            return np.moveaxis(moved, 2, 1)
        if along is None:
            return np.linalg.norm(moved, axis=-1)[:, None]
        return (moved @ (np.asarray(along, float) / np.linalg.norm(along)))[:, None]
    raise InputError(
        "this kind of channel cannot be diagnosed yet",
        field=f"channels.{channel.name}.kind",
        value=channel.kind,
        allowed="crease_angle, panel_angle, marker, marker_2d, tip_displacement",
    )


def component_names(recording: Recording) -> list[str]:
    """Names of all components of all channels, in order."""
    out = []
    for c in recording.channels.values():
        width = 1 if c.values.ndim == 1 else c.values.shape[1]
        out += [c.name] if width == 1 else [f"{c.name}.{'xyz'[i]}" for i in range(width)]
    return out


def stacked(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """All components of all channels (n, D), and their noise (D,)."""
    columns = [c.values.reshape(len(recording.times), -1) for c in recording.channels.values()]
    noise = [np.full(v.shape[1], c.noise) for c, v in zip(recording.channels.values(), columns, strict=True)]
    return np.concatenate(columns, axis=1), np.concatenate(noise)


def angle_mask(recording: Recording) -> np.ndarray:
    """(D,) whether a component is an angle."""
    return np.concatenate(
        [np.full(1 if c.values.ndim == 1 else c.values.shape[1], c.is_angle, bool) for c in recording.channels.values()]
    )


def channel_values(
    model: Model, recording: Recording, x: np.ndarray, angles: np.ndarray | None, begin: np.ndarray | None = None
) -> np.ndarray:
    """All components [F, D, W] at positions [F, N, W, 3] (and continuous angles [F, C, W]); see `read`."""
    return np.concatenate([read(model, c, x, angles, begin) for c in recording.channels.values()], axis=1)


def depths(model: Model, recording: Recording, x: np.ndarray) -> np.ndarray:
    """How far each marker in a picture is before its plane, [F, k, W] at positions x [F, N, W, 3]."""
    pictured = [c for c in recording.channels.values() if c.kind == "marker_2d"]
    found = [_camera(c).depth(_points(model, c, x)) for c in pictured]
    return np.stack(found, axis=1) if found else np.zeros((len(x), 0, x.shape[2]))


def turned_axes(model: Model, recording: Recording, x: np.ndarray) -> np.ndarray:
    """The axes of the body under each marker as its channel sees them, [F, 9 k, W] at positions x [F, N, W, 3]."""
    frames, nodes, worlds, _ = x.shape
    each = np.moveaxis(x, 2, 1).reshape(frames * worlds, nodes, 3)
    found = [body_axes(model, each, c).reshape(frames, worlds, 9) for c in marked(recording)]
    return np.moveaxis(np.concatenate(found, axis=2), 2, 1) if found else np.zeros((frames, 0, worlds))


def marked(recording: Recording) -> list[Channel]:
    """The channels that follow a marker."""
    return [c for c in recording.channels.values() if c.kind in ("marker", "marker_2d")]


def _points(model: Model, channel: Channel, x: np.ndarray) -> np.ndarray:
    """The point of the body that carries a marker, [F, W, 3]."""
    frames, nodes, worlds, _ = x.shape
    if "panel" not in channel.attachment and not channel.attachment.get("height"):
        return x[:, index_of(model, channel, "node", nodes)]
    each = np.moveaxis(x, 2, 1).reshape(frames * worlds, nodes, 3)
    return body_point(model, each, channel).reshape(frames, worlds, 3)


def _camera(channel: Channel) -> Camera:
    if channel.camera is None:
        raise InputError("a marker in a picture needs a camera", field=f"channels.{channel.name}.camera")
    return channel.camera


def units_of(recording: Recording) -> list[str]:
    """The unit of every component of a recording, channel after channel."""
    return [c.unit for c in recording.channels.values() for _ in range(1 if c.values.ndim == 1 else c.values.shape[1])]

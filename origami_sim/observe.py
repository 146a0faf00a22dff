"""The observer: what the channels of a recording would have read during a simulated run."""

import numpy as np
from scipy.interpolate import CubicSpline

from origami_sim.errors import InputError
from origami_sim.model import Model
from origami_sim.recording import Channel, Recording
from origami_sim.solve.dynamics import Trajectory


def observe(trajectory: Trajectory, recording: Recording, *, world: int = 0) -> dict[str, np.ndarray]:
    """Simulated channels at the recording's times, by channel name: (n,) or (n, d) [SI].

    Angles are continuous and start in the recording's turn. Frames are joined by cubic splines.

    Raises:
        InputError: a channel attached to something that the model does not have, a run shorter than the recording.
    """
    times = recording.times - recording.times[0]
    frames = trajectory.times - trajectory.times[0]
    if times[-1] > frames[-1] * (1 + 1e-9) + 1e-12:
        raise InputError(
            "the run is shorter than the recording",
            field="duration",
            value=float(frames[-1]),
            allowed=f">= {times[-1]:g} s",
        )
    out = {}
    for name, channel in recording.channels.items():
        values = channel_frames(trajectory, channel, world=world)
        if channel.is_angle:
            first = channel.values[np.isfinite(channel.values)][0]
            values = values + 2 * np.pi * np.round((first - values[0]) / (2 * np.pi))
        aligned = len(frames) >= len(times) and np.allclose(frames[: len(times)], times, atol=1e-9)
        out[name] = values[: len(times)] if aligned else CubicSpline(frames, values)(times)
    return out


def channel_frames(trajectory: Trajectory, channel: Channel, *, world: int = 0) -> np.ndarray:
    """One simulated channel at the frames of the run: (F,) or (F, d) [SI]."""
    model, x = trajectory.model, trajectory.x[:, :, world]
    if channel.kind == "crease_angle":
        return trajectory.creases[:, _index(model, channel, "crease", len(model.creases)), world]
    if channel.kind == "panel_angle":
        return panel_angle(model, x, _index(model, channel, "panel", int(model.triangle_panel.max()) + 1))
    if channel.kind in ("marker", "tip_displacement"):
        point = x[:, _index(model, channel, "node", len(model.position))]
        return point if channel.kind == "marker" else np.linalg.norm(point - point[0], axis=1)
    raise InputError(
        "this kind of channel cannot be observed yet",
        field=f"channels.{channel.name}.kind",
        value=channel.kind,
        allowed="crease_angle, panel_angle, marker, tip_displacement",
    )


def panel_angle(model: Model, x: np.ndarray, panel: int) -> np.ndarray:
    """Absolute angle of a panel about the y axis, from the upright (+z) towards +x, continuous: (F,) [rad].

    The panel's direction runs from the middle of its first crease to its centroid; x [F, N, 3].
    """
    triangles = model.triangles[model.triangle_panel == panel]
    nodes = set(np.unique(triangles).tolist())
    axes = [c[1:3] for c in model.creases if {int(c[1]), int(c[2])} <= nodes]
    if not axes:
        raise InputError("a panel angle needs a crease on the panel", field="panel", value=panel)
    start = x[:, axes[0]].mean(axis=1)
    along = x[:, triangles].mean(axis=(1, 2)) - start
    return np.unwrap(np.arctan2(along[:, 0], along[:, 2]))


def _index(model: Model, channel: Channel, family: str, count: int) -> int:
    """Index that an attachment names, by number or by the model's label."""
    given = channel.attachment.get(family)
    names = model.names.get(family, ())
    if isinstance(given, str) and given in names:
        return names.index(given)
    if isinstance(given, int) and 0 <= given < count:
        return given
    raise InputError(
        "the model has nothing of that name",
        field=f"channels.{channel.name}.{family}",
        value=given,
        allowed=", ".join(names) or f"0 to {count - 1}",
    )

"""Films of rollouts: channels of a batch from frame to frame, at the times of a recording or finer."""

from collections.abc import Sequence

import numpy as np

from origami_sim.effects import get
from origami_sim.model import Model
from origami_sim.observation.channels import channel_values, depths, turned_axes
from origami_sim.predict.shots import by_geometry
from origami_sim.recording import Recording
from origami_sim.solve.batch import Batch

FINER = 20
"""Simulated frames for each recorded one, at most, where these come at uneven times: it bounds memory."""

FILMED = 64e6
"""Bytes of positions that are kept before they are read; more would not be faster."""


def film_step(times: np.ndarray) -> float:
    """Time between simulated frames [s]: as recorded, or as close as the closest where frames do not lie on a grid.

    At most FINER times as many as were recorded.
    """
    steps = np.diff(times)
    counts = steps / float(np.median(steps))
    if np.all(np.abs(counts - np.round(counts)) < 0.1):
        return float(times[-1] - times[0]) / float(np.round(counts).sum())
    return max(float(steps.min()), float(times[-1] - times[0]) / (FINER * len(times)))


def even(step: float, lasting: float, frames: int) -> float:
    """A step [s] by which the next block begins at a frame of the film: the usual one, but for more than rounding."""
    return step if abs(frames * step - lasting) < 1e-9 * lasting else lasting / frames


def interpolated(ends: np.ndarray, longer: np.ndarray, step: float) -> np.ndarray:
    """Shifts and rates [L, W] a time `longer` (W,) [s] after the second of three frames `ends` [3, L, W].

    Rates are a parabola through the three, and shifts its integral through theirs.
    """
    m = ends.shape[1] // 2
    (q0, q1, q2), (v0, v1, v2) = ends[:, :m], ends[:, m:]
    a, j = (v2 - v0) / (2 * step), (v2 - 2 * v1 + v0) / step**2
    v = (q2 - q0) / (2 * step) - j * step**2 / 6
    shift = q1 + longer * (v + longer * (a / 2 + longer * j / 6))
    return np.concatenate([shift, v1 + longer * (a + longer * j / 2)])


def film(
    batch: Batch,
    recording: Recording,
    frames: int,
    substeps: int,
    step: float,
    models: Sequence[Model],
    *,
    first: bool = True,
    begin: np.ndarray | None = None,
):
    """Channels of the next frames and what else is asked of markers (`pictured`), in parts [f, D + k, W].

    With the present state as the first frame, if `first`. Displacements are counted since `begin`, see `read`.

    Args:
        models: see `pictured`.
    """
    model, out, left = batch.model, [], frames
    lengths = np.linalg.norm(np.diff(model.position[model.bars], axis=1)[:, 0], axis=-1)
    limit = 0.5 * lengths.min(initial=np.inf) * substeps / step
    if first:
        batch.advance(0, step / substeps, limit)
        x, angles = batch.motion()
        out.append(pictured(models, recording, x[None], angles[None], begin))
        left -= 1
    most = max(1, int(FILMED / (24 * len(model.position) * batch.worlds)))
    while left > 0:
        part = min(left, most)
        out.append(pictured(models, recording, *batch.film(part, substeps, step / substeps, limit), begin))
        left -= part
    return out


def pictured(
    models: Sequence[Model],
    recording: Recording,
    x: np.ndarray,
    angles: np.ndarray | None,
    begin: np.ndarray | None = None,
) -> np.ndarray:
    """All components, the depth of every marker in a picture and, if asked for, every marker's axes, [F, D + k, W].

    Args:
        models: of so many equal groups of the W worlds, one after the other. A marker is at a point of a body, which
            lies elsewhere among the nodes of a body of other lengths.
    """
    alike, each = by_geometry(models), x.shape[2] // len(models)
    if len(alike) == 1:
        return _pictured(models[0], recording, x, angles, begin)
    columns = [(np.array(mine)[:, None] * each + np.arange(each)).ravel() for mine in alike.values()]
    parts = []
    for mine, at in zip(alike.values(), columns, strict=True):
        turned = None if angles is None else angles[:, :, at]
        begun = None if begin is None else begin[:, at]
        parts.append(_pictured(models[mine[0]], recording, x[:, :, at], turned, begun))
    return np.concatenate(parts, axis=2)[:, :, np.argsort(np.concatenate(columns))]


def _pictured(model: Model, recording: Recording, x: np.ndarray, angles, begin) -> np.ndarray:
    parts = [channel_values(model, recording, x, angles, begin), depths(model, recording, x)]
    if any(get(e).on_body for e in model.effects):
        parts.append(turned_axes(model, recording, x))
    return np.concatenate(parts, axis=1)

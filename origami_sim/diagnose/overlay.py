"""The replay of a diagnosis: the recorded object beside the model as given and beside the best explanation."""

import re
from pathlib import Path

import numpy as np

from origami_sim.diagnose.diagnosis import Diagnosis
from origami_sim.diagnose.forward import Block, Forward, _by_length, shifted, stacked
from origami_sim.diagnose.keep import Keep
from origami_sim.diagnose.refit import Fit
from origami_sim.diagnose.static import CurveForward, Static
from origami_sim.model import Model, dihedral_angles
from origami_sim.replay import Overlay, write_overlay
from origami_sim.solve.dynamics import simulate

FRAMES, RATE = 600, 60.0
"""A replay has at most so many frames, and at most so many per second."""

SHOWN = ("before", "after")
"""Fits that are shown: the model as given, and the best explanation."""

MOST = 6
"""Recordings that get a replay, the first ones."""


def write_overlays(folder: str | Path, keep: Keep, diagnosis: Diagnosis) -> list[Path]:
    """Writes replay.rrd, or one replay_<name>.rrd for each of several recordings (the first MOST).

    There is none where the motion is prescribed and only a force was recorded: both would show the same.

    Each shows the recorded object as outlines, over the model as given and over the best explanation, with creases and
    panels coloured by what parts them from the recording.
    """
    forward = keep.forward
    assert forward is not None and keep.fits
    if isinstance(forward, CurveForward) and not isinstance(forward, Static):
        return []
    out = []
    for r, recording in enumerate(forward.recordings[:MOST]):
        name = "" if len(forward.recordings) == 1 else "_" + re.sub(r"\W+", "_", recording.name)
        path = Path(folder) / f"replay{name}.rrd"
        overlay = film(forward, keep.fits, r)
        series = [t for t in diagnosis.traces if t.recording == recording.name]
        out.append(write_overlay(path, overlay, series, title=f"{recording.name}: {diagnosis.verdict}"))
    return out


def film(forward: Forward, fits: dict[str, Fit], r: int) -> Overlay:
    """Frames of one recording: the pose that its channels tell, and what the fits "before" and "after" make of it."""
    if isinstance(forward, Static):
        times, recorded, films = _steps(forward, fits, r)
    else:
        times, recorded, films = _motion(forward, fits, r)
    model = forward.model
    return Overlay(
        model,
        times,
        recorded,
        films,
        {n: _crease_gaps(model, x, recorded) for n, x in films.items()},
        {n: _panel_gaps(model, x, recorded) for n, x in films.items()},
    )


Films = tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]
"""Times [F] [s], recorded [F, N, 3] and simulated [F, N, 3] positions [m]."""


def _steps(forward: Static, fits: dict[str, Fit], r: int) -> Films:
    """The equilibria of a quasi-static curve; its load steps are the times."""
    recording = forward.recordings[r]
    films = {}
    for name in SHOWN:
        world = forward._world(fits[name].hypothesis, fits[name].theta, fits[name].hypothesis.effects)
        films[name] = forward._chain(r, [world], None)[0][:, 0]
    block = next(b for b in forward.blocks if b.recording == r)
    return recording.times, _recorded(forward, block, recording.times - recording.times[0]), films


def _motion(forward: Forward, fits: dict[str, Fit], r: int) -> Films:
    """Rollouts of all segments, each from its fitted start."""
    recording = forward.recordings[r]
    mine = [b for b in fits["after"].blocks if forward.blocks[b].recording == r]
    length = sum(forward.blocks[b].times[-1] for b in mine)
    rate = min(1.0 / float(np.median(np.diff(recording.times))), RATE, FRAMES / length)
    counts = {b: max(1, int(forward.blocks[b].times[-1] * rate + 1e-9)) for b in mine}
    offsets = {b: np.arange(counts[b] + 1) / rate for b in mine}
    times = np.concatenate([recording.times[forward.blocks[b].first] + offsets[b] for b in mine])
    order = np.argsort(times, kind="stable")
    keep = order[np.append(np.diff(times[order]) > 1e-9, True)]  # where segments meet, the later one
    recorded = np.concatenate([_recorded(forward, forward.blocks[b], offsets[b]) for b in mine])
    films = {}
    for name in SHOWN:
        frames = _simulated(forward, fits[name], r, mine, counts, rate)
        films[name] = np.concatenate([frames[b] for b in mine])[keep]
    return times[keep], recorded[keep], films


def _simulated(forward: Forward, fit: Fit, r: int, mine: list[int], counts, rate: float) -> dict[int, np.ndarray]:
    """Node positions [F, N, 3] of each block, from its fitted start."""
    model, parameters = forward._world(fit.hypothesis, fit.theta, fit.hypothesis.effects)
    recording, out = forward.recordings[r], {}
    for group in _by_length(forward.blocks, mine):
        blocks = [forward.blocks[b] for b in group]
        duration = counts[group[0]] / rate
        state = forward._state(model, [(model, parameters)], blocks, fit.local[None][:, group])
        state.memory[:] = forward._memory(r, model, parameters, blocks, 1)
        starts = recording.times[[b.first for b in blocks]] - recording.times[0]
        drive = shifted(forward._drives[r], starts, duration, 1)
        motion = simulate(model, parameters, drive, duration=duration, rate=rate, state=state, threads=forward.threads)
        out |= {b: motion.x[:, :, w] for w, b in enumerate(group)}
    return out


def _recorded(forward: Forward, block: Block, offsets: np.ndarray) -> np.ndarray:
    """Positions [F, N, 3] of the rigid-panel pose that fits the channels best, each from the one before."""
    recording, arm = forward.recordings[block.recording], forward.articulation
    values, noise = stacked(recording)
    pose, out = block.pose, []
    times = recording.times[block.first] + offsets
    for frame in np.clip(np.searchsorted(recording.times, times - 1e-9), 0, len(recording.times) - 1):
        level = values[frame]
        seen = np.isfinite(level)
        for _ in range(10 if arm.size else 0):
            now, tangent = forward._channel_tangent(recording, pose, level)
            weight = np.where(seen, 1.0 / noise, 0.0)
            gap = np.where(seen, level - now, 0.0)
            by = np.linalg.lstsq(np.nan_to_num(tangent) * weight[:, None], gap * weight, rcond=1e-8)[0]
            size = np.abs(by).max(initial=0.0)
            pose = arm.moved(pose, (by * min(1.0, 1.0 / (size + 1e-12)))[:, None])
            if size < 1e-7:
                break
        out.append(arm.positions(pose)[:, 0])
    return np.array(out)


def _crease_gaps(model: Model, x: np.ndarray, recorded: np.ndarray) -> np.ndarray:
    """[F, C] differences of the fold angles [rad]."""
    one, other = (dihedral_angles(np.moveaxis(p, 0, 1), model.creases).T for p in (x, recorded))
    return np.abs((one - other + np.pi) % (2 * np.pi) - np.pi)


def _panel_gaps(model: Model, x: np.ndarray, recorded: np.ndarray) -> np.ndarray:
    """[F, P] rms distance of a panel's nodes from where they were recorded [m]."""
    away = np.sum((x - recorded) ** 2, axis=2)
    panels = range(int(model.triangle_panel.max(initial=-1)) + 1)
    nodes = [np.unique(model.triangles[model.triangle_panel == p]) for p in panels]
    return np.stack([np.sqrt(away[:, n].mean(axis=1)) if len(n) else np.zeros(len(x)) for n in nodes], axis=1)

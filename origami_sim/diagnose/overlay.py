"""The replay of a diagnosis: the recorded object beside the model as given and beside the best explanation."""

import copy
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from origami_sim.diagnose.keep import Keep
from origami_sim.effects import get
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Block, Predictor
from origami_sim.hypotheses.hypothesis import Hypothesis, Suspect
from origami_sim.model import Model, dihedral_angles
from origami_sim.observation.channels import stacked
from origami_sim.predict.starts import channel_tangent
from origami_sim.recording import Channel
from origami_sim.report.diagnosis import Diagnosis
from origami_sim.view.overlay import Overlay, write_overlay

FRAMES, RATE = 600, 60.0
"""A replay has at most so many frames, and at most so many per second."""

SHOWN = ("before", "after")
"""Fits that are shown: the model as given, and the best explanation."""

STEPS = "Seconds are load steps."
SLOW = "Every frame is an equilibrium, as time goes on."
SEGMENTS = "Every segment of the recording is simulated from a start of its own: there both meet again."

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
    if forward.prescribed:
        return []
    if not len(forward.model.triangles):
        return []  # a body of one node has nothing to draw
    out = []
    for r, recording in enumerate(forward.recordings[:MOST]):
        name = "" if len(forward.recordings) == 1 else "_" + re.sub(r"\W+", "_", recording.name)
        path = Path(folder) / f"replay{name}.rrd"
        overlay = film(forward, keep.fits, r)
        series = [t for t in diagnosis.traces if t.recording == recording.name]
        out.append(write_overlay(path, overlay, series, title=f"{recording.name}: {diagnosis.verdict}"))
    return out


def film(forward: Predictor, fits: dict[str, Fit], r: int) -> Overlay:
    """Frames of one recording: the pose that its channels tell, and what the fits "before" and "after" make of it."""
    recording, model = forward.recordings[r], forward.model
    mine = [b for b in fits["after"].blocks if forward.blocks[b].recording == r]
    step = float(np.median(np.diff(recording.times)))
    total = sum(len(forward.blocks[b].times) for b in mine)
    every = 1 if recording.by_step else max(1, int(np.ceil(total / FRAMES)), round(1.0 / (RATE * step)))
    frames = {b: np.arange(0, len(forward.blocks[b].times), every) for b in mine}
    times = np.concatenate([recording.times[forward.blocks[b].first + frames[b]] for b in mine])
    order = np.argsort(times, kind="stable")
    keep = order[np.append(np.diff(times[order]) > 1e-9, True)]  # where segments meet, the later one
    recorded = np.concatenate([_recorded(forward, forward.blocks[b], frames[b]) for b in mine])[keep]
    films = {}
    for name in SHOWN:
        x = _positions(forward, fits[name], r, mine)
        films[name] = np.concatenate([x[b][frames[b]] for b in mine])[keep]
    return Overlay(
        model,
        times[keep],
        recorded,
        films,
        {n: _crease_gaps(model, x, recorded) for n, x in films.items()},
        {n: _panel_gaps(model, x, recorded) for n, x in films.items()},
        STEPS if recording.by_step else SLOW if forward.curve else SEGMENTS,
    )


def _positions(forward: Predictor, fit: Fit, r: int, mine: list[int]) -> dict[int, np.ndarray]:
    """Node positions [n, N, 3] of each block: what markers on all nodes would have read."""
    recording, count = forward.recordings[r], len(forward.model.position)
    if not forward.curve:
        forward.recorded(r)  # type: ignore[attr-defined]  # the recorded motion, which the copy below could not tell any more
    nowhere = np.zeros((len(recording.times), 3))
    markers = {f"node {i}": Channel(f"node {i}", "marker", nowhere, "m", 1.0, {"node": i}) for i in range(count)}
    other = copy.copy(forward)
    other.recordings, other._built = list(forward.recordings), {}  # type: ignore[attr-defined]
    other.recordings[r] = replace(recording, channels=markers)
    other.blocks = [
        replace(b, values=np.zeros((len(b.times), 3 * count)), begin=None) if n in mine else b
        for n, b in enumerate(forward.blocks)
    ]
    build = forward.subject.build

    def bare(values):
        model, parameters, drive = build(values)
        plain = model.with_effects(without=tuple(e for e in model.effects if get(e).on_body))
        return plain, parameters.for_model(plain), drive

    other.subject = replace(forward.subject, build=bare)
    # an error of one channel is no node's
    felt = tuple(s for s in fit.hypothesis.suspects if s.kind != "measurement" or _of_all(s))
    predicted = other.predict(Hypothesis(felt), numbers_kept(fit, felt)[None], fit.local[None], mine)
    return {b: p[0].reshape(-1, count, 3) for b, p in zip(mine, predicted, strict=True)}


def _of_all(s: Suspect) -> bool:
    """Whether an error of the measurement is that of all channels."""
    return s.entities is None and not get(s.effect).on_body


def _recorded(forward: Predictor, block: Block, frames: np.ndarray) -> np.ndarray:
    """Positions [F, N, 3] of the rigid-panel pose that fits the channels best, each from the one before."""
    recording, arm = forward.recordings[block.recording], forward.articulation
    values, noise = stacked(recording)
    pose, out = block.pose, []
    for frame in block.first + frames:
        level = values[frame]
        seen = np.isfinite(level)
        for _ in range(10 if arm.size else 0):
            now, tangent = channel_tangent(forward.model, forward.articulation, recording, pose, level)
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


def numbers_kept(f: Fit, rest: tuple[Suspect, ...]) -> np.ndarray:
    """The numbers of a fit that a smaller hypothesis of these suspects still has."""
    ends = np.cumsum([len(f.free) - len(f.hypothesis.free), *(len(s.free) for s in f.hypothesis.suspects)])
    own = {s.label: f.theta[a:b] for s, a, b in zip(f.hypothesis.suspects, ends[:-1], ends[1:], strict=True)}
    return np.concatenate([f.theta[: ends[0]], *(own[s.label] for s in rest)])

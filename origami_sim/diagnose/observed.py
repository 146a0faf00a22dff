"""What of a device the channels of its recordings show at all."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from origami_sim.errors import InputError
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.hypotheses.hypothesis import apply
from origami_sim.model import Model
from origami_sim.observation.attachments import body_point, index_of, panel_of
from origami_sim.observation.channels import stacked
from origami_sim.observation.thinning import BENDS
from origami_sim.predict.begun import within
from origami_sim.predict.measured import clock_of
from origami_sim.predict.starts import channel_tangent, seen_first
from origami_sim.recording import Channel, Recording
from origami_sim.verdict.words import joined

BENT = 0.3
"""Fold [rad] of a second pose that is asked: flat creases may lie where a channel has an extremum."""

MOST = 8
"""Segments of each recording whose poses are asked."""

FEWEST, FEWEST_STEPS = 16, 8
"""Frames and load steps with a value that a diagnosis needs."""

OFF = 20.0
"""How many times a distance on a panel may be off before its unit is refused; a length scale of 50 % is a suspect."""

TOGETHER = 1e-6
"""Change of the channels, over the largest, below which a mixture of folds counts as unseen."""


def unobserved(forward: Predictor) -> str | None:
    """One sentence on the coordinates (folds; shifts and turns of what nothing holds) that no channel tells.

    None if the channels tell all of them, or if forces or moments are measured, which are not read off a pose.

    Raises:
        InputError: no channel changes with any coordinate.
    """
    names = forward.articulation.names()
    kinds = {c.kind for r in forward.recordings for c in r.channels.values()}
    if not names or kinds & {"force", "moment"}:
        return None
    tangent = channel_tangents(forward)
    blind = np.linalg.norm(tangent, axis=0) < 1.0  # a whole radian or metre stays below the noise
    if np.all(blind):
        channels = ", ".join(dict.fromkeys(n for r in forward.recordings for n in r.channels))
        raise InputError(
            "no channel reacts to any fold of the model",
            field="channels",
            value=channels,
            allowed=f"channels attached to what moves: {', '.join(names)}",
        )
    _, size, ways = np.linalg.svd(tangent[:, ~blind], full_matrices=True)
    size = np.append(size, np.zeros(len(ways) - len(size)))
    unseen = ways[size < TOGETHER * size[0]]
    mixed = np.flatnonzero(~blind)[np.linalg.norm(unseen, axis=0) > 1e-3]
    parts = []
    if np.any(blind):
        parts.append(f"no channel shows {in_ranges([names[k] for k in np.flatnonzero(blind)])}")
    if len(mixed):
        parts.append(f"the channels show {in_ranges([names[k] for k in mixed])} only together")
    if not parts:
        return None
    text = "; ".join(parts)
    return f"{text[0].upper()}{text[1:]}: what is missing there can be told only by its effect on the rest."


def beyond_the_log(forward: Predictor, f: Fit) -> list[str]:
    """A sentence for each drive past the end of whose log a clock that is off takes frames, while it still moves.

    There the drive is held at its last value, which it did not do.
    """
    out = []
    for r, recording in enumerate(forward.recordings):
        if recording.by_step:
            continue
        times = recording.times - recording.times[0]
        taken, frame = _taken(forward, f, r), float(np.median(np.diff(times)))
        for drive in recording.drive.values():
            own = recording.times if drive.times is None else drive.times
            past = taken - (own[-1] - recording.times[0])
            late = int(np.sum(past > 0.5 * frame))
            if drive.constant or not late:
                continue
            last = np.asarray(drive.values)[own >= own[-1] - 2.0 * past.max()]
            if np.any(np.ptp(last, axis=0) > BENDS * np.ptp(drive.values, axis=0)):
                out.append(
                    f"The clock takes the last {late} frames of {recording.name} up to {past.max():.2g} s past the end "
                    f"of the recorded {drive.name}, which is taken as held there: leave them out, or log it longer."
                )
    return out


def _taken(forward: Predictor, f: Fit, r: int) -> np.ndarray:
    """(n,) when the frames of a recording were taken by the clock of its drives, of the channel that is latest [s]."""
    recording, names = forward.recordings[r], [n.name for n in forward.subject.nominals]
    hypothesis, values = within(f.hypothesis, f.theta, len(names), r)
    model, parameters, _ = forward.subject.build(dict(zip(names, values[: len(names)].tolist(), strict=True)))
    model = replace(model.with_effects(*hypothesis.effects), channels=len(recording.channels))
    parameters = apply(parameters, hypothesis, values[len(names) :], model)
    times, channels = recording.times - recording.times[0], range(len(recording.channels))
    return np.max([clock_of(model, parameters, 1, c, times)[:, 0] for c in channels], axis=0)


def check_recording(recording: Recording, model: Model) -> None:
    """Refuses a recording that cannot be of this model, or that says too little.

    A point of a device that is held cannot move farther than twice the sum of its panels; two points of one panel keep
    their distance, so that one many times as large or as small is in another unit.

    Args:
        recording, model: what is to be diagnosed.

    Raises:
        InputError: too few frames with a value; lengths in another unit.
    """
    seen = [np.isfinite(c.values).reshape(recording.frame_count, -1).any(axis=1) for c in recording.channels.values()]
    count, fewest = int(np.any(seen, axis=0).sum()), FEWEST_STEPS if recording.by_step else FEWEST
    if count < fewest:
        raise InputError(
            "a recording is too short for a diagnosis",
            field=f"{recording.name}.frames",
            value=count,
            allowed=f"at least {fewest} with a value",
        )
    count = int(model.triangle_panel.max(initial=-1)) + 1
    panels = [np.unique(model.triangles[model.triangle_panel == p]) for p in range(count)]
    reach = 2.0 * sum(float(np.linalg.norm(np.ptp(model.position[n], axis=0))) for n in panels)
    for name, c in recording.channels.items():
        if c.kind not in ("marker", "marker_2d", "tip_displacement") or not panels or np.all(model.free):
            continue
        moved = float(np.linalg.norm(np.nanmax(c.values, axis=0) - np.nanmin(c.values, axis=0)))
        if moved > reach:
            raise InputError(
                f"channel '{name}' moves by {moved:.3g} m, farther than anything that is held on this model can",
                field=f"channels.{name}.unit",
                allowed=f"lengths up to {reach:.3g} m (millimetres or pixels read as metres?)",
            )
    _check_distances(recording, model, panels)


def _check_distances(recording: Recording, model: Model, panels: Sequence[np.ndarray]) -> None:
    """Refuses markers of one panel whose distance is many times off."""
    rest = model.position[None]
    marked = [(n, c, body_point(model, rest, c)[0]) for n, c in recording.channels.items() if c.kind == "marker"]
    for k, (name, a, here) in enumerate(marked):
        for other, b, there in marked[k + 1 :]:
            together = _panels_of(a, model, panels) & _panels_of(b, model, panels)
            real = float(np.linalg.norm(here - there))
            if not together or real == 0.0:
                continue
            told = float(np.nanmedian(np.linalg.norm(a.values - b.values, axis=1)))
            if not real / OFF < told < real * OFF:
                raise InputError(
                    f"markers '{name}' and '{other}' are {told:.3g} m apart, on the model's panel {real:.3g} m",
                    field=f"channels.{name}.unit",
                    allowed="the unit in which the file is written, and the points that the markers are on",
                )


def _panels_of(channel: Channel, model: Model, panels: Sequence[np.ndarray]) -> set[int]:
    """Panels that carry a marker."""
    if "panel" in channel.attachment:
        return {panel_of(model, channel)}
    node = index_of(model, channel, "node", len(model.position))
    return {p for p, nodes in enumerate(panels) if node in nodes}


def channel_tangents(forward: Predictor) -> np.ndarray:
    """[R, m] changes of all channels with the coordinates, in units of their noise, in poses of all recordings."""
    arm, rows = forward.articulation, []
    bend = BENT * np.where(np.arange(arm.size) % 2, -1.0, 1.0)[:, None]
    bend[: arm.size - len(arm.creases)] = 0.0
    for index, recording in enumerate(forward.recordings):
        values, noise = stacked(recording)
        near = seen_first(values)
        told = np.any(np.isfinite(values), axis=0)
        blocks = [b for b in forward.blocks if b.recording == index]
        picked = np.unique(np.linspace(0, len(blocks) - 1, MOST).astype(int)) if blocks else []
        poses = [arm.moved(arm.reference(), bend), *(blocks[k].pose for k in picked)]
        for pose in poses:
            rows.append((channel_tangent(forward.model, arm, recording, pose, near)[1] / noise[:, None])[told])
    return np.concatenate(rows)


def in_ranges(names: Sequence[str]) -> str:
    """Names in a row; of four and more that are numbered one after the other, the first and the last."""
    runs: list[list[str]] = []
    for name in names:
        word, _, number = name.rpartition(" ")
        last = runs[-1][-1].rpartition(" ") if runs else ("", "", "")
        follows = number.isdigit() and last[2].isdigit() and last[0] == word and int(number) == int(last[2]) + 1
        if follows:
            runs[-1].append(name)
        else:
            runs.append([name])
    return joined([n for r in runs for n in ([f"{r[0]} to {r[-1]}"] if len(r) > 3 else r)])

"""What is compared: recordings thinned and cut into segments, and the model without any effect fitted to them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from origami_sim.diagnose import verdict as words
from origami_sim.diagnose.channels import units_of
from origami_sim.diagnose.compare import weights_from
from origami_sim.diagnose.forward import Forward, local_line, stacked
from origami_sim.diagnose.hypothesis import Hypothesis, Subject, Suspect
from origami_sim.diagnose.options import Options
from origami_sim.diagnose.prescribed import curves
from origami_sim.diagnose.refit import Fit, Weights, carried_on, fit
from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.recording import Channel, Recording, estimate_noise
from origami_sim.recording.wild import wild_frames
from origami_sim.solve.timestep import stable_step

GROWTH = 30.0
"""Growth of a difference in the start beyond which a segment is cut: below the time in which chaos takes over."""

STEADY = 10.0
"""The same for what begins at rest, beyond which it is cut at all: small errors of any model grow as much."""

EVEN = 1.5
"""Factor between a time step and the median one up to which frames are averaged over it."""

FRAMES = 400
"""Frames of a recording that are compared at least, if it has as many."""

FEWEST = 8
"""Segments that a single recording is cut into at least, where its start is fitted, for held-out scores."""


def among(every: Sequence[Suspect], catalogue: Sequence[str]) -> list[Suspect]:
    """The suspects of some effects.

    Raises:
        InputError: an effect that the catalogue lacks; effects of which none can act here.
    """
    wanted = {get(n).name for n in catalogue}
    out = [s for s in every if s.effect in wanted]
    if not out:
        raise InputError(
            "none of these can act on this device, or show in these recordings",
            field="suspects",
            value=", ".join(sorted(wanted)),
            allowed=", ".join(sorted({s.effect for s in every})),
        )
    return out


def prepared(recordings: Sequence[Recording], rate: float) -> list[Recording]:
    """The recordings without wild frames, thinned to about `rate` frames per second, but to no less than FRAMES frames.

    Raises:
        InputError: none, different channels, too few frames.
    """
    if not recordings:
        raise InputError("there is nothing to diagnose", field="recordings", value=0, allowed="at least one recording")
    names = list(recordings[0].channels)
    out = []
    for r in recordings:
        if list(r.channels) != names:
            raise InputError(
                "recordings of one object need the same channels",
                field=f"{r.name}.channels",
                value=", ".join(r.channels),
                allowed=", ".join(names),
            )
        fewest = 8 if r.by_step else 16
        if len(r.times) < fewest:
            raise InputError(
                "a recording is too short for a diagnosis",
                field=f"{r.name}.frames",
                value=len(r.times),
                allowed=f"at least {fewest}",
            )
        every = int(1.0 / float(np.median(np.diff(r.times))) / rate + 1e-6)
        out.append(thinned(tamed(r), max(1, min(every, len(r.times) // FRAMES))))
    return out


def tamed(recording: Recording) -> Recording:
    """The recording without wild frames, of which a note tells; load steps have no course to be far off from."""
    channels, notes = dict(recording.channels), []
    for name, c in recording.channels.items() if not recording.by_step else ():
        wild = wild_frames(recording.times, c.values, c.noise)
        if not wild.any():
            continue
        values = np.where(wild if c.values.ndim == 1 else wild[:, None], np.nan, c.values)
        channels[name] = replace(c, values=values)
        when, count = f"at t = {recording.times[np.argmax(wild)]:.6g} s", np.count_nonzero(wild)
        notes.append(f"{recording.name}: a wild frame of channel '{name}' is left out, {when}.")
        if count > 1:
            notes[-1] = f"{recording.name}: {count} wild frames of channel '{name}' are left out, the first {when}."
    if not notes:
        return recording
    known = recording.metadata.get("notes", ())
    return replace(recording, channels=channels, metadata={**recording.metadata, "notes": [*known, *notes]})


def thinned(recording: Recording, every: int) -> Recording:
    """One frame of so many, each the mean of those around it, as far as half way to the next (shared by both)."""
    if every <= 1:
        return recording
    out = recording.only(slice(None, None, every))
    steps = np.diff(recording.times)
    even = (steps < EVEN * np.median(steps)) & (steps > np.median(steps) / EVEN)
    channels = {n: averaged(c, every, recording.times, even) for n, c in recording.channels.items()}
    return replace(out, channels=channels)


def averaged(channel: Channel, every: int, times: np.ndarray, even: np.ndarray) -> Channel:
    """A channel thinned by means over frames, with the noise that these show: no less than that of frames that are
    independent, nor of the steps of the readings.

    A mean over a bend is off by half its second derivative times the mean square of the distances, which the means
    beside it tell. Where frames are missing a parabola through the others takes its place. What lies at a gap in time,
    and the first and last frame, stays as it was read.

    Args:
        times: (n,) [s]. even: (n - 1,) which steps in time are as usual.
    """
    n, half, at = len(channel.values), every // 2, np.arange(0, len(channel.values), every)
    if len(at) < 3:
        return replace(channel, values=channel.values[::every])
    values, away = channel.values.reshape(n, -1), np.arange(-half, half + 1)
    share = np.where(2 * np.abs(away) == every, 0.5, 1.0) / every
    around = values[np.minimum(at[1:-1, None] + away, n - 1)]
    means = np.concatenate([values[:1], np.einsum("j,njd->nd", share, around), values[at[-1:]]])
    bend = float(share @ away**2) / (2.0 * every**2)
    inner = means[1:-1] - bend * (means[2:] - 2.0 * means[1:-1] + means[:-2])
    odd = np.concatenate([[0], np.cumsum(~even)])  # odd steps before each frame
    first, last = np.maximum(at[:-2] - half, 0), np.minimum(at[2:] + half, n - 1)
    whole = odd[first] == odd[last]
    out = values[at]
    out[1:-1] = np.where(whole[:, None] & np.isfinite(inner), inner, out[1:-1])
    for k, d in np.argwhere(whole[:, None] & np.isnan(inner)).tolist():
        frames = np.arange(n)[first[k] : last[k] + 1]
        part, x = values[frames, d], frames - at[k + 1]
        seen = np.isfinite(part)
        if seen.sum() >= 2 * every and np.any(seen & (x < 0)) and np.any(seen & (x > 0)):
            out[k + 1, d] = np.polynomial.Polynomial.fit(x[seen], part[seen], 2)(0.0)
    out = out.reshape(len(at), *channel.values.shape[1:])
    least = channel.noise * np.hypot(1.0 + 2.0 * bend, np.sqrt(2.0) * bend) * np.linalg.norm(share)  # white noise
    report = channel.noise_report
    count = report.quantum / np.sqrt(12.0) if report is not None else 0.0
    noise = float(np.clip(estimate_noise(times[at], out), min(max(least, count), channel.noise), channel.noise))
    if report is not None and channel.noise == report.level:  # it was read from the data, and still is
        report = replace(report, level=noise)
    return replace(channel, values=out, noise=noise, noise_report=report)


def arranged(subject: Subject, recordings: list[Recording], o: Options) -> Forward:
    """Segments that are short enough to be predictable, and start modes; for curves, what predicts them."""
    curve = curves(subject, recordings, o.threads)
    if curve is not None:
        return curve
    whole = max(float(r.times[-1] - r.times[0]) for r in recordings)
    shortest = 8 * max(float(np.median(np.diff(r.times))) for r in recordings)
    if o.segment is not None and not shortest <= o.segment < np.inf:
        raise InputError(
            "a segment needs frames to be compared", field="segment", value=o.segment, allowed=f">= {shortest:.3g} s"
        )
    start = o.start or ("fit" if o.segment is not None else starting(subject, recordings))
    if start == "rest" and o.start is None and not steady(subject, recordings, whole, o.threads):
        start = "fit"
    if start == "rest":  # later segments would not begin there
        return Forward(subject, recordings, start="rest", threads=o.threads)
    step = stable_step(*subject.build({f.name: f.start for f in subject.nominals})[:2]).dt
    step = min(step, float(np.median(np.diff(recordings[0].times))))  # without stiffness any step is stable
    length = o.segment
    if length is None:
        count = FEWEST if len(recordings) == 1 else max(1, FEWEST // len(recordings))
        length = min(whole / count, max(o.steps * step / FEWEST, whole / 100))
        length = min(length, predictable(Forward(subject, recordings, segment=length, most=4, threads=o.threads)))
    most = max(FEWEST, int(o.steps * step / length)) // len(recordings)
    kept = {"segment": length, "start": "fit", "most": max(1, most), "threads": o.threads}
    forward = Forward(subject, recordings, **kept)
    calm = forward.calming()
    return forward if calm == forward.calm else Forward(subject, recordings, calm=calm, **kept)


def starting(subject: Subject, recordings: list[Recording]) -> str:
    """ "rest" if all recordings begin at rest in the reference state, else "fit"."""
    probe = Forward(subject, recordings, start="rest")
    for index, recording in enumerate(recordings):
        values, noise = stacked(recording)
        block = next(b for b in probe.blocks if b.recording == index)
        head = slice(0, max(4, len(values) // 100))
        now, _ = probe._channel_tangent(recording, block.pose, values[0])
        # a start on the ground is better guessed than fitted: where feet touch turns on micrometres
        standing = probe.articulation.floating and len(probe.model.contacts) and len(set(units_of(recording))) == 1
        if standing and len(values) >= 4 * words.WINDOW:  # a tracker that smooths hides its noise from the next frames
            noise = np.maximum(noise, np.sqrt(np.nan_to_num(np.nanmedian(words.scatter(values), axis=0))))
        with np.errstate(invalid="ignore"):
            begun = np.nanmedian(values[head], axis=0)
            away = begun - now
            drift = 1.4826 * np.nanmedian(np.abs(values[head] - begun), axis=0)  # whatever one frame shows
        scale = np.maximum(np.nanstd(values, axis=0), 5 * noise)
        # what does not move at all, such as a marker across the plane of a motion, scatters by its noise
        moves = np.hypot(np.maximum(0.2 * scale, 0.05 * scale.max() if standing else 0.0), 3 * noise)
        near = np.maximum(0.05 * scale, 5 * noise)
        still = np.all(np.abs(away) <= near) and np.all(drift <= moves)
        if not still and not _just_begun(recording.times, values, noise, now, near):
            return "fit" if probe.articulation.size else "rest"
    return "rest"


def _just_begun(times: np.ndarray, values: np.ndarray, noise: np.ndarray, reference: np.ndarray, near) -> bool:
    """Whether a motion that is under way within a few frames was at rest in its first, near the reference."""
    level, rate, error = local_line(times, values, noise, 0)
    fast = np.nanstd(np.gradient(values, times, axis=0), axis=0)
    calm = (np.abs(level - reference) <= near) & (np.abs(rate) <= np.maximum(0.05 * fast, 4 * error))
    return bool(np.all(calm & (error < 0.5 * fast)))


def steady(subject: Subject, recordings: list[Recording], whole: float, threads: int | None) -> bool:
    """Whether a difference in the start hardly grows in a whole recording; where feet stand, that is not asked."""
    forward = Forward(subject, recordings, segment=whole, threads=threads)
    if forward.articulation.floating or not forward.articulation.size:
        return True
    return predictable(forward, STEADY) >= whole


def predictable(forward: Forward, growth: float = GROWTH) -> float:
    """Time over which a difference in the start grows less than so many times [s]."""
    m = forward.local
    local = np.zeros((m + 1, len(forward.blocks), m))
    for k in range(m):
        local[1 + k, :, k] = 1e-6 if k < m // 2 else 1e-5
    theta = np.array([f.start for f in forward.subject.nominals])
    predicted = forward.predict(Hypothesis(), [theta] * (m + 1), local)
    shortest = np.inf
    for block, values in zip(forward.blocks, predicted, strict=True):
        moved = np.linalg.norm(np.nan_to_num(values[1:] - values[0], nan=np.inf), axis=2)  # [m, n]
        early = np.maximum.accumulate(moved, axis=1)
        first = np.maximum(early[:, max(2, len(block.times) // 20)], 1e-9)
        beyond = np.any(moved > growth * first[:, None], axis=0)
        shortest = min(shortest, block.times[np.argmax(beyond)] if np.any(beyond) else block.times[-1] + 1e-9)
    return max(float(shortest), 8 * float(np.median(np.diff(forward.recordings[0].times))))


def nominal_fits(forward: Forward) -> tuple[Fit, Fit, Weights]:
    """The nominal model as given (only starts fitted) and refitted, and the weights."""
    noise = forward.blocks[0].noise
    theta = np.array([f.start for f in forward.subject.nominals])
    rough = forward.predict(Hypothesis(), theta[None], np.zeros((1, len(forward.blocks), forward.local)))
    gaps = [b.values - v[0] for b, v in zip(forward.blocks, rough, strict=True)]
    if any(np.any(np.isnan(v[0])) for v in rough):
        raise InputError(
            "the nominal model goes unstable on this recording", field="model", allowed="a model that can be simulated"
        )
    rms = np.sqrt(np.nanmean(np.concatenate(gaps) ** 2, axis=0))
    w = first = Weights(np.maximum(rms, noise), 0.1)
    given = base = fit(forward, Hypothesis(), w, fixed=True, most=3, done=0.01)
    for n in range(3):
        if base.failed:
            break
        new = weights_from(forward, [base])
        if n and np.all(np.abs(np.log(new.deviation / w.deviation)) < 0.1) and abs(np.log(new.part / w.part)) < 0.3:
            break
        known = None if base.linear is None else base.linear.reweighted(w, new)
        w, kept = new, len(theta) if n else 0
        base = fit(
            forward, Hypothesis(), w, theta=base.theta, local=base.local, most=5, done=0.01, known=known, kept=kept
        )
    if not base.failed:
        base = carried_on(forward, base, w)
    if base.failed:
        raise InputError(f"the nominal model cannot be fitted: {base.failed}", field="model")
    return given.reweighted(first, w), base, w

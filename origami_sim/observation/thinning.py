"""Recordings with fewer frames, each the mean of those around it."""

from dataclasses import replace
from functools import partial

import numpy as np

from origami_sim.recording import Channel, Recording, estimate_noise
from origami_sim.threads import shared

EVEN = 1.5
"""Factor between a time step and the median one up to which frames are averaged over it."""

BENDS = 2e-3
"""Part of its range by which the mean of a drive departs from what it is, at the end of a ramp.

Means of two or three frames depart by 1e-4 of a sine of 40 frames, of five by 8e-4. Half and double change no word of
two recordings in steps, and what is named by no more than a tenth of its deviation.
"""


def thinned(recording: Recording, every: int, *, driven: bool = False) -> Recording:
    """One frame of so many, each the mean of those around it, as far as half way to the next (shared by both).

    Args:
        driven: whether what is read follows the drive at once, without inertia. The drive is then averaged alike, and
            at the ends of its ramps, where means say neither what it was nor what was read, frames stay as they are.
    """
    if every <= 1:
        return recording
    out = recording.only(slice(None, None, every))
    steps = np.diff(recording.times)
    even = (steps < EVEN * np.median(steps)) & (steps > np.median(steps) / EVEN)
    bent, means = np.zeros(len(out.times), bool), {}
    for name, d in recording.drive.items() if driven else ():
        if not d.constant:
            values = d.at(recording.times)
            means[name] = then, mean = values[::every], filtered(values, every, even)
            far = np.abs(mean - then) > BENDS * np.ptp(values, axis=0)
            bent |= far.reshape(len(far), -1).any(axis=1)
    bent[1:-1] |= bent[:-2] | bent[2:]  # what is corrected by the means beside it
    drive = dict(out.drive)
    for name, (then, mean) in means.items():
        mean[bent] = then[bent]
        drive[name] = replace(drive[name], values=mean, times=None)
    each = [partial(averaged, c, every, recording.times, even, bent) for c in recording.channels.values()]
    channels = dict(zip(recording.channels, shared(each), strict=True))
    return replace(out, channels=channels, drive=drive)


def averaged(channel: Channel, every: int, times: np.ndarray, even: np.ndarray, as_read: np.ndarray) -> Channel:
    """A channel thinned by means over frames, with the noise that these show: no less than that of frames that are
    independent, nor of the steps of the readings.

    Args:
        times: (n,) [s]. even: (n - 1,) which steps in time are as usual. as_read: which of the frames that are left
            stay as they were read.
    """
    at, out = np.arange(0, len(channel.values), every), filtered(channel.values, every, even)
    if len(at) < 3:
        return replace(channel, values=out)
    out[as_read] = channel.values[at][as_read]
    share, bend = weighted(every)
    least = channel.noise * np.hypot(1.0 + 2.0 * bend, np.sqrt(2.0) * bend) * np.linalg.norm(share)  # white noise
    report = channel.noise_report
    count = report.quantum / np.sqrt(12.0) if report is not None else 0.0
    noise = float(np.clip(estimate_noise(times[at], out), min(max(least, count), channel.noise), channel.noise))
    if report is not None and channel.noise == report.level:  # it was read from the data, and still is
        report = replace(report, level=noise)
    return replace(channel, values=out, noise=noise, noise_report=report)


def weighted(every: int) -> tuple[np.ndarray, float]:
    """Weights of the frames around one of so many, and the part of a second difference by which their mean is off."""
    away = np.arange(-(every // 2), every // 2 + 1)
    share = np.where(2 * np.abs(away) == every, 0.5, 1.0) / every
    return share, float(share @ away**2) / (2.0 * every**2)


def filtered(series: np.ndarray, every: int, even: np.ndarray) -> np.ndarray:
    """Means of values [n, ...] around one frame of so many.

    A mean over a bend is off by half its second derivative times the mean square of the distances, which the means
    beside it tell. Where frames are missing a parabola through the others takes its place. What lies at a gap in time,
    and the first and last frame, stays as it was read.
    """
    n, half, at = len(series), every // 2, np.arange(0, len(series), every)
    if len(at) < 3:
        return series[::every]
    share, bend = weighted(every)
    values, away = series.reshape(n, -1), np.arange(-half, half + 1)
    around = values[np.minimum(at[1:-1, None] + away, n - 1)]
    means = np.concatenate([values[:1], np.einsum("j,njd->nd", share, around), values[at[-1:]]])
    inner = means[1:-1] - bend * (means[2:] - 2.0 * means[1:-1] + means[:-2])
    odd = np.concatenate([[0], np.cumsum(~even)])  # odd steps before each frame
    first, last = np.maximum(at[:-2] - half, 0), np.minimum(at[2:] + half, n - 1)
    whole = odd[first] == odd[last]
    out = values[at]
    out[1:-1] = np.where(whole[:, None] & np.isfinite(inner), inner, out[1:-1])
    for k, d in np.argwhere(whole[:, None] & np.isnan(inner)).tolist():
        frames = np.arange(first[k], last[k] + 1)
        part, x = values[frames, d], frames - at[k + 1]
        seen = np.isfinite(part)
        if seen.sum() >= 2 * every and np.any(seen & (x < 0)) and np.any(seen & (x > 0)):
            out[k + 1, d] = np.polynomial.Polynomial.fit(x[seen], part[seen], 2)(0.0)
    return out.reshape(len(at), *series.shape[1:])

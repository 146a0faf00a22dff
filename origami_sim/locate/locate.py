"""Where the mismatch is: the moment that a recorded motion needs at each crease beyond what the model gives (equation
error).

Panels are taken as rigid. A recorded frame gives the coordinates of the tree; a smoother gives their rates and
accelerations; the residual generalised force is J'(m a - f), which for a crease's fold angle is the moment that is
missing at that crease, whatever its cause, and for a device that nothing holds also the wrench that is missing on its
root panel. Its product with the rate is the unexplained power.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.signal import savgol_coeffs, savgol_filter

from origami_sim.drive import Drive, Signal
from origami_sim.fit.least_squares import Fit
from origami_sim.locate.places import REVERSAL, Curve, Place
from origami_sim.model import Model, Parameters, State, node_mass
from origami_sim.model.articulation import Pose
from origami_sim.model.distort import distorted
from origami_sim.predict.curves import PASSIVE
from origami_sim.predict.rollouts import Rollouts
from origami_sim.predict.track import Track, followed
from origami_sim.solve.batch import Batch

BINS = 13
"""Bins of a curve, of equal numbers of frames."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Smoothed motion of the tree in one recording, and the generalised forces that it needs.

    Attributes:
        times: (n,) [s]. q, rate, acceleration: [m, n]. missing: [m, n] needed less modelled. error: [m, n] its
            deviation. inertia: [m, m, n] by which accelerations need forces. noise: (m,) deviation of these.
        modelled: [m, n] forces of the model. pose: of the frames. told: (m,) whether the channels tell a coordinate.
        drive: channel -> (n,) values of what varies. half: half window of the smoother [frames].
    """

    times: np.ndarray
    q: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    missing: np.ndarray
    error: np.ndarray
    inertia: np.ndarray
    noise: np.ndarray
    modelled: np.ndarray
    pose: Pose
    told: np.ndarray
    drive: dict[str, np.ndarray]
    half: int

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Means of values [..., n] over windows."""
        return self._windows(values).mean(-1)

    def middle(self, values: np.ndarray) -> np.ndarray:
        """Values [..., n] in the middle of windows."""
        windows = self._windows(values)
        return windows[..., windows.shape[-1] // 2]

    def thinned(self, by: int) -> "Motion":
        """Every so many frames."""
        return replace(self.part(slice(None, None, by)), half=self.half // by)

    def part(self, some: slice | np.ndarray) -> "Motion":
        """Some of the frames."""
        part = {f.name: getattr(self, f.name)[..., some] for f in fields(self) if f.name in _BY_FRAME}
        return replace(self, **part, pose=self.pose.select(some), drive={n: v[some] for n, v in self.drive.items()})

    def _windows(self, values: np.ndarray) -> np.ndarray:
        width, count = self.width, max(1, len(self.times) // self.width)
        return values[..., : count * width].reshape(*values.shape[:-1], count, -1)

    @property
    def width(self) -> int:
        """Frames of a window."""
        return max(2 * self.half + 1, round(WINDOW / (self.times[1] - self.times[0])))

    @property
    def calmer(self) -> float:
        """Noise of the mean acceleration over a window, which is that of the rates at its ends, by that of one."""
        point = savgol_coeffs(2 * self.half + 1, 4, deriv=2)
        return float(np.linalg.norm(np.convolve(point, np.ones(self.width) / self.width)) / np.linalg.norm(point))


_BY_FRAME = ("times", "q", "rate", "acceleration", "missing", "error", "inertia", "modelled")


def motion(
    forward: Rollouts,
    fit: Fit,
    index: int,
    *,
    path: Track | None = None,
    half: int | None = None,
    frames: np.ndarray | None = None,
) -> Motion | None:
    """The smoothed motion of a recording, and what is missing in it under a fitted hypothesis.

    Of a device that nothing holds, frames near a contact are left out: in a blow a smoothed acceleration means nothing,
    see `impulses`.

    Args:
        path: another motion in its frames; None: the recorded one. half: half window of the smoother [frames]; None:
            the largest that leaves no more than noise. frames: their times [s]; None: all that can be smoothed.
    """
    recording, arm = forward.recordings[index], forward.articulation
    path = path or followed(forward, index)
    if path is None or not np.any(path.told) or not (arm.floating or np.all(path.told)):
        return None
    times = recording.times - recording.times[0]
    step = float(np.median(np.diff(times)))
    grid = np.arange(times[0], times[-1], step)
    q, noise, told = np.stack([np.interp(grid, times, row) for row in path.q]), path.noise, path.told
    half = half or _half_window(q[told], noise[told])
    if q.shape[1] < 4 * half + 2:
        return None
    smooth, rate, acceleration = (
        savgol_filter(q, 2 * half + 1, 3 if d < 2 else 4, deriv=d, delta=step, axis=1) for d in range(3)
    )
    rough = (q - smooth_of(q, half))[:, half:-half]
    deviation = np.maximum(noise, rough.std(axis=1)) * np.linalg.norm(
        savgol_coeffs(2 * half + 1, 4, deriv=2, delta=step)
    )
    model, parameters = forward.world(fit.hypothesis, fit.theta, fit.hypothesis.effects)
    without, parameters = loose(model, parameters)
    pose = path.at(grid + recording.times[0], smooth)
    drive = distorted(without, parameters, forward.drives[index], float(grid[-1]))
    inertia, free, gaps = dynamics(forward, without, parameters, frozen(drive, grid), pose, rate)
    keep = np.ones(len(grid), bool)
    if arm.floating:
        keep = ~spread_out(touching(gaps, noise[: arm.shifts].max()), half)
    keep[:half] = keep[-half:] = False
    if frames is not None:
        keep = np.isin(grid + recording.times[0], frames)
    if keep.sum() < 4 * half + 2:
        return None
    missing = np.einsum("mkw,kw->mw", inertia, acceleration) - free
    error = np.sqrt(np.einsum("mkw,k->mw", inertia**2, deviation**2))
    missing[~told], error[~told] = 0.0, np.inf
    varying = {n: _at(s, grid)[keep] for n, s in drive.signals.items() if np.ptp(_at(s, grid)) > 0}
    at, inertia, pose = grid[keep] + recording.times[0], inertia[:, :, keep], pose.select(keep)
    smooth, rate, acceleration, missing, error = (v[:, keep] for v in (smooth, rate, acceleration, missing, error))
    return Motion(
        at, smooth, rate, acceleration, missing, error, inertia, deviation, free[:, keep], pose, told, varying, half
    )


def frozen(drive: Drive, times: np.ndarray) -> Drive:
    """A drive that holds in each world what it gives at one of the times."""
    return drive.replace(**{n: Signal(offset=_at(s, times)) for n, s in drive.signals.items()})


def loose(model: Model, parameters: Parameters) -> tuple[Model, Parameters]:
    """The model without what keeps panels stiff, which rigid panels do not need."""
    without = model.with_effects(without=tuple(e for e in PASSIVE if e in model.effects))
    return without, parameters.for_model(without)


def dynamics(forward: Rollouts, model: Model, parameters: Parameters, drive: Drive, pose: Pose, rate: np.ndarray):
    """Generalised inertia [m, m, W], forces less centripetal ones [m, W], and gaps of all contacts [k, W].

    Args:
        pose: W poses. rate: [m, W] of the coordinates.
    """
    arm = forward.articulation
    x = arm.positions(pose)
    jacobian = arm.jacobian(pose, x)
    h = 1e-4
    ahead, behind = (arm.positions(arm.moved(pose, s * h * rate)) for s in (1, -1))
    state = State.at_rest(model, x.shape[1], position=x)
    state.v[:] = np.einsum("mnwa,mw->nwa", jacobian, rate)
    batch = Batch(model, parameters, drive, state, threads=forward.threads)
    mass = node_mass(model, parameters)[:, :, None]
    force = batch.total_force(0.0) - mass * (ahead - 2 * x + behind) / h**2
    inertia = np.einsum("mnwa,nwa,knwa->mkw", jacobian, np.broadcast_to(mass, x.shape), jacobian)
    gaps = batch.evaluate(0.0).gaps if len(model.contacts) else np.zeros((0, x.shape[1]))
    return inertia, np.einsum("mnwa,nwa->mw", jacobian, force), gaps


def touching(gaps: np.ndarray, noise: float) -> np.ndarray:
    """(n,) frames in which a contact may act: its gap [k, n] is less than the noise and half of the way of a frame."""
    if not len(gaps) or gaps.shape[1] < 2:
        return np.zeros(gaps.shape[1], bool)
    way = np.abs(np.diff(gaps, axis=1))
    way = np.maximum(np.pad(way, ((0, 0), (1, 0))), np.pad(way, ((0, 0), (0, 1))))
    return np.any(gaps < 3.0 * noise + 0.5 * way, axis=0)


def spread_out(mask: np.ndarray, by: int) -> np.ndarray:
    """A mask and so many frames around it."""
    return np.convolve(mask, np.ones(2 * by + 1), "same") > 0.5 if by else mask


def smooth_of(q: np.ndarray, half: int) -> np.ndarray:
    """The smoother's curve [m, n]."""
    return savgol_filter(q, 2 * half + 1, 4, axis=1)


def _at(signal: Signal, times: np.ndarray) -> np.ndarray:
    """What a signal of one world gives at some times (n,)."""
    return np.broadcast_to(signal(times[:, None]), (len(times), 1))[:, 0]


def _half_window(q: np.ndarray, noise: np.ndarray) -> int:
    """Largest half window for which the smoother leaves no more than the noise; at least 3 frames."""
    best = 3
    rough = q - savgol_filter(q, 7, 4, axis=1)
    # a fit of five numbers to seven leaves this part of the noise in the middle
    noise = np.maximum(noise, np.sqrt(np.mean(rough[:, 3:-3] ** 2, axis=1) / (1 - savgol_coeffs(7, 4)[3])))
    for half in (4, 6, 9, 13, 19, 28, 40):
        if 2 * half + 1 > q.shape[1] // 4:
            break
        left = q - savgol_filter(q, 2 * half + 1, 4, axis=1)
        if np.any(np.sqrt(np.mean(left[:, half:-half] ** 2, axis=1)) > 1.3 * noise):
            break
        best = half
    return best


def motions_of(forward: Rollouts, fit: Fit) -> list[Motion]:
    """The motions of all recordings that determine one."""
    return [m for m in (motion(forward, fit, r) for r in range(len(forward.recordings))) if m is not None]


def locate(forward: Rollouts, motions: Sequence[Motion]) -> list[Place]:
    """Places, most suspicious first: all coordinates of the tree; empty if the recordings do not determine them."""
    if not motions:
        return []
    out = []
    for k, name in enumerate(forward.articulation.names()):
        windows = [_windows(m, k) for m in motions]
        z = np.concatenate([w[1] / w[2] for w in windows])
        score = float(np.sqrt(np.mean(z**2)))
        first = motions[0]
        onset = _onset(*windows[0])
        power = float(np.mean(np.concatenate([m.missing[k] * m.rate[k] for m in motions])))
        thin = max(1, len(first.times) // 1500)
        out.append(
            Place(
                name,
                score,
                0.0,
                power,
                onset,
                first.times[::thin].tolist(),
                first.missing[k, ::thin].tolist(),
                first.error[k, ::thin].tolist(),
                _curves(motions, k),
                _balance(first, k) if first.told[k] else None,
            )
        )
    excess = np.array([max(p.score**2 - 1.0, 0.0) for p in out])
    for p, e in zip(out, excess, strict=True):
        p.share = float(e / excess.sum()) if excess.sum() > 0 else 1.0 / len(out)
    return sorted(out, key=lambda p: -p.score)


WINDOW = 0.1
"""Length of the windows over which the missing moment is averaged [s], at least that of the smoother."""


def _windows(m: Motion, k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Means over windows: times, missing moment, and its deviation."""
    return m.mean(m.times), m.mean(m.missing[k]), m.calmer * m.mean(m.error[k])


def _onset(times: np.ndarray, value: np.ndarray, error: np.ndarray) -> float:
    """First of three windows in a row beyond four deviations; nan if there are none."""
    far = np.abs(value) > 4 * error
    run = far[:-2] & far[1:-1] & far[2:]
    return float(times[np.argmax(run)]) if np.any(run) else float("nan")


def _balance(m: Motion, k: int) -> Curve:
    """Power that the model does not explain, by windows: means over them need rates at their ends only."""
    power = m.mean(m.missing[k] * m.rate[k])
    error = m.calmer * m.mean(m.error[k] * np.abs(m.rate[k]))
    return Curve(
        "time", "s", m.mean(m.times).tolist(), power.tolist(), error.tolist(), [len(m.times) // len(power)] * len(power)
    )


PERIODIC, LEAST = 0.8, 2.0
"""Part of a drive's variance that a harmonic and overtones explain if it is periodic, and periods of it at least."""

STEP = 0.25
"""Part of a drive's range that it changes by between two frames where it steps."""

TURNED = 0.1
"""Rate, in root mean squares, beyond which a motion goes one way; a reversal lies between two ways."""


def phase(times: np.ndarray, values: np.ndarray) -> np.ndarray | None:
    """Phase [rad] in [0, 2 pi) of a periodic signal, from its rising zero; None: it is not periodic."""
    span = times[-1] - times[0]
    even = np.linspace(times[0], times[-1], 2048)
    y = np.interp(even, times, values)
    y = y - y.mean()
    if not np.any(y):
        return None
    first = np.argmax(np.abs(np.fft.rfft(y * np.hanning(len(y))))) / (len(y) * (even[1] - even[0]))
    best, told = 0.0, None
    for f in first + np.linspace(-1.0, 1.0, 41) / span:
        if f * span < LEAST:
            continue
        angle = 2 * np.pi * f * np.outer(even - times[0], [1, 2, 3])
        waves = np.concatenate([np.sin(angle), np.cos(angle)], axis=1)
        x, *_ = np.linalg.lstsq(waves, y, rcond=None)
        explained = 1.0 - float(np.sum((y - waves @ x) ** 2) / (y @ y))
        if explained > best:
            best, told = explained, (f, np.arctan2(x[3], x[0]))
    if told is None or best < PERIODIC:
        return None
    return (2 * np.pi * told[0] * (times - times[0]) + told[1]) % (2 * np.pi)


def since(times: np.ndarray, events: np.ndarray) -> np.ndarray:
    """Time [s] since the last of some events (a mask of frames); nan before the first."""
    last = np.maximum.accumulate(np.where(events, times, -np.inf))
    return np.where(np.isfinite(last), times - last, np.nan)


def way(rate: np.ndarray) -> np.ndarray:
    """Way in which a motion goes, 1 or -1 (0 before it goes any); it is kept until the motion goes the other."""
    clear = np.sign(rate) * (np.abs(rate) > TURNED * np.sqrt(np.mean(rate**2)))
    return clear[np.maximum.accumulate(np.where(clear != 0, np.arange(len(clear)), 0))]


def reversals(rate: np.ndarray) -> np.ndarray:
    """Mask of the frames in which a motion has begun to go the other way."""
    held = way(rate)
    return np.concatenate([[False], held[1:] * held[:-1] < 0])


def against(motions: Sequence[Motion], k: int) -> dict[tuple[str, str], list[np.ndarray]]:
    """What a missing moment may go with, by name and unit: for each motion (n,); nan where it is not defined."""
    out = {("angle", "rad"): [m.q[k] for m in motions], ("rate", "rad/s"): [m.rate[k] for m in motions]}
    for n in sorted(set.intersection(*(set(m.drive) for m in motions))):
        unit = "T" if n.startswith("field") else "V" if n.startswith("voltage") else ""
        values = [m.drive[n] for m in motions]
        out[n, unit] = values
        phases = [phase(m.times, v) for m, v in zip(motions, values, strict=True)]
        told = [p for p in phases if p is not None]
        if len(told) == len(phases):
            out[f"phase of {n}", "rad"] = told
        jumps = [np.abs(np.diff(v, prepend=v[0])) > STEP * np.ptp(v) for v in values]
        if any(np.any(j) for j in jumps):
            out[f"time since a step of {n}", "s"] = [since(m.times, j) for m, j in zip(motions, jumps, strict=True)]
    turns = [since(m.times, reversals(m.rate[k])) for m in motions]
    if np.isfinite(np.concatenate(turns)).sum() > BINS:
        out[REVERSAL, "s"] = turns
    return out


def bins(x: np.ndarray) -> list[np.ndarray]:
    """Indices of the values in each bin of a curve, by size; of those that are numbers."""
    order = np.argsort(x, kind="stable")[: np.isfinite(x).sum()]  # what is not a number comes last
    return [p for p in np.array_split(order, BINS) if len(p)]


def _curves(motions: Sequence[Motion], k: int) -> list[Curve]:
    def joined(f):
        return np.concatenate([f(m) for m in motions])

    missing, along = joined(lambda m: m.missing[k]), joined(lambda m: m.missing[k] * way(m.rate[k]))
    width = 2 * max(m.half for m in motions) + 1
    out = []
    for (name, unit), each in against(motions, k).items():
        x, y = np.concatenate(each), along if name == REVERSAL else missing
        parts = bins(x)
        out.append(binned(name, unit, x, y, parts, [y[p].std() / np.sqrt(max(len(p) / width, 1.0)) for p in parts]))
    return out


def binned(name: str, unit: str, x: np.ndarray, y: np.ndarray, parts: Sequence[np.ndarray], errors) -> Curve:
    """Means of y against means of x in parts (indices), with the errors of the means."""
    middle, mean = ([float(v[p].mean()) for p in parts] for v in (x, y))
    return Curve(name, unit, middle, mean, [float(e) for e in errors], [len(p) for p in parts])

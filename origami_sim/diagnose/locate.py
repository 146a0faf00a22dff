"""Where the mismatch is: the moment that a recorded motion needs at each crease beyond what the model gives (equation
error).

Panels are taken as rigid. A recorded frame gives the coordinates of the tree; a smoother gives their rates and
accelerations; the residual generalised force is J'(m a - f), which for a crease's fold angle is the moment that is
missing at that crease, whatever its cause. Its product with the rate is the unexplained power.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_coeffs, savgol_filter

from origami_sim.diagnose.diagnosis import Curve, Place
from origami_sim.diagnose.forward import Forward, coordinates
from origami_sim.diagnose.refit import Fit
from origami_sim.distort import distorted
from origami_sim.drive import Signal
from origami_sim.model import State
from origami_sim.solve.batch import Batch

BINS = 13
"""Bins of a curve, of equal numbers of frames."""

PASSIVE = ("bars", "bar_viscosity", "panel_bending", "ogden_bars")
"""Effects that keep panels stiff; rigid panels do not need them."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Smoothed motion of the tree in one recording, and the generalised forces that it needs.

    Attributes:
        times: (n,) [s]. q, rate, acceleration: [m, n]. missing: [m, n] needed less modelled. error: [m, n] its
            deviation.
        drive: channel -> (n,) values of what varies. half: half window of the smoother [frames].
    """

    times: np.ndarray
    q: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    missing: np.ndarray
    error: np.ndarray
    drive: dict[str, np.ndarray]
    half: int


def motion(forward: Forward, fit: Fit, index: int) -> Motion | None:
    """The smoothed motion of a recording, and what is missing in it under a fitted hypothesis."""
    found = coordinates(forward, index)
    if found is None:
        return None
    q, noise = found
    recording, arm = forward.recordings[index], forward.articulation
    times = recording.times - recording.times[0]
    step = float(np.median(np.diff(times)))
    grid = np.arange(times[0], times[-1], step)
    q = np.stack([np.interp(grid, times, row) for row in q])
    half = _half_window(q, noise)
    smooth, rate, acceleration = (
        savgol_filter(q, 2 * half + 1, 3 if d < 2 else 4, deriv=d, delta=step, axis=1) for d in range(3)
    )
    keep = slice(half, q.shape[1] - half)
    smooth, rate, acceleration, grid = smooth[:, keep], rate[:, keep], acceleration[:, keep], grid[keep]
    rough = (q - smooth_of(q, half))[:, half:-half]
    deviation = np.maximum(noise, rough.std(axis=1)) * np.linalg.norm(
        savgol_coeffs(2 * half + 1, 4, deriv=2, delta=step)
    )
    model, parameters = forward._world(fit.hypothesis, fit.theta, fit.hypothesis.effects)
    without = model.with_effects(without=tuple(e for e in PASSIVE if e in model.effects))
    parameters = parameters.for_model(without)
    pose = arm.moved(arm.reference(len(grid)), smooth - arm.reference().angles)
    x = arm.positions(pose)
    jacobian = arm.jacobian(pose, x)
    velocity = np.einsum("mnwa,mw->nwa", jacobian, rate)
    h = 1e-4
    ahead, behind = (arm.positions(arm.moved(pose, s * h * rate)) for s in (1, -1))
    a = np.einsum("mnwa,mw->nwa", jacobian, acceleration) + (ahead - 2 * x + behind) / h**2
    drive = distorted(without, parameters, forward._drives[index], float(grid[-1]))
    frozen = drive.replace(**{n: Signal(offset=_at(s, grid)) for n, s in drive.signals.items()})
    state = State.at_rest(without, len(grid), position=x)
    state.v[:] = velocity
    force = Batch(without, parameters, frozen, state, threads=forward.threads).total_force(0.0)
    mass = parameters["inertia", "mass"][:, :, None]
    missing = np.einsum("mnwa,nwa->mw", jacobian, mass * a - force)
    inertia = np.einsum("mnwa,nwa,knwa->mkw", jacobian, np.broadcast_to(mass, x.shape), jacobian)
    error = np.sqrt(np.einsum("mkw,k->mw", inertia**2, deviation**2))
    varying = {n: _at(s, grid) for n, s in drive.signals.items() if np.ptp(_at(s, grid)) > 0}
    return Motion(grid + recording.times[0], smooth, rate, acceleration, missing, error, varying, half)


def smooth_of(q: np.ndarray, half: int) -> np.ndarray:
    """The smoother's curve [m, n]."""
    return savgol_filter(q, 2 * half + 1, 4, axis=1)


def _at(signal: Signal, times: np.ndarray) -> np.ndarray:
    return np.broadcast_to(np.squeeze(signal(times)), times.shape)


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


def locate(forward: Forward, fit: Fit) -> list[Place]:
    """Places, most suspicious first: all coordinates of the tree; empty if the recordings do not determine them."""
    motions = [m for m in (motion(forward, fit, r) for r in range(len(forward.recordings))) if m is not None]
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
            )
        )
    excess = np.array([max(p.score**2 - 1.0, 0.0) for p in out])
    for p, e in zip(out, excess, strict=True):
        p.share = float(e / excess.sum()) if excess.sum() > 0 else 1.0 / len(out)
    return sorted(out, key=lambda p: -p.score)


WINDOW = 0.1
"""Length of the windows over which the missing moment is averaged [s], at least that of the smoother."""


def _windows(m: Motion, k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Means over windows: times, missing moment, and its deviation.

    The noise of a mean acceleration is that of the rates at the two ends, much less than that of one acceleration.
    """
    step = m.times[1] - m.times[0]
    width = max(2 * m.half + 1, round(WINDOW / step))
    point = savgol_coeffs(2 * m.half + 1, 4, deriv=2)
    calmer = np.linalg.norm(np.convolve(point, np.ones(width) / width)) / np.linalg.norm(point)
    count = max(1, len(m.times) // width)
    cut = slice(0, count * width)
    times = m.times[cut].reshape(count, -1).mean(1)
    return times, m.missing[k, cut].reshape(count, -1).mean(1), calmer * m.error[k, cut].reshape(count, -1).mean(1)


def _onset(times: np.ndarray, value: np.ndarray, error: np.ndarray) -> float:
    """First of three windows in a row beyond four deviations; nan if there are none."""
    far = np.abs(value) > 4 * error
    run = far[:-2] & far[1:-1] & far[2:]
    return float(times[np.argmax(run)]) if np.any(run) else float("nan")


def _curves(motions: Sequence[Motion], k: int) -> list[Curve]:
    def joined(f):
        return np.concatenate([f(m) for m in motions])

    y = joined(lambda m: m.missing[k])
    width = 2 * max(m.half for m in motions) + 1
    against = {("angle", "rad"): joined(lambda m: m.q[k]), ("rate", "rad/s"): joined(lambda m: m.rate[k])}
    for n in sorted(set.intersection(*(set(m.drive) for m in motions))):
        unit = "T" if n.startswith("field") else "V" if n.startswith("voltage") else ""
        against[n, unit] = joined(lambda m, n=n: m.drive[n])
    out = []
    for (name, unit), x in against.items():
        order = np.argsort(x, kind="stable")
        parts = [p for p in np.array_split(order, BINS) if len(p)]
        out.append(
            Curve(
                name,
                unit,
                [float(x[p].mean()) for p in parts],
                [float(y[p].mean()) for p in parts],
                [float(y[p].std() / np.sqrt(max(len(p) / width, 1.0))) for p in parts],
                [len(p) for p in parts],
            )
        )
    return out

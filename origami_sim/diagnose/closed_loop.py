"""Whether a drive was a function of the recorded state: then what it does cannot be told from what the device does.

A drive that follows the state looks like a stiffness or a loss, whatever the model says. It is taken for one if a
function of the channels and their rates describes it much better than any simple script of time does, better than it
describes states of the same spectrum and random phases, and if the state does not merely follow the drive. A drive that
carries the tracker's own noise is one as well: a device does not move by the noise of its measurement.

What it is not: a proof of an open loop. A device that is driven in its own rhythm, by a plain sine, looks the same both
ways, and counts as driven by a script.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import hilbert, savgol_coeffs, savgol_filter
from scipy.stats import spearmanr

from origami_sim.observation.channels import component_names, stacked
from origami_sim.recording import Recording
from origami_sim.recording.recording import CHANNEL_KINDS

FEWEST = 60
"""Frames below which nothing is said."""

MOST = 3000
"""Frames that are looked at; longer recordings are thinned."""

EXPLAINED = 0.9
"""Share of the drive's variance that the state must describe."""

BETTER = 2.5
"""How many times more of it the best script must leave."""

PIECES, TONES, BINS = 12, 3, 20
"""Straight pieces and sines of the scripts that are tried; quantiles of the functions of one state."""

LAGS = (0, 1, 2, 3, 4, 6, 8)
"""Frames by which the state may be older than the drive."""

AUTONOMOUS, STRICTLY = 0.9, 0.98
"""Share of the accelerations that the state must determine where no lag tells which of the two follows the other."""

ECHO = 0.5
"""Rank correlation of what is left of drive and channel after smoothing that only a tracker's noise gives."""

DRAWS, CHANCE = 99, 0.01


@dataclass(frozen=True)
class Loop:
    """A drive that was a function of the state.

    Attributes:
        recording, drive: names. state: of what it is a function, in words.
        lag: by how much the drive comes later [s].
        explained: share of its variance that the state describes. scripted: that the best script of time describes.
        p_value: of a state with the same spectrum and random phases that describes it as well.
    """

    recording: str
    drive: str
    state: str
    lag: float
    explained: float
    scripted: float
    p_value: float

    @property
    def sentence(self) -> str:
        later = f" {1e3 * self.lag:.3g} ms before" if self.lag > 0 else ""
        return (
            f"The drive '{self.drive}' of '{self.recording}' is a function of the state: {self.state}{later} "
            f"{'describe' if self.state.endswith('s') else 'describes'} {_percent(self.explained)} of it, the best "
            f"script of time {_percent(self.scripted)} (p = {self.p_value:.2g}), so that its effect cannot be told "
            "from that of the device; record with a drive that does not listen to the device."
        )


def closed_loop(recordings: Sequence[Recording], seed: int = 0) -> Loop | None:
    """The first drive that was a function of the recorded state, or None.

    Load steps have no course in time and are not judged; nor are drives that hold, and recordings of less than 60
    frames.

    Args:
        recordings: with channels and drives. seed: of the surrogates.
    """
    for r in recordings:
        if r.by_step or len(r.times) < FEWEST or not r.channels:
            continue
        state = _state(r)
        if state is None:
            continue
        for name, u in _drives(r, state.times):
            found = _judged(state, u, np.random.default_rng(seed))
            if found is not None:
                words, lag, explained, scripted, p = found
                return Loop(r.name, name, words, lag, explained, scripted, p)
    return None


def scripted(times: np.ndarray, u: np.ndarray) -> float:
    """Share of the variance of a drive (n,) that the best simple script of time describes.

    The scripts: straight pieces with jumps between them, a waveform that repeats, a few sines, one sine whose frequency
    changes smoothly and whose amplitude changes evenly.
    """
    whole = float(np.sum((u - u.mean()) ** 2))
    outside = [np.flatnonzero(np.abs(u - end) > 0.02 * np.ptp(u)) for end in (u[0], u[-1])]
    part = slice(max(outside[0][0] - 1, 0), outside[1][-1] + 2)  # a burst: before and after, the drive holds
    t, v = times[part], u[part]
    inside = float(np.sum((v - v.mean()) ** 2)) / whole
    best = max(_tones(t, v), _repeated(t, v), _chirp(t, v)) if len(v) >= FEWEST // 2 else 0.0
    return max(_pieces(times, u), 1.0 - inside * (1.0 - best))


# the state ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _State:
    """Channels on an even grid: what a controller could have used.

    Attributes:
        names: (D,) components. times: (n,) [s]. raw, values, rates, accelerations: [D, n], smoothed but for `raw`.
        error: (D,) standard deviation of the accelerations' noise. half: half window of the smoother [frames].
    """

    names: list[str]
    times: np.ndarray
    raw: np.ndarray
    values: np.ndarray
    rates: np.ndarray
    accelerations: np.ndarray
    error: np.ndarray
    half: int


def _state(recording: Recording) -> _State | None:
    step = float(np.median(np.diff(recording.times)))
    step *= max(1, len(recording.times) // MOST)
    times = np.arange(recording.times[0], recording.times[-1] + 0.5 * step, step)
    times = np.minimum(times, recording.times[-1])
    values, _ = stacked(recording)
    seen = np.isfinite(values)
    moving = np.array([s.sum() > FEWEST // 2 and np.ptp(v[s]) > 0 for v, s in zip(values.T, seen.T, strict=True)])
    if not moving.any():
        return None
    names = [n for n, m in zip(component_names(recording), moving, strict=True) if m]
    columns = [(v[s], recording.times[s]) for v, s, m in zip(values.T, seen.T, moving, strict=True) if m]
    raw = np.stack([np.interp(times, t, v) for v, t in columns])
    half = _half_window(raw)
    smooth = [savgol_filter(raw, 2 * half + 1, 3 if d < 2 else 4, deriv=d, delta=step, axis=1) for d in range(3)]
    noise = (raw - smooth[0]).std(axis=1)
    slow, fast = (noise * np.linalg.norm(savgol_coeffs(2 * half + 1, 2 + d, deriv=d, delta=step)) for d in (1, 2))
    moves = np.flatnonzero(np.any(np.abs(smooth[1]) > 5 * slow[:, None], axis=0))
    if len(moves) < 2 or moves[-1] - moves[0] < FEWEST:  # a device at rest tells nothing
        return None
    part = slice(max(moves[0], half), min(moves[-1] + 1, len(times) - half))  # without the smoother's ends
    values, rates, accelerations = (s[:, part] for s in smooth)
    return _State(names, times[part], raw[:, part], values, rates, accelerations, fast, half)


def _half_window(raw: np.ndarray, parts: int = 10) -> int:
    """Half window of the widest smoother that leaves white noise everywhere, in every tenth of every row [D, n]."""

    def left(half: int) -> np.ndarray:
        rough = (raw - savgol_filter(raw, 2 * half + 1, 3, axis=1))[:, half : raw.shape[1] - half]
        squares = np.stack([np.mean(p**2, axis=1) for p in np.array_split(rough, parts, axis=1)])
        return np.sqrt(squares / (1.0 - savgol_coeffs(2 * half + 1, 3)[half]))

    best, noise = 3, np.median(left(3), axis=0)
    for half in (4, 6, 9, 13, 20):
        if 2 * half + 1 > raw.shape[1] // 4 or np.any(left(half) > 1.25 * noise):
            break
        best = half
    return best


def _drives(recording: Recording, times: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Name and values (n,) of every drive that varies."""
    for name, drive in recording.drive.items():
        if drive.constant or name in CHANNEL_KINDS:  # an angle that was prescribed is no drive
            continue
        values = np.asarray(drive.at(recording.times), float).reshape(len(recording.times), -1)
        for k, column in enumerate(values.T):
            if np.ptp(column) > 1e-9 * np.abs(column).max():
                label = name if values.shape[1] == 1 else f"{name}_{'xyz'[k] if values.shape[1] == 3 else k}"
                yield label, np.interp(times, recording.times, column)


# the judgement --------------------------------------------------------------------------------------------------------


def _judged(state: _State, u: np.ndarray, rng: np.random.Generator) -> tuple[str, float, float, float, float] | None:
    """State in words, lag [s], shares by state and by script, and p; None for a drive that is no function of it."""
    step = state.times[1] - state.times[0]
    echo = _echo(state, u)
    if echo is not None:
        name, lag, explained, p = echo
        return f"the tracker's own noise in {name}", lag * step, explained, scripted(state.times, u), p
    coordinates = _coordinates(state)
    calm = savgol_filter(u, 2 * state.half + 1, 3)  # as the channels were, which a linear function does not see
    profile = {
        c: {n: _explained(x, u if len(x) == 1 else calm, n) for n in (*LAGS, *(-m for m in LAGS))}
        for c, x in coordinates.items()
    }
    # one coordinate goes before all of them, unless they leave half as much
    left = {(c, n): (1.0 - profile[c][n]) * (2.0 if len(x) > 1 else 1.0) for c, x in coordinates.items() for n in LAGS}
    best, lag = min(left, key=lambda k: left[k])
    mine, sharp = profile[best], len(coordinates[best]) == 1
    by_time = scripted(state.times, u if sharp else calm)
    told = mine[lag] > EXPLAINED and (1.0 - mine[lag]) * BETTER < 1.0 - by_time
    if not told or not _leads(mine, _later(state, u, calm), state, sharp):
        return None
    reached = 0
    for _ in range(DRAWS):
        surrogates = _coordinates(state, rng.uniform(0.0, 2 * np.pi, len(state.times) // 2 + 1))
        reached += any(
            _explained(x, u if len(x) == 1 else calm, n) >= mine[lag] for x in surrogates.values() for n in LAGS
        )
        if (1 + reached) / (DRAWS + 1) > CHANCE:
            return None
    return best, lag * step, mine[lag], by_time, (1 + reached) / (DRAWS + 1)


def _coordinates(state: _State, phases: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """What the drive may be a function of: each value, each rate, and all of them linearly; [k, n] by their words.

    With phases, all spectra keep their size and their phases against each other, and nothing else.
    """
    both = np.concatenate([state.values, state.rates])
    if phases is not None:
        spectrum = np.fft.rfft(both - both.mean(axis=1, keepdims=True), axis=1)
        both = np.fft.irfft(spectrum * np.exp(1j * phases[: spectrum.shape[1]]), both.shape[1], axis=1)
    names = [*state.names, *(f"the rate of {n}" for n in state.names)]
    out = {name: x[None] for name, x in zip(names, both, strict=True)}
    out["all channels and their rates"] = both
    return out


def _explained(x: np.ndarray, u: np.ndarray, lag: int) -> float:
    """Share of the variance of u (n,) that x [k, n], `lag` frames before, describes: any function of one coordinate, a
    linear one of several."""
    most, n = max(LAGS), len(u)  # the same frames of the drive for every lag
    x, u = x[:, most - lag : n - most - lag], u[most : n - most]
    if len(x) > 1:
        x = x - x.mean(axis=1, keepdims=True)
        return _share(u, _linear(x.T, u - u.mean()) + u.mean())
    return _share(u, _function(x[0], u))


def _function(s: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Best straight piece in each quantile of s, with an edge where one step fits best: lines and steps are exact."""
    order = np.argsort(s)
    count = np.arange(1, len(s))
    below = np.cumsum(u[order] - u.mean())[:-1]
    step = s[order[1 + int(np.argmax(below**2 / (count * (len(s) - count))))]]
    edges = np.unique(np.append(np.quantile(s, np.linspace(0, 1, BINS + 1)[1:-1]), step))
    of = np.searchsorted(edges, s, side="right")
    count = np.maximum(np.bincount(of, minlength=len(edges) + 1), 1)
    x = s - (np.bincount(of, s, len(edges) + 1) / count)[of]
    mean = np.bincount(of, u, len(edges) + 1) / count
    xx, xu = np.bincount(of, x * x, len(edges) + 1), np.bincount(of, x * u, len(edges) + 1)
    slope = np.where(xx > 1e-12 * xx.sum(), xu / np.maximum(xx, 1e-300), 0.0)
    return mean[of] + slope[of] * x


def _leads(profile: dict[int, float], later: float, state: _State, sharp: bool) -> bool:
    """Whether the drive follows the state, and not the state the drive.

    If a lag tells, it decides. Else the state must move by a law of its own, because a drive that is no script would
    show in the accelerations; the more so where the values alone, `later` than the drive, describe it as well, as those
    of a device that follows its drive do.

    Args:
        profile: share explained by lag. later: share that later values alone explain.
        sharp: whether a lag can tell; with values and rates together, a lag is only another mixture of them.
    """
    left = {n: max(1.0 - share, 1e-12) for n, share in profile.items()}
    before, now, after = (min(left[n] for n in side) for side in ([-m for m in LAGS[1:]], [0], LAGS[1:]))
    if sharp and before < 0.5 * min(now, after):
        return False
    if sharp and after < 0.5 * min(now, before):
        return True
    follows = 1.0 - later < 2.0 * min(now, after)
    return _autonomous(state) > (STRICTLY if follows else AUTONOMOUS)


def _later(state: _State, u: np.ndarray, calm: np.ndarray) -> float:
    """Share of the drive that the values alone describe, some frames later."""
    return max(_explained(state.values, u if len(state.names) == 1 else calm, -n) for n in LAGS[1:])


def _autonomous(state: _State) -> float:
    """Share of the accelerations' variance (less their noise) that values and rates determine, mean over components."""
    both = np.concatenate([state.values, state.rates])
    basis = [np.ones(both.shape[1])]
    for s in both:
        z = (s - s.mean()) / s.std()
        basis += [z, z**3, np.tanh(s / (0.1 * s.std()))]
    shares = []
    for a, error in zip(state.accelerations, state.error, strict=True):
        left = np.mean((a - _linear(np.stack(basis, axis=1), a)) ** 2)
        signal = a.var() - error**2
        if signal > 0:
            shares.append(1.0 - max(left - error**2, 0.0) / signal)
    return float(np.mean(shares)) if shares else 0.0


def _echo(state: _State, u: np.ndarray) -> tuple[str, int, float, float] | None:
    """A channel whose noise the drive repeats: name, lag in frames, share of the drive's noise, p; or None.

    Both are judged by their sixth differences, in ranks, so that single jumps do not count.
    """
    rough = np.diff(u, 6)
    if np.median(np.abs(rough)) <= 1e-9 * np.ptp(u):
        return None
    found = []
    for name, raw in zip(state.names, state.raw, strict=True):
        own = np.diff(raw, 6)
        for lag in LAGS:
            r, p = spearmanr(own[: len(own) - lag], rough[lag:])
            found.append((abs(float(r)), float(p) * len(LAGS) * len(state.names), name, lag))
    r, p, name, lag = max(found)
    return (name, lag, r**2, p) if r > ECHO and p <= CHANCE else None


# scripts --------------------------------------------------------------------------------------------------------------


def _share(u: np.ndarray, fitted: np.ndarray) -> float:
    total = float(np.sum((u - u.mean()) ** 2))
    return 1.0 - float(np.sum((u - fitted) ** 2)) / total if total > 0 else 1.0


def _linear(basis: np.ndarray, u: np.ndarray) -> np.ndarray:
    scale = np.maximum(np.linalg.norm(basis, axis=0), 1e-300)
    return basis @ (np.linalg.lstsq(basis / scale, u, rcond=1e-10)[0] / scale)


def _pieces(times: np.ndarray, u: np.ndarray, most: int = 400) -> float:
    """Straight pieces, their ends chosen by dynamic programming on at most `most` samples."""
    pick = np.unique(np.linspace(0, len(u) - 1, most).astype(int))
    t, v = (times[pick] - times.mean()) / np.ptp(times), u[pick] - u.mean()
    one, st, sv, stt, stv, svv = (np.insert(np.cumsum(q), 0, 0.0) for q in (t * 0 + 1, t, v, t * t, t * v, v * v))
    n = len(t)
    a, b = np.meshgrid(np.arange(n), np.arange(1, n + 1), indexing="ij")  # piece a..b-1
    count = np.maximum(one[b] - one[a], 1.0)
    mt, mv = (st[b] - st[a]) / count, (sv[b] - sv[a]) / count
    tt, tv, vv = stt[b] - stt[a] - count * mt**2, stv[b] - stv[a] - count * mt * mv, svv[b] - svv[a] - count * mv**2
    cost = vv - np.where(tt > 1e-12, tv**2 / np.maximum(tt, 1e-12), 0.0)
    cost = np.where(b > a, np.maximum(cost, 0.0), np.inf)
    best = cost[0]
    for _ in range(PIECES - 1):
        best = np.minimum(best, np.min(np.insert(best[:-1], 0, np.inf)[:, None] + cost, axis=0))
    return 1.0 - float(best[-1]) / max(float(vv[0, -1]), 1e-300)


def _wave(times: np.ndarray, frequency: float) -> np.ndarray:
    phase = 2 * np.pi * frequency * (times - times[0])
    return np.stack([np.cos(phase), np.sin(phase)], axis=1)


def _peak(times: np.ndarray, u: np.ndarray) -> float:
    """Frequency [Hz] of the sine that takes most from u."""
    step, span = times[1] - times[0], np.ptp(times)
    power = np.abs(np.fft.rfft(u - u.mean(), 8 * len(u))) ** 2
    grid = np.fft.rfftfreq(8 * len(u), step)
    rough = grid[np.argmax(power)]
    fine = rough + np.linspace(-0.15, 0.15, 61) / span
    shares = [_share(u, _linear(np.column_stack([np.ones(len(u)), _wave(times, f)]), u)) for f in fine]
    return float(fine[int(np.argmax(shares))])


def _tones(times: np.ndarray, u: np.ndarray) -> float:
    """A constant and a few sines, one after the other."""
    basis = np.ones((len(u), 1))
    for _ in range(TONES):
        basis = np.column_stack([basis, _wave(times, _peak(times, u - _linear(basis, u)))])
    return _share(u, _linear(basis, u))


def _repeated(times: np.ndarray, u: np.ndarray) -> float:
    """A waveform that is repeated at least three times."""
    step, span = times[1] - times[0], np.ptp(times)
    peak, best = _peak(times, u), 0.0
    for part in (1, 2, 3):  # the strongest sine may be an overtone
        for f in peak / part * (1 + np.linspace(-0.3, 0.3, 31) / (peak * span)):
            if f * span < 3 or f <= 0:
                continue
            bins = int(np.clip(1 / (f * step), 4, len(u) / 5))
            of = (np.mod((times - times[0]) * f, 1.0) * bins).astype(int) % bins
            mean = np.bincount(of, u, bins) / np.maximum(np.bincount(of, minlength=bins), 1)
            best = max(best, _share(u, mean[of]))
    return best


def _chirp(times: np.ndarray, u: np.ndarray) -> float:
    """A sine whose phase is a cubic of time, and whose amplitude changes evenly."""
    t = (times - times[0]) / np.ptp(times)
    analytic = hilbert(u - u.mean())
    start = np.polyfit(t, np.unwrap(np.angle(analytic)), 3, w=np.abs(analytic))

    def left(phase: np.ndarray) -> np.ndarray:
        wave = np.stack([np.cos(np.polyval(phase, t)), np.sin(np.polyval(phase, t))], axis=1)
        return u - _linear(np.column_stack([np.ones(len(u)), wave, t[:, None] * wave]), u)

    found = least_squares(left, start, max_nfev=10)
    return _share(u, u - found.fun)


def _percent(share: float) -> str:
    return f"{100 * max(share, 0.0):.0f} %" if share < 0.995 else f"{100 * share:.2f} %"

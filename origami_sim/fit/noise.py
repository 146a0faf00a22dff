"""Level and colour of the measurement noise, from the frequencies that no motion reaches, and whitening by both.

A motion is smooth: above some frequency a recording holds noise alone. There the power spectrum is compared with those
of everything a tracker may do to white noise (`colour`); the posterior over all of them gives level and correlation,
and with them the noise at the frequencies of the motion, where it cannot be seen. Where noise begins is inferred as
well: a frequency below it may have any power (Whittle 1953 for the likelihood; a scale prior for powers that are free).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from scipy.interpolate import make_lsq_spline
from scipy.signal.windows import dpss
from scipy.special import gammaln, logsumexp
from scipy.stats import chi2, gamma

from origami_sim.errors import InputError
from origami_sim.fit.colour import Colours, all_colours, refined
from origami_sim.fit.correlated import divided, factor, multiplied
from origami_sim.recording import Channel, Recording, estimate_noise
from origami_sim.recording.recording import quantisation, rounding, scaled_differences

STATED = float(np.log(1.5))
"""Standard deviation of the logarithm of a stated noise: people know theirs to a factor of 1.5.

Some hundred frames outweigh it; half or double of it matters for shorter recordings only.
"""

TAPERS = {256: 5.0, 128: 5.0, 64: 4.0, 32: 3.0}
"""Length of the segments whose spectra are averaged [frames]: time-bandwidth product of their taper.

The longest that most of the recording can be cut into; half of 256 resolves motion and noise half as well, double of it
gains nothing for noise that forgets within 40 frames. With 5 a motion leaks 1e-6 of its amplitude to other frequencies,
with 4 it is 1e-5, above the noise of a good encoder; 6 widens every line by a fifth. In short ones motions are slow.
"""

ORDER = 2
"""Order of the differences that are taken before, which lower slow motions further. With 4 the noise's own power at
high frequencies leaks down to the low ones."""

HIGHEST = 0.3
"""Cycles per frame above which there is noise alone in any case. A motion that is recorded with fewer than 3.3 frames
per oscillation makes the noise too large; at 0.4 a tenth of the data is left to tell a colour by."""

FREE = float(np.log(1e12))
"""Width of the scale prior of a power that may be anything: from that of rounding to that of a motion. It costs a
frequency that is said to hold motion 3.3; half or double of the exponent changes that by 0.7."""

LIVELY, WINDOW, LONG = 4.0, 24, 8
"""A burst: noise that is locally, in a window of frames, so many times its usual level, and lasts so long at least.

Shorter events (an impact, a snap) are the object's. A median of three exceeds 4 times once in 4e5 frames, but 3 times
in one recording of 3000 out of three; with 4 frames impacts would be bursts.
"""

STANDS = 16
"""Frames in which a reading does not change from which on they count once.

Numbers of least squares are off by 0.9 to 1.5 of what is stated then, for swings over 0.6 to 30 steps with noise of
0.02 to 0.8 of one; by 2.0 and 4.3 where a swing below a step has little noise (3.6 and 6.0 with all frames). The price:
slow swings over three steps with little noise are known 2.2 times less well. Half: off by 2.2 at most, and a quarter is
lost also where noise moves the readings. Double: by 2.0 to 4.0 where there is little noise. Of two recordings of a real
pendulum drag and a loss of the hinge, which do the same, are 0.49 to 0.51, with double 0.40 to 0.60, with half as here.
"""

RARE = 1e-4
"""Segments with a power, in any octave, that noise as in the median segment has more rarely than this are left out: an
impact passed through. At 1e-2 noise itself is trimmed, at 1e-8 an impact of ten times the noise stays in."""

RESOLVED = 1e-6
"""Power, relative to the largest of the noise, below which a colour is not followed: a thousandth of the amplitude,
less than the digits of most files. At 1e-8 a motion's leakage is taken for a colour, at 1e-4 averages are blurred."""

NEGLIGIBLE = 1e-5
"""Correlation that is taken as none; ten times more costs a per cent of the whitened variance for slow filters."""


@dataclass(frozen=True)
class Burst:
    """Frames from `first` to `last` [s] in which the noise is `factor` times its usual level."""

    first: float
    last: float
    factor: float


@dataclass(frozen=True, eq=False)
class Noise:
    """Measurement noise of one component of a channel.

    Attributes:
        deviation: standard deviation of a reading outside bursts, filters and rounding included [SI].
        colour: (Q + 1,) correlation of readings 0 to Q frames apart; colour[0] is 1, beyond Q there is none.
        frame: time between frames [s].
        quantum: step of the readings [SI]; 0 where none shows.
        kind: the most probable colour, in words. error: relative standard deviation of `deviation`.
        band: frequency [Hz] above which there is noise alone.
        bursts: when the noise is larger.
        systematic: deviation of what is not the object's and does not average out (a lens, a scale): a smooth error of
            frequencies below `band` [SI].
    """

    deviation: float
    colour: np.ndarray = field(default_factory=lambda: np.ones(1))
    frame: float = 1.0
    quantum: float = 0.0
    kind: str = "white"
    error: float = 0.0
    band: float = 0.0
    bursts: tuple[Burst, ...] = ()
    systematic: float = 0.0

    def whiten(self, values: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Columns in which this noise has unit variance and no correlation, (n,) or (n, k) as given.

        Frames with a nan in any column are missing: they stay nan, and the correlation across them is exact. Frames
        are counted by their times, rounded to whole ones, because a tracker filters frames.

        Args:
            values: (n,) or (n, k) readings, residuals or derivatives [SI]. times: (n,) increasing [s].

        Raises:
            InputError: another number of times than values.
        """
        columns, seen, scale, frames = self._arranged(values, times)
        white = np.full(columns.shape, np.nan)
        if seen.any():
            bands = factor(self.colour, frames)
            white[seen] = divided(bands, columns[seen] / scale[:, None])
            if self.systematic > 0:  # (1 + U U')^(-1/2), by the eigenvectors of U' U
                smooth = divided(bands, self._smooth(times[seen]) / scale[:, None])
                power, axes = np.linalg.eigh(smooth.T @ smooth)
                power = np.maximum(power, 1e-12)
                shrink = (1 - 1 / np.sqrt(1 + power)) / power
                white[seen] -= smooth @ (axes @ (shrink[:, None] * (axes.T @ (smooth.T @ white[seen]))))
        return white.reshape(np.shape(values))

    def draw(self, times: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """A sample (n,) of this noise at increasing times (n,) [s], rounding and `systematic` left out [SI]."""
        _, _, scale, frames = self._arranged(np.zeros(len(times)), times)
        white = rng.normal(size=len(times))[:, None]
        out = multiplied(factor(self.colour, frames), white)[:, 0]
        return out * scale

    def _arranged(self, values: np.ndarray, times: np.ndarray):
        """Columns, which frames are seen, their deviations and their numbers."""
        columns = np.asarray(values, float).reshape(len(values), -1)
        if len(times) != len(columns):
            raise InputError("noise is whitened frame by frame", field="times", value=len(times), allowed=len(columns))
        seen = np.isfinite(columns).all(axis=1)
        scale = np.full(len(times), self.deviation)
        for b in self.bursts:
            scale[(times >= b.first) & (times <= b.last)] *= b.factor
        return columns, seen, scale[seen], numbered(times, self.frame)[seen]

    def _smooth(self, times: np.ndarray) -> np.ndarray:
        """[n, J] cosines up to `band` that have together the variance of `systematic`."""
        span = float(np.ptp(times)) + self.frame
        count = max(int(2 * self.band * span), 1)
        waves = np.cos(np.pi * np.outer((times - times[0] + 0.5 * self.frame) / span, np.arange(count + 1)))
        waves[:, 1:] *= np.sqrt(2.0)
        return waves * self.systematic / np.sqrt(count + 1)


def numbered(times: np.ndarray, frame: float) -> np.ndarray:
    """Numbers (n,) of frames at increasing times [s]: neighbours differ by whole numbers, by one at least."""
    steps = np.maximum(np.round(np.diff(times) / frame), 1).astype(np.int64)
    return np.concatenate([[0], np.cumsum(steps)])


def without_repeats(values: np.ndarray) -> np.ndarray:
    """Readings (n, D) of which a sensor that stands on one of its steps for `STANDS` frames or more counts once.

    Its error is the same in all of these frames, so that they tell no more than the one in the middle, which is kept;
    the others are nan. Taken for as many readings, they would tell of motions far below the step.
    """
    out = values.copy()
    for d, column in enumerate(values.T):
        edges = np.flatnonzero(np.r_[True, ~(np.abs(np.diff(column)) <= rounding(column)), True])
        for k in np.flatnonzero(np.diff(edges) >= STANDS):
            middle = (edges[k] + edges[k + 1]) // 2
            out[edges[k] : edges[k + 1], d] = np.nan
            out[middle, d] = column[middle]
    return out


def noise_of(
    recording: Recording,
    residuals: Mapping[str, np.ndarray] | None = None,
    *,
    stated: Mapping[str, float | None] | None = None,
    systematic: Mapping[str, float] | None = None,
    fastest: float | None = None,
) -> dict[str, tuple[Noise, ...]]:
    """Noise of every channel of a recording, by name, one for each component.

    Args:
        residuals: what a model leaves of channels, in the shape of their values [SI]; the readings of others are used.
        stated: noise [SI] that is known by channel, as a prior; None: nothing is. By default it is what the recording
            states, and where it states nothing, nothing.
        systematic: deviation [SI] of smooth errors by channel.
        fastest: frequency [Hz] up to which the object can move; what lies below is not taken for noise.
    """
    out = {}
    for name, channel in recording.channels.items():
        values = channel.values if residuals is None or name not in residuals else residuals[name]
        out[name] = tuple(
            infer(
                recording.times,
                column,
                readings=read,
                stated=stated[name] if stated and name in stated else _stated(channel),
                systematic=(systematic or {}).get(name, 0.0),
                fastest=fastest,
            )
            for column, read in zip(_columns(values), _columns(channel.values), strict=True)
        )
    return out


def _stated(channel: Channel) -> float | None:
    """The noise that a channel states; None where it is what the reading estimated."""
    report = channel.noise_report
    given = channel.noise > 0 and (report is None or channel.noise != report.level)
    return channel.noise if given else None


def _columns(values: np.ndarray) -> np.ndarray:
    return np.asarray(values, float).reshape(len(values), -1).T


def infer(
    times: np.ndarray,
    values: np.ndarray,
    *,
    readings: np.ndarray | None = None,
    stated: float | None = None,
    systematic: float = 0.0,
    fastest: float | None = None,
) -> Noise:
    """Level and colour of the noise in readings of a smooth motion, or in what a model leaves of them.

    Args:
        times: (n,) increasing [s]. values: (n,) readings or residuals [SI]; nan where missing.
        readings: (n,) what was read, for the quantum, where `values` are residuals.
        stated: noise that is known before [SI], a prior. systematic: see `Noise`.
        fastest: frequency [Hz] up to which the object can move; None: inferred.

    Raises:
        InputError: no two readings, times that do not increase, a noise or a systematic error that is no such number.
    """
    values, times = np.asarray(values, float), np.asarray(times, float)
    if np.count_nonzero(np.isfinite(values)) < 2:
        raise InputError("noise needs readings", field="values", value=int(np.isfinite(values).sum()), allowed=">= 2")
    if stated is not None and not (np.isfinite(stated) and stated > 0):
        raise InputError("a noise is positive", field="stated", value=stated, allowed="> 0")
    if not (np.isfinite(systematic) and systematic >= 0):
        raise InputError("a systematic error is not negative", field="systematic", value=systematic, allowed=">= 0")
    if times.shape != values.shape or not np.all(np.diff(times) > 0):
        raise InputError("noise needs one reading at each of increasing times", field="times", value=times.shape)
    frame = float(np.median(np.diff(times)))
    quantum = quantisation(values if readings is None else np.asarray(readings, float))
    bursts, events = _bursts(times, values)
    quiet = np.where(events, np.nan, _evened(times, values, frame))
    found = _spectral(numbered(times, frame), quiet, stated, None if fastest is None else fastest * frame)
    least = max(quantum / np.sqrt(12.0), float(np.finfo(float).eps * np.nanmax(np.abs(values))), 1e-300)
    if found is None:  # too few frames for a spectrum
        seen = np.isfinite(values)
        level = estimate_noise(times[seen], values[seen])
        doubt = np.sqrt(4.6 / max(np.count_nonzero(seen) - 6, 1))  # of a median of correlated differences
        if stated is not None:
            level, doubt = _with_prior(level, doubt, stated) if level > least else (stated, STATED)
        found = _Found(level, doubt, np.ones(1), "white", HIGHEST if fastest is None else fastest * frame)
    level = found.deviation
    colour = found.colour if level > least else np.ones(1)
    return Noise(
        deviation=max(level, least),
        colour=colour,
        frame=frame,
        quantum=quantum,
        kind=found.kind if level > least else "rounding",
        error=found.error,
        band=found.edge / frame,
        bursts=bursts,
        systematic=systematic,
    )


@dataclass(frozen=True, eq=False)
class _Found:
    """Deviation, its relative error, correlation, kind, and the lowest frequency of noise alone [cycles per frame]."""

    deviation: float
    error: float
    colour: np.ndarray
    kind: str
    edge: float


def _with_prior(level: float, error: float, stated: float) -> tuple[float, float]:
    """Level and relative error after a stated one is taken into account, both normal in the logarithm."""
    weight = STATED**2 / (STATED**2 + error**2)
    return float(np.exp(weight * np.log(level) + (1 - weight) * np.log(stated))), error * float(np.sqrt(weight))


def _evened(times: np.ndarray, values: np.ndarray, frame: float) -> np.ndarray:
    """The values, of frames at uneven times without the slow part: a motion seen unevenly is not smooth by frames.

    That is a quintic spline of one knot in 8 frames, which leaves frequencies above a tenth per frame as they are.
    """
    seen = np.isfinite(values)
    number = numbered(times, frame)
    off = np.abs(times - times[0] - number * frame)
    off = np.abs(np.diff(off, prepend=0.0))
    rate = np.abs(np.gradient(values[seen], times[seen])) if seen.sum() > 2 else np.zeros(1)
    if np.median(rate) * np.median(off) < 0.1 * estimate_noise(times[seen], values[seen]):
        return values
    out = np.full(len(values), np.nan)
    for run in np.split(np.arange(len(times)), np.flatnonzero(np.diff(number) > 8) + 1):
        mine = run[seen[run]]
        if len(mine) < 24:
            continue
        knots = times[mine[8:-8:8]]
        ends = times[mine[0]], times[mine[-1]]
        spline = make_lsq_spline(times[mine], values[mine], np.r_[[ends[0]] * 6, knots, [ends[1]] * 6], k=5)
        out[mine] = values[mine] - spline(times[mine])
    return out


def _bursts(times: np.ndarray, values: np.ndarray) -> tuple[tuple[Burst, ...], np.ndarray]:
    """Bursts of noise, and frames (n,) in which something happens, bursts or single events."""
    n, width = len(values), 7
    events = np.zeros(n, bool)
    if n < 4 * WINDOW:
        return (), events
    rough = np.full(n - width + 1, np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(values, width)
    whole = np.asarray(np.isfinite(windows).all(axis=1))
    for k in np.flatnonzero(np.logical_and(whole, np.append(True, ~whole[:-1]))):
        end = k + int(np.argmin(np.r_[whole[k:], False]))
        part = scaled_differences(times[k : end + width - 1], values[k : end + width - 1])
        if len(part) == end - k:
            rough[k:end] = part
    known = np.isfinite(rough)
    power = np.where(known, rough, 0.0) ** 2

    def local(width: int) -> np.ndarray:
        """Mean power around each difference."""
        ones = np.ones(min(width, len(power)))
        return np.convolve(power, ones, "same") / np.maximum(np.convolve(known, ones, "same"), 1.0)

    usual = float(np.median(local(WINDOW)[known])) if known.any() else 0.0
    if not usual > 0:
        return (), events
    near = np.convolve(local(WINDOW) > LIVELY**2 * usual, np.ones(WINDOW), "same")
    loud = np.logical_and(near > 0.5, local(width) > LIVELY * usual)
    quiet = float(np.mean(power[known & ~loud]))
    found = []
    starts = np.flatnonzero(loud)
    cuts = np.flatnonzero(np.diff(starts) > width) + 1
    for group in np.split(starts, cuts) if len(starts) else ():
        first, last = int(group[0]), int(group[-1]) + width - 1
        events[first : last + 1] = True
        inner_first, inner_last = first + width // 2, last - width // 2
        if inner_last - inner_first + 1 >= LONG + width:  # an event of one frame reaches over all its windows
            factor = float(np.sqrt(np.mean(power[group[0] : group[-1] + 1]) / quiet))
            found.append(Burst(float(times[inner_first]), float(times[inner_last]), factor))
    return tuple(found), events


def _segments(number: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, int]:
    """Segments [K, L + 2] of values without a gap that overlap by half, and their length L; none: [0, .], 0."""
    whole = np.isfinite(values)
    cuts = np.flatnonzero((np.diff(number) > 1) | (np.diff(whole.astype(int)) != 0)) + 1
    runs = [r for r in np.split(np.arange(len(values)), cuts) if len(r) and whole[r[0]]]
    for length in TAPERS:
        size = length + ORDER
        usable = [r for r in runs if len(r) >= size]
        if usable and (length == min(TAPERS) or sum(map(len, usable)) >= 0.7 * np.count_nonzero(whole)):
            out = []
            for r in usable:
                count = 1 + max(int(np.ceil((len(r) - size) / (length / 2))), 0)
                for start in np.round(np.linspace(0, len(r) - size, count)).astype(int):
                    out.append(values[r[start] : r[start] + size])
            return np.array(out), length
    return np.zeros((0, 0)), 0


@lru_cache(maxsize=8)
def _kernel(length: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Taper (L,), how power at G frequencies shows in the bins of a spectrum [L/2 + 1, G], width of a line in bins."""
    taper = np.asarray(dpss(length, TAPERS[length]))
    taper = taper / np.sqrt(np.sum(taper**2))
    fold = 2 * GRID // length
    seen = np.abs(np.fft.fft(taper, 2 * GRID)) ** 2 / (2 * GRID)
    bins = fold * np.arange(length // 2 + 1)
    apart = bins[:, None] - np.arange(-GRID, GRID)[None, :]
    both = seen[apart % (2 * GRID)]  # [bins, frequencies from -1/2 to 1/2]
    matrix = np.zeros((len(bins), GRID + 1))
    np.add.at(matrix.T, np.abs(np.arange(-GRID, GRID)), both.T)
    f = np.linspace(0.0, 0.5, GRID + 1)
    matrix *= (2 * np.sin(np.pi * f)) ** (2 * ORDER)
    width = length * float(np.sum(taper**2)) / float(np.sum(taper)) ** 2
    return taper, matrix, width


REFINED = 2
"""Times that the grid is refined around the most probable colour, fourfold each; one is too few beyond 1e4 frames."""

GRID = 512
"""Intervals of the frequency axis, four to a bin of the longest segments; half of it changes levels by 1e-3 at most."""


def _spectral(number: np.ndarray, values: np.ndarray, stated: float | None, slowest: float | None) -> _Found | None:
    """Posterior of the noise from averaged spectra; None where there are too few frames."""
    segments, length = _segments(number, values)
    if not length:
        return None
    taper, matrix, width = _kernel(length)
    rough = np.diff(segments, ORDER, axis=1) * taper
    spectra = np.abs(np.fft.rfft(rough, axis=1)) ** 2
    flat = matrix[1:-1].sum(axis=1)  # what white noise would show
    spectra = spectra[_usual(spectra[:, 1:-1] / flat, int(TAPERS[length]), width)]
    power = spectra.mean(axis=0)[1:-1]
    high = slice(int(HIGHEST * length), None)
    power = power + RESOLVED * flat * np.max((power / flat)[high])
    if not np.all(power > 0):
        return None
    data = _Spectrum(power, matrix[1:-1], len(spectra), width, length)
    colours = all_colours(GRID + 1)
    log, square, edges = _posterior(colours, data, stated, slowest)
    for finer in range(REFINED):
        colours = refined(colours, int(np.argmax(logsumexp(log, axis=1))), GRID + 1, finer)
        log, square, edges = _posterior(colours, data, stated, slowest)
    # the foot of a motion's line in the first bin above it would pass for a colour; in the next it is 15 dB lower
    edge = int(edges[np.argmax(logsumexp(log, axis=0))]) + 1
    log, square, edges = _posterior(colours, data, stated, edge / length, only=True)
    return _summed(colours, log, square, edges, data, stated)


def _usual(spectra: np.ndarray, first: int, width: float) -> np.ndarray:
    """Which of the segments [K, B] have no more power than chance gives them in any octave from bin `first` on."""
    out = np.ones(len(spectra), bool)
    while first < spectra.shape[1]:
        octave = spectra[:, first : 2 * first].mean(axis=1)
        dof = len(spectra[0, first : 2 * first]) / width
        out &= octave <= np.median(octave) * gamma.isf(RARE, dof) / gamma.median(dof)
        first *= 2
    return out


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """An averaged spectrum of differences.

    Attributes:
        power: [B] of the bins between frequency 0 and the highest. matrix: [B, G] how a spectrum shows in it.
        count: segments that were averaged; those that overlap by half count as they are.
        width: bins that the taper does not tell apart: all bins together are worth B / width.
        length: frames of a segment.
    """

    power: np.ndarray
    matrix: np.ndarray
    count: int
    width: float
    length: int


def _posterior(
    colours: Colours, data: _Spectrum, stated: float | None, slowest: float | None, *, only: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Log probability [J, C] of each colour with noise alone from each of C bins on, its variance, and the bins.

    Args:
        slowest: frequency of the first of these bins [cycles per frame]. only: it is the only one.
    """
    power, count, length = data.power, data.count, data.length
    expected = colours.power @ data.matrix.T  # [J, bins]
    bins = 1 + np.arange(len(power))
    # the taper mixes what lies nearer to frequency 0 with the slowest motion, which no segment resolves
    lowest = max(int(TAPERS[length]) + 1, int(np.ceil((slowest or 0.0) * length)))
    highest = int(HIGHEST * length)
    edges = bins[(bins >= min(lowest, highest)) & (bins <= highest)][: 1 if only else None]

    def above(a: np.ndarray) -> np.ndarray:
        """Sums over the bins from each edge on."""
        return np.cumsum(a[..., ::-1], axis=-1)[..., ::-1][..., edges - 1]

    known = above(np.ones(len(power)))
    square = above(power / expected) / known
    log = -count * (above(np.log(expected)) + known * (np.log(square) + 1))
    log = log + above((count - 1) * np.log(power) + count * np.log(count) - gammaln(count))
    free = -np.log(power) - FREE
    log = (log + np.sum(free) - above(free)) / data.width
    total = count * known / data.width
    doubt = 0.5 / np.sqrt(total)  # of the logarithm of the deviation
    if stated is None:
        log = log + np.log(np.sqrt(2 * np.pi) * 2 * doubt) - FREE
    else:
        spread = np.sqrt(STATED**2 + doubt**2)
        log = log - 0.5 * ((0.5 * np.log(square) - np.log(stated)) / spread) ** 2 + np.log(doubt / spread)
    return log + colours.prior[:, None] - np.log(len(edges)), square, edges


def _summed(
    colours: Colours,
    log: np.ndarray,
    square: np.ndarray,
    edges: np.ndarray,
    data: _Spectrum,
    stated: float | None,
) -> _Found:
    """Mean of level and correlation over the posterior."""
    p = np.exp(log - logsumexp(log))
    doubt = 0.5 / np.sqrt(data.count * (data.length // 2 - edges) / data.width)
    level = np.sqrt(square)
    if stated is not None:
        share = STATED**2 / (STATED**2 + doubt**2)
        level, doubt = np.exp(share * np.log(level) + (1 - share) * np.log(stated)), doubt * np.sqrt(share)
    deviation = float(np.exp((p * np.log(level)).sum()))
    spread = (p * (np.log(level / deviation) ** 2 + doubt**2)).sum()
    colour = colours.correlation(p.sum(axis=1), GRID)
    colour = colour / colour[0]
    last = int(np.flatnonzero(np.abs(colour) > NEGLIGIBLE)[-1])
    kinds = np.array([logsumexp(log[colours.family == n]) if np.any(colours.family == n) else -np.inf
                      for n in range(int(colours.family.max()) + 1)])  # fmt: skip
    mine = np.flatnonzero(colours.family == np.argmax(kinds))
    name = colours.name(int(mine[np.argmax(logsumexp(log[mine], axis=1))]))
    edge = edges[int(np.argmax(p.sum(axis=0)))] / data.length
    return _Found(deviation, float(np.sqrt(spread)), np.ascontiguousarray(colour[: last + 1]), name, float(edge))


def portmanteau(white: np.ndarray | Sequence[float], lags: int = 20) -> float:
    """Probability that whitened noise is as correlated as this by chance (Ljung & Box 1978, Biometrika 65).

    Args:
        white: (n,) whitened values; nan where missing. lags: of how many frames the correlation is asked for.

    Returns:
        p: even between 0 and 1 for white noise; products over missing frames are left out.
    """
    x = np.asarray(white, float)
    x = x - np.nanmean(x)
    variance = np.nanmean(x**2)
    total = 0.0
    for k in range(1, min(lags, len(x) - 1) + 1):
        pairs = x[k:] * x[:-k]
        seen = np.isfinite(pairs)
        if seen.any():
            total += float(np.sum(pairs[seen]) / variance) ** 2 / np.count_nonzero(seen)
    return float(chi2.sf(total, min(lags, len(x) - 1)))

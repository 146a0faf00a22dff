"""The verdict: which explanation the recordings support, in one of eight words and one sentence."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.stats import chi2

from origami_sim.diagnose.compare import (
    Score,
    Weights,
    difference,
    nearer,
    probabilities,
    reproducible,
    supported,
    together,
)
from origami_sim.diagnose.onset import onset
from origami_sim.diagnose.screen import Screening
from origami_sim.diagnose.trust import trust
from origami_sim.effects import get
from origami_sim.fit.least_squares import LITTLE, Fit, whitened
from origami_sim.recording.units import quantity

FLOOR = 1.3
"""Residual over the noise up to which a fit counts as down to the noise (a noise estimate is good to some 20 %)."""

STRUCTURED = 2.5
"""Slow structure of a residual, in standard deviations of what noise gives, from which on something is missing."""

INEXACT = 0.06
"""Part of what it explains that a named effect may leave, because real devices follow no law exactly."""

SMALL, SHOWN = 4, 2.0
"""Effects that are there in any device and too small to be told, and the score that each of them has."""

CANCELLED = 0.4
"""Several named effects must do so much together of what each does: two that cancel are a third with another law."""

WORSE = 2.0
"""Held-out error over that without an effect beyond which nothing is named: the few numbers fit what they have seen."""

STRAINED = 3.0
"""Standard deviations from what was known that no number of a named explanation may be."""


@dataclass
class Judgement:
    """The verdict with what led to it.

    Attributes:
        verdict, sentence, probability, chosen: as in `Diagnosis`. best: the fit of the verdict. tied: fits in the tie.
        removed: part of the removable squared error that it removes on held-out data. left: residual over noise after
            it.
        onset: first lasting departure of the refitted nominal [s]; nan: none. others: other explanations, best first.
        structure: slow structure that the refitted nominal leaves, and that the best fit leaves in more than one
            segment, in standard deviations of noise.
    """

    verdict: str
    sentence: str
    probability: float
    chosen: list[str]
    best: Fit
    tied: list[Fit]
    removed: float
    left: float
    onset: float
    notes: list[str] = field(default_factory=list)
    others: list[Fit] = field(default_factory=list)
    structure: tuple[float, float] = (0.0, 0.0)


WINDOW = 10
"""Frames about whose parabola the scatter of a residual is taken."""

BAND = (1 / 20, 1 / 8)
"""Frequencies per frame at which the noise of a residual is read: above most structure, below what trackers smooth."""

SHORT = 3 / BAND[0]
"""Frames below which a segment has too few frequencies in the band."""

COLOUR = 0.1
"""Part by which the noise of trackers may differ below the band in which it is read."""

FAST = (3 / 16, 11 / 32, 1 / 2)
"""Frequencies per frame of two bands in which noise that is white has the same power."""

WHITE, TINTED = 1.2, 0.35
"""Ratio of the powers in these bands up to which noise counts as white, and the part that it may still differ by."""

LEVER = 1.2
"""Logarithm of the power of smoothed noise at zero frequency over that in the band, for a fall by e between its halves:
the square of its middle over the difference of the squares of theirs."""

STEEPER = 4.0 * LEVER**2
"""Doubt about that, over the doubt about the noise in the band: each of two medians is of half of the frequencies."""

NEIGHBOURS = 9
"""Frequencies over which the noise of trackers hardly changes."""

SEVERAL = 5
"""Segments from which on most of them tell what is usual."""

MOST = 2 / 3
"""Part of the structure that a suspect must leave to be refuted where it may itself be small."""

ALLOWED = SMALL * SHOWN**2
"""Squares, in units of the noise, by which effects that are too small to be told may exceed it."""


@dataclass(frozen=True)
class Structure:
    """Squares of residuals at low frequencies, in units of what noise gives, by segment and octave.

    Attributes:
        power: [B, O] sums of squares. count: [B, O] how many. doubt: (O,) relative variance of the noise that they
            are compared with.
        uneven: (B,) standard deviations by which the band of the noise is fuller in one segment than in most, see
            `uneven_of`; nothing where that cannot be told.
    """

    power: np.ndarray
    count: np.ndarray
    doubt: np.ndarray
    uneven: np.ndarray

    @property
    def excess(self) -> float:
        """Sum of squares beyond what noise gives."""
        return float(np.sum(self.power - self.count))

    @property
    def score(self) -> float:
        """Standard deviations of noise by which the worst octave exceeds it and small effects."""
        return max(self._worst(self.power.sum(axis=0), self.count.sum(axis=0)), self._shaken)

    @property
    def repeated(self) -> float:
        """The same without the segment in which it is largest: what shows once only may be a mishap."""
        if len(self.power) < 3:
            return self.score
        power, count = (v.sum(axis=0) - v for v in (self.power, self.count))
        return max(self._shaken, min(self._worst(p, c) for p, c in zip(power, count, strict=True)))

    @property
    def _shaken(self) -> float:
        """What shakes the device now and then: how uneven the second segment is."""
        return float(np.sort(self.uneven)[-2]) if len(self.uneven) else 0.0

    def _worst(self, power: np.ndarray, count: np.ndarray) -> float:
        seen = count > 0
        freedom = 2.0 / (2.0 / count[seen] + self.doubt[seen])
        ratio = np.maximum(power[seen] - ALLOWED, 0.0) / count[seen]
        spread = 2.0 / (9.0 * freedom)  # the cube root is nearly normal (Wilson & Hilferty 1931)
        return float(np.max((np.cbrt(ratio) - 1.0 + spread) / np.sqrt(spread), initial=0.0))


@dataclass(frozen=True)
class _Weighed:
    """All fits, weighed against each other.

    Attributes:
        rows: fits, p: (R,) their probabilities. best, base: the most probable; without an effect. kept: the credible
            ones, of probability `total`. gain, error: held-out log score of the best over the base.
        p_value, p_small: that noise, and that noise and effects too small to be told, give so good a suspect.
        holds: whether the gain is reproducible. tested: whether any suspect could be.
        over, left, removed: held-out error over the noise before and after, root mean square over components; part of
            what can be removed that was.
        before, after: structure of the residuals.
    """

    rows: list[Fit]
    p: np.ndarray
    best: Fit
    base: Fit
    kept: list[Fit]
    total: float
    gain: float
    error: float
    p_value: float
    p_small: float
    significance: float
    level: float
    holds: bool
    tested: bool
    over: float
    left: float
    removed: float
    before: Structure
    after: Structure

    def probability(self, f: Fit) -> float:
        return float(self.p[self.rows.index(f)])

    @property
    def nothing(self) -> bool:
        """Whether no suspect stands out of noise."""
        return self.best is self.base or self.p_value > self.significance

    @property
    def small(self) -> bool:
        """Whether the best may be due to small effects, or to a part of the data only."""
        return self.p_small > self.level or not self.holds

    @property
    def share(self) -> float:
        """Part of the slow structure that the best leaves."""
        return _share(self.before, self.after)

    @property
    def leaves(self) -> bool:
        """Whether the best leaves more structure than inexact laws do; one that may be small, most of it.

        Several effects bend to anything: of 25 pairs that were right, none left more than a sixtieth.
        """
        allowed = MOST if self.small else INEXACT / max(len(self.best.hypothesis.suspects), 1)
        return _leaves(self.before, self.after, allowed)

    @property
    def fall(self) -> str:
        """What becomes of the held-out error, in words."""
        if self.left >= self.over:
            return f"held-out error does not fall ({self.over:.2f} and {self.left:.2f} times the noise floor)"
        text = f"held-out error falls from {self.over:.2f} to {self.left:.2f} times the noise floor"
        if self.over > 1.1:
            text += f" (of what could be removed, {np.clip(self.removed, 0.0, 1.0):.0%} is)"
        return text


@dataclass(frozen=True)
class _Said:
    """A verdict: word, sentence, probability, what is chosen, the fit to show and those in a tie."""

    verdict: str
    sentence: str
    probability: float
    chosen: list[str]
    fit: Fit
    tied: list[Fit] = field(default_factory=list)


def _share(before: Structure, after: Structure) -> float:
    return max(after.excess, 0.0) / max(before.excess, after.excess, 1e-300)


def _leaves(before: Structure, after: Structure, allowed: float) -> bool:
    return after.repeated > STRUCTURED and _share(before, after) > allowed


def lacking(base: Fit, f: Fit) -> bool:
    """Whether a fit leaves more of the structure of the model without an effect than inexact laws do."""
    return _leaves(structure(base, f), structure(f, f), INEXACT)


def judge(forward, given: Fit, base: Fit, sigma: np.ndarray, fits, scores, screening: Screening, chance, weights, o):
    """Weighs all fits; see `docs/diagnosis.md` for the rules in words.

    Args:
        sigma: (D,) noise of the components [SI], see `floor_of`.
        chance: that noise, and that noise and effects too small to be told, give so good a suspect.
    """
    rows = [f for f in fits if id(f) in scores]
    p = probabilities(supported(rows, scores))
    order = np.argsort(-p)
    best = rows[order[0]]
    kept, total = credible(rows, p, order, scores)
    gain, error = difference(scores[id(best)], scores[id(base)]) if best is not base else (0.0, np.inf)
    before, after = (scores[id(f)].rms / sigma for f in (base, best))
    repeats = any(reproducible(scores[id(f)], scores[id(base)]) for f in kept if f is not base)
    w = _Weighed(
        rows=rows,
        p=p,
        best=best,
        base=base,
        kept=kept,
        total=total,
        gain=gain,
        error=error,
        p_value=chance[0],
        p_small=chance[1],
        significance=o.significance,
        level=o.level,
        holds=repeats and nearer(scores[id(best)], scores[id(base)]),
        tested=bool(screening.signatures),
        over=pooled(before),
        left=pooled(after),
        removed=removable(before, after),
        before=structure(base, best),
        after=structure(best, best),
    )
    found = _unnamed(w)
    if found is None:
        found = _adequate_or_parameter(w, given, weights) if _quiet(w) else _refuted(w) or _named(w)
    return Judgement(
        found.verdict,
        found.sentence,
        found.probability,
        found.chosen,
        found.fit,
        found.tied,
        w.removed,
        w.left,
        onset(forward, base, sigma, weights=weights).time,
        _notes(forward, screening),
        [rows[i] for i in order[1:] if _effects(rows[i]) != _effects(best)],
        (w.before.score, w.after.repeated),
    )


def _unnamed(w: _Weighed) -> _Said | None:
    """Where no suspect stands out: untestable, or unknown if the residual has structure."""
    if w.nothing and not w.tested and w.over > FLOOR:
        text = "None of the catalogue's suspects is excited by these recordings."
        return _Said("UNTESTABLE", text, 1.0, [], w.base)
    if w.before.score < STRUCTURED or (w.holds and not w.nothing):
        return None
    text = f"The refitted model misses the recordings by {w.over:.2f} times the noise, and "
    if w.nothing or w.probability(w.base) >= 0.5:
        text += f"nothing in the catalogue explains it (chance of so good a suspect under noise: {w.p_value:.2g})."
    else:
        text += f"no suspect explains it reproducibly: the closest, {w.best.hypothesis.label}, gains {w.gain:.1f} +- "
        text += f"{w.error:.1f} in held-out log score."
    return _Said("UNKNOWN", text, np.nan, [], w.base)


def _refuted(w: _Weighed) -> _Said | None:
    """Unknown where the best explanation leaves structure, or needs a number that is known to be different."""
    strain, number = _strain(w.best)
    text = f"Something real is missing that the catalogue does not name: the closest, {_say(w.best)}, "
    left = f"{w.share:.0%} of the slow structure, {w.after.repeated:.0f} standard deviations of noise"
    if w.leaves and w.share < MOST:
        text = f"The catalogue explains a part, by {_say(w.best)}. Something real is left that it does not name: {left}"
    elif w.leaves:
        text += f"leaves {left}"
    elif strain > STRAINED:
        text += f"needs {number} {strain:.1f} standard deviations from what is known of it"
    elif len(w.best.hypothesis.suspects) > 1 and together(w.best) < CANCELLED and w.before.score >= STRUCTURED:
        text += "are effects that mostly cancel each other, as if both stood for one with another law"
    elif w.left > max(FLOOR, WORSE * w.over):
        text += "predicts what it was not fitted to much worse than no effect does"
    else:
        return None
    return _Said("UNKNOWN", f"{text}{_as_well(w)}; {w.fall}.", np.nan, [w.best.hypothesis.label], w.best)


def _as_well(w: _Weighed) -> str:
    """What these recordings do not tell from the closest, in words."""
    others = [f for f in w.kept if _effects(f) != _effects(w.best) and not _labels(f) > _labels(w.best)]
    names = _distinct([f for f in others if f.hypothesis.suspects])
    if not names:
        return ""
    some = [*names[:3], f"{len(names) - 3} more"] if len(names) > 4 else names
    return f"; these recordings do not tell that from {_join(some)}"


def _quiet(w: _Weighed) -> bool:
    """Whether there is nothing to name: no suspect stands out, or one that may be small and needs a bent prior."""
    return w.nothing or (w.small and not w.leaves and _strain(w.best)[0] > STRAINED)


def _named(w: _Weighed) -> _Said:
    """What the credible explanations say: one effect, several, or a tie."""
    trusted = trust(w.gain, len(w.best.hypothesis.suspects))
    kept = [f for f in w.kept if f is w.best or not _labels(f) > _labels(w.best)]
    total = w.total
    if w.small and w.base not in kept:
        kept.append(w.base)
        total = min(total + w.probability(w.base), 1.0)
    names = _distinct(kept)
    if any(_effects(f) != _effects(w.best) for f in kept):
        if all(kind(f) == "measurement" for f in kept):
            text = "The measurement, not the device, explains the mismatch, and these recordings do not tell which of "
            text += f"{_join(names)}: the best is {_say(w.best)}"
            return _Said("MEASUREMENT", f"{text}; {w.fall}.", total * trusted, names, w.best, kept)
        text = _tied(kept, [w.probability(f) for f in kept])
        return _Said("TIE", f"{text}; {w.fall}.", total * trusted, names, w.best, kept)
    # the same effects elsewhere, or with another that is not proven
    same = [f for f in w.rows if _effects(f) == _effects(w.best) or _labels(f) > _labels(w.best)]
    probability = trusted * sum(map(w.probability, same))
    suspects = w.best.hypothesis.suspects
    if len(suspects) > 1:
        word, text = "SEVERAL", f"{len(suspects)} effects are missing: {_say(w.best)} (p = {probability:.2f})"
    elif kind(w.best) == "measurement":
        word, text = "MEASUREMENT", f"The measurement, not the device, explains the mismatch: {_say(w.best)}"
        text += f" (p = {probability:.2f})"
    else:
        others = [_elsewhere(f) for f in kept if f is not w.best and len(f.hypothesis.suspects) == 1]
        elsewhere = [f for f in same if f is not w.best and len(f.hypothesis.suspects) == 1]
        sure = not elsewhere or w.probability(w.best) > 0.9 * probability
        where = f"these recordings do not tell that from {_join(others)}" if others else "the site is less certain"
        s = w.best.hypothesis.suspects[0]
        lacks = "there is" if s.more else "the model lacks"
        word = "MECHANISM"
        text = f"At {s.site} {lacks} {_say(w.best, sites=False)}{'' if sure else f' ({where})'}, p = {probability:.2f}"
    return _Said(word, f"{text}; {w.fall}.", probability, [s.label for s in suspects], w.best)


CLOSE = 6.0
"""Log evidence up to which an explanation is in a tie if held-out data do not tell it from the best either."""


def credible(
    rows: Sequence[Fit], p: np.ndarray, order: np.ndarray, scores: dict[int, Score]
) -> tuple[list[Fit], float]:
    """The explanations that hold 95 % of the probability, and those that held-out data do not tell from the best."""
    best, total, kept = rows[order[0]], 0.0, []
    evidence = dict(zip((id(f) for f in rows), supported(rows, scores), strict=True))
    for i in order:
        f = rows[i]
        d, error = difference(scores[id(best)], scores[id(f)]) if f is not best else (0.0, 1.0)
        close = evidence[id(best)] - evidence[id(f)] < CLOSE and d < 2.0 * error
        if total < 0.95 or close:
            kept.append(f)
            total += float(p[i])
    return kept, min(total, 1.0)


def chance_of_null(p_value: float) -> float:
    """Probability that nothing is missing, from the look-elsewhere test (Sellke et al. 2001), prior 4 to 1.

    Never more than the prior: what is too small to be seen is not excluded by not being seen.
    """
    bound = -np.e * p_value * np.log(p_value) if 0 < p_value < 1 / np.e else 1.0
    return float(4 * bound / (4 * bound + 1))


def _adequate_or_parameter(w: _Weighed, given: Fit, weights: Weights) -> _Said:
    """Where nothing is missing: whether numbers of the model differ from what was known of them."""
    probability = chance_of_null(w.p_value if w.nothing else w.p_small)
    base, count = w.base, len(w.base.free)
    before = float(sum(whitened(r, weights) @ whitened(r, weights) for r in given.residuals))
    if not count or before - base.misfit - base.penalty <= chi2.ppf(0.99, count):
        return _Said("ADEQUATE", _adequate(w.over), probability, [], base)
    far = sorted(zip(base.free, base.theta, strict=True), key=lambda m: -abs(m[1] - m[0].start) / m[0].spread)
    f, t = far[0]
    beyond = [m for m, v in far if abs(v - m.start) > m.spread]
    aligned = all(m.aligned for m in [f, *beyond])
    recorder = aligned and all(get(m.name.partition(".")[0]).family == "measurement" for m in [f, *beyond])
    strain = abs(t - f.start) / f.spread
    text = "Aligning the recording" if aligned else "Refitting the nominal parameters"
    if strain <= STRAINED:
        text += f" within {'what is known of it' if aligned else 'their priors'}"
    text += f" is enough: {f.label} goes from {said(f.start, f.unit)} to {said(t, f.unit)}, {strain:.1f} standard "
    text += f"deviations of what was known; held-out error is then {w.over:.2f} times the noise."
    if strain > STRAINED:
        text += " That is far from what was known: that number was wrong, or stands for something that acts like it."
    word = "MEASUREMENT" if recorder else "PARAMETER"
    return _Said(word, text, probability, [m.label for m in beyond], base)


def _adequate(over: float) -> str:
    if over <= FLOOR:
        return f"The model is adequate: held-out error is {over:.2f} times the noise."
    return (
        f"Nothing is found that the model lacks, although its held-out error is {over:.1f} times the noise: what is "
        "left has no structure, as if the measurement were noisier than stated."
    )


def kind(f: Fit) -> str:
    """nominal, mechanism or measurement."""
    kinds = {s.kind for s in f.hypothesis.suspects}
    if not kinds:
        return "nominal"
    return "measurement" if kinds == {"measurement"} else "mechanism"


def pooled(errors: np.ndarray) -> float:
    """Root mean square of what components miss, in multiples of their noise (D,)."""
    return float(np.sqrt(np.nanmean(np.square(errors))))


def removable(before: np.ndarray, after: np.ndarray) -> float:
    """(E0^2 - E1^2) / (E0^2 - 1) of errors (D,) over their noise, components pooled."""
    e0, e1 = float(before @ before), float(after @ after)
    excess = e0 - len(before)
    return (e0 - e1) / excess if excess > 0 else 0.0


def structure(f: Fit, reference: Fit) -> Structure:
    """Slow structure in the residuals of a fit, below the frequencies at which the noise of another's is read.

    The noise is read from residuals so that a level that was stated wrongly does not matter. What is missing often
    shows in a narrow band, such as where the device swings, hence octaves. The band in which noise is read is itself
    compared with the fastest frequencies, if noise looks white there: what shakes a device may fill it. If it does not,
    a tracker has smoothed it, and its power goes on growing below the band.
    """
    noise = noise_of(reference.residuals)
    short = min(map(len, f.residuals)) < SHORT
    edge = BAND[1] if short else BAND[0]
    octaves = 1 + int(np.ceil(np.log2(2.0 * edge * max(map(len, f.residuals)))))
    white = np.full(len(noise), np.nan) if short else white_of(reference.residuals)
    smoothed = not short and np.all(np.isnan(white))
    if smoothed:
        noise = noise * np.sqrt(growth_of(reference.residuals))
    power, count = np.zeros((2, len(f.residuals), octaves + 1))  # the last one is the band
    frames = np.zeros(len(noise))
    for b, r in enumerate(f.residuals):
        seen = np.isfinite(r)
        frames += seen.sum(axis=0)
        size = np.abs(np.fft.rfft(np.nan_to_num(r), axis=0)) ** 2 / np.maximum(seen.sum(axis=0), 1)
        frequency = np.fft.rfftfreq(len(r))
        for k in np.flatnonzero(frequency <= BAND[1]):
            slow = frequency[k] <= edge
            octave = min(int(np.log2(edge / (frequency[k] or 0.5 / len(r)))), octaves - 1) if slow else octaves
            scaled = size[k] / (noise if slow else white) ** 2
            parts = 2.0 if 0.0 < frequency[k] < 0.5 else 1.0
            power[b, octave] += parts * float(np.nansum(scaled))
            count[b, octave] += parts * (seen.any(axis=0) & np.isfinite(scaled)).sum()
    # of second differences, or of the median of a spectrum
    doubt = 3.9 / frames if short else (1.0 / np.log(2.0)) ** 2 / ((BAND[1] - BAND[0]) * frames)
    doubt = float(doubt.mean() / len(noise))
    slow = COLOUR**2 + doubt * (1.0 + STEEPER if smoothed else 1.0)
    return Structure(power, count, np.append(np.full(octaves, slow), TINTED**2), uneven_of(f.residuals))


def uneven_of(residuals: Sequence[np.ndarray]) -> np.ndarray:
    """(B,) by how much the band of each segment exceeds what its fast noise and most segments suggest; see `Structure`.

    A tracker may smooth, and its noise may grow with the motion, but both hold for neighbouring frequencies alike.
    Powers are therefore taken over what most segments have about each frequency, and over the segment's own fast ones.
    """
    lengths = set(map(len, residuals))
    if len(residuals) < SEVERAL or len(lengths) > 1 or min(lengths) < SHORT:
        return np.zeros(0)
    left = np.stack(residuals)
    size = np.abs(np.fft.rfft(np.nan_to_num(left), axis=1)) ** 2  # [B, K, D]
    frequency = np.fft.rfftfreq(min(lengths))
    band = (frequency > BAND[0]) & (frequency <= BAND[1])
    fast = (frequency > FAST[0]) & (frequency <= FAST[-1])
    seen = np.any(np.isfinite(left), axis=1)  # [B, D]
    size = np.where(np.expand_dims(seen, 1), size, np.nan)
    with np.errstate(invalid="ignore", divide="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a component that is never seen
        size = np.nan_to_num(size / uniform_filter1d(np.nanmedian(size, axis=0), NEIGHBOURS, axis=0))
        slow, quick = (np.count_nonzero(part) * seen.sum(axis=1) for part in (band, fast))
        level = size[:, fast].sum(axis=(1, 2)) / quick
        usual = size[:, band].sum(axis=(1, 2)) / level / slow
        found = usual - ALLOWED / (2.0 * slow)
        spread = 1.0 / slow + 1.0 / quick
    most = float(np.nanmedian(usual))
    score = (np.cbrt(np.maximum(found, 0.0) / most) - 1.0) / np.sqrt(spread / 9.0 * (1.0 + np.pi / 2.0 / len(usual)))
    return np.nan_to_num(score)


def floor_of(forward, best: Fit) -> np.ndarray:
    """(D,) noise of the components [SI]: as stated; where it was read from the data, at least what a fit leaves fast.

    A tracker that smooths hides its noise from neighbouring frames, from which it was read. Fast is what scatters about
    a parabola over a window.
    """
    floor = forward.blocks[best.blocks[0]].noise.copy()
    channels = forward.recordings[0].channels.values()
    width = [1 if c.values.ndim == 1 else c.values.shape[1] for c in channels]
    read = np.repeat([c.noise_report is not None and c.noise == c.noise_report.level for c in channels], width)
    if min(map(len, best.residuals)) >= 2 * WINDOW:
        variance = np.concatenate([scatter(r) for r in best.residuals])
        seen = np.isfinite(variance)
        fast = np.sqrt(np.sum(np.where(seen, variance, 0.0), axis=0) / np.maximum(seen.sum(axis=0), 1))
        floor[read] = np.maximum(floor, fast)[read]
    return floor


def scatter(values: np.ndarray) -> np.ndarray:
    """(K, D) variance of values (n, D) about a parabola over each window; nan where a frame of it is missing."""
    parts = values[: len(values) // WINDOW * WINDOW].reshape(-1, WINDOW, values.shape[1])
    q, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, WINDOW), 3))
    fast = parts - np.einsum("ij,kj,nkd->nid", q, q, parts)
    return np.sum(fast**2, axis=1) / (WINDOW - 3)


def noise_of(residuals: Sequence[np.ndarray]) -> np.ndarray:
    """(D,) standard deviation of the noise in residuals (n, D), were it white: the median of their spectra in a band.

    Frames of a tracker that smooths are not independent. Short segments, such as curves, have too few frequencies in
    the band for that: of those, second differences.
    """
    if min(map(len, residuals)) < SHORT:
        fast = np.concatenate([np.diff(r, n=2, axis=0) for r in residuals])
        return np.sqrt(np.nanmean(fast**2, axis=0) / 6.0)
    return np.sqrt(np.nanmedian(_spectrum(residuals, *BAND), axis=0) / np.log(2.0))


def white_of(residuals: Sequence[np.ndarray]) -> np.ndarray:
    """(D,) the same from the fastest frequencies; nan if the noise of all components together is not white there."""
    lower, upper = (np.nanmean(_spectrum(residuals, a, b), axis=0) for a, b in pairwise(FAST))
    white = 1.0 / WHITE < np.nanmean(upper) / np.nanmean(lower) < WHITE
    return np.sqrt((lower + upper) / 2.0) if white else np.full(len(lower), np.nan)


def growth_of(residuals: Sequence[np.ndarray]) -> float:
    """Power of the noise at zero frequency over that in its band, from how it falls within the band; 1 at least.

    The logarithm of the power of what a filter lets through begins as a square of the frequency.
    """
    middle = sum(BAND) / 2.0
    lower, upper = (np.nanmedian(_spectrum(residuals, *b), axis=0) for b in ((BAND[0], middle), (middle, BAND[1])))
    fall = float(np.nanmean(np.log(lower / upper)))
    return float(np.exp(max(fall, 0.0) * LEVER))


def _spectrum(residuals: Sequence[np.ndarray], low: float, high: float) -> np.ndarray:
    """[K, D] powers at the frequencies of a band [1 / frame], of all segments; 1 for white noise of unit variance."""
    powers = []
    for r in residuals:
        taper = np.hanning(len(r) + 2)[1:-1, None] * np.isfinite(r)
        size = (taper**2).sum(axis=0)
        power = np.abs(np.fft.rfft(taper * np.nan_to_num(r), axis=0)) ** 2 / np.where(size > 0.0, size, np.nan)
        frequency = np.fft.rfftfreq(len(r))
        powers.append(power[(frequency >= low) & (frequency <= high)])
    return np.concatenate(powers)


def why(f: Fit, base: Fit, judged: Judgement, scores: dict[int, Score]) -> str:
    """Why a row won or lost, in words."""
    if f is judged.best:
        return "chosen" if judged.verdict not in ("UNKNOWN", "UNTESTABLE") else "closest, but not enough"
    d, error = difference(scores[id(f)], scores[id(judged.best)])
    evidence = scores[id(f)].evidence - scores[id(judged.best)].evidence
    if f is base:
        return f"predicts held-out data worse by {-d:.1f} +- {error:.1f} in log score" if d < 0 else "the simplest"
    if any(t in judged.tied for t in (f,)):
        return f"in the tie: evidence {evidence:+.1f}"
    extra = len(f.free) - len(judged.best.free)
    if d > -2 and extra > 0:
        return f"no better, with {extra} more numbers"
    return f"predicts held-out data worse by {-d:.1f} +- {error:.1f}; evidence {evidence:+.1f}"


def distrust(f: Fit, base: Fit, forward) -> str:
    """When not to trust a row."""
    out = []
    if f.promise < np.inf:
        out.append("far behind the best, and not fitted to the end")
    if f.cost > base.cost + LITTLE:
        out.append("fits worse than the model without it, which it holds")
    for n, t, b in zip(f.free, f.theta, f.at_bound, strict=True):
        if b:
            out.append(f"{n.label} lies on its bound ({t:.3g} {n.unit})")
        elif np.isfinite(n.spread) and abs(t - n.start) > 3 * n.spread:
            out.append(f"{n.label} left its prior by {abs(t - n.start) / n.spread:.1f} sd")
    deviation = f.deviations()
    for n, t, d in zip(f.free[len(forward.subject.nominals) :], f.theta[len(forward.subject.nominals) :],
                       deviation[len(forward.subject.nominals) :], strict=True):  # fmt: skip
        if abs(t) < 2 * d:
            out.append(f"{n.label} is not told from zero")
    return "; ".join(out)


def _notes(forward, screening: Screening) -> list[str]:
    notes = []
    if len({b.recording for b in forward.blocks}) == 1:
        notes.append("One recording only: held-out data are stretches of the same recording, which share its errors.")
    lost = [s.suspect.label for s in screening.untestable]
    if lost:
        notes.append(f"Not tested, because these recordings do not tell: {', '.join(lost)}.")
    return notes


def _strain(f: Fit) -> tuple[float, str]:
    """The largest departure of a number of the model from what was known of it [standard deviations], and its name."""
    own = len(f.free) - len(f.hypothesis.free)
    known = zip(f.free[:own], f.theta, strict=False)
    return max(((abs(t - n.start) / n.spread, n.label) for n, t in known), default=(0.0, ""))


def _effects(f: Fit) -> tuple[str, ...]:
    return tuple(sorted(s.effect for s in f.hypothesis.suspects))


def _labels(f: Fit) -> set[str]:
    return {s.label for s in f.hypothesis.suspects}


def _distinct(fits: Sequence[Fit]) -> list[str]:
    return list(dict.fromkeys(f.hypothesis.label for f in fits))


def _say(f: Fit, *, sites: bool = True) -> str:
    """The effects of a fit with their sites, if asked, strengths and intervals."""
    out = []
    deviation = dict(zip((id(n) for n in f.free), f.deviations(), strict=True))
    value = dict(zip((id(n) for n in f.free), f.theta, strict=True))
    for s in f.hypothesis.suspects:
        n = max(s.strengths, key=lambda n: abs(value[id(n)]) / max(deviation[id(n)], 1e-300))
        t, d = value[id(n)], deviation[id(n)]
        digits = 2 + int(np.clip(np.log10(0.5 * abs(t) / max(d, 1e-300)), 0, 4)) if t else 2
        low, high = (said(v, n.unit, digits) for v in (max(t - 1.96 * d, n.lower), min(t + 1.96 * d, n.upper)))
        what = title(s.effect)
        if s.more:
            what = f"{'more' if t > 0 else 'less'} {what} than stated"
        strength = f"{n.name.replace('_', ' ')} {said(t, n.unit, digits)}"
        where = f" at {s.site}" if sites else ""
        out.append(f"{what}{where} ({strength}, 95 %: {low} to {high})")
    return _join(out)


def _elsewhere(f: Fit) -> str:
    """A single effect somewhere else, in words."""
    s = f.hypothesis.suspects[0]
    change = f.theta[len(f.free) - len(s.free)] - s.free[0].start
    return f"{'more' if change > 0 else 'less'} at {s.site}" if s.more else f"the same at {s.site}"


def said(value: float, unit: str, digits: int = 3) -> str:
    """A number with its unit; a plain factor has none."""
    return f"{value:.{digits}g}" if unit in ("-", "1", "") else quantity(value, unit, digits=digits)


def title(effect: str) -> str:
    """The first words of an effect's file: its name as a physicist would say it."""
    import importlib

    e = get(effect)
    text = importlib.import_module(f"origami_sim.effects.{e.name}").__doc__ or e.name
    text = text.strip().splitlines()[0].split(":")[0].rstrip(".")
    first = text.split()[0]
    return text if len(first) > 1 and first.isupper() else text[0].lower() + text[1:]


def _tied(fits: Sequence[Fit], p: Sequence[float]) -> str:
    """What the explanations of a tie have in common, and between which they leave the choice."""
    every = [f.hypothesis.suspects for f in fits]
    shared = [s.label for s in every[0] if all(any(t.label == s.label for t in other) for other in every)]
    at_one = {s.effect for s in every[0] if s.label in shared}
    common = set.intersection(*({s.effect for s in suspects} for suspects in every))
    shared += [
        f"{e} at one place or another" for e in dict.fromkeys(s.effect for s in every[0]) if e in common - at_one
    ]
    text = "These recordings do not decide between "
    text += _join([f"{f.hypothesis.label} (p = {q:.2f})" for f, q in zip(fits[:4], p, strict=False)])
    if len(fits) > 4:
        text += f" and {len(fits) - 4} more"
    return text + (f"; all of them contain {_join(shared)}" if shared and len(fits) > 1 else "")


def _join(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]

"""The verdict: which explanation the recordings support, in one of eight words and one sentence."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import chi2

from origami_sim.diagnose.compare import Score, Weights, difference, probabilities, reproducible, supported
from origami_sim.diagnose.onset import onset
from origami_sim.diagnose.refit import Fit, whitened
from origami_sim.diagnose.screen import Screening
from origami_sim.diagnose.trust import trust
from origami_sim.effects import get
from origami_sim.recording.units import quantity

FLOOR = 1.3
"""Residual over the noise up to which a fit counts as down to the noise (a noise estimate is good to some 20 %)."""

STRUCTURED = 3.0
"""Slow structure of a residual, in standard deviations of what noise gives, from which on something is missing."""

INEXACT = 0.06
"""Part of what it explains that a named effect may leave, because real devices follow no law exactly."""

SMALL, SHOWN = 4, 2.0
"""Effects that are there in any device and too small to be told, and the score that each of them has."""

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


def judge(forward, given: Fit, base: Fit, sigma: np.ndarray, fits, scores, screening: Screening, chance, weights, o):
    """Weighs all fits; see `docs/diagnosis.md` for the rules in words.

    Args:
        sigma: (D,) noise of the components [SI], see `floor_of`.
        chance: that noise, and that noise and effects too small to be told, give so good a suspect.
    """
    p_value, p_small = chance
    rows = [f for f in fits if id(f) in scores]
    p = probabilities(supported(rows, scores))
    order = np.argsort(-p)
    best = rows[order[0]]
    notes = _notes(forward, rows, screening, sigma)
    rms_base, rms_best = scores[id(base)].rms, scores[id(best)].rms
    over = float(np.max(rms_base / sigma))
    left = float(np.max(rms_best / sigma))
    removed = removable(rms_base, rms_best, sigma)
    begins = onset(forward, base, sigma, weights=weights).time
    others = [rows[i] for i in order[1:] if _effects(rows[i]) != _effects(best)]
    before, after = structure(base, best), structure(best, best)
    slow = (before.score, after.repeated)
    share = after.excess / max(before.excess, after.excess, 1e-300)

    def result(verdict, sentence, probability, chosen, fit=best, tied=()):
        return Judgement(
            verdict,
            sentence,
            float(probability),
            list(chosen),
            fit,
            list(tied),
            removed,
            left,
            begins,
            notes,
            others,
            slow,
        )

    kept, total = credible(rows, p, order, scores)
    gain, error = difference(scores[id(best)], scores[id(base)]) if best is not base else (0.0, np.inf)
    holds = best is not base and any(reproducible(scores[id(f)], scores[id(base)]) for f in kept if f is not base)
    holds = holds and float(np.sum((rms_best / sigma) ** 2)) < float(np.sum((rms_base / sigma) ** 2))
    nothing = best is base or p_value > o.significance
    if nothing and not screening.signatures and over > FLOOR:
        return result("UNTESTABLE", "None of the catalogue's suspects is excited by these recordings.", 1.0, [], base)
    if nothing and slow[0] < STRUCTURED:
        probability = max(float(p[rows.index(base)]), chance_of_null(p_value))
        return _adequate_or_parameter(forward, given, base, weights, result, over, probability)
    if nothing or (not holds and slow[0] >= STRUCTURED):
        text = f"The refitted model misses the recordings by {over:.2f} times the noise, "
        if nothing or p[rows.index(base)] >= 0.5:
            text += "and nothing in the catalogue explains it (chance of so good a suspect under noise: "
            return result("UNKNOWN", text + f"{p_value:.2g}).", p[rows.index(base)], [], base)
        name = _distinct([rows[i] for i in order])[0]
        text += f"and no suspect explains it reproducibly: the closest, {name}, gains {gain:.1f} +- {error:.1f} in "
        return result("UNKNOWN", text + "held-out log score.", 1 - p[rows.index(base)], [], base)
    # the same effects elsewhere, or with another that is not proven
    same = [f for f in rows if _effects(f) == _effects(best) or _labels(f) > _labels(best)]
    trusted = trust(gain, len(best.hypothesis.suspects))
    mechanism_p = trusted * float(sum(p[rows.index(f)] for f in same))
    kept = [f for f in kept if f is best or not _labels(f) > _labels(best)]
    fall = f"held-out error falls from {over:.2f} to {left:.2f} times the noise floor"
    if left >= over:
        fall = f"held-out error does not fall ({over:.2f} and {left:.2f} times the noise floor)"
    elif over > 1.1:
        fall += f" (of what could be removed, {np.clip(removed, 0.0, 1.0):.0%} is)"
    small = p_small > o.level or not holds
    if slow[1] > STRUCTURED and share > INEXACT:
        return result(
            "UNKNOWN",
            f"Something real is missing that the catalogue does not name: the closest, {_say(best)}, leaves "
            f"{share:.0%} of the slow structure, {slow[1]:.0f} standard deviations of what noise gives; "
            f"{fall}.",
            mechanism_p,
            [best.hypothesis.label],
        )
    strain, number = _strain(best)
    if strain > STRAINED and small:
        return _adequate_or_parameter(forward, given, base, weights, result, over, chance_of_null(p_small))
    if strain > STRAINED:
        return result(
            "UNKNOWN",
            f"Something real is missing that the catalogue does not name: the closest, {_say(best)}, needs {number} "
            f"{strain:.1f} standard deviations from what is known of it; {fall}.",
            mechanism_p,
            [best.hypothesis.label],
        )
    if small and base not in kept:
        kept.append(base)
        total = min(total + float(p[rows.index(base)]), 1.0)
    total *= trusted
    rivals = [f for f in kept if _effects(f) != _effects(best)]
    if rivals and all(kind(f) == "measurement" for f in kept):
        names = _distinct(kept)
        return result(
            "MEASUREMENT",
            "The measurement, not the device, explains the mismatch, and these recordings do not tell which of "
            f"{_join(names)}: "
            f"the best is {_say(best)}; {fall}.",
            total,
            names,
            best,
            kept,
        )
    if rivals:
        names = _distinct(kept)
        return result(
            "TIE",
            _tied(kept, [float(p[rows.index(f)]) for f in kept]) + f"; {fall}.",
            total,
            names,
            best,
            kept,
        )
    kinds = {kind(best)}
    if len(best.hypothesis.suspects) > 1:
        word = "SEVERAL"
        text = f"{len(best.hypothesis.suspects)} effects are missing: {_say(best)} (p = {mechanism_p:.2f}); {fall}."
    elif kinds == {"measurement"}:
        word = "MEASUREMENT"
        text = f"The measurement, not the device, explains the mismatch: {_say(best)} (p = {mechanism_p:.2f}); {fall}."
    else:
        word = "MECHANISM"
        s = best.hypothesis.suspects[0]
        where = "" if len(same) == 1 or p[rows.index(best)] > 0.9 * mechanism_p else " (the site is less certain)"
        text = f"At {s.site} the model lacks {_say(best)}{where}, p = {mechanism_p:.2f}; {fall}."
    return result(word, text, mechanism_p, [s.label for s in best.hypothesis.suspects])


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
    """Probability that nothing is missing, from the look-elsewhere test (Sellke et al. 2001), prior 4 to 1."""
    bound = -np.e * p_value * np.log(p_value) if 0 < p_value < 1 / np.e else 1.0
    return float(4 * bound / (4 * bound + 1))


def _adequate_or_parameter(forward, given: Fit, base: Fit, weights: Weights, result, over, probability):
    count = len(base.free)
    before = float(sum(whitened(r, weights) @ whitened(r, weights) for r in given.residuals))
    better = before - base.misfit - base.penalty
    deviation = np.array([f.spread for f in base.free])
    moved = [(f, t) for f, t in zip(base.free, base.theta, strict=True)]
    if count and better > chi2.ppf(0.99, count):
        far = sorted(zip(moved, deviation, strict=True), key=lambda m: -abs(m[0][1] - m[0][0].start) / m[1])
        (f, t), spread = far[0]
        text = (
            f"Refitting the nominal parameters within their priors is enough: {f.label} goes from "
            f"{said(f.start, f.unit)} to {said(t, f.unit)}, "
            f"{abs(t - f.start) / spread:.1f} standard deviations of what was known; "
            f"held-out error is then {over:.2f} times the noise."
        )
        return result("PARAMETER", text, probability, [f.label for (f, t), s in far if abs(t - f.start) > s], base)
    return result("ADEQUATE", _adequate(over), probability, [], base)


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


def removable(before: np.ndarray, after: np.ndarray, sigma: np.ndarray) -> float:
    """(E0^2 - E1^2) / (E0^2 - sigma^2), components pooled in units of their noise."""
    e0, e1 = float(np.sum((before / sigma) ** 2)), float(np.sum((after / sigma) ** 2))
    excess = e0 - len(sigma)
    return (e0 - e1) / excess if excess > 0 else 0.0


WINDOW = 10
"""Frames about whose parabola the scatter of a residual is taken."""

BAND = (1 / 20, 1 / 8)
"""Frequencies per frame at which the noise of a residual is read: above most structure, below what trackers smooth."""

SHORT = 4 / BAND[0]
"""Frames below which a segment has too few frequencies in the band."""

ALLOWED = SMALL * SHOWN**2
"""Squares, in units of the noise, by which effects that are too small to be told may exceed it."""


@dataclass(frozen=True)
class Structure:
    """Squares of residuals at low frequencies, in units of what noise gives, by segment and octave.

    Attributes:
        power: [B, O] sums of squares. count: [B, O] how many. doubt: relative variance of the noise that they are
            compared with.
    """

    power: np.ndarray
    count: np.ndarray
    doubt: float

    @property
    def excess(self) -> float:
        """Sum of squares beyond what noise gives."""
        return float(np.sum(self.power - self.count))

    @property
    def score(self) -> float:
        """Standard deviations of noise by which the worst octave exceeds it and small effects."""
        return self._worst(self.power.sum(axis=0), self.count.sum(axis=0))

    @property
    def repeated(self) -> float:
        """The same without the segment in which it is largest: what shows once only may be a mishap."""
        if len(self.power) < 3:
            return self.score
        power, count = (v.sum(axis=0) - v for v in (self.power, self.count))
        return min(self._worst(p, c) for p, c in zip(power, count, strict=True))

    def _worst(self, power: np.ndarray, count: np.ndarray) -> float:
        seen = count > 0
        freedom = 2.0 / (2.0 / count[seen] + self.doubt)
        ratio = np.maximum(power[seen] - ALLOWED, 0.0) / count[seen]
        spread = 2.0 / (9.0 * freedom)  # the cube root is nearly normal (Wilson & Hilferty 1931)
        return float(np.max((np.cbrt(ratio) - 1.0 + spread) / np.sqrt(spread), initial=0.0))


def structure(f: Fit, reference: Fit) -> Structure:
    """Slow structure in the residuals of a fit, below the frequencies at which the noise of another's is read.

    The noise is read from residuals so that a level that was stated wrongly does not matter. What is missing often
    shows in a narrow band, such as where the device swings, hence octaves.
    """
    noise = noise_of(reference.residuals)
    short = min(map(len, f.residuals)) < SHORT
    edge = BAND[1] if short else BAND[0]
    octaves = 1 + int(np.ceil(np.log2(2.0 * edge * max(map(len, f.residuals)))))
    power, count = np.zeros((2, len(f.residuals), octaves))
    frames = np.zeros(len(noise))
    for b, r in enumerate(f.residuals):
        seen = np.isfinite(r)
        frames += seen.sum(axis=0)
        size = np.abs(np.fft.rfft(np.nan_to_num(r), axis=0)) ** 2 / np.maximum(seen.sum(axis=0), 1) / noise**2
        frequency = np.fft.rfftfreq(len(r))
        for k in np.flatnonzero(frequency <= edge):
            octave = min(int(np.log2(edge / (frequency[k] or 0.5 / len(r)))), octaves - 1)
            parts = 2.0 if 0.0 < frequency[k] < 0.5 else 1.0
            power[b, octave] += parts * float(size[k].sum())
            count[b, octave] += parts * seen.any(axis=0).sum()
    # of second differences, or of the median of a spectrum
    doubt = 3.9 / frames if short else (1.0 / np.log(2.0)) ** 2 / ((BAND[1] - BAND[0]) * frames)
    return Structure(power, count, float(doubt.mean() / len(noise)))


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
        parts = np.concatenate([r[: len(r) // WINDOW * WINDOW].reshape(-1, WINDOW, len(floor)) for r in best.residuals])
        q, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, WINDOW), 3))
        fast = parts - np.einsum("ij,kj,nkd->nid", q, q, parts)  # nan where a frame of the window is missing
        variance = np.sum(fast**2, axis=1) / (WINDOW - 3)
        seen = np.isfinite(variance)
        scatter = np.sqrt(np.sum(np.where(seen, variance, 0.0), axis=0) / np.maximum(seen.sum(axis=0), 1))
        floor[read] = np.maximum(floor, scatter)[read]
    return floor


def noise_of(residuals: Sequence[np.ndarray]) -> np.ndarray:
    """(D,) standard deviation of the noise in residuals (n, D), were it white: the median of their spectra in a band.

    Frames of a tracker that smooths are not independent. Short segments, such as curves, have too few frequencies in
    the band for that: of those, second differences.
    """
    if min(map(len, residuals)) < SHORT:
        fast = np.concatenate([np.diff(r, n=2, axis=0) for r in residuals])
        return np.sqrt(np.nanmean(fast**2, axis=0) / 6.0)
    powers = []
    for r in residuals:
        taper = np.hanning(len(r) + 2)[1:-1, None] * np.isfinite(r)
        size = (taper**2).sum(axis=0)
        power = np.abs(np.fft.rfft(taper * np.nan_to_num(r), axis=0)) ** 2 / np.where(size > 0.0, size, np.nan)
        frequency = np.fft.rfftfreq(len(r))
        powers.append(power[(frequency >= BAND[0]) & (frequency <= BAND[1])])
    return np.sqrt(np.nanmedian(np.concatenate(powers), axis=0) / np.log(2.0))


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


def distrust(f: Fit, forward) -> str:
    """When not to trust a row."""
    out = []
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


def _notes(forward, rows: Sequence[Fit], screening: Screening, sigma) -> list[str]:
    notes = []
    if len({b.recording for b in forward.blocks}) == 1:
        notes.append("One recording only: held-out data are stretches of the same recording, which share its errors.")
    lost = [s.suspect.label for s in screening.untestable]
    if lost:
        notes.append(f"Not tested, because these recordings do not tell: {', '.join(lost)}.")
    return notes


def _strain(f: Fit) -> tuple[float, str]:
    """The largest departure of a number from what was known of it, in standard deviations, and its name."""
    return max(
        ((abs(t - n.start) / n.spread, n.label) for n, t in zip(f.free, f.theta, strict=True)), default=(0.0, "")
    )


def _effects(f: Fit) -> tuple[str, ...]:
    return tuple(sorted(s.effect for s in f.hypothesis.suspects))


def _labels(f: Fit) -> set[str]:
    return {s.label for s in f.hypothesis.suspects}


def _distinct(fits: Sequence[Fit]) -> list[str]:
    return list(dict.fromkeys(f.hypothesis.label for f in fits))


def _say(f: Fit) -> str:
    """The effects of a fit with their strengths and intervals."""
    out = []
    deviation = dict(zip((id(n) for n in f.free), f.deviations(), strict=True))
    value = dict(zip((id(n) for n in f.free), f.theta, strict=True))
    for s in f.hypothesis.suspects:
        n = s.free[0]
        t, d = value[id(n)], deviation[id(n)]
        low, high = (said(v, n.unit, 2) for v in (max(t - 1.96 * d, n.lower), min(t + 1.96 * d, n.upper)))
        what = title(s.effect)
        out.append(f"{what} at {s.site} ({n.name.replace('_', ' ')} {said(t, n.unit, 2)}, 95 %: {low} to {high})")
    return _join(out)


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
    common = set.intersection(*({s.effect for s in f.hypothesis.suspects} for f in fits))
    shared = [s.label for s in fits[0].hypothesis.suspects if s.effect in common]
    text = "These recordings do not decide between "
    text += _join([f"{f.hypothesis.label} (p = {q:.2f})" for f, q in zip(fits[:4], p, strict=False)])
    if len(fits) > 4:
        text += f" and {len(fits) - 4} more"
    return text + (f"; all of them contain {_join(shared)}" if shared and len(fits) > 1 else "")


def _join(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]

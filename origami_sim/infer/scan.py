"""Coarse scans of the numbers of an effect, where linear estimates do not lead to the best fit.

A model that lacks a strong effect follows it with numbers that are no fault of theirs, and from there no fit finds the
effect: dry friction that holds a crease back is as a weaker magnet. And a number beside a strength, such as the angle
at which friction yields, may have several values from which a fit goes no further.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np
from scipy.optimize import lsq_linear
from scipy.stats import chi2

from origami_sim.effects import get
from origami_sim.fit.derivatives import changed
from origami_sim.fit.least_squares import UTMOST, Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import PLAUSIBLE, Free, Hypothesis, Suspect
from origami_sim.hypotheses.suspects import CONSTANTS
from origami_sim.infer.placement import LEADING
from origami_sim.infer.profile import along_numbers, missed
from origami_sim.infer.screen import LATE, LEAST, MOST, ROUNDS, Signature, rated, simulated_at

DOUBTED = 0.01
"""Probability, under the priors of its numbers, of a departure as far as a fit's, below which they are not believed.

It only decides where fits begin: half, double and fifty times as much change nothing in four swings. Of a crawler whose
crease friction holds, numbers were 10 and 21 deviations off.
"""

GRID = np.geomspace(0.01, 1e3, 11)
"""Strengths of an effect that are tried, in the unit in which it is screened: from far below what first shows (which
may be too strong already) up to what blocks.

With steps ten times apart the friction of that crawler is not found.
"""

STILL = 0.5
"""Part of the squares that it explained which a signature has to explain at a larger strength, to be simulated there.

Of friction that holds 88 % is left, of the stack of `at_their_strengths` 12 %: half does the same, double leaves
friction as it slips.
"""

COARSE = GRID[2:9]
"""Strengths that are tried where there are many worlds: a tenth to a hundred of the unit."""

SHAPES = 7
"""Values of a number beside a strength that are tried, evenly over what is plausible.

With four, friction and drag of two real swings end 165 of log evidence lower, in another valley of the yield angle.
Half and double change no word of four simulated swings, and no probability by more than 0.033.
"""


def strained(f: Fit) -> bool:
    """Whether numbers are further from what was known than chance would take them."""
    known = sum(np.isfinite(n.spread) for n in f.free)
    return bool(known and chi2.sf(f.penalty, known) < DOUBTED)


def scanned(
    forward: Predictor, hypothesis: Hypothesis, weights: Weights, local: np.ndarray, also: np.ndarray | None
) -> np.ndarray | None:
    """(P,) the given numbers and that strength of one effect, of a few of each, with which recordings are missed least.

    None if the model goes unstable with all of them.

    Args:
        also: (P,) numbers to try besides.
    """
    given = np.array([f.start for f in forward.subject.nominals])
    (suspect,) = hypothesis.suspects
    thetas = np.array([[*given, *values] for values in over_range(suspect)])
    if also is not None:
        thetas = np.concatenate([thetas, also[None]])
    squares = missed(forward, hypothesis, thetas, local, weights)
    return thetas[int(np.argmin(squares))] if np.any(np.isfinite(squares)) else None


class Cleared:
    """Whitened residuals of a fit, and changes of them, without what its starts and numbers explain.

    Args:
        held: numbers of the fit that are not to explain anything.
    """

    def __init__(self, f: Fit, weights: Weights, held: Collection[int] = ()):
        line = f.reweighted(weights).linear
        assert line is not None
        self.weights = weights
        self.line, prior = line, f.coordinates.precision
        self.away = prior * f.away
        self.moved = np.array([n for n in range(len(f.free)) if n not in held], int)
        columns = np.concatenate([*line.cleared(line.tangent), np.diag(prior)])[:, self.moved]
        self.q, self.r = np.linalg.qr(columns)

    def whole(self, columns: list[np.ndarray], *, away: bool) -> np.ndarray:
        """[rows, K] of columns [r, K] per segment, with what is known of the numbers below if they are residuals."""
        below = np.repeat((self.away if away else 0.0 * self.away)[:, None], columns[0].shape[1], axis=1)
        return np.concatenate([*self.line.cleared(columns), below])

    def rest(self, whole: np.ndarray) -> np.ndarray:
        """[rows, K] without what numbers explain."""
        return whole - self.q @ (self.q.T @ whole)

    def explaining(self, whole: np.ndarray) -> np.ndarray:
        """Changes (P,) of the coordinates of numbers, but of those that are held, that explain (rows,)."""
        out = np.zeros_like(self.away)
        out[self.moved] = np.linalg.lstsq(self.r, self.q.T @ whole, rcond=1e-10)[0]
        return out

    @cached_property
    def missed(self) -> float:
        """The squares that the fit itself leaves."""
        return float(np.sum(self.rest(self.whole([r[:, None] for r in self.line.residual], away=True)) ** 2))


def gained(forward: Predictor, base: Fit, before: float, left: float) -> float:
    """Log likelihood that is gained if squares of a fit fall, both judged in white noise as large as what is left."""
    count = sum(int(forward.blocks[b].seen().sum()) for b in base.blocks)
    return 0.5 * count * float(np.log(before / max(left, 1e-12 * before)))


def from_given_numbers(
    forward: Predictor, signatures: Sequence[Signature], given: Fit, base: Fit, weights: Weights
) -> Iterator[tuple[np.ndarray, float] | None]:
    """Of each suspect, its best strength and numbers about the model as given, and what that gains over a refitted one.

    All is linear about the given numbers: where a refit left them, it took up what the suspect does, which then shows
    no more about the refit.

    Args:
        signatures: about the model as given.
    """
    about, before = Cleared(given, weights), Cleared(base, weights).missed
    residual = about.whole([r[:, None] for r in about.line.residual], away=True)[:, 0]
    rest = about.rest(residual[:, None])[:, 0]
    numbers = given.coordinates
    for s in signatures:
        if not s.parts or s.status:
            yield None
            continue
        change = about.whole(s.parts, away=False)
        mine = about.rest(change)
        strength = lsq_linear(mine, rest, s.bounds).x
        left = float(np.sum((rest - mine @ strength) ** 2))
        moved = about.explaining(residual - change @ strength)
        theta = np.concatenate([numbers.values(numbers.of(given.theta) + moved), s.values(strength)])
        gain = gained(forward, base, before, left)
        yield (theta, gain) if gain > 0.0 else None


def at_their_strengths(
    forward: Predictor, signatures: Sequence[Signature], base: Fit, weights: Weights
) -> list[Signature]:
    """Signatures, those that explain most simulated at the strengths with which they do, if these then explain `STILL`.

    Each is a secant, and what it promises is true where it was simulated: a magnet that leans by 15 degrees promised
    30 less of log evidence than its fit had, when it was simulated at 6. But where a refit took numbers far from what
    they are, they have to go back by as much, which is not linear: of a stack that is 13 % stronger the secant promised
    2 of log evidence, and it was not fitted. They are as many as are paired with others.
    """
    if any(s.status == LATE for s in signatures):
        return list(signatures)
    about, settled = Cleared(base, weights), set[int]()
    rest = about.rest(about.whole([r[:, None] for r in about.line.residual], away=True))[:, 0]

    def explained(s: Signature) -> tuple[float, np.ndarray]:
        """Half the squares that a signature leaves at best, and the strengths over its size with which it does."""
        mine = about.rest(about.whole(s.parts, away=False))
        found = lsq_linear(mine, rest, s.bounds)
        # the wrong way, a strength is next to none at its bound
        return float(found.cost), np.where(np.abs(found.x) < LEAST, 0.0, found.x)

    def elsewhere(strengths: np.ndarray) -> bool:
        """Whether a signature explains most at strengths, over its size, at which it was not simulated."""
        x = np.abs(strengths)
        return bool(np.any((x > 0.0) & ((x < 1.0 / MOST) | (x > MOST))))

    out, whole = list(signatures), 0.5 * float(rest @ rest)
    best = {n: explained(s) for n, s in enumerate(out) if s.parts and not s.status}
    for n, new in _at_other_times(forward, {n: out[n] for n in best}, base, weights):
        then = explained(new) if all(np.all(np.isfinite(p)) for p in new.parts) else None
        if then is not None and then[0] < best[n][0] and np.any(then[1]) and not elsewhere(then[1]):
            out[n], best[n] = new, then
    for _ in range(ROUNDS):
        leading = sorted(best, key=lambda n: best[n][0])[:LEADING]
        far = [n for n in leading if n not in settled and elsewhere(best[n][1])]
        if not far:
            break
        strengths = [best[n][1] for n in far]
        for n, new in zip(far, simulated_at(forward, [out[n] for n in far], strengths, base, weights), strict=True):
            then = explained(new) if all(np.all(np.isfinite(p)) for p in new.parts) else None
            if then is not None and whole - then[0] > STILL * (whole - best[n][0]):
                out[n], best[n] = new, then
            else:
                settled.add(n)
    return rated(out, base)


def _at_other_times(
    forward: Predictor, signatures: Mapping[int, Signature], base: Fit, weights: Weights
) -> list[tuple[int, Signature]]:
    """Signatures of which the strength is a time, as of a lag, at as many as a time constant is suspected with.

    A lag of milliseconds shows in the frame of a switch alone, and tells nothing of one of seconds.
    """
    steps = [float(np.median(np.diff(r.times))) for r in forward.recordings]
    longest = max(float(np.ptp(r.times)) for r in forward.recordings)
    known, each = [], []
    for n, s in signatures.items():
        if all(f.unit == "s" for f in s.suspect.strengths):
            for time in np.geomspace(min(steps), longest, CONSTANTS + 2)[1:-1]:
                factors = time / s.size
                if np.all(np.abs(factors) > MOST):
                    both = (factors, -factors) if s.side == 0 else (np.abs(factors),)
                    known += [n] * len(both)
                    each += both
    return list(zip(known, simulated_at(forward, [signatures[n] for n in known], each, base, weights), strict=True))


def over_their_range(
    forward: Predictor,
    suspects: Sequence[Suspect],
    base: Fit,
    weights: Weights,
    progress: Callable[[float], object] | None = None,
    grid: np.ndarray = GRID,
) -> Iterator[tuple[np.ndarray, float] | None]:
    """Of each suspect beside a fit, the best of a few strengths, and the log likelihood that it gains.

    What a strength changes is simulated; starts and the fit's numbers follow linearly. None where none of the strengths
    gains anything. Strengths that would slow the solver down are left out, as in a fit.
    """
    about = Cleared(base, weights)
    for n, s in enumerate(suspects):
        if progress and progress(n / len(suspects)) is False:  # out of time
            yield from [None] * (len(suspects) - n)
            return
        thetas = [np.concatenate([base.theta, values]) for values in over_range(s, grid)]
        best = _best_of(forward, base, about, base.hypothesis.plus(s), thetas)
        yield best[:2] if best else None


def over_shapes(forward: Predictor, f: Fit, weights: Weights) -> tuple[np.ndarray, float] | None:
    """The numbers (P,) of a fit with another value of one beside a strength, and the log likelihood that this gains.

    What a value changes is simulated; starts and other numbers follow linearly. None where no other value gains any.
    """
    return _best_along(forward, f, weights, _along_shapes(forward, f))


def over_numbers(forward: Predictor, f: Fit, weights: Weights) -> tuple[np.ndarray, float] | None:
    """The same with another value of one of the model's numbers, over its prior."""
    return _best_along(forward, f, weights, (([k], thetas) for k, thetas in along_numbers(forward, f)))


def _along_shapes(forward: Predictor, f: Fit) -> Iterator[tuple[list[int], np.ndarray]]:
    """Each number beside a strength, and the numbers (n, P) of a fit with its values over what is plausible.

    A threshold comes with strengths of its own: a stiff stop late is as a soft one early, and of what lies between a
    fit misses more.
    """
    every = [(s, n) for s in f.hypothesis.suspects for n in s.free]
    place = len(forward.subject.nominals)
    for k, (s, n) in enumerate(every, start=place):
        if n in s.strengths:
            continue
        threshold = bool(get(s.effect).parameter(n.name).threshold)
        values = n.start * np.linspace(0.5, 2.0, SHAPES) if threshold else over_shape(n, f.theta[k])
        thetas = np.repeat(f.theta[None], len(values), axis=0)
        thetas[:, k] = values
        if not threshold:
            yield [k], thetas
            continue
        for j, (other, strength) in enumerate(every, start=place):
            if other is s and strength in s.strengths:
                sizes = strength.start + np.copysign(strength.scale * COARSE, f.theta[j])
                both = np.repeat(thetas, len(sizes), axis=0)
                both[:, j] = np.clip(np.tile(sizes, len(thetas)), strength.lower, strength.upper)
                yield [j, k], both


def _best_along(
    forward: Predictor, f: Fit, weights: Weights, each: Iterable[tuple[list[int], np.ndarray]]
) -> tuple[np.ndarray, float] | None:
    """The best of values of single numbers of a fit, with all others that follow linearly, and what it gains."""
    numbers = f.coordinates
    found: tuple[np.ndarray, float] | None = None
    for held, thetas in each:
        about = Cleared(f, weights, held=held)
        best = _best_of(forward, f, about, f.hypothesis, list(thetas))
        if best and best[1] > (found[1] if found else 0.0):
            theta, gain, left = best
            found = numbers.values(numbers.of(theta) + about.explaining(left)), gain
    return found


def _best_of(
    forward: Predictor, f: Fit, about: Cleared, hypothesis: Hypothesis, thetas: list[np.ndarray]
) -> tuple[np.ndarray, float, np.ndarray] | None:
    """Of some numbers of a hypothesis those that leave least, the log likelihood that they gain, and what they leave.

    Those that would slow the solver down are left out, as in a fit. None where nothing is gained.
    """
    least = forward.step(f.hypothesis, f.theta) / UTMOST
    thetas = [t for t in thetas if forward.step(hypothesis, t) >= least]
    if not thetas:
        return None
    hypotheses = [f.hypothesis, *[hypothesis] * len(thetas)]
    shot = forward.shoot(hypotheses, [f.theta, *thetas], np.repeat(f.local[None], len(hypotheses), axis=0), f.blocks)
    parts = changed(forward, shot, about.weights, f.blocks)
    whole = about.whole([r[:, None] - c.T for r, c in zip(about.line.residual, parts, strict=True)], away=True)
    left = np.sum(about.rest(whole) ** 2, axis=0)
    best = int(np.argmin(np.where(np.isfinite(left), left, np.inf)))
    gain = gained(forward, f, about.missed, left[best]) if np.isfinite(left[best]) else 0.0
    return (thetas[best], gain, whole[:, best]) if gain > 0.0 else None


def over_range(suspect: Suspect, grid: np.ndarray = GRID) -> list[np.ndarray]:
    """Numbers of an effect that are tried: each strength alone, of either sign where it may have both."""
    start, out = np.array([f.start for f in suspect.free]), []
    for n, f in enumerate(suspect.free):
        if f not in suspect.strengths:
            continue
        for value in np.unique(np.clip(f.start + f.scale * np.concatenate([grid, -grid]), f.lower, f.upper)):
            if value != f.start:
                out.append(np.where(np.arange(len(start)) == n, value, start))
    return out


def over_shape(shape: Free, at: float) -> np.ndarray:
    """Values of a number beside a strength: SHAPES of what is plausible, and as evenly up to where it is beyond."""
    if shape.lower >= 0.0 and shape.start > 0.0:
        ends = max(shape.lower, shape.start / PLAUSIBLE), min(shape.upper, shape.start * PLAUSIBLE)
        whole = min(ends[0], at or ends[0]), max(ends[1], at)
        share = np.log(whole[1] / whole[0]) / np.log(ends[1] / ends[0])
        return np.geomspace(*whole, round(SHAPES * share))
    far = PLAUSIBLE * shape.scale
    return np.linspace(max(shape.lower, shape.start - far), min(shape.upper, shape.start + far), SHAPES)

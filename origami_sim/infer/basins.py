"""Basins: where fits of a model end that amplifies what is small, and how better ones are found.

What snaps, walks or rings, and is predicted from one start over all of a recording, has a likelihood with many maxima:
a number that is a little off moves a snap out of reach of what derivatives tell. A fit then ends though other numbers,
no stranger than its own, suit the recording better. There, effects are tried over their ranges and numbers over their
priors, in batches; a loss that calms the model makes it linear, and what further effects do is told about the best such
fit.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from origami_sim.effects import get
from origami_sim.fit.least_squares import OWED, Fit, carried_on, fit
from origami_sim.fit.nominal import ROUNDS, SAME, level
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import Hypothesis, Suspect, distinct_sites, scaled
from origami_sim.infer.budget import astray
from origami_sim.infer.profile import along_numbers, missed, several
from origami_sim.infer.scan import COARSE, Cleared, gained, over_numbers, over_shapes, over_their_range
from origami_sim.infer.screen import Signature, screen

CALMING = 3
"""Effects, the best over their ranges, of which the best fit tells more of a rough model. It bounds the time."""

LOOSE = 1.0
"""Gaps between segments, as a part of usual rates, with which a fit is sought anew that misses much: each segment
follows its own data. With a third the same stops are found; with `GAP`, with which fits are made, one of 0.1 N m/rad at
12 degrees ends at 0.006 and 8, or 0.017 and 12 degrees."""


def loosened(forward: Predictor, f: Fit) -> Fit:
    """A fit that goes on with loose ties: next to free segments are nearly linear in their starts.

    Beside impacts tied ones have many minima. What a model misses even so it misses with ties as well.
    """
    for _ in range(ROUNDS):
        before, f = f.rms(), carried_on(forward, f.reweighted(replace(level(forward, f), gap=LOOSE)))
        if f.failed or np.all(np.abs(np.log(f.rms() / before)) < SAME):
            break
    return f


def tightened(forward: Predictor, loose: Fit, tied: Fit) -> Fit:
    """A tied fit, or a better one that is found from one with loose ties (a homotopy)."""
    f = carried_on(forward, loose.reweighted(level(forward, loose)))
    return tied if f.failed or np.prod(f.rms() / tied.rms()) > 1.0 else f


def settled(forward: Predictor, f: Fit) -> tuple[Fit, bool]:
    """The fit, or a better one from other numbers of the model, and whether it is rough: has several basins.

    Along each number that moves the model, over its prior, what is missed has several minima then, parted by more than
    what decides anything. Starts of their own tie segments to the recording, so that predictions by these have one. It
    is not asked where a fit leaves little more than noise.
    """
    if forward.local or forward.curve or not astray(forward, f):
        return f, False
    white = level(forward, f)
    f = f.reweighted(white)
    rough = any(
        several(missed(forward, f.hypothesis, thetas, f.local, white)) for _, thetas in along_numbers(forward, f)
    )
    if not rough:
        return f, False
    return moved_on(forward, f, over_numbers(forward, f, white)) or f, True


def moved_on(forward: Predictor, f: Fit, found: tuple[np.ndarray, float] | None) -> Fit | None:
    """The fit from other numbers that were found to gain something, if it ends better than a fit does."""
    if found is None or found[1] < OWED or f.weights is None:
        return None
    other = fit(forward, f.hypothesis, f.weights, theta=found[0], local=f.local)
    return other if not other.failed and other.cost < f.cost else None


def noticeable(s: Suspect) -> Suspect:
    """The suspect with scales at which its strengths are noticeable in most devices.

    A model that amplifies what is small shows far weaker ones, which tell nothing.
    """
    first = get(s.effect).parameter(s.free[0].name).typical
    sizes = [abs(get(s.effect).parameter(f.name).typical or first or f.scale) for f in s.strengths]
    return scaled(s, sizes)


@dataclass(frozen=True, eq=False)
class Calm:
    """What makes a rough model linear: fits of one effect, and what others do beside the best of them.

    Attributes:
        signatures: of all suspects, about the best fit; without parts of those that cannot act beside its effect.
        weights: of these. fits: by suspect, those that were fitted. found: of each suspect, the best numbers over its
            range about the model as given, and what these gain over the refitted one; None if nothing.
    """

    signatures: list[Signature]
    weights: Weights
    fits: dict[int, Fit]
    found: list[tuple[np.ndarray, float] | None]


def calmest(
    forward: Predictor,
    suspects: Sequence[Suspect],
    given: Fit,
    base: Fit,
    progress: Callable[[float], None] | None = None,
) -> Calm | None:
    """Tries each effect over its range about the model as given, and fits the best few from there; None if none helps.

    Args:
        given, base: the model with its numbers as they were given, and refitted.
    """
    by, none = level(forward, base), Hypothesis()
    suspects, before = [noticeable(s) for s in suspects], Cleared(base, by).missed
    about = fit(forward, none, by, local=given.local, most=0)  # with derivatives by its numbers
    behind = gained(forward, about, Cleared(about, by).missed, before)
    found = [
        (one[0], one[1] - behind) if one and one[1] > behind else None
        for one in over_their_range(forward, suspects, about, by, progress, COARSE)
    ]
    fits: dict[int, Fit] = {}
    for n in sorted((n for n, one in enumerate(found) if one), key=lambda n: -found[n][1]):  # type: ignore[index]
        if len(fits) == CALMING:
            break
        if suspects[n].effect not in {suspects[k].effect for k in fits}:
            f = fit(forward, Hypothesis((suspects[n],)), by, theta=found[n][0], local=base.local)  # type: ignore[index]
            f = elsewhere(forward, f, rough=True)
            if not f.failed:  # what it misses is far less now, and decides where it ends
                on = elsewhere(forward, carried_on(forward, f.reweighted(level(forward, f))), rough=False)
                fits[n] = f if on.failed else on.reweighted(by)
    best = min(fits.values(), key=lambda f: f.cost, default=None)
    if best is None or best.cost > base.reweighted(by).cost - OWED:
        return None
    white = level(forward, best)
    (own,) = best.hypothesis.suspects
    beside = [s for s in suspects if distinct_sites(own, s)]
    told = {s.suspect.form: s for s in screen(forward, beside, best.reweighted(white), white)}
    every = [told.get(s.form, Signature(s, [], np.ones(len(s.strengths)))) for s in suspects]
    for n in fits:  # its numbers have the scales of the suspect that was fitted
        every[n] = every[n].of(suspects[n])
    return Calm(every, white, fits, found)


def elsewhere(forward: Predictor, f: Fit, rough: bool) -> Fit:
    """A fit, or a better one from another value of a number beside a strength, which may lie beyond a ridge.

    Where all is rough, also from another value of a number of the model.
    """
    if f.failed or f.weights is None:
        return f
    f = moved_on(forward, f, over_shapes(forward, f, f.weights)) or f
    return (moved_on(forward, f, over_numbers(forward, f, f.weights)) or f) if rough and f.weights else f

"""Numbers of a leading fit that recordings do not tell from zero, and further ones that they may tell."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from origami_sim.effects import get
from origami_sim.fit.least_squares import Fit
from origami_sim.hypotheses.hypothesis import Hypothesis, Suspect
from origami_sim.hypotheses.suspects import free_number
from origami_sim.infer.screen import Signature


def with_single_components(signatures: Sequence[Signature]) -> list[Signature]:
    """The signatures, and after each of a vector one for every component of it alone.

    A component that a device hardly shows, as the turn of a magnet about the normal of its panel, spoils the fits of
    the others: what it promises far from zero it does not keep.
    """
    out = []
    for s in signatures:
        out.append(s)
        strong, rest = s.suspect.strengths, [n for n in s.suspect.free if n not in s.suspect.strengths]
        if len(strong) < 2 or not is_vector(s.suspect) or not s.parts:
            continue
        for n, strength in enumerate(strong):
            alone = replace(s.suspect, free=(replace(strength, spread=np.inf), *rest))
            mine = slice(n, n + 1)
            parts = [p[:, mine] for p in s.parts]
            if not any(np.any(p) for p in parts):  # recordings do not show it
                continue
            out.append(replace(s, suspect=alone, parts=parts, size=s.size[mine], norm=s.norm[mine], raw=s.raw[mine]))
    return out


def is_vector(s: Suspect) -> bool:
    """Whether a suspect's strengths are components of one vector: branches of a spectrum have a time constant each."""
    return len(s.free) < 2 * len(s.strengths)


def with_further_numbers(f: Fit) -> tuple[Hypothesis, np.ndarray] | None:
    """The effects of a fit with their further numbers (`Effect.further`), and where to begin; None if there are none.

    They change little before the others are about right, and much of what is seen of a blow: from afar a fit with them
    ends elsewhere.
    """
    place, suspects, theta = len(f.free) - len(f.hypothesis.free), [], [f.theta[: len(f.free) - len(f.hypothesis.free)]]
    for s in f.hypothesis.suspects:
        names = [] if s.more else [n for n in get(s.effect).further if n not in {g.name for g in s.free}]
        more = tuple(free_number(s.effect, n, s.entities) for n in names)
        suspects.append(replace(s, free=(*s.free, *more)) if more else s)
        theta += [f.theta[place : place + len(s.free)], np.array([g.start for g in more])]
        place += len(s.free)
    hypothesis = Hypothesis(tuple(suspects))
    return (hypothesis, np.concatenate(theta)) if len(hypothesis.free) > len(f.hypothesis.free) else None


def near_zero(f: Fit, credible: float) -> np.ndarray:
    """(P,) whether each number of a fit may be zero, by a Wald test with that probability.

    A number that lies on its bound has no deviation there: it is told, unless it is zero.
    """
    return np.square(f.theta) <= chi2.ppf(credible, 1) * np.square(f.deviations())


def without_unseen_components(f: Fit, credible: float) -> tuple[Hypothesis, np.ndarray] | None:
    """The effects of a fit and its numbers, without components that may be zero; None if all are told.

    Of every vector one is left at least. The others are zero together by a Wald test, all numbers refitted.

    Args:
        credible: probability with which a component is told from zero.
    """
    assert f.linear is not None
    a = np.concatenate([f.linear.eliminated.rows[:, :-1], np.diag(f.coordinates.precision)])
    root = np.linalg.pinv(a, rcond=1e-12)
    cover, at = root @ root.T, f.coordinates.of(f.theta)
    place, gone, suspects = len(f.free) - len(f.hypothesis.free), [], []
    for s in f.hypothesis.suspects:
        vector = is_vector(s)
        unseen = _unseen(cover, at, [place + k for k, n in enumerate(s.free) if vector and n in s.strengths], credible)
        kept = [n for k, n in enumerate(s.free) if place + k not in unseen]
        suspects.append(replace(s, free=(replace(kept[0], spread=np.inf), *kept[1:])) if unseen else s)
        gone += unseen
        place += len(s.free)
    return (Hypothesis(tuple(suspects)), np.delete(f.theta, gone)) if gone else None


def _unseen(cover: np.ndarray, at: np.ndarray, strong: list[int], credible: float) -> list[int]:
    """Components of a vector, not all of them, that may be zero at once.

    Args:
        cover: [P, P] covariance of all coordinates. at: (P,) those. strong: which are of the vector.
    """
    gone: list[int] = []
    while len(gone) < len(strong) - 1:
        lost = {k: _lost(cover, at, [*gone, k]) for k in strong if k not in gone}
        least = min(lost, key=lambda k: lost[k])
        if lost[least] >= chi2.ppf(credible, len(gone) + 1):
            break
        gone.append(least)
    return gone


def _lost(cover: np.ndarray, at: np.ndarray, some: list[int]) -> float:
    """Squares that a fit loses if some coordinates are zero, all others refitted."""
    return float(at[some] @ np.linalg.pinv(cover[np.ix_(some, some)], rcond=1e-12) @ at[some])

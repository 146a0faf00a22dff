"""Signatures: what each suspect would change in the predictions, simulated once about a fit."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from origami_sim.effects import get
from origami_sim.fit.chain import Chain
from origami_sim.fit.derivatives import changed, small
from origami_sim.fit.evidence import Group
from origami_sim.fit.least_squares import SLOWEST, Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import Suspect, along_each_axis, scaled, usual
from origami_sim.threads import side_by_side

SILENT = 0.3
"""Norm of a signature [standard deviations] below which a suspect at its largest admissible strength is not excited.

A tenth of the smallest strength that the priors know; half or twice as much only changes which sentence an unseen
suspect gets.
"""

MOST, LEAST = 1.25, 0.1
"""What a signature may change, over what a fit misses; else it is simulated again at a strength that suits.

About a strength that explains what is missed all is to be linear: of much less friction a swing tells little of what
more of it does. A swing that a delay has turned by a radian changes no more for being later, by 1.4 times what is
missed if all is: a clock 12 ms late was simulated with 97 ms, and never fitted.
"""

SPARSE = 8
"""One of so many segments tells how much a suspect changes at a strength, before all are simulated.

Half and double change the verdict of no strip, and the probability of what is not named beside it by 0.09.
"""

ROUNDS = 8
"""Times that a suspect is simulated again, at most, until its strength suits. A delay of a field took three."""

CHUNK, ALONG = 6, 24
"""Suspects that are simulated together, so that progress shows and cores share them; and of equilibria along time or
loads, of which every frame takes its time however many worlds there are."""


LATE = "not simulated before the limit"
"""Status of a suspect for which there was no time."""


@dataclass(frozen=True, eq=False)
class Signature:
    """What a suspect would do to the predictions.

    Attributes:
        suspect: with the scales of its strengths set to `size`.
        parts: per block, the whitened changes [r, k] of the rows of a linearisation for a change of each strength.
        size: (k,) those changes [SI], signed. norm: (k,) of what they do, without what starts and numbers could explain
            of it. raw: (k,) with it.
        status: "", or why the suspect cannot be tested.
    """

    suspect: Suspect
    parts: list[np.ndarray]
    size: np.ndarray
    norm: np.ndarray = field(default_factory=lambda: np.zeros(1))
    raw: np.ndarray = field(default_factory=lambda: np.zeros(1))
    status: str = ""

    @property
    def side(self) -> int:
        """1 or -1 where physics allows only a change like `size`, or only its reverse; 0 for both."""
        f = self.suspect.free[0]
        if f.start <= f.lower:
            return 1 if self.size[0] > 0 else -1
        if f.start >= f.upper:
            return -1 if self.size[0] > 0 else 1
        return 0

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest change (k,) of each strength, over `size`."""
        ends = np.array([(f.lower - f.start, f.upper - f.start) for f in self.suspect.strengths]) / self.size[:, None]
        return ends.min(axis=1), ends.max(axis=1)

    def group(self, first: int) -> Group:
        """The columns of its strengths in a linear problem, from that one on."""
        k, size = len(self.size), usual(self.suspect, self.suspect.strengths)
        return Group(tuple(range(first, first + k)), k, np.zeros(k), self.side, np.full(k, np.inf), *self.bounds, size)

    def of(self, suspect: Suspect) -> "Signature":
        """The same of its suspect with other scales: of changes as large as those."""
        size = np.array([f.scale for f in suspect.strengths])
        ratio = size / self.size
        parts, loud = [p * ratio for p in self.parts], np.abs(ratio)
        return replace(self, suspect=suspect, parts=parts, size=size, norm=self.norm * loud, raw=self.raw * loud)

    def values(self, change: np.ndarray) -> np.ndarray:
        """Values of its suspect's numbers [SI] with the strengths (k,) changed, over `size`."""
        s = self.suspect
        strong = dict(zip(s.strengths, change * self.size, strict=True))
        return np.array([np.clip(f.start + strong.get(f, 0.0), f.lower, f.upper) for f in s.free])


def screen(
    forward: Predictor,
    suspects: Sequence[Suspect],
    base: Fit,
    weights: Weights,
    *,
    sized: bool = False,
    progress: Callable[[float], None] | None = None,
    going_on: Callable[[], bool] = lambda: True,
) -> list[Signature]:
    """Signatures of all suspects about a fit.

    What all creases (or panels) would do together is the sum of what each would do, so that only single ones are
    simulated.

    Args:
        sized: whether the scales of strengths are known to suit.
        going_on: asked before each few; if it says no, the others are `LATE`.
    """
    single = [one for s in suspects if not _together(s, suspects) for one in along_each_axis(s)]
    count = ALONG if forward.curve else CHUNK
    groups = [single[k : k + count] for k in range(0, len(single), count)]
    goal = float(np.hypot(_missed(forward, base, weights), small(forward, weights, base.blocks)))

    def simulated(group: Sequence[Suspect]) -> list[tuple[Suspect, np.ndarray, float]] | None:
        return _signatures(forward, group, base, weights, goal, sized) if going_on() else None

    each = side_by_side([partial(simulated, group) for group in groups], forward.threads, progress)
    assert base.linear is not None
    ends = np.cumsum([r.count for r in base.linear.rows])[:-1]
    alone = (
        Signature(s, np.split(one[1][:, None], ends), np.array([one[2]]))
        if one is not None
        else Signature(s, [], np.array([s.free[0].scale]), status=LATE)
        for group, mine in zip(groups, each, strict=True)
        for s, one in zip(group, mine or [None] * len(group), strict=True)
    )
    found = {id(s): _vector(s, [next(alone) for _ in s.strengths]) for s in suspects if not _together(s, suspects)}
    for s in suspects:
        if not _together(s, suspects):
            continue
        names = [f.name for f in s.strengths]
        mine = [v for v in found.values() if v.suspect.effect == s.effect and not v.suspect.more]
        mine = [v for v in mine if [f.name for f in v.suspect.strengths] == names]
        if any(v.status for v in mine):
            found[id(s)] = Signature(s, [], np.array([f.scale for f in s.strengths]), status=LATE)
            continue
        if sum(any(np.any(p) for p in v.parts) for v in mine) < 2:
            continue  # where it can act at a single place, at all of them is the same
        size = np.median([abs(m.size) for m in mine], axis=0) * np.sign(mine[0].size)
        parts = [np.sum([m.parts[n] * (size / m.size) for m in mine], axis=0) for n in range(len(base.blocks))]
        found[id(s)] = Signature(s, parts, size)
    return rated([found[id(s)] for s in suspects if id(s) in found], base)


def simulated_at(
    forward: Predictor, some: Sequence[Signature], strengths: Sequence[np.ndarray], base: Fit, weights: Weights
) -> list[Signature]:
    """Signatures simulated again, each at strengths (k,) over its size; those at zero at the size they had."""
    least = forward.step(base.hypothesis, base.theta) / SLOWEST
    each = [
        (axis, _affordable(forward, base, axis, z * x, least))
        for s, x in zip(some, strengths, strict=True)
        for axis, z, x in zip(along_each_axis(s.suspect), s.size, np.where(x == 0.0, 1.0, x), strict=True)
    ]
    groups = [each[k : k + CHUNK] for k in range(0, len(each), CHUNK)]

    def simulated(group: Sequence[tuple[Suspect, float]]) -> list[Signature]:
        size = np.array([z for _, z in group])
        changes = _changes(forward, [s for s, _ in group], size, base, weights, base.blocks)
        return [Signature(s, [c[:, None] for c in p], np.array([z])) for (s, z), p in zip(group, changes, strict=True)]

    found = side_by_side([partial(simulated, group) for group in groups], forward.threads)
    alone = iter([one for group in found for one in group])
    return [_vector(s.suspect, [next(alone) for _ in s.size]) for s in some]


def rated(found: Sequence[Signature], base: Fit) -> list[Signature]:
    """The signatures with their norms about a fit, and what cannot be tested there."""
    line = base.linear
    assert line is not None
    good = [s for s in found if s.parts and np.all(np.isfinite(np.concatenate(s.parts)))]
    if not good:
        return [replace(s, status=s.status or "its simulation goes unstable") for s in found]
    prior = base.coordinates.precision

    def columns(some: Sequence[int]) -> list[np.ndarray]:
        return [np.concatenate([line.tangent[n], *(s.parts[n] for s in good)], axis=1) for n in some]

    whole = Chain.shared(line, columns).eliminated().rows
    width = line.tangent[0].shape[1]
    below = np.zeros((width, whole.shape[1]))
    below[:, :width] = np.diag(prior[:width])
    whole = np.concatenate([whole, below])
    raw = np.linalg.norm(whole[:, width:], axis=0)
    q, r = np.linalg.qr(whole[:, :width])
    size = np.abs(np.diag(r))
    q = q[:, size > 1e-8 * size.max(initial=1e-300)]
    norm = np.linalg.norm(whole[:, width:] - q @ (q.T @ whole[:, width:]), axis=0)
    out, place = [], dict(zip(map(id, good), np.cumsum([0, *(len(s.size) for s in good)]).tolist(), strict=False))
    for s in found:
        if s.status:
            out.append(s)
            continue
        if id(s) not in place:
            out.append(replace(s, parts=[], status="its simulation goes unstable"))
            continue
        mine = slice(place[id(s)], place[id(s)] + len(s.size))
        loud = np.linalg.norm(np.concatenate(s.parts), axis=0)
        reach = np.full(len(s.size), np.inf)  # of a coefficient that has no typical size any is plausible
        if _typical(s.suspect):
            each = zip(along_each_axis(s.suspect), s.size, strict=True)
            reach = np.maximum(1.0, [_admissible(a, 10 * np.sign(z) * _typical(a)) / z for a, z in each])
        status, shows = "", (norm[mine] * reach >= SILENT) & (norm[mine] >= 1e-6 * loud)
        if not np.any(shows):
            status = (
                "these recordings do not excite it"
                if np.all(loud * reach < SILENT)
                else "starts of segments can take its place"
                if np.all(raw[mine] * reach < SILENT)
                else "nominal parameters can take its place"
            )
        parts = s.parts if np.all(shows) else [np.where(shows, p, 0.0) for p in s.parts]
        out.append(replace(s, parts=parts, norm=norm[mine], raw=loud, status=status))
    return out


def _vector(s: Suspect, axes: Sequence[Signature]) -> Signature:
    """The signature of a suspect from those of each of its strengths alone."""
    size = np.concatenate([a.size for a in axes])
    if late := next((a.status for a in axes if a.status), ""):
        return Signature(scaled(s, size), [], size, status=late)
    parts = [np.concatenate(p, axis=1) for p in zip(*(a.parts for a in axes), strict=True)]
    return Signature(scaled(s, size), parts, size)


def _together(s: Suspect, suspects: Sequence[Suspect]) -> bool:
    """Whether a suspect is the sum of other suspects of its effect at single entities."""
    return (
        s.kind in ("crease", "panel")
        and s.entities is None
        and any(t.effect == s.effect and t.entities is not None for t in suspects)
        and not get(s.effect).memory
        and not any(p.threshold for p in get(s.effect).parameters)  # single ones begin at angles of their own
    )


def _signatures(
    forward: Predictor, group: Sequence[Suspect], base: Fit, weights: Weights, goal: float, sized: bool
) -> list[tuple[Suspect, np.ndarray, float]]:
    """What suspects change in all rows (R,) by their first strengths, and how large these are.

    They are simulated together, such that they change about as much as `goal`.
    """
    least = forward.step(base.hypothesis, base.theta) / SLOWEST
    size = np.array([_affordable(forward, base, s, s.free[0].scale, least) for s in group])

    def changes(mine: Sequence[int], at: np.ndarray, blocks: Sequence[int]) -> list[list[np.ndarray]]:
        return _changes(forward, [group[k] for k in mine], at[mine], base, weights, blocks)

    if not sized and (some := _some(forward, base.blocks)):
        parts, share = changes(range(len(group)), size, some), np.sqrt(len(some) / len(base.blocks))
        size = _suiting(forward, base, group, size, parts, share * goal, least)
    parts = changes(range(len(group)), size, base.blocks)
    for n in range(ROUNDS):
        suits = _suiting(forward, base, group, size, parts, goal, least)
        if n:  # a delay that leaves a segment as it is may move the next one into it
            suits = np.where(abs(suits) < abs(size), suits, size)
        again = np.flatnonzero(suits != size).tolist()
        if not again:
            break
        for k, new in zip(again, changes(again, suits, base.blocks), strict=True):
            parts[k], size[k] = new, suits[k]
    return [(s, np.concatenate(p), float(z)) for s, z, p in zip(group, size, parts, strict=True)]


def _some(forward: Predictor, blocks: Sequence[int]) -> Sequence[int]:
    """Every eighth segment; none where recordings have few."""
    recordings = {forward.blocks[b].recording for b in blocks}
    return blocks[SPARSE // 2 :: SPARSE] if len(blocks) >= 2 * SPARSE * len(recordings) else ()


def _suiting(forward: Predictor, base: Fit, group: Sequence[Suspect], size, parts, goal: float, least: float):
    """Strengths at which suspects change about as much as is missed, by what they change at strengths `size`."""
    norm = np.array([np.linalg.norm(np.concatenate(p)) for p in parts])
    loud = np.where(norm == 0.0, 0.01, np.clip(np.nan_to_num(norm / goal, nan=100.0), 1e-4, 1e4))
    each = zip(group, size, loud, strict=True)
    return np.array(
        [z if LEAST <= by <= MOST else _affordable(forward, base, s, z / by / MOST, least) for s, z, by in each]
    )


def _missed(forward: Predictor, base: Fit, weights: Weights) -> float:
    """What a fit leaves beyond the measurement noise, and moves its numbers from their priors [standard deviations]."""
    left = np.concatenate(base.residuals)
    beyond = np.nansum(left**2 - forward.blocks[0].noise ** 2, axis=0) / weights.deviation**2
    return float(np.sqrt(np.sum(np.maximum(beyond, 0.0)) + base.penalty))


def _affordable(forward: Predictor, base: Fit, s: Suspect, change: float, least: float) -> float:
    """A change within the bounds with which the solver's step is no smaller than the least."""
    change = _admissible(s, change)
    if get(s.effect).family == "measurement":  # does not move anything
        return change
    rest = [f.start for f in s.free[1:]]
    hypothesis = base.hypothesis.plus(s)
    for _ in range(12):
        theta = np.concatenate([base.theta, [s.free[0].start + change], rest])
        if forward.step(hypothesis, theta) >= least:
            break
        change /= 4.0
    return change


def _typical(s: Suspect) -> float:
    """A noticeable strength; ten times as much is the most that is plausible."""
    effect = get(s.effect)
    return max(abs(effect.parameter(n).typical or 0.0) for n in (*effect.fitted[:1], *(f.name for f in s.strengths)))


def _admissible(s: Suspect, change: float) -> float:
    """A change of the strength that stays within its bounds."""
    f = s.free[0]
    return float(np.clip(f.start + change, f.lower, f.upper) - f.start) or f.scale


def _changes(
    forward: Predictor, group, size, base: Fit, weights: Weights, blocks: Sequence[int]
) -> list[list[np.ndarray]]:
    """Per suspect and block, what it changes in the predictions [r]; nan where the simulation fails.

    Suspects that need the same step of the solver, within a factor of two, are simulated together.
    """
    rest = [np.array([f.start for f in s.free], float) for s in group]
    for values, z in zip(rest, size, strict=True):
        values[0] += z
    thetas = [np.concatenate([base.theta, v]) for v in rest]
    hypotheses = [base.hypothesis.plus(s) for s in group]
    steps = np.array([forward.step(h, t) for h, t in zip(hypotheses, thetas, strict=True)])
    pace = np.round(np.log2(np.maximum(steps, 1e-12) / max(steps.max(), 1e-12)))
    out: list[list[np.ndarray]] = [[] for _ in group]
    for p in np.unique(pace):
        mine = np.flatnonzero(pace == p)
        shot = forward.shoot(
            [base.hypothesis, *(hypotheses[k] for k in mine)],
            [base.theta, *(thetas[k] for k in mine)],
            np.repeat(base.local[None], 1 + len(mine), axis=0),
            blocks,
        )
        for part in changed(forward, shot, weights, blocks, base.blocks):
            for k, row in zip(mine, part, strict=True):
                out[k].append(row)
    return out

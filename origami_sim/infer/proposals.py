"""Which set of effects to fit next: one that was estimated and may be as probable as the best that was fitted.

Half and double of UNFITTED, LEADING and OWED change no word on four swings (two rub, one stiffens, one lacks nothing),
and no probability by more than 0.08 (OWED; the others 0.03).
"""

from collections.abc import Sequence

import numpy as np
from scipy.stats import t as student

from origami_sim.fit.evidence import AT_BOUND
from origami_sim.fit.least_squares import OWED
from origami_sim.infer.placement import LEADING
from origami_sim.infer.posterior import Key, Posterior

UNFITTED = 0.05
"""Part of the best set's posterior up to which another is not worth a fit: what is named holds four times the rest."""

ROUGH = 0.01
"""Part of what is missed by which steps improve the first fit of a set, at least; it is carried on in its own noise.

Also the part of what an effect explains to which derivatives tell what another in its place would: of a field's lag of
8 ms beside friction, estimated at 6 below a motion blur that explains 10,000, and 20 above it by its fit.
"""


def proposed(out: Posterior, n: int) -> Key | None:
    """The n-th set to fit: by turns the most promising one, and one that would do what the best does; None: enough.

    Before sets that can at most stand beside a pair comes the better half of that: if it suffices, most of them do not.
    """
    key = _likely(out)
    if (key is None or out.promised(key) < max(out.total[k] for k in named(out))) and (half := _better_half(out)):
        return half
    if n % 2 or key is None:
        key = _analogous(out) or _alike(out) or _alone(out) or key
    return key or _equivalent(out) or _within(out) or _alike(out, ROUGH)


def named(out: Posterior) -> list[Key]:
    """The fitted sets of which one may be named, once others are known.

    Where the best set is of so many laws that they rather imitate another, none of its kind is: it suffices to know it.
    """
    few = [k for k in out.nodes if not out.imitates(k)]
    return few if out.imitates(out.leader) else list(out.nodes)


def _likely(out: Posterior) -> Key | None:
    """The set to fit next: of those that may be named that which promises most, if it may be as probable as any.

    What only adds to the best effects changes what is said only if it takes the lead, which it has to promise.
    """
    fitted = named(out)
    others = out.estimates if len(fitted) == len(out.nodes) else [k for k in out.estimates if not out.imitates(k)]
    best = max(fitted, key=lambda k: out.total[k])
    near = out.total[best] + np.log(UNFITTED)
    least = {k: out.total[best] if best and k > best else near for k in others}
    unfitted = {k: _most(out, k) for k in others}
    # another start of the shape of a set that was fitted has to promise more than that did
    better = [k for k, w in unfitted.items() if w > max(least[k], out.hoped.get(out.labels(k), -np.inf) + OWED)]
    return max((k for k in better if not _idle(out, k)), key=lambda k: unfitted[k], default=None)


def _most(out: Posterior, key: Key) -> float:
    """Log posterior that a set which was not fitted may have at most, but for UNFITTED."""
    thought, promise = out.total[key], out.promised(key)
    if not np.isfinite(thought):
        return promise
    before = out.realised.get(out.estimates[key].parent, [])
    return thought + most_reached([(p - e, f - e) for e, p, f in before], promise - thought)


def _idle(out: Posterior, key: Key) -> bool:
    """Whether a set only adds to a fitted one what physics then holds at nothing, as a lag that would be negative."""
    estimate = out.estimates[key]
    node, column = out.nodes[estimate.parent], 0
    if key in out.begun or not key > node.key or out.promise[key] > out.total[node.key]:
        return False
    for g in estimate.groups:
        group = node.groups[g]
        strong = estimate.values[column : column + group.strengths]
        if g >= len(node.key) and np.all(np.abs(strong) <= AT_BOUND):
            return True
        column += len(group.columns)
    return False


def most_reached(pairs: Sequence[tuple[float, float]], room: float) -> float:
    """How far above its estimate a set may come at most (but for UNFITTED), up to its promise: by those before it.

    Both are linear. A fit comes to some part of the way from the one to the other, which errs in proportion to it.

    Args:
        pairs: of sets that were fitted, the room from estimate to promise, and how far above the estimate they came.
    """
    rooms, came = np.array(pairs).reshape(-1, 2).T
    square = float(rooms @ rooms)
    if len(pairs) < 2 or room <= 0.0 or not square:  # sets that had no room do not tell which part of it is reached
        return room
    part = float(rooms @ came) / square
    doubt = np.sqrt(np.sum((came - part * rooms) ** 2) / (len(pairs) - 1) * (1.0 + room**2 / square))
    return min(room, part * room + float(student.ppf(1.0 - UNFITTED, len(pairs) - 1)) * doubt)


def most_gained(gains: Sequence[float]) -> float:
    """What the next set may gain over its promise at most, if it is like those before (but for UNFITTED); 0 if none."""
    if not gains:
        return 0.0
    off = np.array(gains if len(gains) > 1 else [0.0, *gains])
    doubt = np.sqrt(1.0 + 1.0 / len(off)) * np.std(off, ddof=1)
    return float(np.mean(off) + student.ppf(1.0 - UNFITTED, len(off) - 1) * doubt)


def _alone(out: Posterior) -> Key | None:
    """A single effect to fit that may be best, if it is better than it promised by as much as other sets were.

    About a model that is far from what was recorded what is linear promises too little, or too much; about a fit that
    leaves white noise it tells which effects could stand in its place. Of an effect that was fitted alone, or is in the
    best set, there is no need to know more, but at another place.
    """
    best = max(out.total, key=lambda k: out.total[k])
    near, bonus = out.total[best] + np.log(UNFITTED), most_gained(out.gains)
    known = {out.labels(frozenset((n,))) for key in out.nodes if key == best or len(key) == 1 for n in key}
    singles = [k for k, p in out.ranked.items() if k in out.estimates and p + bonus >= near][:LEADING]
    singles = [k for k in singles if out.labels(k) not in known]
    instead = in_place_of(out, best)
    if not instead or not singles:
        return next(iter(singles), None)
    # to leave a strong effect out is not quite linear: the first ones tell by how much others are underestimated
    key = max(singles, key=lambda k: instead.get(k, np.inf))
    return key if not out.swapped or instead.get(key, np.inf) + most_gained(out.swapped) >= near else None


def _alike(out: Posterior, rough: float = 0.0) -> Key | None:
    """A set to fit that does what the best of those that may be named does, as that one's fit judges it.

    Args:
        rough: part of what an exchanged effect explains by which that may be wrong, as what is strong is not quite
            linear; until a fit has told by how much others are underestimated.
    """
    leader = out.nodes[max(named(out), key=lambda k: out.total[k])]
    most, fitted = out.total[leader.key], {out.effects(k) for k in out.nodes}
    near = most + np.log(UNFITTED)
    known_to = {k: rough * max(0.0, most - out.total.get(k & leader.key, most)) for k in leader.instead}
    alike = {k: t for k, t in leader.instead.items() if t >= near - known_to[k]}
    off = max((out.total[k] - t for k, t in alike.items() if k in out.nodes), default=np.inf)
    some = [k for k, t in alike.items() if k in out.estimates and t + max(off, 0.0) >= near]
    return max((k for k in some if out.effects(k) not in fitted), key=lambda k: alike[k], default=None)


def _analogous(out: Posterior) -> Key | None:
    """A set to fit that differs from a rival as the best one differs from another, if it may be as probable.

    Where two laws look alike, a third effect that is told beside one of them is told beside the other: what an effect
    adds to one set, or gains in the place of another, it is thought to gain in another set of that size.
    """
    best = max(named(out), key=lambda k: out.total[k])
    near, promise = out.total[best] + np.log(UNFITTED), dict[Key, float]()
    for one in out.nodes:
        gone, new = one - best, best - one
        if len(new) != 1 or len(gone) > 1:
            continue
        for rival in out.nodes:
            key = (rival - gone) | new
            if len(rival) == len(one) and gone <= rival and not new & rival and key in out.estimates:
                hope = out.total[rival] + out.total[best] - out.total[one]
                promise[key] = max(promise.get(key, -np.inf), hope)
    # what was fitted from other shapes, or with other components, has to promise more than it came to
    known = {out.labels(k): out.total[k] + OWED for k in sorted(out.nodes, key=lambda k: out.total[k])}
    more = [k for k, p in promise.items() if p >= max(near, known.get(out.labels(k), near))]
    return max(more, key=lambda k: promise[k], default=None)


def _equivalent(out: Posterior) -> Key | None:
    """A set to fit with another effect for one of the best's, if it does the same to the refitted model.

    A late drive and a late clock do the same to what rests at first. About the refitted model this shows; where a clock
    is 12 ms late already, a drive that is just beginning to be does something else. Alike is what the noise of the best
    does not tell apart: in what the refitted model leaves, far more would be.
    """
    none, best = out.nodes[frozenset()], out.nodes[max(named(out), key=lambda k: out.total[k])]
    fitted, lost, bound = {out.effects(k) for k in out.nodes}, {}, -2.0 * np.log(UNFITTED)
    place, cell = dict(zip(none.others, none.groups, strict=True)), none.grid[0]
    values = dict(zip(map(id, best.fit.free), best.fit.theta, strict=True))
    noise, coarse = best.fit.weights, none.fit.weights
    finer = 1.0 if noise is None or coarse is None else float(np.min(coarse.deviation / noise.deviation)) ** 2
    for n in best.key & place.keys():
        one, columns = out.signatures[n], list(place[n].columns)
        change = np.array([values.get(id(f), f.start) - f.start for f in one.suspect.strengths]) / one.size
        for other, group in place.items():
            key, its = (best.key - {n}) | {other}, list(group.columns)
            if cell is None or other in best.key or key not in out.estimates or out.effects(key) in fitted:
                continue
            does, alike = (finer * cell.gram[rows][:, columns] @ change for rows in (columns, its))
            if change @ does > bound:  # else it does not see it at all
                same = np.linalg.lstsq(finer * cell.gram[its][:, its], alike, rcond=1e-12)[0]
                lost[key] = change @ does - alike @ same
    return min((k for k in lost if lost[k] < bound), key=lambda k: lost[k], default=None)


def _within(out: Posterior) -> Key | None:
    """Where the best set is of too many laws to be named, the best of those within it that may be, if not fitted."""
    if not out.imitates(out.leader):
        return None
    inside = [k for k in out.estimates if k < out.leader and not out.imitates(k)]
    known = max((out.total[k] for k in out.nodes if k < out.leader and not out.imitates(k)), default=-np.inf)
    best = max(inside, key=lambda k: out.total[k], default=None)
    return best if best is not None and out.total[best] > known else None


def _better_half(out: Posterior) -> Key | None:
    """The better of the best set's two effects, if estimates were wrong by as much as the other adds to it.

    Next to a strong bend, as that of a stop, derivatives do not tell which of them is needed.
    """
    best = max(named(out), key=lambda k: out.total[k])
    key = max((best - {n} for n in best), key=lambda k: out.total.get(k, -np.inf), default=best)
    off = max((abs(f - e) for each in out.realised.values() for e, _, f in each), default=0.0)
    needed = len(best) != 2 or key not in out.estimates or out.total[key] + off < out.total[best] + np.log(UNFITTED)
    return None if needed else key


def in_place_of(out: Posterior, best: Key) -> dict[Key, float]:
    """Log posterior of single effects in the place of the best set, as its fit judges them if it leaves white noise."""
    leader = out.nodes.get(best)
    white = leader is not None and leader.fit.weights is not None and not leader.fit.weights.colour
    return leader.instead if leader is not None and white else {}

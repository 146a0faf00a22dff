"""Which case is what: kinds in fixed proportions, and within a kind every factor evenly, however many are drawn."""

from itertools import combinations

import numpy as np

PROPORTIONS = {"single": 240, "null": 100, "outside": 60, "confounded": 40, "double": 40, "beside": 40}
"""Cases of each kind in the full battery."""

FULL = sum(PROPORTIONS.values())


def kinds_of(count: int, kinds=tuple(PROPORTIONS)) -> list[str]:
    """The kind of each of the first cases: always that which lags most behind its share."""
    share = {k: PROPORTIONS[k] / sum(PROPORTIONS[j] for j in kinds) for k in kinds}
    drawn, out = dict.fromkeys(kinds, 0), []
    for n in range(count):
        kind = max(kinds, key=lambda k: (n + 1) * share[k] - drawn[k])
        drawn[kind] += 1
        out.append(kind)
    return out


def balanced(cells: list[tuple], count: int, rng: np.random.Generator) -> list[tuple]:
    """So many of the cells, of which every first few are as even as can be.

    The next cell is one whose factors were drawn least, the first factor before the second, and then one whose pairs of
    factors were; chance decides between equals.
    """
    width = len(cells[0])
    pairs = list(combinations(range(width), 2))
    ones, twos = [{} for _ in range(width)], [{} for _ in pairs]
    out = []
    for _ in range(count):
        lot = rng.permutation(len(cells))

        def load(n, lot=lot):
            c = cells[n]
            single = tuple(t.get(v, 0) for t, v in zip(ones, c, strict=True))
            double = tuple(t.get((c[i], c[j]), 0) for t, (i, j) in zip(twos, pairs, strict=True))
            return (*single, *double, lot[n])

        chosen = cells[min(range(len(cells)), key=load)]
        for t, v in zip(ones, chosen, strict=True):
            t[v] = t.get(v, 0) + 1
        for t, (i, j) in zip(twos, pairs, strict=True):
            t[chosen[i], chosen[j]] = t.get((chosen[i], chosen[j]), 0) + 1
        out.append(chosen)
    return out


def stratum(seed: int, index: int, cells: dict[str, list[tuple]]) -> tuple[str, tuple]:
    """Kind and cell of a case; `cells` by kind, those kinds that may be drawn."""
    kinds = kinds_of(index + 1, tuple(k for k in PROPORTIONS if cells.get(k)))
    kind = kinds[-1]
    rng = np.random.default_rng([seed, list(PROPORTIONS).index(kind)])
    return kind, balanced(cells[kind], kinds.count(kind), rng)[-1]

"""The posterior over sets of effects: those that were fitted, and what was estimated about them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import logsumexp
from scipy.stats import chi2

from origami_sim.fit.evidence import Group, Problem, Summed
from origami_sim.fit.hyper import HYPER, Hyper
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import Suspect
from origami_sim.infer.discrepancy import laws
from origami_sim.infer.foresight import Foresight
from origami_sim.infer.screen import Signature

Key = frozenset[int]

CREDIBLE = 0.95
"""Probability that what is stated holds: a set of explanations, or that a strength is not zero."""


@dataclass(eq=False)
class Node:
    """A fitted set.

    Attributes:
        key: indices of its suspects. fit: about which everything is linear. evidence: (cells,) log evidence.
        groups: columns of the fit's own effects, then of the others'. others: indices of these.
        grid: the summed problems by cell. owed: see `judged`. tried: noise of the leader that was tried on it.
        foresight: if the fit leaves coloured noise, until the node is in its place. problems: by size of the gaps, if
            they are to be stored. wide: whether sets that add to it were judged.
        instead: log posterior of single effects in its place, and of sets with another effect for one of its own, as it
            judges them.
    """

    key: Key
    fit: Fit
    evidence: np.ndarray
    groups: list[Group]
    others: list[int]
    grid: list[Summed | None]
    owed: float = 0.0
    tried: Weights | None = None
    foresight: Foresight | None = None
    problems: dict[float, Problem] = field(default_factory=dict)
    wide: bool = False
    instead: dict[Key, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Estimate:
    """Of a set that was not fitted: by which fitted one, as which groups of it, and the values of their columns.

    `near`: how many effects that one has more or less, how many suspects, and its evidence, the better the smaller
    (what an effect does at another site is told best where it acts). `gain`: log Bayes factor of the set over that one.
    """

    parent: Key
    groups: tuple[int, ...]
    values: np.ndarray
    near: tuple[int, int, float]
    gain: float


@dataclass(eq=False)
class Posterior:
    """Over sets of effects, and sizes of discrepancy.

    Attributes:
        signatures: of all suspects, about the refitted model. nodes: fitted sets. log: by set, (cells,) log
            posterior, not normalised; total: over all cells. estimates: of sets that were not fitted. failed: why a fit
            was not possible.
        ranked: single effects, those first that promise most to the model without any. hoped: what sets that were
            fitted had promised, by their labels. gains: by how much single effects, and what adds to the model
            without any, were better than that had promised.
        promise: log posterior that sets which were not fitted may have. weights: of the signatures.
        store: whether nodes keep their problems, to be judged anew (`stored`). smooth: of all nodes, see `cosines`.
        ahead: sets that were fitted and of which a larger one promises more: what, and how. renewed: sets that
            were fitted again for it, with that larger one. polished: leaders that were fitted on. begun: numbers from
            which single effects are fitted, where those are not linear about the refitted model. reconsidered: whether
            all were tried over their ranges. swapped: by how much single effects were better than they promised in
            the place of the best set. realised: log Bayes factors of sets over the fit that their estimates are about,
            by that fit: as estimated, as promised, and as fitted. rough: whether fits end in many basins, see `basins`.
            futile: sets that were fitted since one took the lead. about: by fitted set, signatures about its fit, where
            those about the refitted model do not tell what stands beside it. beyond: the model without any effects,
            about which a moment that no law gives was sought. ended: whether the search was ended before it was done.
    """

    signatures: list[Signature]
    weights: Weights
    hyper: Hyper = HYPER
    nodes: dict[Key, Node] = field(default_factory=dict)
    log: dict[Key, np.ndarray] = field(default_factory=dict)
    total: dict[Key, float] = field(default_factory=dict)
    estimates: dict[Key, Estimate] = field(default_factory=dict)
    failed: dict[Key, str] = field(default_factory=dict)
    ranked: dict[Key, float] = field(default_factory=dict)
    gains: list[float] = field(default_factory=list)
    hoped: dict[tuple[str, ...], float] = field(default_factory=dict)
    promise: dict[Key, float] = field(default_factory=dict)
    store: bool = False
    smooth: list[np.ndarray] = field(default_factory=list)
    ahead: dict[Key, tuple[float, Estimate]] = field(default_factory=dict)
    renewed: set[tuple[Key, Key]] = field(default_factory=set)
    beyond: Node | None = None
    about: dict[Key, dict[int, Signature]] = field(default_factory=dict)
    polished: set[Key] = field(default_factory=set)
    begun: dict[Key, np.ndarray] = field(default_factory=dict)
    reconsidered: bool = False
    swapped: list[float] = field(default_factory=list)
    realised: dict[Key, list[tuple[float, float, float]]] = field(default_factory=dict)
    rough: bool = False
    futile: int = 0
    ended: bool = False
    _labels: dict[Key, tuple[str, ...]] = field(default_factory=dict)

    def probabilities(self, among: Iterable[Key] | None = None) -> dict[Key, float]:
        """Of each set (or of some), over all sizes of discrepancy; of those whose shapes begin elsewhere, the best.

        A set that was not fitted is as probable as its estimate, of whose gain that part counts which others realised
        that were estimated by the same fit: what is linear errs in proportion to how far it goes.
        """
        part = {k: realised_part([(e, f) for e, _, f in each]) for k, each in self.realised.items()}
        log = {k: self.total[k] for k in (self.total if among is None else among)}
        for k, e in self.estimates.items():
            if k in log:
                log[k] -= (1.0 - part.get(e.parent, 1.0)) * max(e.gain, 0.0)
        best: dict[tuple[str, ...], Key] = {}
        for key in sorted(log, key=lambda k: (k in self.nodes, log[k])):
            best[self.labels(key)] = key
        p = np.array([log[k] for k in best.values()])
        total = logsumexp(p)
        return dict.fromkeys(log, 0.0) | dict(zip(best.values(), np.exp(p - total).tolist(), strict=True))

    @property
    def most_probable(self) -> Key:
        """The most probable set, fitted or not."""
        chance = self.probabilities()
        return max(chance, key=lambda k: (chance[k], k in self.nodes))

    @property
    def leader(self) -> Key:
        """The most probable set of those that were fitted."""
        return max(self.nodes, key=lambda k: self.total[k])

    def labels(self, key: Key) -> tuple[str, ...]:
        """Effects of a set and their sites."""
        if key not in self._labels:
            self._labels[key] = tuple(sorted(self.suspect(n).label for n in key))
        return self._labels[key]

    def promised(self, key: Key) -> float:
        """Log posterior that a set which was not fitted may have, by the nearest fit."""
        return max(self.total[key], self.promise[key])

    def drop(self, key: Key) -> None:
        """Leaves out what is known of a set that was not fitted."""
        del self.log[key], self.total[key], self.promise[key], self.estimates[key]

    def cells(self, key: Key | None = None) -> np.ndarray:
        """(cells,) posterior of sizes of discrepancy and flaws, given a set or over all."""
        log = self.log[key] if key is not None else logsumexp(np.stack(list(self.log.values())), axis=0)
        return np.exp(log - logsumexp(log))

    def imitates(self, key: Key) -> bool:
        """Whether a set is of so many laws that they rather imitate one which the catalogue lacks."""
        return self.hyper.foreign(laws(self.effects(key))) > 0.5

    def effects(self, key: Key) -> frozenset[str]:
        """What acts in a set, wherever it does."""
        return frozenset(self.suspect(n).effect for n in key)

    def told(self, key: Key) -> frozenset[str]:
        """Effects of a set, without those whose strengths its fit does not tell from zero: a Wald test.

        A set is judged beside a discrepancy that its fit lacks. Where that is large, an effect may be probable which
        the fit hardly has: of it there is no strength to say. Nor is there where it changes the fit by less than data
        see, as of a clock in slow steps, whatever its derivatives promise.
        """
        node, every = self.nodes.get(key), self.effects(key)
        if node is None or not key:
            return every
        gaps = len(self.hyper.cells) // len(self.hyper.gaps)  # the first cell of each gap has the least discrepancy
        cell = node.grid[gaps * int(np.argmax(node.evidence[::gaps]))]
        own, suspects, out = node.groups[: len(key)], node.fit.hypothesis.suspects, set(every)
        if cell is None:
            return every
        for effect in every:
            mine = [n for n, s in enumerate(suspects) if s.effect == effect]
            shown = chi2.ppf(CREDIBLE, sum(own[n].strengths for n in mine))
            columns = [c for n in mine for c in own[n].columns[: own[n].strengths]]
            at = np.concatenate([own[n].at[: own[n].strengths] for n in mine])
            if cell.lost(own, mine) < shown or at @ cell.gram[np.ix_(columns, columns)] @ at < shown:
                out.remove(effect)
        return frozenset(out)

    def suspect(self, n: int) -> Suspect:
        return self.signatures[n].suspect

    def signature(self, n: int, key: Key) -> Signature:
        """What a suspect does beside a fitted set: about its fit, if that was simulated; in the same units anywhere."""
        return self.about.get(key, {}).get(n, self.signatures[n])

    def label(self, key: Key) -> str:
        return " + ".join(self.labels(key)) or "nominal"


def realised_part(pairs: Sequence[tuple[float, float]]) -> float:
    """Part of estimated gains that fits realised, all of it at most: a regression through the origin."""
    estimated, fitted = np.maximum(np.array(pairs).T, 0.0)
    square = float(estimated @ estimated)
    return min(float(estimated @ fitted) / square, 1.0) if square else 1.0


def marginals(p: Posterior) -> dict[str, float]:
    """Posterior of each effect at each site, over all sets."""
    out: dict[str, float] = {}
    for key, value in p.probabilities().items():
        for label in {p.suspect(n).label for n in key}:
            out[label] = out.get(label, 0.0) + value
    return dict(sorted(out.items(), key=lambda item: -item[1]))

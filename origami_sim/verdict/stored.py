"""A finished search as arrays, and the posterior that follows from them with any hyperparameters, without a simulation.

What is stored is what judging needs and not the reasoning: suspects with their groups of columns, and of every fitted
set the Gram matrices of all columns and of the residual, one for each size of the gaps. Sizes of flaws, of the
channels' discrepancy and of strengths, and the priors of sets, are not in them. The sizes of the gaps are: only those
that were stored, or some of them, can be judged.

Columns of the discrepancy have one prior for all, so that they are stored in the axes in which their Gram matrix is
diagonal: with K of them and C effects that is C K numbers in place of (C + K)^2 / 2, and nothing is lost.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular

from origami_sim.errors import InputError
from origami_sim.fit.evidence import Group, Problem, Sets, Summed, without_flaws
from origami_sim.fit.hyper import HYPER, Hyper
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import Free, Hypothesis, Suspect
from origami_sim.infer.budget import Budget, Share
from origami_sim.infer.placement import enter, log_priors, place
from origami_sim.infer.posterior import Key, Node, Posterior
from origami_sim.infer.remainder import mismatch
from origami_sim.infer.screen import Signature
from origami_sim.verdict.decide import best_of, decide
from origami_sim.verdict.sentences import COMPARED, unnamed_verdict

NULL = 1e-9
"""Part of the largest eigenvalue of the discrepancy's columns below which an axis is nothing but rounding."""


@dataclass(frozen=True, eq=False)
class Reduced:
    """A `Problem` whose columns of the discrepancy are in axes of their own.

    Attributes:
        gram: [C + 1, C + 1] of the effects' columns and of the residual. cross: [C + 1, K] of these with the axes.
        size: (K,) squares of the axes. constant: of the log evidence.
    """

    gram: np.ndarray
    cross: np.ndarray
    size: np.ndarray
    constant: float

    @classmethod
    def of(cls, p: Problem) -> "Reduced":
        c, last = p.columns, len(p.gram) - 1
        size, axes = np.linalg.eigh(p.gram[c:last, c:last])
        kept = size > NULL * size.max(initial=0.0)
        rows = [*range(c), last]
        return cls(p.gram[np.ix_(rows, rows)], p.gram[rows, c:last] @ axes[:, kept], size[kept], p.constant)

    def summed(self, smooth: float, flaws: float, held: Sequence[int] = ()) -> Summed:
        """As `evidence.summed`, of what that does in one step: the discrepancy is summed out first, then the flaws."""
        c = len(self.gram) - 1
        norms = np.sqrt(np.maximum(np.diag(self.gram)[:c], 1e-12))
        scale = np.where(norms > 1e-5, flaws / np.sqrt(max(c, 1)) / norms, 0.0)
        scale[list(held)] = 0.0
        by = smooth**2 / (1.0 + smooth**2 * self.size)
        gram = self.gram - (self.cross * by) @ self.cross.T
        log = self.constant - 0.5 * float(np.sum(np.log1p(smooth**2 * self.size)))
        root = np.linalg.cholesky(np.eye(c) + gram[:c, :c] * scale[:, None] * scale)
        left = solve_triangular(root, gram[:c] * scale[:, None], lower=True, check_finite=False)
        return Summed(gram - left.T @ left, log - float(np.sum(np.log(np.diag(root)))))


@dataclass(frozen=True, eq=False)
class Stored:
    """What judging needs.

    Attributes:
        suspects: of the search, with sides and whether they can be tested. gaps: sizes that were stored.
        nodes: of each fitted set: members in order, groups, other suspects, problems by gap (where segments are not
            tied: one for all). wide: those by which sets that add to them were judged.
        failed: sets that could not be fitted. budgets: of each fitted set.
        quiet: the verdict if nothing is named. compared: share of the frames.
    """

    suspects: list[tuple[Suspect, int, str]]
    gaps: tuple[float, ...]
    nodes: dict[Key, tuple[list[int], list[Group], list[int], dict[float, Reduced]]]
    failed: list[Key]
    budgets: dict[Key, Budget]
    quiet: str
    compared: float
    wide: frozenset[Key]

    @classmethod
    def of(cls, forward: Predictor, given: Fit, base: Fit, p: Posterior, compared: float) -> "Stored":
        """From a finished search that kept its problems (`search(store=True)`)."""
        place_of = {id(s.suspect): n for n, s in enumerate(p.signatures)}
        nodes = {}
        for key, node in p.nodes.items():
            members = [place_of[id(s)] for s in node.fit.hypothesis.suspects]
            nodes[key] = members, node.groups, node.others, {g: Reduced.of(q) for g, q in node.problems.items()}
        quiet = unnamed_verdict(forward, given, base, 1.0)[0]
        return cls(
            [(s.suspect, s.side, s.status or ("" if s.parts else "none")) for s in p.signatures],
            p.hyper.gaps,
            nodes,
            list(p.failed),
            {k: mismatch(p, forward, given, base, k) for k in p.nodes},
            quiet,
            compared,
            frozenset(k for k, n in p.nodes.items() if n.wide),
        )

    def judged(self, hyper: Hyper = HYPER) -> Posterior:
        """The posterior with any hyperparameters.

        Raises:
            InputError: a size of the gaps that was not stored.
        """
        foreign = sorted(set(hyper.gaps) - set(self.gaps))
        if foreign:
            allowed = ", ".join(f"{g:g}" for g in self.gaps)
            raise InputError("this size was not stored", field="gaps", value=foreign[0], allowed=allowed)
        signatures = [
            Signature(
                s, [] if status else [np.zeros(0)], np.full(len(s.strengths), 1.0 if side >= 0 else -1.0), status=status
            )
            for s, side, status in self.suspects
        ]
        out = Posterior(signatures, Weights(np.ones(1)), hyper)
        out.failed = dict.fromkeys(self.failed, "")
        prior = log_priors(signatures, hyper)
        for key, node in self.nodes.items():
            judge_by = place if key in self.wide else enter
            judge_by(out, self._node(key, *node, signatures, hyper), prior)
        return out

    def _node(self, key, members, groups, others, problems, signatures, hyper: Hyper) -> Node:
        hypothesis = Hypothesis(tuple(signatures[m].suspect for m in members))
        fit = Fit(hypothesis, hypothesis.free, np.zeros(0), np.zeros((0, 0)), (), 0.0, 0.0, [], np.zeros(0))
        own = [tuple(range(len(members)))]
        laid = Sets.of(own, groups, len(members), len(next(iter(problems.values())).gram) - 1)
        grid, evidence, held = [], np.full(len(hyper.cells), -np.inf), without_flaws(groups[: len(members)])
        for c, (gap, size, flaws) in enumerate(hyper.cells):
            # segments that are not tied have one problem; the cells of other gaps then say the same and are left out
            one = problems[min(problems)] if gap == hyper.gaps[0] else None
            known = problems.get(gap) if len(problems) > 1 else one
            grid.append(known.summed(size, flaws, held) if known is not None else None)
            if known is not None:
                evidence[c] = grid[-1].of(laid, hyper)[0][0]
        return Node(key, fit, evidence, groups, others, grid)

    def decided(self, p: Posterior) -> dict[str, Any]:
        """Verdict, labels that are chosen and probability, as `verdict.judge` has them before it writes sentences."""
        d = decide(p, self.budgets.__getitem__)
        word, probability, chosen = d.word, None if np.isnan(d.probability) else d.probability, []
        if not d.lead and word != "UNTESTABLE":
            quiet = "UNTESTABLE" if self.compared < COMPARED else self.quiet
            word = word or quiet
            probability = None if word == "UNKNOWN" else probability
        elif word == "UNKNOWN":
            chosen = [p.label(d.best)]
        elif d.tie:
            chosen = [p.label(best_of(p, d.chance, c)) if c else "nominal" for c in d.credible]
        elif word != "UNTESTABLE":
            chosen = [p.suspect(n).label for n in d.best if p.suspect(n).effect in d.lead]
        return {"verdict": word, "chosen": chosen, "probability": probability}

    def save(self, path: str | Path) -> Path:
        """Writes a compressed file of arrays; nothing in it is pickled."""
        arrays: dict[str, np.ndarray] = {}
        nodes = []
        for n, (key, (members, groups, others, problems)) in enumerate(self.nodes.items()):
            found = self.budgets[key]
            shares = [[s.name, s.kind, s.share] for s in found.shares]
            told = [
                [list(g.columns), g.strengths, g.at.tolist(), g.side]
                + [[_json(v) for v in values] for values in (g.spread, *g.bounds(), g.sizes())]
                + [g.whole and [list(g.whole[0]), g.whole[1].tolist()]]
                for g in groups
            ]
            nodes.append(
                {"members": members, "others": others, "groups": told, "shares": shares, "gaps": list(problems)}
                | {"wide": key in self.wide, "over": found.over}
                | {"pushed": found.pushed, "real": found.real, "beyond": found.beyond}
            )
            for k, r in enumerate(problems.values()):
                upper = np.triu_indices(len(r.gram))
                arrays[f"{n}.{k}.gram"], arrays[f"{n}.{k}.cross"] = r.gram[upper], r.cross.astype(np.float32)
                arrays[f"{n}.{k}.size"], arrays[f"{n}.{k}.constant"] = r.size, np.array(r.constant)
        about = {
            "suspects": [[_plain(s), side, status] for s, side, status in self.suspects],
            "gaps": self.gaps,
            "nodes": nodes,
            "failed": [sorted(k) for k in self.failed],
            "quiet": self.quiet,
            "compared": self.compared,
        }
        arrays["about"] = np.frombuffer(json.dumps(about).encode(), np.uint8)
        path = Path(path)
        part = path.with_name(f".{path.name}.partial.npz")
        try:
            np.savez_compressed(part, allow_pickle=False, **arrays)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
        return path

    @classmethod
    def load(cls, path: str | Path) -> "Stored":
        """Reads what `save` wrote.

        Raises:
            InputError: no such file, or one of another kind.
        """
        try:
            with np.load(path, allow_pickle=False) as data:
                about = json.loads(data["about"].tobytes())
                arrays = {k: data[k] for k in data.files}
        except (OSError, ValueError, KeyError) as error:
            raise InputError(f"is no stored search ({error})", file=path) from None
        nodes, budgets = {}, {}
        for n, node in enumerate(about["nodes"]):
            key = frozenset(node["members"])
            groups = [
                Group(
                    tuple(c),
                    s,
                    np.array(at, float),
                    side,
                    _wide(spread),
                    _wide(low, -np.inf),
                    _wide(high),
                    _wide(typical),
                    whole and (tuple(whole[0]), np.array(whole[1])),
                )
                for c, s, at, side, spread, low, high, typical, whole in node["groups"]
            ]
            problems = {}
            for k, gap in enumerate(node["gaps"]):
                cross = arrays[f"{n}.{k}.cross"].astype(float)
                gram = np.zeros((len(cross), len(cross)))
                gram[np.triu_indices(len(cross))] = arrays[f"{n}.{k}.gram"]
                gram += np.triu(gram, 1).T
                size, constant = arrays[f"{n}.{k}.size"], float(arrays[f"{n}.{k}.constant"])
                problems[float(gap)] = Reduced(gram, cross, size, constant)
            nodes[key] = list(node["members"]), groups, list(node["others"]), problems
            more = {k: node.get(k, 0.0) for k in ("pushed", "real", "beyond")}
            budgets[key] = Budget([Share(*s) for s in node["shares"]], node["over"], **more)
        suspects = [(_suspect(s), side, status) for s, side, status in about["suspects"]]
        failed = [frozenset(k) for k in about["failed"]]
        wide = frozenset(frozenset(n["members"]) for n in about["nodes"] if n["wide"])
        return cls(suspects, tuple(about["gaps"]), nodes, failed, budgets, about["quiet"], about["compared"], wide)


def _wide(values: Sequence[float | None], none: float = np.inf) -> np.ndarray:
    """Numbers of a file, in which infinite ones are written as null."""
    return np.array([none if v is None else v for v in values])


def _json(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _plain(s: Suspect) -> dict[str, Any]:
    free = [{k: _json(v) if isinstance(v, float) else v for k, v in asdict(f).items()} for f in s.free]
    return {**asdict(s), "free": free}


def _suspect(given: Mapping[str, Any]) -> Suspect:
    """The suspect that was stored; bounds and spreads that are infinite were left out."""

    def tupled(value: Any) -> Any:
        return tuple(map(tupled, value)) if isinstance(value, list) else value

    ends = {"lower": -np.inf, "upper": np.inf, "spread": np.inf}
    free = [
        Free(**{k: tupled(ends.get(k, np.nan) if v is None and k in ends else v) for k, v in f.items()})
        for f in given["free"]
    ]
    return Suspect(**{k: tupled(v) for k, v in given.items() if k != "free"}, free=tuple(free))

"""Starts that are eliminated segment by segment: against one dense least-squares problem with all of them unknown."""

from dataclasses import replace
from itertools import accumulate

import numpy as np
import pytest
from scipy.linalg import lstsq

from origami_sim.fit import weights
from origami_sim.fit.linear import Linearisation
from origami_sim.fit.weights import Rows, Weights, recast

TIES = {
    "all tied": [True, True, True, False],
    "all free": [False, False, False, False],
    "two chains": [True, False, True, False],
    "one segment": [False],
}
LENGTHS = {"starts that data tell": 9, "starts that only the ties tell": 2}


def made(ties, *, data: int = 9, size: int = 3, numbers: int = 2, seed: int = 0) -> Linearisation:
    """A random problem; a segment that is not tied to the one before has rows of what is known of its start."""
    rng = np.random.default_rng(seed)
    rows, residual, tangent, slopes, tie = [], [], [], [], []
    for n, tied in enumerate(ties):
        r = Rows(data + n, 0 if n and ties[n - 1] else size, size if tied else 0)
        rows.append(r)
        residual.append(rng.normal(size=r.count))
        tangent.append(rng.normal(size=(r.count, numbers)))
        slopes.append(rng.normal(size=(r.count, size)))
        slopes[-1][r.data : r.data + r.start] = -np.diag(rng.uniform(0.1, 1.0, size))[: r.start]
        tie.append(rng.uniform(0.3, 3.0, size) if tied else None)
    return Linearisation(rows, residual, tangent, slopes, tie)


def dense(line: Linearisation) -> np.ndarray:
    """All rows by all starts."""
    size = line.slopes[0].shape[1]
    out = np.zeros((sum(r.count for r in line.rows), size * len(line.rows)))
    ends = list(accumulate(r.count for r in line.rows))
    for n, (end, r, slopes, tie) in enumerate(zip(ends, line.rows, line.slopes, line.tie, strict=True)):
        out[end - r.count : end, size * n : size * (n + 1)] = slopes
        if tie is not None:
            out[end - size : end, size * (n + 1) : size * (n + 2)] = -np.diag(tie)
    return out


cases = pytest.mark.parametrize("ties", TIES.values(), ids=list(TIES))
lengths = pytest.mark.parametrize("data", LENGTHS.values(), ids=list(LENGTHS))


@cases
@lengths
@pytest.mark.parametrize("seed", range(3))
def test_the_sweep_is_the_dense_problem(ties, data, seed):
    """Squares of innovations, starts and what they leave, and the determinant that the starts cost."""
    line = made(ties, data=data, seed=seed)
    a, y = dense(line), np.concatenate(line.residual)
    x, *_ = lstsq(a, y)
    squares = sum(float(v @ v) for v in line.cleared(line.residual))
    assert squares == pytest.approx(np.sum((y - a @ x) ** 2), rel=1e-10)
    chain = line.chain.eliminated()
    starts = list(chain.starts(np.eye(3)[:, 2:])[:, :, 0])
    assert np.concatenate(starts) == pytest.approx(x, abs=1e-9)
    assert np.concatenate(line.smoothed(line.residual, starts)) == pytest.approx(y - a @ x, abs=1e-9)
    ties_ = sum(float(np.sum(np.log(t))) for t in line.tie if t is not None)
    assert chain.spread == pytest.approx(0.5 * np.linalg.slogdet(a.T @ a)[1] - ties_, abs=1e-9)


@cases
def test_products_of_cleared_columns_are_those_without_the_starts(ties):
    line = made(ties, seed=7)
    a, t = dense(line), np.concatenate(line.tangent)
    rest = t - a @ lstsq(a, t)[0]
    found = np.concatenate(line.cleared(line.tangent))
    assert found.T @ found == pytest.approx(rest.T @ rest, abs=1e-9)


@cases
@lengths
@pytest.mark.parametrize("gap", [1.0, 0.05])
def test_a_chain_says_the_same_for_any_size_of_the_gaps(ties, data, gap):
    """Products of columns, and the chain of other weights, though the ties came after."""
    line, old = made(ties, data=data, seed=5), Weights(np.ones(1))
    new = replace(old, gap=gap)  # data weigh the same
    here = line.reweighted(old, new)
    left, there = line.chain.regapped(old.gap / gap).eliminated(), here.chain.eliminated()
    whole = np.concatenate(here.cleared([np.column_stack(p) for p in zip(here.tangent, here.residual, strict=True)]))
    assert left.rows.T @ left.rows == pytest.approx(whole.T @ whole, rel=1e-10, abs=1e-10)
    assert left.spread == pytest.approx(there.spread, abs=1e-9)
    assert left.starts(np.eye(3)) == pytest.approx(there.starts(np.eye(3)), abs=1e-8)


def test_innovations_do_not_know_what_comes_later():
    line = made([True, True, True, False])
    later = [r.copy() for r in line.residual]
    later[2] += 30.0
    before, after = line.cleared(line.residual), line.cleared(later)
    assert all(np.array_equal(a, b) for a, b in zip(before[:2], after[:2], strict=True))
    assert not np.allclose(before[2], after[2])


def test_gaps_without_doubt_join_segments_into_one():
    """A chain whose ties are exact is one long segment with one start."""
    rng = np.random.default_rng(4)
    step = np.array([[1.0, 0.3], [-0.2, 0.9]])
    looks = [rng.normal(size=(6, 2)) for _ in range(3)]
    rows, slopes, tie = [], [], []
    for n, look in enumerate(looks):
        last = n == len(looks) - 1
        rows.append(Rows(6, 2 if not n else 0, 0 if last else 2))
        known = [0.5 * np.eye(2)] if not n else []
        slopes.append(np.concatenate([look, *known, *([] if last else [1e6 * step])]))
        tie.append(None if last else np.full(2, 1e6))
    residual = [np.append(rng.normal(size=6), np.zeros(r.count - 6)) for r in rows]
    line = Linearisation(rows, residual, [np.zeros((r.count, 0)) for r in rows], slopes, tie)
    ways = [look @ np.linalg.matrix_power(step, n) for n, look in enumerate(looks)]
    one = np.concatenate([*ways, 0.5 * np.eye(2)])
    y = np.append(np.concatenate([r[:6] for r in residual]), np.zeros(2))
    squares = sum(float(v @ v) for v in line.cleared(residual))
    assert squares == pytest.approx(np.sum((y - one @ lstsq(one, y)[0]) ** 2), rel=1e-6)
    chain = line.chain.eliminated()
    assert chain.starts(np.eye(1))[0, :, 0] == pytest.approx(lstsq(one, y)[0], abs=1e-6)
    # what is left of the determinant is that of the one start
    assert chain.spread == pytest.approx(0.5 * np.linalg.slogdet(one.T @ one)[1], abs=1e-6)


def test_other_weights_scale_data_and_gaps_and_nothing_else():
    line = made([True, True, False], data=8)
    old, new = Weights(np.array([1.0]), gap=0.1), Weights(np.array([4.0]), gap=0.3)
    other = line.reweighted(old, new)
    for n, r in enumerate(line.rows):
        by = np.concatenate([np.full(r.data, 0.25), np.ones(r.start), np.full(r.tie, 1 / 3)])
        assert other.residual[n] == pytest.approx(by * line.residual[n])
        assert other.tangent[n] == pytest.approx(by[:, None] * line.tangent[n])
        assert other.slopes[n] == pytest.approx(by[:, None] * line.slopes[n])
    assert line.reweighted(old, old) is line
    back = other.reweighted(new, old)
    assert back.chain.eliminated().spread == pytest.approx(line.chain.eliminated().spread)


def test_missing_values_weigh_nothing():
    w = Weights(np.array([0.5, 2.0]))
    values = np.array([[1.0, np.nan], [np.nan, 4.0]])
    rows = Rows(4, seen=np.isfinite(values))
    assert w.whitened(values, rows) == pytest.approx([2.0, 0.0, 0.0, 2.0])
    coloured = Weights(np.array([0.5, 2.0]), (np.array([1.0, 0.5]), np.array([1.0])))
    assert coloured.whitened(values, rows) == pytest.approx([2.0, 0.0, 0.0, 2.0])


def test_coloured_residuals_are_whitened_exactly_in_the_frames_that_were_seen():
    rng = np.random.default_rng(3)
    colour = 0.8 ** np.arange(12)
    w = Weights(np.array([0.5, 3.0]), (colour, np.array([1.0])))
    seen = np.ones((12, 2), bool)
    seen[[3, 4, 9], 0] = False
    rows = Rows(24, seen=seen)
    values = np.where(seen, rng.normal(size=(5, 12, 2)), np.nan)
    white = w.whitened(values, rows)
    mine = seen[:, 0]
    cover = 0.25 * colour[np.abs(np.subtract.outer(np.flatnonzero(mine), np.flatnonzero(mine)))]
    for k in range(5):
        x = values[k, mine, 0]
        squares = x @ np.linalg.solve(cover, x) + np.sum(values[k, :, 1] ** 2) / 9.0
        assert white[k] @ white[k] == pytest.approx(squares)
    assert w.restored(white, rows) == pytest.approx(np.nan_to_num(values))
    other = Weights(np.array([1.0, 1.0]), gap=2.0)
    assert recast([white[0]], [rows], w, other)[0] == pytest.approx(np.nan_to_num(values[0]).ravel())


def test_short_segments_are_weighed_anew_as_long_ones_are(monkeypatch):
    """One matrix does what banded factors do, frame by frame, also where values are missing."""
    rng = np.random.default_rng(2)
    seen = rng.uniform(size=(9, 2)) > 0.2
    rows = [Rows(18, 0, 2), Rows(18, 2, 0, seen=seen)]
    old = Weights(np.array([0.5, 2.0]), (np.array([1.0, 0.4, 0.1]), np.array([1.0])), gap=0.1)
    new = Weights(np.array([0.7, 1.0]), (np.array([1.0, -0.2]), np.array([1.0, 0.3])), gap=0.3)
    for shape in ((), (3,)):
        columns = [rng.normal(size=(r.count, *shape)) for r in rows]
        columns[1][:18] *= seen.reshape(-1, *[1] * len(shape))
        short = recast(columns, rows, old, new)
        with monkeypatch.context() as m:
            m.setattr(weights, "DENSE", 0)
            long = recast(columns, rows, old, new)
        for one, other in zip(short, long, strict=True):
            assert one == pytest.approx(other, abs=1e-12)

"""The evidence of sets of effects: against integrals over grids, and against the frequencies of what was drawn."""

from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.special import logsumexp

from origami_sim.fit.evidence import Group, Sets, Summed, problem, summed, without_flaws
from origami_sim.fit.hyper import Hyper
from origami_sim.fit.linear import Linearisation
from origami_sim.fit.weights import Rows

HYPER = Hyper(slabs=(3.0, 10.0, 40.0), steep=0.2, effects=0.4)
COUNT, SMOOTH, FLAWS = 24, 0.7, 2.0
PRECISION, AWAY = np.array([0.8, 0.0]), np.array([0.3, 0.0])
LAPLACE = 0.05
"""Error of the log evidence where strengths are told."""

USUAL = 0.12
"""The same where data tell less of a strength than what is usual: the tails of a Cauchy density are not normal."""

FOLD = 1.3
"""What it is too small by where only the sum of two strengths is told: the prior has a fold at none."""


class Toy:
    """Two numbers of the model (one of which nothing is known), effects of one column each, and a smooth discrepancy.

    Args:
        scale: (C,) sizes of the effects' columns. at: (C,) values about which the problem is linear.
    """

    def __init__(self, scale, *, seed=0, alike=1.0):
        rng = np.random.default_rng(seed)
        self.numbers, self.smooth = rng.normal(size=(COUNT, 2)), rng.normal(size=(COUNT, 3))
        self.effects = rng.normal(size=(COUNT, len(scale))) * scale
        if alike < 1.0:
            self.effects[:, 1] = self.effects[:, 0] + alike * self.effects[:, 1]
        # without a prior: what the number explains is gone
        known = self.numbers[:, :1] / PRECISION[0]
        p = np.eye(COUNT) - np.outer(self.numbers[:, 1], self.numbers[:, 1]) / (self.numbers[:, 1] @ self.numbers[:, 1])
        plain = p @ np.linalg.inv(np.eye(COUNT) + p @ known @ known.T @ p) @ p
        norms = np.sqrt(np.einsum("rc,rs,sc->c", self.effects, plain, self.effects))
        flaws = self.effects * (FLAWS / np.sqrt(len(scale)) / norms)
        self.root = np.concatenate([known, flaws, SMOOTH * self.smooth], axis=1)
        self.precision = p @ np.linalg.inv(np.eye(COUNT) + p @ self.root @ self.root.T @ p) @ p
        self.norms = np.sqrt(np.einsum("rc,rs,sc->c", self.effects, self.precision, self.effects))

    def drawn(self, rng, a) -> np.ndarray:
        """A residual with effects of strengths a, and everything else at random; the number is away from its prior."""
        hidden = self.root @ rng.normal(size=self.root.shape[1]) + 5.0 * rng.normal() * self.numbers[:, 1]
        return self.effects @ a + hidden + AWAY[0] * self.numbers[:, 0] + rng.normal(size=COUNT)

    def summed(self, residual):
        line = Linearisation([Rows(COUNT)], [residual], [self.numbers], [np.zeros((COUNT, 0))], [None])
        return summed(problem(line, np.arange(2), PRECISION, AWAY, [self.effects], [self.smooth]), SMOOTH, FLAWS)

    def log_density(self, residual) -> np.ndarray:
        """Of residuals [..., n] without any effect, but for a constant."""
        e = residual - AWAY[0] * self.numbers[:, 0]
        return -0.5 * np.einsum("...r,rs,...s->...", e, self.precision, e)


def slab(d: np.ndarray) -> np.ndarray:
    w = np.array(HYPER.slabs)
    log = -0.5 * (d[..., None] / w) ** 2 - np.log(w * np.sqrt(2 * np.pi)) - HYPER.steep * np.log(w)
    return logsumexp(log, axis=-1) - np.log(np.sum(w**-HYPER.steep))


def groups(sides, at=None) -> list[Group]:
    at = np.zeros(len(sides)) if at is None else at
    return [Group((k,), 1, at[k : k + 1], side, np.array([np.inf])) for k, side in enumerate(sides)]


def gained(toy: Toy, residual, sets, made, own=0) -> np.ndarray:
    """Log evidence of sets over that of none."""
    s = toy.summed(residual)
    laid = [Sets.of([k], made, own, len(made)) for k in [(), *sets]]
    log = np.array([s.of(one, HYPER)[0][0] for one in laid])
    return log[1:] - log[0]


def on_grid(toy: Toy, residual, columns, sides) -> float:
    """The same by integrating over strengths on a grid of their detectability."""
    grids, logs = [], []
    for side in sides:
        d = np.linspace(-130.0 if side <= 0 else 0.0, 130.0 if side >= 0 else 0.0, 901 if len(columns) > 1 else 8001)
        grids.append(d)
        logs.append(slab(d) + np.log(d[1] - d[0]) + (np.log(2.0) if side else 0.0))
    mesh = np.meshgrid(*grids, indexing="ij")
    prior = sum(np.meshgrid(*logs, indexing="ij"))
    a = np.stack([m.ravel() / toy.norms[c] for m, c in zip(mesh, columns, strict=True)])
    left = residual - (toy.effects[:, columns] @ a).T
    return float(logsumexp(toy.log_density(left) + np.ravel(prior)) - toy.log_density(residual))


@pytest.mark.parametrize("d", [0.0, 2.0, 5.0, 20.0, -30.0])
@pytest.mark.parametrize("side", [0, 1, -1])
def test_one_effect(d, side):
    toy, rng = Toy([1.0, 30.0, 0.01]), np.random.default_rng(1)
    for column in range(3):
        a = np.zeros(3)
        a[column] = d / toy.norms[column]
        residual = toy.drawn(rng, a)
        (found,) = gained(toy, residual, [(column,)], groups([side] * 3))
        exact = on_grid(toy, residual, [column], [side])
        if side * d < -4.0:  # the tail of the wrong side: not told well, but never as more than it is
            assert found < exact + LAPLACE < -2.0
        else:
            assert found == pytest.approx(exact, abs=LAPLACE)


def test_what_lies_beyond_a_bound_explains_nothing():
    """An effect of d' 20 whose strength may be 5: its evidence is that of what 5 explains."""
    toy, rng = Toy([1.0]), np.random.default_rng(1)
    residual = toy.drawn(rng, np.array([20.0 / toy.norms[0]]))
    free, most = groups([0]), np.array([5.0 / toy.norms[0]])
    bound = [replace(free[0], low=-most, high=most)]
    d = np.linspace(-5.0, 5.0, 8001)
    left = residual - np.outer(d / toy.norms[0], toy.effects[:, 0])
    exact = logsumexp(toy.log_density(left) + slab(d)) + np.log(d[1] - d[0]) - toy.log_density(residual)
    (unbound,), (found,) = (gained(toy, residual, [(0,)], made) for made in (free, bound))
    assert unbound > 150.0 > 100.0 > found
    assert found == pytest.approx(exact, abs=LAPLACE)


def test_an_effect_at_its_bound_leaves_the_others_free():
    """Two that are nearly alike would be large and opposite: where one is bound, the other explains what both would."""
    toy, rng = Toy([1.0, 1.0], alike=0.3), np.random.default_rng(1)
    residual = toy.drawn(rng, np.array([60.0, -40.0]) / toy.norms)
    made = groups([0, 0])
    bound = [made[0], replace(made[1], low=np.full(1, -0.01 / toy.norms[1]), high=np.full(1, 0.01 / toy.norms[1]))]
    alone, both = gained(toy, residual, [(0,), (0, 1)], bound)
    assert alone - 10.0 < both < alone + 1.0
    assert gained(toy, residual, [(0, 1)], made)[0] > alone + 20.0


def test_the_wrong_side_of_a_bound_is_a_tail():
    toy, rng = Toy([1.0]), np.random.default_rng(1)
    residual = toy.drawn(rng, np.array([-5.0 / toy.norms[0]]))
    (sided,) = gained(toy, residual, [(0,)], [replace(groups([1])[0], low=np.zeros(1), high=np.full(1, np.inf))])
    assert sided == pytest.approx(on_grid(toy, residual, [0], [1]), abs=LAPLACE)


@pytest.mark.parametrize("d", [0.0, 5.0, 20.0])
@pytest.mark.parametrize("usual", [0.1, 3.0, 30.0, 1000.0])
def test_what_is_far_beyond_the_usual_is_less_probable(d, usual):
    """A strength of which d' = `usual` is usual, against the integral over its prior: slab times Cauchy, normalised."""
    toy = Toy([1.0])
    residual = toy.drawn(np.random.default_rng(1), np.array([d / toy.norms[0]]))
    made = [replace(groups([0])[0], usual=np.array([usual / toy.norms[0]]))]
    (found,) = gained(toy, residual, [(0,)], made)
    s = np.sinh(np.linspace(-12.0, 12.0, 20001)) * 1e-3  # fine about none, wide enough for the widest slab
    prior = slab(s) - np.log1p((s / usual) ** 2) + np.log(np.gradient(s))
    left = residual - np.outer(s / toy.norms[0], toy.effects[:, 0])
    exact = logsumexp(toy.log_density(left) + prior) - logsumexp(prior) - toy.log_density(residual)
    assert found == pytest.approx(exact, abs=USUAL)


@pytest.mark.parametrize("sides", [(0, 0), (1, 0)])
@pytest.mark.parametrize("d", [(4.0, 3.0), (12.0, -15.0), (25.0, 0.0)])
def test_two_effects(sides, d):
    toy = Toy([1.0, 5.0])
    residual = toy.drawn(np.random.default_rng(2), np.array(d) / toy.norms)
    (found,) = gained(toy, residual, [(0, 1)], groups(sides))
    assert found == pytest.approx(on_grid(toy, residual, [0, 1], sides), abs=LAPLACE)


@pytest.mark.parametrize("d", [(0.0, 0.0), (8.0, 0.0), (20.0, 10.0)])
@pytest.mark.parametrize("apart", [1e-1, 1e-3])
def test_two_effects_that_look_the_same(apart, d):
    """What only the sum of both tells, the prior holds together: no volume is won where nothing is told."""
    rng = np.random.default_rng(8)
    toy = Toy([1.0, 1.0], alike=apart)
    residual = toy.drawn(rng, np.array(d) / toy.norms)
    (found,) = gained(toy, residual, [(0, 1)], groups([0, 0]))
    exact = on_grid(toy, residual, [0, 1], (0, 0))
    assert exact - FOLD < found < exact + LAPLACE


def test_the_point_about_which_a_problem_is_linear_makes_no_difference():
    """A fit's own effects are linearised at their values; sets that lack them get the residual without these."""
    toy = Toy([1.0, 5.0, 2.0])
    residual = toy.drawn(np.random.default_rng(3), np.array([9.0, 0.0, -6.0]) / toy.norms)
    sets = [(0,), (1,), (2,), (0, 1), (0, 2), (1, 2)]
    plain = gained(toy, residual, sets, groups([0, 0, 0]))
    at = np.array([2.3, 0.0, 0.0])
    moved = gained(toy, residual - toy.effects @ at, sets, groups([0, 0, 0], at), own=1)
    assert moved == pytest.approx(plain, abs=1e-9)


def test_a_shape_beside_a_strength_has_its_own_prior():
    """A second column that is normal about where it begins, in a problem that is linear elsewhere."""
    toy, spread = Toy([1.0, 5.0]), 0.6
    at = np.array([8.0 / toy.norms[0], 0.4])
    residual = toy.drawn(np.random.default_rng(4), np.array([8.0 / toy.norms[0], 0.5]))
    group = Group((0, 1), 1, at, 0, np.array([np.inf, spread]))
    s = toy.summed(residual - toy.effects @ at)
    gram, log = s.gram, s.log
    out = s.of(Sets.of([(0,)], [group], 1, 2), HYPER)[0][0]
    norm = np.sqrt(gram[0, 0])
    strength = (np.linspace(-130, 130, 2601) / norm)[:, None]
    shapes = np.linspace(-5 * spread, 5 * spread, 401)[None]
    x, y = strength - at[0], shapes - at[1]
    square = gram[2, 2] - 2 * (x * gram[0, 2] + y * gram[1, 2])
    square = square + x**2 * gram[0, 0] + y**2 * gram[1, 1] + 2 * x * y * gram[0, 1]
    prior = slab(strength * norm) + np.log(norm) - 0.5 * (shapes / spread) ** 2 - np.log(spread * np.sqrt(2 * np.pi))
    cell = np.log((strength[1, 0] - strength[0, 0]) * (shapes[0, 1] - shapes[0, 0]))
    assert out == pytest.approx(log + logsumexp(prior - 0.5 * square) + cell, abs=LAPLACE)


@pytest.mark.parametrize("asked", [-3.0, 3.0])
@pytest.mark.parametrize("lacking", [(0,), (1,), (0, 1)])
def test_what_a_fit_loses_without_effects_is_what_least_squares_loses(lacking, asked):
    """One effect with a shape, one with another, and a third at its bound, of which data ask for less or for more."""
    toy, spread = Toy([1.0, 5.0, 2.0, 3.0, 1.5]), np.array([np.inf, 0.6])
    at = np.array([1.2, 0.4, 0.1, -0.3, 0.0])
    residual = (
        toy.drawn(np.random.default_rng(5), at * [1.0, 1.0, 1.5, 1.0, 0.0] + asked * np.eye(5)[4]) - toy.effects @ at
    )
    made = [Group((2 * k, 2 * k + 1), 1, at[2 * k : 2 * k + 2], 0, spread) for k in range(2)]
    made.append(Group((4,), 1, at[4:], 1, spread[:1], np.zeros(1), np.full(1, np.inf)))

    def missed(gone):
        """Squares that are left, with numbers, flaws and the discrepancy as what they are: columns with priors."""
        free = [c for c in range(5) if c // 2 not in gone]
        known = np.array([0.0, 1.0 / 0.6, 0.0, 1.0 / 0.6, 0.0])[free]
        y = residual + toy.effects @ np.where([c // 2 in gone and c % 2 == 0 for c in range(5)], at, 0.0)
        y = y - AWAY[0] * toy.numbers[:, 0]
        a = np.concatenate([toy.effects[:, free], toy.root, toy.numbers[:, 1:]], axis=1)
        prior = np.diag(np.concatenate([known, np.ones(toy.root.shape[1]), np.zeros(1)]))
        far = np.concatenate([-known * at[free], np.zeros(toy.root.shape[1] + 1)])
        low = np.full(a.shape[1], -np.inf)
        low[free.index(4)] = 0.0
        whole, sought = np.concatenate([a, prior]), np.concatenate([y, far])
        return 2.0 * lsq_linear(whole, sought, (low, np.inf), method="bvls").cost

    s = toy.summed(residual)
    assert s.lost(made, lacking) == pytest.approx(missed(lacking) - missed(()), rel=1e-9)


@pytest.mark.parametrize("own", [0, 1], ids=["about none", "about one"])
def test_problems_are_judged_together_as_one_by_one(own):
    toy, rng = Toy([1.0, 2.0, 0.5]), np.random.default_rng(8)
    each = [toy.summed(toy.drawn(rng, [3.0, 0.0, 1.0])) for _ in range(3)]
    made = groups([0, 1, 0], at=[0.4, 0.0, 0.0])
    for sets in ([()], [(0,), (1,), (2,)], [(0, 1), (1, 2)]):
        laid = Sets.of(sets, made, own, 3)
        log, values = Summed.join(each).of(laid)
        for n, one in enumerate(each):
            assert log[n] == pytest.approx(one.of(laid)[0], rel=1e-12)
            assert values[n] == pytest.approx(one.of(laid)[1], rel=1e-9)


def test_larger_flaws_excuse_more():
    """An effect of d' 12 is nothing beside flaws of as much, and is told beside those of 2."""
    toy = Toy([1.0, 5.0])
    residual = toy.drawn(np.random.default_rng(6), np.array([12.0, 0.0]) / toy.norms)
    line = Linearisation([Rows(COUNT)], [residual], [toy.numbers], [np.zeros((COUNT, 0))], [None])
    p = problem(line, np.arange(2), PRECISION, AWAY, [toy.effects], [toy.smooth])
    sets = [Sets.of([k], groups([0, 0]), 0, 2) for k in [(), (0,)]]
    odds = [np.diff([summed(p, SMOOTH, f).of(s, HYPER)[0][0] for s in sets])[0] for f in (2.0, 8.0, 32.0)]
    assert odds[0] > odds[1] > odds[2] and odds[0] > 10.0 and odds[2] < 2.0


def test_no_flaw_takes_an_effect_beyond_its_bound():
    """A loss cannot be negative: where data ask for that, a fit that holds it at zero is no better than one without."""
    toy = Toy([1.0, 5.0])
    residual = toy.drawn(np.random.default_rng(6), np.array([-30.0, 0.0]) / toy.norms)
    line = Linearisation([Rows(COUNT)], [residual], [toy.numbers], [np.zeros((COUNT, 0))], [None])
    p = problem(line, np.arange(2), PRECISION, AWAY, [toy.effects], [toy.smooth])
    loss = Group((0,), 1, np.zeros(1), 1, np.full(1, np.inf), low=np.zeros(1), high=np.full(1, 1e3))
    held = without_flaws([loss, replace(loss, columns=(1,), at=np.ones(1))])
    assert held == [0]
    none, with_loss = (Sets.of([k], [loss], 0, 2) for k in [(), (0,)])
    free, bound = summed(p, SMOOTH, 16.0), summed(p, SMOOTH, 16.0, held)
    assert free.of(none)[0][0] > bound.of(none)[0][0] + 100.0
    assert bound.of(with_loss)[0][0] < bound.of(none)[0][0]


def test_stated_probabilities_are_frequencies():
    """Effects drawn from the prior: among sets that are given a probability, as many are the truth."""
    toy, rng = Toy([1.0, 30.0, 0.1, 2.0, 5.0]), np.random.default_rng(5)
    sides = [0, 0, 1, 0, -1]
    sets = [k for n in range(3) for k in combinations(range(5), n)]
    prior = np.array([HYPER.effects ** len(k) * (1.0, 1 / 5, 2 / 25)[len(k)] for k in sets])
    prior /= prior.sum()
    stated, true = [], []
    for _ in range(800):
        truth = rng.choice(len(sets), p=prior)
        a = np.zeros(5)
        for c in sets[truth]:
            d = rng.choice(HYPER.slabs, p=HYPER.shares) * rng.normal()
            a[c] = (sides[c] * abs(d) if sides[c] else d) / toy.norms[c]
        log = np.concatenate([[0.0], gained(toy, toy.drawn(rng, a), sets[1:], groups(sides))]) + np.log(prior)
        stated.append(np.exp(log - logsumexp(log)))
        true.append(np.arange(len(sets)) == truth)
    stated, true = np.ravel(stated), np.ravel(true)
    edges = [0.0, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0]
    for low, high in pairwise(edges):
        mine = (stated >= low) & (stated < high + (high == 1.0))
        count, expected = mine.sum(), stated[mine].sum()
        error = np.sqrt(np.sum(stated[mine] * (1 - stated[mine])))
        assert count > 30
        assert abs(true[mine].sum() - expected) < 3.0 * error + 0.02 * expected, low
    assert np.mean(stated[true]) > 0.5, "most are told"

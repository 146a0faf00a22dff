"""The sheet that is folded: stiff bars, soft hinges with target angles, and the search for its least energy.

The energy is a sum of squares, of the strains of the mesh edges (bars) and of the departures of the fold angles from
their targets (hinges), so that Levenberg and Marquardt's method finds its minima (Marquardt 1963,
doi:10.1137/0111030); where the targets can be met without strain it converges quadratically. Model: bars and hinges
after Schenk and Guest (2011) and Filipov, Liu, Tachi, Schenk and Paulino (2017); target angles as in Origami Simulator
(Ghassaei, Demaine and Gershenfeld 2018), which follows the same energy down in time.

What half and double of the numbers below do was measured by benchmarks/pattern_constants.py on the 20 public patterns
of the scoreboard that take less than 1.7 s, of which 18 fold, and where 30 are named on 10 slower ones as well.

Lengths are in units of the sheet's longest side, energies in those of its membrane stiffness E t.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from origami_sim.pattern import Pattern, Triangulation, hinge_angles, triangulate
from origami_sim.pattern.planar import FINEST
from origami_sim.physics.materials import MEMBRANE_POISSON

from .panels import Panels

if TYPE_CHECKING:
    from .contact import Contact, Touching

BEND = 0.1
"""Stiffness of the lines that triangulate a panel over that of a driven crease of that length: panels give way, so that
what is not rigidly foldable can fold. With half and double the same of 30 fold; the compromises of those that cannot
shift, and so does the strain of whirlpool, popup and FTpoly7."""
FREE = 1e-3
"""The same for creases without a target, which only have to be somewhere. With half and double the same of 30 fold, and
half brings a curved pattern, 6.2 degrees off, within 5."""
SLIVER = 0.05
"""Least width of a bar over its length. A sliver's bars would be limp, and it would turn inside out. Half
changes nothing in 30 patterns, double the compromise of two."""
LONGEST_MOVE = 0.1
"""Longest move of a node in one iteration: a triangle of a coarse pattern is not turned over in one go. Half changes
nothing in 30 patterns, in the same time; double, and doing without in 32, the compromises of two that cannot fold."""
MERGED = 2.5e-3
"""Change of a bar's length that counts as inaccuracy of a file that does not show its own, as `planar.COARSEST` does:
hand-drawn lines miss each other by as much. It only decides what counts as torn; half and double change no verdict of
20."""
SHARE, LEAST = 0.1, np.radians(0.1)
"""Share of a target angle within which a crease has arrived at it, where that is less than the tolerance, and the angle
below which that share does not fall, since panels that bend leave so much. Half and double of both change no verdict of
43 public patterns; half of the share counts 1 to 11 % more creases in three of those that miss."""
CLOSED = 0.1
"""Distance from half a turn [rad] within which a given shape is folded flat, to the side of its target. Half and
double change nothing in 20."""
ROUNDING = 1e-18
"""Energy below which a state is exact: angles to some 1e-8 rad. Half and double change nothing; without it small
patterns take 1.3 times as long."""
GAIN = 1e-4
"""Relative fall of the energy in one iteration below which it is done. Half takes 1.07 times as long, double 0.95
times; the same of 20 fold."""
STIFFEST, LARGEST = 1e-9, 1e3
"""Range of the damping of iterations: below, rigid motions are no longer held; above, nothing moves any more.
Half and double of either change nothing: both are decades away from where iterations end."""
FIRST = 1e-6
"""Damping of the first iteration. Half and double change nothing in 20: it is adapted at once."""
REFUSED, POOR, GOOD = 5.0, 3.0, 0.25
"""Factors of the damping after a step that loses, one that gains less than `FORESEEN`, and one that gains more. They
are milder than Marquardt's own, 10 and 0.1; half and double of each change the time by at most 7 %, and the same of 20
fold."""
FORESEEN = (0.2, 0.7)
"""Gains of a step, over what the linear residuals promise, that count as poor and as good. Half takes 1.06 times as
long; double calls no step good, takes 1.17 times as long, and the compromises of two that cannot fold differ."""

FORESIGHT = 4
"""Solutions of one step at most, in search of the pairs that touch at its end. Of four public patterns that would end
through themselves half takes 1.25 times the time, double 1.1 times; the compromise of one shifts with half."""


@dataclass
class Shape:
    """A state of the sheet.

    Attributes:
        x: [N, 3] positions. angles: [H] continuous hinge angles [rad], creases first. energy: of the sheet there.
    """

    x: np.ndarray
    angles: np.ndarray
    energy: float = np.inf


class Elastic:
    """Bars and hinges of a triangulated pattern.

    Args:
        pattern: with fold angles for the creases that are to be driven; mountains and valleys without one fold flat.
        softness: stiffness of a crease per length over E t and over the median length of the mesh edges.

    Attributes:
        mesh: the triangulation. size: longest side of the pattern [m].
        reference: [N, 3] positions as given. bars, lengths: node pairs [B, 2] and their lengths [B].
        spans: [B + P] these, then distances of the other corners of a panel from each other, along it.
        hinges: [H, 4] creases, then bends. driven: [H] whether there is a target. target, start: [H] angles [rad].
        weights: [H] stiffness of the hinges over softness. contact: of panels with each other, if they touch.
        accuracy: by which a point of the drawing may be off, over the size; of files that do not show theirs, that
            which a drawing has at best.
    """

    def __init__(self, pattern: Pattern, softness: float = 1e-3):
        self.pattern, self.mesh = pattern, triangulate(pattern)
        mesh = self.mesh
        self.size = float(np.ptp(mesh.vertices, axis=0).max())
        self.reference = (mesh.vertices - mesh.vertices.mean(axis=0)) / self.size
        self.bars, self.hinges = mesh.bars, np.vstack([mesh.creases, mesh.bends])
        self.lengths = _lengths(self.reference, self.bars)
        self.panels = Panels(mesh)
        self.spans = self._spans_at(self.reference)
        self.axes = _lengths(self.reference, self.hinges[:, 1:3])
        given = np.concatenate([_targets(pattern)[mesh.crease_edge], np.full(len(mesh.bends), np.nan)])
        self.driven, self.target = ~np.isnan(given), np.nan_to_num(given)
        self.start = hinge_angles(self.reference, self.hinges)
        flat = self.driven & (np.abs(self.start) > np.pi - CLOSED)  # folded flat, to the side of the target
        self.start[flat] = near(self.start[flat], self.target[flat])
        middle = float(np.median(self.lengths))
        factor = np.where(self.driven, 1.0, BEND)
        factor[: len(mesh.creases)][~self.driven[: len(mesh.creases)]] = FREE
        self.weights = factor * middle * self.axes * self._stated()
        self.sections = np.maximum(bar_sections(self.reference, mesh), SLIVER * self.lengths)
        self.inaccuracy = MERGED if np.isnan(pattern.accuracy) else pattern.accuracy / self.size
        diagonal = float(np.linalg.norm(np.ptp(self.reference, axis=0)))
        self.accuracy = FINEST * diagonal if np.isnan(pattern.accuracy) else pattern.accuracy / self.size
        self.softness = softness
        self.contact: Contact | None = None
        self._pattern_of_jacobian()

    def _stated(self) -> np.ndarray:
        """Stiffness per length that the file states for a crease, over the median of those; 1 where it states none."""
        stiffness = np.concatenate(
            [self.pattern.stiffness[self.mesh.crease_edge], np.full(len(self.mesh.bends), np.nan)]
        )
        per_length = stiffness / self.axes
        known = np.isfinite(per_length) & (per_length > 0)
        if not known.any():
            return np.ones(len(per_length))
        return np.where(known, per_length / np.median(per_length[known]), 1.0)

    def _pattern_of_jacobian(self):
        """Rows and columns of the Jacobian: bars, hinges, and hinges again for what is beyond half a turn."""
        bars, hinges = len(self.bars), len(self.hinges)
        of_bars = (3 * self.bars[:, :, None] + np.arange(3)).ravel()
        of_hinges = (3 * self.hinges[:, :, None] + np.arange(3)).ravel()
        self._columns = np.concatenate([of_bars, of_hinges, of_hinges])
        rows = (np.arange(bars), bars + np.arange(hinges), bars + hinges + np.arange(hinges))
        self._rows = np.concatenate([np.repeat(r, n) for r, n in zip(rows, (6, 12, 12), strict=True)])
        self._shape = (bars + 2 * hinges, 3 * len(self.reference))

    def angles(self, x, previous) -> np.ndarray:
        """Return the hinge angles [H] of positions [N, 3], continuous from `previous` [rad]."""
        return near(hinge_angles(x, self.hinges), previous)

    def strains(self, x) -> np.ndarray:
        """Return the strain of every bar, then of every other pair of corners of a panel [B + P]."""
        return self._spans_at(x) / self.spans - 1.0

    def misfits(self, x) -> np.ndarray:
        """Return what of the strains [B + P] is more than the inaccuracy of the drawing."""
        change = np.abs(self._spans_at(x) - self.spans)
        return np.maximum(change - self.inaccuracy, 0.0) / self.spans

    def _spans_at(self, x) -> np.ndarray:
        return np.concatenate([_lengths(x, self.bars), self.panels.distances(x)])

    def errors(self, angles) -> np.ndarray:
        """Return the distance of each driven crease from its target [rad]."""
        return np.abs(angles - self.target)[self.driven]

    def allowed(self, tolerance: float) -> np.ndarray:
        """Return the distance from its target within which each driven crease has arrived [rad].

        Args:
            tolerance: of creases that stay flat, and at most of all others [rad].
        """
        target = np.abs(self.target[self.driven])
        return np.where(target > 0.0, np.minimum(np.maximum(SHARE * target, LEAST), tolerance), tolerance)

    def arrived(self, angles, tolerance: float) -> bool:
        """Tell whether all driven creases are within what is `allowed` of their targets."""
        return bool(np.all(self.errors(angles) <= self.allowed(tolerance)))

    def residuals(self, x, previous, target) -> tuple[np.ndarray, np.ndarray]:
        """Return residuals, of which half the squares sum to the energy, and angles continuous from `previous`."""
        angles = self.angles(x, previous)
        hinge = np.sqrt(self.softness * self.weights)
        beyond = np.sign(angles) * np.maximum(np.abs(angles) - np.pi, 0.0)
        stretch = np.sqrt(self.sections / self.lengths) * (_lengths(x, self.bars) - self.lengths)
        stop = np.sqrt(self.softness * np.median(self.lengths) * self.axes)
        return np.concatenate([stretch, hinge * (angles - target), stop * beyond]), angles

    def jacobian(self, x, angles) -> sp.csr_matrix:
        """Return the derivatives of the residuals by the positions."""
        along = x[self.bars[:, 1]] - x[self.bars[:, 0]]
        scale = np.sqrt(self.sections / self.lengths) / np.linalg.norm(along, axis=1)
        pull = scale[:, None] * along
        turn = angle_gradients(x, self.hinges)
        hinge = np.sqrt(self.softness * self.weights)[:, None, None] * turn
        stop = np.sqrt(self.softness * np.median(self.lengths) * self.axes)
        stop = np.where(np.abs(angles) > np.pi, stop, 0.0)[:, None, None] * turn
        values = np.concatenate([np.concatenate([-pull, pull], axis=1).ravel(), hinge.ravel(), stop.ravel()])
        return sp.csr_matrix((values, (self._rows, self._columns)), shape=self._shape)

    def relax(self, shape: Shape, target, iterations: int) -> Shape:
        """Return the state of least energy near `shape`, or where `iterations` have led.

        Args:
            shape: where to start. target: [H] angles to which the hinges are drawn [rad].
            damping: stiffness that holds every node in place during an iteration, to begin with.
        """
        x, near = shape.x, None
        r, angles = self.residuals(x, shape.angles, target)
        energy, damping = float(r @ r), FIRST  # damping is a stiffness that holds every node where it is
        longest = LONGEST_MOVE
        if self.contact is not None:
            near, longest = self.contact.at(x), min(longest, self.contact.longest)
            energy += near.energy
        for _ in range(iterations):
            if energy < ROUNDING:
                break
            jacobian = self.jacobian(x, angles)
            tangent, slope = (jacobian.T @ jacobian).tocsc(), jacobian.T @ r
            way = 1.0
            while damping < LARGEST:
                step = _solve(tangent, damping, -slope) if near is None else _apart(near, tangent, damping, slope)
                step *= min(1.0, longest / max(float(np.abs(step).max()), 1e-300))
                if near is not None:
                    way = near.clear(x + step.reshape(-1, 3))
                    step *= way
                to = x + step.reshape(-1, 3)
                tried, turned = self.residuals(to, angles, target)
                after = None if self.contact is None else self.contact.at(to)
                gained = energy - float(tried @ tried) - (after.energy if after else 0.0)
                if gained > 0.0:
                    break
                damping *= REFUSED
            else:
                break  # nothing goes down any more
            foreseen = energy - float(np.sum((r + jacobian @ step) ** 2)) - (near.after(step) if near else 0.0)
            x, near, r, angles, energy = to, after, tried, turned, energy - gained
            if gained > FORESEEN[1] * foreseen:
                damping = max(GOOD * damping, STIFFEST)
            elif gained < FORESEEN[0] * foreseen:
                damping *= POOR
            if gained < GAIN * energy and way == 1.0:  # what was cut may go on once it touches
                break
        return Shape(x, angles, 0.5 * max(energy, 0.0))


def _apart(near: "Touching", tangent, damping, slope) -> np.ndarray:
    """Return the step that keeps apart what touches, and what would touch at its end, as far as derivatives tell."""
    touching, step = near.gap < 0.0, np.zeros_like(slope)
    for _ in range(FORESIGHT):
        rows = near.rows[touching]
        weighted = sp.diags_array(near.weight[touching]) @ rows
        step = _solve(tangent + rows.T @ weighted, damping, -slope - weighted.T @ near.gap[touching])
        then = near.gap + near.rows @ step < 0.0
        if np.array_equal(then, touching):
            break
        touching = then
    return step


def _targets(pattern: Pattern) -> np.ndarray:
    """Return the fold angles [E] [rad], half a turn for mountains and valleys that give none."""
    flat = {"M": -np.pi, "V": np.pi}
    default = np.array([flat.get(letter, np.nan) for letter in pattern.assignments])
    return np.where(np.isnan(pattern.fold_angles), default, pattern.fold_angles)


def near(angles, previous) -> np.ndarray:
    """Return `angles` moved by whole turns to within half a turn of `previous` [rad]."""
    return previous + (angles - previous + np.pi) % (2.0 * np.pi) - np.pi


def _solve(tangent, damping, force) -> np.ndarray:
    """Return the step of (tangent + damping) step = force; no step where it cannot be solved."""
    try:
        factors = spla.splu(
            (tangent + damping * sp.eye_array(len(force))).tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError:  # exactly singular
        return np.zeros_like(force)
    step = factors.solve(force)
    return step if np.all(np.isfinite(step)) else np.zeros_like(force)


def angle_gradients(x, hinges) -> np.ndarray:
    """Return the derivatives [H, 4, 3] of the hinge angles by the nodes i, j, k, l (see `pattern.triangulate`)."""
    i, j, k, m = (x[hinges[:, n]] for n in range(4))
    e, a, b = k - j, i - j, m - j
    length = np.linalg.norm(e, axis=1)
    n1, n2 = np.cross(a, e), np.cross(e, b)
    least = 1e-24  # a triangle without area has no normal, and its hinge no moment
    gi = (length / np.maximum(np.sum(n1 * n1, axis=1), least))[:, None] * n1
    gl = (length / np.maximum(np.sum(n2 * n2, axis=1), least))[:, None] * n2
    s = (np.sum(a * e, axis=1) / length**2)[:, None]
    t = (np.sum(b * e, axis=1) / length**2)[:, None]
    return np.stack([gi, -(1 - s) * gi - (1 - t) * gl, -s * gi - t * gl, gl], axis=1)


def bar_sections(x, mesh: Triangulation) -> np.ndarray:
    """Return the width [B] of sheet that each bar stands for, as in `build.Sheet`: 2 A / ((1 - nu) perimeter)."""
    a, b, c = (x[mesh.triangles[:, n]] for n in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    perimeter = sum(np.linalg.norm(p - q, axis=1) for p, q in ((a, b), (b, c), (c, a)))
    share = 2.0 * area / ((1.0 - MEMBRANE_POISSON) * perimeter)
    sides = np.sort(np.concatenate([mesh.triangles[:, [0, 1]], mesh.triangles[:, [1, 2]], mesh.triangles[:, [2, 0]]]))
    count = int(mesh.bars.max()) + 1
    index = np.searchsorted(mesh.bars[:, 0] * count + mesh.bars[:, 1], sides[:, 0] * count + sides[:, 1])
    return np.bincount(index, weights=np.tile(share, 3), minlength=len(mesh.bars))


def _lengths(x, pairs) -> np.ndarray:
    return np.linalg.norm(x[pairs[:, 1]] - x[pairs[:, 0]], axis=1)

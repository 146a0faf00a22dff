"""Equilibria of many worlds at the end of a step of given length, within which laws with memory advance.

Nodes are led from where a step begins to where it may end, evenly, by the time loop that `simulate` runs; so every law
advances its memory as its own file says, exactly where angles change evenly. The forces are those of the end, with the
memory of the end, and at rest: laws of the rate are silent. The tangent sees the same, so that Newton's method knows
how stiff a crease is that has no time to relax.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from origami_sim.drive import Drive
from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, State
from origami_sim.solve import grips
from origami_sim.solve.rigid.statics import STEP as TURN
from origami_sim.solve.rigid.statics import closed, led, loops_kept
from origami_sim.solve.rigid.topology import Topology
from origami_sim.solve.skin import clear_share
from origami_sim.solve.statics.equilibria import equilibrium
from origami_sim.solve.statics.held import Held
from origami_sim.solve.statics.system import FINER, THREADED, System
from origami_sim.solve.statics.tangents import Tangent, of_bars, of_panels, of_slipping_panels

CLOSE = 1e-10
"""Error over the size of the device up to which a place is an equilibrium."""

FAR = 0.1
"""Longest Newton step, as a part of the device, or of a radian times two."""

ROUNDS = 12
ITERATIONS = 12
"""Tangents of a step, and Broyden's iterations with each."""

PATIENT = 60
"""Tangents of a world that has lost its equilibrium: so many cover the device from end to end several times."""

EASIER = 4.0
"""Factor by which the drag of `Settling._crept` falls after a step, and grows where a step missed.

With 2 and 8 a crawler goes as far to 1e-5 of its stride; 8 takes up to twice as long.
"""

FRESH, KEPT = 0.5, 0.1
"""Part of the iteration before that each has to be at most, else a tangent is taken anew: one of this step, or of an
earlier one. Where a tangent of an earlier step contracts tenfold, the present one is as stable as that was."""


class Settling(ABC):
    """Equilibria of all worlds, step after step.

    Args:
        model: for the couplings. worlds: model and parameters of each world, alike but for geometry and numbers.
        drive: one level of every channel for each world. state: one world each, for their number and memory.
        among: effects of the program, see `Batch`.
        viscous: whether laws of the rate act, with the velocity at the end of a step.
        keeping: whether a step begins with the tangents of the one before, which is many times faster.
        gripped: whether grips will move that stand in the drive given.

    Attributes:
        torn: [W] worlds whose grips had gone, in the last step, where no shape of their rigid panels reaches.
    """

    far, iterations, close = FAR, ITERATIONS, CLOSE

    def __init__(
        self,
        worlds: Sequence[tuple[Model, Parameters]],
        drive: Drive,
        state: State,
        *,
        among: Sequence[str] = (),
        threads: int | None = None,
        viscous: bool = False,
        keeping: bool = False,
        gripped: bool = False,
    ):
        self.worlds, self.among, self.threads, self.viscous = worlds, among, threads, viscous
        self.keeping, self._kept = keeping, [None] * len(worlds)
        self.past: tuple[State, float] | None = None
        self.moving = False
        self.model = worlds[0][0]
        self.drive, self.start, self.dt, self.time = drive, state, 1.0, 0.0
        self.levels = levels(drive, 0.0, state.worlds)
        parameters = Parameters.join([p for _, p in worlds])
        every = 1 if state.worlds < 64 else threads
        self.held = Held(self.model, parameters, per_world(drive, self.levels), state, among=among, threads=every)
        self.slips = bool(np.any(self.held.friction))
        self.gripped = grips.moving(self.model, drive) or gripped
        self.torn = np.zeros(len(worlds), bool)
        self.reference = np.stack([m.position for m, _ in worlds], axis=1)
        self._copied: dict[int, Held] = {}

    @property
    def tangent(self):
        """Factors of a tangent with which the first world begins its next step; None without any."""
        return self._kept[0]

    def begin_with(self, tangent) -> None:
        """Lets all worlds begin their next step with a tangent of another search."""
        self._kept = [tangent] * len(self._kept)

    def settle(
        self,
        level: np.ndarray,
        start: State,
        guess: np.ndarray,
        wanted: np.ndarray,
        *,
        dt: float,
        time: float,
        search: bool = True,
        gradual: bool = True,
        past: tuple[State, float] | None = None,
    ) -> tuple[State, np.ndarray]:
        """The state at the equilibria at the end of a step, and which of the worlds wanted have one [W].

        Args:
            level: [channels, W] of the drive at the end. start: where the step begins. guess: [N, W, 3] positions.
            dt: length of the step [s]. time: its end [s].
            search: also look far away for worlds whose equilibrium ceased to exist.
            gradual: whether the device moves for as long as the step lasts; else laws of the rate are silent.
            past: where the step before this one began, and its length [s], if the motion goes on from there.
        """
        self.start, self.dt, self.time, self.levels = start, dt, time, level
        self.moving, self.past = self.viscous and gradual, past
        self.held.batch.hold(level)
        begin, every = start.x, wanted
        if self.gripped:
            ends = grips.levels_among(self.model, self.drive, level)
            (guess, reached), (begin, again) = self._led(guess, ends), self._led(begin, ends)
            wanted, self.torn = wanted & reached & again, ~(reached & again)
        x, done = self._newton(guess, wanted & (gradual or not self.slips), ROUNDS)
        lost = wanted & ~done
        if np.any(lost) and self.slips:
            x, again = self._crept(np.where(lost[None, :, None], begin, x), lost)
            done |= again
            lost &= ~again
        if np.any(lost) and search:
            x, again = self._newton(np.where(lost[None, :, None], begin, x), lost, PATIENT)
            done |= again
            lost &= ~again
        wanted, lost = every, lost | (every & ~wanted)
        if np.any(lost) and search:
            x, found = self._searched(x, lost)
            if self.held.remembers and np.any(found):  # found with the memory of the step's beginning
                x, found = self._newton(x, found, ROUNDS)
            done |= found
        done &= wanted
        out = self.held.after(start, np.where(done[None, :, None], x, start.x), dt, time, self.moving)
        out.v[:], out.a[:] = 0.0, 0.0
        out.step, out.status = -1, np.full_like(out.status, -1)
        return out, done

    def _led(self, x: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions [N, W, 3] after grips have gone to levels [G, W], and the worlds in which panels can follow [W]."""
        at = grips.nearest_levels(self.model, x, self.reference)
        return grips.carried_along(self.model, x, at, ends, self.reference), np.ones(x.shape[1], bool)

    def _newton(self, x: np.ndarray, wanted: np.ndarray, rounds: int) -> tuple[np.ndarray, np.ndarray]:
        """Positions after so many rounds, each with a tangent of its own, and which worlds came to rest."""
        done = np.zeros(len(wanted), bool)
        if any(f is not None for f in self._kept):
            known = np.array([f is not None for f in self._kept])
            x, done = self._with(self._kept, x, wanted & known, KEPT)
        for n in range(rounds):
            left = wanted & ~done
            if not np.any(left):
                break
            if self.keeping and n < ROUNDS // 2:
                factors, stable = self._shared(x, left)
            else:
                factors, stable = self._factors(x, left)
            going = np.array([f is not None for f in factors])
            if self.slips:  # a full step along what slides freely would go anywhere
                going &= stable
                wanted = wanted & (stable | ~left)
            if not np.any(going):
                break
            if self.keeping:
                sound = going & stable
                self._kept = [new if s else k for new, k, s in zip(factors, self._kept, sound, strict=True)]
            x, close = self._with(factors, x, going, FRESH)
            done |= close & stable
        return x, done

    def _crept(self, x: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions to which the nodes creep through a viscous medium, and which worlds came to rest.

        A foot that slips has no stiffness against its slip, and gets it at once where it turns back, so that Newton's
        steps go to and fro, or anywhere if all feet slip. Here they are backward Euler's steps of the creep, of lengths
        that follow what their linear models miss (pseudo-transient continuation: Kelley & Keyes 1998; where forces have
        kinks, Fowler & Kelley 2005). They end in balance without the medium, at rest as near as its drag leads.
        """
        x, done = x.copy(), np.zeros(len(wanted), bool)
        drag = np.full(len(wanted), np.inf)
        for _ in range(PATIENT):
            tangents = self._tangents(x, wanted & ~done)
            left = np.array([t is not None for t in tangents])
            if not np.any(left):
                break
            least = np.array([t.least if t else 0.0 for t in tangents])
            drag = np.maximum(np.minimum(drag / EASIER, [t.largest if t else 0.0 for t in tangents]), least)
            f = self._unbalanced(x)
            free = [t.factor(t.least) if t else None for t in tangents]
            held = [t.factor(d) if t else None for t, d in zip(tangents, drag, strict=True)]
            ahead, s = (np.abs(self._by(each, f, left)).max(axis=0, initial=0.0) for each in (free, held))
            # once the drag hardly counts, Newton's method ends what it began
            stable = np.array([t is not None and t.stable for t in tangents])
            new, close = self._with(free, x, left & stable & (FRESH * ahead <= s), FRESH)
            x = np.where(close[None, :, None], new, x)
            done |= close
            left &= ~close
            while np.any(left):
                held = [t.factor(d) if t and go else None for t, d, go in zip(tangents, drag, left, strict=True)]
                s = self._by(held, f, left)
                share = self._share(x, s, left)
                moved = self._moved(x, np.where(left, s * share, 0.0))
                drags = np.stack([t.dragged(s[:, w]) if t else s[:, w] for w, t in enumerate(tangents)], axis=1)
                missed = self._by(held, self._unbalanced(moved) - f + share * (f - drag * drags), left)
                good = left & (np.abs(missed).max(axis=0) <= FRESH * share * np.abs(s).max(axis=0))
                x = np.where(good[None, :, None], moved, x)
                left &= ~good & (drag < 1e3 * np.array([t.largest if t else 0.0 for t in tangents]))
                drag = np.where(left, EASIER * drag, drag)
        return x, done

    def _shared(self, x: np.ndarray, wanted: np.ndarray) -> tuple[list, np.ndarray]:
        """Factors as of `_factors`, of the first of these worlds, which serve those that lie close to it as well.

        Worlds of derivatives differ by little: equilibria are found two to eight times as fast as with their own.
        """
        first = int(np.argmax(wanted))
        close = wanted & (np.abs(x - x[:, [first]]).max(axis=(0, 2)) < self.far * self.size)
        factors, stable = self._factors(x, np.arange(len(wanted)) == first)
        return [factors[first] if c else None for c in close], close & stable[first]

    def _with(self, factors, x: np.ndarray, going: np.ndarray, part: float) -> tuple[np.ndarray, np.ndarray]:
        """Positions that tangents lead to as long as each iteration is that part of the one before; which are close."""
        going, done = going.copy(), np.zeros(len(going), bool)
        if not np.any(going):
            return x, done
        s = self._solved(factors, x, going)
        past, before, worst = [s], np.full(len(going), np.inf), np.zeros(len(going))
        for n in range(self.iterations):
            large = np.abs(s).max(axis=0, initial=0.0)
            going &= large < part * before  # else a new tangent serves better; false for nan
            share = self._share(x, s, going)
            far = going & (share < 1.0)
            if np.any(far):  # no further than this without a new tangent
                x = self._moved(x, np.where(far, s * share, 0.0))
                going &= ~far
            x = self._moved(x, np.where(going, s, 0.0))
            if n:
                worst = np.maximum(worst, _over(large, before))
            # the next iteration would be smaller again; not always by the same ratio, as bars relax what turns stretch
            close = going & (large * np.sqrt(worst if n else 1.0) < self.close * self.size)
            before = large
            done |= close
            going &= ~close
            if not np.any(going):
                break
            z = self._solved(factors, x, going)
            with np.errstate(all="ignore"):  # of worlds that go no further
                for a, b in pairwise(past):  # Broyden's first method (Kelley 1995, ch. 7)
                    z = z + b * _over(np.sum(a * z, axis=0), np.sum(a * a, axis=0))
                last = past[-1]
                s = z / (1.0 - _over(np.sum(last * z, axis=0), np.sum(last * last, axis=0)))
            past.append(s)
        return x, done

    def _searched(self, x: np.ndarray, lost: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Equilibria of these worlds by a search of their own, from where the last step left them; which have one."""
        x, found = x.copy(), np.zeros_like(lost)
        model = self.model.with_effects(without=tuple(e for e in self.model.effects if e not in self.model.laws))
        for w in np.flatnonzero(lost):
            drive = self.drive.replace(**dict(zip(self.drive.signals, self.levels[:, w].tolist(), strict=True)))
            state = self.start.select(np.array([w]))
            one = equilibrium(
                model, self.worlds[int(w)][1].for_model(model), drive, state=state, time=self.time, contact=False
            )
            if one.converged:
                x[:, w], found[w] = one.x, True
        return x, found

    def _force(self, x: np.ndarray) -> np.ndarray:
        """Forces [N, W, 3] at positions [N, W, 3] at the end of the step."""
        return self.held.force(self.start, x, self.dt, self.time, self._velocity(x))

    def _velocity(self, x: np.ndarray, of: np.ndarray | None = None) -> np.ndarray | None:
        """Velocities at the end of the step at positions [N, K, 3] of worlds `of` (K,); None: at rest.

        Backward differences of second order, where the step before is known (Curtiss & Hirschfelder 1952).
        """
        if not self.moving:
            return None
        worlds = slice(None) if of is None else of
        begin = self.start.x[:, worlds]
        rate = (x - begin) / self.dt
        if self.past is None:
            return rate
        before, dt = self.past
        return rate + (rate - (begin - before.x[:, worlds]) / dt) * (self.dt / (self.dt + dt))

    def ahead(self, before: State, now: State, ratio: float) -> np.ndarray:
        """Positions [N, W, 3] to which worlds go on as they went between two states, `ratio` times as far."""
        return now.x + ratio * (now.x - before.x)

    def _solved(self, factors, x: np.ndarray, going: np.ndarray) -> np.ndarray:
        return self._by(factors, self._unbalanced(x), going)

    def _by(self, factors, f: np.ndarray, going: np.ndarray) -> np.ndarray:
        """What the tangents of these worlds give for forces [m, W]."""
        out, of = np.zeros_like(f), dict[int, list[int]]()
        for w in np.flatnonzero(going).tolist():
            of.setdefault(id(factors[w]), []).append(w)
        for mine in of.values():
            out[:, mine] = self._each(factors[mine[0]], f[:, mine])
        return out

    def _each(self, factor, right: np.ndarray) -> np.ndarray:
        """What a tangent gives for forces [m, k] of several worlds."""
        return np.stack([factor.solve(one) for one in right.T], axis=1)

    def _copies(self, w: int, count: int) -> Held:
        """Copies of a world, from whose differences its tangent comes."""
        if w not in self._copied or self._copied[w].batch.worlds != count:
            threads = 1 if count * len(self.model.position) < THREADED else self.threads
            drive, state = per_world(self.drive, self.levels[:, [w]]), self.start.select(np.full(count, w))
            self._copied[w] = Held(self.model, self.worlds[w][1], drive, state, among=self.among, threads=threads)
        self._copied[w].batch.hold(self.levels[:, [w]])
        return self._copied[w]

    def _share(self, x: np.ndarray, s: np.ndarray, going: np.ndarray) -> np.ndarray:
        """[W] share of a change s [m, W] of the coordinates that goes no further than `far`, nor through panels."""
        large = np.abs(s).max(axis=0, initial=0.0)
        share = np.minimum(_over(np.full_like(large, self.far * self.size), large), 1.0)
        return self._clear(x, s * share, going) * np.where(large > 0, share, 1.0)

    def _clear(self, x: np.ndarray, s: np.ndarray, going: np.ndarray) -> np.ndarray:
        """[W] share of a change s [m, W] of the coordinates on which panels do not pass through each other."""
        share = np.ones(len(going))
        if "touch" in self.model.laws:
            moved = self._moved(x, np.where(going, s, 0.0))
            for w in np.flatnonzero(going & np.all(np.isfinite(s), axis=0)):
                share[w] = clear_share(self.model, self.worlds[int(w)][1], x[:, w], moved[:, w] - x[:, w])
        return share

    @property
    @abstractmethod
    def size(self) -> float:
        """What Newton's steps are compared with."""

    @abstractmethod
    def _unbalanced(self, x: np.ndarray) -> np.ndarray:
        """Generalised forces [m, W] at positions [N, W, 3]."""

    @abstractmethod
    def _moved(self, x: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Positions [N, W, 3] after a change s [m, W] of the coordinates."""

    def _factors(self, x: np.ndarray, wanted: np.ndarray) -> tuple[list, np.ndarray]:
        """Factors of each tangent, shifted where it is not stable, and whether Newton's steps may end there [W]."""
        found = self._tangents(x, wanted)
        # what slides without any resistance is to be led by a drag
        stable = np.array([t is not None and t.stable and not (self.slips and t.neutral) for t in found])
        return [None if t is None else t.factor(t.least) for t in found], stable

    @abstractmethod
    def _tangents(self, x: np.ndarray, wanted: np.ndarray) -> list[Tangent | None]:
        """Tangent of every world; None of one that is not finite."""


class SettlingBars(Settling):
    """Equilibria of bars: the coordinates are the free axes of the nodes."""

    def __init__(self, worlds, drive: Drive, state: State, *, system: System | None = None, **options):
        super().__init__(worlds, drive, state, **options)
        self.system = system or coupled(self.model, worlds[0][1], drive)
        self.free = self.system.free

    @property
    def size(self) -> float:
        return self.system.size

    def _unbalanced(self, x):
        return np.moveaxis(self._force(x), 1, 2).reshape(-1, x.shape[1])[self.free]

    def _moved(self, x, s):
        out = np.zeros((self.model.position.size, s.shape[1]))
        out[self.free] = s
        return x + np.moveaxis(out.reshape(-1, 3, s.shape[1]), 2, 1)

    def _tangents(self, x, wanted):
        y = self.system
        y.follow(x)
        count = y.moves.shape[1]
        out: list[Tangent | None] = [None] * x.shape[1]
        for w in np.flatnonzero(wanted):
            start = self.start.select(np.full(count, w))
            copies = self._copies(int(w), count)
            moved = x[:, w, None] + y.moves
            forces = copies.force(start, moved, self.dt, self.time, self._velocity(moved, np.full(count, w)))
            k = y.assembled(forces)
            if not np.all(np.isfinite(k.data)):
                continue
            out[w] = of_bars(y, k)
        return out


class SettlingPanels(Settling):
    """Equilibria of rigid panels: the coordinates are fold angles and the pose of the root, with loops kept closed.

    Raises:
        InputError: what `Topology` refuses, or nothing that is free to move.
    """

    far = 2 * FAR

    def __init__(self, worlds, drive: Drive, state: State, **options):
        super().__init__(worlds, drive, state, **options)
        self.tree = t = Topology(self.model, self.gripped)
        self.count = len(t.turns) + len(t.joints)
        if not self.count:
            raise InputError("statics needs a panel that is free to move", field="free", value=0)
        self.loops = bool(len(t.row_node))
        if self.loops:  # the directions in which loops stay closed turn with every step
            self.iterations, self.keeping = 1, False
        m = self.count
        self._turn = TURN * (FINER if self.slips else 1.0)
        self._near = self._turn * np.concatenate([np.zeros((m, 1)), np.eye(m), -np.eye(m)], axis=1)
        self._every: Held | None = None

    @property
    def size(self) -> float:
        return 1.0

    def _led(self, x, ends):
        out = [led(self.model, self.tree, x[:, w], ends[:, [w]], self.reference[:, [w]]) for w in range(x.shape[1])]
        reached = np.array([a is not None for a in out])
        return np.stack([x[:, w] if a is None else a for w, a in enumerate(out)], axis=1), reached

    def _unbalanced(self, x):
        return np.einsum("mnwa,nwa->mw", self.tree.rates(x), self._force(x))

    def _each(self, factor, right):
        return factor.solve(right)

    def _moved(self, x, s):
        if not self.loops:
            return self.tree.moved(x, s)
        out = x.copy()
        for w in np.flatnonzero(np.any(s != 0.0, axis=0)):
            q = closed(self.tree, x[:, w], s[:, w])
            if q is not None:
                out[:, w] = self.tree.moved(x[:, w], q[:, None])[:, 0]
        return out

    def ahead(self, before: State, now: State, ratio: float) -> np.ndarray:
        if self.slips:
            return self._moved(now.x, -ratio * self._between(now.x, before.x))
        if self.loops or len(self.tree.turns):
            return now.x
        turned = now.angles - before.angles
        return self.tree.moved(now.x, ratio * np.stack([turned[c] for c, _ in self.tree.joints]))

    def _between(self, x: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Change [m, W] of the coordinates that leads from positions [N, W, 3] to others."""
        q, by = np.zeros((self.count, x.shape[1])), self.tree.rates(x)
        for _ in range(3):  # a turn within a step is small: 0.1 rad, 1e-3, 1e-7
            off = other - self._moved(x, q)
            for w in range(x.shape[1]):
                q[:, w] += np.linalg.lstsq(by[:, :, w].reshape(len(by), -1).T, off[:, w].ravel(), rcond=None)[0]
        return q

    def _tangents(self, x, wanted):
        m, worlds = self.count, x.shape[1]
        copies = 2 * m + 1
        each = np.repeat(np.arange(worlds), copies)
        moved, by = self.tree.positions(x[:, each], np.tile(self._near, worlds))
        if self._every is None:
            parameters = Parameters.join([p for _, p in self.worlds], repeat=copies)
            threads = 1 if len(each) * len(x) < THREADED else self.threads
            drive, state = per_world(self.drive, self.levels[:, each]), self.start.select(each)
            self._every = Held(self.model, parameters, drive, state, among=self.among, threads=threads)
        self._every.batch.hold(self.levels[:, each])
        f = self._every.force(self.start.select(each), moved, self.dt, self.time, self._velocity(moved, each))
        moments = np.einsum("mnwa,nwa->mw", by, f).reshape(m, worlds, copies)
        out: list[Tangent | None] = [None] * worlds
        for w in np.flatnonzero(wanted & np.all(np.isfinite(moments), axis=(0, 2))):
            along, own = loops_kept(self.tree, x[:, w], self._near, moments[:, w])
            k = along.T @ ((own[:, m + 1 :] - own[:, 1 : m + 1]) / (2 * self._turn)) @ along
            if self.slips:
                rate = by[:, :, copies * w]
                out[w] = of_slipping_panels(k, along, np.einsum("mna,kna->mk", rate, rate))
            else:
                out[w] = of_panels(k, along)
        return out


def settling(worlds, drive: Drive, state: State, **options) -> Settling:
    """The search for whichever kind the model's panels ask for."""
    if worlds[0][0].panels == "rigid":
        options.pop("system", None)
        return SettlingPanels(worlds, drive, state, **options)
    return SettlingBars(worlds, drive, state, **options)


def coupled(model: Model, parameters: Parameters, drive: Drive) -> System:
    """Couplings and colours of a model, which depend on its effects only."""
    one = parameters.world(0) if parameters.worlds > 1 else parameters
    slips = any(get(e).family == "tangent" for e in model.laws)
    return System(model, one, per_world(drive, levels(drive, 0.0, 1)), State.at_rest(model), slips=slips)


def levels(drive: Drive, time: float, worlds: int) -> np.ndarray:
    """What a drive gives at a time in each world [channels, W]; of the first world where fewer are asked for."""
    values = [np.atleast_1d(s.offset if s.constant else np.squeeze(s(time))) for s in drive.signals.values()]
    return np.stack([np.broadcast_to(v if len(v) in (1, worlds) else v[:worlds], (worlds,)) for v in values])


def per_world(drive: Drive, level: np.ndarray) -> Drive:
    """The drive held at a level [channels, W] in each world."""
    return drive.replace(**dict(zip(drive.signals, np.array(level), strict=True)))


def _over(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a / b, 0 where b is 0; of changes that are almost 0, as of what has settled, it may be infinite."""
    with np.errstate(over="ignore"):
        return np.divide(a, b, out=np.zeros_like(a), where=b > 0)

"""Dynamics: leapfrog rollouts of a batch of worlds, with energies, work and failures by world."""

import math
import time as clock
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from origami_sim.drive import Drive
from origami_sim.effects import get
from origami_sim.errors import InputError, nearest
from origami_sim.model import Model, Parameters, State, node_mass
from origami_sim.model.contact import engaged
from origami_sim.model.distort import distorted
from origami_sim.quantities import converted
from origami_sim.solve import grips
from origami_sim.solve.batch import Evaluation
from origami_sim.solve.lumping import lumped_masses
from origami_sim.solve.motion.accuracy import check_accuracy, energy_error, refined, warning
from origami_sim.solve.motion.frames import check_frames, check_memory
from origami_sim.solve.motion.gripped import check_start, exerted, tears
from origami_sim.solve.motion.implicit import TOLERANCE, Implicit
from origami_sim.solve.oversights import (
    below_the_ground,
    beyond_breakdown,
    beyond_crease_tables,
    idle_drives,
    outside_tables,
    refuse_start_inside_the_ground,
    refuse_start_outside_tables,
    starts_flat,
)
from origami_sim.solve.rigid.batch import TOLERANCE as RIGID
from origami_sim.solve.rigid.batch import RigidBatch, batch_of
from origami_sim.solve.rigid.damping import overdamped
from origami_sim.solve.rigid.topology import Topology
from origami_sim.solve.skin import PRESSED, too_deep
from origami_sim.solve.timestep import TimeStep, stable_step
from origami_sim.solve.watch import Met, continued, watch_of, with_memory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PER_STEP = 0.01
"""Error of a step of rigid panels over the accuracy asked for, to begin with: runs of tens of steps add up to it.

Half of it costs 1.15 times the steps and double saves as much; halving the steps tells whether it was enough.
"""


LOOKED = 24
"""Frames, evenly spread, in which pairs that pass through each other are counted for a summary: a millisecond each for
300 triangles. Half may miss what is over within a twelfth of a run, double takes twice as long."""

STIFFER = (1.0, 4.0, 16.0)
"""Factors on the stiffness of contact that was not stated, tried while panels are pressed too deep into each other.

It is a penalty, so more of it only costs steps, half as long for four times. Smaller ratios take more runs.
"""


@dataclass(frozen=True)
class Failure:
    """A world that went unstable: which, when, where and why."""

    world: int
    time: float
    node: int
    cause: str

    def __str__(self):
        return f"world {self.world} went unstable at t = {self.time:.6g} s at node {self.node}: {self.cause}"


@dataclass(repr=False)
class Trajectory:
    """Frames of a run.

    Attributes:
        times: [F] times of the frames [s].
        x, v: [F, N, W, 3] positions [m] and velocities [m/s].
        angles: [F, C + Q, W] continuous hinge angles, creases first [rad].
        energies: [F, W] by effect [J], with "kinetic". work: [F, W] by effect since the start [J].
        gaps: [F, K, W] heights of the contact points [m].
        contact_forces: [F, N, W, 3] sum of the contact effects [N].
        failures: worlds that went unstable; their later frames repeat the last state.
        dt: step [s]. step: how it was chosen. state: final state, from which a run can be continued.
        wall: seconds that the solver took.
        energy_error: [W] largest error of the energy balance over the energy exchanged (`solve.accuracy`); nan where a
            world went unstable; None for motions without inertia.
        grip_wrenches: [F, G, W, 6] force [N] and moment [N m] of each grip on the device, see `grip_load`; None where
            none moves. Moments are about the middle of its nodes, or a point on the axis about which it turns; nan
            marks what rigid panels between several supports leave open. Their work is `work["grips"]`.
    """

    model: Model
    parameters: Parameters
    drive: Drive
    times: np.ndarray
    x: np.ndarray
    v: np.ndarray
    angles: np.ndarray
    energies: dict[str, np.ndarray]
    work: dict[str, np.ndarray]
    gaps: np.ndarray
    contact_forces: np.ndarray
    failures: list[Failure]
    dt: float
    step: TimeStep
    state: State
    wall: float = 0.0
    notes: list[str] = field(default_factory=list)
    energy_error: np.ndarray | None = None
    grip_wrenches: np.ndarray | None = None

    def __repr__(self) -> str:
        from origami_sim.view.summary import trajectory_line  # only who looks pays for it

        return trajectory_line(self)

    def _repr_html_(self) -> str:
        from origami_sim.view.summary import trajectory_html

        return trajectory_html(self)

    def plot(self, *, world: int = 0) -> "Figure":
        """Fold angles, displacement and drive over time, as a Matplotlib figure (`view.plot.plot_trajectory`)."""
        from origami_sim.view.plot import plot_trajectory

        return plot_trajectory(self, world=world)

    @property
    def creases(self) -> np.ndarray:
        """Fold angles of the creases [F, C, W] [rad], valley positive."""
        return self.angles[:, : len(self.model.creases)]

    def grip_path(self, name: str) -> np.ndarray:
        """How far a grip has moved from the reference state [F, W]: [m], or [rad] of one that turns."""
        return grips.levels_over(self.model, self.drive, self.times, self.x.shape[2])[:, self._grip(name)]

    def grip_load(self, name: str) -> np.ndarray:
        """What a grip exerts on the device along its path [F, W]: a force [N], or a moment about its axis [N m].

        Of a test machine that pulls a sheet it is positive.

        Raises:
            InputError: there is no such grip, or none that moves.
        """
        k = self._grip(name)
        if self.grip_wrenches is None:
            raise InputError("no grip moves in this motion", field="grip", value=name)
        return grips.on_path(self.model.grip_screws[k], self.grip_wrenches[:, k])

    def _grip(self, name: str) -> int:
        names = self.model.names.get("grip", ())
        if name not in names:
            allowed = ", ".join(names) or "Sheet.grip(name, ...)"
            raise InputError(f"there is no such grip{nearest(name, names)}", field="grip", value=name, allowed=allowed)
        return names.index(name)

    def centre_of_mass(self) -> np.ndarray:
        """[F, W, 3] [m]."""
        return self._by_mass(self.x)

    def centre_velocity(self) -> np.ndarray:
        """Velocity [F, W, 3] of the centre of mass [m/s]."""
        return self._by_mass(self.v)

    def _by_mass(self, of_nodes: np.ndarray) -> np.ndarray:
        m = node_mass(self.model, self.parameters)[None, :, :, None]
        return (m * of_nodes).sum(1) / m.sum(1)

    def crossings(self, frame: int = -1) -> np.ndarray:
        """[W] pairs of triangles that pass through each other in a frame; of worlds that went unstable, 0."""
        from origami_sim.pattern.intersections import crossing_pairs  # only who asks waits for its imports

        x = self.x[frame]
        sound = np.all(np.isfinite(x), axis=(0, 2))
        return np.array(
            [len(crossing_pairs(x[:, w], self.model.triangles, 0.0)) if sound[w] else 0 for w in range(x.shape[1])]
        )

    def most_crossings(self) -> tuple[int, float]:
        """Pairs of triangles that pass through each other, all worlds, in the worst of LOOKED frames; its time [s]."""
        frames = np.unique(np.linspace(0, len(self.times) - 1, LOOKED).astype(int))
        counts = [int(self.crossings(int(f)).sum()) for f in frames]
        worst = int(np.argmax(counts))
        return counts[worst], float(self.times[frames[worst]])

    def energy_balance(self) -> np.ndarray:
        """Energy less the work that was fed in, [F, W] [J]; constant up to the integrator's error."""
        total = self.energies["kinetic"].copy()
        for name in self.model.laws:
            effect = get(name)
            if effect.exchanges_work:
                total -= self.work[name]
            else:
                total += self.energies[name]
        return total - self.work.get(grips.WORK, 0.0)


def simulate(
    model: Model,
    parameters: Parameters,
    drive: Drive | None = None,
    *,
    duration: float | str,
    rate: float | str = 60.0,
    dt: float | str | None = None,
    state: State | None = None,
    method: str = "explicit",
    spectral_radius: float = 1.0,
    tolerance: float | None = None,
    accuracy: float | None = None,
    device: str = "cpu",
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Simulates all worlds that the parameters and the drive describe.

    Velocity-Verlet (kick, drift, kick), second order and symplectic without damping; forces that depend on velocity
    see its second-order prediction. Worlds are independent and their results do not depend on the batch.

    The default step is stable, which need not be accurate: every run reports the error of its energy balance
    (`energy_error`), with a note where that is above half a per cent. An `accuracy` has the run repeated at half the
    step until the motion is known that well.

    Panels of which it was not stated whether they touch keep each other off: a run in which any two come near each
    other is made again with contact, and says so (`solve.watch`).

    For stiff parts and slow holds, method="implicit" takes steps of any length: second order, energy kept without
    numerical damping (see `solve.implicit`), world after world, on the CPU.

    Args:
        duration: simulated time [s], rounded up to whole frames, or a quantity ("200 ms"). rate: frames per second.
        dt: step [s]; default SAFETY times the stability limit of the stiffest element. Implicit: any length, halved
            only where Newton finds no solution; by default adapted within each frame.
        state: where to start (default: the reference state at rest); its worlds must match.
        method: "explicit" or "implicit".
        spectral_radius: implicit: below 1 it damps modes faster than the step, so much per step (generalised-alpha).
        tolerance: error of one step without dt: implicit, of positions over the size of the structure (default 1e-5);
            rigid panels, of angles [rad], and of positions over the size (default 1e-10).
        accuracy: largest error of a fold angle [rad], of a position over the device's size and of the energy balance
            over the energy exchanged. Steps, or tolerances, are halved until then; the finest run is returned, and a
            note says what the last halving changed. `dt` or `tolerance` is where that begins.
        device: "cpu" or "cuda:0". threads: CPU threads (default all cores).
        progress: called with the fraction done.

    Raises:
        InputError: duration or rate not positive, more frames than there is memory for, no such method, a step above
            the limit, a drive that ends early, worlds that differ, no such accuracy, a start inside the ground, paths
            of grips that the model lacks, that the start is not on or that no rigid panel can follow;
            implicit: another device, spectral radius or tolerance out of bounds.
    """
    dt = converted(dt, "s", "dt")
    options: dict[str, Any] = {
        "duration": converted(duration, "s", "duration"),
        "rate": converted(rate, "Hz", "rate"),
        "dt": dt,
        "state": state,
        "method": method,
        "spectral_radius": spectral_radius,
        "tolerance": tolerance,
        "device": device,
        "threads": threads,
        "progress": progress,
    }
    drive = drive or Drive()
    model, parameters = continued(model, parameters, state)
    try:
        return _as_asked(model, parameters, drive, accuracy, options)
    except Met as met:
        return _touching(model, parameters, drive, accuracy, options, met.sentence)


def _touching(
    model: Model, parameters: Parameters, drive: Drive, accuracy: float | None, options: dict[str, Any], said: str
) -> Trajectory:
    """The run with contact, stiffer where panels are pressed too deep into each other."""
    rate, method, dt, state = (options[n] for n in ("rate", "method", "dt", "state"))
    before = _substeps(stable_step(model, parameters), dt, rate, method)
    out, stiffer = None, 1.0
    for stiffer in STIFFER:
        other, own = engaged(model, parameters, stiffer)
        chosen, given = stable_step(other, own), dict(options)
        if dt is not None and method == "explicit":
            given["dt"] = min(dt, chosen.dt)
        if state is not None:
            given["state"] = with_memory(other, state)
            if state.step > 0:  # it counts steps, which are shorter now
                given["state"].step = state.step // before * _substeps(chosen, given["dt"], rate, method)
        out = _as_asked(other, own, drive, accuracy, given)
        if not any(PRESSED in f.cause for f in out.failures):
            break
    assert out is not None
    more = f" Its stiffness is {stiffer:g} times the default, by which they were pressed too deep." * (stiffer > 1)
    out.notes.insert(0, said + more)
    return out


def _as_asked(
    model: Model, parameters: Parameters, drive: Drive, accuracy: float | None, options: dict[str, Any]
) -> Trajectory:
    """One run, or as many as an accuracy asks for.

    Raises:
        Met: panels came near each other that nothing keeps apart.
    """
    if accuracy is not None:
        return _accurate(model, parameters, drive, check_accuracy(accuracy), **options)
    out = _simulated(model, parameters, drive, **options)
    dt, method, spectral_radius = (options[n] for n in ("dt", "method", "spectral_radius"))
    fixed = dt is not None or not (method == "implicit" or model.panels == "rigid")
    out.notes += warning(out, fixed=fixed, damped=method == "implicit" and spectral_radius < 1.0)
    return out


def _simulated(
    model: Model,
    parameters: Parameters,
    drive: Drive,
    *,
    duration: float,
    rate: float,
    dt: float | None,
    state: State | None,
    method: str,
    spectral_radius: float,
    tolerance: float | None,
    device: str,
    threads: int | None,
    progress: Callable[[float], None] | None,
) -> Trajectory:
    """One run, with the error of its energy balance."""
    check_frames(duration, rate)
    chosen = stable_step(model, parameters)
    if method not in ("explicit", "implicit"):
        raise InputError("no such method", field="method", value=method, allowed="explicit, implicit")
    if tolerance is not None and not (tolerance > 0 and np.isfinite(tolerance)):
        raise InputError("steps need a positive tolerance", field="tolerance", value=tolerance, allowed="> 0")
    implicit = method == "implicit"
    if implicit and model.panels == "rigid":
        raise InputError("rigid panels need no implicit steps", field="method", value=method, allowed="explicit")
    if dt is not None and not 0 < dt <= (np.finfo(float).max if implicit else chosen.limit):
        what = "the time step is above the stability limit" if dt > 0 else "the time step must be positive"
        allowed = "> 0 s" if implicit else f"0 < dt <= {chosen.limit:.3g} s, set by {chosen.cause}"
        raise InputError(what, field="dt", value=dt, allowed=allowed)
    frame_time = 1.0 / rate
    substeps = _substeps(chosen, dt, rate, method)
    step = frame_time / substeps
    frames = math.ceil(duration * rate - 1e-6)  # at least as long as asked, but for rounding
    if duration * rate < 0.5:
        raise InputError(
            "the run is shorter than one frame",
            field="duration",
            value=duration,
            allowed=f">= {frame_time:g} s at this rate",
        )
    rests = state is None
    if state is None:
        worlds = max(parameters.worlds, drive.worlds)
        state = State.at_rest(model, worlds)
        if grips.alone(model) is not None:  # that grip has the whole device where its path begins
            at = grips.levels_at(model, drive, 0.0, worlds)
            state.x = grips.carried_along(model, state.x, np.zeros_like(at), at)
    check_memory(model, state.worlds, duration, rate)
    first = max(state.step, 0)
    drive_end = (first * step if state.step > 0 else 0.0) + frames * frame_time
    drive.require(drive_end)
    applied = distorted(model, parameters, drive, drive_end)
    refuse_start_outside_tables(model, parameters, applied, state.x, first * step)
    gripped = check_start(model, applied, state, first * step, drive_end)
    tree = Topology(model, gripped) if model.panels == "rigid" and (gripped or np.any(model.free)) else None
    if implicit:
        batch = Implicit(
            model,
            parameters,
            applied,
            state,
            radius=spectral_radius,
            tolerance=(tolerance or TOLERANCE) if dt is None else None,
            device=device,
            threads=threads,
        )
    else:
        error = 0.0 if dt is not None else tolerance or RIGID
        how = {"device": device, "threads": threads}
        if tree is not None:
            damped = dt is None and overdamped(model, parameters, tree, step)
            how |= {"tolerance": error, "tree": tree, "implicit": damped}
        batch = batch_of(model, parameters, applied, state, **how)
    lengths = np.linalg.norm(np.diff(model.position[model.bars], axis=1), axis=-1)
    speed_limit = 0.5 * lengths.min(initial=np.inf) / step

    flat = starts_flat(model, state.x) if tree is not None and len(tree.row_node) else []
    watch, said = watch_of(model, parameters, state, reference=rests, device=device)
    contact = [e for e in model.effects if get(e).family in ("contact", "tangent")]
    record: list[tuple[State, Evaluation]] = []
    mass, pulls = node_mass(model, parameters) if gripped and tree is None else None, []
    began = clock.perf_counter()
    for i in range(frames + 1):
        batch.advance(substeps if i else 0, step, speed_limit)  # no steps: only the first force evaluation
        record.append((batch.state(), batch.evaluate(batch.step * step)))
        if gripped:
            now, laws = record[-1]
            force = sum((laws.forces[n] for n in model.laws), np.zeros_like(now.x))
            motion = grips.motion_at(model, applied, batch.step * step, now.worlds)
            borne = batch.supporting() if isinstance(batch, RigidBatch) else None
            pulls.append(exerted(model, now.x, force, motion, mass=mass, tree=tree, borne=borne))
        if i == 0 and rests and "ground" in model.laws:
            refuse_start_inside_the_ground(model, parameters, record[0][0].x, record[0][1].energies["ground"])
        if watch is not None:
            watch.add(batch.step * step, record[-1][0].x, record[-1][0].v)
        if progress:
            progress(i / frames)
    if watch is not None:
        watch.look()
    wall = clock.perf_counter() - began

    last = record[-1][0]
    stopped = batch.stopped if isinstance(batch, Implicit) else {}
    failures = [
        Failure(w, time, int(n), cause)
        for w, (s, n) in enumerate(last.status.T)
        if s >= 0
        for time, cause in [stopped.get(w) or (float(s * step), _cause(model, parameters, last, w, step, chosen))]
        for cause in [_left(model, parameters, applied, last, w, time) or cause]
    ]
    times = (first + np.arange(frames + 1) * substeps) * step
    torn = tears(model, applied, times, np.stack([s.x for s, _ in record])) if gripped and tree is not None else {}
    failures = [f for f in failures if f.world not in torn] + [Failure(w, *why) for w, why in torn.items()]
    zero = np.zeros((len(model.position), last.worlds, 3))
    out = Trajectory(
        model=model,
        parameters=parameters,
        drive=drive,
        times=times,
        x=np.stack([s.x for s, _ in record]),
        v=np.stack([s.v for s, _ in record]),
        angles=np.stack([e.angles for _, e in record]),
        energies={
            "kinetic": np.stack([e.kinetic for _, e in record]),
            **{n: np.stack([e.energies[n] for _, e in record]) for n in record[0][1].energies},
        },
        work={
            n: np.stack([s.work[i] for s, _ in record])
            for i, n in enumerate((*model.laws, grips.WORK) if gripped else model.laws)
        },
        grip_wrenches=np.stack(pulls) if gripped else None,
        gaps=np.stack([e.gaps for _, e in record]),
        contact_forces=np.stack([sum((e.forces[c] for c in contact), zero) for _, e in record]),
        failures=failures,
        dt=step,
        step=chosen,
        state=last,
        wall=wall,
        notes=[
            *said,
            *flat,
            *lumped_masses(model, parameters),
            *idle_drives(model, parameters, drive),
            *beyond_breakdown(model, parameters, applied, drive_end),
            *below_the_ground(model, parameters, last.x),
            *beyond_crease_tables(model, parameters, np.stack([e.angles for _, e in record])),
            *(batch.notes() if isinstance(batch, Implicit) else []),
        ],
    )
    out.energy_error = energy_error(out)
    return out


def _substeps(chosen: TimeStep, dt: float | None, rate: float, method: str) -> int:
    """Steps from frame to frame, none longer than asked for."""
    longest = dt or (1.0 / rate if method == "implicit" else chosen.dt)
    return max(1, int(np.ceil(1.0 / rate / min(longest, 1.0 / rate) * (1 - 1e-12))))


def _accurate(
    model: Model, parameters: Parameters, drive: Drive, accuracy: float, *, dt, state, tolerance, **options
) -> Trajectory:
    """The run at half the step again and again, until it is accurate.

    Where the solver follows a tolerance of its steps, that is divided by what halves them.
    """
    implicit = options["method"] == "implicit"
    given = dt
    order = 2 if implicit else 5
    adapted = dt is None and (implicit or model.panels == "rigid")
    begin = tolerance or (TOLERANCE if implicit else PER_STEP * accuracy)

    def run(halvings: int) -> Trajectory:
        nonlocal given
        if adapted:
            finer = begin / 2.0 ** ((order + 1) * halvings)
            return _simulated(model, parameters, drive, dt=None, state=state, tolerance=finer, **options)
        parts, start = 2**halvings, state
        if state is not None and state.step > 0:  # it counts steps, of which there are more now
            start = state.copy()
            start.step *= parts
        out = _simulated(model, parameters, drive, dt=given and given / parts, state=start, tolerance=None, **options)
        given = out.dt * parts
        return out

    return refined(run, accuracy, balanced=not implicit or options["spectral_radius"] == 1.0)


def _left(model: Model, parameters: Parameters, drive: Drive, state: State, world: int, time: float) -> str:
    """The panel that left a table of the field, if that is why a world failed."""
    off = outside_tables(model, parameters, drive, state.x, time) if drive.placed else []
    panels = [model.name("panel", int(model.triangle_panel[t])) for t, w, _ in off if w == world]
    return f"{panels[0]} left the table of the field; take a larger table" if panels else ""


def _cause(model: Model, parameters: Parameters, state: State, world: int, dt: float, step: TimeStep) -> str:
    """Why a world failed: the most strained bar of the state in which it stopped."""
    x = state.x[:, world]
    now = np.linalg.norm(x[model.bars[:, 1]] - x[model.bars[:, 0]], axis=-1)
    rest = np.linalg.norm(model.position[model.bars[:, 1]] - model.position[model.bars[:, 0]], axis=-1)
    strain = np.abs(now / rest - 1)
    margin = f"dt = {dt:.3g} s, limit {step.limit:.3g} s set by {step.cause} in the reference state"
    if not np.all(np.isfinite([x, state.v[:, world]])):
        return f"a position or a velocity is not a number ({margin})"
    if "touch" in model.laws and (why := too_deep(model, parameters, x, world)):
        return why
    if model.panels == "rigid":
        return f"no step within {dt:.3g} s is accurate enough; take a finer rate or step, softer creases and contacts"
    if len(strain) and strain.max() > 0.05:
        worst = int(strain.argmax())
        return f"bar {worst} strained by {strain[worst]:.0%} ({margin}); take a smaller step or a smaller load"
    return f"the node moves more than half the shortest bar in one step ({margin}); take a smaller step"

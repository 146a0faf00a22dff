"""Bistable arch of remanent elastomer that snaps in a field across it, beside its recording.

    python -m origami_sim.scenes.magnetic_arch

A strip between clamps, magnetised outwards from midspan, is buckled towards +z by bringing the clamps together. A field
along +z presses on midspan like a dead load 2 M A B, until the arch leaves sideways and snaps through. Modes:

    origami-sim run magnetic_arch                         the recorded ramp, 0 to 16.25 mT in 2.5 s
    origami-sim run magnetic_arch --set mode=step         the recorded step, 5 mT
    origami-sim run magnetic_arch --set mode=quasistatic  all equilibria, limit points, hysteresis loop

The strip is a shell between two held rows of cells, of a nearly incompressible standard linear solid: a Maxwell branch
relaxes beside the elasticity, in bending and in stretching. What flattens an arch between clamps compresses it, so that
the loss in stretching decides whether a sudden field snaps it. The material is as published; the clamp's tilt is
assumed, and a step of 5 mT snaps the arch if it is 1.7 mrad. The recorded motion is drawn beside the simulated one
where the recording is present.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path as File

import numpy as np

from origami_sim.design.build import Sheet
from origami_sim.device.scene import Outcome, Progress, Settings, motion_of, recordings_folder
from origami_sim.drive import Drive, Signal, ramp, series
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, State
from origami_sim.pattern import grid, uncreased
from origami_sim.physics.materials import MU0
from origami_sim.solve.motion.dynamics import Trajectory
from origami_sim.solve.statics.equilibria import Path, continuation, equilibrium

CALIBRATION = "magnetic_arch"
MESHES = ((10, 2), (20, 2), (20, 4))
"""Cells along and across the strip of the mesh study."""

RATE = 400.0
"""Frames per second: 30 in a period of the first mode."""

MARK = 5e-3
"""Field in which the displacements on the ramp are compared [T]."""

RECORDINGS = {"ramp": "ramp_16p25mT_2p5s.csv", "step": "step_5mT.csv"}
RECORDED_RATE, RECORDED_STEP = 16.25e-3 / 2.5, 5e-3
"""Drives of the recordings: rate of the ramp [T/s] and step [T]."""

SETTLED = (0.15, 0.65)
"""Time after the snap over which the displacement is averaged to give the stroke [s]."""

SECOND_MODE = 8.986818915818128
"""k L of the second buckling mode of a clamped strip: tan(k L / 2) = k L / 2."""


def build(s: Settings) -> tuple[Model, Parameters, Drive]:
    """The strip between two held rows of cells, which starts buckled, with the drive of the mode.

    Raises:
        InputError: what `flat` and `buckled` refuse.
    """
    model, parameters = flat(s)
    return replace(model, start=buckled(s, model, parameters).x[:, 0]), parameters, drive(s)


def flat(s: Settings) -> tuple[Model, Parameters]:
    """The strip before its clamps are brought together, its left clamp at x = 0.

    Raises:
        InputError: an odd number of cells.
    """
    cells, rows = round(s.cells), round(s.rows)
    for name, count in (("cells", cells), ("rows", rows)):
        if count % 2:
            fault = "the two halves need as many"
            raise InputError(fault, file=s.file, field=name, value=count, allowed="an even number")
    long, wide = s.length / cells, s.width / rows
    sheet = Sheet(
        uncreased(grid(cells + 2, rows, long, wide)),
        thickness=s.thickness,
        modulus=s.modulus,
        density=s.density,
        membrane_damping=0.0,
        triangulation=s.triangulation,
    )
    branch = [(s.relaxing_modulus / s.modulus, s.relaxation_time)] if s.relaxing_modulus else []
    sheet.shell(poisson=s.poisson, relaxation=branch)
    column = np.arange(rows * (cells + 2)) % (cells + 2)
    sheet.fix(panels=np.flatnonzero((column == 0) | (column == cells + 1)))
    for panel in np.flatnonzero((column > 0) & (column <= cells)):
        outwards = (-1, 0, 0) if column[panel] <= cells // 2 else (1, 0, 0)
        sheet.magnetise(int(panel), remanence=s.remanence, volume=long * wide * s.thickness, poling=outwards)
    sheet.set("mass_damping", decay_rate=s.loop_decay_rate if s.mode == "quasistatic" else s.decay_rate)
    model, parameters = sheet.build()
    parameters.set("shell_bending", "natural_11", s.natural_curvature)
    model = replace(model, names={**model.names, "node": _labels(model)})
    model.position[:, 0] -= long
    return model, parameters


def direction(s: Settings) -> np.ndarray:
    """Unit vector of a positive field: along z, tilted by the misalignment towards x."""
    return np.array([np.sin(s.misalignment), 0.0, np.cos(s.misalignment)])


def drive(s: Settings) -> Drive:
    """Ramp, step or, for the loop, a triangle that starts and ends at zero."""
    wave: list[Signal]
    if s.mode == "ramp":
        wave = [ramp(s.field * a, s.rise_time) for a in direction(s)]
    elif s.mode == "step":
        wave = [Signal(offset=s.step_field * a) for a in direction(s)]
    else:
        knots = s.loop_time * np.array([0.0, 0.25, 0.75, 1.0])
        wave = [series(knots, [0.0, 1.0, -1.0, 0.0], scale=s.loop_field * a) for a in direction(s)]
    return Drive(field=wave)


def _middle(model: Model) -> int:
    """The node nearest to the middle of the strip."""
    low, high = model.position.min(axis=0), model.position.max(axis=0)
    return int(np.argmin(np.abs(model.position - 0.5 * (low + high)).sum(axis=1)))


def _labels(model: Model) -> tuple[str, ...]:
    """Labels of the nodes, of which recordings name "midspan"."""
    return tuple("midspan" if n == _middle(model) else f"node {n}" for n in range(len(model.position)))


def midspan(model: Model, x: np.ndarray) -> np.ndarray:
    """Height of the middle of the strip [m] from positions [..., N, 3]."""
    return x[..., _middle(model), 2]


def euler_shortening(s: Settings) -> float:
    """Shortening at which the clamped strip buckles [m]: strain 4 pi^2 I / (A L^2)."""
    return (np.pi * s.thickness) ** 2 / (3 * s.length)


def buckled(s: Settings, model: Model, parameters: Parameters, *, side: int = 1) -> State:
    """The strip at rest without field, its clamps brought together, buckled towards `side` z.

    Raises:
        InputError: it does not buckle, or no equilibrium was found.
    """
    if not s.shortening > euler_shortening(s):
        raise InputError(
            "the strip does not buckle",
            file=s.file,
            field="shortening",
            value=s.shortening,
            allowed=f"> {euler_shortening(s):.3g} m",
        )
    x = model.position.copy()
    share = np.clip(x[:, 0] / s.length, 0, 1)
    rise = 2 / np.pi * np.sqrt(s.length * (s.shortening - euler_shortening(s)))
    x[:, 2] = side * rise * (1 - np.cos(2 * np.pi * share)) / 2
    clamp = x[:, 0] > s.length * (1 + 1e-9)
    beyond = x[clamp, 0] - s.length
    x[clamp, 0] = s.length + beyond * np.cos(s.clamp_tilt)
    x[clamp, 2] = beyond * np.sin(s.clamp_tilt)
    x[:, 0] -= s.shortening * share
    found = equilibrium(model, parameters, Drive(), state=State.at_rest(model, position=x))
    if not (found.converged and found.stable and side * midspan(model, found.x) > 0.1 * rise):
        raise InputError(f"no buckled state was found: {found.message}", file=s.file, field="shortening")
    return found.state


def shallow_field(s: Settings, kl: float) -> float:
    """Field that holds a perfect shallow arch symmetrically under the compression P = E I (kl / L)^2 [T].

    Under a dead load F at midspan its slope is F / 2P (1 - cos kx - tan(kL/4) sin kx); the shortening that the
    compression leaves over gives F = 2 M A B. nan if it leaves nothing over.
    """
    area = s.width * s.thickness
    compression = (kl / s.length) ** 2 * s.modulus * area * s.thickness**2 / 12
    u = np.linspace(0, kl / 2, 2001)
    slope = 1 - np.cos(u) - np.tan(kl / 4) * np.sin(u)
    bent = s.shortening - compression * s.length / (s.modulus * area)
    load = 2 * compression * np.sqrt(bent * kl / s.length / np.trapezoid(slope**2, u)) if bent > 0 else np.nan
    return float(load * MU0 / (2 * s.remanence * area))


# quasi-static -------------------------------------------------------------------------------------------------------


@dataclass
class Loop:
    """Equilibria over field, from -loop_field on the upper branch to +loop_field on the lower one.

    Attributes:
        field: [P] [T]. displacement: [P] of midspan from the buckled state, positive downwards [m].
        stable: [P]. limits: indices of the limit points; the first is where the rising field snaps the arch through,
            the last where the falling field snaps it back.
        path: as the continuation returned it. rest: height of the buckled state [m].
    """

    field: np.ndarray
    displacement: np.ndarray
    stable: np.ndarray
    limits: np.ndarray
    path: Path
    rest: float

    @property
    def snap(self) -> float:
        """Field of the limit point [T]; nan if none was met."""
        return float(self.field[self.limits[0]]) if len(self.limits) else np.nan

    @property
    def snap_back(self) -> float:
        """Field of the limit point on the way back [T]; nan if none was met."""
        return float(self.field[self.limits[-1]]) if len(self.limits) > 1 else np.nan

    @property
    def before(self) -> float:
        """Displacement at the limit point [m]."""
        return float(self.displacement[self.limits[0]]) if len(self.limits) else np.nan

    @property
    def stroke(self) -> float:
        """Displacement on the other stable branch in the field of the limit point [m]; nan without snap."""
        if len(self.limits) < 2 or not self.path.reached:
            return np.nan
        after = slice(self.limits[-1], None)
        return float(np.interp(self.snap, self.field[after], self.displacement[after]))


def loop(s: Settings) -> Loop:
    """All equilibria between both fields by continuation, through the limit points."""
    model, parameters = flat(s)
    state = buckled(s, model, parameters)
    rest = float(midspan(model, state.x[:, 0]))
    end = Drive(field=tuple(s.loop_field * direction(s)))
    path = continuation(model, parameters, end, start=-1.0, end=1.0, step=0.1, move=0.04 * rest + 0.2e-3, state=state)
    return Loop(s.loop_field * path.factor, rest - midspan(model, path.x), path.stable, path.limit_points, path, rest)


def mesh_study(s: Settings, meshes: Sequence[tuple[int, int]]) -> dict[str, np.ndarray]:
    """Limit point, stroke and height of the buckled state by number of cells along and across the strip."""
    loops = [loop(s.replace(cells=float(n), rows=float(m))) for n, m in meshes]
    return {
        "cells": np.array([n for n, _ in meshes]),
        "rows": np.array([m for _, m in meshes]),
        "snap_mT": 1e3 * np.array([p.snap for p in loops]),
        "stroke_mm": 1e3 * np.array([p.stroke for p in loops]),
        "rest_mm": 1e3 * np.array([p.rest for p in loops]),
    }


# motion -------------------------------------------------------------------------------------------------------------


def move(s: Settings, *, progress: Progress | None = None) -> tuple[Trajectory, np.ndarray]:
    """Motion of the mode from the buckled state, and the displacement of midspan by frame [m]."""
    model, parameters, signals = build(s)
    duration = {"ramp": s.rise_time, "step": s.step_time}.get(s.mode, s.loop_time)
    rate = min(RATE, max(100.0, 1000 / duration))
    duration = np.floor(duration * rate * (1 + 1e-12)) / rate  # whole frames within the drive
    motion = motion_of(s, model, parameters, signals, duration=duration, rate=rate, progress=progress)
    height = midspan(model, motion.x[:, :, 0])
    return motion, height[0] - height


def snap(times: np.ndarray, displacement: np.ndarray, through: float) -> tuple[float, float]:
    """Time at which the displacement first passes `through`, and its mean over the window SETTLED after that.

    Returns:
        Time [s] and stroke [unit of the displacement]; nan if it never passes, or the series ends too early.
    """
    passed = np.flatnonzero(displacement >= through)
    if not len(passed) or not passed[0]:
        return np.nan, np.nan
    n = passed[0]
    share = (through - displacement[n - 1]) / (displacement[n] - displacement[n - 1])
    when = times[n - 1] + share * (times[n] - times[n - 1])
    if times[-1] < when + SETTLED[1]:
        return float(when), np.nan
    even = np.linspace(when + SETTLED[0], when + SETTLED[1], 1001)  # samples may be uneven
    return float(when), float(np.interp(even, times, displacement).mean())


def recorded(mode: str) -> tuple[np.ndarray, np.ndarray] | None:
    """Times [s] and midspan displacements [m] of the recording of a mode; None if there is none here."""
    folder = recordings_folder()
    file = folder / "magnetic_arch" / RECORDINGS[mode] if folder and mode in RECORDINGS else None
    if file is None or not file.is_file():
        return None
    times, displacement = np.loadtxt(file, delimiter=",", skiprows=1).T
    order = np.argsort(times, kind="stable")
    return times[order], 1e-3 * displacement[order]


def beside(s: Settings) -> tuple[np.ndarray, np.ndarray] | None:
    """The recording of the mode; None if there is none here, or if it was driven otherwise."""
    same = {
        "ramp": np.isclose(s.field / s.rise_time, RECORDED_RATE, rtol=1e-6),
        "step": np.isclose(s.step_field, RECORDED_STEP, rtol=1e-6),
    }
    return recorded(s.mode) if same.get(s.mode, False) else None


def rms_difference(motion: Trajectory, displacement: np.ndarray, real, until: float = np.inf) -> float:
    """RMS of simulated less recorded displacement at the recorded times up to `until` [m]; nan if there are none."""
    times, measured = real
    part = times <= min(until, motion.times[-1])
    error = np.interp(times[part], motion.times, displacement) - measured[part]
    return float(np.sqrt(np.mean(error**2))) if part.any() else np.nan


def ramp_table(s: Settings, motion: Trajectory, displacement: np.ndarray) -> tuple[dict, dict[str, float]]:
    """Snap field, stroke and displacement at MARK, simulated and, where it is here, recorded; and numbers by name.

    The snap is the passage through the clamps' line. `rms_before_mm` ends 0.05 s before the first of the two snaps.
    """
    rest, slope = float(midspan(motion.model, motion.x[0, :, 0])), s.field / s.rise_time

    def measure(times: np.ndarray, d: np.ndarray) -> tuple[float, np.ndarray]:
        when, stroke = snap(times, d, rest)
        at_mark = np.interp(MARK, slope * times, d, right=np.nan) if slope > 0 else np.nan
        return when, 1e3 * np.array([slope * when, stroke, at_mark])

    when, simulated = measure(motion.times, displacement)
    table = {
        "quantity": ["snap [mT]", "stroke [mm]", f"displacement at {1e3 * MARK:g} mT [mm]"],
        "simulated": simulated,
    }
    numbers: dict[str, float] = dict(zip(("snap_mT", "stroke_mm", "at_mark_mm"), map(float, simulated), strict=True))
    real = beside(s)
    if real:
        measured_when, table["recorded"] = measure(*real)
        numbers["rms_mm"] = 1e3 * rms_difference(motion, displacement, real)
        until = float(np.fmin(when, measured_when)) - 0.05
        numbers["rms_before_mm"] = 1e3 * rms_difference(motion, displacement, real, until)
    return table, numbers


def step_table(s: Settings, motion: Trajectory, displacement: np.ndarray) -> tuple[dict, dict[str, float]]:
    """First peak and later mean of the displacement, simulated and, where it is here, recorded; and numbers by name."""

    def measure(times: np.ndarray, d: np.ndarray) -> np.ndarray:
        early = times <= 0.1
        return 1e3 * np.array([d[early].max(), np.nan if early.all() else d[~early].mean()])

    simulated = measure(motion.times, displacement)
    table = {"quantity": ["peak within 0.1 s [mm]", "mean after 0.1 s [mm]"], "simulated": simulated}
    numbers: dict[str, float] = dict(zip(("peak_mm", "mean_mm"), map(float, simulated), strict=True))
    real = beside(s)
    if real:
        table["recorded"] = measure(*real)
        numbers["rms_mm"] = 1e3 * rms_difference(motion, displacement, real)
    return table, numbers


# scene --------------------------------------------------------------------------------------------------------------


def run(s: Settings, progress: Progress | None = None) -> Outcome:
    """The motion of the mode beside its recording, with the limit points of the equilibria; or all of these."""
    if s.mode == "quasistatic":
        return _run_quasistatic(s, progress)
    statics = loop(s)
    motion, displacement = move(s, progress=progress)
    table, numbers = (ramp_table if s.mode == "ramp" else step_table)(s, motion, displacement)
    summary = []
    if "recorded" not in table:
        absent = recorded(s.mode) is None
        why = "the recording magnetic_arch is not here" if absent else "the recording was driven otherwise"
        summary.append(f"{why}: nothing to compare with")
    else:
        text = f"RMS {numbers['rms_mm']:.2f} mm"
        if s.mode == "ramp":
            snapped, stroke, _ = table["simulated"] / table["recorded"] - 1
            text += f" ({numbers['rms_before_mm']:.2f} mm before the snap), snap {snapped:+.1%}, stroke {stroke:+.1%}"
        summary.append(f"against the recording: {text}")
    through = displacement.max() > midspan(motion.model, motion.x[0, :, 0])
    summary += [
        f"the arch {'snapped' if through else 'did not snap'} through",
        *_limits(s, statics),
        f"energy balance kept within {1e6 * np.ptp(motion.energy_balance()):.3f} uJ, largest kinetic energy "
        f"{1e6 * motion.energies['kinetic'].max():.0f} uJ",
    ]
    numbers |= {"static_snap_mT": 1e3 * statics.snap, "static_stroke_mm": 1e3 * statics.stroke}
    return Outcome(motion, {s.mode: table}, summary=summary, numbers=numbers)


def _limits(s: Settings, path: Loop) -> list[str]:
    """Sentences on the limit points."""
    lines = [] if path.path.reached else [f"the equilibria are incomplete: {path.path.message}"]
    if len(path.limits) < 2:
        lines.append(f"the equilibria have no pair of limit points within {1e3 * s.loop_field:g} mT")
    else:
        lines.append(
            f"limit points of the equilibria at {1e3 * path.snap:.3f} and {1e3 * path.snap_back:.3f} mT, displacement "
            f"{1e3 * path.before:.2f} mm before and {1e3 * path.stroke:.2f} mm after the snap"
        )
    lost = np.flatnonzero(~path.stable)
    if len(lost) and len(path.limits) and 0 < lost[0] < path.limits[0]:
        a, b = 1e3 * path.field[lost[0] - 1 : lost[0] + 1]
        lines.append(
            f"the upper branch becomes unstable sideways between {a:.2f} and {b:.2f} mT, before its limit point"
        )
    return [*lines, f"a perfect shallow arch leaves sideways at {1e3 * shallow_field(s, SECOND_MODE):.3f} mT"]


def _run_quasistatic(s: Settings, progress: Progress | None) -> Outcome:
    path = loop(s)
    study = mesh_study(s, MESHES)
    motion, displacement = move(s, progress=progress)
    field, rest = motion.drive["field_z"](motion.times) / _largest(s), midspan(motion.model, motion.x[0, :, 0])
    rising = motion.times < s.loop_time / 4
    through, _ = snap(motion.times[rising], displacement[rising], float(rest))
    moved = 1e3 * float(np.interp(through, motion.times, field)) if np.isfinite(through) else np.nan
    return Outcome(
        motion,
        {
            "equilibria": {
                "field_mT": 1e3 * path.field,
                "displacement_mm": 1e3 * path.displacement,
                "stable": np.where(path.stable, "yes", "no"),
            },
            "mesh": {**study},
        },
        summary=[
            *_limits(s, path),
            f"in the slow loop of the replay it passes the clamps' line at {moved:.2f} mT"
            if np.isfinite(moved)
            else "in the slow loop of the replay it does not snap through",
        ],
        numbers={
            "snap_mT": 1e3 * path.snap,
            "snap_back_mT": 1e3 * path.snap_back,
            "stroke_mm": 1e3 * path.stroke,
            "before_mm": 1e3 * path.before,
            "loop_snap_mT": moved,
        },
    )


def _largest(s: Settings) -> float:
    """Share of a positive field that lies along z."""
    return float(direction(s)[2])


def draw(s: Settings, outcome: Outcome, folder: str | File) -> File:
    """Draws the hysteresis loop, or the motion beside its recording, into a folder; returns the picture's path."""
    from matplotlib.figure import Figure  # slow to import, only needed here

    motion = outcome.trajectory
    height = midspan(motion.model, motion.x[:, :, 0])
    displacement = 1e3 * (height[0] - height)
    figure = Figure(figsize=(7.0, 4.6), dpi=120, layout="constrained")
    axes = figure.subplots()
    if s.mode == "quasistatic":
        name, table = "hysteresis.png", outcome.tables["equilibria"]
        field, d = np.asarray(table["field_mT"]), np.asarray(table["displacement_mm"])
        stable = np.asarray(table["stable"]) == "yes"
        moving = 1e3 * motion.drive["field_z"](motion.times) / _largest(s)
        axes.plot(moving, displacement, color="0.75", lw=1, label=f"motion, one loop in {s.loop_time:g} s, damped")
        axes.plot(field, d, color="tab:red", ls="--", lw=1.2, label="unstable equilibria")
        # each stable branch by itself, the limit points included
        ends = np.flatnonzero(np.diff(stable.astype(int)))
        for k, part in enumerate(np.split(np.arange(len(d)), ends + 1)):
            if stable[part[0]]:
                label = "stable equilibria" if k == 0 else None
                axes.plot(field[part], d[part], color="tab:blue", lw=2, label=label)
        for value in (outcome.numbers["snap_mT"], outcome.numbers["snap_back_mT"]):
            if np.isfinite(value):
                axes.axvline(value, color="0.5", ls=":", lw=1)
        axes.set_xlabel("field across the strip [mT]")
        limits = "{snap_mT:.2f} and {snap_back_mT:.2f}".format(**outcome.numbers)
        axes.set_title(f"Bistable arch: limit points at {limits} mT", fontsize=10)
    else:
        name, real = "motion.png", beside(s)
        axes.plot(motion.times, displacement, color="tab:blue", lw=1.2, label="simulated")
        if real:
            axes.plot(real[0], 1e3 * real[1], "o", color="0.25", ms=3, label="recorded")
        loss = "with loss" if s.relaxing_modulus or s.decay_rate else "elastic, no loss"
        drive = f"{1e3 * s.field:g} mT in {s.rise_time:g} s" if s.mode == "ramp" else f"{1e3 * s.step_field:g} mT"
        axes.set_xlabel("time [s]")
        axes.set_title(f"Bistable arch, {s.mode} to {drive}, {loss}", fontsize=10)
    axes.set_ylabel("displacement of midspan [mm]")
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)
    target = File(folder) / name
    figure.savefig(target)
    return target


if __name__ == "__main__":
    from origami_sim.commands.cli import main

    main(["run", "magnetic_arch"])

"""Batch study of a walker over its unknowns: maps of stride, and a set that is steady, converged and robust.

    origami-sim study crawler --out runs/study_crawler
    origami-sim study crawler --out runs/study_crawler --fine --cycles 10 --device cuda:0

Four stages, each resumed where it was interrupted: maps over pairs of unknowns around the calibration; samples over
all of them at once; a screening of the points that give the target with a steady gait, by 5 % of the most delicate
parameters; and full trials of the best (half the step, a finer mesh, 5 % more and less of every parameter).
"""

import argparse
import functools
import hashlib
import json
import os
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from importlib import metadata, resources
from pathlib import Path

import numpy as np
from scipy.stats import qmc

from origami_sim.device.scene import Settings, scene_module, scene_settings
from origami_sim.drive import Drive, Signal
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters
from origami_sim.observation.gait import strides
from origami_sim.solve.batch import default_threads
from origami_sim.solve.motion.dynamics import simulate
from origami_sim.solve.timestep import stable_step

TARGET = 25.0
"""Stride that the paper reports [mm]."""

STEADY, CONVERGED, ROBUST = 0.02, 0.02, 0.20
"""Limits on the spread of the last cycles, the change when the step is halved, and that for 5 % of a parameter."""


@dataclass(frozen=True)
class Axis:
    """One unknown of a map: where it is varied, and how it reads on a plot."""

    name: str
    label: str
    values: tuple[float, ...]
    scale: float = 1.0

    def refined(self) -> "Axis":
        """The same range with the midpoints added."""
        v = np.array(self.values)
        return Axis(self.name, self.label, tuple(np.sort(np.r_[v, 0.5 * (v[1:] + v[:-1])]).tolist()), self.scale)


AXES = {
    a.name: a
    for a in (
        Axis("big_moment", "big patch's moment / printed", (0.1, 0.15, 0.2072, 0.27, 0.35, 0.5, 0.75, 1.0)),
        Axis("friction_ratio", "friction backward / forward", (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0)),
        Axis("foot_height", "foot pad below the sheet [mm]", (0.0, 0.0005, 0.000865, 0.0015, 0.002, 0.003), 1e3),
        Axis("adhesion", "pull-off force of a foot [N]", (0.0, 0.02, 0.05, 0.1, 0.2)),
        Axis("span", "free span (gap) [mm]", (0.013, 0.01524, 0.017, 0.01905, 0.021), 1e3),
        Axis("loss_time", "loss time of the sheet [ms]", (0.003, 0.005, 0.008, 0.01, 0.014), 1e3),
        Axis("foot_friction", "forward friction of the feet", (0.1, 0.2, 0.3, 0.4, 0.6)),
    )
}

MAPS = (
    ("big_moment", "friction_ratio"), ("foot_height", "friction_ratio"), ("big_moment", "adhesion"),
    ("span", "loss_time"), ("foot_friction", "friction_ratio"),
)  # fmt: skip

VARIED = (
    "big_moment", "remanence", "field", "frequency", "foot_friction", "foot_friction_back", "belly_friction", "span",
    "overhang", "rear_width", "front_width", "thickness", "modulus", "density", "patch_density", "foot_height",
    "foot_mass", "adhesion", "loss_time", "decay_rate", "ground_stiffness", "foot_stiffness", "ground_time",
    "big_length", "small_length", "small_width", "big_width", "patch_thickness",
)  # fmt: skip
"""Parameters that are changed by 5 % when a candidate is tried."""


SAMPLED = {
    "big_moment": (0.1, 0.35), "friction_ratio": (1.5, 4.0), "foot_height": (0.0, 0.002), "span": (0.013, 0.021),
    "loss_time": (0.005, 0.014), "foot_friction": (0.1, 0.4),
}  # fmt: skip
"""Ranges of the samples: where the maps show a steady gait."""

DELICATE = ("thickness", "big_moment", "modulus", "span", "rear_width", "big_length", "small_length")
"""Parameters that a point is screened by before it gets a full trial."""


@dataclass(frozen=True)
class Trial:
    """One world of a study.

    Attributes:
        settings: the whole calibration. step: factor on the step that the solver would take. cycles: simulated.
    """

    settings: Settings
    cycles: int
    step: float = 1.0

    @property
    def key(self) -> str:
        """Digest of everything that decides the result."""
        text = json.dumps([self.settings.as_dict(), self.cycles, self.step], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:20]


@dataclass(frozen=True)
class Result:
    """Strides [mm] of a trial by cycle; `failure` says why a world stopped, empty if it did not."""

    strides: tuple[float, ...]
    dt: float
    failure: str = ""

    @property
    def last(self) -> np.ndarray:
        return np.array(self.strides[len(self.strides) // 2 :])

    @property
    def stride(self) -> float:
        """Mean of the second half of the cycles [mm]; nan if the world failed."""
        return float("nan") if self.failure else float(self.last.mean())

    @property
    def spread(self) -> float:
        """Standard deviation over the same cycles, relative to the mean."""
        return float("nan") if self.failure else float(self.last.std() / max(abs(self.last.mean()), 1e-9))


class Store:
    """Results on disk by key, rewritten whole and atomically, so that an interrupted study goes on where it stopped."""

    def __init__(self, file: Path):
        self.file = file
        self.results: dict[str, Result] = {}
        if file.exists():
            try:
                data = json.loads(file.read_text())
                self.results = {
                    k: Result(tuple(v["strides"]), v["dt"], v["failure"]) for k, v in data["results"].items()
                }
                version = data["version"]
            except (ValueError, KeyError, TypeError, AttributeError):
                raise InputError(
                    "is not a study's results", file=file, allowed="an empty folder or a study's"
                ) from None
            if version != _version():
                raise InputError(
                    "was made by another version", file=file, field="version", value=version, allowed=_version()
                )

    def save(self):
        rows = {
            k: {"strides": [round(s, 6) for s in r.strides], "dt": r.dt, "failure": r.failure}
            for k, r in sorted(self.results.items())
        }
        _write(self.file, json.dumps({"version": _version(), "results": rows}, indent=0))


@functools.cache
def _version() -> str:
    """Version of the package and a digest of its laws and scenes: results of other laws must not be mixed in."""
    package = Path(str(resources.files("origami_sim")))
    scenes = Path(str(resources.files("origami_sim.scenes")))
    digest = hashlib.sha256()
    laws = ("physics", "drive", "effects", "model", "solve", "design")
    files = [f for folder in laws for f in package.glob(f"{folder}/**/*.py")]
    for file in sorted([*files, *scenes.glob("*.py")]):
        digest.update(file.read_bytes())
    try:
        version = metadata.version("origami-sim")
    except metadata.PackageNotFoundError:
        version = "unknown"
    return f"{version}+{digest.hexdigest()[:12]}"


def _write(file: Path, text: str):
    """Replaces a file in one step."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=file.parent, delete=False, suffix=".part") as f:
            f.write(text)
        os.replace(f.name, file)
    except OSError as e:
        raise InputError(
            f"cannot be written ({e.strerror})", file=file, allowed="a folder that can be written"
        ) from None


def apply(s: Settings, **values: float) -> Settings:
    """Settings with unknowns replaced; `friction_ratio` sets the backward friction from the forward one."""
    ratio = values.pop("friction_ratio", None)
    if ratio is None and "foot_friction" in values:
        ratio = s.foot_friction_back / s.foot_friction
    s = s.replace(**values)
    return s if ratio is None else s.replace(foot_friction_back=ratio * s.foot_friction)


# running --------------------------------------------------------------------------------------------------------------


def run_trials(
    scene: str, trials: Sequence[Trial], store: Store, *, device: str = "cpu", threads: int | None = None,
    chunk: int = 16, progress: Callable[[int, int], None] | None = None,
) -> list[Result]:  # fmt: skip
    """Results of all trials, taken from the store where it has them; the store is saved after every chunk.

    On the CPU every world has its own step and a thread to itself, so that no result depends on the others. On a CUDA
    device the worlds that share a geometry run as one batch, with the smallest of their steps.
    """
    module = scene_module(scene)
    todo = list({t.key: t for t in trials if t.key not in store.results}.values())
    done, total = len(trials) - len(todo), len(trials)

    def finished(found: Mapping[str, Result]):
        nonlocal done
        store.results.update(found)
        store.save()
        done += len(found)
        if progress:
            progress(min(done, total), total)

    if device == "cpu":
        if todo:  # the first one compiles the kernels before the threads meet
            finished({todo[0].key: _run_one(module, todo[0])})
        with ThreadPoolExecutor(threads or default_threads()) as pool:
            running = {pool.submit(_run_one, module, t): t for t in todo[1:]}
            found = {}
            for future in as_completed(running):
                found[running[future].key] = future.result()
                if len(found) >= chunk:
                    finished(found)
                    found = {}
            if found:
                finished(found)
    else:
        for group in _groups(module, todo):
            finished(_run_batch(group, device))
    return [store.results[t.key] for t in trials]


def _run_one(module, t: Trial) -> Result:
    try:
        model, parameters, drive = module.build(t.settings)
        dt = stable_step(model, parameters).dt * t.step
        f = t.settings.frequency
        motion = simulate(model, parameters, drive, duration=t.cycles / f, rate=f, dt=dt, threads=1)
    except InputError as e:
        return Result((), 0.0, str(e))
    failure = str(motion.failures[0]) if motion.failures else ""
    return Result(tuple((strides(motion, f) * 1e3).tolist()), motion.dt, failure)


_Built = tuple[Trial, Model, Parameters, Drive]


def _groups(module, trials: Sequence[Trial]) -> list[list[_Built]]:
    """Trials by model, length of run and step factor, in a fixed order."""
    out: dict[tuple, list[_Built]] = {}
    for t in trials:
        model, parameters, drive = module.build(t.settings)
        out.setdefault((model.hash, t.cycles, t.step, t.settings.frequency), []).append((t, model, parameters, drive))
    return list(out.values())


def stack(parameters: Sequence[Parameters]) -> Parameters:
    """Parameters of several worlds of one model, side by side; arrays that do not differ stay single."""
    out = parameters[0].copy()
    for key in out:
        columns = [p[key] for p in parameters]
        if any(not np.array_equal(c, columns[0]) for c in columns[1:]):
            out.set(*key, np.concatenate(columns, axis=1))
    return out


def _stack_drives(drives: Sequence[Drive]) -> Drive:
    """Sinusoidal fields of several worlds, side by side."""
    signals = [[d[c] for d in drives] for c in ("field_x", "field_y", "field_z")]
    names = ("offset", "amplitude", "frequency", "phase")
    return Drive(field=[
        Signal(**{n: np.array([getattr(s, n) for s in row], float) for n in names})
        for row in signals
    ])  # fmt: skip


def _run_batch(group: Sequence[_Built], device: str) -> dict[str, Result]:
    trial, model, *_ = group[0]
    parameters = stack([p for _, _, p, _ in group])
    f = trial.settings.frequency
    dt = stable_step(model, parameters).dt * trial.step
    # short launches, so that a display driver's watchdog and an interruption both stay at ease
    motion = simulate(model, parameters, _stack_drives([d for *_, d in group]), duration=trial.cycles / f, rate=20 * f,
                      dt=dt, device=device)  # fmt: skip
    failed = {x.world: str(x) for x in motion.failures}
    return {
        t.key: Result(tuple((strides(motion, f, world=w) * 1e3).tolist()), motion.dt, failed.get(w, ""))
        for w, (t, *_) in enumerate(group)
    }


# maps and candidates --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class StrideMap:
    """Stride [mm] and relative spread over two unknowns: arrays [x, y]."""

    x: Axis
    y: Axis
    trials: tuple[tuple[Trial, ...], ...]
    stride: np.ndarray
    spread: np.ndarray


def map_trials(base: Settings, x: Axis, y: Axis, cycles: int) -> tuple[tuple[Trial, ...], ...]:
    return tuple(tuple(Trial(apply(base, **{x.name: a, y.name: b}), cycles) for b in y.values) for a in x.values)


def stride_map(x: Axis, y: Axis, trials: tuple[tuple[Trial, ...], ...], store: Store) -> StrideMap:
    results = [[store.results[t.key] for t in row] for row in trials]
    return StrideMap(x, y, trials, np.array([[r.stride for r in row] for row in results]),
                     np.array([[r.spread for r in row] for row in results]))  # fmt: skip


def candidates(
    maps: Sequence[StrideMap], *, target: float = TARGET, window: float = 3.0
) -> list[tuple[float, dict, Trial]]:
    """Points within `window` [mm] of the target with a steady gait, the best conditioned first.

    The rank is the largest change of stride to a neighbour on the map [mm]; a point next to a failed or an unsteady
    one is left out.
    """
    out = []
    for m in maps:
        for i, j in np.ndindex(m.stride.shape):
            near = [(a, b) for a, b in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1))
                    if 0 <= a < m.stride.shape[0] and 0 <= b < m.stride.shape[1]]  # fmt: skip
            here = m.stride[i, j]
            if not (abs(here - target) <= window and all(m.spread[p] < STEADY for p in [(i, j), *near])):
                continue
            change = max(abs(m.stride[p] - here) for p in near)
            out.append((float(change), {m.x.name: m.x.values[i], m.y.name: m.y.values[j]}, m.trials[i][j]))
    seen: set[str] = set()
    return [c for c in sorted(out, key=lambda c: c[0]) if not (c[2].key in seen or seen.add(c[2].key))]


def sampled(
    base: Settings, n: int, cycles: int, seed: int = 0, ranges: Mapping[str, tuple[float, float]] = SAMPLED
) -> list[tuple[dict, Trial]]:
    """Points of a Latin hypercube over ranges of unknowns, rounded to three digits."""
    unit = qmc.LatinHypercube(len(ranges), rng=np.random.default_rng(seed)).random(n)
    out = []
    for row in unit:
        where = {k: float(f"{lo + u * (hi - lo):.3g}") for (k, (lo, hi)), u in zip(ranges.items(), row, strict=True)}
        out.append((where, Trial(apply(base, **where), cycles)))
    return out


def checks(t: Trial, names: Sequence[str] = VARIED, *, change: float = 0.05) -> dict[str, Trial]:
    """What a candidate is put through, by name: half the step, a finer mesh, and parameters by +-change."""
    s = t.settings
    out = {"as it is": t}
    if names is VARIED:
        out["step / 2"] = Trial(s, t.cycles, 0.5 * t.step)
        out["cell / 2"] = Trial(s.replace(cell=0.5 * s.cell), t.cycles)
    for name in names:
        for factor in (1 - change, 1 + change):
            value = getattr(s, name) * factor
            low, high = s[name].range or (-np.inf, np.inf)
            if value != getattr(s, name) and low <= value <= high:
                out[f"{name} {100 * (factor - 1):+.0f} %"] = Trial(s.replace(**{name: value}), t.cycles)
    return out


@dataclass(frozen=True)
class Verdict:
    """How a candidate did.

    Attributes:
        stride: [mm]. spread, halved, finer: relative changes. worst, worst_change: the most harmful 5 % change.
        changes: relative change of stride by check.
    """

    stride: float
    spread: float
    halved: float
    finer: float
    worst: str
    worst_change: float
    changes: Mapping[str, float]

    @property
    def accepted(self) -> bool:
        return bool(self.spread < STEADY and abs(self.halved) < CONVERGED and abs(self.worst_change) <= ROBUST)


def judge(found: Mapping[str, Result]) -> Verdict:
    """Verdict from the results of `checks`; a failed world counts as a change of 100 %."""
    base = found["as it is"]
    changes = {
        n: float(np.nan_to_num((r.stride - base.stride) / base.stride, nan=1.0))
        for n, r in found.items()
        if n != "as it is"
    }
    varied = {n: c for n, c in changes.items() if n.endswith("%")}
    worst = max(varied, key=lambda n: abs(varied[n]))
    return Verdict(base.stride, base.spread, changes.get("step / 2", np.nan), changes.get("cell / 2", np.nan), worst,
                   varied[worst], changes)  # fmt: skip


# drawing --------------------------------------------------------------------------------------------------------------


def draw_maps(
    maps: Sequence[StrideMap], file: Path, *, target: float = TARGET, mark: Settings | None = None, note: str = ""
):
    """Stride maps side by side: lines [mm per cycle], the target's bold, unsteady points crossed out."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    columns = min(3, len(maps))
    rows = -(-len(maps) // columns)
    figure, axes = plt.subplots(
        rows, columns, figsize=(4.6 * columns, 3.9 * rows + 0.5), squeeze=False, layout="constrained"
    )
    levels = np.arange(-60, 61, 5)
    filled = None
    for ax, m in zip(axes.flat, maps, strict=False):
        x, y = np.array(m.x.values) * m.x.scale, np.array(m.y.values) * m.y.scale
        z = np.ma.masked_invalid(m.stride.T)
        filled = ax.contourf(x, y, z, levels=levels, cmap="RdBu_r", extend="both")
        ax.contour(x, y, z, levels=levels, colors="0.4", linewidths=0.4)
        if z.count() and z.min() < target < z.max():
            bold = ax.contour(x, y, z, levels=[target], colors="k", linewidths=2)
            ax.clabel(bold, fmt=f"{target:g} mm", fontsize=9)
        gx, gy = np.meshgrid(x, y)
        steady = (m.spread < STEADY).T
        ax.plot(gx[steady], gy[steady], ".", color="0.15", ms=3)
        ax.plot(gx[~steady], gy[~steady], "x", color="0.15", ms=5)
        if mark is not None:
            ratio = mark.foot_friction_back / mark.foot_friction
            here = [ratio if a.name == "friction_ratio" else getattr(mark, a.name) for a in (m.x, m.y)]
            ax.plot(here[0] * m.x.scale, here[1] * m.y.scale, "*", color="gold", mec="k", ms=14, clip_on=False)
        ax.set(xlabel=m.x.label, ylabel=m.y.label)
    for ax in list(axes.flat)[len(maps) :]:
        ax.set_axis_off()
    if filled is not None:
        figure.colorbar(filled, ax=axes, label="stride [mm per cycle]", shrink=0.8)
    key = "star: where the maps cross; dot: steady; cross: spread over 2 % or failed"
    figure.suptitle(key + (f"; {note}" if note else ""), fontsize=10)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=85)
    plt.close(figure)


# command --------------------------------------------------------------------------------------------------------------


def study(
    scene: str, base: Settings, out: Path, *, cycles: int = 6, fine: bool = False, samples: int = 0, seed: int = 0,
    screened: int = 6, tried: int = 2, device: str = "cpu", threads: int | None = None,
    say: Callable[[str], None] = print,
) -> dict:  # fmt: skip
    """Maps, samples, screening and trials; writes results.json, maps.png and report.json into `out`."""
    store = Store(out / "results.json")
    axes = {n: a.refined() if fine else a for n, a in AXES.items()}
    grids = [(axes[x], axes[y], map_trials(base, axes[x], axes[y], cycles)) for x, y in MAPS]

    def go(trials: Sequence[Trial], what: str) -> list[Result]:
        def show(done: int, total: int):
            print(f"\r{what}: {done} of {total} worlds", end="\n" if done == total else "", file=sys.stderr, flush=True)

        return run_trials(scene, trials, store, device=device, threads=threads, progress=show)

    every = [t for *_, grid in grids for row in grid for t in row]
    go(every, "maps")
    maps = [stride_map(x, y, grid, store) for x, y, grid in grids]
    draw_maps(maps, out / "maps.png", mark=base, note=f"field {1e3 * base.field:g} mT, {base.frequency:g} Hz")
    best = candidates(maps)
    points = sampled(base, samples, cycles, seed)
    found = go([t for _, t in points], "samples")
    near = [(abs(r.stride - TARGET), w, t) for (w, t), r in zip(points, found, strict=True)
            if abs(r.stride - TARGET) <= 3 and r.spread < STEADY]  # fmt: skip
    worlds = len({t.key for t in every})
    say(f"{worlds} worlds on maps, {len(best)} within 3 mm of {TARGET:g} mm and steady, as are their "
        f"neighbours; {len(points)} samples, {len(near)} of them within 3 mm and steady")  # fmt: skip

    pool = [({}, Trial(base, cycles)), *((w, t) for _, w, t in best[:screened])]
    pool += [(w, t) for _, w, t in sorted(near, key=lambda c: c[0])[:screened]]
    screens = [checks(t, DELICATE) for _, t in pool]
    go([t for c in screens for t in c.values()], "screening")
    judged = [(judge({n: store.results[t.key] for n, t in c.items()}), *p) for c, p in zip(screens, pool, strict=True)]
    rows = sorted(judged[1:], key=lambda j: abs(j[0].worst_change))
    for v, w, _ in rows:
        say(f"screened {w}: {v.stride:.1f} mm, worst {v.worst}: {v.worst_change:+.1%}")
    jobs = [(w, checks(t)) for _, w, t in [judged[0], *rows[:tried]]]
    go([t for _, c in jobs for t in c.values()], "trials")
    report: dict = {
        "version": _version(), "settings": base.as_dict(), "cycles": cycles, "target_mm": TARGET,
        "worlds": len(store.results),
        "screened": [
            {"where": w, "stride_mm": v.stride, "worst": v.worst, "worst_change": v.worst_change} for v, w, _ in rows
        ],
        "candidates": [],
    }  # fmt: skip
    for where, names in jobs:
        v = judge({n: store.results[t.key] for n, t in names.items()})
        report["candidates"].append({"where": where, **v.__dict__, "changes": dict(v.changes), "accepted": v.accepted})
        say(f"{where or 'the calibration itself'}: {v.stride:.1f} mm, spread {v.spread:.2%}, step / 2 {v.halved:+.2%}, "
            f"finer mesh {v.finer:+.1%}, worst 5 % change {v.worst}: {v.worst_change:+.1%} -> "
            f"{'accepted' if v.accepted else 'not accepted'}")  # fmt: skip
    _write(out / "report.json", json.dumps(report, indent=1))
    return report


def run(args: argparse.Namespace, say: Callable[[str], None] = print) -> dict:
    """The command `origami-sim study crawler`; its report.

    Raises:
        InputError: counts that make no sense, before anything is computed; what the calibration refuses.
    """
    least = {"cycles": 4, "samples": 0, "seed": 0, "screened": 0, "tried": 0, "threads": 1}
    for name, limit in least.items():
        value = getattr(args, name)
        if value is not None and value < limit:
            raise InputError("is too small", field=f"--{name}", value=value, allowed=f">= {limit}")
    base = scene_settings(scene_module(args.scene), args.calibration).override(args.set, "--set")
    options = {n: getattr(args, n) for n in (*least, "fine", "device")}
    return study(args.scene, base, args.out, **options, say=say)

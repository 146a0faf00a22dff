"""`origami-sim compare`: a recording beside a simulation of what was recorded, in the drive that was recorded."""

import sys
from argparse import Namespace
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from types import ModuleType

import numpy as np

from origami_sim.commands.progress import Bar
from origami_sim.device.device import device_module, modelled
from origami_sim.device.scene import Settings, check_recorded_scene, recorded_model, scene_settings
from origami_sim.errors import InputError
from origami_sim.hypotheses.subject import known_before
from origami_sim.observation.compare import Comparison, compare, plot_overlay
from origami_sim.observation.doubts import doubts, driven
from origami_sim.observation.observe import observe
from origami_sim.recording import Recording, read_recording
from origami_sim.results.printing import print_json
from origami_sim.results.run_folder import check_writable, save_run
from origami_sim.solve.motion.dynamics import Trajectory

FEWEST = 3
"""Frames that are compared at least, as many as a recording has."""


def run(args: Namespace) -> int:
    """The command; returns its exit code."""
    from origami_sim.commands.cli import OK, UNSTABLE

    for name in ("duration", "threshold"):
        value = getattr(args, name)
        if value is not None and not 0 < value < float("inf"):
            raise InputError("must be positive", field=f"--{name}", value=value, allowed="a finite number above 0")
    sidecar = args.sidecar or _sidecar(Path(args.recording))
    given, recording = args.scene, None
    if given is None:
        recording = read_recording(args.recording, sidecar)
        given = recorded_model(recording, "--scene")
    given, calibration = modelled(given, args.calibration, "--model")
    module = device_module(given)
    scene = module.__name__.rpartition(".")[2]
    if not hasattr(module, "replicate"):
        allowed = "pendulum_chain, or a device of yours; 'origami-sim diagnose' takes all"
        raise InputError("this scene cannot replicate a recording", field="--scene", value=scene, allowed=allowed)
    settings = scene_settings(module, calibration).override(args.set, "--set")
    recording = recording or read_recording(args.recording, sidecar)  # what is wrong with names is told before
    check_recorded_scene(recording, scene, "origami-sim diagnose --model")
    if recording.by_step:
        raise InputError(
            "load steps without times cannot be laid over a run",
            file=args.recording,
            field="time",
            allowed="a clock in the table or the sidecar ([time]); origami-sim diagnose compares curves",
        )
    part = _window(args, recording)
    model, parameters, drive, *_ = module.build(settings)
    known_before(settings, recording, (), model, parameters)  # of which a diagnosis would refuse what is wrong, too
    notes = [*recording.metadata.get("notes", ()), *doubts(recording, model, parameters, drive)]
    folder = Path(args.out or "runs/compare")
    check_writable(folder)
    if not args.json:
        print("".join(f"note: {note}\n" for note in notes), end="", flush=True)
    comparison, motion, used = replicated(module, settings, part, args.threshold)
    if comparison is None:
        save_comparison(folder, scene, None, motion, used, part, args.set)
        failures = [str(f) for f in motion.failures]
        drives = driven(recording, drive)
        last = f"{part.times[-1] - part.times[0]:.6g} s of the recording"
        said = [f"{f}; nothing is compared, as the simulation did not reach the end of {last}" for f in failures]
        if drives:
            said.append(f"check the units of the drive: {'; '.join(drives)}")
        print("\n".join(f"origami-sim: {s}" for s in [*said, *motion.notes]), file=sys.stderr)
        if args.json:
            print_json({"name": recording.name, "failures": failures, "drives": drives, "folder": str(folder)})
        return UNSTABLE
    save_comparison(folder, scene, comparison, motion, used, part, args.set)
    plot_overlay(comparison, folder / "overlay.png")
    if args.json:
        print(comparison.to_json())
    else:
        first, last = (comparison.instant(float(part.times[k])) for k in (0, -1))
        print(f"compared from {first} to {last}: {len(part.times)} of {len(recording.times)} frames")
        print(comparison.table())
        print(comparison.sentence())
        print(f"run folder: {folder}")
    return OK


def replicated(
    module: ModuleType, settings: Settings, part: Recording, threshold: float
) -> tuple[Comparison | None, Trajectory, Settings]:
    """A recording beside what a scene makes of it; None where its motion went unstable: what is left of it is no fit.

    Args:
        module: a scene that replicates recordings. threshold: as `compare` takes it.

    Returns:
        The comparison, the motion, and the settings that it was simulated with.

    Raises:
        InputError: what the scene's `replicate`, `observe` and `compare` refuse.
    """
    motion, used = module.replicate(settings, part, progress=Bar("replicate"))
    return (None if motion.failures else compare(part, observe(motion, part), threshold=threshold)), motion, used


def save_comparison(
    folder: Path,
    scene: str,
    comparison: Comparison | None,
    motion: Trajectory,
    used: Settings,
    part: Recording,
    overrides: Sequence[str],
) -> None:
    """Leaves the run folder of a comparison, or of a motion that nothing was compared with."""
    columns: dict[str, np.ndarray] = {}
    if comparison is not None:
        columns["time_s"] = comparison.times
        for c in comparison.channels.values():
            columns |= {f"{c.name}_recorded": c.recorded[:, 0], f"{c.name}_simulated": c.predicted[:, 0]}
    save_run(
        folder,
        motion,
        scene=scene,
        tables={"comparison": columns} if columns else {},
        units={"time_s": "s"},
        settings={**used.as_dict(), "overrides": dict(o.split("=", 1) for o in overrides)},
        replay={"recording": part, "title": scene} if columns else {"title": scene},
    )


def shipped_sidecar(name: str) -> Path:
    """The sidecar that ships with the package by a name."""
    return Path(str(resources.files("origami_sim.scenes") / f"{name}.toml"))


def _sidecar(recording: Path) -> Path | None:
    """The shipped sidecar of a known recording, unless one lies beside the file."""
    if not recording.name:  # a folder, as reading it will say
        return None
    shipped = shipped_sidecar(f"{recording.resolve().parent.name}_{recording.stem}")
    return shipped if not recording.with_suffix(".toml").exists() and shipped.exists() else None


def _window(args: Namespace, recording: Recording) -> Recording:
    """What is compared: --duration of a recording, or all that is left of it, from --start on.

    Raises:
        InputError: the recording has none of it, less than asked for, or fewer than FEWEST frames there.
    """
    length = float(recording.times[-1] - recording.times[0])
    left, step = length - args.start, float(np.median(np.diff(recording.times)))
    if not 0 <= args.start <= length:
        raise InputError(
            "is outside of the recording",
            file=args.recording, field="--start", value=args.start, allowed=f"0 to {length:g} s",
        )  # fmt: skip
    lasting = left if args.duration is None else args.duration
    if lasting > left + length / max(len(recording.times) - 1, 1):  # the last frame may be counted as lasting
        raise InputError(
            "is longer than the recording",
            file=args.recording, field="--duration", value=args.duration, allowed=f"up to {left:g} s",
        )  # fmt: skip
    first = float(recording.times[0]) + args.start
    part = recording.window(first, first + lasting)
    if len(part.times) < FEWEST:
        raise InputError(
            f"{lasting:g} s of the recording hold {len(part.times)} of its frames, which are {step:g} s apart",
            file=args.recording,
            field="--start" if args.duration is None else "--duration",
            value=args.start if args.duration is None else args.duration,
            allowed=f"a window of {FEWEST} frames; if the times are in ms, unit = 'ms' under [time] in the sidecar",
        )
    return part

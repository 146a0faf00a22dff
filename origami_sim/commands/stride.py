"""`origami-sim stride`: how far a walker comes in each cycle of its drive; of a scene, against what is stored."""

import math
from argparse import Namespace
from importlib import import_module
from types import ModuleType

import numpy as np

from origami_sim.commands.progress import Bar
from origami_sim.device.device import PERIODS, device_module
from origami_sim.device.scene import NAMES, motion_of, scene_settings
from origami_sim.errors import InputError
from origami_sim.observation.gait import advances, period, strides, summary
from origami_sim.results.printing import print_json
from origami_sim.results.run_folder import format_table


def run(args: Namespace) -> int:
    """The command; returns the exit code."""
    if args.cycles is not None and args.cycles < 1:
        raise InputError("walking takes whole cycles", field="--cycles", value=args.cycles, allowed=">= 1")
    module = device_module(args.scene)
    if args.scene not in NAMES:
        return _device(args, module)
    if not hasattr(module, "walk"):
        allowed = "crawler, or a device of yours with a periodic drive: my_walker.py, my_walker.toml"
        raise InputError("this scene does not walk", field="scene", value=args.scene, allowed=allowed)
    stored = import_module("origami_sim.studies.strides")
    settings = scene_settings(module, args.calibration).override(args.set, "--set")
    cycles = args.cycles or len(stored.reference(args.scene)["strides_mm"])
    motion = module.walk(settings, cycles=cycles, progress=Bar(args.scene))
    report = stored.check(args.scene, strides(motion, settings.frequency), settings=settings)
    print_json(report.to_json()) if args.json else print(report.text())
    return 0 if report.passed else 1


def _device(args: Namespace, module: ModuleType) -> int:
    """Strides of a device of one's own, in the period of its drive."""
    from origami_sim.commands.cli import _soundness

    settings = scene_settings(module, args.calibration).override(args.set, "--set")
    model, parameters, drive, *_ = module.build(settings)
    lasts = period(drive)
    if lasts is None:
        raise InputError(
            "the drive has no period",
            file=module.__file__,
            field="drive",
            allowed="sine(...) channels, the faster ones harmonics of the slowest, and otherwise constants",
        )
    stated = float(settings["duration"].value) if "duration" in settings else 0.0
    cycles = args.cycles or int(stated / lasts * (1 + 1e-9)) or PERIODS
    rate = float(settings["rate"].value) if "rate" in settings else 60.0
    whole = max(1, math.ceil(rate * lasts))  # frames of a cycle
    name = module.__name__.rpartition(".")[2]
    motion = motion_of(
        settings, model, parameters, drive, duration=cycles * lasts, rate=whole / lasts, progress=Bar(name)
    )
    each = 1e3 * advances(motion, lasts)
    steady = [summary(v) for v in each.T]
    table = {"cycle": np.arange(1, len(each) + 1), **{f"{a}_mm": v for a, v in zip("xyz", each.T, strict=True)}}
    numbers = {"period_s": lasts, "cycles": steady[0]["cycles"]}
    for axis, of in zip("xyz", steady, strict=True):
        numbers |= {f"stride_{axis}_mm": of["mean"], f"spread_{axis}_mm": of["spread"]}
        numbers[f"trend_{axis}_mm_per_cycle"] = of["trend"]
    failures = [str(f) for f in motion.failures]
    if args.json:
        columns = {n: np.asarray(v).tolist() for n, v in table.items()}
        print_json({"columns": columns, "numbers": numbers, "notes": motion.notes, "failures": failures})
        return _soundness(motion)
    x, y, z = (of["mean"] for of in steady)
    print(format_table(table))
    spread, trend = steady[0]["spread"], steady[0]["trend"]
    text = f"stride ({x:z.3f}, {y:z.3f}, {z:z.3f}) mm per cycle of {lasts:g} s, of the centre of mass over "
    many = f"the last {numbers['cycles']:.0f} cycles (along x: spread {spread:.3f} mm, trend {trend:+.3f} mm per cycle)"
    print(text + (many if numbers["cycles"] > 1 else "one cycle"))
    for note in motion.notes:
        print(note)
    return _soundness(motion)

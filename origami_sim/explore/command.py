"""`origami-sim sweep`: a device's settings varied, and what it does at each of them as a table."""

import sys
from argparse import Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from origami_sim.device.device import device_module, lasting
from origami_sim.device.scene import Setting, Settings, scene_settings
from origami_sim.errors import InputError, nearest
from origami_sim.explore.found import Device, Found, Measure, Way, at
from origami_sim.explore.sweep import MOST, ROWS, Sweep, points_of, sweep
from origami_sim.observation.gait import period
from origami_sim.quantities import parsed
from origami_sim.results.printing import print_json
from origami_sim.results.run_folder import check_writable, format_table

NAMED = 8
"""Up to so many creases have a column each; half hides some of a gripper's, double makes tables wider than a page."""


def run(args: Namespace) -> int:
    """The command; returns the exit code."""
    module = device_module(args.device)
    name = module.__name__.rpartition(".")[2]
    settings = scene_settings(module).override(args.set, "--set")
    grid = _grid(settings, args.vary)
    for stated in (text.partition("=")[0].strip() for text in args.set):
        if stated in grid:
            raise InputError("is set and varied at once", field="--set", value=stated, allowed="either --set or --vary")

    def build(**values):
        return module.build(settings.replace(**values))

    folder = Path(args.out or f"runs/sweep_{name}")
    if not (folder / ROWS).is_file():  # an earlier sweep goes on
        check_writable(folder)
    first = at(build, {n: v[0] for n, v in grid.items()})
    columns, pair = (
        measures(first, cycles=not args.equilibrium),
        [part.strip() for part in (args.pareto or "").split(",")],
    )
    if args.pareto:  # told before anything is computed
        _check_front(pair, [n for n in grid if not isinstance(settings[n].value, (str, bool))] + [*columns])
    duration = None
    if not args.equilibrium:
        stated = float(settings["duration"].value) if "duration" in settings else 0.0
        duration = stated or lasting(first.drive)
        if not stated and period(first.drive) is not None:  # each point has its own
            duration = max(lasting(at(build, point).drive) for point in points_of(build, grid))
    way = Way(duration=duration, rate=float(settings["rate"].value) if "rate" in settings else 60.0)
    found = sweep(build, grid, columns, way=way, folder=folder, progress=_progress)
    table = folder / "sweep.parquet"
    pq.write_table(pa.table(found.columns), table.absolute())  # 'a:b' alone would be an address
    picture = None
    if args.pareto:
        picture = found.draw(folder / "pareto.png", *pair)
    _tell(args, found, {"table": str(table), **({"pareto": str(picture)} if picture else {})})
    return 0


def measures(d: Device, *, cycles: bool = False) -> dict[str, Measure]:
    """What is measured of any device: angles of its creases, the largest turn, its mass, and where it goes.

    Args:
        d: the device. cycles: whether it moves, so that a periodic drive has strides [mm per cycle].
    """
    names = list(dict.fromkeys(d.model.name("crease", c) for c in range(len(d.model.creases))))
    out: dict[str, Measure] = {}
    if len(names) <= NAMED:
        out |= {f"{n.replace(' ', '_')}_deg": _folded(n) for n in names}
    elif names:
        out["largest_turn_deg"] = _largest
    out["mass_g"] = _mass
    if len(d.model.contacts):
        out |= {f"moved_{a}_mm": _went(a) for a in "xy"}
        if cycles and period(d.drive) is not None:
            out |= {f"stride_{a}_mm": _stride(a) for a in "xy"}
    return out


def _folded(crease: str) -> Measure:
    return lambda found: float(np.degrees(found.angle(crease)))


def _largest(found: Found) -> float:
    count = len(found.model.creases)
    if found.motion is None:
        turn = found.angles[:count]
    else:  # at any time: what a periodic drive leaves at the end says little
        turn = (found.motion.creases[:, :, 0] - found.motion.creases[0, :, 0]).ravel()
    return float(np.degrees(turn[np.abs(turn).argmax()]))


def _mass(found: Found) -> float:
    return 1e3 * found.mass()


def _stride(axis: str) -> Measure:
    return lambda found: 1e3 * found.stride(axis)


def _went(axis: str) -> Measure:
    return lambda found: 1e3 * found.moved(axis)


def _grid(settings: Settings, vary: Sequence[str]) -> dict[str, list]:
    """Values of the settings that are varied."""
    out: dict[str, list] = {}
    for text in vary:
        name, equals, given = (part.strip() for part in text.partition("="))
        if not equals and ":" in text and text.split(":")[0].strip() not in settings:
            fault = "a range needs the setting that it is of"
            raise InputError(fault, field="--vary", value=text, allowed=f"NAME={text}, of {', '.join(settings)}")
        if not equals or name not in settings:
            near = "" if name in settings else nearest(name, settings)
            fault = f"cannot vary this setting{near}"
            raise InputError(fault, field="--vary", value=text, allowed=", ".join(settings))
        out[name] = _values(settings[name], given)
    return out


def _check_front(pair: Sequence[str], known: Sequence[str]) -> None:
    """Raises InputError unless a front is drawn of two columns, the larger one of which may be the better."""
    if len(pair) != 2:
        raise InputError(
            "a front has two measures", field="--pareto", value=",".join(pair), allowed="mass_g,-moved_x_mm"
        )
    for name in pair:
        if name.removeprefix("-") not in known:
            raise InputError("there is no such measure", field="--pareto", value=name, allowed=", ".join(known))


def _values(setting: Setting, given: str) -> list:
    if isinstance(setting.value, (str, bool)):
        words = [w.strip() for w in given.split(",")]
        return [w.lower() == "true" for w in words] if isinstance(setting.value, bool) else words
    parts = given.split(":")
    if len(parts) == 3 and parts[2].strip().isdecimal() and int(parts[2]) > 1:
        if int(parts[2]) > MOST:
            raise InputError("too many values", field=f"--vary {setting.name}", value=given, allowed=f"up to {MOST}")
        low, high = (float(parsed(p, setting.unit, field=f"--vary {setting.name}")) for p in parts[:2])
        return np.linspace(low, high, int(parts[2])).tolist()
    if len(parts) > 1:
        low, high = parts[0].strip() or "LOW", parts[1].strip() or "HIGH"
        raise InputError(
            "a range is from, to and how many values",
            field=f"--vary {setting.name}",
            value=given,
            allowed=f"{low}:{high}:5 for five values, or a list such as {low},{high}",
        )
    return [float(parsed(p, setting.unit, field=f"--vary {setting.name}")) for p in given.split(",")]


def _progress(part: float) -> None:
    if sys.stderr.isatty():
        sys.stderr.write(f"\r{100 * part:3.0f} %" + ("\n" if part >= 1 else ""))
        sys.stderr.flush()


def _tell(args: Namespace, found: Sweep, files: Mapping[str, str]) -> None:
    columns = {n: v.tolist() for n, v in found.columns.items()}
    if args.json:
        print_json({"columns": columns, "failures": found.failures, "computed": found.computed, **files})
        return
    print(format_table(found.columns))
    for row, why in found.failures.items():
        print(f"row {row} is not found: {why}")
    said = f"{len(found)} points, {found.computed} of them computed now; inputs in SI"
    print("; ".join([said, *(f"{n}: {f}" for n, f in files.items())]))

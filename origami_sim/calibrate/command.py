"""`origami-sim calibrate`: calibrations from measured curves, finite elements and papers, re-creatable by command.

    origami-sim calibrate crease crease_torque/unit075.csv --angle-unit deg --moment-unit 'N mm' --out crease.toml
    origami-sim calibrate relaxation A.csv B.csv --gauge-length 80mm --out vhb.toml
    origami-sim calibrate ring-down swing.csv --angle-unit rad --time-unit s --inertia 1e-4 --out hinge.toml
    origami-sim calibrate deflection beam.csv --field-unit mT --length 17.2mm --thickness 0.84mm --remanence 143mT
    origami-sim calibrate paper article.txt --take 'tape_modulus=determined to be # GPa' --out stated.toml
    origami-sim calibrate bridge --gap 2.54mm --thickness 1.27mm --width 25.4mm --modulus 1.5MPa --out crease_box.toml
    origami-sim calibrate stack --notch 10mm --width 19mm --out crease_notch.toml
    origami-sim calibrate again crease.toml

A file that is not found is sought among the recordings (`scene.recordings_folder`).
"""

import argparse
import math
import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from origami_sim.errors import InputError

if TYPE_CHECKING:  # the parser must not wait for the numerical libraries
    from origami_sim.calibrate.result import Calibration

PROGRAM = "origami-sim calibrate"


OF_A_CREASE = ("crease", "bridge", "ring-down")
"""What writes the law of a crease."""


@dataclass(frozen=True)
class Done:
    """A finished calibration: its content, and the fit for the plot (None where nothing was fitted to a curve)."""

    calibration: "Calibration"
    fit: Any = None


class _Parser(argparse.ArgumentParser):
    """Raises InputError instead of leaving the program, for stored commands."""

    def error(self, message):
        raise InputError(f"cannot read this command ({message})", value=self.prog)


def register(parser: argparse.ArgumentParser) -> None:
    """Adds the subcommands and their options to the parser of `origami-sim calibrate`."""
    parser.add_argument("--json", action="store_true", help="print one JSON object instead of text")
    commands = parser.add_subparsers(dest="calibration", required=True, metavar="HOW", parser_class=type(parser))

    def command(name: str, summary: str) -> argparse.ArgumentParser:
        use = " A device takes the file by Sheet.crease_law(FILE)." if name in OF_A_CREASE else ""
        p = commands.add_parser(name, help=summary, description=f"{summary}.{use}")
        p.add_argument("--json", action="store_true", default=argparse.SUPPRESS, help="print one JSON object")
        if name != "again":
            p.add_argument("--out", metavar="TOML", help="calibration file to write")
            p.add_argument("--plot", metavar="PNG", help="picture of fit and residual to write")
            p.add_argument("--note", metavar="TEXT", help="what to say about the source, e.g. an assumed unit")
        return p

    p = command("crease", "Crease law from a torque-angle curve")
    p.add_argument("curve", help="CSV file")
    p.add_argument("--columns", default="angle_deg,torque", help="angle and moment (default angle_deg,torque)")
    p.add_argument("--angle-unit", help="unit of the angle: rad, deg, ...")
    p.add_argument("--moment-unit", help="unit of the moment that holds the angle: 'N m', 'mN m', 'N mm'")
    p.add_argument("--linear", action="store_true", help="one stiffness instead of a table of 33 moments")
    p.add_argument("--within", metavar="LOW,HIGH", help="part of the curve to use, in the angle's unit")

    p = command("relaxation", "Prony series from stress relaxation, joint over several tests")
    p.add_argument("curves", nargs="+", help="CSV files")
    p.add_argument("--columns", default="time_s,displacement_mm,force_n", help="time, displacement and force")
    p.add_argument("--time-unit", default="s", help="default s")
    p.add_argument("--displacement-unit", default="mm", help="default mm")
    p.add_argument("--force-unit", default="N", help="default N")
    p.add_argument("--gauge-length", required=True, help="with its unit, e.g. 80mm")
    p.add_argument("--terms", type=int, help="terms of the series (default: the least BIC)")

    p = command("ring-down", "Stiffness and viscosity of a crease from a free swing")
    p.add_argument("curve", help="CSV file")
    p.add_argument("--columns", default="time_s,angle_rad", help="time and angle (default time_s,angle_rad)")
    p.add_argument("--time-unit", help="unit of the time")
    p.add_argument("--angle-unit", help="unit of the angle")
    p.add_argument("--inertia", type=float, help="about the crease [kg m^2]; without it only ratios can be known")

    p = command("deflection", "Modulus or remanence of a magnetised beam from its tip deflection against field")
    p.add_argument("curve", help="CSV file")
    p.add_argument("--columns", default="field_mt,tip_deflection_over_length", help="flux density and tip deflection")
    p.add_argument("--field-unit", help="unit of the flux density: T, mT, G")
    p.add_argument("--deflection-unit", help="1 for a deflection over the length, or a unit of length")
    p.add_argument("--length", help="free length, with its unit: 17.2mm")
    p.add_argument("--thickness", help="in the bending plane, with its unit: 0.84mm")
    p.add_argument("--remanence", help="known, to find the modulus: 143mT")
    p.add_argument("--modulus", help="known, to find the remanence: 909kPa; without either only a ratio can be known")
    p.add_argument("--measure", default="across", help="across (along the field, default) or total displacement")
    p.add_argument("--tilted", action="store_true", help="also fit the tilt of the field")

    p = command("paper", "Numbers that a paper states, with their quotes")
    p.add_argument("text", help="text file, e.g. from pdftotext -layout")
    p.add_argument(
        "--take", action="append", default=[], metavar="NAME=WORDS",
        help="name of the setting and the words around the number, which # stands for: 'width=tape # cm wide'; "
        "NAME[UNIT]=... if the unit is not printed behind it; may be given several times",
    )  # fmt: skip

    p = command("bridge", "Crease law of an elastomer bridge by finite elements")
    for name, what in (("gap", "between the patches"), ("thickness", "of the sheet"), ("width", "along the crease")):
        p.add_argument(f"--{name}", required=True, help=f"{what}, with its unit: 2.54mm")
    p.add_argument("--modulus", required=True, help="Young's modulus of the sheet: 1.5MPa")
    p.add_argument("--poisson", type=float, default=0.49, help="of sheet and patches (default 0.49)")
    p.add_argument("--share", type=float, default=0.0, help="C01/(C10+C01) of the sheet (default 0: neo-Hookean)")
    p.add_argument("--patch-modulus", default="rigid", help="Young's modulus of the patches, or rigid (default)")
    p.add_argument("--patch-thickness", default="3.175mm", help="default 3.175mm")
    p.add_argument("--largest", default="100deg", help="end of the table on both sides (default 100deg)")
    p.add_argument("--fineness", type=int, default=2, help="mesh, 1 to 4 (default 2)")

    p = command(
        "stack", "Fold of a notched dielectric-elastomer stack by finite elements (materials of the seed paper)"
    )
    p.add_argument("--notch", required=True, help="length of the notch, with its unit: 10mm")
    p.add_argument("--width", required=True, help="along the notch, with its unit: 19mm")
    p.add_argument("--voltage", default="4kV", help="the largest (default 4kV)")
    p.add_argument("--notch-layers", type=int, default=1, help="tape over the notch (default 1 layer)")
    p.add_argument("--arm-layers", type=int, default=5, help="tape on the arms (default 5 layers)")
    p.add_argument("--active", type=float, default=0.7895, help="electroded share of the width (default 15/19)")
    p.add_argument("--fineness", type=int, default=2, help="mesh, 1 to 4 (default 2)")

    p = command("again", "Repeat the stored command of a calibration and compare the values")
    p.add_argument("file", help="a calibration written by this program")
    p.add_argument("--tolerance", type=float, default=1e-3, help="relative, of each number (default 1e-3)")


def build(arguments: Sequence[str]) -> Done:
    """The calibration of a command line, without writing anything.

    Args:
        arguments: what follows `origami-sim calibrate`, or a stored command split into words.

    Raises:
        InputError: a malformed command, and whatever the calibration itself refuses.
    """
    words = list(arguments)
    if words[:2] == PROGRAM.split():
        words = words[2:]
    parser = _Parser(prog=PROGRAM, add_help=False)
    register(parser)
    args = parser.parse_args(words)
    if args.calibration == "again":
        raise InputError("a stored command cannot be 'again'", field="command", allowed="crease, relaxation, ...")
    return calibrate(args)


def calibrate(args: argparse.Namespace) -> Done:
    """The calibration that parsed arguments ask for; its stored command leaves out --plot and --json."""
    from origami_sim.calibrate import experiment

    command = _command(args)
    if args.calibration == "crease":
        angle_name, moment_name = _names(args.columns, 2)
        path = _found(args.curve)
        data = experiment.read_columns(
            path, {angle_name: (args.angle_unit, "angle"), moment_name: (args.moment_unit, "moment")}
        )
        within = None
        if args.within:
            low, high = (_number(w + str(args.angle_unit), "angle", "--within") for w in _names(args.within, 2))
            within = (low, high)
        angle, moment = data[angle_name], data[moment_name]
        if args.linear:
            fit = experiment.fit_crease(angle, moment, within=within)
        else:
            keep = slice(None) if within is None else (angle >= within[0]) & (angle <= within[1])
            fit = experiment.fit_crease_table(angle[keep], moment[keep])
        source = f"{args.curve}, moment in {args.moment_unit}"
        title = f"Crease from the torque-angle curve {path.name}"
    elif args.calibration == "relaxation":
        time_name, displacement_name, force_name = _names(args.columns, 3)
        holds = [
            experiment.read_hold(
                _found(curve),
                time_unit=args.time_unit,
                displacement_unit=args.displacement_unit,
                force_unit=args.force_unit,
                gauge_length=_number(args.gauge_length, "length", "--gauge-length"),
                columns=(time_name, displacement_name, force_name),
            )
            for curve in args.curves
        ]
        fit = experiment.fit_prony(holds, terms=args.terms)
        source = ", ".join(args.curves)
        title = f"Relaxation of {len(holds)} tests, joint: g(t) = rest + sum weight_i exp(-t / time_i), g(0) = 1"
    elif args.calibration == "ring-down":
        time_name, angle_name = _names(args.columns, 2)
        data = experiment.read_columns(
            _found(args.curve), {time_name: (args.time_unit, "time"), angle_name: (args.angle_unit, "angle")}
        )
        fit = experiment.fit_ring_down(data[time_name], data[angle_name], inertia=args.inertia)
        source, title = args.curve, f"Crease from the free swing {Path(args.curve).name}"
    elif args.calibration == "deflection":
        fit = _deflection(args)
        source, title = args.curve, f"Beam from its deflection against field {Path(args.curve).name}"
    elif args.calibration == "paper":
        from origami_sim.calibrate import stated

        found = stated.stated(_found(args.text), args.take, command=command)
        if args.note:
            found = replace(found, title=f"{found.title} ({args.note})")
        return Done(found)
    elif args.calibration == "stack":
        from origami_sim.calibrate import fe_stack

        notch, width = (_number(getattr(args, n), "length", f"--{n}") for n in ("notch", "width"))
        stack = fe_stack.Stack(notch, notch_layers=args.notch_layers, arm_layers=args.arm_layers, active=args.active)
        volts = _number(args.voltage, "voltage", "--voltage")
        return Done(fe_stack.stack_calibration(stack, width, volts, command=command, fineness=args.fineness))
    else:
        from origami_sim.calibrate import fe

        patch = None
        if args.patch_modulus != "rigid":
            patch = fe.Rubber(_number(args.patch_modulus, "pressure", "--patch-modulus"), args.poisson)
        sheet = fe.Rubber(_number(args.modulus, "pressure", "--modulus"), args.poisson, args.share)
        gap, thickness, width, tall = (
            _number(getattr(args, n), "length", f"--{n.replace('_', '-')}")
            for n in ("gap", "thickness", "width", "patch_thickness")
        )
        bridge = fe.Bridge(gap, thickness, sheet, patch, tall)
        largest = _number(args.largest, "angle", "--largest")
        return Done(fe.crease_calibration(bridge, width, command=command, largest=largest, fineness=args.fineness))
    if args.note:
        source += f" ({args.note})"
    return Done(experiment.calibration(fit, title=title, command=command, source=source), fit)


def _deflection(args: argparse.Namespace):
    """The fit of a deflection-field curve."""
    from origami_sim.calibrate import experiment
    from origami_sim.units import UNITS

    field_name, tip_name = _names(args.columns, 2)
    sizes = {
        name: None if getattr(args, name) is None else _number(getattr(args, name), dimension, f"--{name}")
        for name, dimension in (
            ("length", "length"), ("thickness", "length"), ("remanence", "flux density"), ("modulus", "pressure")
        )
    }  # fmt: skip
    relative = args.deflection_unit is None or args.deflection_unit in UNITS["ratio"]
    if args.deflection_unit is None and not tip_name.endswith("_over_length"):
        allowed = ", ".join(["1 (over the length)", *UNITS["length"]])
        raise InputError("the unit of a column is not stated", file=args.curve, field=tip_name, allowed=allowed)
    data = experiment.read_columns(
        _found(args.curve),
        {
            field_name: (args.field_unit, "flux density"),
            tip_name: (args.deflection_unit or "1", "ratio" if relative else "length"),
        },
    )
    tip, length = data[tip_name], sizes["length"]
    if not relative:
        if length is None:
            raise InputError("the beam's size is needed", field="--length", allowed="its free length, e.g. 17.2mm")
        tip = tip / length
    return experiment.fit_deflection(data[field_name], tip, **sizes, measure=args.measure, tilted=args.tilted)


def run(args: argparse.Namespace) -> int:
    """What the command line does with parsed arguments; returns the exit code (1: `again` found other values)."""
    import json

    from origami_sim.calibrate import experiment, result

    if args.calibration == "again":
        rows = again(args.file, args.tolerance)
        moved = [r for r in rows if not r[3]]
        if args.json:
            print(json.dumps([dict(zip(("name", "stored", "found", "same"), r, strict=True)) for r in rows]))
        else:
            for name, stored, found, _ in moved:
                print(f"{name}: stored {stored:.6g}, found {found:.6g}")
            print(f"{len(rows) - len(moved)} of {len(rows)} numbers as stored, within {args.tolerance:g}")
        return 1 if moved else 0
    if args.out:
        _check_ours(args.out)
    done = calibrate(args)
    if args.plot and done.fit is None:
        raise InputError("there is no fit to draw", field="--plot", value=args.plot)
    if args.out:
        result.write_calibration(args.out, done.calibration)
    if args.plot:
        experiment.plot_fit(done.fit, args.plot, title=done.calibration.title)
    if args.json:
        values = {
            q.name: {"value": q.value, "unit": q.unit, "interval": q.interval} for q in done.calibration.quantities
        }
        print(json.dumps({"values": values, "warnings": done.calibration.warnings}))
    else:
        print(experiment.summary(done.calibration))
        if args.out and args.calibration in OF_A_CREASE:
            print(f"{args.out} is the law of a crease: sheet.crease_law({args.out!r}) in a device; --calibration "
                  "of a scene takes the settings that it has")  # fmt: skip
    return 0


def _check_ours(path: str) -> None:
    """Refuses, before anything is computed, to write over a file that is no calibration of this program."""
    from origami_sim.calibrate.result import read_result

    if Path(path).exists():
        try:
            read_result(path)
        except InputError:
            raise InputError(
                "exists, and is not a calibration that this program wrote", file=path, field="--out",
                allowed="a new file, or an earlier calibration",
            ) from None  # fmt: skip


def again(file: str | Path, tolerance: float = 1e-3) -> list[tuple[str, float, float, bool]]:
    """Repeats the stored command: (name, stored, found, same) of every number; tables knot by knot.

    `same` compares relatively; a table with its largest knot.
    """
    from origami_sim.calibrate import result

    stored = result.read_result(file)
    found = build(shlex.split(stored.command)).calibration
    rows = []
    for q in stored.quantities:
        if isinstance(q.value, (str, bool)):
            continue
        old = q.value if isinstance(q.value, tuple) else (q.value,)
        new: Any = found[q.name].value
        new = new if isinstance(new, tuple) else (new,)
        if len(old) != len(new):
            raise InputError("the table has another length now", file=file, field=q.name, value=len(new))
        size = max(map(abs, old)) or 1.0
        for k, (a, b) in enumerate(zip(old, new, strict=True)):
            name = q.name if len(old) == 1 else f"{q.name}_{k:02d}"
            rows.append((name, a, b, math.isclose(a, b, rel_tol=0, abs_tol=tolerance * size)))
    return rows


def _command(args: argparse.Namespace) -> str:
    words = [PROGRAM, args.calibration]
    given = {"crease": "curve", "ring-down": "curve", "deflection": "curve", "relaxation": "curves", "paper": "text"}
    positional = [given[args.calibration]] if args.calibration in given else []
    for name in positional:
        value = getattr(args, name)
        words += map(shlex.quote, value if isinstance(value, list) else [value])
    skip = {*positional, "calibration", "json", "plot", "command", "action"}
    for name, value in vars(args).items():
        if name in skip or value is None or value is False:
            continue
        option = "--" + name.replace("_", "-")
        for item in value if isinstance(value, list) else [value]:
            words.append(option if item is True else f"{option}={shlex.quote(str(item))}")
    return " ".join(words)


def _names(text: str, count: int) -> list[str]:
    names = [n.strip() for n in text.split(",")]
    if len(names) != count or not all(names):
        raise InputError(f"needs {count} entries, separated by commas", field="columns", value=text)
    return names


def _number(text: str, dimension: str, option: str) -> float:
    from origami_sim.units import UNITS, unit_factor

    match = re.fullmatch(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)", str(text).strip())
    if not match or not match[2] or not math.isfinite(float(match[1])):
        allowed = ", ".join(f"NUMBER{u}" for u in UNITS[dimension])
        raise InputError("needs a number with its unit", field=option, value=text, allowed=allowed)
    return float(match[1]) * unit_factor(match[2], dimension=dimension, field=option)


def _found(path: str) -> Path:
    from origami_sim.device.scene import recordings_folder

    given = Path(path)
    folder = recordings_folder()
    if not given.exists() and not given.is_absolute() and folder is not None:
        for place in (folder, folder.parent):  # a paper's text may lie beside the recordings
            if (place / given).exists():
                return place / given
    return given

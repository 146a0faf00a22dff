"""`origami-sim`: run scenes, replay runs, compare and diagnose recordings, list effects, check strides.

Exit codes: 0 done; 1 done, but the answer is no (a regression changed, a pattern missed its target angles); 2 bad
input, nothing written over; 3 a world went unstable; 10 to 17 the verdict of a diagnosis; 130 interrupted.
"""

import argparse
import functools
import gc
import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from origami_sim import __version__
from origami_sim.commands.progress import Bar
from origami_sim.errors import InputError
from origami_sim.files import PATTERNS
from origami_sim.results.printing import print_json as _print_json

if TYPE_CHECKING:  # the parser must not wait for the numerical libraries
    from origami_sim.device.scene import Outcome
    from origami_sim.solve.motion.dynamics import Trajectory

OK, NO, BAD_INPUT, UNSTABLE, INTERRUPTED = 0, 1, 2, 3, 130


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one sentence, as everything else here does."""

    def error(self, message: str):
        print(f"origami-sim: {InputError(f'{message}; see {self.prog} --help')}", file=sys.stderr)
        sys.exit(BAD_INPUT)


_DIAGNOSE_HELP = """\
writes report.html, diagnosis.json, patched.toml (for --calibration; of a scene or a design file for --model, too) and a
replay; data and patch as soon as the verdict stands. Interrupted, the same command goes on where it stopped.

exit codes: 10 ADEQUATE (nothing is found missing), 11 PARAMETER (refitting is enough), 12 MEASUREMENT (the measurement
makes the difference), 13 MECHANISM (an effect is missing), 14 TIE (several explain it alike), 15 SEVERAL (more than one
is missing), 16 UNKNOWN (none of the catalogue), 17 UNTESTABLE (these recordings cannot tell); 2 bad input, 130
interrupted

how well settings are known, so that refitting them is no free lunch: --prior, else [priors] of the sidecar, else the
`uncertainty` of the calibration; all other settings are taken as exact"""


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="origami-sim", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def command(name: str, action: Callable, summary: str, example: str) -> argparse.ArgumentParser:
        p = commands.add_parser(
            name,
            help=summary,
            description=summary + ".",
            epilog=f"example: {example}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        p.set_defaults(action=action)
        p.add_argument("--json", action="store_true", help="print one JSON object instead of text")
        return p

    summary = "Simulate a device, or fold a crease pattern, and leave its run folder"
    p = command("run", _run, summary, "origami-sim run box --set gap=2.54mm; origami-sim run crane.svg --set size=15cm")
    names = ", ".join(import_module("origami_sim.scenes").NAMES)
    yours = "or a device of yours: my_flap.py, package.module:build, my_flap.toml"
    p.add_argument("scene", help=f"{names}; a pattern (.svg, .fold, .dxf, .cp, .opx); {yours}")
    p.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="override a setting (with unit)")
    p.add_argument("--calibration", metavar="TOML", help="a calibration file instead of the scene's own")
    p.add_argument("--settings", action="store_true", help="list the settings and their sources, and stop")
    p.add_argument("--panels", choices=("elastic", "rigid"), help="bars and bending lines, or rigid bodies on hinges")
    p.add_argument("--quasistatic", action="store_true", help="equilibria along time, no inertia: creep, slow drives")
    what = "pattern: panels keep each other off on the whole way, or never (default: where they would pass)"
    p.add_argument("--touch", action=argparse.BooleanOptionalAction, default=None, help=what)
    p.add_argument("--until", type=float, metavar="SECONDS", help="of a quasi-static motion: hold it on until then")
    p.add_argument("--accuracy", type=float, metavar="X", help="halve the step until angles [rad] are that exact")
    p.add_argument("--out", metavar="FOLDER", help="run folder (default runs/SCENE)")

    p = command("show", _show, "Draw a device with its numbers, for sidecars", "origami-sim show my_flap.py")
    p.add_argument("device", help="a scene, my_flap.py, package.module:build or my_flap.toml")
    p.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="override a setting")
    p.add_argument("--out", metavar="PNG", help="the picture (default runs/show/DEVICE.png)")
    p.add_argument("--save", metavar="TOML", help="write the whole design as a file that run and show read")

    example = "origami-sim sweep my_flap.py --vary gap=1mm,2mm"
    sweeping = command("sweep", _sweep, "Vary settings of a device and tabulate what it does", example)
    sweeping.add_argument("device", help="a scene, my_flap.py, package.module:build or my_flap.toml")
    what = "gap=1mm,2mm,4mm or gap=1mm:4mm:7 (seven values from 1 to 4 mm); again for further settings"
    sweeping.add_argument("--vary", action="append", default=[], required=True, metavar="NAME=VALUES", help=what)
    sweeping.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="override a setting")
    sweeping.add_argument("--equilibrium", action="store_true", help="where it comes to rest, instead of its motion")
    sweeping.add_argument("--pareto", metavar="A,B", help="draw the front of two columns: mass_g,-largest_turn_deg")
    sweeping.add_argument("--out", metavar="FOLDER", help="table, and what resumes it (default runs/sweep_DEVICE)")

    p = command("replay", _replay, "Open the replay of a run, or take its picture", "origami-sim replay runs/box")
    p.add_argument("run", help="run folder or .rrd file")
    p.add_argument("--screenshot", metavar="PNG", help="write a picture instead of opening the viewer")
    p.add_argument("--time", type=float, help="simulated time of the picture [s] (default: most folded)")

    from origami_sim.commands import export

    export.register(command("export", export.export, export.SUMMARY, export.EXAMPLE))

    p = command(
        "compare",
        _compare,
        "Compare a recording with the scene pendulum_chain or a device of yours (diagnose takes any)",
        "origami-sim compare double.csv --scene pendulum_chain --duration 5",
    )
    p.add_argument("recording", help="CSV or Parquet file")
    what = "scene or device that models what was recorded: pendulum_chain, my_flap.py"
    p.add_argument("--scene", "--model", metavar="SCENE", help=f"{what} (default: what the sidecar names)")
    _stated(p)
    p.add_argument("--start", type=float, default=0.0, help="seconds after the first sample (default 0)")
    p.add_argument("--duration", type=float, help="seconds compared (default: what is left of the recording)")
    p.add_argument(
        "--threshold", type=float, default=5.0, help="parting, in standard deviations of the noise (default 5)"
    )
    p.add_argument("--out", metavar="FOLDER", help="run folder (default runs/compare)")

    p = command(
        "diagnose",
        _diagnose,
        "Find what makes a model and recordings of the real object differ",
        "origami-sim diagnose double.csv --model pendulum_chain --prior mass_1=1% --prior viscosity_1=20%",
    )
    p.epilog = f"{p.epilog}\n\n{_DIAGNOSE_HELP}"
    _recorded(p)
    p.add_argument("--suspects", metavar="A,B", help="suspect only these effects (default: all that can act)")
    p.add_argument(
        "--thorough", action="store_true", help="more frames, suspects and combinations; several times as long"
    )
    p.add_argument(
        "--limit",
        type=float,
        metavar="S",
        help="seconds after which the verdict is on what has been fitted (default 300, thorough 3000)",
    )
    p.add_argument("--out", metavar="FOLDER", help="where everything is written (default runs/diagnose)")

    p = command(
        "estimate",
        _estimate,
        "Fit numbers of a device, and effects that are known to act, to recordings of it",
        'origami-sim estimate swing.csv --model my_flap.py --prior stiffness=30% --effect "crease_friction at hinge1"',
    )
    _recorded(p)
    p.add_argument(
        "--effect", action="append", default=[], metavar="NAME", help="an effect that acts besides, such as air_drag"
    )
    p.add_argument("--out", metavar="FOLDER", help="where everything is written (default runs/estimate)")
    p.set_defaults(thorough=False, limit=None)

    p = command(
        "study",
        _study,
        "Batch studies: stride maps of the crawler, all combinations of the bi-fold",
        "origami-sim study crawler --samples 64; origami-sim study bifold",
    )
    _studies(p)

    from origami_sim.calibrate.command import register

    summary = "Obtain parameters from measured curves or finite elements"
    p = commands.add_parser(
        "calibrate",
        help=summary,
        description=summary + ".",
        epilog="example: origami-sim calibrate --help lists the ways",
    )
    p.set_defaults(action=_calibrate)
    register(p)

    p = command("effects", _effects, "Print the catalogue of physical effects", "origami-sim effects crease")
    p.add_argument("name", nargs="?", help="one effect, in full")

    p = command(
        "stride",
        _stride,
        "Stride per cycle of a device; of the crawler, against the stored reference and the paper",
        "origami-sim stride my_walker.py --cycles 8; origami-sim stride crawler",
    )
    p.add_argument("scene", nargs="?", default="crawler", help="crawler (default), my_walker.py or my_walker.toml")
    p.add_argument("--cycles", type=int, help="cycles to walk (default: those of the reference, of the device, or 5)")
    p.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="override a setting")
    p.add_argument("--calibration", metavar="TOML", help="numbers of the model, such as patched.toml of a device")

    p = command(
        "demo",
        _demo,
        "Box, crawler, a folded pattern and a recording, with replays and a report",
        "origami-sim demo --out runs/demo",
    )
    p.add_argument("--out", default="runs/demo", metavar="FOLDER", help="where the run folders go (default runs/demo)")
    return parser


def _stated(p: argparse.ArgumentParser) -> None:
    """Options that state the numbers of a device, and the columns of its recordings."""
    p.add_argument("--calibration", metavar="TOML", help="numbers of the model, such as patched.toml of a device")
    p.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="override a setting")
    p.add_argument(
        "--sidecar", metavar="TOML", help="what the columns mean (default: beside the recording, else shipped)"
    )


def _recorded(p: argparse.ArgumentParser) -> None:
    """Options of what is told of a device by recordings."""
    p.add_argument("recordings", nargs="+", metavar="RECORDING", help="tables, a folder or a listing of one object")
    what = "a scene, its calibration (TOML), or my_flap.py (default: what the sidecar names)"
    p.add_argument("--model", metavar="SCENE", help=what)
    _stated(p)
    p.add_argument(
        "--prior",
        action="append",
        default=[],
        metavar="NAME=SD",
        help="how well a setting is known (0.5mm, 5%%, or SI), or the alignment (clock_delay.clock_delay=5ms)",
    )
    p.add_argument(
        "--segment", type=float, metavar="S", help="seconds simulated from one start (default: what can be predicted)"
    )
    p.add_argument(
        "--start-at",
        choices=("rest", "fit"),
        help="simulate from rest, or fit every start (default: as recorded)",
    )
    p.add_argument(
        "--panels",
        choices=("auto", "rigid", "elastic"),
        default="auto",
        help="rigid bodies, or bars that bend (default: rigid where bending could not show)",
    )
    p.add_argument(
        "--motion",
        choices=("auto", "dynamic", "quasistatic"),
        default="auto",
        help="with inertia, or equilibria along time (default: as stated, or the latter where inertia could not show)",
    )


def _studies(parser: argparse.ArgumentParser) -> None:
    """The studies and their options."""
    commands = parser.add_subparsers(dest="scene", required=True, metavar="SCENE")

    def command(name: str, summary: str, example: str) -> argparse.ArgumentParser:
        p = commands.add_parser(name, help=summary, description=summary + ".", epilog=f"example: {example}")
        p.add_argument("--json", action="store_true", default=argparse.SUPPRESS, help="print one JSON object")
        p.add_argument("--out", type=Path, default=Path(f"runs/study_{name}"), help=f"default runs/study_{name}")
        p.add_argument("--calibration", metavar="TOML", help="a calibration file instead of the scene's own")
        p.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="override a setting")
        return p

    summary = "Stride maps over the crawler's unknowns, and a set that is steady, converged and robust"
    p = command("crawler", summary, "origami-sim study crawler --samples 64 --set cell=3.8mm")
    p.add_argument("--cycles", type=int, default=6, help="cycles of the field (default 6); the second half counts")
    p.add_argument("--fine", action="store_true", help="twice as many values on each axis")
    p.add_argument(
        "--samples", type=int, default=64, help="points over all unknowns at once (default 64; 0: only maps)"
    )
    p.add_argument("--seed", type=int, default=0, help="of the samples (default 0)")
    p.add_argument("--screened", type=int, default=6, help="points to screen, of maps and samples each (default 6)")
    p.add_argument("--tried", type=int, default=2, help="points to try in full (default 2)")
    p.add_argument("--device", default="cpu", help="cpu (default) or cuda:0")
    p.add_argument("--threads", type=int, help="CPU threads (default: all cores)")

    summary = "Mass, energy and fold angle of all combinations of the bi-fold (Tables 5 and 6 of the seed paper)"
    command("bifold", summary, "origami-sim study bifold --set section=plate")


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line and exits with its code."""
    args = _parser().parse_args(arguments)
    try:
        for given in sys.argv[1:] if arguments is None else arguments:
            if "\0" in given:  # no file can be called so
                raise InputError("an argument holds a null byte", value=given)
        code = args.action(args)
    except InputError as e:
        print(f"origami-sim: {e}", file=sys.stderr)
        code = BAD_INPUT
    except KeyboardInterrupt as e:
        print(f"origami-sim: {str(e) or 'interrupted; earlier results are untouched.'}", file=sys.stderr)
        code = INTERRUPTED
    except BrokenPipeError:  # the reader of our output left; nothing more can be said there, not even at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = OK
    except OSError as e:  # a disk that is full, a folder that must not be written
        print(f"origami-sim: {InputError(e.strerror or str(e), file=e.filename)}", file=sys.stderr)
        code = BAD_INPUT
    sys.exit(code)


# commands ------------------------------------------------------------------------------------------------------------


def _run(args) -> int:
    from origami_sim.commands import again
    from origami_sim.device.device import KEPT, device_module
    from origami_sim.device.scene import scene_settings
    from origami_sim.results.rescue import not_over_a_sound_run
    from origami_sim.results.run_folder import check_writable

    given = Path(args.scene)
    pattern = given.suffix.lower() in PATTERNS or (given.suffix.lower() not in (".py", ".toml", "") and given.is_file())
    module = import_module("origami_sim.folding.command") if pattern else device_module(args.scene)
    name = Path(args.scene).stem if pattern else module.__name__.rpartition(".")[2]
    if pattern:
        module.check(args)
    elif args.touch is not None:
        states = "Sheet.touch() in the device, touch in its design file, --set touch=on for scenes that have it"
        raise InputError("only a pattern leaves this open", field="--touch", value=args.touch, allowed=states)
    settings = scene_settings(module, args.calibration).override(args.set, "--set")
    if args.calibration and not args.json and (said := again.partly(module, args.calibration)):
        print(said)
    settings = settings.with_panels(args.panels or settings.panels)
    until = settings.until if args.until is None else args.until
    settings = settings.with_motion("quasistatic" if args.quasistatic else settings.motion, until)
    if args.accuracy is not None:
        settings = settings.with_accuracy(args.accuracy)
    if args.settings:
        from origami_sim.units import of_unit

        if args.json:
            _print_json({n: s.__dict__ for n, s in settings.items()})
        else:
            for s in settings.values():
                limits = f", {s.range[0]:g} to {s.range[1]:g}" if s.range else ""
                value = f"{s.value:g}" if isinstance(s.value, float) else s.value
                print(f"{s.name} = {of_unit(str(value), s.unit)}{limits}\n    {s.meaning}; {s.source}")
        return OK
    if pattern:
        return module.run(args, settings, Bar(name))
    folder = Path(args.out or (args.scene if module.__file__ == str(given / KEPT) else f"runs/{name}"))
    check_writable(folder)
    outcome = module.run(settings, progress=Bar(name))
    folder = not_over_a_sound_run(folder, outcome.trajectory)
    design, why = again.design_of(module, settings, outcome)
    kept = _save(folder, name, outcome, settings.as_dict(), args.set, again.origin(args, module, settings, why))
    again.keep(kept, design)
    if hasattr(module, "draw") and kept == folder:
        module.draw(settings, outcome, folder)
    _tell(args, outcome, kept)
    return _soundness(outcome.trajectory) or (OK if kept == folder else BAD_INPUT)


def _sweep(args) -> int:
    from origami_sim.explore import command

    return command.run(args)


def _replay(args) -> int:
    from origami_sim.view.viewer import open_replay, screenshot

    path = Path(args.run)
    if path.is_dir():
        path = path / "replay.rrd"
    if args.screenshot:
        taken = screenshot(path, args.screenshot, time=args.time)
        if args.json:
            _print_json({"picture": str(args.screenshot) if taken else None})
        return OK if taken else NO
    if args.time is not None:
        raise InputError("is the time of a picture", field="--time", value=args.time, allowed="with --screenshot PNG")
    viewer = open_replay(path)
    if args.json:
        _print_json({"replay": str(path), "viewer_process": viewer.pid})
    return OK


def _compare(args) -> int:
    from origami_sim.commands import compare

    return compare.run(args)


def _diagnose(args) -> int:
    gc.disable()  # what is loaded stays: looking through it for what could go, now or later, takes half a second
    from origami_sim.diagnose import command

    gc.freeze()
    gc.enable()
    return command.run(args)


def _estimate(args) -> int:
    from origami_sim.estimation import command

    return command.run(args)


def _calibrate(args) -> int:
    from origami_sim.calibrate import command

    return command.run(args)


def _study(args) -> int:
    module = import_module(f"origami_sim.studies.{'crawler_maps' if args.scene == 'crawler' else 'bifold_tables'}")
    report = module.run(args, functools.partial(print, file=sys.stderr if args.json else sys.stdout))
    if args.json:
        _print_json(report)
    return NO if any(s["failures"] for s in report.get("sets", {}).values()) else OK


def _effects(args) -> int:
    from origami_sim.commands import catalogue

    _print_json(catalogue.entries(args.name)) if args.json else print(catalogue.text(args.name))
    return OK


def _show(args) -> int:
    from origami_sim.commands import show

    found = show.run(args)
    _print_json(found) if args.json else print(show.text(found))
    return OK


def _stride(args) -> int:
    from origami_sim.commands import stride

    return stride.run(args)


def _demo(args) -> int:
    from origami_sim.commands import demo

    return demo.run(args)


# parts ---------------------------------------------------------------------------------------------------------------


def _save(
    folder: Path, scene: str, outcome: "Outcome", settings: dict, overrides: list[str], device: dict
) -> Path | None:
    """Saves a run and returns where: elsewhere, or nowhere, if the disk is full."""
    from origami_sim.results.rescue import save_somewhere

    return save_somewhere(
        folder,
        outcome.trajectory,
        note=lambda sentence: print(f"origami-sim: {sentence}", file=sys.stderr),
        scene=scene,
        tables=outcome.tables,
        units=outcome.units or _units(outcome.tables),
        settings={**settings, "overrides": dict(o.split("=", 1) for o in overrides), "device": device},
    )


def _units(tables: dict) -> dict[str, str]:
    """Units from column names such as field_mT."""
    known = {"deg", "mT", "mm", "s", "rad", "T", "V", "N", "J"}
    names = {n for t in tables.values() for n in t}
    return {n: n.rsplit("_", 1)[1] for n in names if "_" in n and n.rsplit("_", 1)[1] in known}


def _tell(args, outcome: "Outcome", folder: Path | None) -> None:
    from origami_sim.results.run_folder import format_table
    from origami_sim.solve.motion import accuracy

    motion = outcome.trajectory
    if args.json:
        _print_json(
            {
                "numbers": outcome.numbers,
                "folder": None if folder is None else str(folder),
                "dt": motion.dt,
                "energy_error": accuracy.worst(motion.energy_error),
                "crossing_pairs": int(motion.crossings().sum()),
                "notes": motion.notes,
                "failures": [str(f) for f in motion.failures],
            }
        )
        return
    for table in outcome.tables.values():
        print(format_table(table, outcome.units or _units(outcome.tables)))
    for sentence in [*outcome.summary, *motion.notes]:
        print(sentence)
    end, (most, when) = int(motion.crossings().sum()), motion.most_crossings()
    through = f"{end} pairs of triangles through each other" + f" ({most} at t = {when:.3g} s)" * (most > end)
    said = [str(motion.step), accuracy.sentence(motion), through, f"{motion.wall:.1f} s of computing"]
    print(f"{'; '.join(filter(None, said))}; run folder: {folder or 'none'}")


def _soundness(motion: "Trajectory") -> int:
    for failure in motion.failures:
        print(f"origami-sim: {failure}", file=sys.stderr)
    return UNSTABLE if motion.failures else OK


if __name__ == "__main__":
    main()

"""`origami-sim export`: a run as a file for other programs."""

import argparse
import re
from pathlib import Path

from origami_sim.commands.progress import Bar
from origami_sim.errors import InputError

SUMMARY = "Write a run as glTF, OBJ, STL, FOLD or a moving picture"
EXAMPLE = "origami-sim export runs/box --to box.webp; origami-sim export runs/box --to box.fold --at 1.5"


def register(parser: argparse.ArgumentParser) -> None:
    """The options of `export`."""
    add = parser.add_argument
    add("run", help="run folder")
    add(
        "--to",
        required=True,
        metavar="FILE",
        help=".glb, .webp, .gif, .mp4 (all frames); .obj, .stl, .fold, .png (one)",
    )
    add("--at", type=float, metavar="SECONDS", help="time of the one frame (default: most folded)")
    add("--start", type=float, metavar="SECONDS", help="leave out what was before")
    add("--stop", type=float, metavar="SECONDS", help="leave out what came after")
    add("--world", type=int, default=0, help="of a batch (default 0)")
    add("--colour", choices=("kind", "strain"), help="of pictures: panels by kind (default) or by their strain")
    add("--size", metavar="WxH", help="of pictures, in pixels (default 640x400)")
    add("--seconds", type=float, help="how long a moving picture lasts (default: as the motion, 2 to 6)")
    add("--no-labels", action="store_true", help="leave time, drive and scale out of pictures")


def export(args: argparse.Namespace) -> int:
    """Runs the command and returns its exit code."""
    from origami_sim.commands.cli import OK, _print_json
    from origami_sim.results.run_folder import load_run
    from origami_sim.view.export import ALL_FRAMES, SUFFIXES
    from origami_sim.view.export import export as write

    if Path(args.to).suffix.lower() not in SUFFIXES:
        raise InputError("no such format", field="--to", value=args.to, allowed=", ".join(SUFFIXES))
    how = {}
    if args.size is not None:
        found = re.fullmatch(r"(\d{1,5})x(\d{1,5})", args.size)
        if not found:
            raise InputError("is width x height in pixels", field="--size", value=args.size, allowed="such as 640x400")
        how |= {"width": int(found[1]), "height": int(found[2])}
    how |= {n: v for n, v in (("colour", args.colour), ("seconds", args.seconds)) if v is not None}
    if args.no_labels:
        how["labels"] = False
    run = load_run(args.run)
    file = write(
        run,
        args.to,
        at=args.at,
        start=args.start,
        stop=args.stop,
        world=args.world,
        title=str(run.manifest["scene"]),
        progress=Bar(Path(args.to).name),
        **how,
    )
    size = file.stat().st_size
    failed = [str(f) for f in run.trajectory.failures if f.world == args.world]
    if args.json:
        _print_json({"file": str(file), "bytes": size, "failures": failed})
    else:
        moving = Path(args.to).suffix.lower() in ALL_FRAMES and args.stop is None
        for sentence in failed:
            print(f"note: {'it ends where the run failed' if moving else 'the run failed'}: {sentence}")
        print(f"{file}: {size / 1024:.0f} KiB")
    return OK

"""The crawler's free strip, a shell, on finer and finer meshes, beside the chain in a plane (planar_crawler.py).

    python benchmarks/free_crawler.py --cell 5 2.5 1.25
    python benchmarks/free_crawler.py --cell 5 2.5 1.25 --set anticlastic=false

The chain curves across as the strip does, unless that is in plane strain.

Minutes to tens of minutes per mesh. Steps are 1.2 times those that are taken by themselves, within their bound;
`--longer 1` takes those.
"""

import argparse
import time

import planar_crawler

from origami_sim.device.scene import read_calibration
from origami_sim.observation.gait import strides
from origami_sim.scenes import crawler
from origami_sim.solve.timestep import stable_step

LONGER = 1.2


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--calibration", default="crawler")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--cell", type=float, nargs="+", default=[5.0, 2.5], help="[mm]")
    parser.add_argument("--across", type=int, help="cells side by side, an even number; default: about as wide as long")
    parser.add_argument("--cycles", type=int, default=2)
    parser.add_argument("--longer", type=float, default=LONGER, help="step over the one that is taken by itself")
    args = parser.parse_args(argv)
    if args.across:  # no setting: what a mesh is coarse across matters to convergence alone
        crawler.Strip.across = lambda strip, s: args.across
    stated = read_calibration(args.calibration).override(args.set, "--set").replace(guided=False)
    values, lib = {n: stated[n].value for n in stated.as_dict()}, planar_crawler.library()
    for cell in args.cell:
        s = stated.replace(cell=1e-3 * cell)
        model, parameters, _ = crawler.build(s)
        dt = args.longer * stable_step(model, parameters).dt
        crawler.walk(s.replace(frequency=20.0), cycles=1, dt=dt)  # compiles
        began = time.process_time()
        motion = crawler.walk(s, cycles=args.cycles, rate=20.0, dt=dt)
        spent = (time.process_time() - began) / args.cycles
        aside = abs(motion.x[..., 1].mean(axis=1)).max()
        planar = {"relaxing": True, "free": bool(s.anticlastic)}
        chain = planar_crawler.walk(lib, values, cell=s.cell, cycles=args.cycles, **planar)
        for failure in motion.failures:
            print(failure)
        walked, beside = (" ".join(f"{1e3 * x:.2f}" for x in each) for each in (strides(motion, s.frequency), chain))
        print(
            f"cells of {cell:g} mm ({len(model.position)} nodes): {walked} mm, chain {beside} mm; "
            f"{1e3 * aside:.3f} mm aside; step {1e6 * dt:.2f} us, {spent:.0f} s per cycle",
            flush=True,
        )


if __name__ == "__main__":
    main()

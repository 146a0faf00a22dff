"""What the crawler's stride hangs on, by the chain in a plane (planar_crawler.py), for which a walk takes a second.

    python benchmarks/crawler_unknowns.py [--out runs/crawler_unknowns] [--cell 2.5] [--samples 100]

The maps of `origami-sim study crawler` around the default, changes of 5 % of every parameter, and points of a Latin
hypercube over all unknowns on two meshes. Without adhesion, which the chain lacks.
"""

import argparse
from pathlib import Path

import numpy as np
from planar_crawler import library, walk

from origami_sim.scene import Settings, read_calibration
from origami_sim.studies.crawler_maps import (
    AXES,
    MAPS,
    STEADY,
    TARGET,
    VARIED,
    StrideMap,
    draw_maps,
    map_trials,
    sampled,
)

CYCLES = 6


def strides(lib, s: Settings, cell: float) -> np.ndarray:
    """Strides of the second half of the cycles [mm]; nan for a chain that broke."""
    values = {n: s[n].value for n in s.as_dict()}
    with np.errstate(all="ignore"):
        found = 1e3 * walk(lib, values, cell=1e-3 * cell, cycles=CYCLES)[CYCLES // 2 :]
    return found if np.all(np.abs(found) < 1e3) else np.full(len(found), np.nan)


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--calibration", default="crawler")
    parser.add_argument("--cell", type=float, default=2.5, help="[mm]")
    parser.add_argument("--samples", type=int, default=100, help="points of the hypercube")
    parser.add_argument("--only-maps", action="store_true")
    parser.add_argument("--out", type=Path, default=Path("runs/crawler_unknowns"))
    args = parser.parse_args(argv)
    base, lib = read_calibration(args.calibration), library()
    args.out.mkdir(parents=True, exist_ok=True)
    stride = strides(lib, base, args.cell).mean()
    print(f"as it is: {stride:.2f} mm")
    for name in () if args.only_maps else VARIED:
        if base[name].value and name != "adhesion":
            low, high = (
                strides(lib, base.replace(**{name: f * base[name].value}), args.cell).mean() / stride - 1
                for f in (0.95, 1.05)
            )
            print(f"{name} -5 %, +5 %: {low:+.1%}, {high:+.1%}", flush=True)
    maps = []
    for x, y in ((AXES[a], AXES[b]) for a, b in MAPS if "adhesion" not in (a, b)):
        trials = map_trials(base, x, y, CYCLES)
        found = np.array([[strides(lib, t.settings, args.cell) for t in row] for row in trials])
        mean = found.mean(axis=-1)
        maps.append(StrideMap(x, y, trials, mean, found.std(axis=-1) / np.maximum(np.abs(mean), 1e-9)))
        draw_maps(maps, args.out / "maps.png", mark=base, note=f"chain in a plane, cells of {args.cell:g} mm")
        print(f"{x.name}, {y.name}: {mean.size} points", flush=True)
    if args.only_maps:
        return
    both = []
    for _, trial in sampled(base, args.samples, CYCLES, 0):
        coarse, fine = (strides(lib, trial.settings, c) for c in (args.cell, args.cell / 2))
        both.append((coarse.mean(), fine.mean(), fine.std() / max(abs(fine.mean()), 1e-9)))
    a, b, spread = np.array(both).reshape(-1, 3).T
    steady = spread < STEADY
    near = steady & (np.abs(b - TARGET) <= 4.5)
    change = np.abs(a[near] / b[near] - 1)
    print(f"{len(a)} points: {steady.sum()} steady, {near.sum()} of them within 4.5 mm of {TARGET:g} mm, of these "
          f"{(change < 0.02).sum()} within 2 % on both meshes")  # fmt: skip


if __name__ == "__main__":
    main()

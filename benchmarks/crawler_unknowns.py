"""What the crawler's stride hangs on, by the chain in a plane (planar_crawler.py), for which a walk takes a second.

    python benchmarks/crawler_unknowns.py [--out runs/crawler_unknowns] [--cell 3.8] [--only changes maps]
    python benchmarks/crawler_unknowns.py --only points --samples 200 [--best 20]

The maps of `origami-sim study crawler` around the default, changes of 5 % of every parameter, and points of a Latin
hypercube over eight unknowns, those near the target on half the cells as well, the best of them with delicate
parameters changed by 5 %. Without adhesion, which the chain lacks.
"""

import argparse
from pathlib import Path

import numpy as np
from planar_crawler import library, walk

from origami_sim.device.scene import Settings, read_calibration
from origami_sim.studies.crawler_maps import (
    AXES,
    DELICATE,
    MAPS,
    ROBUST,
    SAMPLED,
    STEADY,
    TARGET,
    VARIED,
    StrideMap,
    checks,
    draw_maps,
    map_trials,
    sampled,
)

CYCLES = 6
PARTS = ("changes", "maps", "points")
UNKNOWNS = {**SAMPLED, "belly_friction": (0.1, 0.4), "overhang": (0.001, 0.005)}
"""Ranges of the points' unknowns: those of the study, and two that no map has."""
AGAIN, NEAR, ALIKE = 7.0, 4.5, 0.02
"""Points within so many mm of the target are walked on half the cells; what counts there as near it, and as alike."""


def strides(lib, s: Settings, cell: float) -> np.ndarray:
    """Strides of the second half of the cycles [mm]; nan for a chain that broke."""
    values = {n: s[n].value for n in s.as_dict()}
    with np.errstate(all="ignore"):
        found = 1e3 * walk(lib, values, cell=1e-3 * cell, cycles=CYCLES)[CYCLES // 2 :]
    return found if np.all(np.abs(found) < 1e3) else np.full(len(found), np.nan)


def points(lib, base: Settings, cell: float, samples: int, best: int):
    """Prints how many points of the hypercube come near the target on finer cells too, and where these lie."""
    low, high = np.array(list(UNKNOWNS.values())).T
    both = []
    tried = sampled(base, samples, CYCLES, 0, UNKNOWNS)
    for where, trial in tried:
        coarse = strides(lib, trial.settings, cell).mean()
        fine = strides(lib, trial.settings, cell / 2) if abs(coarse - TARGET) <= AGAIN else np.full(1, np.nan)
        both.append((coarse, fine.mean(), fine.std() / max(abs(fine.mean()), 1e-9), *where.values()))
    a, b, spread, *unknowns = np.array(both).reshape(samples, -1).T
    again = np.abs(a - TARGET) <= AGAIN
    near = (spread < STEADY) & (np.abs(b - TARGET) <= NEAR)
    alike = near & (np.abs(a / np.where(near, b, 1.0) - 1) < ALIKE)
    print(f"{samples} points, {np.isnan(a).sum()} of them broken: {again.sum()} within {AGAIN:g} mm of {TARGET:g} mm; "
          f"with half the cells {(spread < STEADY).sum()} steady, {near.sum()} of them within {NEAR:g} mm, of these "
          f"{alike.sum()} within {ALIKE:.0%} on both meshes")  # fmt: skip
    for name, values, middle in zip(UNKNOWNS, unknowns, (low + high) / 2, strict=True):
        less, more = (
            f"{(alike & half).sum()} of {(near & half).sum()}" for half in (values < middle, values >= middle)
        )
        print(f"{name} below and above {middle:g}: {less}, {more} of the near ones alike", flush=True)
    nearest = [n for n in np.argsort(np.abs(b - TARGET)) if alike[n]][:best]
    if nearest:
        changed(lib, [tried[n] for n in nearest], cell)


def changed(lib, best: list, cell: float):
    """Prints how far 5 % of the delicate parameters change the stride of points."""
    worst = []
    for where, trial in best:
        found = {n: strides(lib, t.settings, cell) for n, t in checks(trial, DELICATE).items()}
        stride = found.pop("as it is").mean()
        change = {n: f.mean() / stride - 1 for n, f in found.items()}
        unsteady = sum(f.std() >= STEADY * abs(f.mean()) for f in found.values())
        name = max(change, key=lambda n: np.nan_to_num(abs(change[n]), nan=np.inf))
        worst.append(abs(change[name]))
        largest = {n: max(abs(change[k]) for k in change if k.startswith(n)) for n in DELICATE}
        print(f"{stride:.2f} mm; worst {name}: {change[name]:+.1%}; {unsteady} unsteady; "
              + ", ".join(f"{n} {c:.1%}" for n, c in largest.items())
              + f"; at {', '.join(f'{n} {v:g}' for n, v in where.items())}", flush=True)  # fmt: skip
    robust = np.array(worst) <= ROBUST
    print(f"{len(best)} points, changed by 5 %: by {np.nanmin(worst):.1%} to {np.nanmax(worst):.1%}, "
          f"median {np.nanmedian(worst):.1%}; {robust.sum()} by no more than {ROBUST:.0%}")  # fmt: skip


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--calibration", default="crawler")
    parser.add_argument("--cell", type=float, default=2.5, help="[mm]")
    parser.add_argument("--samples", type=int, default=60, help="points of the hypercube")
    parser.add_argument("--best", type=int, default=0, help="points of which delicate parameters are changed")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS, metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--out", type=Path, default=Path("runs/crawler_unknowns"))
    args = parser.parse_args(argv)
    base, lib = read_calibration(args.calibration), library()
    args.out.mkdir(parents=True, exist_ok=True)
    stride = strides(lib, base, args.cell).mean()
    print(f"as it is: {stride:.2f} mm")
    for name in VARIED if "changes" in args.only else ():
        if base[name].value and name != "adhesion":
            low, high = (
                strides(lib, base.replace(**{name: f * base[name].value}), args.cell).mean() / stride - 1
                for f in (0.95, 1.05)
            )
            print(f"{name} -5 %, +5 %: {low:+.1%}, {high:+.1%}", flush=True)
    maps = []
    mapped = [(AXES[a], AXES[b]) for a, b in MAPS if "adhesion" not in (a, b)]
    for x, y in mapped if "maps" in args.only else ():
        trials = map_trials(base, x, y, CYCLES)
        found = np.array([[strides(lib, t.settings, args.cell) for t in row] for row in trials])
        mean = found.mean(axis=-1)
        maps.append(StrideMap(x, y, trials, mean, found.std(axis=-1) / np.maximum(np.abs(mean), 1e-9)))
        draw_maps(maps, args.out / "maps.png", mark=base, note=f"chain in a plane, cells of {args.cell:g} mm")
        print(f"{x.name}, {y.name}: {mean.size} points", flush=True)
    if "points" in args.only:
        points(lib, base, args.cell, args.samples, args.best)


if __name__ == "__main__":
    main()

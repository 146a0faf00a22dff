"""Balls and cubes of docs/real-recordings.md: verdicts, and fits of some recordings tested on others.

    python benchmarks/real_recordings.py balls drops.csv       # eleven balls, two drops each
    python benchmarks/real_recordings.py flights tosses.parquet
    python benchmarks/real_recordings.py blows tosses.parquet

The chains are in `pendulum_held_out.py`, the curves in `diagnose_curves.py`. Recordings are made in a folder that is
removed at the end.
"""

import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from origami_sim.device.scene import read_calibration
from origami_sim.diagnose import Options, Subject, diagnose
from origami_sim.diagnose.arrange import arranged
from origami_sim.fit.least_squares import Fit, fit
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import Free, Hypothesis
from origami_sim.hypotheses.suspects import suspects
from origami_sim.recording import Recording, read_recording
from origami_sim.scenes import cube_toss, falling_ball

WHOLE = 10.0
"""Longer than any of these recordings [s]: each is one segment."""

SHORT = -0.021
"""Relative error of the cube's lengths, as its flights show."""


def rms(f: Fit) -> float:
    """Root mean square of all residuals of a fit [m]."""
    return float(np.sqrt(np.nanmean(np.concatenate(f.residuals) ** 2)))


def told(subject: Subject, recordings: Sequence[Recording], **options) -> None:
    """Prints the verdict."""
    found = diagnose(subject, recordings, Options(**options))
    print(f"  {found.verdict}: {found.sentence} [{sum(found.seconds.values()):.0f} s]", flush=True)


def loosened(subject: Subject, *names: str) -> Subject:
    """A subject of which only these numbers are uncertain, without priors."""
    free = [replace(n, spread=np.inf, scale=10 * n.scale) for n in subject.nominals if n.name in names]
    return replace(subject, nominals=tuple(free))


def tested(
    subject: Subject, train: Sequence[Recording], test: Sequence[Recording], weights: Weights, effect: str = ""
) -> tuple[Fit, Fit]:
    """A fit to some recordings, and its numbers on others, of which only the starts are adapted."""
    whole = Options(start="fit", segment=WHOLE)
    one, other = (arranged(subject, list(r), whole)[0] for r in (train, test))
    every = suspects(one.model, one.recordings, one.drive, one.parameters)
    added = tuple(s for s in every if s.effect == effect and not (s.kind == "measurement" and s.entities))
    fitted = fit(one, Hypothesis(added), weights, most=12)
    return fitted, fit(other, Hypothesis(added), weights, theta=fitted.theta, fixed=True, most=12)


def number(f: Fit, name: str) -> str:
    """A fitted number with its 95 % interval."""
    index = next(k for k, n in enumerate(f.free) if n.name == name)
    return f"{f.theta[index]:.4g} +- {1.96 * f.deviations()[index]:.2g}"


def balls(source: Path, folder: Path) -> None:
    """Each drop fitted and the other predicted; 0.2 m of error."""
    falling_ball.convert(source, folder)
    weights = Weights(np.array([0.2]))
    for name in falling_ball.BALLS:
        drops = [read_recording(folder / f"{name.lower().replace(' ', '_')}_{n}.csv") for n in (1, 2)]
        settings = falling_ball.of_ball(read_calibration("falling_ball"), name)
        subject = Subject.from_scene(falling_ball, settings, name=name)
        loose = loosened(subject, "gravity")
        print(name)
        for title, s, effect, shown in (
            ("free fall", subject, "", "gravity"),
            ("gravity alone", loose, "", "gravity"),
            ("drag", subject, "body_drag", "drag_coefficient"),
        ):
            each = [tested(s, [drops[a]], [drops[b]], weights, effect) for a, b in ((0, 1), (1, 0))]
            values = ", ".join(number(f, shown) for f, _ in each)
            print(f"  {title:14s} {shown} {values}; on the other drop {np.mean([rms(g) for _, g in each]):.2f} m")
        told(subject, drops, segment=WHOLE)


def flights(source: Path, folder: Path) -> None:
    """Flights of the centre: every tenth fitted, others tested.

    The board is put out of the way: how the cube is turned is not recorded, and no corner may touch it.
    """
    files = cube_toss.convert(source, folder, "flight")
    train, test = ([read_recording(f) for f in files[n::10][:21]] for n in (0, 5))
    subject = Subject.from_scene(cube_toss, read_calibration("cube_toss").replace(board_height=-0.1))
    fixed = replace(subject, nominals=tuple(n for n in subject.nominals if n.name == "gravity"))
    weights = Weights(np.full(3, 2e-4))
    least = np.zeros(len(test))
    for title, s, effect, shown in (
        ("nominal", fixed, "", "gravity"),
        ("gravity without prior", loosened(subject, "gravity"), "", "gravity"),
        ("length scale", fixed, "length_scale", "length_scale"),
        ("clock rate", fixed, "clock_rate", "clock_rate"),
        ("drag", fixed, "body_drag", "drag_coefficient"),
    ):
        fitted, other = tested(s, train, test, weights, effect)
        z = [1e3 * float(np.sqrt(np.nanmean(np.concatenate(f.residuals)[:, 2] ** 2))) for f in (fitted, other)]
        each = np.array([np.nanmean(r[:, 2] ** 2) for r in other.residuals])
        least = each if title == "nominal" else least
        better = f", better on {np.count_nonzero(each < least)} of {len(each)}"
        rows = f"{z[0]:.3f} mm, others {z[1]:.3f} mm{better}"
        print(f"{title:24s} {number(fitted, shown):20s} rms of z {rows}", flush=True)
    told(subject, train[:12], segment=1.0)


def blows(source: Path, folder: Path) -> None:
    """First blows of one corner: 24 fitted and 24 others tested, both ways."""
    files = cube_toss.convert(source, folder, "impact", scale=SHORT)
    halves = [[read_recording(f) for f in files[n::6][:24]] for n in (0, 3)]
    subject = Subject.from_scene(cube_toss, read_calibration("cube_toss").replace(length_scale=SHORT))
    weights = Weights(np.full(12, 2e-3))

    def only(*names: str) -> tuple[Free, ...]:
        return tuple(replace(n, scale=10 * n.spread) for n in subject.nominals if n.name in names)

    for names in (("inertia",), ("inertia", "friction", "restitution")):
        some = replace(subject, nominals=only(*names))
        for train, test in (halves, halves[::-1]):
            fitted, other = tested(some, train, test, weights)
            forward, _ = arranged(some, test, Options(start="fit"))
            given = fit(forward, Hypothesis(), weights, fixed=True, most=12)
            pairs = zip(given.residuals, other.residuals, strict=True)
            better = sum(bool(np.nanmean(b**2) < np.nanmean(a**2)) for a, b in pairs)
            values = ", ".join(f"{n} {number(fitted, n)}" for n in names)
            print(
                f"{values}: on the others {1e3 * rms(given):.2f} mm published, {1e3 * rms(other):.2f} mm refitted, "
                f"better on {better} of {len(test)}",
                flush=True,
            )
    told(subject, [read_recording(f) for f in files[:11]], segment=1.0)


def main() -> None:
    parts = {"balls": balls, "flights": flights, "blows": blows}
    if len(sys.argv) != 3 or sys.argv[1] not in parts:
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as folder:
        parts[sys.argv[1]](Path(sys.argv[2]), Path(folder))


if __name__ == "__main__":
    main()

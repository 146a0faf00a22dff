"""A ball that falls through air, and real drops of eleven balls from about 47 m.

    python -m origami_sim.scenes.falling_ball                      one fall, as the calibration says
    python -m origami_sim.scenes.falling_ball drops.csv FOLDER     makes recordings of the real drops

The ball is one node of its mass; without drag it falls freely, with it the drag acts on its cross-section. A drop is
one table with a sidecar; `drops.csv` comes from github.com/briandesilva/discovery-of-physics-from-data (MIT) in the
layout ball, drop, time_s, height_m, velocity_m_s. Then, for example:

    origami-sim diagnose FOLDER/tennis_ball_*.csv --model falling_ball --set mass=0.0567 --segment 10
"""

import csv
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from origami_sim.device.scene import Outcome, Progress, Settings, motion_of
from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, State

CALIBRATION = "falling_ball"

OUNCE = 0.028349523125
"""[kg]"""

BALLS: Mapping[str, tuple[float, float]] = {
    "Baseball": (5.0, 22.25),
    "Blue Basketball": (18.0, 75.0),
    "Green Basketball": (16.0, 73.25),
    "Volleyball": (9.5, 66.0),
    "Bowling Ball": (81.0, 67.0),
    "Golf Ball": (1.62, 13.8),
    "Tennis Ball": (2.0, 20.75),
    "Whiffle Ball 1": (1.0, 22.8),
    "Whiffle Ball 2": (1.0, 22.8),
    "Yellow Whiffle Ball": (1.5, 29.0),
    "Orange Whiffle Ball": (1.5, 29.0),
}
"""Weight [oz] and circumference [cm] as published; the volleyball's are unknown and those of its sport's rules."""

HELD = 0.5
"""Frames until a ball has fallen so far [m] are left out: 15 frames per second do not show when it was let go."""

COLUMNS = ("ball", "drop", "time_s", "height_m", "velocity_m_s")


def build(s: Settings) -> tuple[Model, Parameters, Drive]:
    """One node without bars at the origin; heights are displacements along z."""
    none = np.zeros(0)
    model = Model(
        position=np.zeros((1, 3)),
        free=np.ones((1, 3)),
        bars=np.zeros((0, 2), np.int32),
        creases=np.zeros((0, 4), np.int32),
        bends=np.zeros((0, 4), np.int32),
        triangles=np.zeros((0, 3), np.int32),
        triangle_panel=none.astype(np.int32),
        contacts=np.zeros((0, 3), np.int32),
        contact_weights=np.zeros((0, 3)),
        contact_offsets=none,
        contact_axes=np.zeros((0, 3)),
        electrodes=none.astype(np.int32),
        effects=("gravity", "body_drag"),
        names={"node": ("ball",)},
    )
    parameters = Parameters(model)
    parameters.set("inertia", "mass", s.mass)
    parameters.set("gravity", "gravity_z", -s.gravity)
    parameters.set("body_drag", "area", s.circumference**2 / (4 * np.pi))
    parameters.set("body_drag", "air_density", s.air_density)
    parameters.set("body_drag", "drag_coefficient", s.drag_coefficient)
    return model, parameters, Drive()


def terminal_speed(s: Settings) -> float:
    """Speed at which drag bears the weight [m/s]; infinite without drag."""
    pull = 0.5 * s.air_density * s.drag_coefficient * s.circumference**2 / (4 * np.pi)
    return float(np.sqrt(s.mass * s.gravity / pull)) if pull > 0 else np.inf


def exact(s: Settings, times: np.ndarray) -> np.ndarray:
    """Height [m] at times [s] after the release from rest: h0 - v^2 / g log cosh(g t / v), v the terminal speed."""
    v = terminal_speed(s)
    fallen = s.gravity * times**2 / 2 if np.isinf(v) else v**2 / s.gravity * np.log(np.cosh(s.gravity * times / v))
    return s.height - fallen


def run(s: Settings, progress: Progress | None = None) -> Outcome:
    """The fall, beside its closed form."""
    model, parameters, drive = build(s)
    start = State.at_rest(model, position=np.array([[0.0, 0.0, s.height]]))
    motion = motion_of(
        s, model, parameters, drive, duration=s.duration, rate=60.0, dt=1e-3, state=start, progress=progress
    )
    height = motion.x[:, 0, 0, 2]
    every = slice(None, None, 30)
    table: dict[str, np.ndarray | list] = {
        "time_s": motion.times[every],
        "height_m": height[every],
        "speed_m_s": -motion.v[every, 0, 0, 2],
    }
    error = float(np.abs(height - exact(s, motion.times)).max())
    final = terminal_speed(s)
    limit = f"terminal speed {final:.3g} m/s" if np.isfinite(final) else "no drag, so that no speed is terminal"
    return Outcome(
        motion,
        {"fall": table},
        units={"time_s": "s", "height_m": "m", "speed_m_s": "m/s"},
        summary=[f"{limit}; the fall is within {1e6 * error:.2g} um of its closed form"],
        numbers={"error_m": error, "terminal_speed_m_s": final, "last_height_m": float(height[-1])},
    )


def convert(source: str | Path, folder: str | Path) -> list[Path]:
    """Writes one table with a sidecar for every drop; returns the tables.

    A drop begins when the ball has fallen by `HELD`. The velocity of the source is no measurement but derived from the
    heights: it is checked and left out, so that nothing is counted twice. What is found is noted in the sidecar.

    Raises:
        InputError: a file that cannot be read, other columns, a value that is no number, rows that are not sorted.
    """
    drops: dict[tuple[str, str], list[list[float]]] = {}
    try:
        with open(source, newline="") as f:
            rows = csv.DictReader(f)
            if tuple(rows.fieldnames or ()) != COLUMNS:
                raise InputError(
                    "another layout", file=source, field="columns", value=rows.fieldnames, allowed=", ".join(COLUMNS)
                )
            for line, row in enumerate(rows, 2):
                try:
                    numbers = [float(row[c]) for c in COLUMNS[2:]]
                except (TypeError, ValueError):
                    raise InputError("not a number", file=source, field=f"line {line}", value=dict(row)) from None
                drops.setdefault((row["ball"], row["drop"]), []).append(numbers)
    except OSError as e:
        raise InputError(f"cannot be read ({e.strerror})", file=source) from None
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    out = []
    for (ball, drop), values in drops.items():
        times, heights, speeds = np.array(values).T
        if np.any(np.diff(times) <= 0):
            raise InputError("the rows are not sorted in time", file=source, field=f"{ball}, drop {drop}")
        first = int(np.argmax(heights < heights.max() - HELD))
        path = folder / f"{ball.lower().replace(' ', '_')}_{drop}.csv"
        with open(path, "w", newline="") as f:
            writer = csv.writer(f)
            writer.writerow(["time_s", "height_m"])
            writer.writerows(zip(times[first:], heights[first:], strict=True))
        path.with_suffix(".toml").write_text(_sidecar(ball, drop, first, _check(times, heights, speeds)))
        out.append(path)
    return out


def _check(times: np.ndarray, heights: np.ndarray, speeds: np.ndarray) -> str:
    """What the derived velocity and the heights say of each other, in one sentence."""
    middle = 0.5 * (speeds[1:] + speeds[:-1]) * np.diff(times)
    slope = float(np.polyfit(np.diff(heights), middle, 1)[0])
    off = speeds - np.gradient(heights, times)
    inner, outer = np.abs(off[3:-3]).max(), np.abs(np.r_[off[:3], off[-3:]]).max()
    return (
        f"the derived velocity is {slope:.2f} times the change of height; it differs by up to {inner:.1f} m/s inside "
        f"and {outer:.1f} m/s at its ends"
    )


def _sidecar(ball: str, drop: str, held: int, check: str) -> str:
    ounces, centimetres = BALLS.get(ball, (np.nan, np.nan))
    known = "" if np.isnan(ounces) else f"; {ounces} oz, circumference {centimetres} cm"
    left = f"{held} frames until it had fallen {HELD} m left out"
    return f'''name = "{ball}, drop {drop}"
description = "height of a ball dropped from a bridge{known}; {left}; {check}"
source = "https://github.com/briandesilva/discovery-of-physics-from-data"
licence = "MIT"
allow_gaps = true

[time]
column = "time_s"
unit = "s"

[channels.height]
column = "height_m"
kind = "tip_displacement"
unit = "m"
node = 0
direction = [0.0, 0.0, 1.0]

[scene]
name = "falling_ball"
'''


def of_ball(s: Settings, ball: str) -> Settings:
    """The settings of one of the eleven balls.

    Raises:
        InputError: a ball that was not dropped.
    """
    if ball not in BALLS:
        raise InputError("there is no such ball", field="ball", value=ball, allowed=", ".join(BALLS))
    ounces, centimetres = BALLS[ball]
    return s.replace(mass=ounces * OUNCE, circumference=centimetres / 100)


if __name__ == "__main__":
    if len(sys.argv) == 3:
        print("\n".join(map(str, convert(*sys.argv[1:]))))
    else:
        from origami_sim.commands.cli import main

        main(["run", "falling_ball"])

"""A rigid cube tossed onto a board, and real tosses of one.

    python -m origami_sim.scenes.cube_toss
    python -m origami_sim.scenes.cube_toss tosses.parquet FOLDER flight
    python -m origami_sim.scenes.cube_toss tosses.parquet FOLDER impact -0.021

The first runs one toss, as the calibration says. The others make recordings of real tosses: of the flights before the
first blow, and of short windows around it, given the relative error of lengths that the flights have shown.

`tosses.parquet` holds the tosses of github.com/DAIRLab/contact-nets (BSD-3) as toss, time_s, position of the centre and
orientation quaternion. A recording has the places of four corners, which together tell the pose. Then, for example:

    origami-sim diagnose FOLDER/toss_01*.csv --model cube_toss --segment 1

The cube is eight corners and a centre, joined by bars; the masses at the corners give it its inertia. Corners bounce as
unilateral spring-dashpots with bristle friction.
"""

import csv
import itertools
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pyarrow.parquet
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from origami_sim.device.scene import Outcome, Progress, Settings, motion_of
from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, State

CALIBRATION = "cube_toss"

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
"""Corners in sides from the centre; node 8 is the centre."""

NODES = {"flight": [8], "impact": [0, 3, 5, 6], "whole": [0, 3, 5, 6]}
"""Nodes whose places are recorded: the centre, which falls whatever the cube's size, or four corners, a tetrahedron."""

FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
"""Corners of the faces, counter-clockwise seen from outside."""

LOW = 4e-3
"""A corner that comes lower [m] ends the flight: frames of a trackers' filter and of an uneven board are kept out."""

BEFORE, AFTER = 7, 9
"""Frames of an impact before and after the first one in which a corner is lower than `LOW`."""

COLUMNS = ("toss", "time_s", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")


def build(s: Settings) -> tuple[Model, Parameters, Drive]:
    """The cube around the origin, its contacts at its corners.

    Raises:
        InputError: an inertia that corners cannot give.
    """
    at_corner = s.inertia / (4 * s.side**2)
    if not 8 * at_corner < s.mass:
        raise InputError(
            "masses at the corners cannot give this inertia",
            file=s.file,
            field="inertia",
            value=s.inertia,
            allowed=f"< {s.mass * s.side**2 / 2:.3g} kg m^2",
        )
    pairs = [p for p in itertools.combinations(range(8), 2) if np.abs(CORNERS[p[0]] - CORNERS[p[1]]).sum() < 2.5]
    triangles = [t for a, b, c, d in FACES for t in ((a, b, c), (a, c, d))]
    carriers = [next(t for t in triangles if corner in t) for corner in range(8)]
    model = Model(
        position=s.side * np.vstack([CORNERS, np.zeros(3)]),
        free=np.ones((9, 3)),
        bars=np.array([*pairs, *((corner, 8) for corner in range(8))], np.int32),
        creases=np.zeros((0, 4), np.int32),
        bends=np.zeros((0, 4), np.int32),
        triangles=np.array(triangles, np.int32),
        triangle_panel=np.zeros(len(triangles), np.int32),
        contacts=np.array(carriers, np.int32),
        contact_weights=np.array([[float(n == corner) for n in t] for corner, t in enumerate(carriers)]),
        contact_offsets=np.zeros(8),
        contact_axes=np.tile([-1.0, 1.0, 0.0], (8, 1)),
        electrodes=np.zeros(0, np.int32),
        effects=(
            "bars",
            "bar_viscosity",
            "gravity",
            "ground",
            "restitution",
            "coulomb",
            "friction",
            "body_drag",
            *(("length_scale",) if s.length_scale else ()),
        ),
        names={"node": (*(f"corner{n}" for n in range(8)), "centre"), "panel": ("cube",)},
    )
    p = Parameters(model)
    p.set("inertia", "mass", np.array([at_corner] * 8 + [s.mass - 8 * at_corner]))
    ends = model.position[model.bars]
    p.set("bars", "rest_length", np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)).set(
        "bars", "stiffness", s.bar_stiffness
    )
    p.set("bar_viscosity", "viscosity", 0.1 * np.sqrt(s.bar_stiffness * at_corner))
    p.set("gravity", "gravity_z", -s.gravity)
    p.set("ground", "stiffness", s.contact_stiffness)
    p.set("restitution", "impact_damping", impact_damping(s.restitution, s.contact_stiffness, mass_at_corner(s)))
    p.set("coulomb", "friction_coefficient", s.friction)
    p.set("friction", "stiffness", 10 * s.contact_stiffness)  # slides before the dashpot's first push has gone
    p.set("plane", "height", s.board_height)
    p.set(
        "body_drag", "area", np.array([0.0] * 8 + [1.5 * s.side**2])
    )  # a quarter of the surface: the mean over all turns
    if s.length_scale:
        p.set("length_scale", "length_scale", s.length_scale)
    return model, p, Drive()


def mass_at_corner(s: Settings) -> float:
    """Mass that a blow on a corner moves [kg]; half a side squared is its squared lever in the mean of all turns."""
    return 1 / (1 / s.mass + s.side**2 / 2 / s.inertia)


def impact_damping(restitution: float, stiffness: float, mass: float) -> float:
    """Dashpot of the way in [N s/m] with which a mass leaves a spring with `restitution` times its speed.

    The ratio of critical damping z solves exp(-z acos(z) / sqrt(1 - z^2)) = e; beyond z = 1, acosh(z) / sqrt(z^2 - 1).
    """

    def rebound(z: float) -> float:
        if abs(z - 1) < 1e-6:
            return float(np.exp(-z))
        angle = np.arccos(z) / np.sqrt(1 - z * z) if z < 1 else np.arccosh(z) / np.sqrt(z * z - 1)
        return float(np.exp(-z * angle))

    if restitution >= 1.0:
        return 0.0
    ratio = float(brentq(lambda z: rebound(z) - restitution, 0.0, 1e6))
    return 2 * ratio * float(np.sqrt(stiffness * mass))


def tossed(s: Settings, model: Model) -> State:
    """The cube, turned a little out of every symmetry, with its speed and spin."""
    turn = Rotation.from_euler("xyz", [0.3, 0.5, 0.2]).as_matrix()
    x = model.position @ turn.T
    state = State.at_rest(model, position=x + np.array([0.0, 0.0, s.height]))
    state.v[:, 0] = np.cross([0.0, s.spin, 0.0], x) - np.array([s.speed, s.speed, 0.0]) / np.sqrt(2)
    return state


def run(s: Settings, progress: Progress | None = None) -> Outcome:
    """One toss."""
    model, parameters, drive = build(s)
    start = tossed(s, model)
    motion = motion_of(s, model, parameters, drive, duration=s.duration, rate=148.0, state=start, progress=progress)
    centre = motion.centre_of_mass()[:, 0]
    every = slice(None, None, 10)
    table = {"time_s": motion.times[every], "height_m": centre[every, 2], "lowest_m": motion.gaps[every, :, 0].min(1)}
    lengths = np.linalg.norm(np.diff(motion.x[:, model.bars], axis=2)[:, :, 0, 0], axis=-1)
    strain = float(np.abs(lengths / lengths[0] - 1).max(initial=0.0))
    balance = float(np.ptp(motion.energy_balance()[:, 0]))
    return Outcome(
        motion,
        {"toss": table},
        units={"time_s": "s", "height_m": "m", "lowest_m": "m"},
        summary=[
            f"rigid within {1e3 * strain:.2f} mm/m, corners sink by up to {-1e3 * motion.gaps.min():.2f} mm, "
            f"energy balance kept within {1e3 * balance:.2f} mJ of {1e3 * motion.energies['kinetic'].max():.0f} mJ"
        ],
        numbers={"strain": strain, "depth_m": float(-motion.gaps.min()), "energy_error_J": balance},
    )


def corners(position: np.ndarray, quaternion: np.ndarray, side: float) -> np.ndarray:
    """Places of the corners [n, 8, 3] from the centre's [n, 3] [m] and orientations (w, x, y, z) [n, 4]."""
    turn = Rotation.from_quat(quaternion[:, [1, 2, 3, 0]]).as_matrix()
    return position[:, None] + np.einsum("nij,kj->nki", turn, side * CORNERS)


def first_blow(z: np.ndarray) -> int:
    """First frame in which one of the corners at heights z [n, 8] is low; n if none is."""
    low = np.any(z < LOW, axis=1)
    return int(np.argmax(low)) if np.any(low) else len(z)


def convert(
    source: str | Path,
    folder: str | Path,
    part: str = "flight",
    tosses: Iterable[int] | None = None,
    *,
    side: float = 0.1048,
    scale: float = 0.0,
) -> list[Path]:
    """Writes one table with a sidecar for every toss; returns the tables.

    Args:
        part: "flight": the centre up to the first blow, where there are 16 frames of it; "impact": four corners around
            the first blow, where one corner alone touches the board; "whole": four corners all along.
        tosses: which (default: all).
        side: of the cube [m].
        scale: relative error of the recorded lengths; corners are put where the tracker would have shown them.

    Raises:
        InputError: a file that cannot be read, lacks a column or has a quaternion that is none; no such part.
    """
    if part not in ("flight", "impact", "whole"):
        raise InputError("there is no such part", field="part", value=part, allowed="flight, impact, whole")
    try:
        table = pyarrow.parquet.read_table(source)
    except (OSError, ValueError) as e:
        raise InputError(f"cannot be read ({e})", file=source) from None
    missing = [c for c in COLUMNS if c not in table.column_names]
    if missing:
        raise InputError("a column is missing", file=source, field=missing[0], allowed=", ".join(COLUMNS))
    data = np.stack([table[c].to_numpy() for c in COLUMNS], axis=1)
    norms = np.linalg.norm(data[:, 5:9], axis=1)
    bad = np.flatnonzero(~(np.abs(norms - 1) < 1e-2))
    if len(bad):
        raise InputError("not a unit quaternion", file=source, field=f"row {bad[0]}", value=data[bad[0], 5:9].tolist())
    wanted = np.unique(data[:, 0]) if tosses is None else list(tosses)
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    out = []
    for toss in wanted:
        rows = data[data[:, 0] == toss]
        if not len(rows):
            raise InputError("there is no such toss", file=source, field="toss", value=int(toss))
        places = corners(rows[:, 2:5], rows[:, 5:9], side * (1 + scale))
        blow = first_blow(places[:, :, 2])
        cut = {"flight": slice(0, blow), "whole": slice(None)}.get(part, slice(max(0, blow - BEFORE), blow + AFTER))
        touching = np.any(places[cut][:, :, 2] < LOW, axis=0).sum()
        if len(places[cut]) < 16 or (part == "impact" and (blow < BEFORE or touching > 1)):
            continue
        path = folder / f"toss_{int(toss):03d}.csv"
        with open(path, "w", newline="") as f:
            writer = csv.writer(f)
            writer.writerow(["time_s", *(f"n{n}{a}" for n in NODES[part] for a in "xyz")])
            every = np.concatenate([places, rows[:, None, 2:5]], axis=1)[:, NODES[part]]
            for t, p in zip(rows[cut, 1], every[cut], strict=True):
                writer.writerow([t, *p.ravel()])
        path.with_suffix(".toml").write_text(_sidecar(int(toss), part))
        out.append(path)
    return out


NOISE = {"flight": 3e-5, "impact": 5e-4, "whole": 5e-4}
"""Of a point [m]. In flight that of the differences of neighbouring frames; at a blow the orientations, which the
authors filtered by medians of three frames, lag: 0.5 mm for corners that turn by 2 rad/s more than before."""


def _sidecar(toss: int, part: str) -> str:
    head = f"""name = "toss {toss}, {part}"
description = "points of a tossed cube, from its tracked pose"
source = "https://github.com/DAIRLab/contact-nets"
licence = "BSD-3-Clause"
allow_swaps = true

[time]
column = "time_s"
unit = "s"

[scene]
name = "cube_toss"
"""
    for n in NODES[part]:
        columns = ", ".join(f'"n{n}{a}"' for a in "xyz")
        head += f"""
[channels.{"centre" if n == 8 else f"corner{n}"}]
columns = [{columns}]
kind = "marker"
unit = "m"
node = {n}
noise = {NOISE[part]}
"""
    return head


if __name__ == "__main__":
    if len(sys.argv) in (3, 4, 5):
        found = float(sys.argv[4]) if len(sys.argv) == 5 else 0.0
        print("\n".join(map(str, convert(sys.argv[1], sys.argv[2], (*sys.argv[3:4], "flight")[0], scale=found))))
    else:
        from origami_sim.commands.cli import main

        main(["run", "cube_toss"])

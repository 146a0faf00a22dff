"""One flat sheet, three fields: stair step in a magnetic, accordion in an electric, roll in a thermal field.

    python -m origami_sim.scenes.multi_field_sheet
    origami-sim run multi_field_sheet --set mode=thermal

The concept of the seed paper's Figure 1. The panels carry magnetic patches: risers poled along the sheet, which a field
along z turns upright, between treads poled along z, which it keeps level. Creases along y are bilayers that bend when
warmed, all the same way. Creases along x carry dielectric stacks on alternate sides; the first, at the clamped row, is
half as long, so that the rows stand at plus and minus the same angle. One corner panel is held.
"""

from dataclasses import dataclass

import numpy as np

from origami_sim.design.build import Sheet
from origami_sim.device.scene import Outcome, Progress, Settings, follow, motion_of
from origami_sim.drive import Drive, series
from origami_sim.effects.crease_thermal import bilayer_turn
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, dihedral_angles
from origami_sim.pattern.assemble import assemble
from origami_sim.physics.materials import layered_rigidity
from origami_sim.solve.motion.dynamics import Trajectory

CALIBRATION = "multi_field_sheet"
SHAPES = {"magnetic": "stair step", "electric": "accordion", "thermal": "roll"}
"""Field -> shape."""

UP = np.array([0.05, 0.15, 0.3, 0.5, 0.75, 1.0])
"""Shares of a drive at which its equilibrium is followed; then down again, and reversed."""

RAMP, HOLD, REST = 1.5, 1.0, 2.5
"""Seconds in which a drive rises, stays, and (gone in `unfold_time`) leaves the sheet alone."""

FLAT = np.radians(2.0)
"""The sheet counts as flat again when no crease is folded further than this."""


@dataclass(frozen=True)
class Creases:
    """Creases of the sheet by what folds them: index in the model, and place.

    Attributes:
        along_y: (columns - 1, rows) crease index. along_x: (rows - 1, columns) crease index.
    """

    along_y: np.ndarray
    along_x: np.ndarray

    def names(self) -> list[str]:
        """Of all creases: "y-crease 2.1" is the second column border in the first row, "x-crease 1.3" the other way."""
        out = [""] * (self.along_y.size + self.along_x.size)
        for way, creases in (("y", self.along_y), ("x", self.along_x)):
            for (first, second), crease in np.ndenumerate(creases):
                out[int(crease)] = f"{way}-crease {first + 1}.{second + 1}"
        return out


def counts(s: Settings) -> tuple[int, int]:
    """Columns and rows of panels."""
    return round(s.columns), round(s.rows)


def stack(s: Settings) -> tuple[float, float]:
    """Bending rigidity per width of the dielectric stack on its film [N m], and the lever of the stack [m]."""
    film, height = s.stack_film_thickness, round(s.layers) * s.layer_thickness
    moduli = s.film_modulus / (1 - s.film_poisson**2), 4 * s.de_shear_modulus  # plane strain, incompressible
    stretch = moduli[0] * film, moduli[1] * height
    neutral = (stretch[0] * film / 2 + stretch[1] * (film + height / 2)) / sum(stretch)
    return layered_rigidity([(film, moduli[0]), (height, moduli[1])]), film + height / 2 - neutral


def bilayer(s: Settings) -> tuple[float, float]:
    """Bending rigidity per width of the bilayer [N m] and its free turn per kelvin [rad/K]; wide: plane strain."""
    layers = (s.thickness, s.bilayer_film_thickness)
    moduli = s.modulus / (1 - s.poisson**2), s.film_modulus / (1 - s.film_poisson**2)
    expansion = s.expansion * (1 + s.poisson), s.film_expansion * (1 + s.film_poisson)
    rigidity = layered_rigidity(list(zip(layers, moduli, strict=True)))
    return rigidity, bilayer_turn(s.gap, layers, moduli, expansion)


def assembled(s: Settings) -> tuple[Sheet, Creases]:
    """The sheet with its patches, and its creases by direction; x along the columns, centred in y."""
    nx, ny = counts(s)
    dx, dy = s.patch_length + s.gap, s.patch_width + s.stack_length
    xs, ys = dx * np.arange(nx + 1), dy * (np.arange(ny + 1) - ny / 2)
    vertices = [(x, y, 0.0) for y in ys for x in xs]
    at = (nx + 1) * np.arange(ny)[:, None] + np.arange(nx)
    pattern = assemble(vertices, [(k, k + 1, k + nx + 2, k + nx + 1) for k in at.ravel().tolist()])
    sheet = Sheet(
        pattern,
        thickness=s.thickness,
        modulus=s.modulus,
        density=s.density,
        triangulation="center",
        membrane=s.membrane,
        membrane_damping=s.membrane_damping,
    )
    for panel in range(nx * ny):
        riser = panel % nx % 2 == 1
        sheet.patch(
            panel,
            thickness=s.patch_thickness,
            size=(s.patch_length, s.patch_width),
            poling=(1, 0, 0) if riser else (0, 0, 1),
            remanence=s.remanence,
            density=s.patch_density,
        )
        sheet.panel(panel, rigidity=s.patch_stiffening * sheet.rigidity(panel))
    ends = sheet.mesh.vertices[sheet.mesh.creases[:, 1:3]]
    middle = ends.mean(axis=1)
    upright = np.isclose(ends[:, 0, 0], ends[:, 1, 0])
    along_y, along_x = np.zeros((nx - 1, ny), int), np.zeros((ny - 1, nx), int)
    for crease, (x, y, _) in enumerate(middle):
        column, row = x / dx, y / dy + ny / 2
        if upright[crease]:
            along_y[round(column) - 1, int(row)] = crease
        else:
            along_x[round(row) - 1, int(column)] = crease
    return sheet, Creases(along_y, along_x)


def build(s: Settings) -> tuple[Model, Parameters, Drive]:
    nx, ny = counts(s)
    if nx % 2 or nx < 4 or ny < 2:
        raise InputError(
            "treads and risers alternate, and rows fold against each other",
            file=s.file,
            field="columns",
            value=(nx, ny),
            allowed="an even number of columns, 4 or more, and 2 or more rows",
        )
    sheet, creases = assembled(s)
    sheet.fix(panels=[0]).name("crease", creases.names())
    rigidity, turn = bilayer(s)
    stiffness = np.zeros(len(sheet.mesh.creases))
    warm = creases.along_y.ravel()
    stiffness[warm] = rigidity * s.patch_width / s.gap
    sheet.set("crease_thermal", warm, stiffness=stiffness[warm][:, None], turn_per_kelvin=turn)
    rigidity, lever = stack(s)
    for k, row in enumerate(creases.along_x):
        length = s.stack_length * (0.5 if k == 0 else 1.0)
        stiffness[row] = rigidity * s.patch_length / length
        active = {
            "permittivity": s.permittivity * s.pressure_share,
            "layer_thickness": s.layer_thickness,
            "layers": float(round(s.layers)),
            "width": s.patch_length,
            "constraint": 1.0,
            "side": -1.0 if k % 2 else 1.0,
        }
        sheet.set("maxwell_stress", row, lever=lever, **active)
        if s.thinning:
            bottom = lever - round(s.layers) * s.layer_thickness / 2  # of the stack, above the neutral axis
            sheet.set("thickness_thinning", row, first=bottom, neutral=0.0, hinge_length=length, **active)
    sheet.crease(stiffness=stiffness, rest_angle=0.0, loss_time=s.loss_time)
    sheet.on("crease_stop").set("mass_damping", decay_rate=s.decay_rate)
    if s.gravity:
        sheet.gravity((0, 0, -s.gravity))
    model, parameters = sheet.build()
    return model, parameters, drive(s)


def steady(s: Settings, field: str, share: float) -> Drive:
    """A share of the drive of one field, constant in time."""
    if field == "magnetic":
        return Drive(field=(0, 0, share * s.field))
    if field == "electric":
        return Drive(voltage=share * s.voltage)
    return Drive(temperature=share * s.temperature)


def reversed_share(s: Settings, field: str) -> float:
    """The opposite field over the field; a voltage acts alike both ways, so that none is opposite to it."""
    opposite, full = {"magnetic": (s.reversed_field, s.field), "thermal": (s.reversed_temperature, s.temperature)}.get(
        field, (0.0, 0.0)
    )
    return -opposite / abs(full) if full else 0.0


def fields(s: Settings) -> list[str]:
    """The fields that `mode` asks for, in order."""
    return list(SHAPES) if s.mode == "sequence" else [s.mode]


def schedule(s: Settings, field: str) -> tuple[np.ndarray, np.ndarray]:
    """Knots [s] and shares of one field's turn: up, hold, away (through a reversed pulse if asked for), rest."""
    back = 0.0 if s.unfold == "remove" else reversed_share(s, field)
    t = np.cumsum([0.0, RAMP, HOLD, s.unfold_time, s.unfold_time, REST])
    return t, np.array([0.0, 1.0, 1.0, back, 0.0, 0.0])


def drive(s: Settings) -> Drive:
    """The fields one after the other."""
    size = {"magnetic": s.field, "electric": s.voltage, "thermal": s.temperature}
    begin, waves = 0.0, {}
    for field in fields(s):
        t, share = schedule(s, field)
        waves[field] = begin + t, size[field] * share
        begin += t[-1]
    signal = {f: series(np.array([-1.0, *t, 1e9]), np.array([0.0, *v, 0.0])) for f, (t, v) in waves.items() if size[f]}
    return Drive(
        field=(0, 0, signal.get("magnetic", 0.0)),
        voltage=signal.get("electric", 0.0),
        temperature=signal.get("thermal", 0.0),
    )


@dataclass(frozen=True)
class Shape:
    """A shape in numbers.

    Attributes:
        along_y, along_x: (columns - 1,), (rows - 1,) mean fold of each crease line, valley positive [rad].
        spread: largest difference of folds within a line [rad]. inclination: (columns,) of the first row's panels
            above the x axis [rad]. rows: (rows,) of the first column's above the y axis [rad].
        size: extent along x, y, z [m]. gap: from the free edge at large x to the edge x = 0 [m].
    """

    along_y: np.ndarray
    along_x: np.ndarray
    spread: float
    inclination: np.ndarray
    rows: np.ndarray
    size: np.ndarray
    gap: float


def shape(s: Settings, creases: Creases, x: np.ndarray, angles: np.ndarray) -> Shape:
    """Measures positions x [N, 3] and crease angles [crease]."""
    nx, ny = counts(s)
    grid = x[: (nx + 1) * (ny + 1)].reshape(ny + 1, nx + 1, 3)
    along, across = np.diff(grid[0], axis=0), np.diff(grid[:, 0], axis=0)
    fold_y, fold_x = angles[creases.along_y], angles[creases.along_x]
    return Shape(
        fold_y.mean(axis=1),
        fold_x.mean(axis=1),
        float(max(np.ptp(fold_y, axis=1).max(), np.ptp(fold_x, axis=1).max())),
        np.unwrap(np.arctan2(along[:, 2], along[:, 0])),
        np.arctan2(across[:, 2], across[:, 1]),
        np.ptp(grid.reshape(-1, 3), axis=0),
        float(np.linalg.norm((grid[:, -1] - grid[:, 0]).mean(axis=0))),
    )


def settle(s: Settings, field: str) -> tuple[dict[str, Shape], list[str]]:
    """Equilibria with the field ("on"), after it was taken away ("off") and with a little of it reversed ("reversed").

    Each is followed from flat through the one before; and what failed.
    """
    _, creases = assembled(s)
    model, parameters, _ = build(s)
    shares = np.concatenate([UP, UP[-2::-1], [0.0, reversed_share(s, field)]])
    x, notes = follow(model, parameters, [steady(s, field, float(a)) for a in shares], lambda x: x)
    at = {"on": x[len(UP) - 1], "off": x[-2], "reversed": x[-1]}
    found = {name: shape(s, creases, p, dihedral_angles(p, model.creases)) for name, p in at.items()}
    return found, [f"{field}: {n}" for n in notes]


def criteria(field: str, on: Shape) -> tuple[float, float, bool]:
    """Mean fold of the creases that should fold [rad], the largest of those that should not, and whether the shape is
    the one wanted: every fold of the right sign and at least half of the mean, no other crease past 2 deg."""
    active, idle = (on.along_x, on.along_y) if field == "electric" else (on.along_y, on.along_x)
    sign = np.where(np.arange(len(active)) % 2, -1.0, 1.0) if field != "thermal" else np.ones(len(active))
    fold = active * sign
    if field == "electric":
        fold = fold[1:]  # the first stack is half as long
    mean, other = float(fold.mean()), float(np.abs(idle).max())
    return mean, other, bool((fold > 0.5 * mean).all() and mean > 5 * FLAT and other < FLAT)


def flat_again(s: Settings, motion: Trajectory) -> dict[str, tuple[float, float]]:
    """Seconds from the end of each field's hold until no crease is folded past `FLAT` any more (nan if never), and the
    largest fold that is left before the next field [rad]."""
    worst, begin, out = np.abs(motion.creases[:, :, 0]).max(axis=1), 0.0, {}
    for field in fields(s):
        t, _ = schedule(s, field)
        inside = (motion.times > begin + t[2]) & (motion.times <= begin + t[-1] + 1e-9)
        times, folded = motion.times[inside], worst[inside] > FLAT
        last = int(np.flatnonzero(folded)[-1]) + 1 if folded.any() else 0
        after = float(times[last] - begin - t[2]) if last < len(times) else float("nan")
        out[field] = after, float(worst[inside][-1])
        begin += t[-1]
    return out


def run(s: Settings, progress: Progress | None = None) -> Outcome:
    """The shapes and their return to flat by statics, and the motion for the replay."""
    rows, notes, summary, numbers = [], [], [], {}
    for field in fields(s):
        found, failed = settle(s, field)
        notes += failed
        on, off, reverse = found["on"], found["off"], found["reversed"]
        mean, other, right = criteria(field, on)
        active = "along_x" if field == "electric" else "along_y"
        residual = max(np.abs(off.along_y).max(), np.abs(off.along_x).max())
        rows.append(
            {
                "field": field,
                "shape": SHAPES[field] if right else "not reached",
                "fold_deg": np.degrees(mean),
                "other_deg": np.degrees(other),
                "spread_deg": np.degrees(on.spread),
                "height_mm": 1e3 * on.size[2],
                "length_x_mm": 1e3 * on.size[0],
                "length_y_mm": 1e3 * on.size[1],
                "removed_deg": np.degrees(residual),
                "opposite_deg": np.degrees(getattr(reverse, active)[0] * np.sign(getattr(on, active)[0])),
            }
        )
        numbers |= {f"{field}_fold_deg": float(np.degrees(mean)), f"{field}_removed_deg": float(np.degrees(residual))}
        if field == "magnetic":
            tread, riser = np.degrees(on.inclination[2::2]), np.degrees(on.inclination[1::2])
            summary.append(
                f"stair step: risers at {riser.min():.1f} to {riser.max():.1f} deg, treads within "
                f"{np.abs(tread).max():.1f} deg of level; {len(riser)} steps rise {1e3 * on.size[2]:.1f} mm"
            )
        elif field == "electric":
            tilt = np.degrees(on.rows[1:])
            summary.append(
                f"accordion: rows at {tilt.min():+.1f} and {tilt.max():+.1f} deg, a reversed voltage gives the same"
            )
        else:
            total = np.degrees(on.along_y.sum())
            summary.append(
                f"roll: turns by {total:.0f} deg in all, its ends {1e3 * on.gap:.1f} mm apart (a closed one "
                f"{360 * (1 - 1 / counts(s)[0]):.0f} deg)"
            )
    model, parameters, signals = build(s)
    duration = sum(schedule(s, f)[0][-1] for f in fields(s))
    motion = motion_of(s, model, parameters, signals, duration=duration, rate=30, progress=progress)
    for row, (after, left) in zip(rows, flat_again(s, motion).values(), strict=True):
        row |= {"flat_after_s": after, "left_deg": np.degrees(left)}
        numbers[f"{row['field']}_flat_after_s"] = after
    table: dict[str, np.ndarray | list] = {name: [row[name] for row in rows] for name in rows[0]}
    units = {c: u for c in table for end, u in (("_deg", "deg"), ("_mm", "mm"), ("_s", "s")) if c.endswith(end)}
    return Outcome(motion, {"shapes": table}, units=units, summary=[*notes, *summary], numbers=numbers)


if __name__ == "__main__":
    from origami_sim.commands.cli import main

    main(["run", "multi_field_sheet"])

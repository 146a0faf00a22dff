"""Parameter study of the bi-fold (Tables 5 and 6 of the seed paper): mass, energy and fold angle of all combinations.

    origami-sim study bifold --out runs/study_bifold

Every combination is a world of a batch; worlds of equal strip widths share one geometry and are stacked. Two readings
stand side by side. "printed": E_UL of 250-1000 MPa, densities of 1 and 2 kg/m^3, strips of 6.5 and 4 mm on a sheet
that grows to 27.5 mm. "physical": kPa for MPa in Table 5, 960 and 2800 kg/m^3, 6.5 and 2.75 mm, which keep the width.

Boundary conditions: electric "y edges sliding" (with both ends held, as printed, no combination folds at all), magnetic
"x edges". The angle is the rise over half the length. Energy is the square of the applied field, as energy density.
Eq. 9 is lost and read as (x - min) / (max - min) within each set of combinations.
"""

import argparse
import itertools
import json
import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from scipy.stats import spearmanr

from origami_sim.device.scene import Settings, scene_module, scene_settings
from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.physics.materials import EPS0, MU0
from origami_sim.results.run_folder import format_table
from origami_sim.solve.statics.equilibria import equilibrium

from .crawler_maps import stack

READINGS = ("printed", "physical")
SIDES = ("electric", "magnetic")

WIDTHS = {
    "printed": ((4.0e-3, 6.5e-3), (5.0e-3, 5.0e-3), (6.5e-3, 4.0e-3)),
    "physical": ((4.0e-3, 6.5e-3), (5.0e-3, 5.0e-3), (6.5e-3, 2.75e-3)),
}
"""w1, w2 [m]: the pairs of Tables 5 and 6 that keep the width, and as nearly as printed numbers do."""

THICKNESS = {
    "electric": (0.15e-3, 0.175e-3, 0.2e-3, 0.225e-3),
    "magnetic": (0.5e-3, 0.55e-3, 0.6e-3, 0.65e-3, 0.7e-3),
}
MODULUS = {
    ("electric", "printed"): (250e6, 500e6, 750e6, 1000e6),
    ("electric", "physical"): (250e3, 500e3, 750e3, 1000e3),
    ("magnetic", "printed"): (1.4e6, 1.5e6, 1.6e6),
    ("magnetic", "physical"): (1.4e6, 1.5e6, 1.6e6),
}
STRENGTH = {
    "electric": (10e3, 20e3, 30e3, 40e3),
    "magnetic": tuple((2.67 * np.array([0.025, 0.05, 0.075, 0.1])).tolist()),
}
SUPPORT = {"electric": "y edges sliding", "magnetic": "x edges"}
DENSITY = {"printed": (1.0, 2.0), "physical": (960.0, 2800.0)}
"""Of the dielectric and the magnetic strips in Eq. 8 [kg/m^3]."""

VARIED = (
    "support", "width", "de_width", "mae_width", "active_thickness", "underlayer_modulus", "voltage", "field",
    "de_density", "mae_density",
)  # fmt: skip
"""Settings that the tables give."""

DRIVEN = {"electric": "voltage", "magnetic": "field"}
VARIABLES = ("strength", "underlayer_modulus", "w1", "w2", "t1", "mass")

EXPECTED_RANKS = {
    "electric": {"strength": 0.87, "underlayer_modulus": -0.43, "w1": 0.17, "t1": 0.09, "mass": -0.05},
    "magnetic": {"strength": 0.81, "w2": 0.54, "mass": 0.43, "underlayer_modulus": -0.09},
}
EXPECTED_SLOPES = {
    "electric": {
        "strength": 2.0, "w1": 1.0, "t1": 0.66, "underlayer_modulus": -1.0, "notch_thickness": -2.8,
        "notch_length": 0.69,
    },
    "magnetic": {
        "strength": 1.0, "w2": 0.86, "t1": 0.02, "underlayer_modulus": -0.54, "underlayer_thickness": -1.5,
        "notch_thickness": -0.55,
    },
}  # fmt: skip
"""Spearman rank correlations with the angle, and d log angle / d log parameter: beam solution found independently."""

UNITS = {
    "w1": "m", "w2": "m", "t1": "m", "underlayer_modulus": "Pa", "mass": "kg", "energy": "J/m^3", "angle": "deg",
}  # fmt: skip


@dataclass(frozen=True)
class Combinations:
    """A set of combinations, one row each.

    Attributes:
        side: "electric" or "magnetic". reading: "printed" or "physical".
        columns: name -> [R] values: w1, w2, t1 [m], underlayer_modulus [Pa], strength [V] or [T], mass [kg] (Eq. 8),
            energy [J/m^3], angle [deg]; relative_mass, relative_energy, relative_angle (Eq. 9); objective, the mean
            of the relative angle and what is saved of mass and energy; best, whether no other row is better in one of
            the three and as good in the others.
        groups: number of geometries, and so of batches. failures: sentences on rows without an equilibrium.
    """

    side: str
    reading: str
    columns: dict[str, np.ndarray]
    groups: int
    failures: tuple[str, ...] = ()

    @property
    def units(self) -> dict[str, str]:
        return UNITS | {"strength": "V" if self.side == "electric" else "T"}

    def ranks(self) -> dict[str, float]:
        """Spearman's correlation with the angle of each variable that varies."""
        angle, varied = self.columns["angle"], [v for v in VARIABLES if np.ptp(self.columns[v]) > 0]
        return {v: float(spearmanr(self.columns[v], angle, nan_policy="omit").statistic) for v in varied}


def settings_of(base: Settings, side: str, reading: str, **values: float) -> Settings:
    """The calibration with w1, w2, t1, underlayer_modulus and strength replaced."""
    w1, w2 = values["w1"], values["w2"]
    densities = dict(zip(("de_density", "mae_density"), DENSITY["physical"], strict=True))  # inertia plays no part
    return base.replace(
        support=SUPPORT[side], de_width=w1, mae_width=w2, width=3 * w1 + 2 * w2, active_thickness=values["t1"],
        underlayer_modulus=values["underlayer_modulus"], **{DRIVEN[side]: values["strength"]}, **densities,
    )  # fmt: skip


def angles(base: Settings, cases: Sequence[Settings], side: str) -> tuple[np.ndarray, int, list[str]]:
    """Fold angle of each case [deg], as many as worlds; number of geometries; sentences on what was not found.

    Cases of one model are the worlds of one batch of parameters and one drive; an equilibrium starts from that of the
    world before it, if that one is driven less.
    """
    scene = scene_module("bifold")
    built = [scene.build(s) for s in cases]
    groups: dict[str, list[int]] = {}
    for i, (model, *_) in enumerate(built):
        groups.setdefault(model.hash, []).append(i)
    out, notes = np.full(len(cases), np.nan), []
    for members in groups.values():
        model = built[members[0]][0]
        parameters = stack([built[i][1] for i in members])
        strength = np.array([getattr(cases[i], DRIVEN[side]) for i in members])
        drive = Drive(voltage=strength) if side == "electric" else Drive(field=(0.0, 0.0, strength))
        before = None
        for world, i in enumerate(members):
            start = before if before is not None and strength[world] > strength[world - 1] else None
            found = equilibrium(model, parameters, drive, state=start, world=world)
            if not found.converged:
                before = None
                notes.append(f"combination {i + 1}: {found.message}")
                continue
            before = found.state
            out[i] = np.degrees(scene.fold_angles(model, found.x)[SIDES.index(side)])
    return out, len(groups), notes


def combine(
    base: Settings,
    side: str,
    reading: str,
    *,
    keep: Callable[[dict], bool] | None = None,
    moduli: Sequence[float] | None = None,
) -> Combinations:
    """All combinations of Table 5 or 6, solved and rated.

    Args:
        keep: only combinations for which it returns True; it gets w1, w2, t1, underlayer_modulus and strength.
        moduli: of the underlayer [Pa], instead of the table's.
    """
    rows = [
        {"w1": w1, "w2": w2, "t1": t, "underlayer_modulus": e, "strength": v}
        for w1, w2 in WIDTHS[reading]
        for t, e, v in itertools.product(THICKNESS[side], moduli or MODULUS[side, reading], STRENGTH[side])
    ]
    rows = [r for r in rows if keep is None or keep(r)]
    found, groups, notes = angles(base, [settings_of(base, side, reading, **r) for r in rows], side)
    c = {name: np.array([r[name] for r in rows]) for name in rows[0]}
    densities = DENSITY[reading]
    # Eq. 8; the field of Eq. 7 is V / (t1 + t2)
    c["mass"] = (3 * densities[0] * c["w1"] + 2 * densities[1] * c["w2"]) * base.side * c["t1"]
    if side == "electric":
        gap = c["t1"] + (base.underlayer_thickness if base.electrodes == "sandwich" else 0.0)
        c["energy"] = 0.5 * base.permittivity * EPS0 * (c["strength"] / gap) ** 2
    else:
        c["energy"] = c["strength"] ** 2 / (2 * MU0)
    c["angle"] = np.abs(found)
    for name in ("mass", "energy", "angle"):
        low, high = np.nanmin(c[name]), np.nanmax(c[name])
        c[f"relative_{name}"] = (c[name] - low) / (high - low) if high > low else np.zeros(len(rows))
    c["objective"] = (c["relative_angle"] + (1 - c["relative_mass"]) + (1 - c["relative_energy"])) / 3
    c["best"] = undominated(np.stack([c["mass"], c["energy"], -c["angle"]], axis=1))
    return Combinations(side, reading, c, groups, tuple(f"{side}, {reading}: {n}" for n in notes))


def undominated(costs: np.ndarray) -> np.ndarray:
    """[R] whether no other row of costs [R, K] is as small everywhere and smaller somewhere."""
    a, b = costs[:, None], costs[None]
    # equal designs differ by rounding
    tolerance = 1e-9 * np.ptp(costs, axis=0)
    worse = np.all(b <= a + tolerance, axis=-1) & np.any(b < a - tolerance, axis=-1)
    return ~worse.any(axis=1)


def slopes(base: Settings, side: str, *, change: float = 0.01) -> dict[str, float]:
    """d log angle / d log parameter in the middle of a table, small angles; other strips keep the width constant."""
    middle = {
        "electric": {"t1": 0.2e-3, "underlayer_modulus": 500e6, "strength": 40e3},
        "magnetic": {"t1": 0.6e-3, "underlayer_modulus": 1.5e6, "strength": 2e-3},
    }[side]
    out = {}
    for name in EXPECTED_SLOPES[side]:
        cases = []
        for factor in (1 - change, 1 + change):
            values, others = {"w1": 5e-3, "w2": 5e-3, **middle}, {}
            if name in values:
                values[name] *= factor
            else:
                others[name] = getattr(base, name) * factor
            if name == "w1":
                values["w2"] = (25e-3 - 3 * values["w1"]) / 2
            if name == "w2":
                values["w1"] = (25e-3 - 2 * values["w2"]) / 3
            cases.append(settings_of(base.replace(**others), side, "physical", **values))
        low, high = np.abs(angles(base, cases, side)[0])
        out[name] = float(np.log(high / low) / np.log((1 + change) / (1 - change)))
    return out


def corners(electric: Combinations, magnetic: Combinations) -> dict[str, tuple[float, float]]:
    """Largest relative angle of either side, (electric, magnetic), in two corners of the plane of mass and energy."""

    def largest(c: Combinations, heavy: bool, strong: bool) -> float:
        mass, energy = c.columns["relative_mass"], c.columns["relative_energy"]
        chosen = ((mass > 0.5) == heavy) & ((energy > 0.5) == strong)
        return float(np.nanmax(c.columns["relative_angle"][chosen]))

    return {
        "light, much energy": (largest(electric, False, True), largest(magnetic, False, True)),
        "heavy, little energy": (largest(electric, True, False), largest(magnetic, True, False)),
    }


# drawing and saving ---------------------------------------------------------------------------------------------------


def draw(sets: dict[tuple[str, str], Combinations], file: Path):
    """Fig. 20: relative angle over relative mass, relative energy as colour, undominated designs ringed."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 2, figsize=(10.5, 8), sharex=True, sharey=True, layout="constrained")
    shown = None
    for row, reading in zip(axes, READINGS, strict=True):
        for ax, side in zip(row, SIDES, strict=True):
            c = sets[side, reading].columns
            order = np.argsort(c["relative_energy"], kind="stable")
            x, y, e = (c[f"relative_{n}"][order] for n in ("mass", "angle", "energy"))
            best = c["best"][order]
            shown = ax.scatter(x, y, c=e, cmap="viridis", vmin=0, vmax=1, s=34, lw=0, alpha=0.9)
            ax.scatter(x[best], y[best], s=80, facecolors="none", edgecolors="crimson", lw=1.1)
            top = int(np.nanargmax(c["objective"]))
            ax.plot(c["relative_mass"][top], c["relative_angle"][top], "*", color="gold", mec="k", ms=17)
            low, high = np.nanmin(c["angle"]), np.nanmax(c["angle"])
            mass = c["mass"] * 1e6
            ax.set_title(
                f"{side}, {reading}\n{low:.2g} to {high:.3g} deg, {mass.min():.3g} to {mass.max():.3g} mg", fontsize=10
            )
            ax.grid(alpha=0.3)
    for ax in axes[1]:
        ax.set_xlabel("relative mass of the active strips")
    for ax in axes[:, 0]:
        ax.set_ylabel("relative fold angle")
    if shown is not None:
        figure.colorbar(shown, ax=axes, label="relative energy (square of the applied field)", shrink=0.7)
    figure.suptitle(
        "Bi-fold, all combinations. Ring: no other is better in one of the three and as good in the rest.\n"
        "Star: best mean of angle, mass saved and energy saved.",
        fontsize=10,
    )
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=90)
    plt.close(figure)


def save(c: Combinations, file: Path):
    """Writes a set as Parquet, units as field metadata, in one step."""
    units = c.units
    schema, arrays = [], []
    for name, values in c.columns.items():
        arrays.append(pa.array(values))
        schema.append(pa.field(name, arrays[-1].type, metadata={"unit": units[name]} if name in units else None))
    _replace(file, lambda part: pq.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(schema)), part))


def _replace(file: Path, write: Callable[[Path], object]):
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=file.parent) as folder:
            part = Path(folder) / file.name
            write(part)
            os.replace(part, file)
    except OSError as e:
        raise InputError(
            f"cannot be written ({e.strerror})", file=file, allowed="a folder that can be written"
        ) from None


# command --------------------------------------------------------------------------------------------------------------


def study(base: Settings, out: Path, *, say: Callable[[str], None] = print) -> dict:
    """Tables 5 and 6 in both readings; writes SIDE_READING.parquet, tradeoffs.png and report.json into `out`."""
    _replace(out / "settings.json", lambda part: part.write_text(json.dumps(base.as_dict(), indent=1)))
    sets = {}
    for side, reading in itertools.product(SIDES, READINGS):
        c = sets[side, reading] = combine(base, side, reading)
        save(c, out / f"{side}_{reading}.parquet")
        say(f"{side}, {reading}: {len(c.columns['angle'])} worlds of {c.groups} geometries, {len(c.failures)} without "
            f"equilibrium")  # fmt: skip
        for failure in c.failures:
            say(failure)
    draw(sets, out / "tradeoffs.png")
    report: dict = {"settings": base.as_dict(), "sets": {}, "slopes": {}, "corners": {}}
    for side in SIDES:
        both = {r: sets[side, r] for r in READINGS}
        ranks = {r: c.ranks() for r, c in both.items()}
        expected = EXPECTED_RANKS[side]
        say(f"\n{side}: rank correlation with the angle")
        say(format_table({
            "variable": list(VARIABLES), **{r: [ranks[r].get(v, np.nan) for v in VARIABLES] for r in READINGS},
            "expected": [expected.get(v, np.nan) for v in VARIABLES],
        }, {}))  # fmt: skip
        found = report["slopes"][side] = slopes(base, side)
        say(f"\n{side}: d log angle / d log parameter")
        say(format_table({
            "parameter": list(found), "here": list(found.values()), "expected": list(EXPECTED_SLOPES[side].values()),
        }, {}))  # fmt: skip
        say(f"\n{side}: the five best objectives")
        for reading, c in both.items():
            top = np.argsort(-np.nan_to_num(c.columns["objective"], nan=-1.0), kind="stable")[:5]
            names = ("w1", "w2", "t1", "underlayer_modulus", "strength", "mass", "energy", "angle", "objective")
            say(f"{reading}:\n" + format_table({n: c.columns[n][top] for n in names}, c.units))
            report["sets"][f"{side}_{reading}"] = {
                "worlds": len(c.columns["angle"]), "geometries": c.groups, "failures": list(c.failures),
                "ranks": ranks[reading], "best": {n: float(c.columns[n][top[0]]) for n in names},
                "smallest_angle": float(np.nanmin(c.columns["angle"])),
                "largest_angle": float(np.nanmax(c.columns["angle"])),
            }  # fmt: skip
    for reading in READINGS:
        found = corners(sets["electric", reading], sets["magnetic", reading])
        report["corners"][reading] = found
        for where, (e, m) in found.items():
            say(f"{reading}, {where}: largest relative angle {e:.2f} electric, {m:.2f} magnetic")
    text = json.dumps(report, indent=1)
    _replace(out / "report.json", lambda part: part.write_text(text))
    say(f"results: {out}")
    return report


def run(args: argparse.Namespace, say: Callable[[str], None] = print) -> dict:
    """The command `origami-sim study bifold`; its report.

    Raises:
        InputError: a setting that the study itself varies; what the calibration refuses.
    """
    base = scene_settings(scene_module("bifold"), args.calibration)
    for name in (text.partition("=")[0].strip() for text in args.set):
        if name in VARIED:
            raise InputError(
                "is varied by the study", field="--set", value=name, allowed="settings other than " + ", ".join(VARIED)
            )
    return study(base.override(args.set, "--set"), args.out, say=say)

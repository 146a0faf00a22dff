"""Dielectric-elastomer folding actuator: the bender with fewer tape layers in a notch, where it folds.

    python -m origami_sim.scenes.de_fold

Arm, notch, arm and a bare tip in a row, see de_bender for the section and the chain. The notch must keep some tape:
a stack without any is symmetric and does not bend. Plane sections end at the border of the notch; finite elements show
that the stack bends some way into the arms, as if the notch were longer (`notch_law`, calibrations/crease_notch.toml).
"""

import re
from collections.abc import Sequence

import numpy as np

from origami_sim.device.scene import Outcome, Progress, Settings, is_reference, motion_of, read_calibration
from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters

from .de_bender import Segment, chain, exponent, inclinations, settle

CALIBRATION = "de_fold"
VOLTAGES = np.array([1000.0, 2000.0, 3000.0, 4000.0])
REFERENCE = {"notch_deg": np.array([0.72, 2.91, 6.70, 12.30]), "arms_deg": np.array([0.37, 1.47, 3.31, 5.89])}
"""Angles at VOLTAGES for the default calibration: Ogden sections, plane strain, solved independently."""


def segments(s: Settings, hinges: float) -> list[Segment]:
    """Arm, notch, arm under the electrode, and the bare tip; `hinges` in the notch."""
    arm = (s.electrode_length - s.notch_length) / 2
    bare = s.length - s.electrode_length
    for name, value in (("notch_length", arm), ("electrode_length", bare)):
        if not value > 0:
            raise InputError(
                "notch, electrode and strip must each be longer than the one before",
                file=s.file,
                field=name,
                value=getattr(s, name),
                allowed="notch_length < electrode_length < length",
            )
    n = round(hinges)
    each = max(1, round(n * arm / s.notch_length))
    return [
        Segment(arm, each, s.tape_layers, True),
        Segment(s.notch_length, n, s.notch_tape_layers, True, effective_length(s) / s.notch_length),
        Segment(arm, each, s.tape_layers, True),
        Segment(bare, 1, s.tape_layers, False),
    ]


def effective_length(s: Settings) -> float:
    """Length of strip that bends as the notch does [m]: its own, or that of the finite-element calibration.

    Raises:
        InputError: the stored law is for another notch.
    """
    if s.notch_law == "plane_section":
        return s.notch_length
    law = read_calibration("crease_notch")
    made = dict(re.findall(r"--([a-z-]+)=(\S+)", law.command))
    for name, value in (
        ("notch_length", law.notch),
        ("notch_tape_layers", float(made["notch-layers"])),
        ("tape_layers", float(made["arm-layers"])),
    ):
        if not np.isclose(s[name].value, value, rtol=1e-6):
            raise InputError(
                "the finite-element law is for another notch (origami-sim calibrate stack makes one)",
                file=s.file,
                field=name,
                value=s[name].value,
                allowed=f"{value:g} {s[name].unit}",
            )
    return law.effective_length


def build(s: Settings, *, hinges: float | None = None) -> tuple[Model, Parameters, Drive]:
    """The chain; in the notch every hinge turns by as much more as the notch is effectively longer."""
    return chain(s, segments(s, hinges or s.hinges))


def turns(parts: Sequence[Segment], x: np.ndarray) -> np.ndarray:
    """Angle through which each segment bends [rad]; x [N, 3]."""
    borders = np.cumsum([0, *(g.hinges for g in parts)])
    return np.diff(inclinations(x)[borders])


def fold(s: Settings, voltages: Sequence[float] | np.ndarray = VOLTAGES) -> tuple[dict[str, np.ndarray], list[str]]:
    """Angles of notch and arms by statics [deg], counted from the shape without voltage, and their sum; what failed.

    The localisation is the mean curvature of the notch over that of the arms.
    """
    parts = segments(s, s.hinges)
    rest, shapes, notes = settle(build(s), voltages)
    angle = np.degrees([turns(parts, x) - turns(parts, rest) for x in shapes])
    notch, arms = angle[:, 1], angle[:, 0] + angle[:, 2]
    per_length = (notch / s.notch_length) / (arms / (s.electrode_length - s.notch_length))
    return {
        "voltage_kV": np.asarray(voltages) / 1e3,
        "notch_deg": notch,
        "arms_deg": arms,
        "total_deg": notch + arms,
        "localisation": per_length,
    }, notes


def run(s: Settings, progress: Progress | None = None) -> Outcome:
    """Angles by statics, and the motion for the replay."""
    voltages = s.voltage * VOLTAGES / VOLTAGES[-1]
    table, notes = fold(s, voltages)
    if is_reference(s, CALIBRATION, besides={"gravity"}):
        table |= {f"reference_{k}": v for k, v in REFERENCE.items()}
    power = exponent(voltages, table["notch_deg"])
    model, parameters, signals = build(s, hinges=s.motion_hinges)
    motion = motion_of(s, model, parameters, signals, duration=2.0, rate=60, progress=progress)
    final = float(np.degrees(turns(segments(s, s.motion_hinges), motion.x[-1, :, 0])[1]))
    notch, arms = float(table["notch_deg"][-1]), float(table["arms_deg"][-1])
    return Outcome(
        motion,
        {"fold_angle": {**table}},
        units={"voltage_kV": "kV", **{c: "deg" for c in table if c.endswith("_deg")}},
        summary=[
            *notes,
            f"at {s.voltage / 1e3:g} kV the notch folds by {notch:.2f} deg and the arms bend by {arms:.2f} deg by "
            f"statics; the notch ends the motion at {final:.2f} deg",
            f"the notch bends {table['localisation'][-1]:.1f} times as sharply as the arms; its angle goes as the "
            f"voltage to the power {power:.3f}",
        ],
        numbers={
            "notch_deg": notch,
            "arms_deg": arms,
            "exponent": power,
            "dynamic_notch_deg": final,
            "localisation": float(table["localisation"][-1]),
        },
    )


if __name__ == "__main__":
    from origami_sim.commands.cli import main

    main(["run", "de_fold"])

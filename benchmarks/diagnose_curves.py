"""Diagnosis of the real curves: a crease's torque, relaxation of VHB, a magnetic beam.

    python benchmarks/diagnose_curves.py [torque | relaxation | beam] ... [--json FOLDER]

Needs recordings (`origami_sim.device.scene.recordings_folder`). Prints verdict, candidates, places, next experiments.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from origami_sim.device.scene import read_calibration, recordings_folder, scene_module, scene_settings
from origami_sim.diagnose import Diagnosis, Subject, diagnose
from origami_sim.locate.locate_curves import sign_changes
from origami_sim.recording import Channel, Recording
from origami_sim.recording.recording import DriveChannel, estimate_noise

LENGTH = 0.08
"""Gauge length of the VHB strips [m]: the lever on which force becomes moment and displacement angle."""

FRAMES = 225
"""Frames of a relaxation test that are compared; the law is exact between them."""

DIGITISED = 0.005
"""Standard deviation of the beam's points over its length: reading a printed diagram (assumed)."""


def torque(folder: Path) -> tuple[Subject, list[Recording]]:
    """Moment against angle of one real hinge; linear nominal of unknown scale: the source states no unit of torque."""
    angle, moment = np.loadtxt(folder / "crease_torque" / "unit075.csv", delimiter=",", skiprows=1).T
    steps = np.arange(len(angle), dtype=float)
    channel = Channel("moment", "moment", 1e-3 * moment, "N m", estimate_noise(steps, 1e-3 * moment), {"crease": 0})
    drive = {"crease_angle": DriveChannel("crease_angle", np.radians(angle), "rad", False)}
    module = scene_module("crease_coupon")
    settings = scene_settings(module)
    # the scale is unknown: a prior as wide as the value; zero torque at 55.3 deg as published, to 0.5 deg
    subject = Subject.from_scene(
        module, settings, spreads={"stiffness": settings.stiffness, "rest_angle": np.radians(0.5)}
    )
    return subject, [Recording("unit075", steps, {"moment": channel}, drive, {"time_base": "step"})]


def relaxation(folder: Path) -> tuple[Subject, list[Recording]]:
    """Force of stretched VHB strips in time, each as a crease on a lever of its gauge length; nominal: elastic."""
    recordings = []
    for name in ("1p5", "2p0", "2p5"):
        table = np.loadtxt(folder / "vhb_relaxation" / f"relaxation_stretch_{name}.csv", delimiter=",", skiprows=1)
        # the noise of the force at the end of the hold, where 400 points span a change of some per cent
        noise = estimate_noise(np.arange(400.0), table[-400:, 2]) * LENGTH
        t, u, f = table[np.unique(np.linspace(0, len(table) - 1, FRAMES).round().astype(int))].T
        moment = Channel("moment", "moment", f * LENGTH, "N m", noise, {"crease": 0})
        drive = {"crease_angle": DriveChannel("crease_angle", 1e-3 * u / LENGTH, "rad", False)}
        recordings.append(Recording(f"stretch_{name}", t, {"moment": moment}, drive))
    module = scene_module("crease_coupon")
    stiffness = 0.08
    settings = scene_settings(module).replace(stiffness=stiffness, rest_angle=0.0)
    return Subject.from_scene(module, settings, spreads={"stiffness": stiffness, "rest_angle": 1e-3}), recordings


def beam(folder: Path) -> tuple[Subject, list[Recording]]:
    """Tip deflection of a magnetic cantilever against field, by load step."""
    field, deflection = np.loadtxt(folder / "magnetic_beam" / "beam.csv", delimiter=",", skiprows=1).T
    module = scene_module("mae_cantilever")
    settings = read_calibration("magnetic_beam").replace(cells=8.0)
    model = module.build(settings)[0]
    tip = int(np.argmax(model.position[:, 0]))
    channel = Channel(
        "tip",
        "tip_displacement",
        deflection * settings.length,
        "m",
        DIGITISED * settings.length,
        {"node": tip, "direction": [0.0, 0.0, 1.0]},
    )
    levels = np.outer(1e-3 * field, [0.0, 0.0, 1.0])
    drive = {"field": DriveChannel("field", levels, "T", False)}
    recording = Recording("beam", np.arange(len(field), dtype=float), {"tip": channel}, drive, {"time_base": "step"})
    spreads = {"modulus": 0.1 * settings.modulus, "remanence": 0.05 * settings.remanence}
    return Subject.from_scene(module, settings, spreads=spreads), [recording]


CASES = {"torque": torque, "relaxation": relaxation, "beam": beam}


def show(d: Diagnosis):
    """The diagnosis in lines of text."""
    print(d.verdict, f"p = {d.probability:.3f}:", d.sentence)
    for c in d.candidates:
        numbers = ", ".join(f"{n.label} {n.value:.4g} [{n.low:.4g}, {n.high:.4g}] {n.unit}" for n in c.numbers)
        print(f"  {c.label}: p {c.probability:.3f}, held-out rms {c.rms}")
        print(f"    {numbers}; {c.why}{'; ' + c.distrust if c.distrust else ''}{c.failed}")
    print("  rms as given", d.error_before, "refitted", d.error_refitted, "after", d.error_after, "noise", d.noise)
    for s in d.screening[:8]:
        print(f"  screened {s.label}: z {s.z:.1f}, explains {s.explained:.2f}")
    for p in d.places:
        print(f"  place {p.site}: score {p.score:.1f}")
        for curve in p.curves:
            changes = ", ".join(f"{x:.3g}" for x in sign_changes(curve)) or "none"
            print(f"    residual moment against {curve.against}: {np.array(curve.mean).round(8).tolist()}")
            print(f"    at {np.array(curve.x).round(4).tolist()} {curve.unit}; sign changes at {changes}")
    for e in d.experiments:
        print(f"  next: {e.what}: {e.information:.1f} bits")
    for n in d.notes:
        print("  note:", n)


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("cases", nargs="*", choices=[*CASES, []], help="which curves (default: all)")
    parser.add_argument("--json", type=Path, help="folder for the diagnoses")
    given = parser.parse_args()
    folder = recordings_folder()
    if folder is None:
        sys.exit("the recordings are not here: set ORIGAMI_RECORDINGS to their folder")
    for name in given.cases or CASES:
        began = time.perf_counter()
        d = diagnose(*CASES[name](folder))
        print(f"== {name} ({time.perf_counter() - began:.0f} s)")
        show(d)
        if given.json:
            given.json.mkdir(parents=True, exist_ok=True)
            d.save_json(given.json / f"{name}.json")


if __name__ == "__main__":
    main()

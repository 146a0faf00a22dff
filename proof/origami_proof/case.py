"""The diagnosis of one case, from its folder alone.

python -m origami_proof.case FOLDER [--show INTO]: the diagnosis, or its page and replays.
"""

import argparse
import json
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from origami_sim.design.build import Sheet
from origami_sim.device.scene import scene_module, scene_settings
from origami_sim.diagnose import Diagnosis, Options, Subject, diagnose, factor
from origami_sim.diagnose.keep import Keep
from origami_sim.diagnose.overlay import write_overlays
from origami_sim.drive import Drive
from origami_sim.files import write_text
from origami_sim.pattern.assemble import assemble
from origami_sim.physics.materials import MU0
from origami_sim.recording import read_recording
from origami_sim.report.page import geometry_of, write_report

RIGIDITY = 2e5
"""Stiffness of each bar that keeps a panel's shape, over the device's weight [1/m]: panels stretch by some 0.003 mm."""

STORED = "stored.npz"
"""What a case keeps of its search, to be judged anew (`rejudge`)."""

LOSS = 0.1
"""Part of critical damping of a foot on the ground."""

DIAGONAL_STIFFNESS = 1.0
"""Of the diagonals of a panel, some 2500 times that of a crease [N m/rad]."""


def subject(folder: Path) -> Subject:
    """The model that an experimenter would build from object.json, with what is known of its numbers.

    An object is a scene with its settings [SI] and the standard deviations of some, or described panel by panel.
    """
    o = json.loads((folder / "object.json").read_text())
    if "scene" in o:
        module = scene_module(o["scene"])
        return Subject.from_scene(module, scene_settings(module).replace(**o["settings"]), spreads=o["priors"])
    return panels(o)


def panels(o: dict) -> Subject:
    """Rigid panels on linear, viscous creases.

    Panels are kept straight by bars that stretch by less than a thousandth under the device's weight.
    """
    x, faces = np.array(o["vertices"]), o["faces"]
    sheet = Sheet(
        assemble(x, [tuple(f) for f in faces]),
        thickness=o["thickness"],
        density=o["density"],
        modulus=1.5e6,
        triangulation="center",
    )
    if o["held"] is not None:
        sheet.fix(panels=[o["held"]])
    else:  # between two glass plates
        sheet.fix(nodes=range(len(x)), axes="y")
    corners = [x[f] for f in faces]
    area = sum(
        np.linalg.norm(sum(np.cross(c[k] - c[0], c[k + 1] - c[0]) for k in range(1, len(c) - 1))) / 2
        for p, c in enumerate(corners)
        if p != o["held"]
    )
    weight = o["density"] * o["thickness"] * area * o["gravity"]
    sheet.on("bars").set("bars", stiffness=RIGIDITY * weight)
    sheet.set("panel_bending", stiffness=DIAGONAL_STIFFNESS)
    for m in o["magnets"]:
        sheet.magnetise(m["panel"], remanence=1.0, volume=m["moment"] * MU0, poling=m["poling"])
    sheet.crease(range(len(o["creases"])), stiffness=0.0)
    sheet.on("crease_viscosity")
    sheet.gravity((0.0, 0.0, -o["gravity"]))
    sheet.membrane_damping = 0.0
    sheet.name("panel", [f"panel{p}" for p in range(len(faces))])
    for foot in o.get("feet", ()):
        leg = x[faces[foot["panel"]][0], 2]
        sides = np.unique(x[faces[foot["panel"]], 1])
        at = [sheet.contact(foot["panel"], (foot["at"], y, leg), offset=-leg, name=foot["name"]) for y in sides]
        sheet.set("coulomb", at, friction_coefficient=foot["friction"])
        load = foot["load"] / len(at)
        for effect, force in (("ground", load), ("friction", foot["friction"] * load)):
            stiffness = force / foot["give"]
            damping = 2.0 * LOSS * np.sqrt(stiffness * load / o["gravity"])
            sheet.set(effect, at, stiffness=stiffness, damping=damping)
    model, parameters = sheet.build()
    middles = model.position[model.creases[:, 1:3]].mean(1)
    names = [""] * len(middles)
    for c in o["creases"]:
        parent, child = (faces[p] for p in c["panels"])
        middle = x[[v for v in child if v in parent]].mean(0)
        n = int(np.argmin(np.linalg.norm(middles - middle, axis=1)))
        names[n] = c["name"]
        parameters.set("crease", "stiffness", c["stiffness"], np.array([n]))
        parameters.set("crease_viscosity", "viscosity", c["viscosity"], np.array([n]))
    model = replace(model, names={**model.names, "crease": tuple(names)})
    return Subject.from_model(model, parameters, Drive(), [factor(n, s) for n, s in o["priors"].items()])


def diagnose_case(folder: Path) -> dict:
    """Diagnoses the recordings of a case's folder and writes diagnosis.json there, as soon as there is a verdict."""
    began = time.perf_counter()
    recordings = [read_recording(p) for p in sorted(folder.glob("recording*.csv"))]
    rate = 1.0 / float(np.median(np.diff(recordings[0].times)))
    keep = Keep(store=True)

    def write(found: Diagnosis) -> None:
        write_json(folder / "diagnosis.json", short(found, time.perf_counter() - began, rate))
        if keep.stored is not None:
            keep.stored.save(folder / STORED)
            keep.stored = None  # it does not change any more

    keep.write = write
    diagnose(subject(folder), recordings, Options(threads=1), keep=keep)
    return json.loads((folder / "diagnosis.json").read_text())


def short(diagnosis: Diagnosis, seconds: float, rate: float) -> dict:
    """A diagnosis without what only its page shows, with the time that it took [s] and frames per second."""
    found = diagnosis.to_dict()
    found["worked"] = telling(found["traces"])
    for bulky in ("traces", "correlations", "isolability"):
        found.pop(bulky, None)
    for place in found["places"]:
        for bulky in ("times", "moment", "error", "curves"):
            place.pop(bulky, None)
    return {**found, "wall": seconds, "rate": rate}


def show(folder: Path, into: Path) -> list[Path]:
    """Page, replays and data of a case's diagnosis, as `origami-sim diagnose` writes them; they are returned."""
    keep = Keep()
    recordings = [read_recording(p) for p in sorted(folder.glob("recording*.csv"))]
    found = diagnose(subject(folder), recordings, keep=keep)
    assert keep.forward is not None
    into.mkdir(parents=True, exist_ok=True)
    page = write_report(found, into / "report.html", geometry=geometry_of(keep.forward.model))
    return [page, found.save_json(into / "diagnosis.json"), *write_overlays(into, keep, found)]


def telling(traces: list[dict]) -> dict | None:
    """The trace on which the explanation gains most over the refitted model, in units of the noise."""

    def gain(t: dict) -> float:
        recorded, refitted, after = (np.array(t[k], float) for k in ("recorded", "refitted", "after"))
        return float(np.nansum((recorded - refitted) ** 2 - (recorded - after) ** 2)) / t["noise"] ** 2

    keys = ("recording", "component", "unit", "noise", "times", "recorded", "refitted", "after")
    return {k: max(traces, key=gain)[k] for k in keys} if traces else None


def guard(event: str, arguments: tuple) -> None:
    """Audit hook: the diagnosis never opens an answer."""
    if event == "open" and Path(str(arguments[0])).parent.name == "sealed":
        raise PermissionError("the diagnosis tried to open a sealed answer")


def write_json(path: Path, value) -> None:
    write_text(path, json.dumps(value, indent=1))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="the diagnosis of one case, or its page and replays")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--show", type=Path, metavar="INTO", help="write page and replays here, not the diagnosis")
    args = parser.parse_args()
    sys.addaudithook(guard)
    if args.show:
        print(*show(args.folder, args.show), sep="\n")
    else:
        diagnose_case(args.folder)

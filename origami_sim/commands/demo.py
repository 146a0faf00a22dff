"""`origami-sim demo`: box, crawler, a pattern from a file, and a recording beside its simulation; a page of all."""

import argparse
import json
import time
from pathlib import Path

from origami_sim.commands.cli import OK, _print_json, _save, _soundness, _tell
from origami_sim.commands.compare import replicated, save_comparison, shipped_sidecar
from origami_sim.commands.demo_page import Section, write_report
from origami_sim.commands.progress import Bar
from origami_sim.device.scene import recordings_folder, scene_module, scene_settings
from origami_sim.recording import read_recording, stand_in_double_pendulum
from origami_sim.recording.stand_in import write_stand_in_sidecar
from origami_sim.results.run_folder import check_writable

SCENES = ("box", "crawler", "fold_file")

STAND_IN_SECONDS, COMPARED_SECONDS = 20.0, 5.0
"""Of the recording that is made here, and of what is compared of a recording [s]."""


def run(args: argparse.Namespace) -> int:
    """Runs the command and returns its exit code."""
    began = time.perf_counter()
    out = Path(args.out)
    for name in (*SCENES, "pendulum_chain"):
        check_writable(out / name)
    say = (lambda *_, **__: None) if args.json else print
    sections, numbers, worst = [], {}, OK
    for name in SCENES:
        module = scene_module(name)
        settings = scene_settings(module)
        say(f"== {name}", flush=True)
        outcome = module.run(settings, progress=Bar(name))
        _save(out / name, name, outcome, settings.as_dict(), [], {})
        if not args.json:
            _tell(args, outcome, out / name)
        sections.append(Section.of(name, module, outcome, out / name))
        numbers[name] = outcome.numbers
        worst = max(worst, _soundness(outcome.trajectory))

    say("== pendulum_chain", flush=True)
    module = scene_module("pendulum_chain")
    # a recording to try the other commands on, whether or not the real one is there
    stand_in = stand_in_double_pendulum(out / "stand_in.csv", duration=STAND_IN_SECONDS)
    sidecar = write_stand_in_sidecar(stand_in)
    folder = recordings_folder()
    real = folder / "pendulum_chain" / "double.csv" if folder else None
    if real is not None and real.is_file():
        source, described, note = real, shipped_sidecar("pendulum_chain_double"), "real recording"
    else:
        note = "stand-in recording, made here because the real ones are absent (they are not part of this package)"
        source, described = stand_in, sidecar
    say(f"{note}: {source.name}")
    recording = read_recording(source, described)
    part = recording.window(recording.times[0], recording.times[0] + COMPARED_SECONDS)
    comparison, motion, used = replicated(module, scene_settings(module), part, 5.0)
    save_comparison(out / "pendulum_chain", "pendulum_chain", comparison, motion, used, part, [])
    worst = max(worst, _soundness(motion))
    if comparison is not None:
        say(comparison.table())
        say(comparison.sentence())
    commands = [
        f"origami-sim compare {stand_in} --scene pendulum_chain",
        f"origami-sim diagnose {stand_in} --model pendulum_chain",
    ]
    where = out / "pendulum_chain"
    sections.append(Section.of_comparison("pendulum_chain", module, comparison, motion, note, where, commands))

    page = write_report(out / "index.html", sections)
    say(f"\nreport: {page}\nreplays: " + ", ".join(f"origami-sim replay {out / s.name}" for s in sections))
    say("a recording to try: " + "\n                    ".join(commands))
    say(f"done in {time.perf_counter() - began:.0f} s")
    if args.json:
        numbers["pendulum_chain"] = {"recording": note, **(json.loads(comparison.to_json()) if comparison else {})}
        _print_json({"report": str(page), "numbers": numbers, "wall": time.perf_counter() - began})
    return worst

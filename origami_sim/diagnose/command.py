"""`origami-sim diagnose`: from files to a verdict, and everything that it leaves behind."""

import json
import signal
import sys
import tempfile
import threading
import time as clock
from argparse import Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from types import ModuleType

from origami_sim.device.device import device_module, is_device, modelled
from origami_sim.device.scene import (
    NAMES,
    Settings,
    check_recorded_scene,
    read_calibration,
    recorded_model,
    scene_module,
    scene_settings,
    settings_of,
)
from origami_sim.diagnose.diagnose import diagnose
from origami_sim.diagnose.keep import Keep
from origami_sim.diagnose.later import attempt
from origami_sim.diagnose.observed import check_recording
from origami_sim.diagnose.options import Options
from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.hypotheses.hypothesis import Subject
from origami_sim.hypotheses.subject import known_before, with_units
from origami_sim.infer.unlisted import UNLISTED
from origami_sim.observation.doubts import doubts, naming
from origami_sim.quantities import ANY
from origami_sim.recording import DataSet, Recording, lint_report, read_dataset
from origami_sim.report.diagnosis import Diagnosis
from origami_sim.report.page import geometry_of, write_report
from origami_sim.report.page.next_experiment import finding
from origami_sim.report.patch import patched, write_patch

REPORT, JSON, PATCH, RESUME = "report.html", "diagnosis.json", "patched.toml", ".resume"

EXACT = "note: no setting has a prior, so all are taken as exact; state how well they are known with --prior."

THOROUGH = Options(rate=400.0, fits=48, limit=3000.0)


def run(args: Namespace) -> int:
    """The command; returns the verdict's exit code."""
    folder = Path(args.out or "runs/diagnose")
    if args.model:
        check_model(folder / PATCH, args.model)
    check_folder(folder, lambda: _earlier(folder) is not None, "a diagnosis")
    asked = read_arguments(args)
    for file in filter(None, (args.model, asked.given, asked.calibration)):
        check_model(folder / PATCH, file)
    replaced = _earlier(folder)
    if replaced and set(replaced) != {r.name for r in asked.recordings}:
        asked.said.insert(0, f"note: replaces the report of {', '.join(replaced)} in {folder}.")
    options = replace(options_of(args, asked.settings), possible=getattr(asked.module, "POSSIBLE", None))
    catalogue = None if args.suspects is None else [get(s.strip()).name for s in args.suspects.split(",")]
    if not args.json:
        print("\n".join(asked.said), flush=True)
    keep, progress = Keep(folder / RESUME), Progress()
    files = keep.write = Files(folder, asked.known_units, asked.device, keep)
    keep.film = files.film
    try:
        with ending_as_interrupted():
            found = diagnose(
                asked.subject, asked.recordings, options, catalogue=catalogue, progress=progress, keep=keep
            )
            progress.stage("page")
            files.finish(found)
    except KeyboardInterrupt:
        progress.end()
        print("origami-sim: the same command goes on from here.", file=sys.stderr)
        if keep.found is None:
            raise
        raise KeyboardInterrupt(f"interrupted after the verdict, {keep.found.verdict}: {files.shown}") from None
    progress.end()
    if not found.ended:  # else the same command with more time goes on from there
        keep.clear()
    if args.json:
        print(json.dumps(_summary(found, files.made), allow_nan=False))
    else:
        print("\n".join(_text(found, files.made, files.scene)))
    return found.exit_code


# input ----------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Arguments:
    """What a command line states: recordings, the model of their object, and what is known of its numbers.

    Attributes:
        said: lines to print once nothing can be refused any more. given: the scene, device or calibration.
        calibration: a file of it, or None. known_units: the settings, with the units that the model tells.
    """

    subject: Subject
    recordings: list[Recording]
    module: ModuleType
    settings: Settings
    known_units: Settings
    given: str
    calibration: str | None
    said: list[str]

    @property
    def device(self) -> str:
        """What `run` calls the scene or device."""
        return self.given if is_device(self.given) else self.module.__name__.rpartition(".")[2]


def read_arguments(args: Namespace) -> Arguments:
    """Reads recordings, model, settings and priors from a command line.

    Raises:
        InputError: what cannot be read, or contradicts.
    """
    data = read_recordings(args.recordings, args.sidecar)
    given, calibration = modelled(args.model or recorded_model(data[0], "--model"), args.calibration, "--model")
    said = [lint_report(recording) for recording in data]
    said += [f"note: {note}" for note in data.notes]
    module, settings = model_of(given, data)
    settings = settings if calibration is None else scene_settings(module, calibration)
    name = module.__name__.rpartition(".")[2]
    overrides = _overrides(data, name)
    if overrides and (calibration or given.endswith(".toml")):
        which = "--calibration" if args.calibration else "--model"
        said.append(f"note: the sidecar's overrides are left out: {which} states the numbers of this object itself.")
    else:
        settings = _assigned(settings, overrides, data[0].metadata.get("sidecar"))
    settings = _assigned(settings, args.set, "--set")
    model, parameters, drive, *_ = module.build(settings)
    recordings = []
    for recording in data:
        notes = doubts(recording, model, parameters, drive)
        with naming(recording.metadata.get("file")):
            check_recording(recording, model)
        said += [f"note: {note}" for note in notes]
        recordings.append(
            replace(recording, metadata={**recording.metadata, "notes": [*recording.metadata.get("notes", ()), *notes]})
        )
    known, single, aligned = known_before(settings, data[0], args.prior, model, parameters)
    subject = Subject.from_scene(module, settings, spreads=known, name=name).tuned(single).beside(aligned)
    if not subject.nominals:
        said.append(
            "note: no setting has a prior, so all are taken as exact; state how well they are known with --prior."
        )
    units = with_units(module, settings, parameters)
    return Arguments(subject, recordings, module, settings, units, given, calibration, said)


def read_recordings(paths: Sequence[str], sidecar: str | None = None) -> DataSet:
    """Recordings of one object: tables, or one folder or listing; known recordings have shipped sidecars.

    Raises:
        InputError: what `read_dataset` refuses.
    """
    files = [Path(p) for p in paths]
    for file in files:
        if not file.name and len(files) > 1:
            raise InputError("is a folder", field="RECORDING", value=str(file), allowed="tables, or one folder")
    if len(files) == 1 and (files[0].is_dir() or files[0].suffix.lower() == ".toml"):
        return read_dataset(files[0], sidecar=sidecar)
    if sidecar is None and not any(f.with_suffix(".toml").exists() for f in files):
        shipped = [_shipped(f) for f in files]
        first = next((s for s in shipped if s is not None), None)
        if len(set(shipped)) > 1 and first is not None:  # recordings that were driven differently
            return read_dataset(files, sidecar=[s or first for s in shipped])
        sidecar = None if first is None else str(first)
    return read_dataset(files, sidecar=sidecar)


def _shipped(recording: Path) -> Path | None:
    """The sidecar that ships with the package for recordings of this folder, of the same stem or series (a_1, a_2)."""
    scenes = resources.files("origami_sim.scenes")
    for stem in (recording.stem, recording.stem.rpartition("_")[0]):
        found = Path(str(scenes / f"{recording.resolve().parent.name}_{stem}.toml"))
        if stem and found.is_file():
            return found
    return None


def model_of(given: str, data: DataSet) -> tuple[ModuleType, Settings]:
    """The scene of a name or of a calibration, with its settings.

    A calibration belongs to the scene that has the same settings; of several, to the one that the sidecar names.

    Raises:
        InputError: no such scene, a calibration of none, a sidecar that names another scene or none that exists.
    """
    found = data[0].metadata.get("scene") or {}
    stated = found.get("name")
    if is_device(given):
        module = device_module(given)
        check_recorded_scene(data[0], module.__name__, "--model")
        return module, scene_settings(module)
    if stated is not None and stated not in NAMES:
        raise InputError(
            "the sidecar's scene does not exist",
            file=data[0].metadata.get("sidecar"),
            field="scene.name",
            value=found["stated"],
            allowed=f"{', '.join(NAMES)}; or a device that --model names by its file, {stated}.py",
        )
    if not given.endswith(".toml"):
        module = scene_module(given)
        check_recorded_scene(data[0], given, "--model")
        return module, scene_settings(module)
    settings = read_calibration(given)
    own = {n: settings_of(scene_module(n), settings) for n in NAMES}
    fitting = [n for n, names in own.items() if names == set(settings)]
    if stated in fitting:
        fitting = [stated]
    if len(fitting) != 1:
        nearest = max(own, key=lambda n: len(own[n] & set(settings)) - len(own[n] ^ set(settings)))
        odd = sorted(own[nearest] ^ set(settings))
        raise InputError(
            "this calibration fits several scenes" if fitting else "this is a calibration of no scene",
            file=given,
            field=", ".join(fitting or odd[:5]),
            allowed="[scene] name in the sidecar"
            if fitting
            else f"the settings of a scene (the nearest is {nearest}), or --model my_flap.py --calibration {given}",
        )
    check_recorded_scene(data[0], fitting[0], "--model")
    module = scene_module(fitting[0])
    return module, scene_settings(module, given)


def _overrides(data: DataSet, scene: str) -> list[str]:
    """What the sidecar says of this object's settings."""
    found = data[0].metadata.get("scene") or {}
    return [f"{n}={v}" for n, v in found.get("overrides", {}).items()] if found.get("name") == scene else []


def _assigned(settings: Settings, assignments: Sequence[str], source: object) -> Settings:
    """The settings with `name=value` applied; errors name where that was written, not the calibration."""
    if not assignments:
        return settings
    changed = Settings(list(settings.values()), Path(str(source)), settings.effects).override(assignments)
    out = Settings(list(changed.values()), settings.file, settings.effects, accuracy=settings.accuracy)
    return out.with_panels(settings.panels).with_motion(settings.motion, settings.until)


def options_of(args: Namespace, settings: Settings) -> Options:
    """How a diagnosis, or an estimate, looks, by a command line."""
    if args.segment is not None and not args.segment > 0:
        raise InputError("must be positive", field="--segment", value=args.segment, allowed="> 0 s")
    if args.start_at == "rest" and args.segment is not None:
        raise InputError("segments have starts of their own", field="--start-at", value="rest", allowed="no --segment")
    options = THOROUGH if args.thorough else Options()
    motion = args.motion if args.motion != "auto" else settings.motion or "auto"
    limit = options.limit if args.limit is None else args.limit
    return replace(options, motion=motion, panels=args.panels, segment=args.segment, start=args.start_at, limit=limit)


def check_model(patch: Path, model: str) -> None:
    """Refuses to write a patch over the model itself."""
    if Path(model).resolve() == patch.resolve():
        raise InputError(
            "the model would be overwritten",
            file=model,
            field="--out",
            value=str(patch.parent),
            allowed="another folder",
        )


def check_folder(folder: Path, of_ours: Callable[[], bool], what: str) -> None:
    """Refuses, before anything is computed, a folder that cannot be written or that holds other things.

    Args:
        of_ours: whether it is new or empty, or holds what such a command left. what: that is.
    """
    allowed = "a folder that can be written"
    try:
        existing = next(p for p in (folder.absolute(), *folder.absolute().parents) if p.exists())
        if existing.is_dir():
            tempfile.TemporaryDirectory(dir=existing).cleanup()
    except OSError as error:
        fault = f"cannot be written ({error.strerror})"
        raise InputError(fault, file=folder, field="--out", allowed=allowed) from None
    if not existing.is_dir():
        raise InputError("is a file", file=existing, field="--out", allowed=allowed)
    if not of_ours():
        fault, allowed = f"is a folder with other things in it, not {what}", f"a new or empty folder, or that of {what}"
        raise InputError(fault, file=folder, field="--out", allowed=allowed)


def _earlier(folder: Path) -> list[str] | None:
    """Recordings of the diagnosis in a folder, none if it is empty or was interrupted; None: things of others."""
    try:
        found = json.loads((folder / JSON).read_text())
    except (OSError, ValueError, RecursionError):  # not there, no JSON, nested deeply
        found = None
    if isinstance(found, dict) and "verdict" in found and isinstance(found.get("recordings"), list):
        return [str(name) for name in found["recordings"]]
    free = not folder.is_dir() or (folder / RESUME).is_dir() or not any(folder.iterdir())
    return [] if free else None


# output ---------------------------------------------------------------------------------------------------------------


class Progress:
    """Stages on standard error: one line that moves where somebody watches, else one line each."""

    def __init__(self):
        self.name, self.shown, self.began = "", -1, clock.perf_counter()
        self.watched = sys.stderr.isatty()

    def __call__(self, stage: str, part: float) -> None:
        if stage == "done":
            return
        if stage != self.name:
            self.stage(stage)
        percent = int(100 * part)
        if self.watched and percent != self.shown:
            self.shown = percent
            sys.stderr.write(f"\r\033[K{clock.perf_counter() - self.began:5.0f} s  {stage} {percent} %")
            sys.stderr.flush()

    def stage(self, name: str) -> None:
        self.name, self.shown = name, -1
        if not self.watched:
            print(f"{clock.perf_counter() - self.began:5.0f} s  {name}", file=sys.stderr)

    def end(self) -> None:
        if self.watched:
            sys.stderr.write("\r\033[K")
            sys.stderr.flush()


class Files:
    """What a diagnosis leaves, written as soon as its verdict stands and anew whenever something was added to it.

    Where the disk is full, stored predictions make room; where nothing can be written, another folder is taken. Page,
    replays and the patched calibration may fail; a note then says so.

    Attributes:
        folder: where they are. scene: what `run` calls the scene or device.
        made: those that are there: "data", "calibration", "report", and a list "replays".
    """

    def __init__(self, folder: Path, settings: Settings, scene: str, keep: Keep):
        self.folder, self.settings, self.scene, self.keep = folder, settings, scene, keep
        self.made: dict[str, list[Path] | Path] = {"replays": []}
        self._old = True

    def __call__(self, found: Diagnosis) -> None:
        """Writes data and patch where there is room; says so if that is elsewhere, or nowhere."""
        fault = ""
        for room in (lambda: self.folder, self._cleared, self._elsewhere):
            try:
                folder = room()
                if folder != self.folder:
                    found.notes.append(f"{fault} Data and patch are in {folder}.")
                self._write(folder, found)
                self.folder = folder
                return
            except OSError as error:
                fault = fault or f"{self.folder} cannot be written ({error.strerror or error})."
        self.made = {"replays": []}
        found.notes.append(f"{fault} Only what is printed is left.")

    def film(self, found: Diagnosis) -> list[Path]:
        """Writes replays."""
        from origami_sim.diagnose.overlay import write_overlays  # what draws takes 0.4 s to load

        return write_overlays(self.folder, self.keep, found)

    def finish(self, found: Diagnosis) -> None:
        """Writes the page; if it fails, the data once more, with a note of that."""
        forward, made = self.keep.forward, self.made
        assert forward is not None
        made["replays"] = self.keep.films
        page = attempt(
            found.notes,
            "The page could not be written",
            lambda: write_report(found, self.folder / REPORT, geometry=geometry_of(forward.model)),
            None,
        )
        if page is None:
            self(found)
        else:
            made["report"] = page

    @property
    def shown(self) -> str:
        """Where the data are, in words."""
        return f"it is in {self.made['data']}." if "data" in self.made else "it could not be written."

    def _write(self, folder: Path, found: Diagnosis) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        if self._old:  # of a verdict that stood here before
            for file in (folder / REPORT, folder / PATCH, *folder.glob("replay*.rrd")):
                if file.is_file():
                    file.unlink()
            self._old = False
        fault, make = "The patched calibration could not be written", lambda: self._patch(folder, found)
        patch = attempt(found.notes, fault, make, None, passing=OSError)
        self.made |= {"data": found.save_json(folder / JSON)} | ({} if patch is None else {"calibration": patch})

    def _patch(self, folder: Path, found: Diagnosis) -> Path:
        return write_patch(folder / PATCH, self.settings, found, scene=self.scene)

    def _cleared(self) -> Path:
        self.keep.clear()
        return self.folder

    @staticmethod
    def _elsewhere() -> Path:
        return Path(tempfile.mkdtemp(prefix="origami-sim-diagnose-"))


@contextmanager
def ending_as_interrupted() -> Iterator[None]:
    """Whoever asks the process to end (SIGTERM, as schedulers do) interrupts it: nothing is left half written."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(*_):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _summary(d: Diagnosis, files: Mapping[str, list[Path] | Path]) -> dict:
    whole = d.to_dict()
    keys = ("verdict", "sentence", "probability", "outside", "chosen", "budget", "compared", "components", "noise")
    errors = ("error_before", "error_refitted", "error_after", "patch", "notes", "seconds")
    return {
        **{k: whole[k] for k in (*keys, *errors)},
        "candidates": [{k: c[k] for k in ("label", "probability", "odds", "failed")} for c in whole["candidates"]],
        "files": {n: [str(p) for p in f] if isinstance(f, list) else str(f) for n, f in files.items()},
        "exit_code": d.exit_code,
    }


def _text(d: Diagnosis, files: Mapping[str, list[Path] | Path], scene: str) -> list[str]:
    lines = ["", f"{d.verdict}: {d.sentence}", "", f"{'explanation':48s} {'probability':>11s} {'log odds':>9s}"]
    best = d.candidates[0].odds if d.candidates else 0.0
    for c in d.candidates[:8]:
        if c.failed:
            lines.append(f"{c.label:48s}      failed: {c.failed}")
            continue
        remark = c.why if c.odds > best else c.distrust
        mark = f"   {remark}" if remark else ""
        lines.append(f"{c.label:48s} {c.probability:11.3f} {c.odds - best:9.1f}{mark}")
    if d.candidates and round(d.unfitted, 3) > 0.0:
        lines.append(f"{'others, estimated and not fitted':48s} {d.unfitted:11.3f}")
    if round(d.outside, 3) > 0.0:
        lines.append(f"{'a law that the catalogue lacks':48s} {d.outside:11.3f}")
    shown = patched(d)
    for n in shown.numbers if shown is not None else []:
        bound = ", at its bound" if n.at_bound else ""
        unit = "" if n.unit in ("-", "1", ANY) else f" {n.unit}"
        interval = f", 95 % interval {n.low:.4g} to {n.high:.4g}" if n.low < n.high else ""
        lines.append(f"  {n.label} = {n.value:.4g}{unit}{n.each}{interval}{bound}")
    which = "held out" if d.left_out else "fitted"
    lines += ["", f"{f'rms error, {which}':24s} {'noise':>10s} {'as given':>10s} {'refitted':>10s} {'explained':>10s}"]
    rows = zip(d.components, d.units, d.noise, d.error_before, d.error_refitted, d.error_after, strict=True)
    lines += [f"{f'{name} [{unit}]':24s} " + " ".join(f"{v:10.3g}" for v in values) for name, unit, *values in rows]
    lines += ["", *(f"note: {note}" for note in d.notes)]
    if d.experiments:
        lines.append(f"next experiment: {finding(d)}")
    replays = files["replays"]
    assert isinstance(replays, list)
    if "report" in files or "data" in files:
        lines.append(f"report: {files.get('report', files.get('data'))}")
    lines += [f"replay: origami-sim replay {r}" for r in replays]
    if "calibration" in files:
        moment = any(label.startswith(UNLISTED) for label in d.chosen)
        far = "   (the closest explanation, which is not enough)" if d.verdict == "UNKNOWN" and d.patch else ""
        far = "   (with that moment)" if moment else far
        lines.append(f"patched: origami-sim run {scene} --calibration {files['calibration']}{far}")
    return [*lines, f"{sum(d.seconds.values()):.0f} s of computing"]

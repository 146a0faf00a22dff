"""What a run folder keeps so that the run can be made again: where it came from, and the device as it was run.

`device.toml` is a design file with the settings of the run, in which nothing is executed, so that `run`, `compare`,
`diagnose`, `show` and `sweep` take the folder like any device, whatever became of the file that it was built from.
"""

import hashlib
import tempfile
from argparse import Namespace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from origami_sim.design.design_file import read_design, write_design
from origami_sim.device.device import KEPT, source_of
from origami_sim.device.scene import CALIBRATED, NAMES, Outcome, Settings, own_settings, read_calibration, taken
from origami_sim.errors import InputError
from origami_sim.model import State
from origami_sim.solve.motion.quasistatic import QuasiStatic


def origin(args: Namespace, module: ModuleType, settings: Settings, why: str) -> dict[str, Any]:
    """Of which device a run is, how it was asked for, and why the folder holds no device, as the manifest keeps it."""
    file = None if args.scene in NAMES else Path(str(module.__file__))
    return {
        "given": args.scene,
        "file": None if file is None else str(file.absolute()),
        "sha256": hashlib.sha256(file.read_bytes()).hexdigest() if file is not None and file.is_file() else None,
        "calibration": None if args.calibration is None else str(Path(args.calibration).absolute()),
        "effects": [a.effect for a in settings.effects],
        "panels": settings.panels,
        **settings.how,
        "why": why,
    }


def partly(module: ModuleType, calibration: str) -> str:
    """What was taken from a file of `origami-sim calibrate` that holds other things as well; "" of other files."""
    own, given = own_settings(module), read_calibration(calibration)
    if CALIBRATED not in given or CALIBRATED in own:
        return ""
    names, rest = taken(own, given)
    return f"note: {', '.join(names)} are those of {calibration}" + f", not its {', '.join(rest)}." * bool(rest)


def design_of(module: ModuleType, settings: Settings, outcome: Outcome) -> tuple[str, str]:
    """The design file of the device of a run.

    Returns:
        Its text, or "" and why a device in a file would not make the same run.
    """
    motion = outcome.trajectory
    if not hasattr(module, "raw"):
        return "", "it is of a shipped scene"
    if module.own_run:
        return "", "the device has a run() of its own, which no design file holds"
    model, parameters, *_ = module.build(settings)
    start = State.at_rest(model, motion.state.worlds)
    begun = np.any(motion.v[0]) or not np.array_equal(motion.x[0], start.x)
    if begun and not isinstance(motion, QuasiStatic):
        return "", "it does not begin at rest where the device begins"
    stated = {n: float(settings[n].value) for n in ("duration", "rate") if n in settings}
    about = f"the device of a run of {module.__name__}, with its settings"
    why = "a design file does not hold all of its model"
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / KEPT
        for source in (source_of(module, settings), (model, parameters)):
            try:
                write_design(file, source, motion.drive, **stated, **settings.how, about=about)
                read = read_design(file).source
            except InputError as e:
                why = e.what
                continue
            again = read if isinstance(read, tuple) else read.build()
            if (again[0].hash, again[1].hash) == (model.hash, parameters.hash):
                return file.read_text(encoding="utf-8"), ""
    return "", why


def keep(folder: Path | None, design: str) -> None:
    """Puts the device of a run into its folder, in place of that of an earlier run."""
    if folder is None:
        return
    (folder / KEPT).unlink(missing_ok=True)
    if design:
        (folder / KEPT).write_text(design, encoding="utf-8")

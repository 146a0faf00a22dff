"""Keeping what was computed: of a run that failed beside an earlier one, and where the disk is full what fits."""

import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from origami_sim.errors import DiskFull
from origami_sim.results.run_folder import MANIFEST, save_run
from origami_sim.solve.motion.dynamics import Trajectory


def not_over_a_sound_run(folder: Path, trajectory: Trajectory) -> Path:
    """Where a run goes: into the folder, or beside it if it failed and a run that did not fail is there."""
    try:
        earlier = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))["failures"]
    except (OSError, ValueError, LookupError, TypeError):  # no run there, or a damaged one
        return folder
    return folder.with_name(f"{folder.name}-failed") if trajectory.failures and not earlier else folder


def save_somewhere(
    folder: Path, trajectory: Trajectory, *, note: Callable[[str], object], **options: Any
) -> Path | None:
    """Saves a run as `save_run` does; where the disk is full, what fits, and says so.

    Args:
        folder: where it should go. note: called with a sentence about what was left out, or put elsewhere.
        options: of `save_run`.

    Returns:
        The folder in which it is; None if there is no room anywhere.

    Raises:
        InputError: the folder cannot be written for another reason.
    """
    try:
        save_run(folder, trajectory, **options)
        return folder
    except DiskFull as e:
        full = e
    bare = {**options, "replay": False}
    try:
        save_run(folder, trajectory, **bare)
        note(f"the disk is full: {folder} has all but the replay.")
        return folder
    except DiskFull:
        pass
    try:
        elsewhere = Path(tempfile.mkdtemp(prefix=f"origami-sim-{folder.name}-"))
        save_run(elsewhere, trajectory, **bare)
        note(f"{full} The run is kept in {elsewhere}, without a replay: move it.")
        return elsewhere
    except (DiskFull, OSError):
        note(f"{full} There is no room in {tempfile.gettempdir()} either, so that only what is printed is left.")
        return None

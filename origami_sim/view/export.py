"""Runs as files that other programs read: glTF with animation, OBJ and FOLD of one frame, pictures that move."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from origami_sim.errors import InputError
from origami_sim.pattern import Pattern, write_fold, write_mesh
from origami_sim.pattern.files import write_atomic
from origami_sim.solve.motion.dynamics import Trajectory
from origami_sim.view.film import Film, HasTrajectory, trajectory_of
from origami_sim.view.gltf import glb
from origami_sim.view.moving import RATE, write_moving
from origami_sim.view.picture import nearest_frame

ONE_FRAME, ALL_FRAMES = (".obj", ".stl", ".fold", ".png"), (".glb", *RATE)
SUFFIXES = (*ALL_FRAMES, *ONE_FRAME)


def export(
    source: Trajectory | HasTrajectory,
    path: str | Path,
    *,
    at: float | None = None,
    start: float | None = None,
    stop: float | None = None,
    world: int = 0,
    title: str = "origami_sim",
    progress: Callable[[float], None] | None = None,
    **how,
) -> Path:
    """Writes a run, or one frame of it, in the format that the file's suffix names.

    Moving: .glb (glTF 2.0), .webp, .gif, .mp4 (with PyAV). One frame: .obj, .stl (metres, triangles), .fold (metres,
    triangles; creases are mountains and valleys with the fold angles that they have then), .png. What moves ends where
    its world failed, as the frames after that only repeat the last sound one.

    Args:
        source: a trajectory, a run that has one, or a path of equilibria, a point a second.
        path: the file; one that is there is written over.
        at: time of the one frame [s] (default: where the creases are furthest from where they began).
        start, stop: part of the motion to be shown [s] (default: all). world: which of the worlds.
        title: name in the file. progress: called with the fraction done.
        how: of pictures: width, height [px], colour ("kind", "strain"), labels, seconds (how long a film lasts).

    Raises:
        InputError: an unknown suffix, a time outside of the run, an option that the format does not have, no such
            world, a file that cannot be written, MP4 without PyAV.
    """
    file = Path(path).expanduser()
    suffix = file.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError("no such format", field="path", value=suffix or str(path), allowed=", ".join(SUFFIXES))
    if not file.absolute().parent.is_dir():
        raise InputError("there is no such folder", file=file.parent)
    if at is not None and suffix in ALL_FRAMES:
        raise InputError("is the time of one frame", field="at", value=at, allowed=f"with {', '.join(ONE_FRAME)}")
    pictures = (".png", *RATE)
    for name in how:
        if suffix not in pictures or (suffix == ".png" and name == "seconds"):
            raise InputError(
                "is an option of pictures", field=name, value=how[name], allowed=f"with {', '.join(pictures)}"
            )
    trajectory = trajectory_of(source)
    film = Film(between(until_failure(trajectory, world), start, stop), world=world, title=title)
    if suffix == ".glb":
        write_atomic(file, glb(film))
    elif suffix in (".obj", ".stl"):
        nodes, triangles = _used(film)
        write_mesh(film.x[nearest_frame(film, at)][nodes], triangles, file)
    elif suffix == ".fold":
        write_fold(folded(film, nearest_frame(film, at)), file)
    elif suffix == ".png":
        write_moving(file, film, at=at, **how)
    else:
        write_moving(file, film, progress=progress, **how)
    return file


def between(trajectory: Trajectory, start: float | None, stop: float | None) -> Trajectory:
    """The frames of a run from one time to another [s].

    Raises:
        InputError: no frame is left.
    """
    if start is None and stop is None:
        return trajectory
    times = np.asarray(trajectory.times)
    first, last = float(times[0]), float(times[-1])
    slack = 1e-9 * max(abs(first), abs(last), 1e-9)
    kept = (times >= (first if start is None else start) - slack) & (times <= (last if stop is None else stop) + slack)
    if not kept.any():
        raise InputError(
            "no frame of the run is between",
            field="start, stop",
            value=(start, stop),
            allowed=f"{first:g} to {last:g} s",
        )
    arrays = {n: getattr(trajectory, n)[kept] for n in ("times", "x", "v", "angles", "gaps", "contact_forces")}
    cut = {n: {k: v[kept] for k, v in getattr(trajectory, n).items()} for n in ("energies", "work")}
    failures = [f for f in trajectory.failures if stop is None or f.time <= stop + slack]
    return replace(trajectory, **arrays, **cut, failures=failures)


def until_failure(trajectory: Trajectory, world: int) -> Trajectory:
    """The frames of a run up to where a world failed: those after it repeat the last one that was sound."""
    times = [f.time for f in trajectory.failures if f.world == world]
    if not times:
        return trajectory
    end = max(min(times), float(trajectory.times[0]))
    return replace(between(trajectory, None, end), failures=trajectory.failures)


def _used(film: Film) -> tuple[np.ndarray, np.ndarray]:
    """Nodes that are corners, and the triangles by their place among them: mass points of rigid panels are left out."""
    nodes, inverse = np.unique(film.model.triangles, return_inverse=True)
    return nodes, inverse.reshape(-1, 3)


def folded(film: Film, f: int) -> Pattern:
    """One frame as a pattern of triangles: creases with their fold angles, lines within panels flat, borders."""
    nodes, triangles = _used(film)
    place = {int(n): i for i, n in enumerate(nodes)}
    m, angles = film.model, film.trajectory.creases[f, :, film.world]
    letters: dict[tuple[int, int], tuple[str, float]] = {}
    for t in triangles.tolist():
        for a, b in ((0, 1), (1, 2), (2, 0)):
            side = (min(t[a], t[b]), max(t[a], t[b]))
            letters[side] = ("F", 0.0) if side in letters else ("B", np.nan)
    for (_, j, k, _), angle in zip(m.creases.tolist(), angles, strict=True):
        a, b = sorted((place[j], place[k]))
        turned = float((angle + np.pi) % (2 * np.pi) - np.pi) if abs(angle) > np.pi else float(angle)
        letters[a, b] = ("V" if turned > 0 else "M" if turned < 0 else "U", turned)
    edges, count = list(letters), len(letters)
    return Pattern(
        vertices=film.x[f][nodes],
        faces=[tuple(t) for t in triangles.tolist()],
        edges=np.array(edges, np.int64),
        assignments=[letters[e][0] for e in edges],
        fold_angles=np.array([letters[e][1] for e in edges]),
        stiffness=np.full(count, np.nan),
        rest_angles=np.full(count, np.nan),
        thickness=np.full(len(triangles), np.nan),
        materials=[None] * len(triangles),
        extra={
            "frame_unit": "m",
            "frame_title": f"{film.title} at {film.times[f]:g} s",
            "frame_classes": ["foldedForm"],
            "file_creator": "origami_sim",
        },
    )

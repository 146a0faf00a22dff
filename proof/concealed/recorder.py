"""The tracker: what a camera makes of a motion, and the files that it leaves (see docs/recordings.md)."""

from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from world import Motion, World, wave


def channels(world: World, angles: np.ndarray) -> np.ndarray:
    """Readings (n, D) without error.

    Fold angles, or angles of the panels from the upright towards +x, or where the edges are, right and up [m].
    """
    if world.o["channels"] == "crease_angle":
        return angles
    if world.o["channels"] == "marker_2d":
        return edges(world, angles)
    side = float(world.normals[0][0])  # hanging strips only: every face looks along x
    return np.pi - side * np.cumsum(angles, axis=1)


def edges(world: World, q: np.ndarray) -> np.ndarray:
    """Where the edges of a chain of panels in the plane of x and z are, (n, 2 (P + 1)) [m]."""
    first = world.corners[0][0][[0, 2]]
    lengths = [float(np.ptp(c[:, 0])) for c in world.corners]
    shift, rise, pitch = q[:, world.count :].T
    turn = pitch[:, None] + np.concatenate([np.zeros((len(q), 1)), np.cumsum(q[:, : world.count], axis=1)], axis=1)
    x, z = first[0] * np.cos(pitch) - first[1] * np.sin(pitch), first[0] * np.sin(pitch) + first[1] * np.cos(pitch)
    out = [np.stack([shift + x, rise + z], axis=1)]
    for p, length in enumerate(lengths):
        out.append(out[-1] + length * np.stack([np.cos(turn[:, p]), np.sin(turn[:, p])], axis=1))
    return np.concatenate(out, axis=1)


def columns_of(o: dict) -> list[str]:
    """Names of the columns of all readings."""
    return [
        f"{name}{axis}" for name, _ in names(o) for axis in (("_x", "_z") if o["channels"] == "marker_2d" else ("",))
    ]


def names(o: dict) -> list[tuple[str, str]]:
    """(channel, attachment in TOML) of all readings."""
    if o["channels"] == "crease_angle":
        return [(c["name"], f'crease = "{c["name"]}"') for c in o["creases"]]
    if o["channels"] == "marker_2d":  # on the near side of each edge
        return [(f"edge{n}", f"node = {2 * n}") for n in range(len(o["faces"]) + 1)]
    return [(f"arm{c['panels'][1]}", f'panel = "panel{c["panels"][1]}"') for c in o["creases"]]


def readings(world: World, motion: Motion, times: np.ndarray, chain: dict) -> np.ndarray:
    """Readings (n, D) at the camera's times with the errors of the measurement chain, but without noise."""
    first = motion.times[0]
    true = first + (times - first) * (1 + chain.get("clock_rate", 0.0)) - chain.get("clock_delay", 0.0)
    curve = CubicSpline(motion.times, channels(world, motion.angles))
    values = curve(np.clip(true, motion.times[0], motion.times[-1]))
    scale = chain.get("angle_scale", 0.0) + chain.get("length_scale", 0.0)
    return values * (1 + scale) + chain.get("angle_offset", 0.0)


def tracked(values: np.ndarray, tracker: dict, rng: np.random.Generator) -> np.ndarray:
    """Readings with noise, smoothing, quantisation and lost frames.

    The smoothing acts on the noise only: over three frames of a 120 Hz camera, what it takes from a swing of 3 Hz alone
    would have d' of about 10, and be a second effect.
    """
    noise = tracker["noise"] * rng.normal(size=values.shape)
    if tracker["smoothing"]:
        noise[1:-1] = 0.25 * noise[:-2] + 0.5 * noise[1:-1] + 0.25 * noise[2:]
    y = values + noise
    y = np.round(y / tracker["quantum"]) * tracker["quantum"]
    inside = slice(8, len(y) - 8)
    y[inside][rng.random((len(y) - 16, y.shape[1])) < tracker["lost"]] = np.nan
    if tracker["gap"]:
        at = int(rng.integers(16, len(y) - 16 - tracker["gap"]))
        y[at : at + tracker["gap"]] = np.nan
    return y


def write(folder: Path, name: str, o: dict, recording: dict, times, values, tracker: dict) -> None:
    """The table and its sidecar."""
    columns = {"time_s": times}
    columns |= {column: values[:, n] for n, column in enumerate(columns_of(o))}
    drive = recording.get("field")
    if drive:
        b = drive["amplitude"] * np.array([wave(drive, t) for t in times])
        columns |= {f"b{a}_T": b * drive["axis"][k] for k, a in enumerate("xyz")}
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join("" if np.isnan(v) else f"{v:.9g}" for v in row) for row in rows)]
    (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
    text = [f'name = "{name}"', "allow_gaps = true", "[time]", 'column = "time_s"', 'unit = "s"']
    if o["channels"] == "marker_2d":
        text += ["[cameras.side]", "right = [1.0, 0.0, 0.0]", "up = [0.0, 0.0, 1.0]"]
    for channel, attachment in names(o):
        text += [f"[channels.{channel}]", f'kind = "{o["channels"]}"']
        if o["channels"] == "marker_2d":
            text += [f'columns = ["{channel}_x", "{channel}_z"]', 'unit = "m"']
        else:
            text += [f'column = "{channel}"', 'unit = "rad"']
        text += [attachment] + ([f"noise = {tracker['stated']:.6g}"] if tracker["stated"] else [])
    if drive:
        text += ["[drive.field]", 'columns = ["bx_T", "by_T", "bz_T"]', 'unit = "T"']
    (folder / f"{name}.toml").write_text("\n".join(text) + "\n")

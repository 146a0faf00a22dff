"""Replays for the rerun viewer; its calls are here, in `viewer` and in `overlay`, because they still change.

What a replay holds, on the timeline `sim_time` [s]; geometry is in metres, z up:

    sheet/faces            the panels, shaded flat: passive, magnetised, arms
    sheet/outlines         edges of the panels
    sheet/creases          fold lines, in the colours of the angle plot
    magnets                poling direction of each magnetised panel
    field                  flux density; the arrow's length follows it
    contacts               contact forces
    ground, scale          the ground plane (if there are contacts) and a scale bar
    markers/...            markers of a recording
    before/..., after/..., channels/...   of a diagnosis: simulations over the recorded outlines; components
    angles/..., energy/..., work/..., tip/..., centre/..., drive/..., measured/..., simulated/...
                           scalar series, unit in the name
"""

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from origami_sim.effects import get
from origami_sim.errors import InputError, unwritable
from origami_sim.recording import Recording
from origami_sim.solve.motion.dynamics import Trajectory
from origami_sim.view.film import WALK, Film, HasTrajectory, trajectory_of
from origami_sim.view.palette import COLOURS, PLOTTED, SERIES, length_text, nice, scaled
from origami_sim.view.viewer import TIMELINE

BACKGROUND = (250, 250, 248)
_BLOCK = 1_000_000  # numbers per chunk


def write_replay(
    path: str | Path,
    source: Trajectory | HasTrajectory,
    *,
    world: int = 0,
    magnets: Iterable[int] | None = None,
    arms: Iterable[int] = (),
    tip: int | None = None,
    recording: Recording | None = None,
    title: str = "origami_sim",
) -> Path:
    """Writes one world of a run as a replay that opens with a fixed camera and its plots.

    The file's identity depends only on what it shows (title, model, parameters, world), so a replay written again
    takes the earlier one's place in a viewer. It is written beside `path` and then moved there.

    Args:
        path: the .rrd file. source: a trajectory, a run that has one, or a path of equilibria. world: which of its
            worlds.
        magnets: panels to colour as magnets (default: triangles that carry remanence).
        arms: panels to colour as arms. tip: node whose displacement is plotted (default: the one that moves most).
        recording: measured channels to be shown with the simulation.
        title: of the recording in the viewer.

    Raises:
        InputError: no such world, panel or node; a file that cannot be written.
    """
    trajectory = trajectory_of(source)
    scene = Film(trajectory, world, magnets, arms, tip, title)
    with writing(path, scene.application, scene.identity) as stream:
        stream.send_blueprint(_blueprint(scene, _write(scene, stream, recording)))
    return Path(path).expanduser().absolute()


@contextmanager
def writing(path: str | Path, application: str, identity: str) -> Iterator[rr.RecordingStream]:
    """A stream into a file that appears complete or not at all."""
    file = Path(path).expanduser().absolute()
    if file.is_dir():
        raise InputError("is a folder; a replay is a file", file=file, allowed="a file name ending in .rrd")
    work = file.with_name(f".{file.name}.{os.getpid()}.tmp")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        # rerun's own writer waits for ever where the disk becomes full
        with rr.RecordingStream(application, recording_id=identity, send_properties=False) as stream:
            held = stream.memory_recording()
            yield stream
            work.write_bytes(held.drain_as_bytes())
        os.replace(work, file)
    except OSError as e:
        raise unwritable(e, file=file, allowed="a writable folder") from None
    finally:
        work.unlink(missing_ok=True) if work.parent.is_dir() else None


# the file -------------------------------------------------------------------------------------------------------------


@dataclass
class Plot:
    """A time series view: its name and the series that it shows at first."""

    name: str
    paths: list[str] = field(default_factory=list)


@dataclass
class Writer:
    """A stream with the plots that were made for it."""

    stream: rr.RecordingStream
    plots: list[Plot] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    extents: dict[str, tuple[float, float]] = field(default_factory=dict)

    def moving(self, path: str, times: np.ndarray, archetype, static: dict | None = None, **values: np.ndarray):
        """Sends an entity of which `values` [F, n, ...] change with time and `static` do not."""
        if static:
            self.stream.log(path, archetype.from_fields(**static), static=True)
        count = next(iter(values.values())).shape[1]
        if not count:
            return
        rows = max(1, _BLOCK // max(v[0].size for v in values.values()))
        for i in range(0, len(times), rows):
            part = slice(i, i + rows)
            flat = {n: v[part].reshape(-1, *v.shape[2:]) for n, v in values.items()}
            for n in ("vertex_positions", "strips", "vectors", "origins"):
                if n in flat:
                    flat[n] = flat[n].astype(np.float32)
            lengths = np.full(len(times[part]), count)
            rr.send_columns(
                path,
                [rr.TimeColumn(TIMELINE, duration=times[part])],
                archetype.columns(**flat).partition(lengths),
                recording=self.stream,
            )

    def series(
        self,
        path: str,
        name: str,
        times: np.ndarray,
        values: np.ndarray,
        colour: Sequence[int],
        *,
        points: bool = False,
    ):
        """Sends a scalar series; `name` ends with its unit in brackets."""
        style = (
            rr.SeriesPoints(names=name, colors=[colour], marker_sizes=[2.0])
            if points
            else rr.SeriesLines(names=name, colors=[colour], widths=[1.5])
        )
        self.stream.log(path, style, static=True)
        if len(values):
            self.extents[path] = float(values.min()), float(values.max())
        rr.send_columns(
            path, [rr.TimeColumn(TIMELINE, duration=times)], rr.Scalars.columns(scalars=values), recording=self.stream
        )


def _write(scene: Film, stream: rr.RecordingStream, recording: Recording | None) -> Writer:
    out = Writer(stream)
    stream.send_recording_name(scene.title)
    stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    colours = _write_angles(scene, out)
    _write_sheet(scene, out, colours)
    _write_surroundings(scene, out)
    _write_motion(scene, out)
    _write_energies(scene, out)
    _write_drive(scene, out)
    if recording is not None:
        _write_recording(recording, scene, out)
    _write_notes(scene, out)
    return out


def _chosen(values: Sequence[np.ndarray], count: int = PLOTTED) -> list[int]:
    """The `count` series with the largest ranges, in their own order."""
    ranges = [float(np.ptp(v)) if len(v) else 0.0 for v in values]
    return sorted(sorted(range(len(values)), key=lambda i: -ranges[i])[:count])


def slug(name: str) -> str:
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in name) or "_"


def _write_angles(scene: Film, out: Writer) -> list[tuple[int, int, int]]:
    """Crease angles; returns the colour of each crease."""
    angles = np.degrees(scene.trajectory.creases[:, :, scene.world])
    shown = _chosen(list(angles.T))
    colours = [COLOURS["crease"]] * angles.shape[1]
    plot = Plot("Crease angles (deg)")
    names = scene.model.names.get("crease", ())
    for c in range(angles.shape[1]):
        name = scene.model.name("crease", c)
        path = f"/angles/{c:04d}_{slug(name)}"
        if names.count(name) > 1:  # creases of one region
            name += f" {c}"
        colour = SERIES[shown.index(c)] if c in shown else SERIES[-1]
        out.series(path, f"{name} (deg)", scene.times, angles[:, c], colour)
        if c in shown:
            colours[c] = colour
            plot.paths.append(path)
    if plot.paths:
        out.plots.append(plot)
    if angles.shape[1] > len(shown):
        out.notes.append(f"The angle plot shows the {len(shown)} of {angles.shape[1]} creases that move most.")
    return colours


def _write_sheet(scene: Film, out: Writer, crease_colours: list[tuple[int, int, int]]):
    corners, colours = scene.faces()
    count = corners.shape[1]
    # whatever is static would hide later values of the same field, so only what never changes is
    out.moving(
        "sheet/faces",
        scene.times,
        rr.Mesh3D,
        static={"triangle_indices": np.arange(count, dtype=np.uint32).reshape(-1, 3)},
        vertex_positions=corners,
        vertex_colors=colours,
    )
    edges = scene.outlines()
    thin, thick = rr.Radius.ui_points(0.8), rr.Radius.ui_points(2.0)
    out.moving(
        "sheet/outlines",
        scene.times,
        rr.LineStrips3D,
        static={"radii": [thin], "colors": [COLOURS["outline"]]},
        strips=scene.x[:, edges],
    )
    out.moving(
        "sheet/creases",
        scene.times,
        rr.LineStrips3D,
        static={"radii": [thick], "colors": crease_colours},
        strips=scene.x[:, scene.model.creases[:, 1:3]],
    )
    origins, vectors, labels = scene.arrows()
    if labels:
        out.moving(
            "magnets",
            scene.times,
            rr.Arrows3D,
            static={"radii": [0.008 * scene.size], "colors": [COLOURS["poling"]]},
            origins=origins,
            vectors=vectors,
        )
        out.notes.append("Red arrows: poling of the magnets (length means nothing).")


def _write_surroundings(scene: Film, out: Writer):
    """Ground, scale bar, contact forces, field."""
    right, _, _, _ = scene.camera()
    if len(scene.model.contacts):
        _write_ground(scene, out)
        points, forces = scene.contact_arrows()
        size = np.linalg.norm(forces, axis=-1)
        if np.any(size > 0):
            typical = float(np.percentile(size[size > 0], 90))
            scale = 0.35 * scene.size / typical
            unit, factor = scaled("N", typical, "m")
            shown = size > 1e-3 * typical
            out.moving(
                "contacts",
                scene.times,
                rr.Arrows3D,
                static={"radii": [0.006 * scene.size], "colors": [COLOURS["contact"]]},
                origins=points,
                vectors=np.where(shown[:, :, None], scale * forces, 0.0),
            )
            out.notes.append(
                f"Green arrows: contact forces, {length_text(scene.step)} of arrow for "
                f"{scene.step / scale * factor:.3g} {unit}."
            )
    corner = (scene.low + scene.high) / 2 - 0.5 * scene.step * right
    below = scene.height if len(scene.model.contacts) else scene.low[2] - 0.12 * scene.size
    near = np.array([0.0, -1.0, 0.0]) if scene.across == 0 else np.array([1.0, 0.0, 0.0])
    corner += near * (0.5 * abs((scene.high - scene.low) @ near) + 0.25 * scene.size)
    corner[2] = below + 0.002 * scene.size
    if len(scene.model.contacts):
        corner += scene.up * (scene.height + 0.002 * scene.size - corner @ scene.up)
    out.stream.log(
        "scale",
        rr.LineStrips3D(
            [np.stack([corner, corner + scene.step * right])],
            radii=rr.Radius.ui_points(2.5),
            colors=[COLOURS["scale"]],
        ),
        static=True,
    )
    out.stream.log(
        "scale/value",
        rr.Points3D(
            [corner + 0.5 * scene.step * right],
            radii=[0.0],
            colors=[COLOURS["label"]],
            labels=[length_text(scene.step)],
            show_labels=True,
        ),
        static=True,
    )
    field = np.stack([scene.channel(f"field_{i}") for i in "xyz"], axis=1)
    size = np.linalg.norm(field, axis=1)
    if size.max() > 0:
        unit, factor = scaled("T", float(size.max()), "m")
        origin = scene.field_origin()
        vectors = (0.6 * scene.size / size.max() * field)[:, None, :]
        out.moving(
            "field",
            scene.times,
            rr.Arrows3D,
            static={"radii": [0.014 * scene.size], "colors": [COLOURS["field"]]},
            origins=np.broadcast_to(origin, vectors.shape),
            vectors=vectors,
        )
        out.moving(
            "field/value",
            scene.times,
            rr.Points3D,
            static={
                "positions": [origin],
                "radii": [0.015 * scene.size],
                "colors": [COLOURS["label"]],
                "show_labels": [True],
            },
            labels=np.array([[f"B = {factor * b:.0f} {unit}"] for b in size]),
        )
        out.notes.append(f"Blue arrow: flux density, longest for {factor * size.max():.3g} {unit}.")


def _write_ground(scene: Film, out: Writer):
    """A rectangle with grid lines on the ground plane, around where the device goes."""
    step, margin = scene.step, 0.8 * scene.size
    low, high = (np.floor((scene.low - margin) / step) * step)[:2], (np.ceil((scene.high + margin) / step) * step)[:2]

    def on_plane(points: np.ndarray, lift: float) -> np.ndarray:
        z = (scene.height + lift - points @ scene.up[:2]) / scene.up[2]
        return np.concatenate([points, z[..., None]], axis=-1).astype(np.float32)

    corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
    lift = 1e-3 * scene.size
    out.stream.log(
        "ground/plane",
        rr.Mesh3D(
            vertex_positions=on_plane(corners, -lift),
            triangle_indices=[[0, 1, 2], [0, 2, 3]],
            vertex_colors=[COLOURS["ground"]] * 4,
        ),
        static=True,
    )
    lines = [np.array([(v, low[1]), (v, high[1])]) for v in np.arange(low[0], high[0] + step / 2, step)]
    lines += [np.array([(low[0], v), (high[0], v)]) for v in np.arange(low[1], high[1] + step / 2, step)]
    out.stream.log(
        "ground/grid",
        rr.LineStrips3D(on_plane(np.array(lines), 0.0), radii=rr.Radius.ui_points(0.5), colors=[COLOURS["grid"]]),
        static=True,
    )


def _write_motion(scene: Film, out: Writer):
    """Displacements of the tip and of the centre of mass."""
    centre = scene.trajectory.centre_of_mass()[:, scene.world]
    centre = np.where(np.isfinite(centre), centre, 0.0)
    held = not np.all(scene.model.free)  # then the tip says it all
    plot = Plot("Displacement")
    out.notes.append(f"Tip: node {scene.tip}.")
    tip = scene.x[:, scene.tip] - scene.x[0, scene.tip]
    moved = {"tip": tip, "centre": centre - centre[0]}
    largest = max(float(np.abs(d).max()) for d in moved.values())
    unit, factor = scaled("m", largest, "m")
    for (what, d), dim in zip(moved.items(), (1.0, 0.6), strict=True):
        for i, axis in enumerate("xyz"):
            colour = tuple(int(c * dim + 90 * (1 - dim)) for c in SERIES[i])
            name = f"{'tip' if what == 'tip' else 'centre of mass'} {axis} ({unit})"
            path = f"/{what}/{axis}"
            out.series(path, name, scene.times, factor * d[:, i], colour)
            if np.ptp(d[:, i]) > 0.02 * largest and (what == "tip" or not held):
                plot.paths.append(path)
    plot.name += f" ({unit})"
    if largest > 0:
        out.plots.append(plot)


def _write_energies(scene: Film, out: Writer):
    """Energies of the effects that have any, and the work of those that exchange it."""
    t, w = scene.trajectory, scene.world
    found = [("energy", n, v[:, w]) for n, v in t.energies.items()]
    found += [("work", n, v[:, w]) for n, v in t.work.items() if n in t.model.effects and get(n).exchanges_work]
    found = [(kind, n, v) for kind, n, v in found if np.all(np.isfinite(v)) and np.any(v != 0)]
    if not found:
        return
    unit, factor = scaled("J", max(float(np.abs(v).max()) for *_, v in found), "m")
    # an effect's work and its energy tell the same twice; the plot shows the one that the balance counts
    counted = [kind == "work" or n == "kinetic" or not get(n).exchanges_work for kind, n, _ in found]
    shown = _chosen([v if c else np.zeros(1) for (*_, v), c in zip(found, counted, strict=True)], 5)
    shown = [i for i in shown if counted[i]]
    plot = Plot(f"Energies and work ({unit})")
    for i, (kind, name, values) in enumerate(found):
        path = f"/{kind}/{slug(name)}"
        label = f"{'work: ' if kind == 'work' else ''}{name.replace('_', ' ')} ({unit})"
        colour = SERIES[shown.index(i)] if i in shown else SERIES[-1]
        out.series(path, label, scene.times, factor * values, colour)
        if i in shown:
            plot.paths.append(path)
    out.plots.append(plot)


_DRIVES = (
    ("field_", "Field", "T", "m"),
    ("gradient_", "Field gradient", "T/m", ""),
    ("voltage_", "Voltage", "V", ""),
    ("temperature", "Temperature rise", "K", ""),
    ("load", "Load factor", "-", ""),
)


def _write_drive(scene: Film, out: Writer):
    """Every drive channel that is not zero throughout, a plot for each kind."""
    for prefix, title, unit, usual in _DRIVES:
        values = {n: scene.channel(n) for n in scene.trajectory.drive.signals if n.startswith(prefix)}
        values = {n: v for n, v in values.items() if np.any(v != 0)}
        if not values:
            continue
        largest = max(float(np.abs(v).max()) for v in values.values())
        unit, factor = (unit, 1.0) if unit == "-" else scaled(unit, largest, usual)
        plot = Plot(f"{title} ({unit})")
        for i, (name, v) in enumerate(values.items()):
            out.series(
                f"/drive/{name}", f"{name.replace('_', ' ')} ({unit})", scene.times, factor * v, SERIES[i % len(SERIES)]
            )
            plot.paths.append(f"/drive/{name}")
        plot.paths = plot.paths[:PLOTTED]
        out.plots.append(plot)


_MEASURED = {"angle": ("deg", 180.0 / np.pi), "length": ("mm", 1e3), "force": ("mN", 1e3)}


def _write_recording(recording: Recording, scene: Film, out: Writer):
    """Markers as points in space, all other channels as measured series with the simulated ones."""
    others = any(c.kind != "marker" for c in recording.channels.values())
    simulated = _simulated(recording, scene, out) if others else {}
    for channel in recording.channels.values():
        values = np.asarray(channel.values, float).reshape(len(recording.times), -1)
        if channel.kind == "marker":
            seen = np.isfinite(values).all(axis=1)
            path = f"markers/{slug(channel.name)}"
            out.stream.log(
                path,
                rr.Points3D.from_fields(
                    colors=[COLOURS["marker"]], radii=[0.015 * scene.size], labels=[channel.name], show_labels=False
                ),
                static=True,
            )
            rr.send_columns(
                path,
                [rr.TimeColumn(TIMELINE, duration=recording.times)],
                rr.Points3D.columns(positions=values[seen].astype(np.float32)).partition(seen.astype(int)),
                recording=out.stream,
            )
            continue
        kind = "angle" if channel.is_angle else "force" if channel.kind == "force" else "length"
        unit, factor = _MEASURED[kind]
        name = f"Measured (pale) and simulated {kind}s ({unit})"
        plot = next((p for p in out.plots if p.name == name), None)
        if plot is None:
            plot = Plot(name)
            out.plots.insert(0, plot)
        predicted = simulated.get(channel.name)
        for i, column in enumerate(values.T):
            suffix = "" if values.shape[1] == 1 else f" {'xyz'[i]}"
            label, path = f"{channel.name}{suffix} ({unit})", slug(channel.name + suffix)
            colour, seen = SERIES[len(plot.paths) // 2 % len(SERIES)], np.isfinite(column)
            pale = tuple((c + 2 * 255) // 3 for c in colour)
            out.series(f"/measured/{path}", f"measured {label}", recording.times[seen], factor * column[seen], pale,
                       points=True)  # fmt: skip
            plot.paths.append(f"/measured/{path}")
            if predicted is not None:
                read = factor * predicted.reshape(len(recording.times), -1)[:, i]
                out.series(f"/simulated/{path}", f"simulated {label}", recording.times, read, colour)
                plot.paths.append(f"/simulated/{path}")


def _simulated(recording: Recording, scene: Film, out: Writer) -> dict[str, np.ndarray]:
    """What the recording's channels read in the simulation; nothing, with a note, where that cannot be told."""
    from origami_sim.observation.observe import (
        observe,  # it needs the solvers, which a replay without a recording does not
    )

    try:
        return observe(scene.trajectory, recording, world=scene.world)
    except InputError as e:
        out.notes.append(f"No simulated channels: {e}")
        return {}


def _write_notes(scene: Film, out: Writer):
    t = scene.trajectory
    kinds = {"passive": "light blue: passive sheet", "magnet": "dark: magnetised", "arm": "sand: arms"}
    used = [text for kind, text in kinds.items() if kind in scene.kinds]
    lines = [
        f"# {scene.title}",
        "",
        f"World {scene.world} of {t.x.shape[2]}; {len(t.times)} frames, {t.times[0]:g} s to {t.times[-1]:g} s; "
        f"{t.step if t.dt == t.step.dt else f'dt = {t.dt:.3g} s'}.",
        "",
        "Coordinates in metres, z up; time in seconds.",
        "",
        f"- Panels: {', '.join(used)}.",
        *(f"- {n}" for n in out.notes),
        *(["- Thick lines: creases, in the colours of the angle plot."] if len(t.model.creases) else []),
        *(f"- **{f}**" for f in t.failures if f.world == scene.world),
        *(f"- {n}" for n in t.notes),
        "",
        f"Effects: {', '.join(t.model.effects)}.",
    ]
    out.stream.log("notes", rr.TextDocument("\n".join(lines), media_type=rr.MediaType.MARKDOWN), static=True)


ROWS = 3
"""Plots above each other; further ones are tabs of the last. With four, an axis of a small window shows one number."""


def _axis(plot: Plot, out: Writer) -> rrb.ScalarAxis | None:
    """The vertical axis of a plot: between round numbers, so that it shows more than one, or as the viewer likes."""
    found = [out.extents[p] for p in plot.paths if p in out.extents]
    low, high = min((a for a, _ in found), default=0.0), max((b for _, b in found), default=0.0)
    if not (np.isfinite(low) and np.isfinite(high)) or high - low <= 1e-9 * max(abs(low), abs(high)):
        return None  # an empty one is a warning of the writer on standard error
    step = nice(0.35 * (high - low))
    low, high = float(step * np.floor(low / step)), float(step * np.ceil(high / step))
    edge = 0.05 * (high - low)
    return rrb.ScalarAxis(range=(low, high) if axis_numbers(low, high) > 1 else (low - edge, high + edge))


def axis_numbers(low: float, high: float) -> int:
    """How many numbers the viewer writes at an axis: at the powers of ten that part it by ten at most, off its ends."""
    power = 10.0 ** (np.ceil(np.log10(high - low) - 1e-9) - 1.0)
    return int(np.ceil(high / power - 1e-9) - np.floor(low / power + 1e-9)) - 1


def _blueprint(scene: Film, out: Writer) -> rrb.Blueprint:
    _, eye, target, _ = scene.camera()
    controls = rrb.EyeControls3D(position=eye, look_target=target, eye_up=(0.0, 0.0, 1.0))
    if np.linalg.norm(scene.high - scene.low) > WALK * scene.size:  # it walks away: the camera goes along
        start = scene.x[0].mean(axis=0)
        near = start + (eye - target) / np.linalg.norm(eye - target) * 1.6 * scene.size
        controls = rrb.EyeControls3D(
            position=near, look_target=start, eye_up=(0.0, 0.0, 1.0), tracking_entity="/sheet/faces"
        )
    space = rrb.Spatial3DView(
        origin="/",
        name=f"{scene.title} (m)",
        background=BACKGROUND,
        line_grid=False,
        contents=[
            "+ /sheet/**",
            "+ /magnets/**",
            "+ /field/**",
            "+ /contacts/**",
            "+ /ground/**",
            "+ /scale/**",
            "+ /markers/**",
        ],
        eye_controls=controls,
    )
    about = rrb.TextDocumentView(origin="/notes", name="About")
    start, end = float(scene.times[0]), float(scene.times[-1])
    # the legend lies on the plot, so room is left for it beside the curves
    room = [rr.TimeRangeBoundary.absolute(seconds=t) for t in (start, end + 0.5 * (end - start))]
    axis = rrb.TimeAxis(view_range=rr.TimeRange(start=room[0], end=room[1]))
    plots = [
        rrb.TimeSeriesView(
            origin="/",
            name=p.name,
            contents=[f"+ {path}" for path in p.paths],
            axis_x=axis,
            axis_y=_axis(p, out),
            plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.RightTop),
        )
        for p in out.plots
    ]
    left = rrb.Tabs(space, about)
    duration = end - start
    time = rrb.TimePanel(
        state="collapsed",
        timeline=TIMELINE,
        play_state="Playing",
        loop_mode="All",
        playback_speed=min(1.0, duration / 4.0) if duration > 0 else 1.0,
    )
    rows = plots if len(plots) <= ROWS else [*plots[: ROWS - 1], rrb.Tabs(*plots[ROWS - 1 :])]
    root = rrb.Horizontal(left, rrb.Vertical(*rows), column_shares=[11, 9]) if plots else left
    return rrb.Blueprint(root, rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed"), time)

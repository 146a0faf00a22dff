"""The sidecar of a recording: what the columns of its table mean, in TOML.

    name = "double pendulum, run 1"     # the file's stem when left out
    description = "..."                 # also licence: free text, kept in the metadata
    allow_gaps = false                  # true: missing values and time gaps become notes instead of errors
    allow_repeats = false               # true: rows of one time, as where a printed line is steep, become their mean
    motion = "quasistatic"              # optional: inertia does not count, such as in ramps and holds; or "dynamic"
    allow_swaps = false                 # true: markers that seem to exchange names become notes instead of errors

    [source]                            # optional; or source = "free text"
    format = "deeplabcut"               # table, tracker, deeplabcut, sleap, motive, c3d; seen from the file if left out
    likelihood = 0.6                    # points with a lower score are missing
    axes = ["x", "-z", "y"]             # the model's x, y, z in terms of the file's (here its y is up)
    origin = [0.0, 0.0, 0.0]            # the model's origin in the file's axes [m]
    about = "..."                       # free text

    [select]                            # optional: keep the rows where the column has this value
    toss = 12

    [time]                              # left out: the file's own clock, or else rows are load steps 0, 1, 2, ...
    column = "time_s"
    unit = "s"                          # s, ms, us, min
    rate_hz = 1000                      # optional; checked against the column, or the time base when there is no column

    [channels.theta1]                   # the name that the simulation's observer uses
    column = "theta1_rad"               # or columns = ["x", "y", "z"], or track = "name of the tracked point"
    kind = "panel_angle"                # panel_angle, crease_angle, marker, marker_2d, tip_displacement, force, moment
    unit = "rad"                        # of the column; may be left out where the file states its unit of length
    noise = 1e-4                        # standard deviation in `unit`, or "0.4 mrad"; estimated when left out
    sign = 1                            # value = sign * (reading - offset)
    offset = 0.0                        # reading at zero, in `unit`, e.g. the encoder zero
    unwrap = false                      # true: remove jumps of whole turns from an angle
    panel = "arm1"                      # what is observed: panel, crease, node, nodes, ground or grip, and
    point = [0.0, 0.0, 0.01]            # on a panel, the body point from its centroid, in the reference axes [m]
    from = "hinge1"                     # or, in place of the point, measured from a crease of the panel: its
    distance = "45 mm"                  # distance [m] from it, and where it lies along it: from its middle to the right
    along = 0.0                         # for who looks from it into the panel, the panel's upper side up [m]
    height = 0.001                      # of a marker above the mid-plane, along the normal [m]
    direction = [0.0, 0.0, 1.0]         # of a force or a displacement of one column
    camera = "side"                     # of a marker_2d; may be left out where there is one camera

    [cameras.side]                      # the plane in which a marker_2d is measured
    origin = [0.0, 0.0, 0.0]            # point of the model [m] that is seen at
    pixel = [960, 540]                  # this reading; the lower left corner when left out
    right = [1.0, 0.0, 0.0]             # directions of the picture in the model's axes; or
    up = [0.0, 0.0, 1.0]                # rotation = [rx, ry, rz] [rad], which turns x and z into them
    scale = 0.0002                      # metres per pixel, for readings in px
    height = 1080                       # of the picture, where rows count down from its upper edge

    [drive.field]                       # optional: what was applied; grip_top, turn_top: by how much a grip moved
    columns = ["bx", "by", "bz"]        # or column, or value = [0.0, 0.0, 5.0] for a constant
    unit = "mT"
    direction = [0.0, 0.0, 1.0]         # turns one number into a vector
    file = "supply.csv"                 # columns of another table, with its time_column, time_unit and shift [s]
    times = [0.0, 1.0]                  # or samples stated here [s], with values = [0.0, 5.0]

    [[drive.sources]]                   # optional: a magnet, coil or table of a field around it, as in a design file;
    coil = { current = "2 A", radius = "5 cm", position = [0, 0, { column = "z", unit = "mm" }] }   # a column: it moved

    [scene]                             # or, for the name alone, model = "my_flap.py" at the top
    name = "pendulum_chain"             # the scene that simulates this object, or the device: "my_flap.py",
                                        # "package.module:build"; nothing of it is executed unless --model names it, too
    overrides = { mass_1 = 0.09 }       # settings of this object that differ; not over a calibration of its own

    [priors]                            # optional, for a diagnosis: standard deviations of what is known of the object
    mass_1 = 0.5e-3                     # in the unit of the scene's setting, or "5 %" of its value, or "0.5 mm"
    "crease.stiffness[hinge1]" = { factor = 1.2 }       # of one crease: as a share ("20 %", a factor), or
    "crease.rest_angle[hinge1]" = { sd = "0.02 rad" }   # added to what it has
    "clock_delay.clock_delay" = "5 ms"  # of an effect that may act without being a fault: how well it is aligned

    [gravity]                           # optional, of this recording; or gravity = [0.0, 0.0, -9.81]
    pose = "hanging"                    # hanging, upside down: along or against `down`; lying: along `face`
    down = [0.0, 0.0, -1.0]             # the model's direction that points down as it hangs
    face = [1.0, 0.0, 0.0]              # the model's direction that points down as it lies
    size = 9.81                         # [m/s^2]; that of the model when left out

    [start]                             # optional; or start = "moving"
    state = "released"                  # released (at rest), equilibrium (in the first frame's drive), moving
    angles = { hinge1 = "20 deg" }      # fold angles at release [rad], by crease; others are as recorded
    sd = "0.01 rad"                     # how well they, or the equilibrium, are known
    rate_sd = "0.01 rad/s"              # and how well that it rests

    [possible]                          # optional, for a diagnosis: what can be done in a further recording
    levels = [0.3, 0.6, 1.5, -1]        # of the drives, over those recorded; [] if they cannot be changed
    frequencies = [0.3, 3]              # of the drives, over those recorded
    steps = true                        # whether a drive can be switched on and held
    starts = [0.1, 0.3, 2]              # displacements at the start, over those recorded
    ring_down = 0.2                     # displacement from which it can be let go at rest; 0: it cannot
    clamps = ["hinge1"]                 # creases that can be clamped; all when left out
    tilt = "10 deg"                     # how far it can be tilted; from 180 deg on also upside down; 0: not at all
    weights = true                      # whether mass can be added to panels
    longest = "60 s"                    # longest recording; three times the longest of what is held when left out

Any other key is an error. Units: see `origami_sim.units`.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from origami_sim.errors import InputError
from origami_sim.files import read_toml
from origami_sim.recording.camera import rotation_matrix
from origami_sim.recording.clock import even_times
from origami_sim.recording.placed import columns_of
from origami_sim.recording.possible import Possible
from origami_sim.recording.recording import CHANNEL_KINDS
from origami_sim.recording.section import ATTACHMENT_KEYS, Section
from origami_sim.recording.stated import MOTIONS, Gravity, Start, gravity_spec, noise_spec, prior_spec, start_spec
from origami_sim.recording.table import Table
from origami_sim.recording.trackers import FORMATS
from origami_sim.units import unit_factor

_TOP_KEYS = (
    "name",
    "description",
    "source",
    "licence",
    "allow_gaps",
    "allow_repeats",
    "allow_swaps",
    "model",
    "motion",
    "select",
    "time",
    "channels",
    "cameras",
    "drive",
    "scene",
    "priors",
    "gravity",
    "start",
    "possible",
)
_SOURCE_KEYS = ("format", "likelihood", "axes", "origin", "about")
_TIME_KEYS = ("column", "unit", "rate_hz")
_CHANNEL_KEYS = ("column", "columns", "track", "kind", "unit", "noise", "sign", "offset", "unwrap", "camera")
_CAMERA_KEYS = ("origin", "pixel", "right", "up", "rotation", "scale", "height")
_DRIVE_KEYS = (
    *("column", "columns", "value", "unit", "direction"),
    *("file", "time_column", "time_unit", "shift", "times", "values"),
)
_SCENE_KEYS = ("name", "overrides")
_DRIVEN = {
    "field": "flux density",
    "gradient": "flux density gradient",
    "voltage": "voltage",
    "temperature": "temperature",
    "load": "ratio",
    "grip": "length",
    "turn": "angle",
    "crease_angle": "angle",
}
_TRACKED = {"marker": "xyz", "marker_2d": "xy"}
"""Coordinates of a tracked point that a kind of channel takes."""


@dataclass(frozen=True, eq=False)
class Sidecar:
    """A checked sidecar: every key known, every value of its type, every unit known."""

    file: Path
    name: str | None
    free_text: dict[str, str]
    allow_gaps: bool
    allow_repeats: bool
    allow_swaps: bool
    source: dict[str, Any]
    select: dict[str, Any]
    time: dict[str, Any]
    channels: dict[str, dict[str, Any]]
    cameras: dict[str, dict[str, Any]]
    drive: dict[str, dict[str, Any]]
    sources: Any
    scene: dict[str, Any]
    priors: dict[str, float | str]
    gravity: Gravity | None
    start: Start | None
    possible: dict[str, Any]
    motion: str | None

    @classmethod
    def read(cls, path: Path) -> "Sidecar":
        """Read and check a sidecar; InputError names the first key that is wrong."""
        tree = read_toml(path)
        top = Section(path, "", tree, _TOP_KEYS)
        channels = top.table("channels")
        if not channels:
            raise InputError("no channel is described", file=path, field="channels")
        time = Section(path, "time.", top.table("time"), _TIME_KEYS)
        rate = time.number("rate_hz", None)
        if rate is not None and rate <= 0.0:
            raise InputError("the rate must be positive", file=path, field="time.rate_hz", value=rate)
        if "time" in tree and rate is None and "column" not in time.values:
            raise InputError("the time needs a column or a rate_hz", file=path, field="time")
        scene = Section(path, "scene.", top.table("scene"), _SCENE_KEYS)
        source = _source_spec(path, tree.get("source"))
        drives = dict(top.table("drive"))
        sources = drives.pop("sources", [])
        cameras = {name: _camera_spec(path, name, table) for name, table in top.table("cameras").items()}
        texts = {key: text for key in ("description", "licence") if (text := top.text(key, None))}
        return cls(
            file=path,
            name=top.text("name", None),
            free_text=texts | ({"source": source["about"]} if source["about"] else {}),
            allow_gaps=top.flag("allow_gaps"),
            allow_repeats=top.flag("allow_repeats"),
            allow_swaps=top.flag("allow_swaps"),
            source=source,
            select={column: top.label("select", column) for column in top.table("select")},
            time={"column": time.text("column", None), "unit": time.unit("time", default="s"), "rate_hz": rate},
            channels={name: _channel_spec(path, name, table, cameras) for name, table in channels.items()},
            cameras=cameras,
            drive={name: _drive_spec(path, name, table) for name, table in drives.items()},
            sources=sources,
            scene=_scene_spec(top, scene),
            priors={name: prior_spec(top, name) for name in top.table("priors")},
            gravity=gravity_spec(path, tree.get("gravity")),
            start=start_spec(path, tree.get("start")),
            possible=_possible_spec(path, top.table("possible")),
            motion=top.choice("motion", dict.fromkeys(MOTIONS)) if "motion" in tree else None,
        )

    @property
    def columns(self) -> list[str]:
        """Numeric columns that the file must have."""
        specs = [*self.channels.values(), *(spec for spec in self.drive.values() if spec["file"] is None)]
        named = [*(column for spec in specs for column in spec["columns"]), *columns_of(self.sources)]
        time = [self.time["column"]] if self.time["column"] is not None else []
        return list(dict.fromkeys(time + named))

    def time_base(self, table: Table) -> str:
        """Where the times come from: 'column', 'clock' of the file, 'rate' or 'step'."""
        if self.time["column"] is not None:
            return "column"
        if table.clock is not None:
            return "clock"
        return "rate" if self.time["rate_hz"] is not None else "step"

    def times(self, table: Table) -> np.ndarray:
        """(n,) times [s], or step numbers."""
        base = self.time_base(table)
        if base == "column":
            return even_times(table.numbers[self.time["column"]]) * unit_factor(self.time["unit"])
        if base == "clock":
            return even_times(table.numbers[table.clock or ""])
        steps = table.numbers[table.frame] if base == "rate" and table.frame else np.arange(len(table.rows))
        return steps / (self.time["rate_hz"] or 1.0)

    def check_rate(self, times: np.ndarray) -> None:
        """Raise where the stated rate and the time column differ by more than one per cent."""
        rate = self.time["rate_hz"]
        measured = 1.0 / float(np.median(np.diff(times)))
        if rate is not None and abs(measured - rate) > 0.01 * rate:
            raise InputError(
                f"the stated rate is not that of the time column, {measured:.6g} Hz",
                file=self.file,
                field="time.rate_hz",
                value=rate,
            )


def _possible_spec(path: Path, given: dict[str, Any]) -> dict[str, Any]:
    """What can be done in a further recording, checked."""
    Possible().but(given, path)
    return given


def _scene_spec(top: Section, scene: Section) -> dict[str, Any]:
    """The scene or device of the recording as it is stated, its name, and the settings of this object."""
    model, name = top.text("model", None), scene.text("name", None)
    if model is not None and name is not None:
        top.refuse("give either model or [scene] name", "model", model)
    if model is None and not scene.values:
        return {}
    stated = model or name
    return {"name": _device(stated), "stated": stated, "overrides": scene.table("overrides")}


def _device(stated: str | None) -> str | None:
    """The name of a scene or device; of a device's file or module, which nothing here opens, its stem."""
    return stated and re.sub(r"(.*/)?(\w+)\.(py|toml)(:\w+)?|([\w.]+\.)?(\w+):\w+", r"\2\6", stated)


def _source_spec(path: Path, given: object) -> dict[str, Any]:
    """What the sidecar tells about the file; `axes` becomes a matrix (3, 3), or None."""
    if given is None or isinstance(given, str):
        section = Section(path, "", {} if given is None else {"source": given}, ("source",))
        return {"format": None, "likelihood": None, "axes": None, "origin": None, "about": section.text("source", None)}
    section = Section(path, "source.", given, _SOURCE_KEYS)
    axes = section.values.get("axes")
    turn = None
    if axes is not None:
        rows = {sign + axis: factor * np.eye(3)[k] for k, axis in enumerate("xyz") for sign, factor in _SIGNS}
        if not (isinstance(axes, list) and len(axes) == 3 and all(isinstance(a, str) and a in rows for a in axes)):
            section.refuse("must be three of x, y, z, -x, -y, -z", "source.axes", axes)
        turn = np.array([rows[a] for a in axes])
        if not np.isclose(np.linalg.det(turn), 1.0):
            section.refuse("must keep a right hand a right hand", "source.axes", axes)
    likelihood = section.number("likelihood", None)
    if likelihood is not None and not 0.0 <= likelihood <= 1.0:
        section.refuse("must lie between 0 and 1", "source.likelihood", likelihood)
    form = section.choice("format", dict.fromkeys(FORMATS)) if "format" in section.values else None
    origin = section.vector("origin", None)
    return {
        "format": form,
        "likelihood": likelihood,
        "axes": turn,
        "origin": origin,
        "about": section.text("about", None),
    }


_SIGNS = (("", 1.0), ("-", -1.0))


def _camera_spec(path: Path, name: str, table: object) -> dict[str, Any]:
    section = Section(path, f"cameras.{name}.", table, _CAMERA_KEYS)
    axes = np.array([section.vector("right", [1.0, 0.0, 0.0]), section.vector("up", [0.0, 0.0, 1.0])])
    if "rotation" in section.values:
        if "right" in section.values or "up" in section.values:
            section.refuse("give either rotation or right and up", section.prefix + "rotation", None)
        axes = rotation_matrix(np.array(section.vector("rotation", None)))[:, [0, 2]].T
    if not np.allclose(axes @ axes.T, np.eye(2), atol=1e-6):
        section.refuse(
            "right and up must be perpendicular and of length 1", f"cameras.{name}", np.round(axes, 6).tolist()
        )
    scale, height = section.number("scale", None), section.number("height", None)
    for key, value in (("scale", scale), ("height", height)):
        if value is not None and not value > 0.0:
            section.refuse("must be positive", section.prefix + key, value)
    return {
        "origin": np.array(section.vector("origin", [0.0, 0.0, 0.0])),
        "axes": axes,
        "scale": scale,
        "flip": height is not None,
        "zero": tuple(section.vector("pixel", [0.0, height or 0.0], size=2)),
    }


def _channel_spec(path: Path, name: str, table: object, cameras: Mapping[str, object]) -> dict[str, Any]:
    section = Section(path, f"channels.{name}.", table, _CHANNEL_KEYS + ATTACHMENT_KEYS)
    kind = section.choice("kind", CHANNEL_KINDS)
    dimension, counts = CHANNEL_KINDS[kind]
    columns = section.columns(_TRACKED.get(kind))
    if len(columns) not in counts:
        raise InputError(
            f"a channel of kind '{kind}' cannot have {len(columns)} columns",
            file=path,
            field=section.prefix + "columns",
            value=columns,
            allowed=" or ".join(str(count) for count in counts),
        )
    sign = section.number("sign", 1.0)
    if sign not in (1.0, -1.0):
        raise InputError("unknown sign", file=path, field=section.prefix + "sign", value=sign, allowed="1, -1")
    unwrap = section.flag("unwrap")
    if unwrap and dimension != "angle":
        raise InputError("only an angle can be unwrapped", file=path, field=section.prefix + "unwrap")
    unit = section.length_unit(kind) if dimension == "length" else section.unit(dimension)
    noise = noise_spec(section, dimension, unit)
    return {
        "columns": columns,
        "kind": kind,
        "unit": unit,
        "camera": section.camera(kind, cameras),
        "noise": noise,
        "sign": sign,
        "offset": section.number("offset", 0.0),
        "unwrap": unwrap,
        "attachment": section.attachment(kind, len(columns)),
    }


def _drive_spec(path: Path, name: str, table: object) -> dict[str, Any]:
    section = Section(path, f"drive.{name}.", table, _DRIVE_KEYS)
    given = section.values
    ways = [key for key in ("value", "values") if key in given] + ["column"] * ("column" in given or "columns" in given)
    if len(ways) > 1:
        raise InputError("a drive has columns or a value, not both", file=path, field=f"drive.{name}")
    if ("times" in given) != ("values" in given):
        section.refuse("samples need both 'times' and 'values'", f"drive.{name}", None)
    if "file" in given and "time_column" not in given:
        section.refuse("a drive in a file of its own needs a 'time_column'", f"drive.{name}.time_column", None)
    for key in ("time_column", "time_unit", "shift"):
        if key in given and "file" not in given:
            section.refuse("is only for a drive in a file of its own", section.prefix + key, given[key])
    for key in ("value", "values"):
        if key in given and (given[key] == [] or [] in _listed(given[key])):
            section.refuse("must not be empty", section.prefix + key, given[key])
        for row in _listed(given.get(key, [])):
            for component in _listed(row) if key == "values" else [row]:
                section.check_number(key, component)
    times = [section.check_number("times", t) for t in _listed(given.get("times", []))]
    if "times" in given and (
        len(times) < 2 or len(times) != len(_listed(given["values"])) or np.any(np.diff(times) <= 0)
    ):
        section.refuse("must increase, with one value each", section.prefix + "times", times)
    if len({len(_listed(row)) for row in _listed(given.get("values", []))}) > 1:
        section.refuse("must have equally many components", section.prefix + "values", given["values"])
    time_unit = given.get("time_unit", "s")
    unit_factor(time_unit, dimension="time", file=path, field=section.prefix + "time_unit")
    return {
        "columns": [] if "value" in given or "values" in given else section.columns(),
        "value": given.get("value"),
        "unit": section.unit(_DRIVEN.get(name, _DRIVEN.get(name.partition("_")[0]))),
        "direction": section.direction(),
        "file": section.text("file", None),
        "time_column": section.text("time_column", None),
        "time_unit": time_unit,
        "shift": section.number("shift", 0.0),
        "times": times or None,
        "values": given.get("values"),
    }


def _listed(value: Any) -> list:
    return value if isinstance(value, list) and value else [value] if value != [] else []

"""Read a recording: a table or an export of a tracking program, with a TOML sidecar that says what it means.

The sidecar lies next to the table as `<stem>.toml`, or is given; `origami_sim.recording.sidecar` documents its keys.
"""

import hashlib
from pathlib import Path

import numpy as np

from origami_sim.errors import InputError
from origami_sim.files import read_bytes
from origami_sim.recording.camera import Camera
from origami_sim.recording.lint import Series, lint, repeated
from origami_sim.recording.noise import noise_report
from origami_sim.recording.placed import placed_sources, spanning
from origami_sim.recording.recording import Channel, DriveChannel, Recording
from origami_sim.recording.sidecar import Sidecar
from origami_sim.recording.table import Table, read_table
from origami_sim.recording.trackers import FORMATS, detect, read_export
from origami_sim.units import si_unit, unit_factor


def read_recording(csv_path: str | Path, sidecar: str | Path | None = None) -> Recording:
    """Read a table and its sidecar, lint them and convert to SI.

    Args:
        csv_path: a .csv, .txt or .parquet file with one header row, or an export of Tracker, DeepLabCut, SLEAP, Motive,
            or a .c3d file; see `origami_sim.recording.trackers`.
        sidecar: the TOML file; `<stem>.toml` next to the table when None.

    Returns:
        The recording; notes of the lint are in `metadata["notes"]`, what is known of the noise is in its channels.

    Raises:
        InputError: the first fault found, in one sentence.
    """
    path = Path(csv_path)
    data = read_bytes(path)
    description = Path(sidecar) if sidecar is not None else path.with_suffix(".toml")
    if sidecar is None and not description.is_file():
        raise InputError(f"no sidecar '{description.name}' next to the recording", file=path, field="sidecar")
    side = Sidecar.read(description)
    table, form = _read_any(path, data, side)

    table, merged = _merged(table, side)
    times = side.times(table)
    if side.start is not None and side.time_base(table) == "step":
        raise InputError("a quasi-static curve has no start", file=description, field="start", value=side.start.state)
    if side.motion == "dynamic" and side.time_base(table) == "step":
        raise InputError("load steps have no clock", file=description, field="motion", value=side.motion)
    specs = {name: _with_unit(name, spec, table, side) for name, spec in side.channels.items()}
    cameras = {name: _camera(name, spec, side) for name, spec in specs.items() if spec["camera"] is not None}
    specs = {name: _with_noise(spec, cameras.get(name)) for name, spec in specs.items()}
    series = {
        name: Series(
            readings=table.stack(spec["columns"]),
            kind=spec["kind"],
            unit=spec["unit"],
            noise=spec["noise"],
            unwrap=spec["unwrap"],
        )
        for name, spec in specs.items()
    }
    notes = merged + lint(
        times,
        series,
        file=path,
        position=table.position,
        allow_gaps=side.allow_gaps,
        allow_swaps=side.allow_swaps,
        by_step=side.time_base(table) == "step",
    )
    side.check_rate(times)
    channels = {
        name: _channel(name, spec, series[name], times, cameras.get(name), side) for name, spec in specs.items()
    }
    stated = specs | {f"drive.{name}": spec for name, spec in side.drive.items()}
    return Recording(
        name=side.name or path.stem,
        times=times,
        channels=channels,
        drive={name: _drive(name, spec, table, times, side) for name, spec in side.drive.items()},
        metadata={
            "file": str(path),
            "sidecar": str(description),
            "sha256": hashlib.sha256(data).hexdigest(),
            "format": form,
            "time_base": side.time_base(table),
            "notes": notes,
            "scene": side.scene,
            "priors": side.priors,
            "possible": side.possible,
            "units": {"time": side.time["unit"], **{n: s["unit"] for n, s in stated.items()}},
            **side.free_text,
        },
        gravity=side.gravity,
        start=side.start,
        motion=side.motion,
        sources=placed_sources(side.sources, table, times, side.file),
    )


def _read_any(path: Path, data: bytes, side: Sidecar) -> tuple[Table, str]:
    """The table of any format, and which format it was."""
    form = side.source["format"] or detect(path, data)
    if form == "table":
        if path.suffix.lower() in (".csv", ".txt") and b"\0" in data[:1000]:
            raise InputError(
                "is no text, and its first lines show no known format",
                file=path,
                field="source.format",
                allowed=", ".join(FORMATS),
            )
        if side.source["likelihood"] is not None:
            raise InputError("a plain table has no scores", file=side.file, field="source.likelihood")
        return read_table(path, data, side.columns, list(side.select)).select(side.select), form
    if side.select:
        raise InputError(f"rows of the format '{form}' cannot be selected", file=side.file, field="select")
    table = read_export(path, data, form, likelihood=side.source["likelihood"])
    table.require(side.columns)
    return table.check_numbers(), form


def _merged(table: Table, side: Sidecar) -> tuple[Table, list[str]]:
    """The table with rows of one time joined, if the sidecar allows it, and a note that says so."""
    if not side.allow_repeats or side.time_base(table) == "step":
        return table, []
    times = side.times(table)
    groups = np.cumsum(~repeated(times))
    if not len(times) or groups[-1] == len(times):
        return table, []
    count = len(times) - int(groups[-1])
    said = (
        "1 row that repeats the time before it is"
        if count == 1
        else f"{count} rows that repeat the time before them are"
    )
    return table.averaged(groups - 1), [f"{said} averaged with it."]


def _with_unit(name: str, spec: dict, table: Table, side: Sidecar) -> dict:
    """The channel with its unit: that of the sidecar, or that of the file where it states one; both must agree."""
    is_length = spec["kind"] in ("marker", "marker_2d", "tip_displacement")
    field = f"channels.{name}.unit"
    if not is_length:
        return spec
    if table.unit is not None and spec["unit"] is not None and spec["unit"] != table.unit:
        raise InputError(
            "the file states another unit of length",
            file=side.file,
            field=field,
            value=spec["unit"],
            allowed=table.unit,
        )
    unit = spec["unit"] or table.unit or ""
    if unit == "px":
        camera = side.cameras.get(spec["camera"] or "")
        if spec["kind"] != "marker_2d" or camera is None or camera["scale"] is None:
            raise InputError(
                f"channel '{name}' is in pixels: only a marker_2d of a camera with a scale can be",
                file=side.file,
                field=field,
                value=unit,
            )
    else:
        unit_factor(unit, dimension="length", file=side.file, field=field)
    return spec | {"unit": unit}


def _with_noise(spec: dict, camera: Camera | None) -> dict:
    """The channel with its noise in its own unit, which may have been stated in another."""
    if spec["noise"] is None:
        return spec
    value, unit = spec["noise"]
    own = camera.scale if camera is not None else unit_factor(spec["unit"])
    return spec | {"noise": value if unit in (None, "px") else value * unit_factor(unit) / own}


def _camera(name: str, spec: dict, side: Sidecar) -> Camera:
    camera = side.cameras[spec["camera"]]
    in_pixels, scale = spec["unit"] == "px", camera["scale"]
    if not in_pixels and scale is not None:
        raise InputError(
            f"the scale is for readings in px, but channel '{name}' is in {spec['unit']}",
            file=side.file,
            field=f"cameras.{spec['camera']}.scale",
        )
    scale = unit_factor(spec["unit"]) if scale is None else float(scale)
    return Camera(camera["origin"], camera["axes"], scale=scale, zero=camera["zero"], flip=camera["flip"])


def _channel(name: str, spec: dict, series: Series, times: np.ndarray, camera: Camera | None, side: Sidecar) -> Channel:
    readings = spec["sign"] * (series.readings - spec["offset"])
    factor = camera.scale if camera is not None else unit_factor(spec["unit"])
    noise: float | None = spec["noise"]
    values = camera.metres(readings) if camera is not None else readings * factor
    if values.ndim == 2 and values.shape[1] == 3:
        values = _turned(values, spec["kind"], side)
    if spec["unwrap"]:
        seen = np.isfinite(values)
        values[seen] = np.unwrap(values[seen])
    report = noise_report(times, values)
    return Channel(
        name=name,
        kind=spec["kind"],
        values=values,
        unit="m" if spec["unit"] == "px" else si_unit(spec["unit"]),
        noise=report.level if noise is None else noise * factor,
        attachment=spec["attachment"],
        camera=camera,
        noise_report=report,
    )


def _turned(values: np.ndarray, kind: str, side: Sidecar) -> np.ndarray:
    """Vectors (n, 3) of the file's axes in the model's; points are counted from the model's origin."""
    if kind == "marker" and side.source["origin"] is not None:
        values = values - np.array(side.source["origin"])
    return values if side.source["axes"] is None else values @ side.source["axes"].T


def _drive(name: str, spec: dict, table: Table, times: np.ndarray, side: Sidecar) -> DriveChannel:
    factor, unit = unit_factor(spec["unit"]), si_unit(spec["unit"])
    own, constant = None, spec["value"] is not None
    if constant:
        values = np.asarray(spec["value"], dtype=float)
    elif spec["values"] is not None:
        own, values = np.array(spec["times"]), np.asarray(spec["values"], dtype=float)
    elif spec["file"] is not None:
        own, values = _other_file(name, spec, side)
    else:
        values = _whole(name, table, spec["columns"])
    if spec["direction"] is not None:
        if values.ndim > (0 if constant else 1):
            raise InputError(
                "only one number can be given a direction", file=side.file, field=f"drive.{name}.direction"
            )
        values = values[..., None] * np.array(spec["direction"])
    own = None if own is None else spanning(own, times)
    drive = DriveChannel(name=name, values=values * factor, unit=unit, constant=constant, times=own)
    try:
        drive.at(times)
    except InputError as error:
        raise InputError(
            f"the drive '{name}' does not cover the recording",
            file=side.file,
            field=error.field,
            value=error.value,
            allowed=error.allowed,
        ) from None
    return drive


def _other_file(name: str, spec: dict, side: Sidecar) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and values of a drive that stands in a table of its own."""
    path = side.file.parent / spec["file"]
    table = read_table(path, read_bytes(path), [spec["time_column"], *spec["columns"]], [])
    times = _whole(name, table, [spec["time_column"]]) * unit_factor(spec["time_unit"]) + spec["shift"]
    backwards = np.flatnonzero(np.diff(times) <= 0.0)
    if len(times) < 2 or backwards.size:
        place = f" at {table.position(int(backwards[0]) + 1)}" if backwards.size else ""
        raise InputError(f"the times of drive '{name}' do not increase{place}", file=path, field=spec["time_column"])
    return times, _whole(name, table, spec["columns"])


def _whole(name: str, table: Table, columns: list[str]) -> np.ndarray:
    """(n,) or (n, d) numbers without holes."""
    values = table.stack(columns)
    lost = np.flatnonzero(~np.isfinite(values.reshape(len(values), -1)).all(axis=1))
    if lost.size:
        place = table.position(int(lost[0]))
        raise InputError(f"drive '{name}' misses a value at {place}", file=table.file, field=name)
    return values

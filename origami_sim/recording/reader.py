"""Read a recording: a CSV or Parquet table with a TOML sidecar that says what the columns mean.

The sidecar lies next to the table as `<stem>.toml`, or is given; `origami_sim.recording.sidecar` documents its keys.
"""

import hashlib
from pathlib import Path

import numpy as np

from origami_sim.errors import InputError
from origami_sim.recording.lint import Series, lint
from origami_sim.recording.recording import Channel, DriveChannel, Recording, estimate_noise
from origami_sim.recording.sidecar import Sidecar
from origami_sim.recording.table import Table, read_bytes, read_table
from origami_sim.recording.units import si_unit, unit_factor


def read_recording(csv_path: str | Path, sidecar: str | Path | None = None) -> Recording:
    """Read a table and its sidecar, lint them and convert to SI.

    Args:
        csv_path: a .csv, .txt or .parquet file with one header row.
        sidecar: the TOML file; `<stem>.toml` next to the table when None.

    Returns:
        The recording; notes of the lint are in `metadata["notes"]`.

    Raises:
        InputError: the first fault found, in one sentence.
    """
    path = Path(csv_path)
    description = Path(sidecar) if sidecar is not None else path.with_suffix(".toml")
    data = read_bytes(path)
    if sidecar is None and not description.is_file():
        raise InputError(f"no sidecar '{description.name}' next to the recording", file=path, field="sidecar")
    side = Sidecar.read(description)
    table = read_table(path, data, side.columns, list(side.select))
    table = table.select(side.select)

    times = side.times(table)
    series = {
        name: Series(
            readings=table.stack(spec["columns"]),
            kind=spec["kind"],
            unit=spec["unit"],
            noise=spec["noise"],
            unwrap=spec["unwrap"],
        )
        for name, spec in side.channels.items()
    }
    notes = lint(times, series, file=path, position=table.position, allow_gaps=side.allow_gaps)
    side.check_rate(times)
    return Recording(
        name=side.name or path.stem,
        times=times,
        channels={name: _channel(name, spec, series[name], times) for name, spec in side.channels.items()},
        drive={name: _drive(name, spec, table) for name, spec in side.drive.items()},
        metadata={
            "file": str(path),
            "sidecar": str(description),
            "sha256": hashlib.sha256(data).hexdigest(),
            "time_base": side.time_base,
            "notes": notes,
            "scene": side.scene,
            **side.free_text,
        },
    )


def _channel(name: str, spec: dict, series: Series, times: np.ndarray) -> Channel:
    factor = unit_factor(spec["unit"])
    values = spec["sign"] * (series.readings - spec["offset"]) * factor
    if spec["unwrap"]:
        seen = np.isfinite(values)
        values[seen] = np.unwrap(values[seen])
    noise = spec["noise"] * factor if spec["noise"] is not None else estimate_noise(times, values)
    return Channel(
        name=name,
        kind=spec["kind"],
        values=values,
        unit=si_unit(spec["unit"]),
        noise=noise,
        attachment=spec["attachment"],
    )


def _drive(name: str, spec: dict, table: Table) -> DriveChannel:
    factor, unit = unit_factor(spec["unit"]), si_unit(spec["unit"])
    if spec["value"] is not None:
        return DriveChannel(name=name, values=np.asarray(spec["value"], dtype=float) * factor, unit=unit, constant=True)
    values = table.stack(spec["columns"])
    lost = np.flatnonzero(~np.isfinite(values.reshape(len(values), -1)).all(axis=1))
    if lost.size:
        place = table.position(int(lost[0]))
        raise InputError(f"drive '{name}' misses a value at {place}", file=table.file, field=name)
    return DriveChannel(name=name, values=values * factor, unit=unit, constant=False)

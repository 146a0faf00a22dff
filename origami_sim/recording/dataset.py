"""Several recordings of one object: the same channels under different drives."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.files import read_toml
from origami_sim.recording.reader import read_recording
from origami_sim.recording.recording import Recording

SUFFIXES = (".csv", ".txt", ".parquet", ".c3d")


@dataclass(frozen=True, eq=False)
class DataSet:
    """Recordings of one object that have the same channels.

    Attributes:
        name: name of the set.
        recordings: at least one, with different names.
        notes: what stood out when they were put together, e.g. replicates.

    Raises:
        InputError: names or files that stand twice; channels, kinds, units, attachments, scenes, overrides or priors
            that differ.
    """

    name: str
    recordings: tuple[Recording, ...]
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        if not self.recordings:
            raise InputError("a data set needs a recording", field="recordings")
        first, *others = self.recordings
        for other in others:
            _same(first, other)
        for key, what in (("name", lambda r: r.name), ("sha256", lambda r: r.metadata.get("sha256"))):
            seen: dict[str, Recording] = {}
            for recording in self.recordings:
                value = what(recording)
                if value is None:
                    continue
                if value in seen:
                    fault = (
                        f"two recordings have the name '{value}'"
                        if key == "name"
                        else f"the recordings '{seen[value].name}' and '{recording.name}' are the same file"
                    )
                    # one file may hold several selections
                    if key == "name" or _equal_values(seen[value], recording):
                        raise InputError(fault, file=recording.metadata.get("file"), field="recordings")
                seen[value] = recording
        for k, one in enumerate(self.recordings):
            for other in self.recordings[k + 1 :]:
                if one.drive and _equal_drives(one, other):
                    self.notes.append(f"Recordings '{one.name}' and '{other.name}' have the same drive: replicates.")

    def __iter__(self) -> Iterator[Recording]:
        return iter(self.recordings)

    def __len__(self) -> int:
        return len(self.recordings)

    def __getitem__(self, key: int | str) -> Recording:
        """A recording by its number or its name; InputError if there is none."""
        names = [recording.name for recording in self.recordings]
        if isinstance(key, str) and key in names:
            return self.recordings[names.index(key)]
        if isinstance(key, int) and -len(names) <= key < len(names):
            return self.recordings[key]
        raise InputError("no such recording", field="recordings", value=key, allowed=", ".join(names))

    @property
    def channels(self) -> list[str]:
        """Names of the channels that all recordings have."""
        return list(self.recordings[0].channels)


def read_dataset(
    source: str | Path | Sequence[str | Path], *, sidecar: str | Path | Sequence[str | Path] | None = None
) -> DataSet:
    """Read several recordings of one object.

    Args:
        source: a list of tables; or a folder, of which every table with a sidecar of its own is taken, in the order of
            their names; or a TOML file that lists them:

                name = "arch, all drives"
                sidecar = "arch.toml"              # for all that state none of their own
                [[recordings]]
                file = "step_5mT.csv"
                sidecar = "step_5mT.toml"
                name = "step"

            (or `recordings = ["a.csv", "b.csv"]`), paths from the folder of that file; or one table.
        sidecar: one sidecar for all tables; their names are then the files' stems. For a list of tables also a list.

    Raises:
        InputError: the first fault found in any of them, or where they do not fit together.
    """
    if not isinstance(source, (str, Path)):
        paths = [Path(one) for one in source]
        name = paths[0].parent.name if paths else "recordings"
        if sidecar is None or isinstance(sidecar, (str, Path)):
            found = [_read(path, sidecar, None, sidecar is not None) for path in paths]
        else:
            found = [_read(path, own, None, False) for path, own in zip(paths, sidecar, strict=True)]
        return DataSet(name or "recordings", tuple(found))
    if not (sidecar is None or isinstance(sidecar, (str, Path))):
        raise InputError("one sidecar each is for a list of tables", field="sidecar", value=len(sidecar))
    path = Path(source)
    if path.is_dir():
        tables = sorted(p for p in path.iterdir() if p.suffix.lower() in SUFFIXES)
        tables = [p for p in tables if sidecar is not None or p.with_suffix(".toml").is_file()]
        if not tables:
            raise InputError(
                "the folder holds no table with a sidecar", file=path, allowed=f"{', '.join(SUFFIXES)} beside a .toml"
            )
        return DataSet(path.resolve().name, tuple(_read(p, sidecar, None, sidecar is not None) for p in tables))
    if path.suffix.lower() != ".toml":
        return DataSet(path.stem, (_read(path, sidecar, None, False),))
    return _listing(path)


def _listing(path: Path) -> DataSet:
    tree = read_toml(path)
    _check_keys(path, "", tree, ("name", "sidecar", "recordings"))
    entries = tree.get("recordings")
    if not isinstance(entries, list) or not entries:
        raise InputError("must list recordings", file=path, field="recordings", value=entries)
    shared, found = tree.get("sidecar"), []
    for k, entry in enumerate(entries):
        one = {"file": entry} if isinstance(entry, str) else entry
        prefix = f"recordings[{k}]."
        if not isinstance(one, dict):
            raise InputError("must be a file or a table", file=path, field=prefix.rstrip("."), value=entry)
        _check_keys(path, prefix, one, ("file", "sidecar", "name"))
        if "file" not in one:
            raise InputError("'file' is missing", file=path, field=prefix + "file")
        beside = one.get("sidecar", shared)
        found.append(
            _read(
                path.parent / one["file"],
                None if beside is None else path.parent / beside,
                one.get("name"),
                "sidecar" not in one and shared is not None,
            )
        )
    return DataSet(tree.get("name", path.stem), tuple(found))


def _check_keys(path: Path, prefix: str, table: dict, allowed: tuple[str, ...]):
    for key, value in table.items():
        if key not in allowed:
            raise InputError(f"unknown key '{key}'", file=path, field=prefix + key, allowed=", ".join(allowed))
        if key != "recordings" and not (isinstance(value, str) and value):
            raise InputError("must be a text", file=path, field=prefix + key, value=value)


def _read(path: Path, sidecar: str | Path | None, name: str | None, by_stem: bool) -> Recording:
    recording = read_recording(path, sidecar)
    return replace(recording, name=name or path.stem) if name or by_stem else recording


def _same(first: Recording, other: Recording):
    """Raises InputError where two recordings cannot be of the same object."""
    file = other.metadata.get("file")
    if set(first.channels) != set(other.channels):
        raise InputError(
            f"the recordings '{first.name}' and '{other.name}' have different channels",
            file=file,
            field="channels",
            value=sorted(other.channels),
            allowed=", ".join(sorted(first.channels)),
        )
    for name, channel in first.channels.items():
        twin = other.channels[name]
        shape = channel.values.shape[1:], twin.values.shape[1:]
        for what, mine, theirs in (
            ("kind", channel.kind, twin.kind),
            ("unit", channel.unit, twin.unit),
            ("attachment", channel.attachment, twin.attachment),
            ("number of components", *shape),
        ):
            if mine != theirs:
                raise InputError(
                    f"channel '{name}' has another {what} in '{other.name}' than in '{first.name}'",
                    file=file,
                    field=f"channels.{name}",
                    value=theirs,
                    allowed=str(mine),
                )
    if first.by_step != other.by_step:
        raise InputError(f"'{first.name}' and '{other.name}' mix load steps and times", file=file, field="time")
    scenes = [r.metadata.get("scene") or {} for r in (first, other)]
    if scenes[0].get("name") != scenes[1].get("name"):
        raise InputError(
            f"'{first.name}' and '{other.name}' name different scenes",
            file=file,
            field="scene.name",
            value=scenes[1].get("name"),
            allowed=str(scenes[0].get("name")),
        )
    for what, mine, theirs in (
        ("scene.overrides", *(s.get("overrides") or {} for s in scenes)),
        ("priors", *(r.metadata.get("priors") or {} for r in (first, other))),
    ):
        if mine != theirs:
            raise InputError(
                f"'{first.name}' ({first.metadata.get('sidecar')}) and '{other.name}' are of one object but state "
                f"different {what.rpartition('.')[2]}",
                file=other.metadata.get("sidecar"),
                field=what,
                value=theirs,
                allowed=str(mine),
            )
    for name in first.drive.keys() & other.drive.keys():
        if first.drive[name].unit != other.drive[name].unit:
            raise InputError(
                f"drive '{name}' has another unit in '{other.name}' than in '{first.name}'",
                file=file,
                field=f"drive.{name}.unit",
                value=other.drive[name].unit,
                allowed=first.drive[name].unit,
            )


def _equal_values(one: Recording, other: Recording) -> bool:
    return all(
        np.array_equal(channel.values, other.channels[name].values, equal_nan=True)
        for name, channel in one.channels.items()
    )


def _equal_drives(one: Recording, other: Recording) -> bool:
    same = (one.gravity, one.start) == (other.gravity, other.start) and one.drive.keys() == other.drive.keys()
    around = [Drive(sources=r.sources) for r in (one, other)]
    same &= around[0].fingerprint == around[1].fingerprint
    same &= all(map(np.array_equal, *((*d.slots().values(), *d.samples()) for d in around)))
    return same and all(
        d.constant == other.drive[k].constant and np.array_equal(d.values, other.drive[k].values)
        for k, d in one.drive.items()
    )

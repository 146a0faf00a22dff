"""Several recordings of one object: read from a list, a folder or a listing, and checked against each other."""

import numpy as np
import pytest

from origami_sim.errors import InputError
from origami_sim.recording import applied_drive, read_dataset, read_recording

SIDECAR = """
[time]
column = "t"
[channels.tip]
column = "z"
kind = "tip_displacement"
unit = "mm"
node = 3
[drive.field]
column = "b"
unit = "mT"
direction = [0.0, 0.0, 1.0]
[scene]
name = "arch"
"""


@pytest.fixture
def folder(tmp_path):
    """Two recordings with fields of 5 and 10 mT."""
    for name, field in (("weak", 5.0), ("strong", 10.0)):
        rows = "".join(f"{k / 100:.2f},{field * np.sin(k / 7.0):.6f},{field}\n" for k in range(60))
        (tmp_path / f"{name}.csv").write_text("t,z,b\n" + rows)
        (tmp_path / f"{name}.toml").write_text(SIDECAR)
    return tmp_path


def listing(folder, text: str):
    (folder / "all").mkdir()
    (folder / "all" / "arch.toml").write_text(text)
    return folder / "all" / "arch.toml"


@pytest.mark.parametrize("how", ["list", "folder", "listing", "tables"])
def test_the_same_set_from_everywhere(folder, how):
    if how == "list":
        data = read_dataset([folder / "strong.csv", folder / "weak.csv"])
    elif how == "folder":
        data = read_dataset(folder)
    elif how == "listing":
        data = read_dataset(listing(folder, 'name = "arch"\nrecordings = ["../strong.csv", "../weak.csv"]\n'))
        assert data.name == "arch"
    else:
        text = '[[recordings]]\nfile = "../strong.csv"\nsidecar = "../weak.toml"\nname = "strong"\n'
        text += '[[recordings]]\nfile = "../weak.csv"\n'
        data = read_dataset(listing(folder, text))
    assert len(data) == 2 and data.channels == ["tip"] and data.notes == []
    assert [r.name for r in data] == ["strong", "weak"]
    np.testing.assert_allclose(data["weak"].drive["field"].values[0], [0.0, 0.0, 5e-3])
    assert data[0].drive["field"].values[0, 2] == pytest.approx(10e-3)
    with pytest.raises(InputError, match=r"no such recording .*'middle'.*allowed: strong, weak"):
        data["middle"]


def test_one_sidecar_for_all(folder):
    data = read_dataset([folder / "strong.csv", folder / "weak.csv"], sidecar=folder / "weak.toml")
    assert [r.name for r in data] == ["strong", "weak"]
    with pytest.raises(InputError, match="two recordings have the name 'weak'"):
        read_dataset([folder / "weak.csv", folder / "weak.csv"])


def test_replicates_are_told_and_copies_refused(folder):
    text = (folder / "weak.csv").read_text()
    (folder / "again.toml").write_text(SIDECAR)
    (folder / "again.csv").write_text(text.replace("0.05,", "0.0500,"))
    data = read_dataset([folder / "weak.csv", folder / "again.csv"])
    assert data.notes == ["Recordings 'weak' and 'again' have the same drive: replicates."]
    (folder / "again.csv").write_text(text)
    with pytest.raises(InputError, match="the recordings 'weak' and 'again' are the same file"):
        read_dataset([folder / "weak.csv", folder / "again.csv"])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: s.replace("channels.tip", "channels.end"), "'strong' and 'weak' have different channels .*end.*tip"),
        (
            lambda s: s.replace('"mm"\nnode', '"mm"\nnoise = 0.1\nnode').replace("node = 3", "node = 4"),
            "another attachment",
        ),
        (lambda s: s.replace("tip_displacement", "force").replace('"mm"', '"N"'), "another kind"),
        (
            lambda s: s.replace('"mT"', '"kV"').replace("direction = [0.0, 0.0, 1.0]\n", ""),
            "unknown unit of flux density .*'kV'",
        ),
        (lambda s: s.replace('"arch"', '"box"'), "name different scenes"),
        (lambda s: s.replace('[time]\ncolumn = "t"\n', ""), "mix load steps and times"),
        (lambda s: s + "overrides = { gap = 1e-3 }\n", r"weak\.toml: .*strong\.toml.* different overrides .*gap.*: {}"),
        (lambda s: s + '[priors]\ngap = "5 %"\n', r"weak\.toml: .*strong\.toml.* different priors .*5 %.*: {}"),
    ],
)
def test_recordings_of_different_objects_are_refused(folder, change, words):
    (folder / "weak.toml").write_text(change(SIDECAR))
    with pytest.raises(InputError, match=words):
        read_dataset([folder / "strong.csv", folder / "weak.csv"])


def test_a_drive_that_only_the_scene_knows_has_one_unit(folder):
    supply = SIDECAR.replace("[drive.field]", "[drive.supply]").replace("direction = [0.0, 0.0, 1.0]\n", "")
    for name, unit in (("strong", '"mA"'), ("weak", '"V"')):
        (folder / f"{name}.toml").write_text(supply.replace('"mT"', unit))
    with pytest.raises(InputError, match="drive 'supply' has another unit"):
        read_dataset([folder / "strong.csv", folder / "weak.csv"])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a = = 1", "is no valid TOML"),
        ("", "must list recordings"),
        ("recordings = [3]", "must be a file or a table"),
        ('recordings = ["a.csv"]\ncolour = "red"', "unknown key 'colour'"),
        ("[[recordings]]\nname = 'a'", r"'file' is missing \(field 'recordings\[0\]\.file'"),
        ('recordings = ["absent.csv"]', "absent.csv: cannot be read"),
    ],
)
def test_faulty_listings(folder, text, words):
    with pytest.raises(InputError, match=words):
        read_dataset(listing(folder, text))
    with pytest.raises(InputError, match="the folder holds no table with a sidecar"):
        read_dataset(folder / "all")


def test_the_drive_of_a_recording_drives_a_simulation(folder):
    (folder / "weak.toml").write_text(SIDECAR + '[drive.voltage_1]\nvalue = 2.0\nunit = "kV"\n')
    (folder / "weak.csv").write_text("t,z,b\n" + "".join(f"{5 + k / 100},{np.sin(k)},{k}\n" for k in range(60)))
    recording = read_recording(folder / "weak.csv")
    drive = applied_drive(recording)
    np.testing.assert_allclose(drive["field_z"](np.array([0.0, 0.105, 0.59, 0.7])), [0.0, 10.5e-3, 59e-3, 59e-3])
    assert float(drive["voltage_1"](3.0)) == 2000.0 and float(drive["voltage_0"](3.0)) == 0.0
    held = applied_drive(recording, step=7)
    np.testing.assert_allclose(held.field(123.0), [0.0, 0.0, 7e-3])
    with pytest.raises(InputError, match=r"no such step .*60.*allowed: 0 to 59"):
        applied_drive(recording, step=60)
    (folder / "weak.toml").write_text(SIDECAR.replace("direction = [0.0, 0.0, 1.0]\n", ""))
    with pytest.raises(InputError, match=r"wrong number of components .*drive.field"):
        applied_drive(read_recording(folder / "weak.csv"))

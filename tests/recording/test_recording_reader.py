"""The reader against known answers, every fault with its sentence, and mutated text."""

import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pa_parquet
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from origami_sim.errors import InputError
from origami_sim.recording import Recording, read_recording

SCENES = Path(__file__).resolve().parents[2] / "scenes"


SIDECAR = """
[time]
column = "t"
unit = "s"
[channels.theta]
column = "a"
kind = "panel_angle"
unit = "rad"
panel = "arm"
"""


@pytest.fixture
def write(tmp_path):
    """Write a table and its sidecar side by side; returns the path of the table."""

    def write_both(table: str | bytes, sidecar: str = SIDECAR) -> Path:
        path = tmp_path / "run.csv"
        path.write_bytes(table.encode() if isinstance(table, str) else table)
        (tmp_path / "run.toml").write_text(sidecar, encoding="utf-8")
        return path

    return write_both


@pytest.fixture
def swing() -> str:
    """A CSV of 50 frames at 100 Hz: time, a swing within 1.5 rad of zero, and its double."""
    times = np.arange(50) / 100.0
    rows = [f"{t:.2f},{1.5 * np.cos(20.0 * t):.9f},{3.0 * np.cos(20.0 * t):.9f}" for t in times]
    return "\n".join(["t,a,b", *rows]) + "\n"


@pytest.mark.parametrize("above", ["# rig B, run 12\n# encoder\n", "Instrument;PS2000\n\nt [ms],other\n", "# "])
@pytest.mark.parametrize("separator", [",", ";", "\t", "decimal commas"])
def test_tables_as_laboratories_write_them(write, swing, above, separator):
    """Notes above the header (or the '#' of numpy.savetxt), and the separators that a spreadsheet exports."""
    plain = read_recording(write(swing))
    text = swing.replace(",", separator) if len(separator) == 1 else swing.replace(",", ";").replace(".", ",")
    found = read_recording(write(above + text))
    assert np.array_equal(found.times, plain.times)
    assert np.array_equal(found.channels["theta"].values, plain.channels["theta"].values)
    with pytest.raises(InputError, match=f"line {above.count(chr(10)) + 2} holds no number"):
        read_recording(write(above + text.replace("\n", "\nbad", 1)))


def test_a_header_with_a_degree_sign_of_windows(write, swing):
    sidecar = SIDECAR.replace('column = "a"', 'column = "a [°]"')
    for encoding in ("utf-8", "utf-8-sig", "cp1252"):
        found = read_recording(write(swing.replace("t,a", "t,a [°]", 1).encode(encoding), sidecar))
        assert found.channels["theta"].values[0] == 1.5


def test_rounded_time_stamps_are_read_as_an_even_grid(write):
    times = np.arange(200) / 150.0
    path = write("t,a\n" + "".join(f"{t:.6g},{np.sin(t):.9g}\n" for t in times))
    assert np.ptp(np.diff(read_recording(path).times)) < 1e-12
    assert np.abs(read_recording(path).times - times).max() < 1e-7


def test_values_arrive_in_si_with_sign_offset_and_attachment(write):
    sidecar = """
name = "turn"
licence = "MIT"
[time]
column = "t"
unit = "ms"
rate_hz = 100
[channels.fold]
column = "angle"
kind = "crease_angle"
unit = "deg"
noise = 0.9
sign = -1
offset = 180
crease = 3
[channels.tag]
columns = ["x", "y", "z"]
kind = "marker"
unit = "mm"
noise = 0.1
panel = "lid"
point = [0.0, 0.0, 0.01]
[drive.field]
column = "b"
unit = "mT"
[drive.gravity]
value = [0.0, 0.0, -1.0]
unit = "g0"
[scene]
name = "box"
overrides = { thickness = 1e-3 }
"""
    table = "t,angle,x,y,z,b\n0,180,1,2,3,5\n10,90,2,4,6,6\n20,0,3,6,9,7\n30,-90,4,8,12,8\n"
    recording = read_recording(write(table, sidecar))
    assert recording.name == "turn"
    np.testing.assert_allclose(recording.times, [0.0, 0.01, 0.02, 0.03])
    fold, tag = recording.channels["fold"], recording.channels["tag"]
    np.testing.assert_allclose(fold.values, np.deg2rad([0.0, 90.0, 180.0, 270.0]))
    assert (fold.unit, fold.kind, fold.attachment) == ("rad", "crease_angle", {"crease": 3})
    assert fold.noise == pytest.approx(np.deg2rad(0.9))
    np.testing.assert_allclose(tag.values[1], [2e-3, 4e-3, 6e-3])
    assert tag.attachment == {"panel": "lid", "point": [0.0, 0.0, 0.01]}
    np.testing.assert_allclose(recording.drive["field"].values, [5e-3, 6e-3, 7e-3, 8e-3])
    np.testing.assert_allclose(recording.drive["gravity"].values, [0.0, 0.0, -9.80665])
    assert recording.drive["gravity"].constant and not recording.drive["field"].constant
    assert recording.metadata["scene"] == {"name": "box", "stated": "box", "overrides": {"thickness": 1e-3}}
    assert recording.metadata["licence"] == "MIT"


def test_window_keeps_both_ends_and_slices_the_drive(write, swing):
    sidecar = SIDECAR + '[drive.field]\ncolumn = "b"\nunit = "mT"\n[drive.volt]\nvalue = 2.0\nunit = "kV"\n'
    part = read_recording(write(swing, sidecar)).window(0.1, 0.2)
    np.testing.assert_allclose(part.times, np.arange(10, 21) / 100.0)
    assert len(part.channels["theta"].values) == len(part.drive["field"].values) == part.frame_count == 11
    assert part.drive["volt"].values == 2000.0
    with pytest.raises(InputError, match=r"no frame between 7 s and 8 s .*allowed: 0.1 s to 0.2 s"):
        part.window(7.0, 8.0)


@pytest.mark.parametrize("change", ["\r\n", "\r", "bom", "blank lines", "spaces", "quotes", "plus"])
def test_spellings_of_the_same_table_agree(write, swing, change):
    expected = read_recording(write(swing)).channels["theta"].values
    changed = {
        "\r\n": swing.replace("\n", "\r\n"),
        "\r": swing.replace("\n", "\r"),
        "bom": "\ufeff" + swing,
        "blank lines": "\n\n" + swing.replace("0.10,", "\n0.10,"),
        "spaces": swing.replace(",", ", "),
        "quotes": re.sub(r"([^,\n]+),", r'"\1",', swing),
        "plus": swing.replace("0.10,", "+0.10,"),
    }[change]
    np.testing.assert_array_equal(read_recording(write(changed)).channels["theta"].values, expected)


def test_parquet_reads_like_csv_and_selects_rows(tmp_path):
    times = np.tile(np.arange(20) / 100.0, 2)
    angles = np.concatenate([np.sin(times[:20] * 9.0), np.cos(times[:20] * 9.0)])
    toss = np.repeat([1, 2], 20)
    pa_parquet.write_table(pa.table({"t": times, "a": angles, "toss": toss}), tmp_path / "run.parquet")
    rows = "".join(f"{t!r},{a!r},toss {k}\n" for t, a, k in zip(times.tolist(), angles.tolist(), toss, strict=True))
    (tmp_path / "run.csv").write_text("t,a,toss\n" + rows)
    (tmp_path / "run.toml").write_text("[select]\ntoss = 2\n" + SIDECAR)
    (tmp_path / "text.toml").write_text('[select]\ntoss = "toss 2"\n' + SIDECAR)
    from_parquet = read_recording(tmp_path / "run.parquet")
    from_csv = read_recording(tmp_path / "run.csv", tmp_path / "text.toml")
    np.testing.assert_array_equal(from_parquet.channels["theta"].values, angles[20:])
    np.testing.assert_array_equal(from_csv.channels["theta"].values, angles[20:])
    with pytest.raises(
        InputError, match=r"no row has the selected value .*'select.toss', value 2\.0\).*'toss 1', 'toss 2'"
    ):
        read_recording(tmp_path / "run.csv")


def test_without_a_time_column_rows_are_frames_or_load_steps(write, swing):
    frames = read_recording(write(swing, SIDECAR.replace('column = "t"\nunit = "s"', "rate_hz = 50")))
    np.testing.assert_allclose(frames.times[:3], [0.0, 0.02, 0.04])
    steps = read_recording(write(swing, SIDECAR[SIDECAR.index("[channels") :]))
    np.testing.assert_array_equal(steps.times[:3], [0.0, 1.0, 2.0])
    assert (frames.metadata["time_base"], steps.metadata["time_base"]) == ("rate", "step")


def test_unwrap_removes_whole_turns(write):
    times = np.arange(200) / 100.0
    wrapped = np.angle(np.exp(4j * times))
    table = "t,a\n" + "".join(f"{t},{a}\n" for t, a in zip(times, wrapped, strict=True))
    jumping = read_recording(write(table))
    assert "jumps by more than half a turn at t = 0.79 s: unwrap = true?" in " ".join(jumping.metadata["notes"])
    smooth = read_recording(write(table, SIDECAR + "unwrap = true\n"))
    np.testing.assert_allclose(smooth.channels["theta"].values, 4.0 * times, atol=1e-12)
    assert smooth.metadata["notes"] == []


def test_gaps_are_notes_when_allowed(write, swing):
    lines = swing.splitlines()
    holed = "\n".join([lines[0], *lines[1:11], *lines[13:]]).replace("0.30,", "0.30,,")
    holed = re.sub(r"(0\.30,),[^,]*", r"\1", holed)
    recording = read_recording(write(holed, "allow_gaps = true\n" + SIDECAR))
    notes = " ".join(recording.metadata["notes"])
    assert "1 time gap longer than 1.5 median steps of 0.01 s, first after t = 0.09 s (0.03 s long)" in notes
    assert "'theta' misses 1 values in 1 run between others, first at t = 0.3 s" in notes
    assert np.count_nonzero(np.isnan(recording.channels["theta"].values)) == 1


def test_values_missing_at_the_ends_are_notes(write, swing):
    ragged = re.sub(r"0\.(00|49),[^,]*", r"0.\1,", swing)
    notes = read_recording(write(ragged)).metadata["notes"]
    assert notes == [
        "Channel 'theta' starts only at t = 0.01 s.",
        "Channel 'theta' ends already at t = 0.48 s.",
    ]


def test_degrees_that_look_like_radians_are_noted(write, swing):
    notes = read_recording(write(swing, SIDECAR.replace('"rad"', '"deg"'))).metadata["notes"]
    assert notes == ["Channel 'theta' is stated in deg but stays within 2 pi: this looks like radians."]


def test_a_constant_channel_needs_a_stated_noise(write, swing):
    still = re.sub(r"(\n[^,]+),[^,]*,", r"\1,0.5,", swing)
    recording = read_recording(write(still, SIDECAR + "noise = 0.001\n"))
    assert recording.metadata["notes"] == ["Channel 'theta' is constant."]
    with pytest.raises(InputError, match="channel 'theta' is constant, so that its noise cannot be estimated"):
        read_recording(write(still))


def cut(swing: str, line: int, text: str) -> str:
    """The table with one line (counted from 1) replaced."""
    lines = swing.splitlines()
    lines[line - 1] = text
    return "\n".join(lines) + "\n"


TABLE_FAULTS = {
    "empty": (lambda s: "", "the file is empty"),
    "header only": (lambda s: "t,a,b\n", "the recording has 0 frames, at least 3 are needed"),
    "two frames": (lambda s: "\n".join(s.splitlines()[:3]), "the recording has 2 frames, at least 3 are needed"),
    "missing column": (lambda s: s.replace("t,a,b", "t,q,b"), r"column 'a' is missing .*allowed: t, q, b"),
    "double column": (lambda s: s.replace("t,a,b", "t,a,a"), "column 'a' appears more than once"),
    "no number": (lambda s: cut(s, 7, "0.05,oops,1"), r"line 7 holds no number \(field 'a', value 'oops'\)"),
    "underscore": (lambda s: cut(s, 7, "0.05,1_0,1"), r"line 7 holds no number \(field 'a', value '1_0'\)"),
    "short row": (lambda s: cut(s, 9, "0.07,1.0"), "line 9 has 2 cells but the header has 3"),
    "infinite": (lambda s: cut(s, 9, "0.07,inf,1"), r"the number at line 9 is no measurement \(field 'a', value inf\)"),
    "huge": (lambda s: cut(s, 9, "0.07,1e200,1"), "the number at line 9 is no measurement"),
    "no time": (lambda s: cut(s, 9, ",1.0,1"), "the time is missing at line 9"),
    "same time": (lambda s: cut(s, 9, "0.06,1.0,1"), "the time is repeated at line 9 .*value 0.06"),
    "backwards": (lambda s: cut(s, 9, "0.05,1.0,1"), "the time runs backwards from 0.06 s at line 9"),
    "blank lines count": (lambda s: "\n" + cut(s, 9, "0.05,1.0,1"), "the time runs backwards from 0.06 s at line 10"),
    "time gap": (
        lambda s: cut(s, 9, "").replace("\n\n", "\n"),
        r"1 time gap longer than 1.5 median steps of 0.01 s, first after t = 0.06 s \(0.02 s long\)",
    ),
    "hole": (
        lambda s: cut(cut(s, 9, "0.07,nan,1"), 10, "0.08,,1"),
        "'theta' misses 2 values in 1 run between others, first at t = 0.07 s .*allow_gaps = true",
    ),
    "all missing": (lambda s: re.sub(r"(\n[^,]+),[^,]*,", r"\1,,", s), "'theta' has 0 values, at least 3 are needed"),
    "degrees as rad": (
        lambda s: cut(s, 9, "0.07,178.0,1"),
        "is stated in rad but reaches 178, which looks like degrees",
    ),
    "not text": (lambda s: s.encode() + b"\xff\xfe,1,2\n", "line 52 (is not UTF-8|holds no number)"),
    "binary": (
        lambda s: bytes(range(256)) * 4,
        "is no text, .*allowed: table, motive, deeplabcut, sleap, c3d, tracker",
    ),
    "header not text": (lambda s: b"\xff\xfe" + s.encode(), "the header in line 1 is not UTF-8 text"),
}


@pytest.mark.parametrize("name", TABLE_FAULTS)
def test_a_faulty_table_is_refused_in_one_sentence(write, swing, name):
    change, sentence = TABLE_FAULTS[name]
    with pytest.raises(InputError, match=sentence) as caught:
        read_recording(write(change(swing)))
    assert "run.csv" in str(caught.value) and "\n" not in str(caught.value)


CHANNEL = SIDECAR[SIDECAR.index("[channels") :]
SIDECAR_FAULTS = {
    "no toml": (lambda s: "a = = 1", "is no valid TOML"),
    "no channels": (lambda s: "", "no channel is described"),
    "unknown key": (lambda s: "colour = 1\n" + s, "unknown key 'colour' .*allowed: name, description"),
    "unknown channel key": (
        lambda s: s + "units = 1\n",
        r"unknown key 'units' \(field 'channels.theta.units'\); .*unit",
    ),
    "unknown time key": (lambda s: s.replace("[time]", "[time]\nclock = 1"), "unknown key 'clock' .*rate_hz"),
    "unknown scene key": (lambda s: s + "[scene]\nfile = 1\n", "unknown key 'file' .*allowed: name, overrides"),
    "unknown drive key": (lambda s: s + "[drive.b]\nrow = 1\n", "unknown key 'row' .*column, columns, value, unit"),
    "unknown unit": (
        lambda s: s.replace('"rad"', '"grad"'),
        r"unknown unit of angle \(field 'channels.theta.unit', value 'grad'\); allowed: rad, mrad, deg, rev",
    ),
    "wrong dimension": (lambda s: s.replace('"rad"', '"mm"'), "unknown unit of angle"),
    "no unit": (lambda s: s.replace('unit = "rad"\n', ""), "unknown unit of angle"),
    "unknown time unit": (lambda s: s.replace('"s"', '"fortnight"'), "unknown unit of time .*allowed: s, ms, us, min"),
    "unknown drive unit": (lambda s: s + '[drive.b]\nvalue = 1\nunit = "Oe"\n', "unknown unit .*'Oe'.*mT"),
    "unknown kind": (lambda s: s.replace("panel_angle", "angle"), "unknown kind .*allowed: panel_angle, crease_angle"),
    "no kind": (lambda s: s.replace('kind = "panel_angle"\n', ""), "'kind' is missing"),
    "columns of a scalar": (
        lambda s: s.replace('column = "a"', 'columns = ["a", "b"]'),
        r"a channel of kind 'panel_angle' cannot have 2 columns .*allowed: 1",
    ),
    "no column": (lambda s: s.replace('column = "a"\n', ""), "give either 'column' or 'columns'"),
    "both": (lambda s: s + 'columns = ["a"]\n', "give either 'column' or 'columns'"),
    "column number": (lambda s: s.replace('column = "a"', "column = 3"), "must name columns"),
    "column twice": (
        lambda s: s.replace('column = "a"', 'columns = ["a", "a"]'),
        "must not name a column twice",
    ),
    "time without column": (lambda s: s.replace('column = "t"\n', ""), "the time needs a column or a rate_hz"),
    "negative rate": (lambda s: s.replace("[time]", "[time]\nrate_hz = -1"), "the rate must be positive"),
    "wrong rate": (
        lambda s: s.replace("[time]", "[time]\nrate_hz = 1000"),
        "the stated rate is not that of the time column, 100 Hz .*value 1000",
    ),
    "negative noise": (lambda s: s + "noise = -1.0\n", "the noise must be positive"),
    "noise text": (lambda s: s + 'noise = "low"\n', "a text with a unit .*'low'"),
    "noise nan": (lambda s: s + "noise = nan\n", "must be a finite number"),
    "sign": (lambda s: s + "sign = 2\n", "unknown sign .*allowed: 1, -1"),
    "unwrap number": (lambda s: s + "unwrap = 1\n", "must be true or false"),
    "unwrap length": (
        lambda s: s.replace("panel_angle", "force").replace('"rad"', '"N"') + "unwrap = true\n",
        "only an angle can be unwrapped",
    ),
    "two attachments": (lambda s: s + "node = 3\n", r"observes one thing only .*\['panel', 'node'\]"),
    "attachment list": (lambda s: s.replace('"arm"', "[1]"), "must be a name or a number"),
    "point": (lambda s: s + "point = [0.0]\n", "must be three coordinates in metres"),
    "drive both": (lambda s: s + '[drive.b]\ncolumn = "b"\nvalue = 1.0\nunit = "T"\n', "columns or a value, not both"),
    "drive text": (lambda s: s + '[drive.b]\nvalue = "x"\nunit = "T"\n', "must be a finite number .*'x'"),
    "drive nested": (lambda s: s + '[drive.b]\nvalue = [[1.0]]\nunit = "T"\n', "must be a finite number"),
    "channel no table": (lambda s: "[channels]\ntheta = 1\n", "must be a table"),
    "drive no table": (lambda s: "drive = 1\n" + s, "must be a table .*'drive'"),
    "drive empty": (lambda s: s + '[drive.voltage]\nvalue = []\nunit = "V"\n', "must not be empty"),
    "samples empty": (
        lambda s: s + '[drive.voltage]\ntimes = [0, 1]\nvalues = [[], []]\nunit = "V"\n',
        "must not be empty",
    ),
    "name empty": (lambda s: 'name = ""\n' + s, "must be a text"),
    "name of two lines": (lambda s: 'name = "a\\nb"\n' + s, r"no control characters .*'name', value 'a\\nb'"),
    "channel of two lines": (lambda s: s.replace("theta", '"a\\u0000"'), "no control characters .*'channels'"),
}


@pytest.mark.parametrize("name", SIDECAR_FAULTS)
def test_a_faulty_sidecar_is_refused_in_one_sentence(write, swing, name):
    change, sentence = SIDECAR_FAULTS[name]
    with pytest.raises(InputError, match=sentence) as caught:
        read_recording(write(swing, change(SIDECAR)))
    assert "run.toml" in str(caught.value)


def test_a_drive_with_a_hole_is_refused(write, swing):
    sidecar = SIDECAR + '[drive.field]\ncolumn = "b"\nunit = "mT"\n'
    with pytest.raises(InputError, match="drive 'field' misses a value at line 9"):
        read_recording(write(cut(swing, 9, "0.07,1.0,"), sidecar))


def test_files_that_cannot_be_read_are_named(tmp_path, write, swing):
    path = write(swing)
    with pytest.raises(InputError, match=r"absent\.csv: cannot be read: No such file"):
        read_recording(tmp_path / "absent.csv")
    with pytest.raises(InputError, match="cannot be read"):
        read_recording("null\0byte.csv")
    with pytest.raises(InputError, match=r"absent\.toml: cannot be read"):
        read_recording(path, tmp_path / "absent.toml")
    (tmp_path / "bare.csv").write_text(swing)
    with pytest.raises(InputError, match=r"no sidecar 'bare\.toml' next to the recording"):
        read_recording(tmp_path / "bare.csv")
    (tmp_path / "bare.xlsx").write_text(swing)
    with pytest.raises(InputError, match=r"unknown kind of file .*allowed: \.csv, \.txt, \.parquet"):
        read_recording(tmp_path / "bare.xlsx", path.with_suffix(".toml"))
    (tmp_path / "bare.parquet").write_text(swing)
    with pytest.raises(InputError, match="is no readable Parquet file"):
        read_recording(tmp_path / "bare.parquet", path.with_suffix(".toml"))
    pa_parquet.write_table(pa.table({"t": ["0", "1", "2"], "a": [1.0, 2.0, 3.0]}), tmp_path / "text.parquet")
    with pytest.raises(InputError, match=r"the column is not numeric \(field 't', value 'string'\)"):
        read_recording(tmp_path / "text.parquet", path.with_suffix(".toml"))


JUNK = st.sampled_from(
    [",", "\n", "\r", '"', "nan", "inf", "-", "1e99", "1e308", "0", "\0", "é", " ", "t", "x", "_", "#"]
)


@settings(max_examples=250, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data(), in_sidecar=st.booleans(), gaps=st.booleans())
def test_mutated_text_gives_a_recording_or_an_input_error(write, swing, data, in_sidecar, gaps):
    table = "\n".join(swing.splitlines()[:15])
    sidecar = ("allow_gaps = true\n" if gaps else "") + SIDECAR
    text = sidecar if in_sidecar else table
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(text)))
        stop = data.draw(st.integers(start, min(start + 25, len(text))))
        text = text[:start] + data.draw(JUNK | st.text(max_size=4)) + text[stop:]
    damaged = text.encode("utf-8", errors="surrogatepass")
    path = write(table, sidecar)
    (path.with_suffix(".toml") if in_sidecar else path).write_bytes(damaged)
    try:
        recording = read_recording(path)
    except InputError:
        return
    assert isinstance(recording, Recording)
    assert all(np.isfinite(c.noise) and c.noise > 0.0 for c in recording.channels.values())
    assert (np.diff(recording.times) > 0.0).all()


def test_eighty_thousand_rows_load(write):
    times = np.arange(80_000) / 1000.0
    angles = np.random.default_rng(0).normal(scale=1e-4, size=times.size) + np.cos(6.0 * times)
    path = write("t,a\n" + "".join(f"{t:.3f},{a:.7f}\n" for t, a in zip(times, angles, strict=True)))
    recording = read_recording(path)
    assert recording.frame_count == 80_000


@pytest.mark.parametrize(("table", "frames"), [("double", 80_001), ("single_a", 55_001), ("single_b", 23_176)])
def test_the_real_pendulum_recordings_read(pendulum_recordings, table, frames):
    sidecar = SCENES / f"pendulum_chain_{table.split('_')[0]}.toml"
    recording = read_recording(pendulum_recordings / f"{table}.csv", sidecar)
    assert recording.frame_count == frames
    assert recording.metadata["scene"]["name"] == "pendulum_chain"
    assert not recording.drive
    for channel in recording.channels.values():
        assert channel.kind == "panel_angle" and channel.unit == "rad"
        assert 1e-5 < channel.noise < 1e-4
    if table == "single_b":  # raw encoder counts at rest: the quantisation of the stated 1.57e-4 rad is all there is
        assert recording.channels["theta1"].noise == pytest.approx(1.57e-4 / np.sqrt(12.0), rel=0.01)


def test_rows_of_one_time_are_averaged_where_that_is_allowed(write):
    rows = ["0,1.0", "1,2.0", "2,3.0", "2,5.0", f"{2 + 4e-16},7.0", "3,4.0", "3,6.0", "4,1.0"]
    table = "\n".join(["t,a", *rows]) + "\n"
    with pytest.raises(InputError, match=r"repeated at line 5 .*allow_repeats = true"):
        read_recording(write(table))
    found = read_recording(write(table, "allow_repeats = true\n" + SIDECAR))
    np.testing.assert_allclose(found.times, [0, 1, 2, 3, 4])
    np.testing.assert_allclose(found.channels["theta"].values, [1, 2, 5, 5, 1])
    assert "3 rows that repeat the time before them are averaged with it." in found.metadata["notes"]
    with pytest.raises(InputError, match="runs backwards"):
        read_recording(write("t,a\n0,1\n1,1\n0.5,2\n2,1\n3,0\n", "allow_repeats = true\n" + SIDECAR))
    plain = read_recording(write("t,a\n0,1.5\n1,1.2\n2,1.4\n", "allow_repeats = true\n" + SIDECAR))
    assert not any("averaged" in n for n in plain.metadata["notes"])

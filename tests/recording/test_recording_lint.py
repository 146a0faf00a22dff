"""Every fault that a recording can have is told in one sentence, and a sound one is not accused."""

import numpy as np
import pytest

from origami_sim.errors import InputError
from origami_sim.recording import Series, applied_drive, lint, lint_report, read_recording
from origami_sim.recording.lint import swaps

RATE, COUNT = 120.0, 400
TIMES = np.arange(COUNT) / RATE


def track(k: int, noise: float = 1e-4, seed: int = 0) -> np.ndarray:
    """Marker k of a turning object with noise (n, 2) [m]; neighbours cross each other's path."""
    rng = np.random.default_rng([seed, k])
    path = np.column_stack([0.1 * np.cos(4 * TIMES + 2 * k), 0.05 * np.sin(5 * TIMES + k)])
    return path + rng.normal(scale=noise, size=path.shape)


def markers(*readings: np.ndarray, unit: str = "m", kind: str = "marker_2d") -> dict[str, Series]:
    return {f"m{k}": Series(readings=r, kind=kind, unit=unit) for k, r in enumerate(readings)}


def angle(values: np.ndarray, unit: str = "rad", kind: str = "crease_angle") -> dict[str, Series]:
    return {"fold": Series(readings=values, kind=kind, unit=unit)}


def noisy(scale: float = 1e-3) -> np.ndarray:
    return np.sin(5 * TIMES) + np.random.default_rng(1).normal(scale=scale, size=COUNT)


def exchanged(first: int, last: int) -> tuple[np.ndarray, np.ndarray]:
    a, b = track(0), track(1)
    a[first:last], b[first:last] = b[first:last].copy(), a[first:last].copy()
    return a, b


def test_sound_markers_give_no_note():
    for seed in range(10):
        assert lint(TIMES, markers(*(track(k, seed=seed) for k in range(6)))) == []


def test_a_step_of_the_motion_is_not_said_to_be_noise():
    """A device that follows a switched field jumps between frames, as noise in bursts does."""
    steps = 0.2 * (TIMES > 1.0) + np.random.default_rng(2).normal(scale=1e-3, size=COUNT)
    (note,) = lint(TIMES, angle(steps))
    assert note.startswith("Channel 'fold' is now and then") and "steps that are faster than the frames" in note


@pytest.mark.parametrize(("first", "last", "count"), [(100, COUNT, 1), (100, 250, 2), (100, 104, 2)])
def test_swapped_markers_are_found_at_the_frame(first, last, count):
    a, b = exchanged(first, last)
    found = swaps(TIMES, a, b)
    assert found[0] == pytest.approx(TIMES[first]) and len(found) == count
    with pytest.raises(
        InputError, match=r"markers 'm0' and 'm1' seem to exchange names at t = 0\.833333 s.*allow_swaps"
    ):
        lint(TIMES, markers(a, b))
    notes = lint(TIMES, markers(a, b), allow_swaps=True)
    assert notes[-1].startswith("Markers 'm0' and 'm1' seem to exchange names at t = 0.833333 s")


def test_a_swap_behind_an_occlusion_is_found():
    a, b = exchanged(100, COUNT)
    a[97:100] = np.nan
    b[95:99] = np.nan
    np.testing.assert_allclose(swaps(TIMES, a, b), [TIMES[100]])


def test_a_jump_of_one_marker_or_of_both_together_is_no_swap():
    a, b = track(0), track(1)
    a[100:] += 0.05
    assert swaps(TIMES, a, b).size == 0
    b[100:] += 0.05
    assert swaps(TIMES, a, b).size == 0


def test_unsorted_rows_are_told_from_a_clock_that_starts_again():
    mixed = TIMES.copy()
    mixed[[50, 51]] = mixed[[51, 50]]
    with pytest.raises(InputError, match=r"runs backwards from 0\.425 s at row 52: the rows are not sorted \(1 of 399"):
        lint(mixed, markers(track(0)))
    twice = TIMES.copy()
    twice[51] = twice[50] * (1 + 1e-15)  # a point of a printed diagram, read twice
    with pytest.raises(InputError, match="the time is repeated at row 52"):
        lint(twice, markers(track(0)))
    again = np.concatenate([TIMES[:200], TIMES[:200]])
    with pytest.raises(InputError, match=r"runs backwards from 1\.65833333 s at row 201 \("):
        lint(again, markers(track(0)))


def test_load_steps_are_not_said_to_be_seconds():
    steps, values = np.arange(30.0), np.linspace(0.0, 1.0, 30)
    lost = np.where(steps < 3, np.nan, values)
    (note,) = lint(steps, {"fold": Series(lost, "crease_angle", "rad", 1e-3)}, by_step=True)
    assert note == "Channel 'fold' starts only at load step 3."
    lost[10] = np.nan
    with pytest.raises(InputError, match=r"first at load step 10 .*allow_gaps"):
        lint(steps, {"fold": Series(lost, "crease_angle", "rad", 1e-3)}, by_step=True)


def test_runs_of_missing_values_are_counted():
    a = track(0)
    a[50:60] = a[80:82] = a[100:103] = np.nan
    with pytest.raises(
        InputError, match=r"'m0' misses 15 values in 3 runs .*first at t = 0\.416667 s, the longest of 10"
    ):
        lint(TIMES, markers(a))


def test_a_crease_that_turns_too_far_is_degrees():
    notes = lint(TIMES, angle(40 * noisy()))
    assert any("turns by" in n and "this looks like degrees" in n for n in notes)
    assert lint(TIMES, angle(40 * noisy(), kind="panel_angle")) == []  # an arm may go round and round


def test_millimetres_read_as_metres_are_suspected():
    notes = lint(TIMES, markers(1000 * track(0)))
    assert len(notes) == 1 and "moves by 200" in notes[0] and "looks like millimetres" in notes[0]
    assert lint(TIMES, markers(1000 * track(0), unit="mm")) == []
    assert lint(TIMES, markers(1000 * track(0), unit="px")) == []


def test_quantised_readings_state_their_step():
    notes = lint(TIMES, angle(np.round(noisy(1e-4) / 0.02) * 0.02))
    assert notes[0] == "The readings of channel 'fold' come in steps of 0.02 rad."


def test_values_that_stand_still_are_told():
    a = track(0)
    a[200:240] = a[200]
    notes = lint(TIMES, markers(a))
    assert notes[0].startswith("Channel 'm0' stands still for 40 frames from t = 1.66667 s")


@pytest.fixture
def read(tmp_path):
    def write_and_read(drive: str, supply: str = ""):
        rows = "".join(f"{t:.6f},{v:.9f}\n" for t, v in zip(TIMES, noisy(), strict=True))
        (tmp_path / "run.csv").write_text("t,a\n" + rows)
        (tmp_path / "supply.csv").write_text(supply)
        (tmp_path / "run.toml").write_text(
            '[time]\ncolumn = "t"\n[channels.fold]\ncolumn = "a"\nkind = "crease_angle"\nunit = "rad"\ncrease = 0\n'
            + drive
        )
        return read_recording(tmp_path / "run.csv")

    return write_and_read


OWN_FILE = '[drive.voltage]\nfile = "supply.csv"\ntime_column = "ms"\ntime_unit = "ms"\ncolumn = "kv"\nunit = "kV"\n'


def test_a_drive_of_its_own_file_is_joined_by_time(read):
    supply = "ms,kv\n" + "".join(f"{k * 50 - 500},{0.1 * k}\n" for k in range(100))
    drive = read(OWN_FILE, supply).drive["voltage"]
    np.testing.assert_allclose(drive.at(TIMES), (TIMES + 0.5) / 0.05 * 100.0, atol=1e-9)
    shifted = read(OWN_FILE + "shift = 0.25\n", supply).drive["voltage"]
    np.testing.assert_allclose(shifted.at(TIMES), (TIMES + 0.25) / 0.05 * 100.0, atol=1e-9)


def test_a_drive_that_begins_with_the_recording_but_for_rounding_covers_it(read):
    supply = "ms,kv\n" + "".join(f"{350 + 50 * k},{0.1 * k}\n" for k in range(100))
    recording = read(OWN_FILE + "shift = -0.35\n", supply)  # 0.35 s minus 0.35 s is 6e-17 s
    assert recording.drive["voltage"].at(TIMES)[0] == 0.0 and not applied_drive(recording)["voltage_0"].is_zero


def test_a_drive_that_does_not_cover_the_recording_is_refused(read):
    words = r"run.toml: the drive 'voltage' does not cover the recording .*allowed: samples from 0 s to 3\.325 s"
    with pytest.raises(InputError, match=words.replace("3\\.325", r"3\.32\d*")):
        read(OWN_FILE, "ms,kv\n0,0\n3000,1\n")
    with pytest.raises(InputError, match=r"the drive 'field' does not cover the recording"):
        read('[drive.field]\ntimes = [0.0, 2.0]\nvalues = [0.0, 5.0]\nunit = "mT"\ndirection = [0.0, 0.0, 1.0]\n')
    with pytest.raises(InputError, match=r"supply.csv: the times of drive 'voltage' do not increase at line 3"):
        read(OWN_FILE, "ms,kv\n0,0\n0,1\n9000,1\n")


def test_samples_in_the_sidecar_take_a_direction(read):
    drive = read('[drive.field]\ntimes = [0.0, 4.0]\nvalues = [0.0, 8.0]\nunit = "mT"\ndirection = [0.0, 3.0, 4.0]\n')
    np.testing.assert_allclose(drive.drive["field"].at(TIMES), np.outer(2e-3 * TIMES, [0.0, 0.6, 0.8]), atol=1e-12)


@pytest.mark.parametrize(
    ("drive", "words"),
    [
        ('[drive.b]\ntimes = [0.0, 4.0]\nunit = "T"\n', "samples need both 'times' and 'values'"),
        ('[drive.b]\ntimes = [0.0, 0.0]\nvalues = [1.0, 2.0]\nunit = "T"\n', "must increase, with one value each"),
        ('[drive.b]\nfile = "supply.csv"\ncolumn = "kv"\nunit = "T"\n', "needs a 'time_column'"),
        ('[drive.b]\nvalue = 1.0\nshift = 2.0\nunit = "T"\n', "is only for a drive in a file of its own"),
        ('[drive.b]\nvalue = [1.0, 2.0]\nunit = "T"\ndirection = [1.0, 0.0, 0.0]\n', "only one number can be given"),
        ('[drive.b]\nvalue = 1.0\nunit = "T"\ndirection = [0.0, 0.0, 0.0]\n', "must not be zero"),
    ],
)
def test_faulty_drives(read, drive, words):
    with pytest.raises(InputError, match=words):
        read(drive)


def test_the_report_states_noise_drive_and_notes(read):
    recording = read('[drive.voltage]\nvalue = 2.0\nunit = "kV"\n')
    text = lint_report(recording)
    assert text.startswith("run: 400 frames, 3.325 s\n  fold (crease_angle): noise ")
    assert "median level" in text and "rms" in text and "lag-1 correlation" in text
    assert "  drive voltage [V]: constant" in text
    assert recording.channels["fold"].noise == pytest.approx(1e-3, rel=0.15)


def test_the_noise_of_a_quasi_static_curve_is_said_to_be_rough():
    notes = lint(np.arange(13.0), angle(np.sin(np.arange(13.0) / 9)), by_step=True)
    assert notes == [
        "The noise of channel 'fold' is the roughness of 13 load steps, an upper bound: state it if it is known."
    ]


def test_real_tosses_and_swings_are_not_accused_of_swaps(pendulum_recordings, tmp_path):
    """A cube that hits a board stops and turns within a frame: hard on a test that predicts the next frame."""
    tosses = pendulum_recordings.parent / "cube_toss" / "tosses.parquet"
    if not tosses.is_file():
        pytest.skip(f"the real tosses are not in {tosses}")
    for toss in (0, 40, 80, 120):
        (tmp_path / "toss.toml").write_text(
            f'allow_gaps = true\n[select]\ntoss = {toss}\n[time]\ncolumn = "time_s"\n'
            '[channels.centre]\ncolumns = ["x_m", "y_m", "z_m"]\nkind = "marker"\nunit = "m"\nnode = 0\n'
            '[channels.shadow]\ncolumns = ["y_m", "x_m", "z_m"]\nkind = "marker"\nunit = "m"\nnode = 1\n'
        )
        recording = read_recording(tosses, tmp_path / "toss.toml")
        assert not any("exchange" in note for note in recording.metadata["notes"])
        assert 1e-5 < recording.channels["centre"].noise < 1e-4

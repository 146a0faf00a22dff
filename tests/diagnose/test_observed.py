"""Folds that no channel shows are named; a recording that shows nothing is refused."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from origami_sim.device.scene import scene_module, scene_settings
from origami_sim.diagnose import Subject
from origami_sim.diagnose.observed import beyond_the_log, channel_tangents, check_recording, in_ranges, unobserved
from origami_sim.errors import InputError
from origami_sim.hypotheses.hypothesis import Hypothesis
from origami_sim.hypotheses.subject import alignments
from origami_sim.hypotheses.suspects import suspects
from origami_sim.observation.doubts import slow_frames
from origami_sim.predict.bars import BarRollouts
from origami_sim.predict.curves import Static
from origami_sim.predict.prescribed import curves
from origami_sim.recording import Channel, Recording
from origami_sim.recording.recording import DriveChannel
from tests.diagnose.strips import hanging, record

MODEL, PARAMETERS = hanging(4)
SWING = record(duration=0.5, panels=4, rate=100)
TIP = int(np.argmin(MODEL.position[:, 2]))


def seen_by(*channels: Channel | str) -> BarRollouts:
    every = [SWING.channels[c] if isinstance(c, str) else c for c in channels]
    recording = replace(SWING, channels={c.name: c for c in every})
    return BarRollouts(Subject.from_model(MODEL, PARAMETERS), [recording], segment=0.2)


def attached(name: str, kind: str, width: int = 1, **to) -> Channel:
    values = np.zeros((len(SWING.times), width)) if width > 1 else np.zeros(len(SWING.times))
    return Channel(name, kind, values, "m" if width > 1 else "rad", 1e-3, to)


def test_all_folds_are_shown_by_their_own_angles():
    forward = seen_by("fold1", "fold2", "fold3")
    assert unobserved(forward) is None
    tangent = channel_tangents(forward)
    noise = SWING.channels["fold1"].noise
    np.testing.assert_allclose(tangent[:3], np.eye(3) / noise, rtol=1e-6, atol=1e-3)


def test_a_fold_below_the_last_marker_is_named():
    sentence = unobserved(seen_by("fold1", "fold2"))
    assert sentence is not None and sentence.startswith("No channel shows crease 2: ")
    sentence = unobserved(seen_by("fold3"))
    assert sentence is not None and sentence.startswith("No channel shows crease 0 and crease 1: ")


@pytest.mark.parametrize(
    ("label", "value", "log", "after", "late"),
    [
        ("clock_delay at the measurement", -0.03, 0.0, 1.0, 3),
        ("clock_delay at channel fold2", -0.03, 0.0, 1.0, 3),
        ("clock_delay at the measurement", -0.03, 0.5, 1.0, None),  # the log goes on
        ("clock_delay at the measurement", -0.03, 0.0, 0.3, None),  # the drive rests by then
        ("clock_delay at the measurement", 0.03, 0.0, 1.0, None),  # frames before the first see the drive's first value
        ("clock_rate at the measurement", 0.05, 0.0, 1.0, 2),
        ("angle_offset at the measurement", 0.03, 0.0, 1.0, None),  # no clock
        ("clock_delay.clock_delay", -0.03, 0.0, 1.0, 3),  # aligned, with a prior
    ],
)
def test_frames_past_the_end_of_a_drive_that_moves_are_told(label, value, log, after, late):
    """There it is held at its last value, which took a delay of 30 ms three of its deviations from the truth."""
    own = np.arange(0.0, np.ptp(SWING.times) + log + 1e-9, 0.01)
    drive = DriveChannel("field_z", np.sin(20.0 * np.minimum(own, after)), "T", False, own + SWING.times[0])
    swing = replace(SWING, drive={"field_z": drive})
    priors = {label: "10 ms"} if "." in label else {}
    asked = Subject.from_model(MODEL, PARAMETERS).beside(alignments(priors))
    forward = BarRollouts(asked, [swing], segment=0.2)
    every = {s.label: s for s in suspects(MODEL, [swing], forward.drive)}
    hypothesis = Hypothesis(() if priors else (every[label],))
    told = beyond_the_log(forward, SimpleNamespace(hypothesis=hypothesis, theta=np.array([value])))
    assert len(told) == (late is not None)
    if late:
        assert f"the last {late} frames" in told[0] and "past the end of the recorded field_z" in told[0]


def test_folds_that_only_add_up_are_named_as_such():
    """The angle of the last panel is the sum of all folds; with the tip it is two of three."""
    last = attached("last", "panel_angle", panel=3)
    sentence = unobserved(seen_by(last))
    assert sentence is not None
    assert sentence.startswith("The channels show crease 0, crease 1 and crease 2 only together: ")
    sentence = unobserved(seen_by(last, "fold2", "fold3"))
    assert sentence is None
    assert unobserved(seen_by(last, attached("tip", "marker", 3, node=TIP))) is None


def test_channels_without_a_value_show_nothing():
    lost = attached("fold3", "crease_angle", crease=2)
    lost.values[:] = np.nan
    sentence = unobserved(seen_by("fold1", "fold2", lost))
    assert sentence is not None and "crease 2" in sentence


def test_a_recording_of_what_does_not_move_is_refused():
    held = int(np.flatnonzero(~np.any(MODEL.free, axis=1))[0])
    with pytest.raises(InputError, match=r"no channel reacts to any fold.*clamp.*crease 2"):
        unobserved(seen_by(attached("clamp", "marker", 3, node=held)))


def test_curves_are_asked_as_well():
    module = scene_module("mae_crease")
    fold = Channel("fold", "crease_angle", np.linspace(0, 0.5, 20), "rad", 1e-3, {"crease": 0})
    field = DriveChannel("field", np.outer(np.linspace(0, 0.1, 20), [0.0, 0.0, 1.0]), "T", False)
    recording = Recording("curve", np.arange(20.0), {"fold": fold}, {"field": field}, {"time_base": "step"})
    forward = curves(Subject.from_scene(module, scene_settings(module)), [recording])
    assert isinstance(forward, Static)
    assert unobserved(forward) is None


# --- what is refused before anything is computed


def moving(*places: np.ndarray, **attached) -> Recording:
    """Markers at nodes of the last panel, with these positions (n, 3)."""
    panel = int(MODEL.triangle_panel.max())
    nodes = np.unique(MODEL.triangles[MODEL.triangle_panel == panel])
    channels = {
        f"m{n}": Channel(f"m{n}", "marker", p, "m", 1e-4, {"node": int(nodes[n])}) for n, p in enumerate(places)
    }
    return Recording("made", np.arange(len(places[0])) / 100, channels, **attached)


def test_lengths_in_another_unit_are_refused_and_others_are_not():
    wave = 0.02 * np.sin(np.arange(50) / 8)[:, None] * [1.0, 0.0, 0.0]
    panel = int(MODEL.triangle_panel.max())
    a, b = MODEL.position[np.unique(MODEL.triangles[MODEL.triangle_panel == panel])[:2]]
    good = moving(a + wave, b + wave)
    check_recording(good, MODEL)
    check_recording(moving(a + wave, a + 1.5 * (b - a) + wave), MODEL)  # a scale that is a suspect
    with pytest.raises(InputError, match=r"'m0' moves by 40 m.*channels.m0.unit.*millimetres or pixels"):
        check_recording(moving(1e3 * (a + wave), 1e3 * (b + wave)), MODEL)
    with pytest.raises(InputError, match=r"'m0' and 'm1' are .* m apart, on the model's panel"):
        check_recording(moving(1e-3 * (a + wave), 1e-3 * (b + wave)), MODEL)
    free = replace(MODEL, free=np.ones_like(MODEL.free))  # what nothing holds may go far
    check_recording(moving(a + 1e3 * wave, b + 1e3 * wave), free)


def test_recordings_of_few_values_are_refused_and_slow_ones_noted():
    holes = np.where(np.arange(200) % 14 == 0, 0.1, np.nan)
    lost = Recording(
        "lost", np.arange(200) / 100, {"a": Channel("a", "crease_angle", holes, "rad", 1e-3, {"crease": 0})}
    )
    with pytest.raises(InputError, match=r"too short.*lost.frames', value 15.*at least 16 with a value"):
        check_recording(lost, MODEL)
    slow = replace(SWING, times=1e3 * SWING.times)
    (note,) = slow_frames(slow, 5e-5)
    assert "lasts 10 s, 2e+05 steps" in note and note.endswith("motion = 'quasistatic' in the sidecar.")
    assert slow_frames(SWING, 5e-5) == [] == slow_frames(replace(slow, motion="quasistatic"), 5e-5)


def test_many_numbered_names_are_said_as_a_range():
    stations = [f"station {k}" for k in range(1, 25)]
    assert in_ranges(stations) == "station 1 to station 24"
    assert in_ranges(["base", *stations[2:7], "station 9"]) == "base, station 3 to station 7 and station 9"
    assert in_ranges(stations[:3]) == "station 1, station 2 and station 3"

"""The comparison against known residuals, and its false alarms on noise."""

import json

import numpy as np
import pytest
from scipy.stats import norm

from origami_sim.errors import InputError
from origami_sim.observation.compare import PARTING_WINDOW, compare, first_parting, plot_overlay
from origami_sim.recording import Channel, Recording

NOISE = 1e-4
TIMES = np.arange(2000) / 1000.0


def recording_of(metadata=None, **values) -> Recording:
    channels = {name: Channel(name, "panel_angle", v, "rad", NOISE) for name, v in values.items()}
    return Recording("test", TIMES, channels, metadata=metadata or {})


def motion() -> np.ndarray:
    return np.cos(6.0 * TIMES)


def test_scores_follow_their_definitions():
    generator = np.random.default_rng(0)
    measured = motion() + generator.normal(scale=0.1, size=TIMES.size)
    scores = compare(recording_of(theta=measured), {"theta": motion()}).channels["theta"]
    residual = measured - motion()
    assert scores.rmse == pytest.approx(np.sqrt(np.mean(residual**2)))
    assert scores.nrmse == pytest.approx(np.linalg.norm(residual) / np.linalg.norm(measured - measured.mean()))
    assert scores.fit == pytest.approx(100.0 * (1.0 - scores.nrmse))
    np.testing.assert_array_equal(scores.residual[:, 0], residual)


def test_they_part_where_the_error_passes_the_threshold():
    generator = np.random.default_rng(1)
    noise = generator.normal(scale=NOISE, size=(2, TIMES.size))
    drift = 5e-3 * np.maximum(TIMES - 0.5, 0.0)  # reaches 5 x noise at 0.6 s
    comparison = compare(
        recording_of(theta1=motion() + noise[0], theta2=motion() + noise[1] + drift),
        {"theta1": motion(), "theta2": motion()},
    )
    assert comparison.first_channel == "theta2"
    assert comparison.first_time == pytest.approx(0.6, abs=0.03)
    assert comparison.channels["theta1"].parting_time is None
    assert comparison.sentence().startswith(
        f"Simulation and recording part at t = {comparison.first_time:.3f} s in channel"
    )
    assert "in channel theta2 (residual 5" in comparison.sentence() and "noise 100 µrad); fit" in comparison.sentence()


def test_a_step_is_found_on_its_frame():
    measured = motion() + np.where(np.arange(TIMES.size) >= 700, -20.0 * NOISE, 0.0)
    comparison = compare(recording_of(theta=measured), {"theta": motion()})
    assert comparison.first_time == TIMES[700]
    assert comparison.channels["theta"].parting_residual == pytest.approx(-20.0 * NOISE)


def test_outliers_and_holes_do_not_part():
    measured = motion().copy()
    measured[100:102] += 1.0
    measured[500:503] = np.nan
    measured[503:505] -= 1.0
    comparison = compare(recording_of(theta=measured), {"theta": motion()})
    assert comparison.first_channel is None
    assert "do not part between t = 0.000 s and t = 1.999 s: no lasting residual exceeds 5" in comparison.sentence()


def test_noise_alone_gives_no_false_alarm():
    alarms = 0
    for seed in range(200):
        generator = np.random.default_rng(seed)
        white = generator.normal(scale=NOISE, size=TIMES.size)
        heavy = generator.standard_t(3, size=TIMES.size) * NOISE / np.sqrt(3.0)
        comparison = compare(
            recording_of(white=motion() + white, heavy=motion() + heavy), {"white": motion(), "heavy": motion()}
        )
        alarms += comparison.first_channel is not None
    assert alarms == 0  # an upper 95 % bound of 1.5 % per recording


def test_the_false_alarm_rate_is_the_stated_one():
    """At a low threshold, where alarms occur, the share of alarmed windows is that of the median of five normals."""
    generator = np.random.default_rng(5)
    values = generator.normal(size=400_000)
    medians = np.median(np.lib.stride_tricks.sliding_window_view(values, PARTING_WINDOW), axis=1)
    tail = norm.sf(2.0)
    exact = 2.0 * (10 * tail**3 * (1 - tail) ** 2 + 5 * tail**4 * (1 - tail) + tail**5)
    assert exact < 20.0 * tail**3
    measured = np.mean(np.abs(medians) > 2.0)
    assert measured == pytest.approx(exact, rel=0.3)
    found = first_parting(values, 2.0)
    first = int(np.flatnonzero(np.abs(medians) > 2.0)[0])
    assert found is not None and first <= found[0] < first + PARTING_WINDOW


def test_vectors_part_by_component():
    values = np.stack([motion(), np.zeros_like(TIMES), TIMES], axis=1)
    predicted = values.copy()
    predicted[300:, 1] += 1e-3
    recording = Recording("m", TIMES, {"tag": Channel("tag", "marker", values, "m", NOISE)})
    comparison = compare(recording, {"tag": predicted})
    assert comparison.first_time == TIMES[300]
    assert comparison.channels["tag"].parting_residual == pytest.approx(-1e-3)


def test_table_and_json_hold_the_numbers():
    generator = np.random.default_rng(2)
    measured = motion() + generator.normal(scale=NOISE, size=TIMES.size)
    still = np.full(TIMES.size, 0.5)
    comparison = compare(
        recording_of(theta=measured, still=still, off=measured),
        {"theta": motion(), "still": still, "off": 0.9 * motion()},
    )
    lines = comparison.table().splitlines()
    assert [line.split()[0] for line in lines] == ["channel", "off", "theta", "still"]
    assert "never" in lines[2] and "nan" in lines[3]
    tree = json.loads(comparison.to_json(series=True))
    assert tree["channels"]["still"]["fit_percent"] is None
    assert tree["channels"]["theta"]["rmse"] == comparison.channels["theta"].rmse
    series = tree["channels"]["off"]
    residual = np.array(series["recorded"]) - np.array(series["predicted"])
    assert np.sqrt(np.mean(residual**2)) == pytest.approx(series["rmse"])
    assert "recorded" not in json.loads(comparison.to_json())["channels"]["off"]
    assert "undefined (still)" in comparison.sentence()


def test_load_steps_are_no_seconds():
    comparison = compare(recording_of({"time_base": "step"}, theta=motion()), {"theta": 0.9 * motion()})
    assert "part at step 0 in" in comparison.sentence()


@pytest.mark.parametrize(
    ("predicted", "threshold", "sentence"),
    [
        ({}, 5.0, "the simulation does not predict channel 'theta'"),
        ({"theta": motion(), "phi": motion()}, 5.0, "has no such channel .*'phi'.*allowed: theta"),
        ({"theta": motion()[:5]}, 5.0, r"another shape than the recording .*\(5,\).*allowed: \(2000,\)"),
        ({"theta": np.where(TIMES < 1.0, 0.0, np.nan)}, 5.0, "is not finite from t = 1 s"),
        ({"theta": motion()}, 0.0, "the threshold must be positive"),
    ],
)
def test_predictions_that_cannot_be_compared_are_refused(predicted, threshold, sentence):
    with pytest.raises(InputError, match=sentence):
        compare(recording_of(theta=motion()), predicted, threshold=threshold)


def test_a_picture_is_drawn_for_every_kind_of_comparison(tmp_path):
    values = np.stack([motion(), np.zeros_like(TIMES), TIMES], axis=1)
    recording = Recording(
        "m",
        TIMES,
        {
            "tag": Channel("tag", "marker", values, "m", NOISE),
            "arm": Channel("arm", "panel_angle", motion(), "rad", NOISE),
        },
    )
    comparison = compare(recording, {"tag": values + 1e-3 * TIMES[:, None], "arm": 0.5 * motion()})
    picture = plot_overlay(comparison, tmp_path / "overlay.png")
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert [p.name for p in tmp_path.iterdir()] == ["overlay.png"]
    with pytest.raises(InputError, match=r"unknown kind of picture .*allowed: \.png, \.svg, \.pdf"):
        plot_overlay(comparison, tmp_path / "overlay.xyz")

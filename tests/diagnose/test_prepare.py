"""What is compared: frames that are thinned or left out, segments, suspects that are asked for, bad data."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from origami_sim.diagnose import Options, diagnose
from origami_sim.diagnose.arrange import arranged
from origami_sim.diagnose.prepare import among, prepared
from origami_sim.errors import InputError
from origami_sim.fit.nominal import nominal_fits
from origami_sim.hypotheses.suspects import suspects
from origami_sim.observation.thinning import thinned
from origami_sim.predict.shots import by_length
from origami_sim.recording import Channel, DriveChannel, NoiseReport, Recording
from tests.diagnose.strips import hanging, record, subject

SMALL = {"duration": 4.0, "panels": 3, "rate": 100}


def test_frames_are_thinned_but_not_below_what_a_comparison_needs():
    swing = record(**SMALL)
    (same,) = prepared([replace(swing, times=swing.times / 100)], 200.0)
    assert len(same.times) == len(swing.times), "40 ms at 10 kHz are few frames, not many"
    long = record(panels=3, duration=5.0, rate=400)
    (half,) = prepared([long], 200.0)
    assert len(half.times) == pytest.approx(len(long.times) / 2, abs=1)


def test_thinned_frames_are_means_that_follow_a_bend():
    """Noise falls with the root of the frames, the motion stays, and what cannot be averaged stays as it was read."""
    t, rng = np.arange(4001) / 1000.0, np.random.default_rng(2)
    swing = 0.7 * np.sin(2 * np.pi * 6.0 * t)

    def thin(values, times=t, quantum=0.0):
        noise = 0.01
        known = NoiseReport(noise, noise, quantum, 0.0, noise, np.nan, np.nan, 0)
        channel = Channel("a", "crease_angle", values, "rad", noise, noise_report=known)
        (out,) = prepared([Recording("r", times, {"a": channel})], 200.0)
        return out

    exact = thin(swing)
    assert np.array_equal(exact.times, t[::5])
    assert exact.channels["a"].values == pytest.approx(swing[::5], abs=5e-6)  # a plain mean is off by 1e-3
    noisy = thin(swing + rng.normal(0.0, 0.01, 4001)).channels["a"]
    left = (noisy.values - swing[::5])[1:-1]
    assert np.std(left) == pytest.approx(noisy.noise, rel=0.08) and noisy.noise < 0.52 * 0.01
    assert abs(np.mean(left[1:] * left[:-1])) < 0.15 * np.var(left)
    assert noisy.noise_report.level == noisy.noise
    smooth = np.convolve(rng.normal(0.0, 0.02, 4005), np.ones(5) / 5.0, "valid")  # frames that are alike
    alike = thin(swing + smooth).channels["a"]
    assert 0.75 < alike.noise / np.std((alike.values - swing[::5])[1:-1]) < 1.1 and alike.noise > 1.2 * noisy.noise
    counted = thin(0.03 * np.round(0.1 * swing / 0.03), quantum=0.03).channels["a"]  # steps are no noise that averages
    assert counted.noise == pytest.approx(0.03 / np.sqrt(12.0))
    gap = np.where(t > 2.0, t + 0.5, t)
    assert thin(swing, gap).channels["a"].values == pytest.approx(swing[::5], abs=5e-6)
    holes = np.where(rng.random(4001) < 0.02, np.nan, 0.0)
    assert thin(swing + holes).channels["a"].values == pytest.approx(swing[::5], abs=2e-4, nan_ok=True)
    holed = thin(swing + holes + rng.normal(0.0, 0.01, 4001)).channels["a"]
    assert np.nanstd((holed.values - swing[::5])[1:-1]) == pytest.approx(holed.noise, rel=0.08)
    assert np.isnan(holed.values).sum() <= 2


def test_means_across_the_end_of_a_ramp_are_what_the_mean_drive_gives():
    """A flap in a field that goes up and down in steps with ramps of 2 s, twice a second: K a = m B cos a."""
    t = np.arange(0.0, 121.0, 0.5)
    levels = np.interp(t, [0, 20, 22, 50, 52, 90, 92, 121], [0, 0, 0.02, 0.02, -0.01, -0.01, 0.005, 0.005])

    def angle(b: np.ndarray) -> np.ndarray:
        moment = lambda a, v: 2e-3 * a - 0.05 * v * np.cos(a)  # noqa: E731
        return np.array([brentq(moment, -1.5, 1.5, args=(v,), xtol=1e-12) for v in b])

    channel = Channel("fold", "crease_angle", angle(levels), "rad", 1.5e-3, {"crease": 0})
    field = DriveChannel("field_z", levels, "T", False)
    recording = Recording("stairs", t, {"fold": channel}, {"field_z": field})
    for every in (2, 3):
        apart = {}
        for driven in (True, False):
            mean = thinned(recording, every, driven=driven)
            apart[driven] = np.abs(mean.channels["fold"].values - angle(mean.drive["field_z"].at(mean.times))).max()
        assert apart[False] > 10e-3 and apart[True] < 1e-4
    own = replace(recording, drive={"field_z": replace(field, times=t + 0.0)})  # a clock of its own
    assert thinned(own, 2, driven=True).drive["field_z"].at(t[::2]) == pytest.approx(
        thinned(recording, 2, driven=True).drive["field_z"].values, abs=1e-15
    )


@pytest.mark.parametrize(("rate", "every"), [(400, 2), (500, 2), (700, 3), (800, 4)])
def test_no_frame_is_thrown_away_where_frames_are_thinned(rate, every):
    t, rng = np.arange(10 * rate) / rate, np.random.default_rng(3)
    swing = 0.7 * np.sin(2 * np.pi * 4.0 * t)

    def thin(values):
        made = Recording("r", t, {"a": Channel("a", "crease_angle", values, "rad", 0.01)})
        return prepared([made], 200.0)[0]

    assert np.array_equal(thin(swing).times, t[::every])
    assert thin(swing).channels["a"].values == pytest.approx(swing[::every], abs=2e-5)
    noisy = thin(swing + rng.normal(0.0, 0.01, len(t))).channels["a"]
    left = (noisy.values - swing[::every])[1:-1]
    assert np.std(left) == pytest.approx(noisy.noise, rel=0.08)
    assert noisy.noise < 1.25 * 0.01 / np.sqrt(every)  # a mean without its bend has 1 / root


def test_wild_frames_are_left_out_and_told():
    t = np.arange(800) / 120.0
    values = np.stack([np.cos(3.0 * t), np.sin(3.0 * t)], axis=1)
    values[[100, 300]] += 0.5
    made = Recording("r", t, {"m": Channel("m", "marker_2d", values, "m", 1e-3)}, metadata={"notes": ["known."]})
    (found,) = prepared([made], 200.0)
    assert np.flatnonzero(np.isnan(found.channels["m"].values).all(axis=1)).tolist() == [100, 300]
    assert found.metadata["notes"] == [
        "known.", "r: 2 wild frames of channel 'm' are left out, the first at t = 0.833333 s."
    ]  # fmt: skip
    curve = replace(made, metadata={"time_base": "step"})
    assert prepared([curve], 200.0)[0].channels["m"].values is values


def test_frames_that_were_lost_are_frames_without_a_value():
    """A few of them; a long pause stays one. A drive with a row per frame keeps its rows, and fits are the same."""
    swing, lost = record(**SMALL), [57, 200, 201, 202, 301]
    kept = np.delete(np.arange(len(swing.times)), [*lost, *range(310, 325)])
    field = DriveChannel("field_z", np.arange(len(swing.times)) * 1e-9, "T", False)
    made = replace(swing, drive={"field_z": field}).only(kept)
    (found,) = prepared([made], 200.0)
    whole = np.delete(np.arange(len(swing.times)), range(310, 325))
    assert found.times == pytest.approx(swing.times[whole], abs=1e-12)
    read = found.channels["fold1"].values
    assert np.flatnonzero(np.isnan(read)).tolist() == lost
    assert np.array_equal(read[~np.isnan(read)], made.channels["fold1"].values)
    assert found.drive["field_z"].at(found.times) == pytest.approx(field.values[whole], abs=1e-18)
    assert not np.any(np.diff(prepared([swing], 200.0)[0].times) - np.diff(swing.times)), "none was lost"
    short = swing.only(np.delete(np.arange(len(swing.times)), lost))
    found, groups = [], []
    for recording in (short, *prepared([short], 200.0)):
        forward, _ = arranged(subject(3), [recording], Options())
        found.append(nominal_fits(forward)[1])
        groups.append(len(by_length(forward.blocks, list(range(len(forward.blocks))))))
    assert groups[1] == 2 < groups[0]
    assert np.all(np.abs(found[1].theta - found[0].theta) < 0.08 * found[0].deviations())


def test_a_segment_that_is_asked_for_has_a_start_of_its_own():
    at_rest = record(**SMALL, size=0.0)
    assert arranged(subject(3), [at_rest], Options(panels="elastic"))[0].start == "rest"
    cut, _ = arranged(subject(3), [at_rest], Options(segment=0.5))
    assert cut.start == "fit" and len(cut.blocks) > 1
    for length in (0.0, 1e-9, np.inf, np.nan):
        with pytest.raises(InputError, match=r"segment.*allowed: >= 0\.08 s"):
            arranged(subject(3), [at_rest], Options(segment=length))


def test_all_frames_of_rigid_panels_are_compared_and_that_they_are_rigid_is_said():
    swing = record(**SMALL)
    forward, notes = arranged(subject(3), prepared([swing], 200.0), Options())
    assert forward.panels == "rigid" and len(forward.blocks) > 4
    assert sum(b.seen().sum() for b in forward.blocks) == 2 * len(swing.times)
    assert len(notes) == 1 and notes[0].startswith("Panels are taken as rigid")
    bars, notes = arranged(subject(3), prepared([swing], 200.0), Options(panels="elastic"))
    assert bars.panels == "elastic" and not notes


def test_effects_that_cannot_act_are_not_left_out_without_a_word():
    swing = record(**SMALL)
    model, _ = hanging(3)
    every = suspects(model, [swing], subject(3).build({})[2])
    assert {s.effect for s in among(every, ["crease_friction", "adhesion"])} == {"crease_friction"}
    with pytest.raises(InputError, match=r"none of these can act.*adhesion.*air_drag.*crease_friction"):
        among(every, ["adhesion"])
    with pytest.raises(InputError, match="no such effect"):
        among(every, ["crease_frictn"])


def test_bad_data_are_named():
    with pytest.raises(InputError, match="nothing to diagnose"):
        diagnose(subject(), [])
    short = record(duration=0.05, rate=100)
    with pytest.raises(InputError, match="too short"):
        diagnose(subject(), [short])

"""Stored strides: round trip, what is compared, and refusals."""

import numpy as np
import pytest

from origami_sim.device.scene import read_calibration
from origami_sim.errors import InputError
from origami_sim.observation.gait import summary
from origami_sim.studies.crawler_maps import (
    AXES,
    Result,
    Store,
    StrideMap,
    Trial,
    apply,
    candidates,
    judge,
    sampled,
    stack,
)
from origami_sim.studies.strides import check, reference, store

STRIDES = [0.028, 0.024, 0.025, 0.0252, 0.025]


@pytest.fixture
def stored(tmp_path):
    store("walker", STRIDES, settings=read_calibration("crawler"), tolerance=0.1, folder=tmp_path)
    return tmp_path


def test_reference_names_versions_and_settings(stored):
    data = reference("walker", folder=stored)
    assert data["strides_mm"] == [28.0, 24.0, 25.0, 25.2, 25.0]
    assert {"origami-sim", "warp-lang", "numpy"} == set(data["versions"])
    assert check("walker", STRIDES, settings=read_calibration("crawler"), folder=stored).same_settings
    assert not check(
        "walker", STRIDES, settings=read_calibration("crawler").replace(field=0.1), folder=stored
    ).same_settings


def test_summary_of_a_linear_series_is_its_line():
    s = summary([0, 0, 1, 2, 3, 4])
    assert (s["mean"], s["trend"], s["cycles"]) == (2.5, pytest.approx(1.0), 4)


@pytest.mark.parametrize(("change", "within"), [(0.05, True), (0.2, False), (np.nan, False)])
def test_one_cycle_that_changed_is_found(stored, change, within):
    now = np.array(STRIDES)
    now[3] += 1e-3 * change
    report = check("walker", now, folder=stored)
    assert report.passed is within
    assert "paper: 25 mm" in report.text()
    assert len(report.table()["difference_mm"]) == 5


def test_shorter_run_is_compared_over_its_cycles(stored):
    assert check("walker", STRIDES[:3], folder=stored).passed


def test_missing_or_malformed_reference_is_refused(tmp_path):
    with pytest.raises(InputError, match="has no stored strides"):
        reference("nobody", folder=tmp_path)
    (tmp_path / "bad_stride.json").write_text("[]")
    with pytest.raises(InputError, match="not a stored reference"):
        reference("bad", folder=tmp_path)


def test_study_results_survive_and_foreign_files_are_refused(tmp_path):
    file = tmp_path / "results.json"
    kept = Store(file)
    kept.results["a"] = Result((1.0, 2.0), 1e-6)
    kept.save()
    assert Store(file).results == kept.results
    assert [f.name for f in tmp_path.iterdir()] == ["results.json"]
    file.write_text("{}")
    with pytest.raises(InputError, match="not a study's results"):
        Store(file)


def test_trials_differ_by_settings_step_and_length():
    s = read_calibration("crawler")
    keys = {Trial(s, 6).key, Trial(s, 7).key, Trial(s, 6, 0.5).key, Trial(s.replace(field=0.1), 6).key}
    assert len(keys) == 4
    assert Trial(s, 6).key == Trial(read_calibration("crawler"), 6).key


def test_friction_ratio_follows_the_forward_friction():
    s = read_calibration("crawler")
    assert apply(s, foot_friction=0.4, friction_ratio=2.0).foot_friction_back == pytest.approx(0.8)
    ratio = s.foot_friction_back / s.foot_friction
    assert apply(s, foot_friction=0.3).foot_friction_back == pytest.approx(0.3 * ratio)


def test_samples_repeat():
    s = read_calibration("crawler")
    assert [w for w, _ in sampled(s, 5, 6)] == [w for w, _ in sampled(s, 5, 6)]


def test_candidates_want_steady_neighbours():
    t = Trial(read_calibration("crawler"), 6)
    x, y = AXES["span"], AXES["loss_time"]
    trials = tuple(tuple(Trial(t.settings, 6 + 10 * i + j) for j in range(5)) for i in range(5))
    stride, spread = np.full((5, 5), 25.0), np.zeros((5, 5))
    spread[2, 2] = 0.5
    found = candidates([StrideMap(x, y, trials, stride, spread)])
    assert len(found) == 20  # all but the unsteady one and its four neighbours


def test_verdict_counts_a_failure_as_a_change():
    ok, worse, failed = Result((25.0,) * 4, 1e-6), Result((26.0,) * 4, 1e-6), Result((), 0.0, "unstable")
    v = judge({"as it is": ok, "step / 2": ok, "cell / 2": ok, "span +5 %": worse, "field +5 %": failed})
    assert (v.worst, v.worst_change, v.accepted) == ("field +5 %", 1.0, False)
    assert judge({"as it is": ok, "step / 2": ok, "cell / 2": ok, "span +5 %": worse}).accepted


def test_worlds_are_stacked_side_by_side():
    from origami_sim.scenes import crawler

    s = read_calibration("crawler")
    parts = [crawler.build(s.replace(belly_friction=f))[1] for f in (0.2, 0.3)]
    both = stack(parts)
    assert both.worlds == 2
    for w, p in enumerate(parts):
        assert both.world(w).hash == p.hash

"""The crawler walks: symmetries, the planar reference, the printed set, and the stored strides."""

import numpy as np
import pytest

from origami_sim.gait import strides
from origami_sim.scene import read_calibration
from origami_sim.scenes import crawler
from origami_sim.studies.crawler_maps import Store, Trial, checks, judge, run_trials
from origami_sim.studies.strides import check

REFERENCE = {0.2: (31.0, 3.0), 0.1: (27.5, 3.0), 0.05: (12.0, 1.5)}
"""Planar reference [T]: stride and tolerance [mm]."""

SLOW = pytest.mark.slow


def walk(cycles=4, calibration="crawler", **changes):
    """Strides by cycle [mm] and the motion."""
    s = read_calibration(calibration).replace(**changes)
    motion = crawler.walk(s, cycles=cycles, rate=20.0)
    assert not motion.failures, motion.failures[0]
    return strides(motion, s.frequency) * 1e3, motion


@pytest.fixture(scope="module")
def default():
    """Six cycles of the shipped calibration."""
    return walk(6)[0]


def test_default_gait_is_steady_and_near_the_paper(default):
    assert default[3:].std() < 0.02 * default[3:].mean()
    assert default[3:].mean() == pytest.approx(25.0, abs=2.5)


def test_regression_reference_is_reproduced(default):
    report = check("crawler", default / 1e3, settings=read_calibration("crawler"))
    assert report.same_settings
    assert report.passed, report.text()


@pytest.mark.parametrize("field", REFERENCE)
def test_planar_reference(field):
    stride, _ = walk(4, "crawler_reference", field=field, cell=0.0038)
    target, tolerance = REFERENCE[field]
    assert stride[2:].mean() == pytest.approx(target, abs=tolerance)


@SLOW
@pytest.mark.parametrize("field", REFERENCE)
def test_planar_reference_at_its_own_mesh_converged_in_step(field, tmp_path):
    s = read_calibration("crawler_reference").replace(field=field)
    store = Store(tmp_path / "results.json")
    whole, half = run_trials("crawler", [Trial(s, 6), Trial(s, 6, 0.5)], store)
    target, tolerance = REFERENCE[field]
    assert whole.stride == pytest.approx(target, abs=tolerance)
    assert half.stride == pytest.approx(whole.stride, rel=0.02)


def test_turned_device_walks_the_other_way(default):
    turned, motion = walk(4, heading=-1.0)
    assert turned[2:].mean() == pytest.approx(-default[3:].mean(), rel=0.02)
    assert np.abs(motion.x[..., 1] - motion.x[:1, ..., 1]).max() < 1e-12


def test_reversed_field_gives_the_same_stride(default):
    reversed_, _ = walk(5, field=0.2, polarity=-1.0)  # the moments turn, which is the same as turning the field
    assert reversed_[3:].mean() == pytest.approx(default[3:].mean(), rel=0.02)


def test_no_friction_no_drift():
    _, motion = walk(2, foot_friction=0.0, foot_friction_back=0.0, belly_friction=0.0, cell=0.0048)
    x = motion.centre_of_mass()[:, 0, 0]
    assert np.abs(x - x[0]).max() < 1e-6


@pytest.mark.parametrize("field", [0.1, 0.2])
def test_equal_patches_and_isotropic_feet_do_not_walk(field):
    s = read_calibration("crawler")
    even = {"big_length": s.small_length, "big_width": s.small_width, "big_moment": 1.0, "rear_width": 0.0115,
            "front_width": 0.0115, "foot_friction_back": s.foot_friction, "field": field}  # fmt: skip
    stride, _ = walk(5, **even)
    assert abs(stride[2:].mean()) < 0.1


def test_printed_set_snaps_and_repeats_but_is_ill_conditioned():
    # -55.7 mm per cycle: the acceptance band of 1 to 50 mm is missed by 5.7 mm (docs/paper/crawler.md)
    stride, _ = walk(8, "crawler_printed")
    assert stride[4:].std() < 0.02 * abs(stride[4:].mean())
    stiffer, _ = walk(8, "crawler_printed", ground_stiffness=2000.0)
    assert abs(stiffer[4:].mean() / stride[4:].mean() - 1) > 0.1


@SLOW
def test_free_strip_walks_like_the_guided_one(default):
    free, _ = walk(4, guided=False)
    assert free[2:].mean() == pytest.approx(default[3:].mean(), rel=0.25)


@SLOW
def test_default_is_converged_and_robust(tmp_path):
    named = checks(Trial(read_calibration("crawler"), 6))
    found = dict(zip(named, run_trials("crawler", list(named.values()), Store(tmp_path / "results.json")), strict=True))
    verdict = judge(found)
    assert verdict.accepted, (verdict.spread, verdict.halved, verdict.worst, verdict.worst_change)


def test_end_correction_makes_the_borders_of_the_patches_softer():
    """Compliance of bare sheet of length c h more at each of the four borders, and nowhere else; none by default."""
    s = read_calibration("crawler")
    assert s.end_correction == 0.0
    law = read_calibration("crease_bridge")
    before, after = (crawler.build(s.replace(end_correction=c))[1] for c in (0.0, law.end_correction))
    more = 1 / after["crease", "stiffness"][:, 0] - 1 / before["crease", "stiffness"][:, 0]
    x, owner = crawler.stations(s)
    borders = x[1:-1][np.diff(owner) != 0]
    width = s.rear_width + (s.front_width - s.rear_width) * borders / x[-1]
    bare = s.modulus / (1 - s.poisson**2) * s.thickness**3 / 12
    expected = law.end_correction * s.thickness / (bare * width)
    assert len(borders) == 4
    np.testing.assert_allclose(np.sort(more)[-4:], np.sort(expected), rtol=1e-6)
    assert np.abs(np.sort(more)[:-4]).max() < 1e-9 * expected.max()


@SLOW
def test_stride_depends_little_on_the_end_correction():
    """The calibrated bridge instead of plane sections: some per cent, the gait is the same."""
    stride, _ = walk(4, end_correction=0.674)
    assert stride[3] == pytest.approx(24.7, rel=0.1)

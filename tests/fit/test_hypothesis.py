"""Suspects: which there are, where, with which numbers, and which can act beside each other."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from origami_sim.hypotheses.hypothesis import Hypothesis, distinct_sites
from origami_sim.hypotheses.suspects import suspects, told_apart
from origami_sim.predict.rigid import RigidRollouts
from tests.diagnose.strips import record, subject


@pytest.fixture(scope="module")
def forward() -> RigidRollouts:
    return RigidRollouts(subject(3), [record(duration=3.0, panels=3, rate=100)], segment=0.5)


def test_a_tether_is_suspected_at_the_edge_of_each_panel_and_relaxation_at_several_times(forward):
    every = forward.admitted(suspects(forward.model, forward.recordings, forward.drive))
    leads = {s.site: s.entities for s in every if s.effect == "tether"}
    assert leads.pop("the body") is None
    lowest = forward.model.position[:, 2].min()
    *_, last = (np.array(n) for n in leads.values())
    assert len(leads) == 2, "nothing that is held is tied"
    assert forward.model.position[last, 2] == pytest.approx(lowest)
    assert len(last) == 2
    slow = [s.free[1].start for s in every if s.effect == "crease_relaxation" and s.entities == (1,)]
    span = forward.recordings[0].times[-1] - forward.recordings[0].times[0]
    assert len(slow) == 4 and 0.03 < slow[0] and slow[-1] < span
    assert np.diff(np.log(slow)) == pytest.approx(np.log(slow[1] / slow[0]))


def test_creases_and_panels_of_one_name_are_one_suspect(forward):
    model = replace(forward.model, names={"crease": ("upper", "lower"), "panel": ("held", "flap", "flap")})
    every = suspects(model, forward.recordings, forward.drive)
    found = [(s.site, s.entities) for s in every if s.effect == "crease_set"]
    assert found == [("upper", (0,)), ("lower", (1,)), ("all creases", None)]
    (drag,) = (s for s in every if s.effect == "air_drag")
    assert drag.site == "flap" and np.all(model.triangle_panel[list(drag.entities or ())] > 0)
    assert len(drag.entities or ()) == np.count_nonzero(model.triangle_panel > 0)
    same = replace(model, names={"crease": ("fold", "fold")})
    sites = [s.site for s in suspects(same, forward.recordings, forward.drive) if s.effect == "crease_set"]
    assert sites == ["fold"]


def test_of_many_more_creases_than_channels_all_are_suspected_together(forward):
    every = suspects(forward.model, forward.recordings, forward.drive)
    assert told_apart(every, 1) == every
    assert {s.site for s in told_apart(every, 0) if s.kind in ("crease", "panel")} == {"all creases", "all panels"}


def test_one_number_cannot_have_two_values(forward):
    """All creases share an effect with each of them, all channels likewise; two creases do not, nor two channels."""
    every = {s.label: s for s in suspects(forward.model, forward.recordings, forward.drive)}
    one, two, each = (every[f"crease_friction at {s}"] for s in ("crease 0", "crease 1", "all creases"))
    assert distinct_sites(one, two) and distinct_sites(two, one) and not distinct_sites(one, one)
    assert not distinct_sites(one, each) and not distinct_sites(each, two)
    left, right = (every[f"angle_offset at channel fold{n}"] for n in (1, 2))
    assert distinct_sites(left, right) and not distinct_sites(left, every["angle_offset at the measurement"])
    assert distinct_sites(left, every["angle_scale at channel fold1"])


def test_a_recorder_is_as_likely_to_be_wrong_as_any_of_its_channels_is(forward):
    counts = {
        s.site: s.sites for s in suspects(forward.model, forward.recordings, forward.drive) if s.effect == "angle_scale"
    }
    channels = len(counts) - 1
    assert channels > 1 and counts.pop("the measurement") == 2 and set(counts.values()) == {2 * channels}


def test_all_suspects_share_a_program(forward):
    """Compiling one for each would take longer than running it."""
    every = forward.admitted(suspects(forward.model, forward.recordings, forward.drive, forward.parameters))
    assert len({s.effect for s in every}) > 20 and {s.effect for s in every} <= set(forward.shared)


def test_a_motion_that_is_measured_in_several_ways_is_predicted_as_each_alone(forward):
    every = suspects(forward.model, forward.recordings, forward.drive)
    few = [
        s for s in every if s.effect in ("angle_scale", "angle_offset") or s.label == "crease_stiffening at crease 1"
    ]
    hypotheses = [Hypothesis(), *(Hypothesis((s,)) for s in few)]
    thetas = [np.concatenate([np.ones(3), [0.1 * f.scale for f in h.free]]) for h in hypotheses]
    together = forward.predict(hypotheses, thetas)
    for k, (h, t) in enumerate(zip(hypotheses, thetas, strict=True)):
        for values, alone in zip(together, forward.predict(h, [t]), strict=True):
            np.testing.assert_allclose(values[k], alone[0], rtol=0, atol=1e-9)


def test_a_segments_memory_does_not_depend_on_which_others_are_asked_for(forward):
    """The largest fold of the past is that of the whole recording before the segment."""
    every = suspects(forward.model, forward.recordings, forward.drive)
    mullins = Hypothesis((next(s for s in every if s.effect == "crease_mullins"),))
    theta = np.array([1.0, 1.0, 1.0, 1e-4, 0.3])
    whole = forward.predict(mullins, [theta])
    for b in (0, len(forward.blocks) - 1):
        assert np.array_equal(forward.predict(mullins, [theta], blocks=[b])[0], whole[b], equal_nan=True)
    # what was folded that far before is softened: a softer crease than that of the first segment's start
    fresh = RigidRollouts(subject(3), [forward.recordings[0].window(2.5, 3.0)], segment=0.5)
    last = fresh.predict(mullins, [theta])[0][0]
    assert np.abs(whole[-1][0][: len(last)] - last[: len(whole[-1][0])]).max() > 1e-4


@pytest.mark.parametrize(
    "kept",
    [
        np.concatenate(
            [[0], np.arange(1, 40, 3), np.arange(40, 60), np.arange(60, 120, 7)]
        ),  # the median step is short
        np.concatenate([np.arange(0, 100, 10), np.arange(100, 104)]),  # and long, with frames close together at the end
    ],
)
def test_frames_at_uneven_times_are_predicted_as_those_of_an_even_film(kept):
    whole = record(panels=2, duration=2.0, rate=60)
    late = np.where(np.arange(len(kept)) % 2, 0.004, 0.0)  # off any grid
    channels = {n: replace(c, values=c.values[kept]) for n, c in whole.channels.items()}
    some = replace(whole, times=whole.times[kept] + late, channels=channels)
    dense = replace(whole, times=whole.times)
    even, uneven = (RigidRollouts(subject(2), [r], tied=False) for r in (dense, some))
    start = even.blocks[0]
    uneven.blocks = [replace(b, pose=start.pose, rates=start.rates) for b in uneven.blocks]
    at = np.array([[f.start for f in even.subject.nominals]])
    (film,), (found,) = (f.predict(Hypothesis(), at, np.zeros((1, 1, f.local))) for f in (even, uneven))
    smooth = CubicSpline(whole.times, film[0])(some.times)
    np.testing.assert_allclose(found[0], smooth, atol=2e-4 * np.ptp(film))

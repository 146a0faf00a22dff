"""Whole diagnoses of swings with known answers: the word, what is named, its site and its strength."""

import numpy as np
import pytest

from origami_sim.device.device import device_module
from origami_sim.device.scene import scene_settings
from origami_sim.diagnose import Options, diagnose
from origami_sim.drive import Drive
from origami_sim.hypotheses.subject import alignments
from origami_sim.model import State
from origami_sim.predict import rollouts
from origami_sim.recording import Channel, Recording
from origami_sim.solve.motion.dynamics import simulate
from tests.diagnose.strips import record, subject

FRICTION = {"crease_friction": {"friction_moment": (2e-5, [1])}}
LOOPS = ("crease_friction", "crease_hysteresis", "air_drag", "crease_stiffening", "crease_offset", "mass_damping")
SMALL = {"duration": 4.0, "panels": 3, "rate": 100}


def test_friction_is_found_with_its_strength_and_the_fit_improves():
    found = diagnose(subject(3), [record(FRICTION, **SMALL)], catalogue=LOOPS)
    assert found.verdict in ("MECHANISM", "TIE")
    row = next(c for c in found.candidates if c.label == "crease_friction at crease 1")
    assert found.chosen[0] == row.label
    moment = next(n for n in row.numbers if n.label == "crease_friction.friction_moment")
    assert moment.value == pytest.approx(2e-5, rel=0.03)  # the memory at a segment's start is read from the recording
    # alone, or with something else that is too small to be told
    assert found.marginals[row.label] > 0.99 and row.probability > 0.5
    before, after, noise = (np.sum(np.square(e)) for e in (found.error_refitted, found.error_after, found.noise))
    assert (before - after) / (before - noise) > 0.9, "of what could be removed on held-out data"
    assert found.exit_code >= 10 and found.candidates[0].odds > 0


@pytest.mark.parametrize("seed", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_a_crease_that_sticks_is_found_though_no_derivative_promises_it(seed):
    """From the model without friction a stiffening crease promises more, and leaves seventeen times the noise."""
    also = ("crease_stiffening", "crease_quadratic_damping", "crease_relaxation", "air_drag", "tracker_lag")
    swing = record(FRICTION, panels=3, duration=2.5, rate=80, size=0.6, seed=seed)
    others = ("crease_friction", "angle_offset", "clock_delay")
    found = diagnose(subject(3), [swing], catalogue=(*others, *also))
    assert found.chosen == ["crease_friction at crease 1"] and found.verdict == "MECHANISM"
    moment = next(n for n in found.candidates[0].numbers if n.label == "crease_friction.friction_moment")
    assert moment.value == pytest.approx(2e-5, rel=0.05)
    rows = [c.probability for c in found.candidates]
    assert rows[0] <= found.probability + 1e-9 and found.outside > 0.01, "of the law or of one that it imitates"
    assert sum(rows) + found.outside + found.unfitted == pytest.approx(1.0)


def test_words_and_numbers_are_the_same_on_any_number_of_threads(tmp_path, monkeypatch):
    """To the last byte, though segments are simulated in several parts."""
    monkeypatch.setattr(rollouts, "TOGETHER", 8)
    swing, said = record(FRICTION, panels=3, duration=1.5, rate=60), set()
    for threads in (1, 2):
        found = diagnose(subject(3), [swing], Options(threads=threads), catalogue=("crease_friction", "angle_offset"))
        found.seconds, found.settings["threads"] = {}, None
        found.save_json(tmp_path / "found.json")
        said.add((tmp_path / "found.json").read_bytes())
    assert len(said) == 1


def test_nothing_is_found_where_nothing_is_missing():
    found = diagnose(subject(3), [record(seed=4, **SMALL)], catalogue=LOOPS)
    assert found.verdict == "ADEQUATE"
    assert max(np.array(found.error_after) / found.noise) < 1.1


def test_a_wrong_parameter_is_called_a_parameter():
    found = diagnose(subject(3), [record(factors={("crease", "stiffness"): 1.1}, **SMALL)], catalogue=LOOPS)
    assert found.verdict == "PARAMETER" and "crease.stiffness" in found.chosen
    numbers = {n.label: n for n in found.candidates[0].numbers}
    stiffness, mass = numbers["crease.stiffness"], numbers["inertia.mass"]
    assert stiffness.low < 1.1 < stiffness.high
    assert stiffness.value / mass.value == pytest.approx(1.1, abs=0.01), "a frequency tells no more than the ratio"


def test_an_offset_of_one_encoder_is_the_measurement():
    r = record(**SMALL)
    r.channels["fold1"].values[:] += 0.03
    found = diagnose(subject(3), [r], catalogue=(*LOOPS, "angle_offset"))
    assert found.verdict == "MEASUREMENT" and found.chosen[0] == "angle_offset at channel fold1"


@pytest.mark.slow
def test_wrong_zeros_of_two_encoders_are_found_beside_each_other():
    r = record(**SMALL)
    for name, zero in (("fold1", 0.03), ("fold2", -0.02)):
        r.channels[name].values[:] += zero
    found = diagnose(subject(3), [r], catalogue=("angle_offset", "angle_scale", "crease_friction"))
    assert found.verdict == "MEASUREMENT"  # several errors, all of the recorder
    best = found.candidates[0]
    zeros = {s: n for s, n in zip(best.sites, best.numbers[-2:], strict=True)}
    assert set(zeros) == {"channel fold1", "channel fold2"}
    for site, truth in (("channel fold1", 0.03), ("channel fold2", -0.02)):
        assert zeros[site].value == pytest.approx(truth, abs=1e-4)
        assert zeros[site].low < truth < zeros[site].high
    assert set(found.patch) >= {"angle_offset.angle_offset@0", "angle_offset.angle_offset@1"}


@pytest.mark.slow
def test_a_large_error_of_the_scale_is_the_measurement():
    found = diagnose(subject(3), [record(scale=0.7, **SMALL)], catalogue=(*LOOPS, "angle_scale"))
    assert found.verdict == "MEASUREMENT" and found.chosen[0] == "angle_scale at the measurement"
    scale = next(n for n in found.candidates[0].numbers if n.label == "angle_scale.angle_scale")
    assert scale.high - scale.low < 0.06
    assert abs(scale.value + 0.3) < 3.0 * (scale.high - scale.low) / 3.92  # one draw of the noise


@pytest.mark.slow
def test_an_alignment_within_what_is_known_is_the_measurement():
    aligned = subject(3).beside(alignments({"angle_scale.angle_scale": 0.02}))
    found = diagnose(aligned, [record(scale=0.96, **SMALL)], catalogue=LOOPS[:3])
    assert found.verdict == "MEASUREMENT" and found.chosen == ["angle_scale.angle_scale"]
    assert found.sentence.startswith("Aligning the recording is enough: angle_scale")
    assert found.patch["angle_scale.angle_scale"] == pytest.approx(-0.04, abs=0.02)


def test_more_loss_at_one_crease_is_found_where_the_model_has_that_loss():
    r = record({"crease_viscosity": {"viscosity": (1.2e-5, [1])}}, **SMALL)
    found = diagnose(subject(3), [r], catalogue=("crease_viscosity", "crease_friction", "mass_damping"))
    assert found.verdict == "MECHANISM" and found.chosen == ["crease_viscosity at crease 1"]
    more = found.candidates[0].numbers[-1]
    assert more.low < 8e-6 < more.high and more.value == pytest.approx(8e-6, rel=0.15)


@pytest.mark.slow
def test_two_effects_are_found_together():
    both = {**FRICTION, "air_drag": {"drag_coefficient": (2.0, None)}}
    found = diagnose(subject(), [record(both, duration=10.0)], catalogue=(*LOOPS, "crease_mullins"))
    assert found.verdict == "SEVERAL"
    assert set(found.candidates[0].effects) == {"crease_friction", "air_drag"}


@pytest.mark.slow
def test_false_alarms_are_counted_over_a_hundred_nulls():
    """Half of them with parameters drawn from their priors. At most 5 %, which is nominal, plus two standard errors."""
    alarms = []
    for seed in range(100):
        rng = np.random.default_rng([seed, 7])
        factors = {} if seed % 2 else {("crease", "stiffness"): 1 + 0.05 * rng.normal()}
        made = record(seed=seed, factors=factors, noise=float(rng.choice([1e-3, 3e-3])), **SMALL)
        found = diagnose(subject(3), [made], catalogue=LOOPS)
        if found.verdict not in ("ADEQUATE", "PARAMETER"):
            alarms.append((seed, found.verdict, found.chosen))
    assert len(alarms) <= 9, alarms


@pytest.mark.slow
def test_nulls_are_not_blamed_with_the_whole_catalogue_to_choose_from():
    """As they are, with a parameter off, and with a scale off: where that is named, it is no alarm."""
    alarms = []
    for seed in range(12):
        rng = np.random.default_rng([seed, 7])
        off, scale = 1 + 0.05 * rng.normal(), 1 + 0.02 * rng.normal()
        made = record(
            seed=seed,
            factors={("crease", "stiffness"): off} if seed % 3 == 1 else {},
            scale=scale if seed % 3 == 2 else 1.0,
            noise=float(rng.choice([1e-3, 3e-3])),
            **SMALL,
        )
        found = diagnose(subject(3), [made])
        quiet = ("ADEQUATE", "PARAMETER", *(("MEASUREMENT",) if seed % 3 == 2 else ()))
        if found.verdict not in quiet and "nominal" not in found.chosen:
            alarms.append((seed, found.verdict, found.chosen))
    assert len(alarms) <= 1, alarms


def test_two_that_do_the_same_are_a_tie_with_an_experiment():
    """A crease whose rest angle is off and a panel whose weight is, in a small swing of one crease."""
    off = {"crease_offset": {"offset_moment": (3e-6, [0])}}
    swing = record(off, **SMALL | {"panels": 2}, size=0.3)
    found = diagnose(subject(2), [swing], catalogue=("crease_offset", "eccentric_weight", "crease_friction"))
    assert found.verdict == "TIE"
    both = {"crease_offset at crease 0", "eccentric_weight at panel 1"}
    assert both <= set(found.chosen) <= both | {"nothing"}
    assert found.experiments and set(found.experiments[0].separates) - {"nominal"} == both
    told = [e.information for e in found.experiments]
    assert told == sorted(told, reverse=True) and 0.0 <= told[0] <= found.experiments[0].entropy


@pytest.mark.slow
def test_what_the_catalogue_lacks_is_unknown_and_described():
    found = diagnose(subject(3), [record(FRICTION, **SMALL)], catalogue=("crease_stiffening", "crease_offset"))
    assert found.verdict == "UNKNOWN"
    assert "moment at crease 1" in found.sentence or "acts at crease 1" in found.sentence
    assert "takes energy" in found.sentence


def test_recordings_that_excite_no_suspect_test_none():
    """The start of a free swing can take the place of a late clock."""
    swing = record({"crease_friction": {"friction_moment": (2e-5, None)}}, **SMALL | {"panels": 2})
    found = diagnose(subject(2), [swing], catalogue=("clock_delay",))
    assert found.verdict == "UNTESTABLE" and not found.chosen and not found.patch
    assert any("Not tested" in n and "clock_delay" in n for n in found.notes)


CHAIN = """
from origami_sim import Drive, Sheet, strip

def build(length_1="30 mm", length_2="30 mm", length_3="25 mm", mass_1="1.1 g", mass_2="1 g", mass_3="0.9 g"):
    lengths, masses, x = [length_1, length_2, length_3], [mass_1, mass_2, mass_3], 0.01
    sheet = Sheet(strip([x, *lengths], 0.02), thickness="0.5 mm", panels="rigid")
    for k, (length, mass) in enumerate(zip(lengths, masses), 1):
        about = {"inertia": mass * length**2 / 12, "about": (0, 1, 0)}
        sheet.body(k, mass=mass, centre=(x + length / 2, 0, 0), **about)
        x += length
    sheet.crease(stiffness="0.1 mN m/rad", loss_time="8 ms").gravity((9.81, 0, 0)).fix(panels=[0])
    return sheet, Drive()
"""


def test_an_effect_that_numbers_absorbed_is_found_beside_one_that_is_known(tmp_path):
    """A tip that is heavier passes for a panel that is longer than it can be, until the drag beside it is fitted."""
    (tmp_path / "chain.py").write_text(CHAIN)
    module = device_module(str(tmp_path / "chain.py"))
    model, parameters, _ = module.build(scene_settings(module))
    richer, ends = model.with_effects("air_drag", "added_mass"), np.flatnonzero(model.position[:, 0] > 0.0949)
    real = parameters.for_model(richer).set("air_drag", "drag_coefficient", 2.0)
    real.set("added_mass", "added", 2e-5, ends).set("added_mass", "gravity_x", 9.81, ends)
    state = State.folded(richer, dict(enumerate((0.9, 0.3, 0.3))))
    motion = simulate(richer, real, Drive(), duration=4.0, rate=120, state=state)
    read = motion.creases[:, :, 0] + 1.7e-3 * np.random.default_rng(0).normal(size=motion.creases.shape[:2])
    channels = {f"c{k}": Channel(f"c{k}", "crease_angle", read[:, k], "rad", 1.7e-3, {"crease": k}) for k in range(3)}
    priors = {f"length_{k}": 2e-4 for k in (1, 2, 3)} | {f"mass_{k}": "1 %" for k in (1, 2, 3)}
    some = ("air_drag", "added_mass", "mass_damping")
    found = diagnose(module, [Recording("swing", motion.times, channels)], catalogue=some, priors=priors)
    assert found.verdict == "SEVERAL" and set(found.candidates[0].effects) == {"air_drag", "added_mass"}
    of = {n.label: n for n in found.candidates[0].numbers}
    assert of["added_mass.added"].each == " at each of 2 nodes"
    for label, true in (("air_drag.drag_coefficient", 2.0), ("added_mass.added", 2e-5)):
        assert of[label].low < true < of[label].high


def test_a_late_clock_promises_nothing_of_lags_at_which_it_was_not_simulated():
    """A crease that rubs was a moment that no law gives, as clocks late by half a swing were said to explain more."""
    size = {"panels": 3, "duration": 2.5, "rate": 80, "size": 0.6}
    rubs = record({"crease_friction": {"friction_moment": (2e-5, [1])}}, **size)
    some = (
        "crease_friction",
        "crease_stiffening",
        "crease_quadratic_damping",
        "crease_relaxation",
        "clock_delay",
        "tracker_lag",
    )
    found = diagnose(subject(3), [rubs], Options(threads=1), catalogue=some)
    assert found.verdict == "MECHANISM" and found.chosen == ["crease_friction at crease 1"], found.sentence

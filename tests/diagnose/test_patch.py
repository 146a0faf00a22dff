"""Calibrations that change an effect which a model has, and what a verdict says of such a finding."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from origami_sim.device.scene import read_calibration, scene_module, scene_settings
from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.hypotheses.hypothesis import Hypothesis, apply
from origami_sim.hypotheses.suspects import suspects
from origami_sim.model.entities import located
from origami_sim.report.patch import additions, read_additions, switched_on, write_patch
from origami_sim.verdict.words import say
from tests.diagnose.strips import hanging, record

VISCOSITY = ("crease_viscosity", "viscosity")


def table(text: dict, tmp_path):
    return read_additions({"crease_viscosity": text}, tmp_path / "patched.toml")


@pytest.mark.parametrize("change", [2e-6, -3e-6])
def test_more_of_an_effect_is_patched_in_as_it_was_fitted(tmp_path, change):
    """The simulator runs a patched calibration with the numbers of the hypothesis that was fitted."""
    model, parameters = hanging(3)
    (lower,) = (
        s
        for s in suspects(model, [record(panels=3, duration=1.0)], Drive(), parameters)
        if s.effect == "crease_viscosity" and s.entities == (1,)
    )
    assert lower.more
    fitted = apply(parameters, Hypothesis((lower,)), [change], model)
    (found,) = additions(
        SimpleNamespace(
            patch={"crease_viscosity.viscosity@1": change},
            changed=["crease_viscosity"],
            candidates=[],
            recordings=["swing"],
            verdict="MECHANISM",
        ),  # type: ignore[arg-type]
        read_calibration("pendulum_chain"),
    )
    assert found.more
    again = table({"entities": list(found.entities or ()), "more": True, **found.values}, tmp_path)
    _, patched = switched_on(again, model, parameters)
    np.testing.assert_array_equal(patched[VISCOSITY], fitted[VISCOSITY])
    assert patched[VISCOSITY][1, 0] - parameters[VISCOSITY][1, 0] == pytest.approx(change)
    assert patched[VISCOSITY][0, 0] == parameters[VISCOSITY][0, 0]


def test_more_adds_to_a_table_above_it_and_stays_within_bounds(tmp_path):
    model, parameters = hanging(3)
    first = {"entities": [1], "friction_moment": 1e-4}
    trees = [
        {"crease_friction": [first, {"entities": [1], "more": True, "friction_moment": by}]} for by in (5e-5, -3e-4)
    ]
    values = [
        switched_on(read_additions(t, tmp_path / "p.toml"), model, parameters)[1]["crease_friction", "friction_moment"]
        for t in trees
    ]
    assert values[0].ravel() == pytest.approx([0.0, 1.5e-4]) and values[1].ravel() == pytest.approx([0.0, 0.0])
    with pytest.raises(InputError, match=r"no such effect to have more of.*effects\.crease_friction\.more"):
        switched_on(read_additions({"crease_friction": [{"more": True}]}, tmp_path / "p.toml"), model, parameters)
    with pytest.raises(InputError, match=r"not a switch.*effects\.crease_viscosity\.more.*2"):
        table({"more": 2}, tmp_path)
    with pytest.raises(InputError, match="out of its bounds"):
        table({"viscosity": -1e-6}, tmp_path)


@pytest.mark.parametrize(("change", "words"), [(2e-6, "more"), (-2e-6, "less")])
def test_what_the_model_has_is_not_said_to_be_lacking(change, words):
    model, parameters = hanging(3)
    every = suspects(model, [record(panels=3, duration=1.0)], Drive(), parameters)
    lower = next(s for s in every if s.effect == "crease_viscosity" and s.entities == (1,))
    ends = np.array([change - 2e-9]), np.array([change + 2e-9])
    known = {"deviations": lambda: np.array([1e-9]), "intervals": lambda: ends}
    f = SimpleNamespace(hypothesis=Hypothesis((lower,)), free=lower.free, theta=[change], at_bound=[False], **known)
    said = say(f)  # type: ignore[arg-type]
    assert said.startswith(words) and "than stated at crease 1" in said
    low, high = said.partition("95 %: ")[2].rstrip(")").split(" to ")
    assert low != high, "an interval has two ends"
    lacking = replace(lower, more=False)
    other = SimpleNamespace(**{**vars(f), "hypothesis": Hypothesis((lacking,))})
    assert "stated" not in say(other)  # type: ignore[arg-type]


def test_a_headline_of_many_effects_has_the_devices_first_and_leaves_intervals_to_the_table():
    model, parameters = hanging(3)
    every = suspects(model, [record(panels=3, duration=1.0)], Drive(), parameters)
    names = ("angle_offset", "crease_friction", "air_drag")
    mine = tuple(next(s for s in every if s.effect == n) for n in names)

    def said(count: int) -> str:
        free = tuple(n for s in mine[:count] for n in s.free)
        theta = np.array([n.start + n.scale for n in free])
        known = {"deviations": lambda: 0.01 * theta, "intervals": lambda: (0.98 * theta, 1.02 * theta)}
        f = SimpleNamespace(hypothesis=Hypothesis(mine[:count]), free=free, theta=theta, at_bound=0 * theta, **known)
        return say(f)  # type: ignore[arg-type]

    places = [said(3).index(words) for words in ("dry friction", "air drag", "zero error of the angle")]
    assert places == sorted(places) and "95 %" not in said(3)
    assert said(2).startswith("dry friction") and said(2).count("95 %: ") == 2


def test_an_error_of_one_channel_is_the_recordings_and_not_patched_into_the_model(tmp_path):
    """No model has channels, so that it could not be read back; it is named in the file."""
    numbers = {"crease_friction.friction_moment@1": 1e-4, "angle_offset.angle_offset@1": 0.02}
    sites = ["crease 1", "channel fold2"]
    said, effects = [SimpleNamespace(value=v, label=n) for n, v in numbers.items()], ["crease_friction", "angle_offset"]
    best = SimpleNamespace(numbers=said, sites=sites, effects=effects)
    found = SimpleNamespace(
        patch=numbers, changed=[], candidates=[best], recordings=["swing"], verdict="SEVERAL", sentence="Two."
    )
    settings = read_calibration("pendulum_chain")
    assert [a.effect for a in additions(found, settings)] == ["crease_friction"]  # type: ignore[arg-type]
    path = write_patch(tmp_path / "patched.toml", settings, found, scene="pendulum_chain")  # type: ignore[arg-type]
    assert "Left out, as it is an error of the recording: angle_offset at channel fold2" in path.read_text()
    again = scene_settings(scene_module("pendulum_chain"), path)
    assert [a.effect for a in again.effects] == ["crease_friction"]
    numbers["angle_offset.angle_offset"] = numbers.pop("angle_offset.angle_offset@1")  # of all channels
    assert [a.effect for a in additions(found, settings)] == ["crease_friction", "angle_offset"]  # type: ignore[arg-type]


def test_a_number_that_a_suspect_fixes_leaves_every_effect_at_its_site():
    """It comes before those that were fitted."""
    numbers = {"crease_contact.contact_side@0": -1.0, "crease_friction.friction_moment@1": 1e-4}
    numbers["crease_contact.contact_stiffness@0"] = 2e-3
    said = [SimpleNamespace(value=v, label=n) for n, v in numbers.items()]
    best = SimpleNamespace(numbers=said, sites=["crease 1", "crease 0"], effects=["crease_friction", "crease_contact"])
    found = SimpleNamespace(patch=numbers, changed=[], candidates=[best], recordings=["swing"], verdict="SEVERAL")
    added = additions(found, read_calibration("pendulum_chain"))  # type: ignore[arg-type]
    assert {a.effect: (a.site, a.entities) for a in added} == {
        "crease_contact": ("crease 0", (0,)),
        "crease_friction": ("crease 1", (1,)),
    }
    assert dict(next(a for a in added if a.effect == "crease_contact").values)["contact_side"] == -1.0


def test_numbers_of_bodies_are_patched_and_read_by_the_names_that_tables_show(tmp_path):
    module = scene_module("pendulum_chain")
    settings = scene_settings(module)
    model, parameters, *_ = module.build(settings)
    last = model.name("panel", model.panel_count - 1)
    assert located(f"body.mass[{last}]", model, parameters).entities.tolist() == [model.panel_count - 1]
    bare = replace(model, names={})
    assert located("body.mass[panel 1]", bare, parameters).entities.tolist() == [1]
    found = SimpleNamespace(
        candidates=(), verdict="PARAMETER", sentence="", recordings=["swing"], changed=(),
        patch={f"body.mass[{last}] (factor)": 1.2, "inertia.mass[0] (added)": 0.001},
    )  # fmt: skip
    path = write_patch(tmp_path / "patched.toml", settings, found, scene="pendulum_chain")
    again = read_calibration(path)
    _, changed = switched_on(again.effects, model, parameters)
    assert changed["body", "mass"][-1, 0] == pytest.approx(1.2 * parameters["body", "mass"][-1, 0])
    assert np.array_equal(changed["body", "mass"][:-1], parameters["body", "mass"][:-1])
    assert changed["inertia", "mass"][0, 0] == pytest.approx(parameters["inertia", "mass"][0, 0] + 0.001)
    with pytest.raises(InputError, match="can only be changed"):
        read_additions({"body": {"mass": 0.1}}, tmp_path)
    with pytest.raises(InputError, match="no such entity"):
        switched_on(
            read_additions({"body": {"mass": 2.0, "times": True, "entities": [9]}}, tmp_path), model, parameters
        )

"""Where effects are suspected: stretches of a beam, its ends and middle, single panels and their edges."""

from importlib import import_module

import numpy as np
import pytest

from origami_sim import Drive, Sheet, strip
from origami_sim.device.scene import scene_settings
from origami_sim.effects import CATALOGUE
from origami_sim.hypotheses.hypothesis import Hypothesis, along_each_axis, apply
from origami_sim.hypotheses.suspects import suspects, told_apart
from origami_sim.model import node_mass
from origami_sim.model.bodies import rigid
from origami_sim.model.places import across, along, points, stretches
from origami_sim.recording import Channel, Recording

UNEVEN = {"crease_softness", "panel_softness", "remanence_error"}


@pytest.fixture(scope="module")
def scenes():
    def built(name):
        module = import_module(f"origami_sim.scenes.{name}")
        return module.build(scene_settings(module))[:3]

    return {name: built(name) for name in ("mae_cantilever", "magnetic_arch", "pendulum_chain", "box")}


def asked(model, parameters, drive, channels=1):
    channel = Channel("a", "panel_angle", np.zeros(5), "rad", 1e-3, {"panel": 0})
    every = suspects(model, [Recording("r", np.arange(5) / 10, {"a": channel})], drive, parameters)
    return told_apart(every, channels)


def test_a_mass_on_a_single_panel_is_that_of_all_nodes_that_move():
    sheet = Sheet(strip([0.01, 0.03], 0.02), thickness="1 mm", panels="rigid").mass(1, "3 g")
    model, parameters = sheet.crease(stiffness="2 mN m/rad").gravity().fix(panels=[0]).build()
    mass = next(s for s in asked(model, parameters, Drive()) if s.effect == "added_mass")
    assert mass.entities is not None and mass.free[0].entities == mass.entities
    model = model.with_effects("added_mass")
    parameters = parameters.for_model(model)
    loaded = apply(parameters, Hypothesis((mass,)), [1e-4], model)
    before, after = (node_mass(model, p).sum() for p in (parameters, loaded))
    assert mass.site == "the body" and after - before == pytest.approx(1e-4 * len(mass.entities))


def test_a_crease_loses_no_more_stiffness_than_it_has():
    sheet = Sheet(strip([0.01, 0.03, 0.02], 0.02), thickness="1 mm", panels="rigid")
    model, parameters = sheet.crease(stiffness=[2e-3, 5e-4]).gravity().fix(panels=[0]).build()
    soft = [s for s in asked(model, parameters, Drive(), channels=2) if s.effect == "crease_softness"]
    assert {s.site: s.free[0].lower for s in soft} == {"crease 0": -2e-3, "crease 1": -5e-4, "all creases": -5e-4}


def test_a_beam_is_suspected_in_quarters_and_thirds(scenes):
    model, *_ = scenes["mae_cantilever"]
    every = [s for s in asked(*scenes["mae_cantilever"]) if s.stretch]
    assert {s.effect for s in every} == UNEVEN
    creases = {s.site: s for s in every if s.effect == "crease_softness"}
    assert len(creases) == 7 and all(s.kind == "crease" for s in creases.values())
    place = along(model, model.position[model.creases[:, 1]])
    assert place is not None
    thirds = [creases[f"the creases of the {w} third"].entities for w in ("first", "middle", "last")]
    assert sorted(np.concatenate(thirds)) == list(range(len(model.creases)))
    for n, mine in enumerate(thirds):
        assert place[list(mine)].min() > n / 3 - 1e-6 and place[list(mine)].max() < (n + 1) / 3 + 1e-6
    held = model.position[~np.any(model.free, axis=1), 0].mean()
    first = model.position[model.creases[list(creases["the creases of the first quarter"].entities), 1], 0]
    last = model.position[model.creases[list(creases["the creases of the last quarter"].entities), 1], 0]
    assert abs(first.mean() - held) < abs(last.mean() - held), "counted from the clamp"


def test_a_beam_is_suspected_of_a_taper_from_its_clamp_on(scenes):
    model, parameters, drive = scenes["mae_cantilever"]
    (taper,) = (s for s in asked(model, parameters, drive) if s.effect == "crease_taper")
    assert taper.site == "all creases" and [f.name for f in taper.free] == ["taper"]
    richer = model.with_effects("crease_taper")
    put = apply(parameters, Hypothesis((taper,)), [0.3], richer)
    own = parameters["crease", "stiffness"][:, 0]
    assert put["crease_taper", "stiffness"][:, 0] == pytest.approx(own)
    x = model.position[model.creases[:, 1], 0]  # the root of its beam is at zero
    expected = x / model.position[:, 0].max() - 0.5
    assert put["crease_taper", "along"][:, 0] == pytest.approx(expected, abs=1e-12)
    for name in ("pendulum_chain", "box"):
        assert not [s for s in asked(*scenes[name]) if s.effect == "crease_taper"]


def test_all_creases_of_a_beam_are_no_sum_of_stretches_that_overlap(scenes):
    model, *_ = scenes["mae_cantilever"]
    every = asked(*scenes["mae_cantilever"])
    (whole,) = (s for s in every if s.effect == "crease_softness" and s.site == "all creases")
    assert whole.entities == tuple(range(len(model.creases))) == whole.free[0].entities
    (other,) = (s for s in every if s.effect == "crease_set" and s.kind == "crease")
    assert other.entities is None


def test_what_has_few_creases_has_no_stretches(scenes):
    for name in ("pendulum_chain", "box"):
        assert not [s for s in asked(*scenes[name]) if s.stretch]
        assert not stretches(scenes[name][0], "crease")
    assert not [s for s in asked(*scenes["mae_cantilever"], channels=40) if s.stretch], "each crease by itself"
    assert not stretches(scenes["mae_cantilever"][0], "node")
    assert along(scenes["box"][0], np.zeros((1, 3))) is None


def test_masses_are_suspected_at_the_panels_and_at_their_edges(scenes):
    model, parameters, drive = scenes["pendulum_chain"]
    every = {s.label: s for s in asked(model, parameters, drive)}
    assert {n for n in every if n.startswith("mass_error")} == {
        "mass_error at the body", "mass_error at arm1", "mass_error at arm2"
    }  # fmt: skip
    assert {n for n in every if n.startswith("added_mass")} == {"added_mass at arm1", "added_mass at arm2"}
    tip = every["added_mass at arm2"]
    richer = model.with_effects("added_mass")
    values = apply(parameters, Hypothesis((tip,)), [1e-3], richer)
    assert values["added_mass", "gravity_z"] == pytest.approx(parameters["gravity", "gravity_z"])
    more = node_mass(richer, values)[:, 0] - node_mass(model, parameters)[:, 0]
    assert more[list(tip.entities or ())] == pytest.approx(1e-3) and more.sum() == pytest.approx(2e-3)
    assert model.position[list(tip.entities or ()), 2] == pytest.approx(model.position[:, 2].min())


def test_a_rigid_panel_that_is_heavier_is_so_by_its_mass_points(scenes):
    model, parameters, drive = scenes["pendulum_chain"]
    model, parameters = rigid(model, parameters)
    assert model.panels == "rigid" and len(model.carriers)
    (upper,) = (s for s in asked(model, parameters, drive) if s.label == "mass_error at arm1")
    richer = model.with_effects("mass_error")
    values = apply(parameters, Hypothesis((upper,)), [0.1], richer)
    more = node_mass(richer, values)[:, 0] - node_mass(model, parameters)[:, 0]
    panel = model.triangle_panel[[n == "arm1" for n in (model.name("panel", p) for p in model.triangle_panel)]][0]
    assert more.sum() == pytest.approx(0.1 * parameters["body", "mass"][panel, 0])


def test_a_beam_may_carry_a_mass_at_its_ends_or_in_its_middle(scenes):
    places = [site for site, *_ in points(scenes["mae_cantilever"][0])]
    assert places == ["the middle", "the last end"], "the clamp carries nothing"
    model, *_ = scenes["magnetic_arch"]
    ((site, kind, nodes),) = points(model)
    assert (site, kind) == ("the middle", "body")
    assert np.ptp(model.position[list(nodes), 0]) < 1e-9, "one station across the strip"
    assert {"added_mass at the middle"} == {
        s.label for s in asked(*scenes["magnetic_arch"]) if s.effect == "added_mass"
    }


def test_a_field_that_grows_is_one_for_all_panels_and_knows_the_plane_of_motion(scenes):
    model, parameters, drive = scenes["box"]
    for name in ("box", "mae_cantilever"):
        (slope,) = (s for s in asked(*scenes[name]) if s.effect == "field_slope")
        assert slope.entities is None
    assert np.abs(across(scenes["mae_cantilever"][0])) == pytest.approx([0, 1, 0])
    model, parameters, drive = scenes["mae_cantilever"]
    (slope,) = (s for s in asked(model, parameters, drive) if s.effect == "field_slope")
    values = apply(parameters, Hypothesis((slope,)), [0.5, 0.0, 0.0, 0.5], model.with_effects("field_slope"))
    assert np.abs(values["field_slope", "across_y"]) == pytest.approx(1.0)
    assert values["field_slope", "volume"] == pytest.approx(parameters["magnetic_torque", "volume"])


def test_what_has_a_direction_is_absent_in_all_its_components(scenes):
    """Or what is screened would be what the others do; where none of them shows it is no number of the evidence."""
    every = [s for name in ("box", "mae_cantilever") for s in asked(*scenes[name])]
    assert {"field_offset", "field_misalignment", "gravity_tilt", "poling_error"} <= {s.effect for s in every}
    for s in every:
        alike = [f for f in s.free if f.unit == s.free[0].unit]
        assert not any(f.start for f in alike) and list(s.strengths) == alike, s.label
    (stray,) = (s for s in asked(*scenes["mae_cantilever"]) if s.effect == "field_offset")
    assert [s.free[0].name[-1] for s in along_each_axis(stray)] == ["x", "y", "z"], "each is simulated by itself"


@pytest.mark.parametrize(("pull", "lean"), [((0, 0, -9.81), "xy"), ((9.81, 0, 0), "yz"), ((0, 9.81, 0), "xz")])
def test_gravity_is_suspected_to_lean_across_itself(pull, lean):
    """Along itself a lean would be another strength of gravity, which a wrong clock looks like."""
    model, parameters = Sheet(strip([0.02, 0.02], 0.02), thickness=1e-3).crease(stiffness=1e-3).gravity(pull).build()
    channel = Channel("a", "crease_angle", np.zeros(5), "rad", 1e-3, {"crease": 0})
    every = suspects(model, [Recording("r", np.arange(5.0), {"a": channel})], Drive(), parameters)
    (tilt,) = (s for s in every if s.effect == "gravity_tilt")
    assert [f.name for f in tilt.strengths] == [f"tilt_{axis}" for axis in lean]


def test_uneven_effects_are_those_of_families_with_stretches():
    uneven = {n for n, e in CATALOGUE.items() if e.uneven}
    assert uneven >= UNEVEN and all(CATALOGUE[n].family in ("crease", "bend", "triangle") for n in uneven)


def test_what_a_model_has_at_no_strength_is_a_suspect_and_sheets_may_lose_energy():
    module = import_module("origami_sim.scenes.magnetic_arch")
    model, parameters, drive = module.build(scene_settings(module).replace(relaxing_modulus=0.0, cells=6, rows=2))
    assert "mass_damping" in model.effects and "shell_membrane_relaxation" not in model.effects
    every = {s.effect: s for s in asked(model, parameters, drive)}
    assert {"mass_damping", "shell_membrane_relaxation", "shell_bending_relaxation"} <= set(every)
    loss = Hypothesis((every["shell_membrane_relaxation"], every["mass_damping"]))
    richer = model.with_effects("shell_membrane_relaxation")
    out = apply(parameters, loss, [0.3, *(f.start for f in loss.suspects[0].free[1:]), 7.0], richer)
    for c in ("11", "22", "66"):  # the loss is a share of the sheet's own stiffness
        name = f"stiffness_{c}"
        np.testing.assert_array_equal(out["shell_membrane_relaxation", name], parameters["shell_membrane", name])
    assert np.all(out["shell_membrane_relaxation", "share_1"] == 0.3)
    assert np.all(out["mass_damping", "decay_rate"] == 7.0)


def test_gravity_is_no_suspect_where_a_model_has_it_in_any_direction():
    def named(acceleration):
        sheet = Sheet(strip([0.02, 0.02], width=0.02), thickness="1 mm", material="pdms")
        model, parameters = sheet.crease(stiffness="1 mN m/rad").gravity(acceleration).fix(panels=[0]).build()
        return [s for s in asked(model, parameters, Drive()) if s.effect == "gravity"]

    assert not named((0.0, 0.0, -9.80665)) and not named((0.0, 9.81, 0.0))
    (lying,) = named((0.0, 0.0, 0.0))
    assert [f.start for f in lying.strengths] == [0.0, 0.0, 0.0]


def test_a_mass_has_one_name_where_the_end_of_a_strip_is_the_edge_of_its_last_panel():
    sheet = Sheet(strip([0.01, 0.03, 0.03, 0.025], 0.02), thickness="0.5 mm", panels="rigid")
    model, parameters = sheet.crease(stiffness=1e-4).gravity((9.81, 0, 0)).fix(panels=[0]).build()
    assert {site for site, *_ in points(model)} == {"the middle", "the last end"}
    added = [s for s in asked(model, parameters, Drive()) if s.effect == "added_mass"]
    assert [s.label for s in added] == [f"added_mass at panel {k}" for k in (1, 2, 3)]
    assert len({s.entities for s in added}) == len(added)

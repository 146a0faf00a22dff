"""Parameters, states and models: what they accept, and what they say when they do not."""

import math

import numpy as np
import pytest
from effects.kit import hinge, hinge_positions, strip

from origami_sim.effects import CATALOGUE
from origami_sim.errors import InputError
from origami_sim.model import Parameters, State, dihedral_angles


def test_defaults_have_one_value_per_entity():
    model = strip(3)
    p = Parameters(model)
    for effect in CATALOGUE.values():
        for q in effect.parameters:
            expected = (model.count(effect.family), 1) + ((q.knots,) if q.knots > 1 else ())
            assert p[effect.name, q.name].shape == expected
            assert np.all(p[effect.name, q.name] == q.default)
    assert p.worlds == 1


@pytest.mark.parametrize(
    "value, entities, worlds",
    [
        (2.0, None, 1),
        ([1.0, 2.0], None, 1),
        ([[1.0], [2.0]], None, 1),
        ([[1.0, 2.0, 3.0]], None, 3),
        (np.ones((2, 4)), None, 4),
        (5.0, 1, 1),
        ([[1.0, 2.0]], [1], 2),
        ([7.0, 8.0], [1, 0], 1),
    ],
)
def test_values_are_spread_over_entities_and_worlds(value, entities, worlds):
    p = Parameters(strip(3)).set("crease", "stiffness", value, entities)
    assert p["crease", "stiffness"].shape == (2, worlds)
    index = [0, 1] if entities is None else np.atleast_1d(entities)
    wanted = np.asarray(value, float)
    wanted = wanted.reshape(-1, 1) if wanted.ndim < 2 else wanted
    assert np.array_equal(p["crease", "stiffness"][index], np.broadcast_to(wanted, (len(index), worlds)))
    others = np.setdiff1d([0, 1], index)
    assert not np.any(p["crease", "stiffness"][others])


def test_tables_are_spread_over_entities_and_worlds():
    table = np.linspace(-1, 1, 33)
    for value, worlds in ((table, 1), (table[None, None], 1), (np.stack([table, 2 * table])[None], 2)):
        p = Parameters(strip(3)).set("crease_table", "resisting_moment", value)
        assert p["crease_table", "resisting_moment"].shape == (2, worlds, 33)
        assert np.array_equal(p["crease_table", "resisting_moment"][1, 0], table)


@pytest.mark.parametrize(
    "owner, name, value, words",
    [
        ("crease", "stiffness", -1.0, ["crease.stiffness", "-1", "0 to inf"]),
        ("crease", "rest_angle", [0.0, 4.0], ["crease.rest_angle", "4.0", "-3.14159 to 3.14159"]),
        ("crease", "stiffness", float("nan"), ["crease.stiffness", "finite"]),
        ("crease", "stiffness", math.inf, ["crease.stiffness", "finite"]),
        ("crease", "stiffness", [1.0, 2.0, 3.0], ["crease.stiffness", "shape", "(2, worlds)"]),
        ("crease", "stiffness", np.ones((2, 1, 33)), ["crease.stiffness", "shape"]),
        ("crease_table", "resisting_moment", np.zeros((2, 1, 32)), ["crease_table.resisting_moment", "shape"]),
        ("crease_table", "resisting_moment", np.zeros(32), ["crease_table.resisting_moment", "shape"]),
        ("inertia", "mass", 0.0, ["inertia.mass", "positive", "> 0 kg"]),
        ("inertia", "weight", 1.0, ["inertia.weight", "mass"]),
        ("folds", "stiffness", 1.0, ["folds.stiffness", "crease"]),
    ],
)
def test_wrong_parameters_are_named(owner, name, value, words):
    with pytest.raises(InputError) as e:
        Parameters(strip(3)).set(owner, name, value)
    for word in words:
        assert word in str(e.value), word


def test_values_on_the_bounds_are_accepted():
    p = Parameters(strip(3))
    for effect in CATALOGUE.values():
        for q in effect.parameters:
            for bound in q.bounds:
                if math.isfinite(bound):
                    p.set(effect.name, q.name, bound)


def test_entities_out_of_range_and_worlds_that_clash_are_named():
    p = Parameters(strip(3)).set("crease", "stiffness", np.ones((1, 3)))
    with pytest.raises(InputError, match="shape"):
        p.set("crease", "stiffness", 1.0, [2])
    with pytest.raises(InputError, match="shape"):
        p.set("crease", "stiffness", np.ones((1, 2)))
    assert p["crease", "stiffness"].shape == (2, 3), "a refused value leaves the old one"


def test_copies_are_independent_and_hashes_follow_the_values():
    p = Parameters(strip(3))
    q = p.copy()
    assert p.hash == q.hash
    q.set("crease", "stiffness", 1.0)
    assert p.hash != q.hash and not np.any(p["crease", "stiffness"])


def test_effects_are_added_and_removed_and_their_parameters_follow():
    model = strip(2, effects=("bars", "crease"))
    more = model.with_effects("gravity", without=("bars",))
    assert more.effects == ("crease", "gravity") and model.effects == ("bars", "crease")
    p = Parameters(model).set("crease", "stiffness", 3.0)
    carried = p.for_model(more)
    assert np.all(carried["crease", "stiffness"] == 3.0)
    assert np.all(carried["gravity", "gravity_z"] == -9.80665)
    with pytest.raises(InputError, match=r"bars\.stiffness"):
        carried["bars", "stiffness"]
    assert model.hash != more.hash and model.hash == strip(2, effects=("bars", "crease")).hash


def test_names_fall_back_to_numbers():
    model = hinge(names={"crease": ("spine",)})
    assert model.name("crease", 0) == "spine" and model.name("bar", 3) == "bar 3"
    assert model.count("contact") == model.count("coefficient") == 0
    assert model.count("triangle") == 2


def test_state_at_rest_takes_positions_for_all_worlds_or_each():
    model = hinge()
    assert State.at_rest(model, 3).x.shape == (4, 3, 3)
    folded = State.at_rest(model, 2, hinge_positions(0.5))
    assert folded.angles == pytest.approx(0.5)
    each = State.at_rest(model, 2, np.stack([hinge_positions(0.1), hinge_positions(0.2)], axis=1))
    assert each.angles[0] == pytest.approx([0.1, 0.2])
    assert each.step == -1 and np.all(each.status == -1) and each.worlds == 2
    copied = each.copy()
    copied.x[:] = 0
    assert np.any(each.x)


def test_dihedral_angles_of_no_hinges():
    assert dihedral_angles(np.zeros((4, 7, 3)), np.zeros((0, 4), int)).shape == (0, 7)

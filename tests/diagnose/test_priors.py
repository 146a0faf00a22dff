"""What is known of single creases: factors and additions by name, from the sidecar to the patched calibration."""

from types import SimpleNamespace

import numpy as np
import pytest

from origami_sim.device.scene import read_calibration, scene_module, scene_settings
from origami_sim.diagnose import diagnose, subject_of
from origami_sim.errors import InputError
from origami_sim.report.patch import additions, read_additions, switched_on
from tests.diagnose.strips import hanging, record

STIFFNESS, REST = ("crease", "stiffness"), ("crease", "rest_angle")


def test_a_share_and_an_addition_change_one_crease_each():
    priors = {"crease.stiffness[0]": "20 %", "crease.rest_angle[1]": "0.02 rad"}
    subject = subject_of(hanging(3), priors)
    stiff, rest = subject.nominals
    assert (stiff.name, stiff.unit, stiff.start, stiff.spread) == ("crease.stiffness[0] (factor)", "-", 1.0, 0.2)
    assert (rest.name, rest.unit, rest.start, rest.spread) == ("crease.rest_angle[1] (added)", "rad", 0.0, 0.02)
    plain = hanging(3)[1]
    changed = subject.build({stiff.name: 1.3, rest.name: -0.05})[1]
    np.testing.assert_allclose(changed[STIFFNESS][:, 0], plain[STIFFNESS][:, 0] * [1.3, 1.0])
    np.testing.assert_allclose(changed[REST][:, 0], plain[REST][:, 0] + [0.0, -0.05])
    np.testing.assert_array_equal(subject.build({})[1][STIFFNESS], plain[STIFFNESS])


def test_creases_go_by_their_name_and_a_shared_name_means_all_of_them():
    one = subject_of("pendulum_chain", {"crease_viscosity.viscosity[hinge2]": "10 %"})
    values = {one.nominals[-1].name: 2.0}
    ratio = one.build(values)[1]["crease_viscosity", "viscosity"] / one.build({})[1]["crease_viscosity", "viscosity"]
    np.testing.assert_allclose(ratio[:, 0], [1.0, 2.0])
    module = scene_module("crawler")
    regions = np.array(module.build(scene_settings(module))[0].names["crease"])
    crawler = subject_of("crawler", {"crease.stiffness[big end]": "10 %"})
    ratio = crawler.build({crawler.nominals[-1].name: 2.0})[1][STIFFNESS] / crawler.build({})[1][STIFFNESS]
    assert (regions == "big end").sum() > 1
    np.testing.assert_allclose(ratio[:, 0], np.where(regions == "big end", 2.0, 1.0))


def test_an_unknown_rest_angle_of_one_crease_is_refitted_and_nothing_is_missing():
    truth = {"crease": {"rest_angle": (0.06, [1])}}
    subject = subject_of(hanging(3), {"crease.stiffness": "5 %", "crease.rest_angle[1]": "0.05 rad"})
    found = diagnose(subject, [record(truth, panels=3, duration=3.0)], catalogue=["crease_friction", "air_drag"])
    assert (found.verdict, found.chosen) == ("PARAMETER", ["crease.rest_angle[1] (added)"])
    numbers = {n.label: n for n in found.candidates[0].numbers}
    rest = numbers["crease.rest_angle[1] (added)"]
    assert rest.value == pytest.approx(0.06, abs=2e-3)


def test_a_patch_keeps_what_was_refitted_of_one_crease(tmp_path):
    settings = read_calibration("pendulum_chain")
    patch = {"crease_viscosity.viscosity[hinge2] (factor)": 1.4, "mass_1": 0.09}
    found = SimpleNamespace(patch=patch, changed=[], candidates=[], recordings=["swing"], verdict="PARAMETER")
    (added,) = additions(found, settings)  # type: ignore[arg-type]
    assert (added.at, added.times, added.more) == ("hinge2", True, False)
    tree = {added.effect: [{"at": added.at, "times": added.times, **added.values}]}
    model, parameters, _ = scene_module("pendulum_chain").build(settings)
    _, changed = switched_on(read_additions(tree, tmp_path / "p.toml"), model, parameters)
    ratio = changed["crease_viscosity", "viscosity"] / parameters["crease_viscosity", "viscosity"]
    np.testing.assert_allclose(ratio[:, 0], [1.0, 1.4])
    for table, words in (
        ({"at": "hinge9", "viscosity": 1.0}, r"no crease of that name.*effects\.crease_viscosity\.at.*hinge1, hinge2"),
        ({"at": "hinge1", "entities": [0], "viscosity": 1.0}, "either at or entities"),
        ({"more": True, "times": True, "viscosity": 1.0}, "either more or times"),
    ):
        with pytest.raises(InputError, match=words):
            switched_on(read_additions({"crease_viscosity": [table]}, tmp_path / "p.toml"), model, parameters)


@pytest.mark.parametrize(
    "priors, words",
    [
        ({"crease.stiffness[hip]": "5 %"}, r"no crease of that name.*priors.*hip.*0 to 1"),
        ({"crease.stifness[0]": "5 %"}, r"no such parameter.*priors.*crease\.stiffness"),
        ({"crease.rest_angle[0]": "5 %"}, r"no share of zero.*priors\.crease\.rest_angle\[0\]"),
        ({"crease.rest_angle[0]": 0.02}, r"share or a unit.*0\.02 rad"),
        ({"crease.rest_angle[0]": "2 mm"}, r"wrong unit.*mm.*rad"),
        ({"crease.stiffness[0]": "-5 %"}, "not a standard deviation"),
    ],
)
def test_what_is_no_number_of_the_model_is_refused(priors, words):
    with pytest.raises(InputError, match=words) as caught:
        subject_of(hanging(3), priors)
    assert "\n" not in str(caught.value)

"""Target fold angles of a pattern as rest angles of a sheet, and what says so where they are not used."""

import numpy as np
import pytest

from origami_sim import Drive, Sheet, equilibrium, miura, read_pattern, strip
from origami_sim.design.design_file import read_design, write_design
from origami_sim.errors import InputError

SVG = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 60"><rect x="0" y="0" width="100" height="60"
fill="none" stroke="black"/><line x1="50" y1="0" x2="50" y2="60" stroke="red" stroke-opacity="0.25"/></svg>"""


def sheet(**creases) -> Sheet:
    pattern = miura(2, 2, "20 mm", "20 mm", "60 deg", target_angle="60 deg")
    return Sheet(pattern, thickness="0.3 mm", material="paper").crease(stiffness="1 mN m/rad", **creases)


def test_a_miura_rests_at_its_targets():
    stated = sheet(rest_angle="target")
    _, parameters = stated.build()
    target = stated.pattern.fold_angles[stated.mesh.crease_edge]
    np.testing.assert_array_equal(parameters["crease", "rest_angle"][:, 0], target)
    assert np.degrees(np.abs(target)).max() == pytest.approx(60)
    # a folded Miura of these angles exists, so that nothing is left in the sheet at them
    folded = Sheet(miura(2, 2, 0.02, 0.02, np.pi / 3, fold_angle=np.pi / 3), thickness=3e-4, material="paper")
    held = folded.crease(stiffness=1e-3, rest_angle="target").build()
    found = equilibrium(*held, Drive())
    assert found.converged and np.allclose(found.angles[: len(target)], target, atol=1e-6)


def test_a_share_is_of_the_way_from_the_shape():
    half = sheet(rest_angle="target", share=0.5).build()[1]["crease", "rest_angle"]
    np.testing.assert_allclose(half, 0.5 * sheet(rest_angle="target").build()[1]["crease", "rest_angle"])
    assert np.array_equal(half, sheet(rest_angle="target", share="50 %").build()[1]["crease", "rest_angle"])
    folded = Sheet(strip([0.01, 0.01], 0.02, fold_angles=[1.0]), thickness=1e-3).crease(
        stiffness=1.0, rest_angle="target", share=0.0
    )
    assert folded.build()[1]["crease", "rest_angle"][0, 0] == 0.0


def test_an_svg_states_its_targets_by_opacity(tmp_path):
    (tmp_path / "s.svg").write_text(SVG)
    found = Sheet(read_pattern(tmp_path / "s.svg"), thickness="0.3 mm", material="paper")
    found.crease(stiffness="1 mN m/rad")
    assert "gives 1 crease a target angle, which nothing uses" in found.unused_targets()[0]
    found.crease(rest_angle="target")
    assert np.degrees(found.build()[1]["crease", "rest_angle"]) == pytest.approx(-45) and not found.unused_targets()


def test_a_design_file_keeps_the_word(tmp_path):
    stated = sheet(rest_angle="target", share=0.25)
    again = read_design(write_design(tmp_path / "m.toml", stated)).sheet
    assert again.build()[1].hash == stated.build()[1].hash
    assert "target" in (tmp_path / "m.toml").read_text()


def test_targets_that_nothing_uses_are_named_once():
    assert "24 creases target angles" in sheet().unused_targets()[0]
    used = [sheet(rest_angle=0.0), sheet(rest_angle="target"), sheet().set("crease", rest_angle=0.1)]
    used += [sheet().set("crease_drive", drive_stiffness=1e-3, target_angle=0.5)]
    used += [Sheet(strip([0.01, 0.01], 0.02), thickness=1e-3).crease(stiffness=1.0)]
    assert [s.unused_targets() for s in used] == [[]] * 5


@pytest.mark.parametrize(
    ("state", "said"),
    [
        (lambda: sheet(rest_angle="target", share=1.5), r"no share of a fold \(field 'share', value 1.5\).*0 to 1"),
        (lambda: sheet(rest_angle="target", share=[0.5]), r"no share of a fold \(field 'share'"),
        (lambda: sheet(rest_angle=0.3, share=0.5), r"is of target angles \(field 'share'"),
        (lambda: sheet(rest_angle="targt"), r"no rest angle .*value 'targt'.*'target'"),
        (
            lambda: Sheet(strip([0.01, 0.01], 0.02), thickness=1e-3).crease(stiffness=1.0, rest_angle="target"),
            r"gives these creases no target angle \(field 'rest_angle'",
        ),
    ],
)
def test_what_is_no_target_is_one_sentence(state, said):
    with pytest.raises(InputError, match=said):
        state()


def test_a_run_and_show_name_targets_that_nothing_uses(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = """
from origami_sim import Sheet, strip
DURATION = "0.02 s"
def build(rest=""):
    sheet = Sheet(strip([0.01, 0.02], 0.02, fold_angles=["40 deg"]), thickness="1 mm").fix(panels=[0])
    return sheet.crease(stiffness="2 mN m/rad", **({"rest_angle": rest} if rest else {}))
"""
    (tmp_path / "flap.py").write_text(text)
    for command in (("run", "flap.py"), ("show", "flap.py")):
        code, out, _ = call(*command)
        assert code == 0 and out.count("Sheet.crease(rest_angle='target') makes them rest angles") == 1
        code, out, _ = call(*command, "--set", "rest=target")
        assert code == 0 and "target angle" not in out
    assert "valley" in out

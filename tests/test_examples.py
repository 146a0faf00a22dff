"""The worked examples: devices that build, and the answers that the docs state."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from origami_sim.device.device import device_module, lasting
from origami_sim.device.scene import scene_settings
from origami_sim.explore import angle, find, gradient, solve_for
from origami_sim.solve.motion.dynamics import simulate

FOLDER = Path(__file__).parents[1] / "examples"


def example(name: str):
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", [p.stem for p in sorted(FOLDER.glob("*.py"))])
def test_every_example_is_a_device(name):
    module = device_module(str(FOLDER / f"{name}.py"))
    model, parameters, drive = module.build(scene_settings(module))
    assert model.panel_count > 1 and parameters.worlds == 1 and lasting(drive) > 0


def test_the_flap_stands_upright_with_the_stated_gap():
    found = solve_for(example("flap").build, angle("hinge"), "90 deg", {"gap": ("0.3 mm", "6 mm")})
    assert found.reached and found.values["gap"] == pytest.approx(2.42e-3, abs=1e-5)


def test_the_gripper_is_poled_level_at_its_best():
    """m x B is largest for a level moment in a vertical field: arms 75 degrees up, poled 75 degrees off the arm."""
    gripper = example("gripper")
    best = gradient(gripper.build, gripper.grip, {"tilt": np.radians(75)})
    less = [gripper.grip(f) for f in find(gripper.build, [{"tilt": np.radians(75 + d)} for d in (-10, 10)])]
    assert abs(best.slope[0, 0]) < 1e-3 * best.value[0]
    assert max(less) < best.value[0]
    moment = gripper.REMANENCE * 0.012 * gripper.WIDTH * 0.002 / (4e-7 * np.pi)
    assert best.value[0] == pytest.approx(moment * 0.05 / gripper.REACH, rel=0.2)  # less weight, and what arms bend


@pytest.mark.parametrize("name", ["gamma", "fold"])
def test_the_tubes_stiffness_has_the_gradient_of_tubes_built_anew(name):
    tube = example("miura_tube")
    point = {"gamma": 1.1, "fold": 1.3}
    slope = gradient(tube.build, tube.stiffness, point).slope[0, list(point).index(name)]
    h = 2e-3 * point[name]
    around = [
        tube.stiffness(f) for f in find(tube.build, [{**point, name: point[name] + s * h} for s in (1, -1, 2, -2)])
    ]
    assert slope == pytest.approx(np.array([8, -8, -1, 1]) @ around / 12 / h, rel=1e-6)


def test_the_arch_stays_through_from_the_stated_rise():
    snap = example("snap")
    found = solve_for(lambda rise: snap.build(rise, depth=1.5), snap.hold, 0.0, {"rise": ("1 mm", "8 mm")})
    assert found.reached and found.values["rise"] == pytest.approx(1.15e-3, abs=5e-6)
    inner = slice(10, None)
    assert snap.curve(1.08e-3)[1][inner].min() > 0 > snap.curve(1.25e-3)[1][inner].min()
    _, force = snap.curve("1.5 mm")
    assert force.max() == pytest.approx(4.5e-4, abs=1e-5) and force.min() == pytest.approx(-1.7e-4, abs=1e-5)


def test_the_walker_starts_on_its_feet_and_nothing_is_noted():
    walker = example("walker")
    sheet, drive = walker.build()
    motion = simulate(*sheet.build(), drive, duration=0.1, rate=20)
    assert motion.gaps[0].min() == pytest.approx(0.0, abs=1e-12) and motion.notes == []
    assert motion.gaps.min() > -1.5e-4


def test_the_device_of_the_docs_runs(tmp_path):
    text = (FOLDER.parent / "docs" / "own-device.md").read_text(encoding="utf-8")
    (tmp_path / "my_walker.py").write_text(text.split("```python\n")[1].split("```")[0])
    module = device_module(str(tmp_path / "my_walker.py"))
    settings = scene_settings(module).replace(duration=0.1, rate=20.0)
    outcome = module.run(settings)
    assert not outcome.trajectory.failures and outcome.trajectory.notes == []
    assert settings.backward == 0.6 and scene_settings(module).duration == 3.0

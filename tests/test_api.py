"""The package's front door: ten lines from a sheet to a replay, loaded only when used."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import origami_sim

SNIPPET = """\
from math import degrees
from origami_sim import Drive, Sheet, ramp, save_run, simulate, strip

sheet = Sheet(strip([0.01, 0.02], width=0.02), thickness="1 mm", material="pdms")
sheet.patch(1, thickness="3 mm", poling=(1, 0, 0))  # magnetic elastomer on the second panel, poled away from the crease
sheet.crease(stiffness="2 mN m/rad", loss_time="3 ms").gravity().fix(panels=[0])
model, parameters = sheet.build()
drive = Drive(field=(0, 0, ramp("0.1 T", "1 s")))
motion = simulate(model, parameters, drive, duration=2.0)
print(f"folds to {degrees(motion.creases[-1, 0, 0]):.1f} deg with dt = {motion.dt * 1e6:.0f} us")
save_run("runs/flap", motion, scene="flap")  # then: origami-sim replay runs/flap
"""
"""Stands in README.md, word for word."""


def python(code: str, folder: Path, *options: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, *options, "-c", code], cwd=folder, capture_output=True, text=True, timeout=120, check=True
    )


def test_ten_lines_build_simulate_measure_and_keep_a_run(tmp_path):
    assert len([line for line in SNIPPET.splitlines() if line]) == 10
    out = python(SNIPPET, tmp_path).stdout
    angle = float(re.search(r"folds to ([\d.]+) deg", out)[1])
    # k theta = m B cos(theta) - weight; the weight of patch and sheet turns about the crease
    assert 60 < angle < 90
    run = origami_sim.load_run(tmp_path / "runs" / "flap")
    assert run.replay.is_file()
    assert run.trajectory.times[-1] == pytest.approx(2.0)


def test_the_readme_has_the_same_lines():
    readme = Path(origami_sim.__file__).parents[1] / "README.md"
    if not readme.is_file() or "from origami_sim import" not in readme.read_text(encoding="utf-8"):
        pytest.skip("no README with the example here")
    assert SNIPPET in readme.read_text(encoding="utf-8")


def test_every_public_name_is_there():
    for name in origami_sim.__all__:
        assert getattr(origami_sim, name) is not None
    assert set(origami_sim.__all__) <= set(dir(origami_sim))
    assert len(set(origami_sim.__all__)) == len(origami_sim.__all__)
    assert set(origami_sim.__all__) == set(origami_sim._MODULES)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        origami_sim.nothing  # noqa: B018


def test_version_is_that_of_the_distribution():
    import tomllib

    project = Path(origami_sim.__file__).parents[1] / "pyproject.toml"
    if not project.is_file():
        pytest.skip("not a checkout")
    assert tomllib.loads(project.read_text())["project"]["version"] == origami_sim.__version__


def test_every_folder_is_installed():
    import tomllib

    root = Path(origami_sim.__file__).parents[1]
    if not (root / "pyproject.toml").is_file():
        pytest.skip("not a checkout")
    listed = tomllib.loads((root / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    folder = root / "origami_sim"
    found = (p.parent.relative_to(folder).parts for p in folder.glob("*/**/__init__.py"))
    inside = {".".join(("origami_sim", *parts)) for parts in found}
    assert set(listed) == {"origami_sim", *(f"origami_sim.{n}" for n in ("scenes", "calibrations", "studies"))} | inside


HEAVY = ("warp", "numpy", "scipy", "rerun", "matplotlib", "pyarrow", "trimesh")


@pytest.mark.parametrize(
    "code",
    [
        "import origami_sim",
        "from origami_sim.commands import cli\ntry: cli.main(['--help'])\nexcept SystemExit: pass",
        "from origami_sim.commands import cli\ntry: cli.main(['run', '--help'])\nexcept SystemExit: pass",
    ],
    ids=["import", "help", "help of run"],
)
def test_help_and_import_wait_for_no_library(tmp_path, code):
    out = python(f"{code}\nimport sys\nprint('loaded', *(m for m in {HEAVY!r} if m in sys.modules))", tmp_path).stdout
    assert out.splitlines()[-1].strip() == "loaded"


def test_simulating_loads_no_viewer_plots_or_mesh_reader(tmp_path):
    idle = ("rerun", "matplotlib", "pyarrow", "trimesh", "shapely")
    code = (
        "from origami_sim import Drive, Sheet, equilibrium, read_pattern, simulate, strip\n"
        f"import sys\nprint('loaded', *(m for m in {idle!r} if m in sys.modules))"
    )
    assert python(code, tmp_path).stdout.splitlines()[-1].strip() == "loaded"

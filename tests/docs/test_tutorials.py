"""The code of the tutorials and of the README runs as it stands, and says what the pages say."""

import importlib.util
import re
from pathlib import Path

import pytest

from origami_sim.effects import Effect
from origami_sim.results.run_folder import load_run

ROOT = Path(__file__).parents[2]


def code(page: str) -> str:
    """All Python of a page, in one piece."""
    return "\n".join(re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL))


def test_the_first_sheet_folds(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exec(compile(code("docs/tutorials/first-sheet.md"), "first-sheet.md", "exec"), {})
    assert "folds to" in capsys.readouterr().out
    assert load_run("runs/flap").manifest["scene"] == "flap"


def test_the_gripper_closes_more_in_a_larger_field(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exec(compile(code("docs/tutorials/magnetic-gripper.md"), "magnetic-gripper.md", "exec"), {})
    angles = [float(a) for a in re.findall(r"stand at (-?[\d.]+) deg", capsys.readouterr().out)]
    assert len(angles) == 4 and angles == sorted(angles) and angles[-1] > 60
    assert load_run("runs/gripper").trajectory.x.shape[2] == 4


def test_the_effect_of_the_how_to_is_one(tmp_path):
    file = tmp_path / "my_drag.py"
    file.write_text(code("docs/how-to/own-effect.md"))
    spec = importlib.util.spec_from_file_location("my_drag", file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert isinstance(module.EFFECT, Effect) and module.EFFECT.fitted == ("coefficient",)


def test_thick_panels_stop_where_their_page_says(capsys):
    page = "docs/how-to/thick-panels.md"
    exec(compile(code(page), page, "exec"), {})
    said = re.search(r"```\n(top.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)
    assert said is not None and capsys.readouterr().out == said[1]


@pytest.mark.parametrize(
    "page", ["README.md", *(str(p.relative_to(ROOT)) for p in sorted((ROOT / "docs").rglob("*.md")))]
)
def test_links_to_files_lead_somewhere(page):
    made = {"effects", "command-line", "python", "settings", "sidecar", "changes", "benchmarks"}  # docs/generated.py
    for target in re.findall(r"\]\(([^)\s]+)\)", (ROOT / page).read_text(encoding="utf-8")):
        path = target.split("#")[0]
        if path and "://" not in path and Path(path).stem not in made:
            assert ((ROOT / page).parent / path).exists(), target


def test_pictures_of_the_readme_are_small():
    pictures = [ROOT / p for p in re.findall(r"\]\((docs/images/[^)]*)\)", (ROOT / "README.md").read_text())]
    sizes = [p.stat().st_size for p in pictures]
    assert pictures and max(sizes) < 500_000 and sum(sizes) < 1_500_000

"""Notebooks run as they are, show what they promise, and are committed without outputs."""

from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat", reason="notebooks need nbclient")
nbclient = pytest.importorskip("nbclient", reason="notebooks need nbclient")
pytest.importorskip("ipykernel", reason="notebooks need a kernel")

FOLDER = Path(__file__).parent.parent / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
SHOWN = {
    "design_by_asking": ["<b>Sweep</b>"],
    "fold_a_sheet": ["<b>Folding</b>", "<b>Model</b>", "<b>Trajectory</b>"],
    "recording_to_verdict": ["<b>Diagnosis</b>"],
}


def test_each_notebook_is_known():
    assert [p.stem for p in NOTEBOOKS] == sorted(SHOWN)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_a_notebook_has_no_outputs(path):
    cells = nbformat.read(path, as_version=4).cells
    assert all(not c.outputs and c.execution_count is None for c in cells if c.cell_type == "code")


@pytest.mark.parametrize(
    "path",
    [pytest.param(p, marks=pytest.mark.slow) if p.stem == "design_by_asking" else p for p in NOTEBOOKS],
    ids=lambda p: p.stem,
)
def test_a_notebook_runs(path, tmp_path):
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [o for c in notebook.cells if c.cell_type == "code" for o in c.outputs]
    pages = "".join(o.data.get("text/html", "") for o in outputs if "data" in o)
    for words in SHOWN[path.stem]:
        assert words in pages

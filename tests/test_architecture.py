"""Data flow one way: folders of the diagnosis know those before them, and none is too long to be read."""

import re
from pathlib import Path

import pytest

import origami_sim
from origami_sim.predict import cache

ROOT = Path(origami_sim.__file__).parent
ORDER = ("recording", "fit", "predict", "infer", "locate", "report", "diagnose")
FILE, FOLDER = 600, 3500
"""Lines, at most. The folder of solvers is longer, that of effects has a file for each."""


@pytest.mark.parametrize("name", ORDER)
def test_no_folder_of_the_diagnosis_imports_one_that_comes_after_it(name):
    later = ORDER[ORDER.index(name) + 1 :]
    files = list((ROOT / name).rglob("*.py"))
    assert files
    for file in files:
        known = re.findall(r"^\s*from origami_sim\.(\w+)", file.read_text(), re.M)
        assert not set(known) & set(later), file


@pytest.mark.parametrize("name", ORDER)
def test_no_folder_of_the_diagnosis_is_long(name):
    assert sum(len(f.read_text().splitlines()) for f in (ROOT / name).glob("*.py")) <= FOLDER


def test_no_file_is_long():
    files = [f for folder in ("", "scenes", "studies") for f in (ROOT / folder).glob("**/*.py")]
    assert len(files) > 200
    assert not [f for f in files if len(f.read_text().splitlines()) > FILE]


def test_stored_predictions_are_of_the_sources_that_predict():
    """A changed predictor must not read what another one stored."""
    digested = {f for pattern in cache._SOURCES for f in ROOT.glob(pattern)}
    for folder in ("predict", "fit", "solve", "effects", "recording"):
        assert set((ROOT / folder).glob("*.py")) <= digested, folder

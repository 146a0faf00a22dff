"""Imports go one way: a folder knows those before it, and none is too long to be read."""

import ast
from functools import cache
from pathlib import Path

import pytest

import origami_sim
from origami_sim.predict import cache as predictions

ROOT = Path(origami_sim.__file__).parent
BESIDE = ("scenes", "calibrations", "studies")
"""Folders beside the package that are installed inside it: what uses it, found by name."""

ORDER = (
    *("physics", "drive", "effects", "model", "pattern"),
    *("solve.kernels", "solve.program", "solve", "solve.rigid", "solve.statics", "solve.motion"),
    *("design", "recording", "device", "observation", "view", "results"),
    *("explore", "folding", "calibrate"),
    *("hypotheses", "fit", "predict", "infer", "verdict", "locate", "report", "diagnose", "estimation"),
    "commands",
)
"""Folders, each after those that it imports. A folder within one that is not listed goes with it."""

LATE = {
    ("model", "view"): "a notebook draws a model: only who looks pays for the drawing",
    ("solve.motion", "view"): "the same of a trajectory",
    ("solve.statics", "solve.motion"): "a path of equilibria as frames: the same",
    ("observation", "view"): "the same of a comparison",
    ("view", "folding"): "what is told of a folding beside its drawing",
    ("device", "observation"): "a comparison begins where channels show the device",
    ("device", "predict"): "as the diagnosis reads that",
    ("device", "report"): "a calibration may be one that a diagnosis has patched",
}
"""Imports against the order, inside the functions that need them."""

EVERYONES = {"_warp", "errors", "files", "quantities", "threads", "units"}
"""Modules that any folder may import; they import only each other."""

FILE, FOLDER = 600, 3500
LONGER = {
    "effects": "a file for each effect",
    "pattern": "readers of many formats, each its own file",
}
"""Lines of a file and of a folder at most, and folders that are longer."""


def name_of(file: Path) -> str:
    """A module by its name below the package."""
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


FILES = {name_of(f): f for f in sorted(ROOT.glob("**/*.py")) if f.relative_to(ROOT).parts[0] not in BESIDE}
FOLDERS = sorted({f.parent.relative_to(ROOT).as_posix().replace("/", ".") for f in FILES.values()} - {"."})


def folder_of(module: str) -> str | None:
    """The folder in ORDER that a module belongs to; None for those of everyone."""
    parts = module.split(".")
    return next((n for i in range(len(parts), 0, -1) if (n := ".".join(parts[:i])) in ORDER), None)


def test_a_module_belongs_to_its_folder():
    assert folder_of("solve.motion.implicit") == "solve.motion" and folder_of("solve.batch") == "solve"
    assert folder_of("report.page.plots") == "report" and folder_of("errors") is None


@cache
def imported(module: str) -> tuple[frozenset[str], frozenset[str]]:
    """Modules of the package that one imports when it is loaded, and those that only its functions import."""
    at_once, late = set(), set()
    package = module.split(".") if FILES[module].name == "__init__.py" else module.split(".")[:-1]

    def read(node: ast.AST, found: set[str]):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
                continue  # names of types, which nothing loads
            if isinstance(child, ast.Import):
                found |= {a.name.removeprefix("origami_sim.") for a in child.names if a.name.startswith("origami_sim.")}
            elif isinstance(child, ast.ImportFrom):
                home = (child.module or "").split(".") if child.module else []
                if child.level:
                    home = package[: len(package) + 1 - child.level] + home
                elif home[:1] == ["origami_sim"]:
                    home = home[1:]
                else:
                    continue
                for a in child.names:
                    inside = ".".join([*home, a.name])
                    found.add(inside if inside in FILES else ".".join(home))
            read(child, late if isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)) else found)

    read(ast.parse(FILES[module].read_text()), at_once)
    return frozenset(at_once - {""}), frozenset(late - at_once - {""})


def test_every_folder_has_its_place():
    assert {folder_of(n) for n in FOLDERS} == set(ORDER)


@pytest.mark.parametrize("name", ORDER)
def test_no_folder_imports_one_that_comes_after_it(name):
    later = set(ORDER[ORDER.index(name) + 1 :])
    mine = [m for m in FILES if folder_of(m) == name]
    assert mine
    for module in mine:
        at_once, late = imported(module)
        assert not {folder_of(m) for m in at_once} & later, module
        assert all((name, folder_of(m)) in LATE for m in late if folder_of(m) in later), module


def test_every_late_import_against_the_order_is_there():
    assert set(LATE) <= {(folder_of(m), folder_of(n)) for m in FILES for n in imported(m)[1]}


def test_the_root_holds_what_is_of_everyone():
    root = {f.stem for f in ROOT.glob("*.py")}
    assert root == {"__init__", "__main__"} | EVERYONES
    for module in EVERYONES:
        assert set().union(*imported(module)) <= EVERYONES, module


@pytest.mark.parametrize("name", FOLDERS)
def test_no_folder_is_long(name):
    lines = sum(len(f.read_text().splitlines()) for f in (ROOT / name.replace(".", "/")).glob("*.py"))
    assert (lines > FOLDER) == (name in LONGER)


def test_no_file_is_long():
    files = [f for folder in ("", "scenes", "studies") for f in (ROOT / folder).glob("**/*.py")]
    assert len(files) > 200
    assert not [f for f in files if len(f.read_text().splitlines()) > FILE]


def test_stored_predictions_are_of_the_sources_that_predict():
    """A changed predictor must not read what another one stored."""
    digested = {f for pattern in predictions._SOURCES for f in ROOT.glob(pattern)}
    todo, reached = [m for m in FILES if folder_of(m) == "predict"], set()
    while todo:
        module = todo.pop()
        if module not in reached:
            reached.add(module)
            todo += [m for m in imported(module)[0] | imported(module)[1] if folder_of(m) not in ("view", "report")]
    assert {"solve.program.compose", "effects", "threads", "device.scene"} <= reached
    assert not sorted(str(FILES[m]) for m in reached if FILES[m] not in digested)

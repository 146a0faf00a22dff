"""What somebody without the repository gets: build the wheel, install it into a fresh environment, run things there.

    .venv/bin/python .ci/wheel.py

The fresh environment sees the wheel and, by links, the packages that the wheel says it requires, with what those
require, from the environment that runs this: no network is needed, and what the wheel does not declare is not there.
A scene, a pattern and a device file are run in a folder with nothing of the repository in sight.
"""

import shutil
import subprocess
import sys
import tempfile
from importlib.metadata import Distribution, distribution, distributions
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parent.parent
RUNS = {
    "fold_file": ("run", "fold_file", "--set", "fold_time=0.1", "--set", "hold_time=0"),
    "flap": ("run", "flap.py", "--until", "0.1", "--quasistatic"),
    "waterbomb": ("run", "waterbomb.fold"),
}


def required(of: Distribution) -> dict[str, Distribution]:
    """Distributions that one requires without extras, and what those require, by name."""
    found, todo = {}, [of]
    while todo:
        for line in todo.pop().requires or ():
            need = Requirement(line)
            if need.marker is None or need.marker.evaluate({"extra": ""}):
                if need.name not in found:
                    found[need.name] = distribution(need.name)
                    todo.append(found[need.name])
    return found


def linked(dists, into: Path):
    """Link all that distributions have installed beside each other."""
    for d in dists:
        for top in {Path(f).parts[0] for f in d.files or () if Path(f).parts[0] not in ("..", "__pycache__")}:
            if not (into / top).exists():
                (into / top).symlink_to(Path(str(d.locate_file(top))).resolve())


def main():
    with tempfile.TemporaryDirectory() as folder:
        room = Path(folder)

        def call(*command, quiet=True):
            done = subprocess.run([str(c) for c in command], cwd=room, capture_output=quiet, text=True)
            if done.returncode:
                sys.exit(f"wheel: {' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
            return done.stdout

        shutil.copytree(ROOT, room / "source", ignore=shutil.ignore_patterns(".*", "runs", "build", "*.egg-info"))
        pip = ("-m", "pip", "--quiet", "--disable-pip-version-check")
        call(sys.executable, *pip, "wheel", room / "source", "--no-deps", "--no-build-isolation", "--wheel-dir", room)
        shutil.rmtree(room / "source")
        (wheel,) = room.glob("*.whl")
        call(sys.executable, "-m", "venv", room / "venv")
        python, site = room / "venv/bin/python", next((room / "venv/lib").glob("python*")) / "site-packages"
        call(python, *pip, "install", "--no-deps", "--no-index", wheel)
        (own,) = distributions(name="origami-sim", path=[str(site)])
        linked(required(own).values(), site)
        call(python, *pip, "check")
        where = call(python, "-c", "import origami_sim; print(origami_sim.__file__)")
        if not Path(where.strip()).is_relative_to(room):
            sys.exit(f"wheel: {where.strip()} was imported, not the wheel")
        shutil.copy(ROOT / "examples/flap.py", room)
        shutil.copy(ROOT / "scenes/waterbomb.fold", room)
        for name, command in RUNS.items():
            call(room / "venv/bin/origami-sim", *command)
            if not (room / "runs" / name / "manifest.json").is_file():
                sys.exit(f"wheel: {' '.join(command)} left no run folder")
        print(f"wheel: {wheel.name} runs a scene, a device file and a pattern in a fresh environment")


if __name__ == "__main__":
    main()

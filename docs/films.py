"""Writes the moving pictures of the documentation: `python docs/films.py [SCENE ...]` (minutes)."""

import sys
from pathlib import Path

from origami_sim.device.scene import scene_module, scene_settings
from origami_sim.results.run_folder import save_run
from origami_sim.view.export import export

IMAGES = Path(__file__).with_name("images")
LARGEST = 500_000  # bytes per film
FILMS = {  # scene: what of it is shown, and how long that lasts on the screen [s]
    "box": {"seconds": 3.0},
    "crawler": {"start": 0.0, "stop": 3.0, "seconds": 3.0},
    "fold_file": {"seconds": 2.5},
    "de_fold": {"seconds": 3.0},
    "de_bender": {"seconds": 3.0},
    "folding_strip": {"seconds": 4.0},
    "mae_cantilever": {"seconds": 3.0},
    "magnetic_arch": {"seconds": 4.0},
    "multi_field_sheet": {"seconds": 4.0},
    "bifold": {"seconds": 2.0},
}


def main(scenes: list[str]) -> None:
    for name in scenes or FILMS:
        module = scene_module(name)
        motion = module.run(scene_settings(module)).trajectory
        save_run(Path("runs") / name, motion, scene=name)
        file = export(motion, IMAGES / f"{name}.webp", title=name, width=440, height=280, **FILMS[name])
        size = file.stat().st_size
        print(f"{file}: {size / 1024:.0f} KiB")
        if size > LARGEST:
            sys.exit(f"{file} is too large for the documentation: show less of it")


if __name__ == "__main__":
    main(sys.argv[1:])

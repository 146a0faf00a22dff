"""python -m origami_sim: the same as the command `origami-sim`."""

from origami_sim.commands.cli import main

if __name__ == "__main__":
    main()

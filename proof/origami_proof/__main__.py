"""python -m origami_proof: see `command`."""

from origami_proof.command import main

if __name__ == "__main__":
    main()

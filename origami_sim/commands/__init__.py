"""The command line `origami-sim`, and those of its commands that have no folder of their own."""

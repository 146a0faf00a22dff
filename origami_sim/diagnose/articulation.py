"""Rigid panels joined by creases, under the name by which the diagnosis has them."""

from origami_sim.articulation import Articulation, Pose

__all__ = ["Articulation", "Pose"]

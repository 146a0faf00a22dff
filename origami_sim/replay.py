"""Replays for the rerun viewer, by the names under which they are imported; the code is in `origami_sim.view`."""

from origami_sim.view.overlay import Overlay, write_overlay
from origami_sim.view.palette import COLOURS, SERIES
from origami_sim.view.replay import write_replay
from origami_sim.view.viewer import TIMELINE, open_replay, read_series, screenshot

__all__ = [
    "COLOURS",
    "SERIES",
    "TIMELINE",
    "Overlay",
    "open_replay",
    "read_series",
    "screenshot",
    "write_overlay",
    "write_replay",
]

"""Stray field: there without command, of the earth, the core's remanence or a magnet nearby."""

from dataclasses import replace

import numpy as np

from origami_sim.drive import CHANNELS, Drive
from origami_sim.effects._effect import Effect, Parameter


def apply(
    drive: Drive, duration: float, field_offset_x: np.ndarray, field_offset_y: np.ndarray, field_offset_z: np.ndarray
) -> Drive:
    offsets = zip(CHANNELS[:3], (field_offset_x, field_offset_y, field_offset_z), strict=True)
    shifted = {c: replace(drive[c], offset=drive[c].offset + b) for c, b in offsets if np.any(b)}
    return drive.replace(**shifted)


EFFECT = Effect(
    name="field_offset",
    family="drive",
    force=None,
    apply=apply,
    channels=("field",),
    parameters=(
        Parameter("field_offset_x", "Bx", "T", 0.0, (-0.5, 0.5), "constant field along x", typical=0.003),
        Parameter("field_offset_y", "By", "T", 0.0, (-0.5, 0.5), "constant field along y", typical=0.003),
        Parameter("field_offset_z", "Bz", "T", 0.0, (-0.5, 0.5), "constant field along z", typical=0.003),
    ),
    fitted=("field_offset_x", "field_offset_y", "field_offset_z"),
    formula="B = B_command + B0",
    source="earth 50 uT; iron core after full field 1 to 5 mT",
    matters="rest angle off at zero command, unequal response to the two signs",
    confused_with="rest-angle drift, gravity, magnets of neighbouring panels",
    separated_by="turn the device, or run the core down with an alternating field; a Hall probe at zero current",
)

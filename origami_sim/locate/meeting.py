"""Whether panels of which nobody stated that they touch came near each other while they were recorded."""

import numpy as np

from origami_sim.fit.predictor import Predictor
from origami_sim.model import State
from origami_sim.predict.rollouts import Rollouts
from origami_sim.solve.watch import Met, watch_of


def meetings(forward: Predictor) -> list[str]:
    """A sentence for each recording in which panels came as near as they touch; a diagnosis has no contact unasked.

    It is looked in the recorded motion, where the channels tell it. Where no two panels come near each other there, the
    model needs no contact.
    """
    if not isinstance(forward, Rollouts):
        return []
    notes = []
    for r, recording in enumerate(forward.recordings):
        motion = forward.recorded(r)
        if motion is None:
            continue
        x = motion.positions[:, :, None]
        start = State.at_rest(forward.model, position=x[0], placed=True)
        watch, _ = watch_of(forward.model, forward.parameters, start, reference=False)
        if watch is None:
            continue
        try:
            for time, frame in zip(recording.times, x, strict=True):
                watch.add(float(time), frame, np.zeros_like(frame))  # so that each node goes straight on
            watch.look()
        except Met as met:
            notes.append(
                f"{recording.name}: {met.where}, and the model has no contact between panels: state Sheet.touch(), or "
                "touch(stiffness=0) for the diagnosis to ask whether they touch."
            )
    return notes

"""Where a fit leaves something missing: by equation error, of motions and of curves."""

from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.locate.acting import acting
from origami_sim.locate.locate import locate, motions_of
from origami_sim.locate.locate_curves import places
from origami_sim.locate.places import Acting, Place


def located(forward: Predictor, f: Fit) -> tuple[list[Place], list[Acting]]:
    """Places, most suspicious first, and what alone could be what is missing there."""
    if forward.curve:
        return places(forward.balance(f.hypothesis, f.theta), by_step=forward.recordings[0].by_step), []  # type: ignore[attr-defined]
    motions = motions_of(forward, f)  # type: ignore[arg-type]
    return locate(forward, motions), acting(forward.articulation, motions)  # type: ignore[arg-type]

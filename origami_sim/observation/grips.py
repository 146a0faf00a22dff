"""Channels that read what a grip exerts: load cells of test machines, torque sensors of shafts."""

import numpy as np

from origami_sim.drive import Drive
from origami_sim.errors import InputError, nearest
from origami_sim.model import Model
from origami_sim.recording import Channel, Recording
from origami_sim.solve.grips import alone, moving, on_path, turning


def grip_of(model: Model, channel: Channel) -> int:
    """The grip that a channel is attached to, by its name or number; InputError if the model has none such."""
    given, names = channel.attachment["grip"], model.names.get("grip", ())
    if given in names:
        return names.index(given)
    if isinstance(given, int) and 0 <= given < len(model.grip_screws):
        return given
    raise InputError(
        f"the model has no such grip{nearest(str(given), names)}",
        field=f"channels.{channel.name}.grip",
        value=given,
        allowed=", ".join(names) or "Sheet.grip(name, ...)",
    )


def of_grip(model: Model, channel: Channel, wrench: np.ndarray) -> np.ndarray:
    """What a channel reads of a grip: force [N] or moment [N m], (F,) or (F, 3).

    A force is read along the direction of the channel, or along the path; a moment about the axis of the path.

    Args:
        wrench: (F, 6) force and moment about its pole.

    Raises:
        InputError: a force along the path of a grip that turns, a moment of one that does not.
    """
    grip = grip_of(model, channel)
    turns = bool(turning(model)[grip])
    direction = channel.attachment.get("direction")
    if channel.kind == "force" and direction is not None:
        return wrench[:, :3] @ np.asarray(direction, float)
    if channel.kind == "force" and channel.values.ndim == 2 and channel.values.shape[1] == 3:
        return wrench[:, :3]
    if turns == (channel.kind == "force"):
        raise InputError(
            "a grip that turns gives a moment" if turns else "a grip that moves along a direction gives a force",
            field=f"channels.{channel.name}.kind",
            value=channel.kind,
            allowed="moment, or a force with a direction" if turns else "force",
        )
    return on_path(model.grip_screws[grip], wrench)


def refuse_moving(model: Model, channel: Channel) -> None:
    """Refuses to read the force of supports that move, or of all of rigid panels, by nodes in place of a grip."""
    if "grip" in channel.attachment or channel.attachment.get("ground"):
        return
    many = channel.attachment.get("nodes", [channel.attachment.get("node")])
    labels = model.names.get("node", ())
    nodes = [labels.index(n) if isinstance(n, str) and n in labels else n for n in many]
    numbers = [n for n in nodes if isinstance(n, int) and 0 <= n < len(model.grips)]
    if model.panels == "rigid" or np.any(model.grips[numbers] >= 0):
        names = model.names.get("grip", range(len(model.grip_screws)))
        raise InputError(
            "the force of supports that move is that of a grip",
            field=f"channels.{channel.name}",
            value=f"nodes {many}",
            allowed="grip = " + " or ".join(repr(n) for n in names),
        )


def refuse_unfollowed(model: Model, recording: Recording, drive: Drive) -> None:
    """Refuses what predictions in time do not follow of grips that move.

    Where a segment begins is read from its first frames, as if the device stood in its place: fold angles tell that in
    any frame of reference. Fits change lengths, which held nodes of bars do not follow.

    Raises:
        InputError: bars, several supports, channels other than fold angles.
    """
    if not moving(model, drive):
        return
    kinds = sorted({c.kind for c in recording.channels.values()} - {"crease_angle"})
    for wrong, said, value, allowed in (
        (model.panels != "rigid", "bars", "panels='elastic'", "rigid panels (--panels rigid)"),
        (alone(model) is None, "several supports", "loops", "one grip that holds the device alone"),
        (bool(kinds), "what a camera sees", ", ".join(kinds), "crease_angle channels, or compare"),
    ):
        if wrong:
            raise InputError(
                f"a diagnosis in time does not follow {said} of devices in grips that move",
                file=recording.metadata.get("sidecar"), field="drive", value=value, allowed=allowed,
            )  # fmt: skip

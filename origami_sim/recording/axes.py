"""Mirrored pictures, exchanged axes and reversed signs: found before anything is fitted.

That a picture is mirrored is no effect with a strength: it is so or it is not, nothing in between can be fitted, and
what is not seen at once is explained away by wrong physics. So it is a check of the recording against what the model
as given predicts. Only the form counts: each candidate may shift the readings by a constant, because a mirrored picture
has its zero elsewhere.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import ArrayLike

from origami_sim.errors import InputError
from origami_sim.recording.recording import CHANNEL_KINDS, Channel, Recording
from origami_sim.units import quantity

FAR = 3.0
"""How many times closer (root mean square) the changed readings must be to the prediction than those as recorded.

Between a picture and its mirror image the error of a fair model falls tenfold and more, between a bad model's two wrong
answers it changes by less than 2. Half of it raises alarms where a motion is nearly symmetrical, double of it misses
mirrors where the model is off by a tenth of the motion.
"""

EXPLAINED = 0.5
"""Part of the motion (root mean square) that may be left: a change that explains less than that is no explanation.

Half of it asks for a model that is right within a quarter, double of it accepts one that is no better than a constant.
"""

PICTURE = ("right", "up")


@dataclass(frozen=True)
class Axes:
    """A change of axes after which the readings agree far better with the model.

    Attributes:
        channels: names of the channels that share it: all markers of one picture.
        order: which recorded component stands at each place. signs: by which sign it is to be multiplied.
        shift: constant (d,) that is added afterwards [SI].
        given: root mean square difference to the prediction as recorded, the mean taken off. changed: with the change
            [SI].
        sentence: what is wrong, in words.
    """

    channels: tuple[str, ...]
    order: tuple[int, ...]
    signs: tuple[int, ...]
    shift: tuple[float, ...]
    given: float
    changed: float
    sentence: str

    def corrected(self, values: np.ndarray) -> np.ndarray:
        """Readings (n,) or (n, d) of one of the channels with the change."""
        return reordered(values, self.order, self.signs, self.shift)


def mistaken_axes(recording: Recording, predicted: Mapping[str, np.ndarray]) -> list[Axes]:
    """Groups of channels that the model explains far better with axes mirrored, exchanged or both.

    All signed permutations of the components are tried: 2 of an angle, 8 of a picture, 48 in space. Markers of one
    camera share one; every angle, force and displacement has its own. Of several that explain the readings equally well
    (a motion along one axis) the one with the fewest changes counts.

    A motion that is nearly its own mirror image, and a model in opposite phase throughout, cannot be told from it.

    Args:
        predicted: what the model as given would have read, by channel name, each of the shape of the channel's values
            [SI]; channels without one are left out.

    Raises:
        InputError: a prediction of another shape than the channel.
    """
    found = []
    for group in groups_of([c for c in recording.channels.values() if c.name in predicted]):
        pairs = [_pair(c, np.asarray(predicted[c.name], float)) for c in group]
        axes = _best(group, *(np.concatenate(p) for p in zip(*pairs, strict=True)))
        if axes is not None:
            found.append(axes)
    return found


def reordered(values: np.ndarray, order: Sequence[int], signs: Sequence[int], shift: ArrayLike = 0.0) -> np.ndarray:
    """Readings (n,) or (n, d) with components in another order, with other signs, and moved."""
    columns = values.reshape(len(values), -1)[:, list(order)] * np.asarray(signs) + np.asarray(shift)
    return columns.reshape(values.shape)


def orders(width: int) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Orders and signs of so many components, those first that change least: as they are."""
    same = tuple(range(width))
    every = [(o, s) for o in permutations(same) for s in product((1, -1), repeat=width)]
    return sorted(every, key=lambda c: sum(a != b for a, b in zip(c[0], same, strict=True)) + c[1].count(-1))


def alike(left: float, least: float, noise: float) -> bool:
    """Whether a change explains readings as well as the best one does."""
    return left <= 1.05 * least + 0.1 * noise


def groups_of(channels: Sequence[Channel]) -> list[list[Channel]]:
    """Channels that can only be mistaken together: markers in the same picture, or in the same space."""
    out: dict[object, list[Channel]] = {}
    for c in channels:
        key: object = c.name
        if c.kind in ("marker", "marker_2d"):
            key = (c.kind, picture_of(c))
        out.setdefault(key, []).append(c)
    return list(out.values())


def picture_of(channel: Channel) -> bytes | None:
    """What tells the picture that a marker is in from others; None outside of pictures."""
    return None if channel.camera is None else channel.camera.axes.tobytes()


def _pair(channel: Channel, predicted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Readings and prediction [m, d] of the frames in which both are known."""
    values = np.asarray(channel.values, float)
    if predicted.shape != values.shape:
        raise InputError(
            f"the prediction of channel '{channel.name}' has another shape",
            field=f"predicted.{channel.name}",
            value=predicted.shape,
            allowed=str(values.shape),
        )
    read, said = values.reshape(len(values), -1), predicted.reshape(len(values), -1)
    known = np.isfinite(read).all(axis=1) & np.isfinite(said).all(axis=1)
    return read[known], said[known]


def _best(group: Sequence[Channel], read: np.ndarray, said: np.ndarray) -> Axes | None:
    if len(read) < 3:
        return None
    width = read.shape[1]
    candidates, left = orders(width), {}
    for order, signs in candidates:
        gap = said - reordered(read, order, signs)
        left[order, signs] = float(np.sqrt(np.mean(np.sum((gap - gap.mean(axis=0)) ** 2, axis=1))))
    given, least = left[candidates[0]], min(left.values())
    motion = float(np.sqrt(np.mean(np.sum((read - read.mean(axis=0)) ** 2, axis=1))))
    noise = float(np.sqrt(width * np.mean([c.noise**2 for c in group])))
    order, signs = next(c for c in candidates if alike(left[c], least, noise))
    changed = left[order, signs]
    if changed >= given or given < FAR * max(changed, noise) or changed > EXPLAINED * motion:
        return None
    shift = (said - reordered(read, order, signs)).mean(axis=0)
    names = tuple(c.name for c in group)
    unit = group[0].unit
    sentence = (
        f"{'Channel' if len(names) == 1 else 'Channels'} {', '.join(names)}: {words(group[0], order, signs)}; so "
        f"changed the model is {quantity(changed, unit)} off, as recorded {quantity(given, unit)}."
    )
    return Axes(names, order, signs, tuple(map(float, shift)), given, changed, sentence)


def words(channel: Channel, order: tuple[int, ...], signs: tuple[int, ...]) -> str:
    """What is wrong with the axes, for a reader who has the set-up before him."""
    width = len(order)
    if width == 1:
        what = "angle" if CHANNEL_KINDS[channel.kind][0] == "angle" else "reading"
        return f"the {what} is counted the other way round"
    labels = PICTURE if channel.kind == "marker_2d" else tuple("xyz")[:width]
    turned = [labels[k] for k, s in zip(order, signs, strict=True) if s < 0]
    moved = [labels[k] for k, place in enumerate(order) if k != place]
    whole = "the picture" if channel.kind == "marker_2d" else "the frame of reference"
    said = []
    if moved:
        said.append(f"the axes {' and '.join(moved)} are exchanged")
    if turned:
        said.append(f"{' and '.join(turned)} point{'s' if len(turned) == 1 else ''} the other way")
    mirror = np.linalg.det(np.eye(width)[list(order)] * np.array(signs)[:, None]) < 0
    return f"{whole} is {'mirrored' if mirror else 'turned'}: {', and '.join(said)}"

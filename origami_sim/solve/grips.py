"""Grips of a model: which of them move, where their nodes are, and what force they exert.

How far a grip has gone along its path from the reference state is its level, [m] or [rad]; levels are [G, W], and
motions [3, G, W] levels, rates and accelerations.
"""

import numpy as np

from origami_sim.drive import PATHS, Drive
from origami_sim.errors import InputError, nearest
from origami_sim.model import Model, State
from origami_sim.model.motions import carried, velocity

WORK = "grips"
"""Name of their work among that of the effects."""

APART = 1e-6
"""Distance over the device's size from which a held node is not where its grip is: rounding leaves 1e-12, and a start
that is meant to be elsewhere 1e-3. Half and double refuse the same ones."""

TEARS = 1e-4
"""Distance over the device's size from which panels no longer reach their grip: loops stay closed to 1e-8, and to 5e-5
where steps have a tolerance of 1e-4; panels that do not reach are off by 5e-4 in the next frame, and by 1e-2 after ten.
Half and double tell the same ones."""

PART = 0.1
"""Share of an element's length by which grips move from one equilibrium to the next on a way to one: bars that are
strained by a tenth still come to rest. Half takes twice as long, double loses arches of thick strips."""


def turning(model: Model) -> np.ndarray:
    """Whether each grip turns about an axis [G]; else it moves along a direction."""
    return np.any(model.grip_screws[:, :3] != 0.0, axis=1)


def channels(model: Model) -> list[str]:
    """Channel of the drive that is the path of each grip."""
    names = model.names.get("grip", ())
    return [f"{PATHS[int(t)]}_{names[k] if k < len(names) else k}" for k, t in enumerate(turning(model))]


def moving(model: Model, drive: Drive) -> bool:
    """Whether any grip of the model moves.

    Raises:
        InputError: a path of a grip that the model does not have.
    """
    known = channels(model)
    for name in drive.signals:
        if name.partition("_")[0] in PATHS and name not in known:
            said = f"the model has no such grip{nearest(name, known)}"
            raise InputError(
                said, field=name, allowed=", ".join(known) or "Sheet.grip(name, panels=..., direction=...)"
            )
    return any(n in drive.signals and not drive[n].is_zero for n in known)


def placed(model: Model, levels: np.ndarray, reference: np.ndarray | None = None) -> np.ndarray:
    """Places [N, W, 3] [m] to which levels [G, W] bring the nodes; those of no grip are as in the reference state.

    Args:
        reference: [N, W, 3] of worlds that differ in shape (default: the model's).
    """
    begin = model.position[:, None] if reference is None else reference
    out = np.array(np.broadcast_to(begin, (len(begin), levels.shape[1], 3)))
    for k, (way, level) in enumerate(zip(model.grip_screws, levels, strict=True)):
        mine = model.grips == k
        out[mine] = carried(out[mine], way, level)
    return out


def levels_at(model: Model, drive: Drive, time: float, worlds: int) -> np.ndarray:
    """Levels [G, W] at a time [s]; 0 of grips that the drive does not move."""
    out = np.zeros((len(model.grip_screws), worlds))
    for row, name in zip(out, channels(model), strict=True):
        if name in drive.signals:
            row[:] = np.squeeze(drive[name](time))
    return out


def levels_over(model: Model, drive: Drive, times: np.ndarray, worlds: int) -> np.ndarray:
    """Levels [F, G, W] at times [F] [s]."""
    return np.stack([levels_at(model, drive, float(t), worlds) for t in times])


def motion_at(model: Model, drive: Drive, time: float, worlds: int) -> np.ndarray:
    """Levels, their rates and their accelerations [3, G, W] at a time [s]."""
    out = np.zeros((3, len(model.grip_screws), worlds))
    out[0] = levels_at(model, drive, time, worlds)
    for k, name in enumerate(channels(model)):
        if name in drive.signals:
            for row, value in zip(out[1:, k], drive[name].derivatives(time), strict=True):
                row[:] = np.squeeze(value)
    return out


def standing(levels: np.ndarray) -> np.ndarray:
    """The motion [3, G, W] of grips that stand at levels [G, W]."""
    return np.stack([levels, np.zeros_like(levels), np.zeros_like(levels)])


def levels_among(model: Model, drive: Drive, values: np.ndarray) -> np.ndarray:
    """Levels [G, W] among the values [channels, W] of a drive; 0 of grips that it does not move."""
    rows, known = np.zeros((len(model.grip_screws), values.shape[1])), list(drive.signals)
    for row, name in zip(rows, channels(model), strict=True):
        if name in known:
            row[:] = values[known.index(name)]
    return rows


def held(model: Model) -> np.ndarray:
    """The axes [N, 3] along which grips hold nodes."""
    return (model.grips >= 0)[:, None] & (model.free == 0.0)


def held_at(model: Model, x: np.ndarray, levels: np.ndarray, reference: np.ndarray | None = None) -> np.ndarray:
    """Positions x [N, W, 3] with the held axes of grips where levels [G, W] have them, and all else; see `placed`."""
    if not len(model.grips):
        return x
    return np.where(held(model)[:, None], placed(model, levels, reference), x)


def alone(model: Model) -> int | None:
    """The grip that holds the device alone; None if there is none such (0 is a grip)."""
    holding = np.unique(model.grips[np.any(model.free == 0.0, axis=1)]) if len(model.grips) else []
    return int(holding[0]) if len(holding) == 1 and holding[0] >= 0 else None


def carried_along(
    model: Model, x: np.ndarray, before: np.ndarray, after: np.ndarray, reference: np.ndarray | None = None
) -> np.ndarray:
    """A guess of positions [N, W, 3] after levels have gone on from [G, W] to others, from positions x [N, W, 3].

    Where one grip alone holds the device, all of it goes along; else what is held.
    """
    if not len(model.grips) or np.array_equal(before, after):
        return x
    only = alone(model)
    if only is not None:
        x = carried(x, model.grip_screws[only], (after - before)[only])
    return held_at(model, x, after, reference)


def ridden(model: Model, state: State, motion: np.ndarray) -> None:
    """Takes a state along with the grip that holds it alone, with its velocities, to levels and rates [3, G, W]."""
    k = alone(model)
    assert k is not None
    way, level = model.grip_screws[k], motion[0, k]
    state.x = carried(state.x, way, level)
    turned = carried(state.v, np.append(way[:3], np.zeros(3)), level)
    state.v = turned + motion[1, k, :, None] * velocity(state.x, way)


def nearest_levels(model: Model, x: np.ndarray, reference: np.ndarray | None = None) -> np.ndarray:
    """Levels [G, W] that bring the nodes nearest to positions x [N, W, 3]; turns within half a turn."""
    out = np.zeros((len(model.grip_screws), x.shape[1]))
    for k, way in enumerate(model.grip_screws):
        mine = model.grips == k
        before, now = (model.position[:, None] if reference is None else reference)[mine], x[mine]
        if not np.any(way[:3]):
            out[k] = ((now - before) @ way[3:]).mean(axis=0)
            continue
        on = _on_axis(way)
        sine = (np.cross(before - on, now - on) @ way[:3]).sum(axis=0)
        flat = [a - (a @ way[:3])[..., None] * way[:3] for a in (before - on, now - on)]
        out[k] = np.arctan2(sine, (flat[0] * flat[1]).sum(axis=(0, 2)))
    return out


def way_to(model: Model, x: np.ndarray, end: np.ndarray, length: float) -> list[np.ndarray]:
    """Levels [G, 1] at the parts of a way to those at its end, from positions x [N, 1, 3] of one world, these first.

    Who turns from the reference state goes the whole angle, and from anywhere else the shorter way round. A device that
    one grip holds alone goes along whole. Others bend at each part, by no more than a share of an element's length [m].
    """
    begin = nearest_levels(model, x)
    turns = (np.abs(begin) > APART) & turning(model)[:, None]
    begin = begin + np.where(turns, 2 * np.pi * np.round((end - begin) / (2 * np.pi)), 0.0)
    far = 0.0 if alone(model) is not None else _astray(model, x, end).max()
    count = max(1, int(np.ceil(far / (PART * length))))
    return [begin + (end - begin) * (k / count) for k in range(count)] + [end]


def velocities(model: Model, x: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Velocities [N, W, 3] [m/s] of the nodes of grips at positions x [N, W, 3], in a motion [3, G, W]."""
    out = np.zeros_like(x)
    for k, way in enumerate(model.grip_screws):
        mine = model.grips == k
        out[mine] = motion[1, k, :, None] * velocity(x[mine], way)
    return out


def accelerations(model: Model, x: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Accelerations [N, W, 3] [m/s^2] of the held axes of grips at positions x [N, W, 3], in a motion [3, G, W]."""
    out = np.zeros_like(x)
    for k, way in enumerate(model.grip_screws):
        mine = model.grips == k
        unit = velocity(x[mine], way)
        out[mine] = motion[2, k, :, None] * unit + motion[1, k, :, None] ** 2 * np.cross(way[:3], unit)
    return out * (model.free == 0.0)[:, None]


def poles(model: Model, levels: np.ndarray) -> np.ndarray:
    """Points [G, W, 3] [m] about which moments of the grips are meant, at levels [G, W].

    The middle of the nodes, where it is now, or the point next to their middle on the axis about which they turn.
    """
    out = np.zeros((len(levels), levels.shape[1], 3))
    x = placed(model, levels)
    for k, way in enumerate(model.grip_screws):
        out[k] = x[model.grips == k].mean(axis=0)
        if np.any(way[:3]):
            on = _on_axis(way)
            out[k] = on + ((out[k] - on) @ way[:3])[:, None] * way[:3]
    return out


def _on_axis(screw: np.ndarray) -> np.ndarray:
    """The point [3] [m] next to the origin on the axis of a screw (6,) that turns."""
    return np.cross(screw[:3], screw[3:])


def wrenches(model: Model, mass: np.ndarray, x: np.ndarray, force: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Force [N] and moment about its pole [N m] of each grip on bars [G, W, 6].

    At a held axis the support exerts what the node's mass needs for the acceleration of its path, less all laws.

    Args:
        mass: [N, 1 or W] of the nodes [kg]. x: [N, W, 3] [m]. force: [N, W, 3] of all laws [N].
        motion: levels, rates and accelerations [3, G, W].
    """
    exerted = (model.free == 0.0)[:, None] * (mass[:, :, None] * accelerations(model, x, motion) - force)
    out = np.zeros((len(model.grip_screws), x.shape[1], 6))
    for k, pole in enumerate(poles(model, motion[0])):
        mine = model.grips == k
        out[k, :, :3] = exerted[mine].sum(axis=0)
        out[k, :, 3:] = np.cross(x[mine] - pole, exerted[mine]).sum(axis=0)
    return out


def on_path(screw: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """What a grip exerts along its path [...]: a force along the direction [N], a moment about the axis [N m].

    Args:
        screw: of the grip (6,), or of many [..., 6]. wrench: what it exerts [..., 6].
    """
    turns = np.any(screw[..., :3] != 0.0, axis=-1, keepdims=True)
    way = np.where(turns, screw[..., :3], screw[..., 3:])
    part = np.where(turns, wrench[..., 3:], wrench[..., :3])
    return np.where(way == 0.0, 0.0, part * way).sum(axis=-1)  # a component that is open elsewhere is no matter


def work(levels: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Work of all grips since the first frame [F, W] [J], of loads along paths, both [F, G, W]: trapezoids."""
    spent = (0.5 * (load[1:] + load[:-1]) * np.diff(levels, axis=0)).sum(axis=1)
    return np.concatenate([np.zeros((1, levels.shape[2])), np.cumsum(spent, axis=0)])


def refuse_jump(model: Model, x: np.ndarray, levels: np.ndarray) -> None:
    """Refuses a start in which held nodes are not where their grips are.

    Args:
        x: [N, W, 3] positions at the start. levels: [G, W] then.

    Raises:
        InputError: naming the grip and how far off it is.
    """
    off = _astray(model, x, levels).max(axis=1)
    worst = int(off.argmax())
    if off[worst] > APART * _size(model):
        raise InputError(
            f"a grip cannot jump: it is {off[worst] * 1e3:.3g} mm from where the motion starts",
            field=channels(model)[int(model.grips[worst])],
            allowed="a path from 0 on, such as ramp('5 mm', '1 s'), or a state that is there, as of an equilibrium",
        )


def torn(model: Model, x: np.ndarray, levels: np.ndarray) -> dict[int, tuple[int, str]]:
    """Worlds whose rigid panels do not reach their grips, at x [N, W, 3] and levels [G, W]: a node of each, and why."""
    off, out = _astray(model, x, levels), {}
    for w in np.flatnonzero(off.max(axis=0) > TEARS * _size(model)).tolist():  # none where positions are no numbers
        node = int(off[:, w].argmax())
        name = channels(model)[int(model.grips[node])].partition("_")[2]
        far = f"node {node} is {off[node, w] * 1e3:.3g} mm from its grip '{name}'"
        out[w] = node, f"the grips tear the rigid panels: {far}"
    return out


def _astray(model: Model, x: np.ndarray, levels: np.ndarray) -> np.ndarray:
    """Distance [N, W] [m] of nodes at x [N, W, 3] from where grips at levels [G, W] have them; 0 of others."""
    return np.linalg.norm(held_at(model, x, levels) - x, axis=-1)


def _size(model: Model) -> float:
    """Size of a device in its reference state [m]."""
    return float(np.ptp(model.position, axis=0).max(initial=0.0)) or 1.0

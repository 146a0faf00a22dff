"""Grips of a model: which of them move, where their nodes are, and what force they exert."""

import numpy as np

from origami_sim.drive import PATHS, Drive
from origami_sim.errors import InputError, nearest
from origami_sim.model import Model, State
from origami_sim.model.motions import carried, velocity

ROW = "grips"
"""Name of their work among that of the effects."""

APART = 1e-6
"""Distance over the device's size from which a held node is not where its grip is: rounding leaves 1e-12, and a start
that is meant to be elsewhere 1e-3. Half and double refuse the same ones."""


def paths(model: Model) -> list[str]:
    """Channel of the drive that is the path of each grip."""
    turns = np.any(model.grip_screws[:, :3] != 0.0, axis=1)
    names = model.names.get("grip", ())
    return [f"{PATHS[int(t)]}_{names[k] if k < len(names) else k}" for k, t in enumerate(turns)]


def moving(model: Model, drive: Drive) -> bool:
    """Whether any grip of the model moves.

    Raises:
        InputError: a path of a grip that the model does not have.
    """
    known = paths(model)
    for name, signal in drive.signals.items():
        if name.partition("_")[0] in PATHS and name not in known:
            said = f"the model has no such grip{nearest(name, known)}"
            allowed = ", ".join(known) or "Sheet.grip(name, panels=..., direction=...)"
            raise InputError(said, field=name, value=signal.unit, allowed=allowed)
    return any(n in drive.signals and not drive[n].is_zero for n in known)


def placed(model: Model, levels: np.ndarray, reference: np.ndarray | None = None) -> np.ndarray:
    """Places [N, W, 3] [m] to which paths [G, W] bring the nodes; those of no grip are as in the reference state.

    Args:
        reference: [N, W, 3] of worlds that differ in shape (default: the model's).
    """
    begin = model.position[:, None] if reference is None else reference
    out = np.array(np.broadcast_to(begin, (len(begin), levels.shape[1], 3)))
    for k, (way, level) in enumerate(zip(model.grip_screws, levels, strict=True)):
        mine = model.grips == k
        out[mine] = carried(out[mine], way, level)
    return out


def along(model: Model, drive: Drive, time: float, worlds: int) -> np.ndarray:
    """Paths, their rates and their accelerations [3, G, W] at a time [s]."""
    out = np.zeros((3, len(model.grip_screws), worlds))
    for k, name in enumerate(paths(model)):
        if name in drive.signals:
            signal = drive[name]
            for row, value in zip(out[:, k], (signal(time), *signal.derivatives(time)), strict=True):
                row[:] = np.squeeze(value)
    return out


def along_frames(model: Model, drive: Drive, times: np.ndarray, worlds: int) -> np.ndarray:
    """Paths [F, G, W] at times [F] [s]."""
    return np.stack([along(model, drive, float(t), worlds)[0] for t in times])


def level_of(model: Model, drive: Drive, levels: np.ndarray) -> np.ndarray:
    """Paths [G, W] of levels [channels, W] of a drive; 0 of grips that it does not move."""
    channels = list(drive.signals)
    rows = [levels[channels.index(n)] if n in channels else np.zeros(levels.shape[1]) for n in paths(model)]
    return np.array(rows).reshape(len(rows), levels.shape[1])


def held_at(model: Model, x: np.ndarray, levels: np.ndarray, reference: np.ndarray | None = None) -> np.ndarray:
    """Positions x [N, W, 3] with the held axes of grips where paths [G, W] have them, and all else; see `placed`."""
    if not len(model.grips):
        return x
    held = ((model.grips >= 0)[:, None] & (model.free == 0.0))[:, None]
    return np.where(held, placed(model, levels, reference), x)


def alone(model: Model) -> int | None:
    """The grip that holds the device alone; None if there is none such (0 is a grip)."""
    held = np.unique(model.grips[np.any(model.free == 0.0, axis=1)]) if len(model.grips) else []
    return int(held[0]) if len(held) == 1 and held[0] >= 0 else None


def carried_along(
    model: Model, x: np.ndarray, before: np.ndarray, after: np.ndarray, reference: np.ndarray | None = None
) -> np.ndarray:
    """A guess of positions [N, W, 3] after paths have gone on from [G, W] to others, from positions x [N, W, 3].

    Where one grip alone holds the device, all of it goes along; else what is held.
    """
    if not len(model.grips) or np.array_equal(before, after):
        return x
    only = alone(model)
    if only is not None:
        x = carried(x, model.grip_screws[only], (after - before)[only])
    return held_at(model, x, after, reference)


def ridden(model: Model, state: State, motion: np.ndarray) -> None:
    """Takes a state along with the grip that holds it alone, with its velocities, to paths and rates [3, G, W]."""
    k = alone(model)
    assert k is not None
    way, level = model.grip_screws[k], motion[0, k]
    state.x = carried(state.x, way, level)
    turned = carried(state.v, np.append(way[:3], np.zeros(3)), level)
    state.v = turned + motion[1, k, :, None] * velocity(state.x, way)


def levels_at(model: Model, x: np.ndarray, reference: np.ndarray | None = None) -> np.ndarray:
    """Paths [G, W] that bring the nodes nearest to positions x [N, W, 3]; turns within half a turn."""
    out = np.zeros((len(model.grip_screws), x.shape[1]))
    for k, way in enumerate(model.grip_screws):
        mine = model.grips == k
        before, now = (model.position[:, None] if reference is None else reference)[mine], x[mine]
        if not np.any(way[:3]):
            out[k] = ((now - before) @ way[3:]).mean(axis=0)
            continue
        on = np.cross(way[:3], way[3:])
        sine = (np.cross(before - on, now - on) @ way[:3]).sum(axis=0)
        flat = [a - (a @ way[:3])[..., None] * way[:3] for a in (before - on, now - on)]
        out[k] = np.arctan2(sine, (flat[0] * flat[1]).sum(axis=(0, 2)))
    return out


def way_to(model: Model, x: np.ndarray, paths: np.ndarray, length: float) -> list[np.ndarray]:
    """Paths [G, 1] at the parts of a way to paths, from positions x [N, 1, 3] of one world, these first.

    Who turns from the reference state goes the whole angle, and from anywhere else the shorter way round.
    """
    begin = levels_at(model, x)
    turns = (np.abs(begin) > APART) & np.any(model.grip_screws[:, :3] != 0.0, axis=1)[:, None]
    begin = begin + np.where(turns, 2 * np.pi * np.round((paths - begin) / (2 * np.pi)), 0.0)
    count = steps_to(model, x, paths, length)
    return [begin + (paths - begin) * (k / count) for k in range(count)] + [paths]


def steps_to(model: Model, x: np.ndarray, paths: np.ndarray, length: float) -> int:
    """Into how many parts the way of grips to paths [G, 1] is cut, from positions x [N, 1, 3] of one world.

    A device that one grip holds alone goes along whole. Others bend at each part, by no more than a share of a length.
    """
    if alone(model) is not None:
        return 1
    far = np.linalg.norm(held_at(model, x, paths) - x, axis=-1).max()
    return max(1, int(np.ceil(far / (PART * length))))


PART = 0.1
"""Share of an element's length by which grips move from one equilibrium to the next on a way to one: bars that are
strained by a tenth still come to rest. Half takes twice as long, double loses arches of thick strips."""


def velocities(model: Model, x: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Velocities [N, W, 3] [m/s] of the nodes of grips at positions x [N, W, 3], for paths [3, G, W]."""
    out = np.zeros_like(x)
    for k, way in enumerate(model.grip_screws):
        mine = model.grips == k
        out[mine] = motion[1, k, :, None] * velocity(x[mine], way)
    return out


def accelerations(model: Model, x: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Accelerations [N, W, 3] [m/s^2] of the held axes of grips at positions x [N, W, 3], for paths [3, G, W]."""
    out = np.zeros_like(x)
    for k, way in enumerate(model.grip_screws):
        mine = model.grips == k
        unit = velocity(x[mine], way)
        out[mine] = motion[2, k, :, None] * unit + motion[1, k, :, None] ** 2 * np.cross(way[:3], unit)
    return out * (model.free == 0.0)[:, None]


def poles(model: Model, levels: np.ndarray) -> np.ndarray:
    """Points [G, W, 3] [m] about which moments of the grips are meant, at paths [G, W].

    The middle of the nodes, where it is now, or the point next to their middle on the axis about which they turn.
    """
    out = np.zeros((len(levels), levels.shape[1], 3))
    x = placed(model, levels)
    for k, way in enumerate(model.grip_screws):
        out[k] = x[model.grips == k].mean(axis=0)
        if np.any(way[:3]):
            on = np.cross(way[:3], way[3:])
            out[k] = on + ((out[k] - on) @ way[:3])[:, None] * way[:3]
    return out


def wrenches(model: Model, mass: np.ndarray, x: np.ndarray, force: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """Force [N] and moment about its pole [N m] of each grip on bars [G, W, 6].

    At a held axis the support exerts what the node's mass needs for the acceleration of its path, less all laws.

    Args:
        mass: [N, 1 or W] of the nodes [kg]. x: [N, W, 3] [m]. force: [N, W, 3] of all laws [N].
        motion: paths, rates and accelerations [3, G, W].
    """
    exerted = (model.free == 0.0)[:, None] * (mass[:, :, None] * accelerations(model, x, motion) - force)
    out = np.zeros((len(model.grip_screws), x.shape[1], 6))
    for k, pole in enumerate(poles(model, motion[0])):
        mine = model.grips == k
        out[k, :, :3] = exerted[mine].sum(axis=0)
        out[k, :, 3:] = np.cross(x[mine] - pole, exerted[mine]).sum(axis=0)
    return out


def on_path(model: Model, wrench: np.ndarray) -> np.ndarray:
    """What grips exert along their paths [..., G, W]: a force along the direction [N], a moment about the axis [N m].

    Args:
        wrench: of the grips [..., G, W, 6].
    """
    turns = np.any(model.grip_screws[:, :3] != 0.0, axis=1)
    way = np.where(turns[:, None], model.grip_screws[:, :3], model.grip_screws[:, 3:])
    part = np.where(turns[:, None, None], wrench[..., 3:], wrench[..., :3])
    way = way[:, None]
    return np.where(way == 0.0, 0.0, part * way).sum(axis=-1)  # a component that is open elsewhere is no matter


def work(levels: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Work of all grips since the first frame [F, W] [J], of loads along paths, both [F, G, W]: trapezoids."""
    spent = (0.5 * (load[1:] + load[:-1]) * np.diff(levels, axis=0)).sum(axis=1)
    return np.concatenate([np.zeros((1, levels.shape[2])), np.cumsum(spent, axis=0)])


def refuse_jump(model: Model, x: np.ndarray, levels: np.ndarray) -> None:
    """Refuses a start in which held nodes are not where their grips are.

    Args:
        x: [N, W, 3] positions at the start. levels: paths [G, W] then.

    Raises:
        InputError: naming the grip and how far off it is.
    """
    size = float(np.ptp(model.position, axis=0).max(initial=0.0)) or 1.0
    off = np.linalg.norm(held_at(model, x, levels) - x, axis=-1).max(axis=1)
    worst = int(off.argmax())
    if off[worst] > APART * size:
        raise InputError(
            f"a grip cannot jump: it is {off[worst] * 1e3:.3g} mm from where the motion starts",
            field=paths(model)[int(model.grips[worst])],
            allowed="a path from 0 on, such as ramp('5 mm', '1 s'), or a state that is there, as of an equilibrium",
        )


def torn(model: Model, x: np.ndarray, levels: np.ndarray) -> list[tuple[int, str]]:
    """[W] the node farthest from its grip, at x [N, W, 3] and paths [G, W], and why panels are torn; "": none is."""
    size = float(np.ptp(model.position, axis=0).max(initial=0.0)) or 1.0
    off = np.linalg.norm(held_at(model, x, levels) - x, axis=-1)
    out = []
    for w, worst in enumerate(off.argmax(axis=0).tolist()):
        far = off[worst, w]
        name = paths(model)[int(model.grips[worst])].partition("_")[2] if model.grips[worst] >= 0 else ""
        said = f"the grips tear the rigid panels: node {worst} is {far * 1e3:.3g} mm from its grip '{name}'"
        out.append((worst, said if not far <= TEARS * size else ""))
    return out


TEARS = 1e-4
"""Distance over the device's size from which panels no longer reach their grip: loops stay closed to 1e-9 and less."""

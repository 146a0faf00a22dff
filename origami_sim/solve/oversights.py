"""What a designer may have overlooked, in sentences: idle drives, what is inside the ground, tables left."""

import numpy as np

from origami_sim.drive import Drive
from origami_sim.effects import CONTACTS, get
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters
from origami_sim.model.clearance import gaps, heights
from origami_sim.physics.materials import G

THROWN = 0.01
"""Height, over the device's size, to which a ground that it starts inside may throw it before that is refused.

Devices at rest on soft ground come to 1e-4 and less, those that were put too low by mistake to 0.1 and more; so half
and double refuse the same ones.
"""

SUNK = 0.01
"""Depth, over the device's size, to which feet may sink before a note says that the ground is soft.

A sheet on `Sheet.ground` sinks by 1e-4, on single points by some 1e-3. Half notes soft mats, double lets a tenth of a
centimetre pass on a device of five.
"""

BREAKDOWN = 35e6, 70e6
"""Fields at which an acrylic elastomer (3M VHB 4905) breaks down [V/m]: as it comes, and drawn to six times its length.

Smirnov, Springhetti, Morozov and Lukin 2018, Technical Physics: 35 to 70 kV/mm, slowly raised voltage.
"""

FLAT = 1e-9
"""Thickness over the device's size below which panels lie in one plane: rounding leaves 1e-16, and what is folded by
1e-6 rad is no longer flat. Half and double change nothing."""

_CHANNELS = {
    "field": "field_",
    "gradient": "source_",
    "voltage": "voltage_",
    "temperature": "temperature",
    "load": "load",
}


def idle_drives(model: Model, parameters: Parameters, drive: Drive) -> list[str]:
    """What the drive has and the model does not answer to, and feet without a ground."""
    notes = []
    if "ground" not in model.laws and len(model.contacts) and any(get(e).family in CONTACTS for e in model.laws):
        notes.append("There are feet or contact points, and no ground that they could touch: Sheet.ground().")
    for kind, prefix in _CHANNELS.items():
        channels = [n for n, s in drive.signals.items() if n.startswith(prefix) and not s.is_zero]
        if prefix == "source_" and not any(n.endswith("_strength") for n in channels):
            continue
        if not channels:
            continue
        acting = [e for e in map(get, model.laws) if kind in e.drives and _acts(model, parameters, e.name)]
        if not acting:
            notes.append(_IDLE[kind])
        elif kind == "voltage":
            wired = set(model.electrodes[_electroded(model, parameters)].tolist())
            idle = [n for n in channels if int(n.removeprefix(prefix)) not in wired]
            notes += [f"The drive has {n}, and no crease is in that electrode group." for n in idle]
    return notes


_IDLE = {
    "field": "The drive has a field, and nothing here is magnetic: state it with Sheet.patch(..., poling=...).",
    "gradient": "There are magnets or coils, and nothing here feels them: Sheet.patch(..., poling=...) with "
    "Sheet.on('field_gradient'), or Sheet.soften(...).",
    "voltage": "The drive has a voltage, and nothing here has electrodes: state them with Sheet.electrode(...).",
    "temperature": "The drive has a temperature, and nothing here depends on it: Sheet.set('crease_thermal', ...).",
    "load": "The drive has a load factor, and nothing here is loaded: Sheet.set('load', ...) or 'crease_drive'.",
}


def _acts(model: Model, parameters: Parameters, effect: str) -> bool:
    """Whether an effect that asks for the drive has anywhere what lets it act: a magnet, a stack, a strength."""
    own = parameters.of(effect)
    if "remanence" in own and "volume" in own:
        return bool(np.any(own["remanence"] * own["volume"]))
    if "layers" in own and "width" in own:
        return bool(np.any(own["layers"] * own["width"]))
    strong = [p.name for p in get(effect).strengths]
    return not strong or any(np.any(own[n]) for n in strong)


def _electroded(model: Model, parameters: Parameters) -> np.ndarray:
    """[C + Q] hinges at which any effect feels a voltage."""
    out = np.zeros(len(model.creases) + len(model.bends), bool)
    for effect in (e for e in map(get, model.laws) if "voltage" in e.drives):
        own = parameters.of(effect.name)
        on = own["layers"] * own["width"] if "layers" in own and "width" in own else np.ones((1, 1))
        part = slice(None, len(model.creases)) if effect.family == "crease" else slice(len(model.creases), None)
        if effect.family in ("crease", "bend"):
            out[part] |= np.any(on, axis=1)
        else:
            out[:] = True
    return out


def beyond_breakdown(model: Model, parameters: Parameters, drive: Drive, end: float) -> list[str]:
    """Where a voltage asks of layers more than an acrylic elastomer holds, until a time `end` [s].

    The field is that in layers of their stated thickness; those that thin out have more.
    """
    peaks = {
        int(n.removeprefix("voltage_")): float(np.abs(s(s.sampled(end)[:, None])).max())
        for n, s in drive.signals.items()
        if n.startswith("voltage_")
    }
    worst: tuple[float, float, float, str] | None = None
    for effect in (e for e in map(get, model.laws) if "voltage" in e.drives):
        own = parameters.of(effect.name)
        if not {"layers", "width", "layer_thickness"} <= set(own) or not peaks:
            continue
        thin = np.where(own["layers"] * own["width"] > 0, own["layer_thickness"], np.inf).min(axis=1)
        volts = np.full(len(thin), max(peaks.values()))
        if effect.family in ("crease", "bend"):
            part = slice(None, len(model.creases)) if effect.family == "crease" else slice(len(model.creases), None)
            volts = np.array([peaks.get(int(g), 0.0) for g in model.electrodes[part]])
        k = int((volts / thin).argmax()) if len(thin) else 0
        if len(thin) and (worst is None or volts[k] / thin[k] > worst[0]):
            worst = volts[k] / thin[k], volts[k], thin[k], model.name(effect.family, k)
    if worst is None or worst[0] <= BREAKDOWN[0]:
        return []
    low, high = (1e-6 * b for b in BREAKDOWN)
    return [
        f"The field in the layers of {worst[3]} comes to {1e-6 * worst[0]:.3g} MV/m ({1e-3 * worst[1]:.3g} kV over "
        f"{1e3 * worst[2]:.3g} mm): acrylic elastomer breaks down at {low:g} MV/m, drawn to six times its length at "
        f"{high:g} MV/m (VHB 4905, Smirnov et al. 2018)."
    ]


def refuse_start_outside_tables(
    model: Model, parameters: Parameters, drive: Drive, x: np.ndarray, time: float = 0.0
) -> None:
    """Refuses a start at which a magnet lies outside of a table of the field.

    Args:
        x: [N, W, 3] positions at the start [m]. time: of the start [s].

    Raises:
        InputError: naming the panel and where the table ends.
    """
    for t, w, k in outside_tables(model, parameters, drive, x, time)[:1]:
        table = drive.placed[k][1]
        assert table is not None
        at = x[model.triangles[t], w].mean(axis=0)
        raise InputError(
            "a magnet starts outside the table of the field",
            file=table.file,
            field=model.name("panel", int(model.triangle_panel[t])),
            value=f"({', '.join(f'{v * 1e3:.4g}' for v in at)}) mm",
            allowed=" x ".join(f"{a[0] * 1e3:.4g} to {a[-1] * 1e3:.4g}" for a in table.axes)
            + " mm, shifted by its position",
        )


def outside_tables(
    model: Model, parameters: Parameters, drive: Drive, x: np.ndarray, time: float
) -> list[tuple[int, int, int]]:
    """Triangles with a magnet that are outside of a table, with the world and the table's number."""
    magnetic = np.zeros(len(model.triangles), bool)
    for name in model.laws:
        own = parameters.of(name)
        if get(name).family == "triangle" and "volume" in own:
            magnetic |= np.broadcast_to(np.any(own["volume"] > 0, axis=1), magnetic.shape)
    out = []
    for k, (_, table) in enumerate(drive.placed):
        if table is None or not np.any(magnetic):
            continue
        shift = np.stack(
            [np.broadcast_to(np.ravel(drive[f"source_{k}_{a}"](time)), x.shape[1]) for a in "xyz"], axis=-1
        )
        at = x[model.triangles].mean(axis=1) - shift  # [T, W, 3]
        low, high = (np.array([a[e] for a in table.axes]) for e in (0, -1))
        slack = 1e-9 * (high - low)
        off = ~np.all((at >= low - slack) & (at <= high + slack), axis=-1) & magnetic[:, None]
        out += [(int(t), int(w), k) for t, w in np.argwhere(off)]
    return out


def refuse_start_inside_the_ground(model: Model, parameters: Parameters, x: np.ndarray, energy: np.ndarray) -> None:
    """Refuses a start from which the ground would throw the device up.

    Args:
        x: [N, W, 3] positions at the start [m]. energy: [W] what the ground has stored there [J].

    Raises:
        InputError: naming the deepest contact point.
    """
    weight = G * np.broadcast_to(parameters["inertia", "mass"].sum(axis=0), energy.shape)
    thrown = energy / weight
    w = int(thrown.argmax())
    if thrown[w] > THROWN * _size(model):
        gap = gaps(model, parameters, x)[:, w]
        deepest = int(gap.argmin())
        raise InputError(
            f"the device starts {-gap[deepest] * 1e3:.3g} mm inside the ground, which would throw it "
            f"{thrown[w] * 1e3:.3g} mm up",
            field=model.name("contact", deepest),
            value=float(gap[deepest]),
            allowed="a start above the ground; Sheet.ground() lifts a sheet there",
        )


def below_the_ground(model: Model, parameters: Parameters, x: np.ndarray) -> list[str]:
    """Where a motion ends inside the ground; positions x [N, W, 3] [m]."""
    if "ground" not in model.laws or not len(model.contacts):
        return []
    nodes = np.unique(model.triangles)
    size, notes = _size(model), []
    lost = ~np.all(np.isfinite(x), axis=(0, 2))
    if np.all(lost):
        return []
    x = np.where(lost[:, None], x[:, [int(np.argmin(lost))]], x)  # worlds that went unstable are like a sound one
    touching, height = gaps(model, parameters, x), heights(parameters, x[nodes])
    w = int(touching.min(axis=0).argmin())
    foot = int(touching[:, w].argmin())
    if touching[foot, w] < -SUNK * size:
        notes.append(
            f"{model.name('contact', foot)} ends {-touching[foot, w] * 1e3:.2g} mm deep in the ground: it is too soft "
            f"for this weight; Sheet.ground() chooses its stiffness."
        )
    below = np.minimum(touching.min(axis=0), 0.0) - height  # deeper than anything that can touch
    node, w = np.unravel_index(int(below.argmax()), below.shape)
    if below[node, w] > 1e-6 * size:
        where = f" in world {w}" if below.shape[1] > 1 else ""
        notes.append(
            f"Node {nodes[node]} ends {-height[node, w] * 1e3:.2g} mm below the ground{where}, which it passed because "
            "it has no contact point there: Sheet.ground() gives one to every node, and both_sides=True to both sides."
        )
    return notes


def beyond_crease_tables(model: Model, parameters: Parameters, angles: np.ndarray) -> list[str]:
    """Where a motion leaves the table of a crease, beyond which its moment goes straight on.

    Args:
        angles: [F, C + Q, W] of the hinges in the frames, creases first [rad].
    """
    if "crease_table" not in model.laws:
        return []
    own = parameters.of("crease_table")
    tabled = np.any(own["resisting_moment"], axis=-1)
    seen = np.nan_to_num(angles[:, : len(model.creases)])  # worlds that went unstable are like flat ones
    ends = own["angle_min"], own["angle_max"]
    over = np.where(tabled, np.maximum(ends[0] - seen.min(axis=0), seen.max(axis=0) - ends[1]), -np.inf)
    left = np.flatnonzero(over.max(axis=1, initial=-np.inf) > 1e-9)
    if not len(left):
        return []
    c, w = np.unravel_index(int(over.argmax()), over.shape)
    low, high = (np.degrees(np.broadcast_to(e, over.shape)[c, w]) for e in ends)
    first, last = np.degrees([seen[:, c, w].min(), seen[:, c, w].max()])
    at = first if low - first > last - high else last
    others = f", and {len(left) - 1} more creases leave theirs" if len(left) > 1 else ""
    return [
        f"{model.name('crease', int(c))} folds to {at:.4g} deg, and the table of its moment goes from {low:.4g} to "
        f"{high:.4g} deg{others}: beyond, the moment goes straight on, which may be wrong."
    ]


def starts_flat(model: Model, x: np.ndarray) -> list[str]:
    """What is to be said of rigid panels that close loops, if they start in one plane at positions x [N, W, 3] [m]."""
    corners = x[np.unique(model.triangles)]
    flattest = np.linalg.svd(np.moveaxis(corners - corners.mean(axis=0), 1, 0), compute_uv=False)[:, -1].min()
    if flattest > FLAT * _size(model):
        return []
    return [
        "The panels start flat, which is a singular state of every closed loop: rounding decides which way each folds, "
        "and steps are many times shorter. Start folded (a pattern's fold_angle), or take panels='elastic'."
    ]


def _size(model: Model) -> float:
    return float(np.ptp(model.position, axis=0).max())

"""The observer: what the channels of a recording would have read during a simulated run, or along its equilibria."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from origami_sim.drive import Drive, Signal, series
from origami_sim.effects import CONTACTS, get
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, State, node_mass
from origami_sim.model.distort import distorted
from origami_sim.observation.attachments import body_axes, body_point, find, index_of, panel_of, panel_point
from origami_sim.observation.grips import grip_of, of_grip, refuse_moving
from origami_sim.recording import Channel, Recording, applied_drive
from origami_sim.solve.batch import Batch
from origami_sim.solve.grips import levels_at, moving, standing
from origami_sim.solve.motion.dynamics import Trajectory
from origami_sim.solve.motion.gripped import exerted
from origami_sim.solve.rigid.reactions import held_nodes, support_of_all
from origami_sim.solve.rigid.topology import Topology
from origami_sim.solve.statics.equilibria import Equilibrium, equilibrium

STAMPS = 1e-3
"""Part of a frame by which a recording may last longer than a run: stamps are rounded, and runs end at whole frames."""

FAR = 5.0
"""Sizes of a panel from its middle beyond which a point is none of its body."""


def observe(trajectory: Trajectory, recording: Recording, *, world: int = 0) -> dict[str, np.ndarray]:
    """Simulated channels at the recording's times, by channel name: (n,) or (n, d) [SI].

    Angles are continuous and start in the recording's turn. Frames are joined by cubic splines. Effects of the family
    "measurement" that the model has on act on the channels that they name, in their order.

    Raises:
        InputError: a channel attached to something that the model does not have, a run shorter than the recording.
    """
    if recording.by_step:
        raise InputError(
            "a quasi-static curve is observed along equilibria, not in a run",
            field="recording",
            value=recording.name,
            allowed="observe_equilibria",
        )
    times = recording.times - recording.times[0]
    frames = trajectory.times - trajectory.times[0]
    if times[-1] > frames[-1] + STAMPS * (frames[-1] / max(len(frames) - 1, 1)):
        raise InputError(
            "the run is shorter than the recording",
            field="duration",
            value=float(frames[-1]),
            allowed=f">= {times[-1]:g} s",
        )
    aligned = len(frames) >= len(times) and np.allclose(frames[: len(times)], times, atol=1e-9)
    out = {}
    for index, (name, channel) in enumerate(recording.channels.items()):
        values = channel_frames(trajectory, channel, world=world)
        if channel.is_angle:
            values = values + _turns(channel, values[0])
        if _measured(trajectory.model, channel):
            out[name] = _distorted(trajectory, channel, index, frames, values, times, world)
        else:
            out[name] = values[: len(times)] if aligned else CubicSpline(frames, values)(times)
    return out


def observe_equilibria(
    model: Model, parameters: Parameters, equilibria: Sequence[Equilibrium], recording: Recording
) -> dict[str, np.ndarray]:
    """Simulated channels of a quasi-static curve, one equilibrium per load step: (n,) or (n, d) [SI], by channel name.

    Displacements are those since the first step. Parameters are of one world.

    Raises:
        InputError: another number of equilibria than steps, one that was not found, a channel that the model lacks.
    """
    if len(equilibria) != recording.frame_count:
        raise InputError(
            "a quasi-static curve needs one equilibrium per load step",
            field="equilibria",
            value=len(equilibria),
            allowed=str(recording.frame_count),
        )
    for step, found in enumerate(equilibria):
        if not found.converged:
            raise InputError(f"there is no equilibrium at step {step}: {found.message}", field="equilibria", value=step)
    poses = Poses(
        model=model,
        parameters=parameters,
        x=np.stack([e.x for e in equilibria]),
        angles=np.stack([e.angles for e in equilibria]),
        times=np.zeros(len(equilibria)),
        state=State.join([e.state for e in equilibria]),
        drive=_held(_reaching(model, parameters, recording)),
    )
    out = {}
    for name, channel in recording.channels.items():
        values = read_channel(poses, channel)
        out[name] = values + _turns(channel, values[0]) if channel.is_angle else values
    return out


def follow(
    model: Model, parameters: Parameters, recording: Recording, *, state: State | None = None, **options
) -> list[Equilibrium]:
    """The equilibria of a quasi-static curve, each found from the one before, with the drive of its load step.

    The branch that is followed is the one that a slow loading follows: where it ends, the next one is found.

    Args:
        model, parameters: one world of each.
        recording: drive levels by load step.
        state: where the first step starts (default: the reference state).
        options: of `origami_sim.solve.statics.equilibria.equilibrium`, e.g. tolerance.
    """
    found: list[Equilibrium] = []
    drives = _reaching(model, parameters, recording)
    model = model.with_effects(without=tuple(e for e in model.effects if get(e).family == "drive"))
    parameters = parameters.for_model(model)
    for drive in drives:
        found.append(equilibrium(model, parameters, drive, state=state, **options))
        state = found[-1].state
    return found


def _reaching(model: Model, parameters: Parameters, recording: Recording) -> list[Drive]:
    """The drive of each load step as it reaches the device; what distorts it may remember earlier steps."""
    steps = [applied_drive(recording, step=k) for k in range(recording.frame_count)]
    levels = {n: np.array([np.ravel(d[n](0.0))[0] for d in steps]) for n in steps[0].signals}
    clock = np.arange(len(steps), dtype=float)
    path = steps[0].replace(**{n: series(clock, v) for n, v in levels.items() if np.any(v != v[0])})
    reached = distorted(model, parameters, path, clock[-1])
    return [reached.held(float(t)) for t in clock]


@dataclass(frozen=True, eq=False)
class Poses:
    """What a channel can be read from: frames of one world.

    Attributes:
        model, parameters: of one world.
        x: [F, N, 3] positions [m]. angles: [F, C + Q] continuous hinge angles [rad].
        times: [F] [s]. state, drive: every frame as a world, with velocities and memory, and what is held in it; needed
            for forces only.
    """

    model: Model
    parameters: Parameters
    x: np.ndarray
    angles: np.ndarray
    times: np.ndarray
    state: State | None = None
    drive: Drive | None = None


def channel_frames(trajectory: Trajectory, channel: Channel, *, world: int = 0) -> np.ndarray:
    """One simulated channel at the frames of the run: (F,) or (F, d) [SI]."""
    grip = "grip" in channel.attachment
    if trajectory.grip_wrenches is not None and (grip or channel.kind == "force"):
        refuse_moving(trajectory.model, channel)
        if grip:
            k = grip_of(trajectory.model, channel)
            return of_grip(trajectory.model, channel, trajectory.grip_wrenches[:, k, world])
    state, drive = _frames(trajectory, world) if grip or channel.kind == "force" else (None, None)
    parameters = trajectory.parameters
    poses = Poses(
        model=trajectory.model,
        parameters=parameters.world(world if parameters.worlds > 1 else 0),
        x=trajectory.x[:, :, world],
        angles=trajectory.angles[:, :, world],
        times=trajectory.times,
        state=state,
        drive=drive,
    )
    return read_channel(poses, channel)


def read_channel(poses: Poses, channel: Channel) -> np.ndarray:
    """One channel at all frames: (F,) or (F, d) [SI].

    - crease_angle: the fold angle, valley positive. panel_angle: see `panel_angle`.
    - marker: a point of the body, see `body_point`. marker_2d: its projection on the channel's camera plane.
    - tip_displacement: what the point has moved since the first frame: a vector (three components), its part along the
      attachment's direction, or its length.
    - force: of the support or the ground on the object, see `support_force`: a vector, or its part along the direction;
      of a grip as well, or along its path. moment: of a grip about the axis about which it turns.

    Raises:
        InputError: a channel attached to something that the model does not have, or that says too little.
    """
    model, x = poses.model, poses.x
    if channel.kind == "crease_angle":
        return poses.angles[:, index_of(model, channel, "crease", len(model.creases))]
    if channel.kind == "panel_angle":
        return panel_angle(model, x, panel_of(model, channel))
    if "grip" in channel.attachment:
        return of_grip(model, channel, grip_wrench(poses, channel))
    if channel.kind == "force":
        return _part(channel, support_force(poses, channel))
    point = body_point(model, x, channel)
    if channel.kind == "marker":
        return point
    if channel.kind == "marker_2d":
        if channel.camera is None:
            raise InputError("a marker in a picture needs a camera", field=f"channels.{channel.name}.camera")
        return channel.camera.project(point)
    moved = point - point[0]
    if channel.values.ndim == 1 and "direction" not in channel.attachment:
        return np.linalg.norm(moved, axis=1)
    return _part(channel, moved)


def support_force(poses: Poses, channel: Channel) -> np.ndarray:
    """Force on the object of its support at a `node` or some `nodes`, or of the `ground`: (F, 3) [N].

    At a held axis nothing accelerates, so the support exerts minus the sum of all effects there (weights included, like
    a load cell that is not set to zero). Axes that are free count nothing. The ground's force is the sum of all contact
    effects. The drive is taken at each frame; memory at its value of the state.

    Of rigid panels only the force of all supports together is determined (`solve.rigid.reactions`): how held nodes
    share it is not.

    Raises:
        InputError: nodes of which no axis is held, a ground without contact effects; in a run, an effect with memory
            that acts there, because a trajectory keeps no memory; some only of the nodes that hold rigid panels.
    """
    model = poses.model
    field = f"channels.{channel.name}"
    ground = bool(channel.attachment.get("ground", False))
    many = channel.attachment.get("nodes")
    names = [channel.attachment.get("node")] if many is None else many
    nodes = [] if ground else [find(model, channel, "node", one, len(model.position)) for one in names]
    contacts = [n for n in model.laws if get(n).family in CONTACTS]
    if ground and not contacts:
        raise InputError("the model has no contact with the ground", field=field + ".ground", value=True)
    held = 1.0 - model.free[nodes]
    if not ground and not held.any():
        raise InputError("no axis of these nodes is held", field=field, value=nodes, allowed="supported nodes")
    together = model.panels == "rigid" and not ground
    missing = sorted(set(held_nodes(model).tolist()) - set(nodes)) if together else []
    if missing:
        raise InputError(
            "how the nodes that hold rigid panels share their force is not determined: a channel has to read all",
            field=f"{field}.nodes",
            value=nodes,
            allowed=f"nodes {held_nodes(model).tolist()}, or panels = 'elastic'",
        )
    if poses.state is None or poses.drive is None:
        raise InputError("a force needs states and a drive", field=field)
    batch = Batch(model, poses.parameters, poses.drive, poses.state)

    def acting(time: float) -> np.ndarray:
        """Forces [N, F, 3] of contacts or of all effects, the drive being held in every frame."""
        if not ground:
            return batch.total_force(time)
        forces = batch.evaluate(time).forces
        return sum((forces[n] for n in contacts), np.zeros_like(forces[contacts[0]]))

    if any("time" in get(n).drives for n in model.laws):  # such a law sees the time of its own frame
        force = np.stack([acting(float(time))[:, frame] for frame, time in enumerate(poses.times)], axis=1)
    else:
        force = acting(0.0)
    if together:
        mass = np.broadcast_to(node_mass(model, poses.parameters), (len(model.position), 1))[:, 0]
        return support_of_all(model, mass, poses.state.x, poses.state.v, force)
    return force.sum(axis=0) if ground else -(held[:, None] * force[nodes]).sum(axis=0)


def grip_wrench(poses: Poses, channel: Channel) -> np.ndarray:
    """Force [N] and moment about its pole [N m] of a channel's grip on what is at rest: (F, 6)."""
    model, grip = poses.model, grip_of(poses.model, channel)
    if poses.state is None or poses.drive is None:
        raise InputError("a force needs states and a drive", field=f"channels.{channel.name}")
    motion = standing(levels_at(model, poses.drive, 0.0, poses.state.worlds))
    force = Batch(model, poses.parameters, poses.drive, poses.state).total_force(0.0)
    tree = Topology(model, moving(model, poses.drive)) if model.panels == "rigid" else None
    return exerted(model, poses.state.x, force, motion, tree=tree)[grip]


def panel_angle(model: Model, x: np.ndarray, panel: int) -> np.ndarray:
    """Absolute angle of a panel about the y axis, from the upright (+z) towards +x, continuous: (F,) [rad].

    The panel's direction runs from the middle of its first crease to its centroid; x [F, N, 3].
    """
    triangles = model.triangles[model.triangle_panel == panel]
    nodes = set(np.unique(triangles).tolist())
    axes = [c[1:3] for c in model.creases if {int(c[1]), int(c[2])} <= nodes]
    if not axes:
        raise InputError("a panel angle needs a crease on the panel", field="panel", value=panel)
    start = x[:, axes[0]].mean(axis=1)
    along = x[:, triangles].mean(axis=(1, 2)) - start
    return np.unwrap(np.arctan2(along[:, 0], along[:, 2]))


def check_scene(recording: Recording, model: Model) -> list[str]:
    """Whether a recording can be of this model: notes, one sentence each, on sizes that do not match.

    Raises:
        InputError: a channel attached to something that the model does not have, or to a point far off its panel; a
            crease that turns farther than any can.
    """
    size = float(np.linalg.norm(np.ptp(model.position, axis=0)))
    rest = model.position[None]
    zero = State.at_rest(model)
    notes = []
    for name, channel in recording.channels.items():
        if "grip" in channel.attachment:
            of_grip(model, channel, np.zeros((1, 6)))
            continue
        if channel.kind == "force":
            many = channel.attachment.get("nodes", [channel.attachment.get("node")])
            if not channel.attachment.get("ground"):
                nodes = [find(model, channel, "node", one, len(model.position)) for one in many]
                if not (model.free[nodes] == 0).any():
                    raise InputError(
                        "no axis of these nodes is held",
                        field=f"channels.{name}",
                        value=nodes,
                        allowed="supported nodes",
                    )
            continue
        if channel.kind == "moment":
            index_of(model, channel, "crease", len(model.creases))
            continue
        read_channel(Poses(model, Parameters(model), rest, zero.angles.T, np.zeros(1)), channel)
        _check_point(model, channel)
        columns = channel.values.reshape(recording.frame_count, -1)
        if channel.is_angle:
            _check_fold(channel)
            continue
        spread = float(np.linalg.norm(np.nanmax(columns, axis=0) - np.nanmin(columns, axis=0)))
        if spread > 20.0 * size > 0.0:  # a body of one node has no size
            notes.append(
                f"Channel '{name}' moves by {spread:.4g} m, {spread / size:.3g} times the size of the model: "
                "millimetres or pixels read as metres?"
            )
        elif 0.0 < spread < 1e-5 * size:
            notes.append(
                f"Channel '{name}' moves by {spread:.4g} m only, {spread / size:.2g} of the size of the model: "
                "metres read as millimetres?"
            )
    return notes


def _check_point(model: Model, channel: Channel) -> None:
    """Refuses a point that lies too far off its panel to be one of it."""
    key = next((k for k in ("point", "distance") if k in channel.attachment), None)
    if "panel" not in channel.attachment or key is None:
        return
    panel = panel_of(model, channel)
    corners = model.position[np.unique(model.triangles[model.triangle_panel == panel])]
    size = float(np.linalg.norm(np.ptp(corners, axis=0)))
    far = float(np.linalg.norm(panel_point(model, channel) - corners.mean(axis=0)))
    if far > FAR * size:
        raise InputError(
            f"the point is {far:.3g} m off the middle of a panel of {size:.3g} m",
            field=f"channels.{channel.name}.{key}",
            value=channel.attachment[key],
            allowed=f"up to {FAR * size:.3g} m (millimetres read as metres?)",
        )


def _check_fold(channel: Channel) -> None:
    """Refuses a fold angle of more than a turn, or that changes by more."""
    seen = channel.values[np.isfinite(channel.values)]
    turned = float(max(np.abs(seen).max(initial=0.0), np.ptp(seen) if len(seen) else 0.0))
    if channel.kind == "crease_angle" and turned > 2 * np.pi:
        raise InputError(
            f"channel '{channel.name}' turns by {turned:.4g} rad, more than a crease can",
            field=f"channels.{channel.name}.unit",
            allowed="fold angles within 2 pi (degrees read as radians?)",
        )


def _part(channel: Channel, vectors: np.ndarray) -> np.ndarray:
    """Vectors (F, 3), or their part along the direction of a channel of one column (F,)."""
    count = 1 if channel.values.ndim == 1 else channel.values.shape[1]
    if count == 3:
        return vectors
    direction = channel.attachment.get("direction")
    if count != 1 or direction is None:
        raise InputError(
            f"a {channel.kind} of {count} column{'s' if count > 1 else ''} cannot be observed without a direction",
            field=f"channels.{channel.name}.direction",
            allowed="one column with a direction, or three columns",
        )
    return vectors @ np.asarray(direction, float)


def _turns(channel: Channel, first: float) -> float:
    """Whole turns that bring an angle [rad] into the turn in which the recording starts."""
    seen = channel.values[np.isfinite(channel.values)]
    return 2 * np.pi * float(np.round((seen[0] - first) / (2 * np.pi)))


def _measured(model: Model, channel: Channel) -> list[str]:
    """The measurement effects of the model that act on a channel."""
    effects = (get(name) for name in model.effects)
    return [e.name for e in effects if e.family == "measurement" and (not e.channels or channel.kind in e.channels)]


def _distorted(trajectory, channel, index, frames, values, times, world) -> np.ndarray:
    """The channel (n,) or (n, d) after the measurement effects; the run is held at its ends."""
    columns = values.reshape(len(frames), -1)
    if channel.kind == "marker_2d":  # until it is measured, a picture has a depth
        depth = channel.camera.depth(body_point(trajectory.model, trajectory.x[:, :, world], channel))
        columns = np.column_stack([columns, depth])
    measured = sorted(_measured(trajectory.model, channel), key=lambda name: not get(name).on_body)
    if measured and get(measured[0]).on_body:
        axes = body_axes(trajectory.model, trajectory.x[:, :, world], channel)
        columns = np.column_stack([columns, axes.reshape(len(frames), -1)])
    spline = CubicSpline(frames, columns)

    def read(at: np.ndarray) -> np.ndarray:
        return np.moveaxis(spline(np.clip(at, frames[0], frames[-1])), -1, 1)  # [n, W, d] -> [n, d, W]

    for name in measured:
        row = index if trajectory.model.channels > 1 else 0
        read = _through(get(name), trajectory.parameters, row, world, read)
    seen = read(times[:, None])[:, : values[0].size, 0]
    return seen.reshape(len(times), *values.shape[1:])


def _through(effect, parameters: Parameters, row: int, world: int, read):
    given = {n: v[row, [world if v.shape[1] > 1 else 0]] for n, v in parameters.of(effect.name).items()}
    return lambda at: effect.apply(read, at, **given)


def _frames(trajectory: Trajectory, world: int) -> tuple[State, Drive]:
    """State and drive of every frame of one world, each as a world."""
    model = trajectory.model
    memory = [n for n in model.laws if get(n).memory]
    if memory:
        raise InputError(
            "a run keeps no memory of the effects, so that a force cannot be observed in it",
            field="effects",
            value=", ".join(memory),
            allowed="effects without memory, or equilibria",
        )
    state = State.at_rest(model, len(trajectory.times))
    state.x, state.v = (np.ascontiguousarray(a[:, :, world].swapaxes(0, 1)) for a in (trajectory.x, trajectory.v))
    state.angles = np.ascontiguousarray(trajectory.angles[:, :, world].T)
    drive = distorted(model, trajectory.parameters, trajectory.drive, float(trajectory.times[-1]))
    values = {}
    for name, signal in drive.signals.items():
        of_worlds = np.asarray(signal(trajectory.times[:, None])).reshape(len(trajectory.times), -1)
        values[name] = of_worlds[:, world if of_worlds.shape[1] > 1 else 0]
    return state, _of_values(drive, values)


def _held(drives: Sequence[Drive]) -> Drive:
    """One drive of as many worlds, each holding the value at time 0 of its own."""
    return _of_values(drives[0], {n: np.array([np.ravel(d[n](0.0))[0] for d in drives]) for n in drives[0].signals})


def _of_values(drive: Drive, values: dict[str, np.ndarray]) -> Drive:
    """The drive, held at these values (F,) by channel, one world each."""
    return drive.with_signals({n: Signal(offset=v) for n, v in values.items()})

"""A chain of rigid arms on hinges, with its published parameters, beside a recording.

    python -m origami_sim.scenes.pendulum_chain

The calibration has two arms; one without mass ends the chain, and a calibration may state further ones (`mass_3`,
`centre_3`, `length_3`, `inertia_3`, `viscosity_3`, `angle_3`, `rate_3`). Angles are those of the recording: absolute,
from the upright vertical.
"""

import numpy as np

from origami_sim.design.build import Sheet
from origami_sim.device.begun import filmed
from origami_sim.device.scene import Outcome, Progress, Settings, motion_of
from origami_sim.drive import Drive
from origami_sim.model import Model, Parameters, State
from origami_sim.observation.observe import observe, panel_angle
from origami_sim.pattern import strip
from origami_sim.recording import Recording, initial_angles
from origami_sim.recording.possible import Possible
from origami_sim.solve.motion.dynamics import Trajectory, simulate

CALIBRATION = "pendulum_chain"
POSSIBLE = Possible(tilt=0.0)
"""What the rig can do in a further recording: it is screwed to its bench."""

SERIES = ("mass", "centre", "length", "inertia", "viscosity", "angle", "rate")
"""Settings of one arm; a calibration may state further arms."""

WIDTH, MOUNT = 0.02, 0.04
"""Drawn width of the arms and length of the mount [m]; only the masses on it matter."""


def arms(s: Settings) -> list[int]:
    """Numbers of the arms, down to the first that has no mass."""
    out = []
    while f"mass_{len(out) + 1}" in s and _number(s, "mass", len(out) + 1) > 0:
        out.append(len(out) + 1)
    return out


def of_arms(s: Settings, name: str) -> np.ndarray:
    """(n,) a setting of every arm [SI]."""
    return np.array([_number(s, name, k) for k in arms(s)])


def _number(s: Settings, name: str, arm: int) -> float:
    return float(s[f"{name}_{arm}"].value)


def build(s: Settings) -> tuple[Model, Parameters, Drive]:
    """Mount and arms hanging straight; each arm has its mass, centre and inertia."""
    lengths = of_arms(s, "length")
    pattern = strip([MOUNT, *lengths], WIDTH)
    pattern.vertices = pattern.vertices[:, [2, 1, 0]] * (1, 1, -1)  # hanging down
    sheet = Sheet(pattern, thickness=0.005, material="aluminium", triangulation="center", panels=s.panels or "elastic")
    sheet.fix(panels=[0])
    for k, upper in zip(arms(s), MOUNT + np.cumsum(lengths) - lengths, strict=True):
        centre = (0, 0, -upper - _number(s, "centre", k))
        sheet.body(k, mass=_number(s, "mass", k), centre=centre, inertia=_number(s, "inertia", k), about=(0, 1, 0))
    sheet.on("bars").set("bars", stiffness=s.membrane_stiffness)
    sheet.set("panel_bending", stiffness=s.membrane_stiffness * (WIDTH / 10) ** 2)
    sheet.set("crease_viscosity", viscosity=of_arms(s, "viscosity"))
    sheet.gravity((0, 0, -s.gravity))
    sheet.membrane_damping = 0.0
    sheet.touch(False)  # arms turn beside each other on their axles
    sheet.name("panel", ("mount", *(f"arm{k}" for k in arms(s))))
    sheet.name("crease", [f"hinge{k}" for k in arms(s)])
    model, parameters = sheet.build()
    return model, parameters, Drive()


def start(s: Settings, model: Model) -> State:
    """The state with the arms at their initial angles and rates."""
    position, velocity = model.position.copy(), np.zeros_like(model.position)
    pivot, tip, upper = np.array([0.0, 0.0, -MOUNT]), np.zeros(3), -MOUNT
    every = zip(arms(s), of_arms(s, "angle"), of_arms(s, "rate"), of_arms(s, "length"), strict=True)
    for panel, angle, rate, length in every:
        nodes = np.unique(model.triangles[model.triangle_panel == panel])
        along = np.array([np.sin(angle), 0.0, np.cos(angle)])
        across = np.array([np.cos(angle), 0.0, -np.sin(angle)]) * rate
        reach = upper - model.position[nodes, 2]
        keep = reach > 1e-9
        nodes, reach = nodes[keep], reach[keep]
        position[nodes] = pivot + np.outer(reach, along) + np.outer(model.position[nodes, 1], (0, 1, 0))
        velocity[nodes] = tip + np.outer(reach, across)
        pivot, tip, upper = pivot + length * along, tip + length * across, upper - length
    state = State.at_rest(model, position=position)
    state.v[:, 0] = velocity
    return state


def from_recording(s: Settings, recording: Recording) -> Settings:
    """The settings with the initial angles and rates that fit the start of a recording best.

    A rate read off the first samples is a few mrad/s wrong, which would part the two within tens of milliseconds. So
    the local estimate is refined by Gauss-Newton steps over rollouts, one world for each perturbed start, over a
    window that is doubled for as long as the residual stays at the noise.
    """
    names = [n for k in arms(s)[: len(recording.channels)] for n in (f"angle_{k}", f"rate_{k}")]
    estimates = initial_angles(recording, float(recording.times[0])).values()
    best = np.array([v for e in estimates for v in (e.angle, e.rate)], float)
    window = 0.03
    while window <= recording.times[-1] - recording.times[0]:
        values, misfit = _fit_start(s, recording, window, names, best)
        if misfit > 2.0 and window > 0.03:
            break
        best, window = values, 2 * window
        if misfit > 2.0:
            break
    return s.replace(**dict(zip(names, map(float, best), strict=True)))


def _fit_start(s: Settings, recording: Recording, window: float, names: list[str], values: np.ndarray):
    """Initial values fitted over a window [s], and the rms residual over the noise."""
    first = float(recording.times[0])
    head = recording.window(first, first + window)
    rate = round(1.0 / float(np.median(np.diff(head.times))))
    model, parameters, drive = build(s)
    scale = np.tile([1e-5, 1e-3], len(names) // 2)
    measured = np.concatenate([c.values for c in head.channels.values()])
    noise = np.concatenate([np.full(len(c.values), c.noise) for c in head.channels.values()])
    misfit = np.inf
    for _ in range(4):
        trials = values + np.vstack([np.zeros(len(names)), np.diag(scale)])
        state = State.join([start(s.replace(**dict(zip(names, map(float, t), strict=True))), model) for t in trials])
        motion = simulate(model, parameters, drive, duration=(len(head.times) - 1) / rate, rate=rate, state=state)
        predicted = np.stack(
            [np.concatenate(list(observe(motion, head, world=w).values())) for w in range(len(trials))]
        )
        slopes = (predicted[1:] - predicted[0]).T / scale
        residual = (measured - predicted[0]) / noise
        misfit = float(np.sqrt(np.mean(residual**2)))
        values = values + np.linalg.lstsq(slopes / noise[:, None], residual, rcond=None)[0]
    return values, misfit


def replicate(s: Settings, recording: Recording, progress: Progress | None = None) -> tuple[Trajectory, Settings]:
    """Simulates what was recorded, from the recording's own initial state, frame by frame."""
    s = from_recording(s, recording)
    model, parameters, drive = build(s)
    duration, rate = filmed(recording)
    lasting = {"duration": duration, "rate": rate, "accuracy": s.accuracy}
    motion = simulate(model, parameters, drive, **lasting, state=start(s, model), progress=progress)
    return motion, s


def swing(s: Settings, *, rate: float = 1000.0, progress: Progress | None = None, **options) -> Trajectory:
    """Simulates `duration` of free swing."""
    model, parameters, drive = build(s)
    return motion_of(
        s, model, parameters, drive, duration=s.duration, rate=rate, state=start(s, model), progress=progress, **options
    )


def arm_angles(motion: Trajectory, s: Settings) -> np.ndarray:
    """Absolute angles of the arms from the upright [rad], [frame, arm], continuous."""
    out = []
    for panel in range(1, len(motion.model.names["panel"])):
        angle = panel_angle(motion.model, motion.x[:, :, 0], panel)
        first = _number(s, "angle", panel)
        out.append(angle + 2 * np.pi * np.round((first - angle[0]) / (2 * np.pi)))
    return np.stack(out, axis=1)


def run(s: Settings, progress: Progress | None = None) -> Outcome:
    motion = swing(s, rate=200, progress=progress)
    angles = arm_angles(motion, s)
    every = slice(None, None, 100)
    table = {"time_s": motion.times[every], **{f"theta{n + 1}_rad": a[every] for n, a in enumerate(angles.T)}}
    balance = motion.energy_balance()
    return Outcome(
        motion,
        {"angles": table},
        summary=[f"energy balance kept within {np.ptp(balance) * 1e6:.2f} uJ over {s.duration:g} s"],
        numbers={"energy_error_J": float(np.ptp(balance))},
    )


if __name__ == "__main__":
    from origami_sim.commands.cli import main

    main(["run", "pendulum_chain"])

"""A chain of two rigid arms on two hinges, with its published parameters, beside a real recording.

    python -m origami_sim.scenes.pendulum_chain

Angles are those of the recording: absolute, from the upright vertical.
"""

import numpy as np

from origami_sim.build import Sheet
from origami_sim.drive import Drive
from origami_sim.model import Model, Parameters, State
from origami_sim.observe import observe, panel_angle
from origami_sim.pattern import strip
from origami_sim.recording import Recording, initial_angles
from origami_sim.scene import Outcome, Progress, Settings
from origami_sim.solve.dynamics import Trajectory, simulate

CALIBRATION = "pendulum_chain"
WIDTH, MOUNT, REACH = 0.02, 0.04, 0.25
"""Drawn width of the arms, length of the mount, and length of arm 2 [m]; only the masses on it matter."""


def build(s: Settings) -> tuple[Model, Parameters, Drive]:
    """Mount, arm 1 and arm 2 hanging straight; node masses give each arm its mass, centre and inertia."""
    lengths = [MOUNT, s.length_1] + ([REACH] if s.mass_2 > 0 else [])
    pattern = strip(lengths, WIDTH)
    pattern.vertices = pattern.vertices[:, [2, 1, 0]] * (1, 1, -1)  # hanging down
    sheet = Sheet(pattern, thickness=0.005, material="aluminium", triangulation="center")
    sheet.fix(panels=[0])
    sheet.rigid_body(1, mass=s.mass_1, centre=(0, 0, -MOUNT - s.centre_1), inertia=s.inertia_1)
    if s.mass_2 > 0:
        sheet.rigid_body(2, mass=s.mass_2, centre=(0, 0, -MOUNT - s.length_1 - s.centre_2), inertia=s.inertia_2)
    sheet.on("bars").set("bars", stiffness=s.membrane_stiffness)
    sheet.set("panel_bending", stiffness=s.membrane_stiffness * (WIDTH / 10) ** 2)
    sheet.set("crease_viscosity", viscosity=np.array([s.viscosity_1, s.viscosity_2][: len(lengths) - 1]))
    sheet.gravity((0, 0, -s.gravity))
    sheet.membrane_damping = 0.0
    sheet.name("panel", ("mount", "arm1", "arm2")[: len(lengths)])
    model, parameters = sheet.build()
    return model, parameters, Drive()


def start(s: Settings, model: Model) -> State:
    """The state with the arms at their initial angles and rates."""
    position, velocity = model.position.copy(), np.zeros_like(model.position)
    pivot, tip = np.array([0.0, 0.0, -MOUNT]), np.zeros(3)
    for panel, (angle, rate, length) in enumerate(((s.angle_1, s.rate_1, s.length_1), (s.angle_2, s.rate_2, REACH)), 1):
        nodes = np.unique(model.triangles[model.triangle_panel == panel])
        along = np.array([np.sin(angle), 0.0, np.cos(angle)])
        across = np.array([np.cos(angle), 0.0, -np.sin(angle)]) * rate
        upper = -MOUNT - (s.length_1 if panel == 2 else 0.0)
        reach = upper - model.position[nodes, 2]
        keep = reach > 1e-9
        nodes, reach = nodes[keep], reach[keep]
        position[nodes] = pivot + np.outer(reach, along) + np.outer(model.position[nodes, 1], (0, 1, 0))
        velocity[nodes] = tip + np.outer(reach, across)
        pivot, tip = pivot + length * along, tip + length * across
        if s.mass_2 == 0:
            break
    state = State.at_rest(model, position=position)
    state.v[:, 0] = velocity
    return state


def from_recording(s: Settings, recording: Recording) -> Settings:
    """The settings with the initial angles and rates that fit the start of a recording best.

    A rate read off the first samples is a few mrad/s wrong, which would part the two within tens of milliseconds. So
    the local estimate is refined by Gauss-Newton steps over rollouts, one world for each perturbed start, over a
    window that is doubled for as long as the residual stays at the noise.
    """
    names = [n for k in (1, 2)[: len(recording.channels)] for n in (f"angle_{k}", f"rate_{k}")]
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
    rate = round(1.0 / float(np.median(np.diff(recording.times))))
    duration = float(np.ceil((recording.times[-1] - recording.times[0]) * rate - 1e-6)) / rate
    motion = simulate(model, parameters, drive, duration=duration, rate=rate, state=start(s, model), progress=progress)
    return motion, s


def swing(s: Settings, *, rate: float = 1000.0, progress: Progress | None = None, **options) -> Trajectory:
    """Simulates `duration` of free swing."""
    model, parameters, drive = build(s)
    return simulate(
        model, parameters, drive, duration=s.duration, rate=rate, state=start(s, model), progress=progress, **options
    )


def arm_angles(motion: Trajectory, s: Settings) -> np.ndarray:
    """Absolute angles of the arms from the upright [rad], [frame, arm], continuous."""
    out = []
    for panel in range(1, len(motion.model.names["panel"])):
        angle = panel_angle(motion.model, motion.x[:, :, 0], panel)
        first = (s.angle_1, s.angle_2)[panel - 1]
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
    from origami_sim.cli import main

    main(["run", "pendulum_chain"])

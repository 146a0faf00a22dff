"""A chain of two rigid arms on two hinges, with its published parameters, beside a real recording.

    python -m origami_sim.scenes.pendulum_chain

Angles are those of the recording: absolute, from the upright vertical.
"""

import numpy as np

from origami_sim.build import Sheet
from origami_sim.drive import Drive
from origami_sim.model import Model, Parameters, State
from origami_sim.pattern import strip
from origami_sim.recording import Recording, initial_angles
from origami_sim.scene import Outcome, Progress, Settings
from origami_sim.solve.dynamics import simulate

CALIBRATION = "pendulum_chain"
WIDTH, MOUNT, REACH = 0.02, 0.04, 0.25
"""Drawn width of the arms, length of the mount, and length of arm 2 [m]; only the masses on it matter."""


def build(s: Settings) -> tuple[Model, Parameters, Drive]:
    """Mount, arm 1 and arm 2 hanging straight; node masses give each arm its mass, centre and inertia."""
    lengths = [MOUNT, s.length_1] + ([REACH] if s.mass_2 > 0 else [])
    sheet = Sheet(strip(lengths, WIDTH), thickness=0.005, material="aluminium", triangulation="center")
    sheet.fix(panels=[0])
    sheet.rigid_body(1, mass=s.mass_1, centre=(MOUNT + s.centre_1, 0, 0), inertia=s.inertia_1)
    if s.mass_2 > 0:
        sheet.rigid_body(2, mass=s.mass_2, centre=(MOUNT + s.length_1 + s.centre_2, 0, 0), inertia=s.inertia_2)
    sheet.on("bars").set("bars", stiffness=s.membrane_stiffness)
    sheet.set("panel_bending", stiffness=s.membrane_stiffness * (WIDTH / 10) ** 2)
    sheet.set("crease_viscosity", viscosity=np.array([s.viscosity_1, s.viscosity_2][: len(lengths) - 1]))
    sheet.gravity((0, 0, -s.gravity))
    sheet.membrane_damping = 0.0
    model, parameters = sheet.build()
    model.names["panel"] = ("mount", "arm1", "arm2")[: len(lengths)]
    hanging = model.position.copy()  # turn the strip so that x points down
    model.position[:] = np.stack([np.zeros(len(hanging)), hanging[:, 1], -hanging[:, 0]], axis=1)
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


def from_recording(s: Settings, recording: Recording, time: float) -> Settings:
    """The settings with the initial angles and rates measured at `time` [s]."""
    values = {}
    for n, estimate in enumerate(initial_angles(recording, time).values(), 1):
        values |= {f"angle_{n}": float(estimate.angle), f"rate_{n}": float(estimate.rate)}
    return s.replace(**values)


def arm_angles(motion, s: Settings) -> np.ndarray:
    """Absolute angles of the arms from the upright [rad], [frame, arm], continuous."""
    model, out = motion.model, []
    for panel in range(1, len(model.names["panel"])):
        corners = model.triangles[model.triangle_panel == panel]
        nodes = np.unique(corners)
        depth = model.position[nodes, 2]
        top, bottom = nodes[depth == depth.max()], nodes[depth == depth.min()]
        d = motion.x[:, bottom, 0].mean(1) - motion.x[:, top, 0].mean(1)
        angle = np.unwrap(np.arctan2(d[:, 0], d[:, 2]))
        first = (s.angle_1, s.angle_2)[panel - 1]
        out.append(angle + 2 * np.pi * np.round((first - angle[0]) / (2 * np.pi)))
    return np.stack(out, axis=1)


def swing(s: Settings, *, rate: float = 1000.0, progress: Progress | None = None, **options):
    """Simulates `duration` of free swing."""
    model, parameters, drive = build(s)
    return simulate(model, parameters, drive, duration=s.duration, rate=rate, state=start(s, model), progress=progress,
                    **options)  # fmt: skip


def run(s: Settings, progress: Progress | None = None) -> Outcome:
    motion = swing(s, rate=200, progress=progress)
    angles = arm_angles(motion, s)
    every = slice(None, None, 100)
    table = {"time_s": motion.times[every], **{f"theta{n + 1}_rad": a[every] for n, a in enumerate(angles.T)}}
    balance = motion.energy_balance()
    return Outcome(
        motion, {"angles": table},
        summary=[f"energy balance kept within {np.ptp(balance) * 1e6:.2f} uJ over {s.duration:g} s"],
        numbers={"energy_error_J": float(np.ptp(balance))},
    )  # fmt: skip


if __name__ == "__main__":
    from origami_sim.cli import main

    main(["run", "pendulum_chain"])

"""Rigid panels against MuJoCo's articulated bodies: a strip, a chain, a box and a free box that tumbles."""

from dataclasses import replace

import numpy as np
import pytest

from origami_sim import Sheet, cross, simulate, strip
from origami_sim.model import Model, Parameters, State, dihedral_angles
from origami_sim.model.articulation import Articulation
from origami_sim.model.bodies import body_of

mujoco = pytest.importorskip("mujoco", reason="the comparison needs MuJoCo: pip install mujoco")

STEP = 1e-4
"""Of MuJoCo's Runge-Kutta scheme [s]. Free bodies are then off by 1.8e-7 m, with half of it by 4.5e-8: of second order,
which is extrapolated (Richardson)."""


def words(values) -> str:
    return " ".join(f"{v:.15g}" for v in np.ravel(values))


class Reference:
    """The bodies and hinges of a flat rigid model in MuJoCo, with linear springs and dashpots in the hinges."""

    def __init__(self, model: Model, parameters: Parameters, gravity, *, free: bool):
        self.model, self.free = model, free
        x, panels = model.position, model.triangle_panel
        self.corners = [np.unique(model.triangles[panels == p]) for p in range(model.panel_count)]
        placed = {0}

        def body(panel: int, origin: np.ndarray, joint: str, at: np.ndarray) -> str:
            centre, inertia = body_of(parameters, panel)
            inside = ""
            for c, (left, j, k, right) in enumerate(model.creases):
                pair = [p for n in (left, right) for p, own in enumerate(self.corners) if {n, j, k} <= {*own}]
                child = next((p for p in pair if p not in placed), None)
                if panel in pair and child is not None:
                    placed.add(child)
                    hinge = f'<joint name="c{c}" type="hinge" axis="{words(x[k] - x[j])}"/>'
                    inside += body(child, x[j], hinge, x[j] - origin)
            return (
                f'<body name="p{panel}" pos="{words(at)}">{joint}<inertial pos="{words(centre - origin)}" '
                f'mass="{parameters["body", "mass"][panel, 0]:.15g}" '
                f'fullinertia="{words(inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])}"/>{inside}</body>'
            )

        tree = body(0, np.zeros(3), "<freejoint/>" if free else "", np.zeros(3))
        self.m = mujoco.MjModel.from_xml_string(
            '<mujoco><compiler angle="radian" boundmass="0" boundinertia="0"/>'
            f'<option gravity="{words(gravity)}" integrator="RK4" timestep="{STEP}"><flag contact="disable"/></option>'
            f"<worldbody>{tree}</worldbody></mujoco>"
        )
        self.d = mujoco.MjData(self.m)
        mujoco.mj_kinematics(self.m, self.d)
        self.begin = [self.d.body(f"p{p}").xpos.copy() for p in range(len(self.corners))]
        hinges = [self.m.joint(f"c{c}") for c in range(len(model.creases))]
        self.at = np.array([h.qposadr[0] for h in hinges])
        dof = np.array([h.dofadr[0] for h in hinges])
        self.d.qpos[self.at] = 0.1
        self.sign = np.sign(dihedral_angles(self.places(), model.creases))  # of the crease's angle by the joint's
        for h, value in zip(hinges, parameters["crease", "stiffness"][:, 0], strict=True):
            self.m.jnt_stiffness[h.id] = value
        self.m.qpos_spring[self.at] = self.sign * parameters["crease", "rest_angle"][:, 0]
        self.m.dof_damping[dof] = parameters["crease_viscosity", "viscosity"][:, 0]

    def places(self) -> np.ndarray:
        """Corners of all panels [N, 3]; nan for nodes that only carry mass."""
        mujoco.mj_kinematics(self.m, self.d)
        x = np.full((len(self.model.position), 3), np.nan)
        for p, nodes in enumerate(self.corners):
            pose = self.d.body(f"p{p}")
            x[nodes] = (self.model.position[nodes] - self.begin[p]) @ pose.xmat.reshape(3, 3).T + pose.xpos
        return x

    def converged(self, angles, times, drift, spin) -> np.ndarray:
        """Corners [F, N, 3] from these fold angles; the root moves off with a velocity and a rate of turning."""
        coarse, fine = (self.run(step, angles, times, drift, spin) for step in (STEP, STEP / 2.0))
        return fine + (fine - coarse) / 3.0

    def run(self, step, angles, times, drift, spin) -> np.ndarray:
        """The same by one step [s] of MuJoCo."""
        mujoco.mj_resetData(self.m, self.d)
        self.m.opt.timestep = step
        self.d.qpos[self.at] = self.sign * angles
        if self.free:
            self.d.qvel[:6] = [*drift, *spin]
        out = []
        for t in times:
            while self.d.time < t - 0.5 * step:
                mujoco.mj_step(self.m, self.d)
            out.append(self.places())
        return np.array(out)


def sheets():
    """Name, sheet, fold angles at the start [rad], acceleration of gravity [m/s^2], whether it flies."""
    heavy = Sheet(strip([0.03, 0.04, 0.03, 0.05], 0.03), thickness=1e-3, panels="rigid").fix(panels=[0])
    heavy.patch(1, thickness=2e-3, size=(0.02, 0.02)).patch(3, thickness=1e-3, side=-1)
    heavy.crease(stiffness=np.array([4e-3, 3e-3, 2e-3]), rest_angle=np.array([0.2, -0.1, 0.3]))
    yield "strip", heavy.set("crease_viscosity", viscosity=2e-6), [0.5, -0.6, 0.4], (0, 0, -9.80665), False
    chain = Sheet(strip([0.04, 0.2, 0.15], 0.03), thickness=2e-3, material="aluminium", panels="rigid").fix(panels=[0])
    chain.crease(stiffness=0.0).set("crease_viscosity", viscosity=np.array([2e-4, 1e-4]))
    yield "chain", chain, [1.2, 0.7], (9.80665, 0, 0), False
    for name, free in (("box", False), ("tumbling box", True)):
        box = Sheet(cross(0.06, 0.05), thickness=1e-3, panels="rigid")
        box.crease(stiffness=np.array([2e-3, 3e-3, 4e-3, 5e-3]), rest_angle=np.pi / 2)
        box.set("crease_viscosity", viscosity=3e-6).touch(False)  # nor do MuJoCo's bodies touch
        yield name, box if free else box.fix(panels=[0]), [0.3, 0.9, -0.2, 1.4], (0, 0, -9.80665), free


CASES = {case[0]: case[1:] for case in sheets()}


@pytest.mark.parametrize("name", CASES)
def test_panels_move_as_mujocos_bodies(name):
    sheet, angles, gravity, free = CASES[name]
    model, parameters = sheet.gravity(gravity).build()
    reference = Reference(model, parameters, gravity, free=free)
    arm = Articulation(model)
    pose = replace(arm.reference(), angles=np.array(angles)[:, None])
    state = State.at_rest(model, position=arm.positions(pose))
    drift, spin = (0.3, -0.1, 2.0), (6.0, -9.0, 4.0)
    if free:
        state.v[:, 0] = np.cross(spin, state.x[:, 0]) + drift
    run = simulate(model, parameters, duration=1.0, rate=20.0, state=state, tolerance=1e-12)
    expected = reference.converged(angles, run.times, drift, spin)
    seen = np.isfinite(expected[0, :, 0])
    assert seen.sum() == len(sheet.mesh.vertices)
    assert expected[0, seen] == pytest.approx(state.x[seen, 0], abs=1e-12)
    assert np.abs(run.x[:, seen, 0] - expected[:, seen]).max() < 1e-8
    assert np.ptp(run.creases, axis=0).max() > 0.5, "it has to move, or nothing was tested"

"""Laws on a CUDA device: the same motion as on the CPU in every world, but for the compilers' rounding.

Each test is skipped without a device. What rounding does is measured beside it, by a run that starts 1e-15 of the
device's size off: contact, friction and yield let it grow.
"""

import math

import numpy as np
import pytest
from solve.sheets import rimmed_end
from solve.test_touch import letter, made, plates
from solve.test_touch_by_default import roll

from origami_sim import Drive, FieldTable, Sheet, coil, field_at, field_table, magnet, ramp, series, simulate, strip
from origami_sim.model import State
from origami_sim.model.bodies import rigid
from origami_sim.pattern import sheet as mesh
from origami_sim.physics.materials import G

MM = 1e-3
SHIFT = 1e-15
"""How far off the second start is, in sizes of the device: some units in the last place."""
GROWTH, FLOOR = 300.0, 1e-12
"""A CUDA device may differ by so many times what the second start does: it rounds at every operation of every step
(1,000 to 20,000 of them), of which 300 add up at random; and by the floor, in sizes, where that start does nothing."""


def same_on(cuda, model, parameters, drive, **options):
    """Asserts that both devices move all worlds alike; returns the CPU's run."""
    state = options.pop("state", None) or State.at_rest(model, max(parameters.worlds, drive.worlds))
    size = np.ptp(state.x[:, 0], axis=0).max()
    off = state.copy()
    by = SHIFT * size * np.random.default_rng(0).choice([-1.0, 1.0], model.position.shape)
    off.x += (by * model.free)[:, None]
    cpu, gpu, other = (
        simulate(model, parameters, drive, state=s, device=d, **options)
        for s, d in ((state, "cpu"), (state, cuda), (off, "cpu"))
    )
    assert not cpu.failures and not gpu.failures
    moved = np.ptp(cpu.x, axis=0).max()
    assert moved > 1e-3 * size, "nothing moves"
    allowed = FLOOR * size + GROWTH * np.abs(other.x - cpu.x).max()
    assert allowed < 1e-6 * moved, "a motion that rounding upsets shows nothing"
    assert np.abs(gpu.x - cpu.x).max() <= allowed
    return cpu


def test_bars_touch_and_rub(cuda):
    """A plate that falls on a tilted one, sticking in one world and sliding in the others."""
    tilt = math.atan(0.4)
    g = (G * math.sin(tilt), 0, -G * math.cos(tilt))
    model, parameters = made(plates(0, 1.1), gravity=g, held=[0], damping_ratio=0.5)
    parameters.set("touch_friction", "friction_coefficient", np.array([[0.1, 0.3, 0.8]] * len(model.triangles)))
    run = same_on(cuda, model, parameters, Drive(), duration=0.01, rate=200)
    slid = (run.x[-1] - run.x[0])[model.free[:, 0] > 0, :, 0].mean(axis=0)
    assert run.work["touch_friction"][:, :2].min() < 0 and slid[0] > slid[1] > slid[2]


def test_edges_touch_as_flaps_close(cuda):
    model, parameters = letter()
    run = same_on(cuda, model, parameters, Drive(load=ramp(1.0, 0.05)), duration=0.06, rate=100)
    assert run.energies["touch"].max() > 0


def test_rigid_panels_touch(cuda):
    model, parameters = rigid(*letter())
    drive = Drive(load=ramp(1.0, 0.05))
    run = same_on(cuda, model, parameters, drive, duration=0.06, rate=100, dt=2e-5)
    assert run.energies["touch"].max() > 0


def test_shells_touch(cuda):
    """A soft plate lands on the corner of one below it and bends."""
    small = [(0, 0), (20, 0), (20, 16), (0, 16)]
    beside = [(x - 12, y - 9) for x, y in small]
    s = Sheet(
        plates(0, 1.01, sizes=[beside, small]), thickness=1 * MM, triangulation="center", modulus=1e6, density=1000.0
    )
    s.shell(poisson=0.3).gravity((0, 0, -G)).touch(friction=0.3).fix(panels=[0])
    model, parameters = s.build()
    run = same_on(cuda, model, parameters, Drive(), duration=8e-3, rate=500)
    assert run.energies["touch"].max() > 0 and run.energies["shell_bending"].max() > 0


def test_panels_of_which_nothing_is_stated_are_seen_to_meet(cuda):
    """In one world of two; there the watch and what follows from it are the same on both devices."""
    model, parameters = roll().build()
    rest = parameters["crease", "rest_angle"] * np.array([[0.6, 1.0]])
    parameters.set("crease", "rest_angle", rest)
    cpu, gpu = (simulate(model, parameters, duration=0.1, rate=60, device=d) for d in ("cpu", cuda))
    assert "meet" in cpu.notes[0] and gpu.notes[0] == cpu.notes[0]
    assert gpu.model.laws == cpu.model.laws and "touch" in gpu.model.laws
    assert np.abs(gpu.x - cpu.x).max() < 1e-9


@pytest.mark.parametrize("panels", ["elastic", "rigid"])
def test_creases_yield_and_set(cuda, panels):
    """Kinematic and isotropic hardening, at once and with viscosity, in one world each."""
    s = Sheet(strip([0.01, 0.02], 0.02), thickness=1 * MM, triangulation="center", panels=panels).fix(panels=[0])
    s.crease(stiffness="2 mN m/rad", damping_ratio=0.3).yields(moment="0.5 mN m", hardening=0.2)
    s.set("crease_drive", drive_stiffness=1.5e-3, target_angle=1.0)
    model, parameters = s.build()
    parameters.set("crease_yield", "isotropic", np.array([[0.0, 1.0, 0.4]]))
    parameters.set("crease_yield", "viscosity", np.array([[0.0, 0.0, 2e-4]]))
    drive = Drive(load=series([0.0, 0.1, 0.2], [0.0, 1.0, 0.0]))
    options = {"dt": 2e-4} if panels == "rigid" else {}
    run = same_on(cuda, model, parameters, drive, duration=0.2, rate=50, **options)
    plastic = run.state.memory[: len(model.creases)]
    assert np.ptp(plastic[0]) > 0.1 * abs(plastic[0]).max() > 0


@pytest.mark.parametrize("panels", ["elastic", "rigid"])
def test_magnets_and_soft_patches_follow_sources_and_tables(cuda, panels):
    """Flaps in the field of a magnet that passes by, of a coil and of a table, in another place in every world."""
    s = Sheet(strip([0.01] * 3, 0.01), thickness=1 * MM, panels=panels, triangulation="center").fix(panels=[1])
    s.crease(stiffness="0.1 mN m/rad", damping_ratio=0.1).on("field_gradient")
    s.magnetise(0, remanence="0.1 T", volume="100 mm^3", poling=(1, 0, 0))
    s.soften(2, susceptibility=20.0, size=("8 mm", "8 mm", "0.5 mm"), saturation="0.3 T")
    model, parameters = s.build()
    far = Drive(sources=[magnet("1.2 T", radius="5 mm", length="8 mm", position=(0, 0.002, -0.06), axis=(0.1, 0, 1))])
    x, y, z = (np.linspace(a, b, 9) for a, b in ((-0.01, 0.04), (-0.01, 0.02), (-0.02, 0.02)))
    table = FieldTable.sampled(lambda p: field_at(far, p)[0], x, y, z)
    passing = (series([0.0, 0.1], [0.0, 0.03]), 0.005, np.array([0.03, 0.035, 0.04]))
    drive = Drive(
        sources=[
            magnet("1.2 T", radius="5 mm", length="10 mm", position=passing),
            coil("20 A", radius="12 mm", length="10 mm", turns=30, position=(0.02, 0.005, -0.03)),
            field_table(table),
        ]
    )
    options = {"dt": 2e-4} if panels == "rigid" else {}
    run = same_on(cuda, model, parameters, drive, duration=0.1, rate=50, **options)
    poled, soft = np.abs(run.creases[-1, :, 0] - run.creases[-1, :, 2])
    assert poled > 1e-2 and soft > 1e-4, "both turn, by the distance of the magnet"


def test_sheets_relax(cuda):
    """A cantilever of shell with three branches falls, of another stiffness and time in each world."""
    x, triangles = rimmed_end("crossed", 4, 2, 0.3)
    x = x * 0.05
    s = Sheet(mesh(x, triangles), thickness=1 * MM, modulus=1e6, density=1000.0, membrane_damping=0.0)
    s.shell(poisson=0.3, relaxation=((0.5, 0.002), (0.3, 0.01), (0.2, 0.1))).gravity()
    model, parameters = s.fix(nodes=np.flatnonzero(x[:, 0] < 1e-9)).build()
    parameters.set("shell_bending_relaxation", "time_1", np.array([[0.002, 0.006, 0.0006]]))
    run = same_on(cuda, model, parameters, Drive(), duration=0.03, rate=100)
    assert run.work["shell_bending_relaxation"].min() < 0


def test_thick_panels_swing_about_hinges_on_their_faces(cuda):
    s = Sheet(strip([0.04, 0.04, 0.03], 0.03), thickness=6 * MM, material="aluminium", panels="rigid")
    s.fix(panels=[0]).crease(stiffness=0.01, damping_ratio=0.1).hinge([0], at="bottom").hinge([1], at="top").gravity()
    model, parameters = s.build()
    parameters.set("crease", "stiffness", np.array([[0.01, 0.02, 0.04]]))
    same_on(cuda, model, parameters, Drive(), duration=0.2, rate=50, dt=2e-4)

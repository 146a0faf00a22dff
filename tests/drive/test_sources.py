"""Magnets, coils and tables around a device: their fields, and what they do to remanent and to soft panels."""

import numpy as np
import pytest
from effects.kit import make_model, quiet, start
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from origami_sim import (
    Drive,
    FieldTable,
    InputError,
    Sheet,
    coil,
    coil_pair,
    dipole,
    equilibrium,
    field_at,
    field_table,
    load_run,
    magnet,
    quasistatic,
    read_design,
    save_run,
    series,
    simulate,
    sine,
    strip,
    write_design,
)
from origami_sim.commands.cli import main
from origami_sim.physics.materials import MU0, demagnetising_factors
from origami_sim.solve.batch import Batch

AXIS = np.array([0.3, -0.5, 0.8]) / np.linalg.norm([0.3, -0.5, 0.8])
MIDDLE = np.array([0.01, -0.02, 0.03])
PLACES = np.random.default_rng(3).uniform(-0.05, 0.05, (60, 3))
PLACES = PLACES[np.linalg.norm(PLACES - MIDDLE, axis=1) > 0.028]  # where sums over segments converge


# fields ---------------------------------------------------------------------------------------------------------------


def biot_savart(points, radius, heights, currents, count=300):
    """Field of loops about the z axis, by sums over segments that converge faster than any power."""
    a = 2 * np.pi * np.arange(count) / count
    along = np.stack([-np.sin(a), np.cos(a), 0 * a], axis=1) * (2 * np.pi * radius / count)
    out = np.zeros_like(points)
    for z, current in zip(heights, currents, strict=True):
        r = points[:, None] - np.stack([radius * np.cos(a), radius * np.sin(a), np.full(count, z)], axis=1)
        out += MU0 * current / (4 * np.pi) * (np.cross(along, r) / np.linalg.norm(r, axis=2)[..., None] ** 3).sum(1)
    return out


def expected(radius, length, current):
    """The same of a winding about AXIS through MIDDLE, at PLACES."""
    turn = Rotation.align_vectors([AXIS], [[0, 0, 1.0]])[0].as_matrix()
    node, weight = np.polynomial.legendre.leggauss(60) if length else (np.zeros(1), np.full(1, 2.0))
    return biot_savart((PLACES - MIDDLE) @ turn, radius, 0.5 * length * node, 0.5 * weight * current) @ turn.T


@pytest.mark.parametrize("length", [0.0, 0.02])
def test_coils_and_cylinders_agree_with_biot_savart(length):
    radius, current = 0.012, 30.0
    given = {"radius": radius, "position": MIDDLE, "axis": 7 * AXIS}
    field, _ = field_at(Drive(sources=[coil(current / 5, length=length, turns=5, **given)]), PLACES)
    reference = expected(radius, length, current)
    assert np.abs(field - reference).max() < 1e-9 * np.abs(reference).max()
    if length:
        poled, _ = field_at(Drive(sources=[magnet(MU0 * current / length, length=length, **given)]), PLACES)
        assert poled == pytest.approx(field, rel=1e-12, abs=1e-18)


@pytest.mark.parametrize("kind", ["dipole", "loop", "coil", "magnet"])
def test_gradients_are_slopes_and_free_of_curl_and_divergence(kind):
    where = {"position": MIDDLE, "axis": AXIS}
    source = {
        "dipole": lambda: dipole("0.3 A m^2", **where),
        "loop": lambda: coil("20 A", radius="12 mm", **where),
        "coil": lambda: coil("20 A", radius="12 mm", length="20 mm", turns=30, **where),
        "magnet": lambda: magnet("1.2 T", radius="5 mm", length="8 mm", **where),
    }[kind]()
    drive, h = Drive(sources=[source]), 2e-6
    beside = MIDDLE + 0.03 * AXIS + np.cross(AXIS, [1.0, 0, 0]) * np.array([0.0, 1e-9, 1e-6, 1.3e-6, 1e-4])[:, None]
    points = np.concatenate([PLACES, beside])  # also on the axis and close to it
    _, gradient = field_at(drive, points)
    slopes = [(field_at(drive, points + h * e)[0] - field_at(drive, points - h * e)[0]) / (2 * h) for e in np.eye(3)]
    size = np.abs(gradient).max(axis=(1, 2), keepdims=True)
    assert np.abs(gradient - np.stack(slopes, axis=-1)).max(axis=(1, 2)) == pytest.approx(0, abs=1e-5 * size.max())
    assert (np.abs(gradient - np.stack(slopes, axis=-1)) / size).max() < 1e-5
    assert np.abs(gradient - np.swapaxes(gradient, 1, 2)).max() <= 1e-13 * size.max()
    assert np.abs(np.trace(gradient, axis1=1, axis2=2)).max() < 1e-12 * size.max()


def test_coil_pairs_are_even_in_field_or_in_gradient():
    radius, current = 0.1, 3.0
    middle, _ = field_at(Drive(sources=[coil_pair(current, radius=radius, axis=AXIS, position=MIDDLE)]), [MIDDLE])
    assert middle[0] == pytest.approx(0.8**1.5 * MU0 * current / radius * AXIS, rel=1e-12)
    near = MIDDLE + 0.05 * radius * np.array([AXIS, -AXIS, [0, 0, 1.0]])
    field, _ = field_at(Drive(sources=[coil_pair(current, radius=radius, axis=AXIS, position=MIDDLE)]), near)
    assert field == pytest.approx(np.tile(middle, (3, 1)), rel=2e-5)  # fourth order: 144/125 of 0.05^4
    opposed = Drive(sources=[coil_pair(current, radius=radius, axis=AXIS, position=MIDDLE, opposed=True)])
    field, gradient = field_at(opposed, [MIDDLE, MIDDLE + 0.05 * radius * AXIS])
    assert np.abs(field[0]).max() < 1e-18
    assert gradient[1] == pytest.approx(gradient[0], rel=2e-4, abs=1e-10)


def test_magpylib_agrees():
    magpylib = pytest.importorskip("magpylib")
    turn = Rotation.align_vectors([AXIS], [[0, 0, 1.0]])[0]
    given = {"position": MIDDLE, "orientation": turn}
    theirs = magpylib.magnet.Cylinder(polarization=(0, 0, 1.2), dimension=(0.01, 0.008), **given)
    ours, _ = field_at(Drive(sources=[magnet(1.2, radius=0.005, length=0.008, position=MIDDLE, axis=AXIS)]), PLACES)
    assert ours == pytest.approx(theirs.getB(PLACES), rel=1e-8, abs=1e-12)
    axes = [np.linspace(-0.03, 0.03, 13)] * 2 + [np.linspace(-0.06, -0.02, 9)]
    table = FieldTable.sampled(theirs.getB, *axes)
    inside = np.random.default_rng(0).uniform([-0.03, -0.03, -0.06], [0.03, 0.03, -0.02], (200, 3))
    off = np.abs(table.at(inside)[0] - theirs.getB(inside)).max() / np.abs(table.values).max()
    assert off < 2 * table.error < 1e-2


# tables ---------------------------------------------------------------------------------------------------------------

SOURCE = Drive(sources=[magnet("1.2 T", radius="5 mm", length="8 mm", position=(0, 0.002, -0.05), axis=(0.1, 0, 1))])


def table(n, change=lambda b: b):
    a = np.linspace(-0.02, 0.02, n)
    return FieldTable.sampled(lambda p: change(field_at(SOURCE, p)[0]), a, a, a + 0.002)


def test_a_table_has_no_curl_and_errors_of_fourth_order():
    points = np.random.default_rng(1).uniform(-0.018, 0.018, (300, 3))
    field, gradient = field_at(SOURCE, points)
    off, steps, largest = [], [], []
    for n in (9, 13, 17, 25):
        t = table(n)
        found, slope = field_at(Drive(sources=[field_table(t)]), points)
        assert found == pytest.approx(t.at(points)[0], rel=1e-12, abs=1e-15)  # kernel and numpy
        assert slope == pytest.approx(t.at(points)[1], rel=1e-10, abs=1e-12)
        assert np.abs(slope - np.swapaxes(slope, 1, 2)).max() <= 1e-13 * np.abs(slope).max()
        off.append(np.abs(found - field).max() / np.linalg.norm(t.values, axis=-1).max())
        largest.append(np.abs(slope - gradient).max() / np.abs(gradient).max())
        steps.append(t.steps[0])
        assert t.error / 12 < off[-1] < 2 * t.error  # stated for the whole box, of which the rim is worst
    assert np.polyfit(np.log(steps), np.log(off), 1)[0] > 3.0
    assert off[-1] < 1e-4 and largest[-1] < 2e-3 and table(25).divergence < 1e-3


def test_a_table_has_steps_of_its_own_along_each_axis():
    """The kernel and numpy agree with each other and with the source: an axis read with another's step would not."""
    x, y, z = (np.linspace(-0.02, 0.02, n) for n in (9, 13, 17))
    t = FieldTable.sampled(lambda p: field_at(SOURCE, p)[0], x, y, z)
    points = np.random.default_rng(4).uniform(-0.018, 0.018, (50, 3))
    found, slope = field_at(Drive(sources=[field_table(t)]), points)
    assert found == pytest.approx(t.at(points)[0], rel=1e-12, abs=1e-15)
    assert slope == pytest.approx(t.at(points)[1], rel=1e-10, abs=1e-12)
    assert np.abs(found - field_at(SOURCE, points)[0]).max() < t.error * np.linalg.norm(t.values, axis=-1).max() * 2


def test_the_divergence_of_a_table_of_a_dipole_is_the_error_of_its_gradient():
    """No curl at all between the places; a divergence that is stated from above, falls, and measures the gradient."""
    source = Drive(sources=[dipole(0.3, position=(0.003, 0.002, -0.05), axis=(0.3, -0.2, 1))])
    points = np.random.default_rng(0).uniform(-0.02, 0.02, (2000, 3))
    exact = field_at(source, points)[1]
    steps, left = [], []
    for n in (9, 13, 17, 25):
        a = np.linspace(-0.02, 0.02, n)
        t = FieldTable.sampled(lambda p: field_at(source, p)[0], a, a, a)
        slope = t.at(points)[1]
        assert np.array_equal(slope, np.swapaxes(slope, 1, 2))
        divergence = np.sqrt(np.mean(np.trace(slope, axis1=1, axis2=2) ** 2))
        over_a_step = divergence * t.steps.max() / np.sqrt(np.mean(t.values**2))
        assert over_a_step / t.divergence == pytest.approx(0.41, rel=0.15)  # 0.36, 0.41, 0.43, 0.45
        # of independent errors of nine components of alike size the trace has the root of three; these lie in the trace
        assert np.sqrt(np.mean((slope - exact) ** 2)) == pytest.approx(divergence / 3, rel=0.03)
        steps.append(t.steps[0])
        left.append(divergence)
    assert np.polyfit(np.log(steps), np.log(left), 1)[0] == pytest.approx(3.01, abs=0.01)


def test_noise_and_a_probe_that_is_turned_are_seen_in_the_misfit():
    noise = np.random.default_rng(2)
    rms = np.sqrt(np.mean(table(9).values ** 2))
    noisy = table(9, lambda b: b + 0.02 * rms * noise.normal(size=b.shape))
    assert 0.01 < noisy.misfit < 0.03 and noisy.error > 0.01
    assert table(9).misfit < 0.003 < table(9, lambda b: b @ Rotation.from_rotvec([0.1, 0, 0]).as_matrix()).misfit


def test_what_is_no_table_is_refused(tmp_path):
    t = table(5)
    holed = t.values.copy()
    holed[1, 2, 3, 0] = np.nan
    with pytest.raises(InputError, match=r"has 1 hole.*x = -0.01, y = 0, z = 0.012 m"):
        FieldTable(t.x, t.y, t.z, holed)
    with pytest.raises(InputError, match="no field of magnets and currents"):
        table(9, lambda b: b[:, [1, 0, 2]])
    with pytest.raises(InputError, match=r"even steps.*'x'"):
        FieldTable(t.x + 0.002 * (t.x > 0), t.y, t.z, t.values)
    with pytest.raises(InputError, match=r"more places along an axis.*'z'.*>= 4"):
        FieldTable(t.x, t.y, t.z[:3], t.values[:, :, :3])
    path = t.write(tmp_path / "map.csv")
    lines = path.read_text().splitlines()
    for change, message in (
        (lambda r: r[:20] + r[21:], r"1 hole.*no number at"),
        (lambda r: [*r, r[5]], "a place has two rows"),
        (lambda r: [r[0].replace("Bx [T]", "Bx"), *r[1:]], r"needs its unit.*Bx"),
        (lambda r: [r[0].replace("Bx [T]", "Bx [mm]"), *r[1:]], r"unknown unit.*Bx"),
        (lambda r: [r[0].replace("By [T]", "Hy [T]"), *r[1:]], r"lacks a column.*By"),
        (lambda r: [r[0], r[1].replace("-0.02", "left", 1), *r[2:]], r"not a number.*row 2, x"),
        (lambda r: [r[0], *[f"{n},{n},{n},0,0,1" for n in range(9)]], "the rows are no grid"),
    ):
        path.write_text("\n".join(change(lines)))
        with pytest.raises(InputError, match=message):
            field_table(path)


def test_files_in_any_unit_and_order_are_the_same_table(tmp_path):
    t = table(5)
    points = np.stack(np.meshgrid(t.x, t.y, t.z, indexing="ij"), axis=-1).reshape(-1, 3)
    rows = np.concatenate([1e3 * points, 1e4 * t.values.reshape(-1, 3)], axis=1)
    rows = rows[np.random.default_rng(0).permutation(len(rows))][:, [3, 0, 1, 2, 4, 5]]
    path = tmp_path / "map.csv"
    np.savetxt(path, rows, delimiter=",", header="Bx [G], x [mm], y [mm], z [mm], By [G], Bz [G]", comments="")
    for read in (FieldTable.read(path), FieldTable.read(t.write(tmp_path / "map.npz"))):
        assert read.values == pytest.approx(t.values, rel=1e-12) and read.x == pytest.approx(t.x, abs=1e-15)


# forces ---------------------------------------------------------------------------------------------------------------

LAWS = ("magnetic_torque", "field_gradient")


def plate(n, size, turn=None, at=(0, 0, 0), effects=LAWS):
    """A square plate of n x n cells, each two triangles."""
    line = np.linspace(-0.5, 0.5, n + 1) * size
    x = np.array([(a, b, 0.0) for a in line for b in line])
    if turn is not None:
        x = x @ turn.as_matrix().T
    corner = [
        [i * (n + 1) + j for i, j in c]
        for c in (((a, b), (a + 1, b), (a + 1, b + 1)) for a in range(n) for b in range(n))
    ]
    other = [
        [i * (n + 1) + j for i, j in c]
        for c in (((a, b), (a + 1, b + 1), (a, b + 1)) for a in range(n) for b in range(n))
    ]
    return make_model(x + np.asarray(at), triangles=corner + other, effects=effects)


def poled(model, moment, effects=LAWS):
    """Parameters of a whole moment [A m^2], along the normal (third component) and the first edge of the plate."""
    count, a = len(model.triangles), np.asarray(moment, float)
    size = np.linalg.norm(a)
    x = model.position[model.triangles]
    first = (x[0, 1] - x[0, 0]) / np.linalg.norm(x[0, 1] - x[0, 0])
    edges = np.stack([x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]], axis=-1)
    weights = np.stack([np.linalg.lstsq(e, first, rcond=None)[0] for e in edges])
    values = {}
    for e in effects:
        values |= {(e, "remanence"): 1.0, (e, "volume"): size * MU0 / count, (e, "poling_n"): a[2] / size}
        values |= {(e, "poling_1"): weights[:, 0], (e, "poling_2"): weights[:, 1]}
    return quiet(model, values)


def wrench(model, parameters, drive, about, time=0.0):
    """Force and torque [N], [N m] about a point."""
    report = Batch(model, parameters, drive, start(model)).evaluate(time)
    f = sum(report.forces.values())[:, 0]
    return f.sum(axis=0), np.cross(model.position - about, f).sum(axis=0)


def test_two_dipoles_push_and_turn_each_other_as_the_closed_form_says():
    """Jackson 1999, section 5.7; a plate of a hundredth of the distance."""
    rng = np.random.default_rng(4)
    source = rng.normal(size=3)
    turn, at = Rotation.random(random_state=5), np.array([0.04, -0.03, 0.05])
    model = plate(2, 5e-4, turn, at)
    drive = Drive(sources=[dipole(np.linalg.norm(source), axis=source)])
    force, torque = wrench(model, poled(model, [0.3, 0, 0.4]), drive, at)
    m, r = turn.apply([0.3, 0, 0.4]), at
    d = np.linalg.norm(r)
    n = r / d
    push = m * (source @ n) + source * (m @ n) + n * (m @ source) - 5 * n * (m @ n) * (source @ n)
    field = MU0 / (4 * np.pi * d**3) * (3 * n * (source @ n) - source)
    assert force == pytest.approx(3 * MU0 / (4 * np.pi * d**4) * push, rel=1e-4, abs=1e-4 * np.linalg.norm(force))
    assert torque == pytest.approx(np.cross(m, field), rel=1e-4, abs=1e-4 * np.linalg.norm(torque))


def test_a_poled_plate_over_a_cylinder_converges_to_the_mean_of_its_gradient():
    """A plate of twice the magnet's size close to it: force by fine quadrature of m dB_z/dz; panels of second order."""
    size, height, moment = 0.02, 0.012, 0.5
    drive = Drive(sources=[magnet("1.2 T", radius="5 mm", length="8 mm")])
    node, weight = np.polynomial.legendre.leggauss(24)
    points = np.array([(a, b, 2 * height / size) for a in node for b in node]) * 0.5 * size
    slope = field_at(drive, points)[1][:, 2, 2]
    exact = moment * np.sum(np.outer(weight, weight).ravel() * slope) / 4
    off = []
    for n in (4, 8, 16):
        model = plate(n, size, at=(0, 0, height))
        off.append(abs(wrench(model, poled(model, [0, 0, moment]), drive, np.zeros(3))[0][2] / exact - 1))
    assert off[-1] < 5e-3 and off[0] / off[1] > 3 and off[1] / off[2] > 3


def test_two_cylinders_pull_as_magpylib_says():
    """A flat disc-like square poled through its thickness, in the field of a cylinder: their forces and ours."""
    magpylib = pytest.importorskip("magpylib")
    if not hasattr(magpylib, "getFT"):
        pytest.skip("this Magpylib gives no forces")
    size, thickness, at = 0.01, 5e-4, np.array([0.006, 0.002, 0.014])
    turn = Rotation.from_rotvec([0.5, 0.2, 0])
    theirs = magpylib.magnet.Cylinder(polarization=(0, 0, 1.2), dimension=(0.01, 0.008))
    target = magpylib.magnet.Cuboid(
        polarization=(0, 0, 0.1), dimension=(size, size, thickness), position=at, orientation=turn
    )
    force, torque = np.asarray(magpylib.getFT(theirs, target, meshing=1500)).reshape(2, 3)
    model = plate(12, size, turn, at)
    drive = Drive(sources=[magnet("1.2 T", radius="5 mm", length="8 mm")])
    ours = wrench(model, poled(model, [0, 0, 0.1 / MU0 * size**2 * thickness]), drive, at)
    assert ours[0] == pytest.approx(force, abs=5e-3 * np.linalg.norm(force))
    assert ours[1] == pytest.approx(torque, abs=5e-3 * np.linalg.norm(torque))


@pytest.mark.parametrize("kind", ["magnet", "table"])
def test_torque_and_pull_together_are_the_slope_of_the_energy(kind):
    drive = SOURCE if kind == "magnet" else Drive(sources=[field_table(table(9))])
    model = plate(1, 0.01, Rotation.random(random_state=1), (0.003, -0.002, 0.004))
    parameters, h = poled(model, [0.3, 0, 0.4]), 1e-7
    steps = h * np.concatenate([np.eye(12), -np.eye(12), np.zeros((1, 12))])
    worlds = np.moveaxis((model.position.reshape(1, 12) + steps).reshape(25, 4, 3), 0, 1)
    report = Batch(model, parameters, drive, start(model, 25, x=worlds)).evaluate(0.0)
    u = report.energies["magnetic_torque"]
    force = (report.forces["magnetic_torque"] + report.forces["field_gradient"])[:, -1].ravel()
    assert force == pytest.approx(-(u[:12] - u[12:24]) / (2 * h), abs=1e-6 * np.abs(force).max())


def test_a_moving_magnet_is_where_it_is_and_worlds_may_have_others():
    model = plate(1, 0.01)
    parameters = poled(model, [0.3, 0, 0.4])
    path = {
        "position": (series([0, 2], [0.0, 0.02]), "5 mm", 0.03),
        "axis": (sine(1.0, 0.25), 0, sine(1.0, 0.25, phase="90 deg")),
    }
    moving = Drive(sources=[magnet("1.2 T", radius="5 mm", length="8 mm", **path)])
    still = Drive(sources=[magnet("1.2 T", radius="5 mm", length="8 mm", position=(0.01, 0.005, 0.03), axis=(1, 0, 0))])
    for a, b in zip(
        wrench(model, parameters, moving, np.zeros(3), 1.0), wrench(model, parameters, still, np.zeros(3)), strict=True
    ):
        assert a == pytest.approx(b, rel=1e-9, abs=1e-15)
    heights = np.array([0.02, 0.03, 0.04])
    many = Drive(sources=[magnet("1.2 T", radius="5 mm", length="8 mm", position=(0, 0, heights))])
    assert many.worlds == 3
    all_forces = Batch(model, parameters, many, start(model, 3)).evaluate(0.0).forces["field_gradient"]
    for w, z in enumerate(heights):
        one = Drive(sources=[magnet("1.2 T", radius="5 mm", length="8 mm", position=(0, 0, z))])
        alone = Batch(model, parameters, one, start(model)).evaluate(0.0).forces["field_gradient"][:, 0]
        assert np.array_equal(all_forces[:, w], alone)


# soft patches ---------------------------------------------------------------------------------------------------------


def test_a_soft_patch_turns_and_is_pulled_by_its_demagnetising_factors():
    chi, volume, b = 5.0, 2e-9, 0.05
    n1, n2, n3 = demagnetising_factors(0.01, 0.004, 0.001)
    angle = 0.4
    turn = Rotation.from_rotvec([0, -angle, 0])  # the field keeps an angle with the first axis, in x and z
    model = plate(1, 1e-5, turn, effects=("soft_magnet",))
    p = quiet(model)
    x = model.position[model.triangles]
    for t in range(2):
        edges = np.stack([x[t, 1] - x[t, 0], x[t, 2] - x[t, 0]], axis=-1)
        weights = np.linalg.lstsq(edges, turn.apply([1.0, 0, 0]), rcond=None)[0]
        p.set("soft_magnet", "poling_1", weights[0], [t]).set("soft_magnet", "poling_2", weights[1], [t])
    for name, value in {
        "susceptibility": chi,
        "volume": volume / 2,
        "demagnetising_1": n1,
        "demagnetising_2": n2,
        "saturation": 3.0,
    }.items():
        p.set("soft_magnet", name, value)
    _, torque = wrench(model, p, Drive(field=(b * 1e-3, 0, 0)), np.zeros(3))
    per = chi**2 * (n3 - n1) / ((1 + chi * n1) * (1 + chi * n3)) / 2 * np.sin(2 * angle)
    assert torque == pytest.approx(
        [0, per * volume * (b * 1e-3) ** 2 / MU0, 0], rel=2e-4, abs=1e-6 * np.abs(torque).max()
    )
    g = np.diag([2.0, -1.0, -1.0])
    axis = turn.apply([1.0, 0, 0])
    force, _ = wrench(model, p, Drive(field=1e-3 * b * axis, gradient=g.tolist()), np.zeros(3))
    assert force == pytest.approx(volume / MU0 * chi / (1 + chi * n1) * g @ (1e-3 * b * axis), rel=2e-4)
    # far above saturation it is a magnet of that polarisation along the field
    p.set("soft_magnet", "saturation", 0.02)
    strong = 400.0 * axis
    force, _ = wrench(model, p, Drive(field=strong, gradient=g.tolist()), np.zeros(3))
    assert force == pytest.approx(0.02 * volume / MU0 * g @ axis, rel=2e-3)
    assert sum(demagnetising_factors(0.01143, 0.01905, 0.003175)) == pytest.approx(1.0, abs=1e-12)
    assert demagnetising_factors(0.01, 0.01, 0.01) == pytest.approx([1 / 3] * 3, rel=1e-12)
    assert demagnetising_factors(1.0, 1e-3, 1e-3)[1] == pytest.approx(0.5, abs=1e-3)


# devices --------------------------------------------------------------------------------------------------------------


def flap(*effects, panels="rigid"):
    sheet = Sheet(strip([0.01, 0.01], 0.01), thickness=1e-3, panels=panels, triangulation="center").fix(panels=[0])
    sheet.crease(stiffness="0.1 mN m/rad", damping_ratio=0.1).magnetise(
        1, remanence="0.1 T", volume="100 mm^3", poling=(1, 0, 0)
    )
    return sheet.on(*effects)


ABOVE = {"radius": "5 mm", "length": "10 mm", "position": (0.012, 0.005, 0.035), "axis": (0, 0, 1)}


@pytest.mark.slow
def test_a_flap_under_a_magnet_is_found_by_every_solver():
    """The energy of a crease and of magnets in the middles of the four triangles, minimised by itself."""
    model, parameters = flap("field_gradient").build()
    assert np.array_equal(parameters["field_gradient", "volume"], parameters["magnetic_torque", "volume"])
    drive = Drive(sources=[magnet("1.2 T", **ABOVE)])
    own = np.flatnonzero(model.triangle_panel == 1)
    middle = model.position[model.triangles[own]].mean(axis=1) - [0.01, 0, 0]
    moment = 0.1 * 100e-9 / MU0 / len(own)

    def energy(a):
        turn = np.array([[np.cos(a), 0, -np.sin(a)], [0, 1, 0], [np.sin(a), 0, np.cos(a)]])
        field = field_at(drive, middle @ turn.T + [0.01, 0, 0])[0]
        return 0.5e-4 * a**2 - moment * np.sum(field @ turn @ [1.0, 0, 0])

    def slope(a):
        return (energy(a + 1e-4) - energy(a - 1e-4)) / 2e-4

    angle = brentq(slope, 0.0, 1.2)
    assert angle > 0.1
    found = equilibrium(model, parameters, drive)
    assert found.converged and found.angles[0] == pytest.approx(angle, abs=1e-6)
    nearer = Drive(sources=[magnet(series([0, 1], [0.0, 1.2]), **ABOVE)])
    assert quasistatic(model, parameters, nearer, [0.0, 0.5, 1.0]).creases[-1, 0, 0] == pytest.approx(angle, abs=1e-5)
    run = simulate(model, parameters, drive, duration=1.0, rate=100.0)
    assert run.creases[-1, 0, 0] == pytest.approx(angle, abs=2e-3)
    assert run.energy_error is not None and run.energy_error < 1e-3


def test_sources_survive_design_files_and_run_folders(tmp_path):
    t = table(5)
    t.write(tmp_path / "map.csv")
    sources = [
        coil(sine("2 A", "3 Hz"), radius="50 mm", turns=100, position=(0, 0, 0.04)),
        magnet("1.2 T", **ABOVE),
        dipole("1 A m^2", position=(0, 0, series([0, 9], [0.1, 0.2]))),
        field_table(t, factor=0.5),
    ]
    drive, sheet = Drive(sources=sources, voltage=[1.0, 2.0]), flap("field_gradient")
    again = read_design(write_design(tmp_path / "flap.toml", sheet, drive))
    points = 0.4 * np.random.default_rng(0).uniform(-0.02, 0.02, (5, 3)) + [0, 0, 0.002]
    model, parameters = again.sheet.build()
    run = simulate(model, parameters, Drive(sources=sources), duration=0.02, rate=100.0)
    save_run(tmp_path / "run", run, scene="flap", replay=False)
    for other in (again.drive, load_run(tmp_path / "run").trajectory.drive):
        for a, b in zip(field_at(drive, points, 0.3), field_at(other, points, 0.3), strict=True):
            assert a == pytest.approx(b, rel=1e-12, abs=1e-18)


def test_what_goes_wrong_is_said(tmp_path, capsys):
    drive = Drive(sources=[magnet("1.2 T", **ABOVE)])
    with pytest.raises(InputError, match=r"differs from place to place.*switch on field_gradient"):
        equilibrium(*flap().build(), drive)
    with pytest.raises(InputError, match=r"starts outside the table.*panel 1"):
        equilibrium(*flap("field_gradient").build(), Drive(sources=[field_table(table(5), position=(0.1, 0, 0))]))
    low = FieldTable(
        *(np.linspace(-0.03, 0.03, 7),) * 2, np.linspace(-0.002, 0.003, 5), np.full((7, 7, 5, 3), [0, 0, 0.2])
    )
    run = simulate(*flap("field_gradient").build(), Drive(sources=[field_table(low)]), duration=0.1, rate=100.0)
    assert "left the table of the field" in str(run.failures[0])
    for bad, message in (
        (lambda: magnet("1.2 T", radius=0, length=1), "positive size.*radius"),
        (lambda: coil("1 V", radius=1), r"wrong unit"),
        (lambda: dipole(1.0, axis=(0, 0, 0)), "direction"),
        (lambda: Drive(sources=["coil"]), "is no source"),
    ):
        with pytest.raises(InputError, match=message):
            bad()
    (tmp_path / "map.csv").write_text("x [mm],y [mm],z [mm],Bx [mT],By [mT],Bz [mT]\n0,0,0,0,0,\n")
    path = write_design(tmp_path / "flap.toml", flap("field_gradient"), None, duration=0.1)
    path.write_text(path.read_text().replace("[drive]", '[drive]\nsources = [{ table = { file = "map.csv" } }]'))
    with pytest.raises(SystemExit) as stop:
        main(["run", str(path), "--out", str(tmp_path)])
    assert stop.value.code == 2
    assert "map.csv" in capsys.readouterr().err

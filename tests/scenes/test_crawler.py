"""The crawler walks: symmetries, the planar reference, the printed set, and the stored strides."""

from itertools import pairwise

import numpy as np
import pytest
import scipy.sparse.linalg as spla

from origami_sim.device.scene import read_calibration
from origami_sim.drive import Drive, sine
from origami_sim.model.clearance import gaps
from origami_sim.observation.gait import strides
from origami_sim.physics.materials import layered_rigidity, material
from origami_sim.scenes import crawler
from origami_sim.solve.motion.dynamics import simulate
from origami_sim.solve.statics.equilibria import equilibrium, tangent
from origami_sim.solve.timestep import stable_step
from origami_sim.studies.crawler_maps import Store, Trial, checks, judge, run_trials
from origami_sim.studies.strides import check

PLANAR = {0.2: 31.4, 0.1: 26.7, 0.05: 12.5}
"""Field [T] and stride [mm] of the independent chain in a plane (benchmarks/planar_crawler.py), cells of 1.3 mm."""

CHAIN = 25.53
"""Second stride [mm] of the same chain by the default set with cells of 3.8 mm."""

RELAXING, CURVING = 25.34, 27.05
"""With cells of 1.25 mm: losses of a free strip, `--relaxing`; one that curves across as well, `--free`."""

STIFFENING = {0.005: 1.162, 0.04: 1.121, 0.2: 1.108}
"""Turn of its bridge over that in plane strain, under the couples that the fields [T] bring (`--bend`)."""

SWUNG = {5.0: 8.88, 10.0: 33.85}
"""Turn [degrees] of the small patch after so many ms in a field of 0.1 T at 20 Hz, the big one held (`--swing`)."""

SLOW = pytest.mark.slow


def walk(cycles=4, calibration="crawler", **changes):
    """Strides by cycle [mm] and the motion."""
    s = read_calibration(calibration).replace(**changes)
    motion = crawler.walk(s, cycles=cycles, rate=20.0)
    assert not motion.failures, motion.failures[0]
    return strides(motion, s.frequency) * 1e3, motion


@pytest.fixture(scope="module")
def default():
    """Six cycles of the shipped calibration."""
    return walk(6)[0]


@pytest.fixture(scope="module")
def coarse():
    """Four cycles of the same with cells of 3.8 mm, for what any mesh must show."""
    return walk(4, cell=0.0038)[0]


def test_gait_is_steady_on_coarse_cells(coarse):
    assert coarse[3] == pytest.approx(coarse[2], rel=5e-3)
    assert coarse[2:].mean() == pytest.approx(25.0, abs=1.0)


@SLOW
def test_default_gait_is_steady_and_near_the_paper(default):
    assert default[3:].std() < 1e-3 * default[3:].mean()
    assert default[3:].mean() == pytest.approx(25.0, abs=1.0)


@SLOW
def test_regression_reference_is_reproduced(default):
    report = check("crawler", default / 1e3, settings=read_calibration("crawler"))
    assert report.same_settings
    assert report.passed, report.text()


@SLOW
@pytest.mark.parametrize("field", [0.05, 0.1, 0.2])
def test_independent_planar_model(field):
    stride, _ = walk(3, "crawler_reference", field=field)
    assert stride[2] == pytest.approx(PLANAR[field], rel=0.03)


@SLOW
def test_finer_cells_walk_alike(default):
    """Cells of 3.8 and 1.9 mm; the chain in a plane, for which it is cheap, has cells halved twice."""
    for cell in (0.0038, 0.0019):
        other, _ = walk(3, cell=cell)
        assert other[2] == pytest.approx(default[3:].mean(), rel=0.025)  # as the chain's (docs/paper/crawler.md)


def finer(parts):
    """Second stride [mm] with cells of 3.8 mm and so many times as short a step."""
    s = read_calibration("crawler").replace(cell=0.0038)
    model, parameters, _ = crawler.build(s)
    motion = crawler.walk(s, cycles=2, rate=20.0, dt=stable_step(model, parameters).dt / parts)
    return 1e3 * strides(motion, s.frequency)[1]


@SLOW
def test_half_the_step_walks_alike(coarse):
    """25.374, 25.442, 25.460 mm with the step, half and a quarter of it: the step costs 0.3 to 0.4 %.

    With one diagonal per cell, left and right land unlike: 25.66 and 26.08 mm.
    """
    assert finer(2) == pytest.approx(coarse[1], rel=3e-3)
    assert coarse[1] == pytest.approx(CHAIN, rel=0.015)


@SLOW
def test_the_stride_converges_with_the_step(coarse):
    half, quarter = finer(2), finer(4)
    assert quarter == pytest.approx(half, rel=1e-3)
    assert abs(quarter - half) < 0.5 * abs(half - coarse[1])  # of first order at least


CELLS = (0.0038, 0.0019, 0.00095)


@pytest.fixture(scope="module")
def meshes():
    """Model and parameters of the default on three meshes, with their settings."""
    out = []
    for cell in CELLS:
        s = read_calibration("crawler").replace(cell=cell)
        out.append((s, *crawler.build(s)[:2]))
    return out


def test_finer_cells_stand_on_no_stiffer_ground(meshes):
    """The belly has a stiffness per length from end to end; the feet have theirs."""
    for s, _, p in meshes:
        length = crawler.stations(s)[0][-1]
        for effect in ("ground", "friction"):
            k, c = p[effect, "stiffness"][:, 0], p[effect, "damping"][:, 0]
            assert k[4:].sum() == pytest.approx(s.ground_stiffness * length)
            assert k[:4] == pytest.approx(s.foot_stiffness / 2)
            np.testing.assert_allclose(c, s.ground_time * k)


def test_the_belly_presses_as_a_continuous_one(meshes):
    """Force and couple on a straight strip that stands on its end, tilted, over a length L: wedges in closed form.

    Of second order in the cells, wherever in a cell L ends. With points at stations alone the force is off by up to
    0.68, 0.34, 0.19 of it on these meshes, and each mesh lands on springs of its own.
    """
    tilt = 0.05
    for cell, (s, model, p) in zip(CELLS, meshes, strict=True):
        stiffness = p["ground", "stiffness"][4:, 0]  # without the feet
        at = (model.position[model.contacts, 0] * model.contact_weights).sum(axis=1)[4:]
        x = np.zeros_like(model.position)
        x[:, 1] = model.position[:, 1]
        x[:, 0] = model.position[:, 0] * np.cos(tilt)
        for length in np.linspace(5e-3, 12e-3, 8):
            x[:, 2] = (model.position[:, 0] - length) * np.sin(tilt) + s.thickness / 2 * np.cos(tilt)
            force = stiffness * np.maximum(-gaps(model, p, x[:, None])[4:, 0], 0.0)
            wedge = s.ground_stiffness * length**2 * np.sin(tilt) / 2
            error = 0.03 * (cell / CELLS[0]) ** 2
            assert force.sum() == pytest.approx(wedge, rel=error)
            assert force @ at == pytest.approx(wedge * length / 3, rel=error)


def test_finer_cells_lose_no_more(meshes):
    """Power lost while a moment grows evenly: the sheet's share of integral of tau (M' / D)^2 dx, by quadrature.

    Borders between sheet and patches count: losses by hinge would lose half of theirs, on any mesh.
    """
    for s, _, p in meshes:
        x, owner = crawler.stations(s)
        loss, stiffness = p["crease_viscosity", "viscosity"][:, 0], p["crease", "stiffness"][:, 0]
        lost = (loss / stiffness**2).sum()
        xi, weight = np.polynomial.legendre.leggauss(4)
        plane = s.modulus / (1 - s.poisson**2)
        bare = plane * s.thickness**3 / 12
        mae = material("mae").plane_modulus
        bonded = layered_rigidity([(s.thickness, plane), (s.patch_thickness, mae)])
        expected = 0.0
        for k, (a, b) in enumerate(pairwise(x)):
            a, b = (0.5 * (a + b) if k == 0 else a), (0.5 * (a + b) if k == len(owner) - 1 else b)  # hinged there
            at = 0.5 * (a + b) + 0.5 * (b - a) * xi
            width = s.rear_width + (s.front_width - s.rear_width) * at / x[-1]
            patch = (0.0, s.big_width, s.small_width)[owner[k]]
            rigid = bare * (width - patch) + bonded * patch
            expected += 0.5 * (b - a) * float((weight * s.loss_time * bare * width / rigid**2).sum())
        assert lost == pytest.approx(expected, rel=5e-3)


def test_finer_cells_stretch_no_more(meshes):
    """Compliance of the strip's two borders from end to end: integral of ds / E A, the patches bonded."""
    for s, model, p in meshes:
        x, owner = crawler.stations(s)
        middle = 0.5 * (x[1:] + x[:-1])
        width = s.rear_width + (s.front_width - s.rear_width) * middle / x[-1]
        patch = np.array([0.0, s.big_width, s.small_width])[owner]
        axial = s.modulus * s.thickness * width + material("mae").modulus * s.patch_thickness * patch
        along = np.abs(np.diff(model.bars, axis=1)[:, 0]) == 2
        cell = model.bars[along].min(axis=1) // 2
        pairs = np.bincount(cell, p["bars", "stiffness"][along, 0])
        border = np.hypot(np.diff(x), 0.5 * (s.front_width - s.rear_width) * np.diff(x) / x[-1])  # it tapers
        assert (1 / pairs).sum() == pytest.approx((border / axial).sum(), rel=1e-9)


@SLOW
def test_turned_device_walks_the_other_way(coarse):
    turned, motion = walk(4, heading=-1.0, cell=0.0038)
    assert turned[2:].mean() == pytest.approx(-coarse[2:].mean(), rel=2e-3)
    assert np.abs(motion.x[..., 1] - motion.x[:1, ..., 1]).max() < 1e-12


@SLOW
def test_reversed_field_gives_the_same_stride(coarse):
    reversed_, _ = walk(5, polarity=-1.0, cell=0.0038)  # the moments turn, which is the same as turning the field
    assert reversed_[3:].mean() == pytest.approx(coarse[2:].mean(), rel=0.02)


def test_no_friction_no_drift():
    _, motion = walk(2, foot_friction=0.0, foot_friction_back=0.0, belly_friction=0.0, cell=0.0048)
    x = motion.centre_of_mass()[:, 0, 0]
    assert np.abs(x - x[0]).max() < 1e-6


@SLOW
@pytest.mark.parametrize("field", [0.1, 0.2])
def test_equal_patches_and_isotropic_feet_do_not_walk(field):
    s = read_calibration("crawler")
    even = {"big_length": s.small_length, "big_width": s.small_width, "big_moment": 1.0, "rear_width": 0.0115,
            "front_width": 0.0115, "foot_friction_back": s.foot_friction, "field": field, "cell": 0.0038}  # fmt: skip
    stride, _ = walk(5, **even)
    assert abs(stride[2:].mean()) < 0.1


@SLOW
def test_printed_set_snaps_and_repeats_but_is_ill_conditioned():
    # -44.2 mm per cycle, and -26.9 on ground and feet four times as stiff (docs/paper/crawler.md)
    stride, _ = walk(8, "crawler_printed")
    assert stride[4:].std() < 0.02 * abs(stride[4:].mean())
    stiffer, _ = walk(8, "crawler_printed", ground_stiffness=520e3, foot_stiffness=2000.0)
    assert abs(stiffer[4:].mean() / stride[4:].mean() - 1) > 0.1


def free(cell=0.0025, **changes):
    return read_calibration("crawler").replace(guided=False, cell=cell, **changes)


def bridge(s):
    """Turn [rad] of a free strip's small patch under a couple of 1 N m, the big one held."""
    model, parameters, _ = crawler.build(s)
    laws = ("shell_membrane", "shell_bending", "crease")
    model = model.with_effects(without=tuple(e for e in model.effects if e not in laws))
    d = crawler.Strip.of(s)
    x = model.position[:, 0]
    near, far = d.x[d.borders[2:]]
    free = np.flatnonzero(np.repeat(x > d.x[d.borders[1]] + 1e-9, 3))
    force = np.zeros(len(x))
    for at, sign in ((near, -1.0), (far, 1.0)):
        row = np.flatnonzero(np.abs(x - at) < 1e-9)
        share = np.ones(len(row))
        share[[0, -1]] = 0.5  # spread over the width
        force[row] = sign * share / share.sum() / (far - near)
    load = np.zeros(3 * len(x))
    load[2::3] = force
    u = np.zeros(len(load))
    k = tangent(model, parameters.for_model(model)).tocsc()
    u[free] = spla.spsolve(k[free][:, free], load[free])
    return float(force @ u[2::3])


def turn(s, poisson):
    """The same of a beam: integral of M ds / D w over the sheet between the patches, and over the small patch, in
    which the couple grows evenly from its far end."""
    plane = s.modulus / (1 - s.poisson**2)
    bonded = layered_rigidity([(s.thickness, plane), (s.patch_thickness, material("mae").plane_modulus)])
    bare, start = s.thickness**3 / 12, s.overhang + s.big_length
    ends = start + s.span, start + s.span + s.small_length
    xi, weight = np.polynomial.legendre.leggauss(8)
    out = 0.0
    for (a, b), patch in (((start, ends[0]), 0.0), (ends, s.small_width)):
        at = 0.5 * (a + b) + 0.5 * (b - a) * xi
        width = s.rear_width + (s.front_width - s.rear_width) * at / (ends[1] + s.overhang)
        couple = np.where(patch, (ends[1] - at) / s.small_length, 1.0)
        sheet = plane if patch else s.modulus / (1 - poisson**2)
        out += 0.5 * (b - a) * float((weight * couple**2 / (sheet * bare * (width - patch) + bonded * patch)).sum())
    return out


def test_free_strip_bends_as_a_beam_does_in_plane_strain():
    """0.5 % softer than the beam with cells of 5 mm, 0.2 % with 2.5; by halves of each line's turn 31, 16 % less."""
    for cell, error in ((0.005, 0.01), (0.0025, 0.005)):
        s = free(cell, anticlastic=False)
        assert bridge(s) == pytest.approx(turn(s, s.poisson), rel=error)


def test_free_strip_bends_between_plane_strain_and_plane_stress():
    """Its width of 10 mm cannot curve across beside the patches: of 1 / (1 - nu^2) = 1.32 it is 1.17 times as soft."""
    s = free()
    wide, narrow = turn(s, s.poisson), turn(s, 0.0)
    assert narrow / wide == pytest.approx(1 / (1 - s.poisson**2), rel=0.02)
    assert 1.1 * wide < bridge(s) < 0.95 * narrow


def held(s):
    """A free strip without ground and weight, its big patch held: model, parameters, and turn of the small patch."""
    model, parameters, _ = crawler.build(s)
    laws = ("shell_membrane", "shell_bending", "shell_bending_relaxation", "magnetic_torque")
    model = model.with_effects(without=tuple(e for e in model.effects if e not in laws))
    d, x = crawler.Strip.of(s), model.position[:, 0]
    model.free[x < d.x[d.borders[1]] + 1e-9] = 0
    near, far = (np.abs(x - d.x[b]) < 1e-9 for b in d.borders[2:])

    def turned(x):
        along = x[far].mean(axis=0) - x[near].mean(axis=0)
        return abs(np.arctan2(along[2], along[0]))

    return model, parameters.for_model(model), turned


def bent(s, fields):
    """Turn over couple [rad/(N m)] of a free strip's small patch in fields, the big one held, from equilibrium."""
    model, parameters, turned = held(s)
    moment = s.remanence / (4e-7 * np.pi) * s.small_length * s.small_width * s.patch_thickness
    state, out = None, []
    for field in fields:
        found = equilibrium(model, parameters, Drive(field=(0, 0, field)), state=state)
        assert found.converged, found.message
        state = found.state
        turn = turned(state.x[:, 0])
        out.append(turn / (moment * field * np.cos(turn)))
    return np.array(out)


@SLOW
def test_free_bridge_stiffens_where_it_bends_far():
    """1.157, 1.119, 1.111 at 22, 68, 85 degrees, with cells of 1.25 mm; 1.156, 1.115, 1.110 with 2.5 mm."""
    softer = bent(free(0.00125), STIFFENING) / bent(free(0.00125, anticlastic=False), STIFFENING)
    np.testing.assert_allclose(softer, list(STIFFENING.values()), rtol=0.01)


@SLOW
def test_free_bridge_swings_as_the_chain_does():
    """8.96, 34.02 degrees, in plane strain 7.98, 31.47: fast, its losses make the patches curve across as well.

    With patches that bend in plane strain it would be 8.5 and 33.4.
    """
    model, parameters, turned = held(free(0.00125))
    motion = simulate(model, parameters, Drive(field=(0, 0, sine(0.1, 20.0))), duration=0.01, rate=200.0)
    found = [np.degrees(turned(motion.x[k, :, 0])) for k in (1, 2)]
    np.testing.assert_allclose(found, list(SWUNG.values()), rtol=0.015)


@pytest.mark.parametrize("cell", [0.005, 0.0025])
def test_free_strip_weighs_stands_and_loses_as_the_guided_one(cell):
    """Mass, ground by length, feet, couple of the magnets and height of the weight: sums over all points."""
    s = free(cell)
    (a, p), (b, q) = crawler.build(s)[:2], crawler.build(s.replace(guided=True))[:2]
    assert p["inertia", "mass"].sum() == pytest.approx(q["inertia", "mass"].sum(), rel=1e-9)
    for law in (("ground", "stiffness"), ("friction", "damping"), ("directional_friction", "backward_excess")):
        feet = [np.char.startswith(m.names["contact"], "foot") for m in (a, b)]
        values = [p[law][:, 0], q[law][:, 0]]
        if law[1] != "backward_excess":
            for own in (feet, [~f for f in feet]):
                assert values[0][own[0]].sum() == pytest.approx(values[1][own[1]].sum(), rel=1e-9)
        else:
            assert set(values[0][feet[0]]) == set(values[1][feet[1]])
    for effect, names in (("magnetic_torque", ("remanence", "volume")), ("eccentric_weight", ("mass", "offset"))):
        first, second = ((r[effect, names[0]] * r[effect, names[1]]).sum() for r in (p, q))
        assert first == pytest.approx(second, rel=1e-9)


@pytest.mark.parametrize("cell", [0.005, 0.0025])
def test_free_strip_loses_as_a_viscous_one_where_it_is_slow(cell):
    """Branches whose stiffness times their time is the viscosity; a turn at 265 Hz meets 99 % of it.

    Moment of a Maxwell branch out of phase: c w / (1 + (w tau)^2). Their time shortens the step by 5.2 % at most.
    """
    s = free(cell, anticlastic=False)
    model, p, _ = crawler.build(s)
    d, across = crawler.Strip.of(s), crawler.Strip.of(s).across(s)
    bare = s.modulus / (1 - s.poisson**2) * s.thickness**3 / 12
    of = model.triangle_panel // (2 * across)
    lost = d.rigidity[of] * p["shell_bending_relaxation", "share_1"][:, 0] * s.relaxation_time
    np.testing.assert_allclose(lost, s.loss_time * bare * d.middle[of])  # the patches lose nothing
    assert set(p["shell_bending_relaxation", "time_1"][:, 0]) == {s.relaxation_time}
    assert 1 / (1 + (2 * np.pi * 265.0 * s.relaxation_time) ** 2) > 0.99
    slow = crawler.build(s.replace(relaxation_time=1e-3))
    assert stable_step(model, p).dt > 0.945 * stable_step(*slow[:2]).dt


def test_feet_turn_with_their_pads_on_any_mesh():
    """Their gap when an overhang tilts as a whole, in closed form; and no lever that grows as cells shrink."""
    s, tilt = free(), 0.2
    for cell in (0.0025, 0.00125):
        model, parameters, _ = crawler.build(s.replace(cell=cell))
        x = model.position.copy()
        x[:, 0], x[:, 2] = np.cos(tilt) * model.position[:, 0], np.sin(tilt) * model.position[:, 0]
        feet = np.char.startswith(model.names["contact"], "foot at x = 0.000")
        depth = s.thickness / 2 + s.foot_height
        np.testing.assert_allclose(gaps(model, parameters, x[:, None])[feet, 0], -depth * np.cos(tilt), rtol=1e-6)
        span = np.ptp(model.position[model.contacts[feet], 0], axis=1)
        np.testing.assert_allclose(span, s.overhang)


def test_free_strip_is_the_same_on_its_left_and_right():
    """Nodes and triangles fall on each other's mirror images, with the same stiffness."""
    model, parameters, _ = crawler.build(free(0.0038))
    place = {tuple(np.round(x * 1e9).astype(int)): n for n, x in enumerate(model.position[:, :2])}
    mirror = np.array([place[tuple(np.round(x * 1e9).astype(int))] for x in model.position[:, :2] * [1, -1]])
    for law in (("shell_bending", "stiffness_11"), ("shell_membrane", "stiffness_66")):
        values = {frozenset(t): v for t, v in zip(model.triangles.tolist(), parameters[law][:, 0], strict=True)}
        for t, value in values.items():
            assert values[frozenset(mirror[list(t)].tolist())] == pytest.approx(value, rel=1e-9)


@pytest.fixture(scope="module")
def plane():
    """Second strides [mm] of the free strip in plane strain with cells of 5 and 2.5 mm, and the finer one's motion."""
    far, near = (walk(2, guided=False, anticlastic=False, cell=cell) for cell in (0.005, 0.0025))
    return far[0][1], near[0][1], near[1]


@SLOW
def test_free_strip_walks_alike_with_halved_cells(plane):
    """25.29 and 25.18 mm."""
    far, near, motion = plane
    assert near == pytest.approx(far, rel=0.02)
    assert np.abs(motion.x[..., 1].mean(axis=1)).max() < 5e-5


@SLOW
def test_free_strip_in_plane_strain_walks_as_the_chain(plane):
    """0.2 and 0.6 % from it."""
    for stride in plane[:2]:
        assert stride == pytest.approx(RELAXING, rel=0.01)


@SLOW
def test_free_strip_walks_as_a_chain_that_curves_across():
    """26.87 mm, with cells of 1.25 mm 26.83; the chain with cells of 2.5 mm 27.29."""
    stride, motion = walk(2, guided=False)
    assert np.abs(motion.x[..., 1].mean(axis=1)).max() < 5e-5
    assert stride[1] == pytest.approx(CURVING, rel=0.03)


@SLOW
def test_default_is_converged_and_robust(tmp_path):
    named = checks(Trial(read_calibration("crawler"), 6))
    found = dict(zip(named, run_trials("crawler", list(named.values()), Store(tmp_path / "results.json")), strict=True))
    verdict = judge(found)
    assert verdict.accepted, (verdict.spread, verdict.halved, verdict.worst, verdict.worst_change)


def test_end_correction_makes_the_borders_of_the_patches_softer():
    """Compliance of bare sheet of length c h more at each of the four borders, and nowhere else; none by default."""
    s = read_calibration("crawler")
    assert s.end_correction == 0.0
    law = read_calibration("crease_bridge")
    before, after = (crawler.build(s.replace(end_correction=c))[1] for c in (0.0, law.end_correction))
    more = 1 / after["crease", "stiffness"][:, 0] - 1 / before["crease", "stiffness"][:, 0]
    x, owner = crawler.stations(s)
    borders = x[1:-1][np.diff(owner) != 0]
    width = s.rear_width + (s.front_width - s.rear_width) * borders / x[-1]
    bare = s.modulus / (1 - s.poisson**2) * s.thickness**3 / 12
    expected = law.end_correction * s.thickness / (bare * width)
    assert len(borders) == 4
    np.testing.assert_allclose(np.sort(more)[-4:], np.sort(expected), rtol=1e-6)
    assert np.abs(np.sort(more)[:-4]).max() < 1e-9 * expected.max()


def test_the_end_correction_softens_a_free_strip_as_much():
    """Turn of the bridge with the big patch held: more by that of bare sheet of length c h, 6 %."""
    s, c = free(anticlastic=False), read_calibration("crease_bridge").end_correction
    d = crawler.Strip.of(s)
    bare = s.modulus / (1 - s.poisson**2) * s.thickness**3 / 12
    more = c * s.thickness / (bare * d.width[d.borders[2]])
    assert bridge(s.replace(end_correction=c)) == pytest.approx(turn(s, s.poisson) + more, rel=0.01)


@SLOW
def test_the_end_correction_lengthens_the_stride_by_a_tenth(default):
    """The calibrated bridge (calibrations/crease_bridge.toml) instead of plane sections: the gait is the same."""
    stride, _ = walk(4, end_correction=0.674)
    assert stride[3] / default[3:].mean() == pytest.approx(1.10, abs=0.02)

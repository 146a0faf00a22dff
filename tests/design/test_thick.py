"""Thick panels: where hinges lie, where edges meet, and that thick sheets fold as theory says."""

import numpy as np
import pytest
import shapely
from shapely import affinity

from origami_sim import (
    Drive,
    Sheet,
    cut,
    equilibrium,
    grid,
    miura,
    quasistatic,
    ramp,
    read_design,
    sheet,
    simulate,
    strip,
    write_design,
)
from origami_sim.design.thick import GIVE, Edge, meeting
from origami_sim.errors import InputError
from origami_sim.model import State, dihedral_angles
from origami_sim.model.articulation import Articulation
from origami_sim.solve.rigid.topology import Topology

MM = 1e-3


def pair(*, panels="rigid", rest_angle=np.pi, thickness=2 * MM, lengths=(0.04, 0.04)):
    """Two panels on a hinge that would fold."""
    s = Sheet(strip(lengths, 0.03), thickness=thickness, material="pdms", panels=panels).fix(panels=[0])
    return s.crease(stiffness=0.01, rest_angle=rest_angle)


def folded(s):
    """Fold angles and node positions where a sheet comes to rest."""
    model, parameters = s.build()
    found = equilibrium(model, parameters)
    assert found.converged, found.message
    return model, found.angles[: len(model.creases)], found.state.x[:, 0]


def panel(model, x, p):
    return x[np.unique(model.triangles[model.triangle_panel == p])]


def degree_four(first, second, radius=0.05):
    """A flat-foldable vertex with two pairs of opposite sectors, and its creases in their order around it."""
    turns = np.cumsum([0, first, second, np.pi - first])
    vertices = [(0, 0, 0), *((radius * np.cos(a), radius * np.sin(a), 0) for a in turns)]
    pattern = sheet(vertices, [(0, 1 + n, 1 + (n + 1) % 4) for n in range(4)])
    pattern.assignments = ["U" if a == "F" else a for a in pattern.assignments]
    pattern.fold_angles[:] = np.nan
    return pattern


# where edges meet -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("at", "gap", "mitre", "valley", "mountain"),
    [
        ("top", 0, 0, 180, 0),
        ("bottom", 0, 0, 0, 180),
        ("top", 0, 45, 180, 90),
        ("bottom", 0, 45, 90, 180),
        ("bottom", 2 * MM, 0, np.degrees(2 * np.arctan(0.5)), 180),
        ("middle", 1 * MM, 30, np.degrees(2 * np.arctan(0.5 + np.tan(np.pi / 6))), None),
        (2 * MM, 0, 0, 180, 0),
    ],
)
def test_a_fold_stops_where_geometry_says(at, gap, mitre, valley, mountain):
    s = pair().hinge(at=at, gap=gap).mitre(angle=np.radians(mitre))
    found = np.degrees(s.stops(0))
    np.testing.assert_allclose(found, [valley, valley if mountain is None else mountain], atol=1e-6)


@pytest.mark.parametrize(("face", "valley", "mountain"), [("top", 60, 0), ("bottom", 0, 60)])
def test_a_mitre_of_one_face_opens_the_fold_towards_it_alone(face, valley, mountain):
    s = pair().hinge(at="middle").mitre(angle="30 deg", face=face)
    np.testing.assert_allclose(np.degrees(s.stops(0)), [valley, mountain], atol=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_stops_are_those_of_solid_sections(seed):
    rng = np.random.default_rng(seed)
    for _ in range(8):
        edges, solids = [], []
        for _ in range(2):
            bottom = rng.uniform(-1.5, 0.8)
            e = Edge(bottom + rng.uniform(0.3, 1.5), bottom, rng.uniform(0, 0.6), *rng.uniform(0, 1.2, 2))
            edges.append(e)
            heights = sorted({e.bottom, e.top, *([0.0] if e.bottom < 0 < e.top else [])})
            far = 3000.0
            edge = [(e.gap + max(z * np.tan(e.above), -z * np.tan(e.below)), z) for z in heights]
            solids.append(shapely.Polygon([*edge, (far, e.top), (far, e.bottom)]))
        mirrored = affinity.scale(solids[1], -1, 1, origin=(0, 0))

        def overlap(angle, one=solids[0], other=mirrored):  # the second panel, to the left, turns up and over
            turned = affinity.rotate(other, -angle, origin=(0, 0), use_radians=True)
            return one.intersection(turned).area

        stop = meeting(edges)
        for share in (0.3, 0.7):
            assert overlap(share * stop) < 1e-9
        assert overlap(max(stop - 1e-3, 0.0)) < 1e-6
        if stop < np.pi - 0.01:
            assert overlap(stop + 0.01) > 1e-7


@pytest.mark.parametrize("panels", ["rigid", "elastic"])
def test_a_mitre_of_45_degrees_stops_a_fold_at_90(panels):
    s = pair(panels=panels, lengths=(0.02, 0.02)).mitre(angle="45 deg")
    _, angles, _ = folded(s)
    assert np.pi / 2 < angles[0] < np.pi / 2 + GIVE


def test_a_stop_holds_against_either_side():
    s = pair(rest_angle=-1.0).hinge(at="top")
    _, angles, _ = folded(s)
    assert -GIVE < angles[0] < 0.0
    s = pair(rest_angle=1.0).hinge(at="top")
    _, angles, _ = folded(s)
    assert angles[0] == pytest.approx(1.0, abs=1e-9)


# where panels lie -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("at", "gap"), [("top", 0.0), (1 * MM, 0.0), (2.5 * MM, 3.0 * MM)])
def test_panels_on_a_hinge_beyond_a_face_fold_flat_with_twice_that_gap(at, gap):
    model, angles, x = folded(pair().hinge(at=at))
    assert angles[0] == pytest.approx(np.pi, abs=1e-9)
    apart = panel(model, x, 1)[:, 2] - panel(model, x, 0)[:, 2]  # of the middle planes
    np.testing.assert_allclose(apart - 2 * MM, gap, atol=1e-9)


def test_panels_about_a_face_touch_each_other():
    """Thicker by 0.4 mm for touch than for the hinge: they stop where their diagonals cross, 20 mm from the axis."""
    _, angles, _ = folded(pair().hinge(at="top").touch(thickness=2.4 * MM))
    assert np.pi - angles[0] == pytest.approx(0.4 / 20, rel=0.1)


def test_a_swing_about_a_face_is_that_of_a_plate_about_that_axis():
    t, length, density = 6 * MM, 0.04, 2700.0
    s = Sheet(strip([0.04, length], 0.03), thickness=t, material="aluminium", density=density, panels="rigid")
    s.fix(panels=[0]).hinge(at="bottom", stop_stiffness=1e-9).gravity((9.81, 0, 0)).crease(stiffness=0.0)
    model, parameters = s.build()
    start = equilibrium(model, parameters)  # hangs along x, its centre off the axis by half of its thickness
    lean = -np.arctan2(t / 2, length / 2)
    assert start.angles[0] == pytest.approx(lean, abs=1e-6)
    inertia = density * length * t * 0.03 * ((length**2 + t**2) / 12 + (length / 2) ** 2 + (t / 2) ** 2)
    weight = density * length * t * 0.03 * 9.81 * np.hypot(length / 2, t / 2)
    assert start.eigenvalues[0] == pytest.approx(weight, rel=1e-4)
    period = 2 * np.pi * np.sqrt(inertia / weight)
    arm = Articulation(model)
    pose = arm.reference()
    pose.angles[:] = lean + 0.01
    state = State.at_rest(model, 1, arm.positions(pose)[:, 0])
    motion = simulate(model, parameters, duration=period, rate=200 / period, state=state)
    swing = motion.creases[:, 0, 0] - lean
    assert swing[100] == pytest.approx(-0.01, rel=1e-3) and swing[200] == pytest.approx(0.01, rel=1e-3)
    assert abs(swing[50]) < 1e-4 * np.pi  # within a hundredth of a quarter period


def test_panels_that_share_no_node_move_as_those_that_do():
    """Hinges in the pattern's plane, with a panel's offset that is none: the same motion by another model."""

    def motion(offset):
        s = Sheet(strip([0.04, 0.05, 0.03], 0.03), thickness=1 * MM, material="aluminium", panels="rigid")
        s.fix(panels=[1]).crease(stiffness=2e-3, damping_ratio=0.1).gravity().panel([2], offset=offset)
        return simulate(*s.build(), duration=0.3).creases[:, :, 0]

    np.testing.assert_allclose(motion(1e-12), motion(0.0), atol=1e-8)


@pytest.mark.parametrize("held_panel", [0, 1])
def test_a_load_on_a_shared_node_acts_once_and_a_held_panel_is_held_alone(held_panel):
    s = Sheet(strip([0.04, 0.04], 0.03), thickness=2 * MM, material="pdms", panels="rigid").fix(panels=[held_panel])
    s.crease(stiffness=0.01, rest_angle=0.0).hinge(at="top").set("load", [2], force_z=1.0)
    model, parameters = s.build()
    assert parameters["load", "force_z"].sum() == 1.0
    mass = parameters["inertia", "mass"][:, 0]
    assert mass.sum() == pytest.approx(2 * 0.04 * 0.03 * 2 * MM * s.density[0])
    held = ~model.free.any(axis=1)
    assert set(np.flatnonzero(held)) == set(np.unique(model.triangles[model.triangle_panel == held_panel]))


# thick origami that folds ---------------------------------------------------------------------------------------------


def test_a_thick_vertex_is_bennetts_linkage_and_folds_as_the_thin_one():
    """Chen, Peng & You 2015, doi:10.1126/science.aab2870: axes a12 = a34, a23 = a41 apart, a / b = sin / sin."""
    first, second, a = np.radians(70), np.radians(50), 2 * MM
    b = a * np.sin(second) / np.sin(first)
    s = Sheet(degree_four(first, second), thickness=2 * MM, material="aluminium", panels="rigid").fix(panels=[0])
    s.crease(stiffness=0.01, damping_ratio=0.5)
    ring = [int(max(c[1:3])) - 1 for c in s.mesh.creases.tolist()]
    where = {n: c for c, n in enumerate(ring)}
    for n, height in enumerate((0.0, a, a + b, b)):
        s.hinge([where[n]], at=float(height), gap="60 mm", stop_stiffness=1e-6)
    s.set("crease_drive", [where[1]], drive_stiffness=1.0, target_angle=0.08)
    model, parameters = s.build()
    run = quasistatic(model, parameters, Drive(load=ramp(1, 1.0)), np.linspace(0, 1, 5))
    angles = run.creases[:, [where[n] for n in range(4)], 0]
    assert angles[-1, 1] > 2.3
    share = np.sin((first - second) / 2) / np.sin((first + second) / 2)
    tan = np.tan(angles[1:] / 2)
    np.testing.assert_allclose(tan / tan[:, 1:2], np.broadcast_to([share, 1, -share, 1], tan.shape), atol=1e-6)


def test_other_heights_lock_the_vertex():
    first, second = np.radians(70), np.radians(50)
    s = Sheet(degree_four(first, second), thickness=2 * MM, material="aluminium", panels="rigid").fix(panels=[0])
    s.crease(stiffness=0.01)
    for c, height in enumerate((0.0, 1 * MM, 3 * MM, 0.5 * MM)):
        s.hinge([c], at=height, gap="60 mm", stop_stiffness=1e-6)
    model, _ = s.build()
    tree = Topology(model)
    slope = tree.closures(model.position, np.zeros((3, 1)))[1][:, :, 0]
    assert np.linalg.svd(slope)[1].min() > 1e-3 * np.linalg.svd(slope)[1].max()  # no first-order motion


GAMMA = np.radians(60)


def miura_sheet(fold, cells):
    pattern = miura(cells, cells, 0.02, 0.02, GAMMA, fold_angle=fold)
    return Sheet(pattern, thickness=2 * MM, material="aluminium", panels="rigid").fix(panels=[0])


def test_tapered_panels_stop_all_creases_in_one_state():
    """Tachi 2011: hinges in the middle plane, edges cut along the bisecting planes of the state to stop at."""
    goal = Sheet(miura(2, 2, 0.02, 0.02, GAMMA, fold_angle=2.2), thickness=2 * MM)
    target = dihedral_angles(goal.mesh.vertices[:, None], goal.mesh.creases)[:, 0]
    s = miura_sheet(0.6, 2)
    np.testing.assert_array_equal(goal.mesh.creases, s.mesh.creases)
    for c, angle in enumerate(target):
        s.mitre([c], angle=abs(angle) / 2)
        np.testing.assert_allclose(s.stops(c), abs(angle), atol=1e-9)
    s.crease(stiffness=0.01, rest_angle=np.pi * np.sign(target))
    _, angles, _ = folded(s)
    assert np.all(np.abs(angles) > np.abs(target)) and np.all(np.abs(angles) < np.abs(target) + GIVE)


def test_offset_panels_fold_flat_into_layers_with_the_kinematics_of_paper():
    """Edmondson et al. 2014: hinges stay in one plane, panels stand off it, each at a height of its own."""
    runs, t = {}, 2 * MM
    for lift in (False, True):
        s = miura_sheet(0.6, 1).touch(False)  # as thick as they are, panels that do not stand off cannot fold flat
        # the sides that panels show in the folded state: neighbours show opposite ones
        sides = np.array([1, -1, -1, 1])
        layers = np.array([0.5, -0.5, 1.5, -1.5]) * t
        if lift:
            for p in range(4):
                s.panel([p], offset=float(sides[p] * layers[p]))
        angles = dihedral_angles(s.mesh.vertices[:, None], s.mesh.creases)[:, 0]
        s.crease(stiffness=0.01, rest_angle=angles)
        for c, a in enumerate(angles):
            s.set("crease_drive", [c], drive_stiffness=0.01, target_angle=float(np.sign(a) * (np.pi - 1e-3) - a))
        model, parameters = s.build()
        run = quasistatic(model, parameters, Drive(load=ramp(1, 1.0)), np.linspace(0, 1, 9))
        runs[lift] = (model, run)
    thin, thick = runs[False][1].creases[:, :, 0], runs[True][1].creases[:, :, 0]
    np.testing.assert_allclose(thick, thin, atol=1e-6)
    model, run = runs[True]
    x = run.x[-1, :, 0]
    normal = np.cross(*np.diff(x[model.triangles[0]], axis=0))
    normal /= np.linalg.norm(normal)
    heights = [(panel(model, x, p).mean(axis=0) - panel(model, x, 0).mean(axis=0)) @ normal for p in range(4)]
    np.testing.assert_allclose(np.diff(np.sort(heights)), t, atol=0.05 * t)


# slits ----------------------------------------------------------------------------------------------------------------


def test_a_slit_lets_its_sides_part():
    pattern = grid(2, 2, 0.02, 0.02)
    slit = [(4, 5)]
    whole, opened = (Sheet(p, thickness=MM) for p in (pattern, cut(pattern, slit)))
    assert len(opened.mesh.creases) == len(whole.mesh.creases) - 1
    assert len(opened.mesh.vertices) == len(whole.mesh.vertices) + 1  # its end on the border parts, the other stays
    with pytest.raises(InputError, match="only an edge between two panels can be cut"):
        cut(pattern, [(0, 1)])
    with pytest.raises(InputError, match="only an edge between two panels can be cut"):
        cut(pattern, [99])


# files, refusals ------------------------------------------------------------------------------------------------------


def test_a_design_file_repeats_it(tmp_path):
    s = pair().panel([1], thickness="3 mm", offset="0.5 mm").hinge(at="0.8 mm", gap="1 mm").mitre([0], angle="20 deg")
    write_design(tmp_path / "thick.toml", s)
    again = read_design(tmp_path / "thick.toml").sheet
    (one, p), (other, q) = s.build(), again.build()
    assert one.hash == other.hash and p.hash == q.hash


def test_what_cannot_be_is_refused():
    with pytest.raises(InputError, match="bars turn about the middle plane"):
        pair(panels="elastic").hinge(at="top").build()
    with pytest.raises(InputError, match="cannot move"):
        pair().hinge(at="middle").build()
    with pytest.raises(InputError, match="the top of panel 0 lies at 1 mm, that of panel 1 at 2 mm"):
        pair().panel([1], thickness=4 * MM).hinge(at="top").build()
    with pytest.raises(InputError, match="stated on a flat pattern"):
        miura_sheet(0.6, 1).crease(stiffness=0.01).hinge(at="top").build()
    with pytest.raises(InputError, match="does not say how stiff"):
        pair().crease(stiffness=0.0).hinge(at="top").build()
    for wrong in ({"at": "side"}, {"at": np.inf}, {"gap": -1.0}, {"stop_stiffness": 0.0}):
        with pytest.raises(InputError):
            pair().hinge(**wrong)
    for wrong in ({"angle": 1.6}, {"angle": -0.1}, {"angle": 0.5, "face": "left"}):
        with pytest.raises(InputError):
            pair().mitre(**wrong)
    for wrong in ({"thickness": 0.0}, {"offset": np.nan}, {"rigidity": -1.0}):
        with pytest.raises(InputError):
            pair().panel([0], **wrong)
    for wrong in (pair().hinge(gap=90 * MM), pair(lengths=(0.04, 0.02)).mitre(angle=np.radians(88))):
        with pytest.raises(InputError, match=r"nothing is left of panel [01], which is [24]0 mm wide there"):
            wrong.build()
    with pytest.raises(InputError, match="there is no such crease"):
        pair().hinge([1], at="top")

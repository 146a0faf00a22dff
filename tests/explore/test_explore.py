"""Sweeps, inverse design and gradients: against closed forms, against differences, resumed and on a cluster."""

import json

import numpy as np
import pytest

from origami_sim.design.build import Sheet
from origami_sim.drive import Drive, ramp
from origami_sim.errors import InputError
from origami_sim.explore import Way, angle, find, gradient, moved, optimise, solve_for, stride, sweep
from origami_sim.explore.found import number
from origami_sim.pattern import miura, strip
from origami_sim.physics.materials import MU0
from origami_sim.quantities import si

WIDTH, LENGTH, PATCH, REMANENCE = 0.02, 0.018, 3e-3, 0.13
MOTION = Way(duration=0.05, rate=200.0, threads=1)


def flap(stiffness=2e-3, field=0.05, gap=0.002, beta=np.pi / 2, gravity=0.0):
    """A magnetic flap, which a field at an angle beta from the sheet turns."""
    sheet = Sheet(strip([0.01, gap + LENGTH], WIDTH), thickness=1e-3, triangulation="center")
    sheet.patch(1, thickness=PATCH, size=(LENGTH, WIDTH), poling=(1, 0, 0), remanence=REMANENCE)
    sheet.crease(stiffness=stiffness, loss_time=3e-3).fix(panels=[0]).name("crease", ["hinge"])
    sheet.panel([0, 1], rigidity=1.0).gravity((0, 0, -gravity))
    return sheet, Drive(field=(field * np.cos(beta), 0, ramp(field * np.sin(beta), 0.02)))


MOMENT = REMANENCE * LENGTH * WIDTH * PATCH / MU0
"""Magnetic moment of the patch [A m^2]."""


def differences(build, measure, point, name, way=None, step=1e-3):
    """Derivative by differences of fourth order of devices that are all found anew."""
    h = point[name] * step
    values = [measure(f) for f in find(build, [{**point, name: point[name] + s * h} for s in (1, -1, 2, -2)], way)]
    return float(np.array([8, -8, -1, 1]) @ values / 12 / h)


# where a device is found ---------------------------------------------------------------------------------------------


def test_equilibria_obey_the_closed_form():
    """K theta = m B sin(beta - theta), up to how the panels bend."""
    for found, beta in zip(find(flap, [{"beta": b} for b in (1.0, 1.5)]), (1.0, 1.5), strict=True):
        theta = found.angle("hinge")
        assert 2e-3 * theta == pytest.approx(MOMENT * 0.05 * np.sin(beta - theta), rel=1e-3)
        assert found.motion is None and found.failure == ""


def test_motions_of_one_batch_are_those_of_each_alone():
    points = [{"gap": 2e-3, "field": 0.03}, {"gap": 3e-3, "field": 0.05}, {"stiffness": 1e-3}]
    together = find(flap, points, MOTION)
    for p, found in zip(points, together, strict=True):
        alone = find(flap, [p], MOTION)[0]
        assert found.angle(0) == pytest.approx(alone.angle(0), abs=2e-4)  # of another time step
        assert np.ptp(found.model.position[:, 0]) == np.ptp(alone.model.position[:, 0])
        assert found.motion is not None and found.motion.x.shape[2] == 1


def test_measures_say_what_there_is():
    found = find(flap, [{}], MOTION)[0]
    with pytest.raises(InputError, match="'hinge' is near"):
        found.angle("hing")
    with pytest.raises(InputError, match="no such axis"):
        found.moved("q")
    assert moved("z")(found) > 0
    assert found.mass() == pytest.approx(1010 * 1e-3 * 0.03 * 0.02 + 2800 * LENGTH * WIDTH * PATCH, rel=1e-6)
    with pytest.raises(InputError, match=r"does not take this point.*gpa"):
        find(flap, [{"gpa": 1e-3}])


def test_defaults_that_are_quantities_are_numbers():
    def build(gap="2 mm", field="50 mT"):
        return flap(gap=gap * 1.0, field=field * 1.0)

    assert find(build, [{"field": 0.05}])[0].angle(0) == find(flap, [{}])[0].angle(0)


# gradients -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["stiffness", "field", "gap", "beta", "gravity"])
def test_gradients_of_equilibria_are_those_of_equilibria_found_anew(name):
    """By a stiffness, a drive, the geometry (which moves held nodes, too) and a load."""
    point = {"stiffness": 2e-3, "field": 0.05, "gap": 2e-3, "beta": 2.0, "gravity": 9.8}

    def height(found):
        return float(found.x[-1, 2])

    g = gradient(
        flap, [angle("hinge"), height], {name: point[name]}, fixed={n: v for n, v in point.items() if n != name}
    )
    for m, slope in zip((angle("hinge"), height), g.slope[:, 0], strict=True):
        assert slope == pytest.approx(differences(flap, m, point, name), rel=1e-6)


@pytest.mark.parametrize("name", ["stiffness", "gap"])
def test_gradients_of_motions_are_those_of_motions_with_one_step(name):
    point = {"stiffness": 2e-3, "gap": 2e-3}
    way = Way(duration=0.04, rate=200.0, dt=4e-5, threads=1)
    g = gradient(flap, angle("hinge"), point, way=way)
    k = list(point).index(name)
    assert g.slope[0, k] == pytest.approx(differences(flap, angle("hinge"), point, name, way, step=2e-3), rel=1e-6)
    assert g.error[0, k] < 1e-3 * abs(g.slope[0, k])


def test_gradients_that_there_are_not():
    with pytest.raises(InputError, match="needs a scale"):
        gradient(flap, angle(0), {"gravity": 0.0})

    def rebuilt(parts=1.0):
        return flap()[0] if parts < 1.0005 else Sheet(strip([0.1] * 3, 0.1), thickness=1e-3).fix(panels=[0])

    with pytest.raises(InputError, match="topology changes"):
        gradient(rebuilt, angle(0), {"parts": 1.0})


def rigid_flap(stiffness=2e-3, field=0.05, gap=2e-3, beta=2.0, gravity=9.8):
    """The flap of rigid panels, its base held."""
    sheet = Sheet(strip([0.01, gap + LENGTH], WIDTH), thickness=1e-3, triangulation="center", panels="rigid")
    sheet.patch(1, thickness=PATCH, size=(LENGTH, WIDTH), poling=(1, 0, 0), remanence=REMANENCE)
    sheet.crease(stiffness=stiffness).fix(panels=[0]).gravity((0, 0, -gravity))
    return sheet, Drive(field=(field * np.cos(beta), 0, ramp(field * np.sin(beta), 0.02)))


def rigid_door(length=0.02, stiffness=2e-4, lean=0.3):
    """Two rigid panels with magnets, the first of which turns about an edge that is held."""
    sheet = Sheet(strip([length, 0.015], 0.02), thickness=1e-3, panels="rigid", triangulation="center")
    sheet.patch(0, thickness=2e-3, poling=(1, 0, 0)).patch(1, thickness=2e-3, poling=(1, 0, 0))
    sheet.crease(stiffness=stiffness).gravity().fix(nodes=[0, 1])
    return sheet, Drive(field=(0.01 * np.cos(lean), 0, 0.05))


def rigid_cells(gamma=1.0, fold=0.8, stiffness=1e-3, held=True):
    """A cell of a Miura sheet, a closed loop, with creases that no folded state leaves without moment."""
    sheet = Sheet(miura(1, 1, 0.03, 0.03, gamma, fold_angle=fold), thickness=5e-4, panels="rigid")
    sheet.crease(stiffness=stiffness).gravity((0, 0, -9.8 if held else 0.0))
    model, parameters = (sheet.fix(panels=[0]) if held else sheet).build()
    uneven = np.random.default_rng(4).uniform(0.5, 2.0, len(model.creases))
    parameters.set("crease", "stiffness", parameters["crease", "stiffness"][:, 0] * uneven)
    parameters.set("crease", "rest_angle", 1.5 * uneven * parameters["crease", "rest_angle"][:, 0])
    return model, parameters


def reach(found):
    return float(np.linalg.norm(found.x[-1] - found.x[0]))


@pytest.mark.parametrize(
    ("build", "point"),
    [
        (rigid_flap, {"stiffness": 2e-3, "field": 0.05, "gap": 2e-3, "beta": 2.0, "gravity": 9.8}),
        (rigid_door, {"length": 0.02, "stiffness": 2e-4, "lean": 0.3}),
        (rigid_cells, {"gamma": 1.0, "fold": 0.8, "stiffness": 1e-3}),
        (lambda gamma, fold: rigid_cells(gamma, fold, held=False), {"gamma": 1.0, "fold": 0.8}),
    ],
    ids=["held", "hinged", "loops", "free"],
)
def test_gradients_of_rigid_equilibria_are_those_of_equilibria_found_anew(build, point):
    """By stiffness, drive, weight and geometry, which moves the root and opens loops that hinges then close."""
    g = gradient(build, [angle(0), reach], point)
    for k, m in enumerate((angle(0), reach)):
        for j, name in enumerate(point):
            assert g.slope[k, j] == pytest.approx(differences(build, m, point, name), rel=1e-6, abs=1e-12)


def test_rigid_panels_whose_loops_cannot_follow_have_no_gradient():
    """A Miura sheet folds as one; of one whose inner corner is elsewhere no panel can turn."""

    def bent(moved=0.0):
        pattern = miura(2, 2, 0.03, 0.03, 1.0, fold_angle=0.8)
        inner = int(np.argmin(np.linalg.norm(pattern.vertices - pattern.vertices.mean(axis=0), axis=1)))
        pattern.vertices[inner, 1] += moved
        sheet = Sheet(pattern, thickness=5e-4, panels="rigid").fix(panels=[0])
        return sheet.crease(stiffness=1e-3, rest_angle=0.5)

    with pytest.raises(InputError, match="keeps loops closed"):
        gradient(bent, angle(0), {"moved": 0.0}, scales={"moved": 0.01})


# inverse design ------------------------------------------------------------------------------------------------------


def test_solve_for_one_number():
    found = solve_for(flap, angle("hinge"), "60 deg", {"stiffness": (1e-4, 1e-2)})
    assert found.reached and found.value == pytest.approx(np.radians(60), abs=1e-7)
    exact = MOMENT * 0.05 * np.cos(np.radians(60)) / np.radians(60)
    assert found.values["stiffness"] == pytest.approx(exact, rel=1e-3)
    far = solve_for(flap, angle("hinge"), "120 deg", {"stiffness": (1e-4, 1e-2)})
    assert not far.reached and "out of reach" in far.message


def test_solve_for_two_numbers():
    wanted = find(flap, [{"stiffness": 1.3e-3, "gap": 2.7e-3}])[0]

    def reach(found):
        return float(found.x[-1, 0])

    found = solve_for(
        flap, [angle("hinge"), reach], [wanted.angle("hinge"), reach(wanted)],
        {"stiffness": (5e-4, 4e-3), "gap": ("1 mm", "4 mm")},
    )  # fmt: skip
    assert found.reached, found.message
    assert found.values == pytest.approx({"stiffness": 1.3e-3, "gap": 2.7e-3}, rel=1e-3)


def test_optimise_finds_an_optimum_inside_and_one_at_a_bound():
    """The torque on a flap that is hardly turned is largest for a field across it."""
    inside = optimise(flap, lambda f: -f.angle("hinge"), {"beta": (0.3, 2.8)}, fixed={"stiffness": 0.2})
    assert inside.reached
    assert inside.values["beta"] == pytest.approx(np.pi / 2 + inside.found.angle("hinge"), abs=0.01)
    bound = optimise(flap, lambda f: -f.angle("hinge"), {"stiffness": (1e-3, 5e-3), "field": ("10 mT", "40 mT")})
    assert bound.values == pytest.approx({"stiffness": 1e-3, "field": 0.04}, rel=1e-6)
    assert min(t["value"] for t in bound.tried) == bound.value


def test_optimise_keeps_what_it_is_subject_to():
    found = optimise(
        flap, lambda f: -f.angle("hinge"), {"field": ("5 mT", "80 mT"), "stiffness": (1e-3, 5e-3)},
        subject_to=[(angle("hinge"), None, "50 deg")],
    )  # fmt: skip
    assert found.value == pytest.approx(-np.radians(50), rel=1e-4)


def test_bad_questions_are_one_sentence():
    with pytest.raises(InputError, match="bounds are an interval"):
        optimise(flap, angle(0), {"gap": ("3 mm", "1 mm")})
    with pytest.raises(InputError, match="nothing is unknown"):
        solve_for(flap, angle(0), 1.0, {})
    with pytest.raises(InputError, match="differ in number"):
        solve_for(flap, [angle(0)], [1.0, 2.0], {"gap": (1e-3, 2e-3)})


# sweeps --------------------------------------------------------------------------------------------------------------

GRID = {"gap": ["1 mm", "2 mm", "3 mm"], "field": ["20 mT", "50 mT"]}


def fold(found):
    return found.angle("hinge")


def weight(found):
    return found.mass()


def test_sweep_takes_all_combinations():
    found = sweep(flap, GRID, {"fold": fold})
    assert len(found) == 6 and found.inputs == ("gap", "field") and not found.failures
    assert found.columns["gap"].tolist() == [1e-3, 1e-3, 2e-3, 2e-3, 3e-3, 3e-3]
    alone = find(flap, [found.point(3)])[0].angle("hinge")
    assert found.columns["fold"][3] == alone
    points = sweep(flap, [{"gap": 1e-3, "field": 0.02}, {"gap": 2e-3, "field": 0.05}], {"fold": fold})
    np.testing.assert_array_equal(points.columns["fold"], found.columns["fold"][[0, 3]])


def test_sweep_goes_on_where_it_stopped(tmp_path):
    first = sweep(flap, {"gap": [1e-3, 2e-3]}, {"fold": fold}, folder=tmp_path)
    assert first.computed == 2
    second = sweep(flap, {"gap": [1e-3, 2e-3, 3e-3]}, {"fold": fold}, folder=tmp_path)
    assert second.computed == 1
    np.testing.assert_array_equal(second.columns["fold"][:2], first.columns["fold"])
    file = tmp_path / "points.jsonl"
    lines = file.read_text().splitlines()
    file.write_text("\n".join([*lines[:2], lines[2][:20]]))  # interrupted while writing
    assert sweep(flap, {"gap": [1e-3, 2e-3, 3e-3]}, {"fold": fold}, folder=tmp_path).computed == 1
    assert json.loads(lines[0])["row"]["values"]["fold"] == first.columns["fold"][0]

    def softer(gap=2e-3):
        return flap(stiffness=1e-3, gap=gap)

    assert sweep(softer, {"gap": [1e-3]}, {"fold": fold}, folder=tmp_path).computed == 1
    assert sweep(flap, {"gap": [1e-3]}, {"fold": weight}, folder=tmp_path).computed == 1
    assert sweep(flap, {"gap": [1e-3]}, {"fold": fold}, folder=tmp_path, way=Way(follow=2)).computed == 1


def test_pareto_front():
    found = sweep(flap, {"gap": [1e-3, 2e-3, 3e-3], "stiffness": [2e-3, 3e-3]}, {"fold": fold, "mass": weight})
    front = found.pareto("mass", "-fold")
    fold_, mass = found.columns["fold"], found.columns["mass"]
    assert 0 < len(front) < 6 and np.all(np.diff(mass[front]) >= 0) and np.all(np.diff(fold_[front]) > 0)
    for k in set(range(6)) - set(front.tolist()):
        assert any(mass[j] <= mass[k] and fold_[j] >= fold_[k] for j in front)
    assert found.columns["gap"][found.pareto("gap", "-fold")[0]] == 1e-3  # of what was varied, too
    with pytest.raises(InputError, match=r"no such measure.*fold, mass, gap, stiffness"):
        found.pareto("weight")


def test_pictures_of_fronts(tmp_path):
    found = sweep(flap, {"gap": [1e-3, 2e-3, 3e-3]}, {"fold": fold, "mass": weight})
    assert found.draw(tmp_path / "front.png", "mass", "-fold").stat().st_size > 5000


def test_sweep_on_a_cluster():
    distributed = pytest.importorskip("distributed", reason="the extra 'cluster' is not installed")
    with distributed.LocalCluster(n_workers=1, processes=False, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            there = sweep(flap, GRID, {"fold": fold}, client=client)
    np.testing.assert_array_equal(there.columns["fold"], sweep(flap, GRID, {"fold": fold}).columns["fold"])


@pytest.mark.parametrize(
    ("grid", "measures", "said"),
    [
        ({}, {"fold": fold}, "needs points"),
        ({"gap": [1e-3]}, {}, "needs a measure"),
        ([{"gap": 1e-3}, {"field": 0.1}], {"fold": fold}, "different numbers"),
    ],
)
def test_bad_sweeps(grid, measures, said):
    with pytest.raises(InputError, match=said):
        sweep(flap, grid, measures)


# the command line ----------------------------------------------------------------------------------------------------

DEVICE = """
from origami_sim import Drive, Sheet, ramp, strip

DURATION = "0.1 s"

def build(gap="2 mm", field="50 mT", held=True):
    sheet = Sheet(strip([0.01, gap + 0.018], 0.02), thickness="1 mm", triangulation="center")
    sheet.patch(1, thickness="3 mm", size=("18 mm", "20 mm"), poling=(1, 0, 0)).name("crease", ["hinge"])
    sheet.crease(stiffness="2 mN m/rad", loss_time="3 ms").gravity().fix(panels=[0])
    return sheet, Drive(field=(0, 0, ramp(field, "20 ms")))
"""


@pytest.fixture
def call(call, tmp_path):
    """Runs a command line in a folder with the file of a flap."""
    (tmp_path / "my_flap.py").write_text(DEVICE)
    return call


def test_sweep_from_the_command_line(call, tmp_path):
    line = ("sweep", "my_flap.py", "--vary", "gap=1mm:3mm:3", "--vary", "field=20mT,50mT", "--json")
    code, out, err = call(*line, "--pareto", "mass_g,-hinge_deg")
    assert (code, err) == (0, "")
    first = json.loads(out)
    assert first["computed"] == 6 and first["columns"]["gap"] == pytest.approx([1e-3, 1e-3, 2e-3, 2e-3, 3e-3, 3e-3])
    assert max(first["columns"]["hinge_deg"]) > 30
    assert (tmp_path / first["pareto"]).is_file() and (tmp_path / first["table"]).is_file()
    again = json.loads(call(*line, "--pareto", "field,-hinge_deg")[1])
    assert (tmp_path / again["pareto"]).is_file()
    code, _, err = call(*line[:4], "--vary", "held=true", "--pareto", "held,-hinge_deg", "--out", "words")
    assert code == 2 and "no such measure" in err and not (tmp_path / "words").exists()
    assert again["computed"] == 0 and again["columns"] == first["columns"]
    code, out, _ = call("sweep", "my_flap.py", "--vary", "gap=2mm", "--equilibrium", "--out", "rest")
    assert code == 0 and "hinge_deg" in out


def test_a_setting_is_set_or_varied(call, tmp_path):
    code, _, err = call("sweep", "my_flap.py", "--set", "gap=2mm", "--vary", "gap=1mm,2mm")
    assert code == 2 and "is set and varied at once (field '--set', value 'gap')" in err and err.count("\n") == 1
    assert not (tmp_path / "runs").exists()
    code, _, _ = call("sweep", "my_flap.py", "--set", "field=20mT", "--vary", "gap=1mm,2mm")
    assert code == 0 and [f.name for f in (tmp_path / "runs").iterdir()] == ["sweep_my_flap"]


WALKER = """
import numpy as np
from origami_sim import Drive, Sheet, si, sine
from origami_sim.pattern.assemble import assemble

def build(field="10 mT", frequency="2 Hz"):
    x, z = si("17 mm"), si("10 mm")
    places = [(X, 6e-3 * y, Z) for X, Z in ((-x, 0), (0, z), (x, 0)) for y in (-1, 1)]
    sheet = Sheet(assemble(places, [(0, 2, 3, 1), (2, 4, 5, 3)]), thickness="0.5 mm", material="pet", panels="rigid")
    sheet.crease(stiffness="0.3 mN m/rad", loss_time="10 ms")
    for panel, side in ((0, 1), (1, -1)):
        sheet.magnetise(panel, remanence="0.1 T", volume="60 mm^3", poling=(side * x, 0, z))
    sheet.feet([0, 1, 4, 5], height=0, friction=0.2, backward=0.6).ground(nodes=(), friction=0.2)
    return sheet, Drive(field=(0, 0, sine(field, frequency)))
"""


def test_strides_are_by_cycle_and_moved_over_the_whole(call, tmp_path):
    """With five cycles each, however long they last; `stride` of the command line finds the same."""
    (tmp_path / "walker.py").write_text(WALKER)
    code, out, err = call("sweep", "walker.py", "--vary", "frequency=4,2", "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)["columns"]
    moved, each = np.array(found["moved_x_mm"]), np.array(found["stride_x_mm"])
    assert each == pytest.approx(2.55, rel=0.02)  # slow: inertia hardly matters
    assert moved[0] == pytest.approx(10 * each[0], rel=0.05)  # as long as the slower one takes for five
    assert moved[1] == pytest.approx(5 * each[1], rel=0.05)
    code, out, err = call("stride", "walker.py", "--set", "frequency=4", "--json")
    one = json.loads(out)
    assert (code, err) == (0, "") and len(one["columns"]["cycle"]) == 5 and one["numbers"]["period_s"] == 0.25
    assert one["numbers"]["stride_x_mm"] == pytest.approx(each[0], rel=1e-3)
    code, out, _ = call("stride", "walker.py", "--cycles", "4")
    assert code == 0 and "mm per cycle of 0.5 s, of the centre of mass over the last 2 cycles" in out
    assert "stride_x_mm" not in call("sweep", "walker.py", "--vary", "field=1mT", "--equilibrium")[1]


def test_what_has_no_period_has_no_stride(call):
    code, _, err = call("stride", "my_flap.py")
    assert code == 2 and "my_flap.py: the drive has no period (field 'drive'); allowed: sine(...)" in err
    with pytest.raises(InputError, match="at rest has no stride"):
        sweep(flap, {"gap": [2e-3]}, {"s": stride("x")})
    with pytest.raises(InputError, match=r"no such axis.*'w'"):
        sweep(flap, {"gap": [2e-3]}, {"s": stride("w")})


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("gpa=1mm", "'gap' is near"),
        ("gap", "cannot vary"),
        ("gap=1mT", "wrong unit"),
        ("gap=", "not a number"),
    ],
)
def test_a_bad_sweep_is_one_sentence(call, tmp_path, given, said):
    code, _, err = call("sweep", "my_flap.py", "--vary", given)
    assert code == 2 and said in err and err.count("\n") == 1
    assert not (tmp_path / "runs").exists()


def test_what_a_sweep_kept_may_be_damaged(tmp_path):
    from origami_sim.explore.sweep import ROWS, _Kept

    good = b'{"key": "a", "row": {"x": 1.0}}\n'
    (tmp_path / ROWS).write_bytes(good + b"[" * 100_000 + b'\n\xff\n{"key": "b", "row": 3}\n[1]\n')
    assert _Kept(tmp_path).rows == {"a": {"x": 1.0}}


def test_quantities_of_another_kind_are_refused():
    def build(gap="2 mm", field=0.05, parts=2, side="top", held=True):
        return flap(gap=si(gap))

    for grid, said in (
        ({"gap": ["1 mT"]}, r"wrong unit.*gap.*mT"),
        ({"gap": [True]}, r"a switch is no number.*gap"),
        ({"parts": ["3 mm"]}, r"wrong unit.*parts"),
        ({"field": ["strong"]}, r"not a number.*field"),
    ):
        with pytest.raises(InputError, match=said):
            sweep(build, grid, {"fold": angle(0)})
    assert number(build, "top", "side") == "top" and number(build, False, "held") is False
    assert number(build, "20 mT", "field") == pytest.approx(0.02)
    with pytest.raises(InputError, match=r"wrong unit.*target.*mm"):
        solve_for(build, angle(0), "9 mm", {"gap": ("1 mm", "4 mm")})
    with pytest.raises(InputError, match=r"wrong unit.*gap.*mT"):
        solve_for(build, angle(0), "9 deg", {"gap": ("1 mT", "4 mT")})
    with pytest.raises(InputError, match=r"wrong unit.*subject_to.*deg"):
        optimise(build, angle(0), {"gap": ("1 mm", "4 mm")}, subject_to=[(moved("x"), "1 deg", None)])

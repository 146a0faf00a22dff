"""The independent truth against closed forms and against the simulator under test."""

import json
from itertools import pairwise, product

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from origami_proof import STRUCTURES, battery, case
from origami_sim.device.scene import scene_module, scene_settings
from origami_sim.hypotheses.hypothesis import Hypothesis
from origami_sim.observation.observe import follow, observe_equilibria
from origami_sim.predict.prescribed import curves
from origami_sim.recording import read_recording

pytest.importorskip("mujoco", reason="the truth of the proof needs MuJoCo: pip install -e proof")


def flap(truth, **crease) -> dict:
    """One panel on a hinge, without weight."""
    o = truth["objects"].draw("hanging_strip", np.random.default_rng(0))
    vertices, faces = truth["objects"].strip([0.03, 0.03], 0.03)
    o |= {"vertices": vertices, "faces": faces, "gravity": 0.0}
    o["creases"] = [{"name": "fold1", "panels": [0, 1], "stiffness": 2e-4, "viscosity": 0.0, **crease}]
    return o


def inertia(o: dict) -> float:
    return o["density"] * o["thickness"] * 0.03**2 * (0.03**2 / 3 + o["thickness"] ** 2 / 12)


def crossings(motion) -> np.ndarray:
    """Times at which the first angle goes upwards through zero."""
    q, t = motion.angles[:, 0], motion.times
    n = np.flatnonzero((q[:-1] < 0) & (q[1:] >= 0))
    return t[n] - q[n] * (t[n + 1] - t[n]) / (q[n + 1] - q[n])


def test_period_of_a_flap(truth):
    o = flap(truth)
    motion = truth["world"].World(o).run({}, [0.2], duration=2.0)
    expected = 2 * np.pi * np.sqrt(inertia(o) / o["creases"][0]["stiffness"])
    assert np.diff(crossings(motion)).mean() == pytest.approx(expected, rel=1e-4)


def test_a_strip_in_a_field_is_of_second_order_in_the_step(truth, monkeypatch):
    world = truth["world"]
    o = truth["objects"].draw("magnetic_strip", np.random.default_rng(2))
    for c in o["creases"]:
        c["viscosity"] = 2e-6
    field = {"field": {"amplitude": 0.02, "frequency": 3.0, "axis": [1.0, 0.0, 0.0]}}
    found = []
    for every in (4, 8, 16):
        monkeypatch.setattr(world, "STEP", 1.0 / world.FINE / every)
        found.append(world.World(o).run(field, [0.5, -0.4, 0.3], duration=0.5).angles)
    a, b = (np.abs(x - y).max() for x, y in pairwise(found))
    assert np.log2(a / b) == pytest.approx(2.0, abs=0.1)


def test_a_truth_that_flies_off_is_not_recorded(truth, monkeypatch):
    monkeypatch.setattr(truth["world"], "FASTEST", 1.0)
    monkeypatch.setattr(truth["draw"], "ATTEMPTS", 2)
    with pytest.raises(truth["draw"].Unsuited, match="rates of"):
        truth["draw"].drawn("single", (5.0, "eccentric_weight", "crawler"), np.random.default_rng(0))


def test_dry_friction_takes_the_same_angle_from_every_swing(truth):
    # Coulomb: the amplitude falls by 4 M / K per period
    o, moment = flap(truth), 4e-7
    law = truth["laws"].build("dry_friction", moment, 0, {})
    motion = truth["world"].World(o, laws=(law,)).run({}, [0.3], duration=1.0)
    q = motion.angles[:, 0]
    tops = q[1:-1][(q[1:-1] > q[:-2]) & (q[1:-1] >= q[2:]) & (q[1:-1] > 0)]
    assert np.diff(tops).mean() == pytest.approx(-4 * moment / o["creases"][0]["stiffness"], rel=0.05)


def test_air_drag_has_the_moment_of_a_turning_plate(truth):
    # moment rho Cd b L^4 / 8 w^2 about the hinge
    o = flap(truth)
    world = truth["world"].World(o, laws=(truth["laws"].build("air_drag", 1.2, 0, {}),))
    motion = world.run({}, [0.0], [5.0], duration=0.02)
    free = truth["world"].World(o).run({}, [0.0], [5.0], duration=0.02)
    slowed = (motion.rates - free.rates)[-1, 0] * inertia(o)
    speed = free.rates[:, 0]
    expected = -1.2 * 1.2 * 0.03 * 0.03**4 / 8 * np.mean(speed * np.abs(speed)) * 0.02
    assert slowed == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize("lag", [4e-5, 5e-4, 1e-2])
def test_a_lag_of_the_field_is_exact_whether_longer_or_shorter_than_a_step(truth, lag):
    """Against the supply's own solution for a sine: with the field of the step's end, 0.05 ms were 0.01 ms."""
    dt, omega = 1.3e-4, 2.0 * np.pi * 3.0
    t = np.arange(20000) * dt
    law = truth["laws"].build("field_lag", lag, 0, {})
    law.reset(None, None)
    found = np.array([law.field(np.array([0.0, 0.0, b]), dt)[2] for b in np.sin(omega * t)])
    x = omega * lag
    exact = (np.sin(omega * t) - x * np.cos(omega * t) + x * np.exp(-t / lag)) / (1.0 + x * x)
    assert np.max(np.abs(found - exact)) < 6e-7  # 5e-7; a sine differs from straight steps by up to 7.5e-7


def test_a_concealed_couple_of_magnets_conserves_energy(truth):
    o = truth["objects"].draw("hanging_strip", np.random.default_rng(3))
    for c in o["creases"]:
        c["viscosity"] = 0.0
    world = truth["world"].World(o, laws=(truth["laws"].build("hidden_magnets", 2e-5, 0, {}),))
    world.model.opt.enableflags |= 2  # mjENBL_ENERGY
    motion = world.run({}, [0.5, -0.4, 0.3][: len(o["creases"])], duration=0.5)

    def total(n):
        d, m = world.data, world.model
        import mujoco

        d.qpos[:], d.qvel[:] = motion.angles[n], motion.rates[n]
        mujoco.mj_forward(m, d)
        pair = [world.body[h[2]] for h in world.hinges[:2]]
        a, b = (d.xmat[p].reshape(3, 3) @ world.normals[h[2]] for p, h in zip(pair, world.hinges[:2], strict=True))
        r = d.xipos[pair[1]] - d.xipos[pair[0]]
        far = np.linalg.norm(r)
        u = r / far
        return d.energy.sum() + 1e-7 * 2e-5 / far**3 * (a @ b - 3 * (a @ u) * (b @ u)), d.energy[1]

    energies = np.array([total(n) for n in range(0, len(motion.times), 8)])
    assert np.ptp(energies[:, 0]) < 0.01 * np.ptp(energies[:, 1])


@pytest.mark.parametrize("structure", ["hanging_strip", "pendulum_chain", "magnetic_strip", "box", "bi_fold"])
def test_both_simulators_agree_without_an_effect(truth, tmp_path, structure):
    """Rigid bodies in MuJoCo and panels of bars move alike, within the half step by which MuJoCo's velocities lag."""
    from origami_sim.drive import Drive, sine
    from origami_sim.model import State
    from origami_sim.model.articulation import Articulation
    from origami_sim.solve.motion.dynamics import simulate

    o = truth["objects"].draw(structure, np.random.default_rng(3))
    (tmp_path / "object.json").write_text(json.dumps(o))
    world, r = truth["world"].World(o), o["recordings"][0]
    start = np.array(r["release"]) + (world.settled() if "field" in r else 0.0)
    expected = world.run(r, start, duration=0.3)
    model, parameters, drive = case.subject(tmp_path).build({})
    if "field" in r:
        f = r["field"]
        waves = tuple(sine(f["amplitude"] * a, f["frequency"]) if a else 0 for a in f["axis"])
        drive = Drive(field=waves)
    names = model.names["crease"]
    order = [names.index(c["name"]) for c in o["creases"]]
    arm = Articulation(model)
    turn = np.zeros((arm.size, 1))
    for angle, crease in zip(start, order, strict=True):
        turn[list(arm.creases).index(crease)] = angle
    state = State.at_rest(model, position=arm.positions(arm.moved(arm.reference(), turn))[:, 0])
    motion = simulate(model, parameters, drive, duration=0.3, rate=480, state=state)
    lag = truth["world"].STEP * np.abs(expected.rates).max()
    assert np.abs(motion.creases[:, order, 0] - expected.angles).max() < 1.5 * lag + 5e-4


def test_a_crawler_walks_alike_in_both(truth, tmp_path):
    """Hunt-Crossley and Dahl against spring, dashpot and bristle: 1 % of the walk, a fifth of the camera's noise."""
    from origami_sim.drive import Drive, sine
    from origami_sim.solve.motion.dynamics import simulate

    o = truth["objects"].draw("crawler", np.random.default_rng(3))
    (tmp_path / "object.json").write_text(json.dumps(o))
    model, parameters, _ = case.subject(tmp_path).build({})
    world, r = truth["world"].World(o), o["recordings"][0]
    f = r["field"] = {**r["field"], "delay": 0.0}
    drive = Drive(field=(0, 0, sine(f["amplitude"], f["frequency"])))
    motion = world.run(r, np.zeros(len(world.joints)), duration=1.5)
    expected = truth["recorder"].channels(world, motion.angles)
    made = simulate(model, parameters, drive, duration=1.5, rate=480)
    found = np.concatenate([made.x[:, 2 * n, 0][:, [0, 2]] for n in range(3)], axis=1)
    walked = found[-1] - found[0]
    assert abs(walked[0]) > 4e-3
    assert np.abs((expected[-1] - expected[0] - walked)[[0, 2, 4]]).max() < 0.012 * abs(walked[0])
    assert np.sqrt(np.mean((found - expected) ** 2, axis=0)).max() < o["noise"] / 5


@pytest.mark.parametrize(("law", "strength"), [("", 0.0), ("foot_friction", 0.2), ("adhesion", 5e-3)])
def test_feet_hold_up_to_their_coefficient(truth, law, strength):
    """On a slope without a field: what stays is below, what slides above tan = mu, larger by what is concealed."""
    o = truth["objects"].draw("crawler", np.random.default_rng(4))
    o["creases"][0]["stiffness"] *= 100  # as one body
    mu, weight = o["feet"][0]["friction"], 2 * o["feet"][0]["load"]
    height, span = o["vertices"][0][2], o["feet"][1]["at"]
    # the lower foot, which rubs more, bears half and what the lean adds
    one = (mu + strength * 0.5) / (1.0 - strength * height / span)
    most = {"": mu, "foot_friction": one, "adhesion": mu * (1 + 4 * strength / weight)}[law]

    def slides(lean: float, duration=0.3) -> float:
        numbers = truth["world"].Numbers.described(o)
        numbers.tilt[0] = lean
        laws = (truth["laws"].build(law, strength, 1, {}),) if law else ()
        world = truth["world"].World(o, numbers, laws)
        motion = world.run({}, [0.0, 0.0, -o["feet"][0]["give"], 0.0], duration=duration)
        return float(motion.rates[-1, world.count])

    assert abs(slides(0.95 * most)) < 1e-3
    assert slides(1.1 * most) == pytest.approx(o["gravity"] * 0.1 * most * 0.3, rel=0.1)


@pytest.mark.parametrize(("name", "left"), [("ageing_friction", 0.0), ("static_friction", 0.2 / (1 + 30**2))])
def test_friction_of_rest_is_lost_by_sliding(truth, name, left):
    o = truth["objects"].draw("crawler", np.random.default_rng(4))
    law = truth["laws"].build(name, 0.2, 0, {})
    world = truth["world"].World(o, laws=(law,))
    world.run({}, np.zeros(len(world.joints)), duration=0.5)
    rested = o["feet"][0]["friction"] + 0.2
    assert [f.friction for f in world.feet] == pytest.approx([rested, rested], rel=0.01)
    world.run({}, np.zeros(len(world.joints)), [0.0, 0.33, 0.0, 0.0], duration=0.005)
    assert [f.friction for f in world.feet] == pytest.approx([o["feet"][0]["friction"] + left] * 2, rel=0.01)


def test_strength_gives_the_wanted_detectability(truth):
    o = truth["objects"].draw("pendulum_chain", np.random.default_rng(1)) | {"duration": 1.0}
    rigid = truth["rigid"].RigidCase(o, {})
    what = {"mechanism": "dry_friction", "place": 0, "extra": {}}
    now, signature = truth["draw"].strengthened(rigid, what, truth["laws"].INSIDE["dry_friction"], 10.0, 1.0)
    assert now["strength"] > 0 and np.linalg.norm(signature) == pytest.approx(10.0, rel=0.11)
    assert np.linalg.norm(rigid.signature([])) == pytest.approx(0.0, abs=1e-6)


# --- beams


def test_elastica_of_the_reference(truth):
    """Tip displacement over length of an elastica solved elsewhere (scenes/mae_cantilever.py)."""
    cantilever = scene_module("mae_cantilever")
    s = scene_settings(cantilever).as_dict()
    x = truth["beam"].cantilever(s, s["field"] * cantilever.SHARES, truth["beam"].Beam(), 1.0) / s["length"]
    assert np.hypot(1 - x[:, 0], x[:, 1]) == pytest.approx(cantilever.REFERENCE, rel=1e-4)


def test_elastica_with_all_effects_by_other_means(truth):
    """SciPy's solve_bvp, level after level, and the cubic by Newton's method."""
    beam = truth["beam"]
    made = beam.BeamCase(beam.draw("mae_cantilever", np.random.default_rng(0)), {})
    s, cell, stiff = made.settings, made.cell, made.scale(0) / beam.CELLS
    b = beam.Beam(cubic=8 * stiff, offset=0.3 * stiff, compliance=2.0, stiffening=0.3, tilt=0.2, stray=(1e-3, 2e-3),
                  loop=2e-3, saturation=5.0, taper=0.5, clamp=0.01 / stiff)  # fmt: skip
    levels = np.array(made.o["recordings"][0]["levels"])[[0, 3, 6, 8, 12, 20, 24]]
    length, bending = s["length"], s["modulus"] * s["width"] * s["thickness"] ** 3 / 12
    magnet = s["remanence"] / beam.MU0 * s["width"] * s["thickness"]
    found = beam.cantilever(s, levels, b, cell)
    for (bx, bz), tip in zip(beam.reaching(levels, b), found, strict=True):
        square = bx * bx + bz * bz
        local = bending * (1 + b.stiffening * square / (square + beam.BEND_HALF**2))

        def slope(at, y, bx=bx, bz=bz, local=local):
            k, root = y[1] * 0.0, local * (1 + b.taper * (at - 0.5))
            for _ in range(50):
                k -= (root * k + b.cubic * cell**3 * k**3 - y[1] - b.offset) / (root + 3 * b.cubic * cell**3 * k**2)
            along, across = bx * np.cos(y[0]) + bz * np.sin(y[0]), bz * np.cos(y[0]) - bx * np.sin(y[0])
            turning = -magnet * across * (1 - b.compliance * along)
            return length * np.stack([k, turning, np.cos(y[0]), np.sin(y[0])])

        def ends(root, far):
            return np.array([root[0] - b.clamp * root[1], far[1], root[2], root[3]])

        at = np.linspace(0.0, 1.0, 41)
        other = solve_bvp(slope, ends, at, np.stack([0 * at, 0 * at, length * at, 0 * at]), tol=1e-8)
        assert other.success and np.abs(other.y[2:, -1] - tip).max() < 2e-10 * length


def test_bender_of_the_reference(truth):
    """Curvature of an Ogden section solved elsewhere (scenes/de_bender.py); five layers of tape: 0.15 % apart."""
    bender = scene_module("de_bender")
    s = {**scene_settings(bender).as_dict(), "electrode_width": 0.019}
    keys = ("width", "electrode_width", "layers", "tape_layers", "tape_modulus", "permittivity")
    for tape in (1, 5):
        fixed = tuple((k, {**s, "tape_layers": float(tape)}[k]) for k in keys)
        found = [truth["beam"]._curvature(fixed, v, truth["beam"].Beam(), 1.0) for v in bender.VOLTAGES]
        assert found == pytest.approx(bender.REFERENCE[tape, True], rel=1.6e-3, abs=5e-5)


@pytest.mark.parametrize("structure", ["mae_cantilever", "de_bender"])
def test_scene_and_beam_agree_without_an_effect(truth, tmp_path, structure):
    """A chain of 16 cells and the continuous beam: closer than the smallest noise of a camera, 0.04 mm."""
    beam = truth["beam"]
    o = beam.draw(structure, np.random.default_rng(5))
    made = beam.BeamCase(o, {})
    tracker = {"noise": 1e-9, "quantum": 1e-10, "stated": 1e-4}
    made.write(tmp_path, [], tracker, np.random.default_rng(0))
    (tmp_path / "object.json").write_text(json.dumps(made.known()))
    recording = read_recording(tmp_path / "recording1.csv")
    model, parameters, _ = case.subject(tmp_path).build({})
    tip = int(np.argmax(model.position[:, 0] + 1e-9 * np.arange(len(model.position))))
    assert made.tip == tip
    found = observe_equilibria(model, parameters, follow(model, parameters, recording), recording)
    for axis in "xz":
        gap = found[f"tip_{axis}"] - recording.channels[f"tip_{axis}"].values
        assert np.abs(gap).max() < 3e-5


def test_the_numbers_take_up_what_they_can(truth):
    """Only remanence over modulus shows: z standard deviations of one are taken up by both, for z times their share."""
    beam = truth["beam"]

    class Stronger(beam.BeamCase):
        """The remanence is off by z standard deviations instead of what was concealed."""

        def curves(self, entries, **factors):
            return (
                super().curves([], remanence=1 + z * 0.03) if entries and not factors else super().curves([], **factors)
            )

    z, made = 0.5, Stronger(beam.draw("mae_cantilever", np.random.default_rng(2)), {})
    made.signature([])
    assert np.linalg.norm(made.signature(["something"])) == pytest.approx(z * 0.03 / np.hypot(0.03, 0.05), rel=0.03)


def test_every_effect_of_a_beam_shows(truth):
    beam = truth["beam"]
    for structure in beam.STRUCTURES:
        o = beam.draw(structure, np.random.default_rng(2))
        o["recordings"] = [{"levels": o["recordings"][0]["levels"][:17]}]  # up and back
        made = beam.BeamCase(o, {})
        for name, c in {**beam.INSIDE[structure], **beam.OUTSIDE[structure]}.items():
            what = {"mechanism": name, "place": 0, "extra": {"angle": 0.5}}
            _, signature = truth["draw"].strengthened(made, what, c, 5.0, 1.0)
            assert np.linalg.norm(signature) == pytest.approx(5.0, rel=0.11), name
        assert np.linalg.norm(made.signature([])) == 0.0


# --- a crease in a torque test


def test_coupon_follows_its_laws(truth):
    """Of a bridge: what all fibres do together is known in closed form."""
    coupon, stiffness = truth["coupon"], 1.5e-3
    fold = np.concatenate([[0.0], coupon.path(0, 1.0), coupon.path(1.0, -1.0), coupon.path(-1.0, 0.5)])

    def more(**effects):
        return coupon.moments(stiffness, fold, coupon.Bridge(**effects)) - stiffness * fold

    assert np.abs(more()).max() < 1e-12
    assert more(taper=0.5) == pytest.approx(more(taper=0.0) + (coupon_taper(0.5) - 1) * stiffness * fold, abs=1e-12)
    assert more(cubic=1e-4) == pytest.approx(1e-4 * fold**3, abs=1e-12)
    assert more(valley=2e-4) == pytest.approx(2e-4 * np.maximum(fold, 0), abs=1e-12)
    assert more(offset=1e-5) == pytest.approx(-1e-5 + 0 * fold, abs=1e-12)
    so_far = np.maximum.accumulate(fold) + np.minimum.accumulate(fold)
    assert more(lasting=1e-4) == pytest.approx(-1e-4 * so_far, abs=1e-12)
    dry = more(dry=1e-5)
    assert dry[1:] == pytest.approx(1e-5 * np.sign(np.diff(fold)), rel=0.01)
    # a rectangle that yields: M = Mp (1 - (a / turn)^2 / 3)
    plastic = more(plastic=1e-5, yields=0.1)[1:11]
    assert plastic == pytest.approx(1e-5 * (1 - (0.1 / fold[1:11]) ** 2 / 3), rel=0.02)
    virgin = more(virgin=1e-3, half=0.3)
    exact = 3e-3 * 0.3 * (0.2 + 0.09 * np.log(1.3 / 0.3))  # 3 Kv times the integral of s^2 half / (half + s)
    assert virgin[10] == pytest.approx(exact, rel=1e-4) and virgin[20] == pytest.approx(0.0, abs=1e-10)
    assert virgin[15] == pytest.approx(0.5 * virgin[10], rel=1e-9)  # back: no further damage


def coupon_taper(taper: float) -> float:
    """Stiffness of five stations in series over that of an even bridge."""
    own = 1 + taper * ((np.arange(5) + 0.5) / 5 - 0.5)
    return float(1 / np.mean(1 / own))


def test_scene_and_coupon_agree_without_an_effect(truth, tmp_path):
    made = truth["coupon"].CouponCase(truth["coupon"].draw("crease_coupon", np.random.default_rng(5)), {})
    made.write(tmp_path, [], {"noise": 1e-12, "quantum": 1e-13, "stated": 1e-6}, np.random.default_rng(0))
    (tmp_path / "object.json").write_text(json.dumps(made.known()))
    recording = read_recording(tmp_path / "recording1.csv")
    subject = case.subject(tmp_path)
    forward = curves(subject, [recording])
    assert forward is not None and [n.name for n in subject.nominals] == ["stiffness"]
    predicted = np.concatenate([v[0, :, 0] for v in forward.predict(Hypothesis(), [[subject.nominals[0].start]])])
    assert predicted == pytest.approx(recording.channels["moment"].values, abs=1e-11)


def test_a_case_has_a_page_and_a_replay(truth, tmp_path):
    rigid = truth["rigid"].RigidCase(flap(truth) | {"recordings": [{"release": [0.5]}], "duration": 1.5}, {})
    tracker = {"noise": 0.004, "quantum": 0.002, "smoothing": False, "lost": 0.0, "gap": 0, "stated": 0.004}
    rigid.write(tmp_path, [], tracker, np.random.default_rng(0))
    (tmp_path / "object.json").write_text(json.dumps(rigid.known()))
    page, data, replay = case.show(tmp_path, tmp_path / "shown")
    assert json.loads(data.read_text())["verdict"] in page.read_text() and replay.stat().st_size > 1000
    assert not (tmp_path / "diagnosis.json").exists()


def test_every_effect_of_a_coupon_shows(truth):
    coupon = truth["coupon"]
    made = coupon.CouponCase(coupon.draw("crease_coupon", np.random.default_rng(2)), {})
    for name, c in {**coupon.INSIDE["crease_coupon"], **coupon.OUTSIDE["crease_coupon"]}.items():
        what = {"mechanism": name, "place": 0, "extra": {"angle": 0.1}}
        _, signature = truth["draw"].strengthened(made, what, c, 5.0, 1.0)
        assert np.linalg.norm(signature) == pytest.approx(5.0, rel=0.11), name
    assert np.linalg.norm(made.signature([])) == 0.0


# --- confounded pairs


def test_overlap_and_what_is_left(truth):
    rivals = truth["rivals"]
    a, b = np.array([3.0, 4.0]), np.array([2.0, 0.0])
    assert rivals.overlap(a, b) == pytest.approx(0.6) and rivals.apart(a, b) == pytest.approx(4.0)


def test_a_confounded_pair_is_one_until_it_is_separated(truth):
    draw, pair = truth["draw"], truth["rivals"].PAIRS[-2]
    made, account, more = draw.confounded(pair, 1, np.random.default_rng(4))
    rival = account["rival"]
    assert (account["mechanism"], rival["mechanism"]) == ("field_stiffening", "stiffening")
    assert account["d"] >= 4.5 and rival["overlap"] >= 0.97 and rival["apart"] <= 3.0 and rival["separated"] >= 5.0
    assert max(more["levels"]) == 2 * max(made.o["recordings"][0]["levels"])
    # the same, from the written numbers
    both = [truth["rigid"].entry(e["mechanism"], e["strength"]) for e in (account, rival)]
    mine, theirs = (made.signature([e], fresh=n == 0) for n, e in enumerate(both))
    assert truth["rivals"].apart(mine, theirs) == pytest.approx(rival["apart"], rel=0.02)


def test_the_nearest_other_effect(truth):
    draw = truth["draw"]
    o = truth["beam"].draw("de_bender", np.random.default_rng(2))
    one = truth["rigid"].entry("rest_angle", 1e-5)
    sealed = {"object": o, "factors": {}, "concealed": [one], "site": "", "names": ["crease_offset"]}
    found = draw.nearest(sealed)
    made = draw.case_of(o, {})
    mine = made.signature([one], fresh=True)
    for name in ("stiffening", "length_scale", "voltage_offset"):  # all others, at any strength
        scale = made.scale(0) if truth["beam"].INSIDE["de_bender"][name].stiff else 1.0
        small = truth["rigid"].entry(name, truth["beam"].INSIDE["de_bender"][name].first * scale * 1e-3)
        assert truth["rivals"].apart(mine, made.beside(small)) > 0.9 * found["apart"]
    assert "length_scale" in found["mechanism"] and found["apart"] < np.linalg.norm(mine)


def test_an_effect_outside_is_as_strong_as_no_two_laws_can_imitate(truth):
    draw, o = truth["draw"], truth["coupon"].draw("crease_coupon", np.random.default_rng(3))
    case = draw.case_of(o, {})
    what = draw.placed(o, "fatigue", 0, {}, outside=True)
    account = draw.unlike(case, what, 10.0, np.random.default_rng(0))
    assert 7.0 < account["like"]["apart"] < account["d"] and account["d_wanted"] in (10.0, 20.0)
    one = truth["rigid"].entry("fatigue", account["strength"])
    mine = case.signature([one], fresh=True)
    assert np.linalg.norm(mine) == pytest.approx(account["d"], rel=1e-6)
    shapes = []  # of what is said to be most like it
    for name in account["like"]["mechanism"].split(" + "):
        c = truth["coupon"].INSIDE["crease_coupon"][name]
        extras = draw.EXTRAS.get(name, ({},))
        each = [truth["rigid"].entry(name, c.first * (case.scale(0) if c.stiff else 1.0), 0, x) for x in extras]
        shapes.append([case.beside(e) for e in each])
    left = []
    for pair in product(*shapes):
        x = np.linalg.lstsq(np.stack(pair, axis=1), mine, rcond=None)[0]
        left.append(np.linalg.norm(mine - np.stack(pair, axis=1) @ x))
    assert min(left) <= account["like"]["apart"] * (1 + 1e-6)  # which admits only losses, not gains


def test_a_small_effect_shows_beside_its_own_motion_as_it_does_from_rest(truth):
    draw = truth["draw"]
    o = truth["objects"].draw("pendulum_chain", np.random.default_rng(1))
    case = draw.case_of(o, {})
    small = truth["rigid"].entry("rest_angle", 1e-4)
    mine = case.signature([small], fresh=True)
    assert np.linalg.norm(case.beside(small) - mine) < 0.02 * np.linalg.norm(mine)


def test_structures_are_those_of_the_command(truth):
    assert truth["draw"].STRUCTURES == STRUCTURES


def test_pairs_are_of_known_mechanisms(truth):
    for p in truth["rivals"].PAIRS:
        known = truth["draw"].table(p.structure)
        assert p.one[0] in known and p.other[0] in known


@pytest.mark.parametrize(
    ("what", "recording", "expected"),
    [
        ("start from 0.3 times the displacement and rate", {"release": [1.0]}, {"release": [0.3]}),
        ("let it run 3 times as long", {"release": [1.0]}, {"release": [1.0], "stretch": 3.0}),
        ("voltage at 2 times the level", {"levels": [1.0, 3.0]}, {"levels": [2.0, 6.0]}),
        ("field reversed", {"levels": [1.0]}, {"levels": [-1.0]}),
        ("repeat the same curve", {"levels": [1.0]}, {"levels": [1.0]}),
        ("start from 2 times the displacement and rate", {"levels": [1.0]}, None),
        ("field at 3 times the frequency", {"release": [1.0]}, None),
        ("the set-up tilted by 10 degrees about y", {"release": [1.0]}, None),
    ],
)
def test_proposed_experiments(truth, what, recording, expected):
    assert truth["rivals"].proposed(what, recording) == expected


def test_a_proposed_drive(truth):
    field = {"amplitude": 0.02, "frequency": 2.0, "axis": [0, 0, 1]}
    made = truth["rivals"].proposed("field at 3 times the frequency", {"release": [0.0], "field": field})
    assert made["field"] == {**field, "frequency": 6.0}


def test_an_experiment_is_made_of_the_same_object(truth, tmp_path):
    draw = truth["draw"]
    folder, answer = tmp_path / "case", tmp_path / "sealed" / "0.json"
    made = draw.make(5, 0, folder, answer, structures=["de_bender"], kinds=["single"])
    draw.realise("voltage at 0.3 times the level", folder, answer, tmp_path / "more", repeats=2)
    assert (tmp_path / "more" / "recording1.csv").read_bytes() == (folder / "recording1.csv").read_bytes()
    third = read_recording(tmp_path / "more" / "recording3.csv")
    levels = np.array(made["object"]["recordings"][0]["levels"])
    fourth = read_recording(tmp_path / "more" / "recording4.csv")
    assert not np.array_equal(third.channels["tip_z"].values, fourth.channels["tip_z"].values)
    assert third.drive["voltage"].values.ravel() == pytest.approx(0.3 * levels)
    again = draw.case_of(made["object"] | {"recordings": [{"levels": (0.3 * levels).tolist()}]}, made["factors"])
    expected = again.curves(made["concealed"] + made["nuisances"])[0]
    got = np.stack([third.channels[f"tip_{a}"].values for a in "xz"], axis=1)
    assert np.abs(got - expected).max() < 6 * made["tracker"]["noise"]
    with pytest.raises(ValueError, match="cannot be made"):
        draw.realise("a tenth more mass on every panel", folder, answer, tmp_path / "none")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["single", "double", "confounded", "outside", "null", "beside"])
def test_a_case_is_the_same_for_the_same_seed_and_tells_nothing(truth, tmp_path, kind):
    kept = []
    for n in range(2):
        folder, answer = tmp_path / f"case{n}", tmp_path / f"answers{n}" / "0.json"
        made = truth["draw"].make(5, 2, folder, answer, structures=["pendulum_chain"], kinds=[kind])
        assert json.loads(answer.read_text())["kind"] == made["kind"] == kind
        kept.append({p.name: p.read_bytes() for p in folder.iterdir() if p.is_file()})
    assert kept[0] == kept[1]
    hidden = [made["mechanism"].encode()] if made["mechanism"] else []
    assert not any(word in b"".join(kept[0].values()) for word in (*hidden, b"nuisance", b"strength"))


@pytest.mark.slow
def test_a_proof_end_to_end_and_resumed(tmp_path):
    told = []
    options = {"cases": 1, "seed": 4, "structures": ["pendulum_chain"], "kinds": ["single"], "say": told.append}
    board = battery.prove(tmp_path, **options)
    assert board["cases"] == 1 and board["failed"] == 0
    written = (tmp_path / "cases" / "0000" / "diagnosis.json").stat().st_mtime_ns
    assert battery.prove(tmp_path, **options)["proportions"] == board["proportions"]
    assert (tmp_path / "cases" / "0000" / "diagnosis.json").stat().st_mtime_ns == written

"""The independent truth against closed forms and against the simulator under test."""

import json
import sys

import numpy as np
import pytest

from origami_sim import prove

pytest.importorskip("mujoco", reason="the truth of the proof needs MuJoCo: pip install 'origami-sim[proof]'")


@pytest.fixture
def truth(monkeypatch):
    """The modules of the truth generator, which are scripts beside each other."""
    monkeypatch.syspath_prepend(str(prove.generator().parent))
    import draw
    import laws
    import objects
    import recorder
    import world

    yield {"draw": draw, "laws": laws, "objects": objects, "recorder": recorder, "world": world}
    for name in ("draw", "laws", "objects", "recorder", "world"):
        sys.modules.pop(name, None)


def flap(truth, **crease) -> dict:
    """One panel on a hinge, without weight."""
    o = truth["objects"].draw("hanging_strip", np.random.default_rng(0))
    vertices, faces = truth["objects"].strip([0.03, 0.03], 0.03)
    o |= {"vertices": vertices, "faces": faces, "gravity": 0.0}
    o["creases"] = [{"name": "fold1", "panels": [0, 1], "stiffness": 2e-4, "viscosity": 0.0, **crease}]
    return o


def inertia(o: dict) -> float:
    return o["density"] * o["thickness"] * 0.03**2 * 0.03**2 / 3


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


@pytest.mark.parametrize("structure", ["hanging_strip", "pendulum_chain", "magnetic_strip", "box"])
def test_both_simulators_agree_without_an_effect(truth, tmp_path, structure):
    """Rigid bodies in MuJoCo and panels of bars move alike, within the half step by which MuJoCo's velocities lag."""
    from origami_sim.diagnose.articulation import Articulation
    from origami_sim.drive import Drive, sine
    from origami_sim.model import State
    from origami_sim.solve.dynamics import simulate

    o = truth["objects"].draw(structure, np.random.default_rng(3))
    (tmp_path / "object.json").write_text(json.dumps(o))
    world, r = truth["world"].World(o), o["recordings"][0]
    start = np.array(r["release"]) + (world.settled() if "field" in r else 0.0)
    expected = world.run(r, start, duration=0.3)
    model, parameters, drive = prove.subject(tmp_path).build({})
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


def test_strength_gives_the_wanted_detectability(truth):
    draw, laws = truth["draw"], truth["laws"]
    o = truth["objects"].draw("pendulum_chain", np.random.default_rng(1)) | {"duration": 1.0}
    case = draw.Case(o, {})
    strength, d = draw.strength_for(case, "dry_friction", laws.INSIDE["dry_friction"], 0, {}, 10.0, 1.0)
    assert strength > 0 and d == pytest.approx(10.0, rel=0.11)
    assert case.detectability() == pytest.approx(0.0, abs=1e-6)


@pytest.mark.slow
def test_a_case_is_the_same_for_the_same_seed_and_tells_nothing(truth, tmp_path):
    kept = []
    for n in range(2):
        folder, answer = tmp_path / f"case{n}", tmp_path / f"answers{n}" / "0.json"
        made = truth["draw"].make(5, 2, folder, answer, structures=["pendulum_chain"], kinds=["single"])
        assert json.loads(answer.read_text())["mechanism"] == made["mechanism"] != ""
        kept.append({p.name: p.read_bytes() for p in folder.iterdir()})
    assert kept[0] == kept[1]
    assert not any(
        word in b"".join(kept[0].values()) for word in (made["mechanism"].encode(), b"nuisance", b"strength")
    )


@pytest.mark.slow
def test_a_proof_end_to_end_and_resumed(tmp_path):
    told = []
    options = {"cases": 1, "seed": 4, "structures": ["pendulum_chain"], "kinds": ["single"], "say": told.append}
    board = prove.prove(tmp_path, **options)
    assert board["cases"] == 1 and board["failed"] == 0
    written = (tmp_path / "cases" / "0000" / "diagnosis.json").stat().st_mtime_ns
    assert prove.prove(tmp_path, **options)["proportions"] == board["proportions"]
    assert (tmp_path / "cases" / "0000" / "diagnosis.json").stat().st_mtime_ns == written

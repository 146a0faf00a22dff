"""Magnets in each other's field, against closed forms and finely divided magnets."""

import numpy as np
import pytest
from effects.kit import make_model, quiet, random_rotation, slope, start

from origami_sim.design.build import Sheet
from origami_sim.device.scene import read_calibration, scene_module
from origami_sim.diagnose import diagnose
from origami_sim.drive import Drive, series
from origami_sim.errors import InputError
from origami_sim.hypotheses.suspects import suspects
from origami_sim.model import magnets
from origami_sim.pattern import strip
from origami_sim.physics.materials import MU0
from origami_sim.recording import Channel, Recording
from origami_sim.recording.recording import DriveChannel
from origami_sim.solve.batch import forces
from origami_sim.solve.motion.dynamics import simulate
from origami_sim.solve.statics.equilibria import tangent

NAME = "dipole_interaction"
BR, VOLUME = 0.13, 7e-7
MOMENT = BR * VOLUME / MU0
SIDE = 0.02


def plates(cells, *placed, thickness=0.002, **values):
    """Square magnets poled along their first axis, each placed by (rotation, centre): model, parameters and moment."""
    corner = np.array([[i, j] for i in range(cells + 1) for j in range(cells + 1)]) / cells - 0.5
    one = SIDE * np.column_stack([corner, np.zeros(len(corner))])
    a = np.array([i * (cells + 1) + j for i in range(cells) for j in range(cells)])
    b, c, d = a + cells + 1, a + cells + 2, a + 1
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    model = make_model(
        np.concatenate([one @ r.T + at for r, at in placed]),
        triangles=np.concatenate([triangles + k * len(one) for k in range(len(placed))]),
        effects=("magnetic_torque", NAME),
    )
    first = np.tile(
        np.repeat([1.0, 0.0], cells**2), len(placed)
    )  # of a, b, c the first edge is along x, of a, c, d ...
    poling = {
        "poling_1": np.where(first, 1.0, 1.0),
        "poling_2": np.where(first, 0.0, -1.0),
    }  # ... the first less the second
    volume = SIDE**2 * thickness / (2 * cells**2)
    given = {"coupling": 1.0, "remanence": BR, "volume": volume, **poling, **values}
    return model, quiet(model, {(NAME, k): v for k, v in given.items()})


def wrench(model, parameters):
    """Force [N] and torque [N m] on the first plate about the origin."""
    f = forces(model, parameters, Drive(), start(model), 0.0).forces[NAME][:, 0]
    half = len(f) // 2
    return f[:half].sum(0), np.cross(model.position, f)[:half].sum(0)


def divided(placed, cells, thickness=0.002):
    """The same of plates that are cut into cells x cells dipoles, by the field of each on each."""
    grid = (np.arange(cells) + 0.5) / cells - 0.5
    one = SIDE * np.array([[u, v, 0.0] for u in grid for v in grid])
    (r1, c1), (r2, c2) = placed
    x, y = one @ r1.T + c1, one @ r2.T + c2
    m, n = (r[:, 0] * BR * SIDE**2 * thickness / MU0 / cells**2 for r in (r1, r2))
    away = x[:, None] - y[None]
    d = np.linalg.norm(away, axis=-1, keepdims=True)
    u = away / d
    field = 1e-7 * (3 * u * (u @ n)[..., None] - n) / d**3
    mu, nu = (u @ m)[..., None], (u @ n)[..., None]
    pull = 3e-7 / d**4 * (mu * n + nu * m + (m @ n) * u - 5 * mu * nu * u)
    return pull.sum((0, 1)), (np.cross(m, field) + np.cross(x[:, None], pull)).sum((0, 1))


FAR = (np.eye(3), np.zeros(3)), (np.eye(3), np.array([1.0, 0, 0]))


def test_two_magnets_in_line_attract_as_dipoles_do():
    model, parameters = plates(1, *FAR)
    moment = BR * SIDE**2 * 0.002 / MU0
    force, _ = wrench(model, parameters)
    assert force[0] == pytest.approx(6e-7 * moment**2, rel=SIDE**2)  # the next term is (size / distance)^2
    assert np.abs(force[1:]).max() < 3e-4 * force[0]  # the dipoles of two triangles are not the plate's middle
    half, _ = wrench(*plates(1, *FAR, coupling=0.5))
    assert half == pytest.approx(force / 2, rel=1e-12)


def test_finer_triangles_come_to_finely_divided_magnets():
    rng = np.random.default_rng(3)
    placed = (np.eye(3), np.zeros(3)), (random_rotation(rng), np.array([0.03, 0.01, 0.02]))
    force, torque = divided(placed, 48)
    cells = np.array([1, 2, 4, 8])
    errors = []
    for n in cells:
        f, t = wrench(*plates(n, *placed))
        errors.append(
            [np.linalg.norm(f - force) / np.linalg.norm(force), np.linalg.norm(t - torque) / np.linalg.norm(torque)]
        )
    errors = np.array(errors)
    assert errors[0].max() < 0.16  # two triangles a magnet
    assert slope(1 / cells, errors[:, 0]) == pytest.approx(2, abs=0.15), errors
    assert slope(1 / cells, errors[:, 1]) == pytest.approx(2, abs=0.15), errors


def test_action_equals_reaction_also_between_different_strengths():
    rng = np.random.default_rng(4)
    placed = (random_rotation(rng), np.zeros(3)), (random_rotation(rng), np.array([0.03, 0.01, 0.02]))
    coupling = rng.uniform(0.2, 1.0, 16)
    model, parameters = plates(2, *placed, coupling=coupling, offset=0.003)
    f = forces(model, parameters, Drive(), start(model), 0.0).forces[NAME][:, 0]
    assert np.abs(f.sum(0)).max() < 1e-13 * np.abs(f).max()
    assert np.abs(np.cross(model.position, f).sum(0)).max() < 1e-13 * np.abs(f).max()


def test_magnets_that_touch_and_are_poled_alike_are_one():
    alone, values = plates(2, (np.eye(3), np.zeros(3)))
    assert magnets(alone, values, NAME).tolist() == [0] * 8
    assert not forces(alone, values, Drive(), start(alone), 0.0).forces[NAME].any()
    half = np.array([1, 1, -1, -1, 1, 1, -1, -1.0])  # cells in rows, first the lower triangles and then the upper
    values.set(NAME, "remanence", BR * half)
    assert magnets(alone, values, NAME).tolist() == [0, 0, 1, 1, 0, 0, 1, 1]
    values.set(NAME, "volume", 0.0, [2, 3, 6, 7])
    assert magnets(alone, values, NAME).tolist() == [0, 0, -1, -1, 0, 0, -1, -1]


def test_magnets_that_join_in_one_world_only_are_refused():
    model, values = plates(1, (np.eye(3), np.zeros(3)))
    values.set(NAME, "remanence", np.array([[BR, BR], [BR, -BR]]))
    with pytest.raises(InputError, match="join in other ways"):
        forces(model, values, Drive(), start(model, 2), 0.0)
    values.set(NAME, "remanence", np.array([[BR, -BR], [BR, -BR]]))  # alike in both
    assert not forces(model, values, Drive(), start(model, 2), 0.0).forces[NAME].any()


def test_worlds_may_lack_magnets():
    """As those of a batch in which some worlds try the effect and others do not."""
    model, values = plates(1, *FAR)
    alone = forces(model, values, Drive(), start(model), 0.0).forces[NAME][:, 0]
    values.set(NAME, "remanence", np.array([[0.0, BR, 0.0], [0.0, BR, 0.0], [0.0, BR, BR], [0.0, BR, BR]]))
    assert magnets(model, values, NAME).tolist() == [0, 0, 1, 1]
    found = forces(model, values, Drive(), start(model, 3), 0.0).forces[NAME]
    assert np.array_equal(found[:, 1], alone) and not found[:, [0, 2]].any()


def test_a_panel_without_a_magnet_feels_none_even_where_it_lies_on_one():
    placed = (np.eye(3), np.zeros(3)), (np.eye(3), np.array([0.05, 0, 0])), (np.eye(3), np.zeros(3))
    model, values = plates(1, *placed)
    values.set(NAME, "volume", 0.0, [4, 5])
    found = forces(model, values, Drive(), start(model), 0.0)
    assert np.isfinite(found.energies[NAME]).all() and not found.forces[NAME][8:].any()
    assert found.forces[NAME][:8].any()


def test_a_flap_on_a_held_magnet_is_suspected_of_both():
    """Also where one panel only can move."""
    sheet = Sheet(strip([0.02, 0.02], 0.02), thickness=1e-3)
    sheet.crease(stiffness=1e-3).fix(panels=[0])
    for panel, poling in ((0, (1, 0, 0)), (1, (-1, 0, 0))):
        sheet.magnetise(panel, remanence=BR, volume=VOLUME, poling=poling)
    model, parameters = sheet.build()
    fold = Channel("fold", "crease_angle", np.zeros(9), "rad", 1e-3, {"crease": 0})
    found = suspects(model, [Recording("r", np.arange(9.0), {"fold": fold})], Drive(), parameters)
    assert [(x.site, x.entities) for x in found if x.effect == NAME] == [("all panels", None)]


def test_the_tangent_knows_that_magnets_feel_each_other():
    placed = (np.eye(3), np.zeros(3)), (np.eye(3), np.array([0.03, 0, 0.01]))
    model, parameters = plates(1, *placed)
    k = tangent(model, parameters).toarray()
    n, h = model.position.size, 1e-6
    steps = h * np.concatenate([np.eye(n), -np.eye(n)])
    x = np.moveaxis((model.position.ravel() + steps).reshape(2 * n, -1, 3), 0, 1)
    f = forces(model, parameters, Drive(), start(model, 2 * n, x=x), 0.0).forces[NAME]
    f = np.moveaxis(f, 1, 0).reshape(2 * n, n)
    assert k == pytest.approx(-((f[:n] - f[n:]) / (2 * h)).T, abs=1e-6 * np.abs(k).max())
    assert np.abs(k[: n // 2, n // 2 :]).max() > 0.01 * np.abs(k).max()


def test_a_flap_of_the_box_sags_without_a_field(tmp_path):
    """By 0.56 deg in an independent solution; here 0.66 by four dipoles a patch, above the sheet as the patch is."""
    file = tmp_path / "box.toml"
    file.write_text(read_calibration("box").file.read_text() + "\n[[effects.dipole_interaction]]\ncoupling = 1.0\n")
    box = scene_module("box")
    without, with_it = (np.degrees(box.flap_angles(read_calibration(c), np.zeros(1))[0]) for c in ("box", str(file)))
    assert (with_it - without).mean() == pytest.approx(-0.56, abs=0.1)
    assert np.ptp(with_it) < 1e-6


@pytest.mark.slow
def test_magnets_in_each_others_field_are_found_where_they_were_left_out(tmp_path):
    """A box in 20 and 80 mT, of which the model knows the field of the coil only."""
    file = tmp_path / "box.toml"
    file.write_text(read_calibration("box").file.read_text() + "\n[[effects.dipole_interaction]]\ncoupling = 1.0\n")
    box, times, rng = scene_module("box"), np.arange(0, 2, 1 / 120), np.random.default_rng(1)
    model, parameters, _ = box.build(read_calibration(str(file)))
    recordings = []
    for name, level in (("weak", 0.02), ("strong", 0.08)):
        field = level * np.sin(2 * np.pi * times)[:, None] * [0.0, 0.0, 1.0]
        made = simulate(
            model, parameters, Drive(field=(0, 0, series(times, field[:, 2]))), duration=times[-1], rate=120
        )
        read = made.creases[:, :, 0] + 2e-3 * rng.normal(size=(len(times), 4))
        channels = {
            f"fold{c}": Channel(f"fold{c}", "crease_angle", read[:, c], "rad", 2e-3, {"crease": c}) for c in range(4)
        }
        recordings.append(Recording(name, times, channels, {"field": DriveChannel("field", field, "T", False)}))
    others = ("crease_offset", "gravity_tilt", "remanence_error", "eccentric_weight", "crease_friction")
    found = diagnose(box, recordings, catalogue=(NAME, *others))
    assert found.verdict == "MECHANISM" and found.chosen == ["dipole_interaction at all panels"]
    coupling = found.candidates[0].numbers[-1]
    assert coupling.value == pytest.approx(1.0, abs=0.015)


@pytest.mark.parametrize(
    "name, several", [("crawler", True), ("folding_strip", True), ("mae_cantilever", False), ("pendulum_chain", False)]
)
def test_only_a_device_with_several_magnets_is_suspected(name, several):
    scene = scene_module(name)
    model, parameters, drive = scene.build(read_calibration(scene.CALIBRATION))[:3]
    tip = Channel("tip", "marker", np.zeros((9, 3)), "m", 1e-4, {"panel": 0})
    found = suspects(model, [Recording("r", np.arange(9.0), {"tip": tip})], drive, parameters)
    assert [(x.site, x.entities) for x in found if x.effect == NAME] == several * [("all panels", None)]

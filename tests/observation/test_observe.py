"""The observer: channels of a simulated run, against the positions that they come from."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from origami_sim import Sheet, miura, simulate, strip
from origami_sim.device.scene import read_calibration
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters, node_mass
from origami_sim.observation.attachments import body_point
from origami_sim.observation.channels import read
from origami_sim.observation.observe import channel_frames, check_scene, follow, observe, observe_equilibria
from origami_sim.physics.materials import G
from origami_sim.recording import Camera, Channel, Recording, read_recording
from origami_sim.scenes import pendulum_chain
from origami_sim.solve.rigid.reactions import held_nodes


@pytest.fixture(scope="module")
def motion():
    s = read_calibration(pendulum_chain.CALIBRATION).with_panels("elastic").replace(duration=0.5)
    return pendulum_chain.swing(s, rate=200.0)


def channel(kind, values, unit="rad", **attachment) -> Channel:
    return Channel(name="c", kind=kind, values=np.asarray(values, float), unit=unit, noise=1e-4, attachment=attachment)


def recording(times, *channels) -> Recording:
    return Recording(name="test", times=np.asarray(times, float), channels={c.name: c for c in channels})


def test_panel_angles_follow_the_direction_of_the_panel(motion):
    """Upright is 0, towards +x positive: hanging at the calibration's angle."""
    angle = channel_frames(motion, channel("panel_angle", [0.0], panel="arm1"))
    start = read_calibration("pendulum_chain").angle_1
    assert np.cos(angle[0]) == pytest.approx(np.cos(start), abs=1e-9)
    assert np.sin(angle[0]) == pytest.approx(np.sin(start), abs=1e-9)
    assert np.abs(np.diff(angle)).max() < 0.5  # continuous
    by_number = channel_frames(motion, channel("panel_angle", [0.0], panel=1))
    np.testing.assert_array_equal(angle, by_number)


def test_crease_angle_is_that_of_the_run(motion):
    found = channel_frames(motion, channel("crease_angle", [0.0], crease=1))
    np.testing.assert_array_equal(found, motion.creases[:, 1, 0])


def test_marker_and_tip(motion):
    marker = channel_frames(motion, channel("marker", np.zeros((2, 3)), unit="m", node=4))
    np.testing.assert_array_equal(marker, motion.x[:, 4, 0])
    tip = channel_frames(motion, channel("tip_displacement", [0.0, 0.0], unit="m", node=4))
    np.testing.assert_allclose(tip, np.linalg.norm(marker - marker[0], axis=1), atol=1e-15)


def test_angles_start_in_the_turn_of_the_recording(motion):
    angle = channel_frames(motion, channel("panel_angle", [0.0], panel="arm1"))
    seen = channel("panel_angle", np.full(3, angle[0] + 6 * np.pi + 0.1), panel="arm1")
    found = observe(motion, recording([7.0, 7.1, 7.2], seen))["c"]
    assert found[0] == pytest.approx(angle[0] + 6 * np.pi, abs=1e-9)


def test_frames_between_those_of_the_run_are_interpolated(motion):
    times = np.linspace(0, 0.4, 57)
    seen = channel("panel_angle", np.full(57, 2.6), panel="arm1")
    found = observe(motion, recording(times, seen))["c"]
    angle = channel_frames(motion, seen)
    np.testing.assert_allclose(found, np.interp(times, motion.times, angle), atol=1e-3)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            channel("panel_angle", [0.0, 0.0], panel="arm7"),
            r"nothing of that name.*channels\.c\.panel.*arm7.*arm1, arm2",
        ),
        (channel("panel_angle", [0.0, 0.0], panel=9), r"nothing of that name.*9"),
        (channel("crease_angle", [0.0, 0.0], crease=5), r"nothing of that name.*crease.*5.*hinge1, hinge2"),
        (channel("marker", np.zeros((2, 3)), unit="m", node=999), r"nothing of that name.*node.*999"),
        (channel("marker", np.zeros((2, 3)), unit="m"), r"a marker needs a node.*channels\.c\.node"),
    ],
)
def test_channels_that_the_model_lacks(motion, given, words):
    with pytest.raises(InputError, match=words):
        observe(motion, recording([0.0, 0.1], given))


def test_stamps_that_are_rounded_may_end_after_the_run(motion):
    end = float(motion.times[-1])
    given = channel("crease_angle", [0.0, 0.0], crease=0)
    late, exact = (observe(motion, recording([0.0, t], given))["c"] for t in (end + 1e-7, end))
    np.testing.assert_allclose(late, exact, rtol=0, atol=1e-6)


def test_a_run_shorter_than_the_recording(motion):
    with pytest.raises(InputError, match=r"run is shorter than the recording.*0\.5.*2 s"):
        observe(motion, recording([0.0, 2.0], channel("crease_angle", [0.0, 0.0], crease=0)))


def turned(angle: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points of arm 1 [F, 3] that lie at `points` [3] while it hangs, when its absolute angle is `angle` [F]."""
    pivot = np.array([0.0, 0.0, -pendulum_chain.MOUNT])
    phi = angle - np.pi
    x, y, z = points - pivot
    return pivot + np.stack(
        [x * np.cos(phi) + z * np.sin(phi), np.full(len(phi), y), z * np.cos(phi) - x * np.sin(phi)], 1
    )


def arm_centroid(motion) -> np.ndarray:
    model = motion.model
    corners = model.position[model.triangles[model.triangle_panel == 1]]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return np.average(corners.mean(axis=1), axis=0, weights=areas)


@pytest.mark.parametrize("point", [(0.0, 0.0, 0.0), (0.004, 0.003, -0.02), (-0.01, 0.0, 0.3)])
def test_a_marker_on_a_panel_moves_rigidly_with_it(motion, point):
    """Inside the panel, off its surface and outside of it, against the closed form of a turning arm."""
    angle = channel_frames(motion, channel("panel_angle", [0.0], panel="arm1"))
    given = channel("marker", np.zeros((2, 3)), unit="m", panel="arm1", point=list(point))
    expected = turned(angle, arm_centroid(motion) + point)
    np.testing.assert_allclose(channel_frames(motion, given), expected, atol=2e-5 * max(1.0, abs(point[2]) / 0.02))


def test_a_marker_above_the_surface(motion):
    """The height lies along the normal, of the panel or around a node, and turns with it."""
    angle = channel_frames(motion, channel("panel_angle", [0.0], panel="arm1"))
    on = channel_frames(motion, channel("marker", np.zeros((2, 3)), unit="m", panel="arm1"))
    above = channel_frames(motion, channel("marker", np.zeros((2, 3)), unit="m", panel="arm1", height=0.01))
    np.testing.assert_allclose(np.linalg.norm(above - on, axis=1), 0.01, rtol=1e-9)
    along = np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], 1)
    np.testing.assert_allclose(np.einsum("fc,fc->f", above - on, along), 0.0, atol=1e-5)
    node = int(np.argmin(motion.model.position[:, 2]))
    flat = channel_frames(motion, channel("marker", np.zeros((2, 3)), unit="m", node=node))
    lifted = channel_frames(motion, channel("marker", np.zeros((2, 3)), unit="m", node=node, height=0.01))
    np.testing.assert_allclose(np.linalg.norm(lifted - flat, axis=1), 0.01, rtol=1e-9)


@pytest.mark.filterwarnings("error")
def test_a_marker_of_a_world_that_failed_is_no_number(motion):
    """Such a world may leave all nodes in one place, where no panel has a normal; nothing is printed of it."""
    marker = channel("marker", motion.x[:, 4, 0], unit="m", panel="arm1", height=0.001)
    assert np.isnan(body_point(motion.model, np.zeros_like(motion.x[:, :, 0]), marker)).all()


def test_a_marker_in_a_picture(motion):
    """A camera that is tilted by 30 degrees about y, against rotating by hand."""
    tilt = np.deg2rad(30.0)
    camera = Camera.turned(np.array([0.1, 0.2, 0.3]), np.array([0.0, tilt, 0.0]))
    given = replace(channel("marker_2d", np.zeros((2, 2)), unit="m", node=4), camera=camera)
    x, _, z = (motion.x[:, 4, 0] - [0.1, 0.2, 0.3]).T
    right, up = x * np.cos(tilt) - z * np.sin(tilt), x * np.sin(tilt) + z * np.cos(tilt)
    np.testing.assert_allclose(channel_frames(motion, given), np.stack([right, up], 1), atol=1e-14)
    pixels = np.array([[100.0, 400.0], [110.0, 380.0]])
    seen = Camera(np.zeros(3), np.eye(3)[[0, 2]], scale=1e-3, zero=(100.0, 400.0), flip=True)
    np.testing.assert_allclose(seen.metres(pixels), [[0.0, 0.0], [0.01, 0.02]])
    with pytest.raises(InputError, match="a marker in a picture needs a camera"):
        channel_frames(motion, channel("marker_2d", np.zeros((2, 2)), unit="m", node=4))


def test_displacements_as_vector_part_and_length(motion):
    moved = motion.x[:, 4, 0] - motion.x[0, 4, 0]
    vector = channel_frames(motion, channel("tip_displacement", np.zeros((2, 3)), unit="m", node=4))
    np.testing.assert_array_equal(vector, moved)
    part = channel("tip_displacement", np.zeros(2), unit="m", node=4, direction=[0.0, 0.0, -1.0])
    np.testing.assert_allclose(channel_frames(motion, part), -moved[:, 2], atol=1e-16)
    with pytest.raises(InputError, match="of 2 columns cannot be observed without a direction"):
        channel_frames(motion, channel("tip_displacement", np.zeros((2, 2)), unit="m", node=4))


@pytest.mark.parametrize("on", [{"node": 4}, {"panel": 1, "point": [0.0, 0.003, 0.02]}, {"panel": 1, "height": 0.004}])
@pytest.mark.parametrize("values", [np.zeros(2), np.zeros((2, 3))])
def test_a_diagnosis_reads_displacements_as_a_run_is_read(motion, on, values):
    given = channel("tip_displacement", values, unit="m", **on)
    x = motion.x[:, :, :1]
    found = read(motion.model, given, x, None, begin=x[0])[:, :, 0]
    wanted = channel_frames(motion, given).reshape(len(x), -1)
    assert np.abs(wanted).max() > 1e-3
    np.testing.assert_allclose(found, wanted, atol=1e-14)


def test_the_support_of_a_swinging_chain_carries_weight_and_momentum(motion):
    """Newton: the impulse of support and weight is the change of momentum, which the run has in its velocities."""
    model, mass = motion.model, motion.parameters["inertia", "mass"][:, 0]
    held = np.flatnonzero((model.free == 0).all(axis=1)).tolist()
    s = read_calibration(pendulum_chain.CALIBRATION).replace(duration=0.1).with_panels("elastic")
    fine = pendulum_chain.swing(s, rate=20_000.0)
    given = channel("force", np.zeros((2, 3)), unit="N", nodes=held)
    force = channel_frames(fine, given)
    weight = mass.sum() * np.array([0.0, 0.0, -s.gravity])
    momentum = np.einsum("n,fnc->fc", mass, fine.v[:, :, 0])
    impulse = CubicSpline(fine.times, force + weight).integrate(fine.times[0], fine.times[-1])
    change = momentum[-1] - momentum[0]
    np.testing.assert_allclose(impulse, change, atol=0.01 * np.abs(change).max())
    down = channel("force", np.zeros(2), unit="N", nodes=held, direction=[0.0, 0.0, 1.0])
    np.testing.assert_array_equal(channel_frames(fine, down), force[:, 2])
    with pytest.raises(InputError, match="no axis of these nodes is held"):
        channel_frames(motion, channel("force", np.zeros((2, 3)), unit="N", node=int(model.position[:, 2].argmin())))
    with pytest.raises(InputError, match="no contact with the ground"):
        channel_frames(motion, channel("force", np.zeros((2, 3)), unit="N", ground=True))


def shallow_truss(rise: float = 0.3, stiffness: float = 100.0):
    """Two bars from supports to an apex that moves vertically, with a unit load downwards."""
    free = np.zeros((3, 3))
    free[2, 2] = 1.0
    none = np.zeros((0, 3), int)
    model = Model(
        position=np.array([(-1.0, 0, 0), (1.0, 0, 0), (0, 0, rise)]),
        free=free,
        bars=np.array([(0, 2), (1, 2)]),
        creases=np.zeros((0, 4), int),
        bends=np.zeros((0, 4), int),
        triangles=none,
        triangle_panel=np.zeros(0, int),
        contacts=none,
        contact_weights=np.zeros((0, 3)),
        contact_offsets=np.zeros(0),
        contact_axes=np.zeros((0, 3)),
        electrodes=np.zeros(0, int),
        effects=("bars", "load"),
    )
    length = np.hypot(1.0, rise)
    parameters = Parameters(model, {("bars", "stiffness"): stiffness, ("bars", "rest_length"): np.full(2, length)})
    return model, parameters.set("load", "force_z", -1.0, entities=2)


def test_a_quasi_static_curve_is_observed_step_by_step(tmp_path):
    """Von Mises truss below its limit load: deflection and support forces against the closed form."""
    rise, stiffness = 0.3, 100.0
    model, parameters = shallow_truss(rise, stiffness)
    rest = np.hypot(1.0, rise)
    sink = np.array([0.0, 0.005, 0.02, 0.04, 0.06, 0.03, 0.01])  # up and down again
    z = rise - sink
    load = 2 * stiffness * (rest / np.hypot(1.0, z) - 1) * z
    rows = "".join(f"{p!r},{w * 1e3!r}\n" for p, w in zip(load.tolist(), sink.tolist(), strict=True))
    (tmp_path / "press.csv").write_text("load,sink\n" + rows)
    (tmp_path / "press.toml").write_text(
        '[channels.sink]\ncolumn = "sink"\nkind = "tip_displacement"\nunit = "mm"\nnoise = 0.01\nnode = 2\n'
        'direction = [0.0, 0.0, -1.0]\n[drive.load]\ncolumn = "load"\nunit = "1"\n'
    )
    recording = read_recording(tmp_path / "press.csv")
    assert recording.by_step
    support = channel("force", np.zeros((7, 3)), unit="N", nodes=[0, 1])
    both = replace(recording, channels={**recording.channels, "support": replace(support, name="support")})
    found = observe_equilibria(model, parameters, follow(model, parameters, both), both)
    np.testing.assert_allclose(found["sink"], recording.channels["sink"].values, atol=1e-9)
    np.testing.assert_allclose(found["support"][:, 2], load, atol=1e-8)
    np.testing.assert_allclose(found["support"][:, :2], 0.0, atol=1e-9)
    one = replace(both, channels={"left": replace(support, name="left", attachment={"node": 0})})
    left = observe_equilibria(model, parameters, follow(model, parameters, one), one)["left"]
    np.testing.assert_allclose(left, np.stack([load / 2 / z, 0 * load, load / 2], 1), atol=1e-8)
    with pytest.raises(InputError, match=r"one equilibrium per load step .*value 3\); allowed: 7"):
        observe_equilibria(model, parameters, follow(model, parameters, recording)[:3], recording)


def test_a_curve_of_steps_is_not_observed_in_a_run(motion):
    given = replace(
        recording([0.0, 1.0], channel("crease_angle", [0.0, 0.0], crease=0)), metadata={"time_base": "step"}
    )
    with pytest.raises(InputError, match="observed along equilibria, not in a run"):
        observe(motion, given)


def test_a_recording_is_held_against_the_model(motion):
    """Attachments must exist; sizes that do not match are told."""
    model = motion.model
    marker = motion.x[:, 4, 0]
    assert check_scene(recording(motion.times, channel("marker", marker, unit="m", node=4)), model) == []
    large = check_scene(recording(motion.times, channel("marker", 1000 * marker, unit="m", node=4)), model)
    assert len(large) == 1 and "times the size of the model: millimetres or pixels read as metres?" in large[0]
    small = check_scene(recording(motion.times, channel("marker", 1e-6 * marker, unit="m", node=4)), model)
    assert len(small) == 1 and "metres read as millimetres?" in small[0]
    far = channel("marker", marker, unit="m", panel="arm1", point=[9.0, 0.0, 0.0])
    with pytest.raises(InputError, match=r"the point is 9 m off.*channels\.c\.point.*9\.0.*millimetres read as metres"):
        check_scene(recording(motion.times, far), model)
    near = channel("marker", marker, unit="m", panel="arm1", point=[0.0, 0.0, 0.3])
    assert check_scene(recording(motion.times, near), model) == []  # on a stick
    for fold in (np.linspace(80.0, 82.0, len(marker)), np.linspace(-3.5, 3.5, len(marker))):
        with pytest.raises(InputError, match=r"more than a crease can .*channels\.c\.unit.*degrees read as radians"):
            check_scene(recording(motion.times, channel("crease_angle", fold, crease=0)), model)
        check_scene(recording(motion.times, channel("panel_angle", fold, panel=1)), model)  # an arm may go round
    with pytest.raises(InputError, match=r"nothing of that name.*crease.*5.*hinge1, hinge2"):
        check_scene(recording(motion.times, channel("crease_angle", np.zeros(len(marker)), crease=5)), model)
    moments = channel("moment", np.zeros(len(marker)), unit="N m", crease=0)
    assert check_scene(recording(motion.times, moments), model) == []  # of a test with prescribed angles
    with pytest.raises(InputError, match=r"a moment needs a crease .*channels\.c\.crease"):
        check_scene(recording(motion.times, replace(moments, attachment={})), model)
    same = replace(model, names={"panel": ("mount", "arm", "arm")})
    with pytest.raises(InputError, match=r"several have that name.*channels\.c\.panel.*arm.*mount"):
        check_scene(recording(motion.times, channel("marker", marker, unit="m", panel="arm")), same)
    with pytest.raises(InputError, match=r"nothing of that name.*channels\.c\.panel.*lid"):
        check_scene(recording(motion.times, channel("marker", marker, unit="m", panel="lid")), model)


@pytest.mark.parametrize("camera", [None, Camera(np.zeros(3), np.eye(3)[[0, 2]])])
def test_a_marker_offset_is_a_marker_at_another_point_of_its_panel(motion, camera):
    """In the model's axes at the reference state, as `point`, and the height along the panel's normal."""
    model, parameters = motion.model.with_effects("marker_offset"), None
    panel = model.names["panel"].index("arm2")
    nodes = model.triangles[model.triangle_panel == panel]
    corners = model.position[nodes[0]]
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= np.linalg.norm(normal)
    inside = 2e-3 * (corners[1] - corners[0]) / np.linalg.norm(corners[1] - corners[0])
    offset = inside + 3e-3 * normal
    parameters = motion.parameters.for_model(model)
    for axis, value in zip("xyz", offset, strict=True):
        parameters.set("marker_offset", f"offset_{axis}", value)
    kind, width = ("marker", 3) if camera is None else ("marker_2d", 2)
    times = motion.times[:40]
    plain = replace(channel(kind, np.zeros((40, width)), unit="m", panel="arm2", point=[0, 0, 0]), camera=camera)
    moved = replace(plain, attachment={"panel": "arm2", "point": inside.tolist(), "height": 3e-3})
    found = observe(replace(motion, model=model, parameters=parameters), recording(times, plain))["c"]
    expected = observe(motion, recording(times, moved))["c"]
    np.testing.assert_allclose(found, expected, atol=2e-7)  # panels bend by that much
    assert np.abs(found - observe(motion, recording(times, plain))["c"]).max() > 2e-3


def test_each_channel_has_errors_of_its_own(motion):
    model = replace(motion.model.with_effects("angle_offset"), channels=2)
    parameters = motion.parameters.for_model(model).set("angle_offset", "angle_offset", np.array([0.03, -0.02]))
    seen = [replace(channel("crease_angle", np.zeros(40), crease=c), name=f"c{c}") for c in (0, 1)]
    found = observe(replace(motion, model=model, parameters=parameters), recording(motion.times[:40], *seen))
    for c, zero in ((0, 0.03), (1, -0.02)):
        np.testing.assert_allclose(found[f"c{c}"], motion.creases[:40, c, 0] + zero, atol=1e-12)
    with pytest.raises(InputError, match="another model"):
        parameters.for_model(replace(model, channels=3))


@pytest.mark.parametrize("length", [0.172719, 0.2])
def test_a_marker_measured_from_a_hinge_does_not_move_when_the_length_is_refitted(length):
    """45 mm below the hinge and 3 mm to the right of its middle, seen with the panel's upper side up."""
    s = read_calibration(pendulum_chain.CALIBRATION).replace(length_1=length)
    model = pendulum_chain.build(s)[0]
    given = channel("marker", np.zeros((2, 3)), unit="m", panel="arm1", **{"from": "hinge1", "distance": 0.045})
    found = body_point(model, model.position[None], given)[0]
    np.testing.assert_allclose(found, [0.0, 0.0, -pendulum_chain.MOUNT - 0.045], atol=1e-12)
    corners = model.position[model.triangles[model.triangle_panel == 1][0]]
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= np.linalg.norm(normal)
    given.attachment["along"] = 0.003
    moved = body_point(model, model.position[None], given)[0] - found
    np.testing.assert_allclose(moved, 0.003 * np.cross([0.0, 0.0, -1.0], normal), atol=1e-12)
    below = channel("marker", np.zeros((2, 3)), unit="m", panel="arm1", **{"from": "hinge2", "distance": 0.01})
    found = body_point(model, model.position[None], below)[0]
    np.testing.assert_allclose(found, [0.0, 0.0, -pendulum_chain.MOUNT - length + 0.01], atol=1e-12)
    wrong = channel("marker", np.zeros((2, 3)), unit="m", panel="arm2", **{"from": "hinge1", "distance": 0.01})
    with pytest.raises(InputError, match=r"does not have this crease.*channels\.c\.from.*hinge1"):
        body_point(model, model.position[None], wrong)
    far = replace(given, attachment=given.attachment | {"distance": 45.0})
    with pytest.raises(InputError, match=r"off the middle of a panel.*channels\.c\.distance.*45"):
        check_scene(recording([0.0, 0.1], far), model)


# --- supports of rigid panels


def test_the_supports_of_rigid_panels_carry_weight_and_momentum():
    """A swinging double chain: force of all supports against the derivative of the momentum that the run has."""
    s = read_calibration(pendulum_chain.CALIBRATION).replace(duration=0.3).with_panels("rigid")
    fine = pendulum_chain.swing(s, rate=2000.0)
    model, mass = fine.model, node_mass(fine.model, fine.parameters)[:, 0]
    held = held_nodes(model).tolist()
    force = channel_frames(fine, channel("force", np.zeros((2, 3)), unit="N", nodes=held))
    weight = mass.sum() * np.array([0.0, 0.0, -s.gravity])
    momentum = CubicSpline(fine.times, np.einsum("n,fnc->fc", mass, fine.v[:, :, 0]))
    inner = slice(20, -20)  # where the spline's ends are far
    expected = momentum(fine.times, 1)[inner] - weight
    np.testing.assert_allclose(force[inner], expected, atol=1e-5 * np.abs(expected).max())
    with pytest.raises(InputError, match="share their force is not determined"):
        channel_frames(fine, channel("force", np.zeros((2, 3)), unit="N", nodes=held[:1]))


def test_the_support_of_a_falling_plate_follows_the_closed_form():
    """A rod let go horizontally, when it has fallen by a: 5/2 W sin a along it, 1/4 W cos a across it."""
    density, thickness = 1000.0, 1e-5
    sheet = Sheet(strip([0.02, 0.05], 0.02), thickness=thickness, density=density, panels="rigid").fix(panels=[0])
    model, parameters = sheet.crease(stiffness=0.0).gravity().build()
    run = simulate(model, parameters, duration=0.08, rate=500.0)
    a = np.abs(run.creases[:, 0, 0])
    given = channel("force", np.zeros((2, 3)), unit="N", nodes=held_nodes(model).tolist())
    held, falls = (density * thickness * 0.02 * length * G for length in (0.02, 0.05))
    expected = held + falls * (2.5 * np.sin(a) ** 2 + 0.25 * np.cos(a) ** 2)
    assert a[-1] > 0.8
    np.testing.assert_allclose(channel_frames(run, given)[:, 2], expected, rtol=1e-7)


def test_the_supports_of_a_loop_of_rigid_panels():
    """Panels around one vertex, thrown: the momentum changes by what supports and weight give."""
    sheet = Sheet(miura(1, 1, 0.02, 0.02, np.pi / 3, fold_angle=np.pi / 4), thickness=1e-3, panels="rigid")
    model, parameters = sheet.fix(panels=[0]).crease(stiffness=2e-3).gravity().build()
    parameters.set("crease", "rest_angle", 1.2, entities=0)
    run = simulate(model, parameters, duration=0.02, rate=20_000.0)
    given = channel("force", np.zeros((2, 3)), unit="N", nodes=held_nodes(model).tolist())
    mass = node_mass(model, parameters)[:, 0]
    momentum = CubicSpline(run.times, np.einsum("n,fnc->fc", mass, run.v[:, :, 0]))
    weight = mass.sum() * np.array([0.0, 0.0, -G])
    inner = slice(20, -20)
    expected = momentum(run.times, 1)[inner] - weight
    assert np.abs(expected + weight).max() > 0.3 * np.abs(weight).max()
    np.testing.assert_allclose(channel_frames(run, given)[inner], expected, atol=1e-4 * np.abs(expected).max())

"""Closed forms of what distorts drive and measurement: a sine delayed, a ramp lagging, rotations, worlds apart."""

import math

import numpy as np
import pytest
from effects.kit import hinge
from scipy.spatial.transform import Rotation

from origami_sim.drive import CHANNELS, Drive, ramp, series, sine
from origami_sim.effects import CATALOGUE, DISTORTIONS, get
from origami_sim.effects._signals import scaled
from origami_sim.model import Parameters
from origami_sim.model.distort import distorted
from origami_sim.recording.recording import CHANNEL_KINDS

DRIVES = [n for n, e in CATALOGUE.items() if e.family == "drive"]
MEASUREMENTS = [n for n, e in CATALOGUE.items() if e.family == "measurement"]
WAVE = 2 * math.pi * 3.0
DURATION = 1.0
TIMES = np.linspace(0.25, DURATION, 151)
"""Instants at which a device would feel the drive [s]."""


def through(name, drive, **values):
    """The drive behind one effect; values are numbers or one number per world."""
    effect = get(name)
    worlds = max(np.size(v) for v in values.values())
    given = {p.name: np.broadcast_to(values.get(p.name, p.default), (worlds,)) for p in effect.parameters}
    return effect.apply(drive, DURATION, **given)


def measured(name, motion, times=TIMES, **values):
    """What a channel reads of motion(t [n, W]) -> [n, d, W] behind one effect."""
    effect = get(name)
    worlds = max(np.size(v) for v in values.values())
    given = {p.name: np.broadcast_to(values.get(p.name, p.default), (worlds,)) for p in effect.parameters}
    return effect.apply(motion, np.repeat(times[:, None], worlds, 1), **given)


def at(drive, channel, times=TIMES):
    """A channel at these times [n, W]."""
    values = np.asarray(drive[channel](times[:, None]))
    return values.reshape(len(times), -1)


def everything():
    """A drive in which every channel moves, each in its own way."""
    field = (sine(0.02, 3.0), sine(0.03, 2.0, offset=0.01), ramp(0.1, 0.5))
    voltage = [sine(2000.0, 3.0), 0.0, ramp(4000.0, 0.5, start=100.0)]
    return Drive(field=field, voltage=voltage, temperature=ramp(30.0, 0.3), load=sine(1.0, 1.0))


# --- all of them ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", DRIVES)
def test_one_strength_distorts_each_world_of_a_drive_as_alone(name):
    effect, factors = get(name), np.array([1.0, 1.5])
    values = {p.name: p.default for p in effect.parameters} | {effect.fitted[0]: 0.1}
    both, *alone = (scaled(everything(), everything().signals, f) for f in (factors, factors[:1], factors[1:]))
    out = through(name, both, **values)
    for world, one in enumerate(through(name, a, **values) for a in alone):
        for channel in one.signals:
            found, expected = at(out, channel), at(one, channel)[:, 0]
            assert np.allclose(found[:, world % found.shape[1]], expected, rtol=1e-15, atol=0.0)


@pytest.mark.parametrize("name", [*DRIVES, *MEASUREMENTS])
def test_is_a_suspect_that_is_silent_by_default(name):
    effect = get(name)
    assert effect.fitted and effect.confused_with and effect.separated_by and effect.family in DISTORTIONS
    strength = effect.parameter(effect.fitted[0])
    assert strength.default == 0 and strength.typical
    typical = {p.name: p.default if p.typical is None else p.typical for p in effect.parameters}
    off = {**typical, **{n: 0.0 for n in effect.fitted}}
    if effect.family == "measurement":
        assert set(effect.channels) <= set(CHANNEL_KINDS)

        def motion(t):
            place = np.stack([np.sin(WAVE * t), t, 1 + t * t], axis=1)
            return np.concatenate([place, turned_about_y(t)], axis=1) if effect.on_body else place

        clean = motion(TIMES[:, None])[:, :3]
        assert np.array_equal(measured(name, motion, **off), clean)
        assert np.abs(measured(name, motion, **typical) - clean).max() > 1e-4
    else:
        clean = everything()
        quiet, loud = through(name, clean, **off), through(name, clean, **typical)
        for c in clean.signals:
            assert np.array_equal(at(quiet, c), at(clean, c))
        touched = {c.split("_")[0] for c in clean.signals if np.any(at(loud, c) != at(clean, c))}
        assert touched == set(effect.channels) or (name == "drive_delay" and len(touched) == 4)


def turned_about_y(t):
    """The nine components [n, 9, W] of axes that turn about y by the angle t."""
    nothing = 0 * t
    x, z = (np.cos(t), nothing, -np.sin(t)), (np.sin(t), nothing, np.cos(t))
    return np.stack([*x, nothing, nothing + 1, nothing, *z], axis=1)


@pytest.mark.parametrize("name", [*DRIVES, *MEASUREMENTS])
def test_worlds_are_independent(name):
    """Two worlds with other values, and a drive that itself differs, are what each of them is alone."""
    effect = get(name)
    values = [{p.name: f * (p.typical or p.default) for p in effect.parameters} for f in (0.5, 1.3)]
    both = {n: np.array([v[n] for v in values]) for n in values[0]}
    if effect.family == "measurement":

        def motion(t):
            place = np.stack([np.sin(WAVE * t), t, t][: 3 if effect.on_body else 2], axis=1)
            return np.concatenate([place, turned_about_y(t)], axis=1) if effect.on_body else place

        together = measured(name, motion, **both)
        assert together.shape == (len(TIMES), 3 if effect.on_body else 2, 2)
        for w in (0, 1):
            assert np.allclose(together[:, :, w], measured(name, motion, **values[w])[:, :, 0], rtol=0, atol=1e-13)
        return
    field, voltage = np.array([0.02, 0.05]), np.array([2000.0, 3000.0])
    options = {"temperature": ramp(30.0, 0.3), "load": ramp(1.0, 0.5)}
    together = through(name, Drive(field=(sine(field, 3.0), 0.01, 0), voltage=sine(voltage, 3.0), **options), **both)
    for w in (0, 1):
        one = Drive(field=(sine(field[w], 3.0), 0.01, 0), voltage=sine(voltage[w], 3.0), **options)
        alone = through(name, one, **values[w])
        for c in one.signals:
            found = at(together, c)
            assert np.allclose(found[:, min(w, found.shape[1] - 1)], at(alone, c)[:, 0], rtol=1e-12, atol=1e-15), c


@pytest.mark.parametrize("name", DRIVES)
def test_a_distorted_drive_lasts_as_long_as_the_run(name):
    model = hinge(effects=(name,))
    parameters = Parameters(model)
    for p in get(name).parameters:
        parameters.set(name, p.name, p.default if p.typical is None else p.typical)
    out = distorted(model, parameters, everything(), DURATION)
    out.require(DURATION)
    assert all(np.all(np.isfinite(at(out, c))) for c in out.signals)


# --- the drive --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "channel"), [("field_lag", "field_z"), ("voltage_lag", "voltage_0"), ("temperature_lag", "temperature")]
)
def test_lag_of_a_ramp_and_of_a_sine(name, channel):
    """Ramp: t - tau (1 - exp(-t / tau)), exact. Sine: amplitude 1 / sqrt(1 + w^2 tau^2), to the sampling's error."""
    tau = 0.08
    out = at(through(name, Drive().replace(**{channel: ramp(2.0, 2.0)}), lag=tau), channel)[:, 0]
    assert out == pytest.approx(TIMES - tau * (1 - np.exp(-TIMES / tau)), abs=1e-12)
    out = at(through(name, Drive().replace(**{channel: sine(1.0, 3.0)}), lag=tau), channel)[:, 0]
    wt = WAVE * tau
    steady = np.sin(WAVE * TIMES) - wt * np.cos(WAVE * TIMES) + wt * np.exp(-TIMES / tau)
    assert np.abs(out - steady / (1 + wt**2)).max() < (WAVE / 2000) ** 2 / 8


def test_delay_of_a_sine_holds_its_first_value():
    delay = 0.05
    drive = Drive(field=(sine(1.0, 3.0, offset=0.5), 0, 0), voltage=sine(100.0, 1.0, phase=0.3))
    out = through("drive_delay", drive, delay=delay)
    assert np.abs(at(out, "field_x") - at(drive, "field_x", TIMES - delay)).max() < (WAVE / 2000) ** 2 / 4
    early = np.array([0.0, 0.02, 0.05])
    assert at(out, "voltage_0", early)[:, 0] == pytest.approx(100 * math.sin(0.3), rel=1e-12)


def test_gains_and_offsets_leave_a_wave_a_wave():
    """Nothing is sampled: the result is exact at every instant."""
    gradient = [[1.0, 0, 0], [0, -1.0, 0], [0, 0, 0]]
    drive = Drive(field=(sine(0.1, 3.0), 0, ramp(1.0, 0.7)), gradient=gradient, voltage=[9.0, 0.0])
    gained = through("field_gain", drive, field_gain=-0.2)
    for c in CHANNELS[:12]:
        assert at(gained, c) == pytest.approx(0.8 * at(drive, c), rel=1e-15)
    assert through("voltage_gain", drive, voltage_gain=0.5)["voltage_0"](0.3) == 13.5
    shifted = through("field_offset", drive, field_offset_y=0.003)
    assert at(shifted, "field_y") == pytest.approx(0.003)
    assert np.array_equal(at(shifted, "field_x"), at(drive, "field_x"))
    shifted = through("voltage_offset", drive, voltage_offset=100.0)
    assert shifted["voltage_0"](0.1) == 109.0
    assert shifted["voltage_1"](0.1) == 0.0, "a group that is not driven is grounded"


def test_a_misaligned_field_is_turned_with_its_gradient():
    """Exact rotation; the turned field is that of the turned magnet, R B(R^T x), at every place."""
    turn = np.array([0.1, -0.2, 0.3])
    r = Rotation.from_rotvec(turn).as_matrix()
    g = np.array([[1.0, 0.3, -0.2], [0.3, -0.4, 0.5], [-0.2, 0.5, -0.6]])
    drive = Drive(field=(0.1, ramp(0.2, 0.8), -0.05), gradient=g.tolist())
    out = through("field_misalignment", drive, turn_x=turn[0], turn_y=turn[1], turn_z=turn[2])
    place = np.array([0.02, -0.05, 0.03])
    for t in (0.1, 0.6):
        gradient = np.array([float(np.ravel(out[c](t))[0]) for c in CHANNELS[3:12]]).reshape(3, 3)
        before = drive.field(t).ravel() + g @ (r.T @ place)
        assert out.field(t).ravel() + gradient @ place == pytest.approx(r @ before, rel=1e-12)


def test_hysteresis_is_a_play_of_constant_width_at_every_rate():
    width = 0.004
    for frequency in (1.0, 4.0):
        drive = Drive(field=(sine(0.02, frequency), 0, 0))
        out = through("field_hysteresis", drive, coercive_field=width)
        command, field = at(drive, "field_x")[:, 0], at(out, "field_x")[:, 0]
        assert np.abs(command - field).max() == pytest.approx(width, rel=1e-9)
        assert field.max() == pytest.approx(0.02 - width, rel=1e-3)
        zero = np.array([0.5, 1.0]) / frequency  # falling and rising through zero
        assert at(out, "field_x", zero[zero <= 1])[0, 0] == pytest.approx(width, rel=1e-9)


def test_a_saturating_field_keeps_its_direction_and_its_limit():
    """Bs tanh(B / Bs) to third order; at a hundred times the limit, the limit; a gradient of the same coil alike."""
    limit, way = 0.03, np.array([2.0, -1.0, 2.0]) / 3.0
    for size, expected in ((0.003, limit * math.tanh(0.1)), (3.0, limit)):
        drive = Drive(field=tuple(size * way), gradient=((0, 0, 0), (0, 0, 0.5), (0, 0, 0)))
        s = 2.0 / (3.0 * limit**2) if size < limit else 1.0 / limit**2
        out = through("field_saturation", drive, field_saturation=s)
        field = np.array([at(out, c)[7, 0] for c in CHANNELS[:3]])
        assert field == pytest.approx(expected * way, rel=1e-4)
        gradient = next(c for c in CHANNELS[3:12] if not drive[c].is_zero)
        assert at(out, gradient)[7, 0] == pytest.approx(0.5 * np.linalg.norm(field) / size, rel=1e-12)


def test_a_current_limit_charges_along_a_straight_line():
    """0.1 mA into 0.76 nF: 30.4 ms to 4 kV; the corner is rounded to a sample, 0.5 ms."""
    step = Drive(voltage=series([0.0, 1e-6, 1.0], [0.0, 4000.0, 4000.0]))
    out = through("voltage_limit", step, charge_time=0.76e-9 / 1e-4)
    t = np.array([0.01, 0.015, 0.03, 0.0305, 0.5])
    assert at(out, "voltage_0", t)[:, 0] == pytest.approx(np.minimum(t / 7.6e-6, 4000.0), abs=0.2)


def test_leakage_takes_what_its_equation_says():
    command = np.linspace(-9000.0, 9000.0, 181)
    times = np.linspace(0, DURATION, 181)
    drive = Drive(voltage=series(times, command))
    sagging = through("voltage_sag", drive, sag=0.05, sag_voltage=4000.0, leakage_voltage=1000.0)
    out = at(sagging, "voltage_0", times)[:, 0]
    back = out + 0.05 * 4000 * np.sinh(out / 1000) / math.sinh(4.0)
    assert back == pytest.approx(command, rel=1e-9, abs=1e-6)
    assert np.all(np.diff(out) > 0)
    at_four = at(through("voltage_sag", Drive(voltage=4200.0), sag=0.05), "voltage_0")
    assert at_four == pytest.approx(4000.0, rel=1e-9)


# --- the measurement --------------------------------------------------------------------------------------------------


def wave(t):
    return np.sin(WAVE * t)[:, None]


def test_clock_errors_shift_and_stretch_time():
    assert measured("clock_delay", wave, clock_delay=0.013)[:, 0, 0] == pytest.approx(np.sin(WAVE * (TIMES - 0.013)))
    slow = measured("clock_rate", wave, clock_rate=-0.02)[:, 0, 0]
    assert slow == pytest.approx(np.sin(WAVE * (0.25 + 0.98 * (TIMES - 0.25))))


def test_scales_and_offsets():
    def line(t):
        return np.stack([t, -t, 2 + 0 * t], axis=1)

    clean = line(TIMES[:, None])
    for name in ("length_scale", "angle_scale"):
        assert measured(name, line, **{name: 0.05}) == pytest.approx(1.05 * clean, rel=1e-15)
    assert measured("angle_offset", wave, angle_offset=-0.02) == pytest.approx(wave(TIMES[:, None]) - 0.02, rel=1e-14)
    moved = measured("length_offset", line, offset_x=0.001, offset_y=-0.002, offset_z=0.003)
    assert moved - clean == pytest.approx(np.broadcast_to([[0.001], [-0.002], [0.003]], clean.shape), abs=1e-15)
    single = measured("length_offset", wave, offset_x=0.001, offset_y=5.0)
    assert single == pytest.approx(wave(TIMES[:, None]) + 0.001, rel=1e-14), "a scalar channel has one component"


def test_a_tilted_camera_turns_positions_about_the_origin():
    def line(t):
        return np.stack([t, -t, 2 + 0 * t], axis=1)

    turn = np.array([0.1, -0.05, 0.2])
    clean = line(TIMES[:, None])[:, :, 0]
    seen = measured("camera_tilt", line, tilt_x=turn[0], tilt_y=turn[1], tilt_z=turn[2])[:, :, 0]
    assert seen == pytest.approx(Rotation.from_rotvec(turn).apply(clean), rel=1e-13)
    flat = measured("camera_tilt", lambda t: line(t)[:, :2], tilt_x=turn[0], tilt_y=turn[1], tilt_z=turn[2])[:, :, 0]
    c, s = math.cos(0.2), math.sin(0.2)
    assert flat == pytest.approx(clean[:, :2] @ np.array([[c, s], [-s, c]]), rel=1e-13)


def test_a_tracker_that_lags_follows_a_ramp_late_and_a_sine_smaller():
    tau, start = 0.02, TIMES[0]

    def ramp_(t):
        return (3 * t)[:, None]

    late = measured("tracker_lag", ramp_, tracker_lag=tau)[:, 0, 0]
    settled = TIMES > start + 30 * tau
    assert late[settled] == pytest.approx(3 * (TIMES[settled] - tau), rel=1e-5)
    smaller = measured("tracker_lag", wave, tracker_lag=tau)[:, 0, 0]
    wt = WAVE * tau
    exact = (np.sin(WAVE * TIMES) - wt * np.cos(WAVE * TIMES)) / (1 + wt**2)
    assert np.abs(smaller - exact)[settled].max() < 1e-4


def test_exposure_averages_over_its_time():
    w = 0.04
    mean = measured("exposure", wave, exposure=w)[:, 0, 0]
    exact = (np.cos(WAVE * (TIMES - w)) - np.cos(WAVE * TIMES)) / (WAVE * w)
    settled = TIMES > TIMES[0] + w
    assert np.abs(mean - exact)[settled].max() < 1e-12


@pytest.mark.parametrize(("name", "value"), [("tracker_lag", 0.1), ("exposure", 0.1)])
def test_what_was_before_a_filter_began_is_told_by_who_reads(name, value):
    """Of a body that had rested its first value is where that was."""

    def rested(t):
        return wave(np.maximum(t, TIMES[0]))

    first = measured(name, rested, **{name: value})[0, 0, 0]
    assert first == pytest.approx(math.sin(WAVE * TIMES[0]), rel=1e-13)


def test_perspective_scales_with_the_depth_about_its_centre():
    """A pinhole at 0.8 m that faces (0.02, -0.01): similar triangles; a picture without depth is left alone."""
    x = np.array([[0.05, -0.03, 0.1], [-0.04, 0.08, -0.05], [0.02, -0.01, 0.3]])
    eye = np.array([0.02, -0.01, 0.8])

    def still(t):
        return np.repeat(x[None, :, :], len(t), axis=0)

    seen = measured("perspective", still, nearness=1 / 0.8, centre_right=eye[0], centre_up=eye[1])
    for w in range(3):
        point = x[:, w]
        ray = eye + (point - eye) * eye[2] / (eye[2] - point[2])  # where it meets the plane of the ruler
        assert seen[:, :2, w] == pytest.approx(np.broadcast_to(ray[:2], (len(TIMES), 2)), rel=1e-12, abs=1e-15)
    flat = measured("perspective", lambda t: still(t)[:, :2], nearness=1 / 0.8)
    assert np.array_equal(flat, still(TIMES)[:, :2])
    behind = measured("perspective", lambda t: 10.0 + 0 * still(t), nearness=1.0)
    assert np.all(np.isfinite(behind))

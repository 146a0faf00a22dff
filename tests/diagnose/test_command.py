"""`origami-sim diagnose`: what it reads, says and leaves."""

import json
import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from diagnose.swings import FRICTION, NOISE, QUICK, SIDECAR, WAVE, T, main, recorded_drive, single, swing, table

import origami_sim
from origami_sim import threads
from origami_sim.device.scene import NAMES, Settings, read_calibration, recordings_folder, scene_module, scene_settings
from origami_sim.diagnose import EXIT, Keep, Subject, command, diagnose, overlay, subject_of
from origami_sim.drive import Drive, sine
from origami_sim.effects import CATALOGUE, Effect, Parameter, scalar
from origami_sim.errors import InputError
from origami_sim.fit.predictor import Prediction
from origami_sim.hypotheses.subject import known_before, spreads
from origami_sim.observation.doubts import assumed, switched
from origami_sim.predict import cache
from origami_sim.recording import Channel, DriveChannel, Recording, read_recording
from origami_sim.report.page import read_report
from origami_sim.report.patch import Addition, additions, switched_on, write_patch
from origami_sim.results.run_folder import load_run
from origami_sim.solve.motion.dynamics import simulate
from origami_sim.view.viewer import read_series


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    return swing(tmp_path_factory.mktemp("recorded"))


@pytest.fixture(scope="module")
def diagnosed(recorded, tmp_path_factory):
    """Exit code, output, progress and folder of one whole diagnosis on the command line."""
    import contextlib
    import io

    folder = tmp_path_factory.mktemp("diagnosed") / "out"
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main("diagnose", recorded, "--model", "pendulum_chain", "--out", folder, *QUICK)
    return code, out.getvalue(), err.getvalue(), folder


# what it says and leaves -----------------------------------------------------------------------------------------


def test_the_missing_friction_is_found_and_all_files_are_there(diagnosed):
    code, out, err, folder = diagnosed
    assert code == EXIT["MECHANISM"]
    assert out.index("noise") < out.index("MECHANISM: ")  # the lint comes first
    assert "crease_friction at hinge1" in out
    stages = re.findall(r"^ *\d+ s  (\w+)", err, re.M)
    order = [stages.index(n) for n in ("nominal", "screen", "search", "verdict", "locate", "baselines", "page")]
    assert order == sorted(order)
    names = {"report.html", "diagnosis.json", "patched.toml", "replay.rrd"}
    assert {p.name for p in folder.iterdir()} == names
    data = json.loads((folder / "diagnosis.json").read_text())
    assert data["verdict"] == "MECHANISM"
    assert read_report(folder / "report.html")["diagnosis"] == data
    # held-out error at the noise, which is known here, where that of the refitted model is far above
    assert data["error_after"][0] == pytest.approx(NOISE, rel=0.15)
    assert data["error_refitted"][0] > 2.5 * NOISE


def test_the_patched_calibration_switches_the_effect_on(diagnosed, recorded, tmp_path, capfd):
    folder = diagnosed[3]
    settings = read_calibration(folder / "patched.toml")
    (found,) = settings.effects
    assert (found.effect, found.entities, found.site) == ("crease_friction", (0,), "hinge1")
    assert found.values["friction_moment"] == pytest.approx(FRICTION, rel=0.05)
    low, high = settings["mass_1"].uncertainty or (0, 0)
    assert low < settings.mass_1 < high
    arguments = ("--calibration", folder / "patched.toml", "--set", "duration=0.1", "--out", tmp_path / "run")
    assert main("run", "pendulum_chain", *arguments) == 0
    run = load_run(tmp_path / "run")
    assert run.manifest["effects"][-1] == "crease_friction"
    assert run.trajectory.parameters["crease_friction", "friction_moment"][0, 0] == found.values["friction_moment"]


def test_the_patched_scene_follows_the_recording_where_the_given_one_does_not(diagnosed, recorded):
    module, given = single()
    recording = read_recording(recorded)
    error = {}
    for name, s in (("given", given), ("patched", read_calibration(diagnosed[3] / "patched.toml"))):
        model, parameters, drive = module.build(s.replace(angle_1=2.4, rate_1=0.0))
        motion = simulate(model, parameters, drive, duration=8.0, rate=120, state=module.start(given, model))
        angle = module.arm_angles(motion, given)[:, 0]
        error[name] = np.sqrt(np.mean((angle - recording.channels["theta1"].values) ** 2))
    assert error["given"] > 50 * NOISE
    assert error["patched"] < 4 * NOISE  # free run over all 8 s with numbers that were fitted in segments


def test_a_patched_calibration_is_a_model_again(diagnosed, recorded):
    data = command.read_recordings([str(recorded)])
    module, settings = command.model_of(str(diagnosed[3] / "patched.toml"), data)
    assert module.__name__.endswith("pendulum_chain")
    subject = Subject.from_scene(module, settings)
    assert [f.name for f in subject.nominals] == ["mass_1", "viscosity_1"]  # with the intervals of the diagnosis
    assert "crease_friction" in subject.build({})[0].effects


def test_the_replay_shows_the_recorded_object_over_both_simulations(diagnosed):
    folder = diagnosed[3]
    series = {path: values for path, _, values in read_series(folder / "replay.rrd")}
    left = {n: np.sqrt(np.mean(series[f"/channels/theta1/left_{n}"] ** 2)) for n in ("before", "after")}
    assert left["after"] == pytest.approx(np.degrees(NOISE), rel=0.15)
    assert left["before"] > 3 * left["after"]


def test_films_are_what_was_fitted(recorded, monkeypatch):
    """The drawn simulation has the channels of the fit, and the drawn recording those that were measured."""
    from origami_sim.fit.least_squares import fit
    from origami_sim.fit.weights import Weights
    from origami_sim.hypotheses.hypothesis import Hypothesis
    from origami_sim.observation.observe import panel_angle
    from origami_sim.predict.bars import BarRollouts

    subject, recording = Subject.from_scene(*single()), read_recording(recorded).window(0.0, 1.0)
    forward = BarRollouts(subject, [recording], segment=0.4)
    given = fit(forward, Hypothesis(), Weights(forward.blocks[0].noise), fixed=True)
    monkeypatch.setattr(overlay, "RATE", np.inf)  # every frame
    shown = overlay.film(forward, {"before": given, "after": given}, 0)
    predicted = forward.predict(Hypothesis(), given.theta[None], given.local[None])
    clocks = [recording.times[b.first] + b.times for b in forward.blocks]
    ends = np.append([c[0] for c in clocks[1:]], np.inf)  # where segments meet, the later one is shown
    told = recording.channels["theta1"].values
    for clock, values, end in zip(clocks, predicted, ends, strict=True):
        mine = (shown.times > clock[0] - 1e-6) & (shown.times < min(end, clock[-1]) - 1e-6)
        assert np.count_nonzero(mine) > 5
        for x, times, wanted in (
            (shown.films["after"], clock, values[0, :, 0]),
            (shown.recorded, recording.times, told),
        ):
            frames = np.argmin(np.abs(times[:, None] - shown.times[mine]), axis=0)
            np.testing.assert_allclose(times[frames], shown.times[mine], atol=1e-6)
            gap = panel_angle(forward.model, x[mine], 1) - wanted[frames]
            np.testing.assert_allclose(np.sin(gap), 0.0, atol=1e-6)


def test_an_error_of_one_channel_moves_no_node(recorded):
    from origami_sim.fit.least_squares import fit
    from origami_sim.fit.weights import Weights
    from origami_sim.hypotheses.hypothesis import Free, Hypothesis, Suspect
    from origami_sim.predict.bars import BarRollouts

    subject, recording = Subject.from_scene(*single()), read_recording(recorded).window(0.0, 1.0)
    forward = BarRollouts(subject, [recording], segment=0.4)
    late = Free("clock_delay", "clock_delay", "s", 0.0, 0.01, entities=(1,))
    one = Hypothesis((Suspect("clock_delay", "channel theta2", "measurement", (late,), (1,)),))
    weights = Weights(forward.blocks[0].noise)
    plain = fit(forward, Hypothesis(), weights, fixed=True, most=0)
    theta = np.append(plain.theta, 0.05)
    delayed = fit(forward, one, weights, theta=theta, local=plain.local, fixed=True, most=0)
    shown = overlay.film(forward, {"before": plain, "after": delayed}, 0)
    np.testing.assert_allclose(shown.films["after"], shown.films["before"], atol=1e-12)


def test_an_interrupted_diagnosis_goes_on_where_it_stopped(diagnosed, recorded, tmp_path, monkeypatch, capfd):
    shown = command.Progress.__call__

    def interrupted(self, stage, part):
        shown(self, stage, part)
        if stage == "verdict":
            raise KeyboardInterrupt

    monkeypatch.setattr(threads, "default_threads", lambda: 1)  # each process counts what it finds itself
    arguments = ("diagnose", recorded, "--model", "pendulum_chain", "--out", tmp_path / "out", *QUICK)
    with monkeypatch.context() as m:
        m.setattr(command.Progress, "__call__", interrupted)
        assert main(*arguments) == 130
    assert "the same command goes on from here" in capfd.readouterr().err
    stored = list((tmp_path / "out" / ".resume").iterdir())
    assert stored
    assert [p.name for p in (tmp_path / "out").iterdir()] == [".resume"]
    kept = []
    monkeypatch.setattr(command, "Keep", lambda folder: kept.append(Keep(folder)) or kept[0])
    assert main(*arguments, "--json") == EXIT["MECHANISM"]
    assert kept[0].cache.found >= len(stored)
    assert not (tmp_path / "out" / ".resume").exists()
    one, other = (json.loads((f / "diagnosis.json").read_text()) for f in (diagnosed[3], tmp_path / "out"))
    assert one.pop("seconds").keys() == other.pop("seconds").keys()
    assert one == other  # to the last digit, as if it had not been interrupted
    printed = json.loads(capfd.readouterr().out)
    assert printed["verdict"] == "MECHANISM"
    assert printed["exit_code"] == EXIT["MECHANISM"]
    assert Path(printed["files"]["report"]).is_file()


def test_stored_predictions_are_of_these_inputs_only(tmp_path, recorded, monkeypatch):
    """Another start, number, site or recording never finds a stored prediction; a damaged file is computed again."""
    from origami_sim.hypotheses.hypothesis import Hypothesis
    from origami_sim.hypotheses.suspects import suspects
    from origami_sim.predict.bars import BarRollouts

    monkeypatch.setattr(cache, "WORTH", 0.0)  # however quick they are
    module, s = single()
    recording = read_recording(recorded).window(0.0, 1.0)
    subject = Subject.from_scene(module, s, spreads={"viscosity_1": 5e-5})
    plain, keep = BarRollouts(subject, [recording], segment=0.5), Keep(tmp_path)
    remembered = BarRollouts(subject, [recording], segment=0.5)
    keep.follow(remembered)
    theta, local = np.array([[2e-4]]), np.zeros((1, len(plain.blocks), plain.local))
    friction = next(
        x for x in suspects(plain.model, [recording], plain.drive, plain.parameters) if "friction" in x.effect
    )
    asked = [
        (Hypothesis(), theta, local),
        (Hypothesis(), theta * 2, local),
        (Hypothesis(), theta, local + 1e-3),
        (Hypothesis((friction,)), np.array([[2e-4, 1e-3, 0.01]]), local),
    ]
    for again in range(2):
        for one in asked:
            for a, b in zip(plain.predict(*one), remembered.predict(*one), strict=True):
                np.testing.assert_array_equal(a, b)
        assert (keep.cache.found, keep.cache.computed) == (len(asked) * again, len(asked))
    for file in tmp_path.iterdir():
        file.write_bytes(file.read_bytes()[:100])
    remembered.predict(*asked[0])
    assert keep.cache.computed == len(asked) + 1
    other = BarRollouts(subject, [recording], segment=0.5)
    other.calm = 0.01
    keep.follow(other)
    other.predict(*asked[0])
    assert keep.cache.computed == len(asked) + 2


@pytest.mark.slow
def test_a_hypothesis_that_diverges_is_reported_and_no_crash(recorded, monkeypatch):
    import warp as wp

    from origami_sim.fit.least_squares import fit
    from origami_sim.fit.weights import Weights
    from origami_sim.hypotheses.hypothesis import Hypothesis
    from origami_sim.hypotheses.suspects import suspects
    from origami_sim.predict.bars import BarRollouts

    @wp.func
    def moment(angle: scalar, runaway: scalar):
        return runaway * wp.exp(wp.abs(angle) * scalar(20.0)) * angle

    law = Effect(
        name="runaway",
        family="crease",
        force=moment,
        parameters=(Parameter("runaway", "R", "N m", 0.0, (0.0, np.inf), "pushes away", typical=1e-3),),
        fitted=("runaway",),
        formula="",
        source="",
        matters="never",
    )
    monkeypatch.setitem(CATALOGUE, "runaway", law)
    module, s = single()
    recording = read_recording(recorded).window(0.0, 2.0)
    found = diagnose((module, s), recording, catalogue=["runaway"])
    (row,) = found.screening
    assert (row.label, row.status) == ("runaway at hinge1", "its simulation goes unstable")
    forward = BarRollouts(Subject.from_scene(module, s), [recording], segment=0.5)
    every = suspects(forward.model, [recording], forward.drive, forward.parameters)
    suspect = next(x for x in every if x.effect == "runaway")
    failed = fit(forward, Hypothesis((suspect,)), Weights(forward.blocks[0].noise), theta=np.array([1.0]))
    assert "unstable" in failed.failed


@pytest.mark.slow
def test_missing_values_that_are_allowed_do_not_change_the_answer(recorded, tmp_path, capfd):
    """A point that was lost for a tenth of the time, also where the recording begins."""
    t, angle = np.loadtxt(recorded, delimiter=",", skiprows=1).T
    angle[(t * 7.3) % 1.0 < 0.1] = np.nan
    gaps = table(tmp_path / "gaps.csv", t, {"theta1_rad": angle}, "allow_gaps = true\n" + SIDECAR)
    assert np.isnan(read_recording(gaps).channels["theta1"].values).mean() > 0.09
    assert main("diagnose", gaps, "--model", "pendulum_chain", "--out", tmp_path / "out", *QUICK) == EXIT["MECHANISM"]
    assert "note: channel 'theta1' misses" in capfd.readouterr().out
    data = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert data["patch"]["crease_friction.friction_moment@0"] == pytest.approx(FRICTION, rel=0.05)
    assert data["error_after"][0] == pytest.approx(NOISE, rel=0.2)


def test_a_drive_on_its_own_clock_reaches_the_model():
    """Samples between the frames are kept, also where the recording is thinned and starts later than the drive."""
    from origami_sim.diagnose.prepare import thinned
    from origami_sim.predict.drives import drive_of

    times = 2.0 + np.arange(40) / 20.0
    clock = np.linspace(1.5, 4.5, 301)
    field = DriveChannel("field_z", np.sin(20.0 * clock), "T", False, clock)
    recording = Recording("r", times, {"a": Channel("a", "panel_angle", 0 * times, "rad", 1e-3)}, {"field_z": field})
    for one in (recording, thinned(recording, 4)):
        signal = drive_of(one, Drive())["field_z"]
        np.testing.assert_allclose(np.squeeze(signal(clock[50:-70] - 2.0)), np.sin(20.0 * clock[50:-70]), atol=1e-9)


def test_drives_of_several_components_reach_their_channels():
    from origami_sim.predict.drives import drive_of

    gradient = drive_of(recorded_drive("gradient", np.arange(9.0), "T/m", constant=True), Drive())
    assert [float(gradient[f"gradient_{i}{j}"](0.3)) for i in "xyz" for j in "xyz"] == list(range(9))
    assert float(drive_of(recorded_drive("field", [0.0, 0.0, 0.2], constant=True), Drive())["field_z"](1.0)) == 0.2
    two = drive_of(recorded_drive("voltage", np.outer(np.arange(20), [1.0, 2.0]), "V"), Drive(voltage=[0.0, 0.0]))
    assert float(two["voltage_1"](0.55)) == pytest.approx(11.0)


def test_what_the_scene_drives_by_itself_is_told():
    """A note names what no recording states and how large it is; a curve takes nothing from the scene."""
    own = Drive(field=(0.0, 0.0, sine(0.2, 3.0)), temperature=5.0)
    silent = recorded_drive("load", 0.0, "1", constant=True)
    (note,) = assumed(silent, own)
    assert note.startswith("'r' states no field_z, temperature: the scene's own is assumed ")
    assert note.endswith("(field_z up to 200 mT, temperature up to 5.0 K).")
    assert assumed(silent, Drive()) == []
    (note,) = assumed(recorded_drive("field", np.zeros((20, 3))), own)
    assert "field" not in note and "temperature" in note
    silent.metadata["time_base"] = "step"
    assert assumed(silent, own) == []


def test_a_drive_that_is_switched_between_two_rows_is_noted():
    """Then when is known to a row only; a wave, a slow ramp and a noisy level are not switched."""
    k = np.arange(20)
    steps = np.zeros((20, 3))
    steps[8:, 2] = 0.01
    (note,) = switched(recorded_drive("field", steps))
    assert "after 0.7 s: when is known to 100 ms only" in note
    fine = DriveChannel("field", steps[[0, 7, 8, 19]], "T", False, times=np.array([0.0, 0.799, 0.8, 1.9]))
    logged = recorded_drive("field", steps)
    logged.drive["field"] = fine
    assert switched(logged) == [], "to a hundredth of a frame"
    noise = 1e-4 * np.random.default_rng(0).normal(size=(20, 3))
    assert switched(recorded_drive("field", steps + noise)) == [note]
    for calm in (np.sin(k), np.clip(0.2 * k - 1, 0, 1), 0.01 + noise[:, 0]):
        assert switched(recorded_drive("field_z", calm)) == []
    assert switched(recorded_drive("load", 0.0, "1", constant=True)) == []


FLAP = """\
name = "flap"
[time]
column = "time_s"
[channels.fold]
column = "fold"
kind = "crease_angle"
unit = "rad"
crease = 0
[scene]
name = "mae_crease"
overrides = { stiffness = 0.03 }
[priors]
stiffness = "5 %"
"""


@pytest.fixture
def reached(monkeypatch) -> list:
    """What the command hands to the diagnosis, which is left out."""
    handed = []

    def stop(*arguments, **_):
        handed.append(arguments)
        raise InputError("stopped here")

    monkeypatch.setattr(command, "diagnose", stop)
    return handed


def test_a_drive_that_is_not_stated_is_a_note_of_the_diagnosis(reached, tmp_path, capfd):
    path = table(tmp_path / "flap.csv", T, {"fold": 0.1 * WAVE}, FLAP)
    assert main("diagnose", path, "--model", "mae_crease", "--out", tmp_path / "out") == 2
    note = "'flap' states no field_z: the scene's own is assumed (field_z up to 200 mT)."
    assert f"note: {note}" in capfd.readouterr().out
    subject, (recording,), _ = reached[0]
    assert recording.metadata["notes"][-1] == note
    assert subject.nominals[0].start == 0.03


def test_overrides_do_not_undo_what_was_refitted(reached, tmp_path, capfd):
    """A calibration of this object states its numbers; the sidecar's are over those of the scene only."""
    path = table(tmp_path / "flap.csv", T, {"fold": 0.1 * WAVE}, FLAP)
    settings = scene_settings(scene_module("mae_crease")).replace(stiffness=0.021)
    nothing = SimpleNamespace(patch={}, candidates=[], recordings=["r"], verdict="ADEQUATE", sentence="Noise.")
    own = write_patch(tmp_path / "own.toml", settings, nothing, scene="mae_crease")  # type: ignore[arg-type]
    assert main("diagnose", path, "--model", own, "--out", tmp_path / "out") == 2
    assert "overrides are left out" in capfd.readouterr().out
    assert main("diagnose", path, "--model", own, "--set", "stiffness=0.04", "--out", tmp_path / "out") == 2
    assert [handed[0].nominals[0].start for handed in reached] == [0.021, 0.04]


def test_the_worked_sidecar_of_the_manual_works(reached, tmp_path, capfd):
    """With a table and a log of the supply that are made up."""
    text = (Path(__file__).resolve().parents[2] / "docs" / "recordings.md").read_text()
    (tmp_path / "flap.toml").write_text(text.split("```toml\n")[1].split("```")[0])
    rng, head = np.random.default_rng(2), ["scorer" + 6 * ",net", "bodyparts" + 3 * ",tip" + 3 * ",corner"]
    rows = [",".join(f"{v:.3f},{w:.3f},0.99" for v, w in rng.normal([(650, 655)] * 2, 1.0)) for _ in range(60)]
    lines = [*head, "coords" + 2 * ",x,y,likelihood", *(f"{k},{row}" for k, row in enumerate(rows))]
    (tmp_path / "flap.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "supply.csv").write_text("ms,b\n" + "".join(f"{k},{5 * np.sin(k / 30):.6f}\n" for k in range(340, 620)))
    assert main("diagnose", tmp_path / "flap.csv", "--model", "mae_crease", "--out", tmp_path / "out") == 2
    assert "stopped here" in capfd.readouterr().err
    subject, (recording,), _ = reached[0]
    assert recording.metadata["notes"] == []
    assert [f.name for f in subject.nominals] == ["stiffness"]


def test_a_full_disk_costs_only_what_would_have_been_kept(tmp_path, monkeypatch):
    def full(file, **_):
        file.write(b"half")
        raise OSError(28, "No space left on device")

    one = Prediction([np.zeros((1, 3, 1))], [None])
    with monkeypatch.context() as m:
        m.setattr(cache.np, "savez", full)
        cache._write(tmp_path / "one.npz", one)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "taken").write_text("")
    cache._write(tmp_path / "taken" / "one.npz", one)
    assert cache._read(tmp_path / "taken" / "one.npz", 1) is None


# priors, models and patches --------------------------------------------------------------------------------------


def test_priors_come_in_the_settings_unit_with_a_unit_or_as_a_share(recorded):
    settings = scene_settings(scene_module("pendulum_chain"))
    given = {"mass_1": "2 %", "length_1": "0.5 mm", "viscosity_1": 2e-5}
    assert spreads(settings, given) == pytest.approx(
        {"mass_1": 0.02 * settings.mass_1, "length_1": 5e-4, "viscosity_1": 2e-5}
    )
    data = command.read_recordings([str(recorded)])
    built = scene_module("pendulum_chain").build(settings)[:2]
    known, _, aligned = known_before(settings, data[0], ["length_1=1mm", "mass_1=0.001"], *built)
    assert known == pytest.approx(
        {"length_1": 1e-3, "mass_1": 1e-3, "viscosity_1": 5e-5}
    )  # the command line over the sidecar
    assert not aligned


@pytest.mark.slow
def test_an_alignment_is_a_number_of_the_model_and_comes_into_the_patch(recorded, tmp_path):
    """A scale that is known to 1 %, on the command line over the sidecar; beside it friction is found as without."""
    sidecar = recorded.with_suffix(".toml").read_text() + '"angle_scale.angle_scale" = 0.5\n'
    t, angle = np.loadtxt(recorded, delimiter=",", skiprows=1).T
    table(tmp_path / "scaled.csv", t, {"theta1_rad": 0.985 * angle}, sidecar)
    given = ("--model", "pendulum_chain", "--prior", "angle_scale.angle_scale=0.01", "--out", tmp_path / "out", *QUICK)
    assert main("diagnose", tmp_path / "scaled.csv", *given) == EXIT["MECHANISM"]
    data = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    scale = next(n for n in data["candidates"][0]["numbers"] if n["label"] == "angle_scale.angle_scale")
    assert scale["spread"] == 0.01 and scale["low"] < -0.015 < scale["high"]
    assert data["patch"]["crease_friction.friction_moment@0"] == pytest.approx(FRICTION, rel=0.1)
    patch = read_calibration(tmp_path / "out" / "patched.toml")
    added = {a.effect: a.values for a in patch.effects}
    assert added["angle_scale"] == {"angle_scale": pytest.approx(scale["value"])}
    assert "crease_friction" in added


def test_of_an_alignment_only_the_stated_component_acts():
    for source, label, unit in (("box", "gravity_tilt.tilt_y", "rad"), ("box", "field_misalignment.turn_x", "rad")):
        subject = subject_of(source, {label: 0.01})
        effect, _, name = label.partition(".")
        aligned = subject.nominals[-1]
        assert (aligned.name, aligned.unit, aligned.aligned) == (label, unit, True)
        for value in (0.0, 0.02):
            given = subject.build({label: value})[1].of(effect)
            moved = {n: float(v.flat[0]) for n, v in given.items() if n in CATALOGUE[effect].fitted}
            assert moved.pop(name) == value and not any(moved.values())


def test_an_alignment_starts_where_the_calibration_has_it(tmp_path):
    """A patched calibration is diagnosed again with the same sidecar."""
    settings = scene_settings(scene_module("pendulum_chain"))
    late = Settings(list(settings.values()), settings.file, [Addition("clock_delay", {"clock_delay": 0.004})])
    subject = subject_of((scene_module("pendulum_chain"), late), {"clock_delay.clock_delay": "5 ms"})
    assert subject.nominals[-1].start == 0.004 and subject.nominals[-1].spread == 0.005
    for values, expected in (({}, 0.004), ({"clock_delay.clock_delay": 0.006}, 0.006)):
        assert np.all(subject.build(values)[1]["clock_delay", "clock_delay"] == expected)


def test_alignments_are_of_the_measurement_the_drive_or_the_body():
    with pytest.raises(InputError, match=r"not a number that can be aligned.*crease_friction"):
        subject_of("pendulum_chain", {"crease_friction.friction_moment": 1e-5})
    # settings that are called like an effect keep their priors
    assert [f.spread for f in subject_of("cube_toss", {"length_scale": 0.01}).nominals if f.name == "length_scale"] == [
        0.01
    ]
    assert subject_of("box", {"angle_scale.angle_scale": "1 %"}).nominals[-1].spread == 0.01


def test_several_recordings_are_one_data_set(recorded, tmp_path):
    for name in ("one", "two"):
        for suffix in (".csv", ".toml"):
            shutil.copy(recorded.with_suffix(suffix), tmp_path / f"{name}{suffix}")
        sidecar = tmp_path / f"{name}.toml"
        sidecar.write_text(sidecar.read_text().replace('"swing"', f'"{name}"'))
    values = np.loadtxt(tmp_path / "two.csv", delimiter=",", skiprows=1)
    table(tmp_path / "two.csv", values[:, 0], {"theta1_rad": values[:, 1] + 1e-3}, (tmp_path / "two.toml").read_text())
    for given in ([str(tmp_path)], [str(tmp_path / "one.csv"), str(tmp_path / "two.csv")]):
        assert [r.name for r in command.read_recordings(given)] == ["one", "two"]


@pytest.mark.slow
def test_two_recordings_are_held_out_in_turn_and_have_a_replay_each(recorded, tmp_path):
    t, angle = np.loadtxt(recorded, delimiter=",", skiprows=1).T
    for name, part in (("one", t < 4.0), ("two", t > 4.0)):
        table(tmp_path / f"{name}.csv", t[part], {"theta1_rad": angle[part]}, SIDECAR.replace('"swing"', f'"{name}"'))
    out = tmp_path / "out"
    files = tmp_path / "one.csv", tmp_path / "two.csv"
    assert main("diagnose", *files, "--model", "pendulum_chain", "--out", out, *QUICK) == EXIT["MECHANISM"]
    data = json.loads((out / "diagnosis.json").read_text())
    assert data["recordings"] == ["one", "two"]
    assert not [n for n in data["notes"] if n.startswith("One recording only")]
    assert data["patch"]["crease_friction.friction_moment@0"] == pytest.approx(FRICTION, rel=0.05)
    assert {p.name for p in out.glob("*.rrd")} == {"replay_one.rrd", "replay_two.rrd"}


def test_known_recordings_have_shipped_sidecars():
    folder = recordings_folder()
    if folder is None:
        pytest.skip("the real recordings are not here (shared/recordings or $ORIGAMI_RECORDINGS)")
    names = [str(folder / "pendulum_chain" / f"single_{k}.csv") for k in "ab"]
    data = command.read_recordings(names)
    assert [r.name for r in data] == ["single_a", "single_b"]
    assert command.read_recordings([str(folder / "pendulum_chain" / "double.csv")]).channels == ["theta1", "theta2"]
    names = [str(folder / "magnetic_arch" / f"{n}.csv") for n in ("step_5mT", "ramp_16p25mT_2p5s")]
    step, ramp = command.read_recordings(names)  # driven differently, each by its own
    assert (step.name, ramp.name) == ("step_5mT", "ramp_16p25mT_2p5s")
    assert step.drive["field"].constant and not ramp.drive["field"].constant
    assert len(ramp.times) == 94 and any("4 rows that repeat" in n for n in ramp.metadata["notes"])


def test_python_takes_a_scene_or_a_model_with_parameters():
    module, s = single()
    model, parameters, drive = module.build(s)
    assert subject_of("pendulum_chain").name == "pendulum_chain"
    assert subject_of(module, {"mass_1": "1 %"}).nominals[0].spread == pytest.approx(0.01 * s.mass_1)
    assert subject_of((module, s)).build({})[0].hash == model.hash
    for source in ((model, parameters), (model, parameters, drive)):
        subject = subject_of(source, {"crease_viscosity.viscosity": "20 %"})
        assert [(f.name, f.spread) for f in subject.nominals] == [("crease_viscosity.viscosity", pytest.approx(0.2))]
        assert subject_of(subject) is subject
    for source, said in ((3, "no model"), ("nothing", "no such scene")):
        with pytest.raises(InputError, match=said):
            subject_of(source)  # type: ignore[arg-type]
    late = subject_of((model, parameters), {"clock_delay.clock_delay": "5 ms"})
    assert [(f.name, f.spread, f.unit) for f in late.nominals] == [("clock_delay.clock_delay", 0.005, "s")]
    richer, numbers, _ = late.build({"clock_delay.clock_delay": 0.02})
    assert richer.effects[-1] == "clock_delay" and numbers["clock_delay", "clock_delay"] == 0.02
    with pytest.raises(InputError, match="no such parameter"):
        subject_of((model, parameters), {"crease_viscosity.nothing": 0.1})
    with pytest.raises(InputError, match="not a number that can be aligned"):
        subject_of((model, parameters), {"crease.stiffness": 0.1})
    with pytest.raises(InputError, match="states its own priors"):
        subject_of(subject_of(module), {"mass_1": 1.0})
    # the package can be called by the name of its function, however it was imported
    with pytest.raises(InputError, match="nothing to diagnose"):
        origami_sim.diagnose((model, parameters), [])


@pytest.mark.parametrize("name", NAMES)
def test_every_scene_switches_on_what_its_calibration_adds(name):
    module = scene_module(name)
    settings = scene_settings(module)
    added = Addition("mass_damping", {"decay_rate": 0.25}), Addition("length_scale", {"error": 0.01})
    added = [a for a in added if a.values.keys() <= {p.name for p in CATALOGUE[a.effect].parameters}]
    model, parameters, *_ = module.build(Settings(list(settings.values()), settings.file, added))
    assert {a.effect for a in added} <= set(model.effects)
    assert np.all(parameters["mass_damping", "decay_rate"] == 0.25)
    if "mass_damping" not in module.build(settings)[0].effects:
        assert model.effects[-len(added)] == "mass_damping"


def test_a_magnet_that_is_added_is_the_magnet_that_is_there():
    """Parameters that are not stated are those of an effect of the scene of the same family."""
    module = scene_module("mae_crease")
    model, parameters, _ = module.build(scene_settings(module))
    magnet = next(n for n in model.effects if (n, "remanence") in set(parameters))
    twin = next(
        e for e in CATALOGUE.values()
        if e.family == CATALOGUE[magnet].family and e.name not in model.effects and e.fitted
        and any(p.name == "remanence" for p in e.parameters) and "remanence" not in e.fitted
    )  # fmt: skip
    rich, out = switched_on(
        [Addition(twin.name, {twin.fitted[0]: twin.parameter(twin.fitted[0]).typical})], model, parameters
    )
    assert twin.name in rich.effects
    np.testing.assert_array_equal(out[twin.name, "remanence"], parameters[magnet, "remanence"])


def test_a_patch_reads_back_as_it_was_written(diagnosed, tmp_path):
    """Words, choices, ranges and numbers of every scene, to the last digit."""
    nothing = SimpleNamespace(patch={}, candidates=[], recordings=["r"], verdict="ADEQUATE", sentence="Noise.")
    for name in NAMES:
        settings = scene_settings(scene_module(name))
        path = write_patch(tmp_path / f"{name}.toml", settings, nothing, scene=name)  # type: ignore[arg-type]
        again = scene_settings(scene_module(name), path)
        assert dict(again) == dict(settings)
        assert again.effects == additions(nothing, settings) == ()  # type: ignore[arg-type]

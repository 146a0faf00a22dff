"""Fits with known answers, coverage of their intervals, what they refuse, and the real recordings."""

import argparse
import json
import math
import shlex
from dataclasses import replace

import numpy as np
import pytest
from effects.test_laws import hinge_moment

from origami_sim.calibrate import command, relaxation
from origami_sim.calibrate.experiment import (
    Hold,
    Parameter,
    calibration,
    fit,
    fit_crease,
    fit_crease_table,
    fit_prony,
    fit_ring_down,
    plot_fit,
    read_columns,
    read_hold,
    summary,
    table_basis,
)
from origami_sim.calibrate.result import read_result, write_calibration
from origami_sim.device.scene import recordings_folder
from origami_sim.errors import InputError

ANGLES = np.linspace(-1.2, 1.6, 60)


@pytest.fixture
def recordings():
    folder = recordings_folder()
    if folder is None:
        pytest.skip("the real recordings are missing (set ORIGAMI_RECORDINGS)")
    return folder


# --- the fit ----------------------------------------------------------------------------------------------------------


def line(rng, noise=2e-3, n=40):
    x = np.linspace(-1, 1, n)
    return x, 0.05 * (x - 0.3) + rng.normal(0, noise, n)


def test_profile_of_a_line_is_students_interval():
    """For a linear model the profile-likelihood interval is the textbook one."""
    x, y = line(np.random.default_rng(3))
    parameters = (Parameter("a", "1", 0.0, (-math.inf, math.inf), ""), Parameter("b", "1", 0.01, (-9.0, 9.0), ""))
    found = fit(lambda p: y - p[0] - p[1] * x, parameters, independent=True)
    from scipy import stats

    line_fit = stats.linregress(x, y)
    half = stats.t.ppf(0.975, len(x) - 2) * line_fit.stderr
    assert found["b"] == pytest.approx(line_fit.slope, rel=1e-6)
    assert found.interval("b") == pytest.approx((line_fit.slope - half, line_fit.slope + half), rel=1e-4)
    assert found.warnings == ()


def test_intervals_cover_at_their_level():
    rng = np.random.default_rng(11)
    hits = []
    for _ in range(150):
        x, y = line(rng)
        found = fit_crease(x, y)
        hits.append([lo <= t <= hi for (lo, hi), t in zip(found.intervals, (0.05, 0.3), strict=True)])
    assert (np.abs(np.mean(hits, axis=0) - 0.95) < 0.05).all()


def test_correlated_residuals_widen_the_interval_and_warn():
    x = np.linspace(-1, 1, 200)
    bent = fit_crease(x, 0.05 * x + 0.01 * x**3)
    assert any("correlated" in w for w in bent.warnings)
    x, y = line(np.random.default_rng(4), n=200)
    assert not fit_crease(x, y).warnings


def coloured(rng, n, rho):
    """A process whose neighbours correlate by rho, of unit variance."""
    white = rng.normal(0, 1, n)
    out = np.empty(n)
    out[0] = white[0]
    for i in range(1, n):
        out[i] = rho * out[i - 1] + math.sqrt(1 - rho**2) * white[i]
    return out


def test_the_mean_of_a_correlated_process_is_as_uncertain_as_it_is():
    """The variance of its mean is (1 + rho) / (1 - rho) / n, and intervals hold the truth as often as they say.

    Taken as independent they would hold it in 67 of 100 cases at rho = 0.6.
    """
    rng, n, rho = np.random.default_rng(17), 400, 0.6
    mean = (Parameter("mean", "1", 0.0, (-9.0, 9.0), ""),)
    widths, hits, independent = [], [], []
    for _ in range(120):
        y = coloured(rng, n, rho)
        low, high = fit(lambda p, y=y: y - p[0], mean).interval("mean")
        widths.append(high - low)
        hits.append(low < 0 < high)
        low, high = fit(lambda p, y=y: y - p[0], mean, independent=True).interval("mean")
        independent.append(low < 0 < high)
    assert np.median(widths) == pytest.approx(2 * 1.96 * math.sqrt((1 + rho) / (1 - rho) / n), rel=0.05)
    assert np.mean(hits) == pytest.approx(0.95, abs=3 * math.sqrt(0.95 * 0.05 / 120))
    assert np.mean(independent) < 0.8


def test_only_a_ratio_or_a_product_can_be_known():
    x = np.linspace(0, 1, 20)
    y = 3 * x + np.random.default_rng(0).normal(0, 0.01, 20)
    free = (
        Parameter("stiffness", "N m/rad", 3.0, (0.1, 100.0), ""),
        Parameter("inertia", "kg m^2", 1.0, (0.1, 10.0), ""),
    )
    ratio = fit(lambda p: y - p[0] / p[1] * x, free)
    assert any("only the ratio stiffness/inertia can be known" in w for w in ratio.warnings)
    assert any("does not bound" in w for w in ratio.warnings)
    assert ratio.interval("inertia") == (0.1, 10.0)
    product = fit(lambda p: y - p[0] * p[1] * x, free)
    assert any("only the product stiffness * inertia" in w for w in product.warnings)
    idle = fit(lambda p: y - p[0] * x, free)
    assert any("does not depend on inertia" in w for w in idle.warnings)


# --- crease -----------------------------------------------------------------------------------------------------------


def test_linear_crease_without_noise_is_exact():
    found = fit_crease(ANGLES[::-1], 0.02 * (ANGLES[::-1] - 0.7))
    assert (found["stiffness"], found["rest_angle"]) == pytest.approx((0.02, 0.7), rel=1e-9)


@pytest.mark.slow
def test_table_basis_is_the_effect_of_the_simulator():
    knots = np.random.default_rng(2).normal(size=33)
    angles = np.linspace(-3.6, 3.6, 41)
    table = {("crease_table", "resisting_moment"): knots[None, None]}
    assert table_basis(angles, -math.pi, math.pi) @ knots == pytest.approx(-hinge_moment("crease_table", table, angles))


def law(a):
    return 0.02 * np.sin(a - 0.4) + 0.01 * (a - 0.4)


def test_table_finds_the_law_its_noise_and_its_zero():
    rng = np.random.default_rng(5)
    angles = np.linspace(-1.5, 2.0, 200)
    inside, noises = [], []
    for _ in range(40):
        found = fit_crease_table(angles, law(angles) + rng.normal(0, 2e-4, 200))
        true = law(found.knots)
        inside.append((found.intervals[:, 0] <= true) & (true <= found.intervals[:, 1]))
        noises.append(found.noise)
        assert np.abs(found.moments - true).max() < 4e-4
        assert found.rest_angle == pytest.approx(0.4, abs=0.01)
        assert found.rest_interval[0] < found.rest_angle < found.rest_interval[1]
    assert abs(np.mean(inside) - 0.95) < 0.04
    assert np.mean(noises) == pytest.approx(2e-4, rel=0.05)


def test_table_without_noise_follows_the_curve():
    found = fit_crease_table(np.linspace(-1.5, 2.0, 200), law(np.linspace(-1.5, 2.0, 200)))
    assert np.abs(found.model - found.y).max() < 3e-4 * np.ptp(found.y)  # the law has a third-order error


def test_softening_law_must_be_asked_for():
    angles = np.linspace(-1.5, 2.5, 100)
    with pytest.raises(InputError, match="stiffness would be negative"):
        fit_crease_table(angles, np.sin(1.5 * angles))
    assert fit_crease_table(angles, np.sin(1.5 * angles), falling=True).moments[-1] < 0


# --- relaxation -------------------------------------------------------------------------------------------------------

TRUE = (np.array([0.5, 20.0, 600.0]), np.array([0.35, 0.25, 0.15]), 0.25)


def hold(ramp, scale, rng=None, noise=0.0, series=TRUE, name="test"):
    """A hold computed by stepping the branches over a fine ramp, apart from the closed form of the fit."""
    times, weights, rest = series
    n = 20001
    t = np.linspace(-ramp, 0, n)
    elastic = np.linspace(0, 1, n) ** 0.7
    q = np.zeros(len(times))
    for rise in np.diff(elastic):
        q = (q + rise / 2) * np.exp(-ramp / (n - 1) / times) + rise / 2
    after = np.geomspace(0.02, 1800, 400)
    force = scale * (rest + np.exp(-after[:, None] / times) @ (weights * q))
    if rng is not None:
        force = force * (1 + rng.normal(0, noise, len(after)))
    return Hold(name, after, force, t[::100], elastic[::100])


def test_prony_series_is_recovered_over_four_decades():
    rng = np.random.default_rng(6)
    holds = [hold(2.0, 1.5, rng, 2e-3, name="slow"), hold(1.0, 3.0, rng, 2e-3, name="fast")]
    found = fit_prony(holds)
    assert found.decades > 4
    assert len(found.times) == 3
    assert found.times == pytest.approx(TRUE[0], rel=0.08)
    assert np.append(found.weights, found.rest) == pytest.approx(np.append(TRUE[1], TRUE[2]), abs=0.01)
    assert found.rest_interval[0] < TRUE[2] < found.rest_interval[1]
    assert max(found.held_out.values()) < 4e-3
    assert list(found.scales.values()) == pytest.approx([1.5, 3.0], rel=0.02)
    assert (found.spectrum[1] >= 0).all()
    assert found(0.0) == pytest.approx(1.0)
    k = found.crease_parameters(0.02)
    assert sum(v for (_, n), v in k.items() if n.startswith("stiffness")) == pytest.approx(0.02)


def test_the_ramp_of_a_hold_follows_the_law_of_rubber(tmp_path):
    """A neo-Hookean strip pulled to twice its length: nominal stress over shear modulus is l - 1 / l^2."""
    time = np.concatenate([np.linspace(0, 2, 41), np.linspace(2.1, 200, 100)])
    displacement = np.minimum(time / 2, 1.0) * 40.0  # of 40 mm
    force = np.where(time < 2, time / 2, 1.0) + 0.5 * np.exp(-time / 20)
    file = tmp_path / "hold.csv"
    rows = (f"{t},{d},{f}" for t, d, f in zip(time, displacement, force, strict=True))
    file.write_text("time_s,displacement_mm,force_n\n" + "\n".join(rows))
    hold = read_hold(file, time_unit="s", displacement_unit="mm", force_unit="N", gauge_length=0.04)
    stretch = 1 + (hold.ramp_time + 2) / 2
    whole = stretch <= 1.998  # the ramp counts as ended at 0.999 of its way
    expected = (stretch - 1 / stretch**2) / (2 - 1 / 4)
    np.testing.assert_allclose(hold.ramp_force[whole], expected[whole], atol=2e-3)
    at = np.interp(1.5, stretch, hold.ramp_force)
    assert at == pytest.approx((1.5 - 1 / 2.25) / 1.75, abs=2e-3)  # 0.603; 0.5 if the force were to grow with length


def test_weights_of_correlated_residuals_are_less_certain(monkeypatch):
    """Residuals whose neighbours correlate by r widen a weight's interval by sqrt((1 + r) / (1 - r)), as everywhere."""
    smooth = hold(2.0, 1.0)
    noisy = smooth.force * (1 + 2e-3 * coloured(np.random.default_rng(23), len(smooth.force), 0.95))

    def found():
        return fit_prony([replace(smooth, force=noisy)], terms=3)

    aware = found()
    monkeypatch.setattr(relaxation, "fit", lambda *a, independent, **k: fit(*a, independent=True, **k))
    naive = found()
    rest = aware.y / aware.model - 1
    r = np.corrcoef(rest[1:], rest[:-1])[0, 1]
    assert r > 0.4
    assert not np.any(aware.intervals == 0)  # none is cut off at its bound
    ratio = np.diff(aware.intervals) / np.diff(naive.intervals)
    np.testing.assert_allclose(ratio, math.sqrt((1 + r) / (1 - r)), rtol=0.1)


def test_real_material_is_predicted_at_a_stretch_not_fitted(recordings):
    """VHB 4910: one relative relaxation function for three stretches, over more than four decades."""
    done = command.build(
        [
            "relaxation",
            *(f"vhb_relaxation/relaxation_stretch_{s}.csv" for s in ("1p5", "2p0", "2p5")),
            "--gauge-length=80mm",
        ]
    )
    found = done.fit
    assert found.decades > 4
    assert 4 <= len(found.times) <= 6
    assert max(found.error.values()) < 0.01
    assert max(found.held_out.values()) < 0.012
    assert found(1700.0) / found(0.1) < 0.16  # the force falls to about a fifth of its peak after a ramp of seconds


# --- ring-down --------------------------------------------------------------------------------------------------------


def swing(rng, noise=0.01, inertia=2e-5, stiffness=0.012, viscosity=4e-5, n=400):
    t = np.linspace(0, 2.0, n)
    gamma = viscosity / inertia / 2
    rate = math.sqrt(stiffness / inertia - gamma**2)
    return t, 0.1 + 0.5 * np.exp(-gamma * t) * np.cos(rate * t + 0.3) + rng.normal(0, noise, n)


def test_ring_down_with_inertia_finds_stiffness_and_viscosity():
    found = fit_ring_down(*swing(np.random.default_rng(7)), inertia=2e-5)
    assert found["stiffness"] == pytest.approx(0.012, rel=3e-3)
    assert found["viscosity"] == pytest.approx(4e-5, rel=0.05)
    assert found["rest_angle"] == pytest.approx(0.1, abs=3e-3)
    assert found.warnings == ()


def test_ring_down_without_inertia_says_that_only_ratios_can_be_known():
    found = fit_ring_down(*swing(np.random.default_rng(7)))
    assert found["stiffness_per_inertia"] == pytest.approx(600, rel=3e-3)
    assert found["viscosity_per_inertia"] == pytest.approx(2, rel=0.05)
    assert len(found.warnings) == 1
    assert "combinations stiffness/inertia, viscosity/inertia can be known" in found.warnings[0]


def test_ring_down_intervals_cover():
    rng = np.random.default_rng(8)
    hits = []
    for _ in range(40):
        found = fit_ring_down(*swing(rng, n=120), inertia=2e-5)
        hits.append([lo <= t <= hi for (lo, hi), t in zip(found.intervals, (0.012, 4e-5, 0.1), strict=True)])
    assert (np.mean(hits, axis=0) >= 0.875).all()


def test_ring_down_of_a_real_pendulum(recordings):
    """Late small swings of the single arm: the rate of its published constants, m g a / (I + m a^2)."""
    t, angle = np.loadtxt(recordings / "pendulum_chain" / "single_a.csv", delimiter=",", skiprows=1, unpack=True)
    late = t > t[-1] - 4
    found = fit_ring_down(t[late][::10], angle[late][::10])
    amplitude = (angle[late].max() - angle[late].min()) / 2
    published = 0.14775 * 9.81001 * 0.14758 / (1.0912e-4 + 0.14775 * 0.14758**2)
    assert found["stiffness_per_inertia"] == pytest.approx(published * (1 - amplitude**2 / 8), rel=0.02)


# --- real torque-angle curve ------------------------------------------------------------------------------------------

CREASE = ["crease", "crease_torque/unit075.csv", "--angle-unit=deg", "--moment-unit=N mm"]


def test_real_crease(recordings, tmp_path):
    done = command.build(CREASE)
    found = done.fit
    assert math.degrees(found.rest_angle) == pytest.approx(54.0, abs=0.5)
    assert np.std(found.y - found.model) < 1e-3 * np.ptp(found.y)
    assert (np.diff(found.moments) > 0).all()
    linear = command.build([*CREASE, "--linear", "--within=39,69"]).fit
    assert math.degrees(linear["rest_angle"]) == pytest.approx(54.3, abs=0.6)
    assert linear["stiffness"] == pytest.approx(found.stiffness, rel=0.05)
    assert plot_fit(found, tmp_path / "fit.png").stat().st_size > 1e4


def test_unit_of_the_real_torque_must_be_stated(recordings):
    with pytest.raises(
        InputError, match=r"unit of a column is not stated \(field 'torque'\); allowed: N m, mN m, uN m, N mm"
    ):
        command.build(CREASE[:3])


def test_stored_command_gives_the_stored_values(recordings, tmp_path):
    done = command.build(CREASE)
    path = write_calibration(tmp_path / "crease.toml", done.calibration)
    assert read_result(path) == done.calibration
    assert shlex.split(read_result(path).command)[:3] == ["origami-sim", "calibrate", "crease"]
    rows = command.again(path)
    assert len(rows) == 38 and all(same for *_, same in rows)
    path.write_text(path.read_text().replace("value = 0.0014", "value = 0.0015", 1))
    assert not all(same for *_, same in command.again(path))


def test_shipped_calibrations_are_what_their_commands_give(recordings):
    pytest.importorskip("skfem", reason="scikit-fem is not installed (the [fe] extra)")
    from importlib import resources

    folder = resources.files("origami_sim.calibrations")
    for name in ("crease_unit075", "crease_bridge", "crease_notch", "vhb_relaxation", "vhb_relaxation_crease"):
        rows = command.again(str(folder / f"{name}.toml"), 5e-3)
        assert rows and [r for r in rows if not r[3]] == [], name


def test_summary_rounds_to_the_uncertainty():
    x, y = line(np.random.default_rng(3))
    text = summary(calibration(fit_crease(x, y), title="t", command="c", source="s"))
    assert "stiffness = 0.04999 (0.0487 to 0.05127) N m/rad" in text


# --- bad input --------------------------------------------------------------------------------------------------------

X = np.linspace(0, 1, 30)
BROKEN = np.where(np.arange(30) == 7, np.nan, X)
LONG = np.linspace(0, 3, 300)
ZIGZAG = np.append(X[:20], X[10:20])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: fit_crease([0.0, 1.0], [0.0, 1.0]), ["too few points", "2", "3 or more"]),
        (lambda: fit_crease_table(X[:5], X[:5]), ["too few points", "5", "8 or more"]),
        (lambda: fit_crease(X, -X), ["stiffness would be negative", "stiffness", "-1"]),
        (lambda: fit_crease_table(X, -X), ["stiffness would be negative", "angle"]),
        (lambda: fit_crease(ZIGZAG, ZIGZAG), ["not monotone", "point 21", "one branch"]),
        (lambda: fit_crease(np.r_[X, X[-2::-1]], np.r_[X, X[-2::-1]]), ["not monotone", f"point {len(X) + 1}"]),
        (lambda: fit_crease(-np.r_[X, X[-2::-1]], np.r_[X, X[-2::-1]]), ["not monotone", f"point {len(X) + 1}"]),
        (lambda: fit_crease(0 * X, X), ["not monotone", "point 2"]),
        (lambda: fit_crease(X, BROKEN), ["point 8", "not a finite number", "moment"]),
        (lambda: fit_crease(BROKEN, X), ["point 8", "not a finite number", "angle"]),
        (lambda: fit_crease(X, X[:-1]), ["as many values"]),
        (lambda: fit_crease_table(X, X, ends=(1.0, 0.0)), ["range of angles"]),
        (lambda: fit_prony([]), ["at least one hold"]),
        (lambda: fit_prony([hold(1.0, 1.0)], terms=0), ["number of terms", "1 to 12"]),
        (lambda: fit_prony([Hold("h", X + 1, X + 1, X - 1, X)]), ["does not relax", "would be negative"]),
        (lambda: fit_prony([Hold("h", X + 1, -X, X - 1, X)]), ["held force is positive"]),
        (lambda: fit_ring_down(X, X * 0 + 1), ["no swing"]),
        (lambda: fit_ring_down(X[::-1], np.sin(20 * X)), ["runs backwards"]),
        (lambda: fit_ring_down(X, BROKEN), ["point 8", "finite"]),
        (lambda: fit_ring_down(X[:4], X[:4]), ["too few points"]),
        (lambda: fit_ring_down(X, np.sin(20 * X), inertia=-1.0), ["inertia", "-1.0", "> 0"]),
        (
            lambda: fit_ring_down(LONG, np.exp(LONG) * np.sin(20 * LONG)),
            ["amplitude grows", "viscosity would be negative"],
        ),
        (lambda: fit(lambda p: X[:1] - p, [Parameter("a", "1", 0.0, (0, 1), "")]), ["too few points", "parameters"]),
        (lambda: fit(lambda p: X - p, [Parameter("a", "1", 2.0, (0, 1), "")]), ["out of its bounds", "a", "0 to 1"]),
        (lambda: calibration(3, title="", command="", source=""), ["not a fit"]),
        (lambda: command.build(["crease"]), ["cannot read this command"]),
        (lambda: command.build(["bridge", "--gap=2.54", "--thickness=1mm", "--width=1mm", "--modulus=1MPa"]),
         ["needs a number with its unit", "--gap"]),
        (lambda: command.build(["again", "x.toml"]), ["cannot be 'again'"]),
        (lambda: read_columns("/nowhere.csv", {"a": ("s", "time")}), ["cannot be read", "/nowhere.csv"]),
    ],
)  # fmt: skip
def test_bad_input_is_one_sentence(make, words):
    with pytest.raises(InputError) as error:
        make()
    assert all(w in str(error.value) for w in words), str(error.value)
    assert "\n" not in str(error.value) and str(error.value).count(".") < 12


def test_bad_files_are_one_sentence(tmp_path):
    file = tmp_path / "curve.csv"
    for text, units, words in (
        ("angle,torque\n1,2\n2,x\n", ("deg", "N m"), ["line 3", "torque", "'x'"]),
        ("angle,torque\n1,2\n2\n", ("deg", "N m"), ["line 3", "torque"]),
        ("angle,moment\n1,2\n", ("deg", "N m"), ["no such column", "torque", "angle, moment"]),
        ("angle,torque\n1,2\n", ("deg", "N"), ["unknown unit of moment", "'N'", "mN m"]),
        ("angle,torque\n1,2\n", (None, "N m"), ["unit of a column is not stated", "angle", "deg"]),
        ("", ("deg", "N m"), ["no such column"]),
    ):
        file.write_text(text)
        with pytest.raises(InputError) as error:
            read_columns(file, {"angle": (units[0], "angle"), "torque": (units[1], "moment")})
        assert all(w in str(error.value) for w in [*words, "curve.csv"]), str(error.value)
    t = np.linspace(0, 10, 50)
    for displacement, force, words in (
        (t, 1 / (1 + t), ["no hold"]),
        (np.minimum(t, 1), -t, ["not tensile"]),
    ):
        rows = (f"{a},{b},{c}" for a, b, c in zip(t, displacement, force, strict=True))
        file.write_text("\n".join(["time_s,displacement_mm,force_n", *rows]))
        with pytest.raises(InputError) as error:
            read_hold(file, time_unit="s", displacement_unit="mm", force_unit="N", gauge_length=0.08)
        assert all(w in str(error.value) for w in words), str(error.value)
    with pytest.raises(InputError, match="unit of a column is not stated"):
        read_hold(file, time_unit="s", displacement_unit="mm", force_unit=None, gauge_length=0.08)


def run(words):
    parser = argparse.ArgumentParser()
    command.register(parser)
    return command.run(parser.parse_args(words))


def test_command_line_writes_the_file_and_the_plot(tmp_path, capsys):
    curve, out, png = tmp_path / "swing.csv", tmp_path / "hinge.toml", tmp_path / "hinge.png"
    t, angle = swing(np.random.default_rng(9))
    curve.write_text("\n".join(["time_s,angle_rad", *(f"{a},{b}" for a, b in zip(t, angle, strict=True))]))
    words = ["ring-down", str(curve), "--time-unit=s", "--angle-unit=rad", "--inertia=2e-5", f"--out={out}"]
    assert run([*words, f"--plot={png}"]) == 0
    assert "viscosity = " in capsys.readouterr().out and png.stat().st_size > 1e4
    assert run(["again", str(out)]) == 0
    assert "3 of 3 numbers as stored" in capsys.readouterr().out
    out.write_text(out.read_text().replace("--inertia=2e-05", "--inertia=3e-05"))
    assert run(["again", str(out)]) == 1
    assert run([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["values"]["stiffness"]["unit"] == "N m/rad"
    with pytest.raises(InputError, match="unit of a column is not stated"):
        run(words[:3])

"""Finite elements of an elastomer bridge against beam theory, exact finite bending and the measured end corrections."""

import math
import sys
from itertools import pairwise

import numpy as np
import pytest

from origami_sim.calibrate.result import read_result, write_calibration
from origami_sim.device.scene import read_calibration
from origami_sim.errors import InputError

pytest.importorskip("skfem", reason="scikit-fem is not installed (the [fe] extra)")

from origami_sim.calibrate.fe import (
    Bridge,
    Rubber,
    _Section,
    crease_calibration,
    crease_curve,
    crease_table,
)

H, GAP = 1.27e-3, 2.54e-3
SHEET = Rubber(1.5e6)
PATCHES = {"0.78 MPa": (Rubber(0.78e6), 0.66), "1.98 MPa": (Rubber(1.98e6), 0.52), "rigid": (None, 0.40)}


def strip(length=3e-3, poisson=0.49, share=0.0):
    return Bridge(length, H, Rubber(1.5e6, poisson, share), overlap=0.0)


def rivlin(bend):
    """M / (D kappa) of an incompressible neo-Hookean block bent to curvature kappa, bend = kappa h.

    Rivlin 1949: the stretches of the faces are reciprocal, lambda_o^2 = e^a with sinh a = kappa h, and
    M = mu / (2 kappa^2) (sinh(2 a) / 2 - a); in plane strain a Mooney-Rivlin block is the same.
    """
    a = np.arcsinh(bend)
    return (np.sinh(2 * a) / 2 - a) / (2 * bend**3 / 3)


@pytest.mark.parametrize("poisson", [0.3, 0.49, 0.4999])
@pytest.mark.parametrize("length", [3e-3, 50e-3], ids=["short", "slender"])
def test_bare_strip_is_a_plane_strain_beam_without_locking(poisson, length):
    """A pure moment between free-pulling ends bends a strip of any length as a beam, up to round-off."""
    curve = crease_curve(strip(length, poisson), fineness=1)
    assert curve.effective_length == pytest.approx(length, rel=1e-5)


def test_wide_gap_between_patches_is_a_beam():
    curve = crease_curve(Bridge(100e-3, H, SHEET), fineness=1)
    assert curve.effective_length == pytest.approx(100e-3, rel=0.012)
    assert curve.effective_length == pytest.approx(100e-3 + 2 * curve.end_correction * H, rel=1e-12)


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_finite_bending_is_the_exact_solution(share):
    bend = np.array([0.09, 0.55, 0.83])
    block = strip(poisson=0.4999, share=share)
    curve = crease_curve(block, bend / H * block.gap, fineness=1)
    assert curve.moment / (block.rigidity * bend / H) == pytest.approx(rivlin(bend), rel=2e-4)


def test_tangent_is_the_derivative_of_the_forces():
    section = _Section(Bridge(GAP, H, Rubber(1.5e6, share=0.3), Rubber(0.78e6)), 1)
    rng = np.random.default_rng(0)
    u, du = rng.normal(size=section.size) * 1e-6, rng.normal(size=section.size) * 1e-10
    stiffness = section.assemble(u)[1]
    difference = (section.assemble(u + du)[0] - section.assemble(u - du)[0]) / 2
    assert np.abs(difference - stiffness @ du).max() < 1e-8 * np.abs(stiffness @ du).max()
    assert abs(stiffness - stiffness.T).max() < 1e-10 * abs(stiffness).max()


def test_moment_is_the_derivative_of_the_energy():
    """Work of the moment over the fold against the energy of the section, from an independent formula."""
    bridge = Bridge(GAP, H, Rubber(1.5e6, share=0.3))
    section = _Section(bridge, 1)
    angles = np.linspace(0, 1.2, 25)
    q, moments, energies = section._start(), [0.0], [0.0]
    for a, b in pairwise(angles):
        q, moment = section._increment(a / 2, (b - a) / 2, q)
        moments.append(moment)
        to_all, offset = section._motion(b / 2)
        u = to_all @ q + offset
        total = 0.0
        for part, (op, weight) in enumerate(zip(section.operators, section.weights, strict=True)):
            f = np.einsum("eqkm,em->eqk", op, u[section.dofs]) + np.array([1.0, 0, 0, 1])
            j, i1 = f[..., 0] * f[..., 3] - f[..., 1] * f[..., 2], (f**2).sum(axis=-1) + 1
            density = section.c10 * (j ** (-2 / 3) * i1 - 3) + section.c01 * (j ** (-4 / 3) * (i1 - 1 + j**2) - 3)
            total += ((density if part == 0 else section.bulk / 2 * (j - 1) ** 2) * weight).sum()
        energies.append(2 * total)  # both halves
    work = np.concatenate([[0], np.cumsum((np.array(moments)[1:] + np.array(moments)[:-1]) / 2 * np.diff(angles))])
    assert energies[-1] == pytest.approx(work[-1], rel=1e-3)


@pytest.mark.parametrize("name", PATCHES)
def test_effective_length_follows_the_rule(name):
    """L* = g + 2 c h, c within 10 % of the reference and independent of the gap."""
    patch, expected = PATCHES[name]
    found = [crease_curve(Bridge(g, H, SHEET, patch), fineness=2).end_correction for g in (H, GAP, 4 * H)]
    assert found == pytest.approx([expected] * 3, rel=0.10)
    assert np.ptp(found) < 2e-3


def test_overlap_is_long_enough():
    patch = PATCHES["0.78 MPa"][0]
    found = [
        crease_curve(Bridge(GAP, H, SHEET, patch, overlap=f * (H + 3.175e-3)), fineness=1).end_correction
        for f in (3, 4, 6)
    ]
    assert np.ptp(found) < 3e-3


def test_mesh_converges():
    """The corner under the patch's edge is singular: the order lies between 1 and 2 (that of smooth fields is 4)."""
    found = np.array([crease_curve(Bridge(GAP, H, SHEET), fineness=f).end_correction for f in (1, 2, 3, 4)])
    steps = np.abs(np.diff(found))
    orders = np.log2(steps[:-1] / steps[1:])
    assert ((orders > 0.9) & (orders < 2.2)).all()
    assert steps[-1] < 0.01 * found[-1]


def test_fold_beyond_a_right_angle_both_ways():
    """The moment rises throughout; the bridge softens more towards the patches than away from them."""
    moments, curve = crease_table(Bridge(GAP, H, SHEET), 0.0254, fineness=1)
    angles = np.linspace(-math.radians(100), math.radians(100), 33)
    assert (np.diff(moments) > 0).all()
    assert moments[16] == pytest.approx(0, abs=1e-12)
    assert np.gradient(moments, angles)[16] == pytest.approx(0.0254 * curve.stiffness, rel=5e-3)
    ratio = moments / (0.0254 * curve.stiffness * np.where(angles == 0, 1, angles))
    assert 0.75 < ratio[-1] < 0.9 and 0.9 < ratio[0] < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("name", PATCHES)
def test_law_at_large_angles_is_converged(name):
    """Under rigid patches the compressed surface at the patch's edge creases (stretch below 0.65, Biot 1963) from about
    60 deg on, towards the patches; a mesh resolves that late, so this case needs one mesh more."""
    patch, _ = PATCHES[name]
    meshes = (2, 3) if patch is None else (1, 2)
    coarse, fine = (crease_table(Bridge(GAP, H, SHEET, patch), 1.0, fineness=f)[0] for f in meshes)
    assert np.abs(coarse - fine).max() < 0.02 * np.abs(fine).max()


def test_calibration_is_written_and_read(tmp_path):
    found = crease_calibration(Bridge(GAP, H, SHEET), 0.0254, command="origami-sim calibrate bridge", fineness=1)
    assert any("touch at about 37 deg" in w for w in found.warnings)
    path = write_calibration(tmp_path / "crease.toml", found)
    assert read_result(path) == found
    assert read_calibration(path).stiffness == found["stiffness"].value


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Bridge(-1e-3, H, SHEET), ["positive dimensions", "gap", "-0.001"]),
        (lambda: Bridge(2.54, H, SHEET), ["slip of the unit", "gap", "2.54"]),
        (lambda: Bridge(GAP, H, SHEET, overlap=math.nan), ["overlap"]),
        (lambda: Rubber(-1.5e6), ["positive modulus"]),
        (lambda: Rubber(1.5e6, 0.5), ["poisson", "0.5", "0.3 to 0.4999"]),
        (lambda: Rubber(1.5e6, share=2.0), ["share"]),
        (lambda: crease_curve(strip(), [4.0]), ["between -pi and pi"]),
        (lambda: crease_curve(strip(), [math.nan]), ["between -pi and pi"]),
        (lambda: crease_curve(strip(), fineness=9), ["mesh", "fineness"]),
        (lambda: crease_table(strip(), 0.0), ["positive width"]),
        (lambda: crease_table(strip(), 1.0, largest=4.0), ["end of a table"]),
    ],
)
def test_bad_input_is_one_sentence(make, words):
    with pytest.raises(InputError) as error:
        make()
    assert all(w in str(error.value) for w in words) and "\n" not in str(error.value)


def test_without_scikit_fem_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "skfem", None)
    with pytest.raises(InputError, match=r"origami-sim\[fe\]"):
        crease_curve(strip())

"""Real chains: held-out error of the published model, of its refit and of what the diagnosis named.

    python benchmarks/pendulum_held_out.py path/to/pendulum_chain/double.csv
    python benchmarks/pendulum_held_out.py path/to/pendulum_chain/single_a.csv path/to/pendulum_chain/single_b.csv

Of the double chain half of the segments are fitted and the others predicted: first half and second half, odd and even
segments, both ways; of the single chain one recording is fitted and the other predicted. Only the starts of predicted
segments are adapted. The block-energy error is the error of the change of energy over a segment, with the published
masses. Which effects are fitted was found on all of the data: what is held out are their numbers, not the choice.
"""

import argparse

import numpy as np

from origami_sim.device.scene import read_calibration, scene_module
from origami_sim.diagnose import Options, Subject
from origami_sim.diagnose.arrange import arranged
from origami_sim.diagnose.command import read_recordings
from origami_sim.diagnose.prepare import prepared
from origami_sim.fit.least_squares import fit
from origami_sim.fit.nominal import nominal_fits
from origami_sim.hypotheses.hypothesis import Hypothesis
from origami_sim.hypotheses.suspects import suspects
from origami_sim.predict.starts import local_line
from origami_sim.recording.rigid_pendulum import PUBLISHED_DOUBLE as P

SPREADS = {
    "mass_1": 0.00094, "centre_1": 0.0011, "inertia_1": 4.4e-5, "inertia_2": 1.3e-4, "viscosity_1": 1.2e-4,
    "viscosity_2": 2e-5, "gravity": 0.01,
}  # fmt: skip
NAMED = {
    "air drag on arm 2": ("air_drag at arm2",),
    "dry friction in both hinges": ("crease_friction at all creases",),
    "dry friction and air drag": ("crease_friction at all creases", "air_drag at arm2"),
}

SINGLE = {
    "mass_2": 0.0, "length_1": 0.295, "mass_1": 0.14775, "centre_1": 0.14758, "inertia_1": 1.0912e-4,
    "viscosity_1": 2.2394e-4, "gravity": 9.81,
}  # fmt: skip
SINGLE_SPREADS = {
    "mass_1": 0.0014775, "centre_1": 0.00029516, "inertia_1": 2.18e-5, "viscosity_1": 1.12e-4, "gravity": 0.01,
}  # fmt: skip
SINGLE_NAMED = {"dry friction of the hinge": ("crease_friction at crease 0",)}


def energy(angle: np.ndarray, rate: np.ndarray) -> float:
    """Energy of the chain with the published masses [J]; angles from the upright [rad]."""
    (a, b), (v, w) = angle, rate
    kinetic = 0.5 * (P.I1 + P.m1 * P.a1**2 + P.m2 * P.L1**2) * v**2 + 0.5 * (P.I2 + P.m2 * P.a2**2) * w**2
    kinetic += P.m2 * P.L1 * P.a2 * np.cos(a - b) * v * w
    return kinetic + P.g * ((P.m1 * P.a1 + P.m2 * P.L1) * np.cos(a) + P.m2 * P.a2 * np.cos(b))


def change(times: np.ndarray, values: np.ndarray, noise: np.ndarray) -> float:
    """Change of energy over a segment [J], from local polynomials near its ends."""
    seen = np.flatnonzero(np.all(np.isfinite(values), axis=1))
    ends = [energy(*local_line(times, values, noise, int(n))[:2]) for n in (seen[12], seen[-13])]
    return ends[1] - ends[0]


def doubled(file: str):
    """Forward model of the double chain, and how its segments are split into those fitted and those predicted."""
    recordings = prepared(list(read_recordings([file])), 200.0)
    subject = Subject.from_scene(scene_module("pendulum_chain"), read_calibration("pendulum_chain"), spreads=SPREADS)
    forward, _ = arranged(subject, recordings, Options(segment=2.0))
    blocks = np.arange(len(forward.blocks))
    halves = [list(map(int, h)) for h in np.array_split(blocks, 2)]
    turns = [list(map(int, blocks[k::2])) for k in range(2)]
    splits = {
        "second half": (halves[0], halves[1]),
        "first half": (halves[1], halves[0]),
        "odd segments": (turns[0], turns[1]),
        "even segments": (turns[1], turns[0]),
    }
    return forward, splits


def single(files: list[str]):
    """The same of the single chain: numbers that one recording tells predict the other."""
    recordings = prepared(list(read_recordings(files)), 200.0)
    settings = read_calibration("pendulum_chain").replace(**SINGLE)
    subject = Subject.from_scene(scene_module("pendulum_chain"), settings, spreads=SINGLE_SPREADS)
    forward, _ = arranged(subject, recordings, Options())
    one, other = ([n for n, b in enumerate(forward.blocks) if b.recording == r] for r in range(2))
    return forward, {recordings[1].name: (one, other), recordings[0].name: (other, one)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", metavar="RECORDING")
    files = parser.parse_args().files
    forward, splits = single(files) if len(files) > 1 else doubled(files[0])
    named = SINGLE_NAMED if len(files) > 1 else NAMED
    _, base, weights = nominal_fits(forward)
    found = {s.label: s for s in suspects(forward.model, forward.recordings, forward.drive, forward.parameters)}
    given = np.array([f.start for f in forward.subject.nominals])
    names = list(forward.recordings[0].channels)
    print(f"rms of angles [mrad]; {len(forward.blocks)} segments of {forward.blocks[0].times[-1]:.2f} s")
    energies = "" if len(files) > 1 else "  block energy"
    print(f"{'model':34s}{'held out':>16s}{''.join(f'{n:>10s}' for n in names)}{energies}")
    for name, labels in {"published": None, "refitted": (), **named}.items():
        for held, (train, test) in splits.items():
            hypothesis = Hypothesis(tuple(found[s] for s in labels or ()))
            theta = given
            if labels is not None:
                start = np.concatenate([base.theta, *([0.3 * f.scale] for s in hypothesis.suspects for f in s.free)])
                theta = fit(forward, hypothesis, weights, theta=start, local=base.local, blocks=train, most=8).theta
            f = fit(forward, hypothesis, weights, theta=theta, local=base.local, blocks=test, fixed=True)
            rms = np.sqrt(np.nanmean(np.concatenate(f.residuals) ** 2, axis=0)) * 1e3
            text = f"{name:34s}{held:>16s}" + "".join(f"{v:10.2f}" for v in rms)
            print(text + (f"{missed_energy(forward, f):11.1f} uJ" if len(files) == 1 else ""), flush=True)


def missed_energy(forward, f) -> float:
    """Error of the change of energy over a segment, root mean square [uJ]."""
    misses = []
    for b, r in zip(f.blocks, f.residuals, strict=True):
        block = forward.blocks[b]
        predicted, recorded = (change(block.times, v, block.noise) for v in (block.values - r, block.values))
        misses.append(predicted - recorded)
    return float(np.sqrt(np.mean(np.square(misses))) * 1e6)


if __name__ == "__main__":
    main()

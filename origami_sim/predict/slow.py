"""What a hypothesis predicts for slow motions with a clock: equilibria along time, for many worlds at once."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from origami_sim.drive import Drive
from origami_sim.effects import get
from origami_sim.errors import InputError
from origami_sim.hypotheses.hypothesis import Hypothesis, Subject
from origami_sim.model import Model, Parameters, State
from origami_sim.model.distort import distorted
from origami_sim.observation.channels import depths, turned_axes
from origami_sim.predict.curves import PIECES, Balance, Curves, channels_of, measures_force
from origami_sim.predict.measured import measured
from origami_sim.predict.track import coordinates
from origami_sim.predict.worlds import World
from origami_sim.recording import Recording
from origami_sim.solve.motion.quasistatic import TOLERANCE, March, knots
from origami_sim.solve.statics.held import Held
from origami_sim.solve.statics.settling import levels, per_world, settling

ACCURATE = 0.03
"""Error of a step over the noise of the channel that sees best: with half or twice as much no fit changes."""

FINEST, COARSEST = 1e-8, 1e-3
"""Limits of it, as a part of the device's size: rounding, and what a step may go wrong however noisy a recorder is."""

CLOSE = 1e-8
"""Error over the size of the device up to which a place is an equilibrium: a thousandth of what differences see."""

SHORTEST = 2.0**-6
"""Shortest step, as a part of the interval between two frames; when within it a snap happened, no frame tells."""

MOVING = {"rate", "v", "v1", "v2", "v3", "speed", "velocity"}
"""Arguments of laws of the rate."""


class Slow(Curves):
    """A `Predictor` of motions so slow that inertia does not show: equilibria along time.

    Laws with memory advance exactly between frames, laws of the rate act with the velocity at the end of a step, and
    steps are cut until their error is small against the noise, in all worlds of a batch alike. A recording begins where
    the device had rested for ever without a drive, which comes on at the first frame; or, if its start is stated as
    "equilibrium", in the drive of the first frame.

    Args:
        panels: "rigid" for panels that do not bend; "": as the subject builds them. The rest as for `Curves`.

    Raises:
        InputError: a start other than "equilibrium"; what rigid panels refuse.
    """

    turning = True

    def __init__(
        self,
        subject: Subject,
        recordings: Sequence[Recording],
        *,
        pieces: int = PIECES,
        panels: str = "",
        threads: int | None = None,
    ):
        made = subject.with_rigid_panels() if panels == "rigid" else subject
        super().__init__(made, recordings, pieces=pieces, threads=threads)
        self.panels = self.model.panels
        for r in self.recordings:
            if r.start is not None and r.start.state != "equilibrium":
                raise InputError(
                    "a quasi-static motion begins at rest",
                    file=r.metadata.get("sidecar"),
                    field="start",
                    value=r.start.state,
                    allowed="'equilibrium' (in the first frame's drive), or none (it had rested without a drive)",
                )

    def _default(self) -> Drive:
        return self.drive

    def _curve(self, r: int, worlds) -> np.ndarray:
        recording, model = self.recordings[r], worlds[0][0]
        states, alive, drive = self._followed(r, worlds)
        drives = None
        if measures_force(recording):
            at = recording.times - recording.times[0]
            given = np.stack([levels(drive, float(t), len(worlds)) for t in at], axis=1)
            drives = [per_world(drive, given[:, :, w]) for w in range(len(worlds))]
        out = channels_of(recording, worlds, states, alive, drives)
        x = np.stack([s.x for s in states])
        more = [depths(model, recording, x)]
        if any(get(e).on_body for e in model.effects):
            more.append(turned_axes(model, recording, x))
        return np.concatenate([out, *more], axis=1)

    def _followed(self, r: int, worlds: Sequence[World]) -> tuple[list[State], np.ndarray, Drive]:
        """States of all worlds at the frames, whether they have an equilibrium [n, K], and the drive that acts."""
        recording, model, count = self.recordings[r], worlds[0][0], len(worlds)
        at = recording.times - recording.times[0]
        commanded = self.drives[r]
        instants = np.unique(np.concatenate([at, knots(commanded, at)]))
        joint = Parameters.join([p for _, p in worlds])
        drive = distorted(model, joint, commanded.on(instants), float(at[-1]))
        state = State.at_rest(model, count, position=np.stack([m.position for m, _ in worlds], axis=1), placed=True)
        viscous = any(MOVING & set(get(e).arguments) for e in model.laws)
        options = {"among": self.shared, "threads": self.threads, "system": self._system(model, worlds)}
        search = settling(worlds, drive, state, keeping=True, viscous=viscous, **options)
        search.close = CLOSE
        tolerance = self._tolerance(r) if viscous or search.held.remembers else None
        march = March(search, drive, tolerance, shortest=SHORTEST)
        rested = drive if recording.start is not None else _silenced(drive)
        march.begin(state, 0.0, levels(rested, 0.0, count))
        states, alive = [march.state], [march.alive]
        for i, instant in enumerate(at[1:], 1):
            for end in instants[(instants > at[i - 1]) & (instants <= instant)]:
                march.go(float(end), i)
            states.append(march.state)
            alive.append(march.alive)
        return states, np.stack(alive), drive

    def _tolerance(self, r: int) -> float:
        """Error of a step, as a part of the device's size."""
        size = float(np.ptp(self.model.position, axis=0).max()) or 1.0
        seen = [
            c.noise / (1.0 if c.is_angle else size) for c in self.recordings[r].channels.values() if c.kind != "force"
        ]
        return float(np.clip(ACCURATE * min(seen), FINEST, COARSEST)) if seen else TOLERANCE

    def _read(self, worlds, recording: Recording, curve: np.ndarray) -> np.ndarray:
        model = worlds[0][0]
        dims = sum(1 if c.values.ndim == 1 else c.values.shape[1] for c in recording.channels.values())
        distort = [e for e in model.effects if get(e).family == "measurement" and get(e).apply is not None]
        if not distort:
            return curve[:, :dims]
        at, count = recording.times - recording.times[0], len(worlds)
        joint = Parameters.join([p for _, p in worlds])
        return measured(joint, recording, distort, at, curve, at, np.zeros(count), rested=True)

    # --- equation error

    def balance(self, hypothesis: Hypothesis, theta: np.ndarray) -> list[Balance]:
        """At the recorded angles, led along in time: moments that balance each crease beyond what the model gives."""
        found = []
        if len(self.articulation.open):
            return found
        for r, recording in enumerate(self.recordings):
            given = coordinates(self, r)
            if given is None:
                return []
            q, noise = given
            world = self.world(hypothesis, theta, hypothesis.effects)
            # the recorded angles, and each of them a little further, for the error of the moment
            moves = np.concatenate([np.zeros((1, len(q))), 1e-5 * np.eye(len(q))])
            moments, drive = self._moments(r, *world, q[:, :, None] + moves.T[:, None])
            slope = (moments[:, :, 1:] - moments[:, :, :1]) / 1e-5
            error = np.sqrt(np.einsum("knj,j->kn", slope**2, noise**2))
            at = recording.times - recording.times[0]
            against = {n: np.array([levels(drive, float(t), 1)[k, 0] for t in at]) for k, n in enumerate(drive.signals)}
            against = {n: v for n, v in against.items() if np.ptp(v) > 0}
            names = self.articulation.names()
            found.append(Balance(names, recording.times, q, moments[:, :, 0], error, {**against, "time": at}))
        return found

    def _moments(self, r: int, model: Model, parameters: Parameters, q: np.ndarray) -> tuple[np.ndarray, Drive]:
        """Missing moments [m, n, W] along coordinates [m, n, W], and the drive that acts."""
        arm, at = self.articulation, self.recordings[r].times - self.recordings[r].times[0]
        m, frames, worlds = q.shape
        pose = arm.moved(arm.reference(frames * worlds), q.reshape(m, -1) - arm.reference().angles)
        x = arm.positions(pose)
        by = arm.jacobian(pose, x).reshape(m, -1, frames, worlds, 3)
        x, rate = x.reshape(-1, frames, worlds, 3), np.gradient(q, at, axis=1)
        drive = distorted(model, parameters, self.drives[r].on(at), float(at[-1]))
        state = State.at_rest(model, worlds, position=x[:, 0])
        every = per_world(drive, levels(drive, 0.0, worlds))
        held = Held(model, parameters, every, state, among=self.shared, threads=self.threads)
        out = np.empty((m, frames, worlds))
        for k in range(frames):
            held.batch.hold(levels(drive, float(at[k]), worlds))
            dt = float(at[k] - at[k - 1]) if k else 1.0
            velocity = np.einsum("mnwa,mw->nwa", by[:, :, k], rate[:, k])
            force = held.force(state, x[:, k], dt, float(at[k]), velocity)
            out[:, k] = -np.einsum("mnwa,nwa->mw", by[:, :, k], force)
            state = held.batch.state()
        return out, drive

    # --- experiments

    def menu(self, levels: Sequence[float]) -> list[tuple[str, Curves]]:
        out = super().menu(levels)
        for speed in (0.1, 10.0):
            other = self._other()
            other.recordings = [replace(r, times=r.times / speed) for r in self.recordings]
            other.drives = [_paced(d, speed) for d in self.drives]
            out.append((f"the same at {speed:g} times the speed", other))
        return out


def restless(recordings: Sequence[Recording], drives: Sequence[Drive]) -> list[str]:
    """Sentences on recordings that begin under a drive, of which nobody says since when it acts."""
    out = []
    for r, d in zip(recordings, drives, strict=True):
        if r.start is None and any(np.any(d[n](0.0)) for n in d.levels):
            out.append(
                f"'{r.name}' begins under a drive, which is taken to have come on at its first frame: state start = "
                '"equilibrium" if the device had rested in it.'
            )
    return out


def _silenced(drive: Drive) -> Drive:
    """Nothing but the device's age, and sources without strength."""
    return drive.replace(**dict.fromkeys(drive.levels, 0.0))


def _paced(drive: Drive, speed: float) -> Drive:
    """The drive at another speed."""
    return drive.replace(
        **{
            n: replace(s, frequency=speed * np.asarray(s.frequency), times=None if s.times is None else s.times / speed)
            for n, s in drive.signals.items()
        }
    )

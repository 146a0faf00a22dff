"""What a hypothesis predicts for motions that were prescribed: the moment that holds each crease along a known path."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from origami_sim.errors import InputError
from origami_sim.hypotheses.hypothesis import Hypothesis, Subject
from origami_sim.model import Parameters, State
from origami_sim.model.articulation import Articulation
from origami_sim.model.distort import distorted
from origami_sim.observation.attachments import index_of
from origami_sim.observation.channels import PATH
from origami_sim.predict.curves import HOLD, PIECES, Balance, Curves, Static
from origami_sim.recording import Recording
from origami_sim.solve.batch import Batch
from origami_sim.solve.statics.settling import levels, per_world

KIND = "moment"
"""Kind of the channels that are predicted: the moment applied to a crease, positive towards valley."""


class Prescribed(Curves):
    """Moments along prescribed fold angles, in time or by load step.

    All panels move as rigid bodies, exactly as prescribed; the moment is that which holds the crease against all
    effects, slow enough for inertia not to count. Between frames angles change evenly, so that laws with memory follow
    the path exactly at any length of step. Load steps take as long as anything may take to relax, and show no rate.

    Raises:
        InputError: a recording without prescribed angles, or with other channels than moments, of another number of
            creases than the model has, or a model whose root panel is not held.
    """

    prescribed = True

    def __init__(
        self, subject: Subject, recordings: Sequence[Recording], *, pieces: int = PIECES, threads: int | None = None
    ):
        super().__init__(subject, recordings, pieces=pieces, threads=threads)
        arm = self.articulation
        if arm.floating or len(arm.open):
            raise InputError(
                "angles can be prescribed only where a panel is held and creases close no loop", field="model"
            )
        self._q: list[np.ndarray] = []
        for r in self.recordings:
            if PATH not in r.drive:
                raise InputError(
                    "all recordings need a prescribed angle, or none", field=f"{r.name}.drive", allowed=PATH
                )
            given = r.drive[PATH].at(r.times).reshape(len(r.times), -1).T
            if len(given) != arm.size:
                raise InputError(
                    "the prescribed angles are not those of the model's creases",
                    field=f"{r.name}.drive.{PATH}",
                    value=len(given),
                    allowed=f"{arm.size} columns",
                )
            self._q.append(np.array(given))
            for c in r.channels.values():
                if c.kind != KIND:
                    raise InputError(
                        "a prescribed motion is compared by its moments",
                        field=f"channels.{c.name}.kind",
                        value=c.kind,
                        allowed=KIND,
                    )

    def _driven(self, recording: Recording) -> Recording:
        return replace(recording, drive={n: d for n, d in recording.drive.items() if n != PATH})

    def _curve(self, r: int, worlds) -> np.ndarray:
        recording, q = self.recordings[r], self._q[r]
        model, parameters = worlds[0][0], Parameters.join([p for _, p in worlds])
        frames, count = q.shape[1], len(worlds)
        x, jacobian = self._along(worlds, q)
        times = recording.times - recording.times[0]
        rate = np.zeros_like(q) if recording.by_step else np.gradient(q, times, axis=1)
        drive = distorted(model, parameters, self.drives[r], float(times[-1]))
        still = replace(model, free=np.zeros_like(model.free))
        state = State.at_rest(model, count, position=x[:, 0])
        every = per_world(drive, levels(drive, 0.0, count))
        batch = Batch(still, parameters, every, state, threads=self.threads, among=self.shared, supports=model)
        moments = np.empty((len(q), frames, count))
        steady = drive.constant
        for k in range(frames):
            if not steady:
                batch.hold(levels(drive, float(times[k]), count))
            if k:
                batch.lead(x[:, k], HOLD if recording.by_step else float(times[k] - times[k - 1]))
            velocity = np.einsum("mnwa,m->nwa", jacobian[:, :, k], rate[:, k])
            batch._overwrite(batch._v, velocity)
            force = batch.total_force(float(times[k]))
            moments[:, k] = -np.einsum("mnwa,nwa->mw", jacobian[:, :, k], force)
        rows = [self._row(c) for c in recording.channels.values()]
        return moments[rows].swapaxes(0, 1)

    def _along(self, worlds, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions [N, n, K, 3] and their derivatives by the angles [m, N, n, K, 3]."""
        known: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}
        for model, _ in worlds:
            key = model.position.tobytes()
            if key not in known:
                arm = Articulation(model)
                pose = arm.moved(arm.reference(q.shape[1]), q - arm.reference().angles)
                x = arm.positions(pose)
                known[key] = x, arm.jacobian(pose, x)
        each = [known[m.position.tobytes()] for m, _ in worlds]
        return np.stack([x for x, _ in each], axis=2), np.stack([j for _, j in each], axis=3)

    def _row(self, channel) -> int:
        """The coordinate of a channel's crease."""
        crease = index_of(self.model, channel, "crease", len(self.model.creases))
        return int(np.flatnonzero(self.articulation.creases == crease)[0])

    def inputs(self):
        yield from super().inputs()
        yield from self._q

    def balance(self, hypothesis: Hypothesis, theta: np.ndarray) -> list[Balance]:
        """The moments that are missing at each crease: modelled less recorded, positive towards valley."""
        found, names = [], self.articulation.names()
        predicted = self.predict(hypothesis, theta[None])
        for r, recording in enumerate(self.recordings):
            mine = [n for n, b in enumerate(self.blocks) if b.recording == r]
            missing = np.concatenate([predicted[n][0] - self.blocks[n].values for n in mine]).T
            noise = np.array([c.noise for c in recording.channels.values()])
            rows = [self._row(c) for c in recording.channels.values()]
            error = np.broadcast_to(noise[:, None], missing.shape)
            clock = {} if recording.by_step else {"time": recording.times - recording.times[0]}
            own = [names[k] for k in rows]
            found.append(Balance(own, recording.times, self._q[r][rows], missing, error, clock))
        return found

    def menu(self, levels: Sequence[float]) -> list[tuple[str, Curves]]:
        out = super().menu(levels)
        rest = self.articulation.reference().angles
        changes = [
            ("half of the angles", [rest + 0.5 * (q - rest) for q in self._q]),
            ("the same angles to the other side", [rest - (q - rest) for q in self._q]),
            ("there and back in the same time", [_returning(q) for q in self._q]),
        ]
        for what, paths in changes:
            other = self._other()
            assert isinstance(other, Prescribed)
            other._q = paths
            out.append((what, other))
        if not any(r.by_step for r in self.recordings):
            for speed in (0.1, 10.0):
                other = self._other()
                other.recordings = [replace(r, times=r.times / speed, drive={}) for r in self.recordings]
                out.append((f"the same angles at {speed:g} times the speed", other))
        return out


def _returning(q: np.ndarray) -> np.ndarray:
    """A path [m, n] that goes to its end in half of the frames and comes back in the other half."""
    n = q.shape[1]
    return q[:, np.round(np.interp(np.arange(n), [0, (n - 1) / 2, n - 1], [0, n - 1, 0])).astype(int)]


def curves(subject: Subject, recordings: Sequence[Recording], threads: int | None = None) -> Curves | None:
    """Predictions for recordings that are curves; None for motions in time.

    Raises:
        InputError: curves among motions.
    """
    if any(PATH in r.drive for r in recordings):
        return Prescribed(subject, recordings, threads=threads)
    stepped = [r.by_step for r in recordings]
    if all(stepped):
        return Static(subject, recordings, threads=threads)
    if any(stepped):
        raise InputError(
            "quasi-static curves and motions in time cannot be diagnosed together",
            field="recordings",
            value=", ".join(r.name for r in recordings if r.by_step),
        )
    return None

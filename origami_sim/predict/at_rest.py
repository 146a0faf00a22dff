"""Whether recordings begin at rest in the model's reference state, before anything is simulated."""

import numpy as np

from origami_sim.hypotheses.hypothesis import Subject
from origami_sim.model.articulation import Articulation
from origami_sim.observation.channels import stacked, units_of
from origami_sim.observation.rates import local_line
from origami_sim.predict.starts import channel_tangent
from origami_sim.recording import Recording

WINDOW = 10
"""Frames about whose parabola the scatter of a recording is taken."""


def starting(subject: Subject, recordings: list[Recording]) -> str:
    """ "rest" if all recordings begin at rest in the reference state, else "fit"."""
    model, *_ = subject.build({f.name: f.start for f in subject.nominals})
    arm = Articulation(model)
    for recording in recordings:
        values, noise = stacked(recording)
        head = slice(0, max(4, len(values) // 100))
        now, _ = channel_tangent(model, arm, recording, arm.reference(), values[0])
        # a start on the ground is better guessed than fitted: where feet touch turns on micrometres
        standing = arm.floating and len(model.contacts) and len(set(units_of(recording))) == 1
        if standing and len(values) >= 4 * WINDOW:  # a tracker that smooths hides its noise from the next frames
            noise = np.maximum(noise, np.sqrt(np.nan_to_num(np.nanmedian(scatter(values), axis=0))))
        with np.errstate(invalid="ignore"):
            begun = np.nanmedian(values[head], axis=0)
            away = begun - now
            drift = 1.4826 * np.nanmedian(np.abs(values[head] - begun), axis=0)  # whatever one frame shows
        scale = np.maximum(np.nanstd(values, axis=0), 5 * noise)
        # what does not move at all, such as a marker across the plane of a motion, scatters by its noise
        moves = np.hypot(np.maximum(0.2 * scale, 0.05 * scale.max() if standing else 0.0), 3 * noise)
        near = np.maximum(0.05 * scale, 5 * noise)
        still = np.all(np.abs(away) <= near) and np.all(drift <= moves)
        if not still and not _just_begun(recording.times, values, noise, now, near):
            return "fit" if arm.size else "rest"
    return "rest"


def scatter(values: np.ndarray) -> np.ndarray:
    """(K, D) variance of values (n, D) about a parabola over each window; nan where a frame of it is missing."""
    parts = values[: len(values) // WINDOW * WINDOW].reshape(-1, WINDOW, values.shape[1])
    q, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, WINDOW), 3))
    fast = parts - np.einsum("ij,kj,nkd->nid", q, q, parts)
    return np.sum(fast**2, axis=1) / (WINDOW - 3)


def _just_begun(times: np.ndarray, values: np.ndarray, noise: np.ndarray, reference: np.ndarray, near) -> bool:
    """Whether a motion that is under way within a few frames was at rest in its first, near the reference."""
    level, rate, error = local_line(times, values, noise, 0)
    fast = np.nanstd(np.gradient(values, times, axis=0), axis=0)
    calm = (np.abs(level - reference) <= near) & (np.abs(rate) <= np.maximum(0.05 * fast, 4 * error))
    return bool(np.all(calm & (error < 0.5 * fast)))

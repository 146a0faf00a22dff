"""A hanging strip of panels, and recordings of it with a known effect: constructed cases for every stage."""

import numpy as np

from origami_sim.design.build import Sheet
from origami_sim.diagnose import Subject, factor
from origami_sim.drive import Drive
from origami_sim.model import Model, Parameters, State
from origami_sim.model.articulation import Articulation
from origami_sim.pattern import strip
from origami_sim.recording import Recording
from origami_sim.recording.recording import Channel
from origami_sim.solve.motion.dynamics import simulate


def hanging(panels: int = 4) -> tuple[Model, Parameters]:
    """Panels of 30 mm that hang from a held one on creases of 0.2 mN m/rad."""
    pattern = strip([0.03] * panels, 0.03)
    pattern.vertices = pattern.vertices[:, [2, 1, 0]] * (1, 1, -1)
    sheet = Sheet(pattern, thickness=1.5e-3, material="pdms", triangulation="center")
    sheet.fix(panels=[0])
    sheet.on("bars").set("bars", stiffness=1000.0)
    sheet.set("panel_bending", stiffness=1.0)
    sheet.crease(range(panels - 1), stiffness=2e-4)
    sheet.set("crease_viscosity", viscosity=4e-6)
    sheet.gravity((0, 0, -9.80665))
    sheet.membrane_damping = 0.0
    return sheet.build()


def subject(panels: int = 4) -> Subject:
    """The strip with 5 % of doubt in the creases, 30 % in their loss and 3 % in the mass."""
    known = [
        factor("crease.stiffness", 0.05),
        factor("crease_viscosity.viscosity", 0.3),
        factor("inertia.mass", 0.03),
    ]
    return Subject.from_model(*hanging(panels), None, known)


def record(
    effects=None,
    *,
    panels=4,
    factors=None,
    seed=0,
    duration=6.0,
    rate=200,
    noise=2e-3,
    size=1.0,
    scale=1.0,
    name="swing",
) -> Recording:
    """A free swing with concealed effects {effect: {parameter: (value, creases or None)}} and a tracker's noise.

    The tracker rounds to half its noise; `factors` multiplies parameters, `scale` the angles that are written down.
    """
    model, parameters = hanging(panels)
    richer = model.with_effects(*(effects or {}))
    parameters = parameters.for_model(richer)
    for effect, values in (effects or {}).items():
        for key, (value, entities) in values.items():
            parameters.set(effect, key, value, None if entities is None else np.array(entities))
    for (owner, key), by in (factors or {}).items():
        parameters.set(owner, key, parameters[owner, key] * by)
    arm, rng = Articulation(model), np.random.default_rng(seed)
    start = size * np.resize([0.9, -0.7, 0.8], arm.size)[:, None] * (1 + 0.1 * rng.normal(size=(arm.size, 1)))
    state = State.at_rest(richer, position=arm.positions(arm.moved(arm.reference(), start))[:, 0])
    motion = simulate(richer, parameters, Drive(), duration=duration, rate=rate, state=state)
    assert not motion.failures
    channels = {}
    for c in range(panels - 1):
        read = scale * motion.creases[:, c, 0] + noise * rng.normal(size=len(motion.times))
        read = np.round(read / (noise / 2)) * (noise / 2)
        channels[f"fold{c + 1}"] = Channel(f"fold{c + 1}", "crease_angle", read, "rad", 1.02 * noise, {"crease": c})
    return Recording(name, motion.times, channels)

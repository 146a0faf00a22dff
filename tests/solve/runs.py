"""Rollouts of so many steps."""

from effects.kit import quiet

from origami_sim.solve.motion.dynamics import simulate

G = 9.80665


def run(model, values, *, steps, dt, frames=1, drive=None, **options):
    """So many steps of dt, reported in so many frames."""
    return simulate(
        model,
        values if hasattr(values, "worlds") else quiet(model, values),
        drive,
        dt=dt,
        duration=steps * dt,
        rate=frames / (steps * dt),
        **options,
    )

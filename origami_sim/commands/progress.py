"""How far a command is, on standard error: a line where somebody watches, and where nobody does what long runs need."""

import sys
import time

LONG = 30.0
"""Seconds after which a run that nobody watches says once how long it will take, as one that is watched always does."""


class Bar:
    """A progress line on standard error, with the time that is left."""

    def __init__(self, label: str):
        self.label, self.shown, self.began = label, "", time.perf_counter()
        self.watched, self.told = sys.stderr.isatty(), False

    def __call__(self, fraction: float):
        spent = time.perf_counter() - self.began
        left = spent * (1.0 - fraction) / fraction if fraction > 0 else 0.0
        if not self.watched:
            if spent > LONG and 0 < fraction < 1 and not self.told:
                self.told = True
                print(f"{self.label}: {fraction:.1%} done in {spent:.0f} s, {_lasting(left)} left", file=sys.stderr)
            return
        line = f"{self.label}: {int(100 * fraction):3d} %" + f", {_lasting(left)} left" * (left > 1)
        if line != self.shown:
            sys.stderr.write(f"\r{' ' * len(self.shown)}\r{line}")
            self.shown = line
            if fraction >= 1:
                sys.stderr.write(f" in {spent:.1f} s\n")
            sys.stderr.flush()


def _lasting(seconds: float) -> str:
    """A time [s] in words, to about one digit: it is an estimate."""
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 1.5 * size:
            return f"about {seconds / size:.0f} {unit}"
    return f"about {seconds:.0f} s"

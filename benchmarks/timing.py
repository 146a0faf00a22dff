"""Timing of alternatives side by side, because the machine is shared and its clock moves."""

import time
from collections.abc import Callable

import numpy as np


def interleave(
    runs: dict[str, Callable[[], object]], repeats: int, clock: Callable[[], float] = time.perf_counter
) -> dict[str, np.ndarray]:
    """Seconds [repeats] of each, one after the other in every repeat, by the wall clock or by another one."""
    seconds = {name: np.zeros(repeats) for name in runs}
    for i in range(repeats):
        for name, run in runs.items():
            began = clock()
            run()
            seconds[name][i] = clock() - began
    return seconds


def table(title: str, header: tuple[str, ...], rows: list[tuple], notes: tuple[str, ...] = ()) -> str:
    """Rows as text, numbers to three digits."""

    def cell(value) -> str:
        return f"{value:,.0f}" if isinstance(value, (int, float)) and abs(value) >= 1000 else (
            f"{value:.3g}" if isinstance(value, float) else str(value))  # fmt: skip

    cells = [header, *[tuple(cell(v) for v in row) for row in rows]]
    widths = [max(len(row[i]) for row in cells) for i in range(len(header))]
    lines = [" | ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in cells]
    return "\n".join([title, lines[0], "-+-".join("-" * w for w in widths), *lines[1:], *notes, ""])


def verdict(value: float, target: float, *, at_least: bool = False) -> str:
    """`met` or `MISSED`, beside the target."""
    met = value >= target if at_least else value <= target
    return f"{'>=' if at_least else '<='} {target:g}: {'met' if met else 'MISSED'}"

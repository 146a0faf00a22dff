"""Pictures of a scoreboard."""

import json
from pathlib import Path

import matplotlib
import numpy as np

from origami_sim.effects import get

matplotlib.use("Agg")
import matplotlib.pyplot as plt


def figures(board: dict, out: Path) -> None:
    """Writes the pictures of a run into its folder.

    confusion.png; accuracy.png, by d' and stated against observed probability; strength.png, where any is known;
    worked.png, of a case that went well, if there is one.
    """
    worked(board, out)
    confusion(board, out / "confusion.png")
    accuracy(board, out / "accuracy.png")
    strengths(board, out / "strength.png")


def confusion(board: dict, file: Path) -> None:
    truths = sorted(board["confusion"])
    tops = sorted({t for v in board["confusion"].values() for t in v})
    table = np.array([[board["confusion"][t].get(n, 0) for n in tops] for t in truths])
    fig, ax = plt.subplots(figsize=(3.5 + 0.32 * len(tops), 2.8 + 0.28 * len(truths)), layout="constrained")
    ax.imshow(table, cmap="Blues", aspect="auto")
    ax.set_xticks(range(len(tops)), tops, rotation=60, ha="right", fontsize=8)
    ax.set_yticks(range(len(truths)), truths, fontsize=8)
    for i, j in zip(*np.nonzero(table), strict=True):
        dark = table[i, j] > 0.6 * table.max()
        ax.text(j, i, str(table[i, j]), ha="center", va="center", fontsize=8, color="white" if dark else "black")
    ax.set(xlabel="named", ylabel="concealed")
    fig.savefig(file, dpi=130)
    plt.close(fig)


def accuracy(board: dict, file: Path) -> None:
    fig, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    levels = list(board["by_d_wanted"])
    for n, v in enumerate(board["by_d_wanted"].values()):
        share = v["share"]
        error = [[max(0.0, share - v["low"])], [max(0.0, v["high"] - share)]]
        left.errorbar(n, share, error, fmt="o", color="C0", capsize=4)
        left.annotate(f"{v['hits']}/{v['count']}", (n, share), (6, 4), textcoords="offset points", fontsize=8)
    left.axhline(0.9, color="0.6", lw=1, ls="--")
    left.set_xticks(range(len(levels)), [f"{float(v):g}" for v in levels])
    left.set(
        xlabel="detectability d'",
        ylabel="top-1, with 95 % interval",
        ylim=(-0.05, 1.1),
        xlim=(-0.5, max(len(levels), 1) - 0.5),
    )
    stated = [(r["probability"], r["correct"]) for r in board["rows"] if r["correct"] is not None]
    right.plot([0, 1], [0, 1], color="0.6", lw=1, ls="--")
    if stated:
        p, c = np.array(stated, float).T
        index = np.minimum((p * 10).astype(int), 9)
        for b in np.unique(index):
            mine = index == b
            right.plot(p[mine].mean(), c[mine].mean(), "o", color="C1", ms=4 + 2 * np.sqrt(mine.sum()))
            right.annotate(
                str(mine.sum()), (p[mine].mean(), c[mine].mean()), (6, 4), textcoords="offset points", fontsize=8
            )
    right.set(xlabel="stated probability", ylabel="share correct", xlim=(0, 1.05), ylim=(-0.05, 1.1))
    fig.savefig(file, dpi=130)
    plt.close(fig)


def strengths(board: dict, file: Path) -> None:
    """Concealed against recovered strength in units that are typical of each effect, and their ratio against d'."""
    known = [r for r in board["rows"] if r["value"] is not None]
    if not known:
        return
    fig, (left, right) = plt.subplots(1, 2, figsize=(9.5, 4.2), layout="constrained")
    for n, mechanism in enumerate(dict.fromkeys(r["mechanism"] for r in known)):
        mine = [r for r in known if r["mechanism"] == mechanism]
        effect = get(mine[0]["effect"])
        unit = abs(effect.parameter(effect.fitted[0]).typical or 1.0)
        sign = np.sign([r["strength"] for r in mine])
        true = np.abs([r["strength"] for r in mine]) / unit
        known_as = [[np.nan if r[k] is None else r[k] for k in ("value", "low", "high")] for r in mine]
        value, low, high = (sign[:, None] * np.array(known_as, float)).T / unit
        error = np.nan_to_num(np.abs(np.sort([low, high], axis=0) - value))
        style = {"fmt": "os^vD"[n // 10 % 5], "color": f"C{n % 10}", "ms": 4, "lw": 1, "label": mechanism}
        left.errorbar(true, value, error, **style)
        beside = 1.0 + 0.02 * (n % 11 - 5)  # so that mechanisms of the same d' do not hide one another
        right.errorbar([r["d"] * beside for r in mine], value / true, error / true, **style)
    ends = left.get_xlim()
    left.plot(ends, ends, color="0.6", lw=1, ls="--", zorder=0)
    left.set(xscale="log", yscale="log", xlabel="concealed / typical of the effect", ylabel="recovered / typical")
    right.axhline(1.0, color="0.6", lw=1, ls="--", zorder=0)
    right.set(xscale="log", xlabel="detectability d'", ylabel="recovered / concealed, 95 % interval", ylim=(0, 2))
    right.set_xticks([2, 5, 10, 20, 50], ["2", "5", "10", "20", "50"])
    right.set_xticks([], minor=True)
    right.legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    fig.savefig(file, dpi=130)
    plt.close(fig)


def worked(board: dict, out: Path) -> None:
    """The named effect without which most was missed: what was recorded and predicted, and the explanations."""
    right = [r for r in board["rows"] if r["kind"] == "single" and r["top1"] and r["found_site"] is not False]
    for row in sorted(right, key=lambda r: (r["verdict"] != "MECHANISM", -r["refitted"])):
        found = json.loads((out / "cases" / f"{row['case']:04d}" / "diagnosis.json").read_text())
        if found.get("worked"):
            break
    else:
        return
    trace, rows = found["worked"], [c for c in found["candidates"] if not c["failed"]][:7]
    t, recorded, refitted, after = (np.array(trace[k], float) for k in ("times", "recorded", "refitted", "after"))
    fig = plt.figure(figsize=(10.5, 5.0), layout="constrained")
    grid = fig.add_gridspec(2, 2, width_ratios=[1.5, 1.0])
    upper, lower, side = fig.add_subplot(grid[0, 0]), fig.add_subplot(grid[1, 0]), fig.add_subplot(grid[:, 1])
    upper.plot(t, recorded, ".", color="0.5", ms=3, label="recorded")
    upper.plot(t, refitted, color="C1", lw=1, label="refitted, nothing added")
    upper.plot(t, after, color="C0", lw=1, label="with the explanation")
    upper.set(ylabel=f"{trace['component']} [{trace['unit']}]")
    upper.legend(fontsize=7)
    lower.axhspan(-2 * trace["noise"], 2 * trace["noise"], color="0.9", label="noise, 2 sd")
    for predicted, color in ((refitted, "C1"), (after, "C0")):
        lower.plot(t, recorded - predicted, ".", color=color, ms=3, alpha=0.6)
    lower.set(xlabel="time [s], or load step", ylabel=f"recorded less predicted [{trace['unit']}]")
    lower.legend(fontsize=7)
    side.barh(range(len(rows)), [c["probability"] for c in rows], color="C0", alpha=0.4)
    for n, c in enumerate(rows):
        side.annotate(f"{c['label']}  {c['probability']:.2f}", (0.01, n), va="center", fontsize=7)
    side.set(ylim=(len(rows) - 0.4, -0.6), xlim=(0, 1), yticks=[], xlabel="probability")
    place = f" at {row['site']}" if row["site"] else ""
    fig.suptitle(
        f"case {row['case']}, {row['structure']}: {row['mechanism']}{place} concealed, d' = {row['d']:.0f}; "
        f"verdict {row['verdict']}",
        fontsize=9,
    )
    fig.savefig(out / "worked.png", dpi=130)
    plt.close(fig)

"""Fold every pattern of a folder and write the scoreboard of docs/patterns.md.

python benchmarks/patterns.py FOLDER [--out docs/patterns.md] [--pictures FOLDER] [--only WORD ...] [--jobs 1]

Without --out the scoreboard goes to runs/patterns.md; a page that has the two marks is filled between them. A pattern
counts as meant to fold unless its own targets forbid it: they contradict each other at a vertex, or fold curves flat
(`origami_sim.folding.consistency`). Results are kept in --results, so that an interrupted run goes on; --again forgets
them.
"""

import argparse
import json
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from origami_sim.errors import InputError
from origami_sim.folding import fold, read, summarise
from origami_sim.folding.fold import THICKNESS

SUFFIXES = (".svg", ".fold", ".dxf", ".cp", ".opx")
BEGIN, END = "<!-- scoreboard -->", "<!-- end of the scoreboard -->"
HEAD = "| pattern | creases | furthest | rms | strain | panels bend | cross | s | end |"


def folded(path: Path, picture: Path | None) -> dict:
    """Return what became of one pattern, as plain numbers and words."""
    began = time.process_time()
    try:
        pattern = read(path)
    except InputError as e:
        return {"read": False, "reason": str(e).replace(str(path), path.name)}
    try:
        folding = fold(pattern)
    except InputError as e:
        return {"read": True, "target": False, "reason": str(e)}
    found = summarise(folding, THICKNESS)
    if picture is not None:
        from origami_sim.folding.picture import draw

        draw(folding, picture)
    meant = not folding.contradictions and not folding.curved and not folding.unordered
    seconds = time.process_time() - began
    return {
        **found.numbers,
        "read": True,
        "target": True,
        "meant": meant or folding.reached,
        "reached": folding.reached,
        "reason": found.reason,
        "seconds": seconds,
    }


def row(name: str, r: dict) -> str:
    """Return one line of the table."""
    if not r.get("target"):
        return f"| {name} | | | | | | | | {'not read' if not r['read'] else 'no target'}: {r['reason']} |"
    share = f"{r['missed']:.0f} missed: " if r["missed"] else ""
    end = "**folds**" if r["reached"] and not r["crossing_pairs"] else "folds, through itself" if r["reached"] else ""
    return (
        f"| {name} | {r['creases']:.0f} | {r['largest_error_deg']:.1f} | {r['rms_error_deg']:.1f} | "
        f"{r['largest_strain']:.1%} | {r['largest_bend_deg']:.0f} | {r['crossing_pairs']:.0f} | {r['seconds']:.0f} | "
        f"{end or share + r['reason']} |"
    )


def scoreboard(results: dict[str, dict]) -> str:
    """Return the counts and the table as Markdown."""
    known = list(results.values())
    targets = [r for r in known if r.get("target")]
    meant = [r for r in targets if r["meant"]]
    good = [r for r in meant if r["reached"] and not r["crossing_pairs"]]
    through = sum(bool(r["reached"] and r["crossing_pairs"]) for r in meant)

    def share(n, of):
        return f"{n} of {of} ({n / max(of, 1):.0%})"

    return "\n".join(
        [
            "| | |",
            "|---|---|",
            f"| read | {share(sum(r['read'] for r in known), len(known))} |",
            f"| of these, with target angles that do not forbid each other | {share(len(meant), len(targets))} |",
            f"| of those, all creases within 5 degrees and no panel through another | {share(len(good), len(meant))} |",
            f"| the same, of all with a target | {share(len(good), len(targets))} |",
            f"| all creases within 5 degrees, but through itself | {share(through, len(meant))} |",
            "",
            HEAD,
            "|" + "---|" * HEAD.count(" | ") + "---|",
            *(row(name, r) for name, r in sorted(results.items())),
            "",
        ]
    )


def write(page: Path, text: str) -> None:
    """Write the scoreboard as a page of its own, or between the marks of one that is there."""
    before, mark, after = (page.read_text() if page.is_file() else "").partition(BEGIN)
    if mark:
        text = f"{before}{BEGIN}\n{text}\n{END}{after.partition(END)[2]}"
    page.write_text(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, default=Path("runs/patterns.md"))
    parser.add_argument("--results", type=Path, default=Path("runs/patterns.json"))
    parser.add_argument("--pictures", type=Path, help="folder for a picture of each")
    parser.add_argument("--only", nargs="*", default=[], help="words, one of which the path must contain")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--again", action="store_true", help="fold again what is known")
    args = parser.parse_args()
    files = sorted(p for p in args.folder.rglob("*") if p.suffix.lower() in SUFFIXES)
    names = {p.relative_to(args.folder).as_posix(): p for p in files}
    kept, results = args.results, {}
    for file in (kept, args.out):
        file.parent.mkdir(parents=True, exist_ok=True)
    if kept.is_file() and not args.again:
        results = json.loads(kept.read_text())
    todo = {n: p for n, p in names.items() if n not in results and (not args.only or any(w in n for w in args.only))}
    if args.pictures:
        args.pictures.mkdir(parents=True, exist_ok=True)
    # the small ones first, so that a table is there early
    todo = dict(sorted(todo.items(), key=lambda item: item[1].stat().st_size))
    pictures = {n: args.pictures / f"{n.replace('/', '_')}.png" if args.pictures else None for n in todo}
    with ProcessPoolExecutor(args.jobs) as pool:
        jobs = {n: pool.submit(folded, p, pictures[n]) for n, p in todo.items()}
        for name, job in jobs.items():
            results[name] = job.result()
            print(row(name, results[name]), flush=True)
            kept.write_text(json.dumps(results, indent=1))
    write(args.out, scoreboard(results))
    print(f"{args.out}: {len(results)} patterns")


if __name__ == "__main__":
    main()

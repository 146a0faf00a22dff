"""Gives the command line what nobody should, and fails where it does anything but its work or one clear sentence.

    python benchmarks/fuzz_cli.py --count 20000 --seed 1

Each input is a good command with one to three damages: words replaced by nonsense, left out, doubled, moved, taken from
other commands; files named that are of another kind, missing, folders, pipes, empty, damaged. All run in one process,
`main([...])`, in a folder of their own. The long part of a diagnosis, of a study and of a demonstration is left out:
what comes before it is tried. A fault is

- an exception other than the end with an exit code,
- exit code 2 without one line of one sentence, or with anything on standard output,
- exit code 2, and a file of before that is another one now,
- a command that takes longer than `SLOW`.

What faulted is printed and kept in --out. Accepted commands that hold a word which no command can mean are listed under
"accepted", to be looked at.
"""

import argparse
import collections
import contextlib
import hashlib
import io
import os
import random
import shutil
import signal
import tempfile
import time
import traceback
import warnings
from pathlib import Path
from unittest import mock

from fuzz import DEVICE, damaged, hangs, small_run, table_files

SLOW = 30.0
"""Seconds of computing above which a command counts as one that hangs; the slowest honest one takes 8 s."""

NONSENSE = [
    *("", " ", "nan", "-inf", "1e999", "1e-999", "-1", "0", "99999999999999999999", "3 parsec", "1 km", "5%", "-5 %"),
    *(
        "mm",
        "=",
        "==",
        "a=b=c",
        "gap",
        "gap=",
        "=3mm",
        "gap=nan",
        "gap=-3mm",
        "gap=3 V",
        "gap=inf",
        "gap=1e9",
        "field=x",
    ),
    *("gap=1mm:2mm:0", "gap=1mm:2mm:99999999", "gap=1mm:2mm:-3", "gap=2mm,2mm,", "gap=,,", "gap=:::", "layers=1.5"),
    *("layers=true", "--", "-", "-x", "--nonsense", "--out", "--set", "--json", "\x00", "\n", "é", "☃", "a" * 5000),
    *("../../nowhere", "no/such/folder/x", "nothing.csv", "nothing.svg", "nothing.py", "nothing.toml", "nothing"),
    *("folder", "folder.svg", "pipe.svg", "pipe.csv", "empty.toml", "empty.svg", "empty.py", "empty.csv", "junk.svg"),
    *("junk.csv", "junk.toml", "junk.py", "junk", "a.csv", "a.toml", "a.fold", "flap.py", "runs/flap", "flap.py:none"),
    *("flap.py:DURATION", "flap:build", "os:getcwd", "json:loads", "flap", "crease", "box", "x.webp", "x.glb", "x.xyz"),
    *("sidecar", "0x0", "1x1", "99999x99999", "640x", "mass_g,-hinge_deg", "mass_g", "a,b,c", ",", "kind", "wire"),
    *(
        "crease,crease",
        "crease,nonsense",
        "mass_1=1%",
        "mass_1=-1%",
        "clock_delay.clock_delay=5ms",
        "NUL",
        "~",
        "$HOME",
    ),
]
"""Words that go anywhere."""

NEVER = ("nan", "-inf", "1e999", "3 parsec", "nothing.csv", "nothing.svg", "gap=nan", "gap=inf", "gap=3 V",
         "layers=1.5", "nothing", "\x00", "a=b=c", "pipe.svg", "empty.py", "junk.py")  # fmt: skip
"""Of these what no command can mean."""

PLACES = ("--out", "--screenshot")
"""Options that any name will do for."""

COMMANDS = """
run a.fold --set size=5cm
run a.svg --set merge=0.001 --json
run a.cp --settings
run a.svg --out there
run flap.py --set gap=1mm --out there
run flap.py --quasistatic --until 0.1
run flap.py --accuracy 0.1
run box --settings --set gap=2.54mm
run box --calibration box.toml --settings
run flap.py --panels rigid
show flap.py --set gap=1mm --out x.png
show flap.py --save my.toml
show box --json
sweep flap.py --vary gap=1mm,2mm --equilibrium --out there
sweep flap.py --vary gap=1mm:2mm:3 --set field=1mT
sweep flap.py --vary field=1mT,2mT --equilibrium --pareto mass_g,-crease_0_deg
export runs/flap --to x.glb
export runs/flap --to x.obj --at 0.01
export runs/flap --to x.fold --world 0
export runs/flap --to x.png --size 96x64 --colour strain --no-labels
export runs/flap --to x.webp --size 96x64
export runs/flap --to x.gif --start 0 --stop 0.02 --seconds 1 --size 96x64
replay runs/flap --screenshot x.png --time 0.01
compare a.csv --scene pendulum_chain --duration 0.02 --start 0.01 --threshold 5 --out there
compare a.csv --sidecar a.toml --set mass_1=0.1
compare b.csv --model my_flap.py --duration 0.1 --threshold 3
diagnose a.csv --model pendulum_chain --prior mass_1=1% --suspects crease_friction,air_drag --out there
diagnose a.csv c.csv --model pendulum_chain --set mass_1=0.1 --sidecar a.toml --segment 0.1 --thorough
diagnose list.toml --model pendulum_chain --motion quasistatic --prior clock_delay.clock_delay=5ms
diagnose b.csv --model my_flap.py --prior gap=5% --panels auto
effects crease
effects --json
stride crawler --cycles 1
demo --out there
study crawler --samples 4 --cycles 2 --seed 1 --screened 1 --tried 1
study bifold --set section=plate
calibrate bridge --help
calibrate crease curve.csv --out k.toml --plot k.png --angle-unit deg --moment-unit Nmm --linear
calibrate ring-down ring.csv --out k.toml --time-unit s --angle-unit rad --inertia 1e-6
calibrate deflection bend.csv --out k.toml --field-unit mT --deflection-unit mm --length 2cm
calibrate paper notes.txt --out k.toml --take modulus[MPa]=modulus # MPa
calibrate bridge --gap 2mm --thickness 1mm --width 2cm --modulus 1MPa --out k.toml
calibrate again box.toml
calibrate --help
""".strip().splitlines()
"""Good commands, or nearly."""


NOTES = b"The elastomer has a Young's modulus of 1.2 MPa and a density of 970 kg/m^3.\n"
CURVE = b"angle_deg,moment_mNm\n" + b"".join(b"%d,%.5f\n" % (k, 1e-4 * k + 1e-7 * k**2) for k in range(-20, 21))
RING = b"time_s,angle_rad\n"
RING += b"".join(b"%.3f,%.5f\n" % (k / 50, 0.5 ** (k / 20) * (1 - 0.2 * (k % 10))) for k in range(80))


class Accepted(Exception):
    """The front end has let a command pass on to its long part."""


def accept(*_, **__):
    """Stands in for the long part of a command."""
    raise Accepted


LONG = (
    "origami_sim.diagnose.command.diagnose",
    "origami_sim.studies.crawler_maps.run",
    "origami_sim.studies.bifold_tables.run",
    "origami_sim.scenes.crawler.walk",
    "origami_sim.commands.demo.run",
    "origami_sim.view.viewer.open_replay",
    "origami_sim.view.viewer.screenshot",
)
"""What would take minutes or open a window."""


def files(folder: Path) -> dict[str, bytes]:
    """The files that commands may name, by path."""
    good = table_files(folder)
    run = {f"runs/flap/{name}": data for name, data in small_run(folder).items()}
    csv, side = good["table"]["a.csv"], good["table"]["a.toml"]
    return {
        "a.csv": csv, "c.csv": csv + b"\n", "a.toml": side, "b.csv": good["placed"]["a.csv"],
        "b.toml": good["placed"]["a.toml"].split(b"[[drive")[0],
        "map.csv": good["placed"]["map.csv"], "list.toml": good["listing"]["list.toml"], "side.toml": side,
        "a.fold": good["fold"]["a.fold"], "a.svg": good["svg"]["a.svg"], "a.cp": good["cp"]["a.cp"],
        "box.toml": good["calibration"]["a.toml"], "flap.py": DEVICE.replace(b'"2 s"', b'"20 ms"'), "empty.py": b"",
        "my_flap.py": DEVICE, "notes.txt": NOTES, "curve.csv": CURVE, "ring.csv": RING,
        "bend.csv": CURVE.replace(b"angle_deg,moment_mNm", b"field_mt,deflection_mm"),
        "empty.toml": b"", "empty.svg": b"", "empty.csv": b"", "junk.svg": b"\xff\xfe<svg", "junk.csv": b"\x00,1\n\n;",
        "junk.toml": b"a = [[", "junk.py": b"build = 1 / 0\n", "junk": b"\x7fELF", "folder/a.csv": csv, **run,
    }  # fmt: skip


def laid_out(here: Path, content: dict[str, bytes]) -> None:
    """Writes the files, folders and a pipe of a case."""
    shutil.rmtree(here, ignore_errors=True)
    for name, data in content.items():
        (here / name).parent.mkdir(parents=True, exist_ok=True)
        (here / name).write_bytes(data)
    (here / "folder.svg").mkdir()
    for name in ("pipe.svg", "pipe.csv"):
        os.mkfifo(here / name)


def digests(here: Path) -> dict[str, str]:
    """Every file with the digest of its bytes."""
    return {
        str(p.relative_to(here)): hashlib.sha256(p.read_bytes()).hexdigest() if p.is_file() else "no file"
        for p in here.rglob("*")
        if "__pycache__" not in p.parts
    }


def spoilt(words: list[str], draw: random.Random) -> list[str]:
    """The command with one to three damages."""
    words = list(words)
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        how, n = draw.randrange(8), draw.randrange(len(words) + 1)
        if how <= 2 and len(words) > 1:  # the command itself is rarely what is wrong
            words[draw.randrange(1, len(words))] = draw.choice(NONSENSE)
        elif how == 3 and words:
            del words[min(n, len(words) - 1)]
        elif how == 4:
            words.insert(n, draw.choice(NONSENSE))
        elif how == 5:
            other = draw.choice(COMMANDS).split()
            words[n:n] = draw.sample(other, min(len(other), draw.randint(1, 2)))
        elif how == 6 and words:
            k = draw.randrange(len(words))
            word, at = words[k], draw.randrange(len(words[k]) + 1)
            words[k] = word[:at] + draw.choice(("", "=", "-", "9", ".", ":", "e", " ", ",", "é")) + word[at + 1 :]
        elif words:
            words.insert(n, words[draw.randrange(len(words))])
    return words


def ended(words: list[str], here: Path) -> tuple[str, str]:
    """How a command ended, and what is wrong with that."""
    from origami_sim.commands.cli import main

    before, out, err = digests(here), io.StringIO(), io.StringIO()
    code: object = None
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main(words)
    except Accepted:
        return "accepted", ""
    except SystemExit as e:
        code = e.code
    except BaseException:
        return "CRASHED", traceback.format_exc()
    if code != 2:
        fault = "" if isinstance(code, int) and code in {0, 1, 3, *range(10, 18)} else f"exit code {code}"
        return f"code {code}", fault
    said = err.getvalue().strip()
    if said.count("\n") or not said.startswith("origami-sim: ") or not said.endswith(".") or len(said) > 3000:
        return "CRASHED", f"refused with {len(said)} characters: {said[:600]!r}"
    if out.getvalue().strip():
        return "CRASHED", f"refused ({said[:200]}), but printed {out.getvalue()[:300]!r}"
    after = digests(here)
    changed = [name for name, digest in before.items() if after.get(name) != digest]
    return "refused", f"refused ({said[:200]}), but changed {changed[:5]}" if changed else ""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=5_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", default="runs/fuzz_cli", help="where commands that faulted are kept")
    args = parser.parse_args()
    kept, draw, counts, odd = Path(args.out).resolve(), random.Random(args.seed), collections.Counter(), {}
    kept.mkdir(parents=True, exist_ok=True)
    warnings.simplefilter("ignore")
    signal.signal(signal.SIGPROF, hangs)
    faults, began, home = 0, time.perf_counter(), Path.cwd()
    with tempfile.TemporaryDirectory() as place, contextlib.ExitStack() as stack:
        for name in LONG:
            stack.enter_context(mock.patch(name, accept))
        good = files(Path(place))
        here = Path(place) / "up" / "there" / "case"
        for n in range(args.count):
            content = dict(good)
            if draw.random() < 0.3:
                name = draw.choice(list(content))
                content[name] = damaged(content[name], list(good.values()), draw)
            laid_out(here, content)
            os.chdir(here)
            words = spoilt(draw.choice(COMMANDS).split(), draw)
            start = time.process_time()
            signal.setitimer(signal.ITIMER_PROF, 3 * SLOW)  # so that what hangs says where
            how, fault = ended(words, here)
            signal.setitimer(signal.ITIMER_PROF, 0)
            took = time.process_time() - start
            os.chdir(home)
            if not fault and took > SLOW:
                how, fault = "slow", f"took {took:.0f} s"
            counts[words[0][:12] if words else "", how] += 1
            never = [w for w, before in zip(words, ["", *words], strict=False) if w in NEVER and before not in PLACES]
            if how in ("code 0", "accepted") and never and not {"-h", "--help"} & set(words):
                odd.setdefault(never[0], " ".join(words)[:200])
            if fault:
                faults += 1
                print(f"input {n}: {[w[:60] for w in words]}\n{fault[-1500:]}\n", flush=True)
                shutil.copytree(
                    here, kept / f"{args.seed}_{n}", dirs_exist_ok=True, ignore=lambda *_: {"pipe.svg", "pipe.csv"}
                )
    names = sorted({h for _, h in counts})
    for command in sorted({c for c, _ in counts if sum(counts[c, h] for h in names) > 20}):
        print(f"{command:12s}" + "".join(f"{h} {counts[command, h]}  " for h in names if counts[command, h]))
    for word, example in odd.items():
        print(f"accepted {word!r}: {example}")
    print(f"{sum(counts.values())} commands in {time.perf_counter() - began:.0f} s, {faults} faulted")
    return 1 if faults else 0


if __name__ == "__main__":
    raise SystemExit(main())

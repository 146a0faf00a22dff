"""Damages files of every kind that is read, and fails where a reader does anything but return or raise InputError.

    python benchmarks/fuzz.py --count 50000 --seed 1

50,000 inputs (seed 20) took 365 s of two processes and crashed nothing on 2026-11-25.

Kinds: tables with sidecars, listings, calibrations, exports of trackers, FOLD, SVG, DXF, .cp, .opx, OBJ, STL, designs,
files of devices, tables of fields, run folders, earlier diagnoses and sweeps. Each input is one of
a few good files with one to four damages: bytes turned, cut out, doubled, swapped with those of another kind; numbers
replaced by what is no number here; lines moved; brackets nested. What crashed is kept in --out.
"""

import argparse
import collections
import multiprocessing
import random
import re
import shutil
import signal
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path

SLOW = 10.0
"""Seconds of computing above which an input counts as one that hangs; the slowest honest one takes 4 s."""

ENDS = ("x0", "y0", "x1", "y1")
"""What ORIPA calls the ends of a line."""

ODD = [
    *(b"true", b"false", b"null", b"nan", b"-nan", b"inf", b"1e400", b"-1e308", b"1e-320", b"0", b"-1", b"99999999999"),
    *(b"9" * 400, b"''", b'""', b"[]", b"{}", b"[[]]", b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b",,,,", b"=", b"\n\n"),
    *(b"\r", b"1_0", b"0x1f", b"1979-05-27", b"/dev/zero", b"../../..", b"%", b"5 %", b"1 km", b"\xc2\xb5m", b"e"),
    *(b"#", b"[" * 3000, b"{" * 3000, b"a." * 3000, b"M 0 0 L", b"C 1 1", b"z" * 200_000, b"<g>" * 500, b"&x;"),
]


def table_files(folder: Path) -> dict[str, dict[str, bytes]]:
    """Good files by kind: the name under which each is written, and its bytes."""
    import numpy as np

    from origami_sim import miura, triangulate, write_fold
    from origami_sim.pattern import write_mesh
    from origami_sim.recording.stand_in import stand_in_double_pendulum, write_stand_in_sidecar

    csv = stand_in_double_pendulum(folder / "seed.csv", duration=0.06)
    side = write_stand_in_sidecar(csv).read_bytes()
    pattern = miura(2, 2, 0.02, 0.02, 1.0, target_angle=1.0)
    write_fold(pattern, folder / "seed.fold")
    split = triangulate(pattern)
    for suffix in ("obj", "stl"):
        write_mesh(pattern.vertices, split.triangles, folder / f"seed.{suffix}")
    rows = [f"{k},{100 + k}.5,{200 - k}.25,0.9,{120 + k},{210 + k},0.8" for k in range(20)]
    lab = "scorer,net,net,net,net,net,net\nbodyparts,corner,corner,corner,tip,tip,tip\n"
    lab += "coords,x,y,likelihood,x,y,likelihood\n"
    sleap = "track,frame_idx,instance.score,tip.x,tip.y,tip.score\n" + "".join(
        f"a,{k},0.9,{100 + k},{200 - k},0.9\n" for k in range(20)
    )
    run = small_run(folder)
    camera = (
        b"allow_gaps = true\n[time]\nrate_hz = 120.0\n[cameras.side]\norigin = [0.0, 0.0, 0.1]\npixel = [100, 400]\n"
        b'scale = 0.001\nheight = 480\n[channels.tip]\ntrack = "tip"\nkind = "marker_2d"\nnode = 4\n'
    )
    times = np.arange(20) / 120.0
    rows_of = "".join(f"{t:.4f}\t{t:.3f}\t{-t:.3f}\n" for t in times)
    tracker = f"mass_A\nt\tx\ty\n{rows_of}"
    plane = b"[cameras.side]\norigin = [0.0, 0.0, 0.0]\npixel = [0, 0]\n[channels.tip]\n"
    plane += b'track = "mass_A"\nkind = "marker_2d"\nnode = 4\nunit = "m"\n'
    svg = (
        b'<?xml version="1.0"?><!DOCTYPE svg><svg xmlns="http://www.w3.org/2000/svg" width="100mm" height="100mm" '
        b'viewBox="0 0 100 100"><style>.m{stroke:#ff0000}</style><rect x="0" y="0" width="100" height="100" '
        b'fill="none" stroke="#000"/><line class="m" x1="0" y1="0" x2="100" y2="100"/><g transform="rotate(10)"><path '
        b'd="M10 50 C 30 20 60 80 90 50" stroke="#0000ff" opacity="0.5" fill="none"/></g><use href="#a"/></svg>'
    )
    motive = "Format Version,1.23,Capture Frame Rate,120.0,Length Units,Millimeters,Coordinate Space,Global\n\n"
    motive += ",Type,Marker,Marker,Marker\n,Name,tip,tip,tip\n,ID,b,b,b\n,,Position,Position,Position\n"
    motive += "Frame,Time (Seconds),X,Y,Z\n" + "".join(f"{k},{k / 120:.6f},{k},{2 * k},{-k}\n" for k in range(20))
    space = b'[channels.tip]\ntrack = "tip"\nkind = "marker"\nnode = 4\n'
    places = [(x, y, z) for x in range(4) for y in range(4) for z in range(4)]
    field = "x [mm], y [mm], z [mm], Bx [mT], By [mT], Bz [mT]\n"
    field += "".join(f"{x},{y},{z},{0.1 * x},{0.1 * y},{20 - 0.2 * z}\n" for x, y, z in places)
    placed = b'[time]\ncolumn = "t"\n[channels.a]\ncolumn = "a"\nkind = "crease_angle"\nunit = "rad"\ncrease = 0\n'
    placed = b'model = "my_flap.py"\n' + placed + b"[[drive.sources]]\nmagnet = { remanence = '1 T', radius = 0.01, "
    placed += b"length = '1 cm', position = [0, 0, { column = 'z', unit = 'mm' }] }\n[[drive.sources]]\n"
    placed += b"table = { file = 'map.csv', factor = { sine = 1, frequency = 2 } }\n"
    rows_of = "t,a,z\n" + "".join(f"{k / 60:.5f},{0.3 * np.sin(k):.6f},{k}\n" for k in range(20))
    cp = b"1 -200 -200 200 -200\n1 200 -200 200 200\n1 200 200 -200 200\n1 -200 200 -200 -200\n3 -200 -200 200 200\n"
    cp += b"3 -200 200 200 -200\n2 -200 0 200 0\n4 0 -200 10 200\n"
    beans, dxf = "", "0 SECTION 2 HEADER 9 $INSUNITS 70 4 0 ENDSEC 0 SECTION 2 ENTITIES "
    for kind, *ends in (line.split() for line in cp.decode().splitlines()):
        numbers = "".join(f'<void property="{k}"><double>{v}</double></void>' for k, v in zip(ENDS, ends, strict=True))
        kind = f'<void property="type"><int>{kind.replace("4", "0")}</int></void>'
        beans += f'<void index="0"><object class="oripa.OriLineProxy">{kind}{numbers}</object></void>'
        dxf += "0 LINE 8 valley " + "".join(f"{c} {v} " for c, v in zip((10, 20, 11, 21), ends, strict=True))
    opx = f'<?xml version="1.0"?><java><object><void property="lines"><array>{beans}</array></void></object></java>'
    dxf += "0 LWPOLYLINE 8 0 90 4 70 1 10 0 20 0 10 4 20 0 42 0.2 10 4 20 4 10 0 20 4 "
    dxf += "0 ARC 8 0 62 1 10 2 20 2 40 1 50 10 51 300 0 ENDSEC 0 EOF"
    calibration = (Path(__file__).parents[1] / "calibrations" / "box.toml").read_bytes()
    return {
        "table": {"a.csv": csv.read_bytes(), "a.toml": side},
        "listing": {"a.csv": csv.read_bytes(), "side.toml": side,
                    "list.toml": b'name = "x"\nsidecar = "side.toml"\n[[recordings]]\nfile = "a.csv"\nname = "one"\n'},
        "deeplabcut": {"a.csv": (lab + "\n".join(rows) + "\n").encode(), "a.toml": camera},
        "sleap": {"a.csv": sleap.encode(), "a.toml": camera},
        "tracker": {"a.txt": tracker.encode(), "a.toml": plane},
        "motive": {"a.csv": motive.encode(), "a.toml": space},
        "field": {"a.csv": field.encode()},
        "placed": {"a.csv": rows_of.encode(), "a.toml": placed, "map.csv": field.encode()},
        "cp": {"a.cp": cp},
        "opx": {"a.opx": opx.encode()},
        "dxf": {"a.dxf": dxf.replace(" ", "\n").encode()},
        "design": {"a.toml": documented_design()},
        "model": {"a.toml": model_design(folder)},
        "device": {"a.py": DEVICE},
        "earlier": {"diagnosis.json": b'{"verdict": "TIE", "recordings": ["one", "two"]}',
                    "points.jsonl": b'{"key": "a", "row": {"x": 1.0}}\n{"key": "b", "row": {"x": 2.0}}\n'},
        "calibration": {"a.toml": calibration},
        "fold": {"a.fold": (folder / "seed.fold").read_bytes()},
        "svg": {"a.svg": svg},
        "obj": {"a.obj": (folder / "seed.obj").read_bytes()},
        "run": run,
        "stl": {"a.stl": (folder / "seed.stl").read_bytes()},
    }  # fmt: skip


DEVICE = b'''"""A flap."""
from origami_sim import Drive, Sheet, ramp, strip

DURATION = "2 s"


def build(gap="2 mm", field="50 mT", layers=2):
    sheet = Sheet(strip([0.01, 0.02], 0.02), thickness="1 mm", triangulation="center")
    sheet.patch(1, thickness="3 mm", poling=(1, 0, 0)).crease(stiffness="2 mN m/rad", loss_time="3 ms")
    return sheet.fix(panels=[0]), Drive(field=(0, 0, ramp(field, 1.0)))
'''


def documented_design() -> bytes:
    """The design file of the page on them, which is the module's docstring, with waves of every kind."""
    from origami_sim.design import design_file as design

    shown = (line[4:] for line in (design.__doc__ or "").splitlines() if line.startswith("    "))
    text = "\n".join(shown).replace('"2 A"', '{ sine = "2 A", frequency = 2 }')
    return text.replace("[drive]", "[drive]\nvoltage_1 = { times = [0, 1], values = [0, 5] }\n").encode()


def model_design(folder: Path) -> bytes:
    """A design file that holds a model and its parameters."""
    from origami_sim import Sheet, strip, write_design

    sheet = Sheet(strip([0.01, 0.01], width=0.01), thickness=1e-3, material="pdms").fix(panels=[0])
    model = sheet.crease(stiffness=1e-3, loss_time=0.003).build()
    return write_design(folder / "model.toml", model).read_bytes()


def small_run(folder: Path) -> dict[str, bytes]:
    """The files of a run folder."""
    from origami_sim import Sheet, save_run, simulate, strip

    sheet = Sheet(strip([0.01, 0.01], width=0.01), thickness=1e-3, material="pdms")
    sheet.crease(stiffness=1e-3, loss_time=0.003).gravity().fix(panels=[0])
    save_run(folder / "run", simulate(*sheet.build(), duration=0.03), scene="seed", replay=False)
    return {n: (folder / "run" / n).read_bytes() for n in ("manifest.json", "states.npz")}


def readers() -> dict[str, Callable[[Path], object]]:
    """What is done with the files of each kind, in their folder."""
    from origami_sim import load_run, read_pattern, read_recording
    from origami_sim.device.device import device_module
    from origami_sim.device.scene import read_calibration, scene_module, scene_settings
    from origami_sim.diagnose.command import _earlier
    from origami_sim.drive.gridded import FieldTable
    from origami_sim.explore.sweep import _Kept
    from origami_sim.folding import read
    from origami_sim.recording.dataset import read_dataset

    box = scene_module("box")

    def calibrated(folder: Path):
        read_calibration(folder / "a.toml")
        return scene_settings(box, folder / "a.toml")

    def built(path: Path):
        module = device_module(str(path))
        return module.build(module.SETTINGS)

    def earlier(folder: Path):
        known = _earlier(folder)
        if known is not None:
            ", ".join(known)
        return _Kept(folder).rows

    recording = lambda folder: read_recording(folder / "a.csv")  # noqa: E731
    return {
        "table": recording,
        "deeplabcut": recording,
        "sleap": recording,
        "motive": recording,
        "placed": recording,
        "field": lambda folder: FieldTable.read(folder / "a.csv"),
        **{kind: (lambda folder, kind=kind: read(folder / f"a.{kind}")) for kind in ("cp", "opx", "dxf")},
        "design": lambda folder: built(folder / "a.toml"),
        "model": lambda folder: built(folder / "a.toml"),
        "device": lambda folder: built(folder / "a.py"),
        "earlier": earlier,
        "tracker": lambda folder: read_recording(folder / "a.txt"),
        "listing": lambda folder: read_dataset(folder / "list.toml"),
        "calibration": calibrated,
        "run": load_run,
        **{
            kind: (lambda folder, kind=kind: read_pattern(folder / f"a.{kind}"))
            for kind in ("fold", "svg", "obj", "stl")
        },
    }


def damaged(data: bytes, others: list[bytes], draw: random.Random) -> bytes:
    """The file with one to four damages."""
    for _ in range(draw.randint(1, 4)):
        how, size = draw.randrange(11), len(data)
        a = draw.randrange(size + 1)
        b = min(size, a + draw.choice((1, 2, 5, 20, 200)))
        if how == 0:  # a bit
            if size:
                k = draw.randrange(size)
                data = data[:k] + bytes([data[k] ^ (1 << draw.randrange(8))]) + data[k + 1 :]
        elif how == 1:
            data = data[:a] + data[b:]
        elif how == 2:
            data = data[:b] + data[a:b] * draw.choice((1, 1, 3, 50)) + data[b:]
        elif how == 3:  # cut off
            data = data[: draw.choice((a, 0, 1, size // 2, max(0, size - 1)))]
        elif how == 4:
            data = data[:a] + draw.choice(ODD) + data[a:]
        elif how in (5, 6):  # a number
            found = list(re.finditer(rb"-?\d+\.?\d*(?:e-?\d+)?", data))
            if found:
                m = draw.choice(found)
                data = data[: m.start()] + draw.choice(ODD) + data[m.end() :]
        elif how == 7:  # lines change places
            lines = data.split(b"\n")
            i, j = draw.randrange(len(lines)), draw.randrange(len(lines))
            lines[i], lines[j] = lines[j], lines[i]
            data = b"\n".join(lines)
        elif how == 8:  # a word for another
            words = list(re.finditer(rb"[A-Za-z_]{3,}", data))
            if len(words) > 1:
                m, n = draw.sample(words, 2)
                data = data[: m.start()] + n.group() + data[m.end() :]
        elif how == 9:
            data = data[:a] + draw.choice(others)[: draw.choice((10, 1000))] + data[a:]
        else:
            word = draw.choice((b'"', b"'", b",", b"[", b"{", b"(", b"<"))
            data = data.replace(word, draw.choice(ODD), draw.randint(1, 3))
    return data


def hangs(*_) -> None:
    """Ends an input that takes too long, with the place where it is."""
    raise TimeoutError("it hangs")


def work(job: tuple[int, int, str, list[str]]) -> tuple[collections.Counter, list[str]]:
    """Tries `count` inputs from a seed: how they ended by kind, and what crashed."""
    from origami_sim.errors import InputError

    seed, count, out, kinds = job
    draw, ended, crashes = random.Random(seed), collections.Counter(), []
    warnings.simplefilter("ignore")
    signal.signal(signal.SIGPROF, hangs)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        good, read = table_files(folder), readers()
        for kind, files in good.items():  # a good file that is refused would test nothing
            here = folder / "good" / kind
            here.mkdir(parents=True)
            for name, data in files.items():
                (here / name).write_bytes(data)
            read[kind](here)
        every = [d for files in good.values() for d in files.values()]
        for n in range(count):
            kind = draw.choice(kinds or list(good))
            files = dict(good[kind])
            for name in draw.sample(list(files), draw.randint(1, len(files))):
                files[name] = damaged(files[name], every, draw)
            here = folder / "case"
            shutil.rmtree(here, ignore_errors=True)
            here.mkdir()
            for name, data in files.items():
                (here / name).write_bytes(data)
            began, fault = time.process_time(), ""
            signal.setitimer(signal.ITIMER_PROF, 6 * SLOW)  # so that what hangs says where
            try:
                read[kind](here)
                ended[kind, "read"] += 1
            except InputError as e:
                ended[kind, "refused"] += 1
                if "\n" in str(e).strip() or len(str(e)) > 2000:
                    fault = (
                        f"a refusal of {len(str(e))} characters in {str(e).count(chr(10)) + 1} lines: {str(e)[:300]}"
                    )
            except BaseException:
                fault = traceback.format_exc()
            signal.setitimer(signal.ITIMER_PROF, 0)
            if not fault and time.process_time() - began > SLOW:
                fault = f"took {time.process_time() - began:.0f} s"
            if fault:
                ended[kind, "CRASHED"] += 1
                crashes.append(f"{kind}, seed {seed}, input {n}\n{fault}")
                kept = Path(out) / f"{kind}_{seed}_{n}"
                shutil.copytree(here, kept, dirs_exist_ok=True)
    return ended, crashes


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=50_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--kinds", type=lambda text: text.split(","), default=[], help="only these: svg,fold")
    parser.add_argument("--out", default="runs/fuzz", help="where the inputs that crashed are kept")
    args = parser.parse_args()
    began, size = time.perf_counter(), 500
    jobs = [
        (args.seed * 1_000_000 + k, min(size, args.count - k * size), args.out, args.kinds)
        for k in range(-(-args.count // size))
    ]
    ended, crashes = collections.Counter(), []
    Path(args.out).mkdir(parents=True, exist_ok=True)
    with multiprocessing.get_context("spawn").Pool(args.processes) as pool:
        for one, found in pool.imap_unordered(work, jobs):
            ended.update(one)
            for crash in found:
                crashes.append(crash)
                print(crash, flush=True)
    for kind in sorted({k for k, _ in ended}):
        print(f"{kind:12s}" + "".join(f"{how} {ended[kind, how]:6d}   " for how in ("read", "refused", "CRASHED")))
    print(f"{sum(ended.values())} inputs in {time.perf_counter() - began:.0f} s, {len(crashes)} crashed")
    return 1 if crashes else 0


if __name__ == "__main__":
    raise SystemExit(main())

"""Drawing and diagnosing many cases: on this machine or on a Dask cluster."""

import hashlib
import json
import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from origami_proof import DEVELOPMENT
from origami_proof.case import write_json
from origami_proof.freeze import freeze
from origami_sim.errors import InputError

TIMEOUT = 1800.0
"""Longest diagnosis or drawing of one case [s]."""

RUN = "run.json"
SEPARATING, SUGGESTED = "separating", "suggested"
"""Folders within that of a case: with the experiment that separates a confounded pair; with the one that a tie asked
for."""

NEAREST = ".nearest.json"
"""Ending, in the folder of the answers, of what is hardest to tell from a single effect."""

REPEATS = 4
"""A proposed experiment is made as often as the proposal says, if that is not more often than this."""


def generator() -> Path:
    """The truth generator of a checkout.

    Raises:
        InputError: the package was installed without it.
    """
    path = Path(__file__).resolve().parents[1] / "concealed" / "draw.py"
    if not path.is_file():
        raise InputError("the proof needs a checkout of the repository", field="proof/concealed", value="absent")
    return path


def prove(
    out: Path,
    *,
    cases: int,
    seed: int,
    jobs: int = 1,
    cluster: str | None = None,
    structures: Sequence[str] = (),
    kinds: Sequence[str] = (),
    follow: bool = False,
    nearest: bool = False,
    draw_only: bool = False,
    say: Callable[[str], None] = print,
) -> dict:
    """Draws cases, diagnoses them and scores; what is done already is kept.

    Args:
        out: folder of the run: cases/, sealed/, frozen.json, scoreboard.json, scoreboard.txt and figures.
        cases, seed: how many, and which. structures, kinds: only these (default: all).
        jobs: cases at a time. cluster: dask instead, see `workers`.
        follow: make the experiment that a tie proposes, and diagnose again with it.
        nearest: find out which other effect of the catalogue is hardest to tell from each single one, also outside.
        draw_only: no diagnosis.

    Returns:
        the scoreboard, see `score.report`; with `draw_only` what was chosen.

    Raises:
        InputError: another seed or choice in the same folder, no MuJoCo to draw with, a sealed run that goes on with
        another diagnosis, a cluster that is not there.
    """
    from origami_proof.score import report

    if cluster is not None:
        dask(cluster)
    out.mkdir(parents=True, exist_ok=True)
    choice = {"seed": seed, "structures": list(structures), "kinds": list(kinds)}
    stored = out / RUN
    if stored.exists() and json.loads(stored.read_text()) != choice:
        raise InputError("the folder holds another run", field="--out", value=str(out), allowed="a folder of its own")
    write_json(stored, choice)
    sealed = seed >= DEVELOPMENT
    frozen = freeze(out, generator().parent, sealed=sealed, drawing=draw_only)
    say(f"{'sealed' if sealed else 'development'} run: seed {seed}, {cases} cases, in {out}")
    if not draw_only:
        say(f"diagnosis {frozen['diagnosis'][:12]} of {frozen['date']}")
    works = [Work(n, str(out.resolve()), json.dumps(choice), follow, nearest, draw_only) for n in range(cases)]
    missing = any(not (out / "cases" / f"{n:04d}" / "answer.sha256").exists() for n in range(cases))
    if (missing or follow or nearest) and find_spec("mujoco") is None:
        raise InputError("drawing needs MuJoCo: pip install -e proof", field="mujoco", value="absent")
    began = time.perf_counter()
    with workers(cluster, jobs) as each:
        for done, told in enumerate(each(works), 1):
            say(f"{done}/{cases} {told}; {time.perf_counter() - began:.0f} s")
    return choice if draw_only else report(out, cases, say)


# --- one case


@dataclass(frozen=True)
class Work:
    """What a worker needs to know of a case; paths are absolute, on a disk that all workers share."""

    index: int
    out: str
    choice: str
    follow: bool
    nearest: bool
    draw_only: bool


def do(work: Work) -> str:
    """Draws and diagnoses one case, in processes of their own; what was told."""
    out, choice = Path(work.out), json.loads(work.choice)
    folder, answer = out / "cases" / f"{work.index:04d}", out / "sealed" / f"{work.index:04d}.json"
    failed = drawn(work.index, folder, answer, choice)
    if failed:
        return f"case {work.index}: cannot be drawn ({failed}) and is left out"
    if work.nearest:
        compared(answer)
    if work.draw_only:
        return f"case {work.index}: drawn"
    found = diagnosed(folder)
    told = found.get("failed") or f"{found['verdict']} {', '.join(found['chosen'])}"
    if (folder / SEPARATING).exists():
        told += f"; with another experiment {_said(diagnosed(folder / SEPARATING))}"
    if work.follow and found.get("verdict") == "TIE":
        made = followed(folder, answer, found)
        if made:
            told += f"; after '{made}' {_said(diagnosed(folder / SUGGESTED))}"
    sure = found.get("probability")
    return f"case {work.index}: {told}" + (f" (p = {sure:.2f})" if sure is not None else "")


def _said(found: dict) -> str:
    return found.get("failed") or f"{found['verdict']} {', '.join(found['chosen'])}"


def drawn(index: int, folder: Path, answer: Path, choice: dict) -> str | None:
    """The truth, in a process of its own, and the digest of its answer; why there is none, or None."""
    digest = folder / "answer.sha256"
    if digest.exists():
        return None
    command = [sys.executable, str(generator()), "--seed", str(choice["seed"]), "--case", str(index)]
    command += ["--folder", str(folder), "--answer", str(answer)]
    for option in ("structures", "kinds"):
        command += [f"--{option}", *choice[option]] if choice[option] else []
    ran = _run(command)
    if ran is None:
        digest.write_text(hashlib.sha256(answer.read_bytes()).hexdigest())
    return ran


def compared(answer: Path) -> None:
    """Which effect of the catalogue is hardest to tell from a single one, in the folder of the answers.

    Raises:
        InputError: the truth cannot run.
    """
    into = answer.with_suffix(NEAREST)
    if into.exists() or json.loads(answer.read_text())["kind"] not in ("single", "outside"):
        return
    ran = _run([sys.executable, str(generator()), "--nearest", "--answer", str(answer), "--into", str(into)])
    if ran is not None:
        raise InputError(f"the truth generator failed ({ran})", field="answer", value=answer.name)


def diagnosed(folder: Path) -> dict:
    """The diagnosis of a case, in a process of its own; a failure is a result too.

    A verdict counts that stood when the process ended; `ended` says why it did.
    """
    result = folder / "diagnosis.json"
    stood = json.loads(result.read_text()) if result.exists() else None
    if stood is None or ("ended" not in stood and stood.get("unfinished")):  # the battery was interrupted there
        ran = _run([sys.executable, "-m", "origami_proof.case", str(folder)])
        if isinstance(ran, str):
            stood = json.loads(result.read_text()) if result.exists() else None
            write_json(result, {"failed": ran} if stood is None else {**stood, "ended": ran})
    return json.loads(result.read_text())


def followed(folder: Path, answer: Path, found: dict) -> str:
    """Makes the best proposed experiment that the truth can make; its words, or "" if there is none.

    The recordings that there were and the new one go to the folder `suggested` of the case.
    """
    more = folder / SUGGESTED
    note = more / "experiment.json"
    if not note.exists():
        for e in found.get("experiments", []):
            if e["repeats"] > REPEATS:
                continue
            command = [sys.executable, str(generator()), "--realise", e["what"], "--repeats", str(e["repeats"])]
            ran = _run([*command, "--folder", str(folder), "--answer", str(answer), "--into", str(more)])
            if ran is None:
                write_json(note, e)
                break
            if "cannot be made" not in ran:
                raise InputError(f"the truth generator failed ({ran})", field="experiment", value=e["what"])
        else:
            return ""
    return json.loads(note.read_text())["what"]


def _run(command: list[str]) -> str | None:
    """None if it succeeded, else its last line."""
    home = str(Path(__file__).resolve().parents[1])
    path = os.pathsep.join([home, *filter(None, [os.environ.get("PYTHONPATH")])])
    single = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONPATH": path}
    if _STOPPED.is_set():
        raise KeyboardInterrupt
    # in a session of its own: Ctrl-C in a terminal would reach it too, and its last words would pass for a failure
    ran = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=single, start_new_session=True
    )
    _CHILDREN.add(ran)
    try:
        _, said = ran.communicate(timeout=TIMEOUT)
    except subprocess.TimeoutExpired:
        ran.kill()
        ran.communicate()
        return f"longer than {TIMEOUT:.0f} s"
    finally:
        _CHILDREN.discard(ran)
    if _STOPPED.is_set():
        raise KeyboardInterrupt
    return (said.strip().splitlines() or ["no message"])[-1] if ran.returncode else None


_CHILDREN: set[subprocess.Popen] = set()
_STOPPED = threading.Event()
"""Processes under way, and whether they were ended because the battery was interrupted: that is no result of theirs."""


# --- who works


@contextmanager
def workers(cluster: str | None, jobs: int) -> Iterator[Callable[[Sequence[Work]], Iterator[str]]]:
    """A function that does works, as many at a time as there are workers, and yields what was told as each is done.

    Args:
        cluster: None: `jobs` threads here, each of which waits for processes. "local" or "local:N": a Dask cluster on
            this machine. Else the address of a Dask scheduler, e.g. "tcp://10.0.0.1:8786"; its workers share the disk.

    Raises:
        InputError: dask.distributed is not installed, no such cluster, or no scheduler answers.
    """
    if cluster is None:
        _STOPPED.clear()
        with ThreadPoolExecutor(max(1, jobs)) as pool:
            try:
                yield lambda works: _pooled(pool, works)
            except BaseException:
                _STOPPED.set()
                pool.shutdown(wait=False, cancel_futures=True)
                for child in list(_CHILDREN):
                    child.kill()
                raise
        return
    distributed = dask(cluster)
    local = LOCAL.fullmatch(cluster)
    count = int(local[1] or os.cpu_count() or 1) if local else 0
    if local and count < 1:
        raise InputError("a cluster needs workers", field="--cluster", value=cluster, allowed="local:1 or more")
    started = distributed.LocalCluster(n_workers=count, threads_per_worker=1, dashboard_address=None) if local else None
    try:
        client = distributed.Client(started or cluster, timeout=20)
    except OSError as error:
        raise InputError(f"no scheduler answers ({error})", field="--cluster", value=cluster) from None
    try:
        yield lambda works: (f.result() for f in distributed.as_completed(client.map(do, works, pure=False)))
    finally:
        client.close()
        if started is not None:
            started.close()


LOCAL = re.compile(r"local(?::(\d+))?")


def dask(cluster: str):
    """The module dask.distributed.

    Raises:
        InputError: it is not installed, or no cluster has such a name.
    """
    if not LOCAL.fullmatch(cluster) and not re.fullmatch(r"\w+://\S+:\d+", cluster):
        allowed = "local, local:WORKERS, or a scheduler such as tcp://HOST:8786"
        raise InputError("no such cluster", field="--cluster", value=cluster, allowed=allowed)
    try:
        return import_module("distributed")
    except ImportError:
        raise InputError(
            "a cluster needs Dask: pip install -e 'proof[cluster]'", field="--cluster", value=cluster
        ) from None


def _pooled(pool: ThreadPoolExecutor, works: Sequence[Work]) -> Iterator[str]:
    futures = [pool.submit(do, w) for w in works]
    yield from (f.result() for f in as_completed(futures))

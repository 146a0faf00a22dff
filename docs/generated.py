"""Pages of the documentation that are made from the code: effects, command line, Python, settings, sidecars.

A hook of MkDocs (`mkdocs.yml`): the pages exist only while the site is built, so that they cannot be out of date.
"""

import argparse
import importlib
import inspect
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
FAMILIES = {
    "crease": "at creases", "bend": "within panels", "bar": "in bars", "triangle": "on panels", "node": "at nodes",
    "membrane": "in shells", "plate": "in shells", "contact": "on the ground", "tangent": "on the ground",
    "coefficient": "on the ground", "pair": "between panels", "rub": "between panels",
    "drive": "of what is applied", "measurement": "of the measurement",
}  # fmt: skip


def on_files(files, config):
    """Adds the pages, and those that stand elsewhere in the repository."""
    from mkdocs.structure.files import File

    made = {
        "reference/effects.md": effects(),
        "reference/command-line.md": command_line(),
        "reference/python.md": python(),
        "reference/settings.md": settings(),
        "reference/sidecar.md": sidecar(),
        "changes.md": (ROOT / "CHANGELOG.md").read_text().replace("](docs/", "]("),
        "benchmarks.md": (ROOT / "benchmarks" / "README.md").read_text().replace("](../docs/", "]("),
    }
    for name, text in made.items():
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown, page, config, files):
    """Links to files of the repository that are no pages become plain words: the site stands alone."""
    return re.sub(r"\[([^\]]*)\]\((?:\.\./)*(?:benchmarks/(?!README)|proof/)[^)]*\)", r"`\1`", markdown).replace(
        "](../benchmarks/README.md", "](benchmarks.md"
    )


def effects() -> str:
    """The catalogue: laws, parameters with bounds, what each is confused with."""
    from origami_sim.effects import CATALOGUE

    out = ["# Effects", "", f"{len(CATALOGUE)} effects, one file each; those that are switched off are suspects.", ""]
    for where in dict.fromkeys(FAMILIES.values()):
        out += [f"## Effects {where}", ""]
        for e in sorted(CATALOGUE.values(), key=lambda e: e.name):
            if FAMILIES.get(e.family, e.family) != where:
                continue
            out += [f"### {e.name}", "", f"`{e.formula}`", "", f"*Matters:* {e.matters}", ""]
            if e.confused_with:
                out += [f"*Confused with:* {e.confused_with}. *Separated by:* {e.separated_by}", ""]
            out += [f"*Source:* {e.source}", ""]
            if e.parameters:
                out += ["| parameter | | unit | default | bounds | meaning |", "|---|---|---|---|---|---|"]
                for p in e.parameters:
                    low, high = p.bounds
                    numbers = f"{p.default:g} | {low:g} to {high:g}"
                    out.append(f"| `{p.name}` | {cell(p.symbol)} | {cell(p.unit)} | {numbers} | {cell(p.meaning)} |")
                out.append("")
    return "\n".join(out)


def command_line() -> str:
    """Every command with its help."""
    from origami_sim.commands import cli

    parser = cli._parser()
    out = ["# Command line", "", (cli.__doc__ or "").strip(), ""]
    for name, command in _commands(parser).items():
        out += [f"## {name}", "", "```", command.format_help().rstrip(), "```", ""]
        for inner, sub in _commands(command).items():
            out += [f"### {name} {inner}", "", "```", sub.format_help().rstrip(), "```", ""]
    return "\n".join(out)


def _commands(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    found = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
    return dict(found[0].choices) if found else {}


def python() -> str:
    """All names that `from origami_sim import ...` offers, with signatures and docstrings as they are written."""
    import origami_sim

    out = ["# Python", "", "Everything here is imported from `origami_sim`; lengths are metres, angles radians.", ""]
    for name in origami_sim.__all__:
        thing = importlib.import_module(f"origami_sim.{origami_sim._MODULES[name]}")
        if name != "diagnose" or not callable(thing):  # that one is a package which can be called
            thing = getattr(thing, name)
        out += [f"## {name}", "", f"*`origami_sim.{origami_sim._MODULES[name]}`*", ""]
        if not callable(thing):
            out += [f"A {type(thing).__name__} of {len(thing)}: " + ", ".join(f"`{k}`" for k in thing) + ".", ""]
            continue
        out += _described(name, thing)
        if inspect.isclass(thing):
            for method, value in vars(thing).items():
                plain = value.__func__ if isinstance(value, classmethod | staticmethod) else value
                if method.startswith("_") or not inspect.isfunction(plain):
                    continue
                out += [f"### {name}.{method}", "", *_described(method, plain)]
    return "\n".join(out)


def _described(name: str, thing) -> list[str]:
    """Signature and docstring of a function or a class."""
    try:
        signature = f"{name}{inspect.signature(thing)}"
    except (TypeError, ValueError):
        signature = name
    if len(signature) > 100:
        signature = signature.replace("(", "(\n    ", 1).replace(", ", ",\n    ")
    text = inspect.getdoc(thing) or ""
    return (
        ["```python", signature, "```", "", "```text", text, "```", ""] if text else ["```python", signature, "```", ""]
    )


def settings() -> str:
    """What `--set` takes, by device."""
    from origami_sim.device.scene import NAMES, scene_module, scene_settings

    out = ["# Settings of devices", "", "`origami-sim run NAME --set SETTING=VALUE`; every number with its source.", ""]
    for name in NAMES:
        module = scene_module(name)
        out += [f"## {name}", "", (module.__doc__ or "").strip().split("\n\n")[0], ""]
        out += ["| setting | value | range | meaning | source |", "|---|---|---|---|---|"]
        for s in scene_settings(module).values():
            value = f"{s.value:g} {s.unit}" if isinstance(s.value, float) else str(s.value)
            limits = f"{s.range[0]:g} to {s.range[1]:g}" if s.range else " ".join(s.choices)
            out.append(f"| `{s.name}` | {cell(value)} | {limits} | {cell(s.meaning)} | {cell(s.source)} |")
        out.append("")
    return "\n".join(out)


def sidecar() -> str:
    """The annotated example from which the keys are read."""
    from origami_sim.recording import sidecar as module

    text = (module.__doc__ or "").strip()
    head, _, rest = text.partition("\n\n")
    body, _, tail = rest.rpartition("\n\n")
    lines = [line.removeprefix("    ") for line in body.splitlines()]
    return "\n".join(["# Keys of sidecars", "", head, "", "```toml", *lines, "```", "", tail, ""])


def cell(text: str) -> str:
    """A text that may stand in a table."""
    return str(text).replace("|", "\\|").replace("\n", " ")

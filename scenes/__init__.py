"""One script per device: `build` returns the model and what drives it, `run` computes its table and its motion."""

import pkgutil

NAMES = tuple(sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_")))
"""The scenes: every script of this folder."""

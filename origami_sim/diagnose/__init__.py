"""Diagnosis: where simulation and recordings differ, which physics was left out, and how sure that is.

The package itself can be called: `origami_sim.diagnose(model, recordings)` is `diagnose.diagnose`.
"""

import sys
from types import ModuleType

from origami_sim.diagnose.diagnose import diagnose
from origami_sim.diagnose.keep import Keep
from origami_sim.diagnose.options import Options
from origami_sim.hypotheses.hypothesis import Free, Subject, factor
from origami_sim.hypotheses.subject import subject_of
from origami_sim.report.diagnosis import EXIT, VERDICTS, Diagnosis

__all__ = ["EXIT", "VERDICTS", "Diagnosis", "Free", "Keep", "Options", "Subject", "diagnose", "factor", "subject_of"]


class _Callable(ModuleType):
    """The name of the package and that of its function are one to a user."""

    def __call__(self, *args, **options) -> Diagnosis:
        return diagnose(*args, **options)


sys.modules[__name__].__class__ = _Callable

"""Questions of a designer in one call: sweep a device, solve for a number of it, optimise it, and ask for gradients.

    from origami_sim.explore import sweep, solve_for, optimise

    sweep(build, {"gap": ["1 mm", "2 mm", "3 mm"], "field": ["20 mT", "50 mT"]}, {"fold": angle("hinge")})
    solve_for(build, angle("hinge"), "90 deg", {"gap": ("0.5 mm", "6 mm")})
    optimise(build, lambda found: -found.moved("x"), {"friction": (0.1, 0.6)}, way=Way(duration=6.0))

`build` is that of a device file: numbers in, a `Sheet` or (model, parameters) and a drive out. A measure is a function
of what was `Found` there, such as `angle("hinge")` or any of your own.
"""

from origami_sim.explore.found import Found, Way, angle, find, moved, stride
from origami_sim.explore.gradients import Gradient, gradient
from origami_sim.explore.search import Solution, optimise, solve_for
from origami_sim.explore.sweep import Sweep, sweep

__all__ = [
    "Found",
    "Gradient",
    "Solution",
    "Sweep",
    "Way",
    "angle",
    "find",
    "gradient",
    "moved",
    "optimise",
    "solve_for",
    "stride",
    "sweep",
]

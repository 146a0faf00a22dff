"""Discrete-hinge simulator for active origami."""

import warp as _warp

_warp.config.quiet = True
_warp.config.enable_backward = False

"""Discrete-hinge simulator for active origami."""

import warp as _warp

_warp.config.log_level = _warp.LOG_ERROR
_warp.config.enable_backward = False

"""How warp is set up, once, before the first kernel is defined: quiet, and without adjoints."""

import warp

warp.config.log_level = warp.LOG_ERROR
warp.config.enable_backward = False

"""What commands print for machines."""

import json
import math


def print_json(value) -> None:
    """One object on one line; what JSON lacks (infinity, nan) becomes null."""
    print(json.dumps(_finite(value), allow_nan=False))


def _finite(value):
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value

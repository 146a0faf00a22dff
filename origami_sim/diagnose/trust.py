"""How often explanations that are as well supported as this one were right where the truth was known.

Probabilities of candidates are shares among those that were fitted. That the truth is among them is another matter: two
effects may look like one, and not all physics is in the catalogue. How often that happened in sealed runs that were
opened (see `docs/proof.md`) is a logistic curve in the held-out gain, stored with the runs that it comes from.
"""

import json
from pathlib import Path

import numpy as np

FILE = Path(__file__).with_suffix(".json")


def features(gain: float, effects: int) -> np.ndarray:
    """(3,) what trust depends on: held-out gain over the model without an effect, and whether there are several."""
    return np.array([1.0, np.log(max(gain, 1.0)), float(effects > 1)])


def trust(gain: float, effects: int) -> float:
    """Chance that the truth is among explanations with such a held-out gain [log score] and so many effects."""
    stored = json.loads(FILE.read_text())
    return float(1.0 / (1.0 + np.exp(-features(gain, effects) @ stored["coefficients"])))

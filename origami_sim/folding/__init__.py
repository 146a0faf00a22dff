"""Folding of crease patterns to their target angles: as far as they go together, and what stands against it."""

from .fold import Folding, fold
from .reading import read
from .summary import Summary, summarise

__all__ = ["Folding", "Summary", "fold", "read", "summarise"]

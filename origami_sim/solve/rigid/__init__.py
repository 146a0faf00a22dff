"""Rigid panels in reduced coordinates: their motion, equilibria, reactions and sensitivity to a design."""

"""Equilibria: the tangent of any set of effects, Newton's method, load paths, many worlds at once."""

"""Formulas that know no model: materials, the kinematics of hinges and triangles, fields of magnets."""

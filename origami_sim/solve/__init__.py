"""Solvers: batches of worlds and their time step, and what is built on them."""

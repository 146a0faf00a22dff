"""Programs: the kernels of a simulation, written as text from the laws of its effects."""

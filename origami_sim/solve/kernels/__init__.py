"""What runs inside a kernel: the text of the kernels of a set of effects, and the functions that it calls."""

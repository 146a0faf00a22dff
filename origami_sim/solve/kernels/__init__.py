"""What runs inside a kernel: the functions that its text calls."""
